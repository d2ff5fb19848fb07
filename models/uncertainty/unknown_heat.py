"""The heat that a lump would need for its readings to be what they are, found by smoothing through the model.

    dT/dt = q(t) - b (T - sink)

At a known rate b the heat q [K/min] is linear in the readings. Its prior is a constant beside a random walk and an integrated
random walk, whose sizes are averaged over by their likelihood, and the rate over what is known of it; nothing else is assumed.
Without another source for the rate the heat is one that the model would need *at that rate*: another rate b' turns the same
readings into q + (b' - b) (T - sink).
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array, followed
from ..core.tails import chi2_tail
from ..search.rules import rule

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


@dataclass(frozen=True)
class HeatRules:
    """When heat is said to follow a column."""

    chance: float = rule(
        0.002,
        "1",
        "nominal chance, over everything tried, of a claim where nothing follows; the ratio's own law is wider than chi-square",
        "set by hand, with room; what it comes to: python -m benchmarks.analysis.unknown_heat",
    )
    correlation: float = rule(
        0.5,
        "1",
        "least correlation of the heat with what the column tells of it on blocks left out",
        "set by hand: a column that tells a quarter of the variance where it was not fitted",
    )


RULES = HeatRules()


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
    """Readings (N,) [degC] of one sensor at `time` [min], standard deviations `noise` [K], surroundings `sink` (N,) [degC]."""

    time: Array
    reading: Array
    noise: Array
    sink: Array

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
        design = np.column_stack([decay, _response(rate, knots, self.time)])
        return design / self.noise[:, None], (self.reading - known) / self.noise

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
        return rises

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
    """As :func:`simplest_rate` of a heat that follows shapes (K, G) at times (G,), about a rate known to a factor exp(step)."""
    centre, none = float(np.log(near)), np.empty((0, len(grid)))
    for _ in range(CLOSER):
        logs = centre + step * np.linspace(-1.5, 1.5, AROUND)
        likelihood = column_likelihoods(lump, np.exp(logs).tolist(), none, grid, shapes)[1]
        weight = np.exp(likelihood - likelihood.max())
        weight /= weight.sum()
        centre = float(weight @ logs)
        spacing = float(logs[1] - logs[0])
        spread = float(np.sqrt(weight @ (logs - centre) ** 2 + spacing**2 / 12.0))
        if spread > spacing:
            break
        step = 2.0 * spacing
    return float(np.exp(centre)), spread


@dataclass(frozen=True)
class Follows:
    """Heat that follows a logged column: to a power, so many minutes late.

    powers are the least and the largest that do nearly as well; correlation is that of the heat with what the column tells on
    blocks left out, likelihood_ratio is twice the logarithm, mean over the sensors,
    p its chance over everything tried; rates (S,) [1/min] those at which it does best,
    shape (G,) the column as the heat follows it, at :func:`moments`.
    """

    column: str
    power: float
    powers: tuple[float, float]
    delay_min: float
    correlation: float
    likelihood_ratio: float
    p: float
    rates: tuple[float, ...] = ()
    shape: Array | None = None

    def as_dict(self) -> dict[str, Any]:
        """What a record holds of it."""
        return {
            "column": self.column,
            "power": self.power,
            "powers": list(self.powers),
            "delay_min": float(f"{self.delay_min:.3g}"),
            "correlation": round(self.correlation, 3),
            "p": float(f"{self.p:.2g}"),
        }


#: A power does nearly as well where its ratio is less than this below the best: 95 % of a chi-square law of one.
NEAR = 3.84
#: Powers of a column that are tried; a column that goes below zero has its first power only.
POWERS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)


def moments(time: Array) -> Array:
    """Every time (N,), an instant before and one after it: straight lines between them draw what moves evenly and what jumps."""
    little = INSTANT * np.diff(time)
    return np.sort(np.concatenate([time, time[1:] - little, time[:-1] + little]))


def between_readings(column: Array, time: Array) -> list[Callable[[Array], Array]]:
    """How a column (N,) may be between its readings at time (N,): on the straight line, and where it jumps held, or told after."""
    ways: list[Callable[[Array], Any]] = [lambda at: np.interp(at, time, column)]
    if float(np.abs(np.diff(column)).max()) > JUMPS * float(np.ptp(column)):
        last = len(time) - 1
        ways.append(lambda at: column[np.clip(np.searchsorted(time, at, "right") - 1, 0, last)])
        ways.append(lambda at: column[np.clip(np.searchsorted(time, at, "left"), 0, last)])
    return ways


def shapes_of(
    column: Array, time: Array, delays: Sequence[float], powers: Sequence[float] = POWERS
) -> tuple[Array, list[tuple[float, float]]]:
    """Shapes (C, G) at :func:`moments` of a column (N,) to powers and delays, each of range 1, and their (power, delay [min])."""
    if float(column.min()) < 0.0 or len(np.unique(column)) == 2:  # what is on or off has no power
        powers = (1.0,)
    rows, told, grid = [], [], moments(time)
    for way, power, delay in itertools.product(between_readings(column, time), powers, delays):
        shape = way(grid - delay) ** power
        reach = float(np.ptp(shape))
        if reach > 0.0:
            rows.append(shape / reach)
            told.append((power, delay))
    return np.array(rows).reshape(len(rows), len(grid)), told


#: Rates about one that is nearly known, and how often they close in on it.
AROUND, CLOSER = 9, 5
#: Where a heat follows a column: shapes that are looked at again beside those without delay, at so many rates; and those for
#: which the rate is found exactly.
LIKELY, FINE_RATES, REFINED = 12, 150, 3
#: An instant, of the time between two readings; and a step that is a jump, of the range of a column.
INSTANT, JUMPS = 1e-3, 0.05


def delays_for(time: Array) -> tuple[float, ...]:
    """Delays [min] that are tried: none, and from two readings to a tenth of the record."""
    span, step = float(time[-1] - time[0]), float(np.median(np.diff(time)))
    return (0.0, *np.geomspace(2.0 * step, max(0.1 * span, 4.0 * step), 8).tolist())


def block_correlation(heats: Sequence[UnknownHeat], shapes: Array, grid: Array, blocks: int = 4) -> float:
    """Correlation of heats with what shapes (K, G) at times (G,) tell of them on blocks left out, sizes learnt on the others."""
    real, told = [], []
    for heat in heats:
        x = np.column_stack([np.ones(len(heat.time)), *(np.interp(heat.time, grid, s) for s in shapes)])
        edges = np.linspace(0, len(x), blocks + 1).astype(int)
        guess = np.empty(len(x))
        for a, b in itertools.pairwise(edges):
            rest = np.ones(len(x), dtype=bool)
            rest[a:b] = False
            guess[a:b] = x[a:b] @ np.linalg.lstsq(x[rest], heat.heat[rest], rcond=None)[0]
        size = max(float(np.std(heat.heat)), 1e-300)
        real.append((heat.heat - heat.heat.mean()) / size)
        told.append((guess - heat.heat.mean()) / size)
    one, other = np.concatenate(real), np.concatenate(told)
    if not (np.std(other) > 0.0 and np.std(one) > 0.0):
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])


def followed_column(
    lumps: Sequence[Lump],
    rates: Sequence[Sequence[float]],
    columns: dict[str, NDArray[np.float64]],
    time: Array,
    given: Sequence[Array] = (),
) -> list[Follows]:
    """Logged columns (N,) at `time` that the heats of a run's sensors follow, with the best power and delay; the likeliest first.

    rates are those that each sensor may have; where there are several, each model takes the one that suits it best.
    given are shapes (G,) that the heat follows already. What is told is not yet a claim.
    """
    delays, grid = delays_for(time), moments(time)
    offers = {n: shapes_of(c, time, delays) for n, c in columns.items() if np.ptp(c) > 0.0}
    offers = {n: (shapes, told) for n, (shapes, told) in offers.items() if told}
    if not offers or not lumps:
        return []
    every = np.concatenate([shapes for shapes, _ in offers.values()])
    total, best_rates, alone = np.zeros(len(every)), np.zeros((len(lumps), len(every))), 0.0
    for k, (lump, may) in enumerate(zip(lumps, rates, strict=True)):
        with_, without = column_likelihoods(lump, may, every, grid, np.array(given))
        total += 2.0 * (with_.max(axis=0) - without.max())
        alone += 2.0 * float(without.max()) / len(lumps)
        best_rates[k] = np.asarray(may)[with_.argmax(axis=0)]
    # The sensors of a run share its unknown heat: together they are evidence no better than one of them.
    ratios, found, begin = total / len(lumps), [], 0
    for name, (shapes, told) in offers.items():
        ratio = ratios[begin : begin + len(told)]
        best = int(np.argmax(ratio))
        p = min(1.0, len(every) * chi2_tail(1, max(0.0, float(ratio[best]))))
        own = tuple(best_rates[:, begin + best].tolist())
        if p < RULES.chance and all(len(may) > 1 for may in rates):
            likely = np.union1d(np.argsort(-ratio)[:LIKELY], [i for i, (_, delay) in enumerate(told) if delay == 0.0]).astype(int)
            place, among, own = _at_own_rates(lumps, rates, shapes[likely], grid, np.array(given))
            best, ratio = int(likely[place]), np.full(len(told), -np.inf)
            ratio[likely] = among - alone
        power, delay = told[best]
        near = [told[i][0] for i in np.flatnonzero(ratio >= ratio[best] - NEAR)]
        heats = [smooth_heat(lump, rate) for lump, rate in zip(lumps, own, strict=True)] if p < RULES.chance else []
        r = block_correlation(heats, np.array([*given, shapes[best]]), grid) if heats else 0.0
        found.append(Follows(name, power, (min(near), max(near)), delay, r, float(ratio[best]), p, own, shapes[best]))
        begin += len(told)
    return sorted(found, key=lambda f: -f.likelihood_ratio)


def _at_own_rates(
    lumps: Sequence[Lump], rates: Sequence[Sequence[float]], shapes: Array, grid: Array, given: Array
) -> tuple[int, Array, tuple[float, ...]]:
    """The best of shapes (C, G), twice the log-likelihoods (C,), mean over the lumps, and each lump's rate, where heat follows one.

    The rate is then known so well that between the rates of a coarse grid the likelihood of the right shape is not seen.
    """
    total, nearest = np.zeros(len(shapes)), np.zeros((len(lumps), len(shapes)))
    for k, (lump, may) in enumerate(zip(lumps, rates, strict=True)):
        fine = np.geomspace(may[0], may[-1], FINE_RATES)
        likelihood = column_likelihoods(lump, fine.tolist(), shapes, grid, given)[0]
        total += 2.0 * likelihood.max(axis=0) / len(lumps)
        nearest[k] = fine[likelihood.argmax(axis=0)]
    step = float(np.log(rates[0][-1] / rates[0][0])) / (FINE_RATES - 1)
    refined = {}
    for c in np.argsort(-total)[:REFINED].tolist():
        together = np.vstack([*given, shapes[c]])
        own = [following_rate(lump, float(nearest[k, c]), step, together, grid)[0] for k, lump in enumerate(lumps)]
        reached = [
            column_likelihoods(lump, [b], shapes[c : c + 1], grid, given)[0][0, 0] for lump, b in zip(lumps, own, strict=True)
        ]
        total[c] = 2.0 * float(np.mean(reached))
        refined[c] = tuple(own)
    best = max(refined, key=lambda c: float(total[c]))
    return best, total, refined[best]


def claims(
    lumps: Sequence[Lump], rates: Sequence[Sequence[float]], columns: dict[str, NDArray[np.float64]], time: Array, most: int = 3
) -> list[Follows]:
    """Columns that the heat is said to follow, each beside those before it: chance does not give such a ratio, and the columns tell
    the heat where it was not fitted, the more of them the better.
    """
    found: list[Follows] = []
    left = dict(columns)
    while left and len(found) < most:
        follows = followed_column(lumps, rates, left, time, [f.shape for f in found if f.shape is not None])
        least = found[-1].correlation if found else RULES.correlation
        best = next((f for f in follows if f.p < RULES.chance and f.correlation >= least), None)
        if best is None:
            break
        found.append(best)
        del left[best.column]
    return found
