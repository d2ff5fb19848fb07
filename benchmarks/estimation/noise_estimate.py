"""``ast_cqkf`` with and without the process noise of Sage and Husa.

python -m benchmarks.estimation.noise_estimate (docs/published.md).

Median error of T_inf after an hour by the readings alone, and the share of 95 % intervals that hold, on the records of
benchmarks.documents.paper and on machines of simulators that do not know the law; the closing likelihood step is left out, as it
replaces what the filter found where the model is right.
"""

import argparse
from functools import partial

import numpy as np

import thermofast as tf
from benchmarks.documents.paper import KINDS, MINUTES, Array, _holds, measured, truth_of
from benchmarks.machines import bar

WAYS = {
    "neither": {},
    "q (42)": {"process_mean_most": 0.01},
    "Q (43)": {"process_noise_most": 1e-4},
    "Q (43), cap 1e-2": {"process_noise_most": 1e-2},
    "both": {"process_mean_most": 0.01, "process_noise_most": 1e-4},
}


def records(kind: str, seed: int) -> list[tuple[Array, Array, float]]:
    """(minutes, reading, true limit) of the sensors of one record."""
    if kind in KINDS:
        reading = KINDS[kind](measured(0.02, seed), np.random.default_rng(seed))
        return [(MINUTES, reading, truth_of(kind, reading))]
    run = bar.simulate(seed).runs[0]
    last = int(np.searchsorted(run.time - run.time[0], 60.0, "right")) - 1
    return [(run.time, line, float(run.limit[i, last])) for i, line in enumerate(run.reading) if np.isfinite(line).all()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=60)
    draws = parser.parse_args().draws
    print("| records | " + " | ".join(WAYS) + " |")
    print("| --- |" + " ---: |" * len(WAYS))
    identify = partial(tf.identify, until=60, filter="ast_cqkf", imperfection="none", rates="own")
    for kind in (*KINDS, "bar"):
        cells = []
        for settings in WAYS.values():
            errors, held, open_ended = [], [], 0
            for seed in range(70_000, 70_000 + (draws if kind in KINDS else draws // 3)):
                for time, reading, truth in records(kind, seed):
                    r = identify({"time_min": time, "T": reading}, settings=settings | {"closing_step": "false"})[0]
                    open_ended += r.steady_state_c is None
                    errors.append(np.nan if r.steady_state_c is None else abs(r.steady_state_c - truth))
                    held.append(_holds(r, truth))
            cells.append(
                f"{np.nanmedian(errors):.2f} K, {100 * np.mean(held):.0f} %" + (f", {open_ended} open" if open_ended else "")
            )
        print(f"| {kind} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
