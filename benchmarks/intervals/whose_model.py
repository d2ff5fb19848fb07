"""A model of this machine, and of another: what does each buy?

python -m benchmarks.intervals.whose_model [--machines 12] [--seed 6100]

Machines by the simulators bar, network and plate, every other one with a dominant effect (plate has none). `improve --auto` learns
from the first run, or from the first two together; the third run, cut at 30 to 180 min as of a test that goes on, is identified for
400 min, with that model and with that of another machine of the same kind. Printed of sensors whose status is `ok`: what the 95 %
intervals hold, their width over that without a model, and how many models were let go, as readings that do not fit.
"""

import argparse
import importlib
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from typing import Any

import numpy as np

import thermofast as tf

SIMULATORS = ("bar", "network", "plate")
EFFECTS = ("second_mode", "nonlinear_loss", "friction_decay", "sensor_lag")
TIMES, END, ANOTHER = (30.0, 60.0, 90.0, 180.0), 400.0, 5000
#: (simulator, this machine or another's model, runs learnt from, minutes, status, held, width over none, let go)
Row = tuple[str, str, int, float, str, bool, float, bool]


def records(simulator: str, seed: int) -> tuple[list[tf.Run], Any]:
    """Three runs of a machine at loads that differ, and the simulator's account of them."""
    effect = None if simulator == "plate" or seed % 2 else EFFECTS[seed // 2 % len(EFFECTS)]
    machine = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, 1.0, effect, runs=3, load_spread=0.2)
    runs = []
    for k, record in enumerate(machine.runs):
        good = np.isfinite(record.reading).all(axis=0)
        columns = {f"T{i}": line for i, line in enumerate(record.reading[:, good])}
        runs.append(tf.read({"time_min": record.time[good]} | columns, name=f"run {k} of {seed}"))
    return runs, machine.runs[2]


@cache
def learnt(simulator: str, seed: int, count: int) -> Any:
    """The model file of a machine's first runs."""
    return tf.improve(records(simulator, seed)[0][:count], together=count > 1, start=0.0, auto=True).model


def width(record: Any) -> float:
    """Of the interval at the end [K]; infinite where a side is open."""
    low, high = record.at_lo_c, record.at_hi_c
    return np.inf if low is None or high is None else float(high - low)


def judged(job: tuple[str, int]) -> list[Row]:
    simulator, seed = job
    runs, third = records(simulator, seed)
    last = int(np.abs(third.time - END).argmin())
    at = float(third.time[last] - third.time[0])
    rows: list[Row] = []
    for until in TIMES:
        read = runs[2].time_s <= 60.0 * until + 1e-6
        columns = {"time_min": runs[2].time_s[read] / 60.0} | {n: c[read] for n, c in runs[2].channels.items()}
        so_far = tf.read(columns, name=runs[2].name)
        plain = tf.identify(so_far, at=at, start=0.0, jobs=1)
        for whose, count in (("this", 1), ("this", 2), ("another's", 1), ("another's", 2)):
            model = learnt(simulator, seed + (ANOTHER if whose != "this" else 0), count)
            if model is None:
                continue
            for i, r in enumerate(tf.identify(so_far, at=at, model=model, start=0.0, jobs=1)):
                true = float(third.clean[i][last])
                held = (r.at_lo_c is None or r.at_lo_c <= true) and (r.at_hi_c is None or true <= r.at_hi_c)
                gone = "do not fit" in (r.message or "")
                rows.append((simulator, whose, count, until, r.status, held, width(r) / width(plain[i]), gone))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=12, help="of each simulator")
    parser.add_argument("--seed", type=int, default=6100)
    given = parser.parse_args()
    jobs = [(simulator, given.seed + k) for simulator in SIMULATORS for k in range(given.machines)]
    with ProcessPoolExecutor() as pool:
        rows = [row for one in pool.map(judged, jobs) for row in one]
    minutes = ", ".join(f"{t:g}" for t in TIMES)
    print(f"| machines | model of | runs | `ok` | held at {minutes} min | median width over that without a model | let go |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for simulator in SIMULATORS:
        for whose in ("this", "another's"):
            for count in (1, 2):
                mine = [r for r in rows if r[:3] == (simulator, whose, count)]
                ok = [[r for r in mine if r[3] == until and r[4] == "ok"] for until in TIMES]
                held = ", ".join(f"{100 * np.mean([r[5] for r in some]):.0f}" if some else "-" for some in ok)
                wide = ", ".join(f"{np.median([r[6] for r in some if np.isfinite(r[6])] or [np.nan]):.2f}" for some in ok)
                counts = f"{sum(map(len, ok))} of {len(mine)}", f"{sum(r[7] for r in mine)} of {len(mine)}"
                print(f"| {simulator} | {whose} | {count} | {counts[0]} | {held} % | {wide} | {counts[1]} |", flush=True)


if __name__ == "__main__":
    main()
