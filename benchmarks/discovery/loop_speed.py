"""How long the discovery loop takes: ``python -m benchmarks.discovery.loop_speed``.

`diagnose` with the whole catalogue on 10 sensors of 400 readings, to take 5 s at most on two cores: for healthy records, one
clear effect, two, and something outside the catalogue. And what a second core is worth on many runs.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from machines import draw

from thermofast.output.files import write_columns

LIMIT_S = 5.0
SENSORS, READINGS = 10, 400
SEEDS = (1, 2, 3, 4, 5)
KINDS: tuple[tuple[str, ...], ...] = (
    (),
    ("second_mode",),
    ("cyclic_load",),
    ("cooling_switch", "reading_jump"),
    ("ambient", "second_mode"),
    ("load_step", "sensor_lag"),
    ("sensor_lag", "nonlinear_loss"),
    ("random_walk_heat",),
    ("hysteresis_friction",),
)


def cut(kind: tuple[str, ...], seed: int) -> dict[str, np.ndarray]:
    """A drawn record of at least ten sensors and 400 readings, cut to that."""
    for attempt in range(400):
        columns = draw(kind, np.random.default_rng([seed, attempt]), "clear" if kind else None).columns
        sensors = [c for c in columns if c[0] == "T" and c[1:].isdigit()]
        if len(sensors) >= SENSORS and len(columns["time_min"]) >= READINGS:
            kept = ["time_min", *sensors[:SENSORS], "ambient"]
            return {c: columns[c][:READINGS] for c in kept}
    raise RuntimeError("no such record drawn")


def seconds(*arguments: str) -> float:
    """Wall time of one command."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-m", "thermofast", *arguments], check=True, capture_output=True, cwd=ROOT)
    return time.perf_counter() - began


def main() -> None:
    """Print the table."""
    folder = Path(tempfile.mkdtemp())
    print(
        f"| diagnose, {SENSORS} sensors x {READINGS} readings | s, median and longest of {len(SEEDS)} | longest of {LIMIT_S:g} s |"
    )
    print("| --- | ---: | ---: |")
    for kind in KINDS:
        taken = []
        for seed in SEEDS:
            path = folder / "run.csv"
            write_columns(str(path), cut(kind, seed))
            taken.append(seconds("diagnose", str(path), "-q"))
        name = " + ".join(kind) or "nothing hidden"
        print(f"| {name} | {np.median(taken):.1f}, {max(taken):.1f} | {max(taken) / LIMIT_S:.2f} |", flush=True)
    runs = []
    for i in range(24):
        runs.append(str(folder / f"r{i}.csv"))
        write_columns(runs[-1], draw(("sensor_drift",), np.random.default_rng(i), "clear").columns)
    one, both = (seconds("diagnose", *runs, "-q", "--jobs", jobs) for jobs in ("1", "2"))
    print(f"\n{len(runs)} runs: {one:.1f} s with --jobs 1, {both:.1f} s with --jobs 2 ({one / both:.2f} times faster)")


if __name__ == "__main__":
    main()
