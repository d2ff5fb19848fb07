"""Tables for the eye, laid out for any width: numbers are never cut, lists break at ``+`` and commas, wide tables are stacked."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from rich.cells import cell_len

GAP = 2
#: What stands beside the number that it belongs to.
INTERVAL = "95 % interval"
#: A name of a sensor longer than this is folded where the table is too wide.
WIDEST_NAME = 24


@dataclass(frozen=True)
class Column:
    """cells are the texts of its rows; words are set to the left and may be broken into lines."""

    heading: str
    cells: tuple[str, ...]
    words: bool

    @property
    def natural(self) -> int:
        return max(map(cell_len, (self.heading, *self.cells)))

    @property
    def least(self) -> int:
        """Width below which a number would be cut, or a word outside its folding places."""
        heading = max(map(cell_len, self.heading.split() or [""]))
        if not self.words:
            return max(heading, *map(cell_len, self.cells), 0)
        return max(heading, *(min(cell_len(part), WIDEST_NAME) for cell in self.cells for part in pieces(cell)), 0)


def pieces(text: str) -> list[str]:
    """Parts of a text that stay on one line: it breaks behind ``+``, a comma or a blank only."""
    return [p for p in re.split(r"(?<=[+])|(?<=,) |(?<= )", text) if p] or [""]


def folded(text: str, width: int) -> list[str]:
    """Lines of a text that fit into `width`; a single part that is longer is broken."""
    lines, line = [], ""
    for piece in pieces(text):
        joint = "" if not line or line.endswith(("+", " ")) else " "
        if cell_len(line + joint + piece.rstrip()) <= width:
            line += joint + piece
            continue
        if line:
            lines.append(line.rstrip())
        while cell_len(piece) > width:
            lines.append(piece[:width])
            piece = piece[width:]
        line = piece
    return [*lines, line.rstrip()]


def blocks(columns: Sequence[Column], width: int | None, keys: int = 1) -> list[list[tuple[Column, int]]]:
    """Groups of (column, width) that each fit into `width`, the first `keys` columns and the status leading each group; an interval
    stays with its number.

    Without a width the table is as wide as it is.
    """
    total = sum(c.natural for c in columns) + GAP * (len(columns) - 1)
    if width is None or total <= width:
        return [[(c, c.natural) for c in columns]]
    least = [c.least for c in columns]
    if sum(least) + GAP * (len(columns) - 1) <= width:
        return [_spread(columns, least, width)]
    lead = list(columns[:keys])
    status = [c for c in columns[keys:] if c.heading == "status"]
    rest = [c for c in columns[keys:] if c.heading != "status"]
    together: list[list[Column]] = []
    for column in rest:
        if column.heading == INTERVAL and together:
            together[-1].append(column)
        else:
            together.append([column])
    groups: list[list[tuple[Column, int]]] = []
    current = [*lead, *status]
    for some in together:
        tried = [*current, *some]
        if sum(c.least for c in tried) + GAP * (len(tried) - 1) > width and len(current) > len(lead):
            groups.append(_spread(current, [c.least for c in current], width))
            current = [*lead, *some]
        else:
            current = tried
    groups.append(_spread(current, [c.least for c in current], width))
    return groups


def _spread(columns: Sequence[Column], least: Sequence[int], width: int) -> list[tuple[Column, int]]:
    """Widths between the least and the natural ones that fill `width` as far as they can."""
    spare = max(width - sum(least) - GAP * (len(columns) - 1), 0)
    found = []
    for column, low in zip(columns, least, strict=True):
        more = min(spare, column.natural - low)
        spare -= more
        found.append((column, low + more))
    return found


def lines_of(block: Sequence[tuple[Column, int]]) -> tuple[list[str], list[list[str]]]:
    """(lines of the heading, lines of each row) of one block."""
    heading = _row([(folded(c.heading, w), w, c.words) for c, w in block], bottom=True)
    rows = range(len(block[0][0].cells))
    return heading, [_row([(folded(c.cells[i], w) if c.words else [c.cells[i]], w, c.words) for c, w in block]) for i in rows]


def _row(cells: Sequence[tuple[list[str], int, bool]], bottom: bool = False) -> list[str]:
    height = max(len(lines) for lines, _, _ in cells)
    found = []
    for k in range(height):
        parts = []
        for lines, width, words in cells:
            at = k - (height - len(lines)) if bottom else k
            text = lines[at] if 0 <= at < len(lines) else ""
            blank = " " * (width - cell_len(text))
            parts.append(text + blank if words else blank + text)
        found.append((" " * GAP).join(parts).rstrip())
    return found
