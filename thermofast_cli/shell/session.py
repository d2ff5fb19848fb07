"""What every command does around its own work: read the runs, share the sensors out, gather the records, say how it went."""

import os
import stat
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ..archives.sources import named_by
from ..errors import InputError, ThermofastError, UsageError
from ..output.files import REPORT_SUFFIXES, TABLE_SUFFIXES, check_target, check_targets
from ..output.screen import chosen_format, progress, say, show_records
from ..output.whole import once_written
from ..reading import read_runs
from ..reading_options import options_from
from ..records import FAILURES
from ..results import Result
from ..workers.engine import Started, Work, with_start
from ..workers.pool import warm_pool
from .made import how_made
from .options import EXCEL_CSV, MORE_OUTPUTS, scale_of

#: Outputs that show more than the records.
DETAILED = (".xlsx", ".html")

if TYPE_CHECKING:
    from thermofast.models.imperfection import Imperfection

    from ..machine.model import Model

#: How a command is called on a run, where its name and a file are not all.
EXAMPLES = {"changed": "changed before.csv --new after.csv", "bench": "filters bench run.csv"}


@dataclass(frozen=True)
class Readings:
    """Runs read, with the start of each [min], and (name, why) of those that could not be."""

    runs: list[Started]
    unreadable: list[tuple[str, str]]
    warm: ProcessPoolExecutor | None = None

    @property
    def sensors(self) -> int:
        """How many there are, for a progress bar."""
        return sum(len(run.channels) for run, _ in self.runs)


def read_all(
    runs: tuple[str, ...],
    given: dict[str, Any],
    quiet: bool,
    targets: Sequence[str | None] = (),
    jobs: int | None = None,
    from_rise: bool = True,
    search: bool = True,
) -> Readings:
    """Read every run; what was taken for what goes to standard error.

    from_rise: as in :func:`~..workers.engine.with_start`; search: as in :func:`~..workers.pool.new_pool`.
    targets are the files to be written, which may be no run.

    Raises
    ------
    ThermofastError: there is one run and it cannot be read, or none of several can.
    """
    sources = named_by(choose_sources(runs))
    check_targets([*targets, *more_outputs()], sources)
    if not sources:
        context = click.get_current_context(silent=True)
        command = str(context.info_name) if context is not None else "identify"
        raise UsageError(
            "no RUN given",
            allowed="files, - for standard input, a pipe, or runs = [...] in thermofast.toml",
            do=f"as in: thermofast {EXAMPLES.get(command, f'{command} run.csv')}",
        )
    if len(set(sources)) < len(sources):
        raise UsageError("the same RUN twice", found=", ".join(s for s in set(sources) if list(sources).count(s) > 1))
    options, start = options_from({name: value for name, value in given.items() if name != "start"}), start_of(given["start"])
    warm = warm_pool(jobs, sum(Path(s).stat().st_size for s in sources if Path(s).is_file()), search)
    found, unreadable = [], []
    last: ThermofastError | None = None
    for source in sources:
        try:
            read = read_runs(source, options)
        except ThermofastError as error:
            unreadable.append((source, str(error)))
            last = error
            continue
        for run in read:
            found.append(with_start(run, start, from_rise))
            if not quiet:
                say(f"{run.name}: {'; '.join([*run.notes, *map(str, run.guesses)])}")
                if start is None and found[-1][1] > 0.0:
                    say(f"{run.name}: the rise begins at {found[-1][1]:.4g} min (--start to say otherwise)")
    if not found and last is not None:
        if warm is not None:
            warm.shutdown(cancel_futures=True)
        if len(unreadable) == 1:
            raise last
        raise InputError("none of the runs could be read", found="\n  ".join(why for _, why in unreadable))
    for _, why in unreadable:
        say(why)
    return Readings(found, unreadable, warm)


def start_of(text: str) -> float | None:
    """``--start`` [min]; None for auto.

    Raises
    ------
    UsageError: no time.
    """
    if text == "auto":
        return None
    try:
        value = float(text)
        if not 0.0 <= value < 1e7:
            raise ValueError
    except ValueError:
        raise UsageError("--start: not a time", found=repr(text), allowed="minutes from the first reading, or auto") from None
    return value


def load_model(path: str | None, extra: Sequence[str] = (), searched: bool = False) -> "Model | None":
    """The model file named, checked, with the effects of the user's own named beside it; None where none is. Imported only then:
    most calls need no model.

    searched: the effects are of use without a model, too.

    Raises
    ------
    UsageError: as :meth:`Model.load`, and effects beside no model.
    """
    if path is None:
        if extra and not searched:
            raise UsageError(
                "--effect is for a --model that speaks of it", found=", ".join(extra), do="name the model, or leave it out"
            )
        return None
    from ..machine.model import Model

    return Model.load(path, extra)


def load_imperfection(named: str) -> "Imperfection":
    """``typical``, ``none`` or the prior of a file.

    Raises
    ------
    UsageError: as :func:`read_imperfection`.
    """
    from ..machine.lab import read_imperfection

    return read_imperfection(named)


def check_outputs(tables: Sequence[str | None], picture: str | None = None) -> None:
    """Refuses outputs that cannot be written before any work is done for them.

    Raises
    ------
    UsageError: an unknown suffix, no such folder, no matplotlib for a picture, or --excel-csv without CSV.
    """
    if wants_excel_csv():
        form = click.get_current_context().params.get("form")
        csv = [t for t in (*tables, *more_outputs()) if t and t.lower().endswith(".csv")]
        if not csv and (form or ("" if any(tables) else chosen_format(None))) != "csv":
            raise UsageError("--excel-csv is for CSV", do="add -o FILE.csv or --format csv")
    # The result itself may be a page; it comes first.
    results = [*tables[:1], *more_outputs()]
    folder = "; for -o a folder of results ends with /, as in -o results/"
    # Commands that go on with such a folder make one.
    or_else = folder if any(p.name == "resume" for p in click.get_current_context().command.params) else ""
    for target in [*results, *tables[1:]]:
        if target:
            check_target(target, (*TABLE_SUFFIXES, *(REPORT_SUFFIXES if target in results else ())), or_else)
    if picture:
        from ..output.pictures.plots import check_picture

        check_picture(picture)


@contextmanager
def working(readings: Readings, total: int, what: str, quiet: bool, jobs: int | None) -> Iterator[Work]:
    """How the library is to work for a command: progress on a terminal, what is finished kept where the user interrupts."""
    scale = scale_of()
    crew = None
    if scale.cluster is not None or scale.mpi:
        from ..workers.cluster import crew_of

        crew = crew_of(jobs, scale.cluster, scale.mpi)
    with progress(total, what, quiet) as advance:
        try:
            yield Work(jobs, readings.warm, advance, keep=True, limit_s=scale.task_timeout, crew=crew)
        finally:
            if crew is not None:
                crew.close()
            if readings.warm is not None:
                readings.warm.shutdown(cancel_futures=True)


def deliver(
    result: Result[Any],
    unreadable: Sequence[Any],
    output: str | None,
    form: str | None,
    quiet: bool,
    drawn: Sequence[Any],
    beneath: tuple[str, ...] = ("message",),
) -> int:
    """A result, and records of what could not be read, to the file named or to standard output; the exit code.

    `beneath` are the texts under a drawn table. Exit code: 0 done, 1 some sensor failed, 130 interrupted.
    """
    whole = replace(result, records=(*result.records, *unreadable)) if unreadable else result
    targets, made = [*([output] if output else []), *more_outputs()], how_made()
    for target in targets:
        whole.save(target, wants_excel_csv(), made)
        if not quiet:
            once_written(partial(say, f"{len(whole)} record{'' if len(whole) == 1 else 's'} in {target}"))
    if form or not targets:
        columns, excel = whole.kind.columns(), wants_excel_csv()
        show_records(whole.command, columns, whole.rows(), form, drawn, beneath, whole.input(), excel)
    if result.interrupted:
        say(f"interrupted: {len(result)} records were finished")
        return 130
    return 1 if any(status in FAILURES for status in whole.statuses()) else 0


def more_outputs() -> tuple[str, ...]:
    """The files that -o named beside the first."""
    context = click.get_current_context(silent=True)
    return tuple(context.meta.get(MORE_OUTPUTS, ())) if context else ()


def wants_excel_csv() -> bool:
    """Whether --excel-csv was given."""
    context = click.get_current_context(silent=True)
    return bool(context and context.meta.get(EXCEL_CSV))


def on_the_command_line(name: str) -> bool:
    """Whether a parameter was given there, not by a settings file or by default."""
    context = click.get_current_context(silent=True)
    return context is not None and context.get_parameter_source(name) is ParameterSource.COMMANDLINE


def wants_details(output: str | None, picture: str | None) -> bool:
    """Whether more than the records is to be shown: by a picture, or by a workbook with charts."""
    return bool(picture) or any(o and Path(o).suffix.lower() in DETAILED for o in (output, *more_outputs()))


def draw(result: Any, path: str | None, **more: Any) -> None:
    """The picture of a result, where one is asked for."""
    if path and result.plot(path, **more) is None:
        say("nothing to draw: see the status of each record")


def choose_sources(given: tuple[str, ...]) -> tuple[str, ...]:
    """The runs named on the command line, else standard input where something is piped in, else those of thermofast.toml."""
    named = click.get_current_context(silent=True) is None or on_the_command_line("runs")
    if given and named:
        return given
    if _piped() and (not given or _holds_something()):
        return ("-",)
    return given


def _piped() -> bool:
    """Whether standard input is a pipe or a file, not a terminal and not nothing."""
    try:
        mode = os.fstat(sys.stdin.fileno()).st_mode
    except (AttributeError, OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISREG(mode) or stat.S_ISSOCK(mode)


def _holds_something() -> bool:
    buffer: Any = sys.stdin.buffer
    return bool(buffer.peek(1))
