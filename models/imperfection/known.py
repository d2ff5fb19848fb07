"""What is known of the sensors of a machine before they are read: how fast they are, and what shape their rise has."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .shapes import Asked

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Known:
    """Of the s sensors of a part, each over its own x = rate t (n,).

    log_rate (s, 2): log rate and its deviation; curve (s, n): the rise over its law's own, 0 at first; held (s, n): the same with
    what is logged held as it was at the last reading used, which leads to the limit. doubt (s, J, n): columns whose amplitudes are
    standard normal, relative to the rise, in which the curve may be wrong. beside (s, k) [K] at beside_time (k,) [min after the
    first reading]: what is not proportional to the rise; beside_end (s,) [K] what it is in the limit.
    """

    log_rate: Array
    x: Array
    curve: Array
    held: Array
    doubt: Array
    beside_time: Array = field(default_factory=lambda: np.array([0.0, 1.0]))
    beside: Array | None = None
    beside_end: Array | None = None

    @cached_property
    def turns(self) -> Array:
        """X at which 95 % of each rise is done for good (s,)."""
        outside = np.abs(self.held - self.held[:, -1:]) > 0.05 * np.abs(self.held[:, -1:])
        last = self.held.shape[1] - 1 - np.argmax(outside[:, ::-1], axis=1)
        found = np.empty(len(self.held))
        for i, (place, line) in enumerate(zip(last.tolist(), self.held, strict=True)):
            k = min(place, len(line) - 2)
            here, there = abs(line[k] - line[-1]), abs(line[k + 1] - line[-1])
            share = (here - 0.05 * abs(line[-1])) / (here - there) if here > there else 1.0
            found[i] = self.x[k] + share * (self.x[k + 1] - self.x[k])
        return np.maximum(found, 1e-3)

    @cached_property
    def pace(self) -> Array:
        """How fast the 5 % that are left at `turns` fall there (s,), over the rate."""
        near = self.turns[:, None] * np.array([0.9, 1.1])
        left = np.array([np.interp(at, self.x, line[-1] - line) for at, line in zip(near, self.held, strict=True)])
        with np.errstate(all="ignore"):
            fall = np.log(left[:, 0] / left[:, 1]) / (near[:, 1] - near[:, 0])
        return np.clip(np.nan_to_num(fall, nan=1.0), 0.1, 10.0)

    def beyond_law(self, rate: Array, time: Array, asked: Asked) -> Array:
        """What the curve has beyond the law over the rate, (s, F, m + k), at rates (s, F) and the rows of :func:`shapes.law`."""
        of_law = np.expm1(-self.x)
        lines = zip(self.curve + of_law, self.held + of_law, strict=True)
        rows = [self._rows(*both, i, r, time, asked) / r[:, None] for i, (both, r) in enumerate(zip(lines, rate, strict=True))]
        found = np.stack(rows)
        found[..., len(time) + 1] = 0.0  # settling is counted from where the curve itself has 5 % left
        return found

    def doubts(self, time: Array, asked: Asked) -> Array:
        """Covariance (s, m + k, m + k) over the square of the rise, at the known rates."""
        found = []
        for i, columns in enumerate(self.doubt):
            rate = np.exp(self.log_rate[i, :1])
            rows = np.concatenate([self._rows(c, c, i, rate, time, asked) for c in columns])
            found.append(rows.T @ rows)
        return np.array(found)

    def beside_at(self, time: Array, asked: Asked) -> Array:
        """What is not proportional to the rise (s, m + k) [K]."""
        assert self.beside is not None
        assert self.beside_end is not None
        ends = self.beside_end[:, None]
        there, later = (np.array([np.interp(at, self.beside_time, line) for line in self.beside]) for at in (time, asked.times))
        settles = np.zeros_like(ends)  # counted from the limit with what is logged held
        return np.concatenate([there, ends, settles, 0.0 * ends, later], axis=1)

    def _rows(self, line: Array, held: Array, i: int, rate: Array, time: Array, asked: Asked) -> Array:
        """A line over x at the rows that are asked for (F, m + k), at rates (F,)."""
        there, later = (np.interp(rate[:, None] * at, self.x, line) for at in (time, asked.times))
        end = np.full((len(rate), 1), held[-1])
        late = np.interp(self.turns[i], self.x, held) - 0.95 * held[-1] - 0.05 * held[0]
        return np.concatenate([there, end, np.full_like(end, late), 0.0 * end, later], axis=1)
