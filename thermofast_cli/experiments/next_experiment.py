"""The next experiment: which run would settle what a search left open, by simulation through the search itself.

Each cause that a search could not exclude is taken for the truth in turn; the run that it would give in a possible experiment is
simulated, with the noise and a disturbance like the ones of the record at hand, and searched as the record was. An experiment is
worth what share of such runs ends with the true cause named, and it alone.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from thermofast.models import Observations
from thermofast.models.greybox import SINK, Key, Model
from thermofast.models.joint import Fit, Part
from thermofast.models.search.candidates import Candidate
from thermofast.models.search.discover import Discovery, discover, discover_together
from thermofast.models.search.judge import least_p, sensor_p_values
from thermofast.models.search.rules import RULES

Array = np.ndarray[Any, np.dtype[np.float64]]
Spread = Callable[..., Iterable[Any]]

#: Runs simulated for each cause and experiment; causes that are told apart; sweeps until sensors that heat each other agree.
DRAWS, MOST_CAUSES, SWEEPS = 8, 3, 12
#: An experiment that settles so large a share is good enough: the least effort among such is proposed.
GOOD = 0.9
#: One that settles less is not proposed.
LEAST = 0.5


@dataclass(frozen=True)
class Experiment:
    """One possible run, and in how many of the `runs` simulated it would name the true cause alone; effort orders them."""

    name: str
    effort: int
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


def possible(seen: Observations) -> list[Experiment]:
    """Experiments that may be tried on a machine of which this was seen, those of least effort first."""
    span = seen.span
    cool = max(60.0, 0.5 * span)
    off = f"with the heat off for {cool:.0f} min at its end"
    return [
        Experiment("the same run once more", 1),
        Experiment(f"the same run, read {FASTER} times as often", 2),
        Experiment(f"the same run {off}, logged (--drive)", 3),
        Experiment(f"the same run for {2.0 * span:.0f} min", 4),
        Experiment(f"the same run {off} and on again as long, logged (--drive)", 5),
        Experiment(f"the same run, read {FASTER} times as often, {off} and on again as long, logged (--drive)", 6),
    ]


FASTER = 4


def _grid(k: int, seen: Observations) -> tuple[Array, Array | None]:
    """Times (N,) [min] of the k-th possible experiment and the heat (N,) where it is switched, both beside the nominal 1."""
    time, span = seen.time, seen.span
    step = float(np.median(np.diff(time)))
    further = np.arange(time[-1] + step, time[0] + 2.0 * span + 1e-9, step)
    if k == 1:
        return np.linspace(time[0], time[-1], FASTER * (len(time) - 1) + 1), None
    cool = max(60.0, 0.5 * span)
    if k in (2, 4, 5):
        more = np.arange(time[-1] + step, time[-1] + (cool if k == 2 else 2.0 * cool) + 1e-9, step)
        return np.concatenate([time, more]), np.concatenate([np.ones(len(time)), np.where(more <= time[-1] + cool, 0.0, 1.0)])
    return (np.concatenate([time, further]) if k == 3 else time), None


def simulated(fit: Fit, k: int, rng: np.random.Generator) -> Observations:
    """A run of the machine that `fit` describes in the k-th possible experiment."""
    seen = fit.run
    time, heat = _grid(k, seen)
    if seen.heat is not None:
        before = np.interp(time, seen.time, seen.heat)
        heat = before if heat is None else before * heat
    ambient, inputs = ({c: np.interp(time, seen.time, v) for c, v in columns.items()} for columns in (seen.ambient, seen.inputs))
    weight = np.array([np.interp(time, seen.time, np.where(w > 0.0, w, np.median(w[w > 0.0]))) for w in seen.weight])
    weight *= FASTER if k == 5 else 1.0  # what is read more often than is needed is averaged
    drive = seen.drive if heat is None or seen.drive else "heat"
    run = replace(seen, time=time, reading=np.zeros((seen.sensors, len(time))), weight=weight, heat=heat, drive=drive)
    run = replace(run, ambient=ambient, inputs=inputs)
    # The first readings tell the surroundings where nobody logs them.
    run.reading[:] = fit.curve[:, :1]
    told: dict[Key, Any] = {**fit.values}
    told.setdefault(Key(-1, SINK.name), fit.model.sink_guess)
    parts = fit.model.parts if heat is None else [_scaling(p) for p in fit.model.parts]
    sensors = np.arange(seen.sensors)
    for _ in range(SWEEPS if any(p.effect.reads_sensors for p in parts) else 1):
        model = Model(run, parts)
        local, shared = model.vector(told)
        curve = model.forward(local, np.broadcast_to(shared, (seen.sensors, len(shared))), sensors)
        run = replace(run, reading=curve)
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


#: Neighbouring residuals averaged: what is left is slow, the white noise is drawn anew.
SMOOTH = 9


def _trial(item: tuple[int, int, int], truths: Sequence[Fit], ids: Sequence[frozenset[str]], effects: Sequence[Any]) -> bool:
    """Whether one simulated experiment (experiment, cause, draw) ends with its cause named, and it alone."""
    k, cause, draw = item
    fit = truths[cause]
    run = simulated(fit, k, np.random.default_rng([2_000, k, cause, draw]))
    if k == 0 and _settles(discover_together([fit.run, run], effects)[1], ids[cause]):
        return True
    return _settles(discover(run, effects), ids[cause])


def _settles(found: Discovery, truth: frozenset[str]) -> bool:
    """Whether a search names the true cause, and nothing else is possible."""
    return found.named is not None and all(frozenset(c.ids) == truth for c in (found.named, *found.also))


def next_experiments(found: Discovery, effects: Sequence[Any], spread: Spread = map, draws: int = DRAWS) -> list[Experiment]:
    """Possible experiments with how often each would settle what the search left open; the one to propose first.

    effects is the catalogue that was searched; only those of the open causes are tried. Empty where nothing is open.
    """
    open_ = causes(found)
    if not open_:
        return []
    ids = [frozenset(c.ids) for c in open_]
    some = [e for e in effects if any(e.id in i for i in ids)]
    fits = [c.fit for c in open_]
    offers = possible(found.base.run)
    items = [(k, c, d) for k in range(len(offers)) for c in range(len(fits)) for d in range(draws)]
    said = list(spread(partial(_trial, truths=fits, ids=ids, effects=some), items))
    told = []
    for k, offer in enumerate(offers):
        mine = [s for s, item in zip(said, items, strict=True) if item[0] == k]
        told.append(replace(offer, settled=sum(mine), runs=len(mine)))
    good = [e for e in told if e.share >= GOOD]
    first = min(good, key=lambda e: (e.effort, -e.share)) if good else max(told, key=lambda e: (e.share, -e.effort))
    return [first, *sorted((e for e in told if e is not first), key=lambda e: -e.share)]


def experiment_words(experiments: Sequence[Experiment]) -> str:
    """'next: the same run with ... would settle it in 15 of 16 simulated runs (once more: 2 of 16)'; or that none does."""
    if not experiments:
        return ""
    first = experiments[0]
    again = next(e for e in experiments if e.effort == 1)
    beside = "" if first is again else f" ({again.name}: {again.settled})"
    if first.share < LEAST:
        return (
            f"no run that was simulated settles it: the best, {first.name}, in {first.settled} of {first.runs}{beside}; "
            "log what may have changed beside it"
        )
    return f"next: {first.name} would settle it, in {first.settled} of {first.runs} simulated{beside}"
