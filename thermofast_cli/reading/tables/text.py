"""Text tables: header and dialect by our own rules, the body by pyarrow with declared types."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from ...errors import InputError, listed
from ...reading_options import Options, joined
from ..headings.constants import kind_of, not_applied, without_rows_beneath
from ..headings.interval import interval_above
from ..headings.names import names_and_units
from ..moments.stamps import looks_like_stamp
from ..run import Array, Guess
from ..table import Table, to_floats, wide_numbers
from ..units import parse_unit, unit_above, unit_changes
from .cells import with_unit, without
from .dialect import THOUSAND, Dialect, detect_dialect, is_missing, is_number, number_within, split, to_number
from .encoding import odd_letters, refuse_markup, to_utf8
from .lines import (
    LINE_END,
    begins_of_lines,
    closed_quotes,
    joined_segments,
    newlines,
    plain_rows,
    plain_scope,
    transposed,
    united_headers,
    without_cut_end,
    without_last,
    without_separator_line,
)

SAMPLE_BYTES = 1 << 18
#: Bytes from which a body is parsed in pieces by several threads, and of such a piece.
LARGE, PIECE = 1 << 24, 1 << 20
#: Share of the lines without readings that is told of as a fault, not as a word of the logger.
MANY_EVENTS = 0.05
#: Columns with words among their numbers that are found one by one: each is another pass.
SINGLY = 4
#: A number in several groups of thousands.
_THOUSANDS = {d: re.compile(rf"\s*[+-]?\d{{1,3}}(?:[{o}]\d{{3}}){{2,}}\s*$") for d, o in (".,", ",.")}
#: A number with decimals in brackets, or with a letter or a sign behind it.
_ODD_NUMBER = {d: re.compile(rf"\(?[+-]?\d+[{d}]\d+\)? ?[A-Za-z*!<>#-]?$") for d in ".,"}
#: Numbers in the digits and signs of East Asian typesetting, which are as wide as a letter there.
_FULL_WIDTH = re.compile(rb"(?:\xef\xbc[\x8b-\x8f\x90-\x9a])*\xef\xbc[\x90-\x99](?:\xef\xbc[\x8b-\x8f\x90-\x9a])*")
_HALF_WIDTH = {code + 0xFEE0: code for code in range(0x2B, 0x3B)}
#: Share of a column's cells that must be numbers for it to be one of numbers.
MOSTLY = 0.5


def read_text(data: bytes, name: str, options: Options) -> Table:
    """A table from the bytes of a text file. A column with cells that are no numbers is a fault told only where it is used.

    Raises
    ------
    InputError: empty, binary, no rows, ragged rows.
    """
    if not data or data.isspace():
        raise InputError(f"{name}: the file is empty", allowed="a header line and rows of readings", do="export the record again")
    data, encoding, notes = to_utf8(data, name, options.encoding)
    # To look for one byte takes a tenth of the time of looking for three.
    if b"\xe2" in data and (b"\xe2\x88\x92" in data or b"\xe2\x80\x93" in data):
        data = re.sub(rb"\xe2\x88\x92|(?<![^\s;,|\"])\xe2\x80\x93(?=\d)", b"-", data)  # the minus of typesetters, and their dash
    if b"\xef" in data and _FULL_WIDTH.search(data[:SAMPLE_BYTES]):
        data = _FULL_WIDTH.sub(lambda m: m[0].decode().translate(_HALF_WIDTH).encode(), data)
        notes.append("full-width digits read as digits")
    if b"\r\r\n" in data[:SAMPLE_BYTES]:
        data = data.replace(b"\r\r\n", b"\r\n")  # written twice through a text layer
    if options.skip_footer:
        data = without_last(data, options.skip_footer)
        if not data.strip():
            raise InputError(f"{name}: --skip-footer {options.skip_footer} leaves no line", do="leave fewer out")
        notes.append(f"the last {options.skip_footer} lines left out, as told")
    refuse_markup(data, name)
    data, separator = without_separator_line(data)
    data, written = plain_rows(data)
    data, quotes = closed_quotes(data)
    data, segments = joined_segments(data, name)
    data, scope = plain_scope(data)
    data, guesses = transposed(data)
    if encoding == "cp1252" and not options.encoding and (odd := odd_letters(data)):
        text = f"letters of an unknown alphabet, read as Windows-1252: {odd[:12]!r}"
        guesses.append(Guess("layout", text, "--encoding says which (cp1253, koi8_r, gb18030, euc_jp, ...)"))
    notes += written + quotes + segments + scope
    head = LINE_END.split(data[: _sample_end(data)].decode("utf-8", errors="replace"))
    told = options if options.delimiter or not separator else replace(options, delimiter=separator)
    dialect = detect_dialect(head, encoding, name, told)
    united, of_headers = united_headers(data, head, dialect, name) if options.header_line is None else (data, [])
    if of_headers:
        data, head = united, LINE_END.split(united[: _sample_end(united)].decode())
        dialect = detect_dialect(head, encoding, name, replace(told, delimiter=dialect.delimiter))
        notes += of_headers
    start = _offset(data, dialect.data_line)
    body = data[start:]
    del data, united  # a large file is held once
    if body.find(b"\n", 0, -1) < 0:
        body = body.replace(b"\r", b"\n")  # line ends of old Macintoshes
    if dialect.delimiter == " ":
        body = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", body)
        body = re.sub(rb"[ \t]+", b"\t", body)
    blank = b"[" + re.escape(dialect.delimiter).encode() + rb' "]'
    if dialect.delimiter != " " and not begins_of_lines(body).isdisjoint(f'{dialect.delimiter} "'.encode()):
        # Rows of nothing but delimiters, as sheets have them, are empty.
        body = re.sub(rb"(?m)^" + blank + rb"+(?=\r?$)", b"", body)
    body = _first_row_as_wide(body, head, dialect)
    body, beneath, constants = without_rows_beneath(body, dialect)
    body, cut = without_cut_end(body, dialect)
    body, footer = _without_footer(body, head, dialect)
    notes += [*beneath, *cut, *footer]
    guesses += not_applied([*head[: dialect.header_line or 0], *constants], dialect)
    lines = head[dialect.data_line :]
    joined = _decimal_commas(body, head, dialect)
    if joined is not None:
        body, dialect = joined
        lines = body.decode().splitlines()
        text = "decimal commas in a comma-separated file: every second comma taken for a decimal sign"
        guesses.append(Guess("layout", text, "export with semicolons to be sure"))
    names, units = names_and_units(head, dialect, name)
    more = frozenset(m.lower() for m in options.missing)
    clean, strangers, headers, lost = _without_strangers(body, head, dialect) if _in_trouble(body, dialect) else (body, [], [], [])
    notes += strangers
    guesses += lost
    columns, faults, carried, at, told_notes = _parse_body(clean, lines, names, dialect, name, more, set(options.exclude))
    notes = [dialect.describe(), *notes, *told_notes]
    unit_of = {n: u or carried.get(n, "") for n, u in zip(names, units, strict=True)}
    comments = [line for line in head[dialect.data_line :] if line[:1] in "#%"]
    named = dialect.header_line is not None
    above = [*head[: dialect.header_line if named else dialect.data_line], *comments]
    again = tuple(dialect.data_line + i for i in headers)
    unit, interval = unit_above(above), interval_above(above)
    return Table(name, names, columns, unit_of, at, tuple(notes), faults, tuple(guesses), named, dialect, unit, interval, (), again)


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


def _first_row_as_wide(body: bytes, head: list[str], dialect: Dialect) -> bytes:
    """Without what the first row alone has more than the others, under a name of its own: the logger's serial number."""
    if dialect.delimiter == " ":
        return body  # its cells are parted by tabs from here on
    first = split(head[dialect.data_line], dialect.delimiter) if dialect.data_line < len(head) else []
    names = split(head[dialect.header_line], dialect.delimiter) if dialect.header_line is not None else []
    if not dialect.width < len(first) == len(names) or any('"' in cell for cell in first):
        return body
    end = body.find(b"\n")
    kept = dialect.delimiter.join(first[: dialect.width]).encode()
    return kept + body[end:]


def _without_footer(body: bytes, head: list[str], dialect: Dialect) -> tuple[bytes, list[str]]:
    """Without rows at the end, as wide as the others, that begin with words where the others begin with a number or a stamp."""
    rows = [split(line, dialect.delimiter) for line in head[dialect.data_line : dialect.data_line + 60] if line.strip()]
    first = {kind_of(row[0], dialect.decimal) for row in rows[:40] if len(row) == dialect.width}
    if not first <= {"number", "stamp"} or not first:
        return body, []
    end, dropped = len(body), []
    for _ in range(40):
        stop = end
        while stop and body[stop - 1] in b"\r\n":
            stop -= 1
        at = max(body.rfind(b"\n", 0, stop), body.rfind(b"\r", 0, stop)) + 1
        cells = split(body[at:stop].decode("utf-8", errors="replace"), dialect.delimiter)
        begins = next((c.strip() for c in cells if c.strip()), "")  # Testo leaves the first cell empty: ;Min:;20,0
        if at == 0 or len(cells) != dialect.width or kind_of(begins, dialect.decimal) != "words":
            break
        end = at
        dropped.append(begins)
    return (
        (body[:end], [f"{len(dropped)} lines below the readings left out ({listed(dropped[::-1], 3)})"]) if dropped else (body, [])
    )


def _without_strangers(body: bytes, head: list[str], dialect: Dialect) -> tuple[bytes, list[str], list[int], list[Guess]]:
    """With empty lines for those that hold no readings (the header again, comments, events), how many there were, which of them
    were headers, and that so many are none.
    """
    names = {head[i].strip() for i in (dialect.header_line, *dialect.unit_lines) if i is not None}
    lines = body.split(b"\n")
    kept, comments, headers, events, first = [], 0, list[int](), 0, 0
    last = max((i for i, line in enumerate(lines) if line.strip()), default=0)
    for i, line in enumerate(lines):
        text = line.decode("utf-8", errors="replace").strip()
        if text and text in names:
            headers.append(i)
            line = b""
        elif text.startswith(("#", "%", "//")):
            comments += 1
            line = b""
        elif text and i < last and _is_event(split(text, dialect.delimiter), dialect):
            first = first if events else i
            events += 1
            line = b""
        kept.append(line)
    told = [(len(headers), "repeated headers"), (comments, "comment lines"), (events, "lines without readings")]
    notes = [f"{n} {what} left out" for n, what in told if n]
    lost = []
    if events > MANY_EVENTS * len(lines):
        text = f"{events} of {len(lines)} lines hold no readings and are left out"
        lost.append(Guess("lines", text, f"look at them; line {first + dialect.data_line + 1} is the first"))
    return (b"\n".join(kept), notes, headers, lost) if notes else (body, [], [], [])


def _is_event(cells: list[str], dialect: Dialect) -> bool:
    """Whether a line of another width tells of something instead of readings."""
    return len(cells) != dialect.width and not _reads(cells, dialect.decimal)


def _decimal_commas(body: bytes, head: list[str], dialect: Dialect) -> tuple[bytes, Dialect] | None:
    """Body and dialect where numbers with decimal commas stand in a comma-separated file and only one reading is possible.

    There are then twice as many cells as names (each number has a fraction), or one less (the time has none).
    """
    if dialect.delimiter != "," or dialect.header_line is None:
        return None
    count = len(split(head[dialect.header_line], ","))
    if count < 2 or dialect.width not in (2 * count, 2 * count - 1):
        return None
    whole = dialect.width == 2 * count - 1  # the first column without a fraction
    pair = r"\s*[+-]?\d+,\d+\s*"
    row = re.compile((r"\s*[+-]?\d+\s*" if whole else pair) + f"(?:,{pair}){{{count - 1}}}$")
    lines = LINE_END.split(body.decode("utf-8", errors="replace"))
    if not all(row.match(line) for line in lines if line.strip()):
        return None
    parts = [line.split(",") for line in lines]
    first = 1 if whole else 0
    rows = [p[:first] + [f"{p[i].strip()},{p[i + 1].strip()}" for i in range(first, len(p) - 1, 2)] for p in parts]
    text = "\n".join(";".join(r) for r in rows) + "\n"
    return text.encode(), replace(dialect, delimiter=";", decimal=",", width=count, joined=True)


Cells = Array | list[str]


def _in_trouble(body: bytes, dialect: Dialect) -> bool:
    """Whether some line looks as if it held no readings: a quick look for letters or signs at the beginning of lines."""
    if not body.translate(None, b"0123456789.,;:|\t \"'+-eE\r\n"):
        return False  # nothing but numbers
    if dialect.header_line is None:
        return bool(re.search(rb"(?m)^[#%/]", body))
    return bool(re.search(rb"[A-Za-z]{4}|(?m:^\W?[A-Za-z#%/])", body))


def _parse_body(
    body: bytes, lines: list[str], names: list[str], dialect: Dialect, name: str, more: frozenset[str], excluded: set[str]
) -> tuple[dict[str, Cells], dict[str, InputError], dict[str, str], Sequence[int], list[str]]:
    """(columns, what is wrong with some, units that stand in the cells, the rows' lines, notes); lines are the body's first."""
    ragged: list[str] = []

    def ragged_row(row: pacsv.InvalidRow) -> str:
        ragged.append(row.text)
        return "skip"

    delimiter = "\t" if dialect.delimiter == " " else dialect.delimiter

    # A small one in this thread alone: a pool of pyarrow's that is still starting when a refusal ends the process aborts it.
    large = len(body) > LARGE and b'"' not in body
    options = pacsv.ReadOptions(column_names=names, block_size=PIECE if large else max(len(body) + 1, PIECE), use_threads=large)

    def parse(types: dict[str, pa.DataType]) -> pa.Table:
        ragged.clear()
        return pacsv.read_csv(
            pa.BufferReader(body),
            read_options=options,
            parse_options=pacsv.ParseOptions(delimiter=delimiter, invalid_row_handler=ragged_row),
            convert_options=pacsv.ConvertOptions(
                column_types=types, null_values=[""], decimal_point=dialect.decimal, strings_can_be_null=False
            ),
        )

    if not body or body.isspace():
        raise InputError(f"{name}: a header and no rows", allowed="rows of readings", do="export the record again")
    texts = _of_words(lines, names, dialect, more) | (excluded & set(names))
    if not texts and dialect.decimal == "." and (wide := wide_numbers(body, len(names), delimiter)) is not None:
        at = _lines_of_rows(body, len(wide), delimiter, dialect)
        return {n: without(wide[:, i], more, n) for i, n in enumerate(names)}, {}, {}, at, []
    # Where some cell is no number, its column is looked at cell by cell, for the words that mean 'no reading' and to name the
    # others. The words are not given to pyarrow, which would look for each of them in every column of every record.
    looked_at = set(texts)
    while True:
        try:
            table = parse({n: pa.string() if n in looked_at else pa.float64() for n in names})
            break
        except pa.ArrowInvalid as error:
            if len(looked_at) == len(names):
                raise
            found = re.search(r"column #(\d+)", str(error))
            looked_at |= {names[int(found[1])]} if found and len(looked_at) < len(texts) + SINGLY else set(names)
    notes = _check_ragged(body, len(names), delimiter, dialect, name) if ragged else []
    at = _lines_of_rows(body, table.num_rows, delimiter, dialect)
    columns: dict[str, Cells] = {}
    faults: dict[str, InputError] = {}
    carried: dict[str, str] = {}
    parsed = dict(zip(names, table.columns, strict=True))
    del table
    for n in names:
        column = parsed.pop(n)
        if n in looked_at:
            columns[n], fault, unit = _cells(column.to_pylist(), n, dialect, name, at, more, n in texts)
            if fault is not None:
                faults[n] = fault
            if unit:
                carried[n] = unit
        else:
            columns[n] = without(to_floats(column), more, n)
    return columns, faults, carried, at, notes


def _of_words(lines: list[str], names: list[str], dialect: Dialect, more: frozenset[str]) -> set[str]:
    """Names of the columns that hold words or stamps, by the first lines of a body."""
    rows = (split(line, dialect.delimiter) for line in lines[:200] if line.strip())
    sample = [row for row in rows if len(row) == len(names)]
    return {n for i, n in enumerate(names) if _is_text([r[i] for r in sample], dialect.decimal, more)}


def _lines_of_rows(body: bytes, rows: int, delimiter: str, dialect: Dialect) -> Sequence[int]:
    """Of each row its line in the file, from 0; empty lines and rows of another width, left out in reading, count too."""
    end = len(body)
    while end and body[end - 1 : end].isspace():  # empty lines at the end shift nothing
        end -= 1
    if newlines(body, end) < rows:
        return range(dialect.data_line, dialect.data_line + rows)
    lines = LINE_END.split(body.decode("utf-8", errors="replace"))
    full = [i for i, line in enumerate(lines) if line and len(split(line, delimiter)) == dialect.width]
    found = [dialect.data_line + i for i in full]
    return found if len(found) == rows else range(dialect.data_line, dialect.data_line + rows)


def _is_text(cells: list[str], decimal: str, more: frozenset[str]) -> bool:
    if decimal == "." and _all_floats(cells):
        return False
    told = [c for c in cells if not is_missing(c, more)]
    return bool(told) and sum(is_number(c, decimal) for c in told) < MOSTLY * len(told)


def _all_floats(cells: list[str]) -> bool:
    try:
        for c in cells:
            float(c)
    except ValueError:
        return False
    return True


def _check_ragged(body: bytes, width: int, delimiter: str, dialect: Dialect, name: str) -> list[str]:
    """Notes where rows of another width are a footer or a last line cut short.

    Raises
    ------
    InputError: any other row, by its line.
    """
    lines = LINE_END.split(body.decode("utf-8", errors="replace"))
    counts = [(i, split(line, delimiter)) for i, line in enumerate(lines) if line.strip()]
    bad = [(i, cells) for i, cells in counts if len(cells) != width]
    good = [i for i, cells in counts if len(cells) == width]
    last = good[-1] if good else -1
    tail = [i for i, _ in bad if i > last]
    if bad and not [i for i, _ in bad if i <= last]:
        first, cells = bad[0]
        if len(bad) == 1 and len(cells) < width and any(is_number(c, dialect.decimal) for c in cells):
            return [f"the last line ({dialect.data_line + first + 1}) is cut short and was left out"]
        if all(not _reads(cells, dialect.decimal) for _, cells in bad):
            return [f"{len(tail)} lines below the readings left out ({lines[first].strip()[:40]!r})"]
    first, cells = bad[0] if bad else (0, [])
    line = dialect.data_line + first + 1
    raise InputError(
        f"{name}, line {line}: the row has {len(cells)} cells, the others {width}",
        found=lines[first][:80],
        allowed=f"{width} cells in each row",
        do=f"mend the row{f' and {len(bad) - 1} more like it' if len(bad) > 1 else ''}, or check --delimiter and --decimal",
    )


def _reads(cells: list[str], decimal: str) -> bool:
    """Whether a row holds readings: at least two numbers, or a stamp and a number."""
    told = [c for c in cells if c.strip()]
    numbers = sum(is_number(c, decimal) for c in told)
    return numbers >= 2 or (numbers >= 1 and any(looks_like_stamp(c) for c in told))


def _cells(
    cells: list[str], column: str, dialect: Dialect, name: str, lines: Sequence[int], more: frozenset[str], is_text: bool
) -> tuple[Cells, InputError | None, str]:
    """(numbers or the cells themselves, what is wrong with the few that are none, unit that each cell carries)."""
    unit = ""
    if is_text:
        cells, unit = with_unit(cells, dialect.decimal, more)
        if not unit:
            return cells, _wordy(cells, column, dialect, name, lines), ""
    distinct = dict.fromkeys(cells)  # of a million readings some thousand
    if any(_THOUSANDS[dialect.decimal].match(c) for c in distinct):
        # One of several groups says what a single group is: 60,000 beside 1,020,000.
        cells = [re.sub(r"(?<=\d)[.,](?=\d{3}$)", "", c) if THOUSAND[dialect.decimal].match(c) else c for c in cells]
        distinct = dict.fromkeys(cells)
    told = [c for c in distinct if not is_missing(c, more)]
    number = {c: to_number(c, dialect.decimal) for c in told if is_number(c, dialect.decimal)}
    values = np.array([number.get(c, np.nan) for c in cells])
    if len(number) == len(told):
        return without(values, more, column), None, unit
    odd = {c for c in told if c not in number}
    bad = [i for i, c in enumerate(cells) if c in odd]
    if len(bad) > np.count_nonzero(np.isfinite(values)) or all(THOUSAND[dialect.decimal].match(c) for c in odd):
        return cells, None, ""
    found = listed(dict.fromkeys(repr(cells[i]) for i in bad), 3)
    fault = InputError(
        f"{name}, line {lines[bad[0]] + 1}, column {column!r}: not a number",
        found=found + (f" in {len(bad)} rows" if len(bad) > 1 else ""),
        allowed="a number, an empty cell, or a known word for 'no reading' (NaN, OL, ---, ...)",
        do=f"mend the cell{'s' if len(odd) > 1 else ''}, say --missing {_all_words(cells[i] for i in bad)} if "
        f"{'these mean' if len(odd) > 1 else 'it means'} 'no reading', or --exclude {column!r}",
    )
    return values, fault, unit


def _all_words(cells: Iterable[str]) -> str:
    """Words of cells, each once, as --missing takes them; the first few of very many."""
    return repr(joined(list(dict.fromkeys(c.strip() for c in cells))[:8]))


def _odd_numbers(cells: list[str], column: str, dialect: Dialect, name: str, lines: Sequence[int]) -> InputError | None:
    """What is wrong with a column of words most of which are numbers with a sign beside: 28.4 H, (9.5)."""
    odd = [bool(_ODD_NUMBER[dialect.decimal].match(c.strip())) or is_missing(c) or is_number(c, dialect.decimal) for c in cells]
    told = [i for i, c in enumerate(cells) if not is_missing(c) and not is_number(c, dialect.decimal)]
    if not told or not all(odd):
        return None
    return InputError(
        f"{name}, line {lines[told[0]] + 1}, column {column!r}: no number in a column of temperatures",
        found=listed(dict.fromkeys(repr(cells[i]) for i in told), 3) + f" in {len(told)} rows",
        allowed="numbers, empty cells, and known words for 'no reading'",
        do=f"export plain numbers, or say --exclude {column!r}",
    )


def _wordy(cells: list[str], column: str, dialect: Dialect, name: str, lines: Sequence[int]) -> InputError | None:
    """What is wrong with a column of words that holds numbers too: a probe that was open for most of the record."""
    if not cells or looks_like_stamp(cells[0]):
        return None
    within = [w[2] for c in dict.fromkeys(cells) if (w := number_within(c, dialect.decimal))]
    units = {unit.symbol: text for text in within if (unit := parse_unit(text)) is not None and unit.temperature}
    if len(units) > 1:
        return unit_changes(f"{name}, column {column!r}", units.values())
    numbers = [is_number(c, dialect.decimal) or number_within(c, dialect.decimal) is not None for c in cells]
    if not 0.05 * len(cells) <= sum(numbers) < len(cells):
        return _odd_numbers(cells, column, dialect, name, lines)
    first = numbers.index(False)
    other = listed(dict.fromkeys(repr(c) for c, n in zip(cells, numbers, strict=True) if not n), 3)
    return InputError(
        f"{name}, line {lines[first] + 1}, column {column!r}: not a number",
        found=f"{other} in {numbers.count(False)} rows",
        allowed="numbers of one unit, and known words for 'no reading'",
        do=f"say --missing {cells[first].strip()!r} if it means 'no reading', or --exclude {column!r}",
    )
