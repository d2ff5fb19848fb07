"""A loss or a heat that changed on machines of parts that warm each other: is it named, and is it as large as is told?

python -m benchmarks.analysis.linked_events [--machines 24] [--seed 700] [--steadily] [--apart] draws machines of three to five
lumps in a row, integrated by scipy, each of them read, with nothing else in them: the loss of all, or the heat, becomes another
multiple of itself at some time of the record. Each is searched as `diagnose` does. Told are the shares in which the event is
named (with the links, or alone), in which the size that is told for it holds (95 %), its median half-width, and in which
something is named that is not there. Links that are left out draw half of such a change: the size told without them is then too
small, whatever its standard error. --steadily: by 20 to 40 % down or up, evenly through the record. --apart: parts that are
heated each and do not warm each other; the room is logged.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

import thermofast as tf

#: The effect that is hidden, and the parameter that says how large it is.
HIDDEN = {"loss": ("cooling_switch", "ratio", 0.0), "heat": ("load_step", "change", 1.0)}


def machine(kind: str, seed: int, steadily: bool = False, apart: bool = False) -> tuple[pd.DataFrame, float]:
    """A record of six hours and the multiple that the loss or the heat becomes."""
    rng = np.random.default_rng([seed, len(kind)])
    n, factor = int(rng.integers(3, 6)), float(rng.choice([0.5, 0.65, 0.75, 1.3, 1.6, 2.0, 2.5]))
    capacity, tau, at = rng.uniform(0.7, 1.5, n), rng.uniform(40.0, 90.0), rng.uniform(90.0, 240.0)
    loss, heat, room = rng.uniform(0.55, 1.1, n) * capacity / tau, np.zeros(n), 20.0 + 0.1 * rng.standard_normal()
    heat[:2] = np.array([1.0, rng.uniform(0.0, 0.6)]) * rng.uniform(8.0, 20.0) / tau
    links = np.diag(rng.uniform(0.2, 0.8, n - 1) / tau, 1)
    links += links.T
    if steadily:
        factor = float(1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.4))
    if apart:
        links, heat = np.zeros((n, n)), rng.uniform(8.0, 20.0, n) / tau

    def slope(t: float, temperature: np.ndarray) -> np.ndarray:
        now = 1.0 + (factor - 1.0) * t / 360.0 if steadily else factor if t >= at else 1.0
        lost = loss * (now if kind == "loss" else 1.0) * (temperature - room)
        given = heat * (now if kind == "heat" else 1.0)
        passed = (links * (temperature[:, None] - temperature[None, :])).sum(axis=1)
        return np.asarray((given - lost - passed) / capacity)

    time = np.arange(0.0, 360.5)
    law = solve_ivp(slope, (0.0, 360.0), np.full(n, room), t_eval=time, max_step=1.0, rtol=1e-8).y.T
    columns = {f"T{i + 1} [degC]": law[:, i] + 0.03 * rng.standard_normal(len(time)) for i in range(n)}
    logged = {"ambient [degC]": room + 0.03 * rng.standard_normal(len(time))} if apart else {}
    return pd.DataFrame({"time [min]": time, **columns, **logged}), factor


def judge(job: tuple[str, int, bool, bool]) -> tuple[str, str, bool, bool, float | None, float]:
    """(kind, verdict, named, something else named, error over its standard error, half-width) of a machine."""
    kind = job[0]
    record, factor = machine(*job)
    effect, size, less = HIDDEN[kind]
    rows = tf.diagnose(tf.read(record))
    named = {name for row in rows for name in row.verdict.split("+")} - {"none", "unexplained"}
    told = next((row.parameters[f"{effect}.{size}"] for row in rows if f"{effect}.{size}" in row.parameters), None)
    verdict = max((row.verdict for row in rows), key=len)
    if told is None or not told["standard_error"]:
        return kind, verdict, effect in named, bool(named - {effect, "neighbour_heat"}), None, np.nan
    error = (told["value"] - (factor - less)) / told["standard_error"]
    return kind, verdict, effect in named, bool(named - {effect, "neighbour_heat"}), error, 1.96 * told["standard_error"]


def main() -> None:
    """Print a row for each kind, and what was said where the event is not named or its size does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=700)
    parser.add_argument("--steadily", action="store_true")
    parser.add_argument("--apart", action="store_true")
    asked = parser.parse_args()
    jobs = [(kind, asked.seed + i, asked.steadily, asked.apart) for kind in HIDDEN for i in range(asked.machines)]
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judge, jobs))
    print("| changes | machines | named | another effect named | size told holds (95 %) | half-width, median |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for kind in HIDDEN:
        mine = [f for f in found if f[0] == kind]
        sized = [f for f in mine if f[4] is not None and f[2]]
        holds = sum(abs(f[4] or 0.0) <= 1.96 for f in sized)
        wide = np.median([f[5] for f in sized]) if sized else np.nan
        counts = f"{len(mine)} | {sum(f[2] for f in mine)} | {sum(f[3] for f in mine)}"
        print(f"| {kind} | {counts} | {holds} of {len(sized)} | {wide:.2g} |")
    for (kind, seed, *_), (_, verdict, named, other, error, _) in zip(jobs, found, strict=True):
        if not named or other or (error is not None and abs(error) > 1.96):
            print(f"{kind} {seed}: {verdict}, error {'-' if error is None else f'{error:.1f}'} standard errors")


if __name__ == "__main__":
    main()
