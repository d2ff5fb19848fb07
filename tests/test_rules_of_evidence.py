"""What sensors of a run say of their rates and of each other's, by Bayes' rule on small grids."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from thermofast.models.imperfection import TYPICAL, Part
from thermofast.models.imperfection.evidence import ANCHORS, Run
from thermofast.models.imperfection.numerics import cells

PRIOR = SimpleNamespace(
    log_rate_spread=0.5, strong_share=0.2, from_others=0.0, evidence_power=1.0, apart=0.1, rate_spread=0.1, none=False
)


class _Known(SimpleNamespace):
    """A run that knows what a test tells it, with the methods of a real one."""

    log_rate_prior, weighed, taken_evidence, told, agrees, spread = (
        Run.log_rate_prior,
        Run.weighed,
        Run.taken_evidence,
        Run.told,
        Run.agrees,
        Run.spread,
    )
    part_of, settles, blocks_of = Run.part_of, Run.settles, Run.blocks_of


def _run(sensors=1, known=None, guessed=False, rates="auto", log_prior=(-1.0, -2.0, -0.5), **prior):
    return _Known(
        count=sensors,
        known=known,
        guessed=guessed,
        rates=rates,
        prior=SimpleNamespace(**(vars(PRIOR) | prior)),
        centre=np.zeros(sensors),
        log_prior=np.array(log_prior),
        base=np.array([True, False, False]),
    )


def test_slower_rates_than_the_pilots_are_twice_as_open():
    """By normal laws; of a machine that is known by its own deviation, or by Student's t where it may have been changed."""
    off = np.array([[-1.0, -0.2, 0.0, 0.2, 1.0]])
    found = _run().log_rate_prior(off)
    truth = np.where(off > 0.0, -0.5 * (off / 0.5) ** 2, -0.5 * off**2)
    assert found == pytest.approx(truth - math.log(1.5))
    fine = np.linspace(-9.0, 9.0, 20001)[None]
    whole = np.exp(_run().log_rate_prior(fine)).sum() * (fine[0, 1] - fine[0, 0])
    assert whole == pytest.approx(math.sqrt(0.5 * math.pi), rel=1e-3)
    known = np.array([[0.0, 0.3], [1.0, 0.7]])
    guessed = _run(2, known, True).log_rate_prior(np.vstack([off, off]))
    for row, deviation in zip(guessed, (0.3, 0.7), strict=True):
        assert row - row[2] == pytest.approx(stats.norm.logpdf(off[0], 0.0, deviation) - stats.norm.logpdf(0.0, 0.0, deviation))
    assert _run(2, known, True).log_rate_prior(off[0], 1) == pytest.approx(guessed[1])
    sure = _run(2, known).log_rate_prior(np.vstack([off, off]))
    for row, deviation in zip(sure, (0.3, 0.7), strict=True):
        assert row - row[2] == pytest.approx(stats.t.logpdf(off[0] / deviation, 3.0) - stats.t.logpdf(0.0, 3.0))


RATES = np.array([[-1.0, -0.5, 0.5, 1.0]])


def test_one_sensor_is_weighed_by_bayes_rule():
    """Evidence, both priors and the width of a cell; what was not worked out is nothing."""
    run = _run()
    evidence = np.random.default_rng(0).standard_normal((1, 4, 3))
    evidence[0, 1, 2] = np.nan
    found = run.weighed(RATES, evidence)
    joint = evidence + run.log_prior + (run.log_rate_prior(RATES) + np.log(cells(RATES)))[..., None]
    joint[np.isnan(joint)] = -np.inf
    assert np.exp(found - logsumexp(found)) == pytest.approx(np.exp(joint - logsumexp(joint)))
    run._known = evidence
    assert run.taken_evidence(RATES) == pytest.approx([logsumexp(joint)])


def test_a_hypothesis_counts_by_its_evidence_to_a_power():
    """Over that of the background; what the background weighs stays."""
    evidence = np.random.default_rng(1).standard_normal((1, 4, 3))
    plain, half = _run().weighed(RATES, evidence), _run(evidence_power=0.5).weighed(RATES, evidence)
    own = logsumexp(plain - _run().log_prior, axis=1)[0]
    level = own[0] - 1.0 - math.log1p(-0.2)
    assert (half - plain)[0, 0] == pytest.approx([0.0, -0.5 * (own[1] - level), -0.5 * (own[2] - level)])


@pytest.mark.parametrize(("sensors", "share"), [(2, 0.3), (3, 0.3), (4, 0.2), (6, 0.12)])
def test_sensors_tell_each_other_of_size_and_kind(sensors, share):
    """Three tenths of the log evidence of two others at most, and of each no more than 20."""
    rates = np.repeat(RATES, sensors, axis=0)
    evidence = np.random.default_rng(2).standard_normal((sensors, 4, 3))
    evidence[0, :, 1] += 50.0
    alone, told = _run(sensors).weighed(rates, evidence), _run(sensors, from_others=0.3).weighed(rates, evidence)
    own = logsumexp(alone - _run().log_prior, axis=1)
    relative = np.clip(own - (own[:, :1] - 1.0 - math.log1p(-0.2)), -20.0, 20.0)
    for i in range(sensors):
        others = np.delete(relative, i, axis=0).sum(axis=0)
        assert (told - alone)[i, 2] == pytest.approx(share * others)
    assert relative[0, 1] == 20.0


def _told(at, rates="auto", deviation=0.05, sensors=2, strong=None, **prior):
    """What the others say of each rate, where the posterior of each sensor is normal; under a strong effect about others, if any."""
    run = _run(sensors, rates=rates, **prior)
    grid = np.tile(np.linspace(-1.0, 1.0, 81), (sensors, 1))
    centres = [at] if strong is None else [at, strong]
    log = np.array([-0.5 * ((grid - np.array(c)[:, None]) / deviation) ** 2 for c in centres]) + run.log_rate_prior(grid)
    said, dense, agreeing = run.told(grid, log)
    # Of all rates of a class together it says nothing: a class is not made likelier by it.
    assert logsumexp(log + said, axis=2) == pytest.approx(logsumexp(log, axis=2))
    return grid[0], said if strong is not None else said[0], dense, agreeing


def test_a_sensor_is_told_the_rates_of_those_that_agree():
    """Most at their rate; nothing where they disagree, or where each is to be by itself."""
    grid, said, dense, agreeing = _told([0.2, 0.25])
    assert said.shape == (2, 81)
    assert grid[np.argmax(said[0])] == pytest.approx(0.25, abs=0.03)
    assert grid[np.argmax(said[1])] == pytest.approx(0.2, abs=0.03)
    assert (dense[0], dense[-1]) == (-1.0, 1.0)
    assert dense[np.argmax(agreeing[0])] == pytest.approx(0.2, abs=0.03)
    assert (agreeing[:, 0] < 0.2).all()
    _, apart, *_ = _told([-0.8, 0.8])
    assert (apart == 0.0).all()
    _, shared, *_ = _told([-0.8, 0.8], rates="shared")
    assert not (shared == 0.0).any()
    for wrong in ({"rates": "own"}, {"sensors": 1}):
        sensors = wrong.get("sensors", 2)
        _, said, dense, agreeing = _told([0.2, 0.25][:sensors], **wrong)
        assert (said == 0.0).all()
        assert (len(dense), agreeing.shape) == (0, (sensors, 0))


def test_under_a_strong_effect_the_others_tell_what_their_rates_are_under_it():
    """The law sees both at 0.2, an effect at -0.5: each is told the one and the other; nothing of either where the law disagrees."""
    grid, said, *_ = _told([0.2, 0.2], strong=[-0.5, -0.5])
    assert [grid[np.argmax(line)] for line in said[:, 0]] == pytest.approx([0.2, -0.5], abs=0.05)
    _, apart, *_ = _told([-0.8, 0.8], strong=[-0.5, -0.5])
    assert (apart == 0.0).all()


def test_what_is_said_of_a_rate_is_a_mixture_of_agreeing_and_not():
    """The likelihood of the other's rate, spread by what sensors differ, over that of any rate, and a tenth that says nothing."""
    grid, said, *_ = _told([0.2, 0.25], rates="auto")
    fine = np.linspace(-1.0, 1.0, 4001)
    prior = np.where(fine > 0.0, np.exp(-0.5 * (fine / 0.5) ** 2), np.exp(-0.5 * fine**2))
    prior /= prior.sum()
    heard = stats.norm.pdf(fine, 0.25, math.hypot(0.05, math.sqrt(2.0) * 0.1))
    truth = np.interp(grid, fine, np.log(0.9 * heard / (heard @ prior) + 0.1))
    own = -0.5 * ((grid - 0.2) / 0.05) ** 2 + _run().log_rate_prior(grid[None])[0]

    def told(line):
        return line - (logsumexp(own + line) - logsumexp(own))

    assert said[0] == pytest.approx(told(truth), abs=0.07)
    _, four, *_ = _told([0.2, 0.25, 0.25, 0.25], sensors=4)
    # Three others count as two; up to the constant that is taken off.
    assert np.ptp(four[0] - 2.0 * said[0]) < 0.1
    _, bare, *_ = _told([0.2, 0.25, 0.25, 0.25], sensors=4, none=True)
    assert np.ptp(bare[0] - 1.5 * four[0]) < 0.1


def test_sensors_agree_where_that_is_likelier_than_not():
    """Over what is known of the sensor's own rate; none with itself."""
    run = _run(2)
    rates, dense = np.array([[0.0, 1.0]] * 2), np.array([0.0, 0.5, 1.0])
    marginal = np.log(np.array([[0.6, 0.4], [0.4, 0.6]]))
    agreeing = np.array([[0.9, 0.5, 0.1], [0.8, 0.5, 0.0]])
    assert run.agrees(rates, marginal, dense, agreeing).tolist() == [[False, False], [False, False]]
    agreeing[1] = [0.9, 0.5, 0.0]
    assert run.agrees(rates, marginal, dense, agreeing).tolist() == [[False, True], [False, False]]
    assert run.agrees(rates, marginal, np.zeros(0), np.zeros((2, 0))).tolist() == [[False] * 2] * 2


def test_rates_are_looked_at_evenly_and_about_the_laws_own():
    """Those beyond the ends stand at them; of a law without a rate at the lower one."""
    run = _run(2)
    run.anchors = np.array([0.5 + 0.1 * ANCHORS, np.full(9, np.nan)])
    found = run.spread(np.array([0.0, 0.0]), np.array([1.0, 2.0]), 3)
    assert found[0].tolist() == pytest.approx(sorted([0.0, 0.5, 1.0, 0.0, 0.1, 0.3, 0.4, 0.5, 0.6, 0.7, 0.9, 1.0]))
    assert found[1].tolist() == [0.0] * 10 + [1.0, 2.0]


def test_sensors_are_numbered_part_by_part():
    """The law's last twentieth is left after ln 20 time constants; a known shape has turns of its own."""
    run = _run(5)
    run.rows, run.blocks = np.array([0, 2, 5]), ["first", "second"]
    run.shape = [None, SimpleNamespace(settles=lambda row, rate: (row, rate))]
    assert [run.part_of(i) for i in range(5)] == [(0, 0), (0, 1), (1, 0), (1, 1), (1, 2)]
    assert [run.blocks_of(i) for i in (1, 2)] == ["first", "second"]
    assert run.settles(1, 0.3) == (pytest.approx(math.log(20.0)), 1.0)
    assert run.settles(4, 0.3) == (2, 0.3)


TIME = np.arange(0.0, 121.0, 2.0)


@pytest.fixture(scope="module")
def seen():
    """Two sensors of a rise of 10 K with a time constant of 40 min, read for two hours."""
    noise = 0.02 * np.random.default_rng(0).standard_normal((2, len(TIME)))
    return [Part(TIME, -10.0 * np.exp(-TIME / 40.0) + noise, np.full(2, 0.02), np.zeros(2))]


def test_rates_are_looked_at_over_the_length_of_the_record(seen):
    """From a twelfth over its length to forty over it, or ten times the pilot's."""
    for tau in (40.0, 2.0):
        run = Run(seen, tau, TYPICAL, np.array([60.0]), "own")
        span = run.blocks[0].last
        assert np.exp(run.nodes[0]) == pytest.approx(1.0 / 12.0 / span)
        assert 0.0 <= run.nodes[-1] - math.log(40.0 / span if tau == 40.0 else 10.0 / tau) < 0.12 + 1e-9
        assert np.diff(run.nodes) == pytest.approx(0.12)
        assert run.centre == pytest.approx(-math.log(tau))
        assert (run.count, run.times, run.rows.tolist()) == (2, 1, [0, 2])


def test_what_was_worked_out_is_kept_for_sensors_that_are_not_looked_at_anew(seen):
    """The rate is found to the noise; squares and evidence of the other sensor stay."""
    run = Run(seen, 40.0, TYPICAL, np.zeros(0), "own")
    rates = run.spread(np.full(2, math.log(1.0 / 60.0)), np.full(2, math.log(1.0 / 25.0)), 15)
    every, marginal, squares, *_ = run._looked(rates, np.ones(2, dtype=bool))
    again = run._looked(rates, np.array([True, False]))
    assert again[0] == pytest.approx(every)
    np.testing.assert_array_equal(again[2], squares)
    assert np.exp(rates[0, np.argmax(marginal[0])]) == pytest.approx(1.0 / 40.0, rel=0.08)
    log_rate, weight, *_ = run.posterior()
    assert weight.sum(axis=(1, 2)) == pytest.approx([1.0, 1.0])
    mean = (weight.sum(axis=2) * log_rate).sum(axis=1)
    assert np.exp(mean) == pytest.approx(1.0 / 40.0, rel=0.05)


def test_what_stands_of_other_sensors_stays_when_one_is_looked_at_anew():
    """Ten sensors, more than are worked on at a time: a look at three of them gives what a look at all gives of all."""
    time, rng = np.arange(0.0, 40.0, 0.5), np.random.default_rng(8)
    reading = 20.0 + 6.0 * -np.expm1(-time / rng.uniform(30.0, 60.0, (10, 1))) + 0.02 * rng.standard_normal((10, len(time)))
    run = Run([Part(time, reading, np.full(10, 0.02), np.zeros(10))], 45.0, TYPICAL, np.zeros(0), "auto")
    before = np.tile(np.linspace(-4.6, -3.0, 9), (10, 1))
    after, anew = before.copy(), np.isin(np.arange(10), (1, 8, 9))
    after[anew] = np.maximum(before[anew], -4.0)  # rates that stand for nothing, at the end of the grid
    whole = run._looked(after, np.ones(10, dtype=bool))
    evidence = run._known.copy()
    run._looked(before, np.ones(10, dtype=bool))
    again = run._looked(after, anew)
    np.testing.assert_array_equal(run._known, evidence)
    assert np.isfinite(evidence).any(axis=(1, 2)).all()
    for mine, other in zip(again, whole, strict=True):
        np.testing.assert_array_equal(mine, other)
