"""Runs of two machines searched as those of one: is it said, and is it never said of one machine?

python -m benchmarks.analysis.two_machines [--each 28] [--seed 7000] draws, by two simulators, machines with every dominant effect
and without; two runs of one, and one run of it beside one of another machine of the same kind, are given to `diagnose --together`.
Printed is how often it says that they look like runs of two machines: the first must be nought. Machines whose rates are nearer
than a factor of two cannot be told apart by them.
"""

import argparse
import importlib
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf
from benchmarks.machines.record import EFFECTS

KINDS = (*EFFECTS, None, None)
LOADS = 0.15


def judge(job: tuple[str, int, int]) -> tuple[str, bool, bool]:
    """(simulator, whether two runs of one machine are said to be of two, whether those of two are)."""
    simulator, seed, number = job
    effect = KINDS[number % len(KINDS)]
    simulate = importlib.import_module(f"benchmarks.machines.{simulator}").simulate
    one = simulate(seed + number, 1.0, effect, runs=2, load_spread=LOADS).runs
    other = simulate(seed + 200 + number, 1.0, effect if number % 2 else None, runs=1, load_spread=LOADS).runs[0]
    return simulator, _said(one[0], one[1]), _said(one[0], other)


def _said(*runs: object) -> bool:
    read = [tf.read(_columns(run), name=f"run {k}") for k, run in enumerate(runs)]
    return "two machines" in tf.diagnose(read, together=True, jobs=1)[0].message


def _columns(run: object) -> dict[str, np.ndarray]:
    good = np.isfinite(run.reading).all(axis=0)  # type: ignore[attr-defined]
    rows = run.reading[:3, good]  # type: ignore[attr-defined]
    return {"time_min": run.time[good]} | {f"T{i}": line for i, line in enumerate(rows)}  # type: ignore[attr-defined]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=28)
    parser.add_argument("--seed", type=int, default=7000)
    asked = parser.parse_args()
    jobs = [(simulator, asked.seed, number) for simulator in ("bar", "network") for number in range(asked.each)]
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judge, jobs))
    print("| simulator | pairs of runs | of one machine, said to be of two | of two machines, said to be |")
    print("| --- | ---: | ---: | ---: |")
    for simulator in ("bar", "network"):
        some = [(one, two) for name, one, two in found if name == simulator]
        print(f"| {simulator} | {len(some)} | {sum(one for one, _ in some)} | {sum(two for _, two in some)} |")


if __name__ == "__main__":
    main()
