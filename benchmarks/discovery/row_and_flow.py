"""Heat along a row, to a logged coolant, a delay that follows a logged flow: are they found, and is what is not there left out?

python -m benchmarks.discovery.row_and_flow [--each 40] [--seed 0] simulates rods of three to six bodies by scipy, linked each to
the next or in pairs only; plug flow through a pipe whose flow moves in steps, with the delay that follows of it or one delay all
the while; bodies that a coolant of a logged temperature cools, each in its own measure, or that it does not touch. Right is the
effect with its way of acting, every link as it is; or some of them, and none that is not there. Told beside it is the median error
of its coupling or delay.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.integrate import solve_ivp

import thermofast as tf

KINDS = ("row", "uneven row", "pairs", "flow", "one delay", "coolant", "idle coolant")
RODS = ("row", "uneven row", "pairs")


def rod(seed: int, kind: str = "row", noise: float = 0.01) -> tuple[tf.Run, float]:
    """(run, coupling of the first [1/min]) of bodies in a row, each linked to the next, uneven: by conductances and masses of up to
    a factor of two; pairs: only the first to the second and so on.
    """
    pairs = kind == "pairs"
    rng = np.random.default_rng(seed)
    count = 4 if pairs else int(rng.integers(3, 7))
    loss = rng.uniform(0.01, 0.03)
    coupling, losses = loss * rng.uniform(1.0, 6.0), loss * rng.uniform(0.8, 1.25, count)
    heat = loss * rng.uniform(2.0, 6.0, count)
    heat[0] += 3.0 * loss * rng.uniform(5.0, 12.0)
    matrix = np.diag(-losses)
    uneven = kind == "uneven row"
    conductance, mass = (rng.uniform(0.7, 1.4, count) if uneven else np.ones(count) for _ in range(2))
    for i in range(0, count - 1, 2 if pairs else 1):
        both = coupling * conductance[i] / mass[[i, i + 1]]
        matrix[[i, i + 1], [i, i + 1]] -= both
        matrix[[i, i + 1], [i + 1, i]] += both
    time = np.linspace(0.0, 4.0 / loss, 400)

    def law(t: float, y: np.ndarray) -> np.ndarray:
        return np.asarray(matrix @ y + heat)

    rise = solve_ivp(law, (0.0, time[-1]), np.zeros(count), t_eval=time, rtol=1e-9, atol=1e-9, method="LSODA").y
    reading = 21.0 + rise + noise * rng.standard_normal(rise.shape)
    room = 21.0 + 0.01 * rng.standard_normal(len(time))
    data = {"time_min": time, **{f"T{i + 1}": row for i, row in enumerate(reading)}, "room": room}
    return tf.read(data, ambient="room", name=f"rod {seed}"), float(matrix[0, 1])


def pipe(seed: int, follows: bool = True, noise: float = 0.02, run: int = 0) -> tuple[tf.Run, float]:
    """(run, delay of the first sensor at the largest flow [min]) along a pipe; the flow of each run has steps of its own."""
    machine, rng = np.random.default_rng(seed), np.random.default_rng([seed, run])
    tau = machine.uniform(30.0, 80.0)
    time, fine = np.linspace(0.0, 5.0 * tau, 400), np.linspace(0.0, 5.0 * tau, 40_001)
    steps = int(rng.integers(2, 5))
    at = np.sort(rng.uniform(0.05, 0.45, steps)) * time[-1]
    flow = 5.0 * rng.uniform(0.25, 1.0, steps + 1)[np.searchsorted(at, time)] + 0.02 * rng.standard_normal(400)
    between = np.interp(fine, time, flow)
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (between[1:] + between[:-1]) * np.diff(fine))])
    rows, volumes = {}, machine.uniform(0.05, 0.2, 3) * time[-1]
    for i, volume in enumerate(volumes):
        left = np.interp(np.interp(time, fine, passed) - volume, passed, fine) if follows else np.maximum(time - volume / 3.0, 0.0)
        rows[f"T{i + 1}"] = 20.0 - machine.uniform(5.0, 15.0) * np.expm1(-left / tau) + noise * rng.standard_normal(400)
    data = {"time_min": time, **rows, "flow_lpm": flow}
    return tf.read(data, inputs="flow_lpm", name=f"pipe {seed}"), float(volumes[0] / (flow.max() if follows else 3.0))


def cooled(seed: int, touches: bool = True, noise: float = 0.02, run: int = 0) -> tuple[tf.Run, float]:
    """(run, the first sensor's coupling [1/min]) of three bodies and a coolant whose chiller hunts and is set anew on the way."""
    machine, rng = np.random.default_rng(seed), np.random.default_rng([seed, run, 5])
    loss = machine.uniform(0.008, 0.025, 3)
    coupling = loss * machine.uniform(0.15, 0.8, 3) * touches
    heat = (loss + coupling) * machine.uniform(8.0, 20.0, 3) * rng.uniform(0.8, 1.2)
    time = np.linspace(0.0, 420.0, 421)
    period, size, later, anew = rng.uniform(30.0, 120.0), rng.uniform(0.5, 2.0), rng.uniform(100.0, 300.0), rng.uniform(-3.0, 3.0)

    def coolant(t: np.ndarray) -> np.ndarray:
        return np.asarray(18.0 + size * np.sin(2.0 * np.pi * t / period) + anew * (t > later))

    def law(t: float, y: np.ndarray) -> np.ndarray:
        return np.asarray(heat - loss * (y - 21.0) - coupling * (y - coolant(np.asarray(t))))

    found = solve_ivp(law, (0.0, 420.0), np.full(3, 20.5), t_eval=time, rtol=1e-8, atol=1e-8, max_step=1.0).y
    rows = {f"T{i + 1}": row + noise * rng.standard_normal(421) for i, row in enumerate(found)}
    columns = {"time_min": time, **rows, "room": 21.0 + 0.01 * rng.standard_normal(421), "coolant_degC": coolant(time)}
    return tf.read(columns, ambient="room", inputs="coolant_degC", name=f"cooled {seed}"), float(coupling[0])


def judge(job: tuple[str, int]) -> tuple[str, str, float]:
    """(kind, 'right', 'other way' or what was said, relative error of the number) of one record."""
    kind, seed = job
    if "coolant" in kind:
        run, true = cooled(seed, kind == "coolant")
        name, key = ("coolant_heat", "kappa")
    else:
        run, true = rod(seed, kind) if kind in RODS else pipe(seed, kind == "flow")
        name, key = ("neighbour_heat", "kappa") if kind in RODS else ("transport_delay", "delay")
    record = tf.diagnose(run)[0]
    if kind == "idle coolant" and record.verdict == "none":
        return kind, "right", 0.0
    if record.verdict != name:
        return kind, record.verdict, np.nan
    told, names = set(filter(None, record.ranking[0]["acts"].split(", "))), list(run.channels)
    row = {f"{c} by {' and '.join(names[j] for j in (i - 1, i + 1) if 0 <= j < len(names))}" for i, c in enumerate(names)}
    pairs = {f"{c} by {names[i ^ 1]}" for i, c in enumerate(names)} if kind == "pairs" else set()
    true_ways = {"row": row, "uneven row": row, "pairs": pairs, "flow": {"flow_lpm"}, "one delay": set()}.get(
        kind, {"coolant_degC"}
    )
    said = "right" if told == true_ways else "not all" if kind in RODS and told < true_ways else "other way"
    return kind, said, abs(record.parameters[f"{name}.{key}"]["value"] / true - 1.0)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    print("| hidden | records | right | not all the links | a wrong one | said else | median error of the number |")
    print("| --- | ---: | ---: | ---: | ---: | --- | ---: |")
    with ProcessPoolExecutor() as pool:
        for kind in KINDS:
            found = list(pool.map(judge, [(kind, asked.seed + i) for i in range(asked.each)], chunksize=2))
            said = [w for _, w, _ in found]
            other = ", ".join(sorted({w for w in said if w not in ("right", "not all", "other way")}))
            error = 100.0 * float(np.nanmedian([e for *_, e in found]))
            print(
                f"| {kind} | {len(found)} | {said.count('right')} | {said.count('not all')} | {said.count('other way')} "
                f"| {other} | {error:.2g} % |",
                flush=True,
            )


if __name__ == "__main__":
    main()
