"""diagnose --next: which run would settle what a record left open."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from thermofast.discovery.observe import observe
from thermofast.experiments.next_experiment import Experiment, causes, experiment_words, next_experiments, possible, simulated
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import fit_model
from thermofast.models.search.discover import discover

CATALOGUE = [effect() for effect in BUILT_IN]


def switched(path=None, ratio=1.02, noise=0.02, seed=1):
    """Two sensors whose load grows a little half-way, late in the rise: a changed loss would look nearly alike."""
    rng = np.random.default_rng(seed)
    time, rates, rises = np.arange(0.0, 241.0), np.array([0.02, 0.025]), np.array([8.0, 6.0])

    def law(t, y):
        return rates * (rises * (ratio if t >= 150.0 else 1.0) - y)

    curve = solve_ivp(law, (0.0, 240.0), [0.0, 0.0], t_eval=time, max_step=1.0).y
    readings = 20.0 + curve + noise * rng.standard_normal(curve.shape)
    data = {"time_min": time, "front": readings[0], "rear": readings[1]}
    if path is None:
        return tf.read(data)
    np.savetxt(path, np.array(list(data.values())).T, delimiter=",", header=",".join(data), comments="", fmt="%.4f")
    return path


def test_a_simulated_run_without_noise_is_the_model_in_that_experiment():
    time = np.arange(0.0, 121.0)
    curve = 20.0 + 10.0 * -np.expm1(-0.03 * time)
    seen = observe(tf.read({"time_min": time, "a": curve + 1e-6 * np.sin(7.0 * time)})).seen
    fit = fit_model(seen)
    quiet = np.random.default_rng(0)
    again, faster, cool, longer, *_ = possible(seen)
    assert simulated(fit, again, quiet).reading == pytest.approx(np.interp(seen.time, time, curve)[None], abs=1e-3)
    cooled = simulated(fit, cool, quiet)
    after = cooled.time > 121.0
    # With the heat off it falls to the surroundings at the same rate.
    late = cooled.time[after] - 120.0
    sink = fit.model.sink_guess
    assert sink == pytest.approx(20.0, abs=0.5)
    assert cooled.reading[0][after] == pytest.approx(sink + (curve[-1] - sink) * np.exp(-0.03 * late), abs=0.02)
    assert np.all(cooled.heat[after] == 0.0)
    assert len(simulated(fit, faster, quiet).time) == 4 * (len(seen.time) - 1) + 1
    assert simulated(fit, longer, quiet).span == pytest.approx(2.0 * seen.span, rel=0.02)


def test_a_run_is_proposed_that_parts_what_the_record_left_open():
    seen = observe(switched()).seen
    found = discover(seen, CATALOGUE)
    open_ = [c.ids for c in causes(found)]
    assert ("load_step",) in open_
    assert ("cooling_switch",) in open_
    told = next_experiments(found, CATALOGUE, draws=2)
    assert len(told) == len(possible(seen))
    assert "heat" in told[0].name
    once_more = next(e for e in told if e.effort == 1)
    assert told[0].share >= 0.5 > once_more.share


def test_words_propose_only_what_settles():
    again, cool = Experiment("the same run once more", 1, settled=1, runs=16), Experiment("a cool-down", 3, settled=15, runs=16)
    assert experiment_words([cool, again]) == (
        "next: a cool-down would settle it, in 15 of 16 simulated (the same run once more: 1)"
    )
    assert experiment_words([again, cool]).startswith("no run that was simulated settles it")
    assert experiment_words([]) == ""


def test_the_command_proposes_where_something_is_open_and_is_silent_elsewhere(tool, tmp_path):
    done = tool(
        "diagnose", switched(tmp_path / "open.csv"), "--next", "--effects", "load_step,cooling_switch", "--format", "json", "-q"
    )
    record = json.loads(done.out)["records"][0]
    assert {e["simulated"] for e in record["next_experiment"]} == {16}
    assert "next: " in record["advice"] or "no run that was simulated" in record["advice"]
    plain = tool("diagnose", "sample_runs/spindle.csv", "--channels", "T1,T2", "--next", "--format", "json", "-q")
    assert json.loads(plain.out)["records"][0]["next_experiment"] == []
    refused = tool("diagnose", "sample_runs/hidden.csv", "sample_runs/hidden_second_run.csv", "--next", "--together", "-q")
    assert refused.code == 2
    assert "--next looks at one run" in refused.err
