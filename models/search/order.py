"""The order of a set's effects in which it is told: the second of an effect behind the first."""

from dataclasses import replace

import numpy as np

from ..joint import Key, Model, search
from .candidates import Candidate


def in_order(candidate: Candidate) -> Candidate:
    """The set with the second of an effect behind the first: events by their time, in each sensor the slow behind the fast."""
    for name in candidate.ids:
        if f"{name}.2" in candidate.ids:
            candidate = _second_behind(candidate, name)
    return candidate


def _second_behind(candidate: Candidate, name: str) -> Candidate:
    old, places = candidate.parts, [candidate.ids.index(name), candidate.ids.index(f"{name}.2")]
    first, second = (old[k].effect for k in places)
    values = {key: np.array(value) for key, value in candidate.fit.values.items()}
    if first.event:
        places.sort(key=lambda k: float(np.min(values.get(Key(k, first.event or ""), -np.inf))))
    at = sorted(places)
    parts = list(old)
    parts[at[0]], parts[at[1]] = replace(old[places[0]], effect=first), replace(old[places[1]], effect=second)
    moved = {Key(dict(zip(places, at, strict=True)).get(p, p), n): value for (p, n), value in values.items()}
    own = [p.name for p in first.parameters if p.each == "sensor"]
    pace = next((p.name for p in first.parameters if p.settles == "rate" and p.name in own), None)
    if pace is not None and not first.event:
        sensors = candidate.fit.run.sensors
        behind = moved[Key(at[0], pace)] < moved[Key(at[1], pace)]
        behind &= parts[at[0]].concerns(sensors) & parts[at[1]].concerns(sensors)
        for n in own:
            one, two = (moved[Key(k, n)] for k in at)
            moved[Key(at[0], n)], moved[Key(at[1], n)] = np.where(behind, two, one), np.where(behind, one, two)
    model = Model(candidate.fit.run, parts)
    return replace(candidate, fit=search(model, *model.vector(moved), most=0))
