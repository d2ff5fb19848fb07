"""``thermofast identify``."""

from typing import Any

import click

from ..shell.options import (
    READING,
    Finite,
    RunCommand,
    filter_options,
    model_option,
    output_options,
    reading_options,
    runs_argument,
)


@click.command(
    "identify", cls=RunCommand, epilog="Example: thermofast identify sample_runs/spindle.csv --until 60 --save-plot spindle.png"
)
@runs_argument
@click.option(
    "--until",
    type=Finite(0, min_open=True),
    metavar="MIN",
    help="Use the first MIN minutes only; the rest shows the error ahead.",
)
@model_option
@click.option(
    "--pace",
    metavar="MIN:FACTOR,..",
    help="After the last reading used the rate is FACTOR times its own for MIN minutes, and so on; the last one lasts.",
)
@click.option("--joint", is_flag=True, help="One AFUKF over all sensors of a run: what they say together wakes its fading.")
@filter_options
@reading_options
@output_options
@click.option("--trace", metavar="FILE", help="Write what the filter did, reading by reading: .csv .json .jsonl .parquet .md.")
@click.option("--save-plot", metavar="FILE", help="Draw measurement, model and band per sensor: .png .pdf .svg.")
@click.option("--plot-trace", is_flag=True, help="Add rate and steady state converging to the picture of --save-plot.")
def command(
    runs: tuple[str, ...],
    until: float | None,
    model: str | None,
    pace: str | None,
    joint: bool,
    filter_name: str,
    preset: str | None,
    settings: tuple[str, ...],
    form: str | None,
    output: str | None,
    jobs: int | None,
    quiet: bool,
    trace: str | None,
    save_plot: str | None,
    plot_trace: bool,
    **reading: Any,
) -> int:
    """Say where each sensor of each RUN will settle and when 95 % of the rise is done.

    RUN is a CSV or Parquet file, or - for standard input. One record per sensor; status tells how far to trust it:
    ok, not_determined (a side of an interval is open), model_doubtful (the base model does not fit).
    """
    from dataclasses import replace

    from ..errors import UsageError
    from ..estimation.methods import choose, paces
    from ..estimation.work import IdentifyTask, identify_lost, identify_task
    from ..output.files import TABLE_SUFFIXES, check_target, check_targets, write_table
    from ..output.screen import interval, number, text
    from ..records import TRACE_COLUMNS, IdentifyRecord
    from ..shell.session import choose_sources, collect, deliver, exit_code, read_all, share_out

    method = replace(choose(filter_name, preset, settings), paces=paces(pace))
    if pace and model:
        raise UsageError("--pace changes the rate of the base model", do="leave --pace or --model out")
    if joint and (filter_name != "afukf" or preset or model):
        raise UsageError(
            "--joint runs the AFUKF over all sensors",
            found=f"--model {model}" if model else f"--preset {preset}" if preset else f"--filter {filter_name}",
            do="leave one of them out",
        )
    for target in (output, trace):
        if target:
            check_target(target, TABLE_SUFFIXES)
    if plot_trace and not save_plot:
        raise UsageError("--plot-trace adds to a picture", do="say where with --save-plot FILE.png")
    if save_plot:
        from ..output.plots import SUFFIXES, require_matplotlib

        require_matplotlib()
        check_target(save_plot, SUFFIXES)
    given = {k: reading[k] for k in READING}
    sources = choose_sources(runs)
    check_targets([output, trace, save_plot], sources)
    readings = read_all(sources, given, quiet, jobs)
    for run, _ in readings.runs:
        if until is not None and until > run.time_s[-1] / 60.0 * 1.001:
            raise UsageError(
                f"{run.name}: --until {until:g} is longer than the record",
                found=f"{run.time_s[-1] / 60.0:.4g} min",
                allowed="a time inside the record, or no --until",
            )
    details = bool(trace or save_plot)
    if model:
        if trace or plot_trace:
            raise UsageError("--trace shows a filter at work; with --model a joint fit takes its place", do="leave one of them out")
        found, interrupted = _with_model(readings, given, until, model, bool(save_plot), jobs, quiet)
        filter_name = "joint_fit"

    def make(name: str, minutes: Any, part: tuple[str, ...], values: Any, notes: tuple[str, ...], start: float) -> IdentifyTask:
        return IdentifyTask(name, minutes, part, values, notes, method, start, until, details, joint)

    if not model:
        tasks, processes = share_out(readings, jobs, 1.0 if not joint else 100.0, make, whole=joint)
        found, interrupted = collect(identify_task, tasks, processes, identify_lost, quiet, readings.warm)
    records = [r.record for r in found]
    records += [IdentifyRecord(name, "", filter_name, status="unreadable", message=why) for name, why in readings.unreadable]
    drawn = [
        ("sensor", text("channel")),
        ("settles degC", number("steady_state_c")),
        ("95 % interval", interval("steady_state_lo_c", "steady_state_hi_c")),
        ("measured", number("steady_state_measured_c")),
        ("t95 min", number("t95_min", 1)),
        ("95 % interval", interval("t95_lo_min", "t95_hi_min", 1)),
        ("to go min", number("time_to_go_min", 0)),
        ("noise K", number("noise_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        ("status", text("status")),
    ]
    deliver("identify", records, IdentifyRecord, output, form, quiet, drawn, [r for r, _ in readings.runs])
    if trace:
        traced = [
            {"run": r.record.run, "channel": r.record.channel, **{c: float(v[i]) for c, v in r.trace.items()}}
            for r in found
            if r.trace is not None
            for i in range(len(r.trace["time_min"]))
        ]
        write_table(trace, "trace", TRACE_COLUMNS, traced)
    if save_plot:
        from ..output.plots import plot_prediction

        plot_prediction(save_plot, [r.curves for r in found if r.curves is not None], plot_trace)
    return exit_code(records, interrupted)


def _with_model(
    readings: Any, given: dict[str, Any], until: float | None, model: str, want_curves: bool, jobs: int | None, quiet: bool
) -> tuple[list[Any], bool]:
    """Results with a learnt model, all sensors of a run together."""
    from ..discovery.loop import LoopTask
    from ..machine.modelfile import read_model
    from ..machine.settle import identify_model_lost, identify_with_model
    from ..shell.loop_session import run_loop

    drive = read_model(model).learnt_from.drive
    told = given["start"] != "auto"
    tasks = [
        LoopTask(run, start if told else 0.0, until_min=until, model=model, drive=drive, want_curves=want_curves)
        for run, start in readings.runs
    ]
    found, interrupted = run_loop(identify_with_model, tasks, jobs, identify_model_lost, quiet)
    return [i for results in found for i in results], interrupted
