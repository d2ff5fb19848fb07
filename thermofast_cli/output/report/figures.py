"""What the charts of a page show: strips of series over one axis, as the page's script draws them."""

from pathlib import Path
from typing import Any

import numpy as np

from .sheets import sensor_name

#: Buckets of a curve of measurements, of each of which the least and the largest reading are kept; points of a model's curve.
BUCKETS, MODEL_POINTS = 300, 160
#: Charts on a page: the sensors in their order.
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


def charts_of(result: Any) -> list[dict[str, Any]]:
    """The charts of a result; none where it has no picture."""
    makers = {"identify": _prediction, "compare": _comparison, "improve": _staircase, "sweep": _sweep}
    maker = makers.get(result.command)
    return maker(result)[:MOST] if maker is not None else []


def _prediction(result: Any) -> list[dict[str, Any]]:
    found = []
    for c in result.curves:
        if c is None:
            continue
        some, thin = extremes(c.reading), _even(len(c.model_time))
        left = c.reading - np.interp(c.time, c.model_time, c.model, left=np.nan, right=np.nan)
        marks = [{"at": _round(c.until), "css": "mark", "label": "identification time"}]
        marks += [{"at": _round(c.t95), "css": "done", "label": "95 % of the rise"}] if c.t95 is not None else []
        top = [
            _series("band", c.model_time[thin], c.band_low[thin], "95 % band", "band", c.band_high[thin]),
            _series("points", c.time[some], c.reading[some], "measured", "measured"),
            _series("line", c.model_time[thin], c.model[thin], "model", "model"),
        ]
        name = sensor_name(c.run, c.channel, result)
        label = f"{name}: measurement and prediction from the first {c.until:g} min. {c.note}".strip()
        strips = [{"unit": "°C", "series": top}, _residual(c.time[some], left[some])]
        found.append({"title": name, "label": label, "axis": "min", "marks": marks, "strips": strips})
    return found


def _comparison(result: Any) -> list[dict[str, Any]]:
    found = []
    for p in result.panels:
        some = extremes(p.reading)
        top = [
            _series("points", p.time[some], p.reading[some], "measured", "measured"),
            _series("line", p.time[some], p.model[some], "model", "model"),
        ]
        marks = [{"at": _round(p.until), "css": "mark", "label": "identification time"}] if p.until is not None else []
        name = sensor_name(p.run, p.channel, result)
        areas = [[_round(a), _round(b)] for a, b, _ in p.failing]
        told = f"; the model fails in {len(areas)} stretches, shaded" if areas else "; the model fails nowhere"
        strips = [{"unit": "°C", "series": top}, _residual(p.time[some], (p.reading - p.model)[some])]
        label = f"{name}: measurement and {p.effects}{told}"
        found.append({"title": name, "label": label, "axis": "min", "marks": marks, "areas": areas, "strips": strips})
    return found


def _staircase(result: Any) -> list[dict[str, Any]]:
    found = []
    for one in result.steps:
        if not one.labels:
            continue
        x = np.arange(len(one.labels), dtype=float)
        lines = [_stroke(_series("line", x, [e[i] for e in one.ahead_errors], c, ""), i) for i, c in enumerate(one.channels)]
        label = f"{one.run}: error on readings that were not fitted, step by step: {', then '.join(one.labels)}"
        strips = [{"unit": "K", "series": lines}]
        found.append({"title": Path(one.run).name, "label": label, "axis": "step", "names": list(one.labels), "strips": strips})
    return found


def _sweep(result: Any) -> list[dict[str, Any]]:
    found = []
    for swept in result.curves:
        if not len(swept.times):
            continue
        lines = [
            _stroke(_series("line", swept.times, e, f"window {r.window_min:g} min", ""), k)
            for k, (r, e) in enumerate(zip(swept.records, swept.rmse, strict=False))
        ]
        record = swept.records[0]
        name = sensor_name(record.run, record.channel, result)
        label = f"{name}: error of the steady state against the identification time, a line for each window"
        found.append({"title": name, "label": label, "axis": "min", "strips": [{"unit": "K", "series": lines}]})
    return found


def _residual(time: Any, left: Any) -> dict[str, Any]:
    return {"unit": "K", "height": 70, "zero": True, "series": [_series("points", time, left, "residual", "measured")]}


def _series(kind: str, x: Any, y: Any, label: str, css: str, y2: Any = None) -> dict[str, Any]:
    told = {"kind": kind, "x": _rounded(x), "y": _rounded(y), "label": label, "css": css}
    return told if y2 is None else {**told, "y2": _rounded(y2)}


def _stroke(series: dict[str, Any], number: int) -> dict[str, Any]:
    colour, dash = STROKES[number % len(STROKES)]
    return {**series, "stroke": colour, "dash": dash}


def extremes(values: Any, buckets: int = BUCKETS) -> Any:
    """Places (m,) of the least and the largest of each bucket of values (n,), which a thinned curve keeps; all of few."""
    if len(values) <= 2 * buckets:
        return np.arange(len(values))
    kept = []
    for part in np.array_split(np.arange(len(values)), buckets):
        good = part[np.isfinite(values[part])]
        kept += [good[np.argmin(values[good])], good[np.argmax(values[good])]] if len(good) else []
    return np.unique(np.array(kept, dtype=int))


def _even(count: int) -> Any:
    return np.unique(np.linspace(0, count - 1, min(count, MODEL_POINTS)).round().astype(int)) if count else np.arange(0)


def _rounded(values: Any) -> list[float | None]:
    return [_round(float(v)) for v in values]


def _round(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None
