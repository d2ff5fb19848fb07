"""``thermofast plan``."""

import math
from typing import Any

import click

from ..shell.numbers import Finite, Whole
from ..shell.options import RunCommand, model_option, own_effect_option, reading_options_but_interval, table_options


@click.command(
    "plan",
    cls=RunCommand,
    epilog="Example: thermofast plan --like sample_runs/spindle.csv --imperfection none --tolerance 0.5,0.2",
)
@click.option("--sensors", type=Whole(1, 10_000), metavar="N", help="How many sensors; 10 by default.")
@click.option("--interval", "every", metavar="TIME", help="Between readings, as 1s, 0.5min; 1s by default.")
@click.option("--noise", type=Finite(0, min_open=True), metavar="K", help="Standard deviation of a reading; 0.02 by default.")
@click.option("--rise", type=Finite(0, min_open=True), metavar="K", help="Rise that is expected; 9 by default.")
@click.option("--tau", type=Finite(0, min_open=True), metavar="MIN", help="Time constant that is expected; 65 by default.")
@click.option("--like", metavar="RUN", help="Take what is not said from a record of such a test.")
@click.option("--tolerance", default="0.5", show_default=True, metavar="K,K", help="Half-widths of the interval to reach.")
@click.option("--imperfection", default="typical", show_default=True, metavar="typical|none|FILE", help="As for identify.")
@model_option
@own_effect_option
@reading_options_but_interval
@table_options
@click.option("--save-plot", metavar="FILE", help="Draw half-width against the time measured: .png .pdf .svg.")
def command(
    sensors: int | None,
    every: str | None,
    noise: float | None,
    rise: float | None,
    tau: float | None,
    like: str | None,
    tolerance: str,
    imperfection: str,
    model: str | None,
    extra: tuple[str, ...],
    form: str | None,
    output: str | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Say how long a test must run for an accuracy, and what reading faster, more sensors or past runs would save.

    Records such as the machine's imperfection makes likely are drawn and identified at many times. A wish that no time fulfils is
    told to be hopeless, with what is the limit: the readings, or the machine.
    """
    from ..errors import UsageError
    from ..output.screen import interval, number, progress, text
    from ..pipeline.around import design_like, plan_design
    from ..shell.options import numbers
    from ..shell.session import check_outputs, deliver, draw, load_imperfection, load_model, on_the_command_line, read_all
    from ..workers.engine import Work

    said = [f"--{name.removesuffix('_min')}".replace("_", "-") for name in reading if on_the_command_line(name)]
    if like is None and said:
        raise UsageError(f"{said[0]}: no file is read", do="name the record of such a test with --like, or leave it away")
    wishes = numbers(tolerance, "--tolerance", "kelvin")
    check_outputs([output], save_plot)
    prior = load_imperfection(imperfection)
    given = {"sensors": sensors, "interval_s": seconds(every), "noise_c": noise, "rise_c": rise, "tau_min": tau}
    base, replayed = None, None
    if like is not None:
        base, replayed = design_like(read_all((like,), reading, quiet, [output, save_plot], 1).runs[0], prior)
    learnt = load_model(model, extra)
    with progress(1, "plan", quiet) as advance:
        how = Work(None, advance=advance)
        result = plan_design({k: v for k, v in given.items() if v is not None}, wishes[::-1], prior, base, how, replayed, learnt)
    drawn = [
        ("test", text("channel")),
        ("sensors", number("sensors", 0)),
        ("every s", number("interval_s", 3)),
        ("noise K", number("noise_c", 3)),
        ("rise K", number("rise_c", 3)),
        ("to +- K", number("tolerance_c", 3)),
        ("min", number("time_min", 0)),
        ("of six machines", interval("time_lo_min", "time_hi_min", 0)),
        ("time constants", number("time_constants", 2)),
        ("at best +- K", number("least_half_width_c", 3)),
        ("status", text("status")),
    ]
    code = deliver(result, [], output, form, quiet, drawn)
    draw(result, save_plot)
    return code


def seconds(text: str | None) -> float | None:
    """'1s', '0.5min', '200ms', '1h' or a number of seconds.

    Raises
    ------
    UsageError: none of these, or not above zero.
    """
    from ..errors import UsageError

    if text is None:
        return None
    for unit, factor in (("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("h", 3600.0), ("", 1.0)):
        if text.endswith(unit):
            try:
                value = float(text.removesuffix(unit)) * factor
            except ValueError:
                break
            if 0.0 < value < math.inf:
                return value
            break
    raise UsageError("--interval: not a time", found=repr(text), allowed="as 1s, 200ms, 0.5min")
