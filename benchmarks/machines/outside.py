"""Machines with a hidden cause that is in nobody's catalogue: naming an effect on them is wrong.

Three lumps march with one of: a heat that wanders (random walk), flutters (Ornstein-Uhlenbeck), cycles ever quicker (chirp) or
is switched on and off several times (pulses), or a room that wanders and is not logged.
"""

import numpy as np

from . import record as common
from .record import DURATION, Array, Machine, Record

KINDS = ("walk", "flutter", "chirp", "pulses", "room")
FINE = 0.1  # min


def _heat(kind: str, rng: np.random.Generator, time: Array) -> Array:
    """Heat relative to its mean (n,) on the fine grid."""
    if kind == "walk":
        size = rng.uniform(0.15, 0.4)
        return np.asarray(1.0 + size * np.cumsum(rng.standard_normal(time.size)) * np.sqrt(FINE / DURATION))
    if kind == "flutter":
        return np.asarray(
            1.0 + rng.uniform(0.1, 0.25) * common.coloured(rng, rng.uniform(20.0, 60.0) * common.STEP / FINE, time.size)
        )
    if kind == "chirp":
        first, last = 1.0 / rng.uniform(80.0, 160.0), 1.0 / rng.uniform(20.0, 40.0)
        phase = 2.0 * np.pi * (first * time + 0.5 * (last - first) * time**2 / DURATION) + rng.uniform(0.0, 6.3)
        return np.asarray(1.0 + rng.uniform(0.15, 0.4) * np.sin(phase))
    heat = np.ones(time.size)
    for _ in range(int(rng.integers(3, 6)) if kind == "pulses" else 0):
        begins, lasts = rng.uniform(30.0, 380.0), rng.uniform(10.0, 40.0)
        heat += rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.5) * ((time > begins) & (time < begins + lasts))
    return heat


def simulate(seed: int, kind: str, runs: int = 1) -> Machine:
    """A machine of a seed whose hidden cause is one of `KINDS`, run `runs` times."""
    rng = np.random.default_rng([seed, 31])
    tau = rng.uniform(35.0, 90.0) * np.array([0.8, 1.0, 1.25])
    rise, noise = rng.uniform(4.0, 14.0, 3), float(rng.uniform(0.01, 0.03))
    time, fine = np.arange(0.0, DURATION + 1.0), np.arange(0.0, DURATION + FINE / 2.0, FINE)
    records = []
    for _ in range(runs):
        heat, room = _heat(kind, rng, fine), np.full(fine.size, 21.0)
        if kind == "room":
            room = room + rng.uniform(1.0, 2.5) * np.cumsum(rng.standard_normal(fine.size)) * np.sqrt(FINE / DURATION)
        state = np.empty((3, fine.size))
        state[:, 0] = now = 21.0 + rng.uniform(-0.3, 0.3, 3)
        for k in range(1, fine.size):
            now = now + FINE * (rise * heat[k] + room[k] - now) / tau
            state[:, k] = now
        clean = np.array([np.interp(time, fine, row) for row in state])
        reading = np.round((clean + noise * rng.standard_normal(clean.shape)) / 0.02) * 0.02
        none = np.full_like(time, np.nan)
        records.append(Record(time, reading, clean, none, np.full_like(clean, np.nan)))
    return Machine(seed, kind, tuple(records), noise=noise)
