"""``thermofast validate``."""

from typing import TYPE_CHECKING

import click

from ..shell.numbers import Finite
from ..shell.options import RunCommand, batched, output_options, own_effect_option, ranges, reading_options, runs_argument

if TYPE_CHECKING:
    from ..shell.batch import Batch


@click.command(
    "validate",
    cls=RunCommand,
    epilog="Example: thermofast validate machine.toml runs/*.csv --until 30 --save-plot areas.png",
)
@click.argument("model", metavar="M.toml")
@runs_argument
@own_effect_option
@click.option(
    "--until",
    type=Finite(0, min_open=True),
    required=True,
    metavar="MIN",
    help="Each run is carried on from its first MIN minutes.",
)
@click.option(
    "--input-range",
    "input_ranges",
    multiple=True,
    metavar="COLUMN=X",
    help="A logged input is only known to within +- X of its unit: only what no such value explains counts. May be repeated.",
)
@reading_options
@output_options
@click.option("--save-plot", metavar="FILE", help="Draw the distributions with the area between them: .png .pdf .svg.")
@batched
def command(
    batch: "Batch",
    model: str,
    extra: tuple[str, ...],
    until: float,
    input_ranges: tuple[str, ...],
) -> int:
    """Hold a model that 'thermofast improve' learnt against a set of RUNs of its machine, as whole distributions.

    Each run is carried on from its first minutes; its least and its largest temperature after them are one sample of what was
    measured, and draws of the model with its constants and the noise uncertain are samples of what it says. The area between the
    two distributions [K] is the metric (Zhao, Lyu and Kan 2018); 'right' is what a right model would leave with so many runs, and
    p how often it would leave as much.
    """
    from ..output.screen import number, text
    from ..pipeline.around import validate_runs
    from ..shell.session import draw, load_model

    allowed = ranges(input_ranges)
    learnt = load_model(model, extra)
    assert learnt is not None
    readings = batch.read()
    with batch.working(readings, len(readings.runs), "runs") as how:
        result = validate_runs(readings.runs, learnt, until, allowed, how)
    drawn = [
        ("sensor", text("channel")),
        ("runs", number("runs", 0)),
        ("least K", number("area_low_c", 3)),
        ("largest K", number("area_high_c", 3)),
        ("area K", number("area_c", 3)),
        ("outside K", number("outside_c", 3)),
        ("right K", number("expected_c", 3)),
        ("p", number("p", 3)),
        ("status", text("status")),
    ]
    code = batch.tell(result, readings, drawn)
    draw(result, batch.save_plot)
    return code
