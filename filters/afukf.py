"""Adaptive fading unscented Kalman filter: the default."""

from dataclasses import dataclass

from .base import Closing, setting
from .fading import AdaptiveFading
from .loop import GaussianFilter
from .moments import Moments, sigma_points


@dataclass(frozen=True)
class Afukf(GaussianFilter):
    """Sigma points with an adaptive rule kept inside bounds that keep it stable, closed by a likelihood step."""

    name = "afukf"
    summary = "adaptive fading UKF: leaves outliers out, follows the noise, fades when the model fails (default)"
    reference = "spindle paper, doi:10.6041/j.issn.1000-1298.2019.04.042, sections 1.1-1.3, in a stable form"

    forgetting: float = setting(0.9, "memory of the mean innovation, per reading", 0.5, 0.999)
    spread_forgetting: float = setting(0.85, "memory of the innovations' spread, per reading", 0.5, 0.999)
    gate: float = setting(5.0, "standard deviations beyond which a reading is an outlier", 2.0, 100.0)
    noise_threshold: float = setting(2.5, "innovation variance ratio above which R grows", 1.0, 100.0)
    wake_threshold: float = setting(4.0, "standard deviations of the mean innovation at which fading wakes", 1.0, 100.0)
    fading_gain: float = setting(0.3, "fading factor - 1 at the wake threshold", 0.0, 10.0)
    fading_most: float = setting(1.5, "largest fading factor of one reading", 1.0, 10.0)
    jump_readings: float = setting(4.0, "outliers in a row, on one side, that count as a jump", 2.0, 100.0)
    spread: float = setting(0.0, "phi of the scaled sigma points (4); 0: the 2n points of (3)", 0.0, 10.0)
    closing_step: bool = True

    @property
    def moments(self) -> Moments:
        return sigma_points(self.spread)

    @property
    def fading_rule(self) -> AdaptiveFading:
        return AdaptiveFading(
            self.forgetting,
            self.spread_forgetting,
            self.gate,
            self.noise_threshold,
            self.wake_threshold,
            self.fading_gain,
            self.fading_most,
            self.jump_readings,
        )

    @property
    def closing(self) -> Closing:
        return "when consistent" if self.closing_step else "never"
