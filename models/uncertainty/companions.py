"""What the sensors of a run, and the rest of its own readings, say against a sensor that is said to have settled.

The law may take a first ripple, a step, the foot of a slow rise or a probe that came loose for a fast machine that is done, and
count all that comes later as the disturbances of a machine at rest.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Time constants after which the law has done 95 %, and how many readings there must be behind them.
DONE, FEWEST = 3.0, 24
#: Stretches of a record whose means tell which way a sensor went.
STRETCHES = 20
#: Within so many kelvin, and within such a share of what a sensor moved, cold sensors begin alike.
APART_K, APART = 1.0, 0.1
#: A part that is no faster than so many times the sensor that moved most is a slow one, where it moved by such a share of that
#: sensor's way, and by so many deviations of its halves.
SLOW, MOVED, CLEAR = 0.4, 0.03, 4.0
#: Share of a record at its beginning, in its middle and at its end whose medians tell how a sensor bends; and the error of a
#: difference of two medians of normal readings, against that of one reading over the root of their number.
ENDS, MEDIANS = 0.1, 1.8
#: Of a rise, what slow parts may add after so many time constants, at first and by which rate that falls (machines of a stranger's
#: hand; tried on ``benchmarks.machines.bodies --late``).
REST, REST_FALLS = 0.5, 0.5


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


def went_back(time: Array, reading: Array, noise: Array, way: float) -> tuple[Array, Array]:
    """How far readings (S, n) [K] at time (n,) went against a `way` (1: warmer, -1: colder), and when they turned [min].

    By means over a twentieth of the record, of a noise (S,) [K] of a reading; 0 where that is no more than chance, and nan for a
    time where they have not come back by more than chance since.
    """
    edges = np.unique(np.linspace(0, len(time), min(STRETCHES, len(time)) + 1).astype(int))
    count = np.diff(edges)
    means = way * np.add.reduceat(reading, edges[:-1], axis=1) / count
    chance = CLEAR * math.sqrt(2.0) * noise / math.sqrt(count.min())
    least = means.argmin(axis=1)
    at = np.arange(len(means)), least
    away, since = means[:, 0] - means[at], means[:, -1] - means[at]
    went = away > chance
    turned = went & (since > chance)
    middle = np.add.reduceat(time, edges[:-1]) / count - time[0]
    return np.where(went, away, 0.0), np.where(turned, middle[least], np.nan)


def halves(time: Array, reading: Array, noise: Array) -> tuple[Array, Array, Array]:
    """(ways in the first and the second half of a record, their errors), each (S,) [K], of readings (S, n) with a noise (S,)."""
    share = (time - time[0]) / (time[-1] - time[0])
    parts = share <= ENDS, np.abs(share - 0.5) <= 0.5 * ENDS, share >= 1.0 - ENDS
    first, middle, last = (np.median(reading[:, own], axis=1) if own.any() else np.full(len(reading), np.nan) for own in parts)
    fewest = max(min(int(own.sum()) for own in parts), 1)
    return middle - first, last - middle, MEDIANS * noise / np.sqrt(fewest)


def slow_parts(early: Array, late: Array, error: Array, span: Array) -> NDArray[np.bool_]:
    """Which sensors (S,) are parts so slow against the one that moved most that they still take heat: by their `halves` and the
    length `span` (S,) [min] of what was read of each.

    Of an exponential the ratio of the ways is exp(-rate span / 2): the rate of a slow part is looked at from above, by its errors,
    and that of the other from below.
    """
    moved = early + late
    most = int(np.nanargmax(np.abs(moved))) if np.isfinite(moved).any() else 0
    way, doubt = np.sign(moved[most]), CLEAR * error
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = -np.log((way * late - doubt) / np.maximum(way * early + doubt, 1e-9)) / span
        fast = -np.log((way * late[most] + doubt[most]) / (way * early[most] - doubt[most])) / span[most]
        return np.asarray((way * moved > MOVED * np.abs(moved[most])) & (rate < SLOW * fast) & (fast > 0.0))


def slow_paces(of: Sequence[tuple[Array, Array, Array]]) -> list[tuple[Array, Array]]:
    """Of blocks (time (n,), readings (S, n), noise (S,)), each (S,) [K/min]: how fast the :func:`slow_parts` went on in the second
    half of what was read, nan of the others; and how fast each sensor did at its end, at most.
    """
    some = [block for block in of if len(block[1])]
    if not some:
        return [(np.zeros(0), np.zeros(0)) for _ in of]
    early, late, error = (np.concatenate(part) for part in zip(*(halves(*block) for block in some), strict=True))
    span = np.concatenate([np.full(len(reading), time[-1] - time[0]) for time, reading, _ in some])
    pace = np.where(slow_parts(early, late, error, span), late / (0.5 * span), np.nan)
    ends = np.cumsum([len(reading) for _, reading, _ in of])[:-1]
    return list(zip(np.split(pace, ends), (fastest_at_end(*block) for block in of), strict=True))


def fastest_at_end(time: Array, reading: Array, noise: Array) -> Array:
    """How fast (S,) [K/min] readings (S, n) with a noise (S,) may at most have gone on, from 70 to 80 % of a record to its end."""
    share = (time - time[0]) / (time[-1] - time[0])
    parts = np.abs(share - 0.75) <= 0.5 * ENDS, share >= 1.0 - ENDS
    fewest = min(int(own.sum()) for own in parts)
    if not fewest:
        return np.full(len(reading), np.inf)
    before, last = (np.median(reading[:, own], axis=1) for own in parts)
    way = np.abs(last - before) + CLEAR * MEDIANS * noise / math.sqrt(fewest)
    return np.asarray(way / (time[parts[1]].mean() - time[parts[0]].mean()))


def still_ahead(moved: Array, ahead: Array, unknown: NDArray[np.bool_], pace: Array, most: float) -> tuple[float, float]:
    """(how far [K], at which rate [1/min]) that sensor goes on, of those (S,) that have a pace, which may go farthest.

    moved, ahead (S,) [K] are how far each has gone and has still to go, pace (S,) [K/min] how fast it does; where that is not
    known, it may come as far as `most` [K].
    """
    far = np.abs(np.nan_to_num(ahead))
    far = np.where(unknown | ~np.isfinite(ahead), np.maximum(far, most - np.abs(moved)), far)
    k = int(np.where(np.isfinite(pace), far, -1.0).argmax())
    return float(np.sign(pace[k]) * far[k]), float(abs(pace[k]) / max(far[k], 1e-9))


def settled_beside(share: Array, rate: float) -> Array:
    """When (S,) [min] 95 % are done of a rise that is over, to which a slow part adds such a share (S,) of it at `rate` [1/min]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.maximum(np.log(share / (0.05 * (1.0 + share))), 0.0) / rate)


def risen_before(first: Array, last: Array, coolest: float) -> Array:
    """How much warmer (S,) [K] than the coolest, another sensor or the room [degC], sensors were where the record begins.

    first, last (S,) [degC] are where they begin and end; within APART_K, and a share APART of that way, they began alike.
    """
    return np.asarray(np.maximum(first - coolest - np.maximum(APART_K, APART * np.abs(last - first)), 0.0))


def all_before(
    first: Sequence[Array], last: Sequence[Array], members: Sequence[NDArray[np.bool_]], rooms: Sequence[float]
) -> list[Array]:
    """:func:`risen_before` of blocks of sensors (S,), of which members are one machine's; rooms [degC] that are logged."""
    coolest = [float(one[mine].min()) for one, mine in zip(first, members, strict=True) if mine.any()]
    least = float(np.nanmin([np.inf, *coolest, *rooms]))
    return [risen_before(one, then, least) for one, then in zip(first, last, strict=True)]


def rest_of_warm(before: Array, shown: Array, turns: Array) -> Array:
    """How far [K] beyond its limit by the law that of a sensor may lie which had risen `before` (S,) [K] where its record begins.

    Such a machine was perhaps on its way, and slow parts of the whole rise are no part of the law's rise `shown` (S,) [K], whose
    last part the record is. turns (S,): time constants that were read; those before are what the law needs for `before`.
    """
    warm = (before > 0.0) & (shown > 0.0)
    rise = np.where(warm, shown, 1.0)
    whole = np.log1p(np.where(warm, before, 0.0) / rise) + turns
    return np.where(warm, REST * np.exp(-REST_FALLS * whole) * before, 0.0)
