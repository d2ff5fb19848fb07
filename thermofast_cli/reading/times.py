"""Time columns: elapsed numbers with a unit, or wall-clock stamps, to seconds from the first reading."""

import re
from collections.abc import Sequence
from datetime import datetime
from functools import lru_cache

import numpy as np

from ..errors import InputError
from .run import Array

UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
_UNIT_WORDS = {
    "us": ("us", "µs", "μs", "microseconds"),
    "ms": ("ms", "msec", "millis", "milliseconds"),
    "s": ("s", "sec", "secs", "second", "seconds", "sek", "sekunden"),
    "min": ("min", "mins", "minute", "minutes", "minuten"),
    "h": ("h", "hr", "hrs", "hour", "hours", "std", "stunden"),
    "d": ("d", "day", "days", "tage"),
}
TIME_WORDS = frozenset(
    [
        "time",
        "times",
        "timestamp",
        "timestamps",
        "datetime",
        "date",
        "elapsed",
        "clock",
        "zeit",
        "uhrzeit",
        "datum",
        "zeitstempel",
        "stamp",
        "时间",
        "日期",
    ]
)
#: Names that mean time only when they are the whole name: T_min may be the least of a temperature.
TIME_NAMES = frozenset(["t", "s", "sec", "seconds", "min", "minutes", "h", "hours", "x_value"])
_DATES = (
    "%Y-%m-%d",
    "%Y/%m/%d",
    "%Y.%m.%d",
    "%d.%m.%Y",
    "%d.%m.%y",
    "%d/%m/%Y",
    "%m/%d/%Y",
    "%d-%m-%Y",
    "%m-%d-%Y",
    "%d/%m/%y",
    "%m/%d/%y",
)
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p", "%I:%M:%S.%f %p")


def words(name: str) -> list[str]:
    """Lower-case words of a column name; digits at the end of a word are not part of it."""
    return _words(name.rstrip("0123456789"))


@lru_cache(maxsize=4096)
def _words(name: str) -> list[str]:
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return [w for w in (re.sub(r"\d+$", "", part) for part in re.split(r"[\W_]+", spaced.lower())) if w]


def unit_of(name: str, unit_cell: str = "") -> str | None:
    """Unit that a time column's name, or its cell in the unit line, tells: ``time_min`` -> ``min``."""
    for word in [w.strip("[]() ") for w in (unit_cell.lower(),)] + words(name)[::-1]:
        for unit, known in _UNIT_WORDS.items():
            if word in known:
                return unit
    return None


def is_time_name(name: str) -> bool:
    whole = re.sub(r"[\[(].*", "", name).strip()
    if name[-1:].isdigit():
        return any(w in TIME_WORDS for w in words(name))
    if re.fullmatch(r"t_(us|ms|s|sec|min|h)", name):
        return True
    return any(w in TIME_WORDS for w in words(name)) or whole in TIME_NAMES or whole.lower() in TIME_NAMES - {"t", "h", "s"}


def stamps_to_seconds(cells: Sequence[str], place: str, first_line: int, time_format: str | None = None) -> Array:
    """Seconds (n,) from the first stamp; a clock without date goes on past midnight.

    Raises
    ------
    InputError: a stamp that no known format reads, or a date that two formats read differently.
    """
    cells = [c.strip() for c in cells]
    formats = [time_format] if time_format else _formats(cells[0])
    readings: list[Array] = []
    failed: tuple[int, str] = (0, cells[0])
    for fmt in formats:
        seconds, bad = _parse(cells, fmt)
        if seconds is not None:
            readings.append(seconds)
        elif bad >= failed[0]:
            failed = (bad, cells[bad])
    if not readings:
        raise InputError(
            f"{place}, line {first_line + failed[0] + 1}: unreadable time",
            found=repr(failed[1]),
            allowed="2026-05-03 20:38:07, 03.05.2026 20:38:07, 5/3/2026 8:38:07 PM, 20:38:07 or a number with a unit",
            do="mend the cell or say --time-format, as in '%d.%m.%Y %H:%M:%S'",
        )
    forward = [r for r in readings if not (np.diff(r) < 0).any()] or readings
    shortest = min(forward, key=lambda r: float(np.ptp(r)))
    others = [r for r in forward if not np.allclose(r, shortest)]
    if any(np.ptp(r) < 10 * np.ptp(shortest) for r in others):
        raise InputError(
            f"{place}: day and month cannot be told apart",
            found=repr(cells[0]),
            allowed="stamps that only one order of day and month reads",
            do="say --time-format '%d/%m/%Y %H:%M:%S' or '%m/%d/%Y %H:%M:%S'",
        )
    return shortest


def _formats(sample: str) -> list[str]:
    sample = sample.replace("T", " ", 1)
    if " " not in sample and ":" in sample:
        return list(_CLOCKS)
    dates = [f"{d} {c}" for d in _DATES for c in _CLOCKS] + list(_DATES) + list(_CLOCKS)
    return ["iso", *dates]


def _parse(cells: Sequence[str], fmt: str) -> tuple[Array | None, int]:
    seconds = np.empty(len(cells))
    origin: datetime | None = None
    day, last = 0.0, -1.0
    # A blink without fraction in a column with fractions is common: 20:38:07 between 20:38:07.5 and 20:38:08.5.
    plain = fmt.replace(".%f", "") if ".%f" in fmt else None
    for i, cell in enumerate(cells):
        text = cell.replace(",", ".")
        try:
            stamp = datetime.fromisoformat(text) if fmt == "iso" else datetime.strptime(text, fmt)
        except (ValueError, re.error):
            try:
                stamp = datetime.strptime(text.replace("T", " ", 1), plain or fmt)
            except (ValueError, re.error):
                return None, i
        if origin is None:
            origin = stamp
        try:
            value = (stamp - origin).total_seconds()
        except TypeError:  # one stamp with a zone, one without
            return None, i
        if "%d" not in fmt and fmt != "iso":
            if value + day < last - 43200:
                day += 86400.0
            value += day
            last = value
        seconds[i] = value
    return seconds, -1


def epoch_unit(values: Array) -> str | None:
    """Unit of numbers too large for elapsed seconds: an epoch in ms, us or ns, or None."""
    largest = float(np.abs(values).max())
    return "us" if largest > 1e14 else "ms" if largest > 1e11 else None
