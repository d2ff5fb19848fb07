"""Columns of wall-clock stamps and of elapsed clocks, to seconds."""

import functools
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..run import Array, Guess
from ..vocabulary import MONTHS
from .clock_texts import LOOKS_SO, as_clock
from .four_parts import HUNDREDTHS, days_to_seconds

DAY_S = 86400.0
#: Lines of statistics or of another table below the readings, at most.
MOST_BELOW = 60
#: A record lasts this long [s] and is read at these intervals [s]: what tells minutes from seconds where nothing else does.
PLAUSIBLE_LENGTH_S = (600.0, 4.0 * DAY_S)
PLAUSIBLE_INTERVAL_S = (0.04, 900.0)
_CELL = re.compile(
    r"(?:[A-Za-z]{2,9}[,.]?\s+)?"  # a day of the week
    r"(?:(?P<a>\d{1,4})(?P<sep>[-/.])(?P<b>\d{1,2})(?P=sep)(?P<c>\d{1,4})\.?|(?P<compact>\d{8})|"
    r"(?P<da>\d{1,2})[-/. ]+(?P<mon>[^\W\d_]{3,9})\.?[-/. ,]+(?P<yr>\d{2,4})|"
    r"(?P<mon2>[^\W\d_]{3,9})\.?[ ]+(?P<da2>\d{1,2}),?[ ]+(?P<yr2>\d{4})|(?P<days>\d+)\s*d(?:ays?)?,?)?"
    r"(?:(?:[\sT_]|(?<=\d)-|,\s*)*(?:(?P<h>\d{1,5}):(?P<m>\d{2})(?::(?P<s>\d{2})(?:[.,:](?P<f>\d{1,9}))?|[.,](?P<fm>\d{1,9}))?|"
    r"(?<=[_T\s-])(?P<clock>\d{6}|\d{4})(?:[.,](?P<fc>\d{1,9}))?)\s*(?P<pm>[AaPp]\.?[Mm]\.?)?)?"
    r"\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?(?:\s*[A-Z]{2,5})?$"
)
_ISO = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d(:\d\d(\.\d{1,9})?)?$")
#: Forms that are written anew before they are read: 2026年3月14日 8时05分00秒, 上午 08:05, 08h05, and Sat Mar 14 08:05:00 CET 2026.
_EAST = re.compile(r"(\d+)[年년]\s*(\d+)[月월]\s*(\d+)[日일]")
_EAST_CLOCK = re.compile(r"(\d+)\s*[时時点點시]\s*(?:(\d+)\s*[分분](?:\s*(\d+(?:\.\d+)?)\s*[秒초])?)?")
_HALF_FIRST = re.compile(
    r"(上午|下午|午前|午後|早上|凌晨|晚上|中午|오전|오후|Ö[ÖS]|[AaPp][Mm](?= *\d))\s*(\d{1,2}):(\d{2}(?::\d{2}(?:\.\d+)?)?)"
)
_HALF_LAST = re.compile(r"(?<=\d) ?([πμ])\.?μ\.?$|(?<=\d) ?(Ö[ÖS])$")
_AFTERNOON = ("下午", "午後", "晚上", "中午", "오후", "PM", "pm", "Pm", "ÖS", "μ")
_PLAIN = re.compile(r"[+-]?\d[\d.,]*$")
_FRENCH_CLOCK = re.compile(r"(?<![:\d])(\d{1,2}) ?h ?(\d{2})(?: ?(?:m|min|mn) ?(?:(\d{2}) ?s?)?)?$")
_YEAR_LAST = re.compile(r"(?:[A-Za-z]{3,9},? )?([A-Za-z]{3}) +(\d{1,2}) (\d{1,2}:\d{2}:\d{2}(?:\.\d+)?) (?:([A-Z]{3,5}) )?(\d{4})$")
_OTHER_FORM = re.compile(
    r"(?i:uhr|hrs)$|[年년时時点點시午오早凌晚]|[πμ]\.?μ|Ö[ÖS]|\d г\.?|^(?:令和|民[國国])"
    r"|\d ?(?i:h(?:rs?|ours?)?),? ?\d|(?i:[ap]m) *\d"
    r"|:\d\d\S* (?:[A-Z]{3,5} )?\d{4}$|(?i:[ap]\.\s?m\.)"
    rf"|{LOOKS_SO}"
    r"|^\d+\. \d|[/-]\d{4} \d\d?\.\d\d$|\.\d\d\.\d\d$|^\d{4}(?:\.\d\d?){2}\. |^\d{1,3}[. ]\d\d?:\d\d:"
)
_FORMAT_IN_NAME = re.compile(r"(?i)\b(h{1,2}:m{2}:s{2}|m{1,2}:s{2}|h{1,2}:m{2})\b")
_ORDER_IN_NAME = re.compile(r"(?i)(y{2,4}[-/. ]m{1,2}[-/. ]d{1,2}|d{1,2}[-/. ]m{1,2}[-/. ]y{2,4}|m{1,2}[-/. ]d{1,2}[-/. ]y{2,4})")
ALLOWED = "2026-05-03 20:38:07, 03.05.2026 20:38:07, 5/3/2026 8:38:07 PM, 20:38:07 or a number with a unit"


@dataclass(frozen=True)
class Stamps:
    """seconds (n,) from the first stamp; starts: moments [s since 1970] that the first row of a wall clock without zone may be.

    dated: the stamps are moments of a calendar, not of an elapsed or daily clock.
    """

    seconds: Array
    starts: tuple[float, ...] = ()
    guess: Guess | None = None
    dated: bool = False


def plain(cell: str) -> str:
    """A stamp of another language's or program's form in one that is known here; other cells as they are."""
    if not cell.isascii():
        cell = re.sub(r"令和(\d{1,2}|元)(?=[年./-])", lambda m: str(2018 + int(m[1].replace("元", "1"))), cell)
        cell = re.sub(r"民[國国](\d{2,3})(?=[年./-])", lambda m: str(1911 + int(m[1])), cell)
        cell = re.sub(r"(?<=\d{4}) ?г\.?(?= |,|$)", "", cell)
        cell = _EAST.sub(r"\1-\2-\3 ", cell)
        cell = _EAST_CLOCK.sub(lambda m: f"{m[1]}:{int(m[2] or 0):02d}" + (f":{m[3]:0>2}" if m[3] else ""), cell)
    # Where the half of the day stands first noon may be its hour 0.
    cell = _HALF_FIRST.sub(lambda m: f"{'12' if int(m[2]) == 0 else m[2]}:{m[3]} {'PM' if m[1] in _AFTERNOON else 'AM'}", cell)
    if not cell.isascii():
        cell = _HALF_LAST.sub(lambda m: f" {'PM' if (m[1] or m[2]) in _AFTERNOON else 'AM'}", cell)
    if not _FRENCH_CLOCK.match(cell) and (clock := as_clock(cell)) is not None:
        return clock
    cell = _FRENCH_CLOCK.sub(lambda m: f"{m[1]}:{m[2]}" + (f":{m[3]}" if m[3] else ""), cell)
    cell = re.sub(r"(?<=\d) ?(?i:uhr|hrs)$", "", cell)
    cell = re.sub(r"(?i)\b([ap])\.\s?m\.", r"\1m", cell)
    cell = re.sub(r"^(\d{1,4})\. (\d{1,2})\. (\d{1,4})\.?(?= |$)", r"\1.\2.\3", cell)
    cell = re.sub(r"^(\d{4})\.(\d{1,2})\.(\d{1,2})\.(?= )", r"\1.\2.\3", cell)
    cell = re.sub(r"(?<=\d) ([01]?\d|2[0-3])\.([0-5]\d)\.([0-5]\d)$", r" \1:\2:\3", cell)
    cell = re.sub(r"(?<=\d[/-]\d{4}) ([01]?\d|2[0-3])\.([0-5]\d)$", r" \1:\2", cell)
    cell = re.sub(r"^(\d{1,3})(?:[. ]|d )(\d{1,2}):(\d{2}:\d{2}(?:\.\d+)?)$", r"\1 d \2:\3", cell)
    return _YEAR_LAST.sub(lambda m: f"{m[2]} {m[1]} {m[5]} {m[3]} {m[4] or ''}", cell).strip()


@functools.lru_cache(maxsize=8192)  # a layout is looked for with each delimiter and each decimal mark
def looks_like_stamp(cell: str) -> bool:
    """Whether a cell is a date, a clock time, or both."""
    cell = cell.strip()
    if re.match(r"[A-Za-z_]\w*:\d", cell):
        return False  # a name with its reading, T1:21.70
    if cell[:1].isalnum() and len(cell) > 3 and _OTHER_FORM.search(cell):
        cell = plain(cell)
    if (
        not cell
        or not cell[0].isalnum()
        or not (":" in cell or re.search(r"\d[-/.]\d{1,2}[-/.]\d|\d{8}[_T ]\d{4}|[A-Za-z]{3}", cell))
    ):
        return False
    found = _CELL.match(cell)
    return bool(found and (found["h"] or found["a"] or found["mon"] or found["mon2"] or (found["compact"] and found["clock"])))


def parse_stamps(cells: Sequence[str], place: str, lines: Sequence[int], name: str = "", time_format: str | None = None) -> Stamps:
    """Seconds from the first stamp; a clock without date goes on past midnight.

    Raises
    ------
    InputError: a stamp that no known form reads, an order of day and month or of minutes and hours that nothing decides.
    """
    in_days = days_to_seconds([c.strip() for c in cells], place, name, time_format) if cells and cells[0].count(":") == 3 else None
    if in_days is not None:
        return Stamps(in_days - in_days[0])
    if time_format and time_format != HUNDREDTHS:
        return _told_format([c.strip() for c in cells], place, lines, time_format)
    if _ISO.match(cells[0]):
        try:
            with warnings.catch_warnings():  # a zone among stamps that have none is for the longer way
                warnings.simplefilter("error")
                whole = np.array(cells, dtype="datetime64[us]")
        except (ValueError, Warning):
            whole = np.array([], dtype="datetime64[us]")
        if len(whole) and not np.isnat(whole).any():
            seconds = (whole - whole[0]).astype(np.float64) / 1e6
            return Stamps(seconds, (float(whole[0].astype(np.int64)) / 1e6,), None, True)
    cells = [c.strip() for c in cells]
    if any(_OTHER_FORM.search(c) for c in (cells[0], cells[-1])):
        cells = [plain(c) for c in cells]
    found = [_CELL.match(c) if c else None for c in cells]
    bad = next((i for i, m in enumerate(found) if m is None or not _holds(m)), None)
    if bad is not None:
        raise _unreadable(cells, bad, place, lines)
    matches = [m for m in found if m is not None]
    clock, invalid = _clock(matches)
    dated = any(matches[0][g] for g in ("a", "compact", "mon", "mon2"))
    if dated:
        return _dated(matches, clock, invalid, cells, place, lines, name)
    return _undated(matches, clock, invalid, cells, place, lines, name)


def _holds(m: re.Match[str]) -> bool:
    return any(m[g] for g in ("a", "compact", "mon", "mon2", "h", "clock"))


def _unreadable(cells: Sequence[str], at: int, place: str, lines: Sequence[int]) -> InputError:
    if two := two_signs(cells):
        return two_decimal_signs(place, two)
    return InputError(
        f"{place}, line {lines[at] + 1}: unreadable time",
        found=repr(cells[at]),
        allowed=ALLOWED,
        do=f"mend the cell or say --time-format, as in '%d.%m.%Y %H:%M:%S'{below(lines, at)}",
    )


def below(lines: Sequence[int], at: int) -> str:
    """What to do besides where the row `at` without a time is near the end of the lines, as the first of a table below them."""
    rest = lines[-1] - lines[at] + 1
    near = at > len(lines) // 2 and rest <= MOST_BELOW
    return f", or --skip-footer {rest} if what begins there is no part of the record" if near else ""


def two_signs(cells: Sequence[str]) -> str:
    """The first cell with a point or comma where all cells are plain numbers, though not by the file's decimal sign; else empty."""
    told = [c for c in cells if c.strip()]
    if not told or not all(_PLAIN.match(c.strip()) for c in told):
        return ""
    return next((c for c in told if "." in c or "," in c), "")


def two_decimal_signs(place: str, cell: str) -> InputError:
    """Numbers of a column with another decimal sign than the rest of the file, or with signs between thousands."""
    clock = re.fullmatch(r"([01]?\d|2[0-3])[.,]([0-5]\d)", cell.strip())
    return InputError(
        f"{place}: numbers written in another way than in the rest of the file",
        found=f"{cell!r}, where '{'.' if ',' in cell else ','}' is the decimal sign elsewhere",
        allowed="one decimal sign in the whole file, and none between thousands",
        do="export the record again so" + (f"; a time of day is {clock[1]}:{clock[2]}" if clock else ""),
    )


def _numbers(matches: Sequence[re.Match[str]], group: str) -> Array:
    return np.array([int(m[group] or 0) for m in matches], dtype=float)


def _fraction(matches: Sequence[re.Match[str]], group: str) -> Array:
    return np.array([float("0." + m[group]) if m[group] else 0.0 for m in matches])


def _clock(matches: Sequence[re.Match[str]]) -> tuple[Array, NDArray[np.bool_]]:
    """Seconds of the day (n,), taking two parts as hours and minutes, and which are no time of day or clock."""
    h, m, s = (_numbers(matches, g) for g in ("h", "m", "s"))
    compact = [(c["clock"] or "").ljust(6, "0") for c in matches]
    if any(c["clock"] for c in matches):
        h, m, s = (h + [int(c[0:2]) for c in compact], m + [int(c[2:4]) for c in compact], s + [int(c[4:6]) for c in compact])
    pm = np.array([(c["pm"] or "").lower()[:1] for c in matches])
    invalid = (m > 59) | (s > 59) | ((pm != "") & ((h < 1) | (h > 12)))
    h = np.where(pm == "", h, h % 12 + 12.0 * (pm == "p"))
    short = np.array([bool(c["fm"]) for c in matches])  # 05:32.5 is minutes and seconds
    seconds = np.where(short, 60.0 * h + m, 3600.0 * h + 60.0 * m + s)
    fractions = _fraction(matches, "f") + _fraction(matches, "fm") + _fraction(matches, "fc")
    return seconds + fractions + DAY_S * _numbers(matches, "days"), invalid


def _offset(matches: Sequence[re.Match[str]]) -> tuple[Array, bool, bool]:
    """Zone offsets (n,) [s], whether all stamps carry a zone, and whether any does."""
    zones = [m["zone"] or "" for m in matches]
    known = {z: _zone_seconds(z) for z in set(zones)}
    return np.array([known[z] for z in zones]), all(zones), any(zones)


def _zone_seconds(zone: str) -> float:
    if not zone or zone in ("Z", "UTC", "GMT"):
        return 0.0
    digits = zone[1:].replace(":", "")
    return (1.0 if zone[0] == "+" else -1.0) * (3600.0 * int(digits[:2]) + 60.0 * int(digits[2:]))


def _days(year: Array, month: Array, day: Array) -> Array | None:
    """Days since 1970 (n,), or None where some are no date."""
    year = np.where(year < 69, year + 2000, np.where(year < 100, year + 1900, year))
    if ((month < 1) | (month > 12) | (day < 1) | (day > 31) | (year < 1900) | (year > 2200)).any():
        return None
    months = (12 * (year - 1970) + month - 1).astype(np.int64)
    first = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    following = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    if (first + day > following).any():
        return None
    return np.asarray(first + day - 1, dtype=float)


def _dated(
    matches: Sequence[re.Match[str]],
    clock: Array,
    invalid: NDArray[np.bool_],
    cells: Sequence[str],
    place: str,
    lines: Sequence[int],
    name: str,
) -> Stamps:
    invalid = invalid | (clock > DAY_S)  # 24:00 is the end of the day that is told (ISO 8601)
    if invalid.any():
        raise _unreadable(cells, int(np.argmax(invalid)), place, lines)
    offset, zoned, some = _offset(matches)
    if some and not zoned:
        bare = next(i for i, m in enumerate(matches) if not m["zone"])
        raise _unreadable(cells, bare, place, lines)
    orders = _orders(matches, name)
    readings = {o: d * DAY_S + clock - offset for o, d in orders.items() if d is not None}
    if not readings:
        raise _unreadable(cells, _first_bad_date(matches, name), place, lines)
    order, guess = _decide(readings, cells, place)
    seconds = readings[order]
    alike = [float(r[0]) for r in readings.values() if np.allclose(r - r[0], seconds - seconds[0])]
    return Stamps(seconds - seconds[0], () if zoned else (float(seconds[0]), *alike), guess, True)


def _orders(matches: Sequence[re.Match[str]], name: str) -> dict[str, Array | None]:
    """Days since 1970 by each order of day, month and year that the form of the stamps allows."""
    first = matches[0]
    if first["compact"]:
        whole = [m["compact"] or "0" * 8 for m in matches]
        parts = [np.array([float(w[a:b]) for w in whole]) for a, b in ((0, 4), (4, 6), (6, 8))]
        return {"ymd": _days(*parts)}
    for month, day, year in (("mon", "da", "yr"), ("mon2", "da2", "yr2")):
        if first[month]:
            told = [(m[month] or "").lower() for m in matches]
            months = np.array([float(MONTHS.get(n[:4]) or MONTHS.get(n[:3], 0)) for n in told])  # juin, juillet
            return {"dmy": _days(_numbers(matches, year), months, _numbers(matches, day))}
    if not first["a"]:
        return {}
    a, b, c = (_numbers(matches, g) for g in "abc")
    ways = {"ymd": (a, b, c), "dmy": (c, b, a), "mdy": (c, a, b)}
    if len(first["a"]) > 2:
        allowed = ["ymd"]
    elif len(first["c"]) > 2:
        allowed = ["dmy", "mdy"]
    else:
        allowed = ["dmy", "mdy", "ymd"]
    said = _ORDER_IN_NAME.search(name)
    if said:
        letters = "".join(dict.fromkeys(ch for ch in said.group(1).lower() if ch in "ymd"))
        allowed = [letters] if letters in allowed else allowed
    return {o: _days(*ways[o]) for o in allowed}


def _first_bad_date(matches: Sequence[re.Match[str]], name: str) -> int:
    for i in range(len(matches)):
        if all(d is None for d in _orders(matches[i : i + 1], name).values()):
            return i
    return 0


def _decide(readings: dict[str, Array], cells: Sequence[str], place: str) -> tuple[str, Guess | None]:
    """The order of day and month: the only valid one, or the one that the steps between the rows prove."""
    forward = {o: r for o, r in readings.items() if not (np.diff(r) < 0).any()} or readings
    first = next(iter(forward))
    relative = {o: r - r[0] for o, r in forward.items()}
    if all(np.allclose(r, relative[first]) for r in relative.values()):
        return first, None
    uneven = {o: unusual_steps(r) for o, r in relative.items()}
    best = min(uneven, key=lambda o: uneven[o])
    rivals = [o for o in uneven if o != best and uneven[o] <= uneven[best] and not np.allclose(relative[o], relative[best])]
    if rivals:
        clock = {0: "", 1: " %H:%M", 2: " %H:%M:%S"}.get(cells[0].count(":"), " %H:%M:%S")
        raise InputError(
            f"{place}: day and month cannot be told apart",
            found=repr(cells[0]),
            allowed="stamps that only one order of day and month reads",
            do=f"say --time-format '%d/%m/%Y{clock}' or '%m/%d/%Y{clock}'",
        )
    words = {"dmy": "day.month.year", "mdy": "month.day.year", "ymd": "year.month.day"}[best]
    return best, Guess(
        "date order", f"{cells[0]!r} read as {words}, the order in which the rows are evenly apart", "--time-format says otherwise"
    )


def unusual_steps(seconds: Array) -> int:
    """How many steps leave the usual one or go back."""
    step = np.diff(seconds)
    usual = float(np.median(step)) if len(step) else 0.0
    return int((np.abs(step - usual) > 0.5 * abs(usual) + 1.0).sum())


def _undated(
    matches: Sequence[re.Match[str]],
    clock: Array,
    invalid: NDArray[np.bool_],
    cells: Sequence[str],
    place: str,
    lines: Sequence[int],
    name: str,
) -> Stamps:
    two_parts = all(m["h"] and m["s"] is None and not m["fm"] and not m["pm"] for m in matches)
    guess: Guess | None = None
    elapsed = any(m["days"] for m in matches)
    if two_parts:
        clock, guess = _two_parts(matches, clock, name, place, cells)
        elapsed = elapsed or "s" in _said(name)
    if invalid.any():
        raise _unreadable(cells, int(np.argmax(invalid)), place, lines)
    if not elapsed and bool(((clock[:-1] == DAY_S) & (np.diff(clock) < -0.5 * DAY_S)).any()) and clock.max() == DAY_S:
        clock = clock % DAY_S  # 24:00, then 00:01: the end of a day
    if elapsed or bool((clock >= DAY_S).any()):
        return Stamps(clock - clock[0], (), guess)
    newest_first = len(clock) > 2 and float((np.diff(clock) < 0).mean()) > 0.5
    clock = clock[::-1] if newest_first else clock
    step = np.diff(clock)
    usual = float(np.median(step[step > 0])) if (step > 0).any() else 0.0
    # Past midnight the clock falls back by a day less a step; a run that begins anew falls back to its start.
    midnight = (step < -0.5 * DAY_S) & (step + DAY_S <= max(20.0 * usual, 3600.0))
    days = np.concatenate([[0.0], np.cumsum(midnight)])
    seconds = clock + DAY_S * days
    seconds = seconds[::-1] if newest_first else seconds
    return Stamps(seconds - seconds[0], (), guess)


def _said(name: str) -> str:
    found = _FORMAT_IN_NAME.search(name)
    return found.group(1).lower() if found else ""


def _two_parts(
    matches: Sequence[re.Match[str]], clock: Array, name: str, place: str, cells: Sequence[str]
) -> tuple[Array, Guess | None]:
    """``12:30`` as hours and minutes, or as minutes and seconds: what the name says, else what only one of them makes possible."""
    said = _said(name)
    if said:
        return (clock / 60.0 if said.startswith("m") else clock), None
    first = _numbers(matches, "h")
    if (first > 47).any():
        return clock / 60.0, Guess("time", f"{cells[0]!r} read as minutes:seconds", "--time-format says otherwise")
    ways = {"hours:minutes": clock, "minutes:seconds": clock / 60.0}
    likely = [w for w, seconds in ways.items() if plausible(seconds)]
    if len(likely) != 1:
        raise InputError(
            f"{place}: hours:minutes and minutes:seconds cannot be told apart",
            found=f"{cells[0]!r} to {cells[-1]!r}",
            allowed="a name as in 'Time (mm:ss)', or clocks with seconds",
            do="say --time-format '%H:%M' or '%M:%S'",
        )
    return ways[likely[0]], Guess(
        "time", f"{cells[0]!r} read as {likely[0]}, the only reading of a likely length", "--time-format says otherwise"
    )


def plausible(seconds: Array, shortest_s: float | None = None) -> bool:
    """Whether the times (n,) [s] are those of a thermal record: its length and its interval are likely ones."""
    step = np.diff(seconds)
    if not len(step):
        return False
    length, interval = float(np.ptp(seconds)), float(np.median(np.abs(step)))
    return (
        (PLAUSIBLE_LENGTH_S[0] if shortest_s is None else shortest_s) <= length * 1.0001
        and length <= PLAUSIBLE_LENGTH_S[1] * 1.0001
        and PLAUSIBLE_INTERVAL_S[0] <= interval <= PLAUSIBLE_INTERVAL_S[1] * 1.0001
    )


def _told_format(cells: Sequence[str], place: str, lines: Sequence[int], time_format: str) -> Stamps:
    """By the user's own format; elapsed clocks may pass 24 hours and 60 minutes."""
    if time_format in ("%M:%S", "%H:%M", "%H:%M:%S"):
        parts = [c.replace(",", ".").split(":") for c in cells]
        try:
            numbers = np.array([[float(v) for v in p] for p in parts])
        except ValueError:
            numbers = np.empty((0, 0))
        if numbers.ndim == 2 and numbers.shape[1] == time_format.count(":") + 1:
            scale = {"%M:%S": [60.0, 1.0], "%H:%M": [3600.0, 60.0], "%H:%M:%S": [3600.0, 60.0, 1.0]}[time_format]
            clock = numbers @ np.array(scale)
            wrapped = np.concatenate([[0.0], np.cumsum(np.diff(clock) < -0.5 * DAY_S)])
            clock = clock + (DAY_S * wrapped if time_format != "%M:%S" else 0.0)
            return Stamps(clock - clock[0])
    seconds = np.empty(len(cells))
    origin: datetime | None = None
    dated = any(d in time_format for d in ("%d", "%j", "%x", "%c", "%D"))
    day, last = 0.0, -1.0
    plain = time_format.replace(".%f", "")
    for i, cell in enumerate(cells):
        try:
            stamp = datetime.strptime(cell, time_format)
        except (ValueError, re.error):
            try:  # 20:38:07 stands between 20:38:06.5 and 20:38:07.5
                stamp = datetime.strptime(cell, plain)
            except (ValueError, re.error):
                raise InputError(
                    f"{place}, line {lines[i] + 1}: unreadable time",
                    found=repr(cell),
                    allowed=f"stamps as --time-format {time_format!r} says",
                    do="mend the cell or the format",
                ) from None
        origin = origin or stamp
        try:
            value = (stamp - origin).total_seconds()
        except TypeError:  # one stamp with a zone, one without
            raise _unreadable(cells, i, place, lines) from None
        if not dated:
            if value + day < last - 0.5 * DAY_S:
                day += DAY_S
            value += day
            last = value
        seconds[i] = value
    assert origin is not None
    wall = dated and origin.tzinfo is None
    return Stamps(seconds, ((origin - datetime(1970, 1, 1)).total_seconds(),) if wall else (), None, dated)
