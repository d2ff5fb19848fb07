"""How imperfect a lab's machines are: the prior of the discrepancy as a person writes it, ``[imperfection]`` of a TOML file."""

import math
import tomllib
from collections.abc import Sequence
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
    "lean": (0.0, 0.95),
    "scale_spread": (0.05, 3.0),
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
    if not isinstance(named, str | Path):
        raise UsageError(
            "imperfection: not a prior", found=repr(named), allowed=f"{', '.join(KNOWN)}, a TOML file, or an Imperfection"
        )
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
        elif key == "factors":
            changes[key] = _factors(value, source)
        elif key in NUMBERS:
            changes[key] = _number(f"{source}: {key}", value, *NUMBERS[key])
        else:
            raise UsageError(f"{source}: unknown key {key} in [imperfection]", allowed=_allowed(), do=nearest(key, NUMBERS))
    return replace(TYPICAL, **changes)


def _sizes(table: Any, source: str) -> dict[str, float]:
    if not isinstance(table, dict):
        raise UsageError(f"{source}: [imperfection] background is not a table", allowed=f"background.KEY of {', '.join(SIZES)}")
    for name in table:
        if name not in SIZES:
            raise UsageError(f"{source}: unknown key background.{name}", allowed=", ".join(SIZES), do=nearest(name, SIZES))
    return {name: _number(f"{source}: background.{name}", size, 0.0, 10.0) for name, size in table.items()}


def _factors(value: Any, source: str) -> tuple[tuple[float, float], ...]:
    what = f"{source}: factors"
    if not isinstance(value, list) or not value or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        raise UsageError(f"{what} is no list of pairs", allowed="[[TIME CONSTANTS, FACTOR], ...]")
    pairs = [(_number(what, turn, 1e-3, 1e3), _number(what, factor, 0.01, 100.0)) for turn, factor in value]
    if sorted({turn for turn, _ in pairs}) != [turn for turn, _ in pairs]:
        raise UsageError(f"{what} is out of order", found=repr(value), allowed="time constants ascending, each once")
    return tuple(pairs)


def write_imperfection(path: str, prior: Imperfection, learnt_from: Sequence[str]) -> None:
    """The prior as a table [imperfection] that :func:`read_imperfection` reads; what is as in the typical one is left out.

    Raises
    ------
    UsageError: another suffix than .toml, or a place that cannot be written.
    """
    from ..output.files import check_target, write_text_whole

    check_target(path, (".toml",))
    lines = [f"# How imperfect the machines of this lab are: learnt by thermofast calibrate from {len(learnt_from)} complete runs."]
    lines += [f"#   {name}" for name in learnt_from]
    lines += ["# For: thermofast identify --imperfection THIS FILE. Not for machines of another kind.", "", "[imperfection]"]
    lines += [f"{key} = {getattr(prior, key):g}" for key in NUMBERS if getattr(prior, key) != getattr(TYPICAL, key)]
    sizes = [(name, getattr(prior.background, name)) for name in SIZES]
    lines += [f"background.{name} = {size:g}" for name, size in sizes if size != getattr(TYPICAL.background, name)]
    if prior.factors:
        lines.append(f"factors = [{', '.join(f'[{turn:g}, {factor:.4g}]' for turn, factor in prior.factors)}]")
    write_text_whole(path, "\n".join(lines) + "\n")


def _number(what: str, value: Any, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or not least <= value <= most:
        raise UsageError(f"{what} is not such a number", found=repr(value), allowed=f"{least:g} to {most:g}")
    return float(value)


def _allowed() -> str:
    return f"{', '.join(NUMBERS)}, and background.KEY of {', '.join(SIZES)}"
