"""A spindle before a column that is 4 to 10 times slower and carries 15 to 45 % of the rise: what does a short record say?

python -m benchmarks.intervals.two_masses [--machines 20] [--seed 700] [--share 0.15 0.45] [--slower 4 10] [--still] [--drive]
[--own 0] [--fast 15 40] [--past 3.5]
draws machines of two exponentials a sensor (three sensors, 20 mK, a reading a minute, a room that wanders by 0.1 K per root
hour; --still: it does not) and prints, for records of so many time constants of the fast mass: rows that are `ok`, limits held,
the median width of the interval and how far below the limit the estimate lies, and of the `ok` rows the settling times held (of
a room that stays) and their median width over the time; alone, with one complete run of the same machine (`improve --together`
of it and another), and with the room logged. --drive: half of the load for the first fast time constant, then all of it, logged
and told (`--drive`); without the rows of past runs. --calibrated: with the room logged, after `calibrate` on complete runs of
ten other such machines, too. --fast: the time constant of the fast mass [min]. --own: share by which the time constants of the
sensors differ from the machine's at most. --share 2.3 5.7 --slower 5 5: quick parts of 15 to 30 % of the rise. --past: so many time
constants of the slow mass the runs learnt from were long.
"""

import argparse

import numpy as np
from scipy.optimize import brentq

import thermofast as tf

TURNS = (1.5, 3.0, 4.5, 7.0)
#: Time constants of the slow mass of a complete run.
LONG = 3.5
CALIBRATED = "room logged, after calibrate on ten others"


def machine(
    seed: int,
    runs: int,
    shares: tuple[float, float] = (0.15, 0.45),
    slower: tuple[float, float] = (4.0, 10.0),
    still: bool = False,
    steps: bool = False,
    own: float = 0.0,
    fast_min: tuple[float, float] = (15.0, 40.0),
) -> tuple[float, np.ndarray, list[tuple[dict[str, np.ndarray], np.ndarray]]]:
    """(time constant of the fast mass [min], settling times (S,) [min] of a load that is whole from the start on, of each run its
    columns and the limits (S, N) [degC] with the room of each time).
    """
    rng = np.random.default_rng(seed)
    tau, ratio, share = rng.uniform(*fast_min), rng.uniform(*slower), rng.uniform(*shares)
    fast = rng.uniform(5.0, 10.0, 3)
    slow = fast * share * rng.uniform(0.7, 1.3, 3)
    each = tau * rng.uniform(1.0 - own, 1.0 + own, 3) if own else np.full(3, tau)
    time = np.arange(0.0, LONG * tau * ratio)
    found = []
    for _ in range(runs):
        room = np.cumsum(rng.normal(0.0, 0.1 / np.sqrt(60.0), len(time))) * (0.0 if still else 1.0)
        lagged = np.zeros(len(time))
        for i in range(1, len(time)):
            lagged[i] = lagged[i - 1] + (room[i] - lagged[i - 1]) / tau
        load = rng.uniform(0.9, 1.1)
        rise = np.zeros((3, len(time)))
        for part, since in ((0.5, time), (0.5, np.maximum(time - tau, 0.0))) if steps else ((1.0, time),):
            turns = since / each[:, None]
            rise += part * (fast[:, None] * -np.expm1(-turns) + slow[:, None] * -np.expm1(-turns / ratio))
        reading = 20.0 + load * rise + lagged + rng.normal(0.0, 0.02, (3, len(time)))
        columns = {"time_min": time, "ambient": 20.0 + room} | {f"T{i}": line for i, line in enumerate(reading)}
        columns |= {"load_kW": np.where(time < tau, 0.5, 1.0)} if steps else {}
        found.append((columns, 20.0 + load * (fast + slow)[:, None] + room))
    return tau, np.array([settling(*parts, ratio) for parts in zip(fast, slow, each, strict=True)]), found


def settling(fast: float, slow: float, tau: float, ratio: float) -> float:
    """When 95 % of two exponentials are done [min]."""

    def left(time: float) -> float:
        return float(fast * np.exp(-time / tau) + slow * np.exp(-time / (ratio * tau)) - 0.05 * (fast + slow))

    return float(brentq(left, 0.0, 20.0 * tau * max(ratio, 1.0)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=20)
    parser.add_argument("--seed", type=int, default=700)
    parser.add_argument("--share", type=float, nargs=2, default=(0.15, 0.45))
    parser.add_argument("--slower", type=float, nargs=2, default=(4.0, 10.0))
    parser.add_argument("--still", action="store_true")
    parser.add_argument("--drive", action="store_true")
    parser.add_argument("--calibrated", action="store_true")
    parser.add_argument("--own", type=float, default=0.0)
    parser.add_argument("--fast", type=float, nargs=2, default=(15.0, 40.0))
    parser.add_argument("--past", type=float, default=LONG)
    asked = parser.parse_args()
    learnt_kind = (
        "after two complete runs of it" if asked.past >= LONG else f"after two runs of {asked.past:g} time constants of it"
    )
    kinds = ("alone", "room logged", learnt_kind)[: 2 if asked.drive else 3]
    lab = None
    if asked.calibrated:
        kinds = (*kinds, CALIBRATED)
        others = [
            machine(asked.seed + 500_000 + k, 1, asked.share, asked.slower, asked.still, asked.drive, asked.own, asked.fast)[2]
            for k in range(10)
        ]
        found = tf.calibrate([tf.read(one[0][0], name=f"past {k}") for k, one in enumerate(others)])
        lab = found.prior
        print(found.records[0].message or "calibrate says nothing of strong effects")
    rows: dict[tuple[str, float], list[tuple[bool, bool, float, float, bool, float]]] = {(k, t): [] for k in kinds for t in TURNS}
    for seed in range(asked.seed, asked.seed + asked.machines):
        tau, settles, runs = machine(seed, 3, asked.share, asked.slower, asked.still, asked.drive, asked.own, asked.fast)
        bare = [{n: c for n, c in columns.items() if n != "ambient"} for columns, _ in runs]
        part = int(len(bare[0]["time_min"]) * min(asked.past / LONG, 1.0))
        past = [tf.read({n: c[:part] for n, c in columns.items()}, name=f"past {k}") for k, columns in enumerate(bare[1:])]
        model = tf.improve(past, together=True).model if not asked.drive else None
        columns, limit = runs[0]
        for turns in TURNS:
            kept = columns["time_min"] <= turns * tau
            now = limit[:, int(kept.sum()) - 1]
            sources = {"alone": bare[0], "room logged": columns, CALIBRATED: columns}
            for kind in kinds:
                source, learnt = sources.get(kind, bare[0]), None if kind in sources else model
                drive, prior = "load_kW" if asked.drive else None, lab if kind == CALIBRATED else None
                record = {n: c[kept] for n, c in source.items()}
                said = tf.identify(record, model=learnt, drive=drive, imperfection=prior or "typical").records
                for r, truth, done in zip(said, now, settles, strict=True):
                    low = -np.inf if r.steady_state_lo_c is None else r.steady_state_lo_c
                    high = np.inf if r.steady_state_hi_c is None else r.steady_state_hi_c
                    off = truth - (r.steady_state_c if r.steady_state_c is not None else np.nan)
                    soon, late = r.t95_lo_min or 0.0, np.inf if r.t95_hi_min is None else r.t95_hi_min
                    told = (soon <= done <= late, (late - soon) / done)
                    rows[kind, turns].append((r.status == "ok", low <= truth <= high, high - low, off, *told))
    print(
        "| | time constants of the fast mass read | `ok` | limits held | of `ok` rows | width K | estimate below the limit by K "
        "| t95 held of `ok` | width / t95 |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for (kind, turns), found in rows.items():
        ok, held, width, off, settled, wide = (np.array(v) for v in zip(*found, strict=True))
        of_ok = f"{100 * held[ok].mean():.0f} %" if ok.any() else "-"
        told = f"{100 * ok.mean():.0f} % | {100 * held.mean():.0f} % | {of_ok} | {np.median(width):.2f} | {np.nanmedian(off):.2f}"
        told += f" | {100 * settled[ok].mean():.0f} % | {np.median(wide[ok]):.2f}" if ok.any() else " | - | -"
        print(f"| {kind} | {turns:g} | {told} |")


if __name__ == "__main__":
    main()
