"""Is it said rightly what changed in a machine between two tests?

python -m benchmarks.analysis.changed [--each 20] [--seed 760000] [--least 0.08] [--most 0.42] [--probe] compares one or three old
runs of simulated machines, or the model that `improve` learns from them, with one new run in which the heat, the heat capacity, the
loss or one sensor's rise is 8 to 40 % more or less, or each sensor's (by 20 %, deviation), or the room is 4 to 8 K warmer or
colder, which no room column tells, or nothing is: the machine's own curve, transformed (a heat capacity stretches time, a loss
stretches time and shrinks the rise). With ../shared/data the pots of one, two and three litres and their repeats too, and the
laptop at five coolings. --probe: one probe alone, the middle one, tells 2 to 5 K more or less from beginning to end; right is the
right sensor with an interval that holds.
"""

import argparse
import importlib
import itertools
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import thermofast as tf
from benchmarks.discovery.dominant import runs_of
from benchmarks.machines.record import Record
from thermofast.reading import Run

KINDS = ("nothing", "heat capacity", "loss", "heat", "sensor", "contact", "room")
POTS = Path(__file__).parents[3] / "shared" / "data" / "cooking_pot"


def factor_of(rng: np.random.Generator, sizes: tuple[float, float]) -> float:
    """By how much something changes, between these shares more, or as much less."""
    return float(np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(*np.log1p(sizes))))


def changed(run: Run, record: Record, kind: str, rng: np.random.Generator, factor: float, room: float) -> Run:
    """The new run, changed: its clean curve transformed, its noise drawn anew; room [degC] is that of the old runs."""
    quick = {"heat capacity": 1.0 / factor, "loss": factor}.get(kind, 1.0)
    time = record.time
    curve = np.array([np.interp(np.minimum(time * quick, time[-1]), time, row) for row in record.clean])
    rise = curve - curve[:, :1]
    if kind in ("loss", "heat"):
        rise *= 1.0 / factor if kind == "loss" else factor
    if kind == "sensor":
        rise[int(rng.integers(len(rise)))] *= factor
    if kind == "contact":
        rise *= np.exp(0.2 * rng.standard_normal(len(rise)))[:, None]
    if kind == "probe":
        rise[len(rise) // 2] += factor
    if kind == "room":
        rise = rise + room - record.room[0] + float(rng.choice([-1.0, 1.0]) * rng.uniform(4.0, 8.0))
    keep = time * quick <= time[-1]
    noise = float(np.median([np.std(r - c) for r, c in zip(record.reading, record.clean, strict=True)]))
    reading = curve[:, :1] + rise + noise * rng.standard_normal(rise.shape)
    return tf.read({"time_min": time[keep]} | {f"T{i}": row[keep] for i, row in enumerate(reading)}, name="new")


def judge(job: tuple[str, str, int, int, tuple[float, float]]) -> tuple[str, str, int, str, bool]:
    """(simulator, kind, old runs, verdict, right) of one machine; -1 or -3 old runs: the model learnt from so many."""
    simulator, kind, asked, seed, sizes = job
    count = abs(asked)
    machine = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, 1.0, None, runs=count + 1)
    runs = runs_of(machine, seed)
    bare = [tf.read({"time_min": r.time_s / 60.0, **r.channels}, name=f"old {k}") for k, r in enumerate(runs[:-1])]
    rng = np.random.default_rng([seed, 5])
    room = float(np.mean([r.room[0] for r in machine.runs[:-1]]))
    new = changed(runs[-1], machine.runs[-1], kind, rng, factor_of(rng, sizes), room)
    if kind == "probe":
        off = float(rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 5.0))
        new = changed(runs[-1], machine.runs[-1], kind, rng, off, room)
    told = tf.changed(bare, new) if asked > 0 else tf.changed(new=new, model=tf.improve(bare, together=count > 1).model)
    said = told.verdict.split(" or ")
    if kind == "probe":
        first = told[0]
        which = first.channel == list(new.channels)[len(new.channels) // 2]
        held = first.difference_lo_k is not None and first.difference_lo_k <= off <= first.difference_hi_k
        verdict = (
            f"{told.verdict}{'' if which else ' elsewhere'}{'' if held else ', size wrong'}"
            if told.verdict == "sensor"
            else told.verdict
        )
        return simulator, kind, asked, verdict, told.verdict == "sensor" and which and held
    # Of some repeats the simulator draws another room.
    moved = kind == "nothing" and "room" in said and abs(machine.runs[-1].room[0] - room) > 2.5
    return simulator, kind, asked, told.verdict, kind in said or moved


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=760_000)
    parser.add_argument("--least", type=float, default=0.08, help="least change, as a share")
    parser.add_argument("--most", type=float, default=0.42)
    parser.add_argument("--probe", action="store_true")
    given = parser.parse_args()
    kinds = ("nothing", "probe") if given.probe else KINDS
    print("| machines | old runs | changed | of | right | said |")
    print("| --- | ---: | --- | ---: | ---: | --- |")
    for simulator in ("bar", "network"):
        for count in (1, 3, -1, -3):
            seeds = [(k, given.seed + 1000 * k + i) for k in range(len(kinds)) for i in range(given.each)]
            jobs = [(simulator, kinds[k], count, seed, (given.least, given.most)) for k, seed in seeds]
            with ProcessPoolExecutor() as pool:
                found = list(pool.map(judge, jobs))
            for kind in kinds:
                some = [f for f in found if f[1] == kind]
                said = ", ".join(f"{v} {n}" for v, n in Counter(f[3] for f in some).most_common())
                right, old = 100 * np.mean([f[4] for f in some]), count if count > 0 else f"model of {-count}"
                print(f"| {simulator} | {old} | {kind} | {len(some)} | {right:.0f} % | {said} |", flush=True)
    if POTS.is_dir() and not given.probe:
        _pots()
        _laptop()


def _pots() -> None:
    """Pots of different volumes, and the same volume twice."""
    print("\n| pots | changed | said |\n| --- | --- | --- |")
    names = sorted(p.stem for p in POTS.glob("*cm_*.csv"))
    for a in names:
        for b in names[names.index(a) + 1 :]:
            if a.split("_")[0] == b.split("_")[0]:
                told = tf.changed(tf.read(POTS / f"{a}.csv"), tf.read(POTS / f"{b}.csv"))
                change = "nothing" if a.split("_")[1] == b.split("_")[1] else "heat capacity"
                print(f"| {a}, {b} | {change} | {told.verdict} |", flush=True)


def _laptop() -> None:
    """A laptop under one load at five coolings: its loss, as is said."""
    print("\n| laptop | changed | said |\n| --- | --- | --- |")
    paths = sorted((POTS.parent / "laptop").glob("*.csv"))
    for a, b in itertools.combinations(paths, 2):
        print(f"| {a.stem}, {b.stem} | loss | {tf.changed(tf.read(a), tf.read(b)).verdict} |", flush=True)


if __name__ == "__main__":
    main()
