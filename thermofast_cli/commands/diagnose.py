"""``thermofast diagnose``."""

import shlex
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..reading_options import names
from ..shell.options import (
    RunCommand,
    batched,
    false_alarm_option,
    loop_options,
    model_option,
    output_options,
    reading_options,
    runs_argument,
    scale_options,
)

if TYPE_CHECKING:
    from ..results import Diagnosis
    from ..shell.batch import Batch


@click.command("diagnose", cls=RunCommand, epilog="Example: thermofast diagnose sample_runs/hidden.csv --format table")
@runs_argument
@loop_options
@false_alarm_option
@click.option("--effects", metavar="A,B", help="Look for these effects only: ids, or FILE.py:CLASS.")
@click.option("--together", is_flag=True, help="The RUNS are of one machine: one search of all of them.")
@click.option(
    "--write-effect",
    metavar="FILE.py",
    help="Where the heat that one RUN needs follows its logged columns, write that as an effect of your own, to read and add.",
)
@click.option(
    "--next", "next_experiment", is_flag=True, help="Where causes remain open: simulate which run would settle it (minutes)."
)
@model_option
@reading_options
@output_options
@click.option("--save-plot", metavar="FILE", help="Draw what is left with each effect that was tried: .png .pdf .svg.")
@scale_options
@batched
def command(
    batch: "Batch",
    until: float | None,
    extra: tuple[str, ...],
    drive: str | None,
    false_alarm: float,
    effects: str | None,
    together: bool,
    next_experiment: bool,
    write_effect: str | None,
    model: str | None,
) -> int:
    """Say which physical effect the base model (or the model of --model) lacks on each RUN.

    The verdict is an effect, up to four joined by '+', 'none', or 'unexplained'. An effect is named only if chance would not give
    its gain (--false-alarm, over everything that is tried), an unknown disturbance of the same size and colour explains the
    misfit far less well, the error on readings left out falls, and the record determines its parameters, or is so much likelier
    with it that only its size is open. 'partly_explained' says that a pattern remains beside it, as on most machines: what it is
    worth, and what remains, stand in the row.

    With --together the evidence for an effect is summed over several runs of one machine; what one run alone shows is its event.

    --next assumes each remaining cause in turn to be the true one, simulates the runs that it would give (once more, longer, read
    faster, with the surroundings logged, with the heat switched off and on or halved, with one part heated alone) and searches
    them: the run proposed is one that most often settles it. With --together it is asked of all runs at once.

    A record counts from its first reading unless --start MIN says otherwise: an idle beginning is itself a finding.
    """
    from ..archives.blocks import Analysis
    from ..pipeline.loop import diagnose_runs
    from ..records import DiagnoseRecord
    from ..shell.session import draw, load_model

    if write_effect:
        from ..analysis.effect_file import check_effect_runs, check_effect_target

        check_effect_target(write_effect)
    options: dict[str, Any] = {"until_min": until, "extra": extra, "drive": drive, "false_alarm": false_alarm}
    options["model"] = load_model(model, extra, True)
    options["together"], options["next_experiment"] = together, next_experiment
    work: Callable[..., Diagnosis] = partial(diagnose_runs, effects=names(effects), **options)
    work([])  # what is wrong with the options is said before any file is read
    if batch.is_archive:
        return batch.archive(Analysis("diagnose", DiagnoseRecord, work))
    readings = batch.read()
    if write_effect:
        check_effect_runs([run for run, _ in readings.runs], drive)
    with batch.working(readings, len(readings.runs), "models tried" if len(readings.runs) == 1 else "runs") as how:
        result = work(readings.runs, how=how)
    code = batch.tell(result, readings, _drawn(), "message", "advice")
    draw(result, batch.save_plot)
    if write_effect:
        _write(readings.runs, write_effect, batch.quiet, {k: options[k] for k in ("until_min", "drive", "model")})
    return code


def _drawn() -> list[Any]:
    from ..output.screen import number, percent, text

    return [
        ("sensor", text("channel")),
        ("verdict", text("verdict")),
        ("also possible", text("also_possible")),
        ("event min", number("event_min", 1)),
        ("explains", percent("explained_share")),
        ("base ahead K", number("rmse_base_ahead_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        ("remains K", number("remaining_c", 3)),
        ("noise K", number("noise_c", 3)),
        ("status", text("status")),
    ]


def _write(runs: Any, path: str, quiet: bool, options: dict[str, Any]) -> None:
    from ..analysis.unknown_heat import NO_COLUMN
    from ..pipeline.loop import write_effect_of

    written = write_effect_of(runs, path, **options)
    if quiet and written:
        return
    if written is None:
        click.echo(f"{path}: not written: {NO_COLUMN}", err=True)
        return
    add = f"thermofast improve {written.again} --add {shlex.quote(written.spec)}"
    click.echo(f"{written.words}\n{path}: written; {add}", err=True)
