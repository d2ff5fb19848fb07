"""What an effect explains beside others, and how effects that act twice or mirrored are put in order; on made-up fits."""

from types import SimpleNamespace

import numpy as np
import pytest

from thermofast.models.effects.base import Choice
from thermofast.models.joint import RATE, Key
from thermofast.models.noise.spectral import block_means, spectral_likelihood
from thermofast.models.search import candidates, dominant, order


def _fit(residual, parts=(), searched=4, noise=0.1):
    residual = np.asarray(residual, dtype=float)
    sensors, readings = residual.shape
    run = SimpleNamespace(
        weight=np.full(residual.shape, 2.0), time=np.arange(float(readings)), least_noise=np.full(sensors, noise), sensors=sensors
    )
    rmse = np.sqrt((residual**2).mean(axis=1))
    known = {"dof": np.full(sensors, readings - 4.0), "readings": np.full(sensors, readings), "rmse": rmse}
    return SimpleNamespace(residual=residual, run=run, searched=searched, model=SimpleNamespace(parts=list(parts)), **known)


def _part(name, who=None):
    effect = SimpleNamespace(id=name, event="", again=True)
    concerns = lambda n: np.ones(n, dtype=bool) if who is None else np.array(who)
    return SimpleNamespace(effect=effect, id=name, concerns=concerns)


@pytest.fixture
def slow():
    """Residuals of two sensors that wander, and a tenth of them."""
    walk = np.cumsum(np.random.default_rng(0).standard_normal((2, 240)), axis=1) * 0.1
    return _fit(walk), _fit(0.1 * walk, searched=6)


def test_evidence_is_twice_the_gain_of_a_likelihood_over_a_disturbance(slow, monkeypatch):
    """White beside a tenth of the misfit and the noise of a block; of the sensors that are concerned the misfit."""
    monkeypatch.setattr(dominant, "places", lambda part, run: 7.0)
    before, after = slow
    candidate = SimpleNamespace(fit=after)
    found = dominant._Scale(before).evidence(candidate, _part("load", [True, False]))
    means, weight = block_means(before.residual, before.run.weight, before.run.time)
    per_block = np.maximum(np.median(weight, axis=1), 1.0)
    scale = np.sqrt(0.01 / per_block + (0.1 * before.rmse) ** 2)
    less = block_means(after.residual, after.run.weight, after.run.time)[0]
    assert found.evidence == pytest.approx(2.0 * (spectral_likelihood(less, scale) - spectral_likelihood(means, scale)))
    assert (found.free, found.places, found.candidate) == (2, 7.0, candidate)
    assert found.had == pytest.approx(dominant.misfit_power(before, np.array([True, False])))
    assert found.left == pytest.approx(dominant.misfit_power(after, np.array([True, False])))
    same = SimpleNamespace(fit=_fit(before.residual, searched=3))
    assert dominant._Scale(before).evidence(same, _part("load")).free == 1
    broken = SimpleNamespace(fit=_fit(np.full((2, 240), np.inf)))
    assert dominant._Scale(before).evidence(broken, _part("load")) is None


class _Told:
    """Evidence that the candidate or the part carries."""

    def __init__(self, fit):
        self.fit = fit

    def evidence(self, candidate, part):
        value = getattr(candidate, "told", None)
        value = part.told if value is None else value
        return None if value is None else dominant.RunEvidence(candidate, value, 2, 3.0, 1.0, 0.1)


def _one(told, name="load"):
    return SimpleNamespace(parts=[_part("other"), _part(name)], told=told)


def test_effects_are_weighed_over_all_runs_those_of_most_worth_first(monkeypatch):
    """By the last part of each; one that no run tells of is left out, and all that were tried count."""
    monkeypatch.setattr(dominant, "_Scale", _Told)
    tried = [[_one(60.0), _one(50.0)], [None, None], [_one(90.0, "door"), None], [_one(200.0, "mass"), _one(30.0, "mass")]]
    found = dominant.weigh(["run 1", "run 2"], tried, 0.01)
    assert [w.effect.id for w in found] == ["mass", "load", "door"]
    assert [w.evidence for w in found] == [230.0, 110.0, 90.0]
    alone = dominant._weighed([dominant.RunEvidence(_one(90.0, "door"), 90.0, 2, 3.0, 1.0, 0.1)], 0.01, 4)
    assert found[2].need == alone.need
    assert found[2].by_run[1] is None
    assert dominant._weighed([dominant.RunEvidence(_one(1.0), 1.0, 2, 3.0, 1.0, 0.1)], 0.01, 0).need == pytest.approx(
        dominant._weighed([dominant.RunEvidence(_one(1.0), 1.0, 2, 3.0, 1.0, 0.1)], 0.01, 1).need
    )


def test_what_an_effect_explains_beside_the_others_is_told_without_it(monkeypatch):
    """Those of the base stay; a single new one is told against the base itself."""
    fitted = []
    monkeypatch.setattr(dominant, "_Scale", _Told)
    monkeypatch.setattr(dominant, "with_parts", lambda fit, parts: None)
    monkeypatch.setattr(dominant, "fit_model", lambda run, parts, start: fitted.append([p.id for p in parts]))
    old, one, two = _part("old"), _part("one"), _part("two")
    one.told, two.told = 80.0, None
    base = SimpleNamespace(model=SimpleNamespace(parts=[old]), run=None)
    found = dominant.beside_others(base, SimpleNamespace(parts=[old, one, two], fit=None), 0.01, 4)
    assert fitted == [["old", "two"], ["old", "one"]]
    assert (found[0].evidence, found[1]) == (80.0, None)
    fitted.clear()
    assert len(dominant.beside_others(base, SimpleNamespace(parts=[old, one], fit=None), 0.01, 4)) == 1
    assert fitted == []


def test_each_of_two_effects_is_needed_over_all_runs(monkeypatch):
    """Eight times beyond what chance gives, by the sum of the runs; one that no run tells of is not."""

    def needed(*by_run):
        monkeypatch.setattr(dominant, "beside_others", lambda fit, twin, *_: [None if e is None else _half(e) for e in twin])
        return dominant._each_needed([None] * len(by_run), by_run, 0.01, 4)

    def _half(evidence):
        sound = SimpleNamespace(ok=True, near=True)
        candidate = SimpleNamespace(parts=[_part("load")], identifiable=sound)
        return dominant.Weighed((dominant.RunEvidence(candidate, evidence, 2, 3.0, 1.0, 0.05),), 0.0, 0.0)

    assert needed((500.0, 500.0))
    assert not needed((500.0, 90.0))
    assert not needed((90.0, 500.0))
    assert not needed((500.0, None))
    assert needed((500.0, 120.0), (300.0, 120.0))
    assert needed((500.0, None), (300.0, 400.0))


class _Effect(SimpleNamespace):
    """An effect that may stand there twice, with a pace of each sensor or an event."""

    @property
    def id(self):
        return self.name if self.number == 1 else f"{self.name}.{self.number}"


def _twice(monkeypatch, values, event=None, who=((True, True), (True, True))):
    """Values of the two of an effect after they were put in order; another effect stands between them."""
    pace = SimpleNamespace(name="pace", each="sensor", settles="rate")
    size = SimpleNamespace(name="size", each="sensor", settles="")
    parts = []
    for name, number, concerned in (("load", 1, who[0]), ("door", 1, who[0]), ("load", 2, who[1])):
        effect = _Effect(name=name, number=number, event=event, parameters=[pace, size])
        parts.append(candidates.Part(effect, Choice(f"{name} {number}"), concerned))
    monkeypatch.setattr(order, "Model", lambda run, parts: SimpleNamespace(parts=parts, vector=lambda values: (values, parts)))
    monkeypatch.setattr(order, "search", lambda model, values, parts, most: SimpleNamespace(values=values, model=model, most=most))
    fit = SimpleNamespace(model=SimpleNamespace(parts=tuple(parts)), values=values, run=SimpleNamespace(sensors=2))
    return order.in_order(candidates.Candidate(fit, np.zeros(2), 0.5))


def test_of_two_the_slower_stands_behind_the_faster_in_each_sensor(monkeypatch):
    """Where both concern it; all of its own parameters go with it."""
    values = {Key(0, "pace"): [1.0, 5.0], Key(2, "pace"): [3.0, 2.0], Key(0, "size"): [10.0, 20.0], Key(2, "size"): [30.0, 40.0]}
    values |= {Key(1, "pace"): [7.0, 8.0], Key(-1, RATE.name): [0.1, 0.2]}
    found = _twice(monkeypatch, values)
    got = {key: value.tolist() for key, value in found.fit.values.items()}
    assert (got[Key(0, "pace")], got[Key(2, "pace")]) == ([3.0, 5.0], [1.0, 2.0])
    assert (got[Key(0, "size")], got[Key(2, "size")]) == ([30.0, 20.0], [10.0, 40.0])
    assert (got[Key(1, "pace")], got[RATE]) == ([7.0, 8.0], [0.1, 0.2])
    assert found.ids == ("load", "door", "load.2")
    assert found.fit.most == 0
    for who in (((False, True), (True, True)), ((True, True), (False, True))):
        kept = _twice(monkeypatch, values, who=who).fit.values
        assert kept[Key(0, "pace")].tolist() == [1.0, 5.0]


def test_of_two_events_the_earlier_stands_first(monkeypatch):
    """With its way of acting, and all of its parameters."""
    values = {
        Key(0, "when"): 90.0,
        Key(2, "when"): 30.0,
        Key(0, "size"): [1.0, 2.0],
        Key(2, "size"): [3.0, 4.0],
        Key(1, "size"): [5.0, 6.0],
    }
    found = _twice(monkeypatch, values, event="when")
    assert (float(found.fit.values[Key(0, "when")]), float(found.fit.values[Key(2, "when")])) == (30.0, 90.0)
    assert found.fit.values[Key(0, "size")].tolist() == [3.0, 4.0]
    assert found.fit.values[Key(1, "size")].tolist() == [5.0, 6.0]
    assert found.ids == ("load", "door", "load.2")
    assert [p.choice.label for p in found.parts] == ["load 2", "door 1", "load 1"]
    values[Key(0, "when")] = 10.0
    assert [p.choice.label for p in _twice(monkeypatch, values, event="when").parts] == ["load 1", "door 1", "load 2"]


def test_values_that_are_a_mirror_are_turned_in_the_sensors_concerned(monkeypatch):
    """A lag and a time constant exchanged; a fit without a mirror stays what it is."""
    monkeypatch.setattr(candidates, "search", lambda model, values: SimpleNamespace(values=values))
    given = []

    def mirrored(rate, own):
        given.append((rate.tolist(), {k: v.tolist() for k, v in own.items()}))
        return None if own["lag"][0] == 0.0 else (np.array([9.0, 9.0]), {"lag": np.array([7.0, 7.0])})

    effect = SimpleNamespace(
        mirrored=mirrored,
        active=lambda choice: [SimpleNamespace(name="lag", each="sensor"), SimpleNamespace(name="all", each="run")],
    )
    part = SimpleNamespace(effect=effect, choice=None, concerns=lambda n: np.array([True, False]))
    model = SimpleNamespace(parts=[None, part], vector=lambda values: (values,))
    values = {RATE: np.array([0.1, 0.2]), Key(1, "lag"): np.array([3.0, 4.0]), Key(1, "all"): 5.0}
    found = candidates.unmirrored(SimpleNamespace(model=model, values=values, run=SimpleNamespace(sensors=2)), 1)
    assert given == [([0.1, 0.0], {"lag": [3.0, 4.0]})]
    assert (found.values[RATE].tolist(), found.values[Key(1, "lag")].tolist(), found.values[Key(1, "all")]) == (
        [9.0, 0.2],
        [7.0, 7.0],
        5.0,
    )
    still = SimpleNamespace(model=model, values=values | {Key(1, "lag"): np.zeros(2)}, run=SimpleNamespace(sensors=2))
    assert candidates.unmirrored(still, 1) is still


def _ways(monkeypatch, scans, by_sensor=(), quick=False, large=(), share=False):
    monkeypatch.setattr(candidates, "_from_other_rates", lambda *_: [])
    monkeypatch.setattr(candidates, "own_starts", lambda scans, effect, at: (None, {"own": scans[0].name}))
    main = SimpleNamespace(share=share, start=0.5)
    effect = SimpleNamespace(parameter=lambda name: main, amplitude="size", large_starts=lambda: large)
    before = SimpleNamespace(run=SimpleNamespace(span=60.0, sensors=2), values={RATE: np.array([0.1, 0.4])})
    pairs = [
        (Choice(f"way {k}", {"by": np.array([k, k])} if by_sensor else {}, by_sensor=by_sensor), s) for k, s in enumerate(scans)
    ]
    found = candidates._own_choices(before, effect, pairs, 3, quick)
    shown = lambda v: v.tolist() if isinstance(v, np.ndarray) else v
    return [(c, [{k: shown(v) for k, v in start.items()} for start in starts]) for c, starts in found]


def test_each_sensor_begins_at_its_best_place_and_from_large_sizes(monkeypatch):
    """At every fifth place from the second on; a share is one of the span."""
    points = [{"when": float(k)} for k in range(12)]
    scan = SimpleNamespace(name="first", points=points)
    ((choice, starts),) = _ways(monkeypatch, [scan], large=[2.0])
    assert choice.label == "way 0"
    assert starts == [{"own": "first"}, *({Key(3, "size"): [2.0, 2.0], Key(3, "when"): [w, w]} for w in (1.0, 6.0, 11.0))]
    assert _ways(monkeypatch, [scan], large=[2.0], share=True)[0][1][1][Key(3, "size")] == [120.0, 120.0]
    assert _ways(monkeypatch, [scan], large=[2.0], quick=True)[0][1] == [{"own": "first"}]
    lone = SimpleNamespace(name="lone", points=[{}])
    assert _ways(monkeypatch, [lone], large=[2.0])[0][1] == [{"own": "lone"}, {Key(3, "size"): [2.0, 2.0]}]
    assert len(_ways(monkeypatch, [lone, scan])) == 2


def test_neighbours_are_composed_of_those_that_promise_most(monkeypatch):
    """Nine ranks at most, one for a quick look; also from a coupling of twice the rate."""
    gains = [(1.0, 9.0), (5.0, 3.0), (4.0, 6.0)]
    scans = [SimpleNamespace(gain=np.array([g]), amplitude=np.array([[0.1 * k, 0.2 * k]])) for k, g in enumerate(gains, 1)]
    found = _ways(monkeypatch, scans, ("by",))
    assert [c.constants["by"].tolist() for c, _ in found] == [[1, 0], [2, 2], [0, 1]]
    assert found[0][1][0][Key(3, "size")] == pytest.approx([0.2, 0.2])
    assert found[0][1][1][Key(3, "size")] == [0.5, 0.8]
    assert len(_ways(monkeypatch, scans, ("by",), quick=True)) == 1
    assert len(_ways(monkeypatch, scans * 4, ("by",))) == 9
