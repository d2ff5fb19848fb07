"""What a change between runs is made of: sizes, kinds, rooms, probes and warm starts, by normal laws."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal, stats

import thermofast as tf
from thermofast.analysis import changed as analysis
from thermofast.analysis.changed import _bent, _of_a_size
from thermofast.analysis.sides import hardly_bent
from thermofast.models.joint import LEVEL, RATE, START, fit_model
from thermofast.models.search import judge
from thermofast.models.uncertainty import changes as changed
from thermofast.models.uncertainty.changes import begun, kinds, numbers, repeats
from thermofast.observing.observe import observe


def test_a_mixed_size_has_the_spread_of_its_ways():
    """Halves of 0.1 and 0.3 with deviations of 0.1: the root of 0.01 and 0.01; none where the likeliest way has none."""
    found = kinds._mixed(np.array([0.6, 0.4]), [(1, 0.1, 0.1), (2, 0.3, 0.1)])
    assert found == (1, pytest.approx(0.18), pytest.approx(math.sqrt(0.01 + 0.6 * 0.08**2 + 0.4 * 0.12**2)))
    assert kinds._mixed(np.array([0.6, 0.4]), [None, (2, 0.3, 0.1)]) == (None, None, None)


def test_another_room_has_the_part_of_nothing_that_it_takes():
    """The likeliest stands first."""
    found = [changed.Change("nothing", None, 0.8), changed.Change("heat", None, 0.2, 0.1, 0.02)]
    told = [(c.kind, pytest.approx(c.probability)) for c in changed.with_room(found, 0.7, 4.0, 0.5)]
    assert [(c.kind, c.probability) for c in changed.with_room(found, 0.7, 4.0, 0.5)] == told
    assert [k for k, _ in told] == ["room", "nothing", "heat"]
    assert [c.probability for c in changed.with_room(found, 0.7, 4.0, 0.5)] == pytest.approx([0.56, 0.24, 0.2])


def test_sensors_begin_beside_each_other_less_the_middle_of_all_or_of_the_others():
    """One that began 5 K higher in the new run is off by 5 K of the others, by 5 K of all as well."""
    starts = np.array([[20.0, 21.0, 22.0], [20.0, 21.0, 22.0], [21.0, 27.0, 23.0]])
    of_all, of_others = changed.begun_beside(starts, 2)
    assert of_all[2].tolist() == [0.0, 5.0, 0.0]
    assert of_others[2].tolist() == [1.0 - 3.5, 5.0, 1.0 - 3.5]
    assert (of_all[:2] == 0.0).all()


def test_rooms_are_others_by_three_kelvin_or_three_deviations():
    """Half likely there, by the error of both means."""
    old, new = np.array([20.0, 20.0]), np.array([23.0])
    assert changed.other_room(old, new, 0.2) == pytest.approx(0.5)
    assert changed.other_room(old, new + 0.3, 0.2) == pytest.approx(stats.norm.cdf(0.3 / (0.2 * math.sqrt(1.5))))
    wide = np.array([17.0, 20.0, 23.0])
    assert changed.other_room(wide, np.array([29.0]), 0.2) == pytest.approx(0.5)
    assert changed.other_room(wide, np.array([11.0]), 0.2) == pytest.approx(0.5)


def test_a_size_is_the_posterior_mean_of_a_normal_prior():
    """Heat moves both rises by 0.2, known to 0.1 each, beside a prior of 0.4: 0.2 times 16 / 16.5 of the precision."""
    noise = np.diag([0.01, 0.01, 0.01, 0.01])
    heat = np.array([0.0, 0.0, 1.0, 1.0])[:, None]
    found = kinds._size("heat", heat, 0.4, np.array([0.0, 0.0, 0.2, 0.2]), noise)
    assert found == (None, pytest.approx(0.2 * 200.0 / 206.25), pytest.approx(1.0 / math.sqrt(206.25)))
    assert kinds._size("nothing", heat, 0.4, np.zeros(4), noise) is None
    most = kinds._size("contact", np.eye(4), 0.2, np.array([0.0, 0.3, 0.1, 0.0]), noise)
    assert most == (1, pytest.approx(0.0), pytest.approx(1.0 / math.sqrt(125.0)))


def test_kinds_of_change_move_what_physics_has_them_move():
    """Heat the rises, heat capacity the rates down, loss rates up and rises down, a sensor its own two; of one none of these."""
    told = kinds._hypotheses(2)
    assert [(k, s) for k, s, *_ in told] == [
        ("nothing", None),
        ("heat", None),
        ("heat capacity", None),
        ("loss", None),
        ("sensor", 0),
        ("sensor", 1),
        ("contact", None),
    ]
    assert [d[:, 0].tolist() for _, _, d, *_ in told[1:4]] == [[0, 0, 1, 1], [-1, -1, 0, 0], [1, 1, -1, -1]]
    assert told[5][2].tolist() == [[0, 0], [0, 1], [0, 0], [1, 0]]
    assert sum(p for *_, p in told) + kinds.PRIORS["exchanged"] == pytest.approx(1.0)
    assert [size for *_, size, _ in told] == [0.0, 0.4, 0.4, 0.4, 0.2, 0.2, 0.2]
    assert len(kinds._hypotheses(1)) == 4


def test_kinds_of_change_are_weighed_by_their_marginal_likelihoods():
    """Of one sensor whose rise is 0.3 larger in the logarithm, by scipy's normal densities under each scatter."""
    old = [changed.RunNumbers(np.zeros(2), 1e-4 * np.eye(2))]
    new = [changed.RunNumbers(np.array([0.0, 0.3]), 1e-4 * np.eye(2))]
    found = changed.changes(old, new)
    difference, weights, mixed = np.array([0.0, 0.3]), np.zeros(4), np.zeros((2, 2))
    for (scale, prior_of), (own_scale, of_own) in itertools.product(repeats.SCALES, repeats.OWN_SCALES):
        noise = 2.0 * (repeats.scatter(1, scale, own_scale) + 1e-4 * np.eye(2))
        for k, (kind, _, direction, size, prior) in enumerate(kinds._hypotheses(1)):
            own = kinds._size(kind, direction, size, difference, noise)
            unlike = (0.1 * own[1]) ** 2 * np.eye(2) if own else 0.0
            covariance = noise + size**2 * direction @ direction.T + unlike
            weight = prior_of * of_own * prior * stats.multivariate_normal.pdf(difference, np.zeros(2), covariance)
            weights[k], mixed = weights[k] + weight, mixed + weight * noise
    told = {c.kind: c.probability for c in found.changes}
    assert [told[k] for k in ("nothing", "heat", "heat capacity", "loss")] == pytest.approx(weights / np.sum(weights))
    assert found.changes[0].kind in ("heat", "nothing")
    assert found.difference == pytest.approx(difference)
    assert found.noise == pytest.approx(mixed / np.sum(weights))
    with pytest.raises(ValueError, match="no runs"):
        changed.changes(old, [])


def test_a_run_that_began_warmer_was_warm_or_in_another_room():
    """Another room moves all alike, to 0.3 K; a warm machine would have risen by as much more."""
    begun = changed.Begun(np.array([2.0, 2.0]), np.array([8.0, 4.0]), warm=0.2, room=0.7)
    (room, _, beside), (warm, shift, unsure) = begun.ways()
    assert room - warm == pytest.approx(math.log(0.8 / 0.2) - math.log(0.3 / math.hypot(0.3, 1.0)))
    assert shift == pytest.approx([0.0, 0.0, -math.log(1.25), -math.log(1.5)])
    assert beside == pytest.approx(0.3 * np.array([0.0, 0.0, 0.1, 1.0 / 6.0]))
    assert unsure == pytest.approx(0.7 * np.array([0.0, 0.0, 0.1, 1.0 / 6.0]))
    apart = changed.Begun(np.array([1.0, 3.0]), np.array([8.0, 4.0]), warm=0.2)
    lower = apart.ways()[0][0] - room
    assert lower == pytest.approx(-0.5 * 2.0 / 0.09)


def test_a_probe_that_is_off_begins_elsewhere_and_rises_as_before():
    """By 4 K in the new run; one that rises by 4 K less was warm, and of two sensors nobody knows which is off."""
    starts = np.array([[20.0, 20.0, 20.0, 20.0], [20.0, 20.0, 20.0, 20.0], [20.0, 24.0, 20.0, 20.0]])
    rises, errors = np.full((3, 4), 10.0), np.full(4, 0.02)
    nothing = [changed.Change("nothing", None, 1.0)]
    probe, rest = changed.with_offset(nothing, starts, rises, 2, errors)
    assert (probe.kind, probe.sensor, probe.kelvin) == ("sensor", 1, True)
    assert probe.probability > 0.95
    assert probe.probability + rest.probability == pytest.approx(1.0)
    variance = 0.09 * 4 / 8 * (0.5 + 1.0)
    assert probe.size == pytest.approx(4.0 * 4.0 / (4.0 + variance))
    assert probe.deviation == pytest.approx(math.sqrt(4.0 * variance / (4.0 + variance)))
    rises[2, 1] = 6.0
    warm = changed.with_offset(nothing, starts, rises, 2, errors)
    assert next(c for c in warm if c.kind == "sensor").probability < 0.5
    assert changed.with_offset(nothing, starts[:, :2], rises[:, :2], 2, errors[:2]) == nothing
    assert changed.with_offset(nothing, starts[1:], rises[1:], 1, errors) == nothing
    assert len(changed.with_offset(nothing, starts[1:], rises[1:], 1, errors, stands_for=2)) == 2


def test_where_a_sensor_began_beside_the_others():
    """Each beside where it began before, less the middle of all; less that of the others alone for the one that is off."""
    starts = np.array([[20.0, 21.0, 22.0], [21.0, 22.0, 23.0], [20.6, 24.5, 22.7]])  # the middle one passes the last
    beside, alone = changed.begun_beside(starts, 2)
    np.testing.assert_allclose(beside, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-0.1, 2.8, 0.0]], atol=1e-12)
    assert alone[2, 1] == pytest.approx(3.0 - 0.15)
    rises = np.array([[9.0, 7.0, 5.0]] * 3)
    found = changed.with_offset([changed.Change("nothing", None, 1.0)], starts, rises, 2, np.full(3, 0.01))
    variance = begun.BESIDE**2 / 2.0 * (1.0 / 2.0 + 1.0)  # of two old runs without scatter of their own and a new one
    shrunk = begun.PROBE**2 / (begun.PROBE**2 + variance)
    assert (found[0].kind, found[0].sensor, found[0].kelvin) == ("sensor", 1, True)
    assert found[0].size == pytest.approx(2.85 * shrunk)
    assert (
        changed.with_offset([changed.Change("nothing", None, 1.0)], starts[1:], rises[1:], 1, np.full(3, 0.01))[0].kind == "nothing"
    )
    told = changed.with_offset([changed.Change("nothing", None, 1.0)], starts[1:], rises[1:], 1, np.full(3, 0.01), 2)
    assert (told[0].kind, told[0].sensor) == ("sensor", 1)


def test_a_large_change_is_not_one_factor_on_every_point():
    """Points differ by a tenth of its logarithm: over six numbers a factor of two is open by 2.8 % more, a hundredth by nothing."""

    def deviation(log):
        old = [changed.RunNumbers(np.zeros(6), np.eye(6) * 1e-10) for _ in range(40)]
        new = [changed.RunNumbers(np.concatenate([np.full(3, log), np.full(3, -log)]), np.eye(6) * 1e-10) for _ in range(40)]
        return next(c for c in changed.changes(old, new).changes if c.kind == "loss").deviation

    large, small = deviation(np.log(2.0)), deviation(0.01)
    assert np.sqrt(large**2 - small**2) == pytest.approx(kinds.UNLIKE * np.log(2.0) / np.sqrt(6.0), rel=0.1)


def test_a_change_of_the_whole_machine_is_one_that_its_points_show():
    """Errors that all have in common let least squares go beyond all that was measured, as in Peelle's puzzle; then it is none."""
    n, size = 6, 0.11
    errors = np.array([0.006, 0.006, 0.02, 0.02, 0.02, 0.02])
    noise = np.kron(np.eye(2), 0.95 * np.outer(errors, errors) + np.diag(0.05 * errors**2))
    of_heat = next(d for kind, _, d, *_ in kinds._hypotheses(n) if kind == "heat")

    def shown(rises, at=size):
        return kinds._of_every_point("heat", of_heat, (None, at, 0.02), np.concatenate([np.zeros(n), rises]), noise)

    assert shown(np.full(n, size))
    assert shown(np.array([0.15, 0.09, 0.12, 0.1, 0.11, 0.1]))
    up_and_down = np.log([1.09, 1.11, 0.95, 0.95, 0.95, 0.95])
    puzzle = kinds._size("heat", of_heat, kinds.SIZE, np.concatenate([np.zeros(n), up_and_down]), noise)
    assert not -0.051 <= puzzle[1] <= 0.104  # beyond all of them, and none of both ways
    assert not shown(up_and_down)
    assert not shown(np.full(n, size), 2.0 * size)
    assert shown(-np.full(n, size), -size)
    assert shown(np.array([0.15, 0.09, 0.12, 0.1, 0.11, -0.5]))  # one of them is elsewhere
    assert kinds._of_every_point("sensor", of_heat, (None, 9.0, 0.1), np.zeros(2 * n), noise)
    assert kinds._of_every_point("heat", of_heat[:2], (None, 9.0, 0.1), np.zeros(2), noise[:2, :2])


def test_a_change_that_its_points_do_not_show_is_none_of_the_kinds():
    """Four of six rise more and two less, each as fast as before: no heat, whatever is likely of it."""
    old = changed.RunNumbers(np.zeros(12), 1e-6 * np.eye(12))
    new = changed.RunNumbers(np.concatenate([np.zeros(6), [0.3, 0.3, 0.3, 0.3, -0.2, -0.2]]), 1e-6 * np.eye(12))
    told = {c.kind: c.probability for c in changed.changes([old], [new]).changes}
    assert told["heat"] < 0.02  # where sensors scatter six times as much as usual four of six may
    assert max(told, key=told.get) == "contact"


def test_a_probe_is_told_from_a_test_that_is_logged_late():
    """Of a machine whose heated part had warmed by 7 K when the logger began; far sensors tell nothing of the heat of all."""
    starts = np.zeros((4, 6)) + np.random.default_rng(3).normal(0.0, 0.05, (4, 6))
    rises = np.tile([30.1, 17.7, 12.9, 10.7, 72.9, 105.2], (4, 1))
    errors = np.array([0.06, 0.06, 0.07, 0.23, 0.44, 4.7])
    nothing = [changed.Change("nothing", None, 1.0)]
    late, off = starts.copy(), starts.copy()
    late[3] += [7.4, 2.5, 0.7, 0.1, 0.0, 0.1]
    less = rises.copy()
    less[3] = [23.0, 14.8, 11.1, 6.4, 6.0, 5.1]
    assert changed.with_offset(nothing, late, less, 3, errors)[0].kind == "nothing"
    off[3, 0] += 7.4
    found = changed.with_offset(nothing, off, rises, 3, errors)[0]
    assert (found.kind, found.sensor, found.kelvin) == ("sensor", 0, True)
    assert found.probability > 0.95


def test_the_middle_counts_what_is_known():
    assert begun.weighted_median(np.array([3.0, 1.0, 2.0]), np.ones(3)) == 2.0
    assert begun.weighted_median(np.array([3.0, 1.0, 2.0]), np.array([0.1, 1.0, 1.0])) == 3.0


def test_more_loss_leaves_no_point_warmer():
    loss = kinds._hypotheses(2)[3][2]
    noise = 0.01**2 * np.eye(4)
    for rise, fine in ((-0.3, True), (0.01, True), (0.03, False)):
        assert kinds._all_one_way(loss, (None, 0.4, 0.1), np.array([0.4, 0.2, -0.5, rise]), noise) == fine


def a_run(course=0.0, rates=(0.01, 0.03), rises=(4.0, 9.0)):
    """Sensors that follow a logged room of 20 degC and this course by scipy's integrator of linear systems, without noise."""
    time = np.arange(0.0, 301.0)
    room = 20.0 + course * np.sin(2.0 * np.pi * time / 200.0)
    rows = [
        stats.norm.rvs(scale=1e-4, size=len(time), random_state=k) + signal.lsim((-b, b, 1.0, 0.0), room + rise, time, X0=20.0)[1]
        for k, (b, rise) in enumerate(zip(rates, rises, strict=True))
    ]
    return tf.read({"time_min": time, **{f"T{i}": row for i, row in enumerate(rows)}, "ambient": room}, name="run")


def test_a_logged_room_is_taken_out_of_a_run_before_its_rates_are_told():
    """The fit of the law alone is 8 % off; a run in a still room is left as it is."""
    run = observe(a_run(0.5)).seen
    fit = changed.without_room(run)
    assert fit.values[RATE] == pytest.approx([0.01, 0.03], rel=2e-3)
    assert fit.values[LEVEL] - run.sink_c == pytest.approx([4.0, 9.0], rel=2e-3)
    assert fit.values[START] == pytest.approx([20.0, 20.0], abs=0.01)
    assert abs(fit_model(run).values[RATE][0] / 0.01 - 1.0) > 0.07
    still = observe(a_run()).seen
    assert changed.without_room(still).values[RATE] == pytest.approx(fit_model(still).values[RATE], rel=1e-9)


def test_the_air_beside_a_sensor_moves_its_own_numbers_and_the_room_those_of_all():
    """A constant of 0.1 K is so much of a rise, whatever else: 0.1 / 4 and 0.1 / 9 of the two; only drifts are common."""
    fit = fit_model(observe(a_run()).seen)
    alone, still = changed.RunNumbers.of(fit, 1.0), changed.RunNumbers.of(fit, 1.0, 0.0)
    air = still.covariance - alone.covariance
    assert air[0, 1] == air[0, 3] == air[2, 3] == 0.0
    moved = np.array([[0.0, 0.0, 0.025, 0.025], [0.2, 0.2, -0.1, -0.1], np.zeros(4), [0.0, 0.0, 1.0, -1.0]])
    own = numbers._of_the_air(moved, 2.0)
    assert own[0, 0] == pytest.approx(0.2**2 * (4.0 + changed.LOGGED_DRIFT**2))
    assert own[0, 1] == pytest.approx(4.0 * 0.2**2)
    assert own[0, 2] == pytest.approx(-0.02 * (4.0 + changed.LOGGED_DRIFT**2))
    assert own[2, 3] == pytest.approx(4.0 * 0.01 - numbers.LOGGED_COURSE**2)
    assert own[2, 2] == pytest.approx(0.01 * (4.0 + changed.LOGGED_DRIFT**2) + 0.025**2 + numbers.LOGGED_COURSE**2)
    assert math.sqrt(air[2, 2]) >= 0.1 / 4.0
    assert math.sqrt(air[3, 3]) >= 0.1 / 9.0


def test_a_sensor_that_is_hardly_bent_is_left_out_and_told():
    """Beside two that settle one of a time constant of 5,000 min shows a slope only; of all such none is left out."""
    rng = np.random.default_rng(3)

    def of(name, rates):
        run = a_run(0.0, rates, (10.0, 6.0, 8.0))
        return tf.read(
            {"time_min": run.time_s / 60.0} | {c: v + 0.02 * rng.standard_normal(len(v)) for c, v in run.channels.items()},
            name=name,
        )

    told = tf.changed(of("old", (0.02, 0.03, 0.0002)), of("new", (0.02, 0.03, 0.0002)))
    assert (told.verdict, told[0].status) == ("nothing", "ok")
    assert "hardly bent, where they settle does not show, and left out: T2" in told[0].message
    assert "not in every run" not in told[0].message
    # Where most are straight that is what the run is of; so is a straight one that moves as much as the others.
    for rates in ((0.0002,) * 3, (0.02, 0.0002, 0.0002)):
        kept = tf.changed(of("old", rates), of("new", rates))
        assert "left out" not in kept[0].message
    time = np.arange(0.0, 301.0)
    rows = [20.0 - 10.0 * np.expm1(-b * time) + 0.02 * rng.standard_normal(301) for b in (0.02, 0.03, *(0.0001,) * 6)]
    few, more = (
        [fit_model(observe(tf.read({"time_min": time} | {f"T{i}": rows[i] for i in which})).seen)] for which in (range(8), range(6))
    )
    assert hardly_bent(few) == []
    assert hardly_bent(more) == ["T2", "T3", "T4", "T5"]
    for rise, left_out in ((1.0, ["T2"]), (8.0, [])):
        table = {"time_min": time, "T0": rows[0], "T1": rows[1], "T2": 20.0 + rise * time / 300.0 + 0.3 * rng.standard_normal(301)}
        assert hardly_bent([fit_model(observe(tf.read(table)).seen)]) == left_out


def test_a_run_is_bent_by_kelvin_that_no_air_explains():
    """Readings 0.3 K beside the law, of 10 K, beside 0.02 K, are; 0.06 K of 1 K are not."""
    time = np.arange(0.0, 301.0)

    def fit(rise, beside):
        rows = [20.0 + rise * (1.0 - np.exp(-0.02 * time)) + beside * np.sin(2.0 * np.pi * time / 60.0)] * 2
        run = tf.read({"time_min": time, "a": rows[0], "b": rows[1]}, name="run")
        return fit_model(observe(run).seen)

    said = _bent([fit(4.0, 0.02), fit(4.0, 0.3)], 1, ("a", "b"))
    assert "a leaves the law of one rise by 0.2" in said[0]
    assert "in the new runs" in said[0]
    assert "in the old runs" in _bent([fit(4.0, 0.3), fit(4.0, 0.02)], 1, ("a", "b"))[0]
    assert not _bent([fit(1.0, 0.005), fit(1.0, 0.09)], 1, ("a", "b"))
    assert not _bent([fit(10.0, 0.02), fit(10.0, 0.3)], 1, ("a", "b"))


def test_nothing_is_not_sure_while_a_change_of_the_machine_has_a_size():
    """A heat of 1.2, to within 7 %, excludes none though it is unlikely; to within 12 % it does not. One sensor's does not count."""
    nothing = changed.Change("nothing", None, 0.9)
    sure = changed.Change("heat", None, 0.07, math.log(1.2), 0.07)
    assert _of_a_size([nothing, sure])
    assert not _of_a_size([nothing, changed.Change("heat", None, 0.07, math.log(1.2), 0.12)])
    assert not _of_a_size([nothing, changed.Change("sensor", 0, 0.07, math.log(1.2), 0.07)])
    assert not _of_a_size([nothing, changed.Change("loss", None, 0.05, 0.0, 0.07), sure])  # the likeliest of them decides


def test_a_room_that_warms_with_the_machine_is_not_taken_out_of_it():
    """A thermometer in the machine's warmth: with it taken out every rise would be another one by what it warmed."""
    rng = np.random.default_rng(8)

    def run(name, share, heat=1.0):
        time = np.arange(0.0, 301.0)
        rise = -np.expm1(-0.02 * time)
        rows = {n: 20.0 + heat * r * rise + 0.02 * rng.standard_normal(301) for n, r in (("a", 9.0), ("b", 6.0), ("c", 4.0))}
        return tf.read({"time_min": time} | rows | {"ambient": 20.0 + share * heat * 6.0 * rise}, name=name)

    told = tf.changed([run("old 1", 0.6), run("old 2", 0.6)], run("new", 0.6, 1.5))
    bare = tf.changed([run("old 1", 0.0), run("old 2", 0.0)], run("new", 0.0, 1.5))
    for found in (told, bare):
        assert (found.verdict, found[0].status) == ("heat", "ok")
        assert found[0].size_lo < 1.5 < found[0].size_hi
    assert told[0].size == pytest.approx(bare[0].size, rel=0.02)


def test_nothing_is_not_determined_while_a_change_has_a_size(monkeypatch):
    rng, run = np.random.default_rng(9), a_run(rates=(0.02, 0.03))
    minutes = run.time_s / 60.0
    noisy = [{n: row + 0.02 * rng.standard_normal(len(row)) for n, row in run.channels.items()} for _ in range(2)]
    runs = [tf.read({"time_min": minutes, **rows}, name=f"run {k}") for k, rows in enumerate(noisy)]
    told = tf.changed(runs[:1], runs[1])
    assert (told.verdict, told[0].status) == ("nothing", "ok")
    monkeypatch.setattr(analysis, "_of_a_size", lambda _: True)
    told = tf.changed(runs[:1], runs[1])
    assert (told.verdict, told[0].status) == ("nothing", "not_determined")


def test_a_misfit_is_set_against_what_moved_where_that_is_more_than_the_fitted_rise():
    """0.2 K beside 10 K that were read and a fitted rise of 1 K are no other course."""
    time, wave = np.arange(101.0), 0.3 * np.sin(np.arange(101.0) / 5.0)

    def fit(share, rise):
        run = SimpleNamespace(used=np.ones((1, 101), dtype=bool), time=time, moved=np.array([10.0]))
        values = {RATE: np.array([0.05]), LEVEL: np.array([20.0 + rise]), START: np.array([20.0])}
        return SimpleNamespace(residual=share * wave[None], run=run, values=values)

    assert not _bent([fit(0.01, 1.0), fit(1.0, 1.0)], 1, ("a",))
    assert not _bent([fit(0.01, 10.0), fit(1.0, 10.0)], 1, ("a",))
    assert "in the new runs" in _bent([fit(0.05, 10.0), fit(3.0, 10.0)], 1, ("a",))[0]


def test_one_that_is_left_out_changes_nothing_for_the_others():
    """The room's course is taken out of them once, whether or not another one is looked at first."""
    rng = np.random.default_rng(5)

    def of(name, course, heat, names):
        run = a_run(course, (0.02, 0.03, 0.00001), (10.0 * heat, 6.0 * heat, 240.0 * heat))
        rows = {n: row + 0.02 * rng.standard_normal(len(row)) for n, row in run.channels.items()}
        return [tf.read({"time_min": run.time_s / 60.0, **{n: rows[n] for n in some}, **run.ambient}, name=name) for some in names]

    both = ("T0", "T1"), ("T0", "T1", "T2")
    old, new = of("old", 0.8, 1.0, both), of("new", -0.8, 1.3, both)
    alone, beside = (tf.changed(a, b) for a, b in zip(old, new, strict=True))
    assert "left out: T2" in beside[0].message
    assert [(r.change, r.channel) for r in alone] == [(r.change, r.channel) for r in beside]
    assert [r.probability for r in alone] == pytest.approx([r.probability for r in beside], abs=1e-3)
    assert [r.size for r in alone if r.size] == pytest.approx([r.size for r in beside if r.size], rel=1e-3)


def numbers_of(rates, rises, error=0.01):
    values = np.log(np.concatenate([rates, rises]))
    return changed.RunNumbers(values, error**2 * np.eye(len(values)))


def test_two_sensors_that_have_each_others_numbers_were_exchanged():
    """However many there are, and no matter what they are called; where both are alike nobody can tell."""
    rng = np.random.default_rng(4)
    rates, rises = rng.uniform(0.01, 0.05, 40), rng.uniform(3.0, 20.0, 40)
    crossed = np.arange(40)
    crossed[[7, 31]] = 31, 7
    found = changed.changes([numbers_of(rates, rises)], [numbers_of(rates[crossed], rises[crossed])]).changes
    assert (found[0].kind, found[0].sensor, found[0].other) == ("exchanged", 7, 31)
    assert found[0].probability > 0.99
    assert sum(c.kind == "exchanged" for c in found) == kinds.PAIRS
    assert sum(c.probability for c in found) == pytest.approx(1.0)
    alike = changed.changes([numbers_of([0.02, 0.0201], [5.0, 5.02])], [numbers_of([0.0201, 0.02], [5.02, 5.0])]).changes
    assert alike[0].kind == "nothing"
    alone = changed.changes([numbers_of([0.02], [5.0])], [numbers_of([0.02], [5.0])]).changes
    assert not any(c.kind == "exchanged" for c in alone)


def test_an_exchange_is_weighed_as_no_change_is_with_the_numbers_crossed():
    """By the normal density of what is left then, and a prior shared by all pairs."""
    rng = np.random.default_rng(5)
    covariance = np.array([m @ m.T for m in rng.normal(0.0, 0.05, (2, 6, 6))])
    old, new = rng.normal(0.0, 0.3, (2, 6))
    means = (old, covariance[0]), (new, covariance[1])
    found = dict(kinds._exchanges(*means, kinds._pairs(*means)))
    order = [2, 1, 0, 5, 4, 3]
    noise = covariance[0] + covariance[1][np.ix_(order, order)]
    density = stats.multivariate_normal(np.zeros(6), noise).logpdf(new[order] - old) + 3.0 * math.log(2.0 * math.pi)
    assert found[0, 2] == pytest.approx(density + math.log(kinds.PRIORS["exchanged"] / 3.0))
    assert set(found) == {(0, 1), (0, 2), (1, 2)}


def test_exchanged_sensors_are_named_together_and_neither_probe_is_accused():
    minutes = np.arange(0.0, 200.0)
    rng = np.random.default_rng(6)

    def run(name, front="front degC", rear="rear degC"):
        # A part that is warm at once has the law begin higher.
        quick = 3.0 * -np.expm1(-minutes / 0.8)
        curves = {front: quick + 9.0 * -np.expm1(-minutes / 25.0), "oil degC": 5.0 * -np.expm1(-minutes / 60.0)}
        curves[rear] = 8.0 * -np.expm1(-minutes / 40.0)
        return tf.read({"time_min": minutes, **{n: 20.0 + c + rng.normal(0.0, 0.02, 200) for n, c in curves.items()}}, name=name)

    for old in (1, 3):
        told = tf.changed([run(f"old {k}") for k in range(old)], run("new", "rear degC", "front degC"))
        assert (told.verdict, told[0].status, told[0].channel) == ("exchanged", "ok", "front degC and rear degC")
        assert "their plugs, places or names were exchanged" in told[0].message
        assert "began" not in told[0].message
    repeated = tf.changed([run("old 1")], run("new 1"))
    assert repeated.verdict == "nothing"
    assert "a contact by what it moves a sensor's rise" in repeated[0].message


def of_two_parts(tau, minutes=300.0, bend=0.0, late=0.0, seed=0, noise=0.0):
    """A fit of the law of one rise to two sensors of which the first has a quick part, of so much of its 10 K."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, minutes, 1.0)
    rows = [
        10.0 * (1.0 - (1.0 - b) * np.exp(-(time + late) / tau) - b * np.exp(-(time + late) / (tau / 10.0))) for b in (bend, 0.0)
    ]
    seen = 20.0 + np.array(rows) + noise * rng.standard_normal((2, len(time)))
    return fit_model(observe(tf.read({"time_min": time, "a": seen[0], "b": seen[1]}, name=f"{tau} {late} {seed}")).seen)


def values_of(fit):
    return changed.RunNumbers.of(fit, 1.0).values


def test_numbers_move_by_the_length_of_a_run_where_the_law_is_not_all():
    """A capacity that is 1.1 times as large is a run that is by 1.1 shorter, slowed: to a third of what the law gets wrong of it."""
    fit, slower = of_two_parts(60.0, bend=0.2), of_two_parts(66.0, bend=0.2)
    by = numbers.by_length(fit)
    assert by[[1, 3]] == pytest.approx([0.0, 0.0], abs=1e-5)
    told = values_of(slower) - values_of(fit)
    wrong = told - np.array([-1.0, -1.0, 0.0, 0.0]) * math.log(1.1)
    assert abs(wrong[0]) > 0.005
    assert wrong == pytest.approx(-by * math.log(1.1), abs=0.3 * abs(wrong[0]))
    steep = numbers.by_length(of_two_parts(900.0, minutes=40.0, bend=0.6, noise=0.05))
    assert np.abs(steep).max() <= numbers.MOST_BY_LENGTH


def test_a_run_that_is_logged_late_is_known_by_where_it_begins():
    """12 min of 60: as warm as the old run was then, and its numbers are those of the old run's rest."""
    old, late = of_two_parts(60.0, bend=0.3), of_two_parts(60.0, bend=0.3, late=12.0)
    warmer = late.run.reading[:, 0] - old.run.reading[:, 0]
    found = numbers.logged_late([old], warmer, 0.7)
    assert found.minutes == pytest.approx(12.0, abs=0.1)
    assert found.warmer == pytest.approx(warmer, abs=0.01)
    assert found.moved == pytest.approx(values_of(late) - values_of(old), abs=0.03)
    assert numbers.logged_late([old], np.array([0.2, 0.2]), 0.7) is None  # another room
    assert numbers.logged_late([old], warmer + np.array([0.0, 3.0]), 0.7) is None  # a probe that is off


def test_what_the_law_leaves_in_every_run_makes_no_difference_uncertain():
    """Of runs that bend alike only the noise is left, of one that bends otherwise what it has alone; of two runs nobody knows."""
    alike = [of_two_parts(60.0, bend=0.2, noise=0.01, seed=k) for k in range(3)]
    other = of_two_parts(60.0, bend=0.4, noise=0.01, seed=9)
    wide = judge.widening(alike[0])
    assert wide > 2.0
    few = numbers.beside_others(alike)
    assert len(few) == 3
    assert max(each[0] for each in few) < 0.2 * wide
    assert np.mean([each[1] for each in few]) == pytest.approx(1.0, abs=0.12)  # the mean of the others has a share of the noise
    assert numbers.beside_others([*alike, other])[3][0] > 3.0 * few[0][0]
    assert [each.tolist() for each in numbers.beside_others(alike[:2])] == [[judge.widening(f)] * 2 for f in alike[:2]]


def test_two_that_were_exchanged_began_in_each_others_place():
    """Their own beginnings say nothing of the room then, and a third that began elsewhere speaks against it as against all else."""
    new = np.array([[20.0, 23.0, 21.0], [20.0, 22.5, 21.0]])
    old = np.array([[23.0, 20.0, 21.0], [22.5, 20.0, 21.0]])
    begun_ = changed.Begun(new[0] - old[0], np.array([8.0, 5.0, 6.0]), seen=new[1] - old[1], new=new)
    crossed = begun_.exchanged(0, 1)
    assert crossed.warmer == pytest.approx([0.0, 0.0, 0.0])
    assert crossed.seen == pytest.approx([0.0, 0.0, 0.0])
    assert crossed.rise.tolist() == [5.0, 8.0, 6.0]
    assert crossed.ways()[0][0] > begun_.ways()[0][0] + 50.0
    assert changed.Begun(np.zeros(2), np.ones(2)).exchanged(0, 1).warmer.tolist() == [0.0, 0.0]


def test_a_heat_capacity_of_all_parts_is_a_shorter_run_and_one_of_some_is_not():
    """Numbers that moved as those of a shorter run name it, where the same numbers without are no one thing."""
    by = np.array([0.6, -0.4, 0.0, 1.0, -0.3, 0.2, 0.0, -0.6])
    size = math.log(1.3)
    old = [changed.RunNumbers(np.zeros(8), 1e-6 * np.eye(8)) for _ in range(4)]
    new = [changed.RunNumbers(np.repeat([-size, 0.0], 4) - size * by, 1e-6 * np.eye(8))]
    told = changed.changes(old, new, by_length=by).changes[0]
    assert (told.kind, told.size) == ("heat capacity", pytest.approx(size, abs=0.01))
    assert told.probability > 0.9
    assert changed.changes(old, new).changes[0].kind == "contact"
    plain = [changed.RunNumbers(np.repeat([-size, 0.0], 4), 1e-6 * np.eye(8))]
    assert changed.changes(old, plain, by_length=by).changes[0].kind == "heat capacity"


def test_a_number_that_a_change_hardly_moves_says_nothing_of_its_size():
    """Rates a fifth slower, and rises that hang on the length by a twentieth: what these do beside is no size of six times as much."""
    stretched = np.array([-1.0, -1.0, -1.0, -1.0, 0.05, 0.05, -0.05, 0.05])[:, None]
    left = -0.2 * np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]) + np.array([0.0, 0.0, 0.0, 0.0, -0.03, -0.03, 0.03, -0.03])
    assert kinds._of_every_point("heat capacity", stretched, (None, 0.2, 0.01), left, 1e-6 * np.eye(8))


def test_a_probe_that_is_off_is_no_exchange_and_two_in_each_others_place_are():
    """One of four begins and settles 4 K higher; two others, as quick as each other's opposite, are where they were."""
    rates, rises = np.array([0.02, 0.021, 0.04, 0.01]), np.array([10.0, 10.5, 6.0, 4.0])
    old = [numbers_of(rates, rises, 0.02) for _ in range(3)]
    crossed = [numbers_of(rates[[1, 0, 2, 3]], rises[[1, 0, 2, 3]], 0.02)]
    off = np.array([0.0, 0.0, 4.0, 0.0])
    probe = changed.Begun(off, rises, seen=off, new=np.array([20.0 + off, 20.0 + off]))
    assert changed.changes(old, crossed, probe).changes[0].kind != "exchanged"
    places = np.array([30.0, 20.0, 20.0, 20.0])
    far = [numbers_of([0.04, 0.021, 0.02, 0.01], [6.0, 10.5, 10.0, 4.0], 0.02)]
    new = places[[2, 1, 0, 3]]
    swapped = changed.Begun(new - places, rises, seen=new - places, new=np.array([new, new]))
    told = changed.changes(old, far, swapped).changes[0]
    assert (told.kind, told.sensor, told.other) == ("exchanged", 0, 2)
    assert told.probability > 0.99
