"""Stopping rules of test standards: a temperature that changes by no more than so much, so often, so long.

The texts of the standards are not free. The presets are the rules as they are commonly read; docs/criteria.md names the source of
each. Buy the standard before you certify.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array

MINUTES = {"s": 1.0 / 60.0, "min": 1.0, "h": 60.0}
#: Points per window at which a rule is looked at.
POINTS = 60
#: Readings at each end of a window are averaged over this share of it, so that their noise does not decide.
AVERAGED = 0.1
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

    def trips(self, time: Array, curves: Array, points: int = POINTS) -> Array:
        """When the rule first holds (...,) [min] on curves (..., n) [degC] at even `time` (n,) of :meth:`times`; inf for never.

        Where a curve is nan the rule does not hold. Between two points the worst change is taken to run straight.
        """
        back = points
        if len(time) <= self.windows * back:
            return np.full(curves.shape[:-1], np.inf)
        change = np.abs(curves[..., back:] - curves[..., :-back])
        n = change.shape[-1] - (self.windows - 1) * back
        worst = np.max([change[..., k * back : k * back + n] for k in range(self.windows)], axis=0)
        held = round(self.hold_min / self.window_min * back)
        if held:
            if n <= held:
                return np.full(curves.shape[:-1], np.inf)
            worst = np.lib.stride_tricks.sliding_window_view(worst, held + 1, axis=-1).max(axis=-1)
        at = time[len(time) - worst.shape[-1] :]
        with np.errstate(invalid="ignore"):
            within: NDArray[np.bool_] = worst <= self.change_k
        first = np.argmax(within, axis=-1)
        found: Array = np.where(within.any(axis=-1), at[first], np.inf)
        before = np.maximum(first - 1, 0)
        above, below = (np.take_along_axis(worst, k[..., None], -1)[..., 0] for k in (before, first))
        with np.errstate(all="ignore"):
            share = np.where((first > 0) & (above > below), (above - self.change_k) / (above - below), 1.0)
        trips: Array = found - (1.0 - np.clip(np.nan_to_num(share, nan=1.0), 0.0, 1.0)) * (time[1] - time[0])
        return trips

    def observed(self, time: Array, reading: Array, start: float) -> float:
        """When readings (n,) [degC] at time (n,) [min] first kept to the rule after `start`; inf where they do not yet.

        The ends of a window are means over a tenth of it, and the time is that in the middle of the last of them.
        """
        wide = AVERAGED * self.window_min
        at = self.times(start, float(time[-1]) + 1e-9)
        if len(at) <= self.windows * POINTS:
            return float("inf")
        sums, moments = (np.concatenate([[0.0], np.cumsum(column)]) for column in (reading, time))
        first, beyond = np.searchsorted(time, at - 0.5 * wide, "left"), np.searchsorted(time, at + 0.5 * wide, "right")
        # Readings that lie further apart than that are joined by straight lines.
        plain = np.interp(at, time, reading)
        with np.errstate(all="ignore"):
            mean = np.where(beyond - first >= 2, (sums[beyond] - sums[first]) / (beyond - first), plain)
            # Few readings in a tenth of a window lie off its middle: carried there by the slope over half a window to either side.
            off = np.where(beyond - first >= 2, at - (moments[beyond] - moments[first]) / (beyond - first), 0.0)
        whole = (at - 0.5 * wide >= time[0]) & (at + 0.5 * wide <= time[-1])
        k = np.arange(len(at))
        before, after = np.maximum(k - POINTS // 2, 0), np.minimum(k + POINTS // 2, len(at) - 1)
        slope = (plain[after] - plain[before]) / (at[after] - at[before])
        mean = np.where(whole, mean + off * slope, plain)
        mean[self.unread(time, at)] = np.nan
        return float(self.trips(at, mean[None])[0])

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
