"""Stray readings: those that leave their two neighbours on one side and come straight back."""

import numpy as np

from . import kernel
from .kernel import Array


def spike_weights(reading: Array, resolution: float = 0.0) -> Array:
    """1 for a reading, 0 for an isolated spike; shape (n,).

    A spike differs from the median of itself and its neighbours by more than eight deviations of the noise, which is taken
    from the differences of the record. In a monotonic stretch that median is the reading itself, however steep.
    resolution [K] is the logger's step.
    """
    weights = np.empty(len(reading))
    kernel.spike_weights(np.ascontiguousarray(reading), resolution, weights)
    return weights
