"""The picture of ``changed``: rate and rise of every sensor, new over old."""

from typing import TYPE_CHECKING, Any

import numpy as np

from .plots import MEASURED, MODEL, new_figure, styled

if TYPE_CHECKING:
    from ...analysis.changed import Difference


#: A sensor that may have changed by such a factor hardly moves and is not known: its bar runs out of the picture.
FARTHEST = 10.0


@styled
def draw_change(difference: "Difference | None") -> Any:
    """A dot with its 95 % interval for each sensor; where the verdict's kind of change would put them stands in the title."""
    if difference is None:
        return None
    n = len(difference.channels)
    figure = new_figure(8.0, 1.6 + 0.32 * n)
    places = np.arange(n)[::-1]
    for axis, half, name in zip(figure.subplots(1, 2, sharey=True), (slice(0, n), slice(n, 2 * n)), ("rate", "rise"), strict=True):
        middle, reach = difference.value[half], 1.96 * difference.deviation[half]
        sides = np.clip([middle - reach, middle + reach], -50.0, 50.0)
        known = np.abs(sides).max(axis=0) < np.log(FARTHEST)
        bars = np.abs(np.exp(sides) - np.exp(middle))[:, known]
        axis.errorbar(np.exp(middle[known]), places[known], xerr=bars, fmt="o", capsize=3, color=MODEL)
        axis.hlines(places[~known], *np.exp(sides[:, ~known]), color=MODEL)
        ends = np.exp(np.append(sides[:, known], 0.0))
        margin = 0.08 * max(float(np.ptp(ends)), 0.1)
        axis.set_xlim(ends.min() - margin, ends.max() + margin)
        axis.axvline(1.0, color=MEASURED, linestyle=":", linewidth=1.2)
        axis.set_xlabel(f"{name}, new over old")
        axis.set_yticks(places, [c.replace("$", r"\$") for c in difference.channels])
    figure.suptitle(f"changed: {difference.verdict}")
    return figure
