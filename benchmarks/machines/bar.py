"""A conducting bar of 15 nodes warmed by two bearings: a simulated machine with small imperfections and known limits.

Independent of the estimators it tests. `python -m benchmarks.machines.bar` prints how far one exponential is from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.machines import record as common
from benchmarks.machines.record import GRID, STEP, Array, Machine, Record, between, coloured, lagged

NODES = 15
SENSORS = 3
REFERENCE = 8.0  # K, rise at which the loss coefficients hold


@dataclass(frozen=True)
class _Bar:
    """The machine itself (heat in K/min per unit capacity). `loss`, `heat` (15,) and `link` (15, 15) per min; `exponent`
    of the loss; `nodes` (3,) of the sensors; `lag` (3,) min; `wander` sd K; `flutter` share; times in min.
    """

    loss: Array
    heat: Array
    link: Array
    exponent: float
    nodes: list[int]
    lag: Array
    rate: float
    wander: float
    flutter: float
    memory: float
    noise: float
    step: float
    every: int


@dataclass(frozen=True)
class _Drive:
    """Inputs of K variants on the grid: `room`, `load`, `settled` (the load that lasts), `fan` (factor of the loss), all
    (K, G); the bar with one more body, node 15: `loss`, `heat`, `capacity` (K, 16), `link` (K, 16, 16), `exponent` (K,);
    `lag` (K, 3) min; `added` (K, 3, G) K, error of the reading.
    """

    room: Array
    load: Array
    settled: Array
    fan: Array
    loss: Array
    heat: Array
    capacity: Array
    link: Array
    exponent: Array
    lag: Array
    added: Array


def _draw(seed: int, background: float) -> _Bar:
    """The machine of a seed; the background scales its imperfections and leaves every other draw alone."""
    rng = np.random.default_rng([seed, 11])
    tau, places = between(rng, 40, 110), rng.uniform(0, NODES - 1, 2)
    share, width, floor = rng.uniform(0.3, 0.7), rng.uniform(1.5, 4.0), rng.uniform(0.35, 0.6)
    position = np.arange(NODES)
    hump = np.exp(-(((position - places[:, None]) / width) ** 2)).T @ np.array([share, 1 - share])
    heat = floor + (1 - floor) * hump / hump.max()
    loss = np.exp(background * 0.15 * rng.standard_normal(NODES))
    joints = background * between(rng, 0.05, 0.3) * rng.uniform(0.7, 1.3, NODES - 1)
    link = np.diag(joints, 1) + np.diag(joints, -1)
    link -= np.diag(link.sum(axis=1))
    rate = float(np.linalg.eigvalsh(np.diag(loss) - link)[0])
    nodes = rng.choice(NODES, SENSORS, replace=False)
    rises = np.linalg.solve(np.diag(loss) - link, heat)[nodes]
    heat = heat * 4.3 / rises.min() * (14.0 * rises.min() / rises.max() / 4.3) ** rng.random()
    coarse = rng.random()  # a coarse machine has both more noise and more of the rest
    return _Bar(
        loss=loss / rate / tau,
        heat=heat / rate / tau,
        link=link / rate / tau,
        rate=1 / tau,
        nodes=nodes.tolist(),
        exponent=1 + background * rng.uniform(0.03, 0.08),
        lag=background * rng.uniform(0.3, 0.8, SENSORS),
        wander=background * 0.05 * 4 ** (0.6 * coarse + 0.4 * rng.random()),
        flutter=background * (0.003 + 0.007 * (0.5 * coarse + 0.5 * rng.random())),
        memory=rng.uniform(10, 40),
        noise=float(0.010 * 4 ** (coarse**1.3)),
        step=float(rng.choice([0.0, 0.01, 0.02, 0.05])),
        every=int(rng.choice([1, 2])),
    )


def _sensor(seed: int) -> int:
    return int(np.random.default_rng([seed, 17]).integers(SENSORS))


def _drive(bar: _Bar, seed: int, run: int, level: float, effect: str | None, sizes: Array, draw: int = 0) -> tuple[_Drive, float]:
    """Inputs of one run with an effect of each of the sizes (K,), and the temperature, degC, at its start."""
    rng, fate = np.random.default_rng([seed, 12, run]), np.random.default_rng([seed, 13, draw])
    K, G = sizes.size, GRID.size
    first = rng.uniform(18, 24)
    walk = rng.random() < 0.5
    slow = between(rng, 100, 400)
    path = np.cumsum(rng.standard_normal(G)) / np.sqrt(G) if walk else coloured(rng, slow, G)
    room = np.tile(first + bar.wander * path / path.std(), (K, 1))
    start = float(room[0, 0] + rng.uniform(-0.3, 0.3))
    load = np.tile(level * (1 + bar.flutter * coloured(rng, bar.memory, G)), (K, 1))
    fan = np.full((K, G), np.exp(0.05 * rng.standard_normal()))
    loss = np.tile(np.append(bar.loss, 0.0), (K, 1))
    heat = np.tile(np.append(bar.heat, 0.0), (K, 1))
    capacity, link = np.ones((K, NODES + 1)), np.zeros((K, NODES + 1, NODES + 1))
    link[:, :NODES, :NODES] = bar.link
    exponent, lag, added = np.full(K, bar.exponent), np.tile(bar.lag, (K, 1)), np.zeros((K, SENSORS, G))
    sensor, sign, when = _sensor(seed), float(fate.choice([-1, 1])), fate.uniform(20, 250)
    fraction, period, phase = between(fate, 0.15, 0.6), between(fate, 8, 40), fate.uniform(0, 1)
    decay, other = fate.uniform(20, 90), fate.random() < 0.5
    s, after = sizes[:, None], (when <= GRID).astype(float)
    now = np.ones((K, G))  # factor of the load that does not last
    couple = np.zeros((K, NODES))
    if effect == "second_mode":
        couple = s / (1 - s) * bar.loss
        capacity[:, NODES] = np.maximum(couple.sum(axis=1) * (1 - sizes) / (fraction * bar.rate), 1e-9)
    elif effect == "neighbour_heat":
        node = bar.nodes[sensor]
        couple[:, node] = sizes * bar.loss[node]
        loss[:, NODES] = 3 * bar.loss[node]  # a neighbour of thrice the bulk, thrice as hot, slower or faster
        heat[:, NODES] = 9 * bar.heat[node]
        capacity[:, NODES] = 3 / fraction if other else 3 * fraction
    elif effect == "ambient":
        room += sign * s * (after if other else GRID / GRID[-1])
    elif effect == "friction_decay":
        now = 1 + s * np.exp(-GRID / decay)
    elif effect == "sensor_lag":
        lag = np.where(s > 0, s * np.linspace(0.9, 1.1, SENSORS), lag)
    elif effect == "nonlinear_loss":
        exponent = np.where(sizes > 0, 1 + sizes, exponent)
    elif effect == "sensor_drift":
        added[:, sensor] = sign * s * GRID / 60
    elif effect == "reading_jump":
        added[:, sensor] = sign * s * after
    elif effect == "cooling_switch":
        fan *= 1 + s * after
    elif effect == "load_step":
        load *= 1 + sign * s * after
    elif effect == "cyclic_load":
        wave = np.sin(2 * np.pi * (GRID / period + phase))
        now = 1 + s * (np.where(wave >= 0, 1.0, -1.0) if other else wave)
    elif effect == "transport_delay":
        now = np.clip((GRID - s) / STEP + 1, 0.0, 1.0)
    link[:, :NODES, NODES] = link[:, NODES, :NODES] = couple
    link[:, range(NODES), range(NODES)] -= couple
    link[:, NODES, NODES] = -couple.sum(axis=1)
    return _Drive(room, load * now, load, fan, loss, heat, capacity, link, exponent, lag, added), start


def _slope(drive: _Drive, state: Array, room: Array, load: Array, fan: Array) -> Array:
    """Warming (K, 16), K/min, at a state (K, 16), degC, with inputs (K, 1)."""
    rise = state - room
    lost = drive.loss * fan * rise * (np.abs(rise) / REFERENCE) ** (drive.exponent[:, None] - 1)
    return np.asarray((drive.heat * load - lost + (drive.link @ state[:, :, None])[:, :, 0]) / drive.capacity)


def march(drive: _Drive, start: Array) -> Array:
    """Temperatures (K, 16, G), degC, on the grid from a start (K, 16) by Heun's rule."""
    inputs = [np.ascontiguousarray(part.T)[:, :, None] for part in (drive.room, drive.load, drive.fan)]
    count = len(inputs[0])
    states = np.empty((count, *start.shape))
    states[0] = state = start
    for k in range(count - 1):
        first = _slope(drive, state, inputs[0][k], inputs[1][k], inputs[2][k])
        ahead = _slope(drive, state + STEP * first, inputs[0][k + 1], inputs[1][k + 1], inputs[2][k + 1])
        state = state + STEP / 2 * (first + ahead)
        states[k + 1] = state
    return np.moveaxis(states, 0, -1)


def settle(drive: _Drive, stride: int) -> Array:
    """Steady temperatures (m, 16), degC, of the first variant with its inputs frozen at every `stride`-th grid time."""
    room, load, fan = (part[0, ::stride, None] for part in (drive.room, drive.settled, drive.fan))
    link, power = drive.link[0], drive.exponent[0] - 1
    state = room + REFERENCE * np.ones(NODES + 1)
    spare = 1e-6 * (np.arange(NODES + 1) == NODES)  # an unused sixteenth node must not make the matrix singular
    for _ in range(40):
        rise = state - room
        steep = drive.loss[0] * fan * (np.abs(rise) / REFERENCE) ** power
        wrong = drive.heat[0] * load - steep * rise + state @ link
        matrix = -link + np.eye(NODES + 1) * ((1 + power) * steep + spare)[:, None, :]
        change = np.linalg.solve(matrix, wrong[:, :, None])[:, :, 0]
        state = state + change
        if np.abs(change).max() < 1e-8:
            break
    return np.asarray(state)


def _readings(bar: _Bar, drive: _Drive, start: float) -> Array:
    """Measured points (K, 3, G), degC, after the probes' lag."""
    states = march(drive, np.full((len(drive.room), NODES + 1), start))[:, bar.nodes]
    return np.array(
        [[lagged(c, lag) for c, lag in zip(rows, lags, strict=True)] for rows, lags in zip(states, drive.lag, strict=True)]
    )


def simulate(
    seed: int, background: float = 1.0, effect: str | None = None, runs: int = 1, exact: bool = False, load_spread: float = 0.0
) -> Machine:
    """Machine of a seed, run `runs` times. `background` multiplies every imperfection; `effect` is one of `EFFECTS`; `exact`
    gives one exponential per sensor. Runs after the first have loads within +-`load_spread` (a share) of the first's.
    """
    common.allow(effect, exact)
    bar, records, sized = _draw(seed, background), [], common.Sized(background=background)
    if effect is not None:

        def curves(amount: float, draw: int, sizes: Array) -> Array:
            trial = _draw(seed, amount)
            drive, start = _drive(trial, seed, 0, 1.0, effect, sizes, draw)
            return _readings(trial, drive, start) + drive.added

        sized = common.scale_effect(seed, effect, curves, background, _sensor(seed), bar.noise)
        bar = _draw(seed, sized.background)
    each = slice(None, None, bar.every)
    for run, level in enumerate(common.levels(seed, runs, load_spread)):
        rng = np.random.default_rng([seed, 16, run])
        if exact:
            rises = np.asarray(level * np.linalg.solve(np.diag(bar.loss) - bar.link, bar.heat)[bar.nodes], dtype=np.float64)
            records.append(common.exact_run(rng, GRID[each], bar.rate, rises, bar.noise, level))
            continue
        drive, start = _drive(bar, seed, run, level, effect, np.array([sized.size]), sized.draw)
        points = _readings(bar, drive, start)[0]
        reading = (points + drive.added[0])[:, each]
        reading = reading + bar.noise * rng.standard_normal(reading.shape)
        reading = np.round(reading / bar.step) * bar.step if bar.step else reading
        limit = np.ascontiguousarray(settle(drive, bar.every)[:, bar.nodes].T)
        beside = None
        if effect == "neighbour_heat":
            state = march(drive, np.full((1, NODES + 1), start))[0, NODES, each]
            beside = np.asarray(state + bar.noise * rng.standard_normal(state.shape))
        records.append(Record(GRID[each], reading, points[:, each], drive.room[0, each], limit, level, beside))
    return Machine(seed, effect, tuple(records), sized.size, sized.ratio, 0.0 if exact else sized.background, bar.noise)


if __name__ == "__main__":
    common.check(simulate)
