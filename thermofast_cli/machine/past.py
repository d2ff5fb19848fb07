"""Past runs of a machine: learnt from fits of them, and made ready for a run at hand."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermofast.models import Observations
from thermofast.models.imperfection import (
    FAST_MODES,
    GUESSED_NODES,
    SLOW_MODES,
    TYPICAL,
    Part,
    Past,
    PastRun,
    SensorShape,
    learn_past,
    pilot,
    widths_left_out,
)
from thermofast.models.joint import LEVEL, RATE, SINK, Fit, Key, fit_model

from ..discovery.loop import LoopTask, ids_of, ready
from ..discovery.observe import observe
from ..errors import ThermofastError, UsageError
from ..estimation.imperfect import follows_machine
from .learnt import carry, changed_files
from .model import Model
from .modelfile import ModelFile, past_of
from .rise import rises_of

#: Rates outside these over the record's length say nothing of the machine.
RATES = 0.3, 200.0
#: Deviation of the log rate about that of a fit to the same readings, where nothing else is known of it.
GUESS = 0.6
#: Of what a sensor moved, what a drive must have brought to be followed.
LEAST_HEAT = 0.1
SINK_KEY = Key(-1, SINK.name)


@dataclass(frozen=True)
class Knowledge:
    """What a model says of a run at hand, or why it cannot say anything.

    notes are for every sensor of it; uses_room: an effect of the model accounts for the surroundings that are logged; strange are
    sensors that do not follow the drive.
    """

    run: str
    past: Past | None = None
    notes: tuple[str, ...] = ()
    uses_room: bool = False
    failed: str = ""
    strange: tuple[str, ...] = ()


def run_learnt_from(fit: Fit, whole: Observations | None = None) -> PastRun:
    """A fitted run as one to learn from."""
    run = fit.run
    plain = not fit.model.parts and run.heat is None
    rises = {} if plain else rises_of(fit, whole or run)
    room = _room(fit)
    parts, log_rates = [], []
    for i in range(run.sensors):
        used = run.used[i]
        time, reading = run.time[used], run.reading[i][used][None]
        noise = np.array([run.noise[i] / np.sqrt(np.median(run.weight[i][used]))])
        parts.append(Part(time, reading, noise, run.resolution[i : i + 1], None if room is None else room[used]))
        rate, span = float(fit.values[RATE][i]), float(time[-1] - time[0])
        known = not plain or RATES[0] < rate * span < RATES[1]
        log_rates.append(np.log(rate if known else 1.0 / float(pilot(time, reading)[0])))
    return PastRun(run.channels, tuple(parts), np.array(log_rates), rises)


def learnt_past(runs: Sequence[PastRun]) -> Past:
    """From runs that are fitted; how wide intervals must be is learnt from three on."""
    return widths_left_out(learn_past(runs, TYPICAL), runs, TYPICAL)


def _room(fit: Fit) -> np.ndarray | None:
    """The surroundings that are logged, where no effect of the model accounts for them and they do not move with the machine."""
    run = fit.run
    if not run.ambient or any(p.effect.follows_ambient for p in fit.model.parts):
        return None
    room = np.mean(list(run.ambient.values()), axis=0)
    seen = run.used.any(axis=0)
    return None if follows_machine(run.filled[:, seen], room[seen]) else room


def knowledge(task: LoopTask) -> list[Knowledge]:
    """What the model of a task says of its run; trouble is told, not raised."""
    try:
        return [_knowledge(task)]
    except ThermofastError as error:
        return [Knowledge(task.run.name, failed=str(error).replace("\n ", ";"))]


def knowledge_lost(task: LoopTask) -> list[Knowledge]:
    """A run whose worker died."""
    return [Knowledge(task.run.name, failed="the worker process died; run it alone with --jobs 1")]


def _driven(task: LoopTask) -> Knowledge:
    """Of a run whose heat follows a logged column, and of whose machine nothing is known."""
    name = task.run.name
    _, prepared = ready(task)
    if prepared is None:
        return Knowledge(name)
    fit = fit_model(prepared.seen)
    log_rates = np.log(fit.values[RATE])
    # A column that a sensor follows leaves less of it than a heat that is constant does, and is what moves it.
    bare = observe(replace(task.run, inputs={}), task.start_min).seen
    assert bare is not None
    constant = fit_model(bare.until(task.until_min))
    moved = np.ptp(fit.run.filled[:, fit.run.used.any(axis=0)], axis=1)
    sink = float(fit.values.get(SINK_KEY, prepared.seen.sink_c or 0.0))
    follows = (fit.rmse <= np.maximum(constant.rmse, 1.2 * fit.run.noise)) & (np.abs(fit.values[LEVEL] - sink) > LEAST_HEAT * moved)
    count = len(SLOW_MODES) + len(FAST_MODES) + 1
    none, little = np.zeros(count), 1e-12 * np.eye(count)
    shapes = {c: SensorShape(float(b), GUESS, none, little) for c, b in zip(fit.run.channels, log_rates, strict=True)}
    rises = rises_of(fit, prepared.whole, GUESSED_NODES)
    strange = [c for c, yes in zip(fit.run.channels, follows, strict=True) if not yes]
    for c in strange:
        del shapes[c]
    held = f"with {task.drive} as the heat, as last logged"
    return Knowledge(name, Past(shapes, scatter=0.0, guessed=True, rises=rises), (held,), strange=tuple(strange))


def _knowledge(task: LoopTask) -> Knowledge:
    if task.model is None:
        return _driven(task)
    file, name = task.model.file, task.run.name
    mine = [c for c in task.run.channels if c in file.channels]
    if not mine:
        raise UsageError(
            f"{name}: none of its sensors is in the model {task.model.source}",
            found=", ".join(list(task.run.channels)[:12]),
            allowed=", ".join(file.channels[:12]),
            do="use a model of this machine, or name the sensors alike",
        )
    past = past_of_model(task.model)
    notes = [_said([e.id for e in file.effects], task.model.source, past.runs), *changed_files(file)]
    if not file.effects and task.drive is None:
        return Knowledge(name, past, tuple(notes))
    _, prepared = ready(task)
    if prepared is None:
        return Knowledge(name, past, tuple(notes))
    carried = carry(file, prepared.seen, name, task.model.source)
    notes = [_said(ids_of(carried.fit.model.parts), task.model.source, past.runs), *carried.notes]
    rises = rises_of(carried.fit, prepared.whole)
    known = {c: s for c, s in past.shapes.items() if c in rises}
    uses_room = any(p.effect.follows_ambient for p in carried.fit.model.parts)
    return Knowledge(name, replace(past, shapes=known, rises=rises), tuple(notes), uses_room)


def past_of_model(model: Model) -> Past:
    """What a model tells of the next run of its machine.

    Raises
    ------
    UsageError: it tells of no sensor, or as :func:`past_of`.
    """
    past = past_of(model.file.past) if model.file.past is not None else _old(model.file)
    if not past.shapes:
        raise UsageError(f"{model.source}: it tells no rate of any sensor", do="learn the model anew with thermofast improve")
    return past


def _said(effects: Sequence[str], source: str, runs: int) -> str:
    learnt = f", learnt from {runs} runs" if runs > 1 else ""
    return f"with {', '.join(effects)} of {source}{learnt}" if effects else f"by {source}{learnt}"


def _old(file: ModelFile) -> Past:
    """Of a model file that tells no past: its rates, and the shapes of machines in general."""
    found = {}
    for c in file.channels:
        rate = next((n for n in file.base if n.name == "rate" and n.channel in (None, c)), None)
        if rate is not None and rate.value > 0.0:
            share = (rate.standard_error or 0.0) / rate.value
            found[c] = SensorShape.unseen(float(np.log(rate.value)), min(share, 0.5), TYPICAL)
    return Past(found)
