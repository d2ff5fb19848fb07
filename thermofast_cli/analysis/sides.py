"""Runs of a machine before and after: observed alike, fitted over the length of the shortest, what does not bend left out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.joint import LEVEL, START, Fit, Key, fit_model
from thermofast.models.search.judge import widening
from thermofast.models.search.logged import follows_machine
from thermofast.models.uncertainty.changes import (
    LOGGED_DRIFT,
    ROOM_BETWEEN,
    WARM,
    Begun,
    RunNumbers,
    beside_others,
    by_length,
    logged_late,
    rates_and_rises,
    without_room,
)

from ..errors import UsageError
from ..machine.learnt import as_learnt, first_readings
from ..machine.model import Model
from ..machine.modelfile import refuse_copies
from ..observing.observe import FEWEST_READINGS, observe
from ..workers.engine import Started

Array = NDArray[np.float64]

#: Deviation of the logarithm of its rate or rise from which a sensor that moves little is left out: the logarithm is then no
#: Gaussian.
UNKNOWN = 0.5
#: Share of what the others move below which it is.
WEAK = 0.5
#: Share of the sensors that must be bent to be those that a run is of.
ENOUGH = 0.3
#: What is not known of a logged room's mean [K].
ROOM_ERROR = 0.1


@dataclass(frozen=True)
class Sides:
    """Runs of the old side, `old` of them, and of the new side behind them, K in all, of S sensors.

    seen (K) as they were read, with all their sensors, and fits (K) of those that all have; straight: those that hardly bend, left
    out. model: what takes the place of old runs, as one of them.
    """

    seen: tuple[Observations, ...]
    fits: tuple[Fit, ...]
    old: int
    straight: tuple[str, ...] = ()
    model: Model | None = None

    @classmethod
    def of(cls, old: Sequence[Started], new: Sequence[Started], model: Model | None) -> "Sides":
        """All runs looked at over the length of the shortest; a model as the run that it foretells at the readings of the longest.

        Raises
        ------
        UsageError: no runs, a run on both sides, no sensor that all have, too few readings, or runs that go opposite ways.
        """
        _check(old, new, model)
        seen = [observed_run(one) for one in (*old, *new)]
        refuse_copies((one.name, one) for one in seen)
        if model is not None:
            longest = max(seen, key=lambda s: s.span)
            seen.insert(0, as_learnt(model.file, longest, longest.name, model.source))
        channels = _in_common(seen)
        span = min(s.span for s in seen)
        mine = [s.only(channels) for s in seen]
        if any(s.sink_c is None or follows_machine(s.filled, next(iter(s.ambient.values()))) for s in mine):
            mine = [replace(s, ambient={}) for s in mine]
        fits = [without_room(s.until(float(s.time[0]) + span)) for s in mine]
        straight = hardly_bent(fits)
        if straight:
            # Without what its room did already.
            fits = [fit_model(f.run.only([c for c in channels if c not in straight])) for f in fits]
        _same_way(fits, max(len(old), 1))
        return cls(tuple(seen), tuple(fits), max(len(old), 1), tuple(straight), model)

    @property
    def channels(self) -> tuple[str, ...]:
        return tuple(self.fits[0].run.channels)

    @property
    def left_out(self) -> list[str]:
        """Sensors that not every run has."""
        return sorted({c for s in self.seen for c in s.channels} - set(self.channels) - set(self.straight))

    @property
    def logged(self) -> bool:
        """Whether the room is logged, in all of them."""
        return self.fits[0].run.sink_c is not None

    @property
    def knows_rooms(self) -> bool:
        """Whether the rooms of both sides can be compared: a model does not tell of one that is not logged."""
        return self.model is None or not self.logged

    @property
    def stand_for(self) -> int:
        """How many runs those of the old side stand for, each of them."""
        return 1 if self.model is None else 1 + len(self.model.file.also_from)

    @property
    def _rooms(self) -> Array:
        """Rooms (K, 1) [degC] where they are logged, else 0."""
        return np.array([[f.run.sink_c or 0.0] for f in self.fits])

    def _fitted(self, key: Key) -> Array:
        return np.stack([np.asarray(f.values[key], dtype=np.float64) for f in self.fits]) - self._rooms

    @cached_property
    def starts(self) -> Array:
        """Fitted beginnings (K, S) [degC], above the room where that is logged."""
        return self._fitted(START)

    @cached_property
    def levels(self) -> Array:
        """Fitted steady states (K, S) [degC], above the room where that is logged."""
        return self._fitted(LEVEL)

    @property
    def rise(self) -> Array:
        """What the new runs rise on average (S,) [K]."""
        mean: Array = (self.levels - self.starts)[self.old :].mean(axis=0)
        return mean

    @property
    def warmer(self) -> Array:
        """How much warmer the new runs began than the old ones (S,) [K]."""
        mean: Array = self.starts[self.old :].mean(axis=0) - self.starts[: self.old].mean(axis=0)
        return mean

    @property
    def settles_higher(self) -> Array:
        """How much higher the new runs settle than the old ones (S,) [K]."""
        mean: Array = self.levels[self.old :].mean(axis=0) - self.levels[: self.old].mean(axis=0)
        return mean

    @cached_property
    def begun(self) -> Begun:
        """How the new runs began, beside the old ones."""
        warm, room = (1.0 - WARM, ROOM_ERROR) if self.logged else (WARM, ROOM_BETWEEN)
        if self.model is not None or self.first is None:
            return Begun(self.warmer, self.rise, warm, room)
        seen = self.first - self._rooms
        warmer = seen[self.old :].mean(axis=0) - seen[: self.old].mean(axis=0)
        new = np.array([self.starts[self.old :].mean(axis=0), seen[self.old :].mean(axis=0)])
        late = logged_late(self.fits[: self.old], warmer, room)
        return Begun(self.warmer, self.rise, warm, room, warmer, late, new)

    @property
    def misfit_at_start(self) -> Array | float:
        """By how much more (S,) [K] the fitted beginnings miss the first readings in the new runs than in the old ones."""
        if self.model is not None or self.first is None:
            return 0.0
        missed = self.starts + self._rooms - self.first
        more: Array = missed[self.old :].mean(axis=0) - missed[: self.old].mean(axis=0)
        return more

    def numbers(self) -> tuple[list[RunNumbers], list[RunNumbers]]:
        """Logarithms of rates and rises of the old runs, and of the new ones.

        Raises
        ------
        UsageError: a sensor does not move.
        """
        drift = LOGGED_DRIFT if self.logged else 1.0
        found = [_numbers(fit, wider, drift) for fit, wider in zip(self.fits, beside_others(self.fits), strict=True)]
        if self.model is not None:
            found[0] = replace(found[0], runs=self.stand_for)
        return found[: self.old], found[self.old :]

    @property
    def by_length(self) -> Array:
        """By how much the numbers of the old runs (2 S,) move by the logarithm of the length of a run."""
        mean: Array = np.mean([by_length(fit) for fit in self.fits[: self.old]], axis=0)
        return mean

    @cached_property
    def first(self) -> Array | None:
        """First readings (K, S) [degC] of the runs, of a model those that it was learnt from; None where it does not say.

        What its fit makes of them is no reading.
        """
        of = [s.only(list(self.channels)) for s in self.seen]
        some = (
            1 if self.model is None else 3
        )  # as past runs are kept in a model: a point near the heat moves from the first reading on
        first = np.array([[np.median(row[u][:some]) for row, u in zip(s.reading, s.used, strict=True)] for s in of])
        if self.model is not None:
            told = first_readings(self.model.file, self.channels)
            if told is None:
                return None
            first[0] = told
        return first


def _check(old: Sequence[Started], new: Sequence[Started], model: Model | None) -> None:
    """Raises UsageError for a side without runs, and for a run that is on both."""
    if model is not None and old:
        raise UsageError("--model takes the place of OLD runs", do="leave one of them out")
    for side, runs in (("OLD", old), ("--new", new)):
        if not runs and not (side == "OLD" and model is not None):
            raise UsageError(f"no run is given as {side}", do="as in: thermofast changed before.csv --new after.csv")
    both = {run.name for run, _ in old} & {run.name for run, _ in new}
    if both:
        raise UsageError(f"{both.pop()} is old and new", do="give each run on one side")


def _in_common(seen: Sequence[Observations]) -> list[str]:
    """Sensors that all runs have.

    Raises
    ------
    UsageError: there are none.
    """
    channels = [c for c in seen[0].channels if all(c in s.channels for s in seen)]
    if not channels:
        other = min(seen[1:], key=lambda s: len({*s.channels} & {*seen[0].channels}))
        raise UsageError(
            "the runs have no sensor in common",
            found=f"{seen[0].name}: {', '.join(seen[0].channels[:6])}; {other.name}: {', '.join(other.channels[:6])}",
            do="give runs of one machine, their sensors named alike",
        )
    return channels


def observed_run(one: Started) -> Observations:
    """Readings of a run that can be compared.

    Raises
    ------
    UsageError: a sensor has too few.
    """
    run, start = one
    seen = observe(run, start).seen
    if seen is None or int(seen.used.sum(axis=1).min()) < FEWEST_READINGS:
        every = seen is None or int(seen.used.sum(axis=1).max()) < FEWEST_READINGS
        raise UsageError(
            f"{run.name}: too few readings",
            allowed=f"{FEWEST_READINGS} or more in every sensor",
            do="give a longer run" if every else "choose --channels",
        )
    return seen


def _same_way(fits: Sequence[Fit], old: int) -> None:
    """Raises UsageError where the new runs cool down and the `old` ones warm up, or the other way round."""
    moves = [rates_and_rises(f)[1] for f in fits]
    before, after = np.mean(moves[:old], axis=0), np.mean(moves[old:], axis=0)
    against = before * after < 0.0
    if against.mean() > 0.5:
        way = ("warms up", "cools down") if float(np.median(before)) > 0.0 else ("cools down", "warms up")
        raise UsageError(
            "what changed cannot be told from runs that go opposite ways",
            found=f"{fits[0].run.name} {way[0]}, {fits[-1].run.name} {way[1]}",
            do="compare a warm-up with a warm-up",
        )


def hardly_bent(fits: Sequence[Fit]) -> list[str]:
    """Sensors that in some run move little and are hardly bent, while others are: what is known of them lies along no line of
    logarithms. One that moves as much as the others is what a run is of, however straight.
    """
    channels, unsure = fits[0].run.channels, np.zeros(fits[0].run.sensors)
    for fit in fits:
        numbers = RunNumbers.of(fit, widening(fit))
        if numbers is not None:
            unsure = np.maximum(unsure, np.sqrt(np.diag(numbers.covariance)).reshape(2, -1).max(axis=0))
    bent = unsure <= UNKNOWN
    if bent.sum() < max(2.0, ENOUGH * len(bent)):
        return []
    moved = np.mean([f.run.moved for f in fits], axis=0)
    weak = ~bent & (moved < WEAK * float(np.median(moved[bent])))
    return [c for c, left_out in zip(channels, weak, strict=True) if left_out]


def _numbers(fit: Fit, wider: Array, drift: float) -> RunNumbers:
    found = RunNumbers.of(fit, wider, drift)
    if found is None or not np.all(np.isfinite(found.covariance)):
        raise UsageError(
            f"{fit.run.name}: a sensor does not move", found=", ".join(fit.run.channels[:8]), do="choose others with --channels"
        )
    return found
