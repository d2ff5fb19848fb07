# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled twin of :func:`thermofast.filters.loop.run_readable`: every reading of one sensor in one call.

The model comes in as a capsule around ``void step(const double *state, double dt, double *next)``: this file knows no physics.
"""
from cpython.pycapsule cimport PyCapsule_GetPointer
from libc.math cimport fabs, isfinite, sqrt, log

ctypedef void (*step_function)(const double*, double, double*) noexcept nogil

cdef enum:
    MOST = 8

cdef struct Rule:
    double mean
    double spread
    double gated_run
    double seen
    double fading_variance
    bint fading_started


cdef inline int cholesky(const double* p, double* l, Py_ssize_t n) noexcept nogil:
    """Lower factor of a positive semidefinite matrix; returns 1 where it is indefinite beyond rounding."""
    cdef Py_ssize_t i, j, k
    cdef double s
    for j in range(n):
        for i in range(j):
            l[i * n + j] = 0.0
        s = p[j * n + j]
        for k in range(j):
            s -= l[j * n + k] * l[j * n + k]
        if fabs(p[j * n + j]) < 1e-200:     # a slope long settled: its variance has run out of digits
            for i in range(j, n):
                l[i * n + j] = 0.0
            continue
        if not s > 1e-14 * p[j * n + j]:
            if not s >= -1e-9 * fabs(p[j * n + j]):
                return 1
            for i in range(j, n):
                l[i * n + j] = 0.0
            continue
        l[j * n + j] = sqrt(s)
        for i in range(j + 1, n):
            s = p[i * n + j]
            for k in range(j):
                s -= l[i * n + k] * l[j * n + k]
            l[i * n + j] = s / l[j * n + j]
    return 0


cdef inline int predict_points(step_function step, double* x, double* p, Py_ssize_t n, double dt,
                        double spread, double mean0, double cov0, double each, double scale) noexcept nogil:
    """Unscented transform (3)-(7): points at +- spread times the columns of the root; the centre counts mean0, cov0.

    The covariance is per unit of `scale`; the points must stand where the true one puts them.
    """
    cdef double l[MOST * MOST]
    cdef double point[MOST]
    cdef double moved[(2 * MOST + 1) * MOST]
    cdef double mean[MOST]
    cdef Py_ssize_t i, j, k
    cdef double s
    if cholesky(p, l, n):
        return 1
    spread *= sqrt(scale)
    for i in range(n):
        mean[i] = 0.0
    for j in range(n):
        for i in range(n):
            point[i] = x[i] + spread * l[i * n + j]
        step(point, dt, &moved[2 * j * n])
        for i in range(n):
            point[i] = x[i] - spread * l[i * n + j]
        step(point, dt, &moved[(2 * j + 1) * n])
        for i in range(n):
            mean[i] += each * (moved[2 * j * n + i] + moved[(2 * j + 1) * n + i])
    if mean0 != 0.0 or cov0 != 0.0:
        step(x, dt, &moved[2 * n * n])
        for i in range(n):
            mean[i] += mean0 * moved[2 * n * n + i]
    for k in range(2 * n):
        for i in range(n):
            moved[k * n + i] -= mean[i]
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(2 * n):
                s += moved[k * n + i] * moved[k * n + j]
            s *= each
            if cov0 != 0.0:
                s += cov0 * (moved[2 * n * n + i] - mean[i]) * (moved[2 * n * n + j] - mean[j])
            s /= scale
            p[i * n + j] = s
            p[j * n + i] = s
        x[i] = mean[i]
    return 0


cdef void predict_linear(step_function step, step_function jacobian, double* x, double* p, Py_ssize_t n, double dt) noexcept nogil:
    cdef double f[MOST * MOST]
    cdef double fp[MOST * MOST]
    cdef double moved[MOST]
    cdef Py_ssize_t i, j, k
    cdef double s
    jacobian(x, dt, f)
    step(x, dt, moved)
    for i in range(n):
        for j in range(n):
            s = 0.0
            for k in range(n):
                s += f[i * n + k] * p[k * n + j]
            fp[i * n + j] = s
    for i in range(n):
        for j in range(n):
            s = 0.0
            for k in range(n):
                s += fp[i * n + k] * f[j * n + k]
            p[i * n + j] = s
        x[i] = moved[i]


cdef inline void joseph(double* x, double* p, Py_ssize_t n, double innovation, double s, double r) noexcept nogil:
    """Update in the form of Joseph: the covariance of the gain that was really used."""
    cdef double gain[MOST]
    cdef double row[MOST]
    cdef Py_ssize_t i, j
    for i in range(n):
        gain[i] = p[i * n] / s
        row[i] = p[i]
    for i in range(n):
        x[i] += gain[i] * innovation
    for i in range(n):
        for j in range(n):
            p[i * n + j] -= gain[i] * row[j]
    for i in range(n):
        row[i] = p[i * n]
    for i in range(n):
        for j in range(n):
            p[i * n + j] += gain[j] * (r * gain[i] - row[i])
    for i in range(n):
        for j in range(i):
            p[j * n + i] = p[i * n + j] = 0.5 * (p[i * n + j] + p[j * n + i])


def run(object step_capsule, object jacobian_capsule, const double[::1] t, const double[::1] y, Py_ssize_t first,
        const double[::1] x0, const double[:, ::1] p0, double scale, double dof, double dead_band,
        str rule, double[::1] moments, double[::1] settings,
        double[:, ::1] states, double[:, :, ::1] covariances, double[:, ::1] columns):
    """Filter readings first+1.. ; row k of the outputs holds the posterior of reading k. Returns the index where it broke, or -1.

    columns: noise variance, innovation, its variance, fading, added process noise, noise factor, weight, forgotten.
    """
    cdef step_function step = <step_function> PyCapsule_GetPointer(step_capsule, b"thermofast.step")
    cdef step_function jacobian = NULL
    cdef Py_ssize_t n = x0.shape[0], i, j, k, count = t.shape[0]
    cdef double x[MOST]
    cdef double p[MOST * MOST]
    cdef double keep[MOST * MOST]
    cdef double q[MOST]
    cdef double root[MOST]
    cdef double e, s, nu, z, alpha, r, dt, added, forgotten = 0.0, weight, d, gate, noise_threshold, wake_threshold, u, noise = 1.0
    cdef double xi, rho, threshold, factor, gain0, posterior, r_step = 0.0, v = 0.0
    cdef int kind, broken = -1, tries
    cdef bint linear = moments.shape[0] == 0, gated, woke
    cdef Rule m
    kind = {"none": 0, "innovation": 1, "adaptive": 2, "printed": 3}[rule]
    if linear:
        jacobian = <step_function> PyCapsule_GetPointer(jacobian_capsule, b"thermofast.step")
    m.mean = 0.0
    m.spread = 1.0
    m.gated_run = 0.0
    m.seen = dof
    m.fading_variance = 0.0
    m.fading_started = False
    for i in range(n):
        x[i] = x0[i]
        states[first, i] = x[i]
        q[i] = 0.0
        for j in range(n):
            p[i * n + j] = p0[i, j]
            covariances[first, i, j] = p0[i, j]
    if kind == 3:
        # The printed filter works in plain units: its Q and R are numbers, not multiples of the record's noise.
        noise = settings[5]
        scale = 1.0
        r_step = noise / 100.0
        for i in range(n):
            q[i] = settings[4]
    columns[first, 0] = scale * noise if kind == 3 else scale
    columns[first, 1] = 0.0
    columns[first, 2] = 0.0
    columns[first, 3] = 1.0
    columns[first, 4] = q[0]
    columns[first, 5] = noise
    columns[first, 6] = 1.0
    columns[first, 7] = 0.0
    with nogil:
        for k in range(first + 1, count):
            dt = t[k] - t[k - 1]
            if linear:
                predict_linear(step, jacobian, x, p, n, dt)
            elif predict_points(step, x, p, 3, dt, moments[0], moments[1], moments[2], moments[3], scale) if n == 3 else \
                    predict_points(step, x, p, n, dt, moments[0], moments[1], moments[2], moments[3], scale):
                broken = <int> k        # the size as a constant lets the compiler unroll what a sensor's three states need
                break
            e = y[k] - x[0]
            alpha = 1.0
            r = 1.0
            weight = 1.0
            added = 0.0
            if kind == 3:
                xi = settings[0]
                rho = settings[1]
                threshold = settings[2]
                factor = settings[3]
                for i in range(n):
                    p[i * n + i] += q[i]
                if not m.fading_started:
                    v = e * e
                    m.fading_started = True
                else:
                    v = (xi * v + e * e) / (1.0 + xi)
                s = p[0] + noise
                alpha = (v - rho * noise) / s
                if not alpha > 1.0:
                    alpha = 1.0
                # Equations (12), (13) and figure 1: R moves until the posterior residual is inside the threshold.
                gain0 = alpha * p[0] / s
                posterior = e * (1.0 - gain0)
                if fabs(posterior) > threshold:
                    u = factor if posterior < 0.0 else 1.0 / factor
                    for i in range(n):
                        q[i] *= u
                    d = r_step if (posterior < 0.0) == (e > 0.0) else -r_step
                    for tries in range(10000):
                        if noise + d <= 0.0:
                            break
                        noise += d
                        s = p[0] + noise
                        gain0 = alpha * p[0] / s
                        posterior = e * (1.0 - gain0)
                        if fabs(posterior) <= threshold:
                            break
                for i in range(n):
                    root[i] = alpha * p[i * n] / s
                for i in range(n):
                    x[i] += root[i] * e
                for i in range(n):
                    for j in range(n):
                        p[i * n + j] -= root[i] * s * root[j]
                r = noise
                added = q[0]
                columns[k, 0] = noise
            else:
                s = p[0] + 1.0
                nu = e / sqrt(s * scale)
                if kind == 0:
                    m.seen += 1.0
                    scale += (nu * nu * scale - scale) / m.seen
                elif kind == 1:
                    xi = settings[0]
                    rho = settings[1]
                    if not m.fading_started:
                        v = e * e / scale
                        m.fading_started = True
                    else:
                        v = (xi * v + e * e / scale) / (1.0 + xi)
                    alpha = (v - rho) / s
                    if alpha > 1.0:
                        added = (alpha - 1.0) * p[0]
                        u = sqrt(alpha)
                        for i in range(n):
                            p[i] *= u
                            p[i * n] *= u
                        s = p[0] + 1.0
                    else:
                        alpha = 1.0
                    m.seen += 1.0
                    scale += ((nu * nu if nu * nu < 9.0 else 9.0) * scale - scale) / m.seen
                else:
                    # settings: forgetting, spread forgetting, gate, noise threshold, wake threshold, fading gain, most, jump
                    # Until the noise is known from enough readings, every threshold stands further out.
                    u = 1.0 + 5.0 / m.seen
                    gate = settings[2] * u
                    noise_threshold = settings[3] * u * u
                    wake_threshold = settings[4] * u
                    gated = fabs(nu) > gate
                    if gated:
                        if m.gated_run * nu > 0.0:
                            m.gated_run += 1.0 if nu > 0.0 else -1.0
                        else:
                            m.gated_run = 1.0 if nu > 0.0 else -1.0
                    d = nu - m.mean
                    d = d * d if d * d < gate * gate else gate * gate
                    woke = False
                    if gated and fabs(m.gated_run) < 2.0:
                        pass                     # one outlier teaches nothing
                    else:
                        m.spread = settings[1] * m.spread + (1.0 - settings[1]) * d
                        # A mean counts against the spread of the moment: grown noise is no news of the physics.
                        u = nu / (sqrt(m.spread) if m.spread > 1.0 else 1.0)
                        u = u if fabs(u) < 3.0 else (3.0 if u > 0.0 else -3.0)
                        m.mean = settings[0] * m.mean + (1.0 - settings[0]) * u
                        z = fabs(m.mean) * sqrt((1.0 + settings[0]) / (1.0 - settings[0]))
                        woke = z > wake_threshold and fabs(m.mean) * sqrt(s * scale) > dead_band
                    if not gated:
                        m.gated_run = 0.0
                    r = m.spread if m.spread > noise_threshold else 1.0
                    if gated and fabs(m.gated_run) >= settings[7]:
                        alpha = 100.0           # not outlier: the reading has moved for good
                        m.gated_run = 0.0
                        m.mean = 0.0
                        m.spread = 1.0
                        r = 1.0
                    else:
                        if gated:
                            weight = 0.0
                        if woke:
                            alpha = 1.0 + settings[5] * (z / wake_threshold) * (z / wake_threshold)
                            if alpha > settings[6]:
                                alpha = settings[6]
                    if alpha > 1.0:
                        added = p[0]
                        for i in range(n):
                            root[i] = sqrt(alpha)
                            # Forget no more than brings back what was known at the start.
                            if p[i * n + i] * alpha > p0[i, i]:
                                root[i] = sqrt(p0[i, i] / p[i * n + i]) if p0[i, i] > p[i * n + i] else 1.0
                        for i in range(n):
                            for j in range(n):
                                p[i * n + j] *= root[i] * root[j]
                        if alpha == 100.0:
                            p[0] += e * e / scale    # the reading is anew
                        added = p[0] - added
                        forgotten += log(alpha)
                    s = p[0] + r
                    if not gated and m.spread <= noise_threshold:
                        m.seen += 1.0
                        d = nu * nu if nu * nu < 9.0 else 9.0
                        if alpha == 1.0:
                            scale += (d * scale - scale) / m.seen
                if weight > 0.0 and n == 3:
                    joseph(x, p, 3, e, s, r)
                elif weight > 0.0:
                    joseph(x, p, n, e, s, r)
                columns[k, 0] = scale
            if not isfinite(x[0]) or not isfinite(p[0]) or fabs(x[0]) > 1e12:
                broken = <int> k
                break
            columns[k, 1] = e
            columns[k, 2] = s if kind == 3 else s * scale
            columns[k, 3] = alpha
            columns[k, 4] = added if kind == 3 else added * scale
            columns[k, 5] = r
            columns[k, 6] = weight
            columns[k, 7] = forgotten
            for i in range(n):
                states[k, i] = x[i]
                for j in range(n):
                    covariances[k, i, j] = p[i * n + j]
    return broken
