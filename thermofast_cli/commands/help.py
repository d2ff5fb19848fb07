"""``thermofast help``."""

import click

READING = (
    (
        "A run is a CSV or text table, a workbook, a Parquet, TDMS or MATLAB file, or - for standard input. Delimiter, decimal "
        "sign, header, units and time are found by rule, and what was taken for what is printed on standard error. What the file "
        "does not say is a guess: it "
        'stands in the message of every row and under "input" in JSON, and --strict refuses it.'
    ),
    (
        "A column is a sensor when its unit or its name says that it is a temperature (T1, front [degC], Lager Temperatur), or "
        "when it names a place on the machine. Columns with another unit (V, %, rpm) are inputs, columns called ambient, room, "
        "hall, ... the surroundings; set points and cold junctions are inputs. Codes beside columns that say they are "
        "temperatures are left out."
    ),
    (
        "A file may hold several runs, one after the other: run.csv#2 is the second. A long table (one row per sensor and time) "
        "is recognised where it is plain; --long says which columns name the sensor and hold its reading."
    ),
    ("The same words are keys of [input] in thermofast.toml."),
)


@click.command("help", epilog="Example: thermofast help reading")
@click.argument("topic", metavar="[COMMAND|reading]", required=False)
@click.pass_context
def command(ctx: click.Context, topic: str | None) -> int:
    """Show the help of COMMAND, or how files are read and the options that say otherwise."""
    from ..errors import UsageError, nearest
    from ..main import COMMANDS, cli
    from ..output.screen import show_text

    parent = ctx.parent or ctx
    if topic is None:
        show_text(cli.get_help(parent) + "\n")
    elif topic == "reading":
        show_text(_reading(ctx) + "\n")
    elif topic in COMMANDS:
        found = cli.get_command(parent, topic)
        assert found is not None
        show_text(found.get_help(click.Context(found, info_name=topic, parent=parent)) + "\n")
    else:
        known = [*COMMANDS, "reading"]
        raise UsageError(f"no help on {topic!r}", allowed=", ".join(known), do=nearest(topic, known))
    return 0


def _reading(ctx: click.Context) -> str:
    """How files are read, and the options that say otherwise."""
    from .identify import command as identify

    formatter = ctx.make_formatter()
    formatter.write_heading("How files are read")
    for paragraph in READING:
        formatter.write_text(paragraph)
        formatter.write_paragraph()
    rows = []
    for parameter in identify.params:
        if isinstance(parameter, click.Option) and parameter.hidden:
            parameter.hidden = False
            row = parameter.get_help_record(ctx)
            parameter.hidden = True
            if row:
                rows.append(row)
    formatter.write_dl(rows)
    return formatter.getvalue().rstrip()
