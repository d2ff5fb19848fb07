"""Temperatures in degC, whatever unit they were logged in; and what had to be guessed of it."""

import math
import re
import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError, UsageError, listed
from ...reading_options import Options
from ..run import Array, Guess
from ..signs import sign_of
from ..table import Table
from ..tables.dialect import is_missing, number_within
from ..units import Unit, parse_unit, platinum, to_celsius, unit_changes
from ..vocabulary import words
from .faults import HOTTEST_C

#: Nothing in a test lab is colder [K]: a smaller number under a (K) is degC from a thermocouple of type K.
COLDEST_K = 170.0
#: A room in kelvin: a column without unit that begins here may be kelvin, or degC of something hot.
ROOM_K = (278.0, 318.0)
#: A room in tenths of a degree, and the hottest that thousandths are taken for.
ROOM_TENTHS, MOST_MILLI = (130.0, 350.0), 200_000.0
#: A room in degF.
ROOM_F = (55.0, 95.0)
#: Machines begin warmer [degF]: below, the letter F alone may stand for a place or a type, as in "Bearing (F)" or D,F,F,F.
COLDEST_F = 40.0
#: How far apart [degF] a room in degC and machines in degF that are as cold as it begin at most.
BESIDE_ROOM_F = 5.0
#: A name and the letter that ends it, which may be a unit or a place.
ENDS = re.compile(r"(.*[A-Za-z0-9][ _]|[Tt]\d*)([A-Za-z])\d*")
#: How far apart such columns begin at most where they are a cold machine's in degF, and how many there are at least.
EVEN_F, FEWEST_EVEN = 1.8, 3
#: How what was turned into degC is called.
TURNED = {"K": "kelvin", "F": "degF", "R": "degrees Rankine"} | {f"Pt{n}": f"ohms of a Pt{n} (IEC 60751)" for n in (100, 500, 1000)}
#: Names and values of platinum resistors that were logged in ohms.
RESISTORS = frozenset(["pt", "rtd"])
OHMS = ((100.0, 130.0), (1000.0, 1300.0))
#: Readings on either side of a change of unit, and the least jump [K] that is looked at.
BEFORE_KEY, LEAST_KEY = 3, 8.0
#: A number with a decimal sign.
DECIMALS = re.compile(r"[+-]?\d+[.,]\d+")
#: A whole number, or one with a decimal sign.
_WITH_SIGN = re.compile(r"[+-]?\d+(?:[.,]\d+)?")
#: Numbers from 1 to 10 with three digits behind the sign in a column that may be of thousands, at least.
FEWEST_SMALL = 10
#: A column without unit that begins above this [degC], or at a room in degF, is told.
HOT_C = 120.0


class Temperatures:
    """Converts the columns of one table and keeps what there is to say."""

    def __init__(self, table: Table, units: dict[str, str], options: Options, names: Sequence[str]) -> None:
        self._table, self._units = table, units
        self._all, self._own = _told(options.units, table)
        self._turned: dict[str, list[str]] = {}
        self._scaled: dict[float, list[str]] = {}
        self._by_letter: dict[str, list[str]] = {}
        self._hot: list[str] = []
        self._begin: list[float] = []
        self._count = len(names)
        self._tenths = False
        self._cold: list[str] = []
        self._overruled: dict[str, list[str]] = {}
        #: Columns with a unit of their own that --units, said of all, leaves them.
        self.own_unit: list[str] = []
        self._room: float | None = None
        # Said of all it is meant for those without a unit, and puts one right only where all have one.
        self._all_say = self._all is not None and all(self._says_another(n, "") for n in names)
        self._channels = frozenset(options.channels)
        self._small: list[str] = []
        self._sign_told = options.decimal is not None or table.dialect is None
        self._common = _common_letter(names)
        ends = [m for m in map(ENDS.fullmatch, table.names) if m is not None and m[2].upper() not in "FC"]
        self._places = {m[1].rstrip("0123456789") for m in ends}

    def of(self, name: str, values: Array, is_input: bool = False) -> Array:
        """The column (N,) in degC.

        Raises
        ------
        InputError: its unit cannot be told.
        """
        if not is_input and not self._sign_told and _may_be_thousands(values, f"{self._table.name}, column {name!r}"):
            self._small.append(name)
        told = self._own.get(name) or self._of_all(name, values)
        symbol, scale = (told.symbol, told.scale) if told is not None else (None, 1.0)
        if symbol is not None and self._says_another(name, symbol):
            self._overruled.setdefault(symbol, []).append(name)
        if symbol is None:
            sign = sign_of(name, self._units.get(name, ""))
            unit = sign.unit
            scale = unit.scale if unit is not None else 1.0
            symbol = unit.symbol if unit is not None and unit.temperature else None
            if unit is not None and symbol is not None and not unit.sure:
                if self._is_place(name):
                    symbol = None
                elif symbol != "C":
                    self._by_letter.setdefault(symbol, []).append(name)
            if not is_input:
                self._refuse_place(name, values)
            if symbol == "K" and not (np.isfinite(values).any() and float(np.nanmedian(values)) > COLDEST_K):
                symbol = "C"
                if not is_input:
                    self._cold.append(name)
            if unit is None and self._common is not None and not is_input:
                symbol = self._common
                self._by_letter.setdefault(symbol, []).append(name)
            if symbol is None and not is_input and self._begins_as_degf(name, values):
                symbol = "F"
                self._by_letter.setdefault(symbol, []).append(name)
            if symbol is None and not is_input:
                self._plausible(name, values, sign.kind == "ambient")
        if scale != 1.0:
            self._scaled.setdefault(scale, []).append(name)
        self._note_room(name, values, symbol)
        if symbol in TURNED:
            self._turned.setdefault(symbol, []).append(name)
        return to_celsius(values, symbol or "C", scale)

    def _note_room(self, name: str, values: Array, symbol: str | None) -> None:
        begins = values[np.isfinite(values)][:1]
        if symbol == "C" and len(begins) and sign_of(name, self._units.get(name, "")).kind == "ambient":
            self._room = float(begins[0])

    def _says_another(self, name: str, symbol: str) -> bool:
        """Whether a column surely has a unit of temperature of its own that is not `symbol`."""
        unit = sign_of(name, self._units.get(name, "")).unit
        return unit is not None and unit.temperature and unit.sure and unit.symbol != symbol

    def _of_all(self, name: str, values: Array) -> Unit | None:
        """The unit that all sensors are said to have, where this column has none of its own beside others without."""
        own = self._all is not None and self._says_another(name, self._all.symbol)
        if self._all is None or self._all_say or not own or self._place_begins(name, values) is not None:
            return self._all
        self.own_unit.append(name)
        return None

    def _place_begins(self, name: str, values: Array) -> float | None:
        """Where a column under a bare F begins, if colder than any machine in degF; else None."""
        unit, begins = sign_of(name, self._units.get(name, "")).unit, values[np.isfinite(values)][:3]
        first = float(np.median(begins)) if len(begins) else COLDEST_F
        return first if unit is not None and unit.letter and unit.symbol == "F" and first < COLDEST_F else None

    def _refuse_place(self, name: str, values: Array) -> None:
        """Raises InputError for a column under a bare F that begins colder than any machine in degF."""
        first = self._place_begins(name, values)
        if first is not None:
            cold = (first - 32.0) / 1.8
            raise InputError(
                f"{self._table.name}: the unit of column {name!r} cannot be told",
                found=f"F, and a beginning at {first:.4g}: {cold:.3g} degC in degF; a place (front), a type (float)?",
                allowed="a unit with its sign, as in 'T [°F]' or 'T [°C]'",
                do="say --units C, or F",
            )

    def _is_place(self, name: str) -> bool:
        """Whether T_F stands beside T_R, so that its letter is a place."""
        if not re.fullmatch(r"[Tt][ _][CKF]\d*", name):
            return False
        return any(re.fullmatch(r"[Tt][ _][A-Z]\d*", n) and n[2] not in "CKF" for n in self._table.names)

    def _begins_as_degf(self, name: str, values: Array) -> bool:
        """Whether an F ends the name (T1_F, bearing_F) of a column that begins at a room in degF; beside T1_R it is no unit."""
        found = ENDS.fullmatch(name)
        if found is None or found[2] not in "Ff" or found[1].rstrip("0123456789") in self._places or self._is_place(name):
            return False
        good = values[np.isfinite(values)][:3]
        return bool(len(good) and ROOM_F[0] <= float(np.median(good)) <= ROOM_F[1])

    def _plausible(self, name: str, values: Array, ambient: bool) -> None:
        """Refuses a column without unit that begins where only another unit makes sense; tells one that begins very hot."""
        begins = [v for v in values[:3].tolist() if math.isfinite(v)]
        if len(begins) < 3:  # of most columns the first three readings are there
            begins = values[np.isfinite(values)][:3].tolist()
        if not begins:
            return
        first = sorted(begins)[len(begins) // 2]
        what, way = "", "say --units K, F or C"
        if first > HOTTEST_C and first.is_integer() and first < MOST_MILLI:
            raise InputError(
                f"{self._table.name}: the unit of column {name!r} cannot be told",
                found=f"{first:g} to {values[np.isfinite(values)][-1]:g}, thousandths of a degree?",
                allowed="a unit in the name, as in 'T [m°C]', or a unit line",
                do=f"say --units {shlex.quote(f'{name}=m°C')}, or --exclude it",
            )
        if ROOM_K[0] <= first <= ROOM_K[1]:
            what = "a room in kelvin or something hot in degC"
        elif ambient and ROOM_F[0] <= first <= ROOM_F[1]:
            what = "a room in degF or a hot chamber in degC"
        elif ambient and first >= ROOM_TENTHS[0]:
            what, way = "tenths of a degree, or a hot chamber in degC", "say --units '°C x10' where they are tenths, else C"
        elif any(low <= first <= high for low, high in OHMS) and RESISTORS.intersection(words(name)):
            what = "ohms of a platinum resistor or something hot in degC"
            way = f"say --units Pt{'100' if first < OHMS[1][0] else '1000'} for ohms, else C"
        if what:
            raise InputError(
                f"{self._table.name}: the unit of column {name!r} cannot be told",
                found=f"{first:g} to {values[np.isfinite(values)][-1]:g}, {what}",
                allowed="a unit in the name, as in 'T [K]', or a unit line",
                do=way
                + ("" if self._table.header or self._channels else " (and --channels with the columns that are temperatures)"),
            )
        if first > HOT_C or ROOM_F[0] <= first <= ROOM_F[1]:
            self._hot.append(f"{name} begins at {first:g}")
            if ROOM_F[0] <= first <= ROOM_F[1] and values[np.isfinite(values)][-1] > first + EVEN_F:
                # What is heated at once is degrees warmer by its third reading.
                self._begin.append(begins[0] if ROOM_F[0] <= begins[0] <= ROOM_F[1] else first)
            self._tenths |= first.is_integer() and ROOM_TENTHS[0] <= first <= ROOM_TENTHS[1]

    def notes(self) -> list[str]:
        """What was turned into degC."""
        told = [f"{listed(who, 6)}: {TURNED[s]}, turned into degC" for s, who in self._turned.items()]
        told += [f"{listed(who, 6)}: readings times {size:g}, as the unit says" for size, who in self._scaled.items()]
        told += [f"--units {s} overrules what the file says of {listed(who, 6)}" for s, who in self._overruled.items()]
        if self.own_unit:
            told.append(f"--units is for those without a unit: {listed(self.own_unit, 6)} kept its own; COLUMN=UNIT says another")
        return told

    def guesses(self) -> list[Guess]:
        """What had to be guessed of the units.

        Raises
        ------
        InputError: no column has a unit, and all begin within one kelvin at a room in degF, or at that of a room in degC, and rise.
        """
        low, high = min(self._begin, default=0.0), max(self._begin, default=0.0)
        even = len(self._begin) == self._count >= FEWEST_EVEN and high - low <= EVEN_F
        room = None if self._room is None else 1.8 * self._room + 32.0
        beside = bool(self._begin) and room is not None and room - BESIDE_ROOM_F < low <= high < room + BESIDE_ROOM_F
        if even or beside:
            who = f"all {len(self._begin)}" if even else f"{len(self._begin)} that"
            where = f"in degF beside a room of {self._room:.4g} degC" if beside else "in a room in degF"
            raise InputError(
                f"{self._table.name}: the unit of its temperatures cannot be told",
                found=f"{who} begin at {low:.4g} to {high:.4g}: {where}, or as evenly hot in degC",
                allowed="a unit in the names, as in 'T [F]', or a unit line",
                do="say --units F or C",
            )
        names = {"K": "kelvin", "F": "degF", "C": "degC"}
        found = [
            Guess("unit", f"{listed(who, 6)} read as {names[s]}, by the letter behind the name", "--units says otherwise")
            for s, who in self._by_letter.items()
        ]
        if self._small:
            text = f"{listed(self._small, 3)}: three digits behind the sign are decimals (1.205 is one and a fifth, not 1205)"
            found.append(Guess("unit", text, "--decimal confirms it; export without a sign of thousands if it is one"))
        if self._cold:
            text = f"{listed(self._cold, 3)}: too cold for kelvin, read as degC"
            found.append(Guess("unit", text, "--exclude it if it is a rise or a difference, --units C confirms it"))
        if self._hot:
            way = "--units C confirms it" + (", --units '°C x10' says that they are tenths" if self._tenths else "")
            found.append(Guess("unit", f"no unit, taken for degC: {listed(self._hot, 3)}", way))
        return found


def refuse_another_unit(columns: Sequence[Array], table: Table) -> None:
    """Raises InputError where all columns (N,) of a record jump at one row as from degC to degF, or back: a key was pressed.

    By 1.8 x + 32 to within what the steps about it are, which no machine does with several sensors at once.
    """
    if not columns or len(columns[0]) <= 2 * BEFORE_KEY:
        return
    least = np.full(len(columns[0]) - 1, np.inf)
    for c in columns:  # most records end at their first sensor
        if not np.isfinite(c).all():
            return
        least = np.minimum(least, np.abs(np.diff(c)))
        if not float(least.max()) >= LEAST_KEY:
            return
    at = int(least.argmax())
    if not BEFORE_KEY <= at < len(least) - BEFORE_KEY:
        return
    around = np.array([c[at - BEFORE_KEY : at + BEFORE_KEY + 2] for c in columns])
    steps = np.abs(np.diff(around, axis=1))
    about = np.delete(steps, BEFORE_KEY, axis=1).max(axis=1)
    if (about > 0.2 * steps[:, BEFORE_KEY]).any():
        return  # what jumps to and fro is a code of a broken probe
    before, after = around[:, BEFORE_KEY], around[:, BEFORE_KEY + 1]
    near = 3.0 * np.maximum(about, 0.1)
    for first, one, other in (("C", before, after), ("F", after, before)):
        if (np.abs(1.8 * one + 32.0 - other) <= 1.8 * near).all():
            second = "F" if first == "C" else "C"
            raise InputError(
                f"{table.name}, line {table.lines[at + 1] + 1}: the unit changes from deg{first} to deg{second}",
                found=f"{before[0]:g}, then {after[0]:g}",
                allowed="one unit in a record",
                do="split the file there, and say --units for each part",
            )


def winding_temperature(resistance: Array, told: Sequence[float]) -> Array:
    """Mean temperature (N,) [degC] of a winding: R / R0 (k + T0) - k (IEC 60034-1), told as (R0, T0 [degC], k [K])."""
    cold, at, k = told
    return resistance / cold * (k + at) - k


def _common_letter(names: Sequence[str]) -> str | None:
    """F or K where all temperatures, the room among them, end in it (``front_F``, ``rear_F``, ``room_F``): then it is no place."""
    ends = {m[1] if (m := re.fullmatch(r".*[A-Za-z][ _]([FK])", n.rstrip("0123456789_ "))) else "" for n in names}
    letter = ends.pop() if len(ends) == 1 else ""
    return letter if letter and len(names) >= 2 else None


def _told(units: tuple[str, ...], table: Table) -> tuple[Unit | None, dict[str, Unit]]:
    """(unit of all sensors, unit by column) as the user says.

    Raises
    ------
    UsageError: no unit of temperature, or no such column.
    """
    whole, own = None, dict[str, Unit]()
    for text in units:
        name, sign, letter = text.rpartition("=")
        unit = platinum(letter) or parse_unit(letter)
        if unit is None or not unit.temperature:
            raise UsageError(
                f"--units: {letter!r} is no unit of temperature",
                allowed="C, K or F, degR, m°C, mK, '°C x10' for tenths, Pt100 or Pt1000 for ohms, or COLUMN=C",
            )
        if not sign:
            whole = unit
        elif name not in table.names:
            raise UsageError(f"{table.name}: --units {name!r} is no column of this record", allowed=listed(table.names))
        else:
            own[name] = unit
    return whole, own


def unit_told(name: str, options: Options, table: Table, by_name: bool = False) -> str:
    """The unit that the user says a column of temperatures has, if any; `by_name`: of that column, and not of all."""
    whole, own = _told(options.units, table)
    unit = own.get(name, None if by_name else whole)
    return unit.symbol if unit is not None else ""


def warm_inputs(inputs: Sequence[str], units: Mapping[str, str], options: Options, table: Table) -> list[str]:
    """Those of the inputs that are temperatures, by unit, name, or as the user says."""
    return [n for n in inputs if sign_of(n, units.get(n, "")).temperature or unit_told(n, options, table, by_name=True)]


def winding(ohms: Array, column: str, table: Table, options: Options) -> Array:
    """Temperatures (N,) [degC] of a winding.

    Raises
    ------
    InputError: they are those of no winding: R0 is of another unit than the column.
    """
    found = winding_temperature(ohms, options.resistance)
    middle = float(np.nanmedian(found)) if np.isfinite(found).any() else 20.0
    if not -100.0 <= middle <= 800.0:
        unit = table.units.get(column) or getattr(sign_of(column, "").unit, "symbol", "")
        raise InputError(
            f"{table.name}, column {column!r}: --resistance makes {middle:.4g} degC of it",
            found=f"{float(np.nanmedian(ohms)):.4g} {unit}, R0 {options.resistance[0]:g}",
            allowed="R0 in the unit of the column",
            do=f"say R0 in {unit}" if unit else "check R0 and T0",
        )
    return found


def _may_be_thousands(values: Array, where: str) -> bool:
    """Whether all numbers lie from 1 to 10 and have three digits behind the sign, which may be one of thousands.

    Raises
    ------
    InputError: whole numbers of three digits stand beside them, as 999 before 1.003.
    """
    good = np.abs(values[np.isfinite(values)])
    odd, whole = good[good % 1.0 != 0.0], good[good % 1.0 == 0.0]
    thousands = np.rint(1000.0 * odd)
    small = len(odd) >= FEWEST_SMALL and bool(((odd >= 1.0) & (odd < 10.0) & (np.abs(1000.0 * odd - thousands) < 1e-6)).all())
    if not small or not (thousands % 10.0 != 0.0).any():
        return False
    if len(whole) and 100.0 <= float(whole.max()) < 1000.0:
        raise InputError(
            f"{where}: a sign of thousands",
            found=f"{whole.max():.0f} and {odd[0]:.3f}",
            allowed="numbers without one",
            do="export plain numbers; --decimal says which sign is the decimal one",
        )
    return not len(whole) or float(whole.max()) < 10.0


def refuse_words(table: Table, column: str) -> None:
    """Raises InputError for a column of words that are no reading in a column of temperatures, as ``(21.01)``, or that are numbers
    with another decimal sign than the rest; empty cells say nothing.
    """
    unit = sign_of(column, table.units.get(column, "")).unit
    cells = [c for c in table.columns[column] if isinstance(c, str) and not is_missing(c)]
    if not cells:
        return
    decimal = table.dialect.decimal if table.dialect is not None else "."
    within = [w[2] for c in dict.fromkeys(cells) if (w := number_within(c, decimal))]
    told = {u.symbol: text for text in within if (u := parse_unit(text)) is not None and u.temperature}
    if len(told) > 1:
        raise unit_changes(f"{table.name}, column {column!r}", told.values())
    numbers = [c for c in cells if DECIMALS.fullmatch(c.strip())]
    other = next((c.strip() for c in numbers if ("," in c) == (table.dialect is None or table.dialect.decimal == ".")), None)
    if other is not None and (2 * len(numbers) > len(cells) or all(_WITH_SIGN.fullmatch(c.strip()) for c in cells)):
        sign = "," if "," in other else "."
        raise InputError(
            f"{table.name}, column {column!r}: numbers with another decimal sign than the rest of the file",
            found=repr(other),
            allowed="one decimal sign in a file",
            do=f"say --decimal {sign} if that is the sign of the readings, mend its cells, or say --exclude {column!r}",
        )
    if unit is not None and unit.temperature:
        raise InputError(
            f"{table.name}, column {column!r}: no number in a column of temperatures",
            found=repr(cells[0]),
            allowed="numbers, empty cells, or a known word for 'no reading' (NaN, OL, ---, ...)",
            do=f"mend its cells, or say --exclude {column!r}",
        )
