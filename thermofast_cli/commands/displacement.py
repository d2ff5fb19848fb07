"""``thermofast displacement``."""

from typing import Any

import click

from ..shell.options import READING, RunCommand, names, reading_options, runs_argument, table_options


@click.command(
    "displacement", cls=RunCommand, epilog="Example: thermofast displacement sample_runs/displacement.csv --format table"
)
@runs_argument
@click.option(
    "--displacements", metavar="A,B", help="The displacement columns [um]; those named with um or displacement, by default."
)
@reading_options
@table_options
@click.option("--save-plot", metavar="FILE", help="Draw measured and told displacement, readings left out: .png .pdf .svg.")
def command(
    runs: tuple[str, ...],
    displacements: str | None,
    form: str | None,
    output: str | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Tell thermal displacement from the temperatures of each RUN, and say which way to trust.

    A discrete Bayesian network and least squares are fitted to the readings and scored on contiguous blocks of readings left out in
    turn. 'without' is the error there of the better of their mean and a straight line in time: a model that is not clearly
    below it has learnt nothing.
    """
    from ..analysis.displacement import displacement_run
    from ..errors import UsageError
    from ..output.files import TABLE_SUFFIXES, check_target, check_targets
    from ..output.screen import number, text
    from ..records import DisplacementRecord
    from ..shell.session import choose_sources, deliver, exit_code, read_all

    if output:
        check_target(output, TABLE_SUFFIXES)
    if save_plot:
        from ..output.plots import check_picture

        check_picture(save_plot)
    sources = choose_sources(runs)
    check_targets([output, save_plot], sources)
    readings = read_all(sources, {k: reading[k] for k in READING}, quiet, 1)
    told = []
    for run, start in readings.runs:
        known = {**run.displacements, **run.channels}
        chosen = names(displacements) or tuple(run.displacements)
        missing = [c for c in chosen if c not in known]
        if missing:
            raise UsageError(f"{run.name}: --displacements {missing[0]!r} is no column of this record", allowed=", ".join(known))
        told.append(displacement_run(run, chosen, start if reading["start"] != "auto" else 0.0))
    records = [r for t in told for r in t.records]
    records += [DisplacementRecord(name, "", status="unreadable", message=why) for name, why in readings.unreadable]
    drawn = [
        ("displacement", text("channel")),
        ("by", text("method")),
        ("fitted um", number("rmse_fit_um", 2)),
        ("left out um", number("rmse_ahead_um", 2)),
        ("without um", number("baseline_um", 2)),
        ("in interval", number("coverage", 2)),
        ("trust", text("trusted")),
        ("status", text("status")),
    ]
    deliver("displacement", records, DisplacementRecord, output, form, quiet, drawn, [r for r, _ in readings.runs])
    if save_plot:
        from ..output.displacement_plots import plot_displacement

        plot_displacement(save_plot, [p for t in told for p in t.panels])
    return exit_code(records, False)
