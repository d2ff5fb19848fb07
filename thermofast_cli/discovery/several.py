"""Several runs of one machine, made ready for one search or one fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.joint import RATE, Fit
from thermofast.models.search.discover import Discovery

from ..errors import ThermofastError, UsageError, rounded
from ..observing.task import LoopTask, Ready, failure_records, ready, refused_records
from ..records import Record

Array = NDArray[np.float64]

#: Of a run left out the first so much of the record is read, where --until does not say otherwise; the rest is foretold.
READ = 1.0 / 3.0
#: How far apart logarithms of rates are, in the median sensor and of sensors against each other, where runs are of two machines.
ALL_FASTER, OUT_OF_STEP = 0.7, 0.35
#: Deviation of the logarithm of a rate, by noise alone, from which it is no evidence of that: no smaller than what is looked for.
RATE_KNOWN = 0.35
#: So many of the models nearest to a run are looked at, beside the base model and what is named.
LIKELY = 6
#: Why nothing is named then.
TWO_MACHINES = "two machines"


@dataclass(frozen=True)
class OneOf:
    """One of several runs of a machine, made ready; refused are the records of sensors that cannot be used."""

    task: LoopTask
    prepared: Ready
    refused: list[Any]

    @property
    def first(self) -> Observations:
        """The readings that a model of the other runs may see; when an event of this run came is known from all of it."""
        whole = self.prepared.whole
        if self.task.until_min is not None:
            return self.prepared.seen
        return replace(whole.until(float(whole.time[0]) + READ * whole.span), extent=whole.span)


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


def common_runs(runs: list[OneOf], failed: Sequence[Sequence[Any]] = ()) -> tuple[list[OneOf], list[str]]:
    """The runs with the sensors that all of them have, and what was left out; failed: records of those that cannot be used."""
    if len(runs) < 2:
        why = [f"{some[0].run}: {some[0].message}" for some in failed if some]
        raise UsageError(
            "--together learns from several runs of one machine",
            found="; ".join([f"{len(runs)} that can be used", *why[:3]]),
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


def two_machines(found: Sequence[Discovery], names: Sequence[str]) -> str:
    """What to say of runs whose rates lie so far apart that they are of two machines, whatever of what explains each is taken.

    An event in one of them bends its rate without it: a run with a load that rose looks like one of a machine four times as slow.
    """
    may = [_may_be(d) for d in found]
    for k, name in enumerate(names[1:], 1):
        pairs = [(may[k][ids], may[0][ids]) for ids in may[k] if ids in may[0]]
        # What one run alone has of events stands against the other without.
        pairs += [(fit, may[0][()]) for ids, fit in may[k].items() if ids not in may[0] and _events(fit)]
        pairs += [(may[k][()], fit) for ids, fit in may[0].items() if ids not in may[k] and _events(fit)]
        apart = [_log_rates(own) - _log_rates(other) for own, other in pairs]
        if not all(np.isfinite(off).any() for off in apart):
            continue
        faster = [float(np.nanmedian(off)) for off in apart]
        nearest = float(np.min(np.abs(faster)))
        rests = [off - middle for off, middle in zip(apart, faster, strict=True)]
        if nearest > ALL_FASTER and len(set(np.sign(faster))) == 1:
            how = f"{name} is {rounded(float(np.exp(nearest)))} times as {'fast' if faster[0] > 0.0 else 'slow'} as {names[0]}"
        elif all(np.isfinite(off).sum() > 2 for off in apart) and min(map(_size, rests)) > OUT_OF_STEP:
            sensor = int(np.nanargmax(np.abs(rests[0])))
            times = rounded(float(np.exp(abs(rests[0][sensor]))))
            how = f"beside the other sensors {found[0].base.run.channels[sensor]} is {times} times out of step in {name}"
        else:
            continue
        return f"these runs look like those of two machines ({how})"
    return ""


def _may_be(found: Discovery) -> dict[tuple[str, ...], Fit]:
    """Fits of a run by their effects: none, those named, and an event that takes away half of the misfit or more."""
    cost = float((found.base.rss / found.base.run.noise**2).sum())
    likely = (*found.also, *found.singles)[:LIKELY]
    half = {c.ids: c.fit for c in likely if _events(c.fit) and float((c.fit.rss / c.fit.run.noise**2).sum()) < 0.5 * cost}
    return {(): found.base} | half | ({} if found.named is None else {found.named.ids: found.named.fit})


def _events(fit: Fit) -> bool:
    return all(part.effect.event for part in fit.model.parts)


def _log_rates(fit: Fit) -> Array:
    """Logarithms of the rates (S,), nan of a sensor that hardly moves: its rate may be any, which is no evidence."""
    found: Array = np.log(np.broadcast_to(fit.values[RATE], fit.run.sensors))
    return np.where(fit.deviations[RATE] <= RATE_KNOWN, found, np.nan)


def _size(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def unnamed(found: Sequence[Discovery]) -> list[Discovery]:
    """Verdicts with their names taken back."""
    return [
        d if d.named is None else replace(d, named=None, also=(d.named, *d.also), ahead=None, why=TWO_MACHINES, stages=(), held=())
        for d in found
    ]


def _only(prepared: Ready, channels: list[str]) -> Ready:
    return replace(prepared, whole=prepared.whole.only(channels), seen=prepared.seen.only(channels))
