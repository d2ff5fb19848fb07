"""Sensors that warm each other: is the limit of all of them right?

python -m benchmarks.intervals.linked [--machines 20] [--seed 500]

Two and three bodies in a row, linked to each other both ways about as strongly as to the room (exact, by the matrix exponential):
the link learnt from one run (`improve --add neighbour_heat`) and a second run of another load identified with it;
`identify --auto` on the second run alone; and on a second run whose load rises by half at STEPPED min. Printed: what of the 95 %
intervals held of limit, t95 and the temperature at 400 min.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

import thermofast as tf

Array = NDArray[np.float64]
MINUTES, NOISE = np.arange(401.0), 0.02
UNTIL = {"--model": (40.0, 80.0, 160.0), "--auto": (40.0, 80.0, 160.0), "--auto, load": (150.0, 220.0)}
STEPPED = 100


def machine(seed: int, bodies: int, runs: int = 2, step: float = 0.0) -> list[tuple[dict[str, Array], Array, Array]]:
    """(record, limits (S,), curves (N, S)) [degC] of runs that differ in load, room and start; the load rises
    by a share `step` at STEPPED.
    """
    rng = np.random.default_rng(seed)
    loss = rng.uniform(0.008, 0.03, bodies)
    flow = -np.diag(loss)
    for i in range(bodies - 1):
        there = rng.uniform(0.2, 1.5) * loss[i]
        back = there * rng.uniform(0.6, 1.6)
        flow[i, i] -= there
        flow[i, i + 1] += there
        flow[i + 1, i + 1] -= back
        flow[i + 1, i] += back
    heat, minute, found = loss * rng.uniform(1.0, 14.0, bodies), expm(flow), []
    for _ in range(runs):
        load, room = rng.uniform(0.8, 1.2), rng.normal(20.0, 1.0)
        limit, curve = np.linalg.solve(-flow, heat * load), [rng.uniform(-0.5, 0.5, bodies)]
        for at in MINUTES[:-1]:
            if at == STEPPED:
                limit = limit * (1.0 + step)
            curve.append(limit + minute @ (curve[-1] - limit))
        curves = room + np.array(curve)
        noisy = np.round(curves + NOISE * rng.standard_normal(curves.shape), 3)
        found.append(({"time_min": MINUTES} | {f"T{i + 1}": noisy[:, i] for i in range(bodies)}, room + limit, curves))
    return found


def settled(curve: Array, limit: float) -> float | None:
    """Minutes until 95 % are done for good; None where the record ends before."""
    outside = np.flatnonzero(np.abs(curve - limit) > 0.05 * abs(limit - curve[0]))
    return float(MINUTES[outside[-1] + 1]) if outside[-1] + 1 < len(MINUTES) else None


def within(low: float | None, value: float | None, high: float | None) -> bool | None:
    if value is None:
        return None
    return (low is None or low <= value) and (high is None or value <= high)


def judged(seed: int, bodies: int, how: str) -> list[tuple[float, str, float, bool | None, bool | None, bool | None]]:
    """(until, status, error of the limit [K], whether intervals of limit, t95 and end held) of the second run's sensors."""
    auto = how != "--model"
    (first, _, _), (second, limits, curves) = machine(seed, bodies, step=0.5 if "load" in how else 0.0)
    model = None if auto else tf.improve(first, add=["neighbour_heat"]).model
    found = []
    for until in UNTIL[how]:
        for i, r in enumerate(tf.identify(second, until=until, at=400, model=model, auto=auto, jobs=1)):
            error = abs((np.nan if r.steady_state_c is None else r.steady_state_c) - limits[i])
            limit = within(r.steady_state_lo_c, limits[i], r.steady_state_hi_c)
            t95 = within(r.t95_lo_min, settled(curves[:, i], limits[i]), r.t95_hi_min)
            found.append((until, r.status, error, limit, t95, within(r.at_lo_c, curves[-1, i], r.at_hi_c)))
    return found


def share(told: Sequence[bool | None]) -> str:
    known = [t for t in told if t is not None]
    return f"{100 * np.mean(known):.0f} % of {len(known)}" if known else "-"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=20)
    parser.add_argument("--seed", type=int, default=500)
    given = parser.parse_args()
    print("| | bodies | min used | `ok` | error K, median | limit held | t95 held | at 400 min held |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    seeds = range(given.seed, given.seed + given.machines)
    with ProcessPoolExecutor() as pool:
        for how in UNTIL:
            for bodies in (2, 3):
                rows = [r for one in pool.map(partial(judged, bodies=bodies, how=how), seeds) for r in one]
                for until in UNTIL[how]:
                    mine = [r for r in rows if r[0] == until]
                    ok = sum(r[1] == "ok" for r in mine)
                    held = " | ".join(share([r[k] for r in mine]) for k in (3, 4, 5))
                    error = np.nanmedian([r[2] for r in mine])
                    print(f"| {how} | {bodies} | {until:g} | {ok} of {len(mine)} | {error:.3f} | {held} |", flush=True)


if __name__ == "__main__":
    main()
