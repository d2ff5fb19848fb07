"""How often chance gives an effect its gain: ``python -m benchmarks.discovery.false_alarms`` (docs/false-alarms.md).

Records of the base law alone, made in numpy; every effect of the catalogue is searched on each. Printed per effect: the share
of records on which chance, by the program's own reckoning (each effect's `places`), was below 5 % and 1 %. A
share above that would mean too few places.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import fit_model
from thermofast.models.observations import Observations
from thermofast.models.search.candidates import try_add
from thermofast.models.search.discover import discover

RECORDS = 400


def record(seed: int) -> Observations:
    """Two to six sensors of the base law, 100 to 400 readings; every other record is rounded to steps coarser than its noise."""
    rng = np.random.default_rng([seed, 99])
    n, sensors = int(rng.integers(100, 401)), int(rng.integers(2, 7))
    time = np.arange(float(n))
    rate, rise = rng.uniform(2.5, 7.0, sensors) / n, rng.uniform(3.0, 12.0, sensors)
    noise, step = (0.01, 0.05) if seed % 2 else (0.02, 0.01)
    clean = 20.0 + rise[:, None] * (1.0 - np.exp(-rate[:, None] * time))
    reading = np.round((clean + noise * rng.standard_normal(clean.shape)) / step) * step
    room = 20.0 + 0.02 * rng.standard_normal(n)
    names = tuple(f"T{i}" for i in range(sensors))
    size = np.full(sensors, max(noise, step / np.sqrt(12.0)))
    return Observations("null", names, time, reading, np.ones_like(reading), size, np.full(sensors, step), {"room": room}, {}, 0.02)


def chances(seed: int) -> tuple[dict[str, float], bool]:
    """The chance that the program gives each effect's gain, and whether the search named anything."""
    run = record(seed)
    base = fit_model(run)
    found = {}
    for kind in BUILT_IN:
        candidate = try_add(base, kind())
        if candidate is not None:
            found[kind.id] = candidate.p
    return found, discover(run, [kind() for kind in BUILT_IN]).verdict not in ("none", "unexplained")


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else RECORDS
    with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        results = list(pool.map(chances, range(count), chunksize=4))
    print(f"{count} records without any effect; half of them rounded to 5 times their noise\n")
    print("| effect | chance below 5 % | below 1 % | places |")
    print("| --- | ---: | ---: | ---: |")
    for kind in BUILT_IN:
        p = np.array([r[kind.id] for r, _ in results if kind.id in r])
        constant, by_reading = kind.places
        places = f"{constant:g}" + (f" + {by_reading:g} a reading" if by_reading else "")
        print(f"| {kind.id} | {100.0 * np.mean(p < 0.05):.1f} % | {100.0 * np.mean(p < 0.01):.1f} % | {places} |")
    print(f"\nan effect named in {sum(named for _, named in results)} of {count} records")


if __name__ == "__main__":
    main()
