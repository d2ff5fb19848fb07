"""Clocks of four parts: days, hours, minutes and seconds, or hours, minutes, seconds and hundredths."""

import re
from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ..run import Array

_FOUR = re.compile(r"(\d{1,3}):(\d\d):(\d\d):(\d\d)$")
_IN_DAYS = re.compile(r"(?i)\bd{1,3}:h{1,2}:m{1,2}:s{1,2}\b")
#: What --time-format may say of such clocks.
DAYS, HUNDREDTHS = "dd:hh:mm:ss", "hh:mm:ss:ff"


def days_to_seconds(cells: Sequence[str], place: str, name: str, time_format: str | None) -> Array | None:
    """Seconds (n,) where all cells are days:hours:minutes:seconds; None where they are another clock.

    The column's name or the user may say so, or the last part does, which goes to the next at 60 or at 100.

    Raises
    ------
    InputError: nothing tells days from hundredths.
    """
    if time_format == HUNDREDTHS or not cells or not _FOUR.match(cells[0]):
        return None
    found = [_FOUR.match(cell) for cell in cells]
    if not all(found):
        return None
    parts = np.array([[float(v) for v in m.groups()] for m in found if m])
    days: Array = parts @ np.array([86400.0, 3600.0, 60.0, 1.0])
    if time_format == DAYS or _IN_DAYS.search(name):
        return days
    last = parts[:, 3]
    if (parts[:, 1] > 23).any() or (last > 59).any() or parts[0, :2].any():
        return None
    step = np.diff(last)
    falls, rises = step[step < 0], step[step > 0]
    usual = float(np.median(rises)) if len(rises) else 0.0
    if len(falls) and usual:
        carry = float(np.median(usual - falls))
        return days if abs(carry - 60.0) < abs(carry - 100.0) else None
    raise InputError(
        f"{place}: a clock of four parts",
        found=f"{cells[0]!r} to {cells[-1]!r}: days and seconds, or hundredths of a second",
        allowed=f"one reading of it, as where the name says it: 'Elapsed [{DAYS}]'",
        do=f"say --time-format {DAYS} or {HUNDREDTHS}",
    )
