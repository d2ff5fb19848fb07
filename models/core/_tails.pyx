# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Tails of Student's t, Fisher's F and the normal distribution: the compiled twin of scipy.special's, which take as long to load as
all the rest of a small ``identify``. The incomplete beta function is the continued fraction DLMF 8.17.22, by Lentz's method.
"""
from libc.math cimport NAN, erfc, exp, fabs, isnan, lgamma, log, log1p, sqrt


cdef double fraction(double a, double b, double x) noexcept nogil:
    cdef double tiny = 1e-300, c = 1.0, d = 1.0 - (a + b) * x / (a + 1.0), value, term, step
    cdef int m
    d = 1.0 / (d if fabs(d) > tiny else tiny)
    value = d
    for m in range(1, 2000):
        term = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        d = 1.0 + term * d
        c = 1.0 + term / c
        d = 1.0 / (d if fabs(d) > tiny else tiny)
        c = c if fabs(c) > tiny else tiny
        value *= d * c
        term = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        d = 1.0 + term * d
        c = 1.0 + term / c
        d = 1.0 / (d if fabs(d) > tiny else tiny)
        c = c if fabs(c) > tiny else tiny
        step = d * c
        value *= step
        if fabs(step - 1.0) < 1e-16:
            break
    return value


cdef double incomplete_beta(double a, double b, double x, double rest) noexcept nogil:
    """Regularised I_x(a, b); rest is 1 - x, which the caller may know to more digits."""
    cdef double front
    if isnan(x):
        return NAN
    if not x > 0.0:
        return 0.0
    if not rest > 0.0:
        return 1.0
    front = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(x) + b * log(rest))
    if x < (a + 1.0) / (a + b + 2.0):
        return front * fraction(a, b, x) / a
    return 1.0 - front * fraction(b, a, rest) / b


def f_tails(double over, double under, const double[::1] value, double[::1] out):
    """Probability that F with (over, under) degrees of freedom exceeds each value."""
    cdef Py_ssize_t i
    cdef double all_
    if out.shape[0] != value.shape[0]:
        raise ValueError(f"{out.shape[0]} places for {value.shape[0]} values")
    with nogil:
        for i in range(value.shape[0]):
            all_ = under + over * value[i]
            out[i] = incomplete_beta(0.5 * under, 0.5 * over, under / all_, over * value[i] / all_) if value[i] > 0.0 else (
                NAN if isnan(value[i]) else 1.0)


def normal_tails(const double[::1] value, double[::1] out):
    """Probability that a standard normal number exceeds each value."""
    cdef Py_ssize_t i
    if out.shape[0] != value.shape[0]:
        raise ValueError(f"{out.shape[0]} places for {value.shape[0]} values")
    for i in range(value.shape[0]):
        out[i] = 0.5 * erfc(value[i] / sqrt(2.0))


cdef double t_quantile(double dof) noexcept nogil:
    """97.5 % quantile by Newton's method on the logarithm of the tail, from below where it is steep and never turns back."""
    cdef double t = 1.96, tail, density, step, shape
    cdef int i
    if not dof > 0.0:
        return NAN
    if dof > 1e9:
        return 1.959963984540054
    shape = lgamma(0.5 * (dof + 1.0)) - lgamma(0.5 * dof)
    for i in range(200):
        tail = 0.5 * incomplete_beta(0.5 * dof, 0.5, dof / (dof + t * t), t * t / (dof + t * t))
        density = exp(shape - 0.5 * (dof + 1.0) * log1p(t * t / dof)) / sqrt(3.141592653589793 * dof)
        step = (log(tail) - log(0.025)) * tail / density
        t += step
        if fabs(step) <= 1e-8 * t:      # it converges quadratically: the next step would be one of rounding
            break
    return t


cdef enum:
    KNOWN = 4096

cdef double[KNOWN] known      # quantiles of whole numbers of degrees of freedom, 0 until asked for


def t_quantiles(const double[::1] dof, double[::1] out):
    """97.5 % quantile of Student's t for each number of degrees of freedom."""
    cdef Py_ssize_t i
    cdef int whole
    if out.shape[0] != dof.shape[0]:
        raise ValueError(f"{out.shape[0]} places for {dof.shape[0]} values")
    for i in range(dof.shape[0]):
        whole = <int> dof[i] if 0.0 < dof[i] < KNOWN else 0
        if whole > 0 and whole == dof[i]:
            if known[whole] == 0.0:
                known[whole] = t_quantile(dof[i])
            out[i] = known[whole]
        else:
            out[i] = t_quantile(dof[i])
