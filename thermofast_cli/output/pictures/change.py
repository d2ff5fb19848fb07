"""The picture of ``changed``: rate and rise of every sensor, new over old."""

from typing import TYPE_CHECKING, Any

import numpy as np

from .plots import MEASURED, MODEL, new_figure, styled

if TYPE_CHECKING:
    from ...analysis.changed import Difference


@styled
def draw_change(difference: "Difference | None") -> Any:
    """A dot with its 95 % interval for each sensor; where the verdict's kind of change would put them stands in the title."""
    if difference is None:
        return None
    n = len(difference.channels)
    figure = new_figure(8.0, 1.6 + 0.32 * n)
    places = np.arange(n)[::-1]
    for axis, half, name in zip(figure.subplots(1, 2, sharey=True), (slice(0, n), slice(n, 2 * n)), ("rate", "rise"), strict=True):
        value, deviation = np.exp(difference.value[half]), 1.96 * difference.deviation[half]
        low, high = value * -np.expm1(-deviation), value * np.expm1(deviation)
        axis.errorbar(value, places, xerr=[low, high], fmt="o", capsize=3, color=MODEL)
        axis.axvline(1.0, color=MEASURED, linestyle=":", linewidth=1.2)
        axis.set_xlabel(f"{name}, new over old")
        axis.set_yticks(places, [c.replace("$", r"\$") for c in difference.channels])
    figure.suptitle(f"changed: {difference.verdict}")
    return figure
