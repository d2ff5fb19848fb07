"""The least-squares fit of a grey-box model, all sensors of a run together.

Parameters are of two kinds: those of one sensor (rate, level, start, and an effect's own) and those that all sensors share (one
event time, one wave). The normal equations then have the form of an arrow: one small block per sensor and a border for what
is shared; they are solved by the border's Schur complement inside a projected Levenberg-Marquardt iteration.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrow import BEYOND, arrow_inverse, arrow_step, assemble, finite_slopes
from .coordinates import Prior, SearchSpace
from .core.kernel import Array
from .decay import fit_decay
from .greybox import BASE, LEVEL, RATE, SINK, START, Key, Model, Part
from .noise.discrepancy import Columns
from .noise.rounding import without_rounding
from .observations import Observations

__all__ = [
    "BASE",
    "LEVEL",
    "MOST_ITERATIONS",
    "RATE",
    "SINK",
    "START",
    "Fit",
    "Key",
    "Model",
    "Part",
    "Prior",
    "at_rates",
    "fit_model",
    "refit",
    "rows_of",
    "search",
    "settled",
    "start_values",
    "with_parts",
]

MOST_ITERATIONS = 40
#: Those of a fit that is not one among many.
UNTIL_AT_REST = 400
GAIN_AT_END, SHARE_AT_END = 1e-2, 1e-7
#: Time constants that a record seems to cover below which its rates are doubted.
TURNED = 0.3
#: Rates that a record may show, over its length.
MAY_SHOW = (3.0, 8.0, 20.0)


#: Share of a range that is its edge.
EDGE = 0.02


@dataclass(frozen=True)
class Fit:
    """A fitted model: parameters in search coordinates, curve (S, N) [degC], weighted residual sums of squares rss (S,) [K^2].

    by_local (kl, S, N) and by_shared (ks, S, N) are the model's derivatives. With coloured noise, `columns` and the amplitudes own
    (S, m) and shared_amplitudes (k,) that go best with the readings; residuals are then what is left beside model and disturbance.
    """

    model: Model
    local: Array
    shared: Array
    curve: Array
    by_local: Array
    by_shared: Array
    rss: Array
    converged: bool
    prior: Prior | None = None
    columns: Columns | None = None
    own: Array | None = None
    shared_amplitudes: Array | None = None

    @property
    def run(self) -> Observations:
        return self.model.run

    @cached_property
    def residual(self) -> Array:
        """Reading minus model and disturbance (S, N) [K]; 0 where there is no reading in use."""
        return np.where(self.run.used, self.run.known - self.curve - self.discrepancy, 0.0)

    @cached_property
    def discrepancy(self) -> Array:
        """The disturbance (S, N) [K] that goes best with the readings; 0 where the noise is white."""
        if self.columns is None or self.own is None or self.shared_amplitudes is None:
            return np.zeros_like(self.curve)
        return self.columns.discrepancy(self.own, self.shared_amplitudes)

    @cached_property
    def unrounded(self) -> Array:
        """Residuals (S, N) [K] without what the logger's rounding adds to a reading on average."""
        rows = [
            without_rounding(self.residual[i], self.curve[i], self.run.weight[i], float(self.run.resolution[i]), float(variance))
            for i, variance in enumerate(self.rss / self.dof)
        ]
        return np.array(rows)

    @cached_property
    def readings(self) -> NDArray[np.int_]:
        return np.asarray(self.run.used.sum(axis=1))

    @cached_property
    def searched(self) -> int:
        """Number of effect parameters."""
        n = int(self.model.active[:, len(BASE) :].sum())
        return n + sum(c.part >= 0 for c in self.model.shared)

    @property
    def complexity(self) -> float:
        """Number of effect parameters, and what choosing among ways of acting costs."""
        n = self.run.sensors
        return self.searched + sum(p.effect.choice_costs * int(p.concerns(n).sum()) for p in self.model.parts)

    @property
    def physical(self) -> bool:
        """Whether every effect has values that it could really have."""
        n, values = self.run.sensors, self.values
        for p, part in enumerate(self.model.parts):
            own = {name: value for (at, name), value in values.items() if at == p}
            if not part.effect.physical(part.choice, part.concerns(n), values[RATE], own):
                return False
            # A heat that was switched off looks so: no room moves a machine by more than all that its own heat did.
            moves = part.effect.moves_room
            if moves and float(np.max(np.abs(own[moves]))) > float(np.median(self.run.moved)):
                return False
        return True

    @property
    def distant_surroundings(self) -> bool:
        """Whether it takes surroundings that are as far from the readings as they may be."""
        for j, column in enumerate(self.model.shared):
            if column.key == Key(-1, SINK.name):  # not the same object in another process
                low, high = self.model.low_shared[j], self.model.high_shared[j]
                edge = EDGE * (high - low)
                return not low + edge <= self.values[column.key] <= high - edge
        return False

    @cached_property
    def dof(self) -> Array:
        """Readings minus parameters of each sensor, shared ones spread evenly (S,)."""
        own = self.model.active.sum(axis=1) + len(self.model.shared) / max(1, self.run.sensors)
        return np.asarray(np.maximum(self.readings - own, 1.0))

    @cached_property
    def noise(self) -> Array:
        """Standard deviation (S,) [K] of a reading: of the residuals, but no less than the logger's rounding."""
        floor = self.run.resolution**2 / 12.0
        return np.asarray(np.sqrt(np.maximum(self.rss / self.dof, np.maximum(floor, 1e-18))))

    @cached_property
    def rmse(self) -> Array:
        """Root mean square residual (S,) [K] of the readings in use."""
        total = (self.residual**2).sum(axis=1)
        return np.asarray(np.sqrt(total / np.maximum(self.readings, 1)))

    @cached_property
    def directions(self) -> list[Array]:
        """Orthonormal directions (n, m) in which the fit of each sensor can move, each reading by the root of its weight.

        n are the grid times at which any sensor has a reading in use.
        """
        seen, root = np.flatnonzero(self.run.used.any(axis=0)), np.sqrt(self.run.weight)
        bases = []
        for i in range(self.run.sensors):
            own = self.by_local[self.model.active[i], i]
            tangent = (np.concatenate([own, self.by_shared[:, i]]) * root[i]).T[seen]
            scale = np.maximum(np.sqrt((tangent**2).sum(axis=0)), 1e-300)
            u, s, _ = np.linalg.svd(np.nan_to_num(tangent / scale), full_matrices=False)
            bases.append(u[:, s > 1e-7])
        return bases

    @cached_property
    def elsewhere(self) -> tuple["Fit", ...]:
        """The same model with rates held like the other sensors' and faster: without what is missing a fit bends them."""
        own = self.values[RATE]
        common = np.full_like(own, np.median(own))
        rates = [common, 2.0 * common] if len(own) > 2 else []
        return (*self.as_it_began, *(at_rates(self, r) for r in [*rates, 2.0 * own, 5.0 * own]))

    @cached_property
    def as_it_began(self) -> tuple["Fit", ...]:
        """The same model at other rates, where that of all readings says nothing in some sensor.

        First that of the readings up to the largest, then some that a record of this length may show: a machine that turns round in
        mid-record, as by a switch, or whose heat grows all the while looks like one that goes on for ever.
        """
        if float(self.values[RATE].min()) * self.run.span > TURNED:
            return ()
        rates = [_early_rate(self.run), *(k / self.run.span for k in MAY_SHOW)]
        return tuple(at_rates(self, np.full(self.run.sensors, rate)) for rate in rates)

    def __getstate__(self) -> dict[str, Any]:
        """What another process needs: the fields, without what can be worked out again."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def tangent(self, sensor: int) -> Array:
        """Directions (n used, m) in which the fit of a sensor can move."""
        used = self.run.used[sensor]
        own = self.by_local[self.model.active[sensor], sensor][:, used]
        return np.concatenate([own, self.by_shared[:, sensor][:, used]]).T

    @property
    def values(self) -> dict[Key, Any]:
        return self.model.named(self.local, self.shared)

    @cached_property
    def covariance(self) -> tuple[Array, Array, Array]:
        """Covariances in search coordinates: local (S, kl, kl), shared (ks, ks), and shared with local (S, kl, ks).

        The noise of each sensor is that of its residuals; with coloured noise it is the run's, the amplitudes integrated out.
        """
        noise = self.noise if self.columns is None else np.maximum(self.run.noise, 1e-9)
        _, (local, shared, cross) = inverse_normal_equations(self, self.run.weight / noise[:, None] ** 2)
        kl, ks = self.local.shape[1], len(self.shared)
        return local[:, :kl, :kl], shared[:ks, :ks], cross[:, :kl, :ks]

    def joint_covariance(self, sensor: int) -> Array:
        """Covariance (kl + ks, kl + ks) of one sensor's own and the shared parameters, in search coordinates."""
        local, shared, cross = self.covariance
        top = np.concatenate([local[sensor], cross[sensor]], axis=1)
        bottom = np.concatenate([cross[sensor].T, shared], axis=1)
        whole = np.nan_to_num(np.concatenate([top, bottom]), posinf=0.0, neginf=0.0)
        return np.asarray(0.5 * (whole + whole.T))

    def curve_deviation(self, sensor: int) -> Array:
        """Standard deviation (N,) [K] of one sensor's curve from that of the parameters."""
        by = np.concatenate([self.by_local[:, sensor] * self.model.active[sensor][:, None], self.by_shared[:, sensor]])
        return np.asarray(np.sqrt(np.maximum(np.einsum("in,ij,jn->n", by, self.joint_covariance(sensor), by), 0.0)))

    @cached_property
    def deviations(self) -> dict[Key, Any]:
        """Standard errors in search coordinates (of the logarithm where one is searched) by (part, name)."""
        local, shared, _ = self.covariance
        found: dict[Key, Any] = {}
        for j, c in enumerate(self.model.local):
            found[c.key] = np.hypot(np.sqrt(np.maximum(local[:, j, j], 0.0)), c.parameter.logging_steps * self.run.step)
        for j, c in enumerate(self.model.shared):
            found[c.key] = math.hypot(math.sqrt(max(float(shared[j, j]), 0.0)), c.parameter.logging_steps * self.run.step)
        return found


def inverse_normal_equations(fit: Fit, weight: Array) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
    """(blocks (S, a, a), border (S, a, b), corner (b, b)) of parameters and amplitudes with weights (S, N), and their covariances
    local (S, a, a), shared (b, b), local with shared (S, a, b).
    """
    whole = SearchSpace(fit.model, fit.columns, fit.prior)
    local, shared = whole.joined(fit.local, fit.shared, fit.own, fit.shared_amplitudes)
    by_local, by_shared = fit.by_local, fit.by_shared
    if fit.columns is not None:
        by_local, by_shared = np.concatenate([by_local, fit.columns.own]), np.concatenate([by_shared, fit.columns.shared])
    parts = assemble(by_local, by_shared, fit.residual, weight, whole.active, whole.prior, local, shared)[:3]
    with np.errstate(all="ignore"):  # a direction without any information has a variance beyond all numbers
        return parts, arrow_inverse(*parts, whole.active)


def start_values(run: Observations) -> dict[Key, Any]:
    """Rate, level and start of each sensor (S,) from the base law alone."""
    if run.heat is not None:
        return _driven_start(run)
    rate, level, start = (np.empty(run.sensors) for _ in range(3))
    for i in range(run.sensors):
        used = run.used[i]
        if int(used.sum()) < 3:
            rate[i], level[i], start[i] = 0.01, 20.0, 20.0
            continue
        time = run.time[used]
        fit = fit_decay(time, run.reading[i][used], run.weight[i][used])
        rate[i] = max(fit.rate, 0.05 / run.span)
        if fit.rate < rate[i]:
            first, slope = float(fit.predict(time[:1])[0]), fit.slope
            start[i], level[i] = first, first + slope / rate[i]
        else:
            start[i], level[i] = float(fit.predict(run.time[:1])[0]), fit.steady_state
    return {RATE: rate, LEVEL: level, START: start}


def _early_rate(run: Observations) -> float:
    """Rate [1/min], median over the sensors, of the readings up to where each is farthest from its first."""
    rates = []
    for row, weight, used in zip(run.reading, run.weight, run.used, strict=True):
        time, reading = run.time[used], row[used]
        far = int(np.argmax(np.abs(reading - reading[0]))) + 1 if len(reading) else 0
        if far >= 12:
            rates.append(fit_decay(time[:far], reading[:far], weight[used][:far]).rate)
    found = [float(r) for r in rates if r > 0.0]
    return max(float(np.median(found)) if found else 0.0, 3.0 / run.span)


def _driven_start(run: Observations) -> dict[Key, Any]:
    """As :func:`start_values` where a logged column drives the heat: level and start for each of many rates, the best kept."""
    model = Model(run).freeze(RATE)
    rates = np.geomspace(0.3 / run.span, min(1.0 / run.step, 200.0 / run.span), 16)
    n = run.sensors
    top = np.array([float(np.nanmax(row)) for row in np.where(run.used, run.reading, np.nan)])
    first = np.array([float(row[used][0]) for row, used in zip(run.reading, run.used, strict=True)])
    local, shared = model.vector({LEVEL: top, START: first, RATE: np.full(n, 0.01)})
    many = np.tile(local, (len(rates), 1))
    at = model.column(RATE)
    many[:, at] = np.clip(np.repeat(np.log(rates), n), model.low_local[at], model.high_local[at])
    fit = search(model, many, shared, None, 6, np.tile(np.arange(n), len(rates)), hold_shared=True)
    best = np.argmin(fit.rss.reshape(len(rates), n), axis=0) * n + np.arange(n)
    return model.named(fit.local[best], shared)


def fit_model(
    run: Observations,
    parts: Sequence[Part] = (),
    start: dict[Key, Any] | None = None,
    prior: Prior | None = None,
    most: int = MOST_ITERATIONS,
) -> Fit:
    """Least-squares fit of the base model and `parts`, all sensors together, from `start` (values by (part, name))."""
    model = Model(run, parts)
    told = start or {}
    local, shared = model.vector(told if RATE in told else {**start_values(run), **told})
    return search(model, local, shared, prior, most)


def search(
    model: Model,
    local: Array,
    shared: Array,
    prior: Prior | None = None,
    most: int = MOST_ITERATIONS,
    sensor: Any = None,
    hold_shared: bool = False,
    columns: Columns | None = None,
    ends_at: tuple[float, float] = (GAIN_AT_END, SHARE_AT_END),
    polish: int = 0,
) -> Fit:
    """Projected Levenberg-Marquardt from search coordinates local (R, kl), shared (ks,).

    Where nothing is shared each row has its own damping and ends by itself; otherwise all move together. `sensor` (R,) allows
    several rows of one sensor (several starts at once); rows are the sensors by default. `hold_shared` searches the local
    parameters alone. `columns` are those of a coloured noise, whose amplitudes are searched with the parameters.
    A row ends with a step that gains less than `ends_at`: in units of the noise variance, and as a share of the sum of squares.
    `polish` undamped steps follow, which no sum of squares judges: near its minimum it is flat to rounding, its slope is not.
    """
    whole, given = SearchSpace(model, columns, prior), prior
    prior = whole.prior
    local, shared = whole.joined(local, shared, None, None)
    run = model.run
    sensor = np.arange(run.sensors) if sensor is None else sensor
    reading, used = run.known[sensor], run.used[sensor]
    weight = run.weight[sensor] / np.maximum(run.noise[sensor], 1e-9)[:, None] ** 2
    active = whole.active[sensor]
    rows, together = len(sensor), len(shared) > 0 and not hold_shared

    def evaluate(at_local: Array, at_shared: Array, on: Any) -> tuple[Array, ...]:
        with np.errstate(all="ignore"):
            curve, moved = whole.curve(at_local, at_shared, sensor[on])
            residual = np.where(used[on], reading[on] - curve, 0.0)
            if columns is not None:
                residual = np.where(used[on], residual - moved, 0.0)
            cost = (weight[on] * residual**2).sum(axis=1)
            if prior is not None:
                cost = cost + prior.cost(at_local, at_shared)
        bad = ~np.isfinite(cost)
        if bad.any():
            curve, residual = (np.clip(np.nan_to_num(v), -BEYOND, BEYOND) for v in (curve, residual))
        return curve, residual, np.where(bad, np.inf, cost)

    # Rows that are searched apart and have ended are worked out no more; derivatives only where a step was taken.
    on = np.arange(rows)
    curve, residual, cost = evaluate(local, shared, on)
    dl, ds = (np.empty((k, *curve.shape)) for k in (local.shape[1], len(shared)))
    stale = np.ones(rows, dtype=bool)

    def differentiate(who: NDArray[np.int_], by_shared: bool = True) -> bool:
        if len(who):
            with np.errstate(all="ignore"):
                dl[:, who], ds[:, who] = whole.slopes(local[who], shared, sensor[who], curve[who], by_shared)
            stale[who] = False
        return len(who) > 0

    local, damping, live, converged = local.copy(), np.full(rows, 1e-3), np.ones(rows, dtype=bool), False
    for _ in range(most):
        here, may_move = local[on], active[on]
        if differentiate(on[stale[on]], not hold_shared) or not together:
            slopes = finite_slopes(dl[:, on]), finite_slopes(ds[:, on])
            parts = assemble(*slopes, residual[on], weight[on], may_move, prior, here, shared)
        blocks, border, corner, right, right_shared = parts
        if hold_shared:
            border, corner, right_shared = border[:, :, :0], corner[:0, :0], right_shared[:0]
        # A parameter at its bound that wants beyond it stays there for this step.
        stuck = ((here <= whole.low_local) & (right < 0.0)) | ((here >= whole.high_local) & (right > 0.0))
        stuck_shared = np.zeros(0, dtype=bool)
        if together:
            stuck_shared = (shared <= whole.low_shared) & (right_shared < 0.0)
            stuck_shared |= (shared >= whole.high_shared) & (right_shared > 0.0)
        move, move_shared = arrow_step(blocks, border, corner, right, right_shared, stuck | ~may_move, stuck_shared, damping[on])
        trial = np.where(live[on, None] & may_move, np.clip(here + move, whole.low_local, whole.high_local), here)
        trial_shared = np.clip(shared + move_shared, whole.low_shared, whole.high_shared) if together else shared
        after = evaluate(trial, trial_shared, on)
        total, new = (cost, after[2]) if not together else (np.full(rows, v.sum()) for v in (cost, after[2]))
        with np.errstate(invalid="ignore"):  # from one that was beyond all numbers to another
            gain = total[on] - new
        better = new < total[on]
        done = better & (gain < ends_at[0] + ends_at[1] * total[on])
        damping[on] = np.where(better, damping[on] * 0.2, damping[on] * 8.0)
        live[on] &= ~(done | (damping[on] > 1e8))
        took = on[better]
        local[took], curve[took], residual[took], cost[took] = trial[better], *(a[better] for a in after)
        stale[took] = True
        if together and better[0]:
            shared = trial_shared
        if not live.any():
            converged = True
            break
        if not together and prior is None:
            on = np.flatnonzero(live)
    everyone = np.arange(rows)
    differentiate(everyone[stale | (hold_shared and len(shared) > 0)])
    for _ in range(polish):
        parts = assemble(dl, ds, residual, weight, active, prior, local, shared)
        still, none = ~active, np.zeros(len(shared), dtype=bool)
        move, move_shared = arrow_step(*parts, still, none, np.zeros(rows))
        local, shared = local + move, shared + move_shared
        curve, residual, cost = evaluate(local, shared, everyone)
        differentiate(everyone)
    rss = (run.weight[sensor] * residual**2).sum(axis=1)
    kl, ks = whole.kl, whole.ks
    noise = (columns, local[:, kl:], shared[ks:]) if columns is not None else ()
    return Fit(model, local[:, :kl], shared[:ks], curve, dl[:kl], ds[:ks], rss, converged, given, *noise)


def at_rates(fit: Fit, rates: Array) -> Fit:
    """The same model with the rates (S,) [1/min] held, and the rest fitted anew.

    A fit without the effect that is missing bends its rate to imitate it; from other rates the effect shows.
    """
    model = Model(fit.run, fit.model.parts).freeze(RATE)
    local, at = fit.local.copy(), model.column(RATE)
    local[:, at] = np.clip(np.log(rates), model.low_local[at], model.high_local[at])
    return search(model, local, fit.shared.copy(), fit.prior, 6, hold_shared=True, columns=fit.columns)


def refit(fit: Fit, run: Observations, most: int = 12) -> Fit:
    """The same model fitted to other weights of the same grid, from where `fit` ended."""
    model = Model(run, fit.model.parts)
    return search(model, fit.local.copy(), fit.shared.copy(), fit.prior, most, columns=fit.columns)


def settled(fit: Fit) -> Fit:
    """The fit, gone on with where it was broken off before it came to rest: a search among many breaks off early."""
    return fit if fit.converged else refit(fit, fit.run, UNTIL_AT_REST)


def with_parts(fit: Fit, parts: Sequence[Part]) -> dict[Key, Any]:
    """Start values for a model of `parts` from a fit, effects matched by their id."""
    ids = {part.id: i for i, part in enumerate(parts)}
    return {
        Key(ids[fit.model.parts[p].id] if p >= 0 else -1, name): value
        for (p, name), value in fit.values.items()
        if p < 0 or fit.model.parts[p].id in ids
    }


def rows_of(fit: Fit, keep: Any) -> Fit:
    """A fit of many rows reduced to one row per sensor: keep (S,) row indices."""
    return replace(
        fit,
        local=fit.local[keep],
        curve=fit.curve[keep],
        by_local=fit.by_local[:, keep],
        by_shared=fit.by_shared[:, keep],
        rss=fit.rss[keep],
    )
