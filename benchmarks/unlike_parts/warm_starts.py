"""A machine that is begun anew while it is still warm: how many of the rows that are `ok` hold its limit and its settling time.

python -m benchmarks.unlike_parts.warm_starts [--each 60] [--seed 620000] [--cold] draws chains of three to six bodies (as
benchmarks.unlike_parts.chains), which were heated for one to six hours and left for 15 to 120 min before the record begins, by the
exponential of their matrix; a room that stays and is not logged, a reading a minute in steps of 10 mK. It prints, by how much is
read: rows, those that are `ok`, how many of these hold the limit and the time of 95 %; and the same of parts that first went the
other way. --cold: begun as cold as the room.
"""

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from scipy.linalg import expm

import thermofast as tf

from .chains import Chain, holds

ROOM, READ, LAST = 21.0, (30, 40, 60, 90, 150, 240), 4000.0
#: A part went back where its record falls by so much [K] below where it begins, and its limit lies above that.
BACK = 0.1


def machine(seed: int, cold: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(readings (n, T) [degC] every minute, limits (n,) [degC], true times of 95 % (n,) [min])."""
    rng = np.random.default_rng([seed, 4])
    chain = Chain.drawn(rng)
    matrix, limit = chain.matrix, chain.rises
    warmed, left = rng.uniform(60.0, 360.0), rng.uniform(15.0, 120.0)
    begun = np.zeros(len(limit)) if cold else expm(matrix * left) @ (limit - expm(matrix * warmed) @ limit)
    time, step = np.arange(0.0, LAST + 1.0), expm(matrix)
    away = np.empty((len(limit), len(time)))
    away[:, 0] = begun - limit
    for k in range(len(time) - 1):
        away[:, k + 1] = step @ away[:, k]
    far = np.abs(away) > 0.05 * np.abs(away[:, :1])
    settled = time[np.minimum(far.shape[1] - far[:, ::-1].argmax(axis=1), len(time) - 1)]
    seen = away[:, : READ[-1] + 1] + limit[:, None]
    return ROOM + np.round(seen + chain.noise[:, None] * rng.standard_normal(seen.shape), 2), ROOM + limit, settled


def rows(cold: bool, seed: int) -> list[tuple[int, bool, bool, bool, bool]]:
    """Of each sensor and time read: that time, whether the part went back, whether its row is `ok`, holds the limit, the time."""
    reading, limit, settled = machine(seed, cold)
    minutes, found = np.arange(reading.shape[1], dtype=float), []
    for read in READ:
        some = minutes <= read
        told = tf.identify({"time_min": minutes[some], **{f"T{i} [degC]": row[some] for i, row in enumerate(reading)}}, jobs=1)
        for row, line, true, when in zip(told.records, reading, limit, settled, strict=True):
            back = float(line[some].min()) < line[0] - BACK and true > line[0]
            found.append((read, back, row.status == "ok", *holds(row, true, when)))
    return found


def printed(found: list[tuple[int, bool, bool, bool, bool]]) -> Iterator[str]:
    """Lines of the table."""
    yield "| read, min | rows | `ok` | limit held | t95 held | went back: `ok` | limit held |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for read in READ:
        of = np.array([row[1:] for row in found if row[0] == read])
        ok, back = of[of[:, 1]], of[of[:, 0] & of[:, 1]]
        shares = [f"{100.0 * v.mean():.0f} %" if len(v) else "-" for v in (ok[:, 2], ok[:, 3], back[:, 2])]
        yield f"| {read} | {len(of)} | {len(ok)} | {shares[0]} | {shares[1]} | {len(back)} of {int(of[:, 0].sum())} | {shares[2]} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=60)
    parser.add_argument("--seed", type=int, default=620_000)
    parser.add_argument("--cold", action="store_true")
    asked = parser.parse_args()
    with ProcessPoolExecutor() as pool:
        every = pool.map(partial(rows, asked.cold), range(asked.seed, asked.seed + asked.each))
        for line in printed([row for some in every for row in some]):
            print(line, flush=True)


if __name__ == "__main__":
    main()
