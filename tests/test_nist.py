"""NIST certified values of the exponential laws, from both starts: eight digits of parameters, six of standard errors."""

import nist
import pytest


@pytest.mark.parametrize("start", [0, 1], ids=["start1", "start2"])
@pytest.mark.parametrize("name", nist.PROBLEMS)
def test_certified_digits(name, start, shared):
    certified = nist.read(name)
    values, errors = nist.solved(name, certified, certified.starts[start])
    assert nist.digits(values, certified.values) >= 8
    # The residual of Lanczos1 is nil but for the rounding of its own data.
    assert nist.digits(errors, certified.errors) >= (3 if name == "Lanczos1" else 6)
