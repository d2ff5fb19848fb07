"""Temperatures in degC, whatever unit they were logged in; and what had to be guessed of it."""

import re

import numpy as np

from ..errors import InputError, UsageError, listed
from .columns import sign_of
from .run import Array, Guess, Options
from .tables.table import Table
from .units import parse_unit, to_celsius

#: Nothing in a test lab is colder [K]: a smaller number under a (K) is degC from a thermocouple of type K.
COLDEST_K = 170.0
#: A room in kelvin: a column without unit that begins here may be kelvin, or degC of something hot.
ROOM_K = (278.0, 318.0)


class Temperatures:
    """Converts the columns of one table and keeps what there is to say."""

    def __init__(self, table: Table, units: dict[str, str], options: Options) -> None:
        self._table, self._units = table, units
        self._all, self._own = _told(options.units, table)
        self._turned: dict[str, list[str]] = {}
        self._by_letter: dict[str, list[str]] = {}
        self._channels = frozenset(options.channels)

    def of(self, name: str, values: Array, is_input: bool = False) -> Array:
        """The column (N,) in degC.

        Raises
        ------
        InputError: its unit cannot be told.
        """
        symbol = self._own.get(name, self._all)
        if symbol is None:
            unit = sign_of(name, self._units.get(name, "")).unit
            symbol = unit.symbol if unit is not None and unit.temperature else None
            if unit is not None and symbol is not None and not unit.sure:
                if self._is_place(name):
                    symbol = None
                elif symbol != "C":
                    self._by_letter.setdefault(symbol, []).append(name)
            if symbol == "K" and not (np.isfinite(values).any() and float(np.nanmedian(values)) > COLDEST_K):
                symbol = "C"
            if symbol is None and not is_input:
                self._not_kelvin(name, values)
        if symbol in ("K", "F"):
            self._turned.setdefault(symbol, []).append(name)
        return to_celsius(values, symbol or "C")

    def _is_place(self, name: str) -> bool:
        """Whether T_F stands beside T_R, so that its letter is a place."""
        if not re.fullmatch(r"[Tt][ _][CKF]\d*", name):
            return False
        return any(re.fullmatch(r"[Tt][ _][A-Z]\d*", n) and n[2] not in "CKF" for n in self._table.names)

    def _not_kelvin(self, name: str, values: Array) -> None:
        good = values[np.isfinite(values)]
        first = sorted(good[:3].tolist())[len(good[:3]) // 2] if len(good) else 0.0
        if ROOM_K[0] <= first <= ROOM_K[1]:
            raise InputError(
                f"{self._table.name}: the unit of column {name!r} cannot be told",
                found=f"{first:g} to {good[-1]:g}, a room in kelvin or something hot in degC",
                allowed="a unit in the name, as in 'T [K]', or a unit line",
                do="say --units K or --units C"
                + ("" if self._table.header or self._channels else " (and --channels with the columns that are temperatures)"),
            )

    def notes(self) -> list[str]:
        words = {"K": "kelvin", "F": "degF"}
        return [f"{listed(who, 6)}: {words[s]}, turned into degC" for s, who in self._turned.items()]

    def guesses(self) -> list[Guess]:
        words = {"K": "kelvin", "F": "degF"}
        return [
            Guess("unit", f"{listed(who, 6)} read as {words[s]}, by the letter behind the name", "--units says otherwise")
            for s, who in self._by_letter.items()
        ]


def _told(units: tuple[str, ...], table: Table) -> tuple[str | None, dict[str, str]]:
    """(unit of all sensors, unit by column) as the user says.

    Raises
    ------
    UsageError: no unit of temperature, or no such column.
    """
    whole, own = None, {}
    for text in units:
        name, sign, letter = text.rpartition("=")
        unit = parse_unit(letter)
        if unit is None or not unit.temperature:
            raise UsageError(f"--units: {letter!r} is no unit of temperature", allowed="C, K or F, or COLUMN=C")
        if not sign:
            whole = unit.symbol
        elif name not in table.names:
            raise UsageError(f"{table.name}: --units {name!r} is no column of this record", allowed=listed(table.names))
        else:
            own[name] = unit.symbol
    return whole, own
