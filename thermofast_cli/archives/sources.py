"""Which files an archive holds: those named, those of folders, those of patterns."""

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from ..errors import InputError, shown_name
from ..reading.source import content_of
from ..reading_options import Options

#: What is taken from a folder by its suffix; a file that is named is read whatever it is called.
SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".lvm", ".parquet", ".pq", ".xlsx", ".xlsm", ".xls", ".ods", ".tdms", ".mat")
PACKED = (".gz", ".bz2", ".xz", ".zst", ".zip")
WILD = frozenset("*?[")
#: What says that a folder holds results.
MANIFEST = "_thermofast.json"


@dataclass(frozen=True, order=True)
class SourceFile:
    """A file called `path` where it is told of; `name` is its path below the folder that was named, with slashes; `at` where it
    lies, whatever folder a worker stands in.
    """

    name: str
    path: str
    at: str

    @property
    def folder(self) -> str:
        """The folder it lies in, below the one that was named; "." for that one itself."""
        return self.name.rpartition("/")[0] or "."

    def content(self, options: Options) -> tuple[str, bytes]:
        """(hash, bytes) of it.

        Raises
        ------
        InputError: it cannot be read; a folder stands here only where it cannot be looked into.
        """
        if Path(self.at).is_dir():
            raise InputError(f"{self.path}: a folder that cannot be read", found="no permission", do="check its permissions")
        return content_of(self.at, options, self.path)

    def size(self) -> int:
        """Bytes; 0 where it has gone."""
        try:
            return Path(self.at).stat().st_size
        except OSError:
            return 0


def is_pattern(text: str) -> bool:
    """Whether a RUN is a pattern, and not a file that is called so."""
    return bool(WILD & set(text)) and not Path(text).exists()


def named_by(given: Sequence[str]) -> tuple[str, ...]:
    """Files named one by one, those of a pattern (a shell leaves one in quotes as it is) in the order of their names.

    Raises
    ------
    InputError: a pattern that no file matches.
    """
    found: list[str] = []
    for one in given:
        bare = re.sub(r"#\d+$", "", one)  # the second record of a file
        several = sources_of([one]) if is_pattern(one) and is_pattern(bare) else []
        found += [s.path if Path(s.path).is_file() else s.at for s in several] or [one]
    return tuple(found)


def sources_of(given: Sequence[str], aside: str | None = None) -> list[SourceFile]:
    """The files that are meant, each once, in the order of their names; none below the folder `aside`.

    Raises
    ------
    InputError: a pattern or a folder without a file, or a file that is not there.
    """
    found: dict[str, SourceFile] = {}
    results = os.path.realpath(aside) if aside is not None else None
    plain = [Path(g) for g in given if not is_pattern(g) and not Path(g).is_dir()]
    base = Path(os.path.commonpath([p.absolute().parent for p in plain])) if plain else Path()
    for one in given:
        if Path(one).is_dir():
            root = Path(one)
            paths = sorted(p for p, readable in _below(root) if not readable or _is_record(p))
            allowed = f"files of {' '.join(SUFFIXES)}, packed or not"
        elif is_pattern(one):
            root = _fixed(Path(one))
            if not root.exists():
                raise InputError(f"{one}: no folder {root.as_posix()}", do="check the path")
            wanted = Path(one).relative_to(root).parts
            deep = None if "**" in wanted else len(wanted)
            paths = sorted(p for p, readable in _below(root, deep) if not readable or _fits(p.relative_to(root).parts, wanted))
            allowed = "a pattern that some file matches; ** goes through all folders"
        else:
            root, paths, allowed = base, [Path(one)], ""
            if not paths[0].is_file():
                raise InputError(f"{one}: no such file", do="check the path")
        kept = [p for p in paths if results is None or not os.path.realpath(p).startswith(results + os.sep)]
        if not kept:
            if paths:
                where = "lies in the folder for results, which is not read"
                raise InputError(f"{one}: {where}", do="name another folder for them, or one inside it, as -o NAME/results/")
            raise InputError(f"{one}: no file to read", allowed=allowed, do="check the path")
        for path in kept:
            real, at = os.path.realpath(path), str(path.absolute())
            if real in found and at != real:
                continue  # a link to what is read anyway
            name = path.absolute().relative_to(root.absolute()).as_posix()
            found[real] = SourceFile(name, shown_name(str(path)), at)
    return sorted(found.values())


def _below(folder: Path, deep: int | None = None) -> Iterator[tuple[Path, bool]]:
    """The files below a folder, `deep` folders at most, and folders that cannot be read, with whether they can be.

    Links to folders are followed, each folder once, by its own path where it has one here; hidden files and results of earlier
    calls are left out.
    """
    seen, waiting, linked = set[tuple[int, int]](), [(folder, 1)], list[tuple[Path, int]]()
    while waiting or linked:
        here, level = waiting.pop() if waiting else linked.pop()
        try:
            own = here.stat()
            entries = sorted(os.scandir(here), key=lambda e: e.name)
        except OSError:
            yield here, False
            continue
        if (own.st_dev, own.st_ino) in seen or any(e.name == MANIFEST for e in entries):
            continue
        seen.add((own.st_dev, own.st_ino))
        for entry in entries:
            if entry.name.startswith((".", "~$")):  # the latter is what Excel keeps beside a workbook that is open
                continue
            if _is_folder(entry):
                if deep is None or level < deep:
                    (linked if entry.is_symlink() else waiting).append((here / entry.name, level + 1))
            else:
                yield here / entry.name, True


def _is_folder(entry: "os.DirEntry[str]") -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link to itself
        return False


def _fits(parts: Sequence[str], wanted: Sequence[str]) -> bool:
    """Whether a path is of a pattern, in which ** stands for any folders."""
    if not wanted or not parts:
        return not parts and all(w == "**" for w in wanted)
    if wanted[0] == "**":
        return _fits(parts, wanted[1:]) or _fits(parts[1:], wanted)
    return fnmatchcase(parts[0], wanted[0]) and _fits(parts[1:], wanted[1:])


def _is_record(path: Path) -> bool:
    suffixes = [s.lower() for s in path.suffixes[-2:]]
    return bool(suffixes) and (suffixes[-1] in SUFFIXES or (suffixes[-1] in PACKED and suffixes[0] in SUFFIXES))


def _fixed(pattern: Path) -> Path:
    """The folder of a pattern before its first sign."""
    upto = next(i for i, part in enumerate(pattern.parts) if WILD & set(part))
    return Path(*pattern.parts[:upto])
