"""Rules that a reader changed and no test that he tried told: each by its own numbers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import thermofast as tf
from thermofast.analysis.power import watts
from thermofast.discovery.stretches import failing_stretches, steps_near
from thermofast.estimation.closing import settling
from thermofast.estimation.measured import comes_back
from thermofast.estimation.verdicts import _wide_words
from thermofast.learning.jumps import last_level, longest_stay
from thermofast.models.core.tails import f_tail
from thermofast.models.standards.settled import Passing
from thermofast.records import IdentifyRecord
from thermofast.standards.stopping import _beyond, in_words, reckoned_from_three
from thermofast.standards.switching_off import _rises, with_switch_off


def test_three_points_of_an_exponential_tell_its_limit():
    """First, middle, last, in that order, warming and cooling; on uneven readings by the line between."""
    time = np.linspace(5.0, 65.0, 61)
    warms = 20.0 + 8.0 * -np.expm1(-(time - 5.0) / 30.0)
    assert reckoned_from_three(time, np.stack([warms, 60.0 - warms])) == pytest.approx([28.0, 32.0], abs=1e-9)


def test_far_chances_are_those_of_the_tail_that_intervals_have():
    """Normal inside an interval, Student's beyond it, where they are larger."""
    assert _beyond(1.5) == pytest.approx(0.5 * math.erfc(1.5 / math.sqrt(2.0)))
    for far in (2.5, 4.0):
        assert _beyond(far) > 1.05 * 0.5 * math.erfc(far / math.sqrt(2.0))
        assert _beyond(-far) == pytest.approx(1.0 - _beyond(far))
    assert _beyond(4.0) < 0.5 * float(f_tail(1, 2, 16.0))


def test_a_rule_holds_where_it_tripped_within_what_was_read_counted_from_the_start():
    """50 min after a start at 20 min is beyond 60 min."""
    given = {"criterion": "2K/h", "trip_last": True, "trip_min": 50.0, "trip_from": "prediction", "until_min": 60.0}
    later, within = (IdentifyRecord("run", "a", "afukf", start_min=start, **given) for start in (20.0, 5.0))
    assert "will hold" in in_words([later])[0]
    assert "will hold" not in in_words([within])[0]


def test_readings_rise_after_a_switch_off_by_far_more_than_their_noise():
    rng = np.random.default_rng(1)
    noise = 0.05 * rng.standard_normal(60)
    barely = 30.0 + np.linspace(0.0, 0.2, 60) + noise
    assert np.median(barely[-6:]) > np.median(barely[:6])
    assert not _rises(barely)
    assert _rises(30.0 + np.linspace(0.0, 2.0, 60) + noise)


def test_a_first_reading_later_than_the_readings_last_tells_no_temperature_at_switch_off():
    time = np.arange(10.0, 19.0)
    run = tf.read({"time_min": np.concatenate([[0.0], time]), "a degC": np.concatenate([[60.0], 50.0 - 0.5 * (time - 10.0)])})
    record = with_switch_off(IdentifyRecord("run", "a degC", "afukf"), run, 0.5, None)
    assert record.switch_off_c is None
    assert "comes longer after the switch-off than the readings last" in record.message


@pytest.mark.parametrize(("column", "unit"), [("P [kW]", 1e3), ("P [KW]", 1e3), ("power_W", 1.0), ("P (w)", 1.0), ("speed", None)])
def test_watts_of_a_columns_name(column, unit):
    assert watts(column) == unit


def test_nothing_is_left_of_a_rise_whose_last_readings_are_there():
    passing = Passing(np.arange(20.0), np.full(20, 9.9), 3, 0.01, False)
    assert passing._left(10.0) == 0.0
    assert passing._left(20.0) == pytest.approx(math.log(10.1))


def test_a_staircases_last_step_counts_and_one_that_turns_tells_of_no_stay():
    time = np.arange(100.0)
    climbs = np.select([time < 40, time < 80, time < 96], [0.0, 1.0, 2.0], 3.0)
    assert last_level(time, climbs, 70.0) == 3.0
    assert longest_stay(time, climbs) == 40.0
    turns = np.select([time < 40, time < 70], [0.0, 1.0], 0.0)
    assert longest_stay(time, turns) == math.inf


def test_steps_of_a_column_near_a_stretch():
    """A few of them, up to three readings after it begins; one that jumps all the time steps nowhere."""
    time = np.arange(200.0)
    column = np.select([time < 50, time < 100, time < 150], [0.0, 1.0, 0.0], 1.0)
    run = SimpleNamespace(inputs={"fan": column}, ambient={}, time=time, clock=time, span=199.0, step=1.0)
    assert steps_near(run, 98.0) == ["fan steps from 1 to 0 at 100 min"]
    assert steps_near(run, 96.0) == []
    restless = SimpleNamespace(**{**vars(run), "inputs": {"fan": (time // 5) % 2}})
    assert steps_near(restless, 100.0) == []


def test_a_stretch_within_what_a_model_does_not_know_is_no_failure():
    time, rng = np.arange(200.0), np.random.default_rng(2)
    residual = np.where(time > 120.0, 0.3, 0.0) + 0.02 * rng.standard_normal(200)
    [found] = failing_stretches(time, residual, np.ones(200), 0.02)
    assert found[0] == pytest.approx(121.0, abs=3.0)
    assert found[1:] == (pytest.approx(199.0), pytest.approx(0.3, abs=0.02))
    assert (
        failing_stretches(time, residual, np.ones(200), 0.02, np.full(200, 0.5)) == []
    )  # by the band, and where it is trimmed to it


def test_readings_came_back_where_they_went_farther_than_noise():
    assert "measure longer" in _wide_words(3.0, 0.1, 0.3, 0.05)
    assert "came back" in _wide_words(3.0, 0.1, 0.6, 0.05)
    assert "measure longer" in _wide_words(3.0, 0.4, 0.6, 0.05)


def test_what_hardly_left_its_beginning_does_not_come_back_to_it():
    """By twenty deviations of its noise."""
    law = SimpleNamespace(time=9.0, initial=np.full(2, 20.0), weights=np.ones((2, 10)), noise=np.array([0.1, 0.01]))
    reading = 20.0 + np.stack([np.sin(np.linspace(0.0, math.pi, 10))] * 2)
    sensors = SimpleNamespace(time=np.arange(10.0), reading=reading, resolution=np.zeros(2))
    assert comes_back(law, np.full(2, 20.0), sensors).tolist() == [False, True]


def test_an_interval_of_a_settling_time_holds_its_middle():
    """Where the limit comes near the beginning the times bend so that the middle of the draws is not the estimate."""
    spread = 0.0014915043706202973
    covariance = np.diag([1e-3, 1e-5, spread**2])
    covariance[0, 2] = covariance[2, 0] = -0.49643928661843856 * spread * math.sqrt(1e-3)
    middle, sides = settling(
        np.array([25.0, -0.04127327740551617, 0.008223610249569765]), covariance, 78.72160572576159, 20.0, 1.96
    )
    assert middle > 900.0
    assert sides.low < middle
    assert sides.high >= middle
