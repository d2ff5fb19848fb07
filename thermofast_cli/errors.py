"""One family of exceptions; only ``main`` turns them into an exit code."""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from functools import partial
from typing import Any

#: What a terminal obeys or what turns a line about, and bytes of a name that are no text.
_UNSHOWN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")


class ThermofastError(Exception):
    """Bad usage or input: what, found, allowed, next step."""

    def __init__(self, what: str, *, found: str = "", allowed: str = "", do: str = "") -> None:
        self.what, self.found, self.allowed, self.do = what, found, allowed, do
        parts = [what, found and f"found: {found}", allowed and f"allowed: {allowed}", do and f"do: {do}"]
        super().__init__("\n  ".join(p for p in parts if p))

    def __reduce__(self) -> Any:
        """Across processes with its parts."""
        return partial(type(self), found=self.found, allowed=self.allowed, do=self.do), (self.what,)


class InputError(ThermofastError):
    """A file that cannot be read as a record."""


class UsageError(ThermofastError):
    """An option or a setting that cannot be used."""


class NeedError(UsageError):
    """What was asked for needs something that a readable run does not log."""


class TooShortError(UsageError):
    """A record that ends before the time up to which it is to be read."""


def in_one_line(error: Exception) -> str:
    """What an error says in one line, its parts set apart: what; found: x; do: y."""
    return " ".join("; ".join(line.strip() for line in str(error).splitlines() if line.strip()).split())


def visible(text: str) -> str:
    """A text from outside as it may be shown: control characters and bytes that are no text by their number."""
    return _UNSHOWN.sub(_escaped, text)


def shown_name(name: str) -> str:
    """The name of a file or a column as it may be shown, in one line."""
    return visible(name).replace("\n", "\\n").replace("\t", " ")


def _escaped(found: re.Match[str]) -> str:
    code = ord(found[0])
    # 0xdc80 to 0xdcff stand for the bytes of a file's name that are no UTF-8.
    code = code - 0xDC00 if 0xDC80 <= code <= 0xDCFF else code
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def rounded(value: float, digits: int = 2) -> str:
    """A number in a sentence, of so many significant digits and without powers of ten where it is large: 110, not 1.1e+02."""
    return f"{float(f'{value:.{digits}g}'):.15g}" if 1.0 <= abs(value) < 1e15 else f"{value:.{digits}g}"


def listed(names: Iterable[str], most: int = 12) -> str:
    """Names in a row, shortened where there are many."""
    names = list(names)
    shown = ", ".join(names[:most])
    return f"{shown}, ... ({len(names)} in all)" if len(names) > most else shown


def nearest(name: str, known: Iterable[str]) -> str:
    """``did you mean 'x'?`` for the known name that is most alike; empty where none is."""
    near = get_close_matches(name, list(known), 1, 0.6)
    return f"did you mean {near[0]!r}?" if near else ""
