"""``thermofast watch``."""

import sys
from typing import TYPE_CHECKING, Any

import click

from ..shell.numbers import Finite
from ..shell.options import (
    RunCommand,
    drive_option,
    filter_options,
    imperfection_options,
    model_option,
    own_effect_option,
    reading_options,
    table_options,
)

if TYPE_CHECKING:
    from thermofast.models.imperfection import Rates


@click.command("watch", cls=RunCommand, epilog="Example: thermofast watch sample_runs/spindle.csv --tolerance 1 --replay 6000x")
@click.argument("run", metavar="RUN")
@click.option(
    "--tolerance",
    type=Finite(0, min_open=True),
    default=0.5,
    show_default=True,
    metavar="K",
    help="Half-width to which every sensor's steady state is to be known.",
)
@click.option("--exit", "leave", is_flag=True, help="End as soon as the test can be stopped.")
@click.option(
    "--exec",
    "execute",
    metavar="COMMAND",
    help="Run a shell command at that moment, beside the watch; when that ends it has a minute more.",
)
@click.option("--jsonl", metavar="FILE", help="Append what is known at each look to FILE, a line of JSON each.")
@click.option("--replay", metavar="600x|max", help="Play a finished record, so many times as fast as it was.")
@click.option(
    "--poll", type=Finite(0.05, 3600), default=1.0, show_default=True, metavar="SECONDS", help="How often to look for readings."
)
@click.option("--give-up", type=Finite(0, min_open=True), metavar="MIN", help="End after MIN minutes without a new reading.")
@imperfection_options
@model_option
@own_effect_option
@drive_option
@filter_options
@reading_options
@table_options
def command(
    run: str,
    tolerance: float,
    leave: bool,
    execute: str | None,
    jsonl: str | None,
    replay: str | None,
    poll: float,
    give_up: float | None,
    imperfection: str,
    rates: "Rates",
    model: str | None,
    extra: tuple[str, ...],
    drive: str | None,
    filter_name: str,
    preset: str | None,
    settings: tuple[str, ...],
    form: str | None,
    output: str | None,
    quiet: bool,
    **reading: Any,
) -> int:
    """Follow a record while it is written, and say when the test can be stopped.

    RUN is a file that a logger is writing, a named pipe, or - for standard input. It is looked at again when it has grown by 1 %.
    "You can stop now" is said when all of this holds: every sensor is ok; 1.15 times its half-width is within --tolerance, and has
    been for some time; some sensor has moved by two tolerances; and 1.5 time constants have passed, because a slower part of the
    machine does not show sooner (one ten times as slow does after five). The last condition is dropped where past runs are known:
    --model of this machine, or --imperfection lab.toml where calibrate found strong effects to be rare. --channels chooses
    sensors. The last look is printed when the input ends, at the stop (--exit), or at Ctrl-C.
    With --exit the exit code is 3 where the record ended before it could be stopped.
    """
    from ..output.files import check_targets
    from ..output.screen import say
    from ..pipeline.methods import choose
    from ..pipeline.watching import speed_of, watch_run
    from ..reading_options import options_from
    from ..results import Watching
    from ..shell.live import Looks, commanded, shown
    from ..shell.session import check_outputs, deliver, load_imperfection, load_model, more_outputs

    method = choose(filter_name, preset, settings, load_imperfection(imperfection), rates)
    speed = speed_of(replay)
    check_targets([output, jsonl, *more_outputs()], [run])
    check_outputs([output], None)
    learnt = load_model(model, extra)
    options = options_from({name: value for name, value in reading.items() if name != "start"})
    how = options, reading["start"], method, tolerance, learnt, leave, speed, poll, give_up
    looks = Looks(jsonl)
    with commanded(execute) as commands:
        with shown(tolerance, quiet, looks, commands) as tell:
            last, read = watch_run(run, *how, tell, drive)
        if not quiet and (sys.stderr.isatty() or not last.stop):  # a table that was drawn in place is gone
            before = "what was said of stopping is no longer sure" if looks.stopped else "it ended before the test could be stopped"
            say(last.words if last.stop else f"{before}: {last.words}")
        code = deliver(Watching(last.records, (read,), looked=last), [], output, form, quiet, _drawn())
    if looks.failed and code == 0:
        return 2
    return 3 if leave and not last.stop and code == 0 else code


def _drawn() -> list[Any]:
    """The columns of a drawn table."""
    from ..output.screen import interval, number, text

    return [
        ("sensor", text("channel")),
        ("settles degC", number("steady_state_c")),
        ("95 % interval", interval("steady_state_lo_c", "steady_state_hi_c")),
        ("t95 min", number("t95_min", 1)),
        ("to go min", number("time_to_go_min", 0)),
        ("status", text("status")),
    ]
