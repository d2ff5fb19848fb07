"""How often a refusal ends in an abort instead of its message: ``python -m benchmarks.reading.refusals [RUNS]``.

Each is a process of its own, more of them at once than there are cores, which brings an abort out: a CSV and a Parquet file,
refused while reading (no sensor) and after it (``--until`` beyond the record). Told: processes by exit code; 2 is a refusal, below
0 a signal.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd

SAMPLE = Path(__file__).resolve().parents[2] / "sample_runs" / "spindle.csv"


def commands(folder: Path) -> dict[str, list[str]]:
    """What is refused, by a name of its kind."""
    frame = pd.read_csv(SAMPLE)
    words = pd.DataFrame({"time_min": range(20), "state": ["on"] * 20})
    found = {}
    for kind in ("csv", "parquet"):
        good, bad = folder / f"good.{kind}", folder / f"bad.{kind}"
        for table, path in ((frame, good), (words, bad)):
            table.to_csv(path, index=False) if kind == "csv" else table.to_parquet(path, index=False)
        found[f"{kind}, while reading"] = ["identify", str(bad)]
        found[f"{kind}, after reading"] = ["identify", str(good), "--until", "9999"]
    return found


def code(arguments: list[str]) -> int:
    """Exit code of one process."""
    return subprocess.run([sys.executable, "-m", "thermofast", *arguments, "-q"], capture_output=True, check=False).returncode


def main(runs: int = 1000) -> None:
    """Print the exit codes of a quarter of the runs of each kind."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor() as pool:
        for kind, arguments in commands(Path(folder)).items():
            told = Counter(pool.map(code, [arguments] * (runs // 4)))
            print(f"{kind}: " + ", ".join(f"exit {k}: {n}" for k, n in sorted(told.items())), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
