"""Pictures of the discovery loop: model beside measurement with failing stretches, and the staircase of errors."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..compare import Panel
from ..improve import Improved
from .plots import MARK, MEASURED, MODEL, new_figure, save_figure
from .screen import say

MOST = 6
FAILING = "#fbbf24"
INPUTS = ("#2a8c55", "#7b3294", "#b8860b", "#4d4d4d")


def plot_comparison(path: str, panels: Sequence[Panel]) -> None:
    """Per sensor: measurement and model above, residual below with failing stretches shaded, inputs in a strip under it."""
    if not panels:
        say("no sensor to draw: see the status of each record")
        return
    worst = sorted(panels, key=lambda p: -max((abs(s[2]) / p.noise for s in p.failing), default=0.0))[:MOST]
    shown = [p for p in panels if any(p is w for w in worst)]
    inputs = {n: c for n, c in shown[0].inputs.items() if np.ptp(c) > 0.0}
    rows = 3 if inputs else 2
    across = min(3, len(shown))
    down = -(-len(shown) // across)
    heights = ([2.2, 1.3, 0.7] if inputs else [2.2, 1.3]) * down
    figure = new_figure(4.8 * across, sum(heights) * 1.15 + 0.6)
    axes = figure.subplots(rows * down, across, squeeze=False, sharex=True, gridspec_kw={"height_ratios": heights})
    for at in range(down * across):
        column = [axes[rows * (at // across) + r][at % across] for r in range(rows)]
        if at >= len(shown):
            for axis in column:
                axis.set_visible(False)
            continue
        _panel(column, shown[at], inputs)
    axes[0][0].legend(fontsize=7, frameon=False, loc="best")
    more = f"  ({len(shown)} of {len(panels)} sensors, the worst)" if len(panels) > len(shown) else ""
    figure.suptitle(f"{Path(shown[0].run).name}: {shown[0].effects}{more}", fontsize=11)
    save_figure(path, figure)


def _panel(column: list[Any], p: Panel, inputs: dict[str, Any]) -> None:
    top, low = column[0], column[1]
    top.plot(p.time, p.reading, ".", ms=2.2, color=MEASURED, label="measured")
    top.plot(p.time, p.model, color=MODEL, lw=1.3, label="model")
    top.set_title(p.channel, fontsize=9)
    top.set_ylabel("°C", fontsize=8)
    residual = p.reading - p.model
    low.plot(p.time, residual, ".", ms=2.0, color=MEASURED)
    low.axhline(0.0, color=MODEL, lw=1.0)
    for a, b, _ in p.failing:
        for axis in (top, low):
            axis.axvspan(a, b, color=FAILING, alpha=0.25, lw=0)
    for axis in column[:2]:
        if p.until is not None:
            axis.axvline(p.until, color=MARK, lw=1.0, ls="--", label="identification time")
    low.set_ylabel("residual, K", fontsize=8)
    if len(column) > 2:
        for (name, values), colour in zip(inputs.items(), INPUTS, strict=False):
            span = float(np.ptp(values)) or 1.0
            column[2].plot(
                p.time, (values - values.min()) / span, lw=0.9, color=colour, label=f"{name} {values.min():.4g}..{values.max():.4g}"
            )
        column[2].set_yticks([])
        column[2].set_ylim(-0.15, 2.1)
        column[2].legend(fontsize=6, frameon=False, loc="upper left", ncols=2)
    column[-1].set_xlabel("time, min", fontsize=8)
    column[-1].tick_params(labelbottom=True)
    for axis in column:
        axis.tick_params(labelsize=7)


def plot_staircase(path: str, runs: Sequence[Improved]) -> None:
    """Error of each step, fitted and ahead, one line per sensor, the noise beneath."""
    shown = [r for r in runs if r.labels][:MOST]
    if not shown:
        say("no step to draw: see the status of each record")
        return
    figure = new_figure(max(4.8, 1.7 * max(len(r.labels) for r in shown)) * len(shown), 3.6)
    axes = figure.subplots(1, len(shown), squeeze=False)[0]
    for axis, run in zip(axes, shown, strict=True):
        steps = np.arange(len(run.labels))
        fits, ahead = np.array(run.fit_errors), np.array(run.ahead_errors)
        for i in range(fits.shape[1]):
            axis.step(steps, fits[:, i], where="mid", color=MEASURED, lw=0.9, alpha=0.7, label="fitted" if i == 0 else None)
            axis.step(steps, ahead[:, i], where="mid", color=MODEL, lw=1.4, label="on readings not fitted" if i == 0 else None)
        assert run.noise is not None
        axis.axhline(float(np.median(run.noise)), color=MARK, lw=1.0, ls="--", label="noise")
        axis.set_yscale("log")
        axis.set_xticks(steps, run.labels, fontsize=8)
        axis.set_ylabel("rms error, K", fontsize=8)
        axis.set_title(Path(run.run).name, fontsize=9)
        axis.tick_params(labelsize=8, which="both")
        axis.legend(fontsize=7, frameon=False)
    save_figure(path, figure)
