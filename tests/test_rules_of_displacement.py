"""Rules of displacement from temperatures and of stopping rules, by numpy, scipy or a small table."""

import math

import numpy as np
import pytest
from scipy import stats

from thermofast.models.displacement import by_minute, fits, scoring
from thermofast.models.displacement.sample import Sample
from thermofast.models.standards import three_point
from thermofast.models.standards.criteria import Criterion, criterion_from


def _sample(minutes, run, displacement):
    return Sample(np.zeros((len(run), 1)), np.array(displacement, dtype=float), np.array(minutes, dtype=float), np.array(run))


def test_a_clock_knows_the_mean_of_the_other_runs_at_a_minute():
    """Between their readings on a straight line, beyond the last as at it."""
    sample = _sample([0, 10, 0, 20, 0, 5, 30], [0, 0, 1, 1, 2, 2, 2], [0, 10, 2, 6, 0, 0, 0])
    out = sample.run == 2
    assert scoring._clock(sample, ~out, out) == pytest.approx([1.0, 0.5 * (5.0 + 3.0), 0.5 * (10.0 + 6.0)])


def test_across_a_block_goes_a_line_from_five_readings_before_to_five_after():
    """Level where there are none on one side."""
    sample = Sample.of(np.zeros((30, 1)), np.r_[np.zeros(5), np.ones(5), np.full(10, 9.0), np.full(5, 3.0), np.full(5, 7.0)])
    out = (np.arange(30) >= 10) & (np.arange(30) < 20)
    assert scoring._across(sample, ~out, out) == pytest.approx(1.0 + 2.0 * (np.arange(10.0, 20.0) - 7.0) / 15.0)
    for out, level in ((np.arange(30) < 10, 9.0), (np.arange(30) >= 20, 9.0)):
        assert scoring._across(sample, ~out, out) == pytest.approx(np.full(10, level))


def test_chance_is_scipys_t_test_on_the_logarithms_of_errors():
    """One-sided; of errors that are all alike by the sign alone."""
    squares, rival = np.array([1.0, 2.0, 4.0, 3.0]), np.array([2.0, 2.5, 3.0, 9.0])
    truth = stats.ttest_1samp(np.log(rival / squares), 0.0, alternative="greater").pvalue
    assert scoring._chance(squares, rival) == pytest.approx(truth, rel=1e-6)
    ones = np.ones(4)
    assert [scoring._chance(ones, ones * f) for f in (2.0, 0.5, 1.0)] == [0.0, 1.0, 1.0]


def _score(rmse=1.0, mean=2.0, time=3.0, coverage=0.9, gain=4.0):
    squares = np.array([1.0, 1.1, 0.9, 1.05])
    return scoring.Score(rmse, mean, time, coverage, squares, squares * np.array([gain, 1.1 * gain, gain, 0.9 * gain]), None)


@pytest.mark.parametrize(
    ("own", "why"),
    [
        (_score(), ""),
        (_score(rmse=1.39), ""),
        (_score(rmse=1.41), "error 1.41 um on readings left out, their mean alone gives 2 um"),
        (_score(rmse=1.41, mean=4.0, time=2.0), "error 1.41 um on readings left out, a straight line in time alone gives 2 um"),
        (_score(rmse=0.0, mean=1e-6), "the displacement does not move"),
        (_score(rmse=0.0, mean=1.1e-6), ""),
        (_score(gain=0.5), "the readings left out do not agree that it helps (chance 1)"),
        (_score(coverage=0.85), ""),
        (_score(coverage=0.84), "its 95 % interval holds 84 % of the readings left out"),
    ],
)
def test_what_a_displacement_model_is_doubted_for(own, why):
    """Seven tenths of the better rival's error, blocks that agree, and 85 % inside."""
    assert scoring._doubt(own) == why


def test_the_plainest_of_nearly_equal_methods_is_trusted():
    """An earlier one whose error is within a ninth of the least; a doubted one is none, and is told of."""
    scores = {"a": _score(rmse=1.1), "b": _score(rmse=1.0), "c": _score(rmse=0.5, coverage=0.5)}
    found = scoring.verdict(scores)
    assert found.choice == "a"
    assert found.reason == (
        "error 1.1 um on readings left out, against 2 um without temperatures; its 95 % interval holds 90 %; b 1 um; "
        "not c: its 95 % interval holds 50 % of the readings left out"
    )
    assert scoring.verdict({"a": _score(rmse=1.12), "b": _score(rmse=1.0)}).choice == "b"
    assert scoring.verdict({"c": scores["c"]}).reason == "c: its 95 % interval holds 50 % of the readings left out"
    assert scoring.verdict({}).reason == "no method could be tried"


def test_runs_and_readings_that_are_needed():
    """80 readings; three runs, or one."""
    for n, run, why in ((79, 0, "80 are needed"), (80, 1, "3 are needed")):
        with pytest.raises(ValueError, match=why):
            scoring.too_few(_sample(np.arange(n), np.arange(n) % (1 + run), np.zeros(n)))
    scoring.too_few(_sample(np.arange(80), np.zeros(80, int), np.zeros(80)))
    scoring.too_few(_sample(np.arange(80), np.arange(80) % 3, np.zeros(80)))


def test_whole_runs_are_left_out_in_ten_folds_at_most():
    """Of 21 runs two or three together; each reading once."""
    for runs, folds in ((3, 3), (10, 10), (21, 10)):
        sample = _sample(np.zeros(3 * runs), np.repeat(np.arange(runs), 3), np.zeros(3 * runs))
        found = sample.folds()
        assert len(found) == folds
        assert np.sum([out for _, out in found], axis=0).tolist() == [1] * (3 * runs)
        assert all((left != out).all() for left, out in found)
        assert sample.runs == runs
    assert len(_sample(np.zeros(80), np.zeros(80, int), np.zeros(80)).folds()) == 8


def test_a_score_is_the_error_on_what_was_left_out():
    """Of a method that says the mean of what it may use, with a deviation of one."""
    rng = np.random.default_rng(7)
    sample = Sample.of(np.zeros((160, 1)), rng.standard_normal(160))

    def method(sample, used):
        return fits.Prediction(np.full(160, sample.displacement[used].mean()), np.ones(160), "a note")

    found = scoring.score(sample, method)
    told = np.empty(160)
    for left_in, out in sample.folds():
        told[out] = sample.displacement[left_in].mean()
    error = told - sample.displacement
    assert found.rmse == found.mean_rmse == pytest.approx(math.sqrt(np.mean(error**2)))
    assert found.coverage == pytest.approx(np.mean(np.abs(error) <= 1.959964))
    assert found.squares == pytest.approx([np.mean(error[out] ** 2) for _, out in sample.folds()])
    assert found.rival_squares == pytest.approx(found.squares)
    assert (found.prediction.note, found.rival_rmse) == ("a note", found.mean_rmse)
    assert scoring.later_coverage(sample, method) == pytest.approx(
        np.mean(np.abs(sample.displacement[120:] - sample.displacement[:120].mean()) <= 1.959964)
    )


def test_intervals_are_calibrated_by_quantile_or_spread():
    """The larger of both."""
    many = stats.norm.ppf((np.arange(2000) + 0.5) / 2000)
    assert fits.calibrated(2.0 * many) == pytest.approx(2.0, rel=0.01)
    assert fits.calibrated(np.r_[np.zeros(99), 100.0]) == pytest.approx(10.0)
    assert fits.calibrated(np.r_[np.full(90, 0.1), np.full(10, 1.0)]) == pytest.approx(1.0 / 1.959964)


def test_the_smallest_size_within_a_fiftieth_of_the_least_error_is_taken():
    """In squares."""
    assert fits._least({4: 1.02, 6: 1.0}) == 4
    assert fits._least({4: 1.03, 6: 1.0}) == 6
    assert fits._least({4: 2.0, 6: 1.01, 9: 1.0, 14: 1.0}) == 6


def test_columns_that_stand_still_have_an_endless_scale():
    """Relative to where they stand."""
    centre, scale = fits.standard(np.array([[1.0, 1e6, 0.0], [3.0, 1e6 + 1e-4, 0.0]]))
    assert centre == pytest.approx([2.0, 1e6, 0.0])
    assert scale.tolist() == [1.0, math.inf, math.inf]


def test_leverage_grows_with_the_distance_from_what_was_fitted():
    """One over the readings, 80 at most, at the centre; a deviation off twice that."""
    for readings, counted in ((40, 40.0), (500, 80.0)):
        model = fits.LinearModel(np.array([20.0]), np.array([3.0]), 5.0, np.array([[0.5]]), readings, 2.0)
        at = np.array([[20.0], [22.0], [26.0]])
        assert model.leverage(at) == pytest.approx(np.array([1.0, 2.0, 10.0]) / counted)
        told = model.predict(at)
        assert told.mean == pytest.approx([5.0, 11.0, 23.0])
        assert told.deviation == pytest.approx(2.0 * np.sqrt(1.0 + np.array([1.0, 2.0, 10.0]) / counted))


def test_a_class_has_the_moments_of_its_readings_and_one_even_one():
    """Of readings 1 and 3 in a class from 0 to 4: mean 2; variance (16 / 12 + 0 + 2) / 3; an empty one is even."""
    mean, variance = fits._class_moments(np.array([1.0, 3.0]), np.array([0, 0]), np.array([0.0, 4.0, 8.0]))
    assert mean == pytest.approx([2.0, 6.0])
    assert variance == pytest.approx([(16.0 / 12.0 + 2.0) / 3.0, 16.0 / 12.0])
    mean, variance = fits._class_moments(np.array([3.0]), np.array([0]), np.array([0.0, 4.0]))
    assert (mean[0], variance[0]) == pytest.approx((2.5, (16.0 / 12.0 + 0.25 + 0.25) / 2.0))


def test_a_network_answers_by_its_parents_as_far_as_they_are_in_their_domain():
    """Joint states count the first parent first; one outside is not read, nor those behind it."""
    edges = np.array([[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]])
    tables = (
        np.array([[0.5, 0.5]]),
        np.array([[0.9, 0.1], [0.2, 0.8]]),
        np.array([[1.0, 0.0], [0.7, 0.3], [0.4, 0.6], [0.0, 1.0]]),
    )
    model = fits.NetworkModel((1, 0), edges, np.array([0.0, 1.0, 2.0]), np.array([0.0, 10.0]), np.array([1.0, 4.0]), tables, 2.0)
    at = np.array([[1.5, 0.5], [0.5, 1.5], [9.0, 0.5], [0.5, 9.0]])
    assert model.probabilities(at)[:, 1].tolist() == [0.3, 0.6, 0.1, 0.5]
    told = model.predict(at[:1])
    assert told.mean[0] == pytest.approx(3.0)
    assert told.deviation[0] == pytest.approx(2.0 * math.sqrt(0.7 * (1.0 + 9.0) + 0.3 * (4.0 + 49.0)))


def test_the_table_of_a_minute_tells_the_middle_of_the_likeliest_class():
    """Where all are alike the middle of all; parents beyond what was seen count as at its edge."""
    parents, displacement = np.array([[0.0], [0.5], [3.0], [3.0]]), np.array([0.0, 0.4, 5.9, 6.0])
    told = by_minute._tables(parents, displacement, np.array([[-9.0], [0.2], [1.5], [2.9], [9.0]]))
    assert told == pytest.approx([0.5, 0.5, 3.0, 5.5, 5.5], abs=1e-6)
    sample = _sample([0, 10, 0, 20], [0, 0, 1, 1], [0, 10, 2, 6])
    assert by_minute._at(sample, np.array([2, 3]), sample.displacement[:, None], np.array([5.0, 30.0])).tolist() == [[3.0], [6.0]]


def test_three_points_lead_to_the_end_of_a_falling_exponential_too():
    """Halved each time: 8, 4, 2 leads to 0; one that does not bend, or stands still, to nothing."""
    assert three_point(np.array([8.0]), np.array([4.0]), np.array([2.0]))[0] == pytest.approx(0.0)
    assert np.isnan(
        three_point(np.array([8.0, 8.0, 8.0, 8.0]), np.array([4.0, 4.0, 8.0, 4.0]), np.array([0.0, 4.0, 9.0, 6.0]))
    ).all()


RULE = Criterion("own", "own", 2.0, 60.0, 2, 0.0)


def test_a_rule_is_looked_at_sixty_times_a_window_up_to_the_last_reading():
    """Its length counts the hold."""
    assert RULE.times(5.0, 8.0).tolist() == [5.0, 6.0, 7.0, 8.0]
    assert RULE.times(5.0, 7.9).tolist() == [5.0, 6.0, 7.0]
    assert (RULE.length_min, criterion_from("1K/h + 3h").length_min) == (120.0, 240.0)


def test_the_worst_change_is_that_of_both_windows_and_of_the_hold():
    """A line of 1 K in 30 min that goes twice as fast from the 100th minute on."""
    time = np.arange(201.0)
    curve = np.where(time < 100.0, time / 30.0, 100.0 / 30.0 + (time - 100.0) / 15.0)
    at, worst = RULE.worst(time, curve)
    assert at.tolist() == list(range(120, 201))
    assert worst[0] == pytest.approx((100.0 + 2.0 * 20.0 - 60.0) / 30.0)
    assert worst[-1] == pytest.approx(4.0)
    held = Criterion("own", "own", 2.0, 60.0, 1, 30.0)
    at, worst = held.worst(time[:131], -curve[:131])
    assert at.tolist() == list(range(90, 131))
    assert worst[[0, -1]] == pytest.approx([2.0, 3.0])
    for rule, n in ((RULE, 120), (held, 90)):
        assert len(rule.worst(time[:n], curve[:n])[0]) == 0
        assert len(rule.worst(time[: n + 1], curve[: n + 1])[0]) == 1


def test_a_rule_trips_between_two_points_where_a_straight_line_crosses_it():
    """A worst change that falls from 2.5 to 1.5 K comes to 2 half-way; since a time, and since the largest change."""
    assert RULE._crossed(np.array([0.0, 10.0]), np.array([2.5, 1.5]), np.array(1)) == pytest.approx(5.0)
    assert RULE._crossed(np.array([0.0, 10.0]), np.array([1.0, 1.5]), np.array(1)) == 10.0
    assert RULE._crossed(np.array([0.0, 10.0]), np.array([1.5, 1.0]), np.array(0)) == 0.0
    time = np.arange(0.0, 601.0)
    curve = np.where(time < 200.0, 0.0, 20.0 - 20.0 * np.exp(-(time - 200.0) / 50.0))
    single = Criterion("own", "own", 2.0, 60.0)
    there = 200.0 + 60.0 + 50.0 * math.log(10.0 * (1.0 - math.exp(-1.2)) * math.exp(1.2)) - 60.0
    assert single.trips(time, curve) == 60.0
    assert single.trips(time, curve, since=None) == pytest.approx(there, abs=0.1)
    assert single.trips(time, curve, since=250.0) == pytest.approx(there, abs=0.1)
    assert single.trips(time[:240], curve[:240], since=None) == math.inf
    assert single.trips(time[:50], curve[:50]) == math.inf


def test_a_gap_longer_than_a_window_is_unread():
    """63 min at 60; its ends are not."""
    at = np.array([0.0, 0.5, 100.0])
    assert RULE.unread(np.array([0.0, 63.1, 200.0]), at).tolist() == [False, True, True]
    assert RULE.unread(np.array([0.0, 62.9, 100.0, 101.0]), at).tolist() == [False, False, False]
    assert RULE.unread(np.array([0.0, 80.0]), np.array([-1.0, 0.0, 80.0, 81.0])).tolist() == [False] * 4


def test_readings_hide_a_change_by_their_noise_or_by_steps_that_it_does_not_dither():
    """Means of a tenth of 60 min: of six readings a minute apart; 0.1 K is a twentieth of 2 K."""
    time = np.arange(100.0)
    limit = 0.1 / math.sqrt(2.0) * math.sqrt(6.0)
    assert RULE.hidden(time, limit * np.array([0.99, 1.01]), np.zeros(2)).tolist() == [False, True]
    assert RULE.hidden(10.0 * time, 0.1 / math.sqrt(2.0) * np.array([0.99, 1.01]), np.zeros(2)).tolist() == [False, True]
    step = 0.1 / math.sqrt(2.0) * math.sqrt(12.0)
    assert RULE.hidden(time, np.full(2, 1e-9), step * np.array([0.99, 1.01])).tolist() == [False, True]
    assert RULE.hidden(time, np.array([0.39, 0.41]) * 0.3, np.full(2, 0.3)).tolist() == [True, False]
    assert not RULE.hidden(time[:1], np.array([0.05]), np.zeros(1))[0]


def test_means_of_readings_on_a_line_are_the_line():
    """However they are spaced; nothing in a long gap."""
    rng = np.random.default_rng(8)
    time = np.sort(rng.uniform(0.0, 300.0, 700))
    at, mean = RULE.means(time, 20.0 + 0.01 * time, float(time[0]))
    assert mean == pytest.approx(20.0 + 0.01 * at, abs=2e-3)
    at, mean = RULE.means(np.r_[np.arange(100.0), np.arange(170.0, 300.0)], np.zeros(230), 0.0)
    assert np.isnan(mean).tolist() == [bool(99.0 < t < 170.0) for t in at]
    assert len(RULE.means(np.arange(120.0), np.zeros(120), 0.0)[0]) == 0


def test_all_sensors_keep_to_a_rule_together_when_the_last_does():
    """One falls at rest, the other's change comes to 2 K in an hour after that; never where one does not."""
    rule, time = Criterion("own", "own", 2.0, 60.0), np.arange(0.0, 500.0)
    early, late = 20.0 - 20.0 * np.exp(-time / 20.0), 20.0 - 20.0 * np.exp(-time / 50.0)
    alone = 50.0 * math.log(10.0 * (1.0 - math.exp(-1.2))) + 60.0
    assert rule.all_observed(time, [(time, early), (time, late)], 0.0) == pytest.approx(alone, abs=1.5)
    assert rule.all_observed(time, [(time, early), (time, 0.1 * time)], 0.0) == math.inf
    assert rule.all_observed(time, [], 0.0) == math.inf
    assert rule.observed(time, np.where(time < 300.0, late, late + 9.0), 0.0, together=250.0) == pytest.approx(alone, abs=1.5)
    assert rule.observed(time, np.where(time < 480.0, late, late + 9.0), 0.0) == math.inf


@pytest.mark.parametrize("text", ["0K/h", "2K/0h", "2K/h, 0x30min", "2K/h, 21x30min", "2K/h, 2x0min", "1K/h + 101h"])
def test_numbers_of_a_rule_have_their_bounds(text):
    """Above zero, twenty windows and a hold of a hundred at most."""
    with pytest.raises(ValueError, match=r"above zero|at most 100"):
        criterion_from(text)
    assert criterion_from("2K/h, 20x30min").windows == 20
    assert criterion_from("1K/h + 100h").hold_min == 6000.0
    assert criterion_from("3K/30min").change_k == 3.0
    assert criterion_from("2K/h, 2x30min").change_k == 1.0
