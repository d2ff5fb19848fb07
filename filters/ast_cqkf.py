"""Adaptive strong tracking cubature quadrature Kalman filter."""

from dataclasses import dataclass

from .base import Closing, setting
from .cubature import CubaturePoints
from .fading import FadingRule
from .loop import GaussianFilter
from .moments import Moments
from .strong_tracking import StrongTracking


@dataclass(frozen=True)
class AstCqkf(GaussianFilter):
    """Cubature quadrature points; fades until the innovations are explained, follows their noise."""

    name = "ast_cqkf"
    summary = "adaptive strong tracking CQKF: fades with the innovations, estimates the noise as it goes"
    reference = "Liu et al. 2018, doi:10.13700/j.bh.1001-5965.2017.0312, in a stable form"

    order: int = setting(2, "m, points along each radius", 1.0, 20.0)
    weakening: float = setting(3.5, "beta of equation (28)", 1.0, 100.0)
    forgetting: float = setting(0.95, "rho of equation (30)", 0.0, 1.0)
    noise_forgetting: float = setting(0.95, "b of equation (41)", 0.5, 0.999)
    noise_least: float = setting(0.1, "least noise variance, per that of the start", 1e-6, 1.0)
    noise_most: float = setting(100.0, "largest noise variance, per that of the start", 1.0, 1e6)
    fading_most: float = setting(1.5, "largest fading factor of one reading", 1.0, 1e3)
    outlier: float = setting(5.0, "standard deviations at which a reading says no more about noise and model", 2.0, 100.0)
    process_mean_most: float = setting(0.0, "largest mean of the process noise (42), per deviation of the start; 0: none", 0.0, 1.0)
    process_noise_most: float = setting(0.0, "largest process noise Q (43), per covariance of the start; 0: none", 0.0, 1.0)

    closing_step: bool = True

    @property
    def moments(self) -> Moments:
        return CubaturePoints(self.order)

    @property
    def fading_rule(self) -> FadingRule:
        return StrongTracking(
            self.weakening,
            self.forgetting,
            self.noise_forgetting,
            self.noise_least,
            self.noise_most,
            self.fading_most,
            self.outlier,
            self.process_mean_most,
            self.process_noise_most,
        )

    @property
    def closing(self) -> Closing:
        return "when consistent" if self.closing_step else "never"
