"""Readings rounded to steps far above their noise: does the model look wrong where it is right, and is a real misfit still seen?

python -m benchmarks.estimation.coarse_readings [--each 50] [--seed 0] draws two sensors of exact exponentials, or of ones with a
load that grows half-way by a tenth, rounds them to whole, half and tenth degrees, and prints how often `diagnose` and `compare`
doubt the model, and whether anything but the load (or a change of the cooling, which looks like it) is named.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf

#: (step [K], noise [K]) of the readings.
LOGGERS = ((1.0, 0.02), (1.0, 0.1), (1.0, 0.3), (0.5, 0.02), (0.1, 0.01))


def rounded(step: float, noise: float, grows: float, seed: int) -> tf.Run:
    """A record of 200 min, a reading a minute; `grows` is the share by which the load grows at 90 min."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 201.0)
    data = {"time_min": time}
    for i in range(2):
        rise, rate = rng.uniform(5.0, 20.0), 1.0 / rng.uniform(25.0, 70.0)
        more = grows * -np.expm1(-rate * np.maximum(time - 90.0, 0.0))
        reading = 20.0 + rise * (more - np.expm1(-rate * time)) + noise * rng.standard_normal(201)
        data[f"T{i + 1}"] = np.round(reading / step) * step
    return tf.read(data)


def trial(job: tuple[float, float, float, int]) -> tuple[bool, bool, str]:
    """Whether `diagnose` and `compare` doubt the model, and what is named."""
    run = rounded(*job)
    told = tf.diagnose(run)[0]
    doubted = any(r.status == "model_doubtful" for r in tf.compare(run))
    return told.verdict != "none", doubted, told.verdict


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    print("| step K | noise K | load grows | records | `diagnose` finds something | `compare` doubts | named something else |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    with ProcessPoolExecutor() as pool:
        for grows in (0.0, 0.1):
            for step, noise in LOGGERS:
                jobs = [(step, noise, grows, asked.seed + s) for s in range(asked.each)]
                found = list(pool.map(trial, jobs, chunksize=2))
                seen, doubted = sum(f[0] for f in found), sum(f[1] for f in found)
                other = sum(f[2] not in ("none", "unexplained", "load_step", "cooling_switch") for f in found)
                print(f"| {step:g} | {noise:g} | {grows:.0%} | {asked.each} | {seen} | {doubted} | {other} |", flush=True)


if __name__ == "__main__":
    main()
