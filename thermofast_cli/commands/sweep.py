"""``thermofast sweep``."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..shell.numbers import Finite
from ..shell.options import (
    RunCommand,
    batched,
    criterion_option,
    drive_option,
    filter_options,
    imperfection_options,
    model_option,
    output_options,
    own_effect_option,
    reading_options,
    runs_argument,
    scale_options,
)

if TYPE_CHECKING:
    from thermofast.models.imperfection import Rates

    from ..results import Sweeping
    from ..shell.batch import Batch


@click.command(
    "sweep", cls=RunCommand, epilog="Example: thermofast sweep --windows 40,45,50,55 sample_runs/spindle.csv --save-plot sweep.png"
)
@runs_argument
@click.option("--windows", default="40,45,50,55", show_default=True, metavar="MIN,MIN", help="Sampling windows.")
@click.option(
    "--times", metavar="FIRST:LAST:STEP", help="Identification times; from 5 min (or a tenth) to the longest window by default."
)
@click.option(
    "--tolerance",
    type=Finite(0, min_open=True),
    default=0.1,
    show_default=True,
    metavar="K",
    help="Half-width of the steady state's interval to reach.",
)
@criterion_option
@imperfection_options
@model_option
@own_effect_option
@drive_option
@filter_options
@reading_options
@output_options
@scale_options
@click.option("--save-plot", metavar="FILE", help="Draw RMSE against identification time, one curve per window: .png .pdf .svg.")
@batched
def command(
    batch: "Batch",
    windows: str,
    times: str | None,
    tolerance: float,
    criterion: str | None,
    imperfection: str,
    rates: "Rates",
    model: str | None,
    extra: tuple[str, ...],
    drive: str | None,
    filter_name: str,
    preset: str | None,
    settings: tuple[str, ...],
) -> int:
    """Find the shortest identification time that serves, by the RMSE of the model over sampling windows.

    For every identification time the model identified on the readings so far runs over the whole window; best_time_min is where
    its RMSE is least, shortest_time_min the time from which it stays within the noise of that in every window, and
    tolerance_time_min the time from which the steady state is known to within +- the --tolerance, the machine counted.
    """
    from ..archives.blocks import Analysis
    from ..pipeline.methods import choose, stopping_rule
    from ..pipeline.sensors import default_times, from_rise, sweep_runs
    from ..shell.options import numbers
    from ..shell.session import draw, load_imperfection, load_model

    method = choose(filter_name, preset, settings, load_imperfection(imperfection), rates)
    spans = numbers(windows, "--windows")
    grid = numbers(times, "--times") if times else default_times(spans)
    learnt, rule = load_model(model, extra), stopping_rule(criterion)
    asked: dict[str, Any] = {"windows_min": spans, "times_min": grid, "tolerance_c": tolerance, "criterion": rule}
    work: Callable[..., Sweeping] = partial(sweep_runs, method=method, model=learnt, drive=drive, **asked)
    together = {"model": learnt, "drive": drive}
    analysis = Analysis.of_sensors("sweep", work, filter_name, together, from_rise=from_rise(learnt, drive))
    if batch.is_archive:
        return batch.archive(analysis)
    readings = batch.read(from_rise=analysis.from_rise, search=False)
    with batch.working(readings, readings.sensors if analysis.together else len(readings.runs), "sensors") as how:
        result = work(readings.runs, details=batch.wants_details, how=how)
    code = batch.tell(result, readings, _drawn(rule is not None), **analysis.more)
    draw(result, batch.save_plot)
    return code


def _drawn(rule: bool) -> list[Any]:
    from ..output.screen import number, text

    return [
        ("sensor", text("channel")),
        ("window min", number("window_min", 0)),
        ("best time", number("best_time_min", 1)),
        ("rmse K", number("rmse_c", 4)),
        ("earliest", number("earliest_time_min", 1)),
        ("shortest time", number("shortest_time_min", 1)),
        ("to tolerance", number("tolerance_time_min", 1)),
        ("agreed", text("agreed")),
        *([("rule holds", number("trip_min", 1)), ("missing K then", number("missing_k"))] if rule else []),
        ("status", text("status")),
    ]
