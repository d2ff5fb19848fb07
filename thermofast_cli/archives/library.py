"""An archive from Python: the same stream that a command starts whose ``-o`` names a folder."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields
from functools import partial
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from ..given import NOTHING, Start, checked, model_of
from ..reading_options import Options, options_from
from ..results import Result
from ..workers.cluster import crew_of, kernels
from ..workers.flow import Crew
from .blocks import KINDS, OF_WHOLE_RUNS, Analysis, Reading
from .parts import Manifest, opened
from .settings import defaults_of, settings_of
from .sources import sources_of
from .stream import Progress, check_sources, stream

if TYPE_CHECKING:
    import pandas as pd

#: A task may take so long [s]; then it hangs.
TASK_TIMEOUT_S = 600.0


@dataclass(frozen=True)
class Archived:
    """A folder of results: files done now and there before, records made now by status, parts of files that were not named now, and
    records without a result, by status, of the files that were there before.
    """

    folder: str
    done: int
    skipped: int
    statuses: dict[str, int] = field(default_factory=dict)
    others: int = 0
    lost: dict[str, int] = field(default_factory=dict)

    def to_frame(self, columns: Sequence[str] | None = None) -> "pd.DataFrame":
        """The records of all parts, those of earlier calls too; `columns` of them."""
        import pyarrow as pa
        import pyarrow.dataset as pads

        # Folders called 7 and 007 are two: their names are text.
        place = pads.partitioning(pa.schema([("folder", pa.string())]), flavor="hive")
        table = pads.dataset(self.folder, format="parquet", partitioning=place).to_table(columns=columns and list(columns))
        frame: pd.DataFrame = table.to_pandas()
        return frame.astype({"folder": "category"}) if "folder" in frame else frame


@checked
def archive(
    command: str,
    sources: str | Path | Sequence[str | Path],
    into: str | Path,
    *,
    resume: bool = False,
    prune: bool = False,
    jobs: int | None = None,
    executor: Executor | None = None,
    cluster: str | None = None,
    shared_files: bool = False,
    task_timeout: float = TASK_TIMEOUT_S,
    start: Start = "auto",
    progress: Callable[[Progress], None] | None = None,
    **options: Any,
) -> Archived:
    """``identify``, ``sweep``, ``compare`` or ``diagnose`` over files, folders and patterns into a folder of Parquet parts.

    options are those of the function of that name and of reading; resume goes on with what an earlier call left, prune takes
    parts of files out that are not named any more. executor is any
    of ``concurrent.futures``, cluster the address of a Dask scheduler, task_timeout [s] what a task may take. shared_files: the
    workers of an executor or a cluster see the files and the results under the same paths, and read and write them themselves.

    Raises
    ------
    ThermofastError: as the command would refuse.
    """
    from .. import api

    if command not in KINDS:
        raise UsageError(f"no archive of {command!r}", allowed=" ".join(KINDS))
    from ..pipeline.sensors import from_rise

    reading = {name: options.pop(name) for name in [f.name for f in fields(Options)] if name in options}
    work = partial(getattr(api, command), **options, **({} if command == "diagnose" else {"details": False}))
    if prune and not resume:
        raise UsageError("prune=True takes parts out of results that resume=True goes on with", do="give both, or leave it out")
    if unknown := sorted(set(options) - set(signature(getattr(api, command)).parameters)):
        raise UsageError(f"tf.{command} has no option {unknown[0]!r}", do="see docs/api.md")
    work(NOTHING)  # wrong options are told before any file is read
    settings = settings_of(options | reading | {"start": start}, defaults_of(getattr(api, command)))
    analysis = Analysis(command, KINDS[command], partial(_called, work), settings=settings)
    if command in OF_WHOLE_RUNS:
        from_start = from_rise(model_of(options.get("model")), options.get("drive"))
        analysis = Analysis.of_sensors(command, analysis.call, options.get("filter", "afukf"), options, settings, from_start)
    named = [str(s) for s in ([sources] if isinstance(sources, str | Path) else sources)]
    read = options_from(reading)
    crew = crew_of(jobs, cluster, False, executor)
    begins, near = None if start == "auto" else float(start), crew.near or shared_files
    return into_folder(analysis, named, str(into), resume, crew, read, begins, task_timeout, near, progress, prune)


def _called(work: Callable[..., Result[Any]], started: Any, how: Any) -> Result[Any]:
    """A function of the library on one run; how: it takes somebody's executor only."""
    ((run, start),) = started
    return work(run, start=start, executor=how.executor)


def into_folder(
    analysis: Analysis,
    named: Sequence[str],
    into: str,
    resume: bool,
    crew: Crew,
    options: Options,
    start_min: float | None,
    limit_s: float | None,
    near: bool,
    told: Callable[[Progress], None] | None = None,
    prune: bool = False,
) -> Archived:
    """Everything from the names given to the last part.

    Raises
    ------
    ThermofastError: no file, a folder that holds something else, or results that cannot be written.
    """
    from .. import __version__

    try:
        sources = sources_of(named, into)
        check_sources(sources)
        manifest = Manifest(analysis.command, __version__, kernels(), dict(analysis.settings))
        with opened(into, manifest, resume) as parts:
            reading = Reading(options, start_min, analysis.from_rise)
            found = stream(analysis, sources, parts, crew, reading, limit_s, near, told or (lambda _progress: None))
            others = parts.others({s.name for s in sources}, prune)
    finally:
        crew.close()
    return Archived(into, found.done, found.skipped, dict(found.statuses), others, dict(found.lost))
