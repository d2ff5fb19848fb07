"""What the readings of a run say of its sensors' rates and of the size and kind of its disturbances: evidence over grids.

The rate is the one parameter that is not linear; it and the size of the discrepancy run over grids, and all the rest is closed form
(``_mixture_numpy.py``). Sensors of a run tell each other two things: how large the disturbances of this run are, and,
where their rates agree, the rate.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..decay import LOG_TWENTY
from .blocks import Blocks, Part, block_means
from .machine.known import NOTHING
from .numerics import batches, cells, core, law_slope, log_sum, student, within_depth
from .prior import SLOW, Imperfection
from .shapes import Asked, constant, covariances, kept_covariances, law, of_room, slow_rise

Array = NDArray[np.float64]
Rates = Literal["auto", "own", "shared"]

#: Between nodes of the log rate the covariances are straight lines; the law itself is exact at every rate.
NODE_STEP = 0.12
#: Rates looked at lie between these over the length of the record, or so many times the pilot's.
SLOWEST, FASTEST, BEYOND_PILOT = 1.0 / 12.0, 40.0, 10.0
#: Rates of the first pass that closes in on the posterior, of those after it, and how many more there may be.
FEW, FINE, MORE = 24, 28, 3
#: Rates looked at beside the grid, in deviations of the law's own.
ANCHORS = np.array([-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0])
#: Every so many nodes the first look over all rates takes.
COARSE = 3
#: Of a record that is hardly bent the time constant is a guess, and its discrepancies are counted by its own length.
LONGEST_UNIT = 1.0
#: A record that is nearly straight has a pilot that is too fast: towards slower rates the prior is so many times as wide.
SLOWER = 2.0
#: Sensors beyond this many add nothing that the first have not said: their disturbances are common.
COUNTED_OTHERS = 2.0
#: Rates of a machine that is known, or guessed, are looked at within so many deviations.
AROUND_KNOWN, AROUND_GUESSED = 6.0, 4.0
#: A machine that is known may have been changed since (a fan, a filter, other oil): Student's t with so many degrees of freedom, as
#: scatter between few runs has, log rates that are looked at on either side at least, and how many of them at first.
KNOWN_FREE, KNOWN_REACH, KNOWN_COARSE = 3.0, 0.5, 24
#: Log evidence of one sensor that counts with others, at most: a probe that fell off says much, and nothing of its neighbours.
MOST_SAID = 20.0


class Foretold(NamedTuple):
    """Of one sensor at its n rates and hypotheses that are active, rates in order and hypotheses within.

    Mean and variance (n, asked) of what is asked for, and the squares (n,) of the readings that are left.
    """

    mean: Array
    variance: Array
    squares: Array


@lru_cache(maxsize=4)
def _space(prior: Imperfection) -> tuple[tuple[NDArray[np.intp], Array, Array, Array], tuple[Array, Array], Array]:
    """Hypotheses, kinds and leans of a prior: one is used for many runs."""
    found = prior.hypotheses(), prior.kinds(), prior.leans()
    for array in (*found[0], *found[1], found[2]):
        array.flags.writeable = False
    return found


class Run:
    """The parts of one run, one after the other, with everything about them that the passes over rates and hypotheses share."""

    def __init__(self, parts: Sequence[Part], tau: float, prior: Imperfection, at: Array, rates: Rates) -> None:
        self.prior, self.rates = prior, rates
        self.asked = [Asked(np.maximum(at - p.time[0], 0.0)) for p in parts]
        self.times = len(at)
        length = max(float(p.time[-1] - p.time[0]) for p in parts)
        scale = min(tau, LONGEST_UNIT * length)
        self.blocks = [block_means(p.time - p.time[0], p.reading, p.noise, p.resolution, scale, not prior.none) for p in parts]
        self.rows = np.cumsum([0, *(len(p.reading) for p in parts)])
        self.count = int(self.rows[-1])
        span = max(b.last for b in self.blocks)
        fastest = max(FASTEST / span, BEYOND_PILOT / tau)
        slow, fast = float(np.log(SLOWEST / span)), float(np.log(fastest))
        told = [p.known.log_rate for p in parts if p.known is not None]
        self.known = np.concatenate(told) if told else None
        self.guessed = any(p.known is not None and p.known.guessed for p in parts)
        if self.known is not None:
            around, least = (AROUND_GUESSED, 0.0) if self.guessed else (AROUND_KNOWN, KNOWN_REACH)
            reach = np.maximum(around * self.known[:, 1], least)
            slow, fast = float((self.known[:, 0] - reach).min()), float((self.known[:, 0] + reach).max())
        self.nodes = np.arange(slow, fast + NODE_STEP, NODE_STEP)
        node_rates = np.exp(self.nodes)
        self.logged = [
            None if p.room is None else of_room(node_rates, b.time, p.time - p.time[0], p.room, asked)
            for p, b, asked in zip(parts, self.blocks, self.asked, strict=True)
        ]
        turns = [LOG_TWENTY if p.known is None else float(np.median(p.known.turns)) for p in parts]
        self.unit = scale / 60.0
        self.covariance = [
            kept_covariances(node_rates, b.time, b.last, self.unit, asked, logged, late)
            for b, asked, logged, late in zip(self.blocks, self.asked, self.logged, turns, strict=True)
        ]
        (self.kind, self.scale, self.under, self.log_prior), (self.relative, self.absolute), self.leans = _space(prior)
        self.turns = turns
        self.base = self.kind == 0
        self.centre = np.full(self.count, -np.log(tau)) if self.known is None else self.known[:, 0]
        self.shape = [p.known for p in parts]
        there = list(zip(self.shape, self.blocks, self.asked, strict=True))
        self.moved = [np.ones((len(p.reading), 1)) if p.known is None else p.known.moved[:, None] for p in parts]
        self.wrong = [(NOTHING, NOTHING) if k is None else k.wrong(b.time, a, not prior.none) for k, b, a in there]
        self.follows = [prior.follows(0.0 if k is None else k.others_share) for k in self.shape]
        self.beside = [None if k is None or k.beside is None else k.beside_at(b.time, b.spread, a) for k, b, a in there]
        law_rate = np.concatenate([np.full((len(p.reading), 2), np.nan) if p.log_rate is None else p.log_rate for p in parts])
        self.anchors = law_rate[:, :1] + np.maximum(law_rate[:, 1:], 1e-7) * ANCHORS
        self._known = np.zeros(0)

    def log_rate_prior(self, off: Array, sensor: int | None = None) -> Array:
        """Log prior, up to a constant that all have, of log rates (S, F) less the centres; of one sensor, (F,)."""
        if self.known is None:
            spread = self.prior.log_rate_spread
            slow, fast = np.asarray(SLOWER * spread), np.asarray(spread)
        else:
            slow = fast = self.known[:, 1:] if sensor is None else self.known[sensor, 1]
            if not self.guessed:
                return student(off, slow, KNOWN_FREE)
        found: Array = -0.5 * (off / np.where(off > 0.0, fast, slow)) ** 2 - np.log(slow + fast)
        return found

    def no_evidence(self, log_rate: Array) -> Array:
        """A table (S, F, H) over log rates (S, F) and hypotheses, of which nothing is worked out yet: nan."""
        return np.full((*log_rate.shape, len(self.kind)), np.nan)

    def evaluate(
        self,
        log_rate: Array,
        active: NDArray[np.bool_],
        asked: int,
        wrong: Sequence[tuple[Array, Array]] | None = None,
        into: Array | None = None,
    ) -> tuple[Array, list[Foretold]]:
        """Signed rise (S, F) at log rates (S, F) and, where any temperature is asked for, what is foretold of each sensor.

        active (S, F, H): what is worked out. Its evidence goes into `into` (S, F, H), where that is given; what stands there of the
        rest stays. wrong: in place of the parts'.
        """
        rise = np.empty(log_rate.shape)
        foretold: list[Foretold] = []
        for i, blocks in enumerate(self.blocks):
            first, behind, m = int(self.rows[i]), int(self.rows[i + 1]), len(blocks.time)
            some = log_rate[first:behind]
            of_law, node, share, known = self.rows_of(i, some)
            reading = blocks.mean[:, None] - known[..., :m]
            rise[first:behind] = law_slope(blocks, reading, of_law[..., :m]) / np.exp(some)
            reading = np.ascontiguousarray(np.broadcast_to(reading, (*some.shape, m)))
            known = np.broadcast_to(known, of_law.shape)
            doubts = (self.wrong if wrong is None else wrong)[i]
            # Of all hypotheses of all sensors at once what is foretold, and slow parts, would take many times what the readings do.
            for own in batches(len(some)):
                rows = slice(first + own.start, first + own.stop)
                of = active[rows].any(axis=(0, 1))
                there = np.ascontiguousarray(active[rows][..., of])
                found = np.empty(there.shape), np.empty(there.shape)
                mean, variance = (np.zeros((*there.shape, asked)) for _ in range(2))
                core.mixture(
                    reading[own],
                    np.ascontiguousarray(blocks.noise[own]),
                    constant(blocks.time, self.asked[i]),
                    of_law[own],
                    self.slow_of(i, some[own]),
                    self.leans[of],
                    node[own],
                    share[own],
                    *self.covariance[i],
                    self.relative,
                    self.absolute,
                    np.ascontiguousarray((self.moved[i][own] * rise[rows]) ** 2),
                    *(d[own] for d in doubts),
                    self.follows[i],
                    self.kind[of],
                    self.scale[of],
                    self.under[of],
                    there.view(np.uint8),
                    asked,
                    *found,
                    mean,
                    variance,
                )
                if into is not None:
                    into[rows][..., of] = np.where(there, found[0], into[rows][..., of])
                if asked:
                    mean += known[own][:, :, None, m : m + asked]
                    each = zip(mean, variance, found[1], there, strict=True)
                    foretold += [Foretold(mu[a], v[a], left[a]) for mu, v, left, a in each]
        return rise, foretold

    def rows_of(self, part: int, log_rate: Array) -> tuple[Array, NDArray[np.intp], Array, Array]:
        """Of a part's sensors at log rates (s, F): the law's rows (s, F, m + k), nodes and shares (s, F), what is known beside."""
        blocks, asked, past, rate = self.blocks[part], self.asked[part], self.shape[part], np.exp(log_rate)
        of_law = law(rate, blocks.time, blocks.spread, asked)
        if past is not None:
            of_law = of_law + past.beyond_law(rate, blocks.time, blocks.spread, asked)
        place = np.clip((log_rate - self.nodes[0]) / NODE_STEP, 0.0, len(self.nodes) - 1.000001)
        node = place.astype(np.intp)
        return np.ascontiguousarray(of_law), node, place - node, self._of_room(part, node, place - node)

    def slow_of(self, part: int, log_rate: Array) -> Array:
        """What slow modes of amplitude 1 add to the law's rows at log rates (s, F); nothing where none leans."""
        blocks = self.blocks[part]
        if not self.leans.any():
            return np.zeros((*log_rate.shape, len(SLOW), len(blocks.time) + self.asked[part].count))
        return np.ascontiguousarray(slow_rise(np.exp(log_rate), blocks.time, blocks.last, self.turns[part], self.asked[part]))

    def whole_covariances(self, part: int, nodes: NDArray[np.intp]) -> Array:
        """Of a part's blocks and all that is asked for (n, components, m + k, m + k) at some nodes (n,)."""
        blocks, logged = self.blocks[part], self.logged[part]
        of_room_there = None if logged is None else logged[nodes]
        given = np.exp(self.nodes[nodes]), blocks.time, blocks.last, self.unit, self.asked[part], of_room_there, self.turns[part]
        return covariances(*given)

    def _of_room(self, part: int, node: NDArray[np.intp], share: Array) -> Array:
        """What logged room and known inputs do at rates between nodes (s, F, m + k) [K]; nothing where none are."""
        logged, beside = self.logged[part], self.beside[part]
        found: Array = np.zeros((1, 1, len(self.blocks[part].time) + self.asked[part].count)) if beside is None else beside[:, None]
        if logged is not None:
            found = found + (1.0 - share[..., None]) * logged[node] + share[..., None] * logged[node + 1]
        return found

    def weighed(self, log_rate: Array, evidence: Array) -> Array:
        """Log posterior (S, F, H) up to a constant: evidence, priors, and what other sensors say of size and kind."""
        prior, count = self.prior, self.count
        cell = np.log(np.maximum(cells(log_rate), 1e-12))
        own: Array = np.where(np.isnan(evidence), -np.inf, evidence)
        own += (self.log_rate_prior(log_rate - self.centre[:, None]) + cell)[..., None]
        own -= own.max(axis=(1, 2), keepdims=True)
        kinds = log_sum(own, 1)
        background = self.log_prior[self.base] - np.log1p(-prior.strong_share)
        counted = prior.from_others * min(1.0, COUNTED_OTHERS / max(count - 1, 1))
        weight = np.broadcast_to(self.log_prior, kinds.shape).copy()
        level = log_sum(kinds[:, self.base] + background, 1)
        with np.errstate(invalid="ignore"):  # of a sensor that no hypothesis explains, both are minus infinity
            relative = np.maximum(kinds - level[:, None], -60.0)
        weight[:, ~self.base] += (prior.evidence_power - 1.0) * relative[:, ~self.base]
        said = np.clip(relative, -MOST_SAID, MOST_SAID)
        weight += counted * (said.sum(axis=0) - said)
        own += weight[:, None]
        return own

    def taken_evidence(self, log_rate: Array) -> Array:
        """Log evidence (S,) of what was worked out last at log rates (S, F), which is held no longer."""
        of_rate = self.log_rate_prior(log_rate - self.centre[:, None]) + np.log(np.maximum(cells(log_rate), 1e-12))
        each, self._known = self._known, np.zeros(0)
        each[np.isnan(each)] = -np.inf
        each += self.log_prior
        return log_sum(log_sum(each, 2) + of_rate, 1)

    def told(self, log_rate: Array, marginal: Array) -> tuple[Array, Array, Array]:
        """What the others say of each rate (C, S, F) under each class of hypotheses, a log ratio against knowing nothing.

        marginal (C, S, F): log posteriors under the law with a background, and under strong effects beside them. Such an effect
        is one of the run, and what another's rate would be under it counts: the agreement of rates speaks neither for nor against
        it. They say nothing to a sensor that disagrees with them as the law and a background have it, for a strong effect beside
        their rate could explain nearly any other. Also, over common log rates (D,) less the centres, how likely each other agrees
        there (S, D).
        """
        prior, count, plain = self.prior, self.count, marginal[0]
        if self.rates == "own" or count < 2:
            return np.zeros_like(marginal), np.zeros(0), np.zeros((count, 0))
        off = log_rate - self.centre[:, None]  # sensors that are known for their own rates share how a run departs from them
        apart = prior.apart if self.rates == "auto" else 1e-9
        low, high = float(off.min()), float(off.max())
        spread = np.sqrt(2.0) * prior.rate_spread
        dense = np.linspace(low, high, int(np.clip((high - low) / (spread / 3.0), 50, 1200)))
        step = dense[1] - dense[0]
        weight = np.exp(self.log_rate_prior(dense, 0))
        weight /= weight.sum()
        # A grid finer than the spread between sensors is needed for the rates, not for what is made of them.
        wide = np.hypot(spread, 0.5 * step)
        messages = np.empty((len(marginal), count, len(dense)))
        chance = marginal - self.log_rate_prior(off)
        chance = np.exp(chance - chance.max(axis=2, keepdims=True))
        width = np.hypot(wide, 0.5 * cells(log_rate))
        for j in range(count):
            heard = chance[:, j] @ np.exp(-0.5 * ((dense - off[j][:, None]) / width[j][:, None]) ** 2)
            messages[:, j] = (1.0 - apart) * heard / (heard @ weight)[:, None]
        together = np.log(messages + apart)
        counted = min(1.0, COUNTED_OTHERS / (count - 1)) if not prior.none else 1.0
        others = counted * (together.sum(axis=1, keepdims=True) - together)
        said = np.array([[np.interp(rates, dense, line) for rates, line in zip(off, lines, strict=True)] for lines in others])
        odds = np.ones(count)
        if self.rates == "auto":
            own = np.exp(plain - plain.max(axis=1, keepdims=True))
            ratio = np.exp(said[0] - log_sum(others[0] + np.log(weight), 1)[:, None])
            odds = (own * ratio).sum(axis=1) / own.sum(axis=1) * (1.0 - apart) / apart
        said -= (log_sum(marginal + said, 2) - log_sum(marginal, 2))[..., None]
        said[:, odds < 1.0] = 0.0
        return said, dense, messages[0] / (messages[0] + apart)

    def agrees(self, log_rate: Array, marginal: Array, dense: Array, agreeing: Array) -> NDArray[np.bool_]:
        """Who agrees with whom (S, S): more likely than not, over what is known of the sensor's own rate."""
        found = np.zeros((self.count, self.count), dtype=bool)
        if not len(dense):
            return found
        for i in range(self.count):
            mine = np.exp(marginal[i] - marginal[i].max())
            nearest = np.clip(np.searchsorted(dense, log_rate[i] - self.centre[i]), 0, len(dense) - 1)
            found[i] = agreeing[:, nearest] @ (mine / mine.sum()) > 0.5
            found[i, i] = False
        return found

    def posterior(self) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Log rates (S, F), weights (S, F, H) and who agrees with whom (S, S).

        A coarse look over all rates, then passes that close in.
        """
        slowest, fastest = (np.full(self.count, self.nodes[k]) for k in (0, -1))
        known = self.known is not None and not self.guessed
        coarse = self.spread(slowest, fastest, KNOWN_COARSE if known else len(self.nodes) // COARSE + 1)
        few = np.zeros(len(self.kind), dtype=bool)
        few[self.prior.few()] = True
        evidence = self.no_evidence(coarse)
        self.evaluate(coarse, np.broadcast_to(few, evidence.shape), 0, into=evidence)
        marginal = log_sum(self.weighed(coarse, evidence), 2)
        del evidence  # of fifty sensors such tables are the largest of all that is held
        low, high = within_depth(coarse, marginal, 14.0, 1.0)
        first = self.spread(low, high, FEW)
        marginal = self._looked(first, np.ones(self.count, dtype=bool), few)[1]
        low, high = within_depth(first, marginal, 9.0, 1.0)
        log_rate, open_ = self.spread(low, high, FINE), np.ones(self.count, dtype=bool)
        posterior, marginal, dense, agreeing = self._looked(log_rate, open_)
        for _ in range(MORE):
            closer = within_depth(log_rate, marginal, 9.0, 1.0)
            open_ = (closer[1] - closer[0]) < 0.6 * (log_rate[:, -1] - log_rate[:, 0])
            if not open_.any():
                break
            del posterior  # before another one is made
            log_rate = np.where(open_[:, None], self.spread(*closer, FINE), log_rate)
            posterior, marginal, dense, agreeing = self._looked(log_rate, open_)
        agrees = self.agrees(log_rate, marginal, dense, agreeing)
        posterior -= posterior.max(axis=(1, 2), keepdims=True)
        weight = np.exp(posterior, out=posterior)
        weight /= weight.sum(axis=(1, 2), keepdims=True)
        return log_rate, weight, agrees

    def spread(self, low: Array, high: Array, count: int) -> Array:
        """Log rates (S, F) from low to high (S,), evenly, and those about the law's own."""
        even = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, count)
        law_rate = np.where(np.isnan(self.anchors), low[:, None], self.anchors)
        return np.sort(np.concatenate([even, np.clip(law_rate, low[:, None], high[:, None])], axis=1), axis=1)

    def _looked(
        self, log_rate: Array, anew: NDArray[np.bool_], which: NDArray[np.bool_] | bool = True
    ) -> tuple[Array, Array, Array, Array]:
        """Log posterior (S, F, H), marginal and what ``told`` says of agreement.

        Worked out for sensors `anew` (S,) and hypotheses `which` (H,) only.
        """
        # Rates about the law's own that lie outside the grid stand at its ends, for nothing.
        stands = anew[:, None] & (cells(log_rate) > 0.0)
        active = np.broadcast_to(stands[..., None] & which, (*log_rate.shape, len(self.kind)))
        if anew.all():
            self._known = np.zeros(0)  # before another one is made
            self._known = self.no_evidence(log_rate)
        else:
            self._known[anew] = np.nan
        self.evaluate(log_rate, active, 0, into=self._known)
        posterior = self.weighed(log_rate, self._known)
        classes = [self.base] if self.base.all() else [self.base, ~self.base]
        batch = batches(len(posterior))
        of_classes = np.stack([np.concatenate([log_sum(posterior[rows][..., own], 2) for rows in batch]) for own in classes])
        said, dense, agreeing = self.told(log_rate, of_classes)
        for own, of_class in zip(classes, said, strict=True):
            for rows in batch:
                posterior[rows][..., own] += of_class[rows, :, None]
        return posterior, log_sum(posterior, 2), dense, agreeing

    def settles(self, sensor: int, log_rate: Array) -> tuple[Array | float, Array | float]:
        """Time constants until 95 % are done and how fast the rest falls then, at log rates (F,)."""
        part, row = self.part_of(sensor)
        shape = self.shape[part]
        return (LOG_TWENTY, 1.0) if shape is None else shape.settles(row, log_rate)

    def blocks_of(self, sensor: int) -> Blocks:
        """The blocks of the part that a sensor is in."""
        return self.blocks[self.part_of(sensor)[0]]

    def part_of(self, sensor: int) -> tuple[int, int]:
        """The part that a sensor is in, and its row there."""
        part = int(np.searchsorted(self.rows, sensor, "right")) - 1
        return part, sensor - int(self.rows[part])
