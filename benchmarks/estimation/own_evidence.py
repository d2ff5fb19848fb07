"""Rows against the readings after their identification time: ``python -m benchmarks.estimation.own_evidence [MACHINES]``.

Exact machines by the tests' independent simulator (one exponential and nothing else): how often a row is told that its later
readings leave the prediction's band, which should be once in a thousand. And, where ../shared/cases/lab is there, its imperfect
machines: how many `ok` rows there are, how many of their intervals hold what was reached, and how many are contradicted by their
own later readings (an error ahead beyond three deviations of noise and half-width together), which should be none.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from machines import draw

from thermofast import identify, read
from thermofast.records import IdentifyRecord

LAB = ROOT.parent / "shared" / "cases" / "lab"
TIMES = (30.0, 45.0, 60.0, 90.0, 120.0)
LEAVES = "leave the prediction's band"


def exact(machines: int) -> None:
    """Print how often exact machines are told that their later readings contradict what was said."""
    against = rows = 0
    for seed in range(machines):
        columns = draw((), np.random.default_rng([9, seed])).columns
        table = {name: values for name, values in columns.items() if name == "time_min" or name.startswith("T")}
        until = float(np.random.default_rng(seed).choice([0.2, 0.35, 0.5])) * float(columns["time_min"][-1])
        found = identify(read(table, name=f"exact{seed}"), until=until, jobs=1)
        rows += len(found)
        against += sum(LEAVES in r.message for r in found)
    print(f"exact machines: {against} of {rows} rows told that their later readings leave the band")


def contradicted(row: IdentifyRecord) -> bool:
    """Whether the error ahead is more than the row itself allows for."""
    if row.rmse_ahead_c is None or row.steady_state_hi_c is None or row.steady_state_lo_c is None or row.noise_c is None:
        return False
    half = 0.5 * (row.steady_state_hi_c - row.steady_state_lo_c)
    return row.rmse_ahead_c > 3.0 * math.hypot(row.noise_c, half)


def lab() -> None:
    """Print rows of the lab's machines by identification time."""
    key = json.loads((LAB / "key.json").read_text())
    print("| min | rows | ok | of these the interval holds the end, % | of these contradicted by their later readings |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for until in TIMES:
        rows = held = ok = wrong = 0
        for name, truth in key.items():
            if truth["kind"] == "exact":
                continue
            for row in identify(str(LAB / f"{name}.csv"), until=until, start=0.0, jobs=1):
                rows += 1
                if row.status != "ok" or row.steady_state_lo_c is None or row.steady_state_hi_c is None:
                    continue
                ok += 1
                held += row.steady_state_lo_c <= truth["end"][row.channel] <= row.steady_state_hi_c
                wrong += contradicted(row)
        print(f"| {until:g} | {rows} | {ok} | {100 * held / max(ok, 1):.0f} | {wrong} |")


def main(machines: int = 300) -> None:
    """Print both."""
    exact(machines)
    if not LAB.is_dir():
        print(f"skipped: no folder {LAB}")
        return
    lab()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
