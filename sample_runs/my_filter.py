"""A user's own filter, worked through in docs/add-a-filter.md: sigma points close to the mean."""

from dataclasses import dataclass

from thermofast.filters import GaussianFilter, setting
from thermofast.filters.moments import ScaledPoints


@dataclass(frozen=True)
class TightUkf(GaussianFilter):
    """Sigma points close to the mean, nothing forgotten."""

    name = "tight_ukf"
    summary = "unscented filter with sigma points close to the mean"
    reference = "Julier & Uhlmann 2004, scaled points"
    closing = "never"

    spread: float = setting(0.1, "distance of the sigma points, in deviations", 0.001, 1.0)

    @property
    def moments(self):
        return ScaledPoints(self.spread)
