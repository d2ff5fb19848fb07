"""A record without the noise of its sensor: what the model leaves, parted into noise of known colour and a slow deviation.

The way is that of the paper on a gyroscope's drift (``residual_noise``): an ARMA model of the noise and a Kalman filter on its
state space form. Here the filter is followed by a smoother, as the whole record is there, and what is kept apart from the noise,
the machine's deviation from its model, has a size that the readings tell and the machine's own time constant.
"""

import math
from typing import Any

import numpy as np

from ..core.kernel import Array
from .residual_noise import NoiseModel, _padded

#: Standard deviations of the deviation that are tried, as shares of the noise's. Nought is not among them: of a deviation a fifth
#: as large as the noise no test of a record knows anything (benchmarks.denoised: with nought 78 to 86 % held beside such ones).
SIZES = (0.2, 0.4, 0.8)


def smoothed(series: Array, weight: Array, noise: NoiseModel, decay: float) -> tuple[Array, Array]:
    """Deviation (N,) and its standard deviation (N,) [unit] in a series (N,), nan in gaps, of deviation plus noise.

    noise is of a reading of weight 1; weight (N,) is how many of them a value stands for. decay in (0, 1) is what is left of a
    deviation after one step. Its size is averaged over SIZES by their likelihoods.
    """
    runs = [_run(series, weight, noise, decay, size * math.sqrt(noise.variance)) for size in SIZES]
    share = np.exp([r[2] - max(r[2] for r in runs) for r in runs])
    share /= share.sum()
    mean = np.einsum("k,kn->n", share, [r[0] for r in runs])
    within = np.einsum("k,kn->n", share, [r[1] + (r[0] - mean) ** 2 for r in runs])
    return mean, np.sqrt(np.maximum(within, 0.0))


def _run(series: Array, weight: Array, noise: NoiseModel, decay: float, size: float) -> tuple[Array, Array, float]:
    """Smoothed deviation (N,), its variance (N,) and the log likelihood at one size [unit] of it (Rauch, Tung & Striebel 1965)."""
    phi, theta = _padded(noise.phi, noise.theta)
    step = np.zeros((4, 4))
    step[0, 0], step[1:, 1], step[1, 2], step[2, 3] = decay, phi, 1.0, 1.0
    entry = np.array([0.0, 1.0, *theta])
    process = noise.innovation_variance * np.outer(entry, entry)
    process[0, 0] = size**2 * (1.0 - decay**2)
    mean, p = np.zeros(4), _stationary(step, process, size)
    n, told = len(series), 0.0
    kept: list[tuple[Any, ...]] = []
    row = np.array([1.0, 0.0, 0.0, 0.0])
    for k in range(n):
        before = (mean, p)
        if math.isfinite(series[k]):
            row[1] = 1.0 / math.sqrt(weight[k])
            across = p @ row
            s = float(row @ across)
            e = float(series[k] - row @ mean)
            gain = across / s
            mean, p = mean + gain * e, p - np.outer(gain, across)
            told -= 0.5 * (math.log(s) + e * e / s)
        kept.append((before, mean, p))
        mean, p = step @ mean, step @ p @ step.T + process
    deviation, variance = np.empty(n), np.empty(n)
    later, spread = kept[-1][1], kept[-1][2]
    deviation[-1], variance[-1] = later[0], spread[0, 0]
    for k in range(n - 2, -1, -1):
        (ahead, p_ahead), mean, p = kept[k + 1][0], kept[k][1], kept[k][2]
        back = p @ step.T @ np.linalg.pinv(p_ahead, rcond=1e-12, hermitian=True)
        later, spread = mean + back @ (later - ahead), p + back @ (spread - p_ahead) @ back.T
        deviation[k], variance[k] = later[0], spread[0, 0]
    return deviation, variance, told


def _stationary(step: Array, process: Array, size: float) -> Array:
    """Covariance (4, 4) of the state before the first reading."""
    noise = np.linalg.solve(np.eye(9) - np.kron(step[1:, 1:], step[1:, 1:]), process[1:, 1:].ravel()).reshape(3, 3)
    p = np.zeros((4, 4))
    p[0, 0], p[1:, 1:] = size**2, noise
    return p
