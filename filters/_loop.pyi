from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import Array

def run(
    capsules: tuple[Any, Any, Any],
    rule: str,
    points: NDArray[np.void] | None,
    settings: NDArray[np.void],
    t: Array,
    y: Array,
    first: int,
    x0: Array,
    p0: Array,
    scale: float,
    dof: float,
    dead_band: float,
    states: Array,
    covariances: Array,
    rows: NDArray[np.void],
) -> int: ...
def run_block(
    capsules: tuple[Any, Any, Any],
    rule: str,
    points: NDArray[np.void] | None,
    settings: NDArray[np.void],
    t: Array,
    y: Array,
    first: NDArray[np.intp],
    x0: Array,
    p0: Array,
    scale: Array,
    dof: Array,
    dead_band: Array,
    weights: Array,
    state: Array,
    covariance: Array,
    last: NDArray[np.void],
    woke: NDArray[np.intp],
    broken: NDArray[np.intp],
) -> None: ...
