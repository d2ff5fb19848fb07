"""From one sensor's readings to one record of ``identify``. Pure: arrays in, records out."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Afukf, Filter, Track, Tracks
from thermofast.filters.joint import track_together
from thermofast.models import spike_weights
from thermofast.models.uncertainty.first_passage import Pace, TimeToGo, clock_time, time_to_go

from ..records import IdentifyRecord
from .closing import estimates_of, track_of, tracks_of
from .contradiction import contradicts, words
from .estimate import Estimate, Estimates, FilterError, Model
from .measured import measured_equilibria
from .rules import RULES
from .sensor import Sensor, Sensors, prepare_all

Array = NDArray[np.float64]


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


def identify_sensors(
    run: str,
    channels: Sequence[str],
    time_min: Array,
    values: Array,
    method: Method,
    until_min: float | None = None,
    start_min: float = 0.0,
    notes: Sequence[str] = (),
    want_trace: bool = False,
    together: bool = False,
) -> list[Identified]:
    """Records of S sensors from their readings values (S, N) [degC], nan for none, at time_min (N,).

    Trouble with a sensor is a status in its record, never an exception. ``together``: one adaptive fading filter over all of them.

    Raises
    ------
    TypeError: together, and the filter is not the AFUKF.
    """
    if together and not isinstance(method.filter, Afukf):
        raise TypeError(f"one filter over all sensors is the AFUKF, not {method.filter.name}")
    name = f"{method.filter.name} (joint)" if together else method.filter.name
    notes = tuple(notes) or ("",) * len(channels)
    found: list[Identified | None] = [None] * len(channels)
    blocks: list[Sensors] = []
    for block in prepare_all(time_min, values, start_min):
        keep = np.ones(len(block), dtype=bool)
        for i in block.maybe_refused(until_min, RULES.fewest_readings):
            row, refused = block.rows[i], refusal(block.one(i), until_min)
            if refused is not None:
                status, why, samples = refused
                message = _joined([why, notes[row]])
                record = IdentifyRecord(run, channels[row], name, until_min, samples, start_min, status=status, message=message)
                found[row], keep[i] = Identified(record), False
        if keep.any():
            blocks.append(block if keep.all() else block.some(keep))
    shared = _tracks_together(method, blocks, until_min) if together else {}
    for block in blocks:
        job = _Block(run, channels, name, method, block, until_min, start_min, time_min, notes, want_trace)
        for row, one in zip(block.rows, job.identified(shared), strict=True):
            found[row] = one
    return [one for one in found if one is not None]


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
    """As :func:`identify_sensors` for one sensor, values (N,)."""
    return identify_sensors(run, (channel,), time_min, values[None], method, until_min, start_min, (note,), want_trace)[0]


def _tracks_together(method: Method, blocks: Sequence[Sensors], until_min: float | None) -> dict[int, Track]:
    """Track of every row under one filter over all of them."""
    assert isinstance(method.filter, Afukf)
    records, rows = [], []
    for block in blocks:
        n = block.until(until_min)
        records += [(block.time[:n], r[:n], float(step)) for r, step in zip(block.reading, block.resolution, strict=True)]
        rows += block.rows.tolist()
    tracks = track_together(method.model, method.filter.moments, method.filter.fading_rule, records)
    return dict(zip(rows, tracks, strict=True))


@dataclass(frozen=True)
class _Block:
    """Sensors of one run on one grid, on their way from readings to records."""

    run: str
    channels: Sequence[str]
    filter: str
    method: Method
    sensors: Sensors
    until_min: float | None
    start_min: float
    time_min: Array
    notes: Sequence[str]
    want_trace: bool

    @property
    def count(self) -> int:
        return self.sensors.until(self.until_min)

    def identified(self, shared: dict[int, Track]) -> list[Identified]:
        """Of every sensor; `shared` holds the tracks by row where one filter has run over all."""
        tracks, single, failed = self._tracks(shared)
        if tracks is None:
            return [self._diverged(i, failed[i]) for i in range(len(self.sensors))]
        broken = {i: self._broke_at(int(k)) for i, k in enumerate(tracks.diverged_at) if k >= 0}
        broken |= failed
        n, sensors = self.count, self.sensors
        time, reading = sensors.time[:n], sensors.reading[:, :n]
        found = estimates_of(self.method.model, self.method.filter, tracks, time, reading, sensors.resolution, single)
        records = self._records(found, tracks, broken)
        if not self.want_trace:
            return [Identified(r) for r in records]
        return [self._with_pictures(i, r, found, single) if i not in broken else Identified(r) for i, r in enumerate(records)]

    def _tracks(self, shared: dict[int, Track]) -> tuple[Tracks | None, Callable[[int], Track], dict[int, str]]:
        """What the filter makes of all; a sensor's whole track, where it is asked for; and why it could not run on some."""
        sensors, method, n = self.sensors, self.method, self.count
        time, reading = sensors.time[:n], sensors.reading[:, :n]
        known: dict[int, Track] = {i: shared[row] for i, row in enumerate(sensors.rows.tolist()) if row in shared}

        def single(i: int) -> Track:
            if i not in known:
                known[i] = track_of(method.filter, method.model, time, reading[i], float(sensors.resolution[i]))
            return known[i]

        if not known and not self.want_trace:
            tracks = tracks_of(method.filter, method.model, time, reading, sensors.resolution)
            if tracks is not None:
                return tracks, single, {}
        failed: dict[int, str] = {}
        for i in range(len(sensors)):
            try:
                single(i)
            except FilterError as error:
                failed[i] = str(error)
        if not known:
            return None, single, failed
        some = next(iter(known.values()))
        tracks = Tracks.of([known.get(i, replace(some, diverged_at=0)) for i in range(len(sensors))])
        return tracks, single, failed

    def _broke_at(self, k: int) -> str:
        return f"the filter diverged at reading {k + 1}, {self.sensors.time[k]:.4g} min"

    def _diverged(self, i: int, why: str) -> Identified:
        row = self.sensors.rows[i]
        message = _joined([why, self.notes[row]])
        blank = IdentifyRecord(self.run, self.channels[row], self.filter, self.until_min, self.count, self.start_min)
        return Identified(replace(blank, status="diverged", message=message))

    def _records(self, found: Estimates, tracks: Tracks, broken: dict[int, str]) -> list[IdentifyRecord]:
        sensors, n = self.sensors, self.count
        steady, settled = measured_equilibria(sensors.time, sensors.reading)
        ahead, against = self._ahead(found)
        status, messages = _verdicts(found, tracks, sensors, against, float(sensors.time[n - 1]))
        elapsed = max(found.time - self.start_min, 0.0)
        to_go = [np.maximum(side - elapsed, 0.0) for side in (found.t95, found.t95_low, found.t95_high)]
        for k in np.flatnonzero(found.faded if not self.method.paces else np.isfinite(found.t95)).tolist():
            left = remaining(found.one(k), elapsed, self.method.paces)
            for side, value in zip(to_go, (left.median, left.low, left.high), strict=True):
                side[k] = math.nan if value is None else value
        for side in to_go:
            side[np.isnan(found.t95)] = math.nan
        numbers = {
            "initial_c": found.initial,
            "steady_state_c": found.steady_state,
            "steady_state_lo_c": found.steady_low,
            "steady_state_hi_c": found.steady_high,
            "steady_state_limit_c": found.limit,
            "steady_state_measured_c": steady,
            "t95_min": found.t95,
            "t95_lo_min": found.t95_low,
            "t95_hi_min": found.t95_high,
            "t95_measured_min": settled,
            "time_to_go_min": to_go[0],
            "time_to_go_lo_min": to_go[1],
            "time_to_go_hi_min": to_go[2],
            "rate_per_min": found.rate,
            "noise_c": found.noise,
            "rmse_fit_c": found.misfit,
            "rmse_ahead_c": ahead,
        }
        columns = [_or_none(column) for column in numbers.values()]
        until = self.until_min if self.until_min is not None else float(self.time_min[-1] - self.time_min[0])
        records: list[IdentifyRecord] = []
        for i, (row, values) in enumerate(zip(sensors.rows.tolist(), zip(*columns, strict=True), strict=True)):
            if i in broken:
                records.append(replace(self._diverged(i, broken[i]).record, until_min=until))
                continue
            message = _joined([*messages.get(i, ()), *sensors.notes[i], self.notes[row]])
            told: dict[str, Any] = dict(zip(numbers, values, strict=True))
            head = self.run, self.channels[row], self.filter, until, n, self.start_min
            records.append(IdentifyRecord(*head, **told, status=status[i], message=message))
        return records

    def _ahead(self, found: Estimates) -> tuple[Array, dict[int, float]]:
        """RMS error [K] (S,) on the readings ahead, and by how much [K] those of some sensors contradict what was said of them."""
        sensors, n = self.sensors, self.count
        ahead = np.full(len(sensors), np.nan)
        told = np.isfinite(found.rate)
        if n == len(sensors.time) or not told.any():
            return ahead, {}
        later = sensors.time[n:]
        kept = spike_weights(sensors.reading, sensors.resolution)[:, n:] > 0.0
        error = np.where(kept & told[:, None], sensors.reading[:, n:] - found.free_run(later), np.nan)
        number = np.isfinite(error).sum(axis=1)
        told &= number > 0
        ahead[told] = np.sqrt(np.nansum(error[told] ** 2, axis=1) / number[told])
        half = found.band_from_tangent(later)
        against = {}
        # The covariance alone costs little; what it finds is looked at again with the curved band of draws.
        for i in np.flatnonzero(told & contradicts(error, half, found.noise)):
            good = np.isfinite(error[i])
            size = found.one(int(i)).contradicted_by(later[good], error[i][good], half[i][good])
            if size is not None:
                against[int(i)] = size
        return ahead, against

    def _with_pictures(self, i: int, record: IdentifyRecord, found: Estimates, single: Callable[[int], Track]) -> Identified:
        sensor, n = self.sensors.one(i), self.count
        trace = trace_columns(self.method.model, single(i), sensor.time[:n], sensor.reading[:n])
        return Identified(record, trace, _curves(record, sensor, found.one(i), trace, n, self.until_min))


def _or_none(column: Array) -> list[float | None]:
    """Numbers, None for what is none."""
    return [v if math.isfinite(v) else None for v in column.tolist()]


def refusal(sensor: Sensor, until_min: float | None) -> tuple[str, str, int] | None:
    """(status, message, readings) where a sensor gives nothing to identify, else None."""
    count = sensor.until(until_min)
    if not len(sensor.reading):
        return "no_data", "no reading in this column", 0
    if count < RULES.fewest_readings:
        within = f" in the first {until_min:g} min" if until_min is not None else ""
        return "too_short", f"{count} readings{within}; at least {RULES.fewest_readings} are needed", count
    if float(np.ptp(sensor.reading[:count])) == 0.0:
        return "constant", f"every reading is {sensor.reading[0]:g} degC: is the probe connected?", count
    return None


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


def _verdicts(
    found: Estimates, tracks: Tracks, sensors: Sensors, against: dict[int, float], until: float
) -> tuple[list[str], dict[int, list[str]]]:
    """Status of each sensor, and of some what to say: how far the numbers can be trusted."""
    bounded, seen = found.bounded, np.abs(found.state[:, 0] - found.initial)
    with np.errstate(invalid="ignore"):
        width = found.steady_high - found.steady_low
        too_wide = width > RULES.widest * np.maximum(seen, 4.0 * found.noise)
        largest = np.abs(sensors.reading).max(axis=1)
        doubted = found.faded | _misfits(found.pattern_p, found.too_large, found.misfit, sensors.resolution, largest)
    out = (found.weights == 0.0).sum(axis=1)
    status = np.where(~bounded | too_wide, "not_determined", np.where(doubted, "model_doubtful", "ok")).tolist()
    messages: dict[int, list[str]] = {}
    for i in np.flatnonzero(~bounded | too_wide | doubted | (out > 0)).tolist():
        said = doubts(found.one(i), int(tracks.woke[i]), sensors.one(i))
        if out[i]:
            said.append(f"{out[i]} outlier{'s' if out[i] > 1 else ''} left out")
        if not bounded[i]:
            said.insert(0, _open_side(found.one(i)))
        elif too_wide[i]:
            unsure = "the steady state is known only to within"
            said.insert(0, f"{unsure} {width[i]:.3g} K, many times the rise so far; measure longer")
        messages[i] = said
    for i, size in against.items():
        status[i] = "model_doubtful" if status[i] == "ok" else status[i]
        messages[i] = [words(size, until), *messages.get(i, [])]
    return status, messages


def _open_side(estimate: Estimate) -> str:
    sides = estimate.steady_state_interval
    if estimate.steady_state is None:
        return "no bend is seen yet: the steady state cannot be told; measure longer"
    if sides.low is None or sides.high is None:
        return "these readings do not bound the steady state on one side; measure longer"
    return "these readings do not bound the settling time on one side; measure longer"


def _misfits(pattern_p: Any, too_large: Any, misfit: Any, resolution: Any, largest: Any) -> Any:
    """Whether residuals are more than noise; broadcasts. largest: the largest reading by amount [degC]."""
    # A misfit smaller than the logger's step is its rounding, and one of the last digit is the computer's.
    return ((pattern_p < RULES.doubt) | too_large) & (misfit > np.maximum(0.5 * resolution, 1e-9 * largest))


def doubts(estimate: Estimate, woke: int, sensor: Sensor) -> list[str]:
    """Why the base model does not fit, in words; empty where nothing speaks against it.

    woke: the reading at which the filter began to fade.
    """
    if estimate.faded:
        return [
            f"the base model fails from about {sensor.time[woke]:.4g} min on and the filter forgets what was before; "
            "the interval is that of its last readings and may be too narrow"
        ]
    largest = float(np.abs(sensor.reading).max())
    if _misfits(estimate.pattern_p, estimate.too_large, estimate.misfit, sensor.resolution, largest):
        return [
            f"the readings leave the base model in a pattern ({estimate.misfit:.2g} K rms): "
            "the interval does not cover what the model lacks"
        ]
    return []


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
