"""Where a model fails: the stretches in which a residual leaves the noise, and the logged columns that step there."""

import math

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.noise.threshold import adaptive_threshold

Array = NDArray[np.float64]

#: A stretch fails where its running mean leaves this many standard errors of white noise.
FAILS = 4.5
#: Deviations of the model itself that are no failure.
UNSURE = 3.0
#: Readings whose moments set the adaptive limits of the next, deviations of the limits, readings in a row beyond that count.
WINDOW, DEVIATIONS, IN_A_ROW = 20, 3.0, 3
#: A change of this share of a column's range between two readings is a step.
STEP_SHARE = 0.25
#: Readings of a logged column whose median is its level on either side, and usual changes between neighbours that a step exceeds.
LEVEL, BEYOND_NOISE = 5, 6.0
#: A step may precede the failing stretch by this share of the record, and follow its start by a few readings.
BEFORE_SHARE, AFTER_READINGS = 0.06, 3


def failing_stretches(
    time: Array, residual: Array, weight: Array, noise: float, unsure: Array | None = None
) -> list[tuple[float, float, float]]:
    """(from, to, mean residual [K]) of stretches where the residual (N,), nan for none, leaves a running mean's band.

    The band is that of the noise and, ahead of the fit, of the model's own standard deviation `unsure` (N,) [K].
    Looks at running means over 5, 15 and 45 readings: a long shallow failure shows in the long one, a short one in the short.
    A sudden change of a residual that is already patterned is seen against the residuals just before it (adaptive threshold).
    """
    good = np.flatnonzero(np.isfinite(residual) & (weight > 0.0))
    if len(good) < 10:
        return []
    r, w = residual[good], weight[good]
    room = np.zeros(len(good)) if unsure is None else np.minimum(np.nan_to_num(unsure[good], posinf=1e9), 1e9)
    out = np.zeros(len(good), dtype=bool)
    for width in (5, 15, 45):
        if width * 2 > len(good):
            break
        kernel = np.ones(width)
        heavy = np.convolve(w, kernel, "same")
        mean = np.convolve(r * w, kernel, "same") / heavy
        outside = np.abs(mean) > FAILS * noise / np.sqrt(heavy) + UNSURE * room
        # A mean over a width speaks for its middle half.
        reach = np.convolve(outside, np.ones(width // 2 | 1), "same") > 0
        side = np.sign(np.convolve(r * w, kernel, "same"))
        out |= reach & (np.sign(r) == side)
    out |= _sudden(r, noise)
    # One to each side: where a residual runs from below the band to above it, the one ends and the other begins.
    signed = np.concatenate([[0.0], np.where(out, np.sign(r), 0.0), [0.0]])
    edges = np.flatnonzero(np.diff(signed))
    stretches: list[list[float]] = []
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if not signed[b]:
            continue
        a, b = _trimmed(r, w, room, noise, a, b)
        if b - a < 3:
            continue
        size = float((r[a:b] * w[a:b]).sum() / w[a:b].sum())
        if abs(size) < FAILS * noise / math.sqrt(float(w[a:b].sum())):
            continue
        begin, end = float(time[good[a]]), float(time[good[b - 1]])
        near = stretches and begin - stretches[-1][1] < 0.03 * (time[good[-1]] - time[good[0]]) and stretches[-1][2] * size > 0
        if near:
            count = stretches[-1][3]
            stretches[-1] = [stretches[-1][0], end, (stretches[-1][2] * count + size * (b - a)) / (count + b - a), count + b - a]
        else:
            stretches.append([begin, end, size, b - a])
    return [(round(s[0], 4), round(s[1], 4), float(s[2])) for s in stretches if s[3] >= 3]


def _trimmed(r: Array, w: Array, room: Array, noise: float, a: int, b: int) -> tuple[int, int]:
    """A stretch without those ends where the mean of five readings is within two standard errors."""
    side = math.copysign(1.0, float((r[a:b] * w[a:b]).sum()))
    kernel = np.ones(5)
    heavy = np.convolve(w, kernel, "same")
    mean = np.convolve(r * w, kernel, "same") / np.maximum(heavy, 1e-9)
    far = np.flatnonzero(side * mean[a:b] > 2.0 * noise / np.sqrt(np.maximum(heavy[a:b], 1e-9)) + room[a:b])
    return (a + int(far[0]), a + int(far[-1]) + 1) if len(far) else (a, a)


def _sudden(residual: Array, noise: float) -> NDArray[np.bool_]:
    """Readings (N,) of runs beyond one side of the adaptive threshold, IN_A_ROW of them or more."""
    if len(residual) <= WINDOW:
        return np.zeros(len(residual), dtype=bool)
    low, high = adaptive_threshold(residual, WINDOW, DEVIATIONS, floor=noise)
    found = np.zeros(len(residual), dtype=bool)
    for beyond in (residual > high, residual < low):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], beyond.astype(int), [0]])))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            found[a:b] = b - a >= IN_A_ROW
    return found


def steps_near(run: Observations, begins_min: float) -> list[str]:
    """``spindle_speed steps from 2000 to 5000 at 180 min``, for each column that steps where a stretch begins [min of the run]."""
    found = []
    for name, column in {**run.inputs, **run.ambient}.items():
        span = float(np.ptp(column))
        if span <= 0.0:
            continue
        # From the level before to that after: a single reading says nothing of it, nor does the noise of a room that stays.
        at = np.flatnonzero(np.abs(np.diff(column)) > STEP_SHARE * span)
        least = max(STEP_SHARE * span, BEYOND_NOISE * float(np.median(np.abs(np.diff(column)))))
        steps = [k for k in at.tolist() if abs(np.median(column[k + 1 :][:LEVEL]) - np.median(column[: k + 1][-LEVEL:])) > least]
        if len(steps) > 12:  # a column that jumps all the time steps nowhere in particular
            continue
        early, late = begins_min - BEFORE_SHARE * run.span, begins_min + AFTER_READINGS * run.step
        near = [k for k in steps if early <= run.clock[k + 1] <= late]
        if near:
            k = near[-1]
            found.append(f"{name} steps from {column[k]:.4g} to {column[k + 1]:.4g} at {run.clock[k + 1]:.4g} min")
    return found
