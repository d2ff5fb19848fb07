"""``thermofast identify``."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from ..shell.numbers import Finite, Real
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

    from ..pipeline.request import Request
    from ..shell.batch import Batch


@click.command(
    "identify", cls=RunCommand, epilog="Example: thermofast identify sample_runs/spindle.csv --until 60 --save-plot spindle.png"
)
@runs_argument
@click.option(
    "--until",
    type=Finite(0, min_open=True),
    metavar="MIN",
    help="Use the first MIN minutes only; the rest shows the error ahead.",
)
@click.option(
    "--at",
    type=Finite(0, min_open=True),
    metavar="MIN",
    help="Say the temperature MIN minutes after the rise begins too (with --drive, after the record begins).",
)
@click.option("--room", type=Finite(-100, 500), metavar="DEGC", help="Say the steady state in such a room too; needs its column.")
@criterion_option
@click.option("--limit", type=Finite(-100, 5000), metavar="DEGC", help="Say how far the steady state stays below a limit.")
@click.option(
    "--switch-off-at",
    type=Real(),
    metavar="MIN",
    help="The machine was switched off then (0 the first reading, -1.5 before it): say the temperature at that moment.",
)
@imperfection_options
@model_option
@own_effect_option
@drive_option
@click.option("--auto", is_flag=True, help="Look for what is missing in the readings used, and add it before predicting.")
@click.option(
    "--pace",
    metavar="MIN:FACTOR,..",
    help="After the last reading used the rate is multiplied by FACTOR for MIN minutes, and so on; the last factor then stays.",
)
@click.option(
    "--joint", is_flag=True, help="One AFUKF over all sensors of a run: the innovations of all of them together trigger its fading."
)
@filter_options
@reading_options
@output_options
@scale_options
@click.option("--trace", metavar="FILE", help="Write what the filter did at each reading: .csv .json .jsonl .parquet .xlsx .md.")
@click.option("--save-plot", metavar="FILE", help="Draw measurement, model and band per sensor: .png .pdf .svg.")
@click.option("--plot-trace", is_flag=True, help="Add rate and steady state converging to the picture of --save-plot.")
@batched
def command(
    batch: "Batch",
    until: float | None,
    at: float | None,
    room: float | None,
    criterion: str | None,
    limit: float | None,
    switch_off_at: float | None,
    imperfection: str,
    rates: "Rates",
    model: str | None,
    extra: tuple[str, ...],
    drive: str | None,
    auto: bool,
    pace: str | None,
    joint: bool,
    filter_name: str,
    preset: str | None,
    settings: tuple[str, ...],
    trace: str | None,
    plot_trace: bool,
) -> int:
    """Say where each sensor of each RUN will settle and when 95 % of the rise is done.

    RUN is a CSV or Parquet file, or - for standard input. One record per sensor; status tells how far to trust it:
    ok, not_determined (a side of an interval is open), model_doubtful (more is at work than machines usually do).
    Intervals count readings and machine; --imperfection none counts the readings alone, as do filters that close without a
    likelihood (ukf, ekf, svd_ukf, ckf, cqkf, fading_ukf) and --preset paper.
    """
    from ..archives.blocks import Analysis
    from ..output.files import write_table
    from ..output.screen import say
    from ..pipeline.methods import choose, paces, stopping_rule
    from ..pipeline.request import Request
    from ..pipeline.sensors import from_rise, identify_runs
    from ..records import TRACE_COLUMNS
    from ..shell.session import draw, load_imperfection, load_model
    from ..standards.stopping import in_words

    method = replace(choose(filter_name, preset, settings, load_imperfection(imperfection), rates), paces=paces(pace))
    if plot_trace and not batch.save_plot:
        raise UsageError("--plot-trace adds to a picture", do="say where with --save-plot FILE.png")
    learnt, rule = load_model(model, extra), stopping_rule(criterion)
    request = Request(until, at, room, rule, limit, switch_off_at, learnt, drive, auto=auto, joint=joint)
    request.check(method)  # wrong options are told before reading
    work = partial(identify_runs, method=method, request=request)
    together = {"criterion": rule, "joint": joint, "model": learnt, "drive": drive, "auto": auto}
    analysis = Analysis.of_sensors("identify", work, filter_name, together, from_rise=from_rise(learnt, drive))
    if batch.is_archive:
        return batch.archive(analysis)
    readings = batch.read(trace, from_rise=analysis.from_rise, search=auto or learnt is not None)
    with batch.working(readings, readings.sensors, "sensors") as how:
        result = identify_runs(readings.runs, method, replace(request, details=bool(trace) or batch.wants_details), how)
    for sentence in in_words(result.records) if rule and not batch.quiet else ():
        say(sentence)
    code = batch.tell(result, readings, _drawn(request), filter=filter_name)
    if trace:
        write_table(trace, "trace", TRACE_COLUMNS, result.trace_rows())
    draw(result, batch.save_plot, trace=plot_trace)
    return code


def _share_unseen(row: dict[str, Any]) -> str:
    """How much of the rise a slower part of the machine may add that the record cannot exclude."""
    return str(row["unseen"]).rpartition("up to ")[2].replace(" of the rise", "") if row["unseen"] else "-"


def _drawn(request: "Request") -> list[Any]:
    """The columns of a drawn table: those of every sensor, and of what was asked for."""
    from ..output.screen import interval, number, text

    drawn = [
        ("sensor", text("channel")),
        ("settles degC", number("steady_state_c")),
        ("95 % interval", interval("steady_state_lo_c", "steady_state_hi_c")),
        ("measured", number("steady_state_measured_c")),
        ("t95 min", number("t95_min", 1)),
        ("95 % interval", interval("t95_lo_min", "t95_hi_min", 1)),
        ("to go min", number("time_to_go_min", 0)),
        ("noise K", number("noise_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        ("unseen, up to", _share_unseen),
    ]
    if request.at_min is not None:
        drawn[4:4] = [(f"at {request.at_min:g} min", number("at_c")), ("95 % interval", interval("at_lo_c", "at_hi_c"))]
    if request.room_c is not None:
        drawn[3:3] = [
            (f"in {request.room_c:g} degC", number("room_steady_c")),
            ("95 % interval", interval("room_steady_lo_c", "room_steady_hi_c")),
        ]
    if request.criterion is not None:
        drawn += [
            ("rule holds min", number("trip_min", 1)),
            ("95 % interval", interval("trip_lo_min", "trip_hi_min", 1)),
            ("on", text("trip_from")),
            ("missing K then", number("missing_k")),
            ("95 % interval", interval("missing_lo_k", "missing_hi_k")),
            ("three-point degC", number("three_point_c")),
        ]
    if request.limit_c is not None:
        drawn += [
            (f"K below {request.limit_c:g} degC", number("margin_k")),
            ("95 % interval", interval("margin_lo_k", "margin_hi_k")),
            ("chance above", number("over_limit_p", 3)),
        ]
    if request.switch_off_min is not None:
        drawn += [
            ("at switch-off", number("switch_off_c")),
            ("95 % interval", interval("switch_off_lo_c", "switch_off_hi_c")),
        ]
    return [*drawn, ("status", text("status"))]
