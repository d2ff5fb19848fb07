"""``improve``: add effects, refit, and watch the error fall."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, permutations
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from thermofast.models.effects.base import Effect
from thermofast.models.joint import Fit, fit_model, settled
from thermofast.models.search.candidates import Candidate, try_add
from thermofast.models.search.discover import Discovery, Spread, total_likelihood_ratio
from thermofast.models.search.heldout import held_out_errors
from thermofast.models.search.judge import least_p, sensor_p_values
from thermofast.models.search.rules import RULES

from ..errors import ThermofastError
from ..learning.foretold import as_the_machine_goes, from_first_part, with_rest
from ..learning.heat_law import HeatLaw, heat_law
from ..learning.past import learnt_past, room_left_out, run_learnt_from
from ..machine.modelfile import ModelFile, model_file, past_entry
from ..observing.observe import Observed
from ..observing.task import (
    LoopTask,
    Ready,
    ahead_errors,
    at_rest,
    check_inputs,
    failure_records,
    ids_of,
    in_order,
    parameters_of,
    pooled,
    ready,
    refused_records,
)
from ..plugins.effects import chosen_effects, load_effect
from ..plugins.files import is_file
from ..records import ImproveRecord, finite
from .diagnose import search_run, verdict_of
from .remains import remaining_words
from .wording import ROOMS, unlogged_room, words

Array = NDArray[np.float64]

#: So many effects are tried in every order.
MOST_ORDERED = 3


@dataclass(frozen=True)
class Step:
    """A model of the staircase with its errors (S,) [K]."""

    fit: Fit
    ahead: Array
    floor: Array


@dataclass(frozen=True)
class Improved:
    """Records of a run's steps, the model learnt, and what the staircase plot shows."""

    records: list[ImproveRecord]
    model: ModelFile | None = None
    labels: list[str] = field(default_factory=list)
    fit_errors: list[Array] = field(default_factory=list)
    ahead_errors: list[Array] = field(default_factory=list)
    noise: Array | None = None
    run: str = ""
    channels: tuple[str, ...] = ()


def improve_task(task: LoopTask, spread: Spread = map) -> list[Improved]:
    """A run improved; whatever is wrong with it is a record."""
    try:
        return [_improve(task, spread)]
    except ThermofastError as error:
        return [Improved(failure_records(ImproveRecord, task, error))]


def improve_lost(task: LoopTask, why: str) -> list[Improved]:
    """The record of a run whose worker died."""
    return [Improved([ImproveRecord(task.run.name, "", status="failed", message=why)])]


def _step(fit: Fit, prepared: Ready, until: float | None) -> Step:
    fit = settled(fit)
    ahead = ahead_errors(fit, prepared.whole) if until is not None else held_out_errors(fit)
    return Step(fit, ahead, sensor_p_values(fit))


def _improve(task: LoopTask, spread: Spread) -> Improved:
    observed, prepared = ready(task)
    if prepared is None:
        return Improved(refused_records(ImproveRecord, task.run.name, observed))
    base = _step(fit_model(prepared.seen), prepared, task.until_min)
    steps, stopped, notes = [base], "", prepared.notes_of()
    undecided = False
    if task.auto:
        told = search_run(task, prepared, spread)
        found = told.discovery
        notes += told.broken
        if found.named is None:
            evidence, advice, _ = words(found, prepared.seen, task.again)
            stopped = f"{found.verdict}: {evidence}. {advice}"
        else:
            steps, remark = _found_steps(prepared, task.until_min, base, found)
            room = unlogged_room(found, prepared.seen)
            notes += [room] if room else []
            _, _, status, also = verdict_of(task, found, prepared.seen)
            undecided = status == "not_determined"
            stopped = f"{remark}{_why_enough(found)}{or_else([a for a in also if not (room and a in ROOMS)])}"
    elif task.names:
        effects = chosen_effects(task.names, task.extra)
        check_inputs(effects, prepared.whole)
        added = _all_added(base.fit, effects)
        if added is None:
            stopped = "no fit was found with these effects"
        else:
            steps, remark = _staircase(prepared, task.until_min, base, added)
            left = least_p(steps[-1].floor) < RULES.pattern
            stopped = remark + (
                "the effects asked for are in; a pattern remains: see thermofast diagnose"
                if left
                else "the effects asked for are in, and every sensor is down to its noise"
            )
            if not added.identifiable.ok:
                notes.append(f"not determined by this record: {added.identifiable.why}")
    else:
        law = followed(base.fit)
        steps += [] if law is None else [_step(law.candidate.fit, prepared, task.until_min)]
        stopped = asked_for_base(law)
    return _improved(task, observed, prepared, steps, stopped, [*notes, *at_rest(steps[-1].fit)], undecided)


def followed(fit: Fit) -> HeatLaw | None:
    """How the heat of a driven fit surely follows its drive, where that is not in proportion; mostly None."""
    law = heat_law(fit) if fit.run.heat is not None else None
    return law if law is not None and not law.may_be_none else None


def asked_for_base(law: HeatLaw | None) -> str:
    """Why no effect was added but the law by which the heat follows its drive, without which all rates would be off."""
    return "the base model was asked for" + (f"; {law.words}, and not in proportion: that is in" if law is not None else "")


def _found_steps(prepared: Ready, until: float | None, base: Step, found: Discovery) -> tuple[list[Step], str]:
    """The steps by which effects were found, or an order of those that were found together."""
    assert found.named is not None
    if not found.stages:
        return _staircase(prepared, until, base, found.named)
    return [base, *(_step(stage.fits[0], prepared, until) for stage in found.stages)], ""


def _why_enough(found: Discovery) -> str:
    """By which rule no further effect is added."""
    assert found.named is not None
    names = " and ".join(found.named.ids)
    if not found.partly:
        return f"every sensor is down to its noise with {names}; nothing more would be told from chance"
    return (
        f"no further effect explains what remains ({remaining_words(found.named.fit)}) better than an unknown disturbance would, "
        "or makes the error on readings left out fall"
    )


def or_else(also: Sequence[str]) -> str:
    """What to say of models that do as well: a cause is named only where it stands alone."""
    return f"; as good: {', '.join(also)}: see thermofast diagnose for how to tell them apart" if also else ""


def _all_added(base: Fit, effects: list[Effect]) -> Candidate | None:
    """Effects added one after the other, in the order that gains most; the order in which they were named says nothing.

    Up to MOST_ORDERED all orders are tried, of more that effect first which gains most by itself.
    """
    if len(effects) > MOST_ORDERED:
        found = [try_add(base, effect) for effect in effects]
        gains = [-np.inf if one is None else total_likelihood_ratio(base, one) for one in found]
        first = int(np.argmax(gains))
        return None if (one := found[first]) is None else _all_added(one.fit, [*effects[:first], *effects[first + 1 :]])
    best: Candidate | None = None
    for order in permutations(effects):
        fit, one = base, None
        for effect in order:
            one = try_add(fit, effect)
            if one is None:
                break
            fit = one.fit
        if one is not None and (best is None or total_likelihood_ratio(base, one) > total_likelihood_ratio(base, best)):
            best = one
    return best


def _staircase(prepared: Ready, until: float | None, base: Step, final: Candidate) -> tuple[list[Step], str]:
    """Steps to the final model in an order in which the error ahead falls; says so where there is none."""
    last = _step(final.fit, prepared, until)
    effects = [p.effect for p in final.parts]
    if len(effects) < 2:
        return [base, last], ""
    best: tuple[int, float, list[Step]] | None = None
    for order in permutations(effects) if len(effects) <= MOST_ORDERED else [tuple(effects)]:
        steps, fit = [base], base.fit
        for effect in order[:-1]:
            found = try_add(fit, effect)
            if found is None:
                break
            fit = found.fit
            steps.append(_step(fit, prepared, until))
        if len(steps) < len(effects):
            continue
        steps.append(last)
        errors = [pooled(s.ahead) for s in steps]
        rises = sum(b >= a for a, b in pairwise(errors))
        if best is None or (rises, errors[1]) < best[:2]:
            best = rises, errors[1], steps
    if best is None:
        return [base, last], "the effects only work together; "
    if best[0]:
        return best[2], "in no order does the error fall at every step: only together do these effects help; "
    return best[2], ""


def status_of(down: bool, searched: bool, undecided: bool) -> str:
    """Of a sensor that is down to its noise or not, at a step that a search made or not."""
    if down:
        return "not_determined" if searched and undecided else "ok"
    return "partly_explained" if searched else "model_doubtful"


def _improved(
    task: LoopTask, observed: Observed, prepared: Ready, steps: list[Step], stopped: str, notes: list[str], undecided: bool
) -> Improved:
    """undecided: whether what was found is one cause of several that do as well."""
    seen = prepared.seen
    learnt, doubt = _learnt(task, prepared, steps)
    notes = [*notes, *doubt]
    records: list[Any] = []
    labels = []
    for number, step in enumerate(steps):
        before = ids_of(steps[number - 1].fit.model.parts) if number else []
        effects = sorted(ids_of(step.fit.model.parts), key=lambda e: (e not in before, before.index(e) if e in before else 0))
        new = [e for e in effects if e not in before]
        labels.append("base model" if number == 0 else "+ " + " + ".join(new or effects))
        final = number == len(steps) - 1
        for i, channel in enumerate(seen.channels):
            ahead = step.ahead[i]
            records.append(
                ImproveRecord(
                    task.run.name,
                    channel,
                    step=number,
                    effects=effects,
                    rmse_fit_c=float(step.fit.rmse[i]),
                    rmse_ahead_c=finite(ahead),
                    noise_c=float(seen.noise[i]),
                    whiteness_p=float(step.floor[i]),
                    parameters=parameters_of(step.fit, i),
                    stopped_because=stopped if final else "",
                    status=status_of(step.floor[i] >= RULES.pattern, number > 0 and task.auto, undecided),
                    message="; ".join(dict.fromkeys(notes)) if final else "",
                )
            )
    records += refused_records(ImproveRecord, task.run.name, observed)
    ordered = [r for s in range(len(steps)) for r in in_order([x for x in records if x.step == s], task.run)]
    return Improved(
        ordered,
        learnt,
        labels,
        [s.fit.rmse for s in steps],
        [s.ahead for s in steps],
        seen.noise,
        task.run.name,
        seen.channels,
    )


def _learnt(task: LoopTask, prepared: Ready, steps: list[Step]) -> tuple[ModelFile, list[str]]:
    """What the last step is worth for the machine's next runs, and what to say of it.

    Effects that stand for something else foretell not even the run they were learnt from: its shape then stands for them.
    """
    base, last = steps[0].fit, steps[-1].fit
    files = {load_effect(s).id: s for s in (*task.extra, *task.names) if is_file(s)}
    past = learnt_past([run_learnt_from(last, prepared.whole)])
    learnt = model_file(last, task.run.name, prepared.readings, task.until_min, files, past)
    if not learnt.effects:
        return learnt, []
    events = {k: p.effect.id for k, p in enumerate(last.model.parts) if p.effect.event}
    bare, own = as_the_machine_goes(base, last, prepared, task, events)
    by = from_first_part(learnt, [own], [bare])
    room = room_left_out(last)
    if not by.shape and not room:
        kept = replace(past, factors=tuple((turn, by.wider * factor) for turn, factor in past.factors))
        kept = with_rest(kept, learnt_past([bare]))
        return msgspec.structs.replace(learnt, past=past_entry(kept)), []
    entry = past_entry(learnt_past([bare]), True, tuple(dict.fromkeys(events.values())))
    missed = "from its first part these effects do not foretell the end of the very run"
    why = "the logged surroundings moved and are in none of these effects, which hold their part, too" if room else missed
    return msgspec.structs.replace(learnt, past=entry), [f"{why}: identify uses the shape of its rise instead"]
