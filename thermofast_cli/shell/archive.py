"""A command whose ``-o`` names a folder: an archive instead of some runs."""

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

import click
from click.core import ParameterSource

from ..errors import UsageError
from ..output.files import REPORT_SUFFIXES, TABLE_SUFFIXES
from ..output.screen import counting, say
from ..records import FAILURES
from .options import EXCEL_CSV, MORE_OUTPUTS, scale_of

if TYPE_CHECKING:
    from ..archives.blocks import Analysis
    from ..archives.stream import Progress

#: Options that say nothing of what is worked out.
ELSEWHERE = {"runs", "output", "form", "jobs", "quiet", "save_plot", "trace", "plot_trace"}
#: Names of options whose name in the library is another one.
IN_LIBRARY = {"filter_name": "filter", "interval": "interval_s", "input_ranges": "input_range"}
#: Options that show a single run.
NOT_HERE = {
    "save_plot": "--save-plot",
    "trace": "--trace",
    "form": "--format",
    "plot_trace": "--plot-trace",
    "together": "--together",
    "write_effect": "--write-effect",
}


def names_folder(output: str | None) -> TypeGuard[str]:
    """Whether an output is a folder: one that is there, or a name with a slash at its end."""
    scale = scale_of()
    if scale.shared_files and not (output and (scale.cluster or scale.mpi or _started_by_mpi())):
        raise UsageError(
            "--shared-files is for a folder of results made by a cluster",
            do="name both, -o results/ and --cluster or --mpi, or leave it out",
        )
    if scale.prune and not scale.resume:
        raise UsageError("--prune takes parts out of results that --resume goes on with", do="name both, or leave it out")
    if output is not None and not output.strip():
        raise UsageError("-o: empty", allowed="a file, or a folder as results/", do="name it, or leave -o out")
    if output is None:
        if scale.resume:
            raise UsageError("--resume goes on with a folder of results", do="name it: -o results/")
        return False
    # A folder that is called as a file is more likely a slip.
    there = Path(output).is_dir() and Path(output).suffix.lower() not in (*TABLE_SUFFIXES, *REPORT_SUFFIXES)
    folder = output.endswith(("/", os.sep)) or there
    if scale.resume and not folder:
        raise UsageError("--resume goes on with a folder of results", found=output, do="name it: -o results/")
    return folder


def _started_by_mpi() -> bool:
    from ..workers.cluster import started_by_mpi

    return started_by_mpi()


def run_archive(
    analysis: "Analysis", named: tuple[str, ...], into: str, reading: dict[str, Any], jobs: int | None, quiet: bool
) -> int:
    """The archive's results into the folder; the exit code, as of :func:`~.session.deliver`.

    Raises
    ------
    ThermofastError: as :func:`~..archives.library.into_folder`, and options that show a single run.
    """
    from ..archives.library import TASK_TIMEOUT_S, into_folder
    from ..reading_options import options_from
    from ..workers.cluster import crew_of
    from .session import choose_sources, start_of

    context = click.get_current_context()
    shown = [word for name, word in NOT_HERE.items() if context.params.get(name)]
    if shown or context.meta.get(MORE_OUTPUTS):
        raise UsageError(
            f"{' '.join(shown) or 'a second -o'} is not for an archive", do=f"read the results: {into}, or name single files"
        )
    if context.meta.get(EXCEL_CSV):
        raise UsageError("--excel-csv is for CSV", found=f"-o {into}, a folder of Parquet parts", do="leave it out")
    named = choose_sources(named)
    if "-" in named:
        raise UsageError(
            "standard input is no archive", allowed="files, folders and patterns", do="name a file for -o, or the files to read"
        )
    if not named:
        raise UsageError("no files given", allowed="files, folders and patterns", do="as in: 'archive/**/*.parquet' -o results/")
    scale = scale_of()
    analysis = replace(analysis, settings=_settings(context))
    options, start = options_from({n: v for n, v in reading.items() if n != "start"}), start_of(reading["start"])
    crew = crew_of(jobs, scale.cluster, scale.mpi, guarded=scale.task_timeout is not None)
    try:
        with counting(quiet) as show:
            limit = scale.task_timeout if scale.task_timeout is not None else TASK_TIMEOUT_S
            found = into_folder(
                analysis,
                named,
                into,
                scale.resume,
                crew,
                options,
                start,
                limit,
                crew.near or scale.shared_files,
                lambda p: show(_line(p), p.done + p.skipped, p.files),
                scale.prune,
            )
    except KeyboardInterrupt:
        if not quiet:
            say(f"{into}: what was finished stands there; the same line with --resume goes on")
        raise
    if not quiet:
        rows = ", ".join(f"{count} {status}" for status, count in sorted(found.statuses.items()))
        lost = ", ".join(f"{count} {status}" for status, count in sorted(found.lost.items()))
        there = f"; {found.skipped} were there already{f' ({lost})' if lost else ''}" if found.skipped else ""
        files = f"{found.done} file{'' if found.done == 1 else 's'}"
        say(f"{into}: {files} done{f' (rows: {rows})' if rows else ''}{there}")
        if found.others:
            left = "taken out" if scale.prune else "left, and count in every query: --resume --prune takes them out"
            parts = "1 part is of a file" if found.others == 1 else f"{found.others} parts are of files"
            say(f"{into}: {parts} not named now; {left}")
    return 1 if FAILURES & {*found.statuses, *found.lost} else 0


def _line(progress: "Progress") -> str:
    left = progress.remaining_s()
    wait = "" if left is None else f", about {_span(left[0])} left ({_span(left[1])} to {_span(left[2])})"
    return f"{progress.done + progress.skipped} of {progress.files} files, {sum(progress.statuses.values())} records{wait}"


def _span(seconds: float) -> str:
    return (
        f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
    )


def _settings(context: click.Context) -> dict[str, str]:
    """What was told that a result depends on."""
    from .. import api
    from ..archives.settings import defaults_of, settings_of

    told = {
        name: value
        for name, value in context.params.items()
        if name not in ELSEWHERE and context.get_parameter_source(name) not in (ParameterSource.DEFAULT, None)
    }
    return settings_of({IN_LIBRARY.get(n, n): v for n, v in told.items()}, defaults_of(getattr(api, str(context.info_name))))
