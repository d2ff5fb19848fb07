from numpy import intp, uint8
from numpy.typing import NDArray

from ..core.fit import Array

def mixture(
    reading: Array,
    noise: Array,
    ones: Array,
    law: Array,
    slow: Array,
    leans: Array,
    node: NDArray[intp],
    share: Array,
    covariance: Array,
    variances: Array,
    relative: Array,
    absolute: Array,
    rise: Array,
    doubt: Array,
    beside: Array,
    follows: Array,
    kind: NDArray[intp],
    scale: Array,
    under: Array,
    active: NDArray[uint8],
    asked: int,
    evidence: Array,
    squares: Array,
    mean: Array,
    variance: Array,
) -> None: ...
def quantiles(weight: Array, mean: Array, deviation: Array, level: Array, out: Array) -> None: ...
