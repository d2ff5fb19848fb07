"""From one sensor's readings to the records of ``sweep``: the paper's search for the shortest identification time (section 1.5)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Track
from thermofast.models import growth, spike_weights

from ..errors import rounded
from ..records import IdentifyRecord, SweepRecord
from .closing import (
    Progress,
    consistent_until_the_end,
    estimate_at,
    estimates_at,
    estimates_of,
    progresses_of,
    track_of,
    tracks_of,
)
from .estimate import FilterError
from .identify import Method, identify_sensors
from .rules import RULES
from .sensor import Sensors, prepare_all, refusal
from .verdicts import doubts

Array = NDArray[np.float64]

#: Model values worked on at once: more fall out of the processor's cache and pay nothing.
ELEMENTS = 400_000


@dataclass(frozen=True)
class Swept:
    """records, one per window; rmse (windows, times) [K] over times (times,) [min], nan where a time does not count."""

    records: tuple[SweepRecord, ...]
    times: Array
    rmse: Array
    width: Array


def sweep_sensors(
    run: str,
    channels: Sequence[str],
    time_min: Array,
    values: Array,
    method: Method,
    windows: tuple[float, ...],
    times: tuple[float, ...],
    tolerance_c: float,
    start_min: float = 0.0,
    notes: Sequence[str] = (),
    room: Array | None = None,
) -> list[Swept]:
    """RMSE (38) of the model over each window against identification time, from one filter pass, for S sensors values (S, N).

    The result at time I is that of ``identify --until I``: every state and every likelihood rests on the readings up to I alone.
    windows and times [min] are ascending; only times below a window count for it.
    """
    notes = tuple(notes) or ("",) * len(channels)
    found: list[Swept | None] = [None] * len(channels)
    for block in prepare_all(time_min, values, start_min):
        job = _Block(run, channels, method, block, windows, np.array(times), tolerance_c, notes)
        for row, swept in zip(block.rows.tolist(), job.swept(), strict=True):
            found[row] = swept
    whole = [one for one in found if one is not None]
    if not method.widens:
        return whole

    def identified(until: float) -> list[IdentifyRecord]:
        return list(identify_sensors(run, channels, time_min, values, method, until, start_min, room=room).records)

    return _with_machine(whole, identified, tolerance_c)


def _with_machine(swept: list[Swept], identified: Callable[[float], list[IdentifyRecord]], tolerance_c: float) -> list[Swept]:
    """Status, and time from which the interval that counts the machine is narrow enough, by the records of ``identify``.

    identified gives those of all sensors at a time [min]. Half-widths are taken to fall, and the time is looked for by halving.
    """
    known: dict[int, list[IdentifyRecord]] = {}

    def at(k: int, i: int) -> IdentifyRecord:
        if k not in known:
            known[k] = identified(float(times[k]))
        return known[k][i]

    found = list(swept)
    for i, one in enumerate(swept):
        head, times = one.records[0], one.times
        if head.status not in ("ok", "model_doubtful"):
            continue
        low, high = 0, len(times) - 1
        last = at(high, i)
        doubted = last.status == "model_doubtful"
        told = [last.message] if doubted else []
        if _half_width(last) >= tolerance_c:
            told.insert(0, _not_known(last, float(times[-1]), head.tolerance_time_min, tolerance_c))
            tolerance_time = None
        else:
            while low < high:
                middle = (low + high) // 2
                low, high = (low, middle) if _half_width(at(middle, i)) < tolerance_c else (middle + 1, high)
            tolerance_time = float(times[high])
        message = "; ".join(dict.fromkeys(m for m in (*told, head.message) if m))
        status = "model_doubtful" if doubted else "ok"
        found[i] = replace(
            one,
            records=tuple(replace(r, tolerance_time_min=tolerance_time, status=status, message=message) for r in one.records),
        )
    return found


def _half_width(record: IdentifyRecord) -> float:
    """Half-width [K] of a steady state's interval; infinite where a side is open."""
    low, high = record.steady_state_lo_c, record.steady_state_hi_c
    return 0.5 * (high - low) if low is not None and high is not None else np.inf


def _not_known(last: IdentifyRecord, at_min: float, alone_min: float | None, tolerance_c: float) -> str:
    """What to say where the interval is too wide at the last time; alone_min [min] is when the readings alone would do."""
    half = _half_width(last)
    reached = f"{half:.3g} K at {at_min:g} min" if np.isfinite(half) else f"no bound yet at {at_min:g} min"
    why = f"the steady state is not known to +-{tolerance_c:g} K at any of these times ({reached}): "
    if alone_min is not None:
        return f"{why}the machine is the limit, not the readings, which alone would do at {alone_min:g} min"
    return f"{why}measure longer"


@dataclass(frozen=True)
class _Block:
    """Sensors of one run on one grid, on their way from readings to the records of a sweep."""

    run: str
    channels: Sequence[str]
    method: Method
    sensors: Sensors
    windows: tuple[float, ...]
    times: Array
    tolerance_c: float
    notes: Sequence[str]

    @property
    def count(self) -> int:
        """Readings looked at."""
        return self.sensors.until(max(self.windows[-1], float(self.times[-1])))

    @property
    def ends(self) -> list[int]:
        """Readings of each window."""
        return [min(self.sensors.until(w), self.count) for w in self.windows]

    def swept(self) -> list[Swept]:
        """Of every sensor: those whose likelihood closes at each time together, the others one by one."""
        found: dict[int, Swept] = {}
        for i in self.sensors.maybe_refused(self.windows[-1], RULES.fewest_readings):
            refused = refusal(self.sensors.one(i), self.windows[-1])
            if refused is not None:
                found[i] = self._failed(i, refused[0], refused[1], self.notes[self.sensors.rows[i]])
        going = np.array([i for i in range(len(self.sensors)) if i not in found], dtype=np.intp)
        if len(going):
            for chunk in np.array_split(going, -(-len(going) * len(self.times) * self.count // ELEMENTS)):
                self._together(chunk, found)
        for i in range(len(self.sensors)):
            if i not in found:
                found[i] = self._alone(i)
        return [found[i] for i in range(len(self.sensors))]

    def _blank(self, i: int) -> tuple[SweepRecord, ...]:
        channel = self.channels[self.sensors.rows[i]]
        return tuple(SweepRecord(self.run, channel, self.method.filter.name, window_min=w) for w in self.windows)

    def _failed(self, i: int, status: str, *why: str) -> Swept:
        message = "; ".join(m for m in why if m)
        nothing = np.full((len(self.windows), len(self.times)), np.nan)
        return Swept(tuple(replace(b, status=status, message=message) for b in self._blank(i)), self.times, nothing, nothing[0])

    def _indices(self, reading: Array, broken: int) -> NDArray[np.intp]:
        """The last reading before each time (m,), -1 where a time is of no use to a sensor: too early, or the filter broke."""
        last = np.searchsorted(self.sensors.time[: self.count], self.times * (1 + 1e-12) + 1e-9, "right") - 1
        moved = np.flatnonzero(reading != reading[0])
        least = max(RULES.fewest_readings - 1, int(moved[0]) if len(moved) else len(reading))
        return np.where((last >= least) & (last < broken), last, -1)

    def _together(self, rows: NDArray[np.intp], found: dict[int, Swept]) -> None:
        """Sweep those of `rows` whose likelihood closes at each time."""
        n, sensors, method = self.count, self.sensors, self.method
        time = sensors.time[:n]
        tracks = tracks_of(method.filter, method.model, time, sensors.reading[rows, :n], sensors.resolution[rows])
        if tracks is None:
            return
        at = np.array([self._indices(sensors.reading[i, :n], n) for i in rows])
        # All those that can use the same times; the few others go alone.
        usable = at.max(axis=0) >= 0
        same = consistent_until_the_end(method.filter, tracks, n) & (at[:, usable] >= 0).all(axis=1) & usable.any()
        if not same.any():
            return
        rows, indices = rows[same], at[same][0][usable]
        chosen = tracks.some(same)
        reading, resolution = sensors.reading[rows, :n], sensors.resolution[rows]
        progress = progresses_of(method.filter, chosen, time, reading, indices, resolution, 2.0 * self.tolerance_c)
        errors = progress.state[..., :1] + progress.state[..., 1:2] * growth(progress.state[..., 2:], time - time[indices][:, None])
        errors -= reading[:, None, :]
        rmse, width = self._rmse(errors, reading, resolution, usable), np.full((len(rows), len(self.times)), np.nan)
        width[:, usable] = progress.width
        doubted: dict[int, list[str]] = {}
        # Where the machine is counted, what it does is no doubt: see _with_machine.
        unsure = np.flatnonzero(~progress.sound & (not method.widens))
        if len(unsure):
            k = int(indices[-1]) + 1
            part = chosen.some(unsure)
            ended = replace(part, weight=part.weight[:, :k], woke=np.minimum(part.woke, k - 1))
            block = time[:k], reading[unsure, :k], resolution[unsure]
            last = estimates_of(method.model, method.filter, ended, *block, _no_track)
            doubted = {
                int(j): doubts(last.one(i), int(ended.woke[i]), sensors.one(int(rows[j]))) for i, j in enumerate(unsure.tolist())
            }
        told = [[*doubted.get(j, []), *sensors.notes[i], self.notes[sensors.rows[i]]] for j, i in enumerate(rows.tolist())]
        blanks = [self._blank(i) for i in rows.tolist()]
        doubtful = [bool(doubted.get(j)) for j in range(len(rows))]
        limits = self.tolerance_c, method.widens
        records = sweep_records(blanks, doubtful, told, self.windows, self.times, rmse, width, self.ends, *limits)
        for j, i in enumerate(rows.tolist()):
            found[i] = Swept(records[j], self.times, rmse[j], width[j])

    def _rmse(self, errors: Array, reading: Array, resolution: Array, usable: NDArray[np.bool_]) -> Array:
        """RMSE (S, windows, times) [K] from errors (S, m, n) at the usable times; nan where a time does not count."""
        # An outlier says nothing about the model: it counts in no window.
        kept = spike_weights(reading, resolution) > 0.0
        squares = np.cumsum(errors**2 * kept[:, None, :], axis=2)
        counts = np.cumsum(kept, axis=1)
        rmse = np.full((len(reading), len(self.windows), len(self.times)), np.nan)
        for j, (window, end) in enumerate(zip(self.windows, self.ends, strict=True)):
            if end > 1:
                number = counts[:, end - 1] - 1
                with np.errstate(all="ignore"):
                    rmse[:, j, usable] = np.sqrt(squares[:, :, end - 1] / np.where(number > 0, number, np.nan)[:, None])
            rmse[:, j, self.times >= window - 1e-9] = np.nan
        return rmse

    def _alone(self, i: int) -> Swept:
        n, sensor, method, note = self.count, self.sensors.one(i), self.method, self.notes[self.sensors.rows[i]]
        time, reading = sensor.time[:n], sensor.reading[:n]
        try:
            track = track_of(method.filter, method.model, time, reading, sensor.resolution)
        except FilterError as error:
            return self._failed(i, "diverged", str(error))
        at = self._indices(reading, track.diverged_at if track.diverged_at is not None else n)
        usable = at >= 0
        rmse, width = np.full((1, len(self.windows), len(self.times)), np.nan), np.full((1, len(self.times)), np.nan)
        doubted: list[str] = []
        if usable.any():
            indices = at[usable].tolist()
            progress = estimates_at(
                method.model, method.filter, track, time, reading, indices, sensor.resolution, 2.0 * self.tolerance_c
            )
            errors = window_errors(progress, indices, track.state, time, reading)
            rmse = self._rmse(errors[None], reading[None], np.array([sensor.resolution]), usable)
            width[0, usable] = progress.width
            if not progress.sound and not method.widens:
                last = estimate_at(method.model, method.filter, track, time, reading, indices[-1], sensor.resolution)
                doubted = doubts(last, int(np.argmax(track.fading > 1.0)), sensor)
        told = [[*doubted, *sensor.notes, note]]
        blank = [self._blank(i)]
        limits = self.tolerance_c, method.widens
        records = sweep_records(blank, [bool(doubted)], told, self.windows, self.times, rmse, width, self.ends, *limits)
        return Swept(records[0], self.times, rmse[0], width[0])


def _no_track(_: int) -> Track:
    raise FilterError("a sensor whose likelihood closes needs no track")


def window_errors(progress: Progress, indices: list[int], states: Array, time: Array, reading: Array) -> Array:
    """Model minus reading (m, n) [K] over all readings: the free run both ways from reading indices[i].

    Where the filter has forgotten its past, its own track stands for the readings up to then, as in the paper's figures.
    """
    since = time - time[indices][:, None]
    model = progress.state[:, :1] + progress.state[:, 1:2] * growth(progress.state[:, 2:], since)
    for i in np.flatnonzero(progress.faded):
        k = indices[i]
        tracked = np.isfinite(states[: k + 1, 0])
        model[i, : k + 1] = np.where(tracked, states[: k + 1, 0], reading[: k + 1])
    errors: Array = model - reading
    return errors


def sweep_records(
    blanks: Sequence[tuple[SweepRecord, ...]],
    doubtful: Sequence[bool],
    messages: Sequence[Sequence[str]],
    windows: tuple[float, ...],
    times: Array,
    rmse: Array,
    width: Array,
    ends: list[int],
    tolerance_c: float,
    machine_follows: bool = False,
) -> list[tuple[SweepRecord, ...]]:
    """Records of S sensors from their errors rmse (S, windows, times) [K] and widths (S, times) [K] by docs/architecture.md.

    machine_follows: widths are those of the readings alone, and what is said of them waits for what the machine adds.
    """
    counted = np.isfinite(rmse)
    least = np.where(counted, rmse, np.inf)
    some = np.asarray(counted.any(axis=2))
    best = least.argmin(axis=2)
    smallest = least.min(axis=2)
    # From the earliest time on the RMSE stays within (1 + 2 / sqrt(2 N)) of its minimum.
    with np.errstate(invalid="ignore"):
        limit = smallest * (1.0 + 2.0 / np.sqrt(2.0 * np.array(ends)))
        outside = np.asarray(counted & (rmse > limit[..., None]))
    after = np.where(outside.any(axis=2), len(times) - outside[..., ::-1].argmax(axis=2), 0)
    earliest = np.maximum(after, counted.argmax(axis=2))
    serves = np.asarray((counted & (np.arange(len(times)) >= earliest[..., None])).any(axis=2))
    with np.errstate(invalid="ignore"):
        narrow = _from_there_on(width < 2.0 * tolerance_c)
    records = []
    for s, blank in enumerate(blanks):
        told = [m for m in messages[s] if m]
        if not some[s].all():
            bad = ", ".join(f"{w:g}" for w, good in zip(windows, some[s], strict=True) if not good)
            message = "; ".join([f"no identification time gave a model for the window of {bad} min", *told])
            records.append(tuple(replace(b, status="diverged", message=message) for b in blank))
            continue
        if narrow[s] < 0 and not machine_follows:
            finite = width[s][np.isfinite(width[s])]
            reached = f" (narrowest {rounded(0.5 * finite.min())} K)" if len(finite) and finite.min() > 2.0 * tolerance_c else ""
            told.insert(0, f"the steady state is not known to +-{tolerance_c:g} K at any of these times{reached}: measure longer")
        shortest, agreed = None, None
        if serves[s].all():
            shortest = float(times[earliest[s].max()])
            agreed = shortest - float(times[earliest[s].min()]) <= RULES.agreed_min + 1e-9
        else:
            none = ", ".join(f"{w:g}" for w, good in zip(windows, serves[s], strict=True) if not good)
            why = "at the last the error is above its least; say longer --times"
            told.insert(0, f"no time tried serves for the window of {none} min: {why}")
        status, message = "model_doubtful" if doubtful[s] else "ok", "; ".join(told)
        tolerance_time = None if narrow[s] < 0 else float(times[narrow[s]])
        records.append(
            tuple(
                SweepRecord(
                    b.run,
                    b.channel,
                    b.filter,
                    b.window_min,
                    best_time_min=float(times[best[s, j]]),
                    rmse_c=float(smallest[s, j]),
                    earliest_time_min=float(times[earliest[s, j]]) if serves[s, j] else None,
                    shortest_time_min=shortest,
                    tolerance_time_min=tolerance_time,
                    agreed=agreed,
                    status=status,
                    message=message,
                )
                for j, b in enumerate(blank)
            )
        )
    return records


def _from_there_on(good: NDArray[np.bool_]) -> NDArray[np.intp]:
    """First column of each row (S, m) from which all are true, -1 where there is none."""
    bad = ~good[:, ::-1]
    first = np.where(bad.any(axis=1), good.shape[1] - bad.argmax(axis=1), 0)
    return np.where(first < good.shape[1], first, -1)
