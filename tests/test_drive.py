"""A logged drive in identify and sweep: the law of a machine whose heat is not constant."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import thermofast as tf
from benchmarks.intervals.driven import judged
from thermofast.discovery import improve
from thermofast.learning import past
from thermofast.learning.heat_law import HeatLaw
from thermofast.learning.jumps import last_change, stays
from thermofast.learning.rise import rises_of

TIME = np.arange(0.0, 300.0, 1.0)
POWER = np.where(TIME < 40, 600.0, np.where(TIME < 70, 300.0, np.where(TIME < 110, 900.0, 500.0)))


def response(tau, gain, power, start):
    """Exact for a power that is held between readings: T' = (gain power - T) / tau."""
    found, fall = np.zeros(len(TIME)), np.exp(-1.0 / tau)
    for k in range(1, len(TIME)):
        found[k] = found[k - 1] * fall + gain * power[k - 1] * (1.0 - fall)
    return start + found


def record(rng, tau_a=60.0, tau_b=90.0):
    noise = 0.02 * rng.standard_normal((2, len(TIME)))
    a, b = response(tau_a, 0.02, POWER, 20.0), response(tau_b, 0.03, POWER, 20.0)
    return pd.DataFrame({"time_min": TIME, "T1": a + noise[0], "T2": b + noise[1], "power_W": POWER}), (a, b)


@pytest.mark.proof
def test_intervals_hold_for_power_that_changes_before_and_after_the_identification_time():
    rng, inside, width = np.random.default_rng(1), [], []
    for _ in range(7):
        frame, (a, b) = record(rng, rng.uniform(30, 120), rng.uniform(30, 120))
        for until in (60.0, 100.0, 150.0):
            for r, truth in zip(tf.identify(frame, until=until, at=280, drive="power_W", units="C").records, (a, b), strict=True):
                assert r.status in ("ok", "model_doubtful"), r.message
                inside.append(r.at_lo_c - 0.02 <= truth[280] <= r.at_hi_c + 0.02)
                width.append(r.at_hi_c - r.at_lo_c)
    assert np.mean(inside) >= 0.9
    assert np.median(width) < 1.5


def test_the_steady_state_is_told_for_the_power_as_it_was_last(tool, tmp_path):
    frame, _ = record(np.random.default_rng(2))
    path = tmp_path / "run.csv"
    frame.to_csv(path, index=False)
    told = json.loads(tool("identify", path, "--drive", "power_W", "--until", 60, "--format", "json", "-q").out)["records"]
    for r, gain in zip(told, (0.02, 0.03), strict=True):
        assert r["steady_state_lo_c"] <= 20 + 300 * gain <= r["steady_state_hi_c"]
        assert "power_W as the heat, as last logged" in r["message"]
        assert "law fails" not in r["message"]
    plain = json.loads(tool("identify", path, "--until", 60, "--format", "json", "-q").out)["records"]
    assert all(r["status"] != "ok" for r in plain)
    swept = json.loads(
        tool(*("sweep", path, "--drive", "power_W", "--windows", 200, "--times", "60:180:30"), *("--format", "json", "-q")).out
    )["records"]
    assert all(r["rmse_c"] < 0.03 for r in swept)


def test_a_drive_that_the_temperatures_do_not_follow_is_not_counted(tool, tmp_path):
    rng = np.random.default_rng(3)
    frame = pd.DataFrame({"time_min": TIME, "T1": 20 + 9 * -np.expm1(-TIME / 60) + 0.02 * rng.standard_normal(len(TIME))})
    frame["power_W"] = POWER
    path = tmp_path / "run.csv"
    frame.to_csv(path, index=False)
    told = json.loads(tool("identify", path, "--drive", "power_W", "--until", 150, "--format", "json", "-q").out)["records"][0]
    assert "do not follow the drive" in told["message"]
    assert told["steady_state_lo_c"] <= 29.0 <= told["steady_state_hi_c"]


def test_a_sensor_that_does_not_follow_leaves_the_others_alone(tool, tmp_path):
    frame, _ = record(np.random.default_rng(5))
    frame.insert(3, "T3", 22 + 5 * -np.expm1(-TIME / 50) + 0.02 * np.random.default_rng(6).standard_normal(len(TIME)))
    path = tmp_path / "run.csv"
    frame.to_csv(path, index=False)
    told = json.loads(tool("identify", path, "--drive", "power_W", "--until", 150, "--format", "json", "-q").out)["records"]
    for r, truth in zip(told, (30.0, 35.0, 27.0), strict=True):
        assert r["steady_state_lo_c"] <= truth <= r["steady_state_hi_c"]
        assert r["steady_state_hi_c"] - r["steady_state_lo_c"] < 2.5
    assert ["do not follow" in r["message"] for r in told] == [False, False, True]
    swept = json.loads(
        tool(*("sweep", path, "--drive", "power_W", "--windows", 200, "--times", "60:180:60"), *("--format", "json", "-q")).out
    )["records"]
    assert [r["channel"] for r in swept] == ["T1", "T2", "T3"]
    assert all(r["rmse_c"] < 0.03 for r in swept)
    frame["power_W"] = 500.0
    frame.to_csv(path, index=False)
    still = json.loads(tool("identify", path, "--drive", "power_W", "--until", 150, "--format", "json", "-q").out)["records"]
    assert all("never changes" in r["message"] for r in still)
    # The sensors' last readings are missing: the whole record was read all the same (no until: this was a traceback).
    frame.loc[len(frame) - 2 :, ["T1", "T2", "T3"]] = np.nan
    frame.to_csv(path, index=False)
    still = json.loads(tool("identify", path, "--drive", "power_W", "--format", "json", "-q").out)["records"]
    assert all("never changes while it was read" in r["message"] for r in still)


@pytest.mark.parametrize("command", ["identify", "sweep"])
def test_a_drive_that_is_not_logged_is_met_with_words(tool, command):
    done = tool(command, "sample_runs/spindle.csv", "--drive", "power")
    assert done.code == 2
    assert "no logged input" in done.err


def test_the_bare_law_takes_no_drive(tool):
    done = tool("identify", "sample_runs/spindle.csv", "--drive", "power", "--imperfection", "none", "--rates", "own")
    assert done.code == 2
    assert "--imperfection none" in done.err


@pytest.mark.proof
def test_a_machine_of_two_bodies_under_a_load_in_steps():
    told = [judged((seed, share, "steps", 1.0)) for seed in range(5000, 5008) for share in (0.05, 0.1)]
    sure = [held for _, _, _, status, held, _ in told if status == "ok"]
    assert len(sure) >= 8
    assert np.mean(sure) >= 0.9


@pytest.mark.proof
def test_a_heat_that_follows_a_power_of_the_drive():
    """Taken in proportion, half of such rows were `ok` beside the truth."""
    told = [judged((seed, 0.0, "steps", 1.7)) for seed in range(5000, 5012)]
    sure = [held for *_, status, held, _ in told if status == "ok"]
    assert len(sure) >= 8
    assert np.mean(sure) >= 0.9
    speed = (POWER / 900.0) ** 0.5
    body = response(50.0, 0.02, POWER, 20.0) + 0.02 * np.random.default_rng(3).standard_normal(len(TIME))
    frame = pd.DataFrame({"time_min": TIME, "T1": body, "speed": 6000.0 * speed})
    run = tf.read(frame, inputs="speed")
    told = float(re.search(r"follows speed to the power (\S+) ±", tf.identify(run, drive="speed")[0].message)[1])
    assert told == pytest.approx(2.0, abs=0.05)
    plain = tf.read(frame.assign(speed=POWER), inputs="speed")
    assert "to the power" not in tf.identify(plain, drive="speed")[0].message
    model = tf.improve(run, drive="speed", auto=True).model
    assert model.effects == ("load_step",)
    again = tf.identify(run, until=150, model=model)[0]
    assert again.steady_state_lo_c <= 30.0 <= again.steady_state_hi_c  # 500 W at 0.02 K/W in a room of 20 degC


def test_a_heat_that_was_switched_off_leaves_no_rise_of_which_95_per_cent_could_be_told():
    """Time to go was that of a hundredth of a kelvin, nine hours, where the machine was within a quarter of one at 290 min."""
    power = np.where(TIME < 100.0, 600.0, 0.0)
    body = response(50.0, 0.02, power, 20.0) + 0.02 * np.random.default_rng(3).standard_normal(len(TIME))
    frame = pd.DataFrame({"time_min": TIME, "T1": body, "power_W": power})
    (row,) = tf.identify(frame, until=140, drive="power_W").records
    assert row.status == "ok"
    assert row.steady_state_lo_c <= 20.0 <= row.steady_state_hi_c
    assert (row.t95_min, row.time_to_go_min, row.unseen) == (None, None, "")
    assert "settles where it began" in row.message
    (on,) = tf.identify(frame, until=90, drive="power_W").records
    assert on.t95_min is not None


def test_a_heat_that_goes_on_and_off_swings_about_what_is_foretold_beyond_its_log():
    """Ten minutes on, ten off: a lump of 30 min swings by more than a kelvin about the mean that is foretold."""
    time = np.arange(0.0, 301.0)
    load = np.where(time % 20.0 < 10.0, 100.0, 0.0)
    rise = np.zeros(301)
    for k in range(1, 301):
        rise[k] = rise[k - 1] + (16.0 * load[k - 1] / 100.0 - rise[k - 1]) * -np.expm1(-1.0 / 30.0)
    reading = 20.0 + rise + np.random.default_rng(1).normal(0.0, 0.02, 301)
    seen = {"time_min": time[:141], "T1": reading[:141], "load": load[:141]}
    for at in (250, 255, 260, 265):
        told = tf.identify(seen, drive="load", at=at)[0]
        assert told.at_lo_c < reading[at] < told.at_hi_c
        assert told.at_hi_c - told.at_lo_c < 6.0
    # As far as the log goes it tells where in its cycle the heat is.
    told = tf.identify({"time_min": time, "T1": reading, "load": load}, until=140, drive="load", at=250)[0]
    assert told.at_c == pytest.approx(reading[250], abs=0.3)
    assert told.at_hi_c - told.at_lo_c < 1.0


def test_readings_after_a_logged_change_do_not_contradict_what_was_foretold_before_it():
    """Switched off two hours after the readings used, and the log says so: what was foretold is for a machine that stays on."""
    time = np.arange(0.0, 301.0)
    rise = np.where(time < 180.0, 10.0 * -np.expm1(-time / 40.0), 10.0 * -np.expm1(-180.0 / 40.0) * np.exp(-(time - 180.0) / 40.0))
    table = {"time_min": time, "T1": 20.0 + rise + np.random.default_rng(4).normal(0.0, 0.02, 301)}
    logged = table | {"load": np.where(time < 180.0, 100.0, 0.0)}
    for more in ({}, {"drive": "load"}):
        told = tf.identify(logged, until=90, **more)[0]
        assert told.status == "ok"
        assert told.rmse_ahead_c < 0.2
        assert "load changes at 180 min: readings from then on are not compared" in told.message
    assert tf.identify(table, until=90)[0].status == "model_doubtful"  # nothing says why they fall
    # What goes on and off all the time is no such change.
    humming = table | {"pump": np.where(time % 6.0 < 3.0, 1.0, 0.0)}
    assert "not compared" not in tf.identify(humming, until=90)[0].message


def test_a_power_that_moves_by_its_noise_alone_is_not_counted():
    """A meter's noise of one per cent was followed as heat: narrow intervals, and a load that changed in the last minute."""
    rng = np.random.default_rng(8)
    columns = {
        "time_min": TIME,
        "T1": response(60.0, 0.02, np.full(len(TIME), 500.0), 20.0) + 0.02 * rng.standard_normal(len(TIME)),
    }
    noisy = columns | {"power": 500.0 * (1.0 + 0.01 * rng.standard_normal(len(TIME)))}
    for minutes in (30, 90):
        [plain] = tf.identify(columns, until=minutes)
        [told] = tf.identify(noisy, until=minutes, drive="power")
        assert "power changes by no more than its noise before" in told.message
        assert "the load changed" not in told.message
        for side in ("", "_lo", "_hi"):
            assert getattr(told, f"steady_state{side}_c") == pytest.approx(getattr(plain, f"steady_state{side}_c"), abs=1e-9)


@pytest.mark.parametrize(
    ("shape", "still"),
    [
        (lambda t, n: 500.0 + 5.0 * n, True),
        (lambda t, n: 500.0 + 0.0 * n, True),
        (lambda t, n: 500.0 + 4.0 * np.sin(t / 20.0), True),  # a flutter of one per cent
        (lambda t, n: 500.0 + 5.0 * n + np.where(t > 100.0, 50.0, 0.0), False),
        (lambda t, n: 500.0 + 5.0 * n + 0.5 * t, False),
        (lambda t, n: np.where(t % 20.0 < 10.0, 500.0, 0.0) + 5.0 * n, False),
        (lambda t, n: np.where(t % 4.0 < 2.0, 500.0, 0.0), False),
        (lambda t, n: np.where(t < 1.0, 0.0, 500.0) + 5.0 * n, False),
    ],
)
def test_what_moves_by_noise_or_flutter_stays(shape, still):
    assert stays(shape(TIME, np.random.default_rng(3).standard_normal(len(TIME)))) is still


def test_noise_is_no_jump_of_a_logged_column():
    noise = np.random.default_rng(4).standard_normal(len(TIME))
    assert last_change(TIME, 500.0 + 5.0 * noise) == -np.inf
    assert last_change(TIME, 500.0 + 5.0 * noise + np.where(TIME >= 100.0, 60.0, 0.0)) == 100.0


@pytest.mark.parametrize(("last", "slow"), [(111.0, 0.2), (150.0, 0.3)])
def test_a_load_in_stages_begins_where_its_readings_do_and_is_not_done_before_they_are(last, slow):
    """A low speed first: the one exponential through it all begins well below the first readings."""
    rng, time = np.random.default_rng(2), np.arange(0.0, last, 0.5)
    speed = np.where(time < 40.0, 1000.0, np.where(time < 70.0, 6000.0, 8000.0))
    columns = {"time_min": time, "speed (rpm)": speed}
    for name, rise, tau in (("front", 16.0, 22.0), ("rear", 18.0, 20.0), ("motor", 20.0, 18.0)):
        bodies = np.zeros((2, len(time)))
        for k in range(1, len(time)):
            heat = (speed[k - 1] / 8000.0) ** 1.54
            for body, each in enumerate((tau, 4.0 * tau)):
                bodies[body, k] = heat + (bodies[body, k - 1] - heat) * np.exp(-0.5 / each)
        own = 21.0 + rise * ((1.0 - slow) * bodies[0] + slow * bodies[1])
        columns[f"{name} [degC]"] = own + 0.03 * rng.standard_normal(len(time))
    for row in tf.identify(columns, drive="speed (rpm)"):
        reading = columns[row.channel]
        assert row.initial_c == pytest.approx(reading[0], abs=1e-9)
        if float(np.median(reading[-21:])) < row.initial_c + 0.95 * (row.steady_state_c - row.initial_c):
            assert row.t95_min >= time[-1] - 0.5


def test_a_drive_is_named_beside_its_model_as_without_one():
    """By its name before the unit, as the command that learnt the model took it; another column is refused."""
    time, rng = np.arange(0.0, 240.0), np.random.default_rng(0)
    speed = np.where(time < 100.0, 3000.0, 4500.0)
    reading = 20.0 + 8.0 * -np.expm1(-time / 40.0) + 4.0 * -np.expm1(-np.maximum(time - 100.0, 0.0) / 40.0)
    table = {
        "time_min": time,
        "T1 [degC]": reading + 0.02 * rng.standard_normal(240),
        "speed [rpm]": speed,
        "flow [l/min]": 1.0 + time,
    }
    run = tf.read(table, inputs=["speed", "flow"])
    model = tf.improve(run, drive="speed").model
    assert model.drive == "speed [rpm]"
    bare, whole = (tf.compare(run, model=model, drive=name).records for name in ("speed", "speed [rpm]"))
    assert bare == whole
    with pytest.raises(tf.UsageError, match="is not what the model was learnt with"):
        tf.compare(run, model=model, drive="flow")


def squared(seed, power=POWER):
    """A run whose heat goes as the square of the speed that is logged."""
    body = response(50.0, 0.02, power, 20.0) + 0.02 * np.random.default_rng(seed).standard_normal(len(TIME))
    table = {"time_min": TIME, "T1 [degC]": body, "speed": 6000.0 * (power / 900.0) ** 0.5}
    return tf.read(table, inputs="speed", name=f"run {seed}")


def test_a_model_is_learnt_with_the_power_to_which_the_heat_follows_its_drive():
    """Taken in proportion, a spindle's rows by such a model were `ok` and kelvins beside the truth."""
    one = tf.improve(squared(3), drive="speed")
    both = tf.improve([squared(3), squared(4)], drive="speed", together=True)
    for learnt in (one, both):
        assert learnt.model.effects == ("load_step",)
        (why,) = {r.stopped_because for r in learnt.records if r.stopped_because}
        power, error = map(
            float, re.search(r"was asked for; the heat follows speed to the power (\S+) ± (\S+), and not", why).groups()
        )
        assert abs(power - 2.0) <= error < 0.05
        cold = squared(5, np.where(TIME < 60.0, 300.0, 850.0))
        row = tf.identify(cold, until=80, model=learnt.model)[0]
        assert row.steady_state_lo_c <= 20.0 + 0.02 * 850.0 <= row.steady_state_hi_c
        assert row.steady_state_hi_c - row.steady_state_lo_c < 2.0
    plain = tf.read({"time_min": TIME, "T1 [degC]": squared(3).channels["T1 [degC]"], "power": POWER}, inputs="power")
    assert tf.improve(plain, drive="power").model.effects == ()
    assert tf.improve(squared(3)).model.effects == ()  # without a drive


@pytest.mark.parametrize(("part", "share"), [(0.3, past.DRIVEN), (0.0, 0.0)])
def test_a_driven_model_that_leaves_a_pattern_may_follow_at_other_rates_too(monkeypatch, part, share):
    fast = part * response(4.0, 0.02, POWER, 20.0) + (1.0 - part) * response(60.0, 0.02, POWER, 20.0)
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(TIME))
    run = tf.read({"time_min": TIME, "T1 [degC]": fast + noise, "speed": POWER}, inputs="speed")
    model = tf.improve(run, drive="speed").model
    assert past.past_of_model(model).unexplained == (("T1 [degC]",) if part else ())
    seen = []
    monkeypatch.setattr(past, "rises_of", lambda *a, **more: seen.append(more["other_modes"]) or rises_of(*a, **more))
    tf.identify(run, until=150, model=model, jobs=1)
    assert seen == [share]


@pytest.mark.parametrize(("until", "said"), [(112, True), (114, True), (120, False)])
def test_soon_after_a_jump_a_driven_model_that_leaves_a_pattern_is_doubted(until, said):
    """The drive jumps at 110 min; a quarter of the time constant later (one rate for both parts, of some 30 min) it shows."""
    fast = 0.3 * response(4.0, 0.02, POWER, 20.0) + 0.7 * response(60.0, 0.02, POWER, 20.0)
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(TIME))
    run, clean = (
        tf.read({"time_min": TIME, "T1": r + noise, "speed": POWER}, units="C") for r in (fast, response(60, 0.02, POWER, 20))
    )
    row = tf.identify(run, until=until, model=tf.improve(run, drive="speed").model, jobs=1)[0]
    assert ("the load changed" in row.message) is said
    assert not said or row.status == "model_doubtful"
    plain = tf.identify(clean, until=until, model=tf.improve(clean, drive="speed").model, jobs=1)[0]
    assert "the load changed" not in plain.message  # it leaves none


@pytest.mark.parametrize(
    "of", [(41017, 0.1, "steps", 1.0), (41012, 0.1, "steps", 1.5), (41017, 0.1, "steps", 1.5), (41018, 0.2, "steps", 2.5)]
)
def test_a_fast_part_of_a_tenth_to_a_fifth_is_counted_as_the_drive_changes(of):
    """Rows of benchmarks.intervals.driven that were `ok` beside the truth while only the first change was followed by such a part."""
    *_, held, _ = judged(of)
    assert held


def test_a_power_that_may_be_none_is_not_learnt(monkeypatch):
    law = HeatLaw(None, 0.4, 0.5, "")
    monkeypatch.setattr(improve, "heat_law", lambda fit: law)
    driven = SimpleNamespace(run=SimpleNamespace(heat=np.ones(3)))
    assert improve.followed(driven) is None
    sure = HeatLaw(None, 0.6, 0.5, "")
    monkeypatch.setattr(improve, "heat_law", lambda fit: sure)
    assert improve.followed(driven) is sure
    assert improve.followed(SimpleNamespace(run=SimpleNamespace(heat=None))) is None
