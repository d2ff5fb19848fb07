"""The same work again and again in one process: does memory grow, is a handle left open?

python -m benchmarks.scale.soak [--minutes 120] identifies a file and replays a watch by turns, and fits a line to the memory held
after each collection: its slope with its standard error, and the count of open files and threads before and after.
"""

import argparse
import gc
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import thermofast as tf

ROOT = Path(__file__).parents[2]
PAGE = 4096


def resident() -> float:
    """MB held by this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 1e6


def handles() -> int:
    """Open files of this process."""
    return len(list(Path("/proc/self/fd").iterdir()))


def soak(seconds: float, warm: int = 5, watched: int = 1) -> tuple[float, float, int, int, int]:
    """(slope, its standard error) [kB a turn], turns, files and threads left open; every so many turns a file is watched."""
    held: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.parquet"
        turns, until = 0, float("inf")
        while turns < warm + 8 or time.monotonic() < until:
            tf.identify(ROOT / "sample_runs" / "spindle.csv", until=60).save(out)
            if turns % watched == 0:
                tf.watch(str(ROOT / "sample_runs" / "spindle.csv"), replay="max", tolerance=1.0, channels="T5")
            gc.collect()
            turns += 1
            if turns == warm:  # what is loaded and cached once is no leak
                until = time.monotonic() + seconds
                files, threads = handles(), threading.active_count()
            if turns > warm:
                held.append(resident())
    count = np.arange(len(held), dtype=float)
    (slope, _), covariance = np.polyfit(count, held, 1, cov=True)
    return 1e3 * float(slope), 1e3 * float(np.sqrt(covariance[0, 0])), turns, handles() - files, threading.active_count() - threads


def main() -> None:
    """Print the slope."""
    options = argparse.ArgumentParser()
    options.add_argument("--minutes", type=float, default=120.0)
    slope, error, turns, files, threads = soak(60.0 * options.parse_args().minutes)
    print(f"{turns} turns: {slope:.3f} +- {error:.3f} kB a turn; {files} files and {threads} threads left open")


if __name__ == "__main__":
    main()
