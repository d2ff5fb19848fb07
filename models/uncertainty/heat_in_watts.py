"""The whole heat of a lump in watts where part of it is a power that was logged, and how much heat the lump holds.

    C dT/dt = P(t) + H(t) - (T - sink) / R

P is logged, H is whatever else acts: a constant beside a random walk and an integrated one, as in ``unknown_heat``. In K/min it is
q = g (P - mean P) + h with g = 60 / C: linear in the readings at a known rate b = 60 / (R C). What P moves and H does not tells g,
so heat capacity and resistance come with the intervals that any unlogged heat leaves them; where P hardly moves nothing is told.
When between two readings P jumped nobody logged: what that moves the readings by is free at each of its largest jumps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from ..core.kernel import Array
from .lump_heat import KNOTS, NODES, SHARES, TEST_BENDS, TEST_KNOTS, TEST_WALKS, Lump, posteriors
from .unknown_heat import between_readings, moments

#: Deviations from nothing of 60 / C from which watts are told.
DETERMINED = 4.0
#: A jump of the power between two readings is one of at least this share of its range; so many of the largest are freed.
JUMP, MOST_JUMPS = 0.05, 12
#: Draws from the posterior that the intervals are read off: their own error is a tenth of a deviation at most.
DRAWS = 4000
#: Rates less likely than the likeliest by this factor are left out; this many at least are looked at beside.
UNLIKELY, FEWEST = 1e-3, 9

Interval = tuple[float, float, float]


@dataclass(frozen=True)
class HeatInWatts:
    """All heat [W] at `time` (M,) [min] with its 95 % band, and the logged part of it.

    capacity [J/K] and resistance [K/W] are (value, low, high).
    """

    time: Array
    heat: Array
    low: Array
    high: Array
    logged: Array
    capacity: Interval
    resistance: Interval


def heat_in_watts(
    lump: Lump, power: Array, rates: Sequence[float], deviation: float | None = None, when: Array | None = None
) -> HeatInWatts | None:
    """All heat of a lump of which `power` (P,) [W] is logged; None where the power does not move enough to tell.

    It is logged at `when` (P,) [min], among which are the times of all readings, or at those.

    rates [1/min], evenly spaced in logarithm, are those that are possible; with `deviation`, that of its logarithm, the one given
    is known from elsewhere.
    """
    if not np.ptp(power) > 0.0:
        return None
    when = lump.time if when is None else when
    grid = moments(when)
    known = None if deviation is None else [float(rates[0] * np.exp(node * deviation)) for node in NODES]
    best: tuple[float, Array, list[float]] | None = None
    for way in between_readings(power, when):
        shape = way(grid)
        told = known if known is not None else _likely(lump, power, shape, when, list(rates))
        reached = float(_at_rates(lump, power, shape, when, told, TEST_KNOTS)[0].max())
        if best is None or reached > best[0]:
            best = reached, shape, told
    assert best is not None
    _, shape, told = best
    prior = np.log(SHARES) if known is not None else np.zeros(len(told))
    values, means, covariances, of = _at_rates(lump, power, shape, when, told, KNOTS)
    weight = np.exp(values + prior[of] - np.max(values + prior[of]))
    weight /= weight.sum()
    slope = float(weight @ means[:, -1])
    spread = float(np.sqrt(weight @ (means[:, -1] ** 2 + covariances[:, -1, -1]) - slope**2))
    if slope < DETERMINED * spread:
        return None
    rng = np.random.default_rng(0)
    counts = rng.multinomial(DRAWS, weight)
    some = np.flatnonzero(counts)
    drawn = np.concatenate([rng.multivariate_normal(means[k], covariances[k], counts[k], method="eigh") for k in some])
    rate = np.repeat(np.array(told)[of[some]], counts[some])
    # Far below DETERMINED deviations lies a sign that the gate has ruled out.
    good = drawn[:, -1] > 0.0
    drawn, rate = drawn[good], rate[good]
    capacity = 60.0 / drawn[:, -1]
    at = lump.knots(KNOTS)
    logged = np.interp(at, when, power)
    whole = drawn[:, 1 : 1 + len(at)] / drawn[:, -1:] + logged - shape.mean()
    low, heat, high = np.quantile(whole, [0.025, 0.5, 0.975], axis=0)
    return HeatInWatts(at, heat, low, high, logged, _interval(capacity), _interval(60.0 / (rate * capacity)))


def _interval(draws: Array) -> Interval:
    low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975])
    return float(middle), float(low), float(high)


def _at_rates(
    lump: Lump, power: Array, shape: Array, when: Array, rates: Sequence[float], knots: int
) -> tuple[Array, Array, Array, Array]:
    """Log-likelihoods (H,), means (H, M + J + 2) and covariances of (start, knots, jumps, 60 / C), and the rate of each."""
    at, grid = lump.knots(knots), moments(when)
    shapes = np.vstack([*(np.interp(grid, when, jump) for jump in _jumps(power)), shape])
    priors = [p.with_free(len(shapes)) for p in lump.priors(rates[len(rates) // 2], len(at), TEST_WALKS, TEST_BENDS)]
    found = []
    for rate in rates:
        design, z = lump.scaled(rate, at)
        own = (lump.curves(rate, shapes, grid) / lump.noise).T
        found.append(posteriors(np.hstack([design, own]), z, priors))
    values, means, covariances = (np.concatenate(f) for f in zip(*found, strict=True))
    return values, means, covariances, np.repeat(np.arange(len(rates)), len(priors))


def _jumps(power: Array) -> Array:
    """Shapes (J, N) of heat about the instants at which a power jumped: as much as the jump, at the reading after it."""
    step = np.abs(np.diff(power))
    where = np.argsort(-step)[: min(MOST_JUMPS, int(np.count_nonzero(step > JUMP * np.ptp(power))))] + 1
    shapes = np.zeros((len(where), len(power)))
    shapes[np.arange(len(where)), where] = step[where - 1]
    return shapes


def _likely(lump: Lump, power: Array, shape: Array, when: Array, rates: list[float]) -> list[float]:
    """Rates [1/min], evenly spaced in logarithm, over those that the readings leave possible."""
    for _ in range(6):
        values, _, _, of = _at_rates(lump, power, shape, when, rates, TEST_KNOTS)
        each = np.array([logsumexp(values[of == r]) for r in range(len(rates))])
        kept = np.flatnonzero(each > each.max() + np.log(UNLIKELY))
        if len(kept) >= FEWEST:
            return [rates[k] for k in kept]
        first, last = max(kept[0] - 1, 0), min(kept[-1] + 1, len(rates) - 1)
        rates = np.geomspace(rates[first], rates[last], FEWEST + 4).tolist()
    return rates
