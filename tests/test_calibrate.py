"""What is learnt from complete runs: factors by the formula, a file that is read back, and intervals that hold on other machines."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

import thermofast as tf
from benchmarks.intervals.two_masses import machine
from benchmarks.machines import bar
from thermofast.analysis.calibration import CANDIDATES, MOST, OTHER_TIMES, PRIOR_RUNS, TURNS, Past, learn, past_run, to_choose
from thermofast.estimation.request import Method
from thermofast.filters import Afukf
from thermofast.machine.lab import read_imperfection
from thermofast.models import Lump
from thermofast.models.imperfection import TYPICAL


def columns(run, until=None):
    kept = run.time <= (until if until is not None else np.inf)
    return {"time_min": run.time[kept]} | {f"T{i}": line[kept] for i, line in enumerate(run.reading)}


def pasts(errors, half=0.5):
    """Runs of two sensors whose ends lie `errors` (runs, 2) [K] below what was foretold, to within +-half at every turn."""
    found = []
    for k, pair in enumerate(errors):
        end = np.array([30.0, 31.0])
        middle = end + np.array(pair)
        three = np.stack([middle - half, middle, middle + half], axis=1)
        found.append(Past(f"run {k}", np.broadcast_to(three, (len(CANDIDATES), len(TURNS), 2, 3)).copy(), end))
    return found


def test_factors_are_those_of_the_formula():
    errors = [(0.5, -0.25), (0.75, 0.5), (-1.0, 0.25)]
    lab = learn(pasts(errors))
    squares = sum(np.mean((1.96 * np.array(pair) / 0.5) ** 2) for pair in errors)
    pooled = (PRIOR_RUNS + squares) / (PRIOR_RUNS + 3)
    size = np.sqrt((OTHER_TIMES * pooled + squares) / (OTHER_TIMES + 3))
    expected = student.ppf(0.975, PRIOR_RUNS + 3) * size / 1.96
    assert [factor for _, factor in lab.prior.factors] == pytest.approx([expected] * len(TURNS), rel=1e-6)
    assert lab.records[0].factor == pytest.approx(expected, rel=1e-6)
    assert lab.records[0].held_typical == pytest.approx(4 / 6)
    assert lab.records[0].conformal_factor is None  # 95 % of three runs cannot be told


def test_a_time_at_which_all_ends_lie_far_off_widens_its_own_intervals_most():
    plain, far = pasts([(0.1, 0.1)] * 3), pasts([(1.5, 1.5)] * 3)
    for one, other in zip(plain, far, strict=True):
        one.foretold[:, 2] = other.foretold[:, 2]
    factors = [factor for _, factor in learn(plain).prior.factors]
    squares = 3 * (1.96 * 1.5 / 0.5) ** 2
    small = 3 * (1.96 * 0.1 / 0.5) ** 2
    turns = len(TURNS)
    pooled = (PRIOR_RUNS + (squares + (turns - 1) * small) / turns) / (PRIOR_RUNS + 3)
    sizes = [np.sqrt((OTHER_TIMES * pooled + s) / (OTHER_TIMES + 3)) for s in (small, squares)]
    expected = [student.ppf(0.975, PRIOR_RUNS + 3) * size / 1.96 for size in sizes]
    assert [factors[0], factors[2]] == pytest.approx(expected, rel=1e-6)


def test_conformal_prediction_is_shown_where_runs_suffice():
    errors = [(0.1 * k, 0.05 * k) for k in range(1, 21)]
    [row, *_] = learn(pasts(errors)).records
    assert row.conformal_factor == pytest.approx(2.0 / 0.5)  # rank 20 of 20: the largest run


@pytest.fixture(scope="module")
def lab():
    return tf.calibrate([tf.read(columns(bar.simulate(seed).runs[0]), name=f"past {seed}") for seed in range(8000, 8006)])


@pytest.mark.proof
def test_intervals_after_calibration_hold_on_other_machines_and_are_narrower(lab):
    held, width = {"typical": [], "lab": []}, {"typical": [], "lab": []}
    for seed in range(8100, 8112):
        run = bar.simulate(seed).runs[0]
        for name, prior in (("typical", "typical"), ("lab", lab.prior)):
            for i, r in enumerate(tf.identify(columns(run), until=60, at=410, imperfection=prior).records):
                held[name].append(r.at_lo_c <= run.clean[i, int(np.searchsorted(run.time, 410.0))] <= r.at_hi_c)
                width[name].append(r.at_hi_c - r.at_lo_c)
    assert np.mean(held["lab"]) >= 0.83  # of 36 sensors on 12 machines
    assert np.median(width["lab"]) < 0.95 * np.median(width["typical"])


@pytest.mark.proof
def test_machines_that_are_the_law_get_the_intervals_of_the_law():
    past = [tf.read(columns(bar.simulate(s, exact=True).runs[0]), name=f"past {s}") for s in range(8200, 8204)]
    prior = tf.calibrate(past).prior
    run = bar.simulate(8300, exact=True).runs[0]
    typical, lab = (tf.identify(columns(run), until=120, imperfection=p).records[0] for p in ("typical", prior))
    assert lab.steady_state_hi_c - lab.steady_state_lo_c < 0.6 * (typical.steady_state_hi_c - typical.steady_state_lo_c)


def test_the_file_is_read_back(tmp_path):
    lab = tf.calibrate([tf.read(columns(bar.simulate(seed).runs[0]), name=f"past {seed}") for seed in range(8000, 8003)])
    lab.save(tmp_path / "lab.toml")
    again = read_imperfection(str(tmp_path / "lab.toml"))
    rounded = tuple((t, pytest.approx(f, rel=1e-3)) for t, f in lab.prior.factors)
    assert replace(again, factors=()) == replace(lab.prior, factors=())
    assert again.factors == rounded
    text = (tmp_path / "lab.toml").read_text()
    assert "# How imperfect the machines of this lab are: learnt by thermofast calibrate from 3 complete runs." in text
    lab.save(tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text().startswith("run,channel,time_constants")
    (tmp_path / "lab.toml").write_text("[imperfection]\nfactors = [[2, 1], [1, 1]]\n")
    with pytest.raises(tf.ThermofastError, match="out of order"):
        read_imperfection(str(tmp_path / "lab.toml"))


def test_runs_that_cannot_be_used_are_told_and_one_is_too_few(tmp_path, tool):
    names = []
    for k, until in enumerate((None, None, 60.0)):
        run = columns(bar.simulate(8000 + k).runs[0], until)
        lines = [",".join(run), *(",".join(f"{v:.4f}" for v in row) for row in zip(*run.values(), strict=True))]
        names.append(tmp_path / f"past{k}.csv")
        names[-1].write_text("\n".join(lines))
    done = tool("calibrate", *names, "--lab", tmp_path / "lab.toml", "--format", "json", "-q")
    assert done.code == 0
    found = json.loads(done.out)["records"]
    assert [r["status"] for r in found] == ["ok"] * len(TURNS) + ["not_used"]
    assert "a complete run has 3.5" in found[-1]["message"]
    assert tool("identify", names[2], "--imperfection", tmp_path / "lab.toml", "-q").code == 0
    refused = tool("calibrate", names[0], names[2], "-q")
    assert refused.code == 2
    assert "calibrate learns from two complete runs at least, and of 2 given 1 can be used" in refused.err
    assert "stay with --imperfection typical" in refused.err
    assert "--lab writes TOML" in tool("calibrate", *names, "--lab", tmp_path / "lab.csv").err


@pytest.mark.proof
def test_complete_runs_of_machines_that_are_far_from_the_law_are_used_too():
    """Two bodies of which the second settles slowly: by the bare law such runs never seemed to end."""
    time = np.arange(0.0, 400.0, 2.0)
    runs = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        share = rng.uniform(0.15, 0.3)
        rise = 9.0 * ((1.0 - share) * -np.expm1(-time / 50.0) + share * -np.expm1(-time / 110.0))
        wander = np.cumsum(rng.normal(0.0, 0.02, len(time)))
        made = {f"T{k}": 20.0 + rise * (0.7 + 0.1 * k) + wander + rng.normal(0.0, 0.02, len(time)) for k in range(3)}
        runs.append(tf.read({"time_min": time, **made}, name=f"past {seed}"))
    found = tf.calibrate(runs)
    assert sum(r.status == "not_used" for r in found.records) == 0
    assert found.records[-1].runs == 6


@pytest.mark.proof
def test_machines_with_a_slow_mass_each_are_not_said_to_have_none():
    """What each run goes on to climb is no room's wandering, of which the priors that take strong effects for rare make it."""
    past = [tf.read({n: c for n, c in machine(3000 + k, 1)[2][0][0].items() if n != "ambient"}, name=f"p{k}") for k in range(5)]
    lab = tf.calibrate(past)
    assert lab.prior.strong_share == TYPICAL.strong_share
    assert not lab.prior.rarely_strong
    assert "strong effects are common in these machines" in lab.records[0].message
    assert "improve --together" in lab.records[0].message


def test_few_runs_choose_among_no_priors():
    assert to_choose(3) == (TYPICAL,)
    assert to_choose(4) == CANDIDATES


def test_runs_that_still_move_at_their_end_and_widths_that_do_not_suffice_are_told():
    """A tenth of the rise of a slow part of 900 min goes on where runs of eight time constants end."""

    def run(k, slow):
        rng, time = np.random.default_rng(k), np.arange(481.0)
        rises = [r * ((1.0 - slow) * -np.expm1(-time / 60.0) + slow * -np.expm1(-time / 900.0)) for r in (8.0, 11.0)]
        return tf.read({"time_min": time} | {f"T{i}": 20.0 + r + 0.02 * rng.standard_normal(481) for i, r in enumerate(rises)})

    still, going_on = (past_run((run(1, slow), 0.0), Method(Lump(), Afukf()), CANDIDATES[:1]) for slow in (0.0, 0.3))
    assert (still.settled, going_on.settled) == (1.0, 0.0)
    few = [replace(one, settled=0.4) for one in pasts([(0.1, 0.1)] * 2)]
    told = learn([*few, *pasts([(0.1, 0.1)] * 3)]).records[0].message
    assert told.startswith("in 2 of 5 runs most points still move at the end: what comes after it was not tried")
    assert learn([replace(one, settled=0.5) for one in few]).records[0].message == ""
    far = learn(pasts([(9.0, 9.0)] * 3)).records[0]
    assert (far.factor, far.message) == (MOST, "the errors ask for more than 4 times the width")
    assert "times the width" not in learn(pasts([(0.5, 0.5)] * 3)).records[0].message
