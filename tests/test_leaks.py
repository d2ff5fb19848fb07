"""Nothing that comes after the identification time moves a prediction: it only judges it."""

import numpy as np
import pytest

import thermofast as tf

MINUTES = np.arange(400.0)
UNTIL = 150.0
PREDICTED = ("steady_state_c", "steady_state_lo_c", "steady_state_hi_c", "rate_per_min", "t95_min", "reading_half_width_c")


def record(power=None):
    """Three sensors that follow a logged power, 1 kW and from 120 min on 1.6 kW, in a room that is logged."""
    rng = np.random.default_rng(3)
    heat = np.where(MINUTES < 120.0, 1.0, np.where(MINUTES < 250.0, 1.6, 0.8))
    columns = {"time_min": MINUTES}
    for i, rate in enumerate((0.02, 0.015, 0.018)):
        rise = np.zeros(len(MINUTES))
        for k in range(1, len(rise)):
            rise[k] = rise[k - 1] + rate * (8.0 * heat[k - 1] - rise[k - 1])
        columns[f"T{i + 1} [°C]"] = np.round(20.0 + rise + rng.normal(0.0, 0.02, len(rise)), 2)
    columns["ambient"] = np.round(20.0 + rng.normal(0.0, 0.02, len(MINUTES)), 2)
    columns["P [kW]"] = heat if power is None else np.where(MINUTES > UNTIL, power, heat)
    return columns


def cut(run, end=UNTIL):
    return {name: column[run["time_min"] <= end] for name, column in run.items()}


def predicted(rows):
    return np.array([[getattr(row, name) for name in PREDICTED] for row in rows], dtype=float)


@pytest.mark.parametrize("power", [20.0, 0.0, 1.6])
def test_a_drive_after_the_identification_time_moves_nothing(power):
    drives = {"drive": "P [kW]", "until": UNTIL}
    alone, as_is, other = (predicted(tf.identify(run, **drives)) for run in (cut(record()), record(), record(power)))
    half = 0.5 * (alone[:, 2] - alone[:, 1])
    np.testing.assert_allclose(other, as_is, rtol=1e-6)
    assert np.abs(other[:, :3] - alone[:, :3]).max() < 0.2 * half.min()  # the mean of the room is that of the record
    np.testing.assert_allclose(other[:, 3:5], alone[:, 3:5], rtol=3e-3)
    fits = [[r.rmse_fit_c for r in tf.compare(run, **drives)] for run in (cut(record()), record(power))]
    np.testing.assert_allclose(fits[1], fits[0], rtol=1e-3)


def test_a_drive_that_changes_later_only_is_not_counted():
    for run in (record(), cut(record(), 110.0)):
        rows = tf.identify(run, until=100.0, drive="P [kW]")
        assert all("P [kW] never changes before 100 min, and it is not counted" in row.message for row in rows)


def test_a_gap_of_the_room_is_not_filled_with_what_it_does_later():
    gap = record()
    gap["ambient"][(MINUTES > 130.0) & (MINUTES <= UNTIL)] = np.nan
    later = {**gap, "ambient": np.where(MINUTES > UNTIL, gap["ambient"] + 5.0, gap["ambient"])}
    alone, other = (predicted(tf.identify(run, until=UNTIL)) for run in (cut(gap), later))
    np.testing.assert_allclose(other, alone, rtol=1e-5)


def test_a_room_logged_now_and_then_is_used_and_one_that_is_not_logged_says_so():
    now_and_then = record()
    now_and_then["ambient"][np.arange(400) % 5 != 0] = np.nan
    for row, often in zip(
        tf.identify(now_and_then, until=60.0, room=20.0), tf.identify(record(), until=60.0, room=20.0), strict=True
    ):
        assert row.room_steady_c == pytest.approx(often.room_steady_c, abs=0.05)
        assert "surroundings" not in row.message
    died = record()
    died["ambient"][MINUTES > 150.0] = np.nan
    np.testing.assert_array_equal(predicted(tf.identify(died, until=100.0)), predicted(tf.identify(record(), until=100.0)))
    died["ambient"][MINUTES > 50.0] = np.nan
    assert all("are logged for too little of the time used" in row.message for row in tf.identify(died, until=100.0))
