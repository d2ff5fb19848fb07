"""What every filter, built-in or plug-in, must do."""

import pickle
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from simulator import spindle

from thermofast.errors import UsageError
from thermofast.estimation.closing import estimate_at
from thermofast.filters import BUILT_IN, PRINTED, Ekf, FadingUkf, Filter, LeastSquares, Ukf
from thermofast.filters.fading import AdaptiveFading, FadingRule, InnovationFading, NoFading
from thermofast.filters.loop import GaussianFilter
from thermofast.filters.loop import run as run_filter
from thermofast.filters.moments import Linearised, Moments, ScaledPoints, SymmetricPoints, semidefinite_root
from thermofast.filters.rls import Rls
from thermofast.models import Lump, PrintedLump
from thermofast.models.imperfection import NONE, TYPICAL
from thermofast.models.lump import LumpStart
from thermofast.pipeline.methods import choose
from thermofast.plugins.filters import declaration_problem as check_filter

GAUSSIAN = [f() for f in BUILT_IN if issubclass(f, GaussianFilter)]


@dataclass(frozen=True)
class Cart:
    """A linear model: position and speed. On it every Gaussian filter is the Kalman filter."""

    state_names = ("position", "speed")
    compiled = None

    def step(self, state, dt):
        return state @ np.array([[1.0, 0.0], [dt, 1.0]])

    def jacobian(self, state, dt):
        return np.array([[1.0, dt], [0.0, 1.0]])

    def start(self, time, reading, resolution):
        return LumpStart(0, np.array([reading[0], 0.0]), np.diag([1.0, 4.0]), 0.04, 50.0, np.ones(1), True)


def kalman(time, reading, noise):
    """The textbook Kalman filter, written out."""
    x, p = np.array([reading[0], 0.0]), np.diag([1.0, 4.0]) * noise
    states = [x]
    for k in range(1, len(time)):
        f = np.array([[1.0, time[k] - time[k - 1]], [0.0, 1.0]])
        x, p = f @ x, f @ p @ f.T
        gain = p[:, 0] / (p[0, 0] + noise)
        x = x + gain * (reading[k] - x[0])
        p = p - np.outer(gain, p[0])
        states.append(x)
    return np.array(states), p


@pytest.mark.parametrize("moments", [SymmetricPoints(), ScaledPoints(0.9, 1.0), Linearised()], ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("rule", [NoFading(), InnovationFading(weakening=50.0), AdaptiveFading()], ids=lambda r: r.rule)
def test_on_a_linear_problem_every_gaussian_filter_is_the_kalman_filter(moments, rule):
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.5, 1.5, 60))
    reading = 1.0 + 0.3 * time + 0.2 * rng.standard_normal(60)
    track = run_filter(Cart(), Cart().start(time, reading, 0.0), moments, rule, time, reading)
    expected, p = kalman(time, reading, 0.04)
    assert np.abs(track.state - expected).max() < 1e-10
    assert np.abs(track.covariance[-1] * 0.04 - p).max() < 1e-10


@pytest.mark.parametrize("method", GAUSSIAN, ids=lambda m: m.name)
def test_on_a_linear_problem_the_moments_of_every_gaussian_filter_are_those_of_the_kalman_filter(method):
    """Whatever its fading rule does beside: without one each is the textbook filter."""
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.5, 1.5, 60))
    reading = 1.0 + 0.3 * time + 0.2 * rng.standard_normal(60)
    track = run_filter(Cart(), Cart().start(time, reading, 0.0), method.moments, NoFading(), time, reading)
    expected, p = kalman(time, reading, 0.04)
    assert np.abs(track.state - expected).max() < 1e-10
    assert np.abs(track.covariance[-1] * 0.04 - p).max() < 1e-10


@pytest.mark.parametrize("kind", [Filter, GaussianFilter, Moments, FadingRule], ids=lambda k: k.__name__)
def test_a_contract_is_not_a_filter(kind):
    with pytest.raises(TypeError, match="abstract"):
        kind()


@pytest.mark.parametrize("method", [Ukf(), Ekf(), FadingUkf(weakening=50.0)], ids=lambda m: m.name)
def test_the_lump_with_known_rate_is_linear_too_and_the_compiled_loop_is_the_kalman_filter(method):
    rng = np.random.default_rng(1)
    time, rate, noise = np.arange(80.0), 0.02, 0.0009
    reading = 25 - 7 * np.exp(-rate * time) + 0.03 * rng.standard_normal(80)
    covariance = np.diag([2.0, 0.5, 0.0])
    start = LumpStart(0, np.array([18.0, 0.14, rate]), covariance, noise, 1e9, np.ones(1), True)
    track = run_filter(Lump(), start, method.moments, method.fading_rule, time, reading)
    x, p = np.array([18.0, 0.14]), np.diag([2.0, 0.5])
    f = np.array([[1.0, -np.expm1(-rate) / rate], [0.0, np.exp(-rate)]])
    for k in range(1, 80):
        x, p = f @ x, f @ p @ f.T
        gain = p[:, 0] / (p[0, 0] + 1.0)
        x, p = x + gain * (reading[k] - x[0]), p - np.outer(gain, p[0])
    assert track.state[-1] == pytest.approx([*x, rate], abs=1e-9)
    assert np.abs(track.covariance[-1][:2, :2] - p).max() < 1e-9


@pytest.mark.parametrize("kind", BUILT_IN + PRINTED, ids=lambda k: k.__name__)
def test_a_filter_is_settings_and_repeats_itself(kind):
    method = kind()
    assert pickle.loads(pickle.dumps(method)) == method
    assert check_filter(kind) is None
    time, reading = spindle(np.random.default_rng(3), 90.0)
    model = PrintedLump() if kind in PRINTED else Lump()
    one, two = (method.track(model, time, reading, 0.0) for _ in range(2))
    assert np.array_equal(one.state, two.state, equal_nan=True)
    assert np.array_equal(one.weight, two.weight, equal_nan=True)
    for field in fields(method):
        if field.metadata:
            assert field.metadata["low"] <= field.default <= field.metadata["high"]
            assert field.metadata["meaning"]


@pytest.mark.parametrize("method", [f() for f in BUILT_IN], ids=lambda m: m.name)
def test_a_state_rests_on_the_readings_so_far_alone(method):
    time, reading = spindle(np.random.default_rng(4), 120.0)
    reading[40] += 2.0
    whole = method.track(Lump(), time, reading, 0.0)
    for k in (9, 25, 60, 100):
        part = method.track(Lump(), time[: k + 1], reading[: k + 1], 0.0)
        if k >= whole.first:
            assert np.array_equal(part.state[k], whole.state[k], equal_nan=True)
        a = estimate_at(Lump(), method, whole, time, reading, k, 0.0)
        b = estimate_at(Lump(), method, part, time[: k + 1], reading[: k + 1], k, 0.0)
        assert a.steady_state == b.steady_state
        assert a.steady_state_interval == b.steady_state_interval
        assert a.t95_interval == b.t95_interval


@pytest.mark.parametrize("method", [f() for f in BUILT_IN], ids=lambda m: m.name)
def test_every_filter_finds_the_steady_state_of_a_cool_down_with_gaps(method):
    rng = np.random.default_rng(5)
    time = np.delete(np.arange(240.0), np.arange(50, 70))
    reading = 18.0 + 12.0 * np.exp(-0.02 * time) + 0.02 * rng.standard_normal(len(time))
    track = method.track(Lump(), time, reading, 0.0)
    found = estimate_at(Lump(), method, track, time, reading, len(time) - 1, 0.0)
    assert found.steady_state == pytest.approx(18.0, abs=0.03)
    assert found.t95 == pytest.approx(np.log(20) / 0.02, rel=0.02)
    assert found.steady_state_interval.low < 18.0 < found.steady_state_interval.high


def test_the_printed_filter_diverges_and_says_where():
    broken = 0
    for seed in range(20):
        time, reading = spindle(np.random.default_rng(seed), 60.0)
        track = PRINTED[0]().track(PrintedLump(), time, reading, 0.0)
        if track.diverged_at is not None:
            broken += 1
            assert np.isnan(track.state[track.diverged_at :]).all()
    assert broken >= 15


def test_the_adaptive_rule_tells_three_causes_apart():
    rng = np.random.default_rng(6)
    time, reading = spindle(rng, 200.0)
    method = BUILT_IN[0]()
    clean = method.track(Lump(), time, reading, 0.0)
    assert (clean.weight == 1.0).all()
    assert (clean.fading == 1.0).all()

    spiked = reading.copy()
    spiked[[40, 90]] += 5.0
    track = method.track(Lump(), time, spiked, 0.0)
    assert np.flatnonzero(track.weight == 0.0).tolist() == [40, 90]

    noisy = reading.copy()
    noisy[100:110] += 0.1 * rng.standard_normal(10)
    track = method.track(Lump(), time, noisy, 0.0)
    assert track.noise_factor[103:110].max() > 2.5
    assert track.noise_factor[:95].max() == 1.0

    ramped = reading + 0.002 * np.maximum(0.0, time - 100.0) ** 1.5
    track = method.track(Lump(), time, ramped, 0.0)
    assert track.fading[:100].max() == 1.0
    assert track.fading[100:].max() > 1.0

    jumped = reading + np.where(time >= 120, 1.0, 0.0)
    track = method.track(Lump(), time, jumped, 0.0)
    assert 120 <= int(np.argmax(track.fading)) <= 124
    assert track.state[140, 0] == pytest.approx(jumped[140], abs=0.05)


def test_least_squares_has_no_states_and_fading_wakes_on_a_wrong_model():
    time, reading = spindle(np.random.default_rng(7), 60.0)
    assert np.isnan(LeastSquares().track(Lump(), time, reading).state).all()
    reading[40:] += 0.3
    track = FadingUkf().track(Lump(), time, reading)
    assert track.fading[40] > 1.0


def test_an_indefinite_covariance_is_refused_and_a_semidefinite_one_is_not():
    with pytest.raises(np.linalg.LinAlgError, match="indefinite"):
        semidefinite_root(np.diag([1.0, -1.0]))
    matrix = np.array([[4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    root = semidefinite_root(matrix)
    assert np.abs(root @ root.T - matrix).max() < 1e-12


def test_the_check_of_a_plug_in_explains_what_is_wrong():
    @dataclass(frozen=True)
    class Nameless(Ukf):
        name = ""

    @dataclass(frozen=True)
    class Needy(Ukf):
        name = "needy"
        gain: float = None

        def __init__(self, gain):
            pass

    @dataclass(frozen=True)
    class Trackless(Filter):
        name, summary, reference = "trackless", "x", "y"
        closing = "never"

    assert "derived from thermofast.filters.Filter" in check_filter(42)
    assert "name must be" in check_filter(Nameless)
    assert "must say its meaning and range" in check_filter(Needy)
    assert "no track" in check_filter(Trackless)
    assert check_filter(type("Mine", (Ukf,), {"name": "mine"})) is None
    assert replace(BUILT_IN[0](), gate=4.0).gate == 4.0


@pytest.mark.parametrize(
    ("given", "told"),
    [({"imperfection": replace(TYPICAL, strong_share=0.5)}, "--imperfection FILE"), ({"rates": "shared"}, "--rates shared")],
)
def test_what_a_filter_would_leave_out_without_a_word_is_refused(given, told):
    for name, preset in (("ukf", None), ("afukf", "paper")):
        with pytest.raises(UsageError, match=f"{told} enters the closing estimate"):
            choose(name, preset, (), **given)
    choose("afukf", None, (), **given)
    choose("ukf", None, (), imperfection=NONE)


@pytest.mark.parametrize(
    "method", [k() for k in BUILT_IN if k.name in ("afukf", "fading_ukf", "ast_cqkf", "ckf", "ukf")], ids=lambda m: m.name
)
def test_a_filter_says_how_much_it_has_forgotten(method):
    time = np.arange(150.0)
    reading = np.where(time < 60.0, 20.0 - 30.0 * np.expm1(-time / 30.0), 45.9 - 15.0 * np.expm1(-(time - 59.0) / 30.0))
    reading = reading + 0.02 * np.random.default_rng(4).standard_normal(len(time))
    track = method.track(Lump(), time, reading, 0.0)
    fading = track.fading[np.isfinite(track.fading) & (np.arange(len(time)) >= track.first)]
    assert track.forgotten[-1] == pytest.approx(np.log(fading).sum(), rel=1e-9, abs=1e-12)
    assert (track.forgotten[-1] > 1.0) == (method.name in ("afukf", "fading_ukf", "ast_cqkf"))


@pytest.mark.parametrize("forgetting", [1.0, 0.96])
def test_least_squares_that_forget_know_how_unsure_they_are(forgetting):
    time, rng, told, found = np.arange(0.0, 120.0, 2.0), np.random.default_rng(8), [], []
    method = Rls(forgetting=forgetting)
    assert method.closing == ("always" if forgetting == 1.0 else "never")
    for _ in range(120):
        reading = 20.0 - 9.0 * np.expm1(-time / 40.0) + 0.01 * rng.standard_normal(len(time))
        track = method.track(Lump(), time, reading, 0.0)
        found.append(track.state[-1])
        told.append(np.sqrt(np.diag(track.covariance[-1]) * track.noise_variance[-1]))
    # The noise of the integral is taken for noise of the readings, so that the covariance is a little wide, forgetting or not.
    assert 0.65 < np.std(found, axis=0)[0] / np.median(told, axis=0)[0] < 0.85


class Squared:
    """A model whose step squares every coordinate, or doubles it."""

    def __init__(self, power):
        self.power = power

    def step(self, state, dt):
        return dt * state**self.power


@pytest.mark.parametrize("points", [SymmetricPoints(), ScaledPoints(0.7, 0.4, 2.0), ScaledPoints(1.0, 2.0, 0.0)])
def test_sigma_points_carry_mean_and_covariance(points):
    """Exact for a straight step, and the mean of a square is m^2 + P; the covariance is per unit of the noise variance."""
    mean, covariance, scale = np.array([1.0, -2.0]), np.array([[0.5, 0.2], [0.2, 0.3]]), 0.04
    straight, spread = points.predict(Squared(1), mean, covariance, 3.0, scale)
    np.testing.assert_allclose(straight, 3.0 * mean)
    np.testing.assert_allclose(spread, 9.0 * covariance)
    square = points.predict(Squared(2), mean, covariance, 1.0, scale)[0]
    np.testing.assert_allclose(square, mean**2 + scale * np.diag(covariance))


def test_three_scaled_points_have_the_variance_of_a_gaussian_square():
    """2 P^2 with kappa 2, where n + kappa is the kurtosis, and no shape; eta adds its own share of (1 - phi^2 + eta) P^2."""
    for spread, shape in ((1.0, 0.0), (1.0, 2.0), (0.5, 2.0)):
        found = ScaledPoints(spread, 2.0, shape).predict(Squared(2), np.zeros(1), np.array([[0.7]]), 1.0, 1.0)[1]
        arm = spread**2 * 3.0  # squared distance of the points from the mean, over P
        exact = ((arm - 1.0) ** 2 / arm + (1.0 - 1.0 / arm) + 1.0 - spread**2 + shape) * 0.7**2
        np.testing.assert_allclose(found, exact)
    assert ScaledPoints(0.5).weights(3)[:2] == pytest.approx((0.5 * 3.0**0.5, 1.0 - 4.0))  # kappa 0, eta 2
    assert ScaledPoints(0.5).weights(3)[2] == pytest.approx(1.0 - 4.0 + 1.0 - 0.25 + 2.0)
