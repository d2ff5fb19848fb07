"""Files that are packed: gzip, bzip2, xz, zstandard, and a zip archive that holds one file."""

import bz2
import gzip
import io
import lzma
import zipfile
import zlib

import pyarrow as pa

from ...errors import InputError, listed

#: The first bytes of what is unpacked, and its name.
MAGIC = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ\x00": "xz", b"\x28\xb5\x2f\xfd": "zstandard", b"PK\x03\x04": "zip"}
#: What the libraries raise for an archive that is damaged, cut short, locked or packed in a way that they do not know.
DAMAGED = (
    OSError,
    EOFError,
    MemoryError,
    ValueError,
    zlib.error,
    lzma.LZMAError,
    zipfile.BadZipFile,
    RuntimeError,
    NotImplementedError,
    pa.ArrowException,
)
#: More than this is no logger's file [bytes].
LARGEST = 2 << 30
LARGEST_WINDOW, PIECE = 256 << 20, 1 << 24
#: Members of a zip archive that say that it is a workbook: of Excel, of LibreOffice. Old workbooks of Excel are no archives.
WORKBOOKS = ("xl/workbook.xml", "xl/workbook.bin", "content.xml")
OLD_WORKBOOK = b"\xd0\xcf\x11\xe0"


def unpacked(data: bytes, name: str) -> bytes:
    """The bytes of the file inside, or the bytes themselves where nothing is packed; an Excel workbook stays as it is.

    Raises
    ------
    InputError: a damaged archive, one of several files, or one that unpacks to more than any record.
    """
    kind = next((k for magic, k in MAGIC.items() if data.startswith(magic)), "")
    if not kind or (kind == "zip" and is_workbook(data)):
        return data
    try:
        return _inside(data, kind, name)
    except DAMAGED as error:
        what = f"{name}: a {kind} archive that cannot be unpacked"
        raise InputError(what, found=str(error)[:120], do="copy the file again, or unpack it first") from None


def is_workbook(data: bytes) -> bool:
    """Whether the bytes are those of a workbook (.xlsx, .xlsm, .xlsb, .xls, .ods)."""
    if data.startswith(OLD_WORKBOOK):
        return True
    if not data.startswith(b"PK\x03\x04"):
        return False
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return any(member in WORKBOOKS for member in archive.namelist())
    except DAMAGED:
        return False


def _inside(data: bytes, kind: str, name: str) -> bytes:
    if kind == "zip":
        return _only_member(data, name)
    if kind == "zstandard":
        return _limited(pa.CompressedInputStream(pa.BufferReader(data), "zstd"), name)
    if kind == "gzip":
        return _limited(gzip.GzipFile(fileobj=io.BytesIO(data)), name)
    if kind == "bzip2":
        return _limited(bz2.BZ2File(io.BytesIO(data)), name)
    # A forged head may ask for any amount of memory.
    unpacker = lzma.LZMADecompressor(memlimit=LARGEST_WINDOW)
    whole = unpacker.decompress(data, LARGEST)
    if not unpacker.eof and len(whole) < LARGEST:
        raise EOFError("it ends before the end of what is packed")
    return _limited(io.BytesIO(whole), name)


def _only_member(data: bytes, name: str) -> bytes:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = [f for f in archive.namelist() if not f.endswith("/") and not f.startswith("__MACOSX/")]
        if len(files) != 1:
            raise InputError(
                f"{name}: an archive of {len(files)} files",
                found=listed(files, 5),
                allowed="one",
                do="unpack it, and name the files",
            )
        with archive.open(files[0]) as stream:
            return _limited(stream, name)


def _limited(stream: "io.IOBase | pa.NativeFile", name: str) -> bytes:
    parts: list[bytes] = []
    # Piece by piece: a stream asked for all of it makes room for all that it might be.
    while piece := stream.read(PIECE):
        parts.append(piece)
        if len(parts) * PIECE > LARGEST:
            raise InputError(f"{name}: unpacks to more than {LARGEST >> 30} GiB", do="cut it into files of one test each")
    return b"".join(parts)
