"""What stands in cells beside a number: a unit that every cell of a column carries, and what the user said means 'no reading'."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..moments.stamps import looks_like_stamp
from ..moments.time_column import is_time_name
from ..run import Array
from ..table import Table, words_or_numbers
from ..units import parse_unit
from .dialect import is_missing, is_number, number_within


def units_out_of_cells(table: Table) -> Table:
    """A table of numbers and words by type, columns of cells with their unit as numbers of that unit."""
    columns, units = dict(table.columns), dict(table.units)
    for n, cells in table.columns.items():
        if isinstance(cells, np.ndarray):
            continue
        for decimal in ".,":
            plain, unit = with_unit(cells, decimal, frozenset())
            numbers = words_or_numbers(plain) if unit else cells
            if isinstance(numbers, np.ndarray):
                columns[n], units[n] = numbers, units.get(n) or unit
                break
    return replace(table, columns=columns, units=units)


def with_unit(cells: list[str], decimal: str, more: frozenset[str]) -> tuple[list[str], str]:
    """The numbers of cells that all carry one unit (``21.3 °C``, ``temp=47.2'C``), and that unit; else the cells as they are."""
    first = next((c for c in cells if not is_missing(c, more) and not is_number(c, decimal)), None)
    if first is None or looks_like_stamp(first):
        return cells, ""
    told = [c for c in cells if not is_missing(c, more) and not is_number(c, decimal)]
    found = {c: number_within(c, decimal) for c in dict.fromkeys(told)}
    forms = Counter((f[0], f[2]) for f in found.values() if f)
    if len(forms) != 1 or sum(f is None for f in found.values()) > 0:
        return cells, ""
    (before, after), _ = forms.most_common(1)[0]
    unit = after or before.rstrip("=: ")
    if not (parse_unit(after) or (before and not after)):
        return cells, ""
    return [f[1] if (f := found.get(c)) else c for c in cells], unit


def without(values: Array, missing: frozenset[str], column: str) -> Array:
    """Numbers that the user said mean 'no reading' (85, -999) as nan; the time may be 0 all the same."""
    if not missing:
        return values
    numbers = [] if is_time_name(column) else [float(m) for m in missing if is_number(m, ".")]
    return np.where(np.isin(values, numbers), np.nan, values) if numbers else values


def without_told(table: Table, missing: Sequence[str]) -> Table:
    """A table of numbers and words by type, without what the user said means 'no reading'."""
    if not missing:
        return units_out_of_cells(table)
    more = frozenset(m.lower() for m in missing)
    columns: dict[str, Array | list[str]] = {}
    for n, cells in table.columns.items():
        if isinstance(cells, np.ndarray):
            columns[n] = without(cells, more, n)
        else:
            told = ["" if cell.strip().lower() in more else cell for cell in cells]
            columns[n] = words_or_numbers(told) if told != cells else cells
    return units_out_of_cells(replace(table, columns=columns))
