"""The clock of a long table, which every sensor in it reads for itself: its rules are those of a table with one row a moment."""

from dataclasses import replace

import numpy as np

from ..run import Array, Guess
from .order import SPREAD, clock_change, half_days, newest_first, restarts, set_back, spread_evenly, unwrapped
from .stamps import DAY_S
from .times import Time


def each_in_turn(time: Time, columns: dict[str, Array]) -> tuple[Time, list[Guess]]:
    """Time of the rows of several sensors (n,), with the clock of each mended as if its rows stood alone; and what was guessed.

    An hour told twice or never, a clock of twelve hours, one past midnight, several readings at one stamp: rows of another sensor
    between them hide all of these. columns hold a reading (n,) in the rows of their sensor, nan in the others.
    """
    seconds = time.seconds.copy()
    guesses: dict[str, Guess] = {}
    daily = time.unit == "stamp" and not time.dated
    for column in columns.values():
        rows = np.flatnonzero(np.isfinite(column))
        if len(rows) < 2:
            continue
        if descends := newest_first(seconds[rows]):
            rows = rows[::-1]
        own = seconds[rows]
        if daily:  # the days that a clock without dates went on by, before the rows of this sensor began
            begins = seconds[0] if not descends else seconds[rows].min()
            own = own - DAY_S * np.round((own[0] - begins) / DAY_S)
        own, halves = half_days(own) if time.dated else (own, None)
        guesses |= {halves.text: halves} if halves else {}
        if time.wall:
            own, changed = clock_change(own, time.wall)
            guesses |= {changed.text: changed} if changed else {}
        step = np.diff(own)
        if (step < 0).any() and not (step <= 0).all() and not restarts(own):
            own, wrapped = unwrapped(own)
            guesses |= {wrapped.text: wrapped} if wrapped else {}
            step = np.diff(own)
        own, back = set_back(own, {"": column[rows]})
        guesses |= {back.text: back} if back else {}
        step = np.diff(own)
        if (step == 0).any() and (step >= 0).all():
            spread = spread_evenly(own, {"": column[rows]}, np.flatnonzero(np.concatenate([[True], step > 0])))
            own = own if spread is None else spread
            guesses |= {} if spread is None else {SPREAD.text: SPREAD}
        seconds[rows] = own
    told = np.isfinite(np.array(list(columns.values()))).any(axis=0)
    if told.any() and not told.all():  # a row that tells nothing has no clock to be mended by
        seconds[~told] = np.clip(seconds[~told], seconds[told].min(), seconds[told].max())
    return replace(time, seconds=seconds), list(guesses.values())
