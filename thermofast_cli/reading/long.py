"""Long tables: one row per sensor and time, the sensor's name in a column of its own."""

import re
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import InputError, UsageError, listed
from ..reading_options import Options
from .headings.called import check_names, resolved
from .moments.times import Time
from .run import Array, Guess
from .signs import sign_of
from .table import Table
from .tables.dialect import is_missing, is_number, to_number
from .units import parse_unit, to_celsius
from .values.marks import good_only, unsure
from .vocabulary import FLAGS, MEANS, READINGS, REMARKS, SENSOR_NAMES, UNITS, words

MOST_LABELS = 5000
#: Share of the rows in which another sensor is told than in the row before, where they are read in turn.
IN_TURN = 0.4


@dataclass(frozen=True)
class Layout:
    """Columns of words that together name the sensor, and the column of the readings; guess says how it was found."""

    labels: tuple[str, ...]
    value: str
    guess: Guess | None


def find_long(table: Table, time: Time, options: Options) -> Layout | None:
    """The layout of a long table: as the user says, or where it is plain; None for a wide one.

    Raises
    ------
    InputError: it may be long, and which columns name and measure cannot be told.
    """
    if options.long:
        labels, told = tuple(options.long[0].split("+")), options.long[1]
        check_names([*labels, told], table.names, "--long", table.name)
        return Layout(labels, told, None)
    if set(resolved(options, table.names, table.names).channels) & set(table.names):
        return None  # columns by themselves
    columns = _LongColumns.of(table, time)
    if not columns.repeated:
        return _of_one_sensor(table, time, columns.cells)
    if not columns.values:
        return None
    if not table.header:
        if columns.texts:
            raise _ask(table, columns.texts, columns.values)
        return None
    value = columns.reading()
    if value is None:
        if columns.named and columns.interleaved(tuple(n for n in columns.named if n not in columns.numbers)):
            raise _ask(table, columns.named, columns.values)
        return None
    sensor = columns.sensor(value)
    if not sensor:
        return None
    naming = f"{' and '.join(map(repr, sensor))} {'name' if len(sensor) > 1 else 'names'}"
    guess = f"a long table: {naming} the sensor, {value!r} is the reading"
    return Layout(sensor, value, Guess("layout", guess, "--long SENSOR,VALUE says otherwise"))


@dataclass(frozen=True)
class _LongColumns:
    """What the columns of a table look like to who asks whether it is long.

    cells: of each column that may name sensors; repeated: those whose cells stand there again and again, and of these named, by
    their heading, unclear, and numbers; values: columns of numbers that change.
    """

    table: Table
    seconds: Array
    cells: dict[str, list[str] | None]
    repeated: list[str]
    named: list[str]
    unclear: list[str]
    numbers: list[str]
    values: list[str]

    @classmethod
    def of(cls, table: Table, time: Time) -> "_LongColumns":
        """Of a table whose time is known."""
        rest = [n for n in table.names if n not in time.used]
        cells = {n: _cells_of(table, n) for n in rest}
        repeated = [n for n, c in cells.items() if c is not None and _repeats(c)]
        named = [n for n in repeated if set(words(n)) & SENSOR_NAMES and not set(words(n)) & REMARKS]
        unclear = [n for n in repeated if n not in named and not set(words(n)) & REMARKS]
        numbers = [n for n in repeated if isinstance(table.columns[n], np.ndarray)]
        values = [n for n in rest if n not in repeated and isinstance(table.columns[n], np.ndarray)]
        # Of readings with a word among them that nobody knows, the word is told, and no other number is taken for them.
        values = [n for n in values if n not in table.faults or set(words(n)) & READINGS]
        values = [n for n in values if _varies(table.columns[n]) and not set(words(n)) <= FLAGS - READINGS]
        return cls(table, time.seconds, cells, repeated, named, unclear, numbers, values)

    @property
    def texts(self) -> list[str]:
        """Those that repeat and are words."""
        return [n for n in self.repeated if n not in self.numbers]

    def interleaved(self, names: tuple[str, ...]) -> bool:
        """As :func:`_interleaved`."""
        return _interleaved(self.seconds, self.cells, names)

    def reading(self) -> str | None:
        """The column of the readings: the one that is called so, or a temperature, or the only one."""
        valued = [n for n in self.values if set(words(n)) & READINGS]
        valued = valued or [n for n in self.values if sign_of(n, self.table.units.get(n, "")).temperature]
        if len(valued) == 1:
            return valued[0]
        return self.values[0] if len(self.values) == 1 else None

    def sensor(self, value: str) -> tuple[str, ...]:
        """The columns that together name the sensor of a row whose reading is `value`; none where that is not plain."""
        found = tuple(n for n in self.named if n not in self.numbers) or tuple(n for n in self.named if n in self.numbers)[:1]
        if not found and len(self.unclear) == 1 and self.unclear[0] not in self.numbers:
            only, column = self.unclear[0], np.asarray(self.table.columns[value])
            found = (only,) if self.interleaved((only,)) or _levels(self.cells[only], column) else ()
        if not found:
            return ()
        found = (*found, *_beside(self.seconds, self.cells, found, self.repeated))
        in_turn = bool(set(words(value)) & READINGS) and _in_turn(self.cells[found[0]])
        by_number = any(n in self.numbers for n in found)
        return () if by_number and not (in_turn or self.interleaved(found)) else found


def _beside(seconds: Array, words_of: dict[str, list[str] | None], sensor: tuple[str, ...], repeated: list[str]) -> tuple[str, ...]:
    """The column of words that tells the readings of one sensor at one moment apart, as mean, least and greatest; mostly none."""
    moments = [(t, w) for t, w in zip(seconds.tolist(), _joined(words_of, sensor), strict=True)]
    if len(set(moments)) > 0.95 * len(moments):
        return ()
    for n in repeated:
        apart = {(*m, w) for m, w in zip(moments, words_of[n] or [], strict=False)}
        if n not in sensor and not set(words(n)) & (UNITS | REMARKS) and len(apart) == len(moments):
            return (n,)
    return ()


def _of_one_sensor(table: Table, time: Time, words_of: dict[str, list[str] | None]) -> Layout | None:
    """The layout of a long table that tells of one sensor only: its name in every row, and one column of readings."""
    names = [n for n, c in words_of.items() if c is not None and set(words(n)) & SENSOR_NAMES and len({x.strip() for x in c}) == 1]
    values = [n for n in table.names if n not in time.used and isinstance(table.columns[n], np.ndarray)]
    plain = len(values) == 1 and not sign_of(values[0], table.units.get(values[0], "")).temperature
    if len(names) != 1 or isinstance(table.columns[names[0]], np.ndarray) or not plain or not set(words(values[0])) & READINGS:
        return None
    guess = f"a long table of one sensor, named in {names[0]!r}; {values[0]!r} is the reading"
    return Layout((names[0],), values[0], Guess("layout", guess, "--long SENSOR,VALUE says otherwise"))


def _ask(table: Table, labels: list[str], values: list[str]) -> InputError:
    told = next((n for n in values if set(words(n)) & MEANS), values[-1])
    example = f"{'+'.join(labels)!r},{told!r}"
    return InputError(
        f"{table.name}: this looks like a long table, one row per sensor and time",
        found=f"words that repeat in {listed(labels, 4)}; numbers in {listed(values, 4)}",
        allowed="one column that names the sensor and one with its reading",
        do=f"say --long SENSOR,VALUE, as in --long {example} (A+B,VALUE where two columns name it)",
    )


def _cells_of(table: Table, name: str) -> list[str] | None:
    """Cells of a column that may name sensors: words, or small whole numbers under such a name."""
    column = table.columns[name]
    if not isinstance(column, np.ndarray):
        return column
    if (
        set(words(name)) & (SENSOR_NAMES | {"id"})
        and np.isfinite(column).all()
        and (column % 1.0 == 0.0).all()
        and np.ptp(column) < 1000
    ):
        return [f"{v:g}" for v in column.tolist()]
    return None


def _repeats(cells: list[str]) -> bool:
    different = {c.strip() for c in cells}
    return 2 <= len(different) <= min(max(len(cells) // 2, 2), MOST_LABELS) and "" not in different


def _varies(column: Array | list[str]) -> bool:
    return isinstance(column, np.ndarray) and len(np.unique(column[np.isfinite(column)])) > 1


def _interleaved(seconds: Array, words_of: dict[str, list[str] | None], names: tuple[str, ...]) -> bool:
    """Whether most stamps stand there several times, each time with another name; or time falls back where the name changes."""
    if not names:
        return False
    labels = _joined(words_of, names)
    pairs = {(t, w) for t, w in zip(seconds.tolist(), labels, strict=True)}
    stamps = len(set(seconds.tolist()))
    together = stamps <= 0.7 * len(seconds) and len(pairs) >= 0.95 * len(seconds)
    back = np.flatnonzero(np.diff(seconds) < 0)
    changes = [labels[i] != labels[i + 1] for i in back]
    return together or (len(back) > 0 and len(back) >= len(set(labels)) - 1 and all(changes))


def _in_turn(cells: list[str] | None) -> bool:
    """Whether a column that names sensors by numbers goes from one to another all the time, as where they are asked in turn."""
    changes = sum(a != b for a, b in pairwise(cells or []))
    return changes > IN_TURN * len(cells or [])


def _joined(words_of: dict[str, list[str] | None], names: tuple[str, ...]) -> list[str]:
    columns = [words_of[n] or [] for n in names]
    varying = [c for c in columns if len(set(c)) > 1] or columns[:1]
    return [" ".join(cells) for cells in zip(*varying, strict=True)]


def _levels(cells: list[str] | None, value: Array) -> bool:
    """Whether the readings jump wherever the name changes and not where it stays: two sensors read in turn."""
    if cells is None:
        return False
    label = np.unique(cells, return_inverse=True)[1]
    step, changed = np.abs(np.diff(value)), np.diff(label) != 0
    if changed.sum() < 3 or len(np.unique(label)) > 200:
        return False
    within = []
    for k in np.unique(label):
        own = value[label == k]
        within.append(np.abs(np.diff(own[np.isfinite(own)])))
    quiet = float(np.median(np.concatenate(within))) if within else np.inf
    return float(np.nanmedian(step[changed])) > 5.0 * max(quiet, 1e-9)


def without_switches(table: Table) -> Table:
    """A long table without the rows of things that tell words (a door: on, off), where others in it tell numbers."""
    # Of thousands of columns of numbers none is looked at.
    odd = [n for n, c in table.columns.items() if n in table.faults or not isinstance(c, np.ndarray)]
    named = [n for n in odd if set(words(n)) & SENSOR_NAMES and not set(words(n)) & REMARKS]
    labels = [c for c in (table.columns[n] for n in named) if not isinstance(c, np.ndarray) and _repeats(c)]
    told = [n for n in odd if set(words(n)) & READINGS and n not in named]
    if len(labels) != 1 or len(told) != 1:
        return table
    column, decimal = table.columns[told[0]], table.dialect.decimal if table.dialect is not None else "."
    if isinstance(column, np.ndarray):
        value, said = column, re.search(r" in (\d+) rows", table.faults[told[0]].found)
        count = int(said[1]) if said else 1
    else:
        value = np.array([to_number(c, decimal) if is_number(c, decimal) else np.nan for c in column])
        count = sum(not is_number(c, decimal) and not is_missing(c) for c in column)
    good = {label for label, yes in zip(labels[0], np.isfinite(value), strict=True) if yes}
    keep = np.array([label in good for label in labels[0]])
    # Words among the numbers of one that is kept are for the user to mend.
    if not good or count > int((~keep).sum()):
        return table
    rows = np.flatnonzero(keep).tolist()
    columns = {n: c[keep] if isinstance(c, np.ndarray) else [c[i] for i in rows] for n, c in table.columns.items()}
    others = dict.fromkeys(label for label, k in zip(labels[0], keep, strict=True) if not k)
    # Some of the words may stand for no reading anywhere: what the rest of them were among the numbers nobody can tell.
    empty = int((~np.isfinite(value[keep])).sum())
    among = [f"{empty} rows of the others hold no number"] if empty and count else []
    return replace(
        table,
        columns=columns | {told[0]: value[keep]},
        lines=[table.lines[i] for i in rows],
        faults={n: f for n, f in table.faults.items() if n != told[0]},
        notes=(*table.notes, f"what tells words left out: {listed(others, 6)}", *among),
    )


def to_wide(table: Table, layout: Layout, time: Time) -> Table:
    """The same rows with one column per sensor, nan where a row is another's.

    Raises
    ------
    UsageError: a named column holds no numbers, or there are too many sensors.
    """
    value = table.columns[layout.value]
    if layout.value in table.faults:
        raise table.faults[layout.value]
    if not isinstance(value, np.ndarray):
        raise UsageError(f"{table.name}: --long: {layout.value!r} holds no numbers", allowed="a column of readings")
    words_of: dict[str, list[str] | None] = {n: _label_cells(n, table.columns[n]) for n in layout.labels}
    labels = np.array(_joined(words_of, layout.labels))
    names = [n for n in dict.fromkeys(labels.tolist()) if not n.startswith("$RT_")]  # WinCC tells that its log ended
    value, bad = good_only(table, value)
    if len(names) > MOST_LABELS:
        raise UsageError(
            f"{table.name}: {len(names)} sensors in {' and '.join(layout.labels)}",
            allowed=f"at most {MOST_LABELS}",
            do="say --long",
        )
    units = _units_of(table, labels, names) or dict.fromkeys(names, table.units.get(layout.value, ""))
    if not any(units.values()) and sign_of(layout.value, "").temperature:
        symbol = sign_of(layout.value, "").unit
        units = dict.fromkeys(names, f"°{symbol.symbol}" if symbol else "°C")
    columns: dict[str, Array | list[str]] = {n: table.columns[n] for n in time.used if n in table.columns}
    for label in names:
        column = np.where(labels == label, value, np.nan)
        own = parse_unit(units[label])
        columns[label] = column
        if own is not None and own.temperature:
            columns[label], units[label] = to_celsius(column, own.symbol), "°C"
    note = f"long table: {len(names)} columns from {' and '.join(layout.labels)} and {layout.value}"
    note += f"; {bad} reading{'s' if bad > 1 else ''} of bad quality left out" if bad else ""
    guesses = (*table.guesses, *([layout.guess] if layout.guess else []), *unsure(table))
    return replace(
        table,
        names=list(columns),
        columns=columns,
        units={**dict.fromkeys(columns, ""), **units},
        notes=(*table.notes, note),
        guesses=guesses,
        faults={},
        header=True,
    )


def _label_cells(name: str, column: Array | list[str]) -> list[str]:
    if not isinstance(column, np.ndarray):
        return [c.strip() for c in column]
    stem = next((w for w in words(name) if w in SENSOR_NAMES), "sensor")
    return [f"{stem} {v:g}" for v in column.tolist()]


def _units_of(table: Table, labels: np.ndarray, names: list[str]) -> dict[str, str]:
    """Unit of each sensor where a column tells the unit of each row."""
    column = next((n for n in table.names if set(words(n)) & UNITS and not isinstance(table.columns[n], np.ndarray)), None)
    if column is None:
        return {}
    cells = table.columns[column]
    assert not isinstance(cells, np.ndarray)
    return {n: cells[int(np.argmax(labels == n))] for n in names}
