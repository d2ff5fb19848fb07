"""Extended Kalman filter."""

from dataclasses import dataclass

from .loop import GaussianFilter
from .moments import Linearised, Moments


@dataclass(frozen=True)
class Ekf(GaussianFilter):
    """The Jacobian in place of sigma points."""

    name = "ekf"
    summary = "extended Kalman filter: linearised step, no fading"
    reference = "Jazwinski 1970, Stochastic Processes and Filtering Theory, ch. 8"

    @property
    def moments(self) -> Moments:
        return Linearised()
