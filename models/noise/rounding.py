"""What a logger's rounding adds to a reading on average."""

import math

import numpy as np
from scipy.special import ndtr

from ..core.kernel import Array

#: Noise, in steps, below which the rounding of a slow curve leaves a pattern; and the noises that are tried.
QUIET = 0.45
NOISES = (0.05, 0.15, 0.25, 0.35, 0.45)
#: The same where the cells of the readings decide, and the sweeps that this takes.
CELL_NOISES, SWEEPS = (0.02, 0.06, 0.12, 0.2, 0.3), 60
#: A sweep that moves the curve by less, in steps, is the last.
SETTLED = 1e-3


def rounding_bias(curve: Array, step: float, noise: float) -> Array:
    """Mean of a noisy temperature rounded to `step` [K], less the temperature itself: curve (n,) [degC], noise in steps.

    sum (-1)^k q/(pi k) exp(-2 (pi k s)^2) sin(2 pi k m/q); Widrow & Kollar, Quantization Noise, 2008, ch. 6.
    """
    turn = 2.0 * math.pi * curve / step
    bias = np.zeros_like(curve)
    for k in (1, 2, 3):
        bias += (-1.0) ** k * step / (math.pi * k) * math.exp(-2.0 * (math.pi * k * noise) ** 2) * np.sin(k * turn)
    return bias


def cell_residual(reading: Array, curve: Array, tangent: Array, step: float) -> Array:
    """Residuals (n,) [K] of the fit that suits rounded readings best: what a reading was, given its cell, less the curve.

    A least-squares fit takes the middle of each cell for the temperature and is off by a part of a step, in a pattern, where the
    noise does not blur the cells. Here the curve (n,) moves along its tangents (n, P) until it is likeliest that every temperature
    lies in its cell (expectation and maximisation, Dempster, Laird & Rubin 1977), at the noise that does best.
    """
    solve = np.linalg.pinv(tangent)
    best, told = -np.inf, reading - curve
    for noise in CELL_NOISES:
        moved = curve
        for _ in range(SWEEPS):
            mean, value = _in_cell(reading, moved, step, noise * step)
            by = tangent @ (solve @ (mean - moved))
            moved = moved + by
            if np.abs(by).max() < SETTLED * step:
                break
        if value > best:
            best, told = value, mean - moved
    return np.asarray(told)


def _in_cell(reading: Array, curve: Array, step: float, noise: float) -> tuple[Array, float]:
    """Mean temperature (n,) of a normal law about the curve within each reading's cell, and the log-likelihood of all cells."""
    low, high = (reading - 0.5 * step - curve) / noise, (reading + 0.5 * step - curve) / noise
    # The tail that is not cut off by the rounding of floats.
    turn = low > 0.0
    low, high = np.where(turn, -high, low), np.where(turn, -low, high)
    share = np.maximum(ndtr(high) - ndtr(low), 1e-300)
    mean = noise * (np.exp(-0.5 * low**2) - np.exp(-0.5 * high**2)) / (share * math.sqrt(2.0 * math.pi))
    inside = np.clip(curve + np.where(turn, -mean, mean), reading - 0.5 * step, reading + 0.5 * step)
    return inside, float(np.log(share).sum())


def without_rounding(residual: Array, curve: Array, weight: Array, step: float, variance: float) -> Array:
    """Residuals (n,) [K] of a fit of curve (n,) [degC] without the rounding's share in them.

    The noise is taken as it suits the readings best. Where it hides the rounding (variance [K^2] of the residuals), or the curve
    is not good to a step, the residuals are left as they are.
    """
    beyond = math.sqrt(max(variance - step**2 / 12.0, 0.0))
    if step <= 0.0 or beyond > QUIET * step or variance > step**2:
        return residual
    used = weight > 0.0
    tried = [residual, *(np.where(used, residual - rounding_bias(curve, step, noise), 0.0) for noise in NOISES)]
    return min(tried, key=lambda r: float((weight * r * r).sum()))
