"""Models whose effects stand for something else: what they say of the machine's next run is not taken from them."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from thermofast.discovery import improve
from thermofast.learning.foretold import Foretold, with_rest
from thermofast.learning.past import knowledge, run_learnt_from
from thermofast.learning.rise import rises_of
from thermofast.models import Observations
from thermofast.models.effects import NeighbourHeat
from thermofast.models.imperfection import Past, Rest, SensorShape
from thermofast.models.joint import fit_model
from thermofast.models.search.candidates import try_add
from thermofast.observing.task import LoopTask

RISES, FAST, SLOW, PART = (30.0, 22.0, 15.0), 25.0, 250.0, 0.4
MINUTES = np.arange(0.0, 501.0, 1.0)


def _noisy(clean, seed):
    return np.round(clean + 0.03 * np.random.default_rng(seed).standard_normal(len(clean)), 2)


def _with_slow_part(load, seed, slow=SLOW, until=500.0):
    """Three sensors of which two fifths come as slowly as a column does."""
    minutes = np.arange(0.0, until + 1.0, 1.0)
    law = (1.0 - PART) * -np.expm1(-minutes / FAST) + PART * -np.expm1(-minutes / slow)
    columns = {f"T{i + 1}": _noisy(20.0 + load * rise * law, [seed, i]) for i, rise in enumerate(RISES)}
    return tf.read({"time_min": minutes, **columns}, name=f"run{seed}")


def _in_a_room(seed):
    """Three sensors in a logged room that becomes 2 K warmer over the run."""
    room, columns = np.linspace(0.0, 2.0, len(MINUTES)), {}
    for i, (rise, tau) in enumerate(zip(RISES, (45.0, 55.0, 65.0), strict=True)):
        slope = 2.0 / MINUTES[-1]
        follows = slope * (MINUTES + tau * np.expm1(-MINUTES / tau))  # the answer of one exponential to a ramp
        columns[f"T{i + 1}"] = _noisy(20.0 + rise * -np.expm1(-MINUTES / tau) + follows, [seed, i])
    return tf.read({"time_min": MINUTES, **columns, "ambient": _noisy(20.0 + room, [seed, 9])}, name=f"run{seed}")


def test_effects_that_miss_the_end_of_their_own_run_give_way_to_its_shape():
    improved = tf.improve(_with_slow_part(1.0, 1), add=["neighbour_heat"])
    assert improved.model.file.past.without_effects
    assert "from its first part these effects do not foretell the end of the very run" in improved[-1].message
    told = tf.identify(_with_slow_part(1.2, 2), until=60, model=improved.model)
    assert all("its effects are left out here" in r.message for r in told)
    assert all(r.steady_state_lo_c < 20.0 + 1.2 * rise < r.steady_state_hi_c for r, rise in zip(told, RISES, strict=True))


def test_effects_that_are_the_machine_stay():
    improved = tf.improve(_with_slow_part(1.0, 1), add=["second_mode"])
    assert not improved.model.file.past.without_effects
    assert "do not foretell" not in improved[-1].message
    told = tf.identify(_with_slow_part(1.2, 2), until=60, model=improved.model)
    for r, rise in zip(told, RISES, strict=True):
        assert r.steady_state_lo_c < 20.0 + 1.2 * rise < r.steady_state_hi_c
        assert r.steady_state_hi_c - r.steady_state_lo_c < 0.2 * rise


def test_effects_that_miss_it_by_less_widen_what_is_said_by_them(monkeypatch):
    by_itself = tf.improve(_with_slow_part(1.0, 1), add=["second_mode"]).model.file.past.factors
    monkeypatch.setattr(improve, "from_first_part", lambda *_: Foretold(False, 1.5))
    wider = tf.improve(_with_slow_part(1.0, 1), add=["second_mode"], jobs=1).model.file.past.factors
    assert np.array(wider) == pytest.approx(np.array(by_itself) * [1.0, 1.5], rel=1e-4)


def test_a_model_that_leaves_a_pattern_knows_no_more_of_the_end_than_its_readings():
    """Of a run that broke off long before its slow part had come: the limit of the next one is as open."""
    model = tf.improve(_with_slow_part(1.0, 1, 600.0, 240.0), add=["nonlinear_loss"]).model
    past = model.file.past
    assert past.unexplained == ("T1", "T2", "T3")
    assert all(s.rest for s in past.shapes)
    closed = tuple(msgspec.structs.replace(s, rest=()) for s in past.shapes)
    file = msgspec.structs.replace(model.file, past=msgspec.structs.replace(past, shapes=closed))
    first = _with_slow_part(1.2, 2, 600.0, 100.0)
    as_open, as_told = (tf.identify(first, model=m) for m in (model, replace(model, file=file)))
    for a, b in zip(as_open, as_told, strict=True):
        assert a.steady_state_c == pytest.approx(b.steady_state_c)
        assert a.steady_state_hi_c > b.steady_state_hi_c
        assert "what it was learnt from may have ended early" in a.message


def test_what_a_rest_says_in_time_constants_is_of_the_models_own_rates():
    shape = SensorShape(np.log(0.02), 0.1, np.zeros(1), np.eye(1), rest=Rest(0.1, 0.3, 2.0, 9.0, 4.0))
    own = replace(shape, log_rate=np.log(0.04), rest=None)
    found = with_rest(Past({"T1": own, "T2": own}, 1, unexplained=("T1",)), Past({"T1": shape, "T2": shape}, 1))
    assert found.shapes["T2"].rest is None
    assert found.shapes["T1"].rest == Rest(0.1, 0.3, pytest.approx(4.0), pytest.approx(18.0), pytest.approx(8.0))


@pytest.mark.parametrize(("effect", "left_out"), [("second_mode", True), ("ambient", False)])
def test_effects_learnt_beside_a_logged_room_that_moved_hold_its_part(effect, left_out):
    improved = tf.improve(_in_a_room(3), add=[effect])
    assert improved.model.file.past.without_effects is left_out
    assert ("the logged surroundings moved and are in none of these effects" in improved[-1].message) is left_out


def test_what_is_linked_may_go_slower_together():
    """Where the neighbours are slower than in the run learnt from, and where they were read last, they end higher."""
    time = np.arange(0.0, 61.0, 1.0)

    def slope(_, y):
        between = 0.03 * (y[0] - y[1])
        return [0.6 - (y[0] - 20.0) / 50.0 - between, 0.05 - (y[1] - 20.0) / 70.0 + between]

    body = solve_ivp(slope, (0.0, 60.0), [20.0, 20.0], t_eval=time, rtol=1e-9, atol=1e-9).y
    body = body + 0.02 * np.random.default_rng(4).standard_normal(body.shape)
    seen = Observations("run", ("T1", "T2"), time, body, np.ones((2, 61)), np.full(2, 0.02), np.zeros(2))
    found = try_add(fit_model(seen), NeighbourHeat())
    assert found is not None
    rises = [rises_of(found.fit, seen, stretch=size) for size in (0.0, 0.03, 0.06)]
    for channel in seen.channels:
        none, half, whole = (r[channel].doubt for r in rises)
        assert len(half) == len(whole) == len(none) + 1
        assert whole[: len(none)] == pytest.approx(none)
        assert half[-1, -1] > 0.0
        assert whole[-1, -1] == pytest.approx(2.0 * half[-1, -1], rel=0.1)
    # A sensor's own rate is open by itself: the warmer one is moved by way of the other alone, which is linked to it weakly.
    assert rises[2]["T1"].doubt[-1, -1] < 0.01
    assert run_learnt_from(found.fit).rises.keys() == set(seen.channels)


def test_the_rates_of_what_is_linked_scatter_together_in_another_run_alone():
    first, second = _with_slow_part(1.0, 1), _with_slow_part(1.2, 2)
    model = tf.improve(first, add=["neighbour_heat"], until=200).model
    file = msgspec.structs.replace(model.file, past=msgspec.structs.replace(model.file.past, without_effects=False))
    rows = []
    for run in (first, second):
        (told,) = knowledge(LoopTask(run, until_min=60.0, model=replace(model, file=file)))
        rows.append({len(rise.doubt) for rise in told.past.rises.values()})
    assert max(rows[1]) == max(rows[0]) + 1
