"""Quantiles and tails of four distributions, from scipy.special, which is imported at the first use: it takes as long to
load as numpy, and a process that only hands work out does not need it.
"""

from typing import Any

from .kernel import Array


def t_quantile(dof: Array | float) -> Any:
    """97.5 % quantile of Student's t with `dof` degrees of freedom; broadcasts."""
    from scipy.special import stdtrit

    return stdtrit(dof, 0.975)


def f_tail(over: int, under: int, value: float) -> float:
    """Probability that an F statistic with (over, under) degrees of freedom exceeds `value`."""
    from scipy.special import fdtrc

    return float(fdtrc(over, under, value))


def normal_tail(value: float) -> float:
    """Probability that a standard normal number exceeds `value`."""
    from scipy.special import ndtr

    return float(ndtr(-value))


def chi2_tail(dof: int, value: float) -> float:
    """Probability that a chi-squared number with `dof` degrees of freedom exceeds `value`."""
    from scipy.special import chdtrc

    return float(chdtrc(dof, max(value, 0.0)))
