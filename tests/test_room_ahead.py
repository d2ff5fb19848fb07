"""A room that is logged, and what it may do until a named time."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation.measured import until_then
from thermofast.models.uncertainty.surroundings import room_ahead

TIME = np.arange(0.0, 120.5, 0.5)
AT_ONCE = np.array([np.inf])


def test_a_room_that_stays_is_known_to_stay() -> None:
    room = 20.0 + np.random.default_rng(1).normal(0.0, 0.02, len(TIME))
    mean, deviation = room_ahead(TIME, room, AT_ONCE, 410.0)
    assert abs(mean[0]) < 0.05
    assert 1.96 * deviation[0] < 0.3


def test_a_drift_is_carried_on_in_part_and_the_rest_is_inside() -> None:
    mean, deviation = room_ahead(TIME, 20.0 + 0.5 * TIME / 60.0, AT_ONCE, 410.0)
    went_on = 0.5 * 290.0 / 60.0
    assert 0.2 * went_on < mean[0] < went_on
    assert abs(went_on - mean[0]) < 1.96 * deviation[0]
    assert abs(mean[0]) < 1.96 * deviation[0]


def test_sensors_follow_late() -> None:
    """Of a mean path drawn straight the answer of a lump is the convolution with its exponential, by quadrature."""
    room = 20.0 + 0.5 * TIME / 60.0
    rate, until = 1.0 / 60.0, 240.0
    ahead = np.linspace(120.0, until, 25)
    path = [0.0, *(float(room_ahead(TIME, room, AT_ONCE, t)[0][0]) for t in ahead[1:])]
    fine = np.linspace(120.0, until, 20001)
    drive = np.interp(fine, ahead, path) * rate * np.exp(-rate * (until - fine))
    assert room_ahead(TIME, room, np.array([rate]), until)[0][0] == pytest.approx(np.trapezoid(drive, fine), rel=0.02)


@pytest.mark.proof
def test_the_interval_holds_what_rooms_of_a_memory_do() -> None:
    """Of 200 rooms that wander about a mean with a memory of 60 min, 1 K: 95 % within four deviations of that share."""
    rng, kept, missed = np.random.default_rng(5), np.exp(-0.5 / 60.0), []
    for _ in range(200):
        room = np.empty(681)
        room[0] = rng.standard_normal()
        for k in range(1, len(room)):
            room[k] = kept * room[k - 1] + np.sqrt(1.0 - kept**2) * rng.standard_normal()
        mean, deviation = room_ahead(TIME, 20.0 + room[: len(TIME)], AT_ONCE, 340.0)
        missed.append((room[680] - room[240] - mean[0]) / deviation[0])
    assert np.sum(np.abs(missed) < 1.96) >= 178
    assert 0.85 < np.sqrt(np.mean(np.square(missed))) < 1.15


def test_a_temperature_at_a_named_time_moves_with_the_room_and_doubts_how_far() -> None:
    """The mean is added, and the doubts of the room and of how much of it a sensor follows are those of independent errors."""
    room, rate = 20.0 + 0.5 * TIME / 60.0, np.array([1.0 / 60.0, np.nan])
    at = np.array([[28.0, 30.0, 31.0], [28.0, 30.0, 31.0]])
    found, said = until_then(at, TIME, room, rate, 410.0, 0.3)
    mean, deviation = (v[0] for v in room_ahead(TIME, room, rate[:1], 410.0))
    doubt = 1.96 * np.hypot(deviation, 0.3 * mean)
    assert mean > 0.3
    assert found[0] == pytest.approx([30.0 + mean - np.hypot(2.0, doubt), 30.0 + mean, 30.0 + mean + np.hypot(1.0, doubt)])
    assert len(said) == 1


def test_the_past_alone_moves_nothing() -> None:
    for when, room, until in ((TIME, 20.0 + 0.0 * TIME, 100.0), (TIME[:4], 20.0 + 0.0 * TIME[:4], 410.0)):
        mean, deviation = room_ahead(when, room, AT_ONCE, until)
        assert (mean[0], deviation[0]) == (0.0, 0.0)


def test_identify_counts_it_at_a_named_time_and_not_in_the_limit() -> None:
    rng = np.random.default_rng(7)
    rise = 35.0 - 15.0 * np.exp(-TIME / 40.0)
    room = np.round(20.0 + rng.normal(0.0, 0.02, len(TIME)) + 1.5 * np.sin(2 * np.pi * TIME / 400.0), 2)
    still = {"time_min": TIME, "T": rise + rng.normal(0.0, 0.02, len(TIME)), "ambient": np.round(20.0 + 0.01 * (TIME % 1), 2)}
    fall = np.exp(-0.5 / 40.0)
    late = np.zeros(len(TIME))
    for k in range(1, len(TIME)):
        late[k] = fall * late[k - 1] + (1.0 - fall) * (room[k] - 20.0)
    moving = {**still, "T": still["T"] + late, "ambient": room}
    quiet, moved = (next(iter(tf.identify(tf.read(columns, name="run"), at=300.0))) for columns in (still, moving))
    assert quiet.at_hi_c - quiet.at_lo_c < 0.5
    assert moved.at_hi_c - moved.at_lo_c > 3.0 * (moved.steady_state_hi_c - moved.steady_state_lo_c)
    assert "the room as logged may move by" in moved.message
    assert "the room as logged" not in quiet.message
