"""Least squares of laws that are linear but for their rates: sums of exponentials, as several thermal modes make them.

Variable projection (Golub & Pereyra 1973, SIAM J. Numer. Anal. 10(2), in the form of Kaufman 1975): amplitudes are solved for
exactly at every step, so only rates need starting values, and those can be searched.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from .core.kernel import Array

#: Basis (n, m) of a law at given rates (p,), and its derivatives (p, n, m) by each rate.
Basis = Callable[[Array, Array], tuple[Array, Array]]


def rise_from_zero(x: Array, rates: Array) -> tuple[Array, Array]:
    """Y = a (1 - exp(-r x)): a temperature rise that starts at zero."""
    decay = np.exp(-rates[0] * x)
    return (1.0 - decay)[:, None], (x * decay)[None, :, None]


def modes(x: Array, rates: Array) -> tuple[Array, Array]:
    """Y = sum of a_i exp(-r_i x)."""
    decay = np.exp(-np.outer(x, rates))
    slopes = np.zeros((len(rates), len(x), len(rates)))
    for i in range(len(rates)):
        slopes[i, :, i] = -x * decay[:, i]
    return decay, slopes


def settling_modes(x: Array, rates: Array) -> tuple[Array, Array]:
    """Y = c + sum of a_i exp(-r_i x): modes around a steady state."""
    decay, slopes = modes(x, rates)
    constant, none = np.ones((len(x), 1)), np.zeros((len(rates), len(x), 1))
    return np.hstack([constant, decay]), np.concatenate([none, slopes], axis=2)


@dataclass(frozen=True)
class SeparableFit:
    """amplitudes (m,) and rates (p,) with their standard errors, and the residual sum of squares."""

    amplitudes: Array
    rates: Array
    amplitude_errors: Array
    rate_errors: Array
    rss: float


def fit_separable(basis: Basis, x: Array, y: Array, start: Sequence[float] | None = None, modes_count: int = 1) -> SeparableFit:
    """Fit y (n,) at x (n,).

    Rates are searched from `start` and, because a start may lie in another valley, from a grid over all that the data can
    show (`modes_count` rates at once); the best is refined by Gauss-Newton over all parameters in extended precision.

    Raises
    ------
    ValueError: fewer readings than parameters, or no start led to a fit.
    """
    count = len(start) if start is not None else modes_count
    span = float(np.ptp(x))
    grid = np.geomspace(0.2 / span, 0.5 * len(x) / span, 9)
    starts = [np.abs(np.array(start, dtype=float))] if start is not None else []
    starts += [np.array(pair) for pair in combinations(grid, count)]
    if len(x) <= count + basis(x, starts[0])[0].shape[1]:
        raise ValueError(f"{len(x)} readings for {count + basis(x, starts[0])[0].shape[1]} parameters")
    best: tuple[float, Array] | None = None
    for first in starts:
        found = _project(basis, x, y, first)
        if found is not None and (best is None or found[0] < best[0]):
            best = found
    if best is None:
        raise ValueError("no start led to a fit")
    return _refine(basis, x, y, best[1])


def _project(basis: Basis, x: Array, y: Array, start: Array) -> tuple[float, Array] | None:
    """Reduced least squares over log rates from one start: (sum of squares, rates), or None where it fails."""

    def solved(log_rates: Array) -> tuple[Array, Array, Array, Array]:
        phi, slopes = basis(x, np.exp(log_rates))
        q = np.linalg.qr(phi)[0]
        amplitudes: Any = np.linalg.lstsq(phi, y, rcond=None)[0]
        return y - phi @ amplitudes, amplitudes, slopes, q

    def residual(log_rates: Array) -> Array:
        return solved(log_rates)[0]

    def jacobian(log_rates: Array) -> Array:
        _, amplitudes, slopes, q = solved(log_rates)
        moved: Any = -np.einsum("pnm,m->np", slopes, amplitudes) * np.exp(log_rates)
        reduced: Array = moved - q @ (q.T @ moved)
        return reduced

    limits = np.log(start) - 25.0, np.log(start) + 25.0
    try:
        with np.errstate(all="ignore"):
            found = least_squares(residual, np.log(start), jacobian, bounds=limits, xtol=1e-12, ftol=1e-12, gtol=1e-14, max_nfev=60)
    except (ValueError, np.linalg.LinAlgError):
        return None
    rates = np.exp(found.x)
    order = np.argsort(rates)
    return 2.0 * float(found.cost), rates[order] if len(rates) > 1 else rates


def _refine(basis: Basis, x: Array, y: Array, rates: Array) -> SeparableFit:
    """Gauss-Newton over all parameters; residuals in extended precision, so that nearly exact data keep their digits."""
    wide: Any = np.longdouble
    amplitudes = np.linalg.lstsq(basis(x, rates)[0], y, rcond=None)[0]
    parameters: Any = np.concatenate([amplitudes, rates]).astype(wide)
    m = len(amplitudes)

    def residual(p: Any) -> Any:
        return y.astype(wide) - basis(x.astype(wide), p[m:])[0] @ p[:m]

    def jacobian(p: Any) -> Array:
        phi, slopes = basis(x, p[m:].astype(float))
        return np.hstack([phi, np.einsum("pnm,m->np", slopes, p[:m].astype(float))])

    current = residual(parameters)
    for _ in range(60):
        step = np.linalg.lstsq(jacobian(parameters), current.astype(float), rcond=None)[0]
        for halving in range(30):
            trial = parameters + step * wide(0.5) ** halving
            after = residual(trial)
            if after @ after < current @ current:
                break
        else:
            break
        parameters, current = trial, after
    r = np.linalg.qr(jacobian(parameters), mode="r")
    rss = float(current @ current)
    inverse = np.linalg.solve(r, np.eye(len(parameters)))
    errors = np.sqrt((inverse**2).sum(axis=1) * rss / (len(x) - len(parameters)))
    plain = parameters.astype(float)
    return SeparableFit(plain[:m], plain[m:], errors[:m], errors[m:], rss)
