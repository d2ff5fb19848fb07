"""Settling times are those that the readings show, where they show them; a probe that died, and what stands on the past alone, are told."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

import thermofast as tf
from tests.priors import SMALL_SLOW
from thermofast.analysis.bench import Trial, _error, choose_among
from thermofast.analysis.calibration import _limits, past_run
from thermofast.estimation.closing import likelihood_estimates
from thermofast.estimation.estimate import FilterError
from thermofast.estimation.measured import counted_to, measured_equilibria
from thermofast.estimation.rules import RULES
from thermofast.estimation.sensor import Sensor, Sensors, _maybe_frozen, frozen, left_at_end, prepare_all, saturated
from thermofast.estimation.verdicts import law_verdicts
from thermofast.models.standards.settled import Passing, without_strays
from thermofast.pipeline.methods import choose
from thermofast.reading.follow import Follower
from thermofast.records import BenchRecord, IdentifyRecord


def source_and_body(seed: int, end: float = 600.0, share: float = 0.35) -> tuple[np.ndarray, np.ndarray, float, float]:
    """A source of two minutes on a body of 45 to 60: time, readings of 20 mK, limit and the time of 95 % of all the rise."""
    rng = np.random.default_rng(seed)
    fast, slow, rise = rng.uniform(1.5, 3.0), rng.uniform(45.0, 60.0), rng.uniform(8.0, 14.0)
    time = np.arange(0.0, end + 1.0)

    def done(t):
        return 1.0 - share * np.exp(-np.asarray(t) / fast) - (1.0 - share) * np.exp(-np.asarray(t) / slow)

    settled = brentq(lambda t: float(done(t)) - 0.95, 1.0, 2000.0)
    return time, 20.0 + rise * done(time) + rng.normal(0.0, 0.02, len(time)), 20.0 + rise, settled


@pytest.mark.parametrize("until", [None, 300.0, 120.0])
def test_what_is_done_before_the_exponential_begins_need_not_be_done_by_it(until):
    """The law of such a record begins a third of the way up: 95 % of its own rise came 15 to 30 minutes later than of all of it."""
    held, late = [], []
    for seed in range(12):
        time, reading, limit, settled = source_and_body(9100 + seed)
        (row,) = tf.identify({"time_min": time, "T1": reading}, until=until)
        if row.t95_min is None:
            continue
        assert row.steady_state_lo_c <= limit <= row.steady_state_hi_c
        held.append(row.t95_lo_min <= settled <= row.t95_hi_min)
        late.append(row.t95_min - settled)
    assert len(held) >= 10
    assert np.mean(held) >= 0.9
    if until != 120.0:  # it had come by then
        assert -5.0 < float(np.median(late)) < 20.0


def test_the_law_stays_as_exact_as_it_is_where_the_readings_agree():
    """A settling time that is read errs by minutes, one by the law by seconds."""
    time = np.arange(0.0, 401.0)
    for seed in range(6):
        reading = 20.0 + 9.0 * -np.expm1(-time / 60.0) + np.random.default_rng(seed).normal(0.0, 0.02, len(time))
        (row,) = tf.identify({"time_min": time, "T1": reading})
        assert row.t95_min == pytest.approx(60.0 * math.log(20.0), abs=1.0)


def _passing(line, error: float = 0.05, early: bool = False) -> Passing:
    return Passing(np.arange(float(len(line))), np.asarray(line, dtype=float), 3, error, early)


def test_a_rise_is_done_when_it_stays_done():
    """To 10 K in ten minutes, open for four, and back: 95 % of it for good is at the way back."""
    line = np.concatenate([np.arange(11.0), np.full(10, 10.0), np.full(4, 5.0), np.full(20, 10.0)])
    assert _passing(line).passed(10.0) == (25.0, 26.0)
    assert _passing(line[:20]).passed(10.0) == (9.0, 10.0)
    assert _passing(line[:24]).passed(10.0) is None
    assert _passing(-line).passed(-10.0) == (25.0, 26.0)
    assert _passing(line).passed(math.nan) is None
    assert _passing(1.2 * line).passed(10.0, both=True) is None
    assert _passing(1.2 * line).passed(10.0) == (24.0, 25.0)


def test_a_time_that_the_readings_contradict_is_read():
    """Said to be 100 minutes, or 3, where 95 % were done at 9 to 10; within the readings' own doubt it stands."""
    line = np.concatenate([np.arange(11.0), np.full(190, 10.0)])
    for said in ([90.0, 100.0, 110.0], [2.0, 3.0, 4.0]):
        t95 = np.array(said)
        _passing(line).correct(t95, np.array([9.9, 10.0, 10.1]), np.array([0.05, 0.06, 0.07]))
        assert t95[1] == pytest.approx(9.5)
        assert 7.0 <= t95[0] <= 9.5 <= t95[2] <= 12.0
    t95 = np.array([9.0, 9.1, 9.2])
    _passing(line).correct(t95, np.array([9.9, 10.0, 10.1]), np.array([0.05, 0.06, 0.07]))
    assert t95.tolist() == [9.0, 9.1, 9.2]


def test_a_time_that_has_passed_and_has_not_come_is_ahead():
    """Said to be 30 minutes, while at 99, of which the last three readings are the mean, 1.023 K of 10 are missing: 50 ln 2.047 more."""
    line = 10.0 * -np.expm1(-np.arange(101.0) / (100.0 / math.log(10.0)))
    t95 = np.array([29.0, 30.0, 31.0])
    _passing(line).correct(t95, np.array([9.9, 10.0, 10.5]), np.array([0.01, 0.02, 0.04]))
    assert t95[1] == pytest.approx(100.0 + 50.0 * math.log(1.0233 / 0.5), abs=0.1)
    assert t95[0] == 100.0
    assert t95[2] == pytest.approx(100.0 + 100.0 * math.log((0.5 + 1.0233) / 0.525), abs=0.1)


def test_a_record_begins_at_its_first_reading_where_the_next_go_on_from_it():
    """The middle of three is for a first reading that is off."""
    time = np.arange(0.0, 600.0)
    line = 20.0 + 4.0 * -np.expm1(-time / 2.0) + 6.0 * -np.expm1(-time / 50.0)
    settled = brentq(lambda t: 4.0 * math.exp(-t / 2.0) + 6.0 * math.exp(-t / 50.0) - 0.5, 1.0, 500.0)
    assert measured_equilibria(time, line[None])[1][0] == pytest.approx(settled, abs=1.5)
    off = line.copy()
    off[0] = 35.0
    assert measured_equilibria(time, off[None])[1][0] == pytest.approx(settled + 50.0 * math.log(10.0 / 7.2), abs=3.0)


def test_a_probe_that_died_is_told_and_what_is_left_counts_from_the_run():
    """Its readings end at 44 of 400 minutes: 150 minutes to go were told, at a time when all had long been done."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 401.0)
    columns = {f"T{k}": 20.0 + 9.0 * -np.expm1(-time / 60.0) + rng.normal(0.0, 0.02, len(time)) for k in range(3)}
    columns["T1"][45:] = np.nan
    columns["T2"][-3:] = np.nan
    alive, dead, nearly = tf.identify({"time_min": time, **columns})
    assert "no reading after 44 min, the run goes on to 400: check the probe" in dead.message
    assert dead.time_to_go_min == 0.0
    assert "no reading" not in alive.message + nearly.message
    (_, still, _) = tf.identify({"time_min": time, **columns}, until=60.0)
    assert still.time_to_go_min == pytest.approx(still.t95_min - 60.0)


def test_readings_end_with_the_run_or_well_before_it():
    """Five of a sensor's own readings, and a twentieth of what it read."""
    own = np.arange(0.0, 101.0)
    assert counted_to(own, np.arange(0.0, 106.0), None, 0.0) == (100.0, ())
    assert counted_to(own, np.arange(0.0, 107.0), None, 0.0)[0] == 106.0
    assert counted_to(own, np.arange(0.0, 401.0), 103.0, 0.0) == (100.0, ())
    assert counted_to(own[::10], np.arange(0.0, 141.0), None, 0.0) == (100.0, ())
    assert counted_to(own[::10], np.arange(0.0, 161.0), None, 0.0)[0] == 160.0
    assert counted_to(own + 5.0, np.arange(0.0, 106.0), None, 0.0) == (105.0, ())
    late = counted_to(own + 60.0, np.arange(0.0, 161.0), None, 0.0)
    assert late == (160.0, ("its readings begin at 60 min, from which on its rise is counted",))


def test_a_limit_that_only_the_past_tells_is_said_to_be_so():
    """A model of a machine with a slow wall, used on one that has none: an hour says nothing of walls, and the row says what does."""
    time, rng = np.arange(0.0, 901.0), np.random.default_rng(11)

    def run(wall: float, end: float, name: str) -> tf.Run:
        line = 20.0 + 9.0 * -np.expm1(-time / 40.0) + wall * -np.expm1(-time / 200.0)
        kept = time <= end
        return tf.read({"time_min": time[kept], "T1": (line + rng.normal(0.0, 0.02, len(time)))[kept]}, name=name)

    model = tf.improve([run(4.0, 900.0, "a"), run(4.0, 900.0, "b")], together=True).model
    for read in (60.0, 80.0):
        (other,) = tf.identify(run(0.0, read, "c"), model=model)
        assert other.status == "ok"
        assert "its own readings alone say 28." in other.message
        assert "a limit beyond stands on the past runs" in other.message
    (same,) = tf.identify(run(0.0, 100.0, "e"), model=tf.improve([run(0.0, 900.0, "f"), run(0.0, 900.0, "g")], together=True).model)
    assert "stands on the past runs" not in same.message


def test_calibrate_judges_the_limit_where_the_room_is_logged():
    """What the room may do later has no part in it: ends of walls lay in its band, and intervals of the limit missed them."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 1600.0, 2.0)
    line = 20.0 + 9.0 * -np.expm1(-time / 40.0) + 4.0 * -np.expm1(-time / 240.0)
    columns = {"time_min": time, "T1": line + rng.normal(0.0, 0.02, len(time))}
    logged = tf.read({**columns, "ambient": np.full(len(time), 20.0) + rng.normal(0.0, 0.02, len(time))})
    method = choose("afukf", None, (), SMALL_SLOW)
    with_room, without = (past_run((run, 0.0), method, (method.imperfection,)) for run in (logged, tf.read(columns)))
    ends = [found.end[0] - found.foretold[0, 3, 0] for found in (with_room, without)]
    said = tf.identify(logged, until=_turn(logged), imperfection=SMALL_SLOW)[0]
    assert with_room.foretold[0, 3, 0] == pytest.approx(
        [said.steady_state_lo_c, said.steady_state_c, said.steady_state_hi_c], abs=0.15
    )
    assert ends[0][2] > 0.0  # beyond the limit's interval
    assert ends[1][2] < 0.0  # and within that of the temperature, which counts what an unlogged room may do


def _turn(run: tf.Run) -> float:
    return 1.0 / tf.identify(run)[0].rate_per_min


def test_a_filter_is_advised_by_what_it_foretells():
    """A curve without a limit runs off: it foretells nothing, and says nothing of another filter."""
    blank = BenchRecord("run", "", until_min=60.0, sensors=4)
    ahead = {"afukf": np.array([0.1, 0.1, 0.1, np.nan]), "ast_cqkf": np.array([0.1, 0.1, 0.1, 2.0])}
    trials = [Trial(replace(blank, filter=name, rmse_ahead_c=float(np.sqrt(np.nanmean(e**2)))), e) for name, e in ahead.items()]
    assert [r.filter for r in choose_among(trials) if r.chosen] == ["afukf"]
    ahead["afukf"][:3] = 0.5
    trials = [Trial(replace(blank, filter=name, rmse_ahead_c=float(np.sqrt(np.nanmean(e**2)))), e) for name, e in ahead.items()]
    (chosen,) = [r for r in choose_among(trials) if r.chosen]
    assert chosen.filter == "ast_cqkf"
    assert "differs little from that of afukf" in chosen.message


@pytest.mark.parametrize("order", ["twice", "back"])
def test_a_run_ascends(order):
    """Else a fit has no two times, and what came last came first."""
    time = np.repeat(np.arange(50.0), 2) if order == "twice" else np.arange(100.0)[::-1]
    with pytest.raises(tf.InputError, match="time_s does not ascend"):
        tf.Run("x", 60.0 * time, {"A": np.linspace(20.0, 25.0, 100)})


def _lump(end: float = 301.0, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(0.0, end)
    clean = 20.0 + 10.0 * -np.expm1(-time / 55.0)
    return time, np.round(clean + np.random.default_rng(seed).normal(0.0, 0.02, len(time)), 2)


@pytest.mark.parametrize(
    "stray", [{-1: -5.0}, {-1: 20.0}, {-1: -0.5}, {-2: 3.0, -1: 3.0}, {200: 20.0, 201: 20.0}, {250: 1.5, 251: 1.5, 252: 1.5}]
)
def test_strays_settle_nothing(stray):
    """One bad last reading, or three in a row, and 95 % stay done when they were."""
    time, reading = _lump()
    for at, size in stray.items():
        reading[at] += size
    (row,) = tf.identify({"time_min": time, "T1": reading})
    assert row.t95_min == pytest.approx(55.0 * math.log(20.0), abs=4.0)
    assert row.t95_lo_min <= 55.0 * math.log(20.0) <= row.t95_hi_min
    assert row.time_to_go_min == 0.0


def test_strays_are_put_back_and_edges_are_not():
    """A rise within minutes, a step that stays, and the noise are as they were."""
    line = np.concatenate([5.0 * -np.expm1(-np.arange(30.0) / 2.0), np.full(20, 8.0)])
    assert without_strays(line, 0.02)[1:].tolist() == line[1:].tolist()
    strayed = line.copy()
    strayed[[20, 21, 22, -1]] += [9.0, -9.0, 9.0, 4.0]
    assert without_strays(strayed, 0.02)[1:] == pytest.approx(line[1:], abs=0.01)
    assert without_strays(np.array([0.0, 9.0, 0.0]), 0.02).tolist() == [0.0, 9.0, 0.0]


def test_where_nobody_read_nobody_knows():
    """Nothing logged from 110 to 210 min: 95 % came in between, and were said to have come within a minute of its end."""
    time, reading = _lump(401.0)
    kept = (time < 110.0) | (time > 210.0)
    line = (reading - 20.0)[kept]
    gap = Passing(time[kept], line, 3, 0.02, False)
    assert gap.passed(10.0) == (109.0, 212.0)
    (row,) = tf.identify({"time_min": time[kept], "T1": reading[kept]})
    assert row.t95_lo_min <= 55.0 * math.log(20.0) <= row.t95_hi_min
    assert row.t95_measured_min is None


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(1, 45)), min_size=1, max_size=12), st.integers(0, 9))
def test_no_run_of_equal_readings_is_overlooked(stretches, seed):
    """Those that are looked at closely are all that hold half as many equal differences in a row as the rule asks for, by blocks."""
    half = RULES.frozen_readings // 2
    values = np.concatenate([np.full(long, float(level)) for level, long in stretches])
    noisy = np.where(np.random.default_rng(seed).random(len(values)) < 0.1, values + 1.0, values)
    reading = np.array([values, noisy, np.arange(len(values)) * 0.5])
    m = (len(values) - 1) // half
    blocks = [[bool((np.diff(row)[j * half : (j + 1) * half] == 0.0).all()) for j in range(m)] for row in reading]
    expected = [i for i, of in enumerate(blocks) if any(of)] if m >= 2 else []
    assert _maybe_frozen(reading).tolist() == expected


def test_a_frozen_probe_is_left_out():
    """Sixty readings alike, of a noise of two steps: taken for a machine that had settled."""
    time, reading = _lump()
    reading[120:] = reading[120]
    (row,) = tf.identify({"time_min": time, "T1": reading})
    assert "180 readings stuck at" in row.message
    assert "from 121 min left out (the probe or the logger froze?)" in row.message
    assert row.steady_state_lo_c <= 30.0 <= row.steady_state_hi_c
    assert row.t95_measured_min is None
    assert frozen(np.round(reading, 1), 0.1).sum() == 0  # of a coarser step nothing forbids it
    assert frozen(reading[:130], 0.01).sum() == 0
    assert frozen(reading[:140], 0.01).sum() == 19
    quiet = np.concatenate([reading[:120], np.full(25, reading[119]), _lump(seed=5)[1][145:]])
    assert frozen(quiet, 0.01).sum() == 25
    assert frozen(np.tile(_lump(seed=6)[1], 2)[:600], 0.01).sum() == 0


def test_a_band_of_one_step_of_the_logger_times_nothing():
    """Readings in half degrees of a rise of 9.5 K cross the band when they are rounded across it."""
    time = np.arange(0.0, 600.0)
    line = 20.0 + 9.5 * -np.expm1(-time / 60.0)
    coarse = np.round(2.0 * line) / 2.0
    assert np.isnan(measured_equilibria(time, coarse[None], np.array([0.5]))[1][0])
    assert measured_equilibria(time, line[None], np.array([0.1]))[1][0] == pytest.approx(180.0, abs=2.0)


def test_repetitions_that_a_noise_of_half_a_step_forbids_are_a_frozen_probe():
    """With half a step of noise a reading repeats the one before in two of three at most: 450 in a row are no machine's."""
    time = 0.5 * np.arange(600)
    warm, found = 20.0 + 10.0 * -np.expm1(-time / 40.0), 0
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal(600)
        reading = np.round(np.round((warm + 0.05 * noise) / 0.1) * 0.1, 6)
        assert not frozen(reading, 0.1).any()
        reading[150:] = reading[150]
        found += frozen(reading, 0.1).sum() in range(440, 451)
        # A temperature between two steps is told as one or the other by the least noise, and then as one of them for good.
        dither = np.round(np.round((20.05 + 0.004 * noise + 0.02 * (time > 150.0)) / 0.1) * 0.1, 6)
        assert not frozen(dither, 0.1).any()
    assert found >= 18


@pytest.mark.parametrize("step", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("every", [0.2, 1.0, 5.0])
def test_a_sensor_that_has_settled_is_not_frozen(step, every):
    """Readings of a coarse step stand still by themselves, whatever the slope before; with noise of two steps none do."""
    rng = np.random.default_rng(7)
    for tau, rise in ((20.0, 3.0), (20.0, 10.0), (60.0, 40.0), (150.0, 3.0)):
        time = np.arange(0.0, min(6.0 * tau, 3000.0 * every), every)
        for size in (0.0, 0.2, 0.8):
            line = 20.0 + rise * -np.expm1(-time / tau) + size * step * rng.standard_normal(len(time))
            assert not frozen(np.round(np.round(line / step) * step, 6), step).any()
        noisy = np.round(20.0 + rise * -np.expm1(-time / tau) + 2.0 * step * rng.standard_normal(len(time)), 6)
        noisy[len(time) // 2 :] = noisy[len(time) // 2]
        if len(time) >= 60:
            assert frozen(noisy, step).sum() == len(time) - len(time) // 2 - 1


def test_a_sensor_that_froze_and_met_the_end_of_its_range_is_without_both():
    """One stretch had taken the place of the other."""
    time = np.arange(0.0, 301.0)
    reading = np.round(20.0 + 0.05 * time + np.random.default_rng(2).normal(0.0, 0.02, len(time)), 2)
    reading[20:45] = reading[20]
    reading = np.minimum(reading, 30.0)
    ended, froze = saturated(reading, 0.01), frozen(reading, 0.01)
    assert ended.sum() > 90
    assert froze[21:45].all()
    (found,) = prepare_all(time, reading[None], 0.0)
    assert len(found.time) == len(time) - int((ended | froze).sum())


def test_an_interval_of_the_model_holds_what_was_read():
    """A minute to either side is told from a noise of 0.1 K at a slope of 0.008 K a minute by nobody: 185 may be right, and 180."""
    line = 10.0 * -np.expm1(-np.arange(601.0) / 60.0)
    t95 = np.array([185.0, 185.1, 185.2])
    _passing(line, error=0.1).correct(t95, np.array([9.99, 10.0, 10.01]), np.array([0.015, 0.017, 0.019]))
    assert t95[1] == 185.1
    assert t95[0] < 60.0 * math.log(20.0) < t95[2]


def test_a_model_from_short_runs_says_so():
    """Two time constants tell nothing of a mass that is slower than they were long."""
    time, reading = _lump(121.0)
    late, whole = _lump(401.0, 8)
    short = tf.improve(tf.read({"time_min": time, "T1": reading}, name="a")).model
    long = tf.improve(tf.read({"time_min": late, "T1": whole}, name="b")).model
    other = tf.read({"time_min": time[:80], "T1": _lump(81.0, 9)[1][:80]}, name="c")
    said = "what it was learnt from may have ended early: by the readings alone it may go on by up to "
    assert said in tf.identify(other, model=short)[0].message
    assert "may have ended early" not in tf.identify(other, model=long)[0].message


def test_a_watch_looks_once_more_at_its_end(tmp_path):
    """At all that came, a last line without an end too: nobody goes on writing it."""
    time, reading = _lump(160.0)
    path = tmp_path / "run.csv"
    path.write_text("time_min,T1\n" + "\n".join(f"{t:g},{r:.2f}" for t, r in zip(time, reading, strict=True)))
    look = tf.watch(str(path), tolerance=0.01, give_up=0.005, poll=0.05)
    assert look.records[0].samples == 160
    assert Follower(str(path)).rest() == path.read_bytes()


def test_sensitivity_says_that_a_filter_broke(monkeypatch):
    """Measure longer, it said, and that all was well."""

    def breaks(*_arguments):
        raise FilterError("mine raised ValueError: no")

    monkeypatch.setattr("thermofast.analysis.sensitivity.track_of", breaks)
    time, reading = _lump(160.0)
    (row,) = tf.sensitivity(tf.read({"time_min": time, "T1": reading}), jobs=1)
    assert (row.status, row.message) == ("diverged", "mine raised ValueError: no")


def test_what_the_logged_room_did_since_is_no_error_of_a_limit():
    """Two degrees warmer from the last reading on: after three time constants the limit is 1.9 K higher."""
    row = IdentifyRecord(
        "run", "T1", "afukf", 60.0, initial_c=20.0, steady_state_lo_c=29.0, steady_state_c=30.0, steady_state_hi_c=31.0
    )
    minutes = np.arange(0.0, 301.0)
    room = np.where(minutes > 60.0, 22.0, 20.0)
    found = _limits([replace(row, rate_per_min=1.0 / 60.0), None], minutes, room, 60.0, 180.0)
    moved, left = 2.0 * (1.0 - math.exp(-3.0)), 10.0 * math.exp(-4.0)
    assert found[0] == pytest.approx(np.array([29.0, 30.0, 31.0]) + moved - left, abs=0.03)
    assert np.isnan(found[1]).all()


def test_a_curve_without_a_limit_foretells_nothing():
    """It runs off, by 1e11 K at the end of a record."""
    time, reading = _lump(160.0)
    estimate = SimpleNamespace(steady_state=None, state=np.array([25.0, 0.1, -0.05]), free_run=lambda t: 25.0 + 0.0 * t, time=80.0)
    assert len(_error(estimate, Sensor(time, reading, 0.01, ()), 80, 160)) == 0
    estimate.steady_state = 30.0
    assert len(_error(estimate, Sensor(time, reading, 0.01, ()), 80, 160)) == 80


def test_last_readings_that_are_out_are_counted_where_a_machine_may_have_gone_there():
    """One or three in a row; none where another follows, nor where the step there is several times any other."""
    time = np.arange(20.0)
    reading, weights = np.tile(20.0 + 0.1 * time, (5, 1)), np.ones((5, 20))
    for row, (out, far) in enumerate((([19], 0.1), ([17, 18, 19], 0.1), ([18], 0.1), ([18, 19], 9.0), ([], 0.0))):
        reading[row, out] += far
        weights[row, out] = 0.0
    sensors = Sensors(np.arange(5), time, reading, np.zeros(5), ((),) * 5)
    assert left_at_end(weights, sensors).tolist() == [1, 3, 0, 0, 0]


def test_readings_that_went_and_came_back_are_told_so_under_the_law_alone():
    """Up by six kelvin and back: an interval many times the rise is told with how far they went; of a slow rise, with the rise."""
    time = np.arange(0.0, 120.0)
    there = 20.0 + 6.0 * np.sin(np.pi * time / 119.0)
    reading = np.array([there, 20.0 + 0.5 * time / 119.0]) + 0.02 * np.random.default_rng(2).standard_normal((2, 120))
    weights, none = np.ones((2, 120)), np.zeros(2)
    found = likelihood_estimates(time, reading, weights, np.zeros(2, dtype=np.intp), none, math.inf)
    known = {
        "steady_low": np.zeros(2),
        "steady_high": np.full(2, 100.0),
        "t95_low": np.full(2, 10.0),
        "t95_high": np.full(2, 900.0),
    }
    known |= {"state": np.tile([20.5, 0.0, 0.02], (2, 1)), "initial": np.full(2, 20.0), "noise": np.full(2, 0.02)}
    found = replace(found, **known)
    sensors = Sensors(np.arange(2), time, reading, none, ((),) * 2)
    status, said = law_verdicts(found, SimpleNamespace(woke=np.full(2, -1)), sensors, {}, 119.0)
    assert status == ["not_determined"] * 2
    assert said[0][0].startswith("the steady state is known only to within 100 K: the readings went 6.0")
    assert "many times the rise so far" in said[1][0]
