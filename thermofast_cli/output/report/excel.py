"""A result as an Excel workbook: a summary, the records, what pictures show as numbers, and charts that Excel draws of them."""

import io
import math
from collections.abc import Mapping, Sequence
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import listed
from ..meanings import meaning_of, unit_of
from ..text import plain
from .sheets import Drawing, Sheet, extra_sheets
from .verdicts import verdict_of
from .words import run_names, value_words

if TYPE_CHECKING:
    from ...results import Result

#: Excel's limits: characters in a cell, rows in a sheet.
LONGEST, MOST_ROWS = 32_767, 1_048_575
#: Widths of a column [characters].
NARROW, WIDE = 9, 60
#: Charts side by side, and their size [rows, columns of cells].
ACROSS, DOWN, OVER = 2, 18, 9
#: How numbers of a unit are shown; what they are is in the cell.
SHOWN = {"degC": "0.00", "K": "0.000", "min": "0.0", "µm": "0.00"}
#: Colours of rows by their status.
COLOURS = {"not_determined": "#FFF2CC", "model_doubtful": "#FFF2CC", "partly_explained": "#FFF2CC", "ok": "#FFFFFF"}


def write_result(path: str, result: "Result[Any]", made: Mapping[str, str]) -> None:
    """The workbook of a result. What comes from files is written as text or numbers: nothing in it is a formula or a link.

    made: headings and texts of how it was made.
    """
    rows, columns = result.rows(), list(result.kind.columns())
    records = Sheet(result.command, columns, [[row[c] for c in columns] for row in rows])
    write_sheets(path, [_summary(result, rows, made), records, _key(columns), *extra_sheets(result)])


def write_rows(path: str, command: str, columns: Sequence[str], rows: Sequence[dict[str, Any]]) -> None:
    """One table as a workbook."""
    told = [_key(columns)] if any(map(meaning_of, columns)) else []
    write_sheets(path, [Sheet(command, list(columns), [[row[c] for c in columns] for row in rows]), *told])


def _key(columns: Sequence[str]) -> Sheet:
    """What the columns of the records mean."""
    return Sheet("columns", ["column", "unit", "what it is"], [[c, unit_of(c), meaning_of(c)] for c in columns])


def write_sheets(path: str, sheets: Sequence[Sheet]) -> None:
    """Sheets in their order, their charts on a sheet of their own behind them."""
    import xlsxwriter

    # Put together in memory: a disk that is full is then met where the file is written, as with every other format.
    settings = {
        "in_memory": True,
        "strings_to_formulas": False,
        "strings_to_urls": False,
        "strings_to_numbers": False,
        "nan_inf_to_errors": False,
    }
    whole = io.BytesIO()
    with xlsxwriter.Workbook(whole, settings) as book:
        head = book.add_format({"bold": True, "bottom": 1, "text_wrap": True, "valign": "top"})
        fills = {status: book.add_format({"bg_color": colour}) for status, colour in COLOURS.items()}
        fills[""] = book.add_format({"bg_color": "#F8CECC"})
        shown = {unit: book.add_format({"num_format": form}) for unit, form in SHOWN.items()}
        drawings: list[Drawing] = []
        for sheet in sheets:
            _write(book.add_worksheet(sheet.title[:31]), sheet, head, fills, shown)
            drawings += sheet.drawings
        if drawings:
            drawn = book.add_worksheet("charts")
            _for_paper(drawn)
            drawn.set_h_pagebreaks([2 * DOWN * (k + 1) for k in range(len(drawings) // (2 * ACROSS))])
            for k, drawing in enumerate(drawings):
                drawn.insert_chart(DOWN * (k // ACROSS), OVER * (k % ACROSS), _chart(book, drawing))
    Path(path).write_bytes(whole.getbuffer())


def _summary(result: "Result[Any]", rows: Sequence[dict[str, Any]], made: Mapping[str, str]) -> Sheet:
    from ... import __version__

    lines: list[list[Any]] = [["made by", f"thermofast {result.command} {__version__}"], ["on", f"{date.today():%Y-%m-%d}"]]
    lines += [[heading.lower(), text] for heading, text in made.items()]
    lines += [["verdict", said] for said in verdict_of(result, [plain(row) for row in rows])]
    for told in result.input():
        lines.append(["run", told["run"]])
        lines += [["read as", note] for note in told["notes"]]
        lines += [["guessed", f"{g['text']} ({g['option']})"] for g in told["guesses"]]
    of_whom: dict[str, dict[str, None]] = {}
    names = run_names(str(row["run"]) for row in rows)
    for row in rows:
        if row.get("message"):
            of = f" of {names[row['run']]}" if len(names) > 1 and row.get("channel") else ""
            of_whom.setdefault(str(row["message"]), {})[f"{row.get('channel') or row.get('run') or ''}{of}"] = None
    for message, whom in of_whom.items():
        lines.append([f"message of {listed(list(whom), 6)}" if any(whom) else "message", message])
    return Sheet("summary", ["what", "said"], lines)


def _for_paper(page: Any) -> None:
    """As wide as a page, however many there are below each other."""
    page.set_landscape()
    page.set_paper(9)  # A4
    page.fit_to_pages(1, 0)


def _write(page: Any, sheet: Sheet, head: Any, fills: dict[str, Any], shown: dict[str, Any]) -> None:
    for column, title in enumerate(sheet.columns):
        page.write_string(0, column, title, head)
    status = sheet.columns.index("status") if "status" in sheet.columns else None
    for number, row in enumerate(sheet.rows[:MOST_ROWS], 1):
        for column, value in enumerate(row):
            _cell(page, number, column, value)
        if status is not None:
            told = str(row[status])
            page.set_row(number, None, fills.get(told, fills[""]) if told != "ok" else None)
    for column, title in enumerate(sheet.columns):
        longest = max([len(title) // 2, *(len(_shown(row[column])) for row in sheet.rows[:200])], default=NARROW)
        # A column of records that says nothing is folded away, not left out: a table keeps its columns.
        empty = status is not None and not any(_said(row[column]) for row in sheet.rows)
        unit = unit_of(title) or title.rpartition(" ")[2]  # the columns of a curve end with theirs
        page.set_column(column, column, min(max(longest + 1, NARROW), WIDE), shown.get(unit), {"hidden": empty})
    _for_paper(page)
    page.repeat_rows(0)
    page.freeze_panes(1, min(2, len(sheet.columns)) if status is not None else 0)
    if sheet.rows and status is not None:
        page.autofilter(0, 0, len(sheet.rows), len(sheet.columns) - 1)


def _cell(page: Any, row: int, column: int, value: Any) -> None:
    """A number as a number, an absent one as nothing, a truth as one, the rest as text."""
    if isinstance(value, bool):
        page.write_boolean(row, column, value)
    elif isinstance(value, int | float):
        if math.isfinite(value):
            page.write_number(row, column, float(value))
    elif isinstance(value, datetime):
        page.write_string(row, column, value.isoformat(sep=" "))
    elif _said(value):
        page.write_string(row, column, _shown(value)[:LONGEST])


def _said(value: Any) -> bool:
    """Whether a cell says anything."""
    return isinstance(value, int | float) or value not in (None, "", [], {})


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple) and all(isinstance(v, str) for v in value):
        return ", ".join(value)
    if isinstance(value, list | tuple | dict):
        return value_words(plain(value))
    return "" if value is None else str(value)


def _label(text: str) -> str:
    """A name in a chart; one as ``x!A1`` would be taken for a reference to a cell, so a sign without width parts it."""
    return text.replace("!", "!\u2060")


def _chart(book: Any, drawing: Drawing) -> Any:
    drawn = book.add_chart({"type": drawing.kind, **({"subtype": "straight"} if drawing.kind == "scatter" else {})})
    for line in drawing.lines:
        pen = {"none": True} if line.points else {"width": 1.5, "color": line.colour, "dash_type": line.dash}
        marker = {"type": "circle", "size": 2, "fill": {"color": line.colour}, "border": {"none": True}}
        style: dict[str, Any] = {"line": pen, "marker": marker if line.points else {"type": "none"}}
        if drawing.kind == "bar":
            style = {"fill": {"color": line.colour}}
        drawn.add_series(
            {
                "name": _label(line.name),
                "categories": [drawing.sheet[:31], 1, line.x, line.rows, line.x],
                "values": [drawing.sheet[:31], 1, line.y, line.rows, line.y],
                **style,
            }
        )
    drawn.set_title({"name": _label(drawing.title), "name_font": {"size": 11}, "overlay": False})
    drawn.set_x_axis({"name": drawing.x, "major_gridlines": {"visible": False}})
    ends = dict(zip(("min", "max"), drawing.ends, strict=True)) if drawing.ends is not None else {}
    # A label of a strip that goes below zero stands at its lower end.
    crossing = {"crossing": "min"} if drawing.ends is not None else {}
    lines = {"visible": True, "line": {"color": "#D9D9D9"}}
    drawn.set_y_axis(
        {"name": drawing.y, "major_gridlines": lines, **ends, **crossing, **({"reverse": True} if drawing.kind == "bar" else {})}
    )
    drawn.set_legend({"position": "bottom"} if len(drawing.lines) > 1 else {"none": True})
    drawn.set_size({"width": 560, "height": 330})
    return drawn
