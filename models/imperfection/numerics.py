"""Small numerics of the posterior: grids of log rates, sums of exponentials, quantiles of mixtures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _mixture_numpy
from .blocks import Blocks

core: Any
try:
    from . import _mixture as core
except ImportError:
    core = _mixture_numpy

Array = NDArray[np.float64]

LEVELS = np.array([0.025, 0.5, 0.975])
#: Deviations of a normal between its median and the last of these.
SIGMAS = 1.96
#: Weights of a mixture that together are less than this are left out of its quantiles, the smallest first.
LEAST_TOGETHER = 2e-3
#: A normal in three parts: where they lie, how much of it each is, and the deviation of each, in its deviations.
NODES, NODE_SHARES, WITHIN_NODE = np.array([-1.2, 0.0, 1.2]), np.array([0.3, 0.4, 0.3]), float(np.sqrt(1.0 - 0.6 * 1.2**2))
#: Sensors of which tables of evidence are worked on at a time.
BATCH = 8
#: Newton's steps to where a slow part has settled.
NEWTON = 6


def negligible(weight: Array) -> float:
    """The largest of the smallest weights (n,) that together are no more than LEAST_TOGETHER of all."""
    ascending = np.sort(weight)
    less = np.searchsorted(np.cumsum(ascending), LEAST_TOGETHER * ascending.sum(), "right")
    return float(ascending[less - 1]) if less else -1.0


def settled_after(
    rate: Array, rise: Array, ahead: Array, spread: Array, turns: Array | float, pace: Array | float
) -> tuple[Array, Array]:
    """Minutes until 95 % are done and their deviation, where a discrepancy has the point `ahead` [K] of the law at that time.

    The law is there after `turns` time constants, where what is left falls `pace` times as fast as it: for one exponential
    exp(-b t) = 0.05 + ahead / rise. Far behind the law that has no solution: from half of the 5 % on its tangent stands.
    """
    with np.errstate(all="ignore"):
        share = np.nan_to_num(ahead / rise, nan=0.0, posinf=0.0, neginf=0.0)
        near = np.clip(share, -0.025, 0.95)
        left = 0.05 + near
        time = (turns - (np.log(left / 0.05) + (share - near) / left) / pace) / rate
        return np.maximum(time, 0.0), np.minimum(np.nan_to_num(spread / np.abs(rise), posinf=1e6) / (left * pace * rate), 1e6)


def settled_behind(
    rate: Array, rise: Array, ahead: Array, spread: Array, turns: Array | float, pace: Array | float, mode: Array
) -> tuple[Array, Array, Array]:
    """As :func:`settled_after` where a slow part is at work, `mode` (n,) times as fast as the law: (shares, minutes, their
    deviations), each (nodes, n).

    What is still to come then comes as slowly as that part: exp(-x) + p exp(-mode x) = 0.05 (1 + p), of the amplitude p that
    leaves as much at the law's own time. The time grows faster than what is left, so that a normal is taken in three parts.
    """
    at = ahead + NODES[:, None] * spread
    shares = np.broadcast_to(NODE_SHARES[:, None], at.shape)
    time, deviation = settled_after(*np.broadcast_arrays(rate, rise, at, WITHIN_NODE * spread, turns, pace))
    with np.errstate(all="ignore"):
        left = np.nan_to_num(-at / rise, nan=0.0, posinf=0.0, neginf=0.0)
        then = np.exp(-mode * turns) - 0.05
        size = np.minimum(left / then, 1e3)
        late = (left > 0.0) & (then > 0.0)
        # From the left, where the sum is above its mark, Newton's steps do not pass the root of what falls ever more slowly.
        x = np.fmax(turns + 0.0 * size, np.log(size / (0.05 * (1.0 + size))) / mode)
        for _ in range(NEWTON):
            law, slow = 0.05 * np.exp(-pace * (x - turns)), size * np.exp(-mode * x)
            falls = pace * law + mode * slow
            x = x + (law + slow - 0.05 * (1.0 + size)) / falls
        open_ = WITHIN_NODE * np.abs(spread / rise) * (np.exp(-mode * x) - 0.05) / then / (falls * rate)
        time, deviation = (
            np.where(late, x / rate, time),
            np.where(late, np.minimum(np.nan_to_num(np.abs(open_), posinf=1e6), 1e6), deviation),
        )
    return shares, time, deviation


def law_slope(blocks: Blocks, reading: Array, of_law: Array) -> Array:
    """Initial slope (S, F) of the law fitted to means (S, F, m) by least squares, each weighed by its noise."""
    weight = 1.0 / blocks.noise
    weight = (weight / weight.sum(axis=1, keepdims=True))[:, None]
    centred = of_law - (weight * of_law).sum(axis=2, keepdims=True)
    with np.errstate(all="ignore"):
        slope = (weight * centred * reading).sum(axis=2) / (weight * centred**2).sum(axis=2)
    found: Array = np.nan_to_num(slope)
    return found


def cells(log_rate: Array) -> Array:
    """What each of ascending log rates (..., F) stands for: half the way to its neighbours."""
    found: Array = np.gradient(log_rate, axis=-1)
    return found


def within_depth(log_rate: Array, marginal: Array, depth: float, margin: float) -> tuple[Array, Array]:
    """Where a log posterior (S, F) lies within `depth` of its top, and `margin` steps beyond."""
    near = marginal > marginal.max(axis=1, keepdims=True) - depth
    count = log_rate.shape[1]
    first, last = near.argmax(axis=1), count - 1 - near[:, ::-1].argmax(axis=1)
    rows = np.arange(len(log_rate))
    beyond = int(margin)
    return log_rate[rows, np.maximum(first - beyond, 0)], log_rate[rows, np.minimum(last + beyond, count - 1)]


def batches(count: int) -> list[slice]:
    """Rows of a large table, a few at a time: what is made of them on the way need not be as large."""
    return [slice(i, min(i + BATCH, count)) for i in range(0, count, BATCH)]


def log_sum(values: Array, axis: int) -> Array:
    """Logarithm of the sum of the exponentials along an axis; of large tables over sensors (S, ...) a few sensors at a time."""
    if values.ndim == 3 and axis > 0 and len(values) > BATCH:
        return np.concatenate([log_sum(values[some], axis) for some in batches(len(values))])
    top = values.max(axis=axis, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(all="ignore"):
        off = values - top
        found: Array = np.squeeze(top, axis) + np.log(np.exp(off, out=off).sum(axis=axis))
    return found


def quantiles(weight: Array, mean: Array, deviation: Array) -> Array:
    out = np.empty(len(LEVELS))
    given = [np.ascontiguousarray(v, dtype=float) for v in (weight, mean, deviation)]
    core.quantiles(*given, LEVELS, out)
    return out


def student(off: Array, spread: Array, free: float) -> Array:
    """Log density, up to a constant, of Student's t with `free` degrees of freedom at `off`, in units of `spread`."""
    found: Array = -0.5 * (free + 1.0) * np.log1p((off / spread) ** 2 / free) - np.log(spread)
    return found


def stretch(steady: Array, t95: Array, at: Array, factor: float) -> None:
    """Multiplies the half-widths of one sensor by `factor`, in place; none are settled before the beginning."""
    if factor != 1.0:
        for three in (steady, t95, *at):
            three[...] = three[1] + factor * (three - three[1])
        t95[0] = max(t95[0], 0.0)


def reach(three: Array, side: float, deviation: float) -> None:
    """Lets an interval (3,) reach on one side of its middle at least as far as a normal of this deviation does, in place."""
    far = three[1] + np.sign(side) * SIGMAS * deviation
    if np.isfinite(far) and side:
        end = 2 if side > 0.0 else 0
        three[end] = max(three[end], far) if side > 0.0 else min(three[end], far)


def padded(columns: list[Array]) -> Array:
    """Columns (J, n) of each sensor, to the most of any with columns of nought (s, J, n)."""
    most = max(len(d) for d in columns)
    return np.array([np.pad(d, ((0, most - len(d)), (0, 0))) for d in columns])
