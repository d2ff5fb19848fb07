"""Where does a residual leave the noise? A threshold that follows the residual's own mean and spread in a sliding window.

After Wang, Cao, Li & Huang 2018, doi:10.13700/j.bh.1001-5965.2017.0353, equations (16)-(18). Any units: limits have those of
the residual.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array


def moving_moments(residual: Array, window: int) -> tuple[Array, Array]:
    """Mean (N,) and standard deviation (N,) of equations (18) and (17), each over `window` readings ending at its own.

    As printed: the reading itself is in both, and each square in (17) is about the mean of its own time. nan before the first
    full window, which for the deviation takes 2 window - 1 readings.

    Raises
    ------
    ValueError: a window of fewer than two readings.
    """
    _check(window)
    mean = _trailing_mean(residual, window)
    return mean, np.sqrt(_trailing_mean((residual - mean) ** 2, window))


def adaptive_threshold(
    residual: Array, window: int = 20, deviations: float = 3.0, guard: float = 4.0, floor: float = 0.0
) -> tuple[Array, Array]:
    """Limits low (N,) and high (N,) for a residual (N,): mean +- deviations times the standard deviation, equation (16).

    Unlike (17)-(18) the window ends before the reading that is judged, and a reading beyond `guard` deviations does not enter
    it: as printed a lasting fault is inside its own limits as soon as it fills the window. guard = inf lets all readings in.
    floor is the least standard deviation, such as that of a logger's rounding. nan for the first `window` readings.
    The window follows a slow drift, which stays inside: this finds what comes abruptly.
    White Gaussian residuals leave the limits as often as :func:`false_alarm_rate` says.

    Raises
    ------
    ValueError: a window of fewer than two readings, or a guard inside the limits, by which they would shut themselves.
    """
    _check(window)
    if not guard >= deviations:
        raise ValueError(f"guard of {guard:g} deviations is inside the limits of {deviations:g}")
    low, high = np.full(len(residual), np.nan), np.full(len(residual), np.nan)
    seen = [float(r) for r in residual[:window]]
    for k in range(window, len(residual)):
        mean = math.fsum(seen) / window
        spread = max(math.sqrt(math.fsum((r - mean) ** 2 for r in seen) / (window - 1)), floor)
        low[k], high[k] = mean - deviations * spread, mean + deviations * spread
        value = float(residual[k])
        if abs(value - mean) <= guard * spread:
            seen.append(value)
            del seen[0]
    return low, high


def false_alarm_rate(window: int, deviations: float) -> float:
    """Share of white Gaussian residuals outside :func:`adaptive_threshold` with an open guard: a tail of Student's t.

    A reading and the mean of the `window` before it differ with 1 + 1 / window times the variance of one. A guard far outside
    the limits adds little: its readings are rare.
    """
    from scipy.special import stdtr

    _check(window)
    return 2.0 * float(stdtr(window - 1, -deviations / math.sqrt(1.0 + 1.0 / window)))


def departure(residual: Array, low: Array, high: Array, in_a_row: int = 3) -> int | None:
    """Index of the first of `in_a_row` readings in a row beyond the same limit (N,), or None; nan limits hold no reading out."""
    runs = [_first_run(residual > high, in_a_row), _first_run(residual < low, in_a_row)]
    found = [k for k in runs if k is not None]
    return min(found) if found else None


def _first_run(outside: NDArray[np.bool_], length: int) -> int | None:
    count = 0
    for k, out in enumerate(outside):
        count = count + 1 if out else 0
        if count == length:
            return k - length + 1
    return None


def _trailing_mean(values: Array, window: int) -> Array:
    """Mean (N,) of the `window` values ending at each; nan where one is missing."""
    means = np.full(len(values), np.nan)
    if len(values) >= window:
        means[window - 1 :] = np.lib.stride_tricks.sliding_window_view(values, window).mean(axis=1)
    return means


def _check(window: int) -> None:
    if window < 2:
        raise ValueError(f"a window of {window} readings has no spread")
