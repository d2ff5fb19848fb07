"""What a disturbance moves the parameters of a joint fit by."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import thermofast as tf
from thermofast.discovery.remains import cycle_of
from thermofast.models import Observations
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import RATE, Key, Part, fit_model, refit
from thermofast.models.noise.discrepancy import Noise, RandomWalk
from thermofast.models.uncertainty.disturbed import _taken_up, disturbed_deviations
from thermofast.observing.observe import observe
from thermofast.observing.task import parameters_of, unseen_delay

LOAD = next(kind for kind in BUILT_IN if kind.id == "load_step")()
TIME = np.arange(0.0, 240.0, 2.0)


def stepped(seed=0, room=None, noise=0.02):
    """Three lumps whose heat steps by a fifth at 110 min; room (N,) [K] moves all of them."""
    rng = np.random.default_rng(seed)
    tau, rise = np.array([[35.0], [50.0], [65.0]]), np.array([[8.0], [14.0], [20.0]])
    curve = 20.0 - rise * np.expm1(-TIME / tau) - 0.2 * rise * np.expm1(-np.maximum(TIME - 110.0, 0.0) / tau)
    if room is not None:
        curve = curve + Noise((RandomWalk(1.0),)).columns(TIME, 1.0 / tau[:, 0], rise[:, 0]).shared[room]
    reading = curve + noise * rng.standard_normal(curve.shape)
    sizes = np.full(3, noise), np.zeros(3)
    return Observations("run", ("T1", "T2", "T3"), TIME, reading, np.ones_like(reading), *sizes)


def fitted(run):
    part = Part(LOAD, LOAD.choices(run)[0])
    return fit_model(run, [part], {Key(0, "change"): 0.2, Key(0, "event"): 110.0})


def test_parameters_follow_a_disturbance_as_a_fit_of_it_does():
    run = stepped()
    fit = fitted(run)
    shapes = Noise((RandomWalk(0.1),)).columns(TIME, fit.values[RATE], np.ptp(fit.curve, axis=1)).shared[:3]
    own, shared = _taken_up(fit, shapes)
    for k, shape in enumerate(shapes):
        sides = [refit(fit, replace(run, reading=run.reading + sign * 0.05 * shape), 60) for sign in (1.0, -1.0)]
        np.testing.assert_allclose(
            (sides[0].shared - sides[1].shared) / 0.1, shared[k], rtol=0.05, atol=0.03 * np.abs(shared[k]).max()
        )
        np.testing.assert_allclose((sides[0].local - sides[1].local) / 0.1, own[k], rtol=0.05, atol=0.03 * np.abs(own[k]).max())


def test_the_errors_grow_with_what_the_fit_leaves():
    exact, moved = (fitted(stepped(room=k)) for k in (None, 1))
    change = Key(0, "change")
    quiet, loud = (float(disturbed_deviations(f)[change]) for f in (exact, moved))
    assert quiet < 0.003
    assert loud > 5.0 * quiet
    # Under white noise alone the truth lies outside its interval.
    assert abs(float(moved.values[change]) - 0.2) > 1.96 * float(moved.deviations[change])
    assert abs(float(moved.values[change]) - 0.2) < 1.96 * loud


def test_an_event_is_told_no_sharper_than_readings_and_probes_are():
    fit = fitted(stepped())
    late = 0.02 * float(np.median(1.0 / fit.values[RATE]))
    assert unseen_delay(fit, 0, "event") == pytest.approx(np.hypot(late, 2.0 / np.sqrt(12.0)))
    assert unseen_delay(fit, 0, "change") == 0.0


@pytest.mark.proof
def test_a_room_that_steps_is_named_and_no_load_or_cooling():
    """Lumps of unlike rises go to what they had and as many kelvin more; a load that steps moves each by its own rise."""
    rng, tau, rise = np.random.default_rng(1), (30.0, 45.0, 60.0), (9.0, 15.0, 24.0)
    since = np.maximum(TIME - 120.0, 0.0)
    for step, change, name in ((1.5, 0.0, "room_step"), (0.0, 0.15, "load_step")):
        table = {"time_min": TIME}
        for k, (b, r) in enumerate(zip(tau, rise, strict=True)):
            curve = 20.0 - r * np.expm1(-TIME / b) - (step + change * r) * np.expm1(-since / b)
            table[f"T{k}"] = curve + 0.03 * np.sin(TIME / 23.0 + k) + 0.02 * rng.standard_normal(len(TIME))
        found = tf.diagnose(table)[0]
        assert found.verdict == name
        told = found.parameters[f"{name}.{'step' if step else 'change'}"]
        assert abs(told["value"] - (step or change)) <= 1.96 * told["standard_error"] + 1e-9


def test_errors_of_a_sensors_own_parameters_count_a_disturbance_too():
    law = next(kind for kind in BUILT_IN if kind.id == "second_mode")()
    run = stepped()
    fit = fit_model(run, [Part(law, law.choices(run)[0])])
    told = parameters_of(fit, 1)
    name = next(n for n, p in told.items() if p["standard_error"])
    parameter = law.parameter(name.partition(".")[2])
    own = told[name]["standard_error"] / (told[name]["value"] if parameter.log else 1.0)
    beside = {c.key: np.full(3, 5.0 * own) for c in fit.model.local} | {c.key: 0.0 for c in fit.model.shared}
    wider = parameters_of(fit, 1, beside=beside)[name]["standard_error"]
    assert wider == pytest.approx(np.sqrt(26.0) * told[name]["standard_error"], rel=0.05)


def test_a_power_changes_no_loss_a_fan_brings_no_heat_and_a_coolant_is_warm():
    logged = {
        "Leistung [kW]": 1.0 + (TIME > 100.0),
        "fan": 0.0 + (TIME > 150.0),
        "speed_rpm": 2.0 + (TIME > 50.0),
        "coolant_temp": 18.0 + TIME / 99.0,
    }
    readings = stepped().reading
    table = {"time_min": TIME, **{f"T{i} [°C]": row for i, row in enumerate(readings)}, **logged}
    seen = observe(tf.read(table, inputs=list(logged))).seen
    assert (seen.heats, seen.cools, seen.temperatures) == (("Leistung [kW]",), ("fan",), ("coolant_temp",))
    columns = {kind.id: {c.constants.get("column") for c in kind().choices(seen)} - {None, ""} for kind in BUILT_IN}
    assert columns["cooling_switch"] == {"fan", "speed_rpm"}
    assert columns["load_step"] == {"Leistung [kW]", "speed_rpm"}
    assert columns["coolant_heat"] == {"coolant_temp"}


def switched(step, rises=(9.0, 15.0, 24.0), change=0.0, seed=1):
    """A table of lumps of these rises, in a room that steps by `step` [K] or under a heat that changes by a share, at 120 min."""
    rng, since = np.random.default_rng(seed), np.maximum(TIME - 120.0, 0.0)
    table = {"time_min": TIME}
    for k, (b, r) in enumerate(zip((30.0, 45.0, 60.0), rises, strict=True)):
        curve = 20.0 - r * np.expm1(-TIME / b) - (step + change * r) * np.expm1(-since / b)
        table[f"T{k}"] = curve + 0.02 * rng.standard_normal(len(TIME))
    return table


def test_no_room_moves_a_machine_by_more_than_it_rose():
    """A heat that is switched off looks like a room that falls by as much; three kelvin are a room's."""
    room = next(kind for kind in BUILT_IN if kind.moves_room)()
    for step, change in ((3.0, 0.0), (-3.0, 0.0), (0.0, -1.0)):
        seen = observe(tf.read(switched(step, change=change))).seen
        start = {Key(0, "step"): step or -15.0, Key(0, "event"): 120.0}
        fit = fit_model(seen, [Part(room, room.choices(seen)[0])], start)
        assert step == 0.0 or fit.values[Key(0, "step")] == pytest.approx(step, abs=0.3)
        assert fit.physical == (step != 0.0)


def test_a_load_that_a_room_would_do_as_well_is_told_beside_that_room():
    """Sensors that rise alike: what three kelvin of the room do, a fifth of the load does. No room does what half the load does."""
    alike = (14.0, 14.5, 15.0)
    found = tf.diagnose(switched(3.0, alike))[0]
    assert found.verdict in ("load_step", "cooling_switch")
    assert found.also_possible
    assert found.status in ("not_determined", "partly_explained")
    logged = tf.diagnose({**switched(0.0, alike, 0.2), "room": np.full(len(TIME), 20.0)})[0]
    assert "room_step" not in logged.also_possible
    halved = tf.diagnose(switched(0.0, alike, -0.6))[0]
    assert "room_step" not in halved.also_possible
    assert halved.verdict == "load_step"


def test_what_swings_is_told_with_its_period_beside_what_is_named():
    """A duty cycle that no effect of the catalogue beats a disturbance with: diagnose says that it is there, and how long it is."""
    rng, time = np.random.default_rng(2), np.arange(0.0, 480.0, 1.0)
    duty = np.where((time % 30.0) < 20.0, 1.5, 0.0)
    quick, slow = (lfilter([1.0 - np.exp(-1.0 / tau)], [1.0, -np.exp(-1.0 / tau)], duty) for tau in (4.0, 110.0))
    table = {"time_min": time, "front": 20.0 + 9.0 * quick + 12.0 * slow, "rear": 20.0 + 14.0 * slow}
    seen = observe(tf.read({n: v + (n != "time_min") * 0.02 * rng.standard_normal(len(time)) for n, v in table.items()})).seen
    told = cycle_of(fit_model(seen))
    assert told.startswith("front")
    assert told.endswith("with a period of 30 min")
    assert cycle_of(fit_model(replace(seen, reading=20.0 + 9.0 * np.array([1.0 - np.exp(-time / 40.0)] * 2)))) == ""


def test_the_verdict_says_what_swings_and_what_an_effect_of_one_sensor_does_there():
    """Two sensors swing and one has moved by a kelvin as well: that is its own, and nothing of the swing."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 400.0, 1.0)
    wave = np.sin(2.0 * np.pi * time / 25.0)
    table = {"time_min": time} | {f"T{k}": 20.0 + r * -np.expm1(-time / 60.0) for k, r in enumerate((9.0, 14.0, 18.0))}
    for name, more in (("T0", 0.8 * wave), ("T1", 0.5 * wave), ("T2", 1.0 * (time > 250.0))):
        table[name] = table[name] + more + 0.02 * rng.standard_normal(len(time))
    told = {r.channel: r for r in tf.diagnose(table, effects=["reading_jump"])}
    assert {n: r.verdict for n, r in told.items()} == {"T0": "unexplained", "T1": "unexplained", "T2": "reading_jump"}
    assert "it explains more than 99 % of the misfit there" in told["T2"].message
    assert "T0, T1 swing with a period of 25 min" in told["T2"].message
    alone = tf.diagnose({n: v for n, v in table.items() if n != "T2"}, effects=["reading_jump"])[0]
    assert "beside it T0, T1 swing with a period of 25 min" in alone.message
    assert "goes on and off with that period" in alone.advice
