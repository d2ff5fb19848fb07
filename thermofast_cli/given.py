"""What the library's functions are given, checked and made ready: runs, processes, models."""

import functools
import inspect
import multiprocessing
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

import numpy as np

from .errors import ThermofastError, UsageError, nearest
from .reading import Run, read_runs
from .reading_options import SPOKEN, Options, options_from
from .workers.engine import Started, Work, with_start
from .workers.threads import one_thread

if TYPE_CHECKING:
    from .machine.model import Model

#: A run, a path (``file.csv#2``: its second run), a DataFrame, an Arrow table or a mapping of names to arrays; or a list of them.
Source = Any
Start = float | Literal["auto"]
#: Sensors up to which details for pictures are kept where it is left to the library.
DETAILS_UP_TO = 100


P = ParamSpec("P")
R = TypeVar("R")


def _texts(value: Any) -> Any:
    """Names as :func:`~.reading_options.names` takes them: a text, or a tuple of texts; None where they are none."""
    if isinstance(value, str):
        return value
    if not isinstance(value, Iterable) or isinstance(value, Mapping | bytes):
        return None
    found = tuple(os.fspath(v) if isinstance(v, os.PathLike) else v for v in value)
    return found if all(isinstance(v, str) for v in found) else None


def _count(value: Any) -> Any:
    return value if isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= 1 else None


def _minutes(value: Any) -> Any:
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    return value if number or (isinstance(value, str) and value == "auto") else None


def _pair(value: Any) -> Any:
    return tuple(value) if isinstance(value, list | tuple) and len(value) == 2 and all(isinstance(v, int) for v in value) else None


def _model(value: Any) -> Any:
    from .machine.model import Model

    return os.fspath(value) if isinstance(value, os.PathLike) else value if isinstance(value, str | Model) else None


#: What an argument of a name may be, wherever it occurs: (what of it is used, None where it is wrong; what is allowed).
KINDS: dict[str, tuple[Callable[[Any], Any], str]] = {
    **dict.fromkeys(
        ("drive", "preset", "pace", "name", "rates", "replay", "cluster", "command"),
        (lambda v: v if isinstance(v, str) else None, "a text"),
    ),
    **dict.fromkeys(("effects", "extra", "add", "columns", "methods", "uniform"), (_texts, "names, as 'a,b' or a list")),
    **dict.fromkeys(
        (
            "auto",
            "joint",
            "together",
            "next_experiment",
            "unknown_heat",
            "denoise",
            "cooling",
            "leave",
            "details",
            "resume",
            "prune",
            "shared_files",
        ),
        (lambda v: v if isinstance(v, bool | np.bool_) else None, "True or False"),
    ),
    **dict.fromkeys(
        ("settings", "input_range", "sizes"), (lambda v: v if isinstance(v, Mapping) else None, "a mapping of names to values")
    ),
    **dict.fromkeys(("progress", "told"), (lambda v: v if callable(v) else None, "a function")),
    "into": (lambda v: os.fspath(v) if isinstance(v, str | os.PathLike) else None, "a folder"),
    "model": (_model, "a learnt model, as tf.Model.load gives it, or its file"),
    "start": (_minutes, "minutes, or 'auto'"),
    "sources": (
        lambda v: os.fspath(v) if isinstance(v, str | os.PathLike) else _texts(v) if isinstance(v, list | tuple | set) else None,
        "a path or pattern, or a list of them",
    ),
    "jobs": (_count, "a whole number above zero, or None for all cores"),
    "executor": (lambda v: v if callable(getattr(v, "submit", None)) else None, "a concurrent.futures.Executor"),
    "task_timeout": (lambda v: v if isinstance(v, int | float) and not isinstance(v, bool) and v > 0 else None, "seconds above 0"),
    "order": (_pair, "two whole numbers"),
    "imperfection": (lambda v: os.fspath(v) if isinstance(v, os.PathLike) else v, "'typical', 'none', a file or a prior"),
}
#: Options of the commands that functions call otherwise.
OPTIONS = {
    "set": "settings",
    "effect": "extra",
    "next": "next_experiment",
    "exit": "leave",
    "trace": "details",
    "output": "into",
    "displacements": "columns",
    "past": "model",
}
#: For which None has a meaning, whatever they are by default, or is told of elsewhere.
MAY_BE_NONE = frozenset({"jobs", "runs", "run", "source"})


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, with its arguments looked at before any work is done.

    Raises
    ------
    UsageError: an argument is of a kind that it cannot be.
    """
    signature = inspect.signature(function)
    own = [n for n, p in signature.parameters.items() if p.kind is not inspect.Parameter.VAR_KEYWORD]
    more = [n for n in signature.parameters if n not in own]
    known = [*own, *([f.name for f in fields(Options)] if more == ["reading"] else []), "interval"]

    @functools.wraps(function)
    def after_a_look(*args: P.args, **kwargs: P.kwargs) -> R:
        for name in kwargs:
            if name not in known and more in ([], ["reading"]):
                here = OPTIONS.get(name)
                hint = f"it is called {here!r}" if here in known else nearest(name, known) or "see docs/api.md"
                raise UsageError(f"tf.{function.__name__} has no argument {name!r}", allowed=", ".join(known), do=hint)
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError as error:
            raise UsageError(
                f"tf.{function.__name__}: {error}", allowed=f"{function.__name__}{signature}", do="name each"
            ) from None
        for name, value in bound.arguments.items():
            default = signature.parameters[name].default
            if value is None:
                if default is not None and name not in MAY_BE_NONE:
                    usual = "" if default is inspect.Parameter.empty else f"; left out it is {default!r}"
                    raise UsageError(f"{name}: None", allowed=f"a value{usual}")
            elif name in KINDS:
                used, allowed = KINDS[name][0](value), KINDS[name][1]
                if used is None:
                    raise UsageError(f"{name}: not understood", found=repr(value)[:60], allowed=allowed)
                bound.arguments[name] = used
        try:
            with one_thread(), np.errstate(divide="warn", over="warn", invalid="warn", under="ignore"):  # whatever the caller set
                return function(*bound.args, **bound.kwargs)
        except ThermofastError as error:
            raise _as_called(error, {n: p.default for n, p in signature.parameters.items()}) from None

    return after_a_look


def _as_called(error: ThermofastError, mine: Mapping[str, Any]) -> ThermofastError:
    """The error with a command's options under the names that a function has for them: ``--drive 'rpm'`` as ``drive='rpm'``."""
    known = {f.name: f.default for f in fields(Options)} | {"interval": None} | dict(mine)
    spoken = {told: name for name, told in SPOKEN.items() if name != "interval_s"} | {"set": "settings"}

    def name_of(found: "re.Match[str]") -> str:
        name = found[1].replace("-", "_")
        name = spoken.get(name, name)
        if name not in known:
            return found[0]
        if known[name] is False:
            return f"{name}=True"
        if found[3]:
            return f"{name}={found[3].strip()!r}"
        # A value that stands behind it is given as one: drive='power'.
        return f"{name}=" if found[2] else name

    # A command line that a message gives stays one.
    texts = {part: getattr(error, part) for part in ("what", "found", "allowed", "do")}
    said = {part: text if "thermofast " in text else _OPTION.sub(name_of, text) for part, text in texts.items()}
    return type(error)(said.pop("what"), **said)


#: An option in a message, and the blank before a value in quotes, in capitals or in digits; or a word that confirms a guess.
_OPTION = re.compile(r"--([a-z][a-z0-9-]*[a-z0-9])(?:( (?=['\"A-Z0-9-]))|( [a-z_]+)(?= confirms it))?")


#: In place of runs: options are checked, and nothing is done.
NOTHING = object()


def started_of(runs: Source, start: Start, from_rise: bool, reading: Mapping[str, Any], taken: Sequence[str] = ()) -> list[Started]:
    """Runs with their starts [min]; those that are read already stay as they are. taken: names that others have."""
    if runs is NOTHING:
        return []
    if start != "auto":
        in_range(start=start)
    several = runs if isinstance(runs, list | tuple) else [runs]
    found: list[Run] = []
    for one in several:
        if isinstance(one, Run):
            if reading:
                raise UsageError(f"{one.name}: read already", found=", ".join(reading), do="give the options of reading to tf.read")
            found.append(one)
        else:
            of_one = read_runs(one, options_from(dict(reading)), None)
            if not isinstance(one, str | Path) and any(r.name in (*taken, *(run.name for run in found)) for r in of_one):
                place = len(taken) + len(found) + 1
                of_one = [replace(r, name=f"{r.name} {place}") for r in of_one]  # of several frames none has a name
            found += of_one
    if not found:
        raise UsageError(
            "no run given", allowed="a run, a path, a DataFrame, an Arrow table, a mapping of arrays, or a list of them"
        )
    names = [run.name for run in found]
    if len(set(names)) < len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise UsageError(f"two runs are called {twice!r}", do="give each its own: tf.read(..., name='warm up')")
    return [with_start(run, None if start == "auto" else float(start), from_rise) for run in found]


def work_of(jobs: int | None, executor: Executor | None, progress: Callable[[int], None] | None) -> Work:
    """Who works, and who hears of it; a process of a pool, which may have none of its own, works alone."""
    jobs = 1 if multiprocessing.current_process().daemon else jobs
    return Work(jobs, executor, progress or (lambda _steps: None))


def keeps_details(details: bool | None, started: Sequence[Started]) -> bool:
    """Whether curves and traces are kept: as asked, or where there are few sensors."""
    return details if details is not None else sum(len(run.channels) for run, _ in started) <= DETAILS_UP_TO


def setting_texts(name: str, settings: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Settings of a filter as the command line has them; one in a file is called by the name that it gives itself."""
    if settings and isinstance(name, str):
        from .plugins.files import is_file
        from .plugins.filters import load_filter

        name = load_filter(name).name if is_file(name) else name
    if strange := [key for key in settings or {} if not isinstance(key, str)]:
        raise UsageError("a setting is called by its name", found=repr(strange[0]), allowed="text, as in {'growth': 2.0}")
    bare = {key.removeprefix(f"{name}."): value for key, value in (settings or {}).items()}
    return tuple(f"{name}.{key}={str(value).lower()}" for key, value in bare.items())


def model_of(model: "Model | str | Path | None", extra: Sequence[str] = ()) -> "Model | None":
    """A learnt model, read where it is a path; extra as in :meth:`Model.load`."""
    if model is None:
        return None
    from .machine.model import Model

    return Model.load(model, extra)


#: What numbers may be, as the command's options have it.
RANGES: dict[str, tuple[float, float]] = {
    "until": (1e-9, 1e7),
    "at": (1e-9, 1e7),
    "room": (-100.0, 500.0),
    "limit": (-100.0, 5000.0),
    "switch_off_at": (-1e7, 1e7),
    "start": (-1e7, 1e7),
    "false_alarm": (1e-300, 0.5),
    "tolerance": (1e-9, 1e7),
    "poll": (0.05, 3600.0),
    "give_up": (1e-9, 1e9),
    "duration": (1e-9, 1e9),
    "interval": (1e-9, 1e9),
    "ambient": (-100.0, 500.0),
    "rise": (1e-9, 1e7),
    "t95": (1e-9, 1e9),
    "noise": (0.0, 1e7),
    "step": (0.0, 1e7),
    "seed": (0, 2**63),
    "sensors": (1, 100_000),
    "offset": (0.0, 1e7),
    "jitter": (0.0, 1e7),
}
#: In which unit they are.
UNITS = {
    **dict.fromkeys(("until", "at", "switch_off_at", "start", "give_up", "duration", "t95"), "min"),
    **dict.fromkeys(("room", "limit", "ambient"), "degC"),
    **dict.fromkeys(("rise", "noise", "step", "tolerance", "offset"), "K"),
    "poll": "s",
    "interval": "s",
}
#: Those of them that count.
WHOLE = frozenset({"seed", "sensors"})


def in_range(ranges: Mapping[str, tuple[float, float]] = RANGES, /, **numbers: float | None) -> list[float | None]:
    """The numbers, those that do not count as floats; None stays.

    Raises
    ------
    UsageError: one is no number, or outside what the command's option takes.
    """
    for name, value in numbers.items():
        low, high = ranges[name]
        kinds = (int, np.integer) if name in WHOLE else (int, float, np.number)
        number = isinstance(value, kinds) and not isinstance(value, bool)
        if value is not None and not (number and low <= float(value) <= high):
            whole = "a whole number, " if name in WHOLE else ""
            unit = f" {UNITS[name]}" if name in UNITS else ""
            raise UsageError(f"{name}: not a number in its range", found=repr(value), allowed=f"{whole}{low:g} to {high:g}{unit}")
    return [value if value is None or name in WHOLE else float(value) for name, value in numbers.items()]
