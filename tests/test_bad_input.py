"""Bad input: exit 2, one message that says what, where, what is allowed and what to do; no traceback, no file left."""

import numpy as np
import pandas as pd
import pytest
from conftest import ROOT

import thermofast as tf
from benchmarks.reading.mutated import outcome

SPINDLE = str(ROOT / "sample_runs" / "spindle.csv")
GOOD = "time_min,T1\n" + "".join(f"{i},{18 + 8 * (1 - np.exp(-0.02 * i)):.3f}\n" for i in range(60))

FILES: dict[str, tuple[bytes, list[str]]] = {
    "empty.csv": (b"", ["empty.csv", "the file is empty"]),
    "blank.csv": (b"\n\n  \n", ["the file is empty"]),
    "header.csv": (b"time_min,T1\n", ["no row of readings"]),
    "binary.csv": (bytes(range(256)) * 40, ["binary data"]),
    "nulls.csv": (b"\x00\x01\x00\x02" * 500, ["binary data"]),
    "cut.parquet": (b"PAR1" + b"\x15\x04" * 400, ["cut.parquet", "not a readable Parquet"]),
    "not.parquet": (b"time_min,T1\n0,1\n1,2\n", ["not a readable Parquet"]),
    "notime.csv": (b"a,b\n1,5\n3,2\n2,9\n", ["no time column", "--time", "--interval"]),
    "one.csv": (b"time_min,T1\n0,20\n", ["1 row of readings"]),
    "words.csv": (GOOD.replace("5,18.761\n", "5,warm\n").encode(), ["line 7", "'T1'", "'warm'", "--missing"]),
    "ragged.csv": (GOOD.replace("7,19.045\n", "7,19.045,3\n").encode(), ["line 9", "3 cells", "the others 2"]),
    "times.csv": (b"timestamp,T1\n2026-01-01 10:00:00,20\n2026-01-01 10:61:00,21\n2026-01-01 10:02:00,22\n", ["line 3", "'2026-01-01 10:61:00'"]),
    "gap.csv": (b"time_min,T1\n0,20\n,21\n2,22\n3,23\n", ["line 3", "no time in this row"]),
    "inputs.csv": (b"time_min,speed\n0,1\n1,2\n2,2\n", ["no sensor column", "--channels"]),
    "still.csv": (b"time_min,T1\n1,2\n1,3\n1,4\n", ["same time stamp"]),
    "names.csv": (b"time_min\n0,1\n1,2\n2,3\n", ["2 cells", "header 1"]),
}  # fmt: skip


@pytest.mark.parametrize("command", ["identify", "sweep"])
@pytest.mark.parametrize("name", FILES)
def test_a_bad_file_is_named_and_explained(name, command, tool, tmp_path):
    content, told = FILES[name]
    path, out = tmp_path / name, tmp_path / "out.csv"
    path.write_bytes(content)
    done = tool(command, path, "-o", out)
    assert done.code == 2, done.err
    assert done.out == ""
    assert done.err.count("Error:") == 1
    for part in told:
        assert part in done.err
    assert not out.exists()
    assert list(tmp_path.iterdir()) == [path]


USAGE: dict[str, tuple[list[str], list[str]]] = {
    "missing file": (["identify", "nowhere.csv"], ["nowhere.csv: no such file"]),
    "near file": (["identify", str(ROOT / "sample_runs" / "spindel.csv")], ["no such file", "spindle.csv"]),
    "folder": (["identify", str(ROOT / "sample_runs")], ["a folder", "*.csv"]),
    "window too long": (["sweep", SPINDLE, "--windows", "500"], ["500 min is longer than the record", "400 min"]),
    "no time below": (["sweep", SPINDLE, "--windows", "40", "--times", "50:60:1"], ["no identification time lies below the window of 40"]),
    "until too long": (["identify", SPINDLE, "--until", "900"], ["longer than the record"]),
    "times": (["sweep", SPINDLE, "--times", "a:b"], ["--times", "'a:b'", "FIRST:LAST:STEP"]),
    "windows": (["sweep", SPINDLE, "--windows", "0,-3"], ["--windows", "above zero"]),
    "endless": (["sweep", SPINDLE, "--times", "1:5:0"], ["--times"]),
    "filter": (["identify", SPINDLE, "--filter", "kf"], ["unknown filter 'kf'", "afukf, fading_ukf, ukf, ekf, svd_ukf"]),
    "preset": (["identify", SPINDLE, "--filter", "ukf", "--preset", "paper"], ["--preset paper does not apply", "afukf, fading_ukf"]),
    "set form": (["identify", SPINDLE, "--set", "gate"], ["filter.setting=value"]),
    "set whole": (["identify", SPINDLE, "--filter", "crpf", "--set", "crpf.particles=200.5"], ["not a whole number"]),
    "set owner": (["identify", SPINDLE, "--set", "nope.gate=1"], ["unknown filter 'nope'"]),
    "set other": (["identify", SPINDLE, "--set", "ukf.gate=1"], ["is for ukf", "--filter ukf"]),
    "set key": (["identify", SPINDLE, "--set", "afukf.speed=1"], ["no setting 'speed'", "gate"]),
    "set none": (["identify", SPINDLE, "--filter", "ekf", "--set", "ekf.speed=1"], ["this filter has no settings"]),
    "set value": (["identify", SPINDLE, "--set", "afukf.gate=x"], ["not a number", "2 to 100"]),
    "set range": (["identify", SPINDLE, "--set", "afukf.gate=1"], ["out of range"]),
    "set switch": (["identify", SPINDLE, "--set", "afukf.closing_step=2"], ["true or false"]),
    "suffix": (["identify", SPINDLE, "-o", "out.doc"], [".doc", ".parquet"]),
    "no folder": (["identify", SPINDLE, "-o", "nowhere/out.csv"], ["no folder 'nowhere'"]),
    "picture suffix": (["identify", SPINDLE, "--save-plot", "x.txt"], [".png"]),
    "trace picture alone": (["identify", SPINDLE, "--plot-trace"], ["--save-plot"]),
    "start": (["identify", SPINDLE, "--start", "soon"], ["--start", "auto"]),
    "channel": (["identify", SPINDLE, "--channels", "T77"], ["'T77' is no column", "T1, T2"]),
    "ambient": (["identify", SPINDLE, "--ambient", "x"], ["--ambient 'x'"]),
    "twice": (["identify", SPINDLE, SPINDLE], ["the same RUN twice"]),
    "delimiter": (["identify", SPINDLE, "--delimiter", "ab"], ["one character"]),
    "encoding": (["identify", SPINDLE, "--encoding", "utf-99"], ["utf-99"]),
    "none": (["identify"], ["no RUN given"]),
    "sweep none": (["sweep"], ["no RUN given", "thermofast.toml"]),
    "command": (["identfy"], ["No such command"]),
    "option": (["identify", SPINDLE, "--wat"], ["--wat"]),
    "unknown filter page": (["filters", "kf"], ["unknown filter 'kf'"]),
    "config": (["--config", "nowhere.toml", "identify", SPINDLE], ["nowhere.toml: no such file"]),
    "simulate suffix": (["simulate", "-o", "x.txt"], [".csv .parquet"]),
    "simulate sensor": (["simulate", "-o", "x.csv", "--sensor", "T5=hot"], ["NAME=DEGC:MIN"]),
    "simulate twice": (["simulate", "-o", "x.csv", "--sensor", "A=1:2", "--sensor", "A=3:4"], ["same name twice"]),
    "simulate size": (["simulate", "-o", "x.csv", "--duration", "1e9", "--interval", "0.1"], ["too many readings"]),
}  # fmt: skip


@pytest.mark.parametrize("name", USAGE)
def test_bad_usage_is_explained(name, tool, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, told = USAGE[name]
    done = tool(*arguments)
    assert done.code == 2, done.err
    assert done.out == ""
    for part in told:
        assert part in done.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("speed = 3\n", ["'speed' is not known", "[input] time time_unit", "[compare], ...: options of that command"]),
        ("[sweep]\nwindow = [40]\n", ["[sweep] has no key 'window'", "tolerance tz units windows", "did you mean 'windows'?"]),
        ('[sweep]\ntolerance = "half"\n', ["[sweep] tolerance: not a number", "found: 'half'"]),
        ("[compare]\nuntil = [1, 2]\n", ["[compare] until: not a number", "found: [1, 2]"]),
        ('[input]\ndecimal = ";"\n', ["$.input.decimal"]),
        ("sweep = 3\n", ["[sweep] is no table"]),
        ("runs = [\n", ["not valid TOML"]),
    ],
)
def test_a_bad_settings_file_lists_the_known_keys(text, told, tool, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thermofast.toml").write_text(text)
    done = tool("sweep", SPINDLE)
    assert done.code == 2
    for part in ["thermofast.toml", *told]:
        assert part in done.err


def test_when_no_run_can_be_read_all_are_named(tool, tmp_path):
    (tmp_path / "a.csv").write_text("")
    done = tool("identify", tmp_path / "a.csv", tmp_path / "b.csv")
    assert done.code == 2
    assert "a.csv: the file is empty" in done.err
    assert "b.csv: no such file" in done.err


def test_names_that_look_like_formulas_are_harmless_in_csv(tool, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(GOOD.replace("T1", '"=run|x"'))
    done = tool("identify", path, "--format", "csv", "-q")
    assert done.code == 0
    assert "'=run|x" in done.out
    assert '"=run|x"' in tool("identify", path, "--format", "json", "-q").out


def test_nothing_is_left_where_a_file_cannot_be_written(tool, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("thermofast.output.whole.os.replace", refuse)
    done = tool("identify", SPINDLE, "-q", "-o", tmp_path / "out.csv")
    assert done.code == 2
    assert "No space left" in done.err
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr("thermofast.output.whole.tempfile.mkstemp", refuse)
    assert "cannot be written" in tool("identify", SPINDLE, "-q", "-o", tmp_path / "out.csv").err
    (tmp_path / "folder.csv").mkdir()
    assert "a folder stands there" in tool("identify", SPINDLE, "-o", tmp_path / "folder.csv").err


def test_pictures_without_matplotlib_say_what_to_install(tool, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    done = tool("identify", SPINDLE, "--save-plot", tmp_path / "a.png")
    assert done.code == 2
    assert "thermofast[plot]" in done.err


def test_no_sensor_to_draw_is_said(tool, tmp_path):
    path = tmp_path / "flat.csv"
    path.write_text("time_min,T1\n" + "".join(f"{i},20\n" for i in range(60)))
    assert "nothing to draw" in tool("identify", path, "-q", "--save-plot", tmp_path / "a.png").err
    assert "nothing to draw" in tool("sweep", path, "-q", "--save-plot", tmp_path / "a.png").err


def test_a_parquet_without_rows_or_with_odd_columns(tool, tmp_path):
    frame = pd.DataFrame({"time_min": np.arange(30.0), "T": 20 + np.arange(30.0) ** 0.5, "odd": [[1]] * 30})
    path = tmp_path / "odd.parquet"
    frame.to_parquet(path)
    done = tool("identify", path, "--format", "jsonl")
    assert done.code == 0
    assert "'odd'" in done.err
    frame[:0].drop(columns="odd").to_parquet(path)
    assert tool("identify", path).code == 2


def test_columns_and_sensors_that_tell_nothing_are_said_to(tmp_path):
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 201.0)
    rise = 20.0 - 10.0 * np.expm1(-time / 40.0) + 0.02 * rng.standard_normal(201)
    flow = np.where((time > 50) & (time < 91), np.nan, 5.0)
    data = {"time_min": time, "T1": rise, "T2": 20.0 + 0.02 * rng.standard_normal(201), "flow": flow}
    first, second = tf.diagnose(tf.read(data, inputs="flow"), drive="flow")
    assert (first.verdict, second.verdict) == ("none", "none")
    assert "flow: 40 of 201 readings are missing, filled by straight lines" in first.message
    assert "the drive flow never moves" in first.message
    assert "no rise to learn from" in second.message
    assert "no rise to learn from" not in first.message


@pytest.mark.parametrize("first", [0, pytest.param(200, marks=pytest.mark.proof)])
def test_damaged_files_are_read_or_refused_in_words_and_at_once(first):
    assert [(n, said) for n, said in outcome(range(first, first + 200)) if said not in ("read", "refused")] == []
