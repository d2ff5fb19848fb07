"""What may be claimed of sensors whose machine is not the law: joins blocks of sensors and ``models/imperfection``.

Sensors of a run are taken in groups, in the order of its columns, so that what one says does not depend on the number of processes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import averaging_window, bridged, difference_noise, spike_weights, third_difference_noise
from thermofast.models.imperfection import Imperfection, Part, Past, Rates, Rest, Settled, pilot, settle
from thermofast.models.noise.chain import originals
from thermofast.models.standards import Criterion
from thermofast.models.uncertainty.companions import (
    all_before,
    faster,
    moved_since,
    rest_of_warm,
    settled_beside,
    slow_paces,
    still_ahead,
    went_back,
)
from thermofast.models.uncertainty.surroundings import room_paths

from ..standards.stopping import DRAWS, Rule, asked_ahead, foretold_trips, hides
from .estimate import Claims, Estimates, none_yet, says_more
from .measured import began
from .rules import RULES
from .sensor import Sensors, left_at_end

Array = NDArray[np.float64]
Masks = Sequence[NDArray[np.bool_]]

#: Sensors that share what they say: columns of a run in their order.
GROUP = 50
#: Names of sensors that a row lists before it counts the rest.
NAMED = 6


@dataclass(frozen=True)
class Closed:
    """Sensors of one block on their way: the first `count` readings were used, found is what they say by the law alone.

    usable (S,): whose filter held; room (N,) [degC] at the sensors' times where it is logged.
    """

    sensors: Sensors
    count: int
    found: Estimates
    usable: NDArray[np.bool_]
    room: Array | None = None


def together_of(rates: Rates) -> int:
    """Columns of a run, in their order, that tell each other what they show; with rates of its own a sensor says the same alone."""
    return GROUP if rates != "own" else 1


def claims(
    closed: Sequence[Closed],
    asked: tuple[Array, NDArray[np.bool_]],
    prior: Imperfection,
    rates: Rates,
    name: Callable[[int], str],
    past: Past | None = None,
    rule: Rule | None = None,
) -> list[Claims]:
    """Of all blocks of a task, by groups of its run's columns; temperatures as `times_asked`; `name` names a column.

    past: what complete runs of this machine say of its sensors, by name; let go where the readings contradict it. rule: a
    stopping rule, to be foretold too.
    """
    criterion = None if rule is None else rule.criterion
    if rule is not None and rule.held is not None:
        held = claims(closed, asked, prior, rates, name, rule.held, Rule(rule.criterion))
        whole = claims(closed, asked, prior, rates, name, past)
        return [replace(one, trips=h.trips, missing=h.missing, hidden=h.hidden) for one, h in zip(whole, held, strict=True)]
    empty = [none_yet(len(c.sensors), *asked) for c in closed]
    together = together_of(rates)
    groups = sorted({int(row) // together for c in closed for row in c.sensors.rows})
    left = [left_at_end(c.found.weights, c.sensors) for c in closed]
    for group in groups:
        members = [(c.sensors.rows // together == group) & c.usable for c in closed]
        _mark_changes(left, members, empty)
        if past is not None:
            for c, mine, one in zip(closed, members, empty, strict=True):
                one.known[:] |= mine & np.array([name(int(r)) in past.shapes for r in c.sensors.rows], dtype=bool)
            _claim(
                closed,
                [m & e.known for m, e in zip(members, empty, strict=True)],
                empty,
                past.prior(prior),
                rates,
                name,
                past,
                criterion,
            )
            by_past = [replace(e, steady=e.steady.copy(), t95=e.t95.copy(), at=e.at.copy()) for e in empty]
            _let_go(closed, members, empty, prior, rates, name, past)
        alone = [m & ~e.known for m, e in zip(members, empty, strict=True)]
        # What has hardly moved may be far behind the others: that it is as fast as they is no guess to begin with.
        moved, most = _moved(closed, members)
        little = [a & (m < RULES.behind * most) & (rates == "auto") for a, m in zip(alone, moved, strict=True)]
        slow = _slow_seen(closed, members)
        beside = prior.beside_slow() if any(np.isfinite(pace).any() for pace, _ in slow) else prior
        _claim(closed, [a & ~m for a, m in zip(alone, little, strict=True)], empty, beside, rates, name, criterion=criterion)
        _claim(closed, little, empty, prior, "own", name, criterion=criterion)
        _with_before(closed, alone, empty)
        if not (prior.none or prior.rarely_strong):
            _with_slow(closed, alone, slow, empty)
        if past is not None and not past.guessed:
            _with_past(closed, members, empty, by_past, past)
        _mark_behind(closed, members, empty)
        if not (prior.none or prior.rarely_strong):
            _mark_early(closed, members, empty, past is not None and not past.guessed)
        _mark_settled(closed, members, empty, past is not None and not past.guessed)
    return [Claims(**{**vars(e), "shared_with": tuple(e.shared_with)}) for e in empty]


def _mark_changes(left: Sequence[NDArray[np.intp]], members: Masks, into: Sequence[Claims]) -> None:
    """Marks the sensors of a group whose last readings are a change: several in a row, or those of several sensors at once."""
    gone = sum(int((row[mine] > 0).sum()) for row, mine in zip(left, members, strict=True))
    together = gone >= max(2.0, RULES.changed_share * sum(int(mine.sum()) for mine in members))
    for row, mine, one in zip(left, members, into, strict=True):
        one.left_last[:] = np.where(mine & (row >= (1 if together else RULES.last_alone)), row, one.left_last)


def _moved(closed: Sequence[Closed], members: Masks) -> tuple[list[Array], float]:
    """How far the sensors of each block have moved (S,) [K], and how far that one of the members which moved most."""
    moved = [np.abs(c.found.state[:, 0] - c.found.initial) for c in closed]
    return moved, max((float(m[mine].max()) for m, mine in zip(moved, members, strict=True) if mine.any()), default=0.0)


def _slow_seen(closed: Sequence[Closed], members: Masks) -> list[tuple[Array, Array]]:
    """(How fast (S,) [K/min] those members of a group go on that are slow parts beside fast ones, how fast all do at most)."""
    seen = [(np.full(len(mine), np.nan), np.full(len(mine), np.nan)) for mine in members]
    of = [
        (c.sensors.time[: c.count], c.sensors.reading[m, : c.count], c.found.noise[m]) for c, m in zip(closed, members, strict=True)
    ]
    for (slow, every), mine, found in zip(seen, members, slow_paces(of), strict=True):
        slow[mine], every[mine] = found
    return seen


def _with_slow(closed: Sequence[Closed], members: Masks, paces: Sequence[tuple[Array, Array]], into: Sequence[Claims]) -> None:
    """Intervals of members (S,) reach on by a share of how far the slow part that has most before it may go, at its pace.

    What follows it already moves with it: of that the share is no more than of what both do now.
    """
    slow = np.concatenate([pace for pace, _ in paces])
    quick = [m & np.isnan(own) & np.isfinite(one.steady[:, 1]) for m, (own, _), one in zip(members, paces, into, strict=True)]
    if not (np.isfinite(slow).any() and any(q.any() for q in quick)):
        return
    rise = [one.steady[:, 1] - c.found.initial for c, one in zip(closed, into, strict=True)]
    most = RULES.slow_open * float(np.median(np.abs(np.concatenate([r[q] for r, q in zip(rise, quick, strict=True)]))))
    moved = [c.found.state[:, 0] - c.found.initial for c in closed]
    ahead, unknown = [r - m for r, m in zip(rise, moved, strict=True)], np.concatenate([one.open_limit for one in into])
    far, rate = still_ahead(np.concatenate(moved), np.concatenate(ahead), unknown, slow, most)
    side, beyond = 2 if far > 0.0 else 0, np.fmax if far > 0.0 else np.fmin
    for c, those, own, (_, every), one in zip(closed, quick, rise, paces, into, strict=True):
        last = float(c.sensors.time[c.count - 1] - c.sensors.time[0])
        more = far * np.fmin(RULES.slow_share, RULES.slow_follows * every / max(abs(rate * far), 1e-12))
        coming = more[:, None] * -np.expm1(-rate * np.maximum(one.times - last, 0.0))
        steady, at = beyond(one.steady[:, side], one.steady[:, 1] + more), beyond(one.at[:, :, side], one.at[:, :, 1] + coming)
        late = np.fmax(one.t95[:, 2], last + settled_beside(np.abs(more / own), rate))
        one.steady[those, side], one.at[those, :, side], one.t95[those, 2] = steady[those], at[those], late[those]


def _mark_behind(closed: Sequence[Closed], members: Masks, into: Sequence[Claims]) -> None:
    """Marks the sensors of a group to which the heat has hardly come yet, as the others move: what they do by then says little.

    So it does of one that moves the other way, still warm from another day, or did so at first: by the slowest of the others
    heat may come to it for long.
    """
    moved, most = _moved(closed, members)

    def rates_from(share: float) -> Array:
        each = zip(moved, members, into, strict=True)
        return np.concatenate([one.rate[one.held & mine & (m > share * most), 1] for m, mine, one in each])

    rate = float(np.median(every)) if len(every := rates_from(0.5)) else math.nan
    slowest = float(every.min()) if len(every := rates_from(RULES.behind)) else math.nan
    each = zip(closed, moved, members, strict=True)
    furthest = np.concatenate([(c.found.state[:, 0] - c.found.initial)[mine & (m == most)] for c, m, mine in each])
    way = float(np.sign(furthest[:1].sum()))
    for c, m, mine, one in zip(closed, moved, members, into, strict=True):
        minutes = float(c.sensors.time[c.count - 1] - c.sensors.time[0])
        read, little = rate * minutes, m < RULES.behind * most
        if read >= RULES.behind_until:  # later only what does not move at all, and by far
            little &= (m < RULES.at_rest * c.found.noise) & (most > RULES.still_others * c.found.noise)
        if slowest * minutes < RULES.still_until:
            one.behind[:] = np.where(mine & little & ~one.known, m / max(most, 1e-9), one.behind)
        time, reading = c.sensors.time[: c.count], c.sensors.reading[:, : c.count]
        noise = np.maximum(difference_noise(reading), c.sensors.resolution / math.sqrt(12.0))
        back, turned = went_back(time, reading, noise, way)
        with np.errstate(invalid="ignore"):
            coming = np.where(np.isnan(turned), slowest * minutes < RULES.still_until, minutes < RULES.turned_until * turned)
        against = (m < 0.5 * most) & (back > 0.0) & coming
        one.behind[:] = np.where(mine & against & ~one.known, -back / max(most, 1e-9), one.behind)


def _mark_early(closed: Sequence[Closed], members: Masks, into: Sequence[Claims], learnt: bool) -> None:
    """Marks the sensors of a group whose record is too short for the slow parts behind quick ones, as windings in their oil.

    Until then one exponential is all that there is; where past runs are counted (learnt), these have told. In a machine that is
    warm from before, whose sensors begin apart, slow parts have done some of their rise and show later.
    """
    warm = any(bool((before[mine] > 0.0).any()) for before, mine in zip(_before(closed, members), members, strict=True))
    heard = RULES.heard_warm_min if warm else RULES.heard_min
    for c, mine, one in zip(closed, members, into, strict=True):
        read = float(c.sensors.time[c.count - 1] - c.sensors.time[0])
        with np.errstate(invalid="ignore", divide="ignore"):
            shows = np.minimum(heard, RULES.heard_turns / one.rate[:, 0])  # as slow as it may be
        one.early[:] = np.where(mine & one.held & (read < shows) & ~(one.known & learnt), shows, one.early)


def _mark_settled(closed: Sequence[Closed], members: Masks, into: Sequence[Claims], learnt: bool) -> None:
    """Marks the sensors of a group that are said to have settled, against what the others or their own later readings say.

    learnt: what is known of some is from past runs, in which they may have been as fast.
    """
    moved, most = _moved(closed, members)
    asked = [m & ~(o.known & learnt) for m, o in zip(members, into, strict=True)]
    rate = np.concatenate([np.where(m, o.rate[:, 1], np.nan) for m, o in zip(asked, into, strict=True)])
    span = max(float(c.sensors.time[c.count - 1] - c.sensors.time[0]) for c in closed)
    # What has hardly moved, and is slower, has little to move the others by.
    went = np.concatenate([k >= RULES.behind * most for k in moved])
    many = faster(np.where(went, rate, np.nan), span, RULES.faster, RULES.faster_slowest, RULES.faster_until)
    row = 0
    for c, mine, one in zip(closed, members, into, strict=True):
        own = slice(row, row + len(mine))
        row += len(mine)
        one.faster[:] = np.where(mine, many[own], one.faster)
        if c.room is None and not one.other_rise.any():
            time, reading = c.sensors.time[: c.count], c.sensors.reading[:, : c.count]
            since = moved_since(time, reading, rate[own], one.steady[:, 1] - c.found.initial)
            one.moved[:] = np.where(mine, since, one.moved)


def _let_go(
    closed: Sequence[Closed],
    members: Masks,
    told: Sequence[Claims],
    prior: Imperfection,
    rates: Rates,
    name: Callable[[int], str],
    past: Past,
) -> None:
    """Marks sensors whose readings contradict the past: beyond all it allows, by an effect that is not there without it, or because
    they are far likelier without it, each or all of the run together. What a search chose must make them
    likelier.
    """
    mine = [m & e.known for m, e in zip(members, told, strict=True)]
    if not any(m.any() for m in mine):
        return
    strange = [m & (~(e.check_p >= RULES.unfit) | (e.strong > RULES.strong)) for m, e in zip(mine, told, strict=True)]
    looked = strange if past.guessed and not past.searched else mine
    if not any(m.any() for m in looked):
        return
    each = zip(closed, told, mine, strict=True)
    rates_now = {name(int(c.sensors.rows[i])): float(e.rate[i, 1]) for c, e, m in each for i in np.flatnonzero(m).tolist()}
    off, deviations = past.rates_off(rates_now)
    other = not past.guessed and deviations > RULES.other_rates
    wide = bool(past.open_end) or other
    open_end = [np.array([other or name(int(r)) in past.open_end for r in c.sensors.rows], dtype=bool) for c in closed]
    count = None if wide else 0
    alone = [none_yet(len(c.sensors), e.times[:count], e.ahead[:count]) for c, e in zip(closed, told, strict=True)]
    _claim(closed, looked, alone, prior, rates, name, scale=past)
    for_none = [np.where(m, a.evidence - e.evidence, 0.0) for m, a, e in zip(looked, alone, told, strict=True)]
    together = sum(float(f.sum()) for f in for_none)
    whole = together > -RULES.searched if past.searched else not past.guessed and together > RULES.contradicted
    for c, one, own, m, odd, likelier, of_end in zip(closed, told, alone, mine, strange, for_none, open_end, strict=True):
        one.alone[m] = own.steady[m]
        plain = (own.check_p >= RULES.unfit) & ~(own.strong > RULES.strong)
        # Beyond all it allows, by chance too: without it they must be likelier, or nothing is won by letting it go.
        one.let_go[:] |= odd & (plain | (~(one.check_p >= RULES.unfit) & (likelier > 0.0)))
        if whole:
            one.let_go[:] |= m
        if not past.guessed:
            one.let_go[:] |= m & (likelier > RULES.contradicted)
        if past.unsure:
            one.let_go[:] |= m & (own.check_p >= RULES.unfit) & says_more(own, one, c.found)
        if past.searched == "each":
            one.let_go[:] |= m & (likelier > -RULES.searched_each)
        one.known[:] &= ~one.let_go
        one.other_rise[:] &= one.known
        if any(shape.rest is not None for shape in past.shapes.values()):
            rests = [getattr(past.shapes.get(name(int(r))), "rest", None) for r in c.sensors.rows]
            _with_rest(c, one, own, m & one.known & (~one.other_rise | bool(past.unexplained)), rests)
        if past.unreached:
            share = np.array([past.unreached.get(name(int(r)), 0.0) for r in c.sensors.rows])
            _with_unreached(c, one, own, m & one.known, share)
        if wide:
            _at_least(one, own, m & one.known & of_end)
            one.as_fast[m & one.known] = off if other else np.nan


def _with_past(
    closed: Sequence[Closed],
    members: Masks,
    into: Sequence[Claims],
    by_past: Sequence[Claims],
    past: Past,
) -> None:
    """Intervals of members (S,) whose past was let go reach to what it says, as long as too little has been read to tell a machine
    that is another one from a beginning that is: what is left is then like past runs, whatever the first minutes were.
    """
    for c, mine, one, learnt in zip(closed, members, into, by_past, strict=True):
        if float(c.sensors.time[c.count - 1] - c.sensors.time[0]) < RULES.past_until * past.time_constant:
            _at_least(one, learnt, mine & one.let_go & learnt.held)


def _before(closed: Sequence[Closed], members: Masks) -> list[Array]:
    """How much warmer (S,) [K] the sensors of each block were where the record begins than the coolest of them, or the room.

    A quick part has risen before the law of all begins: where that law says that one was warm, its first readings must, too.
    """
    last, rooms = [c.found.state[:, 0] for c in closed], [c.room[0] for c in closed if c.room is not None]
    by_law = all_before([c.found.initial for c in closed], last, members, rooms)
    as_read = any(before.any() for before in by_law)
    return all_before([began(c.found, c.sensors) for c in closed], last, members, rooms) if as_read else by_law


def _with_before(closed: Sequence[Closed], members: Masks, into: Sequence[Claims]) -> None:
    """Limits of members (S,) that were warm where the record begins reach on, as those of one from the beginning would."""
    for c, mine, one, before in zip(closed, members, into, _before(closed, members), strict=True):
        first, minutes = c.found.initial, float(c.sensors.time[c.count - 1] - c.sensors.time[0])
        on = rest_of_warm(before, one.steady[:, 1] - first, one.rate[:, 1] * minutes)
        warm = mine & (on > 0.0)
        one.steady[warm, 2] = np.maximum(one.steady[:, 2], one.steady[:, 1] + on)[warm]


def _with_rest(c: Closed, one: Claims, own: Claims, members: NDArray[np.bool_], rests: Sequence[Rest | None]) -> None:
    """Intervals of the members (S,) reach as far as the readings of past runs alone left open; once more is read than these runs
    were long, and where effects tell the rise, no farther than the readings at hand do.
    """
    read = float(c.sensors.time[c.count - 1] - c.sensors.time[0])
    for i in np.flatnonzero(members).tolist():
        if (rest := rests[i]) is None:
            continue
        rate, middle = float(one.rate[i, 1]), one.steady[i, 1]
        rise = middle - c.found.initial[i]
        ends = np.sort([middle - rest.below * rise, middle + rest.above * rise])
        done = np.array([rest.soonest, rest.latest]) / rate
        if read * rate > rest.length or one.other_rise[i]:
            ends = np.clip(ends, own.steady[i, 0], own.steady[i, 2])
            done = np.clip(done, own.t95[i, 0], own.t95[i, 2])
        later = np.clip(one.times * rate / rest.length - 1.0, 0.0, 1.0)
        one.at[i, :, 0] = np.fmin(one.at[i, :, 0], one.at[i, :, 1] + later * (ends[0] - middle))
        one.at[i, :, 2] = np.fmax(one.at[i, :, 2], one.at[i, :, 1] + later * (ends[1] - middle))
        one.steady[i, ::2] = min(one.steady[i, 0], ends[0]), max(one.steady[i, 2], ends[1])
        one.t95[i, ::2] = min(one.t95[i, 0], done[0]), max(one.t95[i, 2], done[1])


def _with_unreached(c: Closed, one: Claims, own: Claims, members: NDArray[np.bool_], share: Array) -> None:
    """Limits of the members (S,) reach to either side by a share (S,) of the rise, which no past run came to and the model alone
    tells, and no farther than the readings alone do.
    """
    reach = share * np.abs(one.steady[:, 1] - c.found.initial)
    low, high = np.fmax(one.steady[:, 1] - reach, own.steady[:, 0]), np.fmin(one.steady[:, 1] + reach, own.steady[:, 2])
    wider = members & (reach > 0.0)
    one.steady[wider, 0] = np.minimum(one.steady[:, 0], low)[wider]
    one.steady[wider, 2] = np.maximum(one.steady[:, 2], high)[wider]


def _at_least(one: Claims, other: Claims, members: NDArray[np.bool_]) -> None:
    """Makes intervals of the members (S,) reach at least as far as others do to either side."""
    for mine, own in ((one.steady, other.steady), (one.t95, other.t95), (one.at, other.at)):
        mine[members, ..., 0] = np.minimum(mine[members, ..., 0], own[members, ..., 0])
        mine[members, ..., 2] = np.maximum(mine[members, ..., 2], own[members, ..., 2])


def _claim(
    closed: Sequence[Closed],
    members: Masks,
    into: Sequence[Claims],
    prior: Imperfection,
    rates: Rates,
    name: Callable[[int], str],
    past: Past | None = None,
    criterion: Criterion | None = None,
    scale: Past | None = None,
) -> None:
    """What the members (S,) of each block, taken together, may claim; scale: whose rates set that of the prior, past by default."""
    some = [(i, np.flatnonzero(mine)) for i, mine in enumerate(members) if mine.any()]
    if not some:
        return
    of_block = [[name(int(closed[i].sensors.rows[r])) for r in rows] for i, rows in some]
    names = [n for block in of_block for n in block]
    rises = past.rises if past is not None else {}
    other = [np.array([n in rises for n in block]) for block in of_block]
    parts = [_part(closed[i], rows, strange) for (i, rows), strange in zip(some, other, strict=True)]
    asked, place = _once(parts) if past is None else (parts, np.arange(len(names)))
    of_rates = past or scale
    if of_rates is None:
        tau = float(np.median(np.concatenate([pilot(part.time, part.reading) for part in asked])))
    else:
        tau = float(np.exp(-np.median([of_rates.shapes[n].log_rate for n in names])))
    if past is not None:
        asked = [replace(part, known=past.known(block)) for part, block in zip(parts, of_block, strict=True)]
    names = [names[k] for k in np.unique(place, return_index=True)[1]]
    found = settle(asked, tau, prior, into[0].times, rates)
    trips = _trips(criterion, asked, tau, prior, rates, found)
    at = 0
    for (i, rows), strange, part in zip(some, other, parts, strict=True):
        of = place[at : at + len(rows)]
        _put(into[i], rows, found, of, names)
        into[i].trips[rows], into[i].missing[rows], into[i].hidden[rows] = (column[of] for column in trips)
        into[i].other_rise[rows] = strange
        into[i].averaged[rows] = part.averaged
        at += len(rows)


def _once(parts: Sequence[Part]) -> tuple[list[Part], NDArray[np.intp]]:
    """Each sensor once, a second column of its readings being no further evidence; of each column the place of its sensor there."""
    first = originals([reading for part in parts for reading in part.reading])
    keep = first == np.arange(len(first))
    ends = np.cumsum([len(part.reading) for part in parts])[:-1]
    once = [part.some(mine) for part, mine in zip(parts, np.split(keep, ends), strict=True) if mine.any()]
    return once, (np.cumsum(keep) - 1)[first]


def _trips(
    criterion: Criterion | None, parts: Sequence[Part], tau: float, prior: Imperfection, rates: Rates, found: Settled
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """When a rule holds that does not yet, and what is missing then, (S, 3) each, nan where none is asked for; of which sensors
    (S,) the readings hide whether it does.
    """
    if criterion is None:
        none = np.full((len(found.steady), 3), np.nan)
        return none, none.copy(), np.zeros(len(none), dtype=bool)
    time = max((part.time for part in parts), key=lambda t: float(t[-1]))
    level = np.concatenate([np.median(part.reading[:, -5:], axis=1) for part in parts])
    hidden = np.concatenate([hides(criterion, part.time, part.reading) for part in parts])
    at = asked_ahead(criterion, time, level, found.steady, found.rate, bool(hidden.any()))
    drawn = settle(parts, tau, prior, at, rates, DRAWS).drawn
    assert drawn is not None
    first = 0
    for part in parts:  # a logged room goes on as it did: the limit is that of the room at the last reading, the way there is not
        some = slice(first, first + len(part.reading))
        if part.room is not None:
            drawn.curve[some] += room_paths(part.time, part.room, found.rate[some, 1], at, DRAWS)
        first = some.stop
    return *foretold_trips(criterion, drawn, at, float(time[-1]), hidden), hidden


def _part(closed: Closed, rows: NDArray[np.intp], other_rise: NDArray[np.bool_]) -> Part:
    n, sensors = closed.count, closed.sensors
    time, reading = sensors.time[:n], sensors.reading[rows, :n]
    left_out = closed.found.weights[rows] == 0.0
    if other_rise.any():  # what the law cannot follow is no outlier
        spikes = spike_weights(np.ascontiguousarray(reading), sensors.resolution[rows]) == 0.0
        left_out = np.where(other_rise[:, None], spikes, left_out)
    if left_out.any():
        reading = bridged(time, reading, left_out)
    room = None if closed.room is None else closed.room[:n]
    found = closed.found
    window = averaging_window(time, reading)
    apart = slice((n - 1) % window, None, window)
    # A mean over many averaged readings errs as if each of them had this noise of its own.
    noise = math.sqrt(window) * np.array([third_difference_noise(line[apart], time[apart]) for line in reading])
    with np.errstate(all="ignore"):
        spread = np.log(found.t95_high[rows] / found.t95_low[rows]) / 3.92
        log_rate = np.stack([np.log(found.rate[rows]), np.where(spread > 0.0, spread, np.nan)], axis=1)
    return Part(time, reading, noise, sensors.resolution[rows], room, log_rate, averaged=window)


def _put(into: Claims, rows: NDArray[np.intp], found: Settled, of: NDArray[np.intp], names: Sequence[str]) -> None:
    for name in (f.name for f in fields(Settled) if f.name not in ("agrees", "drawn")):
        getattr(into, name)[rows] = getattr(found, name)[of]
    for row, agrees in zip(rows.tolist(), found.agrees[of], strict=True):
        those = [names[j] for j in np.flatnonzero(agrees).tolist()]
        more = f" and {len(those) - NAMED} more" if len(those) > NAMED else ""
        into.shared_with[row] = ", ".join(those[:NAMED]) + more  # type: ignore[index]
