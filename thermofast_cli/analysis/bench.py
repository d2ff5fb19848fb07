"""``filters bench``: every filter on the user's own record, and which one to use there."""

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Afukf, Filter, Track
from thermofast.filters.joint import track_together
from thermofast.models import Lump, spike_weights

from ..estimation.closing import estimate_at, track_of
from ..estimation.estimate import Estimate, FilterError
from ..estimation.rules import RULES
from ..estimation.sensor import Sensor, prepare
from ..reading import Run
from ..records import BenchRecord, finite

Array = NDArray[np.float64]

#: Filters whose error ahead is within this share of the chosen one's are told beside it.
AS_GOOD = 0.10
#: A default whose error is this many times another's is left, however few the sensors.
FAR = 2.0
#: Chance of leaving the default where nothing is better.
ALARM = 0.05
FEWEST_SENSORS = 3
DEFAULT = "afukf"


@dataclass(frozen=True)
class Trial:
    """A filter's record and its error ahead on each sensor (S,) [K]; closes: whether ``identify`` counts the machine beside it."""

    record: BenchRecord
    ahead: Array
    closes: bool = True


def bench_run(
    run: Run,
    start_min: float,
    until_min: float | None,
    known: dict[str, type[Filter]],
    advance: Callable[[int], None] = lambda _: None,
) -> list[BenchRecord]:
    """One record per filter for a run identified on its first `until_min` minutes, half of it by default.

    advance is told each filter that is done.
    """
    minutes = run.time_s / 60.0
    until = until_min if until_min is not None else 0.5 * float(minutes[-1] - start_min) + start_min
    sensors = [prepare(minutes, values, start_min) for values in run.channels.values()]
    sensors = [s for s in sensors if s.until(until) >= RULES.fewest_readings and float(np.ptp(s.reading[: s.until(until)])) > 0.0]
    blank = BenchRecord(run.name, "", until_min=until, sensors=len(sensors))
    if not sensors:
        return [
            replace(blank, status="no_data", message=f"no sensor has {RULES.fewest_readings} moving readings before {until:g} min")
        ]
    trials = []
    for name, kind in known.items():
        trials.append(_bench(replace(blank, filter=name), kind(), sensors, until, False))
        advance(1)
    if len(sensors) > 1:
        trials.append(_bench(replace(blank, filter="afukf (joint)"), Afukf(), sensors, until, True))
    return choose_among(trials)


def _bench(blank: BenchRecord, method: Filter, sensors: list[Sensor], until: float, together: bool) -> Trial:
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
                tracks.append(track_of(method, model, *record))
            except FilterError as error:
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
    inside = [e.misfit for e, _, _ in good if math.isfinite(e.misfit)]
    ahead = [_error(e, s, n, len(s.time)) for e, s, n in good]
    widths = [_width(e) for e, _, _ in good]
    known = [w for w in widths if w is not None]
    broken = len(sensors) - len(good)
    told = replace(
        blank,
        broken=broken,
        undetermined=len(widths) - len(known),
        rmse_fit_c=finite(math.sqrt(float(np.mean(np.square(inside))))) if inside else None,
        rmse_ahead_c=_pooled(ahead),
        width_c=float(np.median(known)) if known else None,
        steps_per_s=float(f"{sum(cut) / max(spent, 1e-9):.3g}"),
        status="diverged" if broken == len(sensors) else "ok",
        message=why or (f"broke on {broken} of {len(sensors)} sensors" if broken else ""),
    )
    # By sensor, nan where the filter broke: only what both filters of a pair did is compared.
    by_sensor = np.full(len(sensors), np.nan)
    by_sensor[[i for i, e in enumerate(estimates) if e is not None]] = [
        math.sqrt(float(np.mean(e**2))) if len(e) else np.nan for e in ahead
    ]
    return Trial(told, by_sensor, method.closing != "never")


def _error(estimate: Estimate, sensor: Sensor, first: int, last: int) -> Array:
    """Free run minus readings first..last [K], outliers left out; empty where the estimate tells no steady state."""
    kept = spike_weights(sensor.reading, sensor.resolution)[first:last] > 0.0
    if not kept.any() or not np.isfinite(estimate.state).all() or estimate.steady_state is None:
        return np.empty(0)
    return np.asarray(estimate.free_run(sensor.time[first:last])[kept] - sensor.reading[first:last][kept])


def _width(estimate: Estimate) -> float | None:
    sides = estimate.steady_state_interval
    return sides.high - sides.low if sides.low is not None and sides.high is not None else None


def _pooled(errors: list[Array]) -> float | None:
    whole = np.concatenate(errors) if errors else np.empty(0)
    return finite(math.sqrt(float(np.mean(whole**2)))) if len(whole) else None


def choose_among(trials: list[Trial]) -> list[BenchRecord]:
    """Records with the one filter marked that is to be used, and why.

    The default stays unless another filter is better over the sensors by a paired t test on the logarithms of their errors
    ahead, with room for how many filters are compared: one record's luck is no reason to change.
    """
    sound = {t.record.filter: t for t in trials if t.record.broken == 0 and t.record.rmse_ahead_c is not None}
    if not sound:
        advice = "no filter came through on every sensor: see thermofast compare"
        return [replace(t.record, message="; ".join(m for m in (t.record.message, advice) if m)) for t in trials]
    if DEFAULT in sound:
        base = sound[DEFAULT]
        level = ALARM / max(1, len(sound) - 1)
        better = [t for t in sound.values() if clearly_better(t.ahead, base.ahead, level) or _far_below(t.ahead, base.ahead)]
        best = min(better, key=_size) if better else base
        why = f"use it here: error ahead of its own curve {_size(best):.3g} K"
        why += (
            f", clearly below that of {DEFAULT} ({_size(base):.3g} K)"
            if better
            else "; no filter is clearly better over the sensors"
        )
    else:
        best = min(sound.values(), key=_size)
        why = (
            f"use it here: error ahead of its own curve {_size(best):.3g} K, the least of those that came through; {DEFAULT} broke"
        )
    others = [t.record.filter for t in sound.values() if t is not best and abs(_size(t) / _size(best) - 1.0) <= AS_GOOD]
    if others:
        why += f"; within {100 * AS_GOOD:.0f} %: {', '.join(others)}"
    if best.record.filter != DEFAULT and best.closes:
        why += f"; identify counts the machine beside the curve: what it says differs little from that of {DEFAULT}"
    if best.record.filter == DEFAULT:
        why += "; it also leaves outliers out and tells when the model fails"
    return [replace(t.record, chosen=True, message=why) if t is best else t.record for t in trials]


def _size(trial: Trial) -> float:
    return trial.record.rmse_ahead_c if trial.record.rmse_ahead_c is not None else math.inf


def _far_below(own: Array, other: Array) -> bool:
    """Whether errors own (S,) are far below those of another filter, over the sensors of which both tell where they settle."""
    both = np.isfinite(own) & np.isfinite(other)
    return bool(both.any() and FAR * math.sqrt(float(np.mean(own[both] ** 2))) < math.sqrt(float(np.mean(other[both] ** 2))))


def clearly_better(own: Array, other: Array, level: float) -> bool:
    """Whether errors own (S,) are below those of another filter on the same sensors, at a one-sided level."""
    both = np.isfinite(own) & np.isfinite(other) & (own > 0.0) & (other > 0.0)
    if int(both.sum()) < FEWEST_SENSORS:
        return False
    gain = np.log(other[both] / own[both])
    spread = float(gain.std(ddof=1)) / math.sqrt(len(gain))
    if not spread > 0.0:
        return bool(gain[0] > 0.0)
    from scipy.special import stdtr

    return bool(stdtr(len(gain) - 1, -float(gain.mean()) / spread) < level)
