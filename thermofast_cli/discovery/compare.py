"""``compare``: the model beside the measurement, how well and where it fails."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermofast.models import Observations
from thermofast.models.joint import RATE, Fit
from thermofast.models.noise.area_metric import FEWEST, enough, record_area_metric
from thermofast.models.search.heldout import held_out_errors
from thermofast.models.search.judge import rounded_residual, sensor_p_values, widening
from thermofast.models.search.rules import RULES
from thermofast.models.uncertainty.heat_in_watts import HeatInWatts
from thermofast.models.uncertainty.lump_heat import UnknownHeat

from ..analysis.denoise import Denoised, denoised
from ..analysis.power import Constants, thermal_constants, unit_watts
from ..analysis.unknown_heat import NO_COLUMN, NO_WATTS, OWN_RATE, NeededHeat, heat_rows, in_words, needed_of, of_effects
from ..errors import ThermofastError
from ..errors import rounded as rounded_number
from ..observing.task import (
    LoopTask,
    Ready,
    ahead_errors,
    curve_ahead,
    curve_shifts,
    failure_records,
    first_model,
    ids_of,
    in_order,
    ready,
    refused_records,
)
from ..records import CompareRecord, finite
from .colour import Colour, colour_of
from .stretches import failing_stretches, steps_near

Array = NDArray[np.float64]

#: Error on the readings ahead, in units of the noise, from which a model that does not fail has not said what comes either.
OPEN = 5.0
#: A correlation is told where chance gives it once in so many looks.
CORRELATED = 1e-3
MOST_TOLD = 12
HOLDS = "the model holds where it was fitted and fails ahead: "
UNSEEN = "the first minutes did not show what it lacks, or something changed later that nothing logs, which no fit could know"
#: Times the misfit of the readings fitted by which all sensors must leave the model to have left it, and how far apart [share].
BEYOND, AT_ONCE = 10.0, 0.05


@dataclass(frozen=True)
class Comparison:
    """Records of a run and what a picture of it shows."""

    records: list[CompareRecord]
    pictures: list["Panel"] = field(default_factory=list)
    denoised: Denoised | None = None


@dataclass(frozen=True)
class Panel:
    """One sensor: measurement, model, residual over time [min], failing stretches, inputs."""

    run: str
    channel: str
    time: Array
    reading: Array
    model: Array
    failing: list[tuple[float, float, float]]
    until: float | None
    effects: str
    noise: float
    inputs: dict[str, Array]
    heat: UnknownHeat | None = None
    in_watts: HeatInWatts | None = None


def compare_task(task: LoopTask) -> list[Comparison]:
    """A run compared; whatever is wrong with it is a record."""
    try:
        return [_compare(task)]
    except ThermofastError as error:
        return [Comparison(failure_records(CompareRecord, task, error))]


def compare_lost(task: LoopTask, why: str) -> list[Comparison]:
    """The record of a run whose worker died."""
    return [Comparison([CompareRecord(task.run.name, "", status="failed", message=why)])]


def _compare(task: LoopTask) -> Comparison:
    observed, prepared = ready(task)
    if prepared is None:
        return Comparison(refused_records(CompareRecord, task.run.name, observed))
    compared = _Compared.of(task, prepared)
    whole = prepared.whole
    clean = Denoised(task.run.name, whole.clock, whole.ambient | whole.inputs) if task.denoise else None
    records, panels = [], []
    for i, channel in enumerate(whole.channels):
        kept = ""
        if clean is not None:
            found, kept = denoised(compared.fit, i)
            clean.sensors.update({channel: found} if found is not None else {})
        failing = compared.failing(i)
        records.append(compared.record(i, failing, kept))
        if task.want_curves:
            panels.append(compared.panel(i, failing.stretches))
    said = left_together(records, task.until_min)
    records = [replace(r, message=f"{said}; {r.message}" if r.message else said) for r in records] if said else records
    records += refused_records(CompareRecord, task.run.name, observed)
    return Comparison(in_order(records, task.run), panels, clean)


@dataclass(frozen=True)
class _Failing:
    """Where a sensor's model fails: stretches (from, to [min], size [K]).

    colour: of what it leaves, which counts in noise [K] and unsure (N,) [K], the deviation of the curve, `wider` times both.
    """

    colour: Colour
    wider: float
    noise: float
    unsure: Array
    stretches: list[tuple[float, float, float]]


@dataclass(frozen=True)
class _Compared:
    """A run and its model: what all sensors have, before each is told of. Arrays are (S, N) over all its readings.

    ahead (S,) [K]: error on readings that the fit has not seen; floor (S,): p values of a pattern in the residuals; plain and
    residual [K]: what the model leaves, and that without the logger's rounding; low, high [degC]: the curve within input ranges.
    """

    task: LoopTask
    prepared: Ready
    fit: Fit
    notes: list[str]
    ahead: Array
    floor: Array
    curve: Array
    plain: Array
    rounded: list[Array | None]
    residual: Array
    low: Array
    high: Array
    needed: NeededHeat | None
    about_heat: list[str]

    @classmethod
    def of(cls, task: LoopTask, prepared: Ready) -> "_Compared":
        """The model of a task fitted to its run."""
        whole = prepared.whole
        fit, notes = first_model(task, prepared)
        ahead = ahead_errors(fit, whole) if task.until_min is not None else held_out_errors(fit)
        curve = curve_ahead(fit)
        plain = np.where(whole.used, np.nan_to_num(whole.reading) - curve, np.nan)
        # What a reading of whole steps leaves is what its cell leaves, for all sensors before any is set beside another.
        rounded = [rounded_residual(fit, i) if np.array_equal(whole.used[i], fit.run.used[i]) else None for i in range(len(plain))]
        residual = np.stack([plain[i] if r is None else np.where(whole.used[i], r, np.nan) for i, r in enumerate(rounded)])
        low, high = (bound + curve - fit.curve for bound in curve_bounds(fit, dict(task.input_ranges)))
        if task.input_ranges and float((high - low).max(initial=0.0)) == 0.0:
            notes = [*notes, f"the model does not use {', '.join(n for n, _ in task.input_ranges)}: the range changes nothing"]
        needed = _needed(task, fit, whole)
        return cls(task, prepared, fit, notes, ahead, sensor_p_values(fit), curve, plain, rounded, residual, low, high, *needed)

    def failing(self, i: int) -> _Failing:
        """Where the model of the i-th sensor fails."""
        fit, whole = self.fit, self.prepared.whole
        colour = colour_of(fit, i, float(self.floor[i]), self.rounded[i])
        # Errors of slow parameters and of running means grow with the long-run variance of the noise, not with that of a reading.
        wider = math.sqrt(colour.long_run_factor) if colour.short else 1.0
        noise = wider * float(fit.noise[i]) if colour.short else float(self.prepared.seen.noise[i])
        unsure = wider * fit.curve_deviation(i)
        stretches = failing_stretches(whole.clock, self.residual[i], whole.weight[i], noise, unsure)
        return _Failing(colour, wider, noise, unsure, stretches)

    def _unused(self, i: int) -> NDArray[np.bool_]:
        """Readings (N,) that the fit has not seen."""
        unused: NDArray[np.bool_] = self.prepared.whole.used[i] & ~self.fit.run.used[i]
        return unused

    def _verdict(self, i: int, failing: _Failing) -> tuple[str, str]:
        """Status of the i-th sensor, and what is said first."""
        colour, stretches, unused = failing.colour, failing.stretches, self._unused(i)
        left, said = self.floor[i] >= RULES.pattern, ""
        if stretches and left and unused.any():
            steps = steps_near(self.prepared.whole, min(a for a, _, _ in stretches))
            said = HOLDS + ("; ".join(f"{s}, where it begins to fail" for s in steps) or UNSEEN)
        # Noise that is coloured by the logger is no misfit: what remains once its colour is taken off decides.
        sound = (left and not colour.cycles) or (colour.short and colour.whitened_p >= RULES.pattern)
        if stretches or not sound:
            return "model_doubtful", said
        if unused.any() and self.ahead[i] > OPEN * failing.noise:
            return "not_determined", _left_open(float(self.ahead[i]), failing.noise, float(np.median(failing.unsure[unused])))
        return "ok", said

    def record(self, i: int, failing: _Failing, kept: str) -> CompareRecord:
        """What is told of the i-th sensor; kept: what there is to say of its readings without noise."""
        task, fit, whole, colour, needed = self.task, self.fit, self.prepared.whole, failing.colour, self.needed
        channel, unused, count = whole.channels[i], self._unused(i), int(whole.used[i].sum())
        worst = max(failing.stretches, key=lambda s: abs(s[2]), default=None)
        along = correlations(fit, whole, self.residual, i)
        few = "" if enough(count) else f"area metric of {count} readings: at least {FEWEST} are needed to rank models by it"
        constants = (needed and needed.constants(i)) or _constants(fit, i, failing.wider)
        status, first = self._verdict(i, failing)
        said = [first, kept, constants.in_words() if constants else "", few, colour.words, _in_words(along)]
        said += [*self.about_heat, *self.notes, *self.prepared.notes_of(channel)]
        return CompareRecord(
            task.run.name,
            channel,
            effects=ids_of(fit.model.parts),
            until_min=task.until_min,
            samples=int(fit.readings[i]),
            rmse_fit_c=float(fit.rmse[i]),
            rmse_ahead_c=finite(self.ahead[i]),
            rmse_one_step_c=_one_step(fit, whole, i),
            bias_c=float(np.mean(self.plain[i][unused if unused.any() else fit.run.used[i]])),
            noise_c=float(self.prepared.seen.noise[i]),
            whiteness_p=float(self.floor[i]),
            noise_order=colour.order,
            whitened_p=finite(colour.whitened_p),
            long_run_factor=colour.long_run_factor,
            area_metric_c=_area(whole, fit, self.curve, self.low, self.high, i) if whole.used[i].any() else None,
            worst_from_min=worst[0] if worst else None,
            worst_to_min=worst[1] if worst else None,
            worst_error_c=worst[2] if worst else None,
            failing=[{"from_min": a, "to_min": b, "size_c": s} for a, b, s in failing.stretches],
            goes_along_with=along,
            unknown_heat=heat_rows(needed.heats[i], needed.in_watts[i]) if needed else [],
            heat_follows=[f.as_dict() for f in needed.follows] if needed else [],
            **(constants.as_columns() if constants else {}),
            status=status,
            message="; ".join(dict.fromkeys(m for m in said if m)),
        )

    def panel(self, i: int, stretches: list[tuple[float, float, float]]) -> Panel:
        """What a picture of the i-th sensor shows."""
        whole, needed, effects = self.prepared.whole, self.needed, ids_of(self.fit.model.parts)
        return Panel(
            self.task.run.name,
            whole.channels[i],
            whole.clock,
            np.where(whole.used[i], whole.reading[i], np.nan),
            self.curve[i],
            stretches,
            self.task.until_min,
            "base model" if not effects else "base + " + " + ".join(effects),
            float(self.prepared.seen.noise[i]),
            {**whole.ambient, **whole.inputs, **drive_of(whole)},
            needed.heats[i] if needed else None,
            needed.in_watts[i] if needed else None,
        )


def _left_open(ahead: float, noise: float, unsure: float) -> str:
    """What to say of an error on the readings ahead that is no contradiction, because the model does not tell what comes."""
    open_ = f"± {rounded_number(1.96 * unsure)} K" if unsure < 10.0 * ahead else "nearly anything"
    return (
        f"ahead it is off by {rounded_number(ahead)} K, {rounded_number(ahead / noise)} times the noise, within what it "
        f"leaves open ({open_}): what was read up to --until does not say what comes; read on, or log what changes"
    )


def _constants(fit: Fit, sensor: int, wider: float) -> Constants | None:
    """Heat capacity and resistance where the drive is a power in watts."""
    most = unit_watts(fit.run)
    if most is None:
        return None
    # A misfit, which is no noise of the sensor's, errs as its colour says.
    return thermal_constants(fit, sensor, most, max(wider, widening(fit)))


def _needed(task: LoopTask, fit: Fit, whole: Observations) -> tuple[NeededHeat | None, list[str]]:
    """The unknown heat where it was asked for, and what there is to say of it."""
    if not task.unknown_heat:
        return None, []
    found = needed_of(task, fit, whole)
    logged = bool(whole.ambient or whole.inputs or whole.drive)
    power = unit_watts(whole) is not None
    watts = NO_WATTS if power and not any(found.in_watts) else ""
    said = [in_words(found.follows) or NO_COLUMN if logged else "", watts, OWN_RATE if found.own_rate else ""]
    return found, [*said, of_effects(fit)]


def drive_of(whole: Observations) -> dict[str, Array]:
    """The logged column (N,) that is the run's heat, by name, in its own unit; empty where the heat is constant."""
    if whole.drive is None or whole.heat is None:
        return {}
    return {whole.drive: whole.heat * whole.heat_unit}


def left_together(records: Sequence[CompareRecord], until: float | None) -> str:
    """What to say where all sensors leave the model at one time after `until`, by far more than it failed before; else nothing."""
    if until is None or not all(r.worst_from_min is not None and r.worst_from_min > until for r in records):
        return ""
    begun = np.array([r.worst_from_min for r in records], dtype=float)
    far = [abs(r.worst_error_c or 0.0) > BEYOND * (r.rmse_fit_c or 0.0) for r in records]
    if len(records) < 2 or np.ptp(begun) > AT_ONCE * float(np.median(begun)) or not all(far):
        return ""
    said = f"from about {rounded_number(float(np.median(begun)), 3)} min on all sensors leave the model together"
    if any(HOLDS in r.message for r in records):  # why stands there: what is logged jumped then, or nothing shows it
        return said
    return f"{said}: {UNSEEN}; diagnose with a longer --until, or without, says which"


def _one_step(fit: Fit, whole: Observations, i: int) -> float | None:
    """Error of the next reading told from the last one: the residual carried on by the sensor's own decay."""
    good = np.flatnonzero(whole.used[i])
    if len(good) < 3:
        return None
    residual = whole.reading[i][good] - fit.curve[i][good]
    rate = float(fit.values[RATE][i])
    kept = np.exp(-rate * np.diff(whole.time[good]))
    return float(np.sqrt(np.mean((residual[1:] - kept * residual[:-1]) ** 2)))


def curve_bounds(fit: Fit, ranges: dict[str, float]) -> tuple[Array, Array]:
    """Least and largest curve (S, N), (S, N) [degC] while each logged input named lies within +- its range, all else held."""
    low, high = fit.curve, fit.curve
    for name, reach in ranges.items():
        for shift in curve_shifts(fit, {name: reach}, (-1.0, -0.5, 0.5, 1.0)):
            low, high = np.minimum(low, fit.curve + shift), np.maximum(high, fit.curve + shift)
    return low, high


def _area(whole: Observations, fit: Fit, curve: Array, low: Array, high: Array, i: int) -> float:
    """Area metric [K] of one sensor: the parameters' uncertainty random, the declared input ranges intervals."""
    good = whole.used[i]
    deviation = fit.curve_deviation(i)[good]
    deviation = np.minimum(np.nan_to_num(deviation, nan=0.0, posinf=1e6), 1e6)
    bounds = low[i][good], high[i][good]
    noise = float(whole.noise[i]) / math.sqrt(float(np.median(whole.weight[i][good])))
    return record_area_metric(whole.reading[i][good], curve[i][good], deviation, *bounds, noise=noise)


def correlations(fit: Fit, whole: Observations, residual: Array, i: int) -> list[dict[str, Any]]:
    """How a sensor's residual goes along with logged inputs and the other sensors' residuals, and how late it follows.

    Slow signals are alike by chance: an input is compared after the lump has smoothed it, at the lump's own lag, and the number
    of independent samples is that left by the autocorrelation of both (Bartlett 1935).
    """
    good = whole.used[i]
    own = fit.unrounded[i] if not (whole.used & ~fit.run.used).any() else np.nan_to_num(residual[i])
    rate = float(fit.values[RATE][i])
    found = []
    offers = {**whole.ambient, **whole.inputs}
    for name, column in offers.items():
        if np.ptp(column) > 0.0:
            smooth = _smoothed(whole.time, column, rate)
            found.append((name, smooth, 1.0 / rate))
    for j, other in enumerate(whole.channels):
        if j != i:
            found.append((other, np.nan_to_num(residual[j]), 0.0))
    told: list[dict[str, Any]] = []
    for name, series, late in found:
        both = good if name in offers else good & np.isfinite(residual[whole.channels.index(name)])
        r, p = _correlation(whole.time[both], own[both], series[both])
        told.append({"name": name, "correlation": round(r, 3), "late_min": round(late, 1), "p": float(f"{p:.3g}")})
    told = [t for t in told if t["late_min"] < 0.5 * whole.span]
    return sorted(told, key=lambda t: (t["p"], -abs(t["correlation"])))[:MOST_TOLD]


def _smoothed(time: Array, column: Array, rate: float) -> Array:
    from thermofast.models.core.kernel import followed

    out = np.empty((1, len(time)))
    followed(time, np.ascontiguousarray(column), np.array([1.0 / rate]), out)
    smooth: Array = out[0]
    return smooth


def _correlation(time: Array, a: Array, b: Array) -> tuple[float, float]:
    """Correlation of two series (n,) without their straight lines, and its p value from the number of independent samples."""
    if len(a) < 20:
        return 0.0, 1.0
    line = np.stack([np.ones(len(time)), time - time.mean()], axis=1)
    a = a - line @ np.linalg.lstsq(line, a, rcond=None)[0]
    b = b - line @ np.linalg.lstsq(line, b, rcond=None)[0]
    size = math.sqrt(float(a @ a) * float(b @ b))
    if not size > 0.0:
        return 0.0, 1.0
    r = float(a @ b) / size
    n = len(a)
    spectra = [np.abs(np.fft.rfft(x, 2 * n)) ** 2 for x in (a, b)]
    auto = [np.fft.irfft(s)[: n // 2] / max(float(x @ x), 1e-300) for s, x in zip(spectra, (a, b), strict=True)]
    independent = n / max(1.0, 1.0 + 2.0 * float((auto[0][1:] * auto[1][1:]).sum()))
    independent = min(max(independent, 3.0), float(n))
    from thermofast.models.core.tails import normal_tail

    z = math.atanh(min(abs(r), 0.999999)) * math.sqrt(max(independent - 3.0, 0.1))
    return r, 2.0 * normal_tail(z)


def _in_words(along: list[dict[str, Any]]) -> str:
    plain = [t for t in along if t["p"] < CORRELATED / len(along)]
    if not plain:
        return ""
    first = plain[0]
    late = f", {first['late_min']:g} min late" if first["late_min"] else ""
    others = f" (and {len(plain) - 1} more)" if len(plain) > 1 else ""
    return f"the residual goes along with {first['name']}{late} (correlation {first['correlation']:.2f}){others}"
