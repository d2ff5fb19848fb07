"""From one sensor's readings to the records of ``sweep``: the paper's search for the shortest identification time (section 1.5)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import growth, spike_weights

from ..records import SweepRecord
from .closing import Progress, estimate_at, estimates_at, track_of
from .estimate import FEWEST_READINGS, FilterError
from .identify import Method, doubts, refusal
from .sensor import prepare

Array = NDArray[np.float64]

AGREED_MIN = 5.0


@dataclass(frozen=True)
class Swept:
    """records, one per window; rmse (windows, times) [K] over times (times,) [min], nan where a time does not count."""

    records: tuple[SweepRecord, ...]
    times: Array
    rmse: Array
    width: Array


def sweep_sensor(
    run: str,
    channel: str,
    time_min: Array,
    values: Array,
    method: Method,
    windows: tuple[float, ...],
    times: tuple[float, ...],
    tolerance_c: float,
    start_min: float = 0.0,
    note: str = "",
) -> Swept:
    """RMSE (38) of the model over each window against identification time, from one filter pass.

    The result at time I is that of ``identify --until I``: every state and every likelihood rests on the readings up to I alone.
    windows and times [min] are ascending; only times below a window count for it.
    """
    sensor = prepare(time_min, values, start_min)
    blank = tuple(SweepRecord(run, channel, method.filter.name, window_min=w) for w in windows)
    nothing = np.full((len(windows), len(times)), np.nan)
    grid = np.array(times)
    refused = refusal(sensor, windows[-1])
    if refused:
        failed = tuple(replace(b, status=refused[0], message="; ".join(m for m in (refused[1], note) if m)) for b in blank)
        return Swept(failed, grid, nothing, nothing[0])
    count = sensor.until(max(windows[-1], times[-1]))
    time, reading = sensor.time[:count], sensor.reading[:count]
    try:
        track = track_of(method.filter, method.model, time, reading, sensor.resolution)
    except FilterError as error:
        failed = tuple(replace(b, status="diverged", message=str(error)) for b in blank)
        return Swept(failed, grid, nothing, nothing[0])
    rmse, width = nothing.copy(), np.full(len(times), np.nan)
    ends = [min(sensor.until(w), count) for w in windows]
    last = np.searchsorted(time, grid * (1 + 1e-12) + 1e-9, "right") - 1
    broken = track.diverged_at if track.diverged_at is not None else count
    moved = np.flatnonzero(reading != reading[0])
    least = max(FEWEST_READINGS - 1, int(moved[0]) if len(moved) else count)
    usable = [i for i, k in enumerate(last) if least <= k < broken]
    indices = [int(last[i]) for i in usable]
    doubted: list[str] = []
    if usable:
        progress = estimates_at(method.model, method.filter, track, time, reading, indices, sensor.resolution, tolerance_c)
        # An outlier says nothing about the model: it counts in no window.
        kept = spike_weights(reading, sensor.resolution) > 0.0
        squares = np.cumsum(window_errors(progress, indices, track.state, time, reading) ** 2 * kept, axis=1)
        counts = np.cumsum(kept)
        for j, (window, end) in enumerate(zip(windows, ends, strict=True)):
            if end > 1 and counts[end - 1] > 1:
                rmse[j, usable] = np.sqrt(squares[:, end - 1] / (counts[end - 1] - 1))
            rmse[j, grid >= window - 1e-9] = np.nan
        width[usable] = progress.width
        if not progress.sound:
            last_one = estimate_at(method.model, method.filter, track, time, reading, indices[-1], sensor.resolution)
            doubted = doubts(last_one, int(np.argmax(track.fading > 1.0)), sensor)
    return Swept(
        sweep_records(blank, doubted, [*sensor.notes, note], windows, grid, rmse, width, ends, tolerance_c), grid, rmse, width
    )


def window_errors(progress: Progress, indices: list[int], states: Array, time: Array, reading: Array) -> Array:
    """Model minus reading (m, n) [K] over all readings: the free run both ways from reading indices[i].

    Where the filter has forgotten its past, its own track stands for the readings up to then, as in the paper's figures.
    """
    since = time - time[indices][:, None]
    model = progress.state[:, :1] + progress.state[:, 1:2] * growth(progress.state[:, 2:], since)
    for i in np.flatnonzero(progress.faded):
        k = indices[i]
        tracked = np.isfinite(states[: k + 1, 0])
        model[i, : k + 1] = np.where(tracked, states[: k + 1, 0], reading[: k + 1])
    errors: Array = model - reading
    return errors


def sweep_records(
    blank: tuple[SweepRecord, ...],
    doubted: list[str],
    notes: list[str],
    windows: tuple[float, ...],
    times: Array,
    rmse: Array,
    width: Array,
    ends: list[int],
    tolerance_c: float,
) -> tuple[SweepRecord, ...]:
    """Records of one sensor from its errors rmse (windows, times) [K] and widths (times,) [K] by docs/architecture.md."""
    told = [m for m in (*doubted, *notes) if m]
    counted = np.isfinite(rmse)
    least = np.where(counted, rmse, np.inf)
    if not counted.any(axis=1).all():
        bad = [f"{w:g}" for w, row in zip(windows, counted, strict=True) if not row.any()]
        message = "; ".join([f"no identification time gave a model for the window of {', '.join(bad)} min", *told])
        return tuple(replace(b, status="diverged", message=message) for b in blank)
    best = least.argmin(axis=1)
    # From the earliest time on the RMSE stays within (1 + 2 / sqrt(2 N)) of its minimum.
    limit = least.min(axis=1) * (1.0 + 2.0 / np.sqrt(2.0 * np.array(ends)))
    outside = counted & (rmse > limit[:, None])
    after = np.where(outside.any(axis=1), outside.shape[1] - outside[:, ::-1].argmax(axis=1), 0)
    earliest = np.maximum(after, counted.argmax(axis=1))
    serves = [bool(row[k:].any()) for row, k in zip(counted, earliest, strict=True)]
    narrow = _from_there_on(width < tolerance_c)
    shown = []
    if narrow is None:
        finite = width[np.isfinite(width)]
        reached = f" (narrowest {finite.min():.2g} K)" if len(finite) and finite.min() > tolerance_c else ""
        shown.append(f"the steady state is not known to {tolerance_c:g} K at any of these times{reached}")
    shortest, agreed = None, None
    if all(serves):
        shortest = float(times[earliest.max()])
        agreed = shortest - float(times[earliest.min()]) <= AGREED_MIN + 1e-9
    else:
        none = ", ".join(f"{w:g}" for w, good in zip(windows, serves, strict=True) if not good)
        shown.insert(
            0,
            f"no time tried serves for the window of {none} min: at the last the error is above its least; say longer --times",
        )
    message = "; ".join([*shown, *told])
    tolerance_time = None if narrow is None else float(times[narrow])
    first = blank[0]
    return tuple(
        SweepRecord(
            run=first.run,
            channel=first.channel,
            filter=first.filter,
            window_min=window,
            best_time_min=float(times[best[j]]),
            rmse_c=float(rmse[j, best[j]]),
            earliest_time_min=float(times[earliest[j]]) if serves[j] else None,
            shortest_time_min=shortest,
            tolerance_time_min=tolerance_time,
            agreed=agreed,
            status="model_doubtful" if doubted else "ok",
            message=message,
        )
        for j, window in enumerate(windows)
    )


def _from_there_on(good: NDArray[np.bool_]) -> int | None:
    """First index from which all are true, or None."""
    bad = np.flatnonzero(~good)
    first = int(bad[-1]) + 1 if len(bad) else 0
    return first if first < len(good) else None
