"""Steady state and settling time that a complete record itself shows."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 30
LAST_SHARE = 0.1
DRIFT_SHARE = 0.2
COMPLETE = 0.006


def measured_equilibrium(time: Array, reading: Array) -> tuple[float, float | None] | None:
    """(steady state [degC], settling time [min] after the first reading) of a record that reached equilibrium, or None.

    Complete means that the last fifth drifts by less than 0.6 % of the whole rise. The steady state is the mean of
    the last tenth; settled is the moment from which a running mean stays within 5 % of the rise. The
    mean runs over as many readings as bring the noise well inside that band; the time is None where that is too many.
    """
    n = len(reading)
    if n < FEWEST:
        return None
    tail = n - max(int(n * DRIFT_SHARE), 6)
    steady = float(reading[n - max(int(n * LAST_SHARE), 3) :].mean())
    rise = steady - sorted(reading[:3].tolist())[1]
    if rise == 0.0:  # it ends where it began: nothing to settle
        return None
    at, values = time[tail:] - time[tail:].mean(), reading[tail:] - reading[tail:].mean()
    slope = float(at @ values) / float(at @ at)
    drift = abs(slope) * float(time[-1] - time[tail])
    noise = math.sqrt(max(float(values @ values) - slope**2 * float(at @ at), 0.0) / len(values))
    if drift > COMPLETE * abs(rise) or noise * math.sqrt(12.0 / len(values)) > COMPLETE * abs(rise):
        return None
    width = max(3, math.ceil((6.0 * noise / (0.05 * abs(rise))) ** 2)) | 1
    if width > n // 10:
        return steady, None
    smooth = np.convolve(reading, np.ones(width) / width, mode="valid")
    outside = np.flatnonzero(np.abs(smooth - steady) > 0.05 * abs(rise))
    last = int(outside[-1]) + width // 2 if len(outside) else 0
    return steady, float(time[last + 1] - time[0])
