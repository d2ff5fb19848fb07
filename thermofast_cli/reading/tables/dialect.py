"""How a text file is laid out: encoding, delimiter, decimal sign, header. Decided by rule, never by a guesser."""

import csv
import functools
import re
from dataclasses import dataclass
from itertools import pairwise

from ...errors import InputError
from ...reading_options import Options
from ..moments.stamps import looks_like_stamp
from ..units import parse_unit
from ..vocabulary import TIME, words

#: Cells that loggers write where there is no reading (compared in lower case).
MISSING = frozenset(
    [
        "", "nan", "na", "n/a", "n.a.", "null", "none", "nil", "-",
        "--", "---", "----", "ol", "o.l", "o.l.", "0l", "+ol", "-ol",
        "over", "overload", "overflow", "ovfl", "open", "short", "err", "error", "#n/a",
        "#num!", "#value!", "#div/0!", "inf", "+inf", "-inf", "infinity", "bad", "fault",
        "fail", "invalid", "no data", "nodata", "?", "*", "***", "****", "*****",
        "#nv", "#wert!", "#valeur!", "#zahl!", "1.#qnan", "-1.#ind", "1.#inf", "<null>", "(null)", "\\n",
        "unavailable", "unknown", "i/o timeout", "bad input", "n.c.", "fehler", "bruch", "burnout", "burn out", "otc", "ovld",
        "+burnout", "-burnout", "open tc", "open circuit", "over range", "overrange", "+over", "-over", "under", "underrange",
        "n. def.", "not connected", "disconnected", "timeout", "lo", "hi", "-----", "------", "---.-",
        "--.-", "+++++++", "-------", "######", "#######", "########", "no probe", "sensor break", "#name?",
        "#ref!", "#div/0", "*.*", "-ol-",
        "ur", "or", "???", "??", "******", "*******", "********", "#n/v", "#error", "drahtbruch",
        "fühlerbruch", "fuehlerbruch", "tc open", "unplugged", "probe open", "wire break", "broken", "1.#qnan0e+000",
        "+1.#qnan0e+000", "-1.#ind0e+000", "-1.#qnan", "+1.#qnan", "+nan", "-nan", "nan(ind)", "-nan(ind)", "1.#ind",
        "+1.#inf", "o/r", "u/r", "--------", "---------", "sensor error", "sensor fault", "sensor fail", "sensor open",
    ]
)  # fmt: skip
#: A line that begins so is a comment, or the names.
COMMENT = frozenset("#%")
#: Every digit as a one, which is right in each place of a stamp; what parts cells in one text; and the words above so.
_ONES, _CELL_END = str.maketrans("023456789", "1" * 9), "\x1f"
_MISSING_SHAPES = frozenset(m.translate(_ONES) for m in MISSING)
DELIMITERS = ("\t", ";", ",", "|", " ")
SAMPLE_LINES = 400
csv.field_size_limit(1 << 30)  # a row of thirty thousand cells, read with the wrong delimiter, is one cell
#: Cells of a row that are looked at to tell what it is: a row of ten thousand is known by its first hundred.
SAMPLE_CELLS = 100
NAMES = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "blanks"}
_GAP = "[' \u00a0\u202f\u2009’]"


def _number(point: str, comma: str) -> re.Pattern[str]:
    """A number with its decimal sign, thousands set apart by the other one, by an apostrophe or a gap."""
    grouped = rf"(?:[{comma}]\d{{3}})+[{point}]\d+|(?:[{comma}]\d{{3}}){{2,}}|(?:{_GAP}\d{{3}})+(?:[{point}]\d+)?"
    return re.compile(rf"[+-]? *(?:\d+[{point}]?\d*|[{point}]\d+|\d{{1,3}}(?:{grouped}))(?:[eE][+-]?\d+)?$")


_NUMBER = {".": _number(".", ","), ",": _number(",", ".")}
#: A number with one group of thousands, by the decimal sign, whose sign may be that itself; and how much of a number it is where
#: the layout is looked for: it decides between equals only.
THOUSAND = {d: re.compile(rf"\s*[+-]?\d{{1,3}}[{o}]\d{{3}}$") for d, o in (".,", ",.")}
MAYBE = 0.1
#: A word in a header's units line that is no unit of a quantity: a form of stamps, or nothing.
_FORM = re.compile(r"(?i)[\[(]?(yyyy.*|hh.*|dd.*|ts|rn|smp|)[\])]?$")
#: What a Campbell logger says of how a column was made, in the line under the units.
_PROCESS = frozenset(["smp", "avg", "max", "min", "tot", "std", "med", "tmn", "tmx", "wvc", "ave", "mean", "act", "rms", ""])
#: Types of columns as databases shorten them; beside a date, F is a float.
_DATES, _TYPES = frozenset(["D", "DT", "Date", "date", "DATE", "datetime", "DateTime", "timestamp"]), frozenset("DFISBL")
#: What a program says of the kinds of the columns, and the rule under the header of a Markdown table.
_KINDS = frozenset(
    [
        "float",
        "double",
        "real",
        "lreal",
        "int",
        "integer",
        "string",
        "str",
        "datetime",
        "timestamp",
        "date",
        "bool",
        "datetime:rfc3339",
    ]
)
_RULE = re.compile(r":?-{2,}:?$")
#: First cells of lines above the names that tell units, and other names, so many lines above at most.
UNIT_WORDS = frozenset(
    ["unit", "units", "einheit", "einheiten", "unité", "unités", "unità", "unidad", "eenheid", "enhet", "单位", "単位"]
)
NAME_WORDS = frozenset(
    [
        "tag",
        "tag comment",
        "tag no.",
        "tag name",
        "tagname",
        "name",
        "names",
        "channel name",
        "comment",
        "label",
        "bezeichnung",
        "kommentar",
    ]
)
#: First cells of lines that tell of each channel what is connected to it.
_TYPE_WORDS = frozenset(
    [
        "sensor", "sensor type", "type", "tc type", "thermocouple", "thermocouple type", "probe", "probe type", "input",
        "input type", "fühler", "fühlertyp", "sensortyp", "thermoelement", "传感器", "センサ",
    ]
)  # fmt: skip
#: What such a line tells of one channel.
_PROBES = re.compile(r"(?i)(?:(?:typ|type|tc)?[ -]?[bcejknrst]|pt[ -]?\d+|rtd|ntc|ptc|-+|)$")
ROWS_ABOVE = 6


@dataclass(frozen=True)
class Dialect:
    """header_line (or None) and unit_lines count from 0; data_line is the first row of readings."""

    encoding: str
    delimiter: str
    decimal: str
    header_line: int | None
    unit_lines: tuple[int, ...]
    data_line: int
    width: int
    #: Whether numbers with decimal commas stood in a file that is parted by commas.
    joined: bool = False

    def describe(self) -> str:
        header = f"header in line {self.header_line + 1}" if self.header_line is not None else "no header"
        mark = "decimal comma" if self.decimal == "," else "decimal point"
        return f"{NAMES.get(self.delimiter, repr(self.delimiter))}-separated, {mark}, {header}, {self.encoding}"


def is_missing(cell: str, more: frozenset[str] = frozenset()) -> bool:
    """Whether a cell says 'no reading'."""
    cell = cell.strip().lower()
    return cell in MISSING or cell in more


def is_number(cell: str, decimal: str) -> bool:
    return bool(_NUMBER[decimal].match(cell.strip()))


def split(line: str, delimiter: str) -> list[str]:
    """Cells of one line; quotes are understood, a run of blanks is one delimiter."""
    if delimiter == " ":
        return [c.strip('"') for c in line.split()] if '"' in line else line.split()
    # A carriage return within a line is no more than a gap; the csv module would raise.
    return next(csv.reader([line.replace("\r", " ")], delimiter=delimiter), [])


def header_cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line of names, which may stand behind a sign of a comment."""
    return split(line.lstrip("".join(COMMENT)) if line[:1] in COMMENT and delimiter == " " else line, delimiter)


def to_number(cell: str, decimal: str) -> float:
    """A cell that :func:`is_number` accepts; signs and gaps between thousands are dropped."""
    text = re.sub(_GAP, "", cell.strip())
    return float(text.replace(",", "")) if decimal == "." else float(text.replace(".", "").replace(",", "."))


def _data_like(cells: list[str], decimal: str) -> bool:
    """Whether a row holds readings. Rows that differ in their digits only are alike, and looked at once."""
    return _shape_of_data(_CELL_END.join(cells[:SAMPLE_CELLS]).translate(_ONES), decimal)


@functools.lru_cache(maxsize=4096)
def _shape_of_data(row: str, decimal: str) -> bool:
    cells = row.split(_CELL_END)
    if (
        cells[0].strip().lower() in TIME
        or re.match(r"\s*[tT] ?[\[(][a-z]+[\])]\s*$", cells[0])
        or (not re.search(r"\d", cells[0]) and set(words(cells[0])) & TIME)
    ) and not any(_VALUE.search(c) for c in cells[1:]):
        return False  # names, be they the numbers of channels: Date,Time,ms,0001,0002 or Time [h],101,102
    told = [c for c in cells if c.strip().lower() not in _MISSING_SHAPES and parse_unit(c) is None]
    numbers = sum(is_number(c, decimal) for c in told)
    stamps = sum(looks_like_stamp(c) for c in told if c[:1].isdigit() or c[1:2].isdigit())
    # Cells as "21.3 °C" hold readings too, but a row of them alone decides nothing.
    within = [number_within(c, decimal) for c in told]
    carried = sum(w is not None for w in within) if numbers + stamps else 0
    if not numbers + stamps and len(told) > 1 and all(w and not w[0] and parse_unit(w[2]) for w in within):
        return True  # but one of numbers that all carry a known unit does: "5 min", "21.3 °C"
    # A row of a long table may name plant, machine and sensor beside its moment and its one number.
    share = 0.3 if numbers and stamps and len(told) > 3 else 0.5
    return numbers + stamps > 0 and numbers + stamps + carried >= share * len(told)


#: What no name of a channel is: a number with decimals, or with many digits.
_VALUE = re.compile(r"^\s*[+-]?\d+[.,]\d+\s*$|^\s*\d{9,}\s*$")
_WITHIN = {
    d: re.compile(rf"([A-Za-z_]{{1,12}}[=:]\s*)?([+-]?(?:\d+(?:[{re.escape(d)}]\d*)?|[{re.escape(d)}]\d+))\s*([^\d\s].{{0,7}})?$")
    for d in ".,"
}


@functools.lru_cache(maxsize=8192)
def number_within(cell: str, decimal: str) -> tuple[str, str, str] | None:
    """(before, number, after) of a cell that carries its unit or its name, as ``21.3 °C``, ``12.3s`` or ``temp=47.2'C``."""
    found = _WITHIN[decimal].match(cell.strip())
    if not found or not (found[1] or found[3]) or (found[3] and re.search(r"[\d:/]", found[3])):
        return None
    return (found[1] or "").strip(), found[2], (found[3] or "").strip()


def detect_dialect(lines: list[str], encoding: str, name: str, options: Options) -> Dialect:
    """Layout of the first lines of a table (without line ends).

    Raises
    ------
    InputError: empty, no rows of readings.
    """
    lines = lines[: SAMPLE_LINES + max(options.header_line or 0, 0)]
    if not any(line.strip() for line in lines):
        raise InputError(f"{name}: the file is empty", allowed="a header line and rows of readings", do="export the record again")
    best: tuple[float, Dialect] | None = None
    for delimiter in (options.delimiter,) if options.delimiter else DELIMITERS:
        decimals = (options.decimal,) if options.decimal else (".", ",")
        rows = [split(line, delimiter) if line.strip() and line[:1] not in COMMENT else [] for line in lines]
        for decimal in decimals:
            found = _layout(lines, rows, delimiter, decimal, encoding, options)
            # Prefer more numbers read, then a delimiter that leaves nothing inside its cells.
            if found and (best is None or found[0] > best[0] + 1e-9):
                best = found
    if best is None:
        alone = sum(bool(line.strip()) for line in lines) == 1
        looked = f": the first {SAMPLE_LINES} lines are looked at, and those below the line named"
        more = looked if len(lines) >= SAMPLE_LINES else ""
        raise InputError(
            f"{name}: a header and no row of readings" if alone else f"{name}: no row of readings",
            found=f"first line: {next(x for x in lines if x.strip())[:80]!r}",
            allowed="rows with a time and at least one number",
            do=f"check the export, or say --delimiter, --decimal and --header-line{more}",
        )
    return best[1]


def _layout(
    lines: list[str], rows: list[list[str]], delimiter: str, decimal: str, encoding: str, options: Options
) -> tuple[float, Dialect] | None:
    labels = next((i for i, row in enumerate(rows) if row and row[0].strip() == "Y_Unit_Label"), None)
    # A LabVIEW measurement file says where its header ends; the numbers above are settings.
    ends = max((i for i, line in enumerate(lines) if line.startswith("***End_of_Header***")), default=-1)
    data = [i for i, row in enumerate(rows) if i > ends and len(row) > 1 and _data_like(row, decimal)]
    if options.header_line is not None:
        data = [i for i in data if i >= options.header_line]
    if not data:
        return None
    first, width = _block(rows, data, decimal)
    data = [i for i in data if i >= first and len(rows[i]) == width]
    header: int | None = None
    units: tuple[int, ...] = ()
    if options.header_line is not None:
        header = options.header_line - 1 if options.header_line > 0 else None
        below = range(options.header_line, first) if header is not None else range(0)
        units = tuple(i for i in below if len(rows[i]) == width and is_unit_line(rows[i]) and not is_process_line(rows[i]))
    else:
        header, units = _header([[] if i <= ends else row for i, row in enumerate(rows)], first, width, decimal)
    if header is None and options.header_line is None:
        header = next(
            (i for i in range(first - 1, -1, -1) if lines[i][:1] in COMMENT and len(header_cells(lines[i], delimiter)) == width),
            None,
        )
        if header is not None and delimiter == " " and any(c.endswith(":") for c in header_cells(lines[header], delimiter)):
            header = None  # "# rig: spindle 7" is a remark of as many words
    if labels is not None and not units:
        units = (labels,)
    if header is not None and not units:
        units = tuple(i for i in range(max(header - ROWS_ABOVE, 0), header) if len(rows[i]) == width and says(rows[i], UNIT_WORDS))
        if not units and header > 0 and len(rows[header - 1]) == width and all(map(parse_unit, rows[header - 1])):
            units = (header - 1,)
    if header is not None:  # rows of another width between the names and the block are readings all the same
        below = range(max((header, *units)) + 1, first)
        first = next(
            (i for i in below if len(rows[i]) > 1 and (_data_like(rows[i], decimal) or _starts(rows[i], width, decimal))), first
        )
    explained = len(data) / max(sum(1 for row in rows if row), 1)
    cells = [c for i in data[:100] if i >= first for c in rows[i][:SAMPLE_CELLS]]
    told = [c for c in (cell.translate(_ONES) for cell in cells) if c.strip().lower() not in _MISSING_SHAPES]
    share = sum(_tells(c, decimal) for c in told) / max(len(told), 1)
    fits = header is not None and len(header_cells(lines[header], delimiter)) == width
    score = share * explained * min(width, 1000) ** 0.25 + (0.1 if fits else 0.0)
    if delimiter == " " and ((header is not None and not fits) or all("\t" in lines[i] for i in data)):
        score *= 0.8  # a blank stands within stamps and names too
    return score, Dialect(encoding, delimiter, decimal, header, units, first, width)


@functools.lru_cache(maxsize=8192)
def _tells(cell: str, decimal: str) -> float:
    """Whether a cell is a number, a stamp, or a number with its unit; a little, where one sign may part thousands (1,500)."""
    if is_number(cell, decimal) or looks_like_stamp(cell) or number_within(cell, decimal) is not None:
        return 1.0
    return MAYBE if THOUSAND[decimal].match(cell.strip()) else 0.0


def says(cells: list[str], words: frozenset[str]) -> bool:
    """Whether the first cell of a line is one of these words: what the line tells of each column."""
    return bool(cells) and cells[0].strip().lower().rstrip(":") in words


def _block(rows: list[list[str]], data: list[int], decimal: str) -> tuple[int, int]:
    """First row and width of the readings: numbers in a preamble are none, those come in an unbroken block."""
    longest: dict[int, int] = {}
    at = 0
    while at < len(data):
        width, end = len(rows[data[at]]), at
        while end + 1 < len(data) and len(rows[data[end + 1]]) == width and not any(rows[data[end] + 1 : data[end + 1]]):
            end += 1
        longest[width] = max(longest.get(width, 0), end - at + 1)
        at = end + 1
    count = {w: sum(len(rows[i]) == w for i in data) for w in longest}
    width = max(longest, key=lambda w: (longest[w], count[w]))
    mine = [i for i in data if len(rows[i]) == width]
    if len(mine) < 3:
        return mine[0], width
    begun = [i for i in mine if _begins_as_data(rows[i], decimal)]
    if len(begun) > 0.9 * len(mine):
        mine = begun  # numbers in a preamble stand behind a word that says what they are
    return next((a for a, b in pairwise(mine) if b == a + 1 or not any(rows[a + 1 : b])), mine[0]), width


def _header(rows: list[list[str]], first: int, width: int, decimal: str) -> tuple[int | None, tuple[int, ...]]:
    """Line of the names and lines of the units above the first row of readings, as far as there are any."""
    above = [i for i in range(first) if rows[i]]
    while above and len(rows[above[-1]]) > 1 and _data_like(rows[above[-1]], decimal):
        above.pop()  # readings too, though of another width
    while len(above) > 1 and _begins_as_data(rows[above[-1]], decimal) and len(rows[above[-1]]) == width:
        if not any(len(rows[i]) == width and not _begins_as_data(rows[i], decimal) for i in above[:-1]):
            break
        above.pop()  # words where readings will be: "init", "no sensor"
    near = above[-4:]
    named = [i for i in near if abs(len(rows[i]) - width) <= 1 and not _data_like(rows[i], decimal)]
    if above and above[-1] not in named and len(rows[above[-1]]) > 1 and not _data_like(rows[above[-1]], decimal):
        # Names right above the readings, though not as many: whoever reads on must say so.
        return (above[-1], ()) if not named else (named[-1], ())
    if not named:
        return None, ()
    header, units = named[-1], list[int]()
    while (
        len(named) > 1
        and len(rows[named[-2]]) == len(rows[header])
        and (is_unit_line(rows[header]) or is_process_line(rows[header]) or _repeats_units(rows[header], rows[named[-2]]))
    ):
        if not is_process_line(rows[header]):
            units.append(header)
        named.pop()
        header = named[-1]
    if not units and len(named) > 2 and is_unit_line(rows[named[-2]]) and len(rows[named[-3]]) == len(rows[header]):
        # Names, units, and below them places, groups or remarks: the names are those that tell columns apart.
        units.append(named[-2])
        if _tell_apart(rows[named[-3]]) and not _tell_apart(rows[header]):
            header = named[-3]
    return header, tuple(units)


def _tell_apart(cells: list[str]) -> bool:
    """Whether each cell of a line is another word."""
    told = [c.strip() for c in cells]
    return all(told) and len(set(told)) == len(told)


def _starts(cells: list[str], width: int, decimal: str) -> bool:
    return len(cells) == width and _begins_as_data(cells, decimal)


def _begins_as_data(cells: list[str], decimal: str) -> bool:
    """Whether a line begins with a number or a stamp, as rows of readings do and names do not."""
    first = cells[0].strip()
    return first.lstrip("+-")[:1].isdigit() and (is_number(first, decimal) or looks_like_stamp(first))


def is_unit_line(cells: list[str]) -> bool:
    """Whether half of the cells of a line or more are units."""
    if says(cells, _TYPE_WORDS) or _are_types(cells):
        return False  # Sensor,K,K,J: thermocouples, no kelvin
    told = [c.strip() for c in cells if c.strip()]
    known = sum(parse_unit(c) is not None or bool(_FORM.match(c)) for c in told)
    if known < 0.5 * len(told) or known + len(cells) - len(told) < 0.5 * len(cells) or not told:
        return False
    return not {"min", "max"} <= {c.strip().lower() for c in cells}  # the least and the greatest, no minutes


def _repeats_units(cells: list[str], above: list[str]) -> bool:
    """Whether a line gives several columns one unit, and the line above names each of them."""
    places = [i for i, c in enumerate(cells) if parse_unit(c) is not None]
    names = [above[i].strip() for i in places]
    return len({cells[i].strip() for i in places}) < len(places) and len(set(names)) == len(names) and all(names)


def _are_types(cells: list[str]) -> bool:
    """Whether cells are the types of columns of which the first is a date: D,F,F,F of a database, where F is a float."""
    first, *rest = (c.strip() for c in cells or [""])
    return first in _DATES and bool(rest) and all(c in _TYPES or c.lower() in _KINDS for c in rest)


def is_process_line(cells: list[str]) -> bool:
    """Whether cells say how readings were made (Avg, Max) or of which kind they are."""
    told = [c.strip().lower() for c in cells]
    known = all(c in _PROCESS for c in told) or all(not c or c in _KINDS or _RULE.match(c) for c in told)
    known = known or _are_types(cells) or (says(cells, _TYPE_WORDS) and all(_PROBES.match(c) for c in told[1:]))
    return known and sum(map(bool, told)) >= 0.5 * len(cells)
