"""Does a stopping rule trip when it was foretold, and is as much missing then? From the first third of simulated runs.

python -m benchmarks.analysis.criterion [--runs 500] [--seed 60000] [--rule "2K/h, 2x30min"] [--share 0.333] prints, for lumps
that obey the law (scipy's solver, 20 mK of noise) and for imperfect machines of two kinds (rod of a bar, network of masses), of
sensors on which the rule has not tripped yet: how often the foretold time is within 10 % and the kelvin missing within 0.1 K, how
often the 95 % intervals hold both, and the RMS error of the steady state against that of the three-point extrapolation of the
same readings.

--whole: the whole record of lumps instead, in steps of 0.1, 0.5 and 1 K and with 20 and 300 mK of noise: the error of the trip in
time constants (least, median, most) beside that of the first passage of the readings themselves, and intervals that hold.
"""

import argparse
import importlib
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

import thermofast as tf
from tests.simulator import lump
from thermofast.models.standards import Criterion, criterion_from


def simulated(kind: str, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(time (n,) [min], readings (S, n), clean temperatures (S, n), limits (S, n)) of one run, [degC]."""
    if kind != "lump":
        run = importlib.import_module(f"benchmarks.machines.{kind}").simulate(seed, 1.0, None, exact=False).runs[0]
        good = np.isfinite(run.reading).all(axis=0)
        return run.time[good], run.reading[:, good], run.clean[:, good], run.limit[:, good]
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 421.0)
    rate, rise, start = 1.0 / rng.uniform(45.0, 110.0), rng.uniform(6.0, 25.0), rng.uniform(16.0, 24.0)
    clean = lump(time, rate, rise, start, start)[None]
    return time, clean + 0.02 * rng.standard_normal(clean.shape), clean, np.full_like(clean, start + rise)


def trial(kind: str, rule: Criterion, share: float, seed: int) -> list[tuple[float, ...]]:
    """Of each sensor on which the rule holds after `share` of the record and before its end, what was told against what is true.

    Error of the time over it, error of the kelvin missing, whether each interval holds (nan where a noisy reading showed the trip
    early, which has none), and errors [K] of the steady state and of the three-point extrapolation.
    """
    time, reading, clean, limit = simulated(kind, seed)
    until = share * float(time[-1])
    told = tf.identify({"time_min": time} | {f"T{i}": y for i, y in enumerate(reading)}, until=until, criterion=rule, start=0.0)
    at, found = rule.times(0.0, float(time[-1])), []
    last = int(np.searchsorted(time, until, "right")) - 1
    for i, r in enumerate(told):
        line = np.interp(at, time, clean[i])
        trip = float(rule.trips(at, line[None])[0])
        if not until < trip < np.inf:
            continue
        if r.trip_min is None:  # said that it may never: neither time nor what is missing is right
            found.append((np.inf, np.inf, float(r.trip_lo_min is not None and r.trip_lo_min <= trip), 0.0, np.nan, np.nan))
            continue
        missing = float(limit[i, last] - np.interp(trip, at, line))
        high = np.inf if r.trip_hi_min is None else r.trip_hi_min
        low = -np.inf if r.trip_lo_min is None else r.trip_lo_min
        held: tuple[float, float] = (np.nan, np.nan)
        if r.trip_from == "prediction":
            known = r.missing_lo_k is not None and r.missing_lo_k <= missing <= r.missing_hi_k
            held = float(low <= trip <= high), float(known)
        end = float(limit[i, last])
        gap = np.nan if r.missing_k is None else r.missing_k - missing
        three = np.nan if r.three_point_c is None else r.three_point_c - end
        found.append((r.trip_min / trip - 1.0, gap, *held, r.steady_state_c - end, three))
    return found


def of_whole(rule: Criterion, step: float, noise: float, seed: int) -> tuple[float, float, float]:
    """(error of the time told, that of the first passage of the readings) in time constants, whether the interval holds; nan for
    none.
    """
    rng = np.random.default_rng(seed)
    tau, rise, start = rng.uniform(45.0, 150.0), rng.uniform(15.0, 60.0), rng.uniform(16.0, 24.0)
    time = np.arange(0.0, 8.0 * tau)
    clean = lump(time, 1.0 / tau, rise, start, start)
    reading = np.round((clean + noise * rng.standard_normal(len(time))) / step) * step
    (told,) = tf.identify({"time_min": time, "T": reading}, criterion=rule, start=0.0)
    at = rule.times(0.0, float(time[-1]))
    truth = float(rule.trips(at, np.interp(at, time, clean)[None])[0])
    own = float(rule.trips(*(v[None] if k else v for k, v in enumerate(rule.means(time, reading, 0.0))))[0])
    sides = told.trip_lo_min, told.trip_hi_min
    held = np.nan if None in sides else float(sides[0] <= truth <= sides[1])
    return (np.nan if told.trip_min is None else (told.trip_min - truth) / tau), (own - truth) / tau, held


def whole(rule: Criterion, runs: int, seed: int) -> None:
    """Print the table of whole records."""
    print("| step K | noise K | runs | told, time constants off | readings' first passage | time held |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    with ProcessPoolExecutor() as pool:
        for step, noise in ((0.1, 0.02), (0.5, 0.02), (1.0, 0.02), (0.01, 0.3)):
            each = pool.map(partial(of_whole, rule, step, noise), range(seed, seed + runs), chunksize=4)
            told, own, held = np.array(list(each)).T
            sides = [" ".join(f"{q:.2f}" for q in np.nanquantile(v[np.isfinite(v)], (0.0, 0.5, 1.0))) for v in (told, own)]
            some = f"{100.0 * np.nanmean(held):.0f} %" if np.isfinite(held).any() else "none told"
            print(f"| {step} | {noise} | {runs} | {sides[0]} | {sides[1]} | {some} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--seed", type=int, default=60_000)
    parser.add_argument("--rule", default="2K/h, 2x30min")
    parser.add_argument("--share", type=float, default=1.0 / 3.0)
    parser.add_argument("--whole", action="store_true")
    asked = parser.parse_args()
    rule = criterion_from(asked.rule)
    if asked.whole:
        whole(rule, asked.runs, asked.seed)
        return
    heads = "time within 10 % | missing within 0.1 K | time held | missing held | steady RMS | three-point RMS"
    print(f"| machines | runs | sensors | {heads} |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    with ProcessPoolExecutor() as pool:
        for kind in ("lump", "bar", "network"):
            runs = asked.runs if kind == "lump" else max(asked.runs // 10, 4)
            each = pool.map(partial(trial, kind, rule, asked.share), range(asked.seed, asked.seed + runs), chunksize=4)
            found = np.array([row for rows in each for row in rows])
            near, close = (np.where(np.abs(found[:, k]) <= 0.1, 1.0, 0.0) for k in (0, 1))
            shares = " | ".join(f"{100.0 * np.nanmean(s):.1f} %" for s in (near, close, found[:, 2], found[:, 3]))
            own, three = (np.sqrt(np.nanmean(column**2)) for column in (found[:, 4], found[:, 5]))
            print(f"| {kind} | {runs} | {len(found)} | {shares} | {own:.3f} K | {three:.3f} K, {three / own:.1f} x |", flush=True)


if __name__ == "__main__":
    main()
