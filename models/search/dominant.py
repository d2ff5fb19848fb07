"""Which effect matters although the rest is imperfect: effects named one after the other while a pattern remains.

No machine is its model alone: a room wanders, a load flutters. What is asked of an effect here is not that it brings every sensor
down to white noise but that it explains the misfit much better than an unknown disturbance of the same size and colour would
(`..noise.spectral`), the disturbance estimated anew for each model. Where more than two effects do so equally well none is named.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.special import chdtri

from ..core.kernel import Array
from ..core.tails import chi2_tail
from ..effects.base import Effect
from ..joint import Fit, Part, fit_model, with_parts
from ..noise.spectral import block_means, spectral_likelihood
from .candidates import Candidate, trials, try_add
from .judge import least_p, sensor_p_values
from .rules import RULES


@dataclass(frozen=True)
class Weighed:
    """A candidate with its evidence over an unknown disturbance, twice the log-likelihood ratio, and what chance would give.

    share is that of the misfit it explains in the sensors that it concerns; p the chance of the evidence over all that was tried,
    were the chi-square law of clean records true of imperfect ones, which is why several times the need is asked for.
    """

    candidate: Candidate
    evidence: float
    need: float
    share: float
    p: float

    def clear(self, beyond: float) -> bool:
        """Whether it goes `beyond` what chance gives; twice that where it explains a part of the misfit only."""
        much = beyond if self.share >= RULES.mostly else 2.0 * beyond
        return self.evidence >= much * self.need and self.candidate.identifiable.ok

    @property
    def worth(self) -> float:
        """Evidence less what chance gives, by which rivals are compared."""
        return self.evidence - self.need


@dataclass(frozen=True)
class Stage:
    """One more effect on a model: the `before` of it, the one named, and a rival that explains it as well, if there is one."""

    before: Fit
    named: Weighed
    rival: Weighed | None

    @property
    def fit(self) -> Fit:
        return self.named.candidate.fit

    @cached_property
    def share(self) -> float:
        """Share of the misfit before it that the effect explains, over all sensors."""
        return explained_share(self.before, self.fit)


def misfit(fit: Fit) -> Array:
    """Root mean square (S,) [K] of what a model leaves beside the noise of its readings."""
    noise = np.maximum(fit.run.noise, fit.run.resolution / np.sqrt(12.0))
    return np.asarray(np.sqrt(np.maximum(fit.rmse**2 - noise**2 * fit.dof / np.maximum(fit.readings, 1), 0.0)))


def explained_share(before: Fit, after: Fit, who: Any = slice(None)) -> float:
    """Share of the misfit (its mean square, by readings, in sensors who (S,)) that a model explains of what another leaves."""
    left, had = (float((misfit(f) ** 2 * f.readings)[who].sum()) for f in (after, before))
    return 0.0 if had <= 0.0 else min(1.0, max(0.0, 1.0 - left / had))


class _Scale:
    """Residuals of a fit against the unknown disturbance that suits them, on the scale of that fit's own misfit."""

    def __init__(self, before: Fit, false_alarm: float, number: int) -> None:
        run = before.run
        self.before, self.chance = before, false_alarm / max(1, number)
        means, weight = block_means(before.residual, run.weight, run.time)
        noise = np.maximum(run.noise, run.resolution / np.sqrt(12.0))
        per_block = np.maximum(np.median(weight, axis=1), 1.0)
        self.scale = np.maximum(np.sqrt(noise**2 / per_block + (RULES.white_share * before.rmse) ** 2), 1e-12)
        self.without = spectral_likelihood(means, self.scale)

    def weighed(self, candidate: Candidate, part: Part) -> Weighed | None:
        """A candidate whose model has one part more than the fit before."""
        run, fit = self.before.run, candidate.fit
        means = block_means(fit.residual, run.weight, run.time)[0]
        if not np.isfinite(means).all():
            return None
        free, tried = max(1, fit.searched - self.before.searched), trials(part.effect, run)
        evidence = 2.0 * (spectral_likelihood(means, self.scale) - self.without)
        return Weighed(
            candidate,
            evidence,
            need=float(chdtri(free, self.chance / tried)),
            share=explained_share(self.before, fit, part.concerns(run.sensors)),
            p=min(1.0, tried * chi2_tail(free, max(evidence, 0.0))),
        )


def weigh(before: Fit, candidates: Iterable[Candidate], false_alarm: float, number: int) -> list[Weighed]:
    """Candidates grown from one fit with their evidence, those of most worth first; `number` effects were tried."""
    scale = _Scale(before, false_alarm, number)
    found = [scale.weighed(c, c.parts[-1]) for c in candidates]
    return sorted([w for w in found if w is not None], key=lambda w: -w.worth)


def beats_disturbance(base: Fit, named: Candidate, false_alarm: float, number: int) -> bool:
    """Whether each effect of a model that is down to the noise explains more, beside the others, than a disturbance would."""
    new = [p for p in named.parts if p not in base.model.parts]
    beyond = RULES.beyond_alone if len(new) < 2 else RULES.beyond_disturbance
    for part in new:
        others = [p for p in named.parts if p is not part]
        without = fit_model(base.run, others, with_parts(named.fit, others)) if len(new) > 1 else base
        weighed = _Scale(without, false_alarm, number).weighed(named, part)
        if weighed is None or weighed.evidence < beyond * weighed.need:
            return False
    return True


def decide(before: Fit, weighed: Sequence[Weighed]) -> Stage | None:
    """The effect to name of candidates weighed, or none: none goes far enough beyond chance, or too many do so as well."""
    real = [w for w in weighed if w.candidate.fit.physical and w.share >= RULES.least_share]
    beyond = RULES.beyond_once_more if before.model.parts else RULES.beyond_disturbance
    sound = [w for w in real if w.clear(beyond)]
    if not sound or real[0].worth * RULES.as_good > sound[0].worth:
        return None
    # What the unknown disturbance does not part, the plain likelihood may: a rival explains as much of the misfit too.
    near = [w for w in real if w.worth >= RULES.as_good * sound[0].worth]
    best = max((w for w in near if w in sound), key=lambda w: w.candidate.gain)
    rivals = [w for w in near if w is not best and w.candidate.gain >= RULES.as_good * best.candidate.gain]
    return Stage(before, best, rivals[0] if rivals else None) if len(rivals) < 2 else None


def explain(
    base: Fit,
    singles: Sequence[Candidate],
    effects: Sequence[Effect],
    false_alarm: float = RULES.false_alarm,
    spread: Callable[..., Iterable[Any]] = map,
    most: int = RULES.most_effects,
) -> tuple[Stage, ...]:
    """Effects named one after the other, from the candidates tried first on; none where nothing beats an unknown disturbance."""
    stages: list[Stage] = []
    before, tried = base, list(singles)
    while len(stages) < most:
        stage = decide(before, weigh(before, tried, false_alarm, max(1, len(effects))))
        if stage is None:
            break
        stages.append(stage)
        before = stage.fit
        if least_p(sensor_p_values(before)) >= RULES.pattern:
            break
        have = [p.id for p in before.model.parts]
        left = [e for e in effects if e.id not in have]
        tried = [c for c in spread(partial(try_add, before), left) if c is not None]
    return tuple(stages)
