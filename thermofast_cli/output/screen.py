"""The one module that prints: tables to standard output, everything else to standard error."""

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from ..errors import visible
from .text import Row, short, to_csv, to_json, to_jsonl, to_markdown

#: Headings of columns of words: to the left, and folded where they are long.
WORDS = (
    "sensor",
    "effects",
    "verdict",
    "also possible",
    "displacement",
    "by",
    "filter",
    "uncertain",
    "of",
    "",
    "use",
    "agreed",
    "column",
    "role",
    "unit",
    "guessed",
    "note",
)
#: The column that leads each part of a table too wide for the terminal.
LEADING = ("sensor", "displacement", "filter", "column")
#: Seconds between two lines of progress where there is no terminal.
EVERY_S = 30.0
#: How a row is drawn by its status; red where none of these.
STYLES = {"ok": "", "not_determined": "yellow", "model_doubtful": "yellow", "partly_explained": "yellow"}


def say(text: str) -> None:
    """A line on standard error."""
    print(visible(text), file=sys.stderr, flush=True)


def chosen_format(wanted: str | None) -> str:
    """A drawn table on a terminal, CSV into a pipe."""
    return wanted or ("table" if sys.stdout.isatty() else "csv")


def show_text(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


def show_records(
    command: str,
    columns: Sequence[str],
    rows: Sequence[Row],
    wanted: str | None,
    drawn: Sequence[Any],
    beneath: tuple[str, ...] = ("message",),
    input_: Sequence[Row] = (),
    excel_csv: bool = False,
) -> None:
    """Records to standard output; `drawn` are (heading, function of a row) of the terminal's table."""
    kind = chosen_format(wanted)
    if kind == "table":
        draw(command, rows, drawn, beneath)
    elif kind == "csv":
        show_text(to_csv(columns, rows, excel=excel_csv))
    elif kind == "json":
        show_text(to_json(command, rows, input_))
    elif kind == "jsonl":
        show_text(to_jsonl(rows))
    else:
        show_text(to_markdown(columns, rows))


def draw(title: str, rows: Sequence[Row], drawn: Sequence[Any], beneath: tuple[str, ...] = ("message",)) -> None:
    """A table for the eye: one per run, messages beneath; as wide as the terminal, or as it needs where there is none."""
    from rich.console import Console
    from rich.text import Text

    from .table import Column, blocks, lines_of

    terminal = sys.stdout.isatty()
    console = Console(width=None if terminal else 10_000, highlight=False, soft_wrap=not terminal)
    width = console.width if terminal else None
    for run in dict.fromkeys(row["run"] for row in rows):
        mine = [row for row in rows if row["run"] == run]
        console.print(Text(f"{title}  {run}", style="bold"))
        columns = [
            Column(heading, tuple(form(row) for row in mine), heading in WORDS or heading == "status") for heading, form in drawn
        ]
        keys = next((i + 1 for i, c in enumerate(columns) if c.heading in LEADING), 1)
        for block in blocks(columns, width, keys):
            heading, lines = lines_of(block)
            across = max(len(line) for line in [*heading, *(x for row in lines for x in row)])
            for line in heading:
                console.print(Text(line, style="bold"), no_wrap=True, overflow="ignore", crop=False)
            console.print("─" * across, no_wrap=True, overflow="ignore", crop=False)
            for row, texts in zip(mine, lines, strict=True):
                style = STYLES.get(row.get("status", "ok"), "red")
                for line in texts:
                    console.print(Text(line, style=style), no_wrap=True, overflow="ignore", crop=False)
            console.print()
        kind = columns[keys - 1].heading
        for column in beneath:
            told = _told_once([(row["channel"], row[column]) for row in mine if row[column]])
            for message in dict.fromkeys(text for _, text in told):
                who = [channel for channel, text in told if text == message]
                names = ", ".join(dict.fromkeys(who))
                lead = "" if column == "message" else f"{column.replace('_', ' ')}: "
                everyone = len(set(who)) == len({row["channel"] for row in mine}) and len(mine) > 1
                of = "" if everyone or not names else f"{names if len(names) < 60 else f'{len(set(who))} {kind}s'}: "
                console.print(Text(f"  {of}{lead}{message}", style="dim"))


def _told_once(told: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """(sensor, text), where a text is what another sensor's is with something before it, in two parts: the rest is said once."""
    texts = sorted({text for _, text in told}, key=len)
    parts = []
    for channel, text in told:
        rest = next((t for t in texts if text.endswith(f"; {t}")), None)
        own = text if rest is None else text[: -len(rest) - 2]
        parts.append((channel, own.removeprefix(f"{channel}: ")))
        parts += [] if rest is None else [(channel, rest)]
    return parts


def number(name: str, digits: int = 2) -> Any:
    """Forms a column's number for the drawn table."""

    def form(row: Row) -> str:
        value = row[name]
        return "-" if value is None else _fixed(value, digits)

    return form


def _fixed(value: float, digits: int) -> str:
    """A number with so many decimals; below 1 it keeps two digits: of what settles within a minute too the table says when."""
    few = digits < 2 and 0.0 < abs(value) < 1.0
    return f"{value:.2g}" if few and abs(value) >= 1e-4 else f"{value:.{digits}f}"


def percent(name: str) -> Any:
    """Forms a share as a percentage."""

    def form(row: Row) -> str:
        value = row[name]
        return "-" if value is None else f"{100.0 * value:.0f} %"

    return form


def interval(low: str, high: str, digits: int = 2) -> Any:
    """Forms two columns as an interval; an open side is a dash."""

    def form(row: Row) -> str:
        sides = ["-" if row[n] is None else _fixed(row[n], digits) for n in (low, high)]
        return f"{sides[0]}..{sides[1]}" if row[low] is not None or row[high] is not None else "-"

    return form


def text(name: str) -> Any:
    """Forms a column's words."""

    def form(row: Row) -> str:
        value = row[name]
        if isinstance(value, bool):
            return "yes" if value else "no"
        return ", ".join(map(str, value)) if isinstance(value, list) else short(value)

    return form


@contextmanager
def progress(total: int, what: str, quiet: bool) -> Iterator[Any]:
    """A bar on standard error while that is a terminal; yields a function that advances it.

    Where there is one thing to do only, how far it has got cannot be told: a turning sign shows the time, and how many steps of
    it were done.
    """
    if quiet or not sys.stderr.isatty() or total < 1:
        yield lambda _steps: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    name, count = TextColumn("{task.description}"), TextColumn("{task.completed:.0f}")
    columns = (
        (name, BarColumn(), TextColumn("{task.completed:.0f} of {task.total:.0f}"), TimeRemainingColumn())
        if total > 1
        else (SpinnerColumn(), name, count, TimeElapsedColumn())
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total if total > 1 else None)
        yield lambda steps: bar.advance(task, steps)


@contextmanager
def counting(quiet: bool) -> Iterator[Any]:
    """How far many files have got: a bar on a terminal, lines elsewhere; yields a function of a text and files done, of how many.

    A line comes every half minute.
    """
    if quiet:
        yield lambda _text, _done, _all: None
        return
    if not sys.stderr.isatty():
        last = [time.monotonic()]

        def line(text: str, _done: int, _all: int) -> None:
            if time.monotonic() - last[0] >= EVERY_S:
                last[0] = time.monotonic()
                say(text)

        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(BarColumn(), TextColumn("{task.description}"), console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("", total=None)

        def bar(text: str, done: int, whole: int) -> None:
            shown.update(task, description=text, completed=done, total=whole)

        yield bar


@contextmanager
def live_table(on: bool) -> Iterator[Any]:
    """A table on standard error that is drawn again in place; yields a function of a line, records and whether each is within."""
    if not on:
        yield lambda _line, _records, _within: None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.table import Table

    with Live(console=Console(stderr=True), transient=True, auto_refresh=False) as live:

        def draw(line: str, records: Sequence[Any], within: Sequence[bool]) -> None:
            table = Table(title=line, box=None, header_style="bold", title_justify="left")
            for heading in ("sensor", "settles degC", "95 % interval", "to go min", "status", "within"):
                table.add_column(heading, justify="left" if heading in ("sensor", "status", "within") else "right")
            for r, inside in zip(records, within, strict=True):
                row = r.as_dict()
                cells = (number("steady_state_c")(row), interval("steady_state_lo_c", "steady_state_hi_c")(row))
                table.add_row(r.channel, *cells, number("time_to_go_min", 0)(row), r.status, "yes" if inside else "")
            live.update(table, refresh=True)

        yield draw
