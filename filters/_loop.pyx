# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled twin of :func:`thermofast.filters.loop.run_readable`: every reading of one sensor in one call.

The model comes in as a capsule around ``void step(const double *state, double dt, double *next)``: this file knows no physics.
"""
from cpython.pycapsule cimport PyCapsule_GetPointer
from libc.math cimport fabs, isfinite, sqrt, log

import numpy as np

ctypedef void (*step_function)(const double*, double, double*) noexcept nogil

cdef enum:
    MOST = 8

cdef packed struct Points:
    # Where sigma points stand and what they count, field by field as thermofast.filters.moments.POINTS has it.
    double spread
    double centre_mean
    double centre_covariance
    double each

cdef packed struct Settings:
    # Of all rules, as thermofast.filters.fading.SETTINGS has them; a rule reads its own.
    double forgetting
    double spread_forgetting
    double gate
    double noise_threshold
    double wake_threshold
    double fading_gain
    double fading_most
    double jump_readings
    double weakening
    double threshold
    double factor
    double process_noise
    double noise

cdef packed struct Row:
    # What is kept of one reading, as thermofast.filters.loop.ROW has it.
    double noise_variance
    double innovation
    double innovation_variance
    double fading
    double process_noise
    double noise_factor
    double weight
    double forgotten

cdef struct Case:
    # What stays the same over the records of a block.
    step_function step
    step_function jacobian
    Py_ssize_t n
    int kind
    bint linear
    Points points
    Settings settings

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
                               const Points* points, double scale) noexcept nogil:
    """Unscented transform (3)-(7): points at +- spread times the columns of the root, and the centre.

    The covariance is per unit of `scale`; the points must stand where the true one puts them.
    """
    cdef double l[MOST * MOST]
    cdef double point[MOST]
    cdef double moved[(2 * MOST + 1) * MOST]
    cdef double mean[MOST]
    cdef Py_ssize_t i, j, k
    cdef double s, spread = points.spread * sqrt(scale), each = points.each
    cdef double mean0 = points.centre_mean, cov0 = points.centre_covariance
    if cholesky(p, l, n):
        return 1
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


cdef int filter_one(Case* case, const double* t, const double* y, Py_ssize_t count, Py_ssize_t first, const double* x0,
                    const double* p0, double scale, double dof, double dead_band,
                    double* states, double* covariances, Row* rows) noexcept nogil:
    """Filter readings first+1..; row k of the outputs holds the posterior of reading k. Returns the index where it broke, or -1."""
    cdef Py_ssize_t n = case.n, i, j, k
    cdef step_function step = case.step
    cdef Settings* settings = &case.settings
    cdef Points* points = &case.points
    cdef Row* row = &rows[first]
    cdef double x[MOST]
    cdef double p[MOST * MOST]
    cdef double q[MOST]
    cdef double root[MOST]
    cdef double e, s, nu, z, alpha, r, dt, added, forgotten = 0.0, weight, d, gate, noise_threshold, wake_threshold, u, noise = 1.0
    cdef double xi, rho, threshold, factor, gain0, posterior, v = 0.0
    cdef int kind = case.kind, tries, failed
    cdef bint gated, woke
    cdef Rule m
    m.mean = 0.0
    m.spread = 1.0
    m.gated_run = 0.0
    m.seen = dof
    m.fading_variance = 0.0
    m.fading_started = False
    for i in range(n):
        x[i] = x0[i]
        states[first * n + i] = x[i]
        q[i] = 0.0
        for j in range(n):
            p[i * n + j] = p0[i * n + j]
            covariances[(first * n + i) * n + j] = p[i * n + j]
    if kind == 3:
        # The printed filter works in plain units: its Q and R are numbers, not multiples of the record's noise.
        noise = settings.noise
        scale = 1.0
        for i in range(n):
            q[i] = settings.process_noise
    row.noise_variance = scale * noise if kind == 3 else scale
    row.innovation = 0.0
    row.innovation_variance = 0.0
    row.fading = 1.0
    row.process_noise = q[0]
    row.noise_factor = noise
    row.weight = 1.0
    row.forgotten = 0.0
    for k in range(first + 1, count):
        dt = t[k] - t[k - 1]
        if case.linear:
            predict_linear(step, case.jacobian, x, p, n, dt)
        else:
            # The size as a constant lets the compiler unroll what a sensor's three states need.
            failed = predict_points(step, x, p, 3, dt, points, scale) if n == 3 else predict_points(step, x, p, n, dt, points, scale)
            if failed:
                return <int> k
        e = y[k] - x[0]
        alpha = 1.0
        r = 1.0
        weight = 1.0
        added = 0.0
        if kind == 3:
            xi = settings.forgetting
            rho = settings.weakening
            threshold = settings.threshold
            factor = settings.factor
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
                d = noise / 100.0 if (posterior < 0.0) == (e > 0.0) else -noise / 100.0
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
            rows[k].noise_variance = noise
        else:
            s = p[0] + 1.0
            nu = e / sqrt(s * scale)
            if kind == 0:
                m.seen += 1.0
                scale += (nu * nu * scale - scale) / m.seen
            elif kind == 1:
                xi = settings.forgetting
                rho = settings.weakening
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
                # Until the noise is known from enough readings, every threshold stands further out.
                u = 1.0 + 5.0 / m.seen
                gate = settings.gate * u
                noise_threshold = settings.noise_threshold * u * u
                wake_threshold = settings.wake_threshold * u
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
                    m.spread = settings.spread_forgetting * m.spread + (1.0 - settings.spread_forgetting) * d
                    # A mean counts against the spread of the moment: grown noise is no news of the physics.
                    u = nu / (sqrt(m.spread) if m.spread > 1.0 else 1.0)
                    u = u if fabs(u) < 3.0 else (3.0 if u > 0.0 else -3.0)
                    m.mean = settings.forgetting * m.mean + (1.0 - settings.forgetting) * u
                    z = fabs(m.mean) * sqrt((1.0 + settings.forgetting) / (1.0 - settings.forgetting))
                    woke = z > wake_threshold and fabs(m.mean) * sqrt(s * scale) > dead_band
                if not gated:
                    m.gated_run = 0.0
                r = m.spread if m.spread > noise_threshold else 1.0
                if gated and fabs(m.gated_run) >= settings.jump_readings:
                    alpha = 100.0           # not outlier: the reading has moved for good
                    m.gated_run = 0.0
                    m.mean = 0.0
                    m.spread = 1.0
                    r = 1.0
                else:
                    if gated:
                        weight = 0.0
                    if woke:
                        alpha = 1.0 + settings.fading_gain * (z / wake_threshold) * (z / wake_threshold)
                        if alpha > settings.fading_most:
                            alpha = settings.fading_most
                if alpha > 1.0:
                    added = p[0]
                    for i in range(n):
                        root[i] = sqrt(alpha)
                        # Forget no more than brings back what was known at the start.
                        if p[i * n + i] * alpha > p0[i * n + i]:
                            root[i] = sqrt(p0[i * n + i] / p[i * n + i]) if p0[i * n + i] > p[i * n + i] else 1.0
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
            rows[k].noise_variance = scale
        if not isfinite(x[0]) or not isfinite(p[0]) or fabs(x[0]) > 1e12:
            return <int> k
        rows[k].innovation = e
        rows[k].innovation_variance = s if kind == 3 else s * scale
        rows[k].fading = alpha
        rows[k].process_noise = added if kind == 3 else added * scale
        rows[k].noise_factor = r
        rows[k].weight = weight
        rows[k].forgotten = forgotten
        for i in range(n):
            states[k * n + i] = x[i]
            for j in range(n):
                covariances[(k * n + i) * n + j] = p[i * n + j]
    return -1


KINDS = {"none": 0, "innovation": 1, "adaptive": 2, "printed": 3}


cdef Case case_of(object step_capsule, object jacobian_capsule, Py_ssize_t n, str rule, object points,
                  const Settings[::1] settings) except *:
    """points: one record of POINTS, or None for the linearised form."""
    cdef Case case
    cdef const Points[::1] given
    if not 1 <= n <= MOST:
        raise ValueError(f"a model of {n} states: the compiled loop takes 1 to {MOST}")
    if settings.shape[0] != 1:
        raise ValueError("one record of settings")
    case.step = <step_function> PyCapsule_GetPointer(step_capsule, b"thermofast.step")
    case.jacobian = NULL
    case.n = n
    case.kind = KINDS[rule]
    case.settings = settings[0]
    case.linear = points is None
    if case.linear:
        case.jacobian = <step_function> PyCapsule_GetPointer(jacobian_capsule, b"thermofast.step")
    else:
        given = points
        case.points = given[0]
    return case


cdef int agree(Py_ssize_t n, Py_ssize_t other, str what) except -1:
    """Sizes come from outside: the loops above run without bounds checks."""
    if n != other:
        raise ValueError(f"{what}: {other}, needed {n}")
    return 0


def run(object step_capsule, object jacobian_capsule, str rule, object points, const Settings[::1] settings,
        const double[::1] t, const double[::1] y, Py_ssize_t first, const double[::1] x0, const double[:, ::1] p0,
        double scale, double dof, double dead_band,
        double[:, ::1] states, double[:, :, ::1] covariances, Row[::1] rows):
    """Filter the readings of one record after `first`; see :func:`thermofast.filters.loop.run`. Returns where it broke, or -1."""
    cdef Py_ssize_t n = x0.shape[0], count = t.shape[0]
    cdef Case case = case_of(step_capsule, jacobian_capsule, n, rule, points, settings)
    cdef int broken
    for size in (y.shape[0], states.shape[0], covariances.shape[0], rows.shape[0]):
        agree(count, size, "readings")
    for size in (p0.shape[0], p0.shape[1], states.shape[1], covariances.shape[1], covariances.shape[2]):
        agree(n, size, "states")
    if not 0 <= first < count:
        raise ValueError(f"a start at reading {first} of {count}")
    with nogil:
        broken = filter_one(&case, &t[0], &y[0], count, first, &x0[0], &p0[0, 0], scale, dof, dead_band,
                            &states[0, 0], &covariances[0, 0, 0], &rows[0])
    return broken


def run_block(object step_capsule, object jacobian_capsule, str rule, object points, const Settings[::1] settings,
              const double[::1] t, const double[:, ::1] y, const Py_ssize_t[::1] first, const double[:, ::1] x0,
              const double[:, :, ::1] p0, const double[::1] scale, const double[::1] dof, const double[::1] dead_band,
              double[:, ::1] weights, double[:, ::1] state, double[:, :, ::1] covariance, Row[::1] last,
              Py_ssize_t[::1] woke, Py_ssize_t[::1] broken):
    """As :func:`run` for records y (S, N) on one grid; kept are what is known after the last reading and, per reading, the weight
    in a likelihood, which comes in as the start's. woke is the first reading at which the rule faded, N where it never did.
    """
    cdef Py_ssize_t n = x0.shape[1], count = t.shape[0], records = y.shape[0], i, j, k
    cdef Case case = case_of(step_capsule, jacobian_capsule, n, rule, points, settings)
    cdef Row[::1] rows
    cdef double[:, ::1] states
    cdef double[:, :, ::1] covariances
    agree(count, y.shape[1], "readings")
    agree(count, weights.shape[1], "weights")
    for size in (first.shape[0], x0.shape[0], p0.shape[0], scale.shape[0], dof.shape[0], dead_band.shape[0], weights.shape[0],
                 state.shape[0], covariance.shape[0], last.shape[0], woke.shape[0], broken.shape[0]):
        agree(records, size, "records")
    for size in (p0.shape[1], p0.shape[2], state.shape[1], covariance.shape[1], covariance.shape[2]):
        agree(n, size, "states")
    for i in range(records):
        if not 0 <= first[i] < count:
            raise ValueError(f"a start at reading {first[i]} of {count}")
    if not records:
        return
    states, covariances = np.empty((count, n)), np.empty((count, n, n))
    rows = np.empty(count, np.asarray(last).dtype)
    with nogil:
        for i in range(records):
            broken[i] = filter_one(&case, &t[0], &y[i, 0], count, first[i], &x0[i, 0], &p0[i, 0, 0], scale[i], dof[i],
                                   dead_band[i], &states[0, 0], &covariances[0, 0, 0], &rows[0])
            woke[i] = count
            if broken[i] >= 0:
                continue
            for k in range(first[i] + 1, count):
                weights[i, k] = 1.0 / rows[k].noise_factor if rows[k].weight > 0.0 else 0.0
                if rows[k].fading > 1.0 and woke[i] == count:
                    woke[i] = k
            last[i] = rows[count - 1]
            for j in range(n):
                state[i, j] = states[count - 1, j]
                for k in range(n):
                    covariance[i, j, k] = covariances[count - 1, j, k]
