"""What is different in a machine since other runs of it: heat, heat capacity, loss, one sensor, two exchanged, the contacts, the
room, or nothing.

Of every run the base law gives each sensor a rate b (loss over heat capacity) and a rise R (heat over loss), in logarithms. A
change of the heat moves all rises, of the heat capacity all rates, of the loss rates up and rises down, of one sensor its own
numbers, of the contacts between parts anything; of two that were exchanged each has the other's numbers; another room moves
neither, but where the runs begin. Each is a line, a plane or a place
through no change; how likely each is follows from the marginal likelihood of the difference, run-to-run scatter and the errors of
the fits counted, sizes unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ..core.kernel import followed
from ..joint import LEVEL, RATE, START, Fit, fit_model
from ..observations import Observations

Array = NDArray[np.float64]

#: Deviations from run to run of the logarithms of rate and rise: common to all sensors, and of each beside the others; they count
#: as so many runs where there are more. Of simulated and real repeats; see docs/figures.md.
COMMON = 0.06, 0.05
#: Correlation of the two, because it is mostly the loss that is not the same: a fan, a draught, a cover.
TOGETHER = -0.5
OWN = 0.015, 0.015
RUNS_ASSUMED = 3.0
#: Prior deviation of the logarithm of a change, and of one sensor's or the contacts'.
SIZE, LOCAL_SIZE = 0.4, 0.2
#: Points do not all answer to a change alike, nor by nothing else: share of its size by which they differ.
UNLIKE = 0.1
#: Where parts warm each other all rises go as the heat and all rates as the capacity, but a loss moves the rise of the heated part
#: less than that of one far from it: such shares, and how likely each is.
UNLIKE_LOSS = ((UNLIKE, 0.8), (0.2, 0.13), (0.4, 0.07))
#: Errors in common draw the size to the points that are known best, mostly the heated one: how far it is from the middle of all
#: points is not known to so much of itself.
FROM_MIDDLE = 0.7
#: Kinds of change that move every point, and the share of them that may go the other way: a probe in the steam of a pot.
WHOLE, MOST_AGAINST = ("heat", "heat capacity", "loss"), 0.25
#: Prior probabilities: three tests in four are repeated without anything having changed.
PRIORS = {"nothing": 0.74, "heat": 0.06, "heat capacity": 0.06, "loss": 0.06, "sensor": 0.035, "contact": 0.035, "exchanged": 0.01}
#: Pairs of sensors that are looked at as exchanged: those after whose exchange the runs are most alike.
PAIRS = 10
#: A room is another one from this difference [K] on, or from so many deviations of the old runs' rooms: labs hold them to 1 or 2 K.
ROOM, ROOM_DEVIATIONS = 3.0, 3.0
#: Deviation [K] of a room that nobody logged, over a run: of a straight line, and of a swing there and back.
DRIFT = 0.3, 0.15
#: Share of that which a logged room leaves unknown, and of what its course moved each sensor: parts that warm each other follow it
#: later and less than each by itself.
LOGGED_DRIFT, LOGGED_COURSE = 0.3, 0.3
#: Deviation [K] of the air beside a sensor from run to run, beside the room's.
LOCAL = 0.1
#: Times that a run is fitted again without what its logged room did.
FOLLOWED = 2
#: Deviation [K] between the rooms of two runs where nobody logged them: so far a warm start is not known.
ROOM_BETWEEN = 0.7
#: Prior probability that a run which begins elsewhere began warm, and not in another room; where the room is logged, the other way.
WARM = 0.2
#: Prior probability that a run of which one sensor began elsewhere is one that was logged late.
LATE = 0.2
#: Prior deviation [K] of what a probe that is off tells beside the truth.
PROBE = 2.0
#: Deviation [K] of where sensors begin beside each other from run to run; of a machine that is warm, as share of how warm it is.
BESIDE, UNEVEN = 0.3, 0.5


@dataclass(frozen=True)
class RunNumbers:
    """Logarithms of rate and rise (2 S,) of the sensors of a run, rates first, with their covariance (2 S, 2 S).

    runs: of how many runs they are the mean, as those of a model learnt from several; the covariance is that of one.
    """

    values: Array
    covariance: Array
    runs: int = 1

    @classmethod
    def of(cls, fit: Fit, wider: float, drift: float | None = None) -> "RunNumbers | None":
        """Of a fit of the base law, None where a sensor does not rise; `wider` multiplies its errors, `drift` those by DRIFT.

        Without a drift the errors are those of the fit alone, and nothing of the air around the machine.
        """
        n, model = fit.run.sensors, fit.model
        rate, level, start = (np.asarray(fit.values[key], dtype=float) for key in (RATE, LEVEL, START))
        rise = level - start
        if not np.all(np.isfinite(rise)) or np.any(rise == 0.0):
            return None
        values, covariance = np.concatenate([np.log(rate), np.log(np.abs(rise))]), np.zeros((2 * n, 2 * n))
        at = [model.column(key) for key in (RATE, LEVEL, START)]
        courses = _courses(fit.run)
        moved = np.zeros((len(courses), 2 * n))
        for i in range(n):
            slopes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 / rise[i], -1.0 / rise[i]]])
            own = slopes @ fit.joint_covariance(i)[np.ix_(at, at)] @ slopes.T * wider**2
            covariance[np.ix_([i, n + i], [i, n + i])] = own
            moved[:, [i, n + i]] = _by_courses(fit, courses, i, at) @ slopes.T
        # What bends a fit bends those of all sensors alike, along the ridge on which a short record leaves rate and rise.
        errors = np.sqrt(np.diag(covariance))
        bent = np.concatenate([errors[:n], -errors[n:]])
        covariance += np.outer(bent, bent)
        if drift is not None:
            covariance += _of_the_air(moved, drift)
        return cls(values, covariance)


def _of_the_air(moved: Array, drift: float) -> Array:
    """Covariance (2 n, 2 n) by the air around a machine, from what its `_courses` move (courses, 2 n): the room's moves all sensors
    alike, that beside each only its own.
    """
    still, drifts, logged = moved[:1], moved[1 : 1 + len(DRIFT)], moved[1 + len(DRIFT) :]
    room = np.vstack([drift * drifts, LOGGED_COURSE * logged])
    beside = np.vstack([still, LOGGED_DRIFT * drifts])
    own = np.kron(np.ones((2, 2)), np.eye(moved.shape[1] // 2))
    covariance: Array = room.T @ room + own * (beside.T @ beside)
    return covariance


def without_room(run: Observations) -> Fit:
    """The fit of the base law to a run without what its logged room does to each sensor, which follows it at its own rate."""
    fit = fit_model(run)
    for _ in range(FOLLOWED if run.ambient else 0):
        course = _courses(run)[-1]
        rates = np.asarray(fit.values[RATE], dtype=float)
        fit = fit_model(replace(run, reading=run.reading - np.array([_follows(run, course, rate) for rate in rates])))
    return fit


def _courses(run: Observations) -> list[Array]:
    """Courses (N,) [K] of the air around a machine: otherwise by LOCAL, those of DRIFT, and the one logged beside its mean."""
    since = (run.time - run.time[0]) / max(run.span, 1e-9)
    logged = [] if run.sink_c is None else [next(iter(run.ambient.values())) - run.sink_c]
    return [np.full_like(since, LOCAL), DRIFT[0] * since, DRIFT[1] * np.sin(np.pi * since), *logged]


def _follows(run: Observations, course: Array, rate: float) -> Array:
    """What a room's course (N,) [K] does to a sensor (N,) [K] that begins where it does."""
    out = np.empty((1, len(course)))
    followed(run.time, np.ascontiguousarray(course), np.array([1.0 / rate]), out)
    return np.asarray(out[0] - course[0] * np.exp(-rate * (run.time - run.time[0])))


def _by_courses(fit: Fit, courses: Sequence[Array], sensor: int, at: Sequence[int]) -> Array:
    """What a room of each course (N,) [K] does to a sensor's fitted coordinates at the columns `at`: (courses, 3)."""
    run, weight = fit.run, fit.run.weight[sensor]
    rate = float(np.asarray(fit.values[RATE], dtype=float)[sensor])
    read = np.array([_follows(run, course, rate) for course in courses])
    slopes = fit.by_local[at, sensor] * weight
    return np.asarray(np.linalg.lstsq(slopes @ fit.by_local[at, sensor].T, slopes @ read.T, rcond=None)[0].T)


@dataclass(frozen=True)
class Begun:
    """By how much the new runs began warmer (S,) [K] than the old ones, and how much they rise (S,) [K].

    warm: how likely that is the machine's; room: deviation [K] between rooms.
    """

    warmer: Array
    rise: Array
    warm: float = WARM
    room: float = ROOM_BETWEEN

    def ways(self) -> list[tuple[float, Array, Array]]:
        """Of another room, which moves no rise, and of a warm machine: log-likelihood, shift (2 S,) of a difference, deviation."""
        n, mean = len(self.warmer), float(self.warmer.mean())
        apart = float(((self.warmer - mean) ** 2).sum())
        logs = []
        for share, deviation in ((1.0 - self.warm, BESIDE), (self.warm, float(np.hypot(BESIDE, UNEVEN * mean)))):
            logs.append(float(np.log(share)) - (n - 1) * float(np.log(deviation)) - 0.5 * apart / deviation**2)
        # Had it begun as cold as before, it would have risen by so much more.
        more = np.log(np.maximum(1.0 + self.warmer / self.rise, 0.05))
        still = np.zeros(n)
        by_kelvin = np.concatenate([still, np.exp(-more) / self.rise])
        return [(logs[0], np.zeros(2 * n), BESIDE * by_kelvin), (logs[1], np.concatenate([still, -more]), self.room * by_kelvin)]


@dataclass(frozen=True)
class Change:
    """One kind of change: its probability, and the logarithm of its size with its deviation; sensor is that of a `sensor`, with
    other one of two that were `exchanged`.

    size is the factor on heat, heat capacity or loss; of a sensor the factor on its rise; of the contacts that on the rise of the
    sensor that moved most; of the room the difference [K], not a logarithm; None for `nothing`. kelvin: of a sensor as well, whose
    probe tells another temperature throughout; shows: deviation [K] of what parts that from a place that was warm before.
    """

    kind: str
    sensor: int | None
    probability: float
    size: float | None = None
    deviation: float | None = None
    kelvin: bool = False
    shows: float | None = None
    other: int | None = None


def scatter(n: int, runs: Sequence[Sequence[RunNumbers]]) -> Array:
    """Covariance (2 n, 2 n) from run to run, the usual one scaled by what groups of like runs show."""
    common, own = np.array(COMMON), np.repeat(np.square(OWN), n)
    usual: Array = np.kron(np.outer(common, common) * np.array([[1.0, TOGETHER], [TOGETHER, 1.0]]), np.ones((n, n))) + np.diag(own)
    total, count = RUNS_ASSUMED * 2 * n, RUNS_ASSUMED * 2 * n
    for group in runs:
        mean = np.mean([r.values for r in group], axis=0)
        total += sum(float((r.values - mean) @ np.linalg.solve(usual + r.covariance, r.values - mean)) for r in group)
        count += 2 * n * (len(group) - 1)
    return usual * total / count


@dataclass(frozen=True)
class Compared:
    """Kinds of change, the likeliest first; the difference (2 S,) of new runs to old with its covariance.

    same_start is the probability, where nothing changed in the machine, that what began elsewhere was in another room.
    """

    changes: list[Change]
    difference: Array
    noise: Array
    same_start: float = 1.0


def changes(old: Sequence[RunNumbers], new: Sequence[RunNumbers], begun: Begun | None = None) -> Compared:
    """What may have changed between runs.

    Raises
    ------
    ValueError: a group without runs.
    """
    if not old or not new:
        raise ValueError("no runs to compare")
    n = len(old[0].values) // 2
    spread = scatter(n, (old, new))
    means = []
    for group in (old, new):
        precision = [r.runs * np.linalg.inv(r.covariance + spread) for r in group]
        covariance = np.linalg.inv(sum(precision))
        means.append((covariance @ sum(p @ r.values for p, r in zip(precision, group, strict=True)), covariance))
    difference: Array = means[1][0] - means[0][0]
    noise: Array = means[0][1] + means[1][1]
    ways = begun.ways() if begun is not None else [(0.0, np.zeros(2 * n), np.zeros(2 * n))]
    listed, logs, pairs = [], list[Array](), _exchanges(means[0], means[1])
    found: list[tuple[str, Any, list[tuple[int | None, float, float] | None]]] = []
    for kind, sensor, directions, size, prior in _hypotheses(n):
        weights, sizes = [], []
        for likely, shift, unsure in ways:
            for share, of_share in UNLIKE_LOSS if kind == "loss" and n > 1 else ((UNLIKE, 1.0),):
                weight, told = _weighed(kind, directions, size, difference - shift, noise + np.outer(unsure, unsure), share)
                weights.append(weight + np.log(prior * of_share) + likely)
                sizes.append(told)
        found.append((kind, sensor, sizes))
        logs.append(np.array(weights))
    for pair, weight in pairs:
        found.append(("exchanged", pair, [None] * len(ways)))
        logs.append(np.array([weight + likely for likely, _, _ in ways]))
    top = max(float(each.max()) for each in logs)
    shares = [np.exp(each - top) for each in logs]
    total = sum(float(each.sum()) for each in shares)
    for (kind, sensor, sizes), own in zip(found, shares, strict=True):
        at, value, deviation = _mixed(own / max(float(own.sum()), 1e-300), sizes)
        one, other = sensor if isinstance(sensor, tuple) else (sensor, None)
        listed.append(Change(kind, one if at is None else at, float(own.sum()) / total, value, deviation, other=other))
    same_start = float(shares[0][0] / max(float(shares[0].sum()), 1e-300))
    return Compared(sorted(listed, key=lambda c: -c.probability), difference, noise, same_start)


def _exchanges(old: tuple[Array, Array], new: tuple[Array, Array]) -> list[tuple[tuple[int, int], float]]:
    """Log-likelihoods, with their priors, of pairs of sensors that have each other's numbers in the new runs; means (2 S,) of both
    sides with their covariances.
    """
    n = len(old[0]) // 2
    if n < 2:
        return []
    first, second = np.triu_indices(n, 1)
    variance = np.diag(old[1]) + np.diag(new[1])
    # By how much an exchange makes the numbers of both alike, each by itself.
    left = (new[0] - old[0]) ** 2 / variance
    crossed = (new[0].reshape(2, 1, n) - old[0].reshape(2, n, 1)) ** 2 / variance.reshape(2, n, 1)
    gain = sum(left[k * n + first] + left[k * n + second] - crossed[k][first, second] - crossed[k][second, first] for k in (0, 1))
    found = []
    for at in np.argsort(-np.asarray(gain))[:PAIRS].tolist():
        i, j = int(first[at]), int(second[at])
        order = np.arange(2 * n)
        order[[i, j, n + i, n + j]] = j, i, n + j, n + i
        noise = old[1] + new[1][np.ix_(order, order)]
        difference = new[0][order] - old[0]
        log = -0.5 * float(np.linalg.slogdet(noise)[1] + difference @ np.linalg.solve(noise, difference))
        found.append(((i, j), log + float(np.log(PRIORS["exchanged"] / len(first)))))
    return found


def _weighed(
    kind: str, directions: Array, size: float, left: Array, noise: Array, share: float
) -> tuple[float, tuple[int | None, float, float] | None]:
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
        middle = _middle(left * directions[:, 0], np.sqrt(np.diag(noise)))
        told = told[0], told[1], float(np.hypot(told[2], FROM_MIDDLE * (middle - told[1])))
    return -0.5 * float(log + left @ np.linalg.solve(covariance, left)), told


def _of_every_point(kind: str, directions: Array, found: tuple[int | None, float, float] | None, left: Array, noise: Array) -> bool:
    """Whether a change of the whole machine is one that its points show: no larger than that of any, and of few the other way.

    Where all errors have a part in common least squares may go beyond all that was measured (Peelle's puzzle); a coupling that
    changed, which moves some points up and others down, was called a heat then.
    """
    if found is None or kind not in WHOLE or len(left) == 2:  # of one sensor there is nothing to go beyond
        return True
    moved = directions[:, 0] != 0.0
    each = (left * directions[:, 0])[moved]
    apart = np.eye(len(each)) - 1.0 / len(each)
    tolerance = 2.0 * float(np.sqrt((apart @ noise[np.ix_(moved, moved)] @ apart).diagonal().max()))
    size, each = abs(found[1]), each * np.sign(found[1])
    against = float((each < -tolerance).mean())
    return bool(size <= tolerance or (size <= each.max() + tolerance and against <= MOST_AGAINST))


def _all_one_way(directions: Array, found: tuple[int | None, float, float] | None, left: Array, noise: Array) -> bool:
    """Whether all rates and rises go the way of a change: more loss leaves no point warmer, however parts warm each other."""
    against = -np.sign(found[1] if found is not None else 0.0) * left * directions[:, 0]
    return not bool((against > 2.0 * np.sqrt(np.diag(noise))).any())


def _mixed(shares: Array, sizes: Sequence[tuple[int | None, float, float] | None]) -> tuple[int | None, float | None, float | None]:
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


def with_room(found: Sequence[Change], probability: float, difference: float, deviation: float) -> list[Change]:
    """Kinds of change with another room, by so many K, where the machine is as it was; the likeliest first."""
    as_it_was = next(c for c in found if c.kind == "nothing")
    parted = [
        replace(as_it_was, probability=as_it_was.probability * (1.0 - probability)),
        Change("room", None, as_it_was.probability * probability, difference, deviation),
    ]
    return sorted([*parted, *(c for c in found if c is not as_it_was)], key=lambda c: -c.probability)


def with_offset(found: Sequence[Change], starts: Array, rises: Array, old: int, errors: Array, stands_for: int = 1) -> list[Change]:
    """Kinds of change with a probe among them that tells another temperature throughout; the likeliest first.

    starts, rises (K, S) [K]: of each run, the first of which are `old`, each the mean of as many as it `stands_for`; errors (S,):
    of the new rises over the old ones, in logarithms. A probe that is off moves where its sensor begins and not how far it rises; a
    place that is warm from before does both, and a run is as uneven as the old ones were. Of two sensors nobody knows which is off,
    after one run how uneven they are.
    """
    count = starts.shape[1]
    if count < 3 or old * stands_for < 2:
        return list(found)
    begun, alone = begun_beside(starts, old)
    before = begun[:old].mean(axis=0)
    own = ((begun[:old] - before) ** 2).sum(axis=0)
    # Of one sensor as of all together, as one run more whose sensors begin as they usually do.
    variance = (BESIDE**2 * count + own.sum()) / (count * old) * (1.0 / (old * stands_for) + 1.0 / (len(starts) - old))
    moved = begun[old:].mean(axis=0) - before
    rose, after = rises[:old].mean(axis=0), rises[old:].mean(axis=0)
    unsure = (np.hypot(errors, OWN[1]) * np.abs(after)) ** 2 + BESIDE**2
    chance = norm.logpdf(moved, 0.0, np.sqrt(variance))
    fell = after - _middle(after / rose, np.hypot(errors, OWN[1])) * rose
    as_probe = norm.logpdf(moved, 0.0, np.sqrt(variance + PROBE**2)) + norm.logpdf(fell, 0.0, np.sqrt(unsure))
    as_warm = np.logaddexp(chance + norm.logpdf(fell, 0.0, np.sqrt(unsure)), _as_warm_spot(moved, fell, variance, unsure))
    # Where a test is logged late all rise less, each by as much as it had warmed, and no factor is all rises'.
    as_warm = np.logaddexp(as_warm, np.log(LATE) + _as_warm_spot(moved, after - rose, variance, unsure))
    odds = PRIORS["sensor"] / count * np.exp(np.minimum(as_probe - as_warm, 50.0))
    i = int(np.argmax(odds))
    share = float(odds[i] / (1.0 + odds[i]))
    others = [replace(c, probability=c.probability * (1.0 - share)) for c in found]
    size = float((alone[old:, i].mean() - alone[:old, i].mean()) * PROBE**2 / (PROBE**2 + variance))
    deviation, shows = float(np.sqrt(PROBE**2 * variance / (PROBE**2 + variance))), float(np.sqrt(variance + unsure[i]))
    probe = Change("sensor", i, share, size, deviation, kelvin=True, shows=shows)
    return sorted([probe, *others], key=lambda c: -c.probability)


def _middle(values: Array, errors: Array) -> float:
    """Median of values (S,), each weighed by what is known of it: a sensor far from the heat tells nothing of its rise."""
    order = np.argsort(values)
    weight = np.cumsum(1.0 / errors[order] ** 2)
    return float(values[order][np.searchsorted(weight, 0.5 * weight[-1])])


def begun_beside(starts: Array, old: int) -> tuple[Array, Array]:
    """Where sensors began (K, S) [K] beside where they began in the `old` runs, less the middle of all in their run; and less that
    of the others alone, which is what one is off by if it is the only one.
    """
    beside = starts - starts[:old].mean(axis=0)  # one that moves past another then leaves the middle where it was
    others = np.stack([np.median(np.delete(beside, i, axis=1), axis=1) for i in range(beside.shape[1])], axis=1)
    return beside - np.median(beside, axis=1, keepdims=True), beside - others


def _as_warm_spot(moved: Array, fell: Array, variance: float, unsure: Array) -> Array:
    """Log likelihood (S,) that a sensor's place was warm from before: it began higher, and rose by so much less."""
    likely: Array = np.log(WARM) + norm.logpdf(moved, 0.0, np.sqrt(variance + PROBE**2))
    likely += norm.logpdf(fell, -moved, np.sqrt(unsure))
    return likely


def other_room(old: Array, new: Array, error: float) -> float:
    """Probability that the new runs had another room, of the rooms (K,) [degC] of old and new runs, each known to `error` [K]."""
    usual = max(ROOM, ROOM_DEVIATIONS * float(old.std(ddof=1)) if len(old) > 2 else 0.0)
    deviation = error * np.sqrt(1.0 / len(old) + 1.0 / len(new))
    return float(norm.cdf((abs(float(new.mean() - old.mean())) - usual) / deviation))


def _most_moved(difference: Array, noise: Array, size: float) -> tuple[int, float, float]:
    """The sensor that moved most beside the others, where each may in its own way; factor on its rise, as logarithm; deviation."""
    n = len(difference) // 2
    covariance = np.linalg.inv(np.linalg.inv(noise) + np.eye(2 * n) / size**2)
    value = covariance @ np.linalg.solve(noise, difference)
    deviation = np.sqrt(np.diag(covariance))
    most = int(np.argmax((value**2 / np.diag(covariance)).reshape(2, n).sum(axis=0)))
    return most, float(value[n + most]), float(deviation[n + most])


def _size(kind: str, directions: Array, size: float, difference: Array, noise: Array) -> tuple[int | None, float, float] | None:
    """Logarithm of a change and its deviation, all else as it was; of the contacts that of the sensor that moved most."""
    if kind == "nothing":
        return None
    if kind == "contact":
        return _most_moved(difference, noise, size)
    covariance = np.linalg.inv(directions.T @ np.linalg.solve(noise, directions) + np.eye(directions.shape[1]) / size**2)
    value = covariance @ directions.T @ np.linalg.solve(noise, difference)
    return None, float(value[0]), float(np.sqrt(covariance[0, 0]))
