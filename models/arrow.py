"""Normal equations in the form of an arrow: one block per sensor, and a border for what all of them share."""

import numpy as np
from numpy.typing import NDArray

from .coordinates import Prior
from .core.kernel import Array

#: No temperature, residual or derivative of a trial is taken for larger [K]: its square and a sum of such are numbers still.
BEYOND = 1e100


def assemble(
    by_local: Array,
    by_shared: Array,
    residual: Array,
    weight: Array,
    active: NDArray[np.bool_],
    prior: Prior | None,
    local: Array,
    shared: Array,
) -> tuple[Array, Array, Array, Array, Array]:
    """Blocks (R, kl, kl), border (R, kl, ks), corner (ks, ks) and right sides (R, kl), (ks,) with weights (R, N).

    by_local (kl, R, N), by_shared (ks, R, N): derivatives; local, shared: where the search is, for the prior's pull.
    """
    root = np.sqrt(weight)
    jl = (by_local * root).transpose(1, 0, 2) * active[:, :, None]
    js = (by_shared * root).transpose(1, 0, 2)
    r = residual * root
    blocks = jl @ jl.transpose(0, 2, 1)
    border = jl @ js.transpose(0, 2, 1)
    corner = (js @ js.transpose(0, 2, 1)).sum(axis=0)
    right = (jl @ r[:, :, None])[:, :, 0]
    right_shared = (js @ r[:, :, None])[:, :, 0].sum(axis=0)
    if prior is not None:
        right += (prior.local_precision @ (prior.local - local)[:, :, None])[:, :, 0] * active
        blocks += prior.local_precision * active[:, :, None] * active[:, None, :]
        right_shared += prior.shared_precision @ (prior.shared - shared)
        corner = corner + prior.shared_precision
    blocks += np.eye(blocks.shape[1]) * (~active)[:, None, :]
    return blocks, border, corner, right, right_shared


def finite_slopes(values: Array) -> Array:
    """Derivatives with 0 where a trial was beyond all numbers, and none so large that its square is."""
    with np.errstate(all="ignore"):
        fine = abs(values.sum()) < BEYOND
    return values if fine else np.clip(np.nan_to_num(values), -BEYOND, BEYOND)


def _scaled(blocks: Array, corner: Array) -> tuple[Array, Array]:
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("sii->si", blocks), 1e-300))
    scale_shared = 1.0 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
    return scale, scale_shared


def arrow_inverse(blocks: Array, border: Array, corner: Array, active: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Covariances local (R, kl, kl), shared (ks, ks) and local with shared (R, kl, ks): the inverse of the normal equations."""
    scale, scale_shared = _scaled(blocks, corner)
    a = blocks * scale[:, :, None] * scale[:, None, :] + 1e-13 * np.eye(blocks.shape[1])
    b = border * scale[:, :, None] * scale_shared
    inverse = np.linalg.inv(a)
    solved = inverse @ b
    schur = corner * np.outer(scale_shared, scale_shared) - (b.transpose(0, 2, 1) @ solved).sum(axis=0)
    shared = np.linalg.inv(schur + 1e-13 * np.eye(len(schur))) if len(schur) else schur
    local = inverse + solved @ shared @ solved.transpose(0, 2, 1)
    cross = -(solved @ shared) * scale[:, :, None] * scale_shared
    local = local * scale[:, :, None] * scale[:, None, :] * active[:, :, None] * active[:, None, :]
    return local, shared * np.outer(scale_shared, scale_shared), cross


def arrow_step(
    blocks: Array,
    border: Array,
    corner: Array,
    right: Array,
    right_shared: Array,
    stuck: NDArray[np.bool_],
    stuck_shared: NDArray[np.bool_],
    damping: Array,
) -> tuple[Array, Array]:
    """One damped Gauss-Newton step (R, kl), (ks,); parameters marked stuck do not move."""
    scale, scale_shared = _scaled(blocks, corner)
    free, free_shared = (~stuck) * scale, (~stuck_shared) * scale_shared
    eye = np.eye(blocks.shape[1])
    a = blocks * free[:, :, None] * free[:, None, :]
    a = a + eye * (damping[:, None] + stuck)[:, None, :] + 1e-12 * eye
    b = border * free[:, :, None] * free_shared
    g, gs = right * free, right_shared * free_shared
    if not len(corner):
        return np.linalg.solve(a, g[:, :, None])[:, :, 0] * free, np.zeros(0)
    solved = np.linalg.solve(a, np.concatenate([b, g[:, :, None]], axis=2))
    by_b, by_g = solved[:, :, :-1], solved[:, :, -1]
    schur = corner * np.outer(free_shared, free_shared) - (b.transpose(0, 2, 1) @ by_b).sum(axis=0)
    schur = schur + np.eye(len(corner)) * (damping[0] + stuck_shared + 1e-12)
    shared = np.linalg.solve(schur, gs - (b * by_g[:, :, None]).sum(axis=(0, 1)))
    local = by_g - (by_b @ shared[:, None])[:, :, 0]
    return local * free, shared * free_shared


def covariance_root(covariance: Array) -> Array:
    """Factor (n, n) of a covariance, a little indefinite by rounding or not."""
    values, vectors = np.linalg.eigh(covariance)
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return root
