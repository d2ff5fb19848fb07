"""The compiled core and its numpy twin give the same numbers."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thermofast.filters import Afukf, Ekf, FadingUkf, PrintedAfukf, PrintedFadingUkf, Tracks, Ukf
from thermofast.filters.loop import GaussianFilter
from thermofast.filters.loop import run as run_filter
from thermofast.filters.moments import ScaledPoints
from thermofast.models import COMPILED, Lump, PrintedLump
from thermofast.models.core import _lump_numpy
from thermofast.models.core.fit import FIT
from thermofast.models.decay import fit_decay, start_rule
from thermofast.models.noise import spikes

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
@example(50183, 8, False, False)
@given(st.integers(0, 10**6), st.integers(8, 200), st.booleans(), st.booleans())
def test_fits_agree(seed, n, even, signed):
    t, y, w = record(seed, n, even)
    fast, plain = np.empty(1, FIT), np.empty(1, FIT)
    _lump.fit_decay(t, y, w, signed, fast)
    _lump_numpy.fit_decay(t, y, w, signed, plain)
    assert fast["n"] == plain["n"]
    if plain["rate"][0] > 0.5 * plain["greatest"][0]:
        # Faster than the readings: the sum of squares falls towards the bound for ever, and where a search gives up is rounding.
        assert fast["rate"] == pytest.approx(plain["rate"], rel=0.5)
        return
    assert fast["rss"] == pytest.approx(plain["rss"], rel=1e-8)  # the same minimum, whatever the rounding of the path
    assert fast["rate"] == pytest.approx(plain["rate"], rel=2e-4, abs=1e-6)


@settings(max_examples=25, deadline=None)
@example(300, 80, True, math.inf)  # the first readings are left out: the grid begins later, and is even all the same
@given(st.integers(0, 10**6), st.integers(12, 120), st.booleans(), st.sampled_from([math.inf, 0.5]))
def test_likelihoods_agree(seed, n, even, wide):
    t, first, _ = record(seed, n, even, spikes=1)
    y = np.stack([first, record(seed + 1, n, even)[1]])
    counts = np.array([6, n // 2, n], dtype=np.intp)
    begun, steps = np.array([8, 9], dtype=np.intp), np.array([0.01, 0.0])
    out = [np.empty((2, 3), FIT) for _ in range(2)]
    for module, table in zip((_lump, _lump_numpy), out, strict=True):
        module.likelihoods(t, y, np.ones((2, n)), counts, np.full((2, 3), 2.2), begun, steps, start_rule(), wide, table)
    fast, plain = (table.ravel() for table in out)
    for name in FIT.names:
        assert (np.isnan(fast[name]) == np.isnan(plain[name])).all(), name
    for a, b in zip(fast, plain, strict=True):
        if not np.isfinite(b["steady_low"]):
            continue
        half = abs(b["steady_high"] - b["steady_low"])
        assert a["rss"] == pytest.approx(b["rss"], rel=1e-6)
        if math.isfinite(b["rate_low"]):
            for side in ("steady_low", "steady_high"):
                assert a[side] == pytest.approx(b[side], abs=0.02 * half + 1e-6)


def test_a_likelihood_alone_tells_which_readings_it_left_out():
    t, y, _ = record(5, 60, spikes=2)
    weights = [np.ones((1, 60)) for _ in range(2)]
    for module, w in zip((_lump, _lump_numpy), weights, strict=True):
        out = np.empty((1, 1), FIT)
        one = np.array([60], dtype=np.intp), np.array([[2.0]]), np.array([10], dtype=np.intp), np.array([0.01])
        module.likelihoods(t, y[None], w, *one, start_rule(), math.inf, out)
    assert (weights[0] == weights[1]).all()
    assert weights[0].sum() == 58


@pytest.mark.parametrize("module", [_lump, _lump_numpy] if COMPILED else [])
def test_sizes_that_do_not_fit_are_refused(module):
    t, y, w = record(1, 20)
    with pytest.raises((ValueError, IndexError)):
        module.fit_decay(t, y[:10], w, False, np.empty(1, FIT))
    with pytest.raises((ValueError, IndexError)):
        module.spike_weights(y[None], np.zeros(2), np.empty((1, 20)))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 3), st.sampled_from([0.0, 0.01, 0.5]))
def test_starts_and_spikes_agree(seed, spikes, resolution):
    t, y, _ = record(seed, 60, True, spikes)
    weights = [np.ones((1, 60)) for _ in range(4)]
    step = np.array([resolution])
    _lump.spike_weights(y[None], step, weights[0])
    _lump_numpy.spike_weights(y[None], step, weights[1])
    assert (weights[0] == weights[1]).all()
    found = []
    for module, w in ((_lump, weights[2]), (_lump_numpy, weights[3])):
        used, noise, settled, out = np.empty(1, np.intp), np.empty(1), np.empty(1, np.uint8), np.empty(1, FIT)
        module.start_decay(t, y[None], step, start_rule(), w, used, noise, settled, out)
        found.append((int(used[0]), bool(settled[0]), float(noise[0]), float(out["rate"][0])))
    fast, plain = found
    assert fast[:2] == plain[:2]
    assert fast[2] == pytest.approx(plain[2], rel=1e-6)
    assert (weights[2][0, : fast[0]] == weights[3][0, : fast[0]]).all()


def test_profiles_agree_where_the_contour_is_open():
    rng = np.random.default_rng(4)
    t = np.arange(12.0)
    y = 20 + 0.1 * t + 0.05 * rng.standard_normal(12)  # a straight line: no steady state
    bent = 20 + 6.0 * -np.expm1(-t / 4.0) + 0.05 * rng.standard_normal(12)
    w = np.ones((2, 12))
    fits = [fit_decay(t, line, w[0]) for line in (y, bent)]
    rate, limit = np.array([fit.rate for fit in fits]), np.array([1.6 * fit.rss for fit in fits])
    fast, plain = np.empty((2, 4)), np.empty((2, 4))
    for core, out in ((_lump, fast), (_lump_numpy, plain)):
        core.profile_decay(t, np.array([y, bent]), w, rate, limit, out)
    assert np.isnan([fast[0, 0], plain[0, 0]]).all()
    np.testing.assert_allclose(fast[0, 1:3], plain[0, 1:3], rtol=1e-3)
    np.testing.assert_allclose(fast[1], plain[1], rtol=1e-6)
    assert fast[1, 0] < fits[1].rate < fast[1, 1]


@pytest.mark.parametrize("core", [_lump, _lump_numpy])
def test_profiles_of_shapes_that_do_not_agree_are_refused(core):
    t, y, w, one, out = np.arange(12.0), np.ones((2, 12)), np.ones((2, 12)), np.ones(2), np.empty((2, 4))
    for told in (
        (t[1:], y, w, one, one, out),
        (t, y, w[:1], one, one, out),
        (t, y, w, one[:1], one, out),
        (t, y, w, one, one[:1], out),
        (t, y, w, one, one, out[:1]),
        (t, y, w, one, one, out[:, :3].copy()),
    ):
        with pytest.raises(ValueError, match=r"needed|bounds"):
            core.profile_decay(*told)


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


@pytest.mark.parametrize(("model", "method"), CASES[:5], ids=lambda x: getattr(x, "name", type(x).__name__))
def test_a_block_of_records_ends_where_each_alone_does(model, method):
    rng = np.random.default_rng(3)
    t = np.arange(150.0)
    y = 26.7 - rng.uniform(3, 9, (6, 1)) * np.exp(-rng.uniform(0.008, 0.03, (6, 1)) * t) + 0.02 * rng.standard_normal((6, 150))
    y[1, 50] += 3.0
    y[2, 70:] += 0.02 * (t[70:] - 70.0)
    steps = np.array([0.0, 0.01, 0.0, 0.01, 0.0, 0.1])
    block = method.tracks(model, t, y, steps)
    alone = Tracks.of([method.track(model, t, row, float(step)) for row, step in zip(y, steps, strict=True)])
    for name in vars(block):
        ours, theirs = getattr(block, name), getattr(alone, name)
        if name == "weight":  # before the start, which may leave a reading out
            assert (ours[:, 40:] == theirs[:, 40:]).all()
        assert ours == pytest.approx(theirs, rel=1e-12, abs=1e-15), name


@pytest.mark.parametrize("step_min", [1.0, 12.0])
@pytest.mark.parametrize("method", [Afukf(), FadingUkf(), Ukf()], ids=lambda x: x.name)
def test_records_side_by_side_break_and_begin_each_for_itself(method, step_min):
    rng = np.random.default_rng(8)
    t = step_min * np.arange(120.0)
    noise = np.array([[0.005], [0.05], [0.1], [0.02], [0.02], [0.02]])  # so that their starts lie far apart
    rate = rng.uniform(0.008, 0.03, (6, 1)) / step_min
    y = 26.7 - 8.0 * np.exp(-rate * t) + noise * rng.standard_normal((6, 120))
    y[1, 90:] = 1e14
    steps = np.zeros(6)
    block = method.tracks(Lump(), t, y, steps)
    alone = Tracks.of([method.track(Lump(), t, row, 0.0) for row in y])
    assert len(set(block.first[:4].tolist())) >= 3
    assert (block.diverged_at == alone.diverged_at).all()
    assert (block.diverged_at[[0, 2, 3, 4, 5]] == -1).all()
    assert block.diverged_at[1] >= 90
    sound = block.diverged_at < 0
    for name in ("state", "covariance", "noise_variance", "forgotten", "woke"):
        assert (getattr(block, name)[sound] == getattr(alone, name)[sound]).all(), name
    assert (block.weight[sound, 60:] == alone.weight[sound, 60:]).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(4, 70), st.booleans())
def test_squares_of_curves_agree(seed, n, even):
    t, first, weights = record(seed, n, even)
    y = np.stack([first, record(seed + 1, n, even)[1]])
    counts = np.array([max(4, n // 2), n], dtype=np.intp)
    fits = np.empty((2, 2), FIT)
    _lump.likelihoods(
        t, y, np.ones((2, n)), counts, np.full((2, 2), 2.2), np.zeros(2, np.intp), np.zeros(2), start_rule(), math.inf, fits
    )
    fits["rate"][1, 0] = 1e-6  # where the basis is taken by a series
    kept = np.stack([(weights > 0.0).astype(float), np.ones(n)])
    ends = np.array([0, 3, n], dtype=np.intp)
    fast, plain = np.empty((2, 2, 3)), np.empty((2, 2, 3))
    _lump.curve_squares(t, y, kept, fits, ends, fast)
    _lump_numpy.curve_squares(t, y, kept, fits, ends, plain)
    assert fast == pytest.approx(plain, rel=1e-7, abs=1e-9)
    for module in (_lump, _lump_numpy):
        with pytest.raises(ValueError, match="window"):
            module.curve_squares(t, y, kept, fits, np.array([0, n + 1, n], dtype=np.intp), fast)


def test_tails_agree_with_scipy():
    from scipy import special

    from thermofast.models.core import tails

    dof = np.r_[0.7, 1:60, 400, 3000.0, 1e5, np.inf]
    assert tails.t_quantile(dof) == pytest.approx(special.stdtrit(dof, 0.975), rel=1e-9)
    value = np.r_[0.0, np.geomspace(0.01, 60, 100)]
    for over, under in ((8, 30), (8, 989), (2, 3), (11, 40)):
        assert tails.f_tail(over, under, value) == pytest.approx(special.fdtrc(over, under, value), rel=1e-10)
    value = np.linspace(-8, 30, 50)
    assert tails.normal_tail(value) == pytest.approx(special.ndtr(-value), rel=1e-12)
    assert math.isnan(tails.f_tail(2, 9, math.nan))
    assert isinstance(float(tails.t_quantile(7)), float)


@given(st.integers(1, 40), st.integers(0, 10**6))
def test_the_quick_median_is_the_median(n, seed):
    values = np.random.default_rng(seed).integers(-5, 6, (3, n)).astype(float)
    assert spikes._median(values) == pytest.approx(np.median(values, axis=-1), abs=0.0)


@settings(max_examples=40, deadline=None)
@example(3, 2500, 3)  # means over stretches
@example(4, 11, 2)  # too short
@given(st.integers(0, 10**6), st.integers(12, 300), st.integers(1, 6))
def test_patterns_agree(seed, n, own):
    """Of residuals and columns of any size, one of which moves nothing."""
    rng = np.random.default_rng(seed)
    residual, columns = rng.standard_normal((3, n)), rng.standard_normal((3, own, n)) + np.arange(n) / n
    columns[0, -1] = 0.0
    out = [np.empty((3, 3)) for _ in range(2)]
    for module, sums in zip((_lump, _lump_numpy), out, strict=True):
        module.pattern_sums(residual, columns, sums)
    np.testing.assert_allclose(*out, rtol=1e-6, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(8, 200), st.booleans())
def test_patterns_of_the_law_agree(seed, n, even):
    """Readings of no weight anywhere, and a rate that could not be fitted."""
    records = [record(seed + i, n, even) for i in range(3)]
    t = records[0][0]
    y, w = (np.stack([r[k] for r in records]) for k in (1, 2))
    rate = np.array([0.5 / n, 4.0 / n, np.nan])
    out = [(np.empty((3, n)), np.empty((3, 5))) for _ in range(2)]
    for module, into in zip((_lump, _lump_numpy), out, strict=True):
        module.law_patterns(t, y, w, rate, *into)
    np.testing.assert_allclose(out[0][0], out[1][0], atol=1e-10)
    np.testing.assert_allclose(out[0][1], out[1][1], rtol=1e-6, atol=1e-8)
    assert np.isnan(out[0][1][2]).all()
    assert (out[0][0][w == 0.0] == 0.0).all()


@settings(max_examples=60, deadline=None)
@example(1, 4, 1.0, 0.0)
@given(
    st.integers(0, 10**6), st.integers(2, 200), st.sampled_from([10.0, 1.0, 0.5, 0.25, 0.1, 0.02, 0.0625, 1e-5]), st.floats(0, 0.5)
)
def test_steps_of_decimals_are_those_that_sorting_finds(seed, n, step, noise):
    rng = np.random.default_rng(seed)
    readings = 20.0 + 8.0 * -np.expm1(-np.arange(n) / 40.0) + noise * rng.standard_normal((2, n))
    y = np.stack([np.round(np.round(readings[0] / step) * step, 6), readings[1]])
    found = spikes.logger_steps(y)
    np.testing.assert_allclose(found, spikes._steps_of_any(y), atol=1e-12)


def test_a_step_of_decimals_is_found_without_sorting():
    out = np.empty(4)
    _lump.decimal_steps(
        np.array([[20.1, 20.4, 20.2, 20.3], [20.0, 20.5, 22.0, 20.5], [0.0, 100.0, 0.01, 200.0], [20.0, 20.2, 20.7, 20.9]]), out
    )
    np.testing.assert_allclose(out[[0, 1, 3]], [0.1, 0.5, 0.0])
    assert math.isnan(out[2])  # reaches too far
