from typing import Any

from ._lump_numpy import Array

SLOPE_STEP: Any
SLOPE_JACOBIAN: Any
PRINTED_STEP: Any
PRINTED_JACOBIAN: Any

def fit_decay(
    t: Array, y: Array, w: Array, candidates: Array, low: float, high: float
) -> tuple[float, ...]: ...
def profile_decay(
    t: Array,
    y: Array,
    w: Array,
    rate: float,
    minimum: float,
    limit: float,
    low: float,
    high: float,
    correlation: float,
    stride: float,
) -> tuple[float, float, float, float]: ...
