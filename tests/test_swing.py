"""A heat or cooling that swings all the time: its periodic part is found, taken out and told, and nothing else is taken for one."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation.measured import steadied
from thermofast.estimation.sensor import Sensors
from thermofast.models.swing import _own_period, later_swing, swing_of

TIME = np.arange(0.0, 120.0, 0.5)
LAW = 20.0 + 15.0 * (1.0 - np.exp(-TIME / 60.0))


def _swung(period: float = 11.0, size: float = 1.0) -> np.ndarray:
    turn = (TIME / period) % 1.0
    return size * (np.where(turn < 0.3, turn / 0.3, (1.0 - turn) / 0.7) - 0.5)


def _readings(part: np.ndarray, noise: float = 0.02, seed: int = 4) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([LAW + part, 20.0 + 0.5 * (LAW - 20.0) + 0.4 * part]) + noise * rng.standard_normal((2, len(TIME)))


def test_the_period_and_the_periodic_part_are_found() -> None:
    found = swing_of(TIME, _readings(_swung()), np.zeros(2))
    assert found is not None
    assert found.period == pytest.approx(11.0, rel=3e-3)
    assert found.swings.all()
    assert np.sqrt(np.mean((found.at(TIME)[0] - _swung() + _swung().mean()) ** 2)) < 0.03
    low, high = found.ends()
    assert high[0] - low[0] == pytest.approx(1.0, abs=0.1)


def test_a_sensor_that_does_not_swing_is_left_as_it_is() -> None:
    reading = _readings(_swung())
    reading[1] = 20.0 + 0.5 * (LAW - 20.0) + 0.02 * np.random.default_rng(9).standard_normal(len(TIME))
    found = swing_of(TIME, reading, np.zeros(2))
    assert found is not None
    assert found.swings.tolist() == [True, False]
    assert not found.at(TIME)[1].any()


def _settling(begun: float) -> np.ndarray:
    return np.where(begun < TIME, -np.expm1(-np.maximum(TIME - begun, 0.0) / 8.0), 0.0)


@pytest.mark.parametrize("what", ["nothing", "one step", "two steps", "there and back", "a walk", "a slow wave"])
def test_what_happens_own_period_is_no_swing(what: str) -> None:
    rng = np.random.default_rng(3)
    part = {
        "nothing": 0.0 * TIME,
        "one step": 3.0 * np.where(TIME > 50.0, -np.expm1(-(TIME - 50.0) / 20.0), 0.0),
        "two steps": 2.0 * ((TIME > 30.0) & (TIME < 70.0)),
        "there and back": 3.0 * (_settling(44.0) - _settling(64.0)),
        "a walk": 0.2 * np.cumsum(rng.standard_normal(len(TIME))),
        "a slow wave": np.sin(2.0 * np.pi * TIME / 50.0),
    }[what]
    assert swing_of(TIME, _readings(part), np.zeros(2)) is None


def test_a_logger_that_rounds_swings_no_machine() -> None:
    assert swing_of(TIME, np.round(_readings(0.0 * TIME) / 0.5) * 0.5, np.full(2, 0.5)) is None


def test_readings_on_hand_are_cleared_and_those_ahead_foretold_with_it() -> None:
    """The limit is the mean over a cycle, the row is no doubt, and a temperature at a named time counts the swing."""
    turn = (TIME / 11.0) % 1.0
    drive, here, out = np.where(turn < 0.4, 2.5, 0.0), 0.0, []
    for heat in drive:
        out.append(here)
        here += 0.5 / 60.0 * (15.0 * heat - here)
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(TIME))
    table = {"time_min": TIME, "spindle": 20.0 + np.array(out) + noise}
    row = tf.identify(table, until=70.0, at=90.0)[0]
    assert row.status == "ok"
    assert "period of 11 min: temperatures are means over its cycle" in row.message
    assert row.steady_state_lo_c < 35.0 < row.steady_state_hi_c
    assert row.steady_state_hi_c - row.steady_state_lo_c < 12.0
    assert row.at_lo_c < 20.0 + out[180] < row.at_hi_c
    assert row.at_hi_c - row.at_lo_c > 0.5 * np.ptp(np.array(out)[-40:])
    bare = tf.identify(table, until=70.0, imperfection="none")[0]
    assert "cycle" not in bare.message


def test_a_logged_room_that_swings_alike_explains_it() -> None:
    reading = _readings(_swung())
    table = {"time_min": TIME, "front": reading[0], "rear": reading[1], "ambient": 20.0 + _swung()}
    assert all("means over its cycle" not in r.message for r in tf.identify(table))
    calm = table | {"ambient": 20.0 + 0.01 * np.random.default_rng(2).standard_normal(len(TIME))}
    assert all("means over its cycle" in r.message for r in tf.identify(calm))


def test_pictures_show_the_readings_as_they_were_logged_and_what_hides_in_noise_is_not_told() -> None:
    reading = np.concatenate([_readings(_swung()), _readings(0.03 * _swung())[:1]])
    sensors = Sensors(np.arange(3), TIME, reading, np.zeros(3), ((),) * 3)
    found = steadied(sensors, None, 50, None)
    for i in range(3):
        np.testing.assert_allclose(found.measured(i), reading[i], atol=1e-12)
    assert np.abs(found.reading[0] - LAW).max() < 0.25 < np.abs(reading[0] - LAW).max()
    assert [len(n) for n in found.notes] == [1, 1, 0]
    assert steadied(Sensors(np.arange(1), TIME, reading[2:], np.zeros(1), ((),)), None, 50, None).swung is None


def test_a_swing_that_begins_later_is_told_and_left_where_it_is() -> None:
    """A thermostat that comes to its limit before the middle of the record: nothing is taken out, and the rows say what goes on."""
    late = np.where(0.45 * TIME[-1] < TIME, _swung(), 0.0)
    found = later_swing(TIME, _readings(late), np.zeros(2))
    assert found is not None
    assert found.start == pytest.approx(0.5 * TIME[-1], abs=1.0)
    assert later_swing(TIME, _readings(0.0 * late), np.zeros(2)) is None
    table = {"time_min": TIME} | dict(zip(("front", "rear"), _readings(late), strict=True))
    said = f"with a period of {found.period:.3g} min from {found.start:.3g} min on at the latest"
    assert all(said in r.message and "means over its cycle" not in r.message for r in tf.identify(table))
    sensors = Sensors(np.arange(2), TIME, _readings(late), np.zeros(2), ((),) * 2)
    assert steadied(sensors, None, 50, None).swung is None
    assert any(said in r.message for r in tf.diagnose(table, effects=["second_mode"]))


def test_a_multiple_of_a_period_is_told_as_the_period() -> None:
    """Five minutes, read each minute, are found as twenty of which every fourth harmonic stands: it is the same swing."""
    size = 0.01 * np.ones((2, 14))
    size[:, [3, 10]] = [[0.6, -0.8], [0.3, 0.1]]
    cycles, own = _own_period(20.0, size)
    assert cycles == 80.0
    np.testing.assert_array_equal(own, size[:, [3, 10]])
    both = size.copy()
    both[:, 1] = 0.5  # another harmonic that is no multiple: the longer period is its own
    assert _own_period(20.0, both)[0] == 40.0
    both[:, 2] = 0.5
    assert _own_period(20.0, both)[0] == 20.0
