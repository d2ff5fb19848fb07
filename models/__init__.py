"""Physics: the lump that a sensor sits on, its forward run, and its maximum-likelihood fit. Knows no file and no filter."""

from .core.kernel import COMPILED, growth, growth_slope
from .core.tails import t_quantile
from .decay import (
    LOG_TWENTY,
    OUTLIER,
    DecayFit,
    Interval,
    Stretches,
    fit_decay,
    interval,
    likelihood_sweep,
    likelihood_sweeps,
    likelihoods,
    widened_intervals,
)
from .lump import Lump, PrintedLump
from .noise.moving_average import averaging_window
from .noise.spikes import bridged, difference_noise, exceeds_difference_noise, spike_weights, third_difference_noise
from .noise.whiteness import pattern_p_value, variance_inflation
from .observations import Observations

__all__ = [
    "COMPILED",
    "LOG_TWENTY",
    "OUTLIER",
    "DecayFit",
    "Interval",
    "Lump",
    "Observations",
    "PrintedLump",
    "Stretches",
    "averaging_window",
    "bridged",
    "difference_noise",
    "exceeds_difference_noise",
    "fit_decay",
    "growth",
    "growth_slope",
    "interval",
    "likelihood_sweep",
    "likelihood_sweeps",
    "likelihoods",
    "pattern_p_value",
    "spike_weights",
    "t_quantile",
    "third_difference_noise",
    "variance_inflation",
    "widened_intervals",
]
