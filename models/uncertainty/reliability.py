"""The probability that an error exceeds a limit: by its nearest design points (first order) and by counting (Monte Carlo).

The inputs are independent standard normal numbers, the error is any function of them or a :class:`~.chaos.Chaos` fitted to
one. |error| > limit is two events, error > limit and error < -limit, which exclude one another: their probabilities add up.
Source: Zhang et al. (see :mod:`~.chaos`), equations (37)-(39), tables 8 and 9; Hasofer and Lind (1974), Rackwitz and
Fiessler (1978); the step is shortened as by Zhang and Der Kiureghian (1995), without which the iteration may run in circles.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..core.kernel import Array
from ..core.tails import normal_tail
from .chaos import Chaos

#: Errors (n,) of standard normal inputs (n, d).
Surface = Callable[[Array], Array]
#: No design point is looked for further from the centre: beyond it lies a probability of 6e-16.
FURTHEST = 8.0
#: Iterations of one search, and halvings of one step.
STEPS, HALVINGS = 100, 12
#: Two design points closer than this are one.
SAME = 0.3
#: A further design point counts where its probability is more than this share of the nearest one's.
RIVAL = 0.1
#: Step of the differences that give the slope of a function [standard deviations].
DIFFERENCE = 1e-4
#: Errors computed at once in a Monte Carlo run.
BATCH = 50_000


@dataclass(frozen=True)
class DesignPoint:
    """The most probable inputs (d,) at which a limit is reached, and the reliability index at each iteration.

    The last index is that of the point: its distance from the centre, negative where the centre itself exceeds the limit.
    """

    inputs: Array
    path: tuple[float, ...]

    @property
    def distance(self) -> float:
        """Reliability index beta, equation (38)."""
        return self.path[-1]

    @property
    def probability(self) -> float:
        """Probability beyond the plane through the point: exact where the error is linear in the inputs."""
        return float(normal_tail(self.distance))


@dataclass(frozen=True)
class Side:
    """One event, error > limit or error < -limit: design points, nearest first; was a point found at all that exceeds it?"""

    points: tuple[DesignPoint, ...]
    reached: bool

    @property
    def probability(self) -> float:
        """Of the nearest design point; 0 where the search met no error beyond the limit."""
        return self.points[0].probability if self.points else 0.0

    @property
    def doubt(self) -> str:
        """Why the probability must not be trusted, or nothing."""
        if not self.points:
            return "the limit is exceeded, but the search for the nearest point did not settle" if self.reached else ""
        rivals = sum(p.probability > RIVAL * self.probability for p in self.points[1:])
        return f"{rivals + 1} points are about as near, of which one is counted: count by Monte Carlo" if rivals else ""


@dataclass(frozen=True)
class FirstOrder:
    """Both sides of |error| > limit."""

    above: Side
    below: Side

    @property
    def probability(self) -> float:
        """That |error| exceeds the limit: the sum of both sides, for no error is on both; at most 1, as each is approximate."""
        return min(1.0, self.above.probability + self.below.probability)

    @property
    def doubt(self) -> str:
        """Why the probability must not be trusted, or nothing. A curved limit is not seen from here: compare with Monte Carlo."""
        sides = (("above the limit", self.above.doubt), ("below minus the limit", self.below.doubt))
        return "; ".join(f"{name}: {why}" for name, why in sides if why)


@dataclass(frozen=True)
class Counted:
    """A probability counted by Monte Carlo, and the bounds of its exact binomial confidence interval."""

    failures: int
    runs: int
    low: float
    high: float

    @property
    def probability(self) -> float:
        """Share of the runs that failed."""
        return self.failures / self.runs


def first_order(error: Surface | Chaos, limit: float, dimension: int | None = None) -> FirstOrder:
    """Probability that |error| > limit by the first-order reliability method, searched from the centre and along every axis.

    A function needs its number of inputs as `dimension`; its slopes are central differences, so each iteration costs
    2 d + 1 runs, of 2 (2 d + 1) searches: for a costly model fit a Chaos first. Design points that none of the searches
    runs into stay unseen.

    Raises ValueError for a limit that is not positive or a function without its number of inputs.
    """
    if not 0.0 < limit < math.inf:
        raise ValueError(f"a limit must be positive, not {limit}")
    limit = float(limit)
    inputs = error.dimension if isinstance(error, Chaos) else dimension
    if inputs is None or inputs < 1:
        raise ValueError("the number of inputs of the error function is needed")
    return FirstOrder(_side(error, limit, inputs, 1.0), _side(error, limit, inputs, -1.0))


def _side(error: Surface | Chaos, limit: float, dimension: int, sign: float) -> Side:
    axes = np.eye(dimension)
    found: list[DesignPoint] = []
    reached = False
    for start in np.concatenate([np.zeros((1, dimension)), axes, -axes]):
        point, met = _search(error, limit, start, sign)
        reached |= met
        if point and all(float(np.linalg.norm(point.inputs - p.inputs)) > SAME for p in found):
            found.append(point)
    return Side(tuple(sorted(found, key=lambda p: float(np.linalg.norm(p.inputs)))), reached)


def _search(error: Surface | Chaos, limit: float, start: Array, sign: float) -> tuple[DesignPoint | None, bool]:
    """The design point that the iteration (38), (39) settles on from a start (d,), and whether it met an error beyond the limit."""
    u, path, met = start, [], False
    for _ in range(STEPS):
        margin, slope = limit - sign * _at(error, u), -sign * _slope(error, u)
        met |= margin <= 0.0
        steepness = float(np.linalg.norm(slope))
        if not steepness > 1e-12 * limit:  # flat: no direction leads on
            return None, met
        alpha = -slope / steepness
        path.append(float(alpha @ u) + margin / steepness)
        target = alpha * min(max(path[-1], -FURTHEST), FURTHEST)
        if float(np.linalg.norm(target - u)) < 1e-6 and abs(margin) < 1e-6 * limit:
            return DesignPoint(u, tuple(path)), met
        u = _shortened(error, limit, sign, u, target, margin, steepness)
    return None, met


def _shortened(
    error: Surface | Chaos, limit: float, sign: float, u: Array, target: Array, margin: float, steepness: float
) -> Array:
    """The point (d,) on the way to the target that is better, as distance and misfit of the limit weigh together."""
    weight = 2.0 * max(float(np.linalg.norm(u)) / steepness, 0.5 * float(target @ target) / max(abs(margin), 1e-12 * limit))
    now = 0.5 * float(u @ u) + weight * abs(margin)
    share = 1.0
    for _ in range(HALVINGS):
        after = u + share * (target - u)
        merit = 0.5 * float(after @ after) + weight * abs(limit - sign * _at(error, after))
        if merit <= now:
            return after
        share *= 0.5
    return u + share * (target - u)


def _at(error: Surface | Chaos, u: Array) -> float:
    return float(error(u[None, :])[0])


def _slope(error: Surface | Chaos, u: Array) -> Array:
    if isinstance(error, Chaos):
        return np.asarray(error.gradient(u[None, :])[0])
    steps = DIFFERENCE * np.eye(len(u))
    ends = np.asarray(error(np.concatenate([u + steps, u - steps])))
    return np.asarray((ends[: len(u)] - ends[len(u) :]) / (2.0 * DIFFERENCE))


def monte_carlo(
    error: Surface | Chaos, limit: float, dimension: int, runs: int, seed: int = 0, confidence: float = 0.95
) -> Counted:
    """Probability that |error| > limit, counted over random runs. On a Chaos this tells its curvature, not its own misfit.

    Raises ValueError for a limit that is not positive, no runs, a confidence outside (0, 1) or an error that is not finite.
    """
    if not 0.0 < limit < math.inf or runs < 1:
        raise ValueError(f"a positive limit and at least one run are needed, not {limit} and {runs}")
    rng = np.random.default_rng(seed)
    failures, left = 0, runs
    while left:
        count = min(left, BATCH)
        value = np.asarray(error(rng.standard_normal((count, dimension))))
        if not np.isfinite(value).all():
            raise ValueError("an error is not finite")
        failures += int((np.abs(value) > limit).sum())
        left -= count
    return Counted(failures, runs, *binomial_interval(failures, runs, confidence))


def binomial_interval(failures: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Bounds of the probability of a failure (Clopper and Pearson), of which so many were seen in so many runs.

    Raises ValueError for failures outside 0..runs, no runs, or a confidence outside (0, 1).
    """
    if runs < 1 or not 0 <= failures <= runs or not 0.0 < confidence < 1.0:
        raise ValueError(f"no interval for {failures} failures in {runs} runs at confidence {confidence}")
    from scipy.special import betaincinv  # at the first use: it takes long to load

    half = (1.0 - confidence) / 2.0
    low = float(betaincinv(failures, runs - failures + 1, half)) if failures else 0.0
    high = float(betaincinv(failures + 1, runs - failures, 1.0 - half)) if failures < runs else 1.0
    return low, high
