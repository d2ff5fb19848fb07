"""What complete runs of a machine say of its next one: the shape of its rise, how its rates scatter, how it is disturbed.

A run of sensor i is T0 + R [ g(x) + stretch x g'(x) + sum a_j psi_j(x) ] + disturbance + noise with x = rate t: g is the law,
psi are slow and fast modes and the bend of a loss exponent, and their amplitudes a are the machine's: the same in every run.
Level, start and stretch are the run's own; room and load disturb each run anew. All of it is Gaussian once rate and rise are known
well, which they are after a complete run; so the amplitudes have a mean and a covariance in closed form.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...arrow import covariance_root
from ...decay import LOG_TWENTY
from ..blocks import Part, block_means
from ..numerics import SIGMAS, padded
from ..prior import Imperfection, Sizes
from ..shapes import Asked, covariances, law, of_room
from .known import FAST_MODES, SLOW_MODES, Known, modes, within
from .rest import Rest, left_open

Array = NDArray[np.float64]

#: Prior deviations of all slow modes, all fast modes and the exponent: of machines that are all but the law, of machines as they
#: mostly are, and of those with a strong effect of their own; and how likely each is. Runs of one length tell slow modes from a
#: level only so far: were all machines taken for the last kind, no model of an exact one would ever be sure of its limit.
SHAPE_SIZES = ((0.003, 0.01, 0.01), (0.02, 0.03, 0.04), (0.1, 0.15, 0.1), (0.4, 0.15, 0.1))
SHAPE_WEIGHTS = np.array([0.25, 0.5, 0.2, 0.05])
#: Modes slower than this, against the law, are rare, and looked for where runs are so long, in their time constants, as to show
#: them; how many are not, which share the size.
SELDOM, SHOWS = 0.1, 1.2
SLOW_USUAL = sum(k >= SELDOM for k in SLOW_MODES)
#: Share of the typical structure (slow modes, loss exponent) that a shape learnt leaves open: the modes are few. Fast modes stay
#: as they are: each run starts from its own uneven temperatures.
LEFT_OPEN = 0.15
#: Share of each amplitude, and of all together, by which it is another one in a run of another load (a loss that is not linear).
SHAPE_AGAIN = 0.25
#: Deviation of the log rate from run to run, and between the sensors of a run, before runs were compared; counts as so many runs.
SCATTER, SPREAD, RUNS_ASSUMED = 0.06, 0.02, 4.0
#: Blocks of a complete run.
BLOCKS = 24
#: Sizes of the disturbances that are compared, against the typical.
SCALES = np.geomspace(0.08, 4.0, 12)
ROUNDS, ROUNDS_NEAR = 4, 2
#: The rate of a shape is that of the fits within so much of its logarithm: a point far from the heat has hardly one of its own.
FROM_FIT = 0.3
#: Times what the law has alone of a rise that it may have beside modes, or its reciprocal.
MOST_RISE = 3.0
#: What modes leave of the rise after the longest run, relative to it, beside what the law leaves: mean and deviation, which that
#: share of the law's own adds to (what is heated rises on and does not turn round); and at which points x, over that run's end.
REST, REST_SPREAD, OF_LAW, BEYOND_END = 0.01, 0.04, 0.7, (1.0, 1.5, 2.0, 3.0)
#: How many of the sizes are looked at where much the same runs have told which.
NEAR = 4
#: Deviation of the logarithm of the size from run to run, as one run lets it be known.
SCALE_AGAIN = 0.6
#: Log rates about the known one, or about a guess, at which a rise is worked out: what is logged does not stretch with the machine.
#: Points x = rate t at which a rise is drawn, and where all is over.
NODES, GUESSED_NODES = np.linspace(-0.6, 0.6, 41), np.linspace(-2.4, 2.4, 81)
GRID = np.concatenate([[0.0], np.geomspace(1e-3, 200.0, 600)])


def _deviations(sizes: tuple[float, float, float], end: float = np.inf) -> Array:
    """Prior deviation of each amplitude (k,), by runs that are read until x = end: slower modes are no part of what they show."""
    slow, fast, exponent = sizes
    shown = np.array([min(k * end / SHOWS, 1.0) ** 2 if k < SELDOM else 1.0 for k in SLOW_MODES])
    each = [*(slow / np.sqrt(SLOW_USUAL) * shown), *[fast / np.sqrt(len(FAST_MODES))] * len(FAST_MODES)]
    return np.array([*each, exponent])


def _open(background: Sizes) -> Sizes:
    """What a machine whose shape is known still does beside it."""
    b = background
    return replace(b, slow=LEFT_OPEN * b.slow, exponent=LEFT_OPEN * b.exponent)


#: Scales of strong effects beside what is known of a machine (benchmarks.intervals.past_runs, driven, half_explained).
BESIDE_KNOWN = (0.15, 0.6, 2.0)


@dataclass(frozen=True)
class SensorShape:
    """The rise of one sensor: log rate [log 1/min] and its deviation, amplitudes (k,) and their covariance (k, k).

    first_c, moved_c, noise_c: what the runs learnt from read at first [degC], how far they then went [K] and the noise of a reading
    [K], on average. rest: what the readings of these runs alone, length x =
    rate t long, left open of where they end.
    """

    log_rate: float
    deviation: float
    amplitudes: Array
    covariance: Array
    first_c: float = np.nan
    rest: Rest | None = None
    moved_c: float = np.nan
    noise_c: float = np.nan

    @property
    def in_another_run(self) -> Array:
        """Covariance (k, k) of the amplitudes of a run of another load: what was large may be otherwise by a share of itself."""
        again = SHAPE_AGAIN**2 * self.amplitudes
        found: Array = self.covariance + np.diag(again * self.amplitudes) + np.outer(again, self.amplitudes)
        return found

    @classmethod
    def unseen(cls, log_rate: float, deviation: float, prior: Imperfection) -> "SensorShape":
        """Of a sensor whose rate is known and whose shape is only as near to its law as that of machines in general."""
        b = prior.background
        variance = _deviations((b.slow, b.fast, b.exponent)) ** 2
        return cls(log_rate, deviation, np.zeros(len(variance)), np.diag(variance))


@dataclass(frozen=True)
class Rise:
    """The rise of one sensor that a model with effects or a logged drive gives it in one run, in place of the law.

    curve, held, whole (L, n) over GRID, of rates whose logarithms are `nodes` (L,) off `log_rate`; doubt, others (J, n), beside
    (k,) [K] at beside_time (k,) [min] and beside_end [K] as in :class:`Known`, and held_doubt, held_others, others_share as there.
    """

    log_rate: float
    curve: Array
    held: Array
    whole: Array
    doubt: Array
    beside_time: Array
    beside: Array
    beside_end: float
    nodes: Array = field(default_factory=lambda: NODES)
    others: Array = field(default_factory=lambda: np.zeros((0, len(GRID))))
    held_doubt: Array = field(default_factory=lambda: np.zeros((0, len(GRID))))
    held_others: Array = field(default_factory=lambda: np.zeros((0, len(GRID))))
    others_share: float = 0.0

    def about(self, log_rate: float) -> tuple[Array, Array, Array]:
        """The three curves (L, n) at nodes about another rate."""
        step = self.nodes[1] - self.nodes[0]
        at = np.clip((self.nodes + log_rate - self.log_rate - self.nodes[0]) / step, 0.0, len(self.nodes) - 1.000001)
        node = at.astype(int)
        share = (at - node)[:, None]
        curve, held, whole = ((1.0 - share) * v[node] + share * v[node + 1] for v in (self.curve, self.held, self.whole))
        return curve, held, whole


#: Whether effects were looked for, and for whom they are.
Searched = Literal["", "all", "each"]


@dataclass(frozen=True)
class Past:
    """What `runs` complete runs say: a shape per sensor, scatter of the log rate from run to run and spread within a run, and the
    size of disturbances over the typical with the deviation of its logarithm.

    stretches (runs,) are those of the runs learnt from; factors those on half-widths that the runs ask for, as in
    :class:`Imperfection`; rises are those of the run at hand, where a model of it has more than the law. guessed: there were no
    runs, and what stands here of rates is a guess from the run at hand. unexplained: sensors whose readings the model leaves in a
    pattern: its effects stand for what is missing in it, too, and are others in another run. searched: the rises are of effects
    that a search of the run at hand chose, for `all` its sensors or for `each` by itself: they must make its readings likelier than
    a machine's usual disturbance does; unsure: they are not sure enough to be named, and count where the law does not hold.
    stayed_min: how long the heat of the rises, where it is logged, stayed where it was at most; changed_min: when it jumped last
    [min of the run]. cycles: it goes on and off, and what lies beyond the log is for its mean. open_end: sensors of which a limit
    is trusted no farther than the readings at hand go: something happened in the only run learnt from, and a slow mass may be
    hidden in it, or that run ended far from where the model does; unreached: of each sensor the share of its rise by which its
    limit may be off, as no run learnt from came to it.
    """

    shapes: dict[str, SensorShape]
    runs: int = 0
    scatter: float = SCATTER
    spread: float = SPREAD
    scale: float = 1.0
    scale_spread: float = 0.8
    stretches: tuple[float, ...] = ()
    factors: tuple[tuple[float, float], ...] = ()
    guessed: bool = False
    rises: dict[str, Rise] = field(default_factory=dict)
    unexplained: tuple[str, ...] = ()
    searched: Searched = ""
    unsure: bool = False
    stayed_min: float = np.inf
    changed_min: float = -np.inf
    cycles: bool = False
    open_end: frozenset[str] = frozenset()
    unreached: dict[str, float] = field(default_factory=dict)

    @property
    def staged(self) -> bool:
        """Whether the rises are those of a logged load that goes in stages, with nothing else that was looked for or learnt."""
        return self.guessed and not self.searched and not self.cycles and bool(self.rises)

    def prior(self, given: Imperfection) -> Imperfection:
        """What a run of this machine may do beside its shape: structure is known, disturbances are of the size learnt.

        Beside what is known, or followed as logged, strong effects are smaller than on a machine that nobody knows, and to no side.
        """
        given = replace(given, strong_scales=BESIDE_KNOWN, lean=0.0)
        if self.guessed:
            return given
        rare = [i for i, s in enumerate(given.strong) if not (s.slow or s.fast or s.exponent)]
        weights = given.strong_weights or (1.0,) * len(given.strong)
        return replace(
            given,
            background=_open(given.background),
            strong=tuple(given.strong[i] for i in rare),
            strong_weights=tuple(weights[i] for i in rare),
            strong_share=given.strong_share * sum(weights[i] for i in rare) / max(sum(weights), 1e-12),
            multiplier=given.multiplier * self.scale,
            scale_spread=self.scale_spread,
            clean=0.0 if self.runs else given.clean,
            rate_spread=self.spread,
            factors=self.factors,
        )

    @property
    def time_constant(self) -> float:
        """Of an exponential that is done to 95 % when the sensors that were known are [min], by the median: a slow mass counts."""
        done = []
        for shape in self.shapes.values():
            left = np.flatnonzero(np.abs(np.exp(-GRID) - modes(GRID) @ shape.amplitudes) > 0.05)
            done.append(float(GRID[left[-1]] if len(left) else GRID[1]) * np.exp(-shape.log_rate) / LOG_TWENTY)
        return float(np.median(done))

    def rates_off(self, rate: Mapping[str, float]) -> tuple[float, float]:
        """How many times as fast the sensors of a run are as they were, by their rates [1/min], and how many deviations from run to
        run that is, either way. Both by the median; (1, 0) where none was known or is told.
        """
        both = [(self.shapes[c], b) for c, b in rate.items() if c in self.shapes and b > 0.0]
        if not both:
            return 1.0, 0.0
        off = np.array([np.log(b) - s.log_rate for s, b in both])
        deviation = np.array([np.hypot(s.deviation, self.scatter) for s, _ in both])
        return float(np.exp(np.median(off))), abs(float(np.median(off / np.maximum(deviation, 1e-12))))

    def known(self, channels: Sequence[str]) -> Known:
        """For the sensors of a part, in its order; all of them have a shape, and all or none a rise of this run."""
        columns, law = modes(GRID), -np.expm1(-GRID)[None]
        shapes = [self.shapes[c] for c in channels]
        doubt = [(columns @ covariance_root(s.in_another_run)).T for s in shapes]
        own = [columns @ s.amplitudes for s in shapes]
        log_rate = np.array([[s.log_rate, np.hypot(s.deviation, self.scatter)] for s in shapes])
        rises = [self.rises[c] for c in channels if c in self.rises]
        if not rises:
            curve = np.array([law + more for more in own])
            return Known(log_rate, GRID, curve, curve, curve, np.array(doubt))
        about = [r.about(s.log_rate) for r, s in zip(rises, shapes, strict=True)]
        curve, held, whole = (np.array([three[k] + more for three, more in zip(about, own, strict=True)]) for k in range(3))
        both = [r.doubt for r in rises], [r.held_doubt for r in rises]
        others = [np.array(of) if len(of[0]) else None for of in ([r.others for r in rises], [r.held_others for r in rises])]
        doubts = [padded([np.concatenate(two) for two in zip(doubt, of, strict=True)]) for of in both]
        return Known(
            log_rate,
            GRID,
            curve,
            held,
            whole,
            doubts[0],
            rises[0].nodes,
            rises[0].beside_time,
            np.array([r.beside for r in rises]),
            np.array([r.beside_end for r in rises]),
            self.guessed,
            others[0],
            doubts[1],
            others[1],
            rises[0].others_share,
        )


@dataclass(frozen=True)
class PastRun:
    """One run of a machine: a part per sensor, log rates (S,) of a fit to it, and the rises where a model has more than the law.

    alone (S, 4): what its readings alone say of where it ends, see :func:`ends_alone`; none where a model has more than the law.
    """

    channels: tuple[str, ...]
    parts: tuple[Part, ...]
    log_rates: Array
    rises: dict[str, Rise] = field(default_factory=dict)
    unexplained: tuple[str, ...] = ()
    alone: Array = field(default_factory=lambda: np.zeros((0, 4)))


@dataclass(frozen=True)
class _Seen:
    """One run of one sensor at a rate: rows of its blocks, relative to the rise but for the readings and what is absolute; end: x
    of its last reading.
    """

    y: Array
    law: Array
    bend: Array
    modes: Array
    noise: Array
    relative: Array
    absolute: Array
    rise: float
    end: float


def learn_past(runs: Sequence[PastRun], prior: Imperfection, near: Past | None = None) -> Past:
    """From runs of a machine, the more complete the better; a sensor need not be in every run.

    near: what much the same runs have said, from which one round leads there.
    """
    names = list(dict.fromkeys(c for run in runs for c in run.channels))
    scatter, spread, stretches = SCATTER, SPREAD, np.zeros(len(runs))
    log_rate = {c: float(np.mean([r.log_rates[r.channels.index(c)] for r in runs if c in r.channels])) for c in names}
    fitted = log_rate.copy()
    if near is not None:
        scatter, spread, log_rate = near.scatter, near.spread, {c: near.shapes[c].log_rate for c in names}
    scales = SCALES if near is None else SCALES[np.argsort(np.abs(np.log(SCALES / near.scale)))[:NEAR]]
    rises: dict[str, Array] = {}
    for _ in range(ROUNDS if near is None else ROUNDS_NEAR):
        found = {c: _learn(c, runs, log_rate[c], scatter, spread, prior, scales, rises.get(c)) for c in names}
        # What the sensors say of the size is one thing: they share the disturbances.
        total = np.mean([one.evidence for one in found.values()], axis=0)
        likely = SHAPE_WEIGHTS[:, None] * np.exp(-0.5 * (np.log(scales) / prior.scale_spread) ** 2)
        weight = np.exp(total - total.max()) * likely.ravel()
        weight /= weight.sum()
        # Amplitudes are relative to what the law has of the rise, which the modes change.
        rises = {c: weight @ one.rise for c, one in found.items()}
        at = np.array([weight @ one.stretch for one in found.values()])  # (sensors, runs)
        for c, mine in zip(names, at, strict=True):
            log_rate[c] = float(np.clip(log_rate[c] + np.nanmean(mine), fitted[c] - FROM_FIT, fitted[c] + FROM_FIT))
        at = at - np.nanmean(at, axis=1, keepdims=True)
        stretches = np.nan_to_num(np.nanmean(at, axis=0))
        own = np.nanmean((at - stretches) ** 2, axis=0).sum()
        more = len(runs) - 1
        scatter = float(np.sqrt((RUNS_ASSUMED * SCATTER**2 + (stretches**2).sum()) / (RUNS_ASSUMED + more)))
        spread = float(np.sqrt((RUNS_ASSUMED * SPREAD**2 + own) / (RUNS_ASSUMED + more)))
    of_scale = weight.reshape(len(SHAPE_SIZES), -1).sum(axis=0)
    middle = float(of_scale @ np.log(scales))
    deviation = float(np.sqrt(of_scale @ (np.log(scales) - middle) ** 2))
    shapes, places = {}, {c: [(r, r.channels.index(c)) for r in runs if c in r.channels] for c in names}
    for c, one in found.items():
        mean = weight @ one.amplitudes
        apart = one.amplitudes - mean
        covariance = np.einsum("s,sij->ij", weight, one.covariance) + np.einsum("s,si,sj->ij", weight, apart, apart)
        seen = int(np.isfinite(one.stretch[0]).sum())
        of = [r.parts[i].reading[0] for r, i in places[c]]
        first, last = (np.array([np.median(v[some]) for v in of]) for some in (slice(3), slice(-5, None)))
        at_ends = [(r.alone[i], float(np.ptp(r.parts[i].time))) for r, i in places[c] if len(r.alone)]
        rest = left_open(at_ends, float(np.exp(log_rate[c])), mean, SIGMAS * REST_SPREAD)
        average = (
            float(first.mean()),
            rest,
            float(np.mean(last - first)),
            float(np.mean([r.parts[i].noise[0] for r, i in places[c]])),
        )
        shapes[c] = SensorShape(log_rate[c], scatter / float(np.sqrt(seen)), mean, covariance, *average)
    spread_of_scale = float(np.hypot(deviation, SCALE_AGAIN / np.sqrt(len(runs))))
    unexplained = tuple(c for c in names if any(c in r.unexplained for r in runs))
    told = float(np.exp(middle)), spread_of_scale, tuple(stretches.tolist())
    return Past(shapes, len(runs), scatter, spread, *told, unexplained=unexplained)


@dataclass(frozen=True)
class _Learnt:
    """At each size of shape and disturbances: evidence (s,), amplitudes (s, k), covariance (s, k, k), stretch (s, runs), and how
    far each run rises (s, runs) [K]; nan in a run without the sensor.
    """

    evidence: Array
    amplitudes: Array
    covariance: Array
    stretch: Array
    rise: Array


def _seen(run: PastRun, channel: str, log_rate: float, prior: Imperfection) -> _Seen:
    part, rise = run.parts[run.channels.index(channel)], run.rises.get(channel)
    rate = np.exp([log_rate])
    time, tau = part.time - part.time[0], float(1.0 / rate[0])
    blocks = block_means(time, part.reading, part.noise, part.resolution, tau, True, BLOCKS)
    asked, m = Asked(np.zeros(0)), len(blocks.time)
    room = None if part.room is None else of_room(rate, blocks.time, time, part.room, asked)
    there = covariances(rate, blocks.time, blocks.last, tau / 60.0, asked, room)[0, :, :m, :m]
    relative, absolute = replace(prior, background=_open(prior.background), strong=(), strong_weights=()).kinds()
    x = rate[0] * blocks.time
    y = blocks.mean[0] - (0.0 if room is None else room[0, :m])
    shape, bend = law(rate, blocks.time, blocks.spread, asked)[0, :m] * rate[0], x * np.exp(-x)
    if rise is not None:
        inside = within(blocks.time, blocks.spread)
        y = y - np.interp(inside, rise.beside_time, rise.beside).mean(axis=1)
        nodes, node = rise.nodes, len(rise.nodes) // 2
        curves = rise.about(log_rate)[0]
        at_rate, faster = (np.interp(inside, GRID / rate[0] * np.exp(-nodes[k]), curves[k]).mean(axis=1) for k in (node, node + 1))
        shape = shape + np.interp(rate[0] * inside, GRID, curves[node] + np.expm1(-GRID)).mean(axis=1)
        bend = (faster - at_rate) / nodes[node + 1]
    return _Seen(
        y,
        shape,
        bend,
        modes(x),
        blocks.noise[0],
        np.einsum("n,nij->ij", relative[0], there),
        np.einsum("n,nij->ij", absolute[0], there),
        _slope(shape, y),
        float(rate[0] * blocks.last),
    )


def _slope(x: Array, y: Array) -> float:
    """Of y over x (n,); the range of y where x does not change, as of a sensor that is done before its first block."""
    off = x - x.mean()
    size = float(off @ off)
    return float(off @ y) / size if size > 1e-9 * len(x) else float(np.ptp(y))


def _learn(
    channel: str,
    runs: Sequence[PastRun],
    log_rate: float,
    scatter: float,
    spread: float,
    prior: Imperfection,
    scales: Array,
    rises: Array | None,
) -> _Learnt:
    """One sensor over all runs that have it, as one Gaussian: start, rise, stretch, disturbances of each run; one shape of all.

    rises (runs,) [K] are those that the law has, as far as they are known.
    """
    seen = [(r, _seen(run, channel, log_rate, prior)) for r, run in enumerate(runs) if channel in run.channels]
    if rises is not None:
        seen = [(r, replace(s, rise=_likely(float(rises[r]), s.rise))) for r, s in seen]
    sizes = [len(s.y) for _, s in seen]
    ends = np.cumsum([0, *sizes])
    total = int(ends[-1])
    y = np.concatenate([s.y for _, s in seen])
    flat = np.zeros((total, 2 * len(seen)))
    shape = np.concatenate([s.rise * s.modes for _, s in seen])
    bend = np.zeros((total, len(seen)))
    relative, absolute = np.zeros((total, total)), np.zeros((total, total))
    for k, (_, s) in enumerate(seen):
        at = slice(ends[k], ends[k + 1])
        flat[at, 2 * k], flat[at, 2 * k + 1] = 1.0, s.law
        bend[at, k] = s.rise * s.bend
        relative[at, at], absolute[at, at] = s.rise**2 * s.relative, s.absolute
    noise = np.diag(np.concatenate([s.noise for _, s in seen]))
    bend_prior = bend * np.hypot(scatter, spread)
    fixed = noise + bend_prior @ bend_prior.T
    pairs = [(each, scale) for each in SHAPE_SIZES for scale in scales]
    count = len(_deviations(SHAPE_SIZES[0]))
    after = np.array(BEYOND_END) * max(s.end for _, s in seen)
    wide = REST_SPREAD + OF_LAW * np.exp(-after)
    rest, left_over = modes(after) / wide[:, None], -REST / wide
    evidence, amplitudes = np.empty(len(pairs)), np.empty((len(pairs), count))
    covariance, stretch = np.empty((len(pairs), count, count)), np.full((len(pairs), len(runs)), np.nan)
    rise = stretch.copy()
    for k, (shape_sizes, scale) in enumerate(pairs):
        variance = np.linalg.inv(np.diag(_deviations(shape_sizes, after[0]) ** -2) + rest.T @ rest)
        middle = variance @ rest.T @ left_over
        factor = np.linalg.cholesky(fixed + shape @ variance @ shape.T + scale**2 * (relative + absolute))
        white = np.linalg.solve(factor, np.column_stack([y - shape @ middle, flat, shape, bend]))
        x = white[:, 1 : 1 + flat.shape[1]]
        q, r = np.linalg.qr(x)
        left = white - q @ (q.T @ white)
        mine = left[:, 1 + flat.shape[1] : 1 + flat.shape[1] + count]
        bends = left[:, 1 + flat.shape[1] + count :]
        evidence[k] = -np.log(np.diag(factor)).sum() - np.log(np.abs(np.diag(r))).sum() - 0.5 * float(left[:, 0] @ left[:, 0])
        amplitudes[k] = middle + variance @ (mine.T @ left[:, 0])
        covariance[k] = variance - variance @ (mine.T @ mine) @ variance
        stretch[k, [r for r, _ in seen]] = (scatter**2 + spread**2) * (bends.T @ left[:, 0])
        rise[k, [place for place, _ in seen]] = np.linalg.solve(r, q.T @ white[:, 0])[1::2]
    return _Learnt(evidence, amplitudes, covariance, stretch, rise)


def _likely(rise: float, alone: float) -> float:
    """A rise that the law has beside modes [K], no more than some times what it has alone."""
    return float(np.sign(alone) * np.clip(rise * np.sign(alone), abs(alone) / MOST_RISE, abs(alone) * MOST_RISE))
