"""The one module that opens a user's records, and the steps from a table to its runs."""

import hashlib
import re
import stat
import sys
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, UsageError, listed, shown_name
from ..reading_options import Options
from .columns import Roles, classify, length_unit, resistive
from .headings.called import check_names, column_named, resolved
from .long import Layout, find_long, to_wide, without_switches
from .moments.in_turn import each_in_turn
from .moments.order import in_order, length_told, runs_otherwise
from .moments.stamps import two_decimal_signs, two_signs
from .moments.times import Time, find_time, is_time_name, length_of
from .moments.zones import in_zone
from .run import Guess, Run, Seen, SeenColumn, as_asked, renamed, told_of_sensors
from .signs import sign_of
from .table import Table, read_parquet
from .tables.cells import without_told
from .tables.clocks import clocks_of_columns, with_one_clock
from .tables.frames import NAME as IN_MEMORY
from .tables.frames import table_of
from .tables.limits import Limits, refuse_no_path
from .tables.measured import is_measured, measured_table
from .tables.packed import is_workbook, unpacked
from .tables.text import read_text
from .tables.workbook import sheet_text
from .units import parse_unit, unit_changes
from .values.degrees import Temperatures, refuse_another_unit, refuse_words, unit_told, warm_inputs, winding
from .values.faults import unmoved_gap, without_faults, without_impossible
from .values.marks import good_readings
from .values.thousands import with_thousands
from .values.unchanged import as_it_stood
from .vocabulary import UNITS
from .vocabulary import words as words_of
from .wide import read_wide

PARQUET_MAGIC = b"PAR1"
#: Lines above the readings are not counted as rows: not more than these, before they are looked at.
LONGEST_HEAD = 1000
#: Rows of another width, or with a cell that is no reading, that are left out of a growing file: more are another layout.
MOST_CUT, CUT_ROW, BAD_ROW = 20, "is no whole row", "cannot be read"
_BAD_ROW = re.compile(r", line (\d+)(: the row has \d+ cells)?(?(2)|.*: (?:not a number|no time in this row|unreadable time)$)")
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
    return _shown(_table(source, options, name, data))


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
        text, sheet = sheet_text(held.pop(), name, options.sheet, limits)
        found = read_text(text, name, replace(options, delimiter=options.delimiter or ","))
        return replace(found, notes=(f"Excel, sheet {sheet!r}", *found.notes[1:]), dialect=None)
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


def runs_from_table(table: Table, options: Options) -> list[Run]:
    """What each column is, time in order, temperatures in degC: one run, or several where the time begins anew.

    Raises
    ------
    InputError: no time, no sensor, a cell that is no number, or something that cannot be told and must be said.
    UsageError: an option names no column.
    """
    table = with_thousands(without_switches(with_one_clock(table, options)))
    time = find_time(table, replace(options, time=column_named(options.time, table.names)))
    if options.tz is not None:
        time = in_zone(time, options.tz, table.name)
    layout = find_long(table, time, options)
    table = to_wide(table, layout, time) if layout is not None else good_readings(table)
    notes, guesses = [*table.notes, time.note], [*table.guesses, *time.guesses]
    numbers = {n: c for n, c in table.columns.items() if n not in time.used and isinstance(c, np.ndarray)}
    options = resolved(options, table.names, [n for n in numbers if not is_time_name(n)])
    check_names(options.exclude, table.names, "--exclude", table.name)
    windings = resistive(numbers, table.units, options, table.name) if options.resistance else []
    if windings:
        numbers |= {n: winding(numbers[n], n, table, options) for n in windings}
        options = replace(options, units=(*options.units, *(f"{n}=C" for n in windings)))
        notes.append(f"temperatures of windings by their resistance: {listed(windings, 6)}")
    clocks = numbers if layout is None else ()  # of a long table a sensor may be called min
    spare = [n for n in clocks if is_time_name(n) and n not in (*options.channels, *options.inputs, options.ambient)]
    _refuse_other_clock(table, time, spare, options)
    if spare:
        notes.append(f"other columns of time left out: {listed(spare, 6)}")
    named = [n for n in numbers if n not in spare and not (n.startswith("column ") and np.isnan(numbers[n]).all())]
    words = [n for n, c in table.columns.items() if n not in time.used and not isinstance(c, np.ndarray)]
    for n in words:
        if (
            n in table.faults
            and sign_of(n, table.units.get(n, "")).kind == "sensor"
            and n not in options.exclude
            and not options.channels
        ):
            raise table.faults[n]
        if n not in options.exclude and not options.channels:
            refuse_words(table, n)
    for what, who in (("columns of words", [n for n in words if n not in options.exclude]), ("by --exclude", options.exclude)):
        notes += [f"{what} left out: {listed(who, 6)}"] if who else []
    _refuse_taken(options)
    if options.channels:
        check_names(options.channels, [*named, *words], "--channels", table.name)
        if wordy := [c for c in options.channels if c in words]:
            raise InputError(
                f"{table.name}: column {wordy[0]!r} holds words", found=f"as {table.columns[wordy[0]][0]!r}", allowed="numbers"
            )
    units = _with_unit_column(table, named)
    origin = "long" if layout is not None else "header" if table.header else "none"
    roles = classify(named, numbers, units, options, table.name, origin)
    if windings:
        sensors = tuple(n for n in named if n in (*roles.sensors, *windings))
        roles = replace(roles, sensors=sensors, inputs=tuple(n for n in roles.inputs if n not in windings))
    notes += roles.notes
    guesses += roles.guesses
    if not roles.sensors:
        raise _no_sensor(table, words, named)
    for n in (*roles.sensors, *roles.ambient, *roles.inputs):
        if n in table.faults:
            raise table.faults[n]
    own = [u for n in roles.sensors if (u := sign_of(n, units.get(n, "")).unit) is not None and u.temperature]
    if table.unit_above and table.unit_above not in ("C", "K", "F") and not options.units and not own and not options.channels:
        raise _no_sensor(table, [], [f"{n} [{table.unit_above}]" for n in roles.sensors])
    if table.unit_above in ("C", "K", "F") and not options.units and not own:
        options = replace(options, units=(table.unit_above,))
        notes.append(f"temperatures in {table.unit_above}, as a line above the names says")
    used = (*roles.sensors, *roles.ambient, *roles.inputs, *roles.displacements)
    degrees, channel_notes = Temperatures(table, units, options, (*roles.sensors, *roles.ambient)), {}
    columns = {n: numbers[n] for n in used}
    for n in (*roles.sensors, *roles.ambient, *warm_inputs(roles.inputs, units, options, table)):
        columns[n], impossible = without_impossible(degrees.of(n, numbers[n], n in roles.inputs))
        if impossible:
            channel_notes[n] = f"{impossible} overload or impossible reading{'s' if impossible > 1 else ''} left out"
    refuse_another_unit([numbers[n] for n in roles.sensors], table)
    notes += degrees.notes()
    guesses += degrees.guesses()
    notes.append(f"{len(roles.sensors)} sensor{'s' if len(roles.sensors) > 1 else ''} ({listed(roles.sensors, 4)})")
    for what, who in (("surroundings", roles.ambient), ("inputs", roles.inputs), ("displacements", roles.displacements)):
        if who:
            notes.append(f"{what}: {listed(who)}")
    for n in roles.displacements:
        unit = length_unit(n, units.get(n, ""))
        if unit == "mm":
            columns[n] = columns[n] * 1000.0
            notes.append(f"{n}: mm, turned into um")
        elif not unit:
            text = f"{n}: no unit of length, taken for um"
            guesses.append(Guess("unit", text, "write um or mm into its name, or into a line of units"))
    seen = _seen(table, time, layout, roles, units, spare, options)
    if layout is not None:
        time, in_turn = each_in_turn(time, columns)
        guesses += in_turn
    where = table.lines, time.wall, time.dated, layout is not None, table.headers
    stretches = in_order(time.seconds, columns, table.name, *where)
    runs = []
    for k, part in enumerate(stretches):
        name = table.name if len(stretches) == 1 else f"{table.name}#{k + 1}"
        of, faults = without_faults(part.columns, (*roles.sensors, *roles.ambient))
        said = {n: "; ".join(t for t in (channel_notes.get(n, ""), faults.get(n, "")) if t) for n in (*channel_notes, *faults)}
        kinds = (roles.sensors, roles.ambient, roles.inputs, roles.displacements)
        channels, ambient, inputs, displacements = ({n: of[n] for n in who} for who in kinds)
        told = (*guesses, *part.guesses, *unmoved_gap(part.time, list(channels.values())))
        runs.append(Run(name, part.time, channels, ambient, inputs, (*notes, *part.notes), said, displacements, told, seen))
    runs = [as_it_stood(run) for run in runs]
    return [told_of_sensors(renamed(run, options.rename) if options.rename else run) for run in runs]


def _refuse_taken(options: Options) -> None:
    """Raises UsageError for a column that two options name."""
    if options.ambient is not None and options.ambient in options.inputs:
        raise UsageError(f"--ambient and --inputs both name {options.ambient!r}", do="say it in one of them")
    taken = {"--exclude": options.exclude, "--inputs": options.inputs, "--ambient": (options.ambient,)}
    for other, names in taken.items():
        if both := [n for n in options.channels if n in names]:
            raise UsageError(f"--channels and {other} both name {both[0]!r}", do="say it in one of them")


def _seen(
    table: Table, time: Time, layout: Layout | None, roles: Roles, units: dict[str, str], spare: list[str], options: Options
) -> Seen:
    """What each column was taken for, and how the file is laid out."""
    kinds = {"sensors": "sensor", "ambient": "ambient", "inputs": "input", "displacements": "displacement"}
    of = {n: role for kind, role in kinds.items() for n in getattr(roles, kind)} | dict.fromkeys(time.used, "time")
    of |= dict.fromkeys(table.clocks, "time")
    columns = []
    for n in (*table.names, *table.clocks[1:]):
        role = of.get(n, "ignored")
        unit = time.unit if role == "time" else units.get(n, "") or getattr(sign_of(n, "").unit, "symbol", "")
        if role in ("sensor", "ambient", "input"):
            unit = unit_told(n, options, table, by_name=role == "input") or unit
        columns.append(SeenColumn(n, role, unit, _why(n, role, table, roles, spare, options)))
    d = table.dialect if table.dialect is None or not table.dialect.joined else replace(table.dialect, delimiter="", decimal="")
    return Seen(
        len(time.seconds),
        tuple(columns),
        " and ".join(table.clocks or [n for n in table.names if n in time.used]),
        time.unit,
        d.encoding if d else "",
        d.delimiter if d else "",
        d.decimal if d else "",
        None if d is None else 0 if d.header_line is None else d.header_line + 1,
        (*layout.labels, layout.value) if layout is not None else (),
    )


def _why(name: str, role: str, table: Table, roles: Roles, spare: list[str], options: Options) -> str:
    """Why a column is left out."""
    if role != "ignored":
        return ""
    if name in options.exclude:
        return "left out by --exclude"
    if name in spare:
        return "another column of time"
    column = table.columns.get(name)
    if isinstance(column, np.ndarray) and not np.isfinite(column).any():
        return "empty"
    if column is not None and not isinstance(column, np.ndarray):
        return "words" if any(c.strip() for c in column) else "empty"
    if options.channels and name not in options.channels:
        return "not among --channels"
    said = (n.partition(":")[0] for n in roles.notes if name in n)
    return next(said, "neither name nor unit says a temperature")


def _no_sensor(table: Table, words: list[str], named: list[str]) -> InputError:
    for n in words:
        if two := two_signs(table.columns[n]):  # type: ignore[arg-type]
            return two_decimal_signs(f"{table.name}, column {n!r}", two)
    found = [f"{n} ({u})" if (u := table.units.get(n, "")) else n for n in (named or words)]
    return InputError(
        f"{table.name}: no sensor column",
        found=listed(found, 8) or "only a time column",
        allowed="at least one column of temperatures",
        do="name the sensors with --channels, if these are temperatures",
    )


def _with_unit_column(table: Table, named: list[str]) -> dict[str, str]:
    """Units of the columns; a column of words that tells one unit in every row is that of the number beside it."""
    units = dict(table.units)
    for at, (n, cells) in enumerate(table.columns.items()):
        if not (set(words_of(n)) & UNITS) or isinstance(cells, np.ndarray):
            continue
        told = {c.strip() for c in cells if c.strip()}
        order = list(table.columns)
        beside = [order[k] for k in (at - 1, at + 1) if 0 <= k < len(order) and order[k] in named]
        kinds = {unit.symbol for t in told if (unit := parse_unit(t)) is not None and unit.temperature}
        if len(kinds) > 1 and beside:
            raise unit_changes(f"{table.name}, column {n!r}", sorted(told))
        if len(told) == 1 and beside:
            units[beside[0]] = units.get(beside[0]) or told.pop()
    return units


def _refuse_other_clock(table: Table, time: Time, spare: list[str], options: Options) -> None:
    """Raises InputError for a second clock, of the same name or among the readings, that runs otherwise or is of another length."""
    used = next(iter(time.used), "")
    if options.channels and options.time:
        return
    words = [n for n, c in table.columns.items() if n not in time.used and not isinstance(c, np.ndarray) and is_time_name(n)]
    named = of if used in (of := clocks_of_columns(table)) else []
    for n in (*spare, *words, *named):
        if n in options.exclude or n == used:
            continue
        alike = words_of(re.sub(r" \(\d+\)$", "", n)) == words_of(re.sub(r" \(\d+\)$", "", used))
        own, main = table.columns[n], table.columns.get(used, [])
        if isinstance(own, np.ndarray) and isinstance(main, np.ndarray) and np.array_equal(own, main, equal_nan=True):
            continue
        numbers = isinstance(own, np.ndarray) and isinstance(main, np.ndarray)
        if (numbers and (alike or n in named)) or runs_otherwise(table, time, used, n, alike):
            raise InputError(
                f"{table.name}: two clocks, {used!r} and {n!r}, that do not run alike",
                allowed="one time for all columns read together",
                do=f"read the columns of each clock by themselves: --time {n!r} --channels with its columns; or --exclude {n!r} "
                "if it is none of theirs",
            )
        if not options.time and (length := length_told(table, time, n)) is not None:
            told = f"{length_of(float(np.ptp(time.seconds)))} by {used!r}, {length_of(length)} by {n!r}"
            do = f"say which is right: --time {n!r}, or --exclude {n!r}"
            raise InputError(f"{table.name}: two times that disagree about how long the record is", found=told, do=do)


def content_of(source: str, options: Options | None = None, name: str = "") -> tuple[str, bytes]:
    """(hash, bytes) of a file, told of by its name; a pipe, for which one might wait for ever, is none.

    Raises
    ------
    InputError: it cannot be read.
    """
    data = _bytes(_numbered(source)[0], Limits((options or Options()).max_bytes), name, waits=False)
    return hashlib.sha256(data).hexdigest(), data
