"""Moment transforms: how a Gaussian is carried through one step of the model. A plug point of every Gaussian filter."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Array, StateModel

#: Where sigma points stand and what they count, as the compiled loop is given it.
POINTS = np.dtype([(name, float) for name in ("spread", "centre_mean", "centre_covariance", "each")])


def semidefinite_root(matrix: Array) -> Array:
    """Lower factor of a positive semidefinite matrix (n, n).

    Raises
    ------
    numpy.linalg.LinAlgError: indefinite beyond rounding.
    """
    n = len(matrix)
    root = np.zeros((n, n))
    for j in range(n):
        if abs(matrix[j, j]) < 1e-200:  # a slope long settled: its variance has run out of digits
            continue
        pivot = matrix[j, j] - root[j, :j] @ root[j, :j]
        if not pivot > 1e-14 * matrix[j, j]:
            if not pivot >= -1e-9 * abs(matrix[j, j]):
                raise np.linalg.LinAlgError(f"covariance is indefinite: pivot {pivot:g} in row {j}")
            continue
        root[j, j] = math.sqrt(pivot)
        root[j + 1 :, j] = (matrix[j + 1 :, j] - root[j + 1 :, :j] @ root[j, :j]) / root[j, j]
    return root


@dataclass(frozen=True)
class Moments(ABC):
    """Carries mean (n,) and covariance (n, n) through one step of dt minutes.

    The covariance is per unit of `scale`, the noise variance: sigma points stand where the true covariance puts them.
    """

    #: Whether the compiled loop knows this transform; where not, the readable loop is taken.
    compiled: ClassVar[bool] = True

    @abstractmethod
    def predict(self, model: StateModel, mean: Array, covariance: Array, dt: float, scale: float) -> tuple[Array, Array]: ...

    @abstractmethod
    def compiled_settings(self, n: int) -> tuple[float, float, float, float] | None:
        """Where sigma points stand, in the order of :data:`POINTS`; None for the linearised form."""


@dataclass(frozen=True)
class _SigmaPoints(Moments):
    def root(self, covariance: Array) -> Array:
        """Factor (n, n) of a covariance along whose columns the points stand."""
        return semidefinite_root(covariance)

    @abstractmethod
    def weights(self, n: int) -> tuple[float, float, float, float]:
        """Spread of the points, weight of the centre in the mean and in the covariance, weight of every other point."""

    def predict(self, model: StateModel, mean: Array, covariance: Array, dt: float, scale: float) -> tuple[Array, Array]:
        n = len(mean)
        spread, mean0, cov0, each = self.weights(n)
        arms = spread * math.sqrt(scale) * self.root(covariance).T
        moved = model.step(np.concatenate([mean + arms, mean - arms]), dt)
        centre = model.step(mean, dt)
        new_mean = each * moved.sum(axis=0) + mean0 * centre
        moved, centre = moved - new_mean, centre - new_mean
        return new_mean, (each * moved.T @ moved + cov0 * np.outer(centre, centre)) / scale

    def compiled_settings(self, n: int) -> tuple[float, float, float, float]:
        return self.weights(n)


@dataclass(frozen=True)
class SymmetricPoints(_SigmaPoints):
    """The 2n points mean +- columns of sqrt(n P), each of weight 1/(2n): equations (3), (8)."""

    def weights(self, n: int) -> tuple[float, float, float, float]:
        return math.sqrt(n), 0.0, 0.0, 0.5 / n


@dataclass(frozen=True)
class ScaledPoints(_SigmaPoints):
    """The 2n + 1 scaled points of equation (4), with their own spread sqrt((n + delta) P).

    spread is the paper's phi, kappa its kappa, shape its eta (2 for a Gaussian).
    """

    spread: float = 1.0
    kappa: float = 0.0
    shape: float = 2.0

    def weights(self, n: int) -> tuple[float, float, float, float]:
        delta = self.spread**2 * (n + self.kappa) - n
        mean0 = delta / (n + delta)
        return math.sqrt(n + delta), mean0, mean0 + 1.0 - self.spread**2 + self.shape, 0.5 / (n + delta)


def sigma_points(spread: float) -> Moments:
    """The 2n points for a spread of 0, the scaled 2n + 1 points for the paper's phi above it."""
    return ScaledPoints(spread) if spread > 0.0 else SymmetricPoints()


@dataclass(frozen=True)
class Linearised(Moments):
    """First-order propagation with the Jacobian of the step: the extended Kalman filter."""

    def predict(self, model: StateModel, mean: Array, covariance: Array, dt: float, scale: float) -> tuple[Array, Array]:
        jacobian = model.jacobian(mean, dt)
        return model.step(mean, dt), jacobian @ covariance @ jacobian.T

    def compiled_settings(self, n: int) -> None:
        return None
