"""A back-propagation network whose weights a particle swarm starts: part 5 of the collection "Error modelling" (PSO-BP).

30 hidden neurons, ten particles and learning factors of 1.49445 as printed. Of positions within +-5, as printed, ten generations
find no start better than the mean of the readings (tests/published/test_003_neural.py): weights of that size drive the neurons to
their ends. Within +-1 a hundred generations do. The inertia is not printed; the factors belong to Clerc & Kennedy's 0.729. Training
is scikit-learn's, by L-BFGS with a weight decay: on a few hundred readings it ends where gradient descent would go in many
thousand steps, from any start. Needs the extra ``thermofast[neural]``.
"""

import warnings
from typing import Any

import numpy as np

from .fits import Array, Mask, Prediction, calibrated, standard
from .sample import Sample

HIDDEN, PARTICLES, GENERATIONS = 30, 10, 100
LEARNING, INERTIA, FARTHEST = 1.49445, 0.729, 1.0
#: Largest velocity, as a share of the farthest position.
FASTEST = 0.2
#: Weight decay of the training, in units of the standardised columns, and its steps.
DECAY, STEPS = 1.0, 400
#: Rows that a net is trained on at most.
MOST_ROWS = 1500
INNER = 4


def neural_network(sample: Sample, used: Mask) -> Prediction:
    """What the net says of every reading. ValueError where scikit-learn is missing or the readings are too few."""
    rows = np.flatnonzero(used)
    if len(rows) < 2 * HIDDEN:
        raise ValueError(f"a net of {HIDDEN} neurons needs {2 * HIDDEN} readings, {len(rows)} are there")
    rows = rows[:: -(-len(rows) // MOST_ROWS)]
    centre, scale = standard(sample.temperatures[rows])
    low, size = float(sample.displacement[rows].mean()), max(float(sample.displacement[rows].std()), 1e-12)
    inputs, output = (sample.temperatures - centre) / scale, (sample.displacement - low) / size
    start, fitness = swarm(inputs[rows], output[rows])
    errors = []
    for out in np.array_split(rows, INNER):
        inner = np.setdiff1d(rows, out)
        errors.append(trained(inputs[inner], output[inner], start).predict(inputs[out]) - output[out])
    mean = low + size * trained(inputs[rows], output[rows], start).predict(inputs)
    note = "" if fitness < 1.0 else "a swarm that did not converge: no start of its is better than the mean"
    return Prediction(mean, np.full(len(mean), size * calibrated(np.concatenate(errors))), note)


def trained(inputs: Array, output: Array, start: Array | None, steps: int = STEPS) -> Any:
    """scikit-learn's net after training from these weights, or from its own random ones.

    Raises ValueError where scikit-learn is not installed.
    """
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor
    except ImportError:
        raise ValueError("the neural network needs scikit-learn: pip install 'thermofast[neural]'") from None
    net = MLPRegressor(
        hidden_layer_sizes=(HIDDEN,), activation="tanh", solver="lbfgs", alpha=DECAY, max_iter=1, warm_start=True, random_state=0
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        net.fit(inputs, output)
        if start is not None:
            net.coefs_, net.intercepts_ = _layers(start, inputs.shape[1])
        net.set_params(max_iter=steps)
        net.fit(inputs, output)
    return net


def swarm(
    inputs: Array, output: Array, seed: int = 0, farthest: float = FARTHEST, generations: int = GENERATIONS
) -> tuple[Array, float]:
    """(weights (w,), mean square error) of the best start that a swarm finds, of standardised inputs (N, S) and output (N,)."""
    rng, fastest = np.random.default_rng(seed), FASTEST * farthest
    size = HIDDEN * (inputs.shape[1] + 2) + 1
    place = rng.uniform(-farthest, farthest, (PARTICLES, size))
    speed = rng.uniform(-fastest, fastest, (PARTICLES, size))
    best, least = place.copy(), np.array([_error(p, inputs, output) for p in place])
    for _ in range(generations):
        leader = best[int(np.argmin(least))]
        own, all_ = rng.random((2, PARTICLES, size))
        speed = np.clip(INERTIA * speed + LEARNING * own * (best - place) + LEARNING * all_ * (leader - place), -fastest, fastest)
        place = np.clip(place + speed, -farthest, farthest)
        error = np.array([_error(p, inputs, output) for p in place])
        better = error < least
        best[better], least[better] = place[better], error[better]
    return best[int(np.argmin(least))], float(least.min())


def _layers(weights: Array, sensors: int) -> tuple[list[Array], list[Array]]:
    """Weights and thresholds of both layers from one vector: S x 30 and 30 weights, 30 and 1 thresholds."""
    first, rest = weights[: HIDDEN * sensors].reshape(sensors, HIDDEN), weights[HIDDEN * sensors :]
    return [first.copy(), rest[:HIDDEN, None].copy()], [rest[HIDDEN : 2 * HIDDEN].copy(), rest[2 * HIDDEN :].copy()]


def _error(weights: Array, inputs: Array, output: Array) -> float:
    (first, second), (inner, outer) = _layers(weights, inputs.shape[1])
    return float(np.mean((np.tanh(inputs @ first + inner) @ second[:, 0] + outer[0] - output) ** 2))
