"""``sensitivity``: how much each uncertain thing contributes to the spread of the steady state and of the settling time.

The identification is run again and again on a record in which the uncertain things were changed; a Hermite polynomial chaos of the
results gives the share of each (Sobol indices). What is changed are the readings as they are, so the shares hold for this record.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from thermofast.models import Lump
from thermofast.models.arrow import covariance_root
from thermofast.models.joint import RATE, Fit
from thermofast.models.uncertainty.chaos import Chaos, design, fit_chaos, to_uniform
from thermofast.models.uncertainty.reliability import first_order, monte_carlo

from ..errors import ThermofastError
from ..estimation.closing import estimate_at, track_of
from ..estimation.estimate import Estimate, FilterError
from ..estimation.request import Method
from ..estimation.rules import RULES
from ..estimation.sensor import Sensor, prepare, refusal
from ..learning.settle import reference_of, settling_point
from ..machine.learnt import carry
from ..machine.modelfile import ModelFile
from ..observing.task import LoopTask, failure_records, in_order, ready, refused_records
from ..reading.run import ends_before, said_short
from ..records import SensitivityRecord

Array = NDArray[np.float64]

#: Degree of the polynomials.
DEGREE = 2
#: A polynomial that misses this share of the variance tells no shares.
NOTHING_TOLD = 0.5
#: Draws of the polynomial for a probability.
COUNTED = 50_000
#: Share of the runs that may end undetermined.
MOST_LOST = 0.05
QUANTITIES = ("steady_state_c", "t95_min")


@dataclass(frozen=True)
class Sizes:
    """Standard deviations of what is uncertain beside the noise: probe offset [K], start [K], room [K], time stamps [s],
    identification time [min]; limit [K] of the steady state's error, or None. Those
    named as uniform lie evenly within +- their size.
    """

    offset: float = 0.1
    start: float = 0.2
    room: float = 0.3
    jitter: float = 1.0
    until: float = 2.0
    limit: float | None = None
    uniform: tuple[str, ...] = ()


@dataclass(frozen=True)
class Factor:
    """One uncertain thing: `inputs` standard normals of the design, its standard deviation and unit."""

    name: str
    size: float
    unit: str
    inputs: int = 1
    uniform: bool = False


#: Sizes that may be bounds in place of standard deviations.
BOUNDS = ("offset", "start", "room", "until")


@dataclass(frozen=True)
class SensitivityTask:
    """One run and what is uncertain of it."""

    loop: LoopTask
    method: Method
    sizes: Sizes

    @property
    def channels(self) -> tuple[str, ...]:
        """What a progress bar counts."""
        return self.loop.channels

    def singles(self) -> list["SensitivityTask"]:
        """A run is worked on as a whole."""
        return [self]


def sensitivity_task(task: SensitivityTask) -> list[list[SensitivityRecord]]:
    """A run studied; whatever is wrong with it is a record."""
    try:
        return [_with_model(task) if task.loop.model is not None else _plain(task)]
    except ThermofastError as error:
        return [failure_records(SensitivityRecord, task.loop, error)]


#: What the shares and a limit of kelvin leave out, without a model learnt.
BESIDE = "what the machine does beside the law is not among these, and often the largest: the interval of identify counts it"


def sensitivity_lost(task: SensitivityTask, why: str) -> list[list[SensitivityRecord]]:
    """The record of a run whose worker died."""
    return [[SensitivityRecord(task.loop.run.name, "", status="failed", message=why)]]


def _plain(task: SensitivityTask) -> list[SensitivityRecord]:
    """Each sensor by itself, through the filter and its closing step."""
    loop, run = task.loop, task.loop.run
    minutes = run.time_s / 60.0
    records: list[SensitivityRecord] = []
    ends = ("too_short", said_short(run, loop.until_min)) if ends_before(run, loop.until_min) else None
    for channel, values in run.channels.items():
        sensor = prepare(minutes, values, loop.start_min)
        refused = ends or refusal(sensor, loop.until_min, loop.start_min)
        if refused:
            records.append(SensitivityRecord(run.name, channel, status=refused[0], message=refused[1]))
            continue
        first, *others = _sensor_records(task, run.name, channel, sensor)
        beside = "" if first.message else BESIDE
        records += [replace(first, message=first.message or beside), *others]
    return records


def _sensor_records(task: SensitivityTask, run: str, channel: str, sensor: Sensor) -> list[SensitivityRecord]:
    until = task.loop.until_min if task.loop.until_min is not None else float(sensor.time[-1])
    try:
        centre = _estimated(task.method, sensor.time, sensor.reading, until, sensor.resolution)
    except FilterError as error:
        return [SensitivityRecord(run, channel, status="diverged", message=str(error))]
    if centre is None or centre.steady_state is None or centre.t95 is None or not np.isfinite(centre.covariance).all():
        why = "the steady state is not determined by these readings: nothing to vary around; measure longer"
        return [SensitivityRecord(run, channel, status="not_determined", message=why)]
    factors, change = _plain_factors(task.sizes, sensor, until, centre)

    def outcome(point: Array) -> tuple[float, float]:
        reading, to = change(point)
        found = _estimate(task.method, sensor.time, reading, to, sensor.resolution)
        if found is None or found.steady_state is None or found.t95 is None:
            return np.nan, np.nan
        return found.steady_state, found.t95

    points = _points(factors)
    outputs = np.array([outcome(point) for point in _bounded(factors, points)])
    blank = SensitivityRecord(run, channel, until_min=until, runs=len(points))
    return _records(blank, factors, points, outputs, task.sizes.limit)


def _estimate(method: Method, time: Array, reading: Array, until: float, resolution: float) -> Estimate | None:
    with suppress(FilterError):
        return _estimated(method, time, reading, until, resolution)
    return None


def _estimated(method: Method, time: Array, reading: Array, until: float, resolution: float) -> Estimate | None:
    count = int(np.searchsorted(time, until + 1e-9, "right"))
    if count < RULES.fewest_readings:
        return None
    track = track_of(method.filter, method.model, time[:count], reading[:count], resolution)
    if track.diverged_at is not None:
        raise FilterError(f"the filter diverged at reading {track.diverged_at + 1}, {time[track.diverged_at]:.4g} min")
    return estimate_at(method.model, method.filter, track, time[:count], reading[:count], count - 1, resolution)


def _plain_factors(
    sizes: Sizes, sensor: Sensor, until: float, centre: Estimate
) -> tuple[list[Factor], Callable[[Array], tuple[Array, float]]]:
    """Factors of a sensor by itself, and the readings (N,) and the identification time [min] at a design point."""
    time = sensor.time
    rate = float(centre.state[2])
    inside = time <= until + 1e-9
    by_state = _tangent(centre, time)
    slope = np.gradient(Lump().free_run(centre.state, time - centre.time), time)
    back = np.linalg.pinv(by_state[inside])
    stamps = back @ np.diag((slope[inside] * sizes.jitter / 60.0) ** 2) @ back.T
    noise_root, stamp_root = covariance_root(centre.covariance), covariance_root(stamps)
    # The room warms in a straight line while the readings are taken, and the lump follows by its own rate.
    since = time - time[0]
    lagged = _lagged_ramp(since, until - time[0], rate)
    factors = [
        Factor("probe noise", centre.noise, "K", 3),
        Factor("time stamps", sizes.jitter, "s", 3),
        Factor("probe offset", sizes.offset, "K", uniform="offset" in sizes.uniform),
        Factor("start level", sizes.start, "K", uniform="start" in sizes.uniform),
        Factor("room", sizes.room, "K", uniform="room" in sizes.uniform),
        Factor("identification time", sizes.until, "min", uniform="until" in sizes.uniform),
    ]

    def change(point: Array) -> tuple[Array, float]:
        noise, stamp, (offset, start, room, minutes) = point[:3], point[3:6], point[6:]
        added = by_state @ (noise_root @ noise + stamp_root @ stamp)
        added = added + offset * sizes.offset + start * sizes.start * np.exp(-rate * since) + room * sizes.room * lagged
        return sensor.reading + added, until + minutes * sizes.until

    return factors, change


def _lagged_ramp(time: Array, until: float, rate: Any) -> Array:
    """What a room that warms by 1 K in a straight line until then adds to a lump of this rate, and to one after the other."""
    within, after = np.minimum(time, until), np.maximum(time - until, 0.0)
    return np.asarray(within / until - (1.0 - np.exp(-rate * within)) / (rate * until) * np.exp(-rate * after))


def _tangent(centre: Estimate, time: Array) -> Array:
    """Derivative (N, 3) of the free run by the state."""
    columns = []
    for j in range(3):
        step = 1e-4 * max(abs(float(centre.state[j])), 1e-3)
        moved = [centre.state + sign * step * np.eye(3)[j] for sign in (1.0, -1.0)]
        up, down = (Lump().free_run(state, time - centre.time) for state in moved)
        columns.append((up - down) / (2.0 * step))
    return np.stack(columns, axis=1)


def _points(factors: list[Factor]) -> Array:
    return design(sum(f.inputs for f in factors), DEGREE, uniform=_evenly(factors))


def _evenly(factors: list[Factor]) -> tuple[int, ...]:
    """Numbers of the inputs that lie evenly within their bounds."""
    firsts = np.cumsum([0, *[f.inputs for f in factors]]).tolist()
    return tuple(i for f, first in zip(factors, firsts, strict=False) if f.uniform for i in range(first, first + f.inputs))


def _bounded(factors: list[Factor], points: Array) -> Array:
    """Points (n, d) as shares of the factors' sizes: normal numbers, or evenly from -1 to 1."""
    shares = points.copy()
    for i in _evenly(factors):
        shares[:, i] = to_uniform(points[:, i], -1.0, 1.0)
    return shares


def _with_model(task: SensitivityTask) -> list[SensitivityRecord]:
    """All sensors together, through the learnt model: its machine constants are uncertain as the file says."""
    loop = task.loop
    assert loop.model is not None
    observed, prepared = ready(loop)
    if prepared is None:
        return refused_records(SensitivityRecord, loop.run.name, observed)
    file, source, whole, sizes = loop.model.file, loop.model.source, prepared.whole, task.sizes
    until = loop.fitted_min if loop.fitted_min is not None else whole.span
    constants = [(owner, n) for owner, n in _shared_constants(file) if n.standard_error]
    factors = [
        Factor("probe noise", float(np.median(whole.noise)), "K", 2),
        Factor("time stamps", sizes.jitter, "s", 2),
        Factor("probe offset", sizes.offset, "K", uniform="offset" in sizes.uniform),
        Factor("start level", sizes.start, "K", uniform="start" in sizes.uniform),
        Factor("room", sizes.room, "K", uniform="room" in sizes.uniform),
        Factor("identification time", sizes.until, "min", uniform="until" in sizes.uniform),
        *[Factor(f"{owner}.{n.name}" if owner else n.name, float(n.standard_error or 0.0), n.unit) for owner, n in constants],
    ]
    centre = carry(file, prepared.seen, loop.run.name, loop.model.source).fit
    slope = np.gradient(centre.curve, whole.time, axis=1)
    noise_of = _level_roots(centre, np.broadcast_to(centre.noise[:, None], centre.curve.shape))
    stamps_of = _level_roots(centre, np.abs(slope) * sizes.jitter / 60.0)
    rates = centre.values[RATE][:, None]
    fading = np.exp(-rates * whole.time)
    # A model that follows the logged surroundings errs by their probe; one that does not, by how the room warms unseen.
    follows = any(p.choice.constants.get("column") in whole.ambient for p in centre.model.parts)
    warming = np.zeros_like(fading) if follows else _lagged_ramp(whole.time, until, rates)

    def outcome(point: Array) -> Array:
        noise, stamps, (offset, start, room, minutes), moved = point[:2], point[2:4], point[4:8], point[8:]
        added = noise_of @ noise + stamps_of @ stamps + offset * sizes.offset + start * sizes.start * fading
        added = added + room * sizes.room * warming
        changed = replace(
            whole,
            reading=whole.reading + added,
            ambient={n: c + room * sizes.room * follows for n, c in whole.ambient.items()},
        )
        seen = changed.until(until + minutes * sizes.until)
        fit = carry(_moved(file, constants, moved), seen, loop.run.name, source).fit
        reference = reference_of(seen)
        return np.asarray([settling_point(fit, i, reference) for i in range(whole.sensors)])

    points = _points(factors)
    outputs = np.array([outcome(point) for point in _bounded(factors, points)])
    records: list[SensitivityRecord] = []
    for i, channel in enumerate(whole.channels):
        blank = SensitivityRecord(loop.run.name, channel, until_min=loop.start_min + until, runs=len(points))
        records += _records(blank, factors, points, outputs[:, i], sizes.limit)
    return in_order([*records, *refused_records(SensitivityRecord, loop.run.name, observed)], loop.run)


def _shared_constants(file: ModelFile) -> list[tuple[str, Any]]:
    """(effect, number) of the machine's constants that all sensors share, and one for each constant of single sensors."""
    found: list[tuple[str, Any]] = []
    for owner, numbers in [("", file.base), *[(e.id, e.parameters) for e in file.effects]]:
        names = dict.fromkeys(n.name for n in numbers if n.belongs == "machine")
        found += [(owner, next(n for n in numbers if n.name == name)) for name in names]
    return found


def _moved(file: ModelFile, constants: list[tuple[str, Any]], points: Array) -> ModelFile:
    """The model with its constants moved by so many of their standard errors, each sensor's by its own, and held there."""
    shift = {(owner, n.name): float(p) for (owner, n), p in zip(constants, points, strict=True)}

    def moved(owner: str, numbers: Any) -> Any:
        return tuple(
            msgspec.structs.replace(n, value=_inside(n, shift[owner, n.name]), standard_error=0.0)
            if (owner, n.name) in shift and n.standard_error
            else n
            for n in numbers
        )

    effects = tuple(msgspec.structs.replace(e, parameters=moved(e.id, e.parameters)) for e in file.effects)
    return msgspec.structs.replace(file, base=moved("", file.base), effects=effects, correlations=())


def _inside(number: Any, shift: float) -> float:
    """A value moved by a share of its standard error; one that is positive stays so."""
    if number.value > 0.0:
        return float(number.value * np.exp(shift * min(number.standard_error / number.value, 1.0)))
    return float(number.value + shift * number.standard_error)


def _level_roots(fit: Fit, deviation: Array) -> Array:
    """What independent errors of the readings, deviation (S, N) [K], put into each sensor's own level and start: changes
    (S, N, 2) of its curve.
    """
    run = fit.run
    roots = np.zeros((run.sensors, len(run.time), 2))
    for i in range(run.sensors):
        by, used = fit.by_local[1:3, i].T, run.used[i]
        back = np.linalg.pinv(by[used])
        roots[i] = by @ covariance_root((back * deviation[i][used] ** 2) @ back.T)
    return roots


def _records(
    blank: SensitivityRecord, factors: list[Factor], points: Array, outputs: Array, limit: float | None
) -> list[SensitivityRecord]:
    good = np.isfinite(outputs).all(axis=1)
    lost = int((~good).sum())
    records: list[SensitivityRecord] = []
    for q, quantity in enumerate(QUANTITIES):
        named = replace(blank, quantity=quantity, lost=lost)
        if lost > MOST_LOST * len(points):
            why = f"{lost} of {len(points)} changed records do not determine the steady state: measure longer or take smaller sizes"
            records.append(replace(named, status="not_determined", message=why))
            continue
        chaos = fit_chaos(points[good], outputs[good, q], DEGREE, _evenly(factors))
        # A probability lives in the tails, where a polynomial that misses some of the variance is worth nothing.
        exceeds: dict[str, Any] = {}
        if limit is not None and quantity == "steady_state_c" and not chaos.doubt:
            exceeds = _exceedance(chaos, limit)
        if chaos.unexplained > NOTHING_TOLD:
            why = f"{quantity}: no shares: {chaos.doubt}; try a shorter --until or smaller uncertainties"
            records.append(replace(named, surrogate_error=chaos.unexplained, status="not_determined", message=why))
            continue
        spread = replace(
            named,
            mean=chaos.mean,
            deviation=chaos.standard_deviation,
            surrogate_error=chaos.unexplained,
            status="model_doubtful" if chaos.doubt else "ok",
            message=f"{quantity}: the shares are rough: {chaos.doubt}" if chaos.doubt else "",
            **exceeds,
        )
        firsts = np.cumsum([0, *[f.inputs for f in factors]]).tolist()
        groups = [range(a, b) for a, b in pairwise(firsts)]
        for factor, mine, rank, confidence in zip(factors, groups, *chaos.ranks(groups), strict=True):
            shares: dict[str, Any] = {"first_order": chaos.alone(mine), "total": chaos.in_all(mine)}
            if factor.size > 0.0:  # what is taken to be known has no place among what is not
                shares |= {"rank": int(rank), "rank_p": float(confidence)}
            records.append(
                replace(spread, factor=factor.name, size=factor.size, unit=factor.unit, uniform=factor.uniform, **shares)
            )
    return records


def _exceedance(chaos: Chaos, limit: float) -> dict[str, Any]:
    """Probability that the steady state is further than `limit` [K] from its mean: first order, and counted on the polynomial."""
    about = replace(chaos, coefficients=np.concatenate([[0.0], chaos.coefficients[1:]]))
    counted = monte_carlo(about, limit, chaos.dimension, COUNTED)
    return {
        "exceed_p_form": first_order(about, limit).probability,
        "exceed_p_mc": counted.probability,
        "exceed_p_mc_lo": counted.low,
        "exceed_p_mc_hi": counted.high,
    }
