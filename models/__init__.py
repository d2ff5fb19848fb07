"""Physics: the lump that a sensor sits on, its forward run, and its maximum-likelihood fit. Knows no file and no filter."""

from .decay import LOG_TWENTY, DecayFit, Interval, fit_decay, profile_intervals
from .kernel import COMPILED, growth, growth_slope
from .lump import Lump, PrintedLump
from .spikes import spike_weights
from .whiteness import pattern_p_value, variance_inflation

__all__ = [
    "COMPILED",
    "LOG_TWENTY",
    "DecayFit",
    "Interval",
    "Lump",
    "PrintedLump",
    "fit_decay",
    "growth",
    "growth_slope",
    "pattern_p_value",
    "profile_intervals",
    "spike_weights",
    "variance_inflation",
]
