"""The one module that opens a user's records, and the steps from a table to a run."""

import hashlib
import sys
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from ..errors import InputError, UsageError, listed
from .columns import check_names, classify, to_celsius, to_micrometres, without_impossible
from .run import Array, Options, Run
from .table import Table, read_parquet
from .text import read_text
from .times import UNITS, epoch_unit, is_time_name, stamps_to_seconds, unit_of

PARQUET_MAGIC = b"PAR1"
FEWEST_ROWS = 2


def read_run(source: str, options: Options | None = None) -> Run:
    """Read one record from a path, or from standard input for ``-``.

    Raises
    ------
    InputError: the file is missing, a folder, empty, or no record; the message says where and what to do.
    UsageError: an option names a column that is not there.
    """
    options = options or Options()
    data = _bytes(source)
    name = "stdin" if source == "-" else source
    parquet = data.startswith(PARQUET_MAGIC) or source.lower().endswith((".parquet", ".pq"))
    table = read_parquet(data, name) if parquet else read_text(data, name, options)
    return run_from_table(table, options)


def sha256_of(source: str) -> str:
    """Hash of a file; empty where there is none to read (standard input)."""
    try:
        return hashlib.sha256(Path(source).read_bytes()).hexdigest()
    except OSError:
        return ""


def _bytes(source: str) -> bytes:
    if source == "-":
        if sys.stdin is None:
            raise InputError("standard input is closed", do="pipe a record in, or name a file")
        return sys.stdin.buffer.read()
    path = Path(source)
    try:
        return path.read_bytes()
    except FileNotFoundError:
        suffixes = (".csv", ".parquet", ".txt", ".lvm")
        there = sorted(p.name for p in path.parent.glob("*") if p.suffix.lower() in suffixes) if path.parent.is_dir() else []
        alike = get_close_matches(path.name, there, 3, 0.6)
        near = alike + [name for name in there if name not in alike]
        raise InputError(
            f"{source}: no such file",
            found=f"in {path.parent}: {listed(near, 6)}" if near else "",
            do="check the path",
        ) from None
    except IsADirectoryError:
        raise InputError(
            f"{source}: a folder", allowed="a CSV or Parquet file", do=f"name the files, as in {source}/*.csv"
        ) from None
    except OSError as error:
        raise InputError(f"{source}: cannot be read", found=str(error.strerror), do="check the permissions") from None


def run_from_table(table: Table, options: Options) -> Run:
    """What each column is, time in order, temperatures in degC."""
    notes = list(table.notes)
    time, used, note = _time(table, options)
    notes.append(note)
    numbers = {n: c for n, c in table.columns.items() if n not in used and isinstance(c, np.ndarray)}
    named = [n for n in numbers if not (n.startswith("column ") and np.isnan(numbers[n]).all())]
    words = [n for n, c in table.columns.items() if n not in used and not isinstance(c, np.ndarray)]
    if words:
        notes.append(f"columns of words left out: {listed(words, 6)}")
    check_names(options.exclude, table.names, "--exclude", table.name)
    if options.channels:
        check_names(options.channels, [*named, *words], "--channels", table.name)
    roles = classify(named, numbers, table.units, options, table.name)
    if roles.counters:
        notes.append(f"row counters left out: {listed(roles.counters)}")
    if not roles.sensors:
        raise InputError(
            f"{table.name}: no sensor column",
            found=listed([*roles.ambient, *roles.inputs, *words]) or "only a time column",
            allowed="at least one column of temperatures",
            do="name the sensors with --channels",
        )
    time, numbers, mended = _in_order(time, numbers, table.name)
    notes += mended
    channel_notes: dict[str, str] = {}
    temperatures: dict[str, Array] = {}
    for n in (*roles.sensors, *roles.ambient):
        values, unit_note = to_celsius(n, table.units.get(n, ""), numbers[n])
        values, impossible = without_impossible(values)
        if unit_note:
            notes.append(unit_note)
        if impossible:
            channel_notes[n] = f"{impossible} overload or impossible readings left out"
        temperatures[n] = values
    notes.append(f"{len(roles.sensors)} sensors ({listed(roles.sensors, 4)})")
    if roles.ambient:
        notes.append(f"surroundings: {listed(roles.ambient)}")
    if roles.inputs:
        notes.append(f"inputs: {listed(roles.inputs)}")
    displacements: dict[str, Array] = {}
    for n in roles.displacements:
        displacements[n], unit_note = to_micrometres(n, table.units.get(n, ""), numbers[n])
        notes += [unit_note] if unit_note else []
    if roles.displacements:
        notes.append(f"displacements: {listed(roles.displacements)}")
    return Run(
        table.name,
        time,
        {n: temperatures[n] for n in roles.sensors},
        {n: temperatures[n] for n in roles.ambient},
        {n: numbers[n] for n in roles.inputs},
        tuple(notes),
        channel_notes,
        displacements,
    )


def _time(table: Table, options: Options) -> tuple[Array, set[str], str]:
    """Seconds from the first row, the columns used, and how they were read."""
    rows = len(next(iter(table.columns.values())))
    if rows < FEWEST_ROWS:
        raise InputError(f"{table.name}: {rows} row of readings", allowed=f"at least {FEWEST_ROWS}", do="export more of the record")
    if options.interval_s is not None:
        even: Array = np.arange(rows, dtype=np.float64) * options.interval_s
        return even, {n for n in table.names if is_time_name(n)}, f"time: one row every {options.interval_s:g} s, as told"
    if options.time is not None:
        check_names([options.time], table.names, "--time", table.name)
        return _convert(table, options.time, None, options)
    stamped = [n for n in table.names if not isinstance(table.columns[n], np.ndarray)]
    named = [n for n in table.names if is_time_name(n)]
    # A date and a clock in two columns are one time.
    dates = [n for n in named if n in stamped and ":" not in table.columns[n][0]]
    clocks = [n for n in named if n in stamped and ":" in table.columns[n][0] and len(table.columns[n][0].strip()) <= 15]
    if dates and clocks:
        return _convert(table, dates[0], clocks[0], options)
    for n in [n for n in named if n in stamped] + [n for n in named if n not in stamped]:
        column = table.columns[n]
        if not isinstance(column, np.ndarray) or np.isfinite(column).any():
            return _convert(table, n, None, options)
    for n in stamped:
        column = table.columns[n]
        if not isinstance(column, np.ndarray) and any(ch.isdigit() for ch in column[0]) and ":" in column[0]:
            return _convert(table, n, None, options)
    first = table.columns[table.names[0]]
    if isinstance(first, np.ndarray) and table.names[0] == "column 1" and np.isfinite(first).all() and (np.diff(first) > 0).all():
        return _convert(table, table.names[0], None, options)
    raise InputError(
        f"{table.name}: no time column",
        found=listed(table.names),
        allowed="a column named time_s, time_min, elapsed, timestamp, ... or of wall-clock stamps",
        do="name it with --time NAME (and --time-unit), or say --interval SECONDS if rows are evenly spaced",
    )


def _convert(table: Table, name: str, clock: str | None, options: Options) -> tuple[Array, set[str], str]:
    column = table.columns[name]
    if isinstance(column, np.ndarray):
        unit = options.time_unit or unit_of(name, table.units.get(name, ""))
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            raise InputError(
                f"{table.name}, line {table.first_line + int(bad[0]) + 1}, column {name!r}: no time in this row",
                found=f"{len(bad)} rows without a time",
                allowed="a number in every row",
                do="mend or remove the rows",
            )
        told = unit or epoch_unit(column) or "s"
        how = "" if unit else " (no unit found: say --time-unit if they are not)"
        return column * UNITS[told], {name}, f"time: {name!r} in {told}{how}"
    cells = column
    if clock is not None:
        second = table.columns[clock]
        assert not isinstance(second, np.ndarray)
        cells = [f"{d} {c}" for d, c in zip(column, second, strict=True)]
    place = f"{table.name}, column {name!r}"
    seconds = stamps_to_seconds(cells, place, table.first_line, options.time_format)
    used = {name} | ({clock} if clock else set())
    return seconds, used, f"time: wall-clock stamps in {' and '.join(repr(u) for u in sorted(used))}"


def _in_order(time: Array, columns: dict[str, Array], name: str) -> tuple[Array, dict[str, Array], list[str]]:
    """Sorted by time, readings of one stamp averaged, time from the first."""
    notes = []
    step = np.diff(time)
    if (step < 0).any():
        order = np.argsort(time, kind="stable")
        notes.append(f"{int((step < 0).sum())} rows out of order were sorted by time")
        time, columns = time[order], {n: c[order] for n, c in columns.items()}
        step = np.diff(time)
    if (step == 0).any():
        edges = np.flatnonzero(np.concatenate([[True], step > 0]))
        notes.append(f"{int((step == 0).sum())} repeated time stamps: readings of one stamp averaged")

        def mean(c: Array) -> Array:
            good = np.isfinite(c)
            count = np.add.reduceat(good.astype(float), edges)
            total = np.add.reduceat(np.where(good, c, 0.0), edges)
            return np.where(count > 0, total / np.maximum(count, 1.0), np.nan)

        time, columns = time[edges], {n: mean(c) for n, c in columns.items()}
    if len(time) < FEWEST_ROWS:
        raise UsageError(f"{name}: all rows carry the same time stamp", do="name another column with --time, or say --interval")
    return time - time[0], columns, notes
