"""A load in steps that is logged: do limits hold with `--drive` where a machine is not one body?

python -m benchmarks.intervals.driven [--each 60] [--seed 4000] [--cycles]

Machines of one or two exponentials (exact steps), the faster or slower one with 0, 5, 10 or 20 % of the rise at a third to a
twentieth of the other's time constant; two to four loads before the last reading used, the last change half a time constant
before it or earlier; or a warm-up in four stages, each of a tenth to a third of a time constant, the last one read for a quarter
to a whole one. Printed of sensors whose status is `ok`: what the 95 % intervals of the limit at the last load hold, and
their width over the rise; beside it the same machines at a constant load.

--cycles: a load that goes on and off all the time, read for three to five time constants; of `ok` rows how many temperatures
between half a time constant and two after the end of the log lie in the interval of `--at`.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf

POWERS = (1.5, 2.5)
SHARES, NOISE, STEP = (0.0, 0.05, 0.1, 0.2), 0.02, 0.5


def record(seed: int, share: float, load_is: str, power: float = 1.0) -> tuple[tf.Run, float, float]:
    """A record used to its end, the limit of its one sensor at the last load [degC], and its rise to that [K]; logged is a speed
    of which the heat is a power.
    """
    rng = np.random.default_rng([seed, int(100 * share), 7])
    tau, times = rng.uniform(25.0, 80.0), rng.uniform(3.0, 20.0)
    taus, parts = np.array([tau, tau / times]), np.array([1.0 - share, share])
    end, room, heat = tau * rng.uniform(1.0, 2.5), rng.uniform(18.0, 25.0), rng.uniform(8.0, 25.0)
    loads = rng.uniform(0.4, 1.0, rng.integers(2, 5))
    starts = np.concatenate([[0.0], np.sort(rng.uniform(0.1 * end, end - 0.5 * tau, len(loads) - 1))])
    if load_is == "constant":
        loads, starts = loads[-1:], starts[:1]
    elif load_is == "stages":
        loads, starts = np.array([0.25, 0.5, 0.75, 1.0]), tau * rng.uniform(0.1, 0.33) * np.arange(4.0)
        end = starts[-1] + tau * rng.uniform(0.25, 1.0)
    time = np.arange(0.0, end, STEP)
    load = loads[np.searchsorted(starts, time, "right") - 1]
    change = np.diff(loads, prepend=0.0)
    since = np.maximum(time[:, None] - starts, 0.0)
    body = (parts * -np.expm1(-since[..., None] / taus)).sum(axis=-1) @ change
    reading = np.round(room + heat * body + NOISE * rng.standard_normal(len(time)), 2)
    return (
        tf.read({"time_min": time, "T1 [°C]": reading, "load": load ** (1.0 / power)}, inputs=("load",)),
        room + heat * loads[-1],
        heat * loads[-1],
    )


def judged(job: tuple[int, float, str, float]) -> tuple[float, str, float, str, bool, float]:
    seed, share, load_is, power = job
    run, limit, rise = record(seed, share, load_is, power)
    r = tf.identify(run, drive=None if load_is == "constant" else "load", jobs=1).records[0]
    low = -np.inf if r.steady_state_lo_c is None else r.steady_state_lo_c
    high = np.inf if r.steady_state_hi_c is None else r.steady_state_hi_c
    return share, load_is, power, r.status, low <= limit <= high, (high - low) / rise


def cycling(seed: int, share: float, load_is: str, power: float) -> list[tuple[str, bool, float]]:
    """Status, whether the interval holds, its width over the swing's, of four temperatures after the end of a record's log."""
    rng = np.random.default_rng([seed, int(100 * share), 8])
    tau, times = rng.uniform(25.0, 60.0), rng.uniform(3.0, 10.0)
    taus, parts = np.array([tau, tau / times]), np.array([1.0 - share, share])
    period, duty = tau * rng.uniform(0.2, 0.7), rng.uniform(0.3, 0.7)
    end, heat, room = tau * rng.uniform(3.0, 5.0), rng.uniform(10.0, 25.0), rng.uniform(18.0, 25.0)
    time = np.arange(0.0, end + 2.0 * tau, STEP)
    on = np.arange(0.0, time[-1], period)
    starts = np.sort(np.concatenate([on, on + duty * period]))
    since = np.maximum(time[:, None] - starts, 0.0)
    body = (parts * -np.expm1(-since[..., None] / taus)).sum(axis=-1) @ np.where(np.arange(len(starts)) % 2, -1.0, 1.0)
    load = ((time % period) < duty * period).astype(float)
    seen = time <= end
    reading = np.round(room + heat * body + NOISE * rng.standard_normal(len(time)), 2)
    run = tf.read({"time_min": time[seen], "T1 [°C]": reading[seen], "load": load[seen]}, inputs=("load",))
    found, swing = [], float(np.ptp(heat * body[time > end - period]))
    for at in end + tau * np.array([0.5, 0.9, 1.4, 1.9]):
        r = tf.identify(run, drive=None if load_is == "constant" else "load", at=float(at), jobs=1).records[0]
        true = room + float(np.interp(at, time, heat * body))
        low, high = (np.nan if v is None else v for v in (r.at_lo_c, r.at_hi_c))
        found.append((r.status, bool(low <= true <= high), (high - low) / swing))
    return found


def cycles(each: int, seed: int) -> None:
    """Print the table of loads that go on and off."""
    print("| share of the second part | `--drive` | `ok` | temperatures held | median width over that of the swing |")
    print("| --- | --- | ---: | ---: | ---: |")
    for share in SHARES[:3]:
        for told in ("cycles", "constant"):
            with ProcessPoolExecutor() as pool:
                every = pool.map(cycling, *zip(*[(seed + k, share, told, 1.0) for k in range(each)], strict=True))
                rows = [row for some in every for row in some]
            ok = [r for r in rows if r[0] == "ok"]
            held = f"{100 * np.mean([r[1] for r in ok]):.0f} % | {np.median([r[2] for r in ok]):.2f}" if ok else "- | -"
            print(
                f"| {100 * share:.0f} % | {'yes' if told == 'cycles' else 'no'} | {len(ok)} of {len(rows)} | {held} |", flush=True
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=60)
    parser.add_argument("--seed", type=int, default=4000)
    parser.add_argument("--cycles", action="store_true")
    given = parser.parse_args()
    if given.cycles:
        cycles(given.each, given.seed)
        return
    kinds = [("steps", 1.0), *(("steps", power) for power in POWERS), ("stages", 1.0), ("stages", POWERS[0]), ("constant", 1.0)]
    jobs = [(given.seed + k, s, c, p) for c, p in kinds for s in SHARES for k in range(given.each)]
    with ProcessPoolExecutor() as pool:
        rows = list(pool.map(judged, jobs))
    print("| load | share of the second part | `ok` | limit held | median width over the rise |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for load_is, power in kinds:
        for share in SHARES:
            mine = [r for r in rows if r[:3] == (share, load_is, power)]
            ok = [r for r in mine if r[3] == "ok"]
            held = f"{100 * np.mean([r[4] for r in ok]):.0f} %" if ok else "-"
            width = f"{np.median([r[5] for r in ok]):.2f}" if ok else "-"
            drive = "" if load_is == "constant" else ", `--drive`"
            name = load_is + drive + (f", heat as speed^{power:g}" if power != 1.0 else "")
            print(f"| {name} | {100 * share:.0f} % | {len(ok)} of {len(mine)} | {held} | {width} |", flush=True)


if __name__ == "__main__":
    main()
