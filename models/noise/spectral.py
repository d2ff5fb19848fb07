"""How likely residuals are under a disturbance of unknown size and colour, which every machine has a little of.

White noise calls any smooth misfit impossible. Here the residuals are white noise beside a slow disturbance whose spectrum is
1 + rho / (w^2 + a^2)^p, its size, corner and steepness those that suit the residuals at hand best. A model explains something
only if it makes its own residuals likelier than this unknown disturbance makes those of the model without it.
"""

from functools import lru_cache

import numpy as np
from scipy.fft import dct

from ..core.kernel import Array

#: Steepness p, corners a [cycles in the record], and powers rho of the disturbance, relative to the white noise.
STEEPNESS = (1.0, 2.0)
CORNERS = (0.0, 1.0, 3.0, 10.0, 30.0)
POWERS = tuple(np.concatenate([[0.0], np.geomspace(1e-2, 1e8, 41)]).tolist())


def block_means(residual: Array, weight: Array, time: Array, most: int = 500) -> tuple[Array, Array]:
    """Means (S, B) over at most `most` blocks of equal length of residuals (S, N) with weights (S, N), and weights (S, B).

    A block without readings is filled by a straight line between its neighbours, and has the weight of a usual one.
    """
    seen = np.flatnonzero((weight > 0.0).any(axis=0))
    first, last = time[seen[0]], time[seen[-1]]
    step = float(np.median(np.diff(time[seen]))) if len(seen) > 1 else 1.0
    count = max(2, min(most, round((last - first) / max(step, 1e-12)) + 1))
    place = np.clip(((time - first) / max(last - first, 1e-12) * (count - 1) + 0.5).astype(int), 0, count - 1)
    means, weights = np.zeros((len(residual), count)), np.zeros((len(residual), count))
    for i, (row, w) in enumerate(zip(residual, weight, strict=True)):
        weights[i] = np.bincount(place, w, count)
        total = np.bincount(place, w * row, count)
        there = weights[i] > 0.0
        if not there.any():
            continue
        means[i, there] = total[there] / weights[i, there]
        holes = np.flatnonzero(~there)
        means[i, holes] = np.interp(holes, np.flatnonzero(there), means[i, there])
        weights[i, holes] = float(np.median(weights[i, there]))
    return means, weights


@lru_cache(maxsize=8)
def _shapes(count: int) -> tuple[Array, Array]:
    """Inverse spectra (G, count) over the grid, and their log-determinants (G,)."""
    cycle = 0.5 * np.arange(count)  # cosine k has k / 2 cycles in the record
    shapes = [1.0 + rho / np.maximum(cycle**2 + corner**2, 0.25) ** p for p in STEEPNESS for corner in CORNERS for rho in POWERS]
    grid = np.array(shapes)
    return 1.0 / grid, np.log(grid).sum(axis=1)


def spectral_likelihood(means: Array, scale: Array) -> float:
    """Log-likelihood of block means (S, B) [K], white noise of scale (S,) [K] beside a disturbance as it suits them best.

    Sensors that move together count once: they are turned into independent combinations first. Constants are left out.
    """
    scaled = means / scale[:, None]
    _, turn = np.linalg.eigh(scaled @ scaled.T)
    power = dct(turn.T @ scaled, norm="ortho", axis=1) ** 2
    inverse, logs = _shapes(means.shape[1])
    n = means.shape[1]
    with np.errstate(all="ignore"):
        total = power @ inverse.T  # (S, G)
        size = np.maximum(total / n, 1.0)
        value = -0.5 * (n * np.log(size) + logs + total / size)
    return float(value.max(axis=1).sum())
