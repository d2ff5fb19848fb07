"""A network for each minute of repeated runs, as the paper prints it: what the displacement was at this minute of other runs.

Bayesian network modelling of thermal error, part 4 of the collection "Error modelling": equations (1)-(3), sections 2.2, 2.3. Six
states of the displacement, three of each parent, Dirichlet exponents of one, the middle of the most probable state. The paper
names the parents by hand; here they are those of the network of all minutes.
"""

import numpy as np

from .fits import Array, Mask, Prediction, States, calibrated, conditional_table, equal_width_edges, fit_network, states_of
from .sample import Sample

STATES, PARENT_STATES = 6, 3
#: Runs without which no table is made.
FEWEST_RUNS = 4
#: Minutes whose tables are made, spread over the runs; between them the displacement is interpolated.
MOST_TABLES = 60
INNER = 4


def network_by_minute(sample: Sample, used: Mask) -> Prediction:
    """What the tables of each minute say of every reading; ValueError with too few runs.

    Runs of different length are told as far as FEWEST_RUNS of them go, later readings by the last table.
    """
    stretches = sample.stretches()
    have = [bool(used[rows].any()) for rows in stretches]
    if sum(have) < FEWEST_RUNS:
        raise ValueError(f"a table per minute needs {FEWEST_RUNS} runs to learn from, {sum(have)} are there")
    ends = sorted((float(sample.minutes[rows][-1]) for rows, own in zip(stretches, have, strict=True) if own), reverse=True)
    last = ends[FEWEST_RUNS - 1]
    longest = max(float(sample.minutes[rows][-1]) for rows in stretches)
    grid = np.unique(np.linspace(0.0, last, min(MOST_TABLES, max(2, int(last) + 1))))
    parents = fit_network(sample.temperatures[used], sample.displacement[used]).parents
    if not parents:
        raise ValueError("no temperature tells the displacement: a table has nothing to look up")
    inputs = np.stack([_at(sample, rows, sample.temperatures[:, list(parents)], grid) for rows in stretches])
    output = np.stack([_at(sample, rows, sample.displacement[:, None], grid)[:, 0] for rows in stretches])
    learned = np.array(have)
    told = np.stack([_tables(inputs[learned, m], output[learned, m], inputs[:, m]) for m in range(len(grid))], axis=1)
    errors = []
    for out in np.array_split(np.flatnonzero(learned), min(INNER, int(learned.sum()))):
        rest = learned.copy()
        rest[out] = False
        if rest.sum() >= 2:
            errors += [_tables(inputs[rest, m], output[rest, m], inputs[out, m]) - output[out, m] for m in range(len(grid))]
    mean = np.empty(len(sample.run))
    for i, rows in enumerate(stretches):
        mean[rows] = np.interp(sample.minutes[rows], grid, told[i])
    note = f"tables that end at {last:.4g} min, where fewer than {FEWEST_RUNS} runs go on" if longest > last + 1e-9 else ""
    return Prediction(mean, np.full(len(mean), calibrated(np.concatenate(errors))), note)


def _at(sample: Sample, rows: States, columns: Array, grid: Array) -> Array:
    """Columns (G, k) of a run at the minutes of the grid; a run that ended is held at its last reading."""
    return np.stack([np.interp(grid, sample.minutes[rows], column[rows]) for column in columns.T], axis=1)


def _tables(parents: Array, displacement: Array, asked: Array) -> Array:
    """Displacement (M,) [um] at parents asked (M, k), from those of the runs (R, k) and their displacement (R,) at this minute."""
    edges = [equal_width_edges(column, PARENT_STATES) for column in parents.T]
    classes = equal_width_edges(displacement, STATES)

    def joint(rows: Array) -> States:
        states = [
            np.clip(np.searchsorted(e, c, side="right") - 1, 0, PARENT_STATES - 1) for c, e in zip(rows.T, edges, strict=True)
        ]
        return np.asarray(np.ravel_multi_index(states, (PARENT_STATES,) * len(edges)))

    prior = np.ones((PARENT_STATES ** len(edges), STATES))
    p = conditional_table(joint(parents), states_of(displacement, classes), prior)[joint(asked)]
    middle = 0.5 * (classes[1:] + classes[:-1])
    return np.asarray(np.where(np.ptp(p, axis=1) < 1e-12, middle.mean(), middle[p.argmax(axis=1)]))
