"""Pictures of the discovery loop: model beside measurement with failing stretches, and the staircase of errors."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .plots import LINES, MARK, MEASURED, MODEL, new_figure, styled

if TYPE_CHECKING:
    from ...discovery.compare import Panel
    from ...discovery.improve import Improved

MOST = 6
FAILING = "#fbbf24"


@dataclass(frozen=True)
class Band:
    """The unknown heat of one sensor with its 95 % band."""

    channel: str
    unit: str
    time: Any
    heat: Any
    low: Any
    high: Any
    logged: Any = None


@styled
def draw_comparison(panels: "Sequence[Panel]") -> Any:
    """Per sensor: measurement and model above, residual below with failing stretches shaded, inputs in a strip under it."""
    if not panels:
        return None
    worst = sorted(panels, key=lambda p: -max((abs(s[2]) / p.noise for s in p.failing), default=0.0))[:MOST]
    shown = [p for p in panels if any(p is w for w in worst)]
    inputs = {n: c for n, c in shown[0].inputs.items() if np.ptp(c) > 0.0}
    across = min(3, len(shown))
    down = -(-len(shown) // across)
    tall = 4.0 * down
    heats = _bands(shown)
    strip = (0.9 * len(inputs) + 0.3 if inputs else 0.0) + (2.0 if heats else 0.0)
    figure = new_figure(4.8 * across, tall + strip + 0.6)
    upper, lower = figure.subfigures(2, 1, height_ratios=(tall, strip)) if strip else (figure, None)
    axes = upper.subplots(2 * down, across, squeeze=False, sharex=True, gridspec_kw={"height_ratios": [2.2, 1.3] * down})
    for at in range(down * across):
        column = [axes[2 * (at // across) + r][at % across] for r in range(2)]
        if at >= len(shown):
            for axis in column:
                axis.set_visible(False)
            continue
        _panel(column, shown[at])
    _legend(upper, axes)
    if lower is not None:
        _inputs(lower, shown[0].time, inputs, heats)
    more = f"  ({len(shown)} of {len(panels)} sensors, the worst)" if len(panels) > len(shown) else ""
    figure.suptitle(f"{Path(shown[0].run).name}: {shown[0].effects}{more}")
    return figure


def _legend(figure: Any, axes: Any) -> None:
    """One legend for all panels, each thing named once."""
    named: dict[str, Any] = {}
    for axis in axes.ravel():
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    figure.legend(list(named.values()), list(named), loc="outside upper right", ncols=len(named))


def _panel(column: list[Any], p: "Panel") -> None:
    top, low = column
    top.plot(p.time, p.reading, ".", ms=2.2, color=MEASURED, label="measured")
    top.plot(p.time, p.model, color=MODEL, lw=1.3, label="model")
    top.set_title(p.channel)
    top.set_ylabel("°C")
    residual = p.reading - p.model
    low.plot(p.time, residual, ".", ms=2.0, color=MEASURED)
    low.axhline(0.0, color=MODEL, lw=1.0)
    for axis in column:
        for a, b, _ in p.failing:
            axis.axvspan(a, b, color=FAILING, alpha=0.25, lw=0, label="the model fails")
        if p.until is not None:
            axis.axvline(p.until, color=MARK, lw=1.0, ls="--", label="identification time")
    low.set_ylabel("residual, K")
    low.set_xlabel("time, min")
    low.tick_params(labelbottom=True)


def _bands(shown: "Sequence[Panel]") -> list[Band]:
    """The unknown heat of each sensor: in W where that is known of all of them, else in K/min."""
    known = [p for p in shown if p.heat is not None]
    if known and all(p.in_watts is not None for p in known):
        return [Band(p.channel, "W", w.time, w.heat, w.low, w.high, w.logged) for p in known if (w := p.in_watts) is not None]
    found = [(p.channel, h.time, h.heat, 1.96 * h.deviation) for p in known if (h := p.heat) is not None]
    return [Band(channel, "K/min", time, heat, heat - wide, heat + wide) for channel, time, heat, wide in found]


def _inputs(figure: Any, time: Any, inputs: dict[str, Any], heats: Sequence[Band]) -> None:
    """The unknown heat of the sensors, and under it the logged columns, once for all sensors, each with its own scale."""
    ratios = ([2.2] if heats else []) + [1.0] * len(inputs)
    axes = figure.subplots(len(ratios), 1, squeeze=False, sharex=True, gridspec_kw={"height_ratios": ratios})[:, 0]
    if heats:
        for k, band in enumerate(heats):
            axes[0].plot(band.time, band.heat, lw=1.2, color=LINES[k % len(LINES)], label=band.channel)
            axes[0].fill_between(band.time, band.low, band.high, color=LINES[k % len(LINES)], alpha=0.2, lw=0)
        if heats[0].logged is not None:
            axes[0].plot(heats[0].time, heats[0].logged, color=MARK, lw=1.0, ls="--", label="logged")
        axes[0].set_ylabel(f"heat needed,\n{heats[0].unit}")
        axes[0].legend(ncols=3)
        axes[0].tick_params(labelsize=7)
        axes = axes[1:] if inputs else axes
    for k, (axis, (name, values)) in enumerate(zip(axes if inputs else [], inputs.items(), strict=True)):
        axis.plot(time, values, lw=1.0, color=LINES[k % len(LINES)])
        axis.set_ylabel(name, rotation=0, ha="right", va="center")
        axis.margins(y=0.15)
    axes[-1].set_xlabel("time, min")


@styled
def draw_staircase(runs: "Sequence[Improved]") -> Any:
    """Error of each step, fitted and ahead, one line per sensor, the noise beneath."""
    shown = [r for r in runs if r.labels][:MOST]
    if not shown:
        return None
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
        axis.set_xticks(steps, run.labels)
        axis.set_ylabel("rms error, K")
        axis.set_title(Path(run.run).name)
        axis.legend()
    return figure
