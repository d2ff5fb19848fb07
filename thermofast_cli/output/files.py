"""Files out, whole or not at all: written beside the target and moved over it."""

import json
import math
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UsageError
from .text import Row, plain, to_csv, to_json, to_jsonl, to_markdown

TABLE_SUFFIXES = (".csv", ".json", ".jsonl", ".parquet", ".md", ".xlsx")
#: Outputs of a whole result, not of any table.
REPORT_SUFFIXES = (".html",)


def check_targets(targets: Sequence[str | None], sources: Sequence[str]) -> None:
    """Refuses an output that would replace a record or another output.

    Raises
    ------
    UsageError: two paths are the same file.
    """
    seen = {os.path.realpath(s): f"the record {s}" for s in sources if s != "-"}
    for target in targets:
        if target is None:
            continue
        real = os.path.realpath(target)
        if real in seen:
            raise UsageError(f"{target}: would overwrite {seen[real]}", do="name another file")
        seen[real] = "another output of this command"


def check_target(path: str, suffixes: Sequence[str]) -> None:
    """Refuses a target before any work is done for it.

    Raises
    ------
    UsageError: unknown suffix, or no such folder.
    """
    target = Path(path)
    if target.suffix.lower() not in suffixes:
        raise UsageError(
            f"{path}: cannot tell the format from the name", found=target.suffix or "no suffix", allowed=" ".join(suffixes)
        )
    if not target.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {str(target.parent)!r}", do="make it first")
    if target.is_dir():
        raise UsageError(f"{path}: a folder stands there", do="name a file")


def write_whole(path: str, write: Callable[[str], None]) -> None:
    """Runs ``write`` on a temporary name with the same suffix, then moves the file into place.

    Raises
    ------
    UsageError: the file cannot be written; nothing is left behind.
    """
    target = Path(path)
    try:
        handle, temporary = tempfile.mkstemp(prefix=".thermofast-", suffix=target.suffix, dir=target.parent)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written", found=str(error.strerror), do="choose another place") from None
    os.close(handle)
    try:
        write(temporary)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written", found=str(error.strerror), do="choose another place") from None
    finally:
        if os.path.exists(temporary):
            os.unlink(temporary)


def write_table(
    path: str, command: str, columns: Sequence[str], rows: Sequence[Row], input_: Sequence[Row] = (), excel_csv: bool = False
) -> None:
    """A table in the format of the suffix; input_ says in JSON how the runs were read; excel_csv: as :func:`to_csv` has it."""
    suffix = Path(path).suffix.lower()
    if suffix == ".parquet":
        write_whole(path, lambda p: _parquet(p, columns, rows))
        return
    if suffix == ".xlsx":
        from .report.excel import write_rows

        write_whole(path, lambda p: write_rows(p, command, columns, rows))
        return
    text = {
        ".csv": lambda: to_csv(columns, rows, excel=excel_csv),
        ".json": lambda: to_json(command, rows, input_),
        ".jsonl": lambda: to_jsonl(rows),
        ".md": lambda: to_markdown(columns, rows),
    }[suffix]()
    write_whole(path, lambda p: _write_text(p, text))


def write_columns(path: str, columns: dict[str, Any]) -> None:
    """Arrays (N,) by name as a record: .csv or .parquet."""
    if Path(path).suffix.lower() == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as papq

        write_whole(path, lambda p: papq.write_table(pa.table(columns), p))
        return
    rows = zip(*[[f"{v:.10g}" for v in values] for values in columns.values()], strict=True)
    text = "\n".join([",".join(columns), *map(",".join, rows)]) + "\n"
    write_whole(path, lambda p: _write_text(p, text))


def append_line(path: str, line: str) -> None:
    """One line more at the end of a file, written at once: what was there stays."""
    with Path(path).open("a", encoding="utf-8") as file:
        file.write(line + "\n")


def _write_text(path: str, text: str) -> None:
    with open(path, "w", encoding="utf-8", errors="backslashreplace", newline="") as out:
        out.write(text)


def write_text_whole(path: str, text: str) -> None:
    """A text file, whole or not at all."""
    write_whole(path, lambda p: _write_text(p, text))


def write_json(path: str, document: Any) -> None:
    """A JSON document."""
    write_whole(path, lambda p: _write_text(p, json.dumps(document, indent=1) + "\n"))


def _parquet(path: str, columns: Sequence[str], rows: Sequence[Row]) -> None:
    import pyarrow.parquet as papq

    papq.write_table(to_arrow(columns, rows), path)


def to_arrow(columns: Sequence[str], rows: Sequence[Row]) -> Any:
    """Records as an Arrow table: the columns of the Parquet file."""
    import pyarrow as pa

    return pa.table({c: _arrow([row[c] for row in rows]) for c in columns})


def _arrow(values: list[Any]) -> Any:
    """A column; lists of words stay lists, what is nested deeper becomes JSON text."""
    import pyarrow as pa

    kinds = set(map(type, values)) - {type(None)}
    if kinds <= {float}:  # a column without a single number is still a column of numbers
        return _from_buffers(pa.float64(), [v if v is not None and math.isfinite(v) else None for v in values], np.float64)
    if kinds == {int}:
        return _from_buffers(pa.int64(), values, np.int64)
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
