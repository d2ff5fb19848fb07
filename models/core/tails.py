"""Quantiles and tails of four distributions, all broadcasting. Where the core is compiled three of them need no scipy.special,
which takes longer to load than a record of ten sensors to identify; the twins are held to each other by tests.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from .kernel import Array

_compiled: Any
try:
    from . import _tails as _compiled
except ImportError:
    _compiled = None


def _each(tails: Callable[[Array, Array], None], values: Any) -> Any:
    given = np.ascontiguousarray(values, dtype=float)
    out = np.empty(given.size)
    tails(given.ravel(), out)
    return out.reshape(np.shape(values))[()]


def t_quantile(dof: Any) -> Any:
    """97.5 % quantile of Student's t with `dof` degrees of freedom."""
    if _compiled is not None:
        return _each(_compiled.t_quantiles, dof)
    from scipy.special import stdtrit

    return stdtrit(dof, 0.975)


def f_tail(over: int, under: int, value: Any) -> Any:
    """Probability that an F statistic with (over, under) degrees of freedom exceeds `value`."""
    if _compiled is not None:
        return _each(lambda given, out: _compiled.f_tails(over, under, given, out), value)
    from scipy.special import fdtrc

    return fdtrc(over, under, value)


def normal_tail(value: Any) -> Any:
    """Probability that a standard normal number exceeds `value`."""
    if _compiled is not None:
        return _each(_compiled.normal_tails, value)
    from scipy.special import ndtr

    return ndtr(-np.asarray(value))


def chi2_tail(dof: int, value: float) -> float:
    """Probability that a chi-squared number with `dof` degrees of freedom exceeds `value`."""
    from scipy.special import chdtrc  # at the first use: it takes long to load

    return float(chdtrc(dof, max(value, 0.0)))
