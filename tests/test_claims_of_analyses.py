"""What analyses claim of records and machines whose truth is known: noise, cycles, displacement, settling, reliability."""

import json
from pathlib import Path

import numpy as np
import pytest

from thermofast.analysis.bench import Trial, choose_among
from thermofast.discovery.colour import spectral_line
from thermofast.estimation.rules import RULES
from thermofast.models.joint import RATE
from thermofast.models.noise.spikes import third_difference_noise
from thermofast.output.files import write_columns
from thermofast.output.text import cell
from thermofast.records import BenchRecord

HIDDEN = "sample_runs/hidden.csv"


def records(done):
    assert done.code == 0, done.err
    return json.loads(done.out)["records"]


def test_the_noise_of_unevenly_spaced_readings_is_that_of_even_ones():
    rng = np.random.default_rng(1)
    for spacing in (np.ones(400), rng.uniform(0.2, 2.0, 400), rng.exponential(1.0, 400) + 0.05):
        time = np.cumsum(spacing)
        reading = 20.0 + 8.0 * (1.0 - np.exp(-0.015 * time)) + 0.02 * rng.standard_normal(400)
        assert third_difference_noise(reading, time) == pytest.approx(0.02, rel=0.2)
    even = np.arange(400.0)
    assert third_difference_noise(reading, even) == pytest.approx(third_difference_noise(reading), rel=1e-9)


def test_a_filter_far_off_is_not_recommended_however_few_the_sensors():
    def trial(name, error):
        return Trial(BenchRecord("r", "", filter=name, sensors=1, rmse_ahead_c=error), np.array([error]))

    told = {r.filter: r for r in choose_among([trial("afukf", 785.0), trial("ukf", 6.6), trial("ekf", 7.8)])}
    assert told["ukf"].chosen
    assert "within" not in told["ukf"].message
    told = {r.filter: r for r in choose_among([trial("afukf", 0.1), trial("ukf", 0.06)])}
    assert told["afukf"].chosen


@pytest.mark.parametrize("period", [3.0, 4.0, 7.3])
def test_a_fast_cycle_is_no_noise(tool, tmp_path, period):
    rng = np.random.default_rng(2)
    time = np.arange(400.0)
    wave = 0.03 * np.sqrt(2.0) * np.sin(2 * np.pi * time / period)
    columns = {"time_min": time}
    for i, rate in enumerate((0.012, 0.018)):
        columns[f"T{i + 1}"] = 20.0 + 8.0 * (1.0 - np.exp(-rate * time)) + wave + 0.02 * rng.standard_normal(400)
    write_columns(str(tmp_path / "run.csv"), columns)
    for r in records(tool("compare", tmp_path / "run.csv", "--format", "json", "-q")):
        assert r["status"] == "model_doubtful"
        assert "cycle" in r["message"]
    p, found = spectral_line(columns["T1"] - columns["T1"].mean() * 0 - (20.0 + 8.0 * (1.0 - np.exp(-0.012 * time))))
    assert p < 1e-6
    assert found == pytest.approx(period, rel=0.05)
    clean = [spectral_line(rng.standard_normal(300))[0] for _ in range(500)]
    assert 0.02 < np.mean(np.array(clean) < 0.05) < 0.09


def test_nothing_missing_in_the_first_minutes_is_not_told_as_ok_when_the_rest_leaves_the_model(tool):
    for r in records(tool("diagnose", HIDDEN, "--until", 60, "--format", "json", "-q")):
        if r["verdict"] == "none":
            assert r["status"] == "not_determined"
            assert "leave the model" in r["advice"]


def test_input_ranges_are_checked_and_say_when_they_change_nothing(tool):
    wrong = tool("compare", HIDDEN, "--input-range", "nope=1")
    assert wrong.code == 2
    assert "no logged input" in wrong.err
    for r in records(tool("compare", HIDDEN, "--input-range", "ambient=1", "--format", "json", "-q")):
        assert "changes nothing" in r["message"]


def test_millimetres_are_turned_into_micrometres(tool, tmp_path):
    text = open_text("sample_runs/displacement.csv").splitlines()
    head, rows = text[0].replace("Z_um", "Z (mm)"), [line.split(",") for line in text[1:]]
    body = [",".join([*row[:6], f"{float(row[6]) / 1000.0:.4f}", row[7]]) for row in rows]
    (tmp_path / "mm.csv").write_text("\n".join([head, *body]) + "\n")
    done = tool("displacement", tmp_path / "mm.csv", "--format", "json")
    found = {(r["channel"], r["method"]): r for r in records(done)}
    assert found["Z (mm)", "least squares"]["rmse_ahead_um"] == pytest.approx(0.4, rel=0.1)
    assert "mm, turned into um" in done.err


def open_text(path):
    from pathlib import Path

    return (Path(__file__).resolve().parents[1] / path).read_text()


def test_a_displacement_that_drifts_away_from_the_temperatures_is_not_trusted(tool, tmp_path):
    rng = np.random.default_rng(3)
    time = np.arange(500.0)
    load = np.where((time // 100) % 2 == 0, 1.0, 0.2)
    above = np.zeros(500)
    for k in range(1, 500):
        above[k] = 8.0 * load[k] + (above[k - 1] - 8.0 * load[k]) * np.exp(-0.03)
    columns = {"time_min": time, "T1": 20.0 + above + 0.02 * rng.standard_normal(500)}
    columns["Z_um"] = 2.0 * above + 1e-4 * time**2 + 0.3 * rng.standard_normal(500)
    write_columns(str(tmp_path / "run.csv"), columns)
    assert not any(r["trusted"] for r in records(tool("displacement", tmp_path / "run.csv", "--format", "json", "-q")))


def test_every_kind_of_float_is_a_plain_number_in_a_table():
    assert cell(np.float64(0.5)) == "0.5"
    assert cell(np.float64("nan")) == ""


def test_the_sensor_stays_readable_in_a_wide_table(tool):
    shown = tool("identify", "sample_runs/cool_down.csv", "--until", 60, "--format", "table", "-q").out
    for i in range(1, 11):
        assert f"\nT{i} " in shown


def test_the_joint_threshold_is_that_of_the_pooled_deviate():
    from thermofast.filters.fading import Evidence
    from thermofast.filters.joint import joint_wake, pooled_deviation

    def evidence(z, matters=True):
        return Evidence(0.0, z, 4.0, 1.0, False, matters)

    strong, faint = [evidence(2.4)] * 10, [evidence(1.9)] * 10
    assert pooled_deviation([2.4] * 10) > 4.0 > pooled_deviation([1.9] * 10)
    assert joint_wake(strong) == pytest.approx(pooled_deviation([2.4] * 10) / 4.0)
    assert joint_wake(faint) == 0.0
    assert joint_wake([evidence(9.0)]) == 0.0  # one alone is judged by its own rule
    assert joint_wake([evidence(2.4, matters=False)] * 8 + strong[:2]) == 0.0


def test_the_default_is_left_for_what_is_more_than_twice_as_good():
    def trial(name, error):
        return Trial(BenchRecord("r", "", filter=name, sensors=1, rmse_ahead_c=error), np.array([error]))

    told = {r.filter: r for r in choose_among([trial("afukf", 0.25), trial("ukf", 0.1)])}
    assert told["ukf"].chosen


def test_the_period_of_a_slow_line_is_told():
    time = np.arange(400.0)
    noise = 0.2 * np.random.default_rng(1).standard_normal(400)
    assert spectral_line(np.sin(2 * np.pi * time / 40.0) + noise)[1] == pytest.approx(40.0, rel=0.02)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_three_readings_in_a_row_beyond_the_adaptive_limits_are_a_sudden_fault_and_two_are_not(side):
    from thermofast.discovery.stretches import _sudden

    rng = np.random.default_rng(2)
    residual = 0.3 * np.sin(np.arange(200.0) / 60.0) + 0.02 * rng.standard_normal(200)
    for length, found in ((2, 0), (3, 3), (6, 6)):
        faulty = residual.copy()
        faulty[100 : 100 + length] += side * 0.5
        assert int(_sudden(faulty, 0.02)[95:110].sum()) == found


def test_the_lagged_ramp_is_the_lumps_own():
    from scipy.integrate import solve_ivp

    from thermofast.analysis.sensitivity import _lagged_ramp

    time = np.linspace(0.0, 200.0, 41)
    solved = solve_ivp(
        lambda t, y: 0.03 * (min(t / 80.0, 1.0) - y), (0.0, 200.0), [0.0], t_eval=time, rtol=1e-9, atol=1e-11, max_step=1.0
    )
    assert np.abs(_lagged_ramp(time, 80.0, 0.03) - solved.y[0]).max() < 1e-6


def test_a_range_of_the_room_moves_the_curve_by_as_much_on_both_sides():
    from machines import draw

    from thermofast.discovery.compare import curve_bounds
    from thermofast.models.effects.ambient import Ambient
    from thermofast.models.joint import fit_model
    from thermofast.models.search.candidates import try_add
    from thermofast.observing.observe import observe
    from thermofast.reading import Run

    columns = draw(("ambient",), np.random.default_rng(3), "clear").columns
    sensors = {k: v for k, v in columns.items() if k[0] == "T"}
    run = observe(Run("drawn", columns["time_min"] * 60.0, sensors, {"ambient": columns["ambient"]})).seen
    fit = try_add(fit_model(run), Ambient()).fit
    low, high = curve_bounds(fit, {"ambient": 0.5})
    gain = float(np.ravel(fit.values[0, "gain"])[0])
    rise = 1.0 - np.exp(-fit.values[RATE] * run.span)
    assert gain > 0.2
    assert (high - fit.curve)[:, -1] == pytest.approx(0.5 * rise, rel=0.05)
    assert (fit.curve - low)[:, -1] == pytest.approx(0.5 * rise, rel=0.05)


def test_the_last_quarter_is_foretold_from_the_first_three():
    from thermofast.models.displacement import Sample, fit_least_squares, static
    from thermofast.models.displacement.scoring import later_coverage

    rng = np.random.default_rng(4)
    above = 5.0 + 4.0 * np.sin(np.arange(400.0) / 20.0)
    temperatures = 20.0 + np.stack([above, 0.5 * above], axis=1) + 0.02 * rng.standard_normal((400, 2))
    straight = 2.0 * above + 0.3 * rng.standard_normal(400)
    assert later_coverage(Sample.of(temperatures, straight), static(fit_least_squares)) > 0.88
    late = straight + 0.05 * np.maximum(np.arange(400.0) - 300.0, 0.0)
    assert later_coverage(Sample.of(temperatures, late), static(fit_least_squares)) < 0.5


def test_mildly_alike_neighbours_widen_the_interval_without_doubt():
    from thermofast.estimation.closing import likelihood_estimate
    from thermofast.models import variance_inflation

    time, widened = np.arange(120.0), []
    for seed in range(60):
        rng = np.random.default_rng([5, seed])
        noise = rng.standard_normal(120)
        for k in range(1, 120):
            noise[k] += 0.3 * noise[k - 1]
        reading = 26.0 - 8.0 * np.exp(-0.02 * time) + 0.02 * noise
        found = likelihood_estimate(time, reading, np.ones(120), 0, 0.0, 1e9)
        width = found.steady_state_interval.high - found.steady_state_interval.low
        if RULES.doubt < found.pattern_p < RULES.widen:
            widened.append(width / (2 * 1.98 * found.limit))
        elif found.pattern_p > RULES.widen:
            assert width / (2 * 1.98 * found.limit) == pytest.approx(1.0, abs=0.12)
    assert len(widened) > 8
    assert np.median(widened) > 1.15
    assert variance_inflation(np.ones(20)) > 1.0


def test_a_plain_filters_settling_time_is_that_of_its_rate():
    from thermofast.estimation.closing import estimate_at
    from thermofast.filters import Ukf
    from thermofast.models import Lump

    time = np.arange(121.0)
    reading = 26.7 - 8.8 * np.exp(-0.01536 * time) + 0.02 * np.random.default_rng(6).standard_normal(121)
    track = Ukf().track(Lump(), time, reading, 0.0)
    found = estimate_at(Lump(), Ukf(), track, time, reading, 120, 0.0)
    reach = 1.98 * np.sqrt(found.covariance[2, 2])
    assert found.t95 == pytest.approx(np.log(20.0) / found.rate)
    assert found.t95_interval.low == pytest.approx(np.log(20.0) / (found.rate + reach), rel=1e-3)
    assert found.t95_interval.high == pytest.approx(np.log(20.0) / (found.rate - reach), rel=1e-3)


def test_what_is_left_with_a_model_counts_from_the_last_reading(tool, tmp_path):
    model = tmp_path / "machine.toml"
    assert tool("improve", HIDDEN, "--add", "second_mode", "-o", model, "-q").code == 0
    for r in records(
        tool("identify", "sample_runs/hidden_second_run.csv", "--model", model, "--until", 60, "--format", "json", "-q")
    ):
        assert r["time_to_go_min"] == pytest.approx(r["t95_min"] - 60.0, abs=1.0)


def test_diagnose_until_gives_the_named_models_own_error_after_it(tool):
    for r in records(tool("diagnose", HIDDEN, "--until", 300, "--format", "json", "-q")):
        assert r["verdict"] == "second_mode"
        assert r["rmse_ahead_c"] < 0.4 * r["rmse_base_ahead_c"]


@pytest.mark.proof
def test_a_moving_room_beside_a_hidden_mass_is_found_where_it_acts_as_logged(tool, tmp_path):
    run = tmp_path / "run.csv"
    assert tool("simulate", "--effects", "ambient,second_mode", "--seed", 7, "-o", run).code == 0
    tried = "ambient,second_mode,friction_decay,sensor_drift,load_step"  # what it was once taken for, and what it is
    for r in records(tool("diagnose", run, "--effects", tried, "--format", "json", "-q")):
        assert set(r["verdict"].split("+")) == {"ambient", "second_mode"}


def test_a_range_is_named_as_a_channel_is(tool, tmp_path):
    """``ambient`` for ``ambient [degC]``, for compare and validate."""
    path = tmp_path / "run.csv"
    path.write_text(Path(HIDDEN).read_text().replace("ambient", "ambient [degC]", 1))
    short, whole = (
        tool("compare", path, "--input-range", f"{name}=1", "--format", "json", "-q") for name in ("ambient", "ambient [degC]")
    )
    assert short.code == whole.code == 0
    assert records(short) == records(whole)


def test_the_unknown_heat_stands_in_the_table(tool):
    done = tool("compare", HIDDEN, "--unknown-heat", "--channels", "T1", "--format", "table", "-q")
    told = json.loads(tool("compare", HIDDEN, "--unknown-heat", "--channels", "T1", "--format", "json", "-q").out)["records"][0]
    last = told["unknown_heat"][-1]
    expected = f"{last['heat_k_per_min']:.3g} ({last['lo_k_per_min']:.3g}..{last['hi_k_per_min']:.3g})"
    assert expected in " ".join(done.out.split())
    assert "heat at the end" not in tool("compare", HIDDEN, "--channels", "T1", "--format", "table", "-q").out
