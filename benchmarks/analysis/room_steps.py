"""A room that steps and that nobody logs: is it named, and are a load and a cooling that step still told from it?

python -m benchmarks.analysis.room_steps [--each 20] [--seed 91000] prints, by what steps half way through a run (the room, the
heat, the loss, nothing): how often `diagnose` names it alone, in an "A or B", something else or nothing; of those named, how
often the 95 % intervals hold the size and the time of the step. Chains of three to five bodies with radiation, conduction to the
neighbours, a room that wanders beside, a load that flutters and probes that lag, by scipy's LSODA: no code of the search.
"""

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

import thermofast as tf

Array = NDArray[np.float64]
MINUTES = 300
ABSOLUTE = 273.15
RIGHT = {"room": "room_step", "heat": "load_step", "loss": "cooling_switch", "nothing": ""}
#: What its size is called, and its value without a step.
SIZE = {"room": ("step", 0.0), "heat": ("change", 0.0), "loss": ("ratio", 1.0)}


def record(what: str, seed: int, parts: bool = False) -> tuple[dict[str, Array], float, float, NDArray[np.bool_]]:
    """A run as a table, by how much its room steps [K] or its heat or loss changes (a share), when [min], and in which bodies (n,):
    with `parts` in some only.
    """
    rng = np.random.default_rng([seed, sorted(RIGHT).index(what)])
    n = int(rng.integers(3, 6))
    time = np.arange(0.0, MINUTES + 0.5)
    event = float(rng.uniform(0.35, 0.65) * MINUTES)
    size = float(rng.choice([-1.0, 1.0]) * (rng.uniform(1.0, 2.0) if what == "room" else rng.uniform(0.1, 0.2)))
    kept = np.exp(-1.0 / rng.uniform(60.0, 200.0))
    wander = rng.uniform(0.05, 0.12) * lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], rng.standard_normal(len(time) + 999))[999:]
    flutter = 1.0 + 0.005 * lfilter([0.3], [1.0, -0.954], rng.standard_normal(len(time) + 999))[999:]
    heat, rate = rng.uniform(0.15, 0.6, n), 1.0 / (rng.uniform(30.0, 70.0) * np.exp(0.15 * rng.standard_normal(n)))
    link, glow = rng.uniform(0.0, 0.3) * rate.mean(), rng.uniform(0.05, 0.2)
    room_c = 20.0
    who = np.ones(n, dtype=bool)
    if parts:
        size *= 1.5
        who = rng.permutation(np.arange(n) < rng.integers(1, n))

    def slope(t: float, here: Array) -> Array:
        later = t >= event
        room = room_c + np.interp(t, time, wander) + (size if what == "room" and later else 0.0)
        loss = 1.0 + who * (size if what == "loss" and later else 0.0)
        load = np.interp(t, time, flutter) * (1.0 + who * (size if what == "heat" and later else 0.0))
        hot, cold = here + ABSOLUTE, room + ABSOLUTE
        out = rate * ((1.0 - glow) * (here - room) + glow * (hot**4 - cold**4) / (4.0 * cold**3))
        between = np.diff(here) * link
        return heat * load - loss * out + np.append(between, 0.0) - np.insert(between, 0, 0.0)

    curve = solve_ivp(slope, (0.0, MINUTES), np.full(n, room_c), "LSODA", time, rtol=1e-8, atol=1e-8, max_step=1.0).y
    late = np.exp(-1.0 / rng.uniform(0.2, 0.6, n))
    read = np.array([lfilter([1.0 - k], [1.0, -k], row - row[0]) + row[0] for k, row in zip(late, curve, strict=True)])
    noisy = read + rng.uniform(0.01, 0.03) * rng.standard_normal(read.shape)
    return {"time_min": time, **{f"T{i + 1}": row.round(3) for i, row in enumerate(noisy)}}, size, event, who


def trial(seed: int, what: str) -> tuple[str, bool, bool]:
    """(how it was named, whether the step and its time are held)."""
    table, size, event, _ = record(what, seed)
    found = tf.diagnose(table, jobs=1)[0]
    named = [] if found.verdict in ("none", "unexplained") else found.verdict.split("+")
    either = {name for other in found.also_possible for name in other.split("+")} if named else set()
    right = RIGHT[what]
    if not named:
        return "nothing named", False, False
    if right not in named:
        return "in an A or B" if right and right in either else f"{'+'.join(named)} instead", False, False
    name, still = SIZE[what]
    told = [found.parameters.get(f"{right}.{parameter}") for parameter in (name, "event")]
    held = [
        t is not None and abs(t["value"] - truth) <= 1.96 * (t["standard_error"] or np.inf)
        for t, truth in zip(told, (still + size, event), strict=True)
    ]
    return ("in an A or B" if either else "alone" if named == [right] else "with another"), *held


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=91000)
    told = parser.parse_args()
    print("| what steps | runs | how it was named | size held | time held |\n| --- | ---: | --- | ---: | ---: |")
    with ProcessPoolExecutor(2) as pool:
        for what in RIGHT:
            found = list(pool.map(partial(trial, what=what), range(told.seed, told.seed + told.each)))
            ways = ", ".join(f"{way} {count}" for way, count in Counter(way for way, *_ in found).most_common())
            shown = [one for one in found if one[0] in ("alone", "in an A or B", "with another")]
            held = [f"{sum(one[k] for one in shown)} of {len(shown)}" if what in SIZE else "-" for k in (1, 2)]
            print(f"| {what} | {told.each} | {ways} | {held[0]} | {held[1]} |", flush=True)


if __name__ == "__main__":
    main()
