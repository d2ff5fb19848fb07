"""Rules of the filters, one reading at a time, by the equations that they name or by numpy."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from thermofast.filters import LeastSquares
from thermofast.filters.base import Track, Tracks
from thermofast.filters.cost_reference import (
    AdaptiveCostReference,
    CostReference,
    _Record,
    _sensor,
    agreement,
    anew,
    weighted_covariance,
)
from thermofast.filters.fading import AdaptiveFading, Context, Evidence, InnovationFading, Memory, NoFading, PrintedFading, joseph
from thermofast.filters.joint import _track, joint_wake, pooled_deviation
from thermofast.filters.rls import RecursiveLeastSquares, Rls, _lump_state, arx_regressor
from thermofast.filters.strong_tracking import StrongTracking, bounded_covariance, fading_factor, innovation_spread

STATE, COVARIANCE = np.array([20.0, 0.1]), np.array([[3.0, 0.5], [0.5, 1.0]])
WIDE = Context(1e6 * np.eye(2), 0.0)


def _kalman(state, p, e, r):
    """State and covariance by the textbook: K = p h / s, (1 - K h) p."""
    gain = p[:, 0] / (p[0, 0] + r)
    return state + gain * e, p - np.outer(gain, p[0])


def test_the_form_of_joseph_is_the_plain_update_with_the_right_gain():
    """And with a wrong gain the covariance of what was done."""
    for found, truth in zip(joseph(STATE, COVARIANCE, 2.0, 4.0, 1.0), _kalman(STATE, COVARIANCE, 2.0, 1.0), strict=True):
        assert found == pytest.approx(truth)
    gain = COVARIANCE[:, 0] / 8.0
    left = np.eye(2) - np.outer(gain, [1.0, 0.0])
    assert joseph(STATE, COVARIANCE, 2.0, 8.0, 1.0)[1] == pytest.approx(left @ COVARIANCE @ left.T + np.outer(gain, gain))


def test_a_plain_filter_learns_its_noise_from_every_reading():
    """Of ten readings 0.04 K^2, the eleventh 0.8 K off with s = 4: 0.16 counts one in eleven."""
    m = Memory(0.04, 10.0)
    u = NoFading().update(m, STATE, COVARIANCE, 0.8, WIDE)
    assert (m.seen, m.scale) == (11.0, pytest.approx(0.04 + (0.16 - 0.04) / 11.0))
    assert u.innovation_variance == pytest.approx(4.0 * m.scale)
    assert u.state == pytest.approx(_kalman(STATE, COVARIANCE, 0.8, 1.0)[0])


def test_innovations_fade_by_the_running_square_over_three():
    """Equations (18) to (22): V = e^2 at first, then (0.95 V + e^2) / 1.95; alpha = (V - 3) / s, at least 1, on what is read."""
    rule, m = InnovationFading(), Memory(1.0, 10.0)
    u = rule.update(m, STATE, COVARIANCE, 6.0, WIDE)  # (36 - 3) / 4
    p = COVARIANCE * np.array([[8.25, math.sqrt(8.25)], [math.sqrt(8.25), 1.0]])
    assert u.fading == pytest.approx(8.25)
    assert u.covariance == pytest.approx(_kalman(STATE, p, 6.0, 1.0)[1])
    assert u.state == pytest.approx(_kalman(STATE, p, 6.0, 1.0)[0])
    assert m.scale == pytest.approx(1.0 + (9.0 - 1.0) / 11.0)
    assert u.process_noise == pytest.approx(7.25 * 3.0 * m.scale)
    assert u.innovation_variance == pytest.approx((8.25 * 3.0 + 1.0) * m.scale)
    assert (m.forgotten, m.seen) == (pytest.approx(math.log(8.25)), 11.0)
    square = 4.0 / m.scale
    rule.update(m, STATE, COVARIANCE, 2.0, WIDE)
    assert m.v == pytest.approx((0.95 * 36.0 + square) / 1.95)
    still = rule.update(Memory(1.0, 10.0), STATE, COVARIANCE, 2.6, WIDE)  # 6.76 - 3 is less than 4
    assert (still.fading, still.process_noise) == (1.0, 0.0)


def test_the_printed_rule_moves_its_noises_by_the_sign_of_what_is_left():
    """Q by ten up where the rest is negative, else down; R by hundredths until the rest is small."""
    context = WIDE
    for e, q in ((1.0, 0.1), (-1.0, 10.0)):
        rule = PrintedFading(threshold=0.2, process_noise=1.0, noise=2.0, weakening=100.0)
        m = rule.memory(9.0, 5.0)
        u = rule.update(m, STATE, COVARIANCE, e, context)
        assert (m.scale, m.process) == (1.0, pytest.approx(q))
        # With alpha 1 the rest is e R / (p + R), and R steps by 0.02 down to where a fifth is left: R = p / 4 = 1.
        assert u.noise_factor == pytest.approx(1.0, abs=0.021)
        assert abs(e) * u.noise_factor / (4.0 + u.noise_factor) <= 0.2
    held = replace(rule, adapts=False)
    m = held.memory(9.0, 5.0)
    u = held.update(m, STATE, COVARIANCE, 1.0, context)
    assert (m.process, m.noise) == (1.0, 2.0)
    p = COVARIANCE + np.eye(2)
    assert u.covariance == pytest.approx(_kalman(STATE, p, 1.0, 2.0)[1])
    faded = held.update(held.memory(9.0, 5.0), STATE, COVARIANCE, 100.0, context)  # (10^4 - 200) / 6
    assert faded.fading == pytest.approx(9800.0 / 6.0)
    assert held.compiled_settings()["threshold"] == math.inf
    assert rule.compiled_settings()["threshold"] == 0.2


def _adaptive(e, m=None, p=COVARIANCE, context=WIDE, rule=None):
    m = m or Memory(1.0, 1e9)
    return (rule or AdaptiveFading()).update(m, STATE, p, e, context), m


def test_one_outlier_moves_nothing_and_four_in_a_row_are_a_jump():
    """Beyond five deviations; of the same side. Then all before has lost its weight and the reading is news."""
    m = Memory(1.0, 1e9)
    for k in range(3):
        u, _ = _adaptive(10.02, m)
        assert (u.weight, u.fading, m.gated_run) == (0.0, 1.0, k + 1.0)
        assert u.state is STATE
    u, _ = _adaptive(10.02, m)
    assert (u.weight, u.fading, m.gated_run, m.mean, m.spread) == (1.0, 100.0, 0.0, 0.0, 1.0)
    p = 100.0 * COVARIANCE
    p[0, 0] += 10.02**2
    assert u.state == pytest.approx(_kalman(STATE, p, 10.02, 1.0)[0])
    m = Memory(1.0, 1e9, gated_run=3.0)
    assert _adaptive(-10.02, m)[0].weight == 0.0
    assert m.gated_run == -1.0
    assert _adaptive(9.98, Memory(1.0, 1e9))[0].weight == 1.0


def test_a_jump_forgets_no_more_than_was_known_at_the_start():
    """Of the variances 3 and 1 no more than 30 and 0.5."""
    m, context = Memory(1.0, 1e9, gated_run=3.0), Context(np.diag([30.0, 0.5]), 0.0)
    u, _ = _adaptive(10.02, m, context=context)
    factor = np.sqrt([10.0, 1.0])
    p = COVARIANCE * np.outer(factor, factor)
    p[0, 0] += 10.02**2
    assert u.covariance == pytest.approx(_kalman(STATE, p, 10.02, 1.0)[1])
    assert m.forgotten == pytest.approx(math.log(100.0))


def test_thresholds_stand_further_out_while_the_noise_is_hardly_known():
    """Of ten readings by half."""
    for e, weight in ((14.9, 1.0), (15.1, 0.0)):
        assert _adaptive(e, Memory(1.0, 10.0))[0].weight == weight
    assert AdaptiveFading().weigh(Memory(1.0, 10.0), COVARIANCE, 1.0, WIDE).threshold == pytest.approx(6.0)


def test_a_mean_of_innovations_wakes_the_fading_if_it_is_more_than_rounding():
    """Nine tenths remembered: its deviation is that over the root of 19; the factor grows with its square up to a half."""
    rule, m = AdaptiveFading(), Memory(1.0, 1e9, mean=0.9)
    seen = rule.weigh(m, COVARIANCE, 4.0, WIDE)  # two deviations, beside a spread that is 0.85 + 0.15 1.21
    u = 2.0 / math.sqrt(0.85 + 0.15 * 1.1**2)
    assert m.mean == pytest.approx(0.81 + 0.1 * u)
    assert seen.z == pytest.approx(m.mean * math.sqrt(19.0))
    assert seen.wakes == pytest.approx(seen.z / 4.0)
    assert not rule.weigh(Memory(1.0, 1e9, mean=0.9), COVARIANCE, 4.0, Context(np.eye(2), 2.1)).matters
    assert Evidence(0.0, 3.9, 4.0, 1.0, False, True).wakes == 0.0
    for wakes, fading in ((1.0, 1.3), (1.2, 1.432), (1.4, 1.5)):
        assert rule.apply(Memory(1.0, 1e9), STATE, COVARIANCE, 1.0, WIDE, seen, wakes).fading == pytest.approx(fading)


def test_grown_noise_is_followed_beyond_two_and_a_half_times_and_teaches_no_scale():
    """R is the spread then; below it a reading counts in the noise, at most as nine."""
    u, m = _adaptive(1.0, Memory(1.0, 1e9, spread=4.0))
    assert u.noise_factor == pytest.approx(m.spread)
    assert m.seen == 1e9
    u, m = _adaptive(1.0, Memory(1.0, 1e9, spread=2.0))
    assert u.noise_factor == 1.0
    assert m.seen == 1e9 + 1.0
    m = Memory(1.0, 99.0)
    _adaptive(6.4, m)  # 3.2 deviations count as three
    assert m.scale == pytest.approx(1.0 + 8.0 / 100.0)


def test_sensors_wake_together_by_the_median_threshold():
    """One that stays within its rounding counts as one deviation at most."""

    def told(z, threshold=4.0, matters=True):
        return Evidence(0.0, z, threshold, 1.0, False, matters)

    three = [told(5.0, 3.0), told(5.0, 4.0), told(9.0, 9.0, matters=False)]
    assert joint_wake(three) == pytest.approx(pooled_deviation([5.0, 5.0, 1.0]) / 4.0)
    three[2] = told(0.5, 9.0, matters=False)
    assert joint_wake(three) == pytest.approx(pooled_deviation([5.0, 5.0, 0.5]) / 4.0)
    assert pooled_deviation([-3.0]) == 3.0
    assert pooled_deviation([0.1] * 5) == 0.0


def test_a_sensor_that_broke_has_nothing_from_there_on():
    """And all before."""
    columns = np.ones((4, 8))
    s = SimpleNamespace(broken=2, states=np.ones((4, 2)), covariances=np.ones((4, 2, 2)), columns=columns, first=1)
    found = _track(s)
    assert found.diverged_at == 2
    for series in (found.state[:, 0], found.covariance[:, 0, 0], found.fading):
        assert np.isnan(series).tolist() == [False, False, True, True]
    s.broken = -1
    assert _track(s).diverged_at is None


def _strong(e, m, rule=None, p=COVARIANCE, context=WIDE):
    return (rule or StrongTracking()).update(m, STATE, p, e, context)


def _husa(scale=1.0, dof=9.0, **settings):
    m = StrongTracking().memory(scale, dof)
    for name, value in settings.items():
        setattr(m, name, value)
    return m


def test_strong_tracking_fades_until_the_innovations_are_explained():
    """(V - 3.5 R) / p, at most by half; V = (0.95 V + e^2) / 1.95 in variances of the noise."""
    m = _husa(4.0, v=8.0)
    u = _strong(2.0 * math.sqrt(7.0), m)  # V = (7.6 + 7) / 1.95 = 7.487, less 3.5 is 3.987 over 3
    alpha = ((0.95 * 8.0 + 7.0) / 1.95 - 3.5) / 3.0
    assert u.fading == pytest.approx(alpha)
    state, p = _kalman(STATE, alpha * COVARIANCE, 2.0 * math.sqrt(7.0), 1.0)
    assert u.state == pytest.approx(state)
    assert u.covariance == pytest.approx(p)
    assert u.process_noise == pytest.approx((alpha - 1.0) * 3.0 * 4.0)
    assert (u.innovation_variance, u.noise_factor) == (pytest.approx((3.0 * alpha + 1.0) * 4.0), pytest.approx(1.0))
    assert m.forgotten == pytest.approx(math.log(alpha))
    assert _strong(8.0, _husa()).fading == 1.5
    assert _strong(2.0, _husa()).fading == 1.0


def test_strong_tracking_learns_noise_about_the_mean_of_the_innovations():
    """Husa's weight of the tenth reading, what is predicted taken off."""
    m = _husa(mean=0.5)
    _strong(2.0, m)
    d = 0.05 / (1.0 - 0.95**10)
    assert m.seen == 10.0
    assert m.mean == pytest.approx(0.5 + d * 1.5)
    assert m.spread == pytest.approx((1.0 - d) + d * (2.0 - m.mean) ** 2 - d * 3.0)


def test_an_outlier_counts_as_one_at_the_edge():
    """Five deviations of p + R are 10: V is 100 then, and R as wide as the reading takes."""
    m = _husa()
    u = _strong(40.0, m)
    assert m.v == pytest.approx(100.0)
    s = 40.0**2 / 25.0
    assert u.innovation_variance == pytest.approx(s)
    assert u.noise_factor == pytest.approx(s - 1.5 * 3.0)
    assert u.state == pytest.approx(STATE + 1.5 * COVARIANCE[:, 0] / s * 40.0)


def test_within_rounding_and_beyond_what_was_known_nothing_is_forgotten():
    """A logger's half step of 4 K hides 3 K; of the variances 3 and 1 no more than 3.3 and 0.9."""
    assert _strong(3.9, _husa(), context=Context(1e6 * np.eye(2), 4.0)).fading == 1.0
    assert _strong(4.1, _husa(), context=Context(1e6 * np.eye(2), 4.0)).fading > 1.0
    u = _strong(8.0, _husa(), context=Context(np.diag([3.3, 0.9]), 0.0))
    factor = np.sqrt([1.1, 1.0])
    assert u.process_noise == pytest.approx(0.3)
    r = u.innovation_variance - 3.3
    assert u.covariance == pytest.approx(_kalman(STATE, COVARIANCE * np.outer(factor, factor), 8.0, r)[1])


def test_process_noise_of_sage_and_husa_drifts_and_wanders_within_bounds():
    """Equations (42) and (43): by weight, a state's mean by no more than asked for, its covariance below the start's share."""
    d = 0.05 / (1.0 - 0.95**10)
    rule, context = StrongTracking(process_mean_most=0.5, process_noise_most=2.0), Context(np.eye(2), 0.0)
    m = _husa()
    u = _strong(2.0, m, rule, context=context)
    assert m.drift == pytest.approx(np.clip(d * (u.state - STATE), -0.5, 0.5))
    moved = COVARIANCE[:, 0] / 4.0 * 2.0
    wander = d * (np.outer(moved, moved) + u.covariance - COVARIANCE)
    assert m.wander == pytest.approx(bounded_covariance(wander, np.eye(2), 0.0, 2.0))
    m = _husa(drift=np.array([0.4, 0.0]), wander=np.eye(2))
    u = _strong(2.4, m, rule, context=Context(100.0 * np.eye(2), 0.0))
    state, p = _kalman(STATE + np.array([0.4, 0.0]), COVARIANCE + np.eye(2), 2.0, 1.0)
    assert u.state == pytest.approx(state)
    assert u.covariance == pytest.approx(p)
    assert m.drift == pytest.approx((1.0 - d) * np.array([0.4, 0.0]) + d * (state - STATE))
    moved = (COVARIANCE + np.eye(2))[:, 0] / 5.0 * 2.0
    assert m.wander == pytest.approx((1.0 - d) * np.eye(2) + d * (np.outer(moved, moved) + p - COVARIANCE))
    still = _husa()
    _strong(2.0, still)
    assert still.drift is None
    assert still.wander is None


def test_fading_by_traces_or_in_the_units_of_the_noise():
    """Equations (27), (33), (34): what innovations are beyond noise and process noise, over what can fade."""
    spread, predicted, process, noise = np.diag([20.0, 7.0]), np.diag([3.0, 1.0]), np.diag([1.0, 0.5]), np.diag([2.0, 1.0])
    assert fading_factor(spread, predicted, process, noise, 2.0) == pytest.approx((15.0 + 4.5) / (2.0 + 0.5))
    assert fading_factor(spread, predicted, process, noise, 2.0, unit=noise) == pytest.approx((7.5 + 4.5) / (1.0 + 0.5))
    assert fading_factor(spread, predicted, process, noise, 2.0, most=5.0) == 5.0
    assert fading_factor(spread, process, process, noise, 2.0) == 1.0
    e = np.array([1.0, 2.0])
    assert innovation_spread(np.eye(2), e, 0.9) == pytest.approx((0.9 * np.eye(2) + np.outer(e, e)) / 1.9)


def test_a_bounded_covariance_keeps_its_directions():
    """Variances 0.1 and 9 of the reference, turned by 45 degrees, come to 0.5 and 4 of it."""
    root = np.array([[2.0, 0.0], [1.0, 1.0]])
    turn = np.array([[1.0, -1.0], [1.0, 1.0]]) / math.sqrt(2.0)
    wide, kept = (root @ turn @ np.diag(v) @ turn.T @ root.T for v in ([0.1, 9.0], [0.5, 4.0]))
    assert bounded_covariance(wide, root @ root.T, 0.5, 4.0) == pytest.approx(kept)


def test_a_cloud_is_drawn_anew_ten_times_as_wide_but_no_wider_than_at_first():
    """A hundred times the variance, at most 30 and 0.5, and the reading is news."""
    found = anew(COVARIANCE, np.diag([30.0, 0.5]), 2.0)
    factor = np.sqrt([10.0, 1.0])
    assert found == pytest.approx(COVARIANCE * np.outer(factor, factor) + np.diag([4.0, 0.0]))
    assert anew(COVARIANCE, np.diag([1e6, 1e6]), 0.0) == pytest.approx(100.0 * COVARIANCE)


def test_a_clouds_covariance_is_numpys():
    """With weights."""
    rng = np.random.default_rng(3)
    weights, states = rng.dirichlet(np.ones(7)), rng.standard_normal((7, 2))
    assert weighted_covariance(weights, states) == pytest.approx(np.cov(states.T, aweights=weights, ddof=0))


def test_agreement_is_the_ratio_of_von_neumann():
    """Innovations of one sign and size agree by nothing, of alternating ones by 1 at most; two say nothing."""
    assert agreement(np.ones(5)) == 0.0
    assert agreement(np.array([1.0, -1.0, 1.0])) == 1.0
    assert agreement(np.array([1.0, 2.0, 4.0])) == pytest.approx(0.5 * (1.0 + 4.0) / 2.0 / 7.0)
    assert agreement(np.array([1.0, 1.0])) == 1.0
    assert agreement(np.zeros(4)) == 1.0


def test_a_cloud_is_given_up_where_its_innovations_keep_their_sign():
    """Of 20 white ones the agreement scatters by a fifth about 1; a mean within the dead band is rounding."""
    rule = AdaptiveCostReference(wake_threshold=2.0)
    limit = 1.0 - 2.0 / math.sqrt(20.0)
    assert rule.gives_up(limit - 0.01, [0.5] * 30, 0.4)
    assert not rule.gives_up(limit + 0.01, [0.5] * 30, 0.4)
    assert not rule.gives_up(limit - 0.01, [0.5] * 30, 0.6)
    assert rule.gives_up(limit - 0.01, [9.0] * 10 + [-0.5] * 20, 0.4)
    assert not rule.gives_up(limit - 0.01, [9.0] * 10 + [0.1] * 20, 0.4)
    assert not CostReference().gives_up(0.0, [0.5] * 30, 0.0)
    assert rule.kept(30, [1.0, -1.0] * 15 + [1.0] * 20) == 0.0
    assert CostReference().kept(4, []) == 0.75


def test_softness_is_in_units_of_what_a_reading_costs_in_all():
    """delta = 2 softness beta / (1 - lambda)."""
    pricing = CostReference(forgetting=0.9, softness=0.5, sharpness=3.0, power=2.0).pricing
    assert (pricing.forgetting, pricing.power, pricing.sharpness) == (0.9, 2.0, 3.0)
    assert pricing.softness == pytest.approx(30.0)
    assert _sensor(0.5)(np.array([[3.0, 9.0]])).tolist() == [6.0]


def test_the_columns_of_a_cloud_begin_with_the_start():
    """Its noise and weights up to its index, no innovation there; later rows as they are written."""
    start = SimpleNamespace(index=1, state=STATE, covariance=COVARIANCE, noise_variance=0.04, weights=np.array([0.0, 0.5]))
    record = _Record(4, start)
    record.write(2, np.array([0.5, 0.5]), np.array([[1.0, 0.0], [3.0, 0.0]]), 0.25, 0.1, 0.2, 100.0, 4.6)
    found = record.track(start, 3)
    assert (found.first, found.diverged_at) == (1, 3)
    assert found.weight[:3].tolist() == [0.0, 1.0, 1.0]
    assert found.noise_variance[:3].tolist() == [0.04, 0.04, 0.25]
    assert (found.innovation[1], found.innovation_variance[1], found.fading[0], found.forgotten[1]) == (0.0, 0.0, 1.0, 0.0)
    assert (found.innovation[2], found.innovation_variance[2], found.fading[2], found.forgotten[2]) == (0.1, 0.2, 100.0, 4.6)
    assert (found.process_noise[0], found.noise_factor[0], found.noise_factor[2]) == (0.0, 1.0, 1.0)
    assert found.state[2].tolist() == [2.0, 0.0]
    assert found.covariance[2, 0, 0] == pytest.approx(4.0)
    assert np.isnan(found.innovation[[0, 3]]).all()


def _plain(count, fading, weight, factor, diverged=None):
    one = np.arange(float(count))
    return Track(
        2, one[:, None], one[:, None, None], one, one, one, np.array(fading), one, np.array(factor), np.array(weight), one, diverged
    )


def test_the_ends_of_tracks_are_told_together():
    """A reading left out weighs nothing, one of twice the noise half; woke is the first reading that faded."""
    first, second = _plain(3, [1.0, 1.2, 1.5], [1.0, 0.0, 1.0], [1.0, 1.0, 2.0]), _plain(3, [1.0] * 3, [1.0] * 3, [4.0] * 3, 1)
    assert first.likelihood_weight.tolist() == [1.0, 0.0, 0.5]
    found = Tracks.of([first, second])
    assert found.woke.tolist() == [1, 3]
    assert found.diverged_at.tolist() == [-1, 1]
    assert found.state.tolist() == [[2.0], [2.0]]
    assert found.weight[1].tolist() == [0.25] * 3
    assert found.some([1]).woke.tolist() == [3]


def test_least_squares_weighs_all_alike_and_has_no_states():
    """The closing step does the work."""
    found = LeastSquares().track(SimpleNamespace(state_names=("a", "b", "c")), np.arange(4.0), np.arange(4.0))
    assert (found.first, found.diverged_at, found.state.shape, found.covariance.shape) == (4, None, (4, 3), (4, 3, 3))
    assert found.likelihood_weight.tolist() == [1.0] * 4
    assert (found.process_noise == 0.0).all()
    assert (found.forgotten == 0.0).all()
    assert (found.fading == 1.0).all()


def test_the_state_of_an_integrated_law_has_the_covariance_of_its_slopes():
    """By central differences of temperature, slope and rate in the three parameters."""
    theta, row, covariance = np.array([0.3, 0.8, -0.02]), np.array([1.0, 30.0, 250.0]), np.diag([1.0, 2.0, 3.0]) + 0.5

    def state(theta):
        return _lump_state(SimpleNamespace(theta=theta), row, 18.0, covariance)[0]

    assert state(theta) == pytest.approx([18.0 + 19.3, 0.8 - 0.02 * 19.3, 0.02])
    by = np.column_stack([(state(theta + h) - state(theta - h)) / 2e-6 for h in 1e-6 * np.eye(3)])
    assert _lump_state(SimpleNamespace(theta=theta), row, 18.0, covariance)[1] == pytest.approx(by @ covariance @ by.T, rel=1e-6)


def test_recursive_least_squares_forgets_as_weights_do():
    """By numpy's solution of the normal equations with weights of 0.9 to the age."""
    rng = np.random.default_rng(4)
    rows, outputs = rng.standard_normal((12, 2)), rng.standard_normal(12)
    fit = RecursiveLeastSquares(np.zeros(2), 1e9 * np.eye(2), 0.9)
    first = fit.update(rows[0], outputs[0])
    assert first == outputs[0]
    for row, output in zip(rows[1:], outputs[1:], strict=True):
        fit.update(row, output)
    weight = 0.9 ** np.arange(11, -1, -1)
    normal = rows.T @ (weight[:, None] * rows)
    assert fit.theta == pytest.approx(np.linalg.solve(normal, rows.T @ (weight * outputs)), rel=1e-5)
    assert fit.covariance == pytest.approx(np.linalg.inv(normal), rel=1e-5)
    assert arx_regressor(np.array([1.0, 2.0, 3.0]), np.array([7.0, 8.0]), 2, 1).tolist() == [3.0, 2.0, 8.0]
    assert (Rls().closing, Rls(forgetting=0.9).closing, Rls(closing_step=False).closing) == ("always", "never", "never")
