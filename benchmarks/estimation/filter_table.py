"""Every filter on the sample runs and on three measured records.

python -m benchmarks.estimation.filter_table (docs/filters.md).
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

from pathlib import Path

import numpy as np

from thermofast.analysis.bench import bench_run
from thermofast.estimation.sensor import run_start
from thermofast.pipeline.methods import known_filters
from thermofast.reading import Options, read_runs
from thermofast.records import BenchRecord

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
#: (file, minutes to identify on, what it is)
RUNS = (
    (ROOT / "sample_runs" / "spindle.csv", 60.0, "spindle"),
    (ROOT / "sample_runs" / "cool_down.csv", 60.0, "cool down"),
    (ROOT / "sample_runs" / "gaps_and_bad_cells.csv", 120.0, "gaps, spikes"),
    (ROOT / "sample_runs" / "hidden.csv", 120.0, "hidden effect"),
    (DATA / "laptop" / "cooling_Test_300.csv", 4.0, "laptop"),
    (DATA / "tclab" / "energy_balance.csv", 6.0, "tclab"),
    (DATA / "cooking_pot" / "0cm_1L_a.csv", 26.0, "cooking pot"),
)


def judged(path: Path, until: float) -> list[BenchRecord]:
    """Records of every filter on one run."""
    run = read_runs(str(path), Options())[0]
    return bench_run(run, run_start(run.time_s / 60.0, list(run.channels.values())), until, known_filters())


def cell(record: BenchRecord) -> str:
    """'ahead (width)' with what went wrong, and * at the one that is recommended."""
    if record.rmse_ahead_c is None:
        return "-"
    width = f"{record.width_c:.2g}" if record.width_c is not None else "-"
    lost = f", {record.broken} broke" if record.broken else f", {record.undetermined} open" if record.undetermined else ""
    return f"{'**' if record.chosen else ''}{record.rmse_ahead_c:.3g} ({width}{lost}){'**' if record.chosen else ''}"


def main() -> None:
    """Print the table: filters by runs."""
    runs = [(label, judged(path, until)) for path, until, label in RUNS if path.is_file()]
    print("| filter | " + " | ".join(f"{label}, {records[0].until_min:g} min" for label, records in runs) + " | readings/s |")
    print("| --- |" + " --- |" * len(runs) + " ---: |")
    for i, record in enumerate(runs[0][1]):
        mine = [next((r for r in records if r.filter == record.filter), None) for _, records in runs]
        speed = np.median([r.steps_per_s for r in mine if r is not None and r.steps_per_s])
        cells = [cell(r) if r is not None else "-" for r in mine]
        print(f"| {runs[0][1][i].filter} | " + " | ".join(cells) + f" | {float(f'{speed:.2g}'):,.0f} |")


if __name__ == "__main__":
    main()
