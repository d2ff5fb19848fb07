"""Sensors' readings as they are handed over, and made ready for a filter: the logger's step, what was left out and why."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thermofast.models import difference_noise, third_difference_noise
from thermofast.models.noise.spikes import logger_step, logger_steps
from thermofast.models.observations import up_to

from .rules import RULES

if TYPE_CHECKING:
    from ..reading import Run

Array = NDArray[np.float64]

BLOCKS = 120
#: Log probability by chance from which repeated readings are a frozen probe's, and the least share of a noise that it surely is.
LOG_BY_CHANCE, NOISE_SURELY = math.log(1e-10), 0.75
#: How much longer each beginning is in which a start is looked for.
LONGER = 1.5
#: Means of neighbours before and behind a place that are looked at anew, each reading by itself or finer means of them.
BEFORE, BEHIND = 30, 15
#: Deviations of a mean of neighbours by which a rise that begins late must leave the stillness before it.
PLAIN = 30.0


@dataclass(frozen=True)
class Signals:
    """Readings of S sensors of one run as they were read: values (S, N) [degC], nan for none, at time_min (N,).

    start_min: when the rise begins, on the same clock; notes (S) or (): what the reader said of each; room (N,) [degC]: the
    surroundings where they are logged.
    """

    run: str
    channels: tuple[str, ...]
    time_min: Array
    values: Array
    start_min: float = 0.0
    notes: tuple[str, ...] = ()
    room: Array | None = None

    @classmethod
    def of(cls, run: "Run", start_min: float, channels: Sequence[str] | None = None) -> "Signals":
        """Those of a run, or some of them."""
        some = tuple(run.channels if channels is None else channels)
        # As np.stack, in a third of its time.
        values = np.concatenate([run.channels[c] for c in some]).reshape(len(some), -1) if some else np.empty((0, len(run.time_s)))
        notes = tuple(run.channel_notes.get(c, "") for c in some)
        return cls(run.name, some, run.time_s / 60.0, values, start_min, notes, run.room)

    @classmethod
    def joined(cls, several: "Sequence[Signals]") -> "Signals":
        """The sensors of several, all of one run, one after another."""
        return replace(
            several[0],
            channels=tuple(c for one in several for c in one.channels),
            values=np.concatenate([one.values for one in several]),
            notes=tuple(one.note(i) for one in several for i in range(len(one.channels))),
        )

    def note(self, i: int) -> str:
        """What the reader said of the i-th."""
        return self.notes[i] if self.notes else ""

    def one(self, i: int) -> "Signals":
        """The i-th of them."""
        return replace(self, channels=self.channels[i : i + 1], values=self.values[i : i + 1], notes=(self.note(i),))


@dataclass(frozen=True)
class Sensor:
    """time (N,) [min] from the first reading of the run and reading (N,) [degC], finite; resolution [K], 0 if none shows."""

    time: Array
    reading: Array
    resolution: float
    notes: tuple[str, ...]

    @property
    def constant(self) -> bool:
        return len(self.reading) > 0 and float(np.ptp(self.reading)) == 0.0

    def until(self, minutes: float | None) -> int:
        """How many readings lie in the first `minutes`."""
        return _until(self.time, minutes)


def _until(time: Array, minutes: float | None) -> int:
    return len(time) if minutes is None else int(np.searchsorted(time, up_to(minutes), "right"))


@dataclass(frozen=True)
class Sensors:
    """Sensors of a run whose readings stand at the same times: :class:`Sensor` with arrays over them, and their rows in the run.

    time (N,); reading (S, N); resolution (S,); notes (S); rows (S,). swung (S, N) [K]: what was taken out of the readings as a
    swing that goes on all the time; swing (S, 2) [K]: its least and greatest.
    """

    rows: NDArray[np.intp]
    time: Array
    reading: Array
    resolution: Array
    notes: tuple[tuple[str, ...], ...]
    swung: Array | None = None
    swing: Array | None = None

    def __len__(self) -> int:
        return len(self.rows)

    def measured(self, i: int) -> Array:
        """Readings (N,) of the i-th of them as the logger has them."""
        found: Array = self.reading[i] if self.swung is None else self.reading[i] + self.swung[i]
        return found

    def swing_ends(self, at: float) -> Array:
        """How far temperatures (S, 3) [K] at a time, low, middle, high, are from their mean over a cycle.

        Where a logged heat goes on and off the log tells where in its cycle it is, as far as it goes.
        """
        found = np.zeros((len(self), 3))
        if self.swing is not None and (self.swung is not None or at > float(self.time[-1])):
            found[:, ::2] = self.swing
        return found

    def one(self, i: int) -> Sensor:
        """The i-th of them."""
        return Sensor(self.time, self.reading[i], float(self.resolution[i]), self.notes[i])

    def maybe_refused(self, until_min: float | None, fewest: int) -> list[int]:
        """Those that may have nothing to identify in the first `until_min`: fewer readings than `fewest`, or all of them alike."""
        count = self.until(until_min)
        if count < fewest:
            return list(range(len(self)))
        seen = self.reading[:, :count]
        return np.flatnonzero((seen == seen[:, :1]).all(axis=1)).tolist()

    def some(self, keep: NDArray[np.bool_]) -> "Sensors":
        """Those that `keep` (S,) marks."""
        notes = tuple(n for n, k in zip(self.notes, keep, strict=True) if k)
        return Sensors(self.rows[keep], self.time, self.reading[keep], self.resolution[keep], notes)

    def until(self, minutes: float | None) -> int:
        """How many readings lie in the first `minutes`."""
        return _until(self.time, minutes)


def prepare_all(time_min: Array, values: Array, start_min: float) -> list[Sensors]:
    """Finite readings of values (S, N) from `start_min` on, without saturated stretches; sensors with the same times together.

    The logger's step and its range are properties of the instrument: they are taken from the whole record, so that a
    result does not depend on whether the record was cut before or after reading.
    """
    good = np.isfinite(values) & (time_min >= start_min - 1e-9)
    found: list[Sensors] = []
    for rows in _alike(good):
        mask = good[rows[0]]
        time, reading = time_min[mask], values if len(rows) == len(values) and mask.all() else values[np.ix_(rows, mask)]
        resolution = logger_steps(reading)
        ended = {i: s for i in _maybe_saturated(reading) if (s := saturated(reading[i], float(resolution[i]))).any()}
        froze = {i: s for i in _maybe_frozen(reading) if (s := frozen(reading[i], float(resolution[i]))).any()}
        stuck = {i: np.any([which[i] for which in (ended, froze) if i in which], axis=0) for i in ended | froze}
        whole = np.array([i for i in range(len(rows)) if i not in stuck], dtype=np.intp)
        if len(whole):
            found.append(Sensors(rows[whole], time, reading[whole], resolution[whole], ((),) * len(whole)))
        for i, out in stuck.items():
            note = (
                f"{int(out.sum())} readings stuck at {reading[i][out][0]:g} degC from {time[out][0]:.4g} min left out "
                f"({'range ends there?' if i in ended else 'the probe or the logger froze?'})"
            )
            found.append(Sensors(rows[i : i + 1], time[~out], reading[i : i + 1, ~out], resolution[i : i + 1], ((note,),)))
    return found


def prepare(time_min: Array, values: Array, start_min: float) -> Sensor:
    """As :func:`prepare_all` for one sensor (N,)."""
    return prepare_all(time_min, values[None], start_min)[0].one(0)


def refusal(sensor: Sensor, until_min: float | None, start_min: float = 0.0) -> tuple[str, str, int] | None:
    """(status, message, readings) where a sensor gives nothing to identify from `start_min` on, else None."""
    count = sensor.until(until_min)
    if not len(sensor.reading):
        return "no_data", "no reading in this column", 0
    if count < RULES.fewest_readings:
        within = f" in the first {until_min:g} min" if until_min is not None else ""
        if until_min is not None and until_min <= start_min:
            within = f" from {start_min:g} min, where the rise starts, to {until_min:g}"
        return "too_short", f"{count} readings{within}; at least {RULES.fewest_readings} are needed", count
    if float(np.ptp(sensor.reading[:count])) == 0.0:
        return "constant", f"every reading is {sensor.reading[0]:g} degC: is the probe connected?", count
    return None


def _alike(good: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Rows of good (S, N) that are the same, in the order of the first of each."""
    if good.all():
        return [np.arange(len(good))]
    groups: dict[bytes, list[int]] = {}
    for i, row in enumerate(good):
        groups.setdefault(row.tobytes(), []).append(i)
    return [np.array(rows, dtype=np.intp) for rows in groups.values()]


def _maybe_saturated(reading: Array) -> NDArray[np.intp]:
    """Rows whose greatest or least reading is there often enough for :func:`saturated` to look at."""
    if reading.shape[1] <= 3 * RULES.saturated_readings:
        return np.empty(0, dtype=np.intp)
    often = [
        np.count_nonzero(reading == extreme, axis=1) >= RULES.saturated_readings
        for extreme in (reading.max(axis=1, keepdims=True), reading.min(axis=1, keepdims=True))
    ]
    return np.flatnonzero(often[0] | often[1])


def saturated(reading: Array, resolution: float) -> NDArray[np.bool_]:
    """Readings stuck at the end of the instrument's range: shape (n,).

    A run of equal readings at the record's extreme, entered while the curve was moving without slowing down: over as
    many readings as the run lasts, or over the last half or quarter of them (what the record begins with may be quicker), the
    second half of the way to it rose at least half as much as the first. A curve that settles by itself slows down long before it
    stands still. What is :func:`frozen` by its noise need not be the end of a range.
    """
    stuck = np.zeros(len(reading), dtype=bool)
    for extreme in (reading.max(), reading.min()) if len(reading) > 3 * RULES.saturated_readings else ():
        if np.count_nonzero(reading == extreme) < RULES.saturated_readings:
            continue
        way = 1.0 if extreme == reading.max() else -1.0
        edges = np.flatnonzero(np.diff(np.concatenate([[0], (reading == extreme).astype(int), [0]])))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            length = min(b - a, a)
            if b - a < RULES.saturated_readings or length < RULES.saturated_readings:
                continue
            shorter = [n for n in (length // 2, length // 4) if n >= RULES.saturated_readings]
            if _still_moves(way * reading[a - length : a], resolution) or (
                any(_still_moves(way * reading[a - n : a], resolution) for n in shorter)
                and not frozen(reading, resolution)[a:b].any()
            ):
                stuck[a:b] = True
    return stuck


def _still_moves(before: Array, resolution: float) -> bool:
    """Whether readings (n,) rise to their end, by more than their noise, without slowing down."""
    length = len(before)
    noise, ends = max(difference_noise(before), resolution), max(1, length // 8)
    first, last = before[:ends].mean(), before[-ends:].mean()
    middle, between = (before[at - ends // 2 :][:ends].mean() for at in (length // 2, (3 * length) // 4))
    early, late = float(middle - first), float(last - middle)
    slows = float(last - between) < 0.5 * float(between - middle)  # after an event it may rise faster, and settle
    return late > 0.5 * early and late > 4.0 * noise and not slows


def _maybe_frozen(reading: Array) -> NDArray[np.intp]:
    """Rows in which :func:`frozen` may find something: half as many equal readings as it asks for, somewhere."""
    half = RULES.frozen_readings // 2
    m = (reading.shape[1] - 1) // half
    if m < 2:
        return np.empty(0, dtype=np.intp)
    first = reading[:, : m * half : half]
    maybe = np.logical_and.reduce([reading[:, k : m * half + 1 : half][:, :m] == first for k in (1, half // 2, half)])
    rows = np.flatnonzero(maybe.any(axis=1))
    same = reading[rows, 1 : m * half + 1] == reading[rows, : m * half]
    found: NDArray[np.intp] = rows[same.reshape(len(rows), m, half).all(axis=2).any(axis=1)]
    return found


def frozen(reading: Array, resolution: float) -> NDArray[np.bool_]:
    """Readings that only repeat the one before (n,): long runs of them in a record whose noise, of a step at least, forbids it."""
    stuck = np.zeros(len(reading), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (np.diff(reading) == 0.0).astype(int), [0]])))
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):  # readings a to b are equal
        long = max(RULES.frozen_readings, RULES.frozen_share * a)
        if b - a + 1 < long or a < RULES.frozen_readings:
            continue
        # Rounding alone has third differences, too, of three tenths of a step.
        before = reading[max(0, a - RULES.frozen_before) : a]
        noise = third_difference_noise(before)
        if noise > max(resolution, 1e-9) or (b - a) * _log_repeats(before, noise, resolution) < LOG_BY_CHANCE:
            stuck[a + 1 : b + 1] = True
    return stuck


def _log_repeats(reading: Array, noise: float, resolution: float) -> float:
    """Log probability that a reading repeats the one before at most, whatever the temperature, of a noise below a step [K].

    Nought where it may be rounding's: a temperature between two steps that is told as one or the other says nothing of its noise.
    """
    if resolution <= 0.0 or len(reading) < RULES.frozen_readings:
        return 0.0
    at = np.linspace(-1.0, 1.0, len(reading))
    if np.ptp(reading - np.polyval(np.polyfit(at, reading, 2), at)) < 2.0 * resolution:
        return 0.0
    own = math.sqrt(max(noise**2 - resolution**2 / 12.0, 0.0)) / resolution
    return math.log(math.erf(0.5 / (math.sqrt(2.0) * NOISE_SURELY * own))) if own >= RULES.frozen_finer else 0.0


def _blocks(time: Array, reading: Array) -> tuple[Array, Array]:
    """At most BLOCKS means of neighbours: the noise of a fast logger averaged away."""
    if len(reading) <= 2 * BLOCKS:
        return time, reading
    edges = np.linspace(0, len(reading), BLOCKS + 1).astype(int)
    size = np.diff(edges)
    return np.add.reduceat(time, edges[:-1]) / size, np.add.reduceat(reading, edges[:-1]) / size


def _slope(time: Array, reading: Array) -> tuple[float, float]:
    """Slope of a straight line through a stretch and its standard error."""
    t, y = time - time.mean(), reading - reading.mean()
    spread = float(t @ t)
    slope = float(t @ y) / spread
    rest = max(float(y @ y) - slope**2 * spread, 0.0) / max(len(t) - 2, 1)
    return slope, math.sqrt(rest / spread)


def rise_start(time_min: Array, values: Array) -> float | None:
    """When a sensor that was still at first begins to move [min]; 0 if it moves from the start; None if it never does.

    Looked for in ever longer beginnings of the record, the shortest that shows a start decides: what comes later changes nothing,
    and an idle of minutes is seen in a record of days.
    """
    good = np.isfinite(values)
    time, reading = time_min[good], values[good]
    step, count, found = logger_step(reading), 3 * RULES.flat_readings, None
    while True:
        found = _start_within(time[:count], reading[:count], step, count >= len(reading))
        if found or count >= len(reading):
            return found
        count = math.ceil(LONGER * count)


def _start_within(time_min: Array, values: Array, step: float, whole: bool) -> float | None:
    """As :func:`rise_start`, from these readings (n,) of a logger's step [K] alone.

    A still stretch ends where three readings in a row leave its mean by four deviations on one side. It counts as
    still only if it plainly drifts by less than a fifth of the slope that follows: a slow rise under noise is not still. A
    start that would leave less than a third of the readings is believed where these are the `whole` record and what follows is far
    beyond their noise: an idle of hours before a rise of minutes.
    """
    time, reading = _blocks(time_min, values)
    if len(reading) < 3 * RULES.flat_readings:
        return None
    noise = max(difference_noise(reading), step / math.sqrt(12.0), 1e-9)
    count = np.arange(1, len(reading) + 1)
    mean = np.cumsum(reading) / count
    away = (reading[1:] - mean[:-1]) / (noise * np.sqrt(1.0 + 1.0 / count[:-1]))
    side = np.where(np.abs(away) > 4.0, np.sign(away), 0.0)
    thrice = np.flatnonzero((side[:-2] != 0) & (side[:-2] == side[1:-1]) & (side[1:-1] == side[2:]))
    if not len(thrice):
        return None
    still = int(thrice[0]) + 1
    while still > 0 and abs(reading[still - 1] - mean[max(still - 2, 0)]) > 2.0 * noise:
        still -= 1
    fewest = 2 * RULES.flat_readings
    # As much of the rise as was still before, no more than half of it: a fast one is over long before that.
    after = slice(still, max(still + fewest, min(still + max(still, fewest), _half_done(reading, still))))
    late = time[still] > time[0] + 0.67 * (time[-1] - time[0])
    plain = whole and len(reading) - still >= fewest and float(np.abs(reading[still:] - mean[still - 1]).max()) > PLAIN * noise
    if still < RULES.flat_readings or (late and not plain):
        return 0.0
    drift, unsure = _slope(time[:still], reading[:still])
    unsure = max(unsure, step / float(time[still] - time[0]))  # what rounding hides
    rise, rise_unsure = _slope(time[after], reading[after])
    told = abs(rise) > 4.0 * rise_unsure and abs(drift) + 2.0 * unsure < (0.2 if unsure < 0.05 * abs(rise) else 0.5) * abs(rise)
    if told or len(values) <= 2 * BLOCKS or not plain:
        return _bend(time, reading, still) if told else 0.0
    # A rise that is over within some of the means is looked at among those about it.
    about = slice(*np.searchsorted(time_min, [time[max(0, still - BEFORE)], time[min(len(time) - 1, still + BEHIND)]]))
    return _start_within(time_min[about], values[about], step, whole) or 0.0


def _half_done(reading: Array, still: int) -> int:
    """Behind the reading (n,) at which half of what is seen of the rise is done, the first `still` of them about level."""
    away = np.abs(reading[still:] - reading[:still].mean())
    return still + int(np.argmax(away >= 0.5 * away.max())) + 1


def _bend(time: Array, reading: Array, still: int) -> float:
    """Where two straight lines that meet there are nearest to readings (n,), the first `still` of them about level [min].

    The second ends where half of what is seen of the rise is done: the law bends.
    """
    end = max(_half_done(reading, still), still + RULES.flat_readings)
    t, y = time[:end], reading[:end]
    lines = np.stack([np.ones_like(t), t - t[0]], axis=1)

    def left(at: int) -> float:
        through = np.column_stack([lines, np.maximum(t - t[at], 0.0)])
        return float(((y - through @ np.linalg.lstsq(through, y)[0]) ** 2).sum())

    return float(t[min(range(RULES.flat_readings - 1, min(len(t) - 2, still + 1)), key=left)])


def run_start(time_min: Array, channels: list[Array], most: int = 32) -> float:
    """Start of the rise of a run [min]: the first of its sensors to move, 0 if any moves from the first reading."""
    picked = channels[:: max(1, len(channels) // most)]
    starts = [s for s in (rise_start(time_min, c) for c in picked) if s is not None]
    return min(starts, default=0.0)


def left_at_end(weights: Array, sensors: Sensors) -> NDArray[np.intp]:
    """How many of the last readings used (S,) were left out in a row, those of weights (S, n) 0.

    No machine goes faster than its heat drives it: a reading farther from the one before than several times any other step is the
    logger's.
    """
    row = np.zeros(len(weights), dtype=np.intp)
    some = np.flatnonzero(weights[:, -1] == 0.0)
    out, reading = weights[some] == 0.0, sensors.reading[some, : weights.shape[1]]
    last = np.where(out.all(axis=1), 0, out[:, ::-1].argmin(axis=1))
    step = np.abs(np.diff(reading, axis=1))
    usual = np.where(out[:, 1:] | out[:, :-1], 0.0, step).max(axis=1, initial=0.0)
    first = step[np.arange(len(some)), np.minimum(step.shape[1] - last, step.shape[1] - 1)] if step.shape[1] else usual
    row[some] = np.where(first <= RULES.fastest_step * usual, last, 0)
    return row
