"""Are residuals noise, or does a pattern remain? And how much does it cost where neighbours are alike."""

import math
from functools import lru_cache

import numpy as np

from ..core.kernel import Array
from ..core.tails import f_tail, normal_tail

MOST_POINTS = 1000
COSINES = 8
#: A slow disturbance has this share of its spectrum's height as variance between neighbours.
SLOW_SHARE = 0.02


def _blocks(values: Array, blocks: int) -> Array:
    edges = np.linspace(0, len(values), blocks + 1).astype(int)[:-1]
    means: Array = (
        np.add.reduceat(values, edges, axis=0) / np.diff(np.append(edges, len(values)))[(...,) + (None,) * (values.ndim - 1)]
    )
    return means


@lru_cache(maxsize=8)
def _cosines(n: int, count: int) -> Array:
    phase = math.pi * (np.arange(n) + 0.5) / n
    cosines: Array = np.cos(np.outer(phase, np.arange(1, count + 1))) * math.sqrt(2.0 / n)
    return cosines


def pattern_p_value(residual: Array, tangent: Array, slack: float = 0.0) -> float:
    """Probability that white residuals of a fit would show as much pattern as these.

    residual (n,) in units of their noise, in order of time; tangent (n, m), the fit's Jacobian, whose directions the fit has
    already used up. Two looks, each at half the level: an F test of the first COSINES cosines over the record, which sees
    slow misfit, and the lag-one correlation (Durbin & Watson), which sees the rest. Long records are averaged
    over blocks first. `slack` is the variance, relative to the noise's, of slow disturbances that are no misfit (the noise of
    a logged input). Returns nan for fewer than 12 readings.
    """
    n = len(residual)
    if n < 12:
        return math.nan
    if n > MOST_POINTS:
        residual, tangent = _blocks(residual, MOST_POINTS), _blocks(tangent, MOST_POINTS)
        n = MOST_POINTS
    count = min(COSINES, n // 6)
    scale = np.maximum(np.sqrt((tangent * tangent).sum(axis=0)), 1e-300)
    basis = np.concatenate([tangent / scale, _cosines(n, count)], axis=1)
    # What the cosines explain beyond the tangent; a cosine that the fit can imitate is left with nothing but rounding.
    gram, along = basis.T @ basis, basis.T @ residual
    m = tangent.shape[1]
    ridge = 1e-11 * np.eye(m + count)
    explained = float(along @ np.linalg.solve(gram + ridge, along))
    # At its optimum a fit leaves nothing along its own directions; the means of uneven blocks do.
    explained = max(explained - float(along[:m] @ np.linalg.solve((gram + ridge)[:m, :m], along[:m])), 0.0)
    total = float(residual @ residual)
    rest = n - tangent.shape[1] - count
    if not total > 0.0:
        return 1.0
    f = (explained / count) / max((total - explained) / rest, 1e-300)
    slow = f_tail(count, rest, f / (1.0 + slack))
    # A fit makes neighbouring residuals slightly opposite: about -m/n in the lag-one correlation.
    lag_one = float(residual[1:] @ residual[:-1]) / total + tangent.shape[1] / n
    fast = normal_tail(lag_one * math.sqrt(n) - SLOW_SHARE * slack * math.sqrt(n))
    return min(1.0, 2.0 * min(slow, fast))


def variance_inflation(residual: Array) -> float:
    """How many dependent readings count as one independent: 1 + 2 sum of the autocorrelations up to the first small one."""
    n = len(residual)
    total = float(residual @ residual)
    if n < 8 or not total > 0.0:
        return 1.0
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(residual, size)) ** 2
    correlation = np.fft.irfft(power, size)[1 : n // 2] / total
    small = np.flatnonzero(correlation < 0.05)
    kept = correlation[: small[0]] if len(small) else correlation
    return float(min(max(1.0 + 2.0 * kept.sum(), 1.0), n / 4.0))
