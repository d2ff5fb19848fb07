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

#: An effect that changes no reading by more is none [K].
UNSEEN_K = 1e-6
#: How far ahead is looked for where readings come to, in time constants of the slowest lump; by so many times; and by what share of
#: the rise the last two fifths of that may differ where they have come to it.
FAR, AHEAD, SETTLED = 60.0, 3000, 0.002

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

    curves = _read(run, parts, {**values, **named})
    for k, effect in enumerate(effects):
        others = [p for i, p in enumerate(parts) if i != k]
        left = {Key(key.part - (key.part > k), key.name): v for key, v in named.items() if key.part != k}
        if float(np.abs(curves - _read(run, others, {**values, **left})).max()) < UNSEEN_K:
            raise UsageError(
                f"effect {effect.id!r} changes nothing in this record",
                found="a machine that cools has no heat" if (values[LEVEL] <= values[START]).all() else "",
                do="leave it out, or simulate a machine that warms",
            )
    found = sampled(probes, curves, seconds, room, step, seed, drawn, duration_min, interval_s, ambient, run.inputs)
    return replace(found, truth=found.truth | {"sensors": _settling(found.truth["sensors"], run, parts, {**values, **named})})


def _read(run: Observations, parts: list[Part], values: dict[Key, Any]) -> Array:
    """Noiseless readings (S, N) [degC] of a run, a sensor that warms another being as it is, not as it would be alone."""

    def beside(curves: Array) -> Array:
        model = Model(replace(run, reading=curves), parts)
        local, shared = model.vector(values)
        return model.forward(local, np.broadcast_to(shared, (run.sensors, len(shared))), np.arange(run.sensors))

    curves = beside(run.reading)
    return relaxed(curves, beside) if any(p.effect.reads_sensors for p in parts) else curves


def _settling(told: list[dict[str, Any]], run: Observations, parts: list[Part], values: dict[Key, Any]) -> list[dict[str, Any]]:
    """The sensors' truth with what their readings come to and when, all being as at the record's end; the lump's own beside.

    None where they come to nothing: a probe that drifts. Of a load that goes up and down the mean.
    """
    time = np.concatenate([run.time, run.time[-1] + np.arange(1.0, AHEAD + 1.0) * FAR / AHEAD / float(values[RATE].min())])
    n = len(time)

    def held(values: Array) -> Array:
        return np.concatenate([values, np.full(n - len(run.time), values[-1])])

    blank = np.ones((run.sensors, n))
    longer = replace(
        run,
        time=time,
        reading=np.array([held(row) for row in run.reading]),
        weight=blank,
        ambient={name: held(c) for name, c in run.ambient.items()},
        inputs={name: held(c) for name, c in run.inputs.items()},
    )
    curves, found = _read(longer, parts, values), []
    for one, curve in zip(told, curves, strict=True):
        lump = {name: one[name] for name in ("steady_state_c", "t95_min")}
        last, before = curve[-AHEAD // 5 :], curve[-2 * (AHEAD // 5) : -AHEAD // 5]
        end, rise = float(last.mean()), float(last.mean() - curve[0])
        settled = abs(end - float(before.mean())) < SETTLED * max(abs(rise), 1e-9)
        off = np.flatnonzero(np.abs(curve - end) > 0.05 * abs(rise) + 0.5 * float(np.ptp(last)))
        t95 = float(time[min(off[-1] + 1, n - 1)]) if len(off) else 0.0
        now = {"steady_state_c": round(end, 4), "t95_min": round(t95, 1)} if settled else dict.fromkeys(lump)
        found.append(one | now | {"lump": lump})
    return found


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
