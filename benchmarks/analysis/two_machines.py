"""Runs of two machines searched as those of one: is it said, and is it never said of one machine?

python -m benchmarks.analysis.two_machines [--each 28] [--seed 7000] draws, by two simulators, machines with every dominant effect
and without; two runs of one, and one run of it beside one of another machine of the same kind, are given to `diagnose --together`.
Printed is how often it says that they look like runs of two machines: the first must be nought. Machines whose rates are nearer
than a factor of two cannot be told apart by them.

--event: three runs of one machine (three linked bodies, by scipy's solver, with and without a slow mass behind each), of which one
has a load that steps: how often they are said to be of two; and what `improve --together --auto` of the three says of a fourth read
for one and a half time constants, beside what the two runs without the step say.
"""

import argparse
import importlib
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.integrate import solve_ivp

import thermofast as tf
from benchmarks.machines.record import EFFECTS

KINDS = (*EFFECTS, None, None)
LOADS = 0.15


def judge(job: tuple[str, int, int]) -> tuple[str, bool, bool]:
    """(simulator, whether two runs of one machine are said to be of two, whether those of two are)."""
    simulator, seed, number = job
    effect = KINDS[number % len(KINDS)]
    simulate = importlib.import_module(f"benchmarks.machines.{simulator}").simulate
    one = simulate(seed + number, 1.0, effect, runs=2, load_spread=LOADS).runs
    other = simulate(seed + 200 + number, 1.0, effect if number % 2 else None, runs=1, load_spread=LOADS).runs[0]
    return simulator, _said(one[0], one[1]), _said(one[0], other)


def _said(*runs: object) -> bool:
    return _said_of([tf.read(_columns(run), name=f"run {k}") for k, run in enumerate(runs)])


def _columns(run: object) -> dict[str, np.ndarray]:
    good = np.isfinite(run.reading).all(axis=0)  # type: ignore[attr-defined]
    rows = run.reading[:3, good]  # type: ignore[attr-defined]
    return {"time_min": run.time[good]} | {f"T{i}": line for i, line in enumerate(rows)}  # type: ignore[attr-defined]


def linked(seed: int, slow: bool) -> tuple[list[dict[str, np.ndarray]], np.ndarray, float]:
    """Four runs of a machine, the second with a step of its load; the limits (3,) [degC] of the last; its time constant [min]."""
    rng = np.random.default_rng(seed)
    taus, rises, links = rng.uniform(35.0, 60.0, 3), rng.uniform(6.0, 14.0, 3), rng.uniform(0.05, 0.2, 2) / 45.0
    behind, rate = (0.3 / taus if slow else 0.0 * taus), 1.0 / (taus * rng.uniform(4.0, 7.0, 3))
    step, size = rng.uniform(130.0, 230.0), rng.uniform(1.25, 1.6)
    time, found = np.arange(0.0, 401.0), []
    for number, load in enumerate(rng.uniform(0.9, 1.1, 4)):

        def law(t: float, y: np.ndarray, number: int = number, load: float = load) -> np.ndarray:
            acting = load * (size if number == 1 and t > step else 1.0)
            moved = (acting * rises - y[:3]) / taus - behind * (y[:3] - y[3:])
            moved[:2] -= links * (y[:2] - y[1:3])
            moved[1:] += links * (y[:2] - y[1:3])
            return np.concatenate([moved, rate * (y[:3] - y[3:])])

        whole = solve_ivp(law, (0.0, 400.0), np.zeros(6), t_eval=time, max_step=1.0, rtol=1e-7, atol=1e-8).y[:3]
        read = 20.0 + whole + rng.normal(0.0, 0.02, (3, len(time)))
        found.append({"time_min": time} | {f"T{i}": line for i, line in enumerate(read)})
    held = np.diag(1.0 / taus)
    for i, link in enumerate(links):
        held[[i, i + 1], [i, i + 1]] += link
        held[[i, i + 1], [i + 1, i]] -= link
    return found, 20.0 + np.linalg.solve(held, load * rises / taus), float(np.median(taus))


def event(job: tuple[int, bool]) -> tuple[bool, list[tuple[bool, float, float]], list[tuple[bool, float, float]]]:
    """Whether two machines are said; of each sensor whether its limit is held, half-width and error [K]: by three runs, by two."""
    runs, limits, tau = linked(*job)
    read = [tf.read(run, name=f"run {k}") for k, run in enumerate(runs[:3])]
    first = {n: c[: int(1.5 * tau)] for n, c in runs[3].items()}

    def by(some: list[tf.Run]) -> list[tuple[bool, float, float]]:
        told = tf.identify(first, model=tf.improve(some, together=True, auto=True, jobs=1).model, jobs=1)
        rows = []
        for one, limit in zip(told, limits, strict=True):
            low = -np.inf if one.steady_state_lo_c is None else one.steady_state_lo_c
            high = np.inf if one.steady_state_hi_c is None else one.steady_state_hi_c
            rows.append((bool(low <= limit <= high), (high - low) / 2.0, (one.steady_state_c or np.nan) - limit))
        return rows

    return _said_of(read), by(read), by([read[0], read[2]])


def _said_of(runs: list[tf.Run]) -> bool:
    return "two machines" in tf.diagnose(runs, together=True, jobs=1)[0].message


def events(each: int, seed: int) -> None:
    """Print the table of machines of which one run has a step."""
    print("| machine | sets of runs | said to be two machines | learnt from | limits held | median half-width K | RMS error K |")
    print("| --- | ---: | ---: | --- | ---: | ---: | ---: |")
    for slow in (False, True):
        with ProcessPoolExecutor() as pool:
            found = list(pool.map(event, [(seed + k, slow) for k in range(each)]))
        for which, name in ((1, "all three"), (2, "the two without the step")):
            held, half, off = (np.array(v) for v in zip(*(row for one in found for row in one[which]), strict=True))
            two = sum(one[0] for one in found)
            what = "with a slow mass" if slow else "linked bodies"
            rms = float(np.sqrt(np.nanmean(off**2)))
            print(
                f"| {what} | {each} | {two} | {name} | {100 * held.mean():.0f} % | {np.median(half):.2f} | {rms:.2f} |", flush=True
            )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=28)
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--event", action="store_true")
    asked = parser.parse_args()
    if asked.event:
        events(asked.each, asked.seed)
        return
    jobs = [(simulator, asked.seed, number) for simulator in ("bar", "network") for number in range(asked.each)]
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judge, jobs))
    print("| simulator | pairs of runs | of one machine, said to be of two | of two machines, said to be |")
    print("| --- | ---: | ---: | ---: |")
    for simulator in ("bar", "network"):
        some = [(one, two) for name, one, two in found if name == simulator]
        print(f"| {simulator} | {len(some)} | {sum(one for one, _ in some)} | {sum(two for _, two in some)} |")


if __name__ == "__main__":
    main()
