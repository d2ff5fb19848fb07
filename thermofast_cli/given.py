"""What the library's functions are given, checked and made ready: runs, processes, models."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .errors import UsageError
from .reading import Run, read_runs
from .reading_options import options_from
from .workers.engine import Started, Work, with_start

if TYPE_CHECKING:
    from .machine.model import Model

#: A run, a path (``file.csv#2``: its second run), a DataFrame, an Arrow table or a mapping of names to arrays; or a list of them.
Source = Any
Start = float | Literal["auto"]
#: Sensors up to which details for pictures are kept where it is left to the library.
DETAILS_UP_TO = 100


#: In place of runs: options are checked, and nothing is done.
NOTHING = object()


def started_of(runs: Source, start: Start, from_rise: bool, reading: Mapping[str, Any]) -> list[Started]:
    """Runs with their starts [min]; those that are read already stay as they are."""
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
            found += read_runs(one, options_from(dict(reading)), None)
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
    """Who works, and who hears of it.

    Raises
    ------
    UsageError: jobs is no whole number above zero.
    """
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise UsageError(
            "jobs: not a number of processes", found=repr(jobs), allowed="a whole number above zero, or None for all cores"
        )
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise UsageError(
            "executor: nothing that work can be given to", found=repr(executor), allowed="a concurrent.futures.Executor"
        )
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
    return tuple(f"{name}.{key}={str(value).lower()}" for key, value in (settings or {}).items())


def model_of(model: "Model | str | Path | None") -> "Model | None":
    """A learnt model, read where it is a path."""
    if model is None:
        return None
    from .machine.model import Model

    return Model.load(model)


#: What numbers may be, as the command's options have it.
RANGES = {
    "reach": (0.0, 1e7),
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
#: Those of them that count.
WHOLE = frozenset({"seed", "sensors"})


def in_range(ranges: Mapping[str, tuple[float, float]] = RANGES, /, **numbers: float | None) -> list[float | None]:
    """The numbers as they are; None stays.

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
            raise UsageError(f"{name}: not a number in its range", found=repr(value), allowed=f"{whole}{low:g} to {high:g}")
    return list(numbers.values())
