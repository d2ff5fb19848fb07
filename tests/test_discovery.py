"""A small sample of the proof (``make proof`` runs the whole): verdicts on records of an independent simulator."""

from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from machines import EFFECTS
from scipy.integrate import solve_ivp
from scipy.stats import truncnorm
from test_effects_contract import record

import thermofast as tf
from benchmarks.discovery.proof import Job, guarded
from benchmarks.estimation.coarse_readings import trial
from thermofast.discovery import improve
from thermofast.discovery.compare import failing_stretches
from thermofast.discovery.diagnose import own_verdict
from thermofast.discovery.wording import _when
from thermofast.models.effects import BUILT_IN
from thermofast.models.effects.friction_decay import FrictionDecay
from thermofast.models.effects.load_step import LoadStep
from thermofast.models.effects.neighbour_heat import NeighbourHeat
from thermofast.models.joint import Key, fit_model
from thermofast.models.noise.rounding import _in_cell
from thermofast.models.search.discover import discover
from thermofast.models.search.scan import scan
from thermofast.observing.observe import observe
from thermofast.observing.task import check_inputs, not_tried


@pytest.mark.parametrize("effect", EFFECTS)
def test_one_clear_effect_is_named(effect):
    # The search for a nonlinear loss takes 13 s on the common seed and 1 s on the next; make proof runs fifty of each effect.
    outcome = guarded(Job("clear", (effect,), "clear", 78 if effect == "nonlinear_loss" else 77))
    assert outcome.broken == ""
    assert outcome.verdict == effect
    assert outcome.held_out_ratio < 1.15
    if np.isfinite(outcome.other_run_ratio):
        assert outcome.other_run_ratio < 0.5
    for error, bound in outcome.event_errors:
        assert error <= bound


def test_nothing_hidden_is_none():
    verdicts = [guarded(Job("nothing", (), None, 500 + i)).verdict for i in range(8)]
    assert verdicts.count("none") == 8


def test_two_effects_are_found_together():
    assert guarded(Job("pairs", ("cooling_switch", "reading_jump"), "clear", 7)).verdict == "cooling_switch+reading_jump"


def test_sensors_that_explain_each_other_name_no_neighbour():
    run = record(2, 300)
    walk = np.cumsum(0.3 * np.random.default_rng(1).standard_normal(300))
    walk = np.convolve(walk, np.ones(25) / 25, "same")
    run = replace(run, reading=run.reading + np.array([[0.7], [1.0]]) * walk)
    tried = [kind() for kind in BUILT_IN if kind.id in ("neighbour_heat", "second_mode")]
    found = discover(run, tried)
    assert found.verdict == "unexplained"
    assert {c.ids[0] for c in found.singles} == {effect.id for effect in tried}


def test_failing_stretches_are_where_the_curve_fails_and_nowhere_else():
    rng = np.random.default_rng(0)
    time = np.arange(400.0)
    clean = 0.02 * rng.standard_normal(400)
    assert failing_stretches(time, clean, np.ones(400), 0.02) == []
    broken = clean + np.where((time > 200.0) & (time < 240.0), 0.06, 0.0)
    stretches = failing_stretches(time, broken, np.ones(400), 0.02)
    assert len(stretches) == 1
    assert stretches[0][0] == pytest.approx(201.0, abs=6.0)
    assert stretches[0][1] == pytest.approx(239.0, abs=6.0)
    assert stretches[0][2] == pytest.approx(0.06, abs=0.015)


@pytest.mark.proof
@pytest.mark.parametrize("logger", [(1.0, 0.02)])
def test_rounding_to_steps_above_the_noise_is_no_misfit(logger):
    for seed in range(100, 102):
        assert trial((*logger, 0.0, seed)) == (False, False, "none")
    # And a load that grows by more than the rounding hides is still seen.
    assert [trial((*logger, 0.2, seed))[0] for seed in range(100, 102)] == [True] * 2


def test_the_mean_in_a_cell_is_that_of_the_normal_law_cut_off_by_it():
    reading, curve = np.array([21.0, 21.0, 20.0, 25.0]), np.array([21.1, 21.6, 21.2, 20.0])
    for noise in (0.05, 0.3):
        low, high = (reading - 0.5 - curve) / noise, (reading + 0.5 - curve) / noise
        mean, _ = _in_cell(reading, curve, 1.0, noise)
        assert mean[:3] == pytest.approx(truncnorm.mean(low, high, curve, noise)[:3], abs=2e-3)
        assert mean[3] == pytest.approx(24.5, abs=0.05)


def test_a_sensor_that_no_named_effect_concerns_may_still_be_unexplained():
    link = SimpleNamespace(id="neighbour_heat", effect=SimpleNamespace(scope="sensor"), concerns=lambda n: [True, False, False])
    found = SimpleNamespace(
        named=SimpleNamespace(parts=[link]),
        base=SimpleNamespace(run=SimpleNamespace(sensors=3)),
        base_floor=np.array([1e-9, 1e-9, 0.5]),
    )
    assert [own_verdict(found, i) for i in range(3)] == ["neighbour_heat", "unexplained", "none"]


def test_a_run_forward_that_overflows_points_nowhere():
    """Squares of it are no numbers: it must neither win the scan nor warn on the screen."""

    class Overflowing(LoadStep):
        def response(self, points, run, rate, rise):
            curves = super().response(points, run, rate, rise)
            curves = np.ones((1, len(points), len(run.time))) if curves is None else np.array(curves)
            curves[:, 0] = 1e200
            return curves

    run = record()
    fit, effect = fit_model(run), Overflowing()
    found = scan(fit, effect, effect.choices(run)[0])
    assert np.isfinite(found.gain).all()
    assert np.all(found.gain[0] == 0.0)
    assert found.shared_gain[0] == 0.0


def test_a_stretch_ends_where_the_residual_goes_over_to_the_other_side():
    time = np.arange(400.0)
    swing = np.where(time < 230.0, -0.3 * np.sin((time - 100.0) / 130.0 * np.pi), 0.4 * np.sin((time - 230.0) / 170.0 * np.pi))
    broken = np.where(time > 100.0, swing, 0.0) + 0.015 * np.random.default_rng(1).standard_normal(400)
    below, above = failing_stretches(time, broken, np.ones(400), 0.015)
    assert below[:2] == (pytest.approx(102.0, abs=4.0), pytest.approx(228.0, abs=4.0))
    assert above[:2] == (pytest.approx(233.0, abs=4.0), pytest.approx(398.0, abs=4.0))
    assert below[2] == pytest.approx(-0.6 / np.pi, abs=0.02)
    assert above[2] == pytest.approx(0.8 / np.pi, abs=0.02)


@pytest.mark.parametrize(("of", "name", "value"), [("loss", "cooling_switch", 0.7), ("heat", "load_step", 0.25)])
def test_what_changes_all_the_while_is_no_second_mass(of, name, value):
    """Lumps by scipy's solver of which the loss falls, or the heat grows, evenly through the record; the room is logged."""
    rng, minutes = np.random.default_rng(19), np.arange(0.0, 400.0)
    tau, rise = np.array([45.0, 60.0, 75.0]), np.array([9.0, 7.0, 12.0])

    def slope(time, state):
        passed = min(time / minutes[-1], 1.0)
        heat, loss = (1.0, 1.0 - 0.3 * passed) if of == "loss" else (1.0 + 0.25 * passed, 1.0)
        return (rise * heat - loss * state) / tau

    curves = 20.0 + solve_ivp(slope, (0.0, minutes[-1]), np.zeros(3), t_eval=minutes, rtol=1e-9, atol=1e-9).y
    columns = {"time_min": minutes, "ambient": 20.0 + rng.normal(0.0, 0.03, 400)}
    columns |= {f"T{i}": line + rng.normal(0.0, 0.02, 400) for i, line in enumerate(curves)}
    for told in tf.diagnose(columns):
        assert (told.verdict, told.status) == (name, "ok")
        size, error = (told.parameters[f"{name}.{'ratio' if of == 'loss' else 'change'}"][k] for k in ("value", "standard_error"))
        assert abs(size - value) < 1.96 * error + 0.002
        assert "steadily" in told.message
        assert "kink" not in told.message
        assert told.event_min is None


@pytest.mark.proof
def test_a_coolant_in_degrees_by_the_letter_of_its_name_brings_heat():
    """A lump by scipy's solver beside a coolant that swings; told without a unit it follows a column that has no event."""
    rng, minutes = np.random.default_rng(31), np.arange(0.0, 400.0)
    coolant = 18.0 + 3.0 * np.sin(minutes / 55.0)
    tau, rise, kappa = np.array([45.0, 70.0]), np.array([9.0, 7.0]), 0.008

    def slope(time, state):
        return (rise - state) / tau + kappa * (np.interp(time, minutes, coolant) - 20.0 - state)

    curves = 20.0 + solve_ivp(slope, (0.0, minutes[-1]), np.zeros(2), t_eval=minutes, rtol=1e-9, atol=1e-9, max_step=1.0).y
    sensors = {f"T{i}": line + rng.normal(0.0, 0.02, 400) for i, line in enumerate(curves)}
    for told in tf.diagnose({"time_min": minutes, **sensors, "coolant_C": coolant}):
        assert told.verdict == "coolant_heat"
        assert told.parameters["coolant_heat.kappa"]["value"] == pytest.approx(kappa, rel=0.1)
    for told in tf.diagnose({"time_min": minutes, **sensors, "coolant": coolant}):  # of no unit, and said so
        assert "coolant_heat" not in told.verdict
        assert "kink" not in told.message
        assert "--units coolant=C" in told.message


def test_when_something_changed_is_told_by_a_model_whose_moment_was_searched():
    """What follows a logged column has none: it was a KeyError."""
    seen = SimpleNamespace(clock=30.0 + np.arange(10.0), start_min=30.0, span=9.0)
    effect = SimpleNamespace(event="event", scope="run")
    part = SimpleNamespace(effect=effect)
    followed = SimpleNamespace(parts=[part], fit=SimpleNamespace(values={}))
    searched = SimpleNamespace(parts=[part], fit=SimpleNamespace(values={Key(0, "event"): 3.25}))
    assert _when((36.0, 37.0, 0.1), seen, [followed, searched]) == "changed at about 33.2 min"
    assert _when((36.0, 37.0, 0.1), seen, [followed]) == "changed at 36 min"


def test_what_is_added_does_not_hang_on_the_order_in_which_it_was_named():
    base = SimpleNamespace(gain=0.0, names=())

    def try_add(fit, effect):
        """What comes second alone gains nothing, and makes the rest impossible."""
        if fit.names and fit.names[0] == "late":
            return None
        names = (*fit.names, effect)
        return SimpleNamespace(fit=SimpleNamespace(names=names), gain=len(names) - 0.5 * (names[0] == "late"))

    with (
        mock.patch.object(improve, "try_add", try_add),
        mock.patch.object(improve, "total_likelihood_ratio", lambda base, one: one.gain),
    ):
        for order in permutations(["late", "step", "mode"]):
            assert improve._all_added(base, list(order)).gain == 3.0
        for order in (["late", "step", "mode", "room"], ["room", "mode", "step", "late"]):
            assert set(improve._all_added(base, order).fit.names) == {"late", "step", "mode", "room"}
        assert improve._all_added(SimpleNamespace(names=("late",)), ["a", "b", "c", "d"]) is None


def linked_sensors(count):
    """One sensor that is heated, and others that its heat comes to: by scipy's solver."""
    rng, minutes = np.random.default_rng(0), np.arange(0.0, 200.0, 2.0)
    tau = 80.0 * (1.0 + 0.02 * np.arange(1, count))

    def slope(_, state):
        first = (8.0 - state[0]) / 20.0
        return np.concatenate([[first], (5.0 - state[1:]) / tau + 0.03 * (state[0] - state[1:])])

    curves = 20.0 + solve_ivp(slope, (0.0, minutes[-1]), np.zeros(count), t_eval=minutes, rtol=1e-9, atol=1e-9).y
    return {"time_min": minutes} | {f"T{i}": line + rng.normal(0.0, 0.02, len(minutes)) for i, line in enumerate(curves)}


def test_an_effect_of_too_many_sensors_is_said_not_to_have_been_tried():
    many = linked_sensors(41)
    with pytest.raises(
        tf.ThermofastError, match=r"(?s)'neighbour_heat' is tried of 40 sensors at once at most.*41 sensors.*channels"
    ):
        check_inputs([NeighbourHeat()], observe(tf.read(many)).seen)
    assert check_inputs([NeighbourHeat()], observe(tf.read(linked_sensors(40))).seen) is None
    said = not_tried([FrictionDecay(), NeighbourHeat()], observe(tf.read(many)).seen)
    assert said == "neighbour_heat was not tried: it is of 40 sensors at most, and there are 41 (choose with --channels)"


def test_columns_along_which_nothing_was_tried_are_named_and_no_cause_stands_alone():
    rng, minutes = np.random.default_rng(2), np.arange(0.0, 200.0)
    sensors = {f"T{i}": 20.0 + r * -np.expm1(-minutes / 40.0) + rng.normal(0.0, 0.02, 200) for i, r in enumerate((6.0, 8.0))}
    oil = {f"oil{k} [degC]": 20.0 + np.cumsum(rng.normal(0.0, 0.05, 200)) for k in range(8)}
    run = tf.read({"time_min": minutes, **sensors, **oil}, inputs=list(oil), channels=["T0", "T1"])
    for effects, left in ((["coolant_heat"], True), (["second_mode"], False)):
        row = tf.diagnose(run, effects=effects)[0]
        assert ("nothing was tried along oil6" in row.message) is left
        assert (row.status == "not_determined") is left
