"""Records with known truth, of the base model: for training, demonstrations and tests."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import LOG_TWENTY, Lump

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Probe:
    """Truth of one sensor: temperatures degC, times min, rate 1/min, noise K."""

    channel: str
    initial_c: float
    steady_state_c: float
    t95_min: float
    noise_c: float

    @property
    def rate_per_min(self) -> float:
        return LOG_TWENTY / self.t95_min

    def curve(self, time: Array) -> Array:
        """Noiseless temperature (n,) at times (n,) [min]."""
        slope = (self.steady_state_c - self.initial_c) * self.rate_per_min
        return Lump().free_run(np.array([self.initial_c, slope, self.rate_per_min]), time)


@dataclass(frozen=True)
class Simulation:
    """A simulated run: columns name -> (N,), the time column first, and its truth for the key file."""

    columns: dict[str, Array]
    truth: dict[str, Any]


def draw_probes(
    rng: np.random.Generator, count: int, ambient: float, rise: float, t95: float, noise: float, cooling: bool
) -> list[Probe]:
    """Probes of one machine, near and far from its heat: rises and settling times around the given ones."""
    probes = []
    for i in range(count):
        near = 0.4 + 0.9 * rng.random()
        high = ambient + rise * near
        own_t95 = t95 * (1.15 - 0.3 * near + 0.1 * rng.random())
        first, last = (high, ambient) if cooling else (ambient, high)
        probes.append(Probe(f"T{i + 1}", round(first, 3), round(last, 3), round(own_t95, 1), noise))
    return probes


def simulate(probes: list[Probe], duration_min: float, interval_s: float, ambient: float, step: float, seed: int) -> Simulation:
    """Sample the probes with Gaussian noise, rounded to the logger's `step` [K] (0: not rounded)."""
    count = int(duration_min * 60.0 / interval_s + 1e-9) + 1
    seconds: Array = np.arange(count, dtype=np.float64) * interval_s
    curves = np.array([probe.curve(seconds / 60.0) for probe in probes])
    room = np.full(count, ambient)
    return sampled(probes, curves, seconds, room, step, seed, [], duration_min, interval_s, ambient)


def sampled(
    probes: list[Probe],
    curves: Array,
    seconds: Array,
    room: Array,
    step: float,
    seed: int,
    effects: list[dict[str, Any]],
    duration_min: float,
    interval_s: float,
    ambient: float,
    inputs: Mapping[str, Array] | None = None,
) -> Simulation:
    """Noiseless curves (S, N), room and inputs (N,) [degC] as a logger would keep them, and the truth behind them."""
    rng = np.random.default_rng(seed)
    minutes = interval_s >= 60.0 and math.isclose(interval_s % 60.0, 0.0)
    columns: dict[str, Array] = {"time_min": seconds / 60.0} if minutes else {"time_s": seconds}

    def logged(values: Array) -> Array:
        decimals = max(0, math.ceil(-math.log10(step) - 1e-9)) + 1 if step > 0 else 6
        rounded = np.round(values / step) * step if step > 0 else values
        return np.round(rounded, decimals)

    for probe, curve in zip(probes, curves, strict=True):
        columns[probe.channel] = logged(curve + probe.noise_c * rng.standard_normal(len(seconds)))
    room_noise = probes[0].noise_c
    columns["ambient"] = logged(room + room_noise * rng.standard_normal(len(seconds)))
    columns |= {name: logged(values) for name, values in (inputs or {}).items()}
    truth = {
        "schema": "thermofast.truth/1",
        "seed": seed,
        "effects": effects,
        "duration_min": duration_min,
        "interval_s": interval_s,
        "ambient_c": ambient,
        "step_c": step,
        "sensors": [asdict(p) | {"rate_per_min": p.rate_per_min} for p in probes],
    }
    return Simulation(columns, truth | ({"inputs": list(inputs)} if inputs else {}))
