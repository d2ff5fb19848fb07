"""Unscented Kalman filter."""

from dataclasses import dataclass

from .base import Closing
from .fading import FadingRule, NoFading
from .loop import GaussianFilter
from .moments import Moments, SymmetricPoints


@dataclass(frozen=True)
class Ukf(GaussianFilter):
    """Sigma points, no fading: right while the model is right."""

    name = "ukf"
    summary = "unscented Kalman filter: sigma points, no fading"
    reference = "Julier & Uhlmann 2004, Proc. IEEE 92(3); equations (2)-(13) with alpha = 1"

    @property
    def moments(self) -> Moments:
        return SymmetricPoints()

    @property
    def fading_rule(self) -> FadingRule:
        return NoFading()

    @property
    def closing(self) -> Closing:
        return "never"
