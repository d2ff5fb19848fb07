"""Numbers that are moments: epochs, ticks, serial days of a spreadsheet, dates and clocks without signs or with a point."""

from datetime import datetime, timedelta

import numpy as np

from ..run import Array
from .stamps import DAY_S

#: From when stamps are counted, and the first and last moment that calendars and their zones have, in seconds from there.
BEGIN = datetime(1970, 1, 1)
FIRST_S, LAST_S = ((moment - BEGIN).total_seconds() for moment in (datetime(1, 1, 3), datetime(9999, 12, 29)))
UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": DAY_S}
#: 2000 to 2100 as an epoch in seconds, and as serial days of a spreadsheet.
EPOCH_S, SERIAL_DAYS = (9.466848e8, 4.102448e9), (36526.0, 73051.0)
#: 2000 to 2100 in steps of 100 ns, from 1601 and from the year 1.
TICKS = {"a file time of Windows": (1.2591e17, 1.5747e17), "ticks of .NET": (6.3082e17, 6.6239e17)}

#: Digits of a moment without signs, how they are read, and from where to where such numbers lie: years from 2020 to 2039 of two
#: digits (an epoch in seconds is a moment after 2033 there), of four from 2000 to 2059.
_FORMS = (
    (10, "%y%m%d%H%M", 2.0e9, 4.0e9),
    (12, "%y%m%d%H%M%S", 2.0e11, 4.0e11),
    (12, "%Y%m%d%H%M", 2.0e11, 2.06e11),
    (14, "%d%m%Y%H%M%S", 1.0e12, 3.2e13),
)
#: Share of the steps of a clock that are alike.
MOSTLY_ALIKE = 0.9
#: Forms in words.
SPOKEN = {"%y": "YY", "%Y": "YYYY", "%m": "MM", "%d": "DD", "%H": "hh", "%M": "mm", "%S": "ss"}


def of_archive(column: Array) -> bool:
    """Whether these are the millionths of days that Siemens archives call milliseconds."""
    return bool(np.isfinite(column).all()) and SERIAL_DAYS[0] <= column.min() / 1e6 and column.max() / 1e6 < SERIAL_DAYS[1]


def is_date_number(column: Array | list[str]) -> bool:
    return isinstance(column, np.ndarray) and bool(np.isfinite(column).all() and column.min() >= 1.9e7 and column.max() < 2.2e7)


def are_moments(column: Array) -> bool:
    """Whether the numbers (n,) can be nothing but moments: YYYYMMDDhhmmss from 2000 to 2059, each later than the one before."""
    if not (len(column) > 1 and column.min() >= 2.0e13 and column.max() < 2.06e13 and (np.diff(column) > 0.0).all()):
        return False
    try:
        return all(datetime.strptime(f"{v:.0f}", "%Y%m%d%H%M%S") for v in column.tolist())
    except ValueError:
        return False


def epoch_of(values: Array) -> str | None:
    """Unit in which all numbers are moments between 2000 and 2100: s, ms, us, ns, or None."""
    good = values[np.isfinite(values)]
    if not len(good):
        return None
    for unit in ("s", "ms", "us", "ns"):
        if EPOCH_S[0] <= good.min() * UNITS[unit] and good.max() * UNITS[unit] <= EPOCH_S[1]:
            return unit
    return None


def serial(values: Array) -> bool:
    """Whether the numbers are dates of a spreadsheet: days since 1900 with a fraction."""
    inside = SERIAL_DAYS[0] <= values.min() and values.max() <= SERIAL_DAYS[1]
    return inside and bool((values % 1.0 != 0.0).any()) and float(np.median(np.abs(np.diff(values)))) < 0.5


def ticks_of(column: Array) -> str:
    """What counts in steps of 100 ns, in words; empty where the numbers (n,) are no such moments."""
    return next((what for what, (low, high) in TICKS.items() if low <= column.min() and column.max() <= high), "")


def calendar(seconds: float) -> datetime:
    """The moment so many seconds after the beginning of 1970; of one that no calendar has, the nearest that it has."""
    return BEGIN + timedelta(seconds=min(max(seconds, FIRST_S), LAST_S))


def compact(column: Array) -> tuple[list[str], str] | None:
    """(moments as YYYYMMDDhhmmss, the form in words) of whole numbers (n,) that are moments without signs; None of others."""
    found = []
    for digits, form, low, high in _FORMS:
        if not (low <= column.min() and column.max() < high):
            continue
        try:
            moments = [datetime.strptime(f"{v:0{digits}.0f}", form) for v in column.tolist()]
        except ValueError:
            continue
        if not 2000 <= moments[0].year < 2060:
            continue
        steps = np.diff([(m - moments[0]) / timedelta(seconds=1) for m in moments])
        found.append((float(np.ptp(steps)) if len(steps) else 0.0, form, moments))
    if not found:
        return None
    _, form, moments = min(found, key=lambda one: one[0])
    told = form
    for sign, word in SPOKEN.items():
        told = told.replace(sign, word)
    return [m.strftime("%Y%m%d%H%M%S") for m in moments], told


def clock_with_a_point(column: Array) -> Array | None:
    """Seconds (n,) of a clock whose hours and minutes have a point between them, 07.58 and then 08.00; None of other numbers.

    Nearly all of its steps are alike, which as decimals they are not: without a full hour these are. From nought on it could be
    minutes and seconds as well.
    """
    hours = np.floor(column + 1e-9)
    minutes = np.round(100.0 * (column - hours), 6)
    if not (column.min() >= 0.0 and column.max() < 24.0 and column[0] >= 1.0 and len(column) > 2):
        return None
    if (minutes % 1.0 != 0.0).any() or minutes.max() >= 60.0:
        return None
    seconds = 3600.0 * hours + 60.0 * minutes
    steps = np.diff(seconds)
    turned = np.where(steps < -43200.0, steps + 86400.0, steps)
    alike, of_decimals = (float(np.mean(np.abs(d - np.median(d)) < 1.0)) for d in (turned, 3600.0 * np.diff(column)))
    if not ((turned > 0.0).all() and alike >= MOSTLY_ALIKE and alike > of_decimals):
        return None
    return np.asarray(seconds[0] + np.concatenate([[0.0], np.cumsum(turned)]))
