"""``thermofast improve``."""

from typing import Any

import click

from ..shell.options import (
    READING,
    RunCommand,
    false_alarm_option,
    loop_options,
    names,
    output_options,
    reading_options,
    runs_argument,
)


@click.command(
    "improve", cls=RunCommand, epilog="Example: thermofast improve sample_runs/hidden.csv --auto -o machine.toml --format table"
)
@runs_argument
@loop_options
@false_alarm_option
@click.option("--add", metavar="A,B", help="Add these effects: ids, or FILE.py:CLASS.")
@click.option("--auto", is_flag=True, help="Add what the search names, and stop where it would name no more.")
@reading_options
@output_options
@click.option("--save-plot", metavar="FILE", help="Draw the staircase of errors: .png .pdf .svg.")
def command(
    runs: tuple[str, ...],
    until: float | None,
    extra: tuple[str, ...],
    drive: str | None,
    false_alarm: float,
    add: str | None,
    auto: bool,
    form: str | None,
    output: str | None,
    jobs: int | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Add effects to the base model, refit, and show the error fall step by step; -o M.toml writes the model learnt.

    With neither --add nor --auto the base model is learnt and written. The model file serves compare, identify, sweep and
    diagnose through --model, on this run and on others of the same machine.

    A record counts from its first reading unless --start MIN says otherwise: an idle beginning is itself a finding.
    """
    from ..discovery.improve import improve_lost, improve_task
    from ..errors import UsageError
    from ..machine.modelfile import write_model
    from ..output.files import check_target
    from ..output.screen import number, say, text
    from ..records import ImproveRecord
    from ..shell.loop_session import loop_tasks, run_loop
    from ..shell.session import deliver, exit_code

    if add and auto:
        raise UsageError("--add and --auto exclude each other", do="name the effects, or let the search name them")
    learns = output is not None and output.lower().endswith(".toml")
    if save_plot:
        from ..output.plots import check_picture

        check_picture(save_plot)
    if learns:
        check_target(output or "", (".toml",))
    given = {k: reading[k] for k in READING}
    options: dict[str, Any] = {"until_min": until, "extra": extra, "drive": drive, "names": names(add)}
    options |= {"auto": auto, "false_alarm": false_alarm}
    tasks, unreadable = loop_tasks(runs, given, quiet, [output, save_plot], check_table=not learns, **options)
    if learns and len(tasks) > 1:
        raise UsageError(f"{output}: one model file for {len(tasks)} runs", do="learn from one run, or name another output")
    found, interrupted = run_loop(improve_task, tasks, jobs, improve_lost, quiet, shares=True)
    records = [r for i in found for r in i.records]
    records += [ImproveRecord(name, "", status="unreadable", message=why) for name, why in unreadable]
    drawn = [
        ("step", text("step")),
        ("sensor", text("channel")),
        ("effects", text("effects")),
        ("fit K", number("rmse_fit_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        ("noise K", number("noise_c", 3)),
        ("status", text("status")),
    ]
    table = None if learns else output
    runs_read = [t.run for t in tasks]
    deliver("improve", records, ImproveRecord, table, form, quiet, drawn, runs_read, beneath=("stopped_because", "message"))
    if learns and found and found[0].model is not None:
        write_model(output or "", found[0].model)
        if not quiet:
            say(f"model in {output}")
    if save_plot:
        from ..output.loop_plots import plot_staircase

        plot_staircase(save_plot, found)
    return exit_code(records, interrupted)
