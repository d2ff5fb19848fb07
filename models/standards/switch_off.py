"""The temperature at switch-off, of a cooling record whose first reading comes late.

    T(t) = end + A exp(-a t) [+ B exp(-c t)],  a < c

One mode or two; log rates evenly distributed, so that two modes, of which one is the faster and by APART at least, are not half
as likely beforehand as one (each as likely, noise was taken for a mode more often: benchmarks.analysis.switch_off); the amplitude
of the fast mode at switch-off normal about nothing with a quarter of the record's own fall, end and A free. Given the rates all
else is linear and normal, so the temperature at an earlier time is a mixture of normal distributions over the rates, whose
quantiles are its interval: what the record leaves open of the modes is in it. A mode that is over before the first reading leaves
no trace: none of less than a third of the delay is thought of.

A machine of several parts has as many modes, most of them small, and of either sign where a part is warmed by another. What two
modes leave is a sum of small ones at all rates, normal about nothing: of no size, or of one of SMALL, as the record says.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.tails import t_quantile
from ..imperfection.numerics import quantiles

Array = NDArray[np.float64]

#: Readings from which on a cooling curve is looked at.
FEWEST = 8
#: Rates on a grid, and how often it closes in on the posterior.
RATES, CLOSER = 40, 8
#: Points that share the weight, of one mode and of two, with which a grid is fine enough; its reach in standard deviations.
ENOUGH, WIDTHS = (6.0, 40.0), 6.0
#: Noise over the range of the readings, at least.
LEAST_NOISE = 1e-6
#: Slowest rate over the record's length; ratio of the rates at least.
SLOWEST, APART = 0.05, 1.5
#: Shortest time constant, over the delay and over the time between readings: one noisy reading is no mode.
SHORTEST, LEAST_STEPS = 0.33, 2.0
#: Share of the record's fall that the fast mode may have (a deviation).
FAST_SHARE = 0.25
#: Share of the record's fall that all modes beside two have together (a deviation), and how likely each is: of a part that is
#: heated, and of one that is warmed by others, which shows where its fast mode is negative by so many of its deviations.
SMALL = ((0.0, 0.8), (0.007, 0.1), (0.02, 0.1))
SMALL_WARMED, WARMED = ((0.0, 0.4), (0.01, 0.2), (0.03, 0.2), (0.1, 0.2)), 5.0
#: Directions of sums of modes that are counted: those of so large a singular value, over the largest.
SEEN = 1e-10


@dataclass(frozen=True)
class SwitchOff:
    """Temperature [degC] at switch-off with its 95 % interval; modes is the probability that two are at work, noise [K]."""

    temperature: float
    low: float
    high: float
    two_modes: float
    noise: float


def temperature_at_switch_off(time: Array, reading: Array, at: float) -> SwitchOff | None:
    """Of readings (n,) [degC] at time (n,) [min] of a machine that was switched off at `at` [min], before the first of them.

    None where there are too few readings.
    """
    n = len(time)
    if n < FEWEST:
        return None
    length, delay = float(time[-1] - time[0]), max(float(time[0]) - at, 0.0)
    typical = float(np.median(np.diff(time)))
    slow, fast = np.log(SLOWEST / length), np.log(1.0 / max(SHORTEST * delay, LEAST_STEPS * typical))
    if fast <= slow + 0.5:
        fast = slow + 0.5
    t, mean = time - time[0], float(reading.mean())
    y = reading - mean
    size = FAST_SHARE * max(float(np.ptp(reading)), 1e-9)
    noise, fast_mode = _least_noise(t, y, slow, fast)
    boxes = [(slow, fast), (slow, fast)], [(slow, fast)]
    back = at - float(time[0])
    mixtures, several = [], []
    for share, likely in SMALL_WARMED if fast_mode < -WARMED else SMALL:
        beside = _Beside.of(t, y, back, noise, share * float(np.ptp(y)), (slow, fast))
        for box in boxes:
            one, *rest = _closed_in(beside, size, list(box))
            mixtures.append((one + np.log(likely), *rest))
            several.append(np.full(len(one), len(box) == 2 or share > 0.0))
    value, middle, variance = (np.concatenate([m[k] for m in mixtures]) for k in range(3))
    weight = np.exp(value - value.max())
    weight /= weight.sum()
    two = float(weight[np.concatenate(several)].sum())
    kept = weight > 1e-7
    low, centre, high = quantiles(weight[kept], middle[kept], np.sqrt(variance[kept]))
    # The noise is known from the record alone: its own error widens the interval as Student's distribution has it.
    wider = float(t_quantile(n - 5)) / 1.959964
    return SwitchOff(
        mean + float(centre),
        mean + float(centre + wider * (low - centre)),
        mean + float(centre + wider * (high - centre)),
        two,
        noise,
    )


def _least_noise(t: Array, y: Array, slow: float, fast: float) -> tuple[float, float]:
    """Deviation [K] of a reading from the best two modes, those of a grid, moved on from there; the fast one over its deviation."""
    logs = np.linspace(slow, fast, RATES)
    rates = np.exp(logs)
    gram, moment, whole = _sums(t, y, rates)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(RATES), np.arange(RATES)))
    i, j = i[rates[j] >= APART * rates[i]], j[rates[j] >= APART * rates[i]]
    least, known = whole, None
    if len(i):
        own = np.stack([np.zeros_like(i), i + 1, j + 1], axis=1)
        ridge = 1e-12 * np.trace(gram) * np.eye(3)
        right = moment[own]
        solved = np.linalg.solve(gram[own[:, :, None], own[:, None, :]] + ridge, right[..., None])[..., 0]
        left = whole - np.einsum("mi,mi->m", right, solved)
        best = int(np.argmin(left))

        def rest(point: Array) -> float:
            columns = np.vstack([np.ones(len(t)), np.exp(-np.outer(np.exp(point), t))])
            coefficients = np.linalg.lstsq(columns.T, y, rcond=1e-13)[0]
            return float(np.sum((y - coefficients @ columns) ** 2))

        point, least = _moved(rest, np.array([logs[i[best]], logs[j[best]]]))
        known = np.vstack([np.ones(len(t)), np.exp(-np.outer(np.exp(np.sort(point)), t))]).T
    # Readings without noise, as a simulation's, leave nothing that could be weighed.
    noise = max(float(np.sqrt(max(least, 0.0) / (len(t) - 5))), LEAST_NOISE * float(np.ptp(y)), 1e-9)
    if known is None:
        return noise, 0.0
    size = float(np.linalg.lstsq(known, y, rcond=1e-13)[0][2])
    return noise, size / max(noise * float(np.sqrt(np.linalg.pinv(known.T @ known, rcond=1e-13)[2, 2])), 1e-300)


def _moved(height: Callable[[Array], float], point: Array) -> tuple[Array, float]:
    """(place, value) of a minimum near a point."""
    from scipy.optimize import minimize

    found = minimize(height, point, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-9 * max(abs(height(point)), 1e-12)})
    return np.asarray(found.x), float(found.fun)


def _sums(t: Array, y: Array, rates: Array) -> tuple[Array, Array, float]:
    """Products of the columns (1, exp(-rate t), ...), with each other and with the readings, and the readings' own square."""
    columns = np.vstack([np.ones(len(t)), np.exp(-np.outer(rates, t))])
    return columns @ columns.T, columns @ y, float(y @ y)


@dataclass(frozen=True)
class _Beside:
    """A record whitened for its noise and for small modes beside those that are named.

    t (n,), whitener (r, n) to the r directions in which sums of modes lie, and readings y (r,) after it; at [min] is the time asked
    for: there the small modes are share (r,) of the whitened readings, with a variance; log is the density of the readings.
    """

    t: Array
    whitener: Array
    y: Array
    at: float
    share: Array
    variance: float
    log: float

    @classmethod
    def of(cls, t: Array, y: Array, at: float, noise: float, size: float, box: tuple[float, float]) -> "_Beside":
        """Small modes at rates between exp(box), each with as large a part of `size` [K] at switch-off."""
        rates = np.exp(np.linspace(*box, RATES))
        drawn = np.exp(-np.outer(t, np.exp(np.linspace(*box, 3 * RATES))))
        directions, values, _ = np.linalg.svd(np.column_stack([np.ones(len(t)), drawn]), full_matrices=False)
        smooth = directions[:, values > SEEN * values[0]]
        modes = size / np.sqrt(RATES) * smooth.T @ np.exp(-np.outer(t - at, rates))
        factor = np.linalg.cholesky(modes @ modes.T + noise**2 * np.eye(len(modes)))
        inverse = np.linalg.inv(factor)
        whitener, share = inverse @ smooth.T, inverse @ modes @ np.full(RATES, size / np.sqrt(RATES))
        white = whitener @ y
        beyond = float(y @ y) - float(np.sum((smooth.T @ y) ** 2))  # what no sum of modes explains
        log = -0.5 * float(white @ white) - 0.5 * beyond / noise**2 - float(np.log(np.diag(factor)).sum())
        log += len(modes) * float(np.log(noise))
        return cls(t, whitener, white, at, share, max(size**2 - float(share @ share), 0.0), log)


@dataclass(frozen=True)
class _Posterior:
    """Log weights, means and variances of the temperature at the time asked for, for log rates of one mode or two."""

    of: _Beside
    size: float
    box: list[tuple[float, float]]

    def __call__(self, points: Array) -> tuple[Array, Array, Array]:
        """At points (m, modes) of log rates, the fast one first; nothing outside the box, nor where two rates lie too near."""
        of, modes = self.of, points.shape[1]
        lows, highs = np.array(self.box).T
        outside = np.any((points < lows) | (points > highs), axis=1)
        if modes == 2:
            outside |= points[:, 0] < points[:, 1] + np.log(APART)
        rates = np.exp(np.clip(points, lows, highs))
        columns = np.concatenate([np.ones((len(points), 1, len(of.t))), np.exp(-rates[:, ::-1, None] * of.t)], axis=1)
        columns = columns @ of.whitener.T
        earlier = np.concatenate([np.ones((len(points), 1)), np.exp(-rates[:, ::-1] * of.at)], axis=1)
        precision = columns @ columns.transpose(0, 2, 1)
        if modes == 2:
            precision[:, 2, 2] += earlier[:, 2] ** 2 / self.size**2
        precision[:, 1, 1] += 1e-6 / self.size**2
        right = columns @ of.y
        solved = np.linalg.solve(precision, right[..., None])[..., 0]
        value = 0.5 * np.einsum("mi,mi->m", right, solved) - 0.5 * np.linalg.slogdet(precision)[1]
        value += np.log(earlier[:, 2] / self.size) if modes == 2 else 0.0
        told = earlier - columns @ of.share  # of the named modes what the small ones do not tell already
        spread = np.einsum("mi,mi->m", told, np.linalg.solve(precision, told[..., None])[..., 0])
        middle = float(of.share @ of.y) + np.einsum("mi,mi->m", told, solved)
        return np.where(outside, -np.inf, value), middle, np.maximum(spread, 0.0) + of.variance


def _closed_in(beside: _Beside, size: float, box: list[tuple[float, float]]) -> tuple[Array, Array, Array]:
    """Log weights, means and variances (m,) of the temperature asked for over a grid of log rates that closes in on its posterior.

    box holds one range of log rates for each mode, the fast one first. Two rates are often known together far better than each: the
    grid lies along what is known of both, and moves and turns until it holds the posterior.
    """
    modes = len(box)
    posterior = _Posterior(beside, size, box)
    # What the ranges are given beforehand stays what it was as the grid closes in: weights are densities times cells.
    # Pairs of rates in the wrong order, or too near, are none: two modes are half as likely as one beforehand, and less.
    before = beside.log - sum(np.log(high - low) for low, high in box)
    axes = [np.linspace(low, high, RATES) for low, high in box]
    points = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)
    cell = float(sum(np.log(max(axis[1] - axis[0], 1e-12)) for axis in axes))
    for _ in range(CLOSER):
        value, middle, variance = posterior(points)
        if not np.isfinite(value).any():
            return np.array([-np.inf]), np.zeros(1), np.ones(1)
        weight = np.exp(value - value.max())
        weight /= weight.sum()
        if float(1.0 / (weight @ weight)) > ENOUGH[modes - 1]:
            break
        points, cell = _turned(posterior, points, weight)
    return value + before + cell, middle, variance


def _turned(posterior: _Posterior, points: Array, weight: Array) -> tuple[Array, float]:
    """(points, log of a cell) of a grid along the ways in which a posterior is wide, about what was found of it so far."""
    best = points[int(np.argmax(weight))]
    few = float(1.0 / (weight @ weight)) < 5.0
    if few:
        best = _moved(lambda p: min(-float(posterior(p[None])[0][0]), 1e300), best)[0]
    modes = len(best)
    centre, covariance = best, np.zeros((modes, modes))
    if few:
        covariance = _curved(posterior, best)
    else:
        centre = weight @ points
        covariance = (weight[:, None] * (points - centre)).T @ (points - centre)
    values, axes = np.linalg.eigh(covariance)
    wide = np.array([high - low for low, high in posterior.box])
    reach = np.minimum(WIDTHS * np.sqrt(np.maximum(values, 1e-12)), float(np.linalg.norm(wide)))
    steps = np.linspace(-1.0, 1.0, RATES)
    grid = np.stack([a.ravel() for a in np.meshgrid(*[steps] * modes, indexing="ij")], axis=1)
    return centre + (grid * reach) @ axes.T, float(np.sum(np.log(reach * (steps[1] - steps[0]))))


def _curved(posterior: _Posterior, best: Array) -> Array:
    """Covariance of a normal distribution that bends at the best point as the posterior does."""
    modes, step = len(best), 1e-3
    shifts = [np.zeros(modes), *(sign * step * unit for unit in np.eye(modes) for sign in (1.0, -1.0))]
    if modes == 2:
        shifts += [step * np.array([p, q]) for p in (1.0, -1.0) for q in (1.0, -1.0)]
    value = posterior(best + np.array(shifts))[0]
    if not np.isfinite(value).all():  # at an edge
        return 0.05**2 * np.eye(modes)
    bend = np.zeros((modes, modes))
    for k in range(modes):
        bend[k, k] = -(value[1 + 2 * k] - 2.0 * value[0] + value[2 + 2 * k]) / step**2
    if modes == 2:
        bend[0, 1] = bend[1, 0] = -(value[5] - value[6] - value[7] + value[8]) / (4.0 * step**2)
    values, axes = np.linalg.eigh(bend)
    curved: Array = (axes / np.maximum(values, 0.25)) @ axes.T
    return curved
