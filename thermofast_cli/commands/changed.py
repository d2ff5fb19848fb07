"""``thermofast changed``."""

from typing import Any

import click

from ..shell.options import RunCommand, own_effect_option, reading_options, runs_argument, table_options


class OldAndNew(RunCommand):
    """All names after ``--new``, up to the next option, are new: a shell's pattern gives several."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        spread: list[str] = []
        new = False
        for word in args:
            if word.startswith("-") and word != "-":
                new = word == "--new"
                spread += [] if new else [word]
            else:
                spread += ["--new", word] if new else [word]
        return super().parse_args(ctx, spread)


@click.command(
    "changed",
    cls=OldAndNew,
    epilog="Example: thermofast changed sample_runs/hidden.csv --new sample_runs/hidden_second_run.csv",
)
@runs_argument
@click.option("--new", "new", multiple=True, metavar="RUN...", help="The later runs: every file name up to the next option.")
@click.option("--model", metavar="M.toml", help="In place of OLD runs: the model that 'thermofast improve' learnt from them.")
@own_effect_option
@reading_options
@table_options
@click.option("--save-plot", metavar="FILE", help="Draw rate and rise of every sensor, new over old: .png .pdf .svg.")
def command(
    runs: tuple[str, ...],
    new: tuple[str, ...],
    model: str | None,
    extra: tuple[str, ...],
    form: str | None,
    output: str | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Say what differs in a machine between earlier RUNs and later ones (--new): heat, heat capacity, loss, a sensor, two sensors
    exchanged, the contacts, the room, or nothing.

    Every sensor of every run gives a rate and a rise, over the length of the shortest run; each kind of change moves them in its
    own way. One row for each kind, the likeliest first, with its size and 95 % interval; run-to-run scatter is counted, and is
    better known from more earlier runs. The tests must be alike: the same heat asked for, the same places of the
    sensors. A power or speed that all runs log, and that was not as it was, is told; it may be why the heat changed.
    """
    from ..errors import UsageError
    from ..output.screen import interval, number, percent, text
    from ..pipeline.around import changed_runs
    from ..shell.session import check_outputs, deliver, draw, load_model, read_all

    if not new:
        raise UsageError("no run is given as --new", do="as in: thermofast changed before.csv --new after.csv")
    check_outputs([output], save_plot)
    learnt = load_model(model, extra)
    groups = [read_all(some, reading, quiet, [output, save_plot], 1) for some in (runs, new) if some or learnt is None]
    for error in (e for group in groups for e in group.unreadable):
        raise UsageError(f"{error[0]}: cannot be read", found=str(error[1]), do="leave it out")
    before = groups[0].runs if len(groups) > 1 else []
    result = changed_runs(before, groups[-1].runs, learnt)
    drawn = [
        ("change", text("change")),
        ("sensor", text("channel")),
        ("probability", percent("probability")),
        ("new over old", number("size", 3)),
        ("95 % interval", interval("size_lo", "size_hi", 3)),
        ("warmer K", number("difference_k", 1)),
        ("verdict", text("verdict")),
        ("status", text("status")),
    ]
    code = deliver(result, [], output, form, quiet, drawn)
    draw(result, save_plot)
    return code
