"""From one sensor's readings to the records of ``sweep``: the paper's search for the shortest identification time (section 1.5)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Track
from thermofast.models import growth, spike_weights
from thermofast.models.observations import up_to
from thermofast.models.standards import Criterion

from ..errors import rounded
from ..reading import Run
from ..records import IdentifyRecord, SweepRecord
from ..records.columns import Column, Records, Same
from ..standards.stopping import FEWEST, Rule, seen_trips
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
from .identify import identify_sensors
from .measured import measured_equilibrium
from .request import Method, Question
from .rules import RULES
from .sensor import Sensors, Signals, prepare_all, refusal
from .verdicts import doubts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Swept:
    """records, one per window; rmse (windows, times) [K] over times (times,) [min], nan where a time does not count."""

    records: tuple[SweepRecord, ...]
    times: Array
    rmse: Array
    width: Array


@dataclass(frozen=True)
class SweptBlock(Sequence[Swept]):
    """:class:`Swept` of S sensors: records by columns, one per sensor and window; rmse (S, windows, times), width (S, times)."""

    records: Records
    windows: int
    times: Array
    rmse: Array
    width: Array

    @classmethod
    def of(cls, several: Sequence[Swept]) -> "SweptBlock":
        """The same of sensors told one by one, one at least."""
        if isinstance(several, SweptBlock):
            return several
        first = several[0]
        records = Records.of(SweepRecord, [r for one in several for r in one.records])
        rmse, width = np.array([one.rmse for one in several]), np.array([one.width for one in several])
        return cls(records, len(first.records), first.times, rmse, width)

    @classmethod
    def joined(cls, parts: Sequence[Sequence[Swept]]) -> "SweptBlock":
        """All sensors of several, one after another."""
        found = [cls.of(part) for part in parts if len(part)]
        if len(found) == 1:
            return found[0]
        records = Records.joined([one.records for one in found])
        rmse, width = (np.concatenate([getattr(one, n) for one in found]) for n in ("rmse", "width"))
        return cls(records, found[0].windows, found[0].times, rmse, width)

    def taken(self, order: NDArray[np.intp]) -> "SweptBlock":
        """The sensors at these places, in that order."""
        rows = (order[:, None] * self.windows + np.arange(self.windows)).ravel()
        return SweptBlock(self.records.taken(rows), self.windows, self.times, self.rmse[order], self.width[order])

    def without_curves(self) -> "SweptBlock":
        """Records alone."""
        none = np.empty((len(self), 0))
        return replace(self, times=none[0], rmse=none, width=none)

    def __len__(self) -> int:
        return len(self.records) // self.windows

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice):
            return [self[i] for i in range(*key.indices(len(self)))]
        i = range(len(self))[key]
        return Swept(self.records[i * self.windows : (i + 1) * self.windows], self.times, self.rmse[i], self.width[i])


def sweep_sensors(
    signals: Signals, method: Method, windows: tuple[float, ...], times: tuple[float, ...], tolerance_c: float
) -> Sequence[Swept]:
    """RMSE (38) of the model over each window against identification time, from one filter pass, for each of S sensors.

    The result at time I is that of ``identify --until I``: every state and every likelihood rests on the readings up to I alone.
    windows and times [min] are ascending; only times below a window count for it.
    """
    blocks = prepare_all(signals.time_min, signals.values, signals.start_min)
    jobs = [_Block(signals, method, block, windows, np.array(times), tolerance_c) for block in blocks]
    found = [part for job in jobs for part in job.swept()]
    whole = SweptBlock.joined([part for _, part in found])
    order = np.argsort(np.concatenate([rows for rows, _ in found]))
    if not np.array_equal(order, np.arange(len(order))):
        whole = whole.taken(order)
    if not method.widens:
        return whole

    bare = replace(signals, notes=())  # they stand in the sweep's own rows

    def identified(until: float) -> list[IdentifyRecord]:
        return list(identify_sensors(bare, method, Question(until)).records)

    return _with_machine(whole, identified, tolerance_c)


def _with_machine(swept: Sequence[Swept], identified: Callable[[float], list[IdentifyRecord]], tolerance_c: float) -> list[Swept]:
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
            if not doubted and at(high, i).status == "model_doubtful":
                doubted = True
                told.append(
                    f"at {tolerance_time:g} min the model is in doubt, and no more later: identify --until {tolerance_time:g}"
                )
        message = "; ".join(dict.fromkeys(m for m in (*told, head.message) if m))
        status = "model_doubtful" if doubted else "ok"
        found[i] = replace(
            one,
            records=tuple(replace(r, tolerance_time_min=tolerance_time, status=status, message=message) for r in one.records),
        )
    return found


def _half_width(record: IdentifyRecord) -> float:
    """Half-width [K] of a steady state's interval; infinite where a side is open, or it is not determined yet."""
    low, high = record.steady_state_lo_c, record.steady_state_hi_c
    return 0.5 * (high - low) if low is not None and high is not None and record.status != "not_determined" else np.inf


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

    signals: Signals
    method: Method
    sensors: Sensors
    windows: tuple[float, ...]
    times: Array
    tolerance_c: float

    @property
    def count(self) -> int:
        """Readings looked at."""
        return self.sensors.until(max(self.windows[-1], float(self.times[-1])))

    @property
    def ends(self) -> list[int]:
        """Readings of each window."""
        return [min(self.sensors.until(w), self.count) for w in self.windows]

    def swept(self) -> list[tuple[NDArray[np.intp], Sequence[Swept]]]:
        """Rows of the run with what is found of them: those whose likelihood closes at each time together, others one by one."""
        left = np.ones(len(self.sensors), dtype=bool)
        alone: list[tuple[int, Swept]] = []
        for i in self.sensors.maybe_refused(self.windows[-1], RULES.fewest_readings):
            refused = refusal(self.sensors.one(i), self.windows[-1])
            if refused is not None:
                alone.append((i, self._failed(i, refused[0], refused[1], self.signals.note(self.sensors.rows[i]))))
                left[i] = False
        found: list[tuple[NDArray[np.intp], Sequence[Swept]]] = []
        if left.any() and (together := self._together(np.flatnonzero(left))) is not None:
            rows, block = together
            found.append((self.sensors.rows[rows], block))
            left[rows] = False
        alone += [(i, self._alone(i)) for i in np.flatnonzero(left).tolist()]
        if alone:
            found.append((self.sensors.rows[[i for i, _ in alone]], [one for _, one in alone]))
        return found

    def _blank(self, i: int) -> tuple[SweepRecord, ...]:
        channel = self.signals.channels[self.sensors.rows[i]]
        return tuple(SweepRecord(self.signals.run, channel, self.method.filter.name, window_min=w) for w in self.windows)

    def _failed(self, i: int, status: str, *why: str) -> Swept:
        message = "; ".join(m for m in why if m)
        nothing = np.full((len(self.windows), len(self.times)), np.nan)
        return Swept(tuple(replace(b, status=status, message=message) for b in self._blank(i)), self.times, nothing, nothing[0])

    def _indices(self, reading: Array, broken: int) -> NDArray[np.intp]:
        """The last reading before each time, -1 where a time is of no use to a sensor: too early, or the filter broke.

        (S, m) of readings (S, n).
        """
        last = np.searchsorted(self.sensors.time[: self.count], up_to(self.times), "right") - 1
        moved = reading != reading[:, :1]
        first = np.where(moved.any(axis=1), moved.argmax(axis=1), reading.shape[1])
        least = np.maximum(RULES.fewest_readings - 1, first)
        return np.where((last >= least[:, None]) & (last < broken), last, -1)

    def _together(self, rows: NDArray[np.intp]) -> tuple[NDArray[np.intp], SweptBlock] | None:
        """Those of `rows` whose likelihood closes at each time, swept; None where there is none."""
        n, sensors, method = self.count, self.sensors, self.method
        time = sensors.time[:n]
        tracks = tracks_of(method.filter, method.model, time, sensors.reading[rows, :n], sensors.resolution[rows])
        if tracks is None:
            return None
        at = self._indices(sensors.reading[rows, :n], n)
        # All those that can use the same times; the few others go alone.
        usable = at.max(axis=0) >= 0
        same = consistent_until_the_end(method.filter, tracks) & (at[:, usable] >= 0).all(axis=1) & usable.any()
        if not same.any():
            return None
        rows, indices = rows[same], at[same][0][usable]
        chosen = tracks.some(same)
        reading, resolution = np.ascontiguousarray(sensors.reading[rows, :n]), sensors.resolution[rows]
        progress = progresses_of(method.filter, chosen, time, reading, indices, resolution, 2.0 * self.tolerance_c)
        kept = spike_weights(reading, resolution)  # an outlier says nothing about the model: it counts in no window
        squares = progress.stretches.squares(reading, kept, self.ends)
        rmse, width = self._rmse(squares, kept > 0.0, usable), np.full((len(rows), len(self.times)), np.nan)
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
        told = [[*doubted.get(j, []), *sensors.notes[i], self.signals.note(sensors.rows[i])] for j, i in enumerate(rows.tolist())]
        records = self._records(rows, [bool(doubted.get(j)) for j in range(len(rows))], told, rmse, width)
        return rows, SweptBlock(records, len(self.windows), self.times, rmse, width)

    def _records(
        self, rows: NDArray[np.intp], doubtful: Sequence[bool], told: Sequence[Sequence[str]], rmse: Array, width: Array
    ) -> Records:
        """A record for each of these sensors and each window."""
        named = self.signals.run, [self.signals.channels[row] for row in self.sensors.rows[rows].tolist()], self.method.filter.name
        limits = self.tolerance_c, self.method.widens
        return sweep_records(named, doubtful, told, self.windows, self.times, rmse, width, self.ends, *limits)

    def _rmse(self, squares: Array, kept: NDArray[np.bool_], usable: NDArray[np.bool_]) -> Array:
        """RMSE (S, windows, times) [K] from sums of squares (S, m, windows) at the usable times; nan where a time does not count.

        kept (S, n): which readings the sums are of.
        """
        rmse = np.full((len(kept), len(self.windows), len(self.times)), np.nan)
        for j, (window, end) in enumerate(zip(self.windows, self.ends, strict=True)):
            if end > 1:
                number = kept[:, :end].sum(axis=1) - 1
                with np.errstate(all="ignore"):
                    rmse[:, j, usable] = np.sqrt(squares[:, :, j] / np.where(number > 0, number, np.nan)[:, None])
            rmse[:, j, self.times >= window - 1e-9] = np.nan
        return rmse

    def _alone(self, i: int) -> Swept:
        n, sensor, method, note = self.count, self.sensors.one(i), self.method, self.signals.note(self.sensors.rows[i])
        time, reading = sensor.time[:n], sensor.reading[:n]
        try:
            track = track_of(method.filter, method.model, time, reading, sensor.resolution)
        except FilterError as error:
            return self._failed(i, "diverged", str(error))
        at = self._indices(reading[None], track.diverged_at if track.diverged_at is not None else n)[0]
        usable = at >= 0
        rmse, width = np.full((1, len(self.windows), len(self.times)), np.nan), np.full((1, len(self.times)), np.nan)
        doubted: list[str] = []
        if usable.any():
            indices = at[usable].tolist()
            progress = estimates_at(
                method.model, method.filter, track, time, reading, indices, sensor.resolution, 2.0 * self.tolerance_c
            )
            errors = window_errors(progress, indices, track.state, time, reading)
            kept = spike_weights(reading, sensor.resolution)
            sums = np.concatenate([np.zeros((len(indices), 1)), np.cumsum(kept * errors**2, axis=1)], axis=1)
            rmse = self._rmse(sums[None][..., self.ends], kept[None] > 0.0, usable)
            width[0, usable] = progress.width
            if not progress.sound and not method.widens:
                last = estimate_at(method.model, method.filter, track, time, reading, indices[-1], sensor.resolution)
                doubted = doubts(last, int(np.argmax(track.fading > 1.0)), sensor)
        records = self._records(np.array([i]), [bool(doubted)], [[*doubted, *sensor.notes, note]], rmse, width)
        return Swept(tuple(records), self.times, rmse[0], width[0])


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
    named: tuple[str, Sequence[str], str],
    doubtful: Sequence[bool],
    messages: Sequence[Sequence[str]],
    windows: tuple[float, ...],
    times: Array,
    rmse: Array,
    width: Array,
    ends: list[int],
    tolerance_c: float,
    machine_follows: bool = False,
) -> Records:
    """Records of S sensors, for each of its windows, by docs/architecture.md.

    named: run, the sensors' channels, filter; rmse (S, windows, times) [K], width (S, times) [K]. machine_follows: widths are those
    of the readings alone, and what is said of them waits for what the machine adds.
    """
    counted = np.isfinite(rmse)
    least = np.where(counted, rmse, np.inf)
    some: NDArray[np.bool_] = np.asarray(np.all(counted.any(axis=2), axis=1))
    best = least.argmin(axis=2)
    smallest = least.min(axis=2)
    # From the earliest time on the RMSE stays within (1 + 2 / sqrt(2 N)) of its minimum.
    with np.errstate(invalid="ignore"):
        limit = smallest * (1.0 + 2.0 / np.sqrt(2.0 * np.array(ends)))
        outside = np.asarray(counted & (rmse > limit[..., None]))
    after = np.where(outside.any(axis=2), len(times) - outside[..., ::-1].argmax(axis=2), 0)
    earliest = np.maximum(after, counted.argmax(axis=2))
    serves = np.asarray((counted & (np.arange(len(times)) >= earliest[..., None])).any(axis=2))
    # The least error of a few early times is no least error: it must lie between others, or no time be left to try.
    tried, last = counted.sum(axis=2), len(times) - 1 - counted[..., ::-1].argmax(axis=2)
    few = ((best == last) & (times[last] < RULES.tried_until * np.array(windows))) | (tried < RULES.fewest_times)
    serves &= ~few
    with np.errstate(invalid="ignore"):
        narrow = _from_there_on(width < 2.0 * tolerance_c)
    at = times[np.minimum(earliest, len(times) - 1)]
    shortest, first = at.max(axis=1), at.min(axis=1)
    served: NDArray[np.bool_] = np.asarray(serves.all(axis=1)) & some
    agreed: NDArray[np.bool_] = np.asarray(shortest - first <= RULES.agreed_min + 1e-9)
    said = []
    for s, message in enumerate(messages):
        told = [m for m in message if m]
        if not some[s]:
            bad = ", ".join(f"{w:g}" for w, good in zip(windows, counted[s].any(axis=1), strict=True) if not good)
            said.append("; ".join([f"no identification time gave a model for the window of {bad} min", *told]))
            continue
        if narrow[s] < 0 and not machine_follows:
            finite = width[s][np.isfinite(width[s])]
            reached = f" (narrowest {rounded(0.5 * finite.min())} K)" if len(finite) and finite.min() > 2.0 * tolerance_c else ""
            told.insert(0, f"the steady state is not known to +-{tolerance_c:g} K at any of these times{reached}: measure longer")
        if not served[s]:
            none = ", ".join(f"{w:g}" for w, good in zip(windows, serves[s], strict=True) if not good)
            why, w = "at the last the error is above its least; say longer --times", int(few[s].argmax())
            if few[s, w]:
                inside = f"{tried[s, w]} of the times tried lie{'s' if tried[s, w] == 1 else ''} within that of {windows[w]:g} min"
                why = f"{inside}, up to {times[last[s, w]]:g} min; say --times that go on to its end"
            told.insert(0, f"no time tried serves for the window of {none} min: {why}")
        said.append("; ".join(told))
    status = np.where(some, np.where(np.asarray(doubtful, dtype=bool), "model_doubtful", "ok"), "diverged").tolist()
    run, channels, name = named
    each, sound = len(windows), some[:, None]

    def of_sensor(values: Sequence[Any]) -> list[Any]:
        return [v for v in values for _ in range(each)]

    columns: dict[str, Column] = {
        "run": Same(run),
        "channel": of_sensor(channels),
        "filter": Same(name),
        "window_min": np.tile(np.asarray(windows, dtype=float), len(channels)),
        "best_time_min": np.where(sound, times[best], np.nan).ravel(),
        "rmse_c": np.where(sound, smallest, np.nan).ravel(),
        "earliest_time_min": np.where(serves & sound, at, np.nan).ravel(),
        "shortest_time_min": np.repeat(np.where(served, shortest, np.nan), each),
        "tolerance_time_min": np.repeat(np.where((narrow >= 0) & some, times[narrow], np.nan), each),
        "agreed": of_sensor([a if s else None for a, s in zip(agreed.tolist(), served.tolist(), strict=True)]),
        "status": of_sensor(status),
        "message": of_sensor(said),
    }
    return Records(SweepRecord, len(channels) * each, columns)


def _from_there_on(good: NDArray[np.bool_]) -> NDArray[np.intp]:
    """First column of each row (S, m) from which all are true, -1 where there is none."""
    bad = ~good[:, ::-1]
    first = np.where(bad.any(axis=1), good.shape[1] - bad.argmax(axis=1), 0)
    return np.where(first < good.shape[1], first, -1)


#: What is said where a rule holds and the record does not show what is missing then.
GOES_ON = (
    "the record goes on at its end: what is missing when the rule holds is not read from it (identify --criterion foretells it)"
)


def with_trips(records: Sequence[SweepRecord], criterion: Criterion, started: Sequence[tuple[Run, float]]) -> list[SweepRecord]:
    """The records, with when the rule holds on each sensor's whole record, and what a complete one shows to be missing then."""
    of = {run.name: (run, start) for run, start in started}
    rules = {run.name: Rule.of(criterion, run, start, None) for run, start in started}
    told: dict[tuple[str, str], dict[str, Any]] = {}
    said: dict[tuple[str, str], str] = {}
    for key in dict.fromkeys((r.run, r.channel) for r in records):
        run, start = of[key[0]]
        values = run.channels.get(key[1], np.empty(0))
        minutes = run.time_s[: len(values)] / 60.0
        good = np.isfinite(values) & (minutes >= start)
        if good.sum() < FEWEST:
            continue
        time, reading = minutes[good], values[good]
        trips, there, _ = seen_trips(rules[run.name], time, reading[None])
        steady = measured_equilibrium(time, reading)
        trip = float(trips[0]) if math.isfinite(trips[0]) else None
        missing = steady[0] - float(there[0]) if steady is not None and trip is not None else None
        told[key] = {"criterion": criterion.text, "trip_min": None if trip is None else trip - start, "missing_k": missing}
        said[key] = GOES_ON if trip is not None and missing is None else ""
    keys = [(r.run, r.channel) for r in records]
    message = ["; ".join(filter(None, (r.message, said.get(key)))) for key, r in zip(keys, records, strict=True)]
    return [replace(r, message=m, **told.get(key, {})) for key, r, m in zip(keys, records, message, strict=True)]
