"""--drive with a power in watts: heat capacity and resistance to the surroundings, against scipy's ODE solver."""

import numpy as np
import pytest

import thermofast as tf
from benchmarks.thermal_constants import driven, held
from thermofast.analysis.power import watts


def test_intervals_of_capacity_and_resistance_hold_the_truth():
    assert np.mean([held(seed) for seed in range(30)]) >= 0.85
    for seed in range(5):
        run, capacity, resistance = driven(seed)
        told = tf.compare(run, drive="power_w")[0]
        assert told.heat_capacity_j_per_k == pytest.approx(capacity, rel=0.02)
        assert told.resistance_k_per_w == pytest.approx(resistance, rel=0.02)


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
