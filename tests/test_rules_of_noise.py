"""Coloured noise, thresholds and probes that came off, by dense matrices, impulse responses, statsmodels or a few numbers."""

import math
import warnings

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import toeplitz
from scipy.optimize import minimize_scalar
from scipy.signal import freqz, lfilter
from statsmodels.tsa.stattools import adfuller

from thermofast.models.noise import area_metric, chain, denoise, residual_noise
from thermofast.models.noise.residual_noise import NoiseModel
from thermofast.models.noise.threshold import adaptive_threshold
from thermofast.models.uncertainty.first_passage import Pace, RunBack, clock_time, time_to_go

MODELS = [([0.6], []), ([], [0.5]), ([0.5, -0.3], [0.4]), ([0.4, 0.2, -0.3], [0.3, 0.2]), ([], [-0.4, 0.3]), ([0.1, 0.2, 0.5], [])]


def _covariances(phi, theta, count):
    """Of unit innovations, by the squares of the impulse response."""
    psi = lfilter(np.r_[1.0, theta], np.r_[1.0, -np.array(phi)], np.r_[1.0, np.zeros(4000)])
    return np.array([psi[: len(psi) - k] @ psi[k:] for k in range(count)])


@pytest.mark.parametrize(("phi", "theta"), MODELS)
def test_covariances_and_spectrum_of_a_model_are_those_of_its_impulse_response(phi, theta):
    """The long-run factor is the sum of all autocorrelations."""
    model = NoiseModel(np.array(phi), np.array(theta), 2.5)
    truth = 2.5 * _covariances(phi, theta, 400)
    assert model.autocovariance(9) == pytest.approx(truth[:9], rel=1e-9)
    assert model.variance == pytest.approx(truth[0])
    assert model.order == (len(phi), len(theta))
    assert model.long_run_factor == pytest.approx((truth[0] + 2.0 * truth[1:].sum()) / truth[0], rel=1e-6)
    angle = np.array([0.0, 0.3, 1.0, 3.0])
    response = freqz(np.r_[1.0, theta], np.r_[1.0, -np.array(phi)], angle)[1]
    assert model.spectrum(angle) == pytest.approx(2.5 / (2.0 * math.pi) * np.abs(response) ** 2)


@pytest.mark.parametrize(("phi", "theta"), MODELS)
@pytest.mark.parametrize("noise", [0.0, 0.7])
@pytest.mark.parametrize("holes", [(), (5, 6, 30), (45, 52), (0, 89)])
def test_innovations_are_those_of_the_cholesky_factor(phi, theta, noise, holes):
    """Of the covariance of the readings that there are."""
    y = np.random.default_rng(3).standard_normal(90)
    y[list(holes)] = np.nan
    seen = np.isfinite(y)
    whole = toeplitz(_covariances(phi, theta, 90)) + noise * np.eye(90)
    root = np.linalg.cholesky(whole[np.ix_(seen, seen)])
    e, f = residual_noise.innovations(y, np.array(phi), np.array(theta), noise)
    assert np.isnan(e).tolist() == (~seen).tolist()
    assert f[seen] == pytest.approx(np.diag(root) ** 2, rel=1e-6)
    assert e[seen] == pytest.approx(np.linalg.solve(root, y[seen]) * np.diag(root), abs=1e-5)
    model = NoiseModel(np.array(phi), np.array(theta), 4.0)
    if not noise:
        both = residual_noise.whitened(np.column_stack([y, 2.0 * y]), model)
        assert both[:, 0][seen] == pytest.approx((e / np.sqrt(4.0 * f))[seen])
        assert both[:, 1][seen] == pytest.approx(2.0 * both[:, 0][seen])


def test_filtered_noise_is_the_conditional_mean():
    """Given the readings up to each, with their own noise; in a gap what is foretold."""
    phi, theta, noise = [0.5, 0.3], [0.4], 0.6
    y = np.random.default_rng(5).standard_normal(20)
    y[7] = np.nan
    whole = toeplitz(_covariances(phi, theta, 20))
    drift = residual_noise._kalman(y, np.array(phi), np.array(theta), noise)[2]
    for k in (0, 3, 7, 8, 19):
        seen = np.flatnonzero(np.isfinite(y[: k + 1]))
        both = whole[np.ix_(seen, seen)] + noise * np.eye(len(seen))
        assert drift[k] == pytest.approx(whole[k, seen] @ np.linalg.solve(both, y[seen]))


def test_a_correlogram_by_sums_and_by_yule_and_walker():
    """Bands of equations (1) and (2); what does not vary has none."""
    x = lfilter([1.0], [1.0, -0.6], np.random.default_rng(1).standard_normal(60)) + 5.0
    found, d = residual_noise.correlogram(x, 12), x - x.mean()
    rho = np.array([d[: 60 - k] @ d[k:] for k in range(13)]) / (d @ d)
    assert found.autocorrelation == pytest.approx(rho[1:])
    partial = [np.linalg.solve(toeplitz(rho[:k]), rho[1 : k + 1])[-1] for k in range(1, 13)]
    assert found.partial == pytest.approx(partial)
    assert found.quenouille == pytest.approx(1.96 / math.sqrt(60.0))
    assert found.bartlett == pytest.approx([1.96 * math.sqrt((1.0 + 2.0 * (rho[1:k] ** 2).sum()) / 60.0) for k in range(1, 13)])
    assert len(residual_noise.correlogram(x, 59).partial) == 59
    for series, lags in ((np.ones(60), 12), (x, 60), (x, 0), (np.r_[x, np.nan], 12)):
        with pytest.raises(ValueError, match="a correlogram needs"):
            residual_noise.correlogram(series, lags)


@pytest.mark.parametrize("n", [20, 65, 217])
def test_the_unit_root_is_that_of_statsmodels(n):
    """With the third root of the steps as lags, and MacKinnon's quantile."""
    x = lfilter([1.0], [1.0, -0.5], np.random.default_rng(n).standard_normal(n))
    found = residual_noise.stationarity(x)
    lags = math.floor(round((n - 1) ** (1.0 / 3.0), 9))
    with warnings.catch_warnings():  # later versions announce other return types
        warnings.simplefilter("ignore", FutureWarning)
        t, _, _, used, critical = adfuller(x, maxlag=lags, regression="c", autolag=None)[:5]
    assert found.unit_root == pytest.approx(t)
    assert found.critical == pytest.approx(critical["5%"], abs=1e-3)
    assert used == n - 1 - lags
    assert found.stationary == (found.unit_root < found.critical and 0 < found.decays_at < n // 4)
    with pytest.raises(ValueError, match="needs 20 readings, not 19"):
        residual_noise.stationarity(x[:19])


def test_a_series_has_decayed_where_it_stays_inside_the_band():
    """But for one in ten; a walk never does."""
    rng = np.random.default_rng(4)
    white, walk = rng.standard_normal(400), np.cumsum(rng.standard_normal(400))
    assert residual_noise.stationarity(white).stationary
    assert not residual_noise.stationarity(walk).stationary
    for series in (white, lfilter([1.0], [1.0, -0.8], white), np.sin(np.arange(400.0))):
        found = residual_noise.correlogram(series, 100)
        inside = np.abs(found.autocorrelation) <= found.bartlett
        first = next((k + 1 for k in range(100) if inside[k] and (~inside[k:]).sum() <= 0.1 * (100 - k)), -1)
        assert residual_noise.stationarity(series).decays_at == first


def test_partial_correlations_and_coefficients_are_each_others_inverse():
    """Within the unit circle; what lies outside is brought inside."""
    free = np.array([0.3, -1.0, 0.7, 0.5, -0.2])
    phi, theta = residual_noise._from_free(free, 3)
    assert residual_noise._to_free(phi, theta) == pytest.approx(free)
    assert phi == pytest.approx(residual_noise._step_up(0.9995 * free[:3] / np.sqrt(1.0 + free[:3] ** 2)))
    assert residual_noise._step_up(np.array([0.5, 0.2])).tolist() == pytest.approx([0.5 - 0.2 * 0.5, 0.2])
    assert (np.abs(np.roots(np.r_[1.0, -phi])) < 1.0).all()
    assert (np.abs(np.roots(np.r_[1.0, theta])) < 1.0).all()
    outside = residual_noise._to_free(np.array([3.0]), np.array([-3.0]))
    assert outside == pytest.approx(np.full(2, 0.98 / math.sqrt(1.0 - 0.98**2)))


def test_lags_are_regressed_upon_by_least_squares():
    """On the series' own and on the noise's."""
    x, w = np.random.default_rng(6).standard_normal((2, 30))
    found, rest = residual_noise._regression(x, w, 2, 1)
    basis = np.column_stack([x[1:-1], x[:-2], w[1:-1]])
    truth = np.linalg.lstsq(basis, x[2:], rcond=None)[0]
    assert found == pytest.approx(truth)
    assert rest[2:] == pytest.approx(x[2:] - basis @ truth)
    assert rest[:2].tolist() == x[:2].tolist()
    assert residual_noise._regression(x, w, 0, 0)[0].tolist() == []


def test_a_model_is_fitted_by_exact_likelihood():
    """Of white noise the mean square; of an AR(1) by the dense normal density; at unit innovations or not."""
    x = 3.0 * lfilter([1.0], [1.0, -0.5], np.random.default_rng(2).standard_normal(40))
    x[11] = np.nan
    seen = np.isfinite(x)
    white = residual_noise.fit_arma(x, 0, 0)
    assert white.innovation_variance == pytest.approx(np.mean(x[seen] ** 2))
    assert white.aic == pytest.approx(39.0 * (math.log(2.0 * math.pi * white.innovation_variance) + 1.0) + 2.0)
    assert white.n == 39

    def deviance(phi):
        shape = toeplitz(phi ** np.arange(40.0) / (1.0 - phi**2))[np.ix_(seen, seen)]
        variance = x[seen] @ np.linalg.solve(shape, x[seen]) / 39.0
        return -2.0 * stats.multivariate_normal.logpdf(x[seen], np.zeros(39), variance * shape), variance

    best = minimize_scalar(lambda phi: deviance(phi)[0], (0.1, 0.8), bounds=(-0.99, 0.99), method="bounded")
    one = residual_noise.fit_arma(x, 1, 0)
    assert one.phi[0] == pytest.approx(best.x, abs=1e-4)
    assert one.innovation_variance == pytest.approx(deviance(best.x)[1], rel=1e-4)
    assert one.aic == pytest.approx(best.fun + 4.0, abs=1e-6)
    chosen = residual_noise.select_arma(x, 1, 1)
    fits = [residual_noise.fit_arma(x, p, q) for p in (0, 1) for q in (0, 1)]
    assert chosen.aic == min(f.aic for f in fits)
    for p, q in ((4, 0), (0, 3), (-1, 0), (0, -1)):
        with pytest.raises(ValueError, match="is beyond ARMA"):
            residual_noise.fit_arma(x, p, q)
    for series in (x[:20], np.zeros(30)):
        with pytest.raises(ValueError, match="needs 20 readings"):
            residual_noise.fit_arma(series, 0, 0)
    assert residual_noise.fit_arma(x[12:32], 0, 0).n == 20


def test_slow_parameters_know_less_under_coloured_noise(monkeypatch):
    """By the model of least AIC that has no hole, a quarter of the readings at most; never better than under white noise."""
    assert residual_noise.long_run_factor(np.arange(19.0)) == 1.0
    assert residual_noise.long_run_factor(np.zeros(30)) == 1.0

    def factor(readings=400, **aic):
        models = {
            (0, 0): NoiseModel(np.zeros(0), np.zeros(0), 1.0, aic.get("white", 9.0)),
            (1, 0): NoiseModel(np.array([0.5]), np.zeros(0), 1.0, aic.get("half", 9.0)),
            (2, 0): NoiseModel(np.array([0.0, -0.5]), np.zeros(0), 1.0, aic.get("opposite", 9.0)),
            (1, 1): NoiseModel(np.array([0.8]), np.array([-0.91]), 1.0, aic.get("hole", 9.0)),
            (2, 1): NoiseModel(np.array([0.9, 0.0]), np.zeros(1), 1.0, aic.get("slow", 9.0)),
        }
        monkeypatch.setattr(residual_noise, "fit_arma", lambda series, p, q: models[p, q])
        return residual_noise.long_run_factor(np.r_[np.ones(readings), np.nan])

    assert factor(white=1.0) == pytest.approx(1.0)
    assert factor(half=1.0) == pytest.approx(3.0)  # (1 + 0.5) / (1 - 0.5)
    assert factor(slow=1.0) == pytest.approx(19.0)
    assert factor(opposite=1.0) == 1.0
    assert factor(hole=1.0, half=2.0) == pytest.approx(3.0)
    assert factor(60, slow=1.0) == 15.0
    assert factor(20, slow=1.0) == 5.0


def test_limits_follow_the_window_before_a_reading():
    """Mean and sample deviation of those that were let in; a floor, a guard."""
    r = np.array([1.0, 3.0, 2.0, 2.5, 30.0, 2.2, 2.4])
    low, high = adaptive_threshold(r, 3, 2.0, 4.0)
    assert np.isnan(low).tolist() == [True] * 3 + [False] * 4
    for k, window in ((3, r[:3]), (4, r[1:4]), (5, r[1:4]), (6, r[[2, 3, 5]])):
        spread = 2.0 * np.std(window, ddof=1)
        assert (low[k], high[k]) == (pytest.approx(window.mean() - spread), pytest.approx(window.mean() + spread))
    assert adaptive_threshold(np.zeros(5), 2, 3.0, 4.0, 0.5)[1][2:].tolist() == [1.5] * 3
    for window, guard, told in ((1, 4.0, "no spread"), (2, 2.9, "inside the limits")):
        with pytest.raises(ValueError, match=told):
            adaptive_threshold(r, window, 3.0, guard)
    adaptive_threshold(r, 2, 3.0, 3.0)


@pytest.mark.parametrize(("n", "m"), [(5, 5), (7, 4), (1, 3)])
def test_the_area_metric_is_the_distance_of_wasserstein(n, m):
    """By scipy; of bounds to either side, and what lies outside a box."""
    rng = np.random.default_rng(n)
    a, b = rng.standard_normal(n), 0.5 + rng.standard_normal(m)
    assert area_metric.area_metric(a, b) == pytest.approx(stats.wasserstein_distance(a, b))
    both = area_metric.area_metric_interval(a, a + 1.0, b, b + 2.0)
    assert both.lower == pytest.approx(stats.wasserstein_distance(a, b))
    assert both.total == pytest.approx(both.lower + stats.wasserstein_distance(a + 1.0, b + 2.0))
    assert area_metric.area_outside(a, b, b) == pytest.approx(area_metric.area_metric(a, b))
    assert area_metric.area_outside(b + 0.5, b, b + 1.0) == 0.0
    assert area_metric.area_outside(b + 1.5, b, b + 1.0) == pytest.approx(0.5)
    assert area_metric.area_outside(b - 0.5, b, b + 1.0) == pytest.approx(0.5)
    for low, high in ((b, b - 1.0), (b, np.r_[b, 9.0])):
        with pytest.raises(ValueError, match="lower bounds"):
            area_metric.area_outside(a, low, high)
    for wrong in (np.zeros(0), np.array([1.0, np.nan]), np.zeros((2, 2))):
        with pytest.raises(ValueError, match="at least one finite number"):
            area_metric.area_metric(wrong, b)
    assert [area_metric.enough(30, 30), area_metric.enough(30, 29)] == [True, False]
    response = np.array([[1.0, 3.0, 2.0], [5.0, 4.0, 6.0]])
    assert [v.tolist() for v in area_metric.response_bounds(response)] == [[1.0, 4.0], [3.0, 6.0]]


def test_residuals_of_a_record_against_what_the_model_foretells():
    """An offset without any spread is itself; within the bounds nothing contradicts; levels are those of a normal law."""
    curve, zero = np.linspace(20.0, 30.0, 40), np.zeros(40)
    assert area_metric.record_area_metric(curve + 0.5, curve, zero) == pytest.approx(0.5)
    assert area_metric.record_area_metric(curve + 0.5, curve, zero, curve - 1.0, curve + 1.0) == 0.0
    assert area_metric.record_area_metric(curve + 1.5, curve, zero, curve - 1.0, curve + 1.0) == pytest.approx(0.5)
    law = area_metric.record_area_metric(curve, curve, np.full(40, 0.3), noise=0.4)
    assert law == pytest.approx(0.5 * math.sqrt(2.0 / math.pi), rel=1e-3)  # the mean size of a normal number
    assert area_metric._normal_levels(1).shape == (1, 2**15)
    levels = area_metric._normal_levels(7)
    assert stats.norm.cdf(levels[:2, 0]) * levels.shape[1] == pytest.approx([0.618034, 0.236068], abs=1e-5)
    assert levels.shape[0] == 7
    assert np.sort(levels.ravel())[levels.size // 40] == pytest.approx(stats.norm.ppf(0.025), abs=2e-3)
    assert (area_metric._normal_levels(100_000).shape[1], area_metric._normal_levels(2**15).shape[1]) == (4, 4)
    for more in (
        {"low": curve},
        {"low": curve + 1.0, "high": curve},
        {"noise": -1.0},
        {"deviation": zero - 1.0},
        {"deviation": zero[1:]},
    ):
        with pytest.raises(ValueError, match=r"bound|negative|length"):
            area_metric.record_area_metric(**({"reading": curve, "curve": curve, "deviation": zero} | more))


def _fell(at=100, others=0.0, back=0.0, n=140, jump=0.0):
    """Two sensors of a rise of 20 K; the first falls from one reading to the next to where it began, or nearly."""
    time = np.arange(float(n))
    rise = 20.0 * -np.expm1(-time / 30.0)
    reading = np.array([20.0 + rise, 20.0 + 0.8 * rise])
    reading[0, at - 2 :] += jump
    reading[0, at:] = 20.0 + back
    reading[1, at:] += others
    return time, reading, np.ones((2, n), dtype=bool), np.full(2, 0.01)


def test_a_probe_that_came_off_falls_home_while_the_others_go_on():
    """To within a quarter of its way, with ten readings at rest; a second sensor must go on."""
    found = chain.came_off(*_fell())
    assert list(found) == [0]
    assert (found[0].first, found[0].minutes, found[0].level) == (98, 1.0, 20.0)
    assert found[0].fall == pytest.approx(20.0 * -np.expm1(-99.0 / 30.0))
    for more, off in (
        ({"jump": 5.0}, True), ({"jump": 9.0}, False), ({"back": 5.2}, True), ({"back": 5.5}, False), ({"others": -1.4}, True),
        ({"others": -1.8}, False), ({"at": 130}, True), ({"at": 131}, False), ({"n": 29, "at": 15}, False),
    ):  # fmt: skip
        assert bool(chain.came_off(*_fell(**more))) is off, more
    time, reading, used, noise = _fell()
    assert chain.came_off(time, reading[:1], used[:1], noise[:1]) == {}
    assert chain.came_off(time, reading, used, np.array([1.0, 0.01])) == {}
    assert chain.came_off(time, reading[::-1], used, noise)[1].first == 98
    slow = reading.copy()
    slow[0, 100:] = 20.0 + 20.0 * np.exp(-(time[100:] - 99.0) / 30.0)
    assert chain.came_off(time, slow, used, noise) == {}


def test_a_sensor_that_was_logged_twice_is_its_original():
    """Equal in all readings, and changing two dozen times at least."""
    a = np.random.default_rng(0).standard_normal(40)
    other = a.copy()
    other[39] += 1.0
    holes = np.where(np.arange(40) == 3, np.nan, a)
    assert chain.originals([a, a + 1.0, a.copy(), other, holes, holes.copy()]).tolist() == [0, 1, 0, 3, 4, 4]
    for steps, first in ((24, 0), (23, 1)):
        coarse = np.minimum(np.arange(40.0), steps)
        assert chain.originals([coarse, coarse.copy()]).tolist() == [0, first]
    assert chain.originals([]).tolist() == []


def test_directions_of_a_tangent_are_orthonormal_where_readings_are():
    """What says the same or nothing is left out; weighted least squares by a normal likelihood."""
    tangent = np.column_stack([np.ones(8), np.arange(8.0), -2.0 * np.arange(8.0), np.zeros(8)])
    seen = np.arange(8) != 3
    free = denoise._orthonormal(tangent, seen)
    assert free.shape == (8, 2)
    assert free[seen].T @ free[seen] == pytest.approx(np.eye(2), abs=1e-12)
    white = np.column_stack([np.random.default_rng(0).standard_normal(8), tangent[:, :2]])
    found = denoise._regressed(white, 1.5)
    beta, rss, *_ = np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=None)
    assert found.parameters == pytest.approx(beta)
    assert found.variance == pytest.approx(rss[0] / 6.0)
    assert found.root @ found.root.T == pytest.approx(np.linalg.inv(white[:, 1:].T @ white[:, 1:]))
    volume = 0.5 * np.linalg.slogdet(white[:, 1:].T @ white[:, 1:])[1]
    assert found.log_likelihood == pytest.approx(-3.0 * math.log(rss[0] / 6.0) - 1.5 - volume)
    assert found.innovation @ found.innovation == pytest.approx(6.0)


def test_the_time_to_go_of_a_state_that_is_known_and_of_a_rate_that_is_not():
    """log(1 / band) over the rate, less what has gone; the slow side of the rate is the late side of the time."""
    state = np.array([25.0, 0.05, 0.01])  # 5 K left of a rise from 20 degC
    for initial in (20.0, RunBack(math.log(2.0) / 0.01)):
        for band in (0.05, 0.1):
            found = time_to_go(state, np.zeros((3, 3)), initial, band=band)
            truth = math.log(0.5 / band) / 0.01
            assert (found.low, found.median, found.high) == pytest.approx((truth, truth, truth), rel=1e-6)
    cov = np.diag([0.0, 0.0, 1e-6])
    back = time_to_go(state, cov, RunBack(50.0), quantile=2.5)
    assert back.low == pytest.approx(math.log(20.0) / 0.0125 - 50.0)
    assert back.high == pytest.approx(math.log(20.0) / 0.0075 - 50.0)
    # With temperature and slope known and the rate not, the time is that at which slope / rate exp(-rate t) is the band's.
    rates = 0.01 + 1e-3 * np.array([1.959964, 0.0, -1.959964])
    left = 0.05 / rates
    times = np.log(left / (0.05 * (5.0 + left))) / rates
    found = time_to_go(state, cov, 20.0)
    assert (found.low, found.median, found.high) == pytest.approx(tuple(times), rel=2e-3)
    wide = time_to_go(state, cov, 20.0, quantile=2.0 * 1.96)
    assert wide.high - wide.median > 2.0 * (found.high - found.median)
    noisy = time_to_go(state, np.zeros((3, 3)), 20.0, 1.0)
    begun = 20.0 + np.array([1.0, -1.0]) * 1.959964
    assert (noisy.low, noisy.high) == pytest.approx(tuple(np.log(5.0 / (0.05 * (30.0 - np.sort(begun)))) / 0.01), rel=1e-4)


def test_minutes_of_the_clock_at_each_pace():
    """The last one lasts; none at all where it stands still."""
    assert clock_time(7.0, ()) == 7.0
    assert clock_time(60.0, [Pace(30.0, 2.0), Pace(5.0, 0.5)]) == 30.0
    assert clock_time(61.0, [Pace(30.0, 2.0), Pace(5.0, 0.5)]) == 32.0
    assert clock_time(20.0, [Pace(30.0, 2.0), Pace(5.0, 0.5)]) == 10.0
    assert clock_time(1.0, [Pace(30.0, 0.0)]) is None
    assert clock_time(0.0, [Pace(30.0, 0.0)]) == 0.0
    assert clock_time(math.inf, [Pace(30.0, 1.0)]) is None
    state = np.array([25.0, 0.05, 0.01])
    for band in (0.0, 1.0):
        with pytest.raises(ValueError, match="between 0 and 1"):
            time_to_go(state, np.zeros((3, 3)), 20.0, band=band)
    for pace in (Pace(0.0, 1.0), Pace(1.0, -0.1), Pace(1.0, math.inf), Pace(math.inf, 1.0)):
        with pytest.raises(ValueError, match="a pace needs"):
            time_to_go(state, np.zeros((3, 3)), 20.0, paces=[pace])
