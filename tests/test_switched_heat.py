"""A heat that a logger tells in steps: when in its interval it was switched, and what changes it while it is off."""

import numpy as np
import pandas as pd
import pytest

import thermofast as tf
from benchmarks.analysis.thermal_constants import driven
from thermofast.models.effects import BUILT_IN
from thermofast.models.greybox import Key, Model, Part
from thermofast.models.joint import RATE, start_values
from thermofast.observing.observe import observe

STEP, COUNT = 0.5, 400
TIME = STEP * np.arange(COUNT)
POWER = np.where((TIME > 10.0) & (TIME < 110.0), 500.0, 0.0)
ENDINGS = (0.0, 1.0)


def heated(ending, rng, lags=(0.0, 0.0, 0.0), power=POWER, extra=None, noise=0.01):
    """A run of lumps whose heat is the power before each reading (ending 0) or at it (ending 1), read late by `lags` [min].

    The law of a lump under a heat that is held within an interval is exact: T' = gain heat - rate T. extra (N,) multiplies the heat.
    """
    mean = ending * power + (1.0 - ending) * np.append(power[:1], power[:-1])
    mean = mean * (1.0 if extra is None else extra)
    rows = {}
    for i, lag in enumerate(lags):
        rate, gain = 0.02 + 0.008 * i, 0.0012
        fall, curve = np.exp(-rate * STEP), np.zeros(COUNT)
        for k in range(1, COUNT):
            curve[k] = curve[k - 1] * fall + gain / rate * mean[k] * (1.0 - fall)
        late = np.interp(TIME - lag, TIME, curve)
        rows[f"T{i}"] = 20.0 + late + noise * rng.standard_normal(COUNT)
    return tf.read(pd.DataFrame({"time_min": TIME, **rows, "power_w": power}), inputs="power_w")


def ending_of(run):
    seen = observe(run, drive="power_w").seen
    plain = observe(run).seen
    return [e for e in (0.0, 0.5, 1.0) if np.array_equal(seen.heat, plain.driven_by("power_w", e).heat)], seen


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("seed", range(3))
def test_the_readings_tell_whether_a_column_is_held_or_tells_what_was(ending, seed):
    assert ending_of(heated(ending, np.random.default_rng(seed)))[0] == [ending]


@pytest.mark.parametrize("seed", [6079, 6116, 6472, 6536])
def test_where_the_law_leaves_no_pattern_the_whole_record_decides(seed):
    # About the largest jump alone, noise made these a column that is held, or one that tells what was.
    assert ending_of(driven(seed)[0])[0] == [0.5]


def test_a_probe_that_is_early_outvotes_two_that_are_late():
    # The late ones would put the switch an interval later; none can feel a heat before it is there.
    run = heated(1.0, np.random.default_rng(7), lags=(0.0, 0.6, 0.6))
    assert ending_of(run)[0] == [1.0]


def test_readings_about_few_jumps_do_not_count_and_about_many_they_do():
    few = ending_of(heated(0.0, np.random.default_rng(1)))[1]
    at = np.flatnonzero(np.diff(POWER))
    assert not few.used[:, np.concatenate([at, at + 1])].any()
    assert few.used.sum(axis=1).tolist() == [COUNT - 4] * 3
    often = np.where((TIME // 8.0) % 2 == 0, 500.0, 0.0)
    many = ending_of(heated(0.0, np.random.default_rng(1), power=often))[1]
    assert many.used.all()


def test_a_change_of_the_heat_is_off_when_the_heat_is_off():
    stronger = np.where(TIME > 60.0, 1.4, 1.0)
    run = heated(0.0, np.random.default_rng(3), extra=stronger, noise=0.02)
    record = tf.diagnose(run, drive="power_w")[0]
    assert record.verdict == "load_step", record.message
    assert record.parameters["load_step.change"]["value"] == pytest.approx(0.4, abs=0.03)
    assert record.parameters["load_step.event"]["value"] == pytest.approx(60.0, abs=1.0)


@pytest.mark.parametrize("name", ["load_step", "friction_decay", "cyclic_load"])
def test_no_change_of_a_logged_heat_heats_while_it_is_off(name):
    """Only the readings before the switch may tell of the change: afterwards the curve falls by the base law alone."""
    seen = observe(heated(0.0, np.random.default_rng(4)), drive="power_w").seen
    effect = next(e for e in BUILT_IN if e.id == name)()
    choice = next(c for c in effect.choices(seen) if not c.constants.get("column"))
    model = Model(seen, [Part(effect, choice)])
    values = {**start_values(seen), Key(0, effect.amplitude): 0.4}
    local, shared = model.vector(values)
    curve = model.forward(local, np.broadcast_to(shared, (3, len(shared))), np.arange(3))
    rate, sink = values[RATE][0], model.sink_guess
    fall = (curve[0, 399] - sink) / (curve[0, 300] - sink)
    assert fall == pytest.approx(np.exp(-rate * (TIME[399] - TIME[300])), rel=1e-6)


@pytest.mark.proof
def test_a_heat_that_follows_a_speed_late_and_to_a_power_is_told_with_both():
    rng = np.random.default_rng(17)
    speed = np.repeat(rng.uniform(1000.0, 6000.0, 20), 20)
    late = np.concatenate([np.full(12, speed[0]), speed[:-12]])  # 6 min
    run = heated(0.0, rng, power=500.0 * (late / 6000.0) ** 1.7)
    frame = pd.DataFrame({"time_min": TIME, **run.channels, "speed": speed})
    found = tf.diagnose(tf.read(frame, inputs="speed", units="C"), effects="load_step")
    for row in found.records:
        assert (row.verdict, row.status) == ("load_step", "ok")
        assert "(speed, to a power, later)" in row.message
        for name, truth in (("power", 1.7), ("delay", 6.0)):
            told = row.parameters[f"load_step.{name}"]
            assert abs(told["value"] - truth) < 3.0 * told["standard_error"] < 0.15 * truth + 0.2
    # Given as the drive it is found as the drive's own law, and identify counts it without being asked to look for effects.
    bound = tf.diagnose(tf.read(frame, inputs="speed", units="C"), effects="load_step", drive="speed")
    for row in bound.records:
        assert (row.verdict, row.status) == ("load_step", "ok")
        assert "(speed to the power 1 + change, later)" in row.message
        for name, truth in (("change", 0.7), ("delay", 6.0)):
            told = row.parameters[f"load_step.{name}"]
            assert abs(told["value"] - truth) < 3.0 * told["standard_error"] < 0.15 * truth + 0.2
    told = tf.identify(tf.read(frame, inputs="speed", units="C"), drive="speed")[0].message
    assert "the heat follows speed to the power 1.7" in told
    assert "delay 6" in told
