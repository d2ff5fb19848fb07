"""When a record has done 95 % of a rise for good, by its readings: what was read is no matter of a model."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Times the 95 % interval of a mean within which the last of many that lie outside a band is found.
SURELY = 1.7
#: Usual steps between readings from which on nobody read.
GAP = 3.0
#: Readings whose median tells which of them is a stray, and from how many times the noise: three in a row may be strays.
NEAR, STRAY = 7, 6.0


def without_strays(line: Array, noise: float) -> Array:
    """Readings (n,) [K], each that lies far from the median of those about it replaced by that; noise [K] is their deviation."""
    if len(line) < NEAR:
        return line
    about = sliding_window_view(np.pad(line, NEAR // 2, mode="reflect"), NEAR)
    middle = np.median(about, axis=1)
    # At the ends of a curve its own slope is no stray.
    usual = np.sort(np.abs(np.diff(about, axis=1)), axis=1)[:, 1]
    found: Array = np.where(np.abs(line - middle) > STRAY * noise + NEAR // 2 * usual, middle, line)
    return found


@dataclass(frozen=True)
class Passing:
    """When one record passed 95 % of rises [K]: its readings (n,) [K] off where it began, at time (n,) [min] after that.

    wide: readings of the running mean that is looked at, an odd number; error [K]: half-width of that mean's own interval; early:
    whether it had risen before the law's exponential begins.
    """

    time: Array
    line: Array
    wide: int
    error: float
    early: bool

    @cached_property
    def step(self) -> float:
        """Usual time between readings [min]."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def mean(self) -> Array:
        """The running mean (n - wide + 1,)."""
        sums = np.concatenate([[0.0], np.cumsum(self.line)])
        found: Array = (sums[self.wide :] - sums[: -self.wide]) / self.wide
        return found

    def passed(self, rise: float, more: float = 0.0, both: bool = False) -> tuple[float, float] | None:
        """The last time outside, and the first from which 95 % of a rise, and `more` [K], is done for good; None if it is not.

        both: done is within 5 % on either side.
        """
        if not math.isfinite(rise):
            return None
        there = math.copysign(1.0, rise) * self.mean
        outside = there < 0.95 * abs(rise) + more
        if both:
            outside |= there > 1.05 * abs(rise) + more
        if outside[-1]:
            return None
        at = len(outside) - int(outside[::-1].argmax()) if outside.any() else 0
        middle, first = self.wide // 2, max(at - 1, 0)
        low, high = self.time[first + middle], self.time[at + middle]
        steps = np.diff(self.time[first : at + self.wide])
        if steps.max() > GAP * self.step:  # nobody read when it came
            gap = first + int(steps.argmax())
            low, high = min(low, self.time[gap]), max(high, self.time[gap + 1])
        return float(low), float(high)

    def correct(self, t95: Array, rises: Array, rate: Array) -> None:
        """Settling times (3,) put right in place; rises (3,) [K], the least, the middle and the largest; rate (3,) [1/min]."""
        elapsed, blur = float(self.time[-1]), self.step
        read, least = self.passed(float(rises[1]), both=True), self.passed(float(rises[0]), -self.error)
        most = self.passed(float(rises[2]), self.error)
        # From here on to a limit that was not reached: at the rate in the middle, and to each of them at the least rate.
        ahead = elapsed + self._left(float(rises[1])) / float(rate[1])
        slowest = max(self._left(float(r)) for r in rises) / float(rate[0])
        latest = max(t95[2], ahead, elapsed + slowest) if math.isfinite(rises[2]) else math.nan
        if read is not None:
            sooner, later = (self.passed(float(rises[1]), side * SURELY * self.error, both=True) for side in (-1.0, 1.0))
            begin, end = sooner[0] if sooner else read[0], later[1] if later else elapsed
            low, high = min(least[0] if least else read[0], read[0]), latest if most is None else max(most[1], read[1])
            inside = t95[0] - blur <= read[1] and not t95[2] < read[0] - blur
            agree = inside or (not self.early and begin - blur <= t95[1] <= end + blur)
            if not agree or high - low < t95[2] - t95[0]:
                t95[:] = low, 0.5 * (read[0] + read[1]), high
            elif not inside:  # the model is the more exact, if it is right: its interval holds what may have been read, too
                t95[0], t95[2] = min(t95[0], begin), max(t95[2], end)
        elif t95[1] < elapsed - blur:
            t95[:] = min(least[0] if least else elapsed, ahead), ahead, latest

    def _left(self, rise: float) -> float:
        """Time constants from the last readings on until 95 % of a rise are done."""
        share = abs(rise - float(self.mean[-1])) / (0.05 * abs(rise)) if rise else 1.0
        return math.log(max(share, 1.0)) if math.isfinite(share) else 0.0
