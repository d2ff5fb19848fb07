"""``diagnose``: which effect is missing, in words that a test engineer understands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from thermofast.models import Observations
from thermofast.models.effects.base import Effect
from thermofast.models.joint import Fit, Key
from thermofast.models.search.candidates import Candidate
from thermofast.models.search.discover import Discovery, Spread, discover, discover_together, total_likelihood_ratio
from thermofast.models.search.dominant import misfit
from thermofast.models.search.judge import widening
from thermofast.models.search.rules import RULES
from thermofast.models.uncertainty.disturbed import disturbed_deviations

from ..errors import ThermofastError, in_one_line
from ..experiments.next_experiment import Experiment, causes, experiment_words, next_experiments
from ..machine.modelfile import refuse_copies
from ..observing.task import (
    LoopTask,
    Ready,
    ahead_errors,
    as_told,
    check_inputs,
    failure_records,
    ids_of,
    in_order,
    not_tried,
    parameters_of,
    pooled,
    ready,
    refused_records,
)
from ..plugins.effects import chosen_effects
from ..plugins.guard import PluginError
from ..records import DiagnoseRecord, finite
from .remains import explained, shares
from .several import OneOf, common_runs, ready_runs, two_machines, unnamed
from .wording import ROOMS, fails_beyond, not_borne_out, rivals, room_instead, unlogged_room, words

Found = TypeVar("Found")


@dataclass(frozen=True)
class Told:
    """What a search said of a run, and the effects that could not be used."""

    discovery: Discovery
    broken: tuple[str, ...]


def search_run(task: LoopTask, prepared: Ready, spread: Spread = map) -> Told:
    """Search the effects asked for; one that raises is left out and named."""
    effects = chosen_effects(task.names, task.extra)
    if task.names:
        check_inputs(effects, prepared.whole)
    known = None
    if task.model is not None:
        from ..machine.learnt import carry

        known = carry(task.model.file, prepared.seen, task.run.name, task.model.source).fit
        effects = [e for e in effects if e.id not in ids_of(known.model.parts)]

    def search(some: list[Effect]) -> Discovery:
        return discover(prepared.seen, some, task.false_alarm, known=known, spread=spread)

    found, broken = _without_broken(effects, search)
    return Told(_ahead_of(found, prepared, task.until_min), broken)


@dataclass(frozen=True)
class ToldTogether:
    """What one search said of several runs, in their order, and the effects that could not be used.

    another: what to say where they look like runs of two machines; then nothing is named.
    """

    discoveries: tuple[Discovery, ...]
    broken: tuple[str, ...]
    another: str = ""


def search_together(runs: Sequence[OneOf], spread: Spread = map) -> ToldTogether:
    """One search of several runs of a machine; an effect that raises is left out and named."""
    task = runs[0].task
    effects = chosen_effects(() if task.auto else task.names, task.extra)
    for run in runs if task.names and not task.auto else ():
        check_inputs(effects, run.prepared.whole)

    def search(some: list[Effect]) -> list[Discovery]:
        return discover_together([r.prepared.seen for r in runs], some, task.false_alarm, spread)

    found, broken = _without_broken(effects, search)
    another = two_machines(found, [r.task.run.name for r in runs])
    if another:
        found = unnamed(found)
    told = tuple(_ahead_of(f, r.prepared, task.until_min) for f, r in zip(found, runs, strict=True))
    return ToldTogether(told, broken, another)


def _without_broken(effects: list[Effect], search: Callable[[list[Effect]], Found]) -> tuple[Found, tuple[str, ...]]:
    """A search with those effects that do not raise, and what to say of the others."""
    broken: list[str] = []
    while True:
        try:
            return search(effects), tuple(broken)
        except PluginError as error:
            at_fault = [e for e in effects if f"effect {e.id!r}" in str(error)]
            if not at_fault:
                raise
            broken.append(f"left out: {in_one_line(error)}")
            effects = [e for e in effects if e is not at_fault[0]]


def _ahead_of(found: Discovery, prepared: Ready, until: float | None) -> Discovery:
    """With the errors on the readings after --until, where there are any, in the place of those on blocks left out."""
    ahead = ahead_errors(found.base, prepared.whole)
    if until is None or not np.isfinite(ahead).any():
        return found
    after = None if found.named is None else ahead_errors(found.named.fit, prepared.whole)
    held = (ahead, *(ahead_errors(stage.fits[0], prepared.whole) for stage in found.stages))
    return replace(found, ahead_base=ahead, ahead=after, held=held)


def diagnose_task(task: LoopTask, spread: Spread = map) -> list[list[DiagnoseRecord]]:
    """A run diagnosed; whatever is wrong with it is a record."""
    try:
        return [_diagnose(task, spread)]
    except ThermofastError as error:
        return [failure_records(DiagnoseRecord, task, error)]


def diagnose_lost(task: LoopTask, why: str) -> list[list[DiagnoseRecord]]:
    """The record of a run whose worker died."""
    return [[DiagnoseRecord(task.run.name, "", status="failed", message=why)]]


def _diagnose(task: LoopTask, spread: Spread) -> list[DiagnoseRecord]:
    observed, prepared = ready(task)
    if prepared is None:
        return refused_records(DiagnoseRecord, task.run.name, observed)
    told = search_run(task, prepared, spread)
    after = _next(task, prepared, told.discovery, spread)
    records = _records(task, prepared, told.discovery, told.broken, after)
    return in_order(records + refused_records(DiagnoseRecord, task.run.name, observed), task.run)


def diagnose_together(tasks: Sequence[LoopTask], spread: Spread = map) -> list[list[DiagnoseRecord]]:
    """Several runs of one machine in one search: the records of each.

    Raises
    ------
    UsageError: fewer than two runs that can be used, no sensor that all of them have, or a copy among them.
    """
    runs, failed = ready_runs(tasks, DiagnoseRecord)
    refuse_copies((one.task.run.name, one.prepared.whole) for one in runs)
    runs, notes = common_runs(runs, failed)
    told = search_together(runs, spread)
    names = [r.task.run.name for r in runs]
    said = (*([told.another] if told.another else _who_shows(told.discoveries, names)), *notes, *told.broken)
    seen = [r.prepared.seen for r in runs]
    # One machine: what is open is asked of the first run that leaves anything open, beside all that were seen.
    after = next((e for r, f in zip(runs, told.discoveries, strict=True) if (e := _next(r.task, r.prepared, f, spread, seen))), [])
    records = []
    for run, found in zip(runs, told.discoveries, strict=True):
        mine = _records(replace(run.task, together=tuple(names)), run.prepared, found, said, after)
        records.append(in_order(mine + run.refused, run.task.run))
    return [*records, *failed]


def _who_shows(found: Sequence[Discovery], names: Sequence[str]) -> list[str]:
    """Of each effect named: in how many of the runs, and that it is one run's event where only one shows it."""
    who: dict[str, list[str]] = {}
    events: set[str] = set()
    for one, name in zip(found, names, strict=True):
        for part in one.named.parts if one.named is not None else ():
            who.setdefault(part.id, []).append(name)
            events |= {part.id} if part.effect.event is not None else set()
    said = []
    for effect, runs in who.items():
        if len(runs) == 1:
            said.append(f"{effect}: in {runs[0]} alone{', so an event of that run' if effect in events else ''}")
        else:
            said.append(f"{effect}: in {'all' if len(runs) == len(names) else len(runs)} of {len(names)} runs")
    return [f"of {len(names)} runs searched together: {'; '.join(said)}"] if said else [f"{len(names)} runs searched together"]


def _records(
    task: LoopTask, prepared: Ready, found: Discovery, more: Sequence[str], after: Sequence[Experiment]
) -> list[DiagnoseRecord]:
    """A record for each sensor of what a search found."""
    seen = prepared.seen
    ranking = [ranked(c, found) for c in found.singles]
    if found.named is not None:
        ranking.insert(0, ranked(found.named, found)) if len(found.named.ids) > 1 else None
    evidence, advice, status, also = verdict_of(task, found, seen)
    times = widening(found.named.fit) if found.named is not None else 1.0
    beside = disturbed_deviations(found.named.fit, found.around) if found.named is not None else None
    left, steps = misfit(found.named.fit if found.named is not None else found.base), shares(found)
    advice = f"{experiment_words(after) or NONE_OPEN}; {advice}" if task.next_experiment else advice
    records = []
    for i, channel in enumerate(seen.channels):
        verdict = own_verdict(found, i)
        event = event_of(found.named.fit, i) if found.named is not None else None
        # What befell a sensor's own readings comes before what is said of all.
        own = [f"{n.channel}: {n.text}" for n in prepared.notes if n.channel == channel]
        message = "; ".join(dict.fromkeys([*own, evidence, *more, *prepared.notes_of(channel)]))
        records.append(
            DiagnoseRecord(
                task.run.name,
                channel,
                verdict=verdict,
                also_possible=also if verdict != "none" else [],
                false_alarm_p=float(f"{found.p:.3g}"),
                event_min=event,
                rmse_base_ahead_c=finite(found.ahead_base[i]),
                rmse_ahead_c=finite(found.ahead[i]) if found.ahead is not None else None,
                explained_share=explained(found, i),
                remaining_c=float(left[i]),
                explained=steps,
                noise_c=float(found.named.fit.noise[i] if found.named and not found.partly else seen.noise[i]),
                parameters=parameters_of(found.named.fit, i, times, beside) if found.named is not None else {},
                ranking=ranking,
                next_experiment=[e.as_dict() for e in after],
                advice=advice,
                status="model_doubtful" if verdict == "unexplained" else status,
                message=message,
            )
        )
    return records


def verdict_of(task: LoopTask, found: Discovery, seen: Observations) -> tuple[str, str, str, list[str]]:
    """(evidence, advice, status, what is also possible) of a verdict, with what the rest of the record and an unlogged room say."""
    evidence, advice, status = words(found, seen, task.again)
    also = list(dict.fromkeys("+".join(sorted(c.ids)) for c in rivals(found)))
    room = unlogged_room(found, seen)
    if room:
        also += ROOMS
        steady = "if the room stood still, " if advice.startswith("add it") else ""
        advice, status = f"{room}; {steady}{advice}", "not_determined"
    instead = room_instead(found, seen)
    if instead:
        also, status = [*also, *instead], "not_determined" if status == "ok" else status
    beyond = fails_beyond(found, seen, task.until_min)
    if beyond:  # "nothing to add" would contradict it
        advice, status = beyond, "not_determined"
    refuted = not_borne_out(found, seen, task.until_min)
    if refuted:
        advice, status = refuted, "not_determined"
    left_out = not_tried(chosen_effects(() if task.auto else task.names, task.extra), seen)
    if left_out:  # of a cause that was not looked at nobody can say that another stands alone
        evidence, status = f"{evidence}; {left_out}", "not_determined" if status == "ok" else status
    return evidence, advice, status, also


def _next(
    task: LoopTask, prepared: Ready, found: Discovery, spread: Spread, before: Sequence[Observations] = ()
) -> list[Experiment]:
    """Possible experiments where they were asked for and two causes are open, or one is not determined."""
    if not task.next_experiment:
        return []
    _, _, status, _ = verdict_of(task, found, prepared.seen)
    if len(causes(found)) < 2 and (found.named is None or status != "not_determined"):
        return []
    return next_experiments(found, chosen_effects(task.names, task.extra), spread, before=before)


#: What is said of a next experiment that nobody needs.
NONE_OPEN = "next: no two causes are open that another run would part"


def own_verdict(found: Discovery, sensor: int) -> str:
    """The verdict as it concerns one sensor: shared causes, its own effects; one that none concerns may fail all the same."""
    if found.named is None:
        return found.verdict
    n = found.base.run.sensors
    mine = [p.id for p in found.named.parts if p.concerns(n)[sensor]]
    if mine:
        return "+".join(mine)
    return "unexplained" if found.base_floor[sensor] < RULES.pattern else "none"


def event_of(fit: Fit, sensor: int) -> float | None:
    """Time of the first unlogged event [min of the run] that concerns a sensor."""
    times = []
    for k, part in enumerate(fit.model.parts):
        name = part.effect.event
        if name and (k, name) in fit.values and part.concerns(fit.run.sensors)[sensor]:
            value = fit.values[Key(k, name)]
            at = float(value[sensor]) if part.effect.parameter(name).each == "sensor" else float(value)
            times.append(as_told(fit, k, name, at))
    return min(times, default=None)


def ranked(candidate: Candidate, found: Discovery) -> dict[str, Any]:
    """One line of the ranking."""
    fit, channels, n = candidate.fit, candidate.fit.run.channels, candidate.fit.run.sensors
    ways = [", ".join(p.choice.ways(channels, p.concerns(n))) for p in candidate.parts]
    who = candidate.parts[-1].concerns(n)
    first = int(np.flatnonzero(who)[0]) if who.any() else 0
    named = found.named is candidate
    return {
        "effect": "+".join(candidate.ids),
        "rmse_fit_c": finite(pooled(fit.rmse)),
        "rmse_ahead_c": finite(pooled(found.ahead)) if named and found.ahead is not None else None,
        "gain": round(total_likelihood_ratio(found.base, candidate), 1),
        "p": float(f"{candidate.p:.3g}"),
        "at_noise": candidate.at_floor,
        "identifiable": candidate.identifiable.ok,
        "why_not": candidate.identifiable.why,
        "acts": "; ".join(way for way in ways if way),
        "sensors": [c for c, w in zip(channels, who, strict=True) if w],
        "parameters": parameters_of(fit, first),
    }
