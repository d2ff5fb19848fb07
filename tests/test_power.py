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
