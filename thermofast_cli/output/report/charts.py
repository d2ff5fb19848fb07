"""What there is to draw of a result: strips of series over one axis, described once for the page and the workbook."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .words import run_names

#: Sensors that are drawn, in their order.
MOST = 60
#: Okabe and Ito's colours, which the colour-blind tell apart, each with a dash of its own.
STROKES = (
    ("#0072B2", ""),
    ("#D55E00", "7 3"),
    ("#009E73", "2 3"),
    ("#CC79A7", "9 3 2 3"),
    ("#8A6D00", "4 2"),
    ("#56B4E9", "12 4"),
)


@dataclass(frozen=True)
class Series:
    """kind is points, line or band (from y to high); look is measured, model or band, or empty, with a stroke by its number."""

    kind: str
    label: str
    x: Any
    y: Any
    look: str = ""
    high: Any = None
    number: int = 0

    @property
    def stroke(self) -> tuple[str, str]:
        """Its colour and dash, where it has no look; from the seventh on the colours come again with other dashes."""
        again, first = divmod(self.number, len(STROKES))
        return STROKES[first][0], STROKES[(first + again) % len(STROKES)][1]


@dataclass(frozen=True)
class Strip:
    """Series over the chart's axis in one unit; a strip of residuals is lower and has a line at zero."""

    unit: str
    series: tuple[Series, ...]
    residual: bool = False


@dataclass(frozen=True)
class Chart:
    """label says in words what is seen, and says what the axes are where the title does not; marks are (x, look, label),
    areas (from, to); names stand for the places 0, 1, ...

    Charts of one sheet stand in one sheet of a workbook, where sheet is told; each has its own else.
    """

    title: str
    label: str
    axis: str
    strips: tuple[Strip, ...]
    marks: tuple[tuple[float, str, str], ...] = ()
    areas: tuple[tuple[float, float], ...] = ()
    names: tuple[str, ...] = ()
    sheet: str = "curves"
    says: str = ""


def charts_of(result: Any) -> list[Chart]:
    """The charts of a result; none where it has no picture, or where details were not asked for."""
    makers = {"identify": _prediction, "compare": _comparison, "improve": _staircase, "sweep": _sweep}
    maker = makers.get(result.command)
    return maker(result)[:MOST] if maker is not None else []


def drawn_of(result: Any) -> list[Any]:
    """The curves that are drawn of a result of ``identify``, in their order: of many those of sensors that a sentence speaks of or
    that are in doubt first, and of the others those that come first.
    """
    curves = [c for c in result.curves if c is not None]
    if len(curves) <= MOST:
        return curves
    rows = _rows_of(result)
    mine = [rows[c.run, c.channel] for c in curves]
    first = {k for k, r in enumerate(mine) if r.trip_last}
    for name, best in (("steady_state_c", max), ("t95_min", max), ("margin_k", min)):
        told = [k for k, r in enumerate(mine) if getattr(r, name) is not None]
        sure = [k for k in told if mine[k].status == "ok"]
        first |= {best(some, key=lambda k: getattr(mine[k], name)) for some in (told, sure) if some}
    by_interest = sorted(range(len(curves)), key=lambda k: (k not in first, mine[k].status == "ok"))
    return [curves[k] for k in sorted(by_interest[:MOST])]


def _rows_of(result: Any) -> dict[tuple[str, str], Any]:
    """The records of a result by run and channel."""
    return {(r.run, r.channel): r for r in result.records}


def _prediction(result: Any) -> list[Chart]:
    found, rows = [], _rows_of(result)
    for c in drawn_of(result):
        marks = [(c.until, "mark", "identification time")]
        marks += [(c.t95, "done", "95 % of the rise")] if c.t95 is not None else []
        told = rows[c.run, c.channel]
        trip = (told.start_min or 0.0) + told.trip_min if told.trip_min is not None else np.inf
        marks += [(trip, "trip", f"stopping rule {told.criterion}")] if trip <= c.model_time[-1] else []
        ends = c.model_time[[0, -1]]
        low, high = float(np.nanmin(c.model)), float(np.nanmax(c.model))
        # A limit far away would leave the curves no room.
        near = told.limit_c is not None and low - (high - low) <= told.limit_c <= high + (high - low)
        limit = (Series("line", "limit", ends, np.full(2, told.limit_c), number=1),) if near else ()
        top = (
            Series("band", "95 % band", c.model_time, c.band_low, "band", c.band_high),
            Series("points", "measured", c.time, c.reading, "measured"),
            Series("line", "model", c.model_time, c.model, "model"),
            *limit,
        )
        left = c.reading - np.interp(c.time, c.model_time, c.model, left=np.nan, right=np.nan)
        name = sensor_name(c.run, c.channel, result)
        label = f"{name}: measurement and prediction from the first {c.until:g} min. {c.note}".strip()
        found.append(Chart(name, label, "min", (Strip("°C", top), _residual(c.time, left)), tuple(marks)))
    return found


def _needed_heat(heat: list[dict[str, float]]) -> tuple[Strip, ...]:
    """The strip of an unknown heat with its band: in watts where these are known."""
    if not heat:
        return ()
    watts = "heat_w" in heat[0]
    time = np.array([row["time_min"] for row in heat])
    value, low, high = (np.array([row[f"{name}_{'w' if watts else 'k_per_min'}"] for row in heat]) for name in ("heat", "lo", "hi"))
    band = Series("band", "heat, 95 % band", time, low, "band", high)
    return (Strip("W" if watts else "K/min", (band, Series("line", "unknown heat", time, value, "model")), residual=True),)


def _comparison(result: Any) -> list[Chart]:
    found, rows = [], _rows_of(result)
    for p in result.panels:
        top = Series("points", "measured", p.time, p.reading, "measured"), Series("line", "model", p.time, p.model, "model")
        marks = ((p.until, "mark", "identification time"),) if p.until is not None else ()
        name, areas = sensor_name(p.run, p.channel, result), tuple((a, b) for a, b, _ in p.failing)
        many = "1 stretch" if len(areas) == 1 else f"{len(areas)} stretches"
        told = f"; the model fails in {many}, shaded" if areas else "; the model fails nowhere"
        needed = _needed_heat(rows[p.run, p.channel].unknown_heat)
        told += "; below, the heat that would make it fit" if needed else ""
        strips = Strip("°C", top), _residual(p.time, p.reading - p.model), *needed
        found.append(Chart(name, f"{name}: measurement and {p.effects}{told}", "min", strips, marks, areas))
    return found


def _staircase(result: Any) -> list[Chart]:
    found: list[Chart] = []
    called, rows = run_names(r.run for r in result.records), list(result.records)
    for one in result.steps:
        if len(one.labels) < 2:
            continue  # one point is no line
        x, errors = np.arange(len(one.labels), dtype=float), np.array(one.ahead_errors, dtype=float)
        lines = tuple(Series("line", c, x, errors[:, i], number=i) for i, c in enumerate(one.channels))
        left_out = any(r.run == one.run and r.rmse_other_runs_c is not None for r in rows)
        what = (
            "error on this run with what is shared told by the other runs" if left_out else "error on readings that were not fitted"
        )
        label = f"{one.run}: {what}, step by step: {', then '.join(one.labels)}"
        title, names = called.get(one.run, one.run), tuple(one.labels)
        found.append(
            Chart(
                title, label, "step", (Strip("K", lines),), names=names, sheet="steps", says=f"The {what}, a line for each sensor"
            )
        )
    return found


def _sweep(result: Any) -> list[Chart]:
    found: list[Chart] = []
    for swept in result.curves:
        if not len(swept.times):
            continue
        lines = tuple(
            Series("line", f"window {r.window_min:g} min", swept.times, e, number=k)
            for k, (r, e) in enumerate(zip(swept.records, swept.rmse, strict=False))
        )
        name = sensor_name(swept.records[0].run, swept.records[0].channel, result)
        says = "RMS error of the model over the window against the identification time, a line for each window"
        sure = [r.shortest_time_min for r in swept.records if r.shortest_time_min is not None and r.agreed and r.status == "ok"]
        marks = ((max(sure), "mark", "shortest time that serves"),) if sure else ()
        found.append(Chart(name, f"{name}: {says}", "min", (Strip("K", lines),), marks, sheet="times", says=says))
    return found


def _residual(time: Any, left: Any) -> Strip:
    return Strip("K", (Series("points", "residual", time, left, "measured"),), residual=True)


def sensor_name(run: str, channel: str, result: Any) -> str:
    """A sensor, with its run where there are several."""
    called = run_names(r.run for r in result.records)
    return channel if len(called) < 2 else f"{called[run]} {channel}"


def thinned(chart: Chart, points: int, model_points: int) -> dict[int, Any]:
    """Which places (m,) of each axis of a chart are drawn, by the identity of its x.

    Of measurements the least and the largest reading of each of `points` / 2 buckets are kept, of curves places evenly apart.
    """
    series = [s for strip in chart.strips for s in strip.series]
    found = {id(s.x): even(len(s.x), model_points) for s in series}
    return found | {id(s.x): extremes(s.y, points // 2) for s in reversed(series) if s.kind == "points"}


def extremes(values: Any, buckets: int) -> Any:
    """Places (m,) of the least and the largest of each bucket of values (n,); all of few."""
    if len(values) <= 2 * buckets:
        return np.arange(len(values))
    kept = []
    for part in np.array_split(np.arange(len(values)), buckets):
        good = part[np.isfinite(values[part])]
        kept += [good[np.argmin(values[good])], good[np.argmax(values[good])]] if len(good) else []
    return np.unique(np.array(kept, dtype=int))


def even(count: int, most: int) -> Any:
    """Places (m,) of so many, evenly apart, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)) if count else np.arange(0)
