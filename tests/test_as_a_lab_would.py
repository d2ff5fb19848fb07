"""What an analyst of a lab met: models with effects in other commands, gauges set anew, and faults that no row told of."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from thermofast.analysis.sides import observed_run
from thermofast.displacements.report import _constants_apart
from thermofast.errors import UsageError
from thermofast.estimation.measured import measured_equilibria
from thermofast.experiments import planning
from thermofast.learning.past import rises_of_model
from thermofast.machine.learnt import as_learnt
from thermofast.models.displacement import Sample
from thermofast.reading.run import told_of_sensors


def linked(name, heat=1.0, loss=1.0, seed=0, step=3.0):
    """Three parts in a row, heated at the first, by scipy's ODE solver; a reading each three minutes, 20 mK."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 301.0, step)
    give, pass_on = loss * np.array([0.006, 0.006, 0.007]), (0.012, 0.010)

    def slope(_, y):
        to_next, on = pass_on[0] * (y[0] - y[1]), pass_on[1] * (y[1] - y[2])
        return np.array([0.6 * heat - to_next, to_next - on, on]) - give * y

    rise = solve_ivp(slope, (0.0, 300.0), np.zeros(3), t_eval=time, rtol=1e-8).y
    columns = {f"S{k}": 20.0 + row + rng.normal(0.0, 0.02, len(time)) for k, row in enumerate(rise)}
    return tf.read({"time_min": time, **columns}, name=name)


@pytest.fixture(scope="session")
def model():
    """Of two runs, with the heat that neighbours give: one of these links has a second neighbour, and the others have none."""
    found = tf.improve([linked("a", 1.0, seed=1), linked("b", 0.8, seed=2)], together=True, add=["neighbour_heat"]).model
    assert found.file.past is not None
    return replace(
        found, file=msgspec.structs.replace(found.file, past=msgspec.structs.replace(found.file.past, without_effects=False))
    )


def test_a_model_with_links_foretells_its_own_machine(model):
    """The limits by the links were nan where a sensor has no second neighbour, and every sensor was said not to move."""
    given = linked("c", 1.0, seed=3)
    seen = observed_run((given, 0.0))
    curve = as_learnt(model.file, seen, "c", "m.toml").reading
    assert np.isfinite(curve).all()
    assert curve[:, -1] == pytest.approx([values[-1] for values in given.channels.values()], rel=0.08)
    same = tf.changed(new=given, model=model)
    assert same.verdict == "nothing"
    lost = tf.changed(new=linked("d", 1.0, 1.4, seed=4), model=model)
    assert lost.verdict != "nothing"


def test_a_plan_takes_how_far_and_how_often_the_runs_of_a_model_with_effects_were_read(model, monkeypatch):
    """Its levels are what would come without the links: not what the machine does."""
    moved = [np.median(values[-5:]) - np.median(values[:3]) for values in linked("a", 1.0, seed=1).channels.values()]
    again = [np.median(values[-5:]) - np.median(values[:3]) for values in linked("b", 0.8, seed=2).channels.values()]
    assert list(rises_of_model(model).values()) == pytest.approx(0.5 * (np.array(moved) + again), abs=0.02)
    asked = []
    monkeypatch.setattr(planning, "plan", lambda design, *_: (asked.append(design), ([], []))[1])
    tf.plan(1.0, model=model)
    planned = asked[0]
    assert planned.rise_c == pytest.approx(np.median(list(rises_of_model(model).values())))
    assert planned.rises_c == pytest.approx(list(rises_of_model(model).values()))
    assert planned.interval_s == pytest.approx(180.0)
    assert planned.noise_c == pytest.approx(0.02, rel=0.15)
    # Of a record that the plan is like, that one tells.
    like = {"time_min": np.arange(0.0, 301.0), **linked("e", 1.0, seed=6, step=1.0).channels}
    tf.plan(1.0, model=model, like=like)
    assert asked[1].interval_s == pytest.approx(60.0)
    # Machines that cool, too.
    turned = [msgspec.structs.replace(s, moved_c=-s.moved_c) for s in model.file.past.shapes]
    past = msgspec.structs.replace(model.file.past, shapes=tuple(turned))
    assert rises_of_model(replace(model, file=msgspec.structs.replace(model.file, past=past))) == rises_of_model(model)
    # A file of before does not say so, and nothing is planned for a rise that is made up.
    shapes = [msgspec.structs.replace(s, moved_c=None, noise_c=None) for s in model.file.past.shapes]
    before = replace(
        model, file=msgspec.structs.replace(model.file, past=msgspec.structs.replace(model.file.past, shapes=tuple(shapes)))
    )
    assert rises_of_model(before) == {}
    with pytest.raises(UsageError, match="does not say how far its runs rose"):
        tf.plan(1.0, model=before)
    tf.plan(1.0, model=before, rise_c=7.0)
    assert (asked[2].noise_c, asked[2].rise_c) == (planning.Design().noise_c, 7.0)


def test_a_model_keeps_what_its_runs_did(model, tmp_path):
    model.save(tmp_path / "m.toml")
    assert rises_of_model(tf.Model.load(tmp_path / "m.toml")) == pytest.approx(rises_of_model(model), rel=1e-6)


def test_effects_that_do_not_tell_where_runs_end_are_no_reference(model):
    """identify takes the shape of such a model alone, of which nothing says how far a run rises."""
    doubted = msgspec.structs.replace(model.file, past=msgspec.structs.replace(model.file.past, without_effects=True))
    with pytest.raises(UsageError, match="do not tell where its own runs ended") as told:
        tf.changed(new=linked("c", seed=3), model=replace(model, file=doubted))
    assert "neighbour_heat" in str(told.value)


@pytest.mark.parametrize(("constants", "said"), [((7.0, -4.0, 3.0), True), ((0.6, -0.4, 0.2), False)])
def test_gauges_that_were_set_anew_in_each_run_are_told_of(constants, said):
    rng, time = np.random.default_rng(5), np.arange(0.0, 240.0)
    runs = []
    for k, constant in enumerate(constants):
        first, second = (rise * (0.8 + 0.2 * k) * -np.expm1(-time / tau) for rise, tau in ((9.0, 40.0), (4.0, 90.0)))
        growth = 2.0 * first + 1.0 * second + constant + rng.normal(0.0, 0.3, len(time))
        runs.append(tf.read({"time_min": time, "T1": 20.0 + first, "T2": 20.0 + second, "Z_um": growth}, name=f"r{k}"))
    message = tf.displacement(runs, together=True, methods="least_squares").records[0].message
    assert ("the runs differ by constants of up to 11 um: a gauge set anew in each?" in message) == said
    assert ("differ by constants" in message) == said


def test_runs_that_begin_at_nought_or_have_hardly_a_reading_are_not_said_to_differ_by_a_constant():
    """A gauge that was set anew shows it by its first reading; and constants of their own leave nothing of two readings a run."""
    rng, time = np.random.default_rng(5), np.arange(0.0, 240.0)
    rise = 9.0 * -np.expm1(-time / 40.0)
    runs = []
    for k, constant in enumerate((7.0, -4.0, 3.0)):
        growth = 2.0 * rise + np.where(time > 0.0, constant, 0.0) + np.where(time > 0.0, rng.normal(0.0, 0.3, len(time)), 0.0)
        runs.append(tf.read({"time_min": time, "T1": 20.0 + rise, "Z_um": growth}, name=f"r{k}"))
    assert "differ by constants" not in tf.displacement(runs, together=True, methods="least_squares").records[0].message
    few = Sample(rng.normal(size=(4, 2)), np.array([0.0, 1.0, 9.0, 7.0]), np.arange(4.0), np.array([0, 0, 1, 1]))
    assert _constants_apart(few, 2) == 0.0
    many = Sample(np.zeros((8, 1)), np.repeat([1.0, 6.0], 4) + 0.1 * rng.normal(size=8), np.arange(8.0), np.repeat([0, 1], 4))
    assert _constants_apart(many, 2) == pytest.approx(5.0, abs=0.3)
    little = replace(many, displacement=np.repeat([1.0, 1.2], 4) + np.tile([0.1, -0.1], 4))  # what is left is 0.7 of what was
    assert _constants_apart(little, 2) == 0.0


def test_what_was_said_of_one_sensor_stays_where_another_is_logged_twice():
    values = np.arange(40.0)
    run = tf.read({"time_min": values, "A": 20.0 + values, "B": 21.0 + values**2, "C": 21.0 + values**2}, name="r")
    told = told_of_sensors(replace(run, channel_notes={"A": "one reading left out", "C": "two left out"})).channel_notes
    assert told == {"A": "one reading left out", "C": "two left out; every reading is that of B: one sensor logged twice?"}


def test_a_displacement_without_a_unit_is_a_guess(tool, tmp_path):
    lines = [f"{k},{20 + 0.05 * k:.3f},{0.001 * k + 0.0001 * (k % 3):.5f}" for k in range(120)]
    for header, guessed in (("displacement Z", True), ("displacement Z [mm]", False), ("displacement_Z_um", False)):
        path = tmp_path / "z.csv"
        path.write_text("\n".join([f"time_min,T1 [degC],{header}", *lines]) + "\n")
        done = tool("displacement", path, "--strict")
        assert ("no unit of length, taken for um" in done.err) == guessed
        assert done.code == (2 if guessed else 0)


@pytest.mark.parametrize(("every", "told"), [(10, True), (30, False)])
def test_many_lines_without_readings_are_told_in_each_row(every, told, tool, tmp_path):
    rows = [f"{k},{20 + 8 * -np.expm1(-k / 30):.3f},{21 + 5 * -np.expm1(-k / 30):.3f}" for k in range(1, 121)]
    lines = [row if k % every else "ERR timeout;;" for k, row in enumerate(rows)]
    path = tmp_path / "e.csv"
    path.write_text("\n".join(["time_min,T1,T2", *lines]) + "\n")
    found = tf.identify(tf.read(path))
    assert not told or tf.read(path).guesses[-1].option == "look at them; line 12 is the first"
    assert all(("lines hold no readings and are left out" in r.message) == told for r in found)
    assert tool("identify", path, "--strict", "-q").code == (2 if told else 0)


def test_a_turning_point_is_no_equilibrium_of_one_to_which_heat_is_on_its_way():
    time, reading = np.arange(100.0), np.stack([30.0 - 5.0 * np.exp(-np.arange(100.0) / 8.0)] * 2)
    steady, settled = measured_equilibria(time, reading, behind=np.array([np.nan, -0.1]))
    assert np.isfinite([steady[0], settled[0]]).all()
    assert np.isnan([steady[1], settled[1]]).all()


def test_a_plan_knows_nothing_of_a_sensor_that_did_not_move(model, monkeypatch):
    first, *others = model.file.past.shapes
    past = msgspec.structs.replace(model.file.past, shapes=(msgspec.structs.replace(first, moved_c=None), *others))
    still, asked = replace(model, file=msgspec.structs.replace(model.file, past=past)), []
    monkeypatch.setattr(planning, "plan", lambda design, _t, _p, _a, told, *_: (asked.append((design, told)), ([], []))[1])
    tf.plan(1.0, model=still)
    [(design, told)] = asked
    assert list(told.shapes) == [s.channel for s in others]
    assert design.sensors == len(design.rises_c) == len(others)
