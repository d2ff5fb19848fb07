"""Errors on readings that a fit did not see know nothing of these readings, by no way round."""

import json
from dataclasses import replace

import numpy as np
import pytest

import thermofast as tf
from benchmarks.discovery.dominant import runs_of
from benchmarks.machines import bar
from thermofast.discovery import wording
from thermofast.discovery.compare import HOLDS, left_together
from thermofast.discovery.diagnose import verdict_of
from thermofast.discovery.wording import _error_moves, may_be_none, not_borne_out
from thermofast.models.effects import LoadStep, NeighbourHeat
from thermofast.models.joint import Key, fit_model, refit, settled
from thermofast.models.search import heldout
from thermofast.models.search.candidates import try_add
from thermofast.models.search.discover import discover
from thermofast.models.search.rules import RULES
from thermofast.observing.observe import observe
from thermofast.observing.task import LoopTask, ahead_errors, at_rest, curve_ahead
from thermofast.records import CompareRecord

MINUTES = np.arange(0.0, 301.0)


def linked(noise=0.01):
    """Two bodies that warm each other by 0.02 per minute, run together by small steps; the first is heated."""
    state, rows = np.zeros(2), []
    for k in range(10 * len(MINUTES)):
        if k % 10 == 0:
            rows.append(state.copy())
        flow = 0.02 * (state[0] - state[1])
        state = state + 0.1 * np.array([0.2 - 0.015 * state[0] - flow, flow - 0.01 * state[1]])
    rng = np.random.default_rng(1)
    return {"time_min": MINUTES} | {
        n: 20.0 + row + noise * rng.standard_normal(301) for n, row in zip("ab", np.array(rows).T, strict=True)
    }


def fitted(table, until=None):
    seen = observe(tf.read(table)).seen
    fit = settled(try_add(fit_model(seen.until(until)), NeighbourHeat()).fit)
    return fit, seen


def test_a_neighbours_readings_that_are_left_out_are_not_known_either():
    """Whatever both read there, the prediction is the same; before that it is the fit's."""
    fit, seen = fitted(linked(), 150.0)
    later = MINUTES > 150.0
    told = heldout.predicted(fit, later)
    elsewhere = replace(seen.until(150.0), reading=np.where(later, 99.0, seen.reading))
    again = settled(try_add(fit_model(elsewhere), NeighbourHeat()).fit)
    assert heldout.predicted(again, later) == pytest.approx(told, abs=1e-4)
    assert told[:, ~later] == pytest.approx(fit.curve[:, ~later], abs=1e-9)
    assert curve_ahead(fit) == pytest.approx(told)
    # Of a machine that is so linked it is right all the same: the two run on together.
    assert ahead_errors(fit, seen).max() < 0.1
    assert np.array_equal(heldout.predicted(fit, np.zeros(len(MINUTES), dtype=bool)), fit.curve)
    plain = fit_model(seen)
    assert heldout.predicted(plain, later) is plain.curve


def test_a_load_that_changes_later_is_foretold_by_no_neighbour():
    """All sensors leave at once: with their readings each would follow the other, and the error ahead would be a fifth."""
    table = linked()
    fall = np.where(MINUTES > 180.0, -4.0 * -np.expm1(-(MINUTES - 180.0) / 30.0), 0.0)
    table |= {"a": table["a"] + fall, "b": table["b"] + 0.7 * fall}
    fit, seen = fitted(table, 150.0)
    error = ahead_errors(fit, seen)
    after = MINUTES > 150.0
    seen_by_neighbours = np.sqrt(np.mean((seen.reading - fit.curve)[:, after] ** 2, axis=1))
    assert np.all(error > 0.8 * np.sqrt(np.mean((np.outer([1.0, 0.7], fall))[:, after] ** 2, axis=1)))
    assert error[1] > 2.0 * seen_by_neighbours[1]
    told = tf.compare(table, effects="neighbour_heat", until=150.0)
    assert [r.rmse_ahead_c for r in told] == pytest.approx(error, rel=0.05)
    assert [r.bias_c for r in told] == pytest.approx(np.mean((seen.reading - curve_ahead(fit))[:, after], axis=1), rel=0.05)


def test_a_fit_without_a_block_goes_on_until_it_knows_nothing_of_it(monkeypatch):
    """Ten times the iterations change no error by a hundredth; a dozen left a tenth of one."""
    seen = observe(tf.read("sample_runs/hidden_two.csv")).seen
    fit = settled(try_add(fit_model(seen), LoadStep()).fit)
    told = heldout.held_out_errors(fit)
    monkeypatch.setattr(heldout, "MOST_ITERATIONS", 1000)
    assert heldout.held_out_errors(fit) == pytest.approx(told, rel=0.01)
    monkeypatch.setattr(heldout, "MOST_ITERATIONS", 12)
    assert np.max(np.abs(heldout.held_out_errors(fit) / told - 1.0)) > 0.05


def test_a_fit_that_was_broken_off_is_gone_on_with_or_told():
    seen = observe(tf.read("sample_runs/hidden_two.csv")).seen
    broken = refit(fit_model(seen.until(100.0)), seen, 1)
    whole = settled(broken)
    assert (broken.converged, whole.converged) == (False, True)
    assert whole.rss == pytest.approx(fit_model(seen).rss, rel=1e-3)
    assert settled(whole) is whole
    assert at_rest(whole) == []
    assert at_rest(broken) == ["the fit of the base model has not come to rest: its values are one choice of many that fit alike"]
    found = tf.compare("sample_runs/hidden.csv", effects="neighbour_heat")
    assert all("the fit of neighbour_heat has not come to rest" in r.message for r in found)


def test_what_later_readings_do_not_bear_out_is_not_advised():
    """A named effect whose error ahead is no smaller than without it is not determined, and not to be added."""
    seen = observe(tf.read("sample_runs/hidden.csv")).seen
    found = discover(seen.until(200.0), [LoadStep()], RULES.false_alarm)
    named = replace(found, named=found.named or try_add(found.base, LoadStep()), also=())
    worse = replace(named, ahead_base=np.full(4, 0.2), ahead=np.full(4, 0.3))
    said = not_borne_out(worse, seen, 200.0)
    assert said.startswith("the readings after 200 min do not bear it out: the error there is 0.3 K with load_step, 0.2 K without")
    assert not_borne_out(worse, seen, None) == ""
    assert not_borne_out(replace(worse, ahead=np.full(4, 0.19)), seen, 200.0) == ""
    task = LoopTask(tf.read("sample_runs/hidden.csv"), until_min=200.0)
    evidence, advice, status, _ = verdict_of(task, worse, seen.until(200.0))
    assert (advice, status) == (said, "not_determined")
    assert "on readings not fitted" in evidence
    assert "from 0.2 to 0.3 K" in evidence


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [(0.4, 0.1, "falls from 0.4 to 0.1 K"), (0.1, 0.4, "rises from 0.1 to 0.4 K"), (0.2, 0.201, "stays at 0.2 K")],
)
def test_errors_fall_rise_or_stay_in_words(before, after, said):
    assert _error_moves(before, after) == f"the error on readings not fitted {said}"


def test_a_size_is_not_told_from_none_where_its_interval_holds_it_in_every_sensor():
    fit, _ = fitted(linked())
    (part,) = range(len(fit.model.parts))
    value, error = fit.values[Key(part, "kappa")], fit.deviations[Key(part, "kappa")]
    enough = float(np.max(value / (1.96 * error)))
    assert enough > 3.0
    assert not may_be_none(fit, part, 1.0, None)
    assert not may_be_none(fit, part, 0.99 * enough, None)
    assert may_be_none(fit, part, 1.01 * enough, None)


def test_a_run_without_what_an_effect_needs_is_readable(tool, tmp_path):
    done = tool("improve", "sample_runs/spindle.csv", "--channels", "T1", "--add", "neighbour_heat", "--format", "json", "-q")
    (record,) = json.loads(done.out)["records"]
    assert (done.code, record["status"]) == (1, "failed")
    assert "needs a second sensor" in record["message"]


def test_a_model_of_several_runs_is_compared_with_its_own_constants(tmp_path):
    """A slow part that it has not would bend its rate, which is open from run to run, until the first minutes fit."""

    def run(seed):
        rng = np.random.default_rng(seed)
        rise = (1.0 + 0.02 * rng.standard_normal()) * np.array([8.0, 11.0])[:, None]
        shape = 0.85 * -np.expm1(-MINUTES / 35.0) + 0.15 * -np.expm1(-MINUTES / 120.0)
        rows = 20.0 + rise * shape + 0.02 * rng.standard_normal((2, 301))
        return tf.read({"time_min": MINUTES, "a": rows[0], "b": rows[1]}, name=f"run {seed}")

    one = tf.improve(run(1)).model
    both = tf.improve([run(1), run(2)], together=True).model
    by_one, by_both = ([r.rmse_ahead_c for r in tf.compare(run(3), model=m, until=60.0)] for m in (one, both))
    assert by_both == pytest.approx(by_one, rel=0.25)
    assert max(by_both) < 0.5


def test_sensors_that_leave_the_model_together_are_told_first():
    """A load that falls at 180 min for both; not where one goes on as it was, nor without --until."""
    rng = np.random.default_rng(2)
    table = {"time_min": MINUTES}
    for name, rise, tau in (("a", 12.0, 45.0), ("b", 8.0, 55.0)):
        table[name] = 20.0 - rise * np.expm1(-MINUTES / tau) + 0.02 * rng.standard_normal(len(MINUTES))
    fall = np.where(MINUTES > 180.0, 4.0 * np.expm1(-(MINUTES - 180.0) / 50.0), 0.0)
    both = table | {"a": table["a"] + fall, "b": table["b"] + 0.7 * fall}
    for record in tf.compare(both, until=150.0):
        minute = record.message.removeprefix("from about ").partition(" min on all sensors leave the model together")[0]
        assert float(minute) == pytest.approx(182.0, abs=5.0)
    assert all("together" not in r.message for r in tf.compare(table | {"a": table["a"] + fall}, until=150.0))
    assert all("together" not in r.message for r in tf.compare(both))


def test_compare_and_improve_judge_a_fit_that_has_come_to_rest():
    """Of one that a search breaks off they go on: its error on the readings used is the least there is."""
    seen = observe(tf.read("sample_runs/hidden.csv")).seen
    found = try_add(fit_model(seen), NeighbourHeat()).fit
    assert settled(found).rmse[0] < 0.99 * found.rmse[0]
    compared = tf.compare("sample_runs/hidden.csv", effects="neighbour_heat")
    improved = [r for r in tf.improve("sample_runs/hidden.csv", add="neighbour_heat") if r.step == 1]
    for told in (compared, improved):
        assert [r.rmse_fit_c for r in told] == pytest.approx(settled(found).rmse, rel=1e-6)
        assert all("has not come to rest" in r.message for r in told)


def test_picture_and_area_are_of_the_curve_that_knows_no_later_neighbour():
    table = linked()
    fall = np.where(MINUTES > 180.0, -4.0 * -np.expm1(-(MINUTES - 180.0) / 30.0), 0.0)
    table |= {"a": table["a"] + fall, "b": table["b"] + 0.7 * fall}
    fit, seen = fitted(table, 150.0)
    told = tf.compare(table, effects="neighbour_heat", until=150.0, details=True)
    for i, (panel, record) in enumerate(zip(told.panels, told, strict=True)):
        assert panel.model == pytest.approx(curve_ahead(fit)[i], abs=0.02)
        # The two distributions lie apart by no more than their means do at each reading, and not much less where all are too low.
        error = float(np.mean(np.abs(seen.reading[i] - curve_ahead(fit)[i])))
        assert record.area_metric_c == pytest.approx(error, rel=0.4)
        assert record.area_metric_c > 1.5 * float(np.mean(np.abs(seen.reading[i] - fit.curve[i]))) or i == 0


def a_record(begins, error=5.0, fitted_to=0.05, message=""):
    return CompareRecord("run", "a", rmse_fit_c=fitted_to, worst_from_min=begins, worst_error_c=error, message=message)


@pytest.mark.parametrize(
    ("records", "until", "said"),
    [
        ([a_record(200.0), a_record(207.0, -5.0)], 150.0, True),
        ([a_record(200.0), a_record(212.0)], 150.0, False),
        ([a_record(200.0), a_record(201.0, 0.49)], 150.0, False),
        ([a_record(200.0), a_record(None)], 150.0, False),
        ([a_record(200.0), a_record(149.0)], 150.0, False),
        ([a_record(200.0)], 150.0, False),
        ([a_record(200.0), a_record(201.0)], None, False),
    ],
)
def test_sensors_leave_the_model_together_at_one_time_and_far(records, until, said):
    """Within a twentieth of the time, each by ten times what it missed before."""
    told = left_together(records, until)
    assert bool(told) == said
    assert ("something changed later that nothing logs" in told) == said
    explained = [replace(records[0], message=f"{HOLDS}speed steps at 180 min"), *records[1:]]
    assert "something changed" not in left_together(explained, until)


def test_a_size_that_may_be_none_is_told_in_words(monkeypatch):
    machine = bar.simulate(950_001, 1.0, "nonlinear_loss")
    run = runs_of(machine, 950_001)[0]
    plain = tf.diagnose(run, jobs=1)[0]
    monkeypatch.setattr(wording, "may_be_none", lambda *_: True)
    told = tf.diagnose(run, jobs=1)[0]
    assert plain.status == told.status == "partly_explained"
    assert "not told from none" not in plain.message
    assert "beside that, the size of nonlinear_loss" in told.message
