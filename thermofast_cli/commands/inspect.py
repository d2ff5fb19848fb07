"""``thermofast inspect``."""

from typing import Any

import click

from ..shell.options import RunCommand, reading_options, runs_argument, table_options


@click.command("inspect", cls=RunCommand, epilog="Example: thermofast inspect sample_runs/spindle.csv")
@runs_argument
@reading_options
@table_options
@click.option("--write", "settings", metavar="FILE.toml", help="Write how the one RUN was read as settings, to be corrected.")
@click.option("--save-plot", metavar="FILE", help="Draw all columns that were read over time: .png .pdf .svg.")
def command(
    runs: tuple[str, ...],
    form: str | None,
    output: str | None,
    quiet: bool,
    settings: str | None,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Show what is read of each RUN before any mathematics: its columns, what each is taken for, unit, first and last readings.

    Temperatures are in degC and times in elapsed minutes, whatever the file has; what had to be guessed is marked, with the option
    that overrules it. A file that is refused is shown as far as it can be, above the reason. On a terminal a small picture follows.

    --write makes a settings file of it (thermofast.toml in this folder is read by every command): correct a line, and the file is
    read that way from then on.
    """
    from ..errors import ThermofastError, UsageError
    from ..output.pictures.inspect import show_plot
    from ..output.screen import chosen_format, draw, say, show_text, text
    from ..pipeline.inspecting import columns_of, inspect_runs
    from ..reading_options import options_from
    from ..results import Inspection
    from ..shell.session import check_outputs, deliver, read_all
    from ..shell.session import draw as draw_picture
    from ..shell.settings import free_for_settings, write_settings

    check_outputs([output], save_plot)
    drawn = [(h, text(h)) for h in ("column", "role", "unit")]
    drawn += [("readings", _count), ("first", _value("first")), ("last", _value("last")), ("guessed", text("guessed"))]
    drawn += [("note", text("note"))]
    if settings:
        free_for_settings(settings)
    try:
        readings = read_all(runs, reading, True, [output, save_plot, settings], 1)
    except ThermofastError:
        options = options_from({k: v for k, v in reading.items() if k != "start"})
        rows = columns_of(runs[0], options) if len(runs) == 1 and runs[0] != "-" else []
        if rows and chosen_format(form) == "table":
            draw("refused:", [r.as_dict() for r in rows], drawn, ())
        elif rows and not output:
            deliver(Inspection(tuple(rows)), [], None, form, quiet, drawn, ())
        raise
    result = inspect_runs([run for run, _ in readings.runs])
    if settings and len(result.runs) != 1:
        raise UsageError("--write takes one RUN", found=f"{len(result.runs)} runs", do="name one file, or one run as in run.csv#1")
    code = deliver(result, [], output, form, quiet, drawn, ())
    for error in readings.unreadable:
        say(error[1])
    if chosen_format(form) == "table" and not output:
        for run in result.runs:
            show_text("".join(f"  {note}\n" for note in (*run.notes, *map(str, run.guesses))) + "\n")
            show_plot(run)
    draw_picture(result, save_plot)
    if settings:
        write_settings(settings, result.runs[0], reading)
        if not quiet:
            say(f"how it was read is in {settings}")
    return 1 if readings.unreadable else code


def _count(row: dict[str, Any]) -> str:
    return str(row["readings"]) if row["readings"] else "-"


def _value(name: str) -> Any:
    def form(row: dict[str, Any]) -> str:
        return "-" if row[name] is None else f"{row[name]:.5g}"

    return form
