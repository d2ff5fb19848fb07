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


#: Blocks of equal length that a record is averaged to where a slip is looked for, at most, and such blocks before and after one.
BLOCKS, BESIDE = 240, 6
#: Blocks over which a slip may be spread by the probe's own lag, each twice the one before; times the usual length, at which a
#: block holds a gap.
SPREADS, GAP = (1, 2, 4, 8), 2.5
#: A slip is farther than so many times what the record does anywhere else, than such a share of what the sensor moved, and than so
#: many times what its line leaves of the readings about it, as a few that are bad do.
ALONE, WORTH, CLEAR = 3.0, 0.03, 10.0
#: How much farther it may be where twice as much about it is left out: a heat that begins goes on, a slip is over.
GOES_ON = 1.2
#: Of the slip: what another sensor may do at the same moment, what the sensor may have done where its record begins, by which it
#: shows parts that are as quick, and what it had moved before, without which it is a rise that begins late.
ALSO, AT_ONCE, UNDER_WAY = 0.2, 0.5, 0.3


def slipped(time: Array, reading: Array) -> Array:
    """When (S,) [min] sensors slip, as a probe does that moves on its place; nan where none does.

    About each moment one line is fitted to what readings (S, N) at time (N,) [min] were before and after, with a level for
    each side: what a curve does that bends or changes its slope stays out of the difference of the levels. The probe's own lag
    may spread it, so what was read meanwhile is left out. A part of the machine that is as quick as that shows it where the
    record begins, and other sensors feel it too.
    """
    when = np.full(len(reading), np.nan)
    if len(time) < 4 * BESIDE or len(reading) == 0:
        return when
    edges = np.unique(np.linspace(0, len(time), min(len(time), BLOCKS) + 1).round().astype(int))[:-1]
    length = np.diff(np.append(edges, len(time)))
    at, mean = np.add.reduceat(time, edges) / length, np.add.reduceat(reading, edges, axis=1) / length
    rows = np.arange(len(mean))
    levels = [_levels(at, mean, spread) for spread in (*SPREADS, 2 * SPREADS[-1])]
    for spread, about, wider in zip(SPREADS, levels, levels[1:], strict=False):
        if about is None or wider is None:
            break
        size, place = np.abs(about.level), np.arange(len(about.time))
        error = 1.4826 * np.median(np.abs(np.diff(about.level, axis=1)), axis=1)
        # Where the slip is inside a window no line fits there.
        k = (size / (about.left + error[:, None] + 1e-300)).argmax(axis=1)
        far = np.abs(place - k[:, None]) > 2 * BESIDE + spread
        here = size[rows, k]
        elsewhere = np.where(far, size, 0.0).max(axis=1)
        later = np.abs(wider.level[rows, np.clip(np.searchsorted(wider.time, about.time[k]), 0, len(wider.time) - 1)])
        begun = _begun(at, mean, spread)
        before = np.abs(mean[rows, k + BESIDE - 1] - mean[:, 0])
        # Row by sensor, column by whose moment.
        beside = size[:, np.clip(k[:, None] + np.arange(-spread, spread + 1), 0, len(place) - 1)].max(axis=2)
        beside[rows, rows] = 0.0
        others = beside.max(axis=0)
        least = np.max([ALONE * elsewhere, WORTH * np.ptp(mean, axis=1), CLEAR * about.left[rows, k]], axis=0)
        alone = (
            (later < GOES_ON * here)
            & (begun < AT_ONCE * here)
            & (others < ALSO * here)
            & (before > UNDER_WAY * here)
            & far.any(axis=1)
        )
        when = np.where(np.isnan(when) & alone & (here > least), about.time[k], when)
    return when


class _Levels(NamedTuple):
    """About each moment time (K,) [min]: by how much what follows is above what was before, beside one slope, level (S, K) [K], and
    what that line leaves, left (S, K) [K].
    """

    time: Array
    level: Array
    left: Array


def _levels(at: Array, mean: Array, spread: int) -> _Levels | None:
    """Of block means (S, M) at times (M,), BESIDE of them on each side of `spread` that are left out; None of too few."""
    gone = BESIDE + spread
    count = len(at) - gone - BESIDE + 1
    if count < 4:
        return None
    whole, y = at - at[0], mean - mean.mean(axis=1, keepdims=True)

    def sums(values: Array) -> tuple[Array, Array]:
        """(before, after): sums over the BESIDE values on either side."""
        total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)
        each = total[..., BESIDE:] - total[..., :-BESIDE]
        return each[..., :count], each[..., gone : gone + count]

    t_of, tt_of, y_of, ty_of, yy_of = (sums(v) for v in (whole, whole**2, y, whole * y, y**2))
    along = sum(ty - t * y / BESIDE for t, y, ty in zip(t_of, y_of, ty_of, strict=True))
    across = sum(tt - t**2 / BESIDE for t, tt in zip(t_of, tt_of, strict=True))
    squares = sum(yy - y**2 / BESIDE for y, yy in zip(y_of, yy_of, strict=True))
    slope = along / across
    level = (y_of[1] - y_of[0] - slope * (t_of[1] - t_of[0])) / BESIDE
    left = np.sqrt(np.maximum(squares - slope * along, 0.0) / (2 * BESIDE))
    step = np.diff(at)
    holes = np.concatenate([[0], np.cumsum(step > GAP * np.median(step))])
    level[:, holes[gone + BESIDE - 1 : gone + BESIDE - 1 + count] > holes[:count]] = 0.0
    return _Levels(0.5 * (at[BESIDE - 1 : BESIDE - 1 + count] + at[gone : gone + count]), level, left)


def _begun(at: Array, mean: Array, spread: int) -> Array:
    """What sensors (S,) [K] did where their record (S, M) begins, beyond what they go on with after twice the spread."""
    after = slice(2 * spread, 2 * spread + BESIDE)
    t, y = at[after], mean[:, after]
    slope = (y @ (t - t.mean())) / float((t - t.mean()) @ (t - t.mean()))
    found: Array = np.abs(y.mean(axis=1) - slope * (t.mean() - at[0]) - mean[:, 0])
    return found


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
