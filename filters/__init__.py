"""Estimation: one file per published filter, one loop, two plug points (moment transform, fading rule). Knows no physics."""

from .afukf import Afukf
from .ast_cqkf import AstCqkf
from .base import Closing, Compiled, Filter, Start, Starts, StateModel, Track, Tracks, setting
from .ckf import Ckf
from .cost_reference import AdaptiveCostReference, CostReference
from .cqkf import Cqkf
from .ekf import Ekf
from .fading_ukf import FadingUkf
from .least_squares import LeastSquares
from .loop import GaussianFilter
from .printed import PrintedAfukf, PrintedFadingUkf
from .rls import Rls
from .svd import SvdUkf
from .ukf import Ukf

#: Built-in filters, the default first.
BUILT_IN: tuple[type[Filter], ...] = (
    Afukf,
    FadingUkf,
    Ukf,
    Ekf,
    SvdUkf,
    Ckf,
    Cqkf,
    AstCqkf,
    CostReference,
    AdaptiveCostReference,
    Rls,
    LeastSquares,
)
#: What ``--preset paper`` turns a filter into.
PRINTED: tuple[type[Filter], ...] = (PrintedAfukf, PrintedFadingUkf)

__all__ = [
    "BUILT_IN",
    "PRINTED",
    "AdaptiveCostReference",
    "Afukf",
    "AstCqkf",
    "Ckf",
    "Closing",
    "Compiled",
    "CostReference",
    "Cqkf",
    "Ekf",
    "FadingUkf",
    "Filter",
    "GaussianFilter",
    "LeastSquares",
    "PrintedAfukf",
    "PrintedFadingUkf",
    "Rls",
    "Start",
    "Starts",
    "StateModel",
    "SvdUkf",
    "Track",
    "Tracks",
    "Ukf",
    "setting",
]
