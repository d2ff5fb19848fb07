"""How likely each kind of change is: the marginal likelihood of the difference between runs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .begun import Begun, Way, weighted_median
from .change import PRIORS, Change
from .numbers import RunNumbers
from .repeats import Mean, Repeats, repeats

Array = NDArray[np.float64]
#: Sensor, logarithm of a size, and its deviation.
Size = tuple[int | None, float, float]

#: Prior deviation of the logarithm of a change, and of one sensor's or the contacts'.
SIZE, LOCAL_SIZE = 0.4, 0.2
#: Points do not all answer to a change alike, nor by nothing else: share of its size by which they differ.
UNLIKE = 0.1
#: Where parts warm each other all rises go as the heat and all rates as the capacity, but a loss moves the rise of the heated part
#: less than that of one far from it: such shares, and how likely each is.
UNLIKE_LOSS = ((UNLIKE, 0.8), (0.2, 0.13), (0.4, 0.07))
#: Probability that the capacities of all parts change alike. That stretches time, exactly and for a machine of any parts: the new
#: run is then a shorter one of the machine as it was. The plate under a pot keeps its own.
STRETCHED = 0.7
#: Errors in common draw the size to the points that are known best, mostly the heated one: how far it is from the middle of all
#: points is not known to so much of itself.
FROM_MIDDLE = 0.7
#: Kinds of change that move every point, and the share of them that may go the other way: a probe in the steam of a pot.
WHOLE, MOST_AGAINST = ("heat", "heat capacity", "loss"), 0.25
#: Pairs of sensors that are looked at as exchanged: those after whose exchange the runs are most alike.
PAIRS = 10
#: A number that a change moves by less than this share of its size says nothing of how large it is.
SHOWN_BY = 0.4


@dataclass(frozen=True)
class Compared:
    """Kinds of change, the likeliest first; the difference (2 S,) of new runs to old with its covariance.

    same_start is the probability, where nothing changed in the machine, that what began elsewhere was in another room; late, that
    it was logged late.
    """

    changes: list[Change]
    difference: Array
    noise: Array
    same_start: float = 1.0
    late: float = 0.0


class _Weighed(NamedTuple):
    """A kind of change under one scatter, begun in one of the `ways`: its log-likelihood with all priors, and its size then."""

    kind: str
    sensors: tuple[int, ...]
    way: int
    log: float
    size: Size | None


def changes(
    old: Sequence[RunNumbers], new: Sequence[RunNumbers], begun: Begun | None = None, by_length: Array | None = None
) -> Compared:
    """What may have changed between runs; by_length (2 S,): how the old numbers hang on the length of a run.

    Raises
    ------
    ValueError: a group without runs.
    """
    if not old or not new:
        raise ValueError("no runs to compare")
    under = repeats(old, new, by_length)
    likeliest = max(under, key=lambda each: each.log)
    pairs = _pairs(likeliest.old, likeliest.new)
    weighed = [_weigh(each, begun, by_length, pairs) for each in under]
    top = max(one.log for some in weighed for one in some)
    shares = [np.exp(np.array([one.log for one in some]) - top) for some in weighed]
    total = sum(float(each.sum()) for each in shares)
    kinds: dict[tuple[str, tuple[int, ...]], list[tuple[float, _Weighed]]] = {}
    for some, each in zip(weighed, shares, strict=True):
        for one, share in zip(some, each.tolist(), strict=True):
            kinds.setdefault((one.kind, one.sensors), []).append((share, one))
    listed = [_change(kind, sensors, some, total) for (kind, sensors), some in kinds.items()]
    nothing = kinds["nothing", ()]
    by_way = np.bincount([one.way for _, one in nothing], weights=[share for share, _ in nothing], minlength=3)
    began = by_way / max(float(by_way.sum()), 1e-300)
    weights = [float(each.sum()) / total for each in shares]
    difference: Array = np.average([each.difference for each in under], axis=0, weights=weights)
    noise: Array = np.average([each.noise for each in under], axis=0, weights=weights)
    return Compared(sorted(listed, key=lambda c: -c.probability), difference, noise, float(began[0]), float(began[2]))


def _weigh(under: Repeats, begun: Begun | None, by_length: Array | None, pairs: Sequence[tuple[int, int]]) -> list[_Weighed]:
    """All kinds of change under one scatter, each begun in each way; pairs are those that may have been exchanged."""
    n, found = len(under.difference) // 2, []
    ways = _ways(begun, n)
    for kind, sensor, directions, size, prior in _hypotheses(n):
        for way, (likely, shift, unsure) in enumerate(ways):
            noise, left = under.noise + np.outer(unsure, unsure), under.difference - shift
            for moved, share, of_these in _answers(kind, directions, by_length):
                log, told = _weighed(kind, moved, size, left, noise, share)
                log += float(np.log(prior * of_these)) + likely + under.log
                found.append(_Weighed(kind, () if sensor is None else (sensor,), way, log, told))
    for pair, log in _exchanges(under.old, under.new, pairs, begun):
        found.append(_Weighed("exchanged", pair, 0, log + under.log, None))
    return found


def _answers(kind: str, directions: Array, by_length: Array | None) -> list[tuple[Array, float, float]]:
    """How the points of a machine may answer to a change: directions, share of its size by which they are unlike, probability."""
    if kind == "loss" and len(directions) > 2:
        return [(directions, share, probability) for share, probability in UNLIKE_LOSS]
    if kind == "heat capacity" and by_length is not None:
        stretched = directions - by_length[:, None]
        return [(stretched, UNLIKE, STRETCHED), (directions, UNLIKE, 1.0 - STRETCHED)]
    return [(directions, UNLIKE, 1.0)]


def _ways(begun: Begun | None, n: int) -> list[Way]:
    return begun.ways() if begun is not None else [(0.0, np.zeros(2 * n), np.zeros(2 * n))]


def _change(kind: str, sensors: tuple[int, ...], some: Sequence[tuple[float, _Weighed]], total: float) -> Change:
    """A kind of change that may have come in `some` ways, each with its share of the total."""
    shares = np.array([share for share, _ in some])
    own = float(shares.sum())
    at, value, deviation = _mixed(shares / max(own, 1e-300), [one.size for _, one in some])
    one, other = (*sensors, None, None)[:2]
    return Change(kind, one if at is None else at, own / total, value, deviation, other=other)


def _pairs(old: Mean, new: Mean) -> list[tuple[int, int]]:
    """Pairs of sensors after whose exchange the means (2 S,) of both sides are most alike, each sensor by itself."""
    n = len(old[0]) // 2
    first, second = np.triu_indices(n, 1)
    variance = np.diag(old[1]) + np.diag(new[1])
    left = (new[0] - old[0]) ** 2 / variance
    crossed = (new[0].reshape(2, 1, n) - old[0].reshape(2, n, 1)) ** 2 / variance.reshape(2, n, 1)
    gain = sum(left[k * n + first] + left[k * n + second] - crossed[k][first, second] - crossed[k][second, first] for k in (0, 1))
    best = np.argsort(-np.asarray(gain))[:PAIRS]
    return list(zip(first[best].tolist(), second[best].tolist(), strict=True))


def _exchanges(
    old: Mean, new: Mean, pairs: Sequence[tuple[int, int]], begun: Begun | None = None
) -> list[tuple[tuple[int, int], float]]:
    """Log-likelihoods, with their priors and those of how they begin then, of pairs of sensors that have each other's numbers in
    the new runs; means (2 S,) of both sides with their covariances.
    """
    n, found = len(old[0]) // 2, []
    for i, j in pairs:
        order = np.arange(2 * n)
        order[[i, j, n + i, n + j]] = j, i, n + j, n + i
        noise = old[1] + new[1][np.ix_(order, order)]
        log = -np.inf
        for likely, shift, unsure in _ways(begun.exchanged(i, j) if begun is not None else None, n):
            difference, all_noise = new[0][order] - old[0] - shift, noise + np.outer(unsure, unsure)
            own = -0.5 * float(np.linalg.slogdet(all_noise)[1] + difference @ np.linalg.solve(all_noise, difference))
            log = float(np.logaddexp(log, own + likely))
        found.append(((i, j), log + float(np.log(PRIORS["exchanged"] / (n * (n - 1) / 2)))))
    return found


def _weighed(kind: str, directions: Array, size: float, left: Array, noise: Array, share: float) -> tuple[float, Size | None]:
    """Log-likelihood of a difference (2 S,) where points answer to a change unlike by a share of its size, and what it is then."""
    first = _size(kind, directions, size, left, noise)
    # A change by a factor of three is not one factor on everything, to a hundredth; a small one is unlike by little.
    amount = abs(first[1]) if first is not None else 0.0
    if share > UNLIKE:  # what is left of the size where points are so unlike
        again = _size(kind, directions, size, left, noise + (share * amount) ** 2 * np.eye(len(left)))
        amount = min(amount, abs(again[1]) if again is not None else amount)
    unlike = noise + (share * amount) ** 2 * np.eye(len(left))
    told = _size(kind, directions, size, left, unlike)
    covariance = unlike + size**2 * directions @ directions.T
    sign, log = np.linalg.slogdet(covariance)
    if sign <= 0 or not _of_every_point(kind, directions, told, left, unlike):
        return -np.inf, told
    if share > UNLIKE and not _all_one_way(directions, first, left, noise):
        return -np.inf, told
    if kind == "loss" and len(left) > 2 and told is not None:
        middle = weighted_median(left * directions[:, 0], np.sqrt(np.diag(noise)))
        told = told[0], told[1], float(np.hypot(told[2], FROM_MIDDLE * (middle - told[1])))
    return -0.5 * float(log + left @ np.linalg.solve(covariance, left)), told


def _of_every_point(kind: str, directions: Array, found: Size | None, left: Array, noise: Array) -> bool:
    """Whether a change of the whole machine is one that its points show: no larger than that of any, and of few the other way.

    Where all errors have a part in common least squares may go beyond all that was measured (Peelle's puzzle); a coupling that
    changed, which moves some points up and others down, was called a heat then.
    """
    if found is None or kind not in WHOLE or len(left) == 2:  # of one sensor there is nothing to go beyond
        return True
    moved = np.abs(directions[:, 0]) > SHOWN_BY
    each = left[moved] / directions[moved, 0]
    apart = np.eye(len(each)) - 1.0 / len(each)
    tolerance = 2.0 * float(np.sqrt((apart @ noise[np.ix_(moved, moved)] @ apart).diagonal().max()))
    size, each = abs(found[1]), each * np.sign(found[1])
    against = float((each < -tolerance).mean())
    return bool(size <= tolerance or (size <= each.max() + tolerance and against <= MOST_AGAINST))


def _all_one_way(directions: Array, found: Size | None, left: Array, noise: Array) -> bool:
    """Whether all rates and rises go the way of a change: more loss leaves no point warmer, however parts warm each other."""
    against = -np.sign(found[1] if found is not None else 0.0) * left * directions[:, 0]
    return not bool((against > 2.0 * np.sqrt(np.diag(noise))).any())


def _mixed(shares: Array, sizes: Sequence[Size | None]) -> tuple[int | None, float | None, float | None]:
    """Sensor, size and deviation of a change that may have come in several ways; None where it has no size."""
    if not shares.any():  # as unlikely in every way as can be told: which way says nothing
        shares = np.full(len(sizes), 1.0 / len(sizes))
    likeliest = sizes[int(np.argmax(shares))]
    told = [(s, one) for s, one in zip(shares, sizes, strict=True) if one is not None]
    if likeliest is None or not told:
        return None, None, None
    mean = sum(s * one[1] for s, one in told)
    variance = sum(s * (one[2] ** 2 + (one[1] - mean) ** 2) for s, one in told)
    return likeliest[0], float(mean), float(np.sqrt(variance))


def _hypotheses(n: int) -> list[tuple[str, int | None, Array, float, float]]:
    """(kind, sensor, directions (2 n, p), prior deviation, prior probability)."""
    ones, none = np.ones(n), np.zeros(n)
    found: list[tuple[str, int | None, Array, float, float]] = [
        ("nothing", None, np.zeros((2 * n, 1)), 0.0, PRIORS["nothing"]),
        ("heat", None, np.concatenate([none, ones])[:, None], SIZE, PRIORS["heat"]),
        ("heat capacity", None, np.concatenate([-ones, none])[:, None], SIZE, PRIORS["heat capacity"]),
        ("loss", None, np.concatenate([ones, -ones])[:, None], SIZE, PRIORS["loss"]),
    ]
    if n > 1:
        for i in range(n):
            own = np.zeros((2 * n, 2))
            own[n + i, 0] = own[i, 1] = 1.0
            found.append(("sensor", i, own, LOCAL_SIZE, PRIORS["sensor"] / n))
        found.append(("contact", None, np.eye(2 * n), LOCAL_SIZE, PRIORS["contact"]))
    return found


def _most_moved(difference: Array, noise: Array, size: float) -> tuple[int, float, float]:
    """The sensor that moved most beside the others, where each may in its own way; factor on its rise, as logarithm; deviation."""
    n = len(difference) // 2
    covariance = np.linalg.inv(np.linalg.inv(noise) + np.eye(2 * n) / size**2)
    value = covariance @ np.linalg.solve(noise, difference)
    deviation = np.sqrt(np.diag(covariance))
    most = int(np.argmax((value**2 / np.diag(covariance)).reshape(2, n).sum(axis=0)))
    return most, float(value[n + most]), float(deviation[n + most])


def _size(kind: str, directions: Array, size: float, difference: Array, noise: Array) -> Size | None:
    """Logarithm of a change and its deviation, all else as it was; of the contacts that of the sensor that moved most."""
    if kind == "nothing":
        return None
    if kind == "contact":
        return _most_moved(difference, noise, size)
    covariance = np.linalg.inv(directions.T @ np.linalg.solve(noise, directions) + np.eye(directions.shape[1]) / size**2)
    value = covariance @ directions.T @ np.linalg.solve(noise, difference)
    return None, float(value[0]), float(np.sqrt(covariance[0, 0]))
