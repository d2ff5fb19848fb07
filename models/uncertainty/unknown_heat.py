"""Which logged columns the unknown heat of a run's sensors follows: to a power, late, by how much and how surely.

The heat itself, and its band: :mod:`.lump_heat`.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array
from ..core.tails import chi2_tail
from ..search.rules import rule
from .lump_heat import Lump, UnknownHeat, column_likelihoods, following_rate, smooth_heat

#: A rate at which the heat follows a column is known to such a factor before it is told, in logarithms.
NEARLY = 0.02
#: Lags of probes that are tried [min].
LAGS = (0.15, 0.3, 0.5, 0.75, 1.0, 1.5, 2.5)


@dataclass(frozen=True)
class HeatRules:
    """When heat is said to follow a column."""

    chance: float = rule(
        0.002,
        "1",
        "nominal chance, over everything tried, of a claim where nothing follows; the ratio's own law is wider than chi-square",
        "set by hand, with room; what it comes to: python -m benchmarks.analysis.unknown_heat",
    )
    lag: float = rule(
        9.2,
        "1",
        "least likelihood ratio of a probe that lags over one that does not, from which its lag is counted",
        "99 % of a chi-square law of one, and what trying a few of them gives",
    )
    sharp: float = rule(
        0.9,
        "1",
        "least correlation on blocks left out from which the rate is that at which heat follows the columns",
        "set by hand: right shapes reached 0.96 and more, a shape that lags as nothing offered does 0.68 to 0.85",
    )
    correlation: float = rule(
        0.5,
        "1",
        "least correlation of the heat with what the column tells of it on blocks left out",
        "set by hand: a column that tells a quarter of the variance where it was not fitted",
    )


RULES = HeatRules()


@dataclass(frozen=True)
class Follows:
    """Heat that follows a logged column: to a power, so many minutes late.

    powers are the least and the largest that do nearly as well; correlation is that of the heat with what the column tells on
    blocks left out, likelihood_ratio is twice the logarithm, mean over the sensors, p its chance over everything tried; rates (S,)
    [1/min] those at which it does best, open (S,) how far from their logarithms those of other powers and delays that do nearly as
    well are; shape (G,) the column as the heat follows it, at :func:`moments`.
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
    open: tuple[float, ...] = ()

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
    if int((np.abs(np.diff(column)) > JUMPS * float(np.ptp(column))).sum()) == 1:
        delays = delays[:1]  # one step alone follows one that came before it as well as chance has it
    rows, told, grid = [], [], moments(time)
    for way, power, delay in itertools.product(between_readings(column, time), powers, delays):
        shape = way(grid - delay) ** power
        reach = float(np.ptp(shape))
        if reach > 0.0:
            rows.append(shape / reach)
            told.append((power, delay))
    return np.array(rows).reshape(len(rows), len(grid)), told


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
        own, at = tuple(best_rates[:, begin + best].tolist()), best_rates[:, begin : begin + len(told)]
        if p < RULES.chance and all(len(may) > 1 for may in rates):
            likely = np.union1d(np.argsort(-ratio)[:LIKELY], [i for i, (_, delay) in enumerate(told) if delay == 0.0]).astype(int)
            place, among, own, at[:, likely] = _at_own_rates(lumps, rates, shapes[likely], grid, np.array(given))
            best, ratio = int(likely[place]), np.full(len(told), -np.inf)
            ratio[likely] = among - alone
        power, delay = told[best]
        as_well = np.flatnonzero(ratio >= ratio[best] - NEAR)
        near, share = [told[i][0] for i in as_well], np.exp(0.5 * (ratio[as_well] - ratio[best]))
        apart = np.sqrt((np.log(at[:, as_well] / np.array(own)[:, None]) ** 2) @ share / share.sum()).tolist()
        heats = [smooth_heat(lump, rate) for lump, rate in zip(lumps, own, strict=True)] if p < RULES.chance else []
        r = block_correlation(heats, np.array([*given, shapes[best]]), grid) if heats else 0.0
        found.append(Follows(name, power, (min(near), max(near)), delay, r, float(ratio[best]), p, own, shapes[best], tuple(apart)))
        begin += len(told)
    return sorted(found, key=lambda f: -f.likelihood_ratio)


def _at_own_rates(
    lumps: Sequence[Lump], rates: Sequence[Sequence[float]], shapes: Array, grid: Array, given: Array
) -> tuple[int, Array, tuple[float, ...], Array]:
    """The best of shapes (C, G), twice the log-likelihoods (C,), mean over the lumps, and each lump's rate, where heat follows one;
    and its rates at each shape (S, C), to the spacing that is looked at.

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
    return best, total, refined[best], nearest


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


def with_lag(lump: Lump, rates: Sequence[float], follows: Sequence[Follows], place: int, time: Array) -> Lump:
    """The lump with the lag of its probe that makes the readings likeliest; none where that gains little.

    At the best of `rates`, or where heat `follows` columns logged at `time`, as lump number `place`, at about the rate told there:
    a lag and a lump's time constant are alike but for a record's beginning, so of the two the sum is kept.
    """
    step = float(np.median(np.diff(lump.time)))
    lags = [0.0, *(lag for lag in LAGS if lag > 0.2 * step)]
    shapes = np.array([f.shape for f in follows]) if follows else np.empty((0, len(lump.time)))
    grid = moments(time) if follows else lump.time
    worth = []
    for lag in lags:
        late, may = replace(lump, lag=lag), rates
        if follows:
            slow = 1.0 / follows[-1].rates[place] - lag
            may = [following_rate(late, 1.0 / slow, NEARLY, shapes, grid)[0]] if slow > lag else []
        none = np.empty((0, len(grid)))
        worth.append(float(column_likelihoods(late, may, none, grid, shapes)[1].max()) if len(may) else -np.inf)
    best = int(np.argmax(worth))
    return replace(lump, lag=lags[best]) if 2.0 * (worth[best] - worth[0]) > RULES.lag else lump
