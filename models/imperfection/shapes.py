"""Covariances of the discrepancy's components, between the blocks that were read and the quantities that are asked for.

All follow from one picture: a drive d(t) reaches the point through its own lag, y' = b (d - y), so a drive that steps at time s
leaves 1 - exp(-b (t - s)). A quantity asked for is a row beside the blocks: it has covariances with them, and a value of the law.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

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


def _swings(b: Array, times: Array, width: Array, waits: NDArray[np.bool_], unit: float) -> Array:
    """Responses (G, rows, 2 periods) to heats cos and sin of each period, switched on with the machine; means over `width` (rows,).

    What waits for the end waits for the mean over a cycle, to which a swing adds nothing; all other rows are at times (rows,).
    """
    found = np.empty((len(b), len(times), 2 * len(PERIODS)))
    fading = np.where(waits, 0.0, np.exp(-np.minimum(b * times, 700.0)))
    begun = b * fading
    for k, period in enumerate(PERIODS):
        pulse = 2.0 * np.pi / (period * unit)
        angle = pulse * np.minimum(times, 1e6)
        mean = np.where(waits, 0.0, np.sinc(pulse * width / (2.0 * np.pi)))
        gain = b / (b**2 + pulse**2) / np.sqrt(len(PERIODS))
        in_step, behind = mean * np.cos(angle), mean * np.sin(angle)
        found[..., 2 * k] = gain * (b * in_step + pulse * behind - begun)
        found[..., 2 * k + 1] = gain * (b * behind - pulse * in_step + pulse * fading)
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


class Covariances(NamedTuple):
    """What one run's estimate needs of covariances between m blocks and k quantities asked for, at G rates.

    readings (G, components, m, m + k) of the blocks with each other and with what is asked for; own (G, components, k) the
    variances of that. Which of the quantities go together only :func:`covariances` tells.
    """

    readings: Array
    own: Array


def covariances(
    rate: Array, time: Array, last: float, unit: float, asked: Asked, logged: Array | None = None, turns: float = LOG_TWENTY
) -> Array:
    """(G, components, m + k, m + k) for rates (G,) [1/min], blocks at time (m,) [min] after the first reading, unit [min].

    last [min] is the time of the last reading: limit and settling take room and load to stay as they are then. logged (G, m + k)
    [K] is what a room that is logged does to each row, as :func:`of_room` gives it: little is left of its wandering until then.
    turns: time constants after which 95 % are done.
    """
    return _covariances(rate, time, last, unit, asked, logged, turns, len(time) + asked.count).readings


def _covariances(
    rate: Array, time: Array, last: float, unit: float, asked: Asked, logged: Array | None, turns: float, left: int
) -> Covariances:
    """As :func:`covariances`, of the first `left` rows with all."""
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
    each = x[..., None]
    modes = np.array(SLOW)
    slow = _settled(-np.expm1(-each * modes) / np.sqrt(len(SLOW)), m)
    slow[:, m + SLOW_AHEAD] = np.exp(-rate[:, None] * modes * last) / np.sqrt(len(SLOW))
    decays = np.array(DECAY)
    steps = np.concatenate([np.linspace(0.0, last, STEPS + 1)[:-1], _steps_ahead(last, asked.times)])
    response = times[:, :, None] - steps
    np.maximum(response, 0.0, out=response)  # before a drive steps there is no response
    response *= b[..., None]
    np.minimum(response, 700.0, out=response)
    np.negative(np.expm1(np.negative(response, out=response), out=response), out=response)
    response[:, waits, STEPS:] = 0.0
    _settled(response, m)
    width = np.diff(np.append(steps, 2.0 * steps[-1] - steps[-2])) / unit / 60.0
    walk = response * np.sqrt(width)
    units = steps / unit
    jumps = np.eye(len(steps)) - np.eye(len(steps), k=-1)
    memory = jumps @ np.exp(-np.abs(units[:, None] - units) / LOAD_MEMORY) @ jumps.T
    # A room that drifts goes on to the last reading and stays; a probe that drifts is no part of the machine's temperature.
    held = np.where(waits, np.minimum(times, last), times)
    lagged = held + np.expm1(-b * held) / b
    going = -np.expm1(-np.clip(b * (times - last), 0.0, 700.0))
    lagged = np.where(waits & (times > last), lagged + (last - lagged) * going, lagged)
    probe = np.where(waits, 0.0, times)
    swings = _swings(b, times[0], np.append(np.diff(time, prepend=0.0), np.zeros(rows - m)), waits, unit)
    # Of each component its columns: what rows have in common is the sum of their products.
    columns = {
        "fast": _settled(np.exp(-each * np.array(FAST)) * FAST_SIZES, m),
        "exponent": _settled(loss_bend(x)[..., None], m),
        "decay": _settled((np.exp(-each * decays) - np.exp(-each)) / (1.0 - decays) / np.sqrt(len(DECAY)), m),
        "slow": slow,
        "cycle": _settled(swings, m),
        "walk": walk,
        "room": walk if logged is None else walk * np.where(steps < last, UNLOGGED, 1.0),
        "ramp": _settled(np.stack([lagged, probe], axis=-1) / (60.0 * unit), m),
        "load": response,
    }
    if logged is not None:
        columns["logged"] = logged[..., None]
    found = Covariances(
        np.zeros((nodes, len(COMPONENTS) + len(SLOW), left, rows)), np.zeros((nodes, len(COMPONENTS) + len(SLOW), rows - m))
    )

    def put(place: int, these: Array, with_those: Array) -> None:
        np.matmul(these[:, :left], np.swapaxes(with_those, 1, 2), out=found.readings[:, place])
        np.einsum("gkn,gkn->gk", these[:, m:], with_those[:, m:], out=found.own[:, place])

    for i, name in enumerate(COMPONENTS):
        if name in columns:
            put(i, columns[name] @ memory if name == "load" else columns[name], columns[name])
    start = _begun(np.minimum(times / unit, 1e6), m)
    found.readings[:, COMPONENTS.index("start")] = start[:, :left]
    found.own[:, COMPONENTS.index("start")] = np.diagonal(start, axis1=1, axis2=2)[:, m:]
    for q in range(len(SLOW)):
        put(len(COMPONENTS) + q, len(SLOW) * slow[..., q, None], slow[..., q, None])
    return found


def _begun(at: Array, m: int) -> Array:
    """Covariances (G, rows, rows) of an uneven start at times (G, rows) in units, of which settling alone depends on the rate."""

    def between(one: Array, other: Array) -> Array:
        found: Array = np.exp(-np.abs(one - other) / START_MEMORY - (one + other) / START_DECAY)
        return found

    found = np.empty((*at.shape, at.shape[1]))
    found[:] = between(at[0, :, None], at[0])
    settling = m + SETTLING
    found[:, settling] = found[:, :, settling] = between(at[:, settling, None], at)
    return np.swapaxes(_settled(np.swapaxes(_settled(found, m), 1, 2), m), 1, 2)


def _steps_ahead(last: float, times: Array) -> Array:
    """When a random drive steps on after the last reading until the last of the times asked for (k,) [min].

    What is asked for far behind all else, as by name, has steps of its own: those over readings stay as fine as without it.
    """
    later = np.unique(times[times > last])
    alone = len(later) > 1 and later[-1] - later[-2] > FAR * (later[-2] - last)
    ends = [last, *([later[-2]] if alone else []), *later[-1:]]
    found = [np.linspace(begin, end, STEPS_AHEAD + 1)[:-1] for begin, end in pairwise(ends)]
    return np.concatenate(found) if found else np.zeros(0)


def _settled(values: Array, m: int) -> Array:
    """In place, values (G, rows, k) of rows with 95 % less 0.95 of the limit and 0.05 of the beginning; nothing is left of that."""
    values[:, m + SETTLING] = -0.95 * values[:, m] + values[:, m + SETTLING] - 0.05 * values[:, m + SLOW_AHEAD]
    values[:, m + SLOW_AHEAD] = 0.0
    return values


#: Designs whose covariances are kept, and rows up to which they are: a plan, or a trial, looks at many records of one.
KEPT, KEPT_ROWS = 2, 20


def kept_covariances(
    rate: Array, time: Array, last: float, unit: float, asked: Asked, logged: Array | None, turns: float
) -> Covariances:
    """What an estimate needs; of a few rows, and where no room is logged, from what was worked out before."""
    if logged is not None or len(time) + asked.count > KEPT_ROWS:
        return _covariances(rate, time, last, unit, asked, logged, turns, len(time))
    return _kept(rate.tobytes(), time.tobytes(), last, unit, asked.times.tobytes(), turns)


@lru_cache(maxsize=KEPT)
def _kept(rate: bytes, time: bytes, last: float, unit: float, asked: bytes, turns: float) -> Covariances:
    of_rate, of_time, of_asked = (np.frombuffer(b) if b else np.zeros(0) for b in (rate, time, asked))
    return _covariances(of_rate, of_time, last, unit, Asked(of_asked), None, turns, len(of_time))
