"""Which effect is named where a pattern remains, on made-up evidence: beyond chance, before rivals, twice, one after the other."""

from types import SimpleNamespace

import numpy as np
import pytest

from thermofast.discovery.wording import _rounded
from thermofast.models.effects.base import Choice
from thermofast.models.joint import RATE, Key
from thermofast.models.search import candidates, dominant
from thermofast.models.search.dominant import RunEvidence, Stage, Weighed


def _run(evidence=200.0, had=100.0, left=5.0, ok=True, near=True, gain=50.0, physical=True, distant=False, name="load"):
    """Evidence of one run for an effect."""
    fit = SimpleNamespace(physical=physical, distant_surroundings=distant, name=f"fit of {name}")
    effect = SimpleNamespace(id=name, event="", again=True)
    known = SimpleNamespace(ok=ok, near=near)
    candidate = SimpleNamespace(parts=[SimpleNamespace(effect=effect, id=name)], gain=gain, fit=fit, identifiable=known)
    return RunEvidence(candidate, evidence, 2, 3.0, had, left)


def _weighed(*runs, need=10.0, **more):
    return Weighed(runs or (_run(**more),), need, 0.01)


def test_what_is_weighed_is_summed_over_the_runs_that_show_it():
    """A share of nothing is nothing, and none is less than nothing or more than all."""
    first = _run(evidence=30.0, had=10.0, left=2.0, gain=5.0, name="a")
    both = _weighed(None, first, _run(evidence=12.0, had=6.0, left=2.0, gain=7.0, physical=False, distant=True))
    assert (both.evidence, both.gain, both.worth, both.share) == (42.0, 12.0, 32.0, 0.75)
    assert (both.physical, both.distant_surroundings) == (False, True)
    assert both.effect.id == "a"
    assert (_weighed(first).physical, _weighed(first).distant_surroundings) == (True, False)
    assert _weighed(had=0.0, left=1.0).share == 0.0
    assert _weighed(had=1.0, left=2.0).share == 0.0
    assert _weighed(had=1.0, left=-1.0).share == 1.0
    assert [s.candidate.fit.name for s in both.shown] == ["fit of a", "fit of load"]


@pytest.mark.parametrize(
    ("evidence", "more", "clear"),
    [
        (150.0, {}, True), (149.0, {}, False), (300.0, {"left": 20.0}, True), (299.0, {"left": 20.0}, False), (150.0, {"left": 10.0}, True),
        (299.0, {"left": 10.1}, False), (375.0, {"ok": False}, True), (374.0, {"ok": False}, False),
        (375.0, {"ok": False, "left": 20.0}, True), (1e9, {"ok": False, "near": False}, False),
    ],
)  # fmt: skip
def test_an_effect_is_clear_by_so_many_times_what_chance_gives(evidence, more, clear):
    """Fifteen times of 10; twice that below nine tenths of the misfit, two and a half times where it is doubtful."""
    assert _weighed(evidence=evidence, **more).clear(15.0) is clear


def test_evidence_of_less_than_a_hundred_is_never_clear():
    """However little chance gives; and one run that determines it is enough."""
    assert _weighed(evidence=100.0, need=1.0).clear(5.0)
    assert not _weighed(evidence=99.0, need=1.0).clear(5.0)
    assert _weighed(_run(80.0, ok=False, near=False), _run(80.0)).clear(15.0)


def test_a_stage_of_several_runs_and_of_one_of_them():
    """A run that does not show the effect keeps its model."""
    named, rival = _weighed(_run(name="a"), None), _weighed(None, _run(name="b"))
    stage = Stage(("base 0", "base 1"), named, rival)
    assert [getattr(f, "name", f) for f in stage.fits] == ["fit of a", "base 1"]
    assert stage.of_run(0).rival is None
    assert stage.of_run(0).before == ("base 0",)
    both = Stage(("base 0", "base 1"), _weighed(_run(name="a"), _run(name="c")), rival)
    assert both.of_run(1).named.shown[0].candidate.fit.name == "fit of c"
    assert both.of_run(1).rival.shown[0].candidate.fit.name == "fit of b"


def _decided(*weighed, beside=False):
    fits = [SimpleNamespace(model=SimpleNamespace(parts=["load"] if beside else []))]
    return dominant.decide(fits, sorted(weighed, key=lambda w: -w.worth))


def test_the_effect_of_most_worth_is_named_with_one_rival_at_most():
    """A rival has three quarters of its worth and 85 % of its gain, or leaves little more of the misfit."""
    best = _weighed(evidence=410.0)
    assert _decided(best).named is best
    assert _decided(best).rival is None
    assert _decided() is None
    as_good = _weighed(evidence=311.0)
    assert _decided(best, as_good).rival is as_good
    assert _decided(best, _weighed(evidence=309.0, left=7.0)).rival is None
    leaves = _weighed(evidence=250.0, left=6.2)
    assert _decided(best, leaves).rival is leaves
    assert _decided(best, _weighed(evidence=250.0, left=6.3)).rival is None
    assert _decided(best, _weighed(evidence=311.0, gain=42.0)).rival is None
    assert _decided(best, _weighed(evidence=311.0, gain=43.0)).rival is not None
    assert _decided(best, as_good, _weighed(evidence=320.0)) is None


def test_what_cannot_be_or_explains_less_than_a_quarter_is_no_effect():
    """Nor is one that is not clear; of a sound one with little less worth than the best, which is not, that is named."""
    assert _decided(_weighed(evidence=410.0, physical=False)) is None
    for left, named in ((75.0, True), (76.0, False)):
        assert (_decided(_weighed(evidence=410.0, left=left)) is not None) is named
    assert _decided(_weighed(evidence=99.0)) is None
    for evidence, named in ((470.0, True), (500.0, False)):
        doubtful = _weighed(evidence=evidence, ok=False, near=False)
        found = _decided(doubtful, _weighed(evidence=410.0))
        assert (found is not None) is named
        assert not named or (found.named.evidence, found.rival) == (410.0, doubtful)
    for evidence, named in ((80.0, False), (100.0, True)):
        assert (_decided(_weighed(evidence=evidence)) is not None) is named
    for need, named in ((51.0, True), (52.0, False)):
        assert (_decided(_weighed(evidence=410.0, need=need), beside=True) is not None) is named
        assert _decided(_weighed(evidence=410.0, need=need)) is not None


def test_a_room_that_is_far_away_is_no_rival_of_what_needs_none():
    """Where what needs none is sound."""
    best, far = _weighed(evidence=410.0), _weighed(evidence=420.0, distant=True)
    assert _decided(best, far).named is best
    assert _decided(best, far).rival is None
    assert _decided(_weighed(evidence=400.0, ok=False, near=False), far).named is far


def _foreseen(monkeypatch, size=1.0, typical=(0.9, 1.1), logged=True, parts=1, evidence=20.0, share=0.95, ok=True, machine=False):
    effect = SimpleNamespace(parameters=[SimpleNamespace(name="gain", typical=typical)], amplitude="gain", logged=logged)
    part = SimpleNamespace(effect=effect)
    fit = SimpleNamespace(values={Key(parts - 1, "gain"): size}, physical=True)
    single = SimpleNamespace(parts=[part] * parts, fit=fit, identifiable=SimpleNamespace(ok=ok))
    weighed = SimpleNamespace(share=share, evidence=evidence, need=20.0)
    monkeypatch.setattr(dominant, "weigh", lambda *_: [weighed])
    monkeypatch.setattr(dominant, "_of_the_machine", lambda *_: machine)
    found = dominant.foreseen("base", [single], 0.01)
    assert found is None or found == Stage(("base",), weighed, None)
    return found is not None


def test_a_logged_cause_of_the_usual_size_needs_no_more_than_chance_gives(monkeypatch):
    """Known to a quarter, as large as that in every sensor, nine tenths of the misfit; no thermometer of the machine."""
    assert _foreseen(monkeypatch)
    for size, named in ((0.73, True), (0.71, False), (1.37, True), (1.38, False)):
        assert _foreseen(monkeypatch, size) is named
        assert _foreseen(monkeypatch, np.array([1.0, size])) is named
    for wrong in (
        {"typical": None}, {"typical": (0.8, 1.01)}, {"logged": False}, {"parts": 2}, {"evidence": 19.9}, {"share": 0.89}, {"ok": False},
        {"machine": True},
    ):  # fmt: skip
        assert not _foreseen(monkeypatch, **wrong)
    assert _foreseen(monkeypatch, typical=(0.8, 1.0))
    assert _foreseen(monkeypatch, share=0.9)


class _Scales:
    """Evidence of pairs as they carry it."""

    def __init__(self, fit):
        self.fit = fit

    def evidence(self, candidate, part):
        return candidate.told


def _pair(name="load", gain=100.0, **more):
    told = _run(name=name, gain=gain, **more)
    told.candidate.told = told
    told.candidate.fit.gain = gain
    return told.candidate


def _twice(monkeypatch, pairs, weighed=(), decided=None, needed=True, tried=None):
    """The stage of a pair; of each effect one single and one pair, on one run."""
    monkeypatch.setattr(dominant, "_Scale", _Scales)
    monkeypatch.setattr(dominant, "once_more", lambda effect, parts: effect)
    monkeypatch.setattr(dominant, "in_order", lambda pair: pair)
    monkeypatch.setattr(dominant, "_each_needed", lambda *_: needed)
    monkeypatch.setattr(dominant, "likelihood_ratios", lambda before, after: np.array([after.gain]))
    monkeypatch.setattr(dominant, "try_all", lambda fits, effects, spread: [[pairs[effects[0].id]]])
    monkeypatch.setattr(dominant, "_weighed", lambda by_run, *_: None if by_run[0] is None else Weighed(tuple(by_run), 10.0, 0.0))
    singles = tried if tried is not None else [[_run(name=n).candidate] for n in pairs]
    return dominant._twice(["base"], list(weighed), singles, 0.01, map, decided)


def test_an_effect_that_acts_twice_is_named_where_no_single_one_does_as_well(monkeypatch):
    """Nor gains as much; each of the two is needed, and the pair is eight times beyond chance."""
    pair = _pair(evidence=400.0)
    found = _twice(monkeypatch, {"load": pair})
    assert found.named.shown[0].candidate is pair
    assert (found.rival, found.before) == (None, ("base",))
    assert found.named.by_run[0].places == 9.0
    assert _twice(monkeypatch, {"load": pair}, needed=False) is None
    assert _twice(monkeypatch, {"load": None}) is None
    assert _twice(monkeypatch, {"load": _pair(evidence=79.0)}) is None
    assert _twice(monkeypatch, {"load": _pair(evidence=400.0, physical=False)}) is None
    assert _twice(monkeypatch, {"load": pair}, [_weighed(evidence=341.0)]) is not None  # 0.85 of a worth of 390 is 331.5
    assert _twice(monkeypatch, {"load": pair}, [_weighed(evidence=342.0)]) is None
    assert _twice(monkeypatch, {"load": pair}, [_weighed(evidence=100.0, gain=85.0)]) is None
    assert _twice(monkeypatch, {"load": pair}, [_weighed(evidence=100.0, gain=84.0)]) is not None


def test_beside_a_single_effect_that_was_decided_for_another_pair_must_be_a_rival_ahead(monkeypatch):
    """Its own pair is left to the next stage; of two pairs that do as well the second is a rival."""
    pair, decided = _pair(evidence=400.0), Stage(("base",), _weighed(name="door"), None)
    for evidence, named in ((302.0, True), (303.0, False)):  # three quarters of 390 are 292.5
        assert (_twice(monkeypatch, {"load": pair}, [_weighed(evidence=evidence)], decided) is not None) is named
    assert _twice(monkeypatch, {"load": pair}, decided=Stage(("base",), _weighed(name="load"), None)) is None
    for evidence, gain, rival in ((303.0, 100.0, True), (302.0, 100.0, False), (303.0, 85.0, True), (303.0, 84.0, False)):
        found = _twice(monkeypatch, {"load": pair, "door": _pair("door", gain, evidence=evidence)})
        assert found.named.shown[0].candidate is pair
        assert (found.rival is not None) is rival
    once = _run(name="load").candidate
    once.parts[0].effect.again = False
    assert _twice(monkeypatch, {"load": pair}, tried=[[once]]) is None
    assert _twice(monkeypatch, {"load": pair}, tried=[[None]]) is None


def _explained(monkeypatch, decisions, p=0.0, first=None, most=4):
    """Names of the stages where so many decisions are taken one after the other."""
    left = list(decisions)
    monkeypatch.setattr(dominant, "weigh", lambda *_: [])
    monkeypatch.setattr(dominant, "decide", lambda before, weighed: left.pop(0))
    monkeypatch.setattr(dominant, "_twice", lambda *_: None)
    monkeypatch.setattr(dominant, "try_all", lambda before, effects, spread: [])
    monkeypatch.setattr(dominant, "partners", lambda effects, parts: [])
    monkeypatch.setattr(dominant, "sensor_p_values", lambda fit: np.array([1.0]))
    values = iter(p) if isinstance(p, list) else None
    monkeypatch.setattr(dominant, "least_p", lambda floor: p if values is None else next(values))
    base = SimpleNamespace(model=SimpleNamespace(parts=[]))
    return [s.named.effect.id for s in dominant.explain([base], [], [], most=most, first=first)]


def test_effects_are_named_one_after_the_other_until_nothing_remains(monkeypatch):
    """Or none is found, or there are as many as a reader takes in; a first one that is known is kept."""
    stages = [Stage(("base",), _weighed(name=n), None) for n in "abcde"]
    assert _explained(monkeypatch, [None]) == []
    assert _explained(monkeypatch, [stages[0], None]) == ["a"]
    assert _explained(monkeypatch, stages) == ["a", "b", "c", "d"]
    assert _explained(monkeypatch, stages, most=2) == ["a", "b"]
    assert _explained(monkeypatch, stages, p=[0.0, 1e-3]) == ["a", "b"]
    assert _explained(monkeypatch, stages, p=[0.0, 0.9e-3, 1.1e-3]) == ["a", "b", "c"]
    assert _explained(monkeypatch, stages[1:], p=[1e-3], first=stages[0]) == ["a"]
    assert _explained(monkeypatch, [*stages[1:3], None], first=stages[0]) == ["a", "b", "c"]


def _fit(gain, physical=True, **values):
    return SimpleNamespace(gain=gain, physical=physical, values=values, rss=np.ones(2), noise=None)


@pytest.fixture
def fitted(monkeypatch):
    """Fits whose gains are told one after the other; what each began with is kept."""
    told, began = [], []

    def fit_model(run, parts, start, *more):
        began.append((parts[-1].choice.label, dict(start)))
        return told.pop(0)

    monkeypatch.setattr(candidates, "fit_model", fit_model)
    monkeypatch.setattr(candidates, "likelihood_ratios", lambda before, after: np.array([after.gain, 0.0]))
    monkeypatch.setattr(candidates, "sensor_p_values", lambda fit: np.array([0.0]))
    monkeypatch.setattr(candidates, "with_parts", lambda fit, parts: {"anew": 1.0, RATE: np.array([0.2, 0.4])})
    monkeypatch.setattr(candidates, "Part", lambda effect, choice, *who: SimpleNamespace(effect=effect, choice=choice))
    monkeypatch.setattr(candidates, "replace", lambda of, **new: type(of)(**{**vars(of), **new}))
    return told, began


def _elaborated(fitted, gains, choices, value=100.0, p=0.0, heat=None, changes_heat=False, monkeypatch=None, plain=None):
    told, began = fitted
    told[:], began[:] = [_fit(g) for g in gains], []
    monkeypatch.setattr(candidates, "least_p", lambda floor: p)
    plain = plain or Choice("plain", {}, simple=True)
    effect = SimpleNamespace(choices=lambda run: [plain, *choices], changes_heat=changes_heat, active=lambda choice: [1])
    before = SimpleNamespace(run=SimpleNamespace(heat=heat, sensors=2), model=SimpleNamespace(parts=[]))
    best = value, _fit(value), SimpleNamespace(effect=effect, choice=plain)
    found = candidates._elaborate(before, effect, best)
    return found[2].choice.label, [label for label, _ in began]


def test_a_less_simple_way_of_acting_must_gain_twelve_more(fitted, monkeypatch):
    """Where a pattern remains and the plain one gains at all; one that acts in another way begins anew, too."""
    cost = candidates.RULES.parameter_costs
    more = Choice("more", {}, simple=False)
    for gain, label in ((112.1 + cost, "more"), (111.9 + cost, "plain")):
        assert _elaborated(fitted, [gain], [more], monkeypatch=monkeypatch) == (label, ["more"])
    assert _elaborated(fitted, [], [more], p=1e-3, monkeypatch=monkeypatch) == ("plain", [])
    assert _elaborated(fitted, [], [more], value=11.9, monkeypatch=monkeypatch) == ("plain", [])
    assert _elaborated(fitted, [], [], monkeypatch=monkeypatch) == ("plain", [])
    other = Choice("other", {"shape": 1.0}, simple=False)
    assert _elaborated(fitted, [50.0, 150.0], [other], monkeypatch=monkeypatch) == ("other", ["other", "other"])
    assert _elaborated(fitted, [120.0 + cost, 125.0 + cost], [more, more], monkeypatch=monkeypatch)[1] == ["more", "more"]
    column = Choice("logged", {"column": "a"}, simple=True)
    ways = [Choice(f"of {c}", {"column": c}, simple=False) for c in "ab"]
    assert _elaborated(fitted, [0.0], ways, plain=column, monkeypatch=monkeypatch)[1] == ["of a"]


def test_beside_a_heat_that_varies_a_source_of_its_own_is_another_way(fitted, monkeypatch):
    """The plain way the other way round first, then the others so."""
    more = Choice("more", {}, simple=False)
    ways = _elaborated(fitted, [0.0] * 6, [more], heat=[1.0], changes_heat=True, monkeypatch=monkeypatch)[1]
    assert [w for k, w in enumerate(ways) if k == 0 or w != ways[k - 1]] == ["plain times the rest", "more"]
    assert _elaborated(fitted, [0.0], [more], changes_heat=True, monkeypatch=monkeypatch)[1] == ["more"]
    product = Choice("plain", {"product": True}, simple=True)
    ways = _elaborated(fitted, [0.0] * 6, [], heat=[1.0], changes_heat=True, plain=product, monkeypatch=monkeypatch)[1]
    assert ways == ["plain beside the rest"]


class _Links(Choice):
    """A choice in which each sensor is warmed by others, told by its label as 1-0: the first by 1, the second by 0."""

    def ends(self, sensor):
        return {int(self.label.split("-")[sensor])} - {sensor}


def _links(label):
    return _Links(label, by_sensor=("by",))


def _mutual(fitted, gains, ways, part="1-2-1", physical=True, everywhere=True):
    told, began = fitted
    told[:], began[:] = [_fit(g, physical) for g in gains], []
    key = Key(0, "coupling")
    effect = SimpleNamespace(choices=lambda run: [_links(w) for w in ways], amplitude="coupling", active=lambda choice: [])
    own = SimpleNamespace(effect=effect, choice=_links(part), concerns=lambda n: np.array([True, True, everywhere]))
    before = SimpleNamespace(run=SimpleNamespace(sensors=3), model=SimpleNamespace(parts=[]))
    fit = SimpleNamespace(values={key: np.array([0.01, 0.3]), RATE: np.array([0.2, 0.4])})
    found = candidates._mutual(before, effect, (100.0, fit, own))
    return found[2].choice.label, [start.get(key) for _, start in began]


def test_links_that_go_both_ways_take_the_place_of_those_that_do_not(fitted):
    """Within 16 of them, and the best of those that can really be; each from three starts, one of a strong coupling."""
    label, starts = _mutual(fitted, [84.5, 80.0, 84.2], ["1-0-2"])
    assert label == "1-0-2"
    assert [None if s is None else s.tolist() for s in starts] == [None, [0.1, 0.3], None]
    assert _mutual(fitted, [83.9, 83.9, 83.9], ["1-0-2"])[0] == "1-2-1"
    assert _mutual(fitted, [120.0] * 3, ["1-0-2"], physical=False)[0] == "1-2-1"
    assert _mutual(fitted, [85.0] * 3 + [90.0] * 3, ["1-0-2", "0-2-1"])[0] == "0-2-1"
    assert _mutual(fitted, [90.0] * 3 + [85.0] * 3, ["1-0-2", "0-2-1"])[0] == "1-0-2"
    assert _mutual(fitted, [], ["1-2-0"]) == ("1-2-1", [])
    assert _mutual(fitted, [], ["1-0-2"], part="0-2-1") == ("0-2-1", [])
    assert _mutual(fitted, [], ["1-0-2"], everywhere=False) == ("1-2-1", [])


def test_a_cause_of_one_sensor_is_tried_at_the_two_that_promise_most(monkeypatch):
    """At one for a quick look; the best candidate stands, over all ways of acting."""
    tried = []
    monkeypatch.setattr(candidates, "_from_other_rates", lambda *_: [])
    monkeypatch.setattr(candidates, "own_starts", lambda scans, effect, at: (scans[0], {}))
    monkeypatch.setattr(candidates, "with_parts", lambda *_: {})
    monkeypatch.setattr(candidates, "Part", lambda effect, choice, who: (choice, who.index(True), sum(who)))
    monkeypatch.setattr(
        candidates, "fit_model", lambda run, parts, start, prior, most: tried.append((parts[-1], most)) or parts[-1]
    )
    gains = {("a", 1): 5.0, ("a", 2): 7.0, ("b", 0): 6.0, ("b", 1): 6.5}
    monkeypatch.setattr(
        candidates, "_candidate", lambda before, fit, effect, part: SimpleNamespace(gain=gains[part[:2]], part=part)
    )
    before = SimpleNamespace(run=SimpleNamespace(sensors=3), model=SimpleNamespace(parts=[]))
    scans = [("a", np.array([1.0, 9.0, 5.0])), ("b", np.array([9.0, 2.0, 1.0]))]
    assert candidates._single(before, None, scans, False).part == ("a", 2, 1)
    assert [(part[:2], most) for part, most in tried] == [
        (k, candidates.MOST_ITERATIONS) for k in (("a", 1), ("a", 2), ("b", 0), ("b", 1))
    ]
    tried.clear()
    assert candidates._single(before, None, scans, True).part == ("b", 0, 1)
    assert [(part[:2], most) for part, most in tried] == [(k, candidates.RULES.quick) for k in (("a", 1), ("b", 0))]


def _shared(fitted, monkeypatch, gains, ways=1, quick=False, large=(), elsewhere=(), starts=5):
    told, began = fitted
    told[:], began[:] = [_fit(g, n=k) for k, g in enumerate(gains)], []
    asked = []
    monkeypatch.setattr(candidates, "shared_starts", lambda found, effect, at, most: asked.append(most) or [(1.0, {"s": k}) for k in range(min(most, starts))])  # fmt: skip
    monkeypatch.setattr(candidates, "_elaborate", lambda before, effect, best: best)
    monkeypatch.setattr(candidates, "scan", lambda *_: None)
    monkeypatch.setattr(candidates, "with_parts", lambda fit, parts: {RATE: 0.1, candidates.LEVEL: 30.0})
    monkeypatch.setattr(candidates, "_candidate", lambda before, after, effect, part: after)
    main = SimpleNamespace(null=1.0, share=True, name="size")
    effect = SimpleNamespace(
        large_starts=lambda: large, equivalent=lambda size, rate, level, sink: (rate * size, level + size), amplitude="size",
        active=lambda choice: [1], in_parts=False, event="", parameter=lambda name: main,
    )  # fmt: skip
    values = {RATE: 0.5, candidates.LEVEL: 50.0, candidates.START: 20.0}
    before = SimpleNamespace(
        run=SimpleNamespace(sensors=2, span=60.0), model=SimpleNamespace(parts=[], sink_guess=20.0),
        as_it_began=[SimpleNamespace(values=values) for _ in elsewhere],
    )  # fmt: skip
    found = candidates._shared(before, effect, [(Choice(f"way {k}"), None) for k in range(ways)], quick)
    return found.gain, [start for _, start in began], asked


def test_a_cause_of_all_sensors_is_followed_from_its_best_places(fitted, monkeypatch):
    """Three of them, one for a quick look or where there are many ways; also from a large size, and from where the fit began."""
    assert _shared(fitted, monkeypatch, [5.0, 9.0, 7.0])[0] == 9.0
    assert _shared(fitted, monkeypatch, [5.0], quick=True)[2] == [1]
    assert _shared(fitted, monkeypatch, [5.0] * 6, ways=2)[2] == [3, 3]
    assert _shared(fitted, monkeypatch, [5.0] * 3, ways=3)[2] == [1] * 3
    base = {RATE: 0.1, candidates.LEVEL: 30.0}
    _, starts, _ = _shared(fitted, monkeypatch, [5.0, 6.0], quick=True, large=[2.0])
    assert starts == [base | {"s": 0}, {"s": 0, Key(0, "size"): 2.0, RATE: 0.2, candidates.LEVEL: 32.0}]
    _, starts, _ = _shared(fitted, monkeypatch, [5.0, 6.0], quick=True, elsewhere=[1])
    assert starts[1] == {RATE: 0.5, candidates.LEVEL: 50.0, candidates.START: 20.0, "s": 0}


def test_a_search_that_went_astray_begins_again_at_nothing(fitted, monkeypatch):
    """At its null the model is the one before: it cannot be worse."""
    gain, starts, _ = _shared(fitted, monkeypatch, [-5.0, -0.1], quick=True)
    assert (gain, starts[1][Key(0, "size")]) == (-0.1, 60.0)
    assert _shared(fitted, monkeypatch, [-5.0, -6.0], quick=True)[0] == -5.0
    assert len(_shared(fitted, monkeypatch, [0.0], quick=True)[1]) == 1


def test_an_error_is_told_without_powers_of_ten():
    assert _rounded(157.2, 31.0) == "157 ± 30"
    assert _rounded(0.679, 0.081) == "0.679 ± 0.08"
    assert _rounded(2.0, 0.0) == "2"
