"""A part so slow that it still takes heat while others bend, found by the halves of a record; and what its presence says."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation.imperfect import _slow_seen
from thermofast.models.imperfection import NONE, TYPICAL, Imperfection, Sizes
from thermofast.models.imperfection.prior import BESIDE_SLOW
from thermofast.models.uncertainty.companions import halves, slow_parts

TIME = np.linspace(0.0, 60.0, 121)


def warms(tau, amplitude=10.0, time=TIME):
    return amplitude * -np.expm1(-time / tau)


def seen(*curves, noise=0.0, time=TIME):
    reading = 20.0 + np.array(curves)
    found = halves(time, reading, np.full(len(reading), noise))
    return slow_parts(*found, np.full(len(reading), time[-1] - time[0])).tolist()


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_part_below_two_fifths_of_the_rate_is_slow(way):
    """Noise-free: the halves tell the rates, 1/30 beside 1/70, 1/80 and 1/300; the one that moved most is never slow."""
    assert seen(*(way * warms(tau) for tau in (30.0, 70.0, 80.0, 300.0))) == [False, False, True, True]
    assert seen(way * warms(30.0), way * 0.001 * TIME**2) == [False, True]  # an S has no rate: it has hardly begun


def test_readings_that_are_not_even_tell_the_same():
    """Two thirds of them in the first quarter."""
    time = np.concatenate([np.linspace(0.0, 15.0, 200), np.linspace(15.5, 60.0, 90)])
    assert seen(warms(30.0, time=time), warms(70.0, time=time), warms(80.0, time=time), time=time) == [False, False, True]


def test_one_read_for_a_third_as_long_is_judged_by_its_own_length():
    whole, short = TIME, TIME[:41]
    parts = [halves(t, 20.0 + warms(tau, time=t)[None], np.zeros(1)) for t, tau in ((whole, 30.0), (short, 40.0), (short, 300.0))]
    span = np.array([60.0, 20.0, 20.0])
    assert slow_parts(*(np.concatenate(p) for p in zip(*parts, strict=True)), span).tolist() == [False, False, True]


def test_what_hardly_moves_or_goes_the_other_way_is_none():
    """Of 8.6 K of the bearing 3 % are 0.26: 1.2 K times 1 - exp(-0.2) are 0.22 and no part of it, 1.6 K times it are 0.29."""
    for other, slow in ((warms(300.0, 1.2), False), (warms(300.0, 1.6), True), (warms(300.0, -3.0), False), (0.0 * TIME, False)):
        assert seen(warms(30.0), other) == [False, slow]


def test_halves_that_are_noise_tell_of_no_slow_part():
    """13 readings a window: a noise of 0.2 is an error of 0.10 K, and four of these 0.40."""
    bed = warms(300.0, 4.0)  # 0.38 K in the first half and 0.35 in the second
    for noise, slow in ((0.02, True), (0.2, False)):
        assert seen(warms(30.0), bed, noise=noise) == [False, slow]
    # The bearing bends by less than its errors: that it is faster is not told.
    for noise, slow in ((1e-4, True), (0.05, False)):
        assert seen(warms(400.0, 10.0), warms(4000.0, 20.0), noise=noise)[1] == slow


def test_both_rates_are_looked_at_from_the_safe_side():
    """Ways of 5 and 2 K beside 1 and 0.8: rates as ln 2.5 and ln 1.25, 0.92 and 0.22 over the same time; four errors of each way count."""
    early, late, span = np.array([5.0, 1.0]), np.array([2.0, 0.8]), np.full(2, 60.0)
    for errors, slow in (((0.0, 0.0), True), ((0.0, 0.012), True), ((0.0, 0.02), False), ((0.1, 0.0), True), ((0.175, 0.0), False)):
        assert slow_parts(early, late, np.array(errors), span).tolist() == [False, slow]


def test_where_all_have_hardly_begun_or_the_middle_was_not_read_nothing_is_told():
    assert seen(0.01 * TIME**2, 1e-4 * TIME**3) == [False, False]
    time = np.concatenate([np.linspace(0.0, 20.0, 41), np.linspace(40.0, 60.0, 41)])
    assert seen(warms(30.0, time=time), warms(300.0, time=time), time=time) == [False, False]
    assert not _slow_seen([], [])


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


def test_a_bed_that_was_read_later_and_with_gaps_is_seen_too():
    """Its gaps make it a block of its own; a bearing beside it is as open as beside one that was read as often."""
    time, rng = np.arange(0.0, 91.0), np.random.default_rng(12)
    bearing = 20.0 + 9.0 * -np.expm1(-time / 30.0) + rng.normal(0.0, 0.02, len(time))
    bed = 20.0 + 6.0 * -np.expm1(-time / 240.0) + rng.normal(0.0, 0.02, len(time))
    gappy = np.where((time >= 6.0) & (time % 7.0 != 0.0), bed, np.nan)
    cover = 20.0 + 0.5 * (bearing - 20.0) + rng.normal(0.0, 0.02, len(time))
    far = [
        tf.identify({"time_min": time, "bearing": bearing, "other": o})["bearing"].steady_state_hi_c for o in (bed, gappy, cover)
    ]
    assert far[1] == pytest.approx(far[0], abs=0.25 * (far[0] - far[2]))
    assert far[0] > far[2] + 0.5
