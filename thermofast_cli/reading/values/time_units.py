"""What a column of time says of its unit."""

import re

from ...errors import InputError
from ..vocabulary import TIME_UNITS, words

#: Steps of a clock in brackets, as (100ms) and [x10 s]; minutes and seconds with a point between them.
_STEPS = re.compile(r"[\[(]\s*[x×*]?\s*(\d+(?:[.,]\d+)?)\s*[x×*]?\s*(us|ms|s|sec|min|h)\s*[\])]", re.I)
_MINUTES_SECONDS = re.compile(r"[\[(]\s*(?:min|mm|m)[.,](?:sec|ss|s)\s*[\])]", re.I)
_HOURS_MINUTES = re.compile(r"[\[(]\s*(?:h|hh|hr|hours?)\.(?:min|mm|m)\s*[\])]", re.I)
#: Parts of a unit, as 1/10 s and s/10; and a unit that is not one alone: a factor, a sum, two of them.
_PARTS = re.compile(r"(?:^|[\[(])\s*(?:1\s*/\s*(10+)\s*([a-z]+)|([a-z]+)\s*/\s*(10+))\s*(?:$|[\])])", re.I)
_IN_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
_MORE_THAN_A_UNIT = re.compile(r"[\d*×/]|\bx\b|half|halbe|step|schritt", re.I)
#: Words of a unit that counts from a moment, whose digits are no factor.
_FROM = re.compile(r"\b(since|from|after|seit|ab|depuis|desde|utc|gmt)\b|\d{4}-\d", re.I)


def unit_of(name: str, unit_cell: str = "") -> str | None:
    """Unit that a time column's name, or its cell in the unit line, tells: ``time_min`` -> ``min``."""
    said = words(name)
    said = said[: said.index("of")] if "of" in said else said  # seconds of the day are seconds
    for word in [w.strip("[](){} ") for w in (unit_cell.lower(),)] + said[::-1]:
        for unit, known in TIME_UNITS.items():
            if word in known:
                return unit
    return "s" if name == "X_Value" else None  # a LabVIEW measurement file says so in its definition


def steps_of(name: str, unit_cell: str) -> tuple[float, str] | None:
    """(size, unit) of the steps that a column of time counts, as its name or its cell in the unit line says; else None."""
    if step := _STEPS.search(name):
        return float(step[1].replace(",", ".")), unit_of(step[2]) or "s"
    part = _PARTS.search(name) or _PARTS.search(unit_cell)
    unit = unit_of("", part[2] or part[3]) if part else None
    return (1.0 / float(part[1] or part[4]), unit) if part and unit else None


def sixtieths(name: str) -> tuple[float, str, str] | None:
    """(seconds of a whole one, what these are, their sixtieths) of a clock with a point between, as min.sec, hh.mm; else None."""
    if _MINUTES_SECONDS.search(name):
        return 60.0, "minutes", "seconds"
    return (3600.0, "hours", "minutes") if _HOURS_MINUTES.search(name) else None


def one_unit_alone(source: str, name: str, unit_cell: str) -> None:
    """That the unit of a column of time has no factor and no second one beside it, which would be dropped.

    Raises
    ------
    InputError: it has.
    """
    found = _IN_BRACKETS.search(name)
    for told in (found[1] if found else "", unit_cell):
        units = [w for w in re.findall(r"[^\W\d_]+", told.lower()) if unit_of("", w)]
        if units and not _FROM.search(told) and (_MORE_THAN_A_UNIT.search(told) or len(units) > 1):
            raise InputError(
                f"{source}: column {name!r}: the unit of time is not one alone",
                found=repr(told.strip()),
                allowed=f"{', '.join(TIME_UNITS)}, 0.1 s, 1/10 s, x10 s, min.sec, hh.mm",
                do="--time-unit UNIT where the numbers count whole ones, --interval SECONDS where rows are evenly apart",
            )
