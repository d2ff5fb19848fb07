"""How long until a level is reached: the time that a warming machine still needs.

The logarithm of what a warming machine still lacks falls in a straight line, with the rate as its drift, and the band is the level
it has to reach: a first passage, as in Huang, Liu, Gong, "Multi-phase residual life prediction of engines based on Wiener process",
J. Beijing Univ. Aeronaut. Astronaut. 44 (2018) 1081-1087. A lump is not shaken on its way, so the diffusion is zero and the whole
spread of the time comes from the second source in that paper: parameters known as distributions only. Its phases are the paces.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.kernel import Array

#: Deviations of the rate over which its distribution is integrated: a spacing of 0.02 moves no quantile by more than 0.01 of one.
_NODES = np.linspace(-5.0, 5.0, 501)
_WEIGHT = np.exp(-0.5 * _NODES**2) / np.exp(-0.5 * _NODES**2).sum()
#: Lower side, middle and upper side of a 95 % interval.
_SIDES = np.array([0.025, 0.5, 0.975])


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
