"""When is it settled? A small source that is warm within minutes, on a body: 95 % of the whole rise, by the program and in truth.

python -m benchmarks.unlike_parts.fast_source [--machines 25] [--seed 500] draws machines of four sensors: two on a source of one to
four minutes (5 to 50 % of their rise), two on the body (45 to 80 min), by scipy's solver; 20 mK, steps of 10 mK, a reading a minute
for 900 min; and prints, by how much is read: sensors, rows that are `ok`, true times of 95 % that lie in the interval, the median
of its half-width and of the error of its middle over the true time, and how far `t95_measured_min` is off.
"""

import argparse
from collections.abc import Iterable

import numpy as np
from scipy.integrate import solve_ivp

import thermofast as tf

END = 900.0
READ = (60.0, 120.0, 180.0, 300.0, END)


def machine(seed: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The columns of a record, and when each of its four sensors has done 95 % of its rise for good [min]."""
    rng = np.random.default_rng(seed)
    tau, source, rise = rng.uniform(45.0, 80.0), rng.uniform(1.0, 4.0), rng.uniform(6.0, 14.0)
    share = rng.uniform(0.05, 0.5)
    # Of a rise of 1 the body has 1 - share, the source beside it share; the source gives what it takes to the body.
    time = np.arange(0.0, END + 1.0)

    def slope(_: float, y: np.ndarray) -> list[float]:
        body, hot = y
        flow = (hot - body) / source
        return [(1.0 - share - body) / tau + 0.02 * (flow - share / source), (share / source) - flow + (1.0 - share - body) / tau]

    fine = np.arange(0.0, END + 0.05, 0.1)
    solved = solve_ivp(slope, (0.0, END), [0.0, 0.0], t_eval=fine, rtol=1e-9, atol=1e-10)
    body, hot = solved.y
    shares = np.array([1.0, 0.4, 0.0, 0.0])[:, None]
    levels = np.array([1.0, 0.9, 0.7, 0.5])[:, None]
    clean = rise * levels * (body + shares * (hot - body))
    limit = rise * levels[:, 0] * (1.0 - share + shares[:, 0] * share)
    far = np.abs(clean - limit[:, None]) > 0.05 * limit[:, None]
    settled = fine[far.shape[1] - 1 - far[:, ::-1].argmax(axis=1)]
    at = np.array([np.interp(time, fine, line) for line in clean])
    reading = np.round(20.0 + at + rng.normal(0.0, 0.02, at.shape), 2)
    return {"time_min": time} | {f"T{i}": line for i, line in enumerate(reading)}, settled


def told(seeds: Iterable[int]) -> dict[tuple[float, bool], list[tuple[bool, bool, float, float, float]]]:
    """By how much was read, and whether the sensor sits on the source: ok, held, half-width and error over the truth, measured."""
    found: dict[tuple[float, bool], list[tuple[bool, bool, float, float, float]]] = {}
    for seed in seeds:
        columns, settled = machine(seed)
        for read in READ:
            rows = tf.identify({n: c[columns["time_min"] <= read] for n, c in columns.items()}).records
            for i, (row, truth) in enumerate(zip(rows, settled, strict=True)):
                low, middle, high = row.t95_lo_min, row.t95_min, row.t95_hi_min
                held = (low is None or low <= truth) and (high is None or truth <= high)
                half = 0.5 * (high - low) / truth if low is not None and high is not None else np.inf
                off = (middle - truth) / truth if middle is not None else np.nan
                measured = row.t95_measured_min - truth if row.t95_measured_min is not None else np.nan
                found.setdefault((read, i < 2), []).append((row.status == "ok", held, half, off, measured))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=25)
    parser.add_argument("--seed", type=int, default=500)
    asked = parser.parse_args()
    print("| read, min | sensor on | rows | `ok` | of these t95 held | half-width / t95 | middle off | measured off, min |")
    print("| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for (read, hot), rows in sorted(told(range(asked.seed, asked.seed + asked.machines)).items()):
        ok, held, half, off, measured = (np.array(v) for v in zip(*rows, strict=True))
        apart = f"{np.nanmedian(measured):.1f}" if np.isfinite(measured).any() else "-"
        of_ok = f"{held[ok].mean():.2f} | {np.median(half[ok]):.2f} | {np.nanmedian(off[ok]):+.2f}" if ok.any() else "- | - | -"
        print(f"| {read:g} | {'source' if hot else 'body'} | {len(rows)} | {ok.mean():.2f} | {of_ok} | {apart} |")


if __name__ == "__main__":
    main()
