"""Four linked bodies used as on a shop floor: does ``identify`` hold what it says when the heat is not simply switched on?

python -m benchmarks.machines.shop_floor [--each 6] [--seed 60000] prints, by what the machine does and by how many time constants
were read: how many rows that are ``ok`` hold the limit, and how many of all, without ``--auto`` and with it. The limit is that
with room and load as they are at the last reading used, by Newton's method; a reading outside by less than 0.02 K counts as held.

--watch prints instead how many such tests ``watch`` stops within 390 min at tolerances of 0.5 and 1 K, how many of them at a value
that is wrong by more, and after how many time constants (median).
"""

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import thermofast as tf
from thermofast.analysis.watching import Watch, first_readings
from thermofast.pipeline.watching import events_before
from thermofast.records import IdentifyRecord

Array = NDArray[np.float64]

BODIES, STEP, END = 4, 0.25, 400.0  # -, min, min
READ = (0.6, 1.2, 2.0)  # time constants
#: Rise [K] at which the losses hold, and by how much their exponent is above 1.
REFERENCE, BEND = 10.0, 0.04
NEAR = 0.02  # K


@dataclass(frozen=True)
class Floor:
    """The machine: capacity and loss (4,), link (4, 4) [1/min], heat (4,) [K/min]; tau [min]."""

    capacity: Array
    loss: Array
    link: Array
    heat: Array
    tau: float

    def warming(self, state: Array, room: float, load: float, fan: float) -> Array:
        """dT/dt (4,) [K/min] of a state (4,) [degC]."""
        rise = state - room
        lost = self.loss * fan * rise * (np.abs(rise) / REFERENCE + 1e-9) ** BEND
        found: Array = (self.heat * load - lost + self.link @ state) / self.capacity
        return found

    def limit(self, room: float, load: float, fan: float) -> Array:
        """Where all come to rest (4,) [degC]."""
        state = room + np.full(BODIES, REFERENCE)
        for _ in range(50):
            steep = self.loss * fan * (np.abs(state - room) / REFERENCE + 1e-9) ** BEND
            state = state + np.linalg.solve(
                np.diag(steep * (1.0 + BEND)) - self.link, self.capacity * self.warming(state, room, load, fan)
            )
        return state


@dataclass(frozen=True)
class Use:
    """What is done with it over time: load, the load that lasts and fan (n,), its start (4,) [degC]; reading begins `idle` [min]
    before the heat.
    """

    load: Array
    lasting: Array
    fan: Array
    start: Array
    idle: float = 0.0


def drawn(rng: np.random.Generator) -> Floor:
    """A machine whose bodies are neither alike nor all alone."""
    tau = rng.uniform(40.0, 100.0)
    link = np.zeros((BODIES, BODIES))
    for i in range(BODIES - 1):
        link[i, i + 1] = link[i + 1, i] = rng.uniform(0.1, 0.5) / tau
    heat = np.exp(rng.uniform(-1.0, 0.2, BODIES))
    heat *= rng.uniform(8.0, 25.0) / tau / heat.max()
    capacity, loss = np.exp(rng.uniform(-0.3, 0.3, BODIES)), np.exp(rng.uniform(-0.3, 0.3, BODIES)) / tau
    return Floor(capacity, loss, link - np.diag(link.sum(axis=1)), heat, tau)


#: Kinds of use, as the table has them.
KINDS = (
    "switched on",
    "idle at first",
    "restarted warm",
    "on and off",
    "speed in four stages",
    "a pause",
    "switched off",
    "a door open for a while",
    "running-in friction",
    "cooling down",
)


def used(kind: str, floor: Floor, room: float, time: Array, rng: np.random.Generator) -> Use:
    """One use of a machine of the kinds of KINDS."""
    one = np.ones(len(time))
    load, lasting, fan, start, idle = one, one, one, np.full(BODIES, room), 0.0
    if kind == "idle at first":
        idle = rng.uniform(8.0, 25.0)
        load = lasting = (time >= idle) * one
    elif kind == "restarted warm":
        start = room + (floor.limit(room, 1.0, 1.0) - room) * rng.uniform(0.2, 0.7) * rng.uniform(0.7, 1.3, BODIES)
    elif kind == "on and off":
        load = ((time / rng.uniform(1.0, 6.0)) % 1.0 < rng.uniform(0.4, 0.8)) * one
        load, lasting = load / load.mean(), one
    elif kind == "speed in four stages":
        load = lasting = np.clip(np.floor(time / rng.uniform(8.0, 25.0)) + 1.0, 1.0, 4.0) / 4.0
    elif kind == "a pause":
        began = rng.uniform(30.0, 60.0)
        load = lasting = ~((time > began) & (time < began + rng.uniform(4.0, 10.0))) * one
    elif kind == "switched off":
        load = lasting = (time < rng.uniform(60.0, 110.0)) * one
    elif kind == "a door open for a while":
        began = rng.uniform(30.0, 80.0)
        fan = 1.0 + 0.4 * ((time > began) & (time < began + rng.uniform(5.0, 15.0)))
    elif kind == "running-in friction":
        load = 1.0 + rng.uniform(0.1, 0.5) * np.exp(-time / rng.uniform(20.0, 80.0))
    elif kind == "cooling down":
        start, load, lasting = floor.limit(room, 1.0, 1.0), 0.0 * one, 0.0 * one
    return Use(load, lasting, fan, start, idle)


@dataclass(frozen=True)
class Test:
    """One record: time (n,) [min], reading (n, 4) and true room (n,) [degC], the room as logged or None, every so many are kept."""

    floor: Floor
    use: Use
    time: Array
    reading: Array
    room: Array
    logged: Array | None
    every: int

    def columns(self, until: float) -> dict[str, Array]:
        """The table that a lab has after `until` minutes."""
        some = slice(0, int(np.searchsorted(self.time, until, "right")), self.every)
        table = {"time_min": self.time[some]} | {f"T{i}": row[some] for i, row in enumerate(self.reading.T)}
        return table if self.logged is None else table | {"ambient": self.logged[some]}

    def limit(self, until: float) -> Array:
        """Where all come to rest (4,) [degC] with room and load as at the last of these readings."""
        at = range(0, int(np.searchsorted(self.time, until, "right")), self.every)[-1]
        return self.floor.limit(float(self.room[at]), float(self.use.lasting[at]), float(self.use.fan[at]))


def tested(kind: str, seed: int) -> Test:
    """A machine and what it was used for."""
    rng = np.random.default_rng(seed)
    floor, time = drawn(rng), np.arange(0.0, END, STEP)
    count = len(time)
    room = 20.0 + rng.uniform(0.03, 0.15) * np.cumsum(rng.standard_normal(count)) * np.sqrt(STEP / 60.0)
    use = used(kind, floor, float(room[0]), time, rng)
    flutter = 1.0 + 0.004 * np.convolve(rng.standard_normal(count), np.exp(-np.arange(400) * STEP / 20.0), "same") / 6.0
    states, state, probe = np.empty((count, BODIES)), use.start.copy(), use.start.copy()
    keeps = np.exp(-STEP / rng.uniform(0.3, 0.8))
    for k in range(count):
        probe = keeps * probe + (1.0 - keeps) * state
        states[k] = probe
        state = state + STEP * floor.warming(state, room[k], use.load[k] * flutter[k], use.fan[k])
    noise, coarse = rng.uniform(0.01, 0.04), seed % 3 == 0
    reading = states + noise * rng.standard_normal(states.shape)
    reading = np.round(reading, 1) if coarse else reading
    logged = np.round(room + 0.02 * rng.standard_normal(count), 2) if seed % 2 else None
    return Test(floor, use, time, reading, room, logged, int(rng.choice([1, 2, 4])))


#: (kind, time constants read, with --auto, status, held).
Row = tuple[str, float, bool, str, bool]


def rows_of(job: tuple[str, int]) -> list[Row]:
    """All sensors of one machine at all times, with ``--auto`` and without."""
    kind, seed = job
    test, found = tested(kind, seed), []
    for read in READ:
        until = test.use.idle + read * test.floor.tau
        limit, run = test.limit(until), tf.read(test.columns(until), name="run")
        for auto in (False, True):
            for i, row in enumerate(tf.identify(run, auto=auto)):
                low = -np.inf if row.steady_state_lo_c is None else row.steady_state_lo_c
                high = np.inf if row.steady_state_hi_c is None else row.steady_state_hi_c
                found.append((kind, read, auto, row.status, bool(low - NEAR <= limit[i] <= high + NEAR)))
    return found


TOLERANCES, FIRST, LAST, GROWTH = (0.5, 1.0), 15.0, 390.0, 1.04


def stops_of(job: tuple[str, int]) -> tuple[str, list[tuple[float, float] | None]]:
    """By tolerance: error [K] of the worst sensor and time constants read when a watch says that the test may be stopped."""
    kind, seed = job
    test = tested(kind, seed)
    run, kept = tf.read(test.columns(END), name="run"), {}

    def identify(seen: tf.Run, start: float | None) -> tuple[IdentifyRecord, ...]:
        at = (len(seen.time_s), float(seen.time_s[-1]))
        if at not in kept:
            kept[at] = tf.identify(seen, start="auto" if start is None else start, details=False).records
        return kept[at]

    stops: list[tuple[float, float] | None] = [None] * len(TOLERANCES)
    watches = [Watch(identify, t, happened=lambda seen, at: events_before((seen, 0.0), at)) for t in TOLERANCES]
    minutes = FIRST
    while minutes < LAST:
        count = int(np.searchsorted(run.time_s / 60.0, minutes, "right"))
        for k, watch in enumerate(watches):
            look = watch.look(first_readings(run, count)) if stops[k] is None else None
            if look is not None and look.stop:
                said = np.array([np.nan if r.steady_state_c is None else r.steady_state_c for r in look.records[:BODIES]])
                stops[k] = float(np.abs(said - test.limit(minutes)).max()), (minutes - test.use.idle) / test.floor.tau
        minutes *= GROWTH
    return kind, stops


def watched(each: int, seed: int) -> None:
    """Print the table of --watch."""
    jobs = [(kind, seed + 1000 * k + i) for k, kind in enumerate(KINDS) for i in range(each)]
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(stops_of, jobs))
    print(f"| |{''.join(f' {t:g} K: stopped | wrong | time constants |' for t in TOLERANCES)}\n| --- |{' ---: |' * 6}")
    for kind in KINDS:
        cells = []
        for k, tolerance in enumerate(TOLERANCES):
            stops = [s[k] for name, s in found if name == kind]
            some = [s for s in stops if s is not None]
            late = f"{np.median([at for _, at in some]):.1f}" if some else "-"
            cells += [f"{len(some)} of {len(stops)}", str(sum(error > tolerance for error, _ in some)), late]
        print(f"| {kind} | {' | '.join(cells)} |")


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=6)
    parser.add_argument("--seed", type=int, default=60_000)
    parser.add_argument("--watch", action="store_true")
    given = parser.parse_args()
    if given.watch:
        watched(given.each, given.seed)
        return
    jobs = [(kind, given.seed + 1000 * k + i) for k, kind in enumerate(KINDS) for i in range(given.each)]
    by: dict[tuple[str, float, bool], list[tuple[bool, bool]]] = defaultdict(list)
    with ProcessPoolExecutor() as pool:
        for rows in pool.map(rows_of, jobs):
            for kind, read, auto, status, held in rows:
                for name in (kind, "all"):
                    by[name, read, auto].append((status == "ok", held))
    heads = [f"{way}{read:g}" for way in ("", "--auto, ") for read in READ]
    print(f"| time constants read | {' | '.join(heads)} |\n| --- |{' ---: |' * len(heads)}")
    for kind in (*KINDS, "all"):
        cells = []
        for auto in (False, True):
            for read in READ:
                rows = by[kind, read, auto]
                sound = [held for ok, held in rows if ok]
                cells.append(f"{sum(sound)} of {len(sound)} ok, {sum(h for _, h in rows)} of {len(rows)}")
        print(f"| {kind} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
