"""Past runs that ended before the machine had settled: what their own readings leave open of its end, the past does."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.models.imperfection import FAST_MODES, SLOW_MODES, TYPICAL, Part, Past, SensorShape, ends_alone
from thermofast.models.imperfection.machine.past import _deviations
from thermofast.models.imperfection.machine.rest import _latest, left_open

FAST, SLOW, SHARE = 20.0, 160.0, 0.35


def _run(minutes, seed, load=1.0):
    """A spindle before a column that is eight times slower and brings a third of the rise of 12 K."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, minutes + 0.5)
    rise = 12.0 * load * ((1.0 - SHARE) * -np.expm1(-time / FAST) + SHARE * -np.expm1(-time / SLOW))
    return {"time_min": time, "T1": 20.0 + rise + rng.normal(0.0, 0.02, len(time))}


def _learnt(minutes):
    runs = [tf.read(_run(minutes, seed, load), name=f"past {seed}") for seed, load in ((1, 0.95), (2, 1.04))]
    return tf.improve(runs, together=True).model


def _t95():
    time = np.arange(0.0, 2000.0)
    left = (1.0 - SHARE) * np.exp(-time / FAST) + SHARE * np.exp(-time / SLOW)
    return float(time[left > 0.05][-1])


@pytest.mark.parametrize("minutes", [80.0, 160.0, 320.0])
def test_what_past_runs_had_not_come_to_is_left_open(minutes):
    """Of half, one and two time constants of the column: limits 32.0 degC were told 0.7 K low at 0.4 K, and t95 a third of it."""
    model = _learnt(minutes)
    record = tf.identify(_run(60.0, 3), model=model)[0]
    assert record.status == "ok"
    assert record.steady_state_lo_c < 32.0 < record.steady_state_hi_c
    assert record.t95_lo_min < _t95() < record.t95_hi_min
    assert "what it was learnt from may have ended early: by the readings alone it may go on by up to" in record.message
    shape = model.file.past.shapes[0]
    assert shape.rest[1] > 0.05
    assert shape.rest[3] > _t95() * shape.rate_per_min


def test_complete_runs_leave_nothing_open_and_their_model_is_read_back(tmp_path):
    """Of seven time constants of a machine without a column; rest stands in no file then."""
    time = np.arange(0.0, 281.0)
    runs = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        runs.append(
            tf.read({"time_min": time, "T1": 20.0 - 12.0 * np.expm1(-time / 40.0) + rng.normal(0.0, 0.02, 281)}, name=f"{seed}")
        )
    model = tf.improve(runs, together=True).model
    assert model.file.past.shapes[0].rest == ()
    unfinished = _learnt(160.0)
    unfinished.save(tmp_path / "m.toml")
    again = tf.Model.load(tmp_path / "m.toml")
    assert again.file.past.shapes[0].rest == unfinished.file.past.shapes[0].rest
    assert (
        tf.identify(_run(60.0, 3), model=again)[0].steady_state_hi_c
        == tf.identify(_run(60.0, 3), model=unfinished)[0].steady_state_hi_c
    )


def test_a_model_file_with_a_rest_of_another_length_is_refused(tmp_path):
    """Five numbers, or none."""
    path = tmp_path / "m.toml"
    _learnt(160.0).save(path)
    text = path.read_text()
    at = text.index("rest = [")
    path.write_text(text[:at] + "rest = [0.1, 0.2]" + text[text.index("]", at) + 1 :])
    record = tf.identify(_run(60.0, 3), model=tf.Model.load(path))[0]
    assert record.status == "unreadable"
    assert "[past] is of another version" in record.message


def test_a_run_longer_than_those_of_the_past_is_told_by_its_own_readings():
    """Nothing is left open that the readings at hand have shown since."""
    model = _learnt(80.0)
    short, long = (tf.identify(_run(640.0, 3), until=until, model=model)[0] for until in (60.0, 600.0))
    assert short.steady_state_hi_c > 33.0
    assert 32.0 < long.steady_state_hi_c < 32.7


def test_a_run_of_one_exponential_is_bounded_by_its_own_end():
    """At one time constant: 63 % of the way, and at least 1.4 times as far to go; 95 % after 3 time constants."""
    time, tau = np.arange(0.0, 101.0), 100.0
    reading = 20.0 - 10.0 * np.expm1(-time / tau)
    part = Part(time, reading[None], np.array([0.02]), np.array([0.0]))
    low, high, soonest, latest = ends_alone([part], np.array([-np.log(tau)]), TYPICAL)[0]
    assert low < 1.0 / -np.expm1(-1.0) < high
    assert soonest < 300.0 < latest
    came = np.exp(-0.5) - np.exp(-1.0)
    reached = -np.expm1(-1.0)
    assert _latest(100.0, came / reached, 1.0 / reached) == pytest.approx(tau * np.log(20.0), rel=1e-6)
    assert _latest(100.0, 0.0, 1.04) == 0.0
    assert _latest(100.0, 0.0, 2.0) == pytest.approx(100.0 * (1.0 + 0.5 * np.log(10.0) / 0.1))


def _part(time, rise, noise=0.02):
    return Part(time, 20.0 + np.random.default_rng(0).normal(0.0, noise, (1, len(time))) + rise, np.array([noise]), np.array([0.0]))


def test_the_farther_the_limit_may_be_the_later_it_is_come_to():
    """A third of the rise thirty times as slow, one and a half of its time constants read: the estimate alone said 674 min."""
    time = np.arange(0.0, 901.0)
    rise = 12.0 * (0.65 * -np.expm1(-time / FAST) + 0.35 * -np.expm1(-time / 600.0))
    low, high, soonest, latest = ends_alone([_part(time, rise)], np.array([-np.log(FAST)]), TYPICAL)[0]
    assert low < 12.0 / rise[-1] < high
    assert soonest < 600.0 * np.log(0.35 / 0.05) < latest


def test_what_hardly_moved_and_a_shorter_run_say_nothing_of_the_end():
    """The air beside a machine; a run of half the length of another."""
    time = np.arange(0.0, 81.0)
    moved, still = ends_alone(
        [_part(time, -9.0 * np.expm1(-time / 30.0)), _part(time, 0.0 * time)], np.log([1 / 30, 1 / 30]), TYPICAL
    )
    assert np.isfinite(moved).all()
    assert np.isnan(still).all()
    none = np.zeros(len(SLOW_MODES) + len(FAST_MODES) + 1)
    long, short = np.array([1.0, 1.5, 50.0, 90.0]), np.array([1.0, 4.0, 50.0, 200.0])
    alone = left_open([(long, 100.0)], 0.03, none, 0.08)
    assert left_open([(long, 100.0), (short, 79.0), (still, 100.0)], 0.03, none, 0.08) == alone
    assert left_open([(long, 100.0), (short, 81.0)], 0.03, none, 0.08).above > 2.0 * alone.above
    assert (alone.soonest, alone.latest, alone.length) == pytest.approx((1.5, 2.7, 3.0))
    assert alone.above == pytest.approx(np.sqrt((1.5 * -np.expm1(-3.0) - 1.0) ** 2 - 0.08**2))
    assert left_open([(still, 100.0)], 0.03, none, 0.08) is None
    assert left_open([], 0.03, none, 0.08) is None


def test_a_temperature_beyond_the_end_of_past_runs_is_as_open_as_they_left_it():
    """Within their 80 min the curve is known; at 300 min the truth lay 0.9 K above the interval."""
    model = _learnt(80.0)
    truth = {at: float(_run(at, 0)["T1"][-1]) for at in (75.0, 300.0)}
    near, far = (tf.identify(_run(60.0, 3), model=model, at=at)[0] for at in truth)
    assert near.at_hi_c - near.at_lo_c < 1.2
    for record, at in ((near, 75.0), (far, 300.0)):
        assert record.at_lo_c < truth[at] < record.at_hi_c


def test_modes_of_very_slow_masses_are_looked_for_in_long_runs_alone():
    """33 times as slow: nothing at seven time constants, as any other at forty."""
    sizes = 0.4, 0.15, 0.1
    slowest, usual = SLOW_MODES.index(0.03), SLOW_MODES.index(0.2)
    short, long = _deviations(sizes, 7.0), _deviations(sizes, 40.0)
    assert short[slowest] < 0.05 * short[usual]
    assert long[slowest] == long[usual] == short[usual]


def test_a_past_with_a_slow_mass_counts_as_slow():
    """It is trusted for half of a third of the time that it takes to 95 %, not of the fast mass's."""
    count = len(SLOW_MODES) + len(FAST_MODES) + 1
    shape = SensorShape(-np.log(20.0), 0.05, np.zeros(count), np.eye(count))
    assert Past({"a": shape}).time_constant == pytest.approx(20.0, rel=0.02)
    slow = np.zeros(count)
    slow[SLOW_MODES.index(0.1)] = 0.35
    shape = SensorShape(-np.log(20.0), 0.05, slow, np.eye(count))
    assert Past({"a": shape}).time_constant == pytest.approx(200.0 * np.log(0.35 / 0.05) / np.log(20.0), rel=0.03)
