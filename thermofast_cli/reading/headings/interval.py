"""How far apart the rows of a table are, as a line above its names says: for a file that has no column of time."""

import re
from collections.abc import Sequence

from ..moments.epochs import UNITS
from ..values.time_units import unit_of

#: What is named so, in the words of loggers; a rate is a time there as often as a frequency.
_NAMED = (
    r"(?:sampl\w*|scan\w*|log(?:ging)?|record\w*|measur\w*|acquisition|abtast\w*|mess\w*|aufzeichnung\w*|acquisi\w*|chantillonnage)?"
    r"[\s_-]*(?:interval\w*|inter?valle?|rate|period\w*|takt|frequen\w*|time\s*step|pas|间隔|周期|采样间隔|采样周期|周期时间|サンプリング間隔|記録間隔)"
)
_LINE = re.compile(
    r"^[\s#%;,\"'*/]*(?:[\w.]+[\s_-]+)?" + _NAMED + r"[\s\"']*(?:[\[(]\s*(?P<before>[^\W\d]+)\s*[\])])?[\s:：=;,|\"']*"
    r"(?:(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}(?:[.,]\d+)?)|(?P<value>\d+(?:[.,]\d+)?)[\s\"';,]*(?P<unit>[^\W\d]+(?:/s)?)?)[\s\"';,]*$",
    re.I,
)
#: Characters of such a line, at most: a longer one is no line of a head, and would be costly to look through.
LONGEST = 120
_PER_SECOND = {"hz": 1.0, "khz": 1e3, "sa/s": 1.0, "s/s": 1.0, "samples/s": 1.0}


def interval_above(lines: Sequence[str]) -> tuple[float, str] | None:
    """(seconds between rows, the line) as lines above the names say it; None where none does, or several do not agree."""
    told = [(seconds, line.strip().strip(",;\t ")) for line in lines if (seconds := _seconds(line)) is not None]
    return told[0] if len({seconds for seconds, _ in told}) == 1 else None


def _seconds(line: str) -> float | None:
    found = _LINE.match(line) if len(line) <= LONGEST else None
    if found is None:
        return None
    if found["h"]:
        seconds = 3600.0 * int(found["h"]) + 60.0 * int(found["m"]) + float(found["s"].replace(",", "."))
        return seconds if seconds > 0.0 else None
    value, unit = float(found["value"].replace(",", ".")), (found["unit"] or found["before"] or "").lower()
    if not value > 0.0:
        return None
    if unit in _PER_SECOND:
        return 1.0 / (value * _PER_SECOND[unit])
    known = unit_of("", unit)
    return value * UNITS[known] if known else None
