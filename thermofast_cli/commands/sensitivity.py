"""``thermofast sensitivity``."""

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
    "sensitivity",
    cls=RunCommand,
    epilog="Example: thermofast sensitivity sample_runs/spindle.csv --until 60 --limit 0.2 --format table",
)
@runs_argument
@click.option("--until", type=Finite(0, min_open=True), metavar="MIN", help="Identify on the first MIN minutes, all by default.")
@model_option
@filter_options
@click.option("--offset", type=Finite(0), default=0.1, show_default=True, metavar="K", help="Uncertainty of the probe's offset.")
@click.option(
    "--start-level", "start_level", type=Finite(0), default=0.2, show_default=True, metavar="K", help="Of the level at the start."
)
@click.option("--room", type=Finite(0), default=0.3, show_default=True, metavar="K", help="Of the room while readings are taken.")
@click.option("--jitter", type=Finite(0), default=1.0, show_default=True, metavar="S", help="Of each time stamp.")
@click.option(
    "--until-spread",
    "until_spread",
    type=Finite(0),
    default=2.0,
    show_default=True,
    metavar="MIN",
    help="Of the time to identify.",
)
@click.option("--limit", type=Finite(0, min_open=True), metavar="K", help="Tell the probability of a larger error.")
@reading_options
@output_options
@click.option("--save-plot", metavar="FILE", help="Draw the shares as bars: .png .pdf .svg.")
def command(
    runs: tuple[str, ...],
    until: float | None,
    model: str | None,
    filter_name: str,
    preset: str | None,
    settings: tuple[str, ...],
    offset: float,
    start_level: float,
    room: float,
    jitter: float,
    until_spread: float,
    limit: float | None,
    form: str | None,
    output: str | None,
    jobs: int | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Say how much each uncertain thing contributes to the spread of the steady state and of the settling time.

    Uncertain are the probe's noise (from the record), its offset, the level at the start, the room, the time stamps and the
    identification time, each by the standard deviation of its option; with --model also the machine's constants, by their
    standard errors in the file. 'alone' is the share of the variance that a thing has by itself (first-order Sobol index), 'in
    all' that with what it does together with others. --limit is about the steady state's distance from its mean.
    """
    from ..analysis.sensitivity import SensitivityTask, Sizes, sensitivity_lost, sensitivity_task
    from ..errors import UsageError
    from ..estimation.methods import choose
    from ..output.screen import number, text
    from ..records import SensitivityRecord
    from ..shell.loop_session import loop_tasks, run_loop
    from ..shell.session import deliver, exit_code

    method = choose(filter_name, preset, settings)
    if model and (filter_name != "afukf" or preset or settings):
        raise UsageError("--model puts a joint fit in the filter's place", do="leave --filter, --preset and --set out")
    if save_plot:
        from ..output.plots import check_picture

        check_picture(save_plot)
    given = {k: reading[k] for k in READING}
    sizes = Sizes(offset, start_level, room, jitter, until_spread, limit)
    tasks, unreadable = loop_tasks(runs, given, quiet, [output, save_plot], from_rise=model is None, until_min=until, model=model)
    work = [SensitivityTask(task, method, sizes) for task in tasks]
    found, interrupted = run_loop(sensitivity_task, work, jobs, sensitivity_lost, quiet)
    records = [r for rs in found for r in rs]
    records += [SensitivityRecord(name, "", status="unreadable", message=why) for name, why in unreadable]
    drawn = [
        ("sensor", text("channel")),
        ("of", text("quantity")),
        ("spread", number("deviation", 3)),
        ("uncertain", text("factor")),
        ("by", number("size", 4)),
        ("", text("unit")),
        ("alone", number("first_order", 3)),
        ("in all", number("total", 3)),
        ("p(error > limit)", number("exceed_p_mc", 4)),
        ("status", text("status")),
    ]
    deliver("sensitivity", records, SensitivityRecord, output, form, quiet, drawn, [t.run for t in tasks])
    if save_plot:
        from ..output.share_plots import plot_shares

        plot_shares(save_plot, records)
    return exit_code(records, interrupted)
