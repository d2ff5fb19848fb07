"""Conventional fading unscented Kalman filter."""

from dataclasses import dataclass

from .base import Closing, setting
from .fading import FadingRule, InnovationFading
from .loop import GaussianFilter
from .moments import Moments, sigma_points


@dataclass(frozen=True)
class FadingUkf(GaussianFilter):
    """Fades by the running innovation variance, on the temperature alone and in the form of Joseph."""

    name = "fading_ukf"
    summary = "conventional fading UKF: forgets when innovations outgrow their variance"
    reference = "equations (18)-(22) of the spindle paper, doi:10.6041/j.issn.1000-1298.2019.04.042"

    forgetting: float = setting(0.95, "xi of equation (22)", 0.0, 1.0)
    weakening: float = setting(3.0, "rho of equation (21)", 0.0, 100.0)
    spread: float = setting(0.0, "phi of the scaled sigma points (4); 0: the 2n points of (3)", 0.0, 10.0)

    @property
    def moments(self) -> Moments:
        return sigma_points(self.spread)

    @property
    def fading_rule(self) -> FadingRule:
        return InnovationFading(self.forgetting, self.weakening)

    @property
    def closing(self) -> Closing:
        return "never"
