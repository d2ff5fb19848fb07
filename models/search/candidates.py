"""One effect added to a fit: every way it could act, from every promising start, on the sensors that it concerns."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..core.kernel import Array
from ..effects.base import Choice, Effect
from ..joint import LEVEL, MOST_ITERATIONS, RATE, START, Fit, Key, Model, Part, fit_model, rows_of, search, with_parts
from ..observations import Observations
from .judge import Identifiability, chance, identifiability, least_p, likelihood_ratios, log_ratio, sensor_p_values
from .logged import as_logged
from .mutual import completed, go_both_ways, linked_alike, ways_for_all
from .rules import RULES
from .scan import Scan, own_starts, scan, shared_starts


@dataclass(frozen=True)
class Candidate:
    """A model with effects, beside the fit it was grown from: own (S,) gains over that, p chance of that gain."""

    fit: Fit
    own: Array
    p: float

    @property
    def parts(self) -> tuple[Part, ...]:
        return self.fit.model.parts

    @property
    def ids(self) -> tuple[str, ...]:
        return tuple(part.id for part in self.parts)

    @property
    def gain(self) -> float:
        return float(self.own.sum())

    @cached_property
    def floor(self) -> Array:
        """P values (S,) of the residuals being noise."""
        return sensor_p_values(self.fit)

    @property
    def at_floor(self) -> bool:
        return least_p(self.floor) >= RULES.pattern

    @cached_property
    def identifiable(self) -> Identifiability:
        return identifiability(self.fit)


def trials(effect: Effect, run: Observations) -> float:
    """Effective number of places at which an effect is looked for on a run."""
    constant, by_reading = effect.places
    return constant + by_reading * float(run.used.any(axis=0).sum())


def places(part: Part, run: Observations) -> float:
    """The same of a part: one that only some sensors share is looked for in every choice of so many."""
    n, who = run.sensors, int(part.concerns(run.sensors).sum())
    return trials(part.effect, run) * (math.comb(n, who) if part.effect.in_parts else 1)


def partners(effects: Sequence[Effect], parts: Sequence[Part]) -> list[Effect]:
    """The effects that may be added to parts: those not among them, and once more those that may act again."""
    have, asked = {part.id for part in parts}, {effect.id for effect in effects}
    again = [once_more(p.effect, parts) for p in parts if p.effect.again and p.effect.number == 1 and p.id in asked]
    found = {effect.id: effect for effect in (*effects, *again) if effect.id not in have}
    return list(found.values())


def once_more(effect: Effect, parts: Sequence[Part]) -> Effect:
    """An effect that stands among parts, as it is named when it stands there once more."""
    return effect.numbered(1 + max(p.effect.number for p in parts if type(p.effect) is type(effect)))


def _choices(fit: Fit, effect: Effect) -> list[Choice]:
    """The ways of an effect to act beside those of a fit: one column is followed once, else two laws of it draw a third."""
    taken = {p.choice.constants.get("column") for p in fit.model.parts if type(p.effect) is type(effect)} - {None, ""}
    return [c for c in effect.choices(fit.run) if c.constants.get("column") not in taken]


def first_order(fit: Fit, effect: Effect) -> tuple[float, list[tuple[Choice, Scan]]]:
    """Gain that a straight-line step promises, over all simple ways of acting, and the scans behind it."""
    scans = [(c, scan(fit, effect, c)) for c in _choices(fit, effect) if c.simple]
    if not scans:
        return 0.0, []
    if effect.scope == "run":
        best = 0.0
        for _, found in scans:
            starts = shared_starts(found, effect, 0, 1)
            best = max(best, starts[0][0] if starts else 0.0)
        return best, scans
    per_sensor = np.max([found.gain.max(axis=0) for _, found in scans], axis=0)
    if len(scans) == 1 and not effect.event:
        more = [scans[0][1], *_from_other_rates(fit, effect, scans[0][0])]
        per_sensor = np.maximum(own_starts(more, effect, 0)[0], 0.0)
    return float(per_sensor.sum() if effect.scope == "sensor" else per_sensor.max()), scans


def try_add(before: Fit, effect: Effect, scans: list[tuple[Choice, Scan]] | None = None, quick: bool = False) -> Candidate | None:
    """The best model that adds `effect` to a fit; None where the run lacks what it needs. `quick` follows the best start only."""
    scans = first_order(before, effect)[1] if scans is None else scans
    if not scans:
        return None
    if effect.scope == "run":
        return _shared(before, effect, scans, quick)
    if effect.scope == "one":
        return _single(before, effect, scans, quick)
    return _own(before, effect, scans, quick)


def _candidate(before: Fit, after: Fit, effect: Effect, part: Part) -> Candidate:
    own = np.where(part.concerns(before.run.sensors), likelihood_ratios(before, after), 0.0)
    free = len(effect.active(part.choice))
    return Candidate(after, own, chance(effect, own, free, places(part, before.run)))


def _shared(before: Fit, effect: Effect, scans: list[tuple[Choice, Scan]], quick: bool) -> Candidate:
    run, at = before.run, len(before.model.parts)
    best: tuple[float, Fit, Part] | None = None
    most = 1 if quick or len(scans) > 2 else RULES.followed
    for choice, found in scans:
        part = Part(effect, choice)
        parts = [*before.model.parts, part]
        base = with_parts(before, parts)
        starts = shared_starts(found, effect, at, most)
        for large in effect.large_starts():
            rate, level = effect.equivalent(large, base[RATE], base[LEVEL], before.model.sink_guess)
            starts.append((0.0, {**starts[0][1], Key(at, effect.amplitude): large, RATE: rate, LEVEL: level}))
        for other in before.as_it_began:
            own = {key: other.values[key] for key in (RATE, LEVEL, START)}
            starts += [(gain, {**own, **start}) for gain, start in shared_starts(scan(other, effect, choice), effect, at, most)]
        for _, start in starts:
            fit = fit_model(run, parts, {**base, **start}, None, RULES.quick if quick else MOST_ITERATIONS)
            value = _value(before, fit, part)
            if best is None or value > best[0]:
                best = value, fit, part
    assert best is not None
    if not quick:
        best = _elaborate(before, effect, best)
        best = _in_part(before, effect, scans, best) if effect.in_parts else best
        best = as_logged(before, best, partial(_choices, before, effect), _value)
    if likelihood_ratios(before, best[1]).sum() < 0.0:  # at its null it is the model before: the search went astray
        main = effect.parameter(effect.amplitude)
        null = (main.null or 0.0) * (run.span if main.share else 1.0)
        parts = [*before.model.parts, best[2]]
        still = fit_model(run, parts, {**with_parts(before, parts), Key(at, main.name): null}, None, MOST_ITERATIONS)
        best = max(best, (_value(before, still, best[2]), still, best[2]), key=lambda one: one[0])
    return _candidate(before, best[1], effect, best[2])


def _in_part(
    before: Fit, effect: Effect, scans: list[tuple[Choice, Scan]], best: tuple[float, Fit, Part]
) -> tuple[float, Fit, Part]:
    """The effect in some of the sensors only, where in all of them it leaves a pattern and in these it explains clearly more.

    It begins with the sensor that would gain most by it, and takes in others, in the order of what they would gain at that place.
    """
    n, at = before.run.sensors, len(before.model.parts)
    if n < 2 or least_p(sensor_p_values(best[1])) >= RULES.pattern:
        return best
    choice, found = max(scans, key=lambda one: float(one[1].gain.max()))
    place, first = np.unravel_index(int(np.argmax(found.gain)), found.gain.shape)
    alike = np.sign(found.amplitude[place] - (effect.parameter(effect.amplitude).null or 0.0))
    order = [int(i) for i in np.argsort(-found.gain[place]) if alike[i] == alike[first]]
    start = {Key(at, name): value for name, value in found.points[place].items()}
    start[Key(at, effect.amplitude)] = float(found.amplitude[place, first])
    part_of: tuple[float, Fit, Part] | None = None
    who: list[int] = []
    for i in order[: n - 1]:
        part = Part(effect, choice, tuple(j in (*who, i) for j in range(n)))
        parts = [*before.model.parts, part]
        base = with_parts(before, parts) if part_of is None else with_parts(part_of[1], parts)
        fit = fit_model(before.run, parts, {**base, **start} if part_of is None else base)
        value = _value(before, fit, part)
        # A neighbour that is warmed by it answers, too, but late.
        less = fit.rss[i] <= (1.0 - RULES.in_part) * before.rss[i]
        if part_of is not None and not (less and value > part_of[0] + RULES.worth):
            continue
        part_of, who = (value, fit, part), [*who, i]
    return part_of if part_of is not None and part_of[0] > best[0] + RULES.worth else best


def _value(before: Fit, fit: Fit, part: Part) -> float:
    """Gain of a part less what each of its parameters costs."""
    return float(likelihood_ratios(before, fit).sum()) - RULES.parameter_costs * len(part.effect.active(part.choice))


def unmirrored(fit: Fit, at: int) -> Fit:
    """The fit with values that can really be, where those of part `at` are their mirror: a lag and a time constant exchanged."""
    part = fit.model.parts[at]
    who = part.concerns(fit.run.sensors)
    own = {p.name: fit.values[Key(at, p.name)] for p in part.effect.active(part.choice) if p.each == "sensor"}
    mirrored = part.effect.mirrored(np.where(who, fit.values[RATE], 0.0), own)
    if mirrored is None:
        return fit
    values = {**fit.values, **{Key(at, k): v for k, v in mirrored[1].items()}}
    values[RATE] = np.where(who, mirrored[0], values[RATE])
    return search(fit.model, *fit.model.vector(values))


def _elaborate(before: Fit, effect: Effect, best: tuple[float, Fit, Part]) -> tuple[float, Fit, Part]:
    """Less simple ways of acting of the last part, where the simple one leaves a pattern."""
    more = [c for c in _choices(before, effect) if not c.simple]
    # Beside a heat that is not constant, a source of its own and a change of all of it are different things.
    varies = before.run.heat is not None or any(part.effect.changes_heat for part in before.model.parts)
    if effect.changes_heat and varies:
        plain = best[2].choice
        other = not plain.constants.get("product", False)
        said = f"{plain.label} {'times' if other else 'beside'} the rest".strip()
        more = [replace(plain, label=said, constants={**plain.constants, "product": other}), *more]
        more += [replace(c, constants={**c.constants, "product": other}) for c in more[1:]]
    if not more or best[0] < RULES.worth or least_p(sensor_p_values(best[1])) >= RULES.pattern:
        return best
    if more[0].by_sensor:  # where each has found neighbours of its own it may also keep those
        more = [replace(c, label=best[2].choice.label, constants=best[2].choice.constants) for c in more] + more
    values = best[1].values
    for choice in more:
        label = best[2].choice.constants.get("column")
        if label and choice.constants.get("column") != label:
            continue
        part = replace(best[2], choice=choice)
        parts = [*before.model.parts, part]
        # What acts in quite another way does not begin where the simple one ended.
        starts = [values] if choice.constants.keys() <= best[2].choice.constants.keys() else [values, with_parts(before, parts)]
        for start in starts:
            fit = fit_model(before.run, parts, start)
            value = _value(before, fit, part)
            # A slow change draws half of many things: it is taken where it is all that there is.
            if value > best[0] + RULES.worth and not (choice.rare and least_p(sensor_p_values(fit)) < RULES.pattern):
                best = value, fit, part
    return best


def _mutual(before: Fit, effect: Effect, best: tuple[float, Fit, Part]) -> tuple[float, Fit, Part]:
    """A way in which every link goes both ways, where those found do not and the readings hardly tell the two apart.

    Where all sensors have a link each picks a neighbour by its own noise; heat is conducted both ways.
    """
    run, (value, fit, part) = before.run, best
    ends = [part.choice.ends(i) for i in range(run.sensors)]
    if not part.choice.by_sensor or not part.concerns(run.sensors).all() or go_both_ways(ends):
        return best
    found = best
    for choice in ways_for_all(effect, run):
        other = Part(effect, choice)
        parts = [*before.model.parts, other]
        key = Key(len(parts) - 1, effect.amplitude)
        anew = with_parts(before, parts)
        coupled = anew | {key: np.maximum(fit.values[key], 0.5 * fit.values[RATE])}
        for start in (anew, coupled, with_parts(fit, parts)):
            again = fit_model(run, parts, start)
            gained = _value(before, again, other)
            if again.physical and gained > value - RULES.one_way and (found is best or gained > found[0]):
                found = gained, again, other
    return found


def _single(before: Fit, effect: Effect, scans: list[tuple[Choice, Scan]], quick: bool) -> Candidate:
    run, at, n = before.run, len(before.model.parts), before.run.sensors
    best: Candidate | None = None
    for choice, found in scans:
        promised, start = own_starts([found, *_from_other_rates(before, effect, choice)], effect, at)
        for i in np.argsort(promised)[::-1][: 1 if quick else 2]:
            part = Part(effect, choice, tuple(bool(j == i) for j in range(n)))
            parts = [*before.model.parts, part]
            fit = fit_model(run, parts, {**with_parts(before, parts), **start}, None, RULES.quick if quick else MOST_ITERATIONS)
            candidate = _candidate(before, fit, effect, part)
            if best is None or candidate.gain > best.gain:
                best = candidate
    assert best is not None
    return best


def _from_other_rates(before: Fit, effect: Effect, choice: Choice) -> list[Scan]:
    """Scans from other rates than the fit's own."""
    return [scan(fit, effect, choice, before.noise) for fit in before.elsewhere]


def _own(before: Fit, effect: Effect, scans: list[tuple[Choice, Scan]], quick: bool) -> Candidate | None:
    """Each sensor by itself from several starts, all at once; then those it concerns, with what is shared."""
    run, at, n = before.run, len(before.model.parts), before.run.sensors
    sensors = np.arange(n)
    first = RULES.glance_at_links if scans[0][0].by_sensor and not quick else RULES.glance
    looked: list[tuple[Choice, Fit]] = []
    for choice, starts in _own_choices(before, effect, scans, at, quick):
        parts = [*before.model.parts, Part(effect, choice)]
        model = Model(run, parts)
        base = with_parts(before, parts)
        stacked, shared = [], np.zeros(0)
        for start in starts:
            local, shared = model.vector({**base, **start})
            stacked.append(local)
        tiled = np.tile(sensors, len(starts))
        looked.append((choice, search(model, np.concatenate(stacked), shared, None, first, tiled, hold_shared=True)))
    best_cost = before.rss.copy()
    best_rows: list[tuple[Choice, Fit, int] | None] = [None] * n
    for (choice, glance), kept in zip(looked, _promising([f for _, f in looked], n), strict=True):
        if not len(kept):
            continue
        own, most = kept % n, (RULES.quick if quick else RULES.careful) - first
        fit = search(glance.model, glance.local[kept], glance.shared, None, most, own, hold_shared=True)
        for row, i in enumerate(own):
            if np.isfinite(fit.rss[row]) and fit.rss[row] < best_cost[i] * (1.0 - 1e-12):
                best_cost[i] = fit.rss[row]
                best_rows[i] = choice, fit, row
    best_rows = _both_ways(looked, best_rows, best_cost, before.dof)
    gained = log_ratio(before.rss, best_cost, before.dof)
    own = np.array([g if r is not None else 0.0 for g, r in zip(gained, best_rows, strict=True)])
    free = len(effect.active(looked[0][0]))
    number = trials(effect, run)
    concerned = np.array([chance(effect, np.eye(n)[i] * own[i], free, number) < RULES.concerned for i in range(n)])
    if not concerned.any():
        concerned[int(np.argmax(own))] = True
    return _joined(before, effect, best_rows, concerned, quick)


def _promising(looked: list[Fit], sensors: int) -> list[Any]:
    """Rows of each first look that are among the RULES.carried_on best of their sensor."""
    costs = [np.where(np.isfinite(f.rss), f.rss, np.inf).reshape(-1, sensors) for f in looked]
    limit = np.sort(np.concatenate(costs), axis=0)[: RULES.carried_on][-1]
    return [np.flatnonzero((c <= limit) & np.isfinite(c)) for c in costs]


def _both_ways(
    looked: Sequence[tuple[Choice, Fit]], rows: Sequence[tuple[Choice, Fit, int] | None], costs: Array, dof: Array
) -> list[tuple[Choice, Fit, int] | None]:
    """Each sensor's neighbours again: of those that fit about as well as the best, the ones that could have it as theirs too.

    Each sensor alone picks the neighbour whose noise does least harm, by a hair. Heat is conducted both ways.
    """
    n = len(costs)
    close: list[list[tuple[float, tuple[Choice, Fit, int]]]] = [[] for _ in rows]
    for choice, fit in looked:
        if not choice.by_sensor:
            return list(rows)
        behind = log_ratio(fit.rss, costs[np.arange(len(fit.rss)) % n], dof[np.arange(len(fit.rss)) % n])
        for row in np.flatnonzero(behind < RULES.one_way):
            close[row % n].append((float(behind[row]), (choice, fit, int(row))))
    likely = [
        [] if best is None else [best, *(found for _, found in sorted(near, key=lambda item: item[0]))]
        for best, near in zip(rows, close, strict=True)
    ]
    ends = [[choice.ends(i) for choice, _, _ in likely[i]] for i in range(n)]
    could, must = [set.union(set(), *e) for e in ends], [set.intersection(*e) if e else set() for e in ends]
    picks = [0] * n
    for _ in range(3):
        for i in range(n):
            needed = {j for j in range(n) if i in must[j]}
            shares = [sum(i in could[j] for j in own) / max(len(own | needed), 1) for own in ends[i]]
            # The first of those that are equally mutual is the best fit.
            picks[i] = int(np.argmax(shares)) if shares else 0
        could = must = [e[k] if e else set() for e, k in zip(ends, picks, strict=True)]
    return [few[k] if few else None for few, k in zip(likely, picks, strict=True)]


def _own_choices(
    before: Fit, effect: Effect, scans: list[tuple[Choice, Scan]], at: int, quick: bool
) -> list[tuple[Choice, list[dict[Key, Any]]]]:
    """Ways of acting and starts of an effect that each sensor has for itself; neighbours are composed from the most promising."""
    run = before.run
    main = effect.parameter(effect.amplitude)
    scale = run.span if main.share else 1.0
    found = []
    if scans[0][0].by_sensor:
        promised = np.array([s.gain[0] for _, s in scans])
        amplitude = np.array([s.amplitude[0] for _, s in scans])
        order = np.argsort(-promised, axis=0)
        sensors = np.arange(run.sensors)
        for rank in range(min(1 if quick else 9, len(scans))):
            pick = order[rank]
            small = {Key(at, effect.amplitude): amplitude[pick, sensors]}
            # A strong coupling is reached slowly from a weak one: the other start is a strong one.
            starts = [small, {Key(at, effect.amplitude): np.maximum(main.start, 2.0 * before.values[RATE])}]
            found.append((Choice.composed([scans[p][0] for p in pick]), starts))
        return found
    for choice, s in scans:
        _, start = own_starts([s, *_from_other_rates(before, effect, choice)], effect, at)
        starts = [start]
        for large in () if quick else effect.large_starts():
            for point in s.points[1::5] if len(s.points) > 1 else [{}]:
                values = {Key(at, k): np.full(run.sensors, v) for k, v in point.items()}
                starts.append({Key(at, effect.amplitude): np.full(run.sensors, large * scale), **values})
        found.append((choice, starts))
    return found


def _joined(
    before: Fit, effect: Effect, rows: Sequence[tuple[Choice, Fit, int] | None], concerned: Any, quick: bool
) -> Candidate | None:
    run = before.run
    chosen = next((r for r in rows if r is not None), None)
    if chosen is None:
        return None
    choice = Choice.composed([(r or chosen)[0] for r in rows])
    part = Part(effect, choice, tuple(bool(c) for c in concerned))
    parts = [*before.model.parts, part]
    model = Model(run, parts)
    local, shared = model.vector(with_parts(before, parts))
    for i, r in enumerate(rows):
        if r is not None and concerned[i]:
            local[i] = rows_of(r[1], np.array([r[2]])).local[0]
    fit = search(model, local, shared, None, RULES.quick if quick else MOST_ITERATIONS)
    fit = unmirrored(fit, len(parts) - 1)
    fit, part = _taken_in(before, effect, *(fit, part) if quick else _pruned(fit, part))
    if not quick:
        _, fit, part = _mutual(before, effect, _elaborate(before, effect, (_value(before, fit, part), fit, part)))
    return _candidate(before, fit, effect, part)


def _taken_in(before: Fit, effect: Effect, fit: Fit, part: Part) -> tuple[Fit, Part]:
    """The fit with links of sensors that gain nothing by one alone, where what all sensors share has to move with it.

    Beside a loss that changed, a link left out draws half: the change is then less than it is, and most links gain nothing by that.
    """
    at, who = len(fit.model.parts) - 1, part.concerns(fit.run.sensors)
    if not effect.reads_sensors or not any(0 <= c.part != at for c in fit.model.shared):
        return fit, part
    if not (~who & (sensor_p_values(fit) < RULES.pattern)).any():
        return fit, part
    best, wider = fit, part
    for more in (completed(fit, at, map(int, np.flatnonzero(~who))), *linked_alike(fit, at)):
        more, found = _pruned(more, more.model.parts[at])
        costs = RULES.worth * int((found.concerns(len(who)) & ~wider.concerns(len(who))).sum())
        if _value(before, more, found) > _value(before, best, wider) + costs:
            best, wider = more, found
    return best, wider


def _pruned(fit: Fit, part: Part) -> tuple[Fit, Part]:
    """Without those sensors that need the effect no more once all parameters have moved together."""
    n, effect = fit.run.sensors, part.effect
    at = len(fit.model.parts) - 1
    main = effect.parameter(effect.amplitude)
    null = (main.null or 0.0) * (fit.run.span if main.share else 1.0)
    for _ in range(2):
        who = part.concerns(n)
        far = np.abs(fit.values[Key(at, effect.amplitude)] - null) / np.maximum(fit.deviations[Key(at, effect.amplitude)], 1e-300)
        # Far from nothing by the curvature there, or needed for the fit: a ridge makes a plain effect look vague.
        drop = [i for i in np.flatnonzero(who) if far[i] < RULES.needed]
        if not drop or int(who.sum()) < 2:
            break
        kept = [bool(w and i not in drop) for i, w in enumerate(who)]
        if not any(kept):
            kept[int(np.argmax(np.where(who, far, -1.0)))] = True
        fewer = replace(part, concerned=tuple(kept))
        parts = [*fit.model.parts[:-1], fewer]
        again = fit_model(fit.run, parts, with_parts(fit, parts))
        lost = log_ratio(again.rss, fit.rss, again.dof)
        # A sensor that loses by it gets its effect back.
        back = [bool(k or (w and lost[i] > RULES.worth)) for i, (k, w) in enumerate(zip(kept, who, strict=True))]
        if back == list(who):
            break
        if back != kept:
            fewer = replace(part, concerned=tuple(back))
            parts = [*fit.model.parts[:-1], fewer]
            again = fit_model(fit.run, parts, with_parts(fit, parts))
        fit, part = again, fewer
    return fit, part
