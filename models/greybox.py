"""The grey-box model of all sensors of a run: the layout of its parameters, and its forward run with derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .core.kernel import Array
from .drive import Drive
from .effects.base import Choice, Effect, Parameter, Values
from .observations import Observations

#: Relative step of a derivative, in the search's coordinates (logarithms for scales, the bounds' width otherwise).
NUDGE = 1e-5


@dataclass(frozen=True)
class Part:
    """An effect in a model: how it acts (choice) and the sensors (S,) that it concerns; None: all."""

    effect: Effect
    choice: Choice = Choice()
    concerned: tuple[bool, ...] | None = None

    @property
    def id(self) -> str:
        return self.effect.id

    def concerns(self, sensors: int) -> NDArray[np.bool_]:
        """Mask (S,)."""
        return np.ones(sensors, dtype=bool) if self.concerned is None else np.array(self.concerned)


class Key(NamedTuple):
    """Names a parameter of a model: the place of its effect among the model's parts, -1 for the base model, and its name."""

    part: int
    name: str


@dataclass(frozen=True)
class Column:
    """One searched parameter: of part `part`, or of the base model (-1)."""

    part: int
    parameter: Parameter

    @property
    def key(self) -> Key:
        return Key(self.part, self.parameter.name)


RATE, LEVEL, START = Key(-1, "rate"), Key(-1, "level"), Key(-1, "start")

BASE = (
    Parameter("rate", "1/min", 1e-5, 1e4, 0.015, "rate b", each="sensor", log=True, fastest=4.0),
    Parameter("level", "degC", -1e4, 1e5, 25.0, "steady state at nominal load", belongs="run", each="sensor"),
    Parameter("start", "degC", -500.0, 5000.0, 20.0, "temperature at the first reading", belongs="run", each="sensor"),
)
#: Surroundings that are not logged lie at most so far outside the readings: kelvin, and times the range that these cover. What acts
#: in proportion to a difference of hundreds of kelvin is a room that moved.
FAR_K, FAR = 20.0, 1.0
SINK = Parameter("sink", "degC", -200.0, 2000.0, 20.0, "temperature of the surroundings", belongs="run")


class Model:
    """Base model and effects on one run: the layout of its parameters, and its forward run."""

    def __init__(self, run: Observations, parts: Sequence[Part] = (), active: NDArray[np.bool_] | None = None) -> None:
        self.run, self.parts = run, tuple(parts)
        columns = [Column(i, p) for i, part in enumerate(self.parts) for p in part.effect.active(part.choice)]
        self.local = [Column(-1, p) for p in BASE] + [c for c in columns if c.parameter.each == "sensor"]
        self.shared = [c for c in columns if c.parameter.each == "run"]
        # Without a logged ambient the surroundings are what several sensors under one cause agree on.
        heating = any(part.effect.uses_sink and int(part.concerns(run.sensors).sum()) > 1 for part in self.parts)
        if run.sink_c is None and (heating or run.heat is not None):
            self.shared.append(Column(-1, SINK))
        self.low_local, self.high_local = self._bounds(self.local)
        self.low_shared, self.high_shared = self._bounds(self.shared)
        self.log_local = np.array([c.parameter.log for c in self.local], dtype=bool)
        self.log_shared = np.array([c.parameter.log for c in self.shared], dtype=bool)
        n = run.sensors
        #: Which parameters of a sensor are searched (S, kl); the others stay where they are.
        self.active = np.ones((n, len(self.local)), dtype=bool) if active is None else active.copy()
        for j, c in enumerate(self.local):
            if c.part >= 0 and active is None:
                part = self.parts[c.part]
                self.active[:, j] = part.concerns(n) & part.effect.acting(c.parameter, part.choice, n)
        self.active.flags.writeable = False

    def of_machine(self, column: Column) -> bool:
        """Whether a parameter is a constant of the machine, not of the run."""
        # How strongly the machine follows a logged column is the machine's, though an unlogged change is the run's.
        coupled = column.part >= 0 and column.parameter.name in self.parts[column.part].choice.coupled
        return coupled or column.parameter.belongs == "machine"

    def column(self, key: Key) -> int:
        """Where a parameter of the sensors stands among the search coordinates."""
        return next(j for j, c in enumerate(self.local) if c.key == key)

    def freeze(self, *keys: Key) -> "Model":
        """The same model with these parameters of the sensors held."""
        active = self.active.copy()
        active[:, [self.column(key) for key in keys]] = False
        return Model(self.run, self.parts, active)

    def only(self, *keys: Key) -> "Model":
        """The same model with all parameters of the sensors held but these."""
        active = np.zeros_like(self.active)
        columns = [self.column(key) for key in keys]
        active[:, columns] = True
        return Model(self.run, self.parts, active)

    def with_shared(self, values: Array) -> "Model":
        """The same model with the parameters that sensors share held at these (ks,), in search coordinates."""
        held = Model(self.run, self.parts, self.active)
        held.low_shared = held.high_shared = values
        return held

    def _bounds(self, columns: list[Column]) -> tuple[Array, Array]:
        pairs = [_surroundings_bounds(self.run) if c.parameter is SINK else c.parameter.bounds(self.run) for c in columns]
        low, high = (np.array([p[i] for p in pairs], dtype=float) for i in (0, 1))
        log = np.array([c.parameter.log for c in columns], dtype=bool)
        return (np.where(log, np.log(np.maximum(v, 1e-300)), v) if len(v) else v for v in (low, high))  # type: ignore[return-value]

    @property
    def sink_guess(self) -> float:
        """Temperature of the surroundings: as logged, else the coolest first reading [degC]."""
        if self.run.sink_c is not None:
            return self.run.sink_c
        return _coolest_start(self.run)

    def forward(self, local: Array, shared: Array, sensor: Any) -> Array:
        """Readings (R, N) of rows with parameters local (R, kl), shared (R, ks) in search coordinates, of sensors (R,)."""
        here = np.where(self.log_local, np.exp(np.where(self.log_local, local, 0.0)), local)
        common = np.where(self.log_shared, np.exp(np.where(self.log_shared, shared, 0.0)), shared) if len(self.shared) else shared
        sink_c = np.full((len(sensor), 1), self.sink_guess)
        values: list[dict[str, Any]] = [{} for _ in self.parts]
        for j, c in enumerate(self.local):
            if c.part >= 0:
                column = here[:, j : j + 1]
                null = c.parameter.null
                if null is not None and not self.active[:, j].all():
                    column = np.where(self.active[sensor, j][:, None], column, null)
                values[c.part][c.parameter.name] = column
        for j, c in enumerate(self.shared):
            if c.part < 0:
                sink_c = common[:, j : j + 1]
            else:
                values[c.part][c.parameter.name] = self._where_it_acts(c, common[:, j : j + 1], sensor)
        drive = Drive.plain(self.run, sensor, sink_c)
        for part, named in zip(self.parts, values, strict=True):
            part.effect.apply(drive, self.run, Values(named, part.choice.constants))
        rate, level, start = (here[:, self.column(key)] for key in (RATE, LEVEL, START))
        return drive.forward(self.run, rate, level - sink_c[:, 0], start)

    def _where_it_acts(self, column: Column, values: Array, sensor: Any) -> Array:
        """Values (R, 1) of a parameter that sensors share: of an amplitude what makes it vanish, in sensors without the effect."""
        part, parameter = self.parts[column.part], column.parameter
        if part.concerned is None or parameter.name != part.effect.amplitude or parameter.null is None:
            return values
        null = parameter.null * (self.run.span if parameter.share else 1.0)
        return np.where(part.concerns(self.run.sensors)[sensor][:, None], values, null)

    def with_jacobian(
        self, local: Array, shared: Array, sensor: Any, curve: Array | None = None, by_shared: bool = True
    ) -> tuple[Array, Array, Array]:
        """(model (R, N), its derivatives by local (kl, R, N) and by shared (ks, R, N) parameters); `curve` where it is known.

        What is not searched in a sensor has no derivative there: it is 0. Without `by_shared` the second ones are 0 too.
        """
        rows, kl, ks = len(sensor), len(self.local), len(self.shared)
        step_l = self._steps(local, self.low_local, self.high_local, self.log_local)
        step_s = self._steps(shared, self.low_shared, self.high_shared, self.log_shared)
        first = 0 if curve is not None else 1
        # What belongs to one sensor stands together: rows beside each other with the same rate share the weights of their steps.
        many_l = np.repeat(local[:, None], first + kl + ks, axis=1)
        many_s = np.repeat(shared[:, None], first + kl + ks, axis=1)
        for j in range(kl):
            many_l[:, first + j, j] += step_l[:, j]
        for j in range(ks):
            many_s[:, first + kl + j, j] += step_s[:, j]
        wanted = np.ones((rows, first + kl + ks), dtype=bool)
        wanted[:, first : first + kl] = self.active[sensor]
        wanted[:, first + kl :] = by_shared
        found = self.forward(many_l[wanted], many_s[wanted], np.repeat(sensor, wanted.sum(axis=1)))
        row, at = np.nonzero(wanted)
        by = np.zeros((first + kl + ks, rows, found.shape[1]))
        if curve is None:
            curve = found[at == 0]
        moved = at >= first
        row, at, found = row[moved], at[moved], found[moved]
        steps = np.concatenate([step_l, step_s], axis=1)[row, at - first]
        by[at, row] = (found - curve[row]) / steps[:, None]
        return curve, by[first : first + kl], by[first + kl :]

    @staticmethod
    def _steps(values: Array, low: Array, high: Array, log: NDArray[np.bool_]) -> Array:
        width = np.where(log, 10.0, np.minimum(np.where(high > low, high - low, 1.0), 100.0))
        step = NUDGE * width * np.ones_like(values)
        return np.where(values + step > high, -step, step)

    def vector(self, named: dict[Key, Any]) -> tuple[Array, Array]:
        """Search coordinates local (S, kl), shared (ks,) from values by (part, name), clipped to the bounds; else start values."""
        n = self.run.sensors
        local, shared = np.empty((n, len(self.local))), np.empty(len(self.shared))
        for columns, out, log, low, high in (
            (self.local, local, self.log_local, self.low_local, self.high_local),
            (self.shared, shared, self.log_shared, self.low_shared, self.high_shared),
        ):
            for j, c in enumerate(columns):
                p = c.parameter
                value = named.get(Key(c.part, p.name))
                if value is None:
                    value = self.sink_guess if p is SINK else p.start * (self.run.span if p.share else 1.0)
                value = np.asarray(value, dtype=float)
                out[..., j] = np.clip(np.log(np.maximum(value, 1e-300)) if log[j] else value, low[j], high[j])
        return local, shared

    def place(self, local: Array, shared: Array, part: int, name: str, values: Array) -> None:
        """Write values (G,) of one parameter into search coordinates local (G, S, kl), shared (G, ks), clipped to its bounds."""
        for columns, out, log, low, high in (
            (self.local, local, self.log_local, self.low_local, self.high_local),
            (self.shared, shared, self.log_shared, self.low_shared, self.high_shared),
        ):
            for j, c in enumerate(columns):
                if c.key == Key(part, name):
                    inside = np.clip(np.log(np.maximum(values, 1e-300)) if log[j] else values, low[j], high[j])
                    out[..., j] = inside.reshape(-1, *[1] * (out.ndim - 2))

    def named(self, local: Array, shared: Array) -> dict[Key, Any]:
        """Natural values by (part, name): (S,) for local, a number for shared parameters."""
        found: dict[Key, Any] = {}
        for j, c in enumerate(self.local):
            found[c.key] = np.exp(local[:, j]) if self.log_local[j] else local[:, j].copy()
        for j, c in enumerate(self.shared):
            found[c.key] = float(np.exp(shared[j]) if self.log_shared[j] else shared[j])
        return found


def _coolest_start(run: Observations) -> float:
    firsts = [float(np.median(row[used][:3])) for row, used in zip(run.reading, run.used, strict=True) if used.any()]
    return min(firsts) if firsts else 20.0


def _surroundings_bounds(run: Observations) -> tuple[float, float]:
    """Least and greatest temperature of surroundings [degC] that nobody logged."""
    seen = np.where(run.used, run.reading, np.nan)
    low, high = float(np.nanmin(seen)), float(np.nanmax(seen))
    far = FAR_K + FAR * (high - low)
    return max(SINK.low, low - far), min(SINK.high, high + far)
