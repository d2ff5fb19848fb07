"""The error of a model on readings that its fit did not see: contiguous blocks left out in turn, the model running through them."""

import numpy as np

from ..core.kernel import Array
from ..joint import Fit, refit
from ..observations import held_out_blocks


def held_out_errors(fit: Fit, blocks: int = 8) -> Array:
    """Root mean square error (S,) [K] on left-out readings, pooled over the blocks; nan where the record is too short."""
    run = fit.run
    masks = held_out_blocks(run, blocks)
    total, count = np.zeros(run.sensors), np.zeros(run.sensors)
    for mask in masks:
        again = refit(fit, run.without(mask[None, :]))
        used = run.used & mask
        error = np.where(used, np.nan_to_num(run.reading) - again.curve, 0.0)
        total += (error**2).sum(axis=1)
        count += used.sum(axis=1)
    with np.errstate(all="ignore"):
        return np.asarray(np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan)))
