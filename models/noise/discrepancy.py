"""What the readings do beside the model and beside white noise: slow disturbances that cannot be told from the physics for sure.

K = D + B B': D the white noise of the logger, B a few columns of unit Gaussian amplitudes. A column is a shape that a driving
process (a room that wanders, a load that flutters) takes, passed through the sensor's own lag; amplitudes belong to a sensor or are
shared by all of a run. A joint fit takes them as linear parameters with a prior, so that its normal equations keep the form of an
arrow.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ..core import kernel
from ..core.kernel import Array


@dataclass(frozen=True)
class Columns:
    """own (m, S, N) and shared (k, S, N) [K]: how the readings of S sensors move with amplitudes that are standard normal."""

    own: Array
    shared: Array

    @classmethod
    def none(cls, sensors: int, readings: int) -> "Columns":
        """White noise alone."""
        return cls(np.zeros((0, sensors, readings)), np.zeros((0, sensors, readings)))

    def discrepancy(self, own: Array, shared: Array) -> Array:
        """The disturbance (S, N) [K] of amplitudes own (S, m) and shared (k,)."""
        found: Array = np.einsum("sm,msn->sn", own, self.own) + np.einsum("k,ksn->sn", shared, self.shared)
        return found

    def draw(self, rng: np.random.Generator) -> Array:
        """A disturbance (S, N) [K] as likely as any."""
        sensors = self.own.shape[1]
        return self.discrepancy(rng.standard_normal((sensors, len(self.own))), rng.standard_normal(len(self.shared)))


@dataclass(frozen=True)
class Driving(ABC):
    """A random process behind the readings.

    scale: its size, in what ``covariance`` is of; into: 'sink', a temperature of the surroundings [K], or 'heat', relative to the
    heat, so that its effect grows with the rise; shared: all sensors of a run feel the same.
    """

    scale: float
    into: str = "sink"
    shared: bool = True

    @abstractmethod
    def covariance(self, time: Array, other: Array) -> Array:
        """Of the process at times (n,) and (m,) [min] after the record's first reading: (n, m)."""

    def shapes(self, span: float, points: int = 64, least: float = 1e-4) -> tuple[Array, Array]:
        """(times (n,), shapes (m, n)): the Karhunen-Loeve functions of the process over `span` [min], each of unit amplitude.

        Straight between the times. Left out are those with less than `least` of the variance of the first.
        """
        time = np.linspace(0.0, span, points)
        values, vectors = np.linalg.eigh(self.covariance(time, time))
        kept = values > least * values[-1]
        return time, (vectors[:, kept] * np.sqrt(values[kept])).T[::-1]


@dataclass(frozen=True)
class RandomWalk(Driving):
    """A room that wanders from where it was at the first reading: scale [K] per root hour."""

    def covariance(self, time: Array, other: Array) -> Array:
        found: Array = self.scale**2 / 60.0 * np.minimum(time[:, None], other)
        return found


@dataclass(frozen=True)
class Flutter(Driving):
    """A load that comes back to its mean: an Ornstein-Uhlenbeck process of deviation scale [1] and `memory` [min]."""

    into: str = "heat"
    memory: float = 30.0

    def covariance(self, time: Array, other: Array) -> Array:
        found: Array = self.scale**2 * np.exp(-np.abs(time[:, None] - other) / self.memory)
        return found


@dataclass(frozen=True)
class Noise:
    """White noise and what drives the readings beside it; white alone without any."""

    driven_by: tuple[Driving, ...] = ()

    def columns(self, time: Array, rate: Array, rise: Array, span: float | None = None) -> Columns:
        """At times (N,) [min] after the record's first reading, for sensors of rate (S,) [1/min] and rise (S,) [K].

        span [min] is that of the shapes, by default up to the last time: columns that belong together must have the same.
        """
        own: list[Array] = []
        shared: list[Array] = []
        for process in self.driven_by:
            grid, shapes = process.shapes(float(time[-1]) if span is None else span)
            fine = np.unique(np.concatenate([grid, time]))
            at = np.searchsorted(fine, time)
            size = rise[:, None] if process.into == "heat" else np.ones((len(rise), 1))
            for shape in shapes:
                driven = np.interp(fine, grid, shape)
                # A lump follows what drives it with its own lag; at the first reading nothing has come through yet.
                moved = np.empty((len(rate), len(fine)))
                kernel.followed(fine, np.ascontiguousarray(driven - driven[0]), np.ascontiguousarray(1.0 / rate), moved)
                late = moved[:, at] + driven[0] * -np.expm1(-rate[:, None] * time)
                (shared if process.shared else own).append(size * late)
        none = Columns.none(len(rate), len(time))
        return Columns(np.array(own) if own else none.own, np.array(shared) if shared else none.shared)
