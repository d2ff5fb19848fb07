"""``thermofast displacement``."""

from typing import Any

import click

from ..reading_options import names
from ..shell.options import RunCommand, reading_options, runs_argument, table_options


@click.command(
    "displacement", cls=RunCommand, epilog="Example: thermofast displacement sample_runs/displacement.csv --format table"
)
@runs_argument
@click.option(
    "--displacements", metavar="A,B", help="The displacement columns [um]; those named with um or displacement, by default."
)
@reading_options
@table_options
@click.option("--save-plot", metavar="FILE", help="Draw measured and predicted displacement, readings left out: .png .pdf .svg.")
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
    from ..output.screen import number, text
    from ..pipeline.around import displacement_runs
    from ..records import DisplacementRecord
    from ..results import failed
    from ..shell.session import check_outputs, deliver, draw, read_all

    check_outputs([output], save_plot)
    readings = read_all(runs, reading, quiet, [output, save_plot], 1, from_rise=False)
    result = displacement_runs(readings.runs, names(displacements))
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
    code = deliver(result, failed(DisplacementRecord, readings.unreadable), output, form, quiet, drawn)
    draw(result, save_plot)
    return code
