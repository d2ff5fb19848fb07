"""Analyses of one sensor at a time: identify and sweep."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from thermofast.filters import Afukf
from thermofast.models.standards import Criterion

from ..errors import TooShortError, UsageError
from ..estimation.identify import Found, Identified, Method
from ..estimation.imperfect import GROUP, NOT_FOLLOWED
from ..estimation.sweep import SweptBlock, with_trips
from ..estimation.work import IdentifyTask, SweepTask, identify_lost, identify_task, sweep_lost, sweep_task, together
from ..machine.jumps import jumps_after, uncounted
from ..output.columns import Records
from ..reading.headings.names import named_as
from ..reading.run import Run, ends_before, said_short, stretch
from ..records import IdentifyRecord, SweepRecord
from ..results import Identification, Sweeping
from ..standards.stopping import Rule, with_last, with_limit
from ..standards.switching_off import after_switch_off, with_switch_off
from ..workers.engine import Started, Work, over_runs, over_sensors, share_out

if TYPE_CHECKING:
    from ..estimation.curves import Curves
    from ..machine.model import Model
    from ..machine.past import Knowledge


def long_enough(started: Sequence[Started], until_min: float | None) -> tuple[list[Started], list[Started]]:
    """(runs that go on to the identification time, those that end before it).

    Raises
    ------
    TooShortError: all end before it.
    """
    short = [one for one in started if ends_before(one[0], until_min)]
    if short and len(short) == len(started):
        run = short[0][0]
        raise TooShortError(
            f"{run.name}: --until {until_min:g} is longer than the record",
            found=f"{float(run.time_s[-1]) / 60.0:.4g} min",
            allowed="a time inside the record, or no --until",
        )
    return [one for one in started if one not in short], short


def from_rise(model: "Model | None", drive: str | None = None) -> bool:
    """Whether a run begins where its rise does: not with a drive or effects, to which an idle beginning says something."""
    return drive is None and (model is None or not (model.file.effects or model.drive))


def _check_closes(method: Method, beyond: bool) -> None:
    """Raises UsageError where what is known beyond the readings (`beyond`) would be left out without a word."""
    if beyond and not method.widens:
        raise UsageError(
            "--model, --drive and --auto enter the closing estimate that counts the machine, which is not made here",
            **_not_made(method),
        )


def _not_made(method: Method) -> dict[str, str]:
    """The option for which there is no closing estimate that counts the machine, and what to do."""
    if method.filter.closing != "never":
        return {"found": "--imperfection none --rates own", "do": "leave one of them out"}
    if method.filter.name == Afukf.name:
        return {"found": "--preset paper", "do": "leave it out"}
    return {"found": f"--filter {method.filter.name}", "do": "use --filter afukf"}


def identify_runs(
    started: Sequence[Started],
    method: Method,
    until_min: float | None = None,
    *,
    model: "Model | None" = None,
    joint: bool = False,
    details: bool = False,
    how: Work | None = None,
    at_min: float | None = None,
    room_c: float | None = None,
    drive: str | None = None,
    auto: bool = False,
    criterion: Criterion | None = None,
    limit_c: float | None = None,
    switch_off_min: float | None = None,
) -> Identification:
    """Steady state and settling time of every sensor; ``details`` adds curves and traces, at_min [min] a temperature at that time,
    room_c [degC] the steady state in that room. drive: a logged column that the heat follows. auto: what the
    readings used show to be missing is looked for and added first. criterion: a stopping rule, when it holds; limit_c [degC]: a
    limit, how far the steady state is below it; switch_off_min [min after the first reading, negative before it]: when the machine
    was switched off, for the temperature then.

    Raises
    ------
    UsageError: an identification time outside a record, or settings that exclude each other.
    """
    how = how or Work()
    if joint and type(method.filter) is not Afukf:
        found = "--preset paper" if method.filter.name == Afukf.name else f"--filter {method.filter.name}"
        raise UsageError("--joint runs the AFUKF over all sensors", found=found, do="leave one of them out")
    beyond = model is not None or drive is not None or auto
    if model is not None and auto:
        raise UsageError(
            "--auto looks for effects beside the base model, and --model tells them",
            do="leave one of them out; thermofast improve --auto learns a model with what is found",
        )
    _check_closes(method, beyond)
    if criterion is not None and not method.widens:
        raise UsageError(
            "--criterion is foretold by the closing estimate that counts the machine, which is not made here",
            **_not_made(method),
        )
    if criterion is not None and method.paces:
        raise UsageError("--criterion is foretold at the rate of the readings, which --pace changes", do="leave one of them out")
    started, short = long_enough(started, until_min)
    if model is not None:
        started = [(named_as(run, model.channels), start) for run, start in started]
    if switch_off_min is not None:
        started = [(run, after_switch_off(run, start, switch_off_min)) for run, start in started]
    told: dict[str, Knowledge] = {}
    held: dict[str, Knowledge] = {}
    if beyond:
        asked = until_min, model, drive, auto, how
        by_run, stopped = _known(started, *asked)
        told = {one.run: one for one in by_run}
        if criterion is not None and not stopped:
            # A rule is foretold with what is logged held as it is, not as it was to be later.
            going = [(stretch(run, None, until_min), start) for run, start in started if _goes_on(told[run.name], run, until_min)]
            by_run, stopped = _known(going, *asked) if going else ([], False)
            held = {one.run: one for one in by_run}
        if stopped:
            return Identification((), tuple(run for run, _ in started), True)
    failed = [one for one in told.values() if one.failed]
    able = [(run, start) for run, start in started if run.name not in {one.run for one in failed}]

    rules = {run.name: Rule.of(criterion, run, start, until_min) for run, start in able} if criterion is not None else {}
    rules |= {name: replace(rules[name], held=one.past) for name, one in held.items() if name in rules}
    later = {run.name: jumps_after(run, until_min) for run, _ in able}
    changed = {run.name: uncounted(run, start, until_min, drive) for run, start in able} if not model else {}

    def make(
        name: str, minutes: Any, part: tuple[str, ...], values: Any, notes: tuple[str, ...], start: float, room: Any
    ) -> IdentifyTask:
        of_run, known = method, told.get(name)
        changes, last = changed.get(name, ("", None))
        if changes:
            of_run = replace(of_run, changed_min=last)
            counted = known.past.shapes if known is not None and known.past is not None else {}
            notes = tuple(note if c in counted else _and((note,), changes) for c, note in zip(part, notes, strict=True))
        if known is None or known.past is None or not known.past.rises:
            said, jumps = later.get(name, ("", np.inf))
            of_run = replace(of_run, jumps_min=jumps)
            notes = tuple(_and((said,) if said else (), note) for note in notes)
        if known is not None and known.past is None:
            notes = tuple(_and(known.notes, note) for note in notes)
        if known is not None and known.uses_room and room_c is not None:
            notes = tuple(_and(("the model accounts for the surroundings: --room is not told with it",), note) for note in notes)
        if known is not None and known.past is not None:
            of_run = replace(of_run, past=known.past)
            mine = known.past.shapes
            notes = tuple(
                _and(known.notes if c in mine else (_other(c, known),), note) for c, note in zip(part, notes, strict=True)
            )
            room = None if known.uses_room else room
        return IdentifyTask(
            name,
            minutes,
            part,
            values,
            notes,
            of_run,
            start,
            room,
            until_min=until_min,
            want_trace=details,
            together=joint,
            at_min=at_min,
            room_c=room_c,
            rule=rules.get(name),
        )

    weight = 100.0 if joint else 10.0 if method.widens else 1.0
    sensor_tasks, processes = share_out(able, how.jobs, weight, make, joint, GROUP if method.widens else 1)
    by_task, interrupted = over_sensors(identify_task, sensor_tasks, processes, identify_lost, how, together)
    if auto and not interrupted:
        from .averaged import averaged  # it needs scipy, which takes longer to load than ten sensors to identify

        added = [(run, start) for run, start in able if told[run.name].found]
        silent = replace(how, advance=lambda _steps: None)
        bare: dict[str, Any] = {"at_min": at_min, "room_c": room_c, "drive": drive, "criterion": criterion}
        plain = identify_runs(added, method, until_min, details=details, joint=joint, how=silent, **bare)
        interrupted = plain.interrupted
        without = {(r.run, r.channel): r for r in plain}
        number = {run.name: told[run.name].found for run, _ in added}
        drawn = {(c.run, c.channel): c for c in plain.curves}
        by_task = [[_with_doubt(one, without, drawn, number, averaged) for one in found] for found in by_task]
    unread = [IdentifyRecord(one.run, "", method.filter.name, status=one.status, message=one.failed) for one in failed]
    unread += [
        IdentifyRecord(run.name, c, method.filter.name, until_min, status="too_short", message=said_short(run, until_min))
        for run, _ in short
        for c in run.channels
    ]
    whole = Found.joined([*by_task, [Identified(record) for record in unread]])
    records: Sequence[IdentifyRecord] = whole.records
    if limit_c is not None:
        records = [with_limit(record, limit_c) for record in records]
    if switch_off_min is not None:
        of = {run.name: run for run, _ in started}
        records = [with_switch_off(r, of[r.run], switch_off_min, until_min) for r in records]
    return Identification(
        with_last(records) if criterion is not None else records,
        tuple(run for run, _ in started),
        interrupted,
        tuple(curves for _, curves in whole.details if curves is not None),
        tuple(trace for trace, _ in whole.details),
    )


def _known(
    started: Sequence[Started], until_min: float | None, model: "Model | None", drive: str | None, auto: bool, how: Work
) -> tuple[list["Knowledge"], bool]:
    """What is known of each run's machine beforehand, and whether the work was broken off."""
    from ..machine.past import knowledge, knowledge_lost
    from .loop import loop_tasks

    tasks = loop_tasks(started, until_min=until_min, model=model, drive=drive, auto=auto)
    return over_runs(knowledge, tasks, knowledge_lost, replace(how, advance=lambda _steps: None))


def _goes_on(known: "Knowledge", run: Run, until_min: float | None) -> bool:
    """Whether what is known of a run counts something logged that moves after the time up to which the run is read."""
    if until_min is None or known.past is None or not known.past.rises:
        return False
    since = int(np.searchsorted(run.time_s / 60.0, until_min * (1.0 + 1e-12) + 1e-9)) - 1
    ahead = [c[since:][np.isfinite(c[since:])] for c in (*run.inputs.values(), *run.ambient.values())]
    return any(len(c) > 1 and float(np.ptp(c)) > 0.0 for c in ahead)


def _with_doubt(
    one: Identified,
    without: dict[tuple[str, str], IdentifyRecord],
    drawn: dict[tuple[str, str], "Curves"],
    number: dict[str, int],
    averaged: Callable[[IdentifyRecord, IdentifyRecord, int], IdentifyRecord],
) -> Identified:
    """What was found of a sensor with effects added, its interval counting the record without them where there is one."""
    which = one.record.run, one.record.channel
    plain = without.get(which)
    if plain is None:
        return one
    record = averaged(one.record, plain, number[plain.run])
    counted = replace(record, message=plain.message) != plain
    return replace(one, record=record, curves=one.curves if counted else drawn.get(which))


def _other(channel: str, known: "Knowledge") -> str:
    """What is said of a sensor that is identified on its own though there is a model or a drive."""
    if channel in known.strange:
        return NOT_FOLLOWED
    return "not in the model: identified on its own"


def _and(said: tuple[str, ...], note: str) -> str:
    """What is said of a sensor, with what the reader said of it."""
    return "; ".join(n for n in (*said, note) if n)


def sweep_runs(
    started: Sequence[Started],
    method: Method,
    windows_min: tuple[float, ...],
    times_min: tuple[float, ...],
    tolerance_c: float = 0.1,
    model: "Model | None" = None,
    details: bool = False,
    how: Work | None = None,
    drive: str | None = None,
    criterion: Criterion | None = None,
) -> Sweeping:
    """The shortest identification time that serves; windows and times [min] ascending.

    drive: a logged column that the heat follows; criterion: a stopping rule, when it holds on the whole record.

    Raises
    ------
    UsageError: no time below a window, a window longer than a record, or settings that exclude each other.
    """
    how = how or Work()
    _check_closes(method, model is not None or drive is not None)
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
            raise TooShortError(
                f"{run.name}: the window of {windows_min[-1]:g} min is longer than the record",
                found=f"{length:.4g} min",
                allowed="windows inside the record",
                do=f"say --windows with none above {length:.4g}, or leave the record out",
            )
    if model is not None or drive is not None:
        from ..machine.settle import sweep_model_lost, sweep_with_model
        from .loop import loop_tasks

        doing = partial(sweep_with_model, method=method, windows=windows_min, times=times_min, tolerance_c=tolerance_c)
        by_run, interrupted = over_runs(doing, loop_tasks(started, model=model, drive=drive), sweep_model_lost, how)
        told = [one for results in by_run for one in results]
        records, swept = Records.of(SweepRecord, [record for one in told for record in one.records]), tuple(told)
    else:

        def make(
            name: str, minutes: Any, part: tuple[str, ...], values: Any, notes: tuple[str, ...], start: float, room: Any
        ) -> SweepTask:
            return SweepTask(name, minutes, part, values, notes, method, start, room, windows_min, times_min, tolerance_c, details)

        sensor_tasks, processes = share_out(
            started, how.jobs, 1.0 + 0.02 * len(times_min), make, together=GROUP if method.widens else 1
        )
        by_task, interrupted = over_sensors(sweep_task, sensor_tasks, processes, sweep_lost, how, together)
        parts = [SweptBlock.of(found).records for found in by_task if len(found)]
        records = Records.joined(parts) if parts else Records.of(SweepRecord, [])
        swept = tuple(one for found in by_task for one in found) if details else ()
    shown = with_trips(records, criterion, started) if criterion is not None else records
    return Sweeping(shown, tuple(run for run, _ in started), interrupted, swept if details else ())


def default_times(windows: tuple[float, ...]) -> tuple[float, ...]:
    """About fifty times from 5 min, or a tenth of the shortest window, up to the longest window."""
    first = min(5.0, windows[0] / 10.0)
    step = max(round((windows[-1] - first) / 50.0), 1) if windows[-1] >= 30.0 else (windows[-1] - first) / 50.0
    count = int((windows[-1] - first) / step + 1e-9) + 1
    return tuple(round(first + i * step, 9) for i in range(count))
