"""The pictures of ``inspect``: every column that was read, over time, as a file or in the terminal."""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...reading import Run
from ..screen import show_text
from .plots import MEASURED, new_figure, styled

#: Runs in one picture.
MOST = 4
#: Sensors, points and lines that a terminal can show.
SENSORS, POINTS, LINES = 6, 400, 16


@styled
def draw_columns(runs: Sequence[Run]) -> Any:
    """Sensors above, surroundings, inputs and displacements below, each with its own scale; None without a run."""
    shown = list(runs)[:MOST]
    if not shown:
        return None
    most = max(len(_strips(run)) for run in shown)
    figure = new_figure(5.6 * len(shown), 3.4 + 1.0 * most)
    ratios = [3.0, *[1.0] * most]
    axes = figure.subplots(most + 1, len(shown), squeeze=False, sharex="col", gridspec_kw={"height_ratios": ratios})
    for k, run in enumerate(shown):
        minutes = run.time_s / 60.0
        for name, values in run.channels.items():
            axes[0][k].plot(minutes, values, lw=1.1, label=name)
        axes[0][k].set_title(Path(run.name).name)
        axes[0][k].set_ylabel("°C")
        axes[0][k].legend(ncols=2)
        strips = _strips(run)
        for axis, (name, values) in zip(axes[1:, k], strips, strict=False):
            axis.plot(minutes, values, lw=1.0, color=MEASURED)
            axis.set_ylabel(name, rotation=0, ha="right", va="center")
        for axis in axes[1 + len(strips) :, k]:
            axis.set_visible(False)
        axes[len(strips)][k].set_xlabel("time, min")
        axes[len(strips)][k].tick_params(labelbottom=True)
    return figure


def _strips(run: Run) -> list[tuple[str, Any]]:
    return [*run.ambient.items(), *run.inputs.items(), *run.displacements.items()]


def show_plot(run: Run) -> None:
    """The sensors of a run over elapsed minutes, as characters."""
    import plotext as plt

    plt.clear_figure()
    colours = sys.stdout.isatty()
    plt.theme("pro" if colours else "clear")
    plt.plotsize(min(shutil.get_terminal_size((100, 24)).columns, 110), LINES)
    for number, (name, values) in enumerate(list(run.channels.items())[:SENSORS], 1):
        good = np.flatnonzero(np.isfinite(values))
        some = good[:: max(len(good) // POINTS, 1)]
        if len(some):
            plt.plot((run.time_s[some] / 60.0).tolist(), values[some].tolist(), label=name, marker="hd" if colours else str(number))
    plt.xlabel("min")
    plt.ylabel("degC")
    drawn = plt.build()
    show_text((drawn if colours else plt.uncolorize(drawn)) + "\n")
    more = len(run.channels) - SENSORS
    if more > 0:
        show_text(f"  and {more} more sensors\n")
