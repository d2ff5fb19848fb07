"""The heat that a lump would need for its readings to be what they are, found by smoothing through the model.

    dT/dt = q(t) - b (T - sink)

At a known rate b the heat q [K/min] is linear in the readings. Its prior is a constant beside a random walk and an integrated
random walk, whose sizes are averaged over by their likelihood, and the rate over what is known of it; nothing else is assumed.
Without another source for the rate the heat is one that the model would need *at that rate*: another rate b' turns the same
readings into q + (b' - b) (T - sink).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.kernel import Array, followed

#: Knots of the heat, which is a straight line between them.
KNOTS = 120
#: Sizes of the random walk and of the integrated one over the whole record, relative to rate times range of the readings.
WALKS = tuple(np.geomspace(0.01, 4.0, 9).tolist())
BENDS = (0.01, 0.1, 0.4, 1.5)
#: A test of a column, which compares likelihoods, needs fewer knots and sizes than a band.
TEST_KNOTS, TEST_WALKS, TEST_BENDS = 60, WALKS[::2], BENDS[::2]
#: Prior standard deviation of the mean heat in the same unit.
MEAN = 10.0
#: Gauss-Hermite rule with five points for a normal distribution: an exact mean and variance over the rate.
NODES = (-2.856970, -1.355626, 0.0, 1.355626, 2.856970)
SHARES = (0.011257, 0.222076, 0.533333, 0.222076, 0.011257)
#: Rates about one that is nearly known, and how often they close in on it.
AROUND, CLOSER = 9, 8
#: No factor of a rate is looked at that is larger, in logarithms.
WIDEST = 0.7


@dataclass(frozen=True)
class Prior:
    """One size of the random walks: inverse covariance (M + 1, M + 1) of start and knots, and its log-determinant."""

    inverse: Array
    log_det: float

    def with_free(self, count: int) -> "Prior":
        """With `count` more parameters of which nothing is known; its log-determinant then leaves out a constant."""
        wide = np.zeros((len(self.inverse) + count,) * 2)
        wide[: len(self.inverse), : len(self.inverse)] = self.inverse
        return Prior(wide, self.log_det)


@dataclass(frozen=True)
class Lump:
    """Readings (N,) [degC] of one sensor at `time` [min], standard deviations `noise` [K], surroundings `sink` (N,) [degC].

    lag [min]: of the probe, which follows the lump.
    """

    time: Array
    reading: Array
    noise: Array
    sink: Array
    lag: float = 0.0

    def knots(self, most: int) -> Array:
        """Times (M,) between which the heat is a straight line."""
        return np.linspace(self.time[0], self.time[-1], min(most, max(4, len(self.time))))

    def scaled(self, rate: float, knots: Array) -> tuple[Array, Array]:
        """(design (N, M + 1), readings (N,)) over the noise: what the start and the heat at each knot do to the readings."""
        out = np.empty((1, len(self.time)))
        followed(self.time, np.ascontiguousarray(self.sink), np.array([1.0 / rate]), out)
        decay = self._decay(rate)
        # The start is a deviation from the first reading, the surroundings act as the lump has smoothed them.
        known = out[0] + (self.reading[0] - self.sink[0]) * decay
        seen = self._read(np.vstack([known, decay, _response(rate, knots, self.time).T]))
        return (seen[1:] / self.noise).T, (self.reading - seen[0]) / self.noise

    def curves(self, rate: float, shapes: Array, grid: Array) -> Array:
        """Rise (C, N) under heat of these shapes (C, G) at times (G,) but for a constant, from the start on.

        Between the times, among which are those of all readings, the heat is a straight line.
        """
        since = np.searchsorted(grid, self.time[0])
        own = grid[since:]
        at, out = np.searchsorted(own, self.time), np.empty((1, len(own)))
        decay = self._decay(rate)
        rises = np.empty((len(shapes), len(self.time)))
        for row, shape in zip(rises, (shapes - shapes.mean(axis=1, keepdims=True))[:, since:], strict=True):
            followed(own, np.ascontiguousarray(shape), np.array([1.0 / rate]), out)
            row[:] = (out[0, at] - shape[0] * decay) / rate
        return self._read(rises)

    def _read(self, curves: Array) -> Array:
        """Temperatures (K, N) of the lump as its probe shows them."""
        if self.lag <= 0.0:
            return curves
        out, late = np.empty((len(curves), 1, len(self.time))), np.array([self.lag])
        for row, curve in zip(out, np.ascontiguousarray(curves), strict=True):
            followed(self.time, curve, late, row)
        return out[:, 0]

    def priors(self, rate: float, count: int, *sizes: Sequence[float]) -> "list[Prior]":
        reach = max(float(np.ptp(self.reading)), 10.0 * float(self.noise.max()))
        return _priors(count, rate * reach, reach, *sizes)

    def _decay(self, rate: float) -> Array:
        return np.asarray(np.exp(-rate * (self.time - self.time[0])))


@dataclass(frozen=True)
class UnknownHeat:
    """Heat at `time` (M,) [min] with its standard deviation [K/min], told at a rate [1/min]."""

    time: Array
    heat: Array
    deviation: Array
    rate: float


def smooth_heat(
    lump: Lump,
    rate: float,
    rate_deviation: float = 0.0,
    sink_deviation: float = 0.0,
    shapes: Array | None = None,
    grid: Array | None = None,
) -> UnknownHeat:
    """Heat of one lump at its rate [1/min], of which the logarithm is known to `rate_deviation`, its surroundings to so many K.

    shapes (K, G) at times (G,) are those that it is known to follow, to sizes that the readings tell, beside the random walks.

    Reference: Gaussian process prior through a linear system, Rasmussen & Williams, Gaussian Processes for Machine Learning, 9.8.
    """
    at = lump.knots(KNOTS)
    priors = lump.priors(rate, len(at))
    told = np.hstack([np.zeros((len(at), 1)), np.eye(len(at))])  # the heat at each knot, of start and knots
    if shapes is not None and grid is not None:
        priors = [p.with_free(len(shapes)) for p in priors]
        told = np.hstack([told, np.array([np.interp(at, grid, s - s.mean()) for s in shapes]).T])
    heats, variances = [], []
    for node in NODES if rate_deviation > 0.0 else (0.0,):
        near = rate * float(np.exp(node * rate_deviation))
        design, z = lump.scaled(near, at)
        if shapes is not None and grid is not None:
            design = np.hstack([design, (lump.curves(near, shapes, grid) / lump.noise).T])
        values, starts, inverses = posteriors(design, z, priors)
        means = starts @ told.T
        weight = np.exp(values - values.max())
        weight /= weight.sum()
        mean = weight @ means
        heats.append(mean)
        variances.append(weight @ (means**2 + np.einsum("mi,hij,mj->hm", told, inverses, told, optimize=True)) - mean**2)
    share = np.array(SHARES if len(heats) > 1 else (1.0,))
    heat = share @ np.array(heats)
    variance = share @ (np.array(variances) + np.array(heats) ** 2) - heat**2
    return UnknownHeat(at, heat, np.sqrt(np.maximum(variance, 0.0) + (rate * sink_deviation) ** 2), rate)


def column_likelihoods(
    lump: Lump, rates: Sequence[float], shapes: Array, grid: Array, given: Array | None = None
) -> tuple[Array, Array]:
    """Log-likelihoods (R, C) at each rate with heat that follows a shape (C, G) beside the random walks, and (R,) without.

    The shapes stand at times (G,); given (K, G) are those that the heat follows already, each with a size of its own. The sizes
    of the walks are estimated anew for each shape; a constant in a shape says nothing.
    """
    at = lump.knots(TEST_KNOTS)
    with_, without = np.full((len(rates), len(shapes)), -np.inf), np.empty(len(rates))
    priors = lump.priors(rates[len(rates) // 2], len(at), TEST_WALKS, TEST_BENDS)
    if given is not None and len(given):
        priors = [p.with_free(len(given)) for p in priors]
    for r, rate in enumerate(rates):
        design, z = lump.scaled(rate, at)
        if given is not None and len(given):
            design = np.hstack([design, (lump.curves(rate, given, grid) / lump.noise).T])
        values, _, inverses = posteriors(design, z, priors)
        curves = lump.curves(rate, shapes, grid) / lump.noise
        projected, against = design.T @ curves.T, design.T @ z
        own, mixed = (curves**2).sum(axis=1), curves @ z
        for value, inverse in zip(values, inverses, strict=True):
            reduced = inverse @ projected
            power = np.maximum(own - (projected * reduced).sum(axis=0), 1e-12 * own + 1e-300)
            with_[r] = np.maximum(with_[r], value + 0.5 * (mixed - against @ reduced) ** 2 / power)
        without[r] = values.max()
    return with_, without


def _priors(count: int, size: float, start: float, walks: Sequence[float] = WALKS, bends: Sequence[float] = BENDS) -> list[Prior]:
    x = np.linspace(0.0, 1.0, count)
    low, high = np.minimum(x[:, None], x[None, :]), np.maximum(x[:, None], x[None, :])
    bend = low**2 * (3.0 * high - low) / 2.0 + 3.0 * low * high  # an integrated random walk beside a slope of its size
    walk, much = (np.ravel(m)[:, None, None] for m in np.meshgrid(walks, bends, indexing="ij"))
    whole = np.zeros((len(walk), count + 1, count + 1))
    whole[:, 0, 0] = start**2
    whole[:, 1:, 1:] = size**2 * (MEAN**2 + walk**2 * low + much**2 * bend)
    return [Prior(inverse, log_det) for inverse, log_det in zip(*_inverted(whole), strict=True)]


def posteriors(design: Array, z: Array, priors: Sequence[Prior]) -> tuple[Array, Array, Array]:
    """Log-likelihood (H,), means (H, M + 1) and covariances (H, M + 1, M + 1) under each prior."""
    information, against = design.T @ design, design.T @ z
    inverses, log_dets = _inverted(information + np.stack([p.inverse for p in priors]))
    means = inverses @ against
    values = -0.5 * (float(z @ z) - means @ against + np.array([p.log_det for p in priors]) + log_dets)
    return values, means, inverses


def _inverted(matrices: Array) -> tuple[Array, Array]:
    """Inverses (H, K, K) and log-determinants (H,) of covariances or informations (H, K, K)."""
    factors = np.linalg.cholesky(matrices)
    halves = np.linalg.inv(factors)  # as exact as by two triangular solutions, and all at once
    inverses = np.swapaxes(halves, 1, 2) @ halves
    return inverses, 2.0 * np.log(np.einsum("hii->hi", factors)).sum(axis=1)


def _response(rate: float, knots: Array, time: Array) -> Array:
    """Rise (N, M) of a lump at rest by heat that is 1 at one knot and falls to 0 at its neighbours, integrated exactly."""
    fine = np.union1d(knots, time)
    hats = np.maximum(0.0, 1.0 - np.abs(fine[None, :] - knots[:, None]) / (knots[1] - knots[0]))
    out, late = np.empty_like(hats), np.array([1.0 / rate])
    for row, hat in zip(out, hats, strict=True):
        followed(fine, hat, late, row[None])
    out -= hats[:, :1] * np.exp(-rate * (fine - fine[0]))  # what follows begins where it is, a lump at rest at 0
    return np.asarray(out.T[np.searchsorted(fine, time)] / rate)


def simplest_rate(lump: Lump, rates: Sequence[float]) -> tuple[float, float]:
    """The rate [1/min] at which the heat that a record needs is the simplest, and the standard deviation of its logarithm.

    Of `rates`, evenly spaced in logarithm, each as likely as it makes the readings under the random walks: a heat that moves least.
    """
    likelihood = column_likelihoods(lump, rates, np.empty((0, len(lump.time))), lump.time)[1]
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    logs = np.log(rates)
    mean = float(weight @ logs)
    spacing = float(logs[1] - logs[0])
    return float(np.exp(mean)), float(np.sqrt(weight @ (logs - mean) ** 2 + spacing**2 / 12.0))


def following_rate(lump: Lump, near: float, step: float, shapes: Array, grid: Array) -> tuple[float, float]:
    """As :func:`simplest_rate` of a heat that follows shapes (K, G) at times (G,), about a rate known to a factor exp(step).

    Where the likelihood is wider than what is looked at, more is; where it is narrower than the spacing, less.
    """
    centre, none, widest = float(np.log(near)), np.empty((0, len(grid))), WIDEST
    for _ in range(CLOSER):
        logs = centre + step * np.linspace(-1.5, 1.5, AROUND)
        likelihood = column_likelihoods(lump, np.exp(logs).tolist(), none, grid, shapes)[1]
        weight = np.exp(likelihood - likelihood.max())
        weight /= weight.sum()
        centre = float(weight @ logs)
        spacing = float(logs[1] - logs[0])
        spread = float(np.sqrt(weight @ (logs - centre) ** 2 + spacing**2 / 12.0))
        if spread > 0.6 * step and step < widest:
            step = min(3.0 * step, widest)
        elif spread > spacing:
            break
        else:
            step, widest = 2.0 * spacing, 0.0
    return float(np.exp(centre)), spread
