"""``improve --together``: several runs of one machine in one fit, each left out in turn."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.effects.base import Effect
from thermofast.models.imperfection import SCATTER, Past
from thermofast.models.joint import Fit, Part, fit_model, with_parts
from thermofast.models.search.candidates import try_add
from thermofast.models.search.discover import Spread
from thermofast.models.search.heldout import held_out_errors
from thermofast.models.search.judge import least_p, sensor_p_values
from thermofast.models.search.rules import RULES
from thermofast.models.uncertainty.pooled import Pooled, fit_known, fit_together, pool

from ..errors import ThermofastError, UsageError
from ..machine.modelfile import learnt_from, model_file
from ..machine.past import learnt_past, run_learnt_from
from ..plugins.effects import chosen_effects, load_effect
from ..reading.source import sha256_of
from ..records import ImproveRecord, finite
from .diagnose import search_run
from .improve import Improved
from .loop import LoopTask, Ready, check_inputs, failure_records, ids_of, parameters_of, pooled, ready, refused_records

Array = NDArray[np.float64]

#: Of a run left out the first so much of the record is read, where --until does not say otherwise; the rest is foretold.
READ = 1.0 / 3.0
#: The search's effects stay where the error on runs left out falls to this share.
WORTH = 0.9
#: A run whose rates lie this many usual scatters off is named.
STRETCHED = 2.0


@dataclass(frozen=True)
class Stage:
    """A model of all runs: a fit each, the machine's constants, and the errors (S,) [K] of each run when the others foretell it."""

    fits: tuple[Fit, ...]
    known: Pooled
    left_out: tuple[Array, ...]


@dataclass(frozen=True)
class _Run:
    task: LoopTask
    prepared: Ready
    refused: list[ImproveRecord]

    @property
    def first(self) -> Observations:
        """The readings that a model of the other runs may see."""
        whole = self.prepared.whole
        return self.prepared.seen if self.task.until_min is not None else whole.until(float(whole.time[0]) + READ * whole.span)


def improve_together(tasks: Sequence[LoopTask], spread: Spread = map) -> list[Improved]:
    """An :class:`Improved` for each run, the first with the model of them all.

    Raises
    ------
    UsageError: fewer than two runs that can be used, or no sensor that all of them have.
    """
    runs, failed = [], []
    for task in tasks:
        try:
            observed, prepared = ready(task)
        except ThermofastError as error:
            failed.append(Improved(failure_records(ImproveRecord, task, error)))
            continue
        refused = refused_records(ImproveRecord, task.run.name, observed)
        if prepared is None:
            failed.append(Improved(refused))
        else:
            runs.append(_Run(task, prepared, refused))
    _refuse_copies([r.task.run.name for r in runs])
    runs, notes = _common(runs)
    first = runs[0].task
    stages = [_stage(runs, [fit_model(r.prepared.seen) for r in runs])]
    if first.auto:
        stopped, stages = _auto(runs, stages[0], spread)
    elif first.names:
        stopped, stages = _added(runs, stages[0], chosen_effects(first.names, first.extra))
    else:
        stopped = "the base model was asked for"
    return [*_told(runs, stages, stopped, notes), *failed]


def _common(runs: list[_Run]) -> tuple[list[_Run], list[str]]:
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


def _refuse_copies(sources: Sequence[str]) -> None:
    """Raises UsageError where two of the runs are the same readings under two names."""
    seen: dict[str, str] = {}
    for source in sources:
        key = f"{sha256_of(source)}#{source.rpartition('#')[2] if '#' in source else ''}"
        if not key.startswith("#") and key in seen:
            raise UsageError(f"{source} is a copy of {seen[key]}", do="give each run once: a copy is no further evidence")
        seen[key] = source


def _only(prepared: Ready, channels: list[str]) -> Ready:
    return replace(prepared, whole=prepared.whole.only(channels), seen=prepared.seen.only(channels))


def _stage(runs: Sequence[_Run], fits: Sequence[Fit]) -> Stage:
    """Runs fitted together, and each foretold by the others."""
    found, known = fit_together(fits)
    left_out = []
    for k, run in enumerate(runs):
        others = pool([f for i, f in enumerate(fits) if i != k])
        model = type(fits[k].model)(run.first, fits[k].model.parts)
        start = fit_model(run.first, fits[k].model.parts, fits[k].values)
        fit = fit_known(model, start.local, start.shared, others)
        unseen = run.prepared.whole.used & ~run.first.used
        error = np.where(unseen, run.prepared.whole.known - fit.curve, 0.0)
        count = unseen.sum(axis=1)
        left_out.append(np.sqrt(np.where(count > 0, (error**2).sum(axis=1) / np.maximum(count, 1), np.nan)))
    return Stage(tuple(found), known, tuple(left_out))


def _with(runs: Sequence[_Run], stage: Stage, effect: Effect) -> Stage | None:
    """The model with an effect more, acting in every run as where it explains most; None where a run lacks what it needs."""
    tried = [try_add(fit, effect) for fit in stage.fits]
    found = [t for t in tried if t is not None]
    if len(found) < len(runs):
        return None
    best = max(found, key=lambda t: t.gain)
    parts: tuple[Part, ...] = best.parts
    fits = []
    for own, run in zip(found, runs, strict=True):
        if own.parts[-1].choice == parts[-1].choice and own.parts[-1].concerned == parts[-1].concerned:
            fits.append(own.fit)
        else:
            fits.append(fit_model(run.prepared.seen, parts, {**with_parts(best.fit, parts), **with_parts(own.fit, own.parts[:-1])}))
    return _stage(runs, fits)


def _error(stage: Stage) -> float:
    return pooled(np.concatenate(stage.left_out))


def _added(runs: Sequence[_Run], base: Stage, effects: Sequence[Effect]) -> tuple[str, list[Stage]]:
    stages = [base]
    for effect in effects:
        for run in runs:
            check_inputs([effect], run.prepared.whole)
        found = _with(runs, stages[-1], effect)
        if found is None:
            return f"no fit of every run was found with {effect.id}", stages
        stages.append(found)
    left = min(least_p(sensor_p_values(f)) for f in stages[-1].fits) < RULES.pattern
    return "the effects asked for are in" + ("; a pattern remains: see thermofast diagnose" if left else ""), stages


def _auto(runs: Sequence[_Run], base: Stage, spread: Spread) -> tuple[str, list[Stage]]:
    """Effects that the search names in any run, those named most often first, as long as the runs left out are foretold better."""
    named: Counter[str] = Counter()
    kinds: dict[str, Effect] = {}
    for run in runs:
        found = search_run(run.task, run.prepared, spread).discovery.named
        for part in found.parts if found is not None else ():
            named[part.id] += 1
            kinds[part.id] = part.effect
    if not named:
        return "the search names no effect in any run", [base]
    stages, said = [base], []
    for name, count in named.most_common():
        more = _with(runs, stages[-1], kinds[name])
        if more is not None and _error(more) < WORTH * _error(stages[-1]):
            stages.append(more)
            said.append(f"{name} named in {count} of {len(runs)} runs, and runs left out are foretold better with it")
        else:
            said.append(f"{name} named in {count} of {len(runs)} runs, but runs left out are foretold no better with it")
    return "; ".join(said), stages


def _told(runs: Sequence[_Run], stages: Sequence[Stage], stopped: str, notes: list[str]) -> list[Improved]:
    last, first = stages[-1], runs[0]
    past = learnt_past([run_learnt_from(f, r.prepared.whole) for f, r in zip(last.fits, runs, strict=True)])
    task = first.task
    files = {load_effect(s).id: s for s in (*task.extra, *task.names) if s.partition(":")[0].endswith(".py")}
    origins = [learnt_from(r.prepared.seen, r.task.run.name, r.prepared.readings, r.task.until_min) for r in runs]
    learnt = model_file(last.fits[0], task.run.name, first.prepared.readings, task.until_min, files, past, last.known)
    learnt = type(learnt)(**{**{n: getattr(learnt, n) for n in learnt.__struct_fields__}, "also_from": tuple(origins[1:])})
    notes = [
        *notes,
        f"rates scatter by {100.0 * past.scatter:.2g} % from run to run",
        *_stretched(past, runs),
        *_differing(last, runs),
    ]
    found = []
    for k, run in enumerate(runs):
        records: list[ImproveRecord] = []
        labels, fit_errors, ahead_errors = [], [], []
        for number, stage in enumerate(stages):
            fit = stage.fits[k]
            floor, blocks = sensor_p_values(fit), held_out_errors(fit)
            before = ids_of(stages[number - 1].fits[k].model.parts) if number else []
            effects = ids_of(fit.model.parts)
            labels.append("base model" if number == 0 else "+ " + " + ".join(e for e in effects if e not in before))
            fit_errors.append(fit.rmse)
            ahead_errors.append(stage.left_out[k])
            final = number == len(stages) - 1
            for i, channel in enumerate(fit.run.channels):
                records.append(
                    ImproveRecord(
                        run.task.run.name,
                        channel,
                        step=number,
                        effects=effects,
                        rmse_fit_c=float(fit.rmse[i]),
                        rmse_ahead_c=finite(float(blocks[i])),
                        rmse_other_runs_c=finite(float(stage.left_out[k][i])),
                        noise_c=float(fit.run.noise[i]),
                        whiteness_p=float(floor[i]),
                        parameters=parameters_of(fit, i),
                        stopped_because=stopped if final else "",
                        status="ok" if floor[i] >= RULES.pattern else "model_doubtful",
                        message="; ".join(dict.fromkeys([*notes, *run.prepared.notes_of(channel)])) if final else "",
                    )
                )
        own = [*records, *run.refused]
        name, seen = run.task.run.name, run.prepared.seen
        found.append(Improved(own, learnt if k == 0 else None, labels, fit_errors, ahead_errors, seen.noise, name, seen.channels))
    return found


def _stretched(past: Past, runs: Sequence[_Run]) -> list[str]:
    """Runs that were much faster or slower than the others, in words."""
    pairs = zip(runs, past.stretches, strict=True)
    return [
        f"{r.task.run.name} was {100.0 * abs(s):.2g} % {'faster' if s > 0.0 else 'slower'} than the others"
        for r, s in pairs
        if abs(s) > STRETCHED * SCATTER
    ]


def _differing(stage: Stage, runs: Sequence[_Run]) -> list[str]:
    """Which constants the runs disagree on, in words, those most at odds first."""
    channels, model = runs[0].prepared.seen.channels, stage.fits[0].model
    said = []
    for d in stage.known.differing[:4]:
        owner = "" if d.column.part < 0 else f"{model.parts[d.column.part].id}."
        whose = "" if d.sensor is None else f"{channels[d.sensor]} "
        p = d.column.parameter
        size = f"{100.0 * d.scatter:.2g} %" if p.log else f"{d.scatter:.2g} {p.unit}"
        said.append(f"{whose}{owner}{p.name} differs from run to run, by {size}")
    return said
