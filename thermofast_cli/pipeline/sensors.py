"""Analyses of one sensor at a time: identify and sweep."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thermofast.models.observations import up_to
from thermofast.models.standards import Criterion

from ..errors import TooShortError, UsageError
from ..estimation.estimate import NOT_FOLLOWED
from ..estimation.identify import Found, Identified
from ..estimation.imperfect import GROUP
from ..estimation.request import Method, Question
from ..estimation.sensor import Signals
from ..estimation.sweep import SweptBlock, with_trips
from ..learning.jumps import jumps_after, uncounted
from ..reading.headings.names import named_as
from ..reading.run import Run, ends_before, said_short, stretch
from ..records import IdentifyRecord, SweepRecord
from ..records.columns import Records
from ..results import Identification, Sweeping
from ..standards.stopping import Rule, with_last, with_limit
from ..standards.switching_off import after_switch_off, with_switch_off
from ..workers.engine import Started, Work, over_runs, over_sensors, share_out
from .request import Request, check_closes
from .tasks import IdentifyTask, SweepTask, identify_lost, identify_task, sweep_lost, sweep_task, together

if TYPE_CHECKING:
    from ..learning.past import Knowledge
    from ..machine.model import Model


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


def identify_runs(
    started: Sequence[Started], method: Method, request: Request | None = None, how: Work | None = None
) -> Identification:
    """What is asked of every sensor.

    Raises
    ------
    UsageError: an identification time outside a record, or settings that exclude each other.
    """
    how, request = how or Work(), request or Request()
    request.check(method)
    place = {run.name: k for k, (run, _) in enumerate(started)}
    started, short = long_enough(started, request.until_min)
    started = [_prepared(run, start, request) for run, start in started]
    runs = tuple(sorted((run for run, _ in (*started, *short)), key=lambda run: place[run.name]))
    known, rules, stopped = _beforehand(started, request, how)
    if stopped:
        return Identification((), runs, True)
    able = [(run, start) for run, start in started if run.name not in known or not known[run.name].failed]
    prepared = {run.name: _OfRun.of(run, start, method, request, known.get(run.name), rules.get(run.name)) for run, start in able}
    weight = 100.0 if request.joint else 10.0 if method.widens else 1.0
    tasks, processes = share_out(
        able, how.jobs, weight, lambda part: prepared[part.run].task(part), request.joint, GROUP if method.widens else 1
    )
    by_task, interrupted = over_sensors(identify_task, tasks, processes, identify_lost, how, together)
    if request.auto and not interrupted:
        added = [(run, start) for run, start in able if known[run.name].found]
        by_task, interrupted = _counting_without(by_task, added, known, method, request, how)
    refused = [*_failed(known.values(), method), *_too_short([run for run, _ in short], method, request.until_min)]
    whole = Found.joined([*by_task, refused])
    if refused:
        whole = whole.taken(np.argsort([place[name] for name in whole.records.column("run")], kind="stable"))
    return Identification(
        _with_asked(whole.records, started, request),
        runs,
        interrupted,
        tuple(curves for _, curves in whole.details if curves is not None),
        tuple(trace for trace, _ in whole.details),
    )


def _prepared(run: Run, start: float, request: Request) -> Started:
    """A run with its sensors named as the model names them, and what is looked at from when it was switched off, if it was."""
    if request.model is not None:
        run = named_as(run, request.model.channels)
    return run, (start if request.switch_off_min is None else after_switch_off(run, start, request.switch_off_min))


def _beforehand(started: Sequence[Started], request: Request, how: Work) -> tuple[dict[str, "Knowledge"], dict[str, Rule], bool]:
    """By run: what is known of its machine, and the stopping rule; and whether the work was broken off."""
    until, criterion = request.until_min, request.criterion
    known, held, stopped = dict[str, "Knowledge"](), dict[str, "Knowledge"](), False
    if request.of_machine:
        known, stopped = _known(started, request, how)
        if criterion is not None and not stopped:
            # A rule is foretold with what is logged held as it is, not as it was to be later.
            going = [(stretch(run, None, until), start) for run, start in started if _goes_on(known[run.name], run, until)]
            held, stopped = _known(going, request, how) if going else ({}, False)
    if criterion is None or stopped:
        return known, {}, stopped
    able = [(run, start) for run, start in started if run.name not in known or not known[run.name].failed]
    rules = {run.name: Rule.of(criterion, run, start, until) for run, start in able}
    return known, rules | {n: replace(rules[n], held=one.past) for n, one in held.items() if n in rules}, False


@dataclass(frozen=True)
class _OfRun:
    """What the sensors of one run are treated with: what is known of its machine beforehand, and what is logged beside them.

    changed: what is said of a sensor for which a logged change is not counted; said: of every sensor.
    """

    method: Method
    question: Question
    known: "Knowledge | None"
    changed: str
    said: tuple[str, ...]

    @classmethod
    def of(cls, run: Run, start: float, method: Method, request: Request, known: "Knowledge | None", rule: Rule | None) -> "_OfRun":
        """For a run whose rise begins at `start` [min]."""
        past, said = known.past if known is not None else None, list[str]()
        changed, last = uncounted(run, start, request.until_min, request.drive) if request.model is None else ("", None)
        if changed:
            method = replace(method, changed_min=last)
        if known is not None and known.uses_room and request.room_c is not None:
            said.append("the model accounts for the surroundings: --room is not told with it")
        if past is None or not past.rises:
            later, jumps = jumps_after(run, request.until_min)
            method = replace(method, jumps_min=jumps)
            said.append(later)
        if past is not None:
            method = replace(method, past=past)
        return cls(method, request.question(rule), known, changed, tuple(said))

    def task(self, signals: Signals) -> IdentifyTask:
        """Some sensors of the run, with what is said of each."""
        notes = tuple(self._note(c, signals.note(i)) for i, c in enumerate(signals.channels))
        uses_room = self.method.past is not None and self.known is not None and self.known.uses_room
        room = None if uses_room else signals.room
        return IdentifyTask(replace(signals, notes=notes, room=room), self.method, self.question)

    def _note(self, channel: str, note: str) -> str:
        past, first = self.method.past, self.known.notes if self.known is not None else ()
        counted = past is not None and channel in past.shapes
        if past is not None and self.known is not None and not counted:
            first = (_other(channel, self.known),)
        return "; ".join(said for said in (*first, *self.said, "" if counted else self.changed, note) if said)


def _failed(known: Iterable["Knowledge"], method: Method) -> list[Identified]:
    """Rows of runs whose machine could not be looked at."""
    name = method.filter.name
    return [Identified(IdentifyRecord(one.run, "", name, status=one.status, message=one.failed)) for one in known if one.failed]


def _too_short(runs: Iterable[Run], method: Method, until_min: float | None) -> list[Identified]:
    """Rows of the sensors of runs that end before the identification time."""
    return [
        Identified(
            IdentifyRecord(run.name, c, method.filter.name, until_min, status="too_short", message=said_short(run, until_min))
        )
        for run in runs
        for c in run.channels
    ]


def _with_asked(records: Records, started: Sequence[Started], request: Request) -> Sequence[IdentifyRecord]:
    """The records with what is asked for beside where a sensor settles, and what is told from that."""
    found: Sequence[IdentifyRecord] = records
    if request.limit_c is not None:
        found = [with_limit(record, request.limit_c) for record in found]
    if request.switch_off_min is not None:
        of = {run.name: run for run, _ in started}
        found = [with_switch_off(r, of[r.run], request.switch_off_min, request.until_min) for r in found]
    return with_last(found) if request.criterion is not None else found


def _counting_without(
    by_task: list[Sequence[Identified]],
    added: Sequence[Started],
    known: dict[str, "Knowledge"],
    method: Method,
    request: Request,
    how: Work,
) -> tuple[list[Sequence[Identified]], bool]:
    """What was found with effects that were found and added in some runs, its intervals counting what is found without them.

    And whether the work was broken off.
    """
    from .averaged import averaged  # it needs scipy, which takes longer to load than ten sensors to identify

    plain = identify_runs(added, method, request.without_search(), replace(how, advance=lambda _steps: None))
    without = {(r.run, r.channel): r for r in plain}
    drawn = {(c.run, c.channel): c for c in plain.curves}

    def counted(one: Identified) -> Identified:
        which = one.record.run, one.record.channel
        bare = without.get(which)
        if bare is None:
            return one
        record = averaged(one.record, bare, known[bare.run].found)
        same = replace(record, message=bare.message) == bare
        return replace(one, record=record, curves=drawn.get(which) if same else one.curves)

    return [[counted(one) for one in found] for found in by_task], plain.interrupted


def _known(started: Sequence[Started], request: Request, how: Work) -> tuple[dict[str, "Knowledge"], bool]:
    """What is known of each run's machine beforehand, by run, and whether the work was broken off."""
    from ..learning.past import knowledge, knowledge_lost
    from .loop import loop_tasks

    asked = request.model, request.drive, request.auto
    tasks = loop_tasks(started, until_min=request.until_min, model=asked[0], drive=asked[1], auto=asked[2])
    found, stopped = over_runs(knowledge, tasks, knowledge_lost, replace(how, advance=lambda _steps: None))
    return {one.run: one for one in found}, stopped


def _goes_on(known: "Knowledge", run: Run, until_min: float | None) -> bool:
    """Whether what is known of a run counts something logged that moves after the time up to which the run is read."""
    if until_min is None or known.past is None or not known.past.rises:
        return False
    since = int(np.searchsorted(run.time_s / 60.0, up_to(until_min))) - 1
    ahead = [c[since:][np.isfinite(c[since:])] for c in (*run.inputs.values(), *run.ambient.values())]
    return any(len(c) > 1 and float(np.ptp(c)) > 0.0 for c in ahead)


def _other(channel: str, known: "Knowledge") -> str:
    """What is said of a sensor that is identified on its own though there is a model or a drive."""
    if channel in known.strange:
        return NOT_FOLLOWED
    return "not in the model: identified on its own"


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
    check_closes(method, model is not None or drive is not None)
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
        if ends_before(run, windows_min[-1]):
            raise TooShortError(
                f"{run.name}: the window of {windows_min[-1]:g} min is longer than the record",
                found=f"{length:.4g} min",
                allowed="windows inside the record",
                do=f"say --windows with none above {length:.4g}, or leave the record out",
            )
    if model is not None or drive is not None:
        from ..learning.settle import sweep_model_lost, sweep_with_model
        from .loop import loop_tasks

        doing = partial(sweep_with_model, method=method, windows=windows_min, times=times_min, tolerance_c=tolerance_c)
        by_run, interrupted = over_runs(doing, loop_tasks(started, model=model, drive=drive), sweep_model_lost, how)
        told = [one for results in by_run for one in results]
        records, swept = Records.of(SweepRecord, [record for one in told for record in one.records]), tuple(told)
    else:

        def make(signals: Signals) -> SweepTask:
            return SweepTask(signals, method, windows_min, times_min, tolerance_c, details)

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
