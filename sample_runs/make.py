"""Makes the sample runs of this folder: ``python sample_runs/make.py [FOLDER]``. Seeds are fixed; the truth stands in README.md."""

import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from thermofast.experiments.simulation import Probe, simulate
from thermofast.output.files import write_columns, write_json

ROOM = 17.9
#: Steady state [degC] and t95 [min] of ten probes on a vertical machine; T5 is the paper's sensor 5.
SPINDLE = (
    (25.4, 182.0), (25.9, 186.0), (26.3, 190.0), (26.1, 188.0), (26.7, 195.0),
    (24.2, 214.0), (23.1, 236.0), (28.4, 168.0), (24.6, 208.0), (21.8, 262.0),
)  # fmt: skip


def spindle(noise: float) -> list[Probe]:
    return [Probe(f"T{i + 1}", ROOM, steady, t95, noise) for i, (steady, t95) in enumerate(SPINDLE)]


def bad_cells(columns: dict[str, np.ndarray], rng: np.random.Generator) -> str:
    """A German logger's file: semicolons, decimal commas, a preamble, OL, an overload, gaps, outlier rows and spikes."""
    names = list(columns)
    keep = np.ones(len(columns["ambient"]), dtype=bool)
    keep[55:63] = False
    keep[rng.choice(np.arange(80, 240), 6, replace=False)] = False
    lines = ["Datenlogger ALM 2890;;;;;;", "Messung;Spindel 5000 1/min;;;;;", "Zeit [min];" + ";".join(names[1:]), ""]
    rows = []
    for i in np.flatnonzero(keep):
        cells = [f"{columns['time_min'][i]:g}"] + [f"{columns[n][i]:.2f}" for n in names[1:]]
        if i in (20, 21, 22):
            cells[1] = "OL"
        if i == 90:
            cells[2] = "9.9E+37"
        if i in (33, 140):
            cells[3] = f"{columns[names[3]][i] + 5:.2f}"
        if 100 <= i < 130:
            cells[4] = ""
        cells[5] = "NaN"
        rows.append([c.replace(".", ",") for c in cells])
    rows[30], rows[31] = rows[31], rows[30]
    rows.insert(60, rows[59])
    return "\r\n".join(lines[:3] + [";".join(r) for r in rows]) + "\r\n"


def main(folder: Path) -> None:
    run = simulate(spindle(0.02), 400.0, 60.0, ROOM, 0.01, seed=1)
    write_columns(str(folder / "spindle.csv"), run.columns)
    write_json(str(folder / "spindle.key.json"), run.truth)
    fast = simulate(spindle(0.02), 60.0, 1.0, ROOM, 0.01, seed=2)
    write_columns(str(folder / "spindle_1hz.parquet"), fast.columns)
    cooling = [Probe(p.channel, p.steady_state_c, ROOM, round(p.t95_min * 1.1, 1), 0.02) for p in spindle(0.02)]
    write_columns(str(folder / "cool_down.csv"), simulate(cooling, 400.0, 60.0, ROOM, 0.01, seed=3).columns)
    rough = simulate(spindle(0.02)[:5], 240.0, 60.0, ROOM, 0.01, seed=4)
    (folder / "gaps_and_bad_cells.csv").write_bytes(bad_cells(rough.columns, np.random.default_rng(5)).encode("cp1252"))


def hidden(folder: Path) -> None:
    """The tutorial's records, from the tests' simulator: another program than the one that is to find what is hidden."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
    from machines import draw, second_run

    for name, kind, seed, second in (("hidden", ("second_mode",), 38, True), ("hidden_two", ("ambient", "second_mode"), 6, False)):
        rng = np.random.default_rng(seed)
        case = draw(kind, rng, "clear")
        write_columns(str(folder / f"{name}.csv"), case.columns)
        write_json(str(folder / f"{name}.key.json"), plain({"effects": case.truth["effects"], "noise_c": case.noise}))
        if second:
            write_columns(str(folder / f"{name}_second_run.csv"), second_run(case, rng).columns)
    write_columns(str(folder / "hidden_ramp.csv"), ramped(np.random.default_rng(5)))
    write_columns(str(folder / "displacement.csv"), displaced(np.random.default_rng(41)))
    key = {"effects": {"load_ramp": {"change": 0.6, "begin_min": 110.0, "length_min": 130.0}}, "noise_c": 0.015}
    write_json(str(folder / "hidden_ramp.key.json"), key)


def ramped(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Three sensors of a machine whose load is ramped up from minute 110 to 240, which no effect of the catalogue is."""
    time = np.arange(0.0, 421.0)
    columns = {"time_min": time}
    for i, (rate, rise) in enumerate(((0.016, 6.0), (0.021, 9.0), (0.027, 4.5))):

        def slope(t: float, y: np.ndarray, rate: float = rate, rise: float = rise) -> np.ndarray:
            return rate * (rise * (1.0 + 0.6 * np.clip((t - 110.0) / 130.0, 0.0, 1.0)) - (y - 20.0))

        curve = solve_ivp(slope, (0.0, 420.0), [20.05], "LSODA", time, rtol=1e-9, atol=1e-9, max_step=2.0).y[0]
        columns[f"T{i + 1}"] = np.round(curve + 0.015 * rng.standard_normal(len(time)), 2)
    columns["ambient"] = np.round(20.0 + 0.01 * rng.standard_normal(len(time)), 2)
    return columns


def displaced(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Five temperatures of a drive that runs, rests and runs faster, and two displacements of the spindle nose.

    Z is the sum of what the parts expand by; Y jumps by 6 um where a bearing seat lets go, 5 K above the room.
    """
    time = np.arange(0.0, 601.0)
    load = np.where(time < 180, 1.0, np.where(time < 300, 0.2, np.where(time < 460, 1.4, 0.0)))
    above = []
    for rate, rise in ((0.030, 9.0), (0.018, 6.0), (0.012, 4.5), (0.008, 3.0), (0.020, 2.0)):
        curve = np.zeros(len(time))
        for k in range(1, len(time)):
            curve[k] = rise * load[k] + (curve[k - 1] - rise * load[k]) * np.exp(-rate)
        above.append(curve)
    z = 1.9 * above[0] + 2.6 * above[1] + 1.4 * above[2] - 0.8 * above[3]
    y = np.where(above[0] > 5.0, 6.0, 0.0) - 0.35 * above[1]
    columns = {"time_min": time}
    for i, curve in enumerate(above):
        columns[f"T{i + 1}"] = np.round(20.0 + curve + 0.02 * rng.standard_normal(len(time)), 2)
    columns["Z_um"] = np.round(z + 0.4 * rng.standard_normal(len(time)), 1)
    columns["Y_um"] = np.round(y + 0.3 * rng.standard_normal(len(time)), 1)
    return columns


def plain(value: object) -> object:
    """Numbers and lists for JSON; sensors are counted from 1, as in the record."""
    if isinstance(value, dict):
        told = {k: plain(v) for k, v in value.items()}
        return told | {k: [int(i) + 1 for i in np.ravel(value[k])] for k in ("sensors", "source") if k in value}
    if isinstance(value, np.ndarray):
        return [round(float(v), 6) for v in value.ravel()]
    return round(float(value), 6) if isinstance(value, float | np.floating) else value


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    main(target)
    hidden(target)
