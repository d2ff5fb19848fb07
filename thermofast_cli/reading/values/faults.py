"""Readings that are the logger's and not the machine's: overloads, codes of broken probes, false first readings, held values."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..run import Array, Guess

HOTTEST_C = 5000.0
COLDEST_C = -273.15
#: What probes and their inputs write where they are broken: DS18B20, sixteen bits of tenths and hundredths, all nines.
FAULTS_C = (-127.0, 3276.7, 3276.8, 655.35, 999.9, 999.99, -99.9, -99.99)
#: The same, that may be temperatures too and are none where the readings jump to and from them: a range's end (Pt100, types K, T,
#: S and B), a display with all segments on, no reading, a DS18B20 that was just switched on.
CODES_C = (
    *(-270.0, -250.0, -246.0, -242.02, -242.0, -200.0, 0.0, 85.0, 327.67, 409.5, 850.0, 888.8, 888.88),
    *(1300.0, 1370.0, 1372.0, 1767.6, 1768.0, 1820.0, 1999.0, 2320.0),
)
#: Those of them so far above all machines that a reading near them is one.
CODES_ABOVE_C = tuple(c for c in CODES_C if c >= 1300.0)
#: A jump is larger than so many times the three steps beyond it, and than the median of all; and than so much [K].
BEYOND_NEXT, BEYOND_USUAL, BEYOND_C = 5.0, 20.0, 2.0
#: A number that stands there twice is a code where it is farther from all others than so many times what those cover, and so much
#: [K] more; of so many readings at least. So many of them tell whether it is worth to look.
FAR, FAR_C, FEWEST, FEW = 1.0, 10.0, 12, 7
#: One from readings that are no code is larger than so many times any but two of the steps that follow, and than what they cover.
BEYOND_ANY, BEYOND_RANGE = 10.0, 3.0
#: At most so many first readings are false, told by so many after them.
MOST_FALSE, AFTER = 3, 20
#: The jump from false readings is so many times any step among them: a probe that is put somewhere else goes there step by step.
ONE_JUMP = 2.0
#: Of steps after a first jump this share lies in the first three where the machine itself is fast.
FALLS_OFF = 0.5
#: A value is held where so many runs of equal readings, as long as each other (this share of them), follow each other, of so many
#: readings at least; and go by more than one step of the logger (this share of them): a slow rise in coarse steps does not.
HELD_RUNS, HELD_ALIKE, HELD_LEAST, HELD_STEPS = 8, 0.9, 3, 0.5
#: A gap in which a clock may have been set is so many steps long, with so many readings on either side; what should have moved in
#: it by so many times its noise stood still where it moved by less than this share of that.
GAP_STEPS, BESIDE_GAP, GAP_NOISE, STOOD = 20.0, 20, 10.0, 0.1


def without_impossible(values: Array) -> tuple[Array, int]:
    """Overload values (9.9E+37), codes of broken probes and what is below absolute zero become nan; and how many there were."""
    low, high = np.fmin.reduce(values, initial=np.inf), np.fmax.reduce(values, initial=-np.inf)
    # Of nearly all columns the ends say that there is none.
    some = [v for v in values[:: max(len(values) // FEW, 1)].tolist() if math.isfinite(v)]
    near = FAR * (max(some) - min(some)) + FAR_C if len(some) > 2 else 0.0
    far = len(some) > 2 and (high > max(some) + near or low < min(some) - near)
    if not far and low > 0.0 and high < min(c for c in CODES_C if c > 0.0):
        return values, 0
    with np.errstate(invalid="ignore", over="ignore"):
        bad = (values <= COLDEST_C) | (values > HOTTEST_C) | np.isin(np.round(values, 6), FAULTS_C)
    bad |= _codes(np.where(bad, np.nan, values))
    bad |= _same_far_away(np.where(bad, np.nan, values))
    if not bad.any():
        return values, 0
    return np.where(bad, np.nan, values), int(bad.sum())


def _codes(values: Array) -> NDArray[np.bool_]:
    """Readings (n,) that are one of CODES_C and from which, on each side that there is, the readings jump."""
    found = np.zeros(len(values), dtype=bool)
    at = np.flatnonzero(np.isfinite(values))
    reading = values[at]
    with np.errstate(over="ignore"):
        coded = np.isin(np.round(reading, 6), CODES_C)  # readings in K are an ulp off
    for code in CODES_ABOVE_C:  # and those in degF were rounded
        coded |= np.abs(reading - code) < 0.3
    if not coded.any() or coded.all():
        return found
    plain, place = reading[~coded], np.cumsum(~coded)
    steps = np.abs(np.diff(plain))
    usual = float(np.median(steps)) if len(steps) else 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[0], coded.astype(int), [0]])))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        at_first = int(place[first])  # of readings that are no codes: a loose probe comes and goes
        before, after = plain[max(0, at_first - 4) : at_first][::-1], plain[at_first : at_first + 4]
        sides = [(reading[first], before), (reading[end - 1], after)]
        found[at[first:end]] = all(_jumps(float(edge), beyond, usual) for edge, beyond in sides if len(beyond))
    return found


def _same_far_away(values: Array) -> NDArray[np.bool_]:
    """Readings (n,) that are one and the same number, twice at least, far outside all others: what the logger has for none."""
    found = np.zeros(len(values), dtype=bool)
    at = np.flatnonzero(np.isfinite(values))
    if len(at) < FEWEST:
        return found
    reading = values[at]
    ordered = np.sort(reading)
    gaps = np.diff(ordered)
    for code, rest in ((ordered[-1], reading[reading < ordered[-1]]), (ordered[0], reading[reading > ordered[0]])):
        alike = reading == code
        if not 0 < len(rest) < len(reading):
            continue
        gap = float(gaps[len(rest) - 1] if code == ordered[-1] else gaps[int(alike.sum()) - 1])
        other = np.flatnonzero(~alike)
        between = alike.sum() > 1 and len(other) > 0 and alike[other[0] : other[-1]].any()  # not only before or after all others
        if between and len(rest) > len(reading) // 2 and gap > FAR * float(np.ptp(rest)) + FAR_C:
            found[at[alike]] = True
    return found


def _jumps(edge: float, beyond: Array, usual: float) -> bool:
    """Whether the readings beyond an edge, the nearest first, lie across a jump from it."""
    near = float(np.abs(np.diff(beyond)).max()) if len(beyond) > 1 else 0.0
    return abs(edge - float(beyond[0])) > max(BEYOND_NEXT * near, BEYOND_USUAL * usual, BEYOND_C)


def false_first(columns: Sequence[Array]) -> NDArray[np.intp]:
    """How many of the first readings of each column (n,), in order of time, are not the machine's: (S,), mostly 0.

    The readings jump away from them, more than in any of the steps that follow, and then go back towards them; or go on slowly,
    over less than the jump. A fast machine slows down step by step, and one that settles at once has nothing that follows.
    """
    found = np.zeros(len(columns), dtype=np.intp)
    width = 1 + MOST_FALSE + AFTER
    whole = [i for i, c in enumerate(columns) if len(c) >= width]
    if whole:
        begin = np.empty((len(whole), width))
        for row, i in enumerate(whole):  # not np.stack: of ten thousand columns it makes three objects each
            begin[row] = columns[i][:width]
        first = np.abs(np.diff(begin))
        # Where a reading is missing the column is looked at by itself.
        odd = ~(first[:, :MOST_FALSE].max(axis=1) <= BEYOND_ANY * np.median(first[:, MOST_FALSE:], axis=1))
        for i in np.asarray(whole)[odd].tolist():
            found[i] = _false_first(columns[i])
    return found


def _false_first(column: Array) -> int:
    at = np.flatnonzero(np.isfinite(column))
    reading = column[at]
    if len(reading) <= MOST_FALSE + AFTER:
        return 0
    for k in range(1, MOST_FALSE + 1):
        after = reading[k : k + AFTER + 1]
        steps = np.sort(np.abs(np.diff(after)))
        usual = float(steps[-3])  # an outlier makes two large steps
        jump, moved = float(reading[k] - reading[k - 1]), float(np.median(after[-3:]) - after[0])
        among = float(np.abs(np.diff(reading[:k])).max(initial=0.0))
        if abs(jump) <= max(BEYOND_ANY * usual, ONE_JUMP * among, BEYOND_C) or abs(moved) <= 2.0 * usual:
            continue
        if jump * moved < 0.0:
            covered, falls_off = BEYOND_RANGE * float(np.ptp(after)), False
        else:
            covered, falls_off = (
                float(np.ptp(np.percentile(reading[k:], (1, 99)))),
                abs(after[3] - after[0]) > FALLS_OFF * abs(moved),
            )
        if abs(jump) > covered and not falls_off:
            return int(at[k])
    return 0


def held(columns: Sequence[Array]) -> list[int]:
    """For how many readings each column (n,), in order of time, holds a value until the next is taken; 1 of nearly all."""
    found = [1] * len(columns)
    for i, column in enumerate(columns):
        middle = column[len(column) // 3 :][: 4 * HELD_LEAST].tolist()
        if sum(a == b for a, b in pairwise(middle)) > len(middle) // 2:
            found[i] = _held(column)
    return found


def _held(column: Array) -> int:
    reading = column[np.isfinite(column)]
    edges = np.flatnonzero(np.diff(reading)) + 1
    lengths, jumps = np.diff(edges), np.abs(np.diff(reading))[edges - 1]
    if len(lengths) < HELD_RUNS:
        return 1
    usual = int(np.median(lengths))
    alike = np.abs(lengths - usual * np.maximum(np.rint(lengths / max(usual, 1)), 1.0)) <= 1  # two values in a row may be the same
    enough = usual >= HELD_LEAST and alike.mean() >= HELD_ALIKE and (lengths < 1.5 * usual).mean() >= HELD_ALIKE
    return usual if enough and (jumps > 1.5 * jumps.min()).mean() >= HELD_STEPS else 1


def _taken(column: Array, length: int) -> NDArray[np.bool_]:
    """The readings (n,) of a column that holds each for `length` readings, at which a new one is taken."""
    at = np.flatnonzero(np.isfinite(column))
    edges = np.flatnonzero(np.diff(column[at])) + 1
    first = np.zeros(len(column), dtype=bool)
    first[at[edges if edges[0] < length else np.append(0, edges)]] = True
    return first


def unmoved_gap(time: Array, columns: Sequence[Array]) -> list[Guess]:
    """A guess where a clock leaps ahead of readings that go on as if it had not: time (n,) [s], columns (n,) in its order.

    Looked at is the longest gap, of GAP_STEPS steps at least. All sensors that by their slope before it should have moved, by
    GAP_NOISE times their noise, stood still in it and go on as fast as before.
    """
    if len(time) < 2 * BESIDE_GAP + 1:
        return []
    steps = np.diff(time)
    at = int(np.argmax(steps)) + 1
    gap, usual = float(steps[at - 1]), float(np.median(steps))
    if gap < GAP_STEPS * usual or not BESIDE_GAP <= at <= len(time) - BESIDE_GAP:
        return []
    stood = []
    for column in columns:
        before, after = column[at - BESIDE_GAP : at], column[at : at + BESIDE_GAP]
        if not (np.isfinite(before).all() and np.isfinite(after).all()):
            continue
        lines = [np.polyfit(usual * np.arange(BESIDE_GAP), part, 1) for part in (before, after)]
        noise = float(np.std(np.diff(np.concatenate([before, after])))) + 1e-9
        slope, behind = float(lines[0][0]), float(lines[1][0])
        if abs(slope) * gap > GAP_NOISE * noise:
            moved = float(lines[1][1] - np.polyval(lines[0], usual * BESIDE_GAP))  # beyond what one step brings
            stood.append(abs(moved) < STOOD * abs(slope) * gap and 0.5 < behind / slope < 1.5)
    if not stood or not all(stood):
        return []
    said = f"{gap / 60.0:.4g} min without a reading from {time[at - 1] / 60.0:.4g} min on, in which no sensor moved"
    return [Guess("time", f"{said}: taken to have passed, though the clock may have been set", "correct the stamps if it was")]


def without_faults(columns: dict[str, Array], names: Sequence[str]) -> tuple[dict[str, Array], dict[str, str]]:
    """Columns (n,) in order of time, those of `names` without false first readings and repetitions of a held value.

    Also what was left out of which, in words.
    """
    found, said = dict(columns), {}
    some = [columns[n] for n in names]
    for name, first in zip(names, false_first(some).tolist(), strict=True):
        if first:
            column = columns[name].copy()
            gone = column[:first][np.isfinite(column[:first])]
            column[:first] = np.nan
            found[name] = column
            told = ", ".join(f"{v:.6g}" for v in gone.tolist())
            first_ones = (
                f"the first {len(gone)} readings ({told} degC) are" if len(gone) > 1 else f"the first reading ({told} degC) is"
            )
            said[name] = f"{first_ones} far from all others and left out"
    for name, length in zip(names, held(some), strict=True):
        if length > 1:
            found[name] = np.where(_taken(columns[name], length), found[name], np.nan)
            more = f"{said[name]}; " if name in said else ""
            said[name] = f"{more}each value is held for {length} readings: one of them counts"
    return found, said
