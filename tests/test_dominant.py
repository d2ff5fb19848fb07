"""Machines that are a little imperfect, as every real one is: the effect that matters is named although the rest remains."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.fft import dct
from scipy.integrate import solve_ivp
from scipy.stats import multivariate_normal

import thermofast as tf
from benchmarks.discovery.dominant import BACKGROUND, judge, runs_of
from benchmarks.machines import bar
from thermofast.estimation.estimate import NOT_LIKELIER
from thermofast.models.coloured import fit_disturbed
from thermofast.models.effects import BUILT_IN
from thermofast.models.joint import LEVEL, RATE, START, fit_model
from thermofast.models.noise.spectral import CORNERS, POWERS, STEEPNESS, block_means, spectral_likelihood
from thermofast.models.search.candidates import try_add
from thermofast.models.search.discover import discover, discover_together
from thermofast.models.search.dominant import decide
from thermofast.observing.observe import observe
from thermofast.pipeline.averaged import averaged
from thermofast.records import IdentifyRecord

EFFECTS = {kind.id: kind for kind in BUILT_IN}


def seen_of(**columns):
    return observe(tf.read(columns)).seen


# --- the unknown disturbance ---------------------------------------------------------------------------------------------------------


def test_the_likelihood_of_a_disturbance_is_that_of_its_dense_covariance():
    rng, n, scale = np.random.default_rng(1), 24, 0.7
    means = np.cumsum(rng.standard_normal(n))
    basis, cycle = dct(np.eye(n), norm="ortho", axis=0), 0.5 * np.arange(n)
    best = -np.inf
    for p in STEEPNESS:
        for corner in CORNERS:
            for rho in POWERS[::4]:
                shape = 1.0 + rho / np.maximum(cycle**2 + corner**2, 0.25) ** p
                size = max(1.0, float(((basis @ means / scale) ** 2 / shape).mean()))
                covariance = scale**2 * size * basis.T @ np.diag(shape) @ basis
                best = max(best, multivariate_normal.logpdf(means, cov=covariance, allow_singular=True))
    found = spectral_likelihood(means[None], np.array([scale])) - 0.5 * n * np.log(2.0 * np.pi) - n * np.log(scale)
    assert found >= best - 1e-6  # a finer grid of powers
    assert found == pytest.approx(best, abs=0.5)


def test_sensors_that_move_together_count_once():
    rng = np.random.default_rng(2)
    walk, noise = np.cumsum(rng.standard_normal(200)), 1e-3 * rng.standard_normal(200)
    alone = spectral_likelihood(walk[None], np.ones(1))
    quiet = spectral_likelihood(1e-3 * noise[None], np.ones(1))
    twice = spectral_likelihood(np.array([walk, walk + noise]), np.ones(2))
    assert twice - quiet == pytest.approx(spectral_likelihood(np.sqrt(2.0) * walk[None], np.ones(1)), abs=1.0)
    assert twice - quiet > 1.5 * alone


def test_block_means_weigh_readings_and_bridge_gaps():
    time = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    residual, weight = np.array([[1.0, 2.0, 9.0, 9.0, 5.0, 6.0]]), np.array([[1.0, 1.0, 0.0, 0.0, 1.0, 3.0]])
    means, weights = block_means(residual, weight, time, 3)
    assert means[0] == pytest.approx([1.5, 3.625, (5.0 + 18.0) / 4.0])
    assert weights.shape == (1, 3)


# --- what is named -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("simulator", "effect", "seed"),
    [
        ("network", "transport_delay", 910_004),
    ],
)
def test_the_effect_that_matters_is_named(simulator, effect, seed):
    found = judge((simulator, effect, seed))
    assert found.right
    assert not found.wrong
    assert found.held < 0.5


@pytest.mark.parametrize(("simulator", "seed"), [("bar", 920_001)])
def test_a_background_alone_names_nothing_but_itself(simulator, seed):
    assert set(judge((simulator, None, seed)).named) <= BACKGROUND


@pytest.mark.parametrize("kind", ["chirp"])
def test_a_cause_outside_the_catalogue_is_given_no_name(kind):
    assert judge(("outside", kind, 930_001)).named == []


def test_heat_conducted_both_ways_is_a_link():
    time = np.arange(0.0, 400.0, 2.0)

    def slope(_t, state):
        a, b = state
        return [0.02 * (20.0 - a) + 0.05 * (b - a) * 0.2, 0.9 + 0.02 * (20.0 - b) + 0.05 * (a - b) * 0.2]

    curves = solve_ivp(slope, (0.0, 400.0), [20.0, 20.0], t_eval=time, rtol=1e-8, atol=1e-8).y
    noise = 0.01 * np.random.default_rng(3).standard_normal(curves.shape)
    seen = seen_of(time_min=time, a=curves[0] + noise[0], b=curves[1] + noise[1])
    link = try_add(fit_model(seen), EFFECTS["neighbour_heat"]())
    assert link.fit.physical
    assert link.fit.values[0, "kappa"] == pytest.approx([0.01, 0.01], rel=0.15)


@pytest.mark.proof
def test_a_record_that_turns_round_in_the_middle_still_shows_its_switch():
    time = np.arange(0.0, 420.0)

    def slope(t, state):
        return [0.5 - (0.025 if t < 135.0 else 0.06) * (state[0] - 20.0)]

    curve = solve_ivp(slope, (0.0, 419.0), [20.0], t_eval=time, rtol=1e-8, atol=1e-8, max_step=1.0).y[0]
    rng = np.random.default_rng(4)
    seen = seen_of(time_min=time, a=curve + 0.02 * rng.standard_normal(420), b=curve + 0.02 * rng.standard_normal(420))
    base = fit_model(seen)
    assert np.median(base.values[RATE]) * seen.span < 0.3
    found = discover(seen, [kind() for kind in BUILT_IN])
    assert found.verdict == "cooling_switch"
    assert found.named.fit.values[0, "event"] == pytest.approx(135.0, abs=1.0)
    assert found.named.fit.values[0, "ratio"] == pytest.approx(2.4, rel=0.02)


# --- several runs --------------------------------------------------------------------------------------------------------------------


def step_run(rng, at, size):
    """A load that changes by `size` at `at` [min], beside a load that flutters: exact between readings."""
    time, state, rows = np.arange(0.0, 400.0), np.array([20.0, 20.0, 20.0]), []
    load, fall = 1.0, np.exp(-np.array([0.02, 0.025, 0.03]))
    for t in time:
        rows.append(state)
        load = 1.0 + 0.97 * (load - 1.0) + 0.0015 * rng.standard_normal()
        state = 20.0 + (state - 20.0) * fall + 10.0 * (load + (size if t >= at else 0.0)) * (1.0 - fall)
    reading = np.array(rows).T + 0.01 * rng.standard_normal((3, 400))
    return seen_of(time_min=time, **dict(zip("abc", reading, strict=True)))


def test_what_one_run_alone_shows_is_its_event():
    rng = np.random.default_rng(5)
    runs = [step_run(rng, 180.0, 0.3), step_run(rng, 180.0, 0.0)]
    first, second = discover_together(runs, [EFFECTS[n]() for n in ("load_step", "sensor_lag", "second_mode", "friction_decay")])
    assert first.verdict == "load_step", [s.candidate.identifiable for s in first.stages]
    assert first.named.fit.values[0, "event"] == pytest.approx(180.0, abs=2.0)
    assert "load_step" not in second.verdict


def test_diagnose_together_says_in_how_many_runs(tool, tmp_path):
    machine = bar.simulate(940_001, 1.0, "sensor_lag", runs=2)
    paths = []
    for k, run in enumerate(runs_of(machine, 940_001)):
        columns = {"time_min": run.time_s / 60.0, **run.channels, **run.ambient}
        paths.append(tmp_path / f"run{k}.csv")
        np.savetxt(paths[-1], np.array(list(columns.values())).T, delimiter=",", header=",".join(columns), comments="")
    done = tool("diagnose", "--together", *paths, "--format", "json", "-q")
    records = json.loads(done.out)["records"]
    assert len({r["run"] for r in records}) == 2
    assert all("sensor_lag" in r["verdict"] for r in records)
    assert all("sensor_lag: in all of 2 runs" in r["message"] for r in records)
    again = tmp_path / "again.csv"
    again.write_bytes(paths[0].read_bytes())
    copied = tool("diagnose", "--together", paths[0], again)
    assert copied.code == 2
    assert "is a copy of" in copied.err
    alone = tool("diagnose", "--together", paths[0])
    assert alone.code == 2
    assert "several runs" in alone.err


# --- what a user sees ----------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def drifting(tmp_path_factory):
    machine = bar.simulate(950_001, 1.0, "nonlinear_loss")
    run = runs_of(machine, 950_001)[0]
    path = tmp_path_factory.mktemp("runs") / "run.csv"
    columns = {"time_min": run.time_s / 60.0, **run.channels, **run.ambient}
    np.savetxt(path, np.array(list(columns.values())).T, delimiter=",", header=",".join(columns), comments="")
    return path


def test_diagnose_says_how_much_and_what_remains(tool, drifting):
    told = json.loads(tool("diagnose", drifting, "--format", "json", "-q").out)["records"]
    for r in told:
        assert r["status"] == "partly_explained"
        assert r["verdict"].split("+")[0] == "nonlinear_loss"
        assert 0.5 < r["explained_share"] <= 1.0
        assert r["remaining_c"] < 0.5 * r["rmse_base_ahead_c"]
        assert r["explained"][0]["effect"] == "nonlinear_loss"
        assert r["explained"][0]["rmse_ahead_c"] == pytest.approx(r["rmse_ahead_c"], rel=1.0)
        assert "What remains is" in r["message"]
        assert "% of the misfit" in r["message"]


def test_improve_auto_goes_the_same_way(tool, drifting):
    told = json.loads(tool("improve", drifting, "--auto", "--format", "json", "-q").out)["records"]
    steps = [[r["rmse_ahead_c"] for r in told if r["step"] == k] for k in range(max(r["step"] for r in told) + 1)]
    assert len(steps) >= 2
    assert np.sqrt(np.mean(np.square(steps[-1]))) < 0.5 * np.sqrt(np.mean(np.square(steps[0])))
    assert "unknown disturbance" in told[-1]["stopped_because"]
    assert told[-1]["status"] == "partly_explained"


# --- identify --auto -----------------------------------------------------------------------------------------------------------------


def lossy(exponent, noise, rng):
    """A body whose loss rises with its temperature, to its limit known in closed form."""
    time = np.arange(0.0, 420.0)
    limit = 20.0 + 12.0 * 1.0
    rate = 0.03

    def slope(_t, state):
        over = max(state[0] - 20.0, 0.0) / 12.0
        return [12.0 * rate * (1.0 - over**exponent)]

    curve = solve_ivp(slope, (0.0, 419.0), [20.0], t_eval=time, rtol=1e-9, atol=1e-9).y[0]
    return time, curve + noise * rng.standard_normal((3, 420)), limit


def test_what_is_missing_is_added_before_the_prediction_is_made():
    rng, plain, auto, held = np.random.default_rng(6), [], [], []
    for exponent in (1.3, 1.5):
        time, reading, limit = lossy(exponent, 0.01, rng)
        table = {"time_min": time, **{f"T{i}": row for i, row in enumerate(reading)}, "ambient": np.full(420, 20.0)}
        for way, errors in ((False, plain), (True, auto)):
            for r in tf.identify(table, until=80, auto=way):
                errors.append(r.steady_state_c - limit)
                if way:
                    held.append(r.steady_state_lo_c <= limit <= r.steady_state_hi_c)
                    assert "--auto: nonlinear_loss" in r.message
    assert np.sqrt(np.mean(np.square(auto))) < 0.5 * np.sqrt(np.mean(np.square(plain)))
    assert np.mean(held) >= 0.8


def test_an_interval_counts_that_the_effect_may_be_another():
    def record(middle, low, high):
        return IdentifyRecord("run", "T", "afukf", steady_state_c=middle, steady_state_lo_c=low, steady_state_hi_c=high)

    added, plain = record(30.0, 29.8, 30.2), record(32.0, 31.0, 33.0)
    both = averaged(added, plain, 1)
    rng = np.random.default_rng(8)
    draws = np.concatenate([rng.normal(30.0, 0.2 / 1.96, 850_000), rng.normal(32.0, 1.0 / 1.96, 150_000)])
    assert both.steady_state_c == 30.0
    assert both.steady_state_lo_c == pytest.approx(np.quantile(draws, 0.025), abs=0.01)
    assert both.steady_state_hi_c == pytest.approx(np.quantile(draws, 0.975), abs=0.02)
    assert "32.00 degC would come" in both.message
    assert averaged(added, record(30.0, 29.8, 30.2), 1).message == ""
    assert averaged(added, record(32.0, None, 33.0), 1).steady_state_hi_c == 30.2


def test_auto_says_that_the_readings_show_nothing_missing_and_refuses_a_model(tool):
    told = tf.identify("sample_runs/spindle.csv", until=90, channels=["T3"], auto=True)[0]
    assert "--auto: the readings used show nothing missing" in told.message
    refused = tool("identify", "sample_runs/spindle.csv", "--auto", "--model", "machine.toml")
    assert refused.code == 2


# --- errors beside a disturbance -----------------------------------------------------------------------------------------------------


@pytest.mark.proof
def test_parameters_are_no_surer_than_a_disturbance_lets_them():
    rng, white, disturbed = np.random.default_rng(7), [], []
    for _ in range(12):
        seen = step_run(rng, 500.0, 0.0)
        fit = fit_model(seen)
        both = fit_disturbed(fit)
        truth = np.array([30.0, 30.0, 30.0])
        white += list(np.abs(fit.values[LEVEL] - truth) < 1.96 * fit.deviations[LEVEL])
        disturbed += list(np.abs(both.values[LEVEL] - truth) < 1.96 * both.deviations[LEVEL])
        assert both.columns is not None
        assert both.values[START] == pytest.approx(20.0, abs=0.2)
    assert np.mean(white) < 0.6
    assert np.mean(disturbed) > 0.85


@pytest.mark.proof
def test_runs_of_two_machines_are_told_and_nothing_is_named(tool, tmp_path):
    def run(tau, seed):
        time = np.arange(0.0, 400.0)
        late = np.random.default_rng(seed).normal(0.0, 0.02, (3, len(time)))
        heat = [
            8.0 * (1 + 0.1 * i) * (-np.expm1(-time / tau) - 0.3 * (-np.expm1(-np.maximum(time - 150, 0) / tau))) for i in range(3)
        ]
        return {"time_min": time} | {f"T{i}": 20.0 + h + n for i, (h, n) in enumerate(zip(heat, late, strict=True))}

    paths = [tmp_path / f"{name}.csv" for name in ("one", "again", "other")]
    for path, tau, seed in zip(paths, (60.0, 63.0, 160.0), (1, 2, 3), strict=True):
        pd.DataFrame(run(tau, seed)).to_csv(path, index=False)
    same = tf.diagnose(paths[:2], effects=["load_step", "second_mode"], together=True)
    assert {r.verdict for r in same.records} == {"load_step"}
    mixed = tf.diagnose([paths[0], paths[2]], effects=["load_step", "second_mode"], together=True)
    assert {r.verdict for r in mixed.records} == {"unexplained"}
    assert "two machines (other is 2.7 times as slow as one)" in mixed[0].message.replace(f"{tmp_path}/", "").replace(".csv", "")
    assert "of the same size and colour" not in mixed[0].message
    assert "give runs of one machine" in mixed[0].advice
    grown = tf.improve([paths[0], paths[2]], auto=True, together=True)
    assert "two machines" in grown.records[0].stopped_because


def test_a_set_of_three_effects_is_no_ground_for_ok():
    def record(middle, low, high, message="", status="ok"):
        return IdentifyRecord(
            "run",
            "T",
            "afukf",
            steady_state_c=middle,
            steady_state_lo_c=low,
            steady_state_hi_c=high,
            status=status,
            message=message,
        )

    added, plain = record(30.0, 29.8, 30.2), record(31.0, 30.0, 32.0)
    two, three = averaged(added, plain, 2), averaged(added, plain, 3)
    assert (two.status, three.status) == ("ok", "model_doubtful")
    assert three.steady_state_hi_c > two.steady_state_hi_c
    assert three.message.startswith("3 effects had to be added")
    found = f"{NOT_LIKELIER}; the law fails; --auto: sensor_lag added, which explains all"
    told = averaged(record(30.0, 29.8, 30.2, found), plain, 3)
    assert (told.steady_state_c, told.steady_state_lo_c, told.steady_state_hi_c, told.status) == (31.0, 30.0, 32.0, plain.status)
    assert told.message == f"{NOT_LIKELIER}; --auto: sensor_lag found, which explains all"


def test_what_a_usual_disturbance_explains_as_well_is_not_added():
    """Half a minute of a probe's lag is what machines have: it is found, and counted as a part of their background already."""
    time, rng = np.arange(0.0, 36.5, 0.5), np.random.default_rng(2)
    loss, link = np.diag([1 / 60, 1 / 55, 1 / 66]), np.array([[-1, 1, 0], [1, -2, 1], [0, 1, -1]]) / 200.0
    rates, modes = np.linalg.eigh(loss - link)
    heat = np.array([0.3, 0.1, 0.2])
    late = 0.5 * rates[:, None]
    answer = 1.0 - (np.exp(-np.outer(rates, time)) - late * np.exp(-2.0 * time)) / (1.0 - late)
    rise = modes @ (((modes.T @ heat) / rates)[:, None] * answer)
    table = {"time_min": time} | {f"T{i}": 20.0 + row + rng.normal(0.0, 0.01, len(time)) for i, row in enumerate(rise)}
    found, plain = tf.identify(table, auto=True, details=True), tf.identify(table, details=True)
    for drawn, without in zip(found.curves, plain.curves, strict=True):  # the picture is of the row's numbers
        assert np.array_equal(drawn.band_high, without.band_high)
    for r, without, limit in zip(found, plain, 20.0 + np.linalg.solve(loss - link, heat), strict=True):
        assert r.message.startswith(NOT_LIKELIER), r.message
        assert "lag" in r.message
        assert " found, which explains" in r.message
        assert (r.status, r.steady_state_hi_c) == (without.status, without.steady_state_hi_c)
        assert r.steady_state_lo_c <= limit <= r.steady_state_hi_c


@pytest.mark.proof
def test_one_effect_does_not_take_the_place_of_two_that_explain_far_more():
    """A second mass, and a load that halves, and waves of 0.05 K that nobody models: a cooling alone explains a part of both."""
    rng, step = np.random.default_rng(0), 0.1
    time = np.arange(0.0, 300.0 + step, step)
    tau, rise, here, behind, out = np.array([40.0, 50.0]), np.array([16.0, 11.0]), np.full(2, 20.0), np.full(2, 20.0), []
    for minute in time:
        out.append(here)
        heat = rise * (1.0 if minute < 110.0 else 0.5)
        flow = 0.9 / tau * (behind - here)
        here, behind = here + step * ((heat - (here - 20.0)) / tau + flow), behind - step * flow / 2.0
    reading = np.array(out)[::20] + 0.03 * rng.standard_normal((151, 2))
    reading += 0.05 * np.sin(time[::20] / 37.0 + np.array([[0.3], [1.1]])).T
    found = tf.diagnose({"time_min": time[::20], "front": reading[:, 0], "rear": reading[:, 1]})
    assert set(found[0].verdict.split("+")) == {"load_step", "second_mode"}
    assert found[0].event_min == pytest.approx(110.0, abs=1.0)
    assert all(r.rmse_ahead_c < 0.2 * r.rmse_base_ahead_c for r in found)


def _candidate(worth, share, far=False, gain=None):
    """What `decide` asks of an effect that was weighed, sound by itself."""
    told = {"worth": worth, "share": share, "gain": 100.0 * worth if gain is None else gain, "physical": True}
    return SimpleNamespace(**told, distant_surroundings=far, clear=lambda *asked: True)


def test_what_needs_surroundings_far_away_is_no_rival_of_what_needs_none():
    before = (SimpleNamespace(model=SimpleNamespace(parts=())),)
    room, load, cooling = _candidate(307.0, 0.990), _candidate(290.0, 0.985, far=True), _candidate(288.0, 0.984, far=True)
    stage = decide(before, [room, load, cooling])
    assert (stage.named, stage.rival) == (room, None)
    assert decide(before, [load, cooling]).rival is cooling  # where all do, they are told beside each other
    near = [_candidate(w, 0.98) for w in (307.0, 290.0, 288.0)]
    assert decide(before, near) is None


def test_what_leaves_as_little_of_the_misfit_is_told_beside_however_less_its_evidence():
    before = (SimpleNamespace(model=SimpleNamespace(parts=())),)
    cooling, load = _candidate(106.0, 0.9852, gain=11118.0), _candidate(67.0, 0.9841, gain=10948.0)
    assert decide(before, [cooling, load]).rival is load
    assert decide(before, [cooling, _candidate(67.0, 0.97, gain=10948.0)]).rival is None


def test_what_was_found_takes_no_sure_answer_away():
    """Where the readings do not bound the end with what was found, and settle without it as usual machines do, it is not counted."""

    def record(status, low, high, message=""):
        return IdentifyRecord(
            "run", "T", "afukf", status=status, steady_state_c=30.0, steady_state_lo_c=low, steady_state_hi_c=high, message=message
        )

    told = "these readings do not bound the steady state; --auto: neighbour_heat added, which explains 99.9 % of the misfit"
    added, plain = record("not_determined", 20.0, None, told), record("ok", 29.0, 32.0)
    found = averaged(added, plain, 1)
    assert (found.status, found.steady_state_lo_c, found.steady_state_hi_c) == ("ok", 29.0, 32.0)
    assert "neighbour_heat found" in found.message
    assert "not counted" in found.message
    for other in (record("model_doubtful", 29.0, 32.0), record("not_determined", 29.0, None)):
        assert averaged(added, other, 1).steady_state_hi_c is None
    assert averaged(record("ok", 29.5, 30.5, told), plain, 1).status == "ok"
