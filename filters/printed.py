"""The filters exactly as the spindle paper prints them: what ``--preset paper`` turns a filter into.

Kept so that anyone can see the comparison; guarded only in that a divergence is caught and reported.
"""

from dataclasses import dataclass

from .base import Closing, setting
from .fading import FadingRule, PrintedFading
from .loop import GaussianFilter
from .moments import Moments, SymmetricPoints


@dataclass(frozen=True)
class PrintedAfukf(GaussianFilter):
    """The paper's AFUKF: gain (12), covariance (13), fading (18)-(25), rule of figure 1, constants of section 2.1."""

    name = "afukf"
    summary = "the adaptive fading UKF as printed, with the paper's constants"
    reference = "doi:10.6041/j.issn.1000-1298.2019.04.042"
    adapts = True

    forgetting: float = setting(0.95, "xi of equation (22)", 0.0, 1.0)
    weakening: float = setting(3.0, "rho of equation (21)", 0.0, 100.0)
    threshold: float = setting(1e-4, "H of figure 1 [K]", 0.0, 10.0)
    factor: float = setting(10.0, "c of section 1.3", 1.0, 1000.0)
    process_noise: float = setting(1e-6, "diagonal of Q0", 0.0, 1.0)
    noise: float = setting(1e-6, "R0 [K^2]", 1e-12, 1.0)

    @property
    def moments(self) -> Moments:
        return SymmetricPoints()

    @property
    def fading_rule(self) -> FadingRule:
        return PrintedFading(
            self.forgetting, self.weakening, self.threshold, self.factor, self.process_noise, self.noise, self.adapts
        )

    @property
    def closing(self) -> Closing:
        return "never"


@dataclass(frozen=True)
class PrintedFadingUkf(PrintedAfukf):
    """The conventional fading UKF of section 2.2: the same start and constants, Q and R held."""

    name = "fading_ukf"
    summary = "the conventional fading UKF as printed, with the paper's constants"
    adapts = False
