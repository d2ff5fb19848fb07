"""What slow parts of the usual size leave open on a machine that is quiet otherwise.

The sizes of all disturbances have one scale, which the residuals tell. They tell it of what has happened: of a steady room and load
and of no fast part, and not of a mass that is several times as slow as the law, which has hardly spoken. So the estimate follows
the scale, and the interval is no narrower than slow parts of the size that machines have would make it.
"""

import numpy as np
from numpy.typing import NDArray

from .evidence import COARSE, FEW, Run
from .machine.known import NOTHING
from .numerics import cells, settled_after, within_depth
from .prior import COMPONENTS
from .shapes import SETTLING, Covariances

Array = NDArray[np.float64]

#: Passes over log rates: within so much of the top of the log posterior, at so many rates.
PASSES = ((14.0, FEW), (9.0, FEW))


def deviations(run: Run, log_rate: Array, weight: Array) -> tuple[Array, Array] | None:
    """Deviations (S, asked) [K] of what is asked for and (S,) [min] of t95: nought of machines that are not quiet, None if none is.

    log_rate (S, F) and weight (S, F, H) are the posterior. Under the likeliest hypothesis, slow parts alone are as usual; all rates
    that agree with that are looked at, for a slow part looks much like another rate. A machine that past runs know has told more.
    """
    if run.prior.none or (run.known is not None and not run.guessed):
        return None
    best = weight.sum(axis=1).argmax(axis=1)
    missing = np.maximum(1.0 - np.where(run.base, run.scale, run.under)[best], 0.0)
    if not missing.any():
        return None
    of_rate = weight.sum(axis=2)
    wrong = _as_usual(run, (of_rate * log_rate).sum(axis=1) / of_rate.sum(axis=1), missing)
    quiet = missing > 0.0
    one = (np.arange(len(run.kind)) == best[:, None]) & quiet[:, None]
    slowest, fastest = (np.full(run.count, run.nodes[k]) for k in (0, -1))
    grid = run.spread(slowest, fastest, len(run.nodes) // COARSE + 1)
    for depth, count in PASSES:
        evidence = run.no_evidence(grid)
        run.evaluate(grid, _stands(grid, one), 0, wrong, evidence)
        grid = run.spread(*within_depth(grid, _likely(run, grid, evidence), depth, 1.0), count)
    active, evidence = _stands(grid, one), run.no_evidence(grid)
    rise, foretold = run.evaluate(grid, active, run.asked[0].count, wrong, evidence)
    share = np.exp(_likely(run, grid, evidence))
    share /= share.sum(axis=1, keepdims=True)
    asked, t95 = np.zeros((run.count, run.asked[0].count)), np.zeros(run.count)
    for i in np.flatnonzero(quiet).tolist():
        there = active[i].any(axis=1)  # one hypothesis of a sensor is looked at, at some rates
        own, at = share[i, there], grid[i, there]
        mean, variance, _ = foretold[i]
        asked[i] = _deviation(own[:, None], mean, variance)
        ahead, open_ = mean[:, SETTLING], np.sqrt(variance[:, SETTLING])
        late, spread = settled_after(np.exp(at), rise[i, there], ahead, open_, *run.settles(i, at))
        t95[i] = _deviation(own, late, spread**2)
    return asked, t95


def _as_usual(run: Run, log_rate: Array, missing: Array) -> list[tuple[Array, Array]]:
    """Of each part the covariances of :attr:`Run.wrong`, with what the scales of its sensors lack of slow parts as usual.

    log_rate (S,): about where they are; missing (S,): share of the usual variance.
    """
    found = []
    slow = COMPONENTS.index("slow")
    for i, (doubt, others) in enumerate(run.wrong):
        rows = slice(run.rows[i], run.rows[i + 1])
        if run.shape[i] is None:
            node = np.abs(run.nodes - log_rate[rows, None]).argmin(axis=1)
            usual = run.relative[0, slow] * _square(run.covariance[i], node, slow)
        else:
            usual = others
        more = missing[rows, None, None] * usual if len(usual) else NOTHING
        found.append((np.ascontiguousarray(doubt + more if len(doubt) and len(more) else more if len(more) else doubt), others))
    return found


def _square(covariance: Covariances, node: NDArray[np.intp], component: int) -> Array:
    """(S, m + k, m + k) of one component at nodes (S,): readings with all, and of what is asked for the variances alone."""
    readings, own = covariance.readings[node, component], covariance.own[node, component]
    m, wide = readings.shape[1:]
    found = np.zeros((len(node), wide, wide))
    found[:, :m] = readings
    asked = np.arange(m, wide)
    found[:, asked, asked] = own
    return found


def _stands(grid: Array, one: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of log rates (S, F) and hypotheses (S, H) are worked out (S, F, H)."""
    return (cells(grid) > 0.0)[..., None] & one[:, None]


def _likely(run: Run, grid: Array, evidence: Array) -> Array:
    """Log posterior (S, F) of log rates, its top at nought, by the one hypothesis whose evidence (S, F, H) stands."""
    found = np.fmax.reduce(evidence, axis=2, initial=-np.inf)
    found = found + run.log_rate_prior(grid - run.centre[:, None]) + np.log(np.maximum(cells(grid), 1e-12))
    top = found.max(axis=1, keepdims=True)
    return np.where(np.isfinite(top), found, 0.0) - np.where(np.isfinite(top), top, 0.0)


def _deviation(share: Array, mean: Array, variance: Array) -> Array:
    """Of a mixture of shares (F, ...) with means and variances (F, ...)."""
    middle = (share * mean).sum(axis=0)
    found: Array = np.sqrt((share * (variance + (mean - middle) ** 2)).sum(axis=0))
    return found
