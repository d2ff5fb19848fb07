"""Moments that are written in several columns of numbers: year, month, day, hour, minute, second; or a clock as 203807."""

import re
from itertools import pairwise

import numpy as np

from ...errors import InputError
from ..run import Array
from ..table import Table
from ..vocabulary import TIME_WORDS
from .stamps import DAY_S, Stamps, looks_like_stamp, parse_stamps

PART_OF = {word: part for part, known in TIME_WORDS.items() for word in known}
#: Least and largest number of each part.
RANGES = {"year": (0, 2100), "month": (1, 12), "day": (1, 31), "hour": (0, 9999), "minute": (0, 59), "second": (0, 60)}
DAY_H = 24
#: Names of a year, of a day of it, and of a clock beside it.
YEARS = ("year", "yyyy")
DAYS_OF_YEAR = ("doy", "day of year", "julian day", "jday", "yearday", "day", "julian")
CLOCKS = ("hhmm", "hour minute", "hourminute", "hrmin", "time")
#: Rows of numbers from which on they can be known to be a clock; clocks of two parts are below, ten o'clock as a number.
FEWEST_OF_CLOCK, SHORT, HOUR_AS_NUMBER = 4, 2400, 10000


def moments_in_parts(table: Table) -> tuple[Stamps, frozenset[str]] | None:
    """Moments of columns that tell an hour, a minute, a second, or a date's parts, and which columns those are.

    Two of hour, minute and second at least, next to each other in size, each within its range, and going on together; else None,
    as where two columns tell the same time in two units.
    """
    found: dict[str, str] = {}
    for name in table.names:
        part = PART_OF.get(name.partition("[")[0].partition("(")[0].strip().lower())
        if part and part not in found and _fits(table.columns[name], part):
            found[part] = name
    clock = [p for p in ("hour", "minute", "second") if p in found]
    if len(clock) < 2 or "minute" not in clock:
        return None
    number = {p: np.asarray(table.columns[n], dtype=float) for p, n in found.items()}
    seconds: Array = sum(number[p] * size for p, size in (("hour", 3600.0), ("minute", 60.0), ("second", 1.0)) if p in clock)  # type: ignore[assignment]
    step = np.diff(seconds)
    if (
        not len(step)
        or (step < 0).sum() > max(1.0, 0.02 * len(step))
        or any(not _goes_on(number, a, b) for a, b in pairwise(clock))
    ):
        return None
    used = frozenset(found[p] for p in clock)
    if "hour" not in clock or number["hour"].max() >= DAY_H:
        return Stamps(seconds - seconds[0]), used
    days, of_days = _dates(table, found, number)
    cells = [
        f"{d} {int(h):02d}:{int(m):02d}:{np.floor(1e3 * s) / 1e3:06.3f}".strip()
        for d, h, m, s in zip(days, number["hour"], number["minute"], number.get("second", np.zeros(len(seconds))), strict=True)
    ]
    try:
        return parse_stamps(cells, f"{table.name}, columns {', '.join(sorted(used))}", table.lines, ""), used | of_days
    except InputError:
        return None


def days_of_year(table: Table) -> tuple[Stamps, frozenset[str]] | None:
    """Moments of a year, a day of it from 1 to 366, and a clock as 1305, as Campbell's older loggers write them; else None."""
    if not any(n.strip().lower() in YEARS for n in table.names):
        return None
    bare = {re.sub(r"[\W_]+", " ", n.lower()).strip(): n for n in table.names}
    found = [next((bare[w] for w in known if w in bare), None) for known in (YEARS, DAYS_OF_YEAR, CLOCKS)]
    if any(n is None or not isinstance(table.columns[n], np.ndarray) for n in found):
        return None
    year, day, clock = (np.asarray(table.columns[str(n)], dtype=float) for n in found)
    whole = all(len(c) and np.isfinite(c).all() and (c % 1.0 == 0.0).all() for c in (year, day, clock))
    if not whole or year.min() < 1990 or year.max() > 2100 or day.min() < 1 or day.max() > 366:
        return None
    if clock.min() < 0 or clock.max() > SHORT or (clock % 100 >= 60).any():
        return None
    days = (year - 1970.0).astype(int).astype("datetime64[Y]").astype("datetime64[D]").astype(float) + day - 1.0
    seconds = DAY_S * days + 3600.0 * (clock // 100) + 60.0 * (clock % 100)
    if not (np.diff(seconds) >= 0.0).all():
        return None
    return Stamps(seconds - seconds[0], (float(seconds[0]),), None, True), frozenset(str(n) for n in found)


def _fits(column: "Array | list[str]", part: str) -> bool:
    """Whether numbers (n,) can be a part of moments: whole, or seconds with a fraction, within its range."""
    if not isinstance(column, np.ndarray) or not column.size or not np.isfinite(column).all():
        return False
    low, high = RANGES[part]
    return bool(low <= column.min() and column.max() <= high and (part == "second" or (column % 1.0 == 0.0).all()))


def _goes_on(number: dict[str, Array], larger: str, smaller: str) -> bool:
    """Whether the larger part changes where the smaller one falls back, and nowhere else; it must have been seen to, or to stay."""
    falls, changes = np.diff(number[smaller]) < 0, np.diff(number[larger]) != 0
    # The larger part stays in a short record, the smaller one where rows are a whole larger one apart.
    stays = not changes.any() or np.ptp(number[smaller]) == 0.0
    return bool(not (falls & ~changes).any() and ((falls & changes).any() or stays))


def _dates(table: Table, found: dict[str, str], number: dict[str, Array]) -> tuple[list[str], frozenset[str]]:
    """The date of each row in words, empty where none is told, and the columns that tell it."""
    rows = len(table.columns[found["minute"]])
    if {"year", "month", "day"} <= found.keys():
        years = number["year"] + np.where(number["year"] < 100, 2000, 0)
        told = [f"{int(y):04d}-{int(m):02d}-{int(d):02d}" for y, m, d in zip(years, number["month"], number["day"], strict=True)]
        return told, frozenset(found[p] for p in ("year", "month", "day"))
    for name, column in table.columns.items():
        if not isinstance(column, np.ndarray) and column and looks_like_stamp(column[0]) and all(":" not in c for c in column):
            return [c.strip() for c in column], frozenset({name})
    return [""] * rows, frozenset()


def clock_written_as_number(column: Array, place: str, in_seconds: bool) -> Array | None:
    """Seconds (n,) of numbers that are a clock without signs, 80530 for 08:05:30; None where they count something.

    in_seconds: the column is said to count seconds, which only a clock of three parts that jumps speaks against.

    Every number must be such a clock, and run more evenly read so than as it stands: from 59 s to a minute it jumps by 41.

    Raises
    ------
    InputError: numbers that are as even either way, or a clock of two parts: 0812 is 08:12:00 or 08 min 12 s.
    """
    if (column % 1.0 != 0.0).any() or column.min() < 0 or column.max() >= 240000 or len(column) < FEWEST_OF_CLOCK:
        return None
    if (column // 100 % 100 >= 60).any() or (column % 100 >= 60).any():
        return None
    short = bool(column.max() < SHORT)
    read = _clock(column)
    step, as_it_stands = np.diff(read), np.diff(column)
    if not (step > 0).all() or np.ptp(step) > np.ptp(as_it_stands):
        return None
    even = np.ptp(as_it_stands) == 0.0
    if (even and (column[0] < HOUR_AS_NUMBER or short)) or (in_seconds and (even or short)):
        return None  # every 100 s from the beginning on
    if even or short:
        first, last = (f"{v:0{4 if short else 6}.0f}" for v in (column[0], column[-1]))
        raise InputError(
            f"{place} may be a clock without signs or count",
            found=f"{first} to {last}",
            allowed="a clock with colons, or a name that says the unit, as 'Time [s]'",
            do=f"say --time-format {'%H%M (or %M%S)' if short else '%H%M%S'}, or --time-unit if it counts",
        )
    found: Array = read - read[0]
    return found


def _clock(column: Array) -> Array:
    """Seconds (n,) of HHMMSS, past midnight too."""
    read: Array = 3600.0 * (column // 10000) + 60.0 * (column // 100 % 100) + column % 100
    return read + DAY_S * np.cumsum(np.concatenate([[0.0], np.diff(read) < -0.5 * DAY_S]))
