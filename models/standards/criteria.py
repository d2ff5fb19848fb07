"""Stopping rules of test standards: a temperature that changes by no more than so much, so often, so long.

The texts of the standards are not free. The presets are the rules as they are commonly read; docs/criteria.md names the source of
each. Buy the standard before you certify.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array

MINUTES = {"s": 1.0 / 60.0, "min": 1.0, "h": 60.0}
#: Points per window at which a rule is looked at.
POINTS = 60
#: Readings at each end of a window are averaged over this share of it, so that their noise does not decide.
AVERAGED = 0.1
#: Readings hide a change that they tell no better than to this share of it (1 sd), which is what a trip is known to in time
#: constants; noise of less than this share of the logger's step does not average it away.
SHOWN, DITHERED = 0.05, 0.4
#: A gap longer than so many windows tells nothing of what the temperature did in it.
LONGEST_GAP = 1.05


@dataclass(frozen=True)
class Criterion:
    """A change of at most change_k [K] over each of `windows` successive windows of window_min [min], and that for hold_min [min].

    text is how the rule is written, name what it was asked for by.
    """

    name: str
    text: str
    change_k: float
    window_min: float
    windows: int = 1
    hold_min: float = 0.0

    @property
    def length_min(self) -> float:
        """How long a record the rule looks back on [min]."""
        return self.windows * self.window_min + self.hold_min

    def times(self, first: float, last: float, points: int = POINTS) -> Array:
        """Times (n,) [min] at which a record from first to last is looked at: even, so many points per window."""
        step = self.window_min / points
        found: Array = np.arange(first, last + 1e-9 * step, step)
        return found

    def worst(self, time: Array, curves: Array, points: int = POINTS) -> tuple[Array, Array]:
        """(times (k,) [min], (..., k) [K]): the worst change that the rule looks back on, of curves (..., n) [degC] at even `time`
        (n,) of :meth:`times`; of no times where they are too short.
        """
        back = points
        none = time[:0], np.zeros((*curves.shape[:-1], 0))
        if len(time) <= self.windows * back:
            return none
        change = np.abs(curves[..., back:] - curves[..., :-back])
        n = change.shape[-1] - (self.windows - 1) * back
        worst = np.max([change[..., k * back : k * back + n] for k in range(self.windows)], axis=0)
        held = round(self.hold_min / self.window_min * back)
        if held:
            if n <= held:
                return none
            worst = np.lib.stride_tricks.sliding_window_view(worst, held + 1, axis=-1).max(axis=-1)
        return time[len(time) - worst.shape[-1] :], worst

    def trips(self, time: Array, curves: Array, points: int = POINTS, since: float | None = -np.inf) -> Array:
        """When the rule first holds (...,) [min] on curves (..., n) [degC] at even `time` (n,) of :meth:`times`; inf for never.

        Where a curve is nan the rule does not hold. Between two points the worst change is taken to run straight. since [min]: what
        holds before does not count; None: each curve from when it changed most.
        """
        at, worst = self.worst(time, curves, points)
        if not len(at):
            return np.full(curves.shape[:-1], np.inf)
        first_of = at[np.argmax(worst, axis=-1)][..., None] if since is None else since
        with np.errstate(invalid="ignore"):
            within: NDArray[np.bool_] = (worst <= self.change_k) & (at >= first_of)
        first = np.argmax(within, axis=-1)
        found: Array = np.where(within.any(axis=-1), self._crossed(at, worst, first), np.inf)
        return found

    def _crossed(self, at: Array, worst: Array, first: NDArray[np.intp]) -> Array:
        """When the worst change (..., k) at even times came down to the rule's, at `first` (...,) or just before it."""
        before = np.maximum(first - 1, 0)
        above, below = (np.take_along_axis(worst, k[..., None], -1)[..., 0] for k in (before, first))
        with np.errstate(all="ignore"):
            share = np.where((first > 0) & (above > below), (above - self.change_k) / (above - below), 1.0)
        step = at[1] - at[0] if len(at) > 1 else 0.0
        found: Array = at[first] - (1.0 - np.clip(np.nan_to_num(share, nan=1.0), 0.0, 1.0)) * step
        return found

    def observed(self, time: Array, reading: Array, start: float, together: float | None = None) -> float:
        """When readings (n,) [degC] at time (n,) [min] began to keep to the rule, as they still do at the last of them; inf if not.

        The ends of a window are means over a tenth of it, and the time is that in the middle of the last of them. together [min]:
        when all sensors of the run kept to it; what this one began to keep to then counts, whatever came later.
        """
        at, worst = self.worst(*self.means(time, reading, start))
        if not len(at):
            return float("inf")
        with np.errstate(invalid="ignore"):
            within = worst <= self.change_k
        k = len(at) - 1 if together is None else min(int(np.searchsorted(at, together - 1e-9)), len(at) - 1)
        if not within[k]:
            return float("inf")
        broken = np.flatnonzero(~within[:k])
        return float(self._crossed(at, worst, np.array(broken[-1] + 1 if len(broken) else 0)))

    def all_observed(self, time: Array, readings: Sequence[tuple[Array, Array]], start: float) -> float:
        """When all sensors first kept to the rule together, each of readings (n,) [degC] at its own times (n,) [min]; inf if never.

        time (m,) [min]: of the run. One that the heat has hardly reached keeps to any rule, until it has.
        """
        worst: Array | None = None
        for own, reading in readings:
            at, mine = self.worst(*self.means(own, reading, start, float(time[-1])))
            worst = mine if worst is None else np.maximum(worst, mine)
        if worst is None or not len(at):
            return float("inf")
        with np.errstate(invalid="ignore"):
            within = worst <= self.change_k
        return float(at[np.argmax(within)]) if within.any() else float("inf")

    def means(self, time: Array, reading: Array, start: float, last: float | None = None) -> tuple[Array, Array]:
        """Times (k,) [min] of :meth:`times` from start to last, and what readings (n,) at time (n,) are there.

        Means over a tenth of a window; nan where nothing was read.
        """
        wide = AVERAGED * self.window_min
        at = self.times(start, (float(time[-1]) if last is None else last) + 1e-9)
        if len(at) <= self.windows * POINTS:
            return at[:0], at[:0]
        sums, moments = (np.concatenate([[0.0], np.cumsum(column)]) for column in (reading, time))
        first, beyond = np.searchsorted(time, at - 0.5 * wide, "left"), np.searchsorted(time, at + 0.5 * wide, "right")
        # Readings that lie further apart than that are joined by straight lines.
        between = np.interp(at, time, reading)
        plain = np.where(at <= time[-1], between, np.nan)
        with np.errstate(all="ignore"):
            mean = np.where(beyond - first >= 2, (sums[beyond] - sums[first]) / (beyond - first), plain)
            # Few readings in a tenth of a window lie off its middle: carried there by the slope over half a window to either side.
            off = np.where(beyond - first >= 2, at - (moments[beyond] - moments[first]) / (beyond - first), 0.0)
        whole = (at - 0.5 * wide >= time[0]) & (at + 0.5 * wide <= time[-1])
        k = np.arange(len(at))
        before, after = np.maximum(k - POINTS // 2, 0), np.minimum(k + POINTS // 2, len(at) - 1)
        slope = (between[after] - between[before]) / (at[after] - at[before])
        mean = np.where(whole, mean + off * slope, plain)
        mean[self.unread(time, at)] = np.nan
        return at, mean

    def hidden(self, time: Array, noise: Array, step: Array) -> NDArray[np.bool_]:
        """Of sensors (S,) of that noise [K] and logger's step [K], whether their readings hide the change the rule asks for.

        Each end of a window is the mean of a tenth of it. Steps are averaged away only where the noise is larger than they are.
        """
        each = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
        several = max(AVERAGED * self.window_min / each, 1.0) if each > 0.0 else 1.0
        rounding = np.where(noise < DITHERED * step, step / np.sqrt(12.0), 0.0)
        found: NDArray[np.bool_] = np.sqrt(2.0) * np.hypot(noise / np.sqrt(several), rounding) > SHOWN * self.change_k
        return found

    def unread(self, time: Array, at: Array) -> NDArray[np.bool_]:
        """Which of the times `at` (n,) [min] lie in a gap between readings at `time` (m,) that is longer than a window."""
        after = np.clip(np.searchsorted(time, at, "left"), 1, len(time) - 1)
        inside = (at > time[after - 1]) & (at < time[after])
        found: NDArray[np.bool_] = inside & (time[after] - time[after - 1] > LONGEST_GAP * self.window_min)
        return found


#: name: (rule, the standard that it is read from).
PRESETS = {
    "iec60034-1": ("2K/h, 2x30min", "rotating electrical machines, thermal equilibrium"),
    "iec60076-2": ("1K/h + 3h", "liquid-immersed transformers, top liquid"),
    "ieee-c57.12.90": ("1K/3h", "liquid-immersed transformers, top liquid"),
    "iec62368-1": ("3K/30min", "audio, video and information equipment, steady state"),
    "iec62368-1-cool": ("1K/5min", "the same, where the temperature is at least 10 % below its limit"),
    "iec61439-1": ("1K/h", "low-voltage switchgear assemblies"),
    "iec60598-1": ("1K/h", "luminaires"),
    "iec60974-1": ("2K/h", "arc welding power sources"),
    "iec61010-1": ("2K/h", "laboratory equipment"),
    "iso1182": ("2K/10min", "non-combustibility of products, final temperature equilibrium"),
}

_NUMBER, _UNIT = r"(\d+(?:\.\d+)?)", r"(s|min|h)"
_RULE = re.compile(
    rf"^{_NUMBER}\s*K\s*(?:/|per)\s*(?:{_NUMBER}\s*)?{_UNIT}"
    rf"(?:\s*,\s*(\d+)\s*x\s*{_NUMBER}\s*{_UNIT})?"
    rf"(?:\s*\+\s*{_NUMBER}\s*{_UNIT})?$",
    re.IGNORECASE,
)


def criterion_from(text: str) -> Criterion:
    """A preset by its name, or a rule such as ``2K/h, 2x30min`` (at most 2 K/h over two windows of 30 min) or ``1K/h + 3h``.

    Raises
    ------
    ValueError: it is neither; the message says what is understood.
    """
    name = text.strip()
    rule = PRESETS.get(name.lower().replace(" ", ""), (name, ""))[0]
    found = _RULE.match(rule)
    if found is None:
        raise ValueError(f"a rule such as '2K/h, 2x30min' or '1K/h + 3h', or one of {', '.join(PRESETS)}")
    change, per, unit, count, length, length_unit, hold, hold_unit = found.groups()
    period = float(per or 1.0) * MINUTES[unit.lower()]
    window = float(length) * MINUTES[length_unit.lower()] if length else period
    held = float(hold) * MINUTES[hold_unit.lower()] if hold else 0.0
    if not (period > 0.0 and window > 0.0 and float(change) > 0.0 and (count is None or 1 <= int(count) <= 20)):
        raise ValueError("numbers above zero, and at most 20 windows")
    if held > 100.0 * window:
        raise ValueError("a hold of at most 100 windows")
    return Criterion(name, rule, float(change) * window / period, window, int(count or 1), held)
