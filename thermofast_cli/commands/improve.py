"""``thermofast improve``."""

from typing import TYPE_CHECKING, Any

import click

from ..reading_options import names
from ..shell.options import (
    RunCommand,
    batched,
    false_alarm_option,
    loop_options,
    output_options,
    reading_options,
    runs_argument,
)

if TYPE_CHECKING:
    from ..shell.batch import Batch


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
@batched
def command(
    batch: "Batch",
    until: float | None,
    extra: tuple[str, ...],
    drive: str | None,
    false_alarm: float,
    add: str | None,
    auto: bool,
    together: bool,
) -> int:
    """Add effects to the base model, refit, and show the error fall step by step; -o M.toml writes the model learnt.

    With --together several runs of one machine give one model: what belongs to the machine is shared, what belongs to the run is
    free, and how much the first scatters from run to run is estimated. identify --model starts from it.

    With neither --add nor --auto the base model is learnt and written. The model file serves compare, identify, sweep and
    diagnose through --model, on this run and on others of the same machine.

    A record counts from its first reading unless --start MIN says otherwise: an idle beginning is itself a finding.
    """
    from ..errors import UsageError
    from ..output.files import REPORT_SUFFIXES, TABLE_SUFFIXES, check_target
    from ..output.screen import say
    from ..pipeline.loop import improve_runs
    from ..shell.session import draw

    learns = batch.output is not None and batch.output.lower().endswith(".toml")
    if learns:
        check_target(batch.output or "", (".toml",))
    elif batch.output is not None:
        check_target(batch.output, (*TABLE_SUFFIXES, *REPORT_SUFFIXES, ".toml"))
    options: dict[str, Any] = {"until_min": until, "extra": extra, "drive": drive, "false_alarm": false_alarm}
    options.update(add=names(add), auto=auto, together=together)
    improve_runs([], **options)  # what is wrong with the options is said before any file is read
    readings = batch.read(table=not learns)
    many = len(readings.runs)
    if learns and many > 1 and not together:
        raise UsageError(
            f"{batch.output}: one model file for {many} runs",
            do="say --together where they are of one machine, learn from one run, or name another output",
        )
    with batch.working(readings, many, "models tried" if many == 1 else "runs") as how:
        result = improve_runs(readings.runs, how=how, **options)
    code = batch.tell(result, readings, _drawn(together), "stopped_because", "message", table=not learns)
    if learns and result.models and result.models[0] is not None:
        result.model.save(batch.output or "")
        if not batch.quiet:
            say(f"model in {batch.output}")
    draw(result, batch.save_plot)
    return code


def _drawn(together: bool) -> list[Any]:
    from ..output.screen import number, text

    return [
        ("step", text("step")),
        ("sensor", text("channel")),
        ("effects", text("effects")),
        ("fit K", number("rmse_fit_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        *([("other runs K", number("rmse_other_runs_c", 3))] if together else []),
        ("noise K", number("noise_c", 3)),
        ("status", text("status")),
    ]
