"""Columns by the names that users give them."""

import re
from collections.abc import Collection, Iterable
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

from ...errors import UsageError, listed, nearest
from ...reading_options import Options
from .labels import labelled


def check_names(wanted: Iterable[str], known: Iterable[str], option: str, run: str) -> None:
    """Raises UsageError for a name that is no column."""
    known = list(known)
    for name in wanted:
        if name not in known:
            several = _called(name, known)
            raise UsageError(
                f"{run}: {option} {name!r} is {'the name of several columns' if several else 'no column of this record'}",
                allowed=listed(several or known),
                do="say one in full" if several else nearest(name, known) or "use a name as it stands in the header",
            )


def _called(wanted: str, known: Iterable[str]) -> list[str]:
    """The columns that are called so before their unit, or whose label or channel is."""
    called = {n: {_before_unit(n), *(_before_unit(part) for part in labelled(n) or ())} for n in known}
    return [n for n, names in called.items() if wanted.casefold() in names]


def _before_unit(name: str) -> str:
    return re.sub(r"\s*[\[(].*$", "", name).strip(" ,").casefold()


def resolved(options: Options, known: list[str], readings: Collection[str]) -> Options:
    """Options whose names of columns are those of the record: ``T*`` all readings that begin so, ``front`` one ``front [degC]``.

    readings are the columns that a pattern may mean, numbers that are no time; only ``exclude`` may mean words as well. What is
    no column stays as it is, to be refused by name where it is used.
    """

    def every(wanted: Iterable[str], among: Collection[str] = readings) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for text in wanted for name in columns_named(text, known, among)))

    def before_sign(texts: Iterable[str]) -> tuple[str, ...]:
        told = []
        for name, sign, what in (text.rpartition("=") for text in texts):
            told += [f"{n}={what}" for n in columns_named(name.strip(), known, readings)] if sign else [what]
        return tuple(told)

    several: dict[str, Any] = {n: every(getattr(options, n)) for n in ("inputs", "channels")}
    several["exclude"] = every(options.exclude, known)
    several |= {n: before_sign(getattr(options, n)) for n in ("units", "rename")}
    return replace(options, ambient=column_named(options.ambient, known), **several)


def column_named(wanted: str | None, known: list[str]) -> str | None:
    """The one column that a text names, or the text itself."""
    return wanted if wanted is None else columns_named(wanted, known, ())[0]


def columns_named(wanted: str, known: list[str], readings: Collection[str]) -> tuple[str, ...]:
    """Columns that a text names: by the whole name, by a pattern with * or ?, or by the name before its unit; never none."""
    if wanted in known:
        return (wanted,)
    if "*" in wanted or "?" in wanted:
        pattern = wanted.replace("[", "[[]")
        return tuple(n for n in known if n in readings and fnmatchcase(n, pattern)) or (wanted,)
    bare = _called(wanted, known)
    return tuple(bare) if len(bare) == 1 else (wanted,)
