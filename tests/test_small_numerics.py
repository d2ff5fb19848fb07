"""Small numbers that intervals are made of, by scipy, numpy or a formula: mixtures, rounding, disturbances, runs of a machine."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq
from scipy.special import logsumexp

from thermofast.discovery.colour import spectral_line
from thermofast.discovery.remains import _stretch
from thermofast.estimation.measured import _without_endless
from thermofast.models import variance_inflation
from thermofast.models.arrow import arrow_inverse, arrow_step, assemble, covariance_root, finite_slopes
from thermofast.models.coordinates import Prior
from thermofast.models.imperfection import numerics
from thermofast.models.noise.discrepancy import Columns, Flutter, Noise, RandomWalk
from thermofast.models.noise.rounding import cell_residual, rounding_bias, without_rounding
from thermofast.models.noise.spectral import block_means
from thermofast.models.noise.spikes import bridged, difference_noise, exceeds_difference_noise, third_difference_noise
from thermofast.models.noise.whiteness import pattern_p_value, variance_inflations
from thermofast.models.observations import held_out_blocks
from thermofast.models.relaxation import relaxed
from thermofast.models.search.logged import follows_machine
from thermofast.models.standards import temperature_at_switch_off
from thermofast.models.swing import Swing, _count, _fewer, _harmonics
from thermofast.models.uncertainty.pooled import _pooled
from thermofast.models.uncertainty.surroundings import room_ahead, room_paths
from thermofast.output.text import cell, short


def test_a_law_with_a_discrepancy_settles_where_both_are_at_95_percent():
    """exp(-b t) = 0.05 + ahead / rise, and the deviation by the slope there; twice the pace is half the time beyond."""
    rate, rise, turns = np.array([0.02]), np.array([-10.0]), math.log(20.0)
    for ahead in (-2.0, 0.0, 0.2):
        left = 0.05 + ahead / -10.0
        time, deviation = numerics.settled_after(rate, rise, np.array([ahead]), np.array([0.03]), turns, 1.0)
        assert time[0] == pytest.approx(-math.log(left) / 0.02)
        assert deviation[0] == pytest.approx(0.03 / 10.0 / (left * 0.02))
        twice, narrower = numerics.settled_after(rate, rise, np.array([ahead]), np.array([0.03]), turns, 2.0)
        assert twice[0] == pytest.approx((turns - 0.5 * math.log(left / 0.05)) / 0.02)
        assert narrower[0] == pytest.approx(0.5 * deviation[0])


def test_from_half_of_the_5_percent_on_the_tangent_stands():
    """At a share of -0.025 the logarithm's slope is 1 / 0.025; nothing settles before the beginning."""
    rate, rise = np.array([0.02]), np.array([10.0])
    time, deviation = numerics.settled_after(rate, rise, np.array([-0.45]), np.array([0.03]), math.log(20.0), 1.0)
    assert time[0] == pytest.approx((-math.log(0.025) + 0.02 / 0.025) / 0.02)
    assert deviation[0] == pytest.approx(0.003 / (0.025 * 0.02))
    assert numerics.settled_after(rate, rise, np.array([11.0]), np.array([0.03]), math.log(20.0), 1.0)[0][0] == 0.0
    nowhere = numerics.settled_after(rate, np.zeros(1), np.array([0.1]), np.array([0.03]), math.log(20.0), 1.0)
    assert (nowhere[0][0], nowhere[1][0]) == (pytest.approx(math.log(20.0) / 0.02), 1e6)


@pytest.mark.parametrize("mode", [0.05, 0.1, 0.4])
@pytest.mark.parametrize("size", [1e-4, 0.02, 0.45, 5.0])
def test_behind_a_slow_part_95_percent_are_where_scipy_finds_them(mode, size):
    """exp(-x) + p exp(-mode x) = 0.05 (1 + p) by brentq, its slope by a difference; three parts make one normal."""
    turns, b, rise = math.log(20.0), 0.02, -10.0

    def settles(p):
        return brentq(lambda x: math.exp(-x) + p * math.exp(-mode * x) - 0.05 * (1.0 + p), 0.0, 400.0)

    def ahead(p):
        return np.array([rise * p * (0.05 - math.exp(-mode * turns))])

    spread = np.array([1e-3 * abs(ahead(size)[0])])
    shares, time, deviation = numerics.settled_behind(
        np.array([b]), np.array([rise]), ahead(size), spread, turns, 1.0, np.array([mode])
    )
    sizes = size * (1.0 + 1e-3 * numerics.NODES)
    assert time[:, 0] == pytest.approx([settles(p) / b for p in sizes], rel=1e-7)
    slope = (settles(size * 1.0001) - settles(size * 0.9999)) / (0.0002 * size)
    assert deviation[1, 0] == pytest.approx(slope * size * 1e-3 * numerics.WITHIN_NODE / b, rel=1e-3)
    assert shares.sum() == pytest.approx(1.0)
    assert (shares[:, 0] * (numerics.NODES**2 + numerics.WITHIN_NODE**2)).sum() == pytest.approx(1.0)


def test_ahead_of_the_law_a_slow_part_settles_as_any_other():
    """What is done sooner is not waited for; no rise at all leaves times finite."""
    given = np.array([0.02]), np.array([10.0]), np.array([0.4]), np.array([1e-9])
    assert numerics.settled_behind(*given, math.log(20.0), 1.0, np.array([0.1]))[1][:, 0] == pytest.approx(
        numerics.settled_after(*given, math.log(20.0), 1.0)[0][0]
    )
    nowhere = numerics.settled_behind(
        np.array([0.02]), np.zeros(1), np.array([0.4]), np.ones(1), math.log(20.0), 1.0, np.array([0.1])
    )
    assert all(np.isfinite(part).all() for part in nowhere)


def test_slope_of_a_law_is_that_of_weighted_least_squares():
    """By numpy's polyfit, each mean weighed by its variance; nothing for a law that stands still."""
    rng = np.random.default_rng(1)
    law, reading, noise = rng.standard_normal(6), rng.standard_normal(6), rng.uniform(0.5, 2.0, 6)
    found = numerics.law_slope(SimpleNamespace(noise=noise[None]), reading[None, None], law[None, None])
    assert found[0, 0] == pytest.approx(np.polyfit(law, reading, 1, w=1.0 / np.sqrt(noise))[0])
    assert numerics.law_slope(SimpleNamespace(noise=noise[None]), reading[None, None], np.ones((1, 1, 6)))[0, 0] == 0.0


def test_grids_of_log_rates():
    """A cell reaches half the way to its neighbours; the posterior's depth and a margin of steps beyond it."""
    np.testing.assert_allclose(numerics.cells(np.array([0.0, 1.0, 2.0, 3.0])), 1.0)
    grid = np.arange(21.0)[None]
    log = -0.5 * (grid - 8.0) ** 2
    assert [float(v[0]) for v in numerics.within_depth(grid, log, 5.0, 0.0)] == [5.0, 11.0]  # 0.5 * 3^2 < 5
    assert [float(v[0]) for v in numerics.within_depth(grid, log, 5.0, 2.0)] == [3.0, 13.0]
    assert [float(v[0]) for v in numerics.within_depth(grid, log, 5.0, 30.0)] == [0.0, 20.0]
    assert [float(v[0]) for v in numerics.within_depth(grid, log, 4.5, 0.0)] == [6.0, 10.0]


def test_sums_of_exponentials_and_the_log_density_of_student():
    """By scipy, along either axis, nothing at all included."""
    values = np.array([[-1000.0, -1001.0], [700.0, 710.0], [-np.inf, -np.inf]])
    np.testing.assert_allclose(numerics.log_sum(values, 1), logsumexp(values, axis=1))
    np.testing.assert_allclose(numerics.log_sum(values, 0), logsumexp(values, axis=0))
    table = np.random.default_rng(6).normal(0.0, 300.0, (19, 4, 5))  # more rows than are worked on at a time, and not a multiple
    table[3] = -np.inf
    for axis in (0, 1, 2):
        np.testing.assert_allclose(numerics.log_sum(table, axis), logsumexp(table, axis=axis))
    off, spread = np.array([0.0, 1.0, 5.0]), np.array([0.5, 2.0, 1.0])
    found = numerics.student(off, spread, 4.0) - stats.t.logpdf(off, 4.0, 0.0, spread)
    np.testing.assert_allclose(found, found[0])


def test_half_widths_of_an_interval_are_stretched_about_its_middle():
    """None settles before the beginning."""
    steady, t95, at = np.array([49.0, 50.0, 52.0]), np.array([10.0, 20.0, 40.0]), [np.array([1.0, 2.0, 4.0])]
    numerics.stretch(steady, t95, at, 3.0)
    assert (steady.tolist(), t95.tolist(), at[0].tolist()) == ([47.0, 50.0, 56.0], [0.0, 20.0, 80.0], [-1.0, 2.0, 8.0])
    numerics.stretch(steady, t95, at, 1.0)
    assert steady.tolist() == [47.0, 50.0, 56.0]


def test_quantiles_of_a_mixture_and_the_weights_that_count():
    """2.5, 50 and 97.5 % by root finding; weights left out are two thousandths of all at most."""
    weight, mean, deviation = np.array([0.6, 0.3, 0.1]), np.array([10.0, 13.0, 20.0]), np.array([1.0, 0.5, 3.0])
    exact = [brentq(lambda x, p=p: weight @ stats.norm.cdf(x, mean, deviation) - p, -20.0, 60.0) for p in (0.025, 0.5, 0.975)]
    np.testing.assert_allclose(numerics.quantiles(weight, mean, deviation), exact, rtol=1e-3)
    assert numerics.negligible(np.array([0.5, 0.001, 0.498, 0.0008, 0.0002])) == 0.001
    assert numerics.negligible(np.array([0.5, 0.0015, 0.4977, 0.0008])) == 0.0008
    assert numerics.negligible(np.array([0.5, 0.5])) == -1.0


@pytest.mark.parametrize("noise", [0.2, 0.3])
def test_what_rounding_adds_is_the_mean_of_rounded_noise(noise):
    """Every cell by its normal probability, for a step of half a kelvin."""
    curve, step = np.linspace(20.0, 20.5, 11), 0.5
    cell = step * np.arange(30, 52)
    edges = np.concatenate([[-np.inf], cell[:-1] + 0.5 * step, [np.inf]])
    share = np.diff(stats.norm.cdf(edges, curve[:, None], noise * step), axis=1)
    np.testing.assert_allclose(rounding_bias(curve, step, noise), share @ cell - curve, atol=3e-6)


def test_rounding_is_taken_out_only_where_it_shows():
    """A curve through cells leaves next to nothing; a logger without a step and a curve not good to one are left as they are."""
    curve, step = np.linspace(20.0, 23.0, 301), 0.5
    residual = np.round(curve / step) * step - curve + 0.02 * np.random.default_rng(2).standard_normal(301)
    weight, variance = np.ones(301), step**2 / 12.0
    kept = without_rounding(residual, curve, weight, step, variance)
    assert (kept**2).mean() < 0.25 * (residual**2).mean()
    weight[5] = 0.0
    assert without_rounding(residual, curve, weight, step, variance)[5] == 0.0
    assert without_rounding(residual, curve, weight, 0.0, variance) is residual
    assert without_rounding(residual, curve, weight, step, 1.01 * step**2) is residual
    assert without_rounding(residual, curve, weight, step, step**2 / 12.0 + (0.46 * step) ** 2) is residual
    assert without_rounding(residual, curve, weight, step, step**2 / 12.0 + (0.44 * step) ** 2) is not residual


def test_a_line_through_cells_leaves_little_beside_their_middles():
    """A line through every cell: what is left is a small part of what the middles leave, and none of it along the line."""
    x = np.linspace(0.0, 1.0, 200)
    tangent = np.column_stack([np.ones(200), x])
    reading = np.round(20.17 + 2.3 * x)
    middles = reading - tangent @ np.linalg.lstsq(tangent, reading, rcond=None)[0]
    left = cell_residual(reading, reading - middles, tangent, 1.0)
    assert np.sqrt((left**2).mean()) < 0.1 * np.sqrt((middles**2).mean())
    assert np.abs(tangent.T @ left).max() < 200 * 2e-3


def test_a_room_that_wanders_and_a_load_that_comes_back():
    """Variance scale^2 an hour; correlation 1 / e after the memory."""
    times = np.array([0.0, 30.0, 60.0, 240.0])
    walk = RandomWalk(0.5).covariance(times, times)
    np.testing.assert_allclose(np.diag(walk), 0.25 * times / 60.0)
    assert walk[1, 3] == walk[3, 1] == pytest.approx(0.25 * 0.5)
    flutter = Flutter(0.5, memory=30.0).covariance(times, times)
    np.testing.assert_allclose(np.diag(flutter), 0.25)
    assert flutter[0, 1] == flutter[1, 0] == pytest.approx(0.25 / math.e)


@pytest.mark.parametrize("process", [RandomWalk(0.5), Flutter(0.02, memory=60.0)])
def test_shapes_of_a_process_have_its_covariance(process):
    """Karhunen and Loeve, the largest first, what is left out a ten-thousandth of the first."""
    time, shapes = process.shapes(240.0)
    assert time[[0, -1]].tolist() == [0.0, 240.0]
    np.testing.assert_allclose(shapes.T @ shapes, process.covariance(time, time), atol=0.02 * process.covariance(time, time).max())
    size = (shapes**2).sum(axis=1)
    assert (np.diff(size) <= 0.0).all()
    assert size[-1] > 1e-4 * size[0]


def test_sensors_follow_what_drives_them_with_their_own_lag():
    """One that follows at once reads the process itself, one of 60 min the convolution with its lag; heat acts by the rise."""
    time, rate, rise = np.linspace(0.0, 240.0, 961), np.array([1e4, 1.0 / 60.0]), np.array([20.0, 30.0])
    for process in (RandomWalk(0.5), Flutter(0.02, memory=60.0, shared=False)):
        columns = Noise((process,)).columns(time, rate, rise)
        found, other = (columns.shared, columns.own) if process.shared else (columns.own, columns.shared)
        assert len(other) == 0
        grid, shapes = process.shapes(240.0)
        size = rise if process.into == "heat" else np.ones(2)
        driven = np.interp(time, grid, shapes[1])
        np.testing.assert_allclose(found[1, 0, 1:], size[0] * driven[1:], atol=0.02 * size[0] * np.abs(driven).max())
        fresh = np.concatenate(
            [[0.0], np.cumsum(0.125 * (driven[1:] * np.exp(time[1:] / 60.0) + driven[:-1] * np.exp(time[:-1] / 60.0)))]
        )
        late = fresh * np.exp(-time / 60.0) / 60.0
        np.testing.assert_allclose(found[1, 1], size[1] * late, atol=1e-3 * size[1] * np.abs(driven).max())


def test_means_of_blocks_weigh_readings_and_bridge_holes():
    """Two readings a block, of which one hole lies on the line between its neighbours with a usual weight."""
    time = np.arange(8.0)
    residual, weight = np.array([[1.0, 3.0, 0.0, 0.0, 7.0, 9.0, 4.0, 8.0]]), np.array([[1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 3.0, 1.0]])
    other = np.ones((1, 8))
    means, weights = block_means(np.concatenate([residual, residual]), np.concatenate([weight, other]), time, 4)
    place = np.clip((time / 7.0 * 3.0 + 0.5).astype(int), 0, 3)
    for b in range(4):
        assert weights[1, b] == (place == b).sum()
        assert means[1, b] == pytest.approx(residual[0, place == b].mean())
    # The second block has no reading: half way from 2 to 8, and of the median weight of 2, 2 and 4.
    np.testing.assert_allclose(means[0], [2.0, 5.0, 8.0, 5.0])
    assert weights[0].tolist() == [2.0, 2.0, 2.0, 4.0]


def test_noise_of_few_readings_and_of_steps():
    """1.4826 times the median deviation of the steps over root two; none of less than three readings."""
    reading = np.array([0.0, 1.0, 3.0, 6.0, 10.0])  # steps 1, 2, 3, 4 about 2.5: 1.5, 0.5, 0.5, 1.5
    assert difference_noise(reading) == pytest.approx(1.4826 * 1.0 / math.sqrt(2.0))
    assert difference_noise(reading[:3]) == pytest.approx(1.4826 * 0.5 / math.sqrt(2.0))
    assert difference_noise(reading[:2]) == 0.0
    assert third_difference_noise(reading) == difference_noise(reading)
    np.testing.assert_allclose(
        difference_noise(np.array([reading, 2.0 * reading])), [difference_noise(reading), 2 * difference_noise(reading)]
    )


@pytest.mark.parametrize("n", [2, 3, 4, 5, 40, 41])
def test_what_exceeds_the_noise_of_differences_is_what_is_larger_than_it(n):
    """By the noise itself, of many records, and of sizes just beside it, where as many differences lie above as below."""
    rng = np.random.default_rng(n)
    reading = np.round(rng.standard_normal((200, n)), 1)
    noise = difference_noise(reading)
    for size in (noise * (1.0 - 1e-9) - 1e-12, noise * (1.0 + 1e-9) + 1e-12, rng.uniform(0.0, 2.0, 200), np.full(200, -1.0)):
        np.testing.assert_array_equal(exceeds_difference_noise(reading, size), size > noise)


def test_dependence_of_many_records_is_that_of_each():
    rng = np.random.default_rng(4)
    residual = np.array([np.convolve(rng.standard_normal(60 + k), np.ones(k), "valid")[:60] for k in range(1, 9)] + [np.zeros(60)])
    together = variance_inflation(residual)
    np.testing.assert_allclose(together, [variance_inflation(line) for line in residual], rtol=1e-12)
    assert together[-1] == 1.0 < together[3] < together[7]
    used = np.ones(residual.shape, dtype=bool)
    used[2, ::7], used[4] = False, False  # of two records some readings count, or none
    found = variance_inflations(residual, used)
    assert found[2] == pytest.approx(variance_inflation(residual[2][used[2]])) != together[2]
    assert np.isnan(found[4])
    others = [0, 1, 3, 5, 6, 7, 8]
    np.testing.assert_allclose(found[others], together[others], rtol=1e-12)


def test_readings_that_are_out_lie_on_the_line_between_their_neighbours():
    """In time, not in number; a row without any other reading is left as it is."""
    time, reading = np.array([0.0, 1.0, 4.0, 5.0]), np.array([[0.0, 9.0, 8.0, 10.0], [1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0]])
    out = np.array([[False, True, False, False], [True] * 4, [False] * 4])
    np.testing.assert_allclose(bridged(time, reading, out), [[0.0, 2.0, 8.0, 10.0], *reading[1:]])
    assert reading[0, 1] == 9.0


def test_dependent_readings_count_by_their_autocorrelations():
    """1 + 2 sum up to the first below 0.05, by numpy; at least one and at most a quarter of them."""
    assert variance_inflation(np.ones(20)) == 5.0
    assert variance_inflation(np.ones(7)) == 1.0
    assert variance_inflation(np.tile([1.0, -1.0], 10)) == 1.0
    residual = np.convolve(np.random.default_rng(3).standard_normal(300), np.ones(6), "valid")
    rho = np.correlate(residual, residual, "full")[len(residual) :] / (residual @ residual)
    assert variance_inflation(residual) == pytest.approx(1.0 + 2.0 * rho[: np.flatnonzero(rho < 0.05)[0]].sum())


def test_patterns_need_twelve_readings_and_long_records_are_averaged():
    """Blocks are means of stretches as equal as they can be."""
    assert np.isnan(pattern_p_value(np.ones(11), np.ones((11, 1))))
    assert np.isfinite(pattern_p_value(np.ones(12), np.ones((12, 1))))
    assert pattern_p_value(np.zeros(20), np.ones((20, 1))) == 1.0
    residual, edges = np.random.default_rng(7).standard_normal(1501), (np.arange(1001) * 1.501).astype(int)
    means = np.array([residual[a:b].mean() for a, b in itertools.pairwise(edges)])
    assert pattern_p_value(residual, np.ones((1501, 1))) == pytest.approx(pattern_p_value(means, np.ones((1000, 1))))


def test_a_switch_off_needs_eight_readings():
    """And is that of the curve where there is hardly any noise."""
    time = np.linspace(1.0, 60.0, 40)
    reading = 20.0 + 50.0 * np.exp(-time / 30.0) + 1e-3 * np.random.default_rng(4).standard_normal(40)
    assert temperature_at_switch_off(time[:7], reading[:7], 0.0) is None
    assert temperature_at_switch_off(time[:8], reading[:8], 0.0) is not None


def test_constants_of_a_machine_are_pooled_as_dersimonian_and_laird_have_it():
    """Of four runs: the usual scatter of 0.06 counts as four of them beside what they show; chance by chi-squared."""
    value, variance = np.array([0.0, 0.3, 0.1, 0.6]), np.array([0.01, 0.02, 0.01, 0.04])
    mean, error, scatter, p = (v[0] for v in _pooled(value[:, None], variance[:, None], np.array([True])))
    w = 1.0 / variance
    q = w @ (value - w @ value / w.sum()) ** 2
    between = max((q - 3.0) / (w.sum() - (w**2).sum() / w.sum()), 0.0)
    assert between > 0.0
    assert p == pytest.approx(stats.chi2.sf(q, 3))
    assert scatter == pytest.approx(math.sqrt((4.0 * 0.06**2 + 3.0 * between) / 7.0))
    w = 1.0 / (variance + scatter**2)
    assert mean == pytest.approx(w @ value / w.sum())
    assert error == pytest.approx(w.sum() ** -0.5)
    # One run alone disagrees with nothing; what is no logarithm scatters by a share of itself.
    lone = [v[0] for v in _pooled(np.array([[-50.0]]), np.array([[4.0]]), np.array([False]))]
    assert lone[0] == -50.0
    assert lone[1:] == [pytest.approx(math.sqrt(4.0 + 9.0)), pytest.approx(3.0), 1.0]


def warm(share, shape):
    """A room that moves by a share of the sensors' 20 K, in a shape of the time."""
    warmth = -np.expm1(-np.arange(200.0) / 40.0)
    warmth /= np.median(warmth[-10:]) - np.median(warmth[:10])
    return follows_machine(20.0 + np.array([20.0, 20.0])[:, None] * warmth, 20.0 + 20.0 * share * shape(np.arange(200.0), warmth))


@pytest.mark.parametrize(
    ("share", "shape", "follows"),
    [
        (0.45, lambda time, warmth: warmth, True),
        (0.35, lambda time, warmth: warmth, False),  # less than 0.4 of the rise so far
        (0.6, lambda time, warmth: time / 190.0, False),  # a room that drifts evenly
        (0.6, lambda time, warmth: np.where(time > 100.0, 1.0, 0.0), False),  # a door
    ],
)
def test_a_logged_room_that_is_warmed_by_the_machine(share, shape, follows):
    """It moves by more than 0.4 of the rise, in the machine's own shape."""
    assert warm(share, shape) is follows


def test_a_room_that_moves_by_less_than_1_k_is_none_that_is_warmed():
    """However little the machine warms."""
    warmth = -np.expm1(-np.arange(200.0) / 40.0)
    for rise, follows in ((0.95, False), (1.2, True)):
        assert follows_machine(20.0 + rise * np.array([warmth, warmth]), 20.0 + rise * warmth) is follows


def test_nothing_moves_before_the_last_reading_of_a_room_nor_where_it_is_not_known():
    """Eight readings tell a little; a path starts from where the room is."""
    when, rate = np.arange(8.0), np.array([0.05, np.inf])
    room = 20.0 + 0.1 * when
    for known, until in ((8, 7.0), (7, 60.0)):
        mean, deviation = room_ahead(when[:known], room[:known], rate, until)
        assert not mean.any()
        assert not deviation.any()
    assert (room_ahead(when, room, rate, 60.0)[1] > 0.0).all()
    paths = room_paths(when, room, rate, np.array([3.0, 7.0, 60.0]), 200)
    assert not paths[:, :, :2].any()
    assert paths[:, :, 2].std(axis=1) == pytest.approx(room_ahead(when, room, rate, 60.0)[1], rel=0.2)


def test_a_swing_is_nought_on_the_mean_over_a_cycle_and_reaches_its_ends():
    """3 K of the first harmonic from 5 min on, every 10 min."""
    swing = Swing(10.0, 5.0, np.array([[3.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 2.0]]), np.array([True, True]))
    np.testing.assert_allclose(
        swing.at(np.array([5.0, 7.5, 10.0, 15.0])), [[3.0, 0.0, -3.0, 3.0], [0.0, 0.0, 0.0, 0.0]], atol=1e-12
    )
    np.testing.assert_allclose(swing.at(np.array([6.25]))[1], 2.0 * math.sin(math.pi / 2.0))  # the second harmonic: twice as fast
    low, high = swing.ends()
    np.testing.assert_allclose([low, high], [[-3.0, -2.0], [3.0, 2.0]], rtol=2e-3)
    assert swing.at(np.linspace(0.0, 10.0, 100, endpoint=False)).mean(axis=1) == pytest.approx(0.0, abs=1e-12)


def test_points_and_harmonics_of_a_swing():
    """At most 480 means of neighbours; four points a harmonic, one at least and eight at most."""
    x = np.arange(960.0)
    at, line = _fewer(x, np.array([x, 2.0 * x]))
    np.testing.assert_array_equal(at, 2.0 * np.arange(480) + 0.5)
    np.testing.assert_array_equal(line, [at, 2.0 * at])
    assert len(_fewer(x[:480], x[None, :480])[0]) == 480
    assert [_count(n, 10.0) for n in (20, 80, 119, 120, 2000)] == [1, 2, 2, 3, 8]
    turns = np.array([0.1, 0.7])
    np.testing.assert_allclose(_harmonics(turns, 2), [f(2.0 * np.pi * k * turns) for f in (np.cos, np.sin) for k in (1, 2)])


def test_noise_from_third_differences():
    """Readings that go to and fro have +-8 of them: 1.4826 times that over root 20, whatever parabola they lie on."""
    time = np.arange(13.0)
    fro = np.where(time % 2 == 0.0, 1.0, -1.0)
    assert third_difference_noise(fro) == pytest.approx(1.4826 * 8.0 / math.sqrt(20.0))
    assert third_difference_noise(fro + 0.1 * time**2) == pytest.approx(1.4826 * 8.0 / math.sqrt(20.0))
    assert third_difference_noise(fro + 0.1 * time**2, 7.0 * time) == pytest.approx(1.4826 * 8.0 / math.sqrt(20.0))
    assert third_difference_noise(time[:8] ** 2) == 0.0
    assert third_difference_noise(time[:7] ** 2) == difference_noise(time[:7] ** 2) > 0.0


def test_noise_of_readings_in_coarse_steps_is_that_of_the_differences_up_to_a_twentieth_of_their_range():
    """A step of one leaves 1, -2, 1; a median of them is nought."""
    reading = np.repeat(np.arange(41.0), 10)
    assert third_difference_noise(reading) == pytest.approx(math.sqrt(40 * 6.0 / 407 / 20.0))
    assert third_difference_noise(reading[:390]) == pytest.approx(math.sqrt(38 * 2.0 / (387 - 38) / 20.0))  # 2 is more than 38 / 20


def pattern(residual, tangent, slack=0.0):
    """The two looks of pattern_p_value by least squares and scipy."""
    n, m = len(residual), tangent.shape[1]
    count = min(8, n // 6)
    cosines = np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(1, count + 1)) / n)
    left = [
        float(np.sum((residual - a @ np.linalg.lstsq(a, residual, rcond=None)[0]) ** 2))
        for a in (tangent, np.hstack([tangent, cosines]))
    ]
    total = float(residual @ residual)
    explained, rest = left[0] - left[1], n - m - count
    slow = stats.f.sf(explained / count / ((total - explained) / rest) / (1.0 + slack), count, rest)
    lag_one = residual[1:] @ residual[:-1] / total + m / n
    fast = stats.norm.sf((lag_one - 0.02 * slack) * math.sqrt(n))
    return min(1.0, 2.0 * min(slow, fast)), slow < fast


@pytest.mark.parametrize(("n", "memory"), [(60, 0.0), (30, 0.3), (60, 0.4), (12, 0.0)])
def test_a_pattern_is_seen_by_cosines_and_by_neighbours(n, memory):
    """An F test of up to eight cosines and the lag-one correlation, each at half the level; slack takes from both."""
    rng, seen = np.random.default_rng(5), set()
    for _ in range(8):
        noise = rng.standard_normal(n + 1)
        tangent = np.column_stack([np.ones(n), np.exp(-np.arange(n) / n)])
        residual = noise[1:] + memory * noise[:-1]
        residual -= tangent @ np.linalg.lstsq(tangent, residual, rcond=None)[0]
        for slack in (0.0, 2.0):
            p, by_cosines = pattern(residual, tangent, slack)
            seen.add(by_cosines)
            assert pattern_p_value(residual, tangent, slack) == pytest.approx(p, rel=1e-5)
    assert len(seen) == 2 or n == 12


def test_a_long_record_shows_the_pattern_of_its_means():
    """Of 3000 readings a thousand means of three; of several fits each by itself."""
    residual = np.random.default_rng(6).standard_normal((2, 3000))
    tangent = np.stack([np.ones((3000, 1)), np.linspace(0.0, 1.0, 3000)[:, None]])
    means = residual.reshape(2, 1000, 3).mean(axis=2), tangent.reshape(2, 1000, 3, 1).mean(axis=2)
    np.testing.assert_allclose(pattern_p_value(residual, tangent), [pattern_p_value(r, t) for r, t in zip(*means, strict=True)])


def test_a_disturbance_is_the_sum_of_own_and_shared_columns():
    """An amplitude of a sensor moves that sensor, a shared one all of them."""
    columns = Columns(np.array([[[1.0, 2.0], [3.0, 4.0]]]), np.array([[[10.0, 20.0], [30.0, 40.0]]]))
    found = columns.discrepancy(np.array([[1.0], [-1.0]]), np.array([0.5]))
    np.testing.assert_allclose(found, [[6.0, 12.0], [12.0, 16.0]])
    assert Columns.none(3, 5).discrepancy(np.zeros((3, 0)), np.zeros(0)).tolist() == np.zeros((3, 5)).tolist()
    assert Flutter(1.0).covariance(np.zeros(1), np.array([30.0]))[0, 0] == pytest.approx(1.0 / math.e)


@pytest.fixture
def arrow():
    """Normal equations of two sensors with two constants each and two shared ones, as an arrow and as one matrix."""
    rng = np.random.default_rng(8)
    by_local, by_shared = rng.standard_normal((2, 2, 9)), rng.standard_normal((2, 2, 9))
    residual, weight = rng.standard_normal((2, 9)), rng.uniform(0.5, 2.0, (2, 9))
    prior = Prior(
        rng.standard_normal((2, 2)),
        np.array([np.diag([1.0, 2.0]), np.diag([3.0, 0.5])]),
        rng.standard_normal(2),
        np.diag([1.5, 0.7]),
    )
    at, common = rng.standard_normal((2, 2)), rng.standard_normal(2)
    told = assemble(by_local, by_shared, residual, weight, np.ones((2, 2), dtype=bool), prior, at, common)
    slopes = np.zeros((6, 18))
    slopes[:2, :9], slopes[2:4, 9:], slopes[4:] = by_local[:, 0], by_local[:, 1], by_shared.reshape(2, 18)
    known = np.diag([1.0, 2.0, 3.0, 0.5, 1.5, 0.7])
    matrix = slopes * weight.ravel() @ slopes.T + known
    off = np.concatenate([(prior.local - at).ravel(), prior.shared - common])
    return told, matrix, slopes @ (weight * residual).ravel() + known @ off


def test_an_arrow_is_the_matrix_of_all_parameters(arrow):
    """Its inverse is that of the whole, block by block, and a step without damping the solution."""
    (blocks, border, corner, right, right_shared), matrix, side = arrow
    inverse, every = np.linalg.inv(matrix), np.ones((2, 2), dtype=bool)
    local, shared, cross = arrow_inverse(blocks, border, corner, every)
    np.testing.assert_allclose(local, [inverse[:2, :2], inverse[2:4, 2:4]], rtol=1e-6)
    np.testing.assert_allclose(shared, inverse[4:, 4:], rtol=1e-6)
    np.testing.assert_allclose(cross.reshape(4, 2), inverse[:4, 4:], rtol=1e-6, atol=1e-9)
    step, common = arrow_step(blocks, border, corner, right, right_shared, ~every, np.zeros(2, dtype=bool), np.zeros(2))
    np.testing.assert_allclose(np.concatenate([step.ravel(), common]), np.linalg.solve(matrix, side), rtol=1e-6)


def test_a_damped_step_and_parameters_that_are_stuck(arrow):
    """Damping adds to each diagonal its own share (Marquardt); what is stuck does not move, and the others as if it were known."""
    (blocks, border, corner, right, right_shared), matrix, side = arrow
    free, damping = np.array([True, False, True, True, True, True]), np.array([0.3, 0.3])
    stuck = ~free[:4].reshape(2, 2)
    step, common = arrow_step(blocks, border, corner, right, right_shared, stuck, np.zeros(2, dtype=bool), damping)
    damped = (matrix + 0.3 * np.diag(np.diag(matrix)))[np.ix_(free, free)]
    exact = np.zeros(6)
    exact[free] = np.linalg.solve(damped, side[free])
    np.testing.assert_allclose(np.concatenate([step.ravel(), common]), exact, rtol=1e-6, atol=1e-12)


def test_a_factor_of_a_covariance_and_slopes_beyond_all_numbers():
    """A variance that rounding made negative is nought."""
    covariance = np.array([[4.0, 2.0], [2.0, 1.0 - 1e-12]])
    root = covariance_root(covariance)
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-9)
    fine = np.array([1.0, -2.0])
    assert finite_slopes(fine) is fine
    assert finite_slopes(np.array([np.nan, np.inf, -1e200, 3.0])).tolist() == [0.0, 1e100, -1e100, 3.0]


def test_blocks_that_are_held_out_cover_what_is_used_but_the_very_beginning():
    """Eight of equal length, the first without its first third; none of fewer than three readings a block."""
    time = np.arange(48.0)
    blocks = held_out_blocks(SimpleNamespace(time=time, used=np.ones((2, 48), dtype=bool)))
    assert [np.flatnonzero(b)[[0, -1]].tolist() for b in blocks] == [[2, 5], *([6 * k, 6 * k + 5] for k in range(1, 8))]
    assert held_out_blocks(SimpleNamespace(time=time[:23], used=np.ones((1, 23), dtype=bool))) == []
    assert len(held_out_blocks(SimpleNamespace(time=time[:24], used=np.ones((1, 24), dtype=bool)))) == 8


@pytest.mark.parametrize("n", [120, 121])
def test_a_line_of_the_highest_frequency_is_seen_of_odd_and_even_many_readings(n):
    """Every frequency between nought and that of every other reading counts."""
    k = (n - 1) // 2
    noise = np.random.default_rng(1).standard_normal(n)
    p, period = spectral_line(noise + 2.0 * np.cos(2.0 * np.pi * k * np.arange(n) / n))
    assert p < 1e-12
    assert period == pytest.approx(n / k)


def test_what_remains_ends_with_the_record():
    """The last fifth of an hour that begins at 10 min ends at 70."""
    time = np.arange(0.0, 61.0, 2.0)
    residual = np.where(time > 48.0, 1.0, 0.0)[None]
    run = SimpleNamespace(weight=np.ones_like(residual), time=time, clock=10.0 + time, used=np.ones_like(residual, dtype=bool))
    assert _stretch(SimpleNamespace(residual=residual, run=run)) == "most of it from 60 to 70 min"


def test_a_limit_many_times_farther_than_all_that_was_read_is_no_number():
    time = np.arange(0.0, 60.0)
    went = np.array([1.0, 1.0, -1.0])
    reading = 20.0 + went[:, None] * time / 59.0
    law = SimpleNamespace(state=reading[:, -1:], initial=reading[:, 0], noise=np.full(3, 0.01))
    steady = np.array([[15.0, 25.0, 70.0], [30.0, 80.0, 90.0], [-40.0, 15.0, 18.0]])
    t95 = np.tile([50.0, 100.0, 500.0], (3, 1))
    _without_endless(steady, t95, law, np.ones(3))
    nan = math.nan
    assert steady == pytest.approx(np.array([[15.0, 25.0, 70.0], [30.0, nan, nan], [nan, 15.0, 18.0]]), nan_ok=True)
    assert t95 == pytest.approx(np.array([[50.0, 100.0, 500.0], [nan, nan, nan], [50.0, 100.0, nan]]), nan_ok=True)


def test_sensors_that_warm_each_other_without_end_stop_being_run():
    """Without a warning, and without a second round of numbers that are none."""
    rounds = []

    def forward(curves):
        rounds.append(curves)
        with np.errstate(over="ignore"):
            return curves * 1e200

    with np.errstate(all="raise"):
        found = relaxed(np.ones((2, 3)), forward)
    assert np.isinf(found).all()
    assert len(rounds) == 2


def test_a_name_is_guarded_where_a_spreadsheet_reads_it_and_shown_as_it_is_on_a_screen():
    assert short("=1+2") == "=1+2"
    assert cell("=1+2") == "'=1+2"
