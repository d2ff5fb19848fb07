"""A plate warmed by two patches: diffusion in two dimensions, so that early no sensor is near one exponential.

Independent of the estimators it tests and of the other two simulators: implicit finite volumes on 12 x 8 cells, losses that
rise a little faster than the temperature, heat conducted into a heavy foot at one edge, air that follows the day.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, identity
from scipy.sparse.linalg import splu

from benchmarks.machines import record as common
from benchmarks.machines.record import GRID, STEP, Array, Machine, Record, between

WIDE, HIGH = 12, 8
CELLS = WIDE * HIGH
SENSORS = 4
REFERENCE = 8.0  # K, rise at which the loss coefficients hold


def _operator(rng: np.random.Generator, tau: float) -> tuple[Array, Array, list[int]]:
    """Rates (CELLS + 1, CELLS + 1) [1/min] of cells and foot, heat (CELLS + 1,) [K/min] at nominal load, cells of the sensors."""
    loss = np.exp(0.15 * rng.standard_normal(CELLS)) / tau
    spread = between(rng, 4.0, 40.0) / tau * CELLS / 10.0  # how fast heat crosses a cell against how fast it is lost
    rows, columns, rates = [], [], []
    for y in range(HIGH):
        for x in range(WIDE):
            i = y * WIDE + x
            for near in ([i + 1] if x + 1 < WIDE else []) + ([i + WIDE] if y + 1 < HIGH else []):
                rows += [i, near]
                columns += [near, i]
                rates += [spread, spread]
    matrix = coo_matrix((rates, (rows, columns)), shape=(CELLS, CELLS)).toarray()
    matrix -= np.diag(matrix.sum(axis=1) + loss)
    whole = np.zeros((CELLS + 1, CELLS + 1))
    whole[:CELLS, :CELLS] = matrix
    heavy, link = between(rng, 5.0, 30.0), between(rng, 0.02, 0.15) / tau * WIDE
    edge = np.arange(WIDE)
    whole[edge, edge] -= link
    whole[edge, CELLS] += link
    whole[CELLS, edge] += link / heavy
    whole[CELLS, CELLS] -= link * WIDE / heavy + 1.0 / (tau * rng.uniform(1.0, 3.0))
    heat = np.zeros(CELLS + 1)
    for _ in range(2):
        x, y = rng.integers(1, WIDE - 2), rng.integers(2, HIGH - 1)
        patch = [(y + a) * WIDE + x + b for a in (-1, 0) for b in (0, 1)]
        heat[patch] += rng.uniform(0.4, 1.0)
    sensors = rng.choice(np.arange(WIDE, CELLS), SENSORS, replace=False).tolist()
    return whole, heat, sensors


def _settled(rates: Array, heat: Array, loss: Array, exponent: float) -> Array:
    """Where every cell settles above the air at nominal load; a load near it moves this in proportion."""
    over = -np.linalg.solve(rates, heat)
    for _ in range(40):
        over = np.linalg.solve(rates, _extra(over, loss, exponent) - heat)
    return np.asarray(over)


def _extra(over: Array, loss: Array, exponent: float) -> Array:
    """What cells lose beyond a linear loss [K/min]."""
    return np.asarray(loss * (np.sign(over) * np.abs(over / REFERENCE) ** exponent * REFERENCE - over))


def simulate(
    seed: int, background: float = 1.0, effect: str | None = None, runs: int = 1, exact: bool = False, load_spread: float = 0.0
) -> Machine:
    """Machine of a seed, run `runs` times; `background` multiplies what the air and the load do. It has no effects of a catalogue.

    Raises
    ------
    ValueError: an effect, or an exact machine: there is none of that here.
    """
    if effect is not None or exact:
        raise ValueError("the plate has its background only")
    rng = np.random.default_rng([seed, 31])
    tau = between(rng, 25.0, 100.0)
    rates, heat, sensors = _operator(rng, tau)
    rise = -np.linalg.solve(rates, heat)
    heat *= between(rng, 4.0, 15.0) / rise[sensors].max()
    noise, step = between(rng, 0.01, 0.04), float(rng.choice([0.0, 0.01, 0.05]))
    exponent, every = rng.uniform(1.0, 1.06), int(rng.choice([1, 2]))
    loss = -rates[:CELLS].sum(axis=1)
    loss[loss < 1e-12] = 0.0
    solve = splu((identity(CELLS + 1) - STEP * coo_matrix(rates)).tocsc()).solve
    records = []
    for run, level in enumerate(common.levels(seed, runs, load_spread)):
        mine = np.random.default_rng([seed, 32, run])
        slope = background * mine.uniform(0.0, 0.2) / 60.0
        air = mine.uniform(18.0, 25.0) + slope * 230.0 * np.sin(2 * np.pi * (GRID / 1440.0 + mine.random()))
        air = air + background * 0.05 * common.coloured(mine, mine.uniform(20.0, 90.0), GRID.size)
        share = level * (1.0 + background * between(mine, 0.003, 0.012) * common.coloured(mine, mine.uniform(5.0, 40.0), GRID.size))
        state = np.full(CELLS + 1, air[0]) + background * mine.uniform(0.0, 0.3) * mine.random(CELLS + 1)
        states = np.empty((GRID.size, CELLS + 1))
        states[0] = state
        bent = np.append(loss, 0.0)
        for k in range(1, GRID.size):
            over = state - air[k]
            state = air[k] + solve(over + STEP * (heat * share[k] - _extra(over, bent, exponent)))
            states[k] = state
        limit = air[:, None] + _settled(rates, heat, bent, exponent)[sensors] * share[:, None]
        each = slice(None, None, every)
        clean = states[:, sensors].T[:, each]
        reading = clean + noise * mine.standard_normal(clean.shape)
        reading = np.round(reading / step) * step if step else reading
        records.append(Record(GRID[each], reading, clean, air[each], np.ascontiguousarray(limit[each].T), level))
    return Machine(seed, None, tuple(records), 0.0, 1.0, background, noise)
