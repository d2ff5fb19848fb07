"""What a logger's rounding adds to a reading on average."""

import math

import numpy as np

from ..core.kernel import Array

#: Noise, in steps, below which the rounding of a slow curve leaves a pattern; and the noises that are tried.
QUIET = 0.45
NOISES = (0.05, 0.15, 0.25, 0.35, 0.45)


def rounding_bias(curve: Array, step: float, noise: float) -> Array:
    """Mean of a noisy temperature rounded to `step` [K], less the temperature itself: curve (n,) [degC], noise in steps.

    sum (-1)^k q/(pi k) exp(-2 (pi k s)^2) sin(2 pi k m/q); Widrow & Kollar, Quantization Noise, 2008, ch. 6.
    """
    turn = 2.0 * math.pi * curve / step
    bias = np.zeros_like(curve)
    for k in (1, 2, 3):
        bias += (-1.0) ** k * step / (math.pi * k) * math.exp(-2.0 * (math.pi * k * noise) ** 2) * np.sin(k * turn)
    return bias


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
