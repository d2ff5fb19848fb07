"""Files that are packed: gzip, bzip2, xz, zstandard, and a zip archive that holds one file."""

import bz2
import gzip
import io
import lzma
import zipfile
import zlib

import pyarrow as pa

from ...errors import InputError, listed
from .limits import PIECE, Limits, inflated

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
LARGEST_WINDOW, STEP = 256 << 20, 1 << 16
#: Members of a zip archive that say that it is a workbook: of Excel, of LibreOffice. Old workbooks of Excel are no archives.
WORKBOOKS = ("xl/workbook.xml", "xl/workbook.bin", "content.xml")
OLD_WORKBOOK = b"\xd0\xcf\x11\xe0"


def unpacked(data: bytes, name: str, limits: Limits = Limits()) -> bytes:  # noqa: B008 - frozen
    """The bytes of the file inside, or the bytes themselves where nothing is packed; an Excel workbook stays as it is.

    Raises
    ------
    InputError: a damaged archive, one of several files, or one that unpacks to more than any record.
    """
    kind = next((k for magic, k in MAGIC.items() if data.startswith(magic)), "")
    if not kind or (kind == "zip" and is_workbook(data)):
        return data
    try:
        return _inside(data, kind, name, limits)
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


def _inside(data: bytes, kind: str, name: str, limits: Limits) -> bytes:
    if kind == "zip":
        return _only_member(data, name, limits)
    if kind == "xz":
        return _of_xz(data, name, limits)
    if kind == "zstandard":
        whole = pa.BufferReader(data)
        return limits.read(pa.CompressedInputStream(whole, "zstd"), whole.tell, name)
    raw = io.BytesIO(data)
    return limits.read(gzip.GzipFile(fileobj=raw) if kind == "gzip" else bz2.BZ2File(raw), raw.tell, name)


def _of_xz(data: bytes, name: str, limits: Limits) -> bytes:
    # A forged head may ask for any amount of memory.
    unpacker = lzma.LZMADecompressor(memlimit=LARGEST_WINDOW)
    parts: list[bytes] = []
    size = taken = 0
    while not unpacker.eof:
        waiting = data[taken : taken + STEP] if unpacker.needs_input else b""
        if unpacker.needs_input and not waiting:
            break
        taken += len(waiting)
        parts.append(unpacker.decompress(waiting, PIECE))
        size += len(parts[-1])
        limits.check_unpacked(name, size, taken)
    if not unpacker.eof:
        raise EOFError("it ends before the end of what is packed")
    return b"".join(parts)


def _only_member(data: bytes, name: str, limits: Limits) -> bytes:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = [f for f in archive.namelist() if not f.endswith("/") and not f.startswith("__MACOSX/")]
        if len(files) != 1:
            raise InputError(
                f"{name}: an archive of {len(files)} files",
                found=listed(files, 5),
                allowed="one",
                do="unpack it, and name the files",
            )
        member = archive.getinfo(files[0])
        if member.flag_bits & 1:
            raise RuntimeError(f"{member.filename} is locked with a password")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            with archive.open(member) as stream:
                return limits.read(stream, lambda: member.compress_size, name)
        whole = b"".join(inflated(data, member, name, limits))
        if zlib.crc32(whole) != member.CRC:
            raise zipfile.BadZipFile(f"{member.filename} is damaged")
        return whole
