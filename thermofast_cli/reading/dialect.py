"""How a text file is laid out: encoding, delimiter, decimal sign, header. Decided by rule, never by a guesser."""

import csv
import re
from dataclasses import dataclass
from itertools import pairwise

from ..errors import InputError
from .run import Options

#: Cells that loggers write where there is no reading (compared in lower case).
MISSING = frozenset(
    [
        "",
        "nan",
        "na",
        "n/a",
        "n.a.",
        "null",
        "none",
        "nil",
        "-",
        "--",
        "---",
        "----",
        "ol",
        "o.l",
        "o.l.",
        "0l",
        "+ol",
        "-ol",
        "over",
        "overload",
        "overflow",
        "ovfl",
        "open",
        "short",
        "err",
        "error",
        "#n/a",
        "#num!",
        "#value!",
        "#div/0!",
        "inf",
        "+inf",
        "-inf",
        "infinity",
        "bad",
        "fault",
        "fail",
        "invalid",
        "no data",
        "nodata",
        "?",
        "*",
        "***",
        "****",
        "*****",
    ]
)
DELIMITERS = ("\t", ";", ",", "|", " ")
SAMPLE_LINES = 400
csv.field_size_limit(1 << 30)  # a row of thirty thousand cells, read with the wrong delimiter, is one cell
#: Cells of a row that are looked at to tell what it is: a row of ten thousand is known by its first hundred.
SAMPLE_CELLS = 100
NAMES = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "blanks"}
_NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"),
    ",": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?$"),
}
_STAMP = re.compile(
    r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}([T ]\d{1,2}:\d{2}.*)?$|\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?( ?[APap]\.?[Mm]\.?)?$"
)
_UNIT = re.compile(
    r"[\[(]?(s|sec|secs|seconds|min|mins|minutes|h|hours|ms|°?\s?[CFK]|deg\s?[CFK]|degrees?.*|celsius|kelvin|fahrenheit|v|mv|a|ma|w|kw|%|"
    r"rpm|1/min|um|µm|mm|l/min|bar|pa|kpa|yyyy.*|hh.*|dd.*|)[\])]?$",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Dialect:
    """header_line and unit_line count from 0 and may be None; data_line is the first row of readings."""

    encoding: str
    delimiter: str
    decimal: str
    header_line: int | None
    unit_line: int | None
    data_line: int
    width: int

    def describe(self) -> str:
        header = f"header in line {self.header_line + 1}" if self.header_line is not None else "no header"
        mark = "decimal comma" if self.decimal == "," else "decimal point"
        return f"{NAMES.get(self.delimiter, repr(self.delimiter))}-separated, {mark}, {header}, {self.encoding}"


def detect_encoding(data: bytes, name: str) -> str:
    """BOM, then the pattern of NULs, then strict UTF-8, then Windows-1252.

    Raises
    ------
    InputError: the file is binary.
    """
    head = data[:65536]
    if head.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in head:
        even, odd = head[0::2].count(0), head[1::2].count(0)
        if odd > 0.3 * len(head) / 2 and even < 0.02 * len(head):
            return "utf-16-le"
        if even > 0.3 * len(head) / 2 and odd < 0.02 * len(head):
            return "utf-16-be"
        raise binary(name)
    control = sum(head.count(bytes([c])) for c in range(32) if c not in (9, 10, 12, 13, 26))
    if control > 0.01 * len(head):
        raise binary(name)
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def binary(name: str) -> InputError:
    """The error of a file that is no text."""
    return InputError(
        f"{name}: not a text table",
        found="binary data",
        allowed="CSV text, or Parquet",
        do="export the record as CSV from the logger's software",
    )


def is_missing(cell: str, more: frozenset[str] = frozenset()) -> bool:
    """Whether a cell says 'no reading'."""
    cell = cell.strip().lower()
    return cell in MISSING or cell in more


def is_number(cell: str, decimal: str) -> bool:
    return bool(_NUMBER[decimal].match(cell.strip()))


def split(line: str, delimiter: str) -> list[str]:
    """Cells of one line; quotes are understood, a run of blanks is one delimiter."""
    if delimiter == " ":
        return line.split()
    return next(csv.reader([line], delimiter=delimiter), [])


def _data_like(cells: list[str], decimal: str) -> bool:
    cells = cells[:SAMPLE_CELLS]
    told = [c for c in cells if not is_missing(c)]
    numbers = sum(is_number(c, decimal) for c in told)
    stamps = sum(bool(_STAMP.match(c.strip())) for c in told)
    return numbers + stamps > 0 and numbers + stamps >= 0.5 * len(told)


def detect_dialect(lines: list[str], encoding: str, name: str, options: Options) -> Dialect:
    """Layout of the first lines of a table (without line ends).

    Raises
    ------
    InputError: empty, no rows of readings.
    """
    lines = lines[:SAMPLE_LINES]
    if not any(line.strip() for line in lines):
        raise InputError(f"{name}: the file is empty", allowed="a header line and rows of readings", do="export the record again")
    best: tuple[float, Dialect] | None = None
    for delimiter in (options.delimiter,) if options.delimiter else DELIMITERS:
        decimals = (options.decimal,) if options.decimal else ((".",) if delimiter == "," else (".", ","))
        for decimal in decimals:
            found = _layout(lines, delimiter, decimal, encoding, options)
            # Prefer more numbers read, then a delimiter that leaves nothing inside its cells.
            if found and (best is None or found[0] > best[0] + 1e-9):
                best = found
    if best is None:
        alone = sum(bool(line.strip()) for line in lines) == 1
        raise InputError(
            f"{name}: a header and no row of readings" if alone else f"{name}: no row of readings",
            found=f"first line: {next(x for x in lines if x.strip())[:80]!r}",
            allowed="rows with a time and at least one number",
            do="check the export, or say --delimiter, --decimal and --header-line",
        )
    return best[1]


def _layout(lines: list[str], delimiter: str, decimal: str, encoding: str, options: Options) -> tuple[float, Dialect] | None:
    rows = [split(line, delimiter) if line.strip() and not line.startswith("#") else [] for line in lines]
    data = [i for i, row in enumerate(rows) if len(row) > 1 and _data_like(row, decimal)]
    if options.header_line is not None:
        data = [i for i in data if i >= options.header_line]
    if not data:
        return None
    widths = [len(rows[i]) for i in data]
    width = max(set(widths), key=widths.count)
    data = [i for i in data if len(rows[i]) == width]
    first = data[0]
    if len(data) > 2:  # numbers in a preamble are no readings: those come in an unbroken block
        first = next((a for a, b in pairwise(data) if b == a + 1 or not any(rows[a + 1 : b])), first)
    header: int | None = None
    unit: int | None = None
    if options.header_line is not None:
        header = options.header_line - 1 if options.header_line > 0 else None
    else:
        above = [i for i in range(first) if rows[i]]
        named = [i for i in above[-3:] if abs(len(rows[i]) - width) <= 1 and not _data_like(rows[i], decimal)]
        if named:
            header = named[-1]
            units = sum(bool(_UNIT.match(c.strip())) for c in rows[header])
            before = named[-2] if len(named) > 1 else None
            if before is not None and len(rows[before]) == len(rows[header]) and units >= 0.5 * len(rows[header]):
                header, unit = named[-2], header
    if header is None and options.header_line is None:
        header = next(
            (i for i in range(first - 1, -1, -1) if lines[i].startswith("#") and len(split(lines[i], delimiter)) == width), None
        )
    explained = len(data) / max(sum(1 for row in rows if row), 1)
    cells = [c for i in data[:100] if i >= first for c in rows[i][:SAMPLE_CELLS]]
    numbers = sum(is_number(c, decimal) or bool(_STAMP.match(c.strip())) for c in cells if not is_missing(c))
    told = sum(not is_missing(c) for c in cells)
    share = numbers / max(told, 1)
    score = share * explained * min(width, 1000) ** 0.25 + (
        0.1 if header is not None and len(split(lines[header], delimiter)) == width else 0.0
    )
    return score, Dialect(encoding, delimiter, decimal, header, unit, first, width)
