"""A machine that idled before the rise: minutes or days of it change no number, told with --start or found."""

from dataclasses import asdict

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation.sensor import rise_start

MINUTES = np.arange(0.0, 60.0, 0.25)
RNG = np.random.default_rng(1)
RISES = {
    f"T{k} [°C]": (start, start + rise * -np.expm1(-MINUTES / tau) + 0.02 * RNG.standard_normal(len(MINUTES)))
    for k, (start, rise, tau) in enumerate([(20.0, 40.0, 10.0), (22.0, 30.0, 15.0)])
}


def past(seed):
    """The same machine on another day."""
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(MINUTES))
    return tf.read({"time_min": MINUTES} | {n: reading + noise for n, (_, reading) in RISES.items()}, name=f"day {seed}")


def record(idle):
    """Minutes at rest, then the rise."""
    before = np.arange(0.0, idle, 0.25)
    noise = 0.02 * np.random.default_rng(2).standard_normal(len(before))
    return {"time_min": np.concatenate([before, MINUTES + idle])} | {
        name: np.concatenate([start + noise, reading]) for name, (start, reading) in RISES.items()
    }


def numbers(rows, start=0.0):
    """What rows say, times of events counted from the start."""
    told = {(k, n): v for k, row in enumerate(rows) for n, v in asdict(row).items() if n not in ("start_min", "until_min")}
    for (_, name), found in told.items():
        for one in found if name == "ranking" else ():
            for what, parameter in one["parameters"].items():
                if what.endswith(".event"):  # of which six figures are told
                    parameter["value"] = round(parameter["value"] - start, 1)
    return told


CALLS = {
    "identify": lambda run, late: tf.identify(run, until=15.0 + late, start=late),
    "identify at": lambda run, late: tf.identify(run, until=40.0 + late, start=late, at=55.0),
    "identify all": lambda run, late: tf.identify(run, start=late),
    "compare": lambda run, late: tf.compare(run, until=20.0 + late, start=late),
    "diagnose": lambda run, late: tf.diagnose(run, until=30.0 + late, start=late),
    "sensitivity": lambda run, late: tf.sensitivity(run, until=30.0 + late, start=late),
}


def test_idle_time_changes_nothing_of_what_a_model_says():
    """Early, that the machine is taken to be as it was."""
    model = tf.improve([past(5), past(6)], together=True).model
    at_once, after_days = (numbers(tf.identify(record(idle), until=8.0 + idle, start=idle, model=model)) for idle in (0.0, 3000.0))
    assert "taken to be as it was" in at_once[0, "message"]
    for key, value in at_once.items():
        assert after_days[key] == (pytest.approx(value, rel=1e-6) if isinstance(value, float) else value), key


@pytest.mark.parametrize("call", CALLS)
def test_idle_time_before_the_start_changes_no_number(call):
    at_once, after_days = (numbers(CALLS[call](record(idle), idle), idle) for idle in (0.0, 3000.0))
    assert at_once.keys() == after_days.keys()
    for key, value in at_once.items():
        if isinstance(value, float):
            assert after_days[key] == pytest.approx(value, rel=1e-6, abs=1e-9, nan_ok=True), key
        else:
            assert after_days[key] == value, key


def test_a_picture_begins_where_the_rise_does():
    for idle in (0.0, 3000.0):
        curves = tf.identify(record(idle), until=59.75 + idle, start=idle, details=True).curves[0]
        since = curves.model_time - idle
        assert since[0] == 0.0
        assert since[-1] == pytest.approx(59.75, abs=0.5)
        assert np.abs(curves.model - (60.0 - 40.0 * np.exp(-since / 10.0))).max() < 0.1


@pytest.mark.parametrize("idle", [20, 60, 120, 240, 360])
@pytest.mark.parametrize("tau", [3.0, 8.0, 20.0, 60.0])
def test_a_rise_is_found_after_any_idle_time(idle, tau):
    time = np.arange(0.0, idle + 600.0, 0.5)
    since = np.maximum(time - idle, 0.0)
    reading = 20.0 - 40.0 * np.expm1(-since / tau) + 0.02 * np.random.default_rng(0).standard_normal(len(time))
    assert rise_start(time, reading) == pytest.approx(idle, abs=max(2.0, 0.015 * idle))


def test_a_rise_of_minutes_at_the_end_of_hours():
    time = np.arange(0.0, 460.0, 0.25)
    reading = np.round(20.0 - 40.0 * np.expm1(-np.maximum(time - 400.0, 0.0) / 10.0), 1)
    assert rise_start(time, reading) == pytest.approx(400.0, abs=4.0)
    row = tf.identify({"time_min": time, "T1 [°C]": reading}, start=0.0, until=415.0)[0]
    assert row.status != "ok"
    assert "covariance" not in row.message
    weak = 20.0 + 0.02 * np.random.default_rng(3).standard_normal(len(time)) + 0.1 * (time > 420.0)
    assert rise_start(time, weak) in (0.0, None)  # a third of the readings would have to be left
