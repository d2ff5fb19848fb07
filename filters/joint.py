"""One adaptive fading filter over all sensors of a run: what each sensor's innovations say is weighed together.

With a sensor alone the paper's normalised residual (23)-(29), e_j / lambda_j with lambda_j = y0_j sqrt(m / sum y0^2), is the
residual itself: lambda is 1. Over several sensors it puts their residuals on one footing before they enter one fading
factor. The printed lambda takes the readings' size for that footing, which in degrees Celsius says nothing of their
noise; here each innovation is divided by its own standard deviation, the footing under which all are alike while the model is
right.

The sensors' states stay apart (their noise is independent and no model couples them); what they share is the evidence that
the model fails. A cause that all of them feel, too faint for any one alone, then wakes the fading of all.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .base import Array, StateModel, Track
from .fading import AdaptiveFading, Context, Evidence, Memory
from .loop import COLUMNS
from .moments import Moments


def pooled_deviation(z: Sequence[float]) -> float:
    """How unlikely deviations z (m,) are together, as one standard deviate: their sum of squares against chi-squared of m.

    The cube-root transformation of Wilson & Hilferty 1931, Proc. Natl. Acad. Sci. 17; one deviate alone is itself.
    """
    m = len(z)
    if m == 1:
        return abs(z[0])
    share = math.fsum(v * v for v in z) / m
    spread = 2.0 / (9.0 * m)
    return max(0.0, (math.cbrt(share) - (1.0 - spread)) / math.sqrt(spread))


@dataclass
class _Sensor:
    """One sensor on its way: its readings, where it is, what it carries and what it has written down."""

    time: Array
    reading: Array
    k: int
    state: Array
    covariance: Array
    memory: Memory
    context: Context
    states: Array
    covariances: Array
    columns: Array
    first: int
    broken: int = -1

    @property
    def next_time(self) -> float:
        return float(self.time[self.k + 1]) if self.broken < 0 and self.k + 1 < len(self.time) else math.inf


def track_together(
    model: StateModel,
    moments: Moments,
    rule: AdaptiveFading,
    records: Sequence[tuple[Array, Array, float]],
) -> list[Track]:
    """Filter several sensors of one run in step.

    records: (time (N_j,) [min], reading (N_j,) [degC], resolution [K]) of each sensor, times ascending and of one clock. A sensor
    that has no reading at some time takes no part in the evidence of that time; one that breaks leaves the others alone.
    """
    sensors = [_begin(model, rule, *record) for record in records]
    with np.errstate(all="ignore"):
        while True:
            now = min((s.next_time for s in sensors), default=math.inf)
            if now == math.inf:
                break
            _advance(model, moments, rule, [s for s in sensors if s.next_time <= now])
    return [_track(s) for s in sensors]


def _begin(model: StateModel, rule: AdaptiveFading, time: Array, reading: Array, resolution: float) -> _Sensor:
    start = model.start(time, reading, resolution)
    count, n = len(time), len(start.state)
    states, covariances = np.full((count, n), np.nan), np.full((count, n, n), np.nan)
    columns = np.full((count, len(COLUMNS)), np.nan)
    k = start.index
    columns[: k + 1] = [start.noise_variance, np.nan, np.nan, 1.0, 0.0, 1.0, 1.0, 0.0]
    columns[: k + 1, COLUMNS.index("weight")] = start.weights
    memory = rule.memory(start.noise_variance, start.dof)
    states[k], covariances[k] = start.state, start.covariance
    columns[k] = [memory.scale, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]
    context = Context(start.covariance, 0.5 * resolution)
    return _Sensor(time, reading, k, start.state.copy(), start.covariance.copy(), memory, context, states, covariances, columns, k)


def _advance(model: StateModel, moments: Moments, rule: AdaptiveFading, sensors: list[_Sensor]) -> None:
    """One time: every sensor with a reading predicts, all weigh their innovations together, each updates."""
    weighed: list[tuple[_Sensor, float, Evidence]] = []
    for s in sensors:
        dt = float(s.time[s.k + 1] - s.time[s.k])
        s.k += 1
        try:
            s.state, s.covariance = moments.predict(model, s.state, s.covariance, dt, s.memory.scale)
        except np.linalg.LinAlgError:
            s.broken = s.k
            continue
        e = float(s.reading[s.k] - s.state[0])
        weighed.append((s, e, rule.weigh(s.memory, s.covariance, e, s.context)))
    together = joint_wake([evidence for _, _, evidence in weighed])
    for s, e, evidence in weighed:
        u = rule.apply(s.memory, s.state, s.covariance, e, s.context, evidence, max(evidence.wakes, together))
        s.state, s.covariance = u.state, u.covariance
        if not (math.isfinite(s.state[0]) and math.isfinite(s.covariance[0, 0]) and abs(s.state[0]) <= 1e12):
            s.broken = s.k
            continue
        s.states[s.k], s.covariances[s.k] = s.state, s.covariance
        variances = [s.memory.scale * s.memory.noise, e, u.innovation_variance]
        s.columns[s.k] = [*variances, u.fading, u.process_noise, u.noise_factor, u.weight, s.memory.forgotten]


def joint_wake(evidence: Sequence[Evidence]) -> float:
    """How far the evidence of all sensors together stands over the threshold, 0 where it does not."""
    good = [v for v in evidence if v.matters]
    if len(good) < 2:
        return 0.0
    threshold = float(np.median([v.threshold for v in evidence]))
    # Sensors whose mean is no more than their logger's rounding count as having seen nothing.
    z = pooled_deviation([v.z if v.matters else min(v.z, 1.0) for v in evidence])
    return z / threshold if z > threshold else 0.0


def _track(s: _Sensor) -> Track:
    if s.broken >= 0:
        s.states[s.broken :], s.covariances[s.broken :], s.columns[s.broken :] = np.nan, np.nan, np.nan
    series = {name: s.columns[:, i] for i, name in enumerate(COLUMNS)}
    return Track(s.first, s.states, s.covariances, diverged_at=s.broken if s.broken >= 0 else None, **series)
