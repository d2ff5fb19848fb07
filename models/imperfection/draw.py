"""Records that the prior of the discrepancy holds for likely: what a test of a design not yet made may look like."""

import numpy as np
from numpy.typing import NDArray

from .prior import COMPONENTS, Imperfection
from .shapes import Asked, covariances

Array = NDArray[np.float64]

#: Disturbances that all sensors of a run feel alike.
SHARED = ("room", "load")


def draw_record(
    prior: Imperfection, time: Array, tau: float, rises: Array, noise: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """(readings, true limits), (S, n) and (S,) [K above the beginning]: law, background of the prior and white noise.

    time (n,) [min] from nought on; tau [min], of all but for the prior's spread; rises (S,) [K]; noise (S,) or a number [K].
    """
    found = covariances(np.full(2, 1.0 / tau), time, float(time[-1]), tau / 60.0, Asked(np.zeros(0)))[0]
    rows = len(time) + 1  # the readings and the limit
    relative, absolute = prior.background.scaled(prior.multiplier).variances()
    common, own = np.zeros((rows, rows)), np.zeros((rows, rows))
    room = np.zeros((rows, rows))
    for i, name in enumerate(COMPONENTS):
        part = found[i, :rows, :rows]
        if name == "room":
            room += absolute[i] * part
        elif name in SHARED:
            common += relative[i] * part
        else:
            own += relative[i] * part
    tiny = 1e-12 * np.eye(rows)
    of_room, of_load, of_own = (np.linalg.cholesky(k + tiny) for k in (room, common, own))
    sensors = len(rises)
    swing, air = of_load @ rng.standard_normal(rows), of_room @ rng.standard_normal(rows)
    beside = rises[:, None] * (swing + (of_own @ rng.standard_normal((rows, sensors))).T) + air
    own_tau = tau * np.exp(prior.rate_spread * rng.standard_normal((sensors, 1)))
    clean = rises[:, None] * np.concatenate([-np.expm1(-time / own_tau), np.ones((sensors, 1))], axis=1) + beside
    white = np.broadcast_to(noise, (sensors,))[:, None] * rng.standard_normal((sensors, len(time)))
    return clean[:, :-1] + white, clean[:, -1]
