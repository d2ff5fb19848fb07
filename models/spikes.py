"""Stray readings: those that leave their two neighbours on one side and come straight back."""

import math

import numpy as np

from .kernel import Array

SPIKE = 8.0


def spike_weights(reading: Array, resolution: float = 0.0) -> Array:
    """1 for a reading, 0 for an isolated spike; shape (n,).

    A spike differs from the median of itself and its neighbours by more than SPIKE deviations of the noise, which is taken
    from the differences of the record. In a monotonic stretch that median is the reading itself, however steep.
    """
    weights = np.ones(len(reading))
    if len(reading) < 5:
        return weights
    step = np.diff(reading)
    noise = 1.4826 * float(np.median(np.abs(step - np.median(step)))) / math.sqrt(2.0)
    inner = np.median([reading[:-2], reading[1:-1], reading[2:]], axis=0)
    stray = np.abs(reading[1:-1] - inner) > SPIKE * max(noise, resolution / 2.0, 1e-12)
    weights[1:-1][stray] = 0.0
    return weights if weights.sum() > len(weights) / 2 else np.ones(len(reading))
