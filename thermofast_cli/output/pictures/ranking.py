"""Pictures of ``diagnose`` and of ``filters bench``: what is left of the misfit with each effect, and the error of each filter."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...records import BenchRecord, DiagnoseRecord
from .plots import MARK, MEASURED, MODEL, new_figure, styled

#: Runs beside each other, and effects of one, at most.
MOST_RUNS, MOST_TRIED = 6, 14


@styled
def draw_ranking(records: Sequence[DiagnoseRecord]) -> Any:
    """A dot for each effect or set that was tried, at the rms residual of the run with it; named ones in colour."""
    from matplotlib.ticker import LogLocator, NullFormatter

    runs = list(dict.fromkeys(r.run for r in records if r.ranking))[:MOST_RUNS]
    if not runs:
        return None
    first = {run: next(r for r in records if r.run == run and r.ranking) for run in runs}
    tried = {run: [one for one in first[run].ranking if one["rmse_fit_c"] is not None][:MOST_TRIED] for run in runs}
    figure, axes = _panels(runs, tried)
    for axis, run in zip(axes, runs, strict=True):
        mine = [r for r in records if r.run == run]
        named = {frozenset(r.verdict.split("+")) for r in mine}
        labels = [one["effect"] for one in tried[run]]
        colours = [MODEL if frozenset(label.split("+")) in named else MEASURED for label in labels]
        places = range(len(labels))[::-1]
        axis.scatter([one["rmse_fit_c"] for one in tried[run]], places, color=colours, s=42, zorder=3)
        noise = [r.noise_c for r in mine if r.noise_c is not None]
        if noise:
            axis.axvline(sorted(noise)[len(noise) // 2], color=MARK, lw=1.2, ls="--", label="noise")
            axis.legend(loc="upper right")
        axis.set_yticks(places, labels)
        axis.set_xscale("log")
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))  # powers and their parts in words run into each other
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_xlabel("residuals with it, rms K")
        verdicts = list(dict.fromkeys(r.verdict for r in mine))
        axis.set_title(_plain(f"{Path(run).name}: {', '.join(verdicts)}"))
    return figure


@styled
def draw_bench(records: Sequence[BenchRecord]) -> Any:
    """A bar for each filter, its length the error ahead where readings follow, else that of the fit; the one chosen in colour."""
    runs = list(dict.fromkeys(r.run for r in records if r.rmse_fit_c is not None))[:MOST_RUNS]
    if not runs:
        return None
    ahead = any(r.rmse_ahead_c is not None for r in records)
    shown = {run: [r for r in records if r.run == run] for run in runs}
    figure, axes = _panels(runs, shown)
    for axis, run in zip(axes, runs, strict=True):
        places = range(len(shown[run]))[::-1]
        errors = [(r.rmse_ahead_c if ahead else r.rmse_fit_c) or 0.0 for r in shown[run]]
        axis.barh(places, errors, color=[MODEL if r.chosen else MEASURED for r in shown[run]], height=0.7)
        axis.set_yticks(places, [r.filter for r in shown[run]])
        axis.set_xlabel("error ahead, rms K" if ahead else "residuals, rms K")
        axis.set_title(_plain(Path(run).name))
    return figure


def _panels(runs: Sequence[str], rows: Mapping[str, Sequence[Any]]) -> tuple[Any, Any]:
    """A figure with a panel for each run beside the others, high enough for the longest list of rows; and the panels."""
    figure = new_figure(5.2 * len(runs), 1.5 + 0.26 * max(map(len, rows.values())))
    return figure, figure.subplots(1, len(runs), squeeze=False)[0]


def _plain(text: str) -> str:
    """Text in which a dollar sign begins no formula."""
    return text.replace("$", r"\$")
