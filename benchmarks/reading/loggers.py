"""Real logger files of others against what a careful reader finds in them: ``python -m benchmarks.reading.loggers [FOLDER]``.

The folder holds the files and a truth.json. Told per file: right, right with the option that the refusal names, refused, or WRONG.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from thermofast.errors import ThermofastError
from thermofast.reading import Options, Run, read_runs

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "loggers"
#: What the message of a refusal says to give, as a user would give it.
GIVEN = {
    "influx_annotated_long.csv": Options(long=("column 8+column 10", "column 7")),
    "picolog_calibration.xlsx": Options(time_unit="s"),
    "tclab_apm_kelvin_headerless.csv": Options(units=("K",), time_unit="s", channels=("column 3",)),
}
#: The careful reader overlooked a column: this file has a cell temperature in degC, beside an empty one.
OVERLOOKED = {"pec_cycler.csv": ["Temp (°C)", "Station Temperature (°C)"]}


def judge(name: str, truth: dict[str, Any], folder: Path = FOLDER) -> tuple[str, str]:
    """(right, right with options, refused or WRONG; why) of one file."""
    for how, options in (("right", Options()), ("right with options", GIVEN.get(name))):
        if options is None:
            break
        try:
            runs = read_runs(str(folder / name), options)
        except ThermofastError as error:
            refusal = str(error).splitlines()[0].replace(str(folder) + "/", "")
            continue
        wrong = _wrong(name, runs, truth)
        return ("WRONG", wrong) if wrong else (how, "; ".join(g.text for g in runs[0].guesses))
    return "right" if not truth["temperatures_degC"] else "refused", refusal


def _wrong(name: str, runs: list[Run], truth: dict[str, Any]) -> str:
    if len(runs) != 1:
        return f"{len(runs)} runs"
    run = runs[0]
    found = {**run.channels, **run.ambient}
    wanted = truth["temperatures_degC"]
    if name in OVERLOOKED:
        return "" if sorted(found) == sorted(OVERLOOKED[name]) else f"found {sorted(found)}"
    matched = {w: [n for n in found if _alike(n, w)] for w in wanted}
    if any(len(m) != 1 for m in matched.values()):
        return f"columns {matched}"
    extra = set(found) - {m[0] for m in matched.values()}
    if extra:
        return f"told as temperatures: {sorted(extra)}"
    for w, expected in wanted.items():
        column = found[matched[w][0]]
        good = column[np.isfinite(column)]
        repeated = "repeated time stamp" in " ".join(run.notes)
        if len(good) != expected["n"] and not repeated:
            return f"{w}: {len(good)} readings for {expected['n']}"
        if abs(good[0] - expected["first"]) > 2e-3 or abs(good[-1] - expected["last"]) > 2e-3:
            return f"{w}: {good[0]}..{good[-1]} for {expected['first']}..{expected['last']}"
    last = truth.get("last_elapsed_s")
    if last is not None and abs(run.time_s[-1] - last) > 0.01 + 1e-6 * last:
        return f"ends at {run.time_s[-1]} s, not {last}"
    return ""


def _alike(name: str, wanted: str) -> bool:
    import re

    wanted = re.sub(r" \[\d+\]$", "", wanted)
    short = name.split(", ")[0].rstrip(".")
    return (
        name == wanted
        or short == wanted.split(", ")[0].rstrip(".")
        or name.replace("col ", "column ") == wanted.replace("col ", "column ")
        or name.endswith(f" {wanted}")
    )


def main() -> None:
    """Print a line per file and the sums."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    truths = json.loads((folder / "truth.json").read_text())
    counts: dict[str, int] = {}
    for name, entry in truths.items():
        verdict, why = judge(name, entry["truth"], folder)
        counts[verdict] = counts.get(verdict, 0) + 1
        print(f"{name:36} {verdict:20} {why[:110]}")
    print(
        ", ".join(f"{n} {v}" for v, n in counts.items())
        + f" of {len(truths)}; silently wrong: {counts.get('WRONG', 0)}, to reach: 0"
    )


if __name__ == "__main__":
    main()
