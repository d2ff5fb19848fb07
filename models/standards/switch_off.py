"""The temperature at switch-off, of a cooling record whose first reading comes late.

    T(t) = end + A exp(-a t) [+ B exp(-c t)],  a < c

One mode or two, each as likely beforehand; log rates evenly distributed, the amplitude of the fast mode at switch-off normal
about nothing with a quarter of the record's own fall, end and A free. Given the rates all else is linear and normal, so the
temperature at an earlier time is a mixture of normal distributions over the rates, whose quantiles are its interval: what the
record leaves open of the modes is in it. A mode that is over before the first reading leaves no trace: none of less than a
third of the delay is thought of.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.tails import t_quantile
from ..imperfection.numerics import quantiles

Array = NDArray[np.float64]

#: Readings from which on a cooling curve is looked at.
FEWEST = 8
#: Rates on a grid, and how often it closes in on the posterior.
RATES, CLOSER = 40, 4
#: Slowest rate over the record's length; how far below the best a log posterior still counts; ratio of the rates at least.
SLOWEST, DEPTH, APART = 0.05, 14.0, 1.5
#: Shortest time constant, over the delay and over the time between readings: one noisy reading is no mode.
SHORTEST, LEAST_STEPS = 0.33, 2.0
#: Share of the record's fall that the fast mode may have (a deviation).
FAST_SHARE = 0.25


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
    noise = _least_noise(t, y, slow, fast)
    boxes = [(slow, fast), (slow, fast)], [(slow, fast)]
    mixtures = [_closed_in(t, y, at - float(time[0]), noise, size, list(box)) for box in boxes]
    value, middle, variance = (np.concatenate([m[k] for m in mixtures]) for k in range(3))
    weight = np.exp(value - value.max())
    weight /= weight.sum()
    two = float(weight[: len(mixtures[0][0])].sum())
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


def _least_noise(t: Array, y: Array, slow: float, fast: float) -> float:
    """Deviation [K] of a reading from the best two modes on a grid."""
    rates = np.exp(np.linspace(slow, fast, RATES))
    gram, moment, whole = _sums(t, y, rates)
    best = whole
    for i in range(RATES):
        for j in range(i + 1, RATES):
            if rates[j] < APART * rates[i]:
                continue
            three = [0, i + 1, j + 1]
            solved = np.linalg.lstsq(gram[np.ix_(three, three)], moment[three], rcond=1e-13)[0]
            best = min(best, whole - float(moment[three] @ solved))
    return max(float(np.sqrt(max(best, 0.0) / (len(t) - 5))), 1e-9)


def _sums(t: Array, y: Array, rates: Array) -> tuple[Array, Array, float]:
    """Products of the columns (1, exp(-rate t), ...), with each other and with the readings, and the readings' own square."""
    columns = np.vstack([np.ones(len(t)), np.exp(-np.outer(rates, t))])
    return columns @ columns.T, columns @ y, float(y @ y)


def _closed_in(
    t: Array, y: Array, at: float, noise: float, size: float, box: list[tuple[float, float]]
) -> tuple[Array, Array, Array]:
    """Log weights, means and variances (m,) of the temperature at `at` over a grid of log rates that closes in on its posterior.

    box holds one range of log rates for each mode, the fast one first.
    """
    two = len(box) == 2
    # What the ranges are given beforehand stays what it was as the grid closes in: weights are densities times cells.
    before = -sum(np.log(high - low) for low, high in box) + np.log(0.5)
    found = np.zeros(0), np.zeros(0), np.zeros(0)
    for _ in range(CLOSER):
        axes = [np.linspace(low, high, RATES) for low, high in box]
        cell = float(sum(np.log(max(axis[1] - axis[0], 1e-12)) for axis in axes))
        rates = np.exp(np.concatenate(axes))
        gram, moment, whole = _sums(t, y, rates)
        earlier = np.concatenate([[1.0], np.exp(-rates * at)])
        if two:
            pairs = [(i, RATES + j) for i in range(RATES) for j in range(RATES) if rates[i] >= APART * rates[RATES + j]]
            own = np.array([[0, j + 1, i + 1] for i, j in pairs], dtype=np.intp).reshape(-1, 3)
        else:
            own = np.array([[0, i + 1] for i in range(RATES)], dtype=np.intp)
        if not len(own):
            return np.array([-np.inf]), np.zeros(1), np.ones(1)
        precision = gram[own[:, :, None], own[:, None, :]] / noise**2
        if two:
            precision[:, 2, 2] += earlier[own[:, 2]] ** 2 / size**2
        precision[:, 1, 1] += 1e-6 / size**2
        right = moment[own] / noise**2
        solved = np.linalg.solve(precision, right[..., None])[..., 0]
        value = 0.5 * (np.einsum("mi,mi->m", right, solved) - whole / noise**2) - 0.5 * np.linalg.slogdet(precision)[1]
        value += before + cell + (np.log(earlier[own[:, 2]] / size) if two else 0.0)
        target = earlier[own]
        spread = np.einsum("mi,mi->m", target, np.linalg.solve(precision, target[..., None])[..., 0])
        found = value, np.einsum("mi,mi->m", target, solved), np.maximum(spread, 0.0)
        near = value > value.max() - DEPTH
        places = own[near][:, 1:] - 1
        closer = []
        for mode, axis in enumerate(axes):
            used = places[:, 1 - mode] - mode * RATES if two else places[:, 0]
            first, last = max(int(used.min()) - 1, 0), min(int(used.max()) + 1, RATES - 1)
            closer.append((float(axis[first]), float(axis[last])))
        if all(b[1] - b[0] > 0.7 * (a[1] - a[0]) for a, b in zip(box, closer, strict=True)):
            break
        box = closer
    return found
