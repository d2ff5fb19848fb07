"""An archive's process killed with SIGKILL at random moments: nothing reported is lost, nothing is half, --resume ends byte-equal.

Run with ``python -m benchmarks.scale.killed --kills 500``.
"""

import argparse
import filecmp
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as papq

from thermofast.output.whole import TEMPORARY

VICTIM = """
import sys
import thermofast as tf

def told(progress):
    print(progress.done + progress.skipped, flush=True)

if __name__ == "__main__":
    tf.archive("identify", sys.argv[1], sys.argv[2], resume=sys.argv[3] == "resume", jobs=2, until=60, progress=told)
"""


def make_archive(folder: Path, files: int, seed: int = 1, sensors: int = 12) -> None:
    """Records of lumps, in folders of machines; each file other."""
    rng = np.random.default_rng(seed)
    minutes = np.arange(241.0)
    for i in range(files):
        place = folder / f"machine {i % 3}"
        place.mkdir(parents=True, exist_ok=True)
        tau, rise = rng.uniform(40.0, 120.0, sensors), rng.uniform(3.0, 12.0, sensors)
        heat = 20.0 + rise * (1.0 - np.exp(-minutes[:, None] / tau)) + 0.02 * rng.standard_normal((len(minutes), sensors))
        columns = {"time_min": minutes} | {f"T{k}": heat[:, k].round(3) for k in range(sensors)}
        table = "\n".join([",".join(columns), *(",".join(f"{v:g}" for v in row) for row in zip(*columns.values(), strict=True))])
        (place / f"run {i}.csv").write_text(table + "\n")


def same(left: Path, right: Path) -> bool:
    """Whether two folders hold the same files, byte for byte."""
    names = [sorted(str(p.relative_to(x)) for p in x.rglob("*") if p.is_file()) for x in (left, right)]
    return names[0] == names[1] and filecmp.cmpfiles(left, right, names[0], shallow=False)[1:] == ([], [])


def half_files(results: Path) -> list[Path]:
    """Parts that cannot be read."""
    broken = []
    for path in results.glob("folder=*/*.parquet"):
        try:
            papq.read_table(path)
        except Exception as error:
            print(path, error, file=sys.stderr)
            broken.append(path)
    return broken


def children_of(pid: int) -> set[int]:
    """Processes that a process started, and theirs."""
    found: set[int] = set()
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found |= {int(entry.parent.name)} | children_of(int(entry.parent.name))
    return found


def left_of(family: set[int], wait_s: float = 10.0) -> int:
    """How many of these processes are still there after a while."""
    until = time.monotonic() + wait_s
    while (left := [pid for pid in family if Path(f"/proc/{pid}").exists()]) and time.monotonic() < until:
        time.sleep(0.05)
    return len(left)


def killing(kills: int, files: int, seed: int) -> dict[str, int]:
    """Kill it so often; counts of what went wrong."""
    random.seed(seed)
    counts = {"kills": 0, "finished": 0, "lost": 0, "half": 0, "unequal": 0, "processes left": 0}
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        make_archive(place / "archive", files)
        script = place / "victim.py"
        script.write_text(VICTIM)
        call = [sys.executable, str(script), "archive"]
        environment = {**os.environ, "PYTHONPATH": str(Path.cwd()), "OMP_NUM_THREADS": "1"}
        began = time.monotonic()
        subprocess.run([*call, "whole", "new"], cwd=place, env=environment, check=True, capture_output=True)
        takes = time.monotonic() - began
        results = place / "results"
        while counts["kills"] < kills:
            mode = "resume" if results.exists() and any(results.iterdir()) else "new"
            victim = subprocess.Popen(
                [*call, "results", mode], cwd=place, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
            time.sleep(random.uniform(0.3 * takes, 1.1 * takes))
            family = children_of(victim.pid)
            victim.kill()
            told = victim.communicate()[0].split()
            reported = int(told[-1]) if told else 0
            counts["kills"] += victim.returncode != 0
            there = len(list(results.glob("folder=*/*.parquet")))
            counts["lost"] += max(0, reported - there)
            counts["half"] += len(half_files(results))
            counts["processes left"] += left_of(family)
            if victim.returncode == 0 or there == files:
                if victim.returncode != 0:
                    subprocess.run([*call, "results", "resume"], cwd=place, env=environment, check=True, capture_output=True)
                counts["finished"] += 1
                counts["unequal"] += not same(place / "whole", results)
                counts["half"] += len(list(results.rglob(f"{TEMPORARY}*")))
                shutil.rmtree(results)
    return counts


def main() -> None:
    """Kill, count, print."""
    options = argparse.ArgumentParser()
    options.add_argument("--kills", type=int, default=500)
    options.add_argument("--files", type=int, default=40)
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    print(json.dumps(killing(given.kills, given.files, given.seed)))


if __name__ == "__main__":
    main()
