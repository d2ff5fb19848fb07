"""Cubature quadrature Kalman filter."""

from dataclasses import dataclass

from .base import setting
from .cubature import CubaturePoints
from .loop import GaussianFilter
from .moments import Moments


@dataclass(frozen=True)
class Cqkf(GaussianFilter):
    """The spherical rule times a Gauss-Laguerre rule of order m along the radius, equations (20)-(25)."""

    name = "cqkf"
    summary = "cubature quadrature Kalman filter: m points along each radius, no fading"
    reference = "Liu et al. 2018, doi:10.13700/j.bh.1001-5965.2017.0312, after Bhaumik & Swati 2013, IET Signal Processing 7(7)"

    order: int = setting(2, "m, points along each radius; 1 is the cubature Kalman filter", 1.0, 20.0)

    @property
    def moments(self) -> Moments:
        return CubaturePoints(self.order)
