"""Links in both directions: a sensor that warms another is warmed by it, whether or not the readings ask for that."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..core.kernel import Array
from ..effects.base import Choice, Effect
from ..joint import RATE, Fit, Key, Part, fit_model, with_parts
from ..observations import Observations
from .rules import RULES


def both_ways(fit: Fit) -> Fit:
    """The fit with the other direction of each link that it has in one only, as far as a link can have it.

    A search gives a sensor what its readings cannot do without. Heat is conducted both ways (Fourier): how much of it flows back
    is then unknown rather than nothing, and the covariance of the fit says so.
    """
    for at, part in enumerate(fit.model.parts):
        if part.effect.reads_sensors:
            fit = _each_its_own(completed(fit, at, range(fit.run.sensors)), at)
    return fit


def beside_shared(fit: Fit) -> Fit:
    """The fit with its links in both directions where all sensors share something beside them: how large that is depends on these.

    Sensors that hardly move are left as they are: what would flow from them nothing tells.
    """
    moved = [int(i) for i in np.flatnonzero(np.ptp(fit.curve, axis=1) > RULES.moved * fit.noise)]
    for at, part in enumerate(fit.model.parts):
        if part.effect.reads_sensors and any(0 <= c.part != at for c in fit.model.shared):
            found = [_each_its_own(other, at) for other in (completed(fit, at, moved), *linked_alike(fit, at, moved))]
            fit = min((other for other in found if other.physical), key=lambda other: float(other.rss.sum()), default=fit)
    return fit


def linked_alike(fit: Fit, at: int, sensors: Sequence[int] = ()) -> Iterator[Fit]:
    """The fit with all sensors, or these and those that are linked, linked in each plain way in which all of a run may be."""
    part, parts, n = fit.model.parts[at], [*fit.model.parts], fit.run.sensors
    who = [not sensors or i in sensors or bool(w) for i, w in enumerate(part.concerns(n))]
    for choice in ways_for_all(part.effect, fit.run):
        if choice.simple:
            parts[at] = Part(part.effect, choice, None if all(who) else tuple(who))
            values, key = with_parts(fit, parts), Key(at, part.effect.amplitude)
            yield fit_model(fit.run, parts, values | {key: np.maximum(values[key], 0.5 * fit.values[RATE])})


def ways_for_all(effect: Effect, run: Observations) -> list[Choice]:
    """The ways of acting in which every sensor of a run is linked, each to those that are linked to it in turn."""
    sensors = range(run.sensors)
    return [c for c in effect.choices(run) if c.by_sensor and go_both_ways([c.ends(i) for i in sensors])]


def go_both_ways(ends: Sequence[set[int]]) -> bool:
    """Whether each of the sensors that a sensor is linked to, ends (S,), is linked to it in turn."""
    return all(i in ends[j] for i, mine in enumerate(ends) for j in mine)


def completed(fit: Fit, at: int, sensors: Iterable[int]) -> Fit:
    """The fit in which the sensors are also warmed by those that they warm, where that is no worse fit."""
    for sensor in sensors:
        found = [_with(fit, at, sensor, choice) for choice in _fuller(fit, fit.model.parts[at], sensor)]
        better = [other for other in found if other.physical and other.rss.sum() <= fit.rss.sum() * (1.0 + 1e-9)]
        fit = min(better, key=lambda other: float(other.rss.sum()), default=fit)
    return fit


def _each_its_own(fit: Fit, at: int) -> Fit:
    """The fit with the parameters of the part that the search left out as not needed: neighbours are hardly ever coupled alike."""
    part, parts = fit.model.parts[at], [*fit.model.parts]
    for choice in part.effect.choices(fit.run):
        if choice.by_sensor and set(choice.omitted) < set(part.choice.omitted):
            parts[at] = replace(part, choice=replace(part.choice, omitted=choice.omitted))
            values, key = with_parts(fit, parts), Key(at, part.effect.amplitude)
            # Where the search has come to nothing of it, a ratio to that changes nothing.
            anew = values | {key: np.maximum(values[key], 0.5 * fit.values[RATE] * part.concerns(fit.run.sensors))}
            for found in (fit_model(fit.run, parts, start) for start in (values, anew)):
                fit = found if found.physical and found.rss.sum() <= fit.rss.sum() * (1.0 + 1e-9) else fit
    return fit


def _fuller(fit: Fit, part: Part, sensor: int) -> Iterator[Choice]:
    """Choices that keep what a sensor is warmed by and add most of those that it warms."""
    who = part.concerns(fit.run.sensors)
    have = part.choice.ends(sensor) if who[sensor] else set()
    warmed = {int(j) for j in np.flatnonzero(who) if sensor in part.choice.ends(int(j))}
    could = [(c, c.ends(sensor)) for c in part.effect.choices(fit.run)]
    could = [(c, ends) for c, ends in could if have < ends and ends <= have | warmed]
    most = max((len(ends) for _, ends in could), default=0)
    return (c for c, ends in could if len(ends) == most)


def _with(fit: Fit, at: int, sensor: int, choice: Choice) -> Fit:
    part, sensors = fit.model.parts[at], range(fit.run.sensors)
    who = part.concerns(fit.run.sensors)
    mine = Choice.composed([choice if i == sensor else part.choice for i in sensors])
    parts = [*fit.model.parts]
    parts[at] = replace(part, choice=mine, concerned=tuple(bool(w or i == sensor) for i, w in enumerate(who)))
    values = with_parts(fit, parts)
    if not who[sensor]:
        key = Key(at, part.effect.amplitude)
        amplitude: Array = np.array(values[key], dtype=float)
        amplitude[sensor] = 0.5 * float(fit.values[RATE][sensor])
        values[key] = amplitude
    return fit_model(fit.run, parts, values)
