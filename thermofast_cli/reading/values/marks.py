"""Columns of marks beside readings: which of them say that a reading is none."""

import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import listed
from ..moments.time_column import is_time_name
from ..run import Array, Guess
from ..table import Table
from ..vocabulary import MARK_FAULTS as FAULTS
from ..vocabulary import MARK_QUALITIES as QUALITIES
from ..vocabulary import MARK_STATES as STATES
from ..vocabulary import MARK_VALIDITIES as VALIDITIES
from ..vocabulary import MARKS, VALUES

#: OPC's classic codes: good from, bad below; and all that there are in use.
GOOD, BAD_BELOW = 192.0, 64.0
CLASSIC = frozenset([0, 4, 8, 12, 16, 20, 24, 28, 64, 68, 80, 84, 88, 192, 216])
#: OPC UA's codes are bad from here on; below, 0 is good.
UA_BAD = 2.0**31
_ANY_MARK = re.compile("|".join(sorted(MARKS, key=len, reverse=True)), re.I)
_HEX = re.compile(r"0[xX][0-9a-fA-F]{1,8}")
#: Words of marks. A state that has none of the good ones (run, idle) is one of the machine.
GOOD_WORDS = frozenset(["ok", "good", "valid", "gut", "gültig", "normal", "true", "0", "1", "o.k.", "none", "no error", "g"])
BAD_WORDS = (
    *("bad", "invalid", "ungültig", "fault", "fail", "error", "fehler", "open", "short", "broken", "bruch", "disconnect", "nok"),
    *("sensor break", "sensor broken", "sensor fault", "sensor fail", "sensor error", "sensor open", "sensor short", "no sensor"),
    *("not connected", "no data", "comm fail", "comm err", "comm loss", "communication", "timeout", "stale", "out of", "schlecht"),
    *(f"{side}{gap}{what}" for side in ("over", "under") for gap in ("", " ", "-") for what in ("range", "flow", "load")),
)
#: What may stand behind a sensor's name in that of its readings.
VALUE_ENDINGS = VALUES | {"", "temp", "temperature", "c", "f", "k", "degc", "degf"}


def good_readings(table: Table) -> Table:
    """A wide table without the readings that a column of marks beside them (``T2 Quality`` for ``T2``) says are none."""
    if not _ANY_MARK.search("\n".join(table.names)):
        return table  # of thousands of sensors none is looked at
    marks = {n: owned for n in table.names if (owned := _owner(n)) is not None}
    alone = sum(not owner for owner, _ in marks.values()) == len(marks) == 1  # one mark alone is the whole row's
    columns, notes, guesses = dict(table.columns), list(table.notes), list(table.guesses)
    for n, (owner, kinds) in marks.items():
        if not owner and not alone:
            continue
        mine = [m for m in table.names if m not in marks and isinstance(columns[m], np.ndarray) and not is_time_name(m)]
        mine = [m for m in mine if not owner or (_stem(m).startswith(owner) and _stem(m)[len(owner) :] in VALUE_ENDINGS)]
        bad = bad_by(kinds, table.columns[n], of_row=not owner)
        if mine and owner and bad is None and len(told := np.unique(table.columns[n])) > 1:
            held = listed([v if isinstance(v, str) else f"{v:g}" for v in told.tolist()], 4)
            text = f"what {n!r} says of {listed(mine, 4)} is not known ({held}): readings kept"
            guesses.append(Guess("marks", text, f"mend the readings, or --exclude {n!r}"))
        if not mine or bad is None:
            continue
        if bad.all():
            notes.append(f"{listed(mine, 4)}: every reading is marked as bad by {n!r}: kept")
            continue
        for m in mine if bad.any() else []:
            columns[m] = np.where(bad, np.nan, columns[m])
            notes.append(f"{m}: {int(bad.sum())} readings that {n!r} marks as bad left out")
    return replace(table, columns=columns, notes=tuple(notes), guesses=tuple(guesses))


def good_only(table: Table, value: Array) -> tuple[Array, int]:
    """Readings (n,) of a long table with nan where a column of marks says that they are none, and how many those are."""
    for n in table.names:
        owned = _owner(n)
        bad = bad_by(owned[1], table.columns[n], of_row=True) if owned is not None and not owned[0] else None
        if bad is not None and bad.any() and not bad.all():
            return np.where(bad, np.nan, value), int(bad.sum())
    return value, 0


def unsure(table: Table) -> tuple[Guess, ...]:
    """What to say of a long table whose marks of quality have words that are neither good nor bad, as ``Uncertain``."""
    for n, marks in table.columns.items():
        owned = _owner(n)
        if owned is None or owned[0] or not owned[1] & QUALITIES or isinstance(marks, np.ndarray):
            continue
        if all(map(_HEX.fullmatch, marks)):
            continue
        odd = sorted({c.strip() for c in marks} - {c for c in marks if not c or c.strip().lower() in GOOD_WORDS})
        odd = [c for c in odd if not c.lower().startswith(BAD_WORDS)]
        if odd:
            return (Guess("marks", f"readings that {n!r} marks as {listed(odd, 3)} are kept", "take those rows out to be sure"),)
    return ()


def bad_by(kinds: frozenset[str], marks: Array | list[str], of_row: bool) -> NDArray[np.bool_] | None:
    """Which readings a column of marks says are none (n,); None where what it holds is no mark that is known.

    kinds are the words of its name. Marks are OPC's codes of quality (192 is good, below 64 is bad; of OPC UA 0 is good, from 2**31
    is bad), 1 or 0 for valid or for a fault, or words. ``of_row``: the marks are those of all readings of a row, where a state may
    be the machine's.
    """
    if not isinstance(marks, np.ndarray) and marks and all(_HEX.fullmatch(c.strip()) for c in marks):
        marks = np.array([float(int(c, 16)) for c in marks])
    if not isinstance(marks, np.ndarray):
        told = [c.strip().lower() for c in marks]
        if kinds & FAULTS and set(told) <= {"true", "false", "", "0", "1"}:
            faulty = np.array([c in ("true", "1") for c in told])
            return faulty if faulty.mean() < 0.5 else None
        if kinds & (VALIDITIES | QUALITIES) and set(told) <= {"true", "false", "", "0", "1"}:
            return np.array([c in ("false", "0") for c in told])
        wrong = {c: c.startswith(BAD_WORDS) and c not in GOOD_WORDS for c in set(told)}
        known = all(b or c in GOOD_WORDS or not c for c, b in wrong.items())
        sure = bool(kinds & (QUALITIES | VALIDITIES))
        if not sure and not any(c in GOOD_WORDS for c in wrong):
            return None
        return np.array([wrong[c] for c in told]) if known or not of_row or sure else None
    if not np.isfinite(marks).all() or not len(marks) or marks.min() < 0.0 or (marks % 1.0 != 0.0).any():
        return None
    values = set(np.unique(marks).tolist())
    if marks.max() >= UA_BAD and kinds & (QUALITIES | STATES):
        return np.asarray(marks >= UA_BAD)
    if kinds & QUALITIES and marks.max() >= GOOD and (values <= CLASSIC or (kinds - {"q"} and marks.max() <= 255.0)):
        return np.asarray(marks < BAD_BELOW)
    if kinds & VALIDITIES and values <= {0.0, 1.0}:
        return np.asarray(marks == 0.0)
    # A fault that is there in most rows is no fault of the sensor.
    if kinds & FAULTS and not of_row and 0.0 in values and (marks == 0.0).mean() > 0.5:
        return np.asarray(marks != 0.0)
    return None


def _owner(name: str) -> tuple[str, frozenset[str]] | None:
    """Of a column of marks the bare name of the sensor that it is of, empty for a whole row, and the words that it is marked by."""
    parts = re.sub(r"(?i)status[ _]?code", "statuscode", re.sub(r"[\[(].*", "", name))
    parts = re.sub(r"([a-z0-9])(?=[A-Z][a-z])", r"\1 ", parts)
    words = [w for w in re.split(r"[\W_]+", parts.lower()) if w]
    kinds = set()
    while words and words[-1] in MARKS and not (words[-1] == "q" and len(words) == 1):
        kinds.add(words.pop())
    while words and not kinds and words[0] in MARKS and len(words) > 1:
        kinds.add(words.pop(0))
    return ("".join(words), frozenset(kinds)) if kinds else None


def _stem(name: str) -> str:
    """A name without unit, signs and gaps."""
    return re.sub(r"[\W_]", "", re.sub(r"[\[(].*", "", name.lower()))
