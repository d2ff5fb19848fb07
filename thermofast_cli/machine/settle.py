"""``identify`` and ``sweep`` with a learnt model: steady state and settling time with its effects in."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.joint import LEVEL, RATE, START, Fit, Key, Model
from thermofast.models.search.judge import sensor_p_values
from thermofast.models.search.rules import RULES

from ..discovery.loop import LoopTask, ids_of, in_order, ready
from ..errors import ThermofastError
from ..estimation.contradiction import contradiction, words
from ..estimation.identify import Curves, Identified
from ..estimation.measured import measured_equilibrium
from ..estimation.sweep import Swept, sweep_records
from ..estimation.verdicts import marks
from ..records import IdentifyRecord, SweepRecord, finite
from .learnt import carry

Array = NDArray[np.float64]

NAME = "joint_fit"
DRAWS = 200
#: The free run goes on for this many of the slowest time constants.
HORIZON = 12.0
POINTS = 1200


def identify_with_model(task: LoopTask) -> list[list[Identified]]:
    """A run's sensors identified with a learnt model; whatever is wrong with the run is a record."""
    try:
        return [_identify(task)]
    except ThermofastError as error:
        return [[Identified(IdentifyRecord(task.run.name, "", NAME, status="unreadable", message=str(error)))]]


def identify_model_lost(task: LoopTask) -> list[list[Identified]]:
    """The record of a run whose worker died."""
    return [[Identified(IdentifyRecord(task.run.name, "", NAME, status="diverged", message="the worker process died"))]]


def _identify(task: LoopTask) -> list[Identified]:
    assert task.model is not None
    observed, prepared = ready(task)
    refused = [
        Identified(IdentifyRecord(task.run.name, c, NAME, until_min=task.until_min, status=status, message=why))
        for c, status, why in observed.refused
    ]
    if prepared is None:
        return refused
    whole, seen = prepared.whole, prepared.seen
    carried = carry(task.model.file, seen, task.run.name, task.model.source)
    fit = carried.fit
    floor = sensor_p_values(fit)
    reference = reference_of(seen)
    rng = np.random.default_rng(1)
    found = []
    for i, channel in enumerate(seen.channels):
        settled = _settling(fit, i, reference, rng)
        unused = whole.used[i] & ~fit.run.used[i]
        error = whole.reading[i][unused] - fit.curve[i][unused]
        measured = measured_equilibrium(whole.time[whole.used[i]], whole.reading[i][whole.used[i]])
        notes = list(carried.notes)
        if reference is not None:
            notes.insert(0, f"at surroundings of {reference:.4g} degC")
        if seen.drive is not None:
            notes.append(f"with {seen.drive} as last logged")
        notes.append(f"with {', '.join(ids_of(fit.model.parts)) or 'no effect'} of {task.model.source}")
        status = "ok"
        if floor[i] < RULES.pattern:
            status = "model_doubtful"
            notes.insert(0, "the readings leave the learnt model in a pattern: the interval does not cover what it lacks")
        if unused.any():
            against = contradiction(error, 1.96 * fit.curve_deviation(i)[unused], float(fit.noise[i]))
            if against is not None:
                status = "model_doubtful"
                notes.insert(0, words(against, float(seen.time[np.flatnonzero(seen.used[i])[-1]])))
        if settled["steady_state_lo_c"] is None or settled["t95_min"] is None:
            status = "not_determined"
        record = IdentifyRecord(
            task.run.name,
            channel,
            NAME,
            until_min=task.until_min if task.until_min is not None else seen.span,
            samples=int(fit.readings[i]),
            start_min=task.start_min,
            initial_c=float(fit.values[START][i]),
            rate_per_min=float(fit.values[RATE][i]),
            noise_c=float(fit.noise[i]),
            rmse_fit_c=float(fit.rmse[i]),
            rmse_ahead_c=float(np.sqrt(np.mean(error**2))) if unused.any() else None,
            steady_state_measured_c=measured[0] if measured and reference is None else None,
            t95_measured_min=measured[1] if measured and reference is None else None,
            status=status,
            message="; ".join(notes),
            **settled,
            **_to_go(settled, float(seen.time[np.flatnonzero(seen.used[i])[-1]])),
        )
        found.append(Identified(record, None, _curves(task, whole, fit, i, record) if task.want_curves else None))
    found += refused
    order = in_order([f.record for f in found], task.run)
    return [next(f for f in found if f.record is r) for r in order]


def _to_go(settled: dict[str, Any], elapsed: float) -> dict[str, Any]:
    """What is left of t95 after `elapsed` [min]."""
    sides = {"": "t95_min", "_lo": "t95_lo_min", "_hi": "t95_hi_min"}
    return {
        f"time_to_go{side}_min": max(settled[name] - elapsed, 0.0) if settled[name] is not None else None
        for side, name in sides.items()
    }


def _curves(task: LoopTask, whole: Observations, fit: Fit, i: int, record: IdentifyRecord) -> Curves:
    spread = fit.curve_deviation(i)
    return Curves(
        task.run.name,
        record.channel,
        whole.time,
        np.where(whole.used[i], whole.reading[i], np.nan),
        whole.time,
        fit.curve[i],
        fit.curve[i] - 1.96 * spread,
        fit.curve[i] + 1.96 * spread,
        float(record.until_min or whole.span),
        *marks(record, task.start_min),
        {},
    )


def reference_of(seen: Observations) -> float | None:
    """The surroundings that a steady state is told for: their mean over the last tenth of the readings used [degC]."""
    if not seen.ambient:
        return None
    column = next(iter(seen.ambient.values()))
    used = np.flatnonzero(seen.used.any(axis=0))
    return float(np.mean(column[used[-max(1, len(used) // 10) :]]))


def settling_point(fit: Fit, i: int, reference: float | None) -> tuple[float, float]:
    """Steady state [degC] and t95 [min] of one sensor at the fitted parameters."""
    steady, t95 = _settled(fit, i, reference, np.zeros((1, fit.local.shape[1] + len(fit.shared))))
    return float(steady[0]), float(t95[0])


def _settling(fit: Fit, i: int, reference: float | None, rng: np.random.Generator) -> dict[str, Any]:
    """Steady state and t95 of one sensor with their 95 % intervals, over draws of the parameters."""
    root = covariance_root(fit.joint_covariance(i))
    draws = rng.standard_normal((DRAWS, len(root))) @ root.T
    steady, t95 = _settled(fit, i, reference, np.concatenate([np.zeros((1, len(root))), draws]))
    low, high = np.quantile(steady[1:], [0.025, 0.975])
    t_low, t_high = np.quantile(t95[1:], [0.025, 0.975])
    return {
        "steady_state_c": finite(steady[0]),
        "steady_state_lo_c": finite(min(low, steady[0])),
        "steady_state_hi_c": finite(max(high, steady[0])),
        "t95_min": finite(t95[0]),
        "t95_lo_min": finite(min(t_low, t95[0])),
        "t95_hi_min": finite(max(t_high, t95[0])),
    }


def _settled(fit: Fit, i: int, reference: float | None, moves: Array) -> tuple[Array, Array]:
    """Steady states [degC] and t95 [min] (R,) of one sensor with its parameters moved by (R, kl + ks) in search coordinates."""
    parts = [p for p in fit.model.parts if p.effect.scope != "one"]
    keep = [k for k, p in enumerate(fit.model.parts) if p.effect.scope != "one"]
    rates = [float(fit.values[RATE][i])]
    for k, part in enumerate(fit.model.parts):
        for p in part.effect.parameters:
            if p.settles and Key(k, p.name) in fit.values and part.concerns(fit.run.sensors)[i]:
                value = fit.values[Key(k, p.name)]
                value = float(value[i]) if np.ndim(value) else float(value)
                rates.append(value if p.settles == "rate" else 1.0 / value)
    horizon = max(fit.run.span, HORIZON / max(min(rates), 1e-5))
    far = _far(fit, horizon, reference)
    own = [j for j, c in enumerate(fit.model.local) if c.part < 0 or c.part in keep]
    model = Model(far, parts, fit.model.active[:, own])
    centre = np.concatenate([fit.local[i], fit.shared])
    draws = centre + moves
    kl = fit.local.shape[1]
    local = np.clip(draws[:, :kl], fit.model.low_local, fit.model.high_local)
    shared = np.clip(draws[:, kl:], fit.model.low_shared, fit.model.high_shared)
    old_sink, new_sink = fit.model.sink_guess, model.sink_guess
    local[:, model.column(LEVEL)] += new_sink - old_sink if fit.run.sink_c is not None else 0.0
    common = [j for j, c in enumerate(fit.model.shared) if c.part < 0 or c.part in keep]
    curves = model.forward(local[:, own], shared[:, common], np.full(len(draws), i))
    tail = curves[:, -max(2, POINTS // 10) :]
    steady = tail.mean(axis=1)
    ripple = 0.5 * np.ptp(tail, axis=1)
    band = 0.05 * np.abs(steady - curves[:, 0]) + ripple
    outside = np.abs(curves - steady[:, None]) > band[:, None]
    last = outside.shape[1] - 1 - np.argmax(outside[:, ::-1], axis=1)
    t95 = np.where(outside.any(axis=1), far.time[np.minimum(last + 1, len(far.time) - 1)], 0.0)
    return steady, t95


def covariance_root(covariance: Array) -> Array:
    """Factor (n, n) of a covariance, a little indefinite by rounding or not."""
    values, vectors = np.linalg.eigh(covariance)
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def _far(fit: Fit, horizon: float, reference: float | None) -> Observations:
    """A record of the far future: constant surroundings, inputs as they were last, neighbours as the model lets them settle."""
    run = fit.run
    time = np.linspace(0.0, horizon, POINTS)
    ambient = {n: np.full(POINTS, reference if reference is not None else 0.0) for n in run.ambient}
    used = np.flatnonzero(run.used.any(axis=0))
    inputs = {n: np.full(POINTS, float(c[used[-1]])) for n, c in run.inputs.items()}
    alone = replace(
        run, time=time, ambient=ambient, inputs=inputs, heat=None if run.heat is None else np.full(POINTS, run.heat[used[-1]])
    )
    values = fit.values
    curves = values[LEVEL][:, None] + (values[START] - values[LEVEL])[:, None] * np.exp(-values[RATE][:, None] * time)
    return replace(alone, reading=curves, weight=np.ones_like(curves))


def sweep_with_model(task: LoopTask, windows: tuple[float, ...], times: tuple[float, ...], tolerance_c: float) -> list[list[Swept]]:
    """A run swept with a learnt model; whatever is wrong with it is a record."""
    try:
        return [_sweep(task, windows, times, tolerance_c)]
    except ThermofastError as error:
        return [[_no_sweep(SweepRecord(task.run.name, "", NAME, windows[0], status="unreadable", message=str(error)))]]


def sweep_model_lost(task: LoopTask) -> list[list[Swept]]:
    """The record of a run whose worker died."""
    return [[_no_sweep(SweepRecord(task.run.name, "", NAME, status="diverged", message="the worker process died"))]]


def _no_sweep(record: SweepRecord) -> Swept:
    return Swept((record,), np.empty(0), np.empty((0, 0)), np.empty(0))


def _sweep(task: LoopTask, windows: tuple[float, ...], times: tuple[float, ...], tolerance_c: float) -> list[Swept]:
    """RMSE of the learnt model over each window against identification time, all sensors of a run."""
    assert task.model is not None
    observed, prepared = ready(task)
    if prepared is None:
        return [_no_sweep(SweepRecord(task.run.name, c, NAME, windows[0], status=s, message=w)) for c, s, w in observed.refused]
    whole = prepared.whole
    model = task.model.file
    n = whole.sensors
    rmse = np.full((n, len(windows), len(times)), np.nan)
    width = np.full((n, len(times)), np.nan)
    doubted: list[list[str]] = [[] for _ in range(n)]
    rng = np.random.default_rng(1)
    for k, until in enumerate(times):
        seen = whole.until(until)
        if seen.used.sum(axis=1).min() < 6:
            continue
        fit = carry(model, seen, task.run.name, task.model.source).fit
        error = np.where(whole.used, np.nan_to_num(whole.reading) - fit.curve, 0.0)
        for j, window in enumerate(windows):
            inside = (whole.time <= window * (1 + 1e-12) + 1e-9) & whole.used
            if until < window - 1e-9:
                rmse[:, j, k] = np.sqrt((np.where(inside, error, 0.0) ** 2).sum(axis=1) / np.maximum(inside.sum(axis=1) - 1, 1))
        reference = reference_of(seen)
        for i in range(n):
            settled = _settling(fit, i, reference, rng)
            width[i, k] = settled["steady_state_hi_c"] - settled["steady_state_lo_c"]
        if k == len(times) - 1:
            doubted = [
                ["the readings leave the learnt model in a pattern"] if p < RULES.pattern else [] for p in sensor_p_values(fit)
            ]
    swept = []
    for i, channel in enumerate(whole.channels):
        blank = tuple(SweepRecord(task.run.name, channel, NAME, window_min=w) for w in windows)
        ends = [int(((whole.time <= w) & whole.used[i]).sum()) for w in windows]
        one = [blank], [bool(doubted[i])], [doubted[i]], windows, np.array(times), rmse[i : i + 1], width[i : i + 1]
        swept.append(Swept(sweep_records(*one, ends, tolerance_c)[0], np.array(times), rmse[i], width[i]))
    return swept
