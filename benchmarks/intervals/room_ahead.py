"""A temperature at a named time in a room that is logged and goes on moving: does the interval hold what came?

python -m benchmarks.intervals.room_ahead [--each 40] [--seed 40000] [--until 120] [--at 410] prints, by what the room does: rows
``ok``, how many intervals of ``identify --at`` hold, how many do where the room is taken to stay as it was at the last reading, the
RMS error, and the RMS of what the room does to the sensors after that reading, which is the error of one who takes it to stay.
Bodies are exact lumps in a room of their own kind, by scipy's filter. The last line is of all rooms that move.
"""

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

import thermofast as tf
from thermofast.records import IdentifyRecord

Array = NDArray[np.float64]
STEP = 0.5  # min


def _memory(time: Array, rng: np.random.Generator) -> Array:
    """A room that wanders and comes back (Ornstein & Uhlenbeck)."""
    kept = np.exp(-STEP / rng.uniform(30.0, 300.0))
    path = lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], rng.standard_normal(len(time) + 4000))[4000:]
    return np.asarray(rng.uniform(0.1, 1.0) * path)


def _thermostat(time: Array, rng: np.random.Generator) -> Array:
    phase = (time / rng.uniform(8.0, 40.0) + rng.random()) % 1.0
    return np.asarray(rng.uniform(0.2, 1.5) * (4.0 * np.abs(phase - 0.5) - 1.0))


#: What a room does beside its level, over time [min].
ROOMS: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "nothing": lambda t, rng: 0.0 * t,
    "drifts evenly": lambda t, rng: rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.7) * t / 60.0,
    "warms up and settles": lambda t, rng: rng.uniform(0.5, 4.0) * -np.expm1(-t / rng.uniform(60.0, 400.0)),
    "day and night": lambda t, rng: rng.uniform(0.5, 2.0) * np.sin(2.0 * np.pi * (t / 1440.0 + rng.random())),
    "wanders": lambda t, rng: np.cumsum(rng.normal(0.0, rng.uniform(0.05, 0.4) * np.sqrt(STEP / 60.0), len(t))),
    "wanders and comes back": _memory,
    "thermostat": _thermostat,
    "a step seen": lambda t, rng: rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 3.0) * (t > rng.uniform(20.0, 110.0)),
}


def rows_of(job: tuple[str, int], until: float, at: float) -> list[tuple[str, bool, float, bool, bool, float]]:
    """(kind, status is ok, error [K], held, held by a room taken to stay, what the room did [K]) of three sensors."""
    kind, seed = job
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, at + STEP / 2, STEP)
    moved = ROOMS[kind](time, rng)
    room, rates = 20.0 + moved, 1.0 / rng.uniform(30.0, 90.0, 3)
    used = time <= until
    columns, truth, later = {"time_min": time}, [], []
    for i, rate in enumerate(rates):
        fall = np.exp(-rate * STEP)

        def follows(drive: Array, fall: float = fall) -> Array:
            return np.asarray(lfilter([1.0 - fall], [1.0, -fall], drive))

        clean = 20.0 + rng.uniform(5.0, 20.0) * -np.expm1(-rate * time) + follows(room - room[0])
        columns[f"T{i}"] = clean + rng.normal(0.0, 0.02, len(time))
        truth.append(float(clean[-1]))
        later.append(float(follows(np.where(used, 0.0, room - room[used][-1]))[-1]))
    columns["ambient"] = np.round(room + rng.normal(0.0, 0.02, len(time)), 2)
    run = tf.read(columns, name="run")
    told = tf.identify(run, until=until, at=at)
    with patch("thermofast.estimation.identify.until_then", lambda at_c, *_rest: (at_c, ())):
        stays = tf.identify(run, until=until, at=at)
    found = []
    for row, other, true, moves in zip(told, stays, truth, later, strict=True):
        error = np.nan if row.at_c is None else row.at_c - true
        found.append((kind, row.status == "ok", error, _holds(row, true), _holds(other, true), moves))
    return found


def _holds(row: IdentifyRecord, true: float) -> bool:
    return row.at_lo_c is not None and row.at_hi_c is not None and row.at_lo_c <= true <= row.at_hi_c


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=40)
    parser.add_argument("--seed", type=int, default=40_000)
    parser.add_argument("--until", type=float, default=120.0)
    parser.add_argument("--at", type=float, default=410.0)
    given = parser.parse_args()
    jobs = [(kind, given.seed + 1000 * k + i) for k, kind in enumerate(ROOMS) for i in range(given.each)]
    with ProcessPoolExecutor() as pool:
        rows = [row for some in pool.map(partial(rows_of, until=given.until, at=given.at), jobs) for row in some]
    read, at = f"logged for {given.until:g} min", f"held at {given.at:g} min"
    print(f"| the room, {read} | rows `ok` | {at} | room taken to stay: held | RMS error K | room taken to stay: RMS error K |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for kind in (*ROOMS, "all that move"):
        mine = [row[1:] for row in rows if kind == row[0] or (kind not in ROOMS and row[0] != "nothing")]
        ok, error, held, if_it_stayed, moves = (np.array(column) for column in zip(*mine, strict=True))
        size, stays = (float(np.sqrt(np.nanmean(v**2))) for v in (error, moves))
        shares = f"{100.0 * held.mean():.0f} % | {100.0 * if_it_stayed.mean():.0f} %"
        print(f"| {kind} | {ok.sum()} of {len(ok)} | {shares} | {size:.2f} | {stays:.2f} |")


if __name__ == "__main__":
    main()
