"""Sigma points from the singular values of the covariance: the square root that cannot fail.

Yang et al. 2014, Jilin Daxue Xuebao (Gongxueban) 44(2), 392-397, doi:10.13229/j.cnki.jdxbgxb201402018: equations (16)-(23).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Array, setting
from .loop import GaussianFilter
from .moments import Moments, ScaledPoints


def svd_root(matrix: Array) -> Array:
    """Factor (n, n) with root @ root.T = matrix, columns U sqrt(s) by falling s: equations (18), (19).

    Of a symmetric matrix the singular values are the eigenvalues without their signs, and U the eigenvectors. They are taken
    from the eigenvalues, because the sign is needed: one that rounding made negative is clipped at 0, where the singular
    value alone would put it back with the wrong sign. A matrix indefinite beyond rounding becomes the nearest semidefinite
    one without a word; :func:`filters.moments.semidefinite_root` refuses it. Errors are of the order 1e-16 of the largest
    entry, so a variance smaller than that share of the largest one is lost.

    Raises
    ------
    numpy.linalg.LinAlgError: an entry is not finite.
    """
    if not np.isfinite(matrix).all():
        raise np.linalg.LinAlgError("covariance has entries that are not finite")
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0)))[:, ::-1])


@dataclass(frozen=True)
class SvdPoints(ScaledPoints):
    """The scaled 2n + 1 points, standing along the axes U of the covariance.

    spread is the paper's alpha, kappa its kappa, shape its beta (2 for a Gaussian). The paper prints lambda / (2 (lambda + n))
    for the weight of the outer points (17); they sum to 1 with the centre only for lambda = 1, and right is 1 / (2 (lambda + n)).
    """

    compiled: ClassVar[bool] = False

    def root(self, covariance: Array) -> Array:
        return svd_root(covariance)


@dataclass(frozen=True)
class SvdUkf(GaussianFilter):
    """The unscented filter whose square root cannot fail: for covariances that rounding has made indefinite."""

    name = "svd_ukf"
    summary = "unscented Kalman filter with the root by singular values: never fails on an ill-conditioned covariance"
    reference = "Yang et al. 2014, J. Jilin Univ. (Eng.) 44(2), doi:10.13229/j.cnki.jdxbgxb201402018"

    spread: float = setting(1.0, "alpha of the scaled sigma points (16)", 1e-3, 10.0)

    @property
    def moments(self) -> Moments:
        return SvdPoints(self.spread)
