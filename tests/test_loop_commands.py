"""compare, diagnose, improve, effects and the model file as a user meets them, bad input included."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thermofast.errors import UsageError
from thermofast.machine.modelfile import read_model
from thermofast.plugins import effects as plugins

ROOT = Path(__file__).resolve().parents[1]
HIDDEN = ROOT / "sample_runs" / "hidden.csv"
SECOND = ROOT / "sample_runs" / "hidden_second_run.csv"
SPINDLE = ROOT / "sample_runs" / "spindle.csv"


def records(done):
    assert done.code == 0, done.err
    return json.loads(done.out)["records"]


@pytest.fixture(scope="module")
def learnt(tmp_path_factory):
    from click.testing import CliRunner

    from thermofast.main import cli

    path = tmp_path_factory.mktemp("learnt") / "machine.toml"
    done = CliRunner().invoke(cli, ["improve", str(HIDDEN), "--add", "second_mode", "-o", str(path), "--format", "json", "-q"])
    assert done.exit_code == 0, done.output
    return path


def test_a_healthy_record_is_none_and_says_what_would_have_been_seen(tool):
    found = records(tool("diagnose", SPINDLE, "--channels", "T1,T2,T3", "--format", "json", "-q"))
    assert {r["verdict"] for r in found} == {"none"}
    assert "would most likely have been seen" in found[0]["message"]
    assert "load_step change" in found[0]["message"]
    assert all(r["status"] == "ok" for r in found)
    assert len(found[0]["ranking"]) >= 9


def test_compare_keeps_one_step_and_ahead_apart(tool):
    found = records(tool("compare", HIDDEN, "--until", 120, "--format", "json", "-q"))
    for r in found:
        assert r["rmse_ahead_c"] > 5.0 * r["noise_c"]
        assert r["rmse_one_step_c"] < 2.0 * r["noise_c"]
        assert r["status"] == "model_doubtful"
        assert r["worst_to_min"] > 400.0
        assert abs(r["worst_error_c"]) > 0.2
        assert r["failing"]
        assert 0.0 < r["area_metric_c"] < 1.0
    assert {t["name"] for t in found[0]["goes_along_with"]} & {"T2", "T3", "T4"}


def test_what_one_run_taught_serves_another(tool, learnt):
    with_it = records(tool("compare", SECOND, "--model", learnt, "--until", 60, "--format", "json", "-q"))
    for r in with_it:
        assert r["effects"] == ["second_mode"]
        assert r["rmse_ahead_c"] < 2.0 * r["noise_c"]
    identified = records(tool("identify", SECOND, "--model", learnt, "--until", 60, "--format", "json", "-q"))
    for r in identified:
        assert r["filter"] == "afukf"
        assert r["steady_state_lo_c"] < r["steady_state_c"] < r["steady_state_hi_c"]
        assert r["steady_state_hi_c"] - r["steady_state_lo_c"] < 1.3  # one past run: its next one's rate is known to 8 %
        assert r["rmse_ahead_c"] < 0.06
        assert r["status"] == "ok"
    swept = records(
        tool("sweep", SECOND, "--model", learnt, "--windows", "120,200", "--times", "30:110:40", "--format", "json", "-q")
    )
    assert all(r["rmse_c"] < 0.05 for r in swept)
    again = records(tool("diagnose", SECOND, "--model", learnt, "--format", "json", "-q"))
    assert {r["verdict"] for r in again} == {"none"}


def test_identify_covers_the_steady_state_that_the_simulator_knows(tool, learnt):
    from machines import draw, second_run

    rng = np.random.default_rng(38)
    other = second_run(draw(("second_mode",), rng, "clear"), rng)
    found = records(tool("identify", SECOND, "--model", learnt, "--until", 60, "--format", "json", "-q"))
    settled = other.truth["room"] + np.asarray(other.truth["R"])
    inside = [r["steady_state_lo_c"] - 0.05 <= s <= r["steady_state_hi_c"] + 0.05 for r, s in zip(found, settled, strict=True)]
    assert sum(inside) >= 3


def test_the_staircase_falls(tool):
    found = records(tool("improve", HIDDEN, "--auto", "--format", "json", "-q"))
    assert [r["step"] for r in found] == [0] * 4 + [1] * 4
    assert all(r["rmse_ahead_c"] < 0.4 * b["rmse_ahead_c"] for b, r in zip(found[:4], found[4:], strict=True))
    assert found[-1]["effects"] == ["second_mode"]
    assert "down to its noise" in found[-1]["stopped_because"]
    assert found[4]["parameters"]["second_mode.kappa"]["unit"] == "1/min"


def test_pictures_and_tables_of_every_kind(tool, tmp_path):
    done = tool("compare", HIDDEN, "--save-plot", tmp_path / "c.png", "-o", tmp_path / "c.parquet")
    assert done.code == 0, done.err
    assert (tmp_path / "c.png").stat().st_size > 20_000
    done = tool("improve", HIDDEN, "--add", "second_mode", "--save-plot", tmp_path / "s.png", "-o", tmp_path / "i.csv")
    assert done.code == 0, done.err
    assert (tmp_path / "s.png").stat().st_size > 10_000
    import pandas as pd

    table = pd.read_parquet(tmp_path / "c.parquet")
    assert list(table["channel"]) == ["T1", "T2", "T3", "T4"]
    assert json.loads(table["failing"][0])[0]["from_min"] >= 0.0


def test_a_logged_column_may_drive_the_heat(tool, tmp_path):
    time = np.arange(300.0)
    duty = np.where((time > 60) & (time < 160), 80.0, np.where(time >= 220, 40.0, 10.0))
    heat, curve = duty / 80.0, np.empty(300)
    curve[0] = 21.0
    for k in range(1, 300):
        curve[k] = curve[k - 1] + 0.03 * (20.0 * 0.5 * (heat[k] + heat[k - 1]) - (curve[k - 1] - 20.0))
    noisy = curve + 0.02 * np.random.default_rng(0).standard_normal(300)
    rows = "\n".join(f"{t:g},{a:.3f},{d:g},20.0" for t, a, d in zip(time, noisy, duty, strict=True))
    (tmp_path / "driven.csv").write_text("time_min,block,heater_duty,ambient\n" + rows + "\n")
    found = records(tool("compare", tmp_path / "driven.csv", "--drive", "heater_duty", "--format", "json", "-q"))
    assert found[0]["rmse_fit_c"] < 0.06
    assert records(tool("compare", tmp_path / "driven.csv", "--format", "json", "-q"))[0]["rmse_fit_c"] > 0.3
    verdict = records(tool("diagnose", tmp_path / "driven.csv", "--format", "json", "-q"))[0]
    assert verdict["verdict"] == "load_step"
    bad = tool("compare", tmp_path / "driven.csv", "--drive", "heater_dty", "-q", "--format", "json")
    assert (bad.code, bad.out) == (2, "")
    assert "did you mean 'heater_duty'?" in bad.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["diagnose", HIDDEN, "--effects", "warp"], ["unknown effect 'warp'", "second_mode", "reading_jump"]),
        (["improve", HIDDEN, "--add", "second_mode,second_mode"], ["twice"]),
        (["improve", HIDDEN, "--add", "second_mode", "--auto"], ["exclude each other"]),
        (["compare", HIDDEN, "--model", "nowhere.toml"], ["no such model file", "thermofast improve"]),
        (["compare", HIDDEN, "--until", 9999], ["longer than the record"]),
        (["effects", "warp"], ["unknown effect", "transport_delay"]),
        (["diagnose", HIDDEN, "--effect", "nowhere.py"], ["no such file", "my_effect.py"]),
        (["improve", HIDDEN, "-o", "model.txt"], ["cannot tell the format"]),
    ],
)
def test_bad_usage_is_told(tool, arguments, words):
    done = tool(*arguments)
    assert done.code == 2
    for word in words:
        assert word in done.err


def test_an_effect_without_its_input_says_which_column(tool, tmp_path):
    text = [",".join(line.split(",")[:3]) for line in HIDDEN.read_text().splitlines()]
    (tmp_path / "bare.csv").write_text("\n".join(text) + "\n")
    done = tool("improve", tmp_path / "bare.csv", "--add", "ambient", "--format", "json", "-q")
    assert done.code == 1
    message = json.loads(done.out)["records"][0]["message"]
    assert "needs a logged ambient column" in message
    assert "inputs: none" in message


def test_a_room_that_nobody_logged_stays_possible(tool, tmp_path):
    text = [",".join(line.split(",")[:-1]) for line in HIDDEN.read_text().splitlines()]
    (tmp_path / "bare.csv").write_text("\n".join(text) + "\n")
    found = records(tool("diagnose", tmp_path / "bare.csv", "--format", "json", "-q"))
    assert {r["verdict"] for r in found} == {"second_mode"}
    assert {r["status"] for r in found} == {"not_determined"}
    assert all("ambient" in r["also_possible"] for r in found)
    assert "log the ambient; if the room stood still, add it: thermofast improve" in found[0]["advice"]


def test_one_bad_run_among_several_is_one_record(tool, tmp_path):
    (tmp_path / "bad.csv").write_text("nothing here\n")
    done = tool("diagnose", HIDDEN, tmp_path / "bad.csv", "--effects", "second_mode", "--format", "json", "-q")
    assert done.code == 1
    found = json.loads(done.out)["records"]
    assert [r["status"] for r in found] == ["ok"] * 4 + ["unreadable"]


def test_a_run_too_short_to_judge_says_how_long_it_should_be(tool, tmp_path):
    lines = SPINDLE.read_text().splitlines()
    (tmp_path / "short.csv").write_text("\n".join(line.rsplit(",", 9)[0] for line in lines[:32]) + "\n")
    done = tool("diagnose", tmp_path / "short.csv", "--format", "json", "-q")
    found = json.loads(done.out)["records"]
    assert found[0]["status"] == "not_determined"
    assert "too short to judge; record at least" in found[0]["advice"]
    (tmp_path / "tiny.csv").write_text("\n".join(lines[:12]) + "\n")
    done = tool("diagnose", tmp_path / "tiny.csv", "--format", "json", "-q")
    assert done.code == 1
    assert {r["status"] for r in json.loads(done.out)["records"]} == {"too_short"}


def test_a_model_file_is_read_strictly(learnt, tmp_path):
    text = learnt.read_text()
    model = read_model(str(learnt))
    assert model.effects[0].id == "second_mode"
    assert {n.belongs for n in model.effects[0].parameters} == {"machine"}
    assert len(model.correlations) == 4
    for old, new, words in (
        ('schema = "thermofast.model/1"', 'schema = "thermofast.model/9"', "not a model file of this version"),
        ("[learnt_from]", "colour = 1\n[learnt_from]", "colour"),
        ('id = "second_mode"', 'id = "second_mode"\nlevel = 3', "level"),
        ("[learnt_from]", "[learnt_from", "not valid TOML"),
    ):
        (tmp_path / "m.toml").write_text(text.replace(old, new, 1))
        with pytest.raises(UsageError, match=words):
            read_model(str(tmp_path / "m.toml"))


def test_a_model_of_another_machine_is_refused(tool, learnt, tmp_path):
    (tmp_path / "other.csv").write_text(SECOND.read_text().replace("T", "S"))
    done = tool("compare", tmp_path / "other.csv", "--model", learnt, "--format", "json", "-q")
    assert done.code == 1
    assert "none of its sensors is in the model" in json.loads(done.out)["records"][0]["message"]


GOOD = (ROOT / "sample_runs" / "my_effect.py").read_text()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("drive.heat = drive.heat + ", "nonsense + "), ["NameError", "line 24"]),
        (("drive.heat = drive.heat + ", "drive.heat = np.ones((7, 3)) + 0.0 * "), []),
        (("p.change * np.clip", "p.changed * np.clip"), ["no parameter 'changed'", "change"]),
        (('amplitude = "change"', 'amplitude = "size"'), ["amplitude must be one of its parameters"]),
        (('id = "load_ramp"', 'id = "load ramp"'), ["one word"]),
        (('id = "load_ramp"', 'id = "load_step"'), ["is taken"]),
        (('0.3, "change of the heat in the end", null=0.0', '0.3, "change of the heat in the end"'), ["needs a null"]),
        (("drive.heat = drive.heat + ", "drive.heat = 2.0 * drive.heat + "), ["must change nothing"]),
        (("class LoadRamp(Effect)", "class LoadRamp(Effect"), ["SyntaxError"]),
        (("class LoadRamp(Effect)", "class LoadRamp"), ["no effect class"]),
    ],
)
def test_what_is_wrong_with_an_effect_is_explained(tool, tmp_path, change, words):
    text = GOOD.replace(*change)
    assert text != GOOD
    path = tmp_path / "mine.py"
    path.write_text(text)
    done = tool("effects", "--effect", path)
    assert done.code == 2
    for word in words:
        assert word in done.err


def test_an_effect_that_never_ends_is_stopped(tool, tmp_path, monkeypatch):
    monkeypatch.setattr("thermofast.plugins.guard.PATIENCE_S", 0.3)
    path = tmp_path / "endless.py"
    path.write_text(GOOD.replace("        drive.heat =", "        while True:\n            pass\n        drive.heat ="))
    done = tool("effects", "--effect", path)
    assert done.code == 2
    assert "did not come back" in done.err


def test_an_effect_that_fails_later_is_left_out_and_the_rest_goes_on(tool, tmp_path):
    path = tmp_path / "late.py"
    late = "        if len(run.time) > 100:\n            raise RuntimeError('only short ones')\n        drive.heat ="
    path.write_text(GOOD.replace("        drive.heat =", late))
    found = records(tool("diagnose", HIDDEN, "--effect", path, "--format", "json", "-q"))
    assert {r["verdict"] for r in found} == {"second_mode"}
    assert "only short ones" in found[0]["message"]
    assert "line 25" in found[0]["message"]


def test_an_effect_written_for_one_sensor_works_too(tool, tmp_path):
    path = tmp_path / "plain.py"
    path.write_text(GOOD.replace("        drive.heat =", "        if p.change == 0.0:\n            return\n        drive.heat ="))
    effect = plugins.load_effect(str(path))
    assert effect.by_row
    done = tool("effects", "--effect", path)
    assert done.code == 0
    assert "load_ramp" in done.out


@pytest.mark.proof
def test_hidden_effects_are_made_and_told(tool, tmp_path):
    done = tool(
        "simulate",
        "--effects",
        "load_step,sensor_drift",
        "--seed",
        3,
        "--sensors",
        3,
        "-o",
        tmp_path / "r.csv",
        "--key",
        tmp_path / "k.json",
    )
    assert done.code == 0, done.err
    key = json.loads((tmp_path / "k.json").read_text())
    assert [e["id"] for e in key["effects"]] == ["load_step", "sensor_drift"]
    assert len(key["effects"][1]["channels"]) == 1
    again = tool("simulate", "--effects", "load_step,sensor_drift", "--seed", 3, "--sensors", 3, "-o", tmp_path / "again.csv")
    assert again.code == 0
    assert (tmp_path / "r.csv").read_bytes() == (tmp_path / "again.csv").read_bytes()
    found = records(tool("diagnose", tmp_path / "r.csv", "--format", "json", "-q"))
    assert "load_step" in found[0]["verdict"]
    assert found[0]["event_min"] == pytest.approx(key["effects"][0]["parameters"]["event"], abs=4.0)


def simulated(minutes, every_s, seed=3, rates=(0.004, 0.006), noise=0.02):
    """Two healthy sensors of slow or quick lumps, by formula."""
    time = np.arange(0.0, minutes * 60.0 + 1.0, every_s)
    rng = np.random.default_rng(seed)
    columns = {"time_s": time}
    for i, rate in enumerate(rates):
        columns[f"T{i + 1}"] = 20.0 + (6.0 + i) * (1.0 - np.exp(-rate * time / 60.0)) + noise * rng.standard_normal(len(time))
    return columns


@pytest.mark.parametrize(
    ("minutes", "every_s", "rates"), [(2400, 600, (0.004, 0.006)), (60, 1, (0.05, 0.08)), (60, 60, (0.04, 0.06))]
)
def test_records_of_forty_hours_and_of_readings_each_second_are_judged(tool, tmp_path, minutes, every_s, rates):
    from thermofast.output.files import write_columns

    write_columns(str(tmp_path / "run.csv"), simulated(minutes, every_s, rates=rates))
    for r in records(tool("diagnose", tmp_path / "run.csv", "--format", "json", "-q")):
        assert r["verdict"] == "none"
        assert r["status"] == "ok"
        assert 0.013 < r["noise_c"] < 0.03 or every_s == 1
        assert ("averaged into one" in r["message"]) == (every_s == 1)


def test_diagnose_until_gives_the_error_on_the_readings_after_it(tool):
    few = ("--effects", "second_mode,ambient")
    inside = records(tool("diagnose", HIDDEN, *few, "--format", "json", "-q"))
    early = records(tool("diagnose", HIDDEN, *few, "--until", 200, "--format", "json", "-q"))
    compared = records(tool("compare", HIDDEN, "--until", 200, "--format", "json", "-q"))
    for a, b, c in zip(inside, early, compared, strict=True):
        assert b["rmse_base_ahead_c"] == pytest.approx(c["rmse_ahead_c"])
        assert b["rmse_base_ahead_c"] != pytest.approx(a["rmse_base_ahead_c"], rel=0.05)


def test_evidence_holds_the_tell_tale_with_the_delay_in_minutes(tool):
    message = records(tool("diagnose", HIDDEN, "--format", "json", "-q"))[0]["message"]
    assert "Seen as: fast rise, long creeping tail" in message


def test_a_stricter_false_alarm_rate_is_kept(tool, tmp_path):
    from machines import draw

    from thermofast.output.files import write_columns

    case = draw(("second_mode",), np.random.default_rng(11), "faint")
    write_columns(str(tmp_path / "run.csv"), case.columns)
    loose, strict = (
        records(tool("diagnose", tmp_path / "run.csv", "--false-alarm", p, "--format", "json", "-q")) for p in ("0.05", "1e-12")
    )
    assert loose[0]["false_alarm_p"] < 0.05
    assert loose[0]["false_alarm_p"] > 1e-12
    assert loose[0]["verdict"] not in ("none", "unexplained")
    assert strict[0]["verdict"] in ("none", "unexplained")
    done = tool("diagnose", tmp_path / "run.csv", "--false-alarm", "0")
    assert done.code == 2
    assert "--false-alarm" in done.err


def test_one_run_gives_the_same_records_on_one_process_and_on_two(tool):
    for path, more in (
        (ROOT / "sample_runs" / "hidden.csv", ("--effects", "second_mode,ambient,friction_decay,sensor_lag")),
        (ROOT / "sample_runs" / "hidden_ramp.csv", ("--effects", f"{ROOT / 'sample_runs' / 'my_effect.py'},load_step")),
    ):
        one, two = (tool("diagnose", path, *more, "--jobs", jobs, "--format", "json", "-q") for jobs in (1, 2))
        assert one.out == two.out


def test_work_of_a_dying_process_is_done_in_this_one():
    from thermofast.workers.pool import Shared

    shared = Shared(2)
    assert list(shared(_ends_in_a_worker, [1, 2, 3])) == [1, 4, 9]
    assert list(shared(_ends_in_a_worker, [4])) == [16]
    shared.close()


def _ends_in_a_worker(number):
    import multiprocessing
    import os

    if multiprocessing.parent_process() is not None:
        os._exit(1)
    return number * number


def test_the_chance_of_a_pair_counts_pairs(tool):
    found = records(tool("diagnose", ROOT / "sample_runs" / "hidden_two.csv", "--format", "json", "-q"))[0]
    assert "+" in found["verdict"]
    pair = next(r for r in found["ranking"] if "+" in r["effect"])
    tried = len([r for r in found["ranking"] if "+" not in r["effect"]])
    assert found["false_alarm_p"] == pytest.approx(min(1.0, pair["p"] * 0.5 * tried * (tried + 1)), rel=0.02, abs=1e-300)


def test_an_installed_package_brings_an_effect(tool, monkeypatch):
    from importlib.metadata import EntryPoint

    spec = EntryPoint("grows", "thermofast_installed_effect:HeatGrows", plugins.GROUP)
    import importlib.util
    import sys

    module_spec = importlib.util.spec_from_file_location("thermofast_installed_effect", ROOT / "sample_runs" / "my_effect.py")
    module = importlib.util.module_from_spec(module_spec)
    module_spec.loader.exec_module(module)
    kind = next(v for v in vars(module).values() if isinstance(v, type) and v.__module__ == module.__name__)
    module.HeatGrows = kind
    monkeypatch.setitem(sys.modules, "thermofast_installed_effect", module)
    monkeypatch.setattr("thermofast.plugins.entrypoints.entry_points", lambda group: [spec] if group == plugins.GROUP else [])
    assert kind.id in tool("effects").out
    ramp = ROOT / "sample_runs" / "hidden_ramp.csv"
    found = records(tool("diagnose", ramp, "--format", "json", "-q", "--jobs", 1))
    assert found[0]["verdict"] == kind.id


def two_masses(seed, rise, start=18.0):
    """A lump with a quick and a slow hidden mass, by the matrix exponential: nothing of the project's forward run."""
    from scipy.linalg import expm

    rates = np.array([[-0.05 - 0.04 - 0.015, 0.04, 0.015], [0.03, -0.03, 0.0], [0.0025, 0.0, -0.0025]])
    time = np.arange(0.0, 900.0, 2.0)
    step = expm(2.0 * rates)
    state, curve = np.full(3, -rise), []
    for _ in time:
        curve.append(start + rise + state[0])
        state = step @ state
    noise = np.random.default_rng(seed).standard_normal((2, len(time)))
    return pd.DataFrame(
        {"time_min": time, "T1": curve + 0.01 * noise[0], "T2": start + 0.6 * (np.array(curve) - start) + 0.01 * noise[1]}
    )


def test_an_effect_may_stand_twice_two_hidden_masses_of_different_rates(tool, tmp_path):
    first, second, model = tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "m.toml"
    two_masses(1, 9.0).to_csv(first, index=False)
    two_masses(2, 5.0, 21.0).to_csv(second, index=False)
    steps = records(tool("improve", first, "--add", "second_mode,second_mode.2", "-o", model, "--format", "json", "-q"))
    ahead = {r["step"]: r["rmse_ahead_c"] for r in steps if r["channel"] == "T1"}
    assert [r["effects"] for r in steps if r["channel"] == "T1"][-1] == ["second_mode", "second_mode.2"]
    assert ahead[2] < 0.25 * ahead[1]
    assert ahead[2] < 0.013  # the noise is 0.01 K
    rates = sorted(steps[-1]["parameters"][f"{name}.rate"]["value"] for name in ("second_mode", "second_mode.2"))
    assert rates == pytest.approx([0.0025, 0.03], rel=0.1)
    assert model.read_text().count('id = "second_mode') == 2
    told = records(tool("identify", second, "--model", model, "--until", 240, "--format", "json", "-q"))[0]
    assert told["steady_state_c"] == pytest.approx(26.0, abs=0.1)
    assert told["steady_state_lo_c"] < 26.0 < told["steady_state_hi_c"]
    twice = tool("improve", first, "--add", "second_mode,second_mode")
    assert twice.code == 2
    assert "call the second one second_mode.2" in twice.err


def test_a_sensor_may_be_warmed_by_two_neighbours(tool, tmp_path):
    from scipy.linalg import expm

    # A is linked to B and C, which have heat of their own; one matrix exponential a minute.
    whole = np.zeros((4, 4))
    whole[:3, :3] = [[-0.045, 0.01, 0.015], [0.0, -0.03, 0.0], [0.0, 0.0, -0.012]]
    whole[:3, 3] = [0.08, 0.36, 0.096]
    step, state, rows = expm(whole), np.array([0.0, 0.0, 0.0, 1.0]), []
    for _ in range(400):
        rows.append(18.0 + state[:3])
        state = step @ state
    reading = np.array(rows) + 0.01 * np.random.default_rng(0).standard_normal((400, 3))
    path = tmp_path / "linked.csv"
    pd.DataFrame({"time_min": np.arange(400.0), **{f"T_{n}": reading[:, i] for i, n in enumerate("abc")}}).to_csv(path, index=False)
    steps = records(tool("improve", path, "--add", "neighbour_heat,neighbour_heat.2", "--format", "json", "-q"))
    last = next(r for r in steps if r["step"] == 2 and r["channel"] == "T_a")
    links = sorted(v["value"] for k, v in last["parameters"].items() if k.endswith("kappa"))
    assert links == pytest.approx([0.01, 0.015], rel=0.1)
    assert last["rmse_ahead_c"] < 0.012
    assert next(r for r in steps if r["step"] == 0 and r["channel"] == "T_a")["rmse_ahead_c"] > 0.03


def test_runs_learnt_together_may_be_exported_in_other_units(tool, tmp_path):
    """`T1 [degF]` of one run is `T1` of another, in the model, in every row and on the page."""
    time, paths = np.arange(0.0, 241.0, 2.0), []
    for k, (unit, scale, zero) in enumerate((("", 1.0, 0.0), (" [degF]", 1.8, 32.0), ("", 1.0, 0.0))):
        rng = np.random.default_rng(k)
        columns = {"time_min": time}
        for name, rise, tau in (("T1", 8.0, 40.0), ("T2", 12.0, 55.0)):
            told = 20.0 - (1.0 + 0.1 * k) * rise * np.expm1(-time / tau) + 0.02 * rng.standard_normal(len(time))
            columns[f"{name}{unit}"] = scale * told + zero
        paths.append(tmp_path / f"run{k}.csv")
        pd.DataFrame(columns).round(3).to_csv(paths[-1], index=False)
    page, model = tmp_path / "page.html", tmp_path / "machine.toml"
    told = tool("improve", *paths, "--together", "-o", model, "-o", page, "--format", "json", "-q")
    assert told.code == 0
    assert {r["channel"] for r in json.loads(told.out)["records"]} == {"T1", "T2"}
    assert tuple(read_model(str(model)).channels) == ("T1", "T2")
    assert page.read_text().count("T1 [degF]") == 2  # what is said of the reading alone
    searched = tool("diagnose", *paths[:2], "--together", "--format", "json", "-q")
    assert {(r["run"], r["channel"]) for r in json.loads(searched.out)["records"]} == {
        (str(p), c) for p in paths[:2] for c in ("T1", "T2")
    }


def test_improve_says_what_would_do_as_well(tool, tmp_path):
    """As diagnose does: a name is sure only where it stands alone, also where the other is a room that nobody logged."""
    rng, minutes = np.random.default_rng(3), np.arange(0.0, 300.0)
    slow = 6.0 * -np.expm1(-minutes / 40.0) + 2.0 * -np.expm1(-minutes / 220.0)
    path = tmp_path / "run.csv"
    lines = [f"{t:g},{a:.3f}" for t, a in zip(minutes, 20.0 + slow + rng.normal(0.0, 0.02, 300), strict=True)]
    path.write_text("time_min,T1\n" + "\n".join(lines) + "\n")
    told = json.loads(tool("diagnose", path, "-q", "--format", "json").out)["records"][0]
    done = json.loads(tool("improve", path, "--auto", "-q", "--format", "json").out)["records"]
    assert told["status"] == "not_determined" == done[-1]["status"]
    assert [r["status"] for r in done[:1]] == ["model_doubtful"]
    rivals = [name for name in told["also_possible"] if name != "ambient"]
    assert all(name in done[-1]["stopped_because"] for name in rivals)
    assert "not logged" in done[-1]["message"]
