"""Where sensors will settle when their machine is not the law: law, discrepancy and noise, averaged over all that is unknown."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.tails import f_tail, normal_tail
from .blocks import Part
from .draw import Drawn, conditional, normal_draws
from .evidence import SLOWER, Rates, Run
from .numerics import LEVELS, SIGMAS, cells, negligible, quantiles, reach, settled_after, settled_behind, stretch
from .prior import COMPONENTS, SLOW, Imperfection
from .shapes import FIRST_TIME, LIMIT, SETTLING, SLOW_AHEAD, constant
from .usual import deviations

Array = NDArray[np.float64]

#: Degrees of freedom of a variance that is known.
ENDLESS = 10**9
#: A posterior this near to the slowest rate looked at knows no bound on that side.
EDGE = 0.5
#: Readings left this unlikely widen the intervals.
DOUBTED = 0.05
#: A hypothesis below this share of the posterior is left out of the predictions.
LEAST_WEIGHT = 5e-5
#: A spread of the log rate over the prior's above this is mostly the prior's own.
RATE_UNKNOWN = 0.5
#: A side that a flat prior of such a rate would move by this share of the half-width is a number out of the prior that it has.
OUT_OF_PRIOR = 0.25


@dataclass(frozen=True)
class Settled:
    """What S sensors will do; three numbers are the 2.5 %, 50 % and 97.5 % quantiles.

    steady (S, 3) [degC]: the limit with room and load as at the last reading; t95 (S, 3) [min] after the first reading; at (S, k,
    3) [degC] at the times asked for; rate (S, 3) [1/min]; open_limit, open_t95 (S,): the readings say so little of the rate that
    the far side of the limit, of t95, would be a number out of the prior of it; check_p (S,): probability of readings that leave
    law and discrepancy this far; strong (S,): that a strong effect is at work, one that is more than fast modes or a start, which
    die out; unseen (S,) [K]: what a slow second mass may add after the last reading, where there is one (95 %); unseen_from (S,)
    [min]: its least time constant; hides (S,): probability that slow modes add more than the half-width of the interval; agrees
    (S, S): whose rates were shared; evidence (S,): log likelihood of a sensor's own readings under the prior, up to a constant
    that every prior of the same readings and tau has.
    """

    steady: Array
    t95: Array
    at: Array
    rate: Array
    open_limit: NDArray[np.bool_]
    open_t95: NDArray[np.bool_]
    check_p: Array
    strong: Array
    unseen: Array
    unseen_from: Array
    hides: Array
    agrees: NDArray[np.bool_]
    evidence: Array
    drawn: Drawn | None = None


def settle(
    parts: Sequence[Part],
    tau: float,
    prior: Imperfection,
    at: Sequence[float] | Array = (),
    rates: Rates = "auto",
    draws: int = 0,
) -> Settled:
    """The posterior of S sensors of one run, their parts one after the other.

    tau [min] is the pilot's time constant, a guess that sets the scale of the prior; at [min] are times on the parts' own clock.
    draws: so many curves over `at` are drawn beside.
    """
    run = Run(parts, tau, prior, np.asarray(at, dtype=float), rates)
    log_rate, weight, agrees = run.posterior()
    return _predicted(run, log_rate, weight, agrees, run.taken_evidence(log_rate), draws)


def _settling(weight: Array, mode: Array, foretold: tuple[Array, ...], law: tuple[Array | float, Array | float]) -> Array:
    """Quantiles (3,) [min] of when 95 % are done; mode (n,): how fast a slow part at work is against the law, 0 without one."""
    slow = mode > 0.0
    turns, pace = (np.broadcast_to(a, mode.shape) for a in law)
    late, spread = settled_after(*(a[~slow] for a in (*foretold, turns, pace)))
    if slow.any():
        shares, times, own = settled_behind(*(a[slow] for a in (*foretold, turns, pace, mode)))
        weight = np.concatenate([weight[~slow], (weight[slow] * shares).ravel()])
        late, spread = np.concatenate([late, times.ravel()]), np.concatenate([spread, own.ravel()])
    found: Array = np.maximum(quantiles(weight, late, spread), 0.0)
    return found


def _predicted(run: Run, log_rate: Array, weight: Array, agrees: NDArray[np.bool_], evidence: Array, draws: int) -> Settled:
    asked = run.asked[0].count
    active = weight > LEAST_WEIGHT
    for mine, w in zip(active, weight, strict=True):
        mine &= w > negligible(w[mine])
    rise, foretold = run.evaluate(log_rate, active, asked)
    count = run.count
    steady, t95, rate = (np.full((count, 3), np.nan) for _ in range(3))
    at = np.full((count, run.times, 3), np.nan)
    check, strong, unseen, hides = (np.full(count, np.nan) for _ in range(4))
    open_limit, open_t95 = (np.zeros(count, dtype=bool) for _ in range(2))
    modes = [COMPONENTS.index("slow"), *range(len(COMPONENTS), run.relative.shape[1])]
    slow = np.concatenate([[False], (run.relative[1:, modes] >= 0.03).any(axis=1)])[run.kind]
    brief = np.array([COMPONENTS.index(name) for name in ("fast", "start")])
    others = np.delete(run.relative + run.absolute, brief, axis=1)
    lasting = np.concatenate([[False], others[1:].any(axis=1)])[run.kind]
    modes_of = np.array([0.0] + [SLOW[q] if q >= 0 else 0.0 for _, q in run.prior.effects()])[run.kind]
    drawn = Drawn.none(count, draws, run.times) if draws else None
    cell_of = cells(log_rate)
    usual = deviations(run, log_rate, weight)
    for i in range(count):
        places, hypotheses = np.nonzero(active[i])
        if not len(places):
            continue
        w = weight[i, places, hypotheses]
        mu, sd = foretold[i].mean, np.sqrt(foretold[i].variance)
        steady[i] = quantiles(w, mu[:, LIMIT], sd[:, LIMIT])
        b, r = np.exp(log_rate[i, places]), rise[i, places]
        ahead = modes_of[hypotheses], (b, r, mu[:, SETTLING], sd[:, SETTLING]), run.settles(i, log_rate[i, places])
        t95[i] = _settling(w, *ahead)
        for k in range(run.times):
            at[i, k] = quantiles(w, mu[:, FIRST_TIME + k], sd[:, FIRST_TIME + k])
        of_rate, cell = weight[i].sum(axis=1), cell_of[i]
        unknown = _rate_unknown(run, i, log_rate[i], weight[i], cell)
        if np.isinf(unknown):
            open_limit[i] = open_t95[i] = True
        elif unknown > RATE_UNKNOWN:
            flat = w * np.exp(-run.log_rate_prior(log_rate[i, places] - run.centre[i], i))
            limit, done = quantiles(flat, mu[:, LIMIT], sd[:, LIMIT]), _settling(flat, *ahead)
            far = 2 if r @ w >= 0.0 else 0
            open_limit[i] = not _bounded(limit[far] - steady[i, far], steady[i, far] - steady[i, 1])
            open_t95[i] = not _bounded(done[2] - t95[i, 2], t95[i, 2] - t95[i, 1])
        rate[i] = np.exp(quantiles(of_rate, log_rate[i], 0.5 * cell))
        strong[i] = weight[i][:, lasting].sum()
        m = len(run.blocks_of(i).time)
        left = foretold[i].squares
        if m > 2:  # else no reading is left over to contradict
            check[i] = w @ np.nan_to_num(f_tail(m - 2, ENDLESS, left / (m - 2))) / w.sum()
        # Readings beyond what the prior holds: as elsewhere in statistics, the spread makes room for what is left.
        beyond = float(np.sqrt(max(w @ left / w.sum() / (m - 2), 1.0))) if check[i] < DOUBTED else 1.0
        learnt = run.prior.factor_at(run.blocks_of(i).last * rate[i, 1])
        stretch(steady[i], t95[i], at[i], beyond * learnt)
        if drawn is not None:
            drawn.factor[i] = beyond * learnt
            _draw(run, drawn, i, log_rate, rise[i], (places, hypotheses, w))
        if usual is not None:  # a part that is still cold takes heat and gives none: what ends later ends farther on
            side = float(np.sign(r @ w))
            before = abs(steady[i, 1 + int(side)] - steady[i, 1])
            reach(steady[i], side, learnt * usual[0][i, LIMIT])
            reach(t95[i], 1.0, learnt * usual[1][i])
            for k in range(run.times):
                reach(at[i, k], side, learnt * usual[0][i, FIRST_TIME + k])
            if drawn is not None:
                drawn.factor[i, 1] *= abs(steady[i, 1 + int(side)] - steady[i, 1]) / max(before, 1e-9)
        # Of an interval that complete runs made narrower the posterior knows nothing, nor that slow modes did so.
        half = 0.5 * (steady[i, 2] - steady[i, 0]) / learnt
        with np.errstate(all="ignore"):  # beside what the estimate counts of them
            beside = mu[:, SLOW_AHEAD] - w @ mu[:, SLOW_AHEAD] / w.sum()
            near, far = ((side * half - beside) / sd[:, SLOW_AHEAD] for side in (-1.0, 1.0))
        hides[i] = w @ (np.nan_to_num(normal_tail(far)) + np.nan_to_num(normal_tail(-near)))
        those = slow[hypotheses]
        if those.any():
            ww = w[those]
            unseen[i] = SIGMAS * np.sqrt(ww @ (mu[those, SLOW_AHEAD] ** 2 + sd[those, SLOW_AHEAD] ** 2) / ww.sum())
    return Settled(
        steady=steady,
        t95=t95,
        at=at,
        rate=rate,
        open_limit=open_limit,
        open_t95=open_t95,
        check_p=check,
        strong=strong,
        unseen=unseen,
        unseen_from=1.0 / (max(SLOW) * rate[:, 1]),
        hides=hides,
        agrees=agrees,
        evidence=evidence,
        drawn=drawn,
    )


def _rate_unknown(run: Run, sensor: int, log_rate: Array, weight: Array, cell: Array) -> float:
    """Spread of the log rate of one sensor over its prior's; log_rate, cell (F,), weight (F, H)."""
    if run.known is not None and not run.guessed:
        return 0.0  # where its prior is knowledge there is nothing to be shrunk
    if run.known is None and weight.sum(axis=1) @ (log_rate < run.nodes[0] + EDGE) > LEVELS[0]:
        return np.inf  # slower rates than were looked at would do as well
    # Within hypotheses: that a fast and a slow rate are both known, and only not which is the law's, leaves no limit open.
    middle = (log_rate @ weight) / np.maximum(weight.sum(axis=0), 1e-300)
    within = ((log_rate[:, None] - middle) ** 2 + cell[:, None] ** 2 / 12.0) * weight
    assumed = 0.5 * (1.0 + SLOWER) * run.prior.log_rate_spread if run.known is None else run.known[sensor, 1]
    return float(np.sqrt(within.sum()) / assumed)


def _bounded(moved: float, half: float) -> bool:
    """Whether a side `half` off the middle is one of the readings: it has hardly `moved` under a flat prior of the rate."""
    return abs(moved) <= OUT_OF_PRIOR * abs(half)


def _draw(
    run: Run,
    into: Drawn,
    sensor: int,
    log_rate: Array,
    rise: Array,
    kept: tuple[NDArray[np.intp], NDArray[np.intp], Array],
) -> None:
    """Curves of one sensor: rates and hypotheses `kept` (places, hypotheses, weights) by weight, and what they leave open."""
    rng = np.random.default_rng(0)
    part, row = run.part_of(sensor)
    blocks, asked = run.blocks[part], run.asked[part]
    m = len(blocks.time)
    of_law, node, share, known = run.rows_of(part, log_rate[run.rows[part] : run.rows[part + 1]])
    slow = run.slow_of(part, log_rate[run.rows[part] : run.rows[part + 1]])
    known = np.broadcast_to(known, (*of_law.shape[:2], known.shape[-1]))[row]
    wanted = np.concatenate([[m + LIMIT], m + FIRST_TIME + np.arange(run.times)])
    places, hypotheses, weight = kept
    counts = rng.multinomial(into.limit.shape[1], weight / weight.sum())
    ones, at = constant(blocks.time, asked), 0
    drawn = np.flatnonzero(counts)
    nodes = np.unique(node[row, places[drawn]] + np.array([[0], [1]]))
    at_nodes = run.whole_covariances(part, nodes)
    for k in drawn:
        f, h = places[k], hypotheses[k]
        g, s = int(np.searchsorted(nodes, node[row, f])), share[row, f]
        parts = (1.0 - s) * at_nodes[g] + s * at_nodes[g + 1]
        kinds = [0, int(run.kind[h])] if run.kind[h] else [0]
        sizes = [run.under[h], run.scale[h]] if run.kind[h] else [run.scale[h]]
        amounts = [z * (rise[f] ** 2 * run.relative[n] + run.absolute[n]) for z, n in zip(sizes, kinds, strict=True)]
        whole = np.tensordot(np.sum(amounts, axis=0), parts, axes=1)
        for size, wrong in zip((1.0, sizes[0]), run.wrong[part], strict=True):
            whole = whole + size * rise[f] ** 2 * wrong[row] if len(wrong) else whole
        rises = of_law[row, f] + run.leans[h] @ slow[row, f]
        given = blocks.mean[row] - known[f, :m], blocks.noise[row], ones, rises, whole, wanted
        some = normal_draws(*conditional(*given), int(counts[k]), rng) + known[f, wanted]
        into.limit[sensor, at : at + len(some)], into.curve[sensor, at : at + len(some)] = some[:, 0], some[:, 1:]
        into.rate[sensor, at : at + len(some)] = np.exp(log_rate[sensor, f])
        at += len(some)
