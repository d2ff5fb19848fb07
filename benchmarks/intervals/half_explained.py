"""A model that knows one of two effects: do its limits hold in the next run?

python -m benchmarks.intervals.half_explained [--machines 24]

Machines by an ODE solver with two effects each (a second mass, a loss that grows with the temperature, friction that dies out, a
probe that lags), three runs at loads 1.0, 0.7 and 1.2. A model is learnt from the first run alone or from the first two together,
with one effect added by hand (`one`), both (`both`), what the search names (`auto`), or no effect (`none`); the third run is
identified with it.
Printed: what the 95 % intervals of the limit hold of the sensors whose status is `ok`, and their width over that without a model.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import thermofast as tf

Array = NDArray[np.float64]

EFFECTS = ("second_mode", "nonlinear_loss", "friction_decay", "sensor_lag")
PAIRS = tuple(combinations(EFFECTS, 2))
LOADS, ROOMS = (1.0, 0.7, 1.2), (20.0, 22.0, 19.0)
NOISE, TURNS, COMPLETE = 0.02, (1.0, 2.0, 4.0), 7.0


def machine(seed: int) -> tuple[list[tf.Run], Array, float, tuple[str, ...]]:
    """Records of three runs, the limits of the third's three sensors (3,) [degC], its time constant [min] and its effects."""
    rng = np.random.default_rng(seed)
    effects = PAIRS[seed % len(PAIRS)]
    tau = rng.uniform(40.0, 90.0)
    rate = rng.uniform(0.8, 1.25, 3) / tau
    heat = rng.uniform(8.0, 22.0, 3)
    mass = rng.uniform(0.2, 0.6) if "second_mode" in effects else 0.0
    slow = tau * rng.uniform(1.5, 4.0)
    grows = rng.uniform(0.005, 0.02) if "nonlinear_loss" in effects else 0.0
    friction, dies = (rng.uniform(0.2, 0.5), tau * rng.uniform(0.5, 2.0)) if "friction_decay" in effects else (0.0, tau)
    lag = tau * rng.uniform(0.05, 0.2) if "sensor_lag" in effects else 0.0
    minutes = np.linspace(0.0, np.round(COMPLETE * tau), 401)
    runs, limits = [], np.empty(3)
    for load, room in zip(LOADS, ROOMS, strict=True):

        def slope(t: float, y: Array, load: float = load) -> Array:
            body, behind, probe = y.reshape(3, 3)
            given = rate * heat * load * (1.0 + friction * np.exp(-t / dies))
            lost = rate * (1.0 + grows * body) * body
            body_slope = given - lost - mass * rate * (body - behind)
            return np.concatenate([body_slope, (body - behind) / slow, (body - probe) / lag if lag else body_slope])

        found = solve_ivp(slope, (0.0, minutes[-1]), np.zeros(9), t_eval=minutes, rtol=1e-8, atol=1e-8, method="LSODA")
        curves = room + found.y[6:]
        noisy = np.round(curves + NOISE * rng.standard_normal(curves.shape), 3)
        columns = {f"T{i + 1}": row for i, row in enumerate(noisy)}
        runs.append(tf.read({"time_min": minutes} | columns, name=f"load {load}"))
        steady = heat * load if not grows else (np.sqrt(1.0 + 4.0 * grows * heat * load) - 1.0) / (2.0 * grows)
        limits = room + steady
    return runs, limits, tau, effects


def width(record: Any) -> float:
    """Of the interval of the limit [K]; infinite where a side is open."""
    low, high = record.steady_state_lo_c, record.steady_state_hi_c
    return np.inf if low is None or high is None else float(high - low)


def judged(seed: int) -> list[tuple[str, int, float, str, bool, float]]:
    """(how the model was made, runs, turns, status, held, width over that without a model) of the third run's sensors."""
    runs, limits, tau, effects = machine(seed)
    ways: dict[str, dict[str, Any]] = {
        "one": {"add": [effects[seed // len(PAIRS) % 2]]},
        "both": {"add": list(effects)},
        "auto": {"auto": True},
        "none": {},
    }
    plain = {turns: tf.identify(runs[2], until=turns * tau, jobs=1) for turns in TURNS}
    found = []
    for count in (1, 2):
        for way, how in ways.items():
            model = tf.improve(runs[:count], together=count > 1, **how).model
            for turns in TURNS:
                for i, r in enumerate(tf.identify(runs[2], until=turns * tau, model=model, jobs=1)):
                    low = r.steady_state_lo_c is None or r.steady_state_lo_c <= limits[i]
                    held = low and (r.steady_state_hi_c is None or limits[i] <= r.steady_state_hi_c)
                    found.append((way, count, turns, r.status, held, width(r) / width(plain[turns][i])))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=700)
    given = parser.parse_args()
    with ProcessPoolExecutor() as pool:
        rows = [r for one in pool.map(judged, range(given.seed, given.seed + given.machines)) for r in one]
    print("| model | runs | time constants used | `ok` | limit held | median width over that without a model |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for way in ("one", "both", "auto", "none"):
        for count in (1, 2):
            for turns in TURNS:
                mine = [r for r in rows if r[:3] == (way, count, turns)]
                ok = [r for r in mine if r[3] == "ok"]
                held = f"{100 * np.mean([r[4] for r in ok]):.0f} %" if ok else "-"
                share = np.median([r[5] for r in ok if np.isfinite(r[5])] or [np.nan])
                print(f"| {way} | {count} | {turns:g} | {len(ok)} of {len(mine)} | {held} | {share:.2f} |", flush=True)


if __name__ == "__main__":
    main()
