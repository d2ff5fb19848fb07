"""What is not known of a learnt model, and what speaks against it, in the next run."""

import re
from dataclasses import replace as replaced
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.integrate import solve_ivp
from scipy.stats import multivariate_normal
from scipy.stats import t as student_t
from simulator import held_response

import thermofast as tf
from benchmarks.intervals.half_explained import machine
from thermofast.estimation import imperfect
from thermofast.estimation.estimate import none_yet
from thermofast.estimation.imperfect import _with_unreached
from thermofast.learning.past import _reached
from thermofast.learning.rise import _doubtful
from thermofast.machine.learnt import EFFECT_AGAIN, carry
from thermofast.machine.model import Model
from thermofast.machine.modelfile import model_file, read_model
from thermofast.models.effects import BUILT_IN
from thermofast.models.imperfection import FAST_MODES, NONE, SLOW_MODES, TYPICAL, Part, Past, SensorShape
from thermofast.models.imperfection.machine.known import Known
from thermofast.models.imperfection.machine.past import GRID, SHAPE_AGAIN, modes
from thermofast.models.imperfection.posterior import settle
from thermofast.models.imperfection.shapes import Asked
from thermofast.models.joint import LEVEL, RATE, START, Key, fit_model
from thermofast.models.search.candidates import try_add
from thermofast.models.uncertainty.pooled import SCATTER, dependence, pool
from thermofast.observing.observe import observe

LACKING = 720  # a second mass and a loss that grows, of which the model is told the mass
COUNT = len(SLOW_MODES) + len(FAST_MODES) + 1


@pytest.fixture(scope="module")
def lacking():
    runs, limits, tau, _ = machine(LACKING)
    return tf.improve(runs[0], add=["second_mode"]).model, runs[2], limits, tau


def score(found, limits):
    """Mean interval score (Winkler, 95 %) [K]."""
    low, high = (np.array([getattr(r, f"steady_state_{side}_c") for r in found]) for side in ("lo", "hi"))
    return np.mean(high - low + 40.0 * np.maximum(low - limits, 0.0) + 40.0 * np.maximum(limits - high, 0.0))


def width(found):
    return np.array([r.steady_state_hi_c - r.steady_state_lo_c for r in found])


def test_a_model_that_lacks_an_effect_says_so_and_its_intervals_make_room_for_it(lacking):
    model, run, limits, tau = lacking
    assert [e.id for e in model.file.effects] == ["second_mode"]
    assert model.file.past.unexplained == ("T1", "T2", "T3")
    told = tf.identify(run, until=4 * tau, model=model)
    for r, limit in zip(told, limits, strict=True):
        assert r.status == "ok"
        assert r.steady_state_lo_c <= limit <= r.steady_state_hi_c
        assert "it leaves a pattern in T1, T2, T3" in r.message
    # The same model taken for the whole truth is surer, and wrong.
    whole = Model(replace(model.file, past=replace(model.file.past, unexplained=())), model.source)
    surer = tf.identify(run, until=4 * tau, model=whole)
    assert np.all(width(surer) < 0.8 * width(told))
    assert sum(r.steady_state_lo_c <= limit <= r.steady_state_hi_c for r, limit in zip(surer, limits, strict=True)) < 3
    # It still knows more than nothing does; earlier too, by the interval score, which counts width and misses.
    assert np.all(width(told) < width(tf.identify(run, until=4 * tau)))
    for turns in (1.0, 2.0, 3.0, 4.0):
        with_model, without = (score(tf.identify(run, until=turns * tau, **given), limits) for given in ({"model": model}, {}))
        assert with_model < 0.85 * without


def test_a_model_of_both_effects_leaves_nothing_unexplained():
    runs, limits, tau, effects = machine(LACKING)
    model = tf.improve(runs[0], add=list(effects)).model
    assert model.file.past.unexplained == ()
    for r, limit in zip(tf.identify(runs[2], until=2 * tau, model=model), limits, strict=True):
        assert r.status == "ok"
        assert r.steady_state_lo_c <= limit <= r.steady_state_hi_c


def test_the_doubt_of_a_rise_is_what_was_known_before_the_readings_at_hand(tmp_path):
    runs, _, tau, _ = machine(703)  # a second mass and friction, whose constants the sensors share
    learnt = tf.improve(runs[0], add=["second_mode", "friction_decay"])
    path = tmp_path / "machine.toml"
    learnt.model.save(path)
    file = read_model(str(path))
    of = {c.channel: c for c in file.correlations}
    assert {"rate", "second_mode.kappa", "friction_decay.extra", "friction_decay.time_constant"} <= set(of["T1"].names)
    seen = observe(runs[2], 0.0).seen.until(2 * tau)
    fit = carry(file, seen, "run", str(path)).fit
    moves = _doubtful(fit, 0)
    columns = [c.key for c in (*fit.model.local, *fit.model.shared)]
    assert not moves[:, [columns.index(LEVEL), columns.index(START)]].any()  # the run's own: its readings tell them
    covariance = moves.T @ moves
    ids = {p.id: k for k, p in enumerate(fit.model.parts)}
    numbers = {("rate", -1): next(n for n in file.base if n.name == "rate" and n.channel == "T1")}
    for e in file.effects:
        numbers |= {(n.name, ids[e.id]): n for n in e.parameters if n.channel in (None, "T1")}
    log = {c.key: c.parameter.log for c in (*fit.model.local, *fit.model.shared)}

    def deviation(key, share):
        """Of a constant in the coordinate that is searched, from the file and a share of it beside."""
        n = numbers[key.name, key.part]
        return np.hypot(n.standard_error, share * n.value) / (n.value if log[key] else 1.0)

    for name, part in numbers:
        key = RATE if part < 0 else Key(part, name)
        at = columns.index(key)
        assert np.sqrt(covariance[at, at]) == pytest.approx(deviation(key, SCATTER if part >= 0 else 0.0), rel=0.02)
    # The correlation of a sensor's own with what all share comes through the file.
    one, two = Key(ids["second_mode"], "kappa"), Key(ids["friction_decay"], "extra")
    told = of["T1"].matrix[of["T1"].names.index("second_mode.kappa")][of["T1"].names.index("friction_decay.extra")]
    found = covariance[columns.index(one), columns.index(two)]
    assert found == pytest.approx(told * deviation(one, SCATTER) * deviation(two, SCATTER), rel=0.02)
    assert abs(told) > 0.3
    # The same model with a pattern left doubts each constant by a quarter of it.
    doubted = replace(file, past=replace(file.past, unexplained=("T1",)))
    more = _doubtful(carry(doubted, seen, "run", str(path)).fit, 0)
    at = columns.index(one)
    assert np.sqrt((more.T @ more)[at, at]) == pytest.approx(deviation(one, EFFECT_AGAIN), rel=0.02)


def test_what_a_shape_had_to_be_bent_by_is_open_by_a_share_of_itself():
    bend = np.zeros(COUNT)
    bend[1], bend[-1] = 0.2, -0.1
    shape = SensorShape(-4.0, 0.05, bend, 1e-6 * np.eye(COUNT))
    found = shape.in_another_run - shape.covariance
    assert found[1, 1] == pytest.approx(2 * (SHAPE_AGAIN * 0.2) ** 2)
    assert found[1, -1] == pytest.approx(SHAPE_AGAIN**2 * 0.2 * -0.1)
    assert not found[0].any()


def test_the_bends_left_open_are_in_what_a_past_knows():
    bend = np.linspace(-0.1, 0.1, COUNT)
    shape = SensorShape(-4.0, 0.05, bend, 1e-4 * np.eye(COUNT))
    doubt = Past({"a": shape}).known(["a"]).doubt[0]
    wanted = np.einsum("xi,ij,xj->x", modes(GRID), shape.in_another_run, modes(GRID))
    assert (doubt**2).sum(axis=0) == pytest.approx(wanted, rel=1e-9, abs=1e-15)


class _Two:
    """Two sensors of a block."""

    rows = np.arange(2)

    def __len__(self):
        return 2


@pytest.mark.parametrize(
    ("past", "without", "let_go"),
    [
        # Past runs: of one sensor or of all.
        (Past({}), [4.0, -9.0], [True, False]),
        (Past({}), [2.0, 2.0], [True, True]),
        (Past({}), [2.0, -9.0], [False, False]),
        (Past({}), [2.9, 0.0], [False, False]),
        # What a search chose must make the readings likelier by a log likelihood of 3 over the run, and of 1 where each sensor may
        # have it or not.
        (Past({}, guessed=True, searched="all"), [-2.0, -0.5], [True, True]),
        (Past({}, guessed=True, searched="all"), [-2.5, -0.6], [False, False]),
        (Past({}, guessed=True, searched="each"), [-5.0, -0.5], [False, True]),
        (Past({}, guessed=True, searched="each"), [-1.4, -1.4], [True, True]),
    ],
)
def test_what_is_known_beyond_the_readings_is_let_go_of_by_evidence(monkeypatch, past, without, let_go):
    """without: the log likelihood that the readings of each sensor gain without it."""
    closed = [SimpleNamespace(sensors=_Two())]
    told = none_yet(2, np.zeros(0), np.zeros(0, dtype=bool))
    for name, value in (("known", True), ("check_p", 0.5), ("strong", 0.0), ("evidence", 0.0)):
        getattr(told, name)[:] = value

    def claim(closed, members, into, *rest, **more):
        into[0].evidence[:], into[0].check_p[:], into[0].strong[:] = without, 0.5, 0.0

    monkeypatch.setattr(imperfect, "_claim", claim)
    imperfect._let_go(closed, [np.ones(2, dtype=bool)], [told], TYPICAL, "auto", str, past)
    assert told.let_go.tolist() == let_go
    assert told.known.tolist() == [not gone for gone in let_go]


@pytest.mark.parametrize(
    ("log_rates", "guessed", "wide"),
    [
        ((-4.0, -4.0), False, False),
        ((-4.0 + 0.19, -4.0 + 0.19), False, False),
        ((-4.0 + 0.21, -4.0 + 0.21), False, True),
        ((-4.0 - 0.21, -4.0 - 0.21), False, True),
        ((-4.0 + 0.5, -4.0), False, True),  # the median of two is their mean
        ((-4.0 + 0.3, np.nan), False, True),
        ((np.nan, np.nan), False, False),
        ((-4.0 + 0.5, -4.0 + 0.5), True, False),
    ],
)
def test_a_run_of_other_rates_than_past_runs_had_is_told_no_surer_than_alone(monkeypatch, log_rates, guessed, wide):
    """A deviation of 0.1 from run to run: 0.08 of the machine, 0.06 of what is known of it. Two of them are more than chance."""
    shape = SensorShape(-4.0, 0.06, np.zeros(COUNT), 1e-6 * np.eye(COUNT))
    past = Past({"0": shape, "1": shape}, scatter=0.08, guessed=guessed)
    closed = [SimpleNamespace(sensors=_Two())]
    told = none_yet(2, np.zeros(0), np.zeros(0, dtype=bool))
    for name, value in (("known", True), ("check_p", 0.5), ("strong", 0.0), ("evidence", 0.0), ("steady", [29.9, 30.0, 30.1])):
        getattr(told, name)[:] = value
    told.t95[:], told.rate[:] = [99.0, 100.0, 101.0], np.exp(np.array(log_rates))[:, None]

    def claim(closed, members, into, *rest, **more):
        into[0].evidence[:], into[0].check_p[:], into[0].strong[:] = -9.0, 0.5, 0.0
        into[0].steady[:], into[0].t95[:] = [30.05, 31.0, 33.0], [90.0, 95.0, 99.0]

    monkeypatch.setattr(imperfect, "_claim", claim)
    imperfect._let_go(closed, [np.ones(2, dtype=bool)], [told], TYPICAL, "auto", str, past)
    assert told.known.all()
    assert told.steady[0].tolist() == ([29.9, 30.0, 33.0] if wide else [29.9, 30.0, 30.1])
    assert told.t95[1].tolist() == ([90.0, 100.0, 101.0] if wide else [99.0, 100.0, 101.0])
    factor = np.exp(np.nanmedian(log_rates) + 4.0) if wide else np.nan
    assert told.as_fast == pytest.approx([factor, factor], nan_ok=True)


def test_a_machine_that_was_changed_beside_its_neighbour_is_told_wide_and_its_next_run_is_not():
    """Two masses that warm each other, by scipy's solver; all heat capacities half as large again move no limit."""

    def of(seed, scale=1.0, load=1.0, hours=6.0):
        time = np.arange(0.0, 60.0 * hours + 0.5)

        def law(t, y):
            a, b = y
            return [(9.0 * load - 0.6 * a - 0.4 * (a - b)) / (40.0 * scale), (0.4 * (a - b) - 0.3 * b) / (60.0 * scale)]

        whole = solve_ivp(law, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-8).y
        noise = np.random.default_rng(seed).normal(0.0, 0.02, whole.shape)
        return {"time_min": time, "head": 20.0 + whole[0] + noise[0], "column": 20.0 + whole[1] + noise[1]}

    limit = 9.0 * np.linalg.solve([[1.0, -0.4], [-0.4, 0.7]], [1.0, 0.0])
    model = tf.improve(of(1), add=["neighbour_heat"]).model
    again = tf.identify(of(2, load=0.9, hours=1.5), model=model)
    for r, rise in zip(again, 0.9 * limit, strict=True):
        assert r.steady_state_lo_c < 20.0 + rise < r.steady_state_hi_c
        assert "times as fast" not in r.message
    changed = tf.identify(of(3, scale=1.5, hours=1.5), model=model)
    for r, rise in zip(changed, limit, strict=True):
        assert r.steady_state_lo_c is None or r.steady_state_lo_c < 20.0 + rise
        assert r.steady_state_hi_c is None or r.steady_state_hi_c > 20.0 + rise
        assert "times as fast as in past runs, more than those differ" in r.message


def test_what_a_model_has_far_beyond_the_end_of_its_run_is_trusted_no_farther_than_the_readings():
    """A loss that falls by a third all day long looks like a slow mass, which would go on for days."""

    def of(seed, minutes, load=1.0):
        time = np.arange(0.0, minutes + 0.5)

        def law(t, y):
            return [load * 0.09 - (1.0 - 0.35 * t / 400.0) * y[0] / 120.0]

        rise = solve_ivp(law, (0.0, time[-1]), [0.0], t_eval=time, rtol=1e-8, atol=1e-8).y[0]
        return {"time_min": time, "a": 20.0 + rise + np.random.default_rng(seed).normal(0.0, 0.02, len(time))}

    model = tf.improve(of(1, 400), add=["second_mode"]).model
    [told] = tf.identify(of(2, 60, 0.9), model=model)
    assert "% of where this model ends: the rest is taken on trust" in told.message
    assert told.status != "ok"
    low = float(re.search(r"its own readings alone say ([\d.]+)\.\.", told.message)[1])
    assert told.steady_state_lo_c == pytest.approx(low, abs=0.005)
    assert told.steady_state_lo_c < 20.0 + 0.9 * 10.8 / 0.65 < told.steady_state_hi_c


@pytest.mark.parametrize("share", [0.69, 0.81])
def test_how_far_a_run_had_come_is_told_of_each_sensor_by_all_that_takes_it_there(share):
    # What its own heat does is done at once: it is a neighbour that is slow.
    own, grid = np.ones(len(GRID)), -np.expm1(-GRID)
    slow = -np.expm1(np.log(1.0 - share) * GRID)  # at x = 1 so much is done
    rises = {
        n: SimpleNamespace(
            held=np.array([own] * 3), whole=np.array([0.0 * grid, line, 0.0 * grid]), nodes=np.zeros(3), log_rate=-4.0
        )
        for n, line in (("a", grid), ("b", slow), ("not in the model", 0.1 * grid))
    }
    one = SimpleNamespace(length_min=float(np.exp(4.0)))
    file = SimpleNamespace(learnt_from=SimpleNamespace(length_min=5.0), also_from=(one,))
    found = _reached(rises, file, ("a", "b"))
    assert found == {"a": pytest.approx(-np.expm1(-1.0), abs=0.005), "b": pytest.approx(share, abs=0.005)}
    assert _reached({}, file, ("a", "b")) == {}


def test_what_two_runs_say_of_a_constant_goes_together_as_in_each():
    runs, *_ = machine(LACKING)
    seen = observe(runs[0], 0.0).seen
    mass = next(effect() for effect in BUILT_IN if effect.id == "second_mode")
    fit = try_add(fit_model(seen), mass).fit
    pooled = pool([fit, fit])
    joint = dependence(fit.residual[0][seen.used[0]]) * fit.joint_covariance(0)
    kept = np.flatnonzero(np.isfinite(np.concatenate([pooled.scatter[0], pooled.shared_scatter])))
    assert len(kept) == 3  # rate, and the second mass's two
    scatter = np.diag(np.concatenate([pooled.scatter[0], pooled.shared_scatter])[kept] ** 2)
    whole = (joint[np.ix_(kept, kept)] + scatter) / 2.0 + scatter  # two runs alike know twice as much; the next one scatters again
    size = np.sqrt(np.diag(whole))
    assert pooled.correlation[0][np.ix_(kept, kept)] == pytest.approx(whole / np.outer(size, size), rel=1e-6)
    half = 0.5 + 0.5 * np.eye(len(pooled.correlation[0]))
    told = replaced(pooled, correlation=np.tile(half, (seen.sensors, 1, 1)))
    matrix = np.array(model_file(fit, "run.csv", 400, None, {}, pooled=told).correlations[0].matrix)
    assert matrix == pytest.approx(0.5 + 0.5 * np.eye(3))


def test_evidence_is_that_of_a_normal_distribution_over_levels_and_students_over_the_rate():
    """Two guesses of the rate: how much likelier the readings are with one is told as by brute force."""
    time, rate, sigma = np.arange(0.0, 61.0, 2.0), 1 / 40, 0.05
    reading = 20.0 + 8.0 * -np.expm1(-rate * time) + sigma * np.random.default_rng(2).standard_normal(len(time))
    law = -np.expm1(-GRID)[None, None]
    wide = 100.0  # variance of start and slope, which are not known: the same for both

    def told(guess, deviation):
        known = Known(np.array([[np.log(guess), deviation]]), GRID, law, law, law, np.zeros((1, 1, len(GRID))))
        part = Part(time, reading[None], np.array([sigma]), np.zeros(1), known=known)
        return settle([part], 40.0, NONE, [], "own").evidence[0]

    def brute(guess, deviation):
        reach = max(6.0 * deviation, 0.5)
        off = np.linspace(-reach, reach, 961)
        columns = [np.stack([np.ones_like(time), -np.expm1(-b * time) / b]) for b in guess * np.exp(off)]
        like = [
            multivariate_normal(np.zeros(len(time)), sigma**2 * np.eye(len(time)) + wide * c.T @ c).logpdf(reading - 20.0)
            for c in columns
        ]
        return np.log(np.trapezoid(np.exp(like) * student_t.pdf(off, 3, 0, deviation), off))

    for one, two in (((1 / 40, 0.05), (1 / 60, 0.05)), ((1 / 40, 0.05), (1 / 42, 0.3))):
        assert told(*one) - told(*two) == pytest.approx(brute(*one) - brute(*two), rel=0.05, abs=0.2)


def test_a_model_of_another_machine_is_let_go_by_evidence_and_its_own_is_not():
    runs, _, tau, _ = machine(806)
    model = tf.improve(runs[0]).model
    for r in tf.identify(runs[2], until=2 * tau, model=model):
        assert "do not fit" not in r.message
    # Another machine, half as fast: well within what a discrepancy could do to a sensor, far likelier without the model.
    time, rate = np.arange(0.0, 121.0), 0.5 / tau
    rng = np.random.default_rng(1)
    other = {f"T{i}": 20.0 + 9.0 * -np.expm1(-rate * time) + 0.02 * rng.standard_normal(len(time)) for i in (1, 2, 3)}
    for r in tf.identify({"time_min": time} | other, until=60, model=model):
        assert "do not fit" in r.message
        assert r.steady_state_lo_c is None or r.steady_state_lo_c <= 29.0
        assert r.steady_state_hi_c is None or r.steady_state_hi_c >= 29.0


def test_an_effect_that_grows_without_end_leaves_the_rest_as_it_was():
    x = np.linspace(0.0, 20.0, 401)
    law = 1.0 - np.exp(-x)[None, None]
    small, wild = 0.05 * x / (1.0 + x), 0.01 * np.expm1(4.0 * x)  # 1e32 rises at the end
    time, asked = np.array([5.0, 30.0, 300.0]), Asked(np.array([60.0, 600.0]))
    doubts = [
        Known(np.array([[np.log(1.0 / 30.0), 0.1]]), x, law, law, law, np.array([columns])).doubts(time, asked)[0]
        for columns in ([small], [small, wild])
    ]
    assert np.isfinite(doubts[1]).all()
    assert np.diagonal(doubts[1]).max() == pytest.approx(100.0**2)
    assert np.linalg.eigvalsh(doubts[1]).min() > -1e-9 * 100.0**2
    assert doubts[1][0, 0] == pytest.approx(doubts[0][0, 0] + (0.01 * np.expm1(4.0 * 5.0 / 30.0)) ** 2, rel=0.05)


def test_a_wave_that_was_found_settles_as_its_mean_does():
    """A lump of 40 min whose heat is on for half of each 20 min: at one phase of the wave it never settles, its mean does at 120."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 240.25, 0.5)
    on = (np.floor(time / 10.0).astype(int) % 2 == 0).astype(float)
    reading = held_response(100.0 / 40.0 * on, 1.0 / 40.0, 0.5)
    columns = {f"T{k}": 20.0 + (reading - 20.0) * (1.0 + 0.05 * k) + rng.normal(0.0, 0.02, len(time)) for k in range(2)}
    for k, row in enumerate(tf.identify({"time_min": time, **columns, "ambient": np.full(len(time), 20.0)}, auto=True)):
        assert "cyclic_load" in row.message
        # The first half period is on: the mean's law begins a little ahead of it.
        assert row.steady_state_lo_c < 20.0 + 50.0 * (1.0 + 0.05 * k) < row.steady_state_hi_c
        assert row.steady_state_hi_c - row.steady_state_lo_c < 3.0
        assert 105.0 < row.t95_lo_min < row.t95_min < row.t95_hi_min < 140.0


def test_a_neighbour_that_is_not_read_is_no_other_sensor():
    """Of a model that links three bodies in a row, a run with the two outer ones: one of them was linked to the other."""
    time, rng = np.arange(0.0, 400.0), np.random.default_rng(12)

    def of(heat):
        def law(_, T):
            return [
                heat - 0.03 * (T[0] - T[1]),
                0.03 * (T[0] + T[2] - 2.0 * T[1]) - 0.02 * T[1],
                0.02 * (T[1] - T[2]) - 0.01 * T[2],
            ]

        rise = solve_ivp(law, (0.0, time[-1]), [0.0] * 3, t_eval=time, rtol=1e-8, atol=1e-8).y
        return {"time_min": time, **dict(zip(("a", "b", "c"), 20.0 + rise + rng.normal(0.0, 0.02, rise.shape), strict=True))}

    model = tf.improve(of(0.3), add=["neighbour_heat"]).model
    run = of(0.4)
    run.pop("b")
    told = tf.identify(run, until=60, model=model)
    alone = tf.identify(run, until=60)
    for row, own in zip(told, alone, strict=True):
        assert f"{row.channel}: heat from b is left out" in row.message
        assert row.steady_state_lo_c <= own.steady_state_lo_c + 1e-9
        assert row.steady_state_hi_c is None or row.steady_state_hi_c >= own.steady_state_hi_c - 1e-9


def test_what_no_past_run_came_to_is_told_by_the_model_alone():
    """Of two links that lead to a slow limit the limits reach as far as what was never seen, within what the readings leave open."""
    one = SimpleNamespace(steady=np.array([[49.0, 50.0, 51.0], [49.0, 50.0, 51.0], [49.0, 50.0, 51.0]]))
    own = SimpleNamespace(steady=np.array([[30.0, 50.0, 52.5], [30.0, 50.0, np.nan], [30.0, 50.0, 60.0]]))
    c = SimpleNamespace(found=SimpleNamespace(initial=np.full(3, 20.0)))
    _with_unreached(c, one, own, np.array([True, True, False]), np.array([0.1, 0.1, 0.1]))
    assert one.steady.tolist() == [[47.0, 50.0, 52.5], [47.0, 50.0, 53.0], [49.0, 50.0, 51.0]]
