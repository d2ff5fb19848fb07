"""In which order sets of effects are tried, bettered, weighed and named, with fits that carry their gain alone."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from thermofast.models.effects import BUILT_IN
from thermofast.models.search import candidates, discover, dominant, sets
from thermofast.models.search.judge import Identifiability


def _set(ids, gain, complexity=1, p=0.5, ok=True, physical=True, left=1.0):
    """A candidate that gains so much and leaves a misfit of such a power."""
    effects = [SimpleNamespace(id=i, number=1, mistaken_for=(), logged=False, again=False) for i in ids.split("+")]
    parts = [SimpleNamespace(id=e.id, effect=e, choice=SimpleNamespace(label="", rare=False)) for e in effects]
    fit = SimpleNamespace(
        gain=gain, complexity=complexity, physical=physical, left=left, values={}, model=SimpleNamespace(parts=parts)
    )
    found = SimpleNamespace(
        ids=tuple(ids.split("+")), fit=fit, own=gain, p=p, floor=np.array([p]), identifiable=Identifiability(ok)
    )
    found.parts, found.at_floor, found.gain = parts, p > 0.001, gain
    return found


@pytest.fixture
def base(monkeypatch):
    """The model before, and likelihood ratios by gain."""
    for module in (sets, discover, dominant):
        monkeypatch.setattr(module, "likelihood_ratios", lambda base, fit, careful=True: np.array([fit.gain, 0.0]))
        monkeypatch.setattr(module, "misfit_power", lambda fit: fit.left)
    run = SimpleNamespace(sensors=2)
    return SimpleNamespace(run=run, model=SimpleNamespace(parts=[]), gain=0.0, left=100.0, readings=np.array([1.0]))


def test_each_effect_of_a_set_is_looked_for_anew_until_it_gains_little(monkeypatch, base):
    """A better one takes its place, a worse one does not; a round that gains less than 20 is the last."""
    looked, better = [], iter([])

    def tried(held, effect):
        looked.append(effect.id)
        return next(better)

    monkeypatch.setattr(sets, "_held", lambda base, pair, without: None)
    monkeypatch.setattr(sets, "try_add", tried)
    first = _set("a+b", 100.0)
    better = iter([_set("a+b", 115.0), _set("a+b", 110.0)])
    assert sets._refined(base, first).fit.gain == 115.0
    assert looked == ["a", "b"]
    looked.clear()
    better = iter([_set("a+b", 119.0), _set("a+b", 130.0), _set("a+b", 131.0), None])
    assert sets._refined(base, first).fit.gain == 131.0
    assert looked == ["a", "b", "a"]  # b was looked for after all but the last of it
    looked.clear()
    better = iter([_set("a+b", 125.0), None])
    assert sets._refined(base, first, rounds=1).fit.gain == 125.0
    assert looked == ["a", "b"]


def test_a_set_without_each_of_its_effects_keeps_the_others(monkeypatch, base):
    """What the model had before it stays; gains are no less than nothing, and no chance is known."""
    monkeypatch.setattr(sets, "with_parts", lambda fit, parts: {})
    monkeypatch.setattr(
        sets,
        "fit_model",
        lambda run, parts, values: SimpleNamespace(gain=-1.0 if len(parts) > 2 else 5.0, ids=[p.id for p in parts]),
    )
    whole = _set("a+b+c", 9.0)
    base.model.parts = [whole.parts[0]]
    found = sets._with_one_less(base, whole)
    assert [c.fit.ids for c in found] == [["a", "c"], ["a", "b"]]
    assert (found[0].own.tolist(), found[0].p) == ([5.0, 0.0], 1.0)
    assert sets._of(base, SimpleNamespace(gain=-3.0)).own.tolist() == [0.0, 0.0]


def test_values_that_can_be_take_the_place_of_their_mirror_where_that_costs_nothing(monkeypatch):
    """Less than 9 of the likelihood ratio."""
    for loss, kept in ((8.9, False), (9.1, True)):
        wrong = _set("a+b", 0.0, physical=False)
        other = SimpleNamespace(gain=-loss, physical=True)
        monkeypatch.setattr(sets, "unmirrored", lambda fit, at, other=other: other if at == 1 else SimpleNamespace(gain=-99.0))
        monkeypatch.setattr(sets, "likelihood_ratios", lambda before, after: np.array([after.gain]))
        assert (sets._unmirrored(wrong).fit is wrong.fit) == kept
    right = _set("a", 0.0)
    assert sets._unmirrored(right) is right


def test_what_is_easily_mistaken_for_an_effect_is_tried_in_its_place(monkeypatch, base):
    """And whatever else came near in place of one; those that leave no pattern are rivals."""
    top, near, far = _set("a+b", 500.0), _set("a+c", 301.0), _set("b+c", 299.0)
    swapped, asked = _set("a+d", 320.0, p=0.001), []

    def mistaken(base, candidate, change):
        asked.append((change[0].id, change[1].id))
        return swapped if change[1].id == "d" else _set("b+e", 310.0)

    monkeypatch.setattr(sets, "_replaced", lambda base, top, effects, most, spread: [[near], [far]])
    monkeypatch.setattr(sets, "_mistaken", mistaken)
    monkeypatch.setattr(sets, "_refined", lambda base, c, rounds: c)
    effects = [SimpleNamespace(id=i, mistaken_for=m) for i, m in (("c", ()), ("d", ("b",)), ("e", ()), ("a", ("b",)))]
    top.parts[0].effect.mistaken_for = ("e",)
    found = sets._with_rivals(base, [top], effects, map)
    assert asked == [("a", "e"), ("b", "d")]
    assert [c.ids for c in found] == [("a", "b"), ("b", "e"), ("a", "c")]


def test_sets_that_a_round_bettered_are_looked_at_again_and_exchanged_where_not_sound(monkeypatch, base):
    """From 20 on; of the two best exchanges those within 200 of the best."""
    again, asked = [], []

    def refined(base, c, rounds=2):
        again.append((c.ids, rounds))
        return c

    def replaced(base, top, effects, most, spread):
        asked.append(top.ids)
        return [[_set("a+d", 301.0)], [_set("b+d", 299.0), _set("c+d", 280.0)]]

    monkeypatch.setattr(sets, "_refined", refined)
    monkeypatch.setattr(sets, "_replaced", replaced)
    grown = [_set("a+b", 500.0), _set("a+c", 419.0), _set("b+c", 100.0)]
    glanced = [_set("a+b", 480.0), _set("a+c", 400.0)]
    found = sets._improved(base, grown, glanced, [], map)
    assert again == [(("a", "b"), 1)]
    assert [c.fit.gain for c in found] == [500.0, 419.0, 100.0]
    assert asked == []
    grown[0] = _set("a+b", 500.0, p=0.01)
    again.clear()
    found = sets._improved(base, grown, glanced, [], map)
    assert again == [(("a", "b"), 1), (("a", "d"), 2)]
    assert [c.fit.gain for c in found] == [500.0, 419.0, 301.0, 100.0]


@pytest.fixture
def larger(monkeypatch, base):
    """Larger sets of pairs a+b and a+c: what is grown of them and what betters it are told beforehand."""
    told = SimpleNamespace(grown=[], improved=None, quick=[])
    monkeypatch.setattr(sets, "_grown", lambda base, best, effects, spread: list(told.grown))
    monkeypatch.setattr(sets, "_refined", lambda base, c, rounds: c)
    monkeypatch.setattr(sets, "_improved", lambda base, grown, glanced, effects, spread: told.improved or grown)
    monkeypatch.setattr(sets, "_with_rivals", lambda base, down, effects, spread: down)
    monkeypatch.setattr(sets, "_with_one_less", lambda base, c: told.quick)
    monkeypatch.setattr(sets, "of_needed_effects", lambda base, c, false_alarm, number: c)

    def found(pairs, sensors=2):
        base.run.sensors = sensors
        got = sets.larger_sets(base, pairs, [None] * 9, 0.01, map)
        return [c.ids for c in got.down], [c.ids for c in got.needed]

    told.found = found
    return told


def test_a_pair_grows_as_long_as_each_effect_takes_away_most_of_what_is_left(larger):
    """Six tenths may be left of much, 0.45 of less than a thirtieth of all; a set that is down ends it."""
    nothing, three = ([], []), ([("a", "b", "c")], [("a", "b", "c")])
    for had, left, found in ((10.0, 5.9, three), (10.0, 6.1, nothing), (2.9, 1.2, three), (2.9, 1.4, nothing), (3.1, 1.4, three)):
        larger.grown = [_set("a+b+c", 200.0, left=left)]
        assert larger.found([_set("a+b", 100.0, p=1e-4, left=had)]) == found
    larger.grown = []
    assert larger.found([_set("a+b", 100.0, p=1e-4, left=10.0)]) == nothing


def test_no_set_grows_of_one_sensor_nor_where_a_pair_will_do(larger):
    """A pair that leaves no pattern, whether or not it is determined, is the end of it; so is none."""
    larger.grown = [_set("a+b+c", 200.0, left=1.0)]
    pair = _set("a+b", 100.0, p=1e-4, left=10.0)
    assert larger.found([pair])[0] == [("a", "b", "c")]
    assert larger.found([pair], sensors=1)[0] == []
    assert larger.found([pair, _set("a+c", 50.0, left=9.0)])[0] == []
    assert larger.found([_set("a+b", 100.0, ok=False, left=10.0)])[0] == []
    assert larger.found([])[0] == []


def test_a_set_that_is_not_determined_may_have_a_neighbour_that_is(larger):
    """One with an effect less, or another in the place of one; else no more are added."""
    pair = _set("a+b", 100.0, p=1e-4, left=10.0)
    larger.grown = [_set("a+b+c", 200.0, ok=False, left=1.0)]
    assert larger.found([pair])[0] == []
    larger.quick = [_set("b+c", 150.0)]
    assert larger.found([pair])[0] == [("b", "c")]


def test_a_fourth_effect_is_added_where_three_leave_a_pattern(larger):
    """And no fifth."""
    pair = _set("a+b", 100.0, p=1e-4, left=10.0)
    grown = iter([[_set("a+b+c", 200.0, p=1e-4, left=4.0)], [_set("a+b+c+d", 300.0, left=1.0)]])

    class Told(list):
        def __iter__(self):
            return iter(next(grown))

    larger.grown = Told()
    assert larger.found([pair])[0] == [("a", "b", "c", "d")]


@pytest.fixture
def search(monkeypatch, base):
    """A search of a run whose singles, pairs and verdicts are told beforehand."""
    told = SimpleNamespace(floor=1e-9, pairs=[], larger=(None, []), beats=True, first=None, ahead={}, ambiguous=False, asked=[])
    monkeypatch.setattr(discover, "fit_model", lambda run: base)
    monkeypatch.setattr(discover, "beside_shared", lambda fit: fit)
    monkeypatch.setattr(discover, "sensor_p_values", lambda fit: np.array([told.floor]))
    monkeypatch.setattr(discover, "try_add", lambda fit, effect: effect.single)
    monkeypatch.setattr(discover, "tried_pairs", lambda base, singles, effects, good, spread: told.asked.append(good) or told.pairs)
    monkeypatch.setattr(discover, "_arbitrary", lambda *_: told.ambiguous)
    monkeypatch.setattr(discover, "beats_disturbance", lambda *_: told.beats)
    monkeypatch.setattr(discover, "_several", lambda *_: told.larger)
    monkeypatch.setattr(discover, "foreseen", lambda *_: told.first)
    monkeypatch.setattr(discover, "in_order", lambda c: c)
    monkeypatch.setattr(discover, "held_out_errors", lambda fit: np.array([told.ahead.get(fit.gain, 1.0 / (1.0 + fit.gain))]))
    staged = SimpleNamespace(named=None, ahead_base=np.zeros(1), staged=True)
    monkeypatch.setattr(discover, "_in_stages", lambda *_: [staged])
    monkeypatch.setattr(discover, "_of_two", lambda *_: None)
    told.staged = staged

    def found(*singles, **more):
        effects = [SimpleNamespace(choices=lambda run: True, single=s) for s in singles]
        return discover.discover(SimpleNamespace(sensors=1), [*effects, SimpleNamespace(choices=lambda run: [])], **more)

    told.found = found
    return told


def _verdict(found):
    return "+".join(found.named.ids) if found.named else found.why, ["+".join(c.ids) for c in found.also]


def test_a_single_effect_that_passes_is_named(search):
    """It is rarer than a false alarm over all, leaves no pattern, is determined and can be."""
    good = {"p": 0.009, "gain": 100.0}
    search.floor = 0.5
    assert _verdict(search.found(_made("a", **good))) == ("a", [])
    for worse in ({"p": 0.011}, {"ok": False}, {"physical": False}, {"at_floor": False}):
        assert _verdict(search.found(_made("a", **(good | worse)))) == ("none", [])


def _made(ids, gain=100.0, p=1e-6, floor=0.5, at_floor=True, **more):
    found = _set(ids, gain, **more)
    found.p, found.at_floor, found.floor = p, at_floor, np.array([floor])
    return found


def test_pairs_are_tried_where_a_pattern_or_a_doubted_single_asks_for_them(search):
    """Singles that look like noise at 5 % are not doubted; a pair must beat the chance of all pairs and leave less of a pattern."""
    sound, doubted = _made("a"), _made("b", 90.0, floor=0.02)
    assert _verdict(search.found(sound, doubted))[0] == "a"
    assert search.asked == [[sound]]
    search.floor, search.asked[:] = 0.5, []
    search.found(_made("a", at_floor=False))
    assert search.asked == []
    search.floor = 1e-9
    lone = _made("a", at_floor=False)
    for p, floor, named in ((0.0032, 0.5, True), (0.0034, 0.5, False), (1e-6, 0.0051, True), (1e-6, 0.0049, False)):
        search.pairs = [_made("a+b", 200.0, p=p, floor=floor)]
        found = search.found(lone, _made("b", 5.0, at_floor=False))
        assert (found is not search.staged and found.named is search.pairs[0]) == named


def test_what_does_not_beat_a_disturbance_is_told_and_not_named(search):
    """Nor a pair that draws one sensor alone; larger sets are looked for then."""
    for change in ({"beats": False}, {"ambiguous": True}):
        vars(search).update({"beats": True, "ambiguous": False} | change)
        found = search.found(_made("a"))
        assert _verdict(found) == ("nothing fits", ["a"])
    larger, rival = _made("a+b+c", 300.0), _made("a+b+d", 299.0)
    search.larger = (larger, [rival])
    assert _verdict(search.found(_made("a"))) == ("a+b+c", ["a+b+d"])
    assert _verdict(search.found(_made("a"), most=1))[0] == "nothing fits"


def test_what_foretells_readings_left_out_no_better_is_not_named(search):
    """By the sum of squares over readings."""
    search.ahead = {0.0: 1.0, 100.0: 1.01}
    assert _verdict(search.found(_made("a"))) == ("the error on readings left out does not fall", ["a"])
    search.floor = 0.5
    assert _verdict(search.found(_made("a"))) == ("none", ["a"])
    search.ahead[100.0] = 0.99
    assert _verdict(search.found(_made("a")))[0] == "a"


def test_what_stages_name_stands_where_nothing_is_down_to_the_noise(search):
    """And a logged cause that was foreseen is the first of them, unless it is named anyway."""
    search.staged.named = _made("z")
    assert search.found(_made("a", at_floor=False)) is search.staged
    search.first = SimpleNamespace(named=SimpleNamespace(effect=SimpleNamespace(id="room")))
    assert search.found(_made("a")) is search.staged
    search.first.named.effect.id = "a"
    assert _verdict(search.found(_made("a")))[0] == "a"
    search.floor = 0.5
    assert _verdict(search.found(_made("a", at_floor=False)))[0] == "none"


def test_effects_are_named_one_after_the_other_until_nothing_is_left(monkeypatch):
    """Four at most; the search ends where a model is down to the noise, and where none is named."""

    def stage(name, p):
        fit = SimpleNamespace(p=p, model=SimpleNamespace(parts=[]))
        return SimpleNamespace(fits=(fit,), named=SimpleNamespace(shown=[SimpleNamespace(candidate=SimpleNamespace(parts=[name]))]))

    asked = []
    monkeypatch.setattr(dominant, "sensor_p_values", lambda fit: np.array([fit.p]))
    monkeypatch.setattr(dominant, "weigh", lambda before, tried, false_alarm: tried)
    monkeypatch.setattr(dominant, "decide", lambda before, weighed: weighed)
    monkeypatch.setattr(dominant, "_twice", lambda *_: None)
    monkeypatch.setattr(dominant, "partners", lambda effects, parts: asked.append(list(parts)))
    monkeypatch.setattr(dominant, "try_all", lambda before, effects, spread: next(coming))
    start = SimpleNamespace(model=SimpleNamespace(parts=["old"]))
    many = [stage(name, 1e-9) for name in "abcdef"]
    coming = iter(many[1:])
    assert [s.named.shown[0].candidate.parts for s in dominant.explain([start], many[0], [])] == [["a"], ["b"], ["c"], ["d"]]
    assert asked[1] == ["old", "a", "b"]
    coming = iter([stage("b", 0.5), stage("c", 1e-9)])
    assert len(dominant.explain([start], many[0], [])) == 2
    coming = iter([None])
    assert len(dominant.explain([start], many[0], [])) == 1
    coming, asked[:] = iter([many[1], None]), []
    assert len(dominant.explain([start], None, [], first=many[0])) == 2
    assert asked[0] == ["old", "a"]
    assert len(dominant.explain([start], None, [], first=stage("a", 0.5))) == 1
    assert candidates.RULES.most_effects == 4


def test_pairs_are_refined_where_they_come_near_to_the_noise(monkeypatch, base):
    """Of each two effects the larger promise; the three best are looked at with care, and what acts twice too."""
    refined, asked = [], []
    promises = {"a": [("b", 50.0), ("c", 40.0), ("a.2", 10.0)], "b": [("a", 60.0), ("d", 30.0)], "c": [("d", 20.0)]}

    def offers(base, effects, least, most, afar, root):
        name = root.model.parts[0].id
        asked.append((name, least, most, afar))
        told = [SimpleNamespace(id=i, number=2 if "." in i else 1) for i, _ in promises[name]]
        return [sets._Offer(p, root, e, []) for e, (_, p) in zip(told, promises[name], strict=True)]

    def taken(offer, quick):
        found = _set(f"{offer.root.model.parts[0].id}+{offer.effect.id}", offer.promised)
        found.parts[1].effect.number = offer.effect.number
        found.fit.far, found.quick = far, quick
        return found

    def again(base, pair):
        refined.append("+".join(pair.ids))
        return pair

    monkeypatch.setattr(sets, "_offers", offers)
    monkeypatch.setattr(sets, "_taken", taken)
    monkeypatch.setattr(sets, "_refined", again)
    monkeypatch.setattr(sets, "_as_logged", lambda base, effects: [])
    monkeypatch.setattr(sets, "_excess", lambda fit: fit.far)
    monkeypatch.setattr(sets, "_exchanged", lambda base, best, others, spread: [_set("x+y", 1.0)])
    monkeypatch.setattr(sets, "_needed", lambda pair, singles: pair)
    singles, far = [_set(i, 9.0) for i in "abc"], 1.9
    found = sets.tried_pairs(base, singles, [], [], map)
    assert [c.fit.gain for c in found] == [60.0, 40.0, 30.0, 20.0, 10.0, 1.0]
    assert refined == ["b+a", "a+c", "b+d", "a+a.2"]
    assert all(c.quick for c in found[:5])
    assert asked[0] == ("a", -1.0, 4, True)
    far = 2.1
    refined.clear()
    assert len(sets.tried_pairs(base, singles, [], [], map)) == 5
    assert refined == []
    asked.clear()
    far = 1.9
    found = sets.tried_pairs(base, singles, [], singles[:1], map)
    assert asked == [("a", 25.0, 4, True)]
    assert refined == []  # sound ones are left as they are
    assert not found[0].quick


def test_larger_sets_are_grown_from_the_best_root_that_offers_them(monkeypatch, base):
    """Those that promise most get a look, 24 of them."""
    roots = [_set("a+b", 90.0), _set("a+c", 80.0)]
    promises = {"a+b": [("c", 10.0), ("d", 30.0)], "a+c": [("b", 99.0), ("e", 20.0)]}

    def offers(base, effects, least, most, afar, root):
        name = "+".join(p.id for p in root.model.parts)
        return [sets._Offer(p, root, SimpleNamespace(id=i), []) for i, p in promises[name]]

    asked = []
    monkeypatch.setattr(sets, "_offers", offers)
    monkeypatch.setattr(sets, "_settled", lambda base, o: asked.append((o.effect.id, o.promised)) or _set(o.effect.id, o.promised))
    found = sets._grown(base, roots, [None] * 5, map)
    assert asked == [("d", 30.0), ("e", 20.0), ("c", 10.0)]
    assert [c.ids for c in found] == [("d",), ("e",), ("c",)]
    promises["a+b"] = [(str(k), float(k)) for k in range(30)]
    assert len(sets._grown(base, roots[:1], [None] * 5, map)) == 24


def test_each_effect_of_a_set_is_replaced_by_those_that_promise_most(monkeypatch, base):
    """What stands in the set is not tried; of each the best first."""
    whole = _set("a+b", 90.0)
    monkeypatch.setattr(sets, "_held", lambda base, c, without: without)
    monkeypatch.setattr(sets, "_offers", lambda base, others, least, most, afar, held: [(held, e.id) for e in others][:most])
    gains = {("a", "c"): 5.0, ("a", "d"): 9.0, ("b", "c"): 7.0}
    monkeypatch.setattr(sets, "_settled", lambda base, o: _set("+".join(o), gains[o]) if o in gains else None)
    found = sets._replaced(base, whole, [SimpleNamespace(id=i) for i in "abcd"], 2, map)
    assert [[c.ids for c in some] for some in found] == [[("a", "d"), ("a", "c")], [("b", "c")]]


@pytest.fixture
def of_two(monkeypatch, base):
    """Whether a pair takes the place of what was named one after the other, as all it must have is told."""
    told = SimpleNamespace(clear=True, before=100.0, ahead={}, singles=[_set("a", 90.0)], beyond=8.0, left=100.0)
    weighed = SimpleNamespace(clear=lambda beyond: told.clear and beyond == told.beyond, p=0.001)
    monkeypatch.setattr(discover, "beside_others", lambda *_: [weighed, weighed])
    monkeypatch.setattr(discover, "held_out_errors", lambda fit: np.array([told.ahead.get(fit.gain, 1.0)]))
    monkeypatch.setattr(discover, "weigh", lambda before, tried, false_alarm: [weighed])
    monkeypatch.setattr(discover, "in_order", lambda c: c)

    def found(*pairs):
        named = None if told.before is None else _set("z", told.before, left=told.left)
        before = SimpleNamespace(
            base=base, named=named, ahead=np.ones(1), ahead_base=np.ones(1), singles=told.singles, base_floor=None
        )
        got = discover._of_two(before, pairs, 9, 0.01)
        return None if got is None else (got.named.ids, [c.ids for c in got.also])

    told.found = found
    return told


def test_two_together_take_the_place_of_one_after_the_other_where_they_explain_far_more(of_two):
    """Half as much again, at least 100, and nine tenths of the misfit; each needed, and no third pair does as well."""
    two = (("a", "b"), [])
    assert of_two.found(_set("a+b", 151.0, left=9.9)) == two
    for wrong in ({"gain": 149.0}, {"left": 10.1}, {"ok": False}, {"physical": False}):
        assert of_two.found(_set("a+b", **({"gain": 151.0, "left": 9.9} | wrong))) is None
    of_two.before = None
    assert of_two.found(_set("a+b", 101.0, left=5.0)) == two
    assert of_two.found(_set("a+b", 99.0, left=5.0)) is None
    pairs = [_set("a+b", 200.0, left=5.0), _set("a+c", 171.0, left=5.0)]
    assert of_two.found(*pairs) == (("a", "b"), [("a", "c")])
    assert of_two.found(*pairs, _set("a+d", 171.0, left=5.0)) is None
    assert of_two.found(*pairs, _set("a+d", 169.0, left=5.0)) is not None
    assert of_two.found(*pairs[::-1]) == (("a", "b"), [("a", "c")])
    assert of_two.found() is None
    of_two.ahead[200.0] = 1.01
    assert of_two.found(*pairs) is None
    of_two.ahead[200.0], of_two.singles = 0.99, []
    assert of_two.found(*pairs) is None
    of_two.singles, of_two.clear = [_set("a", 90.0)], False
    assert of_two.found(*pairs) is None


def test_two_that_leave_a_tenth_of_what_each_single_one_leaves_need_not_explain_half_as_much_again(of_two):
    """Less evidence is asked for then, and rivals are those that leave up to three times as much; one of the two may be sure."""
    of_two.singles, of_two.beyond = [_set("a", 90.0, left=50.0), _set("z", 100.0, left=49.0)], 4.0
    assert of_two.found(_set("a+b", 130.0, left=4.9)) == (("a", "b"), [])
    assert of_two.found(_set("a+b", 130.0, left=4.91)) is None
    assert of_two.found(_set("a+b", 99.0, left=4.9)) is None
    pairs = [_set("a+b", 130.0, left=2.0), _set("a+c", 129.0, left=6.0), _set("a+d", 128.0, left=5.0)]
    assert of_two.found(*pairs) == (("a", "b"), [("a", "c"), ("a", "d")])
    assert of_two.found(*pairs, _set("d+c", 127.0, left=6.1)) == (("a", "b"), [("a", "c"), ("a", "d")])
    assert of_two.found(*pairs, _set("d+c", 127.0, left=5.9)) is None
    assert of_two.found(*pairs[:2], _set("b+a", 127.0, left=5.0)) == (("a", "b"), [("a", "c")])
    of_two.left = 19.9  # of what was named, as of two that were found one after the other
    assert of_two.found(*pairs) is None
    of_two.left = 20.0
    assert of_two.found(*pairs) is not None
    of_two.beyond = 8.0
    assert of_two.found(*pairs) is None


def test_a_pair_stands_behind_that_of_its_effects_which_is_there_by_itself(monkeypatch, of_two):
    """Of a slow mass alone nothing may be found: then it is the other one that was there first."""

    @dataclass(frozen=True)
    class Pair:
        fit: object
        ids: tuple = ("b", "a")

        @property
        def parts(self):
            return self.fit.model.parts

    asked = []

    def fitted(run, parts, values):
        asked.append([p.id for p in parts])
        return SimpleNamespace(model=SimpleNamespace(parts=parts))

    monkeypatch.setattr(discover, "fit_model", fitted)
    monkeypatch.setattr(discover, "with_parts", lambda fit, parts: {})
    base = SimpleNamespace(run=None)
    pair = Pair(_set("b+a", 1.0).fit)
    turned, first = discover._behind_a_single(base, pair, [_set("a", 90.0)])
    assert ([p.id for p in turned.parts], first.ids, asked) == (["a", "b"], ("a",), [["a", "b"]])
    assert discover._behind_a_single(base, pair, [_set("b", 9.0), _set("a", 90.0)])[1].ids == ("b",)
    assert discover._behind_a_single(base, pair, [_set("c", 9.0)]) == (pair, None)
    assert len(asked) == 1


def test_a_pair_is_not_named_around_one_effect_that_explains_nearly_all(base):
    """That leaves a thousandth of the misfit, gains 95 % of what the pair does, is no part of it, determined and possible."""
    pair = _made("a+b", 1000.0, left=0.01)
    near = {"left": 0.09, "at_floor": False}
    assert discover._roundabout(base, pair, [_made("a", 600.0, left=5.0), _made("c", 960.0, **near)])
    for other in (
        _made("c", 940.0, **near),
        _made("c", 960.0, **(near | {"left": 0.11})),
        _made("c", 960.0, **near, ok=False),
        _made("c", 960.0, **near, physical=False),
        _made("a", 960.0, **near),
    ):
        assert not discover._roundabout(base, pair, [other])
    assert not discover._roundabout(base, _made("a", 1000.0), [_made("c", 960.0, **near)])
    otherwise = _made("a", 960.0, **near)  # the same effect, that follows a column by another law
    otherwise.parts[0].choice.label = "u, to a power"
    assert discover._roundabout(base, pair, [otherwise])


def test_the_size_of_what_is_named_is_told_beside_the_best_pair_that_holds_it(base):
    """One that takes away half of what it leaves, and is determined and possible."""
    named = _made("a", 500.0, left=4.0)
    best, other = _made("a+b", 900.0, left=1.0), _made("a+c", 800.0, left=0.5)
    pairs = [other, _made("b+c", 990.0, left=0.1), best, _made("a+d", 950.0, left=2.1), _made("a+e", 950.0, left=0.1, ok=False)]
    assert discover._around(base, named, pairs) is best
    assert discover._around(base, named, [_made("a+d", 950.0, left=2.1), _made("a+e", 950.0, left=0.1, physical=False)]) is None


@pytest.mark.parametrize(
    ("ids", "once_more"), [("second_mode+sensor_drift", [("sensor_drift", "second_mode.2")]), ("cooling_switch+load_step", [])]
)
def test_a_slow_part_once_more_is_a_rival_of_what_it_is_mistaken_for_and_an_event_is_not(monkeypatch, base, ids, once_more):
    """Of a network of masses sensor_drift was named, and sure, for the second slow part of one sensor; two events draw a third."""
    kinds, asked = {kind.id: kind() for kind in BUILT_IN}, []
    top = _set(ids, 500.0)
    for part in top.parts:
        part.effect = kinds[part.id]
    monkeypatch.setattr(sets, "_replaced", lambda *_: [])
    monkeypatch.setattr(sets, "_mistaken", lambda base, top, change: asked.append((change[0].id, change[1].id)))
    monkeypatch.setattr(sets, "_refined", lambda base, c, rounds: c)
    sets._with_rivals(base, [top], list(kinds.values()), map)
    assert len(asked) > len(once_more)
    assert [pair for pair in asked if ".2" in pair[1]] == once_more


def test_a_set_with_an_effect_once_more_alone_is_not_named(larger):
    twice = _set("a+c+b.2", 200.0, left=1.0)
    twice.parts[2].effect.number = 2
    larger.grown = [twice]
    assert larger.found([_set("a+b", 100.0, p=1e-4, left=10.0)]) == ([("a", "c", "b.2")], [])
    larger.grown = [_set("a+b+b.2", 200.0, left=1.0)]
    larger.grown[0].parts[2].effect.number = 2
    assert larger.found([_set("a+b", 100.0, p=1e-4, left=10.0)])[1] == [("a", "b", "b.2")]
