"""The compiled core where it was built, its numpy twin otherwise. ``COMPILED`` tells which."""

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
        fit_decay,
        likelihoods,
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
        likelihoods,
        profile_decay,
        spike_weights,
        start_decay,
    )

    COMPILED = False

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
    "fit_decay",
    "followed",
    "forward",
    "growth",
    "growth_slope",
    "likelihoods",
    "profile_decay",
    "spike_weights",
    "start_decay",
]
