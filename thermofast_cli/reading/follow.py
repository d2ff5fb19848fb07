"""A file, or standard input, that a logger is still writing: what is whole of it so far, whatever the logger does to it."""

import os
import stat
import threading
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError
from .tables.packed import MAGIC, OLD_WORKBOOK

#: Bytes at the beginning and before the place read last that tell whether what was read is still there.
HEAD, TAIL = 4096, 256
UTF16 = b"\xff\xfe"
#: First bytes of what does not grow by lines, and what it is.
FINISHED = {magic: f"a {kind} archive" for magic, kind in MAGIC.items() if kind != "zip"}
FINISHED |= {b"PK\x03\x04": "a zip archive or a workbook", OLD_WORKBOOK: "a workbook", b"PAR1": "Parquet"}


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
        self._held: BinaryIO | None = None  # the file as it was opened last, whatever it is called now

    def __del__(self) -> None:
        if self._held is not None:
            self._held.close()

    def poll(self) -> bytes | None:
        """All whole lines so far; None where there are no new ones since the last call.

        Raises
        ------
        InputError: it is a folder, or may not be read, or no text.
        """
        try:
            file = self.path.open("rb")
            try:
                return self._read(file)
            finally:
                self._hold(file)
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
            self._finish()
            self._anew("another file is there now (rotated)")
        elif told.st_size < size:
            self._anew("the file was truncated: what it was given since it was last looked at is lost")
        elif size and not self._same(file, told.st_size):
            self.notes.append("the file was written again")
            self.now = b""
        self._inode = told.st_ino
        at = len(self.now)
        if at == 0:
            self._refuse_finished(file)
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

    def _hold(self, file: BinaryIO) -> None:
        """Keeps the file open until the next look: where it is given another name, its last lines can still be read."""
        old, self._held = self._held, file
        if os.name != "posix":  # there nobody could rename or remove it
            old, self._held = file, None
        if old is not None:
            old.close()

    def _finish(self) -> None:
        """Reads what came to the file that has gone after it was last looked at."""
        if self._held is not None:
            self._held.seek(len(self.now))
            self.now += whole_lines(self._held.read(), self.now[:2] or None)

    def _refuse_finished(self, file: BinaryIO) -> None:
        """Raise InputError at a file that is written whole: an archive, a workbook, Parquet."""
        file.seek(0)
        head = file.read(8)
        kind = next((kind for magic, kind in FINISHED.items() if head.startswith(magic)), None)
        if kind is not None:
            raise InputError(
                f"{self.path}: cannot be followed",
                found=f"{kind}, which is written whole",
                allowed="the text that a logger writes, line by line",
                do="--replay 600 plays a record that has ended",
            )

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
    first = begin or data[:2]
    # Without a mark, too: no text begins with a letter and a byte of nothing but one of two bytes a letter.
    wide = first == UTF16 or (first[:1] != b"\x00" and first[1:2] == b"\x00")
    end = b"\n\x00" if wide else b"\n"
    if not wide and b"\n" not in data and data.count(b"\r") > 1:
        end = b"\r"  # as old instruments end them; of the usual two letters one stands between two of the other
    place = data.rfind(end)
    return data[: place + len(end)] if place >= 0 else b""
