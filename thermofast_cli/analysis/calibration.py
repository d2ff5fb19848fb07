"""How imperfect the machines of a lab are, learnt from complete runs of them: which prior, and how wide its intervals must be.

Each past run is read at several times, as if it went on only that far, and what was foretold of its end is held against the end.
The prior among a few that scores best stands; its intervals are multiplied by a factor that the errors ask for, drawn towards one
where runs are few. Runs, not sensors, are what is counted: the sensors of a run share its disturbances.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import t_quantile
from thermofast.models.imperfection import COMPLETE, PRIOR_RUNS, TYPICAL, Imperfection

from ..errors import rounded
from ..estimation.identify import identify_sensors
from ..estimation.measured import moved_by_room
from ..estimation.request import Method, Question
from ..estimation.sensor import Signals
from ..learning.foretold import OUTSIDE
from ..records import CalibrateRecord, IdentifyRecord
from ..workers.engine import Started

Array = NDArray[np.float64]

#: When a past run is read, in time constants.
TURNS = (0.4, 0.6, 0.8, 1.0, 1.4, 2.0, 3.0)
#: Time constants between a reading and the end of its run from which the end tells the limit.
APART = 1.5
#: Readings whose mean is the end of a run.
LAST = 20
#: Runs that "as wide as at the other times" counts for at each of them.
OTHER_TIMES = 12.0
LEAST, MOST = 0.25, 4.0
#: Share of its sensors that stand still at the end of a run, below which the run is told as one that goes on.
SETTLED = 0.5
#: Runs from which on another prior than the typical one may be chosen: two alike may be chance.
ENOUGH = 4

#: Share of the ends that typical intervals must hold from so many time constants on, for strong effects to be taken for rare: of
#: machines with a slow mass each the end lies beyond them, and what past runs show as a drift would be taken for the room's.
HELD, FROM_TURN = 0.85, 0.8
#: Deviation of the log scale between machines of a lab that are alike: what one record says of its own disturbances moves the width
#: more than it foretells the error (chosen on eight labs of ten runs of each simulator, each held against the other seven; what
#: it brings on fresh machines: python -m benchmarks.intervals.imperfect --calibrated).
ALIKE = 0.15

_alike = replace(TYPICAL, scale_spread=ALIKE, clean=0.0)
#: Priors to choose among: machines that nobody knows, machines that are alike, machines that are the law.
CANDIDATES = (
    TYPICAL,
    replace(TYPICAL, strong_share=0.05),
    replace(TYPICAL, strong_share=0.005),
    _alike,
    replace(_alike, strong_share=0.05),
    replace(_alike, strong_share=0.005),
    replace(_alike, strong_share=0.005, multiplier=1.6),
    replace(TYPICAL, strong_share=0.002, clean=0.9, multiplier=0.3),
)


@dataclass(frozen=True)
class Past:
    """One complete run: what was foretold of its end (turns, S, 3) under each prior (candidates, ...), and the end (S,) [degC].

    settled is the share of its sensors that stand still there.
    """

    name: str
    foretold: Array
    end: Array
    settled: float = 1.0


@dataclass(frozen=True)
class Lab:
    """What was learnt, of which runs: the prior, and a row for each turn."""

    prior: Imperfection
    records: tuple[CalibrateRecord, ...]
    names: tuple[str, ...]


def to_choose(runs: int) -> tuple[Imperfection, ...]:
    """The priors that so many runs may choose among."""
    return CANDIDATES if runs >= ENOUGH else CANDIDATES[:1]


def past_run(started: Started, method: Method, priors: Sequence[Imperfection] = CANDIDATES) -> Past | str:
    """A run as it was foretold at each turn under each prior, or why it cannot be used."""
    run, start = started
    signals = Signals.of(run, start)
    minutes, channels, values = signals.time_min, signals.channels, signals.values
    # The bare law's rate is wrong on just those runs that have most to teach.
    whole = identify_sensors(replace(signals, room=None), method).records
    rates = [r.rate_per_min for r in whole if r.rate_per_min is not None and r.status in ("ok", "model_doubtful")]
    if not rates:
        return "no sensor of it shows where it settles"
    tau = 1.0 / float(np.median(rates))
    length = float(minutes[-1]) - start
    if length < COMPLETE * tau:
        return f"it ends after {rounded(length / tau)} time constants; a complete run has {COMPLETE:g}"
    count = min(LAST, max(3, len(minutes) // 20))
    last = values[:, -count:]
    end = np.array([row[np.isfinite(row)].mean() if np.isfinite(row).any() else np.nan for row in last])
    at = float(minutes[-count:].mean()) - start
    foretold = np.full((len(priors), len(TURNS), len(channels), 3), np.nan)
    for c, prior in enumerate(priors):
        of_prior = replace(method, imperfection=prior)
        for t, turn in enumerate(TURNS):
            until = start + turn * tau
            found = identify_sensors(signals, of_prior, Question(until, at))
            told = [r if r.status != "not_determined" else None for r in found.records]
            ahead = start + at - until
            if run.room is not None and ahead >= APART * tau:
                foretold[c, t] = _limits(told, minutes, run.room, until, ahead)
                continue
            for s, r in enumerate(told):
                if r is not None and r.at_lo_c is not None and r.at_c is not None and r.at_hi_c is not None:
                    foretold[c, t, s] = r.at_lo_c, r.at_c, r.at_hi_c
    good = np.isfinite(end) & np.isfinite(foretold).all(axis=3).any(axis=(0, 1))
    if not good.any():
        return "nothing was foretold of it at any time"
    settled = float(np.mean([r.steady_state_measured_c is not None for r in whole]))
    return Past(run.name, foretold[:, :, good], end[good], settled)


def _limits(told: Sequence[IdentifyRecord | None], minutes: Array, room: Array, until: float, ahead: float) -> Array:
    """Intervals of the limit (S, 3) [degC], as of the end `ahead` [min] after `until`: what the logged room did since is added.

    Where the room is logged the interval of the limit does not count what the room may do later, and that of a temperature does:
    the end of a run says whether the limit's held.
    """
    found = np.full((len(told), 3), np.nan)
    for s, r in enumerate(told):
        if r is None or r.steady_state_c is None or r.initial_c is None or r.rate_per_min is None:
            continue
        moved = moved_by_room(minutes, room, np.array([r.rate_per_min]), until, np.array([until + ahead]))[0, 0]
        left = (r.steady_state_c - r.initial_c) * np.exp(-r.rate_per_min * (until + ahead - (r.start_min or 0.0)))
        for k, side in enumerate((r.steady_state_lo_c, r.steady_state_c, r.steady_state_hi_c)):
            found[s, k] = np.nan if side is None else side + moved - left
    return found


def learn(past: Sequence[Past]) -> Lab:
    """The prior and its factors from complete runs.

    Every figure of the rows is of runs that the factors were not learnt from: each is left out in turn.
    """
    before = _scores(past, 0, np.ones((len(past), len(TURNS))))
    level = _mean(before)
    best, chosen, held = np.inf, 0, _held(past)
    rare = {c: _held(past, c) for c, one in enumerate(to_choose(len(past))) if one.strong_share < TYPICAL.strong_share}
    # What takes strong effects for rare must hold the ends by itself, not by what it is widened to.
    quiet = {c for c, share in rare.items() if min(held, share) >= HELD}
    for c in range(len(to_choose(len(past)))):
        if c in rare and c not in quiet:
            continue
        scores = _scores(past, c, _left_out_factors(past, c))
        score = float(_mean(_mean(scores) / level))
        if score < best:
            best, chosen = score, c
    factors = _factors(past, chosen, np.arange(len(past)))
    prior = replace(CANDIDATES[chosen], factors=tuple(zip(TURNS, factors.tolist(), strict=True)))
    notes = []
    if rare and not quiet:
        most = max(min(held, share) for share in rare.values())
        common = f"intervals for quiet machines hold {100.0 * most:.0f} % of the ends: strong effects are common in these machines"
        notes.append(f"{common}; learn each by itself (thermofast improve --together)")
    moving = sum(p.settled < SETTLED for p in past)
    if moving:
        of = f"in {moving} of {len(past)} runs most points still move at the end"
        notes.append(f"{of}: what comes after it was not tried, and a slower part would go unseen; give longer runs")
    rows = tuple(replace(r, message="; ".join([*_wider(r), *notes])) for r in _rows(past, chosen, factors))
    return Lab(prior, rows, tuple(p.name for p in past))


def _wider(row: CalibrateRecord) -> list[str]:
    """What to say where the errors ask for wider intervals than are given."""
    return [f"the errors ask for more than {MOST:g} times the width"] if row.factor is not None and row.factor >= MOST else []


def _held(past: Sequence[Past], candidate: int = 0) -> float:
    """Share of the ends that intervals of a prior hold, by itself, from FROM_TURN on; each run counts once."""
    of_runs = []
    for one in past:
        parts = [_parts(one, candidate, t) for t, turn in enumerate(TURNS) if turn >= FROM_TURN]
        inside = [np.mean((low <= 0.0) & (high >= 0.0)) for low, _, high in parts if len(low)]
        of_runs += [float(np.mean(inside))] if inside else []
    return float(np.mean(of_runs)) if of_runs else 1.0


def _mean(values: Array) -> Array:
    """Over the first axis, of what is known; nan of nothing."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    found: Array = np.where(count > 0, np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)
    return found


def _parts(one: Past, candidate: int, turn: int) -> tuple[Array, Array, Array]:
    """(low, middle, high) less the end (S,) of the sensors foretold at a turn."""
    three = one.foretold[candidate, turn] - one.end[:, None]
    three = three[np.isfinite(three).all(axis=1)]
    return three[:, 0], three[:, 1], three[:, 2]


def _factors(past: Sequence[Past], candidate: int, of: NDArray[np.intp]) -> Array:
    """By what the half-widths of each turn (turns,) must be multiplied, from these runs: drawn to one factor, and that to one."""
    squares = np.full((len(of), len(TURNS)), np.nan)
    for i, k in enumerate(of.tolist()):
        for t in range(len(TURNS)):
            low, middle, high = _parts(past[k], candidate, t)
            if len(middle):
                half = np.where(middle > 0.0, middle - low, high - middle)  # the side on which the end lies
                squares[i, t] = np.mean((1.96 * middle / half) ** 2)
    known = np.isfinite(squares)
    of_runs = np.array([row[good].mean() for row, good in zip(squares, known, strict=True) if good.any()])
    pooled = (PRIOR_RUNS + of_runs.sum()) / (PRIOR_RUNS + len(of_runs))
    size = np.sqrt((OTHER_TIMES * pooled + np.where(known, squares, 0.0).sum(axis=0)) / (OTHER_TIMES + known.sum(axis=0)))
    found: Array = np.clip(float(t_quantile(PRIOR_RUNS + len(of_runs))) * size / 1.96, LEAST, MOST)
    return found


def _left_out_factors(past: Sequence[Past], candidate: int) -> Array:
    """Factors (runs, turns) for each run from all the others."""
    every = np.arange(len(past))
    return np.array([_factors(past, candidate, np.delete(every, k)) for k in every])


def _scores(past: Sequence[Past], candidate: int, factors: Array) -> Array:
    """Mean interval score (runs, turns) [K] of each run's sensors."""
    found = np.full((len(past), len(TURNS)), np.nan)
    for k, one in enumerate(past):
        for t in range(len(TURNS)):
            low, middle, high = _parts(one, candidate, t)
            if len(middle):
                low, high = middle - factors[k, t] * (middle - low), middle + factors[k, t] * (high - middle)
                found[k, t] = np.mean(high - low + OUTSIDE * (np.maximum(low, 0.0) + np.maximum(-high, 0.0)))
    return found


def _rows(past: Sequence[Past], chosen: int, factors: Array) -> list[CalibrateRecord]:
    apart = _left_out_factors(past, chosen)
    ones = np.ones_like(apart)
    before, after = _scores(past, 0, ones), _scores(past, chosen, apart)
    rows = []
    for t, turn in enumerate(TURNS):
        held: tuple[list[bool], list[bool]] = ([], [])
        widths: tuple[list[float], list[float]] = ([], [])
        sensors, conformal = 0, []
        for k, one in enumerate(past):
            for which, (candidate, factor) in enumerate(((0, 1.0), (chosen, float(apart[k, t])))):
                low, middle, high = _parts(one, candidate, t)
                low, high = middle - factor * (middle - low), middle + factor * (high - middle)
                held[which].extend(((low <= 0.0) & (high >= 0.0)).tolist())
                widths[which].extend((high - low).tolist())
            low, middle, high = _parts(one, chosen, t)
            sensors += len(middle)
            if len(middle):
                conformal.append(float(np.max(np.abs(middle) / np.where(middle > 0.0, middle - low, high - middle))))
        if not sensors:
            continue
        rank = int(np.ceil(0.95 * (len(conformal) + 1)))
        rows.append(
            CalibrateRecord(
                run=f"{len(past)} runs",
                channel="all",
                time_constants=turn,
                runs=len(conformal),
                sensors=sensors,
                held_typical=float(np.mean(held[0])) if held[0] else None,
                width_typical_c=float(np.median(widths[0])) if widths[0] else None,
                held_lab=float(np.mean(held[1])),
                width_lab_c=float(np.median(widths[1])),
                score_ratio=float(np.nanmean(after[:, t]) / np.nanmean(before[:, t])) if np.isfinite(before[:, t]).any() else None,
                factor=float(factors[t]),
                conformal_factor=float(np.sort(conformal)[rank - 1]) if rank <= len(conformal) else None,
            )
        )
    return rows
