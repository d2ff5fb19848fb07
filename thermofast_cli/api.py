"""The library: ``import thermofast as tf``. Each function does what the command of its name does and gives a frozen result."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np

from .errors import InputError, UsageError
from .experiments.simulated import Simulated
from .given import Source, Start, checked, in_range, keeps_details, model_of, setting_texts, started_of, work_of
from .reading import Run, read_runs
from .reading_options import ReadingOptions, names, options_from
from .results import (
    Calibration,
    Changes,
    Comparison,
    Diagnosis,
    Identification,
    Improvement,
    Plan,
    Sweeping,
    Watching,
)

if TYPE_CHECKING:
    from thermofast.models.imperfection import Imperfection, Rates
    from thermofast.models.standards import Criterion

    from .analysis.effect_file import EffectFile
    from .analysis.watching import Look
    from .machine.model import Model


@checked
def read(source: Source, *, name: str | None = None, **reading: Unpack[ReadingOptions]) -> Run:
    """One run from a file or from memory; `reading` are the options of ``thermofast help reading``, with underlines.

    Raises
    ------
    InputError: it cannot be read, or holds several runs; the message says what, where and what to do.
    UsageError: an option that is not known, or that names a column that is not there.
    """
    runs = read_all(source, name=name, **reading)
    if len(runs) > 1:
        raise InputError(
            f"{runs[0].name.rpartition('#')[0]}: {len(runs)} runs",
            allowed="one",
            do="take one of them, as in tf.read('run.csv#2'), or all with tf.read_all",
        )
    return runs[0]


@checked
def read_all(source: Source, *, name: str | None = None, **reading: Unpack[ReadingOptions]) -> list[Run]:
    """The runs of a file or table, mostly one.

    Raises
    ------
    InputError, UsageError: as :func:`read`.
    """
    return read_runs(source, options_from(reading), name)


@checked
def identify(
    runs: Source,
    until: float | None = None,
    *,
    filter: str = "afukf",  # noqa: A002 - the name of the option
    preset: Literal["paper"] | None = None,
    settings: Mapping[str, Any] | None = None,
    model: "Model | str | Path | None" = None,
    drive: str | None = None,
    auto: bool = False,
    joint: bool = False,
    pace: str | None = None,
    at: float | None = None,
    room: float | None = None,
    criterion: "Criterion | str | None" = None,
    limit: float | None = None,
    switch_off_at: float | None = None,
    imperfection: "Imperfection | str" = "typical",
    rates: "Rates" = "auto",
    start: Start = "auto",
    details: bool | None = None,
    jobs: int | None = 1,
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Identification:
    """Steady state and settling time of each sensor from the first `until` minutes (all of the record by default).

    imperfection (``typical``, ``none``, a file or a prior) is how far the machine may leave the law; rates what sensors share. `at`
    [min] asks for a temperature, `room` [degC] for the steady state in such a room, `criterion` (docs/criteria.md) when a stopping
    rule holds, `limit` [degC] for the margin, `switch_off_at` [min, negative before the first reading] for the temperature then.
    `drive` names a logged column that the heat follows; `auto` adds what is missing; details keep what :meth:`Identification.plot`
    draws (of 100 sensors by default); reading as for :func:`read`.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .machine.lab import read_imperfection
    from .pipeline.methods import choose, paces, stopping_rule
    from .pipeline.request import Request
    from .pipeline.sensors import from_rise, identify_runs

    until, at, room, limit, switch_off_at = in_range(until=until, at=at, room=room, limit=limit, switch_off_at=switch_off_at)
    learnt, prior, texts = model_of(model), read_imperfection(imperfection), setting_texts(filter, settings)
    method = replace(choose(filter, preset, texts, prior, rates), paces=paces(pace))
    started, rule = started_of(runs, start, from_rise(learnt, drive), reading), stopping_rule(criterion)
    detailed = keeps_details(details, started)
    request = Request(until, at, room, rule, limit, switch_off_at, learnt, drive, auto=auto, joint=joint, details=detailed)
    return identify_runs(started, method, request, work_of(jobs, executor, progress))


@checked
def calibrate(
    runs: Source,
    *,
    start: Start = "auto",
    progress: Callable[[int], None] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Calibration:
    """How imperfect a lab's machines are, learnt from complete runs; its ``prior`` goes into ``identify(imperfection=...)``.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.around import calibrate_runs
    from .pipeline.methods import choose

    return calibrate_runs(started_of(runs, start, True, reading), choose("afukf", None, ()), work_of(1, None, progress))


@checked
def changed(
    old: Source = None,
    new: Source = None,
    *,
    model: "Model | str | Path | None" = None,
    start: Start = "auto",
    **reading: Unpack[ReadingOptions],
) -> Changes:
    """What is different since `old` runs, or since `model` was learnt: heat, capacity, loss, sensors, contacts, or nothing.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.around import changed_runs

    before = started_of(old, start, True, reading) if old is not None else []
    taken = [run.name for run, _ in before]
    after = started_of(new, start, True, reading, taken) if new is not None else []
    return changed_runs(before, after, model_of(model))


@checked
def plan(
    tolerance: float | Sequence[float] = 0.5,
    *,
    like: Source = None,
    imperfection: "Imperfection | str" = "typical",
    model: "Model | str | Path | None" = None,
    progress: Callable[[int], None] | None = None,
    **design: float,
) -> Plan:
    """How long a test must run until the steady state is known to +-tolerance [K], and what would save time.

    design: sensors, interval_s, noise_c, rise_c, tau_min; what is not said is that of the run `like`, or of a usual test. model was
    learnt from past runs of the machine, which are counted.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .machine.lab import read_imperfection
    from .pipeline.around import design_like, plan_design

    wishes: tuple[float, ...] = (tolerance,)  # type: ignore[assignment]
    if isinstance(tolerance, Sequence | np.ndarray) and not isinstance(tolerance, str):
        wishes = tuple(np.asarray(tolerance).ravel().tolist() if isinstance(tolerance, np.ndarray) else tolerance)
    for wish in wishes:
        if wish is None:
            raise UsageError("tolerance: None among them", allowed="half-widths in K above zero")
        in_range(tolerance=wish)
    prior, learnt = read_imperfection(imperfection), model_of(model)
    if like is not None and len(runs := started_of(like, "auto", True, {})) != 1:
        raise UsageError("like: not one run", found=f"{len(runs)} runs", allowed="one run")
    if not wishes:
        raise UsageError("tolerance: none", found=repr(tolerance), allowed="half-widths in K above zero")
    base, replayed = design_like(runs[0], prior) if like is not None else (None, None)
    return plan_design(dict(design), wishes, prior, base, work_of(1, None, progress), replayed, learnt)


@checked
def watch(
    source: str | Path,
    tolerance: float = 0.5,
    *,
    leave: bool = True,
    replay: str | None = None,
    poll: float = 1.0,
    give_up: float | None = None,
    model: "Model | str | Path | None" = None,
    drive: str | None = None,
    imperfection: "Imperfection | str" = "typical",
    rates: "Rates" = "auto",
    start: Start = "auto",
    told: "Callable[[Look], None] | None" = None,
    filter: str = "afukf",  # noqa: A002 - the name of the option
    preset: Literal["paper"] | None = None,
    settings: Mapping[str, Any] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Watching:
    """Follow a file while it is written until the test can be stopped (`leave`), or none comes for `give_up` [min]; its last look.

    tolerance [K] is the half-width that every sensor is to have; replay (``600x``, ``max``) plays a finished record; `told`
    hears of every look, `poll` [s] says how often the file is looked at. drive: a logged column that the heat follows; filter,
    preset and settings as for :func:`identify`. An interrupt ends it as the command does: the last look is returned.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .machine.lab import read_imperfection
    from .pipeline.methods import choose
    from .pipeline.watching import speed_of, watch_run

    in_range(tolerance=tolerance, poll=poll, give_up=give_up)
    if not isinstance(source, str | Path):
        raise UsageError("source: not a file to follow", found=repr(source)[:60], allowed="a path, or '-' for standard input")

    def tell(look: "Look | None", _notes: tuple[str, ...]) -> None:
        if told is not None and look is not None:
            told(look)

    method = choose(filter, preset, setting_texts(filter, settings), read_imperfection(imperfection), rates)
    how = options_from(reading), str(start), method, tolerance, model_of(model), leave, speed_of(replay), poll, give_up
    last, run = watch_run(str(source), *how, tell, drive)
    return Watching(last.records, (run,), looked=last)


@checked
def sweep(
    runs: Source,
    windows: Sequence[float] = (40.0, 45.0, 50.0, 55.0),
    times: Sequence[float] | None = None,
    *,
    tolerance: float = 0.1,
    criterion: "Criterion | str | None" = None,
    filter: str = "afukf",  # noqa: A002 - the name of the option
    preset: Literal["paper"] | None = None,
    settings: Mapping[str, Any] | None = None,
    model: "Model | str | Path | None" = None,
    drive: str | None = None,
    imperfection: "Imperfection | str" = "typical",
    rates: "Rates" = "auto",
    start: Start = "auto",
    details: bool | None = None,
    jobs: int | None = 1,
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Sweeping:
    """The shortest identification time that serves, over sampling windows and identification times [min].

    tolerance [K] is the half-width of the steady state's interval to reach; imperfection, rates, criterion as for :func:`identify`.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .machine.lab import read_imperfection
    from .pipeline.methods import choose, minutes_of, stopping_rule
    from .pipeline.sensors import default_times, from_rise, sweep_runs

    in_range(tolerance=tolerance)
    learnt, spans = model_of(model), minutes_of(windows, "windows")
    method = choose(filter, preset, setting_texts(filter, settings), read_imperfection(imperfection), rates)
    grid = minutes_of(times, "times") if times is not None else default_times(spans)
    started = started_of(runs, start, from_rise(learnt, drive), reading)
    work, rule, details = work_of(jobs, executor, progress), stopping_rule(criterion), keeps_details(details, started)
    return sweep_runs(started, method, spans, grid, tolerance, learnt, details, work, drive, rule)


@checked
def compare(
    runs: Source,
    until: float | None = None,
    *,
    effects: str | Iterable[str] = (),
    model: "Model | str | Path | None" = None,
    drive: str | None = None,
    extra: str | Iterable[str] = (),
    input_range: Mapping[str, float] | None = None,
    unknown_heat: bool = False,
    denoise: bool = False,
    start: Start = "auto",
    details: bool | None = None,
    jobs: int | None = 1,
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Comparison:
    """Model beside measurement: the base model, with effects, or one that was learnt.

    extra are files with effects of your own, as with ``--effect``; unknown_heat adds the heat that the model would need,
    denoise the run without its sensors' noise (``.denoised[0].columns``).

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.loop import compare_runs

    in_range(until=until)
    started = started_of(runs, start, False, reading)
    return compare_runs(
        started,
        names(effects),
        tuple((input_range or {}).items()),
        keeps_details(details, started),
        work_of(jobs, executor, progress),
        unknown_heat,
        denoise,
        until_min=until,
        extra=names(extra),
        drive=drive,
        model=model_of(model, names(extra)),
    )


@checked
def diagnose(
    runs: Source,
    until: float | None = None,
    *,
    effects: str | Iterable[str] = (),
    model: "Model | str | Path | None" = None,
    drive: str | None = None,
    extra: str | Iterable[str] = (),
    false_alarm: float = 0.01,
    together: bool = False,
    next_experiment: bool = False,
    start: Start = "auto",
    jobs: int | None = 1,
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Diagnosis:
    """Which physical effect is missing; together: one search of several runs of one machine.

    next_experiment: where causes remain that the record does not part, simulate which run would.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.loop import diagnose_runs

    in_range(until=until, false_alarm=false_alarm)
    return diagnose_runs(
        started_of(runs, start, False, reading),
        names(effects),
        work_of(jobs, executor, progress),
        together,
        until_min=until,
        extra=names(extra),
        drive=drive,
        model=model_of(model, names(extra)),
        false_alarm=false_alarm,
        next_experiment=next_experiment,
    )


@checked
def write_effect(
    run: Source,
    path: str | Path,
    until: float | None = None,
    *,
    model: "Model | str | Path | None" = None,
    drive: str | None = None,
    start: Start = "auto",
    **reading: Unpack[ReadingOptions],
) -> "EffectFile | None":
    """Write the effect that the unknown heat of a run asks for as a plug-in to `path`; None where it follows no logged column.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.loop import write_effect_of

    in_range(until=until)
    return write_effect_of(started_of(run, start, False, reading), str(path), until_min=until, drive=drive, model=model_of(model))


@checked
def improve(
    runs: Source,
    until: float | None = None,
    *,
    add: str | Iterable[str] = (),
    auto: bool = False,
    together: bool = False,
    drive: str | None = None,
    extra: str | Iterable[str] = (),
    false_alarm: float = 0.01,
    start: Start = "auto",
    jobs: int | None = 1,
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
    **reading: Unpack[ReadingOptions],
) -> Improvement:
    """Effects added, the error falling; ``.model`` is what was learnt; together: one model of several runs of one machine.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .pipeline.loop import improve_runs

    in_range(until=until, false_alarm=false_alarm)
    started = started_of(runs, start, False, reading)
    return improve_runs(
        started,
        names(add),
        auto,
        work_of(jobs, executor, progress),
        together,
        until_min=until,
        extra=names(extra),
        drive=drive,
        false_alarm=false_alarm,
    )


@checked
def simulate(
    *,
    effects: str | Iterable[str] = (),
    seed: int = 0,
    sensors: int = 10,
    duration: float = 400.0,
    interval: float = 60.0,
    ambient: float = 17.9,
    rise: float = 9.0,
    t95: float = 195.0,
    noise: float = 0.02,
    step: float = 0.01,
    cooling: bool = False,
) -> Simulated:
    """A record with known truth: duration and t95 [min], interval [s], temperatures degC, noise and step K; ``.run()`` reads it.

    Raises
    ------
    UsageError: an unknown effect, a number out of its range, or more readings than memory should hold.
    """
    from .pipeline.around import simulate_record

    in_range(seed=seed, sensors=sensors, duration=duration, interval=interval, ambient=ambient, rise=rise)
    in_range(t95=t95, noise=noise, step=step)
    return simulate_record(names(effects), seed, sensors, duration, interval, ambient, rise, t95, noise, step, cooling)
