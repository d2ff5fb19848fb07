from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._lump_numpy import Array, StartRule

SLOPE_STEP: Any
SLOPE_JACOBIAN: Any
PRINTED_STEP: Any
PRINTED_JACOBIAN: Any

def fit_decay(t: Array, y: Array, w: Array, signed_rate: bool) -> tuple[float, ...]: ...
def profile_decay(t: Array, y: Array, w: Array, rate: float, limit: float) -> tuple[float, float, float, float]: ...
def likelihoods(
    t: Array,
    y: Array,
    w: Array,
    counts: NDArray[np.intp],
    quantiles: Array,
    first: int,
    rule: StartRule,
    wide: float,
    out: Array,
) -> None: ...
def spike_weights(y: Array, resolution: float, out: Array) -> None: ...
def start_decay(t: Array, y: Array, rule: StartRule, w: Array) -> tuple[int, float, bool, tuple[float, ...]]: ...
