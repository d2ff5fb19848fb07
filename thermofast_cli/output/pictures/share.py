"""Pictures of shares: what each uncertain thing contributes, one bar each."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...records import SensitivityRecord
from .plots import MEASURED, MODEL, framed, new_figure, styled

MOST = 6
TITLES = {"steady_state_c": "steady state", "t95_min": "settling time"}


@styled
def draw_shares(records: Sequence[SensitivityRecord]) -> Any:
    """A row for each sensor, a panel for each quantity: the share of the variance alone, and with what goes together."""
    sensors = list(dict.fromkeys((r.run, r.channel) for r in records if r.total is not None))
    if not sensors:
        return None
    shown = sensors[:MOST]
    figure = new_figure(9.5, 2.4 * len(shown) + 0.6)
    axes = figure.subplots(len(shown), 2, squeeze=False)
    for row, sensor in zip(axes, shown, strict=True):
        for axis, quantity in zip(row, TITLES, strict=True):
            mine = [r for r in records if (r.run, r.channel) == sensor and r.quantity == quantity and r.total is not None]
            if not mine:
                axis.set_visible(False)
                continue
            place = np.arange(len(mine))[::-1]
            axis.barh(place, [r.total or 0.0 for r in mine], color=MEASURED, alpha=0.45, height=0.7, label="in all")
            axis.barh(place, [r.first_order or 0.0 for r in mine], color=MODEL, height=0.35, label="alone")
            axis.set_yticks(place, [r.factor for r in mine])
            axis.set_xlim(0.0, 1.05)
            unit = "°C" if quantity.endswith("_c") else "min"
            axis.set_title(f"{sensor[1]}: {TITLES[quantity]}, {mine[0].mean:.4g} ± {mine[0].deviation:.2g} {unit}")
    for axis in axes[-1]:
        axis.set_xlabel("share of the variance")
    framed(figure, axes[0][0], Path(shown[0][0]).name, len(shown), len(sensors))
    return figure
