"""What a column says is what it is: numbers that a sign, a swap or a factor left out would change."""

import re

import numpy as np
import pytest

import thermofast as tf
from thermofast.analysis.calibration import CANDIDATES, TURNS, Past, learn
from thermofast.models import Lump
from thermofast.models.imperfection.prior import SLOW

MINUTES = np.arange(241.0)


def risen(rise=10.0, tau=40.0, noise=0.02, seed=1):
    return 20.0 - rise * np.expm1(-MINUTES / tau) + noise * np.random.default_rng(seed).standard_normal(len(MINUTES))


@pytest.mark.parametrize("off", [0.5, -0.4])
def test_a_bias_is_reading_less_model(off):
    """Readings after the fit that lie `off` higher than the law."""
    found = tf.compare({"time_min": MINUTES, "a": risen() + np.where(MINUTES > 150.0, off, 0.0)}, until=150.0)[0]
    assert found.bias_c == pytest.approx(off, abs=0.05)


def test_a_baseline_is_that_of_no_temperature_and_the_same_for_every_method():
    """The better of the mean and a line across each block: not the method's own error."""
    found = tf.displacement("sample_runs/displacement.csv", "Z_um")
    assert len({r.baseline_um for r in found}) == 1
    assert found[0].baseline_um > 10.0 * found[0].rmse_ahead_um


def test_a_score_ratio_below_one_is_a_gain():
    """Ends ten times as near as typical intervals are wide: those of the lab are narrower and hold them all the same."""
    end = np.array([30.0, 31.0])
    three = np.stack([end + 0.02 - 0.5, end + 0.02, end + 0.02 + 0.5], axis=1)
    past = [Past(f"{k}", np.broadcast_to(three, (len(CANDIDATES), len(TURNS), 2, 3)).copy(), end) for k in range(8)]
    row = learn(past).records[0]
    assert (row.held_typical, row.held_lab) == (1.0, 1.0)
    assert row.width_lab_c < 0.8 * row.width_typical_c
    assert row.score_ratio == pytest.approx(row.width_lab_c / row.width_typical_c, rel=0.05)


def test_what_may_be_unseen_is_slower_than_the_nearest_slow_part():
    """Slow parts have shares SLOW of the law's rate; the fastest of them is the first that hides."""
    record = tf.identify({"time_min": MINUTES[:61], "a": risen()[:61], "b": risen(8.0, 42.0, seed=2)[:61]})[0]
    told = float(re.match(r"a second mass slower than (\d+) min", record.unseen)[1])
    assert told == pytest.approx(1.0 / (max(SLOW) * record.rate_per_min), rel=0.2)


def test_readings_that_a_logger_averages_say_no_more_than_those_it_did_not():
    """A mean over ten readings is ten times as quiet and tells the limit as well, not three times as well."""
    minutes = np.arange(0.0, 60.0, 1.0 / 6.0)
    plain = 20.0 - 10.0 * np.expm1(-minutes / 40.0) + 0.1 * np.random.default_rng(3).standard_normal(len(minutes))
    averaged = np.convolve(plain, np.ones(10) / 10.0, "valid")

    def half_width(values):
        return tf.identify({"time_min": minutes[: len(values)], "a": values}, imperfection="none")[0].reading_half_width_c

    assert half_width(averaged) > 0.7 * half_width(plain)
    # Beside a machine's imperfections they are as likely as others: by their own noise alone they would leave the law by far.
    for values in (plain, averaged):
        told = tf.identify({"time_min": minutes[: len(values)], "a": values})[0]
        assert told.status == "ok"
        assert told.steady_state_lo_c < 30.0 < told.steady_state_hi_c
        assert told.steady_state_hi_c - told.steady_state_lo_c < 4.0


def test_the_interval_of_a_filters_state_is_that_of_draws_of_it():
    """T + s / b of Gaussian states, of which rate and slope go together: 100,000 of them."""
    state, deviations = np.array([25.0, 0.1, 0.02]), np.array([0.05, 0.004, 0.002])
    correlation = np.array([[1.0, 0.3, -0.2], [0.3, 1.0, 0.85], [-0.2, 0.85, 1.0]])
    covariance = correlation * np.outer(deviations, deviations)
    drawn = np.random.default_rng(4).multivariate_normal(state, covariance, 100_000)
    sides = np.quantile(drawn[:, 0] + drawn[:, 1] / drawn[:, 2], [0.025, 0.975])
    steady, _ = Lump().intervals(state, covariance, 1.96)
    assert [steady.low, steady.high] == pytest.approx(sides, abs=0.05)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("T5_column", "sensor"),
        ("T9_table", "sensor"),
        ("T12 bed", "sensor"),
        ("T12_bed_pos", "input"),
        ("T16_table_load", "input"),
        ("table", "ignored"),
    ],
)
def test_a_part_of_a_machine_behind_the_number_of_a_probe_is_a_place(name, role):
    minutes = np.arange(60.0)
    line = 20.0 + 5.0 * -np.expm1(-minutes / 20.0) + 0.02 * np.random.default_rng(1).standard_normal(60)
    row = tf.inspect({"time_min": minutes, "T1_motor": line, name: line + 1.0})[name]
    assert (row.role, row.guessed) == (role, row.guessed if role == "ignored" else "")
