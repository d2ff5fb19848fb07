"""Are residuals noise, or does a pattern remain? And how much does it cost where neighbours are alike."""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array
from ..core.tails import f_tail, normal_tail

MOST_POINTS = 1000
COSINES = 8
#: A slow disturbance has this share of its spectrum's height as variance between neighbours.
SLOW_SHARE = 0.02


def _blocks(values: Array, axis: int, blocks: int) -> Array:
    """Means of `blocks` stretches along an axis."""
    n = values.shape[axis]
    edges = np.linspace(0, n, blocks + 1).astype(int)[:-1]
    size = np.diff(np.append(edges, n)).reshape((-1,) + (1,) * (-axis - 1))
    means: Array = np.add.reduceat(values, edges, axis=axis) / size
    return means


@lru_cache(maxsize=8)
def _cosines(n: int, count: int) -> Array:
    phase = math.pi * (np.arange(n) + 0.5) / n
    cosines: Array = np.cos(np.outer(phase, np.arange(1, count + 1))) * math.sqrt(2.0 / n)
    return cosines


def pattern_p_value(residual: Array, tangent: Array, slack: float = 0.0) -> Any:
    """Probability that white residuals of a fit would show as much pattern as these; one of each of S fits, (...).

    residual (..., n) in units of their noise, in order of time; tangent (..., n, m), the fit's Jacobian, whose directions the fit
    has already used up. Two looks, each at half the level: an F test of the first COSINES cosines over the record, which sees
    slow misfit, and the lag-one correlation (Durbin & Watson), which sees the rest. Long records are averaged
    over blocks first. `slack` is the variance, relative to the noise's, of slow disturbances that are no misfit (the noise of
    a logged input). Returns nan for fewer than 12 readings.
    """
    n = residual.shape[-1]
    if n < 12:
        return np.full(residual.shape[:-1], math.nan)[()]
    if n > MOST_POINTS:
        residual, tangent = _blocks(residual, -1, MOST_POINTS), _blocks(tangent, -2, MOST_POINTS)
        n = MOST_POINTS
    count = min(COSINES, n // 6)
    m = tangent.shape[-1]
    cosines = _cosines(n, count)
    # What the cosines explain beyond the tangent; a cosine that the fit can imitate is left with nothing but rounding.
    across = np.ascontiguousarray(tangent.swapaxes(-1, -2))
    gram = np.empty((*residual.shape[:-1], m + count, m + count))
    # Row by row, as sums of products: products of matrices so narrow take three times as long.
    gram[..., :m, :m] = (across[..., :, None, None, :] @ across[..., None, :, :, None])[..., 0, 0]
    length = np.maximum(np.sqrt(np.einsum("...mm->...m", gram[..., :m, :m])), 1e-300)
    # One after the other: the square of nothing's length is no number.
    gram[..., :m, :m] = gram[..., :m, :m] / length[..., :, None] / length[..., None, :]
    # As one product of two matrices, which is several times as fast as a product for each fit.
    gram[..., :m, m:] = (across.reshape(-1, n) @ cosines).reshape(*across.shape[:-1], count) / length[..., None]
    gram[..., m:, :m] = gram[..., :m, m:].swapaxes(-1, -2)
    gram[..., m:, m:] = cosines.T @ cosines
    along = np.concatenate([(across[..., None, :] @ residual[..., None, :, None])[..., 0, 0] / length, residual @ cosines], axis=-1)
    np.einsum("...ii->...i", gram)[...] += 1e-11
    explained = (along * np.linalg.solve(gram, along[..., None])[..., 0]).sum(axis=-1)
    # At its optimum a fit leaves nothing along its own directions; the means of uneven blocks do.
    own = np.linalg.solve(gram[..., :m, :m], along[..., :m, None])[..., 0]
    explained = np.maximum(explained - (along[..., :m] * own).sum(axis=-1), 0.0)
    total = (residual * residual).sum(axis=-1)
    rest = n - m - count
    with np.errstate(all="ignore"):
        f = (explained / count) / np.maximum((total - explained) / rest, 1e-300)
        slow = f_tail(count, rest, f / (1.0 + slack))
        # A fit makes neighbouring residuals slightly opposite: about -m/n in the lag-one correlation.
        lag_one = (residual[..., 1:] * residual[..., :-1]).sum(axis=-1) / total + m / n
    fast = normal_tail(lag_one * math.sqrt(n) - SLOW_SHARE * slack * math.sqrt(n))
    return np.where(total > 0.0, np.minimum(1.0, 2.0 * np.minimum(slow, fast)), 1.0)[()]


def pattern_p_values(residual: Array, tangent: Array, used: NDArray[np.bool_]) -> Array:
    """:func:`pattern_p_value` of each row (S, n), tangent (S, n, m), over the readings that are used; nan where none is."""
    return _over_used(pattern_p_value, used, residual, tangent)


def variance_inflations(residual: Array, used: NDArray[np.bool_]) -> Array:
    """:func:`variance_inflation` of each row (S, n), over the readings that are used; nan where none is."""
    return _over_used(variance_inflation, used, residual)


def _over_used(told: Callable[..., Any], used: NDArray[np.bool_], *given: Array) -> Array:
    """What is told of each row of arrays (S, n, ...) over the readings used (S, n): of rows that are used whole in one call."""
    whole = used.all(axis=1)
    if whole.all():
        return np.asarray(told(*given))
    found = np.full(len(used), np.nan)
    if whole.any():
        found[whole] = told(*(a[whole] for a in given))
    for i in np.flatnonzero(~whole & used.any(axis=1)):
        found[i] = told(*(a[i][used[i]] for a in given))
    return found


def variance_inflation(residual: Array) -> Any:
    """How many dependent readings (..., n) count as one: 1 + 2 sum of the autocorrelations up to the first small one."""
    n = residual.shape[-1]
    total = np.einsum("...n,...n->...", residual, residual)
    if n < 8:
        return np.ones(residual.shape[:-1])[()]
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(residual, size)) ** 2
    with np.errstate(all="ignore"):
        correlation = np.fft.irfft(power, size)[..., 1 : n // 2] / total[..., None]
    kept = np.logical_and.accumulate(correlation >= 0.05, axis=-1)
    found = 1.0 + 2.0 * np.where(kept, correlation, 0.0).sum(axis=-1)
    return np.where(total > 0.0, np.clip(found, 1.0, n / 4.0), 1.0)[()]
