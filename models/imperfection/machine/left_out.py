"""How wide intervals must be: each past run of a machine foretold by the others."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...core.tails import t_quantile
from ..blocks import Part
from ..posterior import settle
from ..prior import Imperfection
from ..shapes import FIRST_TIME, Asked, of_room
from .past import Past, PastRun, learn_past

#: When a run left out is read, in time constants, and from which on a run is complete: it tells what slower masses do.
TURNS = (0.25, 0.5, 1.0, 2.0, 3.0)
COMPLETE = 3.5
#: Runs from which on they are held against each other; runs that "as wide as the prior says" counts for.
FEWEST, PRIOR_RUNS = 3, 6.0
LEAST, MOST = 0.5, 4.0
#: Readings whose mean is the end of a run, at most a twentieth of them.
LAST = 20


def widths_left_out(past: Past, runs: Sequence[PastRun], prior: Imperfection) -> Past:
    """The same with factors on half-widths that predictions of each run from all the others ask for, where there are three.

    Of fewer runs the factor is that of nothing known of the errors: Student's t for the runs that the prior counts for.
    """
    squares: list[list[float]] = [[] for _ in TURNS]
    for k, run in enumerate(runs if len(runs) >= FEWEST else ()):
        others = learn_past([r for i, r in enumerate(runs) if i != k], prior, past)
        for t, z in enumerate(_errors(run, others, prior)):
            if np.isfinite(z):
                squares[t].append(z)
    factors = []
    for turn, found in zip(TURNS, squares, strict=True):
        n = len(found)
        size = np.sqrt((PRIOR_RUNS + sum(found)) / (PRIOR_RUNS + n))
        factors.append((turn, float(np.clip(float(t_quantile(PRIOR_RUNS + n)) * size / 1.96, LEAST, MOST))))
    return replace(past, factors=tuple(factors))


def _errors(run: PastRun, past: Past, prior: Imperfection) -> list[float]:
    """Mean squares over the sensors of the error of a run's end, in deviations, read up to each turn; nan where untold."""
    mine = [i for i, c in enumerate(run.channels) if c in past.shapes and c not in run.rises]
    if not mine:
        return [np.nan] * len(TURNS)
    names = [run.channels[i] for i in mine]
    tau = float(np.exp(-np.median([past.shapes[c].log_rate for c in names])))
    parts = [run.parts[i] for i in mine]
    span = min(float(p.time[-1] - p.time[0]) for p in parts)
    if span < COMPLETE * tau:
        return [np.nan] * len(TURNS)
    counts = [min(LAST, max(1, len(p.time) // 20)) for p in parts]
    ends = np.array([float(p.reading[0, -n:].mean()) for p, n in zip(parts, counts, strict=True)])
    when = float(np.mean([p.time[-n:].mean() for p, n in zip(parts, counts, strict=True)]))
    rates = [float(np.exp(past.shapes[c].log_rate)) for c in names]
    found = []
    for turn in TURNS:
        cut = [_until(p, turn * tau) for p in parts]
        if min(len(p.time) for p in cut) < 8:
            found.append(np.nan)
            continue
        known = [replace(p, known=past.known([c])) for p, c in zip(cut, names, strict=True)]
        told = settle(known, tau, past.prior(prior), [when])
        at, limit = told.at[:, 0], told.steady
        # What the logged room did later is no error: the limit that is promised is that of the room at the last reading.
        later = [_by_room(p, when, r) - _by_room(c, when, r) for p, c, r in zip(parts, cut, rates, strict=True)]
        off = at[:, 1] + np.array(later) - ends
        # The limit's own half-width, in which what room and load may do later has no part; unlogged, the room's part stays.
        logged = np.array([p.room is not None for p in parts])
        of = np.where(logged[:, None], limit, at)
        half = np.where(off > 0.0, of[:, 1] - of[:, 0], of[:, 2] - of[:, 1])
        found.append(float(np.mean((1.96 * off / half) ** 2)))
    return found


def _by_room(part: Part, when: float, rate: float) -> float:
    """What the room of a part, as far as it is logged and as it is then, does [K] at a time to a sensor of that rate [1/min]."""
    if part.room is None:
        return 0.0
    since = part.time - part.time[0]
    asked = Asked(np.array([when - float(part.time[0])]))
    return float(of_room(np.array([rate]), np.zeros(0), since, part.room, asked)[0, FIRST_TIME])


def _until(part: Part, minutes: float) -> Part:
    n = int(np.searchsorted(part.time - part.time[0], minutes, "right"))
    room = None if part.room is None else part.room[:n]
    return replace(part, time=part.time[:n], reading=np.ascontiguousarray(part.reading[:, :n]), room=room)
