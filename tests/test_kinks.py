"""A heat or a cooling that changed while a machine was read, and no column says so."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation import verdicts
from thermofast.estimation.measured import stepped
from thermofast.estimation.rules import RULES
from thermofast.models.uncertainty.kinks import FEWEST, SENSORS, kink, moved_most

TAU = np.array([12.0, 25.0, 60.0])


def read(rng, minutes=90.0, at=None, size=-0.25, noise=0.02, every=0.5):
    """Three sensors that each follow the heat at a rate of their own, with a quick part; from `at` on the heat is another."""
    time = np.arange(0.0, minutes, every)
    rise = np.array([10.0, 8.0, 6.0])[:, None]

    def risen(since):
        return 0.8 * (1.0 - np.exp(-since / TAU[:, None])) + 0.2 * (1.0 - np.exp(-since / 4.0))

    reading = (
        20.0
        + rise * risen(time)
        + (0.0 if at is None else rise * size * np.where(time > at, risen(np.maximum(time - at, 0.0)), 0.0))
    )
    return time, reading + noise * rng.standard_normal(reading.shape)


def test_a_kink_is_where_the_heat_changed():
    """To two blocks of 120; half the change makes half the share."""
    time, reading = read(np.random.default_rng(1), at=41.0)
    found = kink(time, reading)
    assert found.minutes == pytest.approx(41.0, abs=2.0)
    assert found.gain > 100.0
    assert 0.1 < found.share < 0.4
    less = kink(*read(np.random.default_rng(1), at=41.0, size=-0.125))
    assert less.share == pytest.approx(0.5 * found.share, rel=0.35)


def test_machines_of_many_parts_have_none():
    """Of three rates and a quick part under a heat that stays: 200 runs, at most three of which pass by chance."""
    found = [kink(*read(np.random.default_rng([2, k]))) for k in range(200)]
    assert sum(f.gain > RULES.kinked and f.share > RULES.kinked_share for f in found) <= 3
    assert max(f.gain for f in found) < 2.0 * RULES.kinked


def test_one_sensor_alone_makes_no_kink_of_three():
    time, reading = read(np.random.default_rng(3))
    reading[1, time > 40.0] += 3.0
    assert kink(time, reading).gain < RULES.kinked
    assert kink(time, reading[:2]).gain < RULES.kinked
    assert kink(time, reading[1:2]) is None  # of one it cannot be told


def test_few_readings_have_none_and_of_many_sensors_those_that_moved_count():
    time, reading = read(np.random.default_rng(4), at=41.0)
    assert kink(time[: FEWEST - 1], reading[:, : FEWEST - 1]) is None
    assert kink(time[:FEWEST], reading[:, :FEWEST]) is not None
    assert kink(time[:0], reading[:, :0]) is None
    still = 20.0 + 0.02 * np.random.default_rng(5).standard_normal((40, len(time)))
    many = np.concatenate([still, np.repeat(reading, SENSORS // 3 + 1, axis=0)[:SENSORS]])
    many[45, -2:] = np.nan  # of which not all is known
    assert len(moved_most(many)) == SENSORS
    assert {*range(40, 40 + SENSORS)} - {*moved_most(many).tolist()} == {45}
    assert kink(time, many[[i for i in moved_most(many) if i >= 40]]).minutes == pytest.approx(41.0, abs=2.0)
    assert moved_most(reading).tolist() == [0, 1, 2]


def test_a_change_is_fresh_open_or_behind_by_the_time_constants_since():
    """It came 49 min ago: within half a time constant of 200 min, behind one of 20; outliers and gaps are bridged."""
    time, reading = read(np.random.default_rng(6), at=41.0)
    reading[0, 30], reading[1, 50:60] = 90.0, np.nan
    told = stepped(time, reading, np.zeros(3), np.array([1 / 200.0, 1 / 60.0, 1 / 20.0]))
    assert [told[i][0] for i in range(3)] == [True, False, False]
    early = stepped(*read(np.random.default_rng(6), minutes=180.0, at=41.0), np.zeros(3), np.array([1 / 100.0, 1 / 60.0, np.inf]))
    assert list(early) == [0]  # behind: three times as long as what came before, and more than two time constants
    assert "all points turn at about 4" in told[0][1]
    assert "measure on" in told[0][1]
    assert "--auto looks for it" in told[1][1]
    assert stepped(*read(np.random.default_rng(7)), np.zeros(3), np.full(3, 1 / 60.0)) == {}


@pytest.mark.parametrize(("logged", "told"), [(False, True), (True, False)])
def test_a_row_says_so_unless_a_column_does(logged, told):
    time, reading = read(np.random.default_rng(8), at=41.0)
    power = {"power [W]": np.where(time > 41.0, 75.0, 100.0)} if logged else {}
    rows = tf.identify(tf.read({"time_min": time} | {f"T{i} [degC]": row for i, row in enumerate(reading)} | power)).records
    assert any("all points turn at about 4" in r.message for r in rows) == told


def test_just_after_a_change_no_row_is_ok():
    time, reading = read(np.random.default_rng(9), minutes=50.0, at=41.0, size=-0.4, noise=0.005)
    rows = tf.identify({"time_min": time} | {f"T{i}": row for i, row in enumerate(reading)}).records
    slow = rows[2]
    assert slow.status != "ok"
    assert "all points turn at about 4" in slow.message


def test_what_a_kink_has_done_is_told_by_the_sensors_that_have_it():
    """One that does not move has moved by nothing, of which any noise is a large share."""
    time, reading = read(np.random.default_rng(10), at=41.0)
    still = 20.0 + 0.02 * np.random.default_rng(11).standard_normal((1, len(time)))
    assert kink(time, np.concatenate([reading, still])).share == pytest.approx(kink(time, reading).share, rel=0.25)


def test_a_change_of_little_is_not_told_however_clear_it_is():
    time, reading = read(np.random.default_rng(12), at=41.0, size=-0.04, noise=0.001)
    found = kink(time, reading)
    assert found.gain > RULES.kinked
    assert found.share < RULES.kinked_share
    assert stepped(time, reading, np.zeros(3), np.full(3, 1 / 60.0)) == {}


def test_a_change_that_is_fresh_doubts_a_row_and_averaged_readings_are_not_asked(monkeypatch):
    """Three sensors that are ok, of which the second is said to have just changed; a logger that averages makes kinks of its own."""
    asked = []

    def told(time, reading, resolution, rate):
        asked.append(rate)
        return {1: (True, "all points turn"), 2: (False, "all points turn")}

    monkeypatch.setattr(verdicts, "stepped", told)
    time, reading = read(np.random.default_rng(13), minutes=120.0)
    rows = tf.identify({"time_min": time} | {f"T{i}": row for i, row in enumerate(reading)}).records
    assert [(r.status, "all points turn" in r.message) for r in rows] == [("ok", False), ("model_doubtful", True), ("ok", True)]
    assert np.isfinite(asked[0]).all()
    averaged = np.array(
        [
            np.convolve(row, np.ones(10) / 10.0, "valid")
            for row in reading + 0.2 * np.random.default_rng(14).standard_normal(reading.shape)
        ]
    )
    tf.identify({"time_min": time[: averaged.shape[1]]} | {f"T{i}": row for i, row in enumerate(averaged)})
    assert np.isinf(asked[1]).all()
