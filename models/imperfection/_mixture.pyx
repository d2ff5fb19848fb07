# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Evidence and predictions of many Gaussian-process hypotheses: the compiled twin of ``_mixture_numpy.py``, which explains.

Per hypothesis one Cholesky factor by rows of its upper half, with the quantities asked for, the readings and the law's two
columns as further columns on its right, so that what is left of them is whitened on the way. LANES hypotheses are factorised side
by side, an entry of all of them next to each other in memory, which a processor does at once; none of them knows of the others.
"""
from libc.math cimport NAN, erfc, exp, fabs, log, sqrt
from libc.stdlib cimport free, malloc
from libc.string cimport memset


cdef extern from *:
    """
    #define LANES 8
    #define EACH_LANE _Pragma("GCC unroll 1") for (l = 0; l < LANES; l++)  /* unrolled it would no longer be done at once */
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define AT_ONCE __attribute__((target_clones("avx512f", "avx2", "default")))  /* setup.py: nothing fused, so that each gives the same */
    #else
    #define AT_ONCE
    #endif
    /* The upper half of scale times a kind's covariance, and for an effect that of the background. */
    AT_ONCE static void assemble(
        double *restrict a, Py_ssize_t m, Py_ssize_t wide, Py_ssize_t all,
        const double *const *restrict of_kind, const double *restrict background,
        const double *restrict scale, const double *restrict mixed)
    {
        Py_ssize_t r, j, l, at = 0;
        for (r = 0; r < m; r++)
            for (j = r; j < wide; j++, at++)
                for (l = 0; l < LANES; l++)
                    a[(r * all + j) * LANES + l] = scale[l] * of_kind[l][at] + mixed[l] * background[at];
    }
    /* Of two covariances the upper half of what lies at share w between them, row after row without gaps. */
    AT_ONCE static void between(
        double *restrict out, Py_ssize_t m, Py_ssize_t wide, const double *restrict one, const double *restrict next,
        Py_ssize_t rows, double w)
    {
        Py_ssize_t r, j;
        for (r = 0; r < m; r++) {
            const double *restrict low = one + r * rows, *restrict high = next + r * rows;
            for (j = r; j < wide; j++)
                *out++ = (1.0 - w) * low[j] + w * high[j];
        }
    }
    /* The noise of the readings, and on the right the readings and the law's two columns: of a slow mode that leans what it adds. */
    AT_ONCE static void columns(
        double *restrict a, Py_ssize_t m, Py_ssize_t wide, Py_ssize_t all, const double *restrict noise,
        const double *restrict reading, const double *restrict ones, const double *restrict law, Py_ssize_t modes,
        const double *restrict lean, const double *restrict slow, Py_ssize_t rows)
    {
        Py_ssize_t r, q, l;
        for (r = 0; r < m; r++) {
            double *restrict own = a + (r * all + r) * LANES, *restrict right = a + (r * all + wide) * LANES;
            EACH_LANE own[l] += noise[r];
            EACH_LANE right[l] = reading[r];
            EACH_LANE right[LANES + l] = ones[r];
            EACH_LANE right[2 * LANES + l] = law[r];
            for (q = 0; q < modes; q++)
                EACH_LANE right[2 * LANES + l] += lean[q * LANES + l] * slow[q * rows + r];
        }
    }
    AT_ONCE static void add(double *restrict out, Py_ssize_t count, double size, const double *restrict part)
    {
        Py_ssize_t j;
        for (j = 0; j < count; j++)
            out[j] += size * part[j];
    }
    /* A row of the factor from what is left of its row, and log and product of the pivots so far; a pivot that is none gives NAN. */
    static inline __attribute__((always_inline)) void pivot(
        double *restrict row, Py_ssize_t c, Py_ssize_t all, double *restrict product, double *restrict logs)
    {
        double u[LANES];
        Py_ssize_t j, l;
        long long beyond = 0;
        EACH_LANE {
            double left = row[c * LANES + l];
            logs[l] = left > 0.0 ? logs[l] : NAN;
            u[l] = left > 0.0 ? left : 1.0;
        }
        EACH_LANE product[l] *= u[l];
        EACH_LANE beyond |= product[l] < 1e-100 || product[l] > 1e100 ? 1 : 0;
        EACH_LANE u[l] = 1.0 / sqrt(u[l]);
        if (beyond)
            for (l = 0; l < LANES; l++)
                if (product[l] < 1e-100 || product[l] > 1e100) {
                    logs[l] += log(product[l]);
                    product[l] = 1.0;
                }
        for (j = c; j < all; j++)
            for (l = 0; l < LANES; l++)
                row[j * LANES + l] *= u[l];
    }
    /* Two rows of the factor at a time, so that what is left below them is read and written half as often. */
    AT_ONCE static void whiten(double *restrict a, Py_ssize_t m, Py_ssize_t all, double *restrict logs)
    {
        double product[LANES], u[LANES], v[LANES];
        Py_ssize_t c, r, j, l;
        for (l = 0; l < LANES; l++) {
            product[l] = 1.0;
            logs[l] = 0.0;
        }
        for (c = 0; c < m; c += 2) {
            double *restrict one = a + c * all * LANES, *restrict two = one + all * LANES;
            pivot(one, c, all, product, logs);
            if (c + 1 == m)
                break;
            for (l = 0; l < LANES; l++)
                u[l] = one[(c + 1) * LANES + l];
            for (j = c + 1; j < all; j++)
                for (l = 0; l < LANES; l++)
                    two[j * LANES + l] -= u[l] * one[j * LANES + l];
            pivot(two, c + 1, all, product, logs);
            for (r = c + 2; r < m; r++) {
                double *restrict below = a + r * all * LANES;
                for (l = 0; l < LANES; l++) {
                    u[l] = one[r * LANES + l];
                    v[l] = two[r * LANES + l];
                }
                for (j = r; j < all; j++)
                    for (l = 0; l < LANES; l++)
                        below[j * LANES + l] = below[j * LANES + l] - u[l] * one[j * LANES + l] - v[l] * two[j * LANES + l];
            }
        }
        for (l = 0; l < LANES; l++)
            logs[l] += log(product[l]);
    }
    /* Products of the three whitened columns: of the two of the law, of each with the reading, of the reading. */
    AT_ONCE static void products(const double *restrict a, Py_ssize_t m, Py_ssize_t wide, Py_ssize_t all, double *restrict out)
    {
        Py_ssize_t r, l;
        for (l = 0; l < 6 * LANES; l++)
            out[l] = 0.0;
        for (r = 0; r < m; r++) {
            const double *restrict y = a + (r * all + wide) * LANES, *one = y + LANES, *law = one + LANES;
            for (l = 0; l < LANES; l++) {
                out[l] += one[l] * one[l];
                out[LANES + l] += one[l] * law[l];
                out[2 * LANES + l] += law[l] * law[l];
                out[3 * LANES + l] += one[l] * y[l];
                out[4 * LANES + l] += law[l] * y[l];
                out[5 * LANES + l] += y[l] * y[l];
            }
        }
    }
    """
    const int LANES
    void assemble(double *a, Py_ssize_t m, Py_ssize_t wide, Py_ssize_t all_, const double **of_kind, double *background,
                  double *scale, double *mixed) noexcept nogil
    void between(double *out, Py_ssize_t m, Py_ssize_t wide, const double *one, const double *next, Py_ssize_t rows,
                 double w) noexcept nogil
    void columns(double *a, Py_ssize_t m, Py_ssize_t wide, Py_ssize_t all_, const double *noise, const double *reading,
                 const double *ones, const double *law, Py_ssize_t modes, const double *lean, const double *slow,
                 Py_ssize_t rows) noexcept nogil
    void add(double *out, Py_ssize_t count, double size, const double *part) noexcept nogil
    void products(double *a, Py_ssize_t m, Py_ssize_t wide, Py_ssize_t all_, double *out) noexcept nogil
    void whiten(double *a, Py_ssize_t m, Py_ssize_t all_, double *logs) noexcept nogil


#: Half the range of z that is tabled, and rows of the table to each step of it: cubics between them are right to 3e-10.
cdef enum:
    TABLED = 6
    FINE = 64

cdef double[2 * TABLED * FINE + 2] below
cdef double[2 * TABLED * FINE + 2] density


def _fill():
    cdef Py_ssize_t i
    cdef double z
    for i in range(2 * TABLED * FINE + 2):
        z = i / <double> FINE - TABLED
        below[i] = 0.5 * erfc(-z * 0.7071067811865476)
        density[i] = exp(-0.5 * z * z) * 0.3989422804014327


_fill()


def mixture(
    const double[:, :, ::1] reading,
    const double[:, ::1] noise,
    const double[::1] ones,
    const double[:, :, ::1] law,
    const double[:, :, :, ::1] slow,
    const double[:, ::1] leans,
    const Py_ssize_t[:, ::1] node,
    const double[:, ::1] share,
    const double[:, :, :, ::1] covariance,
    const double[:, :, ::1] variances,
    const double[:, ::1] relative,
    const double[:, ::1] absolute,
    const double[:, ::1] rise,
    const double[:, :, ::1] doubt,
    const double[:, :, ::1] beside,
    const double[::1] follows,
    const Py_ssize_t[::1] kind,
    const double[::1] scale,
    const double[::1] under,
    const unsigned char[:, :, ::1] active,
    Py_ssize_t asked,
    double[:, :, ::1] evidence,
    double[:, :, ::1] squares,
    double[:, :, :, ::1] mean,
    double[:, :, :, ::1] variance,
):
    cdef Py_ssize_t sensors = reading.shape[0], rates = reading.shape[1], m = reading.shape[2]
    cdef Py_ssize_t components = covariance.shape[1], kinds = relative.shape[0], hypotheses = kind.shape[0]
    cdef Py_ssize_t wide = m + asked, all_ = m + asked + 3, modes = slow.shape[2], q
    cdef Py_ssize_t rows = covariance.shape[3], half = m * wide - m * (m - 1) // 2  # entries of the upper half, without gaps
    cdef Py_ssize_t i, f, h, k, n, r, j, g, l, lanes, some
    cdef Py_ssize_t[8] lane  # LANES of each at least
    cdef double[8] logs, size, mixed
    cdef double[48] sums
    cdef const double *of_kind[8]
    cdef const double *of_slow
    cdef double w, v, a0, a1, p00, p01, p11, q0, q1, qq, determinant, b0, b1, u, t0, t1
    cdef double *parts
    cdef double *lean
    cdef double *types
    cdef double *a
    cdef double *row
    if covariance.shape[2] < m or rows < wide or variances.shape[2] < asked or law.shape[2] < wide or slow.shape[3] < wide or ones.shape[0] < wide:
        raise ValueError("fewer rows than quantities asked for")
    if variances.shape[0] != covariance.shape[0] or variances.shape[1] != components:
        raise ValueError("of each rate and component a variance")
    if scale.shape[0] != hypotheses or under.shape[0] != hypotheses:
        raise ValueError("of each hypothesis its scale and that of the background under it")
    if slow.shape[0] != law.shape[0] or slow.shape[1] != law.shape[1] or leans.shape[0] != hypotheses or leans.shape[1] != modes:
        raise ValueError("as many slow rises as laws, and of each hypothesis how far they lean")
    cdef bint doubted = doubt.shape[0] > 0
    if doubted and (doubt.shape[0] < sensors or doubt.shape[1] < wide or doubt.shape[2] < wide):
        raise ValueError("fewer rows of doubt than quantities asked for")
    cdef bint more = beside.shape[0] > 0
    if more and (beside.shape[0] < sensors or beside.shape[1] < wide or beside.shape[2] < wide):
        raise ValueError("fewer rows beside than quantities asked for")
    if follows.shape[0] != kinds:
        raise ValueError("of each kind how much of what is beside")
    parts = <double *> malloc(((components + kinds) * half + LANES * (m * all_ + modes)) * sizeof(double))
    if parts == NULL:
        raise MemoryError()
    types = parts + components * half
    a = types + kinds * half
    lean = a + LANES * m * all_
    cdef double *own = <double *> malloc((components + kinds) * (asked + 1) * sizeof(double))
    cdef double *own_kind = own + components * (asked + 1)
    cdef unsigned char *needed = <unsigned char *> malloc(kinds)
    if own == NULL or needed == NULL:
        free(parts)
        free(own)
        free(needed)
        raise MemoryError()
    with nogil:
        for i in range(sensors):
            for f in range(rates):
                some = 0
                for k in range(kinds):
                    needed[k] = 0
                for h in range(hypotheses):
                    if active[i, f, h]:
                        some = 1
                        needed[kind[h]] = 1
                if not some:
                    for h in range(hypotheses):
                        evidence[i, f, h] = NAN
                    continue
                needed[0] = 1
                g = node[i, f]
                w = share[i, f]
                for n in range(components):
                    between(parts + n * half, m, wide, &covariance[g, n, 0, 0], &covariance[g + 1, n, 0, 0], rows, w)
                    for j in range(asked):
                        own[n * asked + j] = (1.0 - w) * variances[g, n, j] + w * variances[g + 1, n, j]
                for k in range(kinds):
                    if not needed[k]:
                        continue
                    memset(types + k * half, 0, half * sizeof(double))
                    for j in range(asked):
                        own_kind[k * asked + j] = 0.0
                    for n in range(components):
                        v = rise[i, f] * relative[k, n] + absolute[k, n]
                        if v == 0.0:
                            continue
                        add(types + k * half, half, v, parts + n * half)
                        for j in range(asked):
                            own_kind[k * asked + j] += v * own[n * asked + j]
                    if more and follows[k] > 0.0:
                        v = rise[i, f] * follows[k]
                        for r in range(m):
                            row = types + k * half + r * wide - r * (r + 1) // 2
                            for j in range(r, wide):
                                row[j] += v * beside[i, r, j]
                        for j in range(asked):
                            own_kind[k * asked + j] += v * beside[i, m + j, m + j]
                of_slow = &slow[i, f, 0, 0] if modes else NULL
                h = 0
                while h < hypotheses:
                    lanes = 0
                    while h < hypotheses and lanes < LANES:
                        if active[i, f, h]:
                            lane[lanes] = h
                            lanes += 1
                        else:
                            evidence[i, f, h] = NAN
                        h += 1
                    if not lanes:
                        break
                    for l in range(LANES):
                        g = lane[min(l, lanes - 1)]  # lanes left over repeat the last
                        of_kind[l] = types + kind[g] * half
                        size[l] = scale[g]
                        mixed[l] = under[g]
                    assemble(a, m, wide, all_, of_kind, types, size, mixed)
                    if doubted:
                        for r in range(m):
                            for j in range(r, wide):
                                for l in range(LANES):
                                    a[(r * all_ + j) * LANES + l] += rise[i, f] * doubt[i, r, j]
                    for q in range(modes):
                        for l in range(LANES):
                            lean[q * LANES + l] = leans[lane[min(l, lanes - 1)], q]
                    columns(a, m, wide, all_, &noise[i, 0], &reading[i, f, 0], &ones[0], &law[i, f, 0], modes, lean, of_slow,
                            slow.shape[3])
                    whiten(a, m, all_, logs)
                    products(a, m, wide, all_, sums)
                    for l in range(lanes):
                        g = lane[l]
                        k = kind[g]
                        p00, p01, p11 = sums[l], sums[LANES + l], sums[2 * LANES + l]
                        q0, q1, qq = sums[3 * LANES + l], sums[4 * LANES + l], sums[5 * LANES + l]
                        determinant = p00 * p11 - p01 * p01
                        if not determinant > 1e-13 * p00 * p11 or logs[l] != logs[l]:
                            evidence[i, f, g] = NAN
                            continue
                        b0 = (p11 * q0 - p01 * q1) / determinant
                        b1 = (p00 * q1 - p01 * q0) / determinant
                        qq -= b0 * q0 + b1 * q1
                        squares[i, f, g] = qq
                        evidence[i, f, g] = -0.5 * (logs[l] + log(determinant) + qq)
                        for j in range(asked):
                            a0 = a1 = t0 = v = 0.0
                            for r in range(m):
                                row = a + r * all_ * LANES + l
                                u = row[(m + j) * LANES]
                                t0 += u * row[wide * LANES]
                                a0 += u * row[(wide + 1) * LANES]
                                a1 += u * row[(wide + 2) * LANES]
                                v += u * u
                            t1 = ones[m + j] - a0
                            u = law[i, f, m + j] - a1
                            for q in range(modes):
                                u += leans[g, q] * slow[i, f, q, m + j]
                            mean[i, f, g, j] = t0 + b0 * t1 + b1 * u
                            v = scale[g] * own_kind[k * asked + j] + mixed[l] * own_kind[j] - v
                            if doubted:
                                v += rise[i, f] * doubt[i, m + j, m + j]
                            v += (p11 * t1 * t1 - 2.0 * p01 * t1 * u + p00 * u * u) / determinant
                            variance[i, f, g, j] = v if v > 0.0 else 0.0
    free(parts)
    free(own)
    free(needed)


def quantiles(const double[::1] weight, const double[::1] mean, const double[::1] deviation, const double[::1] level, double[::1] out):
    cdef Py_ssize_t n = weight.shape[0], i, q, step, k
    cdef double low, high, at, found, total = 0.0, left = 1e300, right = -1e300, slope, z, first = 0.0, second = 0.0, near
    cdef double u, rise, start, end
    cdef double *per
    if mean.shape[0] != n or deviation.shape[0] != n or out.shape[0] != level.shape[0]:
        raise ValueError("weights, means and deviations differ in number")
    per = <double *> malloc(max(n, 1) * sizeof(double))
    if per == NULL:
        raise MemoryError()
    with nogil:
        for i in range(n):
            per[i] = 1.0 / deviation[i] if deviation[i] > 0.0 else 0.0
            total += weight[i]
            left = min(left, mean[i] - 9.0 * deviation[i])
            right = max(right, mean[i] + 9.0 * deviation[i])
            first += weight[i] * mean[i]
            second += weight[i] * (mean[i] * mean[i] + deviation[i] * deviation[i])
        first = first / total
        near = sqrt(max(second / total - first * first, 0.0))
        for q in range(level.shape[0]):
            low, high = left, right
            at = first + near * (4.0 * level[q] - 2.0)  # near a quantile of one normal distribution
            if not low < at < high:
                at = 0.5 * (low + high)
            for step in range(60):
                found = slope = 0.0
                for i in range(n):
                    if per[i] > 0.0:
                        z = (at - mean[i]) * per[i]
                        if z >= TABLED:
                            found += weight[i]
                        elif z > -TABLED:
                            u = (z + TABLED) * FINE
                            k = <Py_ssize_t> u
                            u -= k
                            rise = below[k + 1] - below[k]
                            start, end = density[k] / <double> FINE, density[k + 1] / <double> FINE
                            found += weight[i] * (
                                below[k] + u * (start + u * (3.0 * rise - 2.0 * start - end + u * (start + end - 2.0 * rise)))
                            )
                            slope += weight[i] * per[i] * (density[k] + u * (density[k + 1] - density[k]))
                    elif at >= mean[i]:
                        found += weight[i]
                found = found / total - level[q]
                slope = slope / total
                if found < 0.0:
                    low = at
                else:
                    high = at
                if high - low < 1e-9 * (right - left) or fabs(found) < 1e-6:
                    break
                at = at - found / slope if slope > 0.0 else 0.5 * (low + high)
                if not low < at < high:
                    at = 0.5 * (low + high)
            out[q] = at
    free(per)
