"""Which effect is missing: a search over single effects and pairs that knows how often it would name one by chance.

The rules: a set of effects is named only if chance would not give its gain (over everything that was tried), it lowers the error
on readings left out, the record determines its parameters, and every sensor is down to its noise. Among sets that fit
equally well the one with the fewest parameters is the verdict. Where none goes down to the noise, effects that matter although the
rest is imperfect are named one after the other (:mod:`.dominant`).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from typing import Any

import numpy as np

from ..core.kernel import Array
from ..effects.base import Choice, Effect
from ..joint import Fit, Key, Model, Part, fit_model, search, with_parts
from ..observations import Observations
from .candidates import Candidate, first_order, trials, try_add
from .dominant import Stage, beats_disturbance, explain, try_all
from .heldout import held_out_errors
from .judge import chance, least_p, likelihood_ratios, sensor_p_values
from .rules import RULES
from .scan import Scan

#: How work is spread over processes: as the built-in ``map``, results in order.
Spread = Callable[..., Iterable[Any]]


@dataclass(frozen=True)
class Discovery:
    """What a search found. `named` is the verdict's model, None for `none` and `unexplained`.

    stages are the steps to it where effects were named one after the other, held their errors (S,) [K] on readings left out from
    the base model's on. singles are in the order of their gain; also_possible are those models that fit as well, or for
    `unexplained` the nearest. ahead_base, ahead (S,) [K] are errors on readings left out.
    """

    base: Fit
    base_floor: Array
    singles: tuple[Candidate, ...]
    named: Candidate | None
    also: tuple[Candidate, ...]
    p: float
    ahead_base: Array
    ahead: Array | None
    why: str
    stages: tuple[Stage, ...] = ()
    held: tuple[Array, ...] = ()

    @cached_property
    def partly(self) -> bool:
        """Whether a pattern remains beside what is named."""
        return bool(self.stages) and least_p(sensor_p_values(self.stages[-1].fits[0])) < RULES.pattern

    @property
    def verdict(self) -> str:
        if self.named is not None:
            known = [p.id for p in self.base.model.parts]
            return "+".join(i for i in self.named.ids if i not in known)
        return "none" if self.why == "none" else "unexplained"


def discover(
    run: Observations,
    effects: Sequence[Effect],
    false_alarm: float = RULES.false_alarm,
    most: int = 2,
    known: Fit | None = None,
    spread: Spread = map,
) -> Discovery:
    """Search the effects, singly and in pairs, that the base model (or the model `known`) lacks on a run.

    `spread` may be the ``map`` of a ``concurrent.futures.Executor``; the result does not depend on it.
    """
    base = fit_model(run) if known is None else known
    floor = sensor_p_values(base)
    singles: list[Candidate] = [c for c in spread(partial(try_add, base), effects) if c is not None]
    singles.sort(key=lambda c: -c.gain)
    number = max(1, len(effects))

    def alone(candidate: Candidate) -> bool:
        return len(candidate.ids) == 1 + len(base.model.parts)

    def over_all(candidate: Candidate) -> float:
        # A pair is the best of all pairs: each of its halves must beat the chance of that.
        return min(1.0, candidate.p * (number if alone(candidate) else 0.5 * number * (number + 1)))

    def passes(candidate: Candidate) -> bool:
        # Two effects can imitate more than one can: their residuals must look more like noise.
        clean = candidate.at_floor if alone(candidate) else least_p(candidate.floor) >= RULES.pair_pattern
        return over_all(candidate) < false_alarm and clean and candidate.identifiable.ok and candidate.fit.physical

    good = [c for c in singles if passes(c)]
    pairs: list[Candidate] = []
    above = least_p(floor) < RULES.pattern
    if most > 1 and known is None and (above or good):
        # A single that is well down at the noise leaves room for little more.
        sound = [c for c in good if least_p(c.floor) > RULES.sound]
        pairs = _pairs(base, singles, effects, sound, spread)
    finalists = good + [c for c in pairs if passes(c)]
    named, also = _choose(base, finalists)
    if named is not None and _arbitrary(base, named, pairs):
        also, named = [named, *also], None
    if named is not None and not beats_disturbance(base, named, false_alarm, number):
        also, named = [named, *also], None
    if named is not None:
        also += _nearly(base, named, also, singles)
    p = min((over_all(c) for c in singles), default=1.0)
    blank = np.full(run.sensors, np.nan)
    if named is None:
        if not above:
            return Discovery(base, floor, tuple(singles), None, (), p, blank, None, "none")
        found = _in_stages([base], [[c] for c in singles], effects, false_alarm, spread)[0]
        if found.named is not None:
            return found
        near = also or [*singles[:1], *sorted(pairs, key=lambda c: -total_likelihood_ratio(base, c))[:2]]
        return Discovery(base, floor, tuple(singles), None, tuple(near), p, found.ahead_base, None, "nothing fits")
    ahead_base, ahead = held_out_errors(base), held_out_errors(named.fit)
    if np.nansum(ahead**2 * base.readings) > np.nansum(ahead_base**2 * base.readings):
        why = "none" if not above else "the error on readings left out does not fall"
        return Discovery(base, floor, tuple(singles), None, (named, *also), p, ahead_base, None, why)
    return Discovery(base, floor, tuple(singles), named, tuple(also), over_all(named), ahead_base, ahead, "")


def discover_together(
    runs: Sequence[Observations], effects: Sequence[Effect], false_alarm: float = RULES.false_alarm, spread: Spread = map
) -> list[Discovery]:
    """Search several runs of one machine as one: the evidence for an effect is summed over the runs that show it.

    A run that does not show an effect is left without it: what happened in one run only is that run's event.
    """
    bases = [fit_model(run) for run in runs]
    return _in_stages(bases, try_all(bases, effects, spread), effects, false_alarm, spread)


def _in_stages(
    bases: Sequence[Fit],
    tried: Sequence[Sequence[Candidate | None]],
    effects: Sequence[Effect],
    false_alarm: float,
    spread: Spread,
) -> list[Discovery]:
    """Effects named one after the other as long as the error on readings left out, of all runs, falls; what that says of each."""
    stages: list[Stage] = []
    held = [[held_out_errors(fit)] for fit in bases]

    def pooled(number: int) -> float:
        return sum(float(np.nansum(h[number] ** 2 * fit.readings)) for h, fit in zip(held, bases, strict=True))

    for stage in explain(bases, tried, effects, false_alarm, spread):
        for h, fit, single in zip(held, stage.fits, stage.named.by_run, strict=True):
            h.append(held_out_errors(fit) if single is not None else h[-1])
        if not pooled(-1) < pooled(-2):
            break
        stages.append(stage)
    found = []
    for k, base in enumerate(bases):
        singles = sorted([c for c in (t[k] for t in tried) if c is not None], key=lambda c: -c.gain)
        found.append(_share_of_run(k, base, tuple(singles), stages, held[k]))
    return found


def _share_of_run(k: int, base: Fit, singles: tuple[Candidate, ...], stages: Sequence[Stage], held: list[Array]) -> Discovery:
    """What a search of several runs says of the k-th of them."""
    floor = sensor_p_values(base)
    mine = [(n, s) for n, s in enumerate(stages) if s.named.by_run[k] is not None]
    own = tuple(s.of_run(k) for _, s in mine)
    if not own:
        p = min((s.named.p for s in stages), default=1.0)
        why = "none" if least_p(floor) >= RULES.pattern else "nothing fits"
        return Discovery(base, floor, singles, None, singles[:1], p, held[0], None, why)
    errors = (held[0], *(held[n + 1] for n, _ in mine))
    named = own[-1].named.shown[0].candidate
    also = tuple(s.rival.shown[0].candidate for s in own if s.rival is not None)
    return Discovery(base, floor, singles, named, also, max(s.named.p for s in own), held[0], errors[-1], "", own, errors)


def total_likelihood_ratio(base: Fit, candidate: Candidate) -> float:
    """Gain over the base model."""
    return float(likelihood_ratios(base, candidate.fit).sum())


@dataclass(frozen=True)
class _Offer:
    """A second effect beside a fit, and what a first-order step promises of both."""

    promised: float
    root: Fit
    effect: Effect
    scans: list[tuple[Choice, Scan]]


def _offers(base: Fit, effects: Sequence[Effect], least: float, most: int, afar: bool, root: Fit) -> list[_Offer]:
    """The best partners of a root; with afar also those that are tried from far away, which may promise little from here."""
    own, have = float(likelihood_ratios(base, root).sum()), [p.id for p in root.model.parts]
    offers = []
    for effect in effects:
        if effect.id not in have:
            value, scans = first_order(root, effect)
            if scans and value > least:
                offers.append(_Offer(own + value, root, effect, scans))
    offers.sort(key=lambda o: -o.promised)
    return [o for rank, o in enumerate(offers) if rank < most or (afar and o.effect.scope == "run" and o.effect.large_starts())]


def _taken(offer: _Offer, quick: bool) -> Candidate | None:
    return try_add(offer.root, offer.effect, offer.scans, quick)


def _pairs(
    base: Fit, singles: list[Candidate], effects: Sequence[Effect], good: list[Candidate], spread: Spread
) -> list[Candidate]:
    """Pairs that a first-order step promises most of: quickly at first, the best of them with care."""
    promised: dict[tuple[str, ...], _Offer] = {}
    roots = [c.fit for c in (good[:3] if good else singles)]
    roots += [] if good else _as_logged(base, effects)
    # Each single brings its best partners, however little it gains by itself: a pair may hide its parts.
    for number, offers in enumerate(spread(partial(_offers, base, effects, 25.0 if good else -1.0, RULES.partners, True), roots)):
        for offer in offers:
            unordered = tuple(sorted((*(p.id for p in offer.root.model.parts), offer.effect.id)))
            key = (*unordered, str(number)) if number >= len(singles) else unordered
            if key not in promised or offer.promised > promised[key].promised:
                promised[key] = offer
    of_single = {c.ids[0]: c for c in singles}
    order = sorted(promised, key=lambda k: -promised[k].promised)[: 4 if good else RULES.pairs]
    order += [k for k in promised if len(k) > 2 and k not in order]
    tried = spread(partial(_taken, quick=not good), [promised[k] for k in order])
    grown = sorted(
        [(c, len(key) > 2) for key, c in zip(order, tried, strict=True) if c is not None],
        key=lambda g: -total_likelihood_ratio(base, g[0]),
    )
    found = [c for c, _ in grown]
    near = any(_excess(pair.fit) < RULES.far for pair in found[: RULES.refined])
    again = [i for i, pair in enumerate(found[: RULES.refined if near else 0]) if not good or not _sound(pair)]
    # What a logged cause hides shows late: the best pair grown from one that acts just as logged is looked at with care too.
    again += [i for i, (_, logged) in enumerate(grown) if logged and i >= len(again)][:1]
    for i, pair in zip(again, spread(partial(_refined, base), [found[i] for i in again]), strict=True):
        found[i] = pair
    found.sort(key=lambda c: -total_likelihood_ratio(base, c))
    if found and not good and near:
        # A sound pair may still be a roundabout way to say that one sensor drifts or jumped.
        others = [e for e in effects if e.scope == "one"] if _sound(found[0]) else effects
        found += _exchanged(base, found[0], others, spread)
    return [_needed(pair, of_single) for pair in found]


def _as_logged(base: Fit, effects: Sequence[Effect]) -> list[Fit]:
    """Fits with a logged cause acting just as logged: what else is missing cannot hide behind a wrong share of it."""
    found = []
    for effect in effects:
        for choice in [c for c in effect.choices(base.run) if c.simple][:2] if effect.logged else []:
            model = Model(base.run, [Part(effect, choice)])
            local, shared = model.vector({**base.values, Key(0, effect.amplitude): effect.parameter(effect.amplitude).start})
            model.low_shared = model.high_shared = shared
            found.append(search(model, local, shared))
    return found


def _excess(fit: Fit) -> float:
    """The residuals' root mean square in units of the noise, of the worst sensor."""
    return float((fit.rmse / np.maximum(fit.run.least_noise, 1e-12)).max())


def _sound(candidate: Candidate) -> bool:
    return least_p(candidate.floor) > RULES.sound and candidate.identifiable.ok and candidate.fit.physical


def _held(base: Fit, pair: Candidate, without: str) -> Fit:
    """The pair's model without one of its effects, all else as the pair has it."""
    others = [p for p in pair.parts if p.id != without]
    model = Model(base.run, others)
    return search(model, *model.vector(with_parts(pair.fit, others)), most=0)


def _refined(base: Fit, pair: Candidate) -> Candidate:
    """Each effect of a pair looked for anew while the other stands as the pair has it."""
    for _ in range(2):
        before = _worth(base, pair)
        for part in pair.parts:
            again = try_add(_held(base, pair, part.id), part.effect)
            if again is not None and _worth(base, again) > _worth(base, pair):
                pair = again
        if _worth(base, pair) < before + RULES.worth_another:
            break
    return pair


def _worth(base: Fit, candidate: Candidate) -> float:
    """Gain less what parameters gain by chance."""
    return total_likelihood_ratio(base, candidate) - 2.0 * candidate.fit.complexity


def _exchanged(base: Fit, pair: Candidate, effects: Sequence[Effect], spread: Spread) -> list[Candidate]:
    """Pairs that share one effect with the best one and that a first-order step promises most of."""
    others = [e for e in effects if e.id not in pair.ids]
    held = [_held(base, pair, p.id) for p in pair.parts]
    offers = list(spread(partial(_offers, base, others, -1.0, RULES.exchanged, False), held))
    tried = iter(spread(partial(_taken, quick=True), [o for of in offers for o in of]))
    likely: list[Candidate] = []
    for of in offers:
        quick = [c for c in islice(tried, len(of)) if c is not None]
        likely += sorted(quick, key=lambda c: -total_likelihood_ratio(base, c))[:2]
    return list(spread(partial(_refined, base), likely))


def _needed(pair: Candidate, singles: dict[str, Candidate]) -> Candidate:
    """The pair with the chance of its less certain half: each effect must be needed beside the other."""
    p = 0.0
    for part in pair.parts:
        other = next(o for o in pair.parts if o.id != part.id)
        alone = singles.get(other.id)
        if alone is None:
            continue
        own = np.maximum(likelihood_ratios(alone.fit, pair.fit), 0.0)
        if part.effect.scope != "run":
            own = np.where(part.concerns(len(own)), own, 0.0)
        free = len(part.effect.active(part.choice))
        p = max(p, chance(part.effect, own, free, trials(part.effect, pair.fit.run)))
        if float(own.sum()) < 2.0 * RULES.equal:
            p = 1.0
    return Candidate(pair.fit, pair.own, p)


def _choose(base: Fit, finalists: list[Candidate]) -> tuple[Candidate | None, list[Candidate]]:
    if not finalists:
        return None, []
    value = {id(c): float(likelihood_ratios(base, c.fit, careful=False).sum()) for c in finalists}
    best = max(finalists, key=lambda c: value[id(c)] - 2.0 * c.fit.complexity)
    limit = value[id(best)]
    equal = [c for c in finalists if value[id(c)] > limit - RULES.equal - 2.0 * max(0.0, best.fit.complexity - c.fit.complexity)]
    equal.sort(key=lambda c: (len(c.ids), c.fit.complexity, -value[id(c)]))
    named = equal[0]
    also = [c for c in equal[1:] if len(c.ids) <= len(named.ids)]
    return named, also[: RULES.most_also]


def _arbitrary(base: Fit, named: Candidate, pairs: list[Candidate]) -> bool:
    """Whether a pair draws the misfit of a single sensor, where two effects can draw nearly anything, or is one of several."""
    if len(named.parts) - len(base.model.parts) < 2:
        return False
    n = base.run.sensors
    who = [p.concerns(n) for p in named.parts]
    shared = any(p.effect.scope == "run" for p in named.parts)
    if shared and n > 1:
        return False
    if not shared and (int(np.logical_or.reduce(who).sum()) > 1):
        return False
    if not shared and not any(p.effect.event for p in named.parts):
        return True
    best = total_likelihood_ratio(base, named)
    rivals = [
        c for c in pairs if set(c.ids) != set(named.ids) and c.at_floor and total_likelihood_ratio(base, c) > best - RULES.nearly[1]
    ]
    return bool(rivals)


def _nearly(base: Fit, named: Candidate, also: list[Candidate], singles: list[Candidate]) -> list[Candidate]:
    """Single effects that leave no pattern either and gain nearly as much, whether or not they would be named themselves."""
    best = total_likelihood_ratio(base, named)
    slack = min(max(RULES.nearly[0], 0.25 * best), RULES.nearly[1])
    ids = {c.ids for c in (named, *also)}
    near = [
        c for c in singles if c.ids not in ids and c.at_floor and c.fit.physical and total_likelihood_ratio(base, c) > best - slack
    ]
    return near[: max(0, RULES.most_also - len(also))]
