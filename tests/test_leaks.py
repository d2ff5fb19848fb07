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


@pytest.mark.parametrize("power", [20.0, 0.0, pytest.param(1.6, marks=pytest.mark.proof)])
def test_a_drive_after_the_identification_time_moves_nothing(power):
    drives = {"drive": "P [kW]", "until": UNTIL}
    alone, as_is, other = (predicted(tf.identify(run, **drives)) for run in (cut(record()), record(), record(power)))
    half = 0.5 * (alone[:, 2] - alone[:, 1])
    np.testing.assert_allclose(other, as_is, rtol=1e-6)
    assert np.abs(other[:, :3] - alone[:, :3]).max() < 0.02 * half.min()
    np.testing.assert_allclose(other[:, 3:5], alone[:, 3:5], rtol=1e-4)
    fits = [[r.rmse_fit_c for r in tf.compare(run, **drives)] for run in (cut(record()), record(power))]
    np.testing.assert_allclose(fits[1], fits[0], rtol=1e-9)


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


LATER = {
    "as it was": lambda room, rng: room,
    "five kelvin warmer": lambda room, rng: room + 5.0,
    "a walk": lambda room, rng: room + np.cumsum(0.3 * rng.standard_normal(len(room))),
}


def in_a_room_that_moves(later, rng, drifting):
    """A body that follows a logged power in a room that is logged, until then; afterwards the room is another."""
    minutes = np.arange(241.0)
    room = 20.0 + (0.8 * np.sin(2.0 * np.pi * minutes / 90.0) if drifting else 0.0 * minutes)
    power = np.where(minutes < 70.0, 1.5, 3.0)
    body, reading = 20.0, []
    for k in range(len(minutes)):
        reading.append(body)
        body += (room[k] + 10.0 * power[k] / 3.0 - body) / 50.0
    logged = room + 0.005 * np.random.default_rng(7).standard_normal(len(minutes))
    logged[minutes > UNTIL] = LATER[later](logged[minutes > UNTIL], rng)
    noise = 0.02 * np.random.default_rng(8).standard_normal(len(minutes))
    return {"time_min": minutes, "T1 [°C]": np.array(reading) + noise, "ambient [°C]": logged, "P [kW]": power}


@pytest.mark.parametrize("later", [name if name == "a walk" else pytest.param(name, marks=pytest.mark.proof) for name in LATER])
@pytest.mark.parametrize("how", [{"drive": "P [kW]"}, {"auto": True}, {"model": True}], ids=lambda how: next(iter(how)))
def test_a_room_after_the_identification_time_moves_nothing(later, how):
    run = in_a_room_that_moves(later, np.random.default_rng(9), drifting="model" in how)
    if "model" in how:
        learnt = in_a_room_that_moves("as it was", None, drifting=True)
        how = {"model": tf.improve(learnt, add="ambient", drive="P [kW]").model}
    alone, other = (predicted(tf.identify(one, until=UNTIL, **how)) for one in (cut(run), run))
    assert np.isfinite(alone[:, :3]).all()
    half = 0.5 * (alone[:, 2] - alone[:, 1])
    assert np.abs(other[:, :3] - alone[:, :3]).max() < 0.03 * half.min()
    np.testing.assert_allclose(other[:, 3:5], alone[:, 3:5], rtol=1e-3)


def test_the_least_time_of_a_sensor_is_its_own_side_of_the_limit():
    """Mirrored records, and those with a sensor that falls, have the same times."""
    minutes, rng = np.arange(221.0), np.random.default_rng(3)
    noise = 0.02 * rng.standard_normal((5, len(minutes)))
    sizes = zip(((48.0, 8.0), (55.0, 10.0), (65.0, 12.0), (75.0, 14.0)), noise, strict=False)
    warm = {f"T{i}": 20.0 - rise * np.expm1(-minutes / tau) + e for i, ((tau, rise), e) in enumerate(sizes)}
    falls = {"falls": 30.0 + 6.0 * np.expm1(-minutes / 60.0) + noise[4]}
    found = [
        [row.t95_lo_min for row in tf.identify({"time_min": minutes, **run}, rates="own")][:4]
        for run in (warm, {n: 40.0 - c for n, c in warm.items()}, {**warm, **falls})
    ]
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=2e-3)
