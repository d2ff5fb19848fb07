"""Which effect matters although the rest is imperfect: effects named one after the other while a pattern remains.

No machine is its model alone: a room wanders, a load flutters. What is asked of an effect here is not that it brings every sensor
down to white noise but that it explains the misfit much better than an unknown disturbance of the same size and colour would
(`..noise.spectral`), the disturbance estimated anew for each model. Where more than two effects do so equally well none is named.
Several runs of one machine are one search: an effect's evidence is summed over the runs that show it.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.special import chdtri

from ..core.kernel import Array
from ..core.tails import chi2_tail
from ..effects.base import Effect
from ..joint import Fit, Key, Part, fit_model, with_parts
from ..noise.spectral import block_means, spectral_likelihood
from .candidates import Candidate, once_more, partners, places, try_add
from .judge import least_p, likelihood_ratios, sensor_p_values
from .logged import follows_machine
from .order import in_order
from .rules import RULES


@dataclass(frozen=True)
class RunEvidence:
    """What an effect does for one run: evidence over an unknown disturbance, twice the log-likelihood ratio, for `free` parameters
    at `places` places; had and left are the misfits before and after in the sensors that it concerns [K^2 times readings].
    """

    candidate: Candidate
    evidence: float
    free: int
    places: float
    had: float
    left: float


@dataclass(frozen=True)
class Weighed:
    """An effect over all runs: `by_run` has None for a run that does not show it.

    need is the evidence that chance gives over all that was tried, p the chance of this evidence were the chi-square law of clean
    records true of imperfect ones, which is why several times the need is asked for.
    """

    by_run: tuple[RunEvidence | None, ...]
    need: float
    p: float

    @cached_property
    def shown(self) -> list[RunEvidence]:
        """What the runs that show it say."""
        return [s for s in self.by_run if s is not None]

    @property
    def effect(self) -> Effect:
        return self.shown[0].candidate.parts[-1].effect

    @property
    def evidence(self) -> float:
        return sum(s.evidence for s in self.shown)

    @property
    def gain(self) -> float:
        """Likelihood ratio under white noise."""
        return sum(s.candidate.gain for s in self.shown)

    @property
    def worth(self) -> float:
        """Evidence less what chance gives, by which rivals are compared."""
        return self.evidence - self.need

    @property
    def share(self) -> float:
        """Share of the misfit that it explains in the sensors that it concerns."""
        had, left = sum(s.had for s in self.shown), sum(s.left for s in self.shown)
        return 0.0 if had <= 0.0 else min(1.0, max(0.0, 1.0 - left / had))

    @property
    def physical(self) -> bool:
        return all(s.candidate.fit.physical for s in self.shown)

    @property
    def distant_surroundings(self) -> bool:
        return any(s.candidate.fit.distant_surroundings for s in self.shown)

    def clear(self, beyond: float, least: float = RULES.least_evidence) -> bool:
        """Whether it goes `beyond` what chance gives, twice that where it explains a part of the misfit only, and is determined.

        Where the curvature alone calls its amplitude doubtful the evidence, which is a likelihood ratio, may overrule it.
        """
        much = beyond if self.share >= RULES.mostly else 2.0 * beyond
        determined = [s.candidate.identifiable for s in self.shown]
        if not any(d.ok for d in determined):
            much = RULES.overruled * beyond if any(d.near for d in determined) else np.inf
        return bool(self.evidence >= max(much * self.need, least))


@dataclass(frozen=True)
class Stage:
    """One more effect on the models `before`, one of each run, and a rival that explains it as well, if there is one."""

    before: tuple[Fit, ...]
    named: Weighed
    rival: Weighed | None

    @property
    def fits(self) -> tuple[Fit, ...]:
        """The models with it, one of each run; a run that does not show it keeps its own."""
        return tuple(f if s is None else s.candidate.fit for f, s in zip(self.before, self.named.by_run, strict=True))

    def of_run(self, k: int) -> "Stage":
        """The stage as it concerns the k-th run, which shows its effect; evidence is that run's, chance that of all runs."""
        rival = self.rival if self.rival is not None and self.rival.by_run[k] is not None else None
        own = replace(self.named, by_run=(self.named.by_run[k],))
        return Stage((self.before[k],), own, None if rival is None else replace(rival, by_run=(rival.by_run[k],)))


def misfit(fit: Fit) -> Array:
    """Root mean square (S,) [K] of what a model leaves beside the noise of its readings."""
    noise = fit.run.least_noise
    return np.asarray(np.sqrt(np.maximum(fit.rmse**2 - noise**2 * fit.dof / np.maximum(fit.readings, 1), 0.0)))


def misfit_power(fit: Fit, who: Any = slice(None)) -> float:
    """Sum of the squared misfit over the readings of the sensors who (S,) [K^2]."""
    return float((misfit(fit) ** 2 * fit.readings)[who].sum())


class _Scale:
    """Residuals of a fit against the unknown disturbance that suits them, on the scale of that fit's own misfit."""

    def __init__(self, before: Fit) -> None:
        run = before.run
        self.before = before
        means, weight = block_means(before.residual, run.weight, run.time)
        per_block = np.maximum(np.median(weight, axis=1), 1.0)
        self.scale = np.maximum(np.sqrt(run.least_noise**2 / per_block + (RULES.white_share * before.rmse) ** 2), 1e-12)
        self.without = spectral_likelihood(means, self.scale)

    def evidence(self, candidate: Candidate, part: Part) -> RunEvidence | None:
        """A candidate whose model has one part more than the fit before; None where it has no finite curve."""
        run, fit = self.before.run, candidate.fit
        means = block_means(fit.residual, run.weight, run.time)[0]
        if not np.isfinite(means).all():
            return None
        evidence = 2.0 * (spectral_likelihood(means, self.scale) - self.without)
        who = part.concerns(run.sensors)
        had, left = (misfit_power(f, who) for f in (self.before, fit))
        return RunEvidence(candidate, evidence, max(1, fit.searched - self.before.searched), places(part, run), had, left)


def _weighed(by_run: Sequence[RunEvidence | None], false_alarm: float, number: int) -> Weighed | None:
    """An effect over the runs that show it; over the best of them where none does by itself."""
    chance = false_alarm / max(1, number)
    some = [s for s in by_run if s is not None]
    if not some:
        return None
    # What belongs to the machine may show a little in each run; an event is one run's, and must show there by itself.
    alone = RULES.beyond_disturbance if some[0].candidate.parts[-1].effect.event else 1.0
    shown = [s for s in some if s.evidence > alone * float(chdtri(s.free, chance / s.places))] or [
        max(some, key=lambda s: s.evidence)
    ]
    free, places = sum(s.free for s in shown), float(np.prod([s.places for s in shown]))
    p = min(1.0, number * places * chi2_tail(free, max(0.0, sum(s.evidence for s in shown))))
    return Weighed(tuple(s if s in shown else None for s in by_run), float(chdtri(free, chance / places)), p)


def weigh(before: Sequence[Fit], tried: Sequence[Sequence[Candidate | None]], false_alarm: float) -> list[Weighed]:
    """Effects with their evidence, those of most worth first: tried has for each effect a candidate of each run."""
    scales = [_Scale(fit) for fit in before]
    found = []
    for candidates in tried:
        pairs = zip(scales, candidates, strict=True)
        by_run = [None if c is None else scale.evidence(c, c.parts[-1]) for scale, c in pairs]
        found.append(_weighed(by_run, false_alarm, len(tried)))
    return sorted([w for w in found if w is not None], key=lambda w: -w.worth)


def beside_others(base: Fit, named: Candidate, false_alarm: float, number: int) -> list[Weighed | None]:
    """What each effect of a model that is down to the noise explains beside the others, over an unknown disturbance."""
    new = [p for p in named.parts if p not in base.model.parts]
    found = []
    for part in new:
        others = [p for p in named.parts if p is not part]
        without = fit_model(base.run, others, with_parts(named.fit, others)) if len(new) > 1 else base
        found.append(_weighed([_Scale(without).evidence(named, part)], false_alarm, number))
    return found


def beats_disturbance(base: Fit, named: Candidate, false_alarm: float, number: int) -> bool:
    """Whether each effect of a model that is down to the noise explains more, beside the others, than a disturbance would."""
    weighed = beside_others(base, named, false_alarm, number)
    beyond = RULES.beyond_alone if len(weighed) < 2 else RULES.beyond_disturbance
    return all(w is not None and w.evidence >= beyond * w.need for w in weighed)


def decide(before: Sequence[Fit], weighed: Sequence[Weighed], sure: bool = True) -> Stage | None:
    """The effect to name of those weighed, or none: none goes far enough beyond chance, or too many do so as well.

    Not sure: the one that is likeliest, which may go less far.
    """
    real = [w for w in weighed if w.physical and w.share >= RULES.least_share]
    beside = any(fit.model.parts for fit in before)
    beyond = RULES.beyond_once_more if beside else RULES.beyond_disturbance
    share = 1.0 if sure else RULES.likeliest
    sound = [w for w in real if w.clear(share * beyond, share * RULES.least_evidence)]
    if not sound or real[0].worth * RULES.as_good > sound[0].worth:
        return None
    # What the unknown disturbance does not part, the plain likelihood may: a rival explains as much of the misfit too.
    near = [w for w in real if w.worth >= RULES.rival * sound[0].worth or 1.0 - w.share <= RULES.leaves * (1.0 - sound[0].share)]
    # A changed heat or loss acts as a moved room does where the room is far away: no rival of what needs no such room.
    inside = [w for w in near if not w.distant_surroundings]
    near = inside if any(w in sound for w in inside) else near
    most = max(w.gain for w in near if w in sound)
    best, *rivals = sorted((w for w in near if w.gain >= RULES.as_good * most), key=lambda w: (w not in sound, -w.worth))
    return Stage(tuple(before), best, rivals[0] if rivals else None) if len(rivals) < 2 else None


def likeliest(base: Fit, singles: Sequence[Candidate], false_alarm: float) -> Stage | None:
    """The single effect that is likeliest where none is named, explains most of the misfit and has no rival; mostly none."""
    stage = decide([base], weigh([base], [[c] for c in singles], false_alarm), sure=False)
    return stage if stage is not None and stage.rival is None and stage.named.share >= RULES.mostly else None


def _of_the_machine(base: Fit, part: Part) -> bool:
    """Whether the logged column of a part is a thermometer on the machine, which sees what the others see."""
    run, name = base.run, str(part.choice.constants.get("column", ""))
    logged, seen = {**run.inputs, **run.ambient}, run.used.any(axis=0)
    return name in logged and follows_machine(run.filled[:, seen], logged[name][seen])


def foreseen(base: Fit, singles: Sequence[Candidate], false_alarm: float) -> Stage | None:
    """The effect of what was logged, where it comes out as large as physics has it and explains most of the misfit; mostly none.

    Of a room that is logged, and that moves a machine by as much as it moved itself, no other effect needs to be better: how large
    these are nobody knows before.
    """
    found = []
    for single in singles:
        effect = single.parts[-1].effect
        typical = next((p.typical for p in effect.parameters if p.name == effect.amplitude), None)
        if not effect.logged or typical is None or typical[1] > RULES.known_size * typical[0] or len(single.parts) > 1:
            continue
        if _of_the_machine(base, single.parts[-1]):
            continue
        size = np.atleast_1d(single.fit.values[Key(len(single.parts) - 1, effect.amplitude)])
        as_known = (size >= typical[0] / RULES.known_size) & (size <= typical[1] * RULES.known_size)
        weighed = weigh([base], [[single]], false_alarm)
        if as_known.all() and weighed and single.identifiable.ok and single.fit.physical:
            found += [w for w in weighed if w.share >= RULES.mostly and w.evidence >= w.need]
    best = max(found, key=lambda w: w.share, default=None)
    return None if best is None else Stage((base,), best, None)


def _twice(
    before: Sequence[Fit],
    weighed: Sequence[Weighed],
    tried: Sequence[Sequence[Candidate | None]],
    false_alarm: float,
    spread: Callable[..., Iterable[Any]],
    decided: Stage | None,
) -> Stage | None:
    """A stage of one effect that acts twice; None where that does not surely explain more than any single effect does.

    Of two changes of the load one alone explains about as much as half the catalogue does, both together far more. Where a single
    effect was decided for, its pair is left to the next stage, and another effect's pair must be as far above it as above a rival.
    """
    seen: list[tuple[Weighed, float, list[Candidate]]] = []
    below = RULES.as_good if decided is None else RULES.rival
    scales = [_Scale(fit) for fit in before]
    for candidates in tried:
        some = [c for c in candidates if c is not None]
        effect = some[0].parts[-1].effect if some else None
        if effect is None or len(some) < len(before) or not effect.again:
            continue
        # By its name: each run, and each worker, has an effect object of its own.
        if decided is not None and decided.named.effect.id == effect.id:
            continue
        twin = once_more(effect, some[0].parts)
        twins = [in_order(t) for t in try_all([c.fit for c in some], [twin], spread)[0] if t is not None]
        if len(twins) < len(before):
            continue
        by_run = [scale.evidence(t, t.parts[-1]) for scale, t in zip(scales, twins, strict=True)]
        both = _weighed([None if e is None else replace(e, places=e.places**2) for e in by_run], false_alarm, len(tried))
        if both is not None and both.physical:
            seen.append((both, sum(float(likelihood_ratios(f, t.fit).sum()) for f, t in zip(before, twins, strict=True)), twins))
    seen.sort(key=lambda one: -one[0].worth)
    for both, gain, twins in seen:
        alike = any(w.worth >= below * both.worth or w.gain >= below * gain for w in weighed)
        if both.clear(RULES.beyond_once_more) and not alike and _each_needed(before, twins, false_alarm, len(tried)):
            # A load that goes down and up again looks much like a door that was open.
            near = [w for w, g, _ in seen if w is not both and w.worth >= RULES.rival * both.worth and g >= RULES.as_good * gain]
            return Stage(tuple(before), both, near[0] if near else None)
    return None


def _each_needed(before: Sequence[Fit], twins: Sequence[Candidate], false_alarm: float, number: int) -> bool:
    """Whether each of two effects goes far beyond chance beside the other, over all runs."""
    beside = [beside_others(fit, twin, false_alarm, number) for fit, twin in zip(before, twins, strict=True)]
    halves = [_weighed([s for w in of if w is not None for s in w.shown], false_alarm, number) for of in zip(*beside, strict=True)]
    return all(half is not None and half.clear(RULES.beyond_once_more) for half in halves)


def explain(
    bases: Sequence[Fit],
    singles: Sequence[Sequence[Candidate | None]],
    effects: Sequence[Effect],
    false_alarm: float = RULES.false_alarm,
    spread: Callable[..., Iterable[Any]] = map,
    most: int = RULES.most_effects,
    first: Stage | None = None,
) -> tuple[Stage, ...]:
    """Effects named one after the other in the runs of one machine; none where nothing beats an unknown disturbance.

    bases has the model of each run to begin with, singles for each effect the candidate of each run that was tried first on it;
    first is the stage to begin with, where it is known.
    """
    stages: list[Stage] = []
    before, tried = tuple(bases), singles
    while len(stages) < most:
        if first is not None and not stages:
            stages.append(first)
            before = first.fits
            if all(least_p(sensor_p_values(fit)) >= RULES.pattern for fit in before):
                break
            tried = try_all(before, partners(effects, [*bases[0].model.parts, *first.named.shown[0].candidate.parts]), spread)
        weighed = weigh(before, tried, false_alarm)
        decided = decide(before, weighed)
        stage = _twice(before, weighed, tried, false_alarm, spread, decided) or decided
        if stage is None:
            break
        stages.append(stage)
        before = stage.fits
        if all(least_p(sensor_p_values(fit)) >= RULES.pattern for fit in before):
            break
        named = [p for s in stages for p in s.named.shown[0].candidate.parts]
        tried = try_all(before, partners(effects, [*bases[0].model.parts, *named]), spread)
    return tuple(stages)


def try_all(before: Sequence[Fit], effects: Sequence[Effect], spread: Callable[..., Iterable[Any]]) -> list[list[Candidate | None]]:
    """For each effect the best model of each run that adds it."""
    by_run = [list(spread(partial(try_add, fit), effects)) for fit in before]
    return [list(of) for of in zip(*by_run, strict=True)]
