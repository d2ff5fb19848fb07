"""What goes wrong between machine and file: a probe that came off, a sensor logged twice."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Longest fall, as a share of the time in which the sensor had gone 63 % of its way: a machine switched off takes 2.2 of it, and
#: with a coolant that carries ten times the heat away a fifth.
QUICK = 0.2
#: It comes to rest no farther from where it began than this share of the way it had gone, within this share of the fall.
HOME, REST = 0.25, 0.1
#: Before it, as long as it takes, the sensor moves by no more than this share of it, and the others meanwhile by no more than this
#: share of their way: where they do, something happened to the machine.
CALM, OTHERS = 0.25, 0.1
#: Of its way, that is gone where a sensor is said to have fallen back; within such a share of the time in which it had gone 63 %.
MOST, FASTER = 0.7, 0.5
#: Deviations of the noise that are no movement, and that are a fall; readings at rest that are needed.
STILL, FALL, AT_REST = 6.0, 30.0, 10


class CameOff(NamedTuple):
    """One sensor falls to where it began, far quicker than it warmed, while the others go on.

    From reading number `first` on, over `minutes`, by `fall` [K] to `level` [degC].
    """

    first: int
    minutes: float
    fall: float
    level: float


def came_off(time: Array, reading: Array, used: NDArray[np.bool_], noise: Array) -> dict[int, CameOff]:
    """Which of the sensors came off: time (N,) [min], reading, used (S, N), noise (S,) [K]. Needs a second sensor that goes on."""
    if len(reading) < 2:
        return {}
    found = {i: fell for i in range(len(reading)) if (fell := _fell(time, reading[i], used[i], float(noise[i]))) is not None}
    return {i: fell for i, fell in found.items() if _others_go_on(i, fell, time, reading, used, noise)}


def fell_back(time: Array, reading: Array, noise: Array) -> dict[int, CameOff]:
    """Which sensors most likely came off, of readings (S, N) with a noise (S,) [K] at time (N,) [min], sooner than :func:`came_off`
    would leave anything out: most of what one had gone is gone, faster by far than it came, and no other that moves goes back.
    """
    if len(reading) < 2 or len(time) < 3 * AT_REST:
        return {}
    away = reading - np.median(reading[:, :3], axis=1, keepdims=True)
    gone = np.sign(away[np.arange(len(away)), np.abs(away).argmax(axis=1)])[:, None] * away
    top, last, big = gone.max(axis=1), np.median(gone[:, -3:], axis=1), FALL * np.maximum(noise, 1e-9)
    found = {}
    for i in np.flatnonzero((top > big) & (top - last > np.maximum(MOST * top, big))).tolist():
        fall, most = float(top[i] - last[i]), int(gone[i].argmax())
        over = most + int((gone[i, most:] < top[i] - MOST * fall).argmax())
        off = most + int(np.flatnonzero(gone[i, most:over] > top[i] - REST * fall)[-1])
        warmed = float(time[int((gone[i] > (1.0 - np.exp(-1.0)) * top[i]).argmax())] - time[0])
        # What falls from one reading to the next jumps, and so does a single outlier.
        quick = over - off > 1 and time[over] - time[off] < FASTER * warmed
        others = np.delete(np.arange(len(reading)), i)
        moved = others[gone[others, off] > big[others]]
        if quick and len(moved) and (last[moved] >= gone[moved, off] - STILL * noise[moved]).all():
            found[i] = CameOff(off, float(time[over] - time[off]), fall, float(reading[i, -1]))
    return found


def _fell(time: Array, reading: Array, used: NDArray[np.bool_], noise: float) -> CameOff | None:
    at = np.flatnonzero(used)
    if len(at) < 3 * AT_REST:
        return None
    r, t = reading[at], time[at]
    start, level = float(np.median(r[:3])), float(np.median(r[-max(AT_REST, len(r) // 20) :]))
    away = np.abs(r - level)
    # At rest from after the last reading that is farther off than rest allows.
    far = np.flatnonzero(away > max(REST * float(away.max()), STILL * noise))
    rest = int(far[-1]) + 1 if len(far) else 0
    if not AT_REST <= rest <= len(r) - AT_REST:
        return None
    way = float(r[int(away[:rest].argmax())]) - start
    warmed = float(t[int(np.argmax((r - start) / way >= 1.0 - np.exp(-1.0)))] - t[0]) if way else 0.0
    near = np.flatnonzero(t[:rest] >= t[rest] - QUICK * warmed)
    if not len(near):
        return None
    fall = float(away[near].max())
    last = int(near[np.flatnonzero(away[near] >= (1.0 - REST) * fall)[-1]])
    before = int(np.searchsorted(t, t[last] - (t[rest] - t[last])))
    calm = abs(float(r[last] - r[max(0, before - 1)])) <= CALM * fall
    if fall < max(FALL * noise, (1.0 - HOME) * abs(way)) or abs(level - start) > HOME * abs(way) or not calm:
        return None
    return CameOff(int(at[max(0, last - 1)]), float(t[rest] - t[last]), fall, level)


def _others_go_on(sensor: int, fell: CameOff, time: Array, reading: Array, used: NDArray[np.bool_], noise: Array) -> bool:
    end = time[fell.first] + 2.0 * fell.minutes
    for j in range(len(reading)):
        at = np.flatnonzero(used[j])
        if j == sensor or not len(at):
            continue
        before, after = (float(np.interp(moment, time[at], reading[j, at])) for moment in (time[fell.first], end))
        if abs(after - before) > OTHERS * abs(before - float(np.median(reading[j, at[:3]]))) + STILL * float(noise[j]):
            return False
    return True


#: How often a column must change for a second one, equal to it in all readings, to be the same sensor: two sensors of a coarse
#: logger that change less often may be alike by chance.
CHANGES = 24
#: Readings looked at first, of which most columns differ.
FIRST = 16


def originals(columns: Sequence[Array]) -> NDArray[np.intp]:
    """Of each column (N,) the number of the first that holds the same readings, (S,); its own where none does."""
    found = np.arange(len(columns))
    for alike in _groups(found.tolist(), [_middle(c) for c in columns]):
        for same in _groups(alike, [hash(columns[i].tobytes()) for i in alike]):
            first = columns[same[0]]
            if np.count_nonzero(np.diff(first[np.isfinite(first)])) >= CHANGES:
                found[[i for i in same if np.array_equal(columns[i], first, equal_nan=True)]] = same[0]
    return found


def _middle(column: Array) -> bytes:
    at = max(0, (len(column) - FIRST) // 2)
    return column[at : at + FIRST].tobytes()


def _groups(numbers: list[int], keys: Sequence[object]) -> list[list[int]]:
    """The numbers with the same key, where there are several."""
    groups: dict[object, list[int]] = {}
    for number, key in zip(numbers, keys, strict=True):
        groups.setdefault(key, []).append(number)
    return [g for g in groups.values() if len(g) > 1]
