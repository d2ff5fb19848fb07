"""Code and objects of others: what they may not touch, what is refused of them, and where it is told."""

import json
import pickle
import re
import signal
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import ROOT

import thermofast as tf
from thermofast.models.drive import MOST_HIDDEN
from thermofast.plugins import effects, guard, trial
from thermofast.plugins.effects import chosen_effects, load_effect
from thermofast.plugins.files import is_file, path_and_class
from thermofast.plugins.guard import alarm

SPINDLE, COOL_DOWN = (ROOT / "sample_runs" / name for name in ("spindle.csv", "cool_down.csv"))
MINUTES = np.arange(120.0)
RISE = 20.0 + 6.0 * -np.expm1(-MINUTES / 30.0) + 0.01 * np.sin(7.0 * MINUTES)

EFFECT = """
from thermofast.models.effects import Effect, Parameter

class Mine(Effect):
    id, summary, equation, tell_tale = "mine", "a heat of mine", "e", "t"
    uses_sink = True
    amplitude = "change"
    parameters = (
        Parameter("change", "1", -1.0, 4.0, 0.3, "change", null=0.0),
        Parameter("begin", "min", 0.0, 0.9, 0.3, "begin", belongs="run", share=True),
    )

    def apply(self, drive, run, p):
        {body}
"""

FILTER = """
import sys
from dataclasses import dataclass
from thermofast.filters import GaussianFilter, setting
from thermofast.filters.moments import ScaledPoints

@dataclass(frozen=True)
class Mine(GaussianFilter):
    name, summary, reference, closing = "mine", "s", "r", "never"
    spread: float = setting(0.1, "of the points", 0.01, 1.0)

    @property
    def moments(self):
        return ScaledPoints(self.spread)

    def track(self, model, time, reading, resolution):
        {body}
        return super().track(model, time, reading, resolution)
"""


def effect_of(tmp_path, body):
    path = tmp_path / "mine.py"
    path.write_text(EFFECT.format(body=body))
    return path


def filter_of(tmp_path, body="pass"):
    path = tmp_path / "my_filter.py"
    path.write_text(FILTER.format(body=body))
    return path


@pytest.mark.parametrize("change", ["run.reading[:] = 0.0", "run.middle -= 1.0", "run.used[0] = False"])
def test_an_effect_that_changes_what_others_read_is_refused_with_its_line(tool, tmp_path, change):
    path = effect_of(tmp_path, f"{change}; drive.heat = drive.heat * (1.0 + p.change * run.after(p.begin))")
    refused = tool("effects", "--effect", path)
    assert refused.code == 2
    assert "mine.py, line 14" in refused.err
    assert "read-only" in refused.err
    assert "make new ones" in refused.err


def test_in_place_arithmetic_on_an_input_is_refused_where_it_shows(tool, tmp_path):
    path = effect_of(tmp_path, 's = run.inputs["speed"]; s /= 2.0; drive.heat = drive.heat + p.change * s * run.after(p.begin)')
    assert "read-only" in tool("effects", "--effect", path).err


@pytest.mark.parametrize("body", ["drive.heat = drive.heat + p.change + 0.0 * p.begin", "drive.loss + p.change * p.begin"])
def test_a_parameter_that_changes_nothing_is_refused(tool, tmp_path, body):
    refused = tool("effects", "--effect", effect_of(tmp_path, body))
    assert refused.code == 2
    assert "changes nothing, whatever it is" in refused.err


def test_as_many_hidden_masses_as_there_is_room_for(tool, tmp_path):
    names = [f"second_mode.{k}" if k > 1 else "second_mode" for k in range(1, MOST_HIDDEN + 2)]
    with pytest.raises(tf.UsageError, match=r"17 hidden masses in one model(?s:.*)allowed: 16 at most"):
        effects.chosen_effects(names, ())
    assert [e.masses for e in effects.chosen_effects(names[:5], ())] == [1] * 5
    compared = tool("compare", SPINDLE, "--effects", ",".join(names[:5]), "--channels", "T1", "--until", 60, "--format", "json")
    assert compared.code in (0, 1)
    assert "Traceback" not in compared.err
    five = "[drive.hidden.append((p.change * k, 0.01 + p.begin / 1000.0)) for k in range(5)]"
    refused = tool("effects", "--effect", effect_of(tmp_path, five))
    assert refused.code == 2
    assert "too many hidden masses" in refused.err


def test_a_filter_cannot_change_readings_nor_end_the_batch(tool, tmp_path):
    changing = tool("identify", SPINDLE, "--until", 60, "--filter", filter_of(tmp_path, "reading -= 5.0"))
    assert changing.code == 2
    assert "read-only" in changing.err
    (tmp_path / "leaves").mkdir()
    path = filter_of(tmp_path / "leaves", "len(time) == 61 and sys.exit(4)")
    leaving = tool("identify", SPINDLE, COOL_DOWN, "--until", 60, "--filter", path, "--format", "json")
    assert leaving.code == 1
    rows = json.loads(leaving.out)["records"]
    assert len(rows) == 20
    assert {r["status"] for r in rows} == {"diverged"}
    assert "raised SystemExit: 4" in rows[0]["message"]


def test_what_a_filter_prints_stays_out_of_the_table(tool, tmp_path):
    printing = tool("identify", SPINDLE, "--until", 60, "--filter", filter_of(tmp_path, 'print("hello")'), "--format", "json")
    assert len(json.loads(printing.out)["records"]) == 10


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("from dataclasses import replace; return replace(super().track(model, time, reading, resolution), noise_variance="
         "-super().track(model, time, reading, resolution).noise_variance)", "noise_variance holds -"),
        ("from dataclasses import replace; t = super().track(model, time, reading, resolution); return replace(t, first=len(time))",
         "nothing would be estimated"),
    ],
)  # fmt: skip
def test_a_track_that_tells_nothing_is_refused_before_the_batch(tool, tmp_path, body, said):
    refused = tool("identify", SPINDLE, "--until", 60, "--filter", filter_of(tmp_path, body))
    assert refused.code == 2
    assert said in refused.err
    assert "Traceback" not in refused.err


def test_a_state_that_leaves_the_readings_is_no_estimate(tool, tmp_path):
    body = (
        "from dataclasses import replace; t = super().track(model, time, reading, resolution); "
        "s = t.state.copy(); s[:, 1] = -5.0; s[:, 2] = 2.0; return replace(t, state=s)"
    )
    done = tool("identify", SPINDLE, "--until", 60, "--filter", filter_of(tmp_path, body), "--format", "json")
    rows = json.loads(done.out)["records"]
    assert {r["status"] for r in rows} == {"diverged"}
    assert "the filter's state leaves the readings (" in rows[0]["message"]


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ("@dataclass(frozen=True)", "", "write @dataclass(frozen=True) above the class"),
        ("@dataclass(frozen=True)", "@dataclass", "write @dataclass(frozen=True) above the class"),
        ("def moments(self)", "def moment(self)", "did you mean 'moments'?"),
    ],
)
def test_a_slip_in_a_filter_is_told_with_what_to_write(tool, tmp_path, was, becomes, said):
    path = filter_of(tmp_path)
    path.write_text(path.read_text().replace(was, becomes))
    refused = tool("identify", SPINDLE, "--until", 60, "--filter", path)
    assert refused.code == 2
    assert said in refused.err


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ('amplitude = "change"', 'amplitude = "change"; moves_room = "room"', "its moves_room must be one of its parameters"),
        ('"begin", belongs="run"', '"begin", settles="speed", belongs="run"', "settles is 'rate' or 'time' (found 'speed')"),
    ],
)
def test_declarations_of_an_effect_that_nothing_reads_are_refused(tool, tmp_path, was, becomes, said):
    path = effect_of(tmp_path, "drive.heat = drive.heat + p.change * run.after(p.begin)")
    path.write_text(path.read_text().replace(was, becomes))
    refused = tool("effects", "--effect", path)
    assert refused.code == 2
    assert said in refused.err


def test_a_column_that_a_run_does_not_have_is_named_with_the_way(tool, tmp_path):
    body = 'drive.heat = drive.heat + p.change * run.inputs["rpm"] * run.after(p.begin)'
    path = effect_of(tmp_path, body)
    done = tool(
        "improve", "sample_runs/hidden.csv", "--effect", path, "--add", "mine", "-o", tmp_path / "m.toml", "--format", "json"
    )
    assert "not every record has a column 'rpm': offer it in choices(self, run)" in done.out
    other = tmp_path / "other.py"
    other.write_text(
        path.read_text().replace("Effect, Parameter\n", "Effect, Parameter\nfrom thermofast.models.effects.base import Choice\n")
        + '\n    def choices(self, run):\n        return [Choice("rpm", {"column": "rpm"})]\n'
    )
    done = tool(
        "improve", "sample_runs/hidden.csv", "--effect", other, "--add", "mine", "-o", tmp_path / "m.toml", "--format", "json"
    )
    assert "choices gives the column 'rpm', which this run does not have" in done.out


def test_settings_of_a_filter_in_a_file(tmp_path):
    path = str(filter_of(tmp_path))
    narrow, wide = (tf.identify(SPINDLE, 60, filter=path, settings={"spread": s}, channels="T1") for s in (0.1, 0.9))
    assert narrow[0].filter == wide[0].filter == "mine"
    assert narrow[0].steady_state_c != wide[0].steady_state_c
    with pytest.raises(tf.UsageError, match="spread"):
        tf.identify(SPINDLE, 60, filter=path, settings={"spread": 9.0})


@pytest.mark.parametrize(("unit", "minute"), [("ns", 60 * 10**9), ("s", 60), ("m", 1)])
def test_masked_times_keep_their_unit(unit, minute):
    plain = (MINUTES * minute).astype(f"timedelta64[{unit}]")
    run = tf.read({"time": np.ma.masked_array(plain, mask=False), "a [°C]": RISE})
    np.testing.assert_allclose(run.time_s, 60.0 * MINUTES)


def test_objects_of_others_are_copied_and_odd_ones_are_read_or_refused(tmp_path):
    reading = RISE.copy()
    run = tf.read({"time_min": MINUTES, "a [°C]": reading})
    reading -= 5.0
    np.testing.assert_allclose(run.channels["a"] if "a" in run.channels else run.channels["a [°C]"], RISE)
    batch = pa.record_batch({"time_min": MINUTES, "a [°C]": RISE})
    assert len(tf.read(batch).time_s) == 120
    stamps = pd.date_range("2026-05-01", periods=120, freq="min", tz="Europe/Berlin")
    assert tf.read({"time": stamps, "a [°C]": RISE}).time_s[-1] == 119 * 60.0
    assert tf.read({"time": stamps - stamps[0], "a [°C]": RISE}).time_s[-1] == 119 * 60.0
    periods = pd.DataFrame({"a [°C]": RISE}, index=pd.period_range("2026-05-01", periods=120, freq="min"))
    assert tf.read(periods).time_s[-1] == 119 * 60.0
    with pytest.raises(tf.ThermofastError, match="index of several levels"):
        tf.read(pd.DataFrame({"a [°C]": RISE}, index=pd.MultiIndex.from_arrays([MINUTES, MINUTES])))
    twice = pa.table([MINUTES, RISE, RISE], names=["time_min", "a [°C]", "a [°C]"])
    pq.write_table(twice, tmp_path / "twice.parquet")
    with pytest.raises(tf.ThermofastError, match="'a \\[°C\\]' twice"):
        tf.read(tmp_path / "twice.parquet")
    for true in (RISE > 21.0, pa.array(RISE > 21.0), pd.Series(RISE > 21.0)):
        told = {"time_min": MINUTES, "on": true}
        with pytest.raises(tf.ThermofastError, match="no sensor column"):
            tf.read(pa.table(told) if isinstance(true, pa.Array) else told)


@pytest.mark.parametrize(
    "call",
    [
        lambda run: tf.identify(run, 60, preset="bla"),
        lambda run: tf.identify(run, 60, start="bla"),
        lambda run: tf.identify(run, 60, filter=None),
        lambda run: tf.identify(run, 60, executor=3),
        lambda run: tf.identify(run, 60, imperfection=3),
        lambda run: tf.sweep(run, tolerance=-1.0),
        lambda run: tf.sweep(run, tolerance=float("nan")),
        lambda run: tf.compare(run, until="60"),
        lambda run: tf.compare(run, extra="nowhere.py", effects="nowhere.py"),
        lambda run: tf.diagnose(run, false_alarm=2.0),
        lambda run: tf.improve(run, false_alarm=float("nan"), auto=True),
        lambda run: tf.plan(-1.0),
        lambda run: tf.plan(like=[]),
        lambda run: tf.watch(run, tolerance=-1.0),
        lambda run: tf.watch(run, poll=-1.0),
        lambda run: tf.sensitivity(run, sizes={"offset": -1.0}),
        lambda run: tf.simulate(duration=-1.0),
        lambda run: tf.simulate(noise=float("nan")),
        lambda run: tf.simulate(sensors=1.5),
        lambda run: tf.simulate(interval=0.0),
        lambda run: tf.simulate(seed=-1),
    ],
)
def test_the_library_refuses_what_the_command_refuses(call):
    with pytest.raises(tf.ThermofastError):
        call(SPINDLE)


def test_a_picture_of_a_result_without_curves_is_refused(tmp_path):
    with pytest.raises(tf.UsageError, match=r"nothing to draw"):
        tf.identify(SPINDLE, 60, details=False).plot(tmp_path / "none.png")


def test_a_model_beside_a_filter_that_does_not_close_is_refused_by_sweep_as_by_identify(tmp_path):
    hidden = ROOT / "sample_runs" / "hidden.csv"
    model = tf.improve(hidden, add="second_mode", channels="T1,T2", until=120).model
    for command in (tf.identify, tf.sweep):
        with pytest.raises(tf.UsageError, match="enter the closing estimate"):
            command(hidden, filter="ukf", model=model)


def test_what_a_prompt_shows_of_a_result_is_a_line():
    assert repr(tf.identify(SPINDLE, 60)) == "<Identification: 10 records (10 ok); .to_frame() shows them>"


STEP = """
import numpy as np
from thermofast.models.effects import Effect, Parameter

class Step(Effect):
    id, summary, equation, tell_tale = "own_step", "a step", "heat = 1 + c (t OP event)", "a kink"
    amplitude, event, scope = "c", "event", "run"
    parameters = (Parameter("c", "1", -0.9, 3.0, 0.3, "change", null=0.0),
                  Parameter("event", "min", 0.0, 1.0, 0.3, "when", belongs="run", share=True))
    EXTRA

    def apply(self, drive, run, p):
        drive.heat = drive.heat * (1.0 + p.c * STEP)
"""


@pytest.mark.parametrize("step", ["(run.time > p.event)", "(run.time >= p.event)", "(run.time < p.event)"])
def test_a_step_at_a_reading_has_no_derivative_whichever_way_it_is_written(step, tmp_path):
    path = tmp_path / "step.py"
    path.write_text(STEP.replace("STEP", step).replace("EXTRA", ""))
    with pytest.raises(tf.ThermofastError, match="'event' has no derivative"):
        load_effect(str(path))
    good = tmp_path / "good.py"
    good.write_text(STEP.replace("STEP", "run.after(p.event)").replace("EXTRA", "").replace("own_step", "good_step"))
    assert load_effect(str(good)).id == "good_step"


def test_an_effect_of_a_file_stands_twice_and_the_first_stays_as_it_is(tmp_path):
    path = tmp_path / "twice.py"
    path.write_text(STEP.replace("STEP", "run.after(p.event)").replace("EXTRA", "again = True").replace("own_step", "step_again"))
    first, second = chosen_effects([str(path), "step_again.2"], ())
    assert (first.id, first.number, second.id, second.number) == ("step_again", 1, "step_again.2", 2)
    assert load_effect(str(path)).id == "step_again"
    assert pickle.loads(pickle.dumps(second)).id == "step_again.2"
    found = tf.diagnose("sample_runs/hidden.csv", channels="T1,T2", extra=(str(path),))
    assert len(found.records) == 2


@pytest.mark.parametrize(("extra", "words"), [("agian = True", "did you mean 'again'"), ("grids = None", "did you mean 'grid'")])
def test_what_looks_like_a_slip_is_asked_about(extra, words, tmp_path):
    path = tmp_path / "slip.py"
    path.write_text(STEP.replace("STEP", "run.after(p.event)").replace("EXTRA", extra))
    with pytest.raises(tf.ThermofastError, match=words):
        load_effect(str(path))


def test_an_old_import_is_answered_with_the_new_one(tmp_path):
    path = tmp_path / "old.py"
    path.write_text("from models.effects import Effect, Parameter\n")
    with pytest.raises(tf.ThermofastError, match=r"write 'from thermofast.models.effects import ...'"):
        load_effect(str(path))


def test_true_and_false_are_no_temperatures():
    time = np.arange(60.0)
    rise = 20.0 - 5.0 * np.expm1(-time / 20.0)
    for flags in ([True, False] * 30, [True, None] * 30):
        run = tf.read({"time_min": time, "T1": rise, "T2": np.array(flags, dtype=object)})
        assert list(run.channels) == ["T1"]
    with pytest.raises(tf.ThermofastError, match="row 3, column 'T2': not a number"):
        tf.read({"time_min": time, "T1": rise, "T2": np.array([20.0, 21.0, True] * 20, dtype=object)})


def test_a_filter_of_a_file_may_not_bear_the_name_of_a_built_in_one(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(OWN_FILTER.replace("NAME", "afukf"))
    with pytest.raises(tf.ThermofastError, match="its name 'afukf' is taken"):
        tf.identify("sample_runs/spindle.csv", until=60, channels="T1", filter=str(path))
    path.write_text(OWN_FILTER.replace("NAME", "own_ls"))
    (row,) = tf.identify("sample_runs/spindle.csv", until=60, channels="T1", filter=str(path)).records
    assert row.status in ("ok", "model_doubtful")


#: As the guide says that a Track is.
OWN_FILTER = """
from dataclasses import dataclass
import numpy as np
from thermofast.filters import Filter, Track

@dataclass(frozen=True)
class Own(Filter):
    name = "NAME"
    summary = "no filter at all"
    reference = "nobody 2026"
    closing = "always"

    def track(self, model, time, reading, resolution=0.0):
        count, n = len(time), len(model.state_names)
        none, one, zero = np.full(count, np.nan), np.ones(count), np.zeros(count)
        return Track(first=count, state=np.full((count, n), np.nan), covariance=np.full((count, n, n), np.nan), noise_variance=none,
                     innovation=none, innovation_variance=none, fading=one, process_noise=zero, noise_factor=one, weight=one,
                     forgotten=zero, diverged_at=None)
"""


def test_what_a_plugin_prints_does_not_stand_among_the_records(tool, tmp_path):
    path = tmp_path / "loud.py"
    loud = STEP.replace("STEP", "run.after(p.event)").replace("EXTRA", "").replace("own_step", "loud_step")
    path.write_text("print('hello')\n" + loud.replace("        drive.heat", "        print('applied')\n        drive.heat"))
    done = tool(
        "diagnose", "sample_runs/hidden.csv", "--channels", "T1,T2", "--effects", f"second_mode,{path}", "--format", "json", "-q"
    )
    assert len(json.loads(done.out)["records"]) == 2


def test_a_model_file_without_the_key_of_what_was_searched_is_read(tool, tmp_path):
    model = tmp_path / "machine.toml"
    assert tool("improve", "sample_runs/hidden.csv", "--channels", "T1,T2", "--add", "second_mode", "-o", model, "-q").code == 0
    before = tool("compare", "sample_runs/hidden.csv", "--channels", "T1,T2", "--model", model, "-q").out
    text = re.sub(r"searched = \[[^\]]*\]\n", "", model.read_text())
    assert "searched" not in text
    model.write_text(text)
    assert tool("compare", "sample_runs/hidden.csv", "--channels", "T1,T2", "--model", model, "-q").out == before


@pytest.mark.parametrize("inside", ["import os; os.chdir('/')", "import numpy; numpy.seterr(all='raise')"])
def test_what_an_import_changes_of_the_process_ends_with_it(inside, tmp_path, tool):
    path = tmp_path / "mine.py"
    path.write_text(inside + "\n" + effect_of(tmp_path, "drive.heat = drive.heat + p.change * run.after(p.begin)").read_text())
    before, folder = np.geterr(), Path.cwd()
    load_effect(str(path))
    assert (np.geterr(), Path.cwd()) == (before, folder)


@pytest.mark.parametrize(
    ("raised", "told"),
    [
        ("raise BaseException('x')", "raised BaseException"),
        ("raise type('Odd', (Exception,), {'__str__': lambda self: 1 / 0})()", "Odd: (no text)"),
    ],
)
def test_whatever_a_plug_in_raises_is_told(raised, told, tmp_path, tool):
    refused = tool("effects", "--effect", effect_of(tmp_path, raised))
    assert refused.code == 2
    assert told in refused.err
    mine = tmp_path / "filter.py"
    mine.write_text(FILTER.replace("{body}", f"\n        if len(time) != 60:\n            {raised}"))
    done = tool("identify", SPINDLE, "--until", "80", "--channels", "T1", "--filter", mine, "--format", "json", "-q")
    (record,) = json.loads(done.out)["records"]
    assert record["status"] == "diverged"
    assert told.split(": ")[-1].removeprefix("raised ") in record["message"]


def test_one_effect_that_cannot_be_used_keeps_nobody_elses_out_of_the_list(tmp_path, tool):
    good = effect_of(tmp_path, "drive.heat = drive.heat + p.change * run.after(p.begin)")
    bad = tmp_path / "bad.py"
    bad.write_text("import nothing_of_that_name\n")
    listed = tool("effects", "--effect", bad, "--effect", good)
    assert listed.code == 2
    assert "\nmine " in listed.out
    assert f"{bad}" in listed.out
    assert listed.out.count("cannot be used") == 1
    assert "nothing_of_that_name" in listed.err


def test_an_effect_that_adds_a_column_for_others_is_refused(tmp_path, tool):
    body = "run.ambient['mine'] = run.time; drive.heat = drive.heat + p.change * run.after(p.begin)"
    refused = tool("effects", "--effect", effect_of(tmp_path, body))
    assert refused.code == 2
    assert "it writes to run.ambient, which other effects use, too" in refused.err


def test_a_null_that_is_no_number_is_refused(tmp_path, tool):
    path = effect_of(tmp_path, "drive.heat = drive.heat + p.change * run.after(p.begin)")
    path.write_text(path.read_text().replace("null=0.0", "null='none'"))
    refused = tool("effects", "--effect", path)
    assert "its null must be a number (found 'none')" in refused.err


def test_a_timer_that_the_caller_has_set_goes_on():
    rang = []
    before = signal.signal(signal.SIGALRM, lambda *_: rang.append(True))
    try:
        signal.setitimer(signal.ITIMER_REAL, 100.0, 7.0)
        with alarm("a filter"), alarm("one in it", 5.0):
            assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 5.0
            time.sleep(0.05)
        left, every = signal.getitimer(signal.ITIMER_REAL)
        assert 0.0 < left < 99.96  # less what went by
        assert every == 7.0
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        with alarm("what takes longer than the caller's timer"):
            time.sleep(0.05)
        time.sleep(0.05)
        assert rang == [True]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_an_effect_that_loops_is_told_once_with_its_own_line(tmp_path, monkeypatch):
    monkeypatch.setattr(guard, "PATIENCE_S", 0.4)
    path = tmp_path / "loops.py"
    path.write_text(EFFECT.format(body="import numpy as np\n        while True:\n            np.linalg.inv(np.eye(60))"))
    tried, curves = [], trial._curves
    monkeypatch.setattr(trial, "_curves", lambda *given: tried.append(given[-1]) or curves(*given))
    with pytest.raises(guard.PluginTimeoutError, match=r"did not come back within 0\.4 s") as told:
        load_effect(str(path))
    assert tried == [False]  # not a second time with plain numbers
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if "linalg.inv" in text)
    assert re.search(rf"line ({line - 1}|{line}) of .*loops\.py", told.value.found)


def test_a_file_in_a_folder_with_a_colon_is_found(tmp_path):
    folder = tmp_path / "a:b"
    folder.mkdir()
    path = folder / "mine.py"
    path.write_text(EFFECT.format(body="drive.heat = drive.heat + p.change * run.after(p.begin)"))
    assert load_effect(str(path)).id == load_effect(f"{path}:Mine").id == "mine"
    assert path_and_class(f"{path}:Mine") == (str(path), "Mine")
    assert not is_file("second_mode")
