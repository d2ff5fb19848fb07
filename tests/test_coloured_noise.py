"""Generalised least squares with white noise and with a low-rank one, against dense covariances that the project does not build.

The oracle's covariances are those of a random walk and of an Ornstein-Uhlenbeck process through a first-order lag, by quadrature over
the convolution; its estimates are scipy's least squares of the readings whitened by a Cholesky factor, its likelihood scipy's.
"""

import numpy as np
import pytest
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares
from scipy.stats import chi2, multivariate_normal

from thermofast.models import Observations
from thermofast.models.coloured import fit_with_noise, posterior
from thermofast.models.joint import LEVEL, RATE, START, at_rates, fit_model, refit
from thermofast.models.noise.discrepancy import Columns, Flutter, Noise, RandomWalk

WALK, LOAD = 0.10, 0.01
ROOM = Noise((RandomWalk(WALK),))
BOTH = Noise((RandomWalk(WALK, shared=True), Flutter(LOAD, shared=False)))
RATES, RISES = np.array([0.02, 0.03]), np.array([9.0, 6.0])


def lagged(kernel, time, rate, other_rate):
    """Covariance (n, n) of b exp(-b u) * w at `time` with the same of another rate; kernel(u, v) is w's, by the trapezoidal rule."""
    fine = np.linspace(0.0, time[-1], 801)
    weights = [np.where(fine <= t, r * np.exp(-r * np.maximum(t - fine, 0.0)), 0.0) for r in (rate, other_rate) for t in time]
    first, second = np.array(weights[: len(time)]), np.array(weights[len(time) :])
    rule = np.full(len(fine), fine[1])
    rule[[0, -1]] /= 2.0
    return (first * rule) @ kernel(fine[:, None], fine) @ (second * rule).T


def walk(u, v):
    return WALK**2 / 60.0 * np.minimum(u, v)


def load(u, v):
    return LOAD**2 * np.exp(-np.abs(u - v) / 30.0)


def dense(time, used, noise):
    """Covariance of the readings in use, sensor after sensor: a room that both feel and a load that each has of its own."""
    n = len(time)
    whole = np.zeros((2 * n, 2 * n))
    for i in range(2):
        for j in range(2):
            block = lagged(walk, time, RATES[i], RATES[j])
            if i == j:
                block = block + RISES[i] ** 2 * lagged(load, time, RATES[i], RATES[i])
            whole[i * n : (i + 1) * n, j * n : (j + 1) * n] = block
    whole += noise**2 * np.eye(2 * n)
    keep = used.ravel()
    return whole[np.ix_(keep, keep)]


def record(seed, gaps=False, noise=0.02):
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0.0, 120.0, 60)) if gaps else np.arange(0.0, 120.0, 2.0)
    time -= time[0]
    reading = 18.0 + RISES[:, None] * -np.expm1(-RATES[:, None] * time)
    reading += BOTH.columns(time, RATES, RISES).draw(rng) + noise * rng.standard_normal(reading.shape)
    weight = np.ones(reading.shape)
    if gaps:
        weight[0, 20:27] = 0.0
    return Observations("run", ("T1", "T2"), time, reading, weight, np.full(2, noise), np.zeros(2))


def test_columns_have_the_covariance_of_what_they_stand_for():
    time = np.array([0.0, 7.0, 15.0, 33.0, 60.0, 90.0, 120.0])
    columns = BOTH.columns(time, RATES, RISES)
    shared, own = columns.shared, columns.own
    found = np.einsum("kin,kjm->ijnm", shared, shared)
    for i in range(2):
        for j in range(2):
            assert found[i, j] == pytest.approx(lagged(walk, time, RATES[i], RATES[j]), abs=0.01 * WALK**2)
    alone = np.einsum("kn,km->nm", own[:, 0], own[:, 0])
    truth = RISES[0] ** 2 * lagged(load, time, RATES[0], RATES[0])
    assert alone == pytest.approx(truth, abs=0.03 * truth.max())


@pytest.mark.parametrize("gaps", [False, True])
def test_the_fit_is_that_of_the_dense_covariance(gaps):
    run = record(3, gaps)
    fit = fit_with_noise(run, BOTH)
    known = posterior(fit)
    rates, rises = fit.values[RATE], fit.values[LEVEL] - fit.values[START]
    columns = BOTH.columns(run.time, rates, rises)
    used = run.used
    b_own = [np.concatenate([columns.own[:, i] if i == j else 0.0 * columns.own[:, j] for j in range(2)], axis=1) for i in range(2)]
    basis = np.concatenate([*b_own, np.concatenate([columns.shared[:, 0], columns.shared[:, 1]], axis=1)])[:, used.ravel()]
    covariance = basis.T @ basis + 0.02**2 * np.eye(int(used.sum()))
    root = np.linalg.inv(np.linalg.cholesky(covariance))

    def residual(p):
        curves = p[1::3, None] + (p[2::3, None] - p[1::3, None]) * np.exp(-np.exp(p[0::3, None]) * run.time)
        return (run.reading - curves)[used]

    start = np.column_stack([np.log(rates), fit.values[LEVEL], fit.values[START]]).ravel()
    theirs = least_squares(lambda p: root @ residual(p), start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    ours = np.column_stack([np.log(rates), fit.values[LEVEL], fit.values[START]]).ravel()
    spread = np.sqrt(np.diag(np.linalg.inv(theirs.jac.T @ theirs.jac)))
    assert np.abs(ours - theirs.x).max() < 0.05 * spread.max()
    assert (np.abs(ours - theirs.x) < 0.05 * spread).all()
    mine = np.sqrt(np.array([known.local[i, j, j] for i in range(2) for j in range(3)]))
    assert mine == pytest.approx(spread, rel=1e-3)
    likelihood = multivariate_normal(cov=covariance, allow_singular=False).logpdf(residual(ours))
    assert known.log_likelihood == pytest.approx(likelihood, abs=1e-3)
    assert fit.residual[~used] == pytest.approx(0.0)


def test_the_likelihood_is_that_of_the_processes_themselves():
    run = record(5)
    fit = fit_with_noise(run, BOTH)
    factor, left = np.linalg.cholesky(dense(run.time, run.used, 0.02)), (run.reading - fit.curve).ravel()
    white = solve_triangular(factor, left, lower=True)
    truth = -0.5 * (white @ white + len(left) * np.log(2.0 * np.pi)) - np.log(np.diag(factor)).sum()
    # The dense one is at the true rates, ours at the fitted ones; few columns stand for the whole process.
    assert posterior(fit).log_likelihood == pytest.approx(truth, abs=1.5)


def test_white_noise_is_the_fit_without_and_its_likelihood_the_normal_one():
    run = record(7)
    plain, coloured = fit_model(run), fit_with_noise(run, Noise(), rounds=1)
    assert coloured.values[LEVEL] == pytest.approx(plain.values[LEVEL], abs=1e-4)
    assert coloured.discrepancy == pytest.approx(0.0)
    normal = multivariate_normal(cov=0.02**2 * np.eye(run.reading.size)).logpdf((run.reading - coloured.curve).ravel())
    assert posterior(coloured).log_likelihood == pytest.approx(normal, abs=1e-6)
    with pytest.raises(ValueError, match="without a noise model"):
        posterior(plain)


@pytest.mark.proof
def test_predictions_cover_what_comes_where_white_noise_does_not():
    ends = np.array([0.0, 300.0, 301.0])
    inside, white_inside, distance = [], [], []
    for seed in range(30):
        rng = np.random.default_rng(100 + seed)
        time = np.arange(0.0, 302.0, 1.0)
        reading = 18.0 + RISES[:, None] * -np.expm1(-RATES[:, None] * time)
        reading += BOTH.columns(time, RATES, RISES).draw(rng)
        clean = reading[:, 300]
        weight = np.where(time <= 60.0, 1.0, 0.0) * np.ones(reading.shape)
        run = Observations(
            "run", ("T1", "T2"), time, reading + 0.02 * rng.standard_normal(reading.shape), weight, np.full(2, 0.02), np.zeros(2)
        )
        for noise, hits in ((BOTH, inside), (Noise(), white_inside)):
            fit = fit_with_noise(run, noise, rounds=3)
            rate, rise = fit.values[RATE], fit.values[LEVEL] - fit.values[START]
            far = Observations("far", run.channels, ends, np.zeros((2, 3)), np.ones((2, 3)), run.noise, run.resolution)
            mean, variance = posterior(fit).predict(far, noise.columns(ends, rate, rise, span=301.0))
            hits.append(np.abs(clean - mean[:, 1]) < 1.96 * np.sqrt(variance[:, 1]))
            if noise is BOTH:
                distance.append(float(((clean - mean[:, 1]) ** 2 / variance[:, 1]).sum()))
    assert np.mean(inside) > 0.88
    assert np.mean(white_inside) < 0.5
    assert np.mean(distance) < chi2.ppf(0.999, 2 * 30) / 30 * 1.4


def test_nothing_drives_white_noise():
    none = Noise().columns(np.arange(5.0), RATES, RISES)
    assert none.own.shape == (0, 2, 5)
    assert Columns.none(2, 5).discrepancy(np.zeros((2, 0)), np.zeros(0)) == pytest.approx(0.0)


def test_the_variance_of_a_prediction_is_that_of_the_whole_normal_equations():
    run = record(11)
    fit = fit_with_noise(run, BOTH)
    m, k, n = len(fit.columns.own), len(fit.columns.shared), len(run.time)
    size = 2 * (3 + m) + k
    jacobian = np.zeros((2, n, size))
    for i in range(2):
        at = i * (3 + m)
        jacobian[i, :, at : at + 3] = fit.by_local[:, i].T
        jacobian[i, :, at + 3 : at + 3 + m] = fit.columns.own[:, i].T
        jacobian[i, :, 2 * (3 + m) :] = fit.columns.shared[:, i].T
    prior = np.ones(size)
    prior[[*range(3), *range(3 + m, 6 + m)]] = 0.0
    precision = np.einsum("ina,inb->ab", jacobian, jacobian) / 0.02**2 + np.diag(prior)
    dense = np.einsum("ina,ab,inb->in", jacobian, np.linalg.inv(precision), jacobian)
    mean, variance = posterior(fit).predict(run, fit.columns)
    assert variance == pytest.approx(dense, rel=1e-3)
    assert mean == pytest.approx(fit.curve + fit.discrepancy, abs=1e-9)


def test_a_fit_fitted_again_keeps_its_noise_and_its_errors_know_of_it():
    run = record(11)
    fit = fit_with_noise(run, BOTH)
    assert refit(fit, run.without(run.time > 80.0)).columns is fit.columns
    assert at_rates(fit, np.array([0.03, 0.04])).columns is fit.columns
    known = posterior(fit)
    assert fit.covariance[0] == pytest.approx(known.local[:, :3, :3])
    assert (fit.deviations[LEVEL] > 3.0 * fit_model(run).deviations[LEVEL]).all()
