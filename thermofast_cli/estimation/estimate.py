"""Joins a filter and the model: the estimate that a track supports at a reading. Pure functions on arrays, one sensor at a time."""

import math
import traceback
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Filter, Track
from thermofast.models import (
    LOG_TWENTY,
    OUTLIER,
    DecayFit,
    Interval,
    Likelihood,
    Lump,
    PrintedLump,
    difference_noise,
    growth,
    growth_slope,
    likelihood,
    likelihood_sweep,
    pattern_p_value,
    t_quantile,
    variance_inflation,
    widened_intervals,
)

from ..plugins.filters import track_problem
from .contradiction import contradiction

Array = NDArray[np.float64]
Model = Lump | PrintedLump

#: Below this share of the earlier readings' weight the filter has met something the model does not know: a likelihood over
#: all readings would average two different pasts, so the filter's own state stands.
KEPT_SHARE = 0.5
#: Residuals of a right model look this patterned once in a thousand records.
DOUBT = 1e-3
#: Residuals this patterned are no reason for doubt yet, but their neighbours may be alike: intervals make room for that.
WIDEN = 0.05
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
    noise: float
    limit: float | None
    weights: Array
    initial: float
    t95: float | None
    t95_interval: Interval
    covariance: Array
    pattern_p: float = math.nan
    misfit: float = math.nan
    faded: bool = False
    too_large: bool = False

    def band(self, times: Array, draws: int = 400) -> tuple[Array, Array]:
        """95 % band (n,), (n,) of the model's temperature at times (n,) [min]: quantiles over draws of the state."""
        rng = np.random.default_rng(1)
        root = np.linalg.cholesky(self.covariance + 1e-12 * np.diag(np.diag(self.covariance) + 1e-12))
        states = self.state + rng.standard_normal((draws, 3)) @ root.T
        dt = times - self.time
        curves = states[:, :1] + states[:, 1:2] * growth(states[:, 2:], dt)
        low, high = np.quantile(curves, [0.025, 0.975], axis=0)
        return low, high

    def contradicted_by(self, times: Array, residual: Array) -> float | None:
        """Largest of the residuals (n,) [K] at times (n,) [min] where they leave the band of the prediction, or None.

        First by the covariance alone, which costs little; what that finds is looked at again with the curved band of draws.
        """
        dt = times - self.time
        rate = self.state[2]
        tangent = np.stack([np.ones_like(dt), growth(rate, dt), self.state[1] * growth_slope(rate, dt)])
        spread = np.sqrt(np.maximum(np.einsum("in,ij,jn->n", tangent, self.covariance, tangent), 0.0))
        if contradiction(residual, 1.96 * spread, self.noise) is None:
            return None
        few = np.linspace(float(times.min()), float(times.max()), 60)
        curve, (low, high) = self.free_run(few), self.band(few)
        above, below = np.interp(times, few, high - curve), np.interp(times, few, curve - low)
        half = np.maximum(np.where(residual > 0.0, above, below), 1.96 * spread)
        return contradiction(residual, half, self.noise)

    def free_run(self, times: Array) -> Array:
        """Model temperatures (n,) [degC] at times (n,) [min], run from the state forwards and backwards."""
        return Lump().free_run(self.state, times - self.time)

    @property
    def bounded(self) -> bool:
        sides = (self.steady_state_interval, self.t95_interval)
        return self.steady_state is not None and all(i.low is not None and i.high is not None for i in sides)


class FilterError(Exception):
    """A filter that cannot run on a record, or a stranger's that raises; the message names it and says why."""


def track_of(method: Filter, model: Model, time: Array, reading: Array, resolution: float) -> Track:
    """What a filter makes of one record; the one place where a filter, built in or not, is called.

    Raises
    ------
    FilterError: the filter raises, or what it returns is no track of the record.
    """
    try:
        track = method.track(model, time, reading, resolution)
    except ValueError as error:
        raise FilterError(f"{method.name}: {error}") from None
    except Exception as error:  # whatever a plug-in does is one sensor's trouble
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{last.filename}, line {last.lineno}"
        raise FilterError(f"{method.name} raised {type(error).__name__}: {error} ({place})") from None
    problem = track_problem(track, len(time))
    if problem:
        raise FilterError(f"{method.name}: {problem}")
    return track


def likelihood_estimate(time: Array, reading: Array, weights: Array, first: int, resolution: float, outlier: float) -> Estimate:
    """Maximum likelihood over the readings (n,) with weights (n,): the closing step.

    Asks whether the residuals are noise, and widens the intervals where they are not.

    Raises
    ------
    ValueError: fewer than three usable readings.
    """
    found = likelihood(time, reading, weights, resolution, first, outlier)
    if found is None:
        raise ValueError("a likelihood needs three usable readings")
    fit, weights = found.fit, found.weights
    used = weights > 0.0
    residual, tangent = fit.residual_and_tangent(time[used], reading[used])
    p, widening = math.nan, 1.0
    if fit.dof >= 9:
        root = np.sqrt(weights[used])
        scaled = residual * root
        p = pattern_p_value(scaled, tangent * root[:, None])
        if p < WIDEN:
            widening = variance_inflation(scaled)
    widening = max(widening, _rounding(fit, resolution))
    if widening > 1.0 and fit.dof > 0 and fit.rss > 0.0:
        steady, rates = widened_intervals(fit, time, reading, weights, widening)
        found = replace(found, steady_state=steady, rate=rates)
    misfit = math.sqrt(float(residual @ residual) / len(residual))
    plain = _from_likelihood(found, time, resolution, widening)
    # Neighbours differ by noise alone: residuals several times larger are something else, even where they show no pattern.
    too_large = misfit > 3.0 * difference_noise(reading) + resolution and len(reading) >= 12
    return replace(plain, pattern_p=p, misfit=misfit, too_large=too_large)


def _rounding(fit: DecayFit, resolution: float) -> float:
    """Factor on the noise variance that makes room for rounding.

    Noise of half a step or more spreads the rounding over many steps, and it averages out; with less, a settled record may
    sit up to half a step beside the truth for ever.
    """
    if resolution <= 0.0 or fit.dof < 1:
        return 1.0
    # Rounding alone leaves residuals of a step over sqrt(12): what is beyond that is the probe's.
    noise = math.sqrt(max(fit.noise_variance - resolution**2 / 12.0, 0.0))
    bias = 0.5 * resolution * max(0.0, 1.0 - 2.0 * noise / resolution)
    spread = fit.steady_state_limit * math.sqrt(fit.noise_variance)
    if bias <= 0.0 or not 0.0 < spread < math.inf:
        return 1.0
    return (1.0 + bias / (float(t_quantile(fit.dof)) * spread)) ** 2


def _from_likelihood(found: Likelihood, time: Array, resolution: float, widening: float = 1.0) -> Estimate:
    fit, rates = found.fit, found.rate
    last = float(time[len(found.weights) - 1])
    state, covariance = fit.state(last)
    curved = fit.rate > 1.001 * fit.rate_low
    noise = math.sqrt(max(fit.noise_variance, resolution**2 / 12.0)) if fit.dof > 0 else math.nan
    limit = fit.steady_state_limit * noise
    known = math.isfinite(noise) and math.isfinite(covariance[2, 2])
    return Estimate(
        time=last,
        state=state,
        steady_state=fit.steady_state if curved else None,
        steady_state_interval=found.steady_state,
        rate=fit.rate if curved else None,
        noise=noise,
        limit=limit if curved and math.isfinite(limit) else None,
        weights=found.weights,
        initial=fit.level - fit.slope * fit.phi_mean,
        t95=LOG_TWENTY / fit.rate if curved else None,
        t95_interval=Interval(
            LOG_TWENTY / rates.high if rates.high is not None else None,
            LOG_TWENTY / rates.low if rates.low is not None else None,
        ),
        covariance=covariance * (noise**2 * widening) if known else np.zeros((3, 3)),
    )


def filter_estimate(model: Model, track: Track, time: Array, reading: Array, k: int, resolution: float) -> Estimate:
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
    quantile = float(t_quantile(dof)) if math.isfinite(dof) else 1.96
    covariance = covariance * noise_variance
    steady, rates = model.intervals(state, covariance, quantile)
    curve, spread = model.curve_state(state), model.curve_covariance(state, covariance)
    temperature, slope, rate = (float(v) for v in curve)
    settles = rate > 0.0
    faded = k >= track.first and float(track.forgotten[k]) > -math.log(KEPT_SHARE)
    # What the filter forgot it cannot be held to: run backwards from its last state, the model would leave every bound.
    anchor = min(track.first, k) if faded else k
    origin = model.curve_state(track.state[anchor]) if faded else curve
    initial = float(Lump().free_run(origin, time[:1] - time[anchor])[0])
    remembered = np.exp(track.forgotten[: k + 1] - track.forgotten[k]) if faded else np.ones(k + 1)
    remembered = np.where((weights > 0.0) & (remembered > 1e-3), remembered, 0.0)
    residual = np.zeros(k + 1)
    used = remembered > 0.0
    residual[used] = reading[: k + 1][used] - Lump().free_run(curve, time[: k + 1][used] - time[k])
    misfit = math.sqrt(float(remembered @ residual**2) / max(float(remembered.sum()), 1e-9))
    elapsed = float(time[k] - time[0])
    if faded or not settles:
        t95, t95_interval = settling(curve, spread, elapsed, initial, quantile)
    else:  # one curve from the start on: where it began is as sure as the state is, and only the rate counts
        t95, t95_interval = (
            LOG_TWENTY / rate,
            Interval(
                LOG_TWENTY / rates.high if rates.high is not None else None,
                LOG_TWENTY / rates.low if rates.low is not None else None,
            ),
        )
    if settles:
        steady = steady.around(temperature + slope / rate)
    return Estimate(
        time=float(time[k]),
        state=curve,
        steady_state=temperature + slope / rate if settles else None,
        steady_state_interval=steady,
        rate=rate if settles else None,
        noise=math.sqrt(float(track.noise_variance[k]) if k >= track.first else noise_variance),
        limit=None,
        weights=weights,
        initial=initial,
        t95=t95,
        t95_interval=t95_interval,
        covariance=spread,
        misfit=misfit,
        faded=faded,
        too_large=len(reading) >= 12 and misfit > 3.0 * difference_noise(reading[: k + 1]) + resolution,
    )


def settling(curve: Array, covariance: Array, elapsed: float, initial: float, quantile: float) -> tuple[float | None, Interval]:
    """Minutes from the first reading to within 5 % of the whole rise, and their 95 % interval.

    curve (3,) is (temperature, slope, rate) `elapsed` minutes after the first reading, covariance (3, 3) its own. The interval runs
    over the rate, temperature and slope following it as the covariance says; None where a side is not bounded.
    """
    nodes = np.linspace(-4.5, 4.5, 181)
    spread = math.sqrt(max(float(covariance[2, 2]), 0.0))
    along = covariance[:, 2] / covariance[2, 2] if covariance[2, 2] > 0.0 else np.array([0.0, 0.0, 1.0])
    states = curve[:, None] + along[:, None] * (quantile / 1.96 * spread * nodes)
    states[:, 90] = curve
    with np.errstate(all="ignore"):
        left = states[1] / states[2]
        share = np.abs(left) / (0.05 * np.abs(states[0] + left - initial))
        times = np.where(states[2] > 0.0, elapsed + np.log(share) / states[2], math.inf)
    times = np.where(np.isnan(times), math.inf, np.maximum(times, 0.0))
    order = np.argsort(times)
    weight = np.cumsum(np.exp(-0.5 * nodes[order] ** 2))
    low, high = times[order][np.searchsorted(weight / weight[-1], [0.025, 0.975])]
    centre = float(times[90])
    low, high = min(low, centre), max(high, centre)  # log(share) bends: near zero the middle of the draws is not the estimate
    return (
        centre if math.isfinite(centre) and centre > 0.0 else None,
        Interval(float(low) if math.isfinite(low) and low > 0.0 else None, float(high) if math.isfinite(high) else None),
    )


def _closes(method: Filter, track: Track, k: int) -> bool:
    consistent = not track.forgotten[k] > -math.log(KEPT_SHARE)
    return method.closing == "always" or (method.closing == "when consistent" and (consistent or k < track.first))


def _outlier(method: Filter) -> float:
    """Deviations at which a reading is outlier: none where the method counts each reading alike."""
    return math.inf if method.closing == "always" else OUTLIER


def _first(method: Filter, track: Track) -> int:
    """Readings up to which a likelihood takes its weights from a start: those before the filter began."""
    return 0 if method.closing == "always" else track.first


def estimate_at(model: Model, method: Filter, track: Track, time: Array, reading: Array, k: int, resolution: float) -> Estimate:
    """The estimate that `method` gives from readings 0..k; the same whether or not the record goes on.

    Where the filter has forgotten its past, it must be right to have done so: one likelihood over all readings stands all the
    same if its residuals are noise, because chance alone wakes a filter now and then in a long record.
    """
    faded = method.closing == "when consistent" and not _closes(method, track, k)
    if faded:
        weights = track.likelihood_weight[: k + 1]
        whole = likelihood_estimate(time[: k + 1], reading[: k + 1], weights, track.first, resolution, OUTLIER)
        if whole.pattern_p >= DOUBT and not whole.too_large:
            return whole
    elif _closes(method, track, k):
        weights = track.likelihood_weight[: k + 1]
        return likelihood_estimate(time[: k + 1], reading[: k + 1], weights, _first(method, track), resolution, _outlier(method))
    return filter_estimate(model, track, time, reading, k, resolution)


def _looks_white(fit: DecayFit, time: Array, reading: Array, weights: Array, resolution: float) -> bool:
    """Whether the residuals of a fit of the first readings show neither a pattern nor more than noise."""
    count = int(np.searchsorted(time, fit.t0 + fit.span * (1.0 + 1e-12), "right"))
    used = weights[:count] > 0.0
    if fit.dof < 9 or int(used.sum()) != fit.n:  # some reading was left out on the way: look closely
        return False
    residual, tangent = fit.residual_and_tangent(time[:count][used], reading[:count][used])
    root = np.sqrt(weights[:count][used])
    if pattern_p_value(residual * root, tangent * root[:, None]) < DOUBT:
        return False
    misfit = math.sqrt(float(residual @ residual) / len(residual))
    return misfit <= 3.0 * difference_noise(reading[:count]) + resolution


@dataclass(frozen=True)
class Progress:
    """What a sweep needs of the estimates after each of m readings.

    state (m, 3); width [K] of the steady state's interval (m,), nan where a side is open; faded (m,), whether the filter
    had forgotten its past; sound, whether the last one's residuals plainly are noise.
    """

    state: Array
    width: Array
    faded: NDArray[np.bool_]
    sound: bool


def estimates_at(
    model: Model,
    method: Filter,
    track: Track,
    time: Array,
    reading: Array,
    indices: list[int],
    resolution: float,
    narrow: float = math.inf,
) -> Progress:
    """As :func:`estimate_at` for several readings of one track, in one call of the likelihood where it closes the estimate.

    A width below `narrow` [K] is that of :func:`estimate_at`; a larger one has not been widened for dependent residuals, and a
    far larger one is to first order.
    """
    at = np.array(indices)
    consistent = ~(track.forgotten[at] > -math.log(KEPT_SHARE)) | (at < track.first)
    closes = consistent if method.closing == "when consistent" else np.full(len(at), method.closing == "always")
    states, width = np.full((len(indices), 3), np.nan), np.full(len(indices), np.nan)
    fit: DecayFit | None = None
    if closes.any():
        weights = track.likelihood_weight
        first, outlier = _first(method, track), _outlier(method)
        states[closes], width[closes], fit = likelihood_sweep(
            time, reading, weights, at[closes] + 1, first, resolution, outlier, narrow
        )
    faded = np.zeros(len(indices), dtype=bool)
    # Intervals that pass for narrow are judged one by one: where residuals are not noise they are wider than they look.
    for i in np.flatnonzero(~closes | (width < narrow)):
        estimate = estimate_at(model, method, track, time, reading, indices[i], resolution)
        low, high = estimate.steady_state_interval.low, estimate.steady_state_interval.high
        states[i], faded[i] = estimate.state, estimate.faded
        width[i] = high - low if low is not None and high is not None else math.nan
    sound = fit is not None and bool(closes[-1]) and _looks_white(fit, time, reading, track.likelihood_weight, resolution)
    return Progress(states, width, faded, sound)
