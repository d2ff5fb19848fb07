"""A learnt model on a run: the machine's constants as known, the run's own from its first minutes."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.effects.base import Choice, Effect
from thermofast.models.greybox import Column
from thermofast.models.joint import BASE, LEVEL, START, Fit, Key, Model, Part, Prior, search, start_values, with_parts
from thermofast.models.relaxation import relaxed
from thermofast.models.search.candidates import try_add
from thermofast.models.search.judge import likelihood_ratios
from thermofast.models.uncertainty.pooled import SCATTER

from ..errors import UsageError, listed
from ..plugins.effects import known_effects, named_effect
from ..plugins.files import path_and_class
from ..reading.source import sha256_of
from .modelfile import EffectEntry, ModelFile, Number, constants_of

Array = NDArray[np.float64]

#: A machine's constant is held no tighter than this share of itself: two runs of one machine are not exactly alike.
LEAST_SHARE = 1e-3
#: Share of itself by which an effect's parameter is another one in another run, where the model leaves a pattern in those it was
#: learnt from: then the effect stands for what is missing, too. Of one run that is explained it is the scatter that machines have.
EFFECT_AGAIN = 0.25
#: Gain that an event must bring to be believed in another run.
EVENT_GAIN = 30.0


#: Values and standard errors (S,) of the machine's constants by (part, name).
Known = dict[Key, tuple[NDArray[np.float64], NDArray[np.float64]]]


@dataclass(frozen=True)
class Carried:
    """A learnt model fitted to a run's first minutes, and what was said about it."""

    fit: Fit
    notes: tuple[str, ...]


def carry(model: ModelFile, seen: Observations, source: str, model_path: str) -> Carried:
    """Fit a learnt model's run parameters to the readings in use; the machine's stay within their standard errors.

    Raises
    ------
    UsageError: the run has none of the model's sensors, or lacks a column that an effect needs.
    """
    missing = [c for c in seen.channels if c not in model.channels]
    if len(missing) == len(seen.channels):
        raise UsageError(
            f"{source}: none of its sensors is in the model {model_path}",
            found=", ".join(seen.channels[:12]),
            allowed=", ".join(model.channels[:12]),
            do="use a model of this machine, or give its sensors the model's names: --rename COLUMN=NAME",
        )
    notes = [f"not in the model: {', '.join(missing)}; fitted freely"] if missing else []
    notes += [
        f"{c}: heat from {listed(others)} is left out, which the model has and what was read of this run has not"
        for c, others in without_neighbours(model, seen.channels).items()
    ]
    same_run = model.learnt_from.is_of(source, seen)
    # Its constants are as they are, however little of this run was read.
    seen = replace(seen, extent=max([seen.span, *(one.length_min for one in (model.learnt_from, *model.also_from))]))
    parts, entries, events = [], [], []
    known = check_effects(model, model_path)
    notes += changed_files(model)
    for entry in model.effects:
        part = _part(entry, known[entry.id], seen, source)
        if part.effect.event and part.effect.event in entry.searched and not same_run:
            events.append((entry, part))
            continue
        parts.append(part)
        entries.append(entry)
    fit = _fitted(model, seen, parts, entries, same_run)
    known_events = [p.id for p, e in zip(parts, entries, strict=True) if p.effect.event and p.effect.event in e.searched]
    if known_events:
        notes.append(f"the run that the model was learnt from: {listed(known_events)} as it was there")
    for entry, part in events:
        # An event of the run learnt from need not happen in this one; where it does, its own readings must show it.
        found = _event(model, fit, entries, entry, part.effect)
        if found is not None:
            fit = found
            entries.append(entry)
            notes.append(f"{entry.id}: found in this run too")
        else:
            notes.append(f"{entry.id}: an event of the run learnt from; not seen in the readings used here")
    return Carried(fit, tuple(notes))


def _event(model: ModelFile, fit: Fit, entries: list[EffectEntry], entry: EffectEntry, effect: Effect) -> Fit | None:
    """The fit with an event of the run learnt from in this one too, if its readings show it; the machine's constants stay as known.

    Readings that are not as the constants say are nearer to nearly any event: it must explain more than other constants would, and
    than these with any effect that is none (a slow mass bends a curve as a coolant does that was switched).
    """
    found = try_add(fit, effect)
    if found is None or not found.identifiable.ok:
        return None
    layout, at = found.fit.model, len(fit.model.parts)
    start = with_parts(fit, layout.parts) | {key: v for key, v in found.fit.values.items() if key.part == at}
    local, shared = layout.vector(start)
    held = search(layout, local, shared, _prior(layout, model, [*entries, entry], _known(model, fit.run, entries)))
    other = search(fit.model, fit.local, fit.shared)
    lasting = (e for e in known_effects(()).values() if not e.event and e.scope != "one" and e.choices(fit.run))
    tried = (try_add(other, e, quick=True) for e in lasting)
    rivals = chain((fit, other), (c.fit for c in tried if c is not None))
    return held if all(float(likelihood_ratios(rival, held).sum()) >= EVENT_GAIN for rival in rivals) else None


def as_learnt(model: ModelFile, seen: Observations, source: str, model_path: str) -> Observations:
    """A run of the machine as it was learnt, without noise and events, at the readings of `seen`.

    Where the room of `seen` is logged it begins as warm as that did, else as warm as the machine was when it was learnt.

    Raises
    ------
    UsageError: as :func:`carry`, and a model that was learnt with a drive, or whose effects do not tell how a run goes on.
    """
    channels = [c for c in seen.channels if c in model.channels]
    if not channels:
        raise UsageError(
            f"{source}: none of its sensors is in the model {model_path}",
            found=", ".join(seen.channels[:12]),
            allowed=", ".join(model.channels[:12]),
            do="give its sensors the model's names: --rename COLUMN=NAME",
        )
    if model.learnt_from.drive:
        raise UsageError(
            f"{model_path}: was learnt with the drive {model.learnt_from.drive!r}",
            do="give the runs that it was learnt from as OLD",
        )
    if model.past is not None and model.past.without_effects:
        raise UsageError(
            f"{model_path}: its effects ({listed(e.id for e in model.effects)}) do not tell where its own runs ended",
            do="give the runs that it was learnt from as OLD, or learn a model without them: thermofast improve RUN... --together",
        )
    seen, known = seen.only(channels), check_effects(model, model_path)
    parts = [(e, _part(e, known[e.id], seen, source)) for e in model.effects]
    kept = [(e, p) for e, p in parts if not (p.effect.event and p.effect.event in e.searched)]
    layout = Model(seen, [p for _, p in kept])
    told: dict[Key, Any] = {}
    for k, numbers in [(-1, model.base), *enumerate(e.parameters for e, _ in kept)]:
        for name in {m.name for m in numbers}:
            mine = [m for m in numbers if m.name == name]
            value = np.array([_of(mine, c, "value") for c in channels])
            # A parameter that some sensors do not have, as a share of a second neighbour, is nought of them.
            told[Key(k, name)] = np.nan_to_num(value) if mine[0].channel is not None else float(value[0])
    first = np.array([float(np.median(row[used][:3])) for row, used in zip(seen.reading, seen.used, strict=True)])
    warmer = float(np.median(first - told[START]))
    for key in (START, LEVEL, Key(-1, "sink")):
        if key in told and seen.sink_c is not None:
            told[key] = told[key] + warmer
    local, shared = layout.vector(told)
    everyone = np.broadcast_to(shared, (len(channels), len(shared))), np.arange(len(channels))

    def beside(curves: Array) -> Array:
        return Model(replace(seen, reading=curves), layout.parts).forward(local, *everyone)

    curve = beside(seen.reading)
    if any(part.effect.reads_sensors for part in layout.parts):
        curve = relaxed(curve, beside)
    return replace(seen, name=model_path, reading=curve)


def first_readings(model: ModelFile, channels: Sequence[str]) -> Array | None:
    """What sensors (S,) read at first in the runs that a model was learnt from [degC]; None where a file of before does not say."""
    firsts = {s.channel: s.first_c for s in model.past.shapes} if model.past is not None else {}
    told = [firsts.get(c) for c in channels]
    return None if None in told else np.array(told, dtype=float)


def check_effects(model: ModelFile, path: str) -> dict[str, Effect]:
    """The effects that a model file speaks of, by id.

    Raises
    ------
    UsageError: one is unknown, its file is gone, or a number is outside its range; the message names the model file.
    """
    gone = [e for e in model.effects if e.file and not Path(path_and_class(e.file)[0]).is_file()]
    if gone:
        raise UsageError(
            f"{path}: its effect {gone[0].id!r} was written in {gone[0].file}, which is not there",
            do="put the file back, or run from the folder it was learnt in",
        )
    known = known_effects([e.file for e in model.effects if e.file])
    for entry in model.effects:
        effect = named_effect(entry.id, known)
        if effect is None:
            raise UsageError(f"{path}: unknown effect {entry.id!r}", allowed=", ".join(known), do="install its plug-in")
        known[entry.id] = effect
    ranges = {("", p.name): p for p in BASE}
    ranges |= {(e.id, p.name): p for e in model.effects for p in known[e.id].parameters}
    for owner, number in [("", n) for n in model.base] + [(e.id, n) for e in model.effects for n in e.parameters]:
        p = ranges.get((owner, number.name))
        if p is not None and not p.share and not p.low <= number.value <= p.high:
            raise UsageError(
                f"{path}: {owner or 'base'} {number.name} is outside its range",
                found=f"{number.value:g} {number.unit}",
                allowed=f"{p.low:g} to {p.high:g}",
                do="learn the model anew",
            )
    return known


def without_neighbours(model: ModelFile, channels: Sequence[str]) -> dict[str, list[str]]:
    """Sensors among `channels` that a model links to others which are not, and those others."""
    found: dict[str, list[str]] = {}
    for entry in model.effects:
        for channel, others in _not_read(entry, channels).items():
            told = found.setdefault(channel, [])
            told += [other for other in others if other not in told]
    return found


def _not_read(entry: EffectEntry, channels: Sequence[str]) -> dict[str, list[str]]:
    """The same of one effect."""
    links = [other for other in entry.constants.values() if isinstance(other, dict)]
    mine = [c for c in channels if entry.channels is None or c in entry.channels]
    gone = {c: [other[c] for other in links if c in other and other[c] not in channels] for c in mine}
    return {c: others for c, others in gone.items() if others}


def changed_files(model: ModelFile) -> list[str]:
    """What to say of a user's own effects whose file is no longer the one that the model was learnt with."""
    changed = [e.file for e in model.effects if e.file and e.sha256 and sha256_of(path_and_class(e.file)[0]) != e.sha256]
    return [f"{name} has changed since the model was learnt" for name in changed]


def _part(entry: EffectEntry, effect: Effect, seen: Observations, source: str) -> Part:
    column = entry.constants.get("column")
    have = {**seen.ambient, **seen.inputs}
    if column and column not in have:
        raise UsageError(
            f"{source}: the model's effect {entry.id!r} needs the column {column!r}",
            found=f"{column} read as a sensor" if column in seen.channels else ", ".join(have) or "no logged inputs",
            do=f"--inputs {shlex.quote(column)}" if column in seen.channels else "log it, or learn a model without this effect",
        )
    names = {p.name for p in effect.parameters}
    unknown = [n for n in entry.searched if n not in names]
    if unknown:
        raise UsageError(f"model file: effect {entry.id!r} has no parameter {unknown[0]!r}", allowed=", ".join(sorted(names)))
    searched = entry.searched or {m.name for m in entry.parameters}  # as a file says that has no such key
    omitted = tuple(n for n in names if n not in searched)
    constants, by_sensor = constants_of(entry, seen.channels)
    choice = Choice(entry.acts, constants, omitted, by_sensor=by_sensor)
    alone = _not_read(entry, seen.channels)
    mine = seen.channels if entry.channels is None else entry.channels
    concerned = None if entry.channels is None and not alone else tuple(c in mine and c not in alone for c in seen.channels)
    return Part(effect, choice, concerned)


def _fitted(model: ModelFile, seen: Observations, parts: list[Part], entries: list[EffectEntry], same_run: bool) -> Fit:
    layout = Model(seen, parts)
    free = start_values(seen)
    told: dict[Key, object] = dict(free)
    n = seen.sensors
    for k, numbers in [(-1, model.base), *enumerate(e.parameters for e in entries)]:
        for name in {m.name for m in numbers}:
            mine = [m for m in numbers if m.name == name]
            value = np.array([_of(mine, c, "value") for c in seen.channels])
            start = np.where(np.isfinite(value), value, np.asarray(free.get(Key(k, name), np.nan)) * np.ones(n))
            is_run = mine[0].belongs == "run"
            if not (is_run and k < 0 and not same_run) and np.isfinite(start).all():
                told[Key(k, name)] = start if mine[0].channel is not None else float(start[0])
    prior = _prior(layout, model, entries, _known(model, seen, entries))
    best: Fit | None = None
    for phase in _phases(layout, same_run):
        at = {**told, **phase}
        local, shared = layout.vector(at)
        if not same_run:
            local = _levels(layout, local, shared)
        fit = search(layout, local, shared, prior)
        if best is None or float((fit.rss / seen.noise**2).sum()) < float((best.rss / seen.noise**2).sum()):
            best = fit
    assert best is not None
    return best


def _known(model: ModelFile, seen: Observations, entries: list[EffectEntry]) -> Known:
    """The machine's constants, of the base model and of effects, for the sensors of a run."""
    known: Known = {}
    for k, numbers in [(-1, model.base), *enumerate(e.parameters for e in entries)]:
        for name in {m.name for m in numbers if m.belongs != "run"}:
            mine = [m for m in numbers if m.name == name]
            value, error = (np.array([_of(mine, c, what) for c in seen.channels]) for what in ("value", "standard_error"))
            known[Key(k, name)] = value, error
    return known


def _of(numbers: list[Number], channel: str, what: str) -> float:
    for m in numbers:
        if m.channel in (None, channel):
            value = getattr(m, what)
            return float(value) if value is not None else np.inf
    return np.nan


def _levels(layout: Model, local: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Level and start fitted with everything else held: the run's own, from its first minutes."""
    held = Model(layout.run, layout.parts).only(LEVEL, START)
    return search(held, local, shared, None, 8, hold_shared=True).local


def _prior(layout: Model, model: ModelFile, entries: list[EffectEntry], known: Known) -> Prior:
    """The machine's constants with their covariance, in search coordinates; nothing of the rest."""
    n, kl = layout.run.sensors, len(layout.local)
    mean, as_told = _constants(layout, model, entries, known, 0.0)
    precision = np.zeros((n, kl, kl))
    for i, covariance in enumerate(as_told):
        at = np.flatnonzero(np.diagonal(covariance)[:kl] > 0.0)
        least = np.diag((LEAST_SHARE * np.maximum(1.0, np.abs(mean[i, at]))) ** 2 * 1e-2)
        precision[i][np.ix_(at, at)] = np.linalg.inv(covariance[np.ix_(at, at)] + least)
    variance = np.diagonal(as_told[0])[kl:]
    shared = np.diag(np.where(variance > 0.0, 1.0 / np.where(variance > 0.0, variance, 1.0), 0.0))
    pattern = model.past is not None and bool(model.past.unexplained)
    again = EFFECT_AGAIN if pattern else SCATTER if not model.also_from else 0.0
    return Prior(mean[:, :kl], precision, mean[0, kl:], shared, _constants(layout, model, entries, known, again)[1])


def _constants(
    layout: Model, model: ModelFile, entries: list[EffectEntry], known: Known, again: float
) -> tuple[np.ndarray, np.ndarray]:
    """Means (S, kl + ks) and covariances (S, kl + ks, kl + ks) of each sensor's and the shared constants as a file tells them.

    0 where it tells nothing; those of effects scatter by `again` of themselves beside.
    """
    columns = [*layout.local, *layout.shared]
    names = [_full_name(c, entries) for c in columns]
    mean, found = np.zeros((layout.run.sensors, len(columns))), np.zeros((layout.run.sensors, len(columns), len(columns)))
    for i, channel in enumerate(layout.run.channels):
        told = next((m for m in model.correlations if m.channel == channel), None)
        active = [*layout.active[i], *(True for _ in layout.shared)]
        spread = np.zeros(len(columns))
        for j, c in enumerate(columns):
            value, error = (float(v[i]) for v in known[c.key]) if c.key in known and active[j] else (np.nan, np.nan)
            if np.isfinite(value):
                mean[i, j], spread[j] = _searched(c, value, error)
                if c.part >= 0:
                    spread[j] = np.hypot(spread[j], again * (1.0 if c.parameter.log else abs(value)))
        together = np.eye(len(columns))
        if told is not None:
            of_file = [(j, told.names.index(name)) for j, name in enumerate(names) if name in told.names]
            here, there = [j for j, _ in of_file], [k for _, k in of_file]
            together[np.ix_(here, here)] = np.array(told.matrix)[np.ix_(there, there)]
        found[i] = together * np.outer(spread, spread)
    return mean, found


def _full_name(column: Column, entries: list[EffectEntry]) -> str:
    return column.parameter.name if column.part < 0 else f"{entries[column.part].id}.{column.parameter.name}"


def _searched(column: Column, value: float, error: float) -> tuple[float, float]:
    """A value and its standard error in search coordinates; an unknown error is taken as half the value."""
    error = error if np.isfinite(error) else 0.5 * abs(value) + 1e-9
    error = max(error, LEAST_SHARE * abs(value), 1e-12)
    if column.parameter.log:
        return float(np.log(max(value, 1e-300))), error / max(abs(value), 1e-300)
    return value, error


def _phases(layout: Model, same_run: bool) -> list[dict[Key, object]]:
    """Starts of a wave whose phase is the run's own."""
    waves = [c.key for c in layout.shared if c.parameter.periodic]
    if not waves or same_run:
        return [{}]
    return [{waves[0]: phase} for phase in np.arange(8) / 8.0]
