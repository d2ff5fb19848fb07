"""What the pictures of a result show, as tables with charts."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ...results import Result

MEASURED, MODEL, BAND = "#5B6770", "#C1440E", "#E8A688"
COLOURS = ("#1F6F8B", "#C1440E", "#5B8C2A", "#7A4E9C", "#B8860B", "#2F4B7C")
#: Sensors whose curves are told, and points of each: more than a picture shows.
MOST_SENSORS, MOST_POINTS = 60, 2000


@dataclass(frozen=True)
class Series:
    """A line of a chart: columns x and y of its sheet, down to row `rows`."""

    name: str
    x: int
    y: int
    rows: int
    colour: str
    points: bool = False
    dash: str = "solid"


@dataclass(frozen=True)
class Chart:
    """kind is scatter, line or bar, as Excel has it; sheet holds its numbers."""

    kind: str
    title: str
    x: str
    y: str
    sheet: str
    series: tuple[Series, ...]


@dataclass(frozen=True)
class Sheet:
    """A table: title, names of columns, rows of cells; and charts of it."""

    title: str
    columns: list[str]
    rows: list[list[Any]]
    charts: list[Chart] = field(default_factory=list)


def extra_sheets(result: "Result") -> list[Sheet]:
    """The sheets of a result beside its records; none for a command without a picture, or where details were not asked for."""
    makers: dict[str, Any] = {"identify": _curves, "compare": _panels, "improve": _steps, "diagnose": _ranking, "sweep": _times}
    maker = makers.get(result.command)
    return maker(result) if maker is not None else []


def _curves(result: Any) -> list[Sheet]:
    shown = [c for c in result.curves if c is not None][:MOST_SENSORS]
    columns: list[tuple[str, Any]] = []
    charts = []
    for c in shown:
        at, name = len(columns), sensor_name(c.run, c.channel, result)
        some, thin = _thinned(len(c.time)), _thinned(len(c.model_time))
        columns += [(f"{name} time min", c.time[some]), (f"{name} measured degC", c.reading[some])]
        columns += [(f"{name} model time min", c.model_time[thin]), (f"{name} model degC", c.model[thin])]
        columns += [(f"{name} low degC", c.band_low[thin]), (f"{name} high degC", c.band_high[thin])]
        lines = (
            Series("measured", at, at + 1, len(c.time[some]), MEASURED, points=True),
            Series("model", at + 2, at + 3, len(c.model_time[thin]), MODEL),
            Series("95 % low", at + 2, at + 4, len(c.model_time[thin]), BAND, dash="dash"),
            Series("95 % high", at + 2, at + 5, len(c.model_time[thin]), BAND, dash="dash"),
        )
        charts.append(Chart("scatter", f"{name}: identified on {c.until:g} min", "min", "degC", "curves", lines))
    return [_of_columns("curves", columns, charts)] if shown else []


def _panels(result: Any) -> list[Sheet]:
    shown = result.panels[:MOST_SENSORS]
    columns: list[tuple[str, Any]] = []
    charts = []
    for p in shown:
        at, name, some = len(columns), sensor_name(p.run, p.channel, result), _thinned(len(p.time))
        columns += [(f"{name} time min", p.time[some]), (f"{name} measured degC", p.reading[some])]
        columns += [(f"{name} model degC", p.model[some]), (f"{name} residual K", (p.reading - p.model)[some])]
        n = len(p.time[some])
        both = (Series("measured", at, at + 1, n, MEASURED, points=True), Series("model", at, at + 2, n, MODEL))
        charts.append(Chart("scatter", f"{name}: {p.effects}", "min", "degC", "curves", both))
        left = (Series("residual", at, at + 3, n, MEASURED, points=True),)
        charts.append(Chart("scatter", f"{name}: residual", "min", "K", "curves", left))
    return [_of_columns("curves", columns, charts)] if shown else []


def _steps(result: Any) -> list[Sheet]:
    sheets = []
    for number, one in enumerate((s for s in result.steps if s.labels), 1):
        title = f"steps {number}"
        columns: list[tuple[str, Any]] = [("step", list(one.labels))]
        columns += [(f"{c} ahead K", [float(e[i]) for e in one.ahead_errors]) for i, c in enumerate(one.channels)]
        rows = len(one.labels)
        lines = tuple(Series(c, 0, i + 1, rows, COLOURS[i % len(COLOURS)]) for i, c in enumerate(one.channels))
        chart = Chart("line", f"{one.run}: error on readings not fitted", "", "rms error, K", title, lines)
        sheets.append(_of_columns(title, columns, [chart]))
    return sheets


def _ranking(result: Any) -> list[Sheet]:
    sheets = []
    firsts = {r.run: r for r in reversed(result.records) if r.ranking}
    for number, (run, record) in enumerate(reversed(firsts.items()), 1):
        title, names = f"ranking {number}", list(dict.fromkeys(k for row in record.ranking for k in row))
        columns = [(n, [row.get(n) for row in record.ranking]) for n in names]
        gain = [Series("gain", names.index("effect"), names.index("gain"), len(record.ranking), COLOURS[0])]
        sheets.append(_of_columns(title, columns, [Chart("bar", f"{run}: what each effect gains", "", "", title, tuple(gain))]))
    return sheets


def _times(result: Any) -> list[Sheet]:
    sheets = []
    for number, swept in enumerate(s for s in result.curves if len(s.times)):
        record, title = swept.records[0], f"times {number + 1}"
        columns: list[tuple[str, Any]] = [("time min", swept.times)]
        columns += [(f"window {r.window_min:g} min: error K", e) for r, e in zip(swept.records, swept.rmse, strict=False)]
        lines = tuple(Series(n, 0, k + 1, len(swept.times), COLOURS[k % len(COLOURS)]) for k, (n, _) in enumerate(columns[1:]))
        chart = Chart("scatter", sensor_name(record.run, record.channel, result), "identified on, min", "error K", title, lines)
        sheets.append(_of_columns(title, columns, [chart]))
    return sheets


def _of_columns(title: str, columns: Sequence[tuple[str, Any]], charts: list[Chart]) -> Sheet:
    """A sheet of columns of different lengths."""
    longest = max((len(values) for _, values in columns), default=0)
    cells = [[*map(_value, values), *[None] * (longest - len(values))] for _, values in columns]
    return Sheet(title, [n for n, _ in columns], [list(row) for row in zip(*cells, strict=True)], charts)


def _value(value: Any) -> Any:
    return float(value) if isinstance(value, np.floating) else value


def _thinned(count: int) -> Any:
    """Which of so many points are told: all of them, or evenly so many."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_POINTS)).round().astype(int)) if count else np.arange(0)


def sensor_name(run: str, channel: str, result: Any) -> str:
    """A sensor, with its run where there are several."""
    return channel if len({r.run for r in result.records}) < 2 else f"{run} {channel}"
