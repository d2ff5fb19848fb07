"""Rows in the order of time: sorted, split where the time begins anew, clock changes taken out, repeated stamps merged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, UsageError, listed
from ..run import Array, Guess
from ..table import Table
from ..values.time_units import unit_of
from .epochs import UNITS, calendar
from .glitches import without_glitches, without_repeats
from .stamps import looks_like_stamp, parse_stamps, plain
from .time_column import BARE, is_time_name
from .times import Time

FEWEST_ROWS = 2
#: Rows of a stretch from which on a time that falls back is a run that begins anew, not a row out of place.
RUN_ROWS = 5
HOUR_S = 3600.0
#: No record of a machine pauses for so long [s].
YEAR_S = 365.25 * 86400.0
#: Spread of readings at one stamp, in deviations of the readings from stamp to stamp, beyond which they are not one sensor's.
MOST_SPREAD = 8.0

#: A clock is set back this often at most, between so many usual steps on either side.
MOST_SET, SET_AROUND = 4, 4
#: Usual steps of a gap before which names that stand again begin another run.
APPENDED = 20.0
#: Share of the rows in which a clock goes forward.
GOES_ON = 0.9
#: What is told where readings at one stamp are put apart.
SPREAD = Guess("time", "several readings at each stamp, put evenly between it and the next", "log finer stamps to be sure")

#: Times that two lengths of one record differ by at least where one of them is in another unit, or none of this record.
QUITE_ANOTHER = 1.5
#: Readings that tell how a clock runs, and seconds in the units that it may count.
FEWEST_OF_CLOCK, SECONDS_IN = 6, (1e-9, 1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0)


@dataclass(frozen=True)
class Stretch:
    """One run's rows: time [s] ascending from its first reading, and its columns (n,) by name."""

    time: Array
    columns: dict[str, Array]
    notes: tuple[str, ...] = ()
    guesses: tuple[Guess, ...] = ()


#: What clocks fall back by when they are full [s]: an hour, half a day, a day, and counters of 32 and 16 bits in ms and us.
FULL_S = (3600.0, 43200.0, 86400.0, 2**32 / 1e3, 2**32 / 1e6, 2**16 / 1e3, 2.0**16)


def in_order(
    time: Array,
    columns: dict[str, Array],
    name: str,
    lines: Sequence[int],
    starts: tuple[float, ...] = (),
    dated: bool = False,
    mixed: bool = False,
    headers: Sequence[int] = (),
) -> list[Stretch]:
    """The runs that a table holds, mostly one.

    starts are the moments that the first row may have [s since 1970] where time is a wall clock without zone; ``dated``: times are
    moments of a calendar. ``mixed``: rows of several sensors follow each other, so that time may fall back between them. headers
    are the lines at which the names stand again.

    Raises
    ------
    InputError: readings at one stamp that differ by far more than the noise: averaging them would be wrong.
    UsageError: all rows carry one time stamp.
    """
    guesses: list[Guess] = []
    if dated:
        _refuse_reset(time, name, lines)
    if mixed:
        return [_one(time, columns, name, lines, guesses, mixed)]
    turned: tuple[str, ...] = ()
    if newest_first(time):
        time, columns, lines = time[::-1], {n: c[::-1] for n, c in columns.items()}, list(lines)[::-1]
        turned, headers = ("newest first: sorted by time",), ()
    else:
        once, turned = without_repeats(time, columns, lines)
        if turned:
            time, columns, lines = time[once], {n: c[once] for n, c in columns.items()}, np.asarray(lines)[once].tolist()
    found = _runs(time, columns, name, lines, starts, dated, headers, guesses)
    return [replace(one, notes=(*turned, *one.notes)) for one in found]


def newest_first(time: Array) -> bool:
    """Whether rows stand in the reverse order of time: nearly all steps go back."""
    return len(time) > FEWEST_ROWS and float((np.diff(time) <= 0.0).mean()) > GOES_ON and float(np.ptp(time)) > 0.0


def _runs(
    time: Array,
    columns: dict[str, Array],
    name: str,
    lines: Sequence[int],
    starts: tuple[float, ...],
    dated: bool,
    headers: Sequence[int],
    guesses: list[Guess],
) -> list[Stretch]:
    """The runs of rows in the order in which they were written."""
    kept, wrong = without_glitches(time, lines)
    if wrong:
        time, columns, lines = time[kept], {n: c[kept] for n, c in columns.items()}, np.asarray(lines)[kept].tolist()
        guesses += wrong
    time, halves = half_days(time) if dated else (time, None)
    guesses += [halves] if halves else []
    if starts:
        time, changed = clock_change(time, starts)
        guesses += [changed] if changed else []
    full, wrapped = unwrapped(time)
    if wrapped and not dated and _goes_on(columns, np.flatnonzero(np.diff(time) < 0)):
        time, guesses = full, [*guesses, wrapped]
    time, back = set_back(time, columns)
    guesses += [back] if back else []
    begins = sorted({*restarts(time), *_after_headers(time, lines, headers)})
    if not begins and not (np.diff(time) <= 0).all():
        time, wrapped = unwrapped(time)
        guesses += [wrapped] if wrapped else []
        begins = earlier_stretches(time) if not dated else []
    if not begins:
        return [_one(time, columns, name, lines, guesses, False)]
    where = ", ".join(str(lines[i] + 1) for i in begins[:6])
    text = f"the time begins anew at line {where}: {len(begins) + 1} runs, #1 to #{len(begins) + 1}"
    guesses.append(Guess("runs", text, "one file a run is sure"))
    edges = [0, *begins, len(time)]
    return [_one(time[a:b], {n: c[a:b] for n, c in columns.items()}, name, lines[a:b], guesses, False) for a, b in pairwise(edges)]


def _refuse_reset(time: Array, name: str, lines: Sequence[int]) -> None:
    """Raises InputError where the calendar jumps by years between two rows: a logger whose clock was set within the record."""
    jump = np.abs(np.diff(time))
    at = int(np.argmax(jump))
    if jump[at] > YEAR_S and np.delete(jump, at).max(initial=0.0) < YEAR_S:
        raise InputError(
            f"{name}, line {lines[at + 1] + 1}: the time jumps by {jump[at] / YEAR_S:.1f} years",
            found="the clock of the logger was set within the record, or two records stand in one file",
            allowed="moments of one clock",
            do="cut the file there, or say --interval SECONDS if the rows are evenly spaced",
        )


def _one(time: Array, columns: dict[str, Array], name: str, at_lines: Sequence[int], told: list[Guess], mixed: bool) -> Stretch:
    notes: list[str] = []
    guesses = list(told)
    step = np.diff(time)
    lines = np.arange(at_lines.start, at_lines.stop) if isinstance(at_lines, range) else np.asarray(at_lines)
    if (step < 0).any():
        if not mixed:
            backwards = "newest first" if (step <= 0).all() else _rows_back(int((step < 0).sum()))
            notes.append(f"{backwards}: sorted by time")
        order = np.arange(len(time))[::-1] if (step <= 0).all() else np.argsort(time, kind="stable")
        time, columns, lines = time[order], {n: c[order] for n, c in columns.items()}, lines[order]
        step = np.diff(time)
    if (step == 0).any():
        edges = np.flatnonzero(np.concatenate([[True], step > 0]))
        if len(edges) < FEWEST_ROWS:
            raise UsageError(f"{name}: all rows carry the same time stamp", do="name another column with --time, or say --interval")
        merged = {n: _mean(c, edges) for n, c in columns.items()}
        odd = [n for n, c in columns.items() if _differ(c, merged[n], edges)]
        if odd:
            at = int(edges[np.argmax(np.diff(np.append(edges, len(time))) > 1)])
            raise InputError(
                f"{name}: readings at one time stamp differ by far more than their noise",
                found=f"{listed(odd, 3)}, as at lines {lines[at] + 1} and {lines[at + 1] + 1}",
                allowed="one reading of each sensor at a time",
                do="say --long SENSOR,VALUE if a column tells the sensor, or name another column with --time",
            )
        spread = spread_evenly(time, columns, edges) if not mixed else None
        if spread is not None:
            time = spread
            guesses.append(SPREAD)
        else:
            if not mixed:
                again = int((step == 0).sum())
                notes.append(f"{again} repeated time stamp{'s' if again > 1 else ''}: readings of one stamp averaged")
            time, columns = time[edges], merged
    if len(time) < FEWEST_ROWS:
        raise UsageError(f"{name}: all rows carry the same time stamp", do="name another column with --time, or say --interval")
    return Stretch(time - time[0], columns, tuple(notes), tuple(guesses))


def spread_evenly(time: Array, columns: dict[str, Array], edges: NDArray[np.intp]) -> Array | None:
    """Times (n,) [s] put evenly within the stamps where each holds as many different readings; None where they do not."""
    size = np.diff(np.append(edges, len(time)))
    inner = size[1:-1]
    if len(inner) < 3:
        return None
    usual = float(np.median(inner))
    twins = np.flatnonzero(np.diff(time) == 0)
    different = any(bool((np.abs(np.diff(c)[twins]) > 0).any()) for c in columns.values())
    if usual < 2.0 or (np.abs(inner - usual) <= 1).mean() < 0.9 or not different:
        return None
    stamps = time[edges]
    gap = np.append(np.diff(stamps), np.median(np.diff(stamps)))
    place = np.arange(len(time)) - np.repeat(edges, size)
    # The first stamp may have begun before the record did: its readings are the last of it.
    late = np.zeros(len(edges))
    late[0] = max(usual - size[0], 0.0)
    whole = np.maximum(size, usual)
    return np.asarray(np.repeat(stamps, size) + np.repeat(gap / whole, size) * (place + np.repeat(late, size)))


def _mean(column: Array, edges: NDArray[np.intp]) -> Array:
    good = np.isfinite(column)
    count = np.add.reduceat(good.astype(float), edges)
    total = np.add.reduceat(np.where(good, column, 0.0), edges)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1.0), np.nan))


def _differ(column: Array, merged: Array, edges: NDArray[np.intp]) -> bool:
    """Whether the readings of one stamp are too far apart to be one sensor's: against what the means of neighbouring stamps do."""
    size = np.diff(np.append(edges, len(column)))
    high = np.maximum.reduceat(np.where(np.isfinite(column), column, -np.inf), edges)
    low = np.minimum.reduceat(np.where(np.isfinite(column), column, np.inf), edges)
    counted = (size > 1) & np.isfinite(merged)
    if not counted.any():
        return False
    spread = float(np.median((high - low)[counted]))
    if spread <= 0.0:
        return False
    steady = merged[np.isfinite(merged)]
    # What one sensor does from stamp to stamp, its logger's step included.
    moves = np.abs(np.diff(steady))
    values = np.unique(column[np.isfinite(column)])
    quantum = float(np.diff(values).min()) if len(values) > 1 else 0.0
    usual = float(np.median(moves)) if len(moves) else 0.0
    if len(steady) < 4:
        return spread > 1.0
    return spread > MOST_SPREAD * max(usual, quantum if quantum < 0.2 * spread else 0.0, 1e-6 * spread) and spread > 0.05


def restarts(time: Array) -> list[int]:
    """Rows at which the time begins anew, so that what follows overlaps what was before: a second run in one file."""
    back = np.flatnonzero(np.diff(time) < 0) + 1
    if not len(back) or len(back) > max(50, len(time) // (2 * RUN_ROWS)):
        return []
    edges = [0, *back.tolist(), len(time)]
    found: list[int] = []
    begin = 0
    for a, b in pairwise(edges[1:]):
        before, after = time[begin:a], time[a:b]
        if len(before) < RUN_ROWS or len(after) < RUN_ROWS:
            continue
        low, high = after[0], min(float(before.max()), float(after[-1]))
        inside_before = int(((before >= low) & (before <= high)).sum())
        inside_after = int((after <= high).sum())
        if inside_before >= 3 and inside_after >= 3:
            found.append(a)
            begin = a
    return found


def earlier_stretches(time: Array) -> list[int]:
    """Rows at which an elapsed time falls back so far that the whole stretch lies before the one above it: another run."""
    back = np.flatnonzero(np.diff(time) < 0) + 1
    edges = [0, *back.tolist(), len(time)]
    if not len(back) or min(b - a for a, b in pairwise(edges)) < RUN_ROWS:
        return []
    parts = [time[a:b] for a, b in pairwise(edges)]
    return back.tolist() if all(float(after.max()) <= float(before.min()) for before, after in pairwise(parts)) else []


def half_days(time: Array) -> tuple[Array, Guess | None]:
    """Time (n,) [s] of dated stamps whose clock has twelve hours and no AM, and what was done; as it is where none is.

    At midnight such a clock goes from 11:59 to 12:00 of the next day, a day too far, and an hour later back by half a day.
    """
    step = np.diff(time)
    usual = float(np.median(step)) if len(step) else 0.0
    if not usual > 0.0:
        return time, None
    half = 43200.0
    moved = np.where(step > 1.5 * half, -2.0 * half, np.where(step < 0.0, half, 0.0))
    if not (moved < 0.0).any() or not (moved > 0.0).any() or (np.abs(step + moved - usual) > 2.0 * usual)[moved != 0.0].any():
        return time, None
    shift = np.concatenate([[0.0], np.cumsum(moved)])
    return time + shift, Guess("time", "a clock of twelve hours without AM and PM, told by its midnight", "log 24 hours to be sure")


def set_back(time: Array, columns: dict[str, Array]) -> tuple[Array, Guess | None]:
    """Time (n,) [s] without the seconds or minutes by which a clock was set back while it ran on, and what was done.

    The steps before and after are the usual ones and the readings go on: a row out of place is made good by the next step, and a
    second run begins cold.
    """
    step = np.diff(time)
    back = np.flatnonzero(step < 0)
    usual = float(np.median(step)) if len(step) else 0.0
    if not 0 < len(back) <= MOST_SET or usual <= 0.0 or (np.abs(step[back]) > HOUR_S).any() or not _goes_on(columns, back):
        return time, None
    for i in back.tolist():
        near = np.concatenate([step[max(0, i - SET_AROUND) : i], step[i + 1 : i + 1 + SET_AROUND]])
        if len(near) < SET_AROUND or (np.abs(near - usual) > 0.5 * usual).any():
            return time, None
    shift = np.zeros(len(time))
    shift[1:] = np.cumsum(np.where(step < 0, usual - step, 0.0))
    told = listed([f"{usual - step[i]:g} s" for i in back.tolist()], 3)
    return time + shift, Guess("time", f"the clock was set back by {told} while it ran; taken out", "log whole moments to be sure")


def _after_headers(time: Array, lines: Sequence[int], headers: Sequence[int]) -> list[int]:
    """Rows below names that stand again, at which time falls back or leaves a gap: another run, appended to the file."""
    if not headers:
        return []
    step = np.diff(time)
    usual = float(np.median(step)) if len(step) else 0.0
    rows = np.searchsorted(np.asarray(lines), np.asarray(headers, dtype=int))
    inside = [r for r in rows.tolist() if RUN_ROWS <= r <= len(time) - RUN_ROWS]
    return [r for r in inside if step[r - 1] < 0 or step[r - 1] > APPENDED * max(usual, 1.0)]


def _goes_on(columns: dict[str, Array], back: NDArray[np.intp]) -> bool:
    """Whether the readings go on where the clock falls back: a second run would begin anew, cold."""
    with np.errstate(invalid="ignore"):
        for c in columns.values():
            step, span = np.abs(np.diff(c)), np.ptp(c[np.isfinite(c)]) if np.isfinite(c).any() else 0.0
            usual = float(np.median(step[np.isfinite(step)])) if np.isfinite(step).any() else 0.0
            if (step[back] > max(5.0 * usual, 0.05 * span)).any():
                return False
    return True


def unwrapped(time: Array) -> tuple[Array, Guess | None]:
    """Time (n,) [s] of a clock that went on from its start when it was full: minutes of an hour, twelve hours, a counter."""
    step = np.diff(time)
    back = np.flatnonzero(step < 0)
    forward = step[step > 0]
    if not len(back) or not len(forward) or len(back) > 50:
        return time, None
    usual = float(np.median(forward))
    for full in FULL_S:
        if usual < 0.1 * full and (np.abs(step[back] + full - usual) <= 2.0 * usual + 1e-6 * full).all():
            shift = np.zeros(len(time))
            shift[1:] = full * np.cumsum(step < 0)
            text = f"the clock falls back by {full:.6g} s {len(back)} time{'s' if len(back) > 1 else ''}: full, and gone on"
            return time + shift, Guess("time", text, "log whole moments to be sure")
    return time, None


def clock_change(time: Array, starts: tuple[float, ...]) -> tuple[Array, Guess | None]:
    """Time (n,) [s] with the hour taken out by which a wall clock was set back or forward, and what was done.

    Daylight saving: on a Sunday of March, April, September, October or November the clock jumps by an hour between two rows that
    are otherwise evenly apart. starts are the moments that the first row may have [s since 1970]: day and month may be unsure.
    """
    step = np.diff(time)
    if len(step) < 8:
        return time, None
    usual = float(np.median(step))
    if usual <= 0.0 or usual > HOUR_S or (np.abs(step - usual) > 0.2 * usual + 1.0).mean() > 0.2:
        return time, None
    near = 0.3 * usual + 2.0
    shift = np.zeros(len(time))
    words = []
    for i in np.flatnonzero(np.abs(np.abs(step - usual) - HOUR_S) <= near):
        set_back = step[i] < usual
        moments = [calendar(start + float(time[i + 1])) for start in starts]
        likely = [m for m in moments if m.weekday() == 6 and m.month in (3, 4, 9, 10, 11) and 0 <= m.hour <= 4]
        if not set_back and not likely:
            continue  # a gap of an hour on any other day is a gap
        moment = (likely or moments)[0]
        shift[i + 1 :] += HOUR_S if set_back else -HOUR_S
        words.append(f"{moment:%Y-%m-%d %H:%M} ({'set back' if set_back else 'put forward'})")
    if not words:
        return time, _hidden_hour(time, step, starts, usual)
    if len(words) > 4:
        return time, None
    return time + shift, Guess(
        "time", f"the clock was changed by an hour at {listed(words)}; the hour was taken out", "log in UTC to be sure"
    )


def _hidden_hour(time: Array, step: Array, starts: tuple[float, ...], usual: float) -> Guess | None:
    """What to say of a gap that holds all of an hour which no wall clock told: from two to three on a Sunday in March or April."""
    for i in np.flatnonzero(step > max(HOUR_S, 1.5 * usual)).tolist():
        for start in starts:
            before, after = (calendar(start + float(time[k])) for k in (i, i + 1))
            spring = before.date() == after.date() and before.weekday() == 6 and before.month in (3, 4)
            if spring and before.hour < 2 and after.hour >= 3:
                text = (
                    f"a gap from {before:%Y-%m-%d %H:%M} to {after:%H:%M}: where that clock was put forward it is an hour shorter"
                )
                return Guess("time", text, "log in UTC to be sure")
    return None


def runs_otherwise(table: Table, time: Time, used: str, name: str, alike: bool = False) -> bool:
    """Whether a column is the clock of the readings behind it: readings stand before it too, it goes on, and not as the other.

    ``alike``: it has the name of the other, and is a clock wherever it stands.
    """
    names = table.names
    first, at = sorted((names.index(used) if used in names else 0, names.index(name)))
    between, behind = names[first + 1 : at], names[at + 1 : at + 2]
    beside = (any(isinstance(table.columns[n], np.ndarray) and not is_time_name(n) for n in some) for some in (between, behind))
    if not alike and not all(beside):
        return False
    own = table.columns[name]
    clock = alike or not isinstance(own, np.ndarray)  # numbers under another name may be of anything that grows
    if not isinstance(own, np.ndarray):
        # A cell that is no moment, or an hour that is told twice, makes it no less a clock.
        told = [i for i, cell in enumerate(own) if looks_like_stamp(plain(cell))]
        if 2 * len(told) < len(own):
            return False
        try:
            seconds = np.full(len(own), np.nan)
            seconds[told] = parse_stamps([own[i] for i in told], name, told, table.name).seconds
        except InputError:
            return alike
        own = seconds
    known = np.isfinite(own) & np.isfinite(time.seconds)
    forward = np.diff(own[known]) > 0.0
    if known.sum() < FEWEST_OF_CLOCK or not (forward.all() or (clock and forward.mean() >= GOES_ON)):
        return False
    main = time.seconds[known] - time.seconds[known][0]
    if not main[-1] > 0.0:
        return False
    # The same clock in another unit of time, or some seconds late, is no other.
    step = float(np.median(np.diff(main)))
    return all(float(np.abs((own[known] - own[known][0]) * unit - main).max()) > max(step, 0.01 * main[-1]) for unit in SECONDS_IN)


def length_told(table: Table, time: Time, name: str) -> float | None:
    """The record's length [s] by a column that says its unit and goes on as the time does, where it is quite another one.

    None where it is not: hours of operation, say, stand still now and then.
    """
    own, unit = table.columns[name], unit_of(name, table.units.get(name, ""))
    if not isinstance(own, np.ndarray) or unit is None or name.lower() in BARE or len(own) < FEWEST_OF_CLOCK:
        return None
    if not (np.isfinite(own) & np.isfinite(time.seconds)).all() or not (np.diff(own) > 0.0).all():
        return None
    main = time.seconds - time.seconds[0]
    seconds = (own - own[0]) * UNITS[unit]
    if not main[-1] > 0.0 or 1.0 / QUITE_ANOTHER < seconds[-1] / main[-1] < QUITE_ANOTHER:
        return None
    step = float(np.median(np.diff(main)))
    alike = np.abs(seconds * (main[-1] / seconds[-1]) - main).max() <= max(step, 0.01 * main[-1])
    return float(seconds[-1]) if alike else None


def _rows_back(count: int) -> str:
    return f"{count} row{'s' if count > 1 else ''} out of order"
