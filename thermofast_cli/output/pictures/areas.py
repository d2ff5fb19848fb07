"""The picture of ``validate``: distributions of the least and the largest temperature of each run, measured and by the model."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .plots import MEASURED, MODEL, framed, new_figure, styled

if TYPE_CHECKING:
    from ...analysis.validate import Area

MOST = 6
#: Points of a distribution function that are drawn.
POINTS = 2000


@styled
def draw_areas(areas: Sequence["Area"]) -> Any:
    """A row for each sensor; the area between the two functions is what the metric counts."""
    if not areas:
        return None
    shown = areas[:MOST]
    figure = new_figure(9.5, 2.6 * len(shown) + 0.8)
    axes = figure.subplots(len(shown), 2, squeeze=False, sharey=True)
    for row, area in zip(axes, shown, strict=True):
        sides = (("least", area.record.area_low_c), ("largest", area.record.area_high_c))
        for k, (axis, (name, size)) in enumerate(zip(row, sides, strict=True)):
            measured, model = np.sort(area.measured[:, k]), np.sort(area.model[:, k])
            low, high = min(measured[0], model[0]), max(measured[-1], model[-1])
            at = np.linspace(low - 0.05 * (high - low), high + 0.05 * (high - low), POINTS)
            steps = [np.searchsorted(sample, at, side="right") / len(sample) for sample in (measured, model)]
            axis.fill_between(at, *steps, color="0.8", label="area")
            axis.plot(at, steps[0], color=MEASURED, label="measured")
            axis.plot(at, steps[1], color=MODEL, label="model")
            axis.set_title(f"{area.channel.replace('$', chr(92) + '$')}: {name} temperature of a run, area {size:.3g} K")
    for axis in axes[-1]:
        axis.set_xlabel("°C")
    for axis in axes[:, 0]:
        axis.set_ylabel("share of runs")
    framed(figure, axes[0][0], f"validate: {shown[0].record.runs} runs", len(shown), len(areas))
    return figure
