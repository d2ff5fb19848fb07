"""What both cores share: the law's growth function, and what a fit tells."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Records of the dtype FIT.
Fits = NDArray[np.void]


def growth(rate: Array | float, dt: Array | float) -> Array:
    """(1 - exp(-rate dt)) / rate, continuous at rate = 0; broadcasts."""
    rate, dt = np.asarray(rate, dtype=float), np.asarray(dt, dtype=float)
    z = np.maximum(rate * dt, -60.0)
    small = np.abs(z) < 1e-7
    safe = np.where(small, 1.0, rate)
    result: Array = np.where(small, dt * (1.0 - 0.5 * z), -np.expm1(-z) / safe)
    return result


def growth_slope(rate: Array | float, dt: Array | float) -> Array:
    """Derivative of :func:`growth` with respect to the rate; broadcasts."""
    rate, dt = np.asarray(rate, dtype=float), np.asarray(dt, dtype=float)
    z = np.maximum(rate * dt, -60.0)
    small = np.abs(z) < 1e-3
    safe = np.where(small, 1.0, rate)
    series = dt * dt * (-0.5 + z * (1.0 / 3.0 - z * 0.125))
    result: Array = np.where(small, series, (dt * np.exp(-z) + np.expm1(-z) / safe) / safe)
    return result


#: What a fit tells: its moments (see :class:`FitMoments`), the readings used and the time they span [min], the least and the
#: greatest rate looked at, and where asked for the 95 % bounds of rate and steady state. nan where there is none.
FIT = np.dtype(
    [
        (name, float)
        for name in (
            "rate",
            "slope",
            "level",
            "phi_mean",
            "psi_mean",
            "weight",
            "phi_phi",
            "phi_psi",
            "psi_psi",
            "rss",
            "n",
            "span",
            "least",
            "greatest",
            "rate_low",
            "rate_high",
            "steady_low",
            "steady_high",
        )
    ]
)


@dataclass(frozen=True)
class FitMoments:
    """What a fit, or each of S fits, says of its own spread; variances per unit of the noise variance of a reading of weight 1.

    Fields are numbers, or arrays (S,). phi and psi are the centred basis function of the slope and its derivative by the rate.
    """

    rate: Any
    slope: Any
    level: Any
    phi_mean: Any
    psi_mean: Any
    weight: Any
    phi_phi: Any
    phi_psi: Any
    psi_psi: Any
    rss: Any

    def rate_covariance(self) -> tuple[Any, Any, Any]:
        """Variance of slope, covariance, variance of rate."""
        a, b, c = self.phi_phi, self.slope * self.phi_psi, self.slope**2 * self.psi_psi
        determinant = a * c - b * b
        if isinstance(determinant, np.ndarray):
            with np.errstate(all="ignore"):
                known = determinant > 0.0
                alone = np.where(a > 0.0, 1.0 / a, np.inf)
                return (
                    np.where(known, c / determinant, alone),
                    np.where(known, -b / determinant, 0.0),
                    np.where(known, a / determinant, np.inf),
                )
        if not determinant > 0.0:
            return (1.0 / a if a > 0.0 else math.inf), 0.0, math.inf
        return c / determinant, -b / determinant, a / determinant

    def steady_gradient(self) -> tuple[Any, Any]:
        """Derivatives of the steady state by slope and by rate."""
        return 1.0 / self.rate - self.phi_mean, self.slope * (-1.0 / self.rate**2 - self.psi_mean)

    def steady_variance(self) -> Any:
        """Variance of the steady state to first order."""
        ss, sr, rr = self.rate_covariance()
        by_slope, by_rate = self.steady_gradient()
        return 1.0 / self.weight + by_slope**2 * ss + 2.0 * by_slope * by_rate * sr + by_rate**2 * rr
