"""Constants that a file tells beside its readings: rows of limits and offsets beneath the names, factors of scale above them."""

import re
from collections.abc import Sequence

from ...errors import listed
from ..moments.stamps import looks_like_stamp
from ..run import Guess
from ..tables.dialect import Dialect, is_number, split, to_number

#: Rows beneath the names that are looked at, and readings that must follow.
_MOST, _FOLLOWING = 12, 3
#: What says that readings are to be multiplied, or shifted; at the beginning of a line.
_SCALES = re.compile(
    r"(?i)^[#%;\s\"]*(scale factor|scaling factor|scale|scaling|multiplier|gain|factor|faktor|skalierung|facteur|系数|比例)\b"
)
_SHIFTS = re.compile(r"(?i)^[#%;\s\"]*(zero offset|offset|shift|nullpunkt|bias|偏移)\b")


def kind_of(cell: str, decimal: str) -> str:
    """What the first cell of a row is: a number, a stamp, nothing, or words."""
    cell = cell.strip()
    if not cell:
        return "nothing"
    return "number" if is_number(cell, decimal) else "stamp" if looks_like_stamp(cell) else "words"


def without_rows_beneath(body: bytes, dialect: Dialect) -> tuple[bytes, list[str], list[str]]:
    """(text, notes, the lines left out): without rows right beneath the names that begin with words where all others begin with a
    number or a stamp: Min, Max, Offset. Empty lines stay in their place, so that errors name the lines of the file.
    """
    lines = body[: 1 << 16].split(b"\n")[: _MOST + 40]
    delimiter = "\t" if dialect.delimiter == " " else dialect.delimiter  # as blanks have become
    rows = [split(line.decode("utf-8", errors="replace").strip("\r"), delimiter) for line in lines]
    kinds = [kind_of(row[0], dialect.decimal) if len(row) == dialect.width else "" for row in rows]
    begins = next((i for i, kind in enumerate(kinds) if kind in ("number", "stamp")), 0)
    following = [kind for kind in kinds[begins:] if kind]
    above = [i for i in range(begins) if kinds[i]]
    if not above or len(above) > _MOST or len(following) < _FOLLOWING or not {"number", "stamp"} >= set(following):
        return body, [], []
    if any(kinds[i] != "words" for i in above):
        return body, [], []
    names = [rows[i][0].strip() for i in above]
    if any(re.search(r"\d", name) for name in names):
        return body, [], []  # an elapsed time may be written in many ways
    told = [lines[i].decode("utf-8", errors="replace") for i in above]
    rest = body[sum(len(line) + 1 for line in lines[:begins]) :]
    note = f"{len(above)} row{'s' if len(above) > 1 else ''} above the readings left out ({listed(names, 3)})"
    return b"\n" * begins + rest, [note], told


def not_applied(lines: Sequence[str], dialect: Dialect) -> list[Guess]:
    """Where a line tells a factor other than one, or an offset other than nought, the guess that the readings have it already."""
    found = []
    for pattern, none in ((_SCALES, 1.0), (_SHIFTS, 0.0)):
        for line in lines:
            said = pattern.match(line)
            cells = re.split(f"[:=\\s{re.escape(dialect.delimiter)}]+", line[said.end() :]) if said else []
            texts = [c.strip('"') for c in cells if is_number(c.strip('"'), dialect.decimal)]
            others = {v for v in (to_number(c, dialect.decimal) for c in texts) if v != none}
            if said and others:
                parts = round(1.0 / min(others), 6) if none and min(others) > 0.0 else 0.0
                way = f"--units '°C x{parts:g}' applies it" if parts >= 2.0 else "correct the readings where they have it not"
                found.append(Guess("unit", f"{said[1].strip()} {listed(texts, 3)}, told beside the readings, is in them", way))
    return found[:2]
