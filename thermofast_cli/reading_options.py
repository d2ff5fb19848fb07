"""What the user may say about how a file is to be read, from the command line or from Python."""

import codecs
import csv
import io
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any, TypedDict

from .errors import UsageError

#: Words for delimiters that a shell or a settings file cannot well hold.
DELIMITERS = {"tab": "\t", "\\t": "\t", "blank": " ", "space": " "}
#: A winding is cold at a temperature between these [degC] when R0 is measured.
COLD = -60.0, 200.0
#: Where the resistance of copper would be nothing, minus that in degC.
COPPER = 235.0
#: The same of any conductor, least and greatest.
CONSTANT = 100.0, 1000.0
#: Options that keep a file from filling the memory.
LIMITS = ("max_bytes", "max_rows", "max_columns")
#: Options of few values, texts, numbers with their least; names on the command line where they are others.
CHOICES = {"time_unit": ("ns", "us", "ms", "s", "min", "h", "d"), "decimal": (".", ",")}
TEXTS = ("time", "time_format", "tz", "ambient", "delimiter", "encoding", "sheet")
LEAST = {"interval_s": 1e-9, "header_line": 0, "from_min": 0.0, "to_min": 1e-9}
SPOKEN = {"interval_s": "interval", "from_min": "from", "to_min": "to"}
#: Options that are lists.
SEVERAL = ("inputs", "channels", "exclude", "missing", "units", "rename")


@dataclass(frozen=True)
class Options:
    """The user's word against the rules; None leaves a thing to its rule."""

    time: str | None = None
    time_unit: str | None = None
    time_format: str | None = None
    tz: str | None = None
    interval_s: float | None = None
    ambient: str | None = None
    inputs: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    header_line: int | None = None
    sheet: str | None = None
    long: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    rename: tuple[str, ...] = ()
    resistance: tuple[float, ...] = ()
    skip_footer: int = 0
    strict: bool = False
    from_min: float | None = None
    to_min: float | None = None
    max_bytes: int = 2 << 30
    max_rows: int = 20_000_000
    max_columns: int = 100_000


class ReadingOptions(TypedDict, total=False):
    """The same as keywords of the functions, for type checkers and editors; a list may be one text with commas between."""

    time: str | None
    time_unit: str | None
    time_format: str | None
    tz: str | None
    interval_s: float | str | None
    interval: float | str | None
    ambient: str | None
    inputs: str | Sequence[str]
    channels: str | Sequence[str]
    exclude: str | Sequence[str]
    missing: str | Sequence[str]
    delimiter: str | None
    decimal: str | None
    encoding: str | None
    header_line: int | None
    sheet: str | int | None
    long: str | Sequence[str]
    units: str | Sequence[str] | Mapping[str, str]
    rename: str | Sequence[str] | Mapping[str, str]
    resistance: str | Sequence[float]
    skip_footer: int
    strict: bool
    from_min: float | str | None
    to_min: float | str | None
    max_bytes: int
    max_rows: int
    max_columns: int


def options_from(given: Mapping[str, Any]) -> Options:
    """Options by their names on the command line; a list is a list or one text with commas between.

    Raises
    ------
    UsageError: an option that is not known, or a value that cannot be.
    """
    given = {"interval_s" if key == "interval" else key: value for key, value in given.items()}
    known = [f.name for f in fields(Options)]
    for key in given:
        if key not in known:
            raise UsageError(f"unknown option of reading {key!r}", allowed=", ".join(known))
    given |= {key: _as_list(given[key]) for key in SEVERAL if key in given}
    for key, value in given.items():
        _check(key, value)
    given |= {key: _names_of(key, given.get(key)) for key in SEVERAL}
    for text in given["rename"]:
        if not all(part.strip() for part in text.rpartition("=")):
            raise UsageError("--rename: not a name and a new one", found=repr(text), allowed="OLD=NEW, as T1=spindle_front")
    given["long"] = _long(given.get("long"))
    given["resistance"] = _resistance(given.get("resistance"))
    given["delimiter"] = _delimiter(given.get("delimiter"))
    given["strict"] = bool(given.get("strict"))
    _check_span(given.get("from_min"), given.get("to_min"))
    return Options(**_whole_numbers(given))


def _as_list(value: Any) -> Any:
    """What is told of several columns, as a tuple: {"T1": "F"} as T1=F."""
    if isinstance(value, Mapping):
        return tuple(f"{name}={told}" for name, told in value.items())
    return tuple(value) if isinstance(value, Iterable) and not isinstance(value, str) else value


def _names_of(key: str, value: Any) -> tuple[str, ...]:
    """The names of an option that takes several.

    Raises
    ------
    UsageError: it is there, and empty.
    """
    if isinstance(value, str) and not value.strip():
        option = f"--{SPOKEN.get(key, key).replace('_', '-')}"
        do = f"name some, or leave {option} out"
        raise UsageError(f"{option} is empty", found=repr(value), allowed="names with commas between", do=do)
    return names(value)


def _delimiter(told: str | None) -> str | None:
    """The character that parts cells, of one told by its name."""
    delimiter = DELIMITERS.get(told, told) if told else None
    if delimiter is not None and (len(delimiter) != 1 or not delimiter.isascii()):
        raise UsageError("--delimiter: one character", found=repr(delimiter), allowed="one character, 'tab' or 'blank'")
    return delimiter


def _check_span(first: float | None, last: float | None) -> None:
    """Raises UsageError where minutes to read do not ascend."""
    if first is not None and last is not None and not first < last:
        raise UsageError("--to is not after --from", found=f"from {first:g} to {last:g} min", allowed="minutes that ascend")


def _whole_numbers(given: dict[str, Any]) -> dict[str, Any]:
    """The options with limits and lines to leave out as whole numbers, those left out as by default.

    Raises
    ------
    UsageError: one is none.
    """
    kept = {key: value for key, value in given.items() if not (key in LIMITS and value is None)}
    for key in LIMITS:
        if key in kept and not (isinstance(kept[key], Integral) and int(kept[key]) > 0):
            raise UsageError(f"--{key.replace('_', '-')}: not a limit", found=repr(kept[key]), allowed="a whole number above zero")
    skipped = given.get("skip_footer") or 0
    if not (isinstance(skipped, Integral) and int(skipped) >= 0):
        raise UsageError("--skip-footer: not a number of lines", found=repr(skipped), allowed="0 or more")
    return kept | {"skip_footer": skipped}


def spoken(options: Options) -> str:
    """What a command line says to read in the same way: the options that are not left to their rules, ready for a shell."""
    said = []
    for f in fields(Options):
        value, option = getattr(options, f.name), f"--{SPOKEN.get(f.name, f.name).replace('_', '-')}"
        if value == f.default:
            continue
        if isinstance(value, tuple):
            value = joined(f"{v:.10g}" if isinstance(v, float) else v for v in value)
        elif f.name == "delimiter":
            value = next((word for word, sign in DELIMITERS.items() if sign == value and word.isalpha()), value)
        elif isinstance(value, float):
            value = f"{value:.10g}"
        if value is True:
            said.append(option)
        else:  # what begins with a hyphen would be taken for an option
            said.append(f"{option}{'=' if str(value).startswith('-') else ' '}{shlex.quote(str(value))}")
    return " ".join(said)


def _check(key: str, value: Any) -> None:
    """Raises UsageError where a value is not of the kind of its option."""
    if value is None:
        return
    if key in SEVERAL:
        fine = isinstance(value, str) or (isinstance(value, tuple) and all(isinstance(v, str) for v in value))
        allowed = "a text, or a list of texts"
    elif key in CHOICES:
        fine, allowed = value in CHOICES[key], " ".join(CHOICES[key])
    elif key in TEXTS:
        fine, allowed = isinstance(value, str), "a text"
    elif key in LEAST:
        kind, words = (Integral, "a whole number") if key == "header_line" else (Real, "a number")
        number = isinstance(value, kind) and not isinstance(value, bool)
        fine, allowed = number and math.isfinite(value) and value >= LEAST[key], f"{words} from {LEAST[key]:g} on"
    elif key == "strict":
        fine, allowed = isinstance(value, bool), "True or False"
    else:
        return
    if fine and key == "encoding":
        try:
            codecs.lookup(value)
        except (LookupError, ValueError):
            fine, allowed = False, "a name as utf-8 or cp1252"
    if not fine:
        option = key if key == "strict" else f"--{SPOKEN.get(key, key).replace('_', '-')}"
        raise UsageError(f"{option}: not understood", found=repr(value)[:60], allowed=allowed)


def names(several: str | Iterable[str] | None) -> tuple[str, ...]:
    """'A, B' or a list as ('A', 'B'); a name that holds a comma stands in quotes, or in a list."""
    if isinstance(several, str):
        parts = next(csv.reader([several], skipinitialspace=True), [])
        return tuple(part.strip() for part in parts if part.strip())
    return tuple(several or ())


def joined(several: Iterable[str]) -> str:
    """Names as one text that :func:`names` takes apart again."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(several)
    return text.getvalue()


def _resistance(given: str | Iterable[float] | None) -> tuple[float, ...]:
    """``R0,T0`` or ``R0,T0,k`` as three numbers; k is copper's where it is not told."""
    if not given:
        return ()
    try:
        found = [float(part) for part in (given.split(",") if isinstance(given, str) else given)]
    except (TypeError, ValueError):
        found = []
    found = [*found, COPPER] if len(found) == 2 else found
    if len(found) != 3 or not all(math.isfinite(v) for v in found) or found[0] <= 0.0 or found[1] + found[2] <= 0.0:
        raise UsageError(
            "--resistance: not a resistance and its temperature",
            found=repr(given),
            allowed="R0,T0 or R0,T0,k as in 1.84,21.5: R0 above zero, in the column's unit, T0 degC, k 235 for copper",
        )
    if not COLD[0] <= found[1] <= COLD[1]:
        raise UsageError(
            f"--resistance: R0 was not measured at {found[1]:g} degC",
            found=repr(given),
            allowed=f"T0 from {COLD[0]:g} to {COLD[1]:g} degC",
            do="say T0 in degC" if found[1] > COLD[1] else "",
        )
    if not CONSTANT[0] <= found[2] <= CONSTANT[1]:
        raise UsageError(
            f"--resistance: k of {found[2]:g} is no conductor's",
            found=repr(given),
            allowed=f"R0,T0,k with k from {CONSTANT[0]:g} to {CONSTANT[1]:g}: 235 for copper, 225 for aluminium",
            do="write decimals with a point, as in 1.5,20" if isinstance(given, str) and given.count(",") > 1 else "",
        )
    return tuple(found)


def _long(given: str | Iterable[str] | None) -> tuple[str, ...]:
    """``SENSOR,VALUE`` as two names; a comma within one is written in quotes."""
    if not given:
        return ()
    several = given if isinstance(given, Iterable) else ()
    parts = tuple(p.strip() for p in next(csv.reader([given]))) if isinstance(given, str) else tuple(several)
    if len(parts) != 2 or not all(isinstance(p, str) and p for p in parts):
        raise UsageError(
            "--long: not two columns", found=repr(given), allowed="SENSOR,VALUE, or A+B,VALUE where two columns name the sensor"
        )
    return parts
