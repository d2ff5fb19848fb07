"""Readings that a logger has averaged over the last few: their noise is one noise seen several times."""

import math
from functools import lru_cache

import numpy as np

from ..core.kernel import Array

#: Windows that are looked for: 2 to this many readings, and no more than this share of a record.
MOST, SHARE = 60, 1.0 / 6.0
#: Log-likelihood by which a moving average must beat white noise and every other smoothing.
SURELY = 6.0
#: Second differences of an average correlate by -1/2 a window later, by nothing in between; half of that must show, and not more.
RETURNED = 0.25
#: Readings and sensors that are enough to see it, and the fewest readings.
ENOUGH, SENSORS, FEWEST = 2000, 16, 48
#: Second differences beyond this many deviations are corners of the curve, not noise; what cutting them leaves of their spectrum.
CORNER, LEAK = 4.0, 0.02
#: Cycles in a reading below which the curve is seen, not the noise.
SLOW = 0.01
#: White noise behind the average (rounding, the logger's own), relative to what the average leaves.
BEHIND = (1e-4, 1e-3, 1e-2, 1e-1)
#: Exponential smoothing, once and twice, that is told apart from it: its memory and its share.
MEMORY, MIXED = tuple(np.linspace(-0.5, 0.98, 20).tolist()), (0.3, 0.9, 0.99, 1.0)
#: Second differences of white noise correlate by -2/3 with their neighbours, of averages by -1/2 or less: no more is looked for.
WHITE = -0.6
#: Spacing of the readings is even when it varies by no more than this share.
EVEN = 0.02


def averaging_window(time: Array, reading: Array) -> int:
    """Readings over which each reading of a run (S, N) at time (N,) is a moving average; 1 where that does not show.

    Such readings have a spectrum with holes at multiples of 1 / window. It is found by Whittle's likelihood of the tapered second
    differences (Brockwell & Davis, Time Series, 1991, section 10.8), where a slow curve leaves nothing.
    """
    reading, time = reading[:SENSORS, -ENOUGH:], time[-ENOUGH:]
    gaps = np.diff(time)
    if len(time) < FEWEST or not np.isfinite(reading).all() or float(np.ptp(gaps)) > EVEN * float(np.median(gaps)):
        return 1
    bend = np.diff(reading, 2, axis=1)
    spread = 1.4826 * np.median(np.abs(bend - np.median(bend, axis=1, keepdims=True)), axis=1, keepdims=True)
    bend = np.clip(bend, -CORNER * spread, CORNER * spread)[spread[:, 0] > 0.0]
    if not len(bend) or (bend[:, 1:] * bend[:, :-1]).sum() < WHITE * (bend**2).sum():
        return 1
    n = bend.shape[1]
    # Neighbours of a tapered spectrum are alike: every second one counts.
    power = np.abs(np.fft.rfft(bend * np.hanning(n), axis=1))[:, _used(n)] ** 2
    inverse, logs, windows = _spectra(n)
    likelihood = -(power.shape[1] * np.log(power @ inverse.T / power.shape[1]) + logs).sum(axis=0)
    best = int(np.argmax(np.where(windows > 1, likelihood, -np.inf)))
    window = int(windows[best])
    if likelihood[best] < likelihood[windows <= 1].max() + SURELY or not _returns(bend, window):
        return 1
    return window


def _returns(bend: Array, window: int) -> bool:
    """Whether second differences (S, n) are alike, turned over, after a window, and neither before nor after two of it.

    Those of a heat that cycles are after half a period, and after a whole one they are as they were.
    """
    series = bend - bend.mean(axis=1, keepdims=True)
    power = float((series**2).sum())
    # A half period may be half a reading longer or shorter; an average is alike up to the reading behind its window.
    periods = [lag for lag in (2 * window - 1, 2 * window, 2 * window + 1) if lag > window + 1]
    lags = (window, *range(2, window - 1), *periods)
    turned, *others = [float((series[:, lag:] * series[:, :-lag]).sum()) / power for lag in lags]
    return turned < -RETURNED and max(np.abs(others)) < RETURNED


def _used(n: int) -> Array:
    """Places of the frequencies that are looked at in a spectrum of n numbers."""
    places = np.arange(1, n // 2, 2)
    return np.asarray(places[places >= SLOW * n])


@lru_cache(maxsize=4)
def _spectra(n: int) -> tuple[Array, Array, Array]:
    """Inverse spectra (G, F) of second differences, sums of their logarithms (G,), and the window of each (G,), 1 for none."""
    angle = 2.0 * math.pi * _used(n) / n
    shapes, windows = [np.ones_like(angle)], [1]
    for memory in MEMORY:
        smooth = (1.0 - memory) ** 2 / (1.0 + memory**2 - 2.0 * memory * np.cos(angle))
        shapes += [share * smooth**times + 1.0 - share for times in (1, 2) for share in MIXED]
        windows += [1] * (2 * len(MIXED))
    for window in range(2, int(min(MOST, SHARE * n)) + 1):
        mean = (np.sin(0.5 * window * angle) / (window * np.sin(0.5 * angle))) ** 2
        shapes += [mean + behind for behind in BEHIND]
        windows += [window] * len(BEHIND)
    grid = np.array(shapes) * ((2.0 * np.sin(0.5 * angle)) ** 4 + LEAK)
    return 1.0 / grid, np.log(grid).sum(axis=1), np.array(windows)
