"""A learnt model on a run: the machine's constants as known, the run's own from its first minutes."""

from dataclasses import dataclass

import numpy as np

from models import Observations
from models.candidates import try_add
from models.effects.base import Choice
from models.joint import Fit, Model, Part, Prior, search, start_values

from .errors import UsageError
from .modelfile import EffectEntry, ModelFile, Number, constants_of
from .plugins import known_effects
from .reading.source import sha256_of

#: A machine's constant is held no tighter than this share of itself: two runs of one machine are not exactly alike.
LEAST_SHARE = 1e-3
#: Gain that an event must bring to be believed in another run.
EVENT_GAIN = 30.0


@dataclass(frozen=True)
class Carried:
    """A learnt model fitted to a run's first minutes, and what was said about it."""

    fit: Fit
    notes: tuple[str, ...]
    unknown: tuple[str, ...]


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
            do="use a model of this machine, or name the sensors alike",
        )
    notes = [f"not in the model: {', '.join(missing)}; fitted freely"] if missing else []
    same_run = bool(model.learnt_from.sha256) and sha256_of(source) == model.learnt_from.sha256
    parts, entries, events = [], [], []
    known = known_effects([e.file for e in model.effects if e.file])
    for entry in model.effects:
        if entry.id not in known:
            raise UsageError(f"{model_path}: unknown effect {entry.id!r}", allowed=", ".join(known), do="install its plug-in")
        part = _part(entry, known[entry.id], seen, source)
        if part.effect.event and part.effect.event in entry.searched and not same_run:
            events.append((entry, part))
            continue
        parts.append(part)
        entries.append(entry)
    fit = _fitted(model, seen, parts, entries, same_run)
    for entry, part in events:
        # An event of the run learnt from need not happen in this one; where it does, its own readings must show it.
        found = try_add(fit, part.effect)
        if found is not None and found.gain > EVENT_GAIN and found.identifiable.ok:
            fit = found.fit
            notes.append(f"{entry.id}: found in this run too")
        else:
            notes.append(f"{entry.id}: an event of the run learnt from; not seen in the readings used here")
    return Carried(fit, tuple(notes), tuple(missing))


def _part(entry: EffectEntry, effect: object, seen: Observations, source: str) -> Part:
    from models.effects.base import Effect

    assert isinstance(effect, Effect)
    column = entry.constants.get("column")
    have = {**seen.ambient, **seen.inputs}
    if column and column not in have:
        raise UsageError(
            f"{source}: the model's effect {entry.id!r} needs the column {column!r}",
            found=", ".join(have) or "no logged inputs",
            do="log it, or learn a model without this effect",
        )
    names = {p.name for p in effect.parameters}
    unknown = [n for n in entry.searched if n not in names]
    if unknown:
        raise UsageError(f"model file: effect {entry.id!r} has no parameter {unknown[0]!r}", allowed=", ".join(sorted(names)))
    omitted = tuple(n for n in names if n not in entry.searched)
    choice = Choice(entry.acts, constants_of(entry, seen.channels), omitted)
    concerned = None if entry.channels is None else tuple(c in entry.channels for c in seen.channels)
    return Part(effect, choice, concerned)


def _fitted(model: ModelFile, seen: Observations, parts: list[Part], entries: list[EffectEntry], same_run: bool) -> Fit:
    layout = Model(seen, parts)
    free = start_values(seen)
    told: dict[tuple[int, str], object] = dict(free)
    n = seen.sensors
    known: dict[tuple[int, str], tuple[np.ndarray, np.ndarray]] = {}
    for k, numbers in [(-1, model.base), *enumerate(e.parameters for e in entries)]:
        for name in {m.name for m in numbers}:
            mine = [m for m in numbers if m.name == name]
            value = np.array([_of(mine, c, "value") for c in seen.channels])
            error = np.array([_of(mine, c, "standard_error") for c in seen.channels])
            start = np.where(np.isfinite(value), value, np.asarray(free.get((k, name), np.nan)) * np.ones(n))
            is_run = mine[0].belongs == "run"
            if not (is_run and k < 0 and not same_run) and np.isfinite(start).all():
                told[k, name] = start if mine[0].channel is not None else float(start[0])
            if not is_run:
                known[k, name] = value, error
    prior = _prior(layout, known)
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


def _of(numbers: list[Number], channel: str, what: str) -> float:
    for m in numbers:
        if m.channel in (None, channel):
            value = getattr(m, what)
            return float(value) if value is not None else np.inf
    return np.nan


def _levels(layout: Model, local: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Level and start fitted with everything else held: the run's own, from its first minutes."""
    held = Model(layout.run, layout.parts)
    held.active = np.zeros_like(layout.active)
    held.active[:, 1:3] = True
    return search(held, local, shared, None, 8, hold_shared=True).local


def _prior(layout: Model, known: dict[tuple[int, str], tuple[np.ndarray, np.ndarray]]) -> Prior:
    """The machine's constants with their standard errors, in search coordinates; nothing of the rest."""
    n = layout.run.sensors
    local, local_sd = np.zeros((n, len(layout.local))), np.full((n, len(layout.local)), np.inf)
    shared, shared_sd = np.zeros(len(layout.shared)), np.full(len(layout.shared), np.inf)
    for columns, mean, sd in ((layout.local, local, local_sd), (layout.shared, shared, shared_sd)):
        for j, c in enumerate(columns):
            if (c.part, c.parameter.name) not in known:
                continue
            value, error = known[c.part, c.parameter.name]
            if c.parameter.each == "run":
                value, error = value[0], error[0]
            good = np.isfinite(value)
            safe = np.where(good, value, 1.0)
            spread = np.hypot(np.where(np.isfinite(error), error, np.inf), LEAST_SHARE * np.abs(safe))
            if c.parameter.log:
                mean[..., j] = np.log(np.maximum(safe, 1e-300))
                spread = spread / np.maximum(safe, 1e-300)
            else:
                mean[..., j] = safe
            sd[..., j] = np.where(good, np.maximum(spread, 1e-9), np.inf)
    return Prior(local, local_sd, shared, shared_sd)


def _phases(layout: Model, same_run: bool) -> list[dict[tuple[int, str], object]]:
    """Starts of a wave whose phase is the run's own."""
    waves = [c.part for c in layout.shared if c.parameter.name == "phase" and c.part >= 0]
    if not waves or same_run:
        return [{}]
    return [{(waves[0], "phase"): phase} for phase in np.arange(8) / 8.0]
