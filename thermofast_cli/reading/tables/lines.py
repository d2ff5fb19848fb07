"""Text whose lines are not yet one row each: cells with line breaks, quotes that nothing closes, LabVIEW measurement files of
several segments, exports of TwinCAT Scope.
"""

import csv
import io
import re
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, listed
from ..moments.stamps import looks_like_stamp
from ..moments.time_column import is_time_name
from ..run import Guess
from .dialect import Dialect, is_number, split, to_number

#: Lines above the readings of each segment of a LabVIEW measurement file.
_SEGMENT_HEAD = re.compile(
    rb"(Channels|Samples|Date|Time|X_Dimension|X0|Delta_X|Y_Dimension|Y_Unit_Label|Notes|Test_\w+|UUT_\w+|Units_\w+)\t"
)
_SEGMENT_END = b"***End_of_Header***"
#: What the first lines of an export say, whatever the language of the machine.
_EXPORT = re.compile(rb"Name[\t;, ][^\n]*\n(?:[^\n]*\n){0,3}?(?:Starttime of export|StartTime[\t;,])")
_NAMES = re.compile(rb"(?m)^Name([\t;,])")

#: Share of the usual number of separators from which on a line is a row of readings by itself.
FULL = 0.7
LINE_END = re.compile(r"\r\n|\n|\r")
MARKS = (b",", b";", b"\t", b"|")
#: Bytes and rows that show how rows are written.
SAMPLE, SOME = 1 << 14, 40
#: Bytes at the end of a text that show how its last numbers are written.
TAIL = 1 << 17
#: A last number with fewer decimals than any before is cut where it is off by so many of the largest steps between readings, and
#: one without any after so many rows with some.
CUT_STEPS, CUT_ROWS = 3.0, 12
#: Bytes that are looked at together, and the one that ends a line.
AT_ONCE, NEWLINE = 1 << 16, 10
#: Lines up to which a table may lie on its side, so many times as wide as it is high, and names before its moments.
MOST_LYING, SIDEWAYS, MOST_NAMES = 400, 3, 3
#: Rows in which WinCC says when it was off and how many rows there are.
_MARKERS = re.compile(rb'(?m)^"?\$RT_[A-Z]+\$"?[;,\t].*(?:\n|\Z)')
_FORTRAN = re.compile(rb"(?<![\w.])([+-]?\d*\.\d+)[dD]([+-]\d{2,3})(?!\d)")


def _signs(data: bytes, end: int | None = None) -> Iterator[NDArray[np.uint8]]:
    """The bytes of a text in pieces that the processor's cache holds, each with the first of the next."""
    signs = np.frombuffer(data, np.uint8, count=len(data) if end is None else end)
    return (signs[at : at + AT_ONCE + 1] for at in range(0, len(signs), AT_ONCE))


def newlines(data: bytes, end: int) -> int:
    """How many there are up to a place, in a third of the time of bytes.count."""
    return sum(int(np.count_nonzero(piece[:AT_ONCE] == NEWLINE)) for piece in _signs(data, end))


def begins_of_lines(data: bytes) -> set[int]:
    """The bytes with which lines begin."""
    found = np.zeros(256, dtype=bool)
    for piece in _signs(data):
        found[piece[1:][piece[:-1] == NEWLINE]] = True
    return {*data[:1], *np.flatnonzero(found).tolist()}


def plain_rows(data: bytes) -> tuple[bytes, list[str]]:
    """(text, notes) without quotes around whole rows, with tabs for blanks between quoted cells, and E for Fortran's D."""
    notes = []
    for entity in (b"&deg;", b"&#176;"):
        if entity in data[:SAMPLE]:  # out of a page
            data = data.replace(entity, "°".encode())
    # To look for one byte takes a tenth of the time of looking for several.
    if b"$" in data and b"$RT_" in data and (rest := _MARKERS.sub(b"", data)) != data:
        notes.append("markers of the archive ($RT_OFF$, $RT_COUNT$, ...) left out")
        data = rest
    first = [line.strip(b"\r") for line in data[:SAMPLE].split(b"\n")[:-1] if line.strip()][1:SOME]
    if not first:
        return data, notes
    whole = [re.fullmatch(rb'"[^"]*[,;\t][^"]*"', line) for line in first]
    if all(whole):
        data = re.sub(rb'(?m)^"([^"\n]*)"(?=\r?$)', rb"\1", data)
        notes.append("quotes around whole rows left out")
    elif all(b'"' in line and not re.search(rb"[,;\t]", line) for line in first):
        data = re.sub(rb'("[^"\n]*"|[^\s"]+)[ ]+(?=\S)', rb"\1\t", data)
        notes.append("quoted cells between blanks")
    if sum(bool(re.search(_FORTRAN, line)) for line in first) > len(first) // 2:
        data = re.sub(_FORTRAN, rb"\1E\2", data)
        notes.append("numbers with Fortran's D for the exponent")
    return data, notes


def closed_quotes(data: bytes) -> tuple[bytes, list[str]]:
    """(text, notes) in which no quoted cell goes on in the next line: one with line breaks stands in one line, with empty lines
    below it so that line numbers hold, and a quote that nothing closes before the next row of readings is left out.

    Else all rows as far as the next quote are one cell.
    """
    if b'"' not in data:
        return data, []
    end = b"\n" if 2 * data.count(b"\n") >= data.count(b"\r") else b"\r"
    if end == b"\n" and re.search(rb"\r(?!\n)", data):
        data = re.sub(rb'"[^"\n\r]*\r[^"\n]*"', lambda m: m[0].replace(b"\r", b" "), data)
    text = np.frombuffer(data, np.uint8)
    of_line = np.searchsorted(np.flatnonzero(text == end[0]), np.flatnonzero(text == ord('"')))
    odd = np.flatnonzero(np.bincount(of_line) % 2).tolist()
    if not odd:
        return data, []
    lines = data.split(end)
    told = [line for line in lines if line.strip()]
    usual = {mark: float(np.median([line.count(mark) for line in told])) for mark in MARKS}
    mark = max(usual, key=lambda m: usual[m])
    if usual[mark] < 1.0:
        mark = b" "
        usual[mark] = float(np.median([line.count(mark) for line in told]))

    def full(text: bytes) -> bool:
        return text.count(mark) >= max(FULL * usual[mark], 1.0)

    def holds_readings(text: bytes) -> bool:
        return sum(bool(re.search(rb"\d", cell)) for cell in text.split(mark)) > 1

    def goes_on(first: int, last: int) -> bool:
        """Whether the cell that a line leaves open ends at the first quote of another, with no row between."""
        inside, sign, after = lines[last].replace(b'""', b"").partition(b'"')
        closes = sign and (not after.strip() or after.lstrip(b" ").startswith(mark))
        begins_as_row = full(inside) and holds_readings(inside)
        rows_between = any(full(lines[i]) and holds_readings(lines[i]) for i in range(first + 1, last) if b'"' not in lines[i])
        return bool(_opens(lines[first], mark) and closes and not begins_as_row and not rows_between)

    joined, left_out, at = 0, [], 0
    while at < len(odd):
        first = odd[at]
        last = odd[at + 1] if at + 1 < len(odd) else None
        if last is None or not goes_on(first, last):
            quote = lines[first].rfind(b'"')
            lines[first] = lines[first][:quote] + lines[first][quote + 1 :]
            left_out.append(first + 1)
            at += 1
            continue
        lines[first] = b" ".join(line.strip(b"\r") for line in lines[first : last + 1])
        lines[first + 1 : last + 1] = [b""] * (last - first)
        joined += 1
        at += 2
    notes = [f"{joined} cell{'s' if joined > 1 else ''} with line breaks joined"] if joined else []
    if left_out:
        notes.append(f"unbalanced quotes removed (line {listed(map(str, left_out), 3)})")
    return end.join(lines), notes


def _opens(line: bytes, mark: bytes) -> bool:
    """Whether the last quoted cell of a line does not end in it; a quote within a cell opens none."""
    at = 0
    while at < len(line):
        at += len(line) - at - len(line[at:].lstrip(b" "))
        if line[at : at + 1] == b'"':
            at += 1
            while (at := line.find(b'"', at)) >= 0 and line[at : at + 2] == b'""':
                at += 2
            if at < 0:
                return True
        following = line.find(mark, at)
        if following < 0:
            return False
        at = following + 1
    return False


def without_last(data: bytes, count: int) -> bytes:
    """Without so many lines at the end, empty ones not counted."""
    for _ in range(count):
        if not data:
            break
        data = data.rstrip(b"\r\n")
        data = data[: max(data.rfind(b"\n"), data.rfind(b"\r")) + 1]
    return data


def without_separator_line(data: bytes) -> tuple[bytes, str]:
    """Excel's first line ``sep=;`` tells the delimiter; an empty line stays in its place so that line numbers hold."""
    found = re.match(rb'"?sep=(.)"?(?=\r|\n)', data)
    return (data[found.end() :], found.group(1).decode("latin-1")) if found else (data, "")


def transposed(data: bytes) -> tuple[bytes, list[Guess]]:
    """(text, guesses) with a row for each moment where the table lies on its side: moments in its first row, sensors in the others.

    Moments are stamps, or numbers that go on under a name of time; before them stand names, and perhaps units.
    """
    if data.count(b"\n", 0, 10 * SAMPLE) > MOST_LYING or data.count(b"\n") > MOST_LYING:
        return data, []
    if (mark := max(MARKS, key=data.count)) not in data:
        return data, []
    last = data.rstrip().rpartition(b"\n")[2].partition(mark)[0].strip(b' "').decode("utf-8", errors="replace")
    if not last or last.lstrip("+-")[:1].isdigit():
        return data, []  # the rows of most tables begin with their moment
    try:
        told = [line for line in csv.reader(io.StringIO(data.decode()), delimiter=mark.decode()) if any(line)]
    except (csv.Error, UnicodeDecodeError):
        return data, []
    width = max(map(len, told), default=0)
    if not width:
        return data, []
    above = next(i for i, row in enumerate(told) if len(row) > width // 2)  # titles
    first, *others = ([cell.strip() for cell in row] + [""] * (width - len(row)) for row in told[above:])
    if not others or width < SIDEWAYS * (1 + len(others)):
        return data, []
    decimal = "," if mark != b"," and sum("," in cell for row in others for cell in row) > len(others) else "."
    begins = _first_moment(first, decimal)
    names = [row[0] for row in others]
    words = not any(is_number(cell, decimal) or looks_like_stamp(cell) or not cell for cell in names)
    if begins is None or not words or len(set(names)) < len(names):
        return data, []
    if sum(is_number(cell, decimal) for row in others for cell in row[begins:]) < 0.5 * len(others) * (width - begins):
        return data, []
    first[0] = first[0] if is_time_name(first[0] or "-") else "time"
    text = io.StringIO()
    csv.writer(text, delimiter=mark.decode(), lineterminator="\n").writerows([*told[:above], *zip(first, *others, strict=True)])
    what = f"a table of {len(others)} rows and {width} columns that lies on its side, moments in its first row: transposed"
    return text.getvalue().encode(), [Guess("layout", what, "transpose it before it is read if a row is no sensor")]


def _first_moment(first: list[str], decimal: str) -> int | None:
    """Where in a row the moments begin, behind at most MOST_NAMES names; None where it holds none."""
    counted = is_time_name(first[0] or "-") and is_number(first[-1], decimal)
    moment: Callable[[str], bool] = partial(is_number, decimal=decimal) if counted else looks_like_stamp
    begins = next((i for i, cell in enumerate(first[: MOST_NAMES + 1]) if i and moment(cell)), None)
    if begins is None or not all(map(moment, first[begins:])):
        return None
    if counted:
        numbers = [to_number(cell, decimal) for cell in first[begins:]]
        return begins if all(a < b for a, b in pairwise(numbers)) else None
    first[1:begins] = [""] * (begins - 1)  # of the units' row
    return begins


def joined_segments(data: bytes, name: str) -> tuple[bytes, list[str]]:
    """A LabVIEW measurement file of several segments with the readings of all of them under the first header.

    Raises
    ------
    InputError: the segments have different channels.
    """
    if not data.startswith(b"LabVIEW Measurement"):
        return data, []
    data, notes = _with_times(data)
    if data.count(_SEGMENT_END) <= 2:
        return data, notes
    ending = b"\r\n" if b"\r\n" in data else b"\n"
    lines = data.split(ending)
    ends = [i for i, line in enumerate(lines) if line.startswith(_SEGMENT_END)]
    head, names = lines[: ends[1] + 2], lines[ends[1] + 1]
    rows = list(head)
    for number, end in enumerate(ends[1:]):
        if lines[end + 1] != names:
            raise InputError(
                f"{name}, line {end + 2}: segment {number + 1} has other channels than the first",
                found=lines[end + 1].decode("latin-1")[:80],
                allowed="the same channels in all segments",
                do="export each segment to a file of its own",
            )
        until = ends[number + 2] if number + 2 < len(ends) else len(lines)
        rows += [b""] * (end + 2 - len(rows))  # lines that are left out stay as empty ones: line numbers hold
        rows += [b"" if _SEGMENT_HEAD.match(r) else r for r in lines[end + 2 : until]]
    return ending.join(rows) + ending, [*notes, f"{len(ends) - 1} segments joined"]


def _with_times(data: bytes) -> tuple[bytes, list[str]]:
    """(text, notes) of a LabVIEW measurement file that has no column of times: those that X0 and Delta_X above the rows tell."""
    if b"\nX_Columns\tNo" not in data[:SAMPLE]:
        return data, []
    comma = b"\nDecimal_Separator\t," in data[:SAMPLE]
    rows, at, step, told = [], 0.0, 0.0, False
    for line in data.split(b"\n"):
        name, *cells = line.strip(b"\r").split(b"\t")
        numbers = {float(c.replace(b",", b".")) for c in cells if c.strip()} if name in (b"X0", b"Delta_X") else set()
        if name == b"Delta_X" and len(numbers) == 1:
            step = numbers.pop()
        elif name == b"X0" and len(numbers) == 1:
            at = numbers.pop()
        elif name == b"" and step > 0.0 and any(c.strip() for c in cells):
            line, told = f"{at:.9g}".replace(".", "," if comma else ".").encode() + line, True
            at += step
        rows.append(line)
    return b"\n".join(rows), [f"no column of times: one row every {step:g} s, as Delta_X has it"] if told else []


#: A time of day, of which no name of a column is made.
_CLOCK = re.compile(rb"\b\d{1,2}:\d{2}:\d{2}\b")


def united_headers(data: bytes, head: list[str], dialect: Dialect, name: str) -> tuple[bytes, list[str]]:
    """(text, notes) where the header stands again with other columns, or in another order: all rows under all names.

    Raises
    ------
    InputError: the same where units stand in lines of their own, which nobody can put together, or where they change.
    """
    if dialect.header_line is None or dialect.delimiter == " ":
        return data, []
    header = split(head[dialect.header_line], dialect.delimiter)
    first = header[0] if header else ""
    if not first.strip() or first.strip()[:1].isdigit():
        return data, []
    begun = first.encode()
    below = data.find(begun) + len(begun)
    if any(data.find(bytes([sign]), below) < 0 for sign in dict.fromkeys(begun)) or data.find(begun, below) < 0:
        return data, []  # to look for single bytes takes a tenth of the time of looking for a word, or of trying every line
    begins = re.compile(rb'(?m)^"?' + re.escape(first.encode()) + rb'"?' + re.escape(dialect.delimiter.encode()) + rb"[^\n]*")
    told = {m[0].rstrip(b"\r"): data.count(b"\n", 0, m.start()) for m in begins.finditer(data)}
    # "Time<tab>20:38:07" in a preamble says when it began, and names no columns.
    found = {line: at for line, at in told.items() if not _CLOCK.search(line)}
    if len(found) < 2:
        return data, []
    lines = [line.rstrip("\r") for line in data.decode("utf-8", errors="replace").split("\n")]
    names: dict[str, None] = {}
    at: list[int] = []
    out: list[tuple[list[str], list[int] | None]] = []
    started = False
    for line in lines:
        cells = split(line, dialect.delimiter) if line.strip() else []
        if cells and cells[0] == first and line.encode() in found:
            named = [c for c in cells if c.strip()]
            if len(set(named)) < len(named) or (started and len(named) < len(cells) and any(cells[len(named) :])):
                return data, []  # which of two columns of one name is which, nobody knows
            started = True
            names |= dict.fromkeys(named)
            at = [list(names).index(c) if c.strip() else -1 for c in cells]
        out.append((cells, at if started and len(cells) == len(at) else None))
    again = min(line for line in found.values() if line != min(found.values())) + 1
    bare = {re.sub(r"\s*[\[(].*", "", n) for n in names}
    if dialect.unit_lines or len(bare) < len(names):
        raise InputError(
            f"{name}, line {again}: the header stands again with other {'columns' if dialect.unit_lines else 'units'}",
            found=lines[again - 1][:80],
            allowed="one header; or several with each column's unit behind its name, the same in all",
            do=f"split the file there, or say --header-line {again} to read the rows below alone",
        )
    text = io.StringIO()
    write = csv.writer(text, delimiter=dialect.delimiter, lineterminator="\n").writerow
    for line, (cells, places) in zip(lines, out, strict=True):
        if places is None:
            text.write(line + "\n")
            continue
        row = list(names) if cells[0] == first and line.encode() in found else [""] * len(names)
        if row[0] == "":
            for place, cell in zip(places, cells, strict=True):
                if place >= 0:
                    row[place] = cell
        write(row)
    return text.getvalue().encode(), [f"the header stands again in line {again} with other columns: rows put under their names"]


def plain_scope(data: bytes) -> tuple[bytes, list[str]]:
    """(text, notes): an export with one line of names, clocks called ``Time [ms]``; other text as it is.

    Lines that go leave empty ones, so that errors name the lines of the file.
    """
    if data.startswith(b"Name") and data.count(b"\n") < 2:
        data = data.replace(b"\r", b"\n")  # line ends of old Macintoshes
    if not _EXPORT.match(data[:4096]):
        return data, []
    start = next((m.start() for m in _NAMES.finditer(data) if m.start() > 0), -1)
    # Below the lines about the channels an empty one, mostly, or the first that begins with a number.
    end = re.compile(rb"\r?\n(?:[\t;, ]*\r?\n|(?=[+-]?\d))").search(data, start) if start > 0 else None
    if end is None:
        return data, []
    mark = data[start + 4 : start + 5].decode()
    lines = data[start : end.start()].decode("utf-8", errors="replace").split("\n")
    rows = [split(line.rstrip("\r"), mark) for line in lines]
    names = rows[0]
    units = next((row for row in rows if row[0].strip() == "Unit"), [])
    header = [_titled(name, units[i] if i < len(units) else "") for i, name in enumerate(names)]
    header = [f'"{cell}"' if mark in cell else cell for cell in header]
    before, between = data[:start].count(b"\n"), data[start : end.end()].count(b"\n")
    text = b"\n" * before + mark.join(header).encode() + b"\n" * between + data[end.end() :]
    return text, [f"TwinCAT Scope export: {sum(n.strip() != 'Name' for n in names)} channels"]


def _titled(name: str, unit: str) -> str:
    """``Time [ms]`` for a clock, whose cells repeat the titles of the lines; else the channel's name with its unit."""
    if name.strip() == "Name":
        return "Time [ms]"
    first = unit.strip().split(" ")[0]
    return name.strip() if first in ("", "(None)", "Unit") else f"{name.strip()} [{first}]"


def without_cut_end(body: bytes, dialect: Dialect) -> tuple[bytes, list[str]]:
    """Without a last line that stops in mid-number, as when a logger is switched off: fewer decimals than in every row before.

    Looked at are as many rows as stand in TAIL bytes. Who leaves out noughts behind the point has numbers of several lengths there:
    then the last must have no point, which all of many rows have, or be off by more than readings move from one to the next.
    """
    if body.endswith((b"\n", b"\r")):
        return body, []
    tail = LINE_END.split(body[-TAIL:].decode("utf-8", errors="replace"))
    rows = [split(line, dialect.delimiter) for line in tail if line.strip()]
    if len(rows) < 6 or len(rows[-1]) != dialect.width:
        return body, []

    def decimals(cell: str) -> int:
        return len(cell.strip().partition(dialect.decimal)[2])

    usual, last = {decimals(row[-1]) for row in rows[1:-1] if row}, rows[-1][-1]
    if not usual or decimals(last) >= min(usual) or not is_number(last, dialect.decimal):
        return body, []
    before = [to_number(row[-1], dialect.decimal) for row in rows[1:-1] if row and is_number(row[-1], dialect.decimal)]
    steps = [abs(b - a) for a, b in pairwise(before)]
    pointless = len(rows) > CUT_ROWS and not decimals(last)
    if len(usual) == 1 or pointless or (steps and abs(to_number(last, dialect.decimal) - before[-1]) > CUT_STEPS * max(steps)):
        at = max(body.rfind(b"\n"), body.rfind(b"\r"))
        return body[: at + 1], [f"the last line stops in mid-number ({last!r}) and was left out"]
    return body, []
