"""A difference equation from temperatures to displacement, found by recursive least squares: a shaft that lags its bearing.

Yang et al. 2014, J. Jilin Univ. (Eng.) 44(2), equations (6)-(10): y_k = sum b_ij u_j,k-i - sum a_i y_k-i + c. Told is the free run
from the first reading of each run, never the next reading from the last ones measured: that would say nothing of the temperatures.
"""

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from thermofast.filters.rls import RecursiveLeastSquares, arx_regressor
from thermofast.models.displacement import Method, Sample
from thermofast.models.displacement.fits import Array, Mask, Prediction, calibrated, standard

#: Orders (outputs, inputs) among which the least error is looked for.
ORDERS = ((1, 1), (2, 1), (2, 2))
#: Rows of a run that are worked on; a longer one is averaged.
MOST_ROWS = 800
#: Least rows for each parameter.
ROWS_PER_PARAMETER = 5
#: Largest root of the output's own equation: beyond it a free run wanders off.
LARGEST_ROOT = 0.9999
#: Covariance that the search starts with, in units of the standardised columns: a ridge of one hundredth of a reading.
START = 100.0
INNER = 4
#: Times as many steps as readings at which a run is little but gaps; fewer averaged rows than this are no run.
MOST_GAPS = 4


@dataclass(frozen=True)
class _Coarse:
    """Evenly spaced rows of all runs: inputs (M, S) and output (M,) standardised, used (M,), first row of each run, step [min]."""

    inputs: Array
    output: Array
    minutes: Array
    used: Mask
    firsts: list[int]


def arx(order: tuple[int, int] | None = None) -> Method:
    """The method of a difference equation of that order, or of the best of a few."""
    return partial(_told, order)


def _told(order: tuple[int, int] | None, sample: Sample, used: Mask) -> Prediction:
    columns = sample.temperatures if sample.inputs is None else np.concatenate([sample.temperatures, sample.inputs], axis=1)
    low, size = sample.displacement[used].mean(), max(float(sample.displacement[used].std()), 1e-12)
    centre, scale = standard(columns[used])
    coarse = _coarse(
        replace(sample, temperatures=(columns - centre) / scale, displacement=(sample.displacement - low) / size), used
    )
    found: dict[tuple[int, int], Array] = {}
    why = ""
    for one in (order,) if order is not None else ORDERS:
        try:
            found[one] = _free_run(coarse, coarse.used, one)
        except ValueError as error:
            why = str(error)
    if not found:
        raise ValueError(why)
    best = min(found, key=lambda one: _criterion(coarse, found[one], one))
    deviation = size * _held_out(sample, (sample.displacement - low) / size, used, coarse, best)
    mean = _at_readings(sample, coarse, found[best])
    return Prediction(low + size * mean, np.full(len(mean), deviation), f"order {best[0]}, {best[1]}")


def _coarse(sample: Sample, used: Mask) -> _Coarse:
    """Readings on one even step, means over as many steps as leave MOST_ROWS of the longest run; what is missing is not used.

    Raises ValueError where readings are not at multiples of one step, or a run has none, or little but gaps.
    """
    stretches = sample.stretches()
    apart = [np.diff(sample.minutes[rows]) for rows in stretches]
    step = float(np.median(np.concatenate(apart))) if any(len(a) for a in apart) else 0.0
    if not step > 0.0:
        raise ValueError("a difference equation needs readings at even times, alike in all runs")
    steps = [np.maximum(1, np.round(a / step)).astype(np.int64) for a in apart]
    off = np.concatenate([np.abs(a - step * n) > 0.02 * step for a, n in zip(apart, steps, strict=True)])
    if float(off.mean()) > 0.02:
        raise ValueError("a difference equation needs readings at even times, alike in all runs")
    longest = max(int(n.sum()) + 1 for n in steps)
    stride = max(1, -(-longest // MOST_ROWS))
    parts, firsts, count = [], [], 0
    for rows, n in zip(stretches, steps, strict=True):
        at = np.concatenate([[0], np.cumsum(n)])
        whole = (int(at[-1]) + 1) // stride * stride
        if whole < MOST_GAPS * stride or at[-1] + 1 > MOST_GAPS * len(rows):
            raise ValueError(f"a run of {len(rows)} readings over {step * at[-1]:.4g} min: too short, or little but gaps")
        grid = np.arange(whole)
        there = np.zeros(at[-1] + 1, dtype=bool)
        there[at] = used[rows]
        columns = [sample.temperatures[rows].T, sample.displacement[rows][None], sample.minutes[rows][None]]
        even = np.stack([np.interp(grid, at, column) for column in np.concatenate(columns)])
        means = even.reshape(len(even), -1, stride).mean(axis=2)
        parts.append((means, there[:whole].reshape(-1, stride).all(axis=1)))
        firsts.append(count)
        count += means.shape[1]
    together = np.concatenate([means for means, _ in parts], axis=1)
    return _Coarse(together[:-2].T, together[-2], together[-1], np.concatenate([own for _, own in parts]), firsts)


def _free_run(coarse: _Coarse, used: Mask, order: tuple[int, int]) -> Array:
    """Output (M,) of the equation fitted to `used` rows, run freely through all.

    Raises ValueError where the rows are too few for the order, or the equation is unstable.
    """
    na, nb = order
    inputs, output = coarse.inputs, coarse.output
    lag, ends = max(na, nb - 1), [*coarse.firsts, len(output)]
    size = na + nb * inputs.shape[1] + 1
    rows = [k for a, b in pairwise(ends) for k in range(a + lag, b) if used[k - lag : k + 1].all()]
    if len(rows) < ROWS_PER_PARAMETER * size:
        need = ROWS_PER_PARAMETER * size
        raise ValueError(f"order {na}, {nb} has {size} parameters: {need} readings in a row are needed, {len(rows)} are there")
    fit = RecursiveLeastSquares(np.zeros(size), START * np.eye(size))
    for k in rows:
        fit.update(_regressor(output[k - lag : k], inputs[k - lag : k + 1], na, nb), float(output[k]))
    roots = np.roots(np.concatenate([[1.0], -fit.theta[:na]]))
    if not np.abs(roots).max() < LARGEST_ROOT:
        raise ValueError(f"order {na}, {nb}: the equation found is unstable, its readings do not bear it")
    own, by, constant = fit.theta[:na], fit.theta[na:-1].reshape(inputs.shape[1], nb), float(fit.theta[-1])
    told = np.empty(len(output))
    for a, b in pairwise(ends):
        still = (float(by.sum(axis=1) @ inputs[a]) + constant) / (1.0 - float(own.sum()))
        first = float(output[a]) if used[a] else still
        before = [first] * na
        driven = sum(by[:, i] @ np.concatenate([np.repeat(inputs[a : a + 1], i, axis=0), inputs[a : b - i]]).T for i in range(nb))
        for k in range(b - a):
            value = first if k == 0 else float(own @ before) + float(driven[k]) + constant
            told[a + k] = value
            before = [value, *before[:-1]]
    return told


def _regressor(outputs: Array, inputs: Array, na: int, nb: int) -> Array:
    """Regressor (na + S nb + 1,) of the next output: its last ones, each input's last ones with that of the moment, one."""
    own = arx_regressor(outputs, np.zeros(0), na, 0)
    each = [arx_regressor(np.zeros(0), column, 0, nb) for column in inputs.T]
    return np.concatenate([own, *each, [1.0]])


def _criterion(coarse: _Coarse, told: Array, order: tuple[int, int]) -> float:
    """Akaike's, of the free run's errors."""
    error = (told - coarse.output)[coarse.used]
    size = order[0] + order[1] * coarse.inputs.shape[1] + 1
    return float(len(error) * np.log(np.mean(error**2) + 1e-12) + 2.0 * size)


def _at_readings(sample: Sample, coarse: _Coarse, told: Array) -> Array:
    """What is told of the even steps (M,) at the readings (N,)."""
    mean, firsts = np.empty(len(sample.run)), [*coarse.firsts, len(told)]
    for rows, (a, b) in zip(sample.stretches(), pairwise(firsts), strict=True):
        mean[rows] = np.interp(sample.minutes[rows], coarse.minutes[a:b], told[a:b])
    return mean


def _held_out(sample: Sample, output: Array, used: Mask, coarse: _Coarse, order: tuple[int, int]) -> float:
    """Deviation of a reading (not of a mean of several) from what is told, from stretches that are left out in turn."""
    errors = []
    rows = np.flatnonzero(used)
    for steps, out in zip(np.array_split(np.flatnonzero(coarse.used), INNER), np.array_split(rows, INNER), strict=True):
        inner = coarse.used.copy()
        inner[steps] = False
        try:
            errors.append((_at_readings(sample, coarse, _free_run(coarse, inner, order)) - output)[out])
        except ValueError:
            continue
    if not errors:
        errors.append((_at_readings(sample, coarse, _free_run(coarse, coarse.used, order)) - output)[rows])
    return float(calibrated(np.concatenate(errors)))
