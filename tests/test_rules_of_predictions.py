"""Rules behind intervals and predictions: the prior, blocks, known machines, limits."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from thermofast.models.imperfection import FAST_MODES, SLOW_MODES, usual
from thermofast.models.imperfection.blocks import Part, block_means, pilot
from thermofast.models.imperfection.draw import conditional, normal_draws
from thermofast.models.imperfection.evidence import Run
from thermofast.models.imperfection.machine import left_out
from thermofast.models.imperfection.machine.known import Known, to_the_limit, within
from thermofast.models.imperfection.prior import COMPONENTS, NONE, SLOW, TYPICAL, Imperfection, Sizes
from thermofast.models.imperfection.shapes import Asked
from thermofast.models.uncertainty.chaos import Chaos
from thermofast.models.uncertainty.companions import moved_since
from thermofast.models.uncertainty.heat_in_watts import _interval, _jumps
from thermofast.models.uncertainty.reliability import DesignPoint, FirstOrder, Side


def test_hypotheses_are_the_background_and_each_effect_in_each_size_over_each_level():
    """Their probabilities sum to one, three tenths of it strong; the background's are log-normal, a tenth of it clean."""
    kind, squares, below, log_prior = TYPICAL.hypotheses()
    prior, count = np.exp(log_prior), len(TYPICAL.effects())
    assert len(kind) == 8 + count * 3 * 2
    assert (kind[:8] == 0).all()
    assert np.bincount(kind)[1:].tolist() == [6] * count
    assert np.sqrt(squares[8:14]).tolist() == pytest.approx([0.3, 1.0, 3.0] * 2)
    assert np.sqrt(below[8:14]).tolist() == pytest.approx([0.1] * 3 + [0.6] * 3)
    assert (below[:8] == 0.0).all()
    assert (prior.sum(), prior[8:].sum()) == (pytest.approx(1.0), pytest.approx(0.3))
    scales = np.array(TYPICAL.scales)
    usual_ = stats.norm.pdf(np.log(scales), 0.0, 0.8)
    assert prior[:8] == pytest.approx(0.7 * (0.9 * usual_ / usual_.sum() + 0.1 * (np.arange(8) == 0)))
    over = stats.norm.pdf(np.log([0.1, 0.6]), 0.0, 0.8)
    assert prior[8] / prior[11] == pytest.approx(over[0] / over[1])
    of_kind = np.array([prior[kind == k].sum() for k in range(1, count + 1)])
    which = np.array([i for i, _ in TYPICAL.effects()])
    weights = [of_kind[which == i].sum() for i in range(len(TYPICAL.strong))]
    assert np.array(weights) == pytest.approx(0.3 * np.array(TYPICAL.strong_weights) / sum(TYPICAL.strong_weights))
    assert of_kind[:4] == pytest.approx(weights[0] * np.full(4, 0.25))
    assert weights[0] == pytest.approx(0.1)  # one machine in ten has a slow mass behind it


def test_the_slowest_mass_is_looked_for_by_itself_alone():
    """A slow mode beside another effect is one of the three faster ones."""
    modes = {i: [q for j, q in TYPICAL.effects() if j == i] for i in range(len(TYPICAL.strong))}
    for i, sizes in enumerate(TYPICAL.strong):
        expected = [0, 1, 2, 3] if sizes == Sizes(slow=sizes.slow) else [1, 2, 3] if sizes.slow else [-1]
        assert modes[i] == expected


def test_a_slow_mode_has_a_share_of_its_neighbours_and_leans():
    """With half of its root mean square as mean three quarters are variance, a fiftieth of which each neighbour has."""
    prior = Imperfection(strong=(Sizes(slow=0.4),), strong_weights=(1.0,), multiplier=2.0)
    relative, absolute = prior.kinds()
    modes = relative[1:, len(COMPONENTS) :]
    whole = 0.64 * 0.75
    assert modes[1] == pytest.approx(whole * np.array([0.02, 1.0, 0.02, 0.0]))
    assert modes[3] == pytest.approx(whole * np.array([0.0, 0.0, 0.02, 1.0]))
    assert (relative[1:, COMPONENTS.index("slow")] == 0.0).all()
    assert relative[0, COMPONENTS.index("slow")] == pytest.approx(0.04**2)
    assert absolute[0, COMPONENTS.index("room")] == pytest.approx(0.2**2)
    kind, squares, *_ = prior.hypotheses()
    leans = prior.leans()
    assert (leans[kind == 0] == 0.0).all()
    assert leans[kind == 2] == pytest.approx(0.5 * 2.0 * 0.4 * np.sqrt(squares[kind == 2])[:, None] * (np.arange(len(SLOW)) == 1))


def test_few_hypotheses_are_every_other_scale_and_each_effect_in_its_middle_size():
    """Over each level of the background."""
    kind, squares, _, _ = TYPICAL.hypotheses()
    few = TYPICAL.few()
    assert np.sqrt(squares[few[kind[few] == 0]]) == pytest.approx(TYPICAL.scales[1::2])
    strong = few[kind[few] > 0]
    assert np.bincount(kind[strong])[1:].tolist() == [2] * len(TYPICAL.effects())
    assert np.sqrt(squares[strong]) == pytest.approx(np.ones(len(strong)))
    assert NONE.few().tolist() == [0]


def test_factors_are_straight_between_the_logarithms_of_turns():
    """And stay outside; none is one."""
    prior = Imperfection(factors=((0.5, 2.0), (2.0, 1.0)))
    assert [prior.factor_at(t) for t in (0.1, 0.5, 1.0, 2.0, 9.0)] == pytest.approx([2.0, 2.0, 1.5, 1.0, 1.0])
    assert TYPICAL.factor_at(1.0) == 1.0
    assert (NONE.none, TYPICAL.none) == (True, False)
    assert (TYPICAL.rarely_strong, NONE.rarely_strong) == (False, False)
    assert [Imperfection(strong_share=s).rarely_strong for s in (0.05, 0.06)] == [True, False]


def test_blocks_are_means_of_even_stretches_whose_noise_falls_with_their_number():
    """120 readings in twelve blocks of ten, by numpy; a twentieth of a time constant is left out at the beginning."""
    time, rng = np.arange(120.0), np.random.default_rng(5)
    reading = rng.standard_normal((2, 120)) + 20.0
    noise, step = np.array([0.5, 0.2]), np.array([0.0, 0.0])
    found = block_means(time, reading, noise, step, 1000.0, skip=False)
    assert found.mean == pytest.approx(reading.reshape(2, 12, 10).mean(axis=2))
    assert found.time == pytest.approx(time.reshape(12, 10).mean(axis=1))
    assert found.spread == pytest.approx(time.reshape(12, 10).var(axis=1))
    assert found.noise == pytest.approx(np.repeat(noise[:, None] ** 2 / 10.0, 12, axis=1))
    assert found.last == 119.0
    skipped = block_means(time, reading, noise, step, 100.0)
    assert skipped.time[0] >= 5.0 + 0.5 * (skipped.time[1] - skipped.time[0]) - 1.0
    assert block_means(time, reading, noise, step, 1000.0).time[0] > 11.9  # a tenth of the record at most
    assert block_means(time[:6], reading[:, :6], noise, step, 1000.0).time[0] == 0.0


def test_blocks_grow_where_a_record_is_long_against_the_time_constant():
    """Of log(span / 1.5 tau), three at most, each is exp(that / 12) times as long as the one before."""
    time = np.linspace(0.0, 1000.0, 40001)
    for tau, growing in ((1000.0 / 1.5 / math.e**2, 2.0), (1.0, 3.0)):
        found = block_means(time, np.zeros((1, 40001)), np.ones(1), np.zeros(1), tau, skip=False)
        length = np.sqrt(12.0 * found.spread)
        assert length[1:] / length[:-1] == pytest.approx(np.full(11, math.exp(growing / 12.0)), rel=0.01)


def test_rounding_averages_out_where_a_block_passes_several_steps():
    """One twelfth of the step's square, over the square of one more than the steps passed."""
    time = np.arange(48.0)
    reading = np.stack([np.repeat(np.arange(12.0), 4), np.arange(48.0)])
    found = block_means(time, reading, np.full(2, 1e-3), np.ones(2), 1000.0, skip=False)
    assert found.noise[:, 3] == pytest.approx(np.array([1.0, 1.0 / 16.0]) / 12.0, rel=1e-4)


@pytest.mark.parametrize("tau", [15.0, 40.0, 150.0])
def test_the_pilot_is_the_time_constant_of_the_law(tau):
    """On sixty rates between a three hundredth of a record and twice it: within half a step."""
    time = np.linspace(3.0, 103.0, 201)
    found = pilot(time, np.stack([20.0 - 8.0 * np.exp(-(time - 3.0) / tau), 5.0 * np.exp(-(time - 3.0) / tau)]))
    assert np.abs(np.log(found / tau)).max() < 0.5 * math.log(600.0) / 59.0 + 0.03


def test_what_is_asked_for_given_readings_is_that_of_a_vague_prior():
    """Of a Gaussian vector in which start and rise have a deviation of 1e4."""
    rng = np.random.default_rng(6)
    root = rng.standard_normal((7, 7))
    covariance, ones, law = 0.1 * root @ root.T, np.ones(7), 1.0 - np.exp(-np.arange(7.0))
    noise, reading, rows = np.full(5, 0.01), rng.standard_normal(5), np.array([5, 6])
    prior = covariance + 1e8 * (np.outer(ones, ones) + np.outer(law, law))
    seen = prior[:5, :5] + np.diag(noise)
    mean, left = conditional(reading, noise, ones, law, covariance, rows)
    assert mean == pytest.approx(prior[5:, :5] @ np.linalg.solve(seen, reading), rel=1e-4)
    assert left == pytest.approx(prior[5:, 5:] - prior[5:, :5] @ np.linalg.solve(seen, prior[:5, 5:]), rel=1e-3, abs=1e-5)
    draws = normal_draws(np.array([3.0, 4.0]), np.diag([4.0, -1e-9]), 4000, np.random.default_rng(0))
    assert draws.mean(axis=0) == pytest.approx([3.0, 4.0], abs=0.1)
    assert draws.std(axis=0) == pytest.approx([2.0, 0.0], abs=0.1)


def test_the_deviation_of_a_mixture_is_that_of_means_and_variances_together():
    """Halves at -1 and 3 with variances 1 and 3: 2 + 4."""
    found = usual._deviation(np.array([[0.5], [0.5]]), np.array([[-1.0, 0.0], [3.0, 0.0]]), np.array([[1.0, 4.0], [3.0, 4.0]]))
    assert found == pytest.approx([math.sqrt(6.0), 2.0])


def _run(known=None, guessed=False, rates="auto"):
    run = Run.__new__(Run)
    run.known, run.guessed, run.prior, run.rates, run.count = known, guessed, TYPICAL, rates, 2
    run.rows, run.centre, run.shape = np.array([0, 2, 5]), np.zeros(5), [None, None]
    return run


def test_rates_slower_than_the_pilots_are_twice_as_open():
    """A normal law of two widths; of a guessed machine of its own; of a known one Student's with three degrees of freedom."""
    off = np.array([[-0.8, 0.0, 0.8]])
    free = _run().log_rate_prior(off)[0]
    assert free[1] - free == pytest.approx([0.5 * (0.8 / 1.2) ** 2, 0.0, 0.5 * (0.8 / 0.6) ** 2])
    known = np.array([[0.0, 0.1], [0.0, 0.2]])
    guess = _run(known, True).log_rate_prior(np.array([[0.1, 0.0], [0.1, 0.0]]))
    assert (guess[:, 1] - guess[:, 0]) == pytest.approx([0.5, 0.125])
    assert guess[0, 1] - guess[1, 1] == pytest.approx(math.log(2.0))
    sure = _run(known).log_rate_prior(np.array([0.3, 0.0]), 0)
    assert sure[1] - sure[0] == pytest.approx(stats.t.logpdf(0.0, 3) - stats.t.logpdf(3.0, 3))


def test_a_sensor_is_in_the_part_whose_rows_hold_it():
    """Two parts of two and three sensors; without a shape 95 % take log 20 time constants."""
    assert [_run().part_of(k) for k in range(5)] == [(0, 0), (0, 1), (1, 0), (1, 1), (1, 2)]
    assert _run().settles(3, np.zeros(1)) == (pytest.approx(math.log(20.0)), 1.0)


def test_a_sensor_agrees_where_it_is_more_likely_than_not_over_its_own_rates():
    """Nobody agrees with itself; without common rates nobody does."""
    run, log_rate = _run(), np.array([[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]])
    dense, agreeing = np.array([0.0, 1.0, 2.0]), np.array([[1.0, 1.0, 1.0], [0.9, 0.4, 0.0]])
    at = [run.agrees(log_rate, np.log([m, [1.0, 1.0, 1.0]]), dense, agreeing)[0] for m in ([0.8, 0.1, 0.1], [0.1, 0.8, 0.1])]
    assert [a.tolist() for a in at] == [[False, True], [False, False]]
    assert not run.agrees(log_rate, np.zeros((2, 3)), np.zeros(0), np.zeros((2, 0))).any()


def _machine(**more):
    """Known sensors: one of the law itself, one of two exponentials, over forty time constants."""
    x = np.linspace(0.0, 40.0, 8001)
    law, slow = -np.expm1(-x), 1.0 - 0.5 * np.exp(-x) - 0.5 * np.exp(-0.5 * x)
    curve = np.stack([law, slow])[:, None]
    values = {"log_rate": np.log([[0.1, math.e], [0.2, math.e]]), "x": x, "curve": curve, "held": curve, "whole": curve}
    return Known(**(values | {"doubt": np.zeros((2, 0, 8001))} | more))


def test_a_known_sensor_has_done_95_percent_where_its_curve_has():
    """Log 20 of the law, with its own pace; of two exponentials by scipy's root, at the pace of both there."""
    from scipy.optimize import brentq

    known = _machine()
    root = brentq(lambda x: 0.5 * math.exp(-x) + 0.5 * math.exp(-0.5 * x) - 0.05, 0.1, 30.0)
    assert known.turns[:, 0] == pytest.approx([math.log(20.0), root], rel=1e-4)
    near = 0.5 * np.exp(-root * np.array([0.9, 1.1])) + 0.5 * np.exp(-0.5 * root * np.array([0.9, 1.1]))
    assert known.pace[:, 0] == pytest.approx([1.0, math.log(near[0] / near[1]) / (0.2 * root)], rel=1e-3)
    assert known.moved.tolist() == pytest.approx([1.0, 1.0])
    assert known.settles(1, np.zeros(3))[0] == pytest.approx(np.full(3, root), rel=1e-4)
    assert _machine(held=3.0 * known.curve).moved == pytest.approx([3.0, 3.0])


def test_beyond_the_law_is_what_the_curve_has_more_at_each_row():
    """Over the rate: at a reading, in the limit and at a time asked for; of the law itself nothing."""
    known, time, spread, asked = _machine(), np.array([5.0, 20.0]), np.zeros(2), Asked(np.array([30.0]))
    found = known.beyond_law(np.array([[0.1], [0.2]]), time, spread, asked)

    def more(x):
        return 0.5 * np.exp(-x) - 0.5 * np.exp(-0.5 * x)

    assert found[0, 0] == pytest.approx(np.zeros(found.shape[-1]), abs=1e-9)
    assert found[1, 0, [0, 1, -1]] == pytest.approx(more(0.2 * np.array([5.0, 20.0, 30.0])) / 0.2, abs=1e-5)
    assert found[1, 0, 2] == pytest.approx(0.0, abs=1e-6)


def test_between_nodes_what_is_known_runs_straight():
    """Of sensors whose curve is twice and four times the law's at two rates, half-way between their logarithms three times."""
    x = np.linspace(0.0, 40.0, 8001)
    curve = np.stack([2.0 * -np.expm1(-x), 4.0 * -np.expm1(-x)])[None]
    values = {"log_rate": np.array([[math.log(0.1), 0.1]]), "nodes": np.array([-0.2, 0.2]), "curve": curve, "held": curve}
    known = _machine(**values, whole=curve, doubt=np.zeros((1, 0, 8001)))
    node, share = known._place(0, math.log(0.1) + np.array([-9.0, -0.2, 0.0, 0.1, 9.0]))
    assert node.tolist() == [0] * 5
    assert share == pytest.approx([0.0, 0.0, 0.5, 0.75, 1.0], abs=1e-5)
    rates = 0.1 * np.exp(np.array([[-0.3, 0.0, 0.3]]))
    found = known.beyond_law(rates, np.array([20.0]), np.zeros(1), Asked(np.zeros(0)))[0] * rates[0][:, None]
    slow, fast = 1.0 - np.exp(-0.1 * 20.0 * np.exp(np.array([-0.2, 0.2])))
    at_ends = 1.0 - np.exp(-20.0 * rates[0])
    assert found[0, 0] == pytest.approx(at_ends[0], rel=1e-4)
    assert found[1, 0] == pytest.approx(0.5 * (slow + 3.0 * fast), rel=1e-4)
    assert found[2, 0] == pytest.approx(3.0 * at_ends[2], rel=1e-4)
    assert found[:, 1] == pytest.approx([1.0, 2.0, 3.0], abs=1e-6)


def test_what_is_beside_the_rise_is_averaged_in_blocks_and_has_an_end_of_its_own():
    """A straight line in time is its value in the middle of a block; nothing of it settles."""
    known = _machine(
        beside_time=np.array([0.0, 100.0]), beside=np.array([[0.0, 10.0], [5.0, 5.0]]), beside_end=np.array([7.0, 8.0])
    )
    found = known.beside_at(np.array([20.0]), np.array([12.0]), Asked(np.array([30.0])))
    assert found == pytest.approx(np.array([[2.0, 7.0, 0.0, 0.0, 3.0], [5.0, 8.0, 0.0, 0.0, 5.0]]))
    inside = within(np.array([20.0]), np.array([12.0]))[0]
    assert (inside[0], inside[-1], np.diff(inside).std()) == pytest.approx((20.0 - 6.0 * 7 / 8, 20.0 + 6.0 * 7 / 8, 0.0))


def test_amplitudes_are_told_relative_to_the_limit_that_they_make():
    """Slow ones add to it, fast ones take from it; below a fifth there is no rise."""
    count = len(SLOW_MODES) + len(FAST_MODES) + 1
    amplitudes = np.zeros(count)
    amplitudes[[0, len(SLOW_MODES), count - 1]] = 0.5, 0.25, 9.0
    found = to_the_limit(amplitudes, np.eye(count))
    assert found[0] == pytest.approx(amplitudes / 1.25)
    assert found[1] == pytest.approx(np.eye(count) / 1.25**2)
    amplitudes[0] = -0.54
    assert to_the_limit(amplitudes, np.eye(count)) is not None
    amplitudes[0] = -0.56
    assert to_the_limit(amplitudes, np.eye(count)) is None


def test_a_part_is_cut_at_a_time_with_its_room():
    """On its own clock, that time included."""
    part = Part(np.arange(10.0, 20.0), np.arange(20.0).reshape(2, 10), np.ones(2), np.zeros(2), np.arange(10.0))
    cut = left_out._until(part, 3.0)
    assert (cut.time.tolist(), cut.reading[1].tolist(), cut.room.tolist()) == (
        [10.0, 11.0, 12.0, 13.0],
        [10.0, 11.0, 12.0, 13.0],
        [0.0, 1.0, 2.0, 3.0],
    )
    assert left_out._by_room(SimpleNamespace(room=None), 5.0, 0.1) == 0.0


def test_half_widths_follow_the_errors_of_runs_left_out(monkeypatch):
    """Six runs that were as wide as said, and three whose squares were 4: the root of 18 / 9, by Student's t."""
    monkeypatch.setattr(left_out, "learn_past", lambda runs, prior, past: None)
    monkeypatch.setattr(left_out, "_errors", lambda run, others, prior: [4.0, np.nan, 4.0, 400.0, 0.0])
    monkeypatch.setattr(left_out, "replace", lambda past, factors: factors)
    three = left_out.widths_left_out(None, [None] * 3, TYPICAL)
    t9, t6 = (stats.t.ppf(0.975, n) / 1.96 for n in (9, 6))
    assert [f for _, f in three] == pytest.approx([math.sqrt(2.0) * t9, t6, math.sqrt(2.0) * t9, 4.0, math.sqrt(6.0 / 9.0) * t9])
    assert [t for t, _ in three] == [0.25, 0.5, 1.0, 2.0, 3.0]
    assert [f for _, f in left_out.widths_left_out(None, [None] * 2, TYPICAL)] == pytest.approx([t6] * 5)


def test_a_jump_of_a_power_is_one_from_a_twentieth_of_its_range():
    """As much as the jump at the reading after it, the largest first, twelve at most."""
    assert _jumps(np.array([0.0, 4.0, 100.0, 94.0])).tolist() == [[0.0, 0.0, 96.0, 0.0], [0.0, 0.0, 0.0, 6.0]]
    assert len(_jumps(np.tile([0.0, 1.0], 20))) == 12
    assert _interval(np.arange(101.0)) == (50.0, 2.5, 97.5)


def test_design_points_count_once_and_rivals_are_told():
    """A tenth of the nearest one's probability makes a rival; both sides add up to one at most."""

    def at(*distances):
        return Side(tuple(DesignPoint(np.zeros(1), (d,)) for d in distances), True)

    assert at(2.0).probability == pytest.approx(stats.norm.sf(2.0))
    assert "2 points" in at(2.0, stats.norm.isf(0.101 * stats.norm.sf(2.0))).doubt
    assert at(2.0, stats.norm.isf(0.099 * stats.norm.sf(2.0))).doubt == ""
    assert FirstOrder(at(2.0), at(1.0)).probability == pytest.approx(stats.norm.sf(2.0) + stats.norm.sf(1.0))
    assert FirstOrder(at(-2.0), at(-1.0)).probability == 1.0
    assert (
        FirstOrder(at(), Side((), False)).doubt
        == "above the limit: the limit is exceeded, but the search for the nearest point did not settle"
    )


def test_shares_of_a_variance_alone_and_in_all():
    """Of terms 3 x, 4 y and 12 x y: alone 9 of 169, in all 153; a rank is sure where its errors are none."""
    powers = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    chaos = Chaos(powers, np.array([7.0, 3.0, 4.0, 12.0]), (), 9, 0.0, np.zeros((9, 4)))
    assert (chaos.alone([0]), chaos.alone([1]), chaos.alone([0, 1])) == pytest.approx((9 / 169, 16 / 169, 1.0))
    assert (chaos.in_all([0]), chaos.in_all([1])) == pytest.approx((153 / 169, 160 / 169))
    assert (chaos.standard_deviation, chaos.mean) == (13.0, 7.0)
    rank, sure = chaos.ranks([[0], [1]])
    assert (rank.tolist(), sure.tolist()) == ([2, 1], [1.0, 1.0])


def test_readings_move_on_after_95_percent_by_more_than_the_law_has_left():
    """From the first third since then to the last: a drift of 0.01 K/min over two of three thirds of 60 min."""
    time = np.arange(5.0, 96.0)
    reading = np.stack([-4.0 * np.exp(-0.1 * (time - 5.0)) + 0.01 * time, 0.0 * time])
    found = moved_since(time, reading, np.array([0.1, np.nan]), np.array([4.0, 1.0]))
    assert found[0] == pytest.approx(0.01 * 41.0, abs=0.011)
    assert np.isnan(found[1])
    assert np.isnan(moved_since(time[:53], reading[:1, :53], np.array([0.1]), np.array([4.0]))[0])
    assert np.isfinite(moved_since(time[:54], reading[:1, :54], np.array([0.1]), np.array([4.0]))[0])


def test_a_curve_may_be_wrong_by_its_columns_over_all_that_the_sensor_does():
    """One column of a straight fortieth of x up to 1: x / 40 at each row, its end in the limit, and what a past's others add."""
    x = np.linspace(0.0, 40.0, 8001)
    column = np.stack([x / 40.0, x / 20.0])[:, None]
    known = _machine(doubt=column, others=3.0 * column, held=2.0 * _machine().curve)
    time, asked = np.array([5.0, 20.0]), Asked(np.array([30.0]))
    found, more = known.wrong(time, asked, True)
    rows = found[0, :, 1] / found[0, 1, 1] * 0.1 * 20.0 / 40.0
    turns = math.log(20.0)
    assert math.sqrt(found[0, 1, 1]) == pytest.approx(0.1 * 20.0 / 40.0 / 2.0)
    assert rows == pytest.approx([0.0125, 0.05, 1.0, turns / 40.0 - 0.95, 0.0, 0.075], abs=1e-4)
    assert math.sqrt(found[1, 2, 2]) == pytest.approx(2.0 / 2.0)
    assert more == pytest.approx(9.0 * found)
    assert known.wrong(time, asked, False)[1].size == 0
    assert _machine(doubt=column).wrong(time, asked, True)[1].size == 0
    wild = _machine(doubt=1e6 * column).doubts(time, asked)
    assert math.sqrt(wild[0, 2, 2]) == pytest.approx(100.0)
