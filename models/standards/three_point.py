"""The extrapolation that transformer laboratories use: where three readings at equal distances lead to, by one exponential."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def three_point(first: Array, second: Array, third: Array) -> Array:
    """The end of one exponential through readings (...,) [degC] at equal distances in time; nan where they do not bend towards one.

    (b^2 - a c) / (2 b - a - c), as IEC 60076-2 and others have it.
    """
    bend = 2.0 * second - first - third
    ratio = (third - second) / np.where(second == first, np.nan, second - first)
    with np.errstate(all="ignore"):
        end = second + (second - first) * (third - second) / bend
    found: Array = np.where((ratio > 0.0) & (ratio < 1.0), end, np.nan)
    return found
