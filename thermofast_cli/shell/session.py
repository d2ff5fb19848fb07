"""What every command does around its own work: read the runs, share the sensors out, gather the records, say how it went."""

import os
import stat
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from click.core import ParameterSource

from ..errors import InputError, ThermofastError, UsageError
from ..estimation.sensor import run_start
from ..output.files import write_table
from ..output.screen import progress, say, show_records
from ..pool import map_tasks, warm_pool, worth
from ..reading import Options, Run, read_runs, told
from ..records import FAILURES, Record
from .options import names

#: Sensors per task: enough to make the way to a worker worth it, few enough to share out evenly.
MOST_PER_TASK = 250


@dataclass(frozen=True)
class Readings:
    """Runs read, with the start of each one's rise [min], and (name, why) of those that could not be."""

    runs: list[tuple[Run, float]]
    unreadable: list[tuple[str, str]]
    warm: ProcessPoolExecutor | None = None


def read_options(given: dict[str, Any]) -> Options:
    """The user's word on reading, from the command's options."""
    delimiter = {"tab": "\t", "\\t": "\t", "blank": " ", "space": " "}.get(given["delimiter"] or "", given["delimiter"])
    if delimiter is not None and (len(delimiter) != 1 or not delimiter.isascii()):
        raise UsageError("--delimiter: one character", found=repr(delimiter), allowed="one character, 'tab' or 'blank'")
    return Options(
        time=given["time"],
        time_unit=given["time_unit"],
        time_format=given["time_format"],
        interval_s=given["interval"],
        ambient=given["ambient"],
        inputs=names(given["inputs"]),
        channels=names(given["channels"]),
        exclude=names(given["exclude"]),
        missing=names(given["missing"]),
        delimiter=delimiter,
        decimal=given["decimal"],
        encoding=given["encoding"],
        header_line=given["header_line"],
        long=_long(given["long"]),
        units=names(given["units"]),
        strict=bool(given["strict"]),
    )


def _long(text: str | None) -> tuple[str, ...]:
    """``SENSOR,VALUE`` as two names; a comma within one is written in quotes."""
    if not text:
        return ()
    import csv

    parts = tuple(p.strip() for p in next(csv.reader([text])))
    if len(parts) != 2 or not all(parts):
        raise UsageError(
            "--long: not two columns", found=repr(text), allowed="SENSOR,VALUE, or A+B,VALUE where two columns name the sensor"
        )
    return parts


def read_all(sources: Sequence[str], given: dict[str, Any], quiet: bool, jobs: int | None = None) -> Readings:
    """Read every run; what was taken for what goes to standard error.

    Raises
    ------
    ThermofastError: there is one run and it cannot be read, or none of several can.
    """
    if not sources:
        raise UsageError(
            "no RUN given",
            allowed="files, - for standard input, a pipe, or runs = [...] in thermofast.toml",
            do="as in: thermofast identify run.csv",
        )
    if len(set(sources)) < len(sources):
        raise UsageError("the same RUN twice", found=", ".join(s for s in set(sources) if list(sources).count(s) > 1))
    options, start = read_options(given), _start(given["start"])
    warm = warm_pool(jobs, sum(Path(s).stat().st_size for s in sources if Path(s).is_file()))
    runs, unreadable = [], []
    last: ThermofastError | None = None
    for source in sources:
        try:
            found = read_runs(source, options)
        except ThermofastError as error:
            unreadable.append((source, str(error)))
            last = error
            continue
        for run in found:
            minutes = run.time_s / 60.0
            begins = start if start is not None else run_start(minutes, list(run.channels.values()))
            if begins >= minutes[-1]:
                raise UsageError(f"{run.name}: --start {begins:g} is after the end of the record", found=f"{minutes[-1]:.4g} min")
            if not quiet:
                say(f"{run.name}: {'; '.join([*run.notes, *map(str, run.guesses)])}")
                if start is None and begins > 0.0:
                    say(f"{run.name}: the rise begins at {begins:.4g} min (--start to say otherwise)")
            runs.append((run, begins))
    if not runs and last is not None:
        if warm is not None:
            warm.shutdown(cancel_futures=True)
        if len(unreadable) == 1:
            raise last
        raise InputError("none of the runs could be read", found="\n  ".join(why for _, why in unreadable))
    for _, why in unreadable:
        say(why)
    return Readings(runs, unreadable, warm)


def _start(text: str) -> float | None:
    if text == "auto":
        return None
    try:
        value = float(text)
        if not 0.0 <= value < 1e7:
            raise ValueError
    except ValueError:
        raise UsageError("--start: not a time", found=repr(text), allowed="minutes from the first reading, or auto") from None
    return value


def share_out(
    readings: Readings, jobs: int | None, weight: float, make: Callable[..., Any], whole: bool = False
) -> tuple[list[Any], int]:
    """Tasks over all sensors of all runs, `whole` runs or parts of them, and the number of processes that they pay for."""
    sensors = sum(len(run.channels) for run, _ in readings.runs)
    longest = max(len(run.time_s) for run, _ in readings.runs)
    processes = jobs if jobs is not None else worth(sensors, longest, weight)
    tasks = []
    for run, start in readings.runs:
        channels = list(run.channels)
        size = max(1, min(MOST_PER_TASK, -(-len(channels) // (4 * processes)))) if processes > 1 else MOST_PER_TASK
        size = len(channels) if whole else size
        for i in range(0, len(channels), size):
            part = tuple(channels[i : i + size])
            values = np.stack([run.channels[c] for c in part])
            notes = tuple(run.channel_notes.get(c, "") for c in part)
            tasks.append(make(run.name, run.time_s / 60.0, part, values, notes, start))
    return tasks, processes


def collect(
    work: Callable[[Any], list[Any]],
    tasks: list[Any],
    jobs: int,
    lost: Callable[[Any], list[Any]],
    quiet: bool,
    warm: Executor | None = None,
) -> tuple[list[Any], bool]:
    """Results in order of the sensors, and whether the user interrupted the work; what was finished by then is kept."""
    found: list[Any] = []
    with progress(sum(len(t.channels) for t in tasks), "sensors", quiet) as advance:
        try:
            for results in map_tasks(work, tasks, jobs, lambda task: task.singles(), lost, warm if jobs > 1 else None):
                advance(len(results))
                found += results
        except KeyboardInterrupt:
            say(f"interrupted: {len(found)} sensors were finished")
            return found, True
        finally:
            if warm is not None:
                warm.shutdown(cancel_futures=True)
    return found, False


def deliver(
    command: str,
    records: Sequence[Record],
    kind: type[Record],
    output: str | None,
    form: str | None,
    quiet: bool,
    drawn: Sequence[Any],
    runs: Sequence[Run],
    beneath: tuple[str, ...] = ("message",),
) -> None:
    """Records to the file named, or to standard output; `beneath` are the texts under a drawn table.

    What was guessed of a run stands in the message of each of its records, and with the reader's notes in JSON's ``input``.
    """
    guessed = {run.name: told(run.guesses) for run in runs if run.guesses}
    rows = [_with_guesses(record.as_dict(), guessed) for record in records]
    input_ = [{"run": r.name, "notes": list(r.notes), "guesses": [g.as_dict() for g in r.guesses]} for r in runs]
    if output:
        write_table(output, command, kind.columns(), rows, input_)
        if not quiet:
            say(f"{len(rows)} records in {output}")
    if form or not output:
        show_records(command, kind.columns(), rows, form, drawn, beneath, input_)


def _with_guesses(row: dict[str, Any], guessed: dict[str, str]) -> dict[str, Any]:
    words = guessed.get(row["run"])
    return row if not words else {**row, "message": "; ".join(m for m in (row["message"], words) if m)}


def exit_code(records: Sequence[Any], interrupted: bool) -> int:
    """0 done, 1 some sensor failed, 130 interrupted."""
    if interrupted:
        return 130
    return 1 if any(record.status in FAILURES for record in records) else 0


def choose_sources(given: tuple[str, ...]) -> tuple[str, ...]:
    """The runs named on the command line, else standard input where something is piped in, else those of thermofast.toml."""
    context = click.get_current_context(silent=True)
    named = context is None or context.get_parameter_source("runs") is ParameterSource.COMMANDLINE
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
