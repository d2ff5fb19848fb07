"""Where does a residual leave the noise? A threshold that follows the residual's own mean and spread in a sliding window.

After Wang, Cao, Li & Huang 2018, doi:10.13700/j.bh.1001-5965.2017.0353, equations (16)-(18). Any units: limits have those of
the residual.
"""

import math

import numpy as np

from ..core.kernel import Array


def adaptive_threshold(
    residual: Array, window: int = 20, deviations: float = 3.0, guard: float = 4.0, floor: float = 0.0
) -> tuple[Array, Array]:
    """Limits low (N,) and high (N,) for a residual (N,): mean +- deviations times the standard deviation, equation (16).

    Unlike (17)-(18) the window ends before the reading that is judged, and a reading beyond `guard` deviations does not enter
    it: as printed a lasting fault is inside its own limits as soon as it fills the window. guard = inf lets all readings in.
    floor is the least standard deviation, such as that of a logger's rounding. nan for the first `window` readings.
    The window follows a slow drift, which stays inside: this finds what comes abruptly.
    White Gaussian residuals leave the limits as often as Student's t says (benchmarks.discovery.clean_stretches).

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


def _check(window: int) -> None:
    if window < 2:
        raise ValueError(f"a window of {window} readings has no spread")
