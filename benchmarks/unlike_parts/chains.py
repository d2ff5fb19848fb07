"""Bodies in a row that warm each other: what is told of their temperature at switch-off, and of a machine that was changed.

python -m benchmarks.unlike_parts.chains [--each 30] [--seed 610000] prints, for chains of three to six bodies (losses, links and
capacities drawn, one heated or two, a logged room that wanders, a load that flutters, losses that differ by 1 % from run to run;
each step by the exponential of their matrix): how many 95 % intervals of the temperature at switch-off hold it, from first readings
30 to 120 s late; how often a loss of all parts is named and its size held; and how often a test that was logged late, or whose load
was halved within, is said to be a change that is none, as `ok`; how often one new run after three old ones names a heat, a capacity
or a loss of all parts, or a probe that is off; and how often two sensors that were exchanged are named, after one old run and after
three.
"""

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import expm

import thermofast as tf
from thermofast.models.standards import temperature_at_switch_off
from thermofast.records import IdentifyRecord

#: Steps of the simulation [min], and the length of a run.
STEP, LONG = 0.25, 360.0


def holds(row: IdentifyRecord, limit: float, settled: float) -> tuple[bool, bool]:
    """Whether a row's intervals hold the true limit [degC] and the true time of 95 % [min]; an open side holds all."""
    sides = row.steady_state_lo_c, row.steady_state_hi_c, row.t95_lo_min, row.t95_hi_min
    low, high, soon, late = (v if v is not None else side for v, side in zip(sides, (-np.inf, np.inf) * 2, strict=True))
    return low <= limit <= high, soon <= settled <= late


@dataclass(frozen=True)
class Chain:
    """Capacities [kJ/K], links (n - 1,) and losses (n,) [W/K], shares of the heat (n,), the heat [W] and noises (n,) [K]."""

    capacity: np.ndarray
    link: np.ndarray
    loss: np.ndarray
    share: np.ndarray
    heat: float
    noise: np.ndarray

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Chain":
        """One of three to six bodies, the first heated, every other time another one, too; it warms by 8 to 22 K on the mean."""
        n = int(rng.integers(3, 7))
        loss, share = rng.uniform(1.0, 6.0, n), np.eye(n)[0]
        if rng.random() < 0.5:
            share[rng.integers(1, n)] = rng.uniform(0.2, 0.6)
        heat = rng.uniform(8.0, 22.0) * loss.sum() / share.sum()
        return cls(rng.uniform(8.0, 40.0, n), rng.uniform(3.0, 15.0, n - 1), loss, share, heat, rng.uniform(0.02, 0.05, n))

    @property
    def matrix(self) -> np.ndarray:
        """How temperatures above the room change by them (n, n) [1/min]."""
        links = np.diag(self.link, 1) + np.diag(self.link, -1)
        return (links - np.diag(links.sum(axis=1) + self.loss)) * 0.06 / self.capacity[:, None]

    @property
    def rises(self) -> np.ndarray:
        """How far above the room the heat brings each (n,) [K]."""
        return np.linalg.solve(-self.matrix, self.share * self.heat * 0.06 / self.capacity)

    def run(self, rng: np.random.Generator, load: Callable[[float], float], minutes: float) -> tuple[np.ndarray, ...]:
        """(times (T,) [min], temperatures (n, T), the room (T,)), begun as warm as the room, under loads of the heat."""
        wander, flutter = rng.uniform(0.05, 0.3), rng.uniform(0.005, 0.01)
        machine = replace(self, loss=self.loss * np.exp(0.01 * rng.standard_normal()))
        time = np.arange(0.0, minutes + STEP / 2, STEP)
        room = 21.0 + rng.normal(0.0, 1.0) + wander * path(rng, len(time), 80.0)
        part = flutter * path(rng, len(time), 12.0)
        return time, warmed([(0.0, machine)], time, room, np.array([load(t) for t in time]) * (1.0 + part)), room

    def logged(self, rng: np.random.Generator, name: str, load: Callable[[float], float] = lambda _: 1.0, late: int = 0) -> tf.Run:
        """A run as a logger has it, every minute from `late` [min] on."""
        time, clean, room = self.run(rng, load, LONG)
        every = slice(int(late / STEP), None, int(1.0 / STEP))
        seen = clean[:, every] + self.noise[:, None] * rng.standard_normal(clean[:, every].shape)
        columns = {f"T{i} [degC]": row for i, row in enumerate(seen)}
        return tf.read({"time_min": time[every] - late, **columns, "ambient [degC]": room[every]}, name=name)


def warmed(machines: list[tuple[float, Chain]], time: np.ndarray, room: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Temperatures (n, T) of machines that each take the place of the one before from a time [min] on, begun as warm as the room.

    time (T,) in STEPs; room (T,) [degC]; load (T,), the heat's share.
    """
    steps = []
    for _, one in machines:
        step = expm(one.matrix * STEP)
        held = (
            np.linalg.solve(one.matrix, step - np.eye(len(one.loss))) * 0.06 / one.capacity
        )  # of powers [W] that stay over a step
        steps.append((one, step, held))
    begins = np.array([begin for begin, _ in machines])
    found = np.empty((len(machines[0][1].loss), len(time)))
    found[:, 0] = room[0]
    for k in range(len(time) - 1):
        one, step, held = steps[int((begins <= time[k]).sum()) - 1]
        found[:, k + 1] = step @ found[:, k] + held @ (one.share * one.heat * load[k] + one.loss * room[k])
    return found


def path(rng: np.random.Generator, count: int, memory_min: float) -> np.ndarray:
    """A course (count,) of deviation 1 that forgets within so many minutes."""
    keeps = np.exp(-STEP / memory_min)
    found = np.empty(count)
    found[0] = rng.standard_normal()
    for k in range(count - 1):
        found[k + 1] = keeps * found[k] + np.sqrt(1.0 - keeps**2) * rng.standard_normal()
    return found


def switched_off(seed: int) -> list[tuple[bool, bool, float]]:
    """Of each part read 30, 60 and 120 s late for an hour: whether it is heated, whether the interval holds, its half-width [K]."""
    rng = np.random.default_rng([seed, 1])
    chain = Chain.drawn(rng)
    time, clean, _ = chain.run(rng, lambda t: float(t < 300.0), LONG + 5.0)
    off, told = int(300.0 / STEP), []
    for late in (2, 4, 8):
        rows = slice(off + late, off + late + int(60.0 / STEP), 2)
        for i, row in enumerate(clean[:, rows] + chain.noise[:, None] * rng.standard_normal(clean[:, rows].shape)):
            found = temperature_at_switch_off(time[rows], row, 300.0)
            if found is not None:
                told.append((chain.share[i] > 0.0, found.low < clean[i, off] < found.high, 0.5 * (found.high - found.low)))
    return told


def lossier(factor: float, seed: int) -> tuple[str, bool]:
    """What three runs after three others are said to be where all losses are `factor` times as large, and whether that is held."""
    rng = np.random.default_rng([seed, 2])
    chain = Chain.drawn(rng)
    other = replace(chain, loss=factor * chain.loss)
    told = tf.changed([chain.logged(rng, f"old {k}") for k in range(3)], [other.logged(rng, f"new {k}") for k in range(3)])
    first = told[0]
    return (told.verdict if first.status == "ok" else "open"), first.change == "loss" and first.size_lo < factor < first.size_hi


def unchanged(late: int, halved: bool, seed: int) -> str:
    """What a run after three others is said to be, as `ok`, where nothing changed but when it is logged, or its load within."""
    rng = np.random.default_rng([seed, 3])
    chain = Chain.drawn(rng)
    old = [chain.logged(rng, f"old {k}") for k in range(3)]
    told = tf.changed(old, chain.logged(rng, "new", (lambda t: 1.0 if t < 150.0 else 0.5) if halved else lambda _: 1.0, late))
    return told.verdict if told[0].status == "ok" else "open"


def one_more(kind: str, factor: float, scatter: float, seed: int) -> tuple[str, bool]:
    """What one run after three others is said to be where a quantity of all parts is `factor` times as large, and whether that is
    held; losses and the heat differ from run to run by a share.
    """
    rng = np.random.default_rng([seed, 7])
    chain = Chain.drawn(rng)
    before = {"heat": chain.heat, "loss": chain.loss, "heat capacity": chain.capacity}

    def run(name: str, more: float) -> tf.Run:
        now = {k: v * (more if k == kind else 1.0) for k, v in before.items()}
        differs = np.exp(scatter * rng.standard_normal(2))
        machine = replace(chain, heat=now["heat"] * differs[0], loss=now["loss"] * differs[1], capacity=now["heat capacity"])
        return machine.logged(rng, name)

    told = tf.changed([run(f"old {k}", 1.0) for k in range(3)], run("new", factor))
    first = told[0]
    held = first.change == kind and first.size_lo is not None and first.size_lo < factor < first.size_hi
    return (told.verdict if first.status == "ok" else "open"), held


def probe_off(kelvin: float, seed: int) -> str:
    """What a run after three others is said to be in which one probe, drawn, tells so much more or less from beginning to end."""
    rng = np.random.default_rng([seed, 8])
    chain = Chain.drawn(rng)
    old = [chain.logged(rng, f"old {k}") for k in range(3)]
    new, name = chain.logged(rng, "new"), f"T{rng.integers(len(chain.loss))} [degC]"
    size = kelvin * float(rng.choice([-1.0, 1.0]))
    columns = {c: values + (size if c == name else 0.0) for c, values in new.channels.items()}
    told = tf.changed(old, tf.read({"time_min": new.time_s / 60.0, **columns, **new.ambient}, name="new"))
    first = told[0]
    if first.status != "ok":
        return "open"
    if told.verdict != "sensor":
        return told.verdict
    if first.channel != name:
        return "another sensor"
    if first.difference_lo_k is None:
        return "a factor"
    return "right" if first.difference_lo_k < size < first.difference_hi_k else "size wrong"


def exchanged(old: int, seed: int) -> str:
    """What a run after others is said to be in which two sensors, drawn, were exchanged."""
    rng = np.random.default_rng([seed, 5])
    chain = Chain.drawn(rng)
    i, j = rng.choice(len(chain.loss), 2, replace=False).tolist()
    before = [chain.logged(rng, f"old {k}") for k in range(old)]
    crossed = {f"T{i} [degC]": f"T{j} [degC]", f"T{j} [degC]": f"T{i} [degC]"}
    new = chain.logged(rng, "new")
    columns = {crossed.get(name, name): values for name, values in new.channels.items()}
    told = tf.changed(before, tf.read({"time_min": new.time_s / 60.0, **columns, **new.ambient}, name="new"))
    if told[0].status != "ok":
        return "open"
    if told.verdict != "exchanged":
        return told.verdict
    return "right" if {f"T{i} [degC]", f"T{j} [degC]"} == set(told[0].channel.split(" and ")) else "wrong pair"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=30)
    parser.add_argument("--seed", type=int, default=610_000)
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.each)
    with ProcessPoolExecutor() as pool:
        off = [row for rows in pool.map(switched_off, seeds) for row in rows]
        for heated, name in ((True, "heated"), (False, "warmed by others")):
            held, wide = np.array([row[1:] for row in off if row[0] == heated]).T
            print(f"switch-off, parts {name}: {held.sum():.0f} of {len(held)} hold, half-width {np.median(wide):.3f} K", flush=True)
        for factor in (1.3, 1.6):
            said = list(pool.map(partial(lossier, factor), seeds))
            named = [held for verdict, held in said if verdict == "loss"]
            wrong = sum(verdict not in ("loss", "open") for verdict, _ in said)
            print(f"loss x{factor}: {len(named)} of {len(said)} named, {sum(named)} hold; another kind {wrong}", flush=True)
        for scatter in (0.0, 0.06):
            for kind, factor in (("nothing", 1.0), *((k, f) for k in ("heat", "heat capacity", "loss") for f in (1.15, 1.3))):
                said = list(pool.map(partial(one_more, kind, factor, scatter), seeds))
                named = [held for verdict, held in said if verdict == kind]
                wrong = sum(verdict not in (kind, "open", "nothing", "room") for verdict, _ in said)
                size = "" if kind == "nothing" else f" x{factor}: intervals of {sum(named)} hold;"
                print(
                    f"one new run, scatter {scatter:.0%}, {kind}: {len(named)} of {len(said)} named,{size} another kind {wrong}",
                    flush=True,
                )
        for late, halved, name in ((5, False, "late"), (10, False, "late"), (20, False, "late"), (0, True, "load halved")):
            said = list(pool.map(partial(unchanged, late, halved), seeds))
            wrong = sum(verdict not in ("nothing", "room", "open") for verdict in said)
            print(f"{name}{f' by {late} min' if late else ''}: a change that is none, ok, in {wrong} of {len(said)}", flush=True)
        for kelvin in (2.0, 4.0):
            said = list(pool.map(partial(probe_off, kelvin), seeds))
            kinds = {kind: said.count(kind) for kind in sorted(set(said))}
            print(f"a probe off by {kelvin:.0f} K: {', '.join(f'{k} {c}' for k, c in kinds.items())} of {len(said)}", flush=True)
        for old in (1, 3):
            said = list(pool.map(partial(exchanged, old), seeds))
            kinds = {kind: said.count(kind) for kind in sorted(set(said))}
            print(f"two sensors exchanged, {old} old: {', '.join(f'{k} {c}' for k, c in kinds.items())} of {len(said)}", flush=True)


if __name__ == "__main__":
    main()
