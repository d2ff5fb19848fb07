"""An Excel workbook as the text that its sheet would be exported to."""

import csv
import datetime as dt
import io
import re
import zipfile
from collections.abc import Callable
from typing import Any, NamedTuple

from ...errors import InputError, UsageError, listed
from ..moments.stamps import looks_like_stamp
from .dialect import is_number
from .limits import Limits, check_workbook
from .packed import DAMAGED

#: A sheet with fewer rows or columns is no record.
LEAST_ROWS, LEAST_COLUMNS = 3, 2
#: A number with a decimal comma that was stored as text; three digits behind the comma may be thousands.
COMMA = re.compile(r"\s*([+-]?\d+),(\d{1,2}|\d{4,})\s*")


class Sheet(NamedTuple):
    """A sheet as comma-separated UTF-8 text, its name, and (what was taken for granted of its cells, the way to overrule it)."""

    text: bytes
    name: str
    taken: tuple[tuple[str, str], ...]


def sheet_text(data: bytes, name: str, sheet: str | None, limits: Limits) -> Sheet:
    """The sheet named, or the only one that holds a table.

    Raises
    ------
    InputError: no workbook that can be read, no sheet with a table, or several.
    UsageError: no sheet of that name.
    """
    import python_calamine as calamine

    unworked = False
    try:
        if data.startswith(b"PK"):
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                unworked = check_workbook(data, archive, name, limits)
        book = calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
    except (calamine.CalamineError, *DAMAGED) as error:
        raise InputError(
            f"{name}: an Excel workbook that cannot be read", found=str(error)[:120], do="save the sheet as CSV"
        ) from None
    names = list(book.sheet_names)
    if sheet is not None and sheet not in names:
        raise UsageError(f"{name}: --sheet {sheet!r} is no sheet of this workbook", allowed=listed(names, 12))
    sheets = {n: _rows(book, n) for n in ([sheet] if sheet is not None else names)}
    # Texts are read where no sheet holds numbers: beside one that does, they are notes about the record.
    tables = _with_rows_of(_is_number, sheets) or _with_rows_of(_reads, sheets)
    if not tables:
        raise InputError(f"{name}: no sheet with a table", found=listed(names, 6), allowed="a row of names above rows of numbers")
    if len(tables) > 1:
        raise InputError(
            f"{name}: {len(tables)} sheets hold tables", found=listed(list(tables), 8), allowed="one", do="say which: --sheet NAME"
        )
    chosen, rows = next(iter(tables.items()))
    taken = _as_numbers(rows, book.get_sheet_by_name(chosen).start or (0, 0))
    if unworked and any("" in row for row in rows):
        taken.append(("formulas without a stored value are empty cells", "open the workbook in Excel and save it"))
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_cell(c) for c in row] for row in rows)
    return Sheet(text.getvalue().encode("utf-8"), chosen, tuple(taken))


def _as_numbers(rows: list[list[Any]], start: tuple[int, int]) -> list[tuple[str, str]]:
    """In place, text with a decimal comma as the number that it is in a sheet that stores others as numbers; what was so taken.

    Of a sheet of text alone the comma is that of all its cells, and of its numbers' reader.
    """
    if not any(isinstance(c, float) and c % 1.0 for row in rows for c in row):
        return []
    found = []
    for i, row in enumerate(rows):
        for j, cell in enumerate(row):
            if isinstance(cell, str) and (number := COMMA.fullmatch(cell)):
                row[j] = float(f"{number[1]}.{number[2]}")
                found.append((f"{_letters(start[1] + j)}{start[0] + i + 1}", cell))
    if not found:
        return []
    (place, cell), more = found[0], len(found) - 1
    cells = f"cells {place} and {more} more are" if more else f"cell {place} is"
    return [(f"{cells} text with a decimal comma ({cell!r})", "store them as numbers")]


def _letters(column: int) -> str:
    """A column (from 0) as Excel calls it."""
    found = ""
    while column >= 0:
        column, letter = column // 26 - 1, column % 26
        found = chr(65 + letter) + found
    return found


def _rows(book: Any, sheet: str) -> list[list[Any]]:
    """Cells of a sheet; none for a sheet of a chart."""
    try:
        return list(book.get_sheet_by_name(sheet).to_python(skip_empty_area=True))
    except Exception:
        return []


def _with_rows_of(holds: Callable[[Any], bool], sheets: dict[str, list[list[Any]]]) -> dict[str, list[list[Any]]]:
    """The sheets with at least LEAST_ROWS rows of LEAST_COLUMNS cells that hold what a record is made of."""
    return {n: rows for n, rows in sheets.items() if sum(sum(map(holds, row)) >= LEAST_COLUMNS for row in rows) >= LEAST_ROWS}


def _is_number(cell: Any) -> bool:
    return isinstance(cell, int | float | dt.date | dt.time | dt.timedelta)


def _reads(cell: Any) -> bool:
    """Whether a cell holds a number or a stamp, if as text: a logger's export with decimal commas, pasted."""
    if not isinstance(cell, str):
        return _is_number(cell)
    return is_number(cell, ".") or is_number(cell, ",") or looks_like_stamp(cell)


def _cell(value: Any) -> str:
    """A cell as a logger would write it: whole numbers without a fraction, moments as ISO stamps, lengths of time as h:mm:ss."""
    if isinstance(value, float):
        return f"{value:.15g}"
    if isinstance(value, dt.datetime):
        return value.isoformat(sep=" ")
    if isinstance(value, dt.timedelta):
        seconds = value.total_seconds()
        hours, rest = divmod(abs(seconds), 3600.0)
        return f"{'-' if seconds < 0 else ''}{hours:.0f}:{int(rest // 60.0):02d}:{rest % 60.0:06.3f}"
    return str(value) if value is not None else ""
