"""What a preamble says of channels that the header only counts: CH1 is "Spindle front"."""

import re
from collections import Counter
from typing import NamedTuple

from ..tables.dialect import NAME_WORDS, UNIT_WORDS, Dialect, header_cells, split
from ..units import parse_unit

#: A name that says where a wire ends in the logger and nothing of the machine: CH1-1, T3, 101, Kanal 2, AI 0/4, with its unit.
DESIGNATION = re.compile(r"((?:[^\W\d_]{1,8}[ ._#-]{0,2})?\d{1,5}(?:[-_/.]\d{1,4})?)(\s*[\[(][^\[\]()]*[\])])?")
#: First cells of lines, and titles of columns of lists, that say what stands at a channel.
LABEL_WORDS = NAME_WORDS | frozenset(
    [
        "signal name", "signal", "description", "designation", "location", "position", "place", "measuring point",
        "sensor name", "channel label", "tag description", "installed at", "signalname", "beschreibung", "messstelle",
        "messort", "ort", "einbauort", "kanalname", "benennung", "désignation", "emplacement", "descrizione", "posizione",
        "descripción", "ubicación", "nombre", "名称", "测点", "测点名称", "位置", "通道名称", "信号名",
        "信号名称", "コメント", "测量点",
    ]
)  # fmt: skip
#: A label says something: three letters in a row, or two signs of a script that writes words so.
_SAYS = re.compile(r"[^\W\d_]{3}|[぀-ヿ㐀-鿿가-힯]{2}")
#: Kinds of probes and inputs, which tell no place.
_PROBES = re.compile(
    r"(?i)(?:type |typ |tc[ _-]?)?[kjtensrb]|pt ?-?\d+.*|ni ?\d+.*|rtd.*|tc|ntc.*|temp\w*|thermo\w*|voltage|volt|dcv?|current"
    r"|logic|pulse|off|on|auto"
)
#: Names of channels that are long enough to be words.
_CHANNEL = re.compile(r"(?i)chan|kanal|canal|sens|input|eingang|temp|probe|therm|point|mess|f(ü|ue)hler|通道|传感器|测点|温度")
#: Characters of a name, and of a line of a list, that are looked at: to look through a hostile one would take for ever.
LONGEST = 1000
#: What parts channel and label in a line that the table's own delimiter leaves whole.
_PARTED = re.compile(r"\s*(?:[:=\t;,|]|\s[-–]\s)\s*")


def designation(name: str) -> str:
    """The channel that a name says and nothing else, without unit; empty for any other name."""
    found = DESIGNATION.fullmatch(name.strip())
    return found[1].strip() if found else ""


def labelled(name: str) -> tuple[str, str] | None:
    """(label, channel with its unit) of a name that :func:`with_labels` made; None for any other."""
    if len(name) > LONGEST:
        return None
    found = re.fullmatch(rf"(.*?{_SAYS.pattern}.*?) ({DESIGNATION.pattern})", name.strip())
    return (found[1], found[2]) if found else None


def with_labels(cells: list[str], units: list[str], head: list[str], dialect: Dialect) -> tuple[list[str], list[str]]:
    """(names, units) with what the lines about them say stands there: CH1 becomes "Spindle front CH1"; others as they are.

    Two channels at least must have a label each of their own: in a line that has a cell for each column (Comment, Spindle front,
    Spindle rear), or in a list with a line for each channel (CH1, Spindle front, TC_K).
    """
    header = dialect.header_line
    channels = {i: d for i, c in enumerate(cells) if (d := designation(c))}
    if header is None or len(channels) < 2 or len(set(channels.values())) < len(channels):
        return cells, units
    between = [i for i in range(header + 1, dialect.data_line) if i not in dialect.unit_lines]
    found = _of_lines(head, between, range(header - 1, -1, -1), cells, channels, dialect)
    found = found or _of_list(head[:header], channels, dialect)
    told = Counter(label.text for label in found.values())
    if len(found) < 2 or max(told.values()) > 1:
        return cells, units
    bare = {i for i in found if not units[i] and "[" not in cells[i] and "(" not in cells[i]}
    return (
        [f"{found[i].text} {c.strip()}" if i in found else c for i, c in enumerate(cells)],
        [found[i].unit if i in bare else unit for i, unit in enumerate(units)],
    )


class _Label(NamedTuple):
    """What stands at a channel, and the unit that is told beside; empty where none is."""

    text: str
    unit: str = ""


def _label(cell: str) -> _Label | None:
    """What a cell says stands at a channel; None where it says nothing."""
    text, _, behind = cell.strip(" '\"").partition("[" if "[" in cell else "(")
    text, behind = text.strip(" '\""), behind.strip(" )]'\"")
    number = designation(text)
    counted = bool(number) and (_CHANNEL.match(number) is not None or not _SAYS.search(number))
    if not _SAYS.search(text) or _PROBES.fullmatch(text) or counted or parse_unit(text) is not None:
        return None
    # Behind a place stands the kind of its thermocouple, too: a bare K is no kelvin.
    return _Label(text, behind if len(behind) > 1 and parse_unit(behind) is not None else "")


def _of_lines(
    head: list[str], between: list[int], above: range, cells: list[str], channels: dict[int, str], dialect: Dialect
) -> dict[int, _Label]:
    """Labels by column from a line of as many cells as the header; one that does not say what it tells must name all."""
    for line in [*between, *above]:
        row = [c.strip() for c in header_cells(head[line], dialect.delimiter)] if head[line].strip() else []
        if len(row) != len(cells):
            continue
        labels = {i: label for i in channels if (label := _label(row[i]))}
        others = [row[i] for i in range(len(row)) if i not in channels]
        said = row[0].lower().rstrip(":") in LABEL_WORDS and 0 not in channels
        near = (line in between or line == above.start) and not any(others) and len(labels) == len(channels)
        if (said or near) and len(labels) > 1:
            return labels
    return {}


def _of_list(above: list[str], channels: dict[int, str], dialect: Dialect) -> dict[int, _Label]:
    """Labels by column from lines that begin with a channel each, under titles or of two cells."""
    rows = [row for line in above for row in _rows(line, dialect.delimiter)]
    names = [(at, c) for at, row in enumerate(rows) if len(row) > 1 and (c := designation(row[0]))]
    wanted = {_key(d): i for i, d in channels.items()}
    if not any(_key(c) in wanted for _, c in names):  # CH1 of the list is 1 of the header, or the other way round
        wanted = {_number(d): i for i, d in channels.items()}
        names = [(at, _number(c)) for at, c in names]
        if len(wanted) < len(channels) or len({c for _, c in names}) < len(names):
            return {}
    listed = [(at, wanted[_key(c)]) for at, c in names if _key(c) in wanted]
    if not listed or len({i for _, i in listed}) < len(listed):
        return {}
    titles = next((rows[at] for at in range(listed[0][0] - 1, -1, -1) if rows[at]), [])
    column = next((k for k, t in enumerate(titles) if k and t.lower() in LABEL_WORDS), None)
    of_unit = next((k for k, t in enumerate(titles) if k and t.lower() in UNIT_WORDS), None) if column else None
    if column is None and any(len([c for c in rows[at] if c]) > 2 for at, _ in listed):
        return {}
    found = {}
    for at, i in listed:
        row, place = rows[at], column or 1
        label = _label(row[place]) if len(row) > place else None
        if label:
            told = of_unit is not None and len(row) > of_unit and parse_unit(row[of_unit]) is not None
            found[i] = label._replace(unit=row[of_unit or 0]) if told else label
    return found


def _rows(line: str, delimiter: str) -> list[list[str]]:
    """The cells of a line of a list, by the table's delimiter or by what else parts two; or of each that one line tells."""
    line = line.strip().lstrip("#%").strip()
    if not line or len(line) > LONGEST:
        return [[]]
    row = split(line, delimiter) if delimiter != " " else []
    several = [_PARTED.split(c.strip(), maxsplit=1) for c in re.split("[,;]", line)]
    if len(several) > 1 and all(len(pair) == 2 and designation(pair[0]) for pair in several):
        return several  # T1 = front bearing, T2 = rear bearing
    row = row if len(row) > 1 else _PARTED.split(line, maxsplit=1)
    return [[c.strip() for c in row]]


def _key(channel: str) -> str:
    return re.sub(r"[ ._#]", "", channel).casefold()


def _number(channel: str) -> str:
    """The digits with which a channel ends, without leading noughts."""
    return re.sub(r"^\D+0*(?=\d)|^0+(?=\d)", "", channel)
