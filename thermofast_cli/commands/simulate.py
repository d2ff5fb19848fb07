"""``thermofast simulate``."""

import shlex

import click

from ..reading_options import names
from ..shell.numbers import Finite, Whole


@click.command("simulate", epilog="Example: thermofast simulate --seed 7 -o run.csv --key key.json")
@click.option("-o", "--output", required=True, metavar="RUN", help="The record to write: .csv or .parquet.")
@click.option("--key", metavar="FILE", help="The truth behind it, as JSON.")
@click.option("--seed", type=Whole(0), default=0, show_default=True, help="The same seed makes the same record.")
@click.option("--sensors", type=Whole(1, 100_000), default=10, show_default=True, help="How many sensors.")
@click.option(
    "--duration",
    type=Finite(0, min_open=True),
    default=400.0,
    show_default=True,
    metavar="MIN",
    help="Length of the record.",
)
@click.option(
    "--interval",
    type=Finite(0, min_open=True),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Time between readings.",
)
@click.option("--ambient", type=Finite(-100, 500), default=17.9, show_default=True, metavar="DEGC", help="The room.")
@click.option(
    "--rise",
    type=Finite(0, min_open=True),
    default=9.0,
    show_default=True,
    metavar="K",
    help="Typical rise above the room.",
)
@click.option(
    "--t95",
    type=Finite(0, min_open=True),
    default=195.0,
    show_default=True,
    metavar="MIN",
    help="Typical time to 95 % of the rise.",
)
@click.option("--noise", type=Finite(0), default=0.02, show_default=True, metavar="K", help="Standard deviation of a reading.")
@click.option("--step", type=Finite(0), default=0.01, show_default=True, metavar="K", help="The logger's step; 0 for none.")
@click.option("--cooling", is_flag=True, help="From warm to the room instead of from the room to warm.")
@click.option(
    "--sensor",
    "fixed",
    multiple=True,
    metavar="NAME=DEGC:MIN",
    help="A sensor with this steady state and t95, in place of a drawn one.",
)
@click.option("--effects", metavar="A,B", help="Hide these effects in the record: ids, or FILE.py:CLASS.")
def command(
    output: str,
    key: str | None,
    seed: int,
    sensors: int,
    duration: float,
    interval: float,
    ambient: float,
    rise: float,
    t95: float,
    noise: float,
    step: float,
    cooling: bool,
    fixed: tuple[str, ...],
    effects: str | None,
) -> int:
    """Write a record of the base model, or one with hidden effects, with probe noise and a logger's step, and the truth behind it.

    With --effects the sizes are drawn from the seed, and the key tells them. Its steady_state_c and t95_min are then those of the
    readings, all being as at the record's end; `lump` has those of the machine without the effects.
    """
    from ..errors import UsageError
    from ..output.files import check_target
    from ..output.screen import say
    from ..pipeline.around import simulate_record

    check_target(output, (".csv", ".parquet"))
    if 60.0 * duration < interval:
        raise UsageError(
            f"--duration {duration:g}: one reading is no record", found=f"one each {interval:g} s", do="a longer one, or --interval"
        )
    if key:
        check_target(key, (".json",))
    given = []
    for text in fixed:
        name, _, numbers = text.partition("=")
        try:
            steady, settle = (float(part) for part in numbers.split(":"))
        except ValueError:
            raise UsageError(f"--sensor {text!r}", allowed="NAME=DEGC:MIN, as in --sensor T5=26.7:195") from None
        given.append((name, steady, settle))
    made = simulate_record(names(effects), seed, sensors, duration, interval, ambient, rise, t95, noise, step, cooling, fixed=given)
    made.save(output, key)
    count, readings = len(made.truth["sensors"]), len(made.columns["ambient"])
    beside = "".join(f"; {name} is an input: --inputs {shlex.quote(name)}" for name in made.truth.get("inputs", ()))
    say(f"{count} sensors, {readings} readings each in {output}" + (f", truth in {key}" if key else "") + beside)
    return 0
