"""Text tables: header and dialect by our own rules, the body by pyarrow with declared types."""

import io
import re

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from ..errors import InputError, listed
from .dialect import Dialect, binary, detect_dialect, detect_encoding, is_missing, is_number, split
from .run import Array, Options
from .table import Table, to_floats

SAMPLE_BYTES = 1 << 18
LINE_END = re.compile(r"\r\n|\n|\r")


def read_text(data: bytes, name: str, options: Options) -> Table:
    """A table from the bytes of a text file.

    Raises
    ------
    InputError: empty, binary, no rows, ragged rows, words for numbers.
    """
    if not data.strip():
        raise InputError(f"{name}: the file is empty", allowed="a header line and rows of readings", do="export the record again")
    encoding = options.encoding or detect_encoding(data, name)
    if options.encoding or encoding not in ("utf-8", "utf-8-sig"):
        try:
            text = data.decode(encoding)
            if sum(ord(c) < 32 and c not in "\t\n\r" for c in text[:20000]) > 0.01 * len(text[:20000]):
                raise binary(name)
            data = text.lstrip("\ufeff").encode("utf-8")
        except (UnicodeError, LookupError) as error:
            raise InputError(
                f"{name}: cannot be decoded as {encoding}", found=str(error), do="say another --encoding, or none"
            ) from None
    elif data.startswith(b"\xef\xbb\xbf"):
        data = data[3:]
    head = LINE_END.split(data[: _sample_end(data)].decode("utf-8", errors="replace"))
    dialect = detect_dialect(head, encoding, name, options)
    names, units = _names(head, dialect, name)
    start = _offset(data, dialect.data_line)
    body = data[start:]
    if dialect.delimiter == " ":
        body = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", body)
        body = re.sub(rb"[ \t]+", b"\t", body)
    sample = [split(line, dialect.delimiter) for line in head[dialect.data_line :] if line.strip()][:200]
    more = frozenset(m.lower() for m in options.missing)
    text_columns = {
        n for i, n in enumerate(names) if _is_text([r[i] for r in sample if len(r) == len(names)], dialect.decimal, more)
    }
    text_columns |= {n for n in names if n in options.exclude}  # nobody will read them: they may hold anything
    columns, notes = _parse_body(body, names, text_columns, dialect, name, more)
    notes = [dialect.describe(), *notes]
    return Table(name, names, columns, dict(zip(names, units, strict=True)), dialect.data_line, tuple(notes))


def _sample_end(data: bytes) -> int:
    """Where the sample ends that tells the layout: at a line's end, after SAMPLE_BYTES and at least eight lines."""
    for count, found in enumerate(re.finditer(rb"\r\n|\n|\r", data)):
        if found.end() >= SAMPLE_BYTES and count >= 8:
            return found.end()
    return len(data)


def _offset(data: bytes, line: int) -> int:
    position = 0
    for _ in range(line):
        found = re.compile(rb"\r\n|\n|\r").search(data, position)
        position = found.end() if found else len(data)
    return position


def _names(head: list[str], dialect: Dialect, name: str) -> tuple[list[str], list[str]]:
    width = dialect.width
    cells = split(head[dialect.header_line], dialect.delimiter) if dialect.header_line is not None else []
    units = split(head[dialect.unit_line], dialect.delimiter) if dialect.unit_line is not None else []
    rows = [split(line, dialect.delimiter) for line in head[dialect.data_line :][:50] if line.strip()]
    if cells and len(cells) == width - 1 and all(row[-1].strip() == "" for row in rows if len(row) == width):
        cells.append("")  # rows that end in a delimiter; otherwise no one can tell which name is missing
    if cells and len(cells) != width:
        raise InputError(
            f"{name}, line {dialect.data_line + 1}: the row has {width} cells and the header {len(cells)}",
            allowed="as many names as cells",
            do="mend the header, or say --header-line and --delimiter",
        )
    names: list[str] = []
    taken: set[str] = set()
    for i in range(width):
        cell = cells[i].strip().lstrip("#").strip() if i < len(cells) else ""
        base = unique = cell or f"column {i + 1}"
        count = 2
        while unique in taken:
            unique = f"{base} ({count})"
            count += 1
        names.append(unique)
        taken.add(unique)
    return names, [units[i].strip() if i < len(units) else "" for i in range(width)]


def _is_text(cells: list[str], decimal: str, more: frozenset[str]) -> bool:
    if decimal == "." and _all_floats(cells):
        return False
    told = [c for c in cells if not is_missing(c, more)]
    return bool(told) and sum(is_number(c, decimal) for c in told) < 0.5 * len(told)


def _all_floats(cells: list[str]) -> bool:
    try:
        for c in cells:
            float(c)
    except ValueError:
        return False
    return True


def _parse_body(
    body: bytes, names: list[str], text_columns: set[str], dialect: Dialect, name: str, more: frozenset[str]
) -> tuple[dict[str, Array | list[str]], list[str]]:
    ragged: list[str] = []

    def ragged_row(row: pacsv.InvalidRow) -> str:
        ragged.append(row.text)
        return "skip"

    delimiter = "\t" if dialect.delimiter == " " else dialect.delimiter

    def parse(types: dict[str, pa.DataType]) -> pa.Table:
        ragged.clear()
        return pacsv.read_csv(
            io.BytesIO(body),
            read_options=pacsv.ReadOptions(column_names=names, block_size=max(len(body) + 1, 1 << 20)),
            parse_options=pacsv.ParseOptions(delimiter=delimiter, invalid_row_handler=ragged_row),
            convert_options=pacsv.ConvertOptions(
                column_types=types, null_values=[""], decimal_point=dialect.decimal, strings_can_be_null=False
            ),
        )

    if not body.strip():
        raise InputError(f"{name}: a header and no rows", allowed="rows of readings", do="export the record again")
    types = {n: pa.string() if n in text_columns else pa.float64() for n in names}
    slow = False
    try:
        table = parse(types)
    except pa.ArrowInvalid:
        # Some cell is no number: look at each, for the words that mean 'no reading' and to name the others. The words are not
        # given to pyarrow, which would look for each of them in every column of every record.
        table, slow = parse(dict.fromkeys(names, pa.string())), True
    notes = _check_ragged(ragged, body, len(names), delimiter, dialect, name)
    columns: dict[str, Array | list[str]] = {}
    for n in names:
        column = table.column(n)
        if n in text_columns:
            columns[n] = column.to_pylist()
        elif slow:
            columns[n] = _numbers(column.to_pylist(), n, dialect, name, more)
        else:
            columns[n] = _without(to_floats(column), more)
    return columns, notes


def _without(values: Array, missing: frozenset[str]) -> Array:
    """Numbers that the user said mean 'no reading' (85, -999) as nan."""
    numbers = [float(m) for m in missing if is_number(m, ".")]
    return np.where(np.isin(values, numbers), np.nan, values) if numbers else values


def _check_ragged(ragged: list[str], body: bytes, width: int, delimiter: str, dialect: Dialect, name: str) -> list[str]:
    """A note where only the last line is cut short, as when a logger is switched off; else an error naming the row."""
    if not ragged:
        return []
    lines = LINE_END.split(body.decode("utf-8", errors="replace"))
    counts = [(i, len(split(line, delimiter))) for i, line in enumerate(lines) if line.strip()]
    bad = [(i, cells) for i, cells in counts if cells != width]
    first, cells = bad[0] if bad else (0, width)
    line = dialect.data_line + first + 1
    if len(bad) == 1 and first == counts[-1][0] and cells < width and not body.endswith((b"\n", b"\r")):
        return [f"the last line ({line}) is cut short and was left out"]
    raise InputError(
        f"{name}, line {line}: the row has {cells} cells, the others {width}",
        found=lines[first][:80],
        allowed=f"{width} cells in each row",
        do=f"mend the row{f' and {len(bad) - 1} more like it' if len(bad) > 1 else ''}, or check --delimiter and --decimal",
    )


def _numbers(cells: list[str], column: str, dialect: Dialect, name: str, more: frozenset[str]) -> Array:
    values = np.full(len(cells), np.nan)
    bad: list[int] = []
    for i, cell in enumerate(cells):
        if is_missing(cell, more):
            continue
        text = cell.strip()
        if is_number(text, dialect.decimal):
            values[i] = float(text.replace(",", "."))
        else:
            bad.append(i)
    if bad:
        found = listed(dict.fromkeys(repr(cells[i]) for i in bad), 3)
        raise InputError(
            f"{name}, line {dialect.data_line + bad[0] + 1}, column {column!r}: not a number",
            found=found + (f" in {len(bad)} rows" if len(bad) > 1 else ""),
            allowed="a number, an empty cell, or a known word for 'no reading' (NaN, OL, ---, ...)",
            do=f"mend the cell, say --missing {cells[bad[0]].strip()!r} if it means 'no reading', or --exclude {column!r}",
        )
    return values
