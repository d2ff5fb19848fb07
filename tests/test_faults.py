"""Readings that are the logger's and not the machine's are left out, and said; those of fast machines and coarse loggers stay."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import thermofast as tf
from thermofast.reading.values.faults import false_first, held, without_faults, without_impossible

TIME = np.arange(361.0)
NOISE = 0.02 * np.random.default_rng(5).standard_normal(361)
LAW = 20.0 + 10.0 * (1.0 - np.exp(-TIME / 60.0))


def changed(at, to):
    readings = np.round(LAW + NOISE, 2)
    readings[at] = to
    return readings


@pytest.mark.parametrize(
    ("readings", "left"),
    [
        (changed([0], [85.0]), 1),
        (changed([0, 1], [85.0, 85.0]), 2),
        (changed([0, 1], [0.0, 0.0]), 2),
        (changed([0, 1], [-200.0, -200.0]), 2),
        (changed([0], [1372.0]), 1),
        (changed(slice(60, 70), -200.0), 10),
        (changed(slice(60, None), 1372.0), 301),
        (changed([50, 51], [850.0, 850.0]), 2),
        (changed([], []), 0),
        (LAW - 20.0, 0),  # a machine that begins at 0 degC
        (85.0 - (LAW - 20.0), 0),  # one that begins at 85
        (15.0 + 70.0 * np.exp(-TIME / 3.0), 0),
    ],
)
def test_a_code_is_none_where_readings_jump_from_it(readings, left):
    kept, count = without_impossible(readings)
    assert count == left
    assert np.isnan(kept).sum() == left


@pytest.mark.parametrize(
    ("readings", "left"),
    [
        (changed([0], [37.3]), 1),
        (changed([0, 1], [37.3, 33.1]), 2),
        (changed([0, 1, 2], [61.0, 60.0, 62.0]), 3),
        (changed([0], [4.2]), 1),  # far below, and the rest goes on slowly over less
        (changed([0], [19.0]), 0),
        (changed([], []), 0),
        (20.0 + 30.0 * (1.0 - np.exp(-TIME / 0.4)) + NOISE, 0),  # a machine that is quicker than its logger
        (20.0 + 30.0 * (1.0 - np.exp(-TIME / 1.5)) + NOISE, 0),
        (20.0 + 4.0 * (1.0 - np.exp(-TIME / 0.3)) + 6.0 * (1.0 - np.exp(-TIME / 60.0)) + NOISE, 0),  # quick, then slow
        (np.interp(TIME, [0.0, 1.0, 2.0, 3.0, 360.0], [14.3, 11.9, 7.5, 4.0, 6.0]) + NOISE, 0),  # a probe put into water
    ],
)
def test_first_readings_far_from_all_others_are_none(readings, left):
    assert false_first([readings]).tolist() == [left]
    kept, said = without_faults({"T": readings}, ["T"])
    assert np.isnan(kept["T"]).sum() == left
    assert ("left out" in said.get("T", "")) is bool(left)


def test_a_false_first_reading_behind_a_missing_one_is_found():
    assert false_first([np.append(np.nan, changed([0], [37.3])[:-1])]).tolist() == [2]


@pytest.mark.parametrize("length", [3, 10])
def test_a_value_that_is_held_counts_once(length):
    readings = (LAW + NOISE)[np.arange(361) // length * length]
    assert held([readings]) == [length]
    kept, said = without_faults({"T": readings}, ["T"])
    at = np.flatnonzero(np.isfinite(kept["T"]))
    assert (at % length == 0).all()
    assert len(at) >= 361 // length - 1
    assert f"held for {length} readings" in said["T"]


@pytest.mark.parametrize("readings", [np.round(LAW, 1), np.round(20.0 + 0.01 * TIME, 1), np.round(LAW), LAW + NOISE])
def test_coarse_readings_are_not_held(readings):
    assert held([readings]) == [1]


def test_a_probe_that_was_not_ready_changes_no_number_of_any_command():
    """Two readings of 37 degC made a limit of 23.1 degC, ok, of one of 30; thermofast watch stopped at 8 min."""
    clean = tf.identify({"time_min": TIME[2:] - 2.0, "T": changed([], [])[2:]}, until=90)[0]
    false = tf.identify({"time_min": TIME, "T": changed([0, 1], [37.3, 37.4])}, until=92)[0]
    assert false.steady_state_c == pytest.approx(clean.steady_state_c, abs=0.05)
    assert "the first 2 readings (37.3, 37.4 degC) are far from all others and left out" in false.message
    assert tf.diagnose({"time_min": TIME, "T": changed([0], [85.0])})[0].verdict == "none"


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 400.0), st.floats(-60.0, 60.0), st.floats(0.0, 0.5))
def test_no_reading_of_a_machine_is_left_out(seed, tau, rise, noise):
    rng = np.random.default_rng(seed)
    readings = 20.0 + rise * (1.0 - np.exp(-TIME / tau)) + noise * rng.standard_normal(361)
    kept, said = without_faults({"T": readings}, ["T"])
    assert not said
    assert kept["T"] is readings
