"""What a picture of an identified sensor shows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Track

from ..records import IdentifyRecord
from .estimate import Claims, Estimate, Model
from .sensor import Sensor
from .verdicts import marks

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
