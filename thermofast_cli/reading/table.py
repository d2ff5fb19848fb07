"""A table as it stands in a file: columns of numbers and of words, before anyone says what they mean."""

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from ..errors import InputError
from .run import Array, Guess
from .tables.dialect import is_missing, is_number, to_number
from .tables.limits import Limits

if TYPE_CHECKING:
    from .tables.dialect import Dialect

#: What most columns are, and what needs no look at what words they hold.
FLOAT = pa.float64()
NUMBERS = frozenset([FLOAT, pa.float32(), pa.int64(), pa.int32()])
#: Digits of a date without signs between them.
DATE = 8
#: From so many columns pyarrow spends longer on each column than on what stands in it, and holds five times the table.
WIDE = 200
#: Numbers of a wide table parsed at once: what is held twice, and as text.
NUMBERS_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class Table:
    """columns: name -> numbers (N,) with nan for none, or cells (N,) as text. lines: of each row its line in the file, from 0.

    faults: what is wrong with a column that is mostly numbers, raised where it is used; header: whether the columns are named.
    """

    name: str
    names: list[str]
    columns: dict[str, Array | list[str]]
    units: dict[str, str]
    lines: Sequence[int]
    notes: tuple[str, ...]
    faults: dict[str, InputError] = field(default_factory=dict)
    guesses: tuple[Guess, ...] = ()
    header: bool = True
    #: How a text file is laid out.
    dialect: "Dialect | None" = None
    #: C, K or F where a line above the names says the unit of all.
    unit_above: str = ""
    #: (seconds between rows, the line) where one above the names says it.
    interval_above: tuple[float, str] | None = None
    #: Where columns have clocks of their own: the names of these, of which the first is the time of the table.
    clocks: tuple[str, ...] = ()
    #: Lines at which the names stand again.
    headers: tuple[int, ...] = ()
    #: Columns that are durations by their type, in seconds.
    durations: tuple[str, ...] = ()


def to_floats(column: pa.ChunkedArray) -> Array:
    """A float64 column as an array (N,) with nan for null; pyarrow's own way there would import pandas."""
    filled = column.fill_null(float("nan")) if column.null_count else column
    parts = [np.frombuffer(c.buffers()[1], dtype=float, count=len(c), offset=8 * c.offset) for c in filled.chunks if len(c)]
    if len(parts) == 1:
        return parts[0]  # not copied: it cannot be written to
    return np.concatenate(parts) if parts else np.empty(0)


def wide_numbers(body: bytes, width: int, delimiter: str) -> Array | None:
    """A wide text table (rows, width) of nothing but numbers with decimal points, each column in one piece.

    None where it is not wide, or any cell is anything else: what that is, and in which row, others tell.
    """
    if width < WIDE or not only_numbers(body, delimiter):
        return None
    table = np.empty((body.count(b"\n") + (not body.endswith(b"\n")), width), order="F")
    rows = parsed(io.BytesIO(body), table, 0, delimiter)
    return table[:rows] if rows else None


def only_numbers(text: bytes, delimiter: str) -> bool:
    """Whether a text holds nothing but numbers with decimal points."""
    return not text.translate(None, b"0123456789.+-eE\r\n" + delimiter.encode())


def parsed(lines: Iterable[bytes], table: Array, at: int, delimiter: str) -> int:
    """How many rows of a table (rows, width) are full once lines of numbers stand in it from row `at` on; 0 where one is none."""
    more, at_once = iter(lines), max(1, NUMBERS_AT_ONCE // table.shape[1])
    try:
        while some := list(islice(more, at_once)):
            if not (some := [line for line in some if line.strip()]):
                continue
            part = np.loadtxt(some, delimiter=delimiter, comments=None, ndmin=2)
            if part.shape[1] != table.shape[1]:
                return 0
            table[at : at + len(part)] = part
            at += len(part)
    except ValueError:
        return 0
    return at


def read_parquet(data: bytes, name: str, limits: Limits) -> Table:
    """A table from the bytes of a Parquet file.

    Raises
    ------
    InputError: not Parquet, cut short, or too large.
    """
    import pyarrow.parquet as papq  # at the first use: a CSV file does not need it

    try:
        # In this thread alone: a pool of pyarrow's that is still starting when a refusal ends the process aborts it. read_table
        # starts one whatever it is told, through the datasets; the file itself does not.
        file = papq.ParquetFile(pa.BufferReader(data), pre_buffer=False, page_checksum_verification=True)
        told = file.metadata
        groups = [told.row_group(i) for i in range(told.num_row_groups)]
        rows = max(told.num_rows, sum(g.num_rows for g in groups))
        limits.check_shape(name, rows, told.num_columns)
        limits.check_unpacked(name, 8 * rows * told.num_columns, len(data))
        # A long text may stand in a file once and in a million rows: words stay codes until their length is known.
        schema = file.schema_arrow
        some = set(schema.types) - NUMBERS
        words = [c.name for c in schema if pa.types.is_string(c.type) or pa.types.is_large_string(c.type)] if some else []
        if words:
            file = papq.ParquetFile(pa.BufferReader(data), pre_buffer=False, page_checksum_verification=True, read_dictionary=words)
        table = file.read(use_threads=False)
        if set(table.schema.types) - NUMBERS:
            for n, column in zip(table.column_names, table.columns, strict=True):
                if n in words or pa.types.is_dictionary(column.type):
                    limits.check_bytes(f"{name}, column {n!r}", _length(column))
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        raise InputError(
            f"{name}: not a readable Parquet file",
            found=str(error).splitlines()[0][:120],
            allowed="a whole Parquet file",
            do="copy or export the file again",
        ) from None
    return from_arrow(table, name, [f"Parquet, {table.num_rows} rows"])


def _length(words: pa.ChunkedArray) -> int:
    """Bytes of a column of words, each row counted."""
    import pyarrow.compute as pc  # it takes longer to load than a small file to read

    total = 0
    for chunk in words.chunks:
        if pa.types.is_dictionary(chunk.type) and not (
            pa.types.is_string(chunk.type.value_type) or pa.types.is_large_string(chunk.type.value_type)
        ):
            continue
        if pa.types.is_dictionary(chunk.type):
            sizes = pc.binary_length(chunk.dictionary).to_numpy(zero_copy_only=False)
            codes = chunk.indices.drop_null().to_numpy(zero_copy_only=False)
            total += int(np.nansum(sizes[codes], dtype=np.float64)) if len(sizes) else 0
        else:
            total += chunk.nbytes
    return total


def from_arrow(table: pa.Table, name: str, notes: list[str]) -> Table:
    """A table from an Arrow table; time stamps become text, durations seconds, labels their words.

    Raises
    ------
    InputError: no column of numbers, stamps or words.
    """
    columns: dict[str, Array | list[str]] = {}
    units: dict[str, str] = {}
    durations: list[str] = []
    guesses: list[Guess] = []
    if len(set(table.column_names)) < len(table.column_names):
        twice = next(c for c in table.column_names if table.column_names.count(c) > 1)
        raise InputError(f"{name}: the column {twice!r} twice", allowed="one column of each name", do="rename one of them")
    for column_name, column in zip(table.column_names, table.columns, strict=True):
        column = _plain(column)
        kind = column.type
        if kind == FLOAT:
            columns[column_name] = to_floats(column)
            continue
        if pa.types.is_dictionary(kind):
            column = _decoded(column)
            kind = column.type
        if pa.types.is_timestamp(kind):
            whole = column.cast(pa.timestamp("us", tz=kind.tz), safe=False).cast(pa.int64()).to_pylist()
            # Arrow keeps moments of a zone in UTC: the mark says so, and no clock change is looked for.
            zone = "+00:00" if kind.tz else ""
            columns[column_name] = [str(np.datetime64(v, "us")) + zone if v is not None else "" for v in whole]
        elif pa.types.is_duration(kind):
            columns[column_name] = to_floats(column.cast(pa.duration("us"), safe=False).cast(pa.int64()).cast(pa.float64())) / 1e6
            units[column_name] = "s"
            durations.append(column_name)
        elif pa.types.is_date(kind) or pa.types.is_time(kind):
            columns[column_name] = [str(v) if v is not None else "" for v in column.to_pylist()]
        elif pa.types.is_boolean(kind):
            columns[column_name] = [str(v) if v is not None else "" for v in column.to_pylist()]  # as in a CSV: no temperature
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
            columns[column_name] = to_floats(column.cast(pa.float64(), safe=False))
        elif pa.types.is_string(kind) or pa.types.is_large_string(kind):
            columns[column_name] = words_or_numbers([str(v) if v is not None else "" for v in column.to_pylist()])
        else:
            guesses.append(Guess("role", f"column {column_name!r} of type {kind} left out", "cast it to numbers or text"))
    if not columns:
        raise InputError(f"{name}: no column of numbers or stamps", found="; ".join(notes), do="export the record with its columns")
    units = {**dict.fromkeys(columns, ""), **units}
    found = Table(name, list(columns), columns, units, range(table.num_rows), tuple(notes))
    return replace(found, guesses=tuple(guesses), durations=tuple(durations))


def _decoded(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """The values of a column that is kept as places in a dictionary, one after another; texts that are views are none to Arrow."""
    kind = pa.large_string() if column.type.value_type == pa.string_view() else column.type.value_type
    plain = [pa.DictionaryArray.from_arrays(c.indices, c.dictionary.cast(kind)).dictionary_decode() for c in column.chunks]
    return pa.chunked_array(plain, kind)


def _plain(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """A column with its values one after another: runs of one value, and texts that are views, as Polars gives them."""
    kind = column.type
    if pa.types.is_run_end_encoded(kind):
        import pyarrow.compute as pc

        return _plain(pa.chunked_array([pc.run_end_decode(chunk) for chunk in column.chunks], kind.value_type))
    return column.cast(pa.large_string()) if kind == pa.string_view() else column


def words_or_numbers(cells: list[str]) -> Array | list[str]:
    """Numbers that were kept as text, as numbers; the comma is the decimal sign where cells have commas and no points."""
    first = next((c for c in cells if not is_missing(c)), None)
    if first is None or not (is_number(first, ".") or is_number(first, ",")):
        return cells
    told = [c for c in cells if not is_missing(c)]
    # 20260131 is a day, and stays a stamp.
    if all(c.strip().isdigit() and len(c.strip()) == DATE for c in told):
        return cells
    decimal = "," if any("," in c for c in told) and not any("." in c for c in told) else "."
    if not all(is_number(c, decimal) for c in told):
        return cells
    return np.array([np.nan if is_missing(c) else to_number(c, decimal) for c in cells])
