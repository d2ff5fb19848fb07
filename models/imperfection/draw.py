"""Draws: records that the prior holds for likely, as of a test not yet made, and curves that the posterior of a run does."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .prior import COMPONENTS, Imperfection
from .shapes import Asked, covariances

Array = NDArray[np.float64]

#: Disturbances that all sensors of a run feel alike.
SHARED = ("room", "load")


def draw_record(
    prior: Imperfection, time: Array, tau: Array | float, rises: Array, noise: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """(readings, true limits), (S, n) and (S,) [K above the beginning]: law, background of the prior and white noise.

    time (n,) [min] from nought on; tau [min], of all or of each (S,), but for the prior's spread; rises (S,) [K]; noise (S,) or a
    number [K].
    """
    rows = len(time) + 1  # the readings and the limit
    of_room, of_load, of_own = _roots(prior, tuple(time.tolist()), float(np.median(tau)))
    sensors = len(rises)
    swing, air = of_load @ rng.standard_normal(rows), of_room @ rng.standard_normal(rows)
    beside = rises[:, None] * (swing + (of_own @ rng.standard_normal((rows, sensors))).T) + air
    own_tau = np.reshape(tau, (-1, 1)) * np.exp(prior.rate_spread * rng.standard_normal((sensors, 1)))
    clean = rises[:, None] * np.concatenate([-np.expm1(-time / own_tau), np.ones((sensors, 1))], axis=1) + beside
    white = np.broadcast_to(noise, (sensors,))[:, None] * rng.standard_normal((sensors, len(time)))
    return clean[:, :-1] + white, clean[:, -1]


@lru_cache(maxsize=32)  # a plan draws many records of one design
def _roots(prior: Imperfection, time: tuple[float, ...], tau: float) -> tuple[Array, Array, Array]:
    """Roots (n + 1, n + 1) of the covariances of readings and limit: by the room [K], by the load and by the sensors' own."""
    found = covariances(np.full(2, 1.0 / tau), np.array(time), time[-1], tau / 60.0, Asked(np.zeros(0)))[0]
    rows = len(time) + 1
    relative, absolute = prior.background.scaled(prior.multiplier).variances()
    common, own = np.zeros((rows, rows)), np.zeros((rows, rows))
    room = np.zeros((rows, rows))
    for i, name in enumerate(COMPONENTS):
        part = found[i, :rows, :rows]
        if name == "room":
            room += absolute[i] * part
        elif name in SHARED:
            common += relative[i] * part
        else:
            own += relative[i] * part
    tiny = 1e-12 * np.eye(rows)
    roots: list[Array] = [np.linalg.cholesky(k + tiny).astype(float) for k in (room, common, own)]
    return roots[0], roots[1], roots[2]


@dataclass(frozen=True)
class Drawn:
    """Of S sensors: curves (S, D, k) [degC] at the times asked for, where each leads (S, D) [degC], its rate (S, D) [1/min].

    factor (S, 2) is what the two sides of intervals are multiplied by, as those of the posterior itself are: that of what ends
    earlier or less far, and that of what ends later or farther.
    """

    curve: Array
    limit: Array
    rate: Array
    factor: Array

    @staticmethod
    def none(sensors: int, draws: int, times: int) -> "Drawn":
        """Of nothing yet."""
        curve, limit = np.full((sensors, draws, times), np.nan), np.full((sensors, draws), np.nan)
        return Drawn(curve, limit, limit.copy(), np.ones((sensors, 2)))


def conditional(
    reading: Array, noise: Array, ones: Array, law: Array, covariance: Array, rows: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Mean (r,) and covariance (r, r) of the rows asked for, given readings (m,): the sums of ``_mixture`` for one hypothesis.

    noise (m,) [K^2]; ones and law (m + k,); covariance (m + k, m + k) of the discrepancy. Start and rise have flat priors.
    """
    m = len(reading)
    factor = np.linalg.cholesky(covariance[:m, :m] + np.diag(noise))
    known = np.column_stack([reading, ones[:m], law[:m], covariance[:m, rows]])
    white = np.linalg.solve(factor, known)
    y, x, cross = white[:, 0], white[:, 1:3], white[:, 3:]
    inverse = np.linalg.inv(x.T @ x)
    beta = inverse @ (x.T @ y)
    target = np.column_stack([ones[rows], law[rows]])
    rest = target - cross.T @ x
    mean = target @ beta + cross.T @ (y - x @ beta)
    return mean, covariance[np.ix_(rows, rows)] - cross.T @ cross + rest @ inverse @ rest.T


def normal_draws(mean: Array, covariance: Array, count: int, rng: np.random.Generator) -> Array:
    """Draws (count, r); a covariance that rounding has made indefinite is taken without what is negative."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    found: Array = mean + rng.standard_normal((count, len(mean))) @ root.T
    return found
