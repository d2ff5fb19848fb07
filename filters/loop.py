"""The one loop of every Gaussian filter: gaps, recording and divergence live here and nowhere else."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from .base import Array, Closing, Filter, Start, StateModel, Track, Tracks
from .fading import SETTINGS, Context, FadingRule, NoFading
from .moments import POINTS, Moments

_compiled: Any
try:
    from . import _loop as _compiled
except ImportError:  # built where no compiler was: the readable loop below gives the same numbers, slowly
    _compiled = None

COLUMNS = (
    "noise_variance",
    "innovation",
    "innovation_variance",
    "fading",
    "process_noise",
    "noise_factor",
    "weight",
    "forgotten",
)


#: What the compiled loop tells of one reading.
ROW = np.dtype([(name, float) for name in COLUMNS])


@dataclass(frozen=True)
class GaussianFilter(Filter):
    """A moment transform times a fading rule, none by default. Subclasses choose the two and declare the settings."""

    @property
    @abstractmethod
    def moments(self) -> Moments: ...

    @property
    def fading_rule(self) -> FadingRule:
        return NoFading()

    @property
    def closing(self) -> Closing:
        return "never"

    def track(self, model: StateModel, time: Array, reading: Array, resolution: float = 0.0) -> Track:
        """Start the model on the first readings, then filter the rest; see :class:`filters.base.Track`."""
        start = model.start(time, reading, resolution)
        return run(model, start, self.moments, self.fading_rule, time, reading, resolution)

    def tracks(self, model: StateModel, time: Array, reading: Array, resolution: Array) -> Tracks | None:
        """In the compiled loop, where it knows the transform, the rule and the model, and ``track`` is this class's own."""
        own = type(self).track is GaussianFilter.track
        called = _called(model, self.moments, self.fading_rule, len(model.state_names)) if own else None
        starts = model.starts(time, reading, resolution) if called is not None else None
        if called is None or starts is None or (starts.index < 0).any():
            return None
        records, n = starts.state.shape
        weight = starts.weights  # nobody else's: the loop goes on with them
        state, covariance = np.full((records, n), np.nan), np.full((records, n, n), np.nan)
        last = np.full(records, np.nan, ROW)
        woke, diverged_at = np.empty(records, np.intp), np.empty(records, np.intp)
        _compiled.run_block(
            *called,
            np.ascontiguousarray(time),
            np.ascontiguousarray(reading),
            starts.index,
            starts.state,
            starts.covariance,
            starts.noise_variance,
            starts.dof,
            0.5 * np.asarray(resolution),
            weight,
            state,
            covariance,
            last,
            woke,
            diverged_at,
        )
        return Tracks(starts.index, weight, state, covariance, last["noise_variance"], last["forgotten"], woke, diverged_at)


def _called(model: StateModel, moments: Moments, rule: FadingRule, n: int) -> tuple[Any, ...] | None:
    """The first arguments of the compiled loop, or None where it does not know one of the three."""
    if _compiled is None or model.compiled is None or not (moments.compiled and rule.compiled):
        return None
    points, settings = moments.compiled_settings(n), np.zeros(1, SETTINGS)
    for name, value in rule.compiled_settings().items():
        settings[name] = value
    told = None if points is None else np.array([points], POINTS)
    compiled = model.compiled
    return (compiled.step, compiled.jacobian, compiled.steps), rule.rule, told, settings


def run(
    model: StateModel,
    start: Start,
    moments: Moments,
    rule: FadingRule,
    time: Array,
    reading: Array,
    resolution: float = 0.0,
    compiled: bool = True,
) -> Track:
    """Filter the readings after ``start.index``; ``compiled=False`` takes the readable loop."""
    count, n = len(time), len(start.state)
    states = np.full((count, n), np.nan)
    covariances = np.full((count, n, n), np.nan)
    rows = np.full(count, np.nan, ROW)
    columns = rows.view(float).reshape(count, len(COLUMNS))
    columns[: start.index + 1] = [start.noise_variance, np.nan, np.nan, 1.0, 0.0, 1.0, 1.0, 0.0]
    rows["weight"][: start.index + 1] = start.weights
    # Rounding to the logger's step is no news of the physics, however long it lasts.
    dead_band = 0.5 * resolution
    called = _called(model, moments, rule, n) if compiled else None
    if called is not None:
        broken = _compiled.run(
            *called,
            np.ascontiguousarray(time),
            np.ascontiguousarray(reading),
            start.index,
            np.ascontiguousarray(start.state),
            np.ascontiguousarray(start.covariance),
            start.noise_variance,
            start.dof,
            dead_band,
            states,
            covariances,
            rows,
        )
    else:
        context = Context(start.covariance, dead_band)
        broken = run_readable(model, start, moments, rule, context, time, reading, (states, covariances, columns))
    if broken >= 0:
        states[broken:], covariances[broken:], columns[broken:] = np.nan, np.nan, np.nan
    series: dict[str, Any] = {name: rows[name] for name in COLUMNS}
    return Track(start.index, states, covariances, diverged_at=broken if broken >= 0 else None, **series)


def run_readable(
    model: StateModel,
    start: Start,
    moments: Moments,
    rule: FadingRule,
    context: Context,
    time: Array,
    reading: Array,
    out: tuple[Array, Array, Array],
) -> int:
    """The loop in numpy: the reference of the compiled one and the path of filters and models without one.

    Returns the reading at which the numbers broke, or -1.
    """
    states, covariances, columns = out
    m = rule.memory(start.noise_variance, start.dof)
    state, p = start.state.copy(), start.covariance.copy()
    k = start.index
    states[k], covariances[k] = state, p
    columns[k] = [m.scale * m.noise, 0.0, 0.0, 1.0, m.process, m.noise, 1.0, 0.0]
    with np.errstate(all="ignore"):
        for k in range(start.index + 1, len(time)):
            try:
                state, p = moments.predict(model, state, p, float(time[k] - time[k - 1]), m.scale)
            except np.linalg.LinAlgError:
                return k
            e = float(reading[k] - state[0])
            u = rule.update(m, state, p, e, context)
            state, p = u.state, u.covariance
            if not (math.isfinite(state[0]) and math.isfinite(p[0, 0]) and abs(state[0]) <= 1e12):
                return k
            states[k], covariances[k] = state, p
            columns[k] = [
                m.scale * m.noise,
                e,
                u.innovation_variance,
                u.fading,
                u.process_noise,
                u.noise_factor,
                u.weight,
                m.forgotten,
            ]
    return -1
