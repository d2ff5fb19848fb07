"""Outliers: those that leave their two neighbours on one side and come straight back; a record's noise and its logger's step."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import kernel
from ..core.kernel import Array


def difference_noise(reading: Array) -> Any:
    """Standard deviation of the noise [K] from the differences of neighbours (..., n), whatever the curve does; shape (...)."""
    if reading.shape[-1] < 3:
        return np.zeros(reading.shape[:-1])[()]
    step = reading[..., 1:] - reading[..., :-1]
    return 1.4826 * _median(np.abs(step - _median(step)[..., None])) / math.sqrt(2.0)


def exceeds_difference_noise(reading: Array, size: Array) -> NDArray[np.bool_]:
    """Whether sizes (S,) [K] are larger than :func:`difference_noise` of the readings (S, n).

    Of most, counting differences says that they are not.
    """
    may = np.empty(len(reading), dtype=np.uint8)
    kernel.may_exceed_difference_noise(np.ascontiguousarray(reading, dtype=float), np.ascontiguousarray(size, dtype=float), may)
    larger, asked = np.zeros(len(reading), dtype=bool), np.flatnonzero(may)
    larger[asked] = size[asked] > difference_noise(reading[asked])
    return larger


def _divided(reading: Array, time: Array) -> Array:
    """Third divided differences (n - 3,) in the size of those of evenly spaced readings."""
    t = np.stack([time[i : len(time) - 3 + i] for i in range(4)])
    gaps = t[:, None] - t[None, :] + np.eye(4)[:, :, None]
    weights = 1.0 / gaps.prod(axis=1)
    y = np.stack([reading[i : len(reading) - 3 + i] for i in range(4)])
    return np.asarray(math.sqrt(20.0) * (weights * y).sum(axis=0) / np.sqrt((weights**2).sum(axis=0)))


def third_difference_noise(reading: Array, time: Array | None = None) -> float:
    """Standard deviation of white noise [K] from third differences (n,): what a smooth curve leaves of them is nothing.

    time (n,) where the readings are not evenly spaced: divided differences, each scaled to the noise it carries.

    The larger of a robust and a trimmed estimate: in readings rounded to few steps the first is often nought.
    """
    if len(reading) < 8:
        return float(difference_noise(reading))
    third = np.diff(reading, 3) if time is None else _divided(reading, time)
    robust = 1.4826 * _median(np.abs(third - _median(third))) / math.sqrt(20.0)
    near = (
        third[np.abs(third) <= 5.0 * math.sqrt(20.0) * robust] if robust > 0.0 else third[np.abs(third) <= np.ptp(reading) / 20.0]
    )
    return max(float(robust), math.sqrt(float(near @ near) / len(near) / 20.0)) if len(near) else float(robust)


def _median(values: Array) -> Any:
    """numpy.median (..., n) without its checks, which cost more than the median of a sensor."""
    middle = values.shape[-1] // 2
    parted = np.partition(values, middle, axis=-1)
    if values.shape[-1] % 2:
        return parted[..., middle]
    # Parting at both middles would take six times as long.
    return 0.5 * (parted[..., :middle].max(axis=-1) + parted[..., middle])


def spike_weights(reading: Array, resolution: Array | float = 0.0) -> Array:
    """1 for a reading, 0 for an isolated spike; shape of reading, (n,) or (S, n).

    A spike differs from the median of itself and its neighbours by more than eight deviations of the noise, which is taken
    from the differences of the record. In a monotonic stretch that median is the reading itself, however steep.
    resolution [K], a number or (S,), is the logger's step.
    """
    rows = np.ascontiguousarray(np.atleast_2d(reading))
    weights = np.empty(rows.shape)
    kernel.spike_weights(rows, np.ascontiguousarray(np.broadcast_to(np.asarray(resolution, dtype=float), len(rows))), weights)
    return weights.reshape(reading.shape)


def bridged(time: Array, reading: Array, out: Any) -> Array:
    """Readings (S, n) at time (n,), those that are `out` (S, n) replaced by the line between their neighbours."""
    found = reading.copy()
    for line, gone in zip(found, out, strict=True):
        if gone.any() and not gone.all():
            line[gone] = np.interp(time[gone], time[~gone], line[~gone])
    return found


def logger_steps(reading: Array) -> Array:
    """The step [K] that all readings of a row (S, n) are multiples of, or 0 where none shows; (S,)."""
    if reading.shape[1] < 2:
        return np.zeros(len(reading))
    found = np.empty(len(reading))
    kernel.decimal_steps(np.ascontiguousarray(reading, dtype=float), found)
    others = np.flatnonzero(np.isnan(found))
    if len(others):
        found[others] = _steps_of_any(reading[others])
    return found


def _steps_of_any(reading: Array) -> Array:
    """As :func:`logger_steps`, of readings that need not be decimals."""
    ordered = np.round(reading, 9)
    ordered.sort(axis=1)
    gaps = ordered[:, 1:] - ordered[:, :-1]
    same = gaps == 0.0
    gaps[same] = np.inf
    step = gaps.min(axis=1)
    gaps[same] = 0.0
    known = np.isfinite(step) & (step >= 1e-6)
    gaps /= np.where(known, step, 1.0)[:, None]
    gaps -= np.rint(gaps)
    known &= np.maximum(gaps.max(axis=1), -gaps.min(axis=1)) <= 0.02
    return np.where(known, step, 0.0)


def logger_step(reading: Array) -> float:
    """As :func:`logger_steps` for one record (n,)."""
    return float(logger_steps(reading[None])[0])
