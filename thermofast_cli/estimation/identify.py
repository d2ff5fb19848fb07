"""From one sensor's readings to one record of ``identify``. Pure: arrays in, records out."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.filters import Afukf, Track, Tracks
from thermofast.models import spike_weights
from thermofast.models.imperfection import room_at_end
from thermofast.models.search.logged import follows_machine

from ..records import IdentifyRecord
from ..records.columns import Column, Records, Same, numbers_of
from ..standards.stopping import Trips, columns_of, trips_of
from .closing import estimates_of, track_of, tracks_of, tracks_together
from .curves import Curves, curves_of, drawn_to, trace_columns
from .estimate import Claims, Estimates, FilterError, lost, remaining, said_of_slow, times_asked, why_let_go, without_past
from .imperfect import Closed, claims, together_of
from .measured import (
    against_claims,
    begun_as_read,
    comes_back,
    contradicts,
    counted_to,
    in_room,
    measured_equilibria,
    moved_by_room,
    room_at,
    steadied,
    swinging,
    until_then,
    with_claims,
)
from .request import EVERYTHING, Method, Question
from .rules import RULES
from .sensor import Sensors, Signals, prepare_all, refusal
from .verdicts import claimed_verdicts, law_verdicts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Identified:
    """What is found of one sensor; trace and curves only where they are asked for."""

    record: IdentifyRecord
    trace: dict[str, Array] | None = None
    curves: Curves | None = None


@dataclass(frozen=True)
class Found(Sequence[Identified]):
    """What a worker hands back for its sensors, :class:`Identified` each: their records by columns.

    details (S): trace and curves of each, where they are asked for; else ().
    """

    records: Records
    details: tuple[tuple[dict[str, Array] | None, Curves | None], ...] = ()

    @classmethod
    def of(cls, several: Sequence[Identified]) -> "Found":
        """The same of sensors told one by one."""
        if isinstance(several, Found):
            return several
        told = tuple((one.trace, one.curves) for one in several)
        return cls(Records.of(IdentifyRecord, [one.record for one in several]), told if any(t or c for t, c in told) else ())

    @classmethod
    def joined(cls, parts: Sequence[Sequence[Identified]]) -> "Found":
        """All sensors of several, one after another."""
        found = [cls.of(part) for part in parts if len(part)]
        if not found:
            return cls(Records.of(IdentifyRecord, []))
        asked = any(one.details for one in found)
        details = tuple(d for one in found for d in (one.details or ((None, None),) * len(one))) if asked else ()
        return cls(Records.joined([one.records for one in found]), details)

    def taken(self, order: NDArray[np.intp]) -> "Found":
        """The sensors at these places, in that order."""
        return Found(self.records.taken(order), tuple(self.details[i] for i in order.tolist()) if self.details else ())

    def __len__(self) -> int:
        return len(self.records)

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice):
            return [self[i] for i in range(*key.indices(len(self)))]
        return Identified(self.records[key], *(self.details[key] if self.details else ()))


def identify_sensors(signals: Signals, method: Method, question: Question = EVERYTHING) -> Found:
    """Records of S sensors from their readings.

    Trouble with a sensor is a status in its record, never an exception.

    Raises
    ------
    TypeError: one filter over all sensors is asked for, and the filter is not the AFUKF.
    """
    if question.together and not isinstance(method.filter, Afukf):
        raise TypeError(f"one filter over all sensors is the AFUKF, not {method.filter.name}")
    blocks, refused = _prepared(signals, method, question)
    shared: dict[int, Track] = {}
    if question.together and isinstance(method.filter, Afukf):
        shared = tracks_together(method.model, method.filter, blocks, question.until_min)
    jobs = [_Block(signals, method, question, block) for block in blocks]
    opened = [job.opened(shared) for job in jobs]
    claimed = _claims(jobs, opened, method)
    parts = [job.identified(o, c) for job, o, c in zip(jobs, opened, claimed, strict=True)]
    whole = Found.joined([*parts, list(refused.values())])
    rows = np.concatenate([*(b.rows for b in blocks), np.array(list(refused), dtype=np.intp)])
    order = np.argsort(rows)
    return whole if np.array_equal(order, np.arange(len(order))) else whole.taken(order)


def _filter_name(method: Method, question: Question) -> str:
    return f"{method.filter.name} (joint)" if question.together else method.filter.name


def _prepared(signals: Signals, method: Method, question: Question) -> tuple[list[Sensors], dict[int, Identified]]:
    """The sensors made ready, those with the same times together; and by row those in which there is nothing to identify."""
    until, blocks, refused = question.until_min, [], {}
    for block in prepare_all(signals.time_min, signals.values, signals.start_min):
        keep = np.ones(len(block), dtype=bool)
        for i in block.maybe_refused(until, RULES.fewest_readings):
            why = refusal(block.one(i), until, signals.start_min)
            if why is not None:
                refused[int(block.rows[i])] = _refused(signals, method, question, int(block.rows[i]), *why)
                keep[i] = False
        if keep.any():
            block = block if keep.all() else block.some(keep)
            blocks.append(_without_swing(block, signals, method, until))
    return blocks, refused


def _refused(signals: Signals, method: Method, question: Question, row: int, status: str, why: str, samples: int) -> Identified:
    told = signals.run, signals.channels[row], _filter_name(method, question), question.until_min, samples, signals.start_min
    return Identified(IdentifyRecord(*told, status=status, message=_joined([why, signals.note(row)])))


def _without_swing(block: Sensors, signals: Signals, method: Method, until_min: float | None) -> Sensors:
    """Sensors without a swing that goes on all the time, or with it where a model of the machine foretells it."""
    told = until_min, together_of(method.rates)
    if method.steadies:
        last = float(block.time[block.until(until_min) - 1])
        return steadied(block, *told, room_at(signals.time_min, signals.room, block.time, last))
    return swinging(block, *told) if method.past is not None and method.past.cycles else block


@dataclass(frozen=True)
class _Opened:
    """What filter and likelihood say of a block: None where the filter ran on no sensor; and why it broke on some."""

    tracks: Tracks | None
    found: Estimates | None
    single: Callable[[int], Track]
    broken: dict[int, str]


def _claims(jobs: Sequence["_Block"], opened: Sequence[_Opened], method: Method) -> list[Claims | None]:
    """What the sensors of each block may claim, all blocks of a run together; None where the law is all."""
    live = [i for i, o in enumerate(opened) if o.found is not None]
    claimed: list[Claims | None] = [None] * len(jobs)
    if not live or not method.widens:
        return claimed
    closed, drawn = [], None
    for i in live:
        job, found = jobs[i], opened[i].found
        assert found is not None
        usable = np.array([k not in opened[i].broken for k in range(len(job.sensors))])
        closed.append(Closed(job.sensors, job.count, found, usable, job.surroundings))
        if job.question.details:
            begin, end = float(job.sensors.time[0]), float(job.sensors.time[-1])
            if job.count == len(job.sensors.time):
                end = drawn_to(begin, end, float(np.nanmax(np.append(found.t95, 0.0))))
            drawn = (begin, end) if drawn is None else (min(drawn[0], begin), max(drawn[1], end))
    signals, question = jobs[0].signals, jobs[0].question
    at_min = None if question.at_min is None else question.at_min + signals.start_min
    end = float(signals.time_min[-1])
    last = end if question.until_min is None else min(question.until_min, end)
    times = times_asked(last, end, at_min, drawn, bool(method.past and method.past.rises))
    given = method.imperfection, method.rates
    found_all = claims(closed, times, *given, lambda row: signals.channels[row], method.past, question.rule)
    for i, one in zip(live, found_all, strict=True):
        claimed[i] = one
    return claimed


@dataclass(frozen=True)
class _Block:
    """Sensors of one run on one grid, on their way from readings to records."""

    signals: Signals
    method: Method
    question: Question
    sensors: Sensors

    @property
    def count(self) -> int:
        return self.sensors.until(self.question.until_min)

    @cached_property
    def surroundings(self) -> Array | None:
        """The room at the sensors' times (N,) [degC]; None where none is logged, or where it moves with the machine."""
        room, n = self.logged, self.count
        return None if room is None or follows_machine(self.sensors.reading[:, :n], room[:n]) else room

    @cached_property
    def logged(self) -> Array | None:
        """The room as logged at the sensors' times (N,) [degC]; None where that is too little."""
        return room_at(self.signals.time_min, self.signals.room, self.sensors.time, float(self.sensors.time[self.count - 1]))

    def opened(self, shared: dict[int, Track]) -> _Opened:
        """Filter and likelihood of every sensor; `shared` holds the tracks by row where one filter has run over all."""
        tracks, single, failed = self._tracks(shared)
        if tracks is None:
            return _Opened(None, None, single, failed)
        broken = {i: self._broke_at(int(k)) for i, k in enumerate(tracks.diverged_at) if k >= 0} | failed
        n, sensors = self.count, self.sensors
        time, reading = sensors.time[:n], sensors.reading[:, :n]
        found = estimates_of(self.method.model, self.method.filter, tracks, time, reading, sensors.resolution, single)
        return _Opened(tracks, found, single, lost(found, reading) | broken)

    def identified(self, opened: _Opened, claimed: Claims | None) -> Found:
        """Of every sensor, with what it may claim."""
        if opened.tracks is None or opened.found is None:
            return Found.of([Identified(self._diverged(i, opened.broken[i])) for i in range(len(self.sensors))])
        records = self._records(opened.found, opened.tracks, opened.broken, claimed)
        if not self.question.details:
            return Found(records)
        found, single = opened.found, opened.single
        details = [
            self._pictures(i, record, found, single, claimed) if i not in opened.broken else (None, None)
            for i, record in enumerate(records)
        ]
        return Found(records, tuple(details))

    def _tracks(self, shared: dict[int, Track]) -> tuple[Tracks | None, Callable[[int], Track], dict[int, str]]:
        """What the filter makes of all; a sensor's whole track, where it is asked for; and why it could not run on some."""
        sensors, method, n = self.sensors, self.method, self.count
        time, reading = sensors.time[:n], sensors.reading[:, :n]
        known: dict[int, Track] = {i: shared[row] for i, row in enumerate(sensors.rows.tolist()) if row in shared}

        def single(i: int) -> Track:
            if i not in known:
                known[i] = track_of(method.filter, method.model, time, reading[i], float(sensors.resolution[i]))
            return known[i]

        if not known and not self.question.details:
            tracks = tracks_of(method.filter, method.model, time, reading, sensors.resolution)
            if tracks is not None:
                return tracks, single, {}
        failed: dict[int, str] = {}
        for i in range(len(sensors)):
            try:
                single(i)
            except FilterError as error:
                failed[i] = str(error)
        if not known:
            return None, single, failed
        some = next(iter(known.values()))
        tracks = Tracks.of([known.get(i, replace(some, diverged_at=0)) for i in range(len(sensors))])
        return tracks, single, failed

    def _broke_at(self, k: int) -> str:
        return f"the filter diverged at reading {k + 1}, {self.sensors.time[k]:.4g} min"

    def _diverged(self, i: int, why: str) -> IdentifyRecord:
        found = _refused(self.signals, self.method, self.question, int(self.sensors.rows[i]), "diverged", why, self.count)
        return found.record

    def _records(self, law: Estimates, tracks: Tracks, broken: dict[int, str], claimed: Claims | None) -> Records:
        sensors, signals, n = self.sensors, self.signals, self.count
        ahead, against = self._ahead(law, claimed)
        found, back, status, messages = self._judged(law, tracks, claimed, against)
        steady, settled = measured_equilibria(sensors.time, sensors.reading, sensors.resolution, getattr(claimed, "behind", None))
        late = max(float(sensors.time[0]) - signals.start_min, 0.0)  # of sensors whose readings begin after the others'
        last, silent = counted_to(sensors.time[:n], signals.time_min, self.question.until_min, signals.start_min)
        at, of_room = self._at(claimed, found)
        there, far = self._in_room(found)
        numbers = {
            "initial_c": found.initial,
            "steady_state_c": found.steady_state,
            "steady_state_lo_c": found.steady_low,
            "steady_state_hi_c": found.steady_high,
            "steady_state_limit_c": found.limit,
            "steady_state_measured_c": steady,
            "t95_min": late + found.t95,
            "t95_lo_min": late + found.t95_low,
            "t95_hi_min": late + found.t95_high,
            "t95_measured_min": late + settled,
            **self._to_go(found, max(last - signals.start_min - late, 0.0), claimed is None),
            "rate_per_min": found.rate,
            "noise_c": found.noise,
            "rmse_fit_c": found.misfit,
            "rmse_ahead_c": ahead,
            "reading_half_width_c": 0.5 * (law.steady_high - law.steady_low),
            **(at | there),
        }
        tripped = self._trips(found, claimed)
        if tripped is not None:
            numbers |= columns_of(tripped)
        whole = np.array([i not in broken for i in range(len(sensors))])
        columns: dict[str, Column] = {name: numbers_of(np.where(whole, column, np.nan)) for name, column in numbers.items()}
        if tripped is not None:
            columns |= self._of_rule(tripped, np.isfinite(numbers["trip_min"]), whole)
        if claimed is not None:
            rise = np.where(back, np.nan, found.steady_state - found.initial).tolist()
            columns["unseen"] = [said_of_slow(claimed, i, rise[i]) if whole[i] else "" for i in range(len(sensors))]
            columns["rate_shared_with"] = [with_ if w else "" for with_, w in zip(claimed.shared_with, whole, strict=True)]
        said = [self._said(i, (*messages.get(i, ()), *silent, *of_room, *far), claimed, tripped) for i in range(len(sensors))]
        for i, why in broken.items():
            status[i], said[i] = "diverged", _joined([why, signals.note(sensors.rows[i])])
        return Records(IdentifyRecord, len(sensors), {**self._named(), **columns, "status": status, "message": said})

    def _judged(
        self, law: Estimates, tracks: Tracks, claimed: Claims | None, against: dict[int, float]
    ) -> tuple[Estimates, NDArray[np.bool_], list[str], dict[int, list[str]]]:
        """What is found of each sensor, which of them come back to where they began, status, and what is said of the numbers."""
        sensors, until_used = self.sensors, float(self.sensors.time[self.count - 1])
        if claimed is None:
            return law, np.zeros(len(sensors), dtype=bool), *law_verdicts(law, tracks, sensors, against, until_used)
        past = self.method.past
        law = begun_as_read(law, sensors, claimed.other_rise)
        back = comes_back(law, claimed.steady[:, 1], sensors)
        found, known = with_claims(law, claimed, sensors, back, past is not None and past.staged), (past, self.method.changed_min)
        return found, back, *claimed_verdicts(found, claimed, tracks, sensors, against, until_used, back, *known)

    def _to_go(self, found: Estimates, elapsed: float, by_law: bool) -> dict[str, Array]:
        """Minutes (S,) from the last reading until 95 % of the rise are there, with their interval; `elapsed` [min] are gone."""
        to_go = [np.maximum(side - elapsed, 0.0) for side in (found.t95, found.t95_low, found.t95_high)]
        counted = np.isfinite(found.t95) if self.method.paces else found.faded & by_law
        for k in np.flatnonzero(counted).tolist():
            left = remaining(found.one(k), elapsed, self.method.paces)
            for side, value in zip(to_go, (left.median, left.low, left.high), strict=True):
                side[k] = math.nan if value is None else max(value, 0.0)
        for side in to_go:
            side[np.isnan(found.t95)] = math.nan
        return dict(zip(("time_to_go_min", "time_to_go_lo_min", "time_to_go_hi_min"), to_go, strict=True))

    def _in_room(self, found: Estimates) -> tuple[dict[str, Array], tuple[str, ...]]:
        """Where each settles in the room that is asked for, and what there is to know of that."""
        n, steady = self.count, (found.steady_low, found.steady_state, found.steady_high)
        room = None if self.surroundings is None else room_at_end(self.sensors.time[:n], self.surroundings[:n])
        return in_room(steady, room, self.question.room_c, self.method.imperfection.background.logged)

    def _of_rule(self, tripped: Trips, trip: NDArray[np.bool_], whole: NDArray[np.bool_]) -> dict[str, Column]:
        """The stopping rule that was asked for, and whether readings or a prediction told when it holds."""
        assert self.question.rule is not None
        text, from_ = self.question.rule.criterion.text, ["readings" if seen else "prediction" for seen in tripped.seen]
        return {
            "criterion": [text if w else "" for w in whole],
            "trip_from": [said if t else "" for said, t in zip(from_, trip & whole, strict=True)],
        }

    def _named(self) -> dict[str, Column]:
        """What every row says of which sensor was identified with what, and from which readings."""
        signals, until = self.signals, self.question.until_min
        return {
            "run": Same(signals.run),
            "channel": [signals.channels[row] for row in self.sensors.rows.tolist()],
            "filter": Same(_filter_name(self.method, self.question)),
            "until_min": Same(float(signals.time_min[-1] - signals.time_min[0]) if until is None else until),
            "samples": Same(self.count),
            "start_min": Same(signals.start_min),
        }

    def _said(self, i: int, about_numbers: Sequence[str], claimed: Claims | None, tripped: Trips | None) -> str:
        """What a sensor's row says in words: of its numbers, its readings, and of how it was read."""
        noted = self.signals.note(self.sensors.rows[i])
        if claimed is None and tripped is None and not (about_numbers or noted or self.sensors.notes[i]):
            return ""
        let_go, about = claimed is not None and bool(claimed.let_go[i]), noted.split("; ") if noted else []
        about = without_past(about) if let_go else about
        said = [*(tripped.said(i) if tripped is not None else ()), *about_numbers, *self.sensors.notes[i], *about]
        if let_go:
            said.insert(0, why_let_go(self.method.past, float(np.ptp(self.sensors.time[: self.count]))))
        if claimed is not None:
            past, unlogged = self.method.past, self.signals.room is None
            if self.question.room_c is not None and unlogged and (past is None or past.guessed):
                said.append("--room needs a column of the surroundings, and there is none")
            if self.signals.room is not None and self.surroundings is None:
                moves = "move with the machine" if self.logged is not None else "are logged for too little of the time used"
                said.append(f"the logged surroundings {moves} and are not used")
        return _joined(said)

    def _at(self, claimed: Claims | None, found: Estimates) -> tuple[dict[str, Array], tuple[str, ...]]:
        """Time, temperature and its interval at the time asked for; and what the room may do until then, in words."""
        said: tuple[str, ...] = ()
        asked, at = self.question.at_min, np.full((len(self.sensors), 3), np.nan)
        time = (asked or 0.0) + self.signals.start_min
        if asked is not None and claimed is not None:
            at = claimed.at[:, int(np.abs(claimed.times - time).argmin())] + self.sensors.swing_ends(time)
            if self.surroundings is not None:
                then, room = self.sensors.time[: self.count], self.surroundings[: self.count]
                at, said = until_then(at, then, room, claimed.rate[:, 1], time, self.method.imperfection.background.logged)
        elif asked is not None:
            middle, half = (of(np.array([time]))[:, 0] for of in (found.free_run, found.band_from_tangent))
            at = np.stack([middle - half, middle, middle + half], axis=1)
        named = np.full(len(at), np.nan if asked is None else asked)
        return {"at_min": named, "at_c": at[:, 1], "at_lo_c": at[:, 0], "at_hi_c": at[:, 2]}, said

    def _trips(self, found: Estimates, claimed: Claims | None) -> Trips | None:
        """When the stopping rule asked for holds: on the readings used, else foretold."""
        rule, sensors, n = self.question.rule, self.sensors, self.count
        if rule is None:
            return None
        steady = np.stack([found.steady_low, found.steady_state, found.steady_high], axis=1)
        foretold = (claimed.trips, claimed.missing, claimed.hidden) if claimed is not None else None
        used = sensors.time[:n], sensors.reading[:, :n]
        return trips_of(rule, *used, steady, self.signals.start_min, foretold, self.surroundings)

    def _ahead(self, found: Estimates, claimed: Claims | None) -> tuple[Array, dict[int, float]]:
        """RMS error [K] (S,) on the readings ahead, and by how much [K] those of some sensors contradict what was said of them."""
        sensors, n = self.sensors, self.count
        ahead = np.full(len(sensors), np.nan)
        told = np.isfinite(found.rate) if claimed is None else claimed.held
        if n == len(sensors.time) or not told.any():
            return ahead, {}
        later = sensors.time[n:]
        kept = (spike_weights(sensors.reading, sensors.resolution)[:, n:] > 0.0) & (later < self.method.jumps_min)
        band = None if claimed is None else claimed.curves(later)
        if claimed is not None and band is not None:
            logged = self.signals.room if self.surroundings is not None else None
            curve = band[1] + moved_by_room(self.signals.time_min, logged, claimed.rate[:, 1], float(sensors.time[n - 1]), later)
        else:
            curve = found.free_run(later)
        error = np.where(kept & told[:, None], sensors.reading[:, n:] - curve, np.nan)
        told &= (number := np.isfinite(error).sum(axis=1)) > 0
        ahead[told] = np.sqrt(np.nansum(error[told] ** 2, axis=1) / number[told])
        if claimed is not None and band is not None:
            return ahead, against_claims(np.where(told[:, None], error, np.nan), band, found, claimed)
        against, half = {}, found.band_from_tangent(later)
        # The covariance alone costs little; what it finds is looked at again with the curved band of draws.
        for i in np.flatnonzero(told & contradicts(error, half, found.noise)):
            good = np.isfinite(error[i])
            size = found.one(int(i)).contradicted_by(later[good], error[i][good], half[i][good])
            if size is not None:
                against[int(i)] = size
        return ahead, against

    def _pictures(
        self, i: int, record: IdentifyRecord, found: Estimates, single: Callable[[int], Track], claimed: Claims | None
    ) -> tuple[dict[str, Array], Curves]:
        """Trace and curves of a sensor."""
        sensor, n = self.sensors.one(i), self.count
        trace = trace_columns(self.method.model, single(i), sensor.time[:n], sensor.reading[:n])
        room = float(self.surroundings[n - 1]) if self.surroundings is not None else None
        given = replace(sensor, reading=self.sensors.measured(i)), found.one(i), trace, n, self.question.until_min, claimed, i, room
        return trace, curves_of(record, *given)


def _joined(messages: list[Any]) -> str:
    return "; ".join(str(m) for m in messages if m)
