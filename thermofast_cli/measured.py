"""Steady state and settling time that a complete record itself shows."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 30
LAST_SHARE = 0.1
DRIFT_SHARE = 0.2
COMPLETE = 0.012


def measured_equilibrium(time: Array, reading: Array) -> tuple[float, float] | None:
    """(steady state [degC], settling time [min] after the first reading) of a record that reached equilibrium, or None.

    Complete means that the last fifth drifts by less than 1.2 % of the whole rise. The steady state is the mean of
    the last tenth; settled is the moment from which a running mean stays within 5 % of the rise.
    """
    n = len(reading)
    if n < FEWEST:
        return None
    tail = slice(n - max(int(n * DRIFT_SHARE), 6), n)
    steady = float(reading[n - max(int(n * LAST_SHARE), 3) :].mean())
    rise = steady - float(np.median(reading[:3]))
    slope, _ = np.polyfit(time[tail], reading[tail], 1)
    residual = reading[tail] - np.polyval(np.polyfit(time[tail], reading[tail], 1), time[tail])
    drift = abs(float(slope)) * float(time[-1] - time[tail][0])
    noise = float(residual.std())
    if drift > COMPLETE * abs(rise) or noise * math.sqrt(12.0 / len(residual)) > COMPLETE * abs(rise):
        return None
    width = max(3, min(n // 50, 15)) | 1
    smooth = np.convolve(reading, np.ones(width) / width, mode="valid")
    outside = np.flatnonzero(np.abs(smooth - steady) > 0.05 * abs(rise))
    if not len(outside):
        return None
    k = int(outside[-1]) + width // 2
    if k + 1 >= n - width // 2:
        return None
    return steady, float(time[min(k + 1, n - 1)] - time[0])
