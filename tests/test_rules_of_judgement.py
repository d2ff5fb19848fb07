"""What a fit may claim, on made-up fits: gain, chance, doubt, and what is no more than rounding."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from thermofast.models import variance_inflation
from thermofast.models.joint import RATE
from thermofast.models.search import judge
from thermofast.models.search.judge import Identifiability, chance, least_p, likelihood_ratios


def _fit(rss, corrected=None, resolution=0.0, dof=90.0, readings=100, **more):
    """A fit of S sensors of four readings each, by what it leaves as read and without rounding."""
    rss = np.array(rss, dtype=float)
    corrected = rss if corrected is None else np.array(corrected, dtype=float)
    run = SimpleNamespace(sensors=len(rss), resolution=np.full(len(rss), resolution), weight=np.full((len(rss), 4), 2.0))
    unrounded = np.sqrt(np.repeat(corrected[:, None], 4, axis=1) / 8.0)
    known = {"run": run, "rss": rss, "unrounded": unrounded, "dof": np.full(len(rss), dof), "readings": np.full(len(rss), readings)}
    return SimpleNamespace(**(known | more))


def test_a_gain_is_the_log_of_the_squares_by_the_degrees_of_freedom():
    """A quarter of the squares is 90 ln 4, of each sensor by itself; the same again is nothing."""
    assert likelihood_ratios(_fit([400.0, 1.0]), _fit([100.0, 1.0])) == pytest.approx([90.0 * math.log(4.0), 0.0])
    assert likelihood_ratios(_fit([100.0]), _fit([400.0])) == pytest.approx([-90.0 * math.log(4.0)])


def test_of_rounded_and_corrected_readings_the_smaller_gain_counts():
    """And to tell rivals apart that of the corrected ones, whichever it is."""
    before, bent, bowed = _fit([400.0], [400.0]), _fit([100.0], [200.0]), _fit([200.0], [100.0])
    for after, own in ((bent, 2.0), (bowed, 4.0)):
        assert likelihood_ratios(before, after) == pytest.approx([90.0 * math.log(2.0)])
        assert likelihood_ratios(before, after, careful=False) == pytest.approx([90.0 * math.log(own)])


def test_below_a_thousandth_of_the_rounding_nothing_is_gained():
    """Steps of 2 K leave 4 / 12 K^2 a reading: of 100 a thirtieth K^2 is the floor, beside which a tenth is four thirds."""
    before, after = _fit([0.1], resolution=2.0), _fit([0.0], resolution=2.0)
    assert likelihood_ratios(before, after) == pytest.approx([90.0 * math.log(4.0)], rel=1e-6)


def test_chance_counts_places_sensors_and_parameters():
    """By scipy's chi-square: of all sensors, of the best of one, and the smaller of both for what each has for itself."""
    own, free, trials = np.array([30.0, 2.0, 0.0]), 2, 5.0
    single, summed = trials * 3 * stats.chi2.sf(30.0, 2), trials * stats.chi2.sf(32.0, 6)
    assert chance(SimpleNamespace(scope="run"), own, free, trials) == pytest.approx(trials * stats.chi2.sf(32.0, 2))
    assert chance(SimpleNamespace(scope="one"), own, free, trials) == pytest.approx(single)
    assert chance(SimpleNamespace(scope="sensor"), own, free, trials) == pytest.approx(2.0 * min(single, summed))
    even = np.full(3, 15.0)
    assert chance(SimpleNamespace(scope="sensor"), even, free, trials) == pytest.approx(2.0 * trials * stats.chi2.sf(45.0, 6))
    for scope in ("run", "one", "sensor"):
        assert chance(SimpleNamespace(scope=scope), np.zeros(3), free, trials) == 1.0


def test_p_values_of_sensors_are_pooled_by_the_least_and_by_fisher():
    """Twice the smaller of Bonferroni's and of scipy's combination; never above 1."""
    for floor in ([0.001, 0.9, 0.8], [0.04, 0.05, 0.06], [0.3]):
        together = stats.combine_pvalues(floor, method="fisher").pvalue
        assert least_p(np.array(floor)) == pytest.approx(2.0 * min(min(floor) * len(floor), together))
    assert least_p(np.array([0.9, 0.8])) == 1.0


def test_coloured_residuals_widen_and_white_ones_do_not(monkeypatch):
    """By the root of the median of the sensors' inflation, each residual by its weight and where it was read."""
    rng = np.random.default_rng(0)
    residual, weight = rng.standard_normal((3, 60)).cumsum(axis=1), rng.uniform(0.5, 4.0, (3, 60))
    used = np.ones((3, 60), dtype=bool)
    used[:, 40:] = False
    fit = SimpleNamespace(residual=residual, run=SimpleNamespace(weight=weight, used=used))
    monkeypatch.setattr(judge, "sensor_p_values", lambda fit: np.full(3, 1e-9))
    factors = [variance_inflation(np.sqrt(w[:40]) * r[:40]) for r, w in zip(residual, weight, strict=True)]
    assert judge.widening(fit) == pytest.approx(math.sqrt(sorted(factors)[1]))
    monkeypatch.setattr(judge, "sensor_p_values", lambda fit: np.full(3, 0.5))
    assert judge.widening(fit) == 1.0


def test_noise_of_inputs_adds_up_in_squares_over_the_sensors_own():
    """Of the parts that concern the sensor: 0.03 K and 0.04 K over 0.01 K are 9 and 16."""
    asked = []

    def borrowed(run, choice, sensor, rate, named):
        asked.append((sensor, rate, named))
        return named["size"]

    effect = SimpleNamespace(borrowed_noise=borrowed)
    parts = [
        SimpleNamespace(effect=effect, choice=None, concerns=lambda n, who=who: np.array(who)) for who in ([1, 1], [0, 1], [1, 0])
    ]
    values = {(0, "size"): np.array([0.5, 0.03]), (1, "size"): 0.04, (2, "size"): 0.7, RATE: np.array([0.1, 0.2])}
    fit = SimpleNamespace(run=SimpleNamespace(noise=[1.0, 0.01], sensors=2), model=SimpleNamespace(parts=parts), values=values)
    assert judge._input_noise(fit, 1) == pytest.approx(25.0)
    assert asked == [(1, 0.2, {"size": 0.03}), (1, 0.2, {"size": 0.04})]


def _read(left, n=36, noise=0.01, resolution=0.0, weight=1.0):
    """A fit of one sensor that leaves `left` [K] in each of n readings."""
    run = SimpleNamespace(
        sensors=1, used=np.ones((1, n), bool), weight=np.full((1, n), weight), noise=[noise], resolution=np.array([resolution])
    )
    return SimpleNamespace(
        run=run,
        unrounded=np.full((1, n), left),
        tangent=lambda i: np.ones((n, 2)),
        rmse=[left],
        rss=[n * left**2],
        dof=np.array([n - 3.0]),
    )


def test_residuals_far_beyond_the_noise_are_no_noise_and_far_below_a_step_are(monkeypatch):
    """1.35 deviations and half as many again for 36 readings; a tenth of the logger's step; 12 readings at least say anything."""
    monkeypatch.setattr(judge, "pattern_p_value", lambda *_: 0.3)
    monkeypatch.setattr(judge, "_input_noise", lambda *_: 0.0)
    for noise, step in ((0.01, 0.0), (1e-6, 0.01 * math.sqrt(12.0))):
        assert judge.sensor_p_values(_read(0.0202, 36, noise, step))[0] == 0.3
        assert judge.sensor_p_values(_read(0.0203, 36, noise, step))[0] == 0.0
    assert judge.sensor_p_values(_read(1.0, 11))[0] == 1.0
    assert judge.sensor_p_values(_read(1.0, 12))[0] == 0.0
    assert judge.sensor_p_values(_read(0.0099, resolution=0.1))[0] == 1.0
    assert judge.sensor_p_values(_read(0.0101, resolution=0.1))[0] == 0.3


def test_a_pattern_may_be_the_rounding_where_no_more_is_left_than_that(monkeypatch):
    """Half a step, of single readings: then the residuals inside the cells tell, here as likely as not."""
    monkeypatch.setattr(judge, "pattern_p_value", lambda *_: 1e-6)
    monkeypatch.setattr(judge, "_input_noise", lambda *_: 0.0)
    monkeypatch.setattr(judge, "_in_cells", lambda fit, i: (0.4, np.arange(len(fit.run.used[i]), dtype=float)))
    half = 0.05 * math.sqrt(33.0 / 36.0)
    below, above = _read(0.99 * half, noise=0.1, resolution=0.1), _read(1.01 * half, noise=0.1, resolution=0.1)
    assert judge.sensor_p_values(below)[0] == 0.4
    assert judge.sensor_p_values(above)[0] == 1e-6
    assert judge.rounded_residual(below, 0) == pytest.approx(np.arange(36.0))
    assert judge.rounded_residual(above, 0) is None
    assert judge.rounded_residual(_read(0.01, 11, resolution=0.1), 0) is None
    mixed = _read(0.99 * half, noise=0.1, resolution=0.1)
    mixed.run.weight[0, 0] = 5.0
    assert judge.rounded_residual(mixed, 0) is None
    monkeypatch.setattr(judge, "_in_cells", lambda fit, i: (1e-6, np.zeros(36)))
    assert judge.rounded_residual(below, 0) is None


def test_residuals_in_cells_are_told_at_the_readings_alone(monkeypatch):
    """Nought where nothing was read."""
    monkeypatch.setattr(judge, "_in_cells", lambda fit, i: (0.4, np.full(int(fit.run.used[i].sum()), 0.25)))
    fit = _read(0.01, 20, resolution=0.1)
    fit.run.used[0, 3:8] = False
    assert judge.rounded_residual(fit, 0) == pytest.approx(np.where(fit.run.used[0], 0.25, 0.0))


def _parameter(name="pace", null=None, share=False, periodic=False, log=False):
    return SimpleNamespace(name=name, null=null, share=share, periodic=periodic, log=log)


EFFECT = SimpleNamespace(event="when", amplitude="size", scope="run")
DOUBTS = [
    (_parameter("when"), 0.5, 1e20, ""),
    (_parameter("when"), 0.0, 1e-4, "when is at the end of the record"),
    (_parameter("when"), 1.0, 1e-4, "when is at the end of the record"),
    (_parameter(), 0.5, 1e12, "pace is not determined"),
    (_parameter(), 0.5, math.nan, "pace is not determined"),
    (_parameter(), 0.5, -1e-9, "pace is not determined"),
    (_parameter(), 0.5, 0.0, ""),
    (_parameter(), 1e-7, 1e-4, "pace is at the end of its range"),
    (_parameter(), 1.0 - 1e-7, 1e-4, "pace is at the end of its range"),
    (_parameter(), 1e-5, 1e-4, ""),
    (_parameter(periodic=True), 0.0, 1e-4, ""),
    (_parameter(log=True), 0.5, 1.19**2, ""),
    (_parameter(log=True), 0.5, math.log(4.0) ** 2, "pace is known only to a factor of 4.0"),
    (_parameter(), 0.5, 100.0, ""),
    (_parameter("size", 0.0), 0.149, 0.01, "size is within 1.5 standard errors of no effect"),
    (_parameter("size", 0.0), 0.151, 0.01, ""),
    (_parameter("size", 1.0), 0.851, 0.01, "size is within 1.5 standard errors of no effect"),
    (_parameter("size", 1.0, share=True), 0.4, 0.01, ""),
    (_parameter("size", 0.01, share=True), 0.45, 0.0025, "size is within 1.5 standard errors of no effect"),
    (_parameter("size", 0.0), 1.0, 0.01, "size is at the end of its range"),
]


@pytest.mark.parametrize(("parameter", "value", "variance", "why"), DOUBTS)
def test_what_a_parameter_is_doubted_for(parameter, value, variance, why):
    """Between 0 and 1, on a record of 40 min: an end, no curvature, no effect, or a factor of more than three either way."""
    fit = SimpleNamespace(run=SimpleNamespace(span=40.0))
    assert judge._doubt(EFFECT, parameter, value, variance, 0.0, 1.0, fit) == why
    assert Identifiability(not why, why).near == why.endswith("no effect")


def _shared(alike=0.0, with_sensor=0.0, sensors=1, scope="run", other_part=0):
    """A fit of a part with two shared parameters and one of the sensor's own, all of deviation 0.1."""
    columns = [SimpleNamespace(part=0, parameter=_parameter("one")), SimpleNamespace(part=other_part, parameter=_parameter("two"))]
    model = SimpleNamespace(
        parts=[
            SimpleNamespace(
                id="thing", effect=SimpleNamespace(event="", amplitude="size", scope=scope), concerns=lambda n: np.ones(n, bool)
            )
        ],
        shared=columns,
        local=[],
        low_shared=np.zeros(2),
        high_shared=np.ones(2),
        active=np.ones((sensors, 1), bool),
    )
    local, shared = np.full((sensors, 1, 1), 0.01), 0.01 * np.array([[1.0, alike], [alike, 1.0]])
    cross = 0.01 * with_sensor * np.ones((sensors, 1, 2))
    run = SimpleNamespace(sensors=sensors, span=40.0)
    return SimpleNamespace(model=model, covariance=(local, shared, cross), shared=np.array([0.5, 0.5]), run=run)


def test_two_parameters_that_move_together_are_not_determined():
    """From a correlation of 0.99995, of either sign; surroundings that nobody logged are no parameter to be told from."""
    assert judge.identifiability(_shared(0.9999)).ok
    for alike in (0.99997, -0.99997):
        assert judge.identifiability(_shared(alike)) == Identifiability(False, "thing: one cannot be told from another parameter")
    assert judge.identifiability(_shared(0.99997, other_part=-1)).ok


def test_what_one_sensor_alone_would_take_for_its_own_is_not_determined():
    """Two sensors, of which each has its own, tell it apart."""
    assert judge.identifiability(_shared(with_sensor=0.9999)).ok
    why = "thing: one cannot be told from the sensor's own parameters"
    assert judge.identifiability(_shared(with_sensor=-0.99997)) == Identifiability(False, why)
    assert judge.identifiability(_shared(with_sensor=0.99997, sensors=2)).ok


@pytest.mark.parametrize(("good", "ok"), [(0, False), (1, False), (2, True), (3, True), (4, True)])
def test_half_of_the_sensors_that_have_an_effect_must_determine_it(good, ok):
    """Of four; the fifth has it not. The first that does not is named."""
    model = SimpleNamespace(
        local=[SimpleNamespace(part=0, parameter=_parameter("size", 0.0)), SimpleNamespace(part=-1, parameter=_parameter("rate"))],
        active=np.ones((5, 2), bool),
        low_local=[-9.0, -9.0],
        high_local=[9.0, 9.0],
    )
    effect = SimpleNamespace(event="", amplitude="size", scope="sensor")
    part = SimpleNamespace(id="thing", effect=effect, concerns=lambda n: np.arange(n) < 4)
    local = np.zeros((5, 2))
    local[4 - good : 4, 0] = 1.0
    run = SimpleNamespace(sensors=5, channels=["T1", "T2", "T3", "T4", "T5"], span=40.0)
    fit = SimpleNamespace(model=model, local=local, run=run)
    covariance = np.tile(0.01 * np.eye(2), (5, 1, 1))
    why = judge._own_doubts(fit, 0, part, covariance)
    assert why == ("" if ok else "thing in T1: size is within 1.5 standard errors of no effect")
    covariance[:, 0, 1] = covariance[:, 1, 0] = -0.0099999
    told = judge._own_doubts(fit, 0, part, covariance)
    assert told == (
        why
        if good < 4 and not ok
        else "thing in T1: size "
        + ("is within 1.5 standard errors of no effect" if good < 4 else "cannot be told from another parameter")
    )
    model.active[:, 1] = False
    assert judge._own_doubts(fit, 0, part, covariance) == why


def test_an_effect_of_each_sensor_is_doubted_where_its_own_parameters_are(monkeypatch):
    """One of all sensors has none of its own."""
    monkeypatch.setattr(judge, "_own_doubts", lambda *_: "thing in T1: no")
    assert judge.identifiability(_shared()) == Identifiability(True)
    assert judge.identifiability(_shared(scope="sensor")) == Identifiability(False, "thing in T1: no")


def test_residuals_within_a_tenth_of_a_step_of_their_cells_are_rounding(monkeypatch):
    """Beyond that their pattern tells."""
    monkeypatch.setattr(judge, "pattern_p_value", lambda *_: 0.07)
    monkeypatch.setattr(judge, "_input_noise", lambda *_: 0.0)
    run = SimpleNamespace(used=np.ones((1, 20), bool), resolution=[0.1], reading=np.zeros((1, 20)))
    fit = SimpleNamespace(run=run, curve=np.zeros((1, 20)), tangent=lambda i: np.ones((20, 1)))
    for left, p in ((-0.0099, 1.0), (-0.0101, 0.07)):
        monkeypatch.setattr(judge, "cell_residual", lambda *_, left=left: np.full(20, left))
        assert judge._in_cells(fit, 0)[0] == p
