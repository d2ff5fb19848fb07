"""Whether the effects of a model, or the shape of the runs it was learnt from, foretell a run better from its first part."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermofast.filters import Afukf
from thermofast.models import Lump
from thermofast.models.imperfection import TYPICAL, Past, PastRun, learn_past
from thermofast.models.joint import Fit, fit_model

from ..estimation.identify import identify_sensors
from ..estimation.request import Method, Question
from ..estimation.sensor import Signals
from ..machine.model import Model
from ..machine.modelfile import ModelFile
from ..observing.task import LoopTask, Ready
from .past import knowledge, run_learnt_from
from .rise import free_runs

#: When a run is read, in time constants, and the share of it up to which that may be.
TURNS, MOST_READ = (0.3, 0.5, 1.0), 0.6
#: Runs that are foretold at most, and readings whose mean is the end of one.
MOST_RUNS, LAST = 4, 10
#: The interval score counts what lies outside a 95 % interval so many times.
OUTSIDE = 40.0
#: Factor on half-widths at most.
WIDEST = 4.0
#: Score of effects that foretell the runs they were learnt from over that of a shape that has not seen them, above which the shape
#: is taken.
NO_BETTER = 0.8
#: Root mean square of the errors of effects that foretell the one run they were learnt from, in deviations of their own intervals,
#: above which they are not the machine's: right ones, which have seen its end, come below 1.
FAILS_ITSELF = 2.0


@dataclass(frozen=True)
class Foretold:
    """shape: whether intervals from the shape of the other runs foretell the ends of runs better than a model's effects do; wider:
    the factor on the half-widths of those by the effects that the errors ask for.
    """

    shape: bool = False
    wider: float = 1.0


def from_first_part(file: ModelFile, tasks: Sequence[LoopTask], plain: Sequence[PastRun]) -> Foretold:
    """How well runs are foretold from their first part, by a model's effects and by the shape of the others.

    The effects were learnt from the very runs that they foretell, the shape was not: they must do clearly better. Of one run there
    is no shape that has not seen it: effects that miss its end are left. plain: the runs as the base model has them. Interval
    scores (Winkler) over each sensor's range of readings.
    """
    if not file.effects or file.learnt_from.drive:
        return Foretold()
    everything = learn_past(plain, TYPICAL)
    rates = [shape.log_rate for shape in everything.shapes.values()]
    tau, model = float(np.exp(-np.median(rates))), Model(file, "the model")
    effects: list[_Told] = []
    shapes: list[_Told] = []
    for k, task in enumerate(tasks[:MOST_RUNS]):
        others = [run for i, run in enumerate(plain) if i != k]
        shape = learn_past(others, TYPICAL, everything) if others else None
        length = float(task.run.time_s[-1]) / 60.0 - task.start_min
        for until in (task.start_min + turn * tau for turn in TURNS if turn * tau < MOST_READ * length):
            told = knowledge(replace(task, until_min=until, model=model, drive=None, names=(), auto=False))[0]
            if told.past is None or told.failed:
                continue
            # What the readings leave open is no merit of the effects.
            by_effects = _told(task, until, replace(told.past, open_end=frozenset(), unreached={}), not told.uses_room)
            by_shape = by_effects if shape is None else _told(task, until, shape, True)
            both = [c for c in by_effects if c in by_shape]
            effects += [by_effects[c] for c in both]
            shapes += [by_shape[c] for c in both]
    if not effects:
        return Foretold()
    off = float(np.sqrt(np.mean([one.off**2 for one in effects])))
    scores = [float(np.mean([one.score for one in some])) for some in (effects, shapes)]
    worse = off > FAILS_ITSELF if len(plain) == 1 else scores[0] > NO_BETTER * scores[1]
    return Foretold(worse, float(np.clip(off, 1.0, WIDEST)))


def with_rest(past: Past, bare: Past) -> Past:
    """The past by a model that leaves a pattern, with what the readings of its runs alone, as the base model has them, left open of
    their end: its effects tell no more of that than they.
    """
    shapes = dict(past.shapes)
    for channel in past.unexplained:
        own, plain = past.shapes[channel], bare.shapes.get(channel)
        if plain is not None and plain.rest is not None:
            by = float(np.exp(own.log_rate - plain.log_rate))  # a rest's times are in time constants
            rest = plain.rest
            of_own = replace(rest, soonest=by * rest.soonest, latest=by * rest.latest, length=by * rest.length)
            shapes[channel] = replace(own, rest=of_own)
    return replace(past, shapes=shapes)


def as_the_machine_goes(base: Fit, fit: Fit, prepared: Ready, task: LoopTask, events: Collection[int]) -> tuple[PastRun, LoopTask]:
    """A run as the base model has it, without what probes of a `fit` show that is not their object's, a drift or a jump, and
    without events (parts of the fit) that are only this run's; and the task with its run as it would have been.
    """
    keep = [k for k, part in enumerate(fit.model.parts) if part.effect.scope != "one" and k not in events]
    if len(keep) == len(fit.model.parts):
        return run_learnt_from(base, prepared.whole), task
    sensors = np.arange(fit.run.sensors)
    shared = np.tile(fit.shared, (len(sensors), 1))
    shown = fit.curve - free_runs(fit, fit.run, fit.local, shared, sensors, keep)
    seen, whole = (replace(one, reading=one.reading - shown) for one in (prepared.seen, prepared.whole))
    minutes = task.run.time_s / 60.0 - task.start_min
    without = {c: np.interp(minutes, fit.run.time, row) for c, row in zip(fit.run.channels, shown, strict=True)}
    channels = {c: row - without.get(c, 0.0) for c, row in task.run.channels.items()}
    # By another name, so that it is not known again for the run in which something happened.
    own = replace(task, run=replace(task.run, name=f"{task.run.name} as the machine goes", channels=channels))
    return run_learnt_from(fit_model(seen), whole), own


@dataclass(frozen=True)
class _Told:
    """Interval score of the end of a sensor, over its range, and how far off it was, in deviations of the interval."""

    score: float
    off: float


def _told(task: LoopTask, until: float, past: Past, with_room: bool) -> dict[str, _Told]:
    """Of the sensors of a run that the past knows and of which both sides are told."""
    run = task.run
    channels = tuple(c for c in run.channels if c in past.shapes)
    if not channels:
        return {}
    signals = Signals.of(run, task.start_min, channels)
    if not with_room:
        signals = replace(signals, room=None)
    at, values = float(signals.time_min[-LAST:].mean()) - task.start_min, signals.values
    records = identify_sensors(signals, Method(Lump(), Afukf(), past=past), Question(until, at)).records
    found = {}
    for record, row in zip(records, values, strict=True):
        last = row[-LAST:][np.isfinite(row[-LAST:])]
        low, middle, high = record.at_lo_c, record.at_c, record.at_hi_c
        if low is not None and middle is not None and high is not None and len(last):
            end, span = float(last.mean()), float(np.nanmax(row) - np.nanmin(row))
            outside = max(low - end, 0.0) + max(end - high, 0.0)
            half = max(middle - low if end < middle else high - middle, 1e-9)
            found[record.channel] = _Told((high - low + OUTSIDE * outside) / max(span, 1e-9), 1.96 * (end - middle) / half)
    return found
