"""A cause that only some sensors share: the motor or the coolant of one part of the machine."""

import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from benchmarks.analysis.room_steps import record
from thermofast.models.effects import BUILT_IN
from thermofast.models.greybox import SINK, Key, Model, Part
from thermofast.models.joint import fit_model
from thermofast.models.search.candidates import places, trials, try_add
from thermofast.models.search.discover import _arbitrary
from thermofast.observing.observe import observe

TIME = np.arange(0.0, 361.0, 3.0)
EVENT = 150.0
LOAD, COOLING = (next(e() for e in BUILT_IN if e.id == name) for name in ("load_step", "cooling_switch"))


def in_parts(who, heat=0.0, loss=0.0, seed=3):
    """Exact lumps (scipy's solver), the heat or the loss of those of who (S,) changed from EVENT on."""
    rng = np.random.default_rng(seed)
    columns = {"time_min": TIME}
    for k, mine in enumerate(who):
        rate, rise = 1.0 / rng.uniform(30.0, 60.0), rng.uniform(6.0, 12.0)

        def slope(t, y, rate=rate, rise=rise, mine=mine):
            later = mine and t >= EVENT
            return [rate * (rise * (1.0 + heat * later) - (1.0 + loss * later) * (y[0] - 20.0))]

        body = solve_ivp(slope, (0.0, TIME[-1]), [20.0], "LSODA", TIME, rtol=1e-9, atol=1e-9, max_step=2.0).y[0]
        columns[f"T{k + 1}"] = body + 0.02 * rng.standard_normal(len(TIME))
    return columns


@pytest.mark.parametrize(
    ("effect", "size"), [("load_step", {"heat": 0.25}), pytest.param("cooling_switch", {"loss": 0.3}, marks=pytest.mark.proof)]
)
def test_a_change_of_one_part_is_named_in_its_sensors_alone(effect, size, tmp_path):
    run = tf.read(in_parts([False, True, False, True], **size))
    told = tf.diagnose(run).to_frame()
    assert told["verdict"].tolist() == ["none", effect, "none", effect]
    assert told["status"].tolist() == ["ok"] * 4
    assert "in T2, T4" in told["message"][1]
    assert not told["parameters"][0]
    found = told["parameters"][3]
    amplitude = "change" if effect == "load_step" else "ratio"
    (expected,) = size.values()
    assert found[f"{effect}.{amplitude}"]["value"] == pytest.approx(expected + (amplitude == "ratio"), abs=0.02)
    assert found[f"{effect}.event"]["value"] == pytest.approx(EVENT, abs=1.0)
    # The model keeps whom it concerns.
    path = tmp_path / "machine.toml"
    tf.improve(run, add=[effect]).model.save(str(path))
    assert tomllib.loads(path.read_text())["effects"][0]["channels"] == ["T2", "T4"]
    again = tf.compare(run, model=tf.Model.load(str(path))).to_frame()
    assert (again["rmse_fit_c"] < 0.025).all()


def test_a_change_of_all_stays_one_of_all():
    told = tf.diagnose(tf.read(in_parts([True, True, True], heat=0.25))).to_frame()
    assert told["verdict"].tolist() == ["load_step"] * 3
    assert "in all sensors" in told["message"][0]


def test_a_sensor_without_the_effect_runs_as_without_it():
    run = observe(tf.read(in_parts([False, True, True]))).seen
    values = {Key(0, "change"): 0.5, Key(0, "event"): EVENT}

    def curves(parts):
        model = Model(run, parts)
        local, shared = model.vector(values)
        return model.forward(local, np.tile(shared, (3, 1)), np.arange(3))

    way = LOAD.choices(run)[0]
    some, everywhere = curves([Part(LOAD, way, (False, True, True))]), curves([Part(LOAD, way)])
    assert np.array_equal(some[0], curves([])[0])
    assert np.array_equal(some[1:], everywhere[1:])
    assert np.abs(everywhere[0] - some[0]).max() > 1.0


def test_surroundings_are_searched_where_more_than_one_sensor_shares_the_cause():
    run = observe(tf.read(in_parts([False, True, True]))).seen
    for who, searched in (((False, True, False), False), ((False, True, True), True), (None, True)):
        keys = [c.key for c in Model(run, [Part(COOLING, COOLING.choices(run)[0], who)]).shared]
        assert (Key(-1, SINK.name) in keys) == searched


@pytest.mark.proof
def test_on_a_machine_that_is_not_its_model_a_change_of_one_part_is_told_where_it_is():
    table, _, event, who = record("heat", 1003, parts=True)
    told = tf.diagnose(tf.read(table)).to_frame()
    assert ["load_step" in verdict for verdict in told["verdict"]] == who.tolist()
    assert told["status"][2] == "model_doubtful"  # what remains there is not explained
    assert told["parameters"][int(np.argmax(who))]["load_step.event"]["value"] == pytest.approx(event, abs=6.0)


def test_a_neighbour_that_is_warmed_by_the_part_has_no_part_in_it():
    table, _, _, who = record("heat", 1005, parts=True)
    base = fit_model(observe(tf.read(table)).seen)
    found = try_add(base, LOAD)
    assert found.parts[-1].concerned == tuple(who.tolist()) == (False, True, False, False)
    # Where it acts was chosen among as many parts of so many sensors.
    assert places(found.parts[-1], base.run) == 4.0 * trials(LOAD, base.run)
    assert places(Part(LOAD, found.parts[-1].choice), base.run) == trials(LOAD, base.run)


def test_two_effects_of_one_sensor_draw_nearly_anything():
    """A load of all sensors stands for itself; one of a single sensor, beside another effect of that sensor, is no finding."""
    lag = SimpleNamespace(scope="sensor", event=None, id="sensor_lag")
    load = SimpleNamespace(scope="run", event=None, id="load")
    base = SimpleNamespace(model=SimpleNamespace(parts=()), run=SimpleNamespace(sensors=3))

    def pair(concerned):
        who = np.ones(3, dtype=bool) if concerned is None else np.array(concerned)
        parts = [SimpleNamespace(effect=lag, concerned=(True, False, False), concerns=lambda n: np.array([True, False, False]))]
        return SimpleNamespace(parts=[*parts, SimpleNamespace(effect=load, concerned=concerned, concerns=lambda n: who)])

    assert _arbitrary(base, pair((True, False, False)), [])
    assert not _arbitrary(base, pair(None), [])
