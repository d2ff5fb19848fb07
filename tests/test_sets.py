"""Three and four effects at once: sets that leave no pattern, each effect needed beside the others."""

import importlib

import numpy as np

from benchmarks.dominant import runs_of
from benchmarks.proof import as_run
from benchmarks.several_effects import judge
from tests.machines import draw
from thermofast.discovery.observe import observe
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import fit_model
from thermofast.models.search.candidates import try_add
from thermofast.models.search.discover import discover
from thermofast.models.search.sets import larger_sets, of_needed

EFFECTS = {kind.id: kind for kind in BUILT_IN}


def candidate_of(seen, names):
    found = None
    for name in names:
        found = try_add(fit_model(seen) if found is None else found.fit, EFFECTS[name]())
    return found


def test_a_clear_set_is_named_whole():
    count, hidden, named, _, _ = judge((3, 50_009))
    assert len(hidden) == count
    assert named == hidden


def test_an_effect_that_is_not_needed_beside_the_others_is_left_out():
    hidden = ("ambient", "reading_jump")
    seen = observe(as_run(draw(hidden, np.random.default_rng(1), "clear"))).seen
    base = fit_model(seen)
    for more in ("sensor_drift", "load_step", "friction_decay"):
        kept = of_needed(base, candidate_of(seen, [*hidden, more]), 0.01, len(BUILT_IN))
        assert kept is not None
        assert set(kept.ids) == set(hidden)


def test_small_things_of_a_background_are_no_set():
    """Three of its own effects, each small, bring this machine down to the noise; none explains more than a disturbance would."""
    machine = importlib.import_module("benchmarks.machines.bar").simulate(930_009, 1.0, None, runs=1)
    seen = observe(runs_of(machine, 930_009)[0]).seen
    found = discover(seen, [kind() for kind in BUILT_IN])
    assert found.named is None or len(found.named.ids) < 3


def test_of_one_sensor_no_set_is_grown():
    seen = observe(as_run(draw(("load_step", "cyclic_load"), np.random.default_rng(1), "clear"))).seen
    one = seen.only(seen.channels[:1])
    base = fit_model(one)
    assert larger_sets(base, [try_add(base, EFFECTS["load_step"]())], [k() for k in BUILT_IN], 0.01, map) == []
