"""Thermal equilibrium of a spindle: Yu et al. 2019, Trans. Chin. Soc. Agric. Mach. 50(4), doi:10.6041/j.issn.1000-1298.2019.04.042.

| figure, 28 min of readings | printed | ours, median of records with 5 mK |
|---|---|---|
| T_inf | 26.797 | 26.70; error 0.127 (RMS), the Cramer-Rao limit is 0.126 |
| time to 95 % | 197 min | 195 min |
| b | 0.016 | 0.0154 |
| RMSE over 400 min | 0.1291 | 0.065 |
| R, Q after the rule of figure 1 | 1.932e-9, 1e-7 | 1.2e-9, 1e-8 with alpha held at 1 |
| the filter as printed | runs | breaks at the second reading of every record |

docs/paper.md has all of it, by ``python -m benchmarks.documents.paper``; this holds a sample to it.
"""

import numpy as np
import pytest

from benchmarks.documents.paper import END, IDENTIFIED, STEADY, T95, VARIANTS, _identified, _limit, measured, printed


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02])
def test_the_printed_filter_loses_definiteness_at_the_second_reading(noise):
    for variant, breaks in ((VARIANTS[0], 2), (VARIANTS[1], 2), (VARIANTS[2], 4)):
        for seed in range(5):
            assert len(printed(variant, measured(noise, seed), IDENTIFIED, seed).states) == breaks


def test_r_moves_by_hundredths_of_itself_off_the_lattice_of_its_start():
    ran = printed(VARIANTS[3], measured(0.005, 1), IDENTIFIED)
    assert len(ran.states) == END + 1
    assert (ran.noise[: IDENTIFIED + 1] < 1e-8).any()  # a hundredth of R0, below which steps of R0 / 100 cannot go
    assert (ran.noise[IDENTIFIED:] == ran.noise[IDENTIFIED]).all()  # after the identification Q and R stay
    assert ran.states[IDENTIFIED, 2] > 27.5  # and T_inf stays near its start of 30


def test_28_minutes_are_enough_for_what_is_printed():
    found = [_identified(measured(0.005, s), IDENTIFIED) for s in range(30)]
    steady = np.array([r.steady_state_c for r in found])
    assert np.sqrt(np.mean((steady - STEADY) ** 2)) == pytest.approx(_limit(0.005), rel=0.3)
    assert np.median([r.t95_min for r in found]) == pytest.approx(T95, abs=3.0)
    assert np.median([r.rate_per_min for r in found]) == pytest.approx(0.0154, abs=3e-4)
    assert np.median([r.rmse_ahead_c for r in found]) < 0.1291
    assert sum(abs(s - STEADY) <= 0.097 for s in steady) > 10
