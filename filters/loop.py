"""The one loop of every Gaussian filter: gaps, recording and divergence live here and nowhere else."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .base import Array, Closing, Filter, Start, StateModel, Track
from .fading import Context, FadingRule, NoFading
from .moments import Moments

_compiled_run: Callable[..., int] | None
try:
    from ._loop import run as _compiled_run
except ImportError:  # built where no compiler was: the readable loop below gives the same numbers, slowly
    _compiled_run = None

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


@dataclass(frozen=True)
class GaussianFilter(Filter):
    """A moment transform times a fading rule, none by default. Subclasses choose the two and declare the settings."""

    @property
    def moments(self) -> Moments:
        raise NotImplementedError

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
    columns = np.full((count, len(COLUMNS)), np.nan)
    columns[: start.index + 1] = [start.noise_variance, np.nan, np.nan, 1.0, 0.0, 1.0, 1.0, 0.0]
    columns[: start.index + 1, 6] = start.weights
    # Rounding to the logger's step is no news of the physics, however long it lasts.
    dead_band = 0.5 * resolution
    if compiled and moments.compiled and rule.compiled and _compiled_run is not None and model.compiled is not None:
        broken = _compiled_run(
            model.compiled.step,
            model.compiled.jacobian,
            np.ascontiguousarray(time),
            np.ascontiguousarray(reading),
            start.index,
            np.ascontiguousarray(start.state),
            np.ascontiguousarray(start.covariance),
            start.noise_variance,
            start.dof,
            dead_band,
            rule.rule,
            moments.compiled_settings(n),
            rule.compiled_settings(),
            states,
            covariances,
            columns,
        )
    else:
        context = Context(start.covariance, dead_band)
        broken = run_readable(model, start, moments, rule, context, time, reading, (states, covariances, columns))
    if broken >= 0:
        states[broken:], covariances[broken:], columns[broken:] = np.nan, np.nan, np.nan
    series: dict[str, Any] = {name: columns[:, i] for i, name in enumerate(COLUMNS)}
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
