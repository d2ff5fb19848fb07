# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled twin of :mod:`models._lump_numpy`: same names, same arguments, same numbers.

Time and rate may be in any pair of reciprocal units; thermofast uses minutes.
"""
import numpy as np

from cpython.pycapsule cimport PyCapsule_New
from libc.math cimport asin, cos, exp, expm1, fabs, isnan, sin, sqrt, NAN, M_PI
from libc.stdlib cimport free, malloc


cdef inline double growth(double rate, double dt) noexcept nogil:
    """(1 - exp(-rate dt)) / rate, continuous at rate = 0."""
    cdef double z = rate * dt
    if fabs(z) < 1e-7:
        return dt * (1.0 - 0.5 * z)
    if z < -60.0:
        z = -60.0
    return -expm1(-z) / rate


cdef inline double growth_slope(double rate, double dt) noexcept nogil:
    """d growth / d rate."""
    cdef double z = rate * dt
    if fabs(z) < 1e-3:
        return dt * dt * (-0.5 + z * (1.0 / 3.0 - z * 0.125))
    if z < -60.0:
        z = -60.0
    return (dt * exp(-z) + expm1(-z) / rate) / rate


cdef inline double clip(double value, double low, double high) noexcept nogil:
    return low if value < low else (high if value > high else value)


cdef void slope_step(const double* x, double dt, double* out) noexcept nogil:
    """State (temperature, slope, rate) one interval on."""
    cdef double rate = clip(x[2], -40.0 / dt, 1e3 / dt) if dt > 0 else x[2]
    out[0] = x[0] + x[1] * growth(rate, dt)
    out[1] = x[1] * exp(-rate * dt)
    out[2] = x[2]


cdef void slope_jacobian(const double* x, double dt, double* out) noexcept nogil:
    cdef double rate = clip(x[2], -40.0 / dt, 1e3 / dt) if dt > 0 else x[2]
    cdef double decay = exp(-rate * dt)
    out[0] = 1.0
    out[1] = growth(rate, dt)
    out[2] = x[1] * growth_slope(rate, dt)
    out[3] = 0.0
    out[4] = decay
    out[5] = -x[1] * dt * decay
    out[6] = 0.0
    out[7] = 0.0
    out[8] = 1.0


cdef void printed_step(const double* x, double dt, double* out) noexcept nogil:
    """State (temperature, rate, steady state), equation (37)."""
    out[0] = x[2] + (x[0] - x[2]) * exp(-x[1] * dt)
    out[1] = x[1]
    out[2] = x[2]


cdef void printed_jacobian(const double* x, double dt, double* out) noexcept nogil:
    cdef double decay = exp(-x[1] * dt)
    out[0] = decay
    out[1] = -(x[0] - x[2]) * dt * decay
    out[2] = 1.0 - decay
    out[3] = 0.0
    out[4] = 1.0
    out[5] = 0.0
    out[6] = 0.0
    out[7] = 0.0
    out[8] = 1.0


SLOPE_STEP = PyCapsule_New(<void*> slope_step, b"thermofast.step", NULL)
SLOPE_JACOBIAN = PyCapsule_New(<void*> slope_jacobian, b"thermofast.step", NULL)
PRINTED_STEP = PyCapsule_New(<void*> printed_step, b"thermofast.step", NULL)
PRINTED_JACOBIAN = PyCapsule_New(<void*> printed_jacobian, b"thermofast.step", NULL)


cdef struct Sums:
    double rate
    double slope
    double level
    double phi_mean
    double psi_mean
    double weight
    double phi_phi
    double phi_psi
    double psi_psi
    double rss
    double gradient


cdef class _Problem:
    """Readings of one fit with the scratch space for its basis."""
    cdef Py_ssize_t n
    cdef double* t
    cdef double* y
    cdef double* w
    cdef double* phi
    cdef double* psi
    cdef double weight
    cdef double level

    def __cinit__(self, const double[::1] t, const double[::1] y, const double[::1] w):
        cdef Py_ssize_t i, m = 0
        cdef Py_ssize_t size = t.shape[0]
        self.t = <double*> malloc(5 * (size + 1) * sizeof(double))
        if self.t == NULL:
            raise MemoryError()
        self.y = self.t + size
        self.w = self.y + size
        self.phi = self.w + size
        self.psi = self.phi + size
        self.weight = 0.0
        self.level = 0.0
        for i in range(size):
            if w[i] > 0.0:
                self.t[m] = t[i] - t[0]
                self.y[m] = y[i]
                self.w[m] = w[i]
                self.weight += w[i]
                self.level += w[i] * y[i]
                m += 1
        self.n = m
        if m:
            self.level /= self.weight
        for i in range(m):
            self.y[i] -= self.level

    def __dealloc__(self):
        free(self.t)

    cdef void evaluate(self, double rate, bint slopes, Sums* s) noexcept nogil:
        cdef Py_ssize_t i
        cdef double phi_mean = 0.0, psi_mean = 0.0, pp = 0.0, py = 0.0, pq = 0.0, qq = 0.0
        cdef double a, q, r, slope, rss = 0.0, gradient = 0.0, z, inverse, em
        inverse = 1.0 / rate if rate != 0.0 else 0.0
        for i in range(self.n):
            z = rate * self.t[i]
            if fabs(z) < 1e-3:
                a = growth(rate, self.t[i])
                q = growth_slope(rate, self.t[i]) if slopes else 0.0
            else:
                if z < -60.0:
                    z = -60.0
                em = expm1(-z)
                a = -em * inverse
                q = (self.t[i] * (1.0 + em) - a) * inverse
            self.phi[i] = a
            self.psi[i] = q
            phi_mean += self.w[i] * a
            psi_mean += self.w[i] * q
        phi_mean /= self.weight
        psi_mean /= self.weight
        for i in range(self.n):
            a = self.phi[i] - phi_mean
            q = self.psi[i] - psi_mean
            pp += self.w[i] * a * a
            py += self.w[i] * a * self.y[i]
            pq += self.w[i] * a * q
            qq += self.w[i] * q * q
        slope = py / pp if pp > 0.0 else 0.0
        for i in range(self.n):
            r = self.y[i] - slope * (self.phi[i] - phi_mean)
            rss += self.w[i] * r * r
            gradient += self.w[i] * r * (self.psi[i] - psi_mean)
        s.rate = rate
        s.slope = slope
        s.level = self.level
        s.phi_mean = phi_mean
        s.psi_mean = psi_mean
        s.weight = self.weight
        s.phi_phi = pp
        s.phi_psi = pq
        s.psi_psi = qq
        s.rss = rss
        s.gradient = gradient

    cdef double rss(self, double rate) noexcept nogil:
        cdef Sums s
        self.evaluate(rate, False, &s)
        return s.rss


cdef int _refine(_Problem p, double low, double high, Sums* best) noexcept nogil:
    """Gauss-Newton in the rate, amplitudes eliminated; halves a step that does not descend."""
    cdef int iteration, halving
    cdef double step, curvature, rate, scale
    cdef Sums trial
    for iteration in range(60):
        curvature = best.psi_psi - best.phi_psi * best.phi_psi / best.phi_phi if best.phi_phi > 0.0 else 0.0
        curvature *= best.slope * best.slope
        if not curvature > 0.0:
            return iteration
        step = best.slope * best.gradient / curvature
        scale = fabs(best.rate) + 1e-9 * (high - low)
        if fabs(step) <= 1e-11 * scale:
            return iteration
        for halving in range(40):
            rate = clip(best.rate + step, low, high)
            if rate == best.rate:
                return iteration
            p.evaluate(rate, True, &trial)
            if trial.rss < best.rss:
                break
            if fabs(step) <= 1e-9 * scale:
                return iteration
            step *= 0.5
        else:
            return iteration
        best[0] = trial
    return 60


def fit_decay(const double[::1] t, const double[::1] y, const double[::1] w,
              const double[::1] candidates, double low, double high):
    """See :func:`models._lump_numpy.fit_decay`."""
    cdef _Problem p = _Problem(t, y, w)
    cdef Sums best, trial
    cdef Py_ssize_t i
    cdef bint have = False
    p.evaluate(low, False, &best)
    with nogil:
        for i in range(candidates.shape[0]):
            p.evaluate(clip(candidates[i], low, high), candidates.shape[0] == 1, &trial)
            if not have or trial.rss < best.rss:
                best = trial
                have = True
        if candidates.shape[0] > 1:
            p.evaluate(best.rate, True, &trial)
            best = trial
        _refine(p, low, high, &best)
    return (best.rate, best.slope, best.level, best.phi_mean, best.psi_mean, best.weight,
            best.phi_phi, best.phi_psi, best.psi_psi, best.rss, p.n)


cdef double _contour(_Problem p, double inside, double outside, double minimum, double limit, double stride) noexcept nogil:
    """The rate between `inside` and `outside` at which RSS reaches `limit`; nan if it stays below."""
    cdef double a = inside, b, fa, fb, c, fc, target, rise
    cdef int i, side = 0
    cdef bint up = outside > inside
    target = sqrt(limit - minimum)
    fa = -target
    # Walk out first: the signed root of the rise of RSS is close to a straight line only near the minimum.
    while True:
        b = inside + stride if up else inside - stride
        if (up and not b < outside) or (not up and not b > outside):
            b = outside
        rise = p.rss(b)
        if rise > limit:
            break
        if b == outside:
            return NAN
        a = b
        fa = (sqrt(rise - minimum) if rise > minimum else 0.0) - target
        stride *= 2.0
    fb = sqrt(rise - minimum) - target
    for i in range(60):
        c = (a * fb - b * fa) / (fb - fa)
        if i % 3 == 2:
            c = 0.5 * (a + b)
        fc = p.rss(c) - minimum
        fc = (sqrt(fc) if fc > 0.0 else 0.0) - target
        if fabs(fc) < 1e-6 * target or fabs(b - a) < 1e-9 * fabs(inside):
            return c
        if fc > 0.0:
            b = c
            fb = fc
            if side == 1:
                fa *= 0.5
            side = 1
        else:
            a = c
            fa = fc
            if side == -1:
                fb *= 0.5
            side = -1
    return c


cdef double _edge(_Problem p, double theta, double centre, double low, double high, double limit, int sign) noexcept nogil:
    """Steady state on the contour of the likelihood at angle theta: its conditional estimate plus or minus its reach."""
    cdef Sums s
    cdef double u = sin(theta), rate, reach, arm
    rate = centre + u * (high - centre if u > 0.0 else centre - low)
    p.evaluate(rate, False, &s)
    arm = 1.0 / rate - s.phi_mean
    reach = (1.0 / s.weight + arm * arm / s.phi_phi) * (limit - s.rss)
    return s.level + s.slope * arm + sign * (sqrt(reach) if reach > 0.0 else 0.0)


cdef double _extreme(_Problem p, double theta, double centre, double low, double high, double limit, int sign) noexcept nogil:
    """Largest (sign 1) or smallest (sign -1) steady state on the contour, by parabolic steps over the angle."""
    cdef double h = 0.3, best_theta, best, left, right, mid, bend, shift
    cdef int i
    best_theta = clip(theta, -0.5 * M_PI + h, 0.5 * M_PI - h)
    mid = sign * _edge(p, best_theta, centre, low, high, limit, sign)
    for i in range(12):
        left = sign * _edge(p, best_theta - h, centre, low, high, limit, sign)
        right = sign * _edge(p, best_theta + h, centre, low, high, limit, sign)
        bend = left - 2.0 * mid + right
        if left > mid or right > mid:
            shift = h if right > left else -h
        elif bend < 0.0:
            shift = 0.5 * h * (left - right) / bend
        else:
            return sign * mid
        theta = clip(best_theta + shift, -0.5 * M_PI + 1e-6, 0.5 * M_PI - 1e-6)
        best = sign * _edge(p, theta, centre, low, high, limit, sign)
        if best > mid:
            best_theta = theta
            mid = best
        if fabs(shift) < 0.02:
            return sign * mid
        h = clip(fabs(shift) * 0.5, 0.02, 0.3)
        best_theta = clip(best_theta, -0.5 * M_PI + h, 0.5 * M_PI - h)
    return sign * mid


def profile_decay(const double[::1] t, const double[::1] y, const double[::1] w, double rate,
                  double minimum, double limit, double low, double high, double correlation, double stride):
    """See :func:`models._lump_numpy.profile_decay`."""
    cdef _Problem p = _Problem(t, y, w)
    cdef double rate_low, rate_high, a, b, upper, lower, theta
    with nogil:
        rate_low = _contour(p, rate, low, minimum, limit, stride)
        rate_high = _contour(p, rate, high, minimum, limit, stride)
        a = low if isnan(rate_low) else rate_low
        b = high if isnan(rate_high) else rate_high
        theta = asin(clip(correlation, -0.99, 0.99))
        upper = _extreme(p, theta, rate, a, b, limit, 1)
        lower = _extreme(p, -theta, rate, a, b, limit, -1)
    return rate_low, rate_high, lower, upper
