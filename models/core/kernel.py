"""The compiled core where it was built, its numpy twin otherwise. ``COMPILED`` tells which."""

import numpy as np
from numpy.typing import NDArray

from ._lump_numpy import StartRule
from .fit import FIT, Array, FitMoments, Fits, growth, growth_slope

try:
    from ._forward import followed, forward
    from ._lump import (
        PRINTED_JACOBIAN,
        PRINTED_STEP,
        SLOPE_JACOBIAN,
        SLOPE_STEP,
        SLOPE_STEPS,
        curve_squares,
        decimal_steps,
        fit_decay,
        law_patterns,
        likelihoods,
        may_exceed_difference_noise,
        pattern_sums,
        profile_decay,
        spike_weights,
        start_decay,
    )

    COMPILED = True
except ImportError:
    from ._forward_numpy import followed, forward
    from ._lump_numpy import (
        PRINTED_JACOBIAN,
        PRINTED_STEP,
        SLOPE_JACOBIAN,
        SLOPE_STEP,
        SLOPE_STEPS,
        curve_squares,
        fit_decay,
        law_patterns,
        likelihoods,
        pattern_sums,
        profile_decay,
        spike_weights,
        start_decay,
    )

    COMPILED = False

    def decimal_steps(y: Array, out: Array) -> None:
        """None is looked at: :func:`thermofast.models.noise.spikes.logger_steps` finds the same by sorting."""
        out.fill(np.nan)

    def may_exceed_difference_noise(y: Array, size: Array, out: NDArray[np.uint8]) -> None:
        """All are asked: :func:`thermofast.models.noise.spikes.exceeds_difference_noise` compares with the noise itself."""
        out.fill(1)


__all__ = [
    "COMPILED",
    "FIT",
    "PRINTED_JACOBIAN",
    "PRINTED_STEP",
    "SLOPE_JACOBIAN",
    "SLOPE_STEP",
    "SLOPE_STEPS",
    "Array",
    "FitMoments",
    "Fits",
    "StartRule",
    "curve_squares",
    "decimal_steps",
    "fit_decay",
    "followed",
    "forward",
    "growth",
    "growth_slope",
    "law_patterns",
    "likelihoods",
    "may_exceed_difference_noise",
    "pattern_sums",
    "profile_decay",
    "spike_weights",
    "start_decay",
]
