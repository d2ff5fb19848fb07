"""Each analysis over runs that are read: settings in, a frozen result out. The commands and the library stand on these alike."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from .analysis.displacement import displacement_run
from .analysis.hidden import simulate_hidden
from .analysis.sensitivity import SensitivityTask, Sizes, sensitivity_lost, sensitivity_task
from .analysis.simulation import Probe, draw_probes, simulate
from .discovery.compare import compare_lost, compare_task
from .discovery.diagnose import diagnose_lost, diagnose_task
from .discovery.improve import improve_lost, improve_task
from .discovery.loop import LoopTask, check_drive
from .engine import Started, Work, over_runs, over_sensors, share_out
from .errors import UsageError, listed
from .estimation.bench import bench_run
from .estimation.identify import Method
from .estimation.work import IdentifyTask, SweepTask, identify_lost, identify_task, sweep_lost, sweep_task
from .machine.learnt import check_effects
from .machine.model import Model
from .machine.settle import identify_model_lost, identify_with_model, sweep_model_lost, sweep_with_model
from .plugins.effects import chosen_effects
from .plugins.filters import known_filters
from .reading import Run
from .results import (
    Bench,
    Comparison,
    Diagnosis,
    Displacement,
    Identification,
    Improvement,
    Sensitivity,
    Simulated,
    Sweeping,
)


def check_until(run: Run, until_min: float | None) -> None:
    """Raises UsageError where the identification time lies behind the record's end."""
    length = float(run.time_s[-1]) / 60.0
    if until_min is not None and until_min > length * 1.001:
        raise UsageError(
            f"{run.name}: --until {until_min:g} is longer than the record",
            found=f"{length:.4g} min",
            allowed="a time inside the record, or no --until",
        )


def identify_runs(
    started: Sequence[Started],
    method: Method,
    until_min: float | None = None,
    model: Model | None = None,
    joint: bool = False,
    details: bool = False,
    how: Work | None = None,
) -> Identification:
    """Steady state and settling time of every sensor; ``details`` adds curves and traces.

    Raises
    ------
    UsageError: an identification time outside a record, or settings that exclude each other.
    """
    how = how or Work()
    if model is not None and method.paces:
        raise UsageError("--pace changes the rate of the base model", do="leave --pace or --model out")
    if joint and (model is not None or method.filter.name != "afukf"):
        found = f"--model {model.source}" if model is not None else f"--filter {method.filter.name}"
        raise UsageError("--joint runs the AFUKF over all sensors", found=found, do="leave one of them out")
    for run, _ in started:
        check_until(run, until_min)
    if model is not None:
        tasks = loop_tasks(started, until_min=until_min, model=model, want_curves=details)
        by_run, interrupted = over_runs(identify_with_model, tasks, identify_model_lost, how)
        found_all = [one for results in by_run for one in results]
    else:

        def make(name: str, minutes: Any, part: tuple[str, ...], values: Any, notes: tuple[str, ...], start: float) -> IdentifyTask:
            return IdentifyTask(name, minutes, part, values, notes, method, start, until_min, details, joint)

        sensor_tasks, processes = share_out(started, how.jobs, 1.0 if not joint else 100.0, make, whole=joint)
        found_all, interrupted = over_sensors(identify_task, sensor_tasks, processes, identify_lost, how)
    return Identification(
        tuple(one.record for one in found_all),
        tuple(run for run, _ in started),
        interrupted,
        tuple(one.curves for one in found_all if one.curves is not None),
        tuple(one.trace for one in found_all),
    )


def sweep_runs(
    started: Sequence[Started],
    method: Method,
    windows_min: tuple[float, ...],
    times_min: tuple[float, ...],
    tolerance_c: float = 0.1,
    model: Model | None = None,
    details: bool = False,
    how: Work | None = None,
) -> Sweeping:
    """The shortest identification time that serves; windows and times [min] ascending.

    Raises
    ------
    UsageError: no time below a window, or a window longer than a record.
    """
    how = how or Work()
    for window in windows_min:
        if not any(t < window - 1e-9 for t in times_min):
            raise UsageError(
                f"no identification time lies below the window of {window:g} min",
                found=f"times from {times_min[0]:g} to {times_min[-1]:g} min",
                allowed="at least one time below each window",
                do="say --times FIRST:LAST:STEP",
            )
    for run, _ in started:
        length = float(run.time_s[-1]) / 60.0
        if windows_min[-1] > length * 1.001:
            raise UsageError(
                f"{run.name}: the window of {windows_min[-1]:g} min is longer than the record",
                found=f"{length:.4g} min",
                allowed="windows inside the record",
                do="say --windows",
            )
    if model is not None:
        doing = partial(sweep_with_model, windows=windows_min, times=times_min, tolerance_c=tolerance_c)
        by_run, interrupted = over_runs(doing, loop_tasks(started, model=model), sweep_model_lost, how)
        swept = [one for results in by_run for one in results]
    else:

        def make(name: str, minutes: Any, part: tuple[str, ...], values: Any, notes: tuple[str, ...], start: float) -> SweepTask:
            return SweepTask(name, minutes, part, values, notes, method, start, windows_min, times_min, tolerance_c, details)

        sensor_tasks, processes = share_out(started, how.jobs, 1.0 + 0.02 * len(times_min), make)
        swept, interrupted = over_sensors(sweep_task, sensor_tasks, processes, sweep_lost, how)
    records = tuple(record for one in swept for record in one.records)
    return Sweeping(records, tuple(run for run, _ in started), interrupted, tuple(swept) if details else ())


def loop_tasks(
    started: Sequence[Started],
    until_min: float | None = None,
    names: tuple[str, ...] = (),
    extra: tuple[str, ...] = (),
    model: Model | None = None,
    drive: str | None = None,
    **more: Any,
) -> list[LoopTask]:
    """A task for each run; effects, model, drive and identification time are checked before any work is done.

    Raises
    ------
    UsageError: as the catalogue, the model and the run raise them.
    """
    chosen_effects(names, extra)
    if model is not None:
        check_effects(model.file, model.source)
        if drive not in (None, model.drive):
            raise UsageError(
                f"--drive {drive!r} is not what the model was learnt with",
                found=f"{model.source}: {model.drive or 'no drive'}",
                do="leave --drive out: the model file tells it",
            )
    for run, _ in started:
        check_until(run, until_min)
        if drive is not None:
            check_drive(run, drive)
    heat = model.drive if model is not None else drive
    return [
        LoopTask(run, start, until_min=until_min, names=names, extra=extra, model=model, drive=heat, **more)
        for run, start in started
    ]


def compare_runs(
    started: Sequence[Started],
    effects: tuple[str, ...] = (),
    input_ranges: tuple[tuple[str, float], ...] = (),
    details: bool = False,
    how: Work | None = None,
    **options: Any,
) -> Comparison:
    """Model beside measurement; options are those of :func:`loop_tasks`.

    Raises
    ------
    UsageError: effects beside a model, a range of a column that is not logged, and as :func:`loop_tasks`.
    """
    if options.get("model") is not None and effects:
        raise UsageError("--effects adds to the base model, and --model takes its place", do="leave one of them out")
    for run, _ in started:
        for name, _reach in input_ranges:
            known = [*run.ambient, *run.inputs]
            if name not in known:
                allowed = ", ".join(known) or "this run logs none"
                raise UsageError(f"{run.name}: --input-range {name!r} is no logged input", allowed=allowed)
    tasks = loop_tasks(started, names=effects, input_ranges=input_ranges, want_curves=details, **options)
    found, interrupted = over_runs(compare_task, tasks, compare_lost, how or Work())
    records = tuple(r for one in found for r in one.records)
    return Comparison(records, tuple(run for run, _ in started), interrupted, tuple(p for one in found for p in one.pictures))


def diagnose_runs(started: Sequence[Started], effects: tuple[str, ...] = (), how: Work | None = None, **options: Any) -> Diagnosis:
    """Which effect is missing; options are those of :func:`loop_tasks` and ``false_alarm``.

    Raises
    ------
    UsageError: as :func:`loop_tasks`.
    """
    tasks = loop_tasks(started, names=effects, **options)
    found, interrupted = over_runs(diagnose_task, tasks, diagnose_lost, how or Work(), shares=True)
    return Diagnosis(tuple(r for records in found for r in records), tuple(run for run, _ in started), interrupted)


def improve_runs(
    started: Sequence[Started], add: tuple[str, ...] = (), auto: bool = False, how: Work | None = None, **options: Any
) -> Improvement:
    """Effects added step by step and the model learnt; options are those of :func:`loop_tasks` and ``false_alarm``.

    Raises
    ------
    UsageError: both ``add`` and ``auto``, and as :func:`loop_tasks`.
    """
    if add and auto:
        raise UsageError("--add and --auto exclude each other", do="name the effects, or let the search name them")
    tasks = loop_tasks(started, names=add, auto=auto, **options)
    found, interrupted = over_runs(improve_task, tasks, improve_lost, how or Work(), shares=True)
    return Improvement(
        tuple(r for one in found for r in one.records),
        tuple(run for run, _ in started),
        interrupted,
        tuple(found),
        tuple(Model(one.model, run.name) if one.model is not None else None for one, (run, _) in zip(found, started, strict=False)),
    )


def bench_runs(started: Sequence[Started], until_min: float | None = None, how: Work | None = None) -> Bench:
    """Every filter on each run, identified on its first `until_min` minutes, half of it by default.

    Raises
    ------
    UsageError: an identification time that leaves nothing before or after it.
    """
    for run, start in started:
        length = float(run.time_s[-1]) / 60.0
        if until_min is not None and not start < until_min < length:
            raise UsageError(
                f"{run.name}: --until {until_min:g} leaves nothing ahead of it, or nothing before it",
                allowed=f"{start:.4g} to {length:.4g} min",
            )
    advance = (how or Work()).advance
    known = known_filters()
    records = [r for run, start in started for r in bench_run(run, start, until_min, known, advance)]
    return Bench(tuple(records), tuple(run for run, _ in started))


def sensitivity_runs(
    started: Sequence[Started],
    method: Method,
    sizes: Sizes,
    until_min: float | None = None,
    model: Model | None = None,
    how: Work | None = None,
) -> Sensitivity:
    """How much each uncertain thing contributes to the spread of the result.

    Raises
    ------
    UsageError: as :func:`loop_tasks`.
    """
    work = [SensitivityTask(task, method, sizes) for task in loop_tasks(started, until_min=until_min, model=model)]
    found, interrupted = over_runs(sensitivity_task, work, sensitivity_lost, how or Work())
    return Sensitivity(tuple(r for records in found for r in records), tuple(run for run, _ in started), interrupted)


def displacement_runs(started: Sequence[Started], columns: tuple[str, ...] = ()) -> Displacement:
    """Thermal displacement from the temperatures of each run: the columns named, or those that the reader took for displacements.

    Raises
    ------
    UsageError: a name that is no column.
    """
    found = []
    for run, start in started:
        known = {**run.displacements, **run.channels}
        chosen = columns or tuple(run.displacements)
        missing = [c for c in chosen if c not in known]
        if missing:
            raise UsageError(f"{run.name}: --displacements {missing[0]!r} is no column of this record", allowed=listed(known))
        found.append(displacement_run(run, chosen, start))
    return Displacement(
        tuple(r for one in found for r in one.records),
        tuple(run for run, _ in started),
        panels=tuple(p for one in found for p in one.panels),
    )


def default_times(windows: tuple[float, ...]) -> tuple[float, ...]:
    """About fifty times from 5 min, or a tenth of the shortest window, up to the longest window."""
    first = min(5.0, windows[0] / 10.0)
    step = max(round((windows[-1] - first) / 50.0), 1) if windows[-1] >= 30.0 else (windows[-1] - first) / 50.0
    count = int((windows[-1] - first) / step + 1e-9) + 1
    return tuple(round(first + i * step, 9) for i in range(count))


def simulate_record(
    effects: tuple[str, ...] = (),
    seed: int = 0,
    sensors: int = 10,
    duration_min: float = 400.0,
    interval_s: float = 60.0,
    ambient_c: float = 17.9,
    rise_c: float = 9.0,
    t95_min: float = 195.0,
    noise_c: float = 0.02,
    step_c: float = 0.01,
    cooling: bool = False,
    fixed: Sequence[tuple[str, float, float]] = (),
) -> Simulated:
    """A record of the base model, or with hidden effects, and the truth behind it.

    fixed: (name, steady state [degC], t95 [min]) of sensors that are given and not drawn.

    Raises
    ------
    UsageError: too many readings, a name twice or none, an unknown effect, or one that needs more sensors.
    """
    if duration_min * 60.0 / interval_s > 1e7:
        raise UsageError("too many readings", found=f"{duration_min * 60.0 / interval_s:.3g}", allowed="ten million a sensor")
    for name, _, settle in fixed:
        plain = name and name.isprintable() and not set(name) & set(',;"=@') and name not in ("ambient", "time_min", "time_s")
        if not plain or not 0.0 < settle < math.inf:
            raise UsageError(f"--sensor {name!r}", allowed="NAME=DEGC:MIN, as in --sensor T5=26.7:195")
    taken = {name for name, _, _ in fixed}
    if len(taken) < len(fixed):
        raise UsageError("--sensor: the same name twice", found=", ".join(name for name, _, _ in fixed))
    drawn = draw_probes(np.random.default_rng([seed, 1]), sensors, ambient_c, rise_c, t95_min, noise_c, cooling)
    given = [Probe(name, ambient_c, steady, settle, noise_c) for name, steady, settle in fixed]
    # A drawn sensor makes way for the given one of its name first, then from the end.
    rest = [p for p in drawn if p.channel not in taken][: max(0, sensors - len(given))]
    probes = sorted(given + rest, key=lambda p: (len(p.channel), p.channel))
    if effects:
        chosen = chosen_effects(effects, ())
        made = simulate_hidden(probes, duration_min, interval_s, ambient_c, step_c, seed, chosen)
    else:
        made = simulate(probes, duration_min, interval_s, ambient_c, step_c, seed)
    return Simulated(made.columns, made.truth)
