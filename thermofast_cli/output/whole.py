"""Files whole or not at all: written beside the target, brought to the disk, moved over it; several of one call together."""

import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import UsageError

#: How names of files begin that are not finished.
TEMPORARY = ".thermofast-"


def _umask() -> int:
    """What new files may not be, by default: it can only be read by setting it, which is of the whole process."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


#: Read once, before there are threads that make files.
UMASK = _umask()


@dataclass
class _Together:
    """Files that wait for each other: (what is written, where it goes), and what is said once they stand."""

    waiting: list[tuple[str, str]] = field(default_factory=list)
    then: list[Callable[[], None]] = field(default_factory=list)


_together: ContextVar[_Together | None] = ContextVar("together", default=None)


@contextmanager
def written_together() -> Iterator[None]:
    """Files written inside appear at its end, all or none: what stood at their places stays where one of them cannot be put there.

    Raises
    ------
    UsageError: one of them cannot be put in its place.
    """
    mine = _Together()
    token = _together.set(mine)
    try:
        yield
        _put(mine.waiting)
    finally:
        _together.reset(token)
        for temporary, _ in mine.waiting:
            _gone(temporary)
    for said in mine.then:
        said()


def once_written(said: Callable[[], None]) -> None:
    """Calls that when the files written so far stand at their places."""
    waiting = _together.get()
    if waiting is None:
        said()
    else:
        waiting.then.append(said)


def write_whole(path: str, write: Callable[[str], None], at_once: bool = False) -> None:
    """Runs ``write`` on a temporary name with the same suffix, then moves the file into place, or has it wait for others.

    at_once: it waits for none, and its temporary name ends with .part: whoever reads all of a folder meets no half file.

    Raises
    ------
    UsageError: the file cannot be written; nothing is left behind.
    """
    path = _behind_link(path)
    target = Path(path)
    try:
        handle, temporary = tempfile.mkstemp(prefix=TEMPORARY, suffix=".part" if at_once else target.suffix, dir=target.parent)
    except OSError as error:
        raise _cannot(path, error) from None
    os.close(handle)
    waits = None if at_once else _together.get()
    kept = False
    try:
        write(temporary)
        _to_disk(temporary)
        os.chmod(temporary, stat.S_IMODE(target.stat().st_mode) if target.exists() else 0o666 & ~UMASK)
        if waits is None:
            _put([(temporary, path)])
        else:
            waits.waiting.append((temporary, path))
            kept = True
    except OSError as error:
        raise _cannot(path, error) from None
    finally:
        if not kept:
            _gone(temporary)


def _behind_link(path: str) -> str:
    """The file that a link leads to, which is written in its place; a link to a device or a pipe is taken for a file itself."""
    real = Path(os.path.realpath(path))
    return str(real) if Path(path).is_symlink() and (real.is_file() or not real.exists()) else path


def _put(files: list[tuple[str, str]]) -> None:
    """Moves files to their places; where one cannot be moved, those before it are taken back."""
    moved: list[tuple[str, str | None]] = []
    try:
        for temporary, target in files:
            old = _kept(target) if len(files) > 1 else None
            moved.append((target, old))
            try:
                os.replace(temporary, target)
            except OSError as error:
                moved.pop()
                _gone(old)
                raise _cannot(target, error) from None
    except BaseException:
        for target, old in reversed(moved):
            with suppress(OSError):
                os.unlink(target) if old is None else os.replace(old, target)
        raise
    for _, old in moved:
        _gone(old)
    for folder in {str(Path(target).parent) for _, target in files}:
        with suppress(OSError):
            _to_disk(folder)


def _kept(target: str) -> str | None:
    """Another name for what stands at a place; None where nothing does.

    Raises
    ------
    UsageError: it cannot be kept.
    """
    name = Path(target).with_name(f"{TEMPORARY}{os.getpid()}-{Path(target).name[-100:]}")
    try:
        os.link(target, name)
    except FileNotFoundError:
        return None
    except OSError:
        try:  # a file system without links
            import shutil

            shutil.copy2(target, name)
        except FileNotFoundError:
            return None
        except OSError as error:
            _gone(str(name))
            raise _cannot(target, error) from None
    return str(name)


def _to_disk(path: str) -> None:
    """Waits until a file, or what a folder says of its files, is on the disk; Windows asks for a file that may be written."""
    handle = os.open(path, os.O_RDONLY if Path(path).is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _gone(path: str | None) -> None:
    if path is not None:
        with suppress(OSError):
            os.unlink(path)


def _cannot(path: str, error: OSError) -> UsageError:
    return UsageError(f"{path}: cannot be written", found=str(error.strerror or error), do="choose another place")
