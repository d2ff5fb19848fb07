"""Sets of two and more effects: which are worth trying, and each effect of a set looked for anew beside the others."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from ..effects.base import Choice, Effect
from ..joint import Fit, Key, Model, Part, fit_model, search, with_parts
from .candidates import Candidate, first_order, once_more, partners, places, try_add, unmirrored
from .dominant import beside_others, misfit_power
from .judge import chance, least_p, likelihood_ratios
from .rules import RULES
from .scan import Scan

#: How work is spread over processes: as the built-in ``map``, results in order.
Spread = Callable[..., Iterable[Any]]


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
    own = float(likelihood_ratios(base, root).sum())
    offers = []
    for effect in partners(effects, root.model.parts):
        value, scans = first_order(root, effect)
        if scans and value > least:
            offers.append(_Offer(own + value, root, effect, scans))
    offers.sort(key=lambda o: -o.promised)
    # What acts again promises little: the first has taken what it could of the second.
    return [o for rank, o in enumerate(offers) if rank < most or o.effect.number > 1 or (afar and _from_afar(o.effect))]


def _from_afar(effect: Effect) -> bool:
    return effect.scope == "run" and bool(effect.large_starts())


def _taken(offer: _Offer, quick: bool) -> Candidate | None:
    return try_add(offer.root, offer.effect, offer.scans, quick)


def _settled(base: Fit, offer: _Offer) -> Candidate | None:
    """A quick look, and its model followed to the end."""
    found = _taken(offer, True)
    if found is None:
        return None
    return _of(base, fit_model(base.run, found.parts, found.fit.values))


def _of(base: Fit, fit: Fit) -> Candidate:
    """A fit as a candidate beside the base model, whose chance is not known yet."""
    return Candidate(fit, np.maximum(likelihood_ratios(base, fit), 0.0), 1.0)


def tried_pairs(
    base: Fit, singles: list[Candidate], effects: Sequence[Effect], good: list[Candidate], spread: Spread
) -> list[Candidate]:
    """Pairs that a first-order step promises most of: quickly at first, the best of them with care."""
    promised: dict[tuple[str, ...], _Offer] = {}
    roots = [c.fit for c in (good[:3] if good else singles)]
    roots += [] if good else _as_logged(base, effects)
    # Each single brings its best partners, however little it gains by itself: a pair may hide its parts.
    for number, offers in enumerate(
        spread(partial(_offers, base, effects, RULES.partner if good else -1.0, RULES.partners, True), roots)
    ):
        for offer in offers:
            unordered = tuple(sorted((*(p.id for p in offer.root.model.parts), offer.effect.id)))
            key = (*unordered, str(number)) if number >= len(singles) else unordered
            if key not in promised or offer.promised > promised[key].promised:
                promised[key] = offer
    of_single = {c.ids[0]: c for c in singles}
    order = sorted(promised, key=lambda k: -promised[k].promised)[: 4 if good else RULES.pairs]
    order += [k for k in promised if (len(k) > 2 or promised[k].effect.number > 1) and k not in order]
    tried = spread(partial(_taken, quick=not good), [promised[k] for k in order])
    grown = sorted(
        [(c, len(key) > 2) for key, c in zip(order, tried, strict=True) if c is not None],
        key=lambda g: -total_likelihood_ratio(base, g[0]),
    )
    found = [c for c, _ in grown]
    near = [i for i, pair in enumerate(found[: RULES.refined]) if _excess(pair.fit) < RULES.far]
    again = [i for i in near if not good or not _sound(found[i])]
    # What a logged cause hides shows late: the best pair grown from one that acts just as logged is looked at with care too.
    again += [i for i, (_, logged) in enumerate(grown) if logged and i not in again][:1]
    # As do two that share what one would do: they are reached slowly from one.
    twice = [i for i, pair in enumerate(found) if any(p.effect.number > 1 for p in pair.parts)] if near and not good else []
    again += [i for i in twice if i not in again]
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
            found.append(search(model.with_shared(shared), local, shared))
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


def _refined(base: Fit, pair: Candidate, rounds: int = 2) -> Candidate:
    """Each effect of a set looked for anew while the others stand as the set has them, again where these have changed since."""
    looked: dict[str, float] = {}
    for _ in range(rounds):
        before = _worth(base, pair)
        for part in pair.parts:
            if _worth(base, pair) - looked.get(part.id, -np.inf) < RULES.equal:
                continue
            again = try_add(_held(base, pair, part.id), part.effect)
            if again is not None and _worth(base, again) > _worth(base, pair):
                pair = again
            looked[part.id] = _worth(base, pair)
        if _worth(base, pair) < before + RULES.worth_another:
            break
    return pair


def _worth(base: Fit, candidate: Candidate) -> float:
    """Gain less what parameters gain by chance."""
    return total_likelihood_ratio(base, candidate) - 2.0 * candidate.fit.complexity


def _replaced(base: Fit, candidate: Candidate, effects: Sequence[Effect], most: int, spread: Spread) -> list[list[Candidate]]:
    """For each effect of a set, the set with it replaced by `most` others, those that a first-order step promises most of."""
    others = [e for e in effects if e.id not in candidate.ids]
    held = [_held(base, candidate, p.id) for p in candidate.parts]
    offers = list(spread(partial(_offers, base, others, -1.0, most, False), held))
    tried = iter(spread(partial(_settled, base), [o for of in offers for o in of]))
    found = [[c for c in islice(tried, len(of)) if c is not None] for of in offers]
    return [sorted(some, key=lambda c: -total_likelihood_ratio(base, c)) for some in found]


def _exchanged(base: Fit, pair: Candidate, effects: Sequence[Effect], spread: Spread) -> list[Candidate]:
    """Pairs that share one effect with the best one."""
    likely = [c for some in _replaced(base, pair, effects, RULES.exchanged, spread) for c in some[:2]]
    return list(spread(partial(_refined, base), [c for c in likely if _excess(c.fit) < RULES.far]))


def _needed(pair: Candidate, singles: dict[str, Candidate]) -> Candidate:
    """The pair with the chance of its less certain half: each effect must be needed beside the other."""
    p = 0.0
    for part in pair.parts:
        other = next(o for o in pair.parts if o.id != part.id)
        alone = singles.get(other.id)
        if alone is None:
            continue
        own = np.maximum(likelihood_ratios(alone.fit, pair.fit), 0.0)
        own = np.where(part.concerns(len(own)), own, 0.0)
        free = len(part.effect.active(part.choice))
        p = max(p, chance(part.effect, own, free, places(part, pair.fit.run)))
        if float(own.sum()) < 2.0 * RULES.equal:
            p = 1.0
    return Candidate(pair.fit, pair.own, p)


@dataclass(frozen=True)
class Sets:
    """Sets that leave no pattern, the best first, and those of them in which each effect is needed."""

    down: tuple[Candidate, ...] = ()
    needed: tuple[Candidate, ...] = ()


def larger_sets(base: Fit, pairs: list[Candidate], effects: Sequence[Effect], false_alarm: float, spread: Spread) -> Sets:
    """Sets of three and more effects that leave no pattern, with rivals that differ in one effect; often none.

    The best pairs are grown by one effect at a time as long as each takes away most of the misfit that is left.
    """
    best = _distinct(base, pairs)[: RULES.grown]
    # Of one sensor three effects draw nearly anything, and where a pair leaves no pattern more effects say nothing more.
    if base.run.sensors < 2 or not best or any(_down(c) for c in pairs) or _no_pattern(best[0]):
        return Sets()
    for _ in range(RULES.most_effects - 2):
        left = min(misfit_power(c.fit) for c in best)
        grown = _grown(base, best, effects, spread)
        if not grown or min(misfit_power(c.fit) for c in grown) > RULES.most_left_quick * left:
            return Sets()
        glanced = grown[:2]
        grown[:2] = spread(partial(_refined, base, rounds=1), glanced)
        most = RULES.most_left_of_little if left < RULES.little * misfit_power(base) else RULES.most_left
        if min(misfit_power(c.fit) for c in grown) > most * left:
            return Sets()
        best = [_unmirrored(c) for c in _improved(base, grown, glanced, effects, spread)[: RULES.grown]]
        down = [c for c in best if _down(c)]
        if not down and _no_pattern(best[0]):
            # Undetermined: what it takes the place of may not be, and with more effects nothing is more so.
            instead = [*_with_rivals(base, [best[0]], effects, spread), *_with_one_less(base, best[0])]
            down = [c for c in _distinct(base, instead) if _down(c)]
            if not down:
                return Sets()
        if down:
            down = _with_rivals(base, down, effects, spread)
            needed = spread(partial(of_needed_effects, base, false_alarm=false_alarm, number=len(effects)), down)
            return Sets(tuple(down), tuple(_distinct(base, (c for c in needed if c is not None and _in_turn(c)))))
    return Sets()


def _in_turn(candidate: Candidate) -> bool:
    """Whether what acts once more does so beside the first of its kind: alone it is no other set than with that one."""
    return all(p.effect.number == 1 or p.id.partition(".")[0] in candidate.ids for p in candidate.parts)


def _with_one_less(base: Fit, candidate: Candidate) -> list[Candidate]:
    """The set without each of its effects in turn."""
    new = [p for p in candidate.parts if p not in base.model.parts]
    found = []
    for part in new:
        others = [p for p in candidate.parts if p is not part]
        found.append(_of(base, fit_model(base.run, others, with_parts(candidate.fit, others))))
    return found


def _unmirrored(candidate: Candidate) -> Candidate:
    """The set with values that can really be, where that costs nothing."""
    for at in range(len(candidate.parts)):
        if candidate.fit.physical:
            break
        other = unmirrored(candidate.fit, at)
        if float(likelihood_ratios(candidate.fit, other).sum()) > -RULES.equal:
            candidate = Candidate(other, candidate.own, candidate.p)
    return candidate


def of_needed_effects(base: Fit, candidate: Candidate, false_alarm: float, number: int) -> Candidate | None:
    """The set without effects that explain less, beside the others, than a disturbance would; None where a pattern remains then."""
    while len(candidate.parts) - len(base.model.parts) > 1 and _down(candidate):
        weighed = beside_others(base, candidate, false_alarm, number)
        worth = [-np.inf if w is None else w.evidence / w.need for w in weighed]
        if min(worth) >= RULES.beyond_disturbance:
            return Candidate(candidate.fit, candidate.own, max(w.p for w in weighed if w is not None))
        new = [p for p in candidate.parts if p not in base.model.parts]
        others = [p for p in candidate.parts if p is not new[int(np.argmin(worth))]]
        fit = fit_model(base.run, others, with_parts(candidate.fit, others))
        candidate = _of(base, fit)
    return None


def _no_pattern(candidate: Candidate) -> bool:
    return least_p(candidate.floor) >= RULES.pair_pattern


def _down(candidate: Candidate) -> bool:
    """Whether a set leaves no pattern and is determined."""
    return _no_pattern(candidate) and candidate.identifiable.ok and candidate.fit.physical


def _distinct(base: Fit, candidates: Iterable[Candidate | None]) -> list[Candidate]:
    """The best of each set of effects, those that gain most first."""
    found: dict[frozenset[str], Candidate] = {}
    for c in sorted((c for c in candidates if c is not None), key=lambda c: -total_likelihood_ratio(base, c)):
        found.setdefault(frozenset(c.ids), c)
    return list(found.values())


def _grown(base: Fit, roots: list[Candidate], effects: Sequence[Effect], spread: Spread) -> list[Candidate]:
    """The roots with one effect more each, at a quick look: those that a first-order step promises most of."""
    promised: dict[frozenset[str], _Offer] = {}
    # The roots come with the best first, and of one set the best root's offer is taken: from afar promises are too large, and
    # beside a set that has bent to what is missing too small.
    for offers in spread(partial(_offers, base, effects, -1.0, len(effects), False), [c.fit for c in roots]):
        for offer in offers:
            promised.setdefault(frozenset({*(p.id for p in offer.root.model.parts), offer.effect.id}), offer)
    likely = sorted(promised.values(), key=lambda o: -o.promised)[: RULES.quick_sets]
    return _distinct(base, spread(partial(_settled, base), likely))


def _improved(
    base: Fit, grown: list[Candidate], glanced: Sequence[Candidate], effects: Sequence[Effect], spread: Spread
) -> list[Candidate]:
    """The best sets with each effect looked for anew beside the others, and replaced where another does better.

    The first of them were so once, and were `glanced` before: where that gained little it is not done again.
    """
    pairs = zip(grown, glanced, strict=False)
    again = [c for c, before in pairs if _worth(base, c) >= _worth(base, before) + RULES.worth_another]
    rest = [c for c in grown if not any(c is a for a in again)]
    found = _distinct(base, [*spread(partial(_refined, base, rounds=1), again), *rest])
    if not _sound(found[0]):
        least = total_likelihood_ratio(base, found[0]) - RULES.close
        quick = _distinct(base, [c for some in _replaced(base, found[0], effects, RULES.replaced, spread) for c in some])[:2]
        near = [c for c in quick if total_likelihood_ratio(base, c) > least]
        found = _distinct(base, [*found, *spread(partial(_refined, base), near)])
    return found


def _with_rivals(base: Fit, down: list[Candidate], effects: Sequence[Effect], spread: Spread) -> list[Candidate]:
    """Sets that leave no pattern, and those that differ from the first of them in one effect and leave none either."""
    top, near = down[0], total_likelihood_ratio(base, down[0]) - RULES.close
    quick = [
        c for some in _replaced(base, top, effects, RULES.replaced, spread) for c in some if total_likelihood_ratio(base, c) > near
    ]
    again = [once_more(p.effect, top.parts) for p in top.parts if p.effect.again and p.effect.number == 1 and not p.effect.event]
    others = [e for e in (*effects, *again) if e.id not in top.ids]
    alike = [(p, e) for p in top.parts for e in others if _mistaken_for_each_other(p.effect, e)]
    found = _distinct(base, [*quick, *spread(partial(_mistaken, base, top), alike)])
    refined = [_unmirrored(c) for c in spread(partial(_refined, base, rounds=1), found[: RULES.rivals])]
    return _distinct(base, [*down, *(c for c in refined if _down(c))])


def _mistaken_for_each_other(one: Effect, other: Effect) -> bool:
    """Whether one of two effects is easily mistaken for the other, also where that one acts once more."""
    first, second = (e.id.partition(".")[0] for e in (one, other))
    return second in one.mistaken_for or first in other.mistaken_for


def _mistaken(base: Fit, candidate: Candidate, change: tuple[Part, Effect]) -> Candidate | None:
    """The set with one of its effects exchanged for one that is easily mistaken for it."""
    part, effect = change
    return try_add(_held(base, candidate, part.id), effect)
