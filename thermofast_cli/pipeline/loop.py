"""Analyses of all sensors of a run together: compare, diagnose, improve."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..analysis.effect_file import EffectFile, check_effect_runs, write_effect
from ..discovery.compare import compare_lost, compare_task
from ..discovery.diagnose import diagnose_lost, diagnose_task, diagnose_together
from ..discovery.improve import improve_lost, improve_task
from ..discovery.together import improve_together
from ..errors import UsageError
from ..machine.learnt import check_effects
from ..machine.model import Model
from ..observing.task import LoopTask, check_drive, drive_of
from ..plugins.effects import chosen_effects
from ..reading.headings.called import column_named
from ..reading.headings.names import named_as
from ..results import Comparison, Diagnosis, Improvement
from ..workers.engine import Started, Work, over_runs, sharing
from ..workers.pool import cores
from .sensors import long_enough

#: By how much a logged column may be wrong, at most [its unit].
WIDEST = 1e7


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
    if until_min is not None and not until_min > 0.0:
        raise UsageError("until: not a time above zero", found=f"{until_min!r}", allowed="minutes from the first reading")
    chosen_effects(names, extra)
    if model is not None:
        check_effects(model.file, model.source)
        if drive is not None and column_named(drive, [model.drive or ""]) != model.drive:
            raise UsageError(
                f"--drive {drive!r} is not what the model was learnt with",
                found=f"{model.source}: {model.drive or 'no drive'}",
                do="leave --drive out: the model file tells it",
            )
    long_enough(started, until_min)
    if model is not None:
        started = [(named_as(run, model.channels), start) for run, start in started]
    for run, _ in started:
        if drive is not None:
            check_drive(run, drive)
    heat = model.drive if model is not None else drive
    return [
        LoopTask(run, start, until_min=until_min, names=names, extra=extra, model=model, drive=drive_of(run, heat), **more)
        for run, start in started
    ]


def _named_alike(started: Sequence[Started]) -> list[Started]:
    """Runs that are looked at beside each other, with the first one's names where only the unit behind these differs."""
    return [(named_as(run, started[0][0].channels), start) for run, start in started]


def ranges_named(started: Sequence[Started], input_ranges: Sequence[tuple[str, float]]) -> tuple[tuple[str, float], ...]:
    """Ranges by the columns that they are of: ``ambient`` for ``ambient [degC]``, as with --channels.

    Raises
    ------
    UsageError: one is of a column that a run does not log, or no number above zero.
    """
    for name, reach in input_ranges:
        number = isinstance(reach, int | float | np.number) and not isinstance(reach, bool)
        if not (number and 0.0 < float(reach) <= WIDEST):
            raise UsageError(f"--input-range {name}: no number above zero", found=repr(reach), allowed=f"up to {WIDEST:g}")
    found = list(input_ranges)
    for run, _ in started:
        known = [*run.ambient, *run.inputs]
        for k, (name, reach) in enumerate(found):
            if (column := column_named(name, known)) not in known:
                allowed = ", ".join(known) or "this run logs none"
                raise UsageError(f"{run.name}: --input-range {name!r} is no logged input", allowed=allowed)
            found[k] = str(column), reach
    return tuple(found)


def compare_runs(
    started: Sequence[Started],
    effects: tuple[str, ...] = (),
    input_ranges: tuple[tuple[str, float], ...] = (),
    details: bool = False,
    how: Work | None = None,
    unknown_heat: bool = False,
    denoise: bool = False,
    **options: Any,
) -> Comparison:
    """Model beside measurement; options are those of :func:`loop_tasks`.

    Raises
    ------
    UsageError: effects beside a model, a range of a column that is not logged, and as :func:`loop_tasks`.
    """
    if options.get("model") is not None and effects:
        raise UsageError("--effects adds to the base model, and --model takes its place", do="leave one of them out")
    if denoise and options.get("until_min") is not None:
        raise UsageError("--denoise takes the whole record", found=f"--until {options['until_min']:g}", do="leave --until out")
    input_ranges = ranges_named(started, input_ranges)
    more: dict[str, Any] = {"input_ranges": input_ranges, "want_curves": details, "unknown_heat": unknown_heat, "denoise": denoise}
    tasks = loop_tasks(started, names=effects, **more, **options)
    found, interrupted = over_runs(compare_task, tasks, compare_lost, how or Work())
    records, panels = (tuple(r for one in found for r in getattr(one, name)) for name in ("records", "pictures"))
    clean = tuple(one.denoised for one in found if one.denoised is not None)
    return Comparison(records, tuple(run for run, _ in started), interrupted, panels, clean)


def diagnose_runs(
    started: Sequence[Started], effects: tuple[str, ...] = (), how: Work | None = None, together: bool = False, **options: Any
) -> Diagnosis:
    """Which effect is missing; options are those of :func:`loop_tasks`, ``false_alarm`` and ``next_experiment``.

    together: the runs are of one machine and searched as one.

    Raises
    ------
    UsageError: a model with runs together, runs together not of one machine, and as :func:`loop_tasks`.
    """
    started = _named_alike(started) if together else started
    tasks = loop_tasks(started, names=effects, **options)
    if together and options.get("model") is not None:
        raise UsageError("--together searches beside the base model, and --model takes its place", do="leave one of them out")
    long = bool(options.get("next_experiment"))
    if together and tasks:
        work = how or Work()
        with sharing(tasks, work.jobs if work.jobs is not None else cores(), long) as spread:
            told = diagnose_together(tasks, spread)
        work.advance(len(tasks))
        return Diagnosis(tuple(r for records in told for r in records), tuple(run for run, _ in started), False)
    found, interrupted = over_runs(diagnose_task, tasks, diagnose_lost, how or Work(), shares=True, long=long)
    return Diagnosis(tuple(r for records in found for r in records), tuple(run for run, _ in started), interrupted)


def write_effect_of(started: Sequence[Started], path: str, **options: Any) -> EffectFile | None:
    """The effect that one run's unknown heat asks for, written to `path`; options are those of :func:`loop_tasks`.

    Raises
    ------
    UsageError: not exactly one run, and as :func:`write_effect`.
    """
    check_effect_runs([run for run, _ in started], options.get("drive"))
    return write_effect(loop_tasks(started, **options)[0], path)


def improve_runs(
    started: Sequence[Started],
    add: tuple[str, ...] = (),
    auto: bool = False,
    how: Work | None = None,
    together: bool = False,
    **options: Any,
) -> Improvement:
    """Effects added step by step and the model learnt; options are those of :func:`loop_tasks` and ``false_alarm``.

    together: the runs are of one machine, and one model is learnt from all of them.

    Raises
    ------
    UsageError: both ``add`` and ``auto``, runs together that are not of one machine, and as :func:`loop_tasks`.
    """
    if add and auto:
        raise UsageError("--add and --auto exclude each other", do="name the effects, or let the search name them")
    started = _named_alike(started)
    tasks = loop_tasks(started, names=add, auto=auto, **options)
    if together and tasks:
        work = how or Work()
        all_ = improve_together(tasks)
        work.advance(len(tasks))
        return Improvement(
            tuple(r for one in all_ for r in one.records),
            tuple(run for run, _ in started),
            False,
            tuple(all_),
            tuple(Model(one.model, f"{len(tasks)} runs") for one in all_ if one.model is not None),
        )
    found, interrupted = over_runs(improve_task, tasks, improve_lost, how or Work(), shares=True)
    return Improvement(
        tuple(r for one in found for r in one.records),
        tuple(run for run, _ in started),
        interrupted,
        tuple(found),
        tuple(Model(one.model, run.name) if one.model is not None else None for one, (run, _) in zip(found, started, strict=False)),
    )
