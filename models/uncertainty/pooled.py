"""One machine, several runs: a mixed-effects fit, in which what belongs to the machine scatters little from run to run.

Each run is fitted by itself; a constant of the machine is the mean of the runs' with a scatter that is estimated (DerSimonian and
Laird 1986, drawn towards the scatter that machines have), and each run is fitted again with that mean and scatter as what is known
of it, until both agree (the alternation of Lindstrom and Bates 1990).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.kernel import Array
from ..core.tails import chi2_tail
from ..greybox import Column
from ..joint import Fit, Model, Prior, search

#: Scatter of a constant from run to run [of its logarithm, or share of it] before runs were compared; it counts as so many runs.
SCATTER, RUNS_ASSUMED = 0.06, 4.0
ROUNDS = 2
#: Batches whose means show how residuals depend on their neighbours.
BATCHES = 20


@dataclass(frozen=True)
class Differing:
    """A constant that the runs do not agree on: of one sensor, or of all (None); scatter in search coordinates."""

    column: Column
    sensor: int | None
    scatter: float
    p: float


@dataclass(frozen=True)
class Pooled:
    """Constants of the machine in search coordinates, local (S, kl) and shared (ks,): mean, error of the mean, scatter.

    nan where a parameter is the run's own. differing: those on which the runs disagree beyond what their readings leave open.
    correlation (S, kl + ks, kl + ks): how what is known of a next run goes together, of each sensor's own and the shared constants.
    """

    mean: Array
    error: Array
    scatter: Array
    shared_mean: Array
    shared_error: Array
    shared_scatter: Array
    correlation: Array
    differing: tuple[Differing, ...] = ()

    def prior(self) -> Prior:
        """What is known of another run of the machine."""
        variance, common = (e**2 + s**2 for e, s in ((self.error, self.scatter), (self.shared_error, self.shared_scatter)))
        precision = np.where(np.isfinite(variance), 1.0 / variance, 0.0)
        shared = np.where(np.isfinite(common), 1.0 / common, 0.0)
        local_precision = precision[:, :, None] * np.eye(precision.shape[1])
        return Prior(np.nan_to_num(self.mean), local_precision, np.nan_to_num(self.shared_mean), np.diag(shared))


def pool(fits: Sequence[Fit]) -> Pooled:
    """Constants of the machine over fits of the same model to runs with the same sensors."""
    model = fits[0].model
    inflated = [np.array([dependence(r[u]) for r, u in zip(f.residual, f.run.used, strict=True)]) for f in fits]
    local = np.stack([f.local for f in fits])
    variance = np.stack([np.diagonal(f.covariance[0], axis1=1, axis2=2) * w[:, None] for f, w in zip(fits, inflated, strict=True)])
    shared = np.stack([f.shared for f in fits])
    common = np.stack([np.diagonal(f.covariance[1]) * float(np.mean(w)) for f, w in zip(fits, inflated, strict=True)])
    kept = np.array([model.of_machine(c) for c in model.local], dtype=bool) & model.active
    kept_shared = np.array([model.of_machine(c) for c in model.shared], dtype=bool)
    mean, error, scatter, p = _pooled(local, variance, model.log_local)
    shared_mean, shared_error, shared_scatter, shared_p = _pooled(shared, common, model.log_shared)
    found = [
        Differing(model.local[j], int(i), float(scatter[i, j]), float(p[i, j])) for i, j in np.argwhere(kept & (p < 0.01)).tolist()
    ]
    found += [
        Differing(model.shared[j], None, float(shared_scatter[j]), float(shared_p[j]))
        for j in np.flatnonzero(kept_shared & (shared_p < 0.01)).tolist()
    ]
    mean, error, scatter = (np.where(kept, v, np.nan) for v in (mean, error, scatter))
    shared_mean, shared_error, shared_scatter = (
        np.where(kept_shared, v, np.nan) for v in (shared_mean, shared_error, shared_scatter)
    )
    differing = tuple(sorted(found, key=lambda d: d.p))
    spread = np.concatenate([scatter, np.tile(shared_scatter, (len(scatter), 1))], axis=1)
    together = np.array([_together(fits, i, [w[i] for w in inflated], spread[i]) for i in range(len(spread))])
    return Pooled(mean, error, scatter, shared_mean, shared_error, shared_scatter, together, differing)


def _together(fits: Sequence[Fit], sensor: int, inflated: Sequence[float], scatter: Array) -> Array:
    """Correlations (kl + ks, kl + ks) of one sensor's and the shared constants in a next run, over fits whose constants scatter."""
    found, at = np.eye(len(scatter)), np.flatnonzero(np.isfinite(scatter))
    between = np.diag(scatter[at] ** 2)
    each = [
        w * np.clip(f.joint_covariance(sensor)[np.ix_(at, at)], -1e6, 1e6) + between for f, w in zip(fits, inflated, strict=True)
    ]
    whole = np.linalg.pinv(np.sum([np.linalg.pinv(c, hermitian=True) for c in each], axis=0), hermitian=True) + between
    deviation = np.sqrt(np.maximum(np.diag(whole), 1e-300))
    found[np.ix_(at, at)] = whole / np.outer(deviation, deviation)
    return found


def dependence(residual: Array) -> float:
    """By how much more the mean of dependent residuals (n,) scatters, in variance, than that of white ones: by means of batches."""
    size = max(1, len(residual) // BATCHES)
    means = residual[: len(residual) // size * size].reshape(-1, size).mean(axis=1)
    variance = float(np.mean(residual**2))
    return max(1.0, size * float(np.mean(means**2)) / variance) if variance > 0.0 else 1.0


def _pooled(value: Array, variance: Array, log: Array) -> tuple[Array, Array, Array, Array]:
    """Mean, its error, scatter and the chance of as much disagreement (...) of values (runs, ...) with variances (runs, ...)."""
    runs = len(value)
    usual = SCATTER * np.where(log, 1.0, np.maximum(np.abs(value.mean(axis=0)), 1e-9)) if value.size else np.zeros(value.shape[1:])
    variance = np.clip(np.nan_to_num(variance, nan=1e6, posinf=1e6), 1e-18, 1e6)
    weight = 1.0 / variance
    total = weight.sum(axis=0)
    middle = (weight * value).sum(axis=0) / total
    spread = (weight * (value - middle) ** 2).sum(axis=0)
    with np.errstate(all="ignore"):
        between = np.nan_to_num((spread - (runs - 1)) / (total - (weight**2).sum(axis=0) / total))
    between = np.maximum(between, 0.0)
    scatter = np.sqrt((RUNS_ASSUMED * usual**2 + (runs - 1) * between) / (RUNS_ASSUMED + runs - 1))
    weight = 1.0 / (variance + scatter**2)
    mean = (weight * value).sum(axis=0) / weight.sum(axis=0)
    p = np.ones_like(mean) if runs < 2 else np.array([chi2_tail(runs - 1, float(q)) for q in spread.ravel()]).reshape(spread.shape)
    return mean, 1.0 / np.sqrt(weight.sum(axis=0)), scatter, p


def fit_known(model: Model, local: Array, shared: Array, known: Pooled) -> Fit:
    """A run fitted from search coordinates with the constants of its machine as they are known."""
    at = np.where(np.isnan(known.mean), local, np.clip(np.nan_to_num(known.mean), model.low_local, model.high_local))
    common = np.where(
        np.isnan(known.shared_mean), shared, np.clip(np.nan_to_num(known.shared_mean), model.low_shared, model.high_shared)
    )
    return search(model, at, common, known.prior())


def fit_together(fits: Sequence[Fit]) -> tuple[list[Fit], Pooled]:
    """Runs that are fitted each by itself, fitted again as runs of one machine; and its constants."""
    found, known = list(fits), pool(fits)
    for _ in range(ROUNDS):
        # The scatter is judged on the runs' own words: with the prior in, they agree more than they do.
        found = [fit_known(f.model, f.local, f.shared, known) for f in fits]
        known = Pooled(**{**vars(known), **_recentred(found, known)})
    return found, known


def _recentred(fits: Sequence[Fit], known: Pooled) -> dict[str, Array]:
    mean = np.mean([f.local for f in fits], axis=0)
    shared = np.mean([f.shared for f in fits], axis=0)
    return {
        "mean": np.where(np.isnan(known.mean), np.nan, mean),
        "shared_mean": np.where(np.isnan(known.shared_mean), np.nan, shared),
    }
