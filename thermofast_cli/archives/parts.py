"""The folder of results: one Parquet part for each file, whole or not there; docs/scale.md has the schema."""

import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ..errors import UsageError
from ..output.files import write_json
from ..output.whole import TEMPORARY, write_whole
from ..records import FAILURES
from .sources import MANIFEST, SourceFile

#: Version of the layout: of names, of the columns beside a record's own, of the manifest.
LAYOUT = 1
LOCK = ".thermofast.lock"
#: Characters of names in the folder, of a hash in them.
LONGEST, SHORT = 80, 16
#: In the message of a file that could not be read because of the machine it was tried on.
WANTING = ("pip install", "out of memory")
#: Where a part says how many of its records have the status failed, or would be read elsewhere.
FAILED = b"thermofast.failed"
#: Where it says how many have which of the statuses that are no result.
LOST = b"thermofast.lost"


@dataclass(frozen=True)
class Manifest:
    """What the results of a folder were made with."""

    command: str
    version: str
    kernels: str
    settings: dict[str, str]
    layout: int = LAYOUT

    def key(self, source: SourceFile, content: str) -> str:
        """What a part depends on: the file's place and content (its hash), settings, version."""
        told = json.dumps([asdict(self), source.name, content], sort_keys=True)
        return hashlib.sha256(told.encode()).hexdigest()[:SHORT]


class Parts:
    """The parts below a folder."""

    def __init__(self, folder: str, manifest: Manifest, resumed: bool = False) -> None:
        self.folder = Path(folder).absolute()  # workers may stand in other folders
        self.manifest = manifest
        #: Whether some may be there already.
        self.resumed = resumed

    def path(self, source: SourceFile, content: str) -> Path:
        """Where the part of a file goes."""
        return self._place(source) / f"{self._stem(source)}-{self.manifest.key(source, content)}.parquet"

    def there(self, source: SourceFile, content: str) -> dict[str, int] | None:
        """How many records of a part that is there, whole, have a status that is no result, by status.

        None where it is not, or something in it failed: that may be better the next time, which an unreadable file is not.
        """
        import pyarrow as pa
        import pyarrow.parquet as papq

        path = self.path(source, content)
        try:
            if not path.exists():
                return None
            # Read as a whole: a byte that went wrong in its middle shows by the checksum of its page.
            whole = papq.ParquetFile(path, page_checksum_verification=True, pre_buffer=False).read(use_threads=False)
            marks = whole.schema.metadata or {}
            return dict(json.loads(marks.get(LOST, b"{}"))) if marks.get(FAILED) == b"0" else None
        except (OSError, ValueError, pa.ArrowException):
            return None

    def write(self, source: SourceFile, content: str, table: Any) -> None:
        """A part, on the disk when this returns; parts of the same file as it was before go.

        Raises
        ------
        UsageError: it cannot be written.
        """
        import pyarrow.parquet as papq

        told = {"layout": str(LAYOUT), "command": self.manifest.command, "version": self.manifest.version}
        marks = {f"thermofast.{name}": value for name, value in told.items()}
        statuses = Counter(table.column("status").to_pylist())
        marks[FAILED.decode()] = str(statuses["failed"] + _may_be_better(table))
        marks[LOST.decode()] = json.dumps({status: statuses[status] for status in sorted(FAILURES & set(statuses))})
        table = table.replace_schema_metadata(marks)
        path = self.path(source, content)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"{path.parent}: cannot be made", found=str(error.strerror), do="choose another place") from None
        write_whole(str(path), lambda p: papq.write_table(table, p, compression="zstd", write_page_checksum=True), at_once=True)
        for old in path.parent.glob(f"{_escaped(self._stem(source))}-*.parquet"):
            if old != path:
                old.unlink(missing_ok=True)

    def others(self, sources: "set[str]", prune: bool = False) -> int:
        """How many parts are of files that are not among those (their names) any more; they go where `prune` says so."""
        mine = {str(self._place(s) / self._stem(s)) for s in (SourceFile(n, n, n) for n in sources)}
        others = [p for p in self.folder.glob("folder=*/*.parquet") if str(p).rpartition("-")[0] not in mine]
        for path in others if prune else ():
            path.unlink(missing_ok=True)
            if not any(path.parent.iterdir()):
                path.parent.rmdir()
        return len(others)

    def _place(self, source: SourceFile) -> Path:
        return self.folder / f"folder={_named(source.folder)}"

    @staticmethod
    def _stem(source: SourceFile) -> str:
        named = _named(source.name.rpartition("/")[2])
        # Readers of folders of Parquet leave out what begins so.
        named = f"%{ord(named[0]):02X}{named[1:]}" if named[:1] in {"_", "."} else named
        return f"{named}-{hashlib.sha256(source.name.encode(errors='surrogateescape')).hexdigest()[:8]}"


def _may_be_better(table: Any) -> int:
    """How many files could not be read for want of a package or of memory, which may be there the next time."""
    rows = zip(table.column("status").to_pylist(), table.column("message").to_pylist(), strict=True)
    return sum(status == "unreadable" and any(word in (said or "") for word in WANTING) for status, said in rows)


def _named(text: str) -> str:
    """A name for a file system: signs that some of them cannot have as %XX, cut short where it is long.

    A sign of equality would make a partition of its own of it; half a character would be none in any encoding.
    """
    signs = [quote(sign, safe=" ()+,@_-.", errors="backslashreplace") for sign in text]
    told = "".join(signs)
    if len(told) > LONGEST:
        kept = int(np.searchsorted(np.cumsum([len(s) for s in signs]), LONGEST - 9, "right"))
        told = f"{''.join(signs[:kept])}~{hashlib.sha256(told.encode()).hexdigest()[:8]}"
    return told.replace("..", "%2E%2E") if told != "." else told


def _escaped(name: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)


@contextmanager
def opened(folder: str, manifest: Manifest, resume: bool) -> Iterator[Parts]:
    """The folder for these results, ours alone while they are made.

    Raises
    ------
    UsageError: something else stands there, results made with other settings, or somebody is writing into it.
    """
    where = Path(folder)
    try:
        where.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: no folder for results", found=str(error.strerror), do="choose another place") from None
    with _locked(where / LOCK, folder):
        there = _manifest_of(where)
        if there is None:
            foreign = sorted(p.name for p in where.iterdir() if p.name != LOCK and not p.name.startswith(TEMPORARY))
            if foreign:
                parts = any(name.startswith("folder=") for name in foreign)
                raise UsageError(
                    f"{folder}: not a folder of results" + (f": its {MANIFEST} is gone" if parts else ""),
                    found=", ".join(foreign[:5]),
                    do="name an empty or a new one",
                )
        elif there is not None and not resume:
            raise UsageError(
                f"{folder}: holds results already",
                found=f"{there.get('command')} of version {there.get('version')}",
                do="--resume goes on with them; or name another folder",
            )
        elif there is not None:
            _check_same(folder, there, manifest)
        for left in (*where.glob(f"{TEMPORARY}*"), *where.glob(f"folder=*/{TEMPORARY}*")):
            left.unlink(missing_ok=True)
        write_json(str(where / MANIFEST), asdict(manifest), at_once=True)
        yield Parts(folder, manifest, there is not None)


def _manifest_of(where: Path) -> dict[str, Any] | None:
    try:
        told = json.loads((where / MANIFEST).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise UsageError(f"{where / MANIFEST}: cannot be read", found=str(error)[:100], do="name another folder") from None
    if not isinstance(told, dict) or told.get("layout") != LAYOUT:
        found = str(told.get("layout") if isinstance(told, dict) else told)[:40]
        raise UsageError(f"{where}: results of another layout", found=found, allowed=str(LAYOUT), do="name another folder")
    return told


def _check_same(folder: str, there: dict[str, Any], manifest: Manifest) -> None:
    if there.get("command") != manifest.command:
        raise UsageError(f"{folder}: holds results of {there.get('command')}", do="name another folder")
    old, new = there.get("settings") or {}, manifest.settings
    if old == new:
        return
    if there.get("version") != manifest.version:  # which may have told its settings in another way
        found = f"version {there.get('version')}, this is {manifest.version}"
        raise UsageError(f"{folder}: its results are another version's", found=found, do="name another folder")
    names = sorted(set(old) | set(new))
    said = {n: f"--{re.sub('_(s|min)$', '', n).replace('_', '-')}" for n in names}
    differ = [f"{said[n]} {old.get(n, 'not given')}, now {new.get(n, 'not given')}" for n in names if old.get(n) != new.get(n)]
    raise UsageError(
        f"{folder}: its results were made with other settings",
        found="; ".join(differ)[:400],
        do="give the same options, or name another folder",
    )


@contextmanager
def _locked(path: Path, folder: str) -> Iterator[None]:
    """Keeps a second call out of the folder; the lock ends with the process, however that ends."""
    try:
        import fcntl
    except ImportError:  # not there on Windows
        yield
        return
    handle = -1
    try:
        while handle < 0:
            try:
                handle = os.open(path, os.O_CREAT | os.O_RDWR, 0o644)
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise UsageError(f"{folder}: another call is writing there", do="wait for it, or name another folder") from None
            except OSError as error:
                raise UsageError(
                    f"{folder}: cannot be {'written' if handle < 0 else 'locked'}",
                    found=str(error.strerror),
                    allowed="a folder of yours, on a file system with locks",
                    do="choose another place",
                ) from None
            if not _still_there(path, handle):  # a call that ended meanwhile took it away: its lock keeps nobody out
                os.close(handle)
                handle = -1
        try:
            yield
        finally:
            path.unlink(missing_ok=True)
    finally:
        if handle >= 0:
            os.close(handle)


def _still_there(path: Path, handle: int) -> bool:
    """Whether an open file is the one that stands at a path."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
