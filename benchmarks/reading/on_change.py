"""Records of loggers that write a sensor only where it has changed by so much (a deadband): what is foretold from them?

python -m benchmarks.reading.on_change [--each 20] [--seed 650000] draws two sensors a record (time constants of 40 to 110 min,
20 mK, read every 5 s for ten hours; with and without a part of 8 % that is 3 to 6 times as slow) as such a logger keeps them,
empty cells elsewhere, and prints of the first 150 and 400 min the rows that are `ok` and those whose interval does not hold the
limit; beside them the same readings at even steps of a minute.
"""

import argparse

import numpy as np

import thermofast as tf


def record(seed: int, band: float, slow: float) -> tuple[dict[str, np.ndarray], list[float]]:
    """Columns, and limits [degC]; a band of 0: a reading a minute."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 36_000.0, 5.0)
    written: list[np.ndarray] = []
    lines, limits = [], []
    for _ in range(2):
        tau, rise, times = rng.uniform(40.0, 110.0) * 60.0, rng.uniform(8.0, 30.0), rng.uniform(3.0, 6.0)
        line = 20.0 + rise * ((1.0 - slow) * -np.expm1(-time / tau) + slow * -np.expm1(-time / (tau * times)))
        lines.append(line + 0.02 * rng.standard_normal(len(time)))
        limits.append(20.0 + rise)
        kept = [0]
        for i in range(1, len(time)):
            if abs(lines[-1][i] - lines[-1][kept[-1]]) >= band:
                kept.append(i)
        written.append(np.array(kept) if band > 0.0 else np.arange(0, len(time), 12))
    rows = np.union1d(*written)
    columns = {"time_s": time[rows]}
    for i, (line, kept_) in enumerate(zip(lines, written, strict=True)):
        whole = np.full(len(time), np.nan)
        whole[kept_] = np.round(line[kept_], 2)
        columns[f"T{i}"] = whole[rows]
    return columns, limits


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=650_000)
    given = parser.parse_args()
    print("| deadband K | slow part | first min | rows | `ok` | of these missed | farthest K | ended before |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for slow in (0.0, 0.08):
        for band in (0.0, 0.1, 0.5, 1.0):
            records = [record(given.seed + k, band, slow) for k in range(given.each)]
            for until in (150.0, 400.0):
                ok, short, off = 0, 0, []
                for columns, limits in records:
                    if columns["time_s"][-1] < 60.0 * until:  # nothing has changed since
                        short += 2
                        continue
                    for row, limit in zip(tf.identify(columns, until=until), limits, strict=True):
                        if row.status == "ok":
                            ok += 1
                            off.append(max(row.steady_state_lo_c - limit, limit - row.steady_state_hi_c, 0.0))
                missed, name = sum(v > 0.0 for v in off), f"{band:g}" if band else "every minute"
                cells = f"{2 * given.each} | {ok} | {missed} | {max(off, default=0.0):.2f} | {short} |"
                print(f"| {name} | {100.0 * slow:.0f} % | {until:g} | {cells}", flush=True)


if __name__ == "__main__":
    main()
