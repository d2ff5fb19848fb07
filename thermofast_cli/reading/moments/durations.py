"""Elapsed times with their units between the numbers: 1h 02m 03s, 1h2m3s, PT1H2M3S, 62'03"."""

import re

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


def as_clock(cell: str) -> str | None:
    """``h:mm:ss``, with a fraction where there is one, of an elapsed time with its units; None of another cell."""
    found = _SPELT.match(cell) or _ISO.match(cell) or _SHORT.match(cell) or _PRIMES.match(cell)
    if found is None:
        return None
    parts = (float((part or "0").replace(",", ".")) for part in found.groups())
    whole, millionths = divmod(round(1e6 * sum(size * part for size, part in zip(_PARTS, parts, strict=True))), 1_000_000)
    fraction = f".{millionths:06d}".rstrip("0") if millionths else ""
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}{fraction}"
