"""What readings themselves show: the equilibrium of a complete record, whether they contradict what was said of them, and the room
as it was logged.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermofast.models import difference_noise, spike_weights
from thermofast.models.imperfection import lagged
from thermofast.models.noise.chain import fell_back
from thermofast.models.noise.spikes import bridged
from thermofast.models.standards.settled import Passing, without_strays
from thermofast.models.swing import later_swing, swing_of
from thermofast.models.uncertainty.kinks import kink, moved_most
from thermofast.models.uncertainty.surroundings import room_ahead

from ..errors import rounded
from ..reading.units import ABSOLUTE_ZERO_C
from .rules import RULES
from .sensor import Sensors

if TYPE_CHECKING:
    from .estimate import Claims, Estimates

Array = NDArray[np.float64]

#: Share of an interval's width, and size [K], from which what the room may do until the time asked for is told.
TOLD_OF_ROOM, TOLD_FROM = 0.25, 0.2
#: Share of a settling time over which readings are averaged to find it: the bend within moves it by a few ten-thousandths.
WINDOW = 0.05


def steadied(sensors: Sensors, until_min: float | None, together: int, room: Array | None) -> Sensors:
    """Sensors without the swing that the readings of the first `until_min` show, which leaves temperatures as means over its cycle.

    together: columns of a run that are looked at at once; room (N,) [degC] where it is logged: one that swings alike explains it.
    One that began later is told, and left where it is.
    """
    n = sensors.until(until_min)
    swings = False
    swung, swing, notes = np.zeros_like(sensors.reading), np.zeros((len(sensors), 2)), list(sensors.notes)
    for group in np.unique(sensors.rows // together).tolist():
        mine = np.flatnonzero(sensors.rows // together == group)
        given = sensors.time[:n], sensors.reading[mine, :n], sensors.resolution[mine]
        found = swing_of(*given)
        told = later_swing(*given) if found is None else found
        if told is None or (room is not None and told.also_in(sensors.time[:n], room[:n])):
            continue
        ends, what = np.stack(told.ends(), axis=1), f"a period of {rounded(told.period, 3)} min"
        if found is not None:
            swings, swung[mine], swing[mine] = True, found.at(sensors.time), ends
            what += ": temperatures are means over its cycle"
        else:  # what came before is no part of it, and nothing is taken out
            what += f" from {rounded(told.start, 3)} min on at the latest, as a cooling or a load that goes on and off has it"
        for k, half in zip(mine[told.swings].tolist(), 0.5 * np.ptp(ends[told.swings], axis=1), strict=True):
            if half >= difference_noise(sensors.reading[k, :n]):  # else too little to be worth a word
                notes[k] = (*notes[k], f"swings by {rounded(float(half))} K with {what}")
    if not swings:
        return replace(sensors, notes=tuple(notes))
    return replace(sensors, reading=sensors.reading - swung, swung=swung, swing=swing, notes=tuple(notes))


def swinging(sensors: Sensors, until_min: float | None, together: int) -> Sensors:
    """Sensors as they are, with the ends of the swing that readings of the first `until_min` show, where a mean is foretold."""
    return replace(sensors, swing=steadied(sensors, until_min, together, None).swing)


def counted_to(time: Array, run_time: Array, until_min: float | None, start_min: float) -> tuple[float, tuple[str, ...]]:
    """Time [min] from which what is left counts, and what to say of readings that begin late, or end long before the run.

    It is the last of a sensor's readings used, at time (n,); the run's, where that goes on for longer than several of the sensor's
    readings, and than a share of all it had read: a probe that died.
    """
    own, usual = float(time[-1]), float(np.median(np.diff(time))) if len(time) > 1 else math.inf
    read = len(run_time) if until_min is None else int(np.searchsorted(run_time, until_min + 1e-9))
    last, long = float(run_time[max(read - 1, 0)]), max(RULES.silent_readings * usual, RULES.silent_share * (own - float(time[0])))
    late = float(time[0]) - start_min
    said = (f"its readings begin at {float(time[0]):.4g} min, from which on its rise is counted",) if late > long else ()
    if last - own <= long:
        return own, said
    return last, (*said, f"no reading after {own:.4g} min, the run goes on to {last:.4g}: check the probe")


def measured_equilibria(
    time: Array, reading: Array, resolution: Array | float = 0.0, behind: Array | None = None
) -> tuple[Array, Array]:
    """(steady states [degC], settling times [min] after the first reading), each (S,), of records (S, n) that reached equilibrium.

    Complete means that the last fifth drifts by less than 0.6 % of the whole rise. The steady state is the mean of
    the last tenth; settled is the moment from which a running mean stays within 5 % of the rise. The
    mean runs over as many readings as bring the noise well inside that band. nan where a record is not complete, a time also where
    that mean would be too long, where nobody read when it came, or where the logger's step (S,) [K] is as wide as the band. Of
    sensors to which heat is still on its way (`behind`, else nan) a turning point is none.
    """
    sensors, n = reading.shape
    steady, settled = np.full(sensors, np.nan), np.full(sensors, np.nan)
    if n < RULES.fewest_complete:
        return steady, settled
    tail = n - max(int(n * RULES.drift_share), 6)
    level = reading[:, n - max(int(n * RULES.last_share), 3) :].mean(axis=1)
    rise = np.abs(level - _first_of(reading))
    at = time[tail:] - time[tail:].mean()
    values = reading[:, tail:] - reading[:, tail:].mean(axis=1, keepdims=True)
    slope = values @ at / float(at @ at)
    drift = np.abs(slope) * float(time[-1] - time[tail])
    noise = np.sqrt(np.maximum((values * values).sum(axis=1) - slope**2 * float(at @ at), 0.0) / len(at))
    here = np.ones(sensors, dtype=bool) if behind is None else np.isnan(behind)
    complete = here & (rise > 0.0) & (drift <= RULES.complete * rise) & (noise * math.sqrt(12.0 / len(at)) <= RULES.complete * rise)
    steady[complete] = level[complete]
    width = _wide_enough(noise, rise)
    some = np.flatnonzero(complete & (width <= n // 10) & (resolution < 0.05 * rise))
    odd = width[some].astype(int) | 1
    for wide in np.unique(odd[odd <= n // 10]).tolist():
        rows = some[odd == wide]
        sums = np.zeros((len(rows), n + 1))
        np.cumsum(reading[rows] - level[rows, None], axis=1, out=sums[:, 1:])
        outside = np.abs(sums[:, wide:] - sums[:, :-wide]) > (0.05 * wide) * rise[rows, None]
        last = np.where(outside.any(axis=1), outside.shape[1] - 1 - outside[:, ::-1].argmax(axis=1) + wide // 2, 0)
        before = np.maximum(last - wide // 2, 0)
        gap = time[np.minimum(last + wide // 2 + 1, n - 1)] - time[before] - wide * float(np.median(np.diff(time)))
        settled[rows] = np.where(gap <= 0.05 * (time[last + 1] - time[0]), time[last + 1] - time[0], np.nan)
    return steady, settled


def _wide_enough(noise: Array, rise: Array) -> Array:
    """Readings (S,) whose mean has its noise [K] well within 5 % of a rise [K]; three at least."""
    with np.errstate(all="ignore"):
        found: Array = np.maximum(3.0, np.ceil((6.0 * noise / (0.05 * np.abs(rise))) ** 2))
    return found


def _first_of(reading: Array) -> Array:
    """Where records (S, n) begin (S,) [degC]: at the first reading if the next two go on from it, else in the middle of three."""
    first = reading[:, :3]
    steps = np.diff(first, axis=1)
    found: Array = np.where((steps[:, 0] * steps[:, 1]) > 0.0, first[:, 0], np.sort(first, axis=1)[:, 1])
    return found


def measured_equilibrium(time: Array, reading: Array) -> tuple[float, float | None] | None:
    """As :func:`measured_equilibria` for one record (n,), or None where it is not complete."""
    steady, settled = measured_equilibria(time, reading[None])
    if math.isnan(steady[0]):
        return None
    return float(steady[0]), None if math.isnan(settled[0]) else float(settled[0])


def outside_band(residual: Array, half_width: Array, noise: Array | float, factor: float = RULES.band_factor) -> NDArray[np.bool_]:
    """Which residuals (..., n) leave `factor` times the prediction's band; nan ones do not. Broadcasts."""
    with np.errstate(invalid="ignore"):
        outside: NDArray[np.bool_] = np.abs(residual) > factor * half_width + RULES.noise_factor * noise
    return outside


def contradicts(residual: Array, half_width: Array, noise: Array, factor: float = RULES.band_factor) -> NDArray[np.bool_]:
    """Whether the readings ahead (S, n), nan for one that does not count, leave the bands of S predictions; noise (S,) [K]."""
    outside = outside_band(residual, half_width, noise[:, None], factor).sum(axis=1)
    found: NDArray[np.bool_] = outside >= np.maximum(RULES.fewest_outside, RULES.share_outside * np.isfinite(residual).sum(axis=1))
    return found


def contradiction(residual: Array, half_width: Array, noise: float) -> float | None:
    """Largest residual [K] of the readings ahead (n,) where they leave the prediction's band, or None where they stay in it.

    half_width (n,) [K] is that of the 95 % band of the curve on the side of each residual, noise [K] a reading's deviation. A right
    model's curve leaves the band so widened about once in a thousand records.
    """
    if not contradicts(residual[None], half_width[None], np.array([noise]))[0]:
        return None
    return float(np.abs(residual[outside_band(residual, half_width, noise)]).max())


def against_claims(error: Array, band: tuple[Array, Array, Array], found: "Estimates", claimed: "Claims") -> dict[int, float]:
    """By how much [K] readings ahead contradict what was claimed of some sensors.

    error (S, m) [K] beside the curve and what a logged room does, nan for a reading that does not count; band (low, middle, high),
    each (S, m) [degC], as claimed for a room that stays. Readings leave it, or go on far beyond the interval of the limit, which no
    approach to it does: what the band has room for there is a room that moves, and the limit was said without it.
    """
    low, curve, high = band
    half, against = np.where(error > 0.0, high - curve, curve - low), {}
    for k in np.flatnonzero(contradicts(error, half, found.noise, RULES.claimed_factor)).tolist():
        against[k] = float(np.abs(error[k][outside_band(error[k], half[k], found.noise[k], RULES.claimed_factor)]).max())
    low, middle, high = claimed.steady.T
    on = np.where(middle >= found.state[:, 0], 1.0, -1.0)
    way, wide = on[:, None] * (error + curve - middle[:, None]), RULES.far_beyond * np.where(on > 0.0, high - middle, middle - low)
    way = np.where(way > 0.0, way, np.where(np.isnan(way), np.nan, 0.0))
    for k in np.flatnonzero(contradicts(way, np.broadcast_to(wide[:, None], way.shape), found.noise, 1.0)).tolist():
        against[k] = max(against.get(k, 0.0), float(np.nanmax(way[k])))
    return against


def words(size: float, until_min: float) -> str:
    """What to say of a contradiction of `size` [K]."""
    after = f"the readings after {until_min:.4g} min leave the prediction's band"
    return f"{after}, by up to {rounded(size)} K: the interval does not hold"


def room_at(time_min: Array, room: Array | None, times: Array, until: float) -> Array | None:
    """A room logged (N,) at time_min (N,), at times (n,), straight over its gaps; None where too little of it is logged.

    What is logged after `until`, the last reading used, says nothing of what was before.
    """
    if room is None:
        return None
    known = np.isfinite(room)
    read = known & (time_min <= until + 1e-9)
    if read.sum() < RULES.fewest_of_room:
        return None
    edges = np.clip(np.concatenate([times[:1], time_min[read], [until]]), times[0], None)
    if np.diff(edges).max() > RULES.room_gap * (until - times[0]):
        return None
    found: Array = np.interp(times, time_min[read], room[read])
    later = times > until + 1e-9
    found[later] = np.interp(times[later], time_min[known], room[known])
    return found


def moved_by_room(time_min: Array, room: Array | None, rate: Array, last: float, later: Array) -> Array:
    """What a logged room does (S, m) [K] at times (m,) after the `last` reading used, from which on a prediction took it to stay.

    That is not held against it; rate (S,) [1/min].
    """
    grid = np.linspace(last, float(later[-1]), 200)
    there = room_at(time_min, room, grid, last)
    if there is None or grid[-1] <= grid[0]:
        return np.zeros((len(rate), len(later)))
    moved = lagged(np.nan_to_num(rate), float(grid[1] - grid[0]), there - there[0])
    return np.array([np.interp(later, grid, line) for line in moved])


def until_then(
    at: Array, time_min: Array, room: Array, rate: Array, until: float, gain_doubt: float
) -> tuple[Array, tuple[str, ...]]:
    """Temperatures at a named time (S, 3) [degC], foretold for a room that stays, with what the room may do until then.

    room (n,) [degC] is logged at time_min (n,), rate (S,) [1/min], gain_doubt (1 sd) by how much sensors follow it more or less.
    Also what the room itself does until then, in words where it counts.
    """
    rates = np.append(np.where(np.isfinite(rate), rate, 1.0), math.inf)  # the last is the room itself
    mean, deviation = room_ahead(time_min, room, rates, until)
    doubt = 1.96 * np.hypot(deviation, gain_doubt * np.abs(mean))[:-1]
    low, middle, high = (side + mean[:-1] for side in at.T)
    moved = np.stack([middle - np.hypot(middle - low, doubt), middle, middle + np.hypot(high - middle, doubt)], axis=1)
    with np.errstate(invalid="ignore"):
        counts = np.any(doubt + np.abs(mean[:-1]) > np.maximum(TOLD_OF_ROOM * (at[:, 2] - at[:, 0]), TOLD_FROM))
    words = f"the room as logged may move by {rounded(mean[-1])} ± {rounded(1.96 * deviation[-1])} K until then, which at_c counts"
    return moved, (words,) if counts else ()


def in_room(
    steady: Sequence[Array], logged_c: float | None, room_c: float | None, gain_doubt: float
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns of the limit (low, middle, high) (S,) [degC], found in the room at the last reading, in another: it moves as much.

    Also, in words, by how much it may move more or less (1 sd: gain_doubt) where that is most of the interval.
    """
    found: tuple[Array, ...] = (np.full_like(steady[0], np.nan),) * 4
    words: tuple[str, ...] = ()
    if logged_c is not None and room_c is not None:
        moved = room_c - logged_c
        low, middle, high = steady
        below, above = (np.hypot(side, 1.96 * gain_doubt * abs(moved)) for side in (middle - low, high - middle))
        found = (np.full_like(middle, room_c), middle + moved, middle + moved - below, middle + moved + above)
        if 1.96 * gain_doubt * abs(moved) > np.median(np.nan_to_num(0.5 * (high - low))):
            words = (
                f"room_steady_c is for a room {rounded(abs(moved))} K {'warmer' if moved > 0.0 else 'colder'}: a point follows"
                f" its room by the whole of that, give or take {100.0 * 1.96 * gain_doubt:.0f} % (a coolant or a floor holds it"
                " back), which is most of that interval; a run in such a room would say",
            )
    return dict(zip(("room_c", "room_steady_c", "room_steady_lo_c", "room_steady_hi_c"), found, strict=True)), words


def begun_as_read(law: "Estimates", sensors: Sensors, other_rise: NDArray[np.bool_]) -> "Estimates":
    """Estimates where sensors with another rise than the law's (S,) begin at their first reading, which the law passes by."""
    if not other_rise.any():
        return law
    first = np.where(outlying(law, sensors)[:, 0], np.median(sensors.reading[:, :3], axis=1), sensors.reading[:, 0])
    return replace(law, initial=np.where(other_rise, first, law.initial))


def with_claims(
    law: "Estimates", claimed: "Claims", sensors: Sensors, back: NDArray[np.bool_], staged: bool = False
) -> "Estimates":
    """Estimates with what may be claimed in place of what the law alone says; an unbounded side is nan.

    back: as :func:`comes_back` says of each sensor; staged: what has another rise than the law's has that of a load in stages.
    """
    steady, t95 = claimed.steady.copy(), claimed.t95.copy()
    # Where the prior of the rate holds the far side it would be a number out of that prior; where the heat has hardly come, one out
    # of what came first.
    rises = law.state[:, 0] >= law.initial
    behind = np.isfinite(claimed.behind)
    open_ = claimed.open_limit | behind
    with np.errstate(invalid="ignore"):
        against = claimed.behind < 0.0  # the others: neither its own way nor theirs is the rest of it
    steady[open_ & (rises | against), 2] = np.nan
    steady[open_ & (~rises | against), 0] = np.nan
    least = np.where(rises, steady[:, 0], steady[:, 2])  # that which leaves the least to be done
    start = began(law, sensors)
    t95[:, 0] = np.clip(np.maximum(t95[:, 0], _not_done_before(law, start, least, sensors)), None, t95[:, 1])
    _as_read(
        t95, law, start, np.where(rises[:, None], steady, steady[:, ::-1]), claimed.rate, sensors, ~claimed.other_rise | staged
    )
    t95[claimed.open_t95 | behind, 2] = np.nan
    t95[back] = np.nan
    most = went(law, sensors)
    _to_the_beginning(steady, law, most)
    steady[steady[:, 0] < ABSOLUTE_ZERO_C, 0] = np.nan  # as far as nobody can go is no bound
    _without_endless(steady, t95, law, most)
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


def _without_endless(steady: Array, t95: Array, law: "Estimates", most: Array) -> None:
    """Opens limits (S, 3) many times farther off than all that was read, most (S,) [K], and their times (S, 3): a number would be a
    promise.
    """
    seen = np.maximum(most, law.noise)[:, None]
    with np.errstate(invalid="ignore"):
        far = np.abs(steady - law.state[:, :1]) > RULES.farthest * seen
    steady[far] = np.nan
    rises = steady[:, 1] >= law.initial
    t95[far[:, 2] & rises, 2] = t95[far[:, 0] & ~rises, 2] = np.nan
    t95[far[:, 1]] = np.nan


def came_loose(time: Array, reading: Array, resolution: Array, changed_min: float | None = None) -> dict[int, str]:
    """What to say of sensors whose readings (S, n) at time (n,) [min] fell back as a probe does that came off: :func:`fell_back`.

    resolution (S,) [K] is the logger's step; what was switched at `changed_min` may have cooled it.
    """
    said = {}
    for i, fell in fell_back(time, reading, np.maximum(difference_noise(reading), resolution)).items():
        begins = float(time[fell.first])
        if changed_min is None or not begins - fell.minutes <= changed_min <= begins + 2.0 * fell.minutes:
            said[i] = (
                f"it falls {rounded(fell.fall)} K in {rounded(fell.minutes)} min at {begins:.4g} min, to where it began, while the "
                f"others go on: did the probe come off? look at it, and use what came before (--until {begins:.4g})"
            )
    return said


def stepped(time: Array, reading: Array, resolution: Array, rate: Array) -> dict[int, tuple[bool, str]]:
    """Whether the heat or the cooling of a run changed within what was read, and no column says so: of each sensor for which it is
    not behind, whether it has just come, and what to say.

    reading (S, n) [degC] at time (n,) [min]; rate (S,) [1/min], inf of one of which nothing is to be said.
    """
    most = moved_most(reading)
    some = reading[most]
    whole = bridged(time, some, (spike_weights(some, resolution[most]) == 0.0) | ~np.isfinite(some))
    found = kink(time, whole[np.isfinite(whole).all(axis=1)])
    if found is None or found.gain < RULES.kinked or found.share < RULES.kinked_share:
        return {}
    since, before = float(time[-1]) - found.minutes, found.minutes - float(time[0])
    turns = since * rate
    at, said = rounded(found.minutes), {}
    # One rate for what came before and after may be any.
    for i in np.flatnonzero((np.minimum(turns, since / before) < RULES.kink_over) & np.isfinite(rate)).tolist():
        fresh = bool(turns[i] < RULES.fresh)
        then = ", and what it leads to shows later: measure on" if fresh else "; --auto looks for it"
        said[i] = (fresh, f"all points turn at about {at} min, as where the heat or the cooling changes{then}")
    return said


def _to_the_beginning(steady: Array, law: "Estimates", most: Array) -> None:
    """Opens intervals (S, 3) that end just short of where a sensor began, to which it is on its way back: the heat may be off.

    most (S,) [K]: how far it :func:`went`.
    Bodies that are warmed by others fall more slowly than their own rate says, as if some heat were left.
    """
    began, now, near = law.initial, law.state[:, 0], RULES.back * most
    for side, sign in ((0, 1.0), (2, -1.0)):
        short = sign * (steady[:, side] - began)
        falls = (sign * (now - steady[:, 1]) > 0.0) & (sign * (steady[:, 1] - began) > 0.0)
        steady[:, side] = np.where(falls & (short > -near) & (short < near), began - sign * near, steady[:, side])


def went(law: "Estimates", sensors: Sensors) -> Array:
    """How far the readings used went from where they began, at most (S,) [K]; outliers went nowhere."""
    away = np.where(outlying(law, sensors), 0.0, np.abs(sensors.reading[:, sensors.time <= law.time] - law.initial[:, None]))
    most: Array = np.nanmax(np.where(np.isfinite(away), away, 0.0), axis=1)
    return most


def outlying(law: "Estimates", sensors: Sensors) -> NDArray[np.bool_]:
    """Which of the readings used (S, n) are outliers: alone, where several that follow each other may be a change."""
    out: NDArray[np.bool_] = law.weights == 0.0
    rows = out.any(axis=1)
    if rows.any():  # of few sensors: the readings used alone say so, whatever comes later
        reading = np.ascontiguousarray(sensors.reading[rows, : out.shape[1]])
        out[rows] &= spike_weights(reading, sensors.resolution[rows]) == 0.0
    return out


def comes_back(law: "Estimates", steady: Array, sensors: Sensors) -> NDArray[np.bool_]:
    """Whether a sensor (S,) settles where it began, as after a heat that was switched off: there is no rise to have 95 % of."""
    most = went(law, sensors)
    near: NDArray[np.bool_] = (np.abs(steady - law.initial) < RULES.back * most) & (most > 20.0 * law.noise)
    return near


def _not_done_before(law: "Estimates", start: Array, least: Array, sensors: Sensors) -> Array:
    """Minutes (S,) after the first reading of the last one before 95 % of the least rise claimed, from `start`, had been read."""
    used = sensors.time <= law.time
    time, reading = sensors.time[used], sensors.reading[:, used]
    with np.errstate(all="ignore"):  # what does not rise is done where it begins
        done = (reading - start[:, None]) / (least - start)[:, None] >= 0.95
    done &= ~outlying(law, sensors)
    first = np.where(done.any(axis=1), np.maximum(done.argmax(axis=1) - 1, 0), len(time) - 1)
    found: Array = time[first] - time[0]
    return found


def began(law: "Estimates", sensors: Sensors) -> Array:
    """Where the rise of each sensor begins (S,) [degC]: where the law's does; at the first reading, where the law passes it by.

    A part that is warm within minutes has risen before the exponential of the others begins. One reading alone may be an outlier:
    the second must lie on the same side.
    """
    time, reading = sensors.time[:2] - sensors.time[0], sensors.reading[:, :2]
    with np.errstate(all="ignore"):
        rise = law.steady_state - law.initial
        off = reading - (law.initial[:, None] - rise[:, None] * np.expm1(-law.rate[:, None] * time))
        far = np.abs(off) > np.stack([np.maximum(6.0 * law.noise, RULES.begins * np.abs(rise)), 3.0 * law.noise], axis=1)
        early = far.all(axis=1) & (off.prod(axis=1) > 0.0)
    found: Array = np.where(early, reading[:, 0], law.initial)
    return found


def _as_read(
    t95: Array, law: "Estimates", start: Array, limits: Array, rate: Array, sensors: Sensors, which: NDArray[np.bool_]
) -> None:
    """Puts settling times (S, 3) [min after the first reading] right, in place, where the readings used contradict the middle one.

    start (S,) [degC]: where each rise :func:`began`; limits (S, 3) [degC]: those claimed, that which is reached first, the middle,
    that which is reached last; rate (S, 3) [1/min];
    which (S,): those whose rise is one exponential's, and does not go on and off.
    What was read is no matter of a model: where 95 % of the rise to the limit had been done for good, the time of that stands;
    where they had not, though the model says so, the way from the last readings on.
    """
    used = sensors.time <= law.time
    time, reading = sensors.time[used] - sensors.time[0], sensors.reading[:, used]
    middle, elapsed = limits[:, 1], float(time[-1])
    rise, of_law = middle - start, middle - law.initial
    width = _wide_enough(law.noise, rise)
    with np.errstate(all="ignore"):
        # What is done before the law's exponential begins need not be done by it.
        sooner = np.where(start != law.initial, np.log(np.abs(rise / of_law)) / rate[:, 1], 0.0)
    looked = which & (len(time) >= RULES.fewest_complete) & np.isfinite(t95[:, 1]) & (width <= len(time) // 10) & (rise != 0.0)
    step = elapsed / max(len(time) - 1, 1)
    for i in np.flatnonzero(looked).tolist():
        wide = int(np.clip(WINDOW * t95[i, 1] / step, width[i], max(len(time) // 10, 3))) | 1
        if abs(middle[i] - np.median(reading[i, -wide:])) > 0.05 * abs(rise[i]) and t95[i, 1] >= elapsed:
            # On its way, and not said to have come.
            t95[i, :2] = np.maximum(t95[i, :2] - np.nan_to_num(sooner[i]), np.minimum(t95[i, :2], elapsed))
            continue
        noise = min(float(law.noise[i]), float(difference_noise(reading[i])))
        line = without_strays(reading[i], noise) - start[i]
        passing = Passing(time, line, wide, 1.96 * noise / math.sqrt(wide), bool(start[i] != law.initial[i]))
        passing.correct(t95[i], limits[i] - start[i], rate[i])
