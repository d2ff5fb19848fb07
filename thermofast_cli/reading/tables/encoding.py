"""Bytes of a text file to UTF-8, by rule: marks, the pattern of NULs, strict UTF-8, then what the vendor's machines write."""

import codecs
import re

import numpy as np

from ...errors import InputError

#: Kinds of files that are no text, by their first bytes: what they are and what to do with them.
KINDS: tuple[tuple[bytes, str, str], ...] = (
    (b"PK\x03\x04", "an Excel workbook (.xlsx) or another zip archive", "save the sheet as CSV, or unpack the archive"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook (.xls)", "save the sheet as CSV"),
    (b"\x89HDF", "an HDF5 or new MATLAB file", "export the record as CSV"),
    (b"\x1f\x8b", "a gzip archive", "unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive", "unpack it first"),
    (b"BZh", "a bzip2 archive", "unpack it first"),
    (b"SQLite format 3", "an SQLite database", "export the table as CSV"),
    (b"%PDF", "a PDF document", "export the record as CSV from the logger's software"),
    (
        b"PAR1",
        "a Parquet file, which is read whole and not line by line",
        "watch it with --replay; save it again if damaged",
    ),
    (b"ARROW1", "an Arrow (Feather) file", "save it as Parquet"),
)

JAPANESE = ("温度", "時間", "時刻", "日時", "日付", "℃", "経過", "測定", "データ", "チャン", "室温")
RUSSIAN = ("время", "Время", "дата", "Дата", "емператур", "одшипник", "среда", "корпус", "Корпус", "оздух", "омнат", "Час")
GREEK = ("ερμοκρασ", "ρόνος", "Ώρα", "ώρα", "μερομην", "εριβάλλο", "ωμάτι", "ουλεμάν", "τρακτος")
#: Encodings, with words of a logger by which a file is known to be in one: read otherwise they do not appear.
BY_WORDS: dict[str, tuple[str, ...]] = {
    "gb18030": ("温度", "时间", "时刻", "室温", "室内", "日期", "℃", "通道", "序号", "采集", "环境", "主轴", "轴承", "记录"),
    "cp932": JAPANESE,
    "euc_jp": JAPANESE,
    "big5": ("溫度", "時間", "時刻", "室溫", "室內", "日期", "℃", "通道", "主軸", "軸承", "環境"),
    "euc_kr": ("온도", "시간", "날짜", "℃", "측정", "시각", "실온", "실내"),
    "cp1251": RUSSIAN,
    "koi8_r": RUSSIAN,
    "cp866": RUSSIAN,
    "cp1253": GREEK,
    "iso8859_7": GREEK,
    "cp1250": ("Čas", "čas", "ożysk", "ředn", "tył", "őmérséklet"),
    "cp1254": ("Sıcaklı", "sıcaklı", "ortamı", "dış", "İş", "yağı", "akım", "Akım", "asınç", "hızı", "Hızı"),
}


#: Letters that stand beside each other where another alphabet is read as Windows-1252, and in no language that has it.
_ODD = re.compile(rb"[\x80-\xff]{3,}")


def odd_letters(data: bytes) -> str:
    """What letters of an unknown alphabet look like, where the first lines of a file, now UTF-8, have any; else empty."""
    head = data[:65536].rpartition(b"\n")[0].decode("utf-8", errors="replace").encode("cp1252", errors="replace")
    found = _ODD.search(head)
    return found[0].decode("cp1252", errors="replace") if found else ""


def kind_of(data: bytes) -> tuple[str, str] | None:
    """(what, do) of a file of a known kind that is no text table, by its first bytes."""
    return next(((what, do) for mark, what, do in KINDS if data.startswith(mark)), None)


def binary(name: str, data: bytes = b"") -> InputError:
    """The error of a file that is no text; it names the kind where it is known."""
    kind = kind_of(data)
    return InputError(
        f"{name}: {kind[0] if kind else 'not a text table'}",
        found="" if kind else "binary data",
        allowed="CSV text" if data.startswith(b"PAR1") else "CSV text, or Parquet",
        do=kind[1] if kind else "export the record as CSV from the logger's software",
    )


def detect_encoding(data: bytes, name: str) -> str:
    """BOM, then the pattern of NULs, then strict UTF-8, then another one by its words, then Windows-1252.

    Raises
    ------
    InputError: the file is binary.
    """
    head = data[:65536]
    if kind_of(data):
        raise binary(name, data)
    if head.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if b"\0" in head:
        even, odd = head[0::2].count(0), head[1::2].count(0)
        if odd > 0.3 * len(head) / 2 and even < 0.02 * len(head):
            return "utf-16-le"
        if even > 0.3 * len(head) / 2 and odd < 0.02 * len(head):
            return "utf-16-be"
    control = sum(head.count(bytes([c])) for c in range(32) if c not in (0, 9, 10, 12, 13, 26))
    # A card pulled out of a logger leaves blocks of NULs in a file that is text otherwise.
    if control > 0.01 * len(head) or (b"\0" in head and head.count(0) > 0.5 * len(head)):
        raise binary(name)
    return "utf-8" if _is_utf8(data) else _by_words(data) or "cp1252"


def _is_utf8(data: bytes) -> bool:
    """Whether all of a file is UTF-8; below its first lines most are plain ASCII, which is told ten times as fast."""
    start = data.find(b"\n", 65536) + 1
    ascii_below = start > 0 and int(np.frombuffer(data, np.uint8, offset=start).max(initial=0)) < 128
    return _decodes(data[:start] if ascii_below else data, "utf-8")


def _by_words(data: bytes) -> str | None:
    """The encoding in which the beginning of a file has most of its words, where all of the file can be in it."""
    head = data[:65536].rpartition(b"\n")[0] or data
    found = {}
    for encoding, known in BY_WORDS.items():
        if _decodes(head, encoding):
            text = head.decode(encoding)
            found[encoding] = sum(word in text for word in known)
    best = max(found, key=lambda e: found[e], default=None)
    mixed = any(not line.isascii() and _decodes(line, "utf-8") for line in head.split(b"\n"))
    return best if best and found[best] and not mixed and _decodes(data, best) else None


def to_utf8(data: bytes, name: str, told: str | None) -> tuple[bytes, str, list[str]]:
    """(UTF-8 without mark, encoding, notes) of a text file.

    Raises
    ------
    InputError: binary, or not in the encoding that the user told.
    """
    notes: list[str] = []
    if len(tail := data.rstrip(b"\0")) < len(data) - 1 and tail.endswith(b"\n"):  # of UTF-16 the last byte may be one
        notes.append(f"{len(data) - len(tail)} NUL bytes at the end left out (the logger lost power?)")
        data = tail
    encoding = told or detect_encoding(data, name)
    if told and b"\0" in data and _is_bytewise(told):  # as where it is not told
        notes.append(f"{data.count(0)} NUL bytes left out (the logger lost power?)")
        data = data.replace(b"\0", b"")
    if told or encoding.startswith("utf-16") or encoding in BY_WORDS:
        try:
            text = data.decode(encoding)
        except (UnicodeError, LookupError) as error:
            raise InputError(
                f"{name}: cannot be decoded as {encoding}", found=str(error), do="say another --encoding, or none"
            ) from None
        if sum(ord(c) < 32 and c not in "\t\n\r" for c in text[:20000]) > 0.01 * len(text[:20000]):
            raise binary(name)
        return text.lstrip("\ufeff").encode("utf-8"), encoding, notes
    if b"\0" in data:
        notes.append(f"{data.count(0)} NUL bytes left out (the logger lost power?)")
        data = data.replace(b"\0", b"")
    elif encoding == "utf-8":
        return data, encoding, notes  # as it was found to be
    if encoding in ("utf-8", "utf-8-sig"):
        data = data.removeprefix(codecs.BOM_UTF8)
        try:
            data.decode("utf-8")
            return data, encoding, notes
        except UnicodeDecodeError:
            pass
    return *_mixed(data, encoding), notes


def _is_bytewise(encoding: str) -> bool:
    """Whether an ASCII letter is one byte in an encoding, so that a NUL is none of its letters; False where it is not known."""
    try:
        return "A".encode(encoding) == b"A"
    except LookupError:
        return False


def _mixed(data: bytes, encoding: str) -> tuple[bytes, str]:
    """Line by line: strict UTF-8 where a line is, else Chinese (GB 18030) beside Chinese UTF-8, else Windows-1252."""
    lines = data.split(b"\n")
    whole: list[bytes] = []
    odd: list[int] = []
    chinese = False
    for i, line in enumerate(lines):
        try:
            chinese |= any("\u4e00" <= c <= "\u9fff" for c in line.decode("utf-8")) if not line.isascii() else False
        except UnicodeDecodeError:
            odd.append(i)
        whole.append(line)
    fallback = (
        "gb18030" if (chinese or encoding == "utf-8-sig") and _decodes(b"".join(lines[i] for i in odd), "gb18030") else "cp1252"
    )
    for i in odd:
        whole[i] = lines[i].decode(fallback, errors="replace").encode("utf-8")
    mixed = encoding == "utf-8-sig" or len(odd) < sum(not line.isascii() for line in lines)
    return b"\n".join(whole), f"utf-8 with lines in {fallback}" if mixed else fallback


def _decodes(data: bytes, encoding: str) -> bool:
    try:
        data.decode(encoding)
    except UnicodeDecodeError:
        return False
    return True


def refuse_markup(data: bytes, name: str) -> None:
    """Raises InputError for JSON and XML, which are text and no table."""
    head = data[:200].lstrip()
    if re.match(rb"\[?\s*\{\s*\"", head):
        lines = ", lines=True" if head.startswith(b"{") and data.count(b"\n{") else ""
        raise InputError(
            f"{name}: JSON, not a table", allowed="CSV text, Parquet, ...", do=f"in Python: tf.read(pandas.read_json(path{lines}))"
        )
    if head.startswith((b"<?xml", b"<html", b"<!DOCTYPE")):
        raise InputError(f"{name}: XML or a page, not a table", allowed="CSV text, Parquet, ...", do="export the record as CSV")
