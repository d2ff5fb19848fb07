"""Covariances of the discrepancy's components, between the blocks that were read and the quantities that are asked for.

All follow from one picture: a drive d(t) reaches the point through its own lag, y' = b (d - y), so a drive that steps at time s
leaves 1 - exp(-b (t - s)). A quantity asked for is a row beside the blocks: it has covariances with them, and a value of the law.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..decay import LOG_TWENTY
from .prior import COMPONENTS, SLOW

Array = NDArray[np.float64]

#: Fast modes against the law's rate, and their sizes: a lag in series, of a probe or of what heat passes on its way, is a mode as
#: much smaller as it is faster. A slow body in a quick heater lags by a fiftieth of its time constant.
FAST = (1.5, 2.0, 3.0, 5.0, 9.0, 18.0, 36.0, 72.0)
FAST_SIZES = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.35, 0.18, 0.09]) / np.sqrt(5.0)
DECAY = (0.7, 1.02, 1.5, 2.5)
#: Periods of a cyclic load, in units.
PERIODS = (6.0, 9.0, 13.0, 20.0, 30.0, 45.0)
#: Memory of a load that flutters, and of an uneven start, in units (a sixtieth of the time constant).
LOAD_MEMORY, START_MEMORY, START_DECAY = 30.0, 5.0, 10.0
#: Steps by which a random drive is drawn over the readings, and over the time ahead.
STEPS, STEPS_AHEAD = 24, 12
#: A time asked for is far behind the others where it is so many times as far from the last of them as that from the readings.
FAR = 0.25
#: Quantities asked for first: the limit, 95 % of the rise, what slow modes still add after the last reading.
LIMIT, SETTLING, SLOW_AHEAD, FIRST_TIME = 0, 1, 2, 3
FOREVER = 1e9
#: Share of the room's wandering that a logged room leaves open, and points by which its record is drawn.
UNLOGGED, ROOM_POINTS = 0.3, 300
#: Fewer readings of a room at its end than these draw no line.
ROOM_FEW = 5
#: Deviations by which a room must move over them to be drifting.
DRIFTS = 4.0


@dataclass(frozen=True)
class Asked:
    """Beside limit, settling and slow rest: temperatures at times (k,) [min], whatever room and load do until then."""

    times: Array

    @property
    def count(self) -> int:
        return FIRST_TIME + len(self.times)


def _loss_shape() -> tuple[Array, Array]:
    """delta(x) of delta' = -delta - u log u, u = 1 - exp(-x): what a loss exponent a little above 1 does, to first order."""
    x = np.concatenate([[0.0], np.geomspace(1e-4, 40.0, 1200)])
    u = -np.expm1(-x)
    drive = np.where(u > 0.0, u * np.log(np.maximum(u, 1e-300)), 0.0)
    # The drive is nearly constant over a step, so that its response is exact: delta e^x = -integral of e^x u log u.
    fall = np.exp(-np.diff(x))
    shape = np.zeros_like(x)
    middle = 0.5 * (drive[1:] + drive[:-1])
    for i in range(len(fall)):
        shape[i + 1] = shape[i] * fall[i] - middle[i] * (1.0 - fall[i])
    return x, shape


_LOSS = _loss_shape()


def loss_bend(x: Array) -> Array:
    """What a loss exponent above 1 does to the rise at x = rate t, relative to it and to what the exponent is above 1."""
    found: Array = np.interp(x, *_LOSS)
    return found


def law(rate: Array, time: Array, spread: Array, asked: Asked) -> Array:
    """(1 - exp(-b t)) / b (..., m + asked.count) of rates (...): means over blocks, then at what is asked for.

    Settling and slow rest are differences, in which the law itself cancels.
    """
    b = rate[..., None]
    x = b * time
    blocks = -np.expm1(-x) / b - 0.5 * b * np.exp(-x) * spread
    none = np.zeros_like(b)
    return np.concatenate([blocks, 1.0 / b, none, none, -np.expm1(-b * asked.times) / b], axis=-1)


def slow_rise(rate: Array, time: Array, last: float, turns: float, asked: Asked) -> Array:
    """What each slow mode of amplitude 1 adds to :func:`law` of rates (...): (..., slow modes, m + asked.count)."""
    b = rate[..., None, None]
    mode = np.array(SLOW)[:, None]

    def at(times: Array) -> Array:
        risen: Array = -np.expm1(-b * mode * times)
        return risen

    end = np.ones_like(b * mode)
    rest = end - at(np.array([last]))
    settling = at(turns / b) - 0.95 * end
    found: Array = np.concatenate([at(time), end, settling, rest, at(asked.times)], axis=-1) / b
    return found


def constant(time: Array, asked: Asked) -> Array:
    """What the initial temperature adds to each of the same rows (m + asked.count,)."""
    return np.concatenate([np.ones(len(time)), [1.0, 0.0, 0.0], np.ones(len(asked.times))])


def _swings(b: Array, times: Array, width: Array, waits: NDArray[np.bool_], unit: float) -> list[Array]:
    """Responses (G, rows) to heats cos and sin of each period, switched on with the machine; means over blocks of `width` (rows,).

    What waits for the end waits for the mean over a cycle, to which a swing adds nothing.
    """
    found = []
    fading = np.exp(-np.minimum(b * times, 700.0))
    for period in PERIODS:
        pulse = 2.0 * np.pi / (period * unit)
        angle = pulse * np.minimum(times, 1e6)
        mean = np.where(waits, 0.0, np.sinc(pulse * width / (2.0 * np.pi)))
        gain = b / (b**2 + pulse**2) / np.sqrt(len(PERIODS))
        found.append(gain * (mean * (b * np.cos(angle) + pulse * np.sin(angle)) - np.where(waits, 0.0, b * fading)))
        found.append(gain * (mean * (b * np.sin(angle) - pulse * np.cos(angle)) + np.where(waits, 0.0, pulse * fading)))
    return found


def lagged(rate: Array, step: float, drive: Array) -> Array:
    """Response (G, n) of y' = b (d - y) at rates (G,) [1/min] to a drive (n,) straight between its points, `step` [min] apart."""
    fall = np.exp(-rate * step)
    late = (1.0 - fall) / np.maximum(rate * step, 1e-12)  # the response to a ramp is exact
    line = np.zeros((len(rate), len(drive)))
    for i in range(1, len(drive)):
        line[:, i] = line[:, i - 1] * fall + drive[i] * (1.0 - late) + drive[i - 1] * (late - fall)
    return line


def of_room(rate: Array, time: Array, when: Array, room: Array, asked: Asked) -> Array:
    """What a logged room (n,) [degC] at `when` (n,) [min] does at rates (G,): (G, m + k) [K], against the room at the beginning.

    After its last reading, for limit, settling and times asked for, the room stays as it was.
    """
    grid = np.linspace(0.0, float(when[-1]), ROOM_POINTS)
    step = float(grid[1] - grid[0])
    ends = max(1, len(room) // 50)
    level = np.interp(grid, when, room) - float(np.median(room[:ends]))
    now = room_at_end(when, room) - float(np.median(room[:ends]))
    line = lagged(rate, step, level)

    def at(times: Array) -> Array:
        inside = np.array([np.interp(times, grid, row) for row in line])
        after = now + (line[:, -1:] - now) * np.exp(-rate[:, None] * np.maximum(times - grid[-1], 0.0))
        return np.where(times > grid[-1], after, inside)

    settles = np.array([at(np.array([t]))[i, 0] for i, t in enumerate(LOG_TWENTY / rate)])
    late = settles - 0.95 * now
    columns = [at(time), np.full((len(rate), 1), now), late[:, None], np.zeros((len(rate), 1)), at(asked.times)]
    return np.concatenate(columns, axis=1)


def room_at_end(when: Array, room: Array) -> float:
    """A room (n,) [degC] as it is at the last of its times (n,): the median of its last fiftieth, or where it plainly drifts over
    its last twentieth the end of a line through the medians of that one's halves.
    """
    count = len(room) // 20
    if count >= ROOM_FEW:
        time, last, half = when[-count:], room[-count:], count // 2
        slope = (np.median(last[half:]) - np.median(last[:half])) / (np.median(time[half:]) - np.median(time[:half]))
        moved = slope * (time[-1] - np.median(time))
        noise = float(np.std(np.diff(last))) / np.sqrt(2.0)
        if abs(moved) > DRIFTS * 2.0 * noise / np.sqrt(count):
            return float(np.median(last) + moved)
    return float(np.median(room[-max(1, len(room) // 50) :]))


def covariances(
    rate: Array, time: Array, last: float, unit: float, asked: Asked, logged: Array | None = None, turns: float = LOG_TWENTY
) -> Array:
    """(G, components, m + k, m + k) for rates (G,) [1/min], blocks at time (m,) [min] after the first reading, unit [min].

    last [min] is the time of the last reading: limit and settling take room and load to stay as they are then. logged (G, m + k)
    [K] is what a room that is logged does to each row, as :func:`of_room` gives it: little is left of its wandering until then.
    turns: time constants after which 95 % are done.
    """
    nodes = len(rate)
    b = rate[:, None]
    settles = turns / rate[:, None]
    one = np.ones((nodes, 1))
    # Rows: blocks, the limit, then 95 % and the beginning, which settling is made of, then the times asked for.
    times = np.concatenate([one * time, one * FOREVER, settles, 0.0 * one, one * asked.times], axis=1)
    rows = times.shape[1]
    m = len(time)
    x = np.minimum(b * times, 700.0)
    waits = np.arange(rows) <= m + 2  # room and load stay as they are at the last reading
    waits[:m] = False

    def squares(columns: list[Array]) -> Array:
        stacked = np.stack(columns, axis=-1)
        found: Array = stacked @ np.swapaxes(stacked, 1, 2)
        return found

    slow = np.stack([-np.expm1(-k * x) for k in SLOW], axis=-1) / np.sqrt(len(SLOW))
    slow_rest = np.stack([np.exp(-k * rate * last) for k in SLOW], axis=-1) / np.sqrt(len(SLOW))
    fast = squares([size * np.exp(-k * x) for k, size in zip(FAST, FAST_SIZES, strict=True)])
    exponent = squares([loss_bend(x)])
    decay = squares([(np.exp(-k * x) - np.exp(-x)) / (1.0 - k) / np.sqrt(len(DECAY)) for k in DECAY])
    steps = np.concatenate([np.linspace(0.0, last, STEPS + 1)[:-1], _steps_ahead(last, asked.times)])
    since = times[:, :, None] - steps
    response = np.where(since > 0.0, -np.expm1(-np.minimum(b[..., None] * np.maximum(since, 0.0), 700.0)), 0.0)
    response[:, waits, STEPS:] = 0.0
    width = np.diff(np.append(steps, 2.0 * steps[-1] - steps[-2])) / unit / 60.0
    wandering = response * np.sqrt(width)
    walk = wandering @ np.swapaxes(wandering, 1, 2)
    unlogged = wandering * np.where(steps < last, UNLOGGED, 1.0) if logged is not None else wandering
    room = unlogged @ np.swapaxes(unlogged, 1, 2)
    cycle = squares(_swings(b, times, np.append(np.diff(time, prepend=0.0), np.zeros(rows - m)), waits, unit))
    units = steps / unit
    jumps = np.eye(len(steps)) - np.eye(len(steps), k=-1)
    memory = jumps @ np.exp(-np.abs(units[:, None] - units) / LOAD_MEMORY) @ jumps.T
    load = response @ memory @ np.swapaxes(response, 1, 2)
    at = np.minimum(times / unit, 1e6)
    start = np.exp(-np.abs(at[:, :, None] - at[:, None]) / START_MEMORY - (at[:, :, None] + at[:, None]) / START_DECAY)
    # A room that drifts goes on to the last reading and stays; a probe that drifts is no part of the machine's temperature.
    held = np.where(waits, np.minimum(times, last), times)
    lagged = held + np.expm1(-b * held) / b
    going = -np.expm1(-np.clip(b * (times - last), 0.0, 700.0))
    lagged = np.where(waits & (times > last), lagged + (last - lagged) * going, lagged)
    probe = np.where(waits, 0.0, times)
    ramp = squares([lagged, probe]) / (60.0 * unit) ** 2
    by_name = {
        "fast": fast,
        "exponent": exponent,
        "decay": decay,
        "load": load,
        "cycle": cycle,
        "walk": walk,
        "start": start,
        "room": room,
        "ramp": ramp,
    }
    found = np.empty((nodes, len(COMPONENTS) + len(SLOW), rows, rows))
    for i, name in enumerate(COMPONENTS):
        if name == "slow":
            columns = _differences(slow, m)
            columns[:, m + SLOW_AHEAD] = slow_rest
            for q in range(len(SLOW)):
                found[:, len(COMPONENTS) + q] = len(SLOW) * columns[:, :, q, None] * columns[:, None, :, q]
            found[:, i] = columns @ np.swapaxes(columns, 1, 2)
        elif name == "logged":
            found[:, i] = 0.0 if logged is None else logged[:, :, None] * logged[:, None, :]
        else:
            found[:, i] = np.swapaxes(_differences(np.swapaxes(_differences(by_name[name], m), 1, 2), m), 1, 2)
    return found


def _steps_ahead(last: float, times: Array) -> Array:
    """When a random drive steps on after the last reading until the last of the times asked for (k,) [min].

    What is asked for far behind all else, as by name, has steps of its own: those over readings stay as fine as without it.
    """
    later = np.unique(times[times > last])
    alone = len(later) > 1 and later[-1] - later[-2] > FAR * (later[-2] - last)
    ends = [last, *([later[-2]] if alone else []), *later[-1:]]
    found = [np.linspace(begin, end, STEPS_AHEAD + 1)[:-1] for begin, end in pairwise(ends)]
    return np.concatenate(found) if found else np.zeros(0)


def _differences(values: Array, m: int) -> Array:
    """Values (G, rows, k) of rows with 95 % less 0.95 of the limit and 0.05 of the beginning, which is left with nothing."""
    found = values.copy()
    found[:, m + SETTLING] = -0.95 * values[:, m] + values[:, m + SETTLING] - 0.05 * values[:, m + SLOW_AHEAD]
    found[:, m + SLOW_AHEAD] = 0.0
    return found


#: Designs whose covariances are kept, and rows up to which they are: a plan, or a trial, looks at many records of one.
KEPT, KEPT_ROWS = 2, 20


def kept_covariances(rate: Array, time: Array, last: float, unit: float, asked: Asked, logged: Array | None, turns: float) -> Array:
    """As :func:`covariances`; of a few rows, and where no room is logged, from what was worked out before."""
    if logged is not None or len(time) + asked.count > KEPT_ROWS:
        return np.ascontiguousarray(covariances(rate, time, last, unit, asked, logged, turns))
    return _kept(rate.tobytes(), time.tobytes(), last, unit, asked.times.tobytes(), turns)


@lru_cache(maxsize=KEPT)
def _kept(rate: bytes, time: bytes, last: float, unit: float, asked: bytes, turns: float) -> Array:
    of_rate, of_time, of_asked = (np.frombuffer(b) if b else np.zeros(0) for b in (rate, time, asked))
    return np.ascontiguousarray(covariances(of_rate, of_time, last, unit, Asked(of_asked), None, turns))
