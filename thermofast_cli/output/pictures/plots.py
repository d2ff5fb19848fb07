"""Pictures, with matplotlib loaded only here and only when one is asked for."""

import textwrap
import warnings
from collections.abc import Callable, Sequence
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec

import numpy as np

from ...errors import UsageError
from ..files import check_target
from ..report.charts import STROKES
from ..whole import write_whole

if TYPE_CHECKING:
    from ...estimation.curves import Curves
    from ...estimation.sweep import Swept

P = ParamSpec("P")

SUFFIXES = (".png", ".pdf", ".svg")
MOST_PANELS = 24
MEASURED, MODEL, MARK = "#7a8793", "#b5410c", "#0072b2"
#: Times the range of what was read by which an axis reaches beyond it: where a rise settles is what the picture is for.
FARTHEST = 5.0
#: Lines beside each other: Okabe and Ito's colours, which the colour-blind tell apart.
LINES = tuple(colour for colour, _ in STROKES)
MOST_POINTS = 2000
#: Characters of a line of a panel's title.
TITLE_WIDTH = 46
#: Fonts of Chinese, Japanese and Korean names, where a machine has them.
OTHER_SCRIPTS = (
    "Noto Sans CJK SC",
    "Source Han Sans SC",
    "Microsoft YaHei",
    "SimHei",
    "PingFang SC",
    "WenQuanYi Zen Hei",
    "Yu Gothic",
    "MS Gothic",
    "Malgun Gothic",
    "Arial Unicode MS",
)
#: One style for the pictures of all commands; text in .svg and .pdf stays text.
STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d3d9dd",
    "grid.linewidth": 0.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.titlesize": 11,
    "savefig.dpi": 150,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}


def require_matplotlib() -> None:
    """Raises UsageError where matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise UsageError("pictures need matplotlib", do="pip install 'thermofast[plot]'") from None


def check_picture(path: str) -> None:
    """Raises UsageError where no picture can be made at `path`."""
    require_matplotlib()
    check_target(path, SUFFIXES)


def styled(draw: Callable[P, Any]) -> Callable[P, Any]:
    """A function that draws, in the style of all pictures.

    Raises
    ------
    UsageError: matplotlib is not installed.
    """

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Any:
        require_matplotlib()
        from cycler import cycler
        from matplotlib import rc_context

        with rc_context(_style() | {"axes.prop_cycle": cycler(color=LINES)}):
            return draw(*args, **kwargs)

    return drawn


def new_figure(width: float, height: float) -> Any:
    """An empty figure [inches]."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def framed(figure: Any, axis: Any, title: str, shown: int, of: int) -> None:
    """The legend of one panel below all of them, and a title that says how many sensors there are besides."""
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.suptitle(title + (f"  (first {shown} of {of} sensors)" if of > shown else ""))


def save_figure(path: str, figure: Any) -> None:
    """The figure, whole or not at all.

    Raises
    ------
    UsageError: an unknown suffix, or a place that cannot be written.
    """
    from matplotlib import rc_context

    check_target(path, SUFFIXES)
    with rc_context(_style()), warnings.catch_warnings():
        # A name in a script of which this machine has no font is drawn as boxes; its rows have it.
        warnings.filterwarnings("ignore", r"Glyph .* missing from", UserWarning)
        write_whole(path, figure.savefig)


@cache
def _style() -> Any:
    """The style of all pictures, with those fonts of this machine that have the names of sensors in other scripts."""
    from matplotlib.font_manager import fontManager

    there = {font.name for font in fontManager.ttflist}
    return STYLE | {"font.family": ["sans-serif", *(name for name in OTHER_SCRIPTS if name in there)]}


def _figure(panels: int, columns: int, width: float, height: float) -> tuple[Any, Any]:
    rows = -(-panels // columns)
    figure = new_figure(width * columns, height * rows + 0.6)
    return figure, figure.subplots(rows, columns, squeeze=False)


@styled
def draw_prediction(curves: "Sequence[Curves]", with_trace: bool = False) -> Any:
    """One panel per sensor: measurement, model, 95 % band, identification time; beside it, on request, rate and T_inf."""
    shown = curves[:MOST_PANELS]
    if not shown:
        return None
    across = 3 if with_trace else min(3, len(shown))
    panels = 3 * len(shown) if with_trace else len(shown)
    figure, axes = _figure(panels, across, 4.6, 3.0)
    flat = axes.ravel()
    several = len({c.run for c in shown}) > 1
    for i, c in enumerate(shown):
        row = flat[3 * i : 3 * i + 3] if with_trace else [flat[i]]
        _prediction(row[0], c, f"{Path(c.run).name}: {c.channel}" if several else c.channel)
        if with_trace:
            _converging(row[1], c, "rate_per_min", "rate_sd_per_min", "rate b, 1/min")
            _converging(row[2], c, "steady_state_c", "steady_state_sd_c", "steady state, °C")
    for axis in flat[panels:]:
        axis.set_visible(False)
    flat[0].legend(loc="best")
    left_out = len(curves) - len(shown)
    more = f"  (first {len(shown)} of {len(curves)} sensors)" if left_out else ""
    figure.suptitle(f"{Path(shown[0].run).name if not several else 'thermofast identify'}{more}")
    return figure


def _prediction(axis: Any, c: "Curves", title: str) -> None:
    step = max(1, len(c.time) // MOST_POINTS)
    axis.plot(c.time[::step], c.reading[::step], ".", ms=2.5, color=MEASURED, label="measured")
    axis.fill_between(c.model_time, c.band_low, c.band_high, color=MODEL, alpha=0.18, lw=0, label="95 % band")
    axis.plot(c.model_time, c.model, color=MODEL, lw=1.4, label="model")
    axis.axvline(c.until, color=MARK, lw=1, ls="--", label="identification time")
    if c.steady_state is not None:
        axis.axhline(c.steady_state, color=MODEL, lw=0.9, ls=":", label="steady state")
    if c.t95 is not None and c.t95 <= c.model_time[-1]:
        axis.axvline(c.t95, color=MEASURED, lw=0.9, ls="-.", label="95 % of the rise")
    # The band of a short record may leave the page: the readings and the model set the scale.
    low = float(min(np.nanmin(c.reading), np.nanmin(c.model)))
    high = float(max(np.nanmax(c.reading), np.nanmax(c.model)))
    if c.steady_state is not None:
        low, high = min(low, c.steady_state), max(high, c.steady_state)
    span = max(high - low, 1e-3)
    real_low, real_high = float(np.nanmin(c.reading)), float(np.nanmax(c.reading))
    room = FARTHEST * max(real_high - real_low, 1e-3)
    axis.set_ylim(max(low - 0.08 * span, real_low - room), min(high + 0.15 * span, real_high + room))
    axis.set_title(textwrap.fill(f"{title}: {c.note}", TITLE_WIDTH))
    axis.set_xlabel("time, min")
    axis.set_ylabel("temperature, °C")


def _converging(axis: Any, c: "Curves", value: str, deviation: str, label: str) -> None:
    time, mean, spread = c.trace["time_min"], c.trace[value], 1.96 * c.trace[deviation]
    good = np.isfinite(mean) & np.isfinite(spread)
    if good.any():
        axis.fill_between(time[good], (mean - spread)[good], (mean + spread)[good], color=MODEL, alpha=0.18, lw=0)
        axis.plot(time[good], mean[good], color=MODEL, lw=1.2)
        last = mean[good][len(mean[good]) // 4 :]
        middle, half = float(np.median(last)), max(4.0 * float(np.ptp(last)), 2.0 * float(spread[good][-1]), 1e-6)
        axis.set_ylim(middle - half, middle + half)
    axis.set_xlabel("time, min")
    axis.set_ylabel(label)


@styled
def draw_sweep(results: "Sequence[Swept]") -> Any:
    """RMSE against identification time, one curve per window, one panel per sensor; the paper's figure 6."""
    shown = [r for r in results if np.isfinite(r.rmse).any()][:MOST_PANELS]
    if not shown:
        return None
    figure, axes = _figure(len(shown), min(3, len(shown)), 4.6, 3.0)
    flat = axes.ravel()
    several = len({r.records[0].run for r in shown}) > 1
    for axis, result in zip(flat, shown, strict=False):
        for j, record in enumerate(result.records):
            good = np.isfinite(result.rmse[j])
            colour = LINES[j % len(LINES)]
            axis.semilogy(result.times[good], result.rmse[j][good], color=colour, lw=1.2, label=f"{record.window_min:g} min")
            if record.best_time_min is not None:
                axis.plot(record.best_time_min, record.rmse_c, "o", ms=4, color=colour)
        first = result.records[0]
        if first.shortest_time_min is not None and first.agreed and first.status == "ok":
            axis.axvline(first.shortest_time_min, color=MARK, lw=1, ls="--", label="shortest time that serves")
        axis.set_title(f"{Path(first.run).name}: {first.channel}" if several else first.channel)
        axis.set_xlabel("identification time, min")
        axis.set_ylabel("RMSE over the window, K")
    for axis in flat[len(shown) :]:
        axis.set_visible(False)
    flat[0].legend(title="window")
    figure.suptitle("thermofast sweep" if several else Path(shown[0].records[0].run).name)
    return figure
