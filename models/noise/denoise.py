"""A record without the noise of its sensor: what the model leaves, parted into the machine's slow deviation and the noise.

The deviation is a Gaussian process that is smooth once (Matern 3/2), as a temperature that heat flows change is; the noise is white
or an AR(1) whose memory is short beside the machine's. Both are states of one Kalman filter (Hartikainen & Sarkka 2010, IEEE MLSP)
with a smoother behind it (Bierman 1973, Int. J. Control 18), as the paper on a gyroscope's drift takes a filter for what an ARMA
model leaves (``residual_noise``). The deviation's size and speed and the noise's memory are averaged over a grid by their
likelihoods; the model's own parameters stay free beside them.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array

#: Sizes of the deviation that are tried, in standard deviations of a reading's noise; nought is not among them, since of a small
#: share of the noise no record knows anything.
SIZES = (0.05, 0.2, 0.5, 1.0, 2.0, 5.0, 15.0)
#: Speeds of the deviation that are tried, in rates of the machine: slower is what its parameters take up, faster is noise.
SPEEDS = (0.7, 2.5, 8.0)
#: The noise is what has less than a tenth of its correlation left after a tenth of the machine's time constant; what remembers
#: longer is the machine. Memories that are tried, as shares of the longest that is still noise.
MEMORY = 0.1
SHARES = (0.0, 0.35, 0.65, 0.85, 1.0)
#: Points of the grid with less of the posterior than this are left out of the average.
LEAST_SHARE = 1e-3


@dataclass(frozen=True)
class Smoothed:
    """Deviation (N,) and its standard deviation (N,) [unit]; of the most likely point the whitened innovations (n,) and the
    standard deviation [unit] of the noise of weight one, and the directions (n, m) of the whitened readings that the model's
    parameters took; the odds of the longest memory that counts as noise over those before the readings.
    """

    mean: Array
    deviation: Array
    innovation: Array
    noise: float
    taken: Array
    longest: float


def smoothed(time: Array, residual: Array, weight: Array, tangent: Array, rate: float) -> Smoothed:
    """What is slow in the residual (N,) [unit] of a fit, nan in gaps, at time (N,) [min].

    weight (N,) is how many readings a value stands for; tangent (N, m) the fit's Jacobian, whose directions the deviation may take
    at no cost; rate [1/min] the machine's. Deviations of the size of nothing come with the band that says so. There must be more
    readings than parameters, and some of them other than the model's.
    """
    seen = np.isfinite(residual)
    free = _orthonormal(tangent, seen)
    columns = np.column_stack([np.where(seen, residual, np.nan), np.where(seen[:, None], free, np.nan)])
    step = np.diff(time, prepend=time[0])
    longest = MEMORY ** (10.0 * float(np.median(step[1:])) * rate)
    memory, speed, size = (a.ravel() for a in np.meshgrid(SHARES, SPEEDS, SIZES, indexing="ij"))
    grid = _Grid(step, 1.0 / np.sqrt(weight), rate * speed, size, longest * memory, float(np.median(step[1:])))
    white, half_log_s = grid.filtered(columns)
    fits = [_regressed(white[:, k], float(half_log_s[k])) for k in range(len(size))]
    likelihood = np.array([f.log_likelihood for f in fits])
    share = np.exp(likelihood - likelihood.max())
    share /= share.sum()
    kept = np.flatnonzero(share >= LEAST_SHARE)
    slow, spread = grid.only(kept).smoothed(columns)
    mean, second = np.zeros(len(time)), np.zeros(len(time))
    for place, k in enumerate(kept):
        fit = fits[k]
        left = free - slow[:, place, 1:]
        value = slow[:, place, 0] + left @ fit.parameters
        variance = fit.variance * (spread[:, place] + ((left @ fit.root) ** 2).sum(axis=1))
        mean += share[k] * value
        second += share[k] * (variance + value**2)
    whole = share[kept].sum()
    mean, second = mean / whole, second / whole
    best = fits[int(np.argmax(share))]
    edge = memory == SHARES[-1]
    before = edge.sum() / max((~edge).sum(), 1)
    odds = float(share[edge].sum() / max(share[~edge].sum(), 1e-300) / before)
    deviation = np.sqrt(np.maximum(second - mean**2, 0.0))
    return Smoothed(mean, deviation, best.innovation, math.sqrt(best.variance), best.taken, odds)


@dataclass(frozen=True)
class _Regressed:
    """Whitened residual (n,) on whitened tangent: parameters (m,), a root (m, m) of their covariance over the variance.

    innovation (n,) is what is left over its deviation, taken (n, m) what of it the parameters took.
    """

    parameters: Array
    root: Array
    variance: float
    innovation: Array
    taken: Array
    log_likelihood: float


def _regressed(white: Array, half_log_s: float) -> _Regressed:
    """Generalised least squares of white[:, 0] on white[:, 1:], and the restricted likelihood (Harville 1977)."""
    q, r = np.linalg.qr(white[:, 1:])
    along = q.T @ white[:, 0]
    left = white[:, 0] - q @ along
    free = len(left) - len(along)
    variance = float(left @ left) / free
    likelihood = -0.5 * free * np.log(variance) - half_log_s - float(np.log(np.abs(np.diag(r))).sum())
    root = np.linalg.solve(r, np.eye(len(along)))
    return _Regressed(root @ along, root, variance, left / np.sqrt(variance), q, float(likelihood))


def _orthonormal(tangent: Array, seen: Array) -> Array:
    """The tangent's directions (N, m), independent of each other over the readings there are."""
    length = np.sqrt((tangent[seen] ** 2).sum(axis=0))
    scaled = tangent / np.where(length > 0.0, length, 1.0)
    _, size, turn = np.linalg.svd(scaled[seen], full_matrices=False)
    good = size > 1e-9 * size.max(initial=0.0)
    return np.asarray(scaled @ (turn[good].T / size[good]))


@dataclass(frozen=True)
class _Grid:
    """The filter at G points of the grid at once. State: deviation, its slope over the rate, noise of a reading of weight one.

    step (N,) [min] since the reading before, scale (N,) of the noise; rate (G,) [1/min], size (G,), memory (G,) after `usual` min.
    """

    step: Array
    scale: Array
    rate: Array
    size: Array
    memory: Array
    usual: float

    def only(self, points: NDArray[np.intp]) -> "_Grid":
        return _Grid(self.step, self.scale, self.rate[points], self.size[points], self.memory[points], self.usual)

    def _moves(self, step: float) -> tuple[Array, Array]:
        """Transition (G, 3, 3) over a step [min] and the covariance (G, 3, 3) that it adds."""
        x = self.rate * step
        move, added = np.zeros((len(x), 3, 3)), np.zeros((len(x), 3, 3))
        move[:, 0, 0], move[:, 0, 1], move[:, 1, 0], move[:, 1, 1] = 1.0 + x, x, -x, 1.0 - x
        move[:, :2, :2] *= np.exp(-x)[:, None, None]
        within = move[:, :2, :2]
        added[:, :2, :2] = (self.size**2)[:, None, None] * (np.eye(2) - within @ within.swapaxes(1, 2))
        move[:, 2, 2] = self.memory ** (step / self.usual)
        added[:, 2, 2] = 1.0 - move[:, 2, 2] ** 2
        return move, added

    def _forward(self, columns: Array, keep: list[tuple[Array, ...]] | None) -> tuple[Array, Array]:
        """Whitened innovations (n, G, 1 + m) and half the log of their variances' product (G,); `keep` gets every step's values."""
        count = len(self.size)
        mean = np.zeros((count, 3, columns.shape[1]))
        p = np.zeros((count, 3, 3))
        p[:, 0, 0] = p[:, 1, 1] = self.size**2
        p[:, 2, 2] = 1.0
        found, half_log_s = [], np.zeros(count)
        last, (move, added) = math.nan, (p, p)
        for k, y in enumerate(columns):
            if k:
                if self.step[k] != last:
                    last, (move, added) = self.step[k], self._moves(float(self.step[k]))
                mean, p = move @ mean, move @ p @ move.swapaxes(1, 2) + added
            entry: tuple[Array, ...] = (mean, p)
            if np.isfinite(y[0]):
                across = p[:, :, 0] + self.scale[k] * p[:, :, 2]
                s = across[:, 0] + self.scale[k] * across[:, 2]
                e = y - mean[:, 0] - self.scale[k] * mean[:, 2]
                gain = across / s[:, None]
                found.append(e / np.sqrt(s)[:, None])
                half_log_s += 0.5 * np.log(s)
                entry = (mean, p, e, s, gain)
                mean = mean + gain[:, :, None] * e[:, None, :]
                p = p - gain[:, :, None] * across[:, None, :]
            if keep is not None:
                keep.append(entry)
        return np.stack(found), half_log_s

    def filtered(self, columns: Array) -> tuple[Array, Array]:
        """Of columns (N, 1 + m), nan in gaps: see `_forward`."""
        return self._forward(columns, None)

    def smoothed(self, columns: Array) -> tuple[Array, Array]:
        """Deviation (N, G, 1 + m) in each column given all of it, and its variance (N, G) beside a noise of variance one."""
        kept: list[tuple[Array, ...]] = []
        self._forward(columns, kept)
        n, count = len(columns), len(self.size)
        value, variance = np.empty((n, count, columns.shape[1])), np.empty((n, count))
        pull, grip = np.zeros((count, 3, columns.shape[1])), np.zeros((count, 3, 3))
        for k in range(n - 1, -1, -1):
            mean, p = kept[k][0], kept[k][1]
            if len(kept[k]) > 2:
                e, s, gain = kept[k][2:]
                row = np.array([1.0, 0.0, self.scale[k]])
                rest = np.eye(3) - gain[:, :, None] * row
                pull = rest.swapaxes(1, 2) @ pull - row[:, None] * (e / s[:, None])[:, None, :]
                grip = rest.swapaxes(1, 2) @ grip @ rest + np.outer(row, row) / s[:, None, None]
            value[k] = mean[:, 0] - np.einsum("gi,gim->gm", p[:, 0], pull)
            variance[k] = p[:, 0, 0] - np.einsum("gi,gij,gj->g", p[:, 0], grip, p[:, 0])
            if k:
                move, _ = self._moves(float(self.step[k]))
                pull, grip = move.swapaxes(1, 2) @ pull, move.swapaxes(1, 2) @ grip @ move
        return value, np.maximum(variance, 0.0)
