"""A file, or standard input, that a logger is still writing: what is whole of it so far, whatever the logger does to it."""

import os
import stat
import threading
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError

#: Bytes at the beginning and before the place read last that tell whether what was read is still there.
HEAD, TAIL = 4096, 256
UTF16 = b"\xff\xfe"


class Follower:
    """Bytes of a growing file. A logger may pause, rotate, truncate, write the whole file again, and die in mid-line.

    Where a file is begun anew what was read stays, and the new lines come after it, without its heading where that is the same:
    the reader of records finds out by the time column whether the run goes on or another has begun.
    """

    def __init__(self, path: str) -> None:
        self.path = Path(path)
        self.before = b""  # of files that are gone
        self.now = b""  # of the file that is there
        self.notes: list[str] = []
        self._inode = 0

    def poll(self) -> bytes | None:
        """All whole lines so far; None where there are no new ones since the last call.

        Raises
        ------
        InputError: it is a folder, or may not be read.
        """
        try:
            with self.path.open("rb") as file:
                return self._read(file)
        except FileNotFoundError:
            return None
        except IsADirectoryError:
            raise InputError(f"{self.path}: a folder", allowed="a file that a logger writes") from None
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read", found=str(error.strerror), do="check the permissions") from None

    def rest(self) -> bytes:
        """All that was ever there, the last line whether or not it has an end.

        For the end of a watch: nobody goes on writing that line.
        """
        self.poll()
        with suppress(OSError), self.path.open("rb") as file:
            file.seek(len(self.now))
            open_ = file.read()
            if open_.strip() and self.now and self._same(file, os.fstat(file.fileno()).st_size):
                return self.text + open_
        return self.text

    def _read(self, file: BinaryIO) -> bytes | None:
        told = os.fstat(file.fileno())
        size = len(self.now)
        if self._inode and told.st_ino != self._inode and not self._same(file, told.st_size):
            self._anew("another file is there now (rotated)")
        elif told.st_size < size:
            self._anew("the file was truncated")
        elif size and not self._same(file, told.st_size):
            self.notes.append("the file was written again")
            self.now = b""
        self._inode = told.st_ino
        at = len(self.now)
        file.seek(at)
        more = whole_lines(file.read(), self.now[:2] or None)
        if not more:
            return None
        self.now += more
        return self.text

    @property
    def text(self) -> bytes:
        """All whole lines so far."""
        if not self.before:
            return self.now
        return self.before + self.now[_same_heading(self.before, self.now) :]

    def _anew(self, why: str) -> None:
        self.notes.append(why)
        self.before, self.now = self.text, b""

    def _same(self, file: BinaryIO, size: int) -> bool:
        """Whether the file still begins with what was read."""
        read = len(self.now)
        if size < read:
            return False
        file.seek(0)
        head = file.read(min(HEAD, read))
        file.seek(max(0, read - TAIL))
        return self.now.startswith(head) and self.now[max(0, read - TAIL) :] == file.read(min(TAIL, read))


def is_stream(path: str) -> bool:
    """Whether a path is no file but a pipe or a device, of which what was read is gone: /dev/stdin, <(ssh logger cat)."""
    try:
        mode = Path(path).stat().st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or stat.S_ISSOCK(mode)


class Piped:
    """Bytes of standard input or a pipe, read as they come by a thread of their own."""

    def __init__(self, source: BinaryIO | Path) -> None:
        self.ended = False
        self.notes: list[str] = []
        self._held = b""
        self._told = 0
        self._lock = threading.Lock()
        self._error: OSError | None = None
        threading.Thread(target=self._pump, args=(source,), daemon=True).start()

    def _pump(self, source: BinaryIO | Path) -> None:
        try:
            # A named pipe is opened only when somebody writes to it: who waits for that is this thread.
            with source.open("rb", buffering=0) if isinstance(source, Path) else nullcontext(source) as stream:
                while chunk := os.read(stream.fileno(), 1 << 16):
                    with self._lock:
                        self._held += chunk
        except OSError as error:
            self._error = error
        finally:
            with self._lock:
                self.ended = True

    def poll(self) -> bytes | None:
        """All whole lines so far, and at the end all there is; None where there are no new ones since the last call.

        Raises
        ------
        InputError: it cannot be read.
        """
        if self._error is not None and not self._held:
            raise InputError("the input cannot be read", found=str(self._error.strerror), do="check the permissions")
        whole = self.text
        if len(whole) <= self._told:
            return None
        self._told = len(whole)
        return whole

    @property
    def text(self) -> bytes:
        """All whole lines so far, and at the end all there is."""
        with self._lock:
            ended, held = self.ended, self._held
        return held if ended else whole_lines(held, held[:2])


def _same_heading(before: bytes, now: bytes) -> int:
    """How many bytes of whole lines two files have alike at their beginning: the heading, in front of readings of other times."""
    at = 0
    for ours, theirs in zip(before[:HEAD].splitlines(keepends=True), now[:HEAD].splitlines(keepends=True), strict=False):
        if ours != theirs:
            break
        at += len(theirs)
    return at


def whole_lines(data: bytes, begin: bytes | None) -> bytes:
    """Up to the last end of a line; `begin` are the first bytes of the file, which tell its width of letters."""
    wide = (begin or data[:2]) == UTF16
    end = b"\n\x00" if wide else b"\n"
    place = data.rfind(end)
    return data[: place + len(end)] if place >= 0 else b""
