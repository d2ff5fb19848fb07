"""Shares of the uncertain things, the time still to go, and the area metric as a user meets them."""

import json
import math

import numpy as np
import pytest
from conftest import ROOT

import thermofast as tf
from thermofast.analysis.sensitivity import Sizes, _plain_factors, _points
from thermofast.estimation.closing import estimate_at
from thermofast.estimation.estimate import remaining
from thermofast.estimation.sensor import Sensor
from thermofast.models.uncertainty.chaos import design, fit_chaos, hermite
from thermofast.pipeline.methods import choose

METHOD = choose("afukf", None, ())
SPINDLE = str(ROOT / "sample_runs" / "spindle.csv")


def records(done):
    assert done.code == 0, done.err
    return json.loads(done.out)["records"]


def study(noise=0.02, until=60.0, seed=1):
    time = np.arange(121.0)
    rng = np.random.default_rng(seed)
    sensor = Sensor(time, 26.7 - 8.8 * np.exp(-0.01536 * time) + noise * rng.standard_normal(121), 0.0, ())
    count = sensor.until(until)
    track = METHOD.filter.track(METHOD.model, time[:count], sensor.reading[:count], 0.0)
    centre = estimate_at(METHOD.model, METHOD.filter, track, time[:count], sensor.reading[:count], count - 1, 0.0)
    factors, change = _plain_factors(Sizes(), sensor, until, centre)

    def outcome(point):
        reading, to = change(point)
        n = int(np.searchsorted(time, to, "right"))
        t = METHOD.filter.track(METHOD.model, time[:n], reading[:n], 0.0)
        found = estimate_at(METHOD.model, METHOD.filter, t, time[:n], reading[:n], n - 1, 0.0)
        return found.steady_state, found.t95

    return centre, factors, outcome


def test_132_runs_tell_what_monte_carlo_tells_from_1000():
    _, factors, outcome = study()
    points = _points(factors)
    assert len(points) == 132
    outputs = np.array([outcome(p) for p in points])
    drawn = np.random.default_rng(5).standard_normal((1000, points.shape[1]))
    counted = np.array([outcome(p) for p in drawn])
    for q in range(2):
        chaos = fit_chaos(points, outputs[:, q], 2)
        assert chaos.mean == pytest.approx(counted[:, q].mean(), abs=0.1 * counted[:, q].std())
        assert chaos.standard_deviation == pytest.approx(counted[:, q].std(), rel=0.06)
        assert not chaos.doubt


def test_the_noises_share_is_what_the_interval_says():
    centre, factors, outcome = study()
    points = _points(factors)
    chaos = fit_chaos(points, np.array([outcome(p)[0] for p in points]), 2)
    from_noise = math.sqrt(chaos.alone(range(3))) * chaos.standard_deviation
    width = (centre.steady_state_interval.high - centre.steady_state_interval.low) / 3.92
    assert from_noise == pytest.approx(width, rel=0.15)
    offset = math.sqrt(chaos.alone([6])) * chaos.standard_deviation
    assert offset == pytest.approx(0.1, rel=0.02)  # an offset of the probe moves the steady state by itself
    assert sum(chaos.alone(m) for m in ([0, 1, 2], [3, 4, 5], [6], [7], [8], [9])) == pytest.approx(1.0, abs=0.03)


def test_sensitivity_at_the_command_line(tool, tmp_path):
    picture = tmp_path / "shares.png"
    arguments = ["sample_runs/spindle.csv", "--until", 60, "--channels", "T1", "--limit", "0.5", "--format", "json", "-q"]
    found = records(tool("sensitivity", *arguments, "--save-plot", picture))
    assert picture.stat().st_size > 5000
    assert {r["quantity"] for r in found} == {"steady_state_c", "t95_min"}
    assert [r["factor"] for r in found[:6]] == [
        "probe noise",
        "time stamps",
        "probe offset",
        "start level",
        "room",
        "identification time",
    ]
    for r in found:
        assert r["status"] == "ok"
        assert -1e-9 <= r["first_order"] <= r["total"] + 1e-9 <= 1.0 + 1e-6
    steady = [r for r in found if r["quantity"] == "steady_state_c"]
    assert 0.2 < steady[0]["exceed_p_mc"] < 0.4
    assert steady[0]["exceed_p_form"] == pytest.approx(steady[0]["exceed_p_mc"], abs=0.03)
    assert found[-1]["exceed_p_mc"] is None
    small = records(tool("sensitivity", *arguments, "--room", "0"))
    assert small[0]["deviation"] < 0.3 * steady[0]["deviation"]


def test_sensitivity_with_a_model_holds_its_constants(tool, tmp_path):
    model = tmp_path / "machine.toml"
    assert tool("improve", "sample_runs/hidden.csv", "--add", "second_mode", "-o", model, "-q").code == 0
    run = "sample_runs/hidden_second_run.csv"
    found = records(tool("sensitivity", run, "--model", model, "--until", 60, "--channels", "T1,T2", "--format", "json", "-q"))
    factors = {r["factor"] for r in found}
    assert {"second_mode.kappa", "second_mode.rate", "rate", "probe offset", "room", "start level", "time stamps"} <= factors
    t95 = {r["factor"]: r["first_order"] for r in found if r["channel"] == "T1" and r["quantity"] == "t95_min"}
    assert max(t95, key=t95.get) == "second_mode.rate"


def test_nothing_is_said_of_what_is_not_determined(tool):
    done = tool("sensitivity", "sample_runs/spindle.csv", "--until", 8, "--channels", "T10", "--format", "json", "-q")
    for record in json.loads(done.out)["records"]:
        assert record["status"] == "not_determined"
        assert record["first_order"] is None
        assert "measure longer" in record["message"]


def test_time_to_go_is_what_is_left_of_t95(tool):
    for r in records(tool("identify", "sample_runs/spindle.csv", "--until", 60, "--format", "json", "-q")):
        assert r["time_to_go_min"] == pytest.approx(r["t95_min"] - 60.0)
        assert r["time_to_go_lo_min"] == pytest.approx(max(r["t95_lo_min"] - 60.0, 0.0), abs=1e-9)
        assert r["time_to_go_hi_min"] == pytest.approx(r["t95_hi_min"] - 60.0)
    twice = records(tool("identify", "sample_runs/spindle.csv", "--until", 60, "--pace", "10:2,1:1", "--format", "json", "-q"))
    plain = records(tool("identify", "sample_runs/spindle.csv", "--until", 60, "--format", "json", "-q"))
    for a, b in zip(twice, plain, strict=True):
        assert a["time_to_go_min"] == pytest.approx(b["time_to_go_min"] - 10.0)
    done = tool("identify", "sample_runs/spindle.csv", "--pace", "10")
    assert done.code == 2
    assert "MIN:FACTOR" in done.err


def test_time_to_go_of_a_settled_sensor_is_none_left_and_of_a_faded_one_its_own():
    time = np.arange(401.0)
    rng = np.random.default_rng(2)
    reading = 26.7 - 8.8 * np.exp(-0.01536 * time) + 0.02 * rng.standard_normal(401)
    track = METHOD.filter.track(METHOD.model, time, reading, 0.0)
    settled = estimate_at(METHOD.model, METHOD.filter, track, time, reading, 400, 0.0)
    assert remaining(settled, 400.0).median == 0.0
    ramped = reading[:121] + 2.0 / 60.0 * np.maximum(0.0, time[:121] - 60.0)
    track = METHOD.filter.track(METHOD.model, time[:121], ramped, 0.0)
    faded = estimate_at(METHOD.model, METHOD.filter, track, time[:121], ramped, 120, 0.0)
    assert faded.faded
    left = remaining(faded, 120.0)
    assert left.median is None or left.low <= left.median


def test_input_ranges_widen_what_the_area_metric_allows(tool):
    run = "sample_runs/hidden_two.csv"
    plain, wide = (
        records(tool("compare", run, "--channels", "T1,T2", "--effects", "ambient", *more, "--format", "json", "-q"))
        for more in ((), ("--input-range", "ambient=0.5"))
    )
    for a, b in zip(plain, wide, strict=True):
        assert 0.0 <= b["area_metric_c"] < a["area_metric_c"]
    done = tool("compare", run, "--input-range", "ambient=x")
    assert done.code == 2
    assert "COLUMN=X" in done.err


def test_ranks_are_as_sure_as_they_say():
    """Hermite series of degree three with known parts in the variance, told by polynomials of degree two."""
    rng, said = np.random.default_rng(5), []
    points = design(6, 2)
    single = hermite(points, 3)[0]
    for _ in range(150):
        linear, square, cube = rng.normal(0.0, 1.0, 6), rng.normal(0.0, 0.3, 6), rng.normal(0.0, 0.2, 6)
        outputs = single[1] @ linear + single[2] @ square + single[3] @ cube
        truth = np.argsort(np.argsort(-(linear**2 + square**2 + cube**2))) + 1
        rank, sure = fit_chaos(points, outputs, 2).ranks([[i] for i in range(6)])
        said += [(s, p == t) for s, p, t in zip(sure, rank, truth, strict=True)]
    sure, right = np.array([s for s, _ in said]), np.array([r for _, r in said])
    assert (sure > 0.9).mean() > 0.3
    assert right[sure > 0.9].mean() > 0.93
    assert right[(sure > 0.4) & (sure < 0.6)].mean() == pytest.approx(0.5, abs=0.2)


def test_a_tolerance_spreads_as_an_even_number_does():
    normal, even = (
        next(r for r in tf.sensitivity(SPINDLE, 60, channels="T5", sizes={"offset": 0.9}, uniform=u) if r.factor == "probe offset")
        for u in ((), "offset")
    )
    # Evenly within +- 0.9 is a standard deviation of 0.9 / sqrt(3).
    spread = [np.sqrt(r.first_order) * r.deviation for r in (normal, even)]
    assert spread[1] / spread[0] == pytest.approx(1.0 / math.sqrt(3.0), rel=0.02)
    with pytest.raises(tf.UsageError, match="no size whose bounds may be given"):
        tf.sensitivity(SPINDLE, 60, uniform="jitter")


def test_the_command_takes_tolerances(tool):
    assert "offset, start, room, until" in tool("sensitivity", SPINDLE, "--until", 60, "--uniform", "noise").err
    done = tool("sensitivity", SPINDLE, "--until", 60, "--channels", "T5", "--uniform", "offset,room", "--format", "json", "-q")
    found = {r["factor"]: r["first_order"] for r in records(done) if r["quantity"] == "steady_state_c"}
    assert found["room"] == pytest.approx(0.8, abs=0.15)  # a third of its variance as a standard deviation


def test_a_run_that_ends_before_the_identification_time_is_too_short_beside_a_long_one():
    time = np.arange(200.0)
    line = 20.0 + 8.0 * -np.expm1(-time / 30.0) + 0.02 * np.random.default_rng(3).standard_normal(200)
    short, long = (tf.read({"time_min": time[:n], "T1": line[:n]}, name=name) for n, name in ((30, "short"), (200, "long")))
    rows = tf.sensitivity([short, long], until=60)
    of_short = [r for r in rows if r.run == "short"]
    assert [r.status for r in of_short] == ["too_short"]
    assert "the record ends at 29 min, before --until 60" in of_short[0].message
    assert {r.status for r in rows if r.run == "long"} == {"ok"}
    late = tf.sensitivity(long, until=60, start=70)[0]
    assert (late.status, late.message) == (
        "too_short",
        "0 readings from 70 min, where the rise starts, to 60; at least 6 are needed",
    )
