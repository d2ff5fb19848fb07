"""A part so slow that it still takes heat while others bend, found by the halves of a record; and what its presence says."""

from dataclasses import replace

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation import imperfect
from thermofast.estimation.imperfect import _slow_seen
from thermofast.estimation.rules import RULES
from thermofast.models.imperfection import NONE, TYPICAL, Imperfection, Sizes
from thermofast.models.imperfection.prior import BESIDE_SLOW
from thermofast.models.uncertainty.companions import (
    fastest_at_end,
    halves,
    settled_beside,
    slow_paces,
    slow_parts,
    still_ahead,
)

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


def test_how_fast_slow_parts_go_on_and_how_fast_each_may_at_its_end():
    """20 exp(-t/300) K: 1.68 K in the second half hour. From 75 to 95 % of the hour the bearing does 10 exp(-t/30), 0.72 K."""
    bearing, bed = 20.0 + warms(30.0), 20.0 + warms(300.0, 20.0)
    (slow, fastest), none, (other, _) = slow_paces(
        [(TIME, bearing[None], np.zeros(1)), (TIME, np.zeros((0, 121)), np.zeros(0)), (TIME, bed[None], np.full(1, 1e-6))]
    )
    assert np.isnan(slow).all()
    assert len(none[0]) == len(none[1]) == 0
    middle = np.abs(TIME / 60.0 - 0.5) <= 0.05
    assert other == pytest.approx((np.median(bed[-13:]) - np.median(bed[middle])) / 30.0, rel=0.03)
    assert fastest == pytest.approx(10.0 * (np.exp(-1.5) - np.exp(-1.9)) / 12.0, rel=0.02)


def test_a_noise_and_a_hole_open_how_fast_a_sensor_may_be():
    """Twelve readings of 0.1 K a window: 1.8 times 0.1 / sqrt(12) is the error of a difference, and four of these count."""
    still = np.full((1, 121), 20.0)
    assert fastest_at_end(TIME, still, np.array([0.1])) == pytest.approx(4.0 * 1.8 * 0.1 / np.sqrt(12) / 12.0, rel=0.1)
    hole = np.concatenate([np.linspace(0.0, 40.0, 41), np.linspace(50.0, 60.0, 11)])
    assert np.isinf(fastest_at_end(hole, np.full((1, 52), 20.0), np.array([0.1])))


def test_the_part_that_has_most_before_it_is_gone_by():
    """Of 3 and 5 K ahead it is the second, at 0.1 K/min; one whose limit is open may come as far as 12 K, of which 4 are done."""
    moved, pace, none = np.array([9.0, 4.0, 4.0]), np.array([np.nan, 0.06, 0.1]), np.zeros(3, bool)
    ahead = np.array([50.0, 3.0, 5.0])
    assert still_ahead(moved, ahead, none, pace, 12.0) == pytest.approx((5.0, 0.02))
    assert still_ahead(-moved, -ahead, none, -pace, 12.0) == pytest.approx((-5.0, 0.02))
    assert still_ahead(moved, ahead, np.array([False, True, False]), pace, 12.0) == pytest.approx((8.0, 0.0075))
    assert still_ahead(moved, np.array([50.0, np.nan, 5.0]), none, pace, 12.0) == pytest.approx((8.0, 0.0075))


def test_when_a_rise_with_a_slow_share_has_settled():
    """Of 1.25 rises 0.25 come at 1/200 a minute: a twentieth of the whole is left after 200 ln 4 min. Less than 5 % changes nothing."""
    assert settled_beside(np.array([0.25, 0.05, 0.0]), 0.005) == pytest.approx([200.0 * np.log(4.0), 0.0, 0.0])


@pytest.fixture(scope="module")
def beside_a_bed():
    """A bearing of 15 min that settles while its bed, 5 h slow, has hardly begun; warmed and, mirrored, cooled."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 121.0)
    bearing, bed = (warms(tau, rise, time) + rng.normal(0.0, 0.02, 121) for tau, rise in ((15.0, 9.0), (300.0, 12.0)))
    return time, bearing, bed


def foretold(time, of, until=60.0, **how):
    table = {"time_min": time, **of}
    return tf.identify(table, until=until, jobs=1, **how)["bearing"]


def test_what_a_logged_bed_may_still_do_opens_the_limit_of_what_stands_on_it(beside_a_bed):
    time, bearing, bed = beside_a_bed
    alone = foretold(time, {"bearing": 20.0 + bearing}, at=180.0)
    one = foretold(time, {"bearing": 20.0 + bearing, "bed": 20.0 + bed}, at=180.0)
    ahead = RULES.slow_share * (
        tf.identify({"time_min": time, "bed": 20.0 + bed}, until=60.0)["bed"].steady_state_c - 20.0 - bed[60]
    )
    assert alone.steady_state_hi_c < 29.6
    assert one.steady_state_hi_c > 29.0 + 0.5 * ahead
    assert one.steady_state_lo_c == pytest.approx(alone.steady_state_lo_c, abs=0.5)
    assert alone.at_hi_c < one.at_hi_c < one.steady_state_hi_c
    assert alone.t95_hi_min < 200.0
    down = foretold(time, {"bearing": 20.0 - bearing, "bed": 20.0 - bed}, at=180.0)
    assert 20.0 - down.steady_state_lo_c == pytest.approx(one.steady_state_hi_c - 20.0, abs=0.01)
    sure = foretold(time, {"bearing": 20.0 + bearing, "bed": 20.0 + bed}, imperfection="none")
    assert sure.steady_state_hi_c < 29.1


def test_how_far_and_when_the_bearing_reaches_on_and_the_bed_itself_does_not(beside_a_bed, monkeypatch):
    """By two fifths of what is ahead of the bed at the pace it has, and at 180 min by what of that comes in two hours."""
    time, bearing, bed = beside_a_bed
    table = {"time_min": time, "bearing": 20.0 + bearing, "bed": 20.0 + bed}
    one = tf.identify(table, until=60.0, at=180.0, jobs=1)
    monkeypatch.setattr(imperfect, "RULES", replace(RULES, slow_share=0.0))
    without = tf.identify(table, until=60.0, at=180.0, jobs=1)
    found, more = one["bearing"], one["bearing"].steady_state_hi_c - one["bearing"].steady_state_c
    (slow, _), *_ = slow_paces([(time[:61], 20.0 + np.array([bearing[:61], bed[:61]]), np.full(2, 0.02))])
    rate = slow[1] / (more / RULES.slow_share)
    assert more > without["bearing"].steady_state_hi_c - without["bearing"].steady_state_c
    assert found.at_hi_c == pytest.approx(found.at_c - more * np.expm1(-120.0 * rate), abs=0.02)
    rise = found.steady_state_c - found.initial_c
    assert found.t95_hi_min == pytest.approx(60.0 + settled_beside(np.array([more / rise]), rate)[0], rel=0.01)
    assert one["bed"] == without["bed"]


def test_a_past_run_that_saw_the_end_says_what_the_bed_does(beside_a_bed, monkeypatch):
    time, bearing, bed = beside_a_bed
    model = tf.improve({"time_min": time, "bearing": 20.0 + bearing}, jobs=1).model
    table = {"time_min": time, "bearing": 20.0 + 0.8 * bearing, "bed": 20.0 + 0.8 * bed}
    one = tf.identify(table, until=60.0, model=model, jobs=1)
    monkeypatch.setattr(imperfect, "RULES", replace(RULES, slow_share=0.0))
    assert one["bearing"] == tf.identify(table, until=60.0, model=model, jobs=1)["bearing"]


def test_what_has_settled_beside_a_bed_that_goes_on_does_not_follow_it(beside_a_bed):
    """After eight time constants it would be seen to."""
    time, bearing, bed = beside_a_bed
    for follows, most in ((0.0, 30.5), (0.2, 34.0)):
        found = foretold(time, {"bearing": 20.0 + bearing + follows * bed, "bed": 20.0 + bed}, until=120.0)
        assert 29.0 + follows * 12.0 < found.steady_state_hi_c < most
