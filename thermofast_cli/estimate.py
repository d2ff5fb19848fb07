"""Joins a filter and the model: the estimate that a track supports at a reading. Pure functions on arrays, one sensor at a time."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from filters import Filter, Track
from models import (
    LOG_TWENTY,
    Interval,
    Lump,
    PrintedLump,
    fit_decay,
    pattern_p_value,
    profile_intervals,
    variance_inflation,
)

Array = NDArray[np.float64]
Model = Lump | PrintedLump

#: Below this share of the earlier readings' weight the filter has met something the model does not know: a likelihood over
#: all readings would average two different pasts, so the filter's own state stands.
KEPT_SHARE = 0.5
#: Residuals of a right model look this patterned once in a thousand records.
DOUBT = 1e-3
FEWEST_READINGS = 6


@dataclass(frozen=True)
class Estimate:
    """What the first k + 1 readings say. Temperatures degC, times min, rates 1/min; None is 'not determined'.

    state (temperature, slope, rate) at ``time`` carries the free run, before and after.
    noise [K] is the standard deviation of a reading; limit [K] the least standard deviation of the steady state that any
    unbiased method could have on this record (Cramer-Rao).
    """

    time: float
    state: Array
    steady_state: float | None
    steady_state_interval: Interval
    rate: float | None
    rate_interval: Interval
    noise: float
    limit: float | None
    weights: Array
    from_likelihood: bool
    pattern_p: float
    misfit: float

    def free_run(self, times: Array) -> Array:
        """Model temperatures (n,) [degC] at times (n,) [min], run from the state forwards and backwards."""
        return Lump().free_run(self.state, times - self.time)

    @property
    def t95(self) -> float | None:
        return LOG_TWENTY / self.rate if self.rate is not None else None

    @property
    def t95_interval(self) -> Interval:
        low, high = self.rate_interval.high, self.rate_interval.low
        return Interval(LOG_TWENTY / low if low else None, LOG_TWENTY / high if high else None)

    @property
    def bounded(self) -> bool:
        sides = (self.steady_state_interval, self.t95_interval)
        return self.steady_state is not None and all(i.low is not None and i.high is not None for i in sides)


def likelihood_estimate(time: Array, reading: Array, weights: Array, resolution: float, judge: bool = True) -> Estimate:
    """Maximum likelihood over the readings (n,) with weights (n,): the closing step.

    `judge` asks whether the residuals are noise, and widens the intervals where they are not.

    Raises
    ------
    ValueError: fewer than three usable readings.
    """
    fit = fit_decay(time, reading, weights)
    for _ in range(2):  # strays that the filter could not see while it knew too little
        residual = (reading - fit.predict(time)) * np.sqrt(weights)
        limit = 6.0 * (1.0 + 3.0 / max(fit.dof, 1)) * math.sqrt(max(fit.noise_variance, 0.0)) + resolution
        stray = np.abs(residual) > limit
        if fit.dof < 3 or not stray.any() or stray.sum() > len(time) // 10:
            break
        weights = np.where(stray, 0.0, weights)
        fit = fit_decay(time, reading, weights)
    p, widening = math.nan, 1.0
    used = weights > 0.0
    residual = (reading - fit.predict(time))[used]
    if judge and used.sum() >= 12:
        scaled = residual * np.sqrt(weights[used])
        p = pattern_p_value(scaled, _tangent(fit, time[used], weights[used]))
        if p < DOUBT:
            widening = variance_inflation(scaled)
    misfit = math.sqrt(float(residual @ residual) / len(residual))
    steady, rates = profile_intervals(fit, time, reading, weights, widening)
    state, _ = fit.state(float(time[-1]))
    curved = fit.rate > 1.001 * fit.rate_low
    noise = math.sqrt(max(fit.noise_variance, resolution**2 / 12.0)) if fit.dof > 0 else math.nan
    limit_c = fit.steady_state_limit * noise
    return Estimate(
        float(time[-1]),
        state,
        fit.steady_state if curved else None,
        steady,
        fit.rate if curved else None,
        rates,
        noise,
        limit_c if curved and math.isfinite(limit_c) else None,
        weights,
        True,
        p,
        misfit,
    )


def _tangent(fit: object, time: Array, weights: Array) -> Array:
    from models.decay import DecayFit
    from models.kernel import growth, growth_slope

    assert isinstance(fit, DecayFit)
    dt = time - fit.t0
    columns = [np.ones(len(time)), growth(fit.rate, dt), growth_slope(fit.rate, dt)]
    return np.column_stack(columns) * np.sqrt(weights)[:, None]


def filter_estimate(
    model: Model, track: Track, time: Array, reading: Array, k: int, resolution: float, judge: bool = True
) -> Estimate:
    """The filter's own state after reading k, with the interval that its covariance stands for."""
    weights = track.likelihood_weight[: k + 1]
    if k >= track.first:
        state, covariance, noise_variance = track.state[k], track.covariance[k], float(track.noise_variance[k])
        dof = k - 2.0
        if isinstance(model, PrintedLump):
            noise_variance, dof = 1.0, math.inf
    else:
        start = model.start(time[: k + 1], reading[: k + 1], resolution)
        state, covariance, noise_variance, dof = start.state, start.covariance, start.noise_variance, start.dof
        weights = start.weights
    quantile = float(stdtrit(dof, 0.975)) if math.isfinite(dof) else 1.96
    steady, rates = model.intervals(state, covariance * noise_variance, quantile)
    curve = model.curve_state(state)
    temperature, slope, rate = (float(v) for v in curve)
    settles = rate > 0.0
    noise = math.sqrt(float(track.noise_variance[k]) if k >= track.first else noise_variance)
    used = weights > 0.0
    run = Lump().free_run(curve, time[: k + 1] - time[k])
    residual = (reading[: k + 1] - run)[used]
    misfit = math.sqrt(float(residual @ residual) / max(len(residual), 1))
    return Estimate(
        float(time[k]),
        curve,
        temperature + slope / rate if settles else None,
        steady,
        rate if settles else None,
        rates,
        noise,
        None,
        weights,
        False,
        math.nan,
        misfit,
    )


def estimate_at(
    model: Model,
    method: Filter,
    track: Track,
    time: Array,
    reading: Array,
    k: int,
    resolution: float,
    judge: bool = True,
) -> Estimate:
    """The estimate that `method` gives from readings 0..k; the same whether or not the record goes on."""
    consistent = not track.forgotten[k] > -math.log(KEPT_SHARE)
    if method.closing == "always" or (method.closing == "when consistent" and (consistent or k < track.first)):
        if k < track.first and method.closing != "always":
            weights = model.start(time[: k + 1], reading[: k + 1], resolution).weights
        else:
            weights = track.likelihood_weight[: k + 1]
        return likelihood_estimate(time[: k + 1], reading[: k + 1], weights, resolution, judge)
    return filter_estimate(model, track, time, reading, k, resolution, judge)
