"""Records with hidden effects: the catalogue's own drive run forward, with sizes drawn at random. For training and tests."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.effects.base import Effect
from thermofast.models.joint import LEVEL, RATE, START, Key, Model, Part
from thermofast.models.relaxation import relaxed

from ..errors import UsageError
from .simulation import Probe, Simulation, sampled

Array = NDArray[np.float64]

#: The input of which effects may draw heat.
COOLANT = "coolant_degC"


def simulate_hidden(
    probes: list[Probe], duration_min: float, interval_s: float, ambient: float, step: float, seed: int, effects: list[Effect]
) -> Simulation:
    """As :func:`simulation.simulate`, with effects; their parameters stand in the truth.

    Raises
    ------
    UsageError: an effect needs more sensors than there are.
    """
    rng = np.random.default_rng([seed, 3])
    seconds: Array = np.arange(int(duration_min * 60.0 / interval_s + 1e-9) + 1, dtype=np.float64) * interval_s
    time = seconds / 60.0
    n = len(probes)
    room = np.full(len(time), ambient)
    if any(e.follows_ambient for e in effects):
        swing, turn = 1.0 + rng.random(), 2.0 * np.pi * rng.random()
        room = room + swing * (np.sin(2.0 * np.pi * time / 1440.0 + turn) - math.sin(turn)) + 0.8 * swing * time / duration_min
    clean = np.array([p.curve(time) for p in probes])
    blank = np.ones((n, len(time)))
    run = Observations(
        "simulated",
        tuple(p.channel for p in probes),
        time,
        clean,
        blank,
        np.full(n, probes[0].noise_c),
        np.zeros(n),
        {"ambient": room},
    )
    if not all(e.choices(run) for e in effects if e.logged):
        run = replace(run, inputs={COOLANT: _coolant(time, ambient, rng)}, temperatures=(COOLANT,))
    parts, named, drawn = [], {}, []
    values: dict[Key, Any] = {
        RATE: np.array([p.rate_per_min for p in probes]),
        LEVEL: np.array([p.steady_state_c for p in probes]),
        START: np.array([p.initial_c for p in probes]),
    }
    for k, effect in enumerate(effects):
        choices = effect.choices(run)
        if not choices:
            raise UsageError(f"effect {effect.id!r} needs {effect.needs or 'more than this run has'}", do="simulate more sensors")
        choice = choices[0]
        concerned: tuple[bool, ...] | None = None
        if effect.scope == "one" or effect.reads_sensors:
            one = int(rng.integers(n))
            concerned = tuple(i == one for i in range(n))
        parts.append(Part(effect, choice, concerned))
        truth: dict[str, Any] = {}
        for p in effect.active(choice):
            low, high = p.typical or (p.start, p.start)
            scale = duration_min if p.share else 1.0
            size = low + (high - low) * rng.random(n if p.each == "sensor" else None)
            sign = 1.0 if p.low >= 0.0 or p.periodic or rng.random() < 0.5 else -1.0
            named[Key(k, p.name)] = size * scale * sign
            truth[p.name] = _told(named[Key(k, p.name)], concerned, run.channels)
        who = [c for c, w in zip(run.channels, concerned or [True] * n, strict=True) if w]
        source = choice.constants.get("source")
        if source is not None and concerned is not None:
            i = concerned.index(True)
            truth["source"] = run.channels[int(np.asarray(source)[i])]
        drawn.append({"id": effect.id, "channels": who, "acts": choice.label, "parameters": truth})

    def beside(curves: Array) -> Array:
        model = Model(replace(run, reading=curves), parts)
        local, shared = model.vector({**values, **named})
        return model.forward(local, np.broadcast_to(shared, (n, len(shared))), np.arange(n))

    curves = beside(clean)
    if any(e.reads_sensors for e in effects):
        curves = relaxed(curves, beside)  # a neighbour that warms is the sensor as it is, not as it would be alone
    return sampled(probes, curves, seconds, room, step, seed, drawn, duration_min, interval_s, ambient, run.inputs)


def _coolant(time: Array, ambient: float, rng: np.random.Generator) -> Array:
    """A chiller that hunts about a temperature near the room's, which is set anew on the way (N,) [degC]."""
    period, turn, later = 40.0 + 60.0 * rng.random(), 2.0 * np.pi * rng.random(), (0.3 + 0.4 * rng.random()) * time[-1]
    found: Array = ambient - 1.0 + np.sin(2.0 * np.pi * time / period + turn) - 2.0 * (time > later)
    return found


def _told(value: Any, concerned: tuple[bool, ...] | None, channels: tuple[str, ...]) -> Any:
    if np.ndim(value) == 0:
        return float(f"{float(value):.6g}")
    who = concerned or (True,) * len(channels)
    return {c: float(f"{float(v):.6g}") for c, v, w in zip(channels, value, who, strict=True) if w}
