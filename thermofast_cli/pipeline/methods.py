"""Filter names, presets and settings from the command line to a ready filter; plug-ins under the same check."""

from collections.abc import Iterable
from dataclasses import fields, replace
from typing import Any, get_args

import numpy as np

from thermofast.filters import PRINTED, Filter
from thermofast.models import Lump, PrintedLump
from thermofast.models.imperfection import TYPICAL, Imperfection, Rates
from thermofast.models.standards import Criterion, criterion_from
from thermofast.models.uncertainty.first_passage import Pace

from ..errors import UsageError, listed, nearest
from ..estimation.request import Method
from ..plugins.filters import filter_class, known_filters


def choose(
    name: str, preset: str | None, settings: tuple[str, ...], imperfection: Imperfection = TYPICAL, rates: Rates = "auto"
) -> Method:
    """The method for a filter name, ``paper`` or no preset, and ``filter.setting=value`` texts.

    Raises
    ------
    UsageError: an unknown filter, preset, setting or value; the message lists the known ones; or a machine's own sizes or shared
        rates with a filter whose estimate counts no machine.
    """
    if rates not in get_args(Rates):
        raise UsageError("rates: not one of what sensors may share", found=repr(rates), allowed=", ".join(get_args(Rates)))
    if preset not in (None, "paper"):
        raise UsageError(f"unknown preset {preset!r}", allowed="paper")
    known = known_filters()
    kind = filter_class(name, known) if isinstance(name, str) else None
    if kind is None:
        raise UsageError(
            f"unknown filter {name!r}",
            allowed=", ".join(known) + "; or a file, as in my_filter.py:MyFilter",
            do=(nearest(name, known) if isinstance(name, str) else "") or "see thermofast filters",
        )
    known = {**known, kind.name: kind}
    if preset == "paper":
        printed = {f.name: f for f in PRINTED}
        if name not in printed:
            raise UsageError(
                f"--preset paper does not apply to {name!r}", allowed=", ".join(printed), do="the paper prints only these"
            )
        chosen: Filter = printed[name]()
    else:
        chosen = kind()
    for text in settings:
        chosen = _set(chosen, text, known)
    _check_counted(chosen, preset, imperfection, rates)
    return Method(PrintedLump() if preset == "paper" else Lump(), chosen, imperfection=imperfection, rates=rates)


def _check_counted(chosen: Filter, preset: str | None, imperfection: Imperfection, rates: Rates) -> None:
    """Raises UsageError where a machine's own sizes or shared rates would be left out without a word."""
    own_sizes = imperfection != TYPICAL and not imperfection.none
    if chosen.closing != "never" or not (own_sizes or rates == "shared"):
        return
    what = " and ".join(n for n, given in (("--imperfection FILE", own_sizes), ("--rates shared", rates == "shared")) if given)
    used = f"--preset {preset}" if preset else f"--filter {chosen.name}"
    raise UsageError(
        f"{what} enters the closing estimate that counts the machine, which {used} does not make",
        do="leave one of them out; --imperfection none says that the readings alone are counted",
    )


def _set(chosen: Filter, text: str, known: dict[str, type[Filter]]) -> Filter:
    path, equals, value = text.partition("=")
    owner, dot, key = path.strip().partition(".")
    if not equals or not dot:
        raise UsageError(f"--set {text!r} is not of the form filter.setting=value", do="as in --set afukf.forgetting=0.95")
    if owner not in known:
        raise UsageError(f"--set {text!r}: unknown filter {owner!r}", allowed=", ".join(known))
    if owner != chosen.name:
        raise UsageError(f"--set {text!r} is for {owner}, and the filter of this run is {chosen.name}", do=f"add --filter {owner}")
    by_name = {f.name: f for f in fields(chosen)}
    if key not in by_name:
        raise UsageError(
            f"--set {text!r}: {owner} has no setting {key!r}",
            allowed=listed(by_name) or "none: this filter has no settings",
            do=f"see thermofast filters {owner}",
        )
    return replace(chosen, **{key: _value(text, value.strip(), by_name[key])})


def _value(text: str, value: str, field: Any) -> Any:
    if isinstance(field.default, bool):
        if value.lower() in ("true", "false"):
            return value.lower() == "true"
        raise UsageError(f"--set {text!r}: not a switch", found=repr(value), allowed="true or false")
    low, high = field.metadata["low"], field.metadata["high"]
    try:
        number = float(value)
    except ValueError:
        raise UsageError(f"--set {text!r}: not a number", found=repr(value), allowed=f"{low:g} to {high:g}") from None
    if not low <= number <= high:
        raise UsageError(f"--set {text!r}: out of range", found=f"{number:g}", allowed=f"{low:g} to {high:g}")
    if isinstance(field.default, int):
        if number != int(number):
            raise UsageError(f"--set {text!r}: not a whole number", found=f"{number:g}", allowed=f"{low:g} to {high:g}")
        return int(number)
    return number


def paces(text: str | None) -> tuple[Pace, ...]:
    """'60:1.3,30:1' as phases of 60 min at 1.3 times the rate and then of its own rate, the last of which lasts.

    Raises
    ------
    UsageError: not of that form, no duration above zero, or a factor below zero.
    """
    found = []
    for part in text.split(",") if text else ():
        minutes, _, factor = part.partition(":")
        try:
            pace = Pace(float(minutes), float(factor))
        except ValueError:
            pace = Pace(0.0, 0.0)
        if not (0.0 < pace.duration < 1e7 and 0.0 <= pace.factor < 1e3):
            raise UsageError(
                "--pace: not a list of phases", found=repr(part), allowed="MIN:FACTOR, both numbers, as in 60:1.3,30:1"
            )
        found.append(pace)
    return tuple(found)


def minutes_of(values: Iterable[float] | float, name: str) -> tuple[float, ...]:
    """Ascending minutes, each once, of one or several; `name` is what the caller called them.

    Raises
    ------
    UsageError: none, or one that is not above zero.
    """
    given: Any = (values,) if isinstance(values, int | float | np.number) and not isinstance(values, bool) else values
    try:
        if isinstance(given, str | bytes):  # "45" is no 4 and 5
            raise TypeError
        several = list(given)
        if any(isinstance(v, str | bytes | bool | np.bool_) for v in several):
            raise TypeError
        found = tuple(sorted({round(float(v), 9) for v in several}))
    except (TypeError, ValueError):
        allowed = "numbers above zero, as in [40, 45, 50]"
        raise UsageError(f"{name}: not a list of minutes", found=repr(values)[:60], allowed=allowed) from None
    if not found or not all(0.0 < v < 1e7 for v in found):
        raise UsageError(f"{name}: not a list of minutes", found=repr(found[:5]), allowed="numbers above zero, below 1e7")
    return found


def stopping_rule(text: Criterion | str | None) -> Criterion | None:
    """A stopping rule as ``--criterion`` takes it.

    Raises
    ------
    UsageError: no rule, and no preset.
    """
    if text is None or isinstance(text, Criterion):
        return text
    if not isinstance(text, str):
        raise UsageError("--criterion: no stopping rule", found=repr(text)[:60], allowed="a text, or a Criterion")
    try:
        return criterion_from(text)
    except ValueError as error:
        raise UsageError("--criterion: no stopping rule", found=repr(text), allowed=str(error)) from None
