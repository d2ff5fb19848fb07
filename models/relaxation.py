"""Sensors that warm each other, run again and again, each beside what the others did in the round before, until nothing moves.

Waveform relaxation: Lelarasmee, Ruehli, Sangiovanni-Vincentelli, IEEE Trans. CAD 1 (1982) 131-145.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Rounds at most; move of a round, over a sensor's range, at which all is at rest; and the least of that range [K].
ROUNDS, AT_REST, LEAST_RISE = 400, 1e-6, 1e-3


def relaxed(curves: Array, forward: Callable[[Array], Array], free: NDArray[np.bool_] | None = None) -> Array:
    """Curves (S, N) that `forward` gives back as they are at the readings `free` (N,), all by default; the others stay.

    forward: curves (S, N) of all sensors, each beside those given of the others. Of sensors that warm each other without end the
    curves are not finite.
    """
    found = np.array(curves, dtype=float)
    size = np.maximum(np.ptp(found, axis=1), LEAST_RISE)
    for _ in range(ROUNDS):
        after = forward(found)
        if free is not None:
            after = np.where(free, after, found)
        before, found = found, after
        if not np.isfinite(found).all() or np.all(np.abs(found - before).max(axis=1, initial=0.0) <= AT_REST * size):
            break
    return found
