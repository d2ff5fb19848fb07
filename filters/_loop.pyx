# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled twin of :func:`thermofast.filters.loop.run_readable`: every reading of one sensor in one call.

The model comes in as a capsule around ``void step(const double *state, double dt, double *next)``: this file knows no physics.
"""
from cpython.pycapsule cimport PyCapsule_GetPointer
from libc.math cimport fabs, isfinite, sqrt, log

import numpy as np

ctypedef void (*step_function)(const double*, double, double*) noexcept nogil
ctypedef void (*steps_function)(const double*, Py_ssize_t, double, double*) noexcept nogil

cdef enum:
    MOST = 8
    LANES = 4       # records filtered side by side: a processor waits for no record's divisions and roots
    AHEAD = 24      # sigma points of that many records of three states

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
    steps_function steps    # of many states at once, NULL where a model has none
    Py_ssize_t n
    int kind
    bint linear
    Points points
    Settings settings
    double mean_scale       # deviations of an exponentially forgetting mean to one

cdef struct Rule:
    # What a rule remembers of a record.
    double mean
    double spread
    double gated_run
    double seen
    double fading_variance
    bint fading_started
    double scale        # variance of a reading
    double forgotten

cdef struct Update:
    # Outcome of one reading.
    double s
    double r
    double alpha
    double weight
    double added


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


cdef inline void judge(Case* case, Rule* m, double* p, const double* p0, Py_ssize_t n, Py_ssize_t stride, double e,
                       double dead_band, Update* out) noexcept nogil:
    """What a rule makes of an innovation; fades the covariance, element i of which stands at i * stride."""
    cdef Settings* settings = &case.settings
    cdef double root[MOST]
    cdef double nu, z = 0.0, alpha = 1.0, r = 1.0, weight = 1.0, added = 0.0, d, u, gate, noise_threshold, wake_threshold, xi, rho
    cdef double s = p[0] + 1.0
    cdef Py_ssize_t i, j
    cdef bint gated, woke
    nu = e / sqrt(s * m.scale)
    if case.kind == 0:
        m.seen += 1.0
        m.scale += (nu * nu * m.scale - m.scale) / m.seen
    elif case.kind == 1:
        xi = settings.forgetting
        rho = settings.weakening
        if not m.fading_started:
            m.fading_variance = e * e / m.scale
            m.fading_started = True
        else:
            m.fading_variance = (xi * m.fading_variance + e * e / m.scale) / (1.0 + xi)
        alpha = (m.fading_variance - rho) / s
        if alpha > 1.0:
            added = (alpha - 1.0) * p[0]
            u = sqrt(alpha)
            for i in range(n):
                p[i * stride] *= u
                p[i * n * stride] *= u
            s = p[0] + 1.0
            m.forgotten += log(alpha)
        else:
            alpha = 1.0
        m.seen += 1.0
        m.scale += ((nu * nu if nu * nu < 9.0 else 9.0) * m.scale - m.scale) / m.seen
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
            u = nu / sqrt(m.spread) if m.spread > 1.0 else nu
            u = u if fabs(u) < 3.0 else (3.0 if u > 0.0 else -3.0)
            m.mean = settings.forgetting * m.mean + (1.0 - settings.forgetting) * u
            z = fabs(m.mean) * case.mean_scale
            woke = z > wake_threshold and fabs(m.mean) * sqrt(s * m.scale) > dead_band
        if not gated:
            m.gated_run = 0.0
        r = m.spread if m.spread > noise_threshold else 1.0
        if gated and fabs(m.gated_run) >= settings.jump_readings:
            alpha = 100.0           # no outlier: the readings have moved for good
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
                d = p[(i * n + i) * stride]
                root[i] = sqrt(alpha)
                # Forget no more than brings back what was known at the start.
                if d * alpha > p0[i * n + i]:
                    root[i] = sqrt(p0[i * n + i] / d) if p0[i * n + i] > d else 1.0
            for i in range(n):
                for j in range(n):
                    p[(i * n + j) * stride] *= root[i] * root[j]
            if alpha == 100.0:
                p[0] += e * e / m.scale    # the reading is anew
            added = p[0] - added
            m.forgotten += log(alpha)
        s = p[0] + r
        if not gated and m.spread <= noise_threshold:
            m.seen += 1.0
            d = nu * nu if nu * nu < 9.0 else 9.0
            if alpha == 1.0:
                m.scale += (d * m.scale - m.scale) / m.seen
    out.s = s
    out.r = r
    out.alpha = alpha
    out.weight = weight
    out.added = added


cdef inline void judge_as_printed(Case* case, Rule* m, double* x, double* p, double* q, double* noise, double e,
                                  Update* out) noexcept nogil:
    """The printed rule: equations (12), (13), (18) to (25) and figure 1; updates state and covariance itself."""
    cdef double root[MOST]
    cdef Settings* settings = &case.settings
    cdef Py_ssize_t i, j, n = case.n
    cdef double xi = settings.forgetting, rho = settings.weakening, threshold = settings.threshold, factor = settings.factor
    cdef double s, alpha, gain0, posterior, u, d
    cdef int tries
    for i in range(n):
        p[i * n + i] += q[i]
    if not m.fading_started:
        m.fading_variance = e * e
        m.fading_started = True
    else:
        m.fading_variance = (xi * m.fading_variance + e * e) / (1.0 + xi)
    s = p[0] + noise[0]
    alpha = (m.fading_variance - rho * noise[0]) / s
    if not alpha > 1.0:
        alpha = 1.0
    # R moves until the posterior residual is inside the threshold.
    gain0 = alpha * p[0] / s
    posterior = e * (1.0 - gain0)
    if fabs(posterior) > threshold:
        u = factor if posterior < 0.0 else 1.0 / factor
        for i in range(n):
            q[i] *= u
        d = noise[0] / 100.0 if (posterior < 0.0) == (e > 0.0) else -noise[0] / 100.0
        for tries in range(10000):
            if noise[0] + d <= 0.0:
                break
            noise[0] += d
            s = p[0] + noise[0]
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
    out.s = s
    out.r = noise[0]
    out.alpha = alpha
    out.weight = 1.0
    out.added = q[0]


cdef inline void begin(Rule* m, double scale, double dof) noexcept nogil:
    m.mean = 0.0
    m.spread = 1.0
    m.gated_run = 0.0
    m.seen = dof
    m.fading_variance = 0.0
    m.fading_started = False
    m.scale = scale
    m.forgotten = 0.0


cdef int filter_one(Case* case, const double* t, const double* y, Py_ssize_t count, Py_ssize_t first, const double* x0,
                    const double* p0, double scale, double dof, double dead_band,
                    double* states, double* covariances, Row* rows, Rule* m) noexcept nogil:
    """Filter readings first+1..; row k of the outputs holds the posterior of reading k, and m what the rule remembers at the end.

    Returns the index where it broke, or -1.
    """
    cdef Py_ssize_t n = case.n, i, j, k
    cdef Row* row = &rows[first]
    cdef double x[MOST]
    cdef double p[MOST * MOST]
    cdef double q[MOST]
    cdef double e, dt, noise = 1.0
    cdef bint printed = case.kind == 3
    cdef int failed
    cdef Update u
    # The printed filter works in plain units: its Q and R are numbers, not multiples of the record's noise.
    begin(m, 1.0 if printed else scale, dof)
    if printed:
        noise = case.settings.noise
    for i in range(n):
        x[i] = x0[i]
        states[first * n + i] = x[i]
        q[i] = case.settings.process_noise if printed else 0.0
        for j in range(n):
            p[i * n + j] = p0[i * n + j]
            covariances[(first * n + i) * n + j] = p[i * n + j]
    row.noise_variance = noise if printed else scale
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
            predict_linear(case.step, case.jacobian, x, p, n, dt)
        else:
            # The size as a constant lets the compiler unroll what a sensor's three states need.
            failed = (predict_points(case.step, x, p, 3, dt, &case.points, m.scale) if n == 3
                      else predict_points(case.step, x, p, n, dt, &case.points, m.scale))
            if failed:
                return <int> k
        e = y[k] - x[0]
        if printed:
            judge_as_printed(case, m, x, p, q, &noise, e, &u)
        elif n == 3:
            judge(case, m, p, p0, 3, 1, e, dead_band, &u)
            if u.weight > 0.0:
                joseph(x, p, 3, e, u.s, u.r)
        else:
            judge(case, m, p, p0, n, 1, e, dead_band, &u)
            if u.weight > 0.0:
                joseph(x, p, n, e, u.s, u.r)
        if not isfinite(x[0]) or not isfinite(p[0]) or fabs(x[0]) > 1e12:
            return <int> k
        tell(&rows[k], m, &u, e, printed, noise)
        for i in range(n):
            states[k * n + i] = x[i]
            for j in range(n):
                covariances[(k * n + i) * n + j] = p[i * n + j]
    return -1


cdef inline void tell(Row* row, Rule* m, Update* u, double e, bint printed, double noise) noexcept nogil:
    row.noise_variance = noise if printed else m.scale
    row.innovation = e
    row.innovation_variance = u.s if printed else u.s * m.scale
    row.fading = u.alpha
    row.process_noise = u.added if printed else u.added * m.scale
    row.noise_factor = u.r
    row.weight = u.weight
    row.forgotten = m.forgotten


cdef inline void predict_lanes(Case* case, double* x, double* p, double dt, const double* scale, int* failed) noexcept nogil:
    """:func:`predict_points` of symmetric points for LANES records of three states: state i of record l is x[i * LANES + l],
    element (i, j) of its covariance p[(3 * i + j) * LANES + l]. failed[l] becomes 1 where a covariance is indefinite.
    """
    cdef double root[9 * LANES]     # lower factors
    cdef double points[3 * AHEAD]   # state by state; of each, points + and - of each column, record by record
    cdef double moved[3 * AHEAD]
    cdef double mean[3 * LANES]
    cdef double spread[LANES]
    cdef double rest[LANES]
    cdef double size[LANES]
    cdef double whole[LANES]
    cdef double each = case.points.each, far, limit
    cdef Py_ssize_t i, j, k, l
    for l in range(LANES):
        spread[l] = case.points.spread * sqrt(scale[l])
    for j in range(3):
        for l in range(LANES):
            size[l] = fabs(p[4 * j * LANES + l])
            rest[l] = p[4 * j * LANES + l]
        for k in range(j):
            for l in range(LANES):
                rest[l] -= root[(3 * j + k) * LANES + l] * root[(3 * j + k) * LANES + l]
        for l in range(LANES):
            limit = 1e-14 * p[4 * j * LANES + l]
            # A slope long settled: its variance has run out of digits. Or a direction of which all is known, but for rounding.
            whole[l] = 1.0 if rest[l] > limit and not size[l] < 1e-200 else 0.0
            if not size[l] < 1e-200 and not rest[l] > limit and not rest[l] >= -1e-9 * size[l]:
                failed[l] = 1
            rest[l] = rest[l] if whole[l] > 0.0 else 1.0
        for l in range(LANES):
            root[4 * j * LANES + l] = sqrt(rest[l])
        for i in range(j + 1, 3):
            for l in range(LANES):
                rest[l] = p[(3 * i + j) * LANES + l]
            for k in range(j):
                for l in range(LANES):
                    rest[l] -= root[(3 * i + k) * LANES + l] * root[(3 * j + k) * LANES + l]
            for l in range(LANES):
                root[(3 * i + j) * LANES + l] = whole[l] * (rest[l] / root[4 * j * LANES + l])
        for l in range(LANES):
            root[4 * j * LANES + l] *= whole[l]
    for j in range(3):
        for i in range(3):
            for l in range(LANES):
                far = spread[l] * root[(3 * i + j) * LANES + l] if i >= j else 0.0
                points[i * AHEAD + 2 * j * LANES + l] = x[i * LANES + l] + far
                points[i * AHEAD + (2 * j + 1) * LANES + l] = x[i * LANES + l] - far
    case.steps(points, AHEAD, dt, moved)
    for i in range(3):
        for l in range(LANES):
            mean[i * LANES + l] = 0.0
        for j in range(3):
            for l in range(LANES):
                mean[i * LANES + l] += each * (moved[i * AHEAD + 2 * j * LANES + l] + moved[i * AHEAD + (2 * j + 1) * LANES + l])
        for k in range(6):
            for l in range(LANES):
                moved[i * AHEAD + k * LANES + l] -= mean[i * LANES + l]
        for l in range(LANES):
            x[i * LANES + l] = mean[i * LANES + l]
    for i in range(3):
        for j in range(i + 1):
            for l in range(LANES):
                rest[l] = 0.0
            for k in range(6):
                for l in range(LANES):
                    rest[l] += moved[i * AHEAD + k * LANES + l] * moved[j * AHEAD + k * LANES + l]
            for l in range(LANES):
                rest[l] = rest[l] * each / scale[l]
                p[(3 * i + j) * LANES + l] = rest[l]
                p[(3 * j + i) * LANES + l] = rest[l]


cdef inline void joseph_lanes(double* x, double* p, const double* e, const double* s, const double* r,
                              const double* weight) noexcept nogil:
    """:func:`joseph` for LANES records; one of weight 0 learns nothing."""
    cdef double gain[3 * LANES]
    cdef double row[3 * LANES]
    cdef Py_ssize_t i, j, l
    for i in range(3):
        for l in range(LANES):
            gain[i * LANES + l] = p[3 * i * LANES + l] / s[l] if weight[l] > 0.0 else 0.0
            row[i * LANES + l] = p[i * LANES + l]
    for i in range(3):
        for l in range(LANES):
            x[i * LANES + l] += gain[i * LANES + l] * e[l]
    for i in range(3):
        for j in range(3):
            for l in range(LANES):
                p[(3 * i + j) * LANES + l] -= gain[i * LANES + l] * row[j * LANES + l]
    for i in range(3):
        for l in range(LANES):
            row[i * LANES + l] = p[3 * i * LANES + l]
    for i in range(3):
        for j in range(3):
            for l in range(LANES):
                p[(3 * i + j) * LANES + l] += gain[j * LANES + l] * (r[l] * gain[i * LANES + l] - row[i * LANES + l])
    for i in range(3):
        for j in range(i):
            for l in range(LANES):
                p[(3 * i + j) * LANES + l] = 0.5 * (p[(3 * i + j) * LANES + l] + p[(3 * j + i) * LANES + l])
                p[(3 * j + i) * LANES + l] = p[(3 * i + j) * LANES + l]


cdef inline bint symmetric(const Points* points) noexcept nogil:
    return points.centre_mean == 0.0 and points.centre_covariance == 0.0


cdef inline void keep_weights(const Row* rows, Py_ssize_t begin_, Py_ssize_t end, Py_ssize_t count, double* weights,
                              Py_ssize_t* woke) noexcept nogil:
    """Weights in a likelihood of the readings from `begin_` up to `end`, and the first at which the rule faded."""
    cdef Py_ssize_t k
    for k in range(begin_, end):
        weights[k] = 1.0 / rows[k].noise_factor if rows[k].weight > 0.0 else 0.0
        if rows[k].fading > 1.0 and woke[0] == count:
            woke[0] = k


cdef struct Several:
    # LANES records side by side; what is kept of a reading is its weight in a likelihood.
    double x[12]
    double p[36]
    Rule m[LANES]
    Row last[LANES]
    Py_ssize_t woke[LANES]
    Py_ssize_t broken[LANES]


cdef void filter_lanes(Case* case, const double* t, const double** y, Py_ssize_t count, Py_ssize_t begun, const double** p0,
                       const double* dead_band, double** weights, Several* a) noexcept nogil:
    """Filter readings begun+1.. of LANES records of three states; the first reading at which one broke stands in a.broken."""
    cdef double e[LANES]
    cdef double s[LANES]
    cdef double r[LANES]
    cdef double weight[LANES]
    cdef double scale[LANES]
    cdef int failed[LANES]
    cdef Update u
    cdef Py_ssize_t k, l
    for l in range(LANES):
        failed[l] = 0
    for k in range(begun + 1, count):
        for l in range(LANES):
            scale[l] = a.m[l].scale
        predict_lanes(case, a.x, a.p, t[k] - t[k - 1], scale, failed)
        for l in range(LANES):
            e[l] = y[l][k] - a.x[l]
            judge(case, &a.m[l], &a.p[l], p0[l], 3, LANES, e[l], dead_band[l], &u)
            s[l] = u.s
            r[l] = u.r
            weight[l] = u.weight
            if a.broken[l] < 0:
                weights[l][k] = (1.0 / u.r if u.r != 1.0 else 1.0) if u.weight > 0.0 else 0.0
                if u.alpha > 1.0 and a.woke[l] == count:
                    a.woke[l] = k
                if k == count - 1:
                    tell(&a.last[l], &a.m[l], &u, e[l], False, 1.0)
        joseph_lanes(a.x, a.p, e, s, r, weight)
        for l in range(LANES):
            if a.broken[l] < 0 and (failed[l] or not isfinite(a.x[l]) or not isfinite(a.p[l]) or fabs(a.x[l]) > 1e12):
                a.broken[l] = k


KINDS = {"none": 0, "innovation": 1, "adaptive": 2, "printed": 3}


cdef Case case_of(object capsules, Py_ssize_t n, str rule, object points, const Settings[::1] settings) except *:
    """capsules: (step, jacobian, steps) of the model, the last None where it has none; points: one record of POINTS, or None for
    the linearised form.
    """
    cdef Case case
    cdef const Points[::1] given
    step, jacobian, steps = capsules
    if not 1 <= n <= MOST:
        raise ValueError(f"a model of {n} states: the compiled loop takes 1 to {MOST}")
    if settings.shape[0] != 1:
        raise ValueError("one record of settings")
    case.step = <step_function> PyCapsule_GetPointer(step, b"thermofast.step")
    case.jacobian = NULL
    case.steps = NULL if steps is None else <steps_function> PyCapsule_GetPointer(steps, b"thermofast.steps")
    case.n = n
    case.kind = KINDS[rule]
    case.settings = settings[0]
    case.mean_scale = sqrt((1.0 + case.settings.forgetting) / (1.0 - case.settings.forgetting))
    case.linear = points is None
    if case.linear:
        case.jacobian = <step_function> PyCapsule_GetPointer(jacobian, b"thermofast.step")
    else:
        given = points
        case.points = given[0]
    return case


cdef int agree(Py_ssize_t n, Py_ssize_t other, str what) except -1:
    """Sizes come from outside: the loops above run without bounds checks."""
    if n != other:
        raise ValueError(f"{what}: {other}, needed {n}")
    return 0


def run(object capsules, str rule, object points, const Settings[::1] settings,
        const double[::1] t, const double[::1] y, Py_ssize_t first, const double[::1] x0, const double[:, ::1] p0,
        double scale, double dof, double dead_band,
        double[:, ::1] states, double[:, :, ::1] covariances, Row[::1] rows):
    """Filter the readings of one record after `first`; see :func:`thermofast.filters.loop.run`. Returns where it broke, or -1."""
    cdef Py_ssize_t n = x0.shape[0], count = t.shape[0]
    cdef Case case = case_of(capsules, n, rule, points, settings)
    cdef Rule m
    cdef int broken
    for size in (y.shape[0], states.shape[0], covariances.shape[0], rows.shape[0]):
        agree(count, size, "readings")
    for size in (p0.shape[0], p0.shape[1], states.shape[1], covariances.shape[1], covariances.shape[2]):
        agree(n, size, "states")
    if not 0 <= first < count:
        raise ValueError(f"a start at reading {first} of {count}")
    with nogil:
        broken = filter_one(&case, &t[0], &y[0], count, first, &x0[0], &p0[0, 0], scale, dof, dead_band,
                            &states[0, 0], &covariances[0, 0, 0], &rows[0], &m)
    return broken


def run_block(object capsules, str rule, object points, const Settings[::1] settings,
              const double[::1] t, const double[:, ::1] y, const Py_ssize_t[::1] first, const double[:, ::1] x0,
              const double[:, :, ::1] p0, const double[::1] scale, const double[::1] dof, const double[::1] dead_band,
              double[:, ::1] weights, double[:, ::1] state, double[:, :, ::1] covariance, Row[::1] last,
              Py_ssize_t[::1] woke, Py_ssize_t[::1] broken):
    """As :func:`run` for records y (S, N) on one grid; kept are what is known after the last reading and, per reading, the weight
    in a likelihood, which comes in as the start's. woke is the first reading at which the rule faded, N where it never did.
    """
    cdef Py_ssize_t n = x0.shape[1], count = t.shape[0], records = y.shape[0], i, j, k, l, done = 0, begun
    cdef Case case = case_of(capsules, n, rule, points, settings)
    cdef Row[::1] rows
    cdef double[:, ::1] states
    cdef double[:, :, ::1] covariances
    cdef Several a
    cdef Rule m
    cdef const double* readings[LANES]
    cdef const double* starts[LANES]
    cdef double* kept[LANES]
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
        if case.steps != NULL and n == 3 and not case.linear and case.kind != 3 and symmetric(&case.points):
            # Side by side from where the last of them has begun; until then, and what is left over, one by one.
            while done + LANES <= records:
                begun = first[done]
                for l in range(LANES):
                    begun = first[done + l] if first[done + l] > begun else begun
                for l in range(LANES):
                    i = done + l
                    readings[l] = &y[i, 0]
                    starts[l] = &p0[i, 0, 0]
                    kept[l] = &weights[i, 0]
                    a.broken[l] = filter_one(&case, &t[0], &y[i, 0], begun + 1, first[i], &x0[i, 0], &p0[i, 0, 0], scale[i],
                                             dof[i], dead_band[i], &states[0, 0], &covariances[0, 0, 0], &rows[0], &a.m[l])
                    a.woke[l] = count
                    keep_weights(&rows[0], first[i] + 1, begun + 1 if a.broken[l] < 0 else a.broken[l], count, kept[l],
                                 &a.woke[l])
                    a.last[l] = rows[begun]
                    for j in range(3):
                        a.x[j * LANES + l] = states[begun, j]
                        for k in range(3):
                            a.p[(3 * j + k) * LANES + l] = covariances[begun, j, k]
                filter_lanes(&case, &t[0], readings, count, begun, starts, &dead_band[done], kept, &a)
                for l in range(LANES):
                    i = done + l
                    broken[i] = a.broken[l]
                    woke[i] = a.woke[l]
                    if broken[i] < 0:
                        last[i] = a.last[l]
                        for j in range(3):
                            state[i, j] = a.x[j * LANES + l]
                            for k in range(3):
                                covariance[i, j, k] = a.p[(3 * j + k) * LANES + l]
                done += LANES
        for i in range(done, records):
            broken[i] = filter_one(&case, &t[0], &y[i, 0], count, first[i], &x0[i, 0], &p0[i, 0, 0], scale[i], dof[i],
                                   dead_band[i], &states[0, 0], &covariances[0, 0, 0], &rows[0], &m)
            woke[i] = count
            if broken[i] >= 0:
                continue
            keep_weights(&rows[0], first[i] + 1, count, count, &weights[i, 0], &woke[i])
            last[i] = rows[count - 1]
            for j in range(n):
                state[i, j] = states[count - 1, j]
                for k in range(n):
                    covariance[i, j, k] = covariances[count - 1, j, k]
