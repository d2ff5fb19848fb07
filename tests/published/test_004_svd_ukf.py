"""Electro-hydraulic loading of a servo turret: Yang et al. 2014, Jilin Daxue Xuebao (Gongxueban) 44(2), 392-397.

| figure | printed | ours |
|---|---|---|
| noise of the force before filtering | 0.7662 | 0.7662 (set), 0.7625 drawn |
| after the EKF | 0.0012 | 0.0012 (the one number fitted, by the size of Q) |
| after the SVD-UKF, Q on all five states | 0.00051 | 0.00077 |
| after the SVD-UKF, Q on the newest force alone | 0.00051 | 0.00040 |
| after the SVD-UKF with points drawn anew after Q | - | 0.0012, the EKF to 1e-12 |
| RLS, readings without noise, 0.6 s at 250 Hz | settled by 0.6 s | all ten to the four printed digits |
| RLS, noise in the equation, 0.6 s at 250 kHz | settled by 0.6 s | all ten within 0.0016 |
| RLS, the same noise in the readings | "unbiased" | off by 0.39 |
| RLS on the static and the sine force alone | ten parameters | rank 3 of 10: not determined |

On a linear model an EKF and a UKF are both the Kalman filter. What sets them apart here is in print: (24) passes on the points
of (21), drawn before Q is added in (23), so that Q is missing from Py (26) and Pxy (27) and the gain is lower. That is smoother
wherever Q is larger than the model deserves. Singular values have no part in it: Cholesky gives the same numbers.

Not printed, and chosen here: Q (by the EKF figure), R (the printed noise), the frequency of the sine (1.5 Hz at 250 Hz, the slope
of the printed initial states), the excitation and P0 of the least squares. The state is the last five forces: figure 6 shows
the states before filtering, and the printed initial values are forces in kN.
"""

from functools import cache

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov, svd
from scipy.optimize import brentq
from scipy.signal import lfilter

from thermofast.filters.fading import NoFading
from thermofast.filters.loop import run as run_filter
from thermofast.filters.moments import ScaledPoints, semidefinite_root
from thermofast.filters.rls import RecursiveLeastSquares, arx_regressor
from thermofast.filters.svd import SvdPoints, svd_root
from thermofast.models import Lump

A = np.array([-0.8563, 0.5752, -0.3405, -0.2439, 0.2444])
B = np.array([0.1478, 0.6946, -0.5003, -0.2057, 0.2602])
THETA = np.concatenate([-A, B])
INITIAL = np.array([0.2303, 0.2290, 0.2256, 0.2223, 0.2214])  # the printed ones, the newest first
RAW, PRINTED_EKF, PRINTED_SVD = 0.7662, 0.0012, 0.00051
#: State of the last five forces: x_{k+1} = F x_k + e_1 sum b_i u_{k+1-i}, y = x[0].
F = np.vstack([-A, np.eye(5)[:4]])
Q_SHAPES = {"all five states": np.eye(5), "newest force": np.diag([1.0, 0.0, 0.0, 0.0, 0.0])}


def control(count, rate, noise=0.0, rng=None):
    """Control signal (count,) that holds 0.21 kN and swings the force by 0.06 kN, plus white noise of its own."""
    w = 2.0 * np.pi * 1.5 / rate
    lags = np.exp(-1j * w * np.arange(1, 6))
    u = 0.21 * (1.0 + A.sum()) / B.sum() + 0.06 / abs((B @ lags) / (1.0 + A @ lags)) * np.sin(w * np.arange(count))
    return u if rng is None else u + noise * rng.standard_normal(count)


def plant(u):
    """Force (N,) [kN] of the printed model, at rest before the first sample."""
    return lfilter(np.r_[0.0, B], np.r_[1.0, A], u)


# ---------------------------------------------------------------- filters of a linear model


def kalman(force, drive, q, p):
    """What the EKF is on this model; returns the filtered force (N,) and the last covariance."""
    out, state = np.empty(len(force)), INITIAL.copy()
    for k in range(len(force)):
        state, p = F @ state, F @ p @ F.T + q
        state[0] += drive[k]
        variance = p[0, 0] + RAW
        gain = p[:, 0] / variance
        state, p = state + gain * (force[k] - state[0]), p - np.outer(gain, gain) * variance
        out[k] = state[0]
    return out, p


def svd_ukf(force, drive, q, p, root=svd_root, redrawn=False):
    """Equations (16)-(31) with alpha = 1, kappa = 0 (lambda = 0: the centre counts nothing), the weight (17) mended.

    redrawn=False is the paper's way: the points of (21) go on into (24)-(27) as they are. Returns the filtered force (N,), the
    last covariance and the reading at which the root failed, or None.
    """
    out, state, n = np.empty(len(force)), INITIAL.copy(), len(INITIAL)
    each = 0.5 / n
    for k in range(len(force)):
        try:
            arms = np.sqrt(n) * root(p).T
        except np.linalg.LinAlgError:
            return out[:k], p, k
        points = np.concatenate([state + arms, state - arms]) @ F.T
        points[:, 0] += drive[k]
        state = each * points.sum(axis=0)
        moved = points - state
        p = each * moved.T @ moved + q
        if redrawn:
            arms = np.sqrt(n) * root(p).T
            moved = np.concatenate([arms, -arms])
        foretold = moved[:, 0]
        variance = each * foretold @ foretold + RAW
        gain = each * moved.T @ foretold / variance
        state, p = state + gain * (force[k] - state[0]), p - np.outer(gain, gain) * variance
        p = 0.5 * (p + p.T)
        out[k] = state[0]
    return out, p, None


def steady_gain(q, redrawn):
    """Gain (5,) of either filter after many readings, by the algebraic Riccati equation or by its iteration."""
    h = np.eye(5)[:, :1]
    if redrawn:
        p = solve_discrete_are(F.T, h, q, [[RAW]])
        return p[:, 0] / (p[0, 0] + RAW)
    p = np.eye(5)
    for _ in range(1500):
        moved = F @ p @ F.T
        gain = moved[:, 0] / (moved[0, 0] + RAW)
        p = moved + q - np.outer(gain, gain) * (moved[0, 0] + RAW)
    return gain


def error_variance(gain, process=None):
    """Variance [kN^2] of the filtered force about the true one, by Lyapunov's equation; process (5, 5): the true Q, None for 0."""
    left = np.eye(5) - np.outer(gain, np.eye(5)[0])
    noise = RAW * np.outer(gain, gain) + (0.0 if process is None else left @ process @ left.T)
    return solve_discrete_lyapunov(left @ F, noise)[0, 0]


@cache
def fitted_q(shape):
    """Size of Q at which the EKF leaves the printed 0.0012: the one number of this file that is fitted."""
    return 10.0 ** brentq(lambda d: np.log(error_variance(steady_gain(10.0**d * Q_SHAPES[shape], True)) / PRINTED_EKF), -5, 0)


@cache
def experiment():
    """The true force, its readings (N,), and the known input of each step (N,); 80 s at 250 Hz after the model has settled."""
    count, lead = 20_000, 500
    u = control(count + lead, 250.0)
    truth = plant(u)
    drive = np.convolve(u, np.r_[0.0, B])[: len(u)]
    reading = truth + np.sqrt(RAW) * np.random.default_rng(4).standard_normal(len(u))
    return truth[lead:], reading[lead:], drive[lead:]


def after_settling(estimate):
    return np.var((estimate - experiment()[0])[500:])


def test_the_printed_model_is_stable_and_the_experiment_is_the_printed_one():
    truth, reading, _ = experiment()
    assert np.abs(np.roots(np.r_[1.0, A])).max() == pytest.approx(0.9023, abs=1e-4)
    assert truth.mean() == pytest.approx(0.21, abs=1e-3)
    assert 0.5 * np.ptp(truth) == pytest.approx(0.06, abs=1e-4)
    assert np.var(reading - truth) == pytest.approx(RAW, rel=0.02)
    assert np.diff(INITIAL[::-1]).mean() / 0.06 == pytest.approx(2 * np.pi * 1.5 / 250, rel=0.03)  # the slope of a sine of 1.5 Hz


@pytest.mark.proof
@pytest.mark.parametrize(("shape", "ours"), [("all five states", 0.00077), ("newest force", 0.00040)])
def test_the_order_of_the_printed_noise_figures(shape, ours):
    truth, reading, drive = experiment()
    q, p = fitted_q(shape) * Q_SHAPES[shape], 0.01 * np.eye(5)
    extended, _ = kalman(reading, drive, q, p)
    printed, _, failed = svd_ukf(reading, drive, q, p)
    assert failed is None
    raw, ekf, svdukf = np.var(reading - truth), after_settling(extended), after_settling(printed)
    assert svdukf < ekf < raw
    assert ekf == pytest.approx(PRINTED_EKF, rel=0.15)
    assert svdukf == pytest.approx(ours, rel=0.15)
    assert 0.5 < svdukf / PRINTED_SVD < 2.0
    # And what any record of any length would give.
    assert error_variance(steady_gain(q, True)) == pytest.approx(PRINTED_EKF, rel=1e-6)
    assert error_variance(steady_gain(q, False)) == pytest.approx(ours, rel=0.01)


@pytest.mark.parametrize("shape", Q_SHAPES)
@pytest.mark.parametrize("size", [1e-6, 1e-4, 1e-2, 1.0])
def test_the_printed_points_are_smoother_for_any_q_that_is_too_large_and_worse_for_a_q_that_is_right(shape, size):
    q = size * RAW * Q_SHAPES[shape]
    extended, printed = steady_gain(q, True), steady_gain(q, False)
    assert error_variance(printed) < 0.9 * error_variance(extended)
    assert error_variance(printed, q) > error_variance(extended, q)


def test_with_points_drawn_anew_it_is_the_kalman_filter_and_the_root_does_not_matter():
    _, reading, drive = (part[:400] for part in experiment())
    q, p = fitted_q("all five states") * np.eye(5), 0.01 * np.eye(5)
    expected, covariance = kalman(reading, drive, q, p)
    for root in (svd_root, np.linalg.cholesky, semidefinite_root):
        found, last, _ = svd_ukf(reading, drive, q, p, root, redrawn=True)
        assert np.abs(found - expected).max() < 1e-12
        assert np.abs(last - covariance).max() < 1e-12
    printed = [svd_ukf(reading, drive, q, p, root)[0] for root in (svd_root, np.linalg.cholesky)]
    assert np.abs(printed[0] - printed[1]).max() < 1e-12
    other = KalmanFilter(dim_x=5, dim_z=1, dim_u=1)
    other.x, other.P, other.F, other.Q, other.R = INITIAL[:, None].copy(), p.copy(), F, q, np.array([[RAW]])
    other.H, other.B = np.eye(5)[:1], np.eye(5)[:, :1]
    for k in range(400):
        other.predict(u=drive[k])
        other.update(reading[k])
        assert other.x[0, 0] == pytest.approx(expected[k], abs=1e-12)


def test_the_printed_outer_weight_is_right_for_lambda_one_alone():
    def total(lam, n=5):
        return lam / (lam + n) + 2 * n * lam / (2 * (lam + n))

    assert total(1.0) == pytest.approx(1.0)
    assert total(0.0) == 0.0  # alpha = 1, kappa = 0: every point would count nothing
    assert total(0.25 * 5 - 5) == pytest.approx(-18.0)  # alpha = 0.5, kappa = 0
    for spread, kappa in ((1.0, 0.0), (1.0, 1.0), (0.5, 0.0)):
        _, mean0, _, each = ScaledPoints(spread, kappa).weights(5)
        assert mean0 + 10 * each == pytest.approx(1.0)


def test_without_process_noise_cholesky_fails_on_the_way_and_singular_values_do_not():
    _, reading, drive = experiment()
    none = np.zeros((5, 5))
    _, last, failed = svd_ukf(reading, drive, none, np.eye(5), np.linalg.cholesky)
    assert failed == pytest.approx(44, abs=8)
    assert np.linalg.cond(last) > 1e13
    found, last, failed = svd_ukf(reading, drive, none, np.eye(5))
    assert failed is None
    assert np.isfinite(last).all()
    assert after_settling(found) < 1e-12  # the model is exact, so nothing of the noise is left


# ---------------------------------------------------------------- the root


def covariances(count, rng, spectrum, lowest):
    """Random covariances of 2 to 10 states, condition number 10**lowest(rng), the eigenvalues spread or half of them small."""
    for _ in range(count):
        n, low = int(rng.integers(2, 11)), lowest(rng)
        axes = np.linalg.qr(rng.standard_normal((n, n)))[0]
        between = rng.uniform(0.0, low, n - 2) if spectrum == "spread" else np.where(np.arange(n - 2) < n // 2 - 1, 0.0, low)
        matrix = (axes * 10.0 ** (rng.uniform(-8.0, 8.0) - np.concatenate([[0.0, low], between]))) @ axes.T
        yield 0.5 * (matrix + matrix.T)


def fails(root, matrix):
    try:
        return not np.isfinite(root(matrix)).all()
    except np.linalg.LinAlgError:
        return True


@pytest.mark.parametrize(
    ("spectrum", "lowest", "low", "high"),
    [
        ("spread", lambda rng: rng.uniform(0.0, 16.0), 0, 20),
        ("half small", lambda rng: rng.uniform(0.0, 16.0), 2, 80),
        ("half small", lambda rng: 16.0, 1500, 6000),
    ],
)
def test_ten_thousand_covariances_of_condition_up_to_1e16(spectrum, lowest, low, high):
    """Counted once: Cholesky fails on 0, 31 and 3316 of 10,000, singular values on none. How many hangs on the spectrum."""
    broken, worst = 0, 0.0
    for matrix in covariances(10_000, np.random.default_rng(4), spectrum, lowest):
        root = svd_root(matrix)
        worst = max(worst, np.abs(root @ root.T - matrix).max() / np.abs(matrix).max())
        broken += fails(np.linalg.cholesky, matrix)
    assert worst < 1e-14
    assert low <= broken <= high


def test_the_root_is_that_of_the_singular_values_and_clips_what_rounding_made_negative():
    rng = np.random.default_rng(5)
    half = rng.standard_normal((6, 6))
    u, s, _ = svd(half @ half.T)
    assert np.abs(np.abs(svd_root(half @ half.T)) - np.abs(u * np.sqrt(s))).max() < 1e-10
    assert np.array_equal(svd_root(np.diag([1.0, 4.0, -1e-17])).T @ np.array([0.0, 0.0, 1.0]), np.zeros(3))
    exchange = svd_root(np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert exchange @ exchange.T == pytest.approx(np.full((2, 2), 0.5))
    assert not svd_root(np.zeros((3, 3))).any()
    for size in (1e-300, 1e300):
        assert np.abs(svd_root(size * np.eye(2))).max() == pytest.approx(np.sqrt(size))
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        svd_root(np.array([[np.nan, 0.0], [0.0, 1.0]]))


@pytest.mark.parametrize("points", [(1.0, 0.0), (0.9, 1.0)])
def test_the_points_carry_a_gaussian_as_the_other_points_do(points):
    """Another root moves the mean from the fourth order on, the covariance (per unit of the noise) from the second on."""
    state, p = np.array([18.0, 0.14, np.log(0.02)]), np.array([[2.0, 0.3, 0.0], [0.3, 0.5, 0.2], [0.0, 0.2, 1.0]])
    apart = []
    for scale in (1e-6, 1e-4):
        mean, covariance = SvdPoints(*points).predict(Lump(), state, p, 1.0, scale)
        other_mean, other = ScaledPoints(*points).predict(Lump(), state, p, 1.0, scale)
        apart.append((np.abs(mean - other_mean).max(), np.abs(covariance - other).max()))
    assert apart[0][0] < 1e-10
    assert apart[0][1] < 5e-4
    assert apart[1][1] == pytest.approx(100 * apart[0][1], rel=0.05)


def test_the_readable_loop_is_taken_for_them():
    rng = np.random.default_rng(6)
    time = np.arange(120.0)
    reading = 26.0 - 8.0 * np.exp(-0.02 * time) + 0.02 * rng.standard_normal(120)
    start = Lump().start(time, reading, 0.0)
    one, two = (run_filter(Lump(), start, m, NoFading(), time, reading) for m in (SvdPoints(), ScaledPoints()))
    assert one.diverged_at is None
    assert one.state[-1] == pytest.approx(two.state[-1], rel=1e-3)
    assert not SvdPoints().compiled


# ---------------------------------------------------------------- recursive least squares


def regressors(y, u):
    return np.column_stack([y[4 - i : len(y) - 1 - i] for i in range(5)] + [u[4 - i : len(u) - 1 - i] for i in range(5)])


def identify(y, u, variance=1e8):
    rls = RecursiveLeastSquares(np.zeros(10), variance * np.eye(10))
    for k in range(5, len(y)):
        rls.update(arx_regressor(y[:k], u[:k], 5, 5), float(y[k]))
    return rls


def test_the_ten_parameters_come_back_to_the_printed_digits_within_the_printed_settling():
    """0.6 s at 250 Hz are 150 readings; the control signal carries noise of its own, as section 2 says it does."""
    u = control(150, 250.0, 0.02, np.random.default_rng(4))
    assert np.array_equal(np.round(identify(plant(u), u).theta, 4), THETA)
    # Long before: twice as many readings as parameters and lags.
    assert np.abs(identify(plant(u)[:40], u[:40]).theta - THETA).max() < 1e-3


def test_noise_in_the_equation_leaves_them_unbiased_and_noise_in_the_readings_does_not():
    """0.6 s at the printed 250 kHz are 150,000 readings."""
    rng = np.random.default_rng(0)
    u = control(150_000, 250e3, 0.02, rng)
    noise = 0.001 * rng.standard_normal(len(u))
    y = lfilter(np.r_[0.0, B], np.r_[1.0, A], u) + lfilter([1.0], np.r_[1.0, A], noise)
    found = identify(y, u)
    z = (found.theta - THETA) / (0.001 * np.sqrt(np.diag(found.covariance)))
    assert np.abs(z).max() < 3.5
    assert np.abs(found.theta - THETA).max() < 0.0025
    batch = np.linalg.lstsq(regressors(y, u), y[5:], rcond=None)[0]
    assert np.abs(found.theta - batch).max() < 1e-5
    measured = lfilter(np.r_[0.0, B], np.r_[1.0, A], u) + noise
    biased = np.linalg.lstsq(regressors(measured, u), measured[5:], rcond=None)[0]
    assert np.abs(biased - THETA).max() == pytest.approx(0.39, abs=0.03)
    # Readings as noisy as figure 7 has them, 0.7662 kN^2, leave nothing of the denominator.
    measured = measured + np.sqrt(RAW) * rng.standard_normal(len(u))
    drowned = np.linalg.lstsq(regressors(measured, u), measured[5:], rcond=None)[0]
    assert np.abs(drowned[:5]).max() < 0.1


def test_the_static_and_the_sine_force_alone_do_not_determine_ten_parameters():
    u = control(20_000, 250.0)
    y = plant(u)
    assert np.linalg.matrix_rank(regressors(y, u)[500:], tol=1e-8) == 3
    found = identify(y[500:2500], u[500:2500], 1e6)
    assert np.abs(found.theta - THETA).max() > 0.3
    assert abs(y[3000] - arx_regressor(y[:3000], u[:3000], 5, 5) @ found.theta) < 1e-4  # and yet it foretells the force


@pytest.mark.parametrize(("variance", "least"), [(1.0, 0.7), (1e2, 1e40), (1e8, 1e40)])
def test_with_the_printed_sign_of_the_gain_the_estimate_runs_away_or_hardly_moves(variance, least):
    u = control(150, 250.0, 0.02, np.random.default_rng(4))
    y = plant(u)
    theta, p = np.zeros(10), variance * np.eye(10)
    for row, output in zip(regressors(y, u), y[5:], strict=True):
        gain = p @ row / (1.0 - row @ p @ row)
        theta, p = theta + gain * (output - row @ theta), p - np.outer(gain, row @ p)
    assert np.abs(theta - THETA).max() > least
    assert np.abs(identify(y, u, 1e8).theta - THETA).max() < 5e-5


@pytest.mark.parametrize("forgetting", [1.0, 0.97])
def test_it_is_ridge_regression_with_fading_weights(forgetting):
    rng = np.random.default_rng(7)
    phi, prior = rng.standard_normal((50, 3)), np.array([1.0, -2.0, 0.5])
    y = phi @ np.array([0.3, 1.0, -1.0]) + 0.1 * rng.standard_normal(50)
    rls = RecursiveLeastSquares(prior, 2.0 * np.eye(3), forgetting)
    innovations = [rls.update(row, float(output)) for row, output in zip(phi, y, strict=True)]
    weight = forgetting ** np.arange(49, -1, -1)
    information = 0.5 * forgetting**50 * np.eye(3) + phi.T * weight @ phi
    assert rls.theta == pytest.approx(np.linalg.solve(information, 0.5 * forgetting**50 * prior + phi.T * weight @ y), abs=1e-12)
    assert np.linalg.inv(rls.covariance) == pytest.approx(information, abs=1e-9)
    assert innovations[0] == pytest.approx(y[0] - phi[0] @ prior)


def test_bad_arguments_are_named():
    with pytest.raises(ValueError, match=r"\(3, 3\)"):
        RecursiveLeastSquares(np.zeros(3), np.eye(2))
    with pytest.raises(ValueError, match=r"forgetting is 1\.5"):
        RecursiveLeastSquares(np.zeros(2), np.eye(2), 1.5)
    with pytest.raises(ValueError, match="needs 5 and 5"):
        arx_regressor(np.zeros(4), np.zeros(9), 5, 5)
    assert arx_regressor(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0]), 2, 1).tolist() == [3.0, 2.0, 5.0]
