"""Coloured noise in a residual: is it stationary, which ARMA model describes it, and what it costs the slow parameters.

The way is that of a paper on a gyroscope's random drift (correlogram, differences until it decays, ARMA by AIC, Kalman filter on
its state space form; Box & Jenkins 1970). Signs are those of EViews and statsmodels:

    x(k) = phi_1 x(k-1) + ... + phi_p x(k-p) + w(k) + theta_1 w(k-1) + ... + theta_q w(k-q)

A series is (N,), evenly spaced, with mean zero, nan where a reading is missing.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dtbtrs
from scipy.optimize import least_squares

from ..core.fit import Array

MOST_AR, MOST_MA = 3, 2
#: Orders (p, q) among which the long-run factor is looked for: more parameters add spread, not truth.
LONG_RUN_ORDERS = ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1))
#: A moving average of 1 + sum theta below this has a hole in its spectrum at frequency zero.
HOLE = 0.1
#: Fewest readings from which a noise model is fitted.
FEWEST = 20
#: Partial autocorrelations stay this far inside the unit circle's edge: a variance at the edge is infinite.
EDGE = 0.9995
#: The filter's variances have settled when they are this close to the innovation variance.
SETTLED = 1e-11
#: Steps of the search from one start: at an edge of the region it is flat, and the search would crawl.
MOST_STEPS = 100
#: Two-sided 95 % of a normal number, as the paper has it.
BAND = 1.96


@dataclass(frozen=True)
class NoiseModel:
    """ARMA(p, q) noise: phi (p,), theta (q,), innovation variance [unit^2], AIC by all n readings it was fitted to."""

    phi: Array
    theta: Array
    innovation_variance: float
    aic: float = math.nan
    n: int = 0

    @property
    def order(self) -> tuple[int, int]:
        """(p, q)."""
        return len(self.phi), len(self.theta)

    @property
    def variance(self) -> float:
        """Variance of one reading [unit^2]."""
        return self.innovation_variance * _start_covariance(*_padded(self.phi, self.theta))[0]

    @property
    def long_run_factor(self) -> float:
        """Variance of a long mean, relative to that of white noise of the same variance: 2 pi f(0) / variance.

        (1 + phi) / (1 - phi) for AR(1); below 1 where neighbours are opposite, as in a differenced series.
        """
        return 2.0 * math.pi * float(self.spectrum(np.zeros(1))[0]) / self.variance

    def spectrum(self, frequency: Array) -> Array:
        """Spectral density (m,) [unit^2] at angular frequencies (m,) [rad per reading]; its integral over +-pi is the variance."""
        z = np.exp(-1j * np.asarray(frequency, dtype=float))
        above = np.polyval(np.append(self.theta[::-1], 1.0), z)
        below = np.polyval(np.append(-self.phi[::-1], 1.0), z)
        density: Array = self.innovation_variance / (2.0 * math.pi) * np.abs(above / below) ** 2
        return density

    def autocovariance(self, count: int) -> Array:
        """Autocovariances (count,) [unit^2] at lags 0, 1, ..."""
        phi, theta = _padded(self.phi, self.theta)
        c = _start_covariance(phi, theta)
        # The state's first row is the covariance of a reading with the moving-average parts still to come.
        state, out = [c[0], c[1], c[2]], []
        for _ in range(count):
            first = state[0]
            out.append(first)
            state = [phi[0] * first + state[1], phi[1] * first + state[2], phi[2] * first]
        return self.innovation_variance * np.array(out)


@dataclass(frozen=True)
class Correlogram:
    """Autocorrelations and partial ones (lags,) at lags 1, 2, ..., with the half widths of their 95 % bands.

    `bartlett` (lags,) is the band of an autocorrelation if all from that lag on are nothing (equation 1), `quenouille` that of
    a partial one (equation 2).
    """

    autocorrelation: Array
    partial: Array
    bartlett: Array
    quenouille: float


@dataclass(frozen=True)
class Stationarity:
    """Whether a series is stationary.

    decays_at: first lag from which on the autocorrelations stay inside Bartlett's band but for one in ten, or -1;
    unit_root: Dickey and Fuller's t with a constant, and its 5 % quantile under a unit root (MacKinnon 2010).
    """

    stationary: bool
    decays_at: int
    unit_root: float
    critical: float


def correlogram(series: Array, lags: int) -> Correlogram:
    """Correlogram of a series (N,) without gaps at lags 1 ... lags < N; equations (1) and (2) of the paper.

    Raises ValueError for gaps, a constant series or too many lags.
    """
    n = len(series)
    x = series - series.mean()
    total = float(x @ x)
    if not total > 0.0 or not 0 < lags < n:
        raise ValueError("a correlogram needs a varying series without gaps, longer than its lags")
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(x, size)) ** 2
    rho = np.fft.irfft(power, size)[1 : lags + 1] / total
    before = np.concatenate([[0.0], np.cumsum(rho[:-1] ** 2)])
    return Correlogram(rho, _partials(rho), BAND * np.sqrt((1.0 + 2.0 * before) / n), BAND / math.sqrt(n))


def stationarity(series: Array) -> Stationarity:
    """Stationarity of a series (N,) without gaps, N >= 20.

    The paper looks whether the correlogram goes to zero. Here: whether it does so within a quarter of the record, and
    whether a unit root is refused at 5 % (Dickey & Fuller 1979, (N-1)^(1/3) lagged differences); both must hold.
    Raises ValueError as :func:`correlogram`, or for a short series.
    """
    n = len(series)
    if n < FEWEST:
        raise ValueError(f"a stationarity check needs {FEWEST} readings, not {n}")
    lags = min(n // 4, 200)
    found = correlogram(series, lags)
    outside = np.abs(found.autocorrelation) > found.bartlett
    share = np.cumsum(outside[::-1])[::-1] / np.arange(lags, 0, -1)
    inside = np.flatnonzero((share <= 0.1) & ~outside)
    decays = int(inside[0]) + 1 if len(inside) else -1
    lagged = int((n - 1) ** (1.0 / 3.0) + 1e-9)  # of 64 it is 4, whatever the power makes of a third
    t = _dickey_fuller(series, lagged)
    used = n - 1 - lagged
    critical = -2.86154 - 2.8903 / used - 4.234 / used**2 - 40.04 / used**3
    return Stationarity(0 < decays < lags and t < critical, decays, t, critical)


def fit_arma(series: Array, p: int, q: int) -> NoiseModel:
    """ARMA(p, q), p <= 3, q <= 2, of a series (N,) by exact maximum likelihood; nan are gaps.

    The innovations and variances are those of the Kalman filter of :func:`innovations`; the innovation variance is
    concentrated out. Raises ValueError for an order out of range, fewer than 20 readings, or a series of zeros.
    """
    if not (0 <= p <= MOST_AR and 0 <= q <= MOST_MA):
        raise ValueError(f"ARMA({p}, {q}) is beyond ARMA({MOST_AR}, {MOST_MA})")
    series = np.asarray(series, dtype=float)
    n = int(np.isfinite(series).sum())
    if n < FEWEST or not np.nanmax(np.abs(series)) > 0.0:
        raise ValueError(f"a noise model needs {FEWEST} readings that are not all zero")
    scale = math.sqrt(float(np.nanmean(series**2)))
    x = series / scale

    def scaled_innovations(free: Array) -> Array:
        """(n,) whose sum of squares is n times exp of (-2 log L / n) but for constants."""
        e, f = innovations(x, *_from_free(free, p))
        seen = np.isfinite(e)
        found: Array = e[seen] / np.sqrt(f[seen]) * math.exp(0.5 * float(np.log(f[seen]).mean()))
        return found

    best, least = np.zeros(p + q), math.inf
    if p + q == 0:
        least = float((scaled_innovations(best) ** 2).sum())
    else:
        for start in _starts(x, p, q):
            found = least_squares(scaled_innovations, start, method="trf", xtol=1e-8, ftol=1e-10, gtol=1e-10, max_nfev=MOST_STEPS)
            if 2.0 * found.cost < least:
                best, least = found.x, 2.0 * float(found.cost)
    phi, theta = _from_free(best, p)
    e, f = innovations(x, phi, theta)
    variance = float(np.nanmean(e * e / f)) * scale**2
    deviance = n * (math.log(2.0 * math.pi * least / n) + 1.0) + 2.0 * n * math.log(scale)
    return NoiseModel(phi, theta, variance, deviance + 2.0 * (p + q + 1), n)


def select_arma(series: Array, most_p: int = MOST_AR, most_q: int = MOST_MA) -> NoiseModel:
    """The ARMA(p, q) of least AIC among p <= most_p, q <= most_q. Raises ValueError as :func:`fit_arma`.

    Akaike's AIC = -2 log L + 2 (p + q + 1), which is the paper's N log(variance) + 2 k but for terms that all orders share.
    """
    orders = [(p, q) for p in range(most_p + 1) for q in range(most_q + 1)]
    return min((fit_arma(series, p, q) for p, q in orders), key=lambda m: m.aic)


def long_run_factor(residual: Array) -> float:
    """By which factor (>= 1) the variance of slow parameters is larger than if this residual (N,) were white; nan are gaps.

    Long-run variance over variance of the ARMA model of least AIC among LONG_RUN_ORDERS, at most N/4; 1 for fewer than 20
    readings or a residual of zeros. Models whose spectrum vanishes at frequency zero are left out: that hole is what the fit of
    a mean or a slow curve leaves in its own residual, and in one short record of twenty it would be taken for the noise's.
    For the same reason the factor comes out low on short records. A misfit is coloured too and is counted as noise here.
    """
    n = int(np.isfinite(residual).sum())
    if n < FEWEST or not np.nanmax(np.abs(residual)) > 0.0:
        return 1.0
    fits = [fit_arma(residual, p, q) for p, q in LONG_RUN_ORDERS]
    model = min((m for m in fits if 1.0 + m.theta.sum() > HOLE), key=lambda m: m.aic)
    return min(max(model.long_run_factor, 1.0), n / 4.0)


def innovations(series: Array, phi: Array, theta: Array, measurement_variance: float = 0.0) -> tuple[Array, Array]:
    """One-step prediction errors (N,), nan in gaps, and their variances (N,) per unit of the innovation variance."""
    run = _kalman(series, phi, theta, measurement_variance)
    return run[0], run[1]


def whitened(columns: Array, model: NoiseModel) -> Array:
    """Columns (N,) or (N, m) carried over to where the model's noise is white with variance 1; nan in gaps.

    A residual and the columns of its tangent go through alike: least squares on the outcome is generalised least squares.
    Every column must have the gaps of the series itself.
    """
    if columns.ndim == 2:
        return np.column_stack([whitened(c, model) for c in columns.T])
    e, f = innovations(columns, model.phi, model.theta)
    white: Array = e / np.sqrt(f * model.innovation_variance)
    return white


def _padded(phi: Array, theta: Array) -> tuple[list[float], list[float]]:
    """Both, phi (3,) and theta (2,), as floats, filled up with zeros."""
    return [*map(float, phi), *[0.0] * (MOST_AR - len(phi))], [*map(float, theta), *[0.0] * (MOST_MA - len(theta))]


def _start_covariance(phi: list[float], theta: list[float]) -> tuple[float, float, float, float, float, float]:
    """Stationary covariance (11, 12, 13, 22, 23, 33) of the state, per unit of the innovation variance."""
    step = np.array([[phi[0], 1.0, 0.0], [phi[1], 0.0, 1.0], [phi[2], 0.0, 0.0]])
    entry = np.array([1.0, *theta])
    p = np.linalg.solve(np.eye(9) - np.kron(step, step), np.outer(entry, entry).ravel()).reshape(3, 3)
    return p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2]


def _kalman(series: Array, phi: Array, theta: Array, r: float) -> tuple[Array, Array, Array]:
    """Innovations (N,), their variances (N,) and the filtered first state (N,), for measurement variance r; variances per unit.

    State space form of Harvey (1989), section 3.3, three states, written out because a loop over small matrices costs ten times as
    much. Once the covariance has settled (r = 0), the rest of a stretch is one banded solution.
    """
    (f1, f2, f3), (t1, t2) = _padded(phi, theta)
    n = len(series)
    y = np.asarray(series, dtype=float)
    gaps = np.append(np.flatnonzero(np.isnan(y)), n)
    e, f, drift = np.full(n, np.nan), np.ones(n), np.array(y)
    a1 = a2 = a3 = 0.0
    p11, p12, p13, p22, p23, p33 = _start_covariance([f1, f2, f3], [t1, t2])
    k, values = 0, y.tolist()
    while k < n:
        s = p11 + r
        f[k] = s
        value = values[k]
        if value == value:
            g = value - a1
            e[k] = g
            g1, g2, g3 = p11 / s, p12 / s, p13 / s
            a1, a2, a3 = a1 + g1 * g, a2 + g2 * g, a3 + g3 * g
            p22, p23, p33 = p22 - g2 * p12, p23 - g2 * p13, p33 - g3 * p13
            p11, p12, p13 = p11 - g1 * p11, p12 - g1 * p12, p13 - g1 * p13
        drift[k] = a1
        settled = r == 0.0 and value == value and p22 + p33 < SETTLED
        a1, a2, a3 = f1 * a1 + a2, f2 * a1 + a3, f3 * a1
        p11, p12, p13, p22, p23, p33 = (
            f1 * f1 * p11 + 2.0 * f1 * p12 + p22 + 1.0,
            f1 * f2 * p11 + f1 * p13 + f2 * p12 + p23 + t1,
            f3 * (f1 * p11 + p12) + t2,
            f2 * f2 * p11 + 2.0 * f2 * p13 + p33 + t1 * t1,
            f3 * (f2 * p11 + p13) + t1 * t2,
            f3 * f3 * p11 + t2 * t2,
        )
        k += 1
        if settled:
            end = int(gaps[np.searchsorted(gaps, k)])
            if end - k > 8:
                x = y[k:end]
                e[k:end] = _steady_innovations(x, (f1, f2, f3), (t1, t2), (a1, a2, a3))
                u, v = e[end - 1], e[end - 2]
                a3 = f3 * x[-1]
                a2 = f2 * x[-1] + t2 * u + f3 * x[-2]
                a1 = f1 * x[-1] + t1 * u + f2 * x[-2] + t2 * v + f3 * x[-3]
                k = end
    return e, f, drift


def _steady_innovations(
    x: Array, phi: tuple[float, float, float], theta: tuple[float, float], state: tuple[float, float, float]
) -> Array:
    """Innovations (n,) of a stretch x (n,) that starts from a known state: theta(B) e = phi(B) x."""
    right = x.copy()
    for lag, value in enumerate(phi, 1):
        right[lag:] -= value * x[:-lag]
    right[:3] -= state
    if theta == (0.0, 0.0):
        return right
    band = np.ones((3, len(x)))
    band[1], band[2] = theta
    e: Array = dtbtrs(band, right[:, None], uplo="L", diag="U")[0][:, 0]
    return e


def _from_free(free: Array, p: int) -> tuple[Array, Array]:
    """Stationary phi (p,) and invertible theta (q,) from free numbers (p + q,): Monahan 1984, by partial autocorrelations."""
    partial = EDGE * free / np.sqrt(1.0 + free * free)
    return _step_up(partial[:p]), -_step_up(partial[p:])


def _to_free(phi: Array, theta: Array) -> Array:
    """The inverse of :func:`_from_free`; what lies outside is brought inside."""
    partial = np.clip(np.concatenate([_step_down(phi), _step_down(-theta)]) / EDGE, -0.98, 0.98)
    free: Array = partial / np.sqrt(1.0 - partial * partial)
    return free


def _step_up(partial: Array) -> Array:
    """Coefficients of an autoregression from its partial autocorrelations (Durbin & Levinson)."""
    phi = np.zeros(0)
    for value in partial:
        phi = np.append(phi - value * phi[::-1], value)
    return phi


def _step_down(phi: Array) -> Array:
    """Partial autocorrelations of an autoregression from its coefficients."""
    partial = np.zeros(len(phi))
    for k in range(len(phi) - 1, -1, -1):
        value = float(np.clip(phi[k], -0.98, 0.98))
        partial[k] = value
        phi = (phi[:k] + value * phi[:k][::-1]) / (1.0 - value * value)
    return partial


def _partials(rho: Array) -> Array:
    """Partial autocorrelations (m,) from autocorrelations (m,) at lags 1 ... m (Durbin & Levinson)."""
    phi, partial, left = np.zeros(0), np.zeros(len(rho)), 1.0
    for k, value in enumerate(rho):
        partial[k] = (value - phi @ rho[:k][::-1]) / left
        phi = np.append(phi - partial[k] * phi[::-1], partial[k])
        left = max(left * (1.0 - partial[k] ** 2), 1e-12)
    return partial


def _starts(x: Array, p: int, q: int) -> list[Array]:
    """Free parameters (p + q,) to start from: those of Hannan and Rissanen (1982), and those of a plain autoregression."""
    x = np.nan_to_num(x)
    plain, _ = _regression(x, x, p, 0)
    starts = [_to_free(plain, np.zeros(q))]
    if q:
        long = min(int(10.0 * math.log10(len(x))), len(x) // 5)
        _, rest = _regression(x, x, long, 0)
        found, _ = _regression(x, rest, p, q)
        starts.append(_to_free(found[:p], found[p:]))
    return starts


def _regression(x: Array, noise: Array, p: int, q: int) -> tuple[Array, Array]:
    """Coefficients (p + q,) of x (n,) on its own lags and those of the noise (n,), and what they leave (n,)."""
    first = max(p, q)
    columns = [x[first - k : len(x) - k] for k in range(1, p + 1)] + [noise[first - k : len(x) - k] for k in range(1, q + 1)]
    rest = x.copy()
    if not columns:
        return np.zeros(0), rest
    basis = np.column_stack(columns)
    found = np.asarray(np.linalg.lstsq(basis, x[first:], rcond=None)[0], dtype=np.float64)
    rest[first:] -= basis @ found
    return found, rest


def _dickey_fuller(series: Array, lags: int) -> float:
    """Student's t of the level in a regression of the differences on the level before, a constant and lagged differences."""
    step = np.diff(series)
    rows = len(step) - lags
    columns = [series[lags:-1], np.ones(rows)] + [step[lags - k : len(step) - k] for k in range(1, lags + 1)]
    basis = np.column_stack(columns)
    found, _, rank, _ = np.linalg.lstsq(basis, step[lags:], rcond=None)
    rest = step[lags:] - basis @ found
    inverse = np.linalg.pinv(basis.T @ basis)
    return float(found[0] / math.sqrt(max(float(rest @ rest) / (rows - rank) * inverse[0, 0], 1e-300)))
