"""Rules that the search for effects decides by, on made-up fits: where it looks, what it keeps and what it names."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from thermofast.models.effects.base import Choice
from thermofast.models.joint import RATE, Key
from thermofast.models.search import candidates, discover, dominant, mutual, sets
from thermofast.models.search.judge import Identifiability
from thermofast.models.search.scan import Scan, own_starts


class _Link(SimpleNamespace):
    """A choice in which a sensor is warmed by others."""

    def ends(self, sensor):
        return self.by.get(sensor, set())


def test_a_link_is_completed_by_as_many_as_the_sensor_warms():
    """It keeps what warms it and adds what it warms: of those choices the fullest."""
    choices = [_Link(by={0: set(e)}) for e in ("1", "12", "13", "2", "123", "14")]
    for c in choices:
        c.by = {0: {int(k) for k in c.by[0]}}
    effect = SimpleNamespace(choices=lambda run: choices)
    fit = SimpleNamespace(run=SimpleNamespace(sensors=5))

    def fuller(by, who=(True,) * 5):
        part = SimpleNamespace(effect=effect, choice=_Link(by=by), concerns=lambda n: np.array(who))
        return [c.ends(0) for c in mutual._fuller(fit, part, 0)]

    assert fuller({0: {1}, 2: {0}}) == [{1, 2}]
    assert fuller({0: {1}, 2: {0}, 3: {0}}) == [{1, 2, 3}]
    assert fuller({0: {1}, 2: {0}}, (True, True, False, True, True)) == []
    assert fuller({0: {1}}) == []
    assert fuller({0: {1}, 1: {0}, 2: {3}}, (False, True, True, True, True)) == [{1}]


def test_places_are_counted_by_readings_and_by_choices_of_sensors():
    """Two, and one for every second time at which anything was read; of two in four sensors there are six choices."""
    run = SimpleNamespace(used=np.array([[True, False, False], [True, True, False]]), sensors=4)
    effect = SimpleNamespace(places=(2.0, 0.5), in_parts=True)
    assert candidates.trials(effect, run) == 3.0
    part = SimpleNamespace(effect=effect, concerns=lambda n: np.arange(n) < 2)
    assert candidates.places(part, run) == 18.0
    effect.in_parts = False
    assert candidates.places(part, run) == 3.0


class _Load:
    """An effect that may act again."""

    again = True

    def __init__(self, number=1):
        self.number, self.id = number, "load" if number == 1 else f"load.{number}"

    def numbered(self, number):
        return _Load(number)


def test_what_may_act_again_is_a_partner_once_more():
    """Under the next number; others that stand there are none, nor what was not asked for."""
    load, mass = _Load(), SimpleNamespace(id="mass", again=False, number=1)
    there = [SimpleNamespace(effect=load, id="load")]
    assert [e.id for e in candidates.partners([load, mass], there)] == ["mass", "load.2"]
    assert [e.id for e in candidates.partners([mass], there)] == ["mass"]
    both = [*there, SimpleNamespace(effect=_Load(2), id="load.2")]
    assert [e.id for e in candidates.partners([load, mass], both)] == ["mass", "load.3"]
    assert [e.id for e in candidates.partners([load, mass], [SimpleNamespace(effect=mass, id="mass")])] == ["load"]


def test_links_go_both_ways_where_each_neighbour_answers():
    """0 and 1 warm each other, 2 warms nobody."""
    assert mutual.go_both_ways([{1}, {0}, set()])
    assert not mutual.go_both_ways([{1}, set(), set()])
    assert not mutual.go_both_ways([{1}, {2}, {0}])


def test_the_best_three_looks_of_each_sensor_are_carried_on():
    """Over all ways of acting; one that did not end is none. Two sensors, three starts in two ways."""
    first = SimpleNamespace(rss=np.array([5.0, 1.0, 2.0, 9.0, np.nan, 8.0]))
    other = SimpleNamespace(rss=np.array([3.0, 2.0, 4.0, np.inf, 1.0, 7.0]))
    assert [rows.tolist() for rows in candidates._promising([first, other], 2)] == [[1, 2], [0, 1, 4, 5]]


def test_a_neighbour_that_answers_is_picked_among_those_that_fit_nearly_as_well():
    """Each fits the third best, which is warmed by nobody; within 16 of that the first two have each other, beyond it not."""
    third, each_other = _Link(by={0: {2}, 1: {2}}, by_sensor=("k",)), _Link(by={0: {1}, 1: {0}}, by_sensor=("k",))
    costs, dof = np.array([1.0, 1.0, 1.0]), np.full(3, 100.0)
    for behind, picked in ((15.0, each_other), (17.0, third)):
        worse = math.exp(behind / 100.0)
        looked = [
            (third, SimpleNamespace(rss=np.array([1.0, 1.0, 1.0]))),
            (each_other, SimpleNamespace(rss=np.array([worse, worse, 3.0]))),
        ]
        rows = [(third, looked[0][1], i) for i in range(3)]
        found = candidates._both_ways(looked, rows, costs, dof)
        assert found[1][0] is picked
    plain = SimpleNamespace(by_sensor=())
    assert candidates._both_ways([(plain, looked[0][1])], rows, costs, dof) == rows


def test_a_first_step_promises_what_the_scope_of_an_effect_shares(monkeypatch):
    """The sum of the sensors' best places, or the best of one sensor; a way that is not simple promises nothing."""
    gains = {"a": np.array([[1.0, 9.0], [4.0, 2.0]]), "b": np.array([[3.0, 3.0], [5.0, 1.0]])}
    monkeypatch.setattr(candidates, "scan", lambda fit, effect, choice: SimpleNamespace(gain=gains[choice.label]))
    choices = [Choice("a"), Choice("b"), Choice("c", simple=False)]
    effect = SimpleNamespace(choices=lambda run: choices, scope="sensor", event="")
    fit = SimpleNamespace(run=None, model=SimpleNamespace(parts=[]))
    assert candidates.first_order(fit, effect)[0] == 14.0
    effect.scope = "one"
    assert candidates.first_order(fit, effect)[0] == 9.0
    effect.scope = "run"
    monkeypatch.setattr(candidates, "shared_starts", lambda found, effect, at, most: [(found.gain.sum(), {})])
    assert candidates.first_order(fit, effect)[0] == 16.0
    assert candidates.first_order(fit, SimpleNamespace(choices=lambda run: choices[2:], scope="run")) == (0.0, [])


def test_each_sensor_starts_from_the_rate_at_which_least_is_left():
    """Costs 10 and 8; gains up to 6 and 5 from the one rate, 9 and 1 from the other, whose costs are 12 and 3."""

    def found(gain, cost, rate):
        fit = SimpleNamespace(values={key: rate * np.ones(2) for key in (RATE, Key(-1, "level"), Key(-1, "start"))})
        fit.values |= {key: rate * np.ones(2) for key in (candidates.LEVEL, candidates.START)}
        none = np.zeros(0)
        return Scan(
            [{"when": 1.0}, {"when": 2.0}],
            10.0 * rate * np.array([[1.0, 2.0], [3.0, 4.0]]),
            np.array(gain),
            none,
            none,
            none,
            np.array(cost),
            fit,
        )

    effect = SimpleNamespace(amplitude="size")
    scans = [found([[6.0, 1.0], [2.0, 5.0]], [10.0, 8.0], 1.0), found([[7.0, 1.0], [9.0, 0.0]], [12.0, 3.0], 2.0)]
    gains, values = own_starts(scans, effect, 0)
    assert gains.tolist() == [7.0, 6.0]  # 12 - 9 = 3 is less than 4, 3 - 1 = 2 less than 3
    assert values[Key(0, "size")].tolist() == [60.0, 40.0]
    assert values[Key(0, "when")].tolist() == [2.0, 1.0]
    assert values[RATE].tolist() == [2.0, 2.0]


def test_a_cause_of_one_part_takes_in_the_sensors_that_it_explains(monkeypatch):
    """It begins where it gains most, goes on to those of its sign, and each must lose three quarters of its squares by it."""
    monkeypatch.setattr(candidates, "sensor_p_values", lambda fit: np.full(3, 1e-9))
    monkeypatch.setattr(candidates, "with_parts", lambda fit, parts: {})
    monkeypatch.setattr(candidates, "likelihood_ratios", lambda before, fit: np.array([fit.gain]))
    gains, left = {}, {}

    def fitted(run, parts, *_):
        who = tuple(i for i in range(3) if parts[-1].concerned[i])
        tried.append(who)
        return SimpleNamespace(gain=gains[who], rss=np.array([left.get((who, i), 1.0) for i in range(3)]))

    monkeypatch.setattr(candidates, "fit_model", fitted)
    before = SimpleNamespace(run=SimpleNamespace(sensors=3), model=SimpleNamespace(parts=[]), rss=np.full(3, 100.0))
    parameter = SimpleNamespace(null=0.0)
    effect = SimpleNamespace(amplitude="size", parameter=lambda name: parameter, active=lambda choice: ("size", "when"))
    found = SimpleNamespace(gain=np.array([[70.0, 90.0, 80.0]]), amplitude=np.array([[1.0, 2.0, -3.0]]), points=[{"when": 5.0}])
    scans = [(Choice(), found), (Choice(), SimpleNamespace(gain=np.zeros((1, 3))))]

    def parted(value):
        tried.clear()
        best = candidates._in_part(before, effect, scans, (value, SimpleNamespace(), None))
        return None if best[2] is None else (best[0], best[2].concerned)

    tried = []
    gains |= {(1,): 100.0, (0, 1): 112.5}
    assert parted(75.0) == (100.5, (True, True, False))  # two parameters cost 12
    assert tried == [(1,), (0, 1)]
    assert parted(88.0) == (100.5, (True, True, False))
    assert parted(89.0) is None
    gains[0, 1] = 111.5
    assert parted(75.0) == (88.0, (False, True, False))
    gains[0, 1], left[(0, 1), 0] = 200.0, 25.5
    assert parted(75.0) == (88.0, (False, True, False))
    left[(0, 1), 0] = 24.5
    assert parted(75.0) == (188.0, (True, True, False))
    monkeypatch.setattr(candidates, "sensor_p_values", lambda fit: np.full(3, 0.5))
    assert parted(75.0) is None


def test_a_sensor_that_needs_an_effect_no_more_loses_it(monkeypatch):
    """Below four standard errors it is tried without, and gets it back where it loses more than 12 by that."""
    monkeypatch.setattr(candidates, "with_parts", lambda fit, parts: {})
    tried = []

    def fitted(run, parts, *_):
        tried.append(parts[-1].concerned)
        return SimpleNamespace(
            rss=after, dof=np.full(3, 100.0), values=fit.values, deviations=fit.deviations, run=run, model=fit.model
        )

    monkeypatch.setattr(candidates, "fit_model", fitted)
    parameter = SimpleNamespace(null=0.5, share=False)
    effect = SimpleNamespace(amplitude="size", parameter=lambda name: parameter)
    key = Key(0, "size")
    run, model = SimpleNamespace(sensors=3, span=2.0), SimpleNamespace(parts=[None])
    fit = SimpleNamespace(run=run, model=model, values={key: np.array([1.5, 0.89, -0.5])}, deviations={key: np.full(3, 0.1)})
    fit.rss = np.ones(3)
    part = candidates.Part(effect, Choice())
    for loss, kept in ((11.0, (True, False, True)), (13.0, (True, True, True))):
        after = np.exp(np.array([0.0, loss / 100.0, 0.0]))
        tried.clear()
        assert tuple(candidates._pruned(fit, part)[1].concerns(3)) == kept
        assert tried[0] == (True, False, True)
    fit.values[key] = np.array([1.5, 0.91, -0.5])
    tried.clear()
    assert candidates._pruned(fit, part)[0] is fit
    parameter.share, parameter.null = True, 0.45  # of two minutes: 0.9
    tried.clear()
    candidates._pruned(fit, part)
    assert tried[0] == (True, False, True)
    fit.values[key] = np.array([0.9, 0.92, 0.91])
    tried.clear()
    parameter.share, parameter.null = False, 0.9
    candidates._pruned(fit, part)
    assert tried[0] == (False, True, False)  # one is left: that which is farthest from nothing


def _set(ids, gain, complexity=1, p=0.5, ok=True, physical=True, parts=None):
    """A candidate that gains so much."""
    fit = SimpleNamespace(gain=gain, complexity=complexity, physical=physical)
    fit.model = SimpleNamespace(parts=parts or [])
    found = SimpleNamespace(
        ids=tuple(ids.split("+")), fit=fit, own=None, p=p, floor=np.array([p]), identifiable=Identifiability(ok)
    )
    plain = [SimpleNamespace(id=i, choice=SimpleNamespace(label="", rare=False)) for i in found.ids]
    found.parts, found.at_floor = parts or plain, p > 0.001
    return found


@pytest.fixture
def by_gain(monkeypatch):
    """Likelihood ratios of fits that carry their gain."""
    for module in (sets, discover, dominant):
        monkeypatch.setattr(module, "likelihood_ratios", lambda base, fit, careful=True: np.array([fit.gain, 0.0]))
    return SimpleNamespace(run=SimpleNamespace(sensors=2), model=SimpleNamespace(parts=[]), gain=0.0)


def test_of_one_set_the_best_stands_and_the_best_set_first(by_gain):
    """In whichever order its effects are named; none is no candidate."""
    many = [_set("a+b", 20.0), None, _set("b+a", 30.0), _set("c", 25.0)]
    assert [c.fit.gain for c in sets._distinct(by_gain, many)] == [30.0, 25.0]


def test_a_sound_set_looks_like_noise_is_determined_and_can_be(by_gain):
    """At 5 %, and at 1 % for one that is down to the noise, of one sensor twice its own p value."""
    assert sets._sound(_set("a", 1.0, p=0.026))
    assert not sets._sound(_set("a", 1.0, p=0.024))
    assert sets._down(_set("a", 1.0, p=0.0051))
    assert not sets._down(_set("a", 1.0, p=0.0049))
    for one in (_set("a", 1.0, ok=False), _set("a", 1.0, physical=False)):
        assert not sets._sound(one)
        assert not sets._down(one)
    assert sets._worth(by_gain, _set("a", 20.0, complexity=3)) == 14.0


def test_the_excess_is_that_of_the_worst_sensor():
    """In deviations of its noise."""
    fit = SimpleNamespace(rmse=np.array([0.3, 0.2]), run=SimpleNamespace(least_noise=np.array([0.1, 0.05])))
    assert sets._excess(fit) == pytest.approx(4.0)


def test_the_best_partners_are_offered_and_those_that_act_again(monkeypatch, by_gain):
    """By what a first step promises beside the root's own gain; afar those that begin at a large size, too."""

    def effect(name, number=1, scope="sensor", large=()):
        return SimpleNamespace(id=name, number=number, scope=scope, large_starts=lambda: large)

    effects = [
        effect("a"),
        effect("b"),
        effect("c", scope="run", large=(1.0,)),
        effect("d", 2),
        effect("e", large=(1.0,)),
        effect("f"),
    ]
    promise = {"a": 5.0, "b": 9.0, "c": 2.0, "d": 1.0, "e": 3.0, "f": 0.5}
    monkeypatch.setattr(sets, "partners", lambda effects, parts: effects)
    monkeypatch.setattr(sets, "first_order", lambda root, e: (promise[e.id], [None]))
    by_gain.gain = 100.0
    told = [[(o.effect.id, o.promised) for o in sets._offers(by_gain, effects, 0.5, 2, afar, by_gain)] for afar in (True, False)]
    assert told == [[("b", 109.0), ("a", 105.0), ("c", 102.0), ("d", 101.0)], [("b", 109.0), ("a", 105.0), ("d", 101.0)]]


def test_each_half_of_a_pair_is_needed_beside_the_other(monkeypatch, by_gain):
    """The chance is that of the less certain half; one that gains less than twice what is equal may be chance."""
    effect = SimpleNamespace(active=lambda choice: ("size",))
    a, b = (SimpleNamespace(id=i, effect=effect, choice=None, concerns=lambda n: np.array([True, False])) for i in "ab")
    pair, singles = _set("a+b", 0.0, parts=[a, b]), {"a": _set("a", 0.0), "b": _set("b", 0.0)}
    pair.fit.run = None
    gains = {id(singles["a"].fit): 40.0, id(singles["b"].fit): 30.0}
    monkeypatch.setattr(sets, "likelihood_ratios", lambda alone, both: np.array([gains[id(alone)], 50.0]))
    monkeypatch.setattr(sets, "places", lambda part, run: 1.0)
    monkeypatch.setattr(sets, "chance", lambda effect, own, free, places: 1.0 / own.sum())
    assert sets._needed(pair, singles).p == pytest.approx(1.0 / 30.0)
    gains[id(singles["b"].fit)] = 17.9
    assert sets._needed(pair, singles).p == 1.0
    gains[id(singles["b"].fit)] = 18.1
    assert sets._needed(pair, singles).p == pytest.approx(1.0 / 18.1)
    assert sets._needed(pair, {"b": singles["b"]}).p == pytest.approx(1.0 / 18.1)
    assert sets._needed(pair, {}).p == 0.0


def test_effects_that_explain_too_little_beside_the_others_are_left_out(monkeypatch, by_gain):
    """The least first, until each is five times chance; none where one remains or a pattern does."""
    evidence = {"a": 60.0, "b": 20.0, "c": 55.0}
    monkeypatch.setattr(
        sets,
        "beside_others",
        lambda base, c, *_: [SimpleNamespace(evidence=evidence[p.id], need=10.0, p=0.01 * ord(p.id)) for p in c.parts],
    )
    monkeypatch.setattr(sets, "fit_model", lambda run, parts, values: fitted.append("+".join(p.id for p in parts)))
    monkeypatch.setattr(sets, "with_parts", lambda fit, parts: {})
    monkeypatch.setattr(sets, "_of", lambda base, fit: left[0])
    whole, left, fitted = _set("a+b+c", 90.0), [_set("a+c", 80.0)], []
    assert sets.of_needed_effects(by_gain, whole, 0.01, 9).p == pytest.approx(0.99)
    assert fitted == ["a+c"]
    evidence["b"] = 50.0
    assert sets.of_needed_effects(by_gain, whole, 0.01, 9).p == pytest.approx(0.99)
    evidence["b"], left[0] = 49.9, _set("a+c", 80.0, p=1e-4)
    assert sets.of_needed_effects(by_gain, whole, 0.01, 9) is None
    left[0] = _set("a", 80.0)
    assert sets.of_needed_effects(by_gain, whole, 0.01, 9) is None


def test_a_set_is_named_by_its_worth_and_the_smallest_of_equals(by_gain):
    """Two of complexity each: within 9 models fit equally well, and of those the one of fewest effects is named."""
    single, pair, other = _set("a", 92.0, 2), _set("a+b", 100.0, 4), _set("c", 95.0, 3)
    assert discover._choose(by_gain, [pair, single, other]) == (single, [other])
    assert discover._choose(by_gain, [_set("a", 86.9, 2), pair])[0] is pair
    near = _set("a", 87.1, 2)
    assert discover._choose(by_gain, [near, pair])[0] is near
    assert discover._choose(by_gain, []) == (None, [])
    many = [_set(str(k), 100.0 - k) for k in range(9)]
    assert discover._choose(by_gain, many) == (many[0], many[1:7])
    # A rare way to act gives way to what does as well, though that has more parameters.
    rare, usual = _set("a", 100.0, 1), _set("b", 105.0, 4)
    assert discover._choose(by_gain, [usual, rare]) == (rare, [usual])
    rare.parts[0].choice.rare = True
    assert discover._choose(by_gain, [usual, rare]) == (usual, [rare])


def test_one_column_is_followed_once(monkeypatch):
    """Beside a part that follows a column the same effect has other ways to act, another effect has all."""
    choices = [
        Choice(""),
        Choice("u", {"column": "u"}),
        Choice("v", {"column": "v"}),
        Choice("u later", {"column": "u"}, simple=False),
    ]

    class One:
        def choices(self, run):
            return choices

    class Other(One):
        pass

    parts = [SimpleNamespace(effect=One(), choice=choices[1])]
    fit = SimpleNamespace(run=None, model=SimpleNamespace(parts=parts))
    assert [c.label for c in candidates._choices(fit, One())] == ["", "v"]
    assert len(candidates._choices(fit, Other())) == 4
    parts[0].choice = choices[0]
    assert len(candidates._choices(fit, One())) == 4


def test_a_single_that_gains_nearly_as_much_stays_possible(by_gain):
    """A quarter of the best gain, of 12 to 30, short of it; without a pattern and not named yet."""
    for best, slack in ((20.0, 12.0), (80.0, 20.0), (400.0, 30.0)):
        named = _set("a", best)
        inside, outside = _set("b", best - slack + 0.1), _set("c", best - slack - 0.1)
        unlike, wild = _set("d", best, p=1e-4), _set("e", best, physical=False)
        assert discover._nearly(by_gain, named, [], [named, inside, outside, unlike, wild]) == [inside]
    assert discover._nearly(by_gain, named, [inside], [inside]) == []
    assert len(discover._nearly(by_gain, named, [named] * 4, [_set(str(k), best) for k in range(9)])) == 2


def test_a_pair_that_draws_one_sensor_is_arbitrary(by_gain):
    """Two effects can draw nearly anything in a single sensor; an event only where another pair does as well."""

    def part(who, scope="sensor", event="", concerned=(True,)):
        effect = SimpleNamespace(scope=scope, event=event)
        return SimpleNamespace(effect=effect, concerned=concerned, concerns=lambda n: np.array(who))

    def arbitrary(*parts, pairs=()):
        return discover._arbitrary(by_gain, _set("a+b", 100.0, parts=list(parts)), list(pairs))

    one, two, event = part([True, False]), part([False, True]), part([True, False], event="when")
    assert not arbitrary(one)
    assert arbitrary(one, one)
    assert not arbitrary(one, two)
    assert not arbitrary(one, part([True, True], "run", concerned=None))
    assert not arbitrary(one, event)
    rival, far = _set("a+c", 70.1), _set("a+c", 69.9)
    assert arbitrary(one, event, pairs=[rival])
    assert not arbitrary(one, event, pairs=[far, _set("b+a", 99.0), _set("a+c", 99.0, p=1e-4)])


def test_rivals_of_a_larger_set_lack_nothing_of_it(monkeypatch, by_gain):
    """Within 12 of it; one with an effect more than is needed is no rival."""
    named, also, near, far, more = (
        _set("a+b+c", 100.0),
        _set("a+b+d", 95.0),
        _set("a+d+e", 88.1),
        _set("b+d+e", 87.9),
        _set("a+b+c+d", 105.0),
    )
    monkeypatch.setattr(discover, "larger_sets", lambda *_: sets.Sets((near, far, more, named), (named, also)))
    assert discover._several(by_gain, [], [], 0.01, map) == (named, [also, near])
    monkeypatch.setattr(discover, "larger_sets", lambda *_: sets.Sets((near,), ()))
    assert discover._several(by_gain, [], [], 0.01, map) == (None, [])


def test_a_misfit_is_what_is_left_beside_the_noise():
    """In squares, the noise by the share of free readings, and over the readings of the sensors asked for."""
    run = SimpleNamespace(least_noise=np.array([0.3, 1.0]))
    fit = SimpleNamespace(run=run, rmse=np.array([0.5, 0.1]), dof=np.array([80.0, 80.0]), readings=np.array([100.0, 100.0]))
    assert dominant.misfit(fit) == pytest.approx([math.sqrt(0.25 - 0.09 * 0.8), 0.0])
    assert dominant.misfit_power(fit) == pytest.approx(17.8)
    assert dominant.misfit_power(fit, np.array([False, True])) == 0.0


def _evidence(evidence, event="", free=2, places=3.0):
    effect = SimpleNamespace(event=event)
    return dominant.RunEvidence(SimpleNamespace(parts=[SimpleNamespace(effect=effect)], gain=1.0), evidence, free, places, 4.0, 1.0)


def test_evidence_is_summed_over_the_runs_that_show_an_effect():
    """Need and chance by scipy's chi-square, over all that was tried; what no run shows by itself counts for the best of them."""
    alone = stats.chi2.isf(0.01 / 9 / 3.0, 2)
    strong, good, faint = _evidence(90.0), _evidence(1.01 * alone), _evidence(0.99 * alone)
    found = dominant._weighed([strong, None, good, faint], 0.01, 9)
    assert found.by_run == (strong, None, good, None)
    assert found.need == pytest.approx(stats.chi2.isf(0.01 / 9 / 9.0, 4))
    assert found.p == pytest.approx(9 * 9.0 * stats.chi2.sf(90.0 + 1.01 * alone, 4), rel=1e-6)
    assert dominant._weighed([faint, _evidence(1.0)], 0.01, 9).by_run == (faint, None)
    event = [_evidence(e * alone, "when") for e in (4.9, 5.1)]
    assert dominant._weighed(event, 0.01, 9).by_run == (None, event[1])
    assert dominant._weighed([None], 0.01, 9) is None


def test_an_effect_must_beat_a_disturbance_and_more_so_beside_others(monkeypatch):
    """One and a half times what chance gives alone, five times beside another."""

    def beats(*evidence):
        weighed = [None if e is None else SimpleNamespace(evidence=e, need=10.0) for e in evidence]
        monkeypatch.setattr(dominant, "beside_others", lambda *_: weighed)
        return dominant.beats_disturbance(None, None, 0.01, 9)

    assert beats(15.1)
    assert not beats(14.9)
    assert beats(50.1, 60.0)
    assert not beats(49.9, 60.0)
    assert not beats(None, 60.0)
