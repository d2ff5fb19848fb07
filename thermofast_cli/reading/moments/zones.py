"""Stamps of a wall clock in a zone: its summer time taken out."""

import math
from dataclasses import replace
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np

from ...errors import UsageError
from ..run import Array, Guess
from .epochs import calendar
from .stamps import unusual_steps
from .times import Time

CELL_S = 900.0  # zones change their clocks at multiples of this


def in_zone(time: Time, zone: str, name: str) -> Time:
    """Stamps of a wall clock in a zone (``Europe/Berlin``) with its summer time taken out.

    An hour that the clock shows twice is told apart by the order of the rows.

    Raises
    ------
    UsageError: no such zone, or no stamps of a wall clock without zone.
    """
    try:
        clock = ZoneInfo(zone)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        do = "name it as Europe/Berlin or America/New_York"
        raise UsageError(f"--tz: no such zone {zone!r}", allowed="a zone of the IANA data base", do=do) from None
    if not time.wall:
        raise UsageError(f"{name}: --tz is for dates and times that have no zone", found=time.note, do="leave it out")
    # A date that may be read in two orders has two starts; the zone's clock may tell them apart.
    ways = [_moments(clock, start + time.seconds) for start in time.wall]
    real = [way for way in ways if way is not None]
    if not real:
        skipped = calendar(_skipped(clock, time.wall[0] + time.seconds))
        raise UsageError(
            f"{name}: --tz {zone}: a time that its clock never shows",
            found=f"{skipped:%Y-%m-%d %H:%M:%S}, where it was set forward",
            do="leave --tz out: the logger did not change its clock",
        )
    moments, guess = min(real, key=lambda way: unusual_steps(way[0]))
    guesses = [Guess("clock change", guess, "--tz left out, if the logger's clock did not change")] if guess else []
    if len({way[0].tobytes() for way in ((m - m[0], g) for m, g in real)}) > 1:
        guesses.append(Guess("date order", "day and month read so that the clock of the zone runs evenly", "--time-format"))
    seconds = moments - moments[0]
    return replace(time, seconds=seconds, wall=(), note=f"{time.note}, in {zone}", guesses=(*time.guesses, *guesses))


def _moments(clock: ZoneInfo, local: Array) -> tuple[Array, str] | None:
    """(moments [s since 1970], what had to be guessed) of what a zone's clock shows; None where it never shows one of them."""
    if math.isfinite(_skipped(clock, local)):
        return None
    cells, of = np.unique(np.floor(local / CELL_S), return_inverse=True)
    offsets = np.array([[_offset(clock, CELL_S * cell, fold) for cell in cells.tolist()] for fold in (0, 1)])
    first, second = local - offsets[0][of], local - offsets[1][of]
    moments = first.copy()
    twice = np.flatnonzero(second > first)
    back = False
    for i in twice.tolist():  # the hour that comes twice
        if i and first[i] < moments[i - 1] - 1.0:
            moments[i] = second[i]
            back = True
    if not len(twice) or back:
        return moments, ""
    # It is there once: the first time or the second.
    later = first.copy()
    later[twice] = second[twice]
    told = "the hour that the clock shows twice stands there once, taken for the"
    return (later, f"{told} second time") if unusual_steps(later) < unusual_steps(moments) else (moments, f"{told} first time")


def _skipped(clock: ZoneInfo, local: Array) -> float:
    """The first of the times shown that a zone's clock leaves out; inf where it shows all."""
    for cell in np.unique(np.floor(local / CELL_S)).tolist():
        shown = CELL_S * cell
        if _offset(clock, shown, 0) < _offset(clock, shown, 1):  # so python's folds mark what is left out
            return float(local[np.floor(local / CELL_S) == cell][0])
    return math.inf


def _offset(clock: ZoneInfo, local: float, fold: int) -> float:
    """Seconds by which a zone's clock that shows `local` [s since 1970] is ahead of UTC."""
    shown = calendar(local).replace(tzinfo=clock, fold=fold)
    ahead = shown.utcoffset()
    return ahead.total_seconds() if ahead is not None else 0.0
