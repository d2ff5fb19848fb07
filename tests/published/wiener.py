"""First passages of a Wiener process with drift, through one phase or several: the paper's own problem, which no heat has.

Source: Huang, Liu, Gong, "Multi-phase residual life prediction of engines based on Wiener process", J. Beijing Univ. Aeronaut.
Astronaut. 44 (2018) 1081-1087; equation numbers are that paper's, formulas are corrected where its print is not right.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Points of a density's numerical integral, evenly spaced in the logarithm of time.
_POINTS = 4001


@dataclass(frozen=True)
class Passage:
    """First passage of X(t) = drift t**power + sqrt(variance) B(t) through `distance` > 0, equations (2), (7), (11).

    variance: of the diffusion per unit of time. drift_variance: the drift is normal with this variance, 0 where it is known.
    age: time that the phase has lasted already; distance and time count from then. A falling process is the
    mirror image: give distance and drift the other sign.

    With power 1 everything is exact. Else the density is the paper's approximation: the tangent to the drift's curve at
    the time of passage stands for the curve, its integral is not 1, and where it turns negative it is taken as 0.

    Raises
    ------
    ValueError: distance, variance or power not positive, age or drift_variance negative.
    """

    distance: float
    drift: float
    variance: float
    power: float = 1.0
    drift_variance: float = 0.0
    age: float = 0.0

    def __post_init__(self) -> None:
        if not min(self.distance, self.variance, self.power) > 0.0 or not min(self.drift_variance, self.age) >= 0.0:
            raise ValueError("distance, variance and power must be positive, age and drift_variance not negative")

    def pdf(self, time: Array) -> Array:
        """Density (n,) at times (n,) > 0, equation (7), averaged over the drift's distribution."""
        path = (time + self.age) ** self.power - self.age**self.power
        # What the tangent misses of the path: nothing where the drift is constant.
        bend = path - self.power * time * (time + self.age) ** (self.power - 1.0)
        spread = self.variance * time + self.drift_variance * path**2
        # The drift of those that arrive at this time is not that of all: its mean given X(time) = distance.
        drift = (self.drift * self.variance * time + self.drift_variance * path * self.distance) / spread
        height = np.exp(-((self.distance - self.drift * path) ** 2) / (2.0 * spread)) / np.sqrt(2.0 * math.pi * spread)
        density: Array = np.maximum(self.distance - drift * bend, 0.0) / time * height
        return density

    def cdf(self, time: Array) -> Array:
        """Probability (n,) of having arrived by times (n,) > 0: closed where power is 1, else the density's integral."""
        if self.power == 1.0:
            return self._straight_cdf(time)
        end = float(np.max(time))
        grid = np.geomspace(1e-9 * min(end, self.crossing), end, _POINTS)
        steps = np.diff(grid)
        density = self.pdf(grid)
        total = np.concatenate([[0.0], np.cumsum(0.5 * steps * (density[1:] + density[:-1]))])
        arrived: Array = np.minimum(np.interp(time, grid, total), 1.0)
        return arrived

    def _straight_cdf(self, time: Array) -> Array:
        from scipy.special import log_ndtr, ndtr

        w, v, q = self.distance, self.variance, self.drift_variance
        root = np.sqrt(q * time**2 + v * time)
        # exp of a large number times a tail: in logarithms, else neither survives.
        mirrored = 2.0 * self.drift * w / v + 2.0 * q * (w / v) ** 2
        tail = log_ndtr(-(2.0 * q * w * time / v + self.drift * time + w) / root)
        arrived: Array = ndtr((self.drift * time - w) / root) + np.exp(np.minimum(mirrored + tail, 0.0))
        return np.minimum(arrived, 1.0)

    def quantile(self, probability: float) -> float:
        """Time by which that share has arrived; inf where so many never do."""
        low, high = 0.0, self.crossing
        while self._arrived(high) < probability:
            low, high = high, 4.0 * high
            if high > 1e12 * self.crossing:
                return math.inf
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._arrived(middle) < probability else (low, middle)
        return 0.5 * (low + high)

    def _arrived(self, time: float) -> float:
        return float(self.cdf(np.array([time]))[0])

    @property
    def crossing(self) -> float:
        """Time of passage without noise, the paper's expectation (13): the mean where power is 1 and the drift is known.

        A drift away from the level never crosses it; the time that diffusion alone takes stands in.
        """
        if self.drift <= 0.0:
            return self.distance**2 / self.variance
        return float((self.distance / self.drift + self.age**self.power) ** (1.0 / self.power) - self.age)

    @property
    def mean(self) -> float:
        """Mean time of passage; inf with a random drift, which may point away, and with a drift slower than diffusion.

        Raises
        ------
        ValueError: a power between 1/2 and 1, or above: no closed form; ask for quantiles.
        """
        if self.drift_variance > 0.0 or self.drift <= 0.0 or self.power <= 0.5:
            return math.inf
        if self.power != 1.0:
            raise ValueError("the mean has a closed form with a constant drift only")
        return self.distance / self.drift


@dataclass(frozen=True)
class Belief:
    """Normal-gamma distribution (3) of a phase's drift u and precision w = 1 / variance: w ~ gamma(a, b), u ~ N(d, c / w)."""

    a: float
    b: float
    c: float
    d: float

    @property
    def drift(self) -> float:
        """Mean of the drift, (23)."""
        return self.d

    @property
    def variance(self) -> float:
        """Diffusion's variance per unit of time, (23): one over the mean of the precision."""
        return self.b / self.a

    def updated(self, time: Array, value: Array, power: float = 1.0) -> "Belief":
        """Belief after readings value (n + 1,) at times (n + 1,), both counted from the phase's start, (22)."""
        steps, moved, path = np.diff(time), np.diff(value), np.diff(time**power)
        # The print squares the path's increment in B, too; completing the square in u does not.
        twice_a = 1.0 / self.c + float(np.sum(path**2 / steps))
        b = self.d / self.c + float(np.sum(moved * path / steps))
        c = self.b + self.d**2 / (2.0 * self.c) + float(np.sum(moved**2 / (2.0 * steps)))
        return Belief(self.a + 0.5 * len(steps), c - b**2 / (2.0 * twice_a), 1.0 / twice_a, b / twice_a)

    def passage(self, distance: float, power: float = 1.0, age: float = 0.0) -> Passage:
        """First passage with the drift's normal distribution at the expected precision."""
        return Passage(distance, self.drift, self.variance, power, self.c * self.variance, age)


@dataclass(frozen=True)
class TotalPassage:
    """Distribution of a sum of passages on cells between edges (m + 1,) of equal width, probability mass (m,)."""

    edges: Array
    mass: Array

    def pdf(self, time: Array) -> Array:
        """Density (n,) at times (n,) within the horizon."""
        middle = 0.5 * (self.edges[1:] + self.edges[:-1])
        density: Array = np.interp(time, middle, self.mass / np.diff(self.edges), left=0.0)
        return density

    def cdf(self, time: Array) -> Array:
        """Probability (n,) of having arrived by times (n,) within the horizon."""
        arrived: Array = np.interp(time, self.edges, np.concatenate([[0.0], np.cumsum(self.mass)]))
        return arrived

    def quantile(self, probability: float) -> float:
        """Time by which that share has arrived; inf beyond the horizon."""
        total = np.cumsum(self.mass)
        if probability > total[-1]:
            return math.inf
        return float(np.interp(probability, np.concatenate([[0.0], total]), self.edges))

    @property
    def mean(self) -> float:
        """Mean time of those that arrive within the horizon."""
        return float(0.5 * (self.edges[1:] + self.edges[:-1]) @ self.mass / self.mass.sum())


def through_phases(phases: Sequence[Passage], horizon: float, cells: int = 4096) -> TotalPassage:
    """Time through phases that end at levels, T = sum of the single passages, (12), (14): densities convolved up to `horizon`.

    By the strong Markov property each phase starts anew at its level. The first may be under way (age > 0): (14).

    Raises
    ------
    ValueError: no phase.
    """
    if not phases:
        raise ValueError("at least one phase is needed")
    width = horizon / cells
    ends: Array = width * np.arange(1.0, cells + 1.0)
    # Differences of the distribution, not samples of the density: no mass is lost where a density is a narrow peak.
    mass = [np.diff(p.cdf(ends), prepend=0.0) for p in phases]
    length = 1 << (len(phases) * cells - 1).bit_length()
    spectrum = np.prod([np.fft.rfft(m, length) for m in mass], axis=0)
    total: Array = np.maximum(np.fft.irfft(spectrum, length)[:cells], 0.0)
    # A cell's mass acts at its middle: with each phase the sum of middles moves up by half a cell.
    edges: Array = width * (np.arange(cells + 1.0) + 0.5 * (len(phases) - 1))
    return TotalPassage(edges, total)
