"""The charts of a result as the page's script draws them: few points, few digits."""

from typing import Any

import numpy as np

from .charts import Chart, Series, charts_of, thinned

#: Points of a curve of measurements and of a model's curve.
POINTS, MODEL_POINTS = 600, 160
#: Height of a strip of residuals; the script has one for the others.
LOW = 70


def figures_of(result: Any) -> list[dict[str, Any]]:
    """The charts of a page, as JSON has them."""
    return [_figure(chart) for chart in charts_of(result)]


def _figure(chart: Chart) -> dict[str, Any]:
    kept = thinned(chart, POINTS, MODEL_POINTS)
    told: dict[str, Any] = {"title": chart.title, "label": chart.label, "axis": chart.axis}
    told["marks"] = [{"at": _round(at), "css": look, "label": label} for at, look, label in chart.marks]
    told["areas"] = [[_round(a), _round(b)] for a, b in chart.areas]
    told |= {"names": list(chart.names)} if chart.names else {}
    told["says"] = " ".join(f"{said}." for said in (chart.says, _few(chart, kept)) if said)
    told["strips"] = [
        {"unit": s.unit, "series": [_series(e, kept[id(e.x)]) for e in s.series]}
        | ({"height": LOW, "zero": True} if s.residual else {})
        for s in chart.strips
    ]
    return told


def _few(chart: Chart, kept: dict[int, Any]) -> str:
    """What to say where not all measurements are drawn."""
    points = next((e for s in chart.strips for e in s.series if e.kind == "points"), None)
    if points is None or len(kept[id(points.x)]) == len(points.x):
        return ""
    return f"{len(kept[id(points.x)])} of {len(points.x)} readings are drawn: the least and the largest of each stretch"


def _series(series: Series, kept: Any) -> dict[str, Any]:
    told: dict[str, Any] = {"kind": series.kind, "label": series.label, "css": series.look}
    told |= {"x": _rounded(series.x[kept]), "y": _rounded(series.y[kept])}
    if series.high is not None:
        told["y2"] = _rounded(series.high[kept])
    return told if series.look else told | dict(zip(("stroke", "dash"), series.stroke, strict=True))


def _rounded(values: Any) -> list[float | None]:
    return [_round(float(v)) for v in values]


def _round(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None
