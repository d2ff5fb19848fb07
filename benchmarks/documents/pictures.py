"""Pictures of the README and of docs/intervals.md: ``python -m benchmarks.documents.pictures``."""

from pathlib import Path

import numpy as np

import thermofast as tf
from benchmarks.machines import bar
from thermofast.main import cli

ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    spindle = str(ROOT / "sample_runs" / "spindle.csv")
    for arguments in (
        ["identify", spindle, "--until", "60", "--channels", "T5,T7,T8", "-q", "--save-plot", str(ROOT / "docs" / "identify.png")],
        ["sweep", spindle, "--channels", "T5", "-q", "--save-plot", str(ROOT / "docs" / "sweep.png")],
    ):
        cli.main([*arguments, "--format", "md"], standalone_mode=False)
    intervals(ROOT / "docs" / "intervals.png")


def intervals(path: Path) -> None:
    """What is said of one simulated machine at every identification time, by the readings alone and with the machine counted."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    run = bar.simulate(60008).runs[0]
    record = {"time_min": run.time, "T": run.reading[0]} | {f"T{i}": line for i, line in enumerate(run.reading[1:], 1)}
    times = np.arange(20.0, 241.0, 5.0)
    sides = {}
    for name, how in (("machine", {}), ("readings", {"imperfection": "none", "rates": "own"})):
        rows = [tf.identify(record, until=float(t), **how)["T"] for t in times]
        sides[name] = np.array([[r.steady_state_lo_c or np.nan, r.steady_state_hi_c or np.nan] for r in rows])
    figure, axes = plt.subplots(figsize=(8.0, 4.2), layout="constrained")
    axes.fill_between(times, *sides["machine"].T, color="#9ecae1", label="95 % interval, machine counted (default)")
    axes.fill_between(times, *sides["readings"].T, color="#d95f0e", alpha=0.8, label="by the readings alone (--imperfection none)")
    k = np.searchsorted(run.time, times)
    axes.plot(times, run.limit[0, k], color="black", label="true limit, room and load as they are then")
    axes.plot(run.time[run.time <= 240.0], run.reading[0, run.time <= 240.0], color="grey", linewidth=1.0, label="readings")
    axes.set(xlabel="identified on the first ... minutes", ylabel="°C", xlim=(20.0, 240.0))
    axes.set_ylim(run.limit[0].mean() - 3.0, run.limit[0].mean() + 3.0)
    axes.legend(loc="lower right")
    figure.savefig(path, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
