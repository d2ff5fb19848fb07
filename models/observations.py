"""All sensors of one run on one time grid: what a joint fit looks at, and what an effect may use."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .core.kernel import Array


def read_only(array: Array) -> Array:
    """The same numbers (no copy), which nobody can change in place: many share them, and some who read them are foreign code."""
    view = array.view()
    view.setflags(write=False)
    return view


def up_to(minutes: "float | Array") -> "float | Array":
    """The last time that counts among those until `minutes`: times in seconds are rounded where they become minutes."""
    return minutes * (1.0 + 1e-12) + 1e-9


@dataclass(frozen=True)
class Observations:
    """time (N,) [min]; reading (S, N) [degC], nan for none; weight (S, N), how many readings each is the mean of, 0 leaves it out.

    noise (S,) [K] of one reading of weight 1, a first guess; resolution (S,) [K] the logger's step, 0 if none shows.
    ambient name -> (N,) [degC] and inputs name -> (N,) are logged columns without holes. sink_c is the temperature of the
    surroundings where it is logged, else None. heat (N,) is the heat of the base model, mean over the interval that ends at each
    reading, where a logged column drives it; drive names that column, driven (N,) are its values in the unit of the heat. logged
    (N,) are the times that stand in the file, where the grid is finer than that. temperatures names those inputs that are some;
    heats those that are a power, a current or a load, which change no loss, cools a fan or a flow, which brings no heat.
    heat_unit is what a heat of 1 is in the column's own unit: its largest until the last reading used. extent [min] is how far the
    readings go that are used, or those that a model was learnt from, 0 for all of them: bounds of parameters are shares of it, and
    neither readings left out nor what comes after them move it. start_min is where time 0 lies on the clock of the run, on which
    times are told.
    """

    name: str
    channels: tuple[str, ...]
    time: Array
    reading: Array
    weight: Array
    noise: Array
    resolution: Array
    ambient: dict[str, Array] = field(default_factory=dict)
    inputs: dict[str, Array] = field(default_factory=dict)
    ambient_noise: float = 0.0
    drive: str | None = None
    heat: Array | None = None
    logged: NDArray[np.bool_] | None = None
    driven: Array | None = None
    temperatures: tuple[str, ...] = ()
    heats: tuple[str, ...] = ()
    cools: tuple[str, ...] = ()
    heat_unit: float = 1.0
    extent: float = 0.0
    start_min: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                self.__dict__[name] = read_only(value)
            elif isinstance(value, dict):
                self.__dict__[name] = {column: read_only(np.asarray(array)) for column, array in value.items()}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self.__post_init__()  # what comes from another process can be written to

    @property
    def sensors(self) -> int:
        return len(self.channels)

    @property
    def clock(self) -> Array:
        """The times (N,) on the clock of the run [min after its first reading]."""
        return self.start_min + self.time

    @property
    def span(self) -> float:
        """Length of the record [min], as far as it is used."""
        return self.extent or float(self.time[-1] - self.time[0])

    @cached_property
    def moved(self) -> Array:
        """From the least to the greatest reading that counts (S,) [K]; nought of a sensor without any."""
        low, high = np.where(self.used, self.reading, np.inf), np.where(self.used, self.reading, -np.inf)
        return read_only(np.maximum(high.max(axis=1, initial=-np.inf) - low.min(axis=1, initial=np.inf), 0.0))

    @cached_property
    def step(self) -> float:
        """Usual time between readings [min]."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def middle(self) -> Array:
        """Middle of the interval that ends at each reading (N,) [min]: the time to take for heat and loss."""
        middle = self.time.copy()
        middle[1:] -= 0.5 * np.diff(self.time)
        return read_only(middle)

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        used = self.weight > 0.0
        used.setflags(write=False)
        return used

    @cached_property
    def known(self) -> Array:
        """Readings (S, N) [degC] with 0 in holes, which carry no weight."""
        return read_only(np.nan_to_num(self.reading))

    @cached_property
    def least_noise(self) -> Array:
        """Standard deviation (S,) [K] of one reading, no less than the logger's rounding leaves."""
        return read_only(np.asarray(np.maximum(self.noise, self.resolution / np.sqrt(12.0))))

    @cached_property
    def filled(self) -> Array:
        """Readings (S, N) [degC] with holes filled by straight lines: what a neighbour sees."""
        whole = np.array(self.reading)
        for row in whole:
            bad = ~np.isfinite(row)
            if bad.any() and not bad.all():
                row[bad] = np.interp(self.time[bad], self.time[~bad], row[~bad])
        return read_only(whole)

    @cached_property
    def last(self) -> int:
        """Place on the grid of the last reading used of any sensor; of the last of all where none is."""
        used = np.flatnonzero((self.weight > 0.0).any(axis=0))
        return int(used[-1]) if len(used) else len(self.time) - 1

    @cached_property
    def sink_c(self) -> float | None:
        """Mean temperature of the first logged surroundings [degC] while readings were used: what they do later is not known."""
        return float(np.mean(next(iter(self.ambient.values()))[: self.last + 1])) if self.ambient else None

    def driven_by(self, column: str, ending: float = 0.5, last: int | None = None) -> "Observations":
        """The same run with a logged column as the heat of the base model; the effects no longer see that column.

        Heat is relative to the largest that was logged until the last reading used, which is that at `last` where told: what comes
        later changes no gain.

        ending is the share that a reading of the column has in the interval that ends with it, beside the reading before: 0.5
        for a column that moves in straight lines, 0 for one that is held until the next reading, 1 for one that tells what was.
        """
        values = self.inputs[column]
        until = (self.last if last is None else last) + 1
        largest = float(np.abs(values[:until]).max()) or float(np.abs(values).max())
        share = values / max(largest, 1e-300)
        level = share if self.logged is None else share[self._file_times[1]]
        heat = self.over_intervals(share, ending)
        rest = {n: c for n, c in self.inputs.items() if n != column}
        return replace(self, inputs=rest, drive=column, heat=heat, driven=level, heat_unit=max(largest, 1e-300))

    def over_intervals(self, column: Array, ending: float) -> Array:
        """Mean of a logged column (..., N) over the interval that ends at each reading; ending as for :meth:`driven_by`."""
        if self.logged is None or ending == 0.5:
            last, following = np.concatenate([column[..., :1], column[..., :-1]], axis=-1), column
        else:  # between two times of the file the column is as at the one or the other, not on the line between them
            earlier, later = self._file_times
            last, following = column[..., earlier], column[..., later]
        return np.asarray(ending * following + (1.0 - ending) * last)

    @cached_property
    def _file_times(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Of each time of the grid (N,) the places of the times that stand in the file before it, and at or after it."""
        assert self.logged is not None
        there = np.flatnonzero(self.logged)
        after = np.clip(np.searchsorted(there, np.arange(len(self.time))), 0, len(there) - 1)
        return there[np.maximum(after - 1, 0)], there[after]

    def before(self, time: Array | float) -> Array:
        """Start of each reading's interval relative to `time`, broadcast to (..., N) [min]."""
        first = np.concatenate([self.time[:1] - self.step, self.time[:-1]])
        return np.asarray(first - time)

    def after(self, time: Array | float) -> Array:
        """Share of the interval that ends at each reading which lies after `time`: 0 before, 1 after, (..., N)."""
        share: Array = (self.time - time) / self._length
        np.minimum(share, 1.0, out=share)
        return np.maximum(share, 0.0, out=share)

    @cached_property
    def _length(self) -> Array:
        """Length of the interval that ends at each reading (N,) [min]."""
        return read_only(np.concatenate([[self.step], np.diff(self.time)]))

    def until(self, minutes: float | None) -> "Observations":
        """The same grid with the readings after `minutes` left out."""
        if minutes is None:
            return self
        seen = self.time <= up_to(minutes)
        extent = float(self.time[seen][-1] - self.time[0]) if seen.any() else 0.0
        return replace(self, weight=np.where(seen, self.weight, 0.0), extent=extent)

    def only(self, channels: Sequence[str]) -> "Observations":
        """The same run with these sensors, in their order."""
        at = [self.channels.index(c) for c in channels]
        rows = {name: getattr(self, name)[at] for name in ("reading", "weight", "noise", "resolution")}
        return replace(self, channels=tuple(channels), **rows)

    def without(self, left_out: NDArray[np.bool_]) -> "Observations":
        """The same grid with the readings (N,) or (S, N) marked left out."""
        return replace(self, weight=np.where(left_out, 0.0, self.weight))


def held_out_blocks(run: Observations, blocks: int = 8) -> list[NDArray[np.bool_]]:
    """Contiguous blocks (N,) of equal length that together cover the readings in use, the first third of the first excepted.

    What the first readings fix, the start of the curve, no later reading can tell: the first block begins after them.
    """
    seen = np.flatnonzero(run.used.any(axis=0))
    if len(seen) < 3 * blocks:
        return []
    edges = np.linspace(0, len(seen), blocks + 1).astype(int)
    found = []
    for a, b in itertools.pairwise(edges):
        mask = np.zeros(len(run.time), dtype=bool)
        mask[seen[max(a, (b - a) // 3) if a == 0 else a : b]] = True
        found.append(mask)
    return found
