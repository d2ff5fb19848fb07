"""Past runs of a machine: learnt from fits of them, and made ready for a run at hand."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermofast.models import Observations
from thermofast.models.coloured import fit_disturbed
from thermofast.models.effects.base import Effect
from thermofast.models.imperfection import (
    COMPLETE,
    FAST_MODES,
    GRID,
    GUESSED_NODES,
    SLOW_MODES,
    TYPICAL,
    Part,
    Past,
    PastRun,
    Rise,
    Searched,
    SensorShape,
    ends_alone,
    learn_past,
    pilot,
    widths_left_out,
)
from thermofast.models.joint import LEVEL, RATE, SINK, Fit, Key, fit_model
from thermofast.models.search.candidates import Candidate
from thermofast.models.search.discover import Discovery, discover
from thermofast.models.search.dominant import likeliest, misfit_power
from thermofast.models.search.judge import sensor_p_values
from thermofast.models.search.logged import follows_machine
from thermofast.models.search.mutual import both_ways
from thermofast.models.search.rules import RULES

from ..errors import ThermofastError, UsageError, in_one_line, listed, rounded
from ..machine.learnt import carry, changed_files, check_effects, without_neighbours
from ..machine.model import Model
from ..machine.modelfile import ModelFile, past_of
from ..observing.observe import FEWEST_READINGS, observe
from ..observing.task import LoopTask, Ready, ids_of, ready
from ..plugins.effects import chosen_effects
from ..plugins.guard import failed_status
from .heat_law import heat_law
from .jumps import cycles, last_change, longest_stay, stays
from .rise import rises_of

#: Rates outside these over the record's length say nothing of the machine.
RATES = 0.3, 200.0
#: Readings of a sensor below which a run says nothing of it.
FEWEST = 8
#: Deviation of the log rate about that of a fit to the same readings, where nothing else is known of it.
GUESS = 0.6
#: Of what a sensor moved, what a drive must have brought to be followed.
LEAST_HEAT = 0.1
#: Share of its heat (1 sd) that a sensor may follow at another rate than that of the fit: of a drive that is logged; of one that
#: never stayed for STAYED time constants, so that slower parts of the machine look like another power of the drive; of a load or a
#: cooling that changed on the way, of which one rate was told from what came before and after together.
DRIVEN, RESTLESS, AT_EVENTS = 0.03, 0.15, 0.1
STAYED = 2.0
SINK_KEY = Key(-1, SINK.name)
#: Share of the rise from which on what the readings of past runs alone leave open of their end is told.
OPEN = 0.05
#: A logged room that moved by more than this share of the rise, and so many times its own noise, is in what was learnt beside it.
ROOM_MOVED, NOISES_MOVED = 0.03, 5.0
#: Share of the way to its end, by its own model, below which what a run ended at says little of that end.
REACHED = 0.8
#: Share of the rest of that way by which a limit may be off to either side, and the same of sensors that are linked: together they
#: settle as slowly as no parameter of one of them tells.
REST, REST_OF_LINKED = 0.5, 1.0


@dataclass(frozen=True)
class Knowledge:
    """What a model says of a run at hand, or why it cannot say anything.

    notes are for every sensor of it; uses_room: an effect of the model accounts for the surroundings that are logged; strange are
    sensors that do not follow the drive; found: how many effects were added.
    """

    run: str
    past: Past | None = None
    notes: tuple[str, ...] = ()
    uses_room: bool = False
    failed: str = ""
    status: str = "unreadable"
    strange: tuple[str, ...] = ()
    found: int = 0


def run_learnt_from(fit: Fit, whole: Observations | None = None) -> PastRun:
    """A fitted run as one to learn from."""
    run = fit.run
    read = [i for i in range(run.sensors) if run.used[i].sum() >= FEWEST]
    plain = not fit.model.parts and run.heat is None
    rises = {} if plain else rises_of(fit, whole or run)
    room = _room(fit)
    parts, log_rates = [], []
    for i in read:
        used = run.used[i]
        time, reading = run.time[used], run.reading[i][used][None]
        noise = np.array([run.noise[i] / np.sqrt(np.median(run.weight[i][used]))])
        parts.append(Part(time, reading, noise, run.resolution[i : i + 1], None if room is None else room[used]))
        rate, span = float(fit.values[RATE][i]), float(time[-1] - time[0])
        known = not plain or RATES[0] < rate * span < RATES[1]
        log_rates.append(np.log(rate if known else 1.0 / float(pilot(time, reading)[0])))
    left = np.ones(run.sensors) if plain else sensor_p_values(fit)
    unexplained = tuple(run.channels[i] for i in read if left[i] < RULES.pattern)
    alone = ends_alone(parts, np.array(log_rates), TYPICAL) if plain and parts else np.zeros((0, 4))
    return PastRun(tuple(run.channels[i] for i in read), tuple(parts), np.array(log_rates), rises, unexplained, alone)


def learnt_past(runs: Sequence[PastRun]) -> Past:
    """From runs that are fitted; how wide intervals must be is learnt from three on."""
    return widths_left_out(learn_past(runs, TYPICAL), runs, TYPICAL)


def _room(fit: Fit) -> np.ndarray | None:
    """The surroundings that are logged, where no effect of the model accounts for them and they do not move with the machine."""
    run = fit.run
    if not run.ambient or _follows_room(fit):
        return None
    room = np.mean(list(run.ambient.values()), axis=0)
    seen = run.used.any(axis=0)
    return None if follows_machine(run.filled[:, seen], room[seen]) else room


def room_left_out(fit: Fit) -> bool:
    """Whether the effects of a fit were learnt beside a logged room that moved and is in none of them: they hold its part, too."""
    room = _room(fit) if fit.model.parts else None
    if room is None:
        return False
    low, high = np.quantile(room, [0.05, 0.95])
    rises = [float(np.ptp(fit.curve[i])) for i in range(fit.run.sensors) if fit.run.used[i].any()]
    return bool(high - low > max(ROOM_MOVED * float(np.median(rises)), NOISES_MOVED * fit.run.ambient_noise))


def _follows_room(fit: Fit) -> bool:
    """Whether an effect of the model accounts for the logged surroundings; one may follow a coolant instead."""
    parts = [p for p in fit.model.parts if p.effect.follows_ambient]
    return any(p.choice.constants.get("column") not in fit.run.inputs for p in parts)


def knowledge(task: LoopTask) -> list[Knowledge]:
    """What the model of a task says of its run; trouble is told, not raised."""
    try:
        return [_knowledge(task)]
    except ThermofastError as error:
        return [Knowledge(task.run.name, failed=in_one_line(error), status=failed_status(error))]


def knowledge_lost(task: LoopTask, why: str) -> list[Knowledge]:
    """A run whose worker died."""
    return [Knowledge(task.run.name, failed=why, status="failed")]


def _too_few(prepared: Ready | None) -> bool:
    return prepared is None or int(prepared.seen.used.sum(axis=1).max()) < FEWEST_READINGS


def _guessed(task: LoopTask) -> Knowledge:
    """Of a run of whose machine nothing is known: heat that follows a logged column, effects that its own readings show."""
    name = task.run.name
    _, prepared = ready(task)
    if prepared is None or _too_few(prepared):
        return Knowledge(name, notes=(f"too few readings for {_wishes(task)}: identified without",))
    seen, whole = prepared.seen, prepared.whole
    notes: list[str] = []
    strange: list[str] = []
    if task.drive is not None:
        column = task.run.inputs[task.drive]
        until = task.run.time_s <= 60.0 * (task.start_min + float(seen.time[seen.last])) + 1e-6
        logged = column[until & np.isfinite(column)]
        if len(logged) < 2 or stays(logged):
            when = "while it was read" if until.all() or task.until_min is None else f"before {task.until_min:g} min"
            how = "never changes" if not len(logged) or float(np.ptp(logged)) == 0.0 else "changes by no more than its noise"
            return Knowledge(name, notes=(f"{task.drive} {how} {when}, and it is not counted",))
        mine, strange = followers(task, seen)
        if not mine:
            return Knowledge(name, Past({}, guessed=True), strange=tuple(strange))
        seen, whole = seen.only(mine), whole.only(mine)
        notes.append(f"with {task.drive} as the heat, as last logged (the mean of whole cycles where it cycles)")
        missing = float(np.mean(~np.isfinite(column[until])))
        notes += [f"{rounded(100.0 * missing)} % of {task.drive} is missing and was filled by straight lines"] if missing else []
    fit = fit_model(seen)
    searched: Searched = ""
    unsure = False
    if task.auto:
        found = discover(seen, chosen_effects((), task.extra))
        stage = likeliest(found.base, found.singles, RULES.false_alarm) if found.verdict == "unexplained" else None
        likely = None if stage is None else stage.named.shown[0].candidate
        notes.append(_looked_for(found, likely))
        added, unsure = found.named or likely, found.named is None and likely is not None
        if added is None and task.drive is None:
            return Knowledge(name, notes=tuple(notes))
        fit = found.base
        if added is not None:
            fit = fit_disturbed(both_ways(added.fit))
            searched = "all" if any(part.effect.scope == "run" for part in added.parts) else "each"
    elif task.drive is not None:
        followed, told = _as_it_follows(fit)
        if followed is None:
            return Knowledge(name, notes=tuple(told))
        fit, notes = followed, [*notes, *told]
    log_rates = np.log(fit.values[RATE])
    count = len(SLOW_MODES) + len(FAST_MODES) + 1
    none, little = np.zeros(count), 1e-12 * np.eye(count)
    shapes = {c: SensorShape(float(b), GUESS, none, little) for c, b in zip(fit.run.channels, log_rates, strict=True)}
    stayed = _stayed(fit)
    rises = rises_of(fit, whole, GUESSED_NODES, task.fitted_min, _other_modes(fit, stayed))
    past = Past(
        shapes,
        scatter=0.0,
        guessed=True,
        rises=rises,
        searched=searched,
        unsure=unsure,
        stayed_min=stayed,
        changed_min=_changed(fit, task.start_min),
        cycles=any(cycles(fit.run.time[: len(c)], c, 1.0 / float(np.median(fit.values[RATE]))) for c in _heats(fit)),
    )
    return Knowledge(name, past, tuple(notes), _follows_room(fit), strange=tuple(strange), found=len(fit.model.parts))


def _heats(fit: Fit) -> list[np.ndarray]:
    """Logged columns (n,) that bring heat, over the readings used."""
    run = fit.run
    columns = [run.inputs[c] for p in fit.model.parts if (c := p.choice.constants.get("column", "")) in run.inputs]
    if run.heat is not None:
        columns.append(run.heat if run.driven is None else run.driven)
    read = int(np.flatnonzero(run.used.any(axis=0))[-1]) + 1
    return [column[:read] for column in columns]


def _stayed(fit: Fit) -> float:
    """Minutes that a logged column which brings heat stayed where it was, at most; inf where none jumps."""
    return min((longest_stay(fit.run.time[: len(column)], column) for column in _heats(fit)), default=float("inf"))


def _changed(fit: Fit, start_min: float) -> float:
    """When [min of the run] such a column jumped last; -inf where none does."""
    return max((start_min + last_change(fit.run.time[: len(c)], c) for c in _heats(fit)), default=-float("inf"))


def _other_modes(fit: Fit, stayed: float) -> float:
    """Share of its heat that a sensor may follow faster or slower than the fit says, where the heat was seen to change; stayed:
    minutes that it stayed where it was, at most.
    """
    if any(part.effect.event for part in fit.model.parts):
        return AT_EVENTS
    if fit.run.heat is None:
        return 0.0
    return RESTLESS if stayed * float(np.median(fit.values[RATE])) < STAYED else DRIVEN


def _as_it_follows(fit: Fit) -> tuple[Fit | None, list[str]]:
    """The fit with the power to which the heat follows its drive, and how late, where the readings tell it from a disturbance.

    None where that power may be 0, so that the heat may not follow at all.
    """
    law = heat_law(fit)
    if law is None:
        return fit, []
    if law.may_be_none:
        why = f"the heat may not follow {fit.run.drive} (power {law.power:.2g} ± {law.half_width:.2g}), and it is not counted"
        return None, [why]
    return fit_disturbed(law.candidate.fit), [law.words]


def _wishes(task: LoopTask) -> str:
    return " and ".join([*([f"the drive {task.drive}"] if task.drive else []), *(["--auto"] if task.auto else [])])


def _looked_for(found: Discovery, likely: Candidate | None) -> str:
    """What a search of the readings used found, in words."""
    added = found.named or likely
    if added is None:
        if found.verdict == "none":
            return "--auto: the readings used show nothing missing"
        return "--auto: something is missing, and the readings used do not tell what; none was added"
    had, left = misfit_power(found.base), misfit_power(added.fit)
    share = f"{min(100.0 * (1.0 - left / had) if had > 0.0 else 100.0, 99.9):.3g} % of the misfit of the readings used"
    if found.named is None:
        return f"--auto: {added.parts[-1].id}, which is likeliest and not sure, added, which explains {share}"
    rivals = [p.id for c in found.also[:1] for p in c.parts if p.id not in found.named.ids]
    either = f" (or {', '.join(rivals)})" if rivals else ""
    return f"--auto: {found.verdict}{either} added, which explains {share}"


def followers(task: LoopTask, seen: Observations) -> tuple[list[str], list[str]]:
    """Sensors that follow the drive of a task, and those that do not, each judged by itself.

    A column that a sensor follows leaves less of it than a heat that is constant does, and is what moves it.
    """
    bare = observe(replace(task.run, inputs={}), task.start_min, until_min=task.fitted_min).seen
    assert bare is not None
    mine: list[str] = []
    strange: list[str] = []
    for i, channel in enumerate(seen.channels):
        one = seen.only([channel])
        if one.used.sum() < FEWEST:
            strange.append(channel)
            continue
        fit, constant = fit_model(one), fit_model(bare.only([channel]).until(task.fitted_min))
        moved = float(np.ptp(one.filled[0, one.used[0]]))
        sink = float(fit.values.get(SINK_KEY, seen.sink_c or 0.0))
        follows = (
            fit.rmse[0] <= max(constant.rmse[0], 1.2 * seen.noise[i]) and abs(fit.values[LEVEL][0] - sink) > LEAST_HEAT * moved
        )
        (mine if follows else strange).append(channel)
    return mine, strange


def _knowledge(task: LoopTask) -> Knowledge:
    if task.model is None:
        return _guessed(task)
    file, name = task.model.file, task.run.name
    mine = [c for c in task.run.channels if c in file.channels]
    if not mine:
        raise UsageError(
            f"{name}: none of its sensors is in the model {task.model.source}",
            found=", ".join(list(task.run.channels)[:12]),
            allowed=", ".join(file.channels[:12]),
            do="use a model of this machine, or give its sensors the model's names: --rename COLUMN=NAME",
        )
    past = past_of_model(task.model)
    more = [*_said_of_length(file, past), *changed_files(file)]
    notes = [_said([e.id for e in file.effects], task.model.source, past.runs), *more]
    if task.drive is None and (not file.effects or (file.past is not None and file.past.without_effects)):
        if file.effects:
            left_out = "its effects are left out here: the shape of its runs foretells the next one better"
            came = [
                f"in its runs came {e}, at another time in each: it is not foretold, and where it comes the model holds no longer"
                for e in (file.past.without_events if file.past is not None else ())
            ]
            notes = [_said((), task.model.source, past.runs), left_out, *came, *notes[1:]]
        return Knowledge(name, past, tuple(notes))
    _, prepared = ready(task)
    if prepared is None or _too_few(prepared):
        return Knowledge(name, notes=(f"too few readings for the effects of {task.model.source}: identified without it",))
    carried = carry(file, prepared.seen, name, task.model.source)
    events = () if file.learnt_from.is_of(name, prepared.seen) else _said_of_events(file, check_effects(file, task.model.source))
    about = (*_said_of_length(file, past), *events)
    notes = [_said(ids_of(carried.fit.model.parts), task.model.source, past.runs), *about, *carried.notes]
    if past.unexplained:
        notes.append(
            f"it leaves a pattern in {', '.join(past.unexplained)} of what it was learnt from, for which intervals make room"
        )
    # What a model of one rate leaves of its own runs follows another course of the drive in another way.
    other_ways = task.drive is not None and bool(past.unexplained)
    other_modes = DRIVEN if other_ways else 0.0
    own = file.learnt_from.is_of(name, prepared.seen)
    linked = any(part.effect.reads_sensors for part in carried.fit.model.parts)
    stretch = past.scatter if linked and not own else 0.0
    rises = rises_of(carried.fit, prepared.whole, until_min=task.fitted_min, other_modes=other_modes, stretch=stretch)
    known = {c: s for c, s in past.shapes.items() if c in rises}
    reached = _reached(rises, file, known)
    short = {c: share for c, share in reached.items() if share < REACHED}
    if short:
        far = f"{rounded(100.0 * min(short.values()), 2)} % of where this model ends"
        whose = "" if len(short) == len(known) else f" of {listed(list(short), 6)}"
        trusted = f"the rest is taken on trust, and the interval{whose} is that of the readings alone at least"
        notes.append(f"what it was learnt from had come to {far}: {trusted}")
    uses_room = any(p.effect.follows_ambient for p in carried.fit.model.parts)
    rest = REST_OF_LINKED if any(p.effect.reads_sensors for p in carried.fit.model.parts) else REST
    unreached = {c: rest * (1.0 - share) for c, share in reached.items()}
    open_end = frozenset(known if events else {*short, *without_neighbours(file, tuple(prepared.seen.channels))})
    past = replace(past, shapes=known, rises=rises, open_end=open_end, unreached=unreached)
    if other_ways:  # and shortly after a jump of it the readings have said nothing yet of how
        past = replace(past, changed_min=_changed(carried.fit, task.start_min))
    return Knowledge(name, past, tuple(notes), uses_room)


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


def rises_of_model(model: Model) -> dict[str, float]:
    """How far [K] each sensor that moved, by name, rose in the first run that a model was learnt from, by the law.

    Where effects carry a part of the rise: how far the runs went.
    """
    if model.file.effects:
        shapes = model.file.past.shapes if model.file.past is not None else ()
        return {s.channel: abs(s.moved_c) for s in shapes if s.moved_c}
    level, start = ({n.channel: n.value for n in model.file.base if n.name == name} for name in ("level", "start"))
    return {c: abs(level[c] - start[c]) for c in level if c is not None and c in start and level[c] != start[c]}


def _said(effects: Sequence[str], source: str, runs: int) -> str:
    learnt = f", learnt from {runs} runs" if runs > 1 and source != f"{runs} runs" else ""
    return f"with {', '.join(effects)} of {source}{learnt}" if effects else f"by {source}{learnt}"


def _said_of_events(file: ModelFile, known: Mapping[str, Effect]) -> tuple[str, ...]:
    """That something happened in the only run a model was learnt from, if so: a slow mass and an event may look alike there."""
    events = [e.id for e in file.effects if (what := known[e.id].event) and what in e.searched]
    if not events or file.also_from:
        return ()
    hidden = "what slower masses do may be hidden in it, and the interval is that of the readings alone at least"
    return (f"learnt from one run in which something happened ({listed(events)}): {hidden}",)


def _said_of_length(file: ModelFile, past: Past) -> tuple[str, ...]:
    """That the runs a model was learnt from ended early, if they may have: what slower masses bring later is not in it."""
    above = {c: shape.rest.above for c, shape in past.shapes.items() if shape.rest is not None and shape.rest.above > OPEN}
    if above:
        far = f"{rounded(min(100.0 * max(above.values()), 999.0), 2)} % of the rise"
        whose = "" if len(above) == len(past.shapes) else f" of {listed(list(above), 6)}"
        on = f"by the readings{whose} alone it may go on by up to {far}, which the interval counts"
        return (f"what it was learnt from may have ended early: {on}",)
    longest = max(one.length_min for one in (file.learnt_from, *file.also_from))
    rates = [s.log_rate for s in past.shapes.values()]
    turns = longest * float(np.exp(np.median(rates))) if rates else np.inf
    if turns >= COMPLETE:
        return ()
    return (f"learnt from no more than {rounded(turns, 2)} time constants: what slower masses bring later is not in it",)


def _reached(rises: Mapping[str, Rise], file: ModelFile, known: Container[str]) -> dict[str, float]:
    """The share of the way to its end, by the model, that each known sensor had gone where the longest run learnt from ended.

    By all that takes it there: heat that comes from a neighbour that is slow comes late.
    """
    longest = max(one.length_min for one in (file.learnt_from, *file.also_from))
    found = {}
    for channel, rise in rises.items():
        line = rise.whole[len(rise.nodes) // 2]
        if channel in known:
            found[channel] = float(np.clip(np.interp(longest * np.exp(rise.log_rate), GRID, line), 0.0, 1.0))
    return found


def _old(file: ModelFile) -> Past:
    """Of a model file that tells no past: its rates, and the shapes of machines in general."""
    found = {}
    for c in file.channels:
        rate = next((n for n in file.base if n.name == "rate" and n.channel in (None, c)), None)
        if rate is not None and rate.value > 0.0:
            share = (rate.standard_error or 0.0) / rate.value
            found[c] = SensorShape.unseen(float(np.log(rate.value)), min(share, 0.5), TYPICAL)
    return Past(found)
