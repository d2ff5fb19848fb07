"""How long a test must run: known limits on machines that are the law, and words where no time will do."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import thermofast as tf
from thermofast.experiments import planning
from thermofast.experiments.planning import Design, _curve, alternatives
from thermofast.models.imperfection import NONE, TYPICAL, Past, SensorShape
from thermofast.models.imperfection.draw import draw_record
from thermofast.pipeline.around import design_like


@pytest.mark.proof
def test_the_law_alone_needs_what_the_cramer_rao_limit_says():
    """One sensor of 8.8 K, 65.1 min, 20 mK, a reading a minute: the least standard deviation at 60 min is 0.08 K."""
    found = tf.plan(0.08 * 1.96, imperfection="none", sensors=1, interval_s=60.0, rise_c=8.8, tau_min=65.1)
    [row] = [r for r in found if r.channel == "as asked"]
    assert row.time_min == pytest.approx(60.0, rel=0.12)
    assert row.time_lo_min <= row.time_min <= row.time_hi_min
    often, quiet = (next(r for r in found if r.channel == c) for c in ("readings ten times as often", "half the noise"))
    assert often.time_min < quiet.time_min < row.time_min


def test_draws_of_the_background_are_of_its_size():
    rng, time, tau = np.random.default_rng(3), np.linspace(0.0, 240.0, 60), 60.0
    rises = np.full(3, 10.0)
    ends, pairs = [], []
    for _ in range(400):
        reading, limit = draw_record(TYPICAL, time, tau, rises, np.zeros(3), rng)
        ends.append(limit - 10.0)
        pairs.append(reading[:, -1])
    spread = np.std(ends)
    room, load, slow = 0.10 * np.sqrt(240.0 / 60.0), 0.1, 0.2
    assert spread == pytest.approx(np.sqrt(room**2 + load**2 + slow**2), rel=0.12)
    apart = np.std(np.array(ends)[:, 0] - np.array(ends)[:, 1]) / np.sqrt(2.0)
    assert apart == pytest.approx(slow, rel=0.15)  # room and load are common to a run


@pytest.mark.proof
def test_a_wish_that_the_machine_forbids_is_told_so(tool, monkeypatch, tmp_path):
    monkeypatch.setattr(planning, "DRAWS", 2)
    monkeypatch.setattr(planning, "TURNS", np.geomspace(0.3, 5.0, 5))
    picture = tmp_path / "plan.png"
    done = tool(
        "plan", "--tolerance", "2.5,0.02", "--sensors", 3, "--interval", "30s", "--format", "json", "-q", "--save-plot", picture
    )
    assert done.code == 0
    rows = {(r["channel"], r["tolerance_c"]): r for r in json.loads(done.out)["records"]}
    assert rows["as asked", 2.5]["status"] == "ok"
    assert rows["as asked", 2.5]["interval_s"] == 30.0
    hopeless = rows["as asked", 0.02]
    assert (hopeless["status"], hopeless["time_min"]) == ("hopeless", None)
    assert "the machine is the limit, not the readings, which alone would do after" in hopeless["message"]
    assert rows["a machine that is the law", 0.02]["status"] == "ok"
    # Without past runs, of the machine or of a lab of quiet ones, ``watch`` stops no earlier than after 1.5 time constants (of 65 min).
    early = [r for r in rows.values() if r["status"] == "ok" and r["time_constants"] < 1.5]
    waits = "watch does not stop before 1.5 time constants (97.5 min)"
    known = ("past run", "quiet machines")
    assert {waits in r["message"] for r in early if not any(k in r["channel"] for k in known)} == {True}
    assert {r["message"] for r in early if any(k in r["channel"] for k in known)} == {""}
    assert not any(waits in r["message"] for r in rows.values() if (r["time_constants"] or 9.0) >= 1.5)
    assert picture.stat().st_size > 10_000
    drawn = tool("plan", "--tolerance", 2.5, "--sensors", 3, "--interval", "30s", "--format", "table", "-q")
    told = sum(r["tolerance_c"] == 2.5 and waits in r["message"] for r in rows.values())
    assert told > 1
    assert f"{told} tests: {waits}" in drawn.out


@pytest.mark.proof
def test_a_record_of_the_machine_tells_what_it_takes_without_its_past_runs(monkeypatch, tmp_path):
    """The row said what machines in general take: 148 min where the record's own intervals took 545."""
    monkeypatch.setattr(planning, "DRAWS", 2)
    monkeypatch.setattr(planning, "TURNS", np.geomspace(0.3, 5.0, 6))
    time, rng = np.arange(0.0, 401.0), np.random.default_rng(3)

    def one(name):
        rises = np.array([12.0, 5.0, 2.0])[:, None]
        columns = 20.0 + rises * -np.expm1(-time / 60.0) + 0.05 * rng.standard_normal((3, len(time)))
        return tf.read({"time_min": time} | {f"T{k}": c for k, c in enumerate(columns)}, name=name)

    first, second = one("first"), one("second")
    model = tf.improve([first, second], together=True).model
    alone = {r.tolerance_c: r.time_min for r in tf.plan((1.0,), like=first) if r.channel == "as asked"}
    beside = {r.tolerance_c: r.time_min for r in tf.plan((1.0,), like=first, model=model) if r.channel == "without its past runs"}
    assert beside[1.0] == pytest.approx(alone[1.0], rel=0.25)
    assert tf.plan((1.0,), like=first, model=model, imperfection="none")[0].channel == "as asked"
    row = tf.plan((1.0,), model=model)[0]
    assert (row.rise_c, row.tau_min) == (pytest.approx(5.0, abs=0.2), pytest.approx(60.0, rel=0.05))


def test_a_test_like_another(tool, monkeypatch):
    monkeypatch.setattr(planning, "DRAWS", 2)
    monkeypatch.setattr(planning, "TURNS", np.geomspace(0.3, 5.0, 3))
    every = planning.alternatives
    monkeypatch.setattr(planning, "alternatives", lambda *given: every(*given)[:1])
    done = tool("plan", "--like", "sample_runs/spindle.csv", "--noise", 0.05, "--tolerance", 1, "--format", "json", "-q")
    row = json.loads(done.out)["records"][0]
    assert (row["sensors"], row["interval_s"], row["noise_c"]) == (10, pytest.approx(60.0), 0.05)
    for words, said in (
        (("--interval", "soon"), "not a time"),
        (("--tolerance", "0"), "not a list"),
        (("--tau", "-3"), "outside what is allowed: above 0"),
    ):
        refused = tool("plan", *words)
        assert refused.code == 2
        assert said in refused.err
    with pytest.raises(tf.ThermofastError, match="unknown word"):
        tf.plan(0.5, taus=3.0)


def test_the_record_it_is_like_is_read_as_said(tool, monkeypatch, tmp_path):
    monkeypatch.setattr(planning, "DRAWS", 2)
    given = ("--imperfection", "none", "--tolerance", "0.2", "--format", "json", "-q")
    run = "sample_runs/spindle.csv"
    done = tool("plan", "--like", run, "--channels", "T1,T2", "--to", "200", *given)
    assert [r["sensors"] for r in json.loads(done.out)["records"] if r["channel"] == "as asked"] == [2]
    (tmp_path / "own.toml").write_text('[input]\nchannels = ["T1"]\ninterval = 5\n')
    done = tool("--config", tmp_path / "own.toml", "plan", "--like", run, *given)
    assert [(r["sensors"], r["interval_s"]) for r in json.loads(done.out)["records"] if r["channel"] == "as asked"] == [(1, 60.0)]
    refused = tool("plan", "--to", "200", *given)
    assert (refused.code, "--to: no file is read" in refused.err) == (2, True)


def test_a_record_that_tells_nothing_of_the_machine_is_no_example_for_a_plan(tool, tmp_path):
    time = np.arange(0.0, 200.0, 1.0)
    rng = np.random.default_rng(2)
    flat, ramp = (tmp_path / f"{name}.csv" for name in ("flat", "ramp"))
    for path, column in ((flat, 0.0 * time), (ramp, 0.05 * time)):
        rows = [f"{t:g},{20 + v:.3f}" for t, v in zip(time, column + 0.02 * rng.standard_normal(len(time)), strict=True)]
        path.write_text("time_min,T1 [C]\n" + "\n".join(rows) + "\n")
        refused = tool("plan", "--like", path)
        assert refused.code == 2
        assert "no sensor of it shows where it settles" in refused.err


def test_a_wish_that_is_reached_but_does_not_stay_is_not_said_to_be_the_machines_limit():
    time = np.geomspace(10.0, 455.0, 15)
    curve = planning.Curve("as asked", time, np.full(15, 0.9), np.full((1, 15), 0.9))
    said = planning._why(curve, curve, 1.0, 0.9)
    assert said.startswith("within 7 time constants (455 min) it comes to +-0.9 K at best, but not on half of the machines")
    assert "the readings are the limit" in planning._why(curve, curve, 0.5, 0.9)


@pytest.mark.proof
def test_twice_the_sensors_waits_for_those_that_were_asked_for(monkeypatch):
    """All of twice as many take longer than the half of them, whatever they tell each other."""
    monkeypatch.setattr(planning, "DRAWS", 4)
    monkeypatch.setattr(planning, "TURNS", np.array([1.5, 2.5]))
    design = Design(sensors=3)
    asked, twice = (o for o in alternatives(design, TYPICAL) if o.name in ("as asked", "twice the sensors"))
    assert (asked.beside, twice.beside, twice.design.sensors) == (1, 2, 6)
    half = _curve(planning.TURNS, planning.DRAWS, replace(twice, beside=1)).half_width
    both = np.isfinite(half)
    assert both.any()
    assert np.all(_curve(planning.TURNS, planning.DRAWS, twice).half_width[both] < half[both] * 1.3)
    assert np.nanmean(_curve(planning.TURNS, planning.DRAWS, twice).half_width[both] / half[both]) < 1.0
    # As many are waited for with either, however many were asked for.
    assert planning.MOST_SENSORS == 12
    drawn = []
    monkeypatch.setattr(planning, "DRAWS", 1)
    monkeypatch.setattr(
        planning,
        "draw_record",
        lambda prior, time, tau, rises, *rest: drawn.append(rises) or draw_record(prior, time, tau, rises, *rest),
    )
    for option in (o for o in alternatives(Design(sensors=30), TYPICAL) if o.name in ("as asked", "twice the sensors")):
        _curve(planning.TURNS, planning.DRAWS, option)
    assert sorted({len(r) for r in drawn}) == [12, 24]
    assert drawn[-1][::2] == pytest.approx(drawn[0])


def test_the_logged_room_of_the_record_counts():
    """Sensors that follow a room which drifts by 2 K: with its column the record tells its limit ten times as well."""
    time = np.arange(0.0, 401.0)
    room = 20.0 + 2.0 * np.sin(2.0 * np.pi * time / 500.0)
    columns = {"time_min": time}
    for k, tau in enumerate((55.0, 70.0)):
        late = np.full(len(time), 20.0)
        for i in range(1, len(time)):
            late[i] = late[i - 1] + (0.5 * (room[i] + room[i - 1]) - late[i - 1]) * -np.expm1(-1.0 / tau)
        noise = np.random.default_rng(k).normal(0.0, 0.02, len(time))
        columns[f"T{k}"] = late - 9.0 * np.expm1(-time / tau) + noise
    designs, half = zip(
        *(design_like((tf.read(columns | logged), 0.0), TYPICAL) for logged in ({}, {"ambient": room})), strict=True
    )
    assert designs[1].rise_c == pytest.approx(9.0 + room[-1] - 20.0, abs=0.1)  # with the room as it is at the end
    assert designs[0].rise_c > designs[1].rise_c + 0.3
    known = np.isfinite(half[0]) & np.isfinite(half[1])
    assert known.sum() >= 5
    assert float(np.min(half[1][known] / half[0][known])) < 0.3
    assert np.nanmin(half[1]) < 0.5


def test_each_sensor_of_a_model_keeps_its_own_rise_and_time_constant_in_a_plan():
    """A small slow one: with the largest rise, or at the others' rate, it would set what is planned."""
    none = SensorShape.unseen(0.0, 0.05, TYPICAL)
    none = replace(none, amplitudes=0.05 * np.eye(len(none.amplitudes))[0])
    shapes = {
        "front": replace(none, log_rate=-np.log(40.0)),
        "bed": replace(none, log_rate=-np.log(200.0)),
        "rear": replace(none, log_rate=-np.log(50.0)),
    }
    past, design = Past(shapes, runs=3), Design(sensors=3, rise_c=18.0, tau_min=50.0, rises_c=(18.0, 2.0, 20.0))
    machine = planning._Machine.of(planning.Option("as asked", design, TYPICAL, past=past))
    assert machine.names == ("front", "bed", "rear")
    assert machine.rises == pytest.approx([18.0, 2.0, 20.0])
    assert machine.tau == pytest.approx([40.0, 200.0, 50.0])
    drawn = machine.drawn(NONE, np.array([0.0, 50.0, 1e4]), np.zeros(3), np.random.default_rng(1))
    whole = [np.interp(50.0 / tau, machine.known.x, one[0]) for tau, one in zip(machine.tau, machine.known.curve, strict=True)]
    assert drawn[:, 1] == pytest.approx(machine.rises * np.array(whole), rel=2e-3)
    assert np.abs(whole + np.expm1(-50.0 / machine.tau)).min() > 0.01
    twice = planning._Machine.of(planning.Option("twice", replace(design, sensors=6), TYPICAL, past=past, beside=2))
    assert twice.names == ("front", "front", "bed", "bed", "rear", "rear")
    few = planning._Machine.of(planning.Option("two", replace(design, sensors=2), TYPICAL, past=past))
    assert few.names == ("front", "rear")


def test_a_plan_names_the_sensor_that_is_last():
    names = ("bed", "front", "rear")
    assert planning._last(names, np.array([1.0, 0.9, 0.8])) == "'bed' last"
    told = planning._last(names, np.array([0.2, 0.3, 1.0]))
    assert told.startswith("'rear' last and by far")
    assert "--exclude it" in told
    assert planning._last(("bed", "bed"), np.array([5.0, 1.0])) == "'bed' last"


def test_a_hopeless_wish_is_told_what_its_own_readings_alone_would_do(monkeypatch):
    """Of each alternative the law with its readings, worked out with all the others; each piece of work is told."""

    def curve(turns, _draws, option):
        time = turns * option.design.tau_min
        soon = 100.0 * option.design.noise_c * option.design.interval_s
        half = np.where(time >= soon, 0.01, 5.0) if option.prior.none else np.full(len(turns), 1.0)
        return planning.Curve(option.name, time, half, half[None])

    monkeypatch.setattr(planning, "_curve", curve)
    monkeypatch.setattr(planning, "TURNS", np.geomspace(0.1, 10.0, 81))
    told = []
    rows, _ = planning.plan(planning.Design(interval_s=60.0, tau_min=60.0), (0.1,), TYPICAL, told.append)
    alone = {r.channel: float(re.search(r"alone would do after (\S+) min", r.message)[1]) for r in rows if r.status == "hopeless"}
    assert alone["as asked"] == pytest.approx(120.0, rel=0.1)
    assert alone["half the noise"] == pytest.approx(60.0, rel=0.1)
    assert alone["readings ten times as often"] == pytest.approx(12.0, rel=0.1)
    assert sum(told) == len(rows) + 3
