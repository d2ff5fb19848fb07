"""An effect that acts twice with constants of its own: two changes of the load, two hidden masses."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from benchmarks.discovery.acts_twice import changed_load, open_door
from thermofast.models.effects import BUILT_IN
from thermofast.models.greybox import Key, Part
from thermofast.models.search.candidates import partners
from thermofast.models.search.discover import discover_together
from thermofast.observing.observe import observe

TIME = np.arange(421.0)


def two_steps(seed):
    """(record, (times, changes)): exact lumps whose heat changes twice."""
    rng = np.random.default_rng(seed)
    when = rng.uniform(80.0, 160.0), rng.uniform(220.0, 320.0)
    change = [rng.uniform(0.15, 0.4) * rng.choice([-1.0, 1.0]) for _ in when]
    columns = {"time_min": TIME}
    for k in range(3):
        tau, rise = rng.uniform(30.0, 70.0), rng.uniform(6.0, 12.0)
        reading = 20.0 + rise * (1.0 - np.exp(-TIME / tau))
        for at, size in zip(when, change, strict=True):
            reading += size * rise * (1.0 - np.exp(-np.clip(TIME - at, 0.0, None) / tau))
        columns[f"T{k + 1}"] = reading + 0.02 * rng.standard_normal(len(TIME))
    return columns, (when, change)


def two_masses(seed):
    """A record of lumps with a fast and a slow hidden mass, by scipy's stiff solver."""
    rng = np.random.default_rng(seed)
    fast, slow = rng.uniform(0.03, 0.08), rng.uniform(0.003, 0.007)
    columns = {"time_min": TIME}
    for k in range(3):
        loss, to_fast, to_slow = 1.0 / rng.uniform(30.0, 60.0), rng.uniform(0.015, 0.04), rng.uniform(0.003, 0.009)
        heat = loss * rng.uniform(6.0, 12.0)

        def slope(_, y, heat=heat, loss=loss, to_fast=to_fast, to_slow=to_slow):
            body, one, two = y
            gives = [to_fast * (body - one), to_slow * (body - two)]
            return [heat - loss * (body - 20.0) - sum(gives), fast * (body - one), slow * (body - two)]

        solved = solve_ivp(slope, (0.0, TIME[-1]), [20.0] * 3, "LSODA", TIME, rtol=1e-10, atol=1e-10)
        columns[f"T{k + 1}"] = solved.y[0] + 0.02 * rng.standard_normal(len(TIME))
    return columns


def test_two_changes_of_the_load_are_both_found_in_their_order():
    columns, (when, change) = two_steps(1)
    told = tf.diagnose(tf.read(columns)).to_frame()
    assert set(told["verdict"]) == {"load_step+load_step.2"}
    assert set(told["status"]) == {"ok"}
    found = told["parameters"].iloc[0]
    for name, at, size in zip(("load_step", "load_step.2"), when, change, strict=True):
        assert found[f"{name}.event"]["value"] == pytest.approx(at, abs=1.0)
        assert found[f"{name}.change"]["value"] == pytest.approx(size, abs=0.02)


@pytest.mark.proof
def test_two_hidden_masses_are_told_the_fast_one_first_in_every_sensor():
    told = tf.diagnose(tf.read(two_masses(0))).to_frame()
    assert set(told["verdict"]) == {"second_mode+second_mode.2"}
    assert told["remaining_c"].max() < 0.02
    for numbers in told["parameters"]:
        assert numbers["second_mode.rate"]["value"] > 3.0 * numbers["second_mode.2.rate"]["value"]


def test_only_what_may_act_twice_is_looked_for_twice():
    twice = {kind.id for kind in BUILT_IN if kind.again}
    assert twice == {"second_mode", "load_step", "cooling_switch"}
    again = next(kind for kind in BUILT_IN if kind.id == "second_mode")().numbered(2)
    assert (again.id, type(again).id) == ("second_mode.2", "second_mode")


def test_each_of_a_kind_has_a_name_of_its_own():
    effects = [kind() for kind in BUILT_IN]
    load = next(e for e in effects if e.id == "load_step")
    names = [{e.id for e in partners(effects, [Part(e) for e in have])} for have in ([load], [load, load.numbered(2)])]
    assert "load_step.2" in names[0]
    assert "load_step.3" in names[1]
    assert not names[1] & {"load_step", "load_step.2"}
    # Named by the user, the second is no first of another kind.
    asked = [e.id for e in partners([load, load.numbered(2)], [Part(load), Part(load.numbered(2))])]
    assert asked == ["load_step.3"]


def in_stages(run):
    """What the search by stages, which looks for what matters on imperfect machines, says of a run."""
    return discover_together([observe(run).seen], [kind() for kind in BUILT_IN])[0]


@pytest.mark.proof
def test_two_changes_stand_out_of_a_machine_that_is_not_its_model():
    """A room that wanders and a load that flutters: one step alone explains no more than half the catalogue does."""
    columns, (when, _) = two_steps(2)
    rng = np.random.default_rng(2)
    room = np.cumsum(0.004 * rng.standard_normal(len(TIME)))
    columns |= {k: v + room + 0.03 * np.sin(TIME / 11.0) for k, v in columns.items() if k != "time_min"}
    found = in_stages(tf.read(columns))
    assert found.verdict == "load_step+load_step.2"
    assert found.named.fit.values[Key(0, "event")] == pytest.approx(when[0], abs=3.0)
    assert len(found.stages) == 1


@pytest.mark.proof
def test_two_changes_are_not_taken_for_an_effect_that_explains_much_by_itself():
    """Alone, friction that fades explains 97 % of this misfit and passes every rule; two changes explain all of it."""
    found = in_stages(tf.read(changed_load(np.random.default_rng(9006), imperfect=True)))
    assert found.verdict == "load_step+load_step.2"
    assert found.named.fit.rmse.max() < 0.03


@pytest.mark.proof
def test_a_door_that_was_open_for_a_while_is_a_cooling_that_changed_twice():
    told = tf.diagnose(open_door(np.random.default_rng(24003), imperfect=False), jobs=1)
    assert {r.verdict for r in told} == {"cooling_switch+cooling_switch.2"}
    found = told[0].parameters
    ratios = [found[f"{n}.ratio"]["value"] for n in ("cooling_switch", "cooling_switch.2")]
    assert ratios[0] > 1.2
    assert ratios[0] * ratios[1] == pytest.approx(1.0, abs=0.02)  # closed as it was before
    assert found["cooling_switch.event"]["value"] < found["cooling_switch.2.event"]["value"]


@pytest.mark.proof
def test_a_load_that_went_down_and_up_is_said_where_it_explains_a_door_as_well():
    told = tf.diagnose(open_door(np.random.default_rng(24001), imperfect=True), jobs=1)[0]
    assert told.verdict == "cooling_switch+cooling_switch.2"
    assert told.also_possible == ["load_step+load_step.2"]
    assert [step["or"] for step in told.explained] == told.also_possible
    assert "(or load_step+load_step.2)" in told.message
