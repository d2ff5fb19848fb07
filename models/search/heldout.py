"""The error of a model on readings that its fit did not see: contiguous blocks left out in turn, the model running through them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.kernel import Array
from ..greybox import Model
from ..joint import Fit, refit
from ..observations import held_out_blocks
from ..relaxation import relaxed

#: Iterations of a fit without a block. It begins where the fit with the block ended: broken off early it would still know of it.
MOST_ITERATIONS = 100


def held_out_errors(fit: Fit, blocks: int = 8) -> Array:
    """Root mean square error (S,) [K] on left-out readings, pooled over the blocks; nan where the record is too short."""
    run = fit.run
    masks = held_out_blocks(run, blocks)
    total, count = np.zeros(run.sensors), np.zeros(run.sensors)
    for mask in masks:
        again = refit(fit, run.without(mask[None, :]), MOST_ITERATIONS)
        used = run.used & mask
        error = np.where(used, np.nan_to_num(run.reading) - predicted(again, mask), 0.0)
        total += (error**2).sum(axis=1)
        count += used.sum(axis=1)
    with np.errstate(all="ignore"):
        return np.asarray(np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan)))


def predicted(fit: Fit, left_out: NDArray[np.bool_]) -> Array:
    """Curves (S, N) [degC] that know nothing of the readings `left_out` (N,): not of a neighbour's either.

    There sensors that warm each other run together, each beside what the model says of the others.
    """
    run, model = fit.run, fit.model
    if not left_out.any() or not any(part.effect.reads_sensors for part in model.parts):
        return fit.curve
    shared = np.tile(fit.shared, (run.sensors, 1))

    def beside(curves: Array) -> Array:
        return Model(replace(run, reading=curves), model.parts, model.active).forward(fit.local, shared, np.arange(run.sensors))

    return beside(relaxed(np.where(left_out, fit.curve, run.filled), beside, left_out))
