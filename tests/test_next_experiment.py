"""diagnose --next: which run would settle what a record left open."""

import json
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermofast as tf
from thermofast.experiments.next_experiment import (
    SEEN_RISE,
    Experiment,
    causes,
    experiment_words,
    next_experiments,
    possible,
    rises,
    simulated,
)
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import fit_model
from thermofast.models.search.discover import discover
from thermofast.observing.observe import observe

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
    again, faster, room, cool, half, longer, *_ = possible(seen)
    assert simulated(fit, again, quiet).reading == pytest.approx(np.interp(seen.time, time, curve)[None], abs=1e-3)
    cooled = simulated(fit, cool, quiet)
    after = cooled.time > 121.0
    # With the heat off it falls to the surroundings at the same rate.
    late = cooled.time[after] - 120.0
    sink = fit.model.sink_guess
    assert sink == pytest.approx(20.0, abs=0.5)
    assert cooled.reading[0][after] == pytest.approx(sink + (curve[-1] - sink) * np.exp(-0.03 * late), abs=0.02)
    assert np.all(cooled.heat[after] == 0.0)
    # At half the heat it settles half-way.
    slower = simulated(fit, half, quiet)
    limit = sink + 0.5 * (30.0 - sink)
    assert slower.reading[0][after] == pytest.approx(limit + (curve[-1] - limit) * np.exp(-0.03 * late), abs=0.02)
    assert np.all(slower.heat[after] == 0.5)
    assert len(simulated(fit, faster, quiet).time) == 4 * (len(seen.time) - 1) + 1
    assert simulated(fit, room, quiet).ambient["surroundings"] == pytest.approx(np.full(121, sink), abs=0.3)
    assert simulated(fit, longer, quiet).span == pytest.approx(2.0 * seen.span, rel=0.02)


@pytest.mark.proof
def test_a_run_is_proposed_that_parts_what_the_record_left_open():
    seen = observe(switched()).seen
    found = discover(seen, CATALOGUE)
    open_ = [c.ids for c in causes(found)]
    assert ("load_step",) in open_
    assert ("cooling_switch",) in open_
    told = next_experiments(found, CATALOGUE, draws=2)
    assert len(told) == len(possible(seen)) == 8
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


@pytest.fixture
def few_draws(monkeypatch):
    """Two simulated runs of each cause in place of eight: what the command makes of them is tried, not the shares."""
    monkeypatch.setattr("thermofast.discovery.diagnose.next_experiments", partial(next_experiments, draws=2))


@pytest.mark.proof
@pytest.mark.usefixtures("few_draws")
def test_the_command_proposes_where_something_is_open_and_is_silent_elsewhere(tool, tmp_path):
    done = tool(
        "diagnose", switched(tmp_path / "open.csv"), "--next", "--effects", "load_step,cooling_switch", "--format", "json", "-q"
    )
    record = json.loads(done.out)["records"][0]
    assert {e["simulated"] for e in record["next_experiment"]} == {4}
    assert "next: " in record["advice"] or "no run that was simulated" in record["advice"]
    plain = tool("diagnose", "sample_runs/spindle.csv", "--channels", "T1,T2", "--next", "--format", "json", "-q")
    record = json.loads(plain.out)["records"][0]
    assert record["next_experiment"] == []
    assert record["advice"].startswith("next: no two causes are open that another run would part")


def two_bodies(path, coupling, heated=(1.0, 1.0), seed=0):
    """Two bodies whose weak link is hardly told from a load that grows."""
    rng = np.random.default_rng(seed)
    time, loss, rise = np.arange(0.0, 241.0), np.array([0.0272, 0.0149]), np.array([10.1, 8.0])
    matrix = np.diag(-loss) + coupling * np.array([[-1.0, 1.0], [1.0, -1.0]])
    curve = solve_ivp(lambda t, y: loss * rise * heated + matrix @ y, (0.0, 240.0), [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-9).y
    readings = 20.0 + curve + 0.03 * rng.standard_normal(curve.shape)
    data = {"time_min": time, "spindle": readings[0], "housing": readings[1]}
    np.savetxt(path, np.array(list(data.values())).T, delimiter=",", header=",".join(data), comments="", fmt="%.4f")
    return path


@pytest.mark.proof
def test_heating_one_part_alone_tells_conduction_from_what_looks_like_it(tmp_path):
    seen = observe(tf.read(two_bodies(tmp_path / "run.csv", 0.0012, seed=3))).seen
    found = discover(seen, CATALOGUE)
    open_ = causes(found)
    assert {c.ids for c in open_} == {("neighbour_heat",), ("load_step",)}
    offer = next(e for e in possible(seen, open_) if e.heated is not None)
    assert offer.heated == 0
    assert "only the part of spindle is heated: by neighbour_heat housing rises" in offer.name
    told = next_experiments(found, CATALOGUE, draws=2)
    assert next(e for e in told if e.heated == 0).share == 1.0
    # So it is on the machine itself, by scipy's solver, and on one without the link.
    linked = observe(tf.read(two_bodies(tmp_path / "linked.csv", 0.0012, (1.0, 0.0)))).seen
    apart = observe(tf.read(two_bodies(tmp_path / "apart.csv", 0.0, (1.0, 0.0)))).seen
    assert rises(linked, 0)[1] > SEEN_RISE > rises(apart, 0)[1]


@pytest.mark.proof
@pytest.mark.usefixtures("few_draws")
def test_several_runs_together_are_asked_for_the_next_one_once(tool, tmp_path):
    runs = [switched(tmp_path / f"{n}.csv", 1.05, seed=n) for n in (1, 2)]
    done = tool("diagnose", *runs, "--together", "--next", "--effects", "load_step,cooling_switch", "--format", "json", "-q")
    records = json.loads(done.out)["records"]
    told = [r["next_experiment"] for r in records]
    assert all(t == told[0] for t in told)
    assert len(told[0]) == 8


def test_only_experiments_that_settled_most_are_simulated_on(monkeypatch):
    """Two runs of each cause by every experiment, six more by the three that settled most; the counts are those of all."""
    offers = [Experiment(f"run {k}", k) for k in range(1, 7)]
    asked = []

    def trial(item, **_):
        experiment, cause, draw = item
        asked.append((experiment.name, cause, draw))
        return experiment.effort in (2.0, 4.0, 5.0) and (experiment.effort != 5.0 or draw < 2)

    open_ = [SimpleNamespace(ids=(name,), fit=None) for name in "ab"]
    for name, made in {"causes": lambda _: open_, "possible": lambda *_: offers, "_trial": trial}.items():
        monkeypatch.setattr(f"thermofast.experiments.next_experiment.{name}", made)
    found = SimpleNamespace(base=SimpleNamespace(run=None))
    told = next_experiments(found, [])
    assert [(e.name, e.settled, e.runs) for e in told[:3]] == [("run 2", 16, 16), ("run 4", 16, 16), ("run 5", 4, 16)]
    assert {(e.settled, e.runs) for e in told[3:]} == {(0, 4)}
    assert len(asked) == len(set(asked)) == 6 * 4 + 3 * 12
    assert experiment_words(told) == "next: run 2 would settle it, in 16 of 16 simulated (run 1: 0 of 4)"
