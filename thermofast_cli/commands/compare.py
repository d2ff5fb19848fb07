"""``thermofast compare``."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..reading_options import names
from ..shell.options import (
    RunCommand,
    batched,
    loop_options,
    model_option,
    output_options,
    ranges,
    reading_options,
    runs_argument,
    scale_options,
)

if TYPE_CHECKING:
    from ..results import Comparison
    from ..shell.batch import Batch


@click.command(
    "compare", cls=RunCommand, epilog="Example: thermofast compare sample_runs/hidden.csv --until 240 --save-plot compare.png"
)
@runs_argument
@loop_options
@click.option("--effects", metavar="A,B", help="Add these effects to the base model: ids, or FILE.py:CLASS.")
@model_option
@click.option(
    "--input-range",
    "input_ranges",
    multiple=True,
    metavar="COLUMN=X",
    help="A logged input is only known to within +- X of its unit; widens what area_metric_c allows. May be repeated.",
)
@click.option(
    "--unknown-heat",
    is_flag=True,
    help="Also the heat that the model would need to follow the readings, with its band, and the logged column it follows.",
)
@click.option(
    "--denoise",
    metavar="FILE",
    help="Write the record without its sensors' noise, white or coloured, with its 95 % band: .csv .parquet. One run.",
)
@reading_options
@output_options
@scale_options
@click.option("--save-plot", metavar="FILE", help="Draw measurement, model and residual with failing stretches: .png .pdf .svg.")
@batched
def command(
    batch: "Batch",
    until: float | None,
    extra: tuple[str, ...],
    drive: str | None,
    effects: str | None,
    model: str | None,
    input_ranges: tuple[str, ...],
    unknown_heat: bool,
    denoise: str | None,
) -> int:
    """Put the model beside the measurement: how well it fits, how well it foretells, and where it fails.

    The headline is 'ahead': the error of the free run on readings that the fit did not see (after --until, else blocks left out in
    turn), with inputs as logged. 'one step' is the error of the next reading told from the last, always smaller.

    --unknown-heat smooths the readings through the model: the heat in K/min at each time, with its 95 % band, drawn by --save-plot
    above the logged columns, and the column, power and delay that it follows where chance would not give that. With --model, learnt
    on another run, the band holds the error of the rate too; without, it is told at the rate of this fit. Where --drive is a power
    that moves, in W or kW by its column's name, the heat stands in W too, beside what was logged, and heat capacity and resistance
    have the intervals that any heat beside the power leaves them.

    --denoise keeps what the model says and what deviates from it smoothly, and leaves the noise out: white, or a colour that dies
    away within a tenth of the time constant. What jumps, remembers longer, or fits neither leaves the sensor as it is, and so does
    a logger's step of more than twice the noise. What a sensor itself adds slowly, as a drift, stays. The file has the denoised
    sensors alone, each with its band (_lo, _hi); of a long record it has means over the steps that the model is fitted to.

    A record counts from its first reading unless --start MIN says otherwise: an idle beginning is itself a finding.
    """
    from ..archives.blocks import Analysis
    from ..output.files import check_target
    from ..pipeline.loop import compare_runs
    from ..records import CompareRecord
    from ..shell.session import draw, load_model

    options: dict[str, Any] = {"until_min": until, "extra": extra, "drive": drive, "model": load_model(model, extra, True)}
    options["effects"], options["denoise"] = names(effects), denoise is not None
    compare_runs([], **options)  # what is wrong with the options is said before any file is read
    work: Callable[..., Comparison] = partial(compare_runs, input_ranges=ranges(input_ranges), unknown_heat=unknown_heat, **options)
    if denoise is not None:
        check_target(denoise, (".csv", ".parquet"))
    if batch.is_archive:
        _one_run(denoise, f"-o {batch.output}, an archive", "name one run, and -o a file")
        return batch.archive(Analysis("compare", CompareRecord, work))
    readings = batch.read(denoise)
    if len(readings.runs) > 1:
        _one_run(denoise, f"{len(readings.runs)} runs", "name one run")
    with batch.working(readings, len(readings.runs), "runs") as how:
        result = work(readings.runs, details=batch.wants_details, how=how)
    code = batch.tell(result, readings, _drawn(unknown_heat, drive is not None))
    draw(result, batch.save_plot)
    return code if denoise is None else max(code, _write_denoised(result, denoise, batch.quiet))


def _one_run(denoise: str | None, found: str, do: str) -> None:
    """Raises UsageError where a denoised record is asked for, which is that of one run."""
    from ..errors import UsageError

    if denoise is not None:
        raise UsageError("--denoise writes one run", found=found, do=do)


def _at_end(unit: str) -> Any:
    """Forms the unknown heat at the end of the record, in K/min or W, with its band: all of it stands in JSON and is drawn."""

    def form(row: dict[str, Any]) -> str:
        last = row["unknown_heat"][-1] if row["unknown_heat"] else {}
        if f"heat_{unit}" not in last:
            return "-"
        return f"{last[f'heat_{unit}']:.3g} ({last[f'lo_{unit}']:.3g}..{last[f'hi_{unit}']:.3g})"

    return form


def _drawn(unknown_heat: bool, driven: bool) -> list[Any]:
    from ..output.screen import interval, number, text

    heat = [("heat at the end K/min", _at_end("k_per_min")), *([("in W", _at_end("w"))] if driven else [])] if unknown_heat else []
    return [
        ("sensor", text("channel")),
        ("effects", text("effects")),
        ("fit K", number("rmse_fit_c", 3)),
        ("ahead K", number("rmse_ahead_c", 3)),
        ("one step K", number("rmse_one_step_c", 3)),
        ("noise K", number("noise_c", 3)),
        ("bias K", number("bias_c", 3)),
        ("fails from..to min", interval("worst_from_min", "worst_to_min", 0)),
        ("by K", number("worst_error_c", 2)),
        *heat,
        ("status", text("status")),
    ]


def _write_denoised(result: "Comparison", path: str, quiet: bool) -> int:
    """The denoised record of the one run; exit code 1 where there is none."""
    from ..output.files import write_columns
    from ..output.screen import say

    clean = next((one for one in result.denoised if one.sensors), None)
    if clean is None:
        # Said with --quiet too: it decides the code.
        say(f"{path}: not written, as no sensor is denoised; the messages say why")
        return 1
    write_columns(path, clean.columns)
    if not quiet:
        say(f"{path}: {len(clean.sensors)} of {len(result.runs[0].channels)} sensors denoised")
    return 0
