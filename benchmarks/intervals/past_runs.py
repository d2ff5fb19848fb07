"""What past runs of the same machine buy: identify with a model that improve --together learnt from 1, 4 and 10 of them.

OMP_NUM_THREADS=1 python -m benchmarks.intervals.past_runs [--machines 40] [--seed 70000] [--logged] prints, for two simulators and
for runs of ../shared/cases/lab where they are (each run foretold from the others), by identification time: coverage of the end, RMS
error, median width, and the interval score over that without a past. --logged: rooms that wander by 0.4 K and are logged, and the
limit with the room as it is at the identification time.
"""

import argparse
import importlib
import json
import os
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import thermofast as tf
from benchmarks.intervals.imperfect import score
from thermofast.models.noise.spikes import logger_step

LAB = Path(__file__).parents[3] / "shared" / "cases" / "lab"
TIMES = (12.0, 30.0, 45.0, 90.0)
COUNTS = (0, 1, 4, 10)
END = 410.0
LATE = 200.0
#: (low, middle, high, truth) of a sensor, by (past runs, minutes).
Told = dict[tuple[int, float], list[tuple[float, float, float, float]]]


def foretold(run: tf.Run, end: dict[str, float], at: float, past: Sequence[tf.Run], counts: Sequence[int]) -> Told:
    """Intervals for the end of a run from its beginning, with the first so many past runs."""
    found: Told = defaultdict(list)
    for count in counts:
        if count > len(past):
            continue
        model = None
        if count:
            some = list(past[:count])
            model = tf.improve(some, together=count > 1, start=0.0).model
        for until in TIMES:
            for r in tf.identify(run, until=until, at=at, model=model, start=0.0, details=False).records:
                if r.channel in end and r.at_c is not None:
                    low, high = (np.nan if v is None else v for v in (r.at_lo_c, r.at_hi_c))
                    found[count, until].append((low, r.at_c, high, end[r.channel]))
    return dict(found)


def simulated(seed: int, simulator: str) -> Told:
    """The first run of a machine, foretold from its others."""
    machine = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, 1.0, None, runs=11, load_spread=0.1)
    runs = []
    for k, record in enumerate(machine.runs):
        good = np.isfinite(record.reading).all(axis=0)
        columns = {f"T{i}": line for i, line in enumerate(record.reading[:, good])}
        runs.append(tf.read({"time_min": record.time[good]} | columns, name=f"run {k}"))
    first = machine.runs[0]
    last = int(np.abs(first.time - END).argmin())
    end = {f"T{i}": float(line[last]) for i, line in enumerate(first.clean)}
    return foretold(runs[0], end, float(first.time[last] - first.time[0]), runs[1:], COUNTS)


def logged(seed: int, simulator: str) -> Told:
    """Limits of the first run of a machine, its room and those of the others logged."""
    machine = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, 1.0, None, runs=11, load_spread=0.1)
    rng, runs, limits = np.random.default_rng(seed), [], {}
    for k, record in enumerate(machine.runs):
        good = np.isfinite(record.reading).all(axis=0)
        time, rate = record.time[good], 1.0 / 60.0
        # A room on top of the simulator's own, which every point follows through its lag.
        swing = 0.4 * (np.sin(2.0 * np.pi * time / 900.0 + k) - np.sin(k))
        step = np.diff(time, prepend=time[0])
        late = np.zeros(len(time))
        for i in range(1, len(time)):
            late[i] = late[i - 1] + (swing[i] - late[i - 1]) * -np.expm1(-rate * step[i])
        steps = [logger_step(line) for line in record.reading[:, good]]  # what is added is rounded as the readings are
        added = [late if step == 0.0 else np.round(late / step) * step for step in steps]
        columns = {f"T{i}": line + more for i, (line, more) in enumerate(zip(record.reading[:, good], added, strict=True))}
        room = record.room[good] + swing + 0.02 * rng.standard_normal(len(time))
        runs.append(tf.read({"time_min": time, "ambient": room} | columns, name=f"run {k}"))
        if k == 0:
            limits = {f"T{i}": (time, line[good] + swing) for i, line in enumerate(record.limit)}
    found: Told = defaultdict(list)
    for count in COUNTS:
        some = runs[1 : 1 + count]
        model = tf.improve(some, together=count > 1, start=0.0).model if count else None
        for until in (*TIMES, LATE):
            for r in tf.identify(runs[0], until=until, model=model, start=0.0, details=False).records:
                if r.steady_state_c is not None:
                    low, high = (np.nan if v is None else v for v in (r.steady_state_lo_c, r.steady_state_hi_c))
                    truth = float(np.interp(until, *limits[r.channel]))
                    found[count, until].append((low, r.steady_state_c, high, truth))
    return dict(found)


def of_lab(machine: int) -> Told:
    """Every run of a machine of the lab foretold from its other four."""
    key = json.loads((LAB / "key.json").read_text())
    names = [f"machine{machine:02d}_run{k}" for k in range(5)]
    runs = [tf.read(str(LAB / f"{name}.csv"), channels=",".join(key[name]["end"])) for name in names]
    found: Told = defaultdict(list)
    for k, (name, run) in enumerate(zip(names, runs, strict=True)):
        others = [r for j, r in enumerate(runs) if j != k]
        at = float(run.time_s[-20:].mean() / 60.0)
        for where, rows in foretold(run, key[name]["end"], at, others, (0, 1, 4)).items():
            found[where] += rows
    return dict(found)


def table(title: str, parts: Sequence[Told]) -> None:
    """One population."""
    whole: dict[tuple[int, float], Any] = defaultdict(list)
    for part in parts:
        for where, rows in part.items():
            whole[where] += rows
    print(f"\n{title}: {len(parts)} machines, {len(whole[0, TIMES[1]])} intervals at each time\n")
    print("| past runs | min | held | RMS K | width K | score K | score over none |")
    print("|" + " ---: |" * 7)
    for count, until in sorted(whole):
        mine, without = ([row for row in whole[n, until] if np.isfinite(row).all()] for n in (count, 0))
        if not mine or not without:  # as early as that a side of all may be open
            continue
        low, middle, high, end = np.array(mine).T
        bare = np.array(without).T
        own, none = (float(np.mean(score(v[0], v[2], v[3]))) for v in ((low, middle, high, end), bare))
        parts_ = [f"{np.mean((low <= end) & (end <= high)):.3f}", f"{np.sqrt(np.mean((middle - end) ** 2)):.2f}"]
        print(f"| {count} | {until:g} | {' | '.join(parts_)} | {np.median(high - low):.2f} | {own:.2f} | {own / none:.2f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=40)
    parser.add_argument("--seed", type=int, default=70_000)
    parser.add_argument("--logged", action="store_true")
    asked = parser.parse_args()
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        if LAB.is_dir() and not asked.logged:
            table("lab", list(pool.map(of_lab, range(20))))
        for simulator in ("bar", "network"):
            of_one = partial(logged if asked.logged else simulated, simulator=simulator)
            table(simulator, list(pool.map(of_one, range(asked.seed, asked.seed + asked.machines))))


if __name__ == "__main__":
    main()
