"""Cubature Kalman filter."""

from dataclasses import dataclass

from .cubature import CubaturePoints
from .loop import GaussianFilter
from .moments import Moments


@dataclass(frozen=True)
class Ckf(GaussianFilter):
    """The 2n points of the spherical-radial rule: the cubature quadrature filter of order 1."""

    name = "ckf"
    summary = "cubature Kalman filter: the third-degree spherical-radial rule, no fading"
    reference = "Arasaratnam & Haykin 2009, IEEE Trans. Automatic Control 54(6)"

    @property
    def moments(self) -> Moments:
        return CubaturePoints(1)
