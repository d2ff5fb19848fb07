"""What is made of one sensor before a filter sees it, and what a complete record itself shows."""

import numpy as np
import pytest
from simulator import lump, spindle

from thermofast.estimation.measured import measured_equilibrium
from thermofast.estimation.sensor import prepare, rise_start, run_start, saturated
from thermofast.models.noise.spikes import logger_step


def test_the_loggers_step_is_seen_where_there_is_one():
    rng = np.random.default_rng(0)
    noise = 20 + rng.standard_normal(300)
    assert logger_step(np.round(noise, 2)) == pytest.approx(0.01)
    assert logger_step(np.round(noise * 20) / 20) == pytest.approx(0.05)
    assert logger_step(np.round(noise)) == pytest.approx(1.0)
    assert logger_step(noise) == 0.0
    assert logger_step(np.full(9, 3.0)) == 0.0


def test_a_saturated_stretch_is_left_out_and_a_settled_one_is_not():
    rng = np.random.default_rng(1)
    time, y = spindle(rng, 120.0)
    clipped = np.minimum(y, 23.0)
    sensor = prepare(time, np.round(clipped, 2), 0.0)
    assert "stuck at 23 degC" in sensor.notes[0]
    assert sensor.reading.max() <= 23.0
    assert not prepare(time, np.round(y, 2), 0.0).notes
    slow = np.round(lump(np.arange(400.0), 0.05, 8.0, 18.0) + 0.002 * rng.standard_normal(400), 1)
    assert not saturated(slow, 0.1).any()


def test_the_start_of_a_rise_is_found_only_where_the_record_was_still():
    rng = np.random.default_rng(2)
    time = np.arange(200.0)
    moving = lump(time, 0.015, 9.0, 18.0) + 0.02 * rng.standard_normal(200)
    assert rise_start(time, moving) == 0.0
    waiting = np.concatenate([np.full(30, 18.0), lump(np.arange(170.0), 0.015, 9.0, 18.0)]) + 0.02 * rng.standard_normal(200)
    assert rise_start(time, waiting) == pytest.approx(29.5, abs=1.5)
    assert rise_start(time, 18 + 0.02 * rng.standard_normal(200)) is None
    assert run_start(time, [waiting, moving]) == 0.0
    assert run_start(time, [waiting, 18 + 0.02 * rng.standard_normal(200)]) == pytest.approx(29.5, abs=1.5)
    fast = np.arange(3600) / 60
    slow = lump(fast, 0.01536, 8.8, 17.9) + 0.02 * rng.standard_normal(3600)
    assert rise_start(fast, slow) == 0.0


def test_a_complete_record_shows_its_own_equilibrium_and_an_incomplete_one_does_not():
    time, y = spindle(np.random.default_rng(3), 400.0)
    steady, t95 = measured_equilibrium(time, y)
    assert steady == pytest.approx(26.7, abs=0.04)
    assert t95 == pytest.approx(195.0, abs=5.0)
    assert measured_equilibrium(time[:200], y[:200]) is None
    assert measured_equilibrium(time[:20], y[:20]) is None
    flat = 20 + 0.02 * np.random.default_rng(4).standard_normal(100)
    assert measured_equilibrium(np.arange(100.0), flat) is None


def test_what_lies_before_the_start_is_not_used():
    time = np.arange(60.0)
    sensor = prepare(time, np.where(time < 20.0, 99.0, 20.0 + 0.1 * time), 20.0)
    assert sensor.time[0] == 20.0
    assert len(sensor.time) == 40
    assert sensor.reading.max() < 30.0


def test_whole_degrees_that_settle_after_a_load_step_are_not_stuck():
    """The rise quickens with the load and then slows down before it stands still: a range that ends does not."""
    time = np.arange(420.0)
    rise = 27.0 * -np.expm1(-time / 30.0) + 10.0 * -np.expm1(-np.maximum(time - 140.0, 0.0) / 30.0)
    assert not saturated(np.round(20.0 + rise), 1.0).any()
    clipped = np.minimum(20.0 + 60.0 * -np.expm1(-time / 200.0), 60.0)
    assert saturated(np.round(clipped), 1.0).sum() > 100


def test_a_start_is_where_it_is_whatever_comes_later():
    """Ten minutes of idling were not seen in a record of twelve hours, of which two hours showed them."""
    found = []
    for length in (60.0, 240.0, 1440.0):
        time = np.arange(0.0, length)
        noise = 0.02 * np.random.default_rng(5).standard_normal(1440)[: len(time)]
        found.append(rise_start(time, 21.0 - 30.0 * np.expm1(-np.maximum(time - 10.0, 0.0) / 60.0) + noise))
    assert found == [10.0, 10.0, 10.0]
    off = []
    for seed in range(12):  # a rise that noise hides for minutes
        time = np.arange(0.0, 240.0, 0.25)
        slow = 21.0 - 2.0 * np.expm1(-np.maximum(time - 10.0, 0.0) / 60.0)
        off.append(rise_start(time, slow + 0.03 * np.random.default_rng(seed).standard_normal(len(time))) - 10.0)
    assert np.abs(off).max() < 2.0
    assert np.sqrt(np.mean(np.square(off))) < 0.8


def test_a_range_that_ends_is_seen_after_a_quick_beginning_too():
    """A part that is warm within a minute is half of the way to the end of the range: the rest of it went on without slowing."""
    time = np.arange(400.0)
    y = 18.0 + 9.0 * -np.expm1(-time / 0.8) + 26.0 * -np.expm1(-time / 60.0)
    clipped = np.minimum(np.round(y, 1), 40.0)
    assert np.array_equal(saturated(clipped, 0.1), clipped == 40.0)
    assert not saturated(np.round(y, 1), 0.1).any()
