"""Which column of a table is its time: by what it is called, by how its cells are written, by how its numbers go on."""

import re
from functools import cached_property, lru_cache
from itertools import chain, islice, pairwise
from operator import ne

import numpy as np

from ..run import Array
from ..table import Table
from ..units import unit_in_name
from ..values.time_units import unit_of
from ..vocabulary import TIME, TIME_NAMES, TIME_PARTS, TIME_UNITS, words
from .epochs import are_moments, epoch_of, is_date_number, of_archive
from .stamps import looks_like_stamp, plain

#: The time of a curve, as panels write it beside its ValueY.
_OF_A_CURVE = re.compile(r"(?i)\bvalue ?x( \(\d+\))?$")
#: Words of a moment at which a row was sent on or stored.
SENT_ON = frozenset(["published", "received", "server", "upload", "uploaded", "inserted", "created", "ingested", "arrival"])
#: Names that are units of time, and of deviations, least readings and heights.
BARE = ("s", "min", "h")
#: Stamps of which the most different ones are looked for, among so many columns.
FEW = 8
#: A date within a stamp.
_DATE = re.compile(r"\d[-/.]\d{1,2}[-/.]\d|\d{8}")

#: A column that is time, and that of the clock where the date stands in one of its own.
Found = tuple[str, str | None]


@lru_cache(maxsize=4096)
def is_time_name(name: str) -> bool:
    """Whether a column is called after time."""
    whole = re.sub(r"[\[(/,].*", "", name).strip()
    told = words(name)
    if whole != name and whole in TIME_NAMES and (unit := unit_in_name(name)) is not None and unit.kind != "time":
        return False  # min [°C] is the least of a temperature
    if whole != name and re.fullmatch(r"[Tt]\d+", whole):
        # t1 [s] beside T1; T1 (min) is the least of a temperature.
        return (unit := unit_in_name(name)) is not None and unit.kind == "time" and (unit.symbol != "min" or "[" in name)
    if any(w in ("temp", "temperature", "temperatur") for w in told):
        return False
    if not name.isascii() and any(part in name for part in TIME_PARTS):
        return True
    if name[-1:].isdigit():
        return any(w in TIME for w in told)
    if re.fullmatch(r"t_(us|ms|s|sec|min|h)|[xX] ?\[(us|ms|s|sec|min|h)\]( \(\d+\))?", name) or _OF_A_CURVE.search(name):
        return True
    return any(w in TIME for w in told) or whole in TIME_NAMES or (len(whole) > 3 and whole.lower() in TIME_NAMES)


def time_column(table: Table) -> Found | None:
    """The column that is time, and that of the clock where the date stands in one of its own; the first rule that finds one."""
    columns = _TimeColumns(table)
    return (
        columns.archived()
        or columns.date_and_clock()
        or columns.stamped_each_row()
        or columns.by_name()
        or columns.first_of_no_name()
        or columns.by_unit()
        or columns.by_moments()
    )


class _TimeColumns:
    """What the columns of a table look like to who looks for its time, and the rules by which it is found."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.numeric: list[str] = []
        self.texts: list[str] = []
        for n in table.names:
            column = table.columns[n]
            if isinstance(column, np.ndarray):
                self.numeric.append(n)
            elif len(set(column[:200])) > 1 or len(set(column)) > 1:  # the bounds of a query are the same in every row
                self.texts.append(n)
            elif looks_like_stamp(column[0]) and ":" not in column[0]:
                self.texts.append(n)  # a date alone may be the same all day

    @cached_property
    def named(self) -> list[str]:
        """Columns that are called after time."""
        found = [n for n in self.table.names if is_time_name(n)]
        if any(words(n) == ["max"] for n in self.numeric):
            found = [n for n in found if words(n) != ["min"]]  # the least reading, not minutes
        return found

    @cached_property
    def stamps(self) -> dict[str, str]:
        """The first cell of each column of stamps."""
        first = {n: first_cell(self.table, n) for n in self.texts}
        return {n: c for n, c in first.items() if looks_like_stamp(c)}

    @cached_property
    def any_dates(self) -> list[str]:
        return [n for n, cell in self.stamps.items() if ":" not in cell]

    @cached_property
    def any_clocks(self) -> list[str]:
        return [n for n, cell in self.stamps.items() if ":" in cell and not _DATE.search(cell)]

    @cached_property
    def whole(self) -> list[str]:
        """Named stamps with date and clock that are moments of the rows."""
        apart = (*self.any_dates, *self.any_clocks)
        return [n for n in self.stamps if n in self.named and n not in apart and _mostly_new(self.table.columns[n])]

    @cached_property
    def others(self) -> bool:
        """Whether a column beside dates and clocks tells the time."""
        return bool(self.whole) or any(n in self.named and unit_of(n, self.table.units.get(n, "")) for n in self.numeric)

    @cached_property
    def pair(self) -> bool:
        """Whether there are one clock and one date, which belong together whatever they are called ("Date,,T1")."""
        return len(self.any_dates) == len(self.any_clocks) == 1 and not self.others

    @cached_property
    def dates(self) -> list[str]:
        return [n for n in self.any_dates if self.pair or n in self.named or n == self.table.names[0]]

    @cached_property
    def clocks(self) -> list[str]:
        return [n for n in self.any_clocks if self.pair or n in self.named]

    def archived(self) -> Found | None:
        """An archive's milliseconds beside stamps."""
        found = [n for n in self.numeric if words(n) == ["time", "ms"] and of_archive(self._values(n))]
        return (found[0], None) if found and self.texts else None

    def date_and_clock(self) -> Found | None:
        """A column of dates and one of clocks; the clock alone where it is elapsed time."""
        columns = self.table.columns
        days = self.dates or [n for n in self.numeric if n in self.named and is_date_number(columns[n])]
        if not (days and self.clocks) or self.whole:
            return None
        day, clock = days[0], self.clocks[0]
        return (clock, None) if _elapses(columns[day], columns[clock]) else (day, clock)

    def stamped_each_row(self) -> Found | None:
        """A column of stamps with date and clock.

        Of several the one with most different values: the others tell when a step or the query began. When a row was sent on is
        not when it was read.
        """
        dated = [n for n in self.stamps if n not in self.clocks and n not in self.dates]
        unnamed = [n for n in dated if n not in self.named and ":" in self.stamps[n] and not self.others]
        ordered = [n for n in dated if n in self.named] + unnamed
        if len(ordered) < 2:
            return (ordered[0], None) if ordered else None
        different = {n: len(set(self.table.columns[n])) for n in ordered[:FEW]}
        often = 0.5 * max(different.values())

        def rank(n: str) -> tuple[bool, int, bool]:
            return different[n] > often and not SENT_ON & set(words(n)), different[n], n in self.named

        return max(different, key=rank), None

    def by_name(self) -> Found | None:
        """A column called after time: numbers that go on, with a unit at best, then what else there is."""
        units = self.table.units
        timed = [n for n in self.numeric if n in self.named and np.isfinite(np.asarray(self.table.columns[n])).any()]
        timed = [n for n in timed if not is_date_number(self.table.columns[n])] or timed
        epochs = [n for n in timed if epoch_of(self._values(n)) and unit_of(n) is None]
        ascending = [n for n in timed if (np.diff(self._values(n)) >= 0).mean() > 0.5 and np.ptp(self._values(n)) > 0.0]
        ascending.sort(key=lambda n: bool((np.diff(self._values(n)) < 0).any()))  # a cycle's length goes up and down
        for group in (
            [n for n in ascending if unit_of(n, units.get(n, "")) and not _after_time(n, timed)],
            epochs,
            self.clocks,
            ascending,
            self.dates,
            timed,
            [n for n in self.table.names if n in self.named and n in self.texts],
        ):
            if group:
                return group[0], None
        return None

    def first_of_no_name(self) -> Found | None:
        """The first column of a table without names, where it goes on."""
        name = self.table.names[0]
        first = self.table.columns[name]
        if name != "column 1" or not isinstance(first, np.ndarray):
            return None
        return (name, None) if np.isfinite(first).all() and (np.diff(first) > 0).all() else None

    def by_unit(self) -> Found | None:
        """The one column that goes on in seconds or minutes, though no name says so."""
        written = set(chain.from_iterable(TIME_UNITS.values()))
        going = [n for n in self.numeric if self.table.units.get(n, "").strip("[]() ").lower() in written]
        going = [n for n in going if (np.diff(self._values(n)) > 0).all()]
        return (going[0], None) if len(going) == 1 else None

    def by_moments(self) -> Found | None:
        """The one column of moments without signs (20240314081520) that go on, whatever it is called."""
        going = [n for n in self.numeric if are_moments(self._values(n))]
        return (going[0], None) if len(going) == 1 else None

    def _values(self, name: str) -> Array:
        return np.asarray(self.table.columns[name], dtype=np.float64)


def _after_time(name: str, timed: list[str]) -> bool:
    """Whether a column called s, min or h stands behind another that could be the time: a deviation, a least, a height."""
    return name.lower() in BARE and name != timed[0] and timed[0].lower() not in BARE


def _mostly_new(column: "Array | list[str]") -> bool:
    """Whether most cells of a column differ from the one before: a moment of each row, not of a batch or a query."""
    return bool(sum(map(ne, column, islice(column, 1, None))) >= 0.5 * (len(column) - 1))


def _elapses(days: "Array | list[str]", clock: "Array | list[str]") -> bool:
    """Whether a clock beside dates begins at 0 and goes on by its usual step where the date changes: it is elapsed time."""
    read = [re.match(r"(\d+):(\d\d)(?::(\d\d(?:\.\d+)?))?$", str(c).strip()) for c in clock]
    if not all(read):
        return False
    seconds = [3600.0 * float(m[1]) + 60.0 * float(m[2]) + float(m[3] or 0.0) for m in read if m]
    step = np.diff(seconds)
    told = [str(d).strip() for d in days]
    changed = np.array([bool(b) and a != b for a, b in pairwise(told)])
    usual = float(np.median(step)) if len(step) else 0.0
    return bool(changed.any()) and seconds[0] <= 2.0 * usual and bool((np.abs(step[changed] - usual) <= 0.5 * usual).all())


def first_cell(table: Table, name: str) -> str:
    """The first cell of a column of words that is not empty; of numbers nothing."""
    return plain(next((c.strip() for c in table.columns[name] if isinstance(c, str) and c.strip()), ""))
