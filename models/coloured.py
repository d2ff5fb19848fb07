"""Generalised least squares: a grey-box model whose readings wander beside it, and what it then says of other times."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .core.kernel import Array
from .greybox import LEVEL, RATE, START, Key, Model, Part
from .joint import Fit, fit_model, inverse_normal_equations, search
from .noise.discrepancy import Columns, Flutter, Noise, RandomWalk
from .observations import Observations


@dataclass(frozen=True)
class Posterior:
    """What a fit with its noise knows: parameters, then amplitudes, of each sensor and of all.

    local (S, a, a), shared (b, b) and cross (S, a, b) are covariances in search coordinates; log_likelihood is that of the readings
    at the parameters, the amplitudes integrated out, for the noise of ``run.noise``.
    """

    fit: Fit
    local: Array
    shared: Array
    cross: Array
    log_likelihood: float

    def predict(self, run: Observations, columns: Columns) -> tuple[Array, Array]:
        """(mean, variance) (S, M) of what sensors come to, disturbance and all, on another grid of the same run's sensors.

        columns are those of the same noise, rates, rises and span at the grid's times. White noise of a reading is not in it.
        """
        fit = self.fit
        model = Model(run, fit.model.parts, fit.model.active)
        everyone = np.arange(run.sensors)
        common = np.broadcast_to(fit.shared, (run.sensors, len(fit.shared)))
        curve, by_local, by_shared = model.with_jacobian(fit.local, common, everyone)
        by_own = np.concatenate([by_local * fit.model.active.T[:, :, None], columns.own])
        by_all = np.concatenate([by_shared, columns.shared])
        assert fit.own is not None
        assert fit.shared_amplitudes is not None
        mean = curve + columns.discrepancy(fit.own, fit.shared_amplitudes)
        variance = np.einsum("asn,sab,bsn->sn", by_own, self.local, by_own)
        variance += np.einsum("bsn,bc,csn->sn", by_all, self.shared, by_all)
        variance += 2.0 * np.einsum("asn,sab,bsn->sn", by_own, self.cross, by_all)
        return mean, np.maximum(variance, 0.0)


def posterior(fit: Fit) -> Posterior:
    """Parameters and amplitudes of a fit with :func:`fit_with_noise` together, and the likelihood of its readings.

    Raises
    ------
    ValueError: the fit has no noise model.
    """
    if fit.columns is None or fit.own is None or fit.shared_amplitudes is None:
        raise ValueError("a fit without a noise model has no posterior of its disturbance")
    run, kl, ks = fit.run, fit.local.shape[1], len(fit.shared)
    weight = run.weight / np.maximum(run.noise, 1e-9)[:, None] ** 2
    (blocks, border, corner), covariances = inverse_normal_equations(fit, weight)
    # Integrating out the amplitudes: the determinant of their own part of the normal equations (the matrix determinant lemma).
    own, cross, rest = blocks[:, kl:, kl:], border[:, kl:, ks:], corner[ks:, ks:]
    solved = np.linalg.solve(own, cross)
    schur = rest - (cross.transpose(0, 2, 1) @ solved).sum(axis=0)
    determinant = np.linalg.slogdet(own)[1].sum() + np.linalg.slogdet(schur)[1]
    used = run.used
    cost = (weight * fit.residual**2).sum() + float((fit.own**2).sum()) + float((fit.shared_amplitudes**2).sum())
    white = float(np.log(2.0 * np.pi / weight[used]).sum())
    return Posterior(fit, *covariances, -0.5 * (float(cost) + white + float(determinant)))


def fit_with_noise(
    run: Observations, noise: Noise, parts: Sequence[Part] = (), start: dict[Key, Any] | None = None, rounds: int = 4
) -> Fit:
    """As :func:`fit_model` where the readings wander beside the model: generalised least squares with the noise's covariance.

    The columns depend on rate and rise: they are worked out anew at each of `rounds` fits, the first at those of white noise.
    """
    fit = fit_model(run, parts, start)
    for _ in range(rounds):
        rate, rise = fit.values[RATE], fit.values[LEVEL] - fit.values[START]
        columns = noise.columns(run.time - run.time[0], rate, rise)
        fit = search(fit.model, fit.local, fit.shared, fit.prior, columns=columns)
    return fit


#: Sizes of a usual machine's disturbance that are tried, and what they multiply: a room that wanders [K per root hour], a load that
#: flutters for all sensors and for each, relative to the heat, with a memory in time constants (`imperfection.prior`).
SIZES = (0.3, 1.0, 2.0, 4.0)
ROOM, LOAD, OWN_LOAD, MEMORY = 0.1, 0.01, 0.005, 0.5


def fit_disturbed(fit: Fit) -> Fit:
    """A fit again beside the disturbance that a usual machine has, its size the likeliest of a few.

    Parameters that a slow disturbance imitates are then no surer than they are; those of a fit to white noise are too sure.
    """
    run = fit.run
    memory = MEMORY / float(np.median(fit.values[RATE]))
    best: Posterior | None = None
    for size in SIZES:
        processes = (
            RandomWalk(ROOM * size),
            Flutter(LOAD * size, memory=memory),
            Flutter(OWN_LOAD * size, shared=False, memory=memory),
        )
        found = posterior(fit_with_noise(run, Noise(processes), fit.model.parts, fit.values, 2))
        if best is None or found.log_likelihood > best.log_likelihood:
            best = found
    assert best is not None
    return best.fit
