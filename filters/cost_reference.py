"""Cost-reference particle filters: particles judged by what they cost, so that no law of the noise need be known.

The pure functions take any state and any model; the two filters at the end put them behind the contract of
:class:`filters.base.Filter`. Equation numbers are those of Wang, Cao, Li & Huang 2018, J. Beijing Univ. Aeronaut.
Astronaut. 44(5), after Miguez, Bugallo & Djuric 2004.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import Array, Closing, Filter, Start, StateModel, Track, setting
from .fading import JUMP
from .loop import COLUMNS
from .moments import semidefinite_root

Step = Callable[[Array, float], Array]
Measure = Callable[[Array], Array]

#: Fixed, so that a filter repeats itself.
SEED = 20180505
#: Most that one reading counts in the running noise variance, in variances: an outlier one teaches little.
MOST_SURPRISE = 9.0
#: Least noise variance [K^2] that cost is counted in: readings without noise still have a scale.
LEAST_VARIANCE = 1e-12


@dataclass(frozen=True)
class Particles:
    """The cloud after one reading: states (P, n), cost (P,), spread (P,), the variance of the next displacement, equation (8)."""

    states: Array
    cost: Array
    spread: Array


@dataclass(frozen=True)
class Pricing:
    """How cost is counted and turned into weights: lambda of (5), q of (6), delta and beta of (7) and (10)."""

    forgetting: float = 0.95
    power: float = 1.0
    softness: float = 0.01
    sharpness: float = 2.0


def cost_increment(predicted: Array, reading: Array | float, power: float) -> Array:
    """||y - h(x)||^q (P,) of predicted readings (P,) or (P, m) against one reading, scalar or (m,): equation (5)."""
    difference = np.abs(np.asarray(reading) - predicted)
    norm: Array = difference if difference.ndim == 1 else np.sqrt((difference * difference).sum(axis=1))
    return norm if power == 1.0 else norm**power


def total_cost(cost: Array, increment: Array, forgetting: float) -> Array:
    """Cost (P,) with one reading's increment (P,) added to what is remembered: (5), and the risk (6) for a predicted increment."""
    result: Array = forgetting * cost + increment
    return result


def weights_from_cost(cost: Array, softness: float, sharpness: float) -> Array:
    """Weights (P,), summing to one, that fall with cost or risk (P,): equations (7) and (10).

    softness is in units of the cost: particles that differ by less weigh alike.
    """
    raw = (cost - cost.min() + softness) ** -sharpness
    result: Array = raw / raw.sum()
    return result


def select(weights: Array, rng: np.random.Generator) -> NDArray[np.intp]:
    """Indices (P,) of the particles drawn by weight (P,), by one uniform number (systematic resampling), in ascending order."""
    count = len(weights)
    places = (np.arange(count) + rng.random()) * (float(weights.sum()) / count)
    return np.minimum(np.searchsorted(np.cumsum(weights), places, side="right"), count - 1)


def displace(moved: Array, spread: Array, root: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """States (P, n) drawn around the moved ones, and their squared displacement (P,) per dimension: equation (8).

    root (n, n) is the lower factor of the covariance that spread (P,) is a multiple of; the paper's is the identity.
    """
    drawn = np.sqrt(spread)[:, None] * rng.standard_normal(moved.shape)
    return moved + drawn @ root.T, np.einsum("pi,pi->p", drawn, drawn) / moved.shape[1]


def next_spread(spread: Array, displaced: Array, kept: float) -> Array:
    """Spread (P,) after a displacement (P,), of which the share `kept` is the old one.

    kept = (k - 1) / k is equation (9), kept = gamma_k is equation (12). The expectation of the new spread is the old one:
    it learns only because particles that had to move further to meet the readings are those that are selected.
    """
    result: Array = kept * spread + (1.0 - kept) * displaced
    return result


def weighted_mean(weights: Array, states: Array) -> Array:
    """Estimate (n,) from weights (P,) and states (P, n): step 3."""
    result: Array = weights @ states
    return result


def weighted_covariance(weights: Array, states: Array) -> Array:
    """Covariance (n, n) of the cloud (P, n) under weights (P,)."""
    from_mean = states - weights @ states
    result: Array = (weights[:, None] * from_mean).T @ from_mean
    return result


def advance(
    particles: Particles,
    moved: Array,
    measure: Measure,
    reading: Array | float,
    kept: float,
    pricing: Pricing,
    root: Array,
    rng: np.random.Generator,
) -> tuple[Particles, Array]:
    """One reading: risk (6), selection (7), displacement (8), spread (9) or (12), cost (5); returns the cloud and weights (10).

    moved (P, n) are the particles' states carried to the time of the reading by the model.
    """
    risk = total_cost(particles.cost, cost_increment(measure(moved), reading, pricing.power), pricing.forgetting)
    chosen = select(weights_from_cost(risk, pricing.softness, pricing.sharpness), rng)
    states, displaced = displace(moved[chosen], particles.spread[chosen], root, rng)
    cost = total_cost(particles.cost[chosen], cost_increment(measure(states), reading, pricing.power), pricing.forgetting)
    spread = next_spread(particles.spread[chosen], displaced, kept)
    return Particles(states, cost, spread), weights_from_cost(cost, pricing.softness, pricing.sharpness)


def share_by_count(count: int) -> float:
    """Share (k - 1) / k of the old spread at the k-th reading: equation (9), by which the spread ends up fixed."""
    return (count - 1.0) / count


def agreement(innovation: Array) -> float:
    """How far innovations (M,) are white, in [0, 1]: half the mean square of their differences over their mean square.

    The ratio of von Neumann (1941) about nought: near 1 for noise of any size, near 0 where the innovations keep one
    sign, the model's error being large beside the noise. Fewer than three innovations say nothing: 1.
    """
    if len(innovation) < 3:
        return 1.0
    square = float(innovation @ innovation) / len(innovation)
    step = np.diff(innovation)
    return min(0.5 * float(step @ step) / len(step) / square, 1.0) if square > 0.0 else 1.0


def anew(covariance: Array, most: Array, innovation: float) -> Array:
    """Covariance (n, n) of a cloud drawn anew: JUMP times wider, no state wider than in `most` (n, n), and the reading is news.

    Equation (12) widens a cloud only by as much as its own particles already scatter, which after a jump is by nothing.
    """
    now = np.maximum(np.diag(covariance), 1e-300)
    factor = np.sqrt(np.clip(np.diag(most) / now, 1.0, JUMP))
    result: Array = covariance * np.outer(factor, factor)
    result[0, 0] += innovation * innovation
    return result


@dataclass(frozen=True)
class CostReference(Filter):
    """Particles with a cost each, equations (5)-(10): the spread of their displacement ends up fixed."""

    name = "crpf"
    summary = "cost-reference particle filter: needs no law of the noise"
    reference = "Miguez, Bugallo & Djuric 2004; equations (5)-(10) of doi:10.13700/j.bh.1001-5965.2017.0353"

    forgetting: float = setting(0.95, "lambda: share of the old cost kept at a reading (5)", 0.0, 0.999)
    power: float = setting(1.0, "q: exponent of the misfit in the cost (6)", 1.0, 4.0)
    softness: float = setting(0.5, "delta of (7), times (1 - lambda) / (2 beta): 0.5 suits q = 1, 1 suits q = 2", 1e-3, 1e3)
    sharpness: float = setting(2.0, "beta: exponent by which weights fall with cost (7)", 0.1, 20.0)
    spread: float = setting(0.15, "first displacement of a particle, in standard deviations of the cloud (8)", 1e-3, 2.0)
    least_spread: float = setting(0.05, "least displacement, in standard deviations of the cloud", 0.0, 2.0)
    particles: int = field(default=200, metadata={"meaning": "number of particles", "low": 20, "high": 100000})

    @property
    def closing(self) -> Closing:
        return "when consistent"

    def kept(self, count: int, innovations: list[float]) -> float:
        """Share of the old spread kept at the count-th reading; the innovations [K] so far, this reading's last."""
        return share_by_count(count)

    def gives_up(self, kept: float, innovations: list[float], dead_band: float) -> bool:
        """Whether the cloud is drawn anew: its model does not explain the innovations [K], whose mean is beyond a dead band [K]."""
        return False

    @property
    def pricing(self) -> Pricing:
        """Settings in units of the noise.

        A reading's cost acts at 1 / (1 - lambda) selections in a row, each worth about exp(-beta cost / delta). With delta =
        2 softness beta / (1 - lambda) they come to exp(-e^q / (2 softness)) in all: for q = 1 and a softness of 0.5 the law of
        Laplace, on which an outlier has little hold, for q = 2 and a softness of 1 that of Gauss. With much less the
        cloud falls in on the noise of the last readings.
        """
        softness = self.softness * 2.0 * self.sharpness / (1.0 - self.forgetting)
        return Pricing(self.forgetting, self.power, softness, self.sharpness)

    def track(self, model: StateModel, time: Array, reading: Array, resolution: float = 0.0) -> Track:
        """Start the model on the first readings, then filter the rest; see :class:`filters.base.Track`.

        Cost is counted in standard deviations of the noise and displacement in those of the cloud, so that settings fit any
        record. The covariance is that of the weighted cloud: it is no posterior, for the weights follow no likelihood.
        """
        start = model.start(time, reading, resolution)
        rng = np.random.default_rng(SEED)
        record = _Record(len(time), start)
        variance, seen, forgotten = max(start.noise_variance, LEAST_VARIANCE), start.dof, 0.0
        try:
            root = math.sqrt(variance) * semidefinite_root(start.covariance)
        except np.linalg.LinAlgError:
            return record.track(start, start.index + 1 if start.index + 1 < len(time) else None)
        cloud = self.draw(start.state, root, rng)
        weights = np.full(self.particles, 1.0 / self.particles)
        innovations: list[float] = []
        dead_band = max(0.5 * resolution, math.sqrt(LEAST_VARIANCE))
        for k in range(start.index + 1, len(time)):
            with np.errstate(all="ignore"):
                moved = model.step(cloud.states, float(time[k] - time[k - 1]))
                mean, covariance = weighted_mean(weights, moved), weighted_covariance(weights, moved)
            e = float(reading[k] - mean[0])
            if not (math.isfinite(e) and abs(e) <= 1e12 and np.isfinite(covariance).all()):
                return record.track(start, k)
            s, noise = float(covariance[0, 0]) + variance, math.sqrt(variance)
            innovations.append(e)
            kept, fading = self.kept(len(innovations), innovations), 1.0
            if self.gives_up(kept, innovations, dead_band):
                innovations.clear()
                fading, kept = JUMP, 1.0
                covariance = anew(covariance, start.covariance * variance, e)
            try:
                root = semidefinite_root(covariance)
            except np.linalg.LinAlgError:
                return record.track(start, k)
            if fading > 1.0:
                cloud = self.draw(mean, root, rng)
                moved = cloud.states
            measured = float(reading[k]) / noise
            cloud, weights = advance(cloud, moved, _sensor(noise), measured, kept, self.pricing, root, rng)
            cloud = Particles(cloud.states, cloud.cost, np.clip(cloud.spread, self.least_spread**2, 1.0))
            seen += 1.0
            if fading == 1.0:
                variance = max(variance + (min(e * e / s, MOST_SURPRISE) - 1.0) * variance / seen, LEAST_VARIANCE)
            forgotten += math.log(fading)
            record.write(k, weights, cloud.states, variance, e, s, fading, forgotten)
        return record.track(start, None)

    def draw(self, mean: Array, root: Array, rng: np.random.Generator) -> Particles:
        """A cloud of no cost around a mean (n,), with the lower factor (n, n) of its covariance: step 1."""
        states = mean + rng.standard_normal((self.particles, len(mean))) @ root.T
        return Particles(states, np.zeros(self.particles), np.full(self.particles, self.spread**2))


@dataclass(frozen=True)
class AdaptiveCostReference(CostReference):
    """The same with the adaptive spread of (12), which goes on following the readings however long the record.

    The share kept is :func:`agreement`, not the correlation of (11): over a window a settled record brings it to nought, and over
    the whole record, which a rise dominates, it stays at 1, so that nothing adapts.
    """

    name = "acrpf"
    summary = "adaptive cost-reference particle filter: the spread follows the innovations"
    reference = "Wang, Cao, Li & Huang 2018, doi:10.13700/j.bh.1001-5965.2017.0353, equations (5)-(12)"

    window: int = field(default=20, metadata={"meaning": "M: innovations judged together", "low": 5, "high": 1000})
    wake_threshold: float = setting(4.0, "standard deviations of the agreement at which the past is forgotten", 1.0, 100.0)

    def kept(self, count: int, innovations: list[float]) -> float:
        return agreement(np.array(innovations[-self.window :]))

    def gives_up(self, kept: float, innovations: list[float], dead_band: float) -> bool:
        # Of M white innovations the agreement is 1 with a standard deviation of about 1 / sqrt(M).
        judged = innovations[-self.window :]
        doubtful = kept < 1.0 - self.wake_threshold / math.sqrt(len(judged))
        # Rounding to the logger's step is no news of the physics, however long it lasts.
        return doubtful and abs(math.fsum(judged)) > dead_band * len(judged)


def _sensor(noise: float) -> Measure:
    """What the sensor reads of states (P, n), in standard deviations of its noise."""

    def measure(states: Array) -> Array:
        result: Array = states[:, 0] / noise
        return result

    return measure


class _Record:
    """The columns of a track while it is being written."""

    def __init__(self, count: int, start: Start) -> None:
        n, k = len(start.state), start.index
        self.state, self.covariance = np.full((count, n), np.nan), np.full((count, n, n), np.nan)
        self.columns = {name: np.full(count, np.nan) for name in COLUMNS}
        still = {"noise_variance": start.noise_variance, "fading": 1.0, "process_noise": 0.0, "noise_factor": 1.0, "forgotten": 0.0}
        for name, value in still.items():
            self.columns[name][: k + 1] = value
        self.columns["weight"][: k + 1] = start.weights
        self.columns["weight"][k] = 1.0
        self.columns["innovation"][k] = self.columns["innovation_variance"][k] = 0.0
        self.state[k], self.covariance[k] = start.state, start.covariance

    def write(
        self, k: int, weights: Array, states: Array, variance: float, e: float, s: float, fading: float, forgotten: float
    ) -> None:
        self.state[k] = weighted_mean(weights, states)
        self.covariance[k] = weighted_covariance(weights, states) / variance
        row = (variance, e, s, fading, 0.0, 1.0, 1.0, forgotten)
        for column, value in zip(self.columns.values(), row, strict=True):
            column[k] = value

    def track(self, start: Start, broken: int | None) -> Track:
        columns: dict[str, Any] = self.columns
        return Track(start.index, self.state, self.covariance, diverged_at=broken, **columns)
