"""Is it said rightly what changed where the room is logged, and moves as much as weakly heated points do?

python -m benchmarks.unlike_parts.logged_rooms [--each 12] [--seed 77000] [--drift 0.4] [--changed 1.3] compares one or two old runs
of a machine with one new one in which its heat, its losses, its heat capacities or the rise of one place are so many times what
they were, or nothing is. Networks of bodies (``benchmarks.machines.bodies``: spindle, motor, coolant, foot), six times to 63 % of
the median sensor at most ten hours long, each run in a room of its own that is logged and goes up, there and back or to and fro by
the drift [K]; losses differ by 3 % from run to run, heat by 2 %. Right is the kind, alone or in an "A or B"; wrong is another one
that is `ok`: where a place changed `nothing` counts as wrong unless the row says that it was left out.
"""

import argparse
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np

import thermofast as tf
from benchmarks.machines.bodies import COMPLETE, Bodies, coolant, motor, rod, spindle
from thermofast.reading import Run

KINDS = {"spindle": spindle, "motor": motor, "coolant": coolant, "foot": rod}
CHANGES = ("nothing", "heat", "loss", "heat capacity", "sensor")
NOISE, LONGEST = 0.02, 600.0  # K, min


def run_of(machine: Bodies, rng: np.random.Generator, drift: float, place: tuple[int, float] | None, name: str) -> Run:
    """One run, logged each minute with its room; place: a probe whose rise is another one by a factor."""
    shape, phase, warmer = int(rng.integers(3)), rng.uniform(0.0, 2.0 * np.pi), 0.5 * rng.standard_normal()
    size = drift * float(rng.choice([-1.0, 1.0]))
    mean, heat, loss, load = (
        machine.steady_room + warmer,
        machine.heat,
        1.0 + 0.03 * rng.standard_normal(),
        1.0 + 0.02 * rng.standard_normal(),
    )

    def room(time: float) -> float:
        share = time / LONGEST
        moved = (2.0 * share - 1.0, np.sin(np.pi * share), np.sin(2.0 * np.pi * time / 240.0 + phase))[shape]
        return mean + size * float(moved)

    today = replace(machine, room=room, steady_room=mean, loss=loss * machine.loss, heat=lambda state: load * heat(state))
    times, state = today.curves()
    curves = state[today.probes]
    risen = np.abs(curves - curves[:, :1])
    turn = float(np.median([times[np.argmax(row > 0.63 * row.max())] for row in risen]))
    if place is not None:
        at, factor = place
        curves[at] = curves[at, 0] + factor * (curves[at] - curves[at, 0])
    minutes = np.arange(0.0, min(COMPLETE * turn, LONGEST) + 1.0)
    columns = {f"T{i}": np.interp(minutes, times, row) + NOISE * rng.standard_normal(len(minutes)) for i, row in enumerate(curves)}
    logged = np.array([room(t) for t in minutes]) + NOISE * rng.standard_normal(len(minutes))
    return tf.read({"time_min": minutes, **columns, "ambient": logged}, name=name)


def judge(job: tuple[str, str, int, int, float, float]) -> tuple[str, int, str, bool, bool]:
    """(change, old runs, said, right, wrong) of one machine."""
    kind, change, count, seed, drift, factor = job
    machine = KINDS[kind](np.random.default_rng(seed), kind)  # the same each time: only what is measured differs
    rng, heat = np.random.default_rng([seed, 9]), machine.heat
    old = [run_of(machine, rng, drift, None, f"old {k}") for k in range(count)]
    place = int(rng.integers(len(machine.probes))), factor
    after = {
        "heat": replace(machine, heat=lambda state: factor * heat(state)),
        "loss": replace(machine, loss=factor * machine.loss),
        "heat capacity": replace(machine, capacity=factor * machine.capacity),
    }.get(change, machine)
    new = run_of(after, rng, drift, place if change == "sensor" else None, "new")
    try:
        told = tf.changed(old, new)
    except tf.ThermofastError as error:
        return change, count, f"refused: {str(error)[:40]}", False, False
    right, sure = change in told.verdict.split(" or "), told[0].status == "ok"
    hidden = change == "sensor" and f"T{place[0]}" in told[0].message.partition("left out: ")[2]
    which = told.verdict != "sensor" or told[0].channel == f"T{place[0]}"
    return change, count, told.verdict, right and which, sure and not (right and which) and not hidden


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=12)
    parser.add_argument("--seed", type=int, default=77_000)
    parser.add_argument("--drift", type=float, default=0.4)
    parser.add_argument("--changed", type=float, default=1.3)
    given = parser.parse_args()
    jobs = [
        (kind, change, count, given.seed + i, given.drift, given.changed)
        for count in (1, 2)
        for change in CHANGES
        for kind in KINDS
        for i in range(given.each)
    ]
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judge, jobs))
    print("| old runs | changed | of | right | `ok` and wrong | said |")
    print("| ---: | --- | ---: | ---: | ---: | --- |")
    for count in (1, 2):
        for change in CHANGES:
            some = [f for f in found if f[:2] == (change, count)]
            said = ", ".join(f"{v} {n}" for v, n in Counter(f[2] for f in some).most_common())
            print(f"| {count} | {change} | {len(some)} | {sum(f[3] for f in some)} | {sum(f[4] for f in some)} | {said} |")


if __name__ == "__main__":
    main()
