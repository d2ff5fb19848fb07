"""The area metric: how far, in K, what was measured lies from what a model says, as whole distributions.

Zhao, Lyu and Kan, "A validation metric for model with mixture of random and interval variables", Journal of Beijing University of
Aeronautics and Astronautics 44(5), 2018, 967-974; for measurements of which only one value of the interval inputs is known,
Ferson and Oberkampf, International Journal of Reliability and Safety 3, 2009, 3-22 (the paper's reference 12).
"""

from dataclasses import dataclass

import numpy as np

from ..core.kernel import Array

#: With fewer samples than this, on either side, the metric may put the worse of two models first (section 3.3).
FEWEST = 30
#: Points that stand for the model's distribution over a record, at least; the error this leaves is far below that of the readings.
POINTS = 2**15
#: Points that stand for the model's distribution at one reading, at least.
LEAST_LEVELS = 4
#: Multiples of this, modulo one, fill the unit interval as evenly as any sequence does.
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True)
class IntervalArea:
    """Equation (2): areas [unit of the samples] between the distributions of the lower and of the upper bounds."""

    lower: float
    upper: float

    @property
    def total(self) -> float:
        """The paper's metric, the sum of both: an offset of one unit counts as two."""
        return self.lower + self.upper


def enough(*samples: int) -> bool:
    """Whether all numbers of samples, measured and of the model, are such that models may be ranked by the metric."""
    return min(samples) >= FEWEST


def area_metric(measured: Array, model: Array) -> float:
    """Area [unit of the samples] between the empirical distributions of measured (n,) and model (m,), exact for any n and m.

    Equation (2) without interval inputs; the Wasserstein distance of order one. ValueError for an empty sample or one not finite.
    """
    measured, model = _sorted(measured), _sorted(model)
    edges = _edges(measured, model)
    return _area(edges, np.abs(_shares(measured, edges) - _shares(model, edges)))


def response_bounds(response: Array) -> tuple[Array, Array]:
    """Least and largest response (M,), (M,) of each draw of the random inputs, from response (M, N) over N interval inputs.

    Steps 3 and 5: row i holds one draw x_i at all values y_k of the interval inputs.
    """
    return response.min(axis=1), response.max(axis=1)


def area_metric_interval(measured_low: Array, measured_high: Array, model_low: Array, model_high: Array) -> IntervalArea:
    """Equation (2) for bounds of the response, measured_low, measured_high (n,) and model_low, model_high (m,).

    The experiment, too, must have been run over all values of the interval inputs: for a single value in them, unknown or not,
    see :func:`area_outside`. ValueError for a sample that is empty or not finite.
    """
    return IntervalArea(area_metric(measured_low, model_low), area_metric(measured_high, model_high))


def area_outside(measured: Array, model_low: Array, model_high: Array) -> float:
    """Area [unit of the samples] by which the distribution of measured (n,) leaves the box of model_low, model_high (m,).

    The box is all distributions between those of the model's lower and upper bounds; nothing inside it contradicts the model.
    Where both bounds are the same sample this is :func:`area_metric`. ValueError for a sample that is empty or not finite, or
    where the bounds' distributions are the wrong way round.
    """
    measured, low, high = _sorted(measured), _sorted(model_low), _sorted(model_high)
    if len(low) != len(high) or (low > high).any():
        raise ValueError("the model's lower bounds must be as many as the upper ones and not above them")
    edges = _edges(measured, low, high)
    share = _shares(measured, edges)
    # The distribution function of the lower bounds is the larger one.
    outside = np.maximum(share - _shares(low, edges), _shares(high, edges) - share)
    return _area(edges, np.maximum(outside, 0.0))


def record_area_metric(
    reading: Array,
    curve: Array,
    deviation: Array,
    low: Array | None = None,
    high: Array | None = None,
    noise: float = 0.0,
) -> float:
    """Mean distance [K] by which a record's residuals would have to move to be such as the model foretells.

    reading, curve (N,) [K or deg C]; deviation (N,) [K] standard deviation of the curve from its parameters; low, high (N,) the
    curve's bounds over the declared ranges of the inputs, None for inputs known exactly; noise [K] of the readings.

    The residuals reading - curve, pooled over the record, against the pooled normal distributions of variance
    deviation^2 + noise^2 about low - curve and high - curve: :func:`area_outside`. Residuals and not temperatures, since a curve
    that is wrong at every time may still pass through the right temperatures.

    A record is one draw of the parameters, not N: where the deviation is that of a right model and all of one sign, the metric
    is on average 0.8 (deviation small beside the noise) to 1.13 times (large beside it) the deviation, and does not vanish with N.

    ValueError for arrays that are empty, of unequal length or not finite, a negative deviation or noise, only one bound, or low
    above high.
    """
    if (low is None) != (high is None):
        raise ValueError("give both bounds of the curve or none")
    low, high = (curve if low is None else low), (curve if high is None else high)
    if not len(reading) == len(curve) == len(deviation) == len(low) == len(high):
        raise ValueError("reading, curve, deviation and bounds must be of one length")
    if not (np.min(deviation, initial=0.0) >= 0.0 and noise >= 0.0):
        raise ValueError("deviation and noise must not be negative")
    if (low > high).any():
        raise ValueError("the curve's lower bound is above its upper one")
    spread = np.hypot(deviation, noise)[:, None] * _normal_levels(len(curve))
    below, above = ((bound - curve)[:, None] + spread for bound in (low, high))
    return area_outside(reading - curve, below.ravel(), above.ravel())


def _normal_levels(readings: int) -> Array:
    """Quantiles (N, levels) of the standard normal, evenly spaced in probability within a reading and staggered between them.

    Staggered, as the readings' normal distributions are pooled: equal ones then make up one distribution of N times the levels.
    """
    from scipy.special import ndtri

    levels = max(LEAST_LEVELS, -(-POINTS // max(readings, 1)))
    stagger = (GOLDEN * np.arange(1, readings + 1)) % 1.0
    return np.asarray(ndtri((np.arange(levels) + stagger[:, None]) / levels))


def _sorted(sample: Array) -> Array:
    """The sample (n,) in ascending order; ValueError where it is empty or not finite."""
    if sample.ndim != 1 or not len(sample) or not np.isfinite(sample).all():
        raise ValueError("a sample must be a list of at least one finite number")
    return np.sort(sample)


def _edges(*samples: Array) -> Array:
    """All values of all samples in ascending order: between two of them no distribution function changes."""
    return np.sort(np.concatenate(samples), kind="stable")


def _shares(sample: Array, edges: Array) -> Array:
    """Empirical distribution function (k - 1,) of an ascending sample on the stretches between edges (k,)."""
    return np.searchsorted(sample, edges[:-1], side="right") / len(sample)


def _area(edges: Array, height: Array) -> float:
    """Integral of a step function of heights (k - 1,) between edges (k,)."""
    return float(height @ np.diff(edges))
