"""How imperfect a lab's machines are: the prior of the discrepancy as a person writes it, ``[imperfection]`` of a TOML file."""

import math
import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from thermofast.models.imperfection import NONE, TYPICAL, Imperfection, Sizes

from ..errors import UsageError, nearest

KNOWN = {"typical": TYPICAL, "none": NONE}
#: Numbers of the prior that a file may set: (least, most).
NUMBERS = {
    "multiplier": (0.0, 100.0),
    "strong_share": (0.0, 0.9),
    "rate_spread": (1e-4, 1.0),
    "log_rate_spread": (0.01, 3.0),
    "apart": (0.0, 0.9),
    "clean": (0.0, 0.99),
}
SIZES = tuple(f.name for f in fields(Sizes))


def read_imperfection(named: "str | Imperfection") -> Imperfection:
    """``typical``, ``none`` or the table [imperfection] of a TOML file; a prior is given back as it is.

    Raises
    ------
    UsageError: no such file, not TOML, no such table, an unknown key, or a number out of its range.
    """
    if isinstance(named, Imperfection):
        return named
    if named in KNOWN:
        return KNOWN[named]
    try:
        raw = tomllib.loads(Path(named).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        allowed = f"{', '.join(KNOWN)}, or a TOML file with a table [imperfection]"
        advice = nearest(named, KNOWN) or "check the name"
        raise UsageError(f"--imperfection {named}: no such file", allowed=allowed, do=advice) from None
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{named}: not valid TOML", found=str(error), do="mend the line") from None
    table = raw.get("imperfection")
    if not isinstance(table, dict):
        raise UsageError(f"{named}: no table [imperfection]", found=", ".join(raw) or "an empty file", allowed=_allowed())
    return prior_from(table, named)


def prior_from(table: dict[str, Any], source: str) -> Imperfection:
    """The typical prior with what a table [imperfection] says otherwise.

    Raises
    ------
    UsageError: an unknown key, or a value that is no number in its range.
    """
    changes: dict[str, Any] = {}
    for key, value in table.items():
        if key == "background":
            changes["background"] = replace(TYPICAL.background, **_sizes(value, source))
        elif key in NUMBERS:
            changes[key] = _number(f"{source}: {key}", value, *NUMBERS[key])
        else:
            raise UsageError(f"{source}: unknown key {key} in [imperfection]", allowed=_allowed(), do=nearest(key, NUMBERS))
    return replace(TYPICAL, **changes, name=source)


def _sizes(table: Any, source: str) -> dict[str, float]:
    if not isinstance(table, dict):
        raise UsageError(f"{source}: [imperfection] background is not a table", allowed=f"background.KEY of {', '.join(SIZES)}")
    for name in table:
        if name not in SIZES:
            raise UsageError(f"{source}: unknown key background.{name}", allowed=", ".join(SIZES), do=nearest(name, SIZES))
    return {name: _number(f"{source}: background.{name}", size, 0.0, 10.0) for name, size in table.items()}


def _number(what: str, value: Any, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or not least <= value <= most:
        raise UsageError(f"{what} is not such a number", found=repr(value), allowed=f"{least:g} to {most:g}")
    return float(value)


def _allowed() -> str:
    return f"{', '.join(NUMBERS)}, and background.KEY of {', '.join(SIZES)}"
