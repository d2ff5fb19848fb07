"""How far machines leave the law, and what may be said of them all the same."""

from .blocks import pilot
from .known import Known
from .left_out import widths_left_out
from .past import FAST_MODES, GRID, GUESSED_NODES, NODES, SCATTER, SLOW_MODES, Past, PastRun, Rise, SensorShape, learn_past
from .posterior import Part, Rates, Settled, settle
from .prior import NONE, TYPICAL, Imperfection, Sizes
from .shapes import lagged

__all__ = [
    "FAST_MODES",
    "GRID",
    "GUESSED_NODES",
    "NODES",
    "NONE",
    "SCATTER",
    "SLOW_MODES",
    "TYPICAL",
    "Imperfection",
    "Known",
    "Part",
    "Past",
    "PastRun",
    "Rates",
    "Rise",
    "SensorShape",
    "Settled",
    "Sizes",
    "lagged",
    "learn_past",
    "pilot",
    "settle",
    "widths_left_out",
]
