"""Past runs that ended before the machine had settled: what their own readings leave open of its end, the past does."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.models.imperfection import TYPICAL, Part, ends_alone
from thermofast.models.imperfection.machine.rest import _latest

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
    assert "what it was learnt from may have ended early: by their readings alone they may go on by up to" in record.message
    rest = model.file.past.shapes[0].rest
    assert rest[1] > 0.05
    assert rest[3] > _t95() * model.file.past.shapes[0].rate_per_min


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
