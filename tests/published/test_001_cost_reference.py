"""The cost-reference particle filter on the drum of a 160 MW boiler: Wang, Cao, Li & Huang 2018, rebuilt.

doi:10.13700/j.bh.1001-5965.2017.0353, section 4: 3000 steps of 0.1 s, 500 particles, 100 s each of no fault, bias and gain.
Not printed: lambda, q, delta, beta; what (11) correlates; whether (1) or (2), the normal model or that of the fault, is measured
with. Misprinted: the steam quality (1 - b3 x2, not b3 x2) and b2 (68, not 0.068). Ours: four runs, printed: fifty.

Mean absolute error                     | printed          | ours, normal model | ours, model of the fault
gamma, pressure, plain -> adaptive      | 0.0111 -> 0.0082 | 1.83 -> 16.5       | 0.141 -> 0.142 (could be known to 0.0069)
gamma, density                          | 3.5750 -> 1.7071 | 3.15 -> 27.2       | 0.083 -> 0.085 (0.0049)
mixture, pressure                       | 0.1952 -> 0.0095 | 14.3 -> 31.8       | 6.29 -> 6.37 (0.65)
mixture, density                        | 4.3659 -> 0.8860 | 44.2 -> 54.0       | 3.01 -> 3.12 (0.41)
the same, (11) over the whole record, 2 runs                  |                    | 5.44 -> 4.58, 2.62 -> 2.16; gamma 0.149 -> 0.183, 0.078 -> 0.107
Missed alarms, gamma / mixture, plain, model of the fault
threshold as printed                    | 0.0045 / 0.0061  | 0.658 / 0.656      | 0.646 / 0.660
guarded threshold                       |                  | 0.000 / 0.342      | 0.000 / 0.000
False alarms before the fault           | about 0          | as printed 0.059 / 0.036, guarded 0.209 / 0.024

The printed gain by adaptation does not come out. The density's error before it does, at the settings chosen for it; the printed
error of the pressure after it, under mixture noise, is a hundredth of what a filter that knows the noise can reach. What
adaptation is for does come out: the spread follows noise that grows late, where that of (9) stays as it was.
"""

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from benchmarks.discovery.clean_stretches import false_alarm_rate
from thermofast.filters.cost_reference import (
    AdaptiveCostReference,
    CostReference,
    Particles,
    Pricing,
    advance,
    agreement,
    cost_increment,
    displace,
    next_spread,
    select,
    share_by_count,
    total_cost,
    weighted_mean,
    weights_from_cost,
)
from thermofast.models import Lump
from thermofast.models.noise.threshold import adaptive_threshold

STEP_S, STEPS, PARTICLES, WINDOW, DEVIATIONS = 0.1, 3000, 500, 20, 2.17
START, SPREAD = np.array([108.0, 428.0]), 0.01
FUEL, STEAM, WATER = 0.3, 0.4, 0.5
#: lambda, q, beta and delta are not printed. Of four settings run in full these come nearest to the errors printed before
#: adaptation; with the others the density's error under gamma noise is 10 to 21. None gives the printed gain by adaptation.
PRICING = Pricing(forgetting=0.95, power=1.0, softness=0.01, sharpness=2.0)
#: (factor on B, offset) of the readings: no fault, constant bias, constant gain, stuck.
MODES = ((0.05, 0.0), (0.05, 0.5), (0.08, 0.0), (0.0, 0.0))


def drum(state, dt):
    """One step of the drum (pressure, fluid density), section 4, with the printed constants."""
    pressure, density = state[..., 0], state[..., 1]
    return np.stack(
        [
            pressure - (0.0018 * STEAM * pressure**1.125 - 0.9 * FUEL + 0.15 * WATER) * dt,
            density + (141.0 * WATER - (1.1 * STEAM - 0.19) * pressure) / 85.0 * dt,
        ],
        axis=-1,
    )


def water(state):
    """B of section 4 with the steam quality and constant of Bell & Astrom: the print has lost a `1 -` and a factor of 1000."""
    pressure, density = state[..., 0], state[..., 1]
    quality = (1.0 - 0.00154 * density) * (0.8 * pressure - 25.6) / (density * (1.0394 - 0.00123 * pressure))
    evaporated = (0.854 * STEAM - 0.147) * pressure + 45.59 * FUEL - 2.514 * WATER - 2.096
    return 0.131 * density + 100.0 * quality + evaporated / 9.0 - 68.0


def gamma_noise(rng, count):
    return 0.09e-2 * rng.gamma(0.25, 0.5, (count, 2)), 0.16e-2 * rng.gamma(0.25, 0.5, count)


def mixture_noise(rng, count):
    """The printed sums of weighted Gaussians: the weights do not sum to one, so it is the variables that are added."""

    def summed(weights, *shape):
        parts = zip(weights, (0.2, 0.02, 0.01), (0.5, 0.08, 0.1), strict=True)
        return 0.1 * sum(w * rng.normal(mean, deviation, shape) for w, mean, deviation in parts)

    return summed((0.8, 0.5, 0.4), count, 2), summed((0.01, 0.05, 0.04), count)


NOISES = {"gamma": gamma_noise, "mixture": mixture_noise}


def schedule(faults):
    """Mode (STEPS,) at each sample: 100 s each of no fault, bias, gain; or all one mode."""
    if faults == "none":
        return np.zeros(STEPS, int)
    last = 3 if faults == "stuck" else 2
    return np.concatenate([np.full(1000, mode) for mode in (0, 1, last)])


def moving_moments(residual, window):
    """Mean (N,) and standard deviation (N,) of equations (18) and (17), each over `window` readings ending at its own.

    As printed: the reading itself is in both, and each square in (17) is about the mean of its own time. nan before the first
    full window, which for the deviation takes 2 window - 1 readings.

    Raises
    ------
    ValueError: a window of fewer than two readings.
    """
    mean = _trailing_mean(residual, window)
    return mean, np.sqrt(_trailing_mean((residual - mean) ** 2, window))


def departure(residual, low, high, in_a_row=3):
    """Index of the first of `in_a_row` readings in a row beyond the same limit (N,), or None; nan limits hold no reading out."""
    runs = [_first_run(residual > high, in_a_row), _first_run(residual < low, in_a_row)]
    found = [k for k in runs if k is not None]
    return min(found) if found else None


def _first_run(outside, length):
    count = 0
    for k, out in enumerate(outside):
        count = count + 1 if out else 0
        if count == length:
            return k - length + 1
    return None


def _trailing_mean(values, window):
    """Mean (N,) of the `window` values ending at each; nan where one is missing."""
    means = np.full(len(values), np.nan)
    if len(values) >= window:
        means[window - 1 :] = np.lib.stride_tricks.sliding_window_view(values, window).mean(axis=1)
    return means


@functools.cache
def simulated(noise, faults, seed):
    """True states (STEPS, 2) and readings (STEPS,)."""
    v, w = NOISES[noise](np.random.default_rng(seed), STEPS)
    states, state = np.empty((STEPS, 2)), START
    for k in range(STEPS):
        state = drum(state, STEP_S) + v[k]
        states[k] = state
    gain, offset = np.array(MODES).T[:, schedule(faults)]
    return states, gain * water(states) + offset + w


def correlation(predicted, reading):
    """Correlation in [0, 1] of predicted and actual readings (M,): a reading of (11); 1 where either does not vary."""
    a, b = predicted - predicted.mean(), reading - reading.mean()
    size = np.sqrt((a @ a) * (b @ b))
    return min(max(float(a @ b) / size, 0.0), 1.0) if size > 0.0 else 1.0


@dataclass
class Result:
    error: np.ndarray
    residual: np.ndarray
    spread: np.ndarray

    @property
    def mean_absolute(self):
        return np.abs(self.error).mean(axis=0)


SHARES = {
    "plain": lambda k, predicted, reading: share_by_count(k),
    "adaptive": lambda k, predicted, reading: correlation(predicted, reading),
    "agreement": lambda k, predicted, reading: agreement(reading - predicted),
    "whole": lambda k, predicted, reading: correlation(predicted, reading),
}


@functools.cache
def filtered(method, noise, faults="none", told=False, seed=0):
    """The paper's filter; told: it measures with the model of the mode that is on, equation (2), else with the normal one."""
    states, readings = simulated(noise, faults, seed)
    rng = np.random.default_rng(1000 + seed)
    cloud = Particles(rng.normal(START, 0.1, (PARTICLES, 2)), np.zeros(PARTICLES), np.full(PARTICLES, SPREAD))
    estimate, modes = START, schedule(faults) if told else np.zeros(STEPS, int)
    predicted, without = np.empty(STEPS), np.empty(STEPS)
    result = Result(np.empty((STEPS, 2)), np.empty((STEPS, 4)), np.empty(STEPS))
    for k in range(STEPS):
        gain, offset = MODES[modes[k]]
        without[k] = readings[k] - offset
        predicted[k] = gain * float(water(drum(estimate, STEP_S)))
        window = slice(0 if method == "whole" else max(0, k + 1 - WINDOW), k + 1)
        kept = SHARES[method](k + 1, predicted[window], without[window])
        moved = drum(cloud.states, STEP_S)
        cloud, weights = advance(
            cloud, moved, lambda x, gain=gain: gain * water(x), without[k], kept if k else 0.0, PRICING, np.eye(2), rng
        )
        estimate = weighted_mean(weights, cloud.states)
        result.error[k], result.spread[k] = estimate - states[k], cloud.spread.mean()
        level = float(water(estimate))
        result.residual[k] = [abs(readings[k] - gain * level - offset) for gain, offset in MODES]
    return result


def missed_and_false(residual, limit):
    """p_m and p_f of section 4 for residuals (STEPS,) of the schedule with faults: of all samples, of those without fault."""
    judged = np.isfinite(limit)
    alarm = residual > limit
    return (judged & ~alarm)[1000:].sum() / STEPS, alarm[:1000].sum() / judged[:1000].sum()


def informed(noise, seed):
    """Mean absolute errors (2,) of the extended Kalman filter that is told mean and covariance of all noise, without faults."""
    v, w = NOISES[noise](np.random.default_rng(99), 100_000)
    states, readings = simulated(noise, "none", seed)
    v_mean, v_covariance, w_mean, w_variance = v.mean(axis=0), np.diag(v.var(axis=0)), w.mean(), w.var()
    x, p, errors = START, np.zeros((2, 2)), np.empty((STEPS, 2))
    for k in range(STEPS):
        f = np.array([(drum(x + d, STEP_S) - drum(x - d, STEP_S)) / 2e-3 for d in 1e-3 * np.eye(2)]).T
        x, p = drum(x, STEP_S) + v_mean, f @ p @ f.T + v_covariance
        h = np.array([0.05 * (water(x + d) - water(x - d)) / 2e-3 for d in 1e-3 * np.eye(2)])
        gain = p @ h / (h @ p @ h + w_variance)
        x, p = x + gain * (readings[k] - 0.05 * water(x) - w_mean), p - np.outer(gain, h @ p)
        errors[k] = x - states[k]
    return np.abs(errors).mean(axis=0)


def mean_errors(method, noise, faults="none", told=False, seeds=(0, 1)):
    return np.mean([filtered(method, noise, faults, told, seed).mean_absolute for seed in seeds], axis=0)


def test_the_level_is_near_nought_at_the_start_only_with_the_constants_restored():
    assert 0.05 * float(water(START)) == pytest.approx(-0.157, abs=2e-3)
    # At 199.3 s the print calls the two fault residuals closest: B must rise towards 0.5 / 0.03 during the bias, as it does.
    states, _ = simulated("gamma", "three", 0)
    level = 0.03 * water(states)
    assert np.all(np.diff(0.5 - level[1000:2000:50]) < 0.0)
    assert 0.0 < level[1990] < 0.5


@pytest.mark.proof
def test_the_plain_filter_has_the_printed_error_of_the_density_while_it_measures_with_the_normal_model():
    pressure, density = mean_errors("plain", "gamma", "three")
    assert density == pytest.approx(3.5750, rel=0.35)
    # The print has 0.0111: impossible beside 3.6 in density, one reading moving both states by their shares of the same gain.
    assert 1.0 < pressure < 3.0
    assert mean_errors("plain", "mixture", "three", told=True)[1] == pytest.approx(4.3659, rel=0.5)


def test_without_faults_errors_are_a_small_multiple_of_what_can_be_known():
    best = informed("gamma", 0)
    assert best == pytest.approx([0.0069, 0.0049], rel=0.5)
    assert best[0] == pytest.approx(0.0082, rel=0.5)  # the printed figure after adaptation: as good as knowing the noise
    found = mean_errors("plain", "gamma")
    assert np.all(found < 0.3)
    assert np.all(found > best)


def test_the_printed_pressure_error_under_mixture_noise_is_below_what_can_be_known():
    best = informed("mixture", 0)
    assert best[0] > 10.0 * 0.0095
    # Even with the state before known exactly and readings without noise: what one step's noise adds in the direction not read.
    read = np.array([water(START + d) - water(START - d) for d in 1e-3 * np.eye(2)])
    across = abs(read[1]) / np.linalg.norm(read)
    assert across * 0.0404 * np.sqrt(2.0 / np.pi) > 2.0 * 0.0095
    assert best[1] < 0.8860  # while that of the density can be


@pytest.mark.proof
def test_adaptation_by_correlation_takes_the_fault_into_the_state():
    before, after = mean_errors("plain", "gamma", "three"), mean_errors("adaptive", "gamma", "three")
    assert np.all(after > 3.0 * before)  # printed the other way: 3.5750 -> 1.7071
    # Measuring with the model of the mode that is on (equation 2), the two are alike.
    ratio = mean_errors("adaptive", "gamma", "three", told=True) / mean_errors("plain", "gamma", "three", told=True)
    assert np.all((ratio > 0.5) & (ratio < 2.0))


def test_correlated_over_the_whole_record_adaptation_gains_a_sixth_under_mixture_noise_alone():
    """A reading of (11) that comes nearest to what is printed, and on a record that warms is no adaptation at all."""
    error = {(m, n): mean_errors(m, n, "three", True, (0,)) for m in ("whole", "plain") for n in ("gamma", "mixture")}
    gain = {n: error["whole", n] / error["plain", n] for n in ("gamma", "mixture")}
    assert np.all(gain["mixture"] < 0.95)  # printed: 0.05 and 0.20
    assert np.all(gain["gamma"] > 0.95)  # printed: 0.74 and 0.48
    minutes = np.arange(61.0)
    rise = 26.7 - 8.8 * np.exp(-0.01536 * minutes)
    noise = 0.02 * np.random.default_rng(3).standard_normal((2, 61))
    assert correlation(rise + noise[0], rise + noise[1]) > 0.9995  # the share of the old spread kept: all


@pytest.mark.proof
def test_what_adaptation_is_for_the_spread_follows_noise_that_grows_late(monkeypatch):
    def grows(rng, count):
        v, w = gamma_noise(rng, count)
        late = mixture_noise(rng, count)[0]
        v[2000:] = (late - late.mean(axis=0))[2000:]
        return v, w

    monkeypatch.setitem(NOISES, "grows", grows)
    error = {}
    for method in ("plain", "adaptive"):
        spreads, errors = [], []
        for seed in (0, 1):
            run, (states, _) = filtered(method, "grows", seed=seed), simulated("grows", "none", seed)
            spreads.append(run.spread[-1] / run.spread[1999])
            errors.append(np.abs(0.05 * (water(states + run.error) - water(states)))[2000:].mean())
        error[method] = np.mean(errors)
        assert max(spreads) < 2.0 if method == "plain" else min(spreads) > 100.0
    assert error["adaptive"] < 0.9 * error["plain"]


def test_as_printed_the_threshold_lets_a_lasting_fault_in_and_guarded_it_misses_none():
    for noise, most_false in (("gamma", 0.3), ("mixture", 0.05)):
        residual = filtered("plain", noise, "three", told=True).residual[:, 0]
        mean, deviation = moving_moments(residual, WINDOW)
        missed, false = missed_and_false(residual, mean + DEVIATIONS * deviation)
        assert missed == pytest.approx(0.65, abs=0.02)  # printed 0.0037 to 0.0063
        assert false < 0.08  # printed "about 0"
        missed, false = missed_and_false(residual, adaptive_threshold(residual, WINDOW)[1])
        assert missed <= 0.006
        assert false < most_false


@pytest.mark.parametrize(("faults", "last"), [("three", 2), ("stuck", 3)])
def test_every_fault_is_isolated_under_gamma_noise(faults, last):
    residual = filtered("plain", "gamma", faults).residual
    assert np.mean(residual[1000:2000].argmin(axis=1) == 1) > 0.99
    assert np.mean(residual[2000:].argmin(axis=1) == last) > 0.99


@pytest.mark.parametrize(("window", "deviations"), [(20, 2.17), (20, 3.0), (50, 2.17)])
def test_false_alarms_on_white_noise_are_those_of_students_t(window, deviations):
    residual = np.random.default_rng(1).standard_normal(20_000)
    low, high = adaptive_threshold(residual, window, deviations, np.inf)
    expected = 2.0 * stats.t.sf(deviations / np.sqrt(1.0 + 1.0 / window), window - 1)
    assert false_alarm_rate(window, deviations) == pytest.approx(expected, rel=1e-12)
    assert np.mean((residual < low) | (residual > high)) == pytest.approx(expected, rel=0.2)
    mean, deviation = moving_moments(residual, window)
    inside = np.mean(np.abs(residual - mean)[2 * window :] > 2.17 * deviation[2 * window :])
    assert inside == pytest.approx(0.029, abs=0.004)  # as printed, the confidence of 97 % is held


@pytest.mark.parametrize(("lag_one", "rate"), [(0.3, 0.0107), (0.6, 0.0143), (0.9, 0.0282)])
def test_false_alarms_grow_with_the_correlation_of_neighbours(lag_one, rate):
    residual = lfilter([1.0], [1.0, -lag_one], np.random.default_rng(1).standard_normal(20_200))[200:]
    low, high = adaptive_threshold(residual)
    assert np.mean((residual < low) | (residual > high)) == pytest.approx(rate, rel=0.2)


def test_moving_moments_are_the_recursions_as_printed():
    r, m = np.random.default_rng(2).standard_normal(100), 8
    mean, deviation = moving_moments(r, m)
    for k in range(2 * m, 99):
        assert mean[k + 1] == pytest.approx(mean[k] + r[k + 1] / m - r[k + 1 - m] / m, abs=1e-12)
        fresh, stale = (r[k + 1] - mean[k + 1]) ** 2, (r[k + 1 - m] - mean[k + 1 - m]) ** 2
        assert deviation[k + 1] ** 2 == pytest.approx(deviation[k] ** 2 + (fresh - stale) / m, abs=1e-12)


def test_a_departure_is_found_where_it_begins_and_nowhere_else():
    r = np.random.default_rng(3).standard_normal(400)
    assert departure(r, *adaptive_threshold(r)) is None
    shifted = r + np.where(np.arange(400) >= 250, 8.0, 0.0)
    assert departure(shifted, *adaptive_threshold(shifted)) == 250
    assert departure(-shifted, *adaptive_threshold(-shifted)) == 250
    flat = np.zeros(60)
    assert departure(flat, *adaptive_threshold(flat)) is None
    flat[40:] = 0.2  # two steps of a logger: what lies between limits and guard is let in
    assert departure(flat, *adaptive_threshold(flat, floor=0.1 / np.sqrt(12.0))) == 40
    assert departure(r[:10], *adaptive_threshold(r[:10])) is None
    with pytest.raises(ValueError, match="no spread"):
        adaptive_threshold(r, 1)
    with pytest.raises(ValueError, match="inside the limits"):
        adaptive_threshold(r, 20, 3.0, 2.0)


def test_the_pieces_are_the_printed_equations():
    rng = np.random.default_rng(4)
    states = rng.standard_normal((7, 2))
    both = cost_increment(states, np.array([0.5, -0.5]), 2.0)
    assert both == pytest.approx(np.linalg.norm(np.array([0.5, -0.5]) - states, axis=1) ** 2)
    one = cost_increment(states[:, 0], 0.5, 1.0)
    assert one == pytest.approx(np.abs(0.5 - states[:, 0]))
    cost = total_cost(both, one, 0.9)
    assert cost == pytest.approx(0.9 * both + one)
    weights = weights_from_cost(cost, 0.1, 2.0)
    assert weights * (cost - cost.min() + 0.1) ** 2 == pytest.approx(np.full(7, weights.max() * 0.01))
    assert weights.sum() == pytest.approx(1.0)
    drawn = np.mean([np.bincount(select(weights, rng), minlength=7) for _ in range(4000)], axis=0)
    assert drawn == pytest.approx(7.0 * weights, abs=0.05)
    assert next_spread(np.ones(1), np.full(1, 3.0), share_by_count(4)) == pytest.approx(0.75 + 3.0 / 4.0)


def test_a_spread_expects_itself_whatever_the_share_kept():
    rng = np.random.default_rng(5)
    root = np.array([[2.0, 0.0], [1.0, 0.5]])
    moved, displaced = displace(np.zeros((100_000, 2)), np.full(100_000, 0.04), root, rng)
    assert np.cov(moved.T) == pytest.approx(0.04 * root @ root.T, rel=0.03)
    assert next_spread(np.full(100_000, 0.04), displaced, 0.3).mean() == pytest.approx(0.04, rel=0.02)


def test_the_two_measures_of_agreement():
    rng = np.random.default_rng(6)
    ramp, noise = np.arange(400.0), rng.standard_normal(400)
    assert correlation(ramp, ramp + noise) == pytest.approx(np.corrcoef(ramp, ramp + noise)[0, 1])
    assert correlation(ramp, -ramp) == 0.0
    assert correlation(np.ones(20), noise[:20]) == 1.0
    assert agreement(noise) == pytest.approx(1.0, abs=0.1)
    assert agreement(noise + 10.0) < 0.02
    assert agreement(noise[:2]) == agreement(np.zeros(20)) == 1.0


PRODUCT = [CostReference(), AdaptiveCostReference()]


@pytest.mark.parametrize("method", PRODUCT, ids=lambda m: m.name)
def test_on_the_lump_a_filter_comes_to_its_truth_with_a_fair_covariance(method):
    time = np.arange(0.0, 301.0)
    errors, believed = [], []
    for seed in range(8):
        reading = 26.7 - 8.8 * np.exp(-0.01536 * time) + 0.02 * np.random.default_rng(seed).standard_normal(301)
        track = method.track(Lump(), time, reading, 0.0)
        state, covariance = track.state[200], track.covariance[200] * track.noise_variance[200]
        slope = np.array([1.0, 1.0 / state[2], -state[1] / state[2] ** 2])
        errors.append(state[0] + state[1] / state[2] - 26.7)
        believed.append(slope @ covariance @ slope)
        assert track.noise_variance[-1] == pytest.approx(0.02**2, rel=0.5)
        assert track.forgotten[-1] == 0.0
    root_mean_square, deviation = np.sqrt(np.mean(np.square(errors))), np.sqrt(np.mean(believed))
    assert root_mean_square < 0.02
    assert 0.5 < deviation / root_mean_square < 4.0


def test_on_the_lump_outlier_readings_have_little_hold_and_a_jump_is_followed_by_the_adaptive_filter_alone():
    time = np.arange(0.0, 201.0)
    reading = 26.7 - 8.8 * np.exp(-0.01536 * time) + 0.02 * np.random.default_rng(6).standard_normal(201)
    outlier, jumped = reading.copy(), reading + np.where(time >= 120, 1.0, 0.0)
    outlier[[40, 90]] += 5.0
    for method in PRODUCT:
        assert np.abs(method.track(Lump(), time, outlier, 0.0).state[100:, 0] - reading[100:]).mean() < 0.05
    left = [np.abs(m.track(Lump(), time, jumped, 0.0).state[150:, 0] - jumped[150:]).mean() for m in PRODUCT]
    assert left[0] > 0.5
    assert left[1] < 0.05
    track = PRODUCT[1].track(Lump(), time, jumped, 0.0)
    assert 120 <= int(np.argmax(track.fading)) <= 130
    assert track.forgotten[-1] > np.log(2.0)
    assert np.all(track.forgotten[:120][track.first :] == 0.0)


def test_on_the_lump_broken_readings_end_the_track():
    time = np.arange(0.0, 100.0)
    reading = 26.7 - 8.8 * np.exp(-0.01536 * time) + 0.02 * np.random.default_rng(7).standard_normal(100)
    reading[60] = 1e14
    track = CostReference().track(Lump(), time, reading, 0.0)
    assert track.diverged_at == 60
    assert np.isnan(track.state[60:]).all()


def test_limits_are_mean_and_sample_deviation_of_the_window_before_a_reading():
    """Equation (16) by numpy, where the guard lets every reading in."""
    residual = np.random.default_rng(7).standard_normal(40)
    low, high = adaptive_threshold(residual, 5, 2.0, np.inf)
    before = [residual[k - 5 : k] for k in range(5, 40)]
    np.testing.assert_allclose(low[5:], [w.mean() - 2.0 * w.std(ddof=1) for w in before])
    np.testing.assert_allclose(high[5:], [w.mean() + 2.0 * w.std(ddof=1) for w in before])
    assert np.isnan(low[:5]).all()
    assert np.isnan(high[:5]).all()
    assert np.isfinite(low[5:]).all()


def test_a_reading_at_the_guard_enters_the_window_and_one_beyond_does_not():
    """The guard is 4 deviations where none is given; it may be the limits themselves, and a window two readings."""
    for reading, mean in ((4.0, 2.0), (4.5, 0.0)):
        low, high = adaptive_threshold(np.array([0.0, 0.0, reading, 0.0]), 2, floor=1.0)
        assert high[3] + low[3] == pytest.approx(2.0 * mean)
    assert adaptive_threshold(np.zeros(3), 2, 3.0, 3.0, floor=1.0)[1][2] == 3.0
    assert np.flatnonzero(np.isfinite(adaptive_threshold(np.zeros(30))[0]))[0] == 20
