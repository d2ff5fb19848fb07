"""Displacement of a machine from its temperatures: a discrete Bayesian network, least squares, and which of the two to trust.

Source: Bayesian network modelling of the thermal error of numerically controlled machine tools, part 4 of the collection
"Error modelling" (equations (1)-(3), sections 2.2 and 2.3). The paper does not say that it left any readings out of the fit;
here every figure comes from contiguous blocks of readings left out, since neighbours in time are alike. Everything that is chosen
(components, sensors, number of states, width of the intervals) is chosen inside the readings that are left in.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
States = NDArray[np.int64]

#: Contiguous blocks a record is cut into, for scoring and, inside what is left in, for choosing.
BLOCKS = 8
#: Readings below which a block says nothing of its own.
READINGS_PER_BLOCK = 10
#: Share of a block's length left unused on either side of it, as a reading next to the block is all but in it.
GUARD = 0.1
#: Numbers of states among which the network chooses; the paper takes 6 for the displacement.
BINS = (4, 6, 9, 14, 20)
#: Parents of the displacement, at most: the paper has three (ambient, front bearing, motor).
MOST_PARENTS = 3
#: A further component or parent must lower the held-out mean square error by this share.
WORTH = 0.02
#: Two-sided 95 % point of the normal distribution.
NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Prediction:
    """Displacement (N,) [um] and its standard deviation (N,) [um]; mean +- 1.96 deviations is meant to hold 95 %."""

    mean: Array
    deviation: Array
    note: str = ""


class Model(Protocol):
    """What both models can do."""

    def predict(self, temperatures: Array) -> Prediction:
        """Displacement at temperatures (N, S) [degC]."""
        ...


#: From temperatures (N, S) [degC] and displacement (N,) [um] to a model.
Fitter = Callable[[Array, Array], Model]


@dataclass(frozen=True)
class LinearModel:
    """Straight-line dependence on the leading principal components of the temperatures.

    centre (S,) [degC], slope (S,) [um/K] and offset [um]: displacement = offset + (T - centre) slope.
    whitening (S, components): (T - centre) whitening has unit variance; readings: number fitted;
    noise [um]: deviation of a prediction at the centre, from readings left out.
    """

    centre: Array
    slope: Array
    offset: float
    whitening: Array
    readings: int
    noise: float = math.nan

    @property
    def components(self) -> int:
        """Number of principal components in use."""
        return int(self.whitening.shape[1])

    def leverage(self, temperatures: Array) -> Array:
        """Variances (N,) of the fitted line, per unit of the noise variance, that grow with the distance from what was fitted.

        Errors of neighbours are alike: a record counts for no more than READINGS_PER_BLOCK readings in each block.
        """
        far = (temperatures - self.centre) @ self.whitening
        return np.asarray((1.0 + (far**2).sum(axis=1)) / min(self.readings, BLOCKS * READINGS_PER_BLOCK))

    def predict(self, temperatures: Array) -> Prediction:
        """Displacement at temperatures (N, S) [degC]."""
        mean = self.offset + (temperatures - self.centre) @ self.slope
        return Prediction(mean, self.noise * np.sqrt(1.0 + self.leverage(temperatures)))


@dataclass(frozen=True)
class NetworkModel:
    """Discrete Bayesian network: the displacement's class given the states of its parents, a few of the temperatures.

    With every temperature read, arcs between the temperatures do not change what is predicted, so only the displacement's own
    table is kept. parents: columns of the temperatures, the most telling first; edges (parents, states + 1) [degC];
    class_edges (classes + 1,) [um]; class_mean and class_variance (classes,) [um, um^2] of the readings in a class;
    tables[j] (states ** j, classes): probabilities given the first j parents; spread: factor on the deviation, from readings
    left out.
    """

    parents: tuple[int, ...]
    edges: Array
    class_edges: Array
    class_mean: Array
    class_variance: Array
    tables: tuple[Array, ...]
    spread: float = 1.0

    def probabilities(self, temperatures: Array) -> Array:
        """Probabilities (N, classes) at temperatures (N, S) [degC].

        A temperature outside its domain is in no state: it and the less telling parents behind it are taken as not read.
        """
        result = np.repeat(self.tables[0], len(temperatures), axis=0)
        known = np.ones(len(temperatures), dtype=bool)
        joint = np.zeros(len(temperatures), dtype=np.int64)
        for parent, edges, table in zip(self.parents, self.edges, self.tables[1:], strict=True):
            state = states_of(temperatures[:, parent], edges)
            known &= state >= 0
            joint = joint * (len(edges) - 1) + np.maximum(state, 0)
            result[known] = table[joint[known]]
        return result

    def predict(self, temperatures: Array) -> Prediction:
        """Expected value and deviation over the classes at temperatures (N, S) [degC]."""
        p = self.probabilities(temperatures)
        mean = p @ self.class_mean
        variance = (p * (self.class_variance + (self.class_mean - mean[:, None]) ** 2)).sum(axis=1)
        return Prediction(mean, self.spread * np.sqrt(variance))


def equal_width_edges(values: Array, states: int) -> Array:
    """Edges (states + 1,) of equal intervals, closed on the left, that hold all values (section 2.3)."""
    low, high = float(values.min()), float(values.max())
    edges = np.linspace(low, max(high, low + 1e-9 * max(abs(low), 1.0)), states + 1)
    # The greatest value lies inside the last interval, which is open on the right; the other edges stay where they are, as the
    # readings of a coarse sensor lie on them.
    edges[-1] = np.nextafter(edges[-1], np.inf)
    return edges


def states_of(values: Array, edges: Array) -> States:
    """States (N,) of values (N,); -1 outside the domain."""
    state = np.searchsorted(edges, values, side="right") - 1
    return np.asarray(np.where((state < 0) | (state >= len(edges) - 1), -1, state), dtype=np.int64)


def conditional_table(joint: States, classes: States, prior: Array) -> Array:
    """Probabilities (parent states, classes), equation (1): (prior + counts) / their sum over the classes.

    joint (N,): state of all parents together; classes (N,): that of the child; prior (parent states, classes): the exponents
    N' of the Dirichlet distribution, which the paper sets to 1 throughout.
    """
    counts = np.bincount(joint * prior.shape[1] + classes, minlength=prior.size).reshape(prior.shape)
    weight = prior + counts
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def blocks_of(readings: int, blocks: int = BLOCKS) -> list[tuple[Mask, Mask]]:
    """For each contiguous block: readings left in (N,) and readings left out (N,); between them a strip that is neither."""
    edges = np.linspace(0, readings, blocks + 1).astype(int)
    found = []
    for a, b in itertools.pairwise(edges):
        strip = math.ceil(GUARD * (b - a))
        left_in, left_out = np.ones(readings, dtype=bool), np.zeros(readings, dtype=bool)
        left_in[max(a - strip, 0) : b + strip] = False
        left_out[a:b] = True
        found.append((left_in, left_out))
    return found


def fit_least_squares(temperatures: Array, displacement: Array, components: int | None = None) -> LinearModel:
    """Least squares on principal components of temperatures (N, S) [degC]; displacement (N,) [um].

    The temperatures of one machine are all but collinear: plain least squares spends its freedom on their noise. All are in
    kelvin with like noise, so that they are not rescaled. The number of components, unless given, is the least whose error on
    blocks left out is all but the smallest. Raises ValueError on shapes that do not fit, values that are not finite or too few
    readings.
    """
    temperatures, displacement = checked(temperatures, displacement)
    most = min(temperatures.shape[1], len(displacement) // (2 * READINGS_PER_BLOCK))
    counts = range(most + 1) if components is None else range(components, components + 1)
    errors, scaled = {}, {}
    folds = blocks_of(len(displacement))
    models = [_components(temperatures[i], displacement[i], counts) for i, _ in folds]
    for n, k in enumerate(counts):
        error = [
            displacement[out] - m[n].offset - (temperatures[out] - m[n].centre) @ m[n].slope
            for m, (_, out) in zip(models, folds, strict=True)
        ]
        errors[k] = float((np.concatenate(error) ** 2).mean())
        scaled[k] = np.concatenate(
            [e / np.sqrt(1.0 + m[n].leverage(temperatures[out])) for e, m, (_, out) in zip(error, models, folds, strict=True)]
        )
    best = _least(errors)
    return replace(_components(temperatures, displacement, range(best, best + 1))[0], noise=calibrated(scaled[best]))


def _components(temperatures: Array, displacement: Array, counts: range) -> list[LinearModel]:
    """Models with these numbers of components, of one decomposition."""
    centre, offset = temperatures.mean(axis=0), float(displacement.mean())
    left, size, right = np.linalg.svd(temperatures - centre, full_matrices=False)
    use = size > 1e-10 * max(float(size[0]), 1.0)  # a direction in which nothing moves has no slope
    along = right[use].T / size[use]
    score = left[:, use].T @ (displacement - offset)
    n = len(displacement)
    return [LinearModel(centre, along[:, :k] @ score[:k], offset, along[:, :k] * math.sqrt(n), n) for k in counts]


def fit_network(temperatures: Array, displacement: Array, bins: int | None = None, prior: float = 1.0) -> NetworkModel:
    """Network of temperatures (N, S) [degC] and displacement (N,) [um], each in `bins` states of equal width.

    The paper names the parents and the states by hand; here at most three parents and, unless given, the number of states are
    those with the least error on blocks left out. The prior of a table is the table with one parent less, weighing `prior`
    readings for each parent state, so that a parent state never seen answers with what the better known parents say; with no
    parent it is uniform. (The paper's N' = 1 for every class, six readings in all, drowns a parent state seen three times.)
    Raises ValueError as fit_least_squares, and on fewer than 2 states or a prior not above 0.
    """
    temperatures, displacement = checked(temperatures, displacement)
    if bins is not None and bins < 2:
        raise ValueError("a network needs at least 2 states")
    if not prior > 0.0:
        raise ValueError("the prior must weigh more than nothing")
    folds = blocks_of(len(displacement))
    found = {}
    for states in BINS if bins is None else (bins,):
        trials = [_Trial(temperatures, displacement, fold, states, prior) for fold in folds]
        found[states] = _choose_parents(trials, temperatures.shape[1])
    states = _least({n: error for n, (error, _) in found.items()})
    parents = found[states][1]
    ratios = []
    for left_in, left_out in folds:
        predicted = _network(temperatures[left_in], displacement[left_in], parents, states, prior).predict(temperatures[left_out])
        ratios.append((displacement[left_out] - predicted.mean) / predicted.deviation)
    model = _network(temperatures, displacement, parents, states, prior)
    # Blocks left out lie mostly inside the domain: they are no licence to claim more than the table does outside of it.
    return replace(model, spread=max(1.0, calibrated(np.concatenate(ratios))))


def _network(temperatures: Array, displacement: Array, parents: tuple[int, ...], states: int, prior: float) -> NetworkModel:
    """The network with these parents and numbers of states."""
    edges = np.array([equal_width_edges(temperatures[:, p], states) for p in parents]).reshape(len(parents), states + 1)
    class_edges = equal_width_edges(displacement, states)
    classes = states_of(displacement, class_edges)
    joint = np.zeros(len(displacement), dtype=np.int64)
    tables = [conditional_table(joint, classes, np.full((1, states), prior / states))]
    for parent, own in zip(parents, edges, strict=True):
        joint = joint * states + states_of(temperatures[:, parent], own)
        tables.append(conditional_table(joint, classes, prior * np.repeat(tables[-1], states, axis=0)))
    return NetworkModel(parents, edges, class_edges, *_class_moments(displacement, classes, class_edges), tuple(tables))


def _class_moments(displacement: Array, classes: States, edges: Array) -> tuple[Array, Array]:
    """Mean and variance (classes,) of the readings in each class, one uniform over the class weighing as much as one reading."""
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    weight = 1.0 + np.bincount(classes, minlength=len(middle))
    mean = (middle + np.bincount(classes, displacement, len(middle))) / weight
    square = np.bincount(classes, (displacement - mean[classes]) ** 2, len(middle))
    return mean, (width**2 / 12.0 + (middle - mean) ** 2 + square) / weight


class _Trial:
    """One block left out, while parents are being chosen: what has been learned from the others, and what is said of it."""

    def __init__(self, temperatures: Array, displacement: Array, fold: tuple[Mask, Mask], states: int, prior: float) -> None:
        left_in, left_out = fold
        edges = [equal_width_edges(column, states) for column in temperatures[left_in].T]
        self.seen = np.array([states_of(c, e) for c, e in zip(temperatures[left_in].T, edges, strict=True)])
        self.asked = np.array([states_of(c, e) for c, e in zip(temperatures[left_out].T, edges, strict=True)])
        self.truth, self.states, self.prior = displacement[left_out], states, prior
        class_edges = equal_width_edges(displacement[left_in], states)
        self.classes = states_of(displacement[left_in], class_edges)
        self.class_mean = _class_moments(displacement[left_in], self.classes, class_edges)[0]
        self.joint = np.zeros(len(self.classes), dtype=np.int64)
        self.place = np.zeros(len(self.truth), dtype=np.int64)  # -1 once a parent is outside its domain
        self.table = conditional_table(self.joint, self.classes, np.full((1, states), prior / states))
        self.mean = np.full(len(self.truth), float(self.table[0] @ self.class_mean))

    def with_parent(self, parent: int) -> tuple[States, States, Array, Array]:
        """Joint states seen and asked, table and prediction if this parent is added."""
        joint = self.joint * self.states + self.seen[parent]
        known = (self.place >= 0) & (self.asked[parent] >= 0)
        place = np.where(known, self.place * self.states + self.asked[parent], -1)
        table = conditional_table(joint, self.classes, self.prior * np.repeat(self.table, self.states, axis=0))
        return joint, place, table, np.where(known, table[place] @ self.class_mean, self.mean)

    def squares(self, parent: int) -> float:
        """Sum of squared errors on the block if this parent is added."""
        return float(((self.with_parent(parent)[3] - self.truth) ** 2).sum())

    def add(self, parent: int) -> None:
        """Take this parent."""
        self.joint, self.place, self.table, self.mean = self.with_parent(parent)


def _choose_parents(trials: list[_Trial], sensors: int) -> tuple[float, tuple[int, ...]]:
    """Held-out mean square error [um^2] and parents, added one by one for as long as each is worth it.

    No more parent states than readings: beyond that a table is mostly prior, and costly (section 2.3).
    """
    readings = sum(len(t.truth) for t in trials)
    error = sum(float(((t.mean - t.truth) ** 2).sum()) for t in trials) / readings
    parents: tuple[int, ...] = ()
    while len(parents) < min(MOST_PARENTS, sensors) and trials[0].states ** (len(parents) + 1) <= readings:
        errors = {s: sum(t.squares(s) for t in trials) / readings for s in range(sensors) if s not in parents}
        best = min(errors, key=errors.__getitem__)
        if errors[best] > (1.0 - WORTH) * error:
            break
        error, parents = errors[best], (*parents, best)
        for trial in trials:
            trial.add(best)
    return error, parents


def _least(errors: dict[int, float]) -> int:
    """The smallest size whose error is all but the least."""
    least = min(errors.values())
    return min(size for size, error in errors.items() if error * (1.0 - WORTH) <= least)


def calibrated(ratios: Array) -> float:
    """Factor with which +-1.96 deviations hold 95 % of held-out errors, given over deviations (N,); no less than their spread."""
    return max(float(np.quantile(np.abs(ratios), 0.95)) / NORMAL_95, float(np.sqrt((ratios**2).mean())))


def standard(columns: Array) -> tuple[Array, Array]:
    """Mean and deviation (S,) of columns (N, S); inf where one stands still, so that it says nothing should it move later."""
    centre, scale = columns.mean(axis=0), columns.std(axis=0)
    return centre, np.where(scale > 1e-9 * np.maximum(1.0, np.abs(centre)), scale, np.inf)


def checked(temperatures: Array, displacement: Array) -> tuple[Array, Array]:
    """Both as arrays of floats; ValueError where nothing can be learned from them."""
    temperatures, displacement = np.asarray(temperatures, dtype=float), np.asarray(displacement, dtype=float)
    if temperatures.ndim != 2 or displacement.shape != temperatures.shape[:1] or temperatures.shape[1] < 1:
        raise ValueError("temperatures must be (readings, sensors) and displacement (readings,)")
    if not (np.isfinite(temperatures).all() and np.isfinite(displacement).all()):
        raise ValueError("temperatures and displacement must be finite: leave out readings with gaps")
    if len(displacement) < BLOCKS:
        raise ValueError(f"{len(displacement)} readings: at least {BLOCKS} are needed, one for each block")
    return temperatures, displacement
