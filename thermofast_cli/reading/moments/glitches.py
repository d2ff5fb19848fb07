"""Rows to leave out: whose clock was wrong for a moment (a stamp years away, or an hour ahead, between rows that go on evenly), and
those written twice, as where two exports overlap.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import listed, rounded
from ..run import Array, Guess
from .stamps import DAY_S

#: Rows in turn that a glitch may last, and glitches of a record: more are another layout.
MOST_ROWS, MOST_GLITCHES = 3, 20
#: Usual steps by which the rows around may be apart, for each that they would be; and how near they must be to it where the place
#: of the rows between is to be empty.
LOOSE, NEAR = 3.0, 0.5
#: Usual steps from its place, and from all of the record, from which on a moment is a wrong one.
OFF_PLACE, FAR = 2.5, 10.0
#: Rows that stand again, all alike, from which on it is no chance.
FEWEST_REPEATED = 2
#: Share of the steps that are the usual one in a record read evenly.
EVEN = 0.9


def without_repeats(time: Array, columns: dict[str, Array], lines: Sequence[int]) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Rows to keep (k,) of times (n,) [s] and columns (n,) as written, and a note on the others.

    Where the time falls back to that of a row before, and the rows from there on say again, in every column, what stood between,
    they are those rows again. A run that begins anew reads otherwise, or is all of it.
    """
    keep, told = np.ones(len(time), dtype=bool), []
    begins = np.flatnonzero(np.diff(time) < 0.0) + 1
    for at in begins.tolist() if len(begins) <= MOST_GLITCHES else []:
        ahead = time[:at][::-1] >= time[at]
        count = at if ahead.all() else int(ahead.argmin())
        before, again = slice(at - count, at), slice(at, at + count)
        if not FEWEST_REPEATED <= count < at or at + count > len(time):
            continue
        moves = any(len(np.unique(c[before][np.isfinite(c[before])])) > 1 for c in columns.values())
        if moves and all(np.array_equal(v[before], v[again], equal_nan=True) for v in (time, *columns.values())):
            keep[again] = False
            told.append(f"{lines[at] + 1} to {lines[at + count - 1] + 1}")
    return np.flatnonzero(keep), ((f"rows written twice left out: lines {listed(told, 3)}",) if told else ())


def without_glitches(time: Array, lines: Sequence[int]) -> tuple[NDArray[np.intp], list[Guess]]:
    """Rows to keep (k,) of times (n,) [s] as written, and what to say of the others.

    A row that came late leaves a gap where it belongs and none where it stands. One whose stamp is wrong has it the other way
    round, or lies outside of all the record.
    """
    every = np.arange(len(time))
    step = np.diff(time)
    back = np.flatnonzero(step < 0.0)
    forward = step[step > 0.0]
    if not 0 < len(back) <= 2 * MOST_GLITCHES or not len(forward):
        return every, []
    usual = float(np.median(forward))
    even = float((np.abs(forward - usual) <= NEAR * usual).mean()) > EVEN
    empty, between = np.zeros(len(time), dtype=bool), np.zeros(len(time), dtype=bool)
    for first, last in _groups(back.tolist(), len(time)):
        whole, count = float(time[last + 1] - time[first - 1]), last - first + 2
        away = np.minimum(np.abs(time[first : last + 1] - time[first - 1]), np.abs(time[first : last + 1] - time[last + 1]))
        if not 0.0 < whole <= LOOSE * count * usual or (away <= OFF_PLACE * usual).any():
            continue
        between[first : last + 1] = True
        empty[first : last + 1] |= even and abs(whole - count * usual) <= NEAR * usual
    if not between.any() or between.all():
        return every, []
    rest = np.sort(time[~between])
    after = np.searchsorted(rest, time).clip(1, len(rest) - 1)
    filled = (rest[0] < time) & (time < rest[-1]) & (rest[after] - rest[after - 1] < (1.0 + NEAR) * usual)
    far = (time < rest[0] - FAR * usual) | (time > rest[-1] + FAR * usual)
    wrong = between & (far | (empty & filled))
    if not wrong.any() or (np.diff(time[~wrong]) < 0.0).sum() >= len(back):
        return every, []
    at = np.flatnonzero(wrong)
    where = listed([str(lines[k] + 1) for k in at.tolist()], 4)
    off = float(np.abs(time[at] - np.interp(at, every[~wrong], time[~wrong])).max())
    text = f"the clock was wrong for a moment, by up to {_told(off)}, in line{'s' if len(at) > 1 else ''} {where}: left out"
    return every[~wrong], [Guess("time", text, "mend the stamps to be sure")]


def _groups(back: list[int], rows: int) -> Iterator[tuple[int, int]]:
    """First and last rows of what may be wrong about each step back: what stands before it, ahead, or behind it, late."""
    for i in back:
        for m in range(MOST_ROWS):
            if i - m > 0:
                yield i - m, i
            if i + m + 2 < rows:
                yield i + 1, i + 1 + m


def _told(seconds: float) -> str:
    """A time in the unit in which one says it."""
    for unit, size in (("years", 365.25 * DAY_S), ("days", DAY_S), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{rounded(seconds / size, 2)} {unit}"
    return f"{rounded(seconds, 2)} s"
