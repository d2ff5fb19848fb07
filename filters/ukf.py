"""Unscented Kalman filter."""

from dataclasses import dataclass

from .base import setting
from .loop import GaussianFilter
from .moments import Moments, sigma_points


@dataclass(frozen=True)
class Ukf(GaussianFilter):
    """Sigma points, no fading: right while the model is right."""

    name = "ukf"
    summary = "unscented Kalman filter: sigma points, no fading"
    reference = "Julier & Uhlmann 2004, Proc. IEEE 92(3); equations (2)-(13) with alpha = 1"

    spread: float = setting(0.0, "phi of the scaled sigma points (4); 0: the 2n points of (3)", 0.0, 10.0)

    @property
    def moments(self) -> Moments:
        return sigma_points(self.spread)
