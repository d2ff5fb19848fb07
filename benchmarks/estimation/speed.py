"""Time of a filter step, of the commands on large files, and of starting up: ``python -m benchmarks.estimation.speed``.

Each row is measured in one run beside its peer or its limit; the ratio is what counts, machines differ.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from thermofast.filters import Afukf, Ukf
from thermofast.models import Lump
from thermofast.models.imperfection import TYPICAL, Part, settle

TOOL = [sys.executable, "-m", "thermofast"]
ROOT = Path(__file__).resolve().parents[2]


def best_of(repeats: int, work: Callable[[], object]) -> float:
    """Least wall time [s] of several runs."""
    return min(_times(repeats, work))


def median_of(repeats: int, work: Callable[[], object]) -> float:
    """Median wall time [s] of several runs."""
    return float(np.median(_times(repeats, work)))


def _times(repeats: int, work: Callable[[], object]) -> list[float]:
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return times


def command(*arguments: str, cores: int | None = None) -> Callable[[], object]:
    """A command in a process of its own, on so many cores (all by default)."""

    def on_few() -> None:
        if cores is not None:
            os.sched_setaffinity(0, set(sorted(os.sched_getaffinity(0))[:cores]))

    return lambda: subprocess.run(arguments, check=True, capture_output=True, cwd=ROOT, preexec_fn=on_few)


def filter_step() -> list[tuple[str, float, str, float, str]]:
    """One step of the compiled filters, steady, over long records; filterpy's UKF on the same model and readings."""
    rng = np.random.default_rng(0)
    n = 20_000
    t = np.arange(n) / 60.0
    y = 26.7 - 8.8 * np.exp(-0.01536 * t) + 0.02 * rng.standard_normal(n)
    model = Lump()
    rows = []
    points = MerweScaledSigmaPoints(3, 0.5, 2.0, 0.0)
    peer = UnscentedKalmanFilter(3, 1, t[1], lambda x: x[:1], lambda x, dt: model_step(x, dt), points)
    peer.x, peer.P, peer.R = np.array([17.9, 0.13, 0.015]), np.diag([4e-4, 1e-4, 1e-5]), np.array([[4e-4]])
    peer.Q = np.zeros((3, 3))

    def run_peer() -> None:
        for value in y[:300]:
            peer.predict()
            peer.update(value)

    peer_step = best_of(3, run_peer) / 300
    for method in (Afukf(), Ukf()):
        start = model.start(t, y, 0.0)
        steps = n - 1 - start.index
        mine = best_of(5, lambda method=method: method.track(model, t, y, 0.0)) - best_of(5, lambda: model.start(t, y, 0.0))
        rows.append(
            (f"{method.name}: one step, us", 1e6 * mine / steps, "filterpy UKF, us", 1e6 * peer_step, "step <= 0.5 us; >= 200 x")
        )
    return rows


def model_step(x: np.ndarray, dt: float) -> np.ndarray:
    """The lump's step in plain numpy, as a user of filterpy would write it."""
    decay = np.exp(-x[2] * dt)
    return np.array([x[0] + x[1] * (1.0 - decay) / x[2], x[1] * decay, x[2]])


def large_file(folder: Path, sensors: int = 10_000, readings: int = 401) -> Path:
    """A wide CSV of spindle-like sensors."""
    rng = np.random.default_rng(0)
    t = np.arange(float(readings))
    rise, rate = rng.uniform(4, 12, sensors), np.log(20) / rng.uniform(100, 300, sensors)
    y = 17.9 + rise * (1 - np.exp(-np.outer(t, rate))) + 0.02 * rng.standard_normal((readings, sensors))
    path = folder / "large.csv"
    with path.open("w") as out:
        out.write("time_min," + ",".join(f"T{i}" for i in range(sensors)) + "\n")
        for k in range(readings):
            out.write(f"{t[k]:g}," + ",".join([f"{v:.2f}" for v in y[k]]) + "\n")
    return path


def whole_commands() -> list[tuple[str, float, str, float, str]]:
    """Wall time of commands, each in a process of its own; medians of five."""
    with tempfile.TemporaryDirectory() as folder:
        large = str(large_file(Path(folder)))
        out, table = str(Path(folder) / "out.csv"), str(Path(folder) / "out.parquet")
        read = (sys.executable, "-c", f"import pandas; pandas.read_csv({large!r})")
        times = ("--windows", "40,45,50,55", "--times", "5:55:1")
        pandas_two, pandas_one = (median_of(5, command(*read, cores=n)) for n in (2, 1))
        law = ("--imperfection", "none", "--rates", "own")
        work = (*TOOL, "identify", large, "-q", "-o", table)
        identify_two, identify_one = (median_of(5, command(*work, *law, cores=n)) for n in (2, 1))
        counted = median_of(3, command(*work, cores=2))
        sweep = median_of(5, command(*TOOL, "sweep", large, "-q", "-o", table, *times, *law, cores=2))
        spindle = "sample_runs/spindle.csv"
        ten = median_of(9, command(*TOOL, "identify", spindle, "-q", "-o", out))
        ten_sweep = median_of(5, command(*TOOL, "sweep", spindle, "-q", "-o", out, *times))
        bare = median_of(9, command(sys.executable, "-c", "pass"))
        numpy = median_of(9, command(sys.executable, "-c", "import numpy"))
        shown = median_of(9, command(*TOOL, "--help"))
    return [
        (
            "identify, 10,000 sensors x 401, the law alone, two cores, s",
            identify_two,
            "pandas.read_csv, bare Python, s",
            pandas_two,
            "ratio <= 2.0",
        ),
        ("the same, one core, s", identify_one, "pandas.read_csv, one core, s", pandas_one, "ratio <= 2.5"),
        ("identify, the same file, machine counted (default), two cores, s", counted, "the law alone, s", identify_two, "-"),
        (
            "sweep 4 windows x 51 times, 10,000 sensors, the law alone, s",
            sweep,
            "identify, same file, s",
            identify_two,
            "ratio <= 1.3",
        ),
        ("sweep 4 windows x 51 times, 10 sensors, s", ten_sweep, "identify, same file, s", ten, "ratio <= 1.5"),
        ("identify, 10 sensors, s", ten, "python -c 'import numpy', s", numpy, "difference <= 0.35 s"),
        ("--help, s", shown, "python -c pass, s", bare, "difference <= 0.15 s"),
    ]


#: Work of one process on the large file, and what of it is spent in compiled functions: 'sensors seconds compiled'.
PER_SENSOR = """
import sys, time
import thermofast as tf
import thermofast.estimation.identify
from thermofast.filters import loop
from thermofast.models.core import kernel

spent = [0.0]

def timed(inner):
    def call(*args):
        begun = time.perf_counter()
        try:
            return inner(*args)
        finally:
            spent[0] += time.perf_counter() - begun
    return call

CORE = "decimal_steps law_patterns likelihoods may_exceed_difference_noise pattern_sums profile_decay spike_weights start_decay"
for name in CORE.split():
    setattr(kernel, name, timed(getattr(kernel, name)))
compiled = loop._compiled
loop._compiled = type("Timed", (), {name: staticmethod(timed(getattr(compiled, name))) for name in ("run", "run_block")})
run = tf.read(sys.argv[1])
tf.identify(run, jobs=1, imperfection="none", rates="own")
spent[0], begun = 0.0, time.perf_counter()
tf.identify(run, jobs=1, imperfection="none", rates="own")
print(len(run.channels), time.perf_counter() - begun, spent[0])
"""


#: Peak of what a process holds in memory [MB] above what it holds once all that the work needs is imported.
PEAK = """
import re, sys
import thermofast as tf

def held(what):
    return int(re.search(what + r":\\s+(\\d+)", open("/proc/self/status").read()).group(1)) / 1024

tf.identify(tf.read("sample_runs/spindle.csv"), jobs=1)
open("/proc/self/clear_refs", "w").write("5")
before = held("VmRSS")
tf.identify(tf.read(sys.argv[1]), jobs=1)
print(held("VmHWM") - before)
"""


def inside() -> list[tuple[str, float, str, float, str]]:
    """Work per sensor outside compiled functions, and peak memory over that of the table, on the large file."""
    with tempfile.TemporaryDirectory() as folder:
        large = str(large_file(Path(folder)))
        done = subprocess.run([sys.executable, "-c", PER_SENSOR, large], check=True, capture_output=True, text=True, cwd=ROOT)
        sensors, seconds, compiled = (float(v) for v in done.stdout.split())

        told = subprocess.run([sys.executable, "-c", PEAK, large], check=True, capture_output=True, text=True, cwd=ROOT)
        above = float(told.stdout)
    outside = 1e6 * (seconds - compiled) / sensors
    return [
        ("identify, per sensor outside compiled functions, us", outside, "all of it, us", 1e6 * seconds / sensors, "<= 20 us"),
        ("peak memory above the imports, 10,000 x 401, MB", above, "the table, MB", 10_000 * 401 * 8 / 2**20, "ratio <= 1.5"),
    ]


def closing() -> list[tuple[str, float, str, float, str]]:
    """Milliseconds of one core for what a sensor may claim, fifty sensors of a run together."""
    rng, minutes = np.random.default_rng(1), np.arange(0.0, 60.0, 0.25)
    y = 20 + 8 * -np.expm1(-minutes / rng.uniform(50, 70, (50, 1))) + 0.02 * rng.standard_normal((50, len(minutes)))
    part = Part(minutes, y, np.full(50, 0.02), np.zeros(50))
    spent = median_of(9, lambda: settle([part], 60.0, TYPICAL))
    return [("closing estimate with discrepancy, a sensor and core, ms", 1e3 * spent / 50, "limit, ms", 1.0, "<= 1")]


def main() -> None:
    print("| what | time | beside | time | ratio | to reach |")
    print("| --- | ---: | --- | ---: | ---: | --- |")
    for what, mine, beside, other, goal in filter_step() + closing() + inside() + whole_commands():
        ratio = f"{other / mine:.0f} x faster" if "x" in goal.split() else f"{mine / other:.2f}"
        if "difference" in goal:
            ratio = f"+{mine - other:.3f} s"
        print(f"| {what} | {mine:.3g} | {beside} | {other:.3g} | {ratio} | {goal} |", flush=True)


if __name__ == "__main__":
    main()
