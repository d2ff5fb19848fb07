"""How long a large file takes to read, over what bare pyarrow.csv needs for the same cells.

python -m benchmarks.reading.reading_speed [--rows 1000000] [--times 3] writes a file of eight sensors with stamps, semicolons and
decimal commas, reads it with pyarrow.csv (stamps parsed, decimal commas told) and with thermofast, which has to find all that
out, and prints the best times of each and their ratio.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

import thermofast as tf

SENSORS = 8


def written(path: Path, rows: int) -> None:
    """A record of so many rows, one a second."""
    rng = np.random.default_rng(0)
    start = np.datetime64("2026-03-01T08:00:00")
    block = 20_000
    with path.open("w", encoding="utf-8") as out:
        out.write(";".join(["Zeit", *(f"T{i + 1} [°C]" for i in range(SENSORS))]) + "\n")
        for first in range(0, rows, block):
            at = np.arange(first, min(first + block, rows))
            stamps = np.datetime_as_string(start + at.astype("timedelta64[s]"), unit="s")
            values = 45.0 - 20.0 * np.exp(-at / 2e5)[:, None] + rng.normal(0.0, 0.05, (len(at), SENSORS))
            lines = [
                f"{s.replace('T', ' ')};{';'.join(f'{v:.3f}' for v in row)}".replace(".", ",")
                for s, row in zip(stamps.tolist(), values.tolist(), strict=True)
            ]
            out.write("\n".join(lines) + "\n")


def bare(path: Path) -> Any:
    """What pyarrow reads, told all that there is to know."""
    types = {f"T{i + 1} [°C]": pa.float64() for i in range(SENSORS)}
    return pacsv.read_csv(
        path,
        parse_options=pacsv.ParseOptions(delimiter=";"),
        convert_options=pacsv.ConvertOptions(
            column_types={"Zeit": pa.timestamp("s"), **types}, decimal_point=",", timestamp_parsers=["%Y-%m-%d %H:%M:%S"]
        ),
    )


def best(act: Callable[[], Any], times: int) -> float:
    """The shortest of so many [s]."""
    found = []
    for _ in range(times):
        began = time.perf_counter()
        act()
        found.append(time.perf_counter() - began)
    return min(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--times", type=int, default=3)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        written(path, asked.rows)
        run = tf.read(str(path))
        assert len(run.time_s) == asked.rows
        assert len(run.channels) == SENSORS
        peer, own = best(lambda: bare(path), asked.times), best(lambda: tf.read(str(path)), asked.times)
    print("| rows x sensors | pyarrow.csv | thermofast | ratio | to reach |\n| --- | ---: | ---: | ---: | ---: |")
    print(f"| {asked.rows} x {SENSORS} | {peer:.3g} s | {own:.3g} s | {own / peer:.2f} | 1.5 |")


if __name__ == "__main__":
    main()
