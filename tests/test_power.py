"""--drive with a power in watts: heat capacity and resistance to the surroundings, against scipy's ODE solver."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from thermofast.analysis.power import watts


def driven(seed, name="power_w", unit=1.0, count=300):
    """(run, heat capacity [J/K], resistance [K/W]) of one lump under a power in three steps."""
    rng = np.random.default_rng(seed)
    capacity, resistance = rng.uniform(300.0, 3000.0), rng.uniform(0.05, 0.5)
    tau = capacity * resistance / 60.0
    time = np.linspace(0.0, tau * rng.uniform(1.5, 5.0), count)
    power = np.array([100.0, 180.0, 60.0])[np.searchsorted(np.sort(rng.uniform(0.2, 0.9, 2)) * time[-1], time)]

    def law(t, y):
        return 60.0 * (np.interp(t, time, power) - (y - 21.0) / resistance) / capacity

    curve = solve_ivp(law, (0.0, time[-1]), [21.0], t_eval=time, max_step=time[-1] / 900.0).y[0]
    reading = curve + 0.05 * rng.standard_normal(count)
    data = {"time_min": time, "body": reading, name: power / unit, "room": 21.0 + 0.01 * rng.standard_normal(count)}
    return tf.read(data, inputs=name, ambient="room"), capacity, resistance


def test_intervals_of_capacity_and_resistance_hold_the_truth():
    held = []
    for seed in range(30):
        run, capacity, resistance = driven(seed)
        told = tf.compare(run, drive="power_w")[0]
        held.append(told.heat_capacity_lo_j_per_k < capacity < told.heat_capacity_hi_j_per_k)
        held.append(told.resistance_lo_k_per_w < resistance < told.resistance_hi_k_per_w)
        assert told.heat_capacity_j_per_k == pytest.approx(capacity, rel=0.02)
        assert told.resistance_k_per_w == pytest.approx(resistance, rel=0.02)
    assert np.mean(held) >= 0.85


def test_kilowatts_are_a_thousand_watts_and_other_columns_are_no_power():
    run, capacity, _ = driven(1, "heater [kW]", 1000.0)
    told = tf.compare(run, drive="heater [kW]")[0]
    assert told.heat_capacity_j_per_k == pytest.approx(capacity, rel=0.02)
    assert "J/K" in told.message
    run, _, _ = driven(1, "duty")
    assert tf.compare(run, drive="duty")[0].heat_capacity_j_per_k is None
    assert [watts(n) for n in ("power_w", "P [kW]", "W", "flow", "kw", "power")] == [1.0, 1000.0, 1.0, None, 1000.0, None]
