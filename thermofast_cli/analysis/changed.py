"""``changed``: what is different in a machine since other runs of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations, third_difference_noise
from thermofast.models.joint import Fit
from thermofast.models.uncertainty.changes import (
    LOCAL,
    WHOLE,
    Change,
    begun_beside,
    changes,
    other_room,
    rates_and_rises,
    with_offset,
    with_room,
)

from ..errors import listed, rounded
from ..machine.model import Model
from ..records import ChangedRecord
from ..workers.engine import Started
from .sides import ROOM_ERROR, Sides

Array = NDArray[np.float64]

#: Probability from which one kind is said, and two together as "A or B".
SURE, EITHER = 0.9, 0.95
#: Deviation of the logarithm of a rate, median over the sensors, from which a record is hardly bent: a first slope is heat over
#: heat capacity, and which of the two changed it does not say.
STRAIGHT = 0.25
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
#: Probability, of runs that are as the old ones, from which they were logged late.
LOGGED_LATE = 0.5
#: Misfit of the law beyond the noise, over the rise, from which a run is bent, and by how many times that of the other side's runs.
BENT, MORE_BENT = 0.04, 4.0
#: A sensor that ends where it did, to within so much of what it began warmer, is no probe that tells more throughout.
ENDS_ALIKE = 0.5
#: Runs so many times as long as the shortest are cut, and that is said.
LONGER = 1.1
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
    sides = Sides.of(old, new, model)
    seen_as = changes(*sides.numbers(), sides.begun, sides.by_length)
    found, difference, deviation = seen_as.changes, seen_as.difference, np.sqrt(np.diag(seen_as.noise))
    if sides.knows_rooms:
        found = _with_room(sides.fits, sides.starts, sides.old, found, seen_as.same_start)
    swapped = found[0].kind == "exchanged" and found[0].probability >= SURE
    late = seen_as.late > LOGGED_LATE
    # Each of two that were exchanged began elsewhere, and neither probe is off; of runs that were logged late all had risen.
    if sides.first is not None and not swapped and not late:
        begin = sides.starts if model is None else sides.first
        of_rises = deviation[len(sides.channels) :]
        found = with_offset(found, begin, sides.levels - sides.starts, sides.old, of_rises, sides.stand_for, sides.misfit_at_start)
    judged = _judged(sides, found, swapped, float(np.median(deviation[: len(sides.channels)])))
    begun = _late_words(sides.warmer) if late and judged.verdict.startswith("nothing") else []
    if begun and sides.begun.late is not None:
        begun.append(f"they are as the old ones from about {rounded(sides.begun.late.minutes)} min on")
    notes = [*judged.notes, *begun, *_beyond_kinds(sides, found, judged.verdict, difference)]
    likely = [c for c in found if c.probability > 0.001 or c.kind == "nothing"]
    notes[:0] = _or_else(likely, sides.channels, judged.status)
    names, told = ", ".join(run.name for run, _ in new), (judged.verdict, judged.status)
    records = [_record(names, c, sides.channels, *told, None if k else notes) for k, c in enumerate(likely)]
    return records, Difference(sides.channels, difference, deviation, judged.verdict)


@dataclass(frozen=True)
class _Judged:
    """What is said to have changed, and what speaks against saying so, or beside it."""

    verdict: str
    status: str
    notes: list[str]


def _judged(sides: Sides, found: Sequence[Change], swapped: bool, unsure: float) -> _Judged:
    """The verdict on kinds of change, where the runs allow one; swapped: two sensors were exchanged. unsure as in _verdict."""
    verdict, status = _verdict(found, unsure)
    asked = _asked_for([f.run for f in sides.fits], sides.old) if sides.model is None else {}
    if verdict == "heat" and any(_accounts_for(found[0], ratio) for ratio in asked.values()):
        verdict, status = "nothing or heat", "not_determined"
    apart = _began_apart(sides, found) if not swapped else []
    late = _logged_late(sides, found[0], verdict)
    bent = _bent(sides.fits, sides.old, sides.channels) if not verdict.startswith("nothing") else []
    if late or bent:
        # What each sensor does by itself is how the machine had warmed; of a load that changed within rate and rise tell nothing.
        verdict, status = "cannot tell", "not_determined"
    if verdict == "nothing" and (apart or _of_a_size(found)):  # rates and rises do not know of a probe that is off
        status = "not_determined"
    rooms = _rooms(sides.first, sides.old) if sides.first is not None and sides.knows_rooms else []
    return _Judged(verdict, status, [*late, *bent, *_asked_words(asked, verdict), *rooms, *apart])


def _began_apart(sides: Sides, found: Sequence[Change]) -> list[str]:
    """What to say of sensors that began elsewhere against the others, but for a probe that is told to be off."""
    if sides.first is None:
        return []
    told = {sides.channels[c.sensor] for c in found[:1] if c.kelvin and c.sensor is not None}
    apart = _apart(sides.first, sides.old, sides.channels)
    return [n for n in apart if not any(n.startswith(f"{c} began") for c in told)]


def _logged_late(sides: Sides, first: Change, verdict: str) -> list[str]:
    """What to say where sensors that changed each in their way began the new runs well up on their rise."""
    if verdict not in ("sensor", "contact"):
        return []
    others = np.arange(len(sides.rise)) != (first.sensor if verdict == "sensor" else None)
    # Where a test is logged late the sensor that is accused ends where it did, too: it began up on its rise.
    others |= np.abs(sides.settles_higher) < ENDS_ALIKE * np.abs(sides.warmer)
    return _late(sides.warmer[others], sides.rise[others])


def _beyond_kinds(sides: Sides, found: Sequence[Change], verdict: str, difference: Array) -> list[str]:
    """What to know beside the kind of change: what would have shown, another machine, and sensors that do not count."""
    channels, notes = sides.channels, list[str]()
    if verdict.startswith("nothing") or verdict == "cannot tell":
        notes.append(_visible(found, len(channels)))
    if verdict == "contact" and float(np.sqrt(np.mean(difference**2))) > ANOTHER:
        notes.append("so much differs that they may be another machine's, or of sensors in other places")
    if sides.straight:
        notes.append(f"hardly bent, where they settle does not show, and left out: {listed(sides.straight)}")
    shortest, longest = (how(s.span for s in sides.seen) for how in (min, max))
    if sides.model is None and longest > LONGER * shortest:
        notes.append(f"looked at over their first {rounded(shortest)} min, the length of the shortest run")
    if sides.left_out:
        notes.append(f"not in every run and left out: {', '.join(sides.left_out)}")
    if len(channels) == 1:
        notes.append("of one sensor, its own change is not told from the machine's")
    return notes


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
    sizes[:1] = [f"of the whole machine {size}" for size in sizes[:1]]
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
    return _late_words(up)


def _late_words(up: Array) -> list[str]:
    """What to say of runs that begin up (S,) [K] on their rise."""
    most = rounded(float(np.abs(up).max()))
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
    rises = np.array([rates_and_rises(f)[1] for f in fits])
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
