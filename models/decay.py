"""Maximum-likelihood fit of the base law T(t) = T_inf + D exp(-rate t), its intervals and its limit.

The fit is a variable projection over the rate (:func:`models._lump_numpy.fit_decay`); intervals are those of the profile
likelihood, because in a short record the steady state is far from Gaussian: its upper side may be ten times its lower.
Times are minutes, temperatures degC, rates 1/min.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from . import kernel
from .kernel import Array

#: The rise is counted as done when 95 % of it is: ln 20 time constants.
LOG_TWENTY = math.log(20.0)
#: Below this many time constants in the record the curve is a straight line to any reader.
LEAST_CURVATURE = 1e-3
GRID_READINGS = 64


@dataclass(frozen=True)
class Interval:
    """A 95 % interval; a side that the record does not bound is None."""

    low: float | None
    high: float | None


@dataclass(frozen=True)
class DecayFit:
    """Fit of T(t) = level + slope (growth(rate, t - t0) - phi_mean); see :func:`fit_decay`.

    rss is the weighted residual sum of squares [K^2], n the number of readings used, span the time they cover [min].
    """

    t0: float
    span: float
    rate: float
    slope: float
    level: float
    phi_mean: float
    psi_mean: float
    weight: float
    phi_phi: float
    phi_psi: float
    psi_psi: float
    rss: float
    n: int
    rate_high: float

    @property
    def dof(self) -> int:
        return self.n - 3

    @property
    def noise_variance(self) -> float:
        """Variance of a reading of weight 1 [K^2]; nan without a spare reading."""
        return self.rss / self.dof if self.dof > 0 else math.nan

    @property
    def steady_state(self) -> float:
        """T_inf [degC]; infinite where no curvature is seen."""
        return self.level + self.slope * (1.0 / self.rate - self.phi_mean) if self.rate > 0.0 else math.inf

    @property
    def rate_low(self) -> float:
        return LEAST_CURVATURE / self.span

    def predict(self, time: Array) -> Array:
        """Temperatures (n,) at times (n,) [min]."""
        return self.level + self.slope * (kernel.growth(self.rate, time - self.t0) - self.phi_mean)

    def _rate_covariance(self) -> tuple[float, float, float]:
        """Variance of slope, covariance, variance of rate, per unit of the noise variance."""
        a, b, c = self.phi_phi, self.slope * self.phi_psi, self.slope**2 * self.psi_psi
        determinant = a * c - b * b
        if not determinant > 0.0:
            return (1.0 / a if a > 0.0 else math.inf), 0.0, math.inf
        return c / determinant, -b / determinant, a / determinant

    @property
    def rate_variance(self) -> float:
        return self._rate_covariance()[2]

    def _steady_state_gradient(self) -> tuple[float, float]:
        return 1.0 / self.rate - self.phi_mean, self.slope * (-1.0 / self.rate**2 - self.psi_mean)

    @property
    def steady_state_limit(self) -> float:
        """Cramer-Rao bound of the steady state's standard deviation, per unit of the noise's, at the estimate."""
        if self.rate <= 0.0:
            return math.inf
        ss, sr, rr = self._rate_covariance()
        by_slope, by_rate = self._steady_state_gradient()
        if math.isinf(rr):
            return math.inf
        variance = 1.0 / self.weight + by_slope**2 * ss + 2 * by_slope * by_rate * sr + by_rate**2 * rr
        return math.sqrt(max(variance, 0.0))

    @property
    def steady_state_rate_correlation(self) -> float:
        ss, sr, rr = self._rate_covariance()
        by_slope, by_rate = self._steady_state_gradient()
        deviation = self.steady_state_limit
        if not (math.isfinite(deviation) and deviation > 0.0 and rr > 0.0):
            return 0.0
        return (by_slope * sr + by_rate * rr) / (deviation * math.sqrt(rr))

    def state(self, time: float) -> tuple[Array, Array]:
        """State (temperature, slope, rate) (3,) at a time [min] and its covariance (3, 3) per unit of the noise variance."""
        dt = time - self.t0
        phi, psi = float(kernel.growth(self.rate, dt)), float(kernel.growth_slope(self.rate, dt))
        decay = math.exp(min(-self.rate * dt, 60.0))
        ss, sr, rr = self._rate_covariance()
        inner = np.array([[1.0 / self.weight, 0.0, 0.0], [0.0, ss, sr], [0.0, sr, rr]])
        jacobian = np.array(
            [
                [1.0, phi - self.phi_mean, self.slope * (psi - self.psi_mean)],
                [0.0, decay, -self.slope * dt * decay],
                [0.0, 0.0, 1.0],
            ]
        )
        mean = np.array([self.level + self.slope * (phi - self.phi_mean), self.slope * decay, self.rate])
        return mean, jacobian @ inner @ jacobian.T


def _thinned(time: Array, reading: Array, weight: Array) -> tuple[Array, Array, Array]:
    """At most GRID_READINGS weighted means of neighbours: enough to tell where a long record's rate lies."""
    if len(time) <= GRID_READINGS:
        return time, reading, weight
    edges = np.linspace(0, len(time), GRID_READINGS + 1).astype(int)[:-1]
    total = np.add.reduceat(weight, edges)
    safe = np.where(total > 0.0, total, 1.0)
    return np.add.reduceat(time * weight, edges) / safe, np.add.reduceat(reading * weight, edges) / safe, total


def fit_decay(time: Array, reading: Array, weight: Array | None = None, signed: bool = False) -> DecayFit:
    """Fit the base law.

    Parameters: time, reading, weight (n,), weights per reading relative to one of full weight, 0 leaves out; `signed`
    allows a rate below zero (a curve that bends away), for telling how well a short stretch fixes the rate.
    The rate is searched over the whole range that the record can show, so no start value is needed.

    Raises
    ------
    ValueError: fewer than three readings of positive weight, or all at one time.
    """
    weight = np.ones(len(time)) if weight is None else weight
    use = weight > 0.0
    times = time[use]
    if len(times) < 3 or not times[-1] > times[0]:
        raise ValueError(f"a fit needs three readings at different times, got {len(times)}")
    span = float(times[-1] - times[0])
    spacing = span / (len(times) - 1)
    low, high = (-3.0 / span if signed else LEAST_CURVATURE / span), 5.0 / spacing
    grid = np.geomspace(0.05 / span, 0.5 * high, 20)
    if signed:
        grid = np.concatenate([[-1.0 / span, 1e-6 / span], grid])
    thin = _thinned(time[use], reading[use], weight[use])
    t0 = float(time[0])
    first = kernel.fit_decay(*thin, grid, low, high)
    values = kernel.fit_decay(time, reading, weight, np.array([first[0]]), low, high)
    return DecayFit(t0, span, *values[:10], n=int(values[10]), rate_high=high)  # type: ignore[misc]


def profile_intervals(
    fit: DecayFit, time: Array, reading: Array, weight: Array | None = None, widening: float = 1.0
) -> tuple[Interval, Interval]:
    """95 % likelihood intervals of the steady state [degC] and of the rate [1/min].

    The limit of the residual sum of squares is that of Student's t for one parameter, with the noise estimated from the
    same readings; `widening` multiplies the noise variance where neighbouring residuals are not independent.
    A side that the record does not bound is None.
    """
    if fit.dof < 1:
        return Interval(None, None), Interval(None, None)
    weight = np.ones(len(time)) if weight is None else weight
    limit = fit.rss + fit.noise_variance * widening * float(stdtrit(fit.dof, 0.975)) ** 2
    if not limit > fit.rss:  # a noiseless record: the estimate is exact
        return Interval(fit.steady_state, fit.steady_state), Interval(fit.rate, fit.rate)
    stride = 2.0 * math.sqrt(min(fit.rate_variance * fit.noise_variance * widening, fit.rate_high**2))
    rate_low, rate_high, low, high = kernel.profile_decay(
        np.ascontiguousarray(time),
        np.ascontiguousarray(reading),
        weight,
        fit.rate,
        fit.rss,
        limit,
        fit.rate_low,
        fit.rate_high,
        fit.steady_state_rate_correlation,
        max(stride, 0.01 * fit.rate),
    )
    closed = not math.isnan(rate_low)
    rising = fit.slope >= 0.0
    return (
        Interval(low if closed or rising else None, high if closed or not rising else None),
        Interval(rate_low if closed else None, None if math.isnan(rate_high) else rate_high),
    )
