"""How far the numbers of a sensor can be trusted, in a status and in words."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Tracks
from thermofast.models import difference_noise, spike_weights
from thermofast.models.imperfection import Past
from thermofast.models.uncertainty.companions import DONE

from ..errors import rounded
from ..records import IdentifyRecord
from .estimate import Estimate, Estimates
from .imperfect import Claims, left_at_end
from .measured import words
from .rules import RULES
from .sensor import Sensor, Sensors

Array = NDArray[np.float64]

#: Readings have gone some way and come back that went farther than so many times where they are, and than so much noise.
TURNED, BEYOND_NOISE = 2.0, 10.0


def with_claims(law: Estimates, claimed: Claims, sensors: Sensors, back: NDArray[np.bool_]) -> Estimates:
    """Estimates with what may be claimed in place of what the law alone says; an unbounded side is nan.

    back: as :func:`comes_back` says of each sensor.
    """
    steady, t95 = claimed.steady.copy(), claimed.t95.copy()
    # Where the readings hardly say more of the rate than was assumed, the slow side would be a number out of the prior; where the
    # heat has hardly come, one out of what came first.
    rises = law.state[:, 0] >= law.initial
    open_ = claimed.unknown_rate | np.isfinite(claimed.behind)
    steady[open_ & rises, 2] = np.nan
    steady[open_ & ~rises, 0] = np.nan
    t95[open_, 2] = np.nan
    t95[:, 0] = np.clip(np.maximum(t95[:, 0], _not_done_before(law, steady[:, 0 if rises.all() else 1], sensors)), None, t95[:, 1])
    t95[back] = np.nan
    _to_the_beginning(steady, law, sensors)
    return replace(
        law,
        steady_state=steady[:, 1],
        steady_low=steady[:, 0],
        steady_high=steady[:, 2],
        rate=claimed.rate[:, 1],
        t95=t95[:, 1],
        t95_low=t95[:, 0],
        t95_high=t95[:, 2],
    )


def _to_the_beginning(steady: Array, law: Estimates, sensors: Sensors) -> None:
    """Opens intervals (S, 3) that end just short of where a sensor began, to which it is on its way back: the heat may be off.

    Bodies that are warmed by others fall more slowly than their own rate says, as if some heat were left.
    """
    began, now, near = law.initial, law.state[:, 0], RULES.back * _went(law, sensors)
    for side, sign in ((0, 1.0), (2, -1.0)):
        short = sign * (steady[:, side] - began)
        falls = (sign * (now - steady[:, 1]) > 0.0) & (sign * (steady[:, 1] - began) > 0.0)
        steady[:, side] = np.where(falls & (short > -near) & (short < near), began - sign * near, steady[:, side])


def _went(law: Estimates, sensors: Sensors) -> Array:
    """How far the readings used went from where they began, at most (S,) [K]; outliers went nowhere."""
    away = np.where(_outlying(law, sensors), 0.0, np.abs(sensors.reading[:, sensors.time <= law.time] - law.initial[:, None]))
    most: Array = np.nanmax(np.where(np.isfinite(away), away, 0.0), axis=1)
    return most


def _outlying(law: Estimates, sensors: Sensors) -> NDArray[np.bool_]:
    """Which of the readings used (S, n) are outliers: alone, where several that follow each other may be a change."""
    out: NDArray[np.bool_] = law.weights == 0.0
    rows = out.any(axis=1)
    if rows.any():  # of few sensors: the readings used alone say so, whatever comes later
        reading = np.ascontiguousarray(sensors.reading[rows, : out.shape[1]])
        out[rows] &= spike_weights(reading, sensors.resolution[rows]) == 0.0
    return out


def comes_back(law: Estimates, steady: Array, sensors: Sensors) -> NDArray[np.bool_]:
    """Whether a sensor (S,) settles where it began, as after a heat that was switched off: there is no rise to have 95 % of."""
    most = _went(law, sensors)
    near: NDArray[np.bool_] = (np.abs(steady - law.initial) < RULES.back * most) & (most > 20.0 * law.noise)
    return near


def _not_done_before(law: Estimates, least: Array, sensors: Sensors) -> Array:
    """Minutes (S,) after the first reading before which 95 % of the least rise claimed had not been read."""
    used = sensors.time <= law.time
    time, reading = sensors.time[used], sensors.reading[:, used]
    with np.errstate(all="ignore"):  # what does not rise is done where it begins
        done = (reading - law.initial[:, None]) / (least - law.initial)[:, None] >= 0.95
    done &= ~_outlying(law, sensors)
    first = np.where(done.any(axis=1), done.argmax(axis=1), len(time) - 1)
    found: Array = time[first] - time[0]
    return found


def _wide_words(width: float, rise: float, went: float, noise: float) -> str:
    """Of an interval [K] many times the rise [K] of readings; where those went farther [K] and came back, that they did."""
    if went <= max(TURNED * rise, BEYOND_NOISE * noise):
        return f"the steady state is known only to within {width:.3g} K, many times the rise so far; measure longer"
    return (
        f"the steady state is known only to within {width:.3g} K: the readings went {went:.3g} K and came back, which is no "
        "approach to one; see thermofast diagnose"
    )


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
    seen = np.abs(found.state[:, 0] - found.initial)
    bounded = found.bounded | (back & np.isfinite(found.steady_low) & np.isfinite(found.steady_high))
    with np.errstate(invalid="ignore"):
        width = found.steady_high - found.steady_low
        too_wide = width > RULES.widest * np.maximum(seen, 4.0 * found.noise)
        unfit = claimed.check_p < RULES.unfit
        # Of a rise that is nearly done no effect beside the law can say otherwise than its readings.
        low, _, high = np.abs(claimed.steady - found.state[:, :1]).T
        rise = np.abs(claimed.steady[:, 1] - found.initial)
        strong = (claimed.strong > RULES.strong) & ~(np.maximum(low, high) <= RULES.done * rise)
        hides = claimed.hides > RULES.hides
    lawless = _lawless(found, sensors) & ~claimed.other_rise
    out = np.where(claimed.other_rise, 0, (found.weights == 0.0).sum(axis=1))
    # Innovations of averaged readings are alike: that they are says nothing of the law.
    averaged = claimed.averaged > 1
    faded = found.faded & ~claimed.other_rise & ~averaged
    undetermined = ~bounded | too_wide
    swings = _too_many(out, found)
    leave = np.where(claimed.other_rise, 0, claimed.left_last)
    if out.any():  # what a curve does that the law cannot follow, one by one, is no outlier of a probe
        out = np.where(swings | (leave > 0), out, np.minimum(out, _outlying(found, sensors).sum(axis=1)))
    stayed = past.stayed_min if past is not None else np.inf
    # A sensor that is said to be quick has slower parts behind it all the same: those that the others read.
    driven = claimed.rate[claimed.other_rise & claimed.held, 1]
    slow = np.minimum(claimed.rate[:, 1], np.median(driven) if len(driven) else np.inf)
    restless = claimed.other_rise & (stayed * slow < 1.0)
    since = _since_change(claimed, past, changed_min, found)
    with np.errstate(invalid="ignore"):
        fresh = since * np.minimum(claimed.rate[:, 1], _median(claimed.rate[claimed.held, 1])) < RULES.fresh
    behind = np.isfinite(claimed.behind)
    haste = np.isfinite(claimed.faster)
    with np.errstate(invalid="ignore"):
        goes_on = np.abs(claimed.moved) > np.maximum(0.5 * width, RULES.at_rest * found.noise)
    # What was changed in a machine bends its curve later: its past is believed until then, and the row says for how long.
    believed = claimed.known & (past is not None and not past.guessed)
    with np.errstate(invalid="ignore"):
        believed &= until * claimed.rate[:, 1] < 1.0
    went = _went(found, sensors)
    # Where the point that moved most shows a heat that is not constant, one that is said to have settled has it ahead.
    uneven = (unfit | swings | lawless | goes_on | (leave > 0)) & ~claimed.known
    first = int(np.argmax(went))
    with np.errstate(invalid="ignore"):
        done = claimed.rate[:, 1] * (found.time - sensors.time[0]) > DONE
    jumped = _jumped(found, sensors)
    reaches = done & bool(uneven[first]) & ~uneven & ~claimed.known
    doubted = unfit | strong | hides | swings | lawless | restless | fresh | behind | haste | goes_on | reaches
    doubted |= (jumped > 0) | (leave > 0)
    status = np.where(undetermined, "not_determined", np.where(doubted, "model_doubtful", "ok")).tolist()
    messages: dict[int, list[str]] = {}
    still = went < RULES.at_rest * found.noise
    for i in np.flatnonzero(still).tolist():  # what a law leaves that cannot follow the readings is no noise
        still[i] = went[i] < RULES.at_rest * max(float(difference_noise(sensors.reading[i])), float(sensors.resolution[i]))
    for i in np.flatnonzero(back | undetermined | doubted | faded | averaged | still | believed | (out > 0)).tolist():
        said = ["it settles where it began: there is no rise of which 95 % could be told"] if back[i] else []
        if still[i]:
            said.append("it did not move by more than its noise: not heated yet, or settled before")
        if not bounded[i]:
            said.append(_open_side(found.one(i)))
        elif too_wide[i]:
            said.append(_wide_words(float(width[i]), float(seen[i]), float(went[i]), float(found.noise[i])))
        if unfit[i]:
            p = f"p = {claimed.check_p[i]:.1g}"
            said.append(f"the readings leave the law by more than machines do ({p}): see thermofast diagnose")
        elif lawless[i]:
            left = rounded(float(found.misfit[i]))
            said.append(f"one exponential does not describe these readings ({left} K rms): see thermofast diagnose")
        elif strong[i]:
            said.append("an effect beside the law is likely; the interval counts it, thermofast diagnose looks for it")
        if faded[i]:
            counts = "" if status[i] != "ok" else ", which the interval counts"
            said.append(f"the plain law fails from about {sensors.time[tracks.woke[i]]:.4g} min on{counts}")
        if restless[i]:
            said.append(
                f"the heat stayed for {rounded(stayed)} min at most, less than a time constant "
                f"({rounded(1.0 / slow[i])} min): slower parts of the machine cannot be told; let it stay and measure on"
            )
        if fresh[i]:
            said.append(
                f"the load changed {rounded(float(since[i]))} min before the last reading: what it leads to shows after "
                f"{rounded(RULES.fresh / claimed.rate[i, 1])} min; measure on"
            )
        if behind[i]:
            share = rounded(100.0 * claimed.behind[i])
            said.append(f"it has moved by {share} % of what others have: heat may still be on its way to it; measure on")
        if haste[i]:
            said.append(
                f"it would be {rounded(claimed.faster[i])} times as fast as others of the run, which have not settled: what these "
                "still do may reach it, or what was read is no rise (a swing, a probe that came loose); measure on"
            )
        if goes_on[i]:
            said.append(
                f"by the law it had settled after {rounded(DONE / claimed.rate[i, 1])} min, and it moved by "
                f"{rounded(abs(claimed.moved[i]))} K since: more than the interval holds"
            )
        if jumped[i]:
            said.append(
                f"the readings jump at {sensors.time[jumped[i]]:.4g} min, as no machine does: a probe that moved or came loose?"
            )
        if reaches[i]:
            said.append("the point that moved most shows a heat that is not constant, which may still reach this one")
        if hides[i]:
            said.append("a slow second mass may hide that moves the limit out of the interval; measure longer")
        if out[i]:
            gone = int(leave[i])
            said.append(_left_out(int(out[i]), found.weights.shape[1], bool(swings[i]), gone, _since(sensors, found, gone)))
        if believed[i]:
            then = rounded(1.0 / claimed.rate[i, 1])
            said.append(f"the machine is taken to be as it was: a change of its cooling may not show before {then} min")
        if averaged[i]:
            said.append(f"each reading is an average over the last {claimed.averaged[i]}, which the interval counts")
        messages[i] = said
    for i, size in against.items():
        status[i] = "model_doubtful" if status[i] == "ok" else status[i]
        messages[i] = [words(size, until), *messages.get(i, [])]
    return status, messages


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
    out, went = (found.weights == 0.0).sum(axis=1), _went(found, sensors)
    row = left_at_end(found.weights, sensors)
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
            said.insert(0, _wide_words(float(width[i]), float(seen[i]), float(went[i]), float(found.noise[i])))
        messages[i] = said
    for i, size in against.items():
        status[i] = "model_doubtful" if status[i] == "ok" else status[i]
        messages[i] = [words(size, until), *messages.get(i, [])]
    return status, messages


def _lawless(found: Estimates, sensors: Sensors) -> NDArray[np.bool_]:
    """Whether the law leaves more of what was read (S,) in a pattern than any machine that it says something about."""
    far: NDArray[np.bool_] = found.too_large.copy()
    if far.any():
        read = sensors.reading[far][:, sensors.time <= found.time]
        most, least = np.nanpercentile(read, (99, 1), axis=1)
        far[far] = found.misfit[far] > RULES.lawless * (most - least)
    return far


def _jumped(found: Estimates, sensors: Sensors) -> NDArray[np.intp]:
    """Reading (S,) to which a sensor jumps once, farther than several times any other step, and from which it goes on; 0 for none.

    An outlier makes two such steps, a gap none; what jumps at the end may be a change, and is told as one.
    """
    used = sensors.time <= found.time
    time, reading = sensors.time[used], sensors.reading[:, used]
    jumped = np.zeros(len(reading), dtype=np.intp)
    if len(time) < 4 * RULES.last_alone:
        return jumped
    gap = np.diff(time)
    step = np.where(gap > 1.5 * np.median(gap), 0.0, np.abs(np.diff(reading, axis=1)))
    at, rows = step.argmax(axis=1), np.arange(len(reading))
    largest = step[rows, at]
    step[rows, at] = 0.0
    inside = (at >= RULES.last_alone) & (at < step.shape[1] - RULES.last_alone)
    far = largest > np.maximum(RULES.fastest_step * step.max(axis=1), RULES.jump * found.noise)
    return np.where(inside & far, at + 1, jumped)


def _since_change(claimed: Claims, past: Past | None, changed_min: float | None, found: Estimates) -> Array:
    """Minutes since the load changed (S,): the drive of a sensor that follows one, else what is logged and not counted; or inf."""
    counted = past.changed_min if past is not None else -np.inf
    other = -np.inf if changed_min is None or changed_min > found.time else changed_min
    return np.asarray(found.time - np.where(claimed.other_rise, counted, other))


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


def marks(record: IdentifyRecord, start_min: float, room_c: float | None = None) -> tuple[str, float | None, float | None]:
    """(note, steady state [degC], time [min] at which 95 % is done) for a picture; no number over what is not determined.

    room_c [degC] is that at the last reading used, in which the steady state holds, where one was logged.
    """
    if record.status == "not_determined" or record.steady_state_c is None:
        return "not determined", None, None
    low, high = record.steady_state_lo_c, record.steady_state_hi_c
    around = f" ({low:.2f}..{high:.2f})" if low is not None and high is not None else ""
    doubt = ", model doubtful" if record.status == "model_doubtful" else ""
    done = record.t95_min + start_min if record.t95_min is not None else None
    room = f" in a room of {room_c:.1f} °C" if room_c is not None else ""
    when = f", from {record.until_min:.4g} min" if record.until_min is not None else ""
    return f"settles at {record.steady_state_c:.2f} °C{around}{room}{when}{doubt}", record.steady_state_c, done
