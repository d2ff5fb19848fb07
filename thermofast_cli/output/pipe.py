"""Output whose reader may go, as ``| head`` does: the work goes on, files are written, and the exit code is that of the work."""

import codecs
import io
import os
import sys
from typing import Any, TextIO, cast

#: What a terminal without lines and signs is given in their place; what else it lacks is written as an escape.
PLAIN = {"─": "-", "━": "-", "│": "|", "┃": "|", "±": "+/-", "°": "deg", "…": "...", "–": "-", "→": "->"}
PLAIN |= dict.fromkeys("┌┐└┘├┤┬┴┼╭╮╰╯╞╡╪", "+")


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Of a text that its stream cannot write, what it can: see :func:`codecs.register_error`."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(PLAIN.get(c) or c.encode("ascii", "backslashreplace").decode() for c in lacking), error.end


codecs.register_error("thermofast_plain", _plain)


class Kept:
    """A text stream that says nothing more once nobody reads it; all else is the stream's own."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    @classmethod
    def of(cls, stream: "TextIO | None") -> Any:
        """The stream so; None where there is none."""
        return None if stream is None else stream if isinstance(stream, cls) else cls(stream)

    def write(self, text: str) -> int:
        """As the stream writes it, or into nothing."""
        try:
            return self._stream.write(text)
        except BrokenPipeError:
            self._leave()
            return len(text)

    def flush(self) -> None:
        """What waits, as far as somebody reads it."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._leave()

    def end(self) -> None:
        """What waits, written; an error is told once, and not again at the end of the interpreter.

        Raises
        ------
        OSError: there is no room for it.
        """
        try:
            self.flush()
        except OSError:
            self._leave()
            raise

    def _leave(self) -> None:
        """What waits and what comes goes into nothing, also at the end of the interpreter."""
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, self._stream.fileno())
        os.close(nothing)

    def __getattr__(self, name: str) -> Any:
        return getattr(cast(Any, self._stream), name)


def whole(stream: TextIO) -> TextIO:
    """The stream, with a buffer where Python was told to have none: of what a full disk takes in part it would not say so."""
    raw = getattr(stream, "buffer", None)
    if not isinstance(raw, io.RawIOBase):
        return stream
    buffered = io.BufferedWriter(raw)
    return io.TextIOWrapper(buffered, encoding=stream.encoding, errors=stream.errors, line_buffering=True)


def without_lines() -> None:
    """Lets a degree sign, or the lines of a table, end no work on a terminal that cannot show them."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="thermofast_plain")


def with_streams() -> None:
    """Gives a process without standard output or error, as a daemon's, one that leads nowhere: else what is said there would go
    into the next file that is opened.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDONLY if name == "stdin" else os.O_WRONLY)
            setattr(sys, name, os.fdopen(nowhere, "r" if name == "stdin" else "w", encoding="utf-8"))
