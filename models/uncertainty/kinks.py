"""Whether the heat or the cooling of a machine changed while it was read, by a kink that its sensors have at one time.

What a machine of any parts does under a heat that stays is smooth: a sum of exponentials. From a step of the heat or of the loss on
each sensor goes another way, quick ones at once and slow ones later, but all from the same time on.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Blocks that readings are averaged to, at most, and the fewest that say anything.
BLOCKS, FEWEST = 120, 30
#: Rates of the smooth course and of what follows a step, each as so many in the time read.
SMOOTH, STEP = (0.3, 1.0, 3.0, 9.0, 27.0, 81.0), (1.0, 2.5, 6.0)
#: Where a kink is looked for, as shares of the time read.
PLACES = np.linspace(0.12, 0.93, 40)
#: Sensors that are looked at, at most: those that moved most.
SENSORS = 16


@dataclass(frozen=True)
class Kink:
    """When (minutes) it is; how much likelier it is than none: twice the log-likelihood ratio of a sensor, on average; and what
    came of it until the last reading, as share of what the sensors have moved.
    """

    minutes: float
    gain: float
    share: float


def kink(time: Array, reading: Array) -> Kink | None:
    """The likeliest kink in readings (S, n) [degC] at times (n,) [min], none missing; None where there are too few, or one sensor.

    The one that has most of it does not count: that may be a probe.
    """
    count = -(-len(time) // BLOCKS)
    blocks = len(time) // count if count else 0
    if blocks < FEWEST or len(reading) < 2:
        return None
    since = time[: blocks * count].reshape(blocks, count).mean(axis=1) - time[0]
    seen = reading[:, : blocks * count].reshape(len(reading), blocks, count).mean(axis=2)
    rise = np.abs(seen[:, -3:].mean(axis=1) - seen[:, :3].mean(axis=1))
    smooth, steps, ends, places = _columns(tuple(np.round(since / since[-1], 6).tolist()))
    left = seen - (seen @ smooth) @ smooth.T
    amount = left @ steps  # of unit columns
    before = (left**2).sum(axis=1)[:, None]
    gains = blocks * np.log(before / np.maximum(before - amount**2, 1e-12 * before + 1e-300))
    gain = np.sort(gains, axis=0)[:-1].mean(axis=0)
    at = int(np.argmax(gain))
    shares = np.abs(amount[:, at]) * ends[at] / np.maximum(rise, 1e-9)
    share = float(np.average(shares, weights=gains[:, at] + 0.1))
    return Kink(float(time[0] + places[at] * since[-1]), float(gain[at]), share)


def moved_most(reading: Array) -> NDArray[np.intp]:
    """The sensors of a run, SENSORS at most, whose readings (S, n) have moved most: many more would say no more."""
    if len(reading) <= SENSORS:
        return np.arange(len(reading))
    with np.errstate(invalid="ignore"):
        moved = np.abs(np.median(reading[:, -3:], axis=1) - np.median(reading[:, :3], axis=1))
    return np.argsort(-np.where(np.isfinite(moved), moved, -1.0))[:SENSORS]


@lru_cache(maxsize=8)
def _columns(relative: tuple[float, ...]) -> tuple[Array, Array, Array, Array]:
    """Of blocks at such shares of the time read: an orthonormal basis (n, 7) of smooth courses; steps (n, m) beside it, of length
    1; what each is at the last block (m,); where it begins (m,).
    """
    since = np.array(relative)
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(since)), *(np.exp(-rate * since) for rate in SMOOTH)]))
    places, rates = (grid.ravel() for grid in np.meshgrid(PLACES, STEP, indexing="ij"))
    after = np.maximum(since[:, None] - places, 0.0)
    steps = 1.0 - np.exp(-rates * after)
    beside = steps - basis @ (basis.T @ steps)
    length = np.maximum(np.sqrt((beside**2).sum(axis=0)), 1e-12)
    return basis, beside / length, steps[-1] / length, places
