"""When a test may be stopped: a growing record looked at again and again, with one error rate for the whole watch.

A posterior may be looked at as often as one likes: the probability that a limit lies in an interval is what it says whatever made
one stop there. What is asked is that all sensors are within the tolerance together, and that it stays so.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import spike_weights
from thermofast.models.noise.spikes import logger_step

from ..errors import rounded
from ..estimation.measured import counted_to
from ..reading import Run
from ..reading.run import stretch
from ..records import IdentifyRecord

Array = NDArray[np.float64]

#: Readings before which there is nothing to look at.
FEWEST = 6
#: A look is due when the record has grown by this share.
GROWTH = 0.01
#: A record is averaged down to about this many readings: none of its time constants is that short.
MOST = 2000
#: Half-widths are multiplied by this against the tolerance: all sensors at once, where each interval holds 95 % by itself.
TOGETHER = 1.15
#: Nothing is settled before some sensor has risen by this many tolerances: a machine that heat has not reached looks settled.
RISEN = 2.0
#: Time constants that must have been read where neither past runs of the machine are known nor that strong effects are rare in
#: this lab: before that a second mass is not to be seen, and a trial (python -m benchmarks.intervals.watching) stopped one test
#: in six of those with a strong effect at a wrong number, against one in ten.
TURNS = 1.5
#: Share of a record that does not serve as a whole that is left out to see whether what came since can be foretold from.
LATER = 0.5
#: The record is searched for events again when it has grown by this, averaged down to about so many readings.
ASKED, FEW = 1.1, 300
#: All sensors must be within the tolerance while the record grows by this share.
HOLDS = 0.03


@dataclass(frozen=True)
class Look:
    """What is known after some minutes: records, and of each sensor whether it is within the tolerance; whether to stop.

    waits says what is waited for where all are within it; from_min, where it is not 0, from when on readings were counted; known,
    that what past runs say was counted; silent, sensors that have not told a reading for long, and since when [min].
    """

    minutes: float
    records: tuple[IdentifyRecord, ...]
    within: tuple[bool, ...]
    stop: bool
    waits: str = ""
    tolerance_c: float = 0.0
    from_min: float = 0.0
    known: bool = False
    silent: tuple[tuple[str, float], ...] = ()

    @property
    def words(self) -> str:
        """One line."""
        if self.stop:
            by = f", by the readings from {self.from_min:.4g} min on" if self.from_min else ""
            return f"{self.minutes:.4g} min: you can stop now, every sensor is within the tolerance{by}"
        wide = TOGETHER if len(self.records) > 1 else 1.0
        halves = {r.channel: None if (h := half_width(r)) is None else wide * h for r in self.records}
        known = {c: h for c, h in halves.items() if h is not None}
        count = f"{sum(self.within)} of {len(self.within)} sensors within the tolerance"
        silent = [
            f"; {c} has told no reading since {since:.4g} min: --exclude {c!r} goes on without it" for c, since in self.silent
        ]
        dead = "".join(silent)
        if len(known) < len(halves):
            return f"{self.minutes:.4g} min: {count}; {len(halves) - len(known)} not determined yet{self.waits}{dead}"
        widest = max(known, key=lambda c: known[c])
        doubted = [r.channel for r in self.records if r.status == "model_doubtful"]
        doubt = f"; the model is in doubt at {', '.join(doubted[:4])}" if doubted else ""
        told = f"{self.minutes:.4g} min: {count}; widest {widest}, +-{rounded(known[widest])} K for all at once"
        limit = "" if widest in dict(self.silent) else self._limit(widest, wide, known[widest])
        return f"{told}{limit}{doubt}{self.waits}{dead}"

    def _limit(self, channel: str, wide: float, half: float) -> str:
        """Where the machine and not the readings keeps the widest sensor from the tolerance."""
        alone = next(r.reading_half_width_c for r in self.records if r.channel == channel)
        if alone is None or not wide * alone <= self.tolerance_c < half:
            return ""
        past = "" if self.known else " (past runs make that less: calibrate, or --model)"
        return f", by the readings alone +-{rounded(wide * alone)} K: the machine is the limit{past}"


def half_width(record: IdentifyRecord) -> float | None:
    """Of the steady state's interval [K]; None where a side is open."""
    low, high = record.steady_state_lo_c, record.steady_state_hi_c
    return None if low is None or high is None or record.status == "not_determined" else 0.5 * (high - low)


@dataclass
class Watch:
    """Looks at a growing record. identify: the records of a run, from a minute of it on, or None for where its rise begins;
    tolerance_c: half-width that is asked for [K]; start_min: the minute from which on the run counts.

    known: past runs of the machine are counted, or the lab's runs show that second masses are rare: a short record may do.
    happened: whether all that a record has beside the law are events before a minute of it.
    """

    identify: Callable[[Run, float | None], tuple[IdentifyRecord, ...]]
    tolerance_c: float
    known: bool = False
    happened: Callable[[Run, float], bool] = lambda _run, _minute: False
    start_min: float | None = None
    asked: tuple[float, bool] = field(default=(0.0, False), init=False)
    last_min: float = field(default=0.0, init=False)
    since_min: float | None = field(default=None, init=False)

    def due(self, minutes: float) -> bool:
        """Whether the record has grown enough since the last look."""
        return minutes >= self.last_min * (1.0 + GROWTH) and minutes > self.last_min

    def _seen(self, run: Run) -> tuple[tuple[IdentifyRecord, ...], tuple[bool, ...], bool, str, float]:
        """Records of a run, which of its sensors are within the tolerance, whether to stop, else what is waited for; and the minute
        from which on readings were counted.
        """
        minutes, began = float(run.time_s[-1]) / 60.0, 0.0
        records = self.identify(thinned(run), self.start_min)
        left = (1.0 - LATER) * (minutes - (self.start_min or 0.0))
        read_later = int((run.time_s >= 60.0 * (minutes - left)).sum())
        if any(r.status != "ok" for r in records) and read_later >= FEWEST:
            # What happened on the way (a pause, a door) is no matter to the readings that came long after it.
            later = self.identify(thinned(stretch(run, minutes - left, None)), 0.0)
            serves = all(r.status == "ok" for r in later) and left * min(_pace(records), _pace(later)) >= TURNS
            if serves and self._happened_before(run, minutes - left):
                records, minutes, began = tuple(_of_later(r, minutes - left) for r in later), left, minutes - left
        halves = [half_width(r) if r.status == "ok" else None for r in records]
        wide = TOGETHER if len(records) > 1 else 1.0
        within = tuple(h is not None and wide * h <= self.tolerance_c for h in halves)
        risen = any(np.ptp(_ends(column)) > RISEN * self.tolerance_c for column in run.channels.values())
        pace = _pace(records)
        start = min((r.start_min or 0.0 for r in records), default=0.0) if began == 0.0 else 0.0
        long_enough = self.known or (minutes - start) * pace >= TURNS
        waits = ""
        least = rounded(start + TURNS / pace, 3) if pace > 0.0 else ""
        if within and all(within) and not risen:
            waits = f"; no sensor has moved by {RISEN:g} tolerances yet"
        elif not all(within) and not long_enough and least:
            waits = f"; no stop before about {least} min"
        elif within and all(within) and not long_enough and least:
            waits = (
                f"; no stop before {TURNS:g} time constants ({least} min), before which no slower part shows; --model, "
                "or a lab.toml by calibrate, knows it before"
            )
        return records, within, bool(within) and all(within) and risen and long_enough, waits, began

    def _happened_before(self, run: Run, minute: float) -> bool:
        """As `happened`, which takes seconds and is asked when the record has grown by ASKED since the last time."""
        minutes = float(run.time_s[-1]) / 60.0
        if not self.asked[0] / ASKED <= minutes < self.asked[0] * ASKED:
            self.asked = minutes, self.happened(thinned(run, FEW), minute)
        return self.asked[1]

    def look(self, run: Run) -> Look:
        """What is known now."""
        minutes = float(run.time_s[-1]) / 60.0
        if minutes < self.last_min:  # another run has begun
            self.since_min, self.last_min, self.asked = None, 0.0, (0.0, False)
        records, within, ready, waits, began = self._seen(run)
        before = minutes / (1.0 + HOLDS) - 1e-9
        if not ready:
            self.since_min = None
        elif self.since_min is None:
            # Where nobody looked lately (a file that was there already) the record of then is looked at now.
            earlier = int(np.searchsorted(run.time_s, 60.0 * before, "right"))
            held = self.last_min < before and earlier >= FEWEST and self._seen(first_readings(run, earlier))[2]
            self.since_min = before if held else minutes
        self.last_min = minutes
        stop = self.since_min is not None and minutes >= (1.0 + HOLDS) * self.since_min
        if self.since_min is not None and not stop:
            waits = f"; it must stay so until {rounded((1.0 + HOLDS) * self.since_min, 4)} min"
        return Look(minutes, records, within, stop, waits, self.tolerance_c, began, self.known, _silent(run))


def _of_later(record: IdentifyRecord, from_min: float) -> IdentifyRecord:
    """What the later readings of a record say of its sensor: of when 95 % of the whole rise is done they say nothing."""
    said = f"by the readings from {from_min:.4g} min on, as those before leave the law; {record.message}".removesuffix("; ")
    blank = dict.fromkeys(("t95_min", "t95_lo_min", "t95_hi_min", "time_to_go_min", "time_to_go_lo_min", "time_to_go_hi_min"), None)
    until = None if record.until_min is None else record.until_min + from_min
    return replace(record, message=said, start_min=from_min, until_min=until, **blank)  # type: ignore[arg-type]


def _silent(run: Run) -> tuple[tuple[str, float], ...]:
    """Sensors that died before the end of a record, as their rows say it too, and their last minute."""
    minutes = run.time_s / 60.0
    told = {c: minutes[np.isfinite(v)] for c, v in run.channels.items()}
    return tuple((c, float(own[-1])) for c, own in told.items() if len(own) and counted_to(own, minutes, None, 0.0)[0] > own[-1])


def _pace(records: tuple[IdentifyRecord, ...]) -> float:
    """The median rate [1/min]; 0 where none has one."""
    rates = [r.rate_per_min for r in records if r.rate_per_min]
    return float(np.median(rates)) if rates else 0.0


def first_readings(run: Run, count: int) -> Run:
    """The first `count` readings of a run."""
    cut: dict[str, Any] = {
        f: {n: v[:count] for n, v in getattr(run, f).items()} for f in ("channels", "ambient", "inputs", "displacements")
    }
    return replace(run, time_s=run.time_s[:count], **cut)


def _ends(column: Array) -> Array:
    """Where a sensor was at first and where it is now."""
    good = column[np.isfinite(column)]
    few = max(1, min(5, len(good) // 4))
    return np.array([np.median(good[:few]), np.median(good[-few:])]) if len(good) else np.zeros(2)


def thinned(run: Run, most: int = MOST) -> Run:
    """A long record averaged over neighbours, outliers left out; the run itself where it is short."""
    together = len(run.time_s) // most
    if together < 2:
        return run
    edges = np.arange(0, len(run.time_s), together)
    count = np.diff(np.append(edges, len(run.time_s)))

    def mean(column: Array, good: NDArray[np.bool_]) -> Array:
        number = np.add.reduceat(good.astype(float), edges)
        with np.errstate(all="ignore"):
            found: Array = np.add.reduceat(np.where(good, np.nan_to_num(column), 0.0), edges) / number
        return found

    def sensor(column: Array) -> Array:
        good = np.isfinite(column)
        if good.sum() > 6:
            good[good] = spike_weights(np.ascontiguousarray(column[good]), logger_step(column[good])) > 0.0
        return mean(column, good)

    rest: dict[str, Any] = {
        name: {c: mean(v, np.isfinite(v)) for c, v in getattr(run, name).items()} for name in ("ambient", "inputs", "displacements")
    }
    time = np.add.reduceat(run.time_s, edges) / count
    return replace(run, time_s=time, channels={c: sensor(v) for c, v in run.channels.items()}, **rest)
