"""Records of one kind held column by column: sensors go from worker to file as arrays, and a record is made when somebody looks."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, cached_property
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Same(NamedTuple):
    """A value that all records of a column share."""

    value: Any


#: Numbers (n,) [unit of the column], nan for none; any values, one each; or one that all share.
Column = Array | list[Any] | Same


@cache
def numeric(kind: Any) -> frozenset[str]:
    """Names of the columns of a kind of record that hold floating-point numbers."""
    return frozenset(f.name for f in fields(kind) if str(getattr(f.type, "__name__", f.type)).startswith("float"))


def numbers_of(values: Array) -> Array:
    """Numbers, nan for what is none (an infinity)."""
    found: Array = np.where(np.isfinite(values), values, np.nan)
    return found


def in_full(column: Column, count: int) -> list[Any]:
    """The values of a column, None for an absent number."""
    if isinstance(column, Same):
        return [column.value] * count
    if isinstance(column, list):
        return column
    values: list[Any] = column.tolist()
    for i in np.flatnonzero(np.isnan(column)).tolist():
        values[i] = None
    return values


class Records(Sequence[Any]):
    """``size`` records of `kind`, a dataclass; columns by the name of its fields, those not given at the field's default."""

    def __init__(self, kind: Any, size: int, columns: Mapping[str, Column]) -> None:
        self.kind, self.size = kind, size
        self.columns: dict[str, Column] = {f.name: columns.get(f.name, Same(f.default)) for f in fields(kind)}

    @classmethod
    def of(cls, kind: Any, records: Sequence[Any]) -> "Records":
        """The same records by columns."""
        return cls(kind, len(records), {f.name: _column([getattr(r, f.name) for r in records]) for f in fields(kind)})

    @classmethod
    def joined(cls, parts: "Sequence[Records]") -> "Records":
        """All records of several, one after another; parts are of one kind.

        Raises
        ------
        ValueError: no part.
        """
        if not parts:
            raise ValueError("no records to join")
        if len(parts) == 1:
            return parts[0]
        kind = parts[0].kind
        counts = [p.size for p in parts]
        return cls(
            kind, sum(counts), {n: _joined([p.columns[n] for p in parts], counts, n in numeric(kind)) for n in parts[0].columns}
        )

    def taken(self, order: NDArray[np.intp]) -> "Records":
        """The records at these places, in that order."""
        return Records(self.kind, len(order), {n: _taken(c, order) for n, c in self.columns.items()})

    def column(self, name: str) -> list[Any]:
        """The values of one column."""
        return in_full(self.columns[name], self.size)

    def changed(self, **columns: Column) -> "Records":
        """The same with other columns in the place of some."""
        return Records(self.kind, self.size, self.columns | columns)

    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each record."""
        values = [repeat(c.value, self.size) if isinstance(c, Same) else in_full(c, self.size) for c in self.columns.values()]
        return [dict(zip(self.columns, row, strict=True)) for row in zip(*values, strict=True)]

    def __len__(self) -> int:
        return self.size

    @cached_property
    def made(self) -> tuple[Any, ...]:
        """The records themselves."""
        return tuple(self.kind(**row) for row in self.rows())

    def __getitem__(self, key: Any) -> Any:
        return self.made[key]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.made)

    def __eq__(self, other: object) -> bool:
        """Whether both hold the same records in the same order."""
        return self.made == tuple(other) if isinstance(other, Sequence) else NotImplemented

    def __repr__(self) -> str:
        return f"<{self.size} records of {self.kind.__name__}>"

    __hash__ = None  # type: ignore[assignment]


def _column(values: list[Any]) -> Column:
    first = values[0] if values else None
    return Same(first) if all(v is first for v in values) else values


def _joined(parts: Sequence[Column], counts: Sequence[int], floating: bool) -> Column:
    first = parts[0]
    if isinstance(first, Same) and all(isinstance(p, Same) and _alike(p.value, first.value) for p in parts):
        return first
    if floating:
        return np.concatenate([_as_array(p, n) for p, n in zip(parts, counts, strict=True)])
    return [v for p, n in zip(parts, counts, strict=True) for v in in_full(p, n)]


def _alike(one: Any, other: Any) -> bool:
    return type(one) is type(other) and bool(one == other)


def _as_array(column: Column, count: int) -> Array:
    if isinstance(column, np.ndarray):
        return column
    return np.array([math.nan if v is None else v for v in in_full(column, count)], dtype=float)


def _taken(column: Column, order: NDArray[np.intp]) -> Column:
    if isinstance(column, Same):
        return column
    return [column[i] for i in order.tolist()] if isinstance(column, list) else column[order]


def told_more(records: Sequence[Any], more: Mapping[str, str]) -> Sequence[Any]:
    """Records whose message says more of their run: by the run's name."""

    def joined(message: str, run: str) -> str:
        said = more.get(run, "")
        return f"{message}; {said}" if message and said else message or said

    if not isinstance(records, Records):
        return [replace(r, message=joined(r.message, r.run)) for r in records]
    said = zip(records.column("message"), records.column("run"), strict=True)
    return records.changed(message=[joined(message, run) for message, run in said])
