"""The lump's numerical core in numpy: what runs where no compiler was, and the oracle of the compiled one.

Every function here has a compiled twin of the same name in ``models/core/_lump.pyx``; the tests hold them equal.
Time and rate may be in any pair of reciprocal units; thermofast uses minutes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# What a compiled filter loop would call; there is none in numpy.
SLOPE_STEP = SLOPE_JACOBIAN = PRINTED_STEP = PRINTED_JACOBIAN = None


def growth(rate: Array | float, dt: Array | float) -> Array:
    """(1 - exp(-rate dt)) / rate, continuous at rate = 0; broadcasts."""
    rate, dt = np.asarray(rate, dtype=float), np.asarray(dt, dtype=float)
    z = np.maximum(rate * dt, -60.0)
    small = np.abs(z) < 1e-7
    safe = np.where(small, 1.0, rate)
    result: Array = np.where(small, dt * (1.0 - 0.5 * z), -np.expm1(-z) / safe)
    return result


def growth_slope(rate: Array | float, dt: Array | float) -> Array:
    """Derivative of :func:`growth` with respect to the rate; broadcasts."""
    rate, dt = np.asarray(rate, dtype=float), np.asarray(dt, dtype=float)
    z = np.maximum(rate * dt, -60.0)
    small = np.abs(z) < 1e-3
    safe = np.where(small, 1.0, rate)
    series = dt * dt * (-0.5 + z * (1.0 / 3.0 - z * 0.125))
    result: Array = np.where(small, series, (dt * np.exp(-z) + np.expm1(-z) / safe) / safe)
    return result


GRID = 12
GRID_READINGS = 64


@dataclass(frozen=True)
class FitMoments:
    """What a fit says of its own spread; all variances per unit of the noise variance of a reading of weight 1.

    phi and psi are the centred basis function of the slope and its derivative by the rate.
    """

    rate: float
    slope: float
    level: float
    phi_mean: float
    psi_mean: float
    weight: float
    phi_phi: float
    phi_psi: float
    psi_psi: float
    rss: float

    def rate_covariance(self) -> tuple[float, float, float]:
        """Variance of slope, covariance, variance of rate."""
        a, b, c = self.phi_phi, self.slope * self.phi_psi, self.slope**2 * self.psi_psi
        determinant = a * c - b * b
        if not determinant > 0.0:
            return (1.0 / a if a > 0.0 else math.inf), 0.0, math.inf
        return c / determinant, -b / determinant, a / determinant

    def steady_gradient(self) -> tuple[float, float]:
        """Derivatives of the steady state by slope and by rate."""
        return 1.0 / self.rate - self.phi_mean, self.slope * (-1.0 / self.rate**2 - self.psi_mean)

    def steady_variance(self) -> float:
        """Variance of the steady state to first order."""
        ss, sr, rr = self.rate_covariance()
        by_slope, by_rate = self.steady_gradient()
        return 1.0 / self.weight + by_slope**2 * ss + 2.0 * by_slope * by_rate * sr + by_rate**2 * rr


@dataclass(frozen=True)
class _Sums(FitMoments):
    gradient: float

    def predict(self, dt: Array) -> Array:
        return self.level + self.slope * (growth(self.rate, dt) - self.phi_mean)


class _Problem:
    """Readings of one fit, those of weight zero left out."""

    def __init__(self, t: Array, y: Array, w: Array, signed_rate: bool) -> None:
        use = w > 0.0
        self.t, self.w = (t - t[0])[use], w[use]
        self.n = int(use.sum())
        if self.n < 3 or not self.t[-1] > self.t[0]:
            raise ValueError(f"a fit needs three readings at different times, got {self.n}")
        self.weight = float(self.w.sum())
        self.level = float(self.w @ y[use] / self.weight)
        self.y = y[use] - self.level
        self.span = float(self.t[-1] - self.t[0])
        self.low = (-3.0 if signed_rate else 1e-3) / self.span
        self.high = 5.0 * (self.n - 1) / self.span
        self.signed_rate = signed_rate

    def thinned(self) -> "_Problem":
        """At most GRID_READINGS block means: enough to tell where a long record's rate lies."""
        if self.n <= GRID_READINGS:
            return self
        edges = np.arange(GRID_READINGS) * self.n // GRID_READINGS
        total = np.add.reduceat(self.w, edges)
        thin = object.__new__(_Problem)
        thin.t = np.add.reduceat(self.t * self.w, edges) / total
        thin.y = np.add.reduceat(self.y * self.w, edges) / total
        thin.w, thin.weight, thin.level, thin.n = total, self.weight, self.level, GRID_READINGS
        return thin

    def evaluate(self, rate: float) -> _Sums:
        phi, psi = growth(rate, self.t), growth_slope(rate, self.t)
        phi_mean, psi_mean = float(self.w @ phi) / self.weight, float(self.w @ psi) / self.weight
        phi, psi = phi - phi_mean, psi - psi_mean
        pp = float(self.w @ (phi * phi))
        slope = float(self.w @ (phi * self.y)) / pp if pp > 0.0 else 0.0
        r = self.y - slope * phi
        return _Sums(
            rate,
            slope,
            self.level,
            phi_mean,
            psi_mean,
            self.weight,
            pp,
            float(self.w @ (phi * psi)),
            float(self.w @ (psi * psi)),
            float(self.w @ (r * r)),
            float(self.w @ (r * psi)),
        )

    def best(self) -> _Sums:
        """The fit: the best rate of a grid, refined."""
        thin = self.thinned()
        rates = list(np.geomspace(0.05 / self.span, 0.5 * self.high, GRID))
        if self.signed_rate:
            rates += [-1.0 / self.span, 1e-6 / self.span]
        chosen = min(rates, key=lambda rate: thin.evaluate(float(rate)).rss)
        return _refine(self, self.evaluate(_clip(float(chosen), self.low, self.high)))

    def told(self, s: _Sums) -> tuple[float, ...]:
        return (
            s.rate,
            s.slope,
            s.level,
            s.phi_mean,
            s.psi_mean,
            s.weight,
            s.phi_phi,
            s.phi_psi,
            s.psi_psi,
            s.rss,
            self.n,
            self.span,
            self.low,
            self.high,
        )


def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


def _refine(p: _Problem, best: _Sums) -> _Sums:
    """Gauss-Newton in the rate, amplitudes eliminated; halves a step that does not descend."""
    for _ in range(60):
        curvature = best.psi_psi - best.phi_psi**2 / best.phi_phi if best.phi_phi > 0.0 else 0.0
        curvature *= best.slope**2
        if not curvature > 0.0:
            return best
        step = best.slope * best.gradient / curvature
        scale = abs(best.rate) + 1e-9 * (p.high - p.low)
        if abs(step) <= 1e-11 * scale:
            return best
        for _halving in range(40):
            rate = _clip(best.rate + step, p.low, p.high)
            if rate == best.rate:
                return best
            trial = p.evaluate(rate)
            if trial.rss < best.rss:
                break
            if abs(step) <= 1e-9 * scale:
                return best
            step *= 0.5
        else:
            return best
        best = trial
    return best


def fit_decay(t: Array, y: Array, w: Array, signed_rate: bool) -> tuple[float, ...]:
    """Weighted least squares of y = level + slope (growth(rate, t - t[0]) - its mean), amplitudes eliminated.

    Variable projection (Golub & Pereyra 1973): for a given rate the law is linear in its two amplitudes, so the search
    runs over the rate alone, over all that the record can show; `signed_rate` lets it be negative.

    Parameters: t, y, w of shape (n,), readings of weight 0 are left out. Returns (rate, slope at t[0], level, mean of phi,
    mean of psi, sum of weights, phi.phi, phi.psi, psi.psi, residual sum of squares, readings used, their span, least and
    greatest rate), phi and psi being the centred basis function and its derivative by the rate.

    Raises
    ------
    ValueError: fewer than three readings of positive weight, or all at one time.
    """
    p = _Problem(t, y, w, signed_rate)
    return p.told(p.best())


def _contour(p: _Problem, inside: float, outside: float, minimum: float, limit: float, stride: float) -> float:
    target = math.sqrt(limit - minimum)
    a, fa = inside, -target
    # Walk out first: the signed root of the rise of RSS is close to a straight line only near the minimum.
    while True:
        b = min(inside + stride, outside) if outside > inside else max(inside - stride, outside)
        rise = p.evaluate(b).rss
        if rise > limit:
            break
        if b == outside:
            return math.nan
        a, fa = b, math.sqrt(max(rise - minimum, 0.0)) - target
        stride *= 2.0
    fb = math.sqrt(rise - minimum) - target
    side = 0
    c = b
    for i in range(60):
        c = 0.5 * (a + b) if i % 3 == 2 else (a * fb - b * fa) / (fb - fa)
        fc = math.sqrt(max(p.evaluate(c).rss - minimum, 0.0)) - target
        if abs(fc) < 1e-4 * target or abs(b - a) < 1e-9 * abs(inside):
            return c
        if fc > 0.0:
            b, fb = c, fc
            fa *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            a, fa = c, fc
            fb *= 0.5 if side == -1 else 1.0
            side = -1
    return c


def _extreme(edge: Callable[[float], float], theta: float) -> float:
    """Maximum of `edge` over the angle by parabolic steps from theta."""
    half = 0.5 * math.pi
    h = 0.3
    best_theta = _clip(theta, -half + h, half - h)
    mid = edge(best_theta)
    for _ in range(12):
        left, right = edge(best_theta - h), edge(best_theta + h)
        bend = left - 2.0 * mid + right
        if left > mid or right > mid:
            shift = h if right > left else -h
        elif bend < 0.0:
            shift = 0.5 * h * (left - right) / bend
        else:
            return mid
        theta = _clip(best_theta + shift, -half + 1e-6, half - 1e-6)
        best = edge(theta)
        if best > mid:
            best_theta, mid = theta, best
        # At a maximum an angle off by d costs d^2 / 2 of the half-width.
        if abs(shift) < 0.1:
            return mid
        h = _clip(abs(shift) * 0.5, 0.02, 0.3)
        best_theta = _clip(best_theta, -half + h, half - h)
    return mid


def _profile(p: _Problem, s: _Sums, limit: float) -> tuple[float, float, float, float]:
    _, sr, rr = s.rate_covariance()
    by_slope, by_rate = s.steady_gradient()
    correlation = 0.0
    if rr < math.inf:
        variance = s.steady_variance()
        if variance > 0.0:
            correlation = (by_slope * sr + by_rate * rr) / math.sqrt(variance * rr)
    # Just outside, if the likelihood were Gaussian.
    stride = max(min(1.1 * math.sqrt(rr * (limit - s.rss)), p.high), 0.01 * s.rate)
    rate_low = _contour(p, s.rate, p.low, s.rss, limit, stride)
    rate_high = _contour(p, s.rate, p.high, s.rss, limit, stride)
    a = p.low if math.isnan(rate_low) else rate_low
    b = p.high if math.isnan(rate_high) else rate_high

    def edge(theta: float, sign: int) -> float:
        u = math.sin(theta)
        at = p.evaluate(s.rate + u * (b - s.rate if u > 0.0 else s.rate - a))
        arm = 1.0 / at.rate - at.phi_mean
        reach = (1.0 / at.weight + arm * arm / at.phi_phi) * (limit - at.rss)
        return at.level + at.slope * arm + sign * math.sqrt(max(reach, 0.0))

    theta = math.asin(_clip(correlation, -0.99, 0.99))
    upper = _extreme(lambda angle: edge(angle, 1), theta)
    lower = -_extreme(lambda angle: -edge(angle, -1), -theta)
    return rate_low, rate_high, lower, upper


def profile_decay(t: Array, y: Array, w: Array, rate: float, limit: float) -> tuple[float, float, float, float]:
    """Likelihood interval of the rate and of the steady state: where the residual sum of squares reaches `limit`.

    `rate` is the estimate. Returns (rate low, rate high, steady state low, steady state high); a rate is nan where the contour
    does not close.
    """
    p = _Problem(t, y, w, False)
    return _profile(p, p.evaluate(rate), limit)


def _drop_outliers(p: _Problem, s: _Sums, t: Array, y: Array, w: Array, outlier: float, resolution: float) -> bool:
    dof = p.n - 3
    if dof < 3 or not outlier < math.inf:
        return False
    size = np.abs(y - s.predict(t - t[0])) * np.sqrt(w)
    used = w > 0.0
    # By the median absolute residual, which outliers do not widen.
    limit = outlier * (1.0 + 3.0 / dof) * 1.4826 * float(np.median(size[used])) * math.sqrt(p.n / dof) + resolution
    out = (size > limit) & used
    if not out.any() or out.sum() > len(t) // 10:
        return False
    w[out] = 0.0
    return True


def spike_weights(y: Array, resolution: float, out: Array) -> None:
    """1 for a reading, 0 for an isolated spike, into out (n,); see :func:`models.spikes.spike_weights`."""
    out[:] = 1.0
    if len(y) < 5:
        return
    step = np.diff(y)
    noise = 1.4826 * float(np.median(np.abs(step - np.median(step)))) / math.sqrt(2.0)
    middle = np.median([y[:-2], y[1:-1], y[2:]], axis=0)
    out[1:-1][np.abs(y[1:-1] - middle) > 8.0 * max(noise, 0.5 * resolution, 1e-12)] = 0.0
    if not 2.0 * out.sum() > len(y):
        out[:] = 1.0


#: (logger's step, spread of rate times span at which a start is settled, fewest readings, growth of their number, deviations
#: at which a reading is outlier)
StartRule = tuple[float, float, int, float, float]


def start_decay(t: Array, y: Array, rule: StartRule, w: Array) -> tuple[int, float, bool, tuple[float, ...]]:
    """Fit of the first readings, as few as fix the rate; see :meth:`models.lump.Lump.start`.

    The number of readings grows by `growing` from `fewest` until rate times span is known to `settled`. `w` (n,) becomes
    their weights, 0 for isolated spikes and for readings that stand out of the rest by `outlier` deviations.
    Returns (readings used, noise variance, whether it settled, the fit as :func:`fit_decay` tells it).
    """
    resolution, settled, fewest, growing, outlier = rule
    size = len(t)
    used = min(fewest, size)
    while True:
        spike_weights(y[:used], resolution, w[:used])
        p = _Problem(t[:used], y[:used], w[:used], True)
        s = p.best()
        for _ in range(used // 5):
            residual = np.where(w[:used] > 0.0, np.abs(y[:used] - s.predict(t[:used] - t[0])), -1.0)
            worst = int(np.argmax(residual))
            dof, largest = p.n - 3, float(residual[worst])
            rest = max(s.rss - largest**2, 0.0) / (dof - 1 if dof > 2 else 1)
            if dof < 3 or not largest > max(outlier * math.sqrt(rest), resolution):
                break
            # Against the spread of the others: with the worst one in, ten readings hide any outlier.
            w[worst] = 0.0
            try:
                without_p = _Problem(t[:used], y[:used], w[:used], True)
            except ValueError:
                w[worst] = 1.0
                break
            without = without_p.best()
            gap = abs(float(y[worst] - without.predict(t[worst : worst + 1] - t[0])[0]))
            dof = without_p.n - 3
            if not gap > outlier * (1.0 + 3.0 / dof) * math.sqrt(without.rss / dof) + resolution:
                w[worst] = 1.0
                break
            p, s = without_p, without
        s = p.evaluate(s.rate)
        dof = p.n - 3
        noise = max(s.rss / dof if dof > 0 else 0.0, resolution**2 / 12.0, 1e-18)
        spread = math.sqrt(noise * s.rate_covariance()[2]) * p.span * (1.0 + 1.0 / max(dof, 1))
        done = dof > 2 and spread < settled
        if done or used == size:
            return used, noise, done, p.told(s)
        used = min(size, max(used + 1, int(used * growing)))


def likelihoods(
    t: Array,
    y: Array,
    w: Array,
    counts: NDArray[np.intp],
    quantiles: Array,
    first: int,
    rule: StartRule,
    wide: float,
    out: Array,
) -> None:
    """Fits and profile intervals of the first counts[i] readings, for every i, into out (len(counts), 18).

    A stretch of no more than `first` readings, one before the filter has begun, has its weights from its own start.
    Readings far outside a fit are left out of it, twice at the most and never more than a tenth; with a single count `w`
    itself is changed to tell which. quantiles (len(counts),) are those of Student's t. Columns: as :func:`fit_decay`, then as
    :func:`profile_decay`; nan where nothing can be fitted, or where no reading is spare.
    Where the half-width of the steady state is beyond `wide` to first order, that stands for the interval.
    """
    out[:] = np.nan
    for i, n in enumerate(counts):
        weights = w[:n].copy()
        begun = 0.0
        try:
            if n <= first:
                # Shorter starts than this were tried when the filter began, and none was settled.
                begun = start_decay(t[:n], y[:n], (*rule[:2], int(n), *rule[3:]), weights)[3][0]
            p = _Problem(t[:n], y[:n], weights, False)
            # The start has searched the same readings already.
            s = _refine(p, p.evaluate(begun)) if begun > p.low else p.best()
            for _ in range(2):
                if not _drop_outliers(p, s, t[:n], y[:n], weights, rule[4], rule[0]):
                    break
                p = _Problem(t[:n], y[:n], weights, False)
                s = p.best()
        except ValueError:
            continue
        out[i, :14] = p.told(s)
        if p.n > 3:
            noise = s.rss / (p.n - 3)
            limit = s.rss + noise * quantiles[i] ** 2
            reach = quantiles[i] * math.sqrt(max(noise * s.steady_variance(), 0.0))
            if reach > wide:
                steady = s.level + s.slope * (1.0 / s.rate - s.phi_mean)
                out[i, 14:] = s.rate, s.rate, steady - reach, steady + reach
            elif limit > s.rss:
                out[i, 14:] = _profile(p, s, limit)
        if len(counts) == 1:
            w[:n] = weights
