"""Records of no machine: scales, steps, gaps, doubles, offsets drawn at random; and what must not matter.

python -m benchmarks.reading.random_records [--records 100000] [--seed 0] identifies them with every filter in turn and looks for
effects in some: no exception, no warning, every record a status, every interval in order. python -m
benchmarks.reading.random_records --metamorphic shifts and scales time and temperature: under --imperfection none --rates own
nothing may change but units.
"""

import argparse
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise

import numpy as np

import thermofast as tf
from thermofast.records import FAILURES

FILTERS = ("afukf", "fading_ukf", "ukf", "ekf", "svd_ukf", "ckf", "cqkf", "ast_cqkf", "crpf", "acrpf", "rls", "least_squares")
KNOWN = FAILURES | {"ok", "not_determined", "model_doubtful"}
BATCH = 100
LONGEST = 20_000


def record(seed: int) -> dict[str, np.ndarray]:
    """A record of one to three sensors and 3 to LONGEST readings."""
    rng = np.random.default_rng(seed)
    n = int(np.exp(rng.uniform(np.log(3), np.log(LONGEST if seed % 50 == 0 else 600))))
    scale, offset = 10.0 ** rng.uniform(-6, 6), rng.choice([0.0, 20.0, -200.0, 1e4])
    time = np.cumsum(rng.choice([0.0, 1.0, 1.0, 1.0, 5.0], n) if rng.random() < 0.2 else np.ones(n)) * 10.0 ** rng.uniform(-3, 3)
    columns = {"time_min": time}
    for k in range(int(rng.integers(1, 4))):
        kind = rng.integers(7)
        u = np.linspace(0.0, 1.0, n)
        shape = (
            -np.expm1(-rng.uniform(0.1, 20.0) * u),
            u,
            np.sign(u - rng.random()),
            np.cumsum(rng.standard_normal(n)) / np.sqrt(n),
            rng.standard_normal(n),
            np.zeros(n),
            np.sin(rng.uniform(1.0, 50.0) * u),
        )[kind]
        values = offset + scale * (shape + 10.0 ** rng.uniform(-8, 0) * rng.standard_normal(n) * (rng.random() < 0.8))
        if rng.random() < 0.3:
            values[rng.random(n) < rng.random()] = np.nan
        if rng.random() < 0.2:
            values[rng.integers(n)] += 10.0 ** rng.uniform(-3, 6) * scale
        columns[f"T{k}"] = np.round(values, int(rng.integers(0, 9))) if rng.random() < 0.3 else values
    return columns


def outcome(seed: int) -> str:
    """What came of a record."""
    name = FILTERS[seed % len(FILTERS)]
    try:
        run = tf.read(record(seed), units="C")
    except tf.ThermofastError:
        return "refused"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result = tf.identify(run, filter=name, until=None if seed % 3 else 0.5 * float(run.time_s[-1]) / 60.0 or None)
            if seed % 40 == 0 and len(run.time_s) < 400:
                search = tf.diagnose(run, effects="second_mode,ambient,load_step")
                assert all(r.status for r in search)
    except tf.ThermofastError as error:
        return f"refused: {error.what[:30]}" if "until" not in str(error) else "refused"
    except Exception as error:
        return f"EXCEPTION {type(error).__name__}: {str(error)[:90]}"
    for r in result:
        if r.status not in KNOWN:
            return f"STATUS {r.status}"
        three = [v for v in (r.steady_state_lo_c, r.steady_state_c, r.steady_state_hi_c) if v is not None]
        if not all(np.isfinite(three)) or any(a > b + 1e-9 * abs(b) for a, b in pairwise(three)):
            return f"INTERVAL {three}"
        if r.noise_c is not None and not r.noise_c >= 0.0:
            return f"NOISE {r.noise_c}"
    return "a status each"


def batch(first: int) -> list[tuple[int, str]]:
    """Outcomes of some seeds."""
    return [(seed, outcome(seed)) for seed in range(first, first + BATCH)]


def metamorphic(seed: int) -> list[str]:
    """What changed that must not, under shifts and scales of a lawful record."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(60, 400))
    minutes = np.arange(n) * rng.choice([0.5, 1.0])
    rise = rng.uniform(2.0, 20.0)
    clean = 20.0 + rise * -np.expm1(-minutes / (rng.uniform(0.2, 0.8) * minutes[-1])) + 0.02 * rng.standard_normal(n)
    plain = {"imperfection": "none", "rates": "own", "details": False}
    base = tf.identify({"time_min": minutes, "T1": clean}, **plain)[0]
    wrong = []
    for factor, shift, stretch in ((1.0, 30.0, 1.0), (3.0, 0.0, 1.0), (0.25, 5.0, 1.0), (1.0, 0.0, 7.0), (2.0, -10.0, 0.1)):
        moved = {"time_min": minutes * stretch, "T1": (clean - 20.0) * factor + 20.0 + shift}
        other = tf.identify(tf.read(moved, units="C"), **plain)[0]
        pairs = (
            [
                ((base.steady_state_c - 20.0) * factor + 20.0 + shift, other.steady_state_c, rise * factor),
                ((base.steady_state_lo_c - 20.0) * factor + 20.0 + shift, other.steady_state_lo_c, rise * factor),
                (base.t95_min * stretch, other.t95_min, base.t95_min * stretch),
                (base.noise_c * factor, other.noise_c, base.noise_c * factor),
            ]
            if None not in (base.steady_state_c, base.steady_state_lo_c, base.t95_min)
            else []
        )
        if base.status != other.status:
            wrong.append(f"seed {seed} x{factor} +{shift} t x{stretch}: {base.status} became {other.status}")
        for want, got, size in pairs:
            if got is None or abs(got - want) > 1e-5 * abs(size):
                wrong.append(f"seed {seed} x{factor} +{shift} t x{stretch}: {want:.8g} became {got}")
    return wrong


def main() -> None:
    """Print counts."""
    options = argparse.ArgumentParser()
    options.add_argument("--records", type=int, default=100_000)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--metamorphic", action="store_true")
    given = options.parse_args()
    with ProcessPoolExecutor() as pool:
        if given.metamorphic:
            told = [
                w for wrong in pool.map(metamorphic, range(given.seed, given.seed + given.records), chunksize=10) for w in wrong
            ]
            print("\n".join(told[:20]), f"\n{given.records} records, five changes of each: {len(told)} that are not the same")
            return
        counts: Counter[str] = Counter()
        for found in pool.map(batch, range(given.seed, given.seed + given.records, BATCH)):
            for seed, what in found:
                counts[what] += 1
                if what[:4].isupper():
                    print(seed, what, flush=True)
        print(dict(counts))


if __name__ == "__main__":
    main()
