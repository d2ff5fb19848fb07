"""Names and units of the columns of a text table, from the lines above its readings."""

import re
from collections import Counter
from collections.abc import Iterable

from ...errors import InputError
from ..moments.time_column import is_time_name
from ..run import Run, renamed
from ..signs import names_a_set_point, names_the_room_alone, sign_of
from ..tables.dialect import NAME_WORDS, ROWS_ABOVE, UNIT_WORDS, Dialect, header_cells, is_process_line, is_unit_line, says, split
from ..units import parse_unit, unit_in_name
from ..vocabulary import DISPLACEMENTS, TIME, words
from .labels import with_labels

#: Names of remarks that no row has.
REMARKED = ("", "comment", "comments", "bemerkung", "remark")
#: A unit in brackets at the end of a name.
_UNIT_BEHIND = re.compile(r"\s*[\[(]([^\[\]()]*)[\])]$")
#: The path of a sensor of a computer, and the unit of each kind.
_PATH = re.compile(r"/[\w./%-]+/([a-z]+)/\d+")
_KINDS = {
    "temperature": "°C",
    "load": "%",
    "clock": "MHz",
    "power": "W",
    "fan": "rpm",
    "voltage": "V",
    "current": "A",
    "control": "%",
    "level": "%",
    "flow": "l/h",
}


def _named_below(cells: list[str], units: list[str], below: list[str], rows: list[list[str]]) -> tuple[list[str], list[str]]:
    """Names and units where the line of units names the columns that have none above (Yokogawa: Date,Time,sec,Unit,degC below
    ,,,Tag,front); a column that only labels the two lines has no name.
    """
    cells, units = list(cells), list(units)
    for i, told in enumerate(below[: len(cells)]):
        label = cells[i].strip().lower() in NAME_WORDS and told.strip().lower() in UNIT_WORDS
        if label and all(not row[i].strip() for row in rows if len(row) > i):
            cells[i] = units[i] = ""
            continue
        nameless = not cells[i].strip() or cells[i].strip().lower() in NAME_WORDS
        if nameless and re.search(r"[A-Za-z]{3}", told) and parse_unit(told) is None and told.strip().lower() not in UNIT_WORDS:
            cells[i], units[i] = told.strip(), ""
    return cells, units


def _counts(cells: list[str]) -> bool:
    """Whether cells are 1, 2, 3, ..."""
    return len(cells) > 2 and cells == [str(i + 1) for i in range(len(cells))]


def _groups(head: list[str], dialect: Dialect) -> list[str]:
    """Of each column what the line right above the names says of several of them together; empty where it says nothing.

    Two groups at least, one of them of temperatures, of the room or of set points, or such as tell columns of one name apart, over
    no or another name of the time, and no numbers: ``;Temperature [°C];;Displacement [um];``.
    """
    line = next((i for i in range((dialect.header_line or 0) - 1, -1, -1) if head[i].strip()), None)
    cells = split(head[line], dialect.delimiter) if line is not None and line not in dialect.unit_lines else []
    told = [c.strip() for c in cells]
    if not 2 < len(told) <= dialect.width or any(re.match(r"[+-]?\d", c) for c in told):
        return []
    labels = [c for c in told[1:] if c]
    unit = parse_unit(_bracketed(labels[0])) if len(labels) == 1 and not told[0] else None
    if len(labels) < 2 and (unit is None or not unit.temperature):
        return []  # one label alone is a title, but for the unit of all
    names = split(head[dialect.header_line or 0], dialect.delimiter)
    blocks = _blocks(told, names)
    of_time = blocks or not told[0] or names[0].strip() in ("", told[0]) or told[0].lower() in TIME
    found = [told[0] if blocks else ""]
    for cell in told[1:]:
        found.append(cell or found[-1])  # a merged cell stands where it begins
    bare = [n.strip() for n in names]
    parts = len(set(bare)) < len(bare) and len(set(zip(bare, found, strict=False))) == len(bare) <= len(found)
    if not of_time or not (parts or any(sign_of(c, "").temperature or _tells(c) for c in told[1:])):
        return []
    return found


def _blocks(told: list[str], names: list[str]) -> bool:
    """Whether the names are the same few over and over, a time first, each time under a label of its own."""
    starts = [i for i, c in enumerate(told) if c]
    size = starts[1] - starts[0] if len(starts) > 1 else 0
    bare = [n.strip() for n in names]
    alike = size > 1 and len(bare) % size == 0 and bare == bare[:size] * (len(bare) // size)
    return (
        alike
        and starts == list(range(0, len(bare), size))
        and len({told[i] for i in starts}) == len(starts)
        and is_time_name(bare[0])
    )


def _tells(label: str) -> bool:
    """Whether a label says that what it stands above is the room's or is asked for."""
    return names_the_room_alone(label) or names_a_set_point(label)


def _bracketed(text: str) -> str:
    """What stands in the brackets of a text; empty where there are none."""
    found = re.search(r"[\[(]([^\])]+)[\])]", text)
    return found[1] if found else ""


def _in_group(cell: str, unit: str, group: str, twice: bool) -> tuple[str, str]:
    """(name, unit) of a column in a group, which has the group's unit in brackets; its name where it would be read alike."""
    if not group or not cell.strip() or group == cell.strip():
        return cell, unit
    own = parse_unit(_bracketed(group) or group)
    if not unit and unit_in_name(cell) is None and own is not None:
        unit = "°F" if own.symbol == "F" and not own.letter else own.symbol  # a bare F may be a place
    moves = own is None and bool(set(words(group))) and set(words(group)) <= DISPLACEMENTS
    moves = moves or (_tells(group) and sign_of(cell, unit).kind in ("sensor", "named", "nameless"))
    return (f"{group} {cell.strip()}" if twice or moves else cell), unit


def _repeated(cells: list[str]) -> set[str]:
    """Names that stand there more than once."""
    return {name for name, count in Counter(cells).items() if count > 1 and name.strip()}


def _told_apart(cells: list[str], head: list[str], dialect: Dialect) -> list[str]:
    """Names with the label above them where that is of the room or of a set point, or where several are alike: front MIN,
    front MAX; and with how they were made, where that stands below and they still are.
    """
    header = dialect.header_line or 0
    above = [split(line, dialect.delimiter) for line in head[max(header - ROWS_ABOVE, 0) : header]]
    labels = next((row for row in reversed(above) if len(row) == len(cells) and says(row, NAME_WORDS)), None)
    twice = _repeated(cells)
    found = list(cells)
    for i, label in enumerate(labels or []):
        other = _tells(label) and sign_of(cells[i].strip(), "").kind in ("sensor", "named", "nameless")
        if label.strip() and cells[i].strip() and i > 0 and (cells[i] in twice or other):
            found[i] = f"{label.strip()} {cells[i].strip()}"
    twice = _repeated(found)
    below = [split(line, dialect.delimiter) for line in head[header + 1 : dialect.data_line]] if twice else []
    below += [["", *row[1:]] for row in above] if twice else []
    made = next((row for row in below if len(row) == len(cells) and is_process_line(row)), None)
    if made is not None:
        found = [f"{c} {m.strip()}" if c in twice and m.strip() else c for c, m in zip(found, made, strict=True)]
    return found


def _told_by_path(head: list[str], dialect: Dialect, units: list[str]) -> list[str]:
    """Units as the line right above the names tells them by paths of sensors, as LibreHardwareMonitor has it:
    /amdcpu/0/temperature/0.
    """
    above = head[dialect.header_line - 1] if dialect.header_line else ""
    cells = split(above, dialect.delimiter) if above.count("/") > 2 else []
    paths = [_PATH.fullmatch(c.strip()) for c in cells]
    if len(cells) != dialect.width or sum(p is not None for p in paths) < len(cells) - 1:
        return units
    return [u or (_KINDS.get(p[1], "counts") if p else "") for u, p in zip(units, paths, strict=True)]


def names_and_units(head: list[str], dialect: Dialect, name: str) -> tuple[list[str], list[str]]:
    """Names and units of the columns, from the first lines of a file.

    Raises
    ------
    InputError: a row has another number of cells than the header.
    """
    width, header = dialect.width, head[dialect.header_line] if dialect.header_line is not None else ""
    # Decimal commas that were joined stand under a header of commas.
    commas = bool(header) and dialect.delimiter == ";" and ";" not in header and len(split(header, ",")) == width
    delimiter = "," if commas else dialect.delimiter
    rows = [split(line, delimiter) for line in head[dialect.data_line :][:50] if line.strip()]
    cells = _as_many(header_cells(header, delimiter), rows, dialect, name) if header else []
    units = _units_above(head, dialect)
    if not cells:
        return _unique([], width), units
    groups = _groups(head, dialect)
    units = _told_by_path(head, dialect, units)
    for line in dialect.unit_lines:
        cells, units = _named_below(cells, units, split(head[line], dialect.delimiter), rows)
    cells, units = with_labels(cells, units, head, dialect)
    twice = _repeated(cells) if groups else set()
    for i, group in enumerate(groups):
        cells[i], units[i] = _in_group(cells[i], units[i], group, cells[i] in twice)
    cells = _told_apart(cells, head, dialect)
    return _unique(_merged_from_above(cells, head, dialect, delimiter), width), units


def _as_many(cells: list[str], rows: list[list[str]], dialect: Dialect, name: str) -> list[str]:
    """The header's cells, as many as the rows have, where it is plain which are missing or too many.

    Raises
    ------
    InputError: it is not.
    """
    width, cells = dialect.width, list(cells)
    if not any(cell.strip() for row in rows if len(row) == width for cell in row[len(cells) :]):
        cells += [""] * (width - len(cells))  # rows that end in delimiters; otherwise no one can tell which name is missing
    if len(cells) == width - 1 and _counts([row[0] for row in rows if len(row) == width]):
        cells.insert(0, "")  # R writes the names of rows under no name
    if len(cells) > width and rows and len(rows[0]) == len(cells):
        del cells[width:]  # what the first row alone has: Lascar's serial number
    while len(cells) > width and cells[-1].strip().lower() in REMARKED:
        cells.pop()  # a header that ends in a delimiter, or names a remark that no row has
    if len(cells) != width:
        commas = dialect.delimiter == "," and width > len(cells)
        raise InputError(
            f"{name}, line {dialect.data_line + 1}: the row has {width} cells and the header {len(cells)}",
            found="numbers with decimal commas in a comma-separated file?" if commas else "",
            allowed="as many names as cells",
            do="export with semicolons or decimal points" if commas else "mend the header, or say --header-line and --delimiter",
        )
    return cells


def _units_above(head: list[str], dialect: Dialect) -> list[str]:
    """Units of the columns as lines of units tell them, the upper ones first."""
    units = [""] * dialect.width
    for line in dialect.unit_lines[::-1]:
        told = split(head[line], dialect.delimiter)[: dialect.width]
        whole, labelled = is_unit_line(told), says(told, UNIT_WORDS)
        for i, cell in enumerate(told):
            if not cell.strip() or (i == 0 and labelled):
                continue
            if parse_unit(cell) or (whole and not units[i]):
                units[i] = cell.strip()
    return units


def _merged_from_above(cells: list[str], head: list[str], dialect: Dialect, delimiter: str) -> list[str]:
    """Names of columns that have none in the header's line, from lines above it: a logger's tags, a cell merged downwards."""
    header, width = dialect.header_line, dialect.width
    if header is None or all(c.strip() for c in cells):
        return cells
    above = [split(line, delimiter) for line in head[max(header - ROWS_ABOVE, 0) : header]]
    tags = next((row for row in above if len(row) == width and says(row, NAME_WORDS)), [""] * width)
    cells = [c if c.strip() or i == 0 else tag for i, (c, tag) in enumerate(zip(cells, tags, strict=False))]
    lower = above[-1] if above and len(above[-1]) == width and sum(map(bool, above[-1])) > 1 else [""] * width
    return [c if c.strip() else merged for c, merged in zip(cells, lower, strict=True)]


def _unique(cells: list[str], width: int) -> list[str]:
    """Names of `width` columns, each once, those without a cell by their number."""
    names: list[str] = []
    taken: set[str] = set()
    for i in range(width):
        cell = cells[i].strip() if i < len(cells) else ""
        # The sign of a comment is none of a name, but where it is all of it.
        bare = cell.lstrip("#%").strip() if i == 0 or cell[1:2].isspace() else cell
        base = unique = bare or cell or f"column {i + 1}"
        count = 2
        while unique in taken:
            unique = f"{base} ({count})"
            count += 1
        names.append(unique)
        taken.add(unique)
    return names


def _bare(name: str) -> str:
    """A sensor's name without the unit of its temperatures behind it."""
    found = _UNIT_BEHIND.search(name)
    unit = parse_unit(found[1]) if found else None
    return name[: found.start()] if found and unit is not None and unit.temperature else name


def named_as(run: Run, names: Iterable[str]) -> Run:
    """The run with its sensors called as names has them where only the unit behind differs: the same probes, exported otherwise."""
    wanted = [n for n in names if n not in run.channels]
    spare = [c for c in run.channels if c not in names]
    pairs = []
    for name in wanted:
        alike = [c for c in spare if _bare(c) == _bare(name)]
        if len(alike) == 1 and sum(_bare(n) == _bare(name) for n in wanted) == 1:
            pairs.append(f"{alike[0]}={name}")
    return renamed(run, pairs) if pairs else run
