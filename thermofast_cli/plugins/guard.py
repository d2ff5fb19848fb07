"""The one place where foreign code is called: what it raises is told with its line, and it may not run for ever."""

import inspect
import os
import re
import signal
import threading
import time
import traceback
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from thermofast.models import Observations
from thermofast.models.drive import Drive

from ..errors import NeedError, ThermofastError, nearest
from .aside import printing_aside

#: Seconds after which foreign code is taken to loop for ever.
PATIENCE_S = 10.0
#: In how many seconds a caller's timer rings that would have rung meanwhile.
OVERDUE_S = 1e-3
#: What a filter may take for each reading beside [s].
PATIENCE_EACH_S = 0.01


class PluginError(ThermofastError):
    """Foreign code that cannot be imported, raised, took too long or returned nonsense; it names the file and the line."""


class PluginTimeoutError(PluginError):
    """Foreign code that did not come back: to call it another way would take as long once more."""


def failed_status(error: ThermofastError) -> str:
    """The status of a run that an error ended: it cannot be read, or what was asked for cannot be done with it."""
    return "failed" if isinstance(error, PluginError | NeedError) else "unreadable"


@contextmanager
def watched(member: Any, what: str) -> Any:
    """Turns whatever a plug-in raises into a :class:`PluginError` that names its line; `what` is it in words, as ``effect 'x'``."""
    file = source_of(member)
    try:
        with alarm(f"{what} ({file})", file=file), contained():
            yield
    except (PluginError, KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException as error:
        do = advice(error, what.startswith("effect"))
        raise PluginError(f"{what} raised {type(error).__name__}", found=where(error, file), do=do) from None


@contextmanager
def contained() -> Any:
    """Keeps to itself what a call of foreign code changes of the process: where it prints, numpy's errors."""
    with printing_aside(), np.errstate(all="ignore"):
        yield


@contextmanager
def imported() -> Any:
    """The same while foreign code is imported, with the folder that one works in: a look at that costs more than a call may."""
    try:
        folder = Path.cwd()
    except OSError:  # it was taken away
        folder = None
    try:
        with contained():
            yield
    finally:
        if folder is not None:
            os.chdir(folder)


@contextmanager
def alarm(what: str, patience_s: float | None = None, file: str = "") -> Any:
    """PluginTimeoutError after so many seconds (PATIENCE_S), where the system can: not on Windows, not outside the main thread.

    `file` is that of the foreign code, whose line is told. A timer that the caller had set goes on afterwards.
    """
    patience_s = PATIENCE_S if patience_s is None else patience_s
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def ring(*_: Any) -> None:
        mine = [f.lineno for f in traceback.extract_stack() if file and Path(f.filename).name == Path(file).name]
        line = f"line {mine[-1]} of {file}" if mine else ""
        raise PluginTimeoutError(f"{what}: did not come back within {patience_s:g} s", found=line, do="look for a loop without end")

    before = signal.signal(signal.SIGALRM, ring)
    left_s, every_s = signal.setitimer(signal.ITIMER_REAL, patience_s)
    begun_s = time.monotonic()
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if left_s:
            signal.setitimer(signal.ITIMER_REAL, max(left_s - (time.monotonic() - begun_s), OVERDUE_S), every_s)


def where(error: BaseException, file: str) -> str:
    """'line 12: message', the line in the user's file where it can be told."""
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).name == Path(file).name]
    place = f"{Path(file).name}, line {lines[-1]}: " if lines else f"{Path(file).name}: "
    if isinstance(error, SyntaxError) and error.lineno:
        place = f"{Path(file).name}, line {error.lineno}: "
    return f"{place}{type(error).__name__}: {said_by(error)}"


def said_by(error: BaseException) -> str:
    """The text of an exception in one line, also of one whose text raises itself."""
    try:
        return " ".join(str(error).split())
    except Exception:  # whatever a stranger's __str__ does
        return "(no text)"


def source_of(member: Any) -> str:
    """The file in which a plug-in's own class is written."""
    for kind in type(member).__mro__ if not isinstance(member, type) else member.__mro__:
        try:
            file = inspect.getsourcefile(kind)
        except (TypeError, OSError):
            continue
        if file and not kind.__dict__.get("__guard__", False):
            return file
    return "?"


def misspelt(kind: type, base: type) -> str:
    """What a class of a user seems to have meant by an attribute that no base of it has; empty where nothing looks so."""
    known = [n for n in dir(base) if not n.startswith("_")]
    known += [n for parent in kind.__mro__[1:] if issubclass(parent, base) for n in vars(parent) if not n.startswith("_")]
    for name in vars(kind):
        if not name.startswith("_") and name not in known and (near := get_close_matches(name, known, 1, 0.8)):
            return f"it has {name!r}, which nothing reads: did you mean {near[0]!r}?"
    return ""


def advice(error: BaseException, of_effect: bool) -> str:
    """What to write instead, where that can be told: the nearest attribute of what was misspelt."""
    if isinstance(error, KeyError) and of_effect:
        return (
            f"not every record has a column {error}: offer it in choices(self, run), as in "
            "[Choice(name, {'column': name}) for name in run.inputs]"
        )
    if isinstance(error, TypeError) and "'Field'" in str(error):
        return "its settings are not made yet: write @dataclass(frozen=True) above the class"
    # A number, or an array, added to an empty list.
    if (isinstance(error, TypeError) and "to list" in said_by(error)) or (
        isinstance(error, ValueError) and "shapes (0,)" in str(error)
    ):
        return "drive.hidden and drive.links are lists: write drive.hidden.append((coupling, rate))"
    if isinstance(error, ValueError) and "read-only" in str(error):
        new = "drive.heat = drive.heat * p.x" if of_effect else "reading = reading - reading[0]"
        return f"others use these numbers, too: make new ones, as in {new}, in place of *= or [...] ="
    found = re.search(r"'(\w+)' object has no attribute '(\w+)'", said_by(error))
    if found and found.group(1, 2) == ("Drive", "hidden_rate"):
        return "a hidden mass is a pair: write drive.hidden.append((coupling, rate))"
    if not isinstance(error, AttributeError) or not found:
        return ""
    owner = getattr(error, "obj", None) or {"Drive": Drive, "Observations": Observations}.get(found.group(1))
    known = [n for n in dir(owner) if not n.startswith("_")] if owner is not None else []
    return nearest(found.group(2), known) or (f"{found.group(1)} has {', '.join(known[:20])}" if known else "")
