"""Heavy masses behind a quick spindle: does ``identify`` wait for what has hardly been warmed?

python -m benchmarks.unlike_parts.far_masses [--machines 30] [--seed 0] prints, for the quick parts and for the heavy ones
behind them and by how much was read (in median times to 63 % of the quick ones' rises): rows, how many are ``ok``, of these how
many hold the limit and the settling time, how many of all hold the limit, and the median width of the ``ok`` intervals over the
rise.

Chains of two to four lumps of 4 to 16 kJ/K and one to three of 25 to 120 kJ/K, each linked to the next (2 to 8 W/K among the quick
ones, 0.7 to 4 W/K on), a room that stays, a reading a minute, 8 to 30 mK, by scipy's LSODA.
"""

import argparse

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import thermofast as tf

Array = NDArray[np.float64]

READ = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0)
#: Minutes that are read at most, and after which all has settled.
LONGEST, SETTLED = 3000.0, 60_000.0


def machine(seed: int) -> tuple[Array, Array, Array, Array, int, float]:
    """(minutes (n,), readings (S, n) and limits (S,) [degC], settling times (S,) [min], quick parts, their time to 63 % [min])."""
    rng = np.random.default_rng([77, seed])
    quick, heavy = int(rng.integers(2, 5)), int(rng.integers(1, 4))
    size = quick + heavy
    capacity = np.concatenate([rng.uniform(4e3, 1.6e4, quick), rng.uniform(2.5e4, 1.2e5, heavy)])
    links = np.zeros((size, size))
    for i in range(size - 1):
        links[i, i + 1] = links[i + 1, i] = rng.uniform(2.0, 8.0) if i < quick - 1 else rng.uniform(0.7, 4.0)
    loss, heat = rng.uniform(1.5, 5.0, size), np.zeros(size)
    heat[0], heat[1] = rng.uniform(50.0, 150.0), rng.uniform(0.0, 60.0) * (rng.random() < 0.6)
    room = rng.uniform(18.0, 24.0)

    def slope(_time: float, state: Array) -> Array:
        return np.asarray(60.0 * (heat + links @ state - links.sum(axis=1) * state - loss * (state - room)) / capacity)

    limit = np.linalg.solve(np.diag(loss + links.sum(axis=1)) - links, heat + loss * room)
    start, minutes, late = np.full(size, room), np.arange(0.0, LONGEST), np.arange(0.0, SETTLED, 10.0)
    curves = solve_ivp(slope, (0.0, LONGEST), start, "LSODA", minutes, rtol=1e-8, atol=1e-8).y
    whole = solve_ivp(slope, (0.0, SETTLED), start, "LSODA", late, rtol=1e-7, atol=1e-7).y
    done = (whole - room) / (limit - room)[:, None]
    settles = late[(done >= 0.95).argmax(axis=1)]
    turn = float(np.median(late[(done[:quick] > 1.0 - np.exp(-1.0)).argmax(axis=1)]))
    reading = curves + rng.uniform(0.008, 0.03) * rng.standard_normal(curves.shape)
    return minutes, reading, limit, settles, quick, turn


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--machines", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rows: dict[tuple[str, float], list[tuple[bool, bool, bool, float]]] = {}
    for seed in range(given.seed, given.seed + given.machines):
        minutes, reading, limit, settles, quick, turn = machine(seed)
        for read in READ:
            some = minutes <= read * turn
            table = {"time_min": minutes[some]} | {f"T{i}": line[some] for i, line in enumerate(reading)}
            for i, r in enumerate(tf.identify(table, jobs=1)):
                sides = r.steady_state_lo_c, r.steady_state_hi_c, r.t95_lo_min, r.t95_hi_min
                low, high, soon, late = (e if s is None else s for s, e in zip(sides, (-np.inf, np.inf, 0.0, np.inf), strict=True))
                told = low <= limit[i] <= high, soon <= settles[i] <= late, (high - low) / (limit[i] - reading[i, 0])
                rows.setdefault(("quick" if i < quick else "heavy", read), []).append((r.status == "ok", *told))
    print("| parts | read | rows | `ok` | limit held | t95 held | of all held | width / rise |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for (part, read), found in sorted(rows.items(), key=lambda row: (row[0][0] != "quick", row[0][1])):
        ok, held, settled, width = (np.array(v) for v in zip(*found, strict=True))
        wide = f"{np.median(width[ok]):.2f}" if ok.any() else "-"
        cells = [len(ok), ok.sum(), held[ok].sum(), settled[ok].sum(), f"{held.mean():.2f}", wide]
        print(f"| {part} | {read:g} | {' | '.join(map(str, cells))} |")


if __name__ == "__main__":
    main()
