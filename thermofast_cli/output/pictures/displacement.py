"""Pictures of displacement: measured, and predicted where readings were left out."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .plots import MARK, MEASURED, MODEL, new_figure, styled

if TYPE_CHECKING:
    from ...displacements.report import Panel

MOST = 6
COLOURS = {"least squares": MODEL, "network": MARK, "arx": "#4a7c59", "network by minute": "#8d6cab", "neural network": "#b5892e"}


@styled
def draw_displacement(panels: "Sequence[Panel]") -> Any:
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
        axis.set_title(f"{Path(panel.run).name}: {panel.channel}, trust {panel.trusted}")
        axis.set_ylabel("displacement, um")
    axes[0].legend()
    axes[-1].set_xlabel("time, min")
    return figure
