"""Heats and probes that no law of warming knows: is a row ``ok`` that takes a swing or a loose probe for a machine at rest?

python -m benchmarks.machines.odd_heats [--each 20] [--seed 640000] [--read 0.4,0.7,1,2] [--kinds plain,slips]
prints, by kind and time constants read (median to 63 % of the rises): rows, the share that is ``ok``, how many of these hold
the limit (the mean over a cycle, room and load as they are), the median half-width over the rise; and how many rows are
doubtful for what the run's other sensors or their own later readings say, with the share of these that hold.

Networks of four to six heat capacities [J/K] and conductances [W/K], solved by the matrix exponential over steps of the input.
plain: a constant heat; duty: switched on and off all the time, four to ten times in a time constant; chiller: the heat swings by a
fifth, in a sawtooth; loose: the first probe comes off and reads between its place and the room from then on; coarse: half degrees;
slips: under a load that flutters by 1.5 % the first probe loses a part of its contact, which its lag spreads (its rows alone).
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

import thermofast as tf

Array = NDArray[np.float64]
ROOM = 20.0
KINDS = ("plain", "duty", "chiller", "loose", "coarse", "slips")
#: Words of the doubts that are looked at.
DOUBTS = ("times as fast as others", "by the law it had settled", "moved most shows a heat", "the readings jump at")


@dataclass(frozen=True)
class Record:
    """time (n,) [min], reading (S, n), limit (S,), and the median time to 63 % [min]."""

    time: Array
    reading: Array
    limit: Array
    tau: float


def simulate(kind: str, seed: int) -> Record:
    """One machine over two and a half of its time constants."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 7))
    capacity = np.exp(rng.uniform(np.log(0.3), np.log(3.0), count))
    links = np.zeros((count, count))
    for i in range(count - 1):  # a row of parts, and some more links
        links[i, i + 1] = np.exp(rng.uniform(np.log(0.02), np.log(0.3)))
    extra = rng.integers(0, count, (2, 2))
    links[extra[:, 0], extra[:, 1]] += 0.02
    links = np.triu(links + links.T, 1)
    links = links + links.T
    loss = np.exp(rng.uniform(np.log(0.004), np.log(0.04), count))
    heat = np.zeros(count)
    heat[0] = 1.0
    heat[1:] = rng.uniform(0.0, 0.3, count - 1) * (rng.random(count - 1) < 0.5)
    matrix = -(np.diag(links.sum(axis=1) + loss) - links) / capacity[:, None]
    limit = np.linalg.solve(-matrix, heat / capacity)
    scale = rng.uniform(6.0, 30.0) / limit.max()
    rates = np.sort(-np.linalg.eigvals(matrix).real)
    tau = float(1.0 / rates[0])
    step = tau / 400.0
    time = step * np.arange(int(2.5 * 400))
    period = tau / rng.uniform(4.0, 10.0)
    share, depth, phase = rng.uniform(0.25, 0.6), rng.uniform(0.1, 0.25), rng.uniform()
    cycle = (time / period + phase) % 1.0
    drive = np.ones(len(time))
    if kind == "duty":
        drive = (cycle < share) / share
    elif kind == "chiller":
        drive = 1.0 + depth * (2.0 * cycle - 1.0)
    elif kind == "slips":
        stay, flutter = np.exp(-step / (0.1 * tau)), 0.0
        for k in range(len(time)):
            flutter = stay * flutter + 0.015 * np.sqrt(1.0 - stay**2) * rng.standard_normal()
            drive[k] += flutter
    onward = expm(np.block([[matrix, (heat / capacity)[:, None]], [np.zeros((1, count + 1))]]) * step)
    rise = np.zeros((count, len(time)))
    for k in range(1, len(time)):
        rise[:, k] = onward[:count, :count] @ rise[:, k - 1] + onward[:count, count] * drive[k - 1]
    clean = ROOM + scale * rise
    if kind == "loose":
        off = time > rng.uniform(0.05, 0.3) * tau
        clean[0, off] = ROOM + rng.uniform(0.2, 0.6) * (clean[0, off] - ROOM)
    if kind == "slips":
        off, whole = time > rng.uniform(0.3, 0.8) * tau, clean[0].copy()
        clean[0, off] = ROOM + rng.uniform(0.6, 0.9) * (clean[0, off] - ROOM)
        fall, held = np.exp(-step / (tau * rng.uniform(0.001, 0.02))), clean[0].copy()
        clean[0] = whole
        for k in range(1, len(time)):
            clean[0, k] = held[k] + fall * (clean[0, k - 1] - held[k])
    reading = clean + rng.uniform(0.01, 0.03) * rng.standard_normal(clean.shape)
    reading = np.round(reading / 0.5) * 0.5 if kind == "coarse" else np.round(reading, 3)
    rising = [float(time[np.argmax(row >= 0.632 * row[-1])]) for row in rise]
    return Record(time, reading, ROOM + scale * limit, float(np.median(rising)))


def judge(job: tuple[str, int, float]) -> list[tuple[str, float, bool, bool, bool, float]]:
    """(kind, read, ok, held, doubtful for one of DOUBTS, half-width over the rise) of each sensor of a machine."""
    kind, seed, read = job
    record = simulate(kind, seed)
    n = int(np.searchsorted(record.time, read * record.tau)) + 1
    table = {"time_min": record.time[:n]} | {f"T{i}": row[:n] for i, row in enumerate(record.reading)}
    rows = []
    for r, limit in zip(tf.identify(table), record.limit, strict=True):
        low, high = r.steady_state_lo_c, r.steady_state_hi_c
        held = low is not None and high is not None and low <= limit <= high
        width = 0.5 * (high - low) / (limit - ROOM) if low is not None and high is not None else np.nan
        doubted = r.status == "model_doubtful" and any(d in r.message for d in DOUBTS)
        rows.append((kind, read, r.status == "ok", bool(held), doubted, float(width)))
    return rows[:1] if kind == "slips" else rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=640_000)
    parser.add_argument("--read", default="0.4,0.7,1,2")
    parser.add_argument("--kinds", default=",".join(KINDS))
    given = parser.parse_args()
    reads = [float(r) for r in given.read.split(",")]
    asked = given.kinds.split(",")
    kinds = [(k, kind) for k, kind in enumerate(KINDS) if kind in asked]
    jobs = [(kind, given.seed + 1000 * k + i, read) for k, kind in kinds for i in range(given.each) for read in reads]
    with ProcessPoolExecutor() as pool:
        rows = [row for found in pool.map(judge, jobs, chunksize=4) for row in found]
    print("| kind | read | rows | `ok` | of these held | half-width / rise | doubtful so | of these held |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind in [*(kind for _, kind in kinds), "all"]:
        for read in reads:
            some = [r for r in rows if kind in (r[0], "all") and r[1] == read]
            fine, doubted = [r for r in some if r[2]], [r for r in some if r[4]]
            held = f"{np.mean([r[3] for r in fine]):.2f}" if fine else "-"
            lost = f"{np.mean([r[3] for r in doubted]):.2f}" if doubted else "-"
            width = float(np.nanmedian([r[5] for r in fine])) if fine else np.nan
            share = len(fine) / max(len(some), 1)
            print(f"| {kind} | {read:g} | {len(some)} | {share:.2f} | {held} | {width:.2f} | {len(doubted)} | {lost} |")


if __name__ == "__main__":
    main()
