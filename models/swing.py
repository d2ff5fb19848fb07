"""Heats that swing all the time about a mean (a chiller between two limits, a load on and off) and what they do to readings.

A machine driven so does what it would do under the mean heat, and beside that a periodic part, which is there from the first cycle
on but for a transient that dies out as the machine's own does. The periodic part is found by regression on harmonics of one period
that all sensors of a run share, beside a trend of exponentials (Quinn & Hannan, The Estimation and Tracking of Frequency, 2001,
chapter 4: several harmonics of an unknown fundamental in a coloured rest).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Rates of the trend's exponentials, over the length of the record, beside a constant and a straight line.
TREND = (0.25, 0.7, 1.5, 3.0, 6.0, 12.0, 24.0)
#: Cycles that must have been read, and readings in each; fewer are a bend like any other.
CYCLES, IN_EACH = 3.4, 6
#: Harmonics at most, and points of each of them.
HARMONICS, OF_EACH = 8, 4
#: Sensors and points that the period is looked for in.
SENSORS, POINTS = 8, 480
#: Most cycles in a record that are looked for, how near to a peak of the spectrum, and how much finer that is than its own step.
MOST, STEP, PADDED = 80, 0.1, 8
#: What is left of a sensor's readings beside the trend, at most, where they swing.
LEFT = 0.25
#: Other periods, in shares of the one found, and what is left there of what they leave, at most: a load that changed once, or a
#: room that wanders, is met by one as well as by the next.
NEAR, SHARP = (0.85, 0.9, 1.1, 1.15), 0.25
#: Share of that in the strongest frequency and its neighbours, below which nothing is looked for further.
PEAK = 0.2
#: Likeness of the first and the second half of the cycles, and how much larger either may be.
ALIKE, GROWN = 0.8, 2.5
#: What the harmonics of a swing leave of a logged room, at most, that swings alike.
ALSO = 0.5
#: Share of a swing in every second of its harmonics, or third and so on, from which its period is as much shorter.
MULTIPLE = 0.95
#: Shares of a record behind which a swing is looked for that is not in all of it.
LATER = (0.25, 0.5)
#: A swing of fewer of the logger's steps (root mean square) is its rounding.
STEPS = 0.6


@dataclass(frozen=True)
class Swing:
    """period, start [min]; size (S, 2 K) [K]: of each sensor cosines and sines of K harmonics; swings (S,): which of them swing."""

    period: float
    start: float
    size: Array
    swings: NDArray[np.bool_]

    def at(self, time: Array) -> Array:
        """The periodic part (S, n) [K] at time (n,) [min]; nought on the mean over a cycle."""
        found: Array = self.size @ _harmonics((time - self.start) / self.period, self.size.shape[1] // 2)
        return found

    def ends(self) -> tuple[Array, Array]:
        """Least and greatest of the periodic part (S,) [K]."""
        found = self.at(self.start + self.period * np.linspace(0.0, 1.0, 128))
        return found.min(axis=1), found.max(axis=1)

    def also_in(self, time: Array, line: Array) -> bool:
        """Whether a line (n,) [K] at the same times swings with the same period."""
        x, cycles = (time - self.start) / float(time[-1] - time[0]), float(time[-1] - time[0]) / self.period
        basis = np.linalg.qr(_trend(x).T)[0]
        rest = (line - line.mean())[None]
        rest = rest - (rest @ basis) @ basis.T
        left = (rest**2).sum(axis=1)
        return bool(left[0] > 0.0 and _explained(x, rest, left, cycles, basis)[0] < ALSO)


def later_swing(time: Array, reading: Array, resolution: Array) -> Swing | None:
    """A swing as of :func:`swing_of` that began later, as of a thermostat that came to its limit; `start` [min] is no earlier."""
    for share in LATER:
        begin = time[0] + share * (time[-1] - time[0])
        late = time >= begin
        found = swing_of(time[late], reading[:, late], resolution)
        if found is not None:
            return found
    return None


def swing_of(time: Array, reading: Array, resolution: Array) -> Swing | None:
    """The swing of readings (S, n) [degC] of a run at time (n,) [min]; None where they do not swing.

    resolution (S,) [K]: the logger's step.
    """
    span = float(time[-1] - time[0])
    if len(time) < CYCLES * IN_EACH or not span > 0.0:
        return None
    some = np.unique(np.linspace(0, len(reading) - 1, SENSORS).round().astype(int))
    at, line = _fewer((time - time[0]) / span, reading[some])
    line = line - line.mean(axis=1, keepdims=True)
    whole = (line**2).sum(axis=1)
    basis = np.linalg.qr(_trend(at).T)[0]
    rest = line - (line @ basis) @ basis.T
    left = (rest**2).sum(axis=1)
    moving = (left > 1e-16 * whole) & (np.sqrt(left / len(at)) > STEPS * resolution[some])
    if not moving.any() or not _peaks(at, rest[moving]):
        return None
    cycles = _cycles(at, rest[moving], left[moving], basis)
    if cycles is None:
        return None
    count = _count(len(at), cycles)
    kept = np.zeros(len(some), dtype=bool)
    beside = np.min([_explained(at, rest[moving], left[moving], cycles * near, basis) for near in NEAR], axis=0)
    kept[moving] = _explained(at, rest[moving], left[moving], cycles, basis) < np.minimum(LEFT, SHARP * beside)
    kept &= _returns(at, line, cycles, count)
    if not kept.any():
        return None
    x, count = (time - time[0]) / span, _count(len(time), cycles)
    trend, harmonics = _trend(x), _harmonics(cycles * x, count)
    size = np.linalg.lstsq(np.concatenate([trend, harmonics]).T, (reading - reading.mean(axis=1, keepdims=True)).T, rcond=None)[0]
    size = size[len(trend) :].T
    # A sensor that the swing does not reach is left as it is: what the harmonics take from it is noise.
    part = size @ harmonics
    basis = np.linalg.qr(trend.T)[0]
    rest = reading - (reading @ basis) @ basis.T
    beyond = ((rest - part) ** 2).sum(axis=1) < (1.0 - 4.0 * count / len(time)) * (rest**2).sum(axis=1)
    swings = beyond & (np.sqrt((part**2).mean(axis=1)) > 0.5 * STEPS * resolution)
    if not swings.any():
        return None
    cycles, size = _own_period(cycles, size * swings[:, None])
    return Swing(span / cycles, float(time[0]), size, swings)


def _own_period(cycles: float, size: Array) -> tuple[float, Array]:
    """The same swing (S, 2 K) by its own period, where what was found is a multiple of it: harmonics of which every so many stand.

    A period that is too short for a first look, of few points or few readings in each cycle, is found as such a multiple.
    """
    count = size.shape[1] // 2
    for every in range(count, 1, -1):
        own = np.arange(every - 1, count, every)
        both = np.concatenate([own, own + count])
        if (size[:, both] ** 2).sum() > MULTIPLE * (size**2).sum():
            return every * cycles, size[:, both]
    return cycles, size


def _fewer(x: Array, reading: Array) -> tuple[Array, Array]:
    """At most POINTS means of neighbours."""
    if len(x) <= POINTS:
        return x, reading
    first = np.linspace(0, len(x), POINTS + 1).astype(int)[:-1]
    count = np.diff(np.append(first, len(x)))
    return np.add.reduceat(x, first) / count, np.add.reduceat(reading, first, axis=1) / count


def _trend(x: Array) -> Array:
    """Rows of the trend (9, n) at x (n,) of the record."""
    return np.concatenate([np.ones((1, len(x))), x[None], np.exp(-np.outer(TREND, x))])


def _harmonics(turns: Array, count: int) -> Array:
    """Cosines and sines (2 count, n) of so many harmonics, `turns` (n,) cycles after the start."""
    first = np.exp(2j * np.pi * turns)
    powers = np.cumprod(np.broadcast_to(first, (count, len(turns))), axis=0)
    return np.concatenate([powers.real, powers.imag])


def _count(n: int, cycles: float) -> int:
    return int(np.clip(n / (OF_EACH * cycles), 1, HARMONICS))


def _peaks(x: Array, rest: Array) -> bool:
    """Whether any of the rests (S, n) has much of its power near one frequency, as an even spacing of the points shows it."""
    even = np.linspace(0.0, 1.0, len(x))
    power = np.abs(np.fft.rfft([np.interp(even, x, line) for line in rest], axis=1)) ** 2
    near = power[:, :-2] + power[:, 1:-1] + power[:, 2:]
    peak = near[:, int(CYCLES) - 2 :].max(axis=1, initial=0.0)
    return bool((peak > PEAK * power.sum(axis=1)).any())


def _cycles(x: Array, rest: Array, left: Array, basis: Array) -> float | None:
    """How many cycles are in the record, as the harmonics of all sensors together have it most likely."""
    even, n = np.linspace(0.0, 1.0, len(x)), PADDED * len(x)
    power = np.abs(np.fft.rfft([np.interp(even, x, line) for line in rest], n, axis=1)) ** 2
    tried = np.arange(power.shape[1]) * len(x) / n * (len(x) - 1) / len(x)
    share = np.where((tried > CYCLES - STEP) & (tried < min(len(x) / IN_EACH, MOST)), (power / left[:, None]).sum(axis=0), 0.0)
    beside = np.pad(share, 1)
    peaks = np.flatnonzero((share > beside[:-2]) & (share >= beside[2:]))
    peaks = peaks[np.argsort(-share[peaks])][:3]
    found = []
    for at in sorted({tried[i] / part for i in peaks for part in (1, 2, 3) if tried[i] / part >= CYCLES - STEP}):
        for reach, points in ((STEP, 11), (0.2 * STEP, 9)):
            near = at + np.linspace(-reach, reach, points)
            value = [float(np.log(np.maximum(_explained(x, rest, left, f, basis), 1e-12)).mean()) for f in near]
            at = float(near[int(np.argmin(value))])
        found.append((min(value), at))
    if not found:
        return None
    best = min(found)[0]
    # Of a period and its multiples, which explain as much, the shortest.
    cycles = max(at for value, at in found if value <= 0.9 * best)
    return cycles if cycles >= CYCLES else None


def _explained(x: Array, rest: Array, left: Array, cycles: float, basis: Array) -> Array:
    """What the harmonics leave of what the trend leaves of each sensor (S,), as a share."""
    wave = _harmonics(cycles * x, _count(len(x), cycles))
    wave -= (wave @ basis) @ basis.T
    gram, of = wave @ wave.T, wave @ rest.T
    gram[np.diag_indices_from(gram)] += 1e-9 * np.trace(gram) / len(gram)
    found: Array = 1.0 - (of * np.linalg.solve(gram, of)).sum(axis=0) / left
    return found


def _returns(x: Array, line: Array, cycles: float, count: int) -> NDArray[np.bool_]:
    """Whether the first half of the cycles of each sensor (S,) and the second are alike."""
    wave = _harmonics(cycles * x, count)
    early = x < 0.5
    trend = _trend(x)
    both = np.concatenate([trend, wave * early, wave * ~early])
    size = np.linalg.lstsq(both.T, line.T, rcond=None)[0][len(trend) :]
    over = _harmonics(np.linspace(0.0, 1.0, 64), count)
    first, second = size[: 2 * count].T @ over, size[2 * count :].T @ over
    one, other = np.sqrt((first**2).mean(axis=1)), np.sqrt((second**2).mean(axis=1))
    likeness = (first * second).mean(axis=1) / np.maximum(one * other, 1e-300)
    found: NDArray[np.bool_] = (likeness > ALIKE) & (one < GROWN * other) & (other < GROWN * one)
    return found
