"""compare --unknown-heat and diagnose --write-effect: the heat that a record needs, and the logged column that it follows."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter
from simulator import held_response

import thermofast as tf
from benchmarks.analysis.unknown_heat import power_trial, powered, trial
from thermofast.analysis.unknown_heat import possible_rates, probed, told_heat
from thermofast.models.uncertainty.lump_heat import Lump, following_rate, smooth_heat
from thermofast.models.uncertainty.unknown_heat import POWERS, followed_column, shapes_of


def written(path, speed="speed", seed=3, second=0.0):
    """A file of two sensors whose heat is the square of a logged column, integrated by scipy; second: another column's share."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 300.0, 300)
    column = np.interp(time, np.linspace(0.0, 300.0, 8), rng.uniform(0.3, 1.0, 8))
    other = np.where((time > 90.0) & (time < 200.0), 1.0, 0.2)

    def law(t, y):
        return 0.012 * (20.0 * (np.interp(t, time, column) ** 2 + second * np.interp(t, time, other)) - y)

    rise = solve_ivp(law, (0.0, 300.0), [0.0], t_eval=time, max_step=1.0).y[0]
    rows = [
        f"{t:.3f},{22.0 + y + 0.03 * rng.normal():.3f},{22.0 + 0.6 * y + 0.03 * rng.normal():.3f},{3000.0 * u:.1f},{w:.2f}"
        for t, y, u, w in zip(time, rise, column, other, strict=True)
    ]
    path.write_text("\n".join([f'time_min,front,rear,"{speed}",pump', *rows]) + "\n")
    return time, column, rise


def test_the_smoothed_heat_of_a_constant_heat_is_that_heat():
    time = np.linspace(0.0, 200.0, 201)
    reading = 20.0 + 15.0 * -np.expm1(-0.03 * time)
    told = smooth_heat(Lump(time, reading, np.full(201, 0.01), np.full(201, 20.0)), 0.03)
    # dT/dt + b (T - sink) of an exponential rise is b times its height at every time.
    assert told.heat == pytest.approx(0.03 * 15.0, rel=0.01)
    assert np.all(told.deviation > 0.0)


def test_surroundings_that_move_are_no_heat():
    time = np.linspace(0.0, 300.0, 301)
    sink = 20.0 + 2.0 * np.sin(2.0 * np.pi * time / 150.0)
    whole = solve_ivp(lambda t, y: 0.02 * (np.interp(t, time, sink) + 10.0 - y), (0.0, 300.0), [20.0], t_eval=time, max_step=0.5)
    told = smooth_heat(Lump(time, whole.y[0], np.full(301, 0.01), sink), 0.02)
    assert np.abs(told.heat - 0.2).max() < 0.01


def test_a_rate_that_is_not_known_widens_the_band_by_what_it_would_shift():
    time = np.linspace(0.0, 200.0, 201)
    lump = Lump(time, 20.0 + 15.0 * -np.expm1(-0.03 * time), np.full(201, 0.01), np.full(201, 20.0))
    sure, unsure = smooth_heat(lump, 0.03), smooth_heat(lump, 0.03, 0.1)
    # Another rate b' turns the same readings into q + (b' - b)(T - sink): at the end by 0.1 x 0.03 x 15 K.
    assert unsure.deviation[-20] == pytest.approx(0.1 * 0.03 * 15.0, rel=0.15)
    assert sure.deviation[-20] < 0.2 * unsure.deviation[-20]


@pytest.mark.proof
@pytest.mark.parametrize("kind", ["column", "ramp", "walk"])
def test_the_band_holds_the_heat_and_only_a_column_that_it_follows_is_claimed(kind):
    told = [trial(kind, True, seed) for seed in range(6)]
    assert np.mean([held for held, _ in told]) >= 0.9
    said = [w for _, w in told]
    assert said.count("right") >= 5 if kind == "column" else said.count("") >= 5


@pytest.mark.proof
def test_a_model_of_another_run_tells_the_rate_that_a_moving_heat_would_bend():
    """A heat that doubles looks like a machine four times as slow; the rate of a run at constant heat is the machine's."""
    time = np.linspace(0.0, 400.0, 401)
    heat = 0.3 * (1.0 + np.clip((time - 150.0) / 100.0, 0.0, 1.0))
    rng = np.random.default_rng(5)

    def run(acting):
        rise = solve_ivp(lambda t, y: np.interp(t, time, acting) - 0.025 * y, (0.0, 400.0), [0.0], t_eval=time, max_step=1.0).y[0]
        return {"time_min": time, "T1": 20.0 + rise + rng.normal(0.0, 0.02, 401), "ambient": np.full(401, 20.0)}

    model = tf.improve([run(np.full(401, 0.3))]).model
    told = tf.compare(run(heat), model=model, unknown_heat=True)[0].unknown_heat
    at, low, high = (np.array([row[n] for row in told]) for n in ("time_min", "lo_k_per_min", "hi_k_per_min"))
    true = np.interp(at, time, heat)
    assert np.mean((low <= true) & (true <= high)) > 0.9
    assert np.median(high - low) < 0.2 * heat.mean()


def test_what_flows_to_a_mass_that_the_model_knows_is_in_the_heat_of_the_part():
    """A second mass, and a heat that grows by four fifths: what the part itself needs is what acts less what the mass takes."""
    time = np.linspace(0.0, 400.0, 401)
    rng = np.random.default_rng(7)

    def run(acting):
        def law(t, y):
            return [np.interp(t, time, acting) - 0.03 * y[0] - 0.015 * (y[0] - y[1]), 0.01 * (y[0] - y[1])]

        rise = solve_ivp(law, (0.0, 400.0), [0.0, 0.0], t_eval=time, max_step=1.0, rtol=1e-8).y
        table = {"time_min": time, "T1": 20.0 + rise[0] + rng.normal(0.0, 0.01, 401), "ambient": np.full(401, 20.0)}
        return table, acting - 0.015 * (rise[0] - rise[1])

    model = tf.improve([run(np.full(401, 0.3))[0]], add=["second_mode"]).model
    table, net = run(0.3 * (1.0 + 0.8 * np.clip((time - 150.0) / 100.0, 0.0, 1.0)))
    told = tf.compare(table, model=model, unknown_heat=True)[0]
    at, low, high = (np.array([row[n] for row in told.unknown_heat]) for n in ("time_min", "lo_k_per_min", "hi_k_per_min"))
    true = np.interp(at, time, net)
    assert np.mean((low <= true) & (true <= high)) > 0.9
    assert np.median(high - low) < 0.2
    assert "what second_mode brings or takes is in it" in told.message


@pytest.mark.proof
def test_a_room_that_the_model_counts_is_taken_off_at_the_learnt_rate():
    """A logged room that goes up by 8 K, and a heat that doubles: the run's own fit bends the rate, and with it what the room does."""
    time = np.linspace(0.0, 400.0, 401)
    rng = np.random.default_rng(3)

    def run(acting, room):
        def law(t, y):
            return np.interp(t, time, acting) - 0.03 * (y - np.interp(t, time, room))

        read = solve_ivp(law, (0.0, 400.0), [20.0], t_eval=time, max_step=1.0, rtol=1e-8).y[0]
        return {"time_min": time, "T1": read + rng.normal(0.0, 0.01, 401), "ambient": room}

    still = 20.0 + 3.0 * np.sin(time / 40.0)
    model = tf.improve([run(np.full(401, 0.3), still)], add=["ambient"]).model
    heat = 0.3 * (1.0 + np.clip((time - 100.0) / 200.0, 0.0, 1.0))
    told = tf.compare(run(heat, 20.0 + 8.0 * np.clip((time - 200.0) / 60.0, 0.0, 1.0)), model=model, unknown_heat=True)[0]
    at, low, high = (np.array([row[n] for row in told.unknown_heat]) for n in ("time_min", "lo_k_per_min", "hi_k_per_min"))
    true = np.interp(at, time, heat)
    assert np.mean((low <= true) & (true <= high)) > 0.9


@pytest.mark.proof
def test_the_lag_of_a_probe_is_no_heat_and_no_other_rate():
    """Speed squared in steps, read by a probe that is 0.9 min late: by scipy's solver, at two readings a minute."""
    time = np.linspace(0.0, 300.0, 601)
    column = np.array([0.4, 1.0, 0.6, 0.9, 0.5])[np.minimum((time // 60.0).astype(int), 4)]

    def law(t, y):
        return [0.4 * np.interp(t, time, column) ** 2 - 0.03 * y[0], (y[0] - y[1]) / 0.9]

    read = solve_ivp(law, (0.0, 300.0), [0.0, 0.0], t_eval=time, max_step=0.25, rtol=1e-8, atol=1e-9).y[1]
    lump = Lump(time, 20.0 + read + np.random.default_rng(2).normal(0.0, 0.02, 601), np.full(601, 0.02), np.full(601, 20.0))
    (late,), follows = probed([lump], [possible_rates(lump)], {"speed": column}, time)
    # About a step a lag of less than a minute is a delay as well.
    assert late.lag + follows[0].delay_min == pytest.approx(0.9, abs=0.25)
    assert (follows[0].column, follows[0].power) == ("speed", 2.0)
    told = told_heat(late, 0, follows, time)
    assert told.rate == pytest.approx(0.03, rel=0.03)
    true = np.interp(told.time, time, 0.4 * column**2)
    assert np.mean(np.abs(told.heat - true) <= 1.96 * told.deviation) > 0.9


def test_a_rate_that_nothing_tells_is_told_with_its_whole_spread():
    """Readings that are all noise: every rate within the widest look is as likely, and the spread is not that of the first look."""
    time = np.linspace(0.0, 200.0, 101)
    reading = 20.0 + np.random.default_rng(3).normal(0.0, 0.05, 101)
    lump = Lump(time, reading, np.full(101, 0.05), np.full(101, 20.0))
    shape = np.sin(time / 20.0)[None]
    assert following_rate(lump, 0.03, 0.02, shape, time)[1] > 0.2


def test_compare_tells_the_heat_and_the_column_that_it_follows(tmp_path):
    written(tmp_path / "run.csv")
    told = tf.compare(tmp_path / "run.csv", inputs="speed,pump", unknown_heat=True)
    for record in told:
        follows = record.heat_follows
        assert [f["column"] for f in follows] == ["speed"]
        assert follows[0]["powers"][0] <= 2.0 <= follows[0]["powers"][1]
        assert follows[0]["correlation"] > 0.9
        assert "the unknown heat follows speed" in record.message
        assert "which the same readings gave" in record.message
        first = record.unknown_heat[0]
        assert set(first) == {"time_min", "heat_k_per_min", "lo_k_per_min", "hi_k_per_min"}
        assert first["lo_k_per_min"] < first["heat_k_per_min"] < first["hi_k_per_min"]
    assert tf.compare(tmp_path / "run.csv", inputs="speed,pump")[0].unknown_heat == []
    told.plot(tmp_path / "heat.svg")
    drawn = (tmp_path / "heat.svg").read_text()
    assert "heat needed" in drawn
    assert "speed" in drawn


@pytest.mark.proof
def test_an_effect_is_written_that_passes_the_check_and_removes_the_error(tmp_path):
    written(tmp_path / "run.csv", second=0.5)
    effect = tf.write_effect(tmp_path / "run.csv", tmp_path / "mine.py", inputs="speed,pump")
    assert effect.kind in {"HeatFollowsSpeedPump", "HeatFollowsPumpSpeed"}
    better = tf.improve(tmp_path / "run.csv", add=[effect.spec], inputs="speed,pump")
    steps = {(r.step, r.channel): r for r in better}
    for sensor in ("front", "rear"):
        assert steps[1, sensor].rmse_ahead_c < 0.35 * steps[0, sensor].rmse_ahead_c
    with pytest.raises(tf.UsageError, match="is there already"):
        tf.write_effect(tmp_path / "run.csv", tmp_path / "mine.py", inputs="speed,pump")


def test_a_column_whose_name_is_code_stays_text(tmp_path):
    name = 'speed² µ""); raise SystemExit  # \' [1/min]'
    run = tmp_path / 'run "\\N{x}""" .csv'
    written(run, speed=name.replace('"', '""'))
    effect = tf.write_effect(run, tmp_path / "mine.py", inputs=[name])
    assert effect.columns == (name,)
    assert tf.improve(run, add=[effect.spec], inputs=[name])[-1].status == "ok"


def test_the_command_writes_the_effect_and_says_how_to_add_it(tmp_path, tool):
    written(tmp_path / "run.csv")
    target = tmp_path / "mine.py"
    done = tool(
        "diagnose",
        str(tmp_path / "run.csv"),
        "--inputs",
        "speed",
        "--exclude",
        "pump",
        "--effects",
        "load_step",
        "--write-effect",
        str(target),
    )
    assert f"--add {target}:HeatFollowsSpeed" in done.err
    assert "p.power" in target.read_text()


def test_an_effect_is_not_written_without_a_column_or_a_reason(tmp_path):
    time = np.arange(0.0, 300.0)
    rng = np.random.default_rng(5)
    rise = 20.0 + 12.0 * -np.expm1(-0.02 * time) + 0.02 * rng.normal(size=300)
    data = {"time_min": time, "a": rise, "flow": rng.uniform(1.0, 2.0, 300)}
    with pytest.raises(tf.UsageError, match="needs a logged column"):
        tf.write_effect(tf.read({n: data[n] for n in ("time_min", "a")}), tmp_path / "a.py")
    assert tf.write_effect(tf.read(data, inputs="flow"), tmp_path / "a.py") is None
    assert not (tmp_path / "a.py").exists()
    with pytest.raises(tf.UsageError, match="one run"):
        tf.write_effect([tf.read(data, inputs="flow", name=n) for n in "ab"], tmp_path / "a.py")


def test_a_constant_column_is_followed_by_nothing(tmp_path):
    time = np.arange(0.0, 200.0)
    data = {"time_min": time, "a": 20.0 + 12.0 * -np.expm1(-0.02 * time), "flow": np.ones(200)}
    told = tf.compare(tf.read(data, inputs="flow"), unknown_heat=True)[0]
    assert told.heat_follows == []
    assert "follows no logged column" in told.message
    assert json.loads(json.dumps(told.as_dict()))["unknown_heat"]


def test_the_search_finds_a_load_that_grows_all_the_while_from_another_rate(tmp_path):
    """The base model takes such a record for a line without a rate; the cause shows from a rate that the record may show."""
    written(tmp_path / "run.csv")
    told = tf.diagnose(tmp_path / "run.csv", inputs="speed", exclude="pump")
    assert {r.verdict for r in told} == {"load_step"}
    assert told[0].parameters["load_step.power"]["value"] == pytest.approx(2.0, abs=0.2)
    assert told[0].rmse_ahead_c < 0.2 * told[0].rmse_base_ahead_c


@pytest.mark.parametrize("kind", ["switched", pytest.param("body", marks=pytest.mark.proof)])
def test_heat_beside_a_logged_power_is_told_in_watts(kind):
    told = np.array([power_trial(kind, seed) for seed in range(960_000, 960_003)])
    told = told[np.isfinite(told[:, 0])]
    assert len(told) >= 2
    held, _, capacity, resistance, _ = told.mean(axis=0)
    assert held > 0.9
    assert capacity + resistance >= 1.6
    _, wide, _, _, error = np.median(told, axis=0)
    assert error < 0.1
    if kind == "nothing":
        assert wide < 0.05


@pytest.mark.proof
def test_compare_tells_watts_and_the_capacity_that_any_other_heat_leaves():
    table, heat, capacity, _ = powered("switched", 960_004)
    table["power_kW"] = table.pop("power_w") / 1000.0
    run = tf.read(table)
    plain = tf.compare(run, drive="power_kW")[0]
    told = tf.compare(run, drive="power_kW", unknown_heat=True)[0]
    rows = pd.DataFrame(told.unknown_heat)
    true = np.interp(rows.time_min, table["time_min"], heat)
    assert np.mean((rows.lo_w <= true) & (true <= rows.hi_w)) > 0.9
    assert told.heat_capacity_lo_j_per_k < capacity < told.heat_capacity_hi_j_per_k
    # The fit alone takes the hidden heat for the power's.
    assert abs(told.heat_capacity_j_per_k / capacity - 1.0) < abs(plain.heat_capacity_j_per_k / capacity - 1.0)


def test_a_power_that_never_moves_tells_no_watts():
    time = np.linspace(0.0, 200.0, 201)
    reading = 20.0 - 10.0 * np.expm1(-time / 40.0) + 0.02 * np.random.default_rng(1).standard_normal(201)
    run = tf.read({"time_min": time, "T1": reading, "room": np.full(201, 20.0), "power_w": np.full(201, 50.0)}, ambient="room")
    told = tf.compare(run, drive="power_w", unknown_heat=True)[0]
    assert "heat_w" not in told.unknown_heat[0]
    assert "the power moves too little to tell how many watts" in told.message


@pytest.mark.proof
def test_when_a_power_jumped_between_two_readings_is_left_open():
    # Records that tell heat where there is none, with great confidence, where a jump is taken to lie half-way between readings.
    told = np.array([power_trial("nothing", seed) for seed in (981_021,)])
    assert told[:, 0].min() > 0.9
    assert told[:, 2].all()


@pytest.mark.proof
@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_column_that_is_held_between_its_readings_tells_the_heat_and_its_power(power):
    """As loggers write what a controller sets: the exact response of a lump to steps at the readings."""
    rng = np.random.default_rng(7)
    time, rate = np.arange(300.0), 0.0375
    speed = np.repeat(rng.choice([1000.0, 2000.0, 3000.0, 4000.0], 15), 20)
    heat = 1.5 * (speed / 4000.0) ** power
    reading = held_response(heat, rate)
    columns = {"time_min": time, "T1": reading + rng.normal(0.0, 0.02, 300), "speed_rpm": speed, "ambient": np.full(300, 20.0)}
    told = tf.compare(columns, unknown_heat=True, inputs=["speed_rpm"])[0]
    assert [(f["column"], f["power"], f["delay_min"]) for f in told.heat_follows] == [("speed_rpm", power, 0.0)]
    at = np.array([row["time_min"] for row in told.unknown_heat])
    low, high = (np.array([row[name] for row in told.unknown_heat]) for name in ("lo_k_per_min", "hi_k_per_min"))
    true = heat[np.minimum(np.floor(at + 1e-9).astype(int), 299)]
    away = np.abs(at - np.round(at / 20.0) * 20.0) > 1.0  # a knot at a jump lies on one of its sides
    assert np.mean((low <= true) & (true <= high), where=away) > 0.9
    assert np.mean(high - low) < 0.1 * heat.mean()


def test_a_column_that_is_on_or_off_has_no_power_and_noise_is_not_followed_beside_it(tmp_path):
    """Surroundings that do nothing but read with noise were claimed beside the pump, with a power of a half."""
    time = np.arange(0.0, 300.0, 1.0)
    rng = np.random.default_rng(8)
    pump = ((time // 37).astype(int) % 2).astype(float)
    assert {power for power, _ in shapes_of(pump, time, (0.0,))[1]} == {1.0}
    assert {power for power, _ in shapes_of(0.2 + pump * time, time, (0.0,))[1]} == set(POWERS)
    heat = 0.2 * (1.0 + 0.6 * pump)
    body = np.zeros(len(time))
    for k in range(1, len(time)):
        body[k] = body[k - 1] + (heat[k - 1] - body[k - 1] / 50.0)
    frame = pd.DataFrame({"time_min": time, "T1": 20.0 + body + 0.02 * rng.standard_normal(len(time)), "pump_on": pump})
    frame["ambient"] = 20.0 + 0.03 * rng.standard_normal(len(time))
    (told,) = tf.compare(frame, unknown_heat=True, ambient="ambient", inputs="pump_on")
    assert "follows pump_on" in told.message
    assert "pump_on^" not in told.message
    assert "and with it" not in told.message


def test_columns_are_told_by_what_each_gains_over_none():
    """Twice the log likelihood itself stood beside ratios: the column that the heat follows came last."""
    rng, time = np.random.default_rng(0), np.linspace(0.0, 240.0, 121)
    load, other = np.where((time // 40) % 2 == 0, 1.0, 0.2), np.sin(time / 17.0) + 2.0
    reading, rate = [20.0], 1.0 / 30.0
    for dt, heat in zip(np.diff(time), load[1:], strict=True):
        fall = np.exp(-rate * dt)
        reading.append(20.0 + (reading[-1] - 20.0) * fall + 0.8 * heat / rate * (1.0 - fall))
    noise = np.full(len(time), 0.02)
    lump = Lump(time, np.array(reading) + noise * rng.standard_normal(len(time)), noise, np.full(len(time), 20.0))
    found = followed_column([lump], [list(np.geomspace(0.5, 40.0, 19) / 240.0)], {"other": other, "load": load}, time)
    assert [f.column for f in found] == ["load", "other"]
    assert found[0].likelihood_ratio > 1000.0
    assert found[1].likelihood_ratio < 20.0


def test_one_step_is_the_cause_of_none_that_came_later():
    """A column that stepped half an hour before the heat did, once each: that says nothing; at the same minute it does."""
    time = np.linspace(0.0, 480.0, 481)
    heat = np.where(time < 180.0, 0.2, 0.35)
    rise = solve_ivp(lambda t, y: np.interp(t, time, heat) - 0.02 * y, (0.0, 480.0), [0.0], t_eval=time, max_step=0.5).y[0]
    lump = Lump(time, 20.0 + rise + np.random.default_rng(6).normal(0.0, 0.02, 481), np.full(481, 0.02), np.full(481, 20.0))
    for when, claimed in ((149.5, []), (180.0, ["flow"])):
        follows = probed([lump], [possible_rates(lump)], {"flow": np.where(time < when, 3.0, 5.0)}, time)[1]
        assert [f.column for f in follows] == claimed


def test_a_probes_lag_is_found_under_any_heat():
    """Constant heat, read twice a minute by a probe that is 0.8 min late; and by one that is not."""
    time = np.linspace(0.0, 200.0, 401)
    late = 12.0 * (1.0 - (np.exp(-time / 40.0) * 40.0 - np.exp(-time / 0.8) * 0.8) / (40.0 - 0.8))
    for rise, lag in ((late, 0.8), (12.0 * -np.expm1(-time / 40.0), 0.0)):
        noise = np.random.default_rng(8).normal(0.0, 0.01, 401)
        lump = Lump(time, 20.0 + rise + noise, np.full(401, 0.01), np.full(401, 20.0))
        (found,), follows = probed([lump], [possible_rates(lump)], {}, time)
        assert follows == []
        assert found.lag == pytest.approx(lag, abs=0.06)


@pytest.mark.proof
def test_a_column_that_is_not_all_of_the_heat_does_not_tell_the_rate():
    """Heat that follows a speed squared a quarter of an hour late, as no shape that is tried does: the band is wide, and holds."""
    time = np.linspace(0.0, 480.0, 481)
    speed = np.random.default_rng(12).uniform(0.4, 1.5, 13)[np.minimum((time // 40.0).astype(int), 12)]
    acting = lfilter([1.0 - np.exp(-1.0 / 15.0)], [1.0, -np.exp(-1.0 / 15.0)], speed**2)
    rise = solve_ivp(lambda t, y: 0.3 * np.interp(t, time, acting) - 0.025 * y, (0.0, 480.0), [0.0], t_eval=time, max_step=0.5).y[0]
    lump = Lump(time, 20.0 + rise + np.random.default_rng(9).normal(0.0, 0.02, 481), np.full(481, 0.02), np.full(481, 20.0))
    (late,), follows = probed([lump], [possible_rates(lump)], {"speed": speed}, time)
    assert 0.5 < follows[0].correlation < 0.9
    told = told_heat(late, 0, follows, time)
    true = np.interp(told.time, time, 0.3 * acting)
    assert np.mean(np.abs(told.heat - true) <= 1.96 * told.deviation) > 0.8
    assert np.median(told.deviation / true) > 0.1


@pytest.mark.proof
def test_a_rate_that_a_column_tells_is_known_to_two_per_cent_at_best():
    """However sharp the likelihood: a load that flutters moves it by as much. b (T - sink) of 0.3 K/min then errs by 0.006 at least."""
    time = np.linspace(0.0, 400.0, 801)
    speed = np.array([0.5, 1.0, 0.7, 0.9, 0.6])[np.minimum((time // 80.0).astype(int), 4)]
    rise = solve_ivp(lambda t, y: 0.4 * np.interp(t, time, speed) - 0.03 * y, (0.0, 400.0), [0.0], t_eval=time, max_step=0.25).y[0]
    lump = Lump(time, 20.0 + rise, np.full(801, 0.002), np.full(801, 20.0))
    (late,), follows = probed([lump], [possible_rates(lump)], {"speed": speed}, time)
    told = told_heat(late, 0, follows, time)
    assert told.deviation[40] >= 0.018 * 0.03 * np.interp(told.time[40], time, rise)
