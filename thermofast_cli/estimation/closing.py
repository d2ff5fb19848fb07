"""Joins a filter and the model: the estimates that tracks support, closed by a likelihood where the filter says so."""

import math
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Afukf, Filter, Track, Tracks
from thermofast.filters.joint import track_together
from thermofast.models import (
    LOG_TWENTY,
    OUTLIER,
    DecayFit,
    Interval,
    Lump,
    PrintedLump,
    Stretches,
    exceeds_difference_noise,
    likelihood_sweep,
    likelihood_sweeps,
    likelihoods,
    t_quantile,
    widened_intervals,
)
from thermofast.models.noise.whiteness import law_patterns, variance_inflations
from thermofast.models.observations import read_only

from ..errors import in_one_line
from ..plugins.filters import track_problem
from ..plugins.guard import PATIENCE_EACH_S, PATIENCE_S, PluginError, alarm, contained, said_by
from .estimate import Estimate, Estimates, FilterError, Model
from .rules import RULES
from .sensor import Sensors

Array = NDArray[np.float64]


def track_of(method: Filter, model: Model, time: Array, reading: Array, resolution: float) -> Track:
    """What a filter makes of one record; the one place where a filter, built in or not, is called.

    Raises
    ------
    FilterError: the filter raises, or what it returns is no track of the record.
    """
    time, reading = read_only(time), read_only(reading)  # other filters see the same arrays
    try:
        with alarm(f"filter {method.name!r}", PATIENCE_S + PATIENCE_EACH_S * len(time)), contained():
            track = method.track(model, time, reading, resolution)
    except PluginError as error:
        raise FilterError(in_one_line(error)) from None
    except ValueError as error:
        raise FilterError(f"{method.name}: {said_by(error)}") from None
    except (KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException as error:  # whatever a plug-in does is one sensor's trouble
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{last.filename}, line {last.lineno}"
        raise FilterError(f"{method.name} raised {type(error).__name__}: {said_by(error)} ({place})") from None
    problem = track_problem(track, len(time), method.closing)
    if problem:
        raise FilterError(f"{method.name}: {problem}")
    return track


def tracks_together(model: Model, method: Afukf, blocks: Sequence[Sensors], until_min: float | None) -> dict[int, Track]:
    """Track of every row under one filter over all of them."""
    records, rows = [], []
    for block in blocks:
        n = block.until(until_min)
        records += [(block.time[:n], r[:n], float(step)) for r, step in zip(block.reading, block.resolution, strict=True)]
        rows += block.rows.tolist()
    tracks = track_together(model, method.moments, method.fading_rule, records)
    return dict(zip(rows, tracks, strict=True))


def tracks_of(method: Filter, model: Model, time: Array, reading: Array, resolution: Array) -> Tracks | None:
    """What a filter makes of all records (S, n) in one call, or None where each must be filtered alone."""
    try:
        with alarm(f"filter {method.name!r}", PATIENCE_S + PATIENCE_EACH_S * reading.size):
            return method.tracks(model, read_only(time), read_only(reading), resolution)
    except (KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException:  # one record's trouble is found, and told, when each is filtered alone
        return None


def likelihood_estimates(
    time: Array, reading: Array, weights: Array, first: NDArray[np.intp], resolution: Array, outlier: float
) -> Estimates:
    """Maximum likelihood over the readings (S, n) with weights (S, n) of S sensors on one grid: the closing step.

    Asks whether the residuals are noise, and widens the intervals where they are not. Where there are fewer than three usable
    readings the rate is nan and nothing is determined.
    """
    found = likelihoods(time, reading, weights, resolution, first, outlier)
    fit, weights = found.fit, found.weights
    p, residual, misfit = law_patterns(time, reading, weights, fit.rate)
    widening = np.maximum(_rounding(fit, resolution), 1.0)
    rows = np.flatnonzero(p < RULES.widen)
    if len(rows):
        widening[rows] = np.maximum(widening[rows], variance_inflations(residual[rows], weights[rows] > 0.0))
    sides = [found.rate_low.copy(), found.rate_high.copy(), found.steady_low.copy(), found.steady_high.copy()]
    rows = np.flatnonzero((widening > 1.0) & (fit.dof > 0) & (fit.rss > 0.0))
    if len(rows):
        wider = widened_intervals(fit.some(rows), time, reading[rows], weights[rows], widening[rows])
        for side, bound in zip(sides, wider, strict=True):
            side[rows] = bound
    rate_low, rate_high, steady_low, steady_high = sides
    too_large = _too_large(misfit, reading, resolution) & (len(time) >= 12)
    state, covariance = fit.state(float(time[-1]))
    curved = fit.rate > 1.001 * fit.least
    with np.errstate(all="ignore"):
        noise = np.where(fit.dof > 0, np.sqrt(np.maximum(fit.noise_variance, resolution**2 / 12.0)), np.nan)
        limit = fit.steady_state_limit * noise
        known = np.isfinite(noise) & np.isfinite(covariance[:, 2, 2])
        covariance = np.where(known[:, None, None], covariance * (noise**2 * widening)[:, None, None], 0.0)
        t95, t95_low, t95_high = LOG_TWENTY / fit.rate, LOG_TWENTY / rate_high, LOG_TWENTY / rate_low
    return Estimates(
        time=float(time[-1]),
        state=state,
        steady_state=np.where(curved, fit.steady_state, np.nan),
        steady_low=steady_low,
        steady_high=steady_high,
        rate=np.where(curved, fit.rate, np.nan),
        noise=noise,
        limit=np.where(curved & np.isfinite(limit), limit, np.nan),
        weights=weights,
        initial=fit.level - fit.slope * fit.phi_mean,
        t95=np.where(curved, t95, np.nan),
        t95_low=t95_low,
        t95_high=t95_high,
        covariance=covariance,
        pattern_p=p,
        misfit=misfit,
        faded=np.zeros(len(reading), dtype=bool),
        too_large=too_large,
    )


def likelihood_estimate(time: Array, reading: Array, weights: Array, first: int, resolution: float, outlier: float) -> Estimate:
    """As :func:`likelihood_estimates` for one sensor, reading and weights (n,).

    Raises
    ------
    ValueError: fewer than three usable readings.
    """
    block = reading[None], weights[None], np.array([first], dtype=np.intp), np.array([resolution])
    found = likelihood_estimates(time, *block, outlier)
    if not math.isfinite(found.state[0, 2]):
        raise ValueError("a likelihood needs three usable readings")
    return found.one(0)


def _too_large(misfit: Array, reading: Array, resolution: Array) -> NDArray[np.bool_]:
    """Whether residuals (S,) [K], beyond the logger's step, are several times what neighbouring readings (S, n) differ by.

    These differ by noise alone: such residuals are something else, even where they show no pattern.
    """
    return exceeds_difference_noise(reading, (misfit - resolution) / 3.0)


def _rounding(fit: DecayFit, resolution: Array) -> Array:
    """Factors (S,) on the noise variance that make room for rounding.

    Noise of half a step or more spreads the rounding over many steps, and it averages out; with less, a settled record may
    sit up to half a step beside the truth for ever.
    """
    factor = np.ones(len(resolution))
    some = (resolution > 0.0) & (fit.dof >= 1)
    if not some.any():
        return factor
    with np.errstate(all="ignore"):
        # Rounding alone leaves residuals of a step over sqrt(12): what is beyond that is the probe's.
        noise = np.sqrt(np.maximum(fit.noise_variance - resolution**2 / 12.0, 0.0))
        bias = 0.5 * resolution * np.maximum(0.0, 1.0 - 2.0 * noise / resolution)
        spread = fit.steady_state_limit * np.sqrt(fit.noise_variance)
        some &= (bias > 0.0) & (spread > 0.0) & np.isfinite(spread)
        if some.any():
            factor[some] = (1.0 + bias[some] / (t_quantile(fit.dof[some]) * spread[some])) ** 2
    return factor


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
    faded = k >= track.first and float(track.forgotten[k]) > -math.log(RULES.kept_share)
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
        too_large=len(reading) >= 12 and bool(_too_large(np.array([misfit]), reading[None, : k + 1], np.array([resolution]))[0]),
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
    consistent = not track.forgotten[k] > -math.log(RULES.kept_share)
    return method.closing == "always" or (method.closing == "when consistent" and (consistent or k < track.first))


def _outlier(method: Filter) -> float:
    """Deviations at which a reading is an outlier: none where the method counts each reading alike."""
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
        if whole.pattern_p >= RULES.doubt and not whole.too_large:
            return whole
    elif _closes(method, track, k):
        weights = track.likelihood_weight[: k + 1]
        return likelihood_estimate(time[: k + 1], reading[: k + 1], weights, _first(method, track), resolution, _outlier(method))
    return filter_estimate(model, track, time, reading, k, resolution)


def estimates_of(
    model: Model,
    method: Filter,
    tracks: Tracks,
    time: Array,
    reading: Array,
    resolution: Array,
    track: Callable[[int], Track],
) -> Estimates:
    """As :func:`estimate_at` the last reading, for S sensors (S, n) on one grid.

    `track` gives a sensor's whole track where it is needed. Sensors whose filter diverged are left out: theirs stay nan.
    """
    sensors, count = reading.shape
    found = Estimates.empty(sensors, count, float(time[-1]))
    sound = tracks.diverged_at < 0
    with np.errstate(invalid="ignore"):
        forgot = tracks.forgotten > -math.log(RULES.kept_share)
    consistent = ~forgot | (count - 1 < tracks.first)
    closes = {"never": np.zeros(sensors, bool), "always": np.ones(sensors, bool), "when consistent": consistent}[method.closing]
    asked = sound & (closes | (method.closing == "when consistent"))
    asks = np.flatnonzero(asked)
    stands = np.zeros(sensors, dtype=bool)
    if len(asks):
        of = slice(None) if asked.all() else asks  # of all, nothing needs to be copied
        first = tracks.first[of] if method.closing != "always" else np.zeros(len(asks), dtype=np.intp)
        whole = likelihood_estimates(time, reading[of], tracks.weight[of], first, resolution[of], _outlier(method))
        with np.errstate(invalid="ignore"):
            # A filter that forgot must be right to have done so: chance alone wakes one now and then in a long record.
            stands[asks] = closes[asks] | ((whole.pattern_p >= RULES.doubt) & ~whole.too_large)
        if stands.all():
            return whole
        found.put(asks[stands[asks]], _some(whole, stands[asks]))
    for i in np.flatnonzero(sound & ~stands).tolist():
        found.put_one(i, filter_estimate(model, track(i), time, reading[i], count - 1, float(resolution[i])))
    return found


def _some(estimates: Estimates, rows: NDArray[np.bool_]) -> Estimates:
    return replace(estimates, **{f.name: getattr(estimates, f.name)[rows] for f in fields(estimates) if f.name != "time"})


def _look_white(fits: DecayFit, time: Array, reading: Array, weights: Array, resolution: Array) -> NDArray[np.bool_]:
    """Whether the residuals of fits of readings (S, n) plainly are noise: no pattern, no larger than neighbours differ."""
    whole = (weights > 0.0).sum(axis=1) == fits.n  # else some reading was left out on the way: look closely
    p, _, misfit = law_patterns(time, reading, weights, fits.rate)
    with np.errstate(invalid="ignore"):  # nan of too few readings
        white: NDArray[np.bool_] = whole & (p >= RULES.doubt) & ~_too_large(misfit, reading, resolution)
    return white


def consistent_until_the_end(method: Filter, tracks: Tracks) -> NDArray[np.bool_]:
    """Of which of S tracks a likelihood closes the estimate after every reading: what was forgotten only grows (S,)."""
    with np.errstate(invalid="ignore"):
        kept = (tracks.diverged_at < 0) & ~(tracks.forgotten > -math.log(RULES.kept_share))
    return kept & (method.closing == "when consistent")


@dataclass(frozen=True)
class Progresses:
    """:class:`Progress` for S sensors whose likelihood closes: their fits after each of m readings, width (S, m), sound (S,).

    A width below that asked for has been judged where all later ones are below it too.
    """

    stretches: Stretches
    width: Array
    sound: NDArray[np.bool_]


def progresses_of(
    method: Filter,
    tracks: Tracks,
    time: Array,
    reading: Array,
    indices: NDArray[np.intp],
    resolution: Array,
    narrow: float = math.inf,
) -> Progresses:
    """As :func:`estimates_at` for S sensors (S, n) on one grid, all of them consistent to the end."""
    weights, first = tracks.weight, tracks.first
    found = likelihood_sweeps(time, reading, weights, indices + 1, first, resolution, _outlier(method), narrow)
    width, going = found.width, np.ones(len(reading), dtype=bool)
    for i in range(len(indices) - 1, -1, -1):
        with np.errstate(invalid="ignore"):
            rows = np.flatnonzero(going & (width[:, i] < narrow))
        if not len(rows):
            break
        # Narrow ones are judged: where residuals are no noise they are wider.
        n = int(indices[i]) + 1
        part = time[:n], reading[rows, :n], weights[rows, :n], first[rows], resolution[rows]
        judged = likelihood_estimates(*part, _outlier(method))
        width[rows, i] = judged.steady_high - judged.steady_low
        with np.errstate(invalid="ignore"):
            going = width[:, i] < narrow
            width[:, :i] = np.where(~going[:, None] & (width[:, :i] < narrow), np.nan, width[:, :i])  # not judged: told by nobody
    last = int(indices[-1]) + 1
    white = _look_white(found.longest, time[:last], reading[:, :last], weights[:, :last], resolution)
    return Progresses(found, width, white)


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
    consistent = ~(track.forgotten[at] > -math.log(RULES.kept_share)) | (at < track.first)
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
    sound = False
    if fit is not None and closes[-1]:
        n = indices[-1] + 1
        row = time[:n], reading[None, :n], track.likelihood_weight[None, :n], np.array([resolution])
        sound = bool(_look_white(fit.as_one_of_several(), *row)[0])
    return Progress(states, width, faded, sound)
