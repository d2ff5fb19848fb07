"""changed: what is different in a machine since other runs of it."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal, norm

import thermofast as tf
from thermofast.analysis.changed import Difference
from thermofast.models.joint import LEVEL, RATE, START, fit_model
from thermofast.models.uncertainty.changes import Begun, Change, RunNumbers, changes, other_room, with_room
from thermofast.models.uncertainty.changes.kinds import _mixed, _size
from thermofast.models.uncertainty.changes.repeats import COMMON, OWN_SCALES, SCALES, _mean, repeats, scatter
from thermofast.observing.observe import observe
from thermofast.output.pictures.change import draw_change

RISES = np.array([10.0, 7.0, 5.0])


def run(rng, name, heat=1.0, capacity=1.0, loss=1.0, fault=1.0, room=20.0, length=300.0, warm=0.0, logged=False):
    """Three points of a machine of known heat, capacity and loss: rate loss over capacity, rise heat over loss.

    fault: a factor on the rise of the first, or one for each. It begins `warm` [K] warmer than its room.
    """
    time = np.arange(0.0, length + 1.0)
    rise = RISES * heat / loss * np.broadcast_to(fault, 3) ** (np.array([1.0, 0.0, 0.0]) if np.ndim(fault) == 0 else 1.0)
    rate = np.array([0.02, 0.024, 0.03]) * loss / capacity
    curves = (
        room + rise[:, None] - (rise - warm)[:, None] * np.exp(-rate[:, None] * time) + 0.02 * rng.standard_normal((3, len(time)))
    )
    columns = {"time_min": time, **dict(zip("abc", curves, strict=True))}
    columns |= {"ambient": room + 0.05 * rng.standard_normal(len(time))} if logged else {}
    return tf.read(columns, name=name)


@pytest.mark.parametrize(
    ("what", "verdict", "size"),
    [
        ({}, "nothing", None),
        ({"heat": 1.4}, "heat", 1.4),
        ({"capacity": 1.7}, "heat capacity", 1.7),
        ({"loss": 0.65}, "loss", 0.65),
        ({"fault": 0.7}, "sensor", 0.7),
        ({"room": 25.0}, "room", None),
    ],
)
def test_what_changed_is_said_with_its_size(what, verdict, size):
    rng = np.random.default_rng(1)
    told = tf.changed([run(rng, f"old {k}") for k in range(3)], run(rng, "new", **what))
    assert told.verdict == verdict
    first = told[0]
    assert first.change == verdict
    assert first.status == "ok"
    assert sum(r.probability for r in told) == pytest.approx(1.0, abs=0.02)
    if size is not None:
        assert first.size_lo < size < first.size_hi
        assert first.size == pytest.approx(size, rel=0.12)
    assert first.channel == ("a" if verdict == "sensor" else "")
    assert ("began at 25 degC" in first.message) == ("room" in what)
    if "room" in what:
        assert first.difference_lo_k < 5.0 < first.difference_hi_k
        assert "in a room 5 K warmer" in first.message
    assert ("would most likely have shown: " in first.message) == (verdict == "nothing")


def test_another_room_is_told_from_a_warm_start_and_from_another_heat():
    rng = np.random.default_rng(11)
    old = [run(rng, f"old {k}", room=20.0 + 0.3 * k) for k in range(3)]
    for what, said in (({"warm": 3.0}, "nothing"), ({"warm": 3.0, "heat": 1.5}, "heat"), ({"room": 24.0, "heat": 0.7}, "heat")):
        told = tf.changed(old, run(rng, "new", **what))
        assert (told[0].change, told.verdict.split(" or ")[0]) == (said, said)
        if said == "heat":
            assert told[0].size_lo < what["heat"] < told[0].size_hi
    small = tf.changed(old, run(rng, "new", room=21.3))
    assert small.verdict == "nothing"
    # A room that is logged is known, whatever else changed, and whether or not the machine began as warm as it.
    logged = [run(rng, f"logged {k}", logged=True) for k in range(2)]
    told = tf.changed(logged, run(rng, "new", room=26.0, warm=0.5, logged=True))
    assert told.verdict == "room"
    assert told[0].difference_k == pytest.approx(6.0, abs=0.2)
    assert tf.changed(logged, run(rng, "new", room=26.0, heat=1.4, logged=True)).verdict == "heat"


def test_contacts_are_told_with_the_point_that_moved_most():
    rng = np.random.default_rng(12)
    old = [run(rng, f"old {k}") for k in range(3)]
    told = tf.changed(old, run(rng, "new", fault=(1.25, 0.85, 1.1)))
    assert told.verdict == "contact"
    assert told[0].channel == "a"
    assert told[0].size_lo < 1.25 < told[0].size_hi
    assert "another machine's" not in told[0].message
    other = tf.changed(old, run(rng, "new", fault=(2.2, 0.5, 1.4), capacity=1.7))
    assert other.verdict == "contact"
    assert "another machine's" in other[0].message


def test_repeats_are_nothing():
    rng, said = np.random.default_rng(2), []
    for k in range(30):
        wander = np.exp(0.04 * rng.standard_normal(2))
        said.append(tf.changed(run(rng, f"a{k}"), run(rng, f"b{k}", heat=wander[0], loss=wander[1])).verdict)
    assert said.count("nothing") >= 28


def test_a_change_that_may_be_is_put_in_words_beside_nothing():
    """A fifth more heat against one old run: nothing is likeliest, and the heat's own interval excludes none."""
    told = tf.changed(run(np.random.default_rng(5), "old"), run(np.random.default_rng(6), "new", heat=1.2))
    assert (told[0].change, told[0].status) == ("nothing", "not_determined")
    second = told[1]
    percent = 100.0 * (second.size - 1.0)
    assert f"it is not sure: with {100.0 * second.probability:.0f} % every point rises more by {percent:.2g} %" in told[0].message
    alike = tf.changed(run(np.random.default_rng(7), "old"), run(np.random.default_rng(8), "new"))
    assert (alike[0].status, "it is not sure" in alike[0].message) == ("ok", False)


def test_a_record_that_is_hardly_bent_does_not_part_heat_and_capacity():
    rng = np.random.default_rng(3)
    told = tf.changed(run(rng, "old", length=24.0), run(rng, "new", length=24.0, capacity=2.0))
    assert told.verdict == "heat or heat capacity"
    assert told[0].status == "not_determined"


def test_scatter_is_learnt_from_runs_that_are_alike():
    """Ten runs, drawn so many times as far from each other as usual, make that multiple of the scatter the likeliest."""
    rng = np.random.default_rng(4)
    for size in (0.25, 0.5, 2.0):
        root = np.linalg.cholesky(scatter(3, size))
        old = [RunNumbers(root @ rng.standard_normal(6), 1e-9 * np.eye(6)) for _ in range(10)]
        found = repeats(old, old[:1])
        deviations = {float(np.sqrt(each.new[1][0, 0])) / COMMON[0]: each.log for each in found}
        assert max(deviations, key=deviations.__getitem__) == pytest.approx(size, rel=0.1)
    one = repeats(old[:1], old[1:2])
    assert len(one) == len(SCALES) * len(OWN_SCALES)  # of one run a side nothing is known
    assert sum(np.exp([each.log for each in one])) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="no runs"):
        changes([], [])


def test_the_command_its_picture_and_its_refusals(tool, tmp_path):
    rng, paths = np.random.default_rng(5), {}
    for name, what in (("before", {}), ("after", {"capacity": 1.8})):
        one = run(rng, name, **what)
        paths[name] = tmp_path / f"{name}.csv"
        columns = {"time_min": one.time_s / 60.0, **one.channels}
        np.savetxt(paths[name], np.array(list(columns.values())).T, delimiter=",", header=",".join(columns), comments="")
    picture = tmp_path / "changed.png"
    done = tool("changed", paths["before"], "--new", paths["after"], "--format", "json", "-q", "--save-plot", picture)
    assert done.code == 0
    rows = json.loads(done.out)["records"]
    assert rows[0]["verdict"] == "heat capacity"
    assert [r["probability"] for r in rows] == sorted((r["probability"] for r in rows), reverse=True)
    assert picture.read_bytes()[:4] == b"\x89PNG"
    more = tmp_path / "more.csv"
    more.write_bytes(paths["after"].read_bytes().replace(b"0.0000", b"0.0001", 1))
    both = tool("changed", paths["before"], "--new", paths["after"], more, "--format", "json", "-q")
    assert json.loads(both.out)["records"][0]["run"] == f"{paths['after']}, {more}"
    for given, words in (
        (("changed", paths["before"]), "no run is given as --new"),
        (("changed", paths["before"], "--new", paths["before"]), "is old and new"),
        (("changed", "--new", paths["after"]), "no RUN given"),
        (("changed", "sample_runs/spindle.csv", "--new", paths["after"]), "no sensor in common"),
    ):
        refused = tool(*given, "-q")
        assert refused.code == 2
        assert words in refused.err
    still = tmp_path / "still.csv"
    still.write_text("time_min,a\n" + "".join(f"{t},20.0\n" for t in range(60)))
    assert tool("changed", paths["before"], "--new", still, "-q").code == 2


def test_a_pot_with_more_water_has_another_heat_capacity(shared):
    pots = shared / "cooking_pot"
    one, again, two = (tf.read(pots / f"0cm_{n}.csv") for n in ("2L_a", "2L_b", "3L_b"))
    assert tf.changed(one, again)[0].change == "nothing"
    told = tf.changed([one, again], two)
    assert told.verdict == "heat capacity"
    # Three litres for two are 12.6 kJ/K for 8.4, and pot and plate, of 1 to 2 kJ/K, keep their own.
    assert told[0].size_lo < 1.44
    assert told[0].size_hi > 1.40
    back = tf.changed([tf.read(pots / f"0cm_3L_{n}.csv") for n in "ab"], one)
    assert back[0].size_lo < 1.0 / 1.44 < 1.0 / 1.40 < back[0].size_hi


@pytest.mark.parametrize(
    ("what", "verdict"), [({}, "nothing"), ({"heat": 1.5}, "heat"), ({"capacity": 1.8, "room": 24.0}, "heat capacity")]
)
def test_a_model_takes_the_place_of_old_runs(tmp_path, what, verdict):
    rng = np.random.default_rng(8)
    model = tf.improve(run(rng, "old")).model
    model.save(tmp_path / "old.toml")
    told = tf.changed(new=run(rng, "new", length=240.0, **what), model=tmp_path / "old.toml")
    assert told.verdict == verdict
    with pytest.raises(tf.UsageError, match="takes the place of OLD"):
        tf.changed(run(rng, "a"), run(rng, "b"), model=tmp_path / "old.toml")
    with pytest.raises(tf.UsageError, match="none of its sensors"):
        tf.changed(new="sample_runs/spindle.csv", model=tmp_path / "old.toml")


@pytest.mark.parametrize(("room", "kelvin"), [(26.0, 6.0), (15.0, -5.0)])
def test_a_model_knows_the_room_that_nobody_logged(room, kelvin):
    rng = np.random.default_rng(8)
    told = tf.changed(new=run(rng, "new", length=240.0, room=room), model=tf.improve(run(rng, "old")).model)
    assert told.verdict == "room"
    assert told[0].difference_k == pytest.approx(kelvin, abs=0.5)
    assert "the old ones at 20" in told[0].message


def test_a_model_of_three_runs_counts_as_three(tmp_path):
    rng = np.random.default_rng(12)
    old = [run(rng, f"old {k}") for k in range(3)]
    new = run(rng, "new", capacity=1.15)
    by_one, by_three = (tf.changed(new=new, model=tf.improve(some, together=len(some) > 1).model) for some in (old[:1], old))
    by_runs = tf.changed(old, new)

    def of(told, kind):
        return next(row for row in told if row.change == kind)

    sure = [math.log(of(told, "heat capacity").size_hi / of(told, "heat capacity").size_lo) for told in (by_one, by_three, by_runs)]
    # The runs themselves tell how little they scatter, too.
    assert sure[2] < sure[1] < 0.9 * sure[0]
    assert of(by_three, "heat capacity").probability > of(by_one, "heat capacity").probability


def test_a_model_with_an_effect_foretells_the_run_that_it_was_learnt_from(tool, tmp_path):
    learnt = tmp_path / "hidden.toml"
    assert tool("improve", "sample_runs/hidden.csv", "--auto", "-q", "-o", learnt).code == 0
    same = tool("changed", "--model", learnt, "--new", "sample_runs/hidden_second_run.csv", "--format", "json", "-q")
    assert json.loads(same.out)["records"][0]["verdict"] == "nothing"


def test_logarithms_of_rate_and_rise_have_the_errors_of_rate_level_and_start():
    """The delta method by finite differences; what bends all fits alike comes on top along rate up, rise down."""
    fit = fit_model(observe(run(np.random.default_rng(3), "one", length=120.0)).seen)
    numbers = RunNumbers.of(fit, 2.0)
    at = [fit.model.column(key) for key in (RATE, LEVEL, START)]
    own = np.zeros((6, 6))
    for i in range(3):
        value = np.array([fit.values[key][i] for key in (RATE, LEVEL, START)])

        def logs(v):
            return np.array([v[0], np.log(abs(v[1] - v[2]))])

        # The rate is fitted as its logarithm.
        slopes = np.array([(logs(value + step) - logs(value - step)) / 2e-6 for step in 1e-6 * np.eye(3)]).T
        own[np.ix_([i, 3 + i], [i, 3 + i])] = 4.0 * slopes @ fit.joint_covariance(i)[np.ix_(at, at)] @ slopes.T
    bent = np.sqrt(np.diag(own)) * np.repeat([1.0, -1.0], 3)
    assert numbers.values == pytest.approx(np.log([*fit.values[RATE], *(fit.values[LEVEL] - fit.values[START])]))
    assert numbers.covariance == pytest.approx(own + np.outer(bent, bent), rel=1e-5)


def test_a_sensor_that_begins_elsewhere_than_before_is_told():
    rng = np.random.default_rng(1)
    new = run(rng, "new")
    high = tf.read({"time_min": new.time_s / 60.0} | {c: v + 2.0 * (c == "b") for c, v in new.channels.items()}, name="high")
    assert tf.changed([run(rng, "one"), run(rng, "two")], high).verdict == "sensor"
    told = tf.changed([run(rng, "one")], high)  # how unevenly it begins one run does not show
    assert told.verdict == "nothing"
    assert "b began 2 K higher against the others than before: warmer than they were, or its probe reads high" in told[0].message
    assert "began" not in tf.changed([run(rng, "one"), run(rng, "two")], new)[0].message


def warm(start, load=1.0, logged=False, seed=0):
    """A run that begins at start (3,) [degC] in a room of 20 degC."""
    rng, time = np.random.default_rng(seed), np.arange(301.0)
    limit = 20.0 + load * np.array([12.0, 18.0, 25.0])
    curve = limit + (np.asarray(start) - limit) * np.exp(-time[:, None] / np.array([60.0, 75.0, 90.0]))
    curve += 0.03 * rng.standard_normal(curve.shape)
    room = {"ambient": 20.0 + 0.02 * rng.standard_normal(len(time))} if logged else {}
    return tf.read({"time_min": time} | {f"T{i}": curve[:, i] for i in range(3)} | room, name=f"run {seed}")


def test_a_warm_start_is_no_change_of_the_heat():
    for start in ([23.0, 24.5, 26.2], [24.0, 24.0, 24.0], [26.0, 30.0, 35.0]):
        told = tf.changed(warm([20.0] * 3, seed=1), warm(start, seed=2))
        assert (told.verdict, told[0].status) == ("nothing", "ok")
        logged = tf.changed(warm([20.0] * 3, logged=True, seed=1), warm(start, logged=True, seed=2))
        assert (logged.verdict, logged[0].status) == ("nothing", "ok")
        # It began warmer by what hides the change: less heat would look so from a start as before.
        less = tf.changed(warm([20.0] * 3, logged=True, seed=1), warm(start, 0.6, logged=True, seed=2))
        assert less.verdict == "heat"
        assert less[0].size_lo < 0.6 < less[0].size_hi
    with pytest.raises(tf.UsageError, match="opposite ways"):
        tf.changed(warm([20.0] * 3, seed=1), warm([32.0, 38.0, 45.0], 0.0, seed=2))


def chain(name, seed, cut=0.0):
    """Four bodies in a row, heated at one end; the logger begins `cut` minutes late, in another room."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 361.0, 2.0)
    flow = np.diag([-0.045, -0.06, -0.055, -0.035]) + 0.025 * (np.eye(4, k=1) + np.eye(4, k=-1))
    limit = np.linalg.solve(-flow, [1.0, 0.1, 0.0, 0.0])
    rise = np.array([limit - expm(flow * t) @ limit for t in time]) + 20.0 + rng.normal(0.0, 0.3)
    noisy = (rise * (1.0 + 0.004 * rng.standard_normal()) + rng.normal(0.0, 0.03, rise.shape))[time >= cut]
    return tf.read({"time_min": time[time >= cut] - cut} | {f"T{i}": noisy[:, i] for i in range(4)}, name=name)


def test_a_logger_that_began_late_is_no_change_of_one_sensor():
    """What each had warmed by then, each in its way, was called a probe that reads high, with 99 %."""
    old = [chain(f"old {k}", k) for k in range(3)]
    whole, late = tf.changed(old, chain("new", 7)), tf.changed(old, chain("late", 7, 30.0))
    assert (whole.verdict, whole[0].status) == ("nothing", "ok")
    assert late[0].status == "not_determined"
    assert "up on their rise: as if logged late, or begun warm; compare runs that begin alike" in late[0].message


def test_a_probe_is_said_to_show_where_it_would():
    """Told from a place that was warm before, which needs more than where it begins."""
    told = tf.changed([chain(f"old {k}", k) for k in range(3)], chain("new", 7))[0].message
    size = float(re.search(r"one probe by ([\d.]+) K", told)[1])
    old = [chain(f"old {k}", k) for k in range(3)]
    assert size > 1.0
    high = chain("new", 7)
    read = {c: v + 1.2 * size * (c == "T2") for c, v in high.channels.items()}
    assert tf.changed(old, tf.read({"time_min": high.time_s / 60.0} | read, name="high")).verdict == "sensor"


def test_a_probe_that_is_off_in_a_warmer_room_is_no_late_start():
    """The room moves all alike; how far the one is off says nothing of where the others begin."""
    old = [chain(f"old {k}", k) for k in range(3)]
    new = chain("new", 7)
    read = {c: v + 2.5 + 6.0 * (c == "T2") for c, v in new.channels.items()}
    told = tf.changed(old, tf.read({"time_min": new.time_s / 60.0} | read, name="high"))
    assert (told.verdict, told[0].channel, told[0].status) == ("sensor", "T2", "ok")


def test_a_run_that_is_too_short_in_every_sensor_must_be_longer():
    short = tf.read({"time_min": np.arange(4.0), "a": [20.0, 21.0, 21.5, 22.0]}, name="short")
    with pytest.raises(tf.UsageError, match="give a longer run"):
        tf.changed(chain("old", 1), short)


@pytest.mark.parametrize(("what", "verdict", "size"), [("probe", "sensor", 0.75), ("loss", "loss", 1.3)])
def test_a_model_of_sensors_that_warm_each_other_stands_for_the_old_machine(what, verdict, size):
    """The old side is what the model's bodies do to each other; the new run's neighbours are a part of what changed."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 401.0, 2.0)

    def record(name, change=""):
        loss = np.array([0.02, 0.03, 0.025]) * (1.3 if change == "loss" else 1.0)
        link = np.array([[0.0, 0.05, 0.0], [0.05, 0.0, 0.04], [0.0, 0.04, 0.0]])
        flow = link - np.diag(loss + link.sum(axis=1))
        limit = np.linalg.solve(-flow, [0.6, 0.1, 0.3])
        rise = np.array([limit - expm(flow * t) @ limit for t in time])
        rise[:, 1] *= 0.75 if change == "probe" else 1.0
        noisy = 20.0 + rise + rng.normal(0.0, 0.02, rise.shape)
        return tf.read({"time_min": time} | {f"T{i}": noisy[:, i] for i in range(3)}, name=name)

    model = tf.improve([record("a"), record("b")], add="neighbour_heat", together=True).model
    found = tf.changed(new=record("new", what), model=model)
    kind = next(r for r in found.records if r.change == verdict)
    assert kind.size == pytest.approx(size, abs=0.05)  # 0.64 and 1.07 with the new run's neighbours
    assert kind.size_lo <= size <= kind.size_hi
    assert tf.changed(new=record("again"), model=model).verdict == "nothing"


def test_a_probe_that_is_off_throughout_is_a_sensor_and_a_warm_place_is_none():
    """By 3 K from beginning to end; 1 K is not told from how unevenly machines begin, and no longer called nothing."""

    def verdict(off, warm=0.0, old=2):
        rng = np.random.default_rng(8)
        runs = [run(rng, f"old {k}") for k in range(old)]
        new = run(rng, "new")
        curves = {c: v.copy() for c, v in new.channels.items()}
        curves["b"] += off + warm * np.exp(-0.4 * new.time_s / 60.0 * 0.06)
        return tf.changed(runs, tf.read({"time_min": new.time_s / 60.0, **curves}, name="new"))

    told = verdict(3.0)
    assert told.verdict == "sensor"
    assert (told[0].change, told[0].channel, told[0].status) == ("sensor", "b", "ok")
    assert told[0].difference_lo_k < 3.0 < told[0].difference_hi_k
    assert told[0].size is None
    assert "b tells 3 K higher than it did beside the others, from beginning to end: its probe" in told[0].message
    assert sum(r.probability for r in told) == pytest.approx(1.0, abs=0.02)
    assert verdict(1.0).verdict == "nothing or sensor"
    assert verdict(0.0).verdict == "nothing"
    assert "one probe by" in verdict(0.0)[0].message
    assert all(r.difference_k is None for r in verdict(0.0, warm=3.0) if r.change == "sensor" and r.probability > 0.5)
    assert not any(r.difference_k for r in verdict(3.0, old=1))  # after one run nobody knows how uneven they begin


@pytest.mark.parametrize("off", [2.5, -4.0])
@pytest.mark.parametrize("learnt", [False, True])
def test_a_probe_that_is_off_by_more_than_sensors_begin_apart_is_told_with_its_size(off, learnt):
    """The middle one of three, which passes the others; with the room logged, by old runs and by a model of them alike."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 300.0)

    def record(name, probe=0.0):
        room = 20.0 + rng.normal(0.0, 0.5)
        heats = {"a": (9.0, 1.0, 6.0), "b": (7.0, 0.0, 70.0), "c": (5.0, -1.0, 80.0)}  # the first moves by 1.4 K in a minute
        rises = {n: room + at + rise * -np.expm1(-time / tau) for n, (rise, at, tau) in heats.items()}
        rises["b"] = rises["b"] + probe
        noisy = {f"{n} [degC]": line + rng.normal(0.0, 0.02, len(time)) for n, line in rises.items()}
        return tf.read({"time_min": time, "ambient": np.full(len(time), room), **noisy}, name=name)

    old, new = [record(f"old {k}") for k in range(3)], [record("new", off), record("newer", off)]
    found = tf.changed(new=new, model=tf.improve(old, together=True).model) if learnt else tf.changed(old, new)
    assert found.verdict == "sensor"
    assert not re.search(r"[ac] \[degC\] began", found[0].message)
    assert found[0].channel == "b [degC]"
    assert found[0].difference_lo_k < off < found[0].difference_hi_k
    assert found[0].difference_k == pytest.approx(off, abs=0.25)


def test_another_room_is_as_likely_as_the_difference_is_beyond_what_rooms_do():
    """Half at 3 K, or at three deviations of the old rooms where more than two are known; its error is that of both means."""
    old = np.array([20.0, 20.0])
    assert other_room(old, np.array([23.0]), 0.5) == pytest.approx(0.5)
    assert other_room(old, np.array([17.0]), 0.5) == pytest.approx(0.5)
    assert other_room(old, np.array([24.0]), 0.5) == pytest.approx(norm.cdf(1.0 / (0.5 * math.sqrt(0.5 + 1.0))))
    assert other_room(np.array([19.0, 21.0]), np.array([23.0]), 0.5) == pytest.approx(0.5)
    assert other_room(np.array([18.0, 20.0, 22.0]), np.array([26.0]), 0.5) == pytest.approx(0.5)


def test_the_size_of_a_change_is_that_of_ridge_regression():
    """One number along a direction, with a prior of its own deviation; of the contacts that of each sensor's own way."""
    noise, difference = np.diag([0.01, 0.02, 0.03, 0.04]), np.array([0.0, 0.0, 0.3, 0.2])
    heat = np.array([0.0, 0.0, 1.0, 1.0])[:, None]
    precision = 1.0 / 0.03 + 1.0 / 0.04 + 1.0 / 0.4**2
    sensor, size, deviation = _size("heat", heat, 0.4, difference, noise)
    assert sensor is None
    assert size == pytest.approx((0.3 / 0.03 + 0.2 / 0.04) / precision)
    assert deviation == pytest.approx(precision**-0.5)
    sensor, size, deviation = _size("contact", np.eye(4), 0.2, difference, noise)
    assert sensor == 0  # 0.3^2 / 0.03 is more than 0.2^2 / 0.04
    assert size == pytest.approx(0.3 * 0.04 / (0.04 + 0.03))
    assert deviation == pytest.approx(math.sqrt(0.04 * 0.03 / (0.04 + 0.03)))
    assert _size("nothing", heat, 0.4, difference, noise) is None


def test_what_begins_warmer_has_that_much_less_to_rise():
    """Shift of the rises by log(1 + warmer / rise), none of the rates; another room shifts nothing."""
    room, warm = Begun(np.array([2.0, 4.0]), np.array([20.0, 10.0]), warm=0.3, room=0.5).ways()
    np.testing.assert_allclose(warm[1], [0.0, 0.0, -math.log(1.1), -math.log(1.4)])
    np.testing.assert_allclose(warm[2], [0.0, 0.0, 0.5 / 22.0, 0.5 / 14.0])
    np.testing.assert_array_equal(room[1], 0.0)
    np.testing.assert_allclose(room[2], [0.0, 0.0, 0.3 / 22.0, 0.3 / 14.0])
    # Of two sensors 2 K apart, normal about their mean with 0.3 K or, warm by 3 K, with half of that beside it.
    spread = math.hypot(0.3, 1.5)
    assert room[0] == pytest.approx(math.log(0.7) - math.log(0.3) - 1.0 / 0.3**2)
    assert warm[0] == pytest.approx(math.log(0.3) - math.log(spread) - 1.0 / spread**2)


def test_a_room_takes_its_share_of_what_nothing_had():
    """And the list stays in order."""
    found = with_room([Change("nothing", None, 0.6), Change("heat", None, 0.4, 0.1, 0.02)], 0.75, 4.0, 0.5)
    assert [(c.kind, round(c.probability, 12)) for c in found] == [("room", 0.45), ("heat", 0.4), ("nothing", 0.15)]
    assert (found[0].size, found[0].deviation) == (4.0, 0.5)


def test_scatter_before_any_repeat_is_the_usual_one():
    """Variance 0.06^2 of a rate and 0.05^2 of a rise in common, -0.5 correlated, 0.015^2 of its own, and what a stretch of time does."""
    usual = scatter(2)
    common, across = [0.06**2, 0.05**2], -0.5 * 0.06 * 0.05
    own = 0.015**2
    np.testing.assert_allclose(usual[0], [common[0] + own, common[0], across, across])
    np.testing.assert_allclose(usual[2], [across, across, common[1] + own, common[1]])
    np.testing.assert_allclose(scatter(2, 0.5, 2.0), 0.25 * (usual - own * np.eye(4)) + own * np.eye(4))
    by = np.array([0.3, -0.1, 0.0, 1.0])
    np.testing.assert_allclose(scatter(2, 2.0, 1.0, by), 4.0 * usual + (0.12**2) * np.outer(by, by))


def test_how_runs_lie_about_their_mean_is_the_restricted_likelihood():
    """Of two runs that of their difference, but for a constant: two scatters by scipy's normal density."""
    apart = np.array([0.05, -0.02, 0.01, 0.03])
    runs = [RunNumbers(sign * 0.5 * apart, 1e-4 * np.eye(4)) for sign in (1.0, -1.0)]
    of = [multivariate_normal.logpdf(apart, np.zeros(4), 2.0 * (scatter(2, scale) + 1e-4 * np.eye(4))) for scale in (0.5, 1.0)]
    for other in (runs[:1], runs):
        found = [_mean(other, scatter(2, scale) + 0.0)[1] for scale in (0.5, 1.0)]
        assert found[0] - found[1] == pytest.approx(of[0] - of[1] if len(other) > 1 else 0.0)
    (mean, covariance), _ = _mean([*runs[:1], replace(runs[1], runs=3)], scatter(2))
    assert mean == pytest.approx(-0.25 * apart)
    np.testing.assert_allclose(covariance, (scatter(2) + 1e-4 * np.eye(4)) / 4.0)


def test_a_copy_of_a_run_is_no_further_run():
    rng = np.random.default_rng(1)
    one, two, new = (run(rng, name) for name in ("one", "two", "new"))
    again = tf.read({"time_min": one.time_s / 60.0, **one.channels}, name="again")
    with pytest.raises(tf.UsageError, match="again is a copy of one"):
        tf.changed([one, two, again], new)
    with pytest.raises(tf.UsageError, match="again is a copy of one"):
        tf.changed([one, two], again)


def loaded(rng, name, load, power=None):
    """A run at a load, which a column tells, or another number in its place."""
    one = run(rng, name, heat=load)
    column = 100.0 * (load if power is None else power) + rng.standard_normal(len(one.time_s))
    return tf.read({"time_min": one.time_s / 60.0, **one.channels, "power_W": column}, name=name)


def test_a_heat_that_a_logged_column_asked_for_is_no_change_of_the_machine(tmp_path):
    rng = np.random.default_rng(5)
    old = [loaded(rng, "one", 1.0), loaded(rng, "two", 1.0)]
    told = tf.changed(old, loaded(rng, "new", 0.7))
    assert (told.verdict, told[0].status) == ("nothing or heat", "not_determined")
    assert "power_W was 30 % less than in the old runs; so much heat was asked for" in told[0].message
    assert all(type(row.difference_k) in (float, type(None)) for row in told)
    told.save(tmp_path / "page.html")  # with two old runs a probe has a size: the page was a traceback
    assert "power_W was 30 % less" in (tmp_path / "page.html").read_text()
    # As much power as before, and less heat: the machine's, or what turns power into heat.
    told = tf.changed(old, loaded(rng, "new", 0.7, power=1.0))
    assert (told.verdict, told[0].status) == ("heat", "ok")
    assert "power_W" not in told[0].message
    # The heat is as it was though twice as much was asked for: said, and left to the reader.
    told = tf.changed(old, loaded(rng, "new", 1.0, power=2.0))
    assert told.verdict == "nothing"
    assert "power_W was 100 % more than in the old runs" in told[0].message


def test_nothing_is_not_sure_where_a_sensor_began_elsewhere():
    rng = np.random.default_rng(3)
    new = run(rng, "new")
    columns = {c: v + 0.8 * (c == "b") for c, v in new.channels.items()}
    told = tf.changed([run(rng, "one")], tf.read({"time_min": new.time_s / 60.0, **columns}, name="high"))
    assert (told.verdict, told[0].status) == ("nothing", "not_determined")
    words = r"b began 0\.(79|8|81) K higher against the others than before: warmer than they were, or its probe reads high"
    assert re.search(words, told[0].message)
    assert "a probe that is off only shows beside two old runs and more" in told[0].message
    assert "a probe" not in tf.changed([run(rng, "one"), run(rng, "two")], run(rng, "three"))[0].message.replace("one probe by", "")
    # All began warmer, each by as much as another: a machine that was warm.
    told = tf.changed([run(rng, "one")], run(rng, "warm", warm=2.0))
    assert (told.verdict, told[0].status) == ("nothing", "ok")


def test_what_is_as_unlikely_in_every_way_has_a_size_all_the_same():
    """Of a heat capacity that no way could explain it was said that 0 % of it would have shown."""
    sizes = [(None, -0.11, 0.08), (None, -0.12, 0.08)]
    at, size, deviation = _mixed(np.zeros(2), sizes)
    assert at is None
    assert (size, deviation) == pytest.approx((-0.115, 0.0802), abs=2e-4)


def test_runs_that_share_no_sensor_are_told_by_name():
    rng = np.random.default_rng(4)
    one, two = run(rng, "one"), run(rng, "two")
    other = tf.read({"time_min": one.time_s / 60.0, **{f"z{c}": v for c, v in one.channels.items()}}, name="odd")
    with pytest.raises(tf.UsageError, match="odd: za, zb, zc"):
        tf.changed([one, other], two)


def four(rng, name, loss=1.0, late=0, halved=None, heat=1.0):
    """Four bodies in a row, the first heated: each minute's step by the exponential of their matrix. Read from `late` [min] on; the
    heat is halved at `halved` [min].
    """
    capacity, links, own = np.array([10.0, 18.0, 25.0, 20.0]), np.array([0.6, 0.5, 0.4]), loss * np.array([0.18, 0.15, 0.135, 0.12])
    matrix = np.diag(links, 1) + np.diag(links, -1)
    matrix = (matrix - np.diag(matrix.sum(axis=1) + own)) / capacity[:, None]
    step, at, rows = expm(matrix), np.zeros(4), []
    for minute in range(421):
        rows.append(at)
        power = heat * 6.0 * (0.5 if halved is not None and minute >= halved else 1.0)
        end = np.linalg.solve(matrix, -np.array([power / capacity[0], 0.0, 0.0, 0.0]))
        at = end + step @ (at - end)
    seen = (20.0 + np.array(rows).T + 0.03 * rng.standard_normal((4, 421)))[:, late:]
    return tf.read({"time_min": np.arange(seen.shape[1], dtype=float), **dict(zip("abcd", seen, strict=True))}, name=name)


def test_a_test_that_is_logged_late_has_no_probe_that_is_off():
    """The heated part has risen when the logger begins, and the others have hardly: where it settles it was known from."""
    rng = np.random.default_rng(21)
    old = [four(rng, f"old {k}") for k in range(3)]
    for late in (5, 10, 20):
        told = tf.changed(old, four(rng, f"late by {late}", late=late))
        assert (told[0].status, told.verdict in ("nothing", "cannot tell")) == ("not_determined", True) or "nothing" in told.verdict
        assert not (told[0].status == "ok" and told.verdict == "sensor")
    # A probe that is off tells more at the end, too.
    probe = four(rng, "probe")
    columns = {"time_min": probe.time_s / 60.0} | {n: v + (3.0 if n == "c" else 0.0) for n, v in probe.channels.items()}
    told = tf.changed(old, tf.read(columns, name="off"))
    assert (told.verdict, told[0].status, told[0].channel) == ("sensor", "ok", "c")
    assert "tells 3 K higher" in told[0].message


@pytest.mark.parametrize("factor", [1.6, 2.0])
def test_the_size_of_a_loss_holds_where_parts_warm_each_other(factor):
    """The heated part, known best, answers by less than the factor and the far ones by more: the interval held none of the two."""
    rng = np.random.default_rng(22)
    told = tf.changed([four(rng, f"old {k}") for k in range(3)], [four(rng, f"new {k}", loss=factor) for k in range(3)])
    assert (told.verdict, told[0].status) == ("loss", "ok")
    assert told[0].size_lo < factor < told[0].size_hi
    assert told[0].size_hi / told[0].size_lo < 1.6


def test_of_a_load_that_changed_within_a_run_nothing_is_said():
    rng = np.random.default_rng(23)
    old = [four(rng, f"old {k}") for k in range(2)]
    told = tf.changed(old, four(rng, "halved", halved=150))
    assert (told.verdict, told[0].status) == ("cannot tell", "not_determined")
    assert re.search(r"[abcd] leaves the law of one rise by \S+ K in the new runs, by \S+ K in the old ones", told[0].message)
    back = tf.changed([four(rng, "halved", halved=150)], four(rng, "new"))
    assert "in the old runs" in back[0].message
    assert tf.changed(old, four(rng, "heat", heat=1.5)).verdict == "heat"


def test_what_one_sensor_would_have_shown_is_told_too():
    rng = np.random.default_rng(24)
    told = tf.changed([run(rng, f"old {k}") for k in range(3)], run(rng, "new"))
    assert re.search(r"(the rise|that) of one sensor( alone)? by [\d.]+( to [\d.]+)? %", told[0].message)


def test_the_picture_is_not_stretched_by_a_sensor_of_which_nothing_is_known():
    """Its bar runs out on both sides; the others lie within a factor of ten."""
    value = np.array([0.1, 0.0, -0.2, 9.0])
    difference = Difference(("a", "b"), value, np.array([0.05, 64.0, 0.1, 3.0]), "cannot tell")
    for axis in draw_change(difference).axes:
        low, high = axis.get_xlim()
        assert 0.5 < low < 1.0
        assert 1.0 < high < 1.3
        assert len(axis.lines[0].get_xdata()) == 1  # one dot; the bar beside it runs from end to end
    assert draw_change(Difference(("a",), np.array([9.0, 9.0]), np.ones(2), "contact")).axes[0].get_xlim()[1] < 1.2


def test_longer_runs_are_said_to_be_cut_and_what_would_show_is_of_the_whole_machine():
    rng = np.random.default_rng(31)
    told = tf.changed([run(rng, "long", length=400.0), run(rng, "longer", length=410.0)], run(rng, "new", length=300.0))
    assert "looked at over their first 300 min, the length of the shortest run" in told[0].message
    assert "would most likely have shown: of the whole machine " in told[0].message
    alike = tf.changed([run(rng, "one", length=300.0), run(rng, "two", length=310.0)], run(rng, "three", length=300.0))
    assert "shortest run" not in alike[0].message


def test_a_test_that_is_logged_late_says_from_when_on_it_is_as_the_old_ones():
    rng = np.random.default_rng(21)
    told = tf.changed([four(rng, f"old {k}") for k in range(3)], four(rng, "late", late=20))
    assert told[0].change == "nothing"
    assert float(re.search(r"as the old ones from about (\S+) min on", told[0].message)[1]) == pytest.approx(20.0, abs=2.0)
