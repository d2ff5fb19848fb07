# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled twin of :mod:`thermofast.models.core._forward_numpy`: same names, same arguments, same numbers."""
from libc.math cimport NAN, exp, expm1, fabs, pow, sqrt
from libc.stdlib cimport free, malloc

cdef enum:
    MOST_SUBSTEPS = 256
    ABREAST = 4
    MOST_HIDDEN = 16    # hidden masses of one row


#: |x / anchor - 1| up to which a power is continued from its anchor by the binomial series, whose seventh term is then below 1e-12.
cdef double NEAR = 0.02


#: Share of a time that it may be wrong by where it was read as a decimal and divided by sixty.
cdef double ROUNDED = 1e-15


#: Times the exponent, the share of its excess over the surroundings by which a temperature may move in one step that takes the
#: loss for straight.
cdef double BENDS = 0.05


cdef struct Power:
    double exponent
    double anchor
    double inverse
    double value
    double c1
    double c2
    double c3
    double c4
    double c5
    double c6


cdef inline void power_of(Power* p, double exponent) noexcept nogil:
    p.exponent = exponent
    p.anchor = -1.0
    p.inverse = 0.0
    p.value = 0.0
    p.c1 = exponent
    p.c2 = p.c1 * (exponent - 1.0) / 2.0
    p.c3 = p.c2 * (exponent - 2.0) / 3.0
    p.c4 = p.c3 * (exponent - 3.0) / 4.0
    p.c5 = p.c4 * (exponent - 4.0) / 5.0
    p.c6 = p.c5 * (exponent - 5.0) / 6.0


cdef inline double raised(Power* p, double x) noexcept nogil:
    """x ** exponent for x > 0, quick where x has hardly moved."""
    cdef double d, e
    if p.anchor > 0.0:
        d = x * p.inverse - 1.0
        if -NEAR < d < NEAR:
            e = d * d
            return p.value * ((1.0 + p.c1 * d) + e * ((p.c2 + p.c3 * d) + e * ((p.c4 + p.c5 * d) + e * p.c6)))
    p.anchor = x
    p.inverse = 1.0 / x
    p.value = pow(x, p.exponent)
    return p.value


cdef inline double slope_of(double T, const double* Z, Py_ssize_t masses, double rate, double heat, double loss, double sink,
                            Power* power, const double* hidden, double links, double linked) noexcept nogil:
    cdef double above = T - sink
    cdef double g = loss, held = 0.0
    cdef Py_ssize_t i
    if power.exponent != 0.0:
        g = loss * raised(power, (fabs(above) + 1e-9) * 0.025)
    for i in range(masses):
        held += hidden[i] * (T - Z[i])
    return rate * (heat - g * above) - held - (links * T - linked)


cdef inline bint two_lumps(double lam, double hidden, double r, double dt, double* w) noexcept nogil:
    """Exact weights of one step of T' = u - lam T - hidden (T - Z), Z' = r (T - Z), u straight; False where modes coincide."""
    cdef double a = lam + hidden, root, l1, l2, e1, e2, f1, f2, g1, g2, d
    root = (a - r) * (a - r) + 4.0 * hidden * r
    if not root > 1e-8 * (a + r) * (a + r):
        return False
    root = sqrt(root)
    l1 = -0.5 * (a + r + root)
    l2 = -(lam * r) / (0.5 * (a + r + root))
    f1 = expm1(l1 * dt)
    f2 = expm1(l2 * dt)
    e1 = 1.0 + f1
    e2 = 1.0 + f2
    f1 = f1 / l1
    f2 = f2 / l2 if l2 * dt < -1e-12 else dt
    g1 = (f1 - dt) / l1
    g2 = (f2 - dt) / l2 if l2 * dt < -1e-5 else dt * dt * (0.5 + l2 * dt / 6.0)
    d = l1 - l2
    # Projectors (A - l2)/d and (l1 - A)/d with A = [[-a, hidden], [r, -r]].
    w[0] = (e1 * (-a - l2) + e2 * (l1 + a)) / d
    w[1] = (e1 - e2) * hidden / d
    w[2] = (e1 - e2) * r / d
    w[3] = (e1 * (-r - l2) + e2 * (l1 + r)) / d
    w[4] = (f1 * (-a - l2) + f2 * (l1 + a)) / d
    w[5] = (f1 - f2) * r / d
    w[6] = (g1 * (-a - l2) + g2 * (l1 + a)) / d
    w[7] = (g1 - g2) * r / d
    return True


cdef inline double late_probe(double y, double T0, double T1, double s0, double s1, double h, double lag,
                              double fade) noexcept nogil:
    """A first-order probe one step on, exactly, while its object moves along the cubic of these ends and slopes.

    fade = exp(-h / lag).
    """
    cdef double c = (3.0 * (T1 - T0) / h - 2.0 * s0 - s1) / h
    cdef double d = (2.0 * (T0 - T1) / h + s0 + s1) / (h * h)
    cdef double first = T0 - lag * (s0 - lag * (2.0 * c - lag * 6.0 * d))
    cdef double last = T1 - lag * (s1 - lag * (2.0 * c + 6.0 * d * h - lag * 6.0 * d))
    return last + (y - first) * fade


cdef struct Lump:
    # One row: its constants, where its drive and its output lie, its state, and what is kept from step to step.
    double rate, rise, start, exponent, links, lag, delay, fastest
    Py_ssize_t masses
    const double* heat
    const double* loss
    const double* sink
    const double* linked
    double* out
    double* slope
    double end, end_heat, end_loss
    double T, y, last_lam, last_dt, last_h, fade, E, phi, psi
    bint pair_ok
    Power power
    double w[8]
    double hidden[MOST_HIDDEN]
    double hidden_rate[MOST_HIDDEN]
    double Z[MOST_HIDDEN]


cdef inline double end_slope(Lump* s, double H, double L, Py_ssize_t k) noexcept nogil:
    """Slope of the reading at the end of interval k."""
    if s.lag > 0.0:
        return (s.T - s.y) / s.lag
    return slope_of(s.T, s.Z, s.masses, s.rate, H, L, s.sink[k], &s.power, s.hidden, s.links, s.linked[k])


cdef inline void weigh(Lump* s, const Lump* beside, double lam, double dt) noexcept nogil:
    """Exact weights of one step of T' = u - lam T, u straight; kept while lam and dt stay, and shared with the row beside."""
    cdef double a, gone
    if lam != s.last_lam or dt != s.last_dt:
        if lam == beside.last_lam and dt == beside.last_dt and beside.masses == 0:
            s.E, s.phi, s.psi = beside.E, beside.phi, beside.psi
            s.last_lam, s.last_dt = lam, dt
            return
        a = lam * dt
        gone = -expm1(-a)
        s.E = 1.0 - gone
        if a < 1e-3:
            s.phi = dt * (1.0 - 0.5 * a + a * a / 6.0)
            s.psi = dt * dt * (0.5 - a / 6.0 + a * a / 24.0)
        else:
            s.phi = gone / lam
            s.psi = (dt - s.phi) / lam
        s.last_lam = lam
        s.last_dt = dt


cdef inline void weigh_pair(Lump* s, const Lump* beside, double lam, double dt) noexcept nogil:
    """The same of a row with one hidden mass."""
    cdef Py_ssize_t i
    if lam != s.last_lam or dt != s.last_dt:
        if (lam == beside.last_lam and dt == beside.last_dt and beside.masses == 1 and beside.exponent == 0.0
                and s.hidden[0] == beside.hidden[0] and s.hidden_rate[0] == beside.hidden_rate[0]):
            s.pair_ok = beside.pair_ok
            for i in range(8):
                s.w[i] = beside.w[i]
        else:
            s.pair_ok = two_lumps(lam, s.hidden[0], s.hidden_rate[0], dt, s.w)
        s.last_lam, s.last_dt = lam, dt


cdef inline double faded(Lump* s, const Lump* beside, double h) noexcept nogil:
    """What is left of a probe's distance after h; kept while h stays, and shared with the row beside."""
    if h != s.last_h:
        s.fade = beside.fade if h == beside.last_h and s.lag == beside.lag else exp(-h / s.lag)
        s.last_h = h
    return s.fade


cdef inline void phis(double z, double* f) noexcept nogil:
    """phi_1, phi_2 and phi_3 of z <= 0: e^z = 1 + z phi_1, phi_1 = 1 + z phi_2, phi_2 = 1/2 + z phi_3."""
    if z > -0.05:
        f[2] = (1.0 + z * (1.0 + z * (1.0 + z * (1.0 + z / 7.0) / 6.0) / 5.0) / 4.0) / 6.0
        f[1] = 0.5 + z * f[2]
        f[0] = 1.0 + z * f[1]
    else:
        f[0] = expm1(z) / z
        f[1] = (f[0] - 1.0) / z
        f[2] = (f[1] - 0.5) / z


cdef void rosenbrock(Lump* s, double dt, Py_ssize_t k, double H, double L, Py_ssize_t m) noexcept nogil:
    """One interval of a row that neighbours hold closely, its loss bent, in m equal pieces: see the numpy twin."""
    cdef double h = dt / m, ds = (s.sink[k] - s.sink[k - 1]) / dt, dq = (s.linked[k] - s.linked[k - 1]) / dt
    cdef double sink = s.sink[k - 1], q = s.linked[k - 1], J, v, f0, bent, T0, T2, bend
    cdef double part[3]
    cdef double whole[3]
    cdef Py_ssize_t i
    for i in range(m):
        T0 = s.T
        bend = s.rate * L * raised(&s.power, (fabs(T0 - sink) + 1e-9) * 0.025)
        f0 = s.rate * H - bend * (T0 - sink) - s.links * T0 + q
        J = -(1.0 + s.exponent) * bend - s.links
        v = dq + (1.0 + s.exponent) * bend * ds
        phis(0.75 * h * J, part)
        phis(h * J, whole)
        T2 = T0 + 0.75 * h * (part[0] * f0 + 0.75 * h * part[1] * v)
        bent = (slope_of(T2, s.Z, 0, s.rate, H, L, sink + 0.75 * h * ds, &s.power, s.hidden, s.links, q + 0.75 * h * dq)
                - f0 - J * (T2 - T0) - 0.75 * h * v)
        s.T = T0 + h * (whole[0] * f0 + h * whole[1] * v + 32.0 / 9.0 * whole[2] * bent)
        sink += h * ds
        q += h * dq
    s.y = s.T


cdef void runge_kutta(Lump* s, const Lump* beside, double dt, Py_ssize_t k, double H, double L) noexcept nogil:
    """One interval of a row without an exact step, by the classical Runge-Kutta rule in equal pieces; apart from the quick ways, so
    that these stay in the processor's registers.
    """
    cdef double h, T0, sink, q, ds, dq, s1, q1, k1, k2, k3, k4, z4, steps
    cdef double Z0[MOST_HIDDEN]
    cdef double Z1[MOST_HIDDEN]
    cdef double z1[MOST_HIDDEN]
    cdef double z2[MOST_HIDDEN]
    cdef double z3[MOST_HIDDEN]
    cdef Py_ssize_t m = 1, i, j
    steps = s.rate * L * (1.0 + s.exponent) * dt / 0.3
    while m < steps and m < MOST_SUBSTEPS:
        m = 2 * m
    steps += (s.fastest + s.links) * dt / 0.3
    if m < steps and s.masses == 0 and s.lag == 0.0:
        k1 = slope_of(s.T, s.Z, 0, s.rate, H, L, s.sink[k - 1], &s.power, s.hidden, s.links, s.linked[k - 1])
        if s.exponent * fabs(k1) * dt < BENDS * (fabs(s.T - s.sink[k - 1]) + 1e-9) * max(1.0, s.links * dt):
            rosenbrock(s, dt, k, H, L, m)
            return
    while m < steps and m < MOST_SUBSTEPS:
        m = 2 * m
    h = dt / m
    ds = (s.sink[k] - s.sink[k - 1]) / m
    dq = (s.linked[k] - s.linked[k - 1]) / m
    sink = s.sink[k - 1]
    q = s.linked[k - 1]
    for i in range(m):
        s1 = sink + ds
        q1 = q + dq
        T0 = s.T
        # A probe needed the slope at the end of the last piece: under the same drive it is that at the start of this one.
        if s.lag > 0.0 and H == s.end_heat and L == s.end_loss:
            k1 = s.end
        else:
            k1 = slope_of(T0, s.Z, s.masses, s.rate, H, L, sink, &s.power, s.hidden, s.links, q)
        for j in range(s.masses):
            Z0[j] = s.Z[j]
            z1[j] = s.hidden_rate[j] * (T0 - Z0[j])
            Z1[j] = Z0[j] + 0.5 * h * z1[j]
        k2 = slope_of(T0 + 0.5 * h * k1, Z1, s.masses, s.rate, H, L, sink + 0.5 * ds, &s.power, s.hidden, s.links, q + 0.5 * dq)
        for j in range(s.masses):
            z2[j] = s.hidden_rate[j] * (T0 + 0.5 * h * k1 - Z1[j])
            Z1[j] = Z0[j] + 0.5 * h * z2[j]
        k3 = slope_of(T0 + 0.5 * h * k2, Z1, s.masses, s.rate, H, L, sink + 0.5 * ds, &s.power, s.hidden, s.links, q + 0.5 * dq)
        for j in range(s.masses):
            z3[j] = s.hidden_rate[j] * (T0 + 0.5 * h * k2 - Z1[j])
            Z1[j] = Z0[j] + h * z3[j]
        k4 = slope_of(T0 + h * k3, Z1, s.masses, s.rate, H, L, s1, &s.power, s.hidden, s.links, q1)
        for j in range(s.masses):
            z4 = s.hidden_rate[j] * (T0 + h * k3 - Z1[j])
            s.Z[j] = Z0[j] + h / 6.0 * (z1[j] + 2.0 * z2[j] + 2.0 * z3[j] + z4)
        s.T = T0 + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if s.lag > 0.0:
            k4 = slope_of(s.T, s.Z, s.masses, s.rate, H, L, s1, &s.power, s.hidden, s.links, q1)
            s.y = late_probe(s.y, T0, s.T, k1, k4, h, s.lag, faded(s, beside, h))
            s.end, s.end_heat, s.end_loss = k4, H, L
        sink = s1
        q = q1
    if s.lag == 0.0:
        s.y = s.T


cdef inline void advance(Lump* s, const Lump* beside, double dt, Py_ssize_t k) noexcept nogil:
    """One interval of one row."""
    cdef double H = s.rise * s.heat[k], L = s.loss[k], lam = s.rate * L + s.links, T0, ds
    cdef double u0, u1, k1 = 0.0, k4, moved
    if s.exponent == 0.0 and s.masses == 0:
        weigh(s, beside, lam, dt)
        u0 = s.rate * (H + L * s.sink[k - 1]) + s.linked[k - 1]
        u1 = s.rate * (H + L * s.sink[k]) + s.linked[k]
        T0 = s.T
        s.T = T0 * s.E + u0 * s.phi + (u1 - u0) / dt * s.psi
        if s.lag > 0.0:
            s.y = late_probe(s.y, T0, s.T, u0 - lam * T0, u1 - lam * s.T, dt, s.lag, faded(s, beside, dt))
        else:
            s.y = s.T
    else:
        if s.exponent == 0.0 and s.masses == 1:
            weigh_pair(s, beside, lam, dt)
        if s.exponent == 0.0 and s.pair_ok:
            T0 = s.T
            if s.lag > 0.0:
                k1 = slope_of(T0, s.Z, 1, s.rate, H, L, s.sink[k - 1], &s.power, s.hidden, s.links, s.linked[k - 1])
            u0 = s.rate * (H + L * s.sink[k - 1]) + s.linked[k - 1]
            u1 = s.rate * (H + L * s.sink[k]) + s.linked[k]
            ds = (u1 - u0) / dt
            moved = s.w[0] * T0 + s.w[1] * s.Z[0] + s.w[4] * u0 + s.w[6] * ds
            s.Z[0] = s.w[2] * T0 + s.w[3] * s.Z[0] + s.w[5] * u0 + s.w[7] * ds
            s.T = moved
            if s.lag > 0.0:
                k4 = slope_of(s.T, s.Z, 1, s.rate, H, L, s.sink[k], &s.power, s.hidden, s.links, s.linked[k])
                s.y = late_probe(s.y, T0, s.T, k1, k4, dt, s.lag, faded(s, beside, dt))
            else:
                s.y = s.T
        else:
            runge_kutta(s, beside, dt, k, H, L)
    s.out[k] = s.y
    if s.delay > 0.0:
        s.slope[k] = end_slope(s, H, L, k)


cdef void retard(Lump* s, const double* time, Py_ssize_t n, double* curve) noexcept nogil:
    """The row's output `delay` later: cubic between readings, its start before."""
    cdef Py_ssize_t k, j = 0
    cdef double at, dt, x
    for k in range(n):
        curve[k] = s.out[k]
    for k in range(s.masses):
        s.Z[k] = s.start
    s.slope[0] = 0.0 if s.lag > 0.0 else slope_of(
        s.start, s.Z, s.masses, s.rate, s.rise * s.heat[1], s.loss[1], s.sink[0], &s.power, s.hidden, s.links, s.linked[0])
    for k in range(n):
        at = time[k] - s.delay
        if at <= time[0]:
            s.out[k] = s.start
            continue
        while j < n - 2 and time[j + 1] < at:
            j += 1
        dt = time[j + 1] - time[j]
        x = (at - time[j]) / dt
        s.out[k] = (curve[j] * (1.0 + 2.0 * x) * (1.0 - x) * (1.0 - x) + s.slope[j] * dt * x * (1.0 - x) * (1.0 - x)
                    + curve[j + 1] * x * x * (3.0 - 2.0 * x) + s.slope[j + 1] * dt * x * x * (x - 1.0))


def forward(const double[::1] time, const double[::1] rate, const double[::1] rise, const double[::1] start,
            const double[:, ::1] heat, const double[:, ::1] loss, const double[:, ::1] sink, const double[::1] exponent,
            const double[:, ::1] hidden, const double[:, ::1] hidden_rate, const double[::1] links, const double[:, ::1] linked,
            const double[::1] lag, const double[::1] delay, double[:, ::1] out):
    """See the numpy twin. A few rows go abreast: each is one long chain of operations, and a processor has room for several."""
    cdef Py_ssize_t rows = rate.shape[0], n = time.shape[0], first, b, k, j, count, masses = hidden.shape[1]
    cdef double dt, last = 0.0
    cdef Lump lumps[ABREAST]
    cdef Lump* s
    cdef double* slopes
    if masses > MOST_HIDDEN:
        raise ValueError(f"{masses} hidden masses: at most {MOST_HIDDEN} of one lump are worked out")
    for size in (rise.shape[0], start.shape[0], exponent.shape[0], hidden.shape[0], hidden_rate.shape[0], links.shape[0],
                 lag.shape[0], delay.shape[0], out.shape[0]):
        if size != rows:
            raise ValueError(f"{size} rows, needed {rows}")
    for size in (heat.shape[1], loss.shape[1], sink.shape[1], linked.shape[1], out.shape[1]):
        if size != n:
            raise ValueError(f"{size} readings, needed {n}")
    if hidden_rate.shape[1] != masses:
        raise ValueError("as many rates of hidden masses as couplings")
    if not rows or not n:
        return
    slopes = <double*> malloc((ABREAST + 1) * n * sizeof(double))
    if slopes == NULL:
        raise MemoryError
    with nogil:
        first = 0
        while first < rows:
            count = ABREAST if first + ABREAST <= rows else rows - first
            for j in range(count):
                b = first + j
                s = &lumps[j]
                s.rate, s.rise, s.start, s.exponent = rate[b], rise[b], start[b], exponent[b]
                s.links, s.lag, s.delay, s.masses, s.fastest = links[b], lag[b], delay[b], 0, 0.0
                for k in range(masses):
                    if hidden[b, k] != 0.0:     # a mass without a coupling is none
                        s.hidden[s.masses], s.hidden_rate[s.masses], s.Z[s.masses] = hidden[b, k], hidden_rate[b, k], start[b]
                        s.fastest += hidden[b, k] + hidden_rate[b, k]
                        s.masses += 1
                s.heat = &heat[b if heat.shape[0] > 1 else 0, 0]
                s.loss = &loss[b if loss.shape[0] > 1 else 0, 0]
                s.sink = &sink[b if sink.shape[0] > 1 else 0, 0]
                s.linked = &linked[b if linked.shape[0] > 1 else 0, 0]
                s.out = &out[b, 0]
                s.slope = slopes + j * n
                power_of(&s.power, s.exponent)
                s.T = s.y = s.out[0] = s.start
                s.last_lam = s.last_dt = s.last_h = -1.0
                s.end_heat = s.end_loss = NAN
                s.end = s.fade = s.E = s.phi = s.psi = 0.0
                s.pair_ok = False
            for k in range(1, n):
                dt = time[k] - time[k - 1]
                # Steps that differ by no more than the times are rounded to are one step: weights are kept while it stays.
                if fabs(dt - last) <= ROUNDED * fabs(time[k]):
                    dt = last
                last = dt
                for j in range(count):
                    advance(&lumps[j], &lumps[j - 1 if j else 0], dt, k)
            for j in range(count):
                if lumps[j].delay > 0.0:
                    retard(&lumps[j], &time[0], n, slopes + ABREAST * n)
            first += ABREAST
    free(slopes)


def followed(const double[::1] time, const double[::1] values, const double[::1] lag, double[:, ::1] out):
    """See the numpy twin."""
    cdef Py_ssize_t rows = lag.shape[0], n = time.shape[0], b, k
    cdef double a, E, phi, dt, y
    with nogil:
        for b in range(rows):
            y = values[0]
            out[b, 0] = y
            for k in range(1, n):
                if lag[b] <= 0.0:
                    out[b, k] = values[k]
                    continue
                dt = time[k] - time[k - 1]
                a = dt / lag[b]
                E = exp(-a)
                phi = (1.0 - E) / a if a > 1e-8 else 1.0 - 0.5 * a
                y = E * y + (phi - E) * values[k - 1] + (1.0 - phi) * values[k]
                out[b, k] = y
