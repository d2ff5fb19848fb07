"""Single rules of what is learnt of machines and said of runs: each with a number that a slip in it would change."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import thermofast as tf
from thermofast.analysis import calibration, changed, validate
from thermofast.analysis.watching import TOGETHER, Watch
from thermofast.discovery import remains, several, together
from thermofast.discovery.colour import colour_of
from thermofast.learning import foretold, jumps, past, rise
from thermofast.machine import learnt
from thermofast.models import Observations
from thermofast.models.imperfection import TYPICAL
from thermofast.models.joint import RATE, Key, fit_model
from thermofast.models.search.logged import _jumps_before
from thermofast.models.standards.switch_off import _curved
from thermofast.models.uncertainty.surroundings import room_ahead
from thermofast.records import IdentifyRecord


def observations(reading, step=1.0, inputs=None, noise=0.02):
    reading = np.atleast_2d(np.asarray(reading, dtype=float))
    sensors, count = reading.shape
    names = tuple(f"T{i + 1}" for i in range(sensors))
    columns = {n: np.asarray(c, dtype=float) for n, c in (inputs or {}).items()}
    whole = np.ones_like(reading)
    return Observations(
        "run", names, step * np.arange(count), reading, whole, np.full(sensors, noise), np.zeros(sensors), {}, columns
    )


def test_several_sensors_are_within_the_tolerance_all_at_once():
    run = tf.read({"time_min": np.arange(0.0, 200.0), "a": np.linspace(20.0, 60.0, 200), "b": np.linspace(20.0, 50.0, 200)})

    def records(half):
        told = {"status": "ok", "steady_state_c": 70.0, "steady_state_lo_c": 70.0 - half, "steady_state_hi_c": 70.0 + half}
        return lambda run, _start: tuple(IdentifyRecord(run.name, c, "afukf", rate_per_min=0.05, **told) for c in run.channels)

    assert TOGETHER == 1.15
    assert Watch(records(0.45), 0.5).look(run).within == (False, False)
    assert Watch(records(0.43), 0.5).look(run).within == (True, True)
    alone = replace(run, channels={"a": run.channels["a"]})
    assert Watch(records(0.45), 0.5).look(alone).within == (True,)


def test_a_heat_that_hardly_stayed_may_be_followed_by_other_modes_more():
    fit = SimpleNamespace(model=SimpleNamespace(parts=()), run=SimpleNamespace(heat=np.ones(3)), values={RATE: np.full(3, 0.02)})
    assert past._other_modes(fit, 60.0) == past.RESTLESS == 0.15
    assert past._other_modes(fit, 150.0) == past.DRIVEN == 0.03
    assert past._other_modes(SimpleNamespace(**vars(fit) | {"run": SimpleNamespace(heat=None)}), 60.0) == 0.0


def test_a_constant_without_a_standard_error_is_known_to_half_of_itself():
    logarithmic, plain = (SimpleNamespace(parameter=SimpleNamespace(log=log)) for log in (True, False))
    assert learnt._searched(logarithmic, 2.0, math.nan) == pytest.approx((math.log(2.0), 0.5))
    assert learnt._searched(plain, -2.0, math.nan) == pytest.approx((-2.0, 1.0))
    assert learnt._searched(logarithmic, 2.0, 0.0) == pytest.approx((math.log(2.0), learnt.LEAST_SHARE))


def test_a_value_beyond_all_draws_has_the_least_chance_that_so_many_can_tell():
    blank = validate.ValidateRecord("3 runs", "T", until_min=60.0, runs=3)
    rng = np.random.default_rng(1)
    low = 20.0 + 0.1 * rng.standard_normal((validate.DRAWS, len(validate.SHARES)))
    mine = [validate.Bounds(f"r{k}", "T", np.array([90.0, 95.0]), low, low + 5.0, 0.0) for k in range(3)]
    assert validate._sensor(blank, mine, False)[0].p == pytest.approx(1.0 / (validate.DRAWS + 1.0))


def test_the_rate_of_half_of_the_runs_far_from_the_files_is_told():
    blank = validate.ValidateRecord("3 runs", "T", until_min=60.0, runs=3)
    low = 20.0 + 0.1 * np.random.default_rng(1).standard_normal((validate.DRAWS, len(validate.SHARES)))
    for off, told in ((validate.FAR + 0.1, True), (validate.FAR - 0.1, False), (-validate.FAR - 0.1, True)):
        mine = [validate.Bounds(f"r{k}", "T", np.array([20.0, 25.0]), low, low + 5.0, off) for k in range(3)]
        assert ("standard errors from the file's" in validate._sensor(blank, mine, False)[0].message) == told


def test_a_room_that_jitters_is_known_the_less_where_it_is():
    time = np.arange(0.0, 120.1, 0.5)
    room = 20.0 + np.random.default_rng(1).normal(0.0, 1.0, len(time))
    mean, deviation = room_ahead(time, room, np.array([math.inf]), 410.0)
    assert (float(mean[0]), float(deviation[0])) == pytest.approx((0.074, 0.561), abs=0.002)
    ramp = 20.0 + time / 120.0
    assert float(room_ahead(time, ramp, np.array([math.inf]), 410.0)[1][0]) == pytest.approx(0.941, abs=0.01)


def test_ends_that_typical_intervals_do_not_hold_forbid_a_prior_of_fewer_strong_effects():
    turns, priors = len(calibration.TURNS), len(calibration.CANDIDATES)
    rare = next(c for c, one in enumerate(calibration.CANDIDATES) if one.strong_share < TYPICAL.strong_share)

    def runs(inside):
        for k in range(6):
            end = np.array([50.0, 60.0])
            half = np.full((priors, turns), 4.0)
            half[rare] = 0.5  # narrow ones score better, and hold
            off = np.full((priors, turns, 1), 0.0 if k < inside else 5.0)
            off[rare] = 0.0
            sides = (end + off + sign * half[..., None] for sign in (-1.0, 0.0, 1.0))
            foretold_ = np.stack(list(sides), axis=-1)
            yield calibration.Past(f"r{k}", foretold_, end, 1.0)

    assert calibration.learn(list(runs(6))).prior.strong_share < TYPICAL.strong_share
    assert calibration.learn(list(runs(3))).prior.strong_share == TYPICAL.strong_share
    # Nor is one taken that holds them only by what it is widened to.
    off_by = [
        replace(one, foretold=one.foretold + np.where(np.arange(priors) == rare, 1.0, 0.0)[:, None, None, None]) for one in runs(6)
    ]
    assert calibration.learn(off_by).prior.strong_share == TYPICAL.strong_share


def test_how_far_off_a_foretold_end_was_counts_the_half_on_its_side(monkeypatch):
    record = SimpleNamespace(at_lo_c=28.0, at_c=30.0, at_hi_c=31.0, channel="a")
    monkeypatch.setattr(foretold, "identify_sensors", lambda *_: SimpleNamespace(records=[record]))
    run = tf.read({"time_min": np.arange(0.0, 100.0), "a": np.append(np.linspace(20.0, 29.0, 50), np.full(50, 29.0))})
    told = foretold._told(SimpleNamespace(run=run, start_min=0.0), 30.0, SimpleNamespace(shapes={"a": None}), True)
    assert told["a"].off == pytest.approx(-0.98)
    assert told["a"].score == pytest.approx(3.0 / 9.0)


def test_events_at_other_times_in_each_run_are_none_of_the_machines_course():
    def at(minutes):
        part = SimpleNamespace(
            id="load_step", choice=None, effect=SimpleNamespace(event="event", active=lambda _: [SimpleNamespace(name="event")])
        )
        return SimpleNamespace(
            model=SimpleNamespace(parts=[part]), values={Key(0, "event"): np.array([minutes])}, run=SimpleNamespace(start_min=10.0)
        )

    assert together._at_other_times([at(100.0), at(104.0)]) == {}
    assert together._at_other_times([at(100.0), at(130.0)]) == {0: "load_step (at 110 to 140 min)"}


def test_one_sensor_well_up_on_its_rise_is_no_test_that_was_logged_late():
    rise_k = np.full(3, 10.0)
    assert changed._late(np.array([0.0, 0.5, 3.0]), rise_k) == []
    assert "up to 3 K up on their rise" in changed._late(np.array([0.0, 2.5, 3.0]), rise_k)[0]


def test_an_event_belongs_to_a_jump_that_came_a_little_before_or_with_it():
    column = np.where(np.arange(100) < 50, 0.0, 1.0)
    run = observations(np.linspace(20.0, 30.0, 100))
    assert [_jumps_before(run, column, event) for event in (47.4, 48.0, 48.6, 49.0)] == [False, True, True, True]


def test_what_remains_goes_along_with_a_column_that_falls_while_it_rises():
    column = np.sin(np.arange(100) / 7.0)
    run = observations(np.zeros((2, 100)), inputs={"coolant": column})
    for sign in (1.0, -1.0):
        fit = SimpleNamespace(run=run, residual=0.5 + sign * np.tile(column, (2, 1)))
        assert remains._along(fit) == "coolant"


def test_what_two_sensors_leave_alike_is_not_most_of_it_in_one():
    rng, time = np.random.default_rng(3), np.arange(200.0)
    wave = np.sin(time / 30.0)
    for second, told in ((1.0, False), (0.1, True)):
        law = 20.0 + 10.0 * -np.expm1(-0.02 * time)
        reading = np.stack([law + wave, law + second * wave]) + 0.01 * rng.standard_normal((2, 200))
        assert ("most of it in T" in remains.remaining_words(fit_model(observations(reading, noise=0.01)))) == told


def test_a_load_that_jumps_by_less_than_its_flutter_stays():
    column = 500.0 + np.random.default_rng(3).normal(0.0, 2.0, 240)
    assert jumps.stays(column + np.where(np.arange(240) < 120, 0.0, 4.0))
    assert not jumps.stays(column + np.where(np.arange(240) < 120, 0.0, 40.0))


def test_a_probe_that_drifts_and_a_wave_are_no_way_to_a_limit():
    def part(scope, periodic):
        return SimpleNamespace(effect=SimpleNamespace(scope=scope, parameters=[SimpleNamespace(periodic=periodic)]))

    parts = [part("run", False), part("one", False), part("sensor", True), part("sensor", False)]
    assert rise.lasting(SimpleNamespace(model=SimpleNamespace(parts=parts))) == [0, 3]


def test_the_covariance_of_two_modes_is_that_of_the_bend_with_its_sign():
    bend = np.array([[4.0, 1.0], [1.0, 3.0]])
    at = np.array([0.3, -0.2])

    def posterior(points):
        off = points - at
        return (-0.5 * np.einsum("ni,ij,nj->n", off, bend, off),)

    assert _curved(posterior, at) == pytest.approx(np.linalg.inv(bend), abs=1e-3)


def test_a_rate_that_is_not_determined_is_no_evidence_of_another_machine():
    rng, time = np.random.default_rng(5), np.arange(0.0, 300.0)

    def found(still):
        rows = [20.0 + a * -np.expm1(-b * time) for a, b in ((10.0, 0.02), (8.0, 0.025), (12.0, 0.015))]
        rows.append(np.full(300, 21.0) + (still * time if still else 0.0))
        reading = np.array(rows) + 0.02 * rng.standard_normal((4, 300))
        return SimpleNamespace(base=fit_model(observations(reading)), also=(), singles=(), named=None)

    runs = [found(0.0), found(2e-5), found(-1e-5)]
    rates = [several._log_rates(one.base) for one in runs]
    assert all(np.isnan(r[3]) and np.isfinite(r[:3]).all() for r in rates)
    assert several.two_machines(runs, ("a", "b", "c")) == ""


#: Share of an oscillation that is left a minute later.
KEPT = 0.97


def colour_at(lasting_min, rate, count, period=None, seed=4):
    """Colour of a residual that dies away within `lasting_min`, or swings, beside a fit of such a rate [1/min]."""
    rng = np.random.default_rng(seed)
    if period is None:
        noise = rng.standard_normal(count)
        for k in range(1, count):
            noise[k] += math.exp(-3.0 / lasting_min) * noise[k - 1]
    else:  # an oscillator that noise drives
        noise = rng.standard_normal(count)
        for k in range(2, count):
            noise[k] += 2.0 * KEPT * math.cos(2.0 * math.pi / period) * noise[k - 1] - KEPT**2 * noise[k - 2]
    run = observations(30.0 + 0.05 * noise, noise=0.05)
    fit = fit_model(run)
    values = {**fit.values, RATE: np.array([rate])}
    told = SimpleNamespace(
        run=run,
        values=values,
        residual=np.atleast_2d(0.05 * noise),
        unrounded=np.atleast_2d(0.05 * noise),
        by_local=np.ones((1, 1, count)),
        by_shared=np.zeros((0, 1, count)),
        model=fit.model,
    )
    return colour_of(told, 0, 1e-6)


def test_no_noise_lasts_a_tenth_of_what_was_seen():
    long, short = colour_at(6.0, 1e-3, 1500), colour_at(60.0, 1e-3, 120)
    assert long.short
    assert not short.short
    assert "a misfit, not noise" in short.words


def test_of_a_swing_two_periods_must_be_seen():
    assert "a misfit, not noise" in colour_at(0.0, 0.05, 100, period=60.0, seed=5).words
    assert "swings with a period" in colour_at(0.0, 0.05, 240, period=40.0).words


def test_nobody_is_told_when_a_limit_shows_that_is_no_number():
    from thermofast.estimation.verdicts import _of_the_heat

    claimed = SimpleNamespace(
        other_rise=np.array([True, True]), held=np.array([True, True]), rate=np.full((2, 3), 1e-4), behind=np.full(2, np.nan)
    )
    case = SimpleNamespace(
        claimed=claimed,
        past=SimpleNamespace(stayed_min=55.0, changed_min=90.0, guessed=True),
        slow=np.full(2, 1e-4),
        found=SimpleNamespace(time=145.0, steady_state=np.array([30.0, np.nan])),
    )
    stayed, changed_, _ = _of_the_heat(case, None)
    assert stayed.where.tolist() == changed_.where.tolist() == [True, False]
    assert stayed.doubts.tolist() == changed_.doubts.tolist() == [True, True]
