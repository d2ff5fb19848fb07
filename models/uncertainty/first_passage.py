"""How long until a level is reached: first passages of a Wiener process with drift, and the time a warming machine still needs.

Source: Huang, Liu, Gong, "Multi-phase residual life prediction of engines based on Wiener process", J. Beijing Univ. Aeronaut.
Astronaut. 44 (2018) 1081-1087; equation numbers are that paper's, formulas are corrected where its print is not right.

The two halves are one idea. The logarithm of what a warming machine still lacks falls in a straight line, with the rate as
its drift, and the band is the level it has to reach. A lump is not shaken on its way, so its diffusion is zero
and the whole spread of the time comes from the second source in the paper: parameters known as distributions only.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.kernel import Array

#: Points of a density's numerical integral, evenly spaced in the logarithm of time.
_POINTS = 4001
#: Deviations of the rate over which its distribution is integrated: a spacing of 0.02 moves no quantile by more than 0.01 of one.
_NODES = np.linspace(-5.0, 5.0, 501)
_WEIGHT = np.exp(-0.5 * _NODES**2) / np.exp(-0.5 * _NODES**2).sum()
#: Lower side, middle and upper side of a 95 % interval.
_SIDES = np.array([0.025, 0.5, 0.975])


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


@dataclass(frozen=True)
class Pace:
    """The rate is `factor` times that of the state for `duration` [min]: a spindle speed, a coolant flow."""

    duration: float
    factor: float


@dataclass(frozen=True)
class RunBack:
    """The rise began `elapsed` [min] before the state, on the state's own curve: where it began is as sure as the state is."""

    elapsed: float


@dataclass(frozen=True)
class TimeToGo:
    """95 % interval and median of a time [min]; None where the probability is spent on 'never'."""

    low: float | None
    median: float | None
    high: float | None


def clock_time(own: float, paces: Sequence[Pace]) -> float | None:
    """Minutes on the clock that make `own` minutes at the state's own rate; None where they are never made."""
    clock, factor = 0.0, 1.0
    for i, pace in enumerate(paces):
        factor = pace.factor
        made = pace.duration * factor if i < len(paces) - 1 else math.inf
        if own <= made:
            break
        clock, own = clock + pace.duration, own - made
    if own == 0.0:
        return clock
    return clock + own / factor if factor > 0.0 and math.isfinite(own) else None


def time_to_go(
    state: Array,
    covariance: Array,
    initial: float | RunBack,
    initial_noise: float = 0.0,
    band: float = 0.05,
    paces: Sequence[Pace] = (),
    quantile: float = 1.96,
) -> TimeToGo:
    """Minutes from the state's time until the machine is for good within `band` of the whole rise around its steady state.

    state (3,) is (temperature degC, slope K/min, rate 1/min), covariance (3, 3) its own [K^2 and so on]. initial is where the rise
    began: a temperature [degC] that does not come from the state or its readings, initial_noise [K] its standard deviation; or
    a RunBack where one curve holds from the first reading on, as for a likelihood. A temperature that was run back, but
    is given as known, errs together with the state, and nobody knows: 120 min into a rise with a time constant of 65 min the
    interval then holds 93.6 % where it says 95. paces: the last one lasts; none is the state's own rate all along.
    quantile is that of the interval's half-width, 1.96 for 95 %, more where the noise comes from few readings.

    Meant is the curve, not the noisy readings about it: however narrow the noise, by chance some later reading leaves the
    band again, so that 'for good' would be never, and a wide noise would delay a machine that is warm. The curve
    approaches without turning, so that the first passage is the last. The sensor's noise counts in the covariance.

    The distribution is exact for a Gaussian state. With a RunBack the share left falls as exp(-rate t) from the start, so that the
    time is log(1 / band) / rate - elapsed whatever temperature and slope are. Else, given the rate, the band is a linear
    condition on temperature and slope, which leaves one integral over the rate. No draws, so no scatter from seed to seed: a
    side from 400 draws scatters by a thirtieth of the interval's width. 0 where the curve is in already; None where
    a rate of zero or less takes that share.

    Raises
    ------
    ValueError: band not within (0, 1), a pace of no or endless duration, or with a factor below zero.
    """
    if not 0.0 < band < 1.0:
        raise ValueError("band is a share of the rise, between 0 and 1")
    if any(not 0.0 < p.duration < math.inf or not 0.0 <= p.factor < math.inf for p in paces):
        raise ValueError("a pace needs a finite duration above zero and a finite factor of zero or more")
    if not (np.isfinite(state).all() and np.isfinite(covariance).all()):
        return TimeToGo(None, None, None)
    if isinstance(initial, RunBack):
        own = _run_back_quantiles(state, covariance, initial.elapsed, quantile, band)
    else:
        own = _approach(state, covariance, initial, initial_noise, quantile / 1.96).quantiles(band)
    low, median, high = (clock_time(v, paces) for v in own)
    return TimeToGo(low, median, high)


def _run_back_quantiles(state: Array, covariance: Array, elapsed: float, quantile: float, band: float) -> list[float]:
    """Times (3,) of the interval's low side, middle and high side; inf where the rate is not above zero."""
    spread = math.sqrt(max(float(covariance[2, 2]), 0.0))
    rates = [float(state[2]) + side * quantile * spread for side in (1.0, 0.0, -1.0)]
    return [max(-math.log(band) / rate - elapsed, 0.0) if rate > 0.0 else math.inf for rate in rates]


@dataclass(frozen=True)
class _Approach:
    """Temperature above the start and slope (2, n) expected at each rate (n,), and their covariance (2, 2) at any."""

    rate: Array
    mean: Array
    covariance: Array

    def inside(self, time: Array, band: float) -> Array:
        """Probability (m,) that the curve is within the band by times (m,) [min] at the state's own rate."""
        from scipy.special import ndtr

        settles = self.rate > 0.0
        b = np.where(settles, self.rate, 1.0)
        way = np.sign(self.mean[0] + self.mean[1] / b)  # a rise or a fall
        left = np.exp(-b * time[:, None]) / b
        within = []
        for side in (1.0, -1.0):
            # Short of the band's near edge, or beyond its far one: side left slope <= band |rise|, linear in temperature and slope.
            by_temperature = way * band
            by_slope = way * band / b - side * way * left
            centre = by_temperature * self.mean[0] + by_slope * self.mean[1]
            (tt, ts), (_, ss) = self.covariance
            spread = np.sqrt(np.maximum(by_temperature**2 * tt + 2.0 * by_temperature * by_slope * ts + by_slope**2 * ss, 1e-300))
            within.append(ndtr(centre / spread))
        both = np.maximum(within[0] + within[1] - 1.0, 0.0)
        result: Array = np.where(settles, both, 0.0) @ _WEIGHT
        return result

    def quantiles(self, band: float) -> list[float]:
        """Times (3,) of the interval's low side, middle and high side; inf where the curve does not get there."""
        scale = 1.0 / float(np.abs(self.rate).max())
        # Bisection of a time that may be anywhere up to infinity: on time / (time + scale).
        low, high = np.zeros(3), np.ones(3)
        for _ in range(36):
            middle = 0.5 * (low + high)
            reached = self.inside(scale * middle / (1.0 - middle), band) >= _SIDES
            low, high = np.where(reached, low, middle), np.where(reached, middle, high)
        time = scale * high / np.maximum(1.0 - high, 1e-12)
        already = self.inside(np.zeros(1), band)[0] >= _SIDES
        ever = self.inside(np.array([math.inf]), band)[0] > _SIDES
        return [float(v) for v in np.where(already, 0.0, np.where(ever & (high < 1.0 - 1e-9), time, math.inf))]


def _approach(state: Array, covariance: Array, initial: float, initial_noise: float, widening: float) -> _Approach:
    variance = float(covariance[2, 2])
    along = covariance[:2, 2] / variance if variance > 0.0 else np.zeros(2)
    off = widening * math.sqrt(max(variance, 0.0)) * _NODES
    rest = widening**2 * (covariance[:2, :2] - np.outer(along, covariance[2, :2]))
    rest = rest + np.diag([initial_noise**2, 0.0])
    return _Approach(state[2] + off, np.array([[state[0] - initial], [state[1]]]) + along[:, None] * off, rest)
