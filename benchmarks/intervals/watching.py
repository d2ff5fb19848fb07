"""Does ``watch`` stop in time, and with right numbers? Simulated tests followed to the moment at which it says "you can stop now".

python -m benchmarks.intervals.watching [--tests 250] [--strong 150] [--seed 80000] [--growth 0.04] [--calibrated] prints, for
tolerances of 0.5 and 1 K and both simulators: the share of tests stopped, how many of those were within the tolerance at every
sensor, the mean time of the stop over the first time at which intervals of the best constant width are as narrow. --calibrated:
with what ``calibrate`` says of ten complete runs of other machines of the kind, too. --cost times a watch of 40 h.
"""

import argparse
import importlib
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

import thermofast as tf
from benchmarks.intervals.imperfect import learnt, oracle
from benchmarks.machines.record import EFFECTS
from thermofast.analysis.watching import Watch, first_readings, half_width
from thermofast.models.imperfection import TYPICAL, Imperfection
from thermofast.pipeline.watching import events_before
from thermofast.records import IdentifyRecord

TOLERANCES = (0.5, 1.0)
FIRST, LAST = 15.0, 400.0


@dataclass(frozen=True)
class Test:
    """One test: looks (k,) [min], error (k, S) [K] of the estimates, when it was stopped and the worst error then, by tolerance."""

    effect: str | None
    looks: np.ndarray
    error: np.ndarray
    stop: tuple[float | None, ...]
    worst: tuple[float, ...]
    narrow: tuple[float | None, ...]


def follow(job: tuple[int, str | None], simulator: str, growth: float, prior: Imperfection = TYPICAL) -> Test:
    """One simulated test looked at whenever it has grown by `growth`."""
    seed, effect = job
    record = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, 1.0, effect).runs[0]
    good = np.isfinite(record.reading).all(axis=0)
    minutes, limit = record.time[good], record.limit[:, good]
    run = tf.read({"time_min": minutes} | {f"T{i}": line for i, line in enumerate(record.reading[:, good])})
    kept: dict[tuple[int, float], tuple[IdentifyRecord, ...]] = {}

    def identify(seen: tf.Run, start: float | None) -> tuple[IdentifyRecord, ...]:
        which = len(seen.time_s), float(seen.time_s[-1])
        if which not in kept:
            kept[which] = tf.identify(seen, start="auto" if start is None else start, details=False, imperfection=prior).records
        return kept[which]

    def happened(seen: tf.Run, minute: float) -> bool:
        return events_before((seen, 0.0), minute)

    watches = [Watch(identify, tolerance, prior.rarely_strong, happened) for tolerance in TOLERANCES]
    stop: list[float | None] = [None] * len(watches)
    narrow: list[float | None] = [None] * len(watches)
    worst = [np.nan] * len(watches)
    looks, errors, at = [], [], FIRST
    while at < LAST:
        count = int(np.searchsorted(minutes - minutes[0], at, "right"))
        seen = first_readings(run, count)
        truth = limit[:, count - 1]
        for k, watch in enumerate(watches):
            look = watch.look(seen)
            estimate = np.array([np.nan if r.steady_state_c is None else r.steady_state_c for r in look.records])
            halves = [half_width(r) for r in look.records]
            if narrow[k] is None and all(h is not None and h <= TOLERANCES[k] for h in halves):
                narrow[k] = at
            if look.stop and stop[k] is None:
                stop[k], worst[k] = at, float(np.abs(estimate - truth).max())
        looks.append(at)
        errors.append(estimate - truth)
        at *= 1.0 + growth
    return Test(effect, np.array(looks), np.array(errors), tuple(stop), tuple(worst), tuple(narrow))


def told(tests: Sequence[Test], title: str, first: Sequence[float | None]) -> None:
    """A table of one population; `first` are the times of the oracle by tolerance."""
    for k, tolerance in enumerate(TOLERANCES):
        stopped = [t for t in tests if t.stop[k] is not None]
        within = np.mean([t.worst[k] <= tolerance for t in stopped]) if stopped else np.nan
        wrong = np.mean([t.stop[k] is not None and t.worst[k] > tolerance for t in tests])
        mean = np.mean([t.stop[k] or LAST for t in tests])
        ratio = f"{mean / first[k]:.2f}" if first[k] else "-"
        row = f"{len(tests)} | {tolerance:g} | {len(stopped) / len(tests):.2f} | {within:.3f} | {wrong:.3f} | {mean:.0f}"
        print(f"| {title} | {row} | {first[k] or 0:.0f} | {ratio} |", flush=True)


def oracle_time(tests: Sequence[Test], tolerance: float) -> float | None:
    """The first look at which intervals of one width about these estimates, the best one, are within the tolerance."""
    for i, minutes in enumerate(tests[0].looks):
        error = np.concatenate([t.error[i] for t in tests])
        error = error[np.isfinite(error)]
        if len(error) > 20 and oracle(error) / 2.0 <= tolerance:
            return float(minutes)
    return None


def cost() -> None:
    """A watch of 100 sensors read every second for 40 h: time per reading, early and late."""
    rng = np.random.default_rng(1)
    seconds = np.arange(0.0, 40 * 3600.0, 1.0)
    rise = rng.uniform(3.0, 15.0, 100)[:, None] * -np.expm1(-seconds / rng.uniform(4000.0, 20000.0, 100)[:, None])
    run = tf.read(
        {"time_s": seconds} | {f"T{i}": 20.0 + line + 0.02 * rng.standard_normal(len(line)) for i, line in enumerate(rise)}
    )
    watch = Watch(lambda seen, start: tf.identify(seen, start="auto" if start is None else start, details=False).records, 0.1)
    for hours in (1.0, 4.0, 10.0, 20.0, 40.0):
        count = int(hours * 3600)
        begun = time.perf_counter()
        watch.look(first_readings(run, count))
        spent = time.perf_counter() - begun
        print(f"| {hours:g} h | {1e3 * spent:.0f} ms a look | {1e3 * spent / (0.01 * count):.2f} ms a reading |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("tests", 250), ("strong", 150), ("seed", 80_000)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--growth", type=float, default=0.04)
    parser.add_argument("--calibrated", action="store_true")
    parser.add_argument("--cost", action="store_true")
    asked = parser.parse_args()
    if asked.cost:
        cost()
        return
    print("| machines | tests | tolerance K | stopped | within, of those | wrong, of all | mean stop min | oracle min | ratio |")
    print("| --- |" + " ---: |" * 8)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for simulator in ("bar", "network"):
            one = partial(follow, simulator=simulator, growth=asked.growth)
            plain = list(pool.map(one, [(asked.seed + i, None) for i in range(asked.tests)], chunksize=2))
            first = [oracle_time(plain, tolerance) for tolerance in TOLERANCES]
            told(plain, simulator, first)
            effects = list(EFFECTS)
            jobs = [(asked.seed + 10_000 + i, effects[i % len(effects)]) for i in range(asked.strong)]
            told(list(pool.map(one, jobs, chunksize=2)), f"{simulator}, one strong effect", [None, None])
            if asked.calibrated:
                known = partial(one, prior=learnt(simulator, asked.seed + 2_000_000, False))
                same = [(asked.seed + i, None) for i in range(asked.tests)]
                told(list(pool.map(known, same, chunksize=2)), f"{simulator}, after calibrate on 10 past runs", first)


if __name__ == "__main__":
    main()
