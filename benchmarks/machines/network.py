"""Five lumped bodies of a machine (spindle, two bearings, housing, column) with links, convection, radiation and rough logs.

Independent of the estimators it tests. `python -m benchmarks.machines.network` prints how far one exponential is from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import eigvals
from scipy.signal import sawtooth

from benchmarks.machines import record as common
from benchmarks.machines.record import DURATION, GRID, STEP, Array, Machine, Record, between, lagged

JOINTS = ((0, 1), (0, 2), (1, 3), (2, 3), (3, 4))  # of spindle 0, front bearing 1, rear bearing 2, housing 3, column 4
SIZE = 6  # the sixth is a body that only some effects use
HEIGHT = np.array([0.7, 0.8, 0.6, 0.6, 0.3, 0.0])  # m
REFERENCE = 7.0  # K, rise at which the convection coefficients hold
ZERO = 273.15  # K
WARMTH = 4 * (20 + ZERO) ** 3  # K^3, so that a radiation coefficient is a conductance near 20 degC


@dataclass(frozen=True)
class _Plant:
    """A machine: `capacity`, `heat` (W), `convect`, `radiate` (W/K), all (6,); `link` (6, 6) W/K; `exponent` of convection;
    `lag` of the probes on `bodies`, min; capacities in W min/K.
    """

    capacity: Array
    heat: Array
    convect: Array
    radiate: Array
    link: Array
    exponent: float
    bodies: list[int]
    lag: Array
    rate: float
    follows: float  # change of the log of the dominant rate with the log of the loss
    noise: float
    step: float
    interval: float


@dataclass(frozen=True)
class _Course:
    """One run of one variant on the grid: `air` (6, G) degC at the bodies; `share` of the heat and the share that `lasts`
    (G,); `fan` (G,) factor of convection; `extra` (S, G) K of reading; `start` (6,) degC; `plant` with the effect built in.
    """

    plant: _Plant
    air: Array
    room: Array
    share: Array
    lasts: Array
    fan: Array
    losses: float
    extra: Array
    start: Array


def _slowest(capacity: Array, link: Array, loss: Array) -> float:
    five = slice(0, SIZE - 1)
    return float(eigvals((np.diag(loss) - link)[five, five] / capacity[five, None]).real.min())


def _draw(seed: int, background: float) -> _Plant:
    """The machine of a seed; the background scales its imperfections and leaves every other draw alone."""
    rng = np.random.default_rng([seed, 21])
    tau = between(rng, 25, 150)
    capacity = np.array([0.5, 0.3, 0.3, 2.0, 4.0, 1.0]) * np.exp(0.4 * rng.standard_normal(SIZE))
    loss = capacity * np.exp(background * 0.25 * rng.standard_normal(SIZE))
    radiate = loss * background * rng.uniform(0.02, 0.10) * (np.arange(SIZE) < SIZE - 1)
    link = np.zeros((SIZE, SIZE))
    for one, two in JOINTS:
        link[one, two] = link[two, one] = background * between(rng, 0.1, 3.0) * min(capacity[one], capacity[two])
    link -= np.diag(link.sum(axis=1))
    heat = capacity * np.array([1.0, 1.4, 1.2, 0.8, 0.6, 0.0]) * np.exp(0.3 * rng.standard_normal(SIZE))
    bodies = np.sort(rng.choice(SIZE - 1, int(rng.integers(2, 6)), replace=False)).tolist()
    rises = np.linalg.solve(np.diag(loss) - link, heat)[bodies]
    heat = heat * between(rng, 4, 12) / rises.mean()
    rate = _slowest(capacity, link, loss)
    follows = np.log(_slowest(capacity, link, 1.05 * loss) / rate) / np.log(1.05)
    return _Plant(
        capacity=capacity * rate * tau,
        heat=heat,
        convect=loss - radiate,
        radiate=radiate,
        link=link,
        exponent=1 + background * rng.uniform(0.0, 0.1),
        bodies=bodies,
        lag=background * rng.uniform(0.2, 1.0, len(bodies)),
        rate=1 / tau,
        follows=float(follows),
        noise=between(rng, 0.008, 0.050),
        step=between(rng, 0.005, 0.1) if rng.random() < 0.5 else float(rng.choice([0.01, 0.1])),
        interval=float(rng.choice([1 / 6, 0.5, 1.0])),
    )


def _sensor(seed: int, plant: _Plant) -> int:
    return int(np.random.default_rng([seed, 27]).integers(len(plant.bodies)))


def _course(
    seed: int, run: int, background: float, level: float, effect: str | None = None, size: float = 0.0, draw: int = 0
) -> _Course:
    """Everything that acts on one run, with an effect of the given size (units in `EFFECTS`)."""
    rng, fate = np.random.default_rng([seed, 22, run]), np.random.default_rng([seed, 23, draw])
    plant = _draw(seed, background)
    teeth = rng.uniform(0.05, 0.2) * sawtooth(2 * np.pi * (GRID / rng.uniform(12, 40) + rng.random()), rng.uniform(0.2, 0.8))
    slope = 0.04 * (0.25 / 0.04) ** (0.6 * np.log(plant.noise / 0.008) / np.log(50 / 8) + 0.4 * rng.random())  # K/h
    day = slope / 60 * 1440 / (2 * np.pi) * np.sin(2 * np.pi * (GRID / 1440 + rng.random()))
    room = rng.uniform(18, 25) + background * (teeth + day)
    gradient = background * rng.uniform(0.0, 0.8)  # K/m
    share = level * common.held(rng, background * between(rng, 0.003, 0.015))
    losses = float(np.exp(0.05 * rng.standard_normal() / max(plant.follows, 0.3)))
    warmth = background * rng.uniform(0, 0.5) * rng.uniform(0, 1, SIZE)
    sign, when, other = float(fate.choice([-1, 1])), fate.uniform(20, 250), fate.random() < 0.5
    fraction, period, phase, decay = between(fate, 0.15, 0.6), between(fate, 8, 40), fate.random(), fate.uniform(20, 90)
    sensor, extra = _sensor(seed, plant), np.zeros((len(plant.bodies), GRID.size))
    after, brief, fan = (when <= GRID).astype(float), np.ones(GRID.size), np.ones(GRID.size)
    capacity, heat, convect, radiate = (part.copy() for part in (plant.capacity, plant.heat, plant.convect, plant.radiate))
    lag, exponent, couple = plant.lag, plant.exponent, np.zeros(SIZE - 1)
    if effect == "second_mode":
        couple = size / (1 - size) * (plant.convect + plant.radiate)[:-1]
        convect[-1], capacity[-1] = 0.0, max(couple.sum(), 1e-9) * (1 - size) / (fraction * plant.rate)
    elif effect == "neighbour_heat":
        body = plant.bodies[sensor]
        couple[body] = size * plant.convect[body]
        convect[-1], heat[-1] = 3 * plant.convect[body], 9 * max(plant.heat[body], 5 * plant.convect[body])
        capacity[-1] = convect[-1] / plant.rate / (fraction if other else 1 / fraction)
    elif effect == "ambient":
        room = room + sign * size * (after if other else GRID / DURATION)
    elif effect == "friction_decay":
        brief = 1 + size * np.exp(-GRID / decay)
    elif effect == "sensor_lag" and size:
        lag = size * np.linspace(0.85, 1.15, lag.size)
    elif effect == "nonlinear_loss" and size:
        exponent = 1 + size
    elif effect in ("sensor_drift", "reading_jump"):
        extra[sensor] = sign * size * (GRID / 60 if effect == "sensor_drift" else after)
    elif effect == "cooling_switch":
        fan = 1 + size * after
    elif effect == "load_step":
        share = share * (1 + sign * size * after)
    elif effect == "cyclic_load":
        wave = np.sin(2 * np.pi * (GRID / period + phase))
        brief = 1 + size * (np.sign(wave) if other else wave)
    elif effect == "transport_delay":
        brief = np.clip((GRID - size) / STEP + 1, 0.0, 1.0)
    link = plant.link - np.diag(np.append(couple, couple.sum()))
    link[:-1, -1] = link[-1, :-1] = couple
    air = room + gradient * (HEIGHT[:, None] - 0.5)
    built = replace(plant, capacity=capacity, heat=heat, convect=convect, radiate=radiate, link=link)
    built = replace(built, exponent=exponent, lag=lag)
    return _Course(built, air, room, share * brief, share, fan, losses, extra, air[:, 0] + warmth)


def march(courses: list[_Course]) -> Array:
    """Temperatures (K, 6, G), degC, of K variants together, by the midpoint rule."""
    plants = [course.plant for course in courses]
    names = ("capacity", "heat", "convect", "radiate")
    capacity, heat, convect, radiate = (np.array([getattr(plant, name) for plant in plants]) for name in names)
    losses = np.array([[course.losses] for course in courses])
    link = np.array([plant.link for plant in plants]) / capacity[:, :, None]
    power = np.array([[plant.exponent - 1] for plant in plants])
    radiate = radiate * losses / capacity / WARMTH
    air = np.array([course.air.T for course in courses]).swapaxes(0, 1)
    fan = np.array([course.fan for course in courses]).T[:, :, None] * losses * convect / capacity
    warm = np.array([course.share for course in courses]).T[:, :, None] * heat / capacity

    def slope(state: Array, k: int, half: bool) -> Array:
        near = 0.5 * (air[k] + air[k + 1]) if half else air[k]
        blow, fed = (0.5 * (fan[k] + fan[k + 1]), 0.5 * (warm[k] + warm[k + 1])) if half else (fan[k], warm[k])
        rise = state - near
        two, squares = state + near + 2 * ZERO, (state + ZERO) ** 2 + (near + ZERO) ** 2
        flow = (link @ state[:, :, None])[:, :, 0] + fed
        return np.asarray(flow - rise * (blow * (np.abs(rise) / REFERENCE) ** power + radiate * two * squares))

    states = np.empty((len(air), len(plants), SIZE))
    states[0] = state = np.array([course.start for course in courses])
    for k in range(len(air) - 1):
        state = state + STEP * slope(state + STEP / 2 * slope(state, k, False), k, True)
        states[k + 1] = state
    return np.moveaxis(states, 0, -1)


def settle(course: _Course, time: Array) -> Array:
    """Steady temperatures (m, 6), degC, with the inputs frozen as they are at each time (m,), min."""
    plant, index = course.plant, np.minimum((time / STEP).astype(int), GRID.size - 1)
    air = np.array([np.interp(time, GRID, row) for row in course.air]).T
    fan, load = course.losses * course.fan[index, None] * plant.convect, course.lasts[index, None] * plant.heat
    radiate, state = course.losses * plant.radiate / WARMTH, air + REFERENCE
    for _ in range(40):
        rise = state - air
        steep = fan * (np.abs(rise) / REFERENCE) ** (plant.exponent - 1)
        wrong = load - steep * rise - radiate * ((state + ZERO) ** 4 - (air + ZERO) ** 4) + state @ plant.link
        slant = plant.exponent * steep + 4 * radiate * (state + ZERO) ** 3 + 1e-9
        change = np.linalg.solve(np.eye(SIZE) * slant[:, None, :] - plant.link, wrong[:, :, None])[:, :, 0]
        state = state + change
        if np.abs(change).max() < 1e-8:
            break
    return np.asarray(state)


def _probes(courses: list[_Course]) -> Array:
    """Measured points (K, S, G), degC, after the probes' lag."""
    rows = ((course.plant, state) for course, state in zip(courses, march(courses), strict=True))
    return np.array([[lagged(state[b], lag) for b, lag in zip(p.bodies, p.lag, strict=True)] for p, state in rows])


def simulate(
    seed: int, background: float = 1.0, effect: str | None = None, runs: int = 1, exact: bool = False, load_spread: float = 0.0
) -> Machine:
    """Machine of a seed, run `runs` times. `background` multiplies every imperfection; `effect` is one of `EFFECTS`; `exact`
    gives one exponential per sensor. Runs after the first have loads within +-`load_spread` (a share) of the first's.
    """
    common.allow(effect, exact)
    plant, records, sized = _draw(seed, background), [], common.Sized(background=background)
    if effect is not None:

        def curves(amount: float, draw: int, sizes: Array) -> Array:
            courses = [_course(seed, 0, amount, 1.0, effect, float(size), draw) for size in sizes]
            return np.asarray(_probes(courses) + np.array([course.extra for course in courses]))

        sized = common.scale_effect(seed, effect, curves, background, _sensor(seed, plant), plant.noise)
    for run, level in enumerate(common.levels(seed, runs, load_spread)):
        rng = np.random.default_rng([seed, 26, run])
        time = common.rough_times(rng, plant.interval)
        if exact:
            steady = np.linalg.solve(np.diag(plant.convect + plant.radiate) - plant.link, plant.heat)
            rises: Array = level * np.asarray(steady[plant.bodies], dtype=np.float64)
            records.append(common.exact_run(rng, time, plant.rate, rises, plant.noise, level))
            continue
        course = _course(seed, run, sized.background, level, effect, sized.size, sized.draw)
        points = np.asarray(CubicSpline(GRID, _probes([course])[0], axis=1)(np.minimum(time, DURATION)), dtype=np.float64)
        reading: Array = points + np.array([np.interp(time, GRID, row) for row in course.extra])
        reading = reading + plant.noise * rng.standard_t(5, reading.shape) / np.sqrt(5 / 3)
        wild = (rng.random(reading.shape) < 0.002) * rng.choice([-1, 1], reading.shape)
        reading = np.round((reading + wild * rng.uniform(0.5, 2, reading.shape)) / plant.step) * plant.step
        limit = np.ascontiguousarray(settle(course, time)[:, plant.bodies].T)
        beside = None
        if effect == "neighbour_heat":
            state = np.interp(time, GRID, march([course])[0, -1])
            beside = np.asarray(state + plant.noise * rng.standard_normal(state.shape))
        records.append(Record(time, reading, points, np.interp(time, GRID, course.room), limit, level, beside))
    return Machine(seed, effect, tuple(records), sized.size, sized.ratio, 0.0 if exact else sized.background, plant.noise)


if __name__ == "__main__":
    common.check(simulate)
