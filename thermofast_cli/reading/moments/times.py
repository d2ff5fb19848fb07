"""The time of each row in seconds: of stamps, of numbers elapsed with a unit, epochs, serial days of a spreadsheet."""

import re
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from ...errors import InputError, UsageError, listed
from ...reading_options import Options
from ..headings.called import check_names
from ..run import Array, Guess
from ..table import Table
from ..values.time_units import one_unit_alone, sixtieths, steps_of, unit_of
from ..vocabulary import words
from .clock_texts import padded
from .epochs import UNITS, clock_with_a_point, compact, epoch_of, is_date_number, of_archive, serial, ticks_of
from .parts import SHORT, clock_written_as_number, days_of_year, moments_in_parts
from .stamps import DAY_S, below, looks_like_stamp, parse_stamps, plausible
from .time_column import BARE, first_cell, is_time_name, time_column

FEWEST_ROWS = 2
#: A clock as Italy and Finland write it.
_DOTTED = re.compile(r"([01]?\d|2[0-3])\.[0-5]\d(\.[0-5]\d)?$")
#: Words of a column that tells parts of the second of a stamp.
MILLISECONDS = frozenset(["ms", "millitm", "millisecond", "milliseconds", "msec"])
DATE_DIGITS = 8  # of a date written without signs, 20260131
#: Words of a time that is still to go.
COUNTDOWN = frozenset(["remaining", "countdown", "restzeit", "verbleibend", "restante", "left"])
#: A number from here on is no time in any unit: nanoseconds since 1970 are 2e18.
NO_TIME = 1e30


@dataclass(frozen=True)
class Time:
    """seconds (n,), the columns it was read from, how in words, and what was guessed; wall: starts of a wall clock without zone."""

    seconds: Array
    used: frozenset[str]
    note: str
    guesses: tuple[Guess, ...] = ()
    wall: tuple[float, ...] = ()
    #: Whether the moments are those of a calendar, so that an earlier one was earlier.
    dated: bool = False
    #: Of numbers their unit, else ``stamp``, or ``interval`` where rows are evenly spaced as told.
    unit: str = ""


def find_time(table: Table, options: Options) -> Time:
    """Time of each row.

    Raises
    ------
    InputError: no column is time, a row has none, or its unit cannot be told.
    UsageError: --time names no column.
    """
    rows = len(next(iter(table.columns.values())))
    if rows < FEWEST_ROWS:
        raise InputError(
            f"{table.name}: {rows} row{'' if rows == 1 else 's'} of readings",
            allowed=f"at least {FEWEST_ROWS}",
            do="export more of the record",
        )
    if options.interval_s is not None:
        even: Array = np.arange(rows, dtype=np.float64) * options.interval_s
        named = frozenset(n for n in table.names if is_time_name(n))
        return Time(even, named, f"time: one row every {options.interval_s:g} s, as told", unit="interval")
    if options.time is not None:
        check_names([options.time], table.names, "--time", table.name)
        return _convert(table, options.time, None, options)
    table = _with_colons(table)
    found = time_column(table)
    parts = moments_in_parts(table) or days_of_year(table)
    if parts is not None and (found is None or found[0] in parts[1] or _is_date(table, *found)):
        stamps, used = parts
        note = f"time: moments in {' and '.join(repr(n) for n in table.names if n in used)}"
        return Time(stamps.seconds, used, note, (stamps.guess,) if stamps.guess else (), stamps.starts, stamps.dated, "stamp")
    if found:
        name, clock = found
        return _convert(table, name, clock, options)
    if len(table.names) > 20 * rows:
        raise InputError(
            f"{table.name}: {rows} rows of {len(table.names)} columns, and no time column",
            allowed="a row for each moment, a column for each sensor",
            do="turn the table (rows become columns), then name the time",
        )
    empty = next((n for n in table.names if is_time_name(n) and not _has_value(table.columns[n])), None)
    if empty is not None:
        raise InputError(
            f"{table.name}, column {empty!r}: no value",
            allowed="a time in each row",
            do="export the record again, or say --interval SECONDS if rows are evenly spaced",
        )
    spaced, said = "--interval SECONDS if rows are evenly spaced", ""
    if table.interval_above is not None:
        seconds, line = table.interval_above
        spaced, said = f"--interval {seconds:g} if every row is as far apart as that line says", f"; above them {line!r}"
    raise InputError(
        f"{table.name}: no time column",
        found=listed(table.names) + said,
        allowed="a column named time_s, time_min, elapsed, timestamp, ... or of wall-clock stamps",
        do=f"name it with --time NAME (and --time-unit), say --header-line N if the names stand in another line, or say {spaced}",
    )


def _has_value(column: "Array | list[str]") -> bool:
    """Whether a column of a table holds anything."""
    if isinstance(column, np.ndarray):
        return bool(np.isfinite(column).any())
    return any(cell.strip() for cell in column)


def _with_colons(table: Table) -> Table:
    """The table with 20.38.07 as 20:38:07, where another column holds the dates."""
    texts = {n: c for n, c in table.columns.items() if not isinstance(c, np.ndarray) and c}
    if not any(re.match(r"(\d{4}([-/.])\d{1,2}\2\d{1,2}|\d{1,2}([-/.])\d{1,2}\3\d{4})$", c[0].strip()) for c in texts.values()):
        return table
    clocks = [n for n, c in texts.items() if is_time_name(n) and all(_DOTTED.match(cell.strip()) for cell in c)]
    if not clocks:
        return table
    return replace(table, columns=table.columns | {n: [c.strip().replace(".", ":") for c in texts[n]] for n in clocks})


def _is_date(table: Table, name: str, clock: str | None) -> bool:
    """Whether a column is one of dates, and no clock was found beside it."""
    return clock is None and not isinstance(table.columns[name], np.ndarray) and ":" not in first_cell(table, name)


def _values(table: Table, name: str) -> Array:
    return np.asarray(table.columns[name], dtype=np.float64)


def _convert(table: Table, name: str, clock: str | None, options: Options) -> Time:
    column = table.columns[name]
    if isinstance(column, np.ndarray):
        told = options.time_format or ""
        if clock is None and not (told and ("." in told or (column % 1.0 == 0.0).all())):
            return _numeric(table, name, column, options)
        width = len(datetime(2026, 1, 1).strftime(told)) if clock is None and told else DATE_DIGITS
        behind = width - len(datetime(2026, 1, 1).strftime(told.partition(".")[0])) - 1 if clock is None and "." in told else 0
        column = [f"{v:0{width}.{behind}f}" for v in column]
    cells = column
    if clock is not None:
        second = table.columns[clock]
        assert not isinstance(second, np.ndarray)
        days: list[str] = []
        for cell in column:  # a date is written where it changes
            days.append(cell.strip() or (days[-1] if days else ""))
        cells = [f"{d} {c}" for d, c in zip(days, second, strict=True)]
    halves = _halves_of_day(table)
    if halves and not any(c[-1:].lower() == "m" for c in cells[:3]):
        cells = [f"{c} {h}" for c, h in zip(cells, table.columns[halves], strict=True)]
    label = f"{name} {clock}" if clock else name
    with_zeros = padded(cells)
    cells = with_zeros or cells
    stamps = parse_stamps(cells, f"{table.name}, column {name!r}", table.lines, label, options.time_format)
    used = frozenset({name} | ({clock} if clock else set()) | ({halves} if halves else set()))
    fine = _milliseconds(table, stamps.seconds)
    if fine is not None:
        seconds = stamps.seconds + 1e-3 * (table.columns[fine] - table.columns[fine][0])  # type: ignore[operator]
        stamps, used = replace(stamps, seconds=seconds), used | {fine}
    note = f"time: stamps in {' and '.join(repr(u) for u in sorted(used))}, from {cells[0].strip()!r}"
    note += ", milliseconds written without leading zeros" if with_zeros else ""
    # A clock that the heading calls UTC, or a fixed step from it, is never changed.
    starts = () if re.search(r"\b(UTC|GMT)\b", name) else stamps.starts
    return Time(stamps.seconds, used, note, (stamps.guess,) if stamps.guess else (), starts, stamps.dated, "stamp")


def _milliseconds(table: Table, seconds: Array) -> str | None:
    """A column of milliseconds beside stamps of whole seconds."""
    for n, column in table.columns.items():
        if not isinstance(column, np.ndarray) or not set(words(n)) & MILLISECONDS or (seconds % 1.0 != 0.0).any():
            continue
        if column.size and column.min() >= 0.0 and column.max() < 1000.0 and (column % 1.0 == 0.0).all():
            return n
    return None


def _halves_of_day(table: Table) -> str | None:
    """A column whose cells all are AM or PM."""
    for n, column in table.columns.items():
        if not isinstance(column, np.ndarray) and all(c.strip().upper() in ("AM", "PM") for c in column):
            return n
    return None


def _another_table(table: Table, column: Array, bad: int) -> str:
    """What to do where time begins anew below a row without one: columns may be others there."""
    after = column[bad + 1 :][:1]
    if not bad or not len(after) or not after[0] <= column[bad - 1]:
        return ""
    return f"; or, if another table begins in line {table.lines[bad] + 1}, put it into a file of its own"


def _numeric(table: Table, name: str, column: Array, options: Options) -> Time:
    bad = np.flatnonzero(~(np.abs(column) < NO_TIME))
    if len(bad):
        raise InputError(
            f"{table.name}, line {table.lines[int(bad[0])] + 1}, column {name!r}: no time in this row",
            found=f"{len(bad)} row{'s' if len(bad) > 1 else ''} without a time",
            allowed="a number in every row, up to 1e30",
            do="mend or remove the rows" + below(table.lines, int(bad[0])) + _another_table(table, column, int(bad[0])),
        )
    if options.time_unit and name in table.durations:
        raise UsageError(f"{table.name}: {name!r} holds durations, which say their unit", do="leave --time-unit out")
    if COUNTDOWN.intersection(words(name)) and (np.diff(column) <= 0.0).all():
        counting = _numeric(table, name, column.max() - column, options)
        return replace(counting, note=f"{counting.note}, counted down", dated=False)
    if not options.time_unit and (counted := _counted(name, column, table.units.get(name, ""))) is not None:
        return counted
    if not options.time_unit:
        one_unit_alone(table.name, name, table.units.get(name, ""))
    unit = options.time_unit or unit_of(name, table.units.get(name, ""))
    written = _written_moments(table, name, column) if not options.time_unit else None
    if written is not None:
        return written
    epoch = epoch_of(column)
    if (ticks := ticks_of(column)) and not options.time_unit:
        return Time(1e-7 * (column - column[0]), frozenset({name}), f"time: {name!r}, {ticks}", dated=True, unit="stamp")
    if unit == "s" and not options.time_unit and (clock := _clock_of(table, name, column, True)) is not None:
        return clock
    if unit and not (epoch and not options.time_unit):
        return Time(column * UNITS[unit], frozenset({name}), f"time: {name!r} in {unit}", unit=unit)
    if epoch:
        # 1.7e18 less 1.7e18 has lost its last digits once it is multiplied: take the start away first.
        note = f"time: {name!r}, an epoch in {epoch}"
        return Time((column - column[0]) * UNITS[epoch], frozenset({name}), note, dated=True, unit=epoch)
    if serial(column):
        text = f"{name!r} read as serial days of a spreadsheet (one is {column[0]:.6g})"
        seconds = np.round((column - column[0]) * DAY_S, 3)
        guess = Guess("time", text, "--time-unit says otherwise")
        return Time(seconds, frozenset({name}), f"time: {name!r} in days", (guess,), unit="d")
    if not unit and (pointed := clock_with_a_point(column)) is not None:
        text = f"{name!r} read as a clock of hours and minutes ({column[0]:05.2f})"
        guess = Guess("time", text, "--time-format or --time-unit says otherwise")
        return Time(pointed, frozenset({name}), f"time: {name!r}, a clock with a point", (guess,), unit="stamp")
    return _clock_of(table, name, column, False) or _without_unit(table, name, column)


def _clock_of(table: Table, name: str, column: Array, in_seconds: bool) -> Time | None:
    """Numbers as a clock without signs, 203807, told as a guess.

    Raises
    ------
    InputError: as :func:`clock_written_as_number`.
    """
    clock = clock_written_as_number(column, f"{table.name}: column {name!r}", in_seconds)
    if clock is None:
        return None
    first = f"{column[0]:06.0f}"
    text = f"{name!r} read as a clock without signs ({first} is {first[:2]}:{first[2:4]}:{first[4:]})"
    guess = Guess("time", text, "--time-unit says otherwise")
    return Time(clock, frozenset({name}), f"time: {name!r}, a clock without signs", (guess,), unit="stamp")


def _counted(name: str, column: Array, unit_cell: str = "") -> Time | None:
    """Numbers that count otherwise than in one unit of time: steps, minutes.seconds, the clock of an archive."""
    ones = np.floor(column + 1e-9)
    if words(name) == ["time", "ms"] and of_archive(column):
        seconds, said, guessed = np.round((column - column[0]) * DAY_S / 1e6, 3), "millionths of days, as archives have it", False
    elif step := steps_of(name, unit_cell):
        size, unit = step
        seconds, said, guessed = column * size * UNITS[unit], f"steps of {size:g} {unit}", size != 1.0
    elif parts := sixtieths(name):
        whole, said, sixty = parts
        seconds, guessed, more = whole * column, True, ", with decimals"  # 0.75 is no minute and 75 seconds
        if (column - ones < 0.5999).all():
            seconds, more = whole * ones + whole / 60.0 * np.round(100.0 * (column - ones), 3), f" and {sixty}"
        said += more
    else:
        return None
    guess = (Guess("time", f"{name!r} read in {said}", "--time-unit says otherwise"),) if guessed else ()
    return Time(seconds, frozenset({name}), f"time: {name!r} in {said}", guess, unit="stamp")


def _written_moments(table: Table, name: str, column: Array) -> Time | None:
    """Numbers that are moments written without signs: 20260503203807, or 20260503 beside 203807."""
    if (column % 1.0 != 0.0).any():
        return None
    guesses: tuple[Guess, ...] = ()
    if column.min() >= 1.9e13 and column.max() < 2.2e13:
        cells, used = [f"{v:014.0f}" for v in column], frozenset({name})
    elif (told := compact(column)) is not None:
        cells, used = told[0], frozenset({name})
        guesses = (Guess("time", f"{name!r} read as {told[1]} ({column[0]:.0f})", "--time-format or --time-unit says otherwise"),)
    else:
        date = next((n for n in table.names if n != name and is_time_name(n) and is_date_number(table.columns[n])), None)
        elapsed = unit_of(name, table.units.get(name, "")) is not None  # a column 'min' beside a date counts minutes
        if date is None or elapsed or not is_time_name(name) or column.min() < 0 or column.max() >= 240000:
            return None
        # Beside a date 0812 is twelve minutes past eight, not past midnight.
        size = 100.0 if column.max() < SHORT else 1.0
        cells = [f"{d:08.0f}{size * v:06.0f}" for d, v in zip(table.columns[date], column, strict=True)]
        used = frozenset({name, date})
        if size > 1.0:
            guesses = (Guess("time", f"{name!r} read as hours and minutes ({column[0]:04.0f})", "--time-format says otherwise"),)
    try:
        stamps = parse_stamps([f"{c[:8]} {c[8:]}" for c in cells], f"{table.name}, column {name!r}", table.lines, name)
    except InputError:
        return None
    note = f"time: moments in {' and '.join(map(repr, sorted(used)))}"
    return Time(stamps.seconds, used, note, guesses, stamps.starts, True, "stamp")


#: Seconds that jitter, without a name that says so, may be as few as these.
SHORTEST_S = 120.0


def _without_unit(table: Table, name: str, column: Array) -> Time:
    """Numbers without a unit: another column of time tells it, or only one unit makes a likely record; else the user must."""
    for other in table.names:
        if other == name:
            continue
        known = _same_time(table, other, column)
        if known:
            return Time(column * UNITS[known], frozenset({name}), f"time: {name!r} in {known}, as {other!r} shows", unit=known)
    # Steps that jitter are a program's that waits a second or so: then a few minutes are as likely as as many hours.
    jitters = bool((column % 1.0 != 0.0).any()) and float(np.ptp(np.diff(column))) > 1e-3 * float(np.ptp(column)) / len(column)
    shortest = SHORTEST_S if jitters else None
    likely = [u for u in ("s", "min", "h") if plausible(column * UNITS[u], shortest if u == "s" else None)]
    if float(np.abs(column).max()) < 1.0 and plausible(column * DAY_S):
        likely.append("d")  # as a spreadsheet keeps clocks
    asked = ("s", "min", "h", "d") if "d" in likely else ("s", "min", "h")
    lengths = ", ".join(f"in {u} {length_of(float(np.ptp(column)) * UNITS[u])}" for u in asked)
    if len(likely) != 1:
        raise InputError(
            f"{table.name}: column {name!r} does not say its unit of time",
            found=f"{column[0]:g} to {column[-1]:g}: {lengths}",
            allowed="a name as time_s, time_min, 'Time [h]', or a unit line",
            do=f"say --time-unit us, ms, s, min, h or d{'' if is_time_name(name) else ', or --time with the right column'}",
        )
    unit = likely[0]
    text = f"{name!r} has no unit, taken as {unit}: the record is then {length_of(float(np.ptp(column)) * UNITS[unit])} long"
    guess = Guess("time", text, f"--time-unit {unit} confirms it")
    return Time(column * UNITS[unit], frozenset({name}), f"time: {name!r} in {unit}", (guess,), unit=unit)


def _same_time(table: Table, other: str, column: Array) -> str | None:
    """The unit in which a column of time without unit runs as fast as another that says its own."""
    second = table.columns[other]
    if isinstance(second, np.ndarray):
        unit = unit_of(other, table.units.get(other, "")) if is_time_name(other) and other.lower() not in BARE else None
        scale = UNITS[u] if (u := epoch_of(second) or unit) else None
        if scale is None or not np.isfinite(second).all():
            return None
        seconds = (second - second[0]) * scale
    else:
        if not (second and looks_like_stamp(second[0])):
            return None
        try:
            seconds = parse_stamps(second, "", range(len(second)), other).seconds
        except InputError:
            return None
    span = float(np.ptp(column))
    for unit in ("ms", "s", "min", "h"):
        if (
            span > 0.0
            and float(np.ptp(seconds)) > 0.0
            and np.allclose((column - column[0]) * UNITS[unit], seconds, rtol=0.01, atol=2.0)
        ):
            return unit
    return None


def length_of(seconds: float) -> str:
    """A time [s] in the largest unit that it is two of."""
    for unit, size in (("d", DAY_S), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"
