"""Heat along a row of sensors, and a delay that follows a logged flow."""

import shlex
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import thermofast as tf
from benchmarks.discovery.row_and_flow import KINDS, cooled, judge, pipe, rod
from thermofast.discovery.stretches import steps_near
from thermofast.discovery.wording import _adding, _coolants
from thermofast.models.effects import BUILT_IN
from thermofast.observing.observe import observe
from thermofast.observing.task import LoopTask
from thermofast.reading_options import options_from, spoken

LONG = ("coolant", "one delay", "uneven row")


@pytest.mark.parametrize("kind", [pytest.param(k, marks=pytest.mark.proof) if k in LONG else k for k in KINDS])
def test_the_way_of_acting_and_its_number_are_found(kind):
    _, said, error = judge((kind, 1))
    assert said == "right"
    assert error < 0.05


@pytest.mark.parametrize(("seed", "pairs"), [(3000, False), (3002, True), (4020, False), (5015, False), (6013, True)])
def test_no_sensor_is_warmed_by_one_that_is_not_its_neighbour(seed, pairs):
    # Each of these told a wrong link while every sensor's neighbours were picked by its own fit alone, or after a short search.
    assert judge(("pairs" if pairs else "row", seed))[1] == "right"


@pytest.mark.proof
def test_links_go_both_ways_where_the_readings_hardly_tell():
    # A sensor that picked its neighbour by its own noise had one that it did not warm in turn; and the first start misleads.
    assert judge(("uneven row", 9113))[1] == "right"


@pytest.mark.parametrize("kind", ["row", pytest.param("uneven row", marks=pytest.mark.proof)])
def test_which_sensor_warms_which_is_told(kind, tmp_path):
    run, coupling = rod(1, kind)
    told = tf.diagnose(run)[0]
    names = list(run.channels)
    assert f"({names[0]} by {names[1]}, {names[1]} by {names[0]} and {names[2]}, " in told.message
    found = tf.improve(run, auto=True).model
    path = tmp_path / "rod.toml"
    found.save(path)
    again = tf.Model.load(path)
    # The same curve from the file as from the search.
    error = [r.rmse_fit_c for r in tf.compare(run, model=again)]
    assert max(error) < 0.012
    assert coupling > 0.0


@pytest.mark.proof
def test_a_delay_by_flow_is_the_machines_and_holds_at_another_flow():
    first, _ = pipe(5)
    other, _ = pipe(5, run=1)
    by_flow = tf.improve(first, auto=True).model
    assert by_flow.effects == ("transport_delay",)
    assert max(r.rmse_fit_c for r in tf.compare(other, model=by_flow)) < 0.025
    assert min(r.rmse_fit_c for r in tf.compare(other)) > 0.06


@pytest.mark.proof
def test_a_flow_that_stops_holds_what_is_in_the_pipe():
    time = np.linspace(0.0, 100.0, 201)
    flow = np.where((time > 40.0) & (time < 60.0), 0.0, 1.0)
    passed = np.minimum(time, 40.0) + np.maximum(time - 60.0, 0.0)
    left = np.interp(passed - 10.0, passed[(time <= 40) | (time >= 60)], time[(time <= 40) | (time >= 60)], left=0.0)
    reading = 20.0 - 10.0 * np.expm1(-left / 30.0) + 0.01 * np.random.default_rng(0).standard_normal(201)
    run = tf.read({"time_min": time, "T1": reading, "flow": flow}, inputs="flow")
    told = tf.diagnose(run)[0]
    assert told.verdict == "transport_delay"
    assert told.ranking[0]["acts"] == "flow"
    assert told.parameters["transport_delay.delay"]["value"] == pytest.approx(10.0, abs=0.6)


@pytest.mark.proof
def test_a_coolant_is_the_machines_and_holds_in_another_run():
    """Each sensor's coupling, and where it settles beside the coolant as it was last."""
    first, coupling = cooled(3)
    other, _ = cooled(3, run=1)
    model = tf.improve(first, auto=True).model
    assert model.effects == ("coolant_heat",)
    told = tf.diagnose(first)[0]
    assert told.parameters["coolant_heat.kappa"]["value"] == pytest.approx(coupling, rel=0.03)
    assert "a room that moves would look like" not in told.advice  # it is the coolant that is logged
    assert max(r.rmse_fit_c for r in tf.compare(other, model=model)) < 0.025
    assert min(r.rmse_fit_c for r in tf.compare(other)) > 0.04
    columns = {"time_min": other.time_s / 60.0, **other.channels, **other.inputs, **other.ambient}
    [row, *_] = tf.identify(tf.read(columns, ambient="room"), until=60.0, model=model, jobs=1)
    assert row.status == "unreadable"
    assert "needs the column 'coolant_degC'; found: coolant_degC read as a sensor; do: --inputs coolant_degC" in row.message


def test_a_coolant_read_as_a_sensor_is_pointed_out():
    run, _ = cooled(3)
    columns = {"time_min": run.time_s / 60.0, **run.channels, "coolant_degC": run.inputs["coolant_degC"]}
    seen = observe(tf.read(columns)).seen
    assert _coolants(seen) == ["if coolant_degC cools the machine, it is a condition of the test: --inputs coolant_degC"]
    spaced = replace(seen, channels=(*seen.channels[:-1], "coolant [°C]"))
    assert _coolants(spaced)[0].endswith("--inputs 'coolant [°C]'")
    assert _coolants(observe(run).seen) == []
    assert _coolants(seen.only(["coolant_degC"])) == []  # a chiller by itself


def test_a_temperature_that_is_logged_is_no_load():
    run, _ = cooled(3)
    power = {"power_W": 500.0 + 100.0 * (run.time_s > 6000.0)}
    columns = {"time_min": run.time_s / 60.0, **run.channels, **run.ambient, **run.inputs, **power}
    seen = observe(tf.read(columns, ambient="room", inputs=["coolant_degC", "power_W"])).seen
    assert seen.temperatures == ("coolant_degC",)
    acts = {kind.id: [c.constants.get("column", "") for c in kind().choices(seen)] for kind in BUILT_IN}
    assert set(acts["coolant_heat"]) == {"coolant_degC"}
    assert set(acts["ambient"]) == {"room"}
    assert "power_W" in acts["load_step"]
    assert all("coolant_degC" not in columns for name, columns in acts.items() if name != "coolant_heat")


@pytest.mark.proof
def test_a_hidden_coolant_is_simulated_with_its_column_and_found():
    made = tf.simulate(effects=["coolant_heat"], seed=4, sensors=3, duration=420)
    assert made.truth["inputs"] == ["coolant_degC"]
    told = tf.diagnose(made.run())[0]
    assert told.verdict == "coolant_heat"
    [hidden] = made.truth["effects"]
    assert told.parameters["coolant_heat.kappa"]["value"] == pytest.approx(hidden["parameters"]["kappa"]["T1"], rel=0.05)


def test_the_command_that_adds_an_effect_says_again_how_the_run_was_read():
    """The same readings go in: what was said of the file, of its stretch and of its heat, as a shell takes it."""
    given = {
        "inputs": "coolant [C]",
        "exclude": ["a, b", "c"],
        "delimiter": ";",
        "interval": 30,
        "rename": "T1=it's",
        "long": "p,q",
    }
    options = options_from({**given, "resistance": "1.84,21.5", "missing": "-99", "skip_footer": 2, "strict": True, "from_min": 5})
    again = spoken(options)
    words = shlex.split(again.replace("--missing=", "--missing ").replace("--strict", "--strict True"))
    told = dict(zip([w[2:].replace("-", "_") for w in words[::2]], words[1::2], strict=True))
    mended = {"interval_s": float(told.pop("interval")), "from_min": float(told.pop("from")), "strict": True}
    assert options_from({**told, **mended, "skip_footer": int(told["skip_footer"])}) == options
    run = tf.read({"time_s": 10.0 * np.arange(400.0), "T1": 20.0 + np.arange(400.0) / 99.0, "P [W]": np.ones(400)}, inputs="P [W]")
    task = LoopTask(replace(run, name="a run.csv"), 2.0, 60.5, drive="P [W]")
    part = SimpleNamespace(id="load_step", effect=SimpleNamespace(file="my effect.py"))
    wanted = "thermofast improve 'a run.csv' --inputs 'P [W]' --start 2 --until 60.5 --drive 'P [W]' --add load_step,load_step"
    assert _adding([part, part], task.again) == f"{wanted} --effect 'my effect.py' -o machine.toml"
    both = replace(task, together=("a run.csv", "b.csv"), start_min=0.0, until_min=None, drive=None)
    assert both.again == "'a run.csv' b.csv --together --inputs 'P [W]'"
    assert replace(task, run=replace(run, name="stdin")).again.startswith("RUN --inputs")


@pytest.mark.proof
def test_the_noise_of_a_room_that_stays_is_no_step():
    """Nor is a single reading, or a wave; a level that changes between two readings is."""
    run, _ = cooled(3)
    seen, rng = observe(run).seen, np.random.default_rng(1)
    count = len(seen.time)
    at = count // 2
    still = 22.0 + 0.02 * rng.standard_normal(count)
    spike = still + 1.0 * (np.arange(count) == at)
    wave = still + 0.3 * np.sin(np.arange(count) / 9.0)
    step = still + 0.5 * (np.arange(count) >= at)
    for column, steps in ((still, 0), (spike, 0), (wave, 0), (step, 1)):
        told = [w for k in range(count) for w in steps_near(replace(seen, ambient={"room": column}, inputs={}), seen.time[k])]
        assert len({*told}) == steps
    assert f"at {seen.time[at]:.4g} min" in told[0]
