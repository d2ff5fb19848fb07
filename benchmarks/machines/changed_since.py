"""A model of a machine that has been changed since: does ``identify --model`` hold what it says of a new run?

python -m benchmarks.machines.changed_since [--each 8] [--seed 76000] [--rule other_rates=99]
prints, by what was changed and how much of the new run
was read (in median times to 63 %): the share of rows that are ``ok``, how many of these hold the limit, and the median
half-width over the rise. Spindle heads of ``benchmarks.machines.bodies``; the model is of three complete runs before
(`improve --together`).
"""

import argparse
import os
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np

import thermofast as tf
from benchmarks.discovery.dominant import with_rule
from benchmarks.machines.bodies import COMPLETE, LONGEST, Bodies, measured, spindle
from thermofast.estimation.rules import RULES

READ = (0.3, 0.5, 1.0)
CHANGES = {
    "nothing": lambda b: b,
    "loss x 0.7": lambda b: replace(b, loss=0.7 * b.loss),
    "loss x 1.3": lambda b: replace(b, loss=1.3 * b.loss),
    "heat capacity x 1.2": lambda b: replace(b, capacity=1.2 * b.capacity),
}


def rows_of(seed: int) -> list[tuple[str, float, bool, bool, float]]:
    """(change, read, ok, held, half-width over the rise) of each sensor of one machine."""

    def of(change: str, run: int) -> tuple[Bodies, np.random.Generator]:
        machine = spindle(np.random.default_rng(seed), "spindle")  # the same each time: only what is measured differs
        return CHANGES[change](machine), np.random.default_rng([seed, run])

    past = [tf.read(measured(*of("nothing", run), COMPLETE).table(LONGEST), name=f"run {run}") for run in range(3)]
    model, found = tf.improve(past, together=True).model, []
    for change in CHANGES:
        seen = measured(*of(change, 3), max(READ))
        for share in READ:
            records = tf.identify(seen.table(share * seen.turn), model=model, jobs=1)
            for r, limit, rise in zip(records, seen.limit, seen.rise, strict=True):
                low, high = (np.nan if side is None else side for side in (r.steady_state_lo_c, r.steady_state_hi_c))
                found.append((change, share, r.status == "ok", bool(low <= limit <= high), 0.5 * (high - low) / abs(rise)))
    return found


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=8)
    parser.add_argument("--seed", type=int, default=76_000)
    parser.add_argument("--rule", default="", metavar="NAME=NUMBER", help="with another value of a rule, to see what it is for")
    given = parser.parse_args()
    by = defaultdict(list)
    with ProcessPoolExecutor(initializer=with_rule, initargs=(given.rule, RULES)) as pool:
        for rows in pool.map(rows_of, range(given.seed, given.seed + given.each)):
            for change, share, *row in rows:
                by[change, share].append(row)
    print("| changed since | read | rows | `ok` | of these held | half-width / rise |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for (change, share), rows in by.items():
        ok, held, half = map(np.array, zip(*rows, strict=True))
        good = f"{held[ok].mean():.2f}" if ok.any() else "-"
        print(f"| {change} | {share:g} | {len(ok)} | {ok.mean():.2f} | {good} | {np.nanmedian(half):.2f} |")


if __name__ == "__main__":
    main()
