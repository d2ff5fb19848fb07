"""How often two effects at once are found: ``python -m benchmarks.discovery.acts_twice [--each 20] [--seed 1] [--only KIND]``.

Machines by a simulator of its own (Euler steps of 0.1 min; scipy's solver for the masses): two changes of the load, a door or a
coolant open for 10 to 90 min, a fast and a slow hidden mass, or a load or a cooling that changes beside a slow mass; the exact law,
and machines whose room wanders, load flutters, loss rises and probes lag. "or" is where the true pair stands among those said to
fit as well; a name is wrong where neither verdict nor rivals hold it. Without pairs that need not explain half as much again:
--rule pair_leaves=0.
"""

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import thermofast as tf
from benchmarks.discovery.dominant import with_rule

TIME = np.arange(421.0)
FINE = (TIME[:, None] + 0.1 * np.arange(10)).ravel()
NOISE = 0.02
TRUE = {
    "load": "load_step+load_step.2",
    "cooling": "cooling_switch+cooling_switch.2",
    "masses": "second_mode+second_mode.2",
    "load beside a mass": "load_step+second_mode",
    "cooling beside a mass": "cooling_switch+second_mode",
}


def changed_load(rng: np.random.Generator, imperfect: bool) -> dict[str, Any]:
    """A record of three sensors whose heat changes twice."""
    when = rng.uniform(80.0, 160.0), rng.uniform(220.0, 320.0)
    change = [rng.uniform(0.15, 0.4) * rng.choice([-1.0, 1.0]) for _ in when]
    heat = 1.0 + sum(size * (at < FINE) for at, size in zip(when, change, strict=True))
    return _lumps(rng, imperfect, heat, np.ones(len(FINE)))


def open_door(rng: np.random.Generator, imperfect: bool) -> dict[str, Any]:
    """The same whose loss is larger for a while."""
    begins = rng.uniform(80.0, 250.0)
    ends, ratio = begins + rng.uniform(10.0, 90.0), rng.uniform(1.3, 3.0)
    return _lumps(rng, imperfect, np.ones(len(FINE)), np.where((begins < FINE) & (ends >= FINE), ratio, 1.0))


def _lumps(rng: np.random.Generator, imperfect: bool, heat: Any, loss: Any) -> dict[str, Any]:
    """Three sensors whose heat and loss are multiplied by (n,) at FINE."""
    room = np.cumsum(rng.normal(0.0, 0.012 * imperfect, len(TIME)))
    load = 1.0 + 0.01 * imperfect * np.sin(2.0 * np.pi * TIME / rng.uniform(20.0, 90.0) + rng.uniform(0.0, 6.0))
    columns: dict[str, Any] = {"time_min": TIME}
    for k in range(3):
        tau, rise = rng.uniform(30.0, 70.0), rng.uniform(6.0, 12.0)
        body = probe = 20.0
        read = []
        for i in range(len(TIME)):
            read.append(probe)
            for j in range(10 * i, 10 * i + 10):
                over = body - 20.0 - room[i] + room[0]
                body += 0.1 * (rise * heat[j] * load[i] - over * loss[j] * (1.0 + 0.01 * imperfect * over / rise)) / tau
                probe = probe + 0.1 * (body - probe) / 0.5 if imperfect else body
        columns[f"T{k + 1}"] = np.array(read) + rng.normal(0.0, NOISE, len(TIME))
    return columns


def two_masses(rng: np.random.Generator, imperfect: bool) -> dict[str, Any]:
    """A record of three sensors, each with a fast and a slow hidden mass."""
    fast, slow = rng.uniform(0.03, 0.08), rng.uniform(0.003, 0.007)
    room = np.cumsum(rng.normal(0.0, 0.004 * imperfect, len(TIME)))
    columns: dict[str, Any] = {"time_min": TIME}
    for k in range(3):
        loss, to_fast, to_slow = 1.0 / rng.uniform(30.0, 60.0), rng.uniform(0.015, 0.04), rng.uniform(0.003, 0.009)
        heat = loss * rng.uniform(6.0, 12.0)

        def slope(_t: float, y: Any, heat: float = heat, loss: float = loss, a: float = to_fast, b: float = to_slow) -> list[float]:
            gives = a * (y[0] - y[1]) + b * (y[0] - y[2])
            return [heat - loss * (y[0] - 20.0) - gives, fast * (y[0] - y[1]), slow * (y[0] - y[2])]

        solved = solve_ivp(slope, (0.0, float(TIME[-1])), [20.0] * 3, "LSODA", TIME, rtol=1e-10, atol=1e-10)
        columns[f"T{k + 1}"] = solved.y[0] + room + rng.normal(0.0, NOISE, len(TIME))
    return columns


def changed_beside_a_mass(rng: np.random.Generator, imperfect: bool, what: str) -> dict[str, Any]:
    """A record of three sensors over a slow mass each, whose heat or loss changes once."""
    when, size, slow = rng.uniform(120.0, 300.0), rng.uniform(0.2, 0.6) * rng.choice([-1.0, 1.0]), rng.uniform(0.003, 0.007)
    room = np.cumsum(rng.normal(0.0, 0.012 * imperfect, len(TIME)))
    swing, phase = 2.0 * np.pi / rng.uniform(20.0, 90.0), rng.uniform(0.0, 6.0)
    columns: dict[str, Any] = {"time_min": TIME}
    for k in range(3):
        rate, share, rise = 1.0 / rng.uniform(30.0, 60.0), rng.uniform(0.15, 0.5), rng.uniform(6.0, 18.0)

        def slope(t: float, y: Any, rate: float = rate, share: float = share, rise: float = rise) -> list[float]:
            changed = size if t > when else 0.0
            heat = (1.0 + changed * (what == "load")) * (1.0 + 0.01 * imperfect * np.sin(swing * t + phase))
            loss = (1.0 + changed * (what == "cooling")) * (y[0] - np.interp(t, TIME, room))
            return [rate * (rise * heat - loss - share * (y[0] - y[1])), slow * (y[0] - y[1])]

        solved = solve_ivp(slope, (0.0, float(TIME[-1])), [0.0, 0.0], t_eval=TIME, max_step=1.0, rtol=1e-8, atol=1e-8)
        columns[f"T{k + 1}"] = 20.0 + solved.y[0] + rng.normal(0.0, NOISE, len(TIME))
    return columns


MACHINES = {
    "load": changed_load,
    "cooling": open_door,
    "masses": two_masses,
    "load beside a mass": partial(changed_beside_a_mass, what="load"),
    "cooling beside a mass": partial(changed_beside_a_mass, what="cooling"),
}


def judge(job: tuple[str, bool, int]) -> tuple[str, bool, str]:
    """Kind, whether imperfect, and what the search says of it."""
    kind, imperfect, seed = job
    record = MACHINES[kind](np.random.default_rng(seed), imperfect)
    row = tf.diagnose(record, jobs=1)[0]
    true = set(TRUE[kind].split("+"))
    if set(row.verdict.split("+")) == true:
        return kind, imperfect, "named"
    if true in [set(also.split("+")) for also in row.also_possible] and row.verdict != "unexplained":
        return kind, imperfect, "or"
    if row.verdict in true and not row.verdict.endswith(".2"):
        return kind, imperfect, "one of the two"
    return kind, imperfect, "none" if row.verdict in ("none", "unexplained") else "wrong"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rule", default="", metavar="NAME=NUMBER", help="with another value of a rule, to see what it is for")
    parser.add_argument("--only", default="", help="one kind")
    given = parser.parse_args()
    kinds = [k for k in TRUE if given.only in ("", k)]
    jobs = [(k, i, given.seed + n) for k in kinds for i in (False, True) for n in range(given.each)]
    with ProcessPoolExecutor(initializer=with_rule, initargs=(given.rule,)) as pool:
        found = list(pool.map(judge, jobs))
    ways = ("named", "or", "one of the two", "none", "wrong")
    print("| acts twice | machine | of | " + " | ".join(ways) + " |")
    print("| --- | --- | ---: |" + " ---: |" * len(ways))
    for kind in kinds:
        for imperfect in (False, True):
            some = Counter(way for k, i, way in found if (k, i) == (kind, imperfect))
            told = " | ".join(str(some[w]) for w in ways)
            print(f"| {kind} | {'imperfect' if imperfect else 'exact'} | {some.total()} | {told} |")


if __name__ == "__main__":
    main()
