"""What a sceptical user and a reviewer found, held."""

import json

import numpy as np
import pytest

from models.spikes import third_difference_noise
from thermofast_cli.bench import Trial, choose_among
from thermofast_cli.colour import spectral_line
from thermofast_cli.output.files import write_columns
from thermofast_cli.output.text import cell
from thermofast_cli.records import BenchRecord

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
        assert f" T{i} " in shown or f"\n T{i} " in shown
