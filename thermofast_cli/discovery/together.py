"""``improve --together``: several runs of one machine in one fit, each left out in turn."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from thermofast.models.effects.base import Effect
from thermofast.models.imperfection import SCATTER, Past
from thermofast.models.joint import Fit, Key, Part, fit_model, with_parts
from thermofast.models.search.candidates import try_add
from thermofast.models.search.discover import Discovery, Spread, total_likelihood_ratio
from thermofast.models.search.heldout import held_out_errors
from thermofast.models.search.judge import least_p, sensor_p_values
from thermofast.models.search.rules import RULES
from thermofast.models.uncertainty.pooled import Pooled, fit_known, fit_together, pool

from ..errors import rounded
from ..learning.foretold import as_the_machine_goes, from_first_part, with_rest
from ..learning.past import learnt_past, run_learnt_from
from ..machine.modelfile import learnt_from, model_file, past_entry, refuse_copies
from ..observing.task import LoopTask, ahead_errors, as_told, check_inputs, ids_of, parameters_of, pooled
from ..plugins.effects import chosen_effects, load_effect
from ..plugins.files import is_file
from ..records import ImproveRecord, finite
from .diagnose import search_run, search_together
from .improve import Improved, asked_for_base, followed, or_else, status_of
from .several import OneOf, common_runs, ready_runs
from .wording import rivals

Array = NDArray[np.float64]

#: The search's effects stay where the error on runs left out falls to this share.
WORTH = 0.9
#: What no run by itself may name stays where the error on runs left out falls to this share: to half, as is asked of a cause.
HALVED = 0.5
NOTHING = "the search names no effect in any run"
#: So many effects are tried there, those first that explain most.
MOST_NEAR = 3
#: Share of its time by which an event may come earlier or later in other runs and is still of the machine, or of its test.
SAME_TIME = 0.1
#: A run whose rates lie this many usual scatters off is named.
STRETCHED = 2.0


@dataclass(frozen=True)
class Stage:
    """A model of all runs: a fit each, the machine's constants, and the errors (S,) [K] of each run when the others foretell it."""

    fits: tuple[Fit, ...]
    known: Pooled
    left_out: tuple[Array, ...]


def improve_together(tasks: Sequence[LoopTask], spread: Spread = map) -> list[Improved]:
    """An :class:`Improved` for each run, the first with the model of them all.

    Raises
    ------
    UsageError: fewer than two runs that can be used, or no sensor that all of them have.
    """
    runs, rest = ready_runs(tasks, ImproveRecord)
    failed = [Improved(records) for records in rest]
    refuse_copies((one.task.run.name, one.prepared.whole) for one in runs)
    runs, notes = common_runs(runs, rest)
    first = runs[0].task
    stages = [_stage(runs, [fit_model(r.prepared.seen) for r in runs])]
    own: dict[int, list[str]] = {}
    undecided = False
    if first.auto:
        stopped, stages, own, undecided = _auto(runs, stages[0], spread)
    elif first.names:
        stopped, stages = _added(runs, stages[0], chosen_effects(first.names, first.extra))
    else:
        laws = [law for fit in stages[0].fits if (law := followed(fit)) is not None]
        more = _with(runs, stages[0], laws[0].candidate.parts[-1].effect) if laws else None
        stages += [] if more is None else [more]
        stopped = asked_for_base(laws[0] if more is not None else None)
    return [*_told(runs, stages, stopped, notes, own, undecided), *failed]


def _stage(runs: Sequence[OneOf], fits: Sequence[Fit]) -> Stage:
    """Runs fitted together, and each foretold by the others."""
    found, known = fit_together(fits)
    left_out = []
    for k, run in enumerate(runs):
        others = pool([f for i, f in enumerate(fits) if i != k])
        model = type(fits[k].model)(run.first, fits[k].model.parts)
        start = fit_model(run.first, fits[k].model.parts, fits[k].values)
        fit = fit_known(model, start.local, start.shared, others)
        left_out.append(ahead_errors(fit, run.prepared.whole))
    return Stage(tuple(found), known, tuple(left_out))


def _with(runs: Sequence[OneOf], stage: Stage, effect: Effect) -> Stage | None:
    """The model with an effect more, acting in every run as where it explains most; None where a run lacks what it needs."""
    tried = [try_add(fit, effect) for fit in stage.fits]
    found = [t for t in tried if t is not None]
    if len(found) < len(runs):
        return None
    best = max(found, key=lambda t: t.gain)
    parts: tuple[Part, ...] = best.parts
    fits = []
    for own, run in zip(found, runs, strict=True):
        if own.parts[-1].choice.acts_as(parts[-1].choice) and own.parts[-1].concerned == parts[-1].concerned:
            fits.append(own.fit)
        else:
            fits.append(fit_model(run.prepared.seen, parts, {**with_parts(best.fit, parts), **with_parts(own.fit, own.parts[:-1])}))
    return _stage(runs, fits)


def _error(stage: Stage) -> float:
    return pooled(np.concatenate(stage.left_out))


def _added(runs: Sequence[OneOf], base: Stage, effects: Sequence[Effect]) -> tuple[str, list[Stage]]:
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


def _auto(runs: Sequence[OneOf], base: Stage, spread: Spread) -> tuple[str, list[Stage], dict[int, list[str]], bool]:
    """Effects that the search names, as long as the runs left out are foretold better; by its number each run's own events; and
    whether another model does as well.
    """
    named: dict[str, tuple[Effect, int]] = {}
    found = search_together(runs, spread)
    if found.another:
        return found.another, [base], {}, False
    discoveries = found.discoveries if any(d.named is not None for d in found.discoveries) else _each(runs, spread)
    for one in discoveries:
        for part in one.named.parts if one.named is not None else ():
            named[part.id] = part.effect, named.get(part.id, (part.effect, 0))[1] + 1
    own: dict[int, list[str]] = {}
    for k, one in enumerate(discoveries):
        for part in one.named.parts if one.named is not None else ():
            if part.effect.event and named[part.id][1] == 1:
                own.setdefault(k, []).append(part.id)
    stages, said = [base], []
    why = {name: (effect, f"{name} named in {count} of {len(runs)} runs") for name, (effect, count) in named.items()}
    order = [why[name] for name in sorted(named, key=lambda name: -named[name][1])]
    # A room that is logged needs no right to be named: the runs left out say whether it is at work.
    rooms = chosen_effects((), runs[0].task.extra) if all(run.prepared.whole.ambient for run in runs) else ()
    order = [(e, f"{e.id} is logged") for e in rooms if e.follows_ambient and e.id not in named] + order
    for effect, told in order:
        more = _with(runs, stages[-1], effect)
        if more is not None and _error(more) < WORTH * _error(stages[-1]):
            stages.append(more)
            said.append(f"{told}, and runs left out are foretold better with it")
        elif effect.id in named:
            said.append(f"{told}, but runs left out are foretold no better with it")
    if not named:
        near, by, as_good = _nearest(runs, stages[-1], discoveries)
        stages += near
        # No search gives the right to its name: it may stand for what goes like it in the next run, too.
        return "; ".join([NOTHING + by, *said]) + or_else(as_good), stages, own, bool(near)
    known = {p.effect.id: p.effect for one in discoveries for c in one.also for p in c.parts}
    before = stages
    stages, others = _or_instead(runs, before, _swaps(discoveries), known)
    open_, worse = ([ids for ids, as_good in others if as_good == way] for way in (True, False))
    if stages is not before:
        taken = "+".join(ids_of(stages[-1].fits[0].model.parts))
        said.append(f"{taken}, which explains each run as well, foretells runs left out far better and is taken in its place")
    elif worse:
        said.append(f"with {' or '.join(worse)}, which would explain each run as well, runs left out are foretold worse")
    return "; ".join(said) + or_else(open_), stages, own, bool(open_)


def _nearest(runs: Sequence[OneOf], before: Stage, discoveries: Sequence[Discovery]) -> tuple[list[Stage], str, list[str]]:
    """What explains most of all runs and is no event, where it foretells the runs left out far better: the model with it, what to
    say of it, and what does as well; empty where nothing does.

    No run by itself gives the right to its name: that an effect learnt from some runs foretells another is evidence of its own.
    """
    gains: dict[str, list[float]] = {}
    effects: dict[str, Effect] = {}
    for one in discoveries:
        for c in one.singles:
            gains.setdefault(c.ids[0], []).append(total_likelihood_ratio(one.base, c))
            effects[c.ids[0]] = c.parts[0].effect
    there = {part.id for part in before.fits[0].model.parts}
    likely = sorted((i for i in gains if len(gains[i]) == len(runs) and i not in there), key=lambda i: -sum(gains[i]))
    near = [effects[i] for i in likely if not effects[i].event and effects[i].scope != "one"][:MOST_NEAR]
    tried = {e.id: more for e in near if (more := _with(runs, before, e)) is not None}
    errors = {i: _error(stage) / _error(before) for i, stage in tried.items()}
    best = min(errors, key=lambda i: errors[i], default="")
    if not best or not errors[best] < HALVED:
        return [], "", []
    told = f", but with {best} the error on runs left out falls to {rounded(100.0 * errors[best])} % of what it was"
    return [tried[best]], told, [i for i, e in errors.items() if i != best and HALVED * e <= errors[best]]


def _swaps(discoveries: Sequence[Discovery]) -> list[tuple[frozenset[str], frozenset[str]]]:
    """What does as well in every run that names an effect: the effects it stands for, and those in their place."""
    found: list[list[tuple[frozenset[str], frozenset[str]]]] = []
    for one in discoveries:
        if one.named is not None:
            named = frozenset(one.named.ids)
            found.append([(named - set(c.ids), frozenset(c.ids) - named) for c in rivals(one)])
    shared = found[0] if found else []
    return [(out, into) for out, into in shared if into and all((out, into) in other for other in found[1:])]


def _or_instead(
    runs: Sequence[OneOf],
    stages: list[Stage],
    swaps: Sequence[tuple[frozenset[str], frozenset[str]]],
    known: dict[str, Effect],
) -> tuple[list[Stage], list[tuple[str, bool]]]:
    """The stages of the model to take, and of each other one that explains every run as well: its effects, and whether it foretells
    the runs left out as well, too. Another than what the search named is taken where it does so far better.
    """
    there = {part.id: part.effect for part in stages[-1].fits[0].model.parts}
    ways = {"+".join(sorted(there)): stages}
    for out, into in swaps:
        if not out <= there.keys():
            continue
        way: list[Stage] | None = stages[:1]
        for effect in [e for i, e in there.items() if i not in out] + [known[i] for i in sorted(into)]:
            more = _with(runs, way[-1], effect) if way else None
            way = [*way, more] if way and more is not None else None
        if way:
            ways.setdefault("+".join(sorted(ids_of(way[-1].fits[0].model.parts))), way)
    errors = {ids: _error(way[-1]) for ids, way in ways.items()}
    best = min(errors, key=lambda ids: errors[ids] * (HALVED if ways[ids] is stages else 1.0))
    return ways[best], [(ids, HALVED * e <= errors[best]) for ids, e in errors.items() if ids != best]


def _each(runs: Sequence[OneOf], spread: Spread) -> list[Discovery]:
    """Each run searched by itself, where together they show nothing."""
    return [search_run(run.task, run.prepared, spread).discovery for run in runs]


def _scattering(past: Past) -> str:
    """How far rates lay apart in these runs, and what is counted on in the next one, which few runs say little of."""
    seen = math.sqrt(sum(s * s for s in past.stretches) / max(len(past.stretches) - 1, 1))
    told = f"rates scattered by {rounded(100.0 * seen)} % from run to run"
    return f"{told}; {rounded(100.0 * past.scatter)} % is counted on, as machines mostly do, until more runs are known"


def _told(
    runs: Sequence[OneOf],
    stages: Sequence[Stage],
    stopped: str,
    notes: list[str],
    alone: dict[int, list[str]],
    undecided: bool,
) -> list[Improved]:
    """undecided: whether another model does as well as the last one."""
    last, first = stages[-1], runs[0]
    # A run with an event of its own, which the others have not, says nothing of how the machine goes without.
    plain = [k for k in range(len(runs)) if k not in alone or len(alone) == len(runs)]
    plain = plain if len(plain) > 1 else list(range(len(runs)))
    notes = [
        *notes,
        *(f"{' and '.join(ids)}: an event of {runs[k].task.run.name} alone{_left(k, plain)}" for k, ids in alone.items()),
    ]
    of_past = plain if len(stages) == 1 else range(len(runs))
    past = learnt_past([run_learnt_from(last.fits[k], runs[k].prepared.whole) for k in of_past])
    task = first.task
    files = {load_effect(s).id: s for s in (*task.extra, *task.names) if is_file(s)}
    origins = [learnt_from(r.prepared.seen, r.task.run.name, r.prepared.readings, r.task.until_min) for r in runs]
    learnt = model_file(last.fits[0], task.run.name, first.prepared.readings, task.until_min, files, past, last.known)
    learnt = msgspec.structs.replace(learnt, also_from=tuple(origins[1:]))
    if len(stages) > 1:
        events = _at_other_times([last.fits[k] for k in plain])
        as_of = [as_the_machine_goes(stages[0].fits[k], last.fits[k], runs[k].prepared, runs[k].task, events) for k in plain]
        bare = [past_run for past_run, _ in as_of]
        by = from_first_part(learnt, [own for _, own in as_of], bare)
        wider = replace(past, factors=tuple((t, by.wider * f) for t, f in past.factors))
        kept = learnt_past(bare) if by.shape else with_rest(wider, learnt_past(bare))
        came = tuple(events.values()) if by.shape else ()
        learnt = msgspec.structs.replace(learnt, past=past_entry(kept, by.shape, came))
        told = "the shape of the other runs foretells a run better from its first part than the effects: identify uses it"
        notes = [*notes, told] if by.shape else notes
    notes = [
        *notes,
        *_room_left_out(last, runs),
        _scattering(past),
        *_stretched(past, [runs[k] for k in of_past]),
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
                        status=status_of(bool(floor[i] >= RULES.pattern), bool(number and task.auto), undecided),
                        message="; ".join(dict.fromkeys([*notes, *run.prepared.notes_of(channel)])) if final else "",
                    )
                )
        own = [*records, *run.refused]
        name, seen = run.task.run.name, run.prepared.seen
        found.append(Improved(own, learnt if k == 0 else None, labels, fit_errors, ahead_errors, seen.noise, name, seen.channels))
    return found


def _at_other_times(fits: Sequence[Fit]) -> dict[int, str]:
    """Parts of the model that are events that came at another time in each run, so none of the machine's course; and when."""
    found = {}
    for k, part in enumerate(fits[0].model.parts):
        if part.effect.event in {p.name for p in part.effect.active(part.choice)}:
            times = [float(np.median(fit.values[Key(k, part.effect.event)])) for fit in fits]
            if max(times) - min(times) > SAME_TIME * float(np.mean(times)):
                told = [as_told(fit, k, part.effect.event, t) for t, fit in zip(times, fits, strict=True)]
                found[k] = f"{part.id} (at {rounded(min(told))} to {rounded(max(told))} min)"
    return found


def _left(run: int, plain: Sequence[int]) -> str:
    return "" if run in plain else ", and its course is left out of the machine's"


def _room_left_out(stage: Stage, runs: Sequence[OneOf]) -> list[str]:
    """What to say where a pattern remains, and a room that all runs log is in no effect of the model: it passes for other rates."""
    parts = stage.fits[0].model.parts
    rooms = [e.id for e in chosen_effects((), runs[0].task.extra) if e.follows_ambient]
    told = any(p.effect.follows_ambient for p in parts) or not all(run.prepared.whole.ambient for run in runs)
    if told or not rooms or min(least_p(sensor_p_values(f)) for f in stage.fits) >= RULES.pattern:
        return []
    ids = ",".join([*ids_of(parts), rooms[0]])
    return [f"the surroundings are logged and not in the model, and what they did passes for other rates: try --add {ids}"]


def _stretched(past: Past, runs: Sequence[OneOf]) -> list[str]:
    """Runs that were much faster or slower than the others, in words."""
    others, beyond = ("the others", len(runs) / (len(runs) - 1.0)) if len(runs) > 2 else ("the other", 2.0)
    return [  # stretches are logarithms, against the mean of all
        f"by this model {r.task.run.name} was {rounded(100.0 * abs(math.expm1(beyond * s)))} % "
        f"{'faster' if s > 0.0 else 'slower'} than {others}"
        for r, s in zip(runs, past.stretches, strict=True)
        if abs(s) > STRETCHED * SCATTER
    ]


def _differing(stage: Stage, runs: Sequence[OneOf]) -> list[str]:
    """Which constants the runs disagree on, in words, those most at odds first."""
    channels, model = runs[0].prepared.seen.channels, stage.fits[0].model
    said = []
    for d in stage.known.differing[:4]:
        owner = "" if d.column.part < 0 else f"{model.parts[d.column.part].id}."
        whose = "" if d.sensor is None else f"{channels[d.sensor]} "
        p = d.column.parameter
        size = f"{rounded(100.0 * d.scatter)} %" if p.log else f"{rounded(d.scatter)} {p.unit}"
        said.append(f"{whose}{owner}{p.name} differs from run to run, by {size}")
    return said
