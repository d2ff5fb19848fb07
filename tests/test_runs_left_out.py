"""What runs that were left out say of effects (`improve --together --auto`): where no search names one, and where two do as well."""

from types import SimpleNamespace

import numpy as np
import pytest

import thermofast as tf
from thermofast.discovery import together
from thermofast.discovery.several import OneOf, ready_runs
from thermofast.discovery.together import _nearest, _or_instead, _stage, _swaps, _with
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import fit_model
from thermofast.models.search.candidates import try_add
from thermofast.observing.task import LoopTask
from thermofast.records import ImproveRecord

KINDS = {kind.id: kind for kind in BUILT_IN}


def run(number: int, load: float, slow: float) -> tf.Run:
    """Three sensors before a hidden mass six times as slow, `slow` of the rise in it; 20 mK."""
    rng = np.random.default_rng(90 + number)
    time = np.arange(0.0, 181.0)
    columns = {"time_min": time}
    for i, rise in enumerate((6.0, 8.0, 9.0)):
        law = (1.0 - slow) * -np.expm1(-time / 30.0) + slow * -np.expm1(-time / 180.0)
        columns[f"T{i}"] = 20.0 + load * rise * law + rng.normal(0.0, 0.02, len(time))
    return tf.read(columns, name=f"run {number}")


@pytest.fixture(scope="module")
def machine() -> list[OneOf]:
    return runs_of(0.3)


def runs_of(slow: float) -> list[OneOf]:
    runs, failed = ready_runs([LoopTask(run(k, load, slow)) for k, load in enumerate((1.0, 0.8))], ImproveRecord)
    assert not failed
    return runs


def searched(runs: list[OneOf], *ids: str, named: str = "", also: tuple[str, ...] = ()) -> list[SimpleNamespace]:
    """What a search would say of each run: the effects that it tried, what it named, and what does as well."""
    found = []
    for one in runs:
        base = fit_model(one.prepared.seen)
        singles = {i: try_add(base, KINDS[i]()) for i in ids}
        found.append(
            SimpleNamespace(
                base=base, singles=tuple(singles.values()), named=singles.get(named), also=tuple(singles[i] for i in also)
            )
        )
    return found


def base_of(runs: list[OneOf]):
    return _stage(runs, [fit_model(r.prepared.seen) for r in runs])


def test_what_no_search_names_is_taken_where_it_foretells_the_other_run(machine):
    base = base_of(machine)
    stages, told, as_good = _nearest(machine, base, searched(machine, "second_mode", "cyclic_load", "load_step"))
    assert [[p.id for p in s.fits[0].model.parts] for s in stages] == [["second_mode"]]
    assert "with second_mode the error on runs left out falls to" in told
    assert as_good == []
    left = [np.sqrt(np.nanmean(np.square(s.left_out))) for s in (base, stages[0])]
    assert left[1] < 0.25 * left[0]


def test_where_nothing_is_hidden_nothing_is_taken():
    law = runs_of(0.0)
    assert _nearest(law, base_of(law), searched(law, "second_mode", "nonlinear_loss")) == ([], "", [])


def test_an_event_and_what_befalls_one_sensor_are_not_taken_for_the_machines(machine):
    assert _nearest(machine, base_of(machine), searched(machine, "load_step", "sensor_drift", "reading_jump")) == ([], "", [])


def test_a_swap_is_what_every_run_that_names_something_leaves_open(machine):
    both = searched(machine, "second_mode", "friction_decay", "cyclic_load", named="second_mode", also=("friction_decay",))
    assert _swaps(both) == [(frozenset({"second_mode"}), frozenset({"friction_decay"}))]
    both[1].also = ()
    assert _swaps(both) == []
    both[1].named = None  # a run that names nothing leaves all as it is
    assert _swaps(both) == [(frozenset({"second_mode"}), frozenset({"friction_decay"}))]


def test_runs_left_out_part_causes_that_explain_each_run_as_well(machine):
    base = base_of(machine)
    known = {i: KINDS[i]() for i in ("second_mode", "cyclic_load")}
    right, wrong = ([base, _with(machine, base, known[i])] for i in known)
    there = [(frozenset({"second_mode"}), frozenset({"cyclic_load"}))]
    back = [(frozenset({"cyclic_load"}), frozenset({"second_mode"}))]
    assert _or_instead(machine, right, there, known) == (right, [("cyclic_load", False)])
    stages, others = _or_instead(machine, wrong, back, known)
    assert [p.id for p in stages[-1].fits[0].model.parts] == ["second_mode"]
    assert others == [("cyclic_load", False)]


def test_two_that_foretell_the_other_run_alike_stay_open(machine, monkeypatch):
    base = base_of(machine)
    known = {i: KINDS[i]() for i in ("second_mode", "friction_decay")}
    mine = [base, _with(machine, base, known["second_mode"])]
    monkeypatch.setattr(together, "_error", lambda stage: errors["+".join(p.id for p in stage.fits[0].model.parts)])
    errors = {"second_mode": 0.1, "friction_decay": 0.19}
    swap = [(frozenset({"second_mode"}), frozenset({"friction_decay"}))]
    assert _or_instead(machine, mine, swap, known) == (mine, [("friction_decay", True)])
    errors["friction_decay"] = 0.21  # more than twice the error
    assert _or_instead(machine, mine, swap, known) == (mine, [("friction_decay", False)])
    errors["friction_decay"] = 0.051  # better, and not by half
    assert _or_instead(machine, mine, swap, known) == (mine, [("friction_decay", True)])
    errors["friction_decay"] = 0.049
    stages, others = _or_instead(machine, mine, swap, known)
    assert [p.id for p in stages[-1].fits[0].model.parts] == ["friction_decay"]
    assert others == [("second_mode", False)]


def test_what_stands_beside_stays_where_a_cause_is_swapped(machine):
    """Also what no search named, as a room that is logged."""
    known = {i: KINDS[i]() for i in ("second_mode", "cyclic_load", "sensor_lag")}
    mine = [base_of(machine)]
    for i in ("sensor_lag", "cyclic_load"):
        mine.append(_with(machine, mine[-1], known[i]))
    stages, _ = _or_instead(
        machine, mine, [(frozenset({"cyclic_load"}), frozenset({"second_mode"}))], {"second_mode": known["second_mode"]}
    )
    assert [p.id for p in stages[-1].fits[0].model.parts] == ["sensor_lag", "second_mode"]


@pytest.mark.parametrize(
    ("friction", "effect", "said", "undecided"),
    [
        (0.19, "second_mode", "; as good: friction_decay: see thermofast diagnose", True),
        (0.5, "second_mode", "with friction_decay, which would explain each run as well, runs left out are foretold worse", False),
        (0.04, "friction_decay", "friction_decay, which explains each run as well, foretells runs left out far better", False),
    ],
)
def test_it_is_said_what_runs_left_out_decide(machine, monkeypatch, friction, effect, said, undecided):
    errors = {"": 1.0, "second_mode": 0.1, "friction_decay": friction}
    monkeypatch.setattr(together, "_error", lambda stage: errors["+".join(p.id for p in stage.fits[0].model.parts)])
    found = searched(machine, "second_mode", "friction_decay", named="second_mode", also=("friction_decay",))
    monkeypatch.setattr(together, "search_together", lambda runs, spread: SimpleNamespace(another="", discoveries=found))
    stopped, stages, own, open_ = together._auto(machine, base_of(machine), map)
    assert [p.id for p in stages[-1].fits[0].model.parts] == [effect]
    assert stopped.startswith("second_mode named in 2 of 2 runs")
    assert said in stopped
    assert (own, open_) == ({}, undecided)
