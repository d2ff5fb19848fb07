"""Evidence and predictions of many Gaussian-process hypotheses over block means.

For sensor i, rate f and hypothesis h the readings are law + discrepancy + noise, y = T0 1 + v0 phi + d + e, with flat priors on T0
and v0, e of variance D and d of covariance K = s (R^2 A + W): relative and absolute parts of the hypothesis' kind, the kind's over
the background's where it is a strong effect. Out come the log of the marginal likelihood (restricted: both linear parameters
integrated out), the squares that are left, and the mean and the variance of what is asked for.
"""

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Share of a law that must be told apart from a constant: less is rounding.
ALIKE = 1e-13


def mixture(
    reading: Array,
    noise: Array,
    ones: Array,
    law: Array,
    slow: Array,
    leans: Array,
    node: NDArray[np.intp],
    share: Array,
    covariance: Array,
    variances: Array,
    relative: Array,
    absolute: Array,
    rise: Array,
    doubt: Array,
    beside: Array,
    follows: Array,
    kind: NDArray[np.intp],
    scale: Array,
    under: Array,
    active: NDArray[np.uint8],
    asked: int,
    evidence: Array,
    squares: Array,
    mean: Array,
    variance: Array,
) -> None:
    """Fills evidence, squares (S, F, H), mean and variance (S, F, H, asked); nan in evidence where not active or not solvable.

    reading (S, F, m), noise (S, m), ones (m + k,), law (S, F, m + k), to which leans (H, Q) times slow (S, F, Q, m + k) is added;
    node (S, F) and share (S, F) place a rate between nodes of covariance (G, components, m, m + k), of readings with all, and of
    variances (G, components, k), of what is asked for; relative, absolute (kinds, components); rise (S, F) [K^2]; kind, scale and
    under (H,), the last of the background under an effect. doubt (S, m + k, m + k) is the covariance, over the square of the rise,
    of a shape that past runs told; (0, 0, 0) for none. beside is another, of which each kind has follows (kinds,) times as much,
    at its scale; of both the rows of readings count and, of what is asked for, the variances.
    """
    m = reading.shape[2]
    wide = m + asked
    evidence[...] = np.nan
    for i, f in np.argwhere(active.any(axis=2)).tolist():
        g, w = node[i, f], share[i, f]
        parts = (1.0 - w) * covariance[g, ..., :wide] + w * covariance[g + 1, ..., :wide]
        singly = (1.0 - w) * variances[g, :, :asked] + w * variances[g + 1, :, :asked]
        amounts = rise[i, f] * relative + absolute
        types, own_types = np.einsum("kn,nrc->krc", amounts, parts), amounts @ singly
        if len(beside):
            types += rise[i, f] * follows[:, None, None] * beside[i, :m, :wide]
            own_types += rise[i, f] * follows[:, None] * np.diagonal(beside[i])[m:wide]
        rows = np.flatnonzero(active[i, f])
        whole = scale[rows, None, None] * types[kind[rows]] + under[rows, None, None] * types[0]
        own = scale[rows, None] * own_types[kind[rows]] + under[rows, None] * own_types[0]
        if len(doubt):
            whole = whole + rise[i, f] * doubt[i, :m, :wide]
            own = own + rise[i, f] * np.diagonal(doubt[i])[m:wide]
        factor, solved = _factors(whole[:, :, :m] + np.diag(noise[i]))
        whole, own, rows = whole[solved], own[solved], rows[solved]
        laws = law[i, f, :wide] + leans[rows] @ slow[i, f, :, :wide]
        known = np.empty((len(rows), m, 3))
        known[..., 0], known[..., 1], known[..., 2] = reading[i, f], ones[:m], laws[:, :m]
        right = np.concatenate([known, whole[:, :, m:]], axis=2)
        white = np.linalg.solve(factor, right)
        y, x, cross = white[..., 0], white[..., 1:3], white[..., 3:]
        normal = np.einsum("hmi,hmj->hij", x, x)
        square = normal[:, 0, 0] * normal[:, 1, 1]
        good = square - normal[:, 0, 1] ** 2 > ALIKE * square
        if not good.all():  # the law cannot be told from a constant
            rows, own, laws, x, y, cross, normal, factor = (a[good] for a in (rows, own, laws, x, y, cross, normal, factor))
        beta = np.linalg.solve(normal, np.einsum("hmi,hm->hi", x, y)[..., None])[..., 0]
        left = y - np.einsum("hmi,hi->hm", x, beta)
        squares[i, f, rows] = (left**2).sum(axis=1)
        logs = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        evidence[i, f, rows] = -0.5 * (logs + np.linalg.slogdet(normal)[1] + squares[i, f, rows])
        if not asked:
            continue
        target = np.stack([np.broadcast_to(ones[m:wide], laws[:, m:].shape), laws[:, m:]], axis=2)
        mean[i, f, rows] = np.einsum("hti,hi->ht", target, beta) + np.einsum("hmt,hm->ht", cross, left)
        rest = target - np.einsum("hmt,hmi->hti", cross, x)
        spread = np.einsum("hti,hij,htj->ht", rest, np.linalg.inv(normal), rest)
        variance[i, f, rows] = np.maximum(own - (cross**2).sum(axis=1) + spread, 0.0)


def _factors(matrices: Array) -> tuple[Array, Any]:
    """Lower Cholesky factors (k, m, m) of those of the matrices (H, m, m) that are positive definite, and which these are (k,)."""
    try:
        return np.asarray(np.linalg.cholesky(matrices), dtype=float), np.arange(len(matrices))
    except np.linalg.LinAlgError:
        found = {}
        for k, matrix in enumerate(matrices):
            with suppress(np.linalg.LinAlgError):
                found[k] = np.linalg.cholesky(matrix)
        return np.array(list(found.values())).reshape(len(found), *matrices.shape[1:]), np.array(list(found), dtype=np.intp)


def quantiles(weight: Array, mean: Array, deviation: Array, level: Array, out: Array) -> None:
    """Fills out with the quantiles at `level` of a mixture of normal distributions (n,)."""
    from scipy.special import ndtr

    sure = deviation <= 0.0
    width = np.where(sure, 1.0, deviation)
    low = np.full(len(level), (mean - 9.0 * deviation).min())
    high = np.full(len(level), (mean + 9.0 * deviation).max())
    for _ in range(70):
        middle = 0.5 * (low + high)
        below = np.where(sure, middle[:, None] >= mean, ndtr((middle[:, None] - mean) / width))
        under = below @ weight < level * weight.sum()
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    out[:] = 0.5 * (low + high)
