"""Where a logged room goes after its last reading, and what that does to the sensors in it.

Of a limit the room at the last reading is part of the definition; a temperature at a named time depends on what the room does until
then. Its past says how much it moves, how fast and how smoothly: a stationary Gaussian process about an unknown level, averaged
over its size, its memory and its smoothness (Matern covariances of order 1/2 and 3/2; Rasmussen & Williams 2006, Gaussian Processes
for Machine Learning, ch. 2 and 4). Stationary, because a room comes back in the end: a random walk, or a line drawn on, does not.
"""

import numpy as np
from numpy.typing import NDArray

from ..imperfection import lagged, room_at_end

Array = NDArray[np.float64]

#: Memories of a room that are looked at, from the swing of a thermostat to days [min], and sizes (1 sd) [K].
MEMORIES, SIZES = np.geomspace(8.0, 2500.0, 9), np.geomspace(0.02, 4.0, 10)
#: Over days rooms move by about this much, 1 sd [K], times or over e ** FACTOR (1 sd). The level is known to LEVEL [K].
USUAL, FACTOR, LEVEL = 1.0, 0.8, 10.0
#: A room is no better known than this [K]: one thermometer is not the air about the machine.
LEAST_NOISE = 0.02
#: Means over which the past is taken, and points of the time ahead.
MEANS, POINTS = 16, 24
#: The same of paths that are drawn.
STEPS = 72
#: Fewer readings say nothing of how a room moves.
FEWEST = 8


def room_ahead(when: Array, room: Array, rate: Array, until: float) -> tuple[Array, Array]:
    """What a room moves sensors of rates (S,) [1/min] by until a time [min], against one that stays: (mean, deviation) (S,) [K].

    A rate of inf follows at once. room (n,) [degC] was logged at `when` (n,) [min], in order; nothing moves where `until` is no
    later than its last reading.
    """
    none = np.zeros(len(rate))
    if until <= when[-1] or len(room) < FEWEST or when[-1] <= when[0]:
        return none, none
    ahead = (until - when[-1]) * np.arange(1, POINTS + 1) / POINTS
    mean, covariance = _path(when - when[-1], room, ahead)
    answer = _answers(rate, float(ahead[0]), POINTS)[:, :, -1].T
    return answer @ mean, np.sqrt(np.maximum(np.einsum("sp,pq,sq->s", answer, covariance, answer), 0.0))


def room_paths(when: Array, room: Array, rate: Array, times: Array, draws: int) -> Array:
    """What rooms that go on as this one did move sensors of rates (S,) [1/min] by at times (k,) [min], to either side of one that
    stays: (S, draws, k) [K].

    room (n,) [degC] was logged at `when` (n,) [min]; until its last reading, and where too little of it is known, nothing moves.
    """
    found = np.zeros((len(rate), draws, len(times)))
    until = float(times.max(initial=when[-1]))
    if until <= when[-1] or len(room) < FEWEST or when[-1] <= when[0]:
        return found
    ahead = (until - when[-1]) * np.arange(1, STEPS + 1) / STEPS
    covariance = _path(when - when[-1], room, ahead)[1]
    size, along = np.linalg.eigh(covariance)
    paths = np.random.default_rng(0).standard_normal((draws, STEPS)) @ (along * np.sqrt(np.maximum(size, 0.0))).T
    answer = _answers(rate, float(ahead[0]), STEPS)
    later = times > when[-1]
    place = np.clip((times[later] - when[-1]) / ahead[0], 0.0, STEPS - 1e-9)
    below = place.astype(np.intp)
    for i in range(len(rate)):
        moved = paths @ answer[:, i]
        found[i][:, later] = moved[:, below] + (place - below) * (moved[:, below + 1] - moved[:, below])
    return found


def _answers(rate: Array, step: float, points: int) -> Array:
    """How sensors of rates (S,) [1/min] follow a path that starts at nothing and is straight between its points, `step` [min]
    apart: (p, S, p + 1) for each point alone at 1.
    """
    hats = np.concatenate([np.zeros((points, 1)), np.eye(points)], axis=1)
    return np.array([lagged(np.minimum(rate, 1e6), step, hat) for hat in hats])


def _path(when: Array, room: Array, ahead: Array) -> tuple[Array, Array]:
    """(mean (p,), covariance (p, p)) of a room at times ahead (p,) [min] of its last reading, less what it is then."""
    several = np.array_split(np.arange(len(room)), min(MEANS, len(room) // 2))
    last = room_at_end(when, room)
    time = np.array([*(when[some].mean() for some in several), when[-1]])
    moved = np.array([*(room[some].mean() for some in several), last]) - last
    jitter = float(np.std(np.diff(room))) / np.sqrt(2.0 * len(room) / len(several))
    noise = (LEAST_NOISE**2 + jitter**2) * np.eye(len(time))
    every = np.concatenate([time, ahead])
    apart = np.abs(every[:, None] - every) / MEMORIES[:, None, None]
    smooth = np.sqrt(3.0) * apart
    alike = np.concatenate([np.exp(-apart), (1.0 + smooth) * np.exp(-smooth)])
    # One hypothesis after the other: kinds of memory by sizes.
    whole = (SIZES[None, :, None, None] ** 2 * alike[:, None]).reshape(-1, len(every), len(every)) + LEVEL**2
    k = len(time)
    root = np.linalg.cholesky(whole[:, :k, :k] + noise)
    white = np.linalg.solve(root, np.broadcast_to(moved[:, None], (len(root), k, 1)))[..., 0]
    told = np.linalg.solve(root, whole[:, :k, k:])
    prior = np.tile(-0.5 * (np.log(SIZES / USUAL) / FACTOR) ** 2, len(alike))
    weight = prior - 0.5 * (white**2).sum(axis=1) - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    weight = np.exp(weight - weight.max())
    weight /= weight.sum()
    means = np.einsum("hkp,hk->hp", told, white)
    mean = weight @ means
    own = whole[:, k:, k:] - told.transpose(0, 2, 1) @ told
    covariance = np.tensordot(weight, own + (means - mean)[:, :, None] * (means - mean)[:, None, :], 1)
    return mean, covariance
