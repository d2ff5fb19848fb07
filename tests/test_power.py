"""--drive with a power in watts: heat capacity and resistance to the surroundings, against scipy's ODE solver."""

import numpy as np
import pytest

import thermofast as tf
from benchmarks.analysis.thermal_constants import driven, held
from thermofast.analysis.power import watts


@pytest.mark.proof
def test_intervals_of_capacity_and_resistance_hold_the_truth():
    assert np.mean([held(seed) for seed in range(30)]) >= 0.85
    for seed in range(5):
        run, capacity, resistance = driven(seed)
        told = tf.compare(run, drive="power_w")[0]
        assert told.heat_capacity_j_per_k == pytest.approx(capacity, rel=0.02)
        assert told.resistance_k_per_w == pytest.approx(resistance, rel=0.02)


def test_a_larger_power_after_what_is_fitted_changes_no_capacity():
    """A heat is relative to the largest that was logged until --until, and so are the watts that it is."""
    time, capacity, resistance = np.arange(0.0, 241.0), 8000.0, 0.08
    power = np.where(time < 40.0, 60.0, np.where(time < 120.0, 100.0, 180.0))
    power[30:35] = 30.0
    here, out = 20.0, []
    for watt in power:
        out.append(here)
        here += 60.0 / capacity * (watt - (here - 20.0) / resistance)
    reading = np.array(out) + 0.01 * np.random.default_rng(0).standard_normal(len(time))
    run = tf.read({"time_min": time, "T": reading, "power_w": np.concatenate([[0.0], power[:-1]])})
    for until in (100.0, None):
        told = tf.compare(run, drive="power_w", until=until)[0]
        assert told.heat_capacity_j_per_k == pytest.approx(capacity, rel=0.08)
        assert told.resistance_k_per_w == pytest.approx(resistance, rel=0.08)


def test_kilowatts_are_a_thousand_watts_and_other_columns_are_no_power():
    run, capacity, _ = driven(1, "heater [kW]", 1000.0)
    told = tf.compare(run, drive="heater [kW]")[0]
    assert told.heat_capacity_j_per_k == pytest.approx(capacity, rel=0.02)
    assert "J/K" in told.message
    run, _, _ = driven(1, "duty")
    assert tf.compare(run, drive="duty")[0].heat_capacity_j_per_k is None
    assert [watts(n) for n in ("power_w", "P [kW]", "W", "flow", "kw", "power")] == [1.0, 1000.0, 1.0, None, 1000.0, None]


def test_intervals_count_a_misfit():
    """A slow wave of the readings that no model has: errors of a few per cent, where white noise would say a few in ten thousand."""
    held = []
    for seed in range(8):
        run, capacity, _ = driven(seed)
        minutes = run.time_s / 60.0
        wave = 0.6 * np.sin(2.0 * np.pi * 2.3 * minutes / minutes[-1] + seed)
        data = {"time_min": minutes, "body": run.channels["body"] + wave, "power_w": run.inputs["power_w"]}
        told = tf.compare(tf.read(data | {"room": run.ambient["room"]}, inputs="power_w", ambient="room"), drive="power_w")[0]
        assert told.status == "model_doubtful"
        held.append(told.heat_capacity_lo_j_per_k < capacity < told.heat_capacity_hi_j_per_k)
        assert told.heat_capacity_hi_j_per_k < 1.3 * told.heat_capacity_lo_j_per_k
    assert sum(held) >= 7


def test_heat_capacity_beside_a_hidden_mass_is_right_where_the_power_jumps_several_times(tmp_path):
    """When in its interval a logged jump came is told by readings so near that a mass which the base law lacks has no time to show."""
    step, hold, pattern = 0.02, 60.0, (150.0, 60.0, 200.0, 0.0, 120.0)
    body = hidden = 0.0
    rows, rng = [], np.random.default_rng(11)
    for k in range(int(300.0 / step) + 1):
        minute = k * step
        power = pattern[min(int((minute + 1e-9) // hold), 4)]
        if k % 50 == 0:
            rows.append((minute, 20.0 + body + 0.03 * rng.standard_normal(), 20.0, power))
        flow = 8.0 * (body - hidden)
        body, hidden = body + step * 60.0 * (power - body / 0.25 - flow) / 8000.0, hidden + step * 60.0 * flow / 15000.0
    path = tmp_path / "run.csv"
    path.write_text("time_min,T1,ambient,power_W\n" + "\n".join(",".join(f"{v:.3f}" for v in row) for row in rows) + "\n")
    told = tf.compare(tf.read(path), drive="power_W", effects=("second_mode",))[0]
    assert told.heat_capacity_lo_j_per_k - 20.0 <= 8000.0 <= told.heat_capacity_hi_j_per_k + 20.0
    assert told.heat_capacity_j_per_k == pytest.approx(8000.0, rel=0.01)
