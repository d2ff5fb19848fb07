"""How far machines leave the law, and what may be said of them all the same."""

from .blocks import Part, pilot
from .draw import Drawn
from .evidence import Rates
from .machine.known import FAST_MODES, SLOW_MODES, Known, to_the_limit
from .machine.left_out import COMPLETE, PRIOR_RUNS, widths_left_out
from .machine.past import (
    GRID,
    GUESSED_NODES,
    NODES,
    SCATTER,
    Past,
    PastRun,
    Rise,
    Searched,
    SensorShape,
    learn_past,
)
from .machine.rest import Rest, ends_alone
from .posterior import Settled, settle
from .prior import NONE, TYPICAL, Imperfection, Sizes
from .shapes import lagged, room_at_end

__all__ = [
    "COMPLETE",
    "FAST_MODES",
    "GRID",
    "GUESSED_NODES",
    "NODES",
    "NONE",
    "PRIOR_RUNS",
    "SCATTER",
    "SLOW_MODES",
    "TYPICAL",
    "Drawn",
    "Imperfection",
    "Known",
    "Part",
    "Past",
    "PastRun",
    "Rates",
    "Rest",
    "Rise",
    "Searched",
    "SensorShape",
    "Settled",
    "Sizes",
    "ends_alone",
    "lagged",
    "learn_past",
    "pilot",
    "room_at_end",
    "settle",
    "to_the_limit",
    "widths_left_out",
]
