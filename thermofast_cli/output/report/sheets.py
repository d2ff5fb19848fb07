"""The charts of a result, and the ranking of ``diagnose``, as tables of a workbook with Excel's own charts."""

import math
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .charts import STROKES, Chart, Series, Strip, charts_of, thinned

if TYPE_CHECKING:
    from ...results import Result

COLOURS = {"measured": "#5B6770", "model": "#C1440E", "band": "#E8A688", "mark": "#1F4E9C", "done": "#3B7D3B", "trip": "#7A4E9C"}
UNITS = {"°C": "degC"}
#: Points of each curve: more than a picture shows.
MOST_POINTS = 2000
#: Characters of a drawing's title.
LONGEST_TITLE = 120


@dataclass(frozen=True)
class Line:
    """A line of a chart: columns x and y of its sheet, down to row `rows`."""

    name: str
    x: int
    y: int
    rows: int
    colour: str
    points: bool = False
    dash: str = "solid"


@dataclass(frozen=True)
class Drawing:
    """kind is scatter, line or bar, as Excel has it; sheet holds its numbers; ends of its y axis, where these are set."""

    kind: str
    title: str
    x: str
    y: str
    sheet: str
    lines: tuple[Line, ...]
    ends: tuple[float, float] | None = None


@dataclass
class Sheet:
    """A table: title, names of columns, rows of cells; and drawings of it."""

    title: str
    columns: list[str]
    rows: list[list[Any]]
    drawings: list[Drawing] = field(default_factory=list)


def extra_sheets(result: "Result[Any]") -> list[Sheet]:
    """The sheets of a result beside its records; none for a command without a picture, or where details were not asked for."""
    if result.command == "diagnose":
        return _ranking(result)
    charts = charts_of(result)
    return [_sheet(title, [c for c in charts if c.sheet == title]) for title in dict.fromkeys(c.sheet for c in charts)]


def _sheet(title: str, charts: list[Chart]) -> Sheet:
    """Columns of different lengths: each axis once, that of the measurements first, and beside it what stands over it."""
    columns: list[tuple[str, list[Any]]] = []
    drawings: list[Drawing] = []
    marked: list[tuple[int, str, Chart]] = []
    for chart in charts:
        kept = thinned(chart, MOST_POINTS, MOST_POINTS)
        before = f"{chart.title} " if chart.sheet != "steps" or len(charts) > 1 else ""
        held = sorted(((s, e) for s in chart.strips for e in s.series), key=lambda pair: pair[1].kind != "points")
        lines: dict[int, list[Line]] = {id(strip): [] for strip in chart.strips}
        for axis in dict.fromkeys(id(e.x) for _, e in held):
            over, some, at = [pair for pair in held if id(pair[1].x) == axis], kept[axis], len(columns)
            told = list(chart.names) or _cells(over[0][1].x[some])
            columns.append((f"{before}{_axis(chart, over[0][1])}", told))
            for strip, s in over:
                for label, values in _columns(s):
                    columns.append((f"{before}{label} {UNITS.get(strip.unit, strip.unit)}", _cells(values[some])))
                    lines[id(strip)].append(_line(s, label, at, len(columns) - 1, len(some)))
        for strip in chart.strips:
            ends = None if chart.names else _ends(strip)
            name = f"{chart.title}: residual" if strip.residual else re.split(r"[;.] ", chart.label)[0][:LONGEST_TITLE]
            kind, across = ("line", "") if chart.names else ("scatter", chart.axis)
            unit = UNITS.get(strip.unit, strip.unit)
            drawings.append(Drawing(kind, name, across, unit, title, tuple(lines[id(strip)]), ends))
            if ends is not None and not strip.residual:
                marked.append((len(drawings) - 1, before, chart))
    for number, before, chart in marked:  # behind the curves, each mark two points from end to end
        for place, look, label in chart.marks:
            drawing, column = drawings[number], f"{before}{label}"
            columns += [(f"{column} {chart.axis}", [float(place)] * 2), (f"{column} {drawing.y}", list(drawing.ends or ()))]
            mark = Line(label, len(columns) - 2, len(columns) - 1, 2, COLOURS[look], dash="long_dash")
            drawings[number] = replace(drawing, lines=(*drawing.lines, mark))
    longest = max((len(cells) for _, cells in columns), default=0)
    filled = [[*cells, *[None] * (longest - len(cells))] for _, cells in columns]
    return Sheet(title, [n for n, _ in columns], [list(row) for row in zip(*filled, strict=True)], drawings)


def _ends(strip: Strip) -> tuple[float, float] | None:
    """Round numbers about all that a strip shows: by itself Excel begins at zero, where nothing is."""
    values = np.concatenate([np.asarray(v, dtype=float).ravel() for s in strip.series for v in (s.y, s.high) if v is not None])
    values = values[np.isfinite(values)]
    if not len(values) or not np.ptp(values) > 0.0:
        return None
    low, high = float(values.min()), float(values.max())
    step = 10.0 ** math.floor(math.log10(high - low)) / 2.0
    return math.floor(low / step) * step, math.ceil(high / step) * step


def _axis(chart: Chart, series: Series) -> str:
    """'time min', and 'model time min' for a curve that has times of its own."""
    if chart.names:
        return chart.axis
    return f"model time {chart.axis}" if series.look in ("model", "band") else f"time {chart.axis}"


def _columns(series: Series) -> list[tuple[str, Any]]:
    if series.kind != "band":
        return [(series.label, series.y)]
    return [(f"{series.label} low", series.y), (f"{series.label} high", series.high)]


def _line(series: Series, label: str, x: int, y: int, rows: int) -> Line:
    colour = COLOURS.get(series.look, series.stroke[0])
    return Line(label, x, y, rows, colour, series.kind == "points", "dash" if series.kind == "band" else "solid")


def _cells(values: Any) -> list[Any]:
    return np.asarray(values, dtype=float).tolist()  # type: ignore[no-any-return]


def _ranking(result: Any) -> list[Sheet]:
    sheets = []
    firsts = {r.run: r for r in reversed(result.records) if r.ranking}
    for number, (run, record) in enumerate(reversed(firsts.items()), 1):
        title = "ranking" if len(firsts) == 1 else f"ranking {number}"
        names = list(dict.fromkeys(k for row in record.ranking for k in row))
        rows = [[row.get(n) for n in names] for row in record.ranking]
        gain = (Line("gain", names.index("effect"), names.index("gain"), len(rows), STROKES[0][0]),)
        sheets.append(Sheet(title, names, rows, [Drawing("bar", f"{run}: what each effect gains", "", "", title, gain)]))
    return sheets
