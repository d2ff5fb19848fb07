"""Records as Arrow tables, as Parquet files hold them: a column has its record's type, whatever stands in it."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from operator import itemgetter
from typing import Any

import numpy as np

from ..records.columns import Column, Records, Same
from .text import Row, plain

#: Types of the columns, as their annotations tell them, an absent value aside; what is nested deeper is JSON text.
TYPES = {"str": "string", "float": "double", "int": "int64", "bool": "bool_", "list[str]": "list"}


def types_of(kind: Any) -> dict[str, Any]:
    """Arrow types by column of a kind of record."""
    import pyarrow as pa

    told = {f.name: str(getattr(f.type, "__name__", f.type) if isinstance(f.type, type) else f.type) for f in fields(kind)}
    named = {n: TYPES.get(t.removesuffix(" | None").strip("\"'"), "string") for n, t in told.items()}
    return {n: pa.list_(pa.string()) if t == "list" else getattr(pa, {"double": "float64"}.get(t, t))() for n, t in named.items()}


def to_arrow(columns: Sequence[str], rows: Sequence[Row], types: Mapping[str, Any] | None = None) -> Any:
    """Rows as an Arrow table; types: of its columns, else by what stands in them."""
    import pyarrow as pa

    told = dict(zip(columns, _turned(columns, rows), strict=True))
    if types is None:
        return pa.table({c: _arrow(values) for c, values in told.items()})
    return pa.table({c: _of_type(values, len(rows), types[c]) for c, values in told.items()})


def _turned(columns: Sequence[str], rows: Sequence[Row]) -> list[list[Any]]:
    """The values of each column; a row at a time, which takes a third of the time of a column at a time."""
    if len(columns) < 2 or not rows:
        return [[row[c] for row in rows] for c in columns]
    return [list(values) for values in zip(*map(itemgetter(*columns), rows), strict=True)]


def _as_texts(values: list[Any]) -> list[Any]:
    """What is nested as JSON; the values themselves where none is."""
    nested = any(issubclass(kind, dict | list | tuple) for kind in set(map(type, values)))
    return [_as_text(v) for v in values] if nested else values


def _as_text(value: Any) -> Any:
    """What is nested as JSON."""
    return json.dumps(plain(value), ensure_ascii=False) if isinstance(value, dict | list | tuple) else value


def columns_to_arrow(records: Records, types: Mapping[str, Any]) -> Any:
    """Records held by columns as an Arrow table, with these types."""
    import pyarrow as pa

    return pa.table({name: _of_type(column, records.size, types[name]) for name, column in records.columns.items()})


def _of_type(column: Column, count: int, kind: Any) -> Any:
    """A column as one of that type."""
    import pyarrow as pa

    if isinstance(column, np.ndarray):
        absent = np.isnan(column)
        held = pa.py_buffer(np.packbits(~absent, bitorder="little")) if absent.any() else None
        numbers = np.where(absent, 0.0, column) if held is not None else np.ascontiguousarray(column)
        return pa.Array.from_buffers(pa.float64(), count, [held, pa.py_buffer(numbers)])
    if isinstance(column, Same):
        if column.value is None:
            return pa.nulls(count, kind)
        if isinstance(column.value, str) and kind == pa.string():
            word = column.value.encode("utf-8", errors="backslashreplace")
            ends = np.arange(count + 1, dtype=np.int32) * len(word)
            return pa.Array.from_buffers(kind, count, [None, pa.py_buffer(ends), pa.py_buffer(word * count)])
        column = [column.value] * count
    found = _arrow(_as_texts(column) if kind == pa.string() else column)
    return found if found.type == kind else found.cast(kind)


def write_arrow(path: str, table: Any) -> None:
    """An Arrow table as a Parquet file."""
    import pyarrow.parquet as papq

    papq.write_table(table, path)


def _arrow(values: list[Any]) -> Any:
    """A column; lists of words stay lists, what is nested deeper becomes JSON text."""
    import pyarrow as pa

    kinds = set(map(type, values)) - {type(None)}
    if kinds <= {float}:  # a column without a single number is still a column of numbers
        return _from_buffers(pa.float64(), [v if v is not None and math.isfinite(v) else None for v in values], np.float64)
    if kinds == {int}:
        return _from_buffers(pa.int64(), values, np.int64)
    if kinds == {bool}:
        held = pa.py_buffer(np.packbits([bool(v) for v in values], bitorder="little"))
        return pa.Array.from_buffers(pa.bool_(), len(values), [_present(values), held])
    if kinds == {str}:
        return _from_text(values)
    values = [plain(v) for v in values]
    if any(isinstance(v, dict) or (isinstance(v, list) and any(isinstance(x, dict) for x in v)) for v in values):
        values = [None if v is None else json.dumps(v, ensure_ascii=False) for v in values]
    if any(isinstance(v, list) for v in values):
        return pa.array(values, type=pa.list_(pa.string()))
    return pa.array(values, type=pa.float64() if all(v is None for v in values) else None)


def _from_buffers(kind: Any, values: list[Any], dtype: type) -> Any:
    """Numbers as an Arrow array: ``pyarrow.array`` would load pandas, which takes longer than writing ten thousand records."""
    import pyarrow as pa

    numbers: Any = np.array([0 if v is None else v for v in values], dtype)
    return pa.Array.from_buffers(kind, len(values), [_present(values), pa.py_buffer(numbers)])


def _from_text(values: list[Any]) -> Any:
    import pyarrow as pa

    encoded = [b"" if v is None else v.encode("utf-8", errors="backslashreplace") for v in values]
    ends = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    buffers = [_present(values), pa.py_buffer(ends), pa.py_buffer(b"".join(encoded))]
    return pa.Array.from_buffers(pa.string(), len(values), buffers)


def _present(values: list[Any]) -> Any:
    """Arrow's bit map of the values that are there, or None where all are."""
    import pyarrow as pa

    absent = [v is None for v in values]
    return pa.py_buffer(np.packbits(~np.array(absent), bitorder="little")) if any(absent) else None
