"""Readings that a logger averages over the last few: seen, told, and counted as the few that they are."""

import numpy as np
import pytest
from scipy.signal import lfilter
from simulator import held_response, lump

import thermofast as tf
from thermofast.models import averaging_window


def bodies(seed, window, count=421, sensors=3, noise=0.03):
    """(time, rows (S, N), limits (S,)): exact bodies whose noise is a moving average, rounded to 0.1 mK."""
    rng = np.random.default_rng(seed)
    time = np.arange(float(count))
    rows, limits = [], []
    for _ in range(sensors):
        tau, rise = rng.uniform(40.0, 80.0), rng.uniform(5.0, 12.0)
        blurred = np.convolve(noise * rng.standard_normal(count + window - 1), np.ones(window) / window, "valid")
        rows.append(np.round(lump(time, 1.0 / tau, rise, 17.9) + blurred, 4))
        limits.append(17.9 + rise)
    return time, np.array(rows), np.array(limits)


def averaged(seed, window):
    return bodies(seed, window)[:2]


def as_run(time, rows):
    return tf.read({"time_min": time, **{f"T{k + 1}": row for k, row in enumerate(rows)}})


@pytest.mark.parametrize("window", [2, 5, 11, 30])
def test_the_window_is_found_from_the_readings_alone(window):
    found = [averaging_window(*averaged(seed, window)) for seed in range(5)]
    assert found.count(window) >= 4
    assert set(found) <= {1, window}


def test_white_or_smoothed_noise_is_no_moving_average():
    rng = np.random.default_rng(7)
    wrong = 0
    for k in range(150):
        time = np.arange(float(rng.choice([60, 120, 421])))
        noise, memory = rng.standard_normal((3, len(time) + 60)), rng.uniform(0.0, 0.95)
        for _ in range(k % 3):  # white, smoothed exponentially once, twice
            noise = lfilter([1.0 - memory], [1.0, -memory], noise, axis=1)
        wrong += averaging_window(time, 300.0 * (1.0 - np.exp(-time / 60.0)) + noise[:, 60:]) > 1
    assert wrong <= 1


@pytest.mark.parametrize("window", [5, 11])
def test_averaged_readings_of_an_exact_body_need_no_effect_and_their_noise_is_right(window):
    told = tf.diagnose(as_run(*averaged(3, window))).to_frame()
    assert set(told["verdict"]) == {"none"}
    assert told["noise_c"].mean() == pytest.approx(0.03 / np.sqrt(window), rel=0.5)
    assert told["message"].str.contains(f"average over the last {window}").all()


def test_the_interval_counts_that_averages_are_few_readings():
    time, rows, limits = bodies(3, 5)
    told = tf.identify(as_run(time, rows), until=150).to_frame()
    assert told["message"].str.contains("average over the last 5").all()
    assert (told["steady_state_lo_c"] < limits).all()
    assert (limits < told["steady_state_hi_c"]).all()
    assert (told["status"] == "ok").all()


def test_a_heat_that_cycles_is_no_moving_average():
    rng = np.random.default_rng(0)
    wrong = 0
    for _ in range(60):
        time = np.arange(0.0, 240.25, 0.5)
        on = 1.0 - rng.uniform(0.1, 1.0) * ((time / rng.uniform(4.0, 60.0)) % 1.0 > rng.uniform(0.2, 0.8))
        curve = held_response(100.0 / 40.0 * on, 1.0 / 40.0, 0.5)
        rows = np.array([curve * (1.0 + 0.1 * k) + 0.02 * rng.standard_normal(len(time)) for k in range(2)])
        wrong += averaging_window(time, rows) > 1
    assert wrong <= 1


@pytest.mark.parametrize(("period", "seed"), [(9, 2), (15, 1), (21, 1)])
def test_a_load_that_is_switched_in_odd_periods_is_no_average(period, seed):
    """Its half periods are a reading longer and shorter by turns, so that nothing is alike after exactly two of them."""
    time, rng = np.arange(240.0), np.random.default_rng(seed)
    heat = 10.0 * (1.0 + 0.6 * np.sign(np.sin(2.0 * np.pi * time / period + 0.1)))
    reading = np.zeros((3, 240))
    for k in range(1, 240):
        reading[:, k] = reading[:, k - 1] + (heat[k] - reading[:, k - 1]) / np.array([60.0, 80.0, 50.0])
    assert averaging_window(time, reading + 0.02 * rng.standard_normal(reading.shape)) == 1


def test_readings_must_be_even_whole_and_at_least_48():
    """Spaced evenly to 2 %; of the first sensors and last readings only so many are looked at."""
    time, rows = averaged(1, 5)
    assert averaging_window(time, rows) == 5
    assert averaging_window(time + 0.004 * (-1.0) ** np.arange(421), rows) == 5  # gaps of 0.992 and 1.008
    assert averaging_window(time + 0.006 * (-1.0) ** np.arange(421), rows) == 1  # 0.988 and 1.012
    spoilt = rows.copy()
    spoilt[0, 200] = np.nan
    assert averaging_window(time, spoilt) == 1
    many = np.concatenate([rows] * 5)  # 15 sensors
    assert averaging_window(time[-48:], many[:, -48:]) == 5
    assert averaging_window(time[-47:], many[:, -47:]) == 1
