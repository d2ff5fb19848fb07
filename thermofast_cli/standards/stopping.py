"""When a stopping rule of a test standard holds, on the readings or foretold; what is missing then, and how far a limit is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import bridged, spike_weights, t_quantile, third_difference_noise
from thermofast.models.core.tails import f_tail
from thermofast.models.imperfection import Drawn, Past
from thermofast.models.noise.spikes import logger_steps
from thermofast.models.observations import up_to
from thermofast.models.standards import LONGEST_GAP, Criterion, three_point

from ..errors import rounded
from ..reading import Run
from ..records import IdentifyRecord

Array = NDArray[np.float64]

#: Curves drawn of each sensor, and points in time at which they are drawn: over what the rule looks back on, and ahead.
DRAWS, BACK, AHEAD = 600, 12, 36
#: Points in time at which the rule is looked at on drawn curves, at most, and per window, at least.
MOST_POINTS, FEWEST_POINTS = 3000, 6
#: How far ahead is looked at most, in lengths of the record used.
FARTHEST = 30.0
SIDES = (0.025, 0.5, 0.975)
#: Degrees of freedom of what lies beyond an interval.
TAIL_FREE = 4
#: Readings without which a rule is not looked at.
FEWEST = 3


@dataclass(frozen=True)
class Trips:
    """Of S sensors: when a rule trips, time (S, 3) [min after the start of the rise], and what is missing then (S, 3) [K].

    Three numbers are the 2.5, 50 and 97.5 % quantiles; of what was seen only the middle one is there.

    seen (S,): it did so on the readings used, late (S,): only after a gap in which it may have done so before. hidden (S,): their
    noise or step hides the change that the rule asks for. reckoned (S,) [degC]: the three-point extrapolation of them.
    """

    time: Array
    missing: Array
    seen: NDArray[np.bool_]
    reckoned: Array
    late: NDArray[np.bool_]
    hidden: NDArray[np.bool_]

    def said(self, sensor: int) -> list[str]:
        """What to know of the trip of a sensor."""
        gap = "a long gap lies before the trip: the rule may have held earlier"
        hidden = "noise or the logger's step hides the change that the rule asks for: told from the curves foretold"
        return [gap] * bool(self.late[sensor]) + [hidden] * bool(self.hidden[sensor])


@dataclass(frozen=True)
class Rule:
    """A stopping rule as it is asked of one run; together_min [min of the run]: when all its sensors first kept to it, or None.

    held: what is known of the machine with all that is logged held as at the last reading used, where it goes on otherwise.
    """

    criterion: Criterion
    together_min: float | None = None
    held: Past | None = None

    @classmethod
    def of(cls, criterion: Criterion, run: Run, start: float, until_min: float | None) -> "Rule":
        """For a run whose rise begins at `start` [min], of what was read until `until_min`, both on the run's clock."""
        minutes = run.time_s / 60.0
        last = math.inf if until_min is None else up_to(until_min)
        some = (minutes >= start) & (minutes <= last)
        readings = []
        for column in run.channels.values():
            good = some & np.isfinite(column)
            if good.sum() >= FEWEST:
                line = _without_spikes(minutes[good], column[good][None])
                if not hides(criterion, minutes[good], line)[0]:
                    readings.append((minutes[good], line[0]))
        if not readings:
            return cls(criterion)
        first = min(float(time[0]) for time, _ in readings)
        together = criterion.all_observed(minutes[some], readings, first)
        return cls(criterion, together if math.isfinite(together) else None)


def trips_of(
    rule: Rule,
    time: Array,
    reading: Array,
    steady: Array,
    start: float,
    foretold: tuple[Array, Array, NDArray[np.bool_]] | None,
    room: Array | None = None,
) -> Trips:
    """What readings (S, n) [degC] at time (n,) [min] show of a rule, and where they do not yet, what is foretold, as in claims.

    steady (S, 3) [degC] is where the sensors settle, a side of which is nan where it is open; start [min] when the rise begins.
    room (>= n,) [degC]: surroundings that are counted, as logged; where a sensor settles is for what they are at the last reading.
    """
    criterion = rule.criterion
    seen, there, doubt = seen_trips(rule, time, reading)
    none = np.full((len(reading), 3), np.nan)
    trips, missing = (none, none.copy()) if foretold is None else (foretold[0] - start, foretold[1].copy())
    # A side on which nobody knows where it ends is none on which the way there is known.
    downwards = missing[:, 1] < 0.0
    far, near = (np.isnan(np.where(downwards, steady[:, a], steady[:, b])) for a, b in ((0, 2), (2, 0)))
    trips[far, 2], trips[near, 0] = np.nan, np.nan
    missing[np.isnan(steady)] = np.nan
    hidden = np.zeros(len(seen), dtype=bool) if foretold is None else foretold[2]
    shown = np.isfinite(seen) & ~hidden
    trips[shown] = np.nan
    trips[shown, 1] = seen[shown] - start
    if room is not None:  # what was missing then was so for the room of then
        then = np.array(
            [_about(time, room[: len(time)], float(t), 0.05 * criterion.window_min) for t in np.where(shown, seen, time[-1])]
        )
        steady = steady + (then - _about(time, room[: len(time)], float(time[-1]), 0.05 * criterion.window_min))[:, None]
    missing[shown] = _missing(criterion, steady - there[:, None], doubt)[shown]
    gaps = time[:-1][np.diff(time) > LONGEST_GAP * criterion.window_min]
    late = np.array([bool((gaps < trip).any()) for trip in seen]) & shown
    return Trips(trips, missing, shown, reckoned_from_three(time, reading), late, hidden)


def _about(time: Array, line: Array, at: float, near: float) -> float:
    """Mean of a line (n,) at times (n,) within `near` of a time; there itself where none are."""
    some = np.abs(time - at) <= near
    return float(line[some].mean()) if some.any() else float(np.interp(at, time, line))


def _missing(criterion: Criterion, away: Array, doubt: Array) -> Array:
    """Kelvin missing (S, 3) at a trip that the readings show, of what the limit is `away` from them (S, 3) then.

    The temperature then is known to its `doubt` (S,) [K, 1 sd]. So are both ends of the window that the rule looks at, which moves
    the trip along a curve that goes on by `change_k` a window.
    """
    low, middle, high = away.T
    own = 1.96 * doubt * np.hypot(1.0, np.sqrt(2.0) * np.abs(middle) / criterion.change_k)
    return np.stack([middle - np.hypot(middle - low, own), middle, middle + np.hypot(high - middle, own)], axis=1)


def seen_trips(rule: Rule, time: Array, reading: Array) -> tuple[Array, Array, Array]:
    """When (S,) [min] readings (S, n) [degC] at time (n,) [min] have kept to the rule, inf where not yet; the temperature then, and
    to how many kelvin it is known by their noise.
    """
    reading, criterion = _without_spikes(time, reading), rule.criterion
    trips = np.array([criterion.observed(time, line, float(time[0]), rule.together_min) for line in reading])
    wide = 0.05 * criterion.window_min
    there, doubt = np.full(len(reading), np.nan), np.zeros(len(reading))
    for i in np.flatnonzero(np.isfinite(trips)):
        near = np.abs(time - trips[i]) <= wide
        there[i] = reading[i, near].mean() if near.sum() >= 2 else np.interp(trips[i], time, reading[i])
        doubt[i] = third_difference_noise(reading[i]) / math.sqrt(max(int(near.sum()), 1))
    return trips, there, doubt


def hides(criterion: Criterion, time: Array, reading: Array) -> NDArray[np.bool_]:
    """Whether the noise or the step of readings (S, n) without outliers hides the change that a rule asks for (S,)."""
    noise = np.array([third_difference_noise(line) for line in reading])
    return criterion.hidden(time, noise, logger_steps(reading))


def _without_spikes(time: Array, reading: Array) -> Array:
    """Readings (S, n) with what their neighbours say in place of an outlier: one wild reading keeps no test going."""
    wild = spike_weights(np.ascontiguousarray(reading), logger_steps(reading)) == 0.0
    return bridged(time, reading, wild)


def reckoned_from_three(time: Array, reading: Array) -> Array:
    """Three-point extrapolation (S,) [degC] of the first, the middle and the last reading (S, n) at time (n,) [min]."""
    at = time[0] + (time[-1] - time[0]) * np.array([0.0, 0.5, 1.0])
    points = np.array([np.interp(at, time, line) for line in reading])
    return three_point(*points.T)


def asked_ahead(criterion: Criterion, time: Array, level: Array, steady: Array, rate: Array, hidden: bool = False) -> Array:
    """Times (k,) [min] at which curves are drawn: what the rule looks back on, and until it must have tripped on all sensors.

    time (n,) [min] of the readings used, level (S,) [degC] at their end; steady (S, 3), rate (S, 3) as foretold. hidden: readings
    do not show whether it has tripped, and all of them are looked back on.
    """
    last, span = float(time[-1]), float(time[-1] - time[0])
    back = float(time[0]) if hidden else max(float(time[0]), last - criterion.length_min)
    with np.errstate(all="ignore"):
        slow = np.where(rate[:, 0] > 0.0, rate[:, 0], np.nan)
        grown = np.expm1(np.minimum(slow * criterion.window_min, 50.0))
        to_go = np.maximum(np.abs(steady[:, 0] - level), np.abs(steady[:, 2] - level))
        wait = np.log(np.maximum(to_go * grown / criterion.change_k, 1.0)) / slow
    far = criterion.length_min + float(np.nanmax(np.nan_to_num(wait, nan=0.0, posinf=FARTHEST * span), initial=0.0))
    # Rounded: what else is asked for moves the last digits of what is foretold, and with them which curves are drawn.
    end = last + float(f"{min(1.2 * far, max(FARTHEST * span, 2.0 * criterion.length_min)):.4g}")
    ahead = last + (end - last) * np.linspace(0.0, 1.0, AHEAD) ** 2
    return np.unique(np.concatenate([np.linspace(back, last, AHEAD if hidden else BACK), ahead]))


def foretold_trips(criterion: Criterion, drawn: Drawn, at: Array, last: float, hidden: NDArray[np.bool_]) -> tuple[Array, Array]:
    """(times [min], kelvin missing), (S, 3) each, of a rule that has not tripped until the `last` reading; inf where it may never.

    at (k,) [min] are the times of the curves drawn, from what the rule looks back on. Sensors (S,) whose readings have `hidden`
    whether it has are judged from the beginning on, each curve from when it changed most: what is late keeps to any rule at first.
    """
    length = float(at[-1] - at[0])
    points = int(np.clip(MOST_POINTS * criterion.window_min / max(length, 1e-9), FEWEST_POINTS, 60))
    dense = criterion.times(float(at[0]), float(at[-1]), points)
    time, missing = (np.full((len(drawn.limit), 3), np.nan) for _ in range(2))
    for i, (curves, limits, rates) in enumerate(zip(drawn.curve, drawn.limit, drawn.rate, strict=True)):
        if not np.isfinite(limits).all():
            continue
        # One exponential is straight over 1 - exp(-rate t).
        there = -np.expm1(-np.outer(rates, dense - at[0]))
        asked = -np.expm1(-np.outer(rates, at - at[0]))
        lines = np.array([np.interp(*line) for line in zip(there, asked, curves, strict=True)])
        trips = criterion.trips(dense, lines, points, None if hidden[i] else last)
        trips = trips if hidden[i] else np.maximum(trips, last)
        some = np.isfinite(trips)
        place = np.clip((trips[some] - dense[0]) / (dense[1] - dense[0]), 0.0, len(dense) - 1.000001)
        below = place.astype(np.intp)
        rows = np.flatnonzero(some)
        left, right = lines[rows, below], lines[rows, below + 1]
        time[i] = np.quantile(trips, SIDES, method="inverted_cdf")
        if some.mean() > SIDES[1]:
            missing[i] = np.quantile(limits[some] - (left + (place - below) * (right - left)), SIDES)
        early, late = drawn.factor[i]
        farther = (late, 1.0, early) if missing[i, 1] < 0.0 else (early, 1.0, late)  # of what cools, less than nothing is missing
        for three, factor in ((time[i], (early, 1.0, late)), (missing[i], farther)):
            with np.errstate(invalid="ignore"):
                three[:] = np.where(np.isfinite(three), three[1] + np.array(factor) * (three - three[1]), three)
        time[i, 0] = time[i, 0] if hidden[i] else max(time[i, 0], last)
    return time, missing


def columns_of(trips: Trips) -> dict[str, Array]:
    """Columns (S,) of records; nan for none."""
    names = ("trip_min", "trip_lo_min", "trip_hi_min"), ("missing_k", "missing_lo_k", "missing_hi_k")
    found: dict[str, Array] = {}
    for three, columns in zip((trips.time, trips.missing), names, strict=True):
        found |= dict(zip(columns, (three[:, 1], three[:, 0], three[:, 2]), strict=True))
    return found | {"three_point_c": trips.reckoned}


def with_limit(record: IdentifyRecord, limit_c: float) -> IdentifyRecord:
    """The record with the margin to a limit [degC], and the chance that it is exceeded.

    In the room asked for, where one was. On each side of the middle the chance is that of a normal distribution as far as the
    interval goes, and beyond that of Student's t: what a record cannot exclude is rare, and large.
    """
    three = record.room_steady_c, record.room_steady_lo_c, record.room_steady_hi_c
    if record.room_c is None:
        three = record.steady_state_c, record.steady_state_lo_c, record.steady_state_hi_c
    middle, low, high = three
    if middle is None:
        return replace(record, limit_c=limit_c)
    sides = [None if side is None else limit_c - side for side in (high, low)]
    margin = limit_c - middle
    side = high if margin > 0.0 else low
    chance = None
    if side is not None:
        half = abs(side - middle) / 1.96
        chance = _beyond(margin / half) if half > 0.0 else float(margin < 0.0)
    return replace(record, limit_c=limit_c, margin_k=margin, margin_lo_k=sides[0], margin_hi_k=sides[1], over_limit_p=chance)


def _beyond(deviations: float) -> float:
    """Chance above so many deviations, of which an interval has 1.96 to either side."""
    if abs(deviations) <= 1.96:
        return 0.5 * math.erfc(deviations / math.sqrt(2.0))
    far = 0.5 * float(f_tail(1, TAIL_FREE, (deviations / 1.96 * float(t_quantile(float(TAIL_FREE)))) ** 2))
    return far if deviations > 0.0 else 1.0 - far


def with_last(records: Sequence[IdentifyRecord]) -> list[IdentifyRecord]:
    """The records, on which of each run's sensors the rule trips last; no word where one may never trip."""
    found = list(records)
    for run in dict.fromkeys(r.run for r in records):
        mine = [i for i, r in enumerate(records) if r.run == run and r.criterion]
        if not mine or any(records[i].trip_min is None for i in mine):
            continue
        last = max(mine, key=lambda i: records[i].trip_min or 0.0)
        for i in mine:
            found[i] = replace(records[i], trip_last=i == last)
    return found


def in_words(records: Sequence[IdentifyRecord]) -> list[str]:
    """A sentence for each run: when the rule holds on all its sensors, which is last, what is missing there then."""
    found = []
    for run in dict.fromkeys(r.run for r in records if r.criterion):
        mine = [r for r in records if r.run == run and r.criterion]
        last = next((r for r in mine if r.trip_last), None)
        if last is None or last.trip_min is None:
            never = ", ".join(r.channel for r in mine if r.trip_min is None)
            found.append(f"{run}: {mine[0].criterion} may never hold on {never}")
            continue
        band = f" ({last.trip_lo_min:.0f} to {last.trip_hi_min:.0f})" if None not in (last.trip_lo_min, last.trip_hi_min) else ""
        past = last.trip_from == "readings" or last.trip_min + (last.start_min or 0.0) <= (last.until_min or math.inf)
        holds = "holds" if past else "will hold"
        there = "" if last.missing_k is None else f"; {rounded(last.missing_k)} K are still missing there then"
        if last.missing_k is not None and last.missing_lo_k is not None and last.missing_hi_k is not None:
            there += f" ({rounded(last.missing_lo_k)} to {rounded(last.missing_hi_k)})"
        left = [r.channel for r in records if r.run == run and not r.criterion]
        every = f"on all sensors but {', '.join(left)}, which could not be read" if left else "on all sensors"
        where = "" if len(mine) < 2 and not left else f" {every}, on {last.channel} last"
        begun = f" of the rise, which began at {rounded(last.start_min)} min" if last.start_min else ""
        doubt = "" if all(r.status == "ok" for r in mine) else ", which is in doubt"
        found.append(f"{run}: {last.criterion} {holds} after {last.trip_min:.0f} min{band}{begun}{where}{doubt}{there}")
    return found
