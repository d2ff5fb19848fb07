"""Are residuals noise, or does a pattern remain? And how much does it cost where neighbours are alike."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import kernel
from ..core._lump_numpy import COSINES, FEWEST_POINTS, MOST_POINTS
from ..core.kernel import Array
from ..core.tails import f_tail, normal_tail

#: A slow disturbance has this share of its spectrum's height as variance between neighbours.
SLOW_SHARE = 0.02


def pattern_p_value(residual: Array, tangent: Array, slack: float = 0.0) -> Any:
    """Probability that white residuals of a fit would show as much pattern as these; one of each of S fits, (...).

    residual (..., n) in units of their noise, in order of time; tangent (..., n, m), the fit's Jacobian, whose directions the fit
    has already used up. Two looks, each at half the level: an F test of the first cosines over the record, which sees
    slow misfit, and the lag-one correlation (Durbin & Watson), which sees the rest. Long records are averaged
    over blocks first. `slack` is the variance, relative to the noise's, of slow disturbances that are no misfit (the noise of
    a logged input). Returns nan for fewer than 12 readings.
    """
    n, m = tangent.shape[-2:]
    rows = np.ascontiguousarray(residual, dtype=float).reshape(-1, n)
    columns = np.ascontiguousarray(tangent.swapaxes(-1, -2), dtype=float).reshape(-1, m, n)
    sums = np.empty((len(rows), 3))
    kernel.pattern_sums(rows, columns, sums)
    return _p_of(sums, n, m, slack).reshape(residual.shape[:-1])[()]


def law_patterns(time: Array, reading: Array, weight: Array, rate: Array) -> tuple[Array, Array, Array]:
    """:func:`pattern_p_value` of the law fitted to S records (S, n) at time (n,), of rate (S,); the amplitudes follow from it.

    Only readings of positive weight (S, n) count. Returns (p value (S,), residual (S, n) times the root of the weight, 0 where
    there is none, root mean square (S,) of the residual without weights); nan where the rate is.
    """
    t, y, w, rates = (np.ascontiguousarray(a, dtype=float) for a in (time, reading, weight, rate))
    residual, sums, p = np.empty(y.shape), np.empty((len(y), 5)), np.full(len(y), np.nan)
    kernel.law_patterns(t, y, w, rates, residual, sums)
    used = sums[:, 4]
    for n in np.unique(used[used >= FEWEST_POINTS]).tolist():  # few lengths: readings that are left out are few
        p[used == n] = _p_of(sums[used == n], int(n), 3)
    with np.errstate(invalid="ignore"):
        return p, residual, np.sqrt(sums[:, 3] / used)


def _p_of(sums: Array, n: int, m: int, slack: float = 0.0) -> Array:
    """P values (S,) of sums (S, 3 ...) as :func:`kernel.pattern_sums` tells them, of n residuals of a fit of m parameters."""
    explained, total, neighbours = sums[:, :3].T
    n = min(n, MOST_POINTS)
    count = min(COSINES, n // 6)
    rest = n - m - count
    with np.errstate(all="ignore"):
        f = (explained / count) / np.maximum((total - explained) / rest, 1e-300)
        slow = f_tail(count, rest, f / (1.0 + slack))
        # A fit makes neighbouring residuals slightly opposite: about -m/n in the lag-one correlation.
        lag_one = neighbours / total + m / n
    fast = normal_tail(lag_one * math.sqrt(n) - SLOW_SHARE * slack * math.sqrt(n))
    return np.where(total == 0.0, 1.0, np.minimum(1.0, 2.0 * np.minimum(slow, fast)))


def variance_inflations(residual: Array, used: NDArray[np.bool_]) -> Array:
    """:func:`variance_inflation` of each row (S, n), over the readings that are used; nan where none is."""
    whole, found = used.all(axis=1), np.full(len(used), np.nan)
    found[whole] = variance_inflation(residual[whole])  # those that are used whole in one call
    for i in np.flatnonzero(~whole & used.any(axis=1)):
        found[i] = variance_inflation(residual[i, used[i]])
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
