"""``thermofast compare``."""

from typing import Any

import click

from ..shell.options import (
    READING,
    RunCommand,
    loop_options,
    model_option,
    names,
    output_options,
    ranges,
    reading_options,
    runs_argument,
)


@click.command(
    "compare", cls=RunCommand, epilog="Example: thermofast compare sample_runs/hidden.csv --until 240 --save-plot compare.png"
)
@runs_argument
@loop_options
@click.option("--effects", metavar="A,B", help="Add these effects to the base model: ids, or FILE.py:CLASS.")
@model_option
@click.option(
    "--input-range",
    "input_ranges",
    multiple=True,
    metavar="COLUMN=X",
    help="A logged input is only known to within +- X of its unit; widens what area_metric_c allows. May be repeated.",
)
@reading_options
@output_options
@click.option("--save-plot", metavar="FILE", help="Draw measurement, model and residual with failing stretches: .png .pdf .svg.")
def command(
    runs: tuple[str, ...],
    until: float | None,
    extra: tuple[str, ...],
    drive: str | None,
    effects: str | None,
    model: str | None,
    input_ranges: tuple[str, ...],
    form: str | None,
    output: str | None,
    jobs: int | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Put the model beside the measurement: how well it fits, how well it foretells, and where it fails.

    The headline is 'ahead': the error of the free run on readings that the fit did not see (after --until, else blocks left out in
    turn), with inputs as logged. 'one step' is the error of the next reading told from the last, always smaller.

    A record counts from its first reading unless --start MIN says otherwise: an idle beginning is itself a finding.
    """
    from ..discovery.compare import compare_lost, compare_task
    from ..errors import UsageError
    from ..output.screen import interval, number, text
    from ..records import CompareRecord
    from ..shell.loop_session import loop_tasks, run_loop
    from ..shell.session import deliver, exit_code

    if save_plot:
        from ..output.plots import check_picture

        check_picture(save_plot)
    if model and effects:
        raise UsageError("--effects adds to the base model, and --model takes its place", do="leave one of them out")
    given = {k: reading[k] for k in READING}
    tasks, unreadable = loop_tasks(
        runs,
        given,
        quiet,
        [output, save_plot],
        until_min=until,
        extra=extra,
        drive=drive,
        names=names(effects),
        model=model,
        input_ranges=ranges(input_ranges),
        want_curves=bool(save_plot),
    )
    for task in tasks:
        for name, _ in task.input_ranges:
            known = [*task.run.ambient, *task.run.inputs]
            if name not in known:
                allowed = ", ".join(known) or "this run logs none"
                raise UsageError(f"{task.run.name}: --input-range {name!r} is no logged input", allowed=allowed)
    found, interrupted = run_loop(compare_task, tasks, jobs, compare_lost, quiet)
    records = [r for c in found for r in c.records]
    records += [CompareRecord(name, "", status="unreadable", message=why) for name, why in unreadable]
    drawn = [
        ("sensor", text("channel")),
        ("effects", text("effects")),
        ("fit K", number("rmse_fit_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        ("one step K", number("rmse_one_step_c", 3)),
        ("noise K", number("noise_c", 3)),
        ("bias K", number("bias_c", 3)),
        ("fails from..to min", interval("worst_from_min", "worst_to_min", 0)),
        ("by K", number("worst_error_c", 2)),
        ("status", text("status")),
    ]
    deliver("compare", records, CompareRecord, output, form, quiet, drawn, [t.run for t in tasks])
    if save_plot:
        from ..output.loop_plots import plot_comparison

        plot_comparison(save_plot, [p for c in found for p in c.pictures])
    return exit_code(records, interrupted)
