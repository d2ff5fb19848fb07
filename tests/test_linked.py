"""Sensors that warm each other: where all of them settle, together, and when."""

from dataclasses import replace

import numpy as np
import pytest

import thermofast as tf
from benchmarks.intervals.linked import MINUTES, machine, settled
from thermofast.learning.jumps import last_level, longest_stay
from thermofast.learning.rise import DRIVEN_MODES, _extended, _of_others, free_run, rises_of, together
from thermofast.models.effects import BUILT_IN
from thermofast.models.imperfection import GRID
from thermofast.models.imperfection.machine.known import Known
from thermofast.models.imperfection.shapes import Asked
from thermofast.models.joint import RATE, Key, Part, fit_model
from thermofast.models.relaxation import relaxed
from thermofast.models.search.candidates import try_add
from thermofast.models.search.mutual import both_ways
from thermofast.observing.observe import observe


@pytest.fixture(scope="module")
def linked():
    (first, _, _), second = machine(503, 2)
    return tf.improve(first, add=["neighbour_heat"]).model, *second


def test_linked_sensors_settle_where_both_balance(linked):
    model, record, limits, curves = linked
    for until in (60.0, 160.0):
        for i, r in enumerate(tf.identify(record, until=until, model=model, at=400)):
            assert r.status == "ok"
            assert r.steady_state_lo_c <= limits[i] <= r.steady_state_hi_c
            assert r.steady_state_c == pytest.approx(limits[i], abs=0.3)
            assert r.t95_min == pytest.approx(settled(curves[:, i], limits[i]), rel=0.1)
            assert r.at_lo_c <= curves[-1, i] <= r.at_hi_c
    # Each by itself would settle elsewhere: the link matters.
    assert abs(tf.identify(record, until=160, imperfection="none")[0].steady_state_c - limits[0]) > 0.3


def test_nothing_read_of_a_neighbour_after_until_is_used(linked):
    model, record, *_ = linked
    other = {k: np.where(MINUTES <= 80.0, v, v + 5.0 * (k == "T2")) for k, v in record.items() if k != "time_min"}
    for more in ({"model": model}, {"auto": True}):
        one, two = (tf.identify(r, until=80, at=400, **more) for r in (record, {"time_min": MINUTES} | other))
        for a, b in zip(one, two, strict=True):
            assert (a.steady_state_c, a.at_c, a.t95_min) == (b.steady_state_c, b.at_c, b.t95_min)


def test_runs_of_linked_sensors_are_learnt_from_together():
    runs = [tf.read(record, name=f"run {k}") for k, (record, _, _) in enumerate(machine(504, 3, runs=3))]
    found = tf.improve(runs[:2], together=True, add=["neighbour_heat"])
    _, limits, _ = machine(504, 3, runs=3)[2]
    for i, r in enumerate(tf.identify(runs[2], until=80, model=found.model)):
        assert r.steady_state_lo_c <= limits[i] <= r.steady_state_hi_c


def test_what_is_not_known_of_one_end_moves_the_other_through_the_link():
    """Ends of two linked bodies: own move m of the one is m / (1 - r0 r1) there and r1 m / (1 - r0 r1) here, r = kappa / (b + kappa)."""
    seen = observe(tf.read(machine(503, 2)[1][0])).seen.until(80.0)
    link = next(effect() for effect in BUILT_IN if effect.id == "neighbour_heat")
    fit = try_add(fit_model(seen), link).fit
    last, every = 80, range(1)
    over = _extended(fit, seen, len(seen.time) - 1, last, seen.time[-1] + np.linspace(1.0, 3000.0, 600))
    over = together(fit, over, last, every)
    moved = _of_others(fit, over, last)
    share = fit.values[Key(0, "kappa")] / (fit.values[Key(0, "kappa")] + fit.values[RATE])
    for one, other in ((0, 1), (1, 0)):
        steps = 1e-4 * np.eye(fit.local.shape[1])
        rows = np.concatenate([fit.local[one] + steps, fit.local[one] - steps])
        ends = free_run(fit, over, rows, np.tile(fit.shared, (len(rows), 1)), one, every)[:, -1]
        slope = (ends[: len(steps)] - ends[len(steps) :]) / 2e-4
        own = np.sqrt(slope @ fit.joint_covariance(one)[: len(slope), : len(slope)] @ slope)
        assert abs(moved[one, other, -1]) == pytest.approx(share[other] * own / (1.0 - share.prod()), rel=0.1)
        assert np.all(moved[one, one] == 0.0)
        assert np.all(moved[one, other, : last + 1] == 0.0)  # what was read of a neighbour is known


@pytest.mark.proof
def test_a_load_that_fell_reaches_the_neighbour_too():
    """Two linked bodies of which one's heat falls at 100 min: with what was found, both settle where the load is now."""
    rng = np.random.default_rng(5)
    flow, heat = np.array([[-0.03, 0.015], [0.012, -0.025]]), np.array([0.35, 0.1])
    before, after = np.linalg.solve(-flow, heat), np.linalg.solve(-flow, heat * [0.6, 1.0])
    values, vectors = np.linalg.eig(flow)

    def towards(start, end, time):
        return end + (vectors @ (np.linalg.solve(vectors, start - end)[:, None] * np.exp(values[:, None] * time))).T

    start = np.zeros(2)
    early = towards(start, before, MINUTES[:101])
    late = towards(early[-1], after, MINUTES[1:201])
    curve = 20.0 + np.concatenate([early, late])
    readings = curve + 0.03 * rng.standard_normal(curve.shape)
    found = tf.identify({"time_min": MINUTES[:301], "T1": readings[:, 0], "T2": readings[:, 1]}, auto=True)
    for r, end in zip(found, 20.0 + after, strict=True):
        assert r.steady_state_lo_c <= end <= r.steady_state_hi_c
        assert r.steady_state_c == pytest.approx(end, abs=0.4)


def test_a_load_that_jumps_at_a_logged_time_jumps_there_however_fast_the_machine_is():
    """A machine of eight minutes read once a minute: the grid of a fit is finer than the file, the load is not."""
    rng = np.random.default_rng(2)
    power = np.where((MINUTES // 50.0) % 2 == 0, 600.0, 200.0)
    rise = [0.0]
    for p in power[:-1]:
        rise.append(0.05 * p + (rise[-1] - 0.05 * p) * np.exp(-1.0 / 8.0))
    for shift, column in ((0, power), (1, np.concatenate([power[:1], power[:-1]]))):  # held until the next, or told afterwards
        record = {"time_min": MINUTES, "T": 20.0 + np.array(rise) + 0.03 * rng.standard_normal(len(MINUTES)), "power [W]": column}
        (found,) = tf.compare(record, drive="power [W]")
        assert found.status == "ok", shift
        assert found.rmse_fit_c == pytest.approx(0.03, rel=0.15)
        (found,) = tf.identify(record, until=157, drive="power [W]")
        assert found.steady_state_lo_c <= 30.0 <= found.steady_state_hi_c
        assert found.steady_state_c == pytest.approx(30.0, abs=0.1)


def test_a_logged_load_counts_as_it_was_last_and_one_that_cycles_as_its_mean():
    """A power that jumps is what it is now; one that switches within the time constant is its mean over whole cycles."""
    rng = np.random.default_rng(1)
    for every, until, level in ((50.0, 150.0, 200.0), (50.0, 155.0, 200.0), (50.0, 203.0, 600.0), (4.0, 200.0, 400.0)):
        power = np.where((MINUTES // every) % 2 == 0, 600.0, 200.0)
        rise = [0.0]
        for p in power[:-1]:
            rise.append(0.05 * p + (rise[-1] - 0.05 * p) * np.exp(-1.0 / 30.0))
        record = {"time_min": MINUTES, "T": 20.0 + np.array(rise) + 0.03 * rng.standard_normal(len(MINUTES)), "power [W]": power}
        (found,) = tf.identify(record, until=until, drive="power [W]")
        assert found.steady_state_lo_c <= 20.0 + 0.05 * level <= found.steady_state_hi_c
        assert found.steady_state_c == pytest.approx(20.0 + 0.05 * level, abs=0.5)


@pytest.mark.proof
def test_a_staircase_counts_as_its_last_step_however_fast_it_is_climbed():
    """Four stages of 20 min within a time constant of 60 go on in one direction; what is up, down and up again is a cycle."""
    time = np.arange(0.0, 90.0, 0.5)
    climbed = 250.0 * (1.0 + np.minimum(time // 20.0, 3.0))
    assert last_level(time, climbed, 60.0) == 1000.0
    assert last_level(time, climbed[::-1].copy(), 60.0) == 250.0
    # Up, up, and back a little: no cycle yet.
    assert last_level(time, np.where(time < 70.0, climbed, 500.0), 60.0) == 500.0
    switched = np.where((time // 5.0) % 2 == 0, 600.0, 200.0)
    assert last_level(time, switched, 60.0) == pytest.approx(400.0, abs=1.0)
    # One that climbed before it began to switch is the mean of what switches.
    both = np.where(time < 40.0, 250.0 + 250.0 * (time // 20.0), switched + 500.0)
    assert last_level(time, both, 60.0) == pytest.approx(900.0, abs=25.0)

    rise, held = [0.0], []
    for p in climbed[:-1]:
        rise.append(0.02 * p + (rise[-1] - 0.02 * p) * np.exp(-0.5 / 60.0))
    for seed in (1, 2, 3, 4, 5):
        reading = 20.0 + np.array(rise) + 0.02 * np.random.default_rng(seed).standard_normal(len(time))
        table = {"time_min": time, "T": reading, "power_w": climbed}
        for until in (65.0, 75.0):
            for way in ({"drive": "power_w"}, {"auto": True})[: 2 if seed < 4 else 1]:  # a search takes seconds
                (found,) = tf.identify(table, until=until, **way)
                held.append(found.steady_state_lo_c <= 40.0 <= found.steady_state_hi_c)
                assert held[-1] or seed > 1, (until, way)
                assert abs(found.steady_state_c - 40.0) < 1.5, (seed, until, way)
                assert found.status == "model_doubtful", (until, way)
                assert "the heat stayed for 20 min at most" in found.message
    assert sum(held) >= len(held) - 1 == 15  # of 16 that are to hold in 95 %
    (plain,) = tf.identify(table, until=75.0)
    assert "power_w changed at 20, 40, 60 min, which is not counted" in plain.message
    (held,) = tf.identify({**table, "power_w": np.full(len(time), 250.0)}, until=75.0)
    assert "not counted" not in held.message


def test_how_long_a_load_stayed_where_it_was():
    time = np.arange(0.0, 90.0, 0.5)
    stages = np.minimum(time // 20.0, 3.0)
    assert longest_stay(time, stages) == 29.5
    assert longest_stay(time, np.minimum(time // 6.0, 9.0)) == pytest.approx(35.5)  # each is a ninth of the range
    for never in (np.ones(len(time)), (time >= 0.5) * 1.0, time // 5.0 % 2, np.where(time < 40.0, stages, 0.0), time):
        assert longest_stay(time, never) == np.inf


def test_heat_flows_back_along_a_link_that_the_readings_asked_for_in_one_direction_only():
    seen = observe(tf.read(machine(503, 3)[1][0])).seen
    link = next(effect() for effect in BUILT_IN if effect.id == "neighbour_heat")
    row = next(choice for choice in link.choices(seen) if choice.label == "row")
    one_way = fit_model(seen, [Part(link, row, (False, True, False))])
    both = both_ways(one_way)
    assert both.model.parts[0].choice.ways(seen.channels, both.model.parts[0].concerns(3)) == [
        "T1 by T2",
        "T2 by T1 and T3",
        "T3 by T2",
    ]
    assert both.rss.sum() < one_way.rss.sum()
    # Each side of the middle has a coupling of its own; the ends have one neighbour, and no ratio that does anything.
    assert both.model.active[:, both.model.column(Key(0, "ratio"))].tolist() == [False, True, False]
    assert float(both.values[Key(0, "ratio")][1]) != pytest.approx(1.0, abs=1e-3)


@pytest.mark.proof
def test_after_a_change_of_load_all_linked_sensors_settle_where_the_law_says():
    """Linked bodies whose load rises by half at 100 min, read up to 150 min: one exponential would miss by many kelvin."""
    record, limits, _ = machine(507, 3, step=0.5)[1]
    for r, limit in zip(tf.identify(record, until=150, auto=True), limits, strict=True):
        if r.status == "ok":  # of such rows one in twenty may lie a little outside
            half = 0.5 * (r.steady_state_hi_c - r.steady_state_lo_c)
            assert r.steady_state_lo_c - 0.3 * half <= limit <= r.steady_state_hi_c + 0.3 * half


def test_a_body_may_follow_its_heat_at_other_rates_too():
    """With shares of modes beside its own: of one body a difference of two exponentials."""
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(MINUTES))
    record = {"time_min": MINUTES, "T": 20.0 - 15.0 * np.expm1(-0.02 * MINUTES) + noise}
    seen = observe(tf.read(record)).seen
    fit = fit_model(seen)
    assert not len(rises_of(fit, seen)["T"].others)
    found = rises_of(fit, seen, other_modes=0.1)["T"].others
    rate = np.exp(DRIVEN_MODES)[:, None]
    inside = GRID < 20.0
    assert found[:, inside] == pytest.approx(0.1 * (np.exp(-GRID) - np.exp(-rate * GRID))[:, inside], abs=1e-3)


def test_what_a_background_may_do_beside_has_the_size_that_the_readings_show():
    """The covariance of `others` belongs to the background: it grows with the scale of a hypothesis, and is part of an effect's."""
    covariance = Known(np.zeros((1, 2)), GRID, *[np.ones((1, 1, len(GRID)))] * 3, np.zeros((1, 1, len(GRID))))
    time, asked = np.array([10.0, 20.0]), Asked(np.zeros(0))
    assert covariance.wrong(time, asked, True)[1].shape == (0, 0, 0)
    lines = 0.1 * np.exp(-GRID)[None, None]
    some = replace(covariance, log_rate=np.array([[np.log(0.02), 0.1]]), others=lines)
    assert some.wrong(time, asked, False)[1].shape == (0, 0, 0)
    found = some.wrong(time, asked, True)[1][0]
    line = np.interp(0.02 * time, GRID, lines[0, 0])
    assert found[:2, :2] == pytest.approx(np.outer(line, line), rel=1e-6)


def test_what_neighbours_bring_counts_among_what_a_sensor_does():
    """A curve that ends at three times the rise of its own heat, and one at half of it: what may be wrong is a share of the larger."""
    x = np.linspace(0.0, 20.0, 50)
    curve = np.array([3.0, 0.5])[:, None, None] * -np.expm1(-x)
    known = Known(np.zeros((2, 2)), x, curve, curve, curve, np.zeros((2, 0, 50)))
    np.testing.assert_allclose(known.moved, [3.0, 1.0], rtol=1e-6)


def test_relaxation_ends_where_all_sensors_are_what_they_are_beside_each_other():
    rng = np.random.default_rng(2)
    links = rng.uniform(0.0, 0.3, (4, 4))
    alone = rng.normal(size=(4, 30))
    found = relaxed(np.zeros((4, 30)), lambda curves: alone + links @ curves)
    assert found == pytest.approx(np.linalg.solve(np.eye(4) - links, alone), abs=1e-4)
    kept = relaxed(np.zeros((4, 30)), lambda curves: alone + links @ curves, np.arange(30) >= 12)
    assert not kept[:, :12].any()
    assert kept[:, 12:] == pytest.approx(found[:, 12:], abs=1e-4)
