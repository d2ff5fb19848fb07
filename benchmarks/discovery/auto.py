"""What ``identify --auto`` is worth: the end foretold from the first two hours of machines with a dominant effect.

python -m benchmarks.discovery.auto [--each 6] [--seed 720000] [--until 120] prints, by simulator and effect, the RMS error of the
temperature at the end (``--at``) with and without ``--auto``, and how many intervals hold. Effects that act from the beginning,
every kind. ``--acted``: all twelve kinds instead, and only machines whose effect has acted by then: one exponential of the readings
used leaves of its sensors ``LEAST`` times what it leaves of the same machine without the effect (the rule by which the simulators
size an effect, on the part that is read).
"""

import argparse
import importlib
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import thermofast as tf
from benchmarks.discovery.dominant import runs_of
from benchmarks.machines.record import EFFECTS, LEAST, Machine

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
PROBES = ("sensor_drift", "reading_jump")
END = 410.0
RATES = np.geomspace(4e-4, 0.4, 200)  # 1/min, of the exponentials by which it is told whether an effect has acted

#: (effect, with --auto, error [K], held, status) of one sensor.
Row = tuple[str, bool, float, bool, str]


def left(machine: Machine, until: float) -> np.ndarray:
    """RMS (S,), K, that one exponential leaves of each sensor's first ``until`` minutes beside its noise."""
    record = machine.runs[0]
    used = record.time <= until
    whole = record.reading[:, used] - record.reading[:, used].mean(axis=1, keepdims=True)
    waves = np.exp(-np.outer(RATES, record.time[used]))
    waves -= waves.mean(axis=1, keepdims=True)
    waves /= np.sqrt((waves**2).sum(axis=1, keepdims=True))
    least = ((whole**2).sum(axis=1)[:, None] - (whole @ waves.T) ** 2).min(axis=1) / used.sum()
    return np.asarray(np.sqrt(np.maximum(least - machine.noise**2, (machine.noise / 4) ** 2)))


def acted(machine: Machine, plain: Machine, until: float) -> bool:
    """Whether the effect dominates what is read: at the sensor it concerns, or at the middle one."""
    assert machine.effect is not None
    ratios = left(machine, until) / left(plain, until)
    return bool((ratios.max() if EFFECTS[machine.effect].local else np.median(ratios)) >= LEAST)


def rows_of(job: tuple[str, str, int, float, bool]) -> list[Row]:
    """All sensors of one machine, with ``--auto`` and without; none of one whose effect is yet to come, where that is asked."""
    simulator, effect, seed, until, choose = job
    simulate = importlib.import_module(f"benchmarks.machines.{simulator}").simulate
    machine = simulate(seed, 1.0, effect)
    if choose and not acted(machine, simulate(seed, machine.background), until):
        return []
    record, run = machine.runs[0], runs_of(machine, seed)[0]
    found: list[Row] = []
    for auto in (False, True):
        plain = tf.identify(run, until=until, at=END, auto=auto)
        for r in plain:
            if r.channel == "N":
                continue
            began = r.start_min or 0.0
            at = began + END if began + END <= record.time[-1] else float(record.time[-1])
            sensor = int(r.channel[1:])
            truth = float(np.interp(at, record.time, record.clean[sensor]))
            if effect in PROBES:  # what is foretold is what the probe will read
                last = np.abs(record.time - at) <= 10.0
                truth += float(np.mean((record.reading - record.clean)[sensor, last]))
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
    parser.add_argument("--acted", action="store_true")
    given = parser.parse_args()
    effects = list(EFFECTS) if given.acted else list(EARLY)
    for simulator in ("bar", "network"):
        jobs = [
            (simulator, effect, given.seed + 1000 * k + i, given.until, given.acted)
            for k, effect in enumerate(effects)
            for i in range(given.each)
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
        for effect in [*effects, "all"]:
            rows = by[effect]
            if not rows:
                print(f"| {effect} | 0 |" + " |" * 7)
                continue
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
