"""``thermofast filters``: the catalogue, one filter's settings, and all of them on a record."""

from typing import TYPE_CHECKING

import click

from ..shell.numbers import Finite
from ..shell.options import RunCommand, batched, reading_options, runs_argument, table_options

if TYPE_CHECKING:
    from ..shell.batch import Batch


class Catalogue(click.Group):
    """Subcommands are ``bench`` and the name of each filter."""

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name == "bench":
            return bench
        return click.Command(cmd_name, callback=lambda: show(cmd_name), add_help_option=False)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return ["bench"]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([("NAME", "What the filter of that name is, and its settings."), ("bench", "All on a record.")])


@click.group(
    "filters",
    cls=Catalogue,
    invoke_without_command=True,
    subcommand_metavar="[NAME | bench RUN...]",
    epilog="Example: thermofast filters afukf",
)
@click.pass_context
def command(ctx: click.Context) -> int:
    """List the filters; show the settings of the one called NAME; or run all of them on a record of yours: bench."""
    if ctx.invoked_subcommand is None:
        from ..output.screen import show_text
        from ..plugins.filters import broken_filters, known_filters

        known = known_filters()
        width = max(map(len, known))
        show_text("".join(f"{n:<{width}}  {f.summary}\n" for n, f in known.items()))
        show_text("".join(f"{b.name:<{width}}  cannot be used: {b.why}\n" for b in broken_filters()))
    return 0


def show(name: str) -> int:
    """One filter with its settings."""
    from dataclasses import fields

    from ..errors import UsageError, nearest
    from ..output.screen import show_text
    from ..plugins.filters import broken_filters, filter_class, known_filters

    known = known_filters()
    kind = filter_class(name, known)
    if kind is None:
        for broken in broken_filters():
            if broken.name == name:
                raise UsageError(f"the filter {name!r} cannot be used", found=broken.why)
        allowed = ", ".join(known) + "; my_filter.py; or bench RUN to try them all"
        raise UsageError(f"unknown filter {name!r}", allowed=allowed, do=nearest(name, known))
    chosen = kind()
    name = chosen.name
    show_text(f"{name}: {chosen.summary}\nreference: {chosen.reference}\n")
    show_text(f"closing likelihood step: {chosen.closing}\n")
    for f in fields(chosen):
        if f.metadata:
            meaning, low, high = f.metadata["meaning"], f.metadata["low"], f.metadata["high"]
            show_text(f"  {name}.{f.name} = {f.default:g}   {meaning}; {low:g} to {high:g}\n")
        else:
            show_text(f"  {name}.{f.name} = {str(f.default).lower()}   close with a maximum-likelihood step\n")
    return 0


@click.command("bench", cls=RunCommand, epilog="Example: thermofast filters bench sample_runs/spindle.csv --until 60")
@runs_argument
@click.option(
    "--until",
    type=Finite(0, min_open=True),
    metavar="MIN",
    help="Identify on the first MIN minutes, half of the record by default; the rest shows the error ahead.",
)
@reading_options
@table_options
@batched
def bench(
    batch: "Batch",
    until: float | None,
) -> int:
    """Run every filter on each RUN and say which one to use there, and why.

    One record per filter: errors of its own curve inside, and ahead over the sensors of which it tells where they settle, the
    median width of the 95 % interval that the readings alone give, readings filtered per second on this machine in one process, and
    on how many sensors the filter broke. What identify says counts the machine beside, and hardly depends on the filter.
    """
    from ..output.screen import number, text
    from ..pipeline.around import bench_runs
    from ..plugins.filters import known_filters

    readings = batch.read(from_rise=True)
    with batch.working(readings, len(readings.runs) * len(known_filters()), "filters tried") as how:
        result = bench_runs(readings.runs, until, how)
    drawn = [
        ("filter", text("filter")),
        ("inside K", number("rmse_fit_c", 4)),
        ("ahead K", number("rmse_ahead_c", 4)),
        ("interval K", number("width_c", 3)),
        ("broke", text("broken")),
        ("undetermined", text("undetermined")),
        ("readings/s", number("steps_per_s", 0)),
        ("use", text("chosen")),
    ]
    batch.tell(result, readings, drawn)
    # A filter that breaks on a record is what the table is for; only a run without readings is a failure.
    return 1 if readings.unreadable or any(r.status == "no_data" for r in result.records) else 0
