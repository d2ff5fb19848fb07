"""How much farther runs may go than they did, as their own readings alone say: the past tells no more of it than they."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..blocks import Part
from ..posterior import settle
from ..prior import Imperfection
from .known import modes

Array = NDArray[np.float64]

#: Runs of so much of the longest's length tell with it what was left open at their end.
LONGEST = 0.8
#: Noises by which a sensor must have moved to tell where it goes.
MOVED = 10.0
#: Share of a run whose readings are its beginning, or its end, and how many they are at most.
ENDS, MOST = 0.02, 20
#: Least rate of what is left, over the second half of a run: slower than that it is told from nothing by no record.
SLOWEST = 0.1


@dataclass(frozen=True)
class Rest:
    """What the readings of past runs alone left open: of their limit, below and above that of the shape learnt from them, as shares
    of the rise, and when 95 % are done, at least and at most; length: of the longest of them. All times are x = rate t.
    """

    below: float
    above: float
    soonest: float
    latest: float
    length: float


def left_open(told: Sequence[tuple[Array, float]], rate: float, amplitudes: Array, known: float) -> Rest | None:
    """Of one sensor, from what :func:`ends_alone` tells of each run (4,) and how long it was [min]; None where nothing is open.

    rate [1/min] and amplitudes (k,) are those of its shape, and the covariance of these leaves the share `known` of the rise open.
    """
    longest = max((length for _, length in told), default=0.0)
    of_longest = [of for of, length in told if length > LONGEST * longest and np.isfinite(of).all()]
    if not of_longest:
        return None
    low, high, soonest, latest = np.mean(of_longest, axis=0).tolist()
    x = rate * longest
    came = float(-np.expm1(-x) + (modes(np.array([x])) @ amplitudes)[0])
    sides = np.maximum([1.0 - came * low, came * high - 1.0], 0.0)
    below, above = np.sqrt(np.maximum(sides**2 - known**2, 0.0)).tolist()
    return Rest(below, above, rate * soonest, rate * latest, x) if below or above else None


def ends_alone(parts: Sequence[Part], log_rates: Array, prior: Imperfection) -> Array:
    """Bounds (S, 4) of the limit, over how far a run came, and of the settling time [min], by the readings of each part (S,) alone.

    nan where they tell none, or the sensor hardly moved.
    """
    told = settle(parts, float(np.exp(-np.median(log_rates))), prior)
    found = np.full((len(parts), 4), np.nan)
    for i, part in enumerate(parts):
        reading = part.reading[0]
        few = int(np.clip(ENDS * len(reading), 1, MOST))
        first, last = float(np.median(reading[:few])), float(np.median(reading[-few:]))
        if abs(last - first) > MOVED * part.noise[0]:
            low, high = np.sort((told.steady[i, ::2] - first) / (last - first))
            soonest, latest = told.t95[i, ::2]
            time, risen = part.time - part.time[0], (reading - first) / (last - first)
            found[i] = low, high, soonest, max(latest, _latest(float(time[-1]), _came(time, risen), high))
    return found


def _came(time: Array, risen: Array) -> float:
    """What came over the second half of a run, by a straight line."""
    late = time >= 0.5 * time[-1]
    about = time[late] - time[late].mean()
    return 0.5 * float(time[-1]) * float(about @ risen[late] / (about @ about))


def _latest(length: float, came: float, limit: float) -> float:
    """When [min] 95 % are done at most, of a run that came to 1 and goes on to its limit as one exponential does.

    The farther the limit, the slower is what leads there: `came` of it, at its rate, came over the second half.
    """
    more = limit - 1.0
    if not more > limit / 20.0:
        return 0.0
    rate = max(float(np.log1p(max(came, 0.0) / more)), SLOWEST)
    return length * (1.0 + 0.5 * float(np.log(20.0 * more / limit)) / rate)
