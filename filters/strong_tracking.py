"""Strong tracking with a noise estimate of Sage and Husa: fade until the innovations are explained, learn their noise.

The functions take any number of readings at once and any number of leading axes; :class:`StrongTracking` is their use on one
sensor. Equations are those of Liu et al. 2018, doi:10.13700/j.bh.1001-5965.2017.0312.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Array
from .fading import Context, FadingRule, Memory, Update, joseph


def _transposed(matrix: Array) -> Array:
    return np.swapaxes(matrix, -1, -2)


def _root(matrix: Array) -> Array:
    return np.asarray(np.linalg.cholesky(matrix), float)


def _relative(matrix: Array, root: Array) -> Array:
    """Symmetric matrix (..., p, p) in the units of a covariance whose lower factor is root (p, p)."""
    left = np.asarray(np.linalg.solve(root, matrix), float)
    both = np.asarray(np.linalg.solve(root, _transposed(left)), float)
    return 0.5 * (both + _transposed(both))


def innovation_spread(previous: Array | None, innovation: Array, forgetting: float) -> Array:
    """V (..., p, p) of equation (30) after an innovation (..., p); previous is None at the first one."""
    square = innovation[..., :, None] * innovation[..., None, :]
    return square if previous is None else (forgetting * previous + square) / (1.0 + forgetting)


def fading_factor(
    spread: Array,
    predicted: Array,
    process: Array,
    noise: Array,
    weakening: float,
    most: float = math.inf,
    unit: Array | None = None,
) -> Array:
    """Fading factor (...,), at least 1: equations (27), (33), (34).

    All matrices (..., p, p): spread V of the innovations, predicted covariance of the readings before fading and without their
    noise, its share H Q H^T due to process noise, noise R. The traces add what may be metres and radians, so that the
    reading with the largest number decides alone; in a `unit` (..., p, p), say R, each counts by its own noise.
    """
    excess, faded = spread - process - weakening * noise, predicted - process
    if unit is not None:
        excess, faded = (np.asarray(np.linalg.solve(unit, a), float) for a in (excess, faded))
    above = np.trace(excess, axis1=-2, axis2=-1)
    below = np.trace(faded, axis1=-2, axis2=-1)
    # Nothing to fade, nothing to fade by: a state known exactly stays so.
    factor = np.where(below > 0.0, above / np.where(below > 0.0, below, 1.0), 1.0)
    return np.clip(factor, 1.0, most)


def husa_weight(count: float, forgetting: float) -> float:
    """Weight d of the newest of `count` readings, b the forgetting factor below 1: equation (41)."""
    return (1.0 - forgetting) / (1.0 - math.pow(forgetting, count))


def bounded_covariance(matrix: Array, reference: Array, least: float, most: float) -> Array:
    """The symmetric matrix (..., p, p) with every variance, in every direction, between `least` and `most` of the reference's."""
    root = _root(reference)
    values, vectors = np.linalg.eigh(_relative(matrix, root))
    arms = root @ vectors
    result: Array = (arms * np.clip(values, least, most)[..., None, :]) @ _transposed(arms)
    return result


def sage_husa_noise(
    noise: Array, innovation: Array, predicted: Array, weight: float, reference: Array, least: float, most: float
) -> Array:
    """Noise R (..., p, p) after one more innovation (..., p): equation (45), kept definite.

    predicted (..., p, p) is the covariance of the readings without noise that the gain was made with; weight is d of equation (41).
    The difference (45) is often indefinite, of several readings always where d = 1. There the predicted covariance is not
    taken off, which errs towards caution; and R stays between `least` and `most` times the reference (p, p) in every direction.

    Raises
    ------
    numpy.linalg.LinAlgError: the reference is not positive definite.
    """
    square = innovation[..., :, None] * innovation[..., None, :]
    biased = (1.0 - weight) * noise + weight * square
    plain = biased - weight * predicted
    values, _ = np.linalg.eigh(_relative(plain, _root(reference)))
    definite = values[..., 0] > least
    return bounded_covariance(np.where(definite[..., None, None], plain, biased), reference, least, most)


@dataclass
class HusaMemory(Memory):
    """And the process noise of Sage and Husa: its mean (n,) [state] and covariance (n, n) per unit of the noise variance."""

    drift: Array | None = None
    wander: Array | None = None


@dataclass(frozen=True)
class StrongTracking(FadingRule):
    """Strong tracking of one sensor with the noise estimate of Sage and Husa, in a form that stays stable.

    The model of a temperature record has no process noise, so that a factor as printed would undo in one reading all
    that hundreds have taught: it is bounded, and no state forgets more than brings back what was known at the start.
    Fading scales the covariance from both sides, which keeps it definite. R is a multiple (``noise_factor``) of the noise
    found at the start, which counts as the readings it rests on. R follows the innovations about their running mean,
    as (44) does for the noise: a wrong model gives them a mean, which R would swallow before the covariance fades. An
    innovation beyond `outlier` standard deviations counts as one at the edge, and its R is as wide as that takes. A record
    that jumps for good therefore goes into R: :class:`filters.fading.AdaptiveFading` is the rule for that.

    Mean and covariance of the process noise, equations (42) and (43), are estimated where `process_mean_most` and
    `process_noise_most` are above 0: no state drifts by more than so many of its deviations at the start in one reading, and Q
    stays below so much of the covariance at the start in every direction.
    """

    rule = "strong tracking"
    compiled: ClassVar[bool] = False
    weakening: float = 3.5
    forgetting: float = 0.95
    noise_forgetting: float = 0.95
    noise_least: float = 0.1
    noise_most: float = 100.0
    fading_most: float = 1.5
    outlier: float = 5.0
    process_mean_most: float = 0.0
    process_noise_most: float = 0.0

    def memory(self, scale: float, dof: float) -> Memory:
        return HusaMemory(scale, dof)

    def update(self, m: Memory, state: Array, p: Array, e: float, context: Context) -> Update:
        assert isinstance(m, HusaMemory)
        carried, mean, one = p, state, np.eye(1)
        if m.drift is not None:
            state, e = state + m.drift, e - float(m.drift[0])
        if m.wander is not None:
            p = p + m.wander
        noise, predicted = m.spread * one, p[:1, :1]
        # One outlier must not move the filter or make it forget: beyond the reach it says no more than at the edge.
        reach = self.outlier * math.sqrt(float(p[0, 0]) + m.spread)
        innovation = np.clip(np.array([e / math.sqrt(m.scale)]), -reach, reach)
        spread = innovation_spread(None if math.isnan(m.v) else m.v * one, innovation, self.forgetting)
        m.v = float(spread[0, 0])
        alpha, added = 1.0, 0.0
        if m.v * m.scale > context.dead_band**2:
            alpha = float(fading_factor(spread, predicted, 0.0 * one, noise, self.weakening, self.fading_most))
        if alpha > 1.0:
            now, start = np.diag(p), np.diag(context.start_covariance)
            factor = np.sqrt(np.clip(start / np.maximum(now, 1e-300), 1.0, alpha))
            p = p * np.outer(factor, factor)
            added = float(p[0, 0] - predicted[0, 0])
            m.forgotten += math.log(alpha)
        s = max(float(p[0, 0]) + m.spread, e * e / (m.scale * self.outlier**2))
        r = s - float(p[0, 0])
        gain = p[:, 0] / s
        state, posterior = joseph(state, p, e, s, r)
        m.seen += 1.0
        weight = husa_weight(m.seen, self.noise_forgetting)
        if self.process_mean_most > 0.0:
            most = self.process_mean_most * np.sqrt(np.diag(context.start_covariance) * m.scale)
            before = np.zeros_like(state) if m.drift is None else m.drift
            m.drift = np.clip((1.0 - weight) * before + weight * (state - mean), -most, most)
        if self.process_noise_most > 0.0:
            moved = gain * (e / math.sqrt(m.scale))
            now = np.zeros_like(p) if m.wander is None else m.wander
            now = (1.0 - weight) * now + weight * (np.outer(moved, moved) + posterior - carried)
            m.wander = bounded_covariance(now, context.start_covariance, 0.0, self.process_noise_most)
        m.mean += weight * (float(innovation[0]) - m.mean)
        deviation = innovation - m.mean
        m.spread = float(sage_husa_noise(noise, deviation, p[:1, :1], weight, one, self.noise_least, self.noise_most)[0, 0])
        return Update(state, posterior, s * m.scale, alpha, added * m.scale, r)

    def compiled_settings(self) -> dict[str, float]:
        return {}
