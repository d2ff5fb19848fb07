"""``validate``: a learnt model against a set of runs, as whole distributions.

Zhao, Lyu and Kan 2018 (``models/noise/area_metric.py``): each run is one draw of what is random, the model's constants and the
noise; within a run the logged inputs go through their values, and its least and largest temperature bound the response. The area
between the distributions of measured and foretold bounds is the metric [K]. What a right model would leave is simulated.
"""

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from thermofast.models.arrow import covariance_root
from thermofast.models.joint import RATE, Fit
from thermofast.models.noise.area_metric import FEWEST, area_metric_interval, area_outside, enough, response_bounds
from thermofast.models.noise.residual_noise import fit_arma, long_run_factor

from ..errors import ThermofastError
from ..machine.learnt import carry
from ..machine.modelfile import ModelFile
from ..observing.task import LoopTask, curve_shifts, failure_records, ready, refused_records
from ..records import ValidateRecord

Array = NDArray[np.float64]

#: Standard errors of the file that the rate of half of the runs may lie from it, held back towards it as each run's is.
FAR = 3.0
#: Draws of the model for each run.
DRAWS = 400
#: Values of each input range that a draw is looked at, as shares of its reach.
SHARES = (-1.0, -0.5, 0.0, 0.5, 1.0)
#: A model that would be this far off once in so many sets of runs is doubted.
DOUBTED = 0.01
#: Readings before --until from which on the colour of the noise is asked for; draws that fall in before it is stationary.
FEWEST_COLOURED, WARM_UP = 30, 100
#: Runs without which nothing is told, readings ahead without which a run is none.
FEWEST_RUNS, FEWEST_READINGS = 2, 5
#: Readings before --until without which a run's own level and start, and the noise, are not known.
FEWEST_BEFORE = 8


@dataclass(frozen=True)
class Bounds:
    """Of one sensor in one run: measured (2,) least and largest temperature ahead, low, high (draws, shares) of the model.

    rate_deviation: how many standard errors of the model file the rate lies from the file's, as this run's first minutes have it.
    """

    run: str
    channel: str
    measured: Array
    low: Array
    high: Array
    rate_deviation: float = 0.0


@dataclass(frozen=True)
class Judged:
    """A run's bounds, one for each sensor, records of what could not be judged, and what there is to say of the run."""

    bounds: list[Bounds]
    refused: list[ValidateRecord]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Area:
    """What a picture of one sensor shows: measured (R, 2) and model (M, 2) bounds, least and largest."""

    channel: str
    measured: Array
    model: Array
    record: ValidateRecord


def validate_task(task: LoopTask) -> list[Judged]:
    """The bounds of one run; whatever is wrong with it is a record."""
    try:
        return [_bounds(task)]
    except ThermofastError as error:
        return [Judged([], failure_records(ValidateRecord, task, error))]


def validate_lost(task: LoopTask, why: str) -> list[Judged]:
    """The record of a run whose worker died."""
    return [Judged([], [ValidateRecord(task.run.name, "", status="failed", message=why)])]


def _bounds(task: LoopTask) -> Judged:
    observed, prepared = ready(task)
    if prepared is None:
        return Judged([], refused_records(ValidateRecord, task.run.name, observed))
    assert task.model is not None
    whole = prepared.whole
    fit = carry(task.model.file, prepared.seen, task.run.name, task.model.source).fit
    shifts = curve_shifts(fit, dict(task.input_ranges), SHARES)
    found, refused = [], refused_records(ValidateRecord, task.run.name, observed)
    for channel in task.model.file.channels:
        if channel not in whole.channels and channel not in {r.channel for r in refused}:
            why = "the model has this sensor, and this run no reading of it that moves"
            refused.append(ValidateRecord(task.run.name, channel, status="no_data", message=why))
    for i, channel in enumerate(whole.channels):
        ahead = whole.used[i] & ~fit.run.used[i]
        before = int(fit.run.used[i].sum())
        if before < FEWEST_BEFORE:
            why = f"{before} readings before --until: at least {FEWEST_BEFORE} are needed"
            refused.append(ValidateRecord(task.run.name, channel, status="too_short", message=why))
            continue
        if ahead.sum() < FEWEST_READINGS:
            why = f"{int(ahead.sum())} readings ahead of --until: at least {FEWEST_READINGS} are needed"
            refused.append(ValidateRecord(task.run.name, channel, status="too_short", message=why))
            continue
        residual = np.where(fit.run.used[i], fit.unrounded[i], np.nan)
        residual = residual[slice(*(np.flatnonzero(fit.run.used[i])[[0, -1]] + [0, 1]))]
        # Noise that neighbours share makes level and constants less sure than their standard errors, and extremes rarer.
        wider = math.sqrt(long_run_factor(residual))
        curve = fit.curve[i][ahead] + wider * _drawn(fit, i, ahead) + _noise(fit, i, ahead, residual)
        low = np.stack([(curve + shift[i][ahead]).min(axis=1) for shift in shifts], axis=1)
        high = np.stack([(curve + shift[i][ahead]).max(axis=1) for shift in shifts], axis=1)
        measured = whole.reading[i][ahead]
        extremes = np.array([measured.min(), measured.max()])
        found.append(
            Bounds(task.run.name, channel, extremes, low, high, _off(task.model.file, channel, float(fit.values[RATE][i])))
        )
    notes = []
    if any(one.is_of(task.run.name, whole) for one in (task.model.file.learnt_from, *task.model.file.also_from)):
        notes.append("among the runs are some that the model was learnt from: they prove nothing")
    if task.input_ranges and max(float(np.abs(shift).max()) for shift in shifts) == 0.0:
        notes.append(f"the model does not use {', '.join(n for n, _ in task.input_ranges)}: the range changes nothing")
    return Judged(found, refused, tuple(notes))


def _off(file: ModelFile, channel: str, rate: float) -> float:
    """Standard errors of the file by which a rate [1/min] lies from the file's; 0 where the file does not know how sure it is."""
    known = next((n for n in file.base if n.name == RATE.name and n.channel in (None, channel)), None)
    if known is None or not known.standard_error or not (known.value > 0.0 and rate > 0.0):
        return 0.0
    return math.log(rate / known.value) * known.value / max(known.standard_error, 1e-3 * known.value)


def _drawn(fit: Fit, sensor: int, at: NDArray[np.bool_]) -> Array:
    """What uncertain parameters add to a sensor's curve (draws, n): the machine's alike in all runs, a run's own each anew."""
    columns = [*fit.model.local, *fit.model.shared]
    active = np.concatenate([fit.model.active[sensor], np.ones(len(fit.model.shared), bool)])
    by = np.concatenate([fit.by_local[:, sensor], fit.by_shared[:, sensor]])[:, at]
    covariance = fit.joint_covariance(sensor)
    machine = np.array([fit.model.of_machine(c) for c in columns]) & active
    own = ~machine & active
    names = [f"{fit.run.channels[sensor]} {c.key}" for c in columns]
    alike = np.stack([_normals(name) for name in names], axis=1)
    apart = np.stack([_normals(f"{_mark(fit)} {name}") for name in names], axis=1)
    moved = np.zeros((DRAWS, len(columns)))
    within = covariance[np.ix_(machine, machine)]
    moved[:, machine] = alike[:, machine] @ covariance_root(within).T
    back = covariance[np.ix_(own, machine)] @ np.linalg.pinv(within)
    rest = covariance[np.ix_(own, own)] - back @ covariance[np.ix_(machine, own)]
    moved[:, own] = moved[:, machine] @ back.T + apart[:, own] @ covariance_root(rest).T
    return np.asarray(moved @ by)


def _noise(fit: Fit, sensor: int, at: NDArray[np.bool_], residual: Array) -> Array:
    """Noise of the readings (draws, n), of the size and, with enough of them, the colour of the residual before (m,) [K]."""
    size = float(fit.noise[sensor] / np.sqrt(np.median(fit.run.weight[sensor][fit.run.used[sensor]])))
    rng = np.random.default_rng(zlib.crc32(f"{_mark(fit)} {fit.run.channels[sensor]} noise".encode()))
    white = rng.standard_normal((DRAWS, int(at.sum()) + WARM_UP))
    if np.isfinite(residual).sum() < FEWEST_COLOURED or not float(np.nanstd(residual)) > 0.0:
        return np.asarray(size * white[:, WARM_UP:])
    model = fit_arma(residual, 1, 1)
    coloured = lfilter(np.r_[1.0, model.theta], np.r_[1.0, -model.phi], white, axis=1)[:, WARM_UP:]
    return np.asarray(size / math.sqrt(model.variance / model.innovation_variance) * coloured)


def _mark(fit: Fit) -> int:
    """A number of the run's readings, by which its draws repeat themselves wherever its file lies."""
    return zlib.crc32(np.nan_to_num(fit.run.reading).tobytes())


def _normals(name: str) -> Array:
    return np.random.default_rng(zlib.crc32(name.encode())).standard_normal(DRAWS)


def judge(judged: Sequence[Judged], until_min: float, ranges: Sequence[str]) -> tuple[list[ValidateRecord], list[Area]]:
    """One record for each sensor over all runs, and what a picture of them shows."""
    records: list[ValidateRecord] = []
    areas = []
    every = [b for one in judged for b in one.bounds]
    for channel in dict.fromkeys(b.channel for b in every):
        mine = [b for b in every if b.channel == channel]
        blank = ValidateRecord(f"{len(mine)} runs", channel, until_min=until_min, runs=len(mine))
        if len(mine) < FEWEST_RUNS:
            why = "one run: a set of runs has a distribution, one has none; compare --model judges it by itself"
            records.append(replace(blank, run=mine[0].run, status="too_short", message=why))
            continue
        record, area = _sensor(blank, mine, bool(ranges))
        notes = dict.fromkeys(n for one in judged for n in one.notes)
        record = replace(record, message="; ".join(m for m in (record.message, *notes) if m))
        area = replace(area, record=record)
        records.append(record)
        areas.append(area)
    return [*records, *(r for one in judged for r in one.refused)], areas


def _sensor(blank: ValidateRecord, mine: list[Bounds], ranged: bool) -> tuple[ValidateRecord, Area]:
    measured = np.stack([b.measured for b in mine])
    # Swept over an input's range a draw's response has bounds; an experiment is somewhere in them, nobody knows where.
    lowest, _ = response_bounds(np.concatenate([b.low for b in mine]))
    _, highest = response_bounds(np.concatenate([b.high for b in mine]))
    swept = area_metric_interval(measured[:, 0], measured[:, 1], lowest, highest)
    allowed = [response_bounds(np.concatenate([getattr(b, side) for b in mine])) for side in ("low", "high")]
    outside = _outside(measured, allowed)
    anywhere = np.random.default_rng(zlib.crc32(blank.channel.encode())).integers(0, len(SHARES), (DRAWS, len(mine)))
    chance = []
    for d in range(DRAWS):
        drawn = np.array([[b.low[d, s], b.high[d, s]] for b, s in zip(mine, anywhere[d], strict=True)])
        if ranged:
            chance.append(_outside(drawn, allowed))
        else:
            chance.append(area_metric_interval(drawn[:, 0], drawn[:, 1], lowest, highest).total)
    value = outside if ranged else swept.total
    p = (1.0 + sum(c >= value for c in chance)) / (DRAWS + 1.0)
    few = (
        ""
        if enough(len(mine))
        else f"{len(mine)} runs: at least {FEWEST} are needed to rank models by the area; p counts how few they are"
    )
    rate_deviation = float(np.median([b.rate_deviation for b in mine]))
    far = (
        f"the rate lies {rate_deviation:+.1f} standard errors from the file's in half of the runs or more"
        if abs(rate_deviation) > FAR
        else ""
    )
    doubt = "a right model would seldom leave so much: compare --model on the runs shows where it fails" if p < DOUBTED else ""
    record = replace(
        blank,
        area_low_c=swept.lower,
        area_high_c=swept.upper,
        area_c=swept.total,
        outside_c=outside,
        expected_c=float(np.median(chance)),
        p=p,
        status="model_doubtful" if doubt or far else "ok",
        message="; ".join(m for m in (doubt, far, few) if m),
    )
    return record, Area(blank.channel, measured, np.stack([lowest, highest], axis=1), record)


def _outside(measured: Array, allowed: Sequence[tuple[Array, Array]]) -> float:
    """Area [K] by which measured bounds (R, 2) leave those, least and largest, that the ranges of the inputs allow."""
    return sum(area_outside(measured[:, k], *box) for k, box in enumerate(allowed))
