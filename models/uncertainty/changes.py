"""What is different in a machine since other runs of it: heat, heat capacity, loss, one sensor, the contacts, the room, or nothing.

Of every run the base law gives each sensor a rate b (loss over heat capacity) and a rise R (heat over loss), in logarithms. A
change of the heat moves all rises, of the heat capacity all rates, of the loss rates up and rises down, of one sensor its own
numbers, of the contacts between parts anything; another room moves neither, but where the runs begin. Each is a line or plane
through no change; how likely each is follows from the marginal likelihood of the difference, run-to-run scatter and the errors of
the fits counted, sizes unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..joint import LEVEL, RATE, START, Fit

Array = NDArray[np.float64]

#: Deviations from run to run of the logarithms of rate and rise: common to all sensors, and of each beside the others; they count
#: as so many runs where there are more. Of simulated and real repeats; see docs/figures.md.
COMMON = 0.06, 0.05
#: Correlation of the two, because it is mostly the loss that is not the same: a fan, a draught, a cover.
TOGETHER = -0.5
OWN = 0.015, 0.015
RUNS_ASSUMED = 3.0
#: Prior deviation of the logarithm of a change, and of one sensor's or the contacts'.
SIZE, LOCAL_SIZE = 0.4, 0.2
#: Points do not all answer to a change alike: share of its size by which they differ.
UNLIKE = 0.1
#: Prior probabilities: three tests in four are repeated without anything having changed.
PRIORS = {"nothing": 0.75, "heat": 0.06, "heat capacity": 0.06, "loss": 0.06, "sensor": 0.035, "contact": 0.035}
#: Deviation of a room from run to run [K], which counts as RUNS_ASSUMED runs; prior deviation of another room; how often it is.
ROOM_SCATTER, ROOM_SIZE, OTHER_ROOM = 0.7, 5.0, 0.15


@dataclass(frozen=True)
class RunNumbers:
    """Logarithms of rate and rise (2 S,) of the sensors of a run, rates first, with their covariance (2 S, 2 S)."""

    values: Array
    covariance: Array

    @classmethod
    def of(cls, fit: Fit, wider: float, warm: Array | None = None) -> "RunNumbers | None":
        """Of a fit of the base law; `wider` multiplies its errors. None where a sensor does not rise.

        warm (S,) [K] is how much warmer, beside its room, a run may have begun than usual: by so much its rises are not known.
        """
        n, model = fit.run.sensors, fit.model
        rate, level, start = (np.asarray(fit.values[key], dtype=float) for key in (RATE, LEVEL, START))
        rise = level - start
        if not np.all(np.isfinite(rise)) or np.any(rise == 0.0):
            return None
        values, covariance = np.concatenate([np.log(rate), np.log(np.abs(rise))]), np.zeros((2 * n, 2 * n))
        at = [model.column(key) for key in (RATE, LEVEL, START)]
        for i in range(n):
            slopes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 / rise[i], -1.0 / rise[i]]])
            own = slopes @ fit.joint_covariance(i)[np.ix_(at, at)] @ slopes.T * wider**2
            covariance[np.ix_([i, n + i], [i, n + i])] = own
        # What bends a fit bends those of all sensors alike, along the ridge on which a short record leaves rate and rise.
        errors = np.sqrt(np.diag(covariance))
        bent = np.concatenate([errors[:n], -errors[n:]])
        covariance += np.outer(bent, bent)
        if warm is not None:
            hidden = np.concatenate([np.zeros(n), warm / rise])
            covariance += np.outer(hidden, hidden)
        return cls(values, covariance)


@dataclass(frozen=True)
class Change:
    """One kind of change: its probability, and the logarithm of its size with its deviation; sensor is that of a `sensor`.

    size is the factor on heat, heat capacity or loss; of a sensor the factor on its rise; of the contacts that on the rise of the
    sensor that moved most; of the room the difference [K], not a logarithm; None for `nothing`.
    """

    kind: str
    sensor: int | None
    probability: float
    size: float | None = None
    deviation: float | None = None


def scatter(n: int, runs: Sequence[Sequence[RunNumbers]]) -> Array:
    """Covariance (2 n, 2 n) from run to run, the usual one scaled by what groups of like runs show."""
    common, own = np.array(COMMON), np.repeat(np.square(OWN), n)
    usual: Array = np.kron(np.outer(common, common) * np.array([[1.0, TOGETHER], [TOGETHER, 1.0]]), np.ones((n, n))) + np.diag(own)
    total, count = RUNS_ASSUMED * 2 * n, RUNS_ASSUMED * 2 * n
    for group in runs:
        mean = np.mean([r.values for r in group], axis=0)
        total += sum(float((r.values - mean) @ np.linalg.solve(usual + r.covariance, r.values - mean)) for r in group)
        count += 2 * n * (len(group) - 1)
    return usual * total / count


def changes(old: Sequence[RunNumbers], new: Sequence[RunNumbers]) -> tuple[list[Change], Array, Array]:
    """Kinds of change, the likeliest first, and the difference (2 S,) of the new runs to the old with its covariance.

    Raises
    ------
    ValueError: a group without runs.
    """
    if not old or not new:
        raise ValueError("no runs to compare")
    n = len(old[0].values) // 2
    spread = scatter(n, (old, new))
    means = []
    for group in (old, new):
        precision = [np.linalg.inv(r.covariance + spread) for r in group]
        covariance = np.linalg.inv(sum(precision))
        means.append((covariance @ sum(p @ r.values for p, r in zip(precision, group, strict=True)), covariance))
    difference: Array = means[1][0] - means[0][0]
    noise: Array = means[0][1] + means[1][1]
    found = []
    for kind, sensor, directions, size, prior in _hypotheses(n):
        unlike = (UNLIKE * size) ** 2 * np.diag((directions**2).sum(axis=1))
        covariance = noise + size**2 * directions @ directions.T + unlike
        sign, log = np.linalg.slogdet(covariance)
        weight = np.log(prior) - 0.5 * (log + difference @ np.linalg.solve(covariance, difference))
        found.append((kind, sensor, directions, size, float(weight) if sign > 0 else -np.inf))
    most = max(w for *_, w in found)
    shares = np.exp([w - most for *_, w in found])
    shares /= shares.sum()
    listed = []
    for (kind, sensor, directions, size, _), share in zip(found, shares, strict=True):
        value, deviation = _size(kind, directions, size, difference, noise)
        if kind == "contact":
            sensor, value, deviation = _most_moved(difference, noise, size)
        listed.append(Change(kind, sensor, float(share), value, deviation))
    return sorted(listed, key=lambda c: -c.probability), difference, noise


def _hypotheses(n: int) -> list[tuple[str, int | None, Array, float, float]]:
    """(kind, sensor, directions (2 n, p), prior deviation, prior probability)."""
    ones, none = np.ones(n), np.zeros(n)
    found: list[tuple[str, int | None, Array, float, float]] = [
        ("nothing", None, np.zeros((2 * n, 1)), 0.0, PRIORS["nothing"]),
        ("heat", None, np.concatenate([none, ones])[:, None], SIZE, PRIORS["heat"]),
        ("heat capacity", None, np.concatenate([-ones, none])[:, None], SIZE, PRIORS["heat capacity"]),
        ("loss", None, np.concatenate([ones, -ones])[:, None], SIZE, PRIORS["loss"]),
    ]
    if n > 1:
        for i in range(n):
            own = np.zeros((2 * n, 2))
            own[n + i, 0] = own[i, 1] = 1.0
            found.append(("sensor", i, own, LOCAL_SIZE, PRIORS["sensor"] / n))
        found.append(("contact", None, np.eye(2 * n), LOCAL_SIZE, PRIORS["contact"]))
    return found


def with_room(found: Sequence[Change], probability: float, difference: float, deviation: float) -> list[Change]:
    """Kinds of change with another room, by so many K, where the machine is as it was; the likeliest first."""
    as_it_was = next(c for c in found if c.kind == "nothing")
    parted = [
        replace(as_it_was, probability=as_it_was.probability * (1.0 - probability)),
        Change("room", None, as_it_was.probability * probability, difference, deviation),
    ]
    return sorted([*parted, *(c for c in found if c is not as_it_was)], key=lambda c: -c.probability)


def other_room(old: Array, new: Array, error: float) -> float:
    """Probability that the new runs had another room, of the rooms (K,) [degC] of old and new runs, each known to `error` [K]."""
    squares, count = RUNS_ASSUMED * ROOM_SCATTER**2, RUNS_ASSUMED
    for group in (old, new):
        squares += float(((group - group.mean()) ** 2).sum())
        count += len(group) - 1
    variance = (squares / count + error**2) * (1.0 / len(old) + 1.0 / len(new))
    difference = float(new.mean() - old.mean())
    wide = variance + ROOM_SIZE**2
    log_odds = np.log(OTHER_ROOM / (1.0 - OTHER_ROOM)) - 0.5 * np.log(wide / variance)
    log_odds += 0.5 * difference**2 * (1.0 / variance - 1.0 / wide)
    return float(1.0 / (1.0 + np.exp(-min(log_odds, 500.0))))


def warm_instead(difference: Array, noise: Array, rise: Array, warmer: Array) -> float:
    """How much likelier, as logarithm, a difference (2 S,) is where the room was `warmer` (S,) [K] than where only the machine was.

    rise (S,) [K] are those of the old runs: a machine that begins warm rises by so much less, in a warmer room as before.
    """
    left = np.maximum(1.0 - warmer / rise, 0.05)
    foretold = np.concatenate([np.zeros(len(rise)), np.log(left)])
    solved = np.linalg.solve(noise, foretold)
    return float(0.5 * foretold @ solved - difference @ solved)


def _most_moved(difference: Array, noise: Array, size: float) -> tuple[int, float, float]:
    """The sensor that moved most beside the others, where each may in its own way; factor on its rise, as logarithm; deviation."""
    n = len(difference) // 2
    covariance = np.linalg.inv(np.linalg.inv(noise) + np.eye(2 * n) / size**2)
    value = covariance @ np.linalg.solve(noise, difference)
    deviation = np.sqrt(np.diag(covariance))
    most = int(np.argmax((value**2 / np.diag(covariance)).reshape(2, n).sum(axis=0)))
    return most, float(value[n + most]), float(deviation[n + most])


def _size(kind: str, directions: Array, size: float, difference: Array, noise: Array) -> tuple[float | None, float | None]:
    """Logarithm of a change and its deviation, all else as it was."""
    if kind in ("nothing", "contact"):
        return None, None
    covariance = np.linalg.inv(directions.T @ np.linalg.solve(noise, directions) + np.eye(directions.shape[1]) / size**2)
    value = covariance @ directions.T @ np.linalg.solve(noise, difference)
    return float(value[0]), float(np.sqrt(covariance[0, 0]))
