"""``changed``: what is different in a machine since other runs of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations, third_difference_noise
from thermofast.models.joint import LEVEL, START, Fit, fit_model
from thermofast.models.search.judge import widening
from thermofast.models.search.logged import follows_machine
from thermofast.models.uncertainty.changes import (
    LOCAL,
    LOGGED_DRIFT,
    WARM,
    WHOLE,
    Begun,
    Change,
    RunNumbers,
    begun_beside,
    changes,
    other_room,
    with_offset,
    with_room,
    without_room,
)

from ..discovery.observe import FEWEST_READINGS, observe
from ..errors import UsageError, listed, rounded
from ..machine.learnt import as_learnt, first_readings
from ..machine.model import Model
from ..machine.modelfile import refuse_copies
from ..records import ChangedRecord
from ..workers.engine import Started

Array = NDArray[np.float64]

#: Probability from which one kind is said, and two together as "A or B".
SURE, EITHER = 0.9, 0.95
#: Deviation of the logarithm of a rate, median over the sensors, from which a record is hardly bent: a first slope is heat over
#: heat capacity, and which of the two changed it does not say.
STRAIGHT = 0.25
#: That of its rate or rise from which a sensor that moves little is left out: its logarithm is then no Gaussian.
UNKNOWN = 0.5
#: Share of what the others move below which it is.
WEAK = 0.5
#: Share of the sensors that must be bent to be those that a run is of.
ENOUGH = 0.3
#: Deviations of its size at which a change of the whole machine is sure to be said.
SHOWS = 4.0
#: Rooms that differ by more [K] are said.
ROOM = 0.5
#: One sensor that began so much farther from the others than before [K] is told: rates and rises do not know of it.
APART = 0.5
#: So much farther than the others did, against each other, between the runs that are compared, or those before [deviations].
FARTHER = 4.0
#: Means of a logged column, new runs over old ones, as logarithms: from which they are said; how near to the heat's.
LOGGED, AS_ASKED = 0.05, 0.1
#: Share of their rise on which new runs are well up where they begin, beyond the old ones, and how uneven that is in a machine:
#: another room moves all points alike.
LATE, UNEVEN = 0.1, 0.1
#: Misfit of the law beyond the noise, over the rise, from which a run is bent, and by how many times that of the other side's runs.
BENT, MORE_BENT = 0.04, 4.0
#: A sensor that ends where it did, to within so much of what it began warmer, is no probe that tells more throughout.
ENDS_ALIKE = 0.5
#: What is not known of a logged room's mean [K].
ROOM_ERROR = 0.1
#: Root mean square of the logarithms of rates and rises, new over old, at which two runs look like those of two machines.
ANOTHER = 0.35
#: What each kind says in words.
WORDS = {
    "nothing": "the new runs are as the old ones",
    "room": "the machine is as it was, in a room {kelvin} K {warmer}",
    "heat": "every point rises {more}, as fast as before: the heat",
    "heat capacity": "every point settles where it did, {slower}: the heat capacity",
    "loss": "every point rises {less} and settles {quicker}: the loss to the surroundings",
    "sensor": "{sensor} alone tells another temperature, is in another place, or in another contact",
    "exchanged": "{sensor} and {other} each tell what the other did: their plugs, places or names were exchanged",
    "probe": "{sensor} tells {kelvin} K {higher} than it did beside the others, from beginning to end: its probe",
    "contact": "points differ each in its own way, {sensor} most, which rises {more}: a contact, a coupling, or several at once",
}


@dataclass(frozen=True)
class Difference:
    """What the picture shows: logarithms of rate and rise of each sensor, new over old (2 S,), with their deviations."""

    channels: tuple[str, ...]
    value: Array
    deviation: Array
    verdict: str


def compare_runs(
    old: Sequence[Started], new: Sequence[Started], model: Model | None = None
) -> tuple[list[ChangedRecord], Difference]:
    """A record for each kind of change, the likeliest first; all runs are looked at over the length of the shortest.

    A model, which takes the place of old runs, is looked at as the run that it foretells at the readings of each new one.

    Raises
    ------
    UsageError: no runs, no sensor that all have, too few readings, a sensor that does not move, or a run on both sides.
    """
    if model is not None and old:
        raise UsageError("--model takes the place of OLD runs", do="leave one of them out")
    for side, runs in (("OLD", old), ("--new", new)):
        if not runs and not (side == "OLD" and model is not None):
            raise UsageError(f"no run is given as {side}", do="as in: thermofast changed before.csv --new after.csv")
    both = {run.name for run, _ in old} & {run.name for run, _ in new}
    if both:
        raise UsageError(f"{both.pop()} is old and new", do="give each run on one side")
    seen = [_observed(one) for one in (*old, *new)]
    refuse_copies((one.name, one) for one in seen)
    if model is not None:
        longest = max(seen, key=lambda s: s.span)
        seen.insert(0, as_learnt(model.file, longest, longest.name, model.source))
    many = max(len(old), 1)
    channels = [c for c in seen[0].channels if all(c in s.channels for s in seen)]
    if not channels:
        other = min(seen[1:], key=lambda s: len({*s.channels} & {*seen[0].channels}))
        raise UsageError(
            "the runs have no sensor in common",
            found=f"{seen[0].name}: {', '.join(seen[0].channels[:6])}; {other.name}: {', '.join(other.channels[:6])}",
            do="give runs of one machine, their sensors named alike",
        )
    span = min(s.span for s in seen)
    mine = [s.only(channels) for s in seen]
    if any(s.sink_c is None or follows_machine(s.filled, next(iter(s.ambient.values()))) for s in mine):
        mine = [replace(s, ambient={}) for s in mine]
    fits = [without_room(s.until(float(s.time[0]) + span)) for s in mine]
    straight = _straight(fits)
    if straight:
        channels = [c for c in channels if c not in straight]
        fits = [fit_model(f.run.only(channels)) for f in fits]  # without what its room did already
    _same_way(fits, many)
    logged = fits[0].run.sink_c is not None
    starts, levels = (
        np.array([np.asarray(f.values[k], dtype=float) - (f.run.sink_c or 0.0) for f in fits]) for k in (START, LEVEL)
    )
    rise = (levels - starts)[many:].mean(axis=0)
    warmer = starts[many:].mean(axis=0) - starts[:many].mean(axis=0)
    begun = Begun(warmer, rise, 1.0 - WARM, ROOM_ERROR) if logged else Begun(warmer, rise)
    numbers = [_numbers(fit, LOGGED_DRIFT if logged else 1.0) for fit in fits]
    if model is not None:
        numbers[0] = replace(numbers[0], runs=1 + len(model.file.also_from))
    seen_as = changes(numbers[:many], numbers[many:], begun)
    found = seen_as.changes
    if model is None or not logged:
        found = _with_room(fits, starts, many, found, seen_as.same_start)
    difference, deviation = seen_as.difference, np.sqrt(np.diag(seen_as.noise))
    first = _first(seen, channels, model)
    swapped = found[0].kind == "exchanged" and found[0].probability >= SURE
    if first is not None and not swapped:  # each of the two began elsewhere, and neither probe is off
        begin, stands_for = (starts, 1) if model is None else (first, 1 + len(model.file.also_from))
        found = with_offset(found, begin, levels - starts, many, deviation[len(channels) :], stands_for)
    verdict, status = _verdict(found, float(np.median(deviation[: len(channels)])))
    asked = _asked_for([f.run for f in fits], many) if model is None else {}
    if verdict == "heat" and any(_accounts_for(found[0], ratio) for ratio in asked.values()):
        verdict, status = "nothing or heat", "not_determined"
    names = ", ".join(run.name for run, _ in new)
    told = {channels[c.sensor] for c in found[:1] if c.kelvin and c.sensor is not None}
    apart = [] if first is None or swapped else _apart(first, many, channels)
    apart = [n for n in apart if not any(n.startswith(f"{c} began") for c in told)]
    others = np.arange(len(rise)) != (found[0].sensor if verdict == "sensor" else None)
    # Where a test is logged late the sensor that is accused ends where it did, too: it began up on its rise.
    others |= np.abs(levels[many:].mean(axis=0) - levels[:many].mean(axis=0)) < ENDS_ALIKE * np.abs(warmer)
    late = _late(warmer[others], rise[others]) if verdict in ("sensor", "contact") else []
    if late:  # what each sensor does by itself then is how the machine had warmed
        verdict, status = "cannot tell", "not_determined"
    bent = _bent(fits, many, channels) if not verdict.startswith("nothing") else []
    if bent:  # of a load that changed within a run rate and rise tell nothing
        verdict, status = "cannot tell", "not_determined"
    if verdict == "nothing" and (apart or _of_a_size(found)):  # rates and rises do not know of a probe that is off
        status = "not_determined"
    notes = [
        *late,
        *bent,
        *_asked_words(asked, verdict),
        *(_rooms(first, many) if first is not None and (model is None or not logged) else []),
        *apart,
    ]
    if verdict.startswith("nothing") or verdict == "cannot tell":
        notes.append(_visible(found, len(channels)))
    if verdict == "contact" and float(np.sqrt(np.mean(difference**2))) > ANOTHER:
        notes.append("so much differs that they may be another machine's, or of sensors in other places")
    notes += [f"hardly bent, where they settle does not show, and left out: {listed(straight)}"] if straight else []
    left = sorted({c for s in seen for c in s.channels} - set(channels) - set(straight))
    notes += [f"not in every run and left out: {', '.join(left)}"] if left else []
    notes += ["of one sensor, its own change is not told from the machine's"] if len(channels) == 1 else []
    likely = [c for c in found if c.probability > 0.001 or c.kind == "nothing"]
    notes[:0] = _or_else(likely, channels, status)
    records = [_record(names, c, channels, verdict, status, None if k else notes) for k, c in enumerate(likely)]
    return records, Difference(tuple(channels), difference, deviation, verdict)


def _with_room(fits: Sequence[Fit], starts: Array, old: int, found: list[Change], same_start: float) -> list[Change]:
    """Kinds of change with another room among them: a logged one, or one in which sensors began (K, S) [degC] elsewhere.

    fits of the `old` runs come first; same_start is the probability that it was not the machine that began warm.
    """
    if fits[0].run.sink_c is not None:
        rooms, error, likely = np.array([f.run.sink_c or 0.0 for f in fits]), ROOM_ERROR, 1.0
    else:
        rooms, moved, likely = starts.mean(axis=1), starts[old:].mean(axis=0) - starts[:old].mean(axis=0), same_start
        error = max(float(np.std(moved, ddof=1)) / math.sqrt(len(moved)), ROOM_ERROR) if len(moved) > 1 else 3.0 * ROOM_ERROR
    size = float(rooms[old:].mean() - rooms[:old].mean())
    deviation = error * math.sqrt(1.0 / old + 1.0 / (len(fits) - old))
    return with_room(found, likely * other_room(rooms[:old], rooms[old:], error), size, deviation)


def _observed(one: Started) -> Observations:
    run, start = one
    seen = observe(run, start).seen
    if seen is None or int(seen.used.sum(axis=1).min()) < FEWEST_READINGS:
        every = seen is None or int(seen.used.sum(axis=1).max()) < FEWEST_READINGS
        raise UsageError(
            f"{run.name}: too few readings",
            allowed=f"{FEWEST_READINGS} or more in every sensor",
            do="give a longer run" if every else "choose --channels",
        )
    return seen


def _same_way(fits: Sequence[Fit], old: int) -> None:
    """Raises UsageError where the new runs cool down and the `old` ones warm up, or the other way round."""
    moves = [_rise(f) for f in fits]
    before, after = np.mean(moves[:old], axis=0), np.mean(moves[old:], axis=0)
    against = before * after < 0.0
    if against.mean() > 0.5:
        way = ("warms up", "cools down") if float(np.median(before)) > 0.0 else ("cools down", "warms up")
        raise UsageError(
            "what changed cannot be told from runs that go opposite ways",
            found=f"{fits[0].run.name} {way[0]}, {fits[-1].run.name} {way[1]}",
            do="compare a warm-up with a warm-up",
        )


def _rise(fit: Fit) -> Array:
    """Fitted rises (S,) [K]."""
    rise: Array = np.asarray(fit.values[LEVEL], dtype=float) - np.asarray(fit.values[START], dtype=float)
    return rise


def _straight(fits: Sequence[Fit]) -> list[str]:
    """Sensors that in some run move little and are hardly bent, while others are: what is known of them lies along no line of
    logarithms. One that moves as much as the others is what a run is of, however straight.
    """
    channels, unsure = fits[0].run.channels, np.zeros(fits[0].run.sensors)
    for fit in fits:
        numbers = RunNumbers.of(fit, widening(fit))
        if numbers is not None:
            unsure = np.maximum(unsure, np.sqrt(np.diag(numbers.covariance)).reshape(2, -1).max(axis=0))
    bent = unsure <= UNKNOWN
    if bent.sum() < max(2.0, ENOUGH * len(bent)):
        return []
    moved = np.mean([f.run.moved for f in fits], axis=0)
    weak = ~bent & (moved < WEAK * float(np.median(moved[bent])))
    return [c for c, left_out in zip(channels, weak, strict=True) if left_out]


def _numbers(fit: Fit, drift: float) -> RunNumbers:
    found = RunNumbers.of(fit, widening(fit), drift)
    if found is None or not np.all(np.isfinite(found.covariance)):
        raise UsageError(
            f"{fit.run.name}: a sensor does not move", found=", ".join(fit.run.channels[:8]), do="choose others with --channels"
        )
    return found


def _verdict(found: Sequence[Change], unsure: float) -> tuple[str, str]:
    """The kind that is sure, two that are together, or none; and the status. unsure: deviation of the logarithm of the rates."""
    kinds: dict[str, float] = {}
    for c in found:
        kinds[c.kind] = kinds.get(c.kind, 0.0) + c.probability
    slope = kinds.get("heat", 0.0) + kinds.get("heat capacity", 0.0)
    if unsure > STRAIGHT and slope >= SURE:
        return "heat or heat capacity", "not_determined"
    first, *rest = sorted(kinds, key=lambda k: -kinds[k])
    if kinds[first] >= SURE:
        return first, "ok"
    if kinds[first] + kinds[rest[0]] >= EITHER:
        return f"{first} or {rest[0]}", "not_determined"
    return "cannot tell", "not_determined"


def _said(c: Change, channels: Sequence[str]) -> str:
    """A change in words, with its size where it has one."""
    size = math.exp(c.size) if c.size is not None and c.deviation is not None and c.kind != "room" and not c.kelvin else None
    percent = "" if size is None else f"by {rounded(abs(100.0 * (size - 1.0)))} %"
    up = size is None or size > 1.0
    return WORDS["probe" if c.kelvin else c.kind].format(
        more=f"{'more' if up else 'less'} {percent}",
        less="less" if up else "more",
        slower=f"{'slower' if up else 'faster'} {percent}",
        quicker=f"{'sooner' if up else 'later'}, {percent}",
        sensor=channels[c.sensor] if c.sensor is not None else "",
        other=channels[c.other] if c.other is not None else "",
        kelvin=rounded(abs(c.size or 0.0)),
        warmer="warmer" if (c.size or 0.0) > 0.0 else "colder",
        higher="higher" if (c.size or 0.0) > 0.0 else "lower",
    )


def _or_else(likely: Sequence[Change], channels: Sequence[str], status: str) -> list[str]:
    """What it may be as well, where that nothing changed is likeliest and not sure: the next change, with its size."""
    if status == "ok" or likely[0].kind != "nothing" or len(likely) < 2:
        return []
    return [f"it is not sure: with {100.0 * likely[1].probability:.0f} % {_said(likely[1], channels)}"]


def _of_a_size(found: Sequence[Change]) -> bool:
    """Whether the likeliest change of the whole machine has a size whose interval excludes that there is none."""
    first = next((c for c in found if c.kind in WHOLE), None)
    if first is None or first.size is None or first.deviation is None:
        return False
    return abs(first.size) > 1.96 * first.deviation


def _record(names: str, c: Change, channels: Sequence[str], verdict: str, status: str, notes: list[str] | None) -> ChangedRecord:
    size, low, high = None, None, None
    kelvin: tuple[float | None, ...] = None, None, None
    if c.size is not None and c.deviation is not None:
        sides = [c.size + k * c.deviation for k in (0.0, -1.96, 1.96)]
        if c.kind == "room" or c.kelvin:
            kelvin = tuple(sides)
        else:
            size, low, high = map(math.exp, sides)
    sensor = " and ".join(channels[i] for i in (c.sensor, c.other) if i is not None)
    said = _said(c, channels)
    said = said if status == "ok" else f"likeliest, with {100.0 * c.probability:.0f} %: {said}"
    message = "" if notes is None else "; ".join([said, *notes])  # what is less likely is not put in words
    return ChangedRecord(
        names,
        sensor,
        change=c.kind,
        probability=round(c.probability, 4),
        size=size,
        size_lo=low,
        size_hi=high,
        difference_k=kelvin[0],
        difference_lo_k=kelvin[1],
        difference_hi_k=kelvin[2],
        verdict=verdict,
        status=status,
        message=message,
    )


def _visible(found: Sequence[Change], sensors: int) -> str:
    """How large a change would most likely have shown, of so many sensors."""
    sizes = [
        f"{c.kind} by {rounded(100.0 * math.expm1(SHOWS * c.deviation))} %"
        for c in found
        if c.kind in WHOLE and c.deviation is not None
    ]
    each = [SHOWS * c.deviation for c in found if c.kind == "sensor" and not c.kelvin and c.deviation is not None]
    if each:
        least, most = (rounded(100.0 * math.expm1(size), 2) for size in (min(each), max(each)))
        sizes.append(
            f"the rise of one sensor alone by {least} %" if least == most else f"that of one sensor by {least} to {most} %"
        )
    sizes += ["a contact by what it moves a sensor's rise"] if each else []
    sizes += [f"one probe by {rounded(SHOWS * c.shows)} K" for c in found if c.kelvin and c.kind == "sensor" and c.shows]
    alone = "" if sensors < 3 or any(c.kelvin for c in found) else "; a probe that is off only shows beside two old runs and more"
    return f"would most likely have shown: {', '.join(sizes)}{alone}"


def _first(seen: Sequence[Observations], channels: Sequence[str], model: Model | None) -> Array | None:
    """First readings (K, S) [degC] of the runs, in the first place those that a model was learnt from: what its fit makes of them
    is no reading. None where it does not say.
    """
    of = [s.only(list(channels)) for s in seen]
    some = 1 if model is None else 3  # as past runs are kept in a model: a point near the heat moves from the first reading on
    first = np.array([[np.median(row[u][:some]) for row, u in zip(s.reading, s.used, strict=True)] for s in of])
    if model is not None:
        told = first_readings(model.file, channels)
        if told is None:
            return None
        first[0] = told
    return first


def _rooms(first: Array, old: int) -> list[str]:
    """What to say where the new runs, which follow `old` others, began in another room; first (K, S) [degC]."""
    began = np.nanmedian(first, axis=1)
    before, after = float(np.mean(began[:old])), float(np.mean(began[old:]))
    return [f"they began at {after:.3g} degC, the old ones at {before:.3g}"] if abs(after - before) > ROOM else []


def _asked_for(runs: Sequence[Observations], old: int) -> dict[str, float]:
    """Of each column that all runs log and of which the new runs had more, or less, than the `old` ones: by which factor."""
    found = {}
    for name in runs[0].inputs if all(r.inputs for r in runs) else ():
        means = np.array([float(np.mean(r.inputs[name][r.used.any(axis=0)])) if name in r.inputs else np.nan for r in runs])
        if not (np.all(means > 0.0) or np.all(means < 0.0)):
            continue
        level = np.log(np.abs(means))
        moved = float(level[old:].mean() - level[:old].mean())
        if abs(moved) > max(LOGGED, FARTHER * float(level[:old].std())):
            found[name] = math.exp(moved)
    return found


def _accounts_for(heat: Change, ratio: float) -> bool:
    """Whether a column that became `ratio` times as much is why the heat did."""
    unsure = 1.96 * (heat.deviation or 0.0)
    return heat.size is not None and abs(math.log(ratio) - heat.size) < max(unsure, AS_ASKED * abs(heat.size))


def _asked_words(asked: dict[str, float], verdict: str) -> list[str]:
    """What to say of logged columns that were not as they were."""
    words = [
        f"{name} was {abs(100.0 * (r - 1.0)):.0f} % {'more' if r > 1.0 else 'less'} than in the old runs"
        for name, r in asked.items()
    ]
    if words and verdict == "nothing or heat":
        words.append("so much heat was asked for, and the machine may be as it was: compare runs of the same load")
    return words


def _late(warmer: Array, rise: Array) -> list[str]:
    """What to say where the new runs begin well up on their rise, warmer (S,) [K] each in its way, with `rise` (S,) [K] to go."""
    up = warmer * np.sign(rise)
    share = np.sort(up / np.maximum(up + np.abs(rise), 1e-9))[-2:]
    if len(share) < 2 or share[0] < LATE or float(np.std(warmer)) < UNEVEN * float(np.mean(up)):
        return []
    most = rounded(float(up.max()))
    return [f"the new runs begin up to {most} K up on their rise: as if logged late, or begun warm; compare runs that begin alike"]


def _bent(fits: Sequence[Fit], old: int, channels: Sequence[str]) -> list[str]:
    """What to say where runs of one side leave the law of one rise far more than those of the other; the `old` ones come first."""
    left = []
    for fit in fits:
        noise = [
            third_difference_noise(row[used], fit.run.time[used]) for row, used in zip(fit.residual, fit.run.used, strict=True)
        ]
        misfit = np.array([np.mean(np.square(row[used])) for row, used in zip(fit.residual, fit.run.used, strict=True)])
        left.append(np.sqrt(np.maximum(misfit - np.square(noise), 0.0)))
    kelvin = np.array(left)
    rises = np.array([_rise(f) for f in fits])
    # The fitted rise of one that hardly moves may be anything.
    share = kelvin / np.maximum([f.run.moved for f in fits], np.abs(rises))
    for mine, side, others, other in ((slice(old, None), "new", slice(old), "old"), (slice(old), "old", slice(old, None), "new")):
        most, usual = share[mine].max(axis=0), share[others].max(axis=0)
        i = int(np.argmax(np.where(most > MORE_BENT * usual, most, 0.0)))
        far, near = (float(kelvin[s, i].max()) for s in (mine, others))
        if most[i] > BENT and most[i] > MORE_BENT * usual[i] and far > LOCAL:
            left_by = f"by {rounded(far)} K in the {side} runs, by {rounded(near)} K in the {other} ones"
            words = f"{channels[i]} leaves the law of one rise {left_by}"
            return [f"{words}: as if its load or cooling had changed within; compare tests of one course"]
    return []


def _apart(first: Array, old: int, channels: Sequence[str]) -> list[str]:
    """What to say of sensors that began the new runs elsewhere against the others than the `old` ones before them."""
    if len(channels) < 2:
        return []
    begun, alone = begun_beside(first, old)
    went = np.abs(begun[old:].mean(axis=0) - begun[:old].mean(axis=0))
    others = np.array([float(np.median(np.delete(went, i))) for i in range(len(went))])
    far = went > np.maximum(APART, FARTHER * np.maximum(begun[:old].std(axis=0), others))
    moved = alone[old:].mean(axis=0) - alone[:old].mean(axis=0)
    words = {True: ("higher", "warmer than they were", "high"), False: ("lower", "colder than they were", "low")}
    found = []
    for i in np.flatnonzero(far).tolist():
        side, was, reads = words[bool(moved[i] > 0.0)]
        size = rounded(abs(float(moved[i])))
        found.append(f"{channels[i]} began {size} K {side} against the others than before: {was}, or its probe reads {reads}")
    return found
