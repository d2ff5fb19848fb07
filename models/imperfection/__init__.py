"""How far machines leave the law, and what may be said of them all the same."""

from .blocks import pilot
from .posterior import Part, Rates, Settled, settle
from .prior import NONE, TYPICAL, Imperfection, Sizes
from .shapes import lagged

__all__ = ["NONE", "TYPICAL", "Imperfection", "Part", "Rates", "Settled", "Sizes", "lagged", "pilot", "settle"]
