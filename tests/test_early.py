"""Records too short for a slow part behind a quick one: no row is `ok` before 25 minutes, or sixty time constants."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation import imperfect
from thermofast.experiments import planning


def record(tau: float, minutes: float, load: float = 1.0) -> tf.Run:
    rng = np.random.default_rng(int(10.0 * tau) + 7)
    time = np.arange(0.0, minutes + 1e-9, 0.25)
    columns = {f"T{i}": 20.0 + load * rise * -np.expm1(-time / tau) for i, rise in enumerate((6.0, 8.0, 9.0))}
    return tf.read({"time_min": time} | {n: c + rng.normal(0.0, 0.02, len(time)) for n, c in columns.items()}, name=f"load {load}")


@pytest.mark.parametrize(
    ("tau", "minutes", "status"),
    [
        (8.0, 16.0, "not_determined"),
        (8.0, 24.0, "not_determined"),
        (8.0, 26.0, "ok"),
        (2.0, 10.0, "not_determined"),
        (2.0, 14.0, "not_determined"),  # seven time constants: a chip on a heat sink looks settled then
        (2.0, 26.0, "ok"),
        (0.3, 19.0, "ok"),  # more than sixty
        (20.0, 26.0, "ok"),
    ],
)
def test_a_row_is_ok_once_a_slow_part_would_show(tau, minutes, status):
    rows = tf.identify(record(tau, minutes))
    assert [r.status for r in rows] == [status] * 3
    said = "so early a slower part behind what has moved so far does not show: measure for"
    assert all((said in r.message) == (status != "ok") for r in rows)
    assert all(r.steady_state_lo_c is not None for r in rows)  # what was found is told all the same


def test_it_is_told_how_long_to_measure():
    assert "measure for 25 min at least" in tf.identify(record(8.0, 16.0))[0].message
    assert "measure for 18 min at least" in tf.identify(record(0.3, 10.0))[0].message


def test_past_runs_and_the_law_alone_are_not_asked():
    assert {r.status for r in tf.identify(record(8.0, 16.0), imperfection="none")} == {"ok"}
    model = tf.improve([record(8.0, 60.0), record(8.0, 60.0, 0.8)], together=True).model
    assert {r.status for r in tf.identify(record(8.0, 16.0, 0.9), model=model)} == {"ok"}


def test_a_sweep_counts_no_time_before():
    """Half-widths are within 0.5 K from 15 min on."""
    rows = tf.sweep(record(8.0, 60.0), windows=(40.0,), times=(16.0, 20.0, 24.0, 26.0, 30.0, 39.0), tolerance=0.5)
    assert [r.tolerance_time_min for r in rows] == [26.0] * 3


def test_a_plan_says_that_watch_waits_so_long(monkeypatch):
    every = planning.alternatives
    monkeypatch.setattr(planning, "alternatives", lambda *given: every(*given)[:1])  # "as asked" is the one that is looked at
    row = tf.plan(sensors=3, tau_min=8.0, rise_c=8.0, tolerance=2.0, interval_s=15.0)[0]
    assert row.time_min < 22.0
    assert "watch does not stop before 3.1 time constants (25 min)" in row.message


def test_a_rate_that_may_be_slow_is_no_quick_one():
    """A probe of 0.4 min with a slow part that moves as it does: its rate may be a hundredth of what is likeliest."""
    found = np.array([[0.03, 8.4, 20.0]])
    one = SimpleNamespace(rate=found, held=np.array([True]), known=np.array([False]), early=np.full(1, np.nan))
    closed = SimpleNamespace(count=2, sensors=SimpleNamespace(time=np.array([0.0, 20.0])))
    with mock.patch.object(imperfect, "_before", return_value=[np.zeros(1)]):
        imperfect._mark_early([closed], [np.array([True])], [one], False)
    assert one.early == 25.0
