"""With --start times are still told on the clock of the run, as --until is said."""

from dataclasses import replace

import numpy as np
import pytest

import thermofast as tf
from thermofast.discovery.stretches import steps_near
from thermofast.discovery.wording import _worst
from thermofast.models.search.discover import discover
from thermofast.observing.observe import observe

STEP, IDLE = 150.0, 60.0


def machine(seed=2, load=True):
    """Three sensors that stand still for an hour, and rise by 60 % more from 150 min on."""
    time, rng = np.arange(0.0, 300.0), np.random.default_rng(seed)
    columns = {"time_min": time}
    for k, (rate, rise) in enumerate(((0.03, 8.0), (0.02, 10.0), (0.015, 6.0))):
        first = rise * -np.expm1(-rate * np.maximum(time - IDLE, 0.0))
        second = 0.6 * rise * -np.expm1(-rate * np.maximum(time - STEP, 0.0)) if load else 0.0
        columns[f"T{k + 1} [degC]"] = 20.0 + first + second + rng.normal(0.0, 0.02, len(time))
    return columns


@pytest.fixture(scope="module")
def run():
    return tf.read(machine())


def test_an_event_is_told_on_the_clock_of_the_run(run):
    (row, *_) = tf.diagnose(run, start=IDLE)
    assert row.verdict == "load_step"
    assert row.event_min == pytest.approx(STEP, abs=2.0)
    assert row.parameters["load_step.event"]["value"] == pytest.approx(STEP, abs=2.0)
    assert f"event {row.event_min:.1f}" in row.message


def test_where_a_model_fails_is_told_on_the_clock_of_the_run(run):
    rows = tf.compare(run, start=IDLE, until=120.0)
    for row in rows:
        assert STEP - 2.0 <= row.worst_from_min <= STEP + 15.0
        assert row.worst_to_min == pytest.approx(299.0)
        assert all(part["from_min"] >= IDLE for part in row.failing)
    assert "from about 15" in rows[0].message
    assert "all sensors leave the model together" in rows[0].message


def test_unknown_heat_and_pictures_are_on_the_clock_of_the_run(run):
    compared = tf.compare(run, start=IDLE, unknown_heat=True, until=120.0, details=True)
    assert compared[0].unknown_heat[0]["time_min"] == pytest.approx(IDLE)
    assert compared[0].unknown_heat[-1]["time_min"] == pytest.approx(299.0)
    panel = compared.panels[0]
    assert (panel.time[0], panel.time[-1], panel.until) == (IDLE, 299.0, 120.0)


def test_words_about_logged_steps_are_on_it(run):
    seen = observe(replace(run, inputs={"fan": np.where(run.time_s < 60.0 * STEP, 1.0, 0.0)}), IDLE).seen
    assert (seen.start_min, seen.time[0], seen.clock[0]) == (IDLE, 0.0, IDLE)
    assert steps_near(seen, STEP) == [f"fan steps from 1 to 0 at {STEP:g} min"]


def test_where_a_base_model_fails_most_and_readings_without_noise_are_on_it(run):
    seen = observe(run, IDLE).seen
    begin, end, _ = _worst(discover(seen, []), seen)
    assert IDLE <= begin < STEP < end <= 299.0
    clean = tf.compare(machine(load=False), start=IDLE, denoise=True).denoised[0]
    assert (clean.time[0], clean.time[-1]) == (IDLE, 299.0)
