"""What the other sensors of a run, and its own later readings, say against a sensor that is said to have settled."""

import numpy as np
import pytest
from scipy.linalg import expm

import thermofast as tf
from benchmarks.machines.odd_heats import DOUBTS, KINDS, judge, simulate
from benchmarks.unlike_parts.far_masses import machine
from thermofast.models.uncertainty.companions import faster, moved_since, rest_of_warm, risen_before


def test_how_many_times_as_fast_as_the_others():
    rate = np.array([0.02, 0.025, 0.3, 0.018, np.nan])
    found = faster(rate, 40.0, 4.0, 8.0, 2.0)
    np.testing.assert_allclose(found, [np.nan, np.nan, 0.3 / 0.02, np.nan, np.nan])
    assert not np.isfinite(faster(rate, 120.0, 4.0, 8.0, 2.0)).any()  # the others were read for two time constants
    assert not np.isfinite(faster(np.array([0.3]), 40.0, 4.0, 8.0, 2.0)).any()
    # Most are as fast: as the slowest of them, if it is done itself.
    several = np.array([0.3, 0.3, 0.25, 0.02])
    np.testing.assert_allclose(faster(several, 40.0, 4.0, 8.0, 2.0), [15.0, 15.0, 12.5, np.nan])
    assert not np.isfinite(faster(several / 10.0, 40.0, 4.0, 8.0, 2.0)[:3]).any()


def test_how_far_readings_moved_since_they_were_done():
    time = np.arange(0.0, 200.0)
    settled = 8.0 * -np.expm1(-0.05 * time)
    drifts = settled + 0.02 * np.maximum(time - 60.0, 0.0)
    reading = 20.0 + np.array([settled, drifts, drifts])
    found = moved_since(time, reading, np.array([0.05, 0.05, 0.012]), np.array([8.0, 8.0, np.nan]))
    assert abs(found[0]) < 1e-9
    # From the middle of the first third, 83 min, to that of the last, 177.
    assert found[1] == pytest.approx(0.02 * 94.0, abs=0.05)
    assert np.isnan(found[2])
    assert np.isnan(moved_since(time[:70], reading[:, :70], np.array([0.05, 0.05, 0.05]), np.full(3, 8.0))).all()


def two_bodies(duty, minutes=60.0):
    """A small body in front of a large one, heated by turns of ten minutes; limits by the mean heat."""
    time = np.arange(0.0, minutes, 0.25)
    heat = (time % 10.0 < 10.0 * duty) / duty
    matrix = np.array([[-0.14, 0.12], [0.02, -0.22 / 6.0]])
    onward = expm(np.block([[matrix, np.array([[2.0], [0.0]])], [np.zeros((1, 3))]]) * 0.25)
    rise = np.zeros((2, len(time)))
    for k in range(1, len(time)):
        rise[:, k] = onward[:2, :2] @ rise[:, k - 1] + onward[:2, 2] * heat[k - 1]
    return time, 20.0 + rise, 20.0 + np.linalg.solve(-matrix, [2.0, 0.0])


def test_a_body_that_is_heated_by_turns_has_not_settled_with_the_first():
    time, clean, limit = two_bodies(0.4)
    noise = np.random.default_rng(3).normal(0.0, 0.02, clean.shape)
    for r, truth in zip(tf.identify({"time_min": time, "T1": clean[0] + noise[0], "T2": clean[1] + noise[1]}), limit, strict=True):
        assert r.status != "ok" or r.steady_state_lo_c <= truth <= r.steady_state_hi_c


def rows_of(loose):
    time, rng = np.arange(0.0, 25.25, 0.25), np.random.default_rng(5)
    rows = [20.0 + r * -np.expm1(-time / tau) for r, tau in ((9.0, 60.0), (7.0, 66.0), (8.0, 72.0))]
    if loose:
        rows[0] = np.where(time > 8.0, 20.0 + 0.3 * (rows[0] - 20.0), rows[0])
    return tf.identify({"time_min": time} | {f"T{i}": row + rng.normal(0.0, 0.02, len(time)) for i, row in enumerate(rows)})


def test_a_probe_that_came_loose_is_no_fast_machine():
    loose, sound = rows_of(True), rows_of(False)
    assert loose[0].status == "model_doubtful"
    assert "times as fast as others of the run, which have not settled" in loose[0].message
    assert [r.status for r in loose[1:]] == [r.status for r in sound[1:]] == ["ok", "ok"]
    assert sound[0].status == "ok"


def test_a_point_that_does_not_move_while_others_do_is_not_determined():
    time, rng = np.arange(0.0, 100.5, 0.5), np.random.default_rng(6)
    table = {"time_min": time, "near": 20.0 + 9.0 * -np.expm1(-time / 60.0), "far": np.full(len(time), 20.0)}
    for name in ("near", "far"):
        table[name] = table[name] + rng.normal(0.0, 0.02, len(time))
    near, far = tf.identify(table)
    assert near.status == "ok"
    assert far.status == "not_determined"
    assert "of what others have: heat may still be on its way to it" in far.message
    alone = tf.identify({n: table[n] for n in ("time_min", "far")})[0]
    assert "it did not move by more than its noise" in alone.message


@pytest.mark.proof
def test_doubtful_rows_would_mostly_have_missed_and_plain_machines_have_none():
    jobs = [(k, kind, i) for k, kind in enumerate(KINDS) if kind in ("duty", "loose") for i in range(5)]
    rows = [row for k, kind, i in jobs for read in (0.4, 1.0) for row in judge((kind, 640_000 + 1000 * k + i, read))]
    doubted = [r for r in rows if r[4]]
    assert len(doubted) >= 7
    assert np.mean([r[3] for r in doubted]) < 0.3
    for i in range(5):  # of machines under a constant heat no row is doubtful for this alone
        record = simulate("plain", 640_000 + i)
        for read in (0.4, 1.0):
            n = int(np.searchsorted(record.time, read * record.tau)) + 1
            table = {"time_min": record.time[:n]} | {f"T{k}": row[:n] for k, row in enumerate(record.reading)}
            found = [r for r in tf.identify(table) if any(words in r.message for words in DOUBTS)]
            assert all("an effect beside the law is likely" in r.message for r in found)


def test_what_the_point_that_moved_most_shows_is_still_ahead_of_the_others():
    """Of a heat that is switched: the heated point swings, three more have long settled by the law, and end kelvins from there."""
    record = simulate("duty", 661_050)
    n = int(np.searchsorted(record.time, 0.4 * record.tau)) + 1
    rows = tf.identify({"time_min": record.time[:n]} | {f"T{i}": row[:n] for i, row in enumerate(record.reading)})
    assert all(r.status == "model_doubtful" for r in rows)
    assert "the point that moved most shows a heat that is not constant" not in rows[0].message
    assert all("the point that moved most shows a heat that is not constant" in r.message for r in rows[1:])
    missed = [not r.steady_state_lo_c <= limit <= r.steady_state_hi_c for r, limit in zip(rows, record.limit, strict=True)]
    assert missed == [True, True, True, True]


@pytest.mark.parametrize(("what", "said"), [("a jump", True), ("an outlier", False), ("a gap", False)])
def test_a_jump_that_no_machine_makes_is_doubtful(what, said):
    time, rng = np.arange(0.0, 121.0), np.random.default_rng(9)
    reading = 20.0 + 9.0 * -np.expm1(-time / 60.0) + rng.normal(0.0, 0.02, len(time))
    if what == "a jump":
        reading[20:] -= 1.5
    elif what == "an outlier":
        reading[20] -= 1.5
    else:
        time, reading = np.delete(time, np.s_[20:50]), np.delete(reading, np.s_[20:50])
    row = tf.identify({"time_min": time, "T": reading})[0]
    assert (f"the readings jump at {20:g} min, as no machine does" in row.message) == said
    assert (row.status == "ok") != said


def test_how_far_a_sensor_rose_before_its_record_begins():
    first, last = np.array([20.5, 45.0, 20.0, 24.0]), np.array([25.0, 50.0, 21.0, 84.0])
    assert risen_before(first, last, 20.0) == pytest.approx([0.0, 24.0, 0.0, 0.0])  # a tenth of what it moved is no sign of it
    assert risen_before(first, last, np.inf) == pytest.approx(np.zeros(4))


def test_what_slow_parts_of_the_whole_rise_may_add():
    before, shown = np.array([30.0, 30.0, 30.0, 0.0, 30.0]), np.array([10.0, 10.0, 1.0, 10.0, -5.0])
    found = rest_of_warm(before, shown, np.array([0.0, 1.0, 0.0, 1.0, 1.0]))
    # Three quarters were done: log 4 time constants before the first reading.
    expected = [0.5 * 0.5 * 30.0, 0.25 * np.exp(-0.5) * 30.0, 0.5 / np.sqrt(31.0) * 30.0, 0.0, 0.0]
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("seed", [4, 10, 17])
def test_heavy_masses_that_have_hardly_moved_are_not_said_to_settle_with_a_spindle(seed):
    """Chains by scipy's solver, read for two of the spindle's times: with its rate these were `ok`, far too low."""
    minutes, reading, limit, _, quick, turn = machine(seed)
    some = minutes <= 2.0 * turn
    table = {"time_min": minutes[some]} | {f"T{i}": line[some] for i, line in enumerate(reading)}
    heavy = [(r, end) for r, end in zip(tf.identify(table), limit, strict=True) if int(r.channel[1:]) >= quick]
    moved = np.abs(reading[:, some][:, -1] - reading[:, 0])
    little = [(r, end) for r, end in heavy if moved[int(r.channel[1:])] < 0.08 * moved.max()]
    assert little
    for r, end in little:
        assert r.rate_shared_with == "" or not set(r.rate_shared_with.split(", ")) & {f"T{i}" for i in range(quick)}
        assert r.status != "ok" or r.steady_state_lo_c <= end <= r.steady_state_hi_c
    # Who says that all have one rate is believed.
    asked = {r.channel: r.rate_shared_with for r in tf.identify(table, rates="shared")}
    assert any(asked[r.channel] for r, _ in little)
