# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Evidence and predictions of many Gaussian-process hypotheses: the compiled twin of ``_mixture_numpy.py``, which explains.

Per hypothesis one Cholesky factor by rows of its upper half, with the quantities asked for, the readings and the law's two
columns as further columns on its right, so that what is left of them is whitened on the way.
"""
from libc.math cimport NAN, erfc, exp, fabs, log, sqrt
from libc.stdlib cimport free, malloc


cdef inline double normal(double z) noexcept nogil:
    return 0.5 * erfc(-z * 0.7071067811865476)


def mixture(
    const double[:, :, ::1] reading,
    const double[:, ::1] noise,
    const double[::1] ones,
    const double[:, :, ::1] law,
    const Py_ssize_t[:, ::1] node,
    const double[:, ::1] share,
    const double[:, :, :, ::1] covariance,
    const double[:, ::1] relative,
    const double[:, ::1] absolute,
    const double[:, ::1] rise,
    const double[:, :, ::1] doubt,
    const Py_ssize_t[::1] kind,
    const double[::1] scale,
    const unsigned char[:, :, ::1] active,
    Py_ssize_t asked,
    double[:, :, ::1] evidence,
    double[:, :, ::1] squares,
    double[:, :, :, ::1] mean,
    double[:, :, :, ::1] variance,
):
    cdef Py_ssize_t sensors = reading.shape[0], rates = reading.shape[1], m = reading.shape[2]
    cdef Py_ssize_t components = covariance.shape[1], kinds = relative.shape[0], hypotheses = kind.shape[0]
    cdef Py_ssize_t wide = m + asked, all_ = m + asked + 3
    cdef Py_ssize_t i, f, h, k, n, r, c, j, g, at, some
    cdef double w, v, a0, a1, p00, p01, p11, q0, q1, qq, determinant, b0, b1, u, t0, t1, logs, product, mixed
    cdef double *parts
    cdef double *types
    cdef double *a
    cdef double *row
    cdef double *from_
    if covariance.shape[2] < wide or law.shape[2] < wide or ones.shape[0] < wide:
        raise ValueError("fewer rows than quantities asked for")
    cdef bint doubted = doubt.shape[0] > 0
    if doubted and (doubt.shape[0] < sensors or doubt.shape[1] < wide or doubt.shape[2] < wide):
        raise ValueError("fewer rows of doubt than quantities asked for")
    parts = <double *> malloc((components + kinds + 1) * m * all_ * sizeof(double))
    if parts == NULL:
        raise MemoryError()
    types = parts + components * m * all_
    a = types + kinds * m * all_
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
                    continue
                needed[0] = 1
                g = node[i, f]
                w = share[i, f]
                for n in range(components):
                    for r in range(m):
                        row = parts + (n * m + r) * wide
                        for j in range(r, wide):
                            row[j] = (1.0 - w) * covariance[g, n, r, j] + w * covariance[g + 1, n, r, j]
                    for j in range(asked):
                        own[n * asked + j] = (1.0 - w) * covariance[g, n, m + j, m + j] + w * covariance[g + 1, n, m + j, m + j]
                for k in range(kinds):
                    if not needed[k]:
                        continue
                    for r in range(m):
                        for j in range(r, wide):
                            types[(k * m + r) * wide + j] = 0.0
                    for j in range(asked):
                        own_kind[k * asked + j] = 0.0
                    for n in range(components):
                        v = rise[i, f] * relative[k, n] + absolute[k, n]
                        if v == 0.0:
                            continue
                        for r in range(m):
                            row = types + (k * m + r) * wide
                            from_ = parts + (n * m + r) * wide
                            for j in range(r, wide):
                                row[j] += v * from_[j]
                        for j in range(asked):
                            own_kind[k * asked + j] += v * own[n * asked + j]
                for h in range(hypotheses):
                    if not active[i, f, h]:
                        evidence[i, f, h] = NAN
                        continue
                    k = kind[h]
                    mixed = 1.0 if k else 0.0
                    for r in range(m):
                        row = a + r * all_
                        from_ = types + (k * m + r) * wide
                        for j in range(r, wide):
                            row[j] = scale[h] * from_[j]
                        if k:
                            from_ = types + r * wide
                            for j in range(r, wide):
                                row[j] += from_[j]
                        if doubted:
                            for j in range(r, wide):
                                row[j] += rise[i, f] * doubt[i, r, j]
                        row[r] += noise[i, r]
                        row[wide] = reading[i, f, r]
                        row[wide + 1] = ones[r]
                        row[wide + 2] = law[i, f, r]
                    logs = 0.0
                    product = 1.0
                    for c in range(m):
                        row = a + c * all_
                        v = row[c]
                        if not v > 0.0:
                            logs = NAN
                            break
                        product *= v
                        if product < 1e-100 or product > 1e100:
                            logs += log(product)
                            product = 1.0
                        v = 1.0 / sqrt(v)
                        for j in range(c, all_):
                            row[j] *= v
                        for r in range(c + 1, m):
                            u = row[r]
                            from_ = a + r * all_
                            for j in range(r, all_):
                                from_[j] -= u * row[j]
                    logs += log(product)
                    p00 = p01 = p11 = q0 = q1 = qq = 0.0
                    for r in range(m):
                        row = a + r * all_ + wide
                        p00 += row[1] * row[1]
                        p01 += row[1] * row[2]
                        p11 += row[2] * row[2]
                        q0 += row[1] * row[0]
                        q1 += row[2] * row[0]
                        qq += row[0] * row[0]
                    determinant = p00 * p11 - p01 * p01
                    if not determinant > 0.0 or logs != logs:
                        evidence[i, f, h] = NAN
                        continue
                    b0 = (p11 * q0 - p01 * q1) / determinant
                    b1 = (p00 * q1 - p01 * q0) / determinant
                    qq -= b0 * q0 + b1 * q1
                    squares[i, f, h] = qq
                    evidence[i, f, h] = -0.5 * (logs + log(determinant) + qq)
                    for j in range(asked):
                        a0 = a1 = t0 = v = 0.0
                        for r in range(m):
                            row = a + r * all_
                            u = row[m + j]
                            t0 += u * row[wide]
                            a0 += u * row[wide + 1]
                            a1 += u * row[wide + 2]
                            v += u * u
                        t1 = ones[m + j] - a0
                        u = law[i, f, m + j] - a1
                        mean[i, f, h, j] = t0 + b0 * t1 + b1 * u
                        v = scale[h] * own_kind[k * asked + j] + mixed * own_kind[j] - v
                        if doubted:
                            v += rise[i, f] * doubt[i, m + j, m + j]
                        v += (p11 * t1 * t1 - 2.0 * p01 * t1 * u + p00 * u * u) / determinant
                        variance[i, f, h, j] = v if v > 0.0 else 0.0
    free(parts)
    free(own)
    free(needed)


def quantiles(const double[::1] weight, const double[::1] mean, const double[::1] deviation, const double[::1] level, double[::1] out):
    cdef Py_ssize_t n = weight.shape[0], i, q, step
    cdef double low, high, at, found, total = 0.0, left = 1e300, right = -1e300, slope, z, first = 0.0, second = 0.0, near
    if mean.shape[0] != n or deviation.shape[0] != n or out.shape[0] != level.shape[0]:
        raise ValueError("weights, means and deviations differ in number")
    with nogil:
        for i in range(n):
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
                    if deviation[i] > 0.0:
                        z = (at - mean[i]) / deviation[i]
                        if z > 6.0:
                            found += weight[i]
                        elif z > -6.0:
                            found += weight[i] * normal(z)
                            slope += weight[i] * exp(-0.5 * z * z) * 0.3989422804014327 / deviation[i]
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
