"""A part so slow that it still takes heat while others bend, found by the halves of a record; and what its presence says."""

import numpy as np
import pytest

from thermofast.models.imperfection import NONE, TYPICAL, Imperfection, Sizes
from thermofast.models.imperfection.prior import BESIDE_SLOW
from thermofast.models.uncertainty.companions import slow_parts

TIME = np.linspace(0.0, 60.0, 121)


def rises(*taus, amplitude=10.0):
    return np.array([amplitude * -np.expm1(-TIME / tau) for tau in taus])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_part_below_two_fifths_of_the_rate_is_slow(way):
    """Noise-free: the halves tell the rates, 1/30 beside 1/70, 1/80 and 1/300; the one that moved most is never slow."""
    found = slow_parts(20.0 + way * rises(30.0, 70.0, 80.0, 300.0), np.zeros(4))
    assert found.tolist() == [False, False, True, True]


def test_what_hardly_moves_bends_in_its_noise_or_goes_the_other_way_is_none():
    noise = np.full(2, 0.02)
    bearing = rises(30.0)[0]
    for other, slow in (
        (1.0 * -np.expm1(-TIME / 300.0), True),  # 1.8 % of the bearing's way in the hour
        (3.0 * -np.expm1(-TIME / 300.0), True),
        (-3.0 * -np.expm1(-TIME / 300.0), False),
        (0.4 * TIME / 60.0 * 0.5, False),
        (np.zeros(len(TIME)), False),
    ):
        moved = abs(other[-1] - other[0]) > 0.03 * bearing[-1]
        assert slow_parts(np.array([bearing, other]), noise).tolist() == [False, slow and moved]
    # The same part is no clear one where its halves are noise, and none beside a sensor that does not bend either.
    assert not slow_parts(np.array([bearing, 3.0 * -np.expm1(-TIME / 300.0)]), np.array([0.02, 2.0])).any()
    assert not slow_parts(rises(3000.0, 30000.0), np.zeros(2)).any()


def test_of_a_run_with_a_slow_part_half_of_the_sensors_feel_one():
    """The other strong effects keep what they have of the rest, and a lab that knows more is believed."""
    beside = TYPICAL.beside_slow()
    kind, *_, log_prior = beside.hypotheses()
    of_kind = np.array([np.exp(log_prior[kind == k]).sum() for k in range(1, len(beside.effects()) + 1)])
    alone = np.array([beside.strong[i] == Sizes(slow=beside.strong[i].slow) for i, _ in beside.effects()])
    assert of_kind[alone].sum() == pytest.approx(BESIDE_SLOW)
    assert of_kind[~alone].sum() == pytest.approx((1.0 - BESIDE_SLOW) * 0.2)
    assert len(set(np.round(of_kind[alone], 9))) == 1
    assert NONE.beside_slow() == NONE
    sure = Imperfection(strong=(Sizes(slow=0.4),), strong_weights=(1.0,), strong_share=0.6)
    assert sure.beside_slow() is sure
    only = Imperfection(strong=(Sizes(slow=0.4),), strong_weights=(), strong_share=0.2).beside_slow()
    assert only.strong_share == pytest.approx(BESIDE_SLOW)
