"""Readings that came after the identification time against what was said of them: a row is never ok against its own evidence."""

import numpy as np
from numpy.typing import NDArray

from .rules import RULES

Array = NDArray[np.float64]


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
    return f"the readings after {until_min:.4g} min leave the prediction's band, by up to {size:.2g} K: the interval does not hold"
