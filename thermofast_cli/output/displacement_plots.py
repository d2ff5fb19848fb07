"""Pictures of displacement: measured, and predicted where readings were left out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..analysis.displacement import Panel
from .plots import MARK, MEASURED, MODEL, new_figure

MOST = 6
COLOURS = {"least squares": MODEL, "network": MARK}


def draw_displacement(panels: Sequence[Panel]) -> Any:
    """A panel for each displacement: what was measured, and what each model says of blocks that it had not seen."""
    shown = panels[:MOST]
    if not shown:
        return None
    figure = new_figure(7.5, 3.0 * len(shown) + 0.5)
    axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for axis, panel in zip(axes, shown, strict=True):
        axis.plot(panel.time, panel.displacement, ".", ms=2.5, color=MEASURED, label="measured")
        for method, predicted in panel.predicted.items():
            axis.plot(panel.time, predicted.mean, lw=1.2, color=COLOURS[method], label=f"{method}, readings left out")
            if method == panel.trusted:
                low, high = predicted.mean - 1.96 * predicted.deviation, predicted.mean + 1.96 * predicted.deviation
                axis.fill_between(panel.time, low, high, color=COLOURS[method], alpha=0.15, lw=0)
        axis.set_title(f"{Path(panel.run).name}: {panel.channel}, trust {panel.trusted}", fontsize=9)
        axis.set_ylabel("displacement, um", fontsize=8)
        axis.tick_params(labelsize=8)
    axes[0].legend(fontsize=7, frameon=False)
    axes[-1].set_xlabel("time, min", fontsize=8)
    return figure
