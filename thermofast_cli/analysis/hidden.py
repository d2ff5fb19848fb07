"""Records with hidden effects: the catalogue's own drive run forward, with sizes drawn at random. For training and tests."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.effects.base import Effect
from thermofast.models.joint import Model, Part

from ..errors import UsageError
from .simulation import Probe, Simulation, sampled

Array = NDArray[np.float64]

#: Ranges that sizes are drawn from; shares of the record's length where the parameter is one. A sign is drawn where low < 0.
TYPICAL: dict[str, dict[str, tuple[float, float]]] = {
    "ambient": {"gain": (1.0, 1.0)},
    "second_mode": {"kappa": (0.004, 0.012), "rate": (0.003, 0.009)},
    "load_step": {"change": (0.15, 0.4), "event": (0.3, 0.6)},
    "cooling_switch": {"ratio": (1.2, 1.6), "event": (0.3, 0.6)},
    "sensor_lag": {"lag": (6.0, 15.0)},
    "transport_delay": {"delay": (0.02, 0.06)},
    "nonlinear_loss": {"exponent": (0.3, 0.7)},
    "neighbour_heat": {"kappa": (0.008, 0.02)},
    "cyclic_load": {"depth": (0.3, 0.5), "period": (0.06, 0.15), "phase": (0.0, 1.0)},
    "friction_decay": {"extra": (0.5, 1.0), "time_constant": (0.08, 0.2)},
    "sensor_drift": {"drift": (0.002, 0.005)},
    "reading_jump": {"jump": (0.3, 0.8), "event": (0.3, 0.7)},
}


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
    if any(e.id == "ambient" for e in effects):
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
    parts, named, drawn = [], {}, []
    values: dict[tuple[int, str], Any] = {
        (-1, "rate"): np.array([p.rate_per_min for p in probes]),
        (-1, "level"): np.array([p.steady_state_c for p in probes]),
        (-1, "start"): np.array([p.initial_c for p in probes]),
    }
    for k, effect in enumerate(effects):
        choices = effect.choices(run)
        if not choices:
            raise UsageError(f"effect {effect.id!r} needs {effect.needs or 'more than this run has'}", do="simulate more sensors")
        choice = choices[0]
        concerned: tuple[bool, ...] | None = None
        if effect.scope == "one" or effect.id == "neighbour_heat":
            one = int(rng.integers(n))
            concerned = tuple(i == one for i in range(n))
        parts.append(Part(effect, choice, concerned))
        truth: dict[str, Any] = {}
        for p in effect.active(choice):
            low, high = TYPICAL.get(effect.id, {}).get(p.name, (p.start, p.start))
            scale = duration_min if p.share else 1.0
            size = low + (high - low) * rng.random(n if p.each == "sensor" else None)
            sign = 1.0 if p.low >= 0.0 or p.name == "phase" or rng.random() < 0.5 else -1.0
            named[k, p.name] = size * scale * sign
            truth[p.name] = _told(named[k, p.name], concerned, run.channels)
        who = [c for c, w in zip(run.channels, concerned or [True] * n, strict=True) if w]
        source = choice.constants.get("source")
        if source is not None and concerned is not None:
            i = concerned.index(True)
            truth["source"] = run.channels[int(np.asarray(source)[i])]
        drawn.append({"id": effect.id, "channels": who, "acts": choice.label, "parameters": truth})
    curves = clean
    for _ in range(2 if any(e.id == "neighbour_heat" for e in effects) else 1):
        model = Model(run, parts)
        local, shared = model.vector({**values, **named})
        curves = model.forward(local, np.broadcast_to(shared, (n, len(shared))), np.arange(n))
        # A neighbour that warms is the sensor as it is, not as it would be alone.
        run = Observations(run.name, run.channels, time, curves, blank, run.noise, run.resolution, run.ambient)
    return sampled(probes, curves, seconds, room, step, seed, drawn, duration_min, interval_s, ambient)


def _told(value: Any, concerned: tuple[bool, ...] | None, channels: tuple[str, ...]) -> Any:
    if np.ndim(value) == 0:
        return float(f"{float(value):.6g}")
    who = concerned or (True,) * len(channels)
    return {c: float(f"{float(v):.6g}") for c, v, w in zip(channels, value, who, strict=True) if w}
