"""``thermofast improve``."""

from typing import Any

import click

from ..reading_options import names
from ..shell.options import (
    RunCommand,
    false_alarm_option,
    loop_options,
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
@click.option("--add", metavar="A,B", help="Add these effects: ids, second_mode.2 for a second of its kind, or FILE.py:CLASS.")
@click.option("--auto", is_flag=True, help="Add what the search names, and stop where it would name no more.")
@click.option("--together", is_flag=True, help="The RUNS are of one machine: one model of all of them, each left out in turn.")
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
    together: bool,
    form: str | None,
    output: str | None,
    jobs: int | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Add effects to the base model, refit, and show the error fall step by step; -o M.toml writes the model learnt.

    With --together several runs of one machine give one model: what belongs to the machine is shared, what belongs to the run is
    free, and how much the first scatters from run to run is estimated. identify --model starts from it.

    With neither --add nor --auto the base model is learnt and written. The model file serves compare, identify, sweep and
    diagnose through --model, on this run and on others of the same machine.

    A record counts from its first reading unless --start MIN says otherwise: an idle beginning is itself a finding.
    """
    from ..errors import UsageError
    from ..output.files import check_target
    from ..output.screen import number, say, text
    from ..pipeline.loop import improve_runs
    from ..records import ImproveRecord
    from ..results import failed
    from ..shell.session import check_outputs, deliver, draw, read_all, working

    learns = output is not None and output.lower().endswith(".toml")
    check_outputs([None if learns else output], save_plot)
    if learns:
        check_target(output or "", (".toml",))
    options: dict[str, Any] = {"until_min": until, "extra": extra, "drive": drive, "false_alarm": false_alarm}
    improve_runs(
        [], names(add), auto, together=together, **options
    )  # what is wrong with the options is said before any file is read
    readings = read_all(runs, reading, quiet, [output, save_plot], jobs, from_rise=False)
    if learns and len(readings.runs) > 1 and not together:
        raise UsageError(
            f"{output}: one model file for {len(readings.runs)} runs",
            do="say --together where they are of one machine, learn from one run, or name another output",
        )
    with working(readings, len(readings.runs), "models tried" if len(readings.runs) == 1 else "runs", quiet, jobs) as how:
        result = improve_runs(readings.runs, names(add), auto, how, together, **options)
    drawn = [
        ("step", text("step")),
        ("sensor", text("channel")),
        ("effects", text("effects")),
        ("fit K", number("rmse_fit_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        *([("other runs K", number("rmse_other_runs_c", 3))] if together else []),
        ("noise K", number("noise_c", 3)),
        ("status", text("status")),
    ]
    table, unreadable = None if learns else output, failed(ImproveRecord, readings.unreadable)
    code = deliver(result, unreadable, table, form, quiet, drawn, beneath=("stopped_because", "message"))
    if learns and result.models and result.models[0] is not None:
        result.model.save(output or "")
        if not quiet:
            say(f"model in {output}")
    draw(result, save_plot)
    return code
