"""A learnt model against a set of runs."""

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from scipy.signal import lfilter

import thermofast as tf
from benchmarks.analysis.validated import LAWS, run_of
from thermofast.analysis.validate import DRAWS, SHARES, Bounds, Judged, judge

HIDDEN = [str(ROOT / "sample_runs" / name) for name in ("hidden.csv", "hidden_second_run.csv")]


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    """A model of three runs of a machine of the law."""
    rng = np.random.default_rng(1)
    learnt = tf.improve([run_of(f"old {i}", rng, LAWS["the machine learnt"]) for i in range(3)], together=True).model
    path = tmp_path_factory.mktemp("machine") / "machine.toml"
    learnt.save(path)
    return path


def test_the_area_is_that_between_the_distributions_by_hand():
    rng = np.random.default_rng(0)
    low, high = rng.normal(20.0, 1.0, DRAWS), rng.normal(30.0, 1.0, DRAWS)
    flat = lambda values: np.repeat(values[:, None], len(SHARES), axis=1)
    bounds = [Bounds(f"r{i}", "T", np.array([20.5, 31.0]), flat(low), flat(high)) for i in range(4)]
    (record,), (area,) = judge([Judged(bounds, [])], 30.0, ())
    # One value against a sample: the mean distance to it.
    assert record.area_low_c == pytest.approx(np.abs(low - 20.5).mean())
    assert record.area_high_c == pytest.approx(np.abs(high - 31.0).mean())
    assert record.area_c == record.outside_c == pytest.approx(record.area_low_c + record.area_high_c)
    assert area.model.shape == (4 * DRAWS, 2)
    wide = [Bounds(b.run, "T", b.measured, b.low + 2.0 * np.array(SHARES), b.high + 2.0 * np.array(SHARES)) for b in bounds]
    (ranged,), _ = judge([Judged(wide, [])], 30.0, ("room",))
    assert ranged.outside_c < 0.3 * ranged.area_c  # the range explains the rest
    assert ranged.p > 0.05


def test_a_right_model_is_let_be_and_a_bent_loss_is_doubted(machine):
    rng = np.random.default_rng(7)
    found = {name: tf.validate(machine, [run_of(f"{name} {i}", rng, LAWS[name]) for i in range(8)], 30.0) for name in LAWS}
    assert [r.status for r in found["the machine learnt"]] == ["ok"] * 3
    assert min(r.p for r in found["the machine learnt"]) > 0.02
    bent = found["loss to the power 1.25"]
    assert sum(r.status == "model_doubtful" for r in bent) >= 2
    assert np.median([r.area_c for r in bent]) > 2.0 * np.median([r.expected_c for r in bent])
    assert all(r.runs == 8 and "8 runs: at least 30" in r.message for r in bent)
    figure = bent.plot()
    assert len(figure.axes) == 6


@pytest.mark.proof
def test_the_command_on_the_machine_with_a_hidden_effect(tool, tmp_path):
    for name, more in (("base", []), ("auto", ["--auto"])):
        assert tool("improve", HIDDEN[0], *more, "-o", tmp_path / f"{name}.toml", "-q").code == 0
    picture = tmp_path / "areas.png"
    done = tool("validate", tmp_path / "base.toml", *HIDDEN, "--until", 60, "--format", "json", "-q", "--save-plot", picture)
    assert done.code == 0, done.err
    base = json.loads(done.out)["records"]
    right = json.loads(tool("validate", tmp_path / "auto.toml", *HIDDEN, "--until", 60, "--format", "json", "-q").out)["records"]
    # A misfit before --until may pass for coloured noise of some sensors.
    assert "model_doubtful" in {r["status"] for r in base}
    assert np.median([r["p"] for r in base]) < 0.06
    assert {r["status"] for r in right} == {"ok"}
    assert "learnt from: they prove nothing" in right[0]["message"]
    assert sum(r["area_c"] for r in right) < 0.25 * sum(r["area_c"] for r in base)
    assert Path(picture).stat().st_size > 10_000


@pytest.mark.proof
def test_a_rate_far_from_the_files_is_told_where_the_area_does_not_show_it(machine):
    rng = np.random.default_rng(8)
    far = tf.validate(machine, [run_of(f"far {i}", rng, lambda rise, rate: 0.7 * rate * rise) for i in range(6)], 120.0)
    assert all(r.status == "model_doubtful" and "standard errors from the file's" in r.message for r in far)


def test_what_cannot_be_validated_is_told(tool, machine, tmp_path):
    run = run_of("new", np.random.default_rng(3), LAWS["the machine learnt"])
    one = tf.validate(machine, run, 30.0)
    assert {r.status for r in one} == {"too_short"}
    assert "one run" in one[0].message
    with pytest.raises(tf.UsageError, match="is no logged input"):
        tf.validate(machine, run, 30.0, input_range={"power": 5.0})
    with pytest.raises(tf.ThermofastError, match="240"):
        tf.validate(machine, run, 500.0)
    others = [run_of(f"new {i}", np.random.default_rng(i), LAWS["the machine learnt"]) for i in (4, 5)]
    cut = tf.read({n: c[:40] for n, c in {"time_min": run.time_s / 60.0, **run.channels}.items()}, name="cut short")
    still = tf.read({"time_min": run.time_s / 60.0, **run.channels, "T2": np.full(len(run.time_s), 21.0)}, name="still")
    found = tf.validate(machine, [*others, cut, still], 90.0)
    assert next(r for r in found if r.run == "cut short").message == "it ends at 78 min, before --until 90"
    gone = next(r for r in found if r.run == "still")
    assert (gone.channel, gone.status) == ("T2", "constant")
    assert {r.channel: r.runs for r in found if r.p is not None} == {"T1": 3, "T2": 2, "T3": 3}
    late = tf.validate(machine, [run, run_of("other", np.random.default_rng(4), LAWS["2 % faster"])], 234.0)
    assert all(r.status == "too_short" and "readings ahead" in r.message for r in late)
    early = tf.validate(machine, [run, run_of("third", np.random.default_rng(4), LAWS["2 % faster"])], 6.0)
    assert all(r.status == "too_short" and "before --until" in r.message for r in early)
    assert "Missing option '--until'" in tool("validate", machine, HIDDEN[0]).err
    done = tool("validate", tmp_path / "none.toml", HIDDEN[0], "--until", 30)
    assert done.code == 2
    assert "none.toml" in done.err
    done = tool("validate", machine, HIDDEN[0], "--until", 30, "--input-range", "ambient")
    assert "COLUMN=X" in done.err


@pytest.mark.proof
def test_noise_that_neighbours_share_does_not_make_a_right_model_doubtful():
    rng, sets = np.random.default_rng(2), []
    for _ in range(1):
        runs = [run_of(f"r{i}", rng, LAWS["the machine learnt"], 0.0) for i in range(7)]
        coloured = []
        for one in runs:
            white = rng.standard_normal((3, len(one.time_s) + 50))
            noise = 0.05 * np.sqrt(1 - 0.8**2) * lfilter([1.0], [1.0, -0.8], white)[:, 50:]
            columns = {c: v + noise[i] for i, (c, v) in enumerate(one.channels.items())}
            coloured.append(tf.read({"time_min": one.time_s / 60.0, **columns}, name=one.name))
        sets.append(tf.validate(tf.improve(coloured[:3], together=True).model, coloured[3:], 80.0))
    assert min(r.p for one in sets for r in one) > 0.01


def test_a_model_file_without_a_rate_is_refused(machine, tmp_path):
    text = machine.read_text()
    start = text.index("[[base]]")
    cut = text[:start] + text[text.index("[[base]]", start + 5) :]
    (tmp_path / "cut.toml").write_text(cut)
    with pytest.raises(tf.UsageError, match=r"no rate of T1"):
        tf.validate(str(tmp_path / "cut.toml"), HIDDEN, 30.0)
