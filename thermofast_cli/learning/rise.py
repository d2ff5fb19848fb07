"""The rise that a model with effects, or a logged drive, gives each sensor of a run, in place of one exponential."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.arrow import covariance_root
from thermofast.models.imperfection import GRID, NODES, Rise
from thermofast.models.joint import LEVEL, RATE, START, Fit, Key, Model
from thermofast.models.observations import up_to
from thermofast.models.relaxation import relaxed

from .jumps import last_level

Array = NDArray[np.float64]

#: The free run goes on for this many of the slowest time constants, over so many points.
HORIZON, AFTER = 12.0, 800
#: A level this near to the start [K] has no shape of its own to be read off.
LEAST_RISE = 1e-3
#: Times what readings leave open of an effect's parameters is the prior with which the same readings are counted again: they then
#: leave a fifth less.
COUNTED_AGAIN = 4.0
#: Share of a doubt by which a curve is moved to see what it does: parameters that make up for each other do so along the tangent.
TANGENT = 0.05
#: What nothing determines moves no further than this, in search coordinates.
MOST_DOUBT = 2.0
#: An effect that grows without end moves a temperature by so much at most [K].
MOST_MOVED = 1e6
#: A body with a faster or slower part follows a drive, or a load that changes, at these log rates beside its own.
DRIVEN_MODES = np.log([0.2, 0.45, 2.0, 5.0, 12.0])


def rises_of(
    fit: Fit,
    whole: Observations,
    nodes: Array = NODES,
    until_min: float | None = None,
    other_modes: float = 0.0,
    stretch: float = 0.0,
) -> dict[str, Rise]:
    """Of every sensor of a fitted model; `whole` holds what was logged after the readings that the fit saw, too.

    Where the level is that of the fit the curve is its own. What no heat brings (a room that is logged, a coolant) stands beside
    the rise; the uncertainty of an effect's parameters is its doubt. nodes (L,) are the log rates
    about that of the fit at which it is worked out. What is logged counts up to until_min, as long as the record without.
    other_modes: share (1 sd) of what the heat does that a sensor may follow at each of DRIVEN_MODES. stretch: deviation of the
    logarithm by which the rates of all sensors that are linked may be others together than in the runs learnt from.
    """
    used = np.flatnonzero(fit.run.used.any(axis=0))
    last = int(used[-1])
    end = float(whole.time[-1])
    rest, later = HORIZON / min(slowest(fit, i) for i in range(fit.run.sensors)), np.linspace(0.0, 1.0, AFTER + 1)[1:]
    if other_modes > 0.0:  # until the slowest of them has come to its end, too, whenever the record ends
        rest, later = rest / float(np.exp(DRIVEN_MODES.min())), later**2
    later = end + rest * later
    seen = together(fit, _extended(fit, whole, len(whole.time) - 1, last, later), last, range(len(fit.model.parts)))
    told = len(whole.time) if until_min is None else int(np.searchsorted(whole.time, up_to(until_min), "right"))
    held = together(fit, _extended(fit, whole, max(last, told - 1), last, later), last, lasting(fit))
    of_others = (_of_others(fit, over, last, stretch) for over in (seen, held))
    runs = _Runs(seen, held, float(whole.time[max(last, told - 1)]), *of_others)
    return {c: _rise(fit, i, runs, nodes, other_modes) for i, c in enumerate(fit.run.channels)}


@dataclass(frozen=True)
class _Runs:
    """A record as logged and with all held from `until` [min] on, and what the doubt of others does in each (J, S, n) [K]."""

    seen: Observations
    held: Observations
    until: float
    of_others: Array
    of_held: Array


def _of_others(fit: Fit, over: Observations, last: int, stretch: float = 0.0) -> Array:
    """What each sensor of a record may move (J, S, N) [K] because another one's end is not known, by a deviation each: of one other
    by its own, and of all others together by a `stretch` of their rates.
    """
    every, sensors = range(len(fit.model.parts)), np.arange(fit.run.sensors)
    if not any(part.effect.reads_sensors for part in fit.model.parts):
        return np.zeros((0, len(sensors), len(over.time)))
    found = []
    for s in range(fit.run.sensors):
        roots = covariance_root(fit.joint_covariance(s)).T
        roots *= np.minimum(1.0, MOST_DOUBT / np.maximum(np.linalg.norm(roots, axis=1, keepdims=True), 1e-300))
        kl = fit.local.shape[1]
        rows = np.concatenate([fit.local[s][None], fit.local[s] + roots[:, :kl]])
        ends = free_run(fit, over, rows, np.concatenate([fit.shared[None], fit.shared + roots[:, kl:]]), s, every)[:, -1]
        moved = np.clip(np.nan_to_num(ends[1:] - ends[0]), -MOST_MOVED, MOST_MOVED)
        move = moved @ roots / max(float(np.linalg.norm(moved)), 1e-300)
        local = fit.local.copy()
        local[s] += move[:kl]
        other = together(replace(fit, local=local), over, last, every).reading - over.reading
        other[s] = 0.0
        found.append(np.clip(np.nan_to_num(other), -MOST_MOVED, MOST_MOVED))
    if stretch > 0.0:
        found.append(_of_slower_others(fit, over, last, stretch))
    return np.array(found)


def _of_slower_others(fit: Fit, over: Observations, last: int, stretch: float) -> Array:
    """What each sensor moves (S, N) [K] where all others are slower by exp(stretch), and still where they were read last."""
    every, sensors = range(len(fit.model.parts)), np.arange(fit.run.sensors)
    shared = np.tile(fit.shared, (len(sensors), 1))
    rate, level = fit.model.column(RATE), fit.model.column(LEVEL)
    slower, higher = fit.local.copy(), fit.local.copy()
    slower[:, rate] -= stretch
    higher[:, level] += 1.0
    base, of_rate, of_level = (
        free_runs(fit, over, local, shared, sensors, every)[:, last] for local in (fit.local, slower, higher)
    )
    with np.errstate(all="ignore"):
        risen = np.nan_to_num((base - of_rate) / (of_level - base))
    slower[:, level] += np.clip(risen, -MOST_MOVED, MOST_MOVED)
    found = np.zeros_like(over.reading)
    for i in sensors:
        local = slower.copy()
        local[i] = fit.local[i]
        found[i] = (together(replace(fit, local=local), over, last, every).reading - over.reading)[i]
    return np.clip(np.nan_to_num(found), -MOST_MOVED, MOST_MOVED)


def _rise(fit: Fit, i: int, runs: _Runs, about: Array, other_modes: float) -> Rise:
    seen, held = runs.seen, runs.held
    level, start = float(fit.values[LEVEL][i]), float(fit.values[START][i])
    log_rate = float(np.log(fit.values[RATE][i]))
    rise = level - start if abs(level - start) > LEAST_RISE else LEAST_RISE
    moves, nodes, kl = _doubtful(fit, i), len(about), fit.local.shape[1]
    # Rows: at each rate with the heat and without, then each doubt at the rate of the fit.
    rows, shared = (np.tile(v, (2 * nodes + len(moves), 1)) for v in (fit.local[i], fit.shared))
    rows[:nodes, fit.model.column(RATE)] = rows[nodes : 2 * nodes, fit.model.column(RATE)] = log_rate + about
    rows[:, fit.model.column(LEVEL)] = start + rise
    rows[nodes : 2 * nodes, fit.model.column(LEVEL)] = start
    rows[2 * nodes :] += TANGENT * moves[:, :kl]
    shared[2 * nodes :] += TANGENT * moves[:, kl:]
    curves = free_run(fit, seen, rows, shared, i, range(len(fit.model.parts)))
    kept = free_run(fit, held, rows, shared, i, lasting(fit))
    # The clock of a sensor begins with its own first reading.
    begin, middle = float(fit.run.time[fit.run.used[i]][0]), nodes // 2
    time, until = seen.time - begin, runs.until - begin
    over = [GRID / np.exp(log_rate + off) for off in about]
    unit, of_end = ((c[:nodes] - c[nodes : 2 * nodes]) / rise for c in (curves, kept))
    whole = kept[:nodes] - kept[:nodes, :1]

    def at_rate(lines: Sequence[Array]) -> Array:
        return np.array([np.interp(over[middle], time, line) for line in lines]).reshape(-1, len(GRID))

    def wrong(all_of: Array, of_neighbours: Array) -> Array:
        return at_rate([line / rise for line in (*((all_of[2 * nodes :] - all_of[middle]) / TANGENT), *of_neighbours)])

    def follows(over_run: Observations, own: Array) -> Array:
        some = _driven(fit, i, over_run, log_rate + DRIVEN_MODES, start, rise) if other_modes > 0.0 else ()
        return other_modes * at_rate([line - own[middle] for line in some])

    whole = np.where(np.abs(whole[:, -1:]) > LEAST_RISE, whole / np.where(whole[:, -1:] == 0.0, 1.0, whole[:, -1:]), of_end)

    def on_grid(lines: Array) -> Array:
        return np.array([np.interp(x, time, line) - np.interp(0.0, time, line) for x, line in zip(over, lines, strict=True)])

    def as_logged(lines: Array, kept_lines: Array) -> Array:
        """With the first point of the grid that lies ahead as it is with all held: it is joined to the readings used."""
        if lasting(fit) == list(range(len(fit.model.parts))):
            ends = over if len(lines) == len(over) else [over[middle]] * len(lines)
            for line, other, points in zip(lines, kept_lines, ends, strict=True):
                ahead = min(int(np.searchsorted(points, until, "right")), len(points) - 1)
                line[ahead] = other[ahead]
        return lines

    held_curve, held_doubt, held_others = on_grid(of_end), wrong(kept, runs.of_held[:, i]), follows(held, of_end)
    return Rise(
        log_rate,
        as_logged(on_grid(unit), held_curve),
        held_curve,
        on_grid(whole),
        as_logged(wrong(curves, runs.of_others[:, i]), held_doubt),
        time,
        curves[nodes + middle] - start,
        float(kept[nodes + middle, -1] - start),
        about,
        as_logged(follows(seen, unit), held_others),
        held_doubt,
        held_others,
        other_modes,
    )


def _driven(fit: Fit, i: int, seen: Observations, log_rates: Array, start: float, rise: float) -> Array:
    """What the heat alone does (F, N) to a sensor that follows at other rates, over its rise."""
    count = len(log_rates)
    rows = np.tile(fit.local[i], (2 * count, 1))
    rows[:, fit.model.column(RATE)] = np.tile(log_rates, 2)
    rows[:count, fit.model.column(LEVEL)], rows[count:, fit.model.column(LEVEL)] = start + rise, start
    curves = free_run(fit, seen, rows, np.tile(fit.shared, (2 * count, 1)), i, range(len(fit.model.parts)))
    found: Array = (curves[:count] - curves[count:]) / rise
    return found


def slowest(fit: Fit, sensor: int) -> float:
    """The slowest rate [1/min] by which anything of a sensor's model settles, no less than 1e-5."""
    rates = [float(fit.values[RATE][sensor])]
    for k, part in enumerate(fit.model.parts):
        for p in part.effect.parameters:
            if p.settles and Key(k, p.name) in fit.values and part.concerns(fit.run.sensors)[sensor]:
                value = fit.values[Key(k, p.name)]
                value = float(value[sensor]) if np.ndim(value) else float(value)
                rates.append(value if p.settles == "rate" else 1.0 / max(value, 1e-9))
    return max(min(rates), 1e-5)


def lasting(fit: Fit) -> list[int]:
    """Places of a model's parts that lead to its limit: a probe that drifts or jumps is no part of its temperature.

    Nor is a wave, which goes on for ever about its mean: the limit, and the way there, are those of the mean over a cycle.
    """
    effects = [part.effect for part in fit.model.parts]
    return [k for k, effect in enumerate(effects) if effect.scope != "one" and not any(p.periodic for p in effect.parameters)]


def together(fit: Fit, over: Observations, last: int, keep: "range | list[int]") -> Observations:
    """A record in which, after reading `last`, each sensor is where the parts `keep` of the model take it among the others.

    What is read of a neighbour later is not known to somebody who foretells it; and who warms another is warmed by it in turn.
    """
    if not any(fit.model.parts[k].effect.reads_sensors for k in keep):
        return over
    sensors = np.arange(fit.run.sensors)
    shared = np.tile(fit.shared, (len(sensors), 1))

    def beside(curves: Array) -> Array:
        return free_runs(fit, replace(over, reading=curves), fit.local, shared, sensors, keep)

    return replace(over, reading=relaxed(over.filled, beside, np.arange(len(over.time)) > last))


def _extended(fit: Fit, whole: Observations, last: int, read: int, later: Array) -> Observations:
    """The record and beyond it, what is logged held as it was about reading `last` from then on, sensors as read up to `read`."""
    count, tau = len(whole.time), 1.0 / float(np.median(fit.values[RATE]))

    def on(column: Array, levels: Array | None = None) -> Array:
        known = column[: last + 1]
        held = last_level(whole.time[: last + 1], known if levels is None else levels[: last + 1], tau)
        return np.concatenate([known, np.full(count - len(known) + len(later), held)])

    time = np.concatenate([whole.time, later])
    values = fit.values
    level, rate = values[LEVEL][:, None], values[RATE][:, None]
    known = whole.filled[:, : read + 1]
    since = time[read + 1 :] - time[read]
    neighbours = np.concatenate([known, level + (known[:, -1:] - level) * np.exp(-rate * since)], axis=1)
    return replace(
        whole,
        time=time,
        reading=neighbours,
        weight=np.broadcast_to((np.arange(len(time)) <= read).astype(float), neighbours.shape),
        ambient={n: on(c) for n, c in whole.ambient.items()},
        inputs={n: on(c) for n, c in whole.inputs.items()},
        heat=None if whole.heat is None else on(whole.heat, whole.driven),
    )


def free_run(fit: Fit, over: Observations, rows: Array, shared: Array, sensor: int, keep: "range | list[int]") -> Array:
    """Curves (R, N) of one sensor over another record with the parts `keep` of the model."""
    return free_runs(fit, over, rows, shared, np.full(len(rows), sensor), keep)


def free_runs(
    fit: Fit, over: Observations, rows: Array, shared: Array, sensors: NDArray[np.intp], keep: "range | list[int]"
) -> Array:
    """The same of a sensor for each row (R,)."""
    own = [j for j, c in enumerate(fit.model.local) if c.part < 0 or c.part in keep]
    common = [j for j, c in enumerate(fit.model.shared) if c.part < 0 or c.part in keep]
    model = Model(over, [fit.model.parts[k] for k in keep], fit.model.active[:, own])
    local = rows[:, own].copy()
    if fit.run.sink_c is not None:  # the level stands against the mean of what was logged, which is another over another record
        local[:, model.column(LEVEL)] += model.sink_guess - fit.model.sink_guess
    curves: Array = model.forward(local, shared[:, common], sensors)
    return curves


def _doubtful(fit: Fit, sensor: int) -> Array:
    """Moves (J, kl + ks) by a deviation each of what is not known of a sensor's shape before its readings are counted.

    Of a machine learnt before that is what is known of its constants; of the rest, so many times what the readings leave open given
    these. They are counted again with rate, level and start, and what they leave open of all together must stay open.
    """
    kl = fit.local.shape[1]
    base = [fit.model.column(key) for key in (RATE, LEVEL, START)]
    active = np.concatenate([fit.model.active[sensor], np.ones(len(fit.shared), dtype=bool)])
    known, learnt = _learnt_before(fit, sensor)
    others = [j for j in np.flatnonzero(active).tolist() if j not in base and j not in known]
    blocks = [(known, learnt)] if known else []
    if others:
        whole = fit.joint_covariance(sensor)
        cross = whole[np.ix_(others, known)]
        left = whole[np.ix_(others, others)] - cross @ np.linalg.pinv(whole[np.ix_(known, known)]) @ cross.T
        blocks.append((others, COUNTED_AGAIN * 0.5 * (left + left.T)))
    moves = [np.zeros((0, kl + len(fit.shared)))]
    for columns, covariance in blocks:
        roots = covariance_root(covariance)
        roots /= np.maximum(np.linalg.norm(roots, axis=0) / MOST_DOUBT, 1.0)
        one = np.zeros((len(columns), kl + len(fit.shared)))
        one[:, columns] = roots.T
        moves.append(one)
    return np.concatenate(moves)


def _learnt_before(fit: Fit, sensor: int) -> tuple[list[int], Array]:
    """Places of the parameters of which a model file tells something, and their covariance, in search coordinates."""
    if fit.prior is None or fit.prior.before is None:
        return [], np.zeros((0, 0))
    covariance = fit.prior.before[sensor]
    known = np.flatnonzero(np.diagonal(covariance) > 0.0).tolist()
    return known, covariance[np.ix_(known, known)]
