"""Does ``compare --denoise`` hold what it says? ``python -m benchmarks.analysis.denoised`` (docs/figures.md).

Lumps of the law whose probe's noise is an AR(1) of a given coefficient, lumps that leave the law a little, and machines of
simulators that are not the model's: how many sensors are denoised, the error of what is left over the noise, and the share of
readings whose band holds the truth.
"""

import argparse
import importlib
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

import thermofast as tf

Array = NDArray[np.float64]
MINUTES, NOISE = np.arange(400.0), 0.05


def nothing(_rng: np.random.Generator) -> Array:
    return np.zeros_like(MINUTES)


def second_mode(_rng: np.random.Generator) -> Array:
    return np.asarray(0.6 * -np.expm1(-MINUTES / 400.0))


def cycle(rng: np.random.Generator) -> Array:
    return np.asarray(0.1 * np.sin(2.0 * np.pi * MINUTES / 300.0 + rng.uniform(0.0, 6.0)))


def wander(rng: np.random.Generator) -> Array:
    kept = np.exp(-1.0 / 60.0)
    return np.asarray(0.03 * np.sqrt(1.0 - kept**2) * lfilter([1.0], [1.0, -kept], rng.standard_normal(len(MINUTES))))


CASES: tuple[tuple[str, float, Callable[[np.random.Generator], Array]], ...] = (
    ("white noise", 0.0, nothing),
    ("AR(1) 0.3", 0.3, nothing),
    ("AR(1) 0.5", 0.5, nothing),
    ("AR(1) 0.7", 0.7, nothing),
    ("AR(1) 0.5, a second mode of 0.6 K", 0.5, second_mode),
    ("AR(1) 0.5, a cycle of 0.1 K", 0.5, cycle),
    ("AR(1) 0.5, a wander of 0.03 K", 0.5, wander),
)


def record(phi: float, beside: Callable[[np.random.Generator], Array], seed: int) -> tuple[Array, Array]:
    """(truth, reading) [degC]."""
    rng = np.random.default_rng(seed)
    truth = 20.0 - 8.0 * np.expm1(-MINUTES / rng.uniform(60.0, 100.0)) + beside(rng)
    white = rng.standard_normal(len(MINUTES) + 100)
    coloured = lfilter([1.0], [1.0, -phi], white)[100:] * NOISE * np.sqrt(1.0 - phi**2)
    return truth, np.round(truth + coloured, 3)


#: Simulator and effect of machines that are not the model's law (docs/figures.md says how they are made).
MACHINES = ("bar:", "network:", "plate:", "bar:second_mode", "bar:cyclic_load", "network:load_step", "bar:sensor_drift")


def of_law(name: str, seed: int) -> Iterator[tuple[dict[str, Array], dict[str, Array]]]:
    """Columns of one record and the truth of each of its sensors."""
    _, phi, beside = next(case for case in CASES if case[0] == name)
    truth, reading = record(phi, beside, seed)
    yield {"time_min": MINUTES, "T": reading}, {"T": truth}


def of_machine(name: str, seed: int) -> Iterator[tuple[dict[str, Array], dict[str, Array]]]:
    """The same of a machine's first run, without the sensors that have gaps."""
    simulator, _, effect = name.partition(":")
    module = importlib.import_module(f"benchmarks.machines.{simulator}")
    run = module.simulate(seed, **({"effect": effect} if effect else {})).runs[0]
    whole = [i for i, row in enumerate(run.reading) if np.isfinite(row).all()]
    yield {"time_min": run.time} | {f"T{i}": run.reading[i] for i in whole}, {f"T{i}": run.clean[i] for i in whole}


def figures(name: str, seeds: range) -> str:
    """One line of the table."""
    held, error, sensors = [], [], 0
    for seed in seeds:
        for columns, truth in (of_machine if ":" in name else of_law)(name, seed):
            sensors += len(truth)
            clean = tf.compare(columns, denoise=True).denoised
            for sensor, (middle, low, high) in clean[0].sensors.items() if clean else ():
                true = np.interp(clean[0].time, columns["time_min"], truth[sensor])
                held.append(np.mean((low <= true) & (true <= high)))
                error.append(np.sqrt(np.mean((middle - true) ** 2)) / np.std(columns[sensor] - truth[sensor]))
    told = f"{np.median(error):.2f} | {100 * np.mean(held):.1f} %" if held else "- | -"
    return f"| {name.rstrip(':')} | {len(held)} of {sensors} | {told} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=60, help="of each case of the law")
    parser.add_argument("--machines", type=int, default=24, help="of each simulator")
    parser.add_argument("--seed", type=int, default=5000)
    given = parser.parse_args()
    print("| record | sensors denoised | error over noise, median | held, of 95 % |")
    print("| --- | ---: | ---: | ---: |")
    for name, _, _ in CASES:
        print(figures(name, range(given.seed, given.seed + given.records)), flush=True)
    for name in MACHINES:
        print(figures(name, range(given.seed, given.seed + given.machines)), flush=True)


if __name__ == "__main__":
    main()
