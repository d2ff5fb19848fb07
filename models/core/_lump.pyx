# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled twin of :mod:`thermofast.models.core._lump_numpy`: same names, same arguments, same numbers.

Time and rate may be in any pair of reciprocal units; thermofast uses minutes.
"""
from cpython.pycapsule cimport PyCapsule_New
from libc.stdint cimport uint8_t
from libc.math cimport INFINITY, M_PI, NAN, asin, cos, exp, expm1, fabs, isnan, pow, sin, sqrt
from libc.stdlib cimport free, malloc
from libc.string cimport memset


cdef inline double growth(double rate, double dt) noexcept nogil:
    """(1 - exp(-rate dt)) / rate, continuous at rate = 0."""
    cdef double z = rate * dt
    if fabs(z) < 0.05:
        return dt * series(z)
    if z < -60.0:
        z = -60.0
    return (1.0 - exp(-z)) / rate


cdef inline double series(double z) noexcept nogil:
    """(1 - exp(-z)) / z where |z| < 0.05: the first term left out is 1e-18, and no exponential is taken."""
    return 1.0 - z * (1.0 / 2.0 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z * (1.0 / 120.0 - z * (
        1.0 / 720.0 - z * (1.0 / 5040.0 - z * (1.0 / 40320.0 - z * (1.0 / 362880.0))))))))


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
    # A filter spends most of its time here: one exponential at most, and none over a short interval.
    cdef double z = clip(x[2] * dt, -40.0, 1e3), part, decay
    if fabs(z) < 0.05:
        part = dt * series(z)
        decay = 1.0 - z * series(z)
    else:
        decay = exp(-z)
        part = dt * (1.0 - decay) / z
    out[0] = x[0] + x[1] * part
    out[1] = x[1] * decay
    out[2] = x[2]


cdef void slope_steps(const double* x, Py_ssize_t count, double dt, double* out) noexcept nogil:
    """Many states one interval on: temperatures, slopes and rates each together."""
    cdef Py_ssize_t i
    cdef double state[3]
    cdef double moved[3]
    cdef double z, part, widest = 0.0
    for i in range(2 * count, 3 * count):
        z = fabs(x[i] * dt)
        widest = z if z > widest else widest
    if widest < 0.05:
        for i in range(count):
            z = x[2 * count + i] * dt
            part = series(z)
            out[i] = x[i] + x[count + i] * (dt * part)
            out[count + i] = x[count + i] * (1.0 - z * part)
            out[2 * count + i] = x[2 * count + i]
        return
    for i in range(count):
        state[0] = x[i]
        state[1] = x[count + i]
        state[2] = x[2 * count + i]
        slope_step(state, dt, moved)
        out[i] = moved[0]
        out[count + i] = moved[1]
        out[2 * count + i] = moved[2]


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
SLOPE_STEPS = PyCapsule_New(<void*> slope_steps, b"thermofast.steps", NULL)
SLOPE_JACOBIAN = PyCapsule_New(<void*> slope_jacobian, b"thermofast.step", NULL)
PRINTED_STEP = PyCapsule_New(<void*> printed_step, b"thermofast.step", NULL)
PRINTED_JACOBIAN = PyCapsule_New(<void*> printed_jacobian, b"thermofast.step", NULL)


cdef inline double min2(double a, double b) noexcept nogil:
    return a if a < b else b


cdef inline double max2(double a, double b) noexcept nogil:
    return a if a > b else b


cdef enum:
    GRID = 12           # rates at which the search begins
    GRID_READINGS = 64  # block means that it looks at
    BLOCK = 16          # readings to one exponential on an even grid
    LANES = 4           # partial sums side by side
    ANCHOR = 32         # blocks after which their exponential is taken anew, so that rounding does not add up
    COSINES = 8         # see the numpy twin
    MOST_POINTS = 1000
    FEWEST_POINTS = 12
    CELLS = 8192        # steps between the least and the greatest reading in which a logger's step is looked for


cdef double KNOWN = 0.08    # standard deviation of a rate over the rate
cdef double NEXT = 1.1      # times as many readings as before
cdef double GROWN = 1.1     # times the mean square of the residuals before: the best rate may be another


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


cdef packed struct Fit:
    # What a fit tells, field by field as thermofast.models.core.fit.FIT has it.
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
    double n
    double span
    double least
    double greatest
    double rate_low
    double rate_high
    double steady_low
    double steady_high


cdef struct Problem:
    # Readings of one fit, those of weight zero left out, with the scratch space of its basis.
    Py_ssize_t n
    double* t
    double* y
    double* w
    double* phi
    double* psi
    double weight
    double level
    double squares      # weighted sum of squares of the centred readings
    double t0
    double low
    double high
    double step         # spacing where it is even
    bint even
    bint plain          # evenly spaced, all of one weight: sums over the basis have closed forms


cdef Problem allocate(Py_ssize_t size) except *:
    cdef Problem p
    p.t = <double*> malloc(5 * (size + 1) * sizeof(double))
    if p.t == NULL:
        raise MemoryError()
    p.y = p.t + size
    p.w = p.y + size
    p.phi = p.w + size
    p.psi = p.phi + size
    return p


cdef int fill(Problem* p, const double* t, const double* y, const double* w, Py_ssize_t size, bint signed_rate) noexcept nogil:
    """Load readings of positive weight; returns 1 where they are too few for a fit."""
    cdef Py_ssize_t i, m = 0
    cdef double span
    p.plain = False
    p.weight = 0.0
    p.level = 0.0
    p.t0 = t[0]
    for i in range(size):
        if w[i] > 0.0:
            p.t[m] = t[i] - t[0]
            p.y[m] = y[i]
            p.w[m] = w[i]
            p.weight += w[i]
            p.level += w[i] * y[i]
            m += 1
    p.n = m
    if m < 3 or not p.t[m - 1] > p.t[0]:
        return 1
    p.level /= p.weight
    p.squares = 0.0
    for i in range(m):
        p.y[i] -= p.level
        p.squares += p.w[i] * p.y[i] * p.y[i]
    span = p.t[m - 1] - p.t[0]
    p.low = -3.0 / span if signed_rate else 1e-3 / span
    p.high = 5.0 * (m - 1) / span
    p.step = p.t[1] - p.t[0]
    p.even = True
    for i in range(2, m):
        if fabs(p.t[i] - p.t[i - 1] - p.step) > 1e-9 * p.step:
            p.even = False
            break
    if p.even:
        p.plain = True
        for i in range(1, m):
            if p.w[i] != p.w[0]:
                p.plain = False
                break
    return 0


cdef inline void powers(double factor, double* power) noexcept nogil:
    """factor to the powers 0 to BLOCK - 1, by few products after one another."""
    cdef double square = factor * factor, fourth = square * square, eighth = fourth * fourth
    cdef Py_ssize_t j
    power[0] = 1.0
    power[1] = factor
    power[2] = square
    power[3] = square * factor
    for j in range(4):
        power[4 + j] = power[j] * fourth
    for j in range(8):
        power[8 + j] = power[j] * eighth


cdef void decays(Problem* p, double rate) noexcept nogil:
    """exp(-rate t) of every reading into p.phi: on an even grid products of few exponentials."""
    cdef double power[BLOCK]
    cdef double first = 1.0, factor, across
    cdef Py_ssize_t i, j, blocks = p.n // BLOCK
    if not p.even:
        for i in range(p.n):
            p.phi[i] = exp(-rate * p.t[i])
        return
    factor = exp(-rate * p.step)
    powers(factor, power)
    across = power[BLOCK - 1] * factor
    for i in range(blocks):
        first = exp(-rate * p.t[BLOCK * i]) if i % ANCHOR == 0 else first * across
        for j in range(BLOCK):
            p.phi[BLOCK * i + j] = first * power[j]
    if BLOCK * blocks < p.n:
        first = exp(-rate * p.t[BLOCK * blocks]) if blocks % ANCHOR == 0 else first * across
        for j in range(p.n - BLOCK * blocks):
            p.phi[BLOCK * blocks + j] = first * power[j]


cdef void evaluate(Problem* p, double rate, bint slopes, Sums* s) noexcept nogil:
    # Sums run in LANES parts side by side, which the processor adds at once.
    cdef Py_ssize_t i, j, early = 0, even = p.n - p.n % LANES
    cdef double phi_mean, psi_mean = 0.0, inverse = 1.0 / rate if rate != 0.0 else 0.0, slope, decay
    cdef double a[LANES]
    cdef double b[LANES]
    cdef double c[LANES]
    cdef double d[LANES]
    cdef double u, v, r
    decays(p, rate)
    while early < p.n and fabs(rate * p.t[early]) < 1e-3:   # where the differences below would lose digits
        p.phi[early] = growth(rate, p.t[early])
        p.psi[early] = growth_slope(rate, p.t[early])
        early += 1
    for i in range(early, p.n):
        decay = p.phi[i]
        p.phi[i] = (1.0 - decay) * inverse
        p.psi[i] = (p.t[i] * decay - p.phi[i]) * inverse
    clear(a)
    clear(b)
    for i in range(0, even, 4):
        for j in range(LANES):
            a[j] += p.w[i + j] * p.phi[i + j]
            b[j] += p.w[i + j] * p.psi[i + j]
    for i in range(even, p.n):
        a[0] += p.w[i] * p.phi[i]
        b[0] += p.w[i] * p.psi[i]
    phi_mean = total(a) / p.weight
    if slopes:
        psi_mean = total(b) / p.weight
    clear(a)
    clear(b)
    clear(c)
    clear(d)
    for i in range(0, even, 4):
        for j in range(LANES):
            u = p.phi[i + j] - phi_mean
            v = p.psi[i + j] - psi_mean
            a[j] += p.w[i + j] * u * u
            b[j] += p.w[i + j] * u * p.y[i + j]
            c[j] += p.w[i + j] * u * v
            d[j] += p.w[i + j] * v * v
    for i in range(even, p.n):
        u = p.phi[i] - phi_mean
        v = p.psi[i] - psi_mean
        a[0] += p.w[i] * u * u
        b[0] += p.w[i] * u * p.y[i]
        c[0] += p.w[i] * u * v
        d[0] += p.w[i] * v * v
    s.phi_phi = total(a)
    s.phi_psi = total(c) if slopes else 0.0
    s.psi_psi = total(d) if slopes else 0.0
    slope = total(b) / s.phi_phi if s.phi_phi > 0.0 else 0.0
    clear(a)
    clear(b)
    for i in range(0, even, 4):
        for j in range(LANES):
            r = p.y[i + j] - slope * (p.phi[i + j] - phi_mean)
            a[j] += p.w[i + j] * r * r
            b[j] += p.w[i + j] * r * (p.psi[i + j] - psi_mean)
    for i in range(even, p.n):
        r = p.y[i] - slope * (p.phi[i] - phi_mean)
        a[0] += p.w[i] * r * r
        b[0] += p.w[i] * r * (p.psi[i] - psi_mean)
    s.rate = rate
    s.slope = slope
    s.level = p.level
    s.phi_mean = phi_mean
    s.psi_mean = psi_mean
    s.weight = p.weight
    s.rss = total(a)
    s.gradient = total(b) if slopes else 0.0


cdef inline void clear(double* lanes) noexcept nogil:
    cdef Py_ssize_t j
    for j in range(LANES):
        lanes[j] = 0.0


cdef inline double total(const double* lanes) noexcept nogil:
    return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])


cdef inline double decayed(Problem* p, double rate, double factor, double begun) noexcept nogil:
    """Sum of y exp(-rate t) over evenly spaced readings; factor is exp(-rate step), begun that of the first reading."""
    cdef double power[BLOCK]
    cdef double part[LANES]
    cdef double found = 0.0, first = begun, across
    cdef Py_ssize_t i, j, k, blocks = p.n // BLOCK, left = p.n - BLOCK * (p.n // BLOCK)
    cdef double* y = p.y
    powers(factor, power)
    across = power[BLOCK - 1] * factor
    for i in range(blocks):
        clear(part)
        for k in range(0, BLOCK, 4):
            for j in range(LANES):
                part[j] += y[k + j] * power[k + j]
        if i:
            first = first * across if i % ANCHOR else exp(-rate * p.t[BLOCK * i])
        found += first * total(part)
        y += BLOCK
    if left:
        part[0] = 0.0
        for j in range(left):
            part[0] += y[j] * power[j]
        if blocks:
            first = first * across if blocks % ANCHOR else exp(-rate * p.t[BLOCK * blocks])
        found += first * part[0]
    return found


cdef void glance_plain(Problem* p, double rate, Sums* s) noexcept nogil:
    """As glance where the basis alone needs no sum over the readings: powers of one number add up to a geometric series."""
    cdef double each = p.w[0], inverse = 1.0 / rate, n = <double> p.n, py
    cdef double begun = exp(-rate * p.t[0]) if p.t[0] > 0.0 else 1.0, factor = exp(-rate * p.step), whole, once, twice
    if rate * p.step > 0.01:
        whole = exp(-rate * p.step * n)
        once = begun * (1.0 - whole) / (1.0 - factor)
        twice = begun * begun * (1.0 - whole * whole) / (1.0 - factor * factor)
    else:                                       # where those differences would lose digits
        once = begun * expm1(-rate * p.step * n) / expm1(-rate * p.step)
        twice = begun * begun * expm1(-2.0 * rate * p.step * n) / expm1(-2.0 * rate * p.step)
    py = -each * inverse * decayed(p, rate, factor, begun)     # the readings are centred
    s.rate = rate
    s.level = p.level
    s.weight = p.weight
    s.phi_mean = (n - once) * inverse / n
    s.phi_phi = each * inverse * inverse * (twice - once * once / n)
    s.slope = py / s.phi_phi if s.phi_phi > 0.0 else 0.0
    s.rss = p.squares - s.slope * py
    if s.rss < 0.0:
        s.rss = 0.0


cdef void glance(Problem* p, double rate, Sums* s) noexcept nogil:
    """As evaluate, without derivatives and in one pass: the readings are centred, so the basis need not be."""
    cdef Py_ssize_t i, j, even = p.n - p.n % LANES
    cdef double a[LANES]
    cdef double b[LANES]
    cdef double c[LANES]
    cdef double inverse, value, weighted, py
    if not fabs(rate) * p.t[p.n - 1] > 1e-2:
        evaluate(p, rate, False, s)
        return
    if p.plain:
        glance_plain(p, rate, s)
        return
    decays(p, rate)
    inverse = 1.0 / rate
    clear(a)
    clear(b)
    clear(c)
    for i in range(0, even, 4):
        for j in range(LANES):
            value = (1.0 - p.phi[i + j]) * inverse
            weighted = p.w[i + j] * value
            a[j] += weighted
            b[j] += weighted * value
            c[j] += weighted * p.y[i + j]
    for i in range(even, p.n):
        value = (1.0 - p.phi[i]) * inverse
        weighted = p.w[i] * value
        a[0] += weighted
        b[0] += weighted * value
        c[0] += weighted * p.y[i]
    py = total(c)
    s.rate = rate
    s.level = p.level
    s.weight = p.weight
    s.phi_mean = total(a) / p.weight
    s.phi_phi = total(b) - total(a) * s.phi_mean
    s.slope = py / s.phi_phi if s.phi_phi > 0.0 else 0.0
    s.rss = p.squares - s.slope * py
    if s.rss < 0.0:
        s.rss = 0.0


cdef double residual_squares(Problem* p, double rate) noexcept nogil:
    cdef Sums s
    glance(p, rate, &s)
    return s.rss


cdef void search(Problem* p, Problem* thin, bint signed_rate, Sums* best) noexcept nogil:
    """Start of the refinement: the best rate of a grid, on block means of a long record where that is quicker."""
    cdef Py_ssize_t i, j, a, b, blocks
    cdef double span = p.t[p.n - 1] - p.t[0], ratio, rate, rss, least = INFINITY, chosen = 0.0, first, bend
    cdef double tried[GRID + 2]
    cdef Py_ssize_t at = 0
    cdef Problem* q = p
    if p.n > GRID_READINGS and not p.plain:
        q = thin
        q.plain = False
        q.n = GRID_READINGS
        q.weight = p.weight
        q.level = p.level
        q.even = False
        q.squares = 0.0
        for j in range(GRID_READINGS):
            a = j * p.n // GRID_READINGS
            b = (j + 1) * p.n // GRID_READINGS
            q.t[j] = 0.0
            q.y[j] = 0.0
            q.w[j] = 0.0
            for i in range(a, b):
                q.t[j] += p.w[i] * p.t[i]
                q.y[j] += p.w[i] * p.y[i]
                q.w[j] += p.w[i]
            q.t[j] /= q.w[j]
            q.y[j] /= q.w[j]
            q.squares += q.w[j] * q.y[j] * q.y[j]
    first = 0.05 / span
    ratio = pow(0.5 * p.high / first, 1.0 / (GRID - 1))
    rate = first
    for i in range(GRID + (2 if signed_rate else 0)):
        if i == GRID:
            rate = -1.0 / span
        elif i == GRID + 1:
            rate = 1e-6 / span
        rss = residual_squares(q, rate)
        tried[i] = rss
        if rss < least:
            least = rss
            chosen = rate
            at = i
        rate *= ratio
    # Between the rates of the grid the sum of squares is nearly a parabola in the logarithm: its least is a better start.
    if q == p and 0 < at < GRID - 1:
        bend = tried[at - 1] - 2.0 * least + tried[at + 1]
        if bend > 0.0:
            rate = chosen * pow(ratio, 0.5 * (tried[at - 1] - tried[at + 1]) / bend)
            evaluate(p, clip(rate, p.low, p.high), True, best)
            if best.rss < least:
                return
    evaluate(p, clip(chosen, p.low, p.high), True, best)


cdef void refine(Problem* p, Sums* best) noexcept nogil:
    """Gauss-Newton in the rate, amplitudes eliminated; halves a step that does not descend.

    From the second step on with the curvature that the last one showed, which the residuals bend too: it ends in fewer.
    """
    cdef int iteration, halving
    cdef double step, curvature, rate, scale, slope, slope_before = 0.0, rate_before = 0.0, shown
    cdef Sums trial
    for iteration in range(60):
        curvature = best.psi_psi - best.phi_psi * best.phi_psi / best.phi_phi if best.phi_phi > 0.0 else 0.0
        curvature *= best.slope * best.slope
        if not curvature > 0.0:
            return
        slope = best.slope * best.gradient
        if iteration > 0 and best.rate != rate_before:
            shown = (slope_before - slope) / (best.rate - rate_before)
            if 0.5 * curvature < shown < 2.0 * curvature:
                curvature = shown
        rate_before = best.rate
        slope_before = slope
        step = slope / curvature
        scale = fabs(best.rate) + 1e-9 * (p.high - p.low)
        if fabs(step) <= 1e-11 * scale:
            return
        for halving in range(40):
            rate = clip(best.rate + step, p.low, p.high)
            if rate == best.rate:
                return
            evaluate(p, rate, True, &trial)
            if trial.rss < best.rss:
                break
            if fabs(step) <= 1e-9 * scale:
                return
            step *= 0.5
        else:
            return
        best[0] = trial


cdef void tell(Problem* p, Sums* s, Fit* out) noexcept nogil:
    out.rate = s.rate
    out.slope = s.slope
    out.level = s.level
    out.phi_mean = s.phi_mean
    out.psi_mean = s.psi_mean
    out.weight = s.weight
    out.phi_phi = s.phi_phi
    out.phi_psi = s.phi_psi
    out.psi_psi = s.psi_psi
    out.rss = s.rss
    out.n = <double> p.n
    out.span = p.t[p.n - 1] - p.t[0]
    out.least = p.low
    out.greatest = p.high


cdef void tell_nothing(Fit* out) noexcept nogil:
    cdef double* field = &out.rate
    cdef Py_ssize_t j
    for j in range(<Py_ssize_t> (sizeof(Fit) // sizeof(double))):
        field[j] = NAN


cdef int agree(Py_ssize_t n, Py_ssize_t other, str what) except -1:
    """Sizes come from outside: loops below run without bounds checks."""
    if n != other:
        raise ValueError(f"{what}: {other} values, needed {n}")
    return 0


def fit_decay(const double[::1] t, const double[::1] y, const double[::1] w, bint signed_rate, Fit[::1] out):
    """See :func:`thermofast.models.core._lump_numpy.fit_decay`."""
    cdef Problem p, thin
    cdef Sums best
    agree(t.shape[0], y.shape[0], "readings")
    agree(t.shape[0], w.shape[0], "weights")
    agree(1, out.shape[0], "fits")
    p = allocate(t.shape[0])
    thin = allocate(GRID_READINGS)
    try:
        if not t.shape[0] or fill(&p, &t[0], &y[0], &w[0], t.shape[0], signed_rate):
            raise ValueError(f"a fit needs three readings at different times, got {p.n if t.shape[0] else 0}")
        search(&p, &thin, signed_rate, &best)
        refine(&p, &best)
        tell_nothing(&out[0])
        tell(&p, &best, &out[0])
    finally:
        free(p.t)
        free(thin.t)


cdef double contour(Problem* p, double inside, double outside, double minimum, double limit, double stride) noexcept nogil:
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
        rise = residual_squares(p, b)
        if rise > limit:
            break
        if b == outside:
            return NAN
        a = b
        fa = (sqrt(rise - minimum) if rise > minimum else 0.0) - target
        stride *= 2.0
    fb = sqrt(rise - minimum) - target
    c = b
    for i in range(60):
        c = 0.5 * (a + b) if i % 3 == 2 else (a * fb - b * fa) / (fb - fa)
        fc = residual_squares(p, c) - minimum
        fc = (sqrt(fc) if fc > 0.0 else 0.0) - target
        if fabs(fc) < 1e-4 * target or fabs(b - a) < 1e-9 * fabs(inside):
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


cdef double edge(Problem* p, double theta, double centre, double low, double high, double limit, int sign) noexcept nogil:
    """Steady state on the contour of the likelihood at angle theta: its conditional estimate plus or minus its reach."""
    cdef Sums s
    cdef double u = sin(theta), rate, reach, arm
    rate = centre + u * (high - centre if u > 0.0 else centre - low)
    glance(p, rate, &s)
    arm = 1.0 / rate - s.phi_mean
    reach = (1.0 / s.weight + arm * arm / s.phi_phi) * (limit - s.rss)
    return s.level + s.slope * arm + sign * (sqrt(reach) if reach > 0.0 else 0.0)


cdef double extreme(Problem* p, double theta, double centre, double low, double high, double limit, int sign) noexcept nogil:
    """Largest (sign 1) or smallest (sign -1) steady state on the contour, by parabolic steps over the angle."""
    cdef double h = 0.3, best_theta, best, left, right, mid, bend, shift
    cdef int i
    best_theta = clip(theta, -0.5 * M_PI + h, 0.5 * M_PI - h)
    mid = sign * edge(p, best_theta, centre, low, high, limit, sign)
    for i in range(12):
        left = sign * edge(p, best_theta - h, centre, low, high, limit, sign)
        right = sign * edge(p, best_theta + h, centre, low, high, limit, sign)
        bend = left - 2.0 * mid + right
        if left > mid or right > mid:
            shift = h if right > left else -h
        elif bend < 0.0:
            shift = 0.5 * h * (left - right) / bend
        else:
            return sign * mid
        theta = clip(best_theta + shift, -0.5 * M_PI + 1e-6, 0.5 * M_PI - 1e-6)
        best = sign * edge(p, theta, centre, low, high, limit, sign)
        if best > mid:
            best_theta = theta
            mid = best
        # At a maximum an angle off by d costs d^2 / 2 of the half-width.
        if fabs(shift) < 0.1:
            return sign * mid
        h = clip(fabs(shift) * 0.5, 0.02, 0.3)
        best_theta = clip(best_theta, -0.5 * M_PI + h, 0.5 * M_PI - h)
    return sign * mid


cdef void rate_covariance(Sums* s, double* out) noexcept nogil:
    """Variance of slope, covariance, variance of rate, per unit of the noise variance."""
    cdef double a = s.phi_phi, b = s.slope * s.phi_psi, c = s.slope * s.slope * s.psi_psi, determinant
    determinant = a * c - b * b
    if determinant > 0.0:
        out[0] = c / determinant
        out[1] = -b / determinant
        out[2] = a / determinant
    else:
        out[0] = 1.0 / a if a > 0.0 else INFINITY
        out[1] = 0.0
        out[2] = INFINITY


cdef double steady_variance(Sums* s) noexcept nogil:
    """Variance of the steady state to first order, per unit of the noise variance."""
    cdef double v[3]
    cdef double by_slope = 1.0 / s.rate - s.phi_mean, by_rate = s.slope * (-1.0 / (s.rate * s.rate) - s.psi_mean)
    rate_covariance(s, v)
    return 1.0 / s.weight + by_slope * by_slope * v[0] + 2.0 * by_slope * by_rate * v[1] + by_rate * by_rate * v[2]


cdef void profile(Problem* p, Sums* s, double limit, double* out) noexcept nogil:
    """Rate low, rate high, steady state low, high at which RSS reaches `limit`."""
    cdef double v[3]
    cdef double by_slope, by_rate, variance, correlation = 0.0, stride, a, b, theta
    rate_covariance(s, v)
    by_slope = 1.0 / s.rate - s.phi_mean
    by_rate = s.slope * (-1.0 / (s.rate * s.rate) - s.psi_mean)
    variance = steady_variance(s)
    if v[2] < INFINITY and variance > 0.0:
        correlation = (by_slope * v[1] + by_rate * v[2]) / sqrt(variance * v[2])
    stride = 1.1 * sqrt(v[2] * (limit - s.rss))     # just outside, if the likelihood were Gaussian
    if not stride < p.high:
        stride = p.high
    if stride < 0.01 * s.rate:
        stride = 0.01 * s.rate
    out[0] = contour(p, s.rate, p.low, s.rss, limit, stride)
    out[1] = contour(p, s.rate, p.high, s.rss, limit, stride)
    a = p.low if isnan(out[0]) else out[0]
    b = p.high if isnan(out[1]) else out[1]
    theta = asin(clip(correlation, -0.99, 0.99))
    out[3] = extreme(p, theta, s.rate, a, b, limit, 1)
    out[2] = extreme(p, -theta, s.rate, a, b, limit, -1)


def profile_decay(const double[::1] t, const double[:, ::1] y, const double[:, ::1] w, const double[::1] rate,
                  const double[::1] limit, double[:, ::1] out):
    """See :func:`thermofast.models.core._lump_numpy.profile_decay`."""
    cdef Problem p
    cdef Sums s
    cdef Py_ssize_t i, n = t.shape[0], rows = y.shape[0]
    agree(n, y.shape[1], "readings")
    agree(n, w.shape[1], "weights")
    agree(rows, w.shape[0], "rows of weights")
    agree(rows, rate.shape[0], "rates")
    agree(rows, limit.shape[0], "limits")
    agree(rows, out.shape[0], "rows of bounds")
    agree(4, out.shape[1], "bounds")
    p = allocate(n)
    try:
        for i in range(rows):
            if not n or fill(&p, &t[0], &y[i, 0], &w[i, 0], n, False):
                raise ValueError("a profile needs three readings at different times")
            evaluate(&p, rate[i], True, &s)
            profile(&p, &s, limit[i], &out[i, 0])
    finally:
        free(p.t)


cdef Py_ssize_t drop_outliers(Problem* p, Sums* s, double* w, Py_ssize_t size, double outlier, double resolution,
                              double* scratch) noexcept nogil:
    """Take the weight of readings far outside the fit; returns how many, 0 where so many stand out that the fit is wrong.

    Far is `outlier` deviations by the median absolute residual, which outliers do not widen.
    """
    cdef Py_ssize_t i, j, count = 0, beyond = 0
    cdef double dof = p.n - 3, limit, inverse = 1.0 / s.rate if s.rate != 0.0 else 0.0, value, factor, largest = 0.0, half
    if dof < 3 or not outlier < INFINITY:
        return 0
    decays(p, s.rate)
    for j in range(p.n):
        value = (1.0 - p.phi[j]) * inverse if fabs(s.rate * p.t[j]) >= 1e-3 else growth(s.rate, p.t[j])
        p.phi[j] = fabs(p.y[j] - s.slope * (value - s.phi_mean)) * sqrt(p.w[j])
        scratch[j] = p.phi[j]
        largest = max2(largest, p.phi[j])
    factor = outlier * (1.0 + 3.0 / dof) * 1.4826 * sqrt(p.n / dof)
    # Where more than half of all lie beyond what the median would have to be, the largest is no outlier: no need to know it.
    half = (largest - resolution) / factor
    for j in range(p.n):
        beyond += p.phi[j] > half
    if 2 * beyond > p.n + 1:
        return 0
    limit = factor * median_of(scratch, p.n) + resolution
    for j in range(p.n):
        if p.phi[j] > limit:
            count += 1
    if count == 0 or count > size // 10:
        return 0
    j = 0
    for i in range(size):
        if w[i] > 0.0:
            if p.phi[j] > limit:
                w[i] = 0.0
            j += 1
    return count


cdef double quantile_of(double* values, Py_ssize_t n, Py_ssize_t k) noexcept nogil:
    """k-th smallest of values, which are reordered (Hoare's selection)."""
    cdef Py_ssize_t low = 0, high = n - 1, i, j
    cdef double pivot, swap
    while low < high:
        pivot = values[(low + high) // 2]
        i = low
        j = high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                swap = values[i]
                values[i] = values[j]
                values[j] = swap
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    return values[k]


cdef double median_of(double* values, Py_ssize_t n) noexcept nogil:
    cdef double upper = quantile_of(values, n, n // 2)
    cdef Py_ssize_t i
    cdef double lower
    if n % 2:
        return upper
    lower = values[0]
    for i in range(n // 2):
        if values[i] > lower:
            lower = values[i]
    return 0.5 * (lower + upper)


cdef void mark_spikes(const double* y, Py_ssize_t n, double resolution, double* w, double* scratch) noexcept nogil:
    cdef Py_ssize_t i, left
    cdef double middle, noise, limit, a, b, c, m
    for i in range(n):
        w[i] = 1.0
    if n < 5:
        return
    for i in range(n - 1):
        scratch[i] = y[i + 1] - y[i]
    middle = median_of(scratch, n - 1)
    for i in range(n - 1):
        scratch[i] = fabs(y[i + 1] - y[i] - middle)
    noise = 1.4826 * median_of(scratch, n - 1) / sqrt(2.0)
    limit = noise if noise > 0.5 * resolution else 0.5 * resolution
    limit = 8.0 * (limit if limit > 1e-12 else 1e-12)
    left = n
    for i in range(1, n - 1):
        a = y[i - 1]
        b = y[i]
        c = y[i + 1]
        m = max2(min2(a, b), min2(max2(a, b), c))  # the middle one of the three
        if fabs(b - m) > limit:
            w[i] = 0.0
            left -= 1
    if not 2 * left > n:
        for i in range(n):
            w[i] = 1.0


def spike_weights(const double[:, ::1] y, const double[::1] resolution, double[:, ::1] out):
    """See :func:`thermofast.models.core._lump_numpy.spike_weights`."""
    cdef Py_ssize_t n = y.shape[1], i
    cdef double* scratch
    agree(y.shape[0], resolution.shape[0], "steps of the logger")
    agree(y.shape[0], out.shape[0], "rows of weights")
    agree(n, out.shape[1], "weights")
    scratch = <double*> malloc((n + 1) * sizeof(double))
    if scratch == NULL:
        raise MemoryError()
    if n:
        with nogil:
            for i in range(y.shape[0]):
                mark_spikes(&y[i, 0], n, resolution[i], &out[i, 0], scratch)
    free(scratch)


cdef struct StartRule:
    double settled
    Py_ssize_t fewest
    double growing
    double outlier


cdef Py_ssize_t start_weights(Problem* p, Problem* thin, double* scratch, const double* t, const double* y, Py_ssize_t size,
                              double resolution, StartRule* rule, double* w, Sums* s, double* noise_out, bint* settled_out) noexcept nogil:
    """Readings used for a start, -1 where nothing can be fitted; see start_decay."""
    cdef Py_ssize_t used = rule.fewest if rule.fewest < size else size, i, worst, round_
    cdef double v[3]
    cdef double r, largest, rest, noise, spread, dof, gap
    cdef Sums without
    while True:
        mark_spikes(y, used, resolution, w, scratch)
        if fill(p, t, y, w, used, True):
            return -1
        search(p, thin, True, s)
        refine(p, s)
        for round_ in range(used // 5):
            worst = 0
            largest = -1.0
            for i in range(used):
                if w[i] > 0.0:
                    r = fabs(y[i] - s.level - s.slope * (growth(s.rate, t[i] - t[0]) - s.phi_mean))
                    if r > largest:
                        largest = r
                        worst = i
            dof = p.n - 3
            rest = (s.rss - largest * largest if s.rss > largest * largest else 0.0) / (dof - 1 if dof > 2 else 1)
            if dof < 3 or not largest > max2(rule.outlier * sqrt(rest), resolution):
                break
            # Against the spread of the others: with the worst one in, ten readings hide any outlier.
            w[worst] = 0.0
            if fill(p, t, y, w, used, True):
                w[worst] = 1.0
                fill(p, t, y, w, used, True)
                break
            search(p, thin, True, &without)
            refine(p, &without)
            gap = fabs(y[worst] - without.level - without.slope * (growth(without.rate, t[worst] - t[0]) - without.phi_mean))
            if not gap > rule.outlier * (1.0 + 3.0 / (p.n - 3)) * sqrt(without.rss / (p.n - 3)) + resolution:
                w[worst] = 1.0
                fill(p, t, y, w, used, True)
                break
            s[0] = without
        evaluate(p, s.rate, True, s)
        dof = p.n - 3
        rate_covariance(s, v)
        noise = max2(s.rss / dof if dof > 0 else 0.0, max2(resolution * resolution / 12.0, 1e-18))
        spread = sqrt(noise * v[2]) * (p.t[p.n - 1] - p.t[0]) * (1.0 + 1.0 / (dof if dof > 1 else 1))
        settled_out[0] = dof > 2 and spread < rule.settled
        if settled_out[0] or used == size:
            noise_out[0] = noise
            return used
        i = <Py_ssize_t> (used * rule.growing)
        if i < used + 1:
            i = used + 1
        used = i if i < size else size


cdef class _Scratch:
    """Working space of one thread for records of up to `size` readings; freed with the object."""
    cdef Problem p
    cdef Problem thin
    cdef double* values
    cdef double* weights

    def __cinit__(self, Py_ssize_t size):
        self.p = allocate(size)
        self.thin = allocate(GRID_READINGS)
        self.values = <double*> malloc((size + 1) * sizeof(double))
        self.weights = <double*> malloc((size + 1) * sizeof(double))
        if self.values == NULL or self.weights == NULL:
            raise MemoryError()

    def __dealloc__(self):
        free(self.p.t)
        free(self.thin.t)
        free(self.values)
        free(self.weights)


def start_decay(const double[::1] t, const double[:, ::1] y, const double[::1] resolution, tuple rule, double[:, ::1] w,
                Py_ssize_t[::1] used, double[::1] noise, uint8_t[::1] settled, Fit[::1] out):
    """See :func:`thermofast.models.core._lump_numpy.start_decay`."""
    cdef Py_ssize_t size = t.shape[0], rows = y.shape[0], i
    cdef _Scratch space
    cdef StartRule r
    cdef Sums s
    cdef bint done = False
    agree(size, y.shape[1], "readings")
    agree(size, w.shape[1], "weights")
    for count in (resolution.shape[0], w.shape[0], used.shape[0], noise.shape[0], settled.shape[0], out.shape[0]):
        agree(rows, count, "rows")
    if not size:
        raise ValueError("a start needs readings")
    space = _Scratch(size)
    r.settled, r.fewest, r.growing, r.outlier = rule
    with nogil:
        for i in range(rows):
            tell_nothing(&out[i])
            used[i] = start_weights(&space.p, &space.thin, space.values, &t[0], &y[i, 0], size, resolution[i], &r, &w[i, 0],
                                    &s, &noise[i], &done)
            if used[i] > 0:
                settled[i] = done
                tell(&space.p, &s, &out[i])


cdef inline bint well_known(const Fit* fit) noexcept nogil:
    """Whether a rate is known so well that a few readings more cannot have another one far from it fit better."""
    cdef double bent = fit.psi_psi - fit.phi_psi * fit.phi_psi / fit.phi_phi if fit.phi_phi > 0.0 else 0.0
    cdef double variance = fit.rss / (fit.n - 3) / (fit.slope * fit.slope * bent) if fit.n > 3 and bent > 0.0 else INFINITY
    return variance < KNOWN * KNOWN * fit.rate * fit.rate


cdef void likely(_Scratch space, const double* t, const double* y, double* weights, Py_ssize_t n, double quantile,
                 Py_ssize_t first, double resolution, StartRule* rule, double wide, const Fit* before, Fit* out) noexcept nogil:
    """Fit of n readings with its intervals; the weights become those that it ended with.

    before: the fit of a few readings less where it knew its rate well, else NULL. The search begins there, and looks everywhere where
    the new readings do not fit as well.
    """
    cdef Sums s
    cdef double limit, noise, reach, steady, begun = before.rate if before != NULL else 0.0
    cdef double bounds[4]
    cdef bint done
    cdef Py_ssize_t round_
    cdef Problem* p = &space.p
    tell_nothing(out)
    rule.fewest = n             # shorter starts than this were tried when the filter began, and none was settled
    if n <= first:
        if start_weights(p, &space.thin, space.values, t, y, n, resolution, rule, weights, &s, &noise, &done) < 0:
            return
        begun = s.rate      # the start has searched the same readings already
        before = NULL
    if fill(p, t, y, weights, n, False):
        return
    if begun > p.low:
        evaluate(p, clip(begun, p.low, p.high), True, &s)
    else:
        search(p, &space.thin, False, &s)
    refine(p, &s)
    if before != NULL and s.rss * before.n > GROWN * before.rss * p.n:
        search(p, &space.thin, False, &s)
        refine(p, &s)
    for round_ in range(2):
        if drop_outliers(p, &s, weights, n, rule.outlier, resolution, space.values) == 0:
            break
        if fill(p, t, y, weights, n, False):
            break
        search(p, &space.thin, False, &s)
        refine(p, &s)
    tell(p, &s, out)
    if p.n <= 3:
        return
    noise = s.rss / (p.n - 3)
    limit = s.rss + noise * quantile * quantile
    reach = quantile * sqrt(noise * steady_variance(&s))
    if reach > wide:            # far too wide whatever its shape: the first order will do
        steady = s.level + s.slope * (1.0 / s.rate - s.phi_mean)
        out.rate_low = s.rate
        out.rate_high = s.rate
        out.steady_low = steady - reach
        out.steady_high = steady + reach
    elif limit > s.rss:
        profile(p, &s, limit, bounds)
        out.rate_low = bounds[0]
        out.rate_high = bounds[1]
        out.steady_low = bounds[2]
        out.steady_high = bounds[3]


def likelihoods(const double[::1] t, const double[:, ::1] y, double[:, ::1] w, const Py_ssize_t[::1] counts,
                const double[:, ::1] quantiles, const Py_ssize_t[::1] first, const double[::1] resolution, tuple rule,
                double wide, Fit[:, ::1] out):
    """See :func:`thermofast.models.core._lump_numpy.likelihoods`."""
    cdef Py_ssize_t rows = y.shape[0], several = counts.shape[0], i, j, k, n
    cdef const Fit* before
    cdef _Scratch space
    cdef StartRule r
    agree(t.shape[0], y.shape[1], "readings")
    agree(t.shape[0], w.shape[1], "weights")
    for count in (w.shape[0], quantiles.shape[0], first.shape[0], resolution.shape[0], out.shape[0]):
        agree(rows, count, "rows")
    agree(several, quantiles.shape[1], "quantiles")
    agree(several, out.shape[1], "fits")
    for i in range(several):
        if not 0 < counts[i] <= t.shape[0]:
            raise ValueError(f"a stretch of {counts[i]} of {t.shape[0]} readings")
    space = _Scratch(t.shape[0])
    r.settled, r.fewest, r.growing, r.outlier = rule
    with nogil:
        for k in range(rows):
            for i in range(several):
                n = counts[i]
                for j in range(n):
                    space.weights[j] = w[k, j]
                before = NULL
                if i and counts[i - 1] <= n <= NEXT * counts[i - 1] and well_known(&out[k, i - 1]):
                    before = &out[k, i - 1]
                likely(space, &t[0], &y[k, 0], space.weights, n, quantiles[k, i], first[k], resolution[k], &r, wide, before, &out[k, i])
            if several == 1:    # the caller of one wants to know which readings were left out
                for j in range(counts[0]):
                    w[k, j] = space.weights[j]


def curve_squares(const double[::1] t, const double[:, ::1] y, const double[:, ::1] kept, const Fit[:, ::1] fits,
                  const Py_ssize_t[::1] ends, double[:, :, ::1] out):
    """See :func:`thermofast.models.core._lump_numpy.curve_squares`."""
    cdef Py_ssize_t rows = y.shape[0], n = t.shape[0], several = fits.shape[1], windows = ends.shape[0], i, j, k, l
    cdef _Scratch space
    cdef Problem* p
    cdef const Fit* f
    cdef double value, inverse, error, squares
    agree(n, y.shape[1], "readings")
    agree(n, kept.shape[1], "marks")
    for count in (kept.shape[0], fits.shape[0], out.shape[0]):
        agree(rows, count, "rows")
    agree(several, out.shape[1], "fits")
    agree(windows, out.shape[2], "windows")
    for i in range(windows):
        if not 0 <= ends[i] <= n or (i and ends[i] < ends[i - 1]):
            raise ValueError(f"a window of {ends[i]} of {n} readings")
    if not rows or not n:
        return
    space = _Scratch(n)
    p = &space.p
    with nogil:
        for j in range(n):
            space.weights[j] = 1.0
        if n < 3 or fill(p, &t[0], &y[0, 0], space.weights, n, False):   # of the grid alone: what is even about it
            p.n = n
            p.even = False
            for j in range(n):
                p.t[j] = t[j] - t[0]
        for k in range(rows):
            for i in range(several):
                f = &fits[k, i]
                inverse = 1.0 / f.rate if f.rate != 0.0 else 0.0
                decays(p, f.rate)
                squares = 0.0
                l = 0
                for j in range(n + 1):
                    while l < windows and ends[l] == j:
                        out[k, i, l] = squares
                        l += 1
                    if j == n or l == windows:
                        break
                    value = (1.0 - p.phi[j]) * inverse if fabs(f.rate * p.t[j]) >= 1e-3 else growth(f.rate, p.t[j])
                    error = f.level + f.slope * (value - f.phi_mean) - y[k, j]
                    squares += kept[k, j] * error * error


cdef class _Columns:
    """Scratch of :func:`pattern_of`: a residual and its columns, one after another, the cosines over the record last."""
    cdef Py_ssize_t size, columns, cosines_of
    cdef double* at
    cdef double* gram

    def __cinit__(self, Py_ssize_t readings, Py_ssize_t own):
        self.size, self.columns, self.cosines_of = readings + 1, own, 0
        self.at = <double*> malloc((1 + own + COSINES) * self.size * sizeof(double))
        self.gram = <double*> malloc((own + COSINES) * (own + COSINES + 1) * sizeof(double))
        if self.at == NULL or self.gram == NULL:
            raise MemoryError()

    def __dealloc__(self):
        free(self.at)
        free(self.gram)


cdef inline double product(const double* a, const double* b, Py_ssize_t n) noexcept nogil:
    """Sum of products, in LANES parts side by side."""
    cdef double part[LANES]
    cdef Py_ssize_t i, j, even = n - n % LANES
    clear(part)
    for i in range(0, even, 4):
        for j in range(LANES):
            part[j] += a[i + j] * b[i + j]
    for i in range(even, n):
        part[0] += a[i] * b[i]
    return total(part)


cdef void block_means(double* values, Py_ssize_t n, Py_ssize_t blocks) noexcept nogil:
    """Means of stretches of values (n,), in place."""
    cdef Py_ssize_t i, j, first = 0, last
    cdef double mean
    for i in range(blocks):
        last = <Py_ssize_t> ((i + 1) * (<double> n / blocks)) if i + 1 < blocks else n
        mean = 0.0
        for j in range(first, last):
            mean += values[j]
        values[i] = mean / (last - first)
        first = last


cdef void pattern_of(_Columns space, Py_ssize_t n, double* out) noexcept nogil:
    """What cosines explain of a residual (n,) beyond its own columns, its sum of squares, and that of products of neighbours."""
    cdef Py_ssize_t own = space.columns, size = space.size, count, whole, i, j, k
    cdef double* r = space.at
    cdef double* columns = space.at + size
    cdef double* g = space.gram
    cdef double* along
    cdef double* a
    cdef double value, length
    for i in range(3):
        out[i] = NAN
    if n < FEWEST_POINTS:
        return
    if n > MOST_POINTS:
        for i in range(1 + own):
            block_means(space.at + i * size, n, MOST_POINTS)
        n = MOST_POINTS
    count = COSINES if COSINES < n // 6 else n // 6
    if space.cosines_of != n:
        a = columns + own * size
        for k in range(n):
            a[k] = cos(M_PI * (k + 0.5) / n)
        # cos(j x) by the two before it.
        for j in range(1, count):
            for k in range(n):
                a[j * size + k] = 2.0 * a[k] * a[(j - 1) * size + k] - (a[(j - 2) * size + k] if j > 1 else 1.0)
        length = sqrt(2.0 / n)
        for j in range(count):
            for k in range(n):
                a[j * size + k] *= length
        space.cosines_of = n
    for i in range(own):
        a = columns + i * size
        length = sqrt(product(a, a, n))
        length = 1.0 / length if length > 1e-300 else 0.0
        for k in range(n):
            a[k] *= length
    whole = own + count
    along = g + whole * whole
    for i in range(whole):
        a = columns + i * size
        along[i] = product(a, r, n)
        for j in range(i + 1):
            # Cosines are of length 1 and at right angles to each other.
            g[i * whole + j] = product(a, columns + j * size, n) if j < own else (1.0 if i == j else 0.0)
        g[i * whole + i] += 1e-11
    # Cholesky's root and the residual's shares along it: what comes after the own columns is what the cosines add.
    out[0] = 0.0
    for i in range(whole):
        for j in range(i + 1):
            value = g[i * whole + j] - product(g + i * whole, g + j * whole, j)
            g[i * whole + j] = value / g[j * whole + j] if j < i else sqrt(value)
        along[i] = (along[i] - product(g + i * whole, along, i)) / g[i * whole + i]
        if i >= own:
            out[0] += along[i] * along[i]
    out[1] = product(r, r, n)
    out[2] = product(r + 1, r, n - 1)


def pattern_sums(const double[:, ::1] residual, const double[:, :, ::1] columns, double[:, ::1] out):
    """See :func:`thermofast.models.core._lump_numpy.pattern_sums`."""
    cdef Py_ssize_t rows = residual.shape[0], n = residual.shape[1], own = columns.shape[1], i, j, k
    cdef _Columns space
    agree(rows, columns.shape[0], "rows of columns")
    agree(n, columns.shape[2], "readings of a column")
    agree(rows, out.shape[0], "rows of sums")
    agree(3, out.shape[1], "sums")
    space = _Columns(n, own)
    with nogil:
        for i in range(rows):
            for k in range(n):
                space.at[k] = residual[i, k]
            for j in range(own):
                for k in range(n):
                    space.at[(1 + j) * space.size + k] = columns[i, j, k]
            pattern_of(space, n, &out[i, 0])


def law_patterns(const double[::1] t, const double[:, ::1] y, const double[:, ::1] w, const double[::1] rate,
                 double[:, ::1] residual, double[:, ::1] out):
    """See :func:`thermofast.models.core._lump_numpy.law_patterns`."""
    cdef Py_ssize_t rows = y.shape[0], n = t.shape[0], i, j, k
    cdef _Columns space
    cdef _Scratch scratch
    cdef Problem* p
    cdef Sums s
    cdef double root, value, squares
    cdef double* left
    cdef double* ones
    cdef double* phi
    cdef double* psi
    agree(n, y.shape[1], "readings")
    agree(n, w.shape[1], "weights")
    agree(n, residual.shape[1], "residuals")
    for count in (w.shape[0], rate.shape[0], residual.shape[0], out.shape[0]):
        agree(rows, count, "rows")
    agree(5, out.shape[1], "sums")
    scratch = _Scratch(n)
    p = &scratch.p
    space = _Columns(n, 3)
    left, ones, phi, psi = space.at, space.at + space.size, space.at + 2 * space.size, space.at + 3 * space.size
    with nogil:
        for i in range(rows):
            for j in range(5):
                out[i, j] = NAN
            for j in range(n):
                residual[i, j] = 0.0
            if not n or isnan(rate[i]) or fill(p, &t[0], &y[i, 0], &w[i, 0], n, True):    # nothing was fitted
                continue
            evaluate(p, rate[i], True, &s)
            squares = 0.0
            root = sqrt(p.w[0])
            for j in range(p.n):
                if j and p.w[j] != p.w[j - 1]:
                    root = sqrt(p.w[j])
                value = p.y[j] - s.slope * (p.phi[j] - s.phi_mean)
                squares += value * value
                left[j] = root * value
                ones[j] = root
                phi[j] = root * (p.phi[j] - s.phi_mean)
                psi[j] = root * (p.psi[j] - s.psi_mean)
            k = 0
            for j in range(n):
                if w[i, j] > 0.0:
                    residual[i, j] = left[k]
                    k += 1
            out[i, 3] = squares
            out[i, 4] = p.n
            pattern_of(space, p.n, &out[i, 0])


cdef inline double nearest(double value) noexcept nogil:
    """The whole number next to a value below 2 ** 51: beyond 2 ** 52 no double has a fraction. rint is a call on older processors."""
    return (value + 6755399441055744.0) - 6755399441055744.0


def decimal_steps(const double[:, ::1] y, double[::1] out):
    """The logger's step of readings (S, n) that are decimals of few digits, found without sorting them, into out (S,).

    nan: the readings are no such decimals, or reach too far. See :func:`thermofast.models.noise.spikes.logger_steps`.
    """
    cdef Py_ssize_t rows = y.shape[0], n = y.shape[1], i, j, decimals, cells, last, least
    cdef double scale, lowest, highest, value, part
    cdef uint8_t* seen
    cdef bint found
    agree(rows, out.shape[0], "steps")
    seen = <uint8_t*> malloc(CELLS * sizeof(uint8_t))
    if seen == NULL:
        raise MemoryError()
    with nogil:
        for i in range(rows):
            out[i] = NAN
            scale = 1.0
            found = False
            for decimals in range(6):
                lowest = INFINITY
                highest = -INFINITY
                found = n > 0
                for j in range(n):
                    value = y[i, j] * scale
                    if not (fabs(value) < 1e15 and fabs(value - nearest(value)) <= 5e-10 * scale):
                        found = False
                        break
                    lowest = min2(lowest, value)
                    highest = max2(highest, value)
                if found:
                    break
                scale *= 10.0
            if not found or not highest - lowest < CELLS - 1:
                continue
            lowest = nearest(lowest)
            cells = <Py_ssize_t> (nearest(highest) - lowest) + 1
            memset(seen, 0, cells)
            for j in range(n):
                seen[<Py_ssize_t> (nearest(y[i, j] * scale) - lowest)] = 1
            least = 0
            last = 0
            for j in range(1, cells):
                if seen[j]:
                    if least == 0 or j - last < least:
                        least = j - last
                    last = j
            out[i] = least / scale
            last = 0
            for j in range(1, cells if least > 1 else 0):
                if seen[j]:
                    part = <double> (j - last) / least
                    if fabs(part - nearest(part)) > 0.02:
                        out[i] = 0.0
                        break
                    last = j
    free(seen)


cdef bint may_exceed(const double* y, Py_ssize_t n, double size, double* scratch) noexcept nogil:
    """Not where fewer than half of the differences lie within the size of any place that their median can have."""
    cdef Py_ssize_t i, above = 0, below = 0, near = 0, few = 0
    cdef double middle, reach, value, deviation = size * (sqrt(2.0) / 1.4826)
    for i in range(0, n - 1, 4):
        scratch[few] = y[i + 1] - y[i]
        few += 1
    middle = median_of(scratch, few)
    for i in range(few):
        scratch[i] = fabs(scratch[i] - middle)
    # How far the median of all may be from that of a few, and still half of them lie beyond.
    reach = max2(0.8 * median_of(scratch, few) - deviation, 0.0)
    for i in range(n - 1):
        value = y[i + 1] - y[i] - middle
        above += value > reach
        below += value < -reach
        near += fabs(value) < reach + deviation
    return 2 * above >= n - 1 or 2 * below >= n - 1 or 2 * near >= n - 1


def may_exceed_difference_noise(const double[:, ::1] y, const double[::1] size, uint8_t[::1] out):
    """Which sizes (S,) may be larger than the noise of readings (S, n), by counting differences, into out (S,).

    See :func:`thermofast.models.noise.spikes.exceeds_difference_noise`.
    """
    cdef Py_ssize_t n = y.shape[1], i
    cdef double* scratch
    agree(y.shape[0], size.shape[0], "sizes")
    agree(y.shape[0], out.shape[0], "answers")
    scratch = <double*> malloc((n // 4 + 1) * sizeof(double))
    if scratch == NULL:
        raise MemoryError()
    with nogil:
        for i in range(y.shape[0]):
            out[i] = size[i] > 0.0 and (n < 3 or may_exceed(&y[i, 0], n, size[i], scratch))
    free(scratch)
