"""What every effect of the catalogue, and a user's own, must keep to."""

import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thermofast.models import Observations
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import LEVEL, RATE, START, Key, Model, Part, at_rates, fit_model
from thermofast.plugins.effects import load_effect

ROOT = Path(__file__).resolve().parents[1]
OWN = load_effect(str(ROOT / "sample_runs" / "my_effect.py"))
EFFECTS = [kind() for kind in BUILT_IN] + [OWN]
CATALOGUE = [
    "ambient",
    "second_mode",
    "load_step",
    "cooling_switch",
    "room_step",
    "sensor_lag",
    "transport_delay",
    "nonlinear_loss",
    "neighbour_heat",
    "cyclic_load",
    "friction_decay",
    "sensor_drift",
    "reading_jump",
    "coolant_heat",
]


def record(sensors=3, n=240, noise=0.02):
    rng = np.random.default_rng(3)
    time = np.arange(float(n))
    rate, rise = np.linspace(0.015, 0.03, sensors), np.linspace(4.0, 9.0, sensors)
    reading = 18.0 + rise[:, None] * (1.0 - np.exp(-rate[:, None] * time)) + noise * rng.standard_normal((sensors, n))
    room = 18.0 + 0.5 * np.sin(time / 60.0)
    names = tuple(f"T{i + 1}" for i in range(sensors))
    blank, coolant = np.ones_like(reading), {"coolant_degC": 15.0 + np.sin(time / 25.0)}
    sizes = np.full(sensors, noise), np.zeros(sensors)
    return Observations("run", names, time, reading, blank, *sizes, {"room": room}, coolant, temperatures=("coolant_degC",))


def record_for(effect):
    """A record on which an effect could act: with a logged room, or without one."""
    run = record()
    return run if effect.choices(run) else replace(run, ambient={})


def test_the_catalogue_is_what_the_manual_lists():
    assert [kind.id for kind in BUILT_IN] == CATALOGUE


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
class TestEveryEffect:
    def test_it_says_what_it_is(self, effect):
        for text in (effect.summary, effect.equation, effect.tell_tale):
            assert text
        assert effect.parameter(effect.amplitude).null is not None
        for other in effect.mistaken_for:
            assert other in CATALOGUE
        for p in effect.parameters:
            assert p.low < p.high
            assert p.low <= p.start <= p.high
            assert p.meaning
            assert p.unit

    def test_at_its_null_it_changes_nothing_and_beyond_it_something(self, effect):
        run = record_for(effect)
        plain = fit_model(run)
        part = Part(effect, effect.choices(run)[0])
        model = Model(run, [part])
        main = effect.parameter(effect.amplitude)
        scale = run.span if main.share else 1.0
        still = model.vector({**plain.values, (0, main.name): main.null * scale * np.ones(3 if main.each == "sensor" else ())})
        moved = model.vector({**plain.values, (0, main.name): main.start * scale * np.ones(3 if main.each == "sensor" else ())})
        rows = np.arange(3)
        curves = [m.forward(v[0], np.broadcast_to(v[1], (3, len(v[1]))), rows) for m, v in ((model, still), (model, moved))]
        assert curves[0] == pytest.approx(plain.curve, abs=1e-6)
        assert np.abs(curves[1] - plain.curve).max() > 1e-3

    def test_a_sensor_that_it_does_not_concern_keeps_its_curve(self, effect):
        if effect.scope == "run":
            pytest.skip("it concerns all")
        run = record_for(effect)
        plain = fit_model(run)
        model = Model(run, [Part(effect, effect.choices(run)[0], (True, False, False))])
        local, shared = model.vector(plain.values)
        curve = model.forward(local, np.broadcast_to(shared, (3, len(shared))), np.arange(3))
        assert curve[1:] == pytest.approx(plain.curve[1:], abs=1e-9)

    def test_its_derivatives_are_those_of_its_curve(self, effect):
        run = record_for(effect)
        model = Model(run, [Part(effect, effect.choices(run)[0])])
        local, shared = model.vector(fit_model(run).values)
        rows = np.arange(3)
        _, by_local, by_shared = model.with_jacobian(local, np.broadcast_to(shared, (3, len(shared))), rows)
        for j in range(local.shape[1] + len(shared)):
            step = 1e-4 * max(1e-3, abs(local[0, j] if j < local.shape[1] else shared[j - local.shape[1]]))
            sides = []
            for sign in (1.0, -1.0):
                at, together = local.copy(), shared.copy()
                if j < local.shape[1]:
                    at[:, j] += sign * step
                else:
                    together[j - local.shape[1]] += sign * step
                sides.append(model.forward(at, np.broadcast_to(together, (3, len(together))), rows))
            central = (sides[0] - sides[1]) / (2.0 * step)
            ours = (by_local if j < local.shape[1] else by_shared)[j if j < local.shape[1] else j - local.shape[1]]
            # Steps of an event lie between readings: there the curve has a corner.
            assert np.abs(ours - central).mean() < 0.02 * np.abs(central).max() + 1e-6

    def test_it_travels_to_a_worker(self, effect):
        if effect is OWN:
            pytest.skip("a worker loads the user's file itself")
        again = pickle.loads(pickle.dumps(effect))
        assert again.id == effect.id
        assert again.parameters == effect.parameters


def test_effects_add_up_in_either_order():
    run = record()
    kinds = {e.id: e for e in EFFECTS}
    parts = [Part(kinds[i], kinds[i].choices(run)[0]) for i in ("ambient", "second_mode", "sensor_lag")]
    curves = []
    for order in (parts, parts[::-1]):
        model = Model(run, order)
        local, shared = model.vector(fit_model(run).values)
        curves.append(model.forward(local, np.broadcast_to(shared, (3, len(shared))), np.arange(3)))
    assert curves[0] == pytest.approx(curves[1], abs=1e-12)


COLUMNS = {"rate", "event", "gain", "power", "duty", "exponent", "lag", "delay"}


def test_a_search_that_holds_what_is_shared_ends_with_all_derivatives():
    """On the way those by shared parameters are not worked out; at its end they are those of the model there."""
    run = record()
    step = next(kind() for kind in BUILT_IN if kind.id == "load_step")
    fit = fit_model(run, [Part(step, step.choices(run)[0])])
    held = at_rates(fit, 1.5 * fit.values[RATE])
    rows = np.arange(3)
    _, _, by_shared = fit.model.with_jacobian(held.local, np.broadcast_to(held.shared, (3, len(held.shared))), rows)
    assert np.abs(by_shared).max() > 1e-3
    assert held.by_shared == pytest.approx(by_shared, abs=1e-9)


def test_no_rule_asks_for_an_effect_or_a_parameter_by_name():
    ids = {kind.id for kind in BUILT_IN} - {"ambient"}  # that is a column's name too
    # Words that name columns and fields of the drive as well are left out.
    names = {p.name for kind in BUILT_IN for p in kind.parameters} - COLUMNS
    asked = re.compile("|".join(rf"[\"']{word}[\"']" for word in sorted(ids | names)))
    shell = ROOT / "thermofast_cli"
    folders = [ROOT / "models" / "search", *(shell / name for name in ("discovery", "machine", "pipeline", "analysis", "plugins"))]
    files = [ROOT / "models" / f"{name}.py" for name in ("joint", "greybox", "drive")]
    sources = [*files, *(f for folder in folders for f in folder.glob("*.py"))]
    assert len(sources) > 25
    assert {f"{s.name}: {found}" for s in sources for found in asked.findall(s.read_text())} == set()


def test_a_model_holds_parameters_by_name_and_cannot_be_changed():
    run = record()
    model = Model(run).freeze(RATE)
    assert not model.active[:, model.column(RATE)].any()
    assert model.active[:, model.column(LEVEL)].all()
    only = Model(run).only(LEVEL, START)
    assert only.active.sum() == 2 * run.sensors
    with pytest.raises(ValueError, match="read-only"):
        model.active[:, 0] = True
    fit = fit_model(run)
    assert fit.values[RATE] is not None
    assert fit.values[Key(-1, "start")] == pytest.approx(fit.values[START])
