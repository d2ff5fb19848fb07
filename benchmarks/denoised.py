"""Does ``compare --denoise`` hold what it says? ``python -m benchmarks.denoised`` (docs/figures.md).

Lumps of the law whose probe's noise is an AR(1) of a given coefficient, and machines that leave the law by more or less than a test
can see: how many are denoised, the error of what is left over the noise, and the share of readings whose band holds the truth.
"""

import argparse
from collections.abc import Callable

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=60)
    parser.add_argument("--seed", type=int, default=5000)
    given = parser.parse_args()
    print("| beside the model | denoised | error over noise, median | held, of 95 % |")
    print("| --- | ---: | ---: | ---: |")
    for name, phi, beside in CASES:
        held, error = [], []
        for seed in range(given.seed, given.seed + given.records):
            truth, reading = record(phi, beside, seed)
            clean = tf.compare({"time_min": MINUTES, "T": reading}, denoise=True).denoised[0].sensors
            if "T" in clean:
                middle, low, high = clean["T"]
                held.append(np.mean((low <= truth) & (truth <= high)))
                error.append(np.sqrt(np.mean((middle - truth) ** 2)) / NOISE)
        told = f"{np.median(error):.2f} | {100 * np.mean(held):.1f} %" if held else "- | -"
        print(f"| {name} | {len(held)} of {given.records} | {told} |", flush=True)


if __name__ == "__main__":
    main()
