from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._lump_numpy import StartRule
from .fit import Array, Fits

SLOPE_STEP: Any
SLOPE_STEPS: Any
SLOPE_JACOBIAN: Any
PRINTED_STEP: Any
PRINTED_JACOBIAN: Any

def fit_decay(t: Array, y: Array, w: Array, signed_rate: bool, out: Fits) -> None: ...
def profile_decay(t: Array, y: Array, w: Array, rate: Array, limit: Array, out: Array) -> None: ...
def likelihoods(
    t: Array,
    y: Array,
    w: Array,
    counts: NDArray[np.intp],
    quantiles: Array,
    first: NDArray[np.intp],
    resolution: Array,
    rule: StartRule,
    wide: float,
    out: Fits,
) -> None: ...
def curve_squares(t: Array, y: Array, kept: Array, fits: Fits, ends: NDArray[np.intp], out: Array) -> None: ...
def spike_weights(y: Array, resolution: Array, out: Array) -> None: ...
def start_decay(
    t: Array,
    y: Array,
    resolution: Array,
    rule: StartRule,
    w: Array,
    used: NDArray[np.intp],
    noise: Array,
    settled: NDArray[np.uint8],
    out: Fits,
) -> None: ...
def pattern_sums(residual: Array, columns: Array, out: Array) -> None: ...
def law_patterns(t: Array, y: Array, w: Array, rate: Array, residual: Array, out: Array) -> None: ...
def decimal_steps(y: Array, out: Array) -> None: ...
def may_exceed_difference_noise(y: Array, size: Array, out: NDArray[np.uint8]) -> None: ...
