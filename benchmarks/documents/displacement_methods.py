"""Which method to tell a displacement is right when: ``python -m benchmarks.documents.displacement_methods`` (docs/published.md).

Machines under changing load with six sensors, and rods whose expansion is the integral of their temperature, told on blocks left
out; thirty repeated warm-ups, told on runs left out; and back propagation with and without the swarm's start.
"""

import argparse
from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from thermofast.displacements import LONE, METHODS, TOGETHER
from thermofast.models.displacement import Sample
from thermofast.models.displacement.neural import STEPS, swarm, trained
from thermofast.models.displacement.scoring import compare

Array = NDArray[np.float64]


def lagged(drive: Array, tau: float, step: float) -> Array:
    """First-order lag of a drive (..., N)."""
    state = np.zeros_like(drive)
    for k in range(1, drive.shape[-1]):
        state[..., k] = state[..., k - 1] + -np.expm1(-step / tau) * (drive[..., k - 1] - state[..., k - 1])
    return state


def machine(seed: int, kind: str, readings: int = 400, step: float = 3.0) -> Sample:
    """Six sensors and a displacement [um]: linear in them, lagging them, jumping at thresholds, or nothing to do with them."""
    rng = np.random.default_rng(seed)
    load = np.repeat(rng.choice([0.0, 0.4, 0.7, 1.0], readings), 15)[:readings]
    clean = 20.0 + np.array([lagged(rng.uniform(5.0, 25.0) * load, rng.uniform(8.0, 60.0), step) for _ in range(6)])
    mixed = 1.2 * clean[0] - 0.7 * clean[1]
    low, high = np.quantile(clean[0], [0.35, 0.7])
    truth = {
        "linear": mixed,
        "a shaft that lags by 40 min": lagged(mixed - mixed[0], 40.0, step),
        "jumps at two thresholds": 12.0 * (clean[0] > low) - 18.0 * (clean[0] > high),
        "bends with the temperature": 0.05 * (clean[0] - 20.0) ** 2 + 0.3 * clean[2],
        "a walk, nothing to do with them": np.cumsum(rng.standard_normal(readings)),
    }[kind]
    noise = 0.3 * rng.standard_normal(readings) * ("walk" not in kind)
    return Sample.of((clean + 0.05 * rng.standard_normal(clean.shape)).T, truth + noise, step * np.arange(readings))


#: Where the rod's thermometers sit, as shares of its length from the bearing that heats it.
ROD_SENSORS = {"a rod, four thermometers along it": (0.05, 0.3, 0.6, 0.95), "a rod, one thermometer at its bearing": (0.05,)}


def rod(seed: int, kind: str, readings: int = 400, step: float = 3.0, nodes: int = 60) -> Sample:
    """A steel rod heated at one end, losing heat along it: its expansion [um] is the integral of its temperature.

    No method has this form: the heat equation in one dimension, exact in time by the matrix exponential. A room beside it.
    """
    rng = np.random.default_rng(seed)
    load = np.repeat(rng.choice([0.0, 0.4, 0.7, 1.0], readings), 15)[:readings]
    length, diffusivity, loss = rng.uniform(0.3, 0.6), 7.2e-4, 1.0 / rng.uniform(60.0, 200.0)  # m, m2/min, 1/min
    pace = diffusivity / (length / nodes) ** 2
    flow = pace * (np.eye(nodes, k=1) + np.eye(nodes, k=-1) - 2.0 * np.eye(nodes))
    flow[0, 0] = flow[-1, -1] = -pace
    flow -= loss * np.eye(nodes)
    move = expm(flow * step)
    heat = np.linalg.solve(flow, (move - np.eye(nodes))[:, 0])
    heat *= rng.uniform(15.0, 30.0) / -np.linalg.solve(flow, np.eye(nodes)[:, 0])[0]
    above = np.zeros((readings, nodes))
    for k in range(1, readings):
        above[k] = move @ above[k - 1] + heat * load[k - 1]
    room = 20.0 + lagged(np.repeat(rng.normal(0.0, 1.0, readings), 60)[:readings], 120.0, step)
    at = [round(share * (nodes - 1)) for share in ROD_SENSORS[kind]]
    temperatures = np.column_stack([above[:, at] + room[:, None], room])
    expansion = 11.5 * length * (above + room[:, None] - 20.0).mean(axis=1)
    noisy = temperatures + 0.05 * rng.standard_normal(temperatures.shape)
    return Sample.of(noisy, expansion + 0.3 * rng.standard_normal(readings), step * np.arange(readings))


KINDS = (
    "linear",
    "a shaft that lags by 40 min",
    "jumps at two thresholds",
    "bends with the temperature",
    "a walk, nothing to do with them",
)


def warm_ups(seed: int, lag: float, runs: int = 30, minutes: int = 150) -> Sample:
    """Repeated warm-ups as in the paper: ambient, bearing, motor; the shaft follows its bearing; runs differ by some 13 %."""
    rng = np.random.default_rng(seed)
    on = np.ones((runs, minutes + 1))
    ambient = rng.normal(0.0, 0.8, (runs, 1)) * np.arange(minutes + 1) / minutes
    bearing = lagged(10.0 * (1.0 + 0.13 * rng.standard_normal((runs, 1))) * on, 35.0, 1.0)
    motor = lagged(14.0 * (1.0 + 0.13 * rng.standard_normal((runs, 1))) * on, 50.0, 1.0)
    shaft = lagged(1.15 * bearing, lag, 1.0)
    temperatures = np.stack([ambient, bearing + ambient, motor + ambient], axis=-1)[:, 1::5]
    axial = (11.5 * 0.29 * (shaft + 0.3 * ambient) + 0.3 * rng.standard_normal(shaft.shape))[:, 1::5]
    temperatures = np.round(16.0 * (temperatures + 0.05 * rng.standard_normal(temperatures.shape))) / 16.0
    each = axial.shape[1]
    clock = np.tile(5.0 * np.arange(each), runs)
    return Sample(temperatures.reshape(-1, 3), axial.ravel(), clock, np.repeat(np.arange(runs), each))


def table(rows: dict[str, Callable[[int], Sample]], names: tuple[str, ...], seeds: int) -> None:
    """Median error on what was left out over that of the better rival without temperatures, coverage, and what was trusted."""
    print(f"| machine | {' | '.join(names)} | trusted |")
    print("| --- |" + " ---: |" * (len(names) + 1))
    for label, make in rows.items():
        found = [compare(make(seed), {n: METHODS[n] for n in names}) for seed in range(seeds)]
        cells = []
        for name in names:
            mine = [f.scores[name] for f in found if name in f.scores]
            share = np.median([s.rmse / s.rival_rmse for s in mine])
            cells.append(f"{share:.2f}, {100 * np.mean([s.coverage for s in mine]):.0f} %")
        chosen = ", ".join(f"{name} {count}" for name, count in Counter(f.choice for f in found).most_common())
        print(f"| {label} | {' | '.join(cells)} | {chosen} |", flush=True)
    print()


def starts(seeds: int) -> None:
    """Mean square error of training and ahead, standardised, from the swarm's start and from scikit-learn's own."""
    print("| bends with the temperature | training, 100 steps | training | the other half |")
    print("| --- | ---: | ---: | ---: |")
    for name in ("started by the swarm", "scikit-learn's own start"):
        early, late, ahead = [], [], []
        for seed in range(seeds):
            sample = machine(seed, "bends with the temperature")
            x = (sample.temperatures - sample.temperatures.mean(axis=0)) / sample.temperatures.std(axis=0)
            y = (sample.displacement - sample.displacement.mean()) / sample.displacement.std()
            half = len(y) // 2
            start = swarm(x[:half], y[:half], seed)[0] if "swarm" in name else None
            for steps, errors in ((100, early), (STEPS, late)):
                net = trained(x[:half], y[:half], start, steps)
                errors.append(np.mean((net.predict(x[:half]) - y[:half]) ** 2))
            ahead.append(np.mean((net.predict(x[half:]) - y[half:]) ** 2))
        print(f"| {name} | {np.median(early):.2e} | {np.median(late):.2e} | {np.median(ahead):.2e} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    machines = {kind: lambda seed, kind=kind: machine(seed, kind) for kind in KINDS}
    rods = {kind: lambda seed, kind=kind: rod(seed, kind) for kind in ROD_SENSORS}
    table(machines | rods, (*LONE, "neural network"), seeds)
    rows = {f"30 warm-ups, the shaft {lag:g} min behind": lambda seed, lag=lag: warm_ups(seed, lag) for lag in (8.0, 40.0)}
    table(rows, TOGETHER, max(2, seeds // 4))
    starts(seeds)


if __name__ == "__main__":
    main()
