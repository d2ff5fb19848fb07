"""Numbers and words of which the user said that they mean 'no reading'."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..moments.times import is_time_name
from ..run import Array
from ..tables.dialect import is_number
from ..tables.table import Table, words_or_numbers
from .carried import units_out_of_cells


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
