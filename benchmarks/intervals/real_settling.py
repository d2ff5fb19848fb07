"""Do the intervals hold what came, on measured records that nobody here made? ``python -m benchmarks.intervals.real_settling``.

The lamp plate cut at its steps, the laptop's graphics chip, pots and boiling tests below boiling: each read for its first quarter,
third and half, and asked for its temperature twice as late and at its end (`identify --from --to --until --at`).
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

import thermofast as tf

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data"
SHARES = (0.25, 1 / 3, 0.5)
#: Water that boils is another process; a sensor is asked for no later than this [degC].
BELOW = 90.0
#: Readings whose mean is what came.
LAST = 5


@dataclass(frozen=True)
class Case:
    """A stretch of a sensor, read for a share of it and asked for its end."""

    family: str
    name: str
    share: float
    late: bool
    held: bool | None
    half_width: float
    rise_left: float
    error: float
    status: str


def stretches() -> Iterator[tuple[str, str, "tf.Run", float]]:
    """(family, name, run, length [min]) of everything that is tried."""
    path = FOLDER / "daisy_heating" / "lamp_steps.csv"
    whole = tf.read(path)
    minutes, level = whole.time_s / 60.0, whole.inputs["lamp_voltage"]
    steps = [0, *(np.flatnonzero(np.diff(level) != 0.0) + 1).tolist(), len(level) - 1]
    for first, last in pairwise(steps):
        begin, end = float(minutes[first]), float(minutes[last]) - 1e-6
        if end - begin > 2.0:
            yield "lamp", f"{path.name} {begin:.4g}..{end:.4g}", tf.read(path, from_min=begin, to_min=end), end - begin
    for path in sorted((FOLDER / "laptop").glob("*.csv")):
        run = tf.read(path, channels=["GPU_Temp"])
        yield "laptop", path.name, run, float(run.time_s[-1]) / 60.0
    for path in sorted((FOLDER / "cooking_pot").glob("*cm_*.csv")):
        run = tf.read(path)
        yield "pots", path.name, run, _below(run, BELOW)
    boil = tf.read(FOLDER / "cooking_pot" / "boil_tests.csv")
    for channel in boil.channels:
        run = tf.read(FOLDER / "cooking_pot" / "boil_tests.csv", channels=[channel])
        yield "boil", channel, run, _below(run, BELOW)


def _below(run: "tf.Run", limit: float) -> float:
    """Minutes until the first of the water's sensors is that hot; the pot's own base is hotter from the start."""
    minutes = run.time_s / 60.0
    ends = []
    for name, values in run.channels.items():
        known = np.isfinite(values)
        hot = np.flatnonzero(known & (values > limit))
        if name != "T10":
            ends.append(float(minutes[hot[0]]) if len(hot) else float(minutes[known][-1]))
    return min(ends)


def cases() -> list[Case]:
    """Every stretch, share and sensor."""
    found = []
    for family, name, run, length in stretches():
        for share in SHARES:
            began = float(tf.identify(run, until=share * length, imperfection="none", rates="own").records[0].start_min or 0.0)
            minutes = run.time_s / 60.0
            asked = [(False, min(2.0 * share * length, length)), (True, length)]
            rows = [(late, at, r) for late, at in asked for r in tf.identify(run, until=share * length, at=at - began).records]
            for late, at, r in rows:
                values = run.channels[r.channel]
                near = np.flatnonzero((minutes <= at) & np.isfinite(values))[-LAST:]
                came = float(values[near].mean())
                used = np.flatnonzero((minutes <= share * length) & np.isfinite(values))
                left = came - float(values[used[-LAST:]].mean())
                sides = r.at_lo_c, r.at_c, r.at_hi_c
                if any(v is None for v in sides):
                    found.append(Case(family, f"{name} {r.channel}", share, late, None, np.nan, left, np.nan, r.status))
                    continue
                low, middle, high = (float(v) for v in sides if v is not None)
                half = 0.5 * (high - low)
                # A logger of whole degrees says no more than to half of one.
                held = low - 0.05 <= came <= high + 0.05
                found.append(Case(family, f"{name} {r.channel}", share, late, held, half, left, middle - came, r.status))
    return found


def main() -> None:
    """Prints the table of docs/real-records.md."""
    if not FOLDER.is_dir():
        print(f"skipped: no folder {FOLDER}")
        return
    found = cases()
    families: dict[str, list[Case]] = defaultdict(list)
    for case in found:
        families[case.family].append(case)
    print(
        "| record | intervals | twice as late: hold | half-width / rise left | at the end: hold | half-width / rise left | RMS K |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for family, some in [*families.items(), ("all", found)]:
        cells = [family, str(len(some))]
        for late in (False, True):
            told = [c for c in some if c.held is not None and c.late is late]
            ratio = [c.half_width / abs(c.rise_left) for c in told if abs(c.rise_left) > 0.2]
            cells += [f"{np.mean([bool(c.held) for c in told]):.2f}", f"{np.median(ratio):.2f}"]
        cells.append(f"{np.sqrt(np.mean([c.error**2 for c in some if c.late and c.held is not None])):.2f}")
        print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
