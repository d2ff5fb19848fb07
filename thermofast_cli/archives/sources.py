"""Which files an archive holds: those named, those of folders, those of patterns."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError, shown_name

#: What is taken from a folder by its suffix; a file that is named is read whatever it is called.
SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".lvm", ".parquet", ".pq", ".xlsx", ".xlsm", ".xls", ".ods", ".tdms", ".mat")
PACKED = (".gz", ".bz2", ".xz", ".zst", ".zip")
WILD = frozenset("*?[")


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

    def size(self) -> int:
        """Bytes; 0 where it has gone."""
        try:
            return Path(self.at).stat().st_size
        except OSError:
            return 0


def is_pattern(text: str) -> bool:
    """Whether a RUN is a pattern, and not a file that is called so."""
    return bool(WILD & set(text)) and not Path(text).exists()


def sources_of(given: Sequence[str], aside: str | None = None) -> list[SourceFile]:
    """The files that are meant, each once, in the order of their names; none below the folder `aside`.

    Raises
    ------
    InputError: a pattern or a folder without a file, or a file that is not there.
    """
    found: dict[Path, SourceFile] = {}
    results = Path(aside).resolve() if aside is not None else None
    plain = [Path(g) for g in given if not is_pattern(g) and not Path(g).is_dir()]
    base = Path(os.path.commonpath([p.absolute().parent for p in plain])) if plain else Path()
    for one in given:
        if Path(one).is_dir():
            root, paths = Path(one), sorted(p for p in _below(Path(one)) if _is_record(p))
            allowed = f"files of {' '.join(SUFFIXES)}, packed or not"
        elif is_pattern(one):
            root = _fixed(Path(one))
            paths = sorted(p for p in root.glob(str(Path(one).relative_to(root))) if p.is_file())
            allowed = "a pattern that some file matches; ** goes through all folders"
        else:
            root, paths, allowed = base, [Path(one)], ""
            if not paths[0].is_file():
                raise InputError(f"{one}: no such file", do="check the path")
        kept = [p for p in paths if results is None or results not in p.resolve().parents]
        if not kept:
            raise InputError(
                f"{one}: no file to read", found="results alone" if paths else "", allowed=allowed, do="check the path"
            )
        for path in kept:
            name = path.absolute().relative_to(root.absolute()).as_posix()
            found.setdefault(path.resolve(), SourceFile(name, shown_name(str(path)), str(path.absolute())))
    return sorted(found.values())


def _below(folder: Path) -> Iterator[Path]:
    return (Path(where) / name for where, _, names in os.walk(folder) for name in names if not name.startswith("."))


def _is_record(path: Path) -> bool:
    suffixes = [s.lower() for s in path.suffixes[-2:]]
    return bool(suffixes) and (suffixes[-1] in SUFFIXES or (suffixes[-1] in PACKED and suffixes[0] in SUFFIXES))


def _fixed(pattern: Path) -> Path:
    """The folder of a pattern before its first sign."""
    upto = next(i for i, part in enumerate(pattern.parts) if WILD & set(part))
    return Path(*pattern.parts[:upto])
