"""A logged column that jumps: a load in stages, one that is switched on and off, one that nothing counts."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..errors import listed
from ..reading import Run

Array = NDArray[np.float64]

#: Share of a logged column's range that is a jump after which what was before no longer counts, and one that parts two stages.
JUMP, STAGE = 0.3, 0.1
#: Share of a record in which a load is switched on: a jump there parts no stages.
BEGINNING = 0.1
#: Share of its largest value by which a logged column jumps where it is worth a word, and how many jumps are: more is a cycle.
UNCOUNTED, FEW = 0.2, 8
#: Times the deviation of steps between readings that a jump is at least; a normal one lies within a quarter of them with QUARTER.
BEYOND_NOISE, QUARTER = 6.0, 0.3186
#: Share of its mean by which a logged column flutters, and times its noise that all of it, and means of STRETCHES stretches, span
#: at most where it is one value all the time.
FLUTTER, NOISE_SPAN, MEANS_SPAN, STRETCHES = 0.02, 10.0, 6.0, 12


def uncounted(run: Run, start_min: float, until_min: float | None, drive: str | None = None) -> tuple[str, float | None]:
    """Where a logged column jumped a few times within the readings used [min], that nothing counts it, else empty; and when [min of
    the run] the last of all did so. drive: the column that was asked to be counted.
    """
    used = (run.time_s >= 60.0 * start_min) & (run.time_s <= (np.inf if until_min is None else 60.0 * until_min))
    changes = list(_changes(run, used))
    way = ": --drive {!r} counts it" if drive is None else ""
    said = [f"{n} changed at {listed([f'{t:.4g}' for t in at], 3)} min, which is not counted{way.format(n)}" for n, at in changes]
    return "; ".join(said), max((float(at[-1]) for _, at in changes), default=None)


def jumps_after(run: Run, until_min: float | None) -> tuple[str, float]:
    """What to say of the first jump of a logged column after the readings used, and when [min of the run] it is; inf: none is."""
    last = np.inf if until_min is None else until_min
    found = [(float(at[at > last][0]), n) for n, at in _changes(run, np.isfinite(run.time_s)) if (at > last).any()]
    if not found:
        return "", np.inf
    when, name = min(found)
    return f"{name} changes at {when:.4g} min: readings from then on are not compared with what is foretold", when


def _changes(run: Run, within: NDArray[np.bool_]) -> Iterator[tuple[str, Array]]:
    """Logged columns that jump a few times `within` some readings (N,), and when [min]; what does all the time is left out."""
    for name, column in run.inputs.items():
        known = within & np.isfinite(column)
        level, minutes = column[known], run.time_s[known] / 60.0
        at = minutes[_jumps(level, UNCOUNTED * float(np.abs(level).max()))] if len(level) > 2 else minutes[:0]
        if 0 < len(at) <= FEW:
            yield name, at


def last_change(time: Array, column: Array) -> float:
    """When [min] a logged column (n,) jumped last; -inf where it does not, or goes on and off all the time."""
    jumps = _jumps(column, STAGE * float(np.ptp(column)))
    return float(time[jumps[-1]]) if 0 < len(jumps) <= FEW else -np.inf


def stays(column: Array) -> bool:
    """Whether a logged column (n,) is one value all the time, but for its noise and a flutter of FLUTTER."""
    span, flutter = float(np.ptp(column)), FLUTTER * abs(float(np.mean(column)))
    if span <= flutter:
        return True
    noise = _step_noise(column) / np.sqrt(2.0)
    means = [float(np.mean(part)) for part in np.array_split(column, min(len(column), STRETCHES))]
    of_means = MEANS_SPAN * noise / np.sqrt(len(column) / len(means))
    return bool(span <= NOISE_SPAN * noise and float(np.ptp(means)) <= max(of_means, flutter))


def last_level(time: Array, column: Array, tau: float) -> float:
    """What a logged column (n,) is at its end, its noise averaged out; one that switches on and off within tau [min] is its mean.

    After a jump only what came since counts: the machine will follow that, not what was before. A staircase goes on in one
    direction, and however fast it is climbed only its last step counts.
    """
    first = len(column) - max(1, len(column) // 20)
    recent, cycle = _recent(time, column, tau)
    if cycle:  # over whole ones
        return float(np.mean(column[cycle[(len(cycle) - 1) % 2] : cycle[-1]]))
    return float(np.mean(column[max([first, *recent[-1:].tolist()]) :]))


def cycles(time: Array, column: Array, tau: float) -> bool:
    """Whether a logged column (n,) switches on and off within tau [min] at its end."""
    return bool(_recent(time, column, tau)[1])


def _recent(time: Array, column: Array, tau: float) -> tuple[NDArray[np.intp], list[int]]:
    """Readings at which a logged column (n,) jumped within the last tau [min], and those of them from which on it cycles."""
    jumps = _jumps(column, JUMP * float(np.ptp(column)))
    recent = jumps[time[jumps] > time[-1] - tau]
    return recent, recent[_first_turn(column, recent) :].tolist()


def longest_stay(time: Array, column: Array) -> float:
    """Minutes that a logged column (n,) which climbs, or falls, in stages stayed where it was, at most; inf where it does not.

    One that jumps back on the way shows by what follows how much of the machine is slow; one jump at the beginning switches it on.
    """
    jumps = _jumps(column, STAGE * float(np.ptp(column)))
    jumps = jumps[time[jumps] > time[0] + BEGINNING * (time[-1] - time[0])]
    directions = np.sign(column[jumps] - column[jumps - 1])
    if not len(jumps) or np.ptp(directions) > 0.0:
        return float("inf")
    return float(np.diff([time[0], *time[jumps], time[-1]]).max())


def _jumps(column: Array, least: float) -> NDArray[np.intp]:
    """Readings at which a logged column (n,) had just jumped by more than `least`; a jump that takes two readings is one."""
    jumped = np.append(np.abs(np.diff(column)) > max(least, BEYOND_NOISE * _step_noise(column), 1e-300), False)
    found: NDArray[np.intp] = np.flatnonzero(jumped[:-1] & ~jumped[1:]) + 1
    return found


def _step_noise(column: Array) -> float:
    """Deviation of the steps between readings of a logged column (n,), by the quarter of them that are smallest."""
    steps = np.abs(np.diff(column))
    return float(np.quantile(steps, 0.25)) / QUARTER if len(steps) else 0.0


def _first_turn(column: Array, jumps: NDArray[np.intp]) -> int:
    """Place of the jump from which on a column cycles: on and off again, and on or off once more; else how many there are."""
    turns = np.flatnonzero(np.diff(np.sign(column[jumps] - column[jumps - 1])))
    return int(turns[0]) if len(turns) > 1 else len(jumps)
