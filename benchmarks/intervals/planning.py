"""Does a plan come true? ``python -m benchmarks.intervals.planning`` [machines].

The time that ``plan --like`` a machine's complete record says for +-0.5 and +-1 K, against the time from which ``identify`` then
knows all sensors of another run of it so together, on simulated machines.
"""

import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf
from benchmarks.machines import bar
from thermofast.analysis.watching import TOGETHER

TOLERANCES = (0.5, 1.0)
TIMES = tuple(np.arange(10.0, 400.0, 10.0))


def ratios(seed: int) -> list[tuple[float, float]]:
    """(tolerance, needed over planned) of one machine: of its slowest sensor."""
    run = bar.simulate(seed, runs=2).runs
    records = [{"time_min": r.time} | {f"T{i}": line for i, line in enumerate(r.reading)} for r in run]
    planned = {r.tolerance_c: r.time_min for r in tf.plan(TOLERANCES, like=records[0]) if r.channel == "as asked"}
    found = []
    for tolerance in TOLERANCES:
        swept = tf.sweep(records[1], (400.0,), TIMES, tolerance=tolerance / TOGETHER)
        times = [r.tolerance_time_min for r in swept]
        known = [t if t is not None else np.inf for t in times]
        if planned[tolerance] is not None:
            found.append((tolerance, float(np.max(known)) / planned[tolerance]))
    return found


def main() -> None:
    """Prints median and spread of the ratios."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    with ProcessPoolExecutor() as pool:
        found = [pair for pairs in pool.map(ratios, range(70_000, 70_000 + count)) for pair in pairs]
    print("| to +- K | plans | needed over planned, median | 10 % to 90 % | to reach |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for tolerance in TOLERANCES:
        some = np.array([ratio for t, ratio in found if t == tolerance])
        low, middle, high = np.quantile(some, [0.1, 0.5, 0.9], method="higher")  # inf: never known so well
        print(f"| {tolerance:g} | {len(some)} | {middle:.2f} | {low:.2f} to {high:.2f} | 0.85 to 1.15 |")


if __name__ == "__main__":
    main()
