"""Tables in which each sensor has a column of time of its own."""

import re
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...reading_options import Options
from ..moments.stamps import DAY_S, parse_stamps
from ..moments.time_column import is_time_name
from ..run import Array
from ..table import Table
from ..values.time_units import unit_of
from ..vocabulary import TIME, TIME_UNITS, words

#: Clocks that are never further apart than this share of the record are one: a time constant is not known so well.
ALIKE = 1e-3
#: Readings of a clock that has no name of one.
FEWEST = 10


def with_one_clock(table: Table, options: Options) -> Table:
    """Columns that each have a clock beside them, as rows of one clock: nan where a row is another's.

    The table as it is where there is one clock, where the user says which, or where it cannot be told whose a column is.
    """
    if options.time is not None or options.interval_s is not None or options.long:
        return table
    table = _called_time(table)
    clocks = _clocks(table)
    owned = _owners(table, clocks) if len(clocks) > 1 else None
    if owned is None:
        return table
    seconds = _seconds(table, clocks)
    if seconds is None:
        return table
    seconds = [_until_it_ends(s) for s in seconds]
    good = [np.isfinite(s) for s in seconds]
    if any(np.unique(s[g]).size < max(2, g.sum()) for s, g in zip(seconds, good, strict=True)):
        return table  # no clock: it stands still, or tells a moment twice
    main, length = seconds[0], float(np.ptp(seconds[0][good[0]]))
    apart = [np.abs(s - main) if np.array_equal(g, good[0]) else np.inf for s, g in zip(seconds, good, strict=True)]
    if max(float(np.nanmax(a)) for a in apart) <= ALIKE * length:
        columns = {n: c for n, c in table.columns.items() if n not in clocks[1:]}
        note = f"{len(clocks)} clocks within {100 * ALIKE:g} % of the record of each other, read as {clocks[0]!r}"
        return replace(table, names=list(columns), columns=columns, notes=(*table.notes, note), clocks=tuple(clocks))
    moments, first = np.unique(np.concatenate([s[g] for s, g in zip(seconds, good, strict=True)]), return_index=True)
    rows = np.concatenate([np.flatnonzero(g) for g in good])[first]
    source = np.concatenate([np.full(int(g.sum()), k) for k, g in enumerate(good)])[first]
    columns = {clocks[0]: _picked([table.columns[n] for n in clocks], source, rows)}
    for k, members in enumerate(owned):
        places = np.searchsorted(moments, seconds[k][good[k]])
        for n in members:
            columns[n] = _spread_over(table.columns[n], good[k], places, len(moments))
    note = f"{len(clocks)} clocks, each of the columns beside it: {len(moments)} moments in all"
    lines = np.asarray(table.lines)[rows].tolist()
    return replace(table, names=list(columns), columns=columns, lines=lines, notes=(*table.notes, note), clocks=tuple(clocks))


def clocks_of_columns(table: Table) -> list[str]:
    """Clocks that are called after the column beside them, and not time: ``t_front``, ``front``; two of them at least."""
    found = []
    for a, b in pairwise(table.names):
        if a[:2] not in ("t ", "t_"):
            continue
        column = table.columns[a]
        bare = re.sub(r"\s*[\[(].*$", "", b).strip().casefold()
        if a[2:].casefold() == bare and isinstance(column, np.ndarray):
            told = column[np.isfinite(column)]
            if len(told) > FEWEST and (np.diff(told) > 0.0).all():
                found.append(a)
    return found if len(found) > 1 else []


def _called_time(table: Table) -> Table:
    """A table in which such clocks are called time as well."""
    new = {n: f"time {n[2:]}" for n in clocks_of_columns(table)}
    if not new or any(n in table.names for n in new.values()):
        return table
    columns = {new.get(n, n): c for n, c in table.columns.items()}
    return replace(table, names=list(columns), columns=columns, units={new.get(n, n): u for n, u in table.units.items()})


def _clocks(table: Table) -> list[str]:
    """Columns of time of one kind, of which some differ: of one name, or all there are, each named after the column beside it.

    Where another column tells the time of all, what is named after its neighbour is how long that ran.
    """
    timed = [n for n in table.names if is_time_name(n)]
    if len(timed) < 2:
        return []
    kind = {n: (isinstance(table.columns[n], np.ndarray), unit_of(n, table.units.get(n, ""))) for n in timed}

    def differ(same: list[str]) -> bool:
        return len(same) > 1 and any(not _equal(table.columns[n], table.columns[same[0]]) for n in same)

    for name in timed:
        same = [n for n in timed if _stem(n) == _stem(name) and kind[n] == kind[name]]
        if differ(same):
            return same
    alike = len(set(kind.values())) == 1
    own = alike and (all(_of_neighbour(table, n) for n in timed) or _of_other_lengths(table, timed))
    return timed if own and differ(timed) else []


def _of_other_lengths(table: Table, timed: list[str]) -> bool:
    """Whether numeric clocks (Time fast, Time slow) end at different rows, with nothing behind: none tells of all rows."""
    ends = []
    for column in (table.columns[n] for n in timed):
        if not isinstance(column, np.ndarray):
            return False
        there = np.isfinite(column)
        ends.append(int(there.sum()))
        if not there[: ends[-1]].all():
            return False
    return len(set(ends)) > 1


def _of_neighbour(table: Table, clock: str) -> bool:
    """Whether a clock has the name of a column next to it (``Time front``, ``front``)."""
    at, mine = table.names.index(clock), set(_stem(clock)) - TIME - set(chain.from_iterable(TIME_UNITS.values()))
    beside = table.names[max(at - 1, 0) : at] + table.names[at + 1 : at + 2]
    return bool(mine) and any(mine <= set(_stem(n)) for n in beside)


def _stem(name: str) -> list[str]:
    # Time A [s], Time B [s], as Time 1, Time 2
    bare = re.sub(r"(?<=\w)[ _-][A-Z](?=\s*(?:[\[(].*)?$)", "", re.sub(r" \(\d+\)$", "", name))
    return words(bare)


def _equal(one: Array | list[str], other: Array | list[str]) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    return list(one) == list(other)


def _owners(table: Table, clocks: list[str]) -> list[list[str]] | None:
    """Of each clock its columns: those that follow it, or stand before it; None where neither is so of all."""
    at = [table.names.index(n) for n in clocks]
    others = [i for i, n in enumerate(table.names) if n not in clocks]
    lead = [i for i in others if i < at[0]]
    if all(b - a > 1 for a, b in zip(at, [*at[1:], len(table.names)], strict=True)) and all(_counts(table, i) for i in lead):
        edges = [*at, len(table.names)]
    elif not [i for i in others if i > at[-1]] and all(b - a > 1 for a, b in zip([-1, *at], at, strict=False)):
        edges = [-1, *at]
    else:
        return None
    return [[table.names[i] for i in others if a < i < b] for a, b in pairwise(edges)]


def _counts(table: Table, at: int) -> bool:
    """Whether a column numbers the rows."""
    column = table.columns[table.names[at]]
    return isinstance(column, np.ndarray) and len(column) > 1 and bool((np.diff(column) == 1.0).all())


def _seconds(table: Table, clocks: list[str]) -> list[Array] | None:
    """Of each clock its times (n,) in one unit, nan where it has ended; None where they have no origin in common."""
    columns = [table.columns[n] for n in clocks]
    if all(isinstance(c, np.ndarray) for c in columns):
        return [np.asarray(c, dtype=float) for c in columns]
    cells = [[str(c).strip() for c in column] for column in columns]
    told = [[i for i, c in enumerate(column) if c] for column in cells]
    try:
        stamps = parse_stamps(
            [column[i] for column, rows in zip(cells, told, strict=True) for i in rows], table.name, range(sum(map(len, told)))
        )
    except InputError:
        return None
    if not stamps.dated:  # past midnight each goes on by itself
        return _times_of_day(cells, told, table.name)
    found, begin = [], 0
    for column, rows in zip(cells, told, strict=True):
        seconds = np.full(len(column), np.nan)
        seconds[rows] = stamps.seconds[begin : begin + len(rows)]
        begin += len(rows)
        found.append(seconds)
    return found


def _until_it_ends(seconds: Array) -> Array:
    """A clock (n,) with nan where it has ended and its last moment, or zero, fills the column up."""
    last = int(np.nanargmax(seconds)) if np.isfinite(seconds).any() else len(seconds)
    rest = seconds[last + 1 :]
    filled = len(rest) > 0 and np.isfinite(rest).all() and set(rest.tolist()) <= {0.0, float(seconds[last])}
    return np.concatenate([seconds[: last + 1], np.full(len(rest), np.nan)]) if filled else seconds


def _times_of_day(cells: list[list[str]], told: list[list[int]], name: str) -> list[Array] | None:
    """Of clocks without dates their times (n,) since the first cell of the first, none more than half a day before it."""
    found = []
    for column, rows in zip(cells, told, strict=True):
        try:
            own = parse_stamps([column[i] for i in rows], name, range(len(rows))).seconds
            begins = float(parse_stamps([cells[0][told[0][0]], column[rows[0]]], name, range(2)).seconds[1])
        except InputError:
            return None
        seconds = np.full(len(column), np.nan)
        seconds[rows] = own + (begins - DAY_S if begins > 0.5 * DAY_S else begins)
        found.append(seconds)
    return found


def _picked(columns: list[Array | list[str]], source: NDArray[np.intp], rows: NDArray[np.intp]) -> Array | list[str]:
    cells = [columns[k][i] for k, i in zip(source.tolist(), rows.tolist(), strict=True)]
    return np.array(cells, dtype=float) if isinstance(columns[0], np.ndarray) else [str(c) for c in cells]


def _spread_over(column: Array | list[str], good: NDArray[np.bool_], places: NDArray[np.intp], count: int) -> Array | list[str]:
    if isinstance(column, np.ndarray):
        values = np.full(count, np.nan)
        values[places] = column[good]
        return values
    cells = [""] * count
    for place, row in zip(places.tolist(), np.flatnonzero(good).tolist(), strict=True):
        cells[place] = column[row]
    return cells
