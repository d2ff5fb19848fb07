"""The one module that opens a user's records: from a path, standard input or memory to a table, and from there to its runs."""

import hashlib
import re
import stat
import sys
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError, listed, shown_name
from ..reading_options import Options
from .from_table import runs_from_table
from .run import Guess, Run, as_asked
from .table import Table, read_parquet
from .tables.cells import without_told
from .tables.frames import NAME as IN_MEMORY
from .tables.frames import table_of
from .tables.limits import Limits, refuse_no_path
from .tables.measured import is_measured, measured_table
from .tables.packed import is_workbook, unpacked
from .tables.text import read_text
from .tables.workbook import sheet_text
from .wide import read_wide

PARQUET_MAGIC = b"PAR1"
#: Lines above the readings are not counted as rows: not more than these, before they are looked at.
LONGEST_HEAD = 1000
#: Rows of another width, or with a cell that is no reading, that are left out of a growing file: more are another layout.
MOST_CUT, CUT_ROW, BAD_ROW = 20, "is no whole row", "cannot be read"
_BAD_ROW = re.compile(r", line (\d+)(: the row has \d+ cells)?(?(2)|.*: (?:not a number|no time in this row|unreadable time)$)")
#: Columns that only the program's own tables have together: rows of results, and the trace of a filter.
RESULTS, TRACE = frozenset({"run", "channel", "status", "message"}), frozenset({"run", "channel", "innovation_c"})
#: How texts of two bytes a sign begin, whose lines are not parted here.
WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff")


def read_growing(data: bytes, options: Options, name: str) -> Run:
    """The run that a logger is writing, from all whole lines so far: the last one, where time has begun anew.

    A logger that died in mid-line and began again leaves a row of another width, one that stammers a cell that is no reading: up to
    MOST_CUT such rows are left out, and noted.

    Raises
    ------
    InputError, UsageError: as :func:`read_runs`.
    """
    cut: list[str] = []
    while True:
        try:
            table = read_text(data, name, options)
            runs = runs_from_table(_shown(replace(table, notes=(*table.notes, *cut))), options)
            break
        except InputError as error:
            found = _BAD_ROW.search(error.what)
            if found is None or len(cut) == MOST_CUT or data.startswith(WIDE_MARKS) or b"\x00" in data[:2]:
                raise
            cut.append(f"line {found[1]} {CUT_ROW if found[2] else BAD_ROW} ({error.found[:40]}) and was left out")
            lines = data.splitlines(keepends=True)
            lines[int(found[1]) - 1] = b"\n"  # the others keep their numbers
            data = b"".join(lines)
    if options.strict:
        refuse_guesses(runs[-1])
    return as_asked(runs[-1], options)


def read_runs(source: Any, options: Options | None = None, name: str | None = None, data: bytes | None = None) -> list[Run]:
    """Read the runs of a file, mostly one, from a path (``file.csv#2`` for its second), or from standard input for ``-``.

    A pandas DataFrame, an Arrow table or a mapping of names to arrays is read by the same rules. data: the bytes of the file,
    where they have been read already.

    Raises
    ------
    InputError: the file is missing, a folder, empty, or no record; the message says where and what to do.
    UsageError: an option names a column that is not there.
    """
    options = options or Options()
    path, number = _numbered(str(source)) if isinstance(source, str | Path) else ("", None)
    table = read_table(source, options, name, data)
    runs = [as_asked(run, options) for run in runs_from_table(table, options)]
    if options.strict:
        for run in runs:
            refuse_guesses(run)
    if number is None:
        return runs
    if not 1 <= number <= len(runs):
        raise InputError(f"{source}: no run of that number", found=f"{len(runs)} in {path}", allowed=f"#1 to #{len(runs)}")
    return runs[number - 1 : number]


def read_table(source: Any, options: Options, name: str | None = None, data: bytes | None = None) -> Table:
    """The table of a file or of something in memory, before anyone says what its columns are; names as they may be shown.

    Raises
    ------
    InputError: as :func:`read_runs`.
    """
    table = _shown(_table(source, options, name, data))
    _refuse_own(table, options)
    return table


def _refuse_own(table: Table, options: Options) -> None:
    """Raises InputError of a table that the program wrote: its numbers are no readings."""
    names = frozenset(table.columns)
    if names >= RESULTS:
        do = "name the record that it came from; results are read with pandas, DuckDB or Excel"
        raise InputError(f"{table.name}: results of thermofast, and no record", found=listed(table.names, 5), do=do)
    if names >= TRACE and not options.long:
        do = "name the record that it came from; --long channel,reading_c takes its readings"
        raise InputError(f"{table.name}: the trace of a filter, and no record", found=listed(table.names, 5), do=do)


def _shown(table: Table) -> Table:
    """A table with names as they may be shown."""
    together = "".join(table.names)
    if shown_name(together) == together:
        return table
    shown: dict[str, str] = {}
    for n in table.names:
        told = shown_name(n)
        shown[n] = told if told not in shown.values() else f"{told} ({len(shown) + 1})"
    return replace(
        table,
        names=list(shown.values()),
        columns={shown[n]: v for n, v in table.columns.items()},
        units={shown[n]: v for n, v in table.units.items()},
        faults={shown[n]: v for n, v in table.faults.items()},
    )


def _table(source: Any, options: Options, name: str | None, data: bytes | None) -> Table:
    if not isinstance(source, str | Path):
        return without_told(table_of(source, name or IN_MEMORY, options), options.missing)
    refuse_no_path(str(source))
    path, _ = _numbered(str(source))
    name = name or ("stdin" if path == "-" else shown_name(path))
    limits = Limits(options.max_bytes, options.max_rows, options.max_columns)
    if data is None and (wide := read_wide(Path(path), name, options, limits)) is not None:
        return wide
    held = [unpacked(_bytes(path, limits) if data is None else data, name, limits)]
    if is_workbook(held[0]):
        sheet = sheet_text(held.pop(), name, options.sheet, limits)
        found = read_text(sheet.text, name, replace(options, delimiter=options.delimiter or ","))
        guesses = (*found.guesses, *(Guess("marks", text, way) for text, way in sheet.taken))
        return replace(found, notes=(f"Excel, sheet {sheet.name!r}", *found.notes[1:]), dialect=None, guesses=guesses)
    if is_measured(held[0]):
        return without_told(measured_table(held.pop(), name, options.sheet, limits), options.missing)
    if options.sheet is not None:
        raise UsageError(f"{name}: --sheet is for workbooks, TDMS and MATLAB files", do="leave it out")
    if held[0].startswith(PARQUET_MAGIC) or path.lower().endswith((".parquet", ".pq")):
        return without_told(read_parquet(held.pop(), name, limits), options.missing)
    # A row of readings has four bytes at least.
    if len(held[0]) > 4 * limits.max_rows and (lines := held[0].count(b"\n") - LONGEST_HEAD) > limits.max_rows:
        limits.check_shape(name, lines, 1)
    table = read_text(held.pop(), name, options)  # handed over, not kept
    limits.check_shape(name, len(table.lines), len(table.columns))
    return table


def refuse_guesses(run: Run) -> None:
    """Raises InputError where anything about the run was guessed."""
    if run.guesses:
        raise InputError(
            f"{run.name}: --strict refuses what had to be guessed",
            found="; ".join(g.text for g in run.guesses),
            do="; ".join(dict.fromkeys(g.option for g in run.guesses)),
        )


def _numbered(source: str) -> tuple[str, int | None]:
    """``file.csv#2`` as (``file.csv``, 2), unless a file of that whole name is there."""
    path, sign, number = source.rpartition("#")
    if sign and number.isdigit() and not Path(source).exists():
        return path, int(number)
    return source, None


def sha256_of(source: str) -> str:
    """Hash of a file; empty where there is none to read (standard input)."""
    try:
        return hashlib.sha256(Path(_numbered(source)[0]).read_bytes()).hexdigest()
    except OSError:
        return ""


def _bytes(source: str, limits: Limits = Limits(), name: str = "", waits: bool = True) -> bytes:  # noqa: B008 - frozen
    name = name or source
    if source == "-":
        if sys.stdin is None:
            raise InputError("standard input is closed", do="pipe a record in, or name a file")
        data = sys.stdin.buffer.read(limits.max_bytes + 1)
        limits.check_bytes("stdin", len(data))
        return data
    path = Path(source)
    try:
        mode = path.stat()
        if stat.S_ISBLK(mode.st_mode) or (stat.S_ISCHR(mode.st_mode) and source != "/dev/stdin"):
            raise InputError(f"{name}: a device", allowed="a file, or - for standard input", do="name the logger's file")
        if not waits and not stat.S_ISREG(mode.st_mode):
            raise InputError(f"{name}: a pipe", allowed="a file", do="leave it out of the archive")
        if stat.S_ISREG(mode.st_mode):
            limits.check_bytes(name, mode.st_size)
            return path.read_bytes()
        with path.open("rb") as stream:
            data = stream.read(limits.max_bytes + 1)
        limits.check_bytes(name, len(data))
        return data
    except FileNotFoundError:
        if path.is_symlink():
            found = f"a link to {shown_name(str(path.readlink()))}, which is not there"
            raise InputError(f"{name}: no such file", found=found, do="mend the link, or name the file") from None
        suffixes = (".csv", ".parquet", ".txt", ".lvm")
        there = sorted(p.name for p in path.parent.glob("*") if p.suffix.lower() in suffixes) if path.parent.is_dir() else []
        alike = get_close_matches(path.name, there, 3, 0.6)
        near = alike + [name for name in there if name not in alike]
        raise InputError(
            f"{name}: no such file",
            found=f"in {path.parent}: {listed(near, 6)}" if near else "",
            do="tf.archive takes patterns, or name the files" if {"*", "?"} & set(name) else "check the path",
        ) from None
    except IsADirectoryError:
        way = f"name the files, as in {name}/*.csv, or say -o results/"
        raise InputError(f"{name}: a folder", allowed="a CSV or Parquet file", do=way) from None
    except OSError as error:
        raise InputError(f"{name}: cannot be read", found=str(error.strerror), do="check the permissions") from None


def content_of(source: str, options: Options | None = None, name: str = "") -> tuple[str, bytes]:
    """(hash, bytes) of a file, told of by its name; a pipe, for which one might wait for ever, is none.

    Raises
    ------
    InputError: it cannot be read.
    """
    data = _bytes(_numbered(source)[0], Limits((options or Options()).max_bytes), name, waits=False)
    return hashlib.sha256(data).hexdigest(), data
