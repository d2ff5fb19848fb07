"""The library: what the commands do, from Python, on what is in memory; and bad input met with words."""

import ast
import json
import pickle
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from conftest import ROOT

import thermofast as tf
from thermofast.reading.tables.frames import table_of

MINUTES = np.arange(120.0)
SPINDLE, HIDDEN = ROOT / "sample_runs" / "spindle.csv", ROOT / "sample_runs" / "hidden.csv"


@pytest.fixture(scope="module")
def frame():
    return pd.read_csv(SPINDLE)


@pytest.fixture(scope="module")
def told():
    return tf.identify(SPINDLE, until=60)


def test_the_import_is_quick_and_lists_what_there_is():
    code = "import sys, thermofast as tf; print(dir(tf)); print([m for m in ('numpy', 'scipy', 'pandas', 'pyarrow', 'click') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names, heavy = done.stdout.splitlines()
    assert heavy == "[]"
    assert "'identify'" in names
    for name in tf.__all__:
        assert getattr(tf, name) is not None
    with pytest.raises(AttributeError, match="it has Guess, InputError"):
        tf.identfy  # noqa: B018


def test_identify_gives_what_the_command_prints(tool, told):
    printed = json.loads(tool("identify", SPINDLE, "--until", 60, "--format", "json", "-q").out)
    ours = json.loads(told.to_json())
    assert {k: v for k, v in ours.items() if k != "records"} == {k: v for k, v in printed.items() if k != "records"}
    for mine, theirs in zip(ours["records"], printed["records"], strict=True):
        # A linear algebra library may round another way in another process: the last digits are its own.
        assert mine == {k: pytest.approx(v, rel=1e-8) if isinstance(v, float) else v for k, v in theirs.items()}
    assert len(told) == 10
    assert told["T5"] is told[4]
    assert [r.channel for r in told] == [f"T{i}" for i in range(1, 11)]
    with pytest.raises(KeyError, match="there are T1, T2"):
        told["T77"]


@pytest.mark.parametrize(
    "given",
    [
        lambda f: f,
        lambda f: pa.Table.from_pandas(f),
        lambda f: {n: f[n].to_numpy() for n in f},
        lambda f: {n: list(f[n]) for n in f},
        lambda f: f.drop(columns="time_min").set_index(pd.to_timedelta(f["time_min"], unit="min")),
        lambda f: f.drop(columns="time_min").set_index(
            pd.date_range("2026-03-29 00:30", periods=401, freq="min", tz="Europe/Berlin")
        ),
        lambda f: f.drop(columns="time_min").set_index(pd.date_range("2026-05-01 00:30", periods=401, freq="min")),
        lambda f: f.astype({"T5": "Float64"}).assign(T5=lambda g: g["T5"].astype(object)),
        lambda f: f.iloc[::-1],
        lambda f: {**{n: f[n].to_numpy() for n in f}, "T5": np.ma.masked_array(f["T5"], mask=np.zeros(401, dtype=bool))},
    ],
    ids=[
        "frame",
        "arrow",
        "arrays",
        "lists",
        "durations",
        "zone over a clock change",
        "stamps",
        "objects",
        "newest first",
        "masked",
    ],
)
def test_every_kind_of_table_gives_the_same(given, frame, told):
    run = tf.read(given(frame), name="here")
    assert run.name == "here"
    assert run.guesses == ()
    found = tf.identify(run, until=60)
    assert found["T5"].steady_state_c == pytest.approx(told["T5"].steady_state_c, abs=1e-9)
    assert list(run.ambient) == ["ambient"]


def test_missing_values_are_gaps_and_repeated_times_are_met(frame):
    holes = frame.copy()
    holes.loc[10:20, "T5"] = np.nan
    masked = np.ma.masked_array(frame["T5"].to_numpy(), mask=(frame.index >= 10) & (frame.index <= 20))
    for given in (holes, {"time_min": frame["time_min"].to_numpy(), "T5": masked}, holes.astype({"T5": "Float64"})):
        assert np.isnan(tf.read(given).channels["T5"]).sum() == 11
    twice = pd.concat([frame, frame.iloc[[50]]])
    assert len(tf.read(twice).time_s) == 401


BAD = {
    "two dimensions": ({"time_min": np.arange(9.0), "T1": np.zeros((9, 2))}, "not one-dimensional"),
    "an array": (np.zeros((9, 2)), "ndarray of shape (9, 2)"),
    "a number": (7, "found: int"),
    "other lengths": ({"time_min": np.arange(9.0), "T1": np.arange(8.0)}, "'T1' has 8 readings, 'time_min' 9"),
    "a mixture": ({"time_min": np.arange(4.0), "T1": [1.0, "OL?", 2.0, 3.0]}, "row 2, column 'T1'"),
    "nothing": (pd.DataFrame(), "no columns"),
    "no sensor": ({"time_min": np.arange(9.0)}, "no sensor column"),
    "no time": ({"T1": np.arange(9.0) ** 0.5, "T2": np.arange(9.0)}, "no time column"),
    "names that are numbers": (pd.DataFrame(np.zeros((9, 2))), "a column is called 0"),
    "a name twice": (pd.DataFrame(np.zeros((9, 2)), columns=["T1", "T1"]), "'T1' twice"),
    "levels": (pd.DataFrame(np.zeros((9, 2)), columns=pd.MultiIndex.from_tuples([("a", "b"), ("a", "c")])), "several levels"),
    "complex": ({"time_min": np.arange(4.0), "T1": np.arange(4.0) * 1j}, "not a number"),
    "no file": ("nowhere.csv", "no such file"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("cells", "numbers"),
    [
        (["19,984", "20,5", "", "n/a", "-1,0"], [19.984, 20.5, np.nan, np.nan, -1.0]),
        (["19.984", "20.5", "21", "1e1", "-3"], [19.984, 20.5, 21.0, 10.0, -3.0]),
        (["1,019.5", "20.5", "21", "22", "23"], [1019.5, 20.5, 21.0, 22.0, 23.0]),
    ],
)
def test_numbers_kept_as_text_are_numbers(cells, numbers):
    table = table_of({"time_min": ["0", "0,5", "1", "1,5", "2"], "T1": cells, "note": ["19,9", "start", "", "", ""]})
    assert table.columns["time_min"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert table.columns["T1"].tolist() == pytest.approx(numbers, nan_ok=True)
    assert isinstance(table.columns["note"], list)
    arrow = table_of(pa.table({"T1": cells}))
    assert arrow.columns["T1"].tolist() == pytest.approx(numbers, nan_ok=True)
    assert table_of({"day": ["20260131"] * 5}).columns["day"] == ["20260131"] * 5
    for build in (dict, pa.table):
        epochs = tf.read(build({"timestamp": [str(1700000000 + 60 * i) for i in range(5)], "T1": numbers}))
        assert epochs.time_s.tolist() == [0.0, 60.0, 120.0, 180.0, 240.0]


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_an_error_with_words(name):
    given, words = BAD[name]
    with pytest.raises(tf.InputError) as refused:
        tf.read(given)
    assert words in str(refused.value)


def test_bad_settings_are_errors_with_words(frame):
    run = tf.read(frame)
    for call, words in (
        (lambda: tf.identify([]), "no run given"),
        (lambda: tf.identify([run, run]), "two runs are called"),
        (lambda: tf.identify(run, channels="T5"), "read already"),
        (lambda: tf.identify(frame, chanels="T5"), "tf.identify has no argument 'chanels'"),
        (lambda: tf.identify(run, untill=60), "did you mean 'until'"),
        (lambda: tf.diagnose(run, next=True), "it is called 'next_experiment'"),
        (lambda: tf.identify(run, trace=True), "it is called 'details'"),
        (lambda: tf.identify(run, next=True), "do: see docs/api.md|do: did you mean"),  # not of this function
        (lambda: tf.identify(run, 60, "afukf"), "tf.identify: too many positional arguments"),
        (lambda: tf.plan(0.5, sensors="3"), "sensors is not such a number"),
        (lambda: tf.read(frame, strict="no"), "strict: not understood"),
        (lambda: tf.identify(run, until=999), "longer than the record"),
        (lambda: tf.identify(run, model={}), "model: not understood"),
        (lambda: tf.identify(run, filter="afuk"), "did you mean 'afukf'"),
        (lambda: tf.identify(run, settings={"gaet": 3}), "no setting 'gaet'"),
        (lambda: tf.identify(run, start=500), "outside the record"),
        (lambda: tf.sweep(run, windows=[]), "not a list of minutes"),
        (lambda: tf.sweep(run, windows=[500], times=[10]), "longer than the record"),
        (lambda: tf.improve(run, add="second_mode", auto=True), "exclude each other"),
        (lambda: tf.sensitivity(run, sizes={"rom": 1.0}), "unknown size 'rom'"),
        (lambda: tf.Model.load("nowhere.toml"), "no such model file"),
    ):
        with pytest.raises(tf.ThermofastError, match=words.replace("(", r"\(")):
            call()


def test_options_are_met_as_the_command_line_meets_them(frame):
    few = tf.read(SPINDLE, channels="T5, T2")
    assert set(few.channels) == {"T2", "T5"}
    assert tf.read(SPINDLE, channels=["T5", "T2"]).channels.keys() == few.channels.keys()
    rows = frame.melt("time_min", ["T1", "T2"], "sensor", "value")
    assert set(tf.read(rows, long="sensor,value").channels) == {"T1", "T2"}
    with pytest.raises(tf.UsageError, match="long: not two columns"):
        tf.read(rows, long="sensor")
    with pytest.raises(tf.UsageError, match=r"(?s)joint=True runs the AFUKF over all sensors.*found: preset paper"):
        tf.identify(SPINDLE, joint=True, preset="paper")
    with pytest.raises(tf.UsageError, match=r"(?s): start=500 is outside the record.*found: 400 min"):
        tf.identify(SPINDLE, start=500)


def test_what_was_guessed_stands_in_every_record_however_it_is_reached():
    fahrenheit = {
        "time_min": MINUTES,
        "front": 70.0 - 20.0 * np.expm1(-MINUTES / 40.0),
        "rear": 70.0 - 9.0 * np.expm1(-MINUTES / 30.0),
    }
    told = tf.identify(fahrenheit)
    assert all("no unit, taken for degC" in m for m in (told[0].message, told["rear"].message, *(r.message for r in told)))
    assert "rear" in told
    assert "in memory" not in told
    both = tf.identify([pd.DataFrame(fahrenheit), pd.DataFrame(fahrenheit)])
    assert [r.run for r in both] == ["in memory", "in memory", "in memory 2", "in memory 2"]
    assert both["in memory 2", "rear"].run == "in memory 2"
    assert ("in memory 2", "front") in both
    with pytest.raises(KeyError, match="of several runs"):
        both["rear"]
    named = {f"{name} [°F]" if name != "time_min" else name: values for name, values in fahrenheit.items()}
    both = tf.identify([pd.DataFrame(named), pd.DataFrame(named)])
    with pytest.raises(KeyError, match=re.escape("say ('in memory', 'rear')")):
        both["rear"]
    assert both["in memory 2", "rear"] == both["in memory 2", "rear [°F]"] == both[3]
    assert ("in memory", "rear") in both
    assert ("in memory", "side") not in both


def test_series_are_joined_by_their_labels_or_not_at_all():
    turned = pd.Series(np.linspace(26.0, 20.0, len(MINUTES)), index=np.arange(len(MINUTES))[::-1])
    with pytest.raises(tf.ThermofastError, match="another index than 'time_min'"):
        tf.read({"time_min": pd.Series(MINUTES), "T1": turned})
    stamps = [f"2026-03-01 {8 + int(m) // 60:02d}:{int(m) % 60:02d}:00" for m in MINUTES]
    frame = pd.DataFrame({"T1": turned.to_numpy()}, index=stamps)
    assert tf.read(frame).time_s[-1] == 60.0 * MINUTES[-1]
    one, other = tf.read(frame), tf.read(frame)
    assert one != other
    assert one in [other, one]


def test_results_can_be_looked_at_saved_and_drawn(told, tmp_path):
    table = told.to_frame()
    assert table.shape == (10, 55)
    assert table["steady_state_c"].tolist() == [r.steady_state_c for r in told]
    assert told.to_arrow().column("channel").to_pylist() == table["channel"].tolist()
    for suffix in (".csv", ".json", ".jsonl", ".parquet", ".md"):
        told.save(tmp_path / f"out{suffix}")
    assert pd.read_csv(tmp_path / "out.csv")["t95_min"].tolist() == table["t95_min"].tolist()
    with pytest.raises(tf.UsageError, match="cannot tell the format"):
        told.save(tmp_path / "out.doc")
    html = told._repr_html_()
    glance, whole = html.split("<details>")
    assert glance.count("<tr>") == 11
    assert "settles, degC" in glance
    assert "steady_state_c" not in glance
    assert "steady_state_c" in whole
    assert "T10" in glance
    head = (tmp_path / "out.md").read_text().splitlines()[0]
    assert "| steady_state_c |" in head
    assert "criterion" not in head  # nothing was asked, so every cell would be empty
    figure = told.plot(tmp_path / "a.png")
    assert figure is not None
    assert (tmp_path / "a.png").stat().st_size > 20_000
    named = tf.identify(tf.read({"time_min": np.arange(60.0), "<b>T1</b> temp": 20 + np.arange(60.0) ** 0.5}))
    assert "<b>T1" not in named._repr_html_()
    assert pickle.loads(pickle.dumps(told.records)) == told.records


def test_guesses_stand_in_the_rows_and_strict_refuses_them(frame):
    given = frame.rename(columns={"time_min": "Time"})
    found = tf.identify(given, until=60)
    assert all("'Time' has no unit, taken as min" in row["message"] for row in found.rows())
    with pytest.raises(tf.InputError, match="strict=True refuses"):
        tf.identify(given, strict=True)


def test_any_executor_carries_the_work(told):
    with ThreadPoolExecutor(2) as pool:
        done = []
        found = tf.identify(SPINDLE, until=60, executor=pool, jobs=2, progress=done.append)
    assert found.records == told.records
    assert sum(done) == 10


def test_a_run_cannot_be_written_to(frame):
    mine = np.array(frame["time_min"])
    run = tf.read({"time_min": mine, "T1": 20.0 + mine**0.5})
    for held in (run, pickle.loads(pickle.dumps(run))):
        with pytest.raises(ValueError, match="read-only"):
            held.channels["T1"][0] = 0.0
    mine[0] = mine[0]  # the caller's own stays his


def test_a_script_without_a_guard_is_run_once(tmp_path):
    script = tmp_path / "mine.py"
    script.write_text(
        "import thermofast as tf\nprint('begun')\n"
        f"print(*[r.status for r in tf.identify({str(SPINDLE)!r}, until=60, jobs=2)])\n"
        f"print(*[r.verdict for r in tf.diagnose({str(SPINDLE)!r}, effects=['second_mode'], jobs=2)])\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120)
    assert done.stdout.split("\n") == ["begun", " ".join(["ok"] * 10), " ".join(["none"] * 10), ""]
    assert done.stderr == ""


def test_the_loop_from_python(tmp_path):
    found = tf.improve(HIDDEN, auto=True)
    assert found.model.effects == ("second_mode",)
    assert found.model.channels == ("T1", "T2", "T3", "T4")
    assert {p["effect"] for p in found.model.parameters()} == {"", "second_mode"}
    found.model.save(tmp_path / "m.toml")
    loaded = tf.Model.load(tmp_path / "m.toml")
    assert loaded.file == found.model.file
    second = ROOT / "sample_runs" / "hidden_second_run.csv"
    for model in (found.model, loaded, tmp_path / "m.toml"):
        assert tf.compare(second, until=60, model=model)["T1"].rmse_ahead_c < 0.06
    assert tf.diagnose(second, model=loaded, effects=["load_step", "ambient"])[0].verdict == "none"
    assert tf.identify(second, until=60, model=loaded)["T1"].status == "ok"
    swept = tf.sweep(second, windows=[60], times=[30, 40, 50], model=loaded)
    assert swept[0].filter == "joint_fit"
    with pytest.raises(tf.UsageError, match=r"\.toml"):
        found.model.save(tmp_path / "m.json")


def test_the_other_analyses(frame):
    run = tf.read(frame)
    swept = tf.sweep(run, windows=[40, 45], times=range(10, 40, 10))
    assert len(swept) == 20
    assert swept.plot() is not None
    assert tf.compare(run, until=60).plot() is not None
    assert [r.filter for r in tf.bench(tf.read(frame, channels=["T1", "T5"]), until=60) if r.chosen] == ["afukf"]
    made = tf.simulate(effects="second_mode", sensors=2, seed=3)
    assert made.truth["effects"][0]["id"] == "second_mode"
    assert made.run().channels["T1"].tolist() == made.columns["T1"].tolist()
    assert made.to_frame()["T1"].tolist() == made.to_arrow()["T1"].to_pylist() == made.columns["T1"].tolist()
    assert tf.displacement(ROOT / "sample_runs" / "displacement.csv")[0].trusted
    spread = tf.sensitivity(tf.read(frame, channels=["T5"]), until=60)
    assert spread[0].channel == "T5"


def test_a_file_of_several_runs(tmp_path, frame):
    two = pd.concat([frame, frame])
    two.to_csv(tmp_path / "two.csv", index=False)
    assert len(tf.read_all(tmp_path / "two.csv")) == 2
    with pytest.raises(tf.InputError, match="2 runs"):
        tf.read(tmp_path / "two.csv")
    assert tf.read(f"{tmp_path / 'two.csv'}#2").channels["T1"].tolist() == frame["T1"].tolist()
    assert len(tf.identify(tmp_path / "two.csv", until=60)) == 20


def test_the_page_of_the_library_is_run(tmp_path, monkeypatch):
    import re

    (tmp_path / "sample_runs").symlink_to(ROOT / "sample_runs")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "api.md").read_text(), re.S)
    assert len(blocks) >= 4
    for block in blocks:
        exec(compile(block, "docs/api.md", "exec"), names)
    assert names["learnt"].model.effects == ("second_mode",)
    assert [r.steady_state_c for r in names["same"]] == [r.steady_state_c for r in names["result"]]


def test_the_notebook_runs(tmp_path, monkeypatch):
    import matplotlib as mpl

    mpl.use("Agg")
    book = json.loads((ROOT / "docs" / "notebook.ipynb").read_text())
    (tmp_path / "sample_runs").symlink_to(ROOT / "sample_runs")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    cells = [c for c in book["cells"] if c["cell_type"] == "code"]
    assert len(cells) >= 5
    compared = 0
    for cell in cells:
        *first, last = ast.parse("".join(cell["source"]).replace("%matplotlib inline", "")).body
        exec(compile(ast.Module(first, []), "docs/notebook.ipynb", "exec"), names)
        if not isinstance(last, ast.Expr):
            exec(compile(ast.Module([last], []), "docs/notebook.ipynb", "exec"), names)
            continue
        shown = eval(compile(ast.Expression(last.value), "docs/notebook.ipynb", "eval"), names)
        told = "".join(next((o["data"]["text/plain"] for o in cell["outputs"] if "text/plain" in o.get("data", {})), ""))
        if isinstance(shown, pd.DataFrame):
            # What the page shows is what the cells give, to the digits that another processor leaves.
            numbers = [[float(v) for v in re.findall(r"(?<![\w.])-?\d+\.\d+", text)] for text in (told, repr(shown))]
            assert numbers[0] == pytest.approx(numbers[1], abs=0.002)
            compared += len(numbers[0])
    assert compared > 60
    assert names["ahead"]["T1"].rmse_ahead_c < 0.06


def test_identify_loads_no_scipy():
    """It takes longer to load than ten sensors to identify."""
    code = (
        "import sys, thermofast as tf\n"
        "tf.identify('sample_runs/spindle.csv', until=60)\n"
        "print([name for name in sys.modules if name.startswith('scipy')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_the_catalogues_are_tables():
    effects = tf.effects().set_index("id")
    assert len(effects) >= 12
    assert effects.loc["second_mode", "equation"]
    own = tf.effects(str(ROOT / "sample_runs" / "my_effect.py"))
    assert len(own) == len(effects) + 1
    filters = tf.filter_catalogue().set_index("name")
    assert {"afukf", "ukf", "crpf"} <= set(filters.index)
    assert filters.loc["afukf", "settings"]


def test_results_compare_slice_and_refuse_in_words():
    record = {"time_min": np.arange(100.0), "a": 30.0 - 10.0 * np.exp(-np.arange(100.0) / 30.0)}
    record["b"] = record["a"] + 1.0
    one, two = tf.identify(record), tf.identify(record)
    assert one == two
    assert one != tf.identify(record, until=60)
    assert one != tf.compare(record)
    assert [r.channel for r in one[0:2]] == ["a", "b"]
    assert len(tf.sweep(record, windows=60)) == 2
    for call, words in (
        (lambda: tf.sweep(record, windows="an hour"), "windows: not a list of minutes"),
        (lambda: tf.identify(record, rates="OWN"), "rates: not one of what sensors may share"),
        (lambda: tf.identify(record, jobs=0), "jobs: not understood"),
    ):
        with pytest.raises(tf.UsageError, match=words):
            call()


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: tf.identify(SPINDLE, settings=3), "settings: not understood"),
        (lambda: tf.identify(SPINDLE, drive=3), "drive: not understood"),
        (lambda: tf.identify(SPINDLE, progress=3), "progress: not understood"),
        (lambda: tf.identify(SPINDLE, pace=1.5), "pace: not understood"),
        (lambda: tf.identify(SPINDLE, joint=1), "joint: not understood"),
        (lambda: tf.identify(SPINDLE, start=np.arange(2)), "start: not understood"),
        (lambda: tf.sweep(SPINDLE, rates=np.arange(2)), "rates: not understood"),
        (lambda: tf.diagnose(SPINDLE, effects=3), "effects: not understood"),
        (lambda: tf.diagnose(SPINDLE, effects=[3]), "effects: not understood"),
        (lambda: tf.diagnose(SPINDLE, effects={"load_step": 1}), "effects: not understood"),
        (lambda: tf.diagnose(SPINDLE, false_alarm=None), "false_alarm: None"),
        (lambda: tf.compare(SPINDLE, input_range=3), "input_range: not understood"),
        (lambda: tf.simulate(seed=None), "seed: None"),
        (lambda: tf.archive("identify", 3, "out"), "sources: not understood"),
        (lambda: tf.archive("identify", [str(SPINDLE)], "out", jobs=0), "jobs: not understood"),
        (lambda: tf.archive("identify", [str(SPINDLE)], "out", task_timeout="x"), "task_timeout: not understood"),
        (lambda: tf.displacement(SPINDLE, order=3), "order: not understood"),
        (lambda: tf.watch(3), "source: not a file to follow"),
        (lambda: tf.effects(3), "effects: not a file"),
        (lambda: tf.read({"time": np.arange(9).astype("timedelta64[M]"), "T1": np.arange(9.0)}), "months and years have no length"),
    ],
)
def test_arguments_of_another_kind_are_told(call, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(tf.ThermofastError, match=told):
        call()
    assert not list(tmp_path.iterdir())


def test_names_may_be_any_iterable_and_an_arrow_reader_is_read():
    one = tf.diagnose(SPINDLE, effects=(e for e in ["load_step", "sensor_lag"]))
    assert {r["effect"] for r in one[0].ranking} <= {"load_step", "sensor_lag"}
    table = pa.table({"time_min": np.arange(60.0), "T1": 20.0 + np.arange(60.0) ** 0.5})
    assert len(tf.read(table.to_reader()).time_s) == 60


def test_errors_name_keywords_where_keywords_were_given(frame):
    with pytest.raises(tf.UsageError) as told:
        tf.identify(SPINDLE, drive="power")
    assert "drive='power' is no logged input" in str(told.value)
    assert "name a column with inputs to make it one" in str(told.value)
    with pytest.raises(tf.InputError, match=r"strict=True refuses.*\n.*\n.*time_unit='min' confirms it"):
        tf.read(frame.rename(columns={"time_min": "Time"}), strict=True)
    with pytest.raises(tf.UsageError) as wrong:
        tf.read(SPINDLE, time="T99")
    assert "--" not in str(wrong.value)


def test_a_diagnosis_and_a_bench_have_pictures(tmp_path):
    found = tf.diagnose(HIDDEN)
    figure = found.plot(tmp_path / "d.png")
    assert (tmp_path / "d.png").stat().st_size > 5_000
    axis = figure.axes[0]
    assert axis.get_title() == "hidden.csv: second_mode"
    labels = [t.get_text() for t in axis.get_yticklabels()]
    assert labels == [one["effect"] for one in found[0].ranking]
    dots = axis.collections[0].get_offsets()
    assert np.asarray(dots)[:, 0] == pytest.approx([one["rmse_fit_c"] for one in found[0].ranking])
    bars = tf.bench(SPINDLE, until=60).plot().axes[0].patches
    assert bars[0].get_width() == pytest.approx(0.0585, abs=0.001)
    with pytest.raises(tf.UsageError, match="nothing to draw"):
        tf.diagnose({"time_min": np.arange(9.0), "T1": np.arange(9.0)}).plot(tmp_path / "none.png")


def test_runs_and_simulated_records_show_themselves():
    run = tf.read(
        {"time_min": np.arange(60.0), "<b>T1</b> temp": 20.0 + np.arange(60.0) ** 0.5, "room": np.full(60, 21.0)}, name="a<b"
    )
    assert repr(run) == "Run('a<b': 60 readings in 59 min of <b>T1</b> temp; beside them room)"
    shown = run._repr_html_()
    assert "&lt;b&gt;T1&lt;/b&gt; temp</td><td>sensor</td><td>20</td><td>27.68</td><td>0" in shown
    assert "<b>" not in shown
    assert "hidden: sensor_lag" in tf.simulate(effects=["sensor_lag"], sensors=2)._repr_html_()


def test_a_record_that_ends_just_before_the_identification_time_is_read_to_its_end():
    """By less than half of what lies between two readings, as of a logger that is no clock; by more it is refused."""
    time = np.arange(0.0, 30.0, 0.5)
    reading = 20.0 + 8.0 * -np.expm1(-time / 15.0) + 0.02 * np.random.default_rng(0).standard_normal(60)
    late = np.r_[time[:-1], 29.9]
    assert tf.identify({"time_min": late, "T1": reading}, until=30.0)["T1"].samples == 60
    with pytest.raises(tf.ThermofastError, match="longer than the record"):
        tf.identify({"time_min": time, "T1": reading}, until=30.0)


def test_rows_come_in_the_order_of_the_runs_and_the_results_know_short_ones():
    line = 20.0 + 6.0 * -np.expm1(-MINUTES / 30.0) + 0.02 * np.random.default_rng(5).standard_normal(120)
    runs = [tf.read({"time_min": MINUTES[:n], "T1": line[:n]}, name=name) for name, n in (("c", 30), ("b", 120), ("a", 40))]
    told = tf.identify(runs, until=60, details=True)
    assert [(r.run, r.status == "too_short") for r in told] == [("c", True), ("b", False), ("a", True)]
    assert [run.name for run in told.runs] == ["c", "b", "a"]
    assert [trace is not None for trace in told.traces] == [False, True, False]
    assert [r.run for r in tf.compare(runs, until=60)] == ["c", "b", "a"]


@pytest.mark.parametrize("reach", [-1.0, 0.0, float("nan"), "x", None, True])
def test_what_a_column_may_be_off_by_is_a_number_above_zero(reach):
    with pytest.raises(tf.ThermofastError, match=r"input_range ambient.*no number above zero"):
        tf.compare(HIDDEN, input_range={"ambient": reach})


def test_records_are_found_by_places_of_any_integer_kind_and_by_filter(told):
    assert told[np.int64(1)] == told[1]
    with pytest.raises(KeyError):
        told[True]
    bench = tf.bench(SPINDLE, until=60, channels=["T1"])
    assert bench["afukf"].filter == "afukf"
    with pytest.raises(KeyError, match="afukf"):
        bench["nobody"]


def test_a_setting_is_called_by_its_name():
    with pytest.raises(tf.ThermofastError, match="a setting is called by its name"):
        tf.identify(SPINDLE, until=60, settings={1: 2})


def test_one_window_may_be_a_number_of_numpy():
    assert tf.sweep(SPINDLE, windows=np.int64(45), times=[20, 40], channels=["T1"]) == tf.sweep(
        SPINDLE, windows=45, times=[20, 40], channels=["T1"]
    )


def test_the_words_of_reading_are_known_to_type_checkers():
    """As many as there are options, and the one that may be told with its unit; a misspelt one is found by mypy before it runs."""
    from thermofast.reading_options import Options, ReadingOptions

    assert {*ReadingOptions.__annotations__} == {f.name for f in fields(Options)} | {"interval"}
