"""Columns of whole numbers whose thousands are set apart by the sign that is no decimal one in the rest of the file."""

import re
from dataclasses import replace

import numpy as np

from ...errors import listed
from ..run import Guess
from ..signs import sign_of
from ..table import Table
from ..tables.dialect import is_missing

#: Whole numbers in groups of three, by the decimal sign of the file.
_GROUPED = {d: re.compile(rf"[+-]?(?:[1-9]\d{{0,2}}(?:[{o}]\d{{3}})+|\d{{1,3}})") for d, o in (".,", ",.")}


def with_thousands(table: Table) -> Table:
    """A text table in which a speed of ``1,500`` beside temperatures of ``23.4`` (or ``1.500`` beside ``23,4``) is a number.

    That is a guess, of columns that by their names or units are a speed, a power and the like: elsewhere both signs may be decimal
    ones. Where no other column shows a decimal sign nothing says which of both it is.
    """
    decimal = table.dialect.decimal if table.dialect is not None else ""
    words = {n: c for n, c in table.columns.items() if not isinstance(c, np.ndarray)}
    found = {n: told for n, c in words.items() if (told := _numbers(table, n, c, decimal)) is not None}
    if not decimal or not found or not _decimals_elsewhere(table):
        return table
    columns = table.columns | {n: np.array(values) for n, (values, _) in found.items()}
    first, cell = next((n, cell) for n, (_, cell) in found.items())
    sign = "," if "," in cell else "."
    number = cell.replace(sign, "")
    text = f"{listed(list(found), 4)}: {sign!r} stands between thousands ({cell!r} is {number})"
    way = f"export without it; --exclude {first!r} if it is a decimal sign"
    faults = {n: fault for n, fault in table.faults.items() if n not in found}
    return replace(table, columns=columns, faults=faults, guesses=(*table.guesses, Guess("unit", text, way)))


def _numbers(table: Table, name: str, cells: list[str], decimal: str) -> tuple[list[float], str] | None:
    """(the column in numbers, the first cell with a sign between thousands), where it is one of such numbers."""
    other = {".": ",", ",": "."}.get(decimal)
    sign = sign_of(name, table.units.get(name, ""))
    if other is None or sign.kind != "input" or (sign.unit is not None and sign.unit.temperature):
        return None
    told = {c: c.strip() for c in dict.fromkeys(cells) if not is_missing(c)}
    first = next((c for c in told.values() if other in c), None)
    if first is None or not all(_GROUPED[decimal].fullmatch(c) for c in told.values()):
        return None
    number = {raw: float(c.replace(other, "")) for raw, c in told.items()}
    return [number.get(c, np.nan) for c in cells], first


def _decimals_elsewhere(table: Table) -> bool:
    """Whether another column has numbers with a decimal sign, which tells it for the file."""
    numbers = [c for c in table.columns.values() if isinstance(c, np.ndarray)]
    return any(bool((np.isfinite(c) & (c % 1.0 != 0.0)).any()) for c in numbers)
