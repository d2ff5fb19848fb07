"""Tables from what is in memory: a pandas DataFrame, an Arrow table, arrays by name. Read by the same rules as a file."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InputError, UsageError
from ...reading_options import Options
from ..moments.stamps import looks_like_stamp
from ..run import Array
from ..table import Table, from_arrow, words_or_numbers
from .dialect import is_missing
from .limits import Limits

NAME = "in memory"
#: Options that say how a file is laid out.
OF_FILES = ("delimiter", "decimal", "encoding", "header_line", "skip_footer", "sheet", "max_bytes")


def table_of(data: Any, name: str = NAME, options: Options = Options()) -> Table:  # noqa: B008 - frozen
    """A table from a pandas DataFrame, an Arrow table or a mapping of names to arrays (N,).

    An index of time of a DataFrame is its column of time. Masked and missing values are nan.

    Raises
    ------
    InputError: another kind of object, columns of different length or more than one dimension, names that are no names; more rows
    or columns than the options allow.
    UsageError: options that say how a text file is laid out.
    """
    if laid_out := [key for key in OF_FILES if getattr(options, key) != getattr(Options(), key)]:
        told = ", ".join(f"--{key.replace('_', '-')}" for key in laid_out)
        raise UsageError(f"{name}: {told} is for files, and this is none", do="leave it out")
    table = _table_of(data, name)
    Limits(options.max_bytes, options.max_rows, options.max_columns).check_shape(name, len(table.lines), len(table.columns))
    return table


def _table_of(data: Any, name: str) -> Table:
    if type(data).__module__.startswith("pyarrow") and hasattr(data, "schema"):
        import pyarrow as pa

        if isinstance(data, pa.RecordBatch):
            data = pa.Table.from_batches([data])
        elif isinstance(data, pa.RecordBatchReader):
            data = data.read_all()
        if not isinstance(data, pa.Table):
            raise InputError(f"{name}: not a record", found=type(data).__name__, allowed="an Arrow table or record batches")
        return from_arrow(data, name, [f"Arrow table, {data.num_rows} rows"])
    framed = type(data).__module__.startswith("pandas")
    if not framed and not isinstance(data, Mapping) and hasattr(data, "__arrow_c_stream__"):
        return from_arrow(_streamed(data, name), name, [f"{type(data).__name__}, by its Arrow stream"])
    if isinstance(data, np.ndarray) and data.dtype.names:
        data = {column: data[column] for column in data.dtype.names}
    if framed:
        data = _columns_of_frame(data, name)
    if not isinstance(data, Mapping):
        shape = getattr(data, "shape", None)
        raise InputError(
            f"{name}: not a record",
            found=type(data).__name__ + (f" of shape {shape}" if shape is not None else ""),
            allowed="a path, a pandas DataFrame, an Arrow table, or a mapping of names to arrays",
            do="name the columns, as in {'time_min': t, 'T1': readings}",
        )
    if not framed:
        _same_index(data, name)
    return _from_arrays(data, name)


def _streamed(data: Any, name: str) -> Any:
    """An Arrow table of whatever gives one away (Polars, DuckDB, ...).

    Raises
    ------
    InputError: what it gives is no table.
    """
    import pyarrow as pa

    try:
        return pa.table(data)
    except (pa.ArrowException, TypeError) as error:
        raise InputError(
            f"{name}: not a record",
            found=f"{type(data).__name__}: {str(error)[:80]}",
            allowed="columns of a table",
            do="give a table, as frame.select(...) does",
        ) from None


def _same_index(columns: Mapping[Any, Any], name: str) -> None:
    """Raises InputError where pandas Series have other labels than each other: pandas joins them by these."""
    indexes = {key: c.index for key, c in columns.items() if type(c).__module__.startswith("pandas") and hasattr(c, "index")}
    for key, index in indexes.items():
        first = next(iter(indexes))
        if not index.equals(indexes[first]):
            raise InputError(
                f"{name}: {key!r} has another index than {first!r}",
                found=f"{index[:3].tolist()} and {indexes[first][:3].tolist()} at their beginnings",
                allowed="pandas Series of one index, or arrays",
                do="pd.DataFrame(columns) puts them together by their labels, .to_numpy() by their places",
            )


def _columns_of_frame(frame: Any, name: str) -> dict[str, Any]:
    import pandas as pd

    if isinstance(frame, pd.Series):
        frame = frame.to_frame(frame.name if frame.name is not None else "T1")
    if not isinstance(frame, pd.DataFrame):
        raise InputError(f"{name}: not a record", found=type(frame).__name__, allowed="a pandas DataFrame or Series")
    if isinstance(frame.columns, pd.MultiIndex):
        raise InputError(
            f"{name}: columns of several levels",
            found=str(frame.columns[0]),
            allowed="one name a column",
            do="join the levels first: frame.columns = [' '.join(map(str, names)) for names in frame.columns]",
        )
    if frame.columns.duplicated().any():
        twice = frame.columns[frame.columns.duplicated()][0]
        raise InputError(f"{name}: the column {twice!r} twice", allowed="one column of each name", do="rename one of them")
    columns: dict[Any, Any] = {column: frame[column] for column in frame.columns}
    index = frame.index
    if isinstance(index, pd.PeriodIndex):
        index = index.to_timestamp()
    if isinstance(index, pd.MultiIndex):
        raise InputError(
            f"{name}: an index of several levels",
            found=", ".join(str(n) for n in index.names),
            allowed="an index of time, or none",
            do="reset_index() makes columns of them",
        )
    if isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex):
        title = "time" if index.name is None else str(index.name)
        while title in columns:
            title += " (index)"
        columns = {title: index.to_series(), **columns}
    elif index.name is not None and index.name not in columns:
        columns = {index.name: index.to_series(), **columns}
    elif index.name is None and pd.api.types.is_float_dtype(index.dtype) and "index" not in columns:
        columns = {"index": index.to_series(), **columns}
    elif index.name is None and len(index) and "time" not in columns and looks_like_stamp(str(index[0])):
        columns = {"time": index.to_series(), **columns}  # stamps as words or objects
    return columns


def _from_arrays(data: Mapping[Any, Any], name: str) -> Table:
    columns: dict[str, Array | list[str]] = {}
    units: dict[str, str] = {}
    durations = tuple(key for key, values in data.items() if _is_duration(values))
    for key, values in data.items():
        if not isinstance(key, str):
            raise InputError(
                f"{name}: a column is called {key!r}",
                found=type(key).__name__,
                allowed="names that are text",
                do="name them, or frame.columns = frame.columns.astype(str) where sensors are called by numbers",
            )
        columns[key], units[key] = _column(key, values, name)
    sizes = {key: len(column) for key, column in columns.items()}
    if not sizes:
        raise InputError(f"{name}: no columns", allowed="a column of time and at least one sensor")
    if len(set(sizes.values())) > 1:
        short, long = min(sizes, key=lambda k: sizes[k]), max(sizes, key=lambda k: sizes[k])
        raise InputError(
            f"{name}: columns of different length",
            found=f"{short!r} has {sizes[short]} readings, {long!r} {sizes[long]}",
            allowed="one length for all columns",
        )
    rows = next(iter(sizes.values()))
    return Table(
        name,
        list(columns),
        columns,
        units,
        range(rows),
        (f"{len(columns)} column{'s' if len(columns) > 1 else ''} of {rows} rows",),
        durations=durations,
    )


def _is_duration(values: Any) -> bool:
    """Whether a column holds lengths of time by its type."""
    return str(getattr(values, "dtype", "")).startswith(("timedelta64", "<m8", ">m8", "duration"))


def _column(key: str, values: Any, name: str) -> tuple[Array | list[str], str]:
    """(numbers (N,) with nan for none, or cells as text; unit) of one column."""
    if getattr(getattr(values, "dtype", None), "kind", "") == "c":
        raise InputError(
            f"{name}, column {key!r}: complex, not a number", allowed="readings", do="give their real part, or leave it out"
        )
    if type(values).__module__.startswith("pandas") and not hasattr(values, "columns"):
        return _series(key, values, name)
    if isinstance(values, np.ma.MaskedArray):
        holes = np.ma.getmaskarray(values)
        if values.dtype.kind in "mM":
            values = np.where(holes, np.array("NaT", dtype=values.dtype), np.asarray(values.data))
        elif values.dtype.kind in "fiub":
            values = np.where(holes, np.nan, np.asarray(values.data, dtype=float))
        else:
            values = np.where(holes, None, np.asarray(values.data, dtype=object))  # type: ignore[call-overload]
    if isinstance(values, list | tuple) and any(isinstance(v, str) for v in values):
        return _objects(key, list(values), name), ""
    try:
        array: Any = np.asarray(values) if not hasattr(values, "columns") else np.empty((0, 0))  # a table within a table
    except ValueError:  # lists of several lengths
        array = np.empty((0, 0))
    if array.ndim != 1:
        raise InputError(
            f"{name}, column {key!r}: not one-dimensional",
            found=f"shape {array.shape}" if array.shape != (0, 0) else type(values).__name__,
            allowed="(N,)",
            do="one name for each column; of rows that are dictionaries, pandas.DataFrame(rows)",
        )
    if array.dtype.kind == "b":
        return [str(v) for v in array], ""  # as in a CSV: no temperature
    if array.dtype.kind in "fiu":
        return np.array(array, dtype=np.float64, order="C"), ""  # what the caller does with his own later is not ours
    if array.dtype.kind == "m":
        if np.datetime_data(array.dtype)[0] in ("Y", "M"):
            raise InputError(
                f"{name}, column {key!r}: months and years have no length", found=str(array.dtype), allowed="seconds, ..."
            )
        return array / np.timedelta64(1, "s"), "s"
    if array.dtype.kind == "M":
        return ["" if np.isnat(v) else str(v) for v in array.astype("datetime64[us]")], ""
    if array.dtype.kind == "U":
        return words_or_numbers(array.tolist()), ""
    return _objects(key, array.tolist(), name), ""


def _series(key: str, series: Any, name: str) -> tuple[Array | list[str], str]:
    import pandas as pd

    series = pd.Series(series)
    if isinstance(series.dtype, pd.DatetimeTZDtype):
        series = series.dt.tz_convert("UTC")
        return ["" if pd.isna(v) else v.isoformat() for v in series], ""
    if pd.api.types.is_timedelta64_dtype(series.dtype):
        return series.dt.total_seconds().to_numpy(dtype=np.float64), "s"
    if pd.api.types.is_datetime64_dtype(series.dtype):
        return _column(key, series.to_numpy(), name)
    if pd.api.types.is_bool_dtype(series.dtype):
        return ["" if pd.isna(v) else str(v) for v in series], ""
    if pd.api.types.is_numeric_dtype(series.dtype):
        return series.to_numpy(dtype=np.float64, na_value=np.nan, copy=True), ""
    return _objects(key, series.tolist(), name), ""


def _objects(key: str, cells: list[Any], name: str) -> Array | list[str]:
    """A column of Python objects: numbers where all are, words where all are; a mixture is refused."""
    missing = [c is None or (isinstance(c, float) and np.isnan(c)) or type(c).__name__ in ("NAType", "NaTType") for c in cells]
    if not all(isinstance(c, str) for c in cells):  # words for no reading among numbers
        missing = [none or (isinstance(c, str) and is_missing(c)) for c, none in zip(cells, missing, strict=True)]
    told = [c for c, none in zip(cells, missing, strict=True) if not none]
    if told and all(isinstance(c, bool | np.bool_) for c in told):
        return ["" if none else str(c) for c, none in zip(cells, missing, strict=True)]  # as in a CSV: no temperature
    if all(_is_number(c) for c in told):
        try:
            return np.array([np.nan if none else float(c) for c, none in zip(cells, missing, strict=True)])
        except OverflowError:
            raise InputError(f"{name}, column {key!r}: a number beyond all floats", allowed="numbers below 1e308") from None
    if all(hasattr(c, "isoformat") for c in told):
        return ["" if none else _stamp(c) for c, none in zip(cells, missing, strict=True)]
    if all(isinstance(c, str) for c in told):
        return words_or_numbers(["" if none else str(c) for c, none in zip(cells, missing, strict=True)])
    first = next(i for i, c in enumerate(cells) if not missing[i] and not _is_number(c))
    raise InputError(
        f"{name}, row {first + 1}, column {key!r}: not a number",
        found=repr(cells[first]),
        allowed="numbers, stamps or words throughout",
        do="turn the column into numbers first, with nan for no reading",
    )


def _is_number(cell: Any) -> bool:
    """Whether an object is a number; True and False are none."""
    return (isinstance(cell, int | float | np.number) and not isinstance(cell, bool)) or type(cell).__name__ == "Decimal"


def _stamp(moment: Any) -> str:
    """A date, a clock time or both as text."""
    return str(moment.isoformat(" ") if hasattr(moment, "hour") and hasattr(moment, "year") else moment.isoformat())
