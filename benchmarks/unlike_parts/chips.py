"""Chips of seconds on heat sinks of minutes: what a short record says of where they settle.

python -m benchmarks.unlike_parts.chips [--each 25] [--seed 640000] draws two sensors a record (chips of 5 to 20 s, a sink of 2
to 10 min with 10 to 50 % of the rise, 50 mK, ten readings a second) and prints, of the first 1, 2, 5 and 15 min, the rows that
are `ok` and those of them whose interval does not hold the limit.
"""

import argparse

import numpy as np

import thermofast as tf


def record(seed: int) -> tuple[dict[str, np.ndarray], list[float]]:
    """Columns and limits [degC]."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 900.05, 0.1)
    columns, limits = {"time_s": time}, []
    for i in range(2):
        fast, rise, share, slow = rng.uniform(5.0, 20.0), rng.uniform(15.0, 50.0), rng.uniform(0.1, 0.5), rng.uniform(120.0, 600.0)
        line = rise * ((1.0 - share) * -np.expm1(-time / fast) + share * -np.expm1(-time / slow))
        columns[f"T{i}"] = 25.0 + line + 0.05 * rng.standard_normal(len(time))
        limits.append(25.0 + rise)
    return columns, limits


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=25)
    parser.add_argument("--seed", type=int, default=640_000)
    given = parser.parse_args()
    records = [record(given.seed + k) for k in range(given.each)]
    print("| read, min | rows | `ok` | of these missed | farthest K |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for until in (1.0, 2.0, 5.0, 15.0):
        ok, off = 0, []
        for columns, limits in records:
            for row, limit in zip(tf.identify(columns, until=until, details=False), limits, strict=True):
                if row.status == "ok":
                    ok += 1
                    off.append(max(row.steady_state_lo_c - limit, limit - row.steady_state_hi_c, 0.0))
        print(f"| {until:g} | {2 * given.each} | {ok} | {sum(v > 0.0 for v in off)} | {max(off, default=0.0):.1f} |", flush=True)


if __name__ == "__main__":
    main()
