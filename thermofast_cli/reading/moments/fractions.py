"""Milliseconds that a program wrote without leading zeros: 13:59:49.50 is 50 ms after the second, and .100 follows it."""

import re
from collections.abc import Sequence
from itertools import pairwise

#: Stamps whose lengths tell whether it is worth to look.
SEEN = 2000
_FRACTION = re.compile(r"(.*:\d{2})[.,:](\d{1,3})(\D*)$")


def padded(cells: Sequence[str]) -> list[str] | None:
    """Stamps (n,) with three digits of milliseconds, where only so they are in order; None where they are as they stand."""
    lengths = {len(c) for c in cells[:SEEN]}
    if len(lengths) < 2 or max(lengths) - min(lengths) > 2 or _FRACTION.match(cells[0].strip()) is None:
        return None
    parts = [_FRACTION.match(c.strip()) for c in cells]
    if any(p is None for p in parts) or {len(p[2]) for p in parts if p} <= {3}:
        return None
    told = [(p[1], p[2]) for p in parts if p]
    within = [(a, b) for (one, a), (other, b) in pairwise(told) if one == other]
    falls = sum(float(f"0.{b}") < float(f"0.{a}") for a, b in within)
    if not falls or any(int(b) < int(a) for a, b in within):
        return None
    return [f"{p[1]}.{p[2]:0>3}{p[3]}" for p in parts if p]
