"""``thermofast calibrate``."""

from typing import Any

import click

from ..shell.options import RunCommand, reading_options, runs_argument, table_options


@click.command(
    "calibrate",
    cls=RunCommand,
    epilog="Example: thermofast calibrate sample_runs/spindle.csv sample_runs/cool_down.csv --lab lab.toml",
)
@runs_argument
@click.option("--lab", metavar="FILE.toml", help="Write what was learnt, for --imperfection of identify and sweep.")
@reading_options
@table_options
def command(runs: tuple[str, ...], lab: str | None, form: str | None, output: str | None, quiet: bool, **reading: Any) -> int:
    """Learn from complete RUNs how imperfect the machines of this lab are, so that intervals are as wide as they need to be.

    Each run is read at several times as if it went no further, and what is foretold of its end is held against the end. Half-widths
    are multiplied by a factor that the errors ask for, shrunk towards one where runs are few; every figure of the table is of
    runs that its factor was not learnt from.
    """
    from ..errors import UsageError
    from ..output.screen import number, say, text
    from ..pipeline.around import calibrate_runs
    from ..pipeline.methods import choose
    from ..records import CalibrateRecord, failed
    from ..shell.session import check_outputs, deliver, read_all, working

    if output and output.endswith(".toml"):
        lab, output = lab or output, None
    if lab is not None and not lab.endswith(".toml"):
        raise UsageError("--lab writes TOML", found=lab, do="say --lab lab.toml")
    check_outputs([output])
    readings = read_all(runs, reading, quiet, [output, lab], 1)
    with working(readings, len(readings.runs), "runs", quiet, 1) as how:
        result = calibrate_runs(readings.runs, choose("afukf", None, ()), how)
    if lab is not None:
        result.save(lab)
        if not quiet:
            say(f"{lab}: for thermofast identify --imperfection {lab}")
    drawn = [
        ("read, time constants", number("time_constants", 1)),
        ("runs", number("runs", 0)),
        ("sensors", number("sensors", 0)),
        ("held before", number("held_typical", 2)),
        ("width K", number("width_typical_c", 2)),
        ("held now", number("held_lab", 2)),
        ("width K", number("width_lab_c", 2)),
        ("score ratio", number("score_ratio", 2)),
        ("factor", number("factor", 2)),
        ("conformal", number("conformal_factor", 2)),
        ("status", text("status")),
    ]
    return deliver(result, failed(CalibrateRecord, readings.unreadable), output, form, quiet, drawn)
