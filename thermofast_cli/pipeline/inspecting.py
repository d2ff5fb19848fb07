"""``inspect``: what was read of a file, column by column, before any mathematics."""

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np

from ..errors import ThermofastError
from ..given import checked
from ..reading import Run
from ..reading.run import Guess, SeenColumn
from ..reading.source import read_runs, read_table
from ..reading_options import Options, ReadingOptions, options_from
from ..records import InspectRecord, finite
from ..results import Inspection

#: A pause of this many usual intervals is a gap.
GAP = 2.5
#: Roles in the words of the reading options, with the attribute of a run that holds their columns.
HELD = {"sensor": "channels", "ambient": "ambient", "input": "inputs", "displacement": "displacements"}


@checked
def inspect(source: Any, *, name: str | None = None, **reading: Unpack[ReadingOptions]) -> Inspection:
    """What is read of a file or table, column by column, before any mathematics; `reading` as in :func:`thermofast.read`.

    Raises
    ------
    InputError, UsageError: as :func:`thermofast.read`.
    """
    if isinstance(source, Run):  # one that was read
        return inspect_runs([source])
    return inspect_runs(read_runs(source, options_from(reading), name))


def inspect_runs(runs: Sequence[Run]) -> Inspection:
    """A record for each column of each run."""
    return Inspection(tuple(r for run in runs for r in _records(run)), tuple(runs))


def columns_of(source: str, options: Options) -> list[InspectRecord]:
    """A record for each column of a file that is refused, none of which has a role; empty where not even columns are seen."""
    try:
        table = read_table(source, options)
    except ThermofastError:
        return []
    found = []
    for name in table.names:
        column = table.columns.get(name)
        if isinstance(column, np.ndarray):
            good = column[np.isfinite(column)]
            ends = (finite(good[0]), finite(good[-1])) if len(good) else (None, None)
            found.append(InspectRecord(table.name, name, "?", table.units.get(name, ""), len(good), *ends))
        else:
            first = next((c.strip() for c in column or [] if c.strip()), "")
            found.append(InspectRecord(table.name, name, "?", note=f"words, as {first[:30]!r}" if first else "empty"))
    return found


def _records(run: Run) -> list[InspectRecord]:
    if run.seen is None:
        return []
    return [_record(run, column) for column in run.seen.columns]


def _record(run: Run, column: SeenColumn) -> InspectRecord:
    guessed = "; ".join(g.text for g in run.guesses if _concerns(g, column))
    if column.role == "time":
        minutes = run.time_s / 60.0
        ends = finite(minutes[0]), finite(minutes[-1])
        note = _clock(run.time_s)
        return InspectRecord(run.name, column.name, column.role, column.unit, len(minutes), *ends, guessed, note)
    values = getattr(run, HELD[column.role]).get(column.name) if column.role in HELD else None
    if values is None:
        return InspectRecord(run.name, column.name, column.role, column.unit, guessed=guessed, note=column.note)
    good = values[np.isfinite(values)]
    missing = len(values) - len(good)
    notes = [column.note, f"{missing} missing" if missing else "", run.channel_notes.get(column.name, "")]
    ends = (finite(good[0]), finite(good[-1])) if len(good) else (None, None)
    told = "; ".join(n for n in notes if n)
    return InspectRecord(run.name, column.name, column.role, column.unit, len(good), *ends, guessed, told)


def _concerns(guess: Guess, column: SeenColumn) -> bool:
    return column.name in guess.text or (guess.about in ("time", "date order") and column.role == "time")


def _clock(time: Any) -> str:
    """'every 10 s, 2 gaps, the longest 5.3 min'."""
    if len(time) < 2:
        return ""
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = steps[steps > GAP * usual]
    every = f"every {usual:.4g} s" if usual < 90.0 else f"every {usual / 60.0:.4g} min"
    if not len(gaps):
        return every
    return f"{every}, {len(gaps)} gap{'s' if len(gaps) > 1 else ''}, the longest {gaps.max() / 60.0:.3g} min"
