"""Cubature quadrature points: the spherical rule of degree three times a Gauss-Laguerre rule along the radius."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from .base import Array, StateModel
from .moments import Moments, semidefinite_root


@lru_cache(maxsize=64)
def cubature_quadrature(n: int, order: int) -> tuple[Array, Array]:
    """Points (2 n order, n) and weights (2 n order,) of a unit Gaussian in n dimensions, read-only: equations (24), (25).

    A point is sqrt(2 lambda) times a signed unit vector, lambda a node of the Gauss-Laguerre rule for the weight
    lambda^(n/2 - 1) exp(-lambda). Moments of the radius are exact up to degree 4 order - 2, those of the coordinates up to
    degree 3 at any order: a higher order refines the radius alone. Order 1 is the 2n points of the cubature Kalman filter.

    Raises
    ------
    ValueError: n or order below 1.
    """
    if n < 1 or order < 1:
        raise ValueError(f"cubature points need at least one dimension and order 1, not n = {n}, order = {order}")
    # Eigenvalues of the Jacobi matrix rather than the polynomial (20) and its derivative in (21): no factorial overflows.
    alpha, k = 0.5 * n - 1.0, np.arange(order)
    side = np.sqrt(k[1:] * (k[1:] + alpha))
    nodes, vectors = np.linalg.eigh(np.diag(2.0 * k + alpha + 1.0) + np.diag(side, 1) + np.diag(side, -1))
    axes = np.concatenate([np.eye(n), -np.eye(n)])
    points = (np.sqrt(2.0 * nodes)[:, None, None] * axes).reshape(-1, n)
    weights = np.repeat(vectors[0] ** 2 / (2.0 * n), 2 * n)
    points.setflags(write=False)
    weights.setflags(write=False)
    return points, weights


@dataclass(frozen=True)
class CubaturePoints(Moments):
    """The 2 n order points of the cubature quadrature Kalman filter: section 1.3 of doi:10.13700/j.bh.1001-5965.2017.0312."""

    compiled: ClassVar[bool] = False
    order: int = 2

    def predict(self, model: StateModel, mean: Array, covariance: Array, dt: float, scale: float) -> tuple[Array, Array]:
        points, weights = cubature_quadrature(len(mean), self.order)
        root = math.sqrt(scale) * semidefinite_root(covariance)
        moved = model.step(mean + points @ root.T, dt)
        new_mean = weights @ moved
        moved = moved - new_mean
        return new_mean, (weights * moved.T) @ moved / scale

    def compiled_settings(self, n: int) -> None:
        return None
