"""Which effect is missing: a search over single effects, pairs and larger sets that knows how often it names one by chance.

The rules: a set of effects is named only if chance would not give its gain (over everything that was tried), it lowers the error
on readings left out, the record determines its parameters, and every sensor is down to its noise. Among sets that fit
equally well the one with the fewest parameters is the verdict. Where no single effect or pair does, the best pairs are grown to
sets of three and four (:mod:`.sets`), each of whose effects must explain more beside the others than a disturbance. Where none
goes down to the noise, effects that matter although the rest is imperfect are named one after the other (:mod:`.dominant`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ..core.kernel import Array
from ..effects.base import Effect
from ..joint import Fit, fit_model, with_parts
from ..observations import Observations
from .candidates import Candidate, try_add
from .dominant import Stage, beats_disturbance, beside_others, explain, foreseen, misfit_power, try_all, weigh
from .heldout import held_out_errors
from .judge import least_p, likelihood_ratios, sensor_p_values
from .mutual import beside_shared
from .order import in_order
from .rules import RULES
from .sets import Spread, larger_sets, total_likelihood_ratio, tried_pairs

__all__ = ["Discovery", "Spread", "discover", "discover_together", "total_likelihood_ratio"]


@dataclass(frozen=True)
class Discovery:
    """What a search found. `named` is the verdict's model, None for `none` and `unexplained`.

    stages are the steps to it where effects were named one after the other, held their errors (S,) [K] on readings left out from
    the base model's on. singles are in the order of their gain; also_possible are those models that fit as well, or for
    `unexplained` the nearest. ahead_base, ahead (S,) [K] are errors on readings left out. around is the fit of a set that holds
    what is named and more, and leaves far less, where that more is not sure enough to be named: sizes may be as it has them.
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
    around: Fit | None = None

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
    """Search the effects, singly, in pairs and in larger sets, that the base model (or the model `known`) lacks on a run.

    `spread` may be the ``map`` of a ``concurrent.futures.Executor``; the result does not depend on it.
    """
    base = fit_model(run) if known is None else known
    floor = sensor_p_values(base)
    # What this run logs nothing for is not tried, and chance has no part in it.
    effects = [e for e in effects if e.choices(run)]
    singles: list[Candidate] = [c for c in spread(partial(try_add, base), effects) if c is not None]
    singles.sort(key=lambda c: -c.gain)
    acceptance = _Acceptance(base, max(1, len(effects)), false_alarm)
    good = [c for c in singles if acceptance.accepts(c)]
    above, sets = least_p(floor) < RULES.pattern, most > 1 and known is None
    pairs: list[Candidate] = []
    if sets and (above or good):
        # A single that is well down at the noise leaves room for little more.
        sound = [c for c in good if least_p(c.floor) > RULES.sound]
        pairs = tried_pairs(base, singles, effects, sound, spread)
    named, also = _sure(acceptance, good + [c for c in pairs if acceptance.accepts(c)], singles, pairs)
    if named is None and above and sets:
        named, rivals = _several(base, pairs, effects, false_alarm, spread)
        if named is not None and _roundabout(base, named, singles):
            named = None
        also = also if named is None else rivals
    first = foreseen(base, singles, false_alarm) if above and known is None else None
    if first is not None and (named is None or first.named.effect.id not in named.ids):
        return _in_stages([base], [[c] for c in singles], effects, false_alarm, spread, first)[0]
    p = min((acceptance.chance_over_all(c) for c in singles), default=1.0)
    nothing = Discovery(base, floor, tuple(singles), None, (), p, np.full(run.sensors, np.nan), None, "none")
    if named is None and not above:
        return nothing
    if named is None:
        found = _in_stages([base], [[c] for c in singles], effects, false_alarm, spread)[0]
        found = _of_two(found, pairs, acceptance.number, false_alarm) or found
        if found.named is not None:
            around = _around(base, found.named, pairs)
            return replace(found, around=beside_shared(around.fit)) if around is not None else found
        near = also or [*singles[:1], *sorted(pairs, key=lambda c: -total_likelihood_ratio(base, c))[:2]]
        return replace(nothing, also=tuple(near), ahead_base=found.ahead_base, why="nothing fits")
    whole = beside_shared(named.fit)
    named = in_order(named if whole is named.fit else replace(named, fit=whole))
    also = [in_order(c) for c in also]
    ahead_base, ahead = held_out_errors(base), held_out_errors(named.fit)
    if np.nansum(ahead**2 * base.readings) > np.nansum(ahead_base**2 * base.readings):
        why = "none" if not above else "the error on readings left out does not fall"
        return replace(nothing, also=(named, *also), ahead_base=ahead_base, why=why)
    return Discovery(base, floor, tuple(singles), named, tuple(also), acceptance.chance_over_all(named), ahead_base, ahead, "")


@dataclass(frozen=True)
class _Acceptance:
    """What a set of effects must at least show to be named, beside a base model, of `number` effects that are looked at."""

    base: Fit
    number: int
    false_alarm: float

    def chance_over_all(self, candidate: Candidate) -> float:
        """The chance of a set over all sets of that size: of a pair, the best of all pairs, each half must beat it."""
        size = len(candidate.ids) - len(self.base.model.parts)
        return min(1.0, candidate.p * math.comb(self.number + size - 1, size))

    def accepts(self, candidate: Candidate) -> bool:
        """Whether a set explains all there is, is determined and can really be."""
        # Two effects can imitate more than one can: their residuals must look more like noise.
        alone = len(candidate.ids) == 1 + len(self.base.model.parts)
        clean = candidate.at_floor if alone else least_p(candidate.floor) >= RULES.pair_pattern
        return self.chance_over_all(candidate) < self.false_alarm and clean and candidate.identifiable.ok and candidate.fit.physical


def _sure(
    acceptance: _Acceptance, finalists: list[Candidate], singles: list[Candidate], pairs: list[Candidate]
) -> tuple[Candidate | None, list[Candidate]]:
    """The one of the finalists that can be named, None where there is none or others do as well; and the others."""
    base = acceptance.base
    named, also = _choose(base, finalists)
    if named is None:
        return None, also
    if (
        _arbitrary(base, named, pairs)
        or not beats_disturbance(base, named, acceptance.false_alarm, acceptance.number)
        or _roundabout(base, named, singles)
    ):
        return None, [named, *also]
    return named, also + _nearly(base, named, also, singles)


def discover_together(
    runs: Sequence[Observations], effects: Sequence[Effect], false_alarm: float = RULES.false_alarm, spread: Spread = map
) -> list[Discovery]:
    """Search several runs of one machine as one: the evidence for an effect is summed over the runs that show it.

    A run that does not show an effect is left without it: what happened in one run only is that run's event.
    """
    bases = [fit_model(run) for run in runs]
    effects = [e for e in effects if any(e.choices(run) for run in runs)]
    return _in_stages(bases, try_all(bases, effects, spread), effects, false_alarm, spread)


def _in_stages(
    bases: Sequence[Fit],
    tried: Sequence[Sequence[Candidate | None]],
    effects: Sequence[Effect],
    false_alarm: float,
    spread: Spread,
    first: Stage | None = None,
) -> list[Discovery]:
    """Effects named one after the other as long as the error on readings left out, of all runs, falls; what that says of each."""
    stages: list[Stage] = []
    held = [[held_out_errors(fit)] for fit in bases]

    def pooled(number: int) -> float:
        return sum(float(np.nansum(h[number] ** 2 * fit.readings)) for h, fit in zip(held, bases, strict=True))

    for stage in explain(bases, tried, effects, false_alarm, spread, first=first):
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


def _of_two(found: Discovery, pairs: Sequence[Candidate], number: int, false_alarm: float) -> Discovery | None:
    """What is found where two effects together explain far more than what was named one after the other; mostly None.

    Of a second mass and a load that changed, a cooling that changed alone explains a part, and takes the place of both. Each of the
    two must go as far beyond chance beside the other as an effect that is named beside others, and no third pair may do as well.
    """
    base = found.base
    before = 0.0 if found.named is None else total_likelihood_ratio(base, found.named)
    so_named = [] if found.named is None else [found.named]
    had, alone = misfit_power(base), min((misfit_power(c.fit) for c in (*found.singles, *so_named)), default=0.0)
    sound = [c for c in pairs if c.identifiable.ok and c.fit.physical and misfit_power(c.fit) <= (1.0 - RULES.mostly) * had]
    sound.sort(key=lambda c: -total_likelihood_ratio(base, c))
    if not sound or total_likelihood_ratio(base, sound[0]) < RULES.least_evidence:
        return None
    named = sound[0]
    # What every single effect leaves, and what was named, no background explains: a second one draws half of that, hardly a tenth.
    little = misfit_power(named.fit) <= RULES.pair_leaves * alone
    if not little and total_likelihood_ratio(base, named) < RULES.both * before:
        return None
    near = [c for c in sound if total_likelihood_ratio(base, c) >= RULES.as_good * total_likelihood_ratio(base, named)]
    if little:
        near = [c for c in near if misfit_power(c.fit) <= RULES.pair_rival * misfit_power(named.fit)]
    different = {frozenset(c.ids): c for c in reversed(near)}
    # One of the two may be sure, and the other one of several.
    if len(different) > 2 and not (little and frozenset.intersection(*different)):
        return None
    needed = beside_others(base, named, false_alarm, number)
    named, first = _behind_a_single(base, named, found.singles)
    beyond = RULES.beyond_pair if little else RULES.beyond_once_more
    if first is None or not all(w is not None and w.clear(beyond) for w in needed):
        return None
    held = tuple(held_out_errors(fit) for fit in (base, first.fit, named.fit))
    so_far = found.ahead if found.ahead is not None else found.ahead_base
    if np.nansum(held[-1] ** 2 * base.readings) > np.nansum(so_far**2 * base.readings):
        return None
    steps = [weigh([fit], [[c]], false_alarm) for fit, c in ((base, first), (first.fit, named))]
    if not all(steps):
        return None
    stages = tuple(Stage((fit,), step[0], None) for fit, step in zip((base, first.fit), steps, strict=True))
    also = tuple(in_order(c) for ids, c in reversed(different.items()) if ids != frozenset(named.ids))[: RULES.most_also]
    p = max(w.p for w in needed if w is not None)
    return Discovery(base, found.base_floor, found.singles, named, also, p, held[0], held[-1], "", stages, held)


def _behind_a_single(base: Fit, pair: Candidate, singles: Sequence[Candidate]) -> tuple[Candidate, Candidate | None]:
    """A pair with that of its effects behind the other one which, by itself, is among the single ones; and that one, if any is."""
    single = {c.parts[-1].effect.id: c for c in singles}
    *others, one, two = pair.parts
    if one.effect.id in single or two.effect.id not in single:
        return pair, single.get(one.effect.id)
    turned = fit_model(base.run, [*others, two, one], with_parts(pair.fit, [*others, two, one]))
    return replace(pair, fit=turned), single[two.effect.id]


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


def _choose(base: Fit, finalists: list[Candidate]) -> tuple[Candidate | None, list[Candidate]]:
    if not finalists:
        return None, []
    value = {id(c): float(likelihood_ratios(base, c.fit, careful=False).sum()) for c in finalists}
    best = max(finalists, key=lambda c: value[id(c)] - 2.0 * c.fit.complexity)
    limit = value[id(best)]
    equal = [c for c in finalists if value[id(c)] > limit - RULES.equal - 2.0 * max(0.0, best.fit.complexity - c.fit.complexity)]
    equal.sort(key=lambda c: (len(c.ids), any(p.choice.rare for p in c.parts), c.fit.complexity, -value[id(c)]))
    named = equal[0]
    also = [c for c in equal[1:] if len(c.ids) <= len(named.ids)]
    return named, also[: RULES.most_also]


def _several(
    base: Fit, pairs: list[Candidate], effects: Sequence[Effect], false_alarm: float, spread: Spread
) -> tuple[Candidate | None, list[Candidate]]:
    """The set of three or more effects to name, and what explains as much, whether or not it would be named itself."""
    sets = larger_sets(base, pairs, effects, false_alarm, spread)
    named, rivals = _choose(base, list(sets.needed))
    if named is None:
        return None, []
    told = [set(c.ids) for c in (named, *rivals)]
    least = total_likelihood_ratio(base, named) - RULES.nearly[0]
    # A set with one effect more than is needed is no rival.
    other = [c for c in sets.down if set(c.ids) not in told and not set(named.ids) < set(c.ids)]
    return named, rivals + [c for c in other if total_likelihood_ratio(base, c) > least]


def _arbitrary(base: Fit, named: Candidate, pairs: list[Candidate]) -> bool:
    """Whether a pair draws the misfit of a single sensor, where two effects can draw nearly anything, or is one of several."""
    if len(named.parts) - len(base.model.parts) < 2:
        return False
    n = base.run.sensors
    who = [p.concerns(n) for p in named.parts]
    shared = any(p.effect.scope == "run" and p.concerned is None for p in named.parts)
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


def _around(base: Fit, named: Candidate, pairs: Sequence[Candidate]) -> Candidate | None:
    """The best pair that holds what is named and takes away half of what that leaves; mostly None."""
    left = (1.0 - RULES.takes) * misfit_power(named.fit)
    more = [c for c in pairs if set(named.ids) < set(c.ids) and c.identifiable.ok and c.fit.physical]
    more = [c for c in more if misfit_power(c.fit) <= left]
    return max(more, key=lambda c: total_likelihood_ratio(base, c), default=None)


def _roundabout(base: Fit, named: Candidate, singles: list[Candidate]) -> bool:
    """Whether a set draws, with what a background adds, what one effect that is not in it, or not so, explains nearly all of."""
    best = max(singles, key=lambda c: total_likelihood_ratio(base, c))
    so, instead = ({(p.id.partition(".")[0], p.choice.label) for p in c.parts} for c in (named, best))
    if len(named.ids) < 2 + len(base.model.parts) or instead <= so:
        return False
    leaves, gains = RULES.roundabout
    little = misfit_power(best.fit) <= leaves * misfit_power(base)
    enough = total_likelihood_ratio(base, best) >= gains * total_likelihood_ratio(base, named)
    return bool(little and enough and best.identifiable.ok and best.fit.physical)


def _nearly(base: Fit, named: Candidate, also: list[Candidate], singles: list[Candidate]) -> list[Candidate]:
    """Single effects that leave no pattern either and gain nearly as much, whether or not they would be named themselves."""
    best = total_likelihood_ratio(base, named)
    slack = min(max(RULES.nearly[0], 0.25 * best), RULES.nearly[1])
    ids = {c.ids for c in (named, *also)}
    near = [
        c for c in singles if c.ids not in ids and c.at_floor and c.fit.physical and total_likelihood_ratio(base, c) > best - slack
    ]
    return near[: max(0, RULES.most_also - len(also))]
