"""Files out, whole or not at all: written beside the target and moved over it."""

import json
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import UsageError
from .text import Row, to_csv, to_json, to_jsonl, to_markdown
from .whole import write_whole

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


def check_target(path: str, suffixes: Sequence[str], or_else: str = "") -> None:
    """Refuses a target before any work is done for it; or_else: what else could be named.

    Raises
    ------
    UsageError: unknown suffix, or no such folder.
    """
    target = Path(path)
    if path.endswith(("/", os.sep)):
        raise UsageError(f"{path}: one file is written here", found="a folder", allowed=" ".join(suffixes), do="name a file")
    if target.suffix.lower() not in suffixes:
        raise UsageError(
            f"{path}: cannot tell the format from the name",
            found=target.suffix or "no suffix",
            allowed=" ".join(suffixes),
            do="end the name so" + or_else,
        )
    if not target.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {str(target.parent)!r}", do="make it first")
    if target.is_dir():
        raise UsageError(f"{path}: a folder stands there", do="name a file")


def write_table(
    path: str,
    command: str,
    columns: Sequence[str],
    rows: Sequence[Row],
    input_: Sequence[Row] = (),
    excel_csv: bool = False,
) -> None:
    """A table in the format of the suffix; input_ says in JSON how the runs were read; excel_csv: as :func:`to_csv` has it."""
    suffix = Path(path).suffix.lower()
    if suffix == ".parquet":
        from .arrow import to_arrow, write_arrow

        write_whole(path, lambda p: write_arrow(p, to_arrow(columns, rows)))
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
    """One line more at the end of a file, written at once, whole or not at all: what was there stays.

    Raises
    ------
    OSError: it cannot be written.
    """
    data, size = (line + "\n").encode(), -1
    with Path(path).open("ab", buffering=0) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            while data:
                data = data[file.write(data) :]
        except OSError:
            with suppress(OSError):
                os.truncate(path, size)
            raise


def _write_text(path: str, text: str) -> None:
    with open(path, "w", encoding="utf-8", errors="backslashreplace", newline="") as out:
        out.write(text)


def write_text_whole(path: str, text: str, at_once: bool = False) -> None:
    """A text file, whole or not at all; at_once: it waits for no other file."""
    write_whole(path, lambda p: _write_text(p, text), at_once)


def write_json(path: str, document: Any, at_once: bool = False) -> None:
    """A JSON document; at_once: it waits for no other file."""
    write_whole(path, lambda p: _write_text(p, json.dumps(document, indent=1) + "\n"), at_once)
