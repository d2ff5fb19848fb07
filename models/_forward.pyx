# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled twin of :mod:`models._forward_numpy`: same names, same arguments, same numbers."""
from libc.math cimport exp, expm1, fabs, pow, sqrt
from libc.stdlib cimport free, malloc

cdef enum:
    MOST_SUBSTEPS = 256


#: |x / anchor - 1| up to which a power is continued from its anchor by the binomial series, whose seventh term is then below 1e-12.
cdef double NEAR = 0.02


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


cdef inline double slope_of(double T, double Z, double rate, double heat, double loss, double sink, Power* power,
                            double hidden, double links, double linked) noexcept nogil:
    cdef double above = T - sink
    cdef double g = loss
    if power.exponent != 0.0:
        g = loss * raised(power, (fabs(above) + 1e-9) * 0.025)
    return rate * (heat - g * above) - hidden * (T - Z) - (links * T - linked)


cdef inline bint two_lumps(double lam, double hidden, double r, double dt, double* w) noexcept nogil:
    """Exact weights of one step of T' = u - lam T - hidden (T - Z), Z' = r (T - Z), u straight; False where modes coincide."""
    cdef double a = lam + hidden, root, l1, l2, e1, e2, f1, f2, g1, g2, d
    root = (a - r) * (a - r) + 4.0 * hidden * r
    if not root > 1e-8 * (a + r) * (a + r):
        return False
    root = sqrt(root)
    l1 = -0.5 * (a + r + root)
    l2 = -(lam * r) / (0.5 * (a + r + root))
    e1 = exp(l1 * dt)
    e2 = exp(l2 * dt)
    f1 = expm1(l1 * dt) / l1
    f2 = expm1(l2 * dt) / l2 if l2 * dt < -1e-12 else dt
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


def forward(const double[::1] time, const double[::1] rate, const double[::1] rise, const double[::1] start,
            const double[:, ::1] heat, const double[:, ::1] loss, const double[:, ::1] sink, const double[::1] exponent,
            const double[::1] hidden, const double[::1] hidden_rate, const double[::1] links, const double[:, ::1] linked,
            const double[::1] lag, const double[::1] delay, double[:, ::1] out):
    """See the numpy twin."""
    cdef Py_ssize_t rows = rate.shape[0], n = time.shape[0], b, k, j, hb, lb, sb, kb, m, i
    cdef double T, Z, y, dt, h, lam, E, phi, psi, u0, u1, last_lam, last_dt, fast, steps
    cdef double last_h, fade, s, ds, q, dq, sm, qm, s1, q1, H, L, a, at, x
    cdef double k1, k2, k3, k4, z1, z2, z3, z4, T0
    cdef double w[8]
    cdef bint paired, pair_ok = False
    cdef Power power
    cdef double* curve = <double*> malloc(n * sizeof(double))
    cdef double* slope = <double*> malloc(n * sizeof(double))
    if curve == NULL or slope == NULL:
        free(curve)
        free(slope)
        raise MemoryError
    with nogil:
        for b in range(rows):
            hb = b if heat.shape[0] > 1 else 0
            lb = b if loss.shape[0] > 1 else 0
            sb = b if sink.shape[0] > 1 else 0
            kb = b if linked.shape[0] > 1 else 0
            power_of(&power, exponent[b])
            T = start[b]
            Z = T
            y = T
            last_lam = -1.0
            last_dt = -1.0
            last_h = -1.0
            fade = 0.0
            E = 0.0
            phi = 0.0
            psi = 0.0
            out[b, 0] = T
            for k in range(1, n):
                dt = time[k] - time[k - 1]
                H = rise[b] * heat[hb, k]
                L = loss[lb, k]
                if exponent[b] == 0.0 and hidden[b] == 0.0 and lag[b] == 0.0:
                    lam = rate[b] * L + links[b]
                    if lam != last_lam or dt != last_dt:
                        a = lam * dt
                        E = exp(-a)
                        if a < 1e-3:
                            phi = dt * (1.0 - 0.5 * a + a * a / 6.0)
                            psi = dt * dt * (0.5 - a / 6.0 + a * a / 24.0)
                        else:
                            phi = -expm1(-a) / lam
                            psi = (dt - phi) / lam
                        last_lam = lam
                        last_dt = dt
                    u0 = rate[b] * (H + L * sink[sb, k - 1]) + linked[kb, k - 1]
                    u1 = rate[b] * (H + L * sink[sb, k]) + linked[kb, k]
                    T = T * E + u0 * phi + (u1 - u0) / dt * psi
                    y = T
                else:
                    m = 1
                    lam = rate[b] * L + links[b]
                    paired = False
                    if exponent[b] == 0.0 and hidden[b] != 0.0:
                        if lam != last_lam or dt != last_dt:
                            pair_ok = two_lumps(lam, hidden[b], hidden_rate[b], dt, w)
                            last_lam = lam
                            last_dt = dt
                        paired = pair_ok
                    if paired:
                        T0 = T
                        k1 = slope_of(T, Z, rate[b], H, L, sink[sb, k - 1], &power, hidden[b], links[b], linked[kb, k - 1])
                        u0 = rate[b] * (H + L * sink[sb, k - 1]) + linked[kb, k - 1]
                        u1 = rate[b] * (H + L * sink[sb, k]) + linked[kb, k]
                        ds = (u1 - u0) / dt
                        s = w[0] * T + w[1] * Z + w[4] * u0 + w[6] * ds
                        Z = w[2] * T + w[3] * Z + w[5] * u0 + w[7] * ds
                        T = s
                        if lag[b] > 0.0:
                            k4 = slope_of(T, Z, rate[b], H, L, sink[sb, k], &power, hidden[b], links[b], linked[kb, k])
                            if dt != last_h:
                                fade = exp(-dt / lag[b])
                                last_h = dt
                            y = late_probe(y, T0, T, k1, k4, dt, lag[b], fade)
                        else:
                            y = T
                        out[b, k] = y
                        if delay[b] > 0.0:
                            slope[k] = (T - y) / lag[b] if lag[b] > 0.0 else slope_of(
                                T, Z, rate[b], H, L, sink[sb, k], &power, hidden[b], links[b], linked[kb, k])
                        continue
                    if exponent[b] != 0.0 or hidden[b] != 0.0:
                        fast = rate[b] * L * (1.0 + exponent[b]) + hidden[b] + hidden_rate[b] + links[b]
                        steps = fast * dt / 0.3
                        while m < steps and m < MOST_SUBSTEPS:
                            m = 2 * m
                    h = dt / m
                    ds = (sink[sb, k] - sink[sb, k - 1]) / m
                    dq = (linked[kb, k] - linked[kb, k - 1]) / m
                    s = sink[sb, k - 1]
                    q = linked[kb, k - 1]
                    for i in range(m):
                        sm = s + 0.5 * ds
                        qm = q + 0.5 * dq
                        s1 = s + ds
                        q1 = q + dq
                        T0 = T
                        k1 = slope_of(T, Z, rate[b], H, L, s, &power, hidden[b], links[b], q)
                        if exponent[b] != 0.0 or hidden[b] != 0.0:
                            z1 = hidden_rate[b] * (T - Z)
                            k2 = slope_of(T + 0.5 * h * k1, Z + 0.5 * h * z1, rate[b], H, L, sm, &power, hidden[b], links[b], qm)
                            z2 = hidden_rate[b] * (T + 0.5 * h * k1 - Z - 0.5 * h * z1)
                            k3 = slope_of(T + 0.5 * h * k2, Z + 0.5 * h * z2, rate[b], H, L, sm, &power, hidden[b], links[b], qm)
                            z3 = hidden_rate[b] * (T + 0.5 * h * k2 - Z - 0.5 * h * z2)
                            k4 = slope_of(T + h * k3, Z + h * z3, rate[b], H, L, s1, &power, hidden[b], links[b], q1)
                            z4 = hidden_rate[b] * (T + h * k3 - Z - h * z3)
                            T = T + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                            Z = Z + h / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4)
                        else:
                            if lam != last_lam or dt != last_dt:
                                a = lam * dt
                                E = exp(-a)
                                phi = -expm1(-a) / lam if a > 1e-3 else dt * (1.0 - 0.5 * a + a * a / 6.0)
                                psi = (dt - phi) / lam if a > 1e-3 else dt * dt * (0.5 - a / 6.0 + a * a / 24.0)
                                last_lam = lam
                                last_dt = dt
                            u0 = rate[b] * (H + L * s) + q
                            u1 = rate[b] * (H + L * s1) + q1
                            T = T * E + u0 * phi + (u1 - u0) / dt * psi
                        if lag[b] > 0.0:
                            k4 = slope_of(T, Z, rate[b], H, L, s1, &power, hidden[b], links[b], q1)
                            if h != last_h:
                                fade = exp(-h / lag[b])
                                last_h = h
                            y = late_probe(y, T0, T, k1, k4, h, lag[b], fade)
                        s = s1
                        q = q1
                    if lag[b] == 0.0:
                        y = T
                out[b, k] = y
                if delay[b] > 0.0:
                    # Slope at both ends of the interval, for the delayed reading between them.
                    if lag[b] > 0.0:
                        slope[k] = (T - y) / lag[b]
                    else:
                        slope[k] = slope_of(T, Z, rate[b], H, L, sink[sb, k], &power, hidden[b], links[b], linked[kb, k])
            if delay[b] > 0.0:
                for k in range(n):
                    curve[k] = out[b, k]
                slope[0] = 0.0 if lag[b] > 0.0 else slope_of(
                    start[b], start[b], rate[b], rise[b] * heat[hb, 1], loss[lb, 1], sink[sb, 0], &power, hidden[b], links[b],
                    linked[kb, 0])
                j = 0
                for k in range(n):
                    at = time[k] - delay[b]
                    if at <= time[0]:
                        out[b, k] = start[b]
                        continue
                    while j < n - 2 and time[j + 1] < at:
                        j += 1
                    dt = time[j + 1] - time[j]
                    x = (at - time[j]) / dt
                    out[b, k] = (curve[j] * (1.0 + 2.0 * x) * (1.0 - x) * (1.0 - x) + slope[j] * dt * x * (1.0 - x) * (1.0 - x)
                                 + curve[j + 1] * x * x * (3.0 - 2.0 * x) + slope[j + 1] * dt * x * x * (x - 1.0))
    free(curve)
    free(slope)


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
