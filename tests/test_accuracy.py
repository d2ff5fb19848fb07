"""A small sample of benchmarks/estimation/accuracy.py: the default filter, blind, beside curve_fit started at the truth."""

import numpy as np
import pytest

from benchmarks.estimation.accuracy import CELLS, run_cell


@pytest.mark.parametrize(("noise", "minutes"), [c for c in CELLS if c in {(0.005, 28), (0.02, 60), (0.05, 120), (0.02, 195)}])
def test_as_good_as_curve_fit_and_covering(noise, minutes):
    cell = run_cell(noise, minutes, draws=150, seed=12345)
    assert cell.lost == 0
    assert cell.rms_ratio < 1.08
    assert cell.alone_rms_ratio < (1.5 if minutes <= 60 else 1.15)
    # Binomial: 150 draws at 95 % lie in 0.89 .. 0.99 but once in two hundred.
    assert 0.89 <= cell.coverage_steady <= 0.995
    assert 0.89 <= cell.coverage_t95 <= 0.995


def test_under_an_unknown_disturbance_the_default_is_no_worse_ahead():
    from benchmarks.estimation.disturbance import CASES, compare

    for case in CASES:
        errors = compare(case, draws=12, noise=0.02, seed=99)
        assert errors["afukf"] <= errors["ukf"] * 1.02, case
        assert errors["afukf"] <= errors["least_squares"] * 1.02, case
        assert np.isfinite(errors["afukf"])
