"""The next experiment: which run would settle what a search left open, by simulation through the search itself.

Each cause that a search could not exclude is taken for the truth in turn; the run that it would give in a possible experiment is
simulated, with the noise and a disturbance like the ones of the record at hand, and searched as the record was. An experiment is
worth what share of such runs ends with the true cause named, and it alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from thermofast.models import Observations
from thermofast.models.core.kernel import Array
from thermofast.models.greybox import SINK, Key, Model
from thermofast.models.joint import LEVEL, START, Fit, Part
from thermofast.models.relaxation import relaxed
from thermofast.models.search.candidates import Candidate
from thermofast.models.search.discover import Discovery, Spread, discover, discover_together
from thermofast.models.search.judge import least_p, sensor_p_values
from thermofast.models.search.rules import RULES

from ..errors import rounded

#: Runs simulated for each cause and experiment; causes that are told apart.
DRAWS, MOST_CAUSES = 8, 3
#: Runs of these after which only so many experiments, those that settled most, are simulated on.
FEW_DRAWS, KEPT = 2, 3
#: An experiment that settles so large a share is good enough: the least effort among such is proposed.
GOOD = 0.9
#: One that settles less is not proposed.
LEAST = 0.5
#: How many times as often a logger may read; the heat is off for this share of the record, and no less than so long [min].
FASTER, OFF_SHARE, LEAST_OFF = 4, 0.5, 60.0
#: The heat of another load or speed, over that of the record.
OTHER_LOAD = 0.5
#: A rise [K] that is one: more than a room that wanders gives.
SEEN_RISE = 0.2
#: Standard deviation [K] of a thermometer in a quiet room.
ROOM_NOISE = 0.05
#: Neighbouring residuals averaged: what is left is slow, the white noise is drawn anew.
SMOOTH = 9


@dataclass(frozen=True)
class Experiment:
    """One possible run, and in how many of the `runs` simulated it would name the true cause alone; effort orders them.

    The same run, `longer` by so many minutes, or with the heat off for `off` minutes after it, or at `load` times what it was, and
    on again for `on`, as logged; read `faster` times as often; with the `room` logged; or with the parts of all sensors but one,
    `heated`, left cold.
    """

    name: str
    effort: float
    longer: float = 0.0
    off: float = 0.0
    load: float = 0.0
    on: float = 0.0
    faster: int = 1
    room: bool = False
    heated: int | None = None
    settled: int = 0
    runs: int = 0

    @property
    def share(self) -> float:
        return self.settled / self.runs if self.runs else 0.0

    def as_dict(self) -> dict[str, Any]:
        """As a record has it."""
        return {"experiment": self.name, "settled": self.settled, "simulated": self.runs}


def causes(found: Discovery) -> list[Candidate]:
    """The models that a search could not exclude, the one named first; none where nothing fits, however near it comes."""
    fitting = found.also if found.named is not None else [c for c in found.also if c.at_floor]
    told: list[Candidate] = []
    for candidate in (*([found.named] if found.named is not None else []), *fitting):
        if all(set(candidate.ids) != set(t.ids) for t in told):
            told.append(candidate)
    return told[:MOST_CAUSES]


def possible(seen: Observations, open_: Sequence[Candidate] = ()) -> list[Experiment]:
    """Experiments that may be tried on a machine of which this was seen with these causes open, those of least effort first."""
    span = seen.span
    cool = max(LEAST_OFF, OFF_SHARE * span)
    off, faster = f"with the heat off for {cool:.0f} min at its end", f"read {FASTER} times as often"
    offers = [
        Experiment("the same run once more", 1),
        Experiment(f"the same run, {faster}", 2, faster=FASTER),
        Experiment(f"the same run {off}, logged (--drive)", 3, off=cool),
        Experiment(
            f"the same run and {cool:.0f} min more at half the load or speed, logged (--drive)", 3.5, off=cool, load=OTHER_LOAD
        ),
        Experiment(f"the same run for {2.0 * span:.0f} min", 4, longer=span),
        Experiment(f"the same run {off} and on again as long, logged (--drive)", 5, off=cool, on=cool),
        Experiment(f"the same run, {faster}, {off} and on again as long, logged (--drive)", 6, off=cool, on=cool, faster=FASTER),
    ]
    if not seen.ambient:
        offers.append(Experiment("the same run with the surroundings logged (--ambient)", 2.5, room=True))
    offers += _heat_one(seen, open_)
    return sorted(offers, key=lambda e: e.effort)


def _linked(candidate: Candidate) -> bool:
    return any(part.effect.reads_sensors for part in candidate.parts)


def _heat_one(seen: Observations, open_: Sequence[Candidate]) -> list[Experiment]:
    """To heat one part alone, where by some open cause it warms others enough to be seen, and by others it does not."""
    linked = [c for c in open_ if _linked(c)]
    if not linked or len(linked) == len(open_):
        return []
    count = np.zeros(seen.sensors)
    for part in linked[0].parts:
        for i in np.flatnonzero(part.concerns(seen.sensors)):
            count[list(part.choice.ends(int(i)))] += 1
    if not count.any():
        return []
    source = int(np.argmax(count))
    offer = Experiment(f"a run from cold in which only the part of {seen.channels[source]} is heated", 4.5, heated=source)
    rise = rises(simulated(linked[0].fit, offer, None), source)
    most = int(np.argmax(rise))
    if rise[most] < 2.0 * SEEN_RISE:
        return []
    links = " and ".join(sorted(p.id for p in linked[0].parts if p.effect.reads_sensors))
    return [replace(offer, name=f"{offer.name}: by {links} {seen.channels[most]} rises {rounded(rise[most])} K, else not")]


def rises(run: Observations, heated: int) -> Array:
    """By how much (S,) [K] each sensor rises from its first readings to its last; none for the heated one."""
    tenth = max(len(run.time) // 10, 1)
    rise = np.array([np.median(row[-tenth:]) - np.median(row[: max(tenth // 4, 1)]) for row in run.filled])
    rise[heated] = 0.0
    return rise


def planned(experiment: Experiment, time: Array) -> tuple[Array, Array | None]:
    """Times (N,) [min] of an experiment after a run read at `time`, and its heat (N,) beside the nominal 1 where it is switched."""
    step, end = float(np.median(np.diff(time))), float(time[-1])
    more = np.arange(end + step, end + experiment.longer + experiment.off + experiment.on + 1e-9, step)
    whole = np.concatenate([time, more])
    if experiment.off:
        return whole, np.where((whole > end) & (whole <= end + experiment.off), experiment.load, 1.0)
    if experiment.faster > 1:
        return np.linspace(time[0], end, experiment.faster * (len(time) - 1) + 1), None
    return whole, None


def simulated(fit: Fit, experiment: Experiment, rng: np.random.Generator | None) -> Observations:
    """A run of the machine that `fit` describes in an experiment; without noise and disturbance where there is no `rng`."""
    seen = fit.run
    time, heat = planned(experiment, seen.time[: seen.last + 1])
    if seen.heat is not None:
        before = np.interp(time, seen.time, seen.heat)
        heat = before if heat is None else before * heat
    ambient, inputs = ({c: np.interp(time, seen.time, v) for c, v in columns.items()} for columns in (seen.ambient, seen.inputs))
    weight = np.array([np.interp(time, seen.time, np.where(w > 0.0, w, np.median(w[w > 0.0]))) for w in seen.weight])
    if experiment.off:  # a long run that is read more often than it needs is averaged
        weight *= experiment.faster
    drive = seen.drive if heat is None or seen.drive else "heat"
    blank = np.zeros((seen.sensors, len(time)))
    run = replace(seen, time=time, reading=blank, weight=weight, heat=heat, drive=drive, extent=0.0)
    sink = float(fit.values.get(Key(-1, SINK.name), fit.model.sink_guess))
    if experiment.room:
        ambient = {"surroundings": sink + (ROOM_NOISE * rng.standard_normal(len(time)) if rng is not None else np.zeros(len(time)))}
    run = replace(run, ambient=ambient, inputs=inputs)
    # The first readings tell the surroundings where nobody logs them.
    run = replace(run, reading=np.broadcast_to(fit.curve[:, :1], run.reading.shape))
    told: dict[Key, Any] = {**fit.values}
    told.setdefault(Key(-1, SINK.name), sink)
    if experiment.heated is not None:
        cold = np.arange(seen.sensors) != experiment.heated
        told[LEVEL], told[START] = np.where(cold, sink, told[LEVEL]), np.full(seen.sensors, sink)
        run = replace(run, reading=np.full(run.reading.shape, sink))
    parts = fit.model.parts if heat is None else [_scaling(p) for p in fit.model.parts]
    sensors = np.arange(seen.sensors)

    def beside(curves: Array) -> Array:
        model = Model(replace(run, reading=curves), parts)
        local, shared = model.vector(told)
        return model.forward(local, np.broadcast_to(shared, (seen.sensors, len(shared))), sensors)

    curve = beside(run.reading)
    if any(p.effect.reads_sensors for p in parts):
        curve = relaxed(curve, beside)
    run = replace(run, reading=curve)
    if rng is None:
        return run
    white = rng.standard_normal(curve.shape) * seen.least_noise[:, None] / np.sqrt(np.maximum(weight, 1e-9))
    return replace(run, reading=curve + white + _disturbance(fit, time, rng))


def _scaling(part: Part) -> Part:
    """A change of the heat that is off when the heat is off, unless it follows a column of its own."""
    if not part.effect.changes_heat or part.choice.constants.get("column"):
        return part
    return replace(part, choice=replace(part.choice, constants={**part.choice.constants, "product": True}))


def _disturbance(fit: Fit, time: Array, rng: np.random.Generator) -> Array:
    """Slow residuals (S, N) of another day: those of the fit with random phases, the same for all sensors, going on for ever.

    None for a model that is down to the noise: there the smoothed residuals are only its noise.
    """
    run = fit.run
    if least_p(sensor_p_values(fit)) >= RULES.pattern:
        return np.zeros((run.sensors, len(time)))
    seen = np.flatnonzero(run.used.any(axis=0))
    even = np.linspace(run.time[seen[0]], run.time[seen[-1]], len(seen))
    kernel = np.ones(SMOOTH) / SMOOTH
    rows = []
    for row, used in zip(fit.residual, run.used, strict=True):
        there = np.interp(even, run.time[used], row[used])
        rows.append(np.convolve(np.pad(there, SMOOTH, mode="edge"), kernel, mode="same")[SMOOTH:-SMOOTH])
    spectrum = np.fft.rfft(np.array(rows), axis=1)
    phases = np.exp(2j * np.pi * rng.random(spectrum.shape[1]))
    phases[0] = 0.0
    other = np.fft.irfft(spectrum * phases, len(even), axis=1)
    return np.array([np.interp(time, even, row, period=float(even[-1] - even[0]) + 1e-9) for row in other])


def _trial(
    item: tuple[Experiment, int, int],
    truths: Sequence[Fit],
    ids: Sequence[frozenset[str]],
    effects: Sequence[Any],
    before: Sequence[Observations],
) -> bool:
    """Whether one simulated experiment (experiment, cause, draw) ends with its cause named, and it alone; before: the runs seen."""
    experiment, cause, draw = item
    fit = truths[cause]
    run = simulated(fit, experiment, np.random.default_rng([2_000, round(10.0 * experiment.effort), cause, draw]))
    if experiment.heated is not None:
        links = frozenset(e.id for e in effects if e.reads_sensors)
        with_link = [bool(links & i) for i in ids]
        return _settles_link(run, experiment.heated, with_link[cause], with_link.count(with_link[cause]))
    if experiment.effort == 1 and _settles(discover_together([*before, run], effects)[-1], ids[cause]):
        return True
    return _settles(discover(run, effects), ids[cause])


def _settles_link(run: Observations, heated: int, linked: bool, alike: int) -> bool:
    """Whether a run in which one part is heated says rightly if others are warmed by it, and that leaves one cause."""
    return alike == 1 and bool(np.max(rises(run, heated)) > SEEN_RISE) == linked


def _settles(found: Discovery, truth: frozenset[str]) -> bool:
    """Whether a search names the true cause, and nothing else is possible."""
    return found.named is not None and all(frozenset(c.ids) == truth for c in (found.named, *found.also))


def next_experiments(
    found: Discovery, effects: Sequence[Any], spread: Spread = map, draws: int = DRAWS, before: Sequence[Observations] = ()
) -> list[Experiment]:
    """Possible experiments with how often each would settle what the search left open; the one to propose first.

    effects is the catalogue that was searched; only those of the open causes are tried; before are the runs that were searched
    together. Empty where nothing is open.
    """
    open_ = causes(found)
    if not open_:
        return []
    ids = [frozenset(c.ids) for c in open_]
    some = [e for e in effects if any(e.id in i for i in ids)]
    fits = [c.fit for c in open_]
    offers = possible(found.base.run, open_)
    trial = partial(_trial, truths=fits, ids=ids, effects=some, before=before or (found.base.run,))

    def tried(of: Sequence[Experiment], drawn: range) -> list[Experiment]:
        items = [(offer, c, d) for offer in of for c in range(len(fits)) for d in drawn]
        settled = [item[0] for item, yes in zip(items, spread(trial, items), strict=True) if yes]
        count = len(fits) * len(drawn)
        return [replace(offer, settled=offer.settled + settled.count(offer), runs=offer.runs + count) for offer in of]

    best = told = sorted(tried(offers, range(min(FEW_DRAWS, draws))), key=lambda e: (-e.share, e.effort))
    if draws > FEW_DRAWS:
        best = tried(told[:KEPT], range(FEW_DRAWS, draws))
        told = [*best, *told[KEPT:]]
    good = [e for e in best if e.share >= GOOD]
    first = min(good, key=lambda e: (e.effort, -e.share)) if good else max(best, key=lambda e: (e.share, -e.effort))
    return [first, *sorted((e for e in told if e is not first), key=lambda e: -e.share)]


def experiment_words(experiments: Sequence[Experiment]) -> str:
    """'next: the same run with ... would settle it in 15 of 16 simulated runs (once more: 2 of 16)'; or that none does."""
    if not experiments:
        return ""
    first = experiments[0]
    again = next(e for e in experiments if e.effort == 1)
    of = "" if again.runs == first.runs else f" of {again.runs}"
    beside = "" if first is again else f" ({again.name}: {again.settled}{of})"
    if first.share < LEAST:
        return (
            f"no run that was simulated settles it: the best, {first.name}, in {first.settled} of {first.runs}{beside}; "
            "log what may have changed beside it"
        )
    return f"next: {first.name} would settle it, in {first.settled} of {first.runs} simulated{beside}"
