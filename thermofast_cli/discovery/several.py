"""Several runs of one machine, made ready for one search or one fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from thermofast.models import Observations

from ..errors import ThermofastError, UsageError
from ..reading.source import sha256_of
from ..records import Record
from .loop import LoopTask, Ready, failure_records, ready, refused_records

#: Of a run left out the first so much of the record is read, where --until does not say otherwise; the rest is foretold.
READ = 1.0 / 3.0


@dataclass(frozen=True)
class OneOf:
    """One of several runs of a machine, made ready; refused are the records of sensors that cannot be used."""

    task: LoopTask
    prepared: Ready
    refused: list[Any]

    @property
    def first(self) -> Observations:
        """The readings that a model of the other runs may see."""
        whole = self.prepared.whole
        return self.prepared.seen if self.task.until_min is not None else whole.until(float(whole.time[0]) + READ * whole.span)


def ready_runs(tasks: Sequence[LoopTask], kind: type[Record]) -> tuple[list[OneOf], list[list[Any]]]:
    """Runs that can be used, and the records of those that cannot."""
    runs, failed = [], []
    for task in tasks:
        try:
            observed, prepared = ready(task)
        except ThermofastError as error:
            failed.append(failure_records(kind, task, error))
            continue
        refused = refused_records(kind, task.run.name, observed)
        if prepared is None:
            failed.append(refused)
        else:
            runs.append(OneOf(task, prepared, refused))
    return runs, failed


def common_runs(runs: list[OneOf]) -> tuple[list[OneOf], list[str]]:
    """The runs with the sensors that all of them have, and what was left out."""
    if len(runs) < 2:
        raise UsageError(
            "--together learns from several runs of one machine",
            found=f"{len(runs)} that can be used",
            allowed="two or more",
            do="name more runs, or leave --together out",
        )
    shared = [c for c in runs[0].prepared.seen.channels if all(c in r.prepared.seen.channels for r in runs)]
    if not shared:
        mine = set(runs[0].prepared.seen.channels)
        other = min(runs[1:], key=lambda r: len(mine & set(r.prepared.seen.channels)))
        raise UsageError(
            f"{other.task.run.name} and the other runs have no sensor in common with {runs[0].task.run.name}",
            found=", ".join(other.prepared.seen.channels[:8]),
            allowed=", ".join(runs[0].prepared.seen.channels[:8]),
            do="give runs of one machine, their sensors named alike",
        )
    left = sorted({c for r in runs for c in r.prepared.seen.channels} - set(shared))
    notes = [f"not in every run and left out: {', '.join(left)}"] if left else []
    cut = [replace(r, prepared=_only(r.prepared, shared)) for r in runs]
    return cut, notes


def refuse_copies(sources: Sequence[str]) -> None:
    """Raises UsageError where two of the runs are the same readings under two names."""
    seen: dict[str, str] = {}
    for source in sources:
        key = f"{sha256_of(source)}#{source.rpartition('#')[2] if '#' in source else ''}"
        if not key.startswith("#") and key in seen:
            raise UsageError(f"{source} is a copy of {seen[key]}", do="give each run once: a copy is no further evidence")
        seen[key] = source


def _only(prepared: Ready, channels: list[str]) -> Ready:
    return replace(prepared, whole=prepared.whole.only(channels), seen=prepared.seen.only(channels))
