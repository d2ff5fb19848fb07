"""Rates and rises of a run in logarithms, and what is not known of them: noise, what the law leaves, the air around a machine."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from ...core.kernel import followed
from ...joint import LEVEL, RATE, START, Fit, fit_model
from ...noise.whiteness import variance_inflations
from ...observations import Observations
from ...search.judge import widening

Array = NDArray[np.float64]

#: Deviation [K] of a room that nobody logged, over a run: of a straight line, and of a swing there and back.
DRIFT = 0.3, 0.15
#: Share of that which a logged room leaves unknown, and of what its course moved each sensor: parts that warm each other follow it
#: later and less than each by itself.
LOGGED_DRIFT, LOGGED_COURSE = 0.3, 0.3
#: Deviation [K] of the air beside a sensor from run to run, beside the room's.
LOCAL = 0.1
#: Times that a run is fitted again without what its logged room did.
FOLLOWED = 2
#: Share of a run that is fitted again to see by how much its numbers hang on its length, and by how much they do at most.
SHORTER, MOST_BY_LENGTH = 0.8, 3.0
#: Share of a run by which others may be logged late, in so many steps, and deviation [K] of where each then begins.
LATEST, LATE_STEPS, BEGUN = 0.15, 61, 0.3
#: Deviations of it by which none begins elsewhere than that explains.
FARTHEST = 3.0


@dataclass(frozen=True)
class RunNumbers:
    """Logarithms of rate and rise (2 S,) of the sensors of a run, rates first, with their covariance (2 S, 2 S).

    runs: of how many runs they are the mean, as those of a model learnt from several; the covariance is that of one.
    """

    values: Array
    covariance: Array
    runs: int = 1

    @classmethod
    def of(cls, fit: Fit, wider: float | Array, drift: float | None = None) -> "RunNumbers | None":
        """Of a fit of the base law, None where a sensor does not rise; `wider`, one or (S,), multiplies its errors,
        `drift` those by DRIFT.

        Without a drift the errors are those of the fit alone, and nothing of the air around the machine.
        """
        n, model = fit.run.sensors, fit.model
        rate, rise = rates_and_rises(fit)
        if not np.all(np.isfinite(rise)) or np.any(rise == 0.0):
            return None
        values, covariance = np.concatenate([np.log(rate), np.log(np.abs(rise))]), np.zeros((2 * n, 2 * n))
        at = [model.column(key) for key in (RATE, LEVEL, START)]
        courses = _courses(fit.run)
        moved, times = np.zeros((len(courses), 2 * n)), np.broadcast_to(wider, n)
        for i in range(n):
            slopes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 / rise[i], -1.0 / rise[i]]])
            own = slopes @ fit.joint_covariance(i)[np.ix_(at, at)] @ slopes.T * times[i] ** 2
            covariance[np.ix_([i, n + i], [i, n + i])] = own
            moved[:, [i, n + i]] = _by_courses(fit, courses, i, at) @ slopes.T
        # What bends a fit bends those of all sensors alike, along the ridge on which a short record leaves rate and rise.
        errors = np.sqrt(np.diag(covariance))
        bent = np.concatenate([errors[:n], -errors[n:]])
        covariance += np.outer(bent, bent)
        if drift is not None:
            covariance += _of_the_air(moved, drift)
        return cls(values, covariance)


def rates_and_rises(fit: Fit) -> tuple[Array, Array]:
    """Fitted rates (S,) [1/min] and rises (S,) [K]."""
    rate, level, start = (np.asarray(fit.values[key], dtype=np.float64) for key in (RATE, LEVEL, START))
    return rate, level - start


def _of_the_air(moved: Array, drift: float) -> Array:
    """Covariance (2 n, 2 n) by the air around a machine, from what its `_courses` move (courses, 2 n): the room's moves all sensors
    alike, that beside each only its own.
    """
    still, drifts, logged = moved[:1], moved[1 : 1 + len(DRIFT)], moved[1 + len(DRIFT) :]
    room = np.vstack([drift * drifts, LOGGED_COURSE * logged])
    beside = np.vstack([still, LOGGED_DRIFT * drifts])
    own = np.kron(np.ones((2, 2)), np.eye(moved.shape[1] // 2))
    covariance: Array = room.T @ room + own * (beside.T @ beside)
    return covariance


def without_room(run: Observations) -> Fit:
    """The fit of the base law to a run without what its logged room does to each sensor, which follows it at its own rate."""
    fit = fit_model(run)
    for _ in range(FOLLOWED if run.ambient else 0):
        course = _courses(run)[-1]
        rates, _ = rates_and_rises(fit)
        fit = fit_model(replace(run, reading=run.reading - np.array([_follows(run, course, rate) for rate in rates])))
    return fit


def _courses(run: Observations) -> list[Array]:
    """Courses (N,) [K] of the air around a machine: otherwise by LOCAL, those of DRIFT, and the one logged beside its mean."""
    since = (run.time - run.time[0]) / max(run.span, 1e-9)
    logged = [] if run.sink_c is None else [next(iter(run.ambient.values())) - run.sink_c]
    return [np.full_like(since, LOCAL), DRIFT[0] * since, DRIFT[1] * np.sin(np.pi * since), *logged]


def _follows(run: Observations, course: Array, rate: float) -> Array:
    """What a room's course (N,) [K] does to a sensor (N,) [K] that begins where it does."""
    out = np.empty((1, len(course)))
    followed(run.time, np.ascontiguousarray(course), np.array([1.0 / rate]), out)
    return np.asarray(out[0] - course[0] * np.exp(-rate * (run.time - run.time[0])))


def _by_courses(fit: Fit, courses: Sequence[Array], sensor: int, at: Sequence[int]) -> Array:
    """What a room of each course (N,) [K] does to a sensor's fitted coordinates at the columns `at`: (courses, 3)."""
    run, weight = fit.run, fit.run.weight[sensor]
    rate = float(np.asarray(fit.values[RATE], dtype=float)[sensor])
    read = np.array([_follows(run, course, rate) for course in courses])
    slopes = fit.by_local[at, sensor] * weight
    return np.asarray(np.linalg.lstsq(slopes @ fit.by_local[at, sensor].T, slopes @ read.T, rcond=None)[0].T)


def beside_others(fits: Sequence[Fit]) -> list[Array]:
    """How many times as large as under white noise the errors (S,) of each run are, beside the others.

    What the law of one rise leaves of a machine comes again in each of its runs and moves their numbers alike; only what a run's
    residuals have that those of the others have not makes a difference uncertain. Of one run against another nobody knows whether
    it does come again.
    """
    if len(fits) < 3:
        return [np.full(fit.run.sensors, widening(fit)) for fit in fits]
    found = []
    for k, fit in enumerate(fits):
        run, times = fit.run, fit.run.time - fit.run.time[0]
        others = [_residuals_at(times, other) for j, other in enumerate(fits) if j != k]
        # The mean of the others has errors of its own, which are not this run's.
        own = (fit.residual - np.mean(others, axis=0)) * np.sqrt((len(fits) - 1.0) / len(fits)) * np.sqrt(run.weight) * run.used
        each = variance_inflations(own, run.used)
        coloured = np.maximum(each, np.median(each))
        share = (own**2).sum(axis=1) / np.maximum((run.weight * fit.residual**2).sum(axis=1), 1e-300)
        found.append(np.sqrt(np.minimum(share * coloured, widening(fit) ** 2)))
    return found


def _residuals_at(times: Array, fit: Fit) -> Array:
    """Residuals of a run (S, N) [K] at other times (N,) [min] since its first reading."""
    since = fit.run.time - fit.run.time[0]
    return np.array([np.interp(times, since[used], row[used]) for row, used in zip(fit.residual, fit.run.used, strict=True)])


def by_length(fit: Fit) -> Array:
    """By how much the logarithms of rates and rises (2 S,) of a run move by the logarithm of its length.

    A machine of several parts does not follow the law of one rise: a shorter run has another rate. So has one in which time is
    stretched by a heat capacity: it is a shorter run of the machine as it was.
    """
    run = fit.run
    moved = _moved(fit, fit_model(run.until(float(run.time[0]) + SHORTER * run.span)))
    found: Array = np.clip(moved / np.log(SHORTER), -MOST_BY_LENGTH, MOST_BY_LENGTH)
    return found


@dataclass(frozen=True)
class Late:
    """What runs would be, were they logged so many minutes late: by how much warmer they begin (S,) [K], and what their logarithms
    of rates and rises (2 S,) are beside those of the whole.
    """

    minutes: float
    warmer: Array
    moved: Array


def logged_late(fits: Sequence[Fit], warmer: Array, room: float) -> Late | None:
    """What runs would be, were they logged as late as explains best how much warmer (S,) [K] others begin, in a room that may be
    another one by a deviation [K]; None where that is not late at all, or does not explain where each of them begins.
    """
    run = fits[0].run
    minutes = run.span * np.linspace(0.0, LATEST, LATE_STEPS)
    rows = [[_smooth_at(fit, minutes, i) for i in range(run.sensors)] for fit in fits]
    risen = np.mean(rows, axis=0)
    risen = risen - risen[:, :1]
    left = warmer[:, None] - risen
    # A room that is another one by r moves all alike: the least of (left - r)^2 / BEGUN^2 + r^2 / room^2.
    n = run.sensors
    r = left.sum(axis=0) / (n + (BEGUN / room) ** 2)
    cost = ((left - r) ** 2).sum(axis=0) / BEGUN**2 + (r / room) ** 2
    at = int(np.argmin(cost))
    if at == 0 or float(np.abs(left - r)[:, at].max()) > FARTHEST * BEGUN:
        return None
    moved = []
    for fit in fits:
        cut = fit_model(fit.run.without(fit.run.time < fit.run.time[0] + minutes[at]))
        risen_before = rates_and_rises(cut)[0] * minutes[at]  # its start is that of the whole run
        moved.append(_moved(fit, cut) - np.concatenate([np.zeros(n), risen_before]))
    return Late(float(minutes[at]), risen[:, at], np.mean(moved, axis=0))


def _smooth_at(fit: Fit, minutes: Array, sensor: int) -> Array:
    """Readings of a sensor [degC] so many minutes (M,) after its first, each the median of a few."""
    used = fit.run.used[sensor]
    time, row = fit.run.time[used] - fit.run.time[0], fit.run.reading[sensor][used]
    found: Array = np.interp(minutes, time, median_filter(row, size=5, mode="nearest"))
    return found


def _moved(fit: Fit, other: Fit) -> Array:
    """Logarithms of rates and rises (2 S,) of another fit over those of the first; 0 of one that does not rise in both."""
    (rate, rise), (other_rate, other_rise) = rates_and_rises(fit), rates_and_rises(other)
    with np.errstate(all="ignore"):
        ratio = np.concatenate([other_rate / rate, other_rise / rise])
        return np.asarray(np.where(ratio > 0.0, np.nan_to_num(np.log(ratio), posinf=0.0, neginf=0.0), 0.0))
