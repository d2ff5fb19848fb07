"""How far the numbers of a sensor can be trusted, in a status and in words."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Tracks
from thermofast.models import bridged, difference_noise, spike_weights
from thermofast.models.imperfection import Past
from thermofast.models.noise.chain import slipped
from thermofast.models.uncertainty.companions import DONE

from ..errors import rounded
from .estimate import Claims, Estimate, Estimates, said_of_early
from .measured import came_loose, outlying, stepped, went, words
from .rules import RULES
from .sensor import Sensor, Sensors, left_at_end

Array = NDArray[np.float64]

#: Readings have gone some way and come back that went farther than so many times where they are, and than so much noise.
TURNED, BEYOND_NOISE = 2.0, 10.0


def _wide_words(width: float, rise: float, went: float, noise: float) -> str:
    """Of an interval [K] many times the rise [K] of readings; where those went farther [K] and came back, that they did."""
    if went <= max(TURNED * rise, BEYOND_NOISE * noise):
        return f"the steady state is known only to within {width:.3g} K, many times the rise so far; measure longer"
    return (
        f"the steady state is known only to within {width:.3g} K: the readings went {went:.3g} K and came back, which is no "
        "approach to one; see thermofast diagnose"
    )


@dataclass(frozen=True)
class Reason:
    """Why a row is no ``ok``, or what it says beside: the sensors (S,) that it concerns, the words for one of them, and which of
    them (S,) it puts in doubt.
    """

    where: NDArray[np.bool_]
    say: Callable[[int], str]
    doubts: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class _Case:
    """What is asked of a run's sensors: their estimates and what may be claimed; quantities (S,) that several reasons use.

    seen, went [K]: how far the last reading used, and any, is from the first; width [K]: of the interval of the steady state; left:
    readings that count as outliers; leave: readings at the end that leave the law; swings: too many are left out.
    """

    found: Estimates
    claimed: Claims
    sensors: Sensors
    past: Past | None
    until: float

    @cached_property
    def seen(self) -> Array:
        return np.abs(self.found.state[:, 0] - self.found.initial)

    @cached_property
    def went(self) -> Array:
        return went(self.found, self.sensors)

    @cached_property
    def width(self) -> Array:
        with np.errstate(invalid="ignore"):
            return np.asarray(self.found.steady_high - self.found.steady_low)

    @cached_property
    def left(self) -> NDArray[np.intp]:
        return np.where(self.claimed.other_rise, 0, (self.found.weights == 0.0).sum(axis=1))

    @cached_property
    def leave(self) -> NDArray[np.intp]:
        return np.where(self.claimed.other_rise, 0, self.claimed.left_last)

    @cached_property
    def swings(self) -> NDArray[np.bool_]:
        return _too_many(self.left, self.found)

    @cached_property
    def lawless(self) -> NDArray[np.bool_]:
        return _lawless(self.found, self.sensors) & ~self.claimed.other_rise

    @cached_property
    def unfit(self) -> NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):
            return np.asarray(self.claimed.check_p < RULES.unfit)

    @cached_property
    def goes_on(self) -> NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):
            return np.abs(self.claimed.moved) > np.maximum(0.5 * self.width, RULES.at_rest * self.found.noise)

    @cached_property
    def slow(self) -> Array:
        """Rate (S,) [1/min] that counts: a sensor that is said to be quick has the slower parts behind it that the others read."""
        driven = self.claimed.rate[self.claimed.other_rise & self.claimed.held, 1]
        return np.minimum(self.claimed.rate[:, 1], np.median(driven) if len(driven) else np.inf)


def claimed_verdicts(
    found: Estimates,
    claimed: Claims,
    tracks: Tracks,
    sensors: Sensors,
    against: dict[int, float],
    until: float,
    back: NDArray[np.bool_],
    past: Past | None,
    changed_min: float | None,
) -> tuple[list[str], dict[int, list[str]]]:
    """Status of each sensor, and of some what to say: ``ok`` is earned by an interval that law, machine and readings bear out."""
    case = _Case(found, claimed, sensors, past, until)
    first = [
        Reason(back, lambda _: "it settles where it began: there is no rise of which 95 % could be told"),
        Reason(_still(case), lambda _: "it did not move by more than its noise: not heated yet, or settled before"),
        *(undetermined := _undetermined(case, back)),
        *_of_the_law(case),
    ]
    later = [*_of_the_heat(case, changed_min), *_of_what_came_later(case), *_of_what_is_out(case), *_noted(case)]
    doubted = np.any([r.doubts for r in (*first, *later) if r.doubts is not None], axis=0)
    open_ = np.any([r.where for r in undetermined], axis=0)
    early = Reason(np.isfinite(claimed.early) & ~open_ & ~doubted, lambda i: said_of_early(claimed, i))
    clear = np.where(early.where, "not_determined", "ok")
    status: list[str] = np.where(open_, "not_determined", np.where(doubted, "model_doubtful", clear)).tolist()
    messages: dict[int, list[str]] = {}
    for reason in (*first, early, _faded(case, tracks, status), *later):
        for i in np.flatnonzero(reason.where).tolist():
            messages.setdefault(i, []).append(reason.say(i))
    read = sensors.time[: found.weights.shape[1]], sensors.reading[:, : found.weights.shape[1]], sensors.resolution
    for i, said in came_loose(*read, changed_min).items():
        status[i], messages[i] = "not_determined" if open_[i] else "model_doubtful", [said]  # what else is said is of no machine
    if past is None and changed_min is None and not (open_.all() or claimed.other_rise.any()):
        for i, (fresh, said) in stepped(*read, np.where(open_ | (claimed.averaged > 1), np.inf, claimed.rate[:, 1])).items():
            status[i] = "model_doubtful" if fresh and status[i] == "ok" else status[i]
            messages[i] = [*messages.get(i, []), said]
    return _contradicted(status, messages, against, until)


def _contradicted(
    status: list[str], messages: dict[int, list[str]], against: dict[int, float], until: float
) -> tuple[list[str], dict[int, list[str]]]:
    """Status and words with those sensors in doubt that readings ahead contradict [K]."""
    for i, size in against.items():
        status[i] = "model_doubtful" if status[i] == "ok" else status[i]
        messages[i] = [words(size, until), *messages.get(i, [])]
    return status, messages


def _undetermined(case: _Case, back: NDArray[np.bool_]) -> list[Reason]:
    """Intervals that determine nothing: open, many times as wide as the rise, or reaching far back behind where it began."""
    found, noise = case.found, case.found.noise
    bounded = found.bounded | (back & np.isfinite(found.steady_low) & np.isfinite(found.steady_high))
    rises = found.state[:, 0] >= found.initial
    with np.errstate(invalid="ignore"):
        wide = case.width > RULES.widest * np.maximum(case.seen, 4.0 * noise)
        short = np.where(rises, found.initial - found.steady_low, found.steady_high - found.initial)
        behind = ~back & (short > RULES.backwards * np.maximum(case.seen, 4.0 * noise))

    def backwards(i: int) -> str:
        far = f"the steady state is known only to within {case.width[i]:.3g} K, from {short[i]:.3g} K behind where it began on"
        return f"{far}: these readings hardly say that it moves on; measure longer"

    return [
        Reason(~bounded, lambda i: _open_side(found.one(i))),
        Reason(
            bounded & wide,
            lambda i: _wide_words(float(case.width[i]), float(case.seen[i]), float(case.went[i]), float(noise[i])),
        ),
        Reason(bounded & ~wide & behind, backwards),
    ]


def _of_the_law(case: _Case) -> list[Reason]:
    """Readings that leave the law, all together or in an effect that is likely."""
    found, claimed, unfit, lawless = case.found, case.claimed, case.unfit, case.lawless
    # Of a rise that is nearly done no effect beside the law can say otherwise than its readings.
    low, _, high = np.abs(claimed.steady - found.state[:, :1]).T
    rise = np.abs(claimed.steady[:, 1] - found.initial)
    with np.errstate(invalid="ignore"):
        strong = (claimed.strong > RULES.strong) & ~(np.maximum(low, high) <= RULES.done * rise)

    def leaves(i: int) -> str:
        return f"the readings leave the law by more than machines do (p = {claimed.check_p[i]:.1g}): see thermofast diagnose"

    def no_law(i: int) -> str:
        left = rounded(float(found.misfit[i]))
        return f"one exponential does not describe these readings ({left} K rms): see thermofast diagnose"

    likely = "an effect beside the law is likely; the interval counts it, thermofast diagnose looks for it"
    return [
        Reason(unfit, leaves, unfit),
        Reason(lawless & ~unfit, no_law, lawless),
        Reason(strong & ~unfit & ~lawless, lambda _: likely, strong),
    ]


def _faded(case: _Case, tracks: Tracks, status: list[str]) -> Reason:
    """That the filter began to forget; innovations of averaged readings are alike, which says nothing of the law."""

    def say(i: int) -> str:
        counts = "" if status[i] != "ok" else ", which the interval counts"
        return f"the plain law fails from about {case.sensors.time[tracks.woke[i]]:.4g} min on{counts}"

    return Reason(case.found.faded & ~case.claimed.other_rise & ~(case.claimed.averaged > 1), say)


def _of_the_heat(case: _Case, changed_min: float | None) -> list[Reason]:
    """A heat that did not stay, that has just changed, or that has hardly come."""
    claimed = case.claimed
    stayed = case.past.stayed_min if case.past is not None else np.inf
    restless = claimed.other_rise & (stayed * case.slow < 1.0)
    since = _since_change(claimed, case.past, changed_min, case.found)
    with np.errstate(invalid="ignore"):
        needed = RULES.fresh_learnt if case.past is not None and not case.past.guessed else RULES.fresh
        fresh = since * np.minimum(claimed.rate[:, 1], _median(claimed.rate[claimed.held, 1])) < needed
    behind = np.isfinite(claimed.behind)
    told = np.isfinite(case.found.steady_state)  # of a limit that is no number nobody is told when it shows

    def moved_on(i: int) -> str:
        return (
            f"the heat stayed for {rounded(stayed)} min at most, less than a time constant ({rounded(1.0 / case.slow[i])} min): "
            "slower parts of the machine cannot be told; let it stay and measure on"
        )

    def changed(i: int) -> str:
        return (
            f"the load changed {rounded(float(since[i]))} min before the last reading: what it leads to shows after "
            f"{rounded(needed / claimed.rate[i, 1])} min; measure on"
        )

    def little(i: int) -> str:
        share = rounded(100.0 * abs(claimed.behind[i]))
        if claimed.behind[i] < 0.0:
            went = f"it went the other way, by {share} % of what others have moved, as a part that was warm before does"
            return f"{went}: their heat may still be on its way to it; measure on"
        return f"it has moved by {share} % of what others have: heat may still be on its way to it; measure on"

    return [Reason(restless & told, moved_on, restless), Reason(fresh & told, changed, fresh), Reason(behind, little, behind)]


def _of_what_came_later(case: _Case) -> list[Reason]:
    """What the run's other sensors, and a sensor's own last readings, say against one said to be quick or to have settled."""
    found, claimed, sensors = case.found, case.claimed, case.sensors
    haste, goes_on, jumped = np.isfinite(claimed.faster), case.goes_on, _jumped(found, sensors)
    slips = np.isfinite(jumped)
    # Where the point that moved most shows a heat that is not constant, one that is said to have settled has it ahead.
    uneven = (case.unfit | case.swings | case.lawless | goes_on | (case.leave > 0)) & ~claimed.known
    with np.errstate(invalid="ignore"):
        done = claimed.rate[:, 1] * (found.time - sensors.time[0]) > DONE
    reaches = done & bool(uneven[int(np.argmax(case.went))]) & ~uneven & ~claimed.known
    with np.errstate(invalid="ignore"):
        hides = claimed.hides > RULES.hides

    def quick(i: int) -> str:
        return (
            f"it would be {rounded(claimed.faster[i])} times as fast as others of the run, which have not settled: what these "
            "still do may reach it, or what was read is no rise (a swing, a probe that came loose); measure on"
        )

    def moves(i: int) -> str:
        return (
            f"by the law it had settled after {rounded(DONE / claimed.rate[i, 1])} min, and it moved by "
            f"{rounded(abs(claimed.moved[i]))} K since: more than the interval holds"
        )

    def jump(i: int) -> str:
        return f"the readings jump at {jumped[i]:.4g} min, as no machine does: a probe that moved, or was exchanged?"

    ahead = "the point that moved most shows a heat that is not constant, which may still reach this one"
    slow = "a slow second mass may hide that moves the limit out of the interval; measure longer"
    return [
        Reason(haste, quick, haste),
        Reason(goes_on, moves, goes_on),
        Reason(slips, jump, slips),
        Reason(reaches, lambda _: ahead, reaches),
        Reason(hides, lambda _: slow, hides),
    ]


def _of_what_is_out(case: _Case) -> list[Reason]:
    """Outliers, which say nothing against a sensor unless they are many, or the last readings."""
    out, found, sensors = case.left, case.found, case.sensors
    many = case.swings | (case.leave > 0)
    if out.any():  # what a curve does that the law cannot follow, one by one, is no outlier of a probe
        out = np.where(many, out, np.minimum(out, outlying(found, sensors).sum(axis=1)))

    def left_out(i: int) -> str:
        gone = int(case.leave[i])
        return _left_out(int(out[i]), found.weights.shape[1], bool(case.swings[i]), gone, _since(sensors, found, gone))

    return [Reason(out > 0, left_out, many)]


def _noted(case: _Case) -> list[Reason]:
    """What an interval counts, or takes for granted, and says."""
    claimed, past = case.claimed, case.past
    # What was changed in a machine bends its curve later: its past is believed until then, and the row says for how long.
    believed = claimed.known & (past is not None and not past.guessed)
    with np.errstate(invalid="ignore"):
        believed &= (case.until - case.sensors.time[0]) * claimed.rate[:, 1] < 1.0

    def as_it_was(i: int) -> str:
        then = rounded(1.0 / claimed.rate[i, 1])
        return f"the machine is taken to be as it was: a change of its cooling may not show before {then} min"

    low, _, high = claimed.alone.T
    with np.errstate(invalid="ignore"):
        beyond = claimed.known & ((claimed.steady[:, 1] < low) | (claimed.steady[:, 1] > high))

    def stands_on_it(i: int) -> str:
        return f"its own readings alone say {low[i]:.2f}..{high[i]:.2f} degC: a limit beyond stands on the past runs"

    def as_fast(i: int) -> str:
        told = f"it is {claimed.as_fast[i]:.2g} times as fast as in past runs, more than those differ"
        return f"{told}: was the machine changed? the interval is that of its own readings at least"

    averaged = np.asarray(claimed.averaged > 1)
    return [
        Reason(np.isfinite(claimed.as_fast), as_fast),
        Reason(believed, as_it_was),
        Reason(np.asarray(beyond), stands_on_it),
        Reason(averaged, lambda i: f"each reading is an average over the last {claimed.averaged[i]}, which the interval counts"),
    ]


def _still(case: _Case) -> NDArray[np.bool_]:
    """Whether a sensor (S,) did not move by more than its noise."""
    still = np.asarray(case.went < RULES.at_rest * case.found.noise)
    for i in np.flatnonzero(still).tolist():  # what a law leaves that cannot follow the readings is no noise
        noise = max(float(difference_noise(case.sensors.reading[i])), float(case.sensors.resolution[i]))
        still[i] = case.went[i] < RULES.at_rest * noise
    return still


def law_verdicts(
    found: Estimates, tracks: Tracks, sensors: Sensors, against: dict[int, float], until: float
) -> tuple[list[str], dict[int, list[str]]]:
    """Status of each sensor, and of some what to say: how far the numbers can be trusted."""
    bounded, seen = found.bounded, np.abs(found.state[:, 0] - found.initial)
    with np.errstate(invalid="ignore"):
        width = found.steady_high - found.steady_low
        too_wide = width > RULES.widest * np.maximum(seen, 4.0 * found.noise)
        largest = np.abs(sensors.reading).max(axis=1)
        doubted = found.faded | _misfits(found.pattern_p, found.too_large, found.misfit, sensors.resolution, largest)
    out, row = (found.weights == 0.0).sum(axis=1), left_at_end(found.weights, sensors)
    far = went(found, sensors) if (bounded & too_wide).any() else seen
    swings, leave = _too_many(out, found), np.where(row >= RULES.last_alone, row, 0)
    doubted = doubted | swings | (leave > 0)
    status = np.where(~bounded | too_wide, "not_determined", np.where(doubted, "model_doubtful", "ok")).tolist()
    messages: dict[int, list[str]] = {}
    for i in np.flatnonzero(~bounded | too_wide | doubted | (out > 0)).tolist():
        said = doubts(found.one(i), int(tracks.woke[i]), sensors.one(i))
        if out[i]:
            gone = int(leave[i])
            said.append(_left_out(int(out[i]), found.weights.shape[1], bool(swings[i]), gone, _since(sensors, found, gone)))
        if not bounded[i]:
            said.insert(0, _open_side(found.one(i)))
        elif too_wide[i]:
            said.insert(0, _wide_words(float(width[i]), float(seen[i]), float(far[i]), float(found.noise[i])))
        messages[i] = said
    return _contradicted(status, messages, against, until)


def _lawless(found: Estimates, sensors: Sensors) -> NDArray[np.bool_]:
    """Whether the law leaves more of what was read (S,) in a pattern than any machine that it says something about."""
    far: NDArray[np.bool_] = found.too_large.copy()
    if far.any():
        read = sensors.reading[far][:, sensors.time <= found.time]
        most, least = np.nanpercentile(read, (99, 1), axis=1)
        far[far] = found.misfit[far] > RULES.lawless * (most - least)
    return far


def _jumped(found: Estimates, sensors: Sensors) -> Array:
    """When (S,) [min] a sensor jumps once, farther than several times any other step, and goes on from there; nan for none.

    An outlier makes two such steps, a gap none; what jumps at the end may be a change, and is told as one. A jump that a probe's
    lag spreads over several readings is a slip.
    """
    used = sensors.time <= found.time
    time, reading = sensors.time[used], sensors.reading[:, used]
    if len(time) < 4 * RULES.last_alone:
        return np.full(len(reading), np.nan)
    gap = np.diff(time)
    moves = np.where(gap > 1.5 * np.median(gap), 0.0, np.diff(reading, axis=1))
    step, rows = np.abs(moves), np.arange(len(reading))
    at = step.argmax(axis=1)
    jump, largest = moves[rows, at], step[rows, at]
    step[rows, at] = 0.0
    inside = (at >= RULES.last_alone) & (at < step.shape[1] - RULES.last_alone) & (largest > RULES.jump * found.noise)
    far = inside & (largest > RULES.fastest_step * step.max(axis=1))
    # Of two that were exchanged one may have begun as fast as it jumps; the other one went the opposite way at the same reading.
    opposite = (at == at[:, None]) & (jump * jump[:, None] < 0.0) & (2.0 * largest > largest[:, None]) & far
    whole = bridged(time, reading, spike_weights(reading, sensors.resolution) == 0.0)
    return np.where(far | (inside & opposite.any(axis=1)), time[at + 1], slipped(time, whole))


def _since_change(claimed: Claims, past: Past | None, changed_min: float | None, found: Estimates) -> Array:
    """Minutes since the load changed (S,): the drive of a sensor that follows one, else what is logged and not counted; or inf."""
    other = -np.inf if changed_min is None or changed_min > found.time else changed_min
    return np.asarray(found.time - np.where(claimed.other_rise, past.changed_min if past is not None else -np.inf, other))


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else np.inf


def _too_many(out: NDArray[np.intp], found: Estimates) -> NDArray[np.bool_]:
    """Whether so many readings (S,) were left out that they are no outliers."""
    many: NDArray[np.bool_] = out >= max(RULES.outlying * found.weights.shape[1], RULES.fewest_outside)
    return many


def _since(sensors: Sensors, found: Estimates, leave: int) -> float | None:
    """When the last readings left the rest [min]; None where they did not."""
    return float(sensors.time[found.weights.shape[1] - leave]) if leave else None


def _left_out(out: int, total: int, too_many: bool, leave: int, since: float | None) -> str:
    if since is not None:
        last = (
            f"the last {leave} readings, from {since:.4g} min on, leave"
            if leave > 1
            else f"the last reading, at {since:.4g} min, leaves"
        )
        beside = f"; {_outliers(out - leave)} left out" if out > leave else ""
        return f"{last} the law: something may just have changed; measure on, or use what came before (--until){beside}"
    if too_many:
        many = f"{_outliers(out)} left out of {total} readings: too many for a probe"
        return f"{many}; a load that swings looks so, see thermofast diagnose"
    return f"{_outliers(out)} left out"


def _outliers(count: int) -> str:
    return f"{count} outlier{'s' if count > 1 else ''}"


def _open_side(estimate: Estimate) -> str:
    sides = estimate.steady_state_interval
    if estimate.steady_state is None:
        return "no bend is seen yet: the steady state cannot be told; measure longer"
    if sides.low is None or sides.high is None:
        return "these readings do not bound the steady state on one side; measure longer"
    return "these readings do not bound the settling time on one side; measure longer"


def _misfits(pattern_p: Any, too_large: Any, misfit: Any, resolution: Any, largest: Any) -> Any:
    """Whether residuals are more than noise; broadcasts. largest: the largest reading by amount [degC]."""
    # A misfit smaller than the logger's step is its rounding, and one of the last digit is the computer's.
    return ((pattern_p < RULES.doubt) | too_large) & (misfit > np.maximum(0.5 * resolution, 1e-9 * largest))


def doubts(estimate: Estimate, woke: int, sensor: Sensor) -> list[str]:
    """Why the base model does not fit, in words; empty where nothing speaks against it.

    woke: the reading at which the filter began to fade.
    """
    if estimate.faded:
        return [
            f"the base model fails from about {sensor.time[woke]:.4g} min on and the filter forgets what was before; "
            "the interval is that of its last readings and may be too narrow"
        ]
    largest = float(np.abs(sensor.reading).max())
    if _misfits(estimate.pattern_p, estimate.too_large, estimate.misfit, sensor.resolution, largest):
        return [
            f"the readings leave the base model in a pattern ({rounded(estimate.misfit)} K rms): "
            "the interval does not cover what the model lacks"
        ]
    return []
