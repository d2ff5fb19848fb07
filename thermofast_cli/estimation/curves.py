"""What a picture of an identified sensor shows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Track

from ..records import IdentifyRecord
from .estimate import Claims, Estimate, Model
from .sensor import Sensor

Array = NDArray[np.float64]


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


def marks(record: IdentifyRecord, start_min: float, room_c: float | None = None) -> tuple[str, float | None, float | None]:
    """(note, steady state [degC], time [min] at which 95 % is done) for a picture; no number over what is not determined.

    room_c [degC] is that at the last reading used, in which the steady state holds, where one was logged.
    """
    if record.status == "not_determined" or record.steady_state_c is None:
        return "not determined", None, None
    low, high = record.steady_state_lo_c, record.steady_state_hi_c
    around = f" ({low:.2f}..{high:.2f})" if low is not None and high is not None else ""
    doubt = ", model doubtful" if record.status == "model_doubtful" else ""
    done = record.t95_min + start_min if record.t95_min is not None else None
    room = f" in a room of {room_c:.1f} °C" if room_c is not None else ""
    when = f", from {record.until_min:.4g} min" if record.until_min is not None else ""
    return f"settles at {record.steady_state_c:.2f} °C{around}{room}{when}{doubt}", record.steady_state_c, done


def drawn_to(begin: float, end: float, t95: float) -> float:
    """Until when a rise is drawn [min of the run]: until it has settled, or five times as long as it was read."""
    return begin + min(max(end - begin, 1.1 * t95), 5.0 * (end - begin))


def curves_of(
    record: IdentifyRecord,
    sensor: Sensor,
    estimate: Estimate,
    trace: dict[str, Array] | None,
    count: int,
    until_min: float | None,
    claimed: Claims | None = None,
    row: int = 0,
    room_c: float | None = None,
) -> Curves:
    """The measured readings, and the model with its band over them, or on until it has settled where all of them were used.

    count: readings used; claimed, row: what may be claimed of the sensor, where the machine is counted; room_c [degC]: the room at
    the last of them, where it is logged.
    """
    begin, end = float(sensor.time[0]), float(sensor.time[-1])
    if count == len(sensor.time) and estimate.t95 is not None:
        end = drawn_to(begin, end, estimate.t95)
    grid = np.linspace(begin, end, 300)
    curve = estimate.free_run(grid)
    if claimed is not None and claimed.held[row]:
        low, curve, high = (side[row] for side in claimed.curves(grid, drawn=True))
    else:
        low, high = estimate.band(grid)
    until = float(sensor.time[count - 1]) if until_min is None else until_min
    start = record.start_min or 0.0
    return Curves(
        record.run,
        record.channel,
        sensor.time,
        sensor.reading,
        grid,
        curve,
        low,
        high,
        until,
        *marks(record, start, room_c),
        trace or {},
    )


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
