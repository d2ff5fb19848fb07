"""Maximum-likelihood fit of the base law T(t) = T_inf + D exp(-rate t), its intervals and its limit.

The fit is a variable projection over the rate (`core/_lump_numpy.py`); intervals are those of the profile
likelihood, because in a short record the steady state is far from Gaussian: its upper side may be ten times its lower.
Times are minutes, temperatures degC, rates 1/min.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .core import kernel
from .core.kernel import Array, FitMoments
from .core.tails import t_quantile

#: The rise is counted as done when 95 % of it is: ln 20 time constants.
LOG_TWENTY = math.log(20.0)


#: A filter may start once the product of rate and time so far is known to this standard deviation: from there on the step
#: is linear enough that sigma points lose nothing (docs/architecture.md has the trial).
SETTLED = 0.12
FEWEST_READINGS = 10
GROWTH = 1.25
OUTLIER = 6.0


@dataclass(frozen=True)
class Interval:
    """A 95 % interval; a side that the record does not bound is None."""

    low: float | None
    high: float | None

    def around(self, estimate: float) -> "Interval":
        """The interval, stretched where it must be to hold the estimate."""
        return Interval(
            None if self.low is None else min(self.low, estimate), None if self.high is None else max(self.high, estimate)
        )


@dataclass(frozen=True)
class DecayFit(FitMoments):
    """Fit of T(t) = level + slope (growth(rate, t - t0) - phi_mean); see :func:`fit_decay`.

    rss is the weighted residual sum of squares [K^2], n the number of readings used, span the time they cover [min].
    """

    n: int
    span: float
    rate_low: float
    rate_high: float
    t0: float

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

    def predict(self, time: Array) -> Array:
        """Temperatures (n,) at times (n,) [min]."""
        return self.level + self.slope * (kernel.growth(self.rate, time - self.t0) - self.phi_mean)

    def residual_and_tangent(self, time: Array, reading: Array) -> tuple[Array, Array]:
        """Reading minus model (n,), and a basis (n, 3) of the directions in which the fit can move."""
        dt = time - self.t0
        decay = np.exp(-self.rate * dt)
        model = self.level + self.slope * ((1.0 - decay) / self.rate - self.phi_mean)
        tangent = np.empty((len(time), 3))
        tangent[:, 0] = 1.0
        tangent[:, 1] = decay
        tangent[:, 2] = dt * decay
        return reading - model, tangent

    @property
    def steady_state_limit(self) -> float:
        """Cramer-Rao bound of the steady state's standard deviation, per unit of the noise's, at the estimate."""
        if self.rate <= 0.0 or math.isinf(self.rate_covariance()[2]):
            return math.inf
        return math.sqrt(max(self.steady_variance(), 0.0))

    def state(self, time: float) -> tuple[Array, Array]:
        """State (temperature, slope, rate) (3,) at a time [min] and its covariance (3, 3) per unit of the noise variance."""
        dt = time - self.t0
        phi, psi, decay = _growths(self.rate, dt)
        ss, sr, rr = self.rate_covariance()
        # (level, slope, rate) carried to the state: the level is independent of the other two.
        by_slope, by_rate = phi - self.phi_mean, self.slope * (psi - self.psi_mean)
        slope_by_rate = -self.slope * dt * decay
        tt = 1.0 / self.weight + by_slope**2 * ss + 2.0 * by_slope * by_rate * sr + by_rate**2 * rr
        ts = by_slope * decay * ss + (by_slope * slope_by_rate + by_rate * decay) * sr + by_rate * slope_by_rate * rr
        tr = by_slope * sr + by_rate * rr
        vv = decay**2 * ss + 2.0 * decay * slope_by_rate * sr + slope_by_rate**2 * rr
        vr = decay * sr + slope_by_rate * rr
        mean = np.array([self.level + self.slope * (phi - self.phi_mean), self.slope * decay, self.rate])
        return mean, np.array([[tt, ts, tr], [ts, vv, vr], [tr, vr, rr]])


def _growths(rate: float, dt: float) -> tuple[float, float, float]:
    """growth, its derivative by the rate, and exp(-rate dt), of plain numbers."""
    z = max(rate * dt, -60.0)
    decay = math.exp(-z)
    if abs(z) < 1e-3:
        return float(kernel.growth(rate, dt)), float(kernel.growth_slope(rate, dt)), decay
    phi = -math.expm1(-z) / rate
    return phi, (dt * decay - phi) / rate, decay


def told_fit(t0: float, values: Sequence[float]) -> DecayFit:
    """The fit that the kernel tells as a row of numbers, for times counted from t0."""
    rate, slope, level, phi_mean, psi_mean, weight, phi_phi, phi_psi, psi_psi, rss = values[:10]
    basis = phi_mean, psi_mean, weight, phi_phi, phi_psi, psi_psi
    return DecayFit(rate, slope, level, *basis, rss, int(values[10]), values[11], values[12], values[13], t0)


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
    t, y, w = (np.ascontiguousarray(a, dtype=float) for a in (time, reading, weight))
    return told_fit(float(time[0]), kernel.fit_decay(t, y, w, signed))


@dataclass(frozen=True)
class Likelihood:
    """Fit of the first readings of a record with its 95 % intervals, and the weights (n,) that it ended with."""

    fit: DecayFit
    steady_state: Interval
    rate: Interval
    weights: Array


def _intervals(fit: DecayFit, rate_low: float, rate_high: float, low: float, high: float) -> tuple[Interval, Interval]:
    closed, rising = not math.isnan(rate_low), fit.slope >= 0.0
    return (
        Interval(low if closed or rising else None, high if closed or not rising else None),
        Interval(rate_low if closed else None, None if math.isnan(rate_high) else rate_high),
    )


def start_rule(resolution: float, outlier: float = OUTLIER) -> kernel.StartRule:
    """How a filter is started on a record with the logger's step `resolution` [K]; see :meth:`models.lump.Lump.start`."""
    return resolution, SETTLED, FEWEST_READINGS, GROWTH, outlier


def _likelihood_table(
    time: Array,
    reading: Array,
    weight: Array,
    counts: Sequence[int] | NDArray[np.intp],
    first: int,
    resolution: float,
    outlier: float,
    wide: float = math.inf,
) -> Array:
    number = np.asarray(counts, dtype=np.intp)
    usable = np.concatenate([[0], np.cumsum(weight > 0.0)])[number]
    quantiles = t_quantile(np.maximum(usable - 3, 1))
    out = np.empty((len(number), 18))
    arrays = np.ascontiguousarray(time), np.ascontiguousarray(reading), weight, number
    kernel.likelihoods(*arrays, quantiles, first, start_rule(resolution, outlier), wide, out)
    return out


def likelihood(
    time: Array, reading: Array, weight: Array, resolution: float = 0.0, first: int = 0, outlier: float = OUTLIER
) -> Likelihood | None:
    """Maximum likelihood of all readings with profile intervals; None where there is nothing to fit.

    weight (n,) as in :func:`fit_decay`; readings `outlier` deviations outside the fit are left out of it (inf: none), and with no
    more than `first` readings the weights are those of a start. The limit of the residual sum of squares is that of Student's
    t for one parameter, the noise being estimated from the same readings.
    """
    weight = np.array(weight, dtype=float)
    values = _likelihood_table(time, reading, weight, [len(time)], first, resolution, outlier)[0].tolist()
    if math.isnan(values[0]):
        return None
    fit = told_fit(float(time[0]), values)
    if fit.dof < 1:
        steady, rates = Interval(None, None), Interval(None, None)
    elif math.isnan(values[16]):  # no noise at all: the estimate is exact
        steady, rates = Interval(fit.steady_state, fit.steady_state), Interval(fit.rate, fit.rate)
    else:
        steady, rates = _intervals(fit, *values[14:])
    return Likelihood(fit, steady, rates, weight)


def likelihood_sweep(
    time: Array,
    reading: Array,
    weight: Array,
    counts: Sequence[int] | NDArray[np.intp],
    first: int,
    resolution: float = 0.0,
    outlier: float = OUTLIER,
    narrow: float = math.inf,
) -> tuple[Array, Array, DecayFit | None]:
    """As :func:`likelihood` for several first stretches of one record, in one call.

    Returns the state (temperature, slope, rate) after each, (m, 3), nan where there is nothing to fit, the width [K] of
    the steady state's interval (m,), nan where a side is open, and the fit of the longest stretch. Only a width that may
    come near `narrow` is looked for on the likelihood; a far larger one is to first order, whatever its shape.
    """
    out = _likelihood_table(time, reading, np.array(weight, dtype=float), counts, first, resolution, outlier, 2.0 * narrow)
    rate, slope, level, phi_mean = out[:, :4].T
    since = time[np.asarray(counts) - 1] - time[0]
    temperature = level + slope * (kernel.growth(rate, since) - phi_mean)
    states = np.column_stack([temperature, slope * np.exp(-rate * since), rate])
    width = np.where(np.isnan(out[:, 14]), np.nan, out[:, 17] - out[:, 16])
    exact = (out[:, 10] > 3) & np.isnan(out[:, 16]) & np.isfinite(rate)
    longest = out[-1].tolist()
    fit = None if math.isnan(longest[0]) else told_fit(float(time[0]), longest)
    return states, np.where(exact, 0.0, width), fit


def widened_intervals(fit: DecayFit, time: Array, reading: Array, weight: Array, widening: float) -> tuple[Interval, Interval]:
    """Intervals of steady state [degC] and rate [1/min] with the noise variance times `widening`: for dependent residuals."""
    noise = fit.noise_variance * widening
    limit = fit.rss + noise * float(t_quantile(fit.dof)) ** 2
    bounds = kernel.profile_decay(np.ascontiguousarray(time), np.ascontiguousarray(reading), weight, fit.rate, limit)
    return _intervals(fit, *bounds)
