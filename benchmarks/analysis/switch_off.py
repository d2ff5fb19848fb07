"""The temperature at switch-off from a first reading that comes 30 to 120 s late: does the interval hold it, and how near is it?

python -m benchmarks.analysis.switch_off [--records 500] [--seed 80000] prints, for one body and for a winding in iron (scipy's
solver; read every 5 to 30 s for 10 to 60 min, noise 0.05 to 0.3 K): the coverage of the 95 % interval, the RMS error over the
Cramer-Rao limit of the modes that are there, and that of one exponential through all readings, as a lab would draw it. A rod of
thirty slices, which is no sum of two, is told beside.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit

from thermofast.models.standards import temperature_at_switch_off


def cooling(modes: int, seed: int) -> tuple[np.ndarray, np.ndarray, float, float]:
    """(time (n,) [min after switch-off], readings (n,) [degC], temperature at switch-off, Cramer-Rao limit [K])."""
    rng = np.random.default_rng([seed, modes])
    noise, length, step = rng.uniform(0.05, 0.3), rng.uniform(10.0, 60.0), rng.uniform(5.0, 30.0) / 60.0
    room, hot = rng.uniform(15.0, 30.0), rng.uniform(40.0, 110.0)
    time = np.arange(rng.uniform(0.5, 2.0), length, step)
    slow = rng.uniform(20.0, 90.0)
    first = 0
    if modes == 9:  # a rod of thirty slices, cooled at one end, warm by a heat that was spread over some of them
        n, reach = 30, int(rng.integers(4, 20))
        conducts, cooled = rng.uniform(20.0, 90.0) / n * 3.0, 1.0 / slow
        matrix = np.diag(np.full(n - 1, conducts), 1) + np.diag(np.full(n - 1, conducts), -1)
        matrix -= np.diag(matrix.sum(axis=1))
        matrix[-1, -1] -= cooled * n / 2.0
        rise = np.linalg.solve(matrix, -np.concatenate([np.ones(reach), np.zeros(n - reach)]))
        first = int(rng.integers(0, n // 2))
        rise = rise * hot / rise[first]
    elif modes == 1:
        matrix, rise = np.array([[-1.0 / slow]]), np.array([hot])
    else:
        share, fast = rng.uniform(0.1, 0.5), rng.uniform(2.0, 8.0)  # of the winding's heat capacity in the whole; min
        link = 1.0 / fast
        matrix = np.array([[-link, link], [link * share, -link * share - 1.0 / slow]])
        rise = np.array([hot, hot * rng.uniform(0.6, 0.95)])
    curve = solve_ivp(lambda _t, y: matrix @ y, (0.0, length), rise, "LSODA", time, rtol=1e-9, atol=1e-9).y[first]
    if modes == 9:
        return time, room + curve + noise * rng.standard_normal(len(time)), room + float(rise[first]), np.nan
    rates, vectors = np.linalg.eig(matrix)
    sizes = vectors[0] * np.linalg.solve(vectors, rise)
    columns = [np.ones_like(time)]
    at = [1.0]
    for rate, size in zip(rates, sizes, strict=True):
        columns += [np.exp(rate * time), size * time * np.exp(rate * time)]
        at += [1.0, 0.0]
    jacobian, target = np.array(columns).T.real, np.array(at)
    limit = noise * np.sqrt(target @ np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14) @ target)
    return time, room + curve + noise * rng.standard_normal(len(time)), room + hot, float(limit)


def trial(modes: int, seed: int) -> tuple[float, float, float, float]:
    """(error [K], whether the interval holds, Cramer-Rao limit [K], error of one exponential [K])."""
    time, reading, truth, limit = cooling(modes, seed)
    found = temperature_at_switch_off(time, reading, 0.0)
    assert found is not None
    try:
        plain = curve_fit(
            lambda t, end, size, tau: end + size * np.exp(-t / tau), time, reading, p0=(reading[-1], np.ptp(reading), 20.0)
        )[0]
        other = float(plain[0] + plain[1]) - truth
    except RuntimeError:
        other = np.nan
    return found.temperature - truth, float(found.low <= truth <= found.high), limit, other


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=500)
    parser.add_argument("--seed", type=int, default=80_000)
    asked = parser.parse_args()
    print("| machine | records | interval holds | RMS error | over the Cramer-Rao limit | one exponential |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    with ProcessPoolExecutor() as pool:
        for modes, name in ((1, "one body"), (2, "winding in iron"), (9, "a rod of thirty slices")):
            seeds = range(asked.seed, asked.seed + asked.records)
            error, held, limit, other = np.array(list(pool.map(partial(trial, modes), seeds, chunksize=8))).T
            ratio = np.sqrt(np.mean(error**2) / np.mean(limit**2))
            rms, plain = np.sqrt(np.mean(error**2)), np.sqrt(np.nanmedian(other**2))
            print(
                f"| {name} | {len(error)} | {100.0 * held.mean():.1f} % | {rms:.3f} K | {ratio:.2f} | median {plain:.2f} K |",
                flush=True,
            )


if __name__ == "__main__":
    main()
