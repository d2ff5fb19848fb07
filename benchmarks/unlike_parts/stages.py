"""A spindle at one speed after another, logged: of the rows that are `ok` with `--drive` how many hold limit and settling time.

python -m benchmarks.unlike_parts.stages [--each 60] [--seed 630000] draws chains of three to six bodies (of half the capacity of
benchmarks.unlike_parts.chains), begun cold, at two or three speeds, mostly from a low one up, each for 15 to 70 min; all heat goes
as one power of the speed. Bodies move by the exponential of their matrix; a room that stays and is not logged, two readings a
minute in steps of 10 mK. It prints, by the minutes read after the last step, of sensors that rise by 2 K and more and have not come
to their limit yet: rows, those that are `ok`, how many of these hold the limit and the time of 95 %, how many have their `t95_min`
within what was read though it is still to come, and how many begin a kelvin or more off their first reading.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
from scipy.linalg import expm

import thermofast as tf

from .chains import Chain, holds

ROOM, STEP, READ, LAST = 21.0, 0.5, (20, 40, 60, 90, 150, 240), 4000.0
SPEEDS = (1000.0, 1500.0, 2000.0, 3000.0, 4000.0, 5000.0, 6000.0, 8000.0)
LEAST_RISE, OFF = 2.0, 1.0


def machine(seed: int) -> tuple[dict[str, np.ndarray], float, np.ndarray, np.ndarray]:
    """(columns of the record, when the last step came [min], limits (n,) [degC], true times of 95 % (n,) [min])."""
    rng = np.random.default_rng([seed, 5])
    chain = Chain.drawn(rng)
    chain = replace(chain, capacity=0.5 * chain.capacity)
    speeds = np.sort(rng.choice(SPEEDS, rng.integers(2, 4), replace=False))
    if rng.uniform() < 0.2:
        rng.shuffle(speeds)
    lasts = np.append(rng.uniform(15.0, 70.0, len(speeds) - 1), LAST)
    limits = ((speeds / SPEEDS[-1]) ** rng.uniform(1.0, 1.8))[:, None] * chain.rises
    step, rows, speed = expm(chain.matrix * STEP), [np.zeros(len(chain.loss))], []
    for limit, last, one in zip(limits, lasts, speeds, strict=True):
        for _ in range(round(last / STEP)):
            rows.append(limit + step @ (rows[-1] - limit))
            speed.append(one)
    body = np.array(rows[:-1]).T
    time, done, changed = STEP * np.arange(body.shape[1]), body / limits[-1][:, None] >= 0.95, float(lasts[:-1].sum())
    seen = time <= changed + READ[-1]
    reading = ROOM + np.round(body[:, seen] + chain.noise[:, None] * rng.standard_normal((len(body), int(seen.sum()))), 2)
    columns = {f"T{i} [degC]": row for i, row in enumerate(reading)}
    columns = {"time_min": time[seen], "speed (rpm)": np.array(speed)[seen], **columns}
    return columns, changed, ROOM + limits[-1], time[done.argmax(axis=1)]


def rows_of(seed: int) -> list[tuple[int, bool, bool, bool, bool, bool]]:
    """Of each sensor and time read: that time; whether its row is `ok`, holds the limit, the time; says too soon, begins off."""
    found = []
    record, changed, limits, settled = machine(seed)
    for read in READ:
        columns = {name: column[record["time_min"] <= changed + read] for name, column in record.items()}
        end = columns["time_min"][-1]
        for row, limit, when in zip(tf.identify(columns, drive="speed (rpm)", jobs=1), limits, settled, strict=True):
            reading = columns[row.channel]
            if limit - ROOM < LEAST_RISE or reading[-1] > limit:
                continue
            soon = row.t95_min is not None and row.t95_min < end - STEP and when > end
            off = row.initial_c is not None and abs(row.initial_c - reading[0]) > OFF
            found.append((read, row.status == "ok", *holds(row, limit, when), soon, off))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=60)
    parser.add_argument("--seed", type=int, default=630_000)
    asked = parser.parse_args()
    with ProcessPoolExecutor() as pool:
        found = [row for some in pool.map(rows_of, range(asked.seed, asked.seed + asked.each)) for row in some]
    print("| read after the last step, min | rows | `ok` | limit held | t95 held | t95 said too soon | begins 1 K off |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for read in READ:
        of = np.array([row[1:] for row in found if row[0] == read])
        ok, off = of[of[:, 0]], int(of[:, 4].sum())
        held = [f"{100.0 * v.mean():.0f} %" if len(v) else "-" for v in (ok[:, 1], ok[:, 2])]
        print(f"| {read} | {len(of)} | {len(ok)} | {' | '.join(held)} | {int(ok[:, 3].sum())} | {off} |", flush=True)


if __name__ == "__main__":
    main()
