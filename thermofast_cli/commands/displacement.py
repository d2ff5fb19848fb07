"""``thermofast displacement``."""

from typing import TYPE_CHECKING

import click

from ..reading_options import names
from ..shell.options import RunCommand, batched, reading_options, runs_argument, table_options

if TYPE_CHECKING:
    from ..shell.batch import Batch


@click.command(
    "displacement", cls=RunCommand, epilog="Example: thermofast displacement sample_runs/displacement.csv --format table"
)
@runs_argument
@click.option(
    "--displacements", metavar="A,B", help="The displacement columns [um]; those named with um or displacement, by default."
)
@click.option(
    "--methods",
    metavar="A,B",
    help="Some of least_squares, network, arx, network_by_minute, neural_network; the first three (four together) by default.",
)
@click.option("--order", metavar="NA,NB", help="Order of arx in outputs and inputs, the best of a few by default.")
@click.option("--together", is_flag=True, help="The RUNs are of one machine: learn from all, and leave whole runs out in turn.")
@reading_options
@table_options
@click.option(
    "--predicted",
    metavar="FILE",
    help="Write what each method tells of each reading when it was left out: .csv .json .jsonl .parquet .xlsx .md.",
)
@click.option("--save-plot", metavar="FILE", help="Draw measured and predicted displacement, readings left out: .png .pdf .svg.")
@batched
def command(
    batch: "Batch",
    displacements: str | None,
    methods: str | None,
    order: str | None,
    together: bool,
    predicted: str | None,
) -> int:
    """Tell thermal displacement from the temperatures of each RUN, and say which method to trust.

    Least squares, a discrete Bayesian network and a difference equation (arx, for a part that lags its temperatures; it looks at
    --inputs too) are fitted and scored on contiguous blocks of readings left out in turn, or on whole runs with --together.
    'without' is the error there of the better of their mean and a straight line in time, or the other runs at that minute: a method
    that is not clearly below it has learnt nothing.

    Least squares gives a formula to take along: a column of what is written, told below the table where it is the one to trust.

    --together also tries a table for each minute; --methods neural_network a net whose weights a particle swarm starts
    (pip install 'thermofast[neural]').
    """
    from ..output.files import write_table
    from ..output.screen import number, text
    from ..pipeline.around import displacement_runs
    from ..records import PREDICTED_COLUMNS
    from ..shell.session import draw

    lags = _order(order)
    displacement_runs([], (), names(methods), lags, together)  # what is wrong with the options is said before any file is read
    readings = batch.read(predicted)
    result = displacement_runs(readings.runs, names(displacements), names(methods), lags, together)
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
    code = batch.tell(result, readings, drawn)
    if predicted:
        write_table(predicted, "predicted", PREDICTED_COLUMNS, result.predicted_rows())
    draw(result, batch.save_plot)
    return code


def _order(text: str | None) -> tuple[int, int] | None:
    """'2,1' as (2, 1).

    Raises
    ------
    UsageError: not two whole numbers above zero.
    """
    from ..errors import UsageError

    if text is None:
        return None
    parts = text.split(",")
    if len(parts) != 2 or not all(p.strip().isdigit() and 0 < int(p) <= 50 for p in parts):
        raise UsageError("--order: not two whole numbers", found=repr(text), allowed="1 to 50 each, as 2,1")
    return int(parts[0]), int(parts[1])
