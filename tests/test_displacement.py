"""Displacement from temperatures, and the colour of the noise, at the command line."""

import json
import re

import numpy as np
import pytest

from thermofast.discovery.stretches import failing_stretches
from thermofast.output.files import write_columns

RUN = "sample_runs/displacement.csv"


def records(done):
    assert done.code == 0, done.err
    return json.loads(done.out)["records"]


def test_each_displacement_is_told_the_right_way(tool, tmp_path):
    picture = tmp_path / "d.png"
    found = {
        (r["channel"], r["method"]): r for r in records(tool("displacement", RUN, "--format", "json", "-q", "--save-plot", picture))
    }
    assert picture.stat().st_size > 10_000
    assert set(found) == {(c, m) for c in ("Z_um", "Y_um") for m in ("least squares", "network", "arx")}
    assert [k for k, r in found.items() if r["trusted"]] == [("Z_um", "least squares"), ("Y_um", "network")]
    linear = found["Z_um", "least squares"]
    assert linear["rmse_ahead_um"] == pytest.approx(0.4, rel=0.1)  # the noise of the gauge
    assert 0.9 < linear["coverage"] < 0.99
    assert linear["sensors"] == ["T1", "T2", "T3", "T4", "T5"]
    assert found["Y_um", "network"]["rmse_ahead_um"] < 0.5 * found["Y_um", "least squares"]["rmse_ahead_um"]


def test_what_cannot_be_told_is_said(tool, tmp_path):
    rng = np.random.default_rng(1)
    time = np.arange(300.0)
    columns = {"time_min": time, "T1": 20.0 + 5.0 * (1.0 - np.exp(-0.02 * time)) + 0.02 * rng.standard_normal(300)}
    columns |= {"Z_um": np.cumsum(rng.standard_normal(300)), "still_um": np.full(300, 3.0)}
    write_columns(str(tmp_path / "run.csv"), columns)
    done = tool("displacement", tmp_path / "run.csv", "--format", "json", "-q")
    assert done.code == 1
    found = json.loads(done.out)["records"]
    assert not any(r["trusted"] for r in found)
    assert found[0]["message"].startswith("trust neither")
    assert found[-1]["status"] == "constant"
    short = {n: c[:60] for n, c in columns.items()}
    write_columns(str(tmp_path / "short.csv"), short)
    found = json.loads(tool("displacement", tmp_path / "short.csv", "--displacements", "Z_um", "--format", "json", "-q").out)[
        "records"
    ]
    assert found[0]["status"] == "too_short"
    assert "80 are needed" in found[0]["message"]
    none = json.loads(tool("displacement", "sample_runs/hidden.csv", "--format", "json", "-q").out)["records"]
    assert none[0]["status"] == "no_data"
    wrong = tool("displacement", RUN, "--displacements", "X_um")
    assert wrong.code == 2
    assert "Z_um" in wrong.err


def test_displacement_columns_are_no_sensors(tool):
    found = records(tool("identify", RUN, "--until", 100, "--format", "json", "-q"))
    assert [r["channel"] for r in found] == ["T1", "T2", "T3", "T4", "T5"]


def coloured(phi, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(400.0)
    columns = {"time_min": time}
    for i, rate in enumerate((0.012, 0.018)):
        noise, fresh = np.empty(400), rng.standard_normal(400)
        noise[0] = fresh[0]
        for k in range(1, 400):
            noise[k] = phi * noise[k - 1] + np.sqrt(1.0 - phi**2) * fresh[k]
        columns[f"T{i + 1}"] = 20.0 + 8.0 * (1.0 - np.exp(-rate * time)) + 0.02 * noise
    return columns


def test_a_loggers_smoothing_is_noise_and_a_slow_pattern_is_not(tool, tmp_path):
    for phi, seed in ((0.0, 1), (0.5, 2), (0.95, 4)):
        write_columns(str(tmp_path / "run.csv"), coloured(phi, seed))
        for r in records(tool("compare", tmp_path / "run.csv", "--format", "json", "-q")):
            if phi == 0.0:
                assert r["noise_order"] == "white"
                assert r["status"] == "ok"
            elif phi == 0.5:
                assert r["whiteness_p"] < 1e-3 < r["whitened_p"]
                assert 1.2 < r["long_run_factor"] < 4.5  # (1 + phi) / (1 - phi) = 3
                assert r["status"] == "ok"
            else:
                assert "a misfit, not noise" in r["message"]
                assert r["status"] == "model_doubtful"


def test_failing_stretches_are_rare_on_clean_records_and_sudden_faults_are_found():
    rng = np.random.default_rng(3)
    time, weight = np.arange(400.0), np.ones(400)
    alarms = sum(bool(failing_stretches(time, 0.02 * rng.standard_normal(400), weight, 0.02)) for _ in range(400))
    assert alarms <= 8  # 2 %; benchmarks.discovery.false_alarms counts more of them
    slow = 0.1 * np.sin(time / 60.0)
    fault = slow + 0.02 * rng.standard_normal(400)
    fault[200:206] += 0.3
    found = failing_stretches(time, fault, weight, 0.02)
    assert any(a <= 206 and b >= 200 and size > 0.1 for a, b, size in found)


def test_least_squares_gives_a_formula_and_every_method_its_predictions(tool, tmp_path):
    """2 um + 3 um/K T1 - 1.5 um/K T2 of two sensors that move apart comes back, and what is written is what was scored."""
    rng, time = np.random.default_rng(4), np.arange(400.0)
    one, two = 20.0 + 8.0 * (1.0 - np.exp(-0.01 * time)), 21.0 + 2.0 * np.sin(time / 40.0)
    columns = {"time_min": time, "T1": one, "T 2": two, "Z_um": 2.0 + 3.0 * one - 1.5 * two + 0.2 * rng.standard_normal(400)}
    write_columns(str(tmp_path / "run.csv"), columns)
    told = tmp_path / "told.json"
    done = tool("displacement", tmp_path / "run.csv", "--format", "json", "-q", "--predicted", told)
    linear, network, _ = records(done)
    assert (linear["method"], linear["trusted"], network["formula"]) == ("least squares", True, "")
    found = re.fullmatch(r"(\S+) \+ (\S+) \[T1\] - (\S+) \[T 2\]", linear["formula"])
    assert [float(n) for n in found.groups()] == pytest.approx([2.0, 3.0, 1.5], abs=0.25)
    assert [float(n) for n in found.groups()[1:]] == pytest.approx([3.0, 1.5], abs=0.02)
    rows = json.loads(told.read_text())["records"]
    assert len(rows) == 3 * 400
    mine = [r for r in rows if r["method"] == "least squares"]
    error = np.array([r["predicted_um"] - r["displacement_um"] for r in mine])
    assert np.sqrt(np.mean(error**2)) == pytest.approx(linear["rmse_ahead_um"])
    inside = np.mean([r["predicted_lo_um"] <= r["displacement_um"] <= r["predicted_hi_um"] for r in mine])
    assert inside == pytest.approx(linear["coverage"])
    drawn = tool("displacement", tmp_path / "run.csv", "--format", "table")
    assert f"Z_um = {linear['formula']}" in " ".join(drawn.out.split())
    refused = tool("displacement", tmp_path / "run.csv", "--predicted", tmp_path / "told.txt")
    assert refused.code == 2
    assert not (tmp_path / "told.txt").exists()
