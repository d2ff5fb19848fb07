"""What ``identify --auto`` is worth: the end foretold from the first two hours of machines with a dominant effect.

python -m benchmarks.discovery.auto [--each 6] [--seed 720000] [--until 120] prints, by simulator and effect, the RMS error of the
temperature at the end (``--at``) with and without ``--auto``, and how many intervals hold. Effects that act from the beginning,
every kind.
"""

import argparse
import importlib
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf
from benchmarks.discovery.dominant import runs_of

#: Effects that show in the first hours; events come when they please.
EARLY = (
    "second_mode",
    "neighbour_heat",
    "ambient",
    "friction_decay",
    "sensor_lag",
    "nonlinear_loss",
    "sensor_drift",
    "cyclic_load",
    "transport_delay",
)
END = 410.0

#: (effect, with --auto, error [K], held, status) of one sensor.
Row = tuple[str, bool, float, bool, str]


def rows_of(job: tuple[str, str, int, float]) -> list[Row]:
    """All sensors of one machine, with ``--auto`` and without."""
    simulator, effect, seed, until = job
    machine = importlib.import_module(f"benchmarks.machines.{simulator}").simulate(seed, 1.0, effect)
    record, run = machine.runs[0], runs_of(machine, seed)[0]
    found: list[Row] = []
    for auto in (False, True):
        plain = tf.identify(run, until=until, at=END, auto=auto)
        for r in plain:
            if r.channel == "N":
                continue
            began = r.start_min or 0.0
            at = began + END if began + END <= record.time[-1] else float(record.time[-1])
            truth = float(np.interp(at, record.time, record.clean[int(r.channel[1:])]))
            low = -np.inf if r.at_lo_c is None else r.at_lo_c
            high = np.inf if r.at_hi_c is None else r.at_hi_c
            found.append((effect, auto, float(r.at_c if r.at_c is not None else np.nan) - truth, low <= truth <= high, r.status))
    return found


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=6)
    parser.add_argument("--seed", type=int, default=720_000)
    parser.add_argument("--until", type=float, default=120.0)
    given = parser.parse_args()
    for simulator in ("bar", "network"):
        jobs = [
            (simulator, effect, given.seed + 1000 * k + i, given.until) for k, effect in enumerate(EARLY) for i in range(given.each)
        ]
        by: dict[str, list[Row]] = defaultdict(list)
        with ProcessPoolExecutor() as pool:
            for rows in pool.map(rows_of, jobs):
                for row in rows:
                    by[row[0]].append(row)
                    by["all"].append(row)
        print(f"**{simulator}**, first {given.until:g} min, the temperature at {END:g} min\n")
        print("| dominant effect | sensors | RMS K | with --auto K | ratio | held | with --auto | ok | with --auto |")
        print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
        for effect in [*EARLY, "all"]:
            rows = by[effect]
            cells = [effect, str(len(rows) // 2)]
            rms = [float(np.sqrt(np.nanmean([r[2] ** 2 for r in rows if r[1] is auto]))) for auto in (False, True)]
            held = [float(np.mean([r[3] for r in rows if r[1] is auto])) for auto in (False, True)]
            ok = [float(np.mean([r[4] == "ok" for r in rows if r[1] is auto])) for auto in (False, True)]
            cells += [f"{rms[0]:.2f}", f"{rms[1]:.2f}", f"{rms[1] / rms[0]:.2f}"]
            cells += [f"{100.0 * v:.0f} %" for v in (*held, *ok)]
            print("| " + " | ".join(cells) + " |", flush=True)
        print()


if __name__ == "__main__":
    main()
