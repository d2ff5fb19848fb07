"""What each column of the records means, and its unit: for pages, workbooks and the reference."""

from collections.abc import Mapping

#: Units by the end of a name.
UNITS = (
    ("_j_per_k", "J/K"), ("_k_per_w", "K/W"), ("_per_min", "1/min"), ("_per_s", "1/s"), ("_min", "min"), ("_c", "degC"),
    ("_k", "K"), ("_um", "µm"), ("_s", "s"),
)  # fmt: skip
#: Columns whose names end so and that are differences: a kelvin is a degree there.
_KELVIN = (
    "noise_c bias_c rise_c tolerance_c width_c remaining_c area_metric_c area_low_c area_high_c area_c outside_c expected_c "
    "worst_error_c reading_half_width_c least_half_width_c steady_state_limit_c width_typical_c width_lab_c rmse_c rmse_fit_c "
    "rmse_ahead_c rmse_base_ahead_c rmse_other_runs_c rmse_one_step_c"
)
KELVIN = frozenset(_KELVIN.split())
SIDES = {"lo": "lower end of the 95 % interval", "hi": "upper end of the 95 % interval"}

MEANINGS: Mapping[str, str] = {
    "run": "the file, or the run in it",
    "channel": "the sensor",
    "status": "how far to trust the row: ok, not_determined (measure longer), model_doubtful or partly_explained (more is at work "
    "than the model has), or a failure",
    "message": "why, and what was guessed or left out",
    "filter": "the filter that followed the readings",
    "until_min": "the readings used, from the first on",
    "samples": "number of readings used",
    "sensors": "the sensors, or their number",
    "runs": "number of runs",
    "start_min": "when the rise starts",
    "initial_c": "temperature at the start of the rise",
    "steady_state_c": "temperature at which the point settles, with room and load as they are at the last reading used",
    "steady_state_limit_c": "smallest standard deviation of it that any unbiased method could have on these readings (Cramér-Rao)",
    "steady_state_measured_c": "where a complete record itself shows it to settle",
    "t95_min": "when 95 % of the rise is done, after its start",
    "t95_measured_min": "the same where a complete record itself shows it",
    "time_to_go_min": "from the last reading used until 95 % of the rise is done for good",
    "rate_per_min": "rate of the law; one over it is the time constant",
    "noise_c": "standard deviation of the noise",
    "rmse_fit_c": "error of the model on the readings used (RMS)",
    "rmse_ahead_c": "error of the model, left to itself, on readings that were not used (RMS)",
    "rmse_base_ahead_c": "the same of the base model",
    "rmse_other_runs_c": "error on this run after its first part when the other runs tell the machine's constants (RMS)",
    "rmse_one_step_c": "error one reading ahead (RMS)",
    "rmse_c": "error of the model over the window at the best time (RMS)",
    "rmse_fit_um": "error on the readings used (RMS)",
    "rmse_ahead_um": "error on readings left out (RMS)",
    "reading_half_width_c": "half of the interval that the readings of a machine without imperfections would give",
    "at_min": "the time asked for with --at",
    "at_c": "temperature at that time",
    "room_c": "the room asked for with --room",
    "room_steady_c": "temperature at which the point settles in that room",
    "criterion": "the stopping rule asked for",
    "trip_min": "when the stopping rule holds, after the start of the rise",
    "trip_from": "whether readings show that, or it is a prediction",
    "trip_last": "whether this sensor is the last one that the rule waits for",
    "missing_k": "what the temperature is then still away from where it settles",
    "three_point_c": "the steady state by the three-point extrapolation of transformer labs, for comparison",
    "limit_c": "the temperature that must not be exceeded",
    "margin_k": "how far the steady state stays below the limit",
    "over_limit_p": "the chance that it does not",
    "switch_off_min": "the moment of switching off",
    "switch_off_c": "the temperature at that moment, from the readings after it",
    "unseen": "what a record this short cannot exclude",
    "rate_shared_with": "the sensors whose rates helped",
    "window_min": "the sampling window: the model is judged on the readings up to there",
    "best_time_min": "identification time whose error over the window is least (the paper's rule)",
    "earliest_time_min": "identification time from which that error stays within its noise of the least",
    "shortest_time_min": "the longest of these over the windows: the shortest time that serves in every window",
    "tolerance_time_min": "identification time from which the steady state is known to within --tolerance, the machine counted",
    "agreed": "whether these times agree over the windows, to 5 min",
    "time_constants": "how many time constants were read",
    "held_typical": "share of the typical 95 % intervals that held the end",
    "width_typical_c": "their median width",
    "held_lab": "the same after calibration",
    "width_lab_c": "their median width after calibration",
    "score_ratio": "interval score after calibration over before: below 1 is better",
    "factor": "factor on half-widths; of a sensitivity, the uncertain thing",
    "conformal_factor": "the factor of plain split conformal prediction, for comparison",
    "interval_s": "time between two readings",
    "rise_c": "rise until the end",
    "tau_min": "time constant",
    "tolerance_c": "half-width asked for",
    "time_min": "how long the test must run",
    "time_lo_min": "the least of six machines drawn",
    "time_hi_min": "the most of six machines drawn",
    "least_half_width_c": "the least half-width that waiting can reach",
    "effects": "the physical effects in the model",
    "bias_c": "mean error",
    "whiteness_p": "chance of a pattern like this in the residual if it were noise",
    "noise_order": "the ARMA model of the residual's colour",
    "whitened_p": "the same chance once the colour is taken off",
    "long_run_factor": "by how much the colour widens a mean of many readings",
    "area_metric_c": "how far the residuals would have to move to be such as the model foretells",
    "worst_from_min": "where the model fails most: from",
    "worst_to_min": "where the model fails most: to",
    "worst_error_c": "by how much it fails there, reading minus model",
    "failing": "all stretches where the model fails",
    "goes_along_with": "what the residual follows",
    "unknown_heat": "heat that the sensor would need to follow its readings, with its band",
    "heat_follows": "the logged columns that this heat follows",
    "heat_capacity_j_per_k": "heat capacity as this sensor sees it",
    "resistance_k_per_w": "thermal resistance as this sensor sees it",
    "area_low_c": "area between the distributions, measured and foretold, of the least temperature",
    "area_high_c": "the same of the largest temperature",
    "area_c": "their sum, the area metric",
    "outside_c": "what of it the ranges of the inputs do not allow",
    "expected_c": "what a right model would leave",
    "p": "how often a right model would leave as much",
    "verdict": "what was found: the effects, none, or unexplained; the change of the machine",
    "also_possible": "models that fit as well",
    "false_alarm_p": "chance of a find like this where nothing is hidden",
    "event_min": "when the event happened, on the clock of the run, as --until",
    "explained_share": "share of the sensor's misfit that the effects explain",
    "remaining_c": "what they leave beside noise (RMS)",
    "explained": "the effects in the order of what they explain, with the errors before and after",
    "parameters": "the parameters of the effects, with their standard errors",
    "ranking": "all effects that were tried, by what they gain",
    "next_experiment": "runs that might settle what is open, the best first",
    "advice": "what to do next",
    "step": "0 is the base model, then one more for each effect added",
    "stopped_because": "why no further effect is added",
    "change": "what may have changed in the machine",
    "probability": "how likely it is that this changed, and no more",
    "size": "the size of the change, new over old; of a sensitivity, the spread of what is uncertain",
    "size_lo": "lower end of its 95 % interval",
    "size_hi": "upper end of its 95 % interval",
    "difference_k": "by how much the room is warmer",
    "broken": "sensors on which the filter broke",
    "undetermined": "sensors of which it does not tell where they settle",
    "width_c": "median width of the 95 % interval",
    "steps_per_s": "readings filtered per second",
    "chosen": "whether this filter is the one to use",
    "quantity": "what is told: the steady state or the settling time",
    "unit": "the unit",
    "uniform": "whether what is uncertain is spread evenly between bounds",
    "first_order": "share of the variance that it brings alone (Sobol)",
    "total": "share of the variance that it brings with all others (Sobol)",
    "rank": "its rank by that share",
    "rank_p": "how often it has that rank when the runs are drawn anew",
    "mean": "mean of the quantity",
    "deviation": "standard deviation of the quantity",
    "exceed_p_form": "chance of an error above the limit, by FORM",
    "exceed_p_mc": "the same by Monte Carlo",
    "exceed_p_mc_lo": "lower end of its 95 % interval",
    "exceed_p_mc_hi": "upper end of its 95 % interval",
    "lost": "runs that gave no number",
    "surrogate_error": "share of the variance that the polynomial misses",
    "method": "the method that tells the displacement from the temperatures",
    "left_out": "what was left out in turn: blocks of one run, or whole runs",
    "baseline_um": "error of the better of a mean and a straight line, or of the other runs at that minute",
    "coverage": "share of the readings inside the 95 % interval",
    "trusted": "whether this method is the one to trust",
    "formula": "the displacement [µm] of the temperatures in brackets [°C], fitted to all readings",
    "column": "the column of the file",
    "role": "time, sensor, ambient, input or ignored",
    "readings": "number of readings",
    "first": "first reading",
    "last": "last reading",
    "guessed": "what the file does not say and was guessed",
    "note": "what was done with it",
}


def unit_of(column: str) -> str:
    """The unit of a column's numbers; empty where it has none, or holds text."""
    return "K" if column in KELVIN else next((unit for end, unit in UNITS if column.endswith(end)), "")


def meaning_of(column: str) -> str:
    """What a column means, in words, empty for one that no record has; that of an interval's end is made from the column beside."""
    if column in MEANINGS:
        return MEANINGS[column]
    for side, said in SIDES.items():
        middle = column.replace(f"_{side}_", "_")
        if middle in MEANINGS:
            return f"{said}: {MEANINGS[middle]}"
    return ""
