"""NIST certified values of the exponential laws, from both starts: eight digits of parameters, six of standard errors."""

import nist
import numpy as np
import pytest

from thermofast.models.separable import fit_separable, rise_from_zero


@pytest.mark.parametrize("start", [0, 1], ids=["start1", "start2"])
@pytest.mark.parametrize("name", nist.PROBLEMS)
def test_certified_digits(name, start, shared):
    basis, amplitude_places, rate_places = nist.PROBLEMS[name]
    certified = nist.read(name)
    fit = fit_separable(basis, certified.x, certified.y, certified.starts[start][rate_places])
    values, errors = nist.in_certified_order(fit, certified, basis, amplitude_places, rate_places)
    assert nist.digits(values, certified.values) >= 8
    # The residual of Lanczos1 is nil but for the rounding of its own data.
    assert nist.digits(errors, certified.errors) >= (3 if name == "Lanczos1" else 6)


def test_misra1a_without_any_start(shared):
    certified = nist.read("Misra1a")
    fit = fit_separable(rise_from_zero, certified.x, certified.y)
    assert nist.digits(np.array([*fit.amplitudes, *fit.rates]), certified.values) >= 8
