"""Where to start the search for an effect: the gain that a small amount of it would bring, at every place it could act.

To first order an effect of amplitude a adds a h(t) to each sensor's curve. What of h the present fit cannot imitate is compared
with the residuals: one division gives the best amplitude and its gain, for hundreds of event times or periods at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.kernel import Array
from ..effects.base import Choice, Effect
from ..joint import LEVEL, RATE, START, Fit, Key, Model, Part, with_parts

#: Rows times readings that one forward run takes at once.
CHUNK = 1_500_000
#: Deviations of the noise by which no curve is changed: beyond them a run forward has overflowed, and points nowhere.
WILD = 1e100


@dataclass(frozen=True)
class Scan:
    """Grid points (G values of the other parameters) with first-order amplitude and gain (G, S), and the amplitude and gain
    (G,) where the sensors share it; strength (G, S) is the gain of an amplitude of 1, cost (S,) the fit's weighted sum of squares.
    """

    points: list[dict[str, float]]
    amplitude: Array
    gain: Array
    shared_amplitude: Array
    shared_gain: Array
    strength: Array
    cost: Array
    fit: Fit


def scan(fit: Fit, effect: Effect, choice: Choice, noise: Array | None = None) -> Scan:
    """First-order gains of adding an effect to a fit, in units of the noise variance (S,): that of the fit by default."""
    run = fit.run
    parts = [*fit.model.parts, Part(effect, choice)]
    model = Model(run, parts)
    at = len(parts) - 1
    main = effect.parameter(effect.amplitude)
    assert main.null is not None
    points = effect.grid(run, choice)
    nudge = 0.02 * ((main.start - main.null) or 1.0) * (run.span if main.share else 1.0)
    middle = model.vector({**with_parts(fit, parts), Key(at, effect.amplitude): main.null + nudge})
    n = run.sensors
    root = np.sqrt(run.weight / (fit.noise if noise is None else noise)[:, None] ** 2)
    seen = np.flatnonzero(run.used.any(axis=0))
    residual = fit.residual * root
    # What curves are compared with, weighted once more: the curves themselves are not.
    beside = [_beside(fit.directions[i], residual[i, seen]) * root[i, seen, None] for i in range(n)]
    per = max(2, CHUNK // (n * len(run.time)) // 2 * 2)
    along, size = np.empty((len(points), n)), np.empty((len(points), n))
    rate, rise = fit.values[RATE], fit.values[LEVEL] - fit.model.sink_guess
    for first in range(0, len(points), per):
        some = points[first : first + per]
        known = effect.response(some, run, rate, rise)
        change = _changes(model, *middle, at, some) if known is None else None
        for i in range(n):
            if known is not None:
                h = known[i % len(known)]
            else:
                assert change is not None
                h = (change[:, i] - fit.curve[i]) / nudge
            h = h if len(seen) == h.shape[1] else h[:, seen]
            with np.errstate(all="ignore"):
                whole = (h * h) @ root[i, seen] ** 2
            if not whole.max(initial=0.0) < WILD:
                h = np.where((whole < WILD)[:, None], h, 0.0)
                whole = (h * h) @ root[i, seen] ** 2
            onto = h @ beside[i]
            along[first : first + len(some), i] = onto[:, -1]
            own = whole - (onto[:, :-1] ** 2).sum(axis=1)
            # What the fit imitates to the last digits is no direction of its own.
            size[first : first + len(some), i] = np.where(own > 1e-9 * whole, own, 0.0)
    low, high = (b - main.null for b in main.bounds(run))
    with np.errstate(all="ignore"):
        amplitude = np.clip(np.nan_to_num(along / size), 0.9 * low, 0.9 * high)
        together = np.clip(np.nan_to_num(along.sum(axis=1) / size.sum(axis=1)), 0.9 * low, 0.9 * high)
    gain = np.maximum(2.0 * amplitude * along - amplitude**2 * size, 0.0)
    shared_gain = np.maximum(2.0 * together * along.sum(axis=1) - together**2 * size.sum(axis=1), 0.0)
    return Scan(
        points, amplitude + main.null, gain, together + main.null, shared_gain, size, (residual[:, seen] ** 2).sum(axis=1), fit
    )


def _beside(directions: Array, residual: Array) -> Array:
    """Orthonormal directions (n, m), and the residual (n,) without what lies in them: (n, m + 1)."""
    left = residual - directions @ (directions.T @ residual)
    return np.column_stack([directions, left])


def _changes(model: Model, local: Array, shared: Array, at: int, some: list[dict[str, float]]) -> Array:
    """Curves (G, S, N) at each of some grid points of part `at`, all else as in local (S, kl), shared (ks,)."""
    n = len(local)
    many, common = np.repeat(local[None], len(some), axis=0), np.repeat(shared[None], len(some), axis=0)
    for name in some[0]:
        values = np.array([point[name] for point in some])
        model.place(many, common, at, name, values)
    rows = np.repeat(common, n, axis=0)
    curves = model.forward(many.reshape(len(some) * n, -1), rows, np.tile(np.arange(n), len(some)))
    return curves.reshape(len(some), n, -1)


def shared_starts(found: Scan, effect: Effect, at: int, most: int) -> list[tuple[float, dict[Key, Any]]]:
    """The best distinct places of a shared effect: (first-order gain, start values of part `at`)."""
    best = effect.starts(found.points, found.shared_amplitude, found.shared_gain, most)
    return [(gain, {Key(at, name): value for name, value in values.items()}) for gain, values in best]


def own_starts(found: Sequence[Scan], effect: Effect, at: int) -> tuple[Array, dict[Key, Any]]:
    """Each sensor's best place over scans from several rates: (gains over the first scan's fit (S,), start values (S,)).

    Start values are those of part `at` and of the base model.
    """
    sensors = np.arange(found[0].gain.shape[1])
    best = np.array([np.argmax(s.gain, axis=0) for s in found])
    left = np.array([s.cost - s.gain[b, sensors] for s, b in zip(found, best, strict=True)])
    which = np.argmin(left, axis=0)
    point = best[which, sensors]
    values: dict[Key, Any] = {
        Key(at, effect.amplitude): np.array([found[w].amplitude[b, i] for i, (w, b) in enumerate(zip(which, point, strict=True))])
    }
    for name in found[0].points[0]:
        values[Key(at, name)] = np.array([found[w].points[b][name] for w, b in zip(which, point, strict=True)])
    for key in [RATE, LEVEL, START]:
        values[key] = np.array([found[w].fit.values[key][i] for i, w in enumerate(which)])
    return found[0].cost - left[which, sensors], values
