"""From one sensor's readings to one record of ``identify``. Pure: arrays in, records out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Afukf, Filter, Track
from thermofast.filters.joint import track_together
from thermofast.models import spike_weights
from thermofast.models.uncertainty.first_passage import Pace, TimeToGo, clock_time, time_to_go

from ..records import IdentifyRecord, finite
from .contradiction import words
from .estimate import DOUBT, FEWEST_READINGS, Estimate, FilterError, Model, estimate_at, track_of
from .measured import measured_equilibrium
from .sensor import Sensor, prepare

Array = NDArray[np.float64]

#: An interval of the steady state wider than this many times the rise seen so far determines nothing.
WIDEST = 5.0


@dataclass(frozen=True)
class Method:
    """What every sensor of a run is treated with; paces: how the rate will change after the last reading used."""

    model: Model
    filter: Filter
    paces: tuple[Pace, ...] = ()


@dataclass(frozen=True)
class Curves:
    """What a picture of one sensor shows; arrays over time [min], temperatures degC."""

    run: str
    channel: str
    time: Array
    reading: Array
    model_time: Array
    model: Array
    band_low: Array
    band_high: Array
    until: float
    note: str
    steady_state: float | None
    t95: float | None
    trace: dict[str, Array]


@dataclass(frozen=True)
class Identified:
    """What a worker hands back for one sensor; trace and curves only where they are asked for."""

    record: IdentifyRecord
    trace: dict[str, Array] | None = None
    curves: Curves | None = None


def identify_sensor(
    run: str,
    channel: str,
    time_min: Array,
    values: Array,
    method: Method,
    until_min: float | None = None,
    start_min: float = 0.0,
    note: str = "",
    want_trace: bool = False,
) -> Identified:
    """Record of one sensor from its readings values (N,) [degC], nan for none, at time_min (N,).

    Trouble with the sensor is a status in the record, never an exception.
    """
    sensor = prepare(time_min, values, start_min)
    blank = IdentifyRecord(run, channel, method.filter.name, until_min=until_min, start_min=start_min)
    refused = _refused(blank, sensor, until_min, note)
    if refused is not None:
        return refused
    count = sensor.until(until_min)
    try:
        track = track_of(method.filter, method.model, sensor.time[:count], sensor.reading[:count], sensor.resolution)
    except FilterError as error:
        return Identified(replace(blank, samples=count, status="diverged", message=_joined([error, note])))
    return _identified(replace(blank, until_min=_until(until_min, time_min)), sensor, track, method, note, until_min, want_trace)


def identify_together(
    run: str,
    channels: Sequence[str],
    time_min: Array,
    values: Array,
    method: Method,
    until_min: float | None = None,
    start_min: float = 0.0,
    notes: Sequence[str] = (),
    want_trace: bool = False,
) -> list[Identified]:
    """As :func:`identify_sensor` for all sensors of a run, values (S, N), under one adaptive fading filter.

    Raises
    ------
    TypeError: the filter is not the AFUKF.
    """
    if not isinstance(method.filter, Afukf):
        raise TypeError(f"one filter over all sensors is the AFUKF, not {method.filter.name}")
    sensors = [prepare(time_min, row, start_min) for row in values]
    blanks = [IdentifyRecord(run, c, f"{method.filter.name} (joint)", until_min=until_min, start_min=start_min) for c in channels]
    refused = [_refused(blank, s, until_min, note) for blank, s, note in zip(blanks, sensors, notes, strict=True)]
    going = [i for i, r in enumerate(refused) if r is None]
    cut = [sensors[i].until(until_min) for i in going]
    records = [(sensors[i].time[:n], sensors[i].reading[:n], sensors[i].resolution) for i, n in zip(going, cut, strict=True)]
    tracks = dict(zip(going, track_together(method.model, method.filter.moments, method.filter.fading_rule, records), strict=True))
    minutes = _until(until_min, time_min)
    return [
        done
        if done is not None
        else _identified(replace(blanks[i], until_min=minutes), sensors[i], tracks[i], method, notes[i], until_min, want_trace)
        for i, done in enumerate(refused)
    ]


def _until(until_min: float | None, time_min: Array) -> float:
    return until_min if until_min is not None else float(time_min[-1] - time_min[0])


def _refused(blank: IdentifyRecord, sensor: Sensor, until_min: float | None, note: str) -> Identified | None:
    refused = refusal(sensor, until_min)
    if refused is None:
        return None
    status, why, samples = refused
    return Identified(replace(blank, samples=samples, status=status, message=_joined([why, note])))


def _identified(
    blank: IdentifyRecord, sensor: Sensor, track: Track, method: Method, note: str, until_min: float | None, want_trace: bool
) -> Identified:
    count, time, reading = len(track.weight), sensor.time, sensor.reading
    blank, notes = replace(blank, samples=count), [note] if note else []
    if track.diverged_at is not None:
        message = f"the filter diverged at reading {track.diverged_at + 1}, {time[track.diverged_at]:.4g} min"
        return Identified(replace(blank, status="diverged", message=_joined([message, *notes])))
    estimate = estimate_at(method.model, method.filter, track, time[:count], reading[:count], count - 1, sensor.resolution)
    record = _record(blank, sensor, estimate, track, count, notes, method.paces)
    trace = trace_columns(method.model, track, time[:count], reading[:count]) if want_trace else None
    curves = _curves(record, sensor, estimate, trace, count, until_min) if want_trace else None
    return Identified(record, trace, curves)


def refusal(sensor: Sensor, until_min: float | None) -> tuple[str, str, int] | None:
    """(status, message, readings) where a sensor gives nothing to identify, else None."""
    count = sensor.until(until_min)
    if not len(sensor.reading):
        return "no_data", "no reading in this column", 0
    if count < FEWEST_READINGS:
        within = f" in the first {until_min:g} min" if until_min is not None else ""
        return "too_short", f"{count} readings{within}; at least {FEWEST_READINGS} are needed", count
    if float(np.ptp(sensor.reading[:count])) == 0.0:
        return "constant", f"every reading is {sensor.reading[0]:g} degC: is the probe connected?", count
    return None


def _record(
    blank: IdentifyRecord,
    sensor: Sensor,
    estimate: Estimate,
    track: Track,
    count: int,
    notes: list[str],
    paces: Sequence[Pace],
) -> IdentifyRecord:
    time, reading = sensor.time, sensor.reading
    steady, t95 = estimate.steady_state_interval, estimate.t95_interval
    initial = estimate.initial
    measured = measured_equilibrium(time, reading)
    ahead, against = None, None
    if count < len(time) and estimate.rate is not None:
        kept = spike_weights(reading, sensor.resolution)[count:] > 0.0
        later = time[count:][kept]
        error = reading[count:][kept] - estimate.free_run(later)
        ahead = math.sqrt(float(np.mean(error**2))) if len(error) else None
        if len(error):
            against = estimate.contradicted_by(later, error)
    status, messages = _verdict(estimate, track, sensor)
    if against is not None:
        status = "model_doubtful" if status == "ok" else status
        messages.insert(0, words(against, float(time[count - 1])))
    to_go = remaining(estimate, max(estimate.time - (blank.start_min or 0.0), 0.0), paces)
    return replace(
        blank,
        initial_c=finite(initial),
        steady_state_c=finite(estimate.steady_state),
        steady_state_lo_c=finite(steady.low),
        steady_state_hi_c=finite(steady.high),
        steady_state_limit_c=finite(estimate.limit),
        steady_state_measured_c=measured[0] if measured else None,
        t95_min=finite(estimate.t95),
        t95_lo_min=finite(t95.low),
        t95_hi_min=finite(t95.high),
        t95_measured_min=measured[1] if measured else None,
        time_to_go_min=to_go.median,
        time_to_go_lo_min=to_go.low,
        time_to_go_hi_min=to_go.high,
        rate_per_min=finite(estimate.rate),
        noise_c=finite(estimate.noise),
        rmse_fit_c=finite(estimate.misfit),
        rmse_ahead_c=finite(ahead),
        status=status,
        message=_joined([*messages, *sensor.notes, *notes]),
    )


def remaining(estimate: Estimate, elapsed: float, paces: Sequence[Pace] = ()) -> TimeToGo:
    """Minutes from the last reading used until 95 % of the rise is done for good, `elapsed` [min] after its start.

    Where one curve holds from the start on, what is left is t95 less what has passed. Where the filter has forgotten its past,
    the start is a reading of its own, and the time is the first passage of the state's curve into the band around its steady state.
    """
    if estimate.t95 is None:
        return TimeToGo(None, None, None)
    if estimate.faded:
        return time_to_go(estimate.state, estimate.covariance, estimate.initial, paces=paces)
    sides = estimate.t95_interval.low, estimate.t95, estimate.t95_interval.high
    low, median, high = (clock_time(max(v - elapsed, 0.0), paces) if v is not None else None for v in sides)
    return TimeToGo(low, median, high)


def _verdict(estimate: Estimate, track: Track, sensor: Sensor) -> tuple[str, list[str]]:
    """Status and what to say: how far the numbers can be trusted."""
    messages = doubts(estimate, track, sensor)
    status = "model_doubtful" if messages else "ok"
    out = int((estimate.weights == 0.0).sum())
    if out:
        messages.append(f"{out} outlier{'s' if out > 1 else ''} left out")
    unsure = _too_wide(estimate)
    if unsure and estimate.bounded:
        status = "not_determined"
        messages.insert(0, f"the steady state is known only to within {unsure:.3g} K, many times the rise so far; measure longer")
    if not estimate.bounded:
        status = "not_determined"
        sides = estimate.steady_state_interval
        if estimate.steady_state is None:
            messages.insert(0, "no bend is seen yet: the steady state cannot be told; measure longer")
        elif sides.low is None or sides.high is None:
            messages.insert(0, "these readings do not bound the steady state on one side; measure longer")
        else:
            messages.insert(0, "these readings do not bound the settling time on one side; measure longer")
    return status, messages


def doubts(estimate: Estimate, track: Track, sensor: Sensor) -> list[str]:
    """Why the base model does not fit, in words; empty where nothing speaks against it."""
    # A misfit smaller than the logger's step is its rounding, and one of the last digit is the computer's.
    least = max(0.5 * sensor.resolution, 1e-9 * float(np.abs(sensor.reading).max()))
    if estimate.faded:
        when = sensor.time[int(np.argmax(track.fading > 1.0))]
        return [
            f"the base model fails from about {when:.4g} min on and the filter forgets what was before; "
            "the interval is that of its last readings and may be too narrow"
        ]
    if (estimate.pattern_p < DOUBT or estimate.too_large) and estimate.misfit > least:
        return [
            f"the readings leave the base model in a pattern ({estimate.misfit:.2g} K rms): "
            "the interval does not cover what the model lacks"
        ]
    return []


def _too_wide(estimate: Estimate) -> float | None:
    """Width [K] of the steady state's interval where it is no knowledge: several times the rise seen so far."""
    low, high = estimate.steady_state_interval.low, estimate.steady_state_interval.high
    if low is None or high is None:
        return None
    seen = abs(float(estimate.state[0]) - estimate.initial)
    return high - low if high - low > WIDEST * max(seen, 4.0 * estimate.noise) else None


def trace_columns(model: Model, track: Track, time: Array, reading: Array) -> dict[str, Array]:
    """Per reading (n,): the paper's convergence figures; nan before the filter has started."""
    n = len(time)
    temperature, rate, steady = (np.full(n, np.nan) for _ in range(3))
    deviations = np.full((n, 3), np.nan)
    for k in range(min(track.first, n), n):
        t, s, b = model.curve_state(track.state[k])
        temperature[k], rate[k], steady[k] = t, b, t + s / b if b != 0.0 else np.nan
        deviations[k] = model.deviations(track.state[k], track.covariance[k] * track.noise_variance[k])
    return {
        "time_min": time,
        "reading_c": reading,
        "temperature_c": temperature,
        "temperature_sd_c": deviations[:, 0],
        "rate_per_min": rate,
        "rate_sd_per_min": deviations[:, 1],
        "steady_state_c": steady,
        "steady_state_sd_c": deviations[:, 2],
        "innovation_c": track.innovation,
        "fading": track.fading,
        "process_noise_k2": track.process_noise,
        "measurement_noise_k2": track.noise_variance * track.noise_factor,
        "weight": track.weight,
    }


def _curves(
    record: IdentifyRecord, sensor: Sensor, estimate: Estimate, trace: dict[str, Array] | None, count: int, until_min: float | None
) -> Curves:
    end = float(sensor.time[-1])
    if count == len(sensor.time) and estimate.t95 is not None:
        end = min(max(end, 1.1 * estimate.t95), 5.0 * end)
    grid = np.linspace(float(sensor.time[0]), end, 300)
    low, high = estimate.band(grid)
    until = float(sensor.time[count - 1]) if until_min is None else until_min
    start = record.start_min or 0.0
    return Curves(
        record.run,
        record.channel,
        sensor.time,
        sensor.reading,
        grid,
        estimate.free_run(grid),
        low,
        high,
        until,
        *marks(record, start),
        trace or {},
    )


def marks(record: IdentifyRecord, start_min: float) -> tuple[str, float | None, float | None]:
    """(note, steady state [degC], time [min] at which 95 % is done) for a picture; no number over what is not determined."""
    if record.status == "not_determined" or record.steady_state_c is None:
        return "not determined", None, None
    low, high = record.steady_state_lo_c, record.steady_state_hi_c
    around = f" ({low:.2f}..{high:.2f})" if low is not None and high is not None else ""
    doubt = ", model doubtful" if record.status == "model_doubtful" else ""
    done = record.t95_min + start_min if record.t95_min is not None else None
    return f"settles at {record.steady_state_c:.2f} °C{around}{doubt}", record.steady_state_c, done


def _joined(messages: list[Any]) -> str:
    return "; ".join(str(m) for m in messages if m)
