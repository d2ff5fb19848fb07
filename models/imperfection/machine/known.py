"""What is known of the sensors of a machine before they are read: how fast they are, and what shape their rise has."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..shapes import Asked, loss_bend

Array = NDArray[np.float64]


#: Modes of the machine's own shape beside the law, as many times as fast as it; with the loss exponent they are the amplitudes.
SLOW_MODES, FAST_MODES = (0.03, 0.055, 0.1, 0.2, 0.35, 0.6), (1.5, 2.0, 3.0, 5.0, 9.0, 20.0)
#: Limit over the law's own below which a shape is no rise.
LEAST_LIMIT = 0.2
#: Points of a block at which a curve with corners is averaged.
POINTS = 8

#: No covariance of anything.
NOTHING = np.zeros((0, 0, 0))
#: A past leaves a temperature open by so many rises at most, which is open to all that matters.
MOST_DOUBTED = 100.0


def modes(x: Array) -> Array:
    """What each amplitude adds (..., k) to the rise, relative to all of it, at x = rate t: nothing at first, nothing in the end."""
    slow = [np.exp(-x) - np.exp(-k * x) for k in SLOW_MODES]
    fast = [np.exp(-k * x) - np.exp(-x) for k in FAST_MODES]
    return np.stack([*slow, *fast, loss_bend(x)], axis=-1)


def to_the_limit(amplitudes: Array, covariance: Array) -> tuple[Array, Array] | None:
    """Amplitudes (k,) and covariance (k, k) of modes that changed the limit, too, as they are relative to it; None without one."""
    slow, fast = amplitudes[: len(SLOW_MODES)], amplitudes[len(SLOW_MODES) : -1]
    limit = 1.0 + float(slow.sum() - fast.sum())
    return (amplitudes / limit, covariance / limit**2) if limit > LEAST_LIMIT else None


def within(time: Array, spread: Array) -> Array:
    """Times (m, POINTS) inside blocks of mean time (m,) whose times have the variance (m,)."""
    found: Array = time[:, None] + np.sqrt(3.0 * spread)[:, None] * (np.arange(POINTS) * 2.0 + 1.0 - POINTS) / POINTS
    return found


@dataclass(frozen=True)
class Known:
    """Of the s sensors of a part, each over its own x = rate t (n,).

    log_rate (s, 2): log rate and its deviation; curve (s, L, n): the rise over its law's own, 0 at first, of rates whose logarithms
    are `nodes` (L,) off the known one, one node where it does not depend on the rate but through x; held (s, L, n): the same with
    what is logged held as it was at the last reading used, which leads to the limit; whole (s, L, n): with that held, all that the
    sensor does over where it ends, what is not proportional to the rise too. doubt (s, J, n): columns whose amplitudes are
    standard normal, relative to the rise, in which the curve may be wrong. beside (s, k) [K] at beside_time (k,) [min after the
    first reading]: what is not proportional to the rise; beside_end (s,) [K] what it is in the limit. guessed: log_rate is no
    knowledge, but a guess from the record itself. others (s, J, n): columns as those of doubt, of the size that the background of
    machines typically has: how far this machine's is from it the readings tell. held_doubt, held_others: the same with what is
    logged held, where that differs: what comes later says nothing of the limit. others_share: share of its heat (1 sd) that each of
    `others` is; 0 where there are none.
    """

    log_rate: Array
    x: Array
    curve: Array
    held: Array
    whole: Array
    doubt: Array
    nodes: Array = field(default_factory=lambda: np.zeros(1))
    beside_time: Array = field(default_factory=lambda: np.array([0.0, 1.0]))
    beside: Array | None = None
    beside_end: Array | None = None
    guessed: bool = False
    others: Array | None = None
    held_doubt: Array | None = None
    held_others: Array | None = None
    others_share: float = 0.0

    @cached_property
    def turns(self) -> Array:
        """Time constants until 95 % of all that each sensor does are done for good (s, L)."""
        end = self.whole[..., -1:]
        left = np.abs(self.whole - end) - 0.05 * np.abs(end)
        count = left.shape[-1]
        last = np.minimum(count - 1 - np.argmax((left > 0.0)[..., ::-1], axis=-1), count - 2)
        here, there = (np.take_along_axis(left, (last + k)[..., None], -1)[..., 0] for k in (0, 1))
        with np.errstate(all="ignore"):
            share = np.where(here > there, here / (here - there), 1.0)
        found: Array = np.maximum(self.x[last] + share * (self.x[last + 1] - self.x[last]), 1e-3)
        return found

    @cached_property
    def moved(self) -> Array:
        """Where each sensor ends, with its neighbours and later loads, over the rise of its own heat (s,); no less than that."""
        middle = int(np.abs(self.nodes).argmin())
        return np.maximum(np.abs(self.held[:, middle, -1]), 1.0)

    @cached_property
    def pace(self) -> Array:
        """How fast the 5 % that are left at `turns` fall there (s, L), over the rate."""
        found = np.ones_like(self.turns)
        for place in np.ndindex(found.shape):
            line, near = self.whole[place], self.turns[place] * np.array([0.9, 1.1])
            left = np.abs(line[-1] - np.interp(near, self.x, line))
            if left.min() > 0.0:
                found[place] = np.log(left[0] / left[1]) / (near[1] - near[0])
        return np.clip(np.nan_to_num(found, nan=1.0), 0.1, 10.0)

    def settles(self, sensor: int, log_rate: Array) -> tuple[Array, Array]:
        """`turns` and `pace` (F,) of one sensor at log rates (F,)."""
        node, share = self._place(sensor, log_rate)
        both = (
            (1.0 - share) * v[sensor, node] + share * v[sensor, np.minimum(node + 1, v.shape[1] - 1)]
            for v in (self.turns, self.pace)
        )
        turns, pace = both
        return turns, pace

    def beyond_law(self, rate: Array, time: Array, spread: Array, asked: Asked) -> Array:
        """What the curve has beyond the law over the rate, (s, F, m + k), at rates (s, F) and the rows of :func:`shapes.law`."""
        of_law, inside = np.expm1(-self.x), within(time, spread)
        found = np.empty((*rate.shape, len(time) + asked.count))

        def line(i: int, node: int, at_rate: float) -> Array:
            return self._rows(self.curve[i, node] + of_law, self.held[i, node, -1] - 1.0, 0.0, at_rate, inside, asked)

        for i, rates in enumerate(rate):
            if len(self.nodes) < 2:
                found[i] = [line(i, 0, r) for r in rates.tolist()]
                continue
            # Between two nodes at one time, each on its own clock: what is logged changes at that time, whatever the rate.
            node, share = self._place(i, np.log(rates))
            own = np.exp(self.log_rate[i, 0] + self.nodes)
            of_node = {k: line(i, k, float(own[k])) for k in {*node.tolist(), *(node + 1).tolist()}}
            for f, (k, w, r) in enumerate(zip(node.tolist(), share.tolist(), rates.tolist(), strict=True)):
                if own[0] <= r <= own[-1]:
                    found[i, f] = (1.0 - w) * of_node[k] + w * of_node[k + 1]
                else:
                    found[i, f] = line(i, k if r < own[0] else k + 1, r)
        found /= rate[..., None]
        return found

    def doubts(self, time: Array, asked: Asked) -> Array:
        """Covariance (s, m + k, m + k) over the square of what each sensor does in all, at the known rates."""
        return self._covariance(self.doubt, self.held_doubt, time, asked)

    def wrong(self, time: Array, asked: Asked, others: bool) -> tuple[Array, Array]:
        """The same, and that of `others`: (0, 0, 0) where there are none or none are wanted."""
        more = NOTHING if self.others is None or not others else self._covariance(self.others, self.held_others, time, asked)
        return self.doubts(time, asked), more

    def _covariance(self, lines: Array, held: Array | None, time: Array, asked: Asked) -> Array:
        found = []
        middle = int(np.abs(self.nodes).argmin())
        for i, (columns, kept) in enumerate(zip(lines, lines if held is None else held, strict=True)):
            rate, turns = float(np.exp(self.log_rate[i, 0])), self.turns[i, middle]
            late = [float(np.interp(turns, self.x, c)) - 0.95 * c[-1] - 0.05 * c[0] for c in kept]
            ends = [float(c[-1]) for c in kept]
            at_each = zip(columns, ends, late, strict=True)
            rows = np.array([self._rows(c, end, at, rate, time[:, None], asked) for c, end, at in at_each])
            # An effect that would grow without end says nothing there; numbers beyond all scales would spoil what it does say.
            rows *= np.minimum(1.0, MOST_DOUBTED / np.maximum(np.sqrt((rows**2).sum(axis=0)), 1.0))
            found.append(rows.T @ rows / self.moved[i] ** 2)
        return np.array(found)

    def beside_at(self, time: Array, spread: Array, asked: Asked) -> Array:
        """What is not proportional to the rise (s, m + k) [K]."""
        assert self.beside is not None
        assert self.beside_end is not None
        ends = self.beside_end[:, None]
        inside = within(time, spread)
        there = np.array([np.interp(inside, self.beside_time, line).mean(axis=1) for line in self.beside])
        later = np.array([np.interp(asked.times, self.beside_time, line) for line in self.beside])
        return np.concatenate([there, ends, 0.0 * ends, 0.0 * ends, later], axis=1)

    def _place(self, sensor: int, log_rate: Array) -> tuple[NDArray[np.intp], Array]:
        """The node below each log rate (F,) and the share of the way to the next."""
        if len(self.nodes) < 2:
            return np.zeros(len(log_rate), dtype=np.intp), np.zeros(len(log_rate))
        step = float(self.nodes[1] - self.nodes[0])
        place = np.clip((log_rate - self.log_rate[sensor, 0] - self.nodes[0]) / step, 0.0, len(self.nodes) - 1.000001)
        node = place.astype(np.intp)
        return node, place - node

    def _rows(self, line: Array, end: float, late: float, rate: float, time: Array, asked: Asked) -> Array:
        """A line over x at the rows that are asked for (m + k,): blocks, limit, settling, slow rest, times.

        Over a block it is the mean at its times (m, n).
        """
        there, later = np.interp(rate * time, self.x, line).mean(axis=1), np.interp(rate * asked.times, self.x, line)
        found: Array = np.concatenate([there, [end, late, 0.0], later])
        return found
