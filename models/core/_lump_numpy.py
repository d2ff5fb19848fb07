"""The lump's numerical core in numpy: what runs where no compiler was, and the oracle of the compiled one.

Every function here has a compiled twin of the same name in ``models/core/_lump.pyx``; the tests hold them equal.
Time and rate may be in any pair of reciprocal units; thermofast uses minutes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fit import Array, FitMoments, Fits, growth, growth_slope

# What a compiled filter loop would call; there is none in numpy.
SLOPE_STEP = SLOPE_STEPS = SLOPE_JACOBIAN = PRINTED_STEP = PRINTED_JACOBIAN = None

GRID, GRID_READINGS = 12, 64
#: Cosines that residuals are looked at with, at most so many readings or their means, and at least.
COSINES, MOST_POINTS, FEWEST_POINTS = 8, 1000, 12


@dataclass(frozen=True)
class _Sums(FitMoments):
    gradient: float

    def predict(self, dt: Array) -> Array:
        curve: Array = self.level + self.slope * (growth(self.rate, dt) - self.phi_mean)
        return curve


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

    def tell(self, s: _Sums, out: Any) -> None:
        """The fit into one record of FIT."""
        for name in vars(s):
            if name != "gradient":
                out[name] = getattr(s, name)
        out["n"], out["span"], out["least"], out["greatest"] = self.n, self.span, self.low, self.high


def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


def _refine(p: _Problem, best: _Sums) -> _Sums:
    """Gauss-Newton in the rate, amplitudes eliminated; halves a step that does not descend.

    It creeps where residuals are large; the compiled twin takes the curvature that its last step showed.
    """
    for _ in range(1000):
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


def fit_decay(t: Array, y: Array, w: Array, signed_rate: bool, out: Fits) -> None:
    """Weighted least squares of y = level + slope (growth(rate, t - t[0]) - its mean), amplitudes eliminated.

    Variable projection (Golub & Pereyra 1973): for a given rate the law is linear in its two amplitudes, so the search
    runs over the rate alone, over all that the record can show; `signed_rate` lets it be negative.

    Parameters: t, y, w of shape (n,), readings of weight 0 are left out; out (1,) of FIT.

    Raises
    ------
    ValueError: fewer than three readings of positive weight, or all at one time.
    """
    p = _Problem(t, y, w, signed_rate)
    out.fill(np.nan)
    p.tell(p.best(), out[0])


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
        return float(at.level + at.slope * arm + sign * math.sqrt(max(reach, 0.0)))

    theta = math.asin(_clip(correlation, -0.99, 0.99))
    upper = _extreme(lambda angle: edge(angle, 1), theta)
    lower = -_extreme(lambda angle: -edge(angle, -1), -theta)
    return rate_low, rate_high, lower, upper


def profile_decay(t: Array, y: Array, w: Array, rate: Array, limit: Array, out: Array) -> None:
    """Likelihood intervals of the rate and of the steady state: where the residual sum of squares reaches `limit` (S,).

    `rate` (S,) are the estimates of records y with weights w (S, n) at t (n,). Into out (S, 4) go the rate's low and high and the
    steady state's low and high; a rate is nan where the contour does not close.

    Raises
    ------
    ValueError: a record without three readings at different times; shapes that do not agree.
    """
    if not (y.shape == w.shape == (len(rate), len(t)) and len(limit) == len(rate) and out.shape == (len(rate), 4)):
        raise ValueError(f"{y.shape} readings and {w.shape} weights at {len(t)} times, for {out.shape} bounds")
    for k in range(len(y)):
        p = _Problem(t, y[k], w[k], False)
        out[k] = _profile(p, p.evaluate(float(rate[k])), float(limit[k]))


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


def curve_squares(t: Array, y: Array, kept: Array, fits: Fits, ends: NDArray[np.intp], out: Array) -> None:
    """Sums of squares [K^2] of fits (S, m) against the readings y (S, n) at t (n,) in windows of ends (W,) readings, ascending.

    kept (S, n) are weights of the readings, 0 for one that does not count; into out (S, m, W), nan where there is no fit.

    Raises
    ------
    ValueError: windows that do not ascend, or longer than the record.
    """
    if len(ends) and (np.diff(ends, prepend=0).min() < 0 or ends[-1] > len(t)):
        raise ValueError(f"windows of {ends.tolist()} of {len(t)} readings")
    phi = growth(fits["rate"][..., None], t - t[0])
    error = fits["level"][..., None] + fits["slope"][..., None] * (phi - fits["phi_mean"][..., None]) - y[:, None, :]
    squares = np.zeros((*fits.shape, len(t) + 1))
    np.cumsum(kept[:, None, :] * error**2, axis=-1, out=squares[..., 1:])
    out[:] = squares[..., ends]


def spike_weights(y: Array, resolution: Array, out: Array) -> None:
    """Into out (S, n); see :func:`models.noise.spikes.spike_weights`."""
    for row, step, weights in zip(y, resolution, out, strict=True):
        _mark_spikes(row, float(step), weights)


def _mark_spikes(y: Array, resolution: float, out: Array) -> None:
    out[:] = 1.0
    if len(y) < 5:
        return
    step = np.diff(y)
    noise = 1.4826 * float(np.median(np.abs(step - np.median(step)))) / math.sqrt(2.0)
    middle = np.median([y[:-2], y[1:-1], y[2:]], axis=0)
    out[1:-1][np.abs(y[1:-1] - middle) > 8.0 * max(noise, 0.5 * resolution, 1e-12)] = 0.0
    if not 2.0 * out.sum() > len(y):
        out[:] = 1.0


#: (spread of rate times span at which a start is settled, fewest readings, growth of their number, deviations at which a reading
#: is an outlier)
StartRule = tuple[float, int, float, float]


def start_decay(
    t: Array,
    y: Array,
    resolution: Array,
    rule: StartRule,
    w: Array,
    used: NDArray[np.intp],
    noise: Array,
    settled: NDArray[np.uint8],
    out: Fits,
) -> None:
    """Fits of the first readings of each record, as few as fix the rate; see :meth:`models.lump.Lump.start`.

    The number of readings grows by `growing` from `fewest` until rate times span is known to `settled`. `w` (S, n) becomes
    their weights, 0 for isolated spikes and for readings that stand out of the rest by `outlier` deviations. Per record of
    y (S, n): the readings used, -1 where none can be fitted, the noise variance, whether it settled, the fit, out (S,) of FIT.
    """
    out.fill(np.nan)
    for i, row in enumerate(y):
        try:
            used[i], noise[i], settled[i], p, s = _start(t, row, float(resolution[i]), rule, w[i])
        except ValueError:
            used[i] = -1
            continue
        p.tell(s, out[i])


def _start(t: Array, y: Array, resolution: float, rule: StartRule, w: Array) -> tuple[int, float, bool, "_Problem", "_Sums"]:
    settled, fewest, growing, outlier = rule
    size = len(t)
    used = min(fewest, size)
    while True:
        _mark_spikes(y[:used], resolution, w[:used])
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
            return used, noise, done, p, s
        used = min(size, max(used + 1, int(used * growing)))


def likelihoods(
    t: Array,
    y: Array,
    w: Array,
    counts: NDArray[np.intp],
    quantiles: Array,
    first: NDArray[np.intp],
    resolution: Array,
    rule: StartRule,
    wide: float,
    out: Fits,
) -> None:
    """Fits and profile intervals of the first counts[i] readings of each record of y (S, n), for every i, into out (S, m) of FIT.

    A stretch of no more than `first` (S,) readings, one before the filter has begun, has its weights from its own start.
    Readings far outside a fit are left out of it, twice at the most and never more than a tenth; with a single count `w` (S, n)
    itself is changed to tell which. quantiles (S, m) are those of Student's t. Fields are nan where nothing can be fitted, or where
    no reading is spare. Where the half-width of the steady state is beyond `wide` to first order, that stands for the interval.
    """
    out.fill(np.nan)
    for k, row in enumerate(y):
        for i, n in enumerate(counts):
            weights = w[k, :n].copy()
            _likely(t[:n], row[:n], weights, float(quantiles[k, i]), int(first[k]), float(resolution[k]), rule, wide, out[k, i])
            if len(counts) == 1:
                w[k, :n] = weights


def _likely(
    t: Array, y: Array, w: Array, quantile: float, first: int, resolution: float, rule: StartRule, wide: float, out: Any
) -> None:
    begun = 0.0
    try:
        if len(t) <= first:
            # Shorter starts than this were tried when the filter began, and none was settled.
            begun = _start(t, y, resolution, (rule[0], len(t), *rule[2:]), w)[4].rate
        p = _Problem(t, y, w, False)
        # The start has searched the same readings already.
        s = _refine(p, p.evaluate(begun)) if begun > p.low else p.best()
        for _ in range(2):
            if not _drop_outliers(p, s, t, y, w, rule[3], resolution):
                break
            p = _Problem(t, y, w, False)
            s = p.best()
    except ValueError:
        return
    p.tell(s, out)
    if p.n <= 3:
        return
    noise = s.rss / (p.n - 3)
    limit = s.rss + noise * quantile**2
    reach = quantile * math.sqrt(max(noise * s.steady_variance(), 0.0))
    bounds = None
    if reach > wide:
        steady = s.level + s.slope * (1.0 / s.rate - s.phi_mean)
        bounds = s.rate, s.rate, steady - reach, steady + reach
    elif limit > s.rss:
        bounds = _profile(p, s, limit)
    if bounds is not None:
        out["rate_low"], out["rate_high"], out["steady_low"], out["steady_high"] = bounds


def pattern_sums(residual: Array, columns: Array, out: Array) -> None:
    """What slow cosines explain of residuals (S, n) beyond their own columns (S, m, n), the directions that fits have used up.

    Into out (S, 3): the explained sum of squares, the whole one, the sum of products of neighbours; of means over MOST_POINTS
    stretches where a record is longer, nan where it is shorter than FEWEST_POINTS.
    """
    out.fill(np.nan)
    n, own = residual.shape[1], columns.shape[1]
    if n < FEWEST_POINTS:
        return
    if n > MOST_POINTS:
        edges = np.linspace(0, n, MOST_POINTS + 1).astype(int)
        residual, columns = (np.add.reduceat(v, edges[:-1], axis=-1) / np.diff(edges) for v in (residual, columns))
        n = MOST_POINTS
    count = min(COSINES, n // 6)
    cosines = math.sqrt(2.0 / n) * np.cos(np.outer(np.arange(1, count + 1), math.pi * (np.arange(n) + 0.5) / n))
    length = np.sqrt((columns**2).sum(axis=-1, keepdims=True))
    scaled = np.divide(columns, length, out=np.zeros_like(columns), where=length > 1e-300)  # what moves nothing explains nothing
    whole = np.concatenate([scaled, np.broadcast_to(cosines, (len(columns), count, n))], axis=1)
    # A cosine that the fit can imitate is left with nothing but rounding.
    root = np.linalg.cholesky(whole @ whole.swapaxes(1, 2) + 1e-11 * np.eye(own + count))
    along = np.linalg.solve(root, whole @ residual[..., None])[..., 0]
    squares, neighbours = residual**2, residual[:, 1:] * residual[:, :-1]
    out[:, 0], out[:, 1], out[:, 2] = (along[:, own:] ** 2).sum(axis=1), squares.sum(axis=1), neighbours.sum(axis=1)


def law_patterns(t: Array, y: Array, w: Array, rate: Array, residual: Array, out: Array) -> None:
    """:func:`pattern_sums` of the law at `rate` (S,), the best amplitudes with it, over the readings of positive weight.

    t (n,), y and w (S, n). Into residual (S, n) what it leaves times the root of the weight, 0 where there is none; into out (S, 5)
    the sums, the sum of squares without weights [K^2] and the count of readings; nan where the rate is.
    """
    residual[:], out[:] = 0.0, np.nan
    for k in np.flatnonzero(~np.isnan(rate)):  # those that could be fitted
        p = _Problem(t, y[k], w[k], True)
        s, root = p.evaluate(float(rate[k])), np.sqrt(p.w)
        phi, psi = growth(s.rate, p.t) - s.phi_mean, growth_slope(s.rate, p.t) - s.psi_mean
        left = p.y - s.slope * phi
        out[k, 3:], residual[k, w[k] > 0.0] = (left @ left, p.n), root * left
        pattern_sums((root * left)[None], (root * [np.ones_like(phi), phi, psi])[None], out[k : k + 1, :3])
