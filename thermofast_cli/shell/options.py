"""Options that commands share, each said once. Imports Click only: ``--help`` must not wait for numpy."""

import functools
import inspect
import math
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import click

from ..errors import UsageError
from ..reading_options import CHOICES
from .complete import columns, filters, presets
from .numbers import Finite, Whole

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
#: Where a command's context keeps whether CSV is to be such as Excel opens by a double click.
EXCEL_CSV = "thermofast.excel_csv"
#: The same for outputs beside the first.
MORE_OUTPUTS = "thermofast.more_outputs"
FILTERS = "afukf, fading_ukf, ukf, ekf, svd_ukf, ckf, cqkf, ast_cqkf, crpf, acrpf, rls, least_squares"


def _together(*options: Decorator) -> Decorator:
    def wrap(function: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            function = option(function)
        return function

    return wrap


def batched(function: Callable[..., int]) -> Callable[..., int]:
    """A command's function whose first argument is a :class:`~.batch.Batch` of what all commands over runs are told."""
    own = set(inspect.signature(function).parameters)
    common = ("runs", "form", "output", "jobs", "quiet", "save_plot")

    @functools.wraps(function)
    def call(**told: Any) -> int:
        from .batch import Batch

        given = {name: told.pop(name) for name in common if name in told}
        reading = {name: told.pop(name) for name in list(told) if name not in own}
        return function(Batch(reading=reading, **given), **told)

    return call


def _hidden(*names: str, **settings: Any) -> Decorator:
    """An option that ``thermofast help reading`` explains once for all commands."""
    return click.option(*names, hidden=True, **settings)


class RunCommand(click.Command):
    """A command that reads runs: its help names the reading options in a line."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_options(ctx, formatter)
        told = [p.opts[0] for p in self.params if isinstance(p, click.Option) and p.hidden]
        with formatter.section("How files are read ('thermofast help reading' explains them)"):
            room = max(formatter.width - formatter.current_indent, 20)
            for line in textwrap.wrap(" ".join(told), room, break_on_hyphens=False):
                formatter.write(" " * formatter.current_indent + line + "\n")


class Joined(click.Option):
    """An option that takes several names with commas, and may be given again for more of them."""

    def __init__(self, *names: Any, **settings: Any) -> None:
        super().__init__(*names, **{**settings, "multiple": True})

    def process_value(self, ctx: click.Context, value: Any) -> Any:
        """The names with commas, as one such option has them; None without."""
        several = super().process_value(ctx, (value,) if isinstance(value, str) else value)
        return ",".join(several) if several else None


class Once(click.Option):
    """An option of which a second one would silently replace the first."""

    def __init__(self, *names: Any, **settings: Any) -> None:
        super().__init__(*names, **{**settings, "multiple": True})

    def process_value(self, ctx: click.Context, value: Any) -> Any:
        """The one value, or None."""
        several = super().process_value(ctx, (value,) if isinstance(value, str) else value)
        if several and len(several) > 1:
            raise click.BadParameter(f"given {len(several)} times ({', '.join(several)}); one is allowed", ctx=ctx, param=self)
        return several[0] if several else None


runs_argument = click.argument("runs", nargs=-1, metavar="[RUN]...", type=click.Path(readable=False))

filter_options = _together(
    click.option(
        "--filter",
        "filter_name",
        default="afukf",
        show_default=True,
        shell_complete=filters,
        metavar="NAME",
        help=f"One of {FILTERS}; or FILE.py[:CLASS].",
    ),
    click.option("--preset", type=click.Choice(["paper"]), help="The filter as the spindle paper prints it."),
    click.option(
        "--set", "settings", multiple=True, metavar="FILTER.KEY=VALUE", help="A filter's setting; see 'thermofast filters NAME'."
    ),
)

imperfection_options = _together(
    click.option(
        "--imperfection",
        default="typical",
        show_default=True,
        metavar="typical|none|FILE",
        help="How far real machines deviate from one exponential: typical, none, or FILE.toml with a lab's own sizes.",
    ),
    click.option(
        "--rates",
        type=click.Choice(["auto", "own", "shared"]),
        default="auto",
        show_default=True,
        help="Whether sensors share their rate: those that agree, none, all.",
    ),
)

jobs_option = click.option("--jobs", type=Whole(1), metavar="N", help="Worker processes; as many as the work pays for, by default.")


#: Where a command's context keeps who works, and whether it goes on with what is there.
SCALE = "thermofast.scale"


@dataclass
class Scale:
    """Who works, how long a task may take [s], and whether results that are there are gone on with."""

    resume: bool = False
    prune: bool = False
    cluster: str | None = None
    mpi: bool = False
    shared_files: bool = False
    task_timeout: float | None = None


def scale_of() -> Scale:
    """That of the command that runs."""
    context = click.get_current_context(silent=True)
    found = context.meta.setdefault(SCALE, Scale()) if context else Scale()
    assert isinstance(found, Scale)
    return found


def _keep(ctx: click.Context, option: click.Parameter, given: Any) -> None:
    setattr(ctx.meta.setdefault(SCALE, Scale()), str(option.name), given)


def _outputs(ctx: click.Context, _: click.Parameter, given: tuple[str, ...]) -> str | None:
    """The first output, one of a model or a prior before tables; the others wait in the context until the result is written."""
    ordered = sorted(given, key=lambda path: not path.lower().endswith(".toml"))
    ctx.meta[MORE_OUTPUTS] = tuple(ordered[1:])
    return ordered[0] if ordered else None


table_options = _together(
    click.option(
        "--format",
        "form",
        type=click.Choice(["table", "csv", "json", "jsonl", "md"]),
        help="Table on a terminal, else CSV, by default.",
    ),
    click.option(
        "-o",
        "--output",
        metavar="FILE",
        multiple=True,
        callback=_outputs,
        help="Write to FILE: .csv .json .jsonl .parquet .md .xlsx .html; may be repeated; with --format the screen shows it too.",
    ),
    click.option(
        "--excel-csv",
        is_flag=True,
        expose_value=False,
        callback=lambda ctx, _, given: ctx.meta.__setitem__(EXCEL_CSV, given),
        help="CSV with semicolons and decimal commas, as Excel opens it in many countries.",
    ),
    click.option("-q", "--quiet", is_flag=True, help="Say nothing on standard error but errors."),
)

output_options = _together(table_options, jobs_option)

scale_options = _together(
    click.option(
        "--resume",
        is_flag=True,
        expose_value=False,
        callback=_keep,
        help="Go on with a folder of results: -o results/ writes a part for each file of an archive. See docs/scale.md.",
    ),
    click.option(
        "--prune",
        is_flag=True,
        expose_value=False,
        callback=_keep,
        help="With --resume: take results of files out that are not named any more.",
    ),
    click.option(
        "--cluster", metavar="ADDRESS", expose_value=False, callback=_keep, help="Work on a Dask cluster, as tcp://scheduler:8786."
    ),
    click.option(
        "--mpi",
        is_flag=True,
        expose_value=False,
        callback=_keep,
        help="Work on processes of MPI that mpi4py starts.",
    ),
    click.option(
        "--shared-files",
        is_flag=True,
        expose_value=False,
        callback=_keep,
        help="With --cluster or --mpi, and -o a folder: the workers see the same files, and read and write them themselves.",
    ),
    click.option(
        "--task-timeout",
        type=Finite(0, min_open=True),
        metavar="SECONDS",
        expose_value=False,
        callback=_keep,
        help="Time limit of a task; one beyond it is tried again alone, then named. 600 where -o names a folder, else none.",
    ),
)

_time_options = _together(
    _hidden("--time", shell_complete=columns, metavar="COLUMN", help="The time column."),
    _hidden("--time-unit", type=click.Choice(CHOICES["time_unit"]), help="Unit of a numeric time column."),
    _hidden("--time-format", metavar="FORMAT", help="Format of wall-clock stamps, as '%d.%m.%Y %H:%M:%S'."),
    _hidden("--tz", metavar="ZONE", help="The zone of stamps that have none, as Europe/Berlin: summer time is taken out exactly."),
)

_no_time_column = _hidden(
    "--interval",
    type=Finite(0, min_open=True),
    metavar="SECONDS",
    help="Rows are this far apart: there is no time column.",
)

_other_reading_options = _together(
    _hidden(
        "--start",
        default="auto",
        show_default=True,
        metavar="MIN|auto",
        help="When the rise begins, minutes from the first reading.",
    ),
    _hidden("--ambient", shell_complete=columns, metavar="COLUMN", help="The column of the surroundings."),
    _hidden("--inputs", cls=Joined, shell_complete=columns, metavar="A,B", help="Columns that are inputs, not sensors."),
    _hidden("--channels", cls=Joined, shell_complete=columns, metavar="A,B", help="Use these sensors only."),
    _hidden("--exclude", cls=Joined, shell_complete=columns, metavar="A,B", help="Leave these columns out."),
    _hidden("--missing", cls=Joined, metavar="A,B", help="More words that mean 'no reading'."),
    _hidden("--delimiter", metavar="CHAR", help="Cell delimiter; 'tab' and 'blank' are understood."),
    _hidden("--decimal", type=click.Choice(CHOICES["decimal"]), help="Decimal sign."),
    _hidden("--encoding", metavar="NAME", help="Text encoding."),
    _hidden("--header-line", type=Whole(0), metavar="N", help="Line of the column names, from 1; 0 for none."),
    _hidden("--sheet", metavar="NAME", help="The sheet of a workbook, or the group of a TDMS or MATLAB file, that holds several."),
    _hidden(
        "--long",
        metavar="SENSOR,VALUE",
        help="One row per sensor and time: the columns that name the sensor (A+B for two) and read it.",
    ),
    _hidden(
        "--rename",
        cls=Joined,
        metavar="OLD=NEW,...",
        help="Other names for columns, in all that is told. Options of reading use the old names, --drive the new.",
    ),
    _hidden(
        "--resistance",
        metavar="R0,T0[,K]",
        help="Columns in ohms are windings: their temperature, from the resistance R0 at T0 degC; K 235 for copper.",
    ),
    _hidden("--skip-footer", type=Whole(0), metavar="N", help="Leave the last N lines of a text file out."),
    _hidden(
        "--units", cls=Joined, metavar="C|K|F", help="Unit of the temperatures, or by column: front=K,rear=F; Pt100 for its ohms."
    ),
    _hidden(
        "--from", "from_min", type=Finite(0), metavar="MIN", help="Use what was read from MIN minutes on; its clock begins anew."
    ),
    _hidden("--to", "to_min", type=Finite(0, min_open=True), metavar="MIN", help="End with the reading at MIN minutes."),
    _hidden(
        "--max-bytes",
        type=Whole(1),
        metavar="N",
        help="A file, what it unpacks to, and its table in memory: not more bytes than this; 2 GiB by default.",
    ),
    _hidden("--max-rows", type=Whole(1), metavar="N", help="Not more rows than this; 20,000,000 by default."),
    _hidden("--max-columns", type=Whole(1), metavar="N", help="Not more columns than this; 100,000 by default."),
    _hidden("--strict", is_flag=True, help="Refuse a record of which anything has to be guessed."),
)

reading_options = _together(_time_options, _no_time_column, _other_reading_options)
#: For a command whose own --interval means something else.
reading_options_but_interval = _together(_time_options, _other_reading_options)

criterion_option = click.option(
    "--criterion",
    shell_complete=presets,
    metavar="RULE",
    help="A test standard's stopping rule, as '2K/h, 2x30min', '1K/h + 3h' or iec60034-1: when it holds, what is missing then.",
)

drive_option = click.option(
    "--drive",
    cls=Once,
    shell_complete=columns,
    metavar="COLUMN",
    help="A logged column (power, duty) that the heat follows; one in W tells compare J/K and K/W.",
)

loop_options = _together(
    click.option(
        "--until",
        type=Finite(0, min_open=True),
        metavar="MIN",
        help="Fit the first MIN minutes only; the rest shows the error ahead.",
    ),
    click.option(
        "--effect",
        "extra",
        multiple=True,
        metavar="FILE.py[:CLASS]",
        help="An effect of your own, beside the catalogue; may be repeated.",
    ),
    drive_option,
)

false_alarm_option = click.option(
    "--false-alarm",
    type=Finite(0, 0.5, min_open=True),
    default=0.01,
    show_default=True,
    metavar="P",
    help="Chance per run, over all that is tried, of naming an effect that is not there.",
)

model_option = click.option("--model", metavar="M.toml", help="A model learnt by 'thermofast improve': where to start from.")
own_effect_option = click.option(
    "--effect",
    "extra",
    multiple=True,
    metavar="FILE.py[:CLASS]",
    help="An effect of your own that --model speaks of: no code is run that only a model names.",
)


def numbers(text: str, option: str, of: str = "minutes") -> tuple[float, ...]:
    """'40,45' or '5:55:1' (ends included) as ascending numbers of something.

    Raises
    ------
    UsageError: not numbers, not above zero, or a step that never ends.
    """
    try:
        if ":" in text:
            parts = [float(p) for p in text.split(":")]
            first, last = parts[0], parts[1]
            step = parts[2] if len(parts) > 2 else 1.0
            if len(parts) > 3 or step <= 0 or last < first or (last - first) / step > 100_000:
                raise ValueError
            found = [first + i * step for i in range(int((last - first) / step + 1e-9) + 1)]
        else:
            found = [float(p) for p in text.split(",") if p.strip()]
        if not found or any(not 0 < v < 1e7 for v in found):
            raise ValueError
    except (ValueError, IndexError):
        raise UsageError(
            f"{option}: not a list of {of}",
            found=repr(text),
            allowed="numbers above zero with commas between them, or FIRST:LAST:STEP",
        ) from None
    return tuple(sorted({round(v, 9) for v in found}))


def ranges(texts: tuple[str, ...]) -> tuple[tuple[str, float], ...]:
    """'ambient=0.5' as ('ambient', 0.5); that it is above zero is seen where the column is looked for.

    Raises
    ------
    UsageError: not of that form.
    """
    found = []
    for text in texts:
        name, _, value = text.rpartition("=")
        try:
            reach = float(value)
        except ValueError:
            reach = math.nan
        if not name or math.isnan(reach):
            raise UsageError("--input-range: not of the form COLUMN=X", found=repr(text), allowed="X above zero, as in ambient=0.5")
        found.append((name.strip(), reach))
    return tuple(found)
