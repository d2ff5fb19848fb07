"""One filter over all sensors, and all filters on a user's record."""

import json
import math

import numpy as np
import pytest
from lone import identify_sensor, sweep_sensor
from scipy import stats

from thermofast.analysis.bench import Trial, choose_among, clearly_better
from thermofast.filters import Afukf
from thermofast.filters.joint import pooled_deviation, track_together
from thermofast.models import Lump
from thermofast.records import BenchRecord

METHOD = Afukf()


def machine(rng, ramp=0.0, sensors=8, minutes=120):
    t = np.arange(minutes + 1.0)
    rates, rises = rng.uniform(0.010, 0.025, sensors), rng.uniform(3.0, 12.0, sensors)
    since = np.maximum(0.0, t - minutes / 2)
    clean = [20.0 + r * (1.0 - np.exp(-b * t)) for b, r in zip(rates, rises, strict=True)]
    warm = [ramp / 60.0 * (since - (1.0 - np.exp(-b * since)) / b) for b in rates]
    return t, np.array(clean) + np.array(warm) + 0.02 * rng.standard_normal((sensors, len(t)))


def together(time, readings):
    return track_together(Lump(), METHOD.moments, METHOD.fading_rule, [(time, row, 0.0) for row in readings])


@pytest.mark.parametrize("m", [2, 5, 10, 30])
def test_pooled_evidence_is_a_standard_deviate(m):
    for p in (0.1, 1e-2, 1e-4):
        size = math.sqrt(stats.chi2.isf(p, m) / m)
        assert pooled_deviation([size] * m) == pytest.approx(stats.norm.isf(p), abs=0.12)
    assert pooled_deviation([2.5]) == 2.5
    assert pooled_deviation([0.1] * m) == 0.0


def test_a_sensor_alone_is_filtered_as_by_itself():
    time, y = machine(np.random.default_rng(1), ramp=2.0, sensors=1)
    [one] = together(time, y)
    alone = METHOD.track(Lump(), time, y[0], 0.0)
    assert np.allclose(one.state, alone.state, atol=1e-9, equal_nan=True)
    assert np.allclose(one.fading, alone.fading)


def test_healthy_sensors_are_left_alone():
    time, y = machine(np.random.default_rng(2))
    for track, row in zip(together(time, y), y, strict=True):
        assert (track.fading == 1.0).all()
        assert np.allclose(track.state, METHOD.track(Lump(), time, row, 0.0).state, atol=1e-9, equal_nan=True)


def test_a_cause_too_faint_for_each_wakes_all_together():
    earlier = 0
    for seed in range(6):
        time, y = machine(np.random.default_rng([3, seed]), ramp=0.5)
        woke = [np.flatnonzero(t.fading > 1.0) for t in together(time, y)]
        alone = [np.flatnonzero(METHOD.track(Lump(), time, row, 0.0).fading > 1.0) for row in y]
        firsts = [min((w[0] for w in ways if len(w)), default=999) for ways in (woke, alone)]
        assert all(len(w) for w in woke)
        assert firsts[0] <= firsts[1]
        earlier += int(np.median([w[0] if len(w) else 999 for w in woke]) < np.median([w[0] if len(w) else 999 for w in alone]))
    assert earlier >= 5


def test_gaps_and_a_sensor_that_breaks_leave_the_others_alone():
    time, y = machine(np.random.default_rng(4), sensors=3)
    records = [(time, y[0], 0.0), (np.delete(time, range(40, 60)), np.delete(y[1], range(40, 60)), 0.0), (time, y[2].copy(), 0.0)]
    records[2][1][80:] = 1e13
    tracks = track_together(Lump(), METHOD.moments, METHOD.fading_rule, records)
    assert tracks[2].diverged_at is not None
    assert np.isnan(tracks[2].state[tracks[2].diverged_at :]).all()
    for track, record in zip(tracks[:2], records[:2], strict=True):
        assert track.diverged_at is None
        assert track.state[-1] == pytest.approx(METHOD.track(Lump(), *record).state[-1], abs=1e-9)


def test_joint_at_the_command_line(tool, tmp_path):
    from thermofast.output.files import write_columns

    time, y = machine(np.random.default_rng(5), ramp=1.0, sensors=4)
    columns = {"time_min": time, **{f"T{i}": row for i, row in enumerate(y)}, "dead": np.full(len(time), 20.0)}
    write_columns(str(tmp_path / "run.csv"), columns)
    done = tool("identify", tmp_path / "run.csv", "--joint", "--imperfection", "none", "--rates", "own", "--format", "json", "-q")
    found = json.loads(done.out)["records"]
    assert done.code == 1
    assert [r["status"] for r in found] == ["model_doubtful"] * 4 + ["constant"]
    assert {r["filter"] for r in found} == {"afukf (joint)"}
    refused = tool("identify", tmp_path / "run.csv", "--joint", "--filter", "ekf")
    assert refused.code == 2
    assert "--joint runs the AFUKF" in refused.err


def test_bench_runs_every_filter_and_says_which_to_use(tool):
    from thermofast.pipeline.methods import known_filters

    done = tool("filters", "bench", "sample_runs/spindle.csv", "--until", 60, "--format", "json", "-q")
    assert done.code == 0, done.err
    found = json.loads(done.out)["records"]
    assert [r["filter"] for r in found] == [*known_filters(), "afukf (joint)"]
    assert sum(r["chosen"] for r in found) == 1
    for r in found:
        assert r["sensors"] == 10
        assert r["steps_per_s"] > 0
    best = next(r for r in found if r["chosen"])
    assert best["message"].startswith("use it here")
    wrong = tool("filters", "bench", "sample_runs/spindle.csv", "--until", 4000)
    assert wrong.code == 2
    assert "--until" in wrong.err


def test_the_default_stays_unless_another_filter_is_clearly_better():
    rng = np.random.default_rng(1)
    base = 0.1 * np.exp(0.3 * rng.standard_normal(10))

    def trial(name, ahead, broken=0):
        size = float(np.sqrt(np.mean(ahead**2))) if ahead is not None else None
        errors = ahead if ahead is not None else np.full(10, np.nan)
        return Trial(BenchRecord("r", "", filter=name, sensors=10, broken=broken, rmse_ahead_c=size, steps_per_s=1e5), errors)

    lucky = base * np.exp(np.array([-0.4, 0.3, -0.2, 0.1, -0.3, 0.2, -0.5, 0.4, -0.1, 0.2]))
    told = {r.filter: r for r in choose_among([trial("afukf", base), trial("ukf", lucky), trial("ekf", 0.1 * base, broken=1)])}
    assert told["afukf"].chosen
    assert "no filter is clearly better" in told["afukf"].message
    told = {
        r.filter: r for r in choose_among([trial("afukf", base), trial("ukf", 0.7 * base * np.exp(0.05 * rng.standard_normal(10)))])
    }
    assert told["ukf"].chosen
    told = {r.filter: r for r in choose_among([trial("afukf", None, broken=10), trial("ukf", base)])}
    assert told["ukf"].chosen
    assert "afukf broke" in told["ukf"].message
    told = choose_among([trial("afukf", None, broken=10)])
    assert "no filter came through" in told[0].message


def test_luck_seldom_changes_the_filter():
    rng = np.random.default_rng(2)
    wrong = 0
    for _ in range(400):
        errors = 0.1 * np.exp(0.3 * rng.standard_normal((12, 10)))
        wrong += any(clearly_better(row, errors[0], 0.05 / 11) for row in errors[1:])
    assert wrong <= 30  # 5 % of 400, and its scatter


def test_a_filter_that_cannot_run_says_so_in_the_records_status():
    from dataclasses import dataclass, replace

    from thermofast.estimation.request import Method
    from thermofast.filters import Ukf

    @dataclass(frozen=True)
    class Choosy(Ukf):
        name = "choosy"

        def track(self, model, time, reading, resolution=0.0):
            raise ValueError("needs a reading each second")

    time, y = machine(np.random.default_rng(6), sensors=1)
    method = replace(Method(Lump(), METHOD), filter=Choosy())
    one = identify_sensor("run", "T1", time, y[0], method).record
    swept = sweep_sensor("run", "T1", time, y[0], method, (60.0,), (30.0,), 0.1).records[0]
    for record in (one, swept):
        assert record.status == "diverged"
        assert record.message == "choosy: needs a reading each second"
