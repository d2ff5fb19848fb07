"""A model whose effects stand for something else, learnt from one complete run: do its limits hold in the next one?

python -m benchmarks.unlike_parts.stand_in [--each 8] [--seed 660000] prints, for rows of four to six bodies by an ODE solver
(losses that grow with the 1.0th to 1.25th power of the temperature; a heavy column at the end; a logged room that becomes 2 K
warmer): `improve --add` of an effect that is at best part of the truth, from a run of eight hours, and of the rows of
`identify --model` on the first hour of a run at 0.7 to 0.8 or 1.2 to 1.3 times the load how many are `ok`, how many of those hold
the limit in the room of that hour, and how wide they are; and the same of a model without effects.
"""

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import thermofast as tf

KINDS, EFFECTS = ("losses", "column", "room"), ("", "neighbour_heat", "second_mode")
LONG, READ, STEP = 480.0, 60.0, 1.0
SENSORS = 3


def machine(kind: str, seed: int) -> tuple[tf.Run, tf.Run, np.ndarray]:
    """A complete run, the first hour of another one, and the limits (3,) [degC] of that in the room it then has."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 7))
    capacity, loss, link = rng.uniform(8.0, 40.0, n), rng.uniform(1.0, 5.0, n), rng.uniform(3.0, 15.0, n - 1)
    power = rng.uniform(1.0, 1.25)
    if kind == "column":
        capacity[-1], link[-1] = rng.uniform(150.0, 400.0), rng.uniform(4.0, 10.0)
    heat = np.zeros(n)
    heat[:2] = rng.uniform(0.3, 1.0, 2)
    heat *= rng.uniform(12.0, 30.0) * loss[:3].sum() / heat.sum()
    warmer = 2.0 if kind == "room" else 0.0

    def slope(y: np.ndarray, room: float, load: float) -> np.ndarray:
        above = y - room
        between = link * np.diff(y)
        lost = loss * np.sign(above) * np.abs(above) ** power / 10.0 ** (power - 1.0)
        into = load * heat - lost + np.append(between, 0.0) - np.insert(between, 0, 0.0)
        return np.asarray(into * 0.06 / capacity)

    def run(load: float, minutes: float, name: str) -> tuple[tf.Run, float]:
        begin = 21.0 + rng.normal(0.0, 1.0)
        phase, wander = rng.uniform(0.0, 6.0), rng.uniform(0.05, 0.1)

        def room(t: float) -> float:
            return float(begin + warmer * t / LONG + wander * np.sin(t / 70.0 + phase))

        time = np.arange(0.0, minutes + STEP / 2.0, STEP)
        found = solve_ivp(lambda t, y: slope(y, room(t), load), (0.0, minutes), np.full(n, room(0.0)), "LSODA", time, rtol=1e-8)
        noisy = np.round(found.y[:SENSORS] + rng.uniform(0.01, 0.04, (SENSORS, 1)) * rng.standard_normal((SENSORS, len(time))), 2)
        columns = {"time_min": time} | {f"T{i + 1}": row for i, row in enumerate(noisy)}
        if warmer:
            columns["ambient"] = np.round([room(t) + 0.02 * rng.standard_normal() for t in time], 2)
        return tf.read(columns, name=name), room(minutes)

    whole = run(1.0, LONG, "run1")[0]
    load = float(rng.choice([rng.uniform(0.7, 0.8), rng.uniform(1.2, 1.3)]))
    first, room = run(load, READ, "run2")
    limit = fsolve(lambda y: slope(y, room, load), np.full(n, room + 10.0))
    return whole, first, limit[:SENSORS]


def rows_of(job: tuple[str, str, int]) -> list[tuple[bool, bool, float]]:
    """(ok, held, width over the rise) of every sensor."""
    kind, effect, seed = job
    whole, first, limit = machine(kind, seed)
    model = tf.improve(whole, add=[effect] if effect else [], jobs=1).model
    found = []
    for r, truth in zip(tf.identify(first, model=model, jobs=1), limit, strict=True):
        low, high = r.steady_state_lo_c, r.steady_state_hi_c
        ok = r.status == "ok" and low is not None and high is not None
        found.append((ok, ok and low <= truth <= high, (high - low) / (truth - r.initial_c) if ok else np.nan))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=8)
    parser.add_argument("--seed", type=int, default=660_000)
    given = parser.parse_args()
    cases = list(product(KINDS, EFFECTS))
    jobs = [(*case, given.seed + 1000 * KINDS.index(case[0]) + i) for case in cases for i in range(given.each)]
    by: dict[tuple[str, str], list[tuple[bool, bool, float]]] = defaultdict(list)
    with ProcessPoolExecutor() as pool:
        for job, rows in zip(jobs, pool.map(rows_of, jobs), strict=True):
            by[job[:2]] += rows
    print("| machine | model of one run with | rows | ok | of those held | median width over the rise |")
    print("| --- | --- | ---: | ---: | ---: | ---: |")
    for (kind, effect), rows in by.items():
        ok = sum(r[0] for r in rows)
        held = 100.0 * sum(r[1] for r in rows) / max(ok, 1)
        print(
            f"| {kind} | {effect or 'no effect'} | {len(rows)} | {ok} | {held:.0f} % | {np.nanmedian([r[2] for r in rows]):.2f} |"
        )


if __name__ == "__main__":
    main()
