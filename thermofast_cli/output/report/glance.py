"""The answer for each sensor in a few columns: what a page begins with, and what a notebook shows."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..text import plain
from .words import escape, interval_words, run_names, status_cell

if TYPE_CHECKING:
    from ...results import Result

#: Results that have such a table.
GLANCED = ("identify", "watch")
#: What a reader asks first of a prediction: heading, column, its interval, digits.
GLANCE = (
    ("settles, degC", "steady_state_c", ("steady_state_lo_c", "steady_state_hi_c"), 2),
    ("95 % done after, min", "t95_min", ("t95_lo_min", "t95_hi_min"), 0),
    ("still to go, min", "time_to_go_min", ("time_to_go_lo_min", "time_to_go_hi_min"), 0),
)
#: Sensors up to which there is such a table.
MOST_GLANCED = 60
#: Rows of a table in a notebook.
SHOWN_ROWS = 60


def glance_page(rows: Sequence[dict[str, Any]], called: Mapping[str, str]) -> str:
    """The table under its heading, as wide as a phone or a sheet of paper; nothing for many sensors."""
    if len(rows) > MOST_GLANCED:
        return ""
    region = '<div class="wide" tabindex="0" role="region" aria-label="At a glance">'
    return f"<h2>At a glance</h2>{region}{_table(rows, called)}</div>"


def _table(rows: Sequence[dict[str, Any]], called: Mapping[str, str]) -> str:
    heads = "".join(f"<th>{heading}</th><th>95 % interval</th>" for heading, *_ in GLANCE)
    lines = []
    for row in rows:
        cells = []
        for _, column, ends, digits in GLANCE:
            told = ("", "") if row[column] is None else (f"{row[column]:.{digits}f}", interval_words(row, ends, digits))
            cells += [f'<td class="number">{text}</td>' for text in told]
        name = row["channel"] if len(called) < 2 else f"{called[row['run']]} {row['channel']}"
        lines.append(f'<tr><th scope="row" class="who">{escape(name)}</th>{"".join(cells)}{status_cell(row["status"])}</tr>')
    head = f'<thead><tr><th class="who">sensor</th>{heads}<th>status</th></tr></thead>'
    return f"<table>{head}<tbody>{''.join(lines)}</tbody></table>"


def notebook_html(result: "Result[Any]") -> str:
    """A result in a notebook: of a prediction the few columns with what is said of them, all that are not empty behind a click."""
    frame = result.to_frame().replace("", None).dropna(axis=1, how="all")
    whole = str(frame.to_html(index=False, float_format=lambda v: f"{v:.4g}", escape=True, na_rep="", max_rows=SHOWN_ROWS))
    rows = [plain(r) for r in result.rows()]
    if result.command not in GLANCED or len(rows) > MOST_GLANCED:
        return whole
    called = run_names(r["run"] for r in rows)
    said = "".join(f"<li>{escape(r['channel'])}: {escape(r['message'])}</li>" for r in rows if r["message"])
    return f"{_table(rows, called)}<ul>{said}</ul><details><summary>all columns</summary>{whole}</details>"
