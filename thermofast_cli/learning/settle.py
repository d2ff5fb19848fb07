"""Steady state and settling time of a fitted model; ``sweep`` with a learnt one, or with a logged drive."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.joint import LEVEL, RATE, START, Fit, fit_model
from thermofast.models.observations import up_to
from thermofast.models.search.judge import sensor_p_values
from thermofast.models.search.rules import RULES

from ..errors import ThermofastError
from ..estimation.estimate import NOT_FOLLOWED
from ..estimation.identify import identify_sensors
from ..estimation.request import Method, Question
from ..estimation.sensor import Signals
from ..estimation.sweep import Swept, sweep_records, sweep_sensors
from ..machine.learnt import carry
from ..observing.task import LoopTask, ready
from ..plugins.guard import failed_status
from ..records import JOINT_FIT, SweepRecord
from .past import followers, knowledge
from .rise import HORIZON, free_run, lasting, slowest, together

Array = NDArray[np.float64]

#: Points of a free run.
POINTS = 1200


def reference_of(seen: Observations) -> float | None:
    """The surroundings that a steady state is told for: their mean over the last tenth of the readings used [degC]."""
    if not seen.ambient:
        return None
    column = next(iter(seen.ambient.values()))
    used = np.flatnonzero(seen.used.any(axis=0))
    return float(np.mean(column[used[-max(1, len(used) // 10) :]]))


def settling_point(fit: Fit, i: int, reference: float | None) -> tuple[float, float]:
    """Steady state [degC] and t95 [min] of one sensor at the fitted parameters."""
    far = _far(fit, max(fit.run.span, HORIZON / slowest(fit, i)), reference)
    curve = free_run(fit, far, fit.local[i : i + 1], fit.shared[None], i, lasting(fit))[0]
    tail = curve[-max(2, POINTS // 10) :]
    steady = float(tail.mean())
    outside = np.flatnonzero(np.abs(curve - steady) > 0.05 * abs(steady - curve[0]) + 0.5 * float(np.ptp(tail)))
    return steady, float(far.time[min(outside[-1] + 1, len(far.time) - 1)]) if len(outside) else 0.0


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
    return together(fit, replace(alone, reading=curves, weight=np.ones_like(curves)), 0, lasting(fit))


def sweep_with_model(
    task: LoopTask, method: Method, windows: tuple[float, ...], times: tuple[float, ...], tolerance_c: float
) -> list[list[Swept]]:
    """A run swept with a learnt model or a logged drive; whatever is wrong with it is a record."""
    try:
        return [_sweep(task, method, windows, times, tolerance_c)]
    except ThermofastError as error:
        return [[_no_sweep(SweepRecord(task.run.name, "", JOINT_FIT, windows[0], status=failed_status(error), message=str(error)))]]


def sweep_model_lost(task: LoopTask, why: str) -> list[list[Swept]]:
    """The record of a run whose worker died."""
    return [[_no_sweep(SweepRecord(task.run.name, "", JOINT_FIT, status="failed", message=why))]]


def _no_sweep(record: SweepRecord) -> Swept:
    return Swept((record,), np.empty(0), np.empty((0, 0)), np.empty(0))


def half_widths(task: LoopTask, method: Method, until: float) -> dict[str, float]:
    """Half-widths [K] of the steady states by ``identify`` with the model of a task, by sensor; infinite where a side is open.

    until [min] counts from the start of the rise.
    """
    until += task.start_min
    told = knowledge(replace(task, until_min=until))[0]
    signals = Signals.of(task.run, task.start_min)
    if told.uses_room:
        signals = replace(signals, room=None)
    found = identify_sensors(signals, replace(method, past=told.past), Question(until))
    sides = {r.channel: (r.steady_state_lo_c, r.steady_state_hi_c) for r in found.records}
    return {c: 0.5 * (b - a) if a is not None and b is not None else np.inf for c, (a, b) in sides.items()}


def _sweep(task: LoopTask, method: Method, windows: tuple[float, ...], times: tuple[float, ...], tolerance_c: float) -> list[Swept]:
    """RMSE of the model over each window against identification time, all sensors of a run."""
    observed, prepared = ready(task)
    if prepared is None:
        return [
            _no_sweep(SweepRecord(task.run.name, c, JOINT_FIT, windows[0], status=s, message=w)) for c, s, w in observed.refused
        ]
    whole, alone = prepared.whole, []
    if task.model is None:
        mine, strange = followers(task, prepared.seen)
        alone = [_on_its_own(task, method, windows, times, tolerance_c, c) for c in strange]
        if not mine:
            return alone
        whole = whole.only(mine)
    n = whole.sensors
    rmse = np.full((n, len(windows), len(times)), np.nan)
    width = np.full((n, len(times)), np.nan)
    doubted: list[list[str]] = [[] for _ in range(n)]
    begin = task.start_min  # of the clock of a joint fit; times and windows count from the first reading
    for k, until in enumerate(times):
        seen = whole.until(until - begin)
        if seen.used.sum(axis=1).min() < 6:
            continue
        if task.model is None:
            fit = fit_model(seen)
        else:
            fit = carry(task.model.file, seen, task.run.name, task.model.source).fit
        error = np.where(whole.used, np.nan_to_num(whole.reading) - fit.curve, 0.0)
        for j, window in enumerate(windows):
            inside = (begin + whole.time <= up_to(window)) & whole.used
            if until < window - 1e-9:
                rmse[:, j, k] = np.sqrt((np.where(inside, error, 0.0) ** 2).sum(axis=1) / np.maximum(inside.sum(axis=1) - 1, 1))
        wide = half_widths(task, method, until - begin)
        width[:, k] = [2.0 * wide.get(c, np.inf) for c in whole.channels]
        if k == len(times) - 1:
            doubted = [["the readings leave the model in a pattern"] if p < RULES.pattern else [] for p in sensor_p_values(fit)]
    swept = []
    for i, channel in enumerate(whole.channels):
        ends = [int(((begin + whole.time <= w) & whole.used[i]).sum()) for w in windows]
        named = task.run.name, (channel,), JOINT_FIT
        one = named, [bool(doubted[i])], [doubted[i]], windows, np.array(times), rmse[i : i + 1], width[i : i + 1]
        swept.append(Swept(tuple(sweep_records(*one, ends, tolerance_c)), np.array(times), rmse[i], width[i]))
    order = {c: i for i, c in enumerate(task.run.channels)}
    return sorted([*swept, *alone], key=lambda one: order[one.records[0].channel])


def _on_its_own(
    task: LoopTask, method: Method, windows: tuple[float, ...], times: tuple[float, ...], tolerance_c: float, channel: str
) -> Swept:
    """A sensor that does not follow the drive, swept without it."""
    signals = replace(Signals.of(task.run, task.start_min, (channel,)), notes=(NOT_FOLLOWED,), room=None)
    return sweep_sensors(signals, method, windows, times, tolerance_c)[0]
