"""What the sensors of a run, and the rest of its own readings, say against a sensor that is said to have settled.

The law may take a first ripple, a step, the foot of a slow rise or a probe that came loose for a fast machine that is done, and
count all that comes later as the disturbances of a machine at rest.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Time constants after which the law has done 95 %, and how many readings there must be behind them.
DONE, FEWEST = 3.0, 24


def faster(rate: Array, span: float, median: float, slowest: float, until: float) -> Array:
    """How many times as fast (S,) a sensor of rate (S,) [1/min] would be as the others of its run, where these have not settled.

    As the others' median, from `median` times on; as the slowest of them from `slowest` times on, if it is said to be done itself;
    nan where neither is so. span [min] is that of the readings; others have settled once they were read for `until` time constants.
    """
    found = np.full(len(rate), np.nan)
    known = np.isfinite(rate)
    if known.sum() < 2:
        return found
    for i in np.flatnonzero(known).tolist():
        others = np.delete(rate, i)
        others = others[np.isfinite(others)]
        middle, least = float(np.median(others)), float(others.min())
        if rate[i] > median * middle and middle * span < until:
            found[i] = rate[i] / middle
        elif rate[i] > slowest * least and least * span < until and rate[i] * span > DONE:
            found[i] = rate[i] / least
    return found


def moved_since(time: Array, reading: Array, rate: Array, ahead: Array) -> Array:
    """How far readings (S, n) [K] at time (n,) [min] have moved since 95 % were done, beyond what the law still had ahead (S,) [K].

    From the first third of what was read since then to the last. rate (S,) [1/min]; ahead is the way from the beginning to the
    limit. nan where too little was read since.
    """
    found, since = np.full(len(rate), np.nan), time - time[0]
    for i in np.flatnonzero(np.isfinite(rate) & np.isfinite(ahead)).tolist():
        first = int(np.searchsorted(since, DONE / rate[i]))
        third = (len(time) - first) // 3
        if 3 * third < FEWEST:
            continue
        limit = reading[i] + ahead[i] * np.exp(-rate[i] * since)
        found[i] = np.median(limit[len(time) - third :]) - np.median(limit[first : first + third])
    return found
