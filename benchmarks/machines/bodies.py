"""Bodies of many kinds, far from one exponential: does ``identify`` hold what it says of the first part of their records?

python -m benchmarks.machines.bodies [--each 10] [--seed 70000] [--kinds rod,motor,...] [--read 0.3,0.5,1,2] prints, by how much
was read (in median times to 63 % of the sensors' rises): the share of rows that are ``ok``, how many of these and of all hold
the limit with room and load as they are, the median half-width over the rise, the mean interval score (Winkler, 95 %) over the
rise; and the same of the settling time, of `ok` rows and of all. Networks of heat capacities [J/K] and conductances [W/K] by
scipy's LSODA. The size of strong effects and how far slow ones lean were chosen on such machines by another hand. --calibrated
12: after `calibrate` on twelve complete runs of other machines of each kind. --past 3: with a model of three complete runs of
the same machine, each with a load (5 %, 1 sd), a room (1.5 K) and readings of its own; --auto: with the effects that `improve
--together --auto` finds in them; --lasting 2.5: such runs are so long. --late 0.7: a record begins when its machine has been
running for so many times to 63 %.

rod, foot, far: a bar of 40 nodes heated at one end, with a heavy foot at the other, or looked at along its whole length. spindle:
two bearings, shaft, housings, headstock and column; viscous: its friction falls as it warms; preload: it grows with what the shaft
is warmer than the housing; warm: it was run and rested before; swing: in a room that nobody logs and that goes up and down. oven:
radiation and convection. coolant: a reservoir that warms slowly. motor: winding, core, housing, flange and bench. bed: a housing
with its bearings on a cast bed that has a sensor too.
"""

import argparse
import os
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

import thermofast as tf
from thermofast.models.imperfection import Imperfection

Array = NDArray[np.float64]

READ = (0.3, 0.5, 1.0, 2.0)
#: Minutes that are worked out of each, and the grid that probes follow.
LONGEST, GRID = 1500.0, 0.25
#: Times to 63 % that a complete run lasts, and where the seeds of such runs begin.
COMPLETE, CALIBRATE_SEED = 6.0, 500_000
MINUTE = 60.0  # s
STEFAN_BOLTZMANN, ZERO = 5.67e-8, 273.15


@dataclass(frozen=True)
class Bodies:
    """Capacities (n,) [J/K], links (n, n) and losses (n,) [W/K]; heat of temperatures (n,) [degC] -> (n,) [W]; probes; exponent
    of the losses (their conductance holds 10 K above the room); room of the time [min] -> [degC]; start (n,) [degC].
    """

    capacity: Array
    links: Array
    loss: Array
    heat: Callable[[Array], Array]
    probes: list[int]
    room: Callable[[float], float]
    steady_room: float
    exponent: float = 1.0
    rested: tuple[float, float] | None = None

    def slope(self, time: float, state: Array, load: float = 1.0) -> Array:
        """K/min."""
        above = state - self.room(time)
        lost = self.loss * above * (np.abs(above) / 10.0 + 1e-9) ** (self.exponent - 1.0)
        flows = self.links @ state - self.links.sum(axis=1) * state
        return np.asarray(MINUTE * (flows - lost + load * self.heat(state)) / self.capacity)

    def curves(self) -> tuple[Array, Array]:
        """(times (k,) [min], temperatures (n, k) [degC])."""
        state = np.full(len(self.capacity), self.room(0.0))
        for minutes, load in zip(self.rested or (), (1.0, 0.0), strict=False):
            state = solve_ivp(self.slope, (0.0, minutes), state, "LSODA", args=(load,), rtol=1e-7, atol=1e-6).y[:, -1]
        times = np.arange(0.0, LONGEST + GRID, GRID)
        solved = solve_ivp(self.slope, (0.0, times[-1]), state, "LSODA", times, rtol=1e-7, atol=1e-6, max_step=4.0)
        return times, solved.y

    def limits(self, near: Array) -> Array:
        """Temperatures at rest (n,) [degC] in the mean room."""
        still = Bodies(**{**vars(self), "room": lambda _: self.steady_room})
        late = solve_ivp(still.slope, (0.0, 3e4), near, "LSODA", rtol=1e-8, atol=1e-7).y[:, -1]
        return np.asarray(root(lambda state: still.slope(0.0, state), late).x)

    def beyond(self, state: Array) -> tuple[Array, Array]:
        """(times (k,) [min], temperatures (n, k) [degC]) after those of :meth:`curves`, in the mean room."""
        still = Bodies(**{**vars(self), "room": lambda _: self.steady_room})
        times = LONGEST + np.geomspace(GRID, 3e4, 4000)
        solved = solve_ivp(still.slope, (LONGEST, times[-1]), state, "LSODA", times, rtol=1e-8, atol=1e-7)
        return times, solved.y

    def again(self, rng: np.random.Generator) -> "Bodies":
        """The same machine on another day: another load and another room, but where heat and room are of one piece (oven)."""
        load, warmer = (1.0 + 0.05 * rng.standard_normal(), 1.5 * rng.standard_normal()) if len(self.capacity) != 9 else (1.0, 0.0)
        heat, room = self.heat, self.room
        return Bodies(
            **{
                **vars(self),
                "heat": lambda state: load * heat(state),
                "room": lambda time: room(time) + warmer,
                "steady_room": self.steady_room + warmer,
            }
        )


def linked(size: int, *links: tuple[int, int, float]) -> Array:
    """Conductances (size, size) of links (from, to, W/K)."""
    found = np.zeros((size, size))
    for one, other, conductance in links:
        found[one, other] = found[other, one] = conductance
    return found


def rod(rng: np.random.Generator, kind: str) -> Bodies:
    """A bar of steel or aluminium of 40 nodes."""
    size = 40
    length, section = rng.uniform(*((0.6, 1.2) if kind == "far" else (0.3, 0.9))), 10.0 ** rng.uniform(-3.0, -2.0)
    conducts, stores = (rng.uniform(110.0, 160.0), 2.43e6) if rng.random() < 0.3 else (rng.uniform(40.0, 52.0), 3.67e6)
    step = length / size
    capacity = np.full(size, stores * section * step)
    loss = np.full(size, rng.uniform(7.0, 20.0) * 3.6 * np.sqrt(section) * step)
    capacity[0] += rng.uniform(0.0, 0.5) * capacity.sum()
    if kind == "foot":
        capacity[-1] += rng.uniform(1.0, 5.0) * capacity.sum()
        loss[-1] += rng.uniform(0.5, 2.0) * loss.sum()
    links = linked(size, *((i, i + 1, conducts * section / step) for i in range(size - 1)))
    heated = int(rng.integers(1, 5))
    heat = np.where(np.arange(size) < heated, 1.0 / heated, 0.0)
    heat *= rng.uniform(8.0, 25.0) / np.linalg.solve(np.diag(loss + links.sum(axis=1)) - links, heat)[0]
    probes = [0, 8, 16, 24, 32] if kind == "far" else np.sort(rng.choice(size * 2 // 3, 5, replace=False)).tolist()
    room = rng.uniform(17.0, 25.0)
    return Bodies(capacity, links, loss, lambda _: heat, probes, lambda _: room, room)


def spindle(rng: np.random.Generator, kind: str) -> Bodies:
    """0, 1 bearings, 2 shaft, 3, 4 housings, 5 headstock, 6 column."""
    u = rng.uniform
    masses = [600.0, 900.0, u(4e3, 9e3), u(8e3, 2e4), u(6e3, 1.5e4), u(2e4, 6e4), u(6e4, 2e5)]
    pairs = [(0, 2, u(3, 10)), (1, 2, u(3, 10)), (1, 3, u(5, 20)), (0, 4, u(5, 20)), (3, 5, u(5, 25)), (4, 5, u(5, 25))]
    links = linked(7, *pairs, (5, 6, u(1, 8)), (3, 4, u(1, 5)))
    loss = np.array([0.0, 0.0, u(0.5, 2), u(1, 3), u(1, 3), u(3, 9), u(5, 15)])
    friction = np.array([u(0.6, 1.0), 1.0]) * u(70.0, 200.0)
    mean, fades = u(17.0, 25.0), u(0.012, 0.03) if kind == "viscous" else 0.0
    grows = u(0.02, 0.06) if kind == "preload" else 0.0
    swing, period = (u(0.2, 0.8), u(15.0, 60.0)) if kind == "swing" else (0.0, 1.0)

    def heat(state: Array) -> Array:
        found = np.zeros(7)
        viscous = 0.4 + 0.6 * np.exp(-fades * (state[:2] - mean))
        found[:2] = friction * viscous * np.clip(1.0 + grows * (state[2] - state[[4, 3]]), 0.3, 4.0)
        return found

    rested = (10.0 ** u(1.3, 2.3), 10.0 ** u(0.7, 1.8)) if kind == "warm" else None
    room = (lambda time: mean + swing * np.sin(2.0 * np.pi * time / period)) if swing else (lambda _: mean)
    return Bodies(np.array(masses), links, loss, heat, [0, 1, 3, 4, 5], room, mean, u(1.0, 1.15), rested)


def oven(rng: np.random.Generator, kind: str) -> Bodies:
    """0 element, 1 air, 2 inner wall, 3 to 6 insulation, 7 shell, 8 load."""
    u = rng.uniform
    through = 4.0 * u(1.5, 4.0)
    links = linked(9, (0, 1, u(3, 8)), (1, 2, u(5, 12)), *((i, i + 1, through) for i in range(2, 7)), (1, 8, u(2, 6)))
    capacity = np.array([u(500, 1500), 300.0, u(4e3, 1e4), 2e3, 2e3, 2e3, 2e3, u(3e3, 8e3), u(1e3, 8e3)])
    loss = np.array([0.0, u(0.05, 0.3), 0, 0, 0, 0, 0, u(5, 12), 0])
    power, shines, room = u(150.0, 500.0), STEFAN_BOLTZMANN * u(0.3, 0.9) * u(0.05, 0.2), u(17.0, 25.0)

    def heat(state: Array) -> Array:
        found, fourth = np.zeros(9), (state + ZERO) ** 4
        found[0] = power
        for one, other, share in ((0, 2, 1.0), (2, 8, 0.6)):
            flow = shines * share * (fourth[one] - fourth[other])
            found[one] -= flow
            found[other] += flow
        found[7] -= 2.0 * shines * (fourth[7] - (room + ZERO) ** 4)
        return found

    return Bodies(capacity, links, loss, heat, [1, 2, 4, 7, 8], lambda _: room, room, 1.25)


def coolant(rng: np.random.Generator, kind: str) -> Bodies:
    """0 gears, 1 oil, 2 housing, 3 jacket, 4 reservoir, 5 foot."""
    u = rng.uniform
    links = linked(6, (0, 1, u(10, 30)), (1, 2, u(10, 30)), (2, 3, u(20, 60)), (3, 4, u(30, 120)), (2, 5, u(2, 10)))
    capacity = np.array([u(3e3, 8e3), u(2e3, 6e3), u(1e4, 3e4), u(1e3, 3e3), u(3e4, 1.6e5), u(2e4, 8e4)])
    power, room = np.array([u(200.0, 700.0), 0, 0, 0, 0, 0]), u(17.0, 25.0)
    loss = np.array([0.0, 0.0, u(2, 6), 0.0, u(4, 25), u(3, 9)])
    return Bodies(capacity, links, loss, lambda _: power, [0, 1, 2, 5, 4], lambda _: room, room)


def motor(rng: np.random.Generator, kind: str) -> Bodies:
    """0 winding, 1 its end, 2 core, 3 rotor, 4 housing, 5 flange, 6 bench; the winding's resistance grows."""
    u = rng.uniform
    pairs = [(0, 2, u(10, 30)), (0, 1, u(3, 9)), (2, 4, u(15, 50)), (3, 2, u(2, 6)), (3, 5, u(1, 4)), (4, 5, u(4, 15))]
    links = linked(7, *pairs, (5, 6, u(1, 10)))
    capacity = np.array([u(800, 3e3), u(300, 900), u(6e3, 2e4), u(4e3, 1e4), u(6e3, 2e4), u(3e3, 1e4), u(2e4, 2e5)])
    copper, iron, room = u(60.0, 200.0), u(20.0, 100.0), u(17.0, 25.0)

    def heat(state: Array) -> Array:
        warm = copper * (1.0 + 0.00393 * (state[0] - 20.0))
        return np.array([0.75 * warm, 0.25 * warm, iron, 0.2 * iron, 0.0, 0.0, 0.0])

    loss = np.array([0.0, 0, 0, 0, u(4, 12), u(1, 3), u(2, 10)])
    return Bodies(capacity, links, loss, heat, [0, 2, 4, 5, 1], lambda _: room, room, u(1.0, 1.25))


def bed(rng: np.random.Generator, kind: str) -> Bodies:
    """0, 1 bearings, 2, 3, 4 housing along its axis, 5 the bed that it stands on."""
    u = rng.uniform
    capacity = np.array([u(600, 1500), u(600, 1500), *(u(6e3, 2e4) for _ in range(3)), u(4e4, 1.6e5)])
    pairs = [(0, 2, u(8, 25)), (1, 4, u(8, 25)), (2, 3, u(5, 25)), (3, 4, u(5, 25))]
    links = linked(6, *pairs, *((i, 5, u(0.5, 6.0)) for i in (2, 3, 4)))
    loss = np.array([0.0, 0.0, *(u(1.0, 4.0) for _ in range(3)), u(2, 8)])
    power, room = np.array([u(50.0, 150.0), u(50.0, 150.0), 0, 0, 0, 0]), u(17.0, 25.0)
    return Bodies(capacity, links, loss, lambda _: power, [0, 2, 3, 4, 5], lambda _: room, room, u(1.0, 1.25))


KINDS = dict.fromkeys(("rod", "foot", "far"), rod)
KINDS |= dict.fromkeys(("spindle", "viscous", "preload", "warm", "swing"), spindle)
KINDS |= {"oven": oven, "coolant": coolant, "motor": motor, "bed": bed}


@dataclass(frozen=True)
class Record:
    """minutes (n,), readings (S, n) and limits (S,) [degC], rises (S,) [K] of the sensors; settles (S,) [min]: within 5 % for good;
    turn [min], their median to 63 %.
    """

    minutes: Array
    reading: Array
    limit: Array
    rise: Array
    settles: Array
    turn: float

    def table(self, until: float, late: float = 0.0) -> dict[str, Array]:
        """Columns of the first minutes, or of as many from a later one on."""
        some = (self.minutes >= late) & (self.minutes <= late + until)
        return {"time_min": self.minutes[some] - late, **{f"T{i}": line[some] for i, line in enumerate(self.reading)}}


def within(times: Array, curves: Array, late: tuple[Array, Array], limit: Array) -> Array:
    """When each curve (S, k), continued by late ones, is within 5 % of its rise to its limit (S,) for good (S,) [min]."""
    times, curves = np.concatenate([times, late[0]]), np.concatenate([curves, late[1]], axis=1)
    outside = np.abs(curves - limit[:, None]) > 0.05 * np.abs(limit - curves[:, 0])[:, None]
    last = outside.shape[1] - 1 - outside[:, ::-1].argmax(axis=1)
    return times[np.minimum(last + 1, len(times) - 1)]


def record(kind: str, seed: int, turns: float) -> Record:
    """So many median times to 63 % of a machine, by probes that lag."""
    rng = np.random.default_rng([seed, *map(ord, kind)])
    return measured(KINDS[kind](rng, kind), rng, turns)


def measured(bodies: Bodies, rng: np.random.Generator, turns: float) -> Record:
    """So many median times to 63 % of bodies, by probes that lag."""
    times, curves = bodies.curves()
    limit, late = bodies.limits(curves[:, -1])[bodies.probes], bodies.beyond(curves[:, -1])
    curves = curves[bodies.probes]
    fall = np.exp(-GRID / 10.0 ** rng.uniform(-1.3, -0.3))
    for k in range(1, curves.shape[1]):  # probes follow what they touch
        curves[:, k] = curves[:, k] + fall * (curves[:, k - 1] - curves[:, k])
    rise = limit - curves[:, 0]
    settles = within(times, curves, (late[0], late[1][bodies.probes]), limit)
    done = (curves - curves[:, :1]) / rise[:, None] >= 1.0 - np.exp(-1.0)
    turn = float(np.clip(np.median([times[d.argmax()] if d.any() else LONGEST for d in done]), 12.0, 600.0))
    step, noise = rng.choice([1.0 / 60.0, 1.0 / 6.0, 1.0 / 6.0, 1.0]), 10.0 ** rng.uniform(-2.3, -1.3)
    minutes = np.arange(0.0, min(turns * turn, LONGEST) + 0.5 * step, step)
    reading = np.array([np.interp(minutes, times, line) for line in curves])
    return Record(minutes, reading + noise * rng.standard_normal(reading.shape), limit, rise, settles, turn)


def of_its_past(kind: str, seed: int, runs: int, auto: bool, lasting: float) -> tf.Model:
    """A model of so many runs, so many times to 63 % long, of the machine that :func:`record` reads."""
    past = []
    for i in range(runs):
        bodies = KINDS[kind](np.random.default_rng([seed, *map(ord, kind)]), kind)
        rng = np.random.default_rng([seed, i + 1, *map(ord, kind)])
        past.append(tf.read(measured(bodies.again(rng), rng, lasting).table(LONGEST), name=f"run {i}"))
    return tf.improve(past, together=True, auto=auto).model if runs > 1 else tf.improve(past[0], auto=auto).model


@dataclass(frozen=True)
class Past:
    """How many runs of the same machine are learnt from, whether effects are looked for in them, and how long they last [turns];
    late: how many turns of the run at hand were over where its record begins.
    """

    runs: int = 0
    auto: bool = False
    lasting: float = COMPLETE
    late: float = 0.0


def rows_of(
    job: tuple[str, int, str | Imperfection, tuple[float, ...], Past],
) -> list[tuple[str, float, bool, float, float, float, float]]:
    """(kind, read, ok, sides of the interval less the limit over the rise, and of settling times over the true one) of each sensor
    of one machine at each time; an open side of a settling time is infinite.
    """
    kind, seed, prior, read, past = job
    seen, found = record(kind, seed, max(read) + past.late), []
    model = of_its_past(kind, seed, past.runs, past.auto, past.lasting) if past.runs else None
    for share in read:
        told = tf.identify(seen.table(share * seen.turn, past.late * seen.turn), imperfection=prior, model=model, jobs=1)
        for r, limit, rise, settles in zip(told, seen.limit, seen.rise, seen.settles, strict=True):
            sides = [np.nan if side is None else (side - limit) / rise for side in (r.steady_state_lo_c, r.steady_state_hi_c)]
            bounded = bool(np.isfinite(sides).all())
            own = settles - past.late * seen.turn
            times = [edge if side is None else side / own for side, edge in ((r.t95_lo_min, 0.0), (r.t95_hi_min, np.inf))]
            found.append((kind, share, r.status == "ok", *((min(sides), max(sides)) if bounded else (np.nan, np.nan)), *times))
    return found


def learnt(job: tuple[str, int, int]) -> Imperfection:
    """What so many complete runs of other machines of a kind teach."""
    kind, seed, runs = job
    past = [tf.read(record(kind, seed + CALIBRATE_SEED + i, COMPLETE).table(LONGEST), name=f"run {i}") for i in range(runs)]
    return tf.calibrate(past).prior


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--each", type=int, default=10)
    parser.add_argument("--seed", type=int, default=70_000)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--calibrated", type=int, default=0, help="complete runs of other machines of the kind to learn from")
    parser.add_argument("--past", type=int, default=0, help="complete runs of the same machine to learn from")
    parser.add_argument("--auto", action="store_true", help="and the effects that are found in them")
    parser.add_argument("--lasting", type=float, default=COMPLETE, help="how long these runs last, in times to 63 %%")
    parser.add_argument("--late", type=float, default=0.0, help="times to 63 %% that are over where a record begins")
    parser.add_argument("--read", default=",".join(map(str, READ)), help="median times to 63 %% that are read")
    given = parser.parse_args()
    read = tuple(map(float, given.read.split(",")))
    by: dict[tuple[str, float], list[tuple[bool, float, float, float, float]]] = defaultdict(list)
    kinds = given.kinds.split(",")
    with ProcessPoolExecutor() as pool:
        priors: dict[str, str | Imperfection] = dict.fromkeys(kinds, "typical")
        if given.calibrated:
            priors |= zip(kinds, pool.map(learnt, [(kind, given.seed, given.calibrated) for kind in kinds]), strict=True)
        past = Past(given.past, given.auto, given.lasting, given.late)
        jobs = [(kind, given.seed + i, priors[kind], read, past) for kind in kinds for i in range(given.each)]
        for rows in pool.map(rows_of, jobs):
            for kind, *row in rows:
                for name in (kind, "all"):
                    by[name, row[0]].append(tuple(row[1:]))
    print(
        "| bodies | read | rows | `ok` | of these held | all held | half-width / rise | score / rise "
        "| t95 held of `ok` | of all | half-width / t95 |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind in (*kinds, "all"):
        for share in read:
            ok, low, high, soon, late = map(np.array, zip(*by[kind, share], strict=True))
            told = np.isfinite(low) & np.isfinite(high)
            held = (low <= 0.0) & (high >= 0.0)
            score = (high - low + 40.0 * np.maximum(low, 0.0) + 40.0 * np.maximum(-high, 0.0))[told]
            good = f"{np.mean(held[ok & told]):.2f}" if (ok & told).any() else "-"
            half = 0.5 * np.median((high - low)[told])
            cells = [f"{len(ok)}", f"{ok.mean():.2f}", good, f"{held[told].mean():.2f}", f"{half:.2f}", f"{score.mean():.2f}"]
            settled = (soon <= 1.0) & (late >= 1.0)
            of_ok = f"{settled[ok].mean():.2f}" if ok.any() else "-"
            cells += [of_ok, f"{settled.mean():.2f}", f"{0.5 * np.median(late - soon):.2f}"]
            print(f"| {kind} | {share:g} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
