"""``thermofast sweep``."""

from typing import Any

import click

from ..shell.options import (
    READING,
    Finite,
    RunCommand,
    filter_options,
    model_option,
    output_options,
    reading_options,
    runs_argument,
)


@click.command(
    "sweep", cls=RunCommand, epilog="Example: thermofast sweep --windows 40,45,50,55 sample_runs/spindle.csv --save-plot sweep.png"
)
@runs_argument
@click.option("--windows", default="40,45,50,55", show_default=True, metavar="MIN,MIN", help="Sampling windows.")
@click.option(
    "--times", metavar="FIRST:LAST:STEP", help="Identification times; from 5 min (or a tenth) to the longest window by default."
)
@click.option(
    "--tolerance",
    type=Finite(0, min_open=True),
    default=0.1,
    show_default=True,
    metavar="K",
    help="Width of the steady state's interval to reach.",
)
@model_option
@filter_options
@reading_options
@output_options
@click.option("--save-plot", metavar="FILE", help="Draw RMSE against identification time, one curve per window: .png .pdf .svg.")
def command(
    runs: tuple[str, ...],
    windows: str,
    times: str | None,
    tolerance: float,
    model: str | None,
    filter_name: str,
    preset: str | None,
    settings: tuple[str, ...],
    form: str | None,
    output: str | None,
    jobs: int | None,
    quiet: bool,
    save_plot: str | None,
    **reading: Any,
) -> int:
    """Find the shortest identification time that serves, by the RMSE of the model over sampling windows.

    For every identification time the model identified on the readings so far runs over the whole window; best_time_min is where
    its RMSE is least, shortest_time_min the time from which it stays within the noise of that in every window, and
    tolerance_time_min the time from which the interval of the steady state is narrower than --tolerance.
    """
    from ..errors import UsageError
    from ..estimation.methods import choose
    from ..estimation.work import SweepTask, sweep_lost, sweep_task
    from ..output.files import TABLE_SUFFIXES, check_target, check_targets
    from ..output.screen import number, text
    from ..records import SweepRecord
    from ..shell.options import numbers
    from ..shell.session import choose_sources, collect, deliver, exit_code, read_all, share_out

    method = choose(filter_name, preset, settings)
    spans = numbers(windows, "--windows")
    grid = numbers(times, "--times") if times else default_times(spans)
    for span in spans:
        if not any(t < span - 1e-9 for t in grid):
            raise UsageError(
                f"no identification time lies below the window of {span:g} min",
                found=f"times from {grid[0]:g} to {grid[-1]:g} min",
                allowed="at least one time below each window",
                do="say --times FIRST:LAST:STEP",
            )
    if output:
        check_target(output, TABLE_SUFFIXES)
    if save_plot:
        from ..output.plots import SUFFIXES, require_matplotlib

        require_matplotlib()
        check_target(save_plot, SUFFIXES)
    sources = choose_sources(runs)
    check_targets([output, save_plot], sources)
    readings = read_all(sources, {k: reading[k] for k in READING}, quiet, jobs)
    for run, _ in readings.runs:
        length = run.time_s[-1] / 60.0
        if spans[-1] > length * 1.001:
            raise UsageError(
                f"{run.name}: the window of {spans[-1]:g} min is longer than the record",
                found=f"{length:.4g} min",
                allowed="windows inside the record",
                do="say --windows",
            )

    def make(name: str, minutes: Any, part: tuple[str, ...], values: Any, notes: tuple[str, ...], start: float) -> SweepTask:
        return SweepTask(name, minutes, part, values, notes, method, start, spans, grid, tolerance, bool(save_plot))

    if model:
        from ..discovery.loop import LoopTask
        from ..machine.modelfile import read_model
        from ..machine.settle import sweep_with_model

        learnt, interrupted = read_model(model), False
        told = reading["start"] != "auto"
        loops = [LoopTask(r, s if told else 0.0, model=model, drive=learnt.learnt_from.drive) for r, s in readings.runs]
        found = [swept for task in loops for swept in sweep_with_model(task, spans, grid, tolerance)]
    else:
        tasks, processes = share_out(readings, jobs, 1.0 + 0.02 * len(grid), make)
        found, interrupted = collect(sweep_task, tasks, processes, sweep_lost, quiet, readings.warm)
    records = [record for result in found for record in result.records]
    records += [SweepRecord(name, "", filter_name, status="unreadable", message=why) for name, why in readings.unreadable]
    drawn = [
        ("sensor", text("channel")),
        ("window min", number("window_min", 0)),
        ("best time", number("best_time_min", 1)),
        ("rmse K", number("rmse_c", 4)),
        ("earliest", number("earliest_time_min", 1)),
        ("shortest time", number("shortest_time_min", 1)),
        ("to tolerance", number("tolerance_time_min", 1)),
        ("agreed", text("agreed")),
        ("status", text("status")),
    ]
    deliver("sweep", records, SweepRecord, output, form, quiet, drawn, [r for r, _ in readings.runs])
    if save_plot:
        from ..output.plots import plot_sweep

        plot_sweep(save_plot, found)
    return exit_code(records, interrupted)


def default_times(windows: tuple[float, ...]) -> tuple[float, ...]:
    """About fifty times from 5 min, or a tenth of the shortest window, up to the longest window."""
    first = min(5.0, windows[0] / 10.0)
    step = max(round((windows[-1] - first) / 50.0), 1) if windows[-1] >= 30.0 else (windows[-1] - first) / 50.0
    count = int((windows[-1] - first) / step + 1e-9) + 1
    return tuple(round(first + i * step, 9) for i in range(count))
