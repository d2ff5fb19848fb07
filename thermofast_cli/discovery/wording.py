"""A verdict in words that a test engineer understands: what was seen, what to do next."""

import math
import shlex
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thermofast.models.effects import BUILT_IN
from thermofast.models.effects.room_step import rise_alike
from thermofast.models.joint import RATE, Fit, Key, Part
from thermofast.models.observations import Observations
from thermofast.models.search.candidates import Candidate, first_order
from thermofast.models.search.discover import Discovery
from thermofast.models.search.judge import widening
from thermofast.models.search.rules import RULES
from thermofast.models.uncertainty.disturbed import disturbed_deviations

from ..errors import rounded
from ..learning.rise import free_runs
from ..observing.task import as_told, pooled, unseen_delay
from .remains import cycle_of, remaining_words, shares
from .several import TWO_MACHINES
from .stretches import steps_near

#: Error ahead, in deviations of the noise, beyond which the first minutes did not show all.
BEYOND = 5.0
#: Gain at which an effect would have been named, for telling how small a one would have been seen.
SEEN_GAIN = 70.0

#: A model that fails from within this share of the record on fails from the start.
FROM_THE_START = 0.03
#: What to do where the readings swing with one period.
ON_AND_OFF = "a heat or a cooling goes on and off with that period: log it, or look at compare --effects cyclic_load"
#: A room that moves a machine by more than this share of its own rise is hardly one.
ROOM_SHARE = 0.5
#: Noise of no more than this share of the logger's step is that of its rounding.
COARSE = 0.3

#: Effects that need the surroundings logged.
ROOMS = tuple(kind.id for kind in BUILT_IN if kind.follows_ambient)
#: What the names of columns contain that tell of a machine's load and cooling.
_POWER = ("power", "load", "duty", "current", "watt", "leistung", "last", "功率", "电流", "電力", "電流")
USUAL = {
    "speed": ("speed", "rpm", "drehzahl", "转速", "轉速", "回転"),
    "power": _POWER,
    "duty": _POWER,
    "coolant": ("cool", "fan", "flow", "kühl", "kuehl", "冷却"),
}


def rivals(found: Discovery) -> list[Candidate]:
    """The models that fit as well and are others: the same effects in another order, or on another column, are not."""
    mine = {frozenset(found.named.ids)} if found.named is not None else set()
    other: list[Candidate] = []
    for candidate in found.also:
        if frozenset(candidate.ids) not in mine:
            mine.add(frozenset(candidate.ids))
            other.append(candidate)
    return other


def other_ways(found: Discovery) -> str:
    """Where the effects named act as well in another way (on another column or neighbour); empty where they do not."""
    if found.named is None:
        return ""
    same = [c for c in found.also if set(c.ids) == set(found.named.ids)]
    own = {p.choice.label for p in found.named.parts}
    ways = dict.fromkeys(p.choice.label for c in same for p in c.parts if p.choice.label and p.choice.label not in own)
    return f"acts as well as: {', '.join(ways)}" if ways else ""


def unlogged_room(found: Discovery, seen: Observations) -> str:
    """What to say where nobody logged the surroundings and a moving room would look like what was named; else nothing."""
    if found.named is None or seen.ambient:
        return ""
    unlogged = [p for p in found.named.parts if not p.choice.constants.get("column")]
    alike = [p.id for p in unlogged if set(ROOMS) & set(p.effect.mistaken_for)]
    if not alike:
        return ""
    return f"the surroundings are not logged, and a room that moves would look like {' and '.join(alike)}: log the ambient"


def room_instead(found: Discovery, seen: Observations) -> list[str]:
    """What was named with a room that moved by itself in its place, where sensors that rise alike do not tell the two apart.

    Nothing where the room is logged, the model has rivals already, or a room had to move by half of all that the machine rose.
    """
    named = found.named
    if named is None or rivals(found) or not _or_a_room(named.parts, seen):
        return []
    fit, parts = named.fit, named.parts
    own = [k for k, part in enumerate(parts) if _steps_by_itself(part)]
    sensors = np.arange(seen.sensors)
    shared = np.tile(fit.shared, (len(sensors), 1))
    without = free_runs(fit, fit.run, fit.local, shared, sensors, [k for k in range(len(parts)) if k not in own])
    if not np.median(np.abs(fit.curve - without)[:, -1]) < ROOM_SHARE * np.median(seen.moved):
        return []
    kept = [part.id for k, part in enumerate(parts) if k not in own]
    return ["+".join(sorted([*kept, kind.id])) for kind in BUILT_IN if kind.moves_room]


def fails_beyond(found: Discovery, seen: Observations, until: float | None) -> str:
    """What to say where nothing is missing in the first minutes and yet the later readings leave the model; else nothing."""
    if until is None or found.verdict != "none":
        return ""
    worst = float(np.nanmax(found.ahead_base / seen.noise, initial=0.0))
    if not worst > BEYOND:
        return ""
    return (
        f"nothing is missing in the first {until:g} min, and the readings after them leave the model by {rounded(worst)} times the "
        "noise: they tell more, say a longer --until"
    )


def not_borne_out(found: Discovery, seen: Observations, until: float | None) -> str:
    """What to say where effects fit the first minutes and tell the later readings no better than the model without them."""
    named = found.named
    if until is None or named is None or found.ahead is None:
        return ""
    who = np.any([p.concerns(seen.sensors) for p in named.parts], axis=0)
    before, after = pooled(found.ahead_base[who]), pooled(found.ahead[who])
    if not after >= before:
        return ""
    return (
        f"the readings after {until:g} min do not bear it out: the error there is {rounded(after)} K with "
        f"{' and '.join(named.ids)}, {rounded(before)} K without: do not add it, and say a longer --until"
    )


def words(found: Discovery, seen: Observations, again: str) -> tuple[str, str, str]:
    """(evidence, advice, status) of a verdict; again is the run and how it was read, as a command line says it."""
    short = _short_record(found, seen)
    if found.partly:
        return _partly_words(found, seen, again)
    if found.named is not None:
        return _named_words(found, seen, again)
    if found.verdict == "none":
        sizes = "; ".join(visible_sizes(found))
        name = "model" if found.base.model.parts else "base model"
        evidence = f"the {name} is down to the noise in every sensor; would most likely have been seen: {sizes}"
        return evidence, short or "nothing to add", "not_determined" if short else "ok"
    above = [c for c, p in zip(seen.channels, found.base_floor, strict=True) if p < RULES.pattern]
    where = _where(found, seen)
    near = ", ".join("+".join(c.ids) for c in rivals(found)[:3])
    evidence = (
        f"the base model fails in {f'{_listed(above)} {where}'.strip()}, and no effect of the catalogue, alone or with a second "
        f"one, explains it better than an unknown disturbance of the same size and colour would; nearest: {near or 'none'}"
    )
    cycle = cycle_of(found.base)
    evidence += f"; beside it {cycle}" if cycle else ""
    if found.why == TWO_MACHINES:
        evidence = f"nothing is named from runs of two machines; nearest in this run: {near or 'none'}"
        return evidence, "give runs of one machine, or search each by itself, without --together", "model_doubtful"
    begins = _worst(found, seen)
    steps = steps_near(seen, begins[0]) if begins else []
    advice = short or "; ".join(
        [
            *(
                [f"{s}, where the model fails: look at it first" for s in steps]
                or [f"log what {_when(begins, seen, rivals(found)[:3])}{_unlogged(seen)}"]
            ),
            *([ON_AND_OFF] if cycle else []),
            *_coolants(seen),
            *_coarse(seen),
            *hints_of(found.also[:2], seen)[:2],
            "or write the effect yourself: docs/add-an-effect.md",
        ]
    )
    return evidence, advice, "not_determined" if short else "model_doubtful"


def _partly_words(found: Discovery, seen: Observations, again: str) -> tuple[str, str, str]:
    """Of effects that matter although a pattern remains beside them."""
    named = found.named
    assert named is not None
    told, times = [], widening(named.fit)
    parts = [p for p in named.parts if p not in found.base.model.parts]
    for step, stage, ahead, left in zip(shares(found), found.stages, found.held, found.held[1:], strict=False):
        new = [p for p in parts if p.id in str(step["effect"]).split("+")]
        rival = f" (or {step['or']})" if step["or"] else ""
        said = "; and ".join(_described(named.fit, named.parts.index(p), seen, times, found.around) for p in new)
        # Of an effect that some sensors have, what it does there: all sensors together may hold another misfit, far larger.
        who = np.any([p.concerns(seen.sensors) for p in new], axis=0) if new else np.ones(seen.sensors, dtype=bool)
        share = 100.0 * (float(str(step["share"])) if who.all() else stage.named.share)
        told.append(
            f"{step['effect']}{rival}: {said}; {'it explains' if len(new) == 1 else 'they explain'} "
            f"{'more than 99' if share > 99.0 else f'{share:.0f}'} % of the misfit{'' if who.all() else ' there'}, and "
            f"{_error_moves(pooled(ahead[who]), pooled(left[who]))}"
        )
    evidence = f"{'; then '.join(told)}. {_seen_as(named)}What remains is {remaining_words(named.fit)}"
    none = [p.id for k, p in enumerate(named.parts) if p in parts and may_be_none(named.fit, k, times, found.around)]
    evidence += f"; beside that, the size of {' and '.join(none)} is not told from none" if none else ""
    also, ways = rivals(found), other_ways(found)
    advice = f"add it: {_adding(named.parts, again)}"
    if also:
        hints = "; ".join(hints_of([named, *also[:2]], seen)) or "run the machine another way, as by cooling down"
        advice = f"{advice}; to tell it from {', '.join('+'.join(c.ids) for c in also)}: {hints}"
    advice = "; ".join([advice, *_driven_by(parts), *_or_a_room(parts, seen), *(p.effect.advice for p in parts if p.effect.advice)])
    return evidence, "; ".join(a for a in (advice, ways) if a), "partly_explained"


def may_be_none(fit: Fit, k: int, times: float, around: Fit | None) -> bool:
    """Whether the 95 % interval of part k's size holds the value at which the effect vanishes, in every sensor that has it.

    times multiplies the errors that sizes have under white noise; around is a fit with more effects that leaves no pattern.
    """
    part = fit.model.parts[k]
    effect, key = part.effect, Key(k, part.effect.amplitude)
    if key not in fit.values or effect.parameter(effect.amplitude).null is None:
        return False
    main = effect.parameter(effect.amplitude)
    value, error = np.asarray(fit.values[key]), np.hypot(times * fit.deviations[key], disturbed_deviations(fit, around)[key])
    who = part.concerns(fit.run.sensors)
    if main.each == "sensor":
        who = who & fit.model.active[:, fit.model.column(key)]
        value, error = value[who], np.asarray(error)[who]
    error = error * np.abs(value) if main.log else error
    return bool(np.all(np.abs(value - main.null) <= 1.96 * error))


def _error_moves(before: float, after: float) -> str:
    """'the error on readings not fitted falls from 0.4 to 0.1 K', rises, or stays at what it rounds to."""
    sides = rounded(before), rounded(after)
    moves = "stays at" if sides[0] == sides[1] else f"{'falls' if after < before else 'rises'} from {sides[0]} to"
    return f"the error on readings not fitted {moves} {sides[1]} K"


def _adding(parts: Sequence[Part], again: str) -> str:
    """The command that learns a model with these effects from the same readings: all of it, with those of a model to begin with."""
    own = dict.fromkeys(f"--effect {shlex.quote(p.effect.file)}" for p in parts if p.effect.file)
    return " ".join(["thermofast improve", again, "--add", ",".join(p.id for p in parts), *own, "-o machine.toml"])


def _driven_by(parts: Sequence[Part]) -> list[str]:
    """What to say of a logged column that the heat follows: it may be taken for the heat itself."""
    columns = dict.fromkeys(str(p.choice.constants.get("column", "")) for p in parts if p.effect.changes_heat)
    return [f"or take the column for the heat itself: --drive {shlex.quote(c)}" for c in columns if c]


def _or_a_room(parts: Sequence[Part], seen: Observations) -> list[str]:
    """What to say of a heat or a loss that stepped by itself where sensors that rise alike do not tell it from a room that did."""
    alike = any(map(_steps_by_itself, parts)) and not seen.ambient and rise_alike(seen)
    return ["log the room: one that became warmer or colder moves sensors that rise alike in the same way"] if alike else []


def _steps_by_itself(part: Part) -> bool:
    """Whether it is a heat or a loss that stepped by itself."""
    return bool(part.effect.event and part.effect.uses_sink and not part.choice.constants.get("column"))


def _described(fit: Fit, k: int, seen: Observations, times: float = 1.0, around: Fit | None = None) -> str:
    """What part k of a model is, where, and how large; times multiplies the errors that its numbers have under white noise.

    around is a fit with more effects that leaves no pattern.
    """
    part = fit.model.parts[k]
    who = part.concerns(seen.sensors)
    sensors = "all sensors" if who.all() else _listed([c for c, w in zip(seen.channels, who, strict=True) if w])
    ways = part.choice.ways(seen.channels, who)
    acts = f" ({_listed(ways)})" if ways else ""
    numbers = ", ".join(_numbers(fit, k, who, times, around))
    return f"{part.effect.summary}{acts}, in {sensors}: {numbers}{' (95 %)' if '±' in numbers else ''}"


def _numbers(fit: Fit, k: int, who: NDArray[np.bool_], times: float, around: Fit | None) -> list[str]:
    """The values of part k's parameters in words with their 95 % half-widths, where who (S,) have it."""
    numbers, beside = [], disturbed_deviations(fit, around)
    for name in fit.model.parts[k].effect.parameters:
        key = Key(k, name.name)
        if key not in fit.values or name.periodic:
            continue
        value, error = fit.values[key], np.hypot(times * fit.deviations[key], beside[key])
        unit = "" if name.unit == "1" else f" {name.unit}"
        if name.each == "sensor":
            mine = np.flatnonzero(who & fit.model.active[:, fit.model.column(key)])
            if len(mine) > 1:
                ends = (rounded(as_told(fit, k, name.name, end)) for end in (value[mine].min(), value[mine].max()))
                numbers.append(f"{name.name} {' to '.join(ends)}{unit} by sensor")
            if len(mine) != 1:
                continue
            i = int(mine[0])
            value, error = float(value[i]), float(error[i])
        error = 1.96 * math.hypot(float(error) * (abs(float(value)) if name.log else 1.0), unseen_delay(fit, k, name.name))
        numbers.append(f"{name.name} {_rounded(as_told(fit, k, name.name, float(value)), float(error))}{unit}")
    return numbers


def _named_words(found: Discovery, seen: Observations, again: str) -> tuple[str, str, str]:
    named = found.named
    assert named is not None
    assert found.ahead is not None
    concerned = np.zeros(seen.sensors, dtype=bool)
    parts = []
    for k, part in enumerate(named.parts):
        concerned |= part.concerns(seen.sensors)
        parts.append(_described(named.fit, k, seen))
    before, after = pooled(found.ahead_base[concerned]), pooled(found.ahead[concerned])
    noise = pooled(named.fit.noise[concerned])
    evidence = (
        f"{'; and '.join(parts)}. {_seen_as(named)}With {' and '.join(named.ids)} added "
        f"{_error_moves(before, after)}; noise {rounded(noise)} K"
    )
    also, ways = rivals(found), other_ways(found)
    if also:
        hints = "; ".join(hints_of([named, *also[:2]], seen)) or "run the machine another way, as by cooling down"
        advice = f"as good: {', '.join('+'.join(c.ids) for c in also)}. To tell them apart: {hints}"
    else:
        advice = f"add it: {_adding(named.parts, again)}"
    advice = "; ".join(
        [
            advice,
            *_driven_by(named.parts),
            *_or_a_room(named.parts, seen),
            *(p.effect.advice for p in named.parts if p.effect.advice),
        ]
    )
    # What fits as well may be the cause as well: a name is sure only where it stands alone.
    return evidence, "; ".join(a for a in (advice, ways) if a), "not_determined" if also else "ok"


def hints_of(candidates: Sequence[Candidate], seen: Observations) -> list[str]:
    """What would tell the effects of the candidates apart, without what the run has already: a logged room, a logged column."""
    hints = dict.fromkeys(
        part.strip() for c in candidates for p in c.parts for part in p.effect.separate.split(";") if p.effect.separate
    )
    logged = _logged(seen)
    return [h for h in hints if not (h.startswith("log ") and any(word in h and there for word, there in logged.items()))]


def _logged(seen: Observations) -> dict[str, bool]:
    """Which of the usual columns a run logs, by their names."""
    names = [n.lower() for n in seen.inputs]
    return {"ambient": bool(seen.ambient)} | {k: any(w in n for n in names for w in words) for k, words in USUAL.items()}


def _unlogged(seen: Observations) -> str:
    """The usual columns that a run does not log, to name them."""
    logged = _logged(seen)
    usual = [k for k in ("speed", "power", "coolant") if not logged[k]] + ([] if logged["ambient"] else ["room"])
    return f" ({', '.join(usual)})" if usual else ""


def _when(begins: tuple[float, float, float] | None, seen: Observations, nearest: Sequence[Candidate] = ()) -> str:
    """What to look for: something that changed where the model begins to fail; from the first reading on nothing need have.

    It fails most after that: where one of the nearest models has something change, that tells when.
    """
    if begins is None or not begins[0] > seen.clock[0] + FROM_THE_START * seen.span:
        return "may change"
    for candidate in nearest:
        for k, part in enumerate(candidate.parts):
            # What follows a logged column has no event of its own.
            when = candidate.fit.values.get(Key(k, part.effect.event or ""))
            if when is not None and part.effect.scope == "run":
                return f"changed at about {seen.start_min + float(when):.3g} min"
    return f"changed at {begins[0]:.4g} min"


def _coolants(seen: Observations) -> list[str]:
    """What to say of sensors that may read what cools the machine: no law of a heated body describes those."""
    named = [c for c in seen.channels if any(word in c.lower() for word in USUAL["coolant"])]
    return [
        f"if {c} cools the machine, it is a condition of the test: --inputs {shlex.quote(c)}"
        for c in named[:1]
        if len(named) < seen.sensors
    ]


def _coarse(seen: Observations) -> list[str]:
    """What to say of readings whose steps are all their noise."""
    steps = seen.resolution[seen.noise <= COARSE * seen.resolution]
    return [f"readings in steps of {rounded(float(steps.max()))} K hide what is smaller: log more digits"] if len(steps) else []


def _seen_as(named: Candidate) -> str:
    """The tell-tale of each effect, with 1/b in minutes where it speaks of that."""
    late = 1.0 / float(np.median(named.fit.values[RATE]))
    tales = [p.effect.tell_tale.replace("1/b", f"1/b = {late:.3g} min") for p in named.parts if p.effect.tell_tale and _searched(p)]
    return f"Seen as: {'; '.join(dict.fromkeys(tales))}. " if tales else ""


def _searched(part: Part) -> bool:
    """Whether the moment of what happens is searched for: what follows a logged column shows as that does."""
    return part.effect.event is None or part.effect.event in {p.name for p in part.effect.active(part.choice)}


def _rounded(value: float, error: float) -> str:
    if not math.isfinite(error) or error <= 0.0:
        return f"{value:.4g}"
    digits = max(0, min(6, 1 - math.floor(math.log10(error))))
    return f"{value:.{digits}f} ± {rounded(error, 1)}"


def _listed(names: list[str]) -> str:
    return ", ".join(names) if len(names) < 7 else f"{', '.join(names[:5])} and {len(names) - 5} more"


def _where(found: Discovery, seen: Observations) -> str:
    worst = _worst(found, seen)
    return f"(most from {worst[0]:.4g} to {worst[1]:.4g} min, by {rounded(worst[2])} K)" if worst else ""


def _worst(found: Discovery, seen: Observations) -> tuple[float, float, float] | None:
    """The stretch in which the base model fails most, over all sensors: from, to [min of the run], by [K]."""
    from .stretches import failing_stretches

    worst: tuple[float, float, float] | None = None
    for i in range(seen.sensors):
        residual = np.where(seen.used[i], found.base.residual[i], np.nan)
        for a, b, size in failing_stretches(seen.clock, residual, seen.weight[i], float(seen.noise[i])):
            if worst is None or abs(size) > abs(worst[2]):
                worst = a, b, size
    return worst


def _short_record(found: Discovery, seen: Observations) -> str:
    """Why a record is too short to judge, and how long it should be; nothing where it is long enough."""
    rates = np.asarray(found.base.values[RATE])
    covered = float(np.median(rates)) * seen.span
    if covered >= 0.7:
        return ""
    need = 1.0 / float(np.median(rates))
    longer = f"at least {need:.0f} min" if need < 20.0 * seen.span else "many times longer: it is hardly bent yet"
    return f"the record covers {covered:.2f} of a time constant: too short to judge; record {longer}"


def visible_sizes(found: Discovery) -> list[str]:
    """For each effect the size that would have been seen, where it acts in the middle of what was searched."""
    sizes = []
    for candidate in found.singles:
        effect = candidate.parts[-1].effect
        _, scans = first_order(found.base, effect)
        if not scans:
            continue
        strength = scans[0][1].strength
        summed = strength.sum(axis=1) if effect.scope == "run" else np.median(strength, axis=1)
        middle = float(np.median(summed))
        if middle <= 0.0:
            continue
        size = math.sqrt(SEEN_GAIN / middle)
        main = effect.parameter(effect.amplitude)
        low, high = main.bounds(found.base.run)
        if size > max(abs(low - (main.null or 0.0)), abs(high - (main.null or 0.0))):
            continue
        unit = "" if main.unit == "1" else f" {main.unit}"
        sizes.append(f"{effect.id} {main.name} {rounded(size)}{unit}")
    return sizes
