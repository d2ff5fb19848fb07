"""Maximum likelihood over all readings at once: the plain reference."""

from dataclasses import dataclass

import numpy as np

from .base import Array, Closing, Filter, StateModel, Track


@dataclass(frozen=True)
class LeastSquares(Filter):
    """No filter: every reading counts alike, and the closing likelihood step does all the work."""

    name = "least_squares"
    summary = "maximum likelihood over all readings at once, each counting alike: the plain reference"
    reference = "Golub & Pereyra 1973, SIAM J. Numer. Anal. 10(2)"

    @property
    def closing(self) -> Closing:
        return "always"

    def track(self, model: StateModel, time: Array, reading: Array, resolution: float = 0.0) -> Track:
        """A track without states: all weights one."""
        count, n = len(time), len(model.state_names)
        none = np.full(count, np.nan)
        one = np.ones(count)
        return Track(
            first=count,
            state=np.full((count, n), np.nan),
            covariance=np.full((count, n, n), np.nan),
            noise_variance=none,
            innovation=none,
            innovation_variance=none,
            fading=one,
            process_noise=np.zeros(count),
            noise_factor=one,
            weight=one,
            forgotten=np.zeros(count),
            diverged_at=None,
        )
