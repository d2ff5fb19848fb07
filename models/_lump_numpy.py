"""The lump's numerical core in numpy: what runs where no compiler was, and the oracle of the compiled one.

Every function here has a compiled twin of the same name in ``models/_lump.pyx``; the tests hold them equal.
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


@dataclass
class _Sums:
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
    gradient: float


class _Problem:
    def __init__(self, t: Array, y: Array, w: Array) -> None:
        use = w > 0.0
        self.t, self.w = (t - t[0])[use], w[use]
        self.n = int(use.sum())
        self.weight = float(self.w.sum())
        self.level = float(self.w @ y[use] / self.weight)
        self.y = y[use] - self.level

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


def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


def _refine(p: _Problem, low: float, high: float, best: _Sums) -> _Sums:
    for _ in range(60):
        curvature = best.psi_psi - best.phi_psi**2 / best.phi_phi if best.phi_phi > 0.0 else 0.0
        curvature *= best.slope**2
        if not curvature > 0.0:
            return best
        step = best.slope * best.gradient / curvature
        scale = abs(best.rate) + 1e-9 * (high - low)
        if abs(step) <= 1e-11 * scale:
            return best
        for _halving in range(40):
            rate = _clip(best.rate + step, low, high)
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


def fit_decay(
    t: Array, y: Array, w: Array, candidates: Array, low: float, high: float
) -> tuple[float, ...]:
    """Weighted least squares of y = level + slope (growth(rate, t - t[0]) - its mean), amplitudes eliminated.

    Variable projection (Golub & Pereyra 1973): for a given rate the law is linear in its two amplitudes, so the search
    runs over the rate alone. It begins at the best of `candidates` and stays in [low, high].

    Parameters: t, y, w of shape (n,), readings of weight 0 are left out. Returns (rate, slope at t[0], level, mean of phi,
    mean of psi, sum of weights, phi.phi, phi.psi, psi.psi, residual sum of squares, readings used), phi and psi being
    the centred basis function and its derivative by the rate.
    """
    p = _Problem(t, y, w)
    best = min((p.evaluate(_clip(float(c), low, high)) for c in candidates), key=lambda s: s.rss)
    s = _refine(p, low, high, best)
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
        p.n,
    )


def _contour(
    p: _Problem, inside: float, outside: float, minimum: float, limit: float, stride: float
) -> float:
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
        if abs(fc) < 1e-6 * target or abs(b - a) < 1e-9 * abs(inside):
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
        if abs(shift) < 0.02:
            return mid
        h = _clip(abs(shift) * 0.5, 0.02, 0.3)
        best_theta = _clip(best_theta, -half + h, half - h)
    return mid


def profile_decay(
    t: Array,
    y: Array,
    w: Array,
    rate: float,
    minimum: float,
    limit: float,
    low: float,
    high: float,
    correlation: float,
    stride: float,
) -> tuple[float, float, float, float]:
    """Likelihood interval of the rate and of the steady state: where the residual sum of squares reaches `limit`.

    `minimum` is its value at the estimate `rate`; `correlation`, between steady state and rate, says where on the contour
    to look first, and `stride`, about two standard errors of the rate, how far out. Returns (rate low, rate high, steady state low, steady state high); a rate is nan
    where the contour does not close between `low` and `high`.
    """
    p = _Problem(t, y, w)
    rate_low = _contour(p, rate, low, minimum, limit, stride)
    rate_high = _contour(p, rate, high, minimum, limit, stride)
    a = low if math.isnan(rate_low) else rate_low
    b = high if math.isnan(rate_high) else rate_high

    def edge(theta: float, sign: int) -> float:
        u = math.sin(theta)
        s = p.evaluate(rate + u * (b - rate if u > 0.0 else rate - a))
        arm = 1.0 / s.rate - s.phi_mean
        reach = (1.0 / s.weight + arm * arm / s.phi_phi) * (limit - s.rss)
        return s.level + s.slope * arm + sign * math.sqrt(max(reach, 0.0))

    theta = math.asin(_clip(correlation, -0.99, 0.99))
    upper = _extreme(lambda angle: edge(angle, 1), theta)
    lower = -_extreme(lambda angle: -edge(angle, -1), -theta)
    return rate_low, rate_high, lower, upper
