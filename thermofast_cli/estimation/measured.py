"""What readings themselves show: the equilibrium of a complete record, and whether they contradict what was said of them."""

import math

import numpy as np
from numpy.typing import NDArray

from ..errors import rounded
from .rules import RULES

Array = NDArray[np.float64]


def measured_equilibria(time: Array, reading: Array) -> tuple[Array, Array]:
    """(steady states [degC], settling times [min] after the first reading), each (S,), of records (S, n) that reached equilibrium.

    Complete means that the last fifth drifts by less than 0.6 % of the whole rise. The steady state is the mean of
    the last tenth; settled is the moment from which a running mean stays within 5 % of the rise. The
    mean runs over as many readings as bring the noise well inside that band. nan where a record is not complete, a time also where
    that mean would be too long.
    """
    sensors, n = reading.shape
    steady, settled = np.full(sensors, np.nan), np.full(sensors, np.nan)
    if n < RULES.fewest_complete:
        return steady, settled
    tail = n - max(int(n * RULES.drift_share), 6)
    level = reading[:, n - max(int(n * RULES.last_share), 3) :].mean(axis=1)
    rise = np.abs(level - np.sort(reading[:, :3], axis=1)[:, 1])
    at = time[tail:] - time[tail:].mean()
    values = reading[:, tail:] - reading[:, tail:].mean(axis=1, keepdims=True)
    slope = values @ at / float(at @ at)
    drift = np.abs(slope) * float(time[-1] - time[tail])
    noise = np.sqrt(np.maximum((values * values).sum(axis=1) - slope**2 * float(at @ at), 0.0) / len(at))
    complete = (rise > 0.0) & (drift <= RULES.complete * rise) & (noise * math.sqrt(12.0 / len(at)) <= RULES.complete * rise)
    steady[complete] = level[complete]
    with np.errstate(all="ignore"):
        width = np.maximum(3, np.ceil((6.0 * noise / (0.05 * rise)) ** 2))
    some = np.flatnonzero(complete & (width <= n // 10))
    odd = width[some].astype(int) | 1
    for wide in np.unique(odd[odd <= n // 10]).tolist():
        rows = some[odd == wide]
        sums = np.zeros((len(rows), n + 1))
        np.cumsum(reading[rows] - level[rows, None], axis=1, out=sums[:, 1:])
        outside = np.abs(sums[:, wide:] - sums[:, :-wide]) > (0.05 * wide) * rise[rows, None]
        last = np.where(outside.any(axis=1), outside.shape[1] - 1 - outside[:, ::-1].argmax(axis=1) + wide // 2, 0)
        settled[rows] = time[last + 1] - time[0]
    return steady, settled


def measured_equilibrium(time: Array, reading: Array) -> tuple[float, float | None] | None:
    """As :func:`measured_equilibria` for one record (n,), or None where it is not complete."""
    steady, settled = measured_equilibria(time, reading[None])
    if math.isnan(steady[0]):
        return None
    return float(steady[0]), None if math.isnan(settled[0]) else float(settled[0])


def outside_band(residual: Array, half_width: Array, noise: Array | float, factor: float = RULES.band_factor) -> NDArray[np.bool_]:
    """Which residuals (..., n) leave `factor` times the prediction's band; nan ones do not. Broadcasts."""
    with np.errstate(invalid="ignore"):
        outside: NDArray[np.bool_] = np.abs(residual) > factor * half_width + RULES.noise_factor * noise
    return outside


def contradicts(residual: Array, half_width: Array, noise: Array, factor: float = RULES.band_factor) -> NDArray[np.bool_]:
    """Whether the readings ahead (S, n), nan for one that does not count, leave the bands of S predictions; noise (S,) [K]."""
    outside = outside_band(residual, half_width, noise[:, None], factor).sum(axis=1)
    found: NDArray[np.bool_] = outside >= np.maximum(RULES.fewest_outside, RULES.share_outside * np.isfinite(residual).sum(axis=1))
    return found


def contradiction(residual: Array, half_width: Array, noise: float) -> float | None:
    """Largest residual [K] of the readings ahead (n,) where they leave the prediction's band, or None where they stay in it.

    half_width (n,) [K] is that of the 95 % band of the curve on the side of each residual, noise [K] a reading's deviation. A right
    model's curve leaves the band so widened about once in a thousand records.
    """
    if not contradicts(residual[None], half_width[None], np.array([noise]))[0]:
        return None
    return float(np.abs(residual[outside_band(residual, half_width, noise)]).max())


def words(size: float, until_min: float) -> str:
    """What to say of a contradiction of `size` [K]."""
    after = f"the readings after {until_min:.4g} min leave the prediction's band"
    return f"{after}, by up to {rounded(size)} K: the interval does not hold"
