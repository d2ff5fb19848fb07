"""``thermofast diagnose``."""

from typing import Any

import click

from ..shell.options import (
    READING,
    RunCommand,
    false_alarm_option,
    loop_options,
    model_option,
    names,
    output_options,
    reading_options,
    runs_argument,
)


@click.command("diagnose", cls=RunCommand, epilog="Example: thermofast diagnose sample_runs/hidden.csv --format table")
@runs_argument
@loop_options
@false_alarm_option
@click.option("--effects", metavar="A,B", help="Look for these effects only: ids, or FILE.py:CLASS.")
@model_option
@reading_options
@output_options
def command(
    runs: tuple[str, ...],
    until: float | None,
    extra: tuple[str, ...],
    drive: str | None,
    false_alarm: float,
    effects: str | None,
    model: str | None,
    form: str | None,
    output: str | None,
    jobs: int | None,
    quiet: bool,
    **reading: Any,
) -> int:
    """Say which physical effect the base model (or the model of --model) lacks on each RUN.

    The verdict is an effect, two joined by '+', 'none', or 'unexplained'. An effect is named only if chance would not give its gain
    (--false-alarm, over everything that is tried), the error on readings left out falls, the record determines its
    parameters, and every sensor comes down to its noise.

    A record counts from its first reading unless --start MIN says otherwise: an idle beginning is itself a finding.
    """
    from ..discovery.diagnose import diagnose_lost, diagnose_task
    from ..output.screen import number, text
    from ..records import DiagnoseRecord
    from ..shell.loop_session import loop_tasks, run_loop
    from ..shell.session import deliver, exit_code

    given = {k: reading[k] for k in READING}
    options: dict[str, Any] = {
        "until_min": until,
        "extra": extra,
        "drive": drive,
        "false_alarm": false_alarm,
        "names": names(effects),
        "model": model,
    }
    tasks, unreadable = loop_tasks(runs, given, quiet, [output], **options)
    found, interrupted = run_loop(diagnose_task, tasks, jobs, diagnose_lost, quiet, shares=True)
    records = [r for rs in found for r in rs]
    records += [DiagnoseRecord(name, "", status="unreadable", message=why) for name, why in unreadable]
    drawn = [
        ("sensor", text("channel")),
        ("verdict", text("verdict")),
        ("also possible", text("also_possible")),
        ("event min", number("event_min", 1)),
        ("base ahead K", number("rmse_base_ahead_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        ("noise K", number("noise_c", 3)),
        ("status", text("status")),
    ]
    deliver("diagnose", records, DiagnoseRecord, output, form, quiet, drawn, [t.run for t in tasks], beneath=("message", "advice"))
    return exit_code(records, interrupted)
