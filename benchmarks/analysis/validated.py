"""Does ``validate`` tell right models from wrong ones? ``python -m benchmarks.analysis.validated`` (docs/figures.md).

A lump of the law is learnt from three runs together and held against sets of others, each with its own level, start and room; then
machines that changed since: the rate by some percent, a loss that bends. With --machines the same of machines that leave the law
everywhere a little, by simulators that are not the model's, and of such whose loss changed. Printed: the share of sensors doubted
(by p or by the rate), of p below 0.01 and below 0.05, and the median area beside what a right model leaves.
"""

import argparse
import importlib
import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

import thermofast as tf
from benchmarks.analysis.changed import changed, factor_of
from benchmarks.discovery.dominant import runs_of

Array = NDArray[np.float64]
MINUTES = np.arange(0.0, 241.0, 2.0)
#: Readings after which an AR(1) has forgotten its start.
SETTLED = 100
RATES = (0.012, 0.016, 0.021)


def run_of(
    name: str, rng: np.random.Generator, law: Callable[[float, float], float], noise: float = 0.02, phi: float = 0.0
) -> tf.Run:
    """A run: three bodies from about the room to a level of its own, by an ODE solver; law: loss [K/min] of rise and rate."""
    start, heat = rng.normal(20.0, 0.5), rng.uniform(0.7, 1.3)
    columns = {}
    for k, rate in enumerate(RATES):

        def slope(_t: float, y: Array, power: float = heat * (6.0 + 2.0 * k) * rate, rate: float = rate) -> list[float]:
            return [power - law(float(y[0]), rate)]

        solved = solve_ivp(slope, (0.0, MINUTES[-1]), [0.0], t_eval=MINUTES, rtol=1e-9, atol=1e-9)
        white = rng.standard_normal(len(MINUTES) + SETTLED)
        coloured = lfilter([math.sqrt(1.0 - phi**2)], [1.0, -phi], white)[SETTLED:]
        columns[f"T{k + 1}"] = start + solved.y[0] + noise * coloured
    return tf.read({"time_min": MINUTES, **columns}, name=name)


LAWS: dict[str, Callable[[float, float], float]] = {
    "the machine learnt": lambda rise, rate: rate * rise,
    "2 % faster": lambda rise, rate: 1.02 * rate * rise,
    "5 % faster": lambda rise, rate: 1.05 * rate * rise,
    "loss to the power 1.25": lambda rise, rate: rate * rise * max(rise / 6.0, 1e-9) ** 0.25,
}


MACHINES = {"bar": ("bar", "nothing"), "network": ("network", "nothing"), "bar, loss 8 to 42 % off": ("bar", "loss")}
Figures = tuple[float, float, float, bool]


def of_law(name: str, seed: int, runs: int, phi: float) -> tuple[list[tf.Run], list[tf.Run]]:
    """Three old runs and `runs` new ones of a machine of the law, changed as LAWS says."""
    rng = np.random.default_rng(seed)
    old = [run_of(f"old {i}", rng, LAWS["the machine learnt"], phi=phi) for i in range(3)]
    return old, [run_of(f"new {i} of {seed}", rng, LAWS[name], phi=phi) for i in range(runs)]


def of_machine(name: str, seed: int, runs: int) -> tuple[list[tf.Run], list[tf.Run]]:
    """The same of a machine by a simulator that is not the model's law; all new runs are changed alike."""
    simulator, kind = MACHINES[name]
    machine = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, 1.0, None, runs=3 + runs)
    every = runs_of(machine, seed)
    bare = [tf.read({"time_min": r.time_s / 60.0, **r.channels}, name=f"run {k} of {seed}") for k, r in enumerate(every)]
    if kind == "nothing":
        return bare[:3], bare[3:]
    factor = factor_of(np.random.default_rng([seed, 5]))
    new = [
        changed(run, record, kind, np.random.default_rng([seed, 5, k]), factor, f"new {k} of {seed}")
        for k, (run, record) in enumerate(zip(every[3:], machine.runs[3:], strict=True))
    ]
    return bare[:3], new


def judged(job: tuple[str, int, int, float, float]) -> list[Figures]:
    """(p, area, a right model's area, doubted) of each sensor of one set of runs."""
    name, seed, runs, until, phi = job
    old, new = of_machine(name, seed, runs) if name in MACHINES else of_law(name, seed, runs, phi)
    found = tf.validate(tf.improve(old, together=True).model, new, until)
    return [(r.p, r.area_c, r.expected_c, r.status == "model_doubtful") for r in found if r.p is not None]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--until", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument(
        "--noise", type=float, default=0.0, metavar="PHI", help="AR(1) noise of this memory from reading to reading"
    )
    parser.add_argument("--machines", action="store_true", help="machines of other simulators in place of the law's")
    given = parser.parse_args()
    heads = "sensors | doubted | p < 0.01 | p < 0.05 | area K | a right model's K"
    print(f"| {given.runs} runs, carried on from {given.until:g} min | {heads} |")
    print("| --- |" + " ---: |" * 6)
    seeds = range(given.seed, given.seed + given.sets)
    with ProcessPoolExecutor() as pool:
        for name in MACHINES if given.machines else LAWS:
            jobs = [(name, seed, given.runs, given.until, given.noise) for seed in seeds]
            p, area, right, doubted = (np.array(c) for c in zip(*(r for one in pool.map(judged, jobs) for r in one), strict=True))
            shares = " | ".join(f"{100 * np.mean(p < level):.1f} %" for level in (0.01, 0.05))
            areas = f"{np.median(area):.3f} | {np.median(right):.3f}"
            print(f"| {name} | {len(p)} | {100 * np.mean(doubted):.1f} % | {shares} | {areas} |", flush=True)


if __name__ == "__main__":
    main()
