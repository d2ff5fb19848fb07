"""What the results of a folder depend on, as a command and the library tell it alike."""

import os
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

from ..reading.source import content_of
from ..reading_options import LIMITS, SEVERAL, Options, options_from

#: How an option that is off, or none, is told.
NOT = "no"
#: What decides whether a file is read at all, and not what is read in it; and where the results are.
ASIDE = frozenset({*LIMITS, "details"})


def settings_of(told: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, str]:
    """Options that are not as they are by default, as text: numbers as numbers, files with the hash of what is in them."""
    names = {n: getattr(options_from({n: v}), n) for n, v in told.items() if n in SEVERAL}  # as 'a,b', or as a list
    found = {name: _as_text(names.get(name, value)) for name, value in sorted(told.items()) if name not in ASIDE}
    usual = {name: _as_text(value) for name, value in defaults.items()}
    return {name: text for name, text in found.items() if text != usual.get(name, NOT)}


def defaults_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Options of a function of the library and of reading as they are where nobody says otherwise."""
    found = {f.name: f.default for f in fields(Options) if f.default is not MISSING}
    found |= {p.name: p.default for p in signature(function).parameters.values() if p.default is not Parameter.empty}
    return found | {"start": "auto"}


def _as_text(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return "yes" if value else NOT
    if isinstance(value, int | float):
        return f"{value:.15g}"
    if isinstance(value, Mapping):
        return " ".join(f"{name}={_as_text(one)}" for name, one in sorted(value.items()))
    if isinstance(value, list | tuple | set):
        return " ".join(_as_text(one) for one in value)
    return with_content(os.fspath(value) if isinstance(value, os.PathLike) else str(value))


def with_content(word: str) -> str:
    """A word; with the hash of what is in it where it is a file, or a class in one."""
    path = word.rpartition(":")[0] if ".py:" in word else word
    return f"{word} (sha256 {content_of(path)[0][:16]})" if Path(path).is_file() else word
