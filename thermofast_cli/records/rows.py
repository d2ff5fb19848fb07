"""One record per line of output: the same columns in every format. None is an absent number."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

#: Statuses that are failures of a sensor: exit code 1.
FAILURES = frozenset({"constant", "no_data", "too_short", "diverged", "unreadable", "failed"})
#: What stands for a filter's name where all sensors of a run were fitted as one.
JOINT_FIT = "joint_fit"


def finite(value: float | None) -> float | None:
    """None for a number that is none."""
    return float(value) if value is not None and math.isfinite(value) else None


class Row:
    """A row of output."""

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        return tuple(f.name for f in fields(cls))  # type: ignore[arg-type]

    def as_dict(self) -> dict[str, Any]:
        return dict(vars(self))


@dataclass(frozen=True)
class Record(Row):
    """run and channel name the sensor; status and message say how far to trust the rest."""

    run: str
    channel: str


@dataclass(frozen=True)
class IdentifyRecord(Record):
    """Steady state and settling time of one sensor; temperatures degC, times min, rate 1/min.

    steady_state_limit_c is the smallest standard deviation that any unbiased method could reach on these readings;
    reading_half_width_c is half the interval that the readings of a machine without imperfections would give; at_* the
    temperature at a time asked for; room_steady_* the steady state in a room asked for; unseen what the record cannot exclude;
    rate_shared_with the sensors whose rates helped. *_measured_* stand where the record itself is complete. time_to_go_* count
    from the last reading used to the time at which 95 % of the rise is done for good.

    trip_* is when the stopping rule asked for holds, after the start of the rise, trip_from whether `readings` show it or it is a
    `prediction`; missing_* what the temperature is then still away from where it settles, negative where it falls; trip_last
    marks the sensor that keeps the test going; three_point_c is the extrapolation of the first, middle and last reading used.
    margin_* is how far the steady state stays below the limit asked for, over_limit_p the chance that it does not. switch_off_* is
    the temperature at the moment asked for, from the readings after it.
    """

    filter: str
    until_min: float | None = None
    samples: int = 0
    start_min: float | None = None
    initial_c: float | None = None
    steady_state_c: float | None = None
    steady_state_lo_c: float | None = None
    steady_state_hi_c: float | None = None
    steady_state_limit_c: float | None = None
    steady_state_measured_c: float | None = None
    t95_min: float | None = None
    t95_lo_min: float | None = None
    t95_hi_min: float | None = None
    t95_measured_min: float | None = None
    time_to_go_min: float | None = None
    time_to_go_lo_min: float | None = None
    time_to_go_hi_min: float | None = None
    rate_per_min: float | None = None
    noise_c: float | None = None
    rmse_fit_c: float | None = None
    rmse_ahead_c: float | None = None
    reading_half_width_c: float | None = None
    at_min: float | None = None
    at_c: float | None = None
    at_lo_c: float | None = None
    at_hi_c: float | None = None
    room_c: float | None = None
    room_steady_c: float | None = None
    room_steady_lo_c: float | None = None
    room_steady_hi_c: float | None = None
    criterion: str = ""
    trip_min: float | None = None
    trip_lo_min: float | None = None
    trip_hi_min: float | None = None
    trip_from: str = ""
    trip_last: bool | None = None
    missing_k: float | None = None
    missing_lo_k: float | None = None
    missing_hi_k: float | None = None
    three_point_c: float | None = None
    limit_c: float | None = None
    margin_k: float | None = None
    margin_lo_k: float | None = None
    margin_hi_k: float | None = None
    over_limit_p: float | None = None
    switch_off_min: float | None = None
    switch_off_c: float | None = None
    switch_off_lo_c: float | None = None
    switch_off_hi_c: float | None = None
    unseen: str = ""
    rate_shared_with: str = ""
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class SweepRecord(Record):
    """One sensor and window of a sweep; docs/architecture.md has the rules.

    trip_min is when the stopping rule asked for holds on the whole record, missing_k what the temperature is then still away
    from the steady state that a complete record shows.
    """

    filter: str
    window_min: float | None = None
    best_time_min: float | None = None
    rmse_c: float | None = None
    earliest_time_min: float | None = None
    shortest_time_min: float | None = None
    tolerance_time_min: float | None = None
    agreed: bool | None = None
    criterion: str = ""
    trip_min: float | None = None
    missing_k: float | None = None
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class CalibrateRecord(Record):
    """How what was foretold of complete runs held, read up to so many time constants; each run by factors learnt from the others.

    held_* is the share of 95 % intervals that held the end, width_*_c their median width, score_ratio the interval score after
    over before. factor multiplies half-widths; conformal_factor is that of plain split conformal prediction, None where runs are
    too few.
    """

    time_constants: float | None = None
    runs: int = 0
    sensors: int = 0
    held_typical: float | None = None
    width_typical_c: float | None = None
    held_lab: float | None = None
    width_lab_c: float | None = None
    score_ratio: float | None = None
    factor: float | None = None
    conformal_factor: float | None = None
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class PlanRecord(Record):
    """How long a test must run until the steady state is known to +-tolerance_c; channel names what is changed of the test;
    time_lo_min and time_hi_min are the extremes of six machines drawn, the latter None where one of them never gets there.
    """

    sensors: int = 0
    interval_s: float | None = None
    noise_c: float | None = None
    rise_c: float | None = None
    tau_min: float | None = None
    tolerance_c: float | None = None
    time_min: float | None = None
    time_lo_min: float | None = None
    time_hi_min: float | None = None
    time_constants: float | None = None
    least_half_width_c: float | None = None
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class CompareRecord(Record):
    """Model beside measurement for one sensor; errors in K, reading minus model.

    rmse_ahead_c is the free run's error on readings that the fit did not see: those after --until, else blocks left out in turn.
    failing lists the stretches where the model fails, goes_along_with what the residual follows.
    whiteness_p is that of the residual being white noise; where it is not, noise_order is the ARMA model of its colour and,
    where that is short enough to be the sensor's noise, whitened_p the p value once the colour is taken off.
    area_metric_c is the mean distance by which the residuals would have to move to be such as the model, its parameters
    uncertain and its inputs within their ranges, foretells.
    unknown_heat is the heat that the sensor would need to follow its readings, with its 95 % band [K/min, and W where --drive is a
    power], and heat_follows the logged columns that the heat of all sensors follows; both only where they were asked for.
    heat_capacity_* and resistance_*, as this sensor sees them, stand where --drive is a power whose column names its unit, W or kW;
    with the unknown heat, which may be any beside the power, their intervals are those that it leaves.
    """

    effects: list[str] = field(default_factory=list)
    until_min: float | None = None
    samples: int = 0
    rmse_fit_c: float | None = None
    rmse_ahead_c: float | None = None
    rmse_one_step_c: float | None = None
    bias_c: float | None = None
    noise_c: float | None = None
    whiteness_p: float | None = None
    noise_order: str = ""
    whitened_p: float | None = None
    long_run_factor: float | None = None
    area_metric_c: float | None = None
    worst_from_min: float | None = None
    worst_to_min: float | None = None
    worst_error_c: float | None = None
    failing: list[dict[str, Any]] = field(default_factory=list)
    goes_along_with: list[dict[str, Any]] = field(default_factory=list)
    unknown_heat: list[dict[str, float]] = field(default_factory=list)
    heat_follows: list[dict[str, Any]] = field(default_factory=list)
    heat_capacity_j_per_k: float | None = None
    heat_capacity_lo_j_per_k: float | None = None
    heat_capacity_hi_j_per_k: float | None = None
    resistance_k_per_w: float | None = None
    resistance_lo_k_per_w: float | None = None
    resistance_hi_k_per_w: float | None = None
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class ValidateRecord(Record):
    """A learnt model against a set of runs, one sensor: the area metric of Zhao, Lyu and Kan 2018.

    area_low_c and area_high_c [K] lie between the distributions, measured and foretold, of the least and of the largest temperature
    ahead of until_min in each run, area_c is their sum, the paper's metric; outside_c what of it the ranges of the inputs do not
    allow. expected_c is what a right model would leave (of outside_c where ranges are given), p how often it would leave as much.
    """

    until_min: float | None = None
    runs: int = 0
    area_low_c: float | None = None
    area_high_c: float | None = None
    area_c: float | None = None
    outside_c: float | None = None
    expected_c: float | None = None
    p: float | None = None
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class DiagnoseRecord(Record):
    """Which effect is missing, repeated in each sensor that it concerns; docs/thresholds.md has the rules.

    explained_share is that of the sensor's misfit which the effects named explain, remaining_c [K] what they leave beside noise;
    explained has the effects in the order of what they explain, over all sensors. next_experiment has the runs that might settle
    what is open, the one proposed first, with how many of those simulated named the true cause alone, where they were asked for.
    """

    verdict: str = ""
    also_possible: list[str] = field(default_factory=list)
    false_alarm_p: float | None = None
    event_min: float | None = None
    rmse_base_ahead_c: float | None = None
    rmse_ahead_c: float | None = None
    explained_share: float | None = None
    remaining_c: float | None = None
    noise_c: float | None = None
    explained: list[dict[str, Any]] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    ranking: list[dict[str, Any]] = field(default_factory=list)
    next_experiment: list[dict[str, Any]] = field(default_factory=list)
    advice: str = ""
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class ImproveRecord(Record):
    """One step of adding effects, for one sensor; step 0 is the base model.

    rmse_other_runs_c: of several runs together, the error on this one after its readings up to --until or its first third, to
    which level, start and events were fitted, and the machine's constants as far as the others leave them open.
    """

    step: int = 0
    effects: list[str] = field(default_factory=list)
    rmse_fit_c: float | None = None
    rmse_ahead_c: float | None = None
    rmse_other_runs_c: float | None = None
    noise_c: float | None = None
    whiteness_p: float | None = None
    parameters: dict[str, Any] = field(default_factory=dict)
    stopped_because: str = ""
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class ChangedRecord(Record):
    """One kind of change of a machine since other runs of it; `verdict` is the same in every row.

    size is the factor, new over old, on heat, heat capacity or loss, of a sensor on its rise, of the contacts on the rise of the
    sensor that moved most, with its 95 % interval; difference_k by how much the room is warmer, with its own. channel names the
    sensor, or the two that were exchanged.
    """

    change: str = ""
    probability: float = 0.0
    size: float | None = None
    size_lo: float | None = None
    size_hi: float | None = None
    difference_k: float | None = None
    difference_lo_k: float | None = None
    difference_hi_k: float | None = None
    verdict: str = ""
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class BenchRecord(Record):
    """One filter on all sensors of a run; errors in K over all of them, width_c the median width of the steady state's interval."""

    filter: str = ""
    until_min: float | None = None
    sensors: int = 0
    broken: int = 0
    undetermined: int = 0
    rmse_fit_c: float | None = None
    rmse_ahead_c: float | None = None
    width_c: float | None = None
    steps_per_s: float | None = None
    chosen: bool = False
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class SensitivityRecord(Record):
    """What one uncertain thing contributes to the spread of one quantity of a sensor.

    size is its standard deviation, or its bound where it is uniform; first_order and total are Sobol indices, shares of the
    quantity's variance; rank is its rank by total, rank_p how often it has that rank when the runs are drawn anew (bootstrap of
    the polynomial); mean and deviation are the quantity's over all that is uncertain; surrogate_error the share of the variance
    that the polynomial misses; exceed_p_* the probability that the steady state errs by more than the limit asked for.
    """

    until_min: float | None = None
    quantity: str = ""
    factor: str = ""
    size: float | None = None
    unit: str = ""
    uniform: bool = False
    first_order: float | None = None
    total: float | None = None
    rank: int | None = None
    rank_p: float | None = None
    mean: float | None = None
    deviation: float | None = None
    exceed_p_form: float | None = None
    exceed_p_mc: float | None = None
    exceed_p_mc_lo: float | None = None
    exceed_p_mc_hi: float | None = None
    runs: int = 0
    lost: int = 0
    surrogate_error: float | None = None
    status: str = "ok"
    message: str = ""


@dataclass(frozen=True)
class DisplacementRecord(Record):
    """One method to tell a displacement from the temperatures; errors in um on readings not used: contiguous blocks of one run, or
    whole runs of several, as left_out says.

    channel is the displacement column; baseline_um the error of the better of its mean and a straight line in time, or the other
    runs at that minute; coverage the share of readings inside the 95 % interval. formula is the displacement [um] of the columns in
    brackets [degC], fitted to all readings: of least squares alone, the others have none.
    """

    method: str = ""
    runs: int = 1
    left_out: str = "blocks"
    samples: int = 0
    sensors: list[str] = field(default_factory=list)
    rmse_fit_um: float | None = None
    rmse_ahead_um: float | None = None
    baseline_um: float | None = None
    coverage: float | None = None
    trusted: bool = False
    formula: str = ""
    status: str = "ok"
    message: str = ""


#: Columns of predicted displacements, one row per method and reading.
PREDICTED_COLUMNS = (
    "run",
    "channel",
    "time_min",
    "displacement_um",
    "method",
    "predicted_um",
    "predicted_lo_um",
    "predicted_hi_um",
)

#: Columns of a trace, one row per reading.
TRACE_COLUMNS = (
    "run",
    "channel",
    "time_min",
    "reading_c",
    "temperature_c",
    "temperature_sd_c",
    "rate_per_min",
    "rate_sd_per_min",
    "steady_state_c",
    "steady_state_sd_c",
    "innovation_c",
    "fading",
    "process_noise_k2",
    "measurement_noise_k2",
    "weight",
)


@dataclass(frozen=True)
class InspectRecord(Row):
    """One column of a file as it was read: role is time, sensor, ambient, input, displacement or ignored; note says why.

    first and last are its first and last readings: degC for temperatures, elapsed minutes for time, else as they stand.
    """

    status: ClassVar[str] = "ok"
    run: str
    column: str
    role: str
    unit: str = ""
    readings: int = 0
    first: float | None = None
    last: float | None = None
    guessed: str = ""
    note: str = ""


def failed(kind: type[Any], unreadable: Sequence[tuple[str, str]], **more: Any) -> list[Any]:
    """Records of a kind, of runs that could not be read: (name, why)."""
    return [kind(run=name, channel="", status="unreadable", message=why, **more) for name, why in unreadable]
