"""``thermofast sensitivity``."""

from typing import TYPE_CHECKING, Any

import click

from ..reading_options import names
from ..shell.numbers import Finite
from ..shell.options import (
    RunCommand,
    batched,
    filter_options,
    model_option,
    output_options,
    own_effect_option,
    reading_options,
    runs_argument,
)

if TYPE_CHECKING:
    from ..shell.batch import Batch


@click.command(
    "sensitivity",
    cls=RunCommand,
    epilog="Example: thermofast sensitivity sample_runs/spindle.csv --until 60 --limit 0.2 --format table",
)
@runs_argument
@click.option("--until", type=Finite(0, min_open=True), metavar="MIN", help="Identify on the first MIN minutes, all by default.")
@model_option
@own_effect_option
@filter_options
@click.option("--offset", type=Finite(0), default=0.1, show_default=True, metavar="K", help="Uncertainty of the probe's offset.")
@click.option(
    "--start-level", "start_level", type=Finite(0), default=0.2, show_default=True, metavar="K", help="Of the level at the start."
)
@click.option("--room", type=Finite(0), default=0.3, show_default=True, metavar="K", help="Of the room while readings are taken.")
@click.option("--jitter", type=Finite(0), default=1.0, show_default=True, metavar="S", help="Of each time stamp.")
@click.option(
    "--until-spread",
    "until_spread",
    type=Finite(0),
    default=2.0,
    show_default=True,
    metavar="MIN",
    help="Of the time to identify.",
)
@click.option(
    "--uniform",
    metavar="A,B",
    help="Of offset, start, room, until: known to lie evenly within +- its size, as a tolerance class says.",
)
@click.option("--limit", type=Finite(0, min_open=True), metavar="K", help="Tell the probability of a larger error.")
@reading_options
@output_options
@click.option("--save-plot", metavar="FILE", help="Draw the shares as bars: .png .pdf .svg.")
@batched
def command(
    batch: "Batch",
    until: float | None,
    model: str | None,
    extra: tuple[str, ...],
    filter_name: str,
    preset: str | None,
    settings: tuple[str, ...],
    offset: float,
    start_level: float,
    room: float,
    jitter: float,
    until_spread: float,
    uniform: str | None,
    limit: float | None,
) -> int:
    """Say how much each uncertain thing contributes to the spread of the steady state and of the settling time.

    Uncertain are the probe's noise (from the record), its offset, the level at the start, the room, the time stamps and the
    identification time, each by the standard deviation of its option; with --model also the machine's constants, by their
    standard errors in the file. 'alone' is the share of the variance that a thing has by itself (first-order Sobol index), 'in
    all' that with what it does together with others; 'confidence' is how often it keeps its rank by that when the runs are drawn
    anew. --limit is about the steady state's distance from its mean. What the machine does beside the law is not among them: the
    interval of identify counts it.
    """
    from ..analysis.sensitivity import BOUNDS, Sizes
    from ..errors import UsageError
    from ..pipeline.around import sensitivity_runs
    from ..pipeline.methods import choose
    from ..shell.session import draw, load_model

    method = choose(filter_name, preset, settings)
    if model and (filter_name != "afukf" or preset or settings):
        raise UsageError("--model puts a joint fit in the filter's place", do="leave --filter, --preset and --set out")
    even = names(uniform)
    if unknown := [name for name in even if name not in BOUNDS]:
        raise UsageError(f"--uniform: {unknown[0]!r} is no size whose bounds may be given", allowed=", ".join(BOUNDS))
    learnt = load_model(model, extra)
    readings = batch.read(from_rise=learnt is None)
    sizes = Sizes(offset, start_level, room, jitter, until_spread, limit, even)
    with batch.working(readings, len(readings.runs), "runs") as how:
        result = sensitivity_runs(readings.runs, method, sizes, until, learnt, how)
    code = batch.tell(result, readings, _drawn())
    draw(result, batch.save_plot)
    return code


def _drawn() -> list[Any]:
    from ..output.screen import number, text

    return [
        ("sensor", text("channel")),
        ("of", text("quantity")),
        ("spread", number("deviation", 3)),
        ("uncertain", text("factor")),
        ("by", number("size", 4)),
        ("", text("unit")),
        ("alone", number("first_order", 3)),
        ("in all", number("total", 3)),
        ("rank", number("rank", 0)),
        ("confidence", number("rank_p", 2)),
        ("p(> limit)", number("exceed_p_mc", 4)),
        ("status", text("status")),
    ]
