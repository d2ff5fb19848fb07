"""Large text files of hundreds of columns of nothing but numbers, of which a few lines are held at once beside the table."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from ..errors import ThermofastError
from ..reading_options import Options
from .run import Array
from .table import WIDE, Table, only_numbers, parsed
from .tables.cells import without
from .tables.limits import Limits
from .tables.lines import TAIL, without_cut_end
from .tables.text import SAMPLE_BYTES, read_text

#: Bytes from which on a file is not held, and of a piece in which it is looked at.
LARGE, PIECE = 1 << 22, 1 << 16
#: Options that ask for a look at all of a text.
LOOKED_THROUGH = ("encoding", "decimal", "delimiter", "header_line", "sheet", "skip_footer", "exclude")


def read_wide(path: Path, name: str, options: Options, limits: Limits) -> Table | None:
    """The table of such a file as :func:`read_text` has it; None where anything in it is anything else, which that one tells."""
    usual = Options()
    if any(getattr(options, key) != getattr(usual, key) for key in LOOKED_THROUGH):
        return None
    if not (path.is_file() and os.access(path, os.R_OK) and LARGE <= (size := path.stat().st_size) <= limits.max_bytes):
        return None
    with path.open("rb") as file:
        head = file.read(SAMPLE_BYTES)
        head += file.readline()
        try:
            first = read_text(head, name, options)
        except ThermofastError:
            return None
        pa.default_memory_pool().release_unused()  # of ten thousand columns pyarrow keeps a tenth of the table's size for later
        columns = list(first.columns.values())
        dialect, told = first.dialect, len(first.notes) + len(first.faults) + len(first.guesses)
        if dialect is None or told > 1 or len(columns) < WIDE or not all(isinstance(c, np.ndarray) for c in columns):
            return None
        rows = len(first.lines)
        if dialect.decimal != "." or first.lines != range(dialect.data_line, dialect.data_line + rows):
            return None
        begin, lines = file.tell(), 0
        for piece in iter(lambda: file.read(PIECE), b""):
            if not only_numbers(piece, dialect.delimiter):
                return None
            lines += piece.count(b"\n")
        limits.check_shape(name, rows + lines, len(columns))
        file.seek(max(begin, size - TAIL))
        end = file.read()
        if without_cut_end(end, dialect)[1]:
            return None
        table = np.empty((rows + lines + (not end.endswith(b"\n")), len(columns)), order="F")
        for i, column in enumerate(columns):
            table[:rows, i] = column
        file.seek(begin)
        full = parsed(file, table, rows, dialect.delimiter)
    if full != len(table):  # empty lines, or a row of another width
        return None
    more = frozenset(m.lower() for m in options.missing)
    whole: dict[str, Array | list[str]] = {n: without(table[:, i], more, n) for i, n in enumerate(first.columns)}
    return replace(first, columns=whole, lines=range(dialect.data_line, dialect.data_line + full))
