"""How far the numbers of a machine scatter from run to run where nothing has changed, and what runs say of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .numbers import RunNumbers

Array = NDArray[np.float64]

#: Usual deviations from run to run of the logarithms of rate and rise: common to all sensors, and of each beside the others. Of
#: simulated and real repeats; see docs/figures.md.
COMMON = 0.06, 0.05
#: Correlation of the two, because it is mostly the loss that is not the same: a fan, a draught, a cover.
TOGETHER = -0.5
OWN = 0.015, 0.015
#: A machine's scatter as a multiple of the usual one, with prior probabilities, and that of each sensor beside the others as a
#: multiple of that: old runs that agree say that a machine repeats well. Set on simulated chains and on the pots of a laboratory.
SCALES = ((0.25, 0.1), (0.5, 0.3), (1.0, 0.5), (2.0, 0.1))
OWN_SCALES = ((0.7, 0.7), (2.0, 0.3))
#: A scatter that like runs make less likely than another by so much, as a logarithm, is not looked at further.
UNLIKELY = 8.0

Mean = tuple[Array, Array]


@dataclass(frozen=True)
class Repeats:
    """Means (2 S,) of old and new runs, each with its covariance (2 S, 2 S), under one scatter; log: its likelihood and prior."""

    log: float
    old: Mean
    new: Mean

    @property
    def difference(self) -> Array:
        """New over old (2 S,), as logarithms."""
        return self.new[0] - self.old[0]

    @property
    def noise(self) -> Array:
        """Covariance (2 S, 2 S) of the difference, where nothing has changed."""
        return self.new[1] + self.old[1]


def scatter(n: int, scale: float = 1.0, own_scale: float = 1.0, by_length: Array | None = None) -> Array:
    """Covariance (2 n, 2 n) from run to run, so many times the usual deviations.

    by_length (2 n,): how numbers hang on the length of a run. What stretches time, as a draught does, moves them as a shorter run
    would.
    """
    common = scale * np.array(COMMON)
    correlated = np.outer(common, common) * np.array([[1.0, TOGETHER], [TOGETHER, 1.0]])
    found: Array = np.kron(correlated, np.ones((n, n))) + np.diag(np.repeat(np.square(scale * own_scale * np.array(OWN)), n))
    return found if by_length is None else found + common[0] ** 2 * np.outer(by_length, by_length)


def repeats(old: Sequence[RunNumbers], new: Sequence[RunNumbers], by_length: Array | None = None) -> list[Repeats]:
    """What the means of both sides are under each scatter that the runs of a side leave likely beside each other."""
    n, found = len(old[0].values) // 2, []
    for (scale, prior), (own_scale, of_own) in product(SCALES, OWN_SCALES):
        spread = scatter(n, scale, own_scale, by_length)
        sides = [_mean(group, spread) for group in (old, new)]
        log = float(np.log(prior * of_own)) + sum(log for _, log in sides)
        found.append(Repeats(log, sides[0][0], sides[1][0]))
    best = max(r.log for r in found)
    return [r for r in found if r.log > best - UNLIKELY]


def _mean(runs: Sequence[RunNumbers], spread: Array) -> tuple[Mean, float]:
    """Mean of runs of one side with its covariance, under a scatter, and the log-likelihood of how they lie about it (restricted:
    whatever the mean is).
    """
    precision = [r.runs * np.linalg.inv(r.covariance + spread) for r in runs]
    covariance: Array = np.linalg.inv(sum(precision))
    mean: Array = covariance @ sum(p @ r.values for p, r in zip(precision, runs, strict=True))
    if len(runs) == 1:
        return (mean, covariance), 0.0
    apart = sum(float((r.values - mean) @ p @ (r.values - mean)) for p, r in zip(precision, runs, strict=True))
    logs = sum(float(np.linalg.slogdet(p)[1]) for p in precision) + float(np.linalg.slogdet(covariance)[1])
    return (mean, covariance), 0.5 * (logs - apart)
