"""The compiled core and its numpy twin give the same numbers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermofast.filters import Afukf, Ekf, FadingUkf, PrintedAfukf, PrintedFadingUkf, Ukf
from thermofast.filters.loop import GaussianFilter
from thermofast.filters.loop import run as run_filter
from thermofast.filters.moments import ScaledPoints
from thermofast.models import COMPILED, Lump, PrintedLump
from thermofast.models.core import _lump_numpy
from thermofast.models.decay import start_rule

pytestmark = pytest.mark.skipif(not COMPILED, reason="no compiled core to compare with")
if COMPILED:
    from thermofast.models.core import _lump


def record(seed: int, n: int = 80, even: bool = True, spikes: int = 0):
    rng = np.random.default_rng(seed)
    t = np.arange(n, dtype=float) if even else np.sort(rng.uniform(0, n, n))
    rise, rate = rng.uniform(-10, 10), rng.uniform(0.5, 6.0) / n
    y = 20 + rise * (1 - np.exp(-rate * t)) + 0.03 * rng.standard_normal(n)
    y[rng.choice(n, spikes, replace=False)] += 4.0
    return t, y, np.where(rng.random(n) < 0.1, 0.0, rng.uniform(0.3, 1.0, n))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(8, 200), st.booleans(), st.booleans())
def test_fits_agree(seed, n, even, signed):
    t, y, w = record(seed, n, even)
    fast, plain = np.array(_lump.fit_decay(t, y, w, signed)), np.array(_lump_numpy.fit_decay(t, y, w, signed))
    assert fast[9] == pytest.approx(plain[9], rel=1e-8)  # the same minimum, whatever the rounding of the path
    assert fast[10] == plain[10]
    assert fast[0] == pytest.approx(plain[0], rel=2e-4, abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(12, 120), st.booleans(), st.sampled_from([math.inf, 0.5]))
def test_likelihoods_agree(seed, n, even, wide):
    t, y, _ = record(seed, n, even, spikes=1)
    counts = np.array([6, n // 2, n], dtype=np.intp)
    quantiles = np.full(3, 2.2)
    out = [np.empty((3, 18)) for _ in range(2)]
    for module, table in zip((_lump, _lump_numpy), out, strict=True):
        module.likelihoods(t, y, np.ones(n), counts, quantiles, 8, start_rule(0.01), wide, table)
    fast, plain = out
    assert (np.isnan(fast) == np.isnan(plain)).all()
    good = np.isfinite(plain)
    for i in range(3):
        if not good[i, 16]:
            continue
        half = abs(plain[i, 17] - plain[i, 16])
        assert fast[i, 9] == pytest.approx(plain[i, 9], rel=1e-6)
        if math.isfinite(plain[i, 14]):
            assert fast[i, 16:] == pytest.approx(plain[i, 16:], abs=0.02 * half + 1e-6)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 3), st.sampled_from([0.0, 0.01, 0.5]))
def test_starts_and_spikes_agree(seed, spikes, resolution):
    t, y, _ = record(seed, 60, True, spikes)
    weights = [np.ones(60) for _ in range(4)]
    _lump.spike_weights(y, resolution, weights[0])
    _lump_numpy.spike_weights(y, resolution, weights[1])
    assert (weights[0] == weights[1]).all()
    rule = start_rule(resolution)
    fast = _lump.start_decay(t, y, rule, weights[2])
    plain = _lump_numpy.start_decay(t, y, rule, weights[3])
    assert fast[0] == plain[0]
    assert fast[2] == plain[2]
    assert fast[1] == pytest.approx(plain[1], rel=1e-6)
    assert (weights[2][: fast[0]] == weights[3][: fast[0]]).all()


def test_profiles_agree_where_the_contour_is_open():
    rng = np.random.default_rng(4)
    t = np.arange(12.0)
    y = 20 + 0.1 * t + 0.05 * rng.standard_normal(12)  # a straight line: no steady state
    w = np.ones(12)
    fit = _lump_numpy.fit_decay(t, y, w, False)
    limit = fit[9] * 1.6
    fast = _lump.profile_decay(t, y, w, fit[0], limit)
    plain = _lump_numpy.profile_decay(t, y, w, fit[0], limit)
    assert math.isnan(fast[0])
    assert math.isnan(plain[0])
    assert fast[1:3] == pytest.approx(plain[1:3], rel=1e-3)


CASES = [
    (Lump(), Ukf()),
    (Lump(), Ekf()),
    (Lump(), FadingUkf()),
    (Lump(), FadingUkf(weakening=0.5)),
    (Lump(), Afukf()),
    (PrintedLump(), PrintedAfukf()),
    (PrintedLump(), PrintedFadingUkf()),
]


@pytest.mark.parametrize(("model", "method"), CASES, ids=lambda x: getattr(x, "name", type(x).__name__))
def test_loops_agree_through_spikes_noise_a_jump_and_a_wrong_model(model, method):
    assert isinstance(method, GaussianFilter)
    rng = np.random.default_rng(11)
    t = np.cumsum(rng.uniform(0.5, 1.5, 200))
    y = 26.7 - 8.8 * np.exp(-0.01536 * t) + 0.02 * rng.standard_normal(200)
    y[50] += 3.0
    y[60:75] += 0.15 * rng.standard_normal(15)
    y[100:] += 0.01 * (t[100:] - t[100])
    y[150:] += 1.5
    start = model.start(t, y, 0.01)
    tracks = [
        run_filter(model, start, method.moments, method.fading_rule, t, y, 0.01, compiled=compiled) for compiled in (True, False)
    ]
    assert tracks[0].diverged_at == tracks[1].diverged_at
    for name in ("state", "covariance", "noise_variance", "fading", "process_noise", "noise_factor", "weight", "forgotten"):
        fast, plain = getattr(tracks[0], name), getattr(tracks[1], name)
        assert np.allclose(fast, plain, rtol=1e-6, atol=1e-9, equal_nan=True), name


def test_loops_agree_with_scaled_points():
    rng = np.random.default_rng(2)
    t = np.arange(60.0)
    y = 26.7 - 8.8 * np.exp(-0.01536 * t) + 0.02 * rng.standard_normal(60)
    start = Lump().start(t, y, 0.0)
    rule = Afukf().fading_rule
    fast, plain = (run_filter(Lump(), start, ScaledPoints(0.7, 0.5), rule, t, y, 0.0, compiled=c) for c in (True, False))
    assert np.allclose(fast.state, plain.state, rtol=1e-8, equal_nan=True)


@settings(max_examples=50, deadline=None)
@given(st.floats(-0.5, 3.0), st.floats(0.01, 50.0))
def test_growth_is_the_integral_and_its_slope_the_derivative(rate, dt):
    whole = float(_lump_numpy.growth(rate, dt))
    grid = np.linspace(0, dt, 4001)
    assert whole == pytest.approx(float(np.trapezoid(np.exp(-rate * grid), grid)), rel=1e-3)
    h = 1e-5 * max(abs(rate), 0.1)
    around = float(_lump_numpy.growth(rate + h, dt) - _lump_numpy.growth(rate - h, dt)) / (2 * h)
    assert float(_lump_numpy.growth_slope(rate, dt)) == pytest.approx(around, rel=1e-3, abs=1e-6)
