"""Heat capacity and resistance from a logged power: do their intervals hold the truth?

python -m benchmarks.analysis.thermal_constants [--each 200] [--seed 0] simulates one lump under a power in three steps by scipy's
solve_ivp and prints how often the 95 % intervals of `compare --drive` hold its heat capacity and its resistance to the
surroundings.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.integrate import solve_ivp

import thermofast as tf


def driven(seed: int, name: str = "power_w", unit: float = 1.0, count: int = 300) -> tuple[tf.Run, float, float]:
    """(run, heat capacity [J/K], resistance [K/W]) of one lump under a power in three steps."""
    rng = np.random.default_rng(seed)
    capacity, resistance = rng.uniform(300.0, 3000.0), rng.uniform(0.05, 0.5)
    tau = capacity * resistance / 60.0
    time = np.linspace(0.0, tau * rng.uniform(1.5, 5.0), count)
    power = np.array([100.0, 180.0, 60.0])[np.searchsorted(np.sort(rng.uniform(0.2, 0.9, 2)) * time[-1], time)]

    def law(t: float, y: np.ndarray) -> np.ndarray:
        return np.asarray(60.0 * (np.interp(t, time, power) - (y - 21.0) / resistance) / capacity)

    curve = solve_ivp(law, (0.0, time[-1]), [21.0], t_eval=time, max_step=time[-1] / 900.0).y[0]
    reading = curve + 0.05 * rng.standard_normal(count)
    data = {"time_min": time, "body": reading, name: power / unit, "room": 21.0 + 0.01 * rng.standard_normal(count)}
    return tf.read(data, inputs=name, ambient="room"), capacity, resistance


def held(seed: int) -> tuple[bool, bool]:
    """Whether the intervals of heat capacity and resistance hold the truth."""
    run, capacity, resistance = driven(seed)
    told = tf.compare(run, drive="power_w")[0]
    bounds = (
        (told.heat_capacity_lo_j_per_k, told.heat_capacity_hi_j_per_k),
        (told.resistance_lo_k_per_w, told.resistance_hi_k_per_w),
    )
    return bounds[0][0] < capacity < bounds[0][1], bounds[1][0] < resistance < bounds[1][1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with ProcessPoolExecutor() as pool:
        found = np.array(list(pool.map(held, range(asked.seed, asked.seed + asked.each), chunksize=4)))
    share = 100.0 * found.mean(axis=0)
    print("| records | heat capacity held, % | resistance held, % |\n| ---: | ---: | ---: |")
    print(f"| {len(found)} | {share[0]:.1f} | {share[1]:.1f} |")


if __name__ == "__main__":
    main()
