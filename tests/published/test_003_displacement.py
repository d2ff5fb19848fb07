"""Displacement from temperatures: a discrete Bayesian network against least squares (thermal error of a machining centre, part 4).

The experiment: machining centre XHK-714F, idle for 150 min, 30 runs, 16 temperature sensors; a network of ambient change T0, rise
of the front bearing T1 and of the motor T2, and the axial (D0) or radial (D1) displacement; 6 states of the displacement; Dirichlet
exponents N' = 1; a network for each sampling time, 20 min the one shown; prediction = middle of the most probable state. The tables
(readings, statistics, state bounds, probabilities, errors of both methods) and figures are missing from the text as it reached us. The
machine below is simulated: shaft growth 11.5e-6/K, shaft lagging its bearing, runs that differ by some 13 %, sensors of 1/16 K.
Its lengths are chosen for displacements like those printed at 20 min, so the first two rows check the rule, not the machine.

    figure                                           printed                        ours
    axial, most probable state at 20 min             [11.0, 12.0) um                [11.0, 12.0) um
    axial prediction at 20 min                       11.5 um                        11.5 um
    radial prediction at 20 min                      6.4 um                         6.4 um (states of 0.8 um: assumed)
    mean absolute percentage errors from 10 min on, mean of 4 simulated series of runs:   axial       radial
    network of each minute, readings used            table missing, "markedly"      4.23 %      3.27 %
    least squares over all minutes, readings used    better than least squares      3.86 %      1.37 %
    network of each minute, a run left out           not given                      8.45 %      6.51 %
    least squares over all minutes, a run left out   not given                      4.06 %      1.38 %
    mean of the other runs at that minute            not given                     10.72 %      7.95 %
    least squares of each minute, a run left out     not given                      1.56 %      1.46 %

The printed ranking is NOT reproduced: on readings used the network leads in two of the four axial series and in no radial one, and on
a run left out it is behind in all of them, its error about doubled. The network of each minute also knows the time, which least
squares over all minutes does not, so it comes closest where the shaft lags its bearing; least squares given the time as well is far ahead.
"""

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.stats import dirichlet

from thermofast.displacements import METHODS
from thermofast.models.displacement import Sample, static
from thermofast.models.displacement.fits import (
    BLOCKS,
    READINGS_PER_BLOCK,
    blocks_of,
    conditional_table,
    equal_width_edges,
    fit_least_squares,
    fit_network,
    states_of,
)
from thermofast.models.displacement.scoring import compare, score

RUNS, MINUTES, STATES, PARENT_STATES = 30, 150, 6, 3


def lagged(drive, tau, dt=1.0):
    """First-order lag of drives (..., N)."""
    state = np.zeros_like(drive)
    for k in range(1, drive.shape[-1]):
        state[..., k] = state[..., k - 1] + dt / tau * (drive[..., k - 1] - state[..., k - 1])
    return state


def thirty_runs(seed=0):
    """Temperatures (runs, minutes, 3) [K] and axial and radial displacement (runs, minutes) [um]."""
    rng = np.random.default_rng(seed)
    on = np.ones((RUNS, MINUTES + 1))
    ambient = rng.normal(0.0, 0.8, (RUNS, 1)) * np.arange(MINUTES + 1) / MINUTES
    bearing = lagged(10.0 * (1.0 + 0.13 * rng.normal(size=(RUNS, 1))) * on, 35.0)
    motor = lagged(14.0 * (1.0 + 0.13 * rng.normal(size=(RUNS, 1))) * on, 50.0)
    shaft = lagged(1.15 * bearing, 8.0)
    temperatures = np.stack([ambient, bearing + ambient, motor + ambient], axis=-1)
    temperatures = np.round((temperatures + 0.05 * rng.normal(size=temperatures.shape)) * 16.0) / 16.0
    axial = 11.5 * 0.29 * (shaft + 0.3 * ambient) + 0.3 * rng.normal(size=shaft.shape)
    radial = 11.5 * 0.106 * (0.8 * bearing + 0.35 * motor) + 0.15 * rng.normal(size=shaft.shape)
    return temperatures[:, 1:], axial[:, 1:], radial[:, 1:]


def printed_network(temperatures, displacement, asked, class_edges=None):
    """Probabilities (M, 6) and prediction (M,) at temperatures (M, 3), as printed; the middle of the domain for an unseen parent state."""
    edges = [equal_width_edges(column, PARENT_STATES) for column in temperatures.T]
    class_edges = equal_width_edges(displacement, STATES) if class_edges is None else class_edges

    def joint(rows):
        states = [
            np.clip(np.searchsorted(e, c, side="right") - 1, 0, PARENT_STATES - 1) for c, e in zip(rows.T, edges, strict=True)
        ]
        return np.ravel_multi_index(states, (PARENT_STATES,) * 3)

    prior = np.ones((PARENT_STATES**3, STATES))
    inside = (displacement >= class_edges[0]) & (displacement < class_edges[-1])
    table = conditional_table(joint(temperatures[inside]), states_of(displacement[inside], class_edges), prior)
    p = table[joint(asked)]
    middle = 0.5 * (class_edges[1:] + class_edges[:-1])
    return p, np.where(np.ptp(p, axis=1) < 1e-12, middle.mean(), middle[p.argmax(axis=1)])


def least_squares(temperatures, displacement, asked):
    return np.asarray(
        sm.OLS(displacement, sm.add_constant(temperatures, has_constant="add"))
        .fit()
        .predict(sm.add_constant(asked, has_constant="add"))
    )


def percent(truth, told):
    """The paper's mean absolute percentage error."""
    return float(100.0 * np.abs((truth - told) / truth).mean())


def test_prediction_at_20_minutes():
    temperatures, axial, radial = (x[:, 19] for x in thirty_runs())
    typical = np.median(temperatures, axis=0)[None]
    p, told = printed_network(temperatures, axial, typical, np.linspace(8.0, 14.0, 7))
    assert p[0].sum() == pytest.approx(1.0)
    assert p[0].argmax() == 3  # [11, 12) um
    assert told[0] == 11.5
    assert printed_network(temperatures, radial, typical, np.linspace(3.6, 8.4, 7))[1][0] == pytest.approx(6.4)


def percentages(temperatures, displacement):
    """Errors [%]: network and least squares on what they were fitted to; on runs left out those two, the clock, least squares by minute."""
    minutes = np.arange(9, MINUTES, 10)
    temperatures, displacement = temperatures[:, minutes], displacement[:, minutes]
    steps = range(len(minutes))
    seen = np.array([printed_network(temperatures[:, m], displacement[:, m], temperatures[:, m])[1] for m in steps]).T
    flat = temperatures.reshape(-1, 3)
    seen_line = least_squares(flat, displacement.ravel(), flat).reshape(displacement.shape)
    network, line, line_at, clock = (np.empty_like(displacement) for _ in range(4))
    for r in range(RUNS):
        rest = np.arange(RUNS) != r
        line[r] = least_squares(temperatures[rest].reshape(-1, 3), displacement[rest].ravel(), temperatures[r])
        clock[r] = displacement[rest].mean(axis=0)
        for m in steps:
            asked = temperatures[r : r + 1, m]
            network[r, m] = printed_network(temperatures[rest, m], displacement[rest, m], asked)[1][0]
            line_at[r, m] = least_squares(temperatures[rest, m], displacement[rest, m], asked)[0]
    return [percent(displacement, told) for told in (seen, seen_line, network, line, clock, line_at)]


@pytest.mark.proof
def test_network_of_each_minute_is_behind_least_squares_on_a_run_left_out():
    runs = [thirty_runs(seed) for seed in range(4)]
    for column, expected in ((1, [4.233, 3.863, 8.454, 4.063, 10.724, 1.560]), (2, [3.271, 1.368, 6.513, 1.384, 7.950, 1.460])):
        ours = np.array([percentages(one[0], one[column]) for one in runs])
        assert ours.mean(axis=0) == pytest.approx(expected, abs=0.01)
        seen, _, network, line, clock, line_at = ours.T
        assert (network > 1.5 * seen).all()  # what a score on readings used hides
        assert (np.maximum(line, line_at) < network).all()
        assert (network < clock).all()


def test_conditional_table_is_the_mean_of_the_dirichlet_posterior():
    rng = np.random.default_rng(3)
    joint, classes = rng.integers(0, 4, 50), rng.integers(0, 6, 50)
    prior = rng.uniform(0.2, 2.0, (4, 6))
    table = conditional_table(joint, classes, prior)
    for j in range(4):
        counts = np.bincount(classes[joint == j], minlength=6)
        assert table[j] == pytest.approx(dirichlet(prior[j] + counts).mean())


def test_states_are_closed_on_the_left_and_hold_every_value():
    values = np.array([0.0, 1.0, 2.0, 3.0])
    assert states_of(values, equal_width_edges(values, 3)).tolist() == [0, 1, 2, 2]
    assert states_of(np.array([-0.1, 3.1]), np.array([0.0, 1.5, 3.0])).tolist() == [-1, -1]
    assert states_of(np.full(4, 7.0), equal_width_edges(np.full(4, 7.0), 3)).tolist() == [0, 0, 0, 0]


def test_all_components_are_ordinary_least_squares():
    temperatures, displacement = machine(0, "linear")
    model = fit_least_squares(temperatures, displacement, components=6)
    truth = sm.OLS(displacement, sm.add_constant(temperatures)).fit()
    assert model.slope == pytest.approx(truth.params[1:], rel=1e-6)
    assert model.predict(temperatures).mean == pytest.approx(truth.fittedvalues, rel=1e-8)


def test_blocks_are_contiguous_cover_all_and_keep_their_distance():
    folds = blocks_of(400)
    assert len(folds) == BLOCKS
    assert np.array([out for _, out in folds]).sum(axis=0).tolist() == [1] * 400
    for left_in, left_out in folds:
        where = np.flatnonzero(left_out)
        assert (np.diff(where) == 1).all()
        assert np.abs(np.flatnonzero(left_in)[:, None] - where).min() == 6  # a tenth of 50 between


def machine(seed, kind, readings=400, sensors=6, hours=20.0):
    """Temperatures (N, 6) [degC] of a machine under changing load and a displacement (N,) [um]."""
    rng = np.random.default_rng(seed)
    dt = 60.0 * hours / readings
    load = np.repeat(rng.choice([0.0, 0.4, 0.7, 1.0], readings), max(int(45.0 / dt), 1))[:readings]
    gain, tau = rng.uniform(5.0, 25.0, sensors), rng.uniform(8.0, 60.0, sensors)
    clean = 20.0 + np.array([lagged(g * load, t, dt) for g, t in zip(gain, tau, strict=True)]).T
    noise = rng.normal(size=readings)
    if kind == "linear":
        displacement = 1.0 * clean[:, 0] + 0.5 * clean[:, 1] - 0.6 * clean[:, 2] + 0.3 * noise
    elif kind == "threshold":  # a bearing that seats, and later slips back
        low, high = np.quantile(clean[:, 0], [0.35, 0.7])
        displacement = 12.0 * (clean[:, 0] > low) - 18.0 * (clean[:, 0] > high) + 0.3 * noise
    elif kind == "noise":
        displacement = noise
    elif kind == "walk":
        displacement = np.cumsum(noise)
    else:
        displacement = np.full(readings, 12.3)
    return clean + 0.05 * rng.normal(size=clean.shape), displacement


def both(temperatures, displacement):
    return compare(Sample.of(temperatures, displacement), {n: METHODS[n] for n in ("least squares", "network")})


@pytest.mark.parametrize("seed", range(2))
def test_least_squares_wins_where_displacement_is_linear(seed):
    found = both(*machine(seed, "linear"))
    assert found.choice == "least squares"
    assert found.scores["least squares"].rmse == pytest.approx(0.3, rel=0.25)  # down to the noise
    assert found.scores["network"].rmse > 1.5 * found.scores["least squares"].rmse


@pytest.mark.parametrize("seed", range(2))
def test_network_wins_where_displacement_jumps_at_thresholds(seed):
    found = both(*machine(seed, "threshold"))
    assert found.choice == "network"
    assert found.scores["network"].rmse < 0.6 * found.scores["least squares"].rmse
    assert found.scores["network"].coverage > 0.9
    assert "readings left out" in found.reason


@pytest.mark.parametrize("kind", ["noise", "walk"])
@pytest.mark.parametrize("seed", range(2))
def test_neither_is_trusted_where_displacement_has_nothing_to_do_with_temperature(kind, seed):
    found = both(*machine(seed, kind))
    assert found.choice == "neither"
    assert "network:" in found.reason
    assert "least squares:" in found.reason


def test_neither_where_nothing_moves():
    found = both(*machine(0, "still"))
    assert found.choice == "neither"
    assert "does not move" in found.reason


def test_too_few_readings():
    few = BLOCKS * READINGS_PER_BLOCK - 1
    temperatures, displacement = machine(0, "linear", readings=few)
    found = both(temperatures, displacement)
    assert (found.choice, found.scores) == ("neither", {})
    assert f"{few} readings are too few" in found.reason
    with pytest.raises(ValueError, match="80 are needed"):
        score(Sample.of(temperatures, displacement), static(fit_least_squares))
    with pytest.raises(ValueError, match="at least 8 "):
        fit_network(temperatures[:7], displacement[:7])


@pytest.mark.parametrize("fit", [fit_least_squares, fit_network])
def test_what_cannot_be_fitted_is_refused(fit):
    temperatures, displacement = machine(0, "linear", readings=100)
    with pytest.raises(ValueError, match="sensors"):
        fit(temperatures, displacement[:-1])
    temperatures[3, 2] = np.nan
    with pytest.raises(ValueError, match="finite"):
        fit(temperatures, displacement)


def test_settings_of_the_network_are_checked():
    readings = machine(0, "linear", readings=100)
    with pytest.raises(ValueError, match="2 states"):
        fit_network(*readings, bins=1)
    with pytest.raises(ValueError, match="prior"):
        fit_network(*readings, prior=0.0)


def test_outside_its_domain_the_network_says_it_does_not_know():
    temperatures, displacement = machine(1, "threshold")
    model = fit_network(temperatures, displacement)
    told = model.predict(np.full((1, 6), 500.0))
    assert told.mean[0] == pytest.approx(displacement.mean(), abs=0.5)
    assert told.deviation[0] >= 0.9 * displacement.std()


def test_collinear_and_stuck_sensors_do_no_harm():
    temperatures, displacement = machine(2, "linear")
    worse = np.column_stack([temperatures, temperatures[:, 0], np.full(len(temperatures), 21.0)])
    assert score(Sample.of(worse, displacement), static(fit_least_squares)).rmse == pytest.approx(
        score(Sample.of(temperatures, displacement), static(fit_least_squares)).rmse, rel=0.05
    )


def test_intervals_of_least_squares_hold_what_they_claim_on_blocks_left_out():
    held = [score(Sample.of(*machine(seed, "linear")), static(fit_least_squares)).coverage for seed in range(20, 30)]
    assert 0.93 < np.mean(held) < 0.97


def test_intervals_of_the_network_hold_no_less_than_they_claim_on_blocks_left_out():
    # More than 95 %: between two classes far apart the normal interval reaches over both.
    assert np.mean([score(Sample.of(*machine(seed, "threshold")), static(fit_network)).coverage for seed in range(20, 23)]) > 0.95
