"""Machines whose cooling, room or load swings all the time: do intervals hold the mean over a cycle that they come to?

python -m benchmarks.machines.swings [--each 20] [--seed 720000] [--read 0.5,0.7,1,2] prints, by kind and time constants read (of
the slowest mode): rows, the share that says that it swings, and that it began to later, the share that is ``ok``, how many of
these hold the mean of the last cycles of a record eight time constants long, how many of all rows do, and the median half-width of
the `ok` rows over the rise.

A housing, a spindle, a motor and a tank of coolant [kJ/K, W/K], by Euler's steps of a two-thousandth of the slowest time constant.
thermostat: a chiller takes heat from the tank, on and off between two limits, with a period that changes as the machine warms;
fan: one that blows on the housing from a limit on, until it is colder again, two to four times the loss (rows in which it has);
room: air conditioning, a sawtooth of 0.6 to 2 K that nobody logged; load: work and pause, ten to thirty minutes a cycle; pulses:
cold oil every so often; steady: none of it. All have a room that wanders by 0.1 K.
"""

import argparse
import math
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
from numpy.typing import NDArray

import thermofast as tf

Array = NDArray[np.float64]
KINDS = ("thermostat", "room", "load", "pulses", "steady", "fan")
NAMES = ("housing", "front", "rear", "motor", "return")
#: Length in time constants, and steps in each.
TURNS, STEPS = 8, 2000
SAID, BEGAN = "means over its cycle", "min on at the latest, as a cooling or a load"


@dataclass(frozen=True)
class Record:
    """time (n,) [min], reading (S, n) [degC], limit (S,), the slowest time constant and when a fan began [min], of that kind."""

    time: Array
    reading: Array
    limit: Array
    tau: float
    begun: float


def simulate(kind: str, seed: int) -> Record:
    """One machine from cold, its limit the mean over the last cycles."""
    rng = np.random.default_rng(seed)
    count = len(NAMES)
    capacity = 60.0 * np.array([rng.uniform(20, 60), rng.uniform(2, 6), rng.uniform(2, 6), rng.uniform(8, 20), rng.uniform(10, 30)])
    link = np.zeros((count, count))  # kJ/min/K
    for i, j, low, high in ((0, 1, 8, 25), (0, 2, 8, 25), (0, 3, 5, 20), (1, 3, 2, 8), (0, 4, 10, 40), (3, 4, 5, 20)):
        link[i, j] = link[j, i] = 0.06 * rng.uniform(low, high) * 10.0
    loss = 0.06 * 10.0 * np.array([rng.uniform(5, 15), 1.0, 1.0, rng.uniform(2, 6), rng.uniform(2, 6)])
    heat = 0.06 * 10.0 * np.array([0.0, rng.uniform(40, 120), rng.uniform(30, 90), rng.uniform(60, 250), 0.0])
    matrix = (link - np.diag(link.sum(axis=1) + loss)) / capacity[:, None]
    tau = float(1.0 / np.sort(-np.linalg.eigvals(matrix).real)[0])
    step = tau / STEPS
    time = step * np.arange(TURNS * STEPS + 1)
    period = float(np.clip(rng.uniform(8.0, 30.0), tau / 25.0, tau / 4.0))
    phase, share, depth = rng.uniform(), rng.uniform(0.3, 0.7), rng.uniform(0.6, 2.0)
    turn = (time / period + phase) % 1.0
    rising = rng.uniform(0.2, 0.8)
    air = depth * (np.where(turn < rising, turn / rising, (1.0 - turn) / (1.0 - rising)) - 0.5) if kind == "room" else 0.0 * time
    air = 20.0 + air + 0.1 * np.sin(2.0 * np.pi * (time / rng.uniform(100.0, 400.0) + rng.uniform()))
    load = np.where(turn < share, 1.0 / share, 0.2) if kind == "load" else np.ones(len(time))
    pulse = np.where(turn < 0.15, 1.0, 0.0) if kind == "pulses" else np.zeros(len(time))
    steady = np.linalg.solve(-matrix, heat / capacity)
    warm = steady[4]
    most = 20.0 + rng.uniform(0.04, 0.12) * warm
    band, power = rng.uniform(0.3, 1.0), rng.uniform(1.5, 3.0) * heat.sum()
    cold = rng.uniform(0.5, 1.5) * heat.sum()
    found = np.empty((count, len(time)))
    found[:, 0] = 20.0
    flow = (link / capacity[:, None], loss / capacity, heat / capacity)
    out = (link.sum(axis=1)) / capacity
    on = False
    fan = np.random.default_rng([seed, 1])
    ends, gap, blows = 20.0 + fan.uniform(0.4, 0.8) * steady[0], fan.uniform(0.3, 1.0), loss[0] * fan.uniform(1.0, 3.0)
    begun = math.inf
    here = found[:, 0].copy()
    for k in range(1, len(time)):
        if kind == "thermostat":
            on = here[4] > most + band if not on else here[4] > most - band
        take = power * on + cold * pulse[k]
        slope = flow[0] @ here - out * here + flow[1] * (air[k] - here) + flow[2] * load[k]
        slope[4] -= take / capacity[4]
        if kind == "fan":
            on = here[0] > ends if not on else here[0] > ends - gap
            begun = min(begun, time[k] if on else math.inf)
            slope[0] += on * blows * (air[k] - here[0]) / capacity[0]
        here = here + step * slope
        found[:, k] = here
    last = time > time[-1] - max(8.0 * period, 0.5 * tau)
    whole = last if kind in ("thermostat", "steady", "fan") else time > time[-1] - 8.0 * period
    limit = found[:, whole].mean(axis=1)
    each = max(round(float(rng.choice([0.25, 0.5, 1.0])) / step), 1)
    reading = found[:, ::each] + rng.uniform(0.01, 0.04) * rng.standard_normal((count, len(time[::each])))
    return Record(time[::each], np.round(reading, 2), limit, tau, begun)


def judge(job: tuple[str, int, float]) -> list[tuple[str, float, bool, bool, bool, bool, float]]:
    """(kind, read, says that it swings, that it began to later, ok, held, half-width over the rise) of each sensor of a machine."""
    kind, seed, read = job
    record = simulate(kind, seed)
    n = int(np.searchsorted(record.time, read * record.tau)) + 1
    if kind == "fan" and record.begun > record.time[n - 1]:
        return []
    table = {"time_min": record.time[:n]} | {name: row[:n] for name, row in zip(NAMES, record.reading, strict=True)}
    rows = []
    for r, limit in zip(tf.identify(table), record.limit, strict=True):
        low, high = r.steady_state_lo_c, r.steady_state_hi_c
        known = low is not None and high is not None
        held = known and low <= limit <= high
        width = 0.5 * (high - low) / abs(limit - 20.0) if known else np.nan
        rows.append((kind, read, SAID in r.message, BEGAN in r.message, r.status == "ok", bool(held), float(width)))
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=720_000)
    parser.add_argument("--read", default="0.5,0.7,1,2")
    given = parser.parse_args()
    reads = [float(r) for r in given.read.split(",")]
    jobs = [(kind, given.seed + 1000 * k + i, read) for k, kind in enumerate(KINDS) for i in range(given.each) for read in reads]
    with ProcessPoolExecutor() as pool:
        rows = [row for found in pool.map(judge, jobs, chunksize=4) for row in found]
    print("| kind | read | rows | says so | began later | `ok` | of these held | all held | half-width / rise |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind in KINDS:
        for read in reads:
            some = [r for r in rows if r[0] == kind and r[1] == read]
            fine = [r for r in some if r[4]]
            held = f"{np.mean([r[5] for r in fine]):.2f}" if fine else "-"
            said, began, ok, every = (float(np.mean([r[k] for r in some])) for k in (2, 3, 4, 5))
            width = float(np.nanmedian([r[6] for r in fine])) if fine else np.nan
            print(f"| {kind} | {read:g} | {len(some)} | {said:.2f} | {began:.2f} | {ok:.2f} | {held} | {every:.2f} | {width:.2f} |")


if __name__ == "__main__":
    main()
