"""Clocks as programs write them: units between the numbers (1h 02m 03s, PT1H2M3S, 62'03"), milliseconds without leading zeros."""

import re
from collections.abc import Sequence
from itertools import pairwise

#: 1 d 2 hours 3 min 4.5 s: hours at least, so that 5 m is no time.
_SPELT = re.compile(
    r"(?i)(?:(\d+) ?d(?:ays?)?,? ?)?(\d+) ?h(?:rs?|ours?)?,? ?(?:(\d+) ?m(?:in(?:s|utes?)?)?,? ?)?"
    r"(?:(\d+(?:\.\d+)?) ?s(?:ec(?:s|onds?)?)?)?$"
)
#: As programs write them, each part only where it is not nought: ISO 8601, and Go's, whose first may be 0s.
_ISO = re.compile(r"P(?:(\d+)D)?T(?=\d)(?:(\d+)H)?(?:(\d+)M)?(?:(\d+(?:[.,]\d+)?)S)?$")
_SHORT = re.compile(r"()(?=\d)(?:(\d+)h)?(?:(\d+)m)?(?:(\d+(?:\.\d+)?)s)?$")
_PRIMES = re.compile(r"()(?:(\d+)h ?)?(\d+)['′] ?(\d{1,2}(?:[.,]\d+)?)(?:''|[\"″])$")
#: What tells from one cell that a column is written so.
LOOKS_SO = r"^P\d*D?T\d|^(?:\d+h)?\d+m\d+(?:\.\d+)?s$|^(?:\d+h ?)?\d+['′] ?\d"
_PARTS = (86400, 3600, 60, 1)
#: Stamps whose lengths tell whether it is worth to look.
SEEN = 2000
_FRACTION = re.compile(r"(.*:\d{2})[.,:](\d{1,3})(\D*)$")


def as_clock(cell: str) -> str | None:
    """``h:mm:ss``, with a fraction where there is one, of an elapsed time with its units; None of another cell."""
    found = _SPELT.match(cell) or _ISO.match(cell) or _SHORT.match(cell) or _PRIMES.match(cell)
    if found is None:
        return None
    parts = (float((part or "0").replace(",", ".")) for part in found.groups())
    whole, millionths = divmod(round(1e6 * sum(size * part for size, part in zip(_PARTS, parts, strict=True))), 1_000_000)
    fraction = f".{millionths:06d}".rstrip("0") if millionths else ""
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}{fraction}"


def padded(cells: Sequence[str]) -> list[str] | None:
    """Stamps (n,) with three digits of milliseconds, where only so they are in order; None where they are as they stand.

    13:59:49.50 is 50 ms after the second where .100 follows it.
    """
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
