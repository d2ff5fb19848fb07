"""Does ``validate`` tell right models from wrong ones? ``python -m benchmarks.validated`` (docs/figures.md).

A lump of the law is learnt from three runs together and held against sets of others, each with its own level, start and room; then
machines that changed since: the rate by some percent, a loss that bends. Printed: the share of sensors doubted (by p or by the
rate), of p below 0.01 and below 0.05, and the median area beside what a right model leaves.
"""

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import thermofast as tf

Array = NDArray[np.float64]
MINUTES = np.arange(0.0, 241.0, 2.0)
RATES = (0.012, 0.016, 0.021)


def run_of(name: str, rng: np.random.Generator, law: Callable[[float, float], float], noise: float = 0.02) -> tf.Run:
    """A run: three bodies from about the room to a level of its own, by an ODE solver; law: loss [K/min] of rise and rate."""
    start, heat = rng.normal(20.0, 0.5), rng.uniform(0.7, 1.3)
    columns = {}
    for k, rate in enumerate(RATES):

        def slope(_t: float, y: Array, power: float = heat * (6.0 + 2.0 * k) * rate, rate: float = rate) -> list[float]:
            return [power - law(float(y[0]), rate)]

        solved = solve_ivp(slope, (0.0, MINUTES[-1]), [0.0], t_eval=MINUTES, rtol=1e-9, atol=1e-9)
        columns[f"T{k + 1}"] = start + solved.y[0] + noise * rng.standard_normal(len(MINUTES))
    return tf.read({"time_min": MINUTES, **columns}, name=name)


LAWS: dict[str, Callable[[float, float], float]] = {
    "the machine learnt": lambda rise, rate: rate * rise,
    "2 % faster": lambda rise, rate: 1.02 * rate * rise,
    "5 % faster": lambda rise, rate: 1.05 * rate * rise,
    "loss to the power 1.25": lambda rise, rate: rate * rise * max(rise / 6.0, 1e-9) ** 0.25,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--until", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1000)
    given = parser.parse_args()
    heads = "sensors | doubted | p < 0.01 | p < 0.05 | area K | a right model's K"
    print(f"| {given.runs} runs, carried on from {given.until:g} min | {heads} |")
    print("| --- |" + " ---: |" * 6)
    for name, law in LAWS.items():
        p, area, right, doubted = [], [], [], []
        for seed in range(given.seed, given.seed + given.sets):
            rng = np.random.default_rng(seed)
            learnt = tf.improve([run_of(f"old {i}", rng, LAWS["the machine learnt"]) for i in range(3)], together=True).model
            found = tf.validate(learnt, [run_of(f"new {i} of {seed}", rng, law) for i in range(given.runs)], given.until)
            p += [r.p for r in found]
            doubted += [r.status == "model_doubtful" for r in found]
            area += [r.area_c for r in found]
            right += [r.expected_c for r in found]
        shares = " | ".join(f"{100 * np.mean(np.array(p) < level):.1f} %" for level in (0.01, 0.05))
        print(
            f"| {name} | {len(p)} | {100 * np.mean(doubted):.1f} % | {shares} | {np.median(area):.3f} | {np.median(right):.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
