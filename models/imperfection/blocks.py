"""Means of readings over blocks: the discrepancy is smooth, so a dozen of them say what thousands of readings say."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .machine.known import Known

Array = NDArray[np.float64]

#: Blocks of a record: half as many leave the intervals as they are to a few per cent (``python -m
#: benchmarks.intervals.imperfect``).
MOST = 12
#: Points and time constants that the pilot looks at.
PILOT_POINTS, PILOT_RATES = 40, 60


@dataclass(frozen=True)
class Part:
    """Sensors on one grid: time (n,) [min], reading (s, n) [degC], noise and resolution (s,) [K]; room (n,) [degC] if logged.

    log_rate (s, 2): the law's own log rate and its deviation, nan where unknown: a posterior that is all but the law's is looked
    for there, however narrow it is. known: what past runs of this machine say; of all parts of a run or of none. averaged: over how
    many readings each is a moving average, which the noise counts.
    """

    time: Array
    reading: Array
    noise: Array
    resolution: Array
    room: Array | None = None
    log_rate: Array | None = None
    known: Known | None = None
    averaged: int = 1

    def some(self, keep: NDArray[np.bool_]) -> "Part":
        """The part with those sensors (s,) alone."""
        if keep.all():
            return self
        log_rate = None if self.log_rate is None else self.log_rate[keep]
        return replace(
            self, reading=self.reading[keep], noise=self.noise[keep], resolution=self.resolution[keep], log_rate=log_rate
        )


@dataclass(frozen=True)
class Blocks:
    """time (m,) [min] and mean (S, m) [degC] of the readings of S sensors in each block; spread (m,) [min^2] of their times.

    noise (S, m) [K^2] is the variance of a mean by the noise of the readings and by the logger's step.
    """

    time: Array
    spread: Array
    mean: Array
    noise: Array
    last: float


def block_means(
    time: Array, reading: Array, noise: Array, resolution: Array, tau: float, skip: bool = True, most: int = MOST
) -> Blocks:
    """Blocks of the readings (S, n) at time (n,) [min], of equal length at first, growing where a record is long against tau [min].

    noise (S,) [K] is a reading's standard deviation, resolution (S,) [K] the logger's step. The first twentieth of a time constant
    is left out where `skip`, of a short record a tenth at most: a probe's own lag and uneven starts live there.
    """
    span = float(time[-1] - time[0])
    kept = time - time[0] >= (min(0.05 * tau, 0.1 * span) if skip else 0.0)
    if kept.sum() < 6:
        kept = np.ones(len(time), dtype=bool)
    t, y = time[kept], reading[:, kept]
    growing = min(max(np.log(max(span, 1e-12) / (1.5 * tau)), 0.0), 3.0)
    even = np.linspace(0.0, 1.0, most + 1)
    edges = t[0] + (t[-1] - t[0]) * (even if growing < 1e-6 else np.expm1(growing * even) / np.expm1(growing))
    block = np.clip(np.searchsorted(edges, t, "right") - 1, 0, most - 1)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    count = np.diff(np.append(first, len(t)))
    middle = np.add.reduceat(t, first) / count
    spread = np.maximum(np.add.reduceat(t * t, first) / count - middle**2, 0.0)
    mean = np.add.reduceat(y, first, axis=1) / count
    # Readings that pass several of the logger's steps within a block average its rounding out; those on one step do not.
    steps = np.maximum.reduceat(y, first, axis=1) - np.minimum.reduceat(y, first, axis=1)
    with np.errstate(all="ignore"):
        passed = np.where(resolution[:, None] > 0.0, steps / resolution[:, None], 0.0)
    rounding = resolution[:, None] ** 2 / 12.0 / (1.0 + passed) ** 2
    floor = (2e-5 * np.ptp(y, axis=1) + 1e-9) ** 2
    variance = np.maximum(noise[:, None] ** 2, floor[:, None]) / count + rounding
    return Blocks(middle, spread, mean, np.maximum(variance, floor[:, None]), float(time[-1]))


def pilot(time: Array, reading: Array) -> Array:
    """Time constants (S,) [min] of the law nearest to readings (S, n) by least squares, at most twice the record's length.

    A guess over the whole record, which no event in it can lead far astray: it sets the scale on which discrepancies are counted.
    """
    at = np.unique(np.linspace(0, len(time) - 1, PILOT_POINTS).round().astype(int))
    # Means of neighbours, so that noise counts for little.
    near = max(len(time) // (2 * PILOT_POINTS), 0)
    total = np.cumsum(np.pad(reading, ((0, 0), (1, 0))), axis=1)
    low, high = np.maximum(at - near, 0), np.minimum(at + near + 1, len(time))
    y = (total[:, high] - total[:, low]) / (high - low)
    y = y - y.mean(axis=1, keepdims=True)
    span = float(time[-1] - time[0])
    taus = np.geomspace(span / 300.0, 2.0 * span, PILOT_RATES)
    shape = -np.expm1(-(time[at] - time[0]) / taus[:, None])
    shape = shape - shape.mean(axis=1, keepdims=True)
    explained = (y @ shape.T) ** 2 / (shape**2).sum(axis=1)
    found: Array = taus[explained.argmax(axis=1)]
    return found
