"""The tool as a user calls it: commands, formats, settings file, pool and interrupts."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from conftest import ROOT

from thermofast.output.pipe import whole
from thermofast.records import IdentifyRecord, SweepRecord
from thermofast.workers import flow, pool

SPINDLE = ROOT / "sample_runs" / "spindle.csv"
TOOL = [sys.executable, "-m", "thermofast"]


def test_identify_prints_the_columns_of_the_design(tool):
    done = tool("identify", SPINDLE, "--until", 60, "--format", "json")
    assert done.code == 0
    document = json.loads(done.out)
    assert document["schema"] == "thermofast.identify/1"
    records = document["records"]
    assert len(records) == 10
    assert list(records[0]) == list(IdentifyRecord.columns())
    truth = json.loads((ROOT / "sample_runs" / "spindle.key.json").read_text())["sensors"]
    inside = sum(
        r["steady_state_lo_c"] <= s["steady_state_c"] <= r["steady_state_hi_c"] for r, s in zip(records, truth, strict=True)
    )
    assert inside >= 8
    assert "10 sensors" in done.err
    assert "surroundings: ambient" in done.err


@pytest.mark.parametrize("form", ["table", "csv", "json", "jsonl", "md"])
def test_every_format_has_every_sensor(form, tool):
    done = tool("identify", SPINDLE, "--format", form, "-q")
    assert done.code == 0
    assert done.err == ""
    for i in range(1, 11):
        assert f"T{i}" in done.out


def test_files_are_written_in_the_format_of_their_suffix(tool, tmp_path):
    frames = {}
    for suffix in ("csv", "json", "jsonl", "parquet", "md"):
        path = tmp_path / f"out.{suffix}"
        assert tool("identify", SPINDLE, "--until", 100, "-q", "-o", path).code == 0
        frames[suffix] = path
    csv, parquet = pd.read_csv(frames["csv"]), pd.read_parquet(frames["parquet"])
    lines = [json.loads(line) for line in frames["jsonl"].read_text().splitlines()]
    assert csv["steady_state_c"].tolist() == parquet["steady_state_c"].tolist() == [x["steady_state_c"] for x in lines]
    assert json.loads(frames["json"].read_text())["records"] == lines
    assert frames["md"].read_text().startswith("| run | channel |")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in frames.values())


def test_several_runs_standard_input_and_a_bad_one_among_them(tool, tmp_path):
    bad = tmp_path / "bad.csv"
    bad.write_text("nothing here\n")
    done = tool("identify", SPINDLE, ROOT / "sample_runs" / "cool_down.csv", bad, "--format", "jsonl")
    assert done.code == 1
    rows = [json.loads(line) for line in done.out.splitlines()]
    assert len(rows) == 21
    assert rows[-1]["status"] == "unreadable"
    assert "bad.csv" in rows[-1]["message"]
    piped = tool("identify", "-", "--format", "jsonl", "-q", stdin=SPINDLE.read_bytes())
    named = tool("identify", SPINDLE, "--format", "jsonl", "-q")
    strip = [{**json.loads(line), "run": ""} for line in piped.out.splitlines()]
    assert strip == [{**json.loads(line), "run": ""} for line in named.out.splitlines()]
    assert tool("identify", stdin=SPINDLE.read_bytes()).code == 0


def test_one_bad_sensor_is_a_row_and_exit_one(tool):
    done = tool("identify", ROOT / "sample_runs" / "gaps_and_bad_cells.csv", "--format", "jsonl", "-q")
    assert done.code == 1
    rows = {json.loads(line)["channel"]: json.loads(line) for line in done.out.splitlines()}
    assert rows["T5"]["status"] == "no_data"
    assert rows["T5"]["steady_state_c"] is None
    for name, truth in {"T1": 25.4, "T2": 25.9, "T3": 26.3, "T4": 26.1}.items():
        assert rows[name]["steady_state_c"] == pytest.approx(truth, abs=0.03)
    assert "outlier" in rows["T3"]["message"]
    assert "overload" in rows["T2"]["message"]


@pytest.mark.parametrize("name", ["afukf", "fading_ukf", "ukf", "ekf", "least_squares"])
def test_every_filter_runs_on_the_sample(name, tool):
    done = tool("identify", SPINDLE, "--filter", name, "--format", "jsonl", "-q", "--channels", "T5")
    row = json.loads(done.out)
    assert row["filter"] == name
    assert row["steady_state_c"] == pytest.approx(26.7, abs=0.05)


def test_the_paper_preset_diverges_and_a_setting_changes_the_result(tool):
    done = tool("identify", SPINDLE, "--preset", "paper", "--format", "jsonl", "-q")
    assert done.code == 1
    assert {json.loads(line)["status"] for line in done.out.splitlines()} == {"diverged"}
    common = ("identify", SPINDLE, "--channels", "T5", "--until", 200, "--format", "csv", "-q")
    plain, off = tool(*common).out, tool(*common, "--set", "afukf.closing_step=false").out
    gated = tool(*common, "--set", "afukf.gate=2").out
    assert len({plain, off, gated}) == 3
    alone = ("identify", SPINDLE, "--channels", "T5", "--until", 60, "--format", "jsonl", "-q", "--filter", "ukf")
    symmetric, scaled = (json.loads(tool(*alone, *extra).out) for extra in ((), ("--set", "ukf.spread=0.5")))
    assert symmetric["steady_state_c"] != scaled["steady_state_c"]
    assert scaled["steady_state_c"] == pytest.approx(symmetric["steady_state_c"], abs=0.05)


def test_sweep_and_its_columns(tool):
    done = tool("sweep", "--windows", "40,45,50,55", SPINDLE, "--channels", "T5,T8", "--format", "json")
    assert done.code == 0
    document = json.loads(done.out)
    assert document["schema"] == "thermofast.sweep/1"
    assert [r["window_min"] for r in document["records"]] == [40, 45, 50, 55] * 2
    assert list(document["records"][0]) == list(SweepRecord.columns())
    for r in document["records"]:
        assert 5 <= r["best_time_min"] < r["window_min"]
        assert isinstance(r["agreed"], bool)
    loose = tool(
        "sweep", "--times", "10:200:10", "--windows", "200", "--tolerance", "1", SPINDLE, "--channels", "T5", "--format", "json"
    )
    record = json.loads(loose.out)["records"][0]
    assert 20 <= record["tolerance_time_min"] <= 150
    assert tool("sweep", SPINDLE, "--format", "table", "-q").out.count("T10") >= 4


def test_pictures_and_the_trace(tool, tmp_path):
    picture, swept, trace = tmp_path / "a.png", tmp_path / "b.svg", tmp_path / "t.parquet"
    runs = [SPINDLE, ROOT / "sample_runs" / "cool_down.csv"]
    done = tool(
        "identify", *runs, "--until", 40, "-q", "--channels", "T1,T5", "--save-plot", picture, "--plot-trace", "--trace", trace
    )
    assert done.code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    frame = pd.read_parquet(trace)
    assert len(frame) == 2 * 2 * 41
    last = frame[(frame["run"] == str(SPINDLE)) & (frame["channel"] == "T5")].iloc[-1]
    assert last["steady_state_c"] == pytest.approx(26.7, abs=1.0)
    assert last["rate_sd_per_min"] > 0
    assert last["measurement_noise_k2"] == pytest.approx(0.0004, rel=0.8)
    assert tool("sweep", SPINDLE, "-q", "--channels", "T5", "--save-plot", swept).code == 0
    assert b"<svg" in swept.read_bytes()[:2000]
    assert tool("identify", SPINDLE, "-q", "--save-plot", tmp_path / "whole.png").code == 0


def test_filters_lists_and_explains(tool):
    listing = tool("filters")
    told = [line.split()[0] for line in listing.out.splitlines()]
    assert told[:4] == ["afukf", "fading_ukf", "ukf", "ekf"]
    assert {"svd_ukf", "ckf", "cqkf", "ast_cqkf", "crpf", "acrpf", "rls", "least_squares"} == set(told[4:])
    one = tool("filters", "afukf").out
    assert "afukf.forgetting = 0.9" in one
    assert "closing_step = true" in one


def test_simulate_repeats_itself_and_identify_recovers_its_truth(tool, tmp_path):
    for name in ("a", "b"):
        done = tool(
            "simulate", "--seed", 7, "-o", tmp_path / f"{name}.csv", "--key", tmp_path / f"{name}.json", "--sensor", "T2=30:120"
        )
        assert done.code == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    truth = {s["channel"]: s for s in json.loads((tmp_path / "a.json").read_text())["sensors"]}
    assert truth["T2"]["steady_state_c"] == 30.0
    rows = [json.loads(x) for x in tool("identify", tmp_path / "a.csv", "--format", "jsonl", "-q").out.splitlines()]
    for row in rows:
        assert row["steady_state_c"] == pytest.approx(truth[row["channel"]]["steady_state_c"], abs=0.05)
        assert row["t95_min"] == pytest.approx(truth[row["channel"]]["t95_min"], rel=0.03)
    fast = tool(
        "simulate", "-o", tmp_path / "f.parquet", "--interval", 5, "--duration", 30, "--cooling", "--sensors", 2, "--step", 0
    )
    assert fast.code == 0
    assert pd.read_parquet(tmp_path / "f.parquet").shape == (361, 4)


def test_the_settings_file_speaks_where_the_command_line_is_silent(tool, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thermofast.toml").write_text(
        f'runs = ["{SPINDLE}"]\nset = ["afukf.gate=6"]\n[input]\nchannels = ["T5"]\nstart = 0\n[identify]\nuntil = 50\n'
        '[sweep]\nwindows = [40, 45]\ntimes = "10:40:5"\n'
    )
    row = json.loads(tool("identify", "--format", "jsonl", "-q").out)
    assert (row["channel"], row["until_min"]) == ("T5", 50.0)
    rows = [json.loads(x) for x in tool("sweep", "--format", "jsonl", "-q").out.splitlines()]
    assert [r["window_min"] for r in rows] == [40.0, 45.0]
    other = tool("identify", ROOT / "sample_runs" / "cool_down.csv", "--channels", "T1", "--until", 99, "--format", "jsonl", "-q")
    assert json.loads(other.out)["until_min"] == 99.0
    other = tmp_path / "other.toml"
    other.write_text("[sweep]\ntolerance = 0.2\n")
    assert tool("--config", other, "sweep", SPINDLE, "-q", "--channels", "T1").code == 0


def test_every_command_has_a_table_of_its_own_options(tool, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hidden = ROOT / "sample_runs" / "hidden.csv"
    (tmp_path / "thermofast.toml").write_text(
        f'runs = ["{hidden}"]\n[input]\nchannels = ["T1", "T2"]\n[compare]\nuntil = 120\nunknown_heat = true\n'
        '[diagnose]\neffects = ["load_step", "second_mode"]\n[changed]\nnew = ["later.csv"]\n[inspect]\nformat = "json"\n'
    )
    compared = json.loads(tool("compare", "--format", "json", "-q").out)["records"]
    assert [(r["channel"], r["until_min"], bool(r["unknown_heat"])) for r in compared] == [("T1", 120.0, True), ("T2", 120.0, True)]
    diagnosed = json.loads(tool("diagnose", "--format", "json", "-q").out)["records"]
    assert {e["effect"] for e in diagnosed[0]["ranking"]} == {"load_step", "second_mode"}
    assert [r["role"] for r in json.loads(tool("inspect", "-q").out)["records"]][:3] == ["time", "sensor", "sensor"]
    # What stands on the command line wins, and [input] holds for commands that compare runs too.
    assert json.loads(tool("compare", "--until", "200", "--format", "json", "-q").out)["records"][0]["until_min"] == 200.0
    second = ROOT / "sample_runs" / "hidden_second_run.csv"
    changed = tool("changed", hidden, "--new", second, "--format", "json", "-q")
    assert "T3" not in changed.out
    assert "later.csv" in tool("changed", hidden, "-q").err


def test_results_do_not_depend_on_jobs(tool):
    one = tool("identify", SPINDLE, "--jobs", 1, "--format", "csv", "-q").out
    assert tool("identify", SPINDLE, "--jobs", 2, "--format", "csv", "-q").out == one
    assert (
        tool("sweep", SPINDLE, "--jobs", 2, "--format", "csv", "-q").out
        == tool("sweep", SPINDLE, "--jobs", 1, "--format", "csv", "-q").out
    )


def die_on_three(numbers):
    if 3 in numbers:
        os._exit(1)
    return [n * 10 for n in numbers]


def always_die(task):
    number, log = task
    with open(log, "a") as out:
        out.write(f"{number}\n")
    os._exit(1)


def test_a_dying_worker_costs_one_sensor():
    tasks = [[1, 2], [3, 4], [5, 6]]

    def split(task):
        return [[n] for n in task]

    def lost(task, why):
        assert "died" in why
        return [-n for n in task]

    results = [r for part in flow.in_order(flow.Flow(die_on_three, split, lost), tasks, flow.Local(2)) for r in part]
    assert results == [10, 20, -3, 40, 50, 60]


def test_when_every_worker_dies_the_retries_end(tmp_path):
    log = tmp_path / "attempts"
    tasks = [(n, str(log)) for n in range(30)]
    dying = flow.Flow(always_die, lambda t: [t], lambda t, why: [-1])
    results = [r for part in flow.in_order(dying, tasks, flow.Local(2)) for r in part]
    assert results == [-1] * 30
    assert len(log.read_text().splitlines()) <= 2 * flow.AHEAD + flow.MOST_FAILURES < 10


def test_any_executor_may_be_passed_in():
    with ThreadPoolExecutor(2) as threads:
        sorting = flow.Flow(sorted, lambda t: [t], lambda t, why: [])
        results = [r for part in flow.in_order(sorting, [[2, 1], [4, 3]], flow.Given(threads, 2)) for r in part]
    assert results == [1, 2, 3, 4]


def troubled(numbers):
    for n in numbers:
        if n == 3:
            raise MemoryError("no room for 3")
        if n == 4:
            time.sleep(60.0)
        if n == 5:
            os.kill(os.getpid(), signal.SIGSEGV)
        if n == 6:
            return [lambda: 6]  # cannot be sent back
    return [n * 10 for n in numbers]


def test_each_kind_of_failure_costs_one_sensor_and_is_named():
    told = {}

    def lost(task, why):
        told[task[0]] = why
        return [-n for n in task]

    tasks = [[1, 2], [3, 30], [7, 4], [5, 8], [6, 9], [10, 11]]
    trying = flow.Flow(troubled, lambda t: [[n] for n in t], lost, lambda parts: [p[0] for p in parts], limit_s=6.0)
    results = [r for part in flow.in_order(trying, tasks, flow.Local(2)) for r in part]
    assert results == [10, 20, -3, 300, 70, -4, -5, 80, -6, 90, 100, 110]
    assert "out of memory: no room for 3" in told[3]
    assert "did not end within 6 s" in told[4]
    assert "the worker process died" in told[5]
    assert "its work failed" in told[6]


def test_somebodys_executor_that_breaks_is_replaced():
    theirs = pool.new_pool(1)
    tasks = [[1, 2], [3, 4], [5, 6]]
    dying = flow.Flow(die_on_three, lambda t: [[n] for n in t], lambda t, why: [-n for n in t])
    results = [r for part in flow.in_order(dying, tasks, flow.Given(theirs, 1)) for r in part]
    theirs.shutdown()
    assert results == [10, 20, -3, 40, 50, 60]


PARENT = """
import os, sys, time
from thermofast.workers.pool import new_pool
if __name__ == "__main__":
    pool = new_pool(2)
    print(*{f.result() for f in [pool.submit(os.getpid) for _ in range(20)]}, flush=True)
    pool.submit(time.sleep, 600)
    time.sleep(600)
"""


def test_no_worker_outlives_a_parent_that_is_killed(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert parent.stdout is not None
    workers = [int(word) for word in parent.stdout.readline().split()]
    parent.kill()
    parent.communicate()
    for _ in range(100):
        left = [
            pid for pid in workers if Path(f"/proc/{pid}").exists() and "Z" not in Path(f"/proc/{pid}/stat").read_text().split()[2]
        ]
        if not left:
            break
        time.sleep(0.1)
    assert workers
    assert left == []


def test_the_work_decides_on_processes(monkeypatch):
    monkeypatch.setattr(pool, "cores", lambda: 8)
    assert pool.worth(10, 401) == 1
    assert pool.worth(3000, 401) == 1  # half a second of work
    assert pool.worth(10_000, 401) == 2
    assert pool.worth(100_000, 401) == 8
    assert pool.warm_pool(1, 10**9) is None
    assert pool.warm_pool(None, 1000) is None
    assert pool.cores() == 8


def test_an_interrupt_keeps_what_is_finished(tmp_path):
    rng = np.random.default_rng(0)
    t = np.arange(401.0)
    frame = pd.DataFrame(
        {"time_min": t} | {f"T{i}": 20 + 8 * (1 - np.exp(-0.015 * t)) + 0.02 * rng.standard_normal(401) for i in range(6000)}
    )
    path = tmp_path / "big.parquet"
    frame.to_parquet(path)
    process = subprocess.Popen(
        [*TOOL, "identify", str(path), "--jobs", "1", "--format", "jsonl"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=ROOT,
        # A suite that was started in the background would hand its deaf ear on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stderr is not None
    process.stderr.readline()
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"Traceback" not in err
    finished = int(re.search(rb"interrupted: (\d+) records", err).group(1))
    assert len(out.splitlines()) == finished < 6000
    for line in out.splitlines()[:5]:
        assert json.loads(line)["status"] == "ok"


def test_a_reader_that_goes_away_is_no_error():
    command = f"{sys.executable} -m thermofast identify {SPINDLE} -q --format jsonl | head -1"
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, cwd=ROOT, check=False)
    assert b"Traceback" not in done.stderr
    assert json.loads(done.stdout)["channel"] == "T1"


def test_help_is_quick_to_import_nothing_heavy():
    code = "import sys; from thermofast.main import cli; cli.main(['--help'], standalone_mode=False); print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    loaded = done.stdout
    for heavy in ("'numpy'", "'scipy'", "'pandas'", "'pyarrow'", "'rich'", "'matplotlib'"):
        assert heavy not in loaded


def test_the_sample_runs_are_what_their_script_makes(tmp_path):
    subprocess.run(
        [sys.executable, ROOT / "sample_runs" / "make.py", tmp_path],
        check=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    for made in tmp_path.iterdir():
        kept = ROOT / "sample_runs" / made.name
        if made.suffix == ".parquet":
            assert pd.read_parquet(made).equals(pd.read_parquet(kept))
        else:
            assert made.read_bytes() == kept.read_bytes(), made.name


def test_python_m_is_the_same_tool():
    done = subprocess.run([*TOOL, "--version"], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.startswith("thermofast, version")
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.dev\d+)?", done.stdout.split()[-1])


def test_one_outlier_does_not_move_the_sweep(tool, tmp_path):
    frame = pd.read_csv(SPINDLE)[["time_min", "T5"]]
    frame.to_csv(tmp_path / "clean.csv", index=False)
    frame.loc[[10, 48], "T5"] += 15.0
    frame.to_csv(tmp_path / "outlier.csv", index=False)
    clean, outlier = (
        [json.loads(x) for x in tool("sweep", tmp_path / f"{name}.csv", "--format", "jsonl", "-q").out.splitlines()]
        for name in ("clean", "outlier")
    )
    for a, b in zip(clean, outlier, strict=True):
        assert b["rmse_c"] == pytest.approx(a["rmse_c"], rel=0.15)
        assert abs(b["shortest_time_min"] - a["shortest_time_min"]) <= 12


def test_every_filter_doubts_a_record_that_falls_again(tool, tmp_path):
    t = np.arange(120.0)
    y = np.where(t < 60, 30 - 12 * np.exp(-t / 25), 21.0) + 0.02 * np.random.default_rng(0).standard_normal(120)
    pd.DataFrame({"time_min": t, "T": y}).to_csv(tmp_path / "fall.csv", index=False)
    for name in ("afukf", "ukf", "ekf", "fading_ukf", "least_squares"):
        done = tool("identify", tmp_path / "fall.csv", "--filter", name, "--format", "jsonl", "-q")
        assert json.loads(done.out)["status"] in {"model_doubtful", "not_determined"}, name


def test_odd_names_and_places_give_no_traceback(tool, tmp_path, monkeypatch):
    folder = tmp_path / "[red]"
    folder.mkdir()
    odd = folder / "[bold].csv"
    odd.write_bytes(SPINDLE.read_bytes())
    assert tool("identify", odd, "--format", "table", "-q").code == 0
    assert tool("identify", SPINDLE, "-q", "-o", tmp_path / ("n" * 300 + ".csv")).code == 2
    for arguments in (
        ["identify", SPINDLE, "--until", "nan"],
        ["sweep", SPINDLE, "--tolerance", "inf"],
        ["simulate", "-o", tmp_path / "x.csv", "--rise", "nan"],
        ["simulate", "-o", tmp_path / "x.csv", "--sensor", "a,b=30:60"],
        ["simulate", "-o", tmp_path / "x.csv", "--sensor", "ambient=30:60"],
        ["identify", SPINDLE, "--start", 900],
    ):
        assert tool(*arguments).code == 2
    copy = tmp_path / "run.csv"
    copy.write_bytes(SPINDLE.read_bytes())
    done = tool("identify", copy, "-o", copy)
    assert done.code == 2
    assert "would overwrite the record" in done.err
    assert tool("identify", copy, "-o", tmp_path / "x.csv", "--trace", tmp_path / "x.csv").code == 2
    assert copy.read_bytes() == SPINDLE.read_bytes()
    for words in (["identify", str(SPINDLE), "-q"], ["--help"]):
        for buffered in ("", "1"):  # PYTHONUNBUFFERED, as containers set it
            with open("/dev/full", "w") as full:
                environment = os.environ | {"PYTHONUNBUFFERED": buffered}
                done = subprocess.run([*TOOL, *words], stdout=full, stderr=subprocess.PIPE, cwd=ROOT, env=environment, check=False)
            assert done.returncode == 2
            assert b"Traceback" not in done.stderr
            assert b"ignored" not in done.stderr
            assert b"make room there" in done.stderr


def test_a_file_that_may_not_be_read_is_a_row_and_the_others_are_worked_on(tool, tmp_path, monkeypatch):
    """Named beside others; whoever runs the suite may read all."""
    closed = tmp_path / "closed.csv"
    closed.write_bytes(SPINDLE.read_bytes())
    real = os.access
    monkeypatch.setattr(os, "access", lambda path, mode, **more: str(path) != str(closed) and real(path, mode, **more))
    done = tool("identify", SPINDLE, closed, "--channels", "T5", "--until", 60, "-q")
    assert done.code == 0
    assert done.out.count("T5") == 2


def test_a_working_folder_that_is_gone_is_named(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    code = f"import os, shutil, sys; os.chdir({str(gone)!r}); shutil.rmtree({str(gone)!r}); from thermofast.main import run; run(['identify', 'a.csv'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "the working folder is gone" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_a_full_disk_takes_in_part_is_written_whole():
    """A file without a buffer that takes three bytes at a time, as one does whose disk is nearly full."""

    class Narrow(io.RawIOBase):
        taken = b""

        def writable(self):
            return True

        def write(self, data):
            self.taken += bytes(data[:3])
            return len(data[:3])

    narrow = Narrow()
    stream = whole(SimpleNamespace(buffer=narrow, encoding="utf-8", errors="strict"))
    stream.write("steady state 26.8 degC\n")
    stream.flush()
    assert narrow.taken == b"steady state 26.8 degC\n"
    already = io.TextIOWrapper(io.BytesIO())
    assert whole(already) is already


def test_other_packages_and_folders_called_filters_and_models_do_not_matter(tmp_path):
    for name in ("filters", "models", "thermofast_cli"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise RuntimeError('not mine')")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    for command in (["filters"], ["identify", str(SPINDLE), "--channels", "T5", "-q"]):
        done = subprocess.run([*TOOL, *command], capture_output=True, text=True, env=environment, cwd=tmp_path, check=False)
        assert (done.returncode, done.stderr) == (0, "")


def test_the_key_of_a_hidden_effect_tells_where_the_readings_come_to(tool, tmp_path):
    """The limit by its closed form: heat and bent loss are equal, and a load that stepped carries its rise with it."""

    def key(effect):
        assert (
            tool("simulate", "--effects", effect, "--seed", "5", "-o", tmp_path / "a.csv", "--key", tmp_path / "a.json").code == 0
        )
        return json.loads((tmp_path / "a.json").read_text())

    def numbers(found):
        sensor = found["sensors"][0]
        return sensor, sensor["lump"], found["effects"][0]["parameters"]

    sensor, lump, told = numbers(key("nonlinear_loss"))
    rise = lump["steady_state_c"] - sensor["initial_c"]
    e = told["exponent"]
    assert sensor["steady_state_c"] == pytest.approx(sensor["initial_c"] + (rise * 40.0**e) ** (1.0 / (1.0 + e)), abs=0.01)
    sensor, lump, told = numbers(key("load_step"))
    assert sensor["steady_state_c"] == pytest.approx(sensor["initial_c"] + rise * (1.0 + told["change"]), abs=0.02)
    assert sensor["t95_min"] > lump["t95_min"] > 0.0
    drifts = key("sensor_drift")["sensors"]
    assert [s["steady_state_c"] is None for s in drifts].count(True) == 1


def test_an_effect_of_heat_is_not_hidden_where_there_is_none(tool, tmp_path):
    done = tool("simulate", "--cooling", "--effects", "load_step", "-o", tmp_path / "a.csv", "--key", tmp_path / "a.json")
    assert done.code == 2
    assert "effect 'load_step' changes nothing in this record" in done.err
    assert "a machine that cools has no heat" in done.err
    assert not (tmp_path / "a.csv").exists()
