"""What a run is once it is read, and what was guessed on the way."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models.noise.chain import originals
from thermofast.models.observations import read_only

from ..errors import InputError, UsageError, listed
from ..reading_options import Options, spoken

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guess:
    """What the file does not say and the reader had to take for granted.

    about is one of time, unit, date order, role, layout, lines, marks, runs, encoding; text says what was taken and why; option
    overrules it.
    """

    about: str
    text: str
    option: str

    def __str__(self) -> str:
        return f"guessed: {self.text} ({self.option})"

    def as_dict(self) -> dict[str, str]:
        return {"about": self.about, "text": self.text, "option": self.option}


def told(guesses: Iterable[Guess]) -> str:
    """All guesses in one line; empty without any."""
    return "; ".join(map(str, guesses))


@dataclass(frozen=True)
class SeenColumn:
    """A column of a file: role is time, sensor, ambient, input, displacement or ignored, and note says why it is that.

    old is its name in the file, where the user has given it another.
    """

    name: str
    role: str
    unit: str = ""
    note: str = ""
    old: str = ""

    @property
    def in_file(self) -> str:
        """Its name in the file."""
        return self.old or self.name


@dataclass(frozen=True)
class Seen:
    """How a file was understood: its rows, its columns in their order, its layout where it is text, and where time stands.

    header_line counts from 1, 0 for none; time_unit is that of numbers, else ``stamp`` or ``interval``; long are the columns that
    name sensors and the one of readings in a long table.
    """

    rows: int
    columns: tuple[SeenColumn, ...]
    time_column: str = ""
    time_unit: str = ""
    encoding: str = ""
    delimiter: str = ""
    decimal: str = ""
    header_line: int | None = None
    long: tuple[str, ...] = ()


#: Columns of a role that a notebook shows.
MOST_SHOWN = 20


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """One run: time_s (N,) ascending seconds from the first reading, channels name -> (N,) degC with nan for no reading.

    `notes` say what was taken for what, and what was mended; `guesses` what the file did not say; `channel_notes` what was mended
    in one sensor. `displacements` are columns in um. `again` is what a command line says to read it in the same way. Its arrays can
    be read, not written to.
    """

    name: str
    time_s: Array
    channels: dict[str, Array]
    ambient: dict[str, Array] = field(default_factory=dict)
    inputs: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    channel_notes: dict[str, str] = field(default_factory=dict)
    displacements: dict[str, Array] = field(default_factory=dict)
    guesses: tuple[Guess, ...] = ()
    seen: Seen | None = None
    again: str = ""

    def __post_init__(self) -> None:
        time = self.__dict__["time_s"] = self._numbers("time_s", self.time_s)
        if not (np.diff(time) > 0.0).all():  # nan does not ascend either
            row = int(np.flatnonzero(~(np.diff(time) > 0.0))[0])
            raise InputError(
                f"{self.name}: time_s does not ascend",
                found=f"{time[row + 1]:g} after {time[row]:g} s, row {row + 2}",
                allowed="ascending seconds",
                do="read it with tf.read, which puts readings in order",
            )
        for group in ("channels", "ambient", "inputs", "displacements"):
            self.__dict__[group] = {name: self._numbers(name, column) for name, column in getattr(self, group).items()}

    def _numbers(self, name: str, column: Any) -> Array:
        """A column as floats (N,).

        Raises
        ------
        InputError: it holds anything else, or not one reading for each time.
        """
        if type(column) is np.ndarray and column.dtype == np.float64 and column.shape == np.shape(self.time_s):
            return read_only(column)  # as nearly all are, and runs are made anew for many reasons
        try:
            found = np.asarray(column, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{self.name}: {name!r} is no array of numbers", found=type(column).__name__) from None
        if found.ndim != 1 or len(found) != len(self.time_s):
            rows = f"({len(self.time_s)},), one for each time"
            raise InputError(f"{self.name}: {name!r} has the wrong shape", found=str(found.shape), allowed=rows)
        return read_only(found)

    @property
    def room(self) -> Array | None:
        """The logged surroundings (N,) [degC], None where there are none; of several their mean, over gaps each as it was last."""
        logged = list(self.ambient.values())
        if len(logged) < 2:
            return logged[0] if logged else None
        there = [np.isfinite(column) for column in logged]
        last = [np.maximum.accumulate(np.where(t, np.arange(len(t)), np.argmax(t))) for t in there]
        whole = [column[at] for column, at, t in zip(logged, last, there, strict=True) if t.any()]
        return np.where(np.any(there, axis=0), np.mean(whole, axis=0), np.nan) if whole else logged[0]

    def __repr__(self) -> str:
        minutes = float(self.time_s[-1]) / 60.0 if len(self.time_s) else 0.0
        beside = [*self.ambient, *self.inputs, *self.displacements]
        more = f"; beside them {listed(beside, 6)}" if beside else ""
        return f"Run({self.name!r}: {len(self.time_s)} readings in {minutes:.4g} min of {listed(self.channels, 6)}{more})"

    def _repr_html_(self) -> str:
        """For a notebook: a row for each column, with its first and last reading; names stay text."""
        lines = [f"<caption>{escape(self.name)}: {len(self.time_s)} readings</caption>"]
        lines.append("<tr><th>column</th><th>role</th><th>first</th><th>last</th><th>missing</th></tr>")
        groups = ("sensor", self.channels), ("ambient", self.ambient), ("input", self.inputs), ("displacement", self.displacements)
        for role, columns in groups:
            for name, values in list(columns.items())[:MOST_SHOWN]:
                there = values[np.isfinite(values)]
                ends = [f"{v:.4g}" for v in (there[0], there[-1])] if len(there) else ["", ""]
                cells = [escape(name), role, *ends, str(len(values) - len(there))]
                lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
            if len(columns) > MOST_SHOWN:
                lines.append(f"<tr><td>and {len(columns) - MOST_SHOWN} more</td><td>{role}</td></tr>")
        notes = "; ".join([*self.notes, *map(str, self.guesses)])
        return f"<table>{''.join(lines)}</table><p>{escape(notes)}</p>"

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()  # what comes from another process can be written to


def renamed(run: Run, pairs: Iterable[str]) -> Run:
    """The run with other names for columns: ``T1=spindle_front``; a column of the file that was not read may be among them.

    Raises
    ------
    UsageError: a name that the file does not have, or one that two columns would share.
    """
    groups = ("channels", "ambient", "inputs", "displacements")
    held = [n for g in groups for n in getattr(run, g)]
    spare = {c.name for c in run.seen.columns} - set(held) if run.seen is not None else set()
    new = {n: n for n in held}
    for text in pairs:
        old, _, name = (part.strip() for part in text.rpartition("="))
        if old in spare:
            continue
        if old not in new:
            raise UsageError(f"{run.name}: --rename {old!r} is no column that was read", allowed=", ".join(held))
        new[old] = name
    if doubled := [n for n in new.values() if list(new.values()).count(n) > 1]:
        raise UsageError(
            f"{run.name}: --rename gives two columns one name", found=repr(doubled[0]), allowed="a name of its own for each"
        )
    columns: dict[str, Any] = {g: {new[n]: v for n, v in getattr(run, g).items()} for g in groups}
    seen = run.seen
    if seen is not None:
        told = (
            replace(c, name=new[c.name], note=f"{c.name!r} in the file", old=c.name) if new.get(c.name, c.name) != c.name else c
            for c in seen.columns
        )
        seen = replace(seen, columns=tuple(told))
    return replace(run, **columns, channel_notes={new.get(n, n): t for n, t in run.channel_notes.items()}, seen=seen)


def as_asked(run: Run, options: Options) -> Run:
    """A run of a file as the user asked for it: its stretch, and how to ask for it again.

    Raises
    ------
    UsageError: as :func:`stretch`.
    """
    kept, again = stretch(run, options.from_min, options.to_min), spoken(options)
    return replace(kept, again=again) if again else kept


def stretch(run: Run, from_min: float | None, to_min: float | None) -> Run:
    """The readings of a run from one minute to another, its clock begun anew; the run itself where neither is given.

    Raises
    ------
    UsageError: fewer than two readings lie in it.
    """
    if from_min is None and to_min is None:
        return run
    minutes = run.time_s / 60.0
    kept = (minutes >= (from_min or 0.0) - 1e-9) & (minutes <= (math.inf if to_min is None else to_min) + 1e-9)
    length = float(minutes[-1])
    if kept.sum() < 2:
        raise UsageError(
            f"{run.name}: fewer than two readings lie from {f'--from {from_min:g}' if from_min else 'the first'} to "
            f"{'the last' if to_min is None else f'--to {to_min:g}'} min",
            found=f"a record of {length:.4g} min",
            allowed="a stretch inside it",
            do="mend --from or --to",
        )
    first = float(run.time_s[kept][0])
    columns: dict[str, Any] = {
        f: {n: v[kept] for n, v in getattr(run, f).items()} for f in ("channels", "ambient", "inputs", "displacements")
    }
    note = f"{first / 60.0:.4g} to {float(minutes[kept][-1]):.4g} min of {length:.4g} kept (--from, --to)"
    return replace(run, time_s=run.time_s[kept] - first, notes=(*run.notes, note), **columns)


def ends_before(run: Run, until_min: float | None) -> bool:
    """Whether a run ends before the time up to which it is to be read, by more than half of what lies between two readings."""
    if until_min is None:
        return False
    last = float(run.time_s[-1]) / 60.0
    between = float(np.median(np.diff(run.time_s))) / 60.0 if len(run.time_s) > 1 else 0.0
    return until_min > max(1.001 * last, last + 0.5 * between)


def said_short(run: Run, until_min: float | None) -> str:
    """That it does, in words."""
    return f"the record ends at {float(run.time_s[-1]) / 60.0:.4g} min, before --until {until_min:g}"


def told_of_sensors(run: Run) -> Run:
    """With a word for each sensor that holds the readings of another."""
    names = list(run.channels)
    first = originals(list(run.channels.values())).tolist()
    copies = {
        n: f"every reading is that of {names[k]}: one sensor logged twice?"
        for n, k in zip(names, first, strict=True)
        if names[k] != n
    }
    notes = {n: "; ".join(t for t in (run.channel_notes.get(n, ""), said) if t) for n, said in copies.items()}
    return replace(run, channel_notes=run.channel_notes | notes) if notes else run


def layout(run: Run) -> dict[str, Any]:
    """How a run's file is laid out, and what was guessed of it."""
    seen = run.seen
    told: dict[str, Any] = {"run": run.name, "rows": len(run.time_s), "duration_s": float(run.time_s[-1])}
    if seen is not None:
        names = ("encoding", "delimiter", "decimal", "header_line", "time_column", "time_unit")
        told |= {n: getattr(seen, n) for n in names} | {"long": list(seen.long)}
    return told | {"notes": list(run.notes), "guesses": [g.as_dict() for g in run.guesses]}
