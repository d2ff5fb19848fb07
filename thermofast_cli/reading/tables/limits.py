"""How large a record may be: checked before room is made for it, whatever a file says of itself."""

import os
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError

#: What unpacks to more than this [bytes] is looked at, and refused where it is so many times what is packed.
LARGE, MOST_TIMES = 32 << 20, 400
PIECE = 1 << 20
#: A cell of a sheet of Excel, and the place of a variable in a MATLAB file that is packed.
CELL = re.compile(rb'<(?:\w+:)?c [^>]*?r="([A-Z]{1,3})([0-9]{1,7})"')
PACKED_VARIABLE, MATLAB_HEAD = 15, 128
#: A formula whose value was never worked out, as programs write it that are no spreadsheets.
NO_VALUE = re.compile(rb"</(?:\w+:)?f>\s*(?:<(?:\w+:)?v\s*/>|<(?:\w+:)?v></|</(?:\w+:)?c>)")


#: Bytes of a path, and of a part of it, that no system's paths have more of.
LONGEST_PATH, LONGEST_PART = 32_767, 255


def refuse_no_path(source: str) -> None:
    """Raises InputError for a text that can be no file's name, as the text of a table handed over in place of one."""
    long = len(source) > LONGEST_PATH or any(len(os.fsencode(part)) > LONGEST_PART for part in Path(source).parts)
    if long or "\0" in source or "\n" in source:
        raise InputError(
            "not the name of a file",
            found=f"{source[:40]!r}, {len(source)} signs",
            allowed="a path",
            do="a text in memory is read as tf.read(pandas.read_csv(io.StringIO(text)))",
        )


@dataclass(frozen=True)
class Limits:
    """Bytes of a file, unpacked or not, and of its table in memory; rows and columns of the table."""

    max_bytes: int = 2 << 30
    max_rows: int = 20_000_000
    max_columns: int = 100_000

    def check_shape(self, name: str, rows: int, columns: int) -> None:
        """Raises InputError for a table that is too large."""
        for count, most, what, option in (
            (rows, self.max_rows, "rows", "--max-rows"),
            (columns, self.max_columns, "columns", "--max-columns"),
            (8 * rows * columns, self.max_bytes, "bytes in memory", "--max-bytes"),
        ):
            if count > most:
                raise InputError(
                    f"{name}: a table of {count} {what}",
                    allowed=f"{most} ({option})",
                    do=f"cut it, or say {option} where it is one",
                )

    def check_bytes(self, name: str, size: int) -> None:
        """Raises InputError for a file that is too large."""
        if size > self.max_bytes:
            raise InputError(
                f"{name}: more than {_told(self.max_bytes)}",
                found=f"{size} bytes" if size < 1 << 50 else "",
                allowed=f"{self.max_bytes} bytes (--max-bytes)",
                do="cut it into files of one test each, or say --max-bytes where it is one",
            )

    def read(self, stream: Any, consumed: Callable[[], int], name: str) -> bytes:
        """All that a stream unpacks; consumed tells how much that is packed it has taken.

        Raises
        ------
        InputError: it is too much, or far more than logged readings can be packed.
        """
        parts: list[bytes] = []
        size = 0
        # Piece by piece: a stream asked for all of it makes room for all that it might be.
        while piece := stream.read(PIECE):
            size += len(piece)
            self.check_unpacked(name, size, consumed())
            parts.append(piece)
        return b"".join(parts)

    def check_unpacked(self, name: str, size: int, taken: int) -> None:
        """Raises InputError for what unpacks to too much."""
        self.check_bytes(name, size)
        if size > LARGE and size > MOST_TIMES * max(taken, PIECE >> 4):
            raise InputError(
                f"{name}: unpacks to more than {MOST_TIMES} times its size",
                found=f"{_told(size)} out of {taken} bytes so far",
                allowed="a packed record",
                do="unpack it, and look at it",
            )


def _told(size: int) -> str:
    return f"{size >> 30} GiB" if size >= 1 << 30 else f"{size >> 20} MiB"


def check_workbook(data: bytes, archive: zipfile.ZipFile, name: str, limits: Limits) -> bool:
    """What a workbook's members unpack to, whatever the archive says of it, and how far its cells reach.

    Returns whether any cell is a formula without a stored value.

    Raises
    ------
    InputError: too much, or an archive that lies.
    """
    unworked = False
    for member in archive.infolist():
        sheet = member.filename.startswith("xl/worksheets/")
        rows = columns = 0
        rest = b""
        for piece in inflated(data, member, name, limits):
            if sheet:
                for letters, row in CELL.findall(rest + piece):
                    if len(letters) > 2 or len(row) > 4:
                        rows, columns = max(rows, int(row)), max(columns, _column(letters))
                unworked = unworked or NO_VALUE.search(rest + piece) is not None
                rest = piece[-64:]
        limits.check_shape(f"{name}, {member.filename}", rows, columns)
    return unworked


def _column(letters: bytes) -> int:
    number = 0
    for letter in letters:
        number = 26 * number + letter - 64
    return number


def inflated(data: bytes, member: zipfile.ZipInfo, name: str, limits: Limits) -> Any:
    """Pieces of a member of a zip archive as its bytes unpack, not as the archive says that they do.

    Raises
    ------
    InputError: as :meth:`Limits.check_unpacked`. zlib.error, zipfile.BadZipFile: it is damaged.
    """
    head = data[member.header_offset : member.header_offset + 30]
    if len(head) < 30 or not head.startswith(b"PK\x03\x04"):
        raise zipfile.BadZipFile(f"no member {member.filename!r} where the archive says")
    begin = member.header_offset + 30 + sum(struct.unpack("<HH", head[26:30]))
    packed = memoryview(data)[begin : begin + member.compress_size]
    if member.compress_type == zipfile.ZIP_STORED:
        limits.check_bytes(name, len(packed))
        yield bytes(packed)
        return
    if member.compress_type != zipfile.ZIP_DEFLATED:
        raise zipfile.BadZipFile(f"member {member.filename!r} is packed in another way than by deflate")
    yield from inflate(packed, name, limits, -zlib.MAX_WBITS)


def inflate(packed: memoryview, name: str, limits: Limits, window: int = zlib.MAX_WBITS) -> Any:
    """Pieces of what zlib has packed.

    Raises
    ------
    InputError: as :meth:`Limits.check_unpacked`. zlib.error: it is damaged.
    """
    unpacker = zlib.decompressobj(window)
    size = 0
    for i in range(0, len(packed), PIECE >> 4):
        waiting: Any = packed[i : i + (PIECE >> 4)]
        while waiting:
            piece = unpacker.decompress(waiting, PIECE)
            waiting = unpacker.unconsumed_tail
            size += len(piece)
            limits.check_unpacked(name, size, i + (PIECE >> 4))
            yield piece
    if not unpacker.eof:
        raise zlib.error("it ends before the end of what is packed")


def matlab_elements(data: bytes, name: str, limits: Limits) -> Iterator[memoryview]:
    """The variables of a MATLAB file with their tags, unpacked one after the other.

    Raises
    ------
    InputError: as :meth:`Limits.check_unpacked`. zlib.error: one is damaged.
    """
    order, whole = matlab_order(data), memoryview(data)
    at = MATLAB_HEAD
    while at + 8 <= len(data):
        kind, size = struct.unpack(f"{order}II", data[at : at + 8])
        held = whole[at : at + 8 + size]
        yield memoryview(b"".join(inflate(held[8:], name, limits))) if kind == PACKED_VARIABLE else held
        at += 8 + size


def matlab_order(data: bytes) -> str:
    """The order of bytes in a MATLAB file, as struct writes it."""
    return "<" if data[126:128] == b"IM" else ">"
