"""``filters bench``: every filter on the user's own record, and which one to use there."""

import math
import time as clock
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from filters import Afukf, Filter, Track
from filters.joint import track_together
from models import Lump, spike_weights

from .estimate import FEWEST_READINGS, Estimate, estimate_at
from .reading import Run
from .records import BenchRecord, finite
from .sensor import Sensor, prepare

Array = NDArray[np.float64]

#: Filters whose error ahead is within this share of the least are as good.
AS_GOOD = 0.10
#: Order of preference among those: what a filter tells beside the estimate, then what it costs.
PREFERRED = ("afukf", "afukf (joint)")
DEFAULT = "afukf"


def bench_run(run: Run, start_min: float, until_min: float | None, known: dict[str, type[Filter]]) -> list[BenchRecord]:
    """One record per filter for a run identified on its first `until_min` minutes, half of it by default."""
    minutes = run.time_s / 60.0
    until = until_min if until_min is not None else 0.5 * float(minutes[-1] - start_min) + start_min
    sensors = [prepare(minutes, values, start_min) for values in run.channels.values()]
    sensors = [s for s in sensors if s.until(until) >= FEWEST_READINGS and float(np.ptp(s.reading[: s.until(until)])) > 0.0]
    blank = BenchRecord(run.name, "", until_min=until, sensors=len(sensors))
    if not sensors:
        return [replace(blank, status="no_data", message=f"no sensor has {FEWEST_READINGS} moving readings before {until:g} min")]
    records = [_bench(replace(blank, filter=name), kind(), sensors, until, False) for name, kind in known.items()]
    if len(sensors) > 1:
        records.append(_bench(replace(blank, filter="afukf (joint)"), Afukf(), sensors, until, True))
    return choose_among(records)


def _bench(blank: BenchRecord, method: Filter, sensors: list[Sensor], until: float, together: bool) -> BenchRecord:
    model = Lump()
    cut = [s.until(until) for s in sensors]
    records = [(s.time[:n], s.reading[:n], s.resolution) for s, n in zip(sensors, cut, strict=True)]
    began = clock.perf_counter()
    tracks: list[Track | None]
    why = ""
    if together:
        assert isinstance(method, Afukf)
        tracks = list(track_together(model, method.moments, method.fading_rule, records))
    else:
        tracks = []
        for record in records:
            try:
                tracks.append(method.track(model, *record))
            except ValueError as error:  # a filter that cannot run on this record says why
                tracks.append(None)
                why = str(error)
    spent = clock.perf_counter() - began
    estimates: list[Estimate | None] = []
    for track, (time, reading, resolution) in zip(tracks, records, strict=True):
        if track is not None and track.diverged_at is None:
            estimates.append(estimate_at(model, method, track, time, reading, len(time) - 1, resolution))
        else:
            estimates.append(None)
    good = [(e, s, n) for e, s, n in zip(estimates, sensors, cut, strict=True) if e is not None]
    inside = [_error(e, s, 0, n) for e, s, n in good]
    ahead = [_error(e, s, n, len(s.time)) for e, s, n in good]
    widths = [_width(e) for e, _, _ in good]
    known = [w for w in widths if w is not None]
    broken = len(sensors) - len(good)
    return replace(
        blank,
        broken=broken,
        undetermined=len(widths) - len(known),
        rmse_fit_c=_pooled(inside),
        rmse_ahead_c=_pooled(ahead),
        width_c=float(np.median(known)) if known else None,
        steps_per_s=float(f"{sum(cut) / max(spent, 1e-9):.3g}"),
        status="diverged" if broken == len(sensors) else "ok",
        message=why or (f"broke on {broken} of {len(sensors)} sensors" if broken else ""),
    )


def _error(estimate: Estimate, sensor: Sensor, first: int, last: int) -> Array:
    """Free run minus readings first..last [K], stray readings left out; empty where the estimate has no rate."""
    kept = spike_weights(sensor.reading, sensor.resolution)[first:last] > 0.0
    if not kept.any() or not np.isfinite(estimate.state).all():
        return np.empty(0)
    return np.asarray(estimate.free_run(sensor.time[first:last])[kept] - sensor.reading[first:last][kept])


def _width(estimate: Estimate) -> float | None:
    sides = estimate.steady_state_interval
    return sides.high - sides.low if sides.low is not None and sides.high is not None else None


def _pooled(errors: list[Array]) -> float | None:
    whole = np.concatenate(errors) if errors else np.empty(0)
    return finite(math.sqrt(float(np.mean(whole**2)))) if len(whole) else None


def choose_among(records: list[BenchRecord]) -> list[BenchRecord]:
    """The records with the one filter marked that is to be used, and why."""
    sound = [r for r in records if r.broken == 0 and r.rmse_ahead_c is not None]
    if not sound:
        advice = "no filter came through on every sensor: see thermofast compare"
        return [replace(r, message="; ".join(m for m in (r.message, advice) if m)) for r in records]
    least = min(r.rmse_ahead_c for r in sound if r.rmse_ahead_c is not None)
    close = [r for r in sound if r.rmse_ahead_c is not None and r.rmse_ahead_c <= (1.0 + AS_GOOD) * least]
    order = {name: i for i, name in enumerate(PREFERRED)}
    best = min(close, key=lambda r: (order.get(r.filter, len(order)), r.rmse_ahead_c, -(r.steps_per_s or 0.0)))
    others = [r.filter for r in close if r is not best]
    why = f"use it here: error ahead {best.rmse_ahead_c:.3g} K"
    if best.rmse_ahead_c is not None and best.rmse_ahead_c > least:
        why += f", within {100 * AS_GOOD:.0f} % of the least ({least:.3g} K)"
    if others:
        why += f"; as good: {', '.join(others)}"
        if best.filter in PREFERRED:
            why += "; this one also leaves stray readings out and tells when the model fails"
    return [replace(r, chosen=True, message=why) if r is best else r for r in records]
