"""The fit, its intervals and its limit, against scipy and against brute force."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit, minimize
from scipy.special import stdtrit
from simulator import lump, spindle

from thermofast.estimation.closing import _too_large, likelihood_estimates
from thermofast.models import (
    DecayFit,
    difference_noise,
    fit_decay,
    interval,
    likelihood_sweeps,
    likelihoods,
    pattern_p_value,
    spike_weights,
    variance_inflation,
)
from thermofast.models.noise.whiteness import law_patterns


def likelihood(time, reading, weight):
    """One record as a block of one: its fit, bounds and weights; None where there is nothing to fit."""
    found = likelihoods(time, reading[None], weight[None], np.zeros(1), np.zeros(1, dtype=np.intp))
    if np.isnan(found.fit.rate[0]):
        return None
    steady, rate = interval(found.steady_low[0], found.steady_high[0]), interval(found.rate_low[0], found.rate_high[0])
    return SimpleNamespace(fit=found.fit.one(0), steady_state=steady, rate=rate, weights=found.weights[0])


def law(t, steady, drop, rate):
    return steady + drop * np.exp(-rate * t)


@pytest.mark.parametrize("seed", range(6))
def test_the_fit_is_that_of_curve_fit_and_so_are_its_errors(seed):
    rng = np.random.default_rng(seed)
    t, y = spindle(rng, 120.0)
    p, covariance = curve_fit(law, t, y, p0=(26.7, -8.8, 0.01536))
    fit = fit_decay(t, y)
    assert fit.steady_state == pytest.approx(p[0], abs=1e-5)
    assert fit.rate == pytest.approx(p[2], rel=1e-6)
    assert fit.steady_state_limit * math.sqrt(fit.noise_variance) == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-3)
    state, spread = fit.state(float(t[-1]))
    assert state[0] == pytest.approx(law(t[-1], *p), abs=1e-6)
    by_end = np.array([1.0, math.exp(-p[2] * t[-1]), -p[1] * t[-1] * math.exp(-p[2] * t[-1])])
    assert spread[0, 0] * fit.noise_variance == pytest.approx(by_end @ covariance @ by_end, rel=1e-3)


def brute_force_profile(t, y, limit, steady):
    """Least RSS over drop and rate with the steady state held, minus the limit."""
    best = min(
        minimize(lambda p: float(((y - law(t, steady, p[0], math.exp(p[1]))) ** 2).sum()), start, method="Nelder-Mead",
                 options={"xatol": 1e-10, "fatol": 1e-14, "maxiter": 4000}).fun
        for start in ([-8.0, -4.0], [-12.0, -4.6])
    )  # fmt: skip
    return best - limit


@pytest.mark.parametrize(("noise", "minutes"), [(0.005, 28), (0.02, 60)])
def test_the_interval_is_where_the_profile_likelihood_reaches_its_limit(noise, minutes):
    t, y = spindle(np.random.default_rng(8), minutes, noise)
    found = likelihood(t, y, np.ones(len(t)))
    fit = found.fit
    limit = fit.rss * (1 + stdtrit(fit.dof, 0.975) ** 2 / fit.dof)
    for edge in (found.steady_state.low, found.steady_state.high):
        assert brute_force_profile(t, y, limit, edge) == pytest.approx(0.0, abs=0.01 * (limit - fit.rss))
    for rate in (found.rate.low, found.rate.high):
        basis = np.column_stack([np.ones(len(t)), np.exp(-rate * t)])
        rss = float(np.linalg.lstsq(basis, y, rcond=None)[1][0])
        assert rss == pytest.approx(limit, abs=0.01 * (limit - fit.rss))
    assert fit.steady_state - found.steady_state.low < found.steady_state.high - fit.steady_state  # the long side is the upper


def test_a_straight_line_has_no_steady_state_and_an_open_interval():
    t = np.arange(20.0)
    y = 20 + 0.2 * t + 0.02 * np.random.default_rng(3).standard_normal(20)
    found = likelihood(t, y, np.ones(20))
    assert found.steady_state.high is None
    assert found.rate.low is None
    assert found.steady_state.low > y[-1]
    falling = likelihood(t, 40 - y, np.ones(20))
    assert falling.steady_state.low is None
    assert falling.steady_state.high == pytest.approx(40 - found.steady_state.low, rel=1e-6)


def test_exact_data_give_the_exact_answer():
    t = np.arange(60.0)
    found = likelihood(t, lump(t, 0.02, 10.0, 17.9), np.ones(60))
    assert found.fit.steady_state == pytest.approx(27.9, abs=1e-6)
    assert found.steady_state.low == pytest.approx(27.9, abs=1e-5)
    constant = likelihood(t, np.full(60, 5.0), np.ones(60))
    assert constant.steady_state.low == constant.steady_state.high
    assert likelihood(t[:2], t[:2], np.ones(2)) is None
    three = likelihood(t[:3], np.array([0.0, 1.0, 1.5]), np.ones(3))
    assert three.steady_state.high is None
    assert math.isnan(three.fit.noise_variance)


def test_far_outliers_are_left_out_and_a_fit_needs_three_readings():
    t, y = spindle(np.random.default_rng(9), 60.0)
    y[[1, 30]] += 5.0
    found = likelihood(t, y, np.ones(61))
    assert np.flatnonzero(found.weights == 0.0).tolist() == [1, 30]
    with pytest.raises(ValueError, match="three readings"):
        fit_decay(t[:2], y[:2])
    assert isinstance(fit_decay(t, y, signed=True), DecayFit)


def test_white_residuals_pass_and_a_pattern_is_seen_at_the_stated_rate():
    rng = np.random.default_rng(10)
    t = np.arange(300.0)
    tangent = np.column_stack([np.ones(300), np.exp(-0.01 * t), t * np.exp(-0.01 * t)])
    q = np.linalg.qr(tangent)[0]
    p = []
    for _ in range(1500):
        r = rng.standard_normal(300)
        p.append(pattern_p_value(r - q @ (q.T @ r), tangent))
    share = np.mean(np.array(p) < 0.05)
    assert 0.03 < share < 0.07
    r = rng.standard_normal(300) + 0.6 * np.sin(t / 12)
    assert pattern_p_value(r - q @ (q.T @ r), tangent) < 1e-6
    long = rng.standard_normal(5000)
    assert pattern_p_value(long, np.ones((5000, 1))) > 1e-4
    assert math.isnan(pattern_p_value(np.zeros(5), np.ones((5, 1))))
    assert pattern_p_value(np.zeros(50), np.ones((50, 1))) == 1.0


def test_dependent_readings_count_for_less():
    rng = np.random.default_rng(11)
    white = rng.standard_normal(20000)
    red = np.empty(20000)
    red[0] = white[0]
    for k in range(1, 20000):
        red[k] = 0.8 * red[k - 1] + white[k]
    assert variance_inflation(white) == pytest.approx(1.0, abs=0.1)
    assert variance_inflation(red) == pytest.approx(1.8 / 0.2, rel=0.2)  # (1 + a) / (1 - a)
    assert variance_inflation(np.zeros(3)) == 1.0


def test_spikes_are_told_from_steps_and_steep_rises():
    rng = np.random.default_rng(12)
    y = np.concatenate([np.linspace(0, 50, 20), np.full(30, 50.0)]) + 0.01 * rng.standard_normal(50)
    assert spike_weights(y).all()
    y[30] += 3.0
    assert np.flatnonzero(spike_weights(y) == 0.0).tolist() == [30]
    assert spike_weights(y[:4]).all()


@settings(max_examples=120, deadline=None)
@example(818, 266, "jump", True)
@example(1641, 317, "jump", False)
@given(st.integers(0, 10**6), st.integers(20, 400), st.sampled_from(["none", "load", "jump", "wave", "outliers"]), st.booleans())
def test_several_stretches_in_one_call_fit_as_each_alone(seed, n, event, even):
    """Each begins its search where the one before ended, once the rate is known: what happens in between must not hold it there."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(n)) if even else np.cumsum(rng.uniform(0.3, 1.7, n))
    rate, at = rng.uniform(0.5, 10.0) / t[-1], rng.integers(5, n)
    y = 20.0 + 8.0 * -np.expm1(-rate * t)
    y[at:] += {"load": 4.0 * -np.expm1(-rate * (t[at:] - t[at])), "jump": rng.uniform(-4.0, 4.0)}.get(event, 0.0)
    y += (event == "wave") * 0.5 * np.sin(20.0 * t / t[-1]) + rng.choice([0.005, 0.05]) * rng.standard_normal(n)
    if event == "outliers":
        y[rng.integers(0, n, max(1, n // 40))] += 3.0
    counts = np.unique(np.linspace(6, n, 40).astype(np.intp))
    first, step, weight = np.array([9], dtype=np.intp), np.zeros(1), np.ones((1, n))
    several = likelihood_sweeps(t, y[None], weight, counts, first, step).fits[0]
    for i, m in enumerate(counts):
        alone = likelihoods(t[:m], y[None, :m], weight[:, :m], step, first).fit
        # Two rates that fit alike to a hundred-thousandth are two names of one curve.
        assert several["rss"][i] == pytest.approx(alone.rss[0], rel=3e-5, abs=1e-12, nan_ok=True), m


def test_a_direction_that_moves_nothing_changes_no_p_value():
    rng = np.random.default_rng(5)
    residual, along = rng.normal(size=60), np.linspace(0.0, 1.0, 60)
    two, three = np.stack([np.ones(60), along], axis=1), np.stack([np.ones(60), along, np.zeros(60)], axis=1)
    with np.errstate(all="raise"):
        assert pattern_p_value(residual, three) == pytest.approx(pattern_p_value(residual, two), rel=0.1)


def test_readings_of_no_weight_do_not_narrow_an_interval():
    """Bounds of a record with readings that do not count are those of the record without them, which has as many degrees less."""
    rng = np.random.default_rng(3)
    t = np.arange(9.0)
    y = 20.0 + 6.0 * -np.expm1(-t / 5.0) + 0.05 * rng.standard_normal(9)
    weight, first = np.ones((1, 9)), np.zeros(1, dtype=np.intp)
    weight[0, [2, 5, 7]] = 0.0
    kept = weight[0] > 0.0
    found = likelihoods(t, y[None], weight, np.zeros(1), first)
    alone = likelihoods(t[kept], y[None, kept], weight[:, kept], np.zeros(1), first)
    for name in ("rate_low", "rate_high", "steady_low", "steady_high"):
        assert getattr(found, name) == pytest.approx(getattr(alone, name), rel=1e-9), name
    assert found.fit.dof == 3


def test_residuals_are_too_large_at_three_times_what_neighbours_differ_by_and_a_step():
    reading = np.tile(20.0 + 0.1 * np.random.default_rng(5).standard_normal(60), (4, 1))
    noise, step = float(difference_noise(reading[0])), np.array([0.0, 0.0, 0.5, 0.5])
    misfit = 3.0 * noise + step + np.array([-1e-6, 1e-6, -1e-6, 1e-6])
    assert _too_large(misfit, reading, step).tolist() == [False, True, False, True]


def test_patterns_of_the_law_are_those_of_its_residuals_beside_its_tangent():
    """By the general function on the readings that count, of two lengths; the misfit counts each reading alike."""
    rng = np.random.default_rng(8)
    t = np.arange(80.0)
    y = np.stack([20.0 + 8.0 * -np.expm1(-0.03 * t) + 0.02 * rng.standard_normal(80) for _ in range(2)])
    w = np.where(rng.random((2, 80)) < 0.2, 0.25, 1.0)
    w[1, [5, 50]] = 0.0
    rates = np.array([fit_decay(t, y[i], w[i]).rate for i in (0, 1)])
    p, residual, misfit = law_patterns(t, y, w, rates)
    for i in (0, 1):
        fit, used, root = fit_decay(t, y[i], w[i]), w[i] > 0.0, np.sqrt(w[i])
        left = y[i] - fit.predict(t)
        decay = np.exp(-fit.rate * t)
        tangent = np.stack([np.ones(80), decay, t * decay], axis=1) * root[:, None]
        assert residual[i] == pytest.approx(left * root, abs=1e-9)
        assert p[i] == pytest.approx(pattern_p_value((left * root)[used], tangent[used]), rel=1e-5)
        assert misfit[i] == pytest.approx(math.sqrt(np.mean(left[used] ** 2)))


def test_dependent_residuals_are_those_of_the_readings_that_count():
    """A record with readings of no weight is as wide as the record without them, where its residuals swing."""
    t = np.arange(90.0)
    y = 20.0 + 8.0 * -np.expm1(-0.03 * t) + 0.2 * np.sin(0.35 * t) + 0.01 * np.random.default_rng(3).standard_normal(90)
    weight = np.where(t % 3 == 1, 0.0, 1.0)
    weight[[0, -1]] = 1.0
    kept = weight > 0.0
    first, step = np.zeros(1, dtype=np.intp), np.zeros(1)
    whole = likelihood_estimates(t, y[None], weight[None], first, step, math.inf)
    part = likelihood_estimates(t[kept], y[None, kept], weight[None, kept], first, step, math.inf)
    assert whole.pattern_p[0] < 1e-6
    assert whole.steady_high - whole.steady_low == pytest.approx(part.steady_high - part.steady_low, rel=1e-6)
