"""Maximum-likelihood fit of the base law T(t) = T_inf + D exp(-rate t), its intervals and its limit.

The fit is a variable projection over the rate (`core/_lump_numpy.py`); intervals are those of the profile
likelihood, because in a short record the steady state is far from Gaussian: its upper side may be ten times its lower.
Times are minutes, temperatures degC, rates 1/min.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .core import kernel
from .core.kernel import Array, FitMoments, Fits
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
    """Fit of T(t) = level + slope (growth(rate, t - t0) - phi_mean), or of S records at once; see :func:`fit_decay`.

    Numbers, or arrays (S,): rss is the weighted residual sum of squares [K^2], n the number of readings used, span the time they
    cover [min], least and greatest the rates looked at.
    """

    n: Any
    span: Any
    least: Any
    greatest: Any
    t0: float

    @classmethod
    def from_table(cls, t0: float, table: Fits) -> "DecayFit":
        """The fit that the core tells as one record of FIT, or the fits of an array of them (S,), for times counted from t0."""
        values = {f.name: table[f.name] if table.ndim else float(table[f.name]) for f in fields(cls) if f.name != "t0"}
        return cls(**values, t0=t0)

    def one(self, i: int) -> "DecayFit":
        """The i-th of several fits."""
        return DecayFit(**{f.name: float(getattr(self, f.name)[i]) for f in fields(self) if f.name != "t0"}, t0=self.t0)

    def some(self, rows: NDArray[np.intp]) -> "DecayFit":
        """Those of several fits."""
        return DecayFit(**{f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "t0"}, t0=self.t0)

    def as_one_of_several(self) -> "DecayFit":
        """The same as several fits of which it is the only one."""
        return DecayFit(**{f.name: np.array([getattr(self, f.name)]) for f in fields(self) if f.name != "t0"}, t0=self.t0)

    @property
    def dof(self) -> Any:
        return self.n - 3

    @property
    def noise_variance(self) -> Any:
        """Variance of a reading of weight 1 [K^2]; nan without a spare reading."""
        with np.errstate(all="ignore"):
            return np.where(self.dof > 0, self.rss / np.maximum(self.dof, 1), np.nan)[()]

    @property
    def steady_state(self) -> Any:
        """T_inf [degC]; infinite where no curvature is seen."""
        with np.errstate(all="ignore"):
            return np.where(self.rate > 0.0, self.level + self.slope * (1.0 / np.asarray(self.rate) - self.phi_mean), np.inf)[()]

    def predict(self, time: Array) -> Array:
        """Temperatures (..., n) at times (n,) [min]."""
        level, slope, rate, mean = (np.asarray(v)[..., None] for v in (self.level, self.slope, self.rate, self.phi_mean))
        result: Array = level + slope * (kernel.growth(rate, time - self.t0) - mean)
        return result

    @property
    def steady_state_limit(self) -> Any:
        """Cramer-Rao bound of the steady state's standard deviation, per unit of the noise's, at the estimate."""
        with np.errstate(all="ignore"):
            unknown = (np.asarray(self.rate) <= 0.0) | np.isinf(self.rate_covariance()[2])
            return np.where(unknown, np.inf, np.sqrt(np.maximum(self.steady_variance(), 0.0)))[()]

    def state(self, time: Array | float) -> tuple[Array, Array]:
        """State (temperature, slope, rate) (..., 3) at a time [min], or a time each, and its covariance (..., 3, 3) per unit of the
        noise variance.
        """
        dt = np.asarray(time) - self.t0
        rate = np.asarray(self.rate)
        phi, psi = kernel.growth(rate, dt), kernel.growth_slope(rate, dt)
        decay = np.exp(-np.maximum(rate * dt, -60.0))
        ss, sr, rr = self.rate_covariance()
        # (level, slope, rate) carried to the state: the level is independent of the other two.
        by_slope, by_rate = phi - self.phi_mean, self.slope * (psi - self.psi_mean)
        slope_by_rate = -self.slope * dt * decay
        with np.errstate(invalid="ignore"):
            tt = 1.0 / self.weight + by_slope**2 * ss + 2.0 * by_slope * by_rate * sr + by_rate**2 * rr
            ts = by_slope * decay * ss + (by_slope * slope_by_rate + by_rate * decay) * sr + by_rate * slope_by_rate * rr
            tr = by_slope * sr + by_rate * rr
            vv = decay**2 * ss + 2.0 * decay * slope_by_rate * sr + slope_by_rate**2 * rr
            vr = decay * sr + slope_by_rate * rr
        mean = np.stack([self.level + self.slope * (phi - self.phi_mean), self.slope * decay, rate], axis=-1)
        rows = [np.stack(row, axis=-1) for row in ((tt, ts, tr), (ts, vv, vr), (tr, vr, np.broadcast_to(rr, np.shape(tt))))]
        return mean, np.stack(rows, axis=-2)


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
    out = np.empty(1, kernel.FIT)
    kernel.fit_decay(t, y, w, signed, out)
    return DecayFit.from_table(float(time[0]), out[0])


@dataclass(frozen=True)
class Likelihoods:
    """Fits of S records on one grid, 95 % bounds (S,), nan for a side that is open, and the weights (S, n) that they ended with.

    Where nothing could be fitted the rate is nan.
    """

    fit: DecayFit
    steady_low: Array
    steady_high: Array
    rate_low: Array
    rate_high: Array
    weights: Array


def interval(low: float, high: float) -> Interval:
    """From bounds that are nan where a side is open."""
    return Interval(None if math.isnan(low) else float(low), None if math.isnan(high) else float(high))


def _open_sides(slope: Array, bounds: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """(rate low, rate high, steady state low, high), nan where the contour of the likelihood does not close on that side."""
    rate_low, rate_high, low, high = bounds
    closed, rising = ~np.isnan(rate_low), np.asarray(slope) >= 0.0
    return rate_low, rate_high, np.where(closed | rising, low, np.nan), np.where(closed | ~rising, high, np.nan)


def start_rule(outlier: float = OUTLIER) -> kernel.StartRule:
    """How a filter is started on a record; see :meth:`models.lump.Lump.start`."""
    return SETTLED, FEWEST_READINGS, GROWTH, outlier


def _fits(
    time: Array,
    reading: Array,
    weight: Array,
    counts: NDArray[np.intp],
    first: NDArray[np.intp],
    resolution: Array,
    outlier: float,
    wide: float = math.inf,
) -> Fits:
    """Fits (S, m) of the first counts (m,) readings of records (S, n); a single count changes the weights (S, n)."""
    if len(counts) == 1:  # as nearly always, and then nothing needs to be summed up on the way
        usable = np.count_nonzero(weight[:, : counts[0]] > 0.0, axis=1)[:, None]
    else:
        usable = np.concatenate([np.zeros((len(weight), 1)), np.cumsum(weight > 0.0, axis=1)], axis=1)[:, counts]
    quantiles = np.ascontiguousarray(t_quantile(np.maximum(usable - 3, 1)))
    out = np.empty((len(reading), len(counts)), kernel.FIT)
    t, y = np.ascontiguousarray(time), np.ascontiguousarray(reading)
    kernel.likelihoods(t, y, weight, counts, quantiles, first, resolution, start_rule(outlier), wide, out)
    return out


def likelihoods(
    time: Array, reading: Array, weight: Array, resolution: Array, first: NDArray[np.intp], outlier: float = OUTLIER
) -> Likelihoods:
    """Maximum likelihood of all readings (S, n) of S records on one grid time (n,), with profile intervals.

    weight (S, n) as in :func:`fit_decay`; readings `outlier` deviations outside the fit are left out of it (inf: none), and with no
    more than `first` (S,) readings the weights are those of a start. The limit of the residual sum of squares is that of Student's
    t for one parameter, the noise being estimated from the same readings. resolution (S,) [K] is the logger's step.
    """
    weight = np.array(weight, dtype=float)
    counts = np.array([len(time)], dtype=np.intp)
    table = _fits(time, reading, weight, counts, np.asarray(first, dtype=np.intp), np.asarray(resolution, float), outlier)[:, 0]
    fit = DecayFit.from_table(float(time[0]), table)
    bounds = table["rate_low"], table["rate_high"], table["steady_low"], table["steady_high"]
    rate_low, rate_high, low, high = _open_sides(fit.slope, bounds)
    exact = np.isnan(table["steady_low"]) & (fit.n > 3)  # no noise at all: the estimate is exact
    return Likelihoods(
        fit,
        np.where(exact, fit.steady_state, low),
        np.where(exact, fit.steady_state, high),
        np.where(exact, fit.rate, rate_low),
        np.where(exact, fit.rate, rate_high),
        weight,
    )


@dataclass(frozen=True)
class Stretches:
    """Fits (S, m) of the first counts (m,) readings of S records at time (n,) [min]; see :func:`likelihood_sweeps`."""

    time: Array
    counts: NDArray[np.intp]
    fits: Fits

    @property
    def states(self) -> Array:
        """State (temperature, slope, rate) (S, m, 3) after each, nan where there is nothing to fit."""
        out, since = self.fits, self.time[self.counts - 1] - self.time[0]
        temperature = out["level"] + out["slope"] * (kernel.growth(out["rate"], since) - out["phi_mean"])
        return np.stack([temperature, out["slope"] * np.exp(-out["rate"] * since), out["rate"]], axis=-1)

    @property
    def width(self) -> Array:
        """Width [K] of the steady state's interval (S, m), nan where a side is open."""
        out = self.fits
        width = np.where(np.isnan(out["rate_low"]), np.nan, out["steady_high"] - out["steady_low"])
        exact = (out["n"] > 3) & np.isnan(out["steady_low"]) & np.isfinite(out["rate"])
        return np.where(exact, 0.0, width)

    @property
    def longest(self) -> DecayFit:
        """The fits of the longest stretch."""
        return DecayFit.from_table(float(self.time[0]), self.fits[:, -1])

    def squares(self, reading: Array, kept: Array, ends: Sequence[int]) -> Array:
        """Sums of squares [K^2] (S, m, W) of the curves against readings (S, n) over windows of the first ends (W,), ascending.

        kept (S, n): 1 for a reading that counts, else 0.
        """
        out = np.empty((*self.fits.shape, len(ends)))
        t, y, marks = (np.ascontiguousarray(a, dtype=float) for a in (self.time, reading, kept))
        kernel.curve_squares(t, y, marks, self.fits, np.asarray(ends, dtype=np.intp), out)
        return out


def likelihood_sweeps(
    time: Array,
    reading: Array,
    weight: Array,
    counts: NDArray[np.intp],
    first: NDArray[np.intp],
    resolution: Array,
    outlier: float = OUTLIER,
    narrow: float = math.inf,
) -> Stretches:
    """As :func:`likelihoods` for several first stretches counts (m,), ascending, of each of S records, in one call.

    Only a width that may come near `narrow` is looked for on the likelihood; a far larger one is to first order.
    """
    out = _fits(time, reading, np.array(weight, dtype=float), counts, first, resolution, outlier, narrow)
    return Stretches(time, counts, out)


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
    """As :func:`likelihood_sweeps` for one record (n,); no fit where there is nothing to fit."""
    number, begun = np.asarray(counts, dtype=np.intp), np.array([first], dtype=np.intp)
    one = reading[None], weight[None], number, begun, np.array([resolution])
    found = likelihood_sweeps(time, *one, outlier, narrow)
    fit = found.longest.one(0)
    return found.states[0], found.width[0], None if math.isnan(fit.rate) else fit


def widened_intervals(fit: DecayFit, time: Array, reading: Array, weight: Array, widening: Array) -> tuple[Array, ...]:
    """Bounds of S fits of records (S, n) with their noise variances times `widening` (S,), for dependent residuals.

    Returns (rate low, rate high [1/min], steady state low, high [degC]), each (S,), nan where a side is open.
    """
    limit = fit.rss + fit.noise_variance * widening * t_quantile(fit.dof) ** 2
    out = np.empty((len(reading), 4))
    t, y, w, rate, most = (np.ascontiguousarray(a, dtype=float) for a in (time, reading, weight, fit.rate, limit))
    kernel.profile_decay(t, y, w, rate, most, out)
    return _open_sides(fit.slope, tuple(out.T))  # type: ignore[arg-type]
