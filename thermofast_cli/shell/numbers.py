"""Numbers as options have them, with or without the unit that stands in their help: 90, 90min, 1.5h."""

import math
import re
from typing import Any

import click

#: By what an option's value is named in its help: the unit that it has, and what others are in that one.
UNITS: dict[str | None, tuple[str, dict[str, float]]] = {
    "MIN": ("min", {"s": 1.0 / 60.0, "min": 1.0, "h": 60.0, "d": 1440.0}),
    "SECONDS": ("s", {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}),
    "S": ("s", {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}),
    "K": ("K", {"mK": 1e-3, "K": 1.0}),
    "DEGC": ("degC", {"degC": 1.0, "°C": 1.0, "C": 1.0}),
}


class Real(click.types.FloatParamType):
    """Any finite number, with the option's unit or another of its kind beside it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number in the option's own unit."""
        unit, known = UNITS.get(param.metavar if param is not None else None, ("", {}))
        if isinstance(value, str):
            parts = re.fullmatch(r"\s*(\S*?)\s*([A-Za-z°]*)\s*", value)
            factor = known.get(parts[2], math.nan if parts[2] else 1.0) if parts else math.nan
            try:
                number = float(parts[1]) * factor if parts else math.nan
            except ValueError:
                number = math.nan
        else:
            number = float(value)
        if not math.isfinite(number):
            others = ", ".join(known)
            beside = f" in {unit}, or with its unit beside it ({others})" if unit else ""
            point = f"; do: write {value.replace(',', '.')}" if isinstance(value, str) and value.count(",") == 1 else ""
            self.fail(f"{value!r} is no number; allowed: {self.allowed()}{beside}{point}", param, ctx)
        return number

    def allowed(self) -> str:
        """Which numbers are, in words."""
        return "any"


class Finite(Real, click.FloatRange):
    """Such a number in a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number in the option's own unit."""
        number = Real.convert(self, value, param, ctx)
        return within(self, number, value, param, ctx)

    def allowed(self) -> str:
        """Which numbers are, in words."""
        return range_of(self)


class Whole(click.IntRange):
    """A whole number in a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number."""
        try:
            number = int(value)
        except ValueError:
            self.fail(f"{value!r} is no whole number; allowed: {range_of(self)}", param, ctx)
        return within(self, number, value, param, ctx)


Range = click.FloatRange | click.IntRange


def within(kind: Range, number: float, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
    """The number, of a range.

    Raises
    ------
    click.BadParameter: it is outside.
    """
    low, high = (-math.inf if kind.min is None else kind.min), (math.inf if kind.max is None else kind.max)
    under = number <= low if kind.min_open else number < low
    if under or number > high:
        kind.fail(f"{value} is outside what is allowed: {range_of(kind)}", param, ctx)
    return number


def range_of(kind: Range) -> str:
    """'above 0', '1 or more', '0 to 0.5' or 'above 0, to 0.5'."""
    if kind.max is None:
        return f"above {kind.min:g}" if kind.min_open else f"{kind.min:g} or more"
    return f"above {kind.min:g}, to {kind.max:g}" if kind.min_open else f"{kind.min:g} to {kind.max:g}"
