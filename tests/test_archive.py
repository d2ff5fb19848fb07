"""Archives: what is read, what is written, and what is left after an interruption."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
import pyarrow.dataset as pads
import pyarrow.parquet as papq
import pytest
from conftest import ROOT

import thermofast as tf
from benchmarks.scale.killed import children_of, half_files, left_of, make_archive, same
from thermofast.archives import parts
from thermofast.archives.blocks import Analysis, Reading
from thermofast.archives.settings import settings_of
from thermofast.archives.sources import SourceFile, sources_of
from thermofast.archives.stream import Progress
from thermofast.errors import UsageError
from thermofast.output.arrow import types_of
from thermofast.reading_options import Options
from thermofast.records import IdentifyRecord


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("archive")
    make_archive(folder / "in", 8, sensors=4)
    (folder / "in" / "machine 0" / "broken.csv").write_text("a,b\nx,y\n")
    return folder


def listed(folder: Path) -> list[str]:
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def test_an_archive_holds_what_identify_says_of_each_file(archive, tool, tmp_path):
    into = tmp_path / "results"
    done = tool("identify", archive / "in", "--until", 60, "-o", f"{into}/", "--jobs", 1)
    assert done.code == 1  # one file is no record
    assert done.err == f"{into}/: 9 files done (rows: 1 model_doubtful, 31 ok, 1 unreadable)\n"
    table = pd.read_parquet(into)
    assert set(table["folder"]) == {"machine 0", "machine 1", "machine 2"}
    assert (table["status"] == "ok").sum() == 31
    told = table[table["status"] == "unreadable"].iloc[0]
    assert told["run"].endswith("broken.csv")
    assert "time" in told["message"]
    alone = tf.identify(archive / "in" / "machine 1" / "run 1.csv", until=60, details=False)
    mine = table[table["source"] == "machine 1/run 1.csv"].set_index("channel")
    for record in alone:
        assert mine.loc[record.channel, "steady_state_c"] == pytest.approx(record.steady_state_c, rel=1e-9)
        assert mine.loc[record.channel, "t95_hi_min"] == pytest.approx(record.t95_hi_min, rel=1e-9)
    # Every part has the same columns of the same types: what reads one reads all.
    schemas = {papq.read_schema(p).remove_metadata().to_string() for p in into.rglob("*.parquet")}
    assert len(schemas) == 1
    kinds = types_of(IdentifyRecord)
    schema = papq.read_schema(next(into.rglob("*.parquet")))
    assert {n: schema.field(n).type for n in kinds} == kinds
    assert pads.dataset(into, partitioning="hive").count_rows() == 33


def test_two_processes_write_the_same_bytes_as_one_and_as_any_executor(archive, tmp_path):
    found = []
    for name, how in {"one": {"jobs": 1}, "two": {"jobs": 2}}.items():
        found.append(tf.archive("identify", str(archive / "in"), str(tmp_path / name), until=60, **how))
    with ThreadPoolExecutor(2) as threads:
        tf.archive("identify", str(archive / "in"), str(tmp_path / "threads"), until=60, executor=threads)
    assert same(tmp_path / "one", tmp_path / "two")
    assert same(tmp_path / "one", tmp_path / "threads")
    assert (found[0].done, found[0].statuses) == (9, {"ok": 31, "model_doubtful": 1, "unreadable": 1})
    assert len(found[0].to_frame(["run", "steady_state_c"])) == 33


def test_resume_redoes_what_is_missing_or_other_and_nothing_else(archive, tmp_path):
    shutil.copytree(archive / "in", tmp_path / "in")
    into, call = str(tmp_path / "r"), ("identify", str(tmp_path / "in"))
    tf.archive(*call, into, until=60, jobs=1)
    parts = sorted(Path(into).rglob("*.parquet"))
    before = {p: p.stat().st_mtime_ns for p in parts}
    parts[0].unlink()
    parts[1].write_bytes(parts[1].read_bytes()[:-1])  # a part that was cut short
    changed = tmp_path / "in" / "machine 2" / "run 2.csv"
    changed.write_text(changed.read_text().rsplit("\n", 2)[0] + "\n")
    (tmp_path / "r" / ".thermofast-left.part").write_bytes(b"half")
    damaged = bytearray(parts[2].read_bytes())
    damaged[len(damaged) // 8] ^= 255  # in a page of readings, which all else says nothing of
    parts[2].write_bytes(damaged)
    found = tf.archive(*call, into, until=60, jobs=1, resume=True)
    assert (found.done, found.skipped, found.others) == (4, 5, 0)
    again = tf.archive(*call, into, until=60, jobs=1, resume=True)
    assert (again.done, again.skipped, again.statuses, again.lost) == (0, 9, {}, {"unreadable": 1})
    kept = [p for p in before if p.exists() and p.stat().st_mtime_ns == before[p]]
    assert len(kept) == 5
    tf.archive(*call, str(tmp_path / "whole"), until=60, jobs=1)
    assert same(tmp_path / "whole", Path(into))
    changed.unlink()
    assert tf.archive(*call, into, until=60, jobs=1, resume=True).others == 1


def test_a_folder_is_guarded(archive, tool, tmp_path):
    into = f"{tmp_path}/r/"
    call = ("identify", archive / "in" / "machine 1", "--jobs", 1, "-q")
    assert tool(*call, "-o", into).code == 0
    for more, what in (
        ((), "holds results already"),
        (("--resume", "--until", "60"), "--until not given, now 60"),
        (("--resume", "--interval", "60"), "--interval not given, now 60"),
    ):
        done = tool(*call, "-o", into, *more)
        assert done.code == 2
        assert what in done.err
    assert "holds results of identify" in tool("compare", archive / "in", "-q", "-o", into, "--resume").err
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("dear")
    assert "not a folder of results" in tool(*call, "-o", f"{tmp_path}/other").err
    assert listed(tmp_path / "other") == ["letter.txt"]
    for more, what in (
        (("-o", into, "--save-plot", "a.png"), "--save-plot is not for an archive"),
        (("-o", into, "-o", "b.csv"), "a second -o is not for an archive"),
        (("--resume",), "--resume goes on with a folder of results"),
        (("-o", f"{tmp_path}/r.csv", "--resume"), "--resume goes on with a folder of results"),
        (("-o", f"{tmp_path}/new/", "--cluster", "tcp://a", "--jobs", "2"), "--cluster and --jobs: each says who works"),
    ):
        done = tool("identify", archive / "in", *more)
        assert done.code == 2
        assert what in done.err
    manifest = Path(into) / "_thermofast.json"
    written = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(written | {"version": "0.1", "settings": {"--until": "60.0"}}))
    assert "its results are another version's" in tool(*call, "-o", into, "--resume").err
    manifest.write_text(json.dumps(written | {"layout": 99}))
    assert "results of another layout" in tool(*call, "-o", into, "--resume").err


@pytest.mark.parametrize(
    ("command", "more"), [("sweep", ("--windows", "120")), ("compare", ()), ("diagnose", ("--effects", "second_mode"))]
)
def test_other_commands_too(archive, tool, tmp_path, command, more):
    into = tmp_path / "r"
    done = tool(command, archive / "in" / "machine 2", *more, "-o", f"{into}/", "--jobs", 1)
    assert done.code == 0
    table = pd.read_parquet(into)
    one = tool(command, archive / "in" / "machine 2" / "run 2.csv", *more, "--format", "jsonl", "-q")
    rows = [json.loads(line) for line in one.out.splitlines()]
    mine = table[table["source"] == "run 2.csv"].reset_index(drop=True)
    assert list(mine["channel"]) == [r["channel"] for r in rows]
    assert list(mine["status"]) == [r["status"] for r in rows]


def test_which_files_an_archive_holds(archive, tmp_path):
    folder = archive / "in"
    assert [s.name for s in sources_of([f"{folder}/**/run [02]*.csv"])] == ["machine 0/run 0.csv", "machine 2/run 2.csv"]
    named = [str(folder / "machine 0" / "run 0.csv"), str(folder / "machine 1" / "run 1.csv")]
    assert [s.name for s in sources_of(named)] == ["machine 0/run 0.csv", "machine 1/run 1.csv"]
    assert len(sources_of([str(folder), *named])) == 9  # each once
    (tmp_path / "results").mkdir()
    shutil.copy(folder / "machine 0" / "run 0.csv", tmp_path / "results" / "x.csv")
    shutil.copy(folder / "machine 0" / "run 0.csv", tmp_path / "y.csv")
    assert [s.name for s in sources_of([str(tmp_path)], str(tmp_path / "results"))] == ["y.csv"]
    for wrong, what in (
        ("nothing*", "no file to read"),
        ("nothing.csv", "no such file"),
        (str(tmp_path / "results"), "lies in the folder for results"),
    ):
        with pytest.raises(tf.InputError, match=what):
            sources_of([wrong], str(tmp_path / "results"))


@pytest.mark.parametrize("name", ["../../etc/passwd", "a/../../b.csv", "x" * 300 + ".csv", "ü\n:*?.csv", "..", "a/..", "CON.csv"])
def test_no_name_leaves_the_folder_of_results(tmp_path, name):
    from thermofast.archives.parts import Manifest, Parts

    parts = Parts(str(tmp_path), Manifest("identify", "1", "compiled", {}))
    path = parts.path(SourceFile(name, name, name), "00")
    assert path.resolve().parent.parent == tmp_path.resolve()
    assert all(len(part.encode()) < 200 for part in path.relative_to(tmp_path).parts)
    assert ":" not in path.name
    assert "\n" not in path.name


def test_remaining_time_is_an_interval_that_shrinks():
    progress = Progress(100, 100_000)
    for i in range(100):
        progress.finished(1000, Counter(["ok"]))
        progress._marks[-1] = (0.5 * (i + 1), progress.done_bytes)
        if i == 6:
            assert progress.remaining_s() is None
        if i == 49:
            middle, low, high = progress.remaining_s()
            assert middle == pytest.approx(25.0)
            assert low <= middle <= high < 30.0
    assert progress.remaining_s()[0] == 0.0


def dies_on_t2(started, how=None, **_):
    for run, _start in started:
        if "T2" in run.channels:
            os._exit(1)
    return tf.identify(started[0][0], until=60, details=False)


def test_a_run_on_which_workers_die_is_named_and_the_others_are_done(archive, tmp_path):
    from thermofast.archives.library import into_folder
    from thermofast.reading import Options
    from thermofast.workers.flow import Local

    shutil.copytree(archive / "in", tmp_path / "in")
    for path in (tmp_path / "in" / "machine 1").iterdir():
        path.write_text(path.read_text().replace("T2", "S2"))
    analysis = Analysis("identify", IdentifyRecord, dies_on_t2, 0, {"filter": "afukf"})
    into = str(tmp_path / "r")
    found = into_folder(analysis, [str(tmp_path / "in")], into, False, Local(2), Options(), None, 60.0, True)
    assert found.statuses["failed"] == 5  # machines 0 and 2
    assert found.statuses["ok"] + found.statuses["model_doubtful"] == 12
    table = pd.read_parquet(into)
    failed = table[table["status"] == "failed"]
    assert set(failed["folder"]) == {"machine 0", "machine 2"}
    assert failed["message"].str.contains("the worker process died").all()


@pytest.mark.proof
def test_a_signal_ends_it_in_order_and_resume_ends_byte_equal(archive, tmp_path):
    make_archive(tmp_path / "in", 16, seed=2, sensors=6)
    call = [sys.executable, "-m", "thermofast", "identify", "in", "--until", "60", "-o", "r/", "--jobs", "2"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    deaf = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    for sign, code in ((signal.SIGTERM, 143), (signal.SIGKILL, -9)):
        more = ["--resume"] if (tmp_path / "r").exists() else []
        victim = subprocess.Popen([*call, *more], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True, preexec_fn=deaf)
        count = len(list((tmp_path / "r").rglob("*.parquet")))
        for _ in range(400):
            if len(list((tmp_path / "r").glob("folder=*/*.parquet"))) > count or victim.poll() is not None:
                break
            time.sleep(0.05)
        family = children_of(victim.pid)
        victim.send_signal(sign)
        err = victim.communicate(timeout=60)[1]
        assert victim.returncode == code, err
        assert "Traceback" not in err
        assert ("with --resume goes on" in err) == (code == 143)
        assert half_files(tmp_path / "r") == []
        assert left_of(family) == 0
    subprocess.run([*call, "--resume", "-q"], cwd=tmp_path, env=environment, check=True)
    subprocess.run([*call[:-4], "-o", "whole/", "--jobs", "1", "-q"], cwd=tmp_path, env=environment, check=True)
    assert same(tmp_path / "r", tmp_path / "whole")


QUERIES = re.findall(r"```sql\n(.*?)```", (ROOT / "docs" / "scale.md").read_text(), re.S)


@pytest.mark.filterwarnings("ignore")
def test_the_questions_of_the_documentation_are_answered(archive, tmp_path, monkeypatch):
    duckdb = pytest.importorskip("duckdb", reason="duckdb is not installed")
    tf.archive("identify", str(archive / "in"), str(tmp_path / "results"), until=60, jobs=1)
    monkeypatch.chdir(tmp_path)
    assert len(QUERIES) == 6
    answers = [duckdb.sql(query).fetchall() for query in QUERIES]
    assert [row[2] for row in answers[0]].count("unreadable") == 1
    assert {row[0] for row in answers[1]} == {"machine 0", "machine 1", "machine 2"}
    assert all(row[1] > 0 for row in answers[2])
    assert len(answers[3]) == 5  # four sensors and the file that is none
    table = pd.read_parquet("results")
    measured = table[table["steady_state_measured_c"].notna()]
    held = measured["steady_state_measured_c"].between(measured["steady_state_lo_c"], measured["steady_state_hi_c"])
    assert {status: share for status, _, share in answers[5]} == pytest.approx(held.groupby(measured["status"]).mean().to_dict())
    assert sum(sensors for _, sensors, _ in answers[5]) == len(measured)


def test_what_could_not_be_read_is_told_again_when_the_call_is_taken_up(tool, tmp_path):
    (tmp_path / "in").mkdir()
    shutil.copy("sample_runs/spindle.csv", tmp_path / "in")
    (tmp_path / "in" / "bad.csv").write_text("no record\n")
    first, again = (tool("identify", tmp_path / "in", "-o", f"{tmp_path}/r/", *more) for more in ((), ("--resume",)))
    assert (first.code, again.code) == (1, 1)
    assert "2 were there already (1 unreadable)" in again.err


def _one_file(where: Path) -> Path:
    where.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / "sample_runs" / "cool_down.csv", where)
    return where


LONG = "Kunde Müller 13/Größe 84/Prüfstand Süd/Wärmeversuche 2026"


@pytest.mark.parametrize("folder", ["主轴升温试验/二零二四年/第三季度", LONG, "rpm=3000/a=b", "007", "a" * 200])
def test_any_folder_is_a_partition_that_others_read(folder, tmp_path):
    """Cut in mid-character a name was none in UTF-8, and hid all other parts; with a sign of equality it was another column."""
    _one_file(tmp_path / "in" / folder / "r.csv")
    _one_file(tmp_path / "in" / "7" / "r.csv")
    found = tf.archive("identify", str(tmp_path / "in"), str(tmp_path / "r"), until=60, jobs=1)
    read = pads.dataset(tmp_path / "r", partitioning="hive").to_table().to_pandas()
    told = found.to_frame()
    assert {p.name.count("=") for p in (tmp_path / "r").glob("folder=*")} == {1}  # DuckDB takes each for a column's
    assert len(read) == len(told) == 20
    assert set(told["source"]) == {"7/r.csv", f"{folder}/r.csv"}
    assert told["folder"].nunique() == 2
    assert "7" in set(told["folder"])
    if len(folder) <= 30 and folder.isascii():
        assert set(told["folder"]) == {"7", folder}


def test_resume_asks_for_what_is_in_the_files_named(tmp_path):
    """From Python a model that was learnt anew, a prior or a filter that was changed, was not noticed."""
    _one_file(tmp_path / "in" / "r.csv")
    lab = tmp_path / "lab.toml"
    lab.write_text('schema = "thermofast.lab/1"\n')
    own = tmp_path / "mine.py"
    own.write_text("# one\n")
    before = settings_of({"imperfection": str(lab), "filter": f"{own}:Mine", "until": 45}, {})
    assert settings_of({"imperfection": lab, "filter": f"{own}:Mine", "until": 45.0}, {}) == before
    lab.write_text('schema = "thermofast.lab/1"\n\n')
    own.write_text("# two\n")
    after = settings_of({"imperfection": str(lab), "filter": f"{own}:Mine", "until": 45}, {})
    assert {n for n in before if before[n] != after[n]} == {"imperfection", "filter"}
    assert settings_of({"auto": False, "until": None, "leave": True}, {"auto": False, "leave": True}) == {}
    assert settings_of({"auto": True, "leave": False}, {"auto": False, "leave": True}) == {"auto": "yes", "leave": "no"}


def test_a_command_and_the_library_go_on_with_each_others_results(tool, tmp_path):
    _one_file(tmp_path / "in" / "r.csv")
    call = ("identify", str(tmp_path / "in"), str(tmp_path / "r"))
    assert tf.archive(*call, until=45, rates="auto", channels=["T1", "T2"], jobs=1).done == 1
    more = ("--until", 45, "--channels", "T1,T2", "--filter", "afukf", "--max-rows", 100_000, "--jobs", 1)
    done = tool("identify", tmp_path / "in", "-o", f"{tmp_path}/r/", "--resume", *more)
    assert (done.code, "1 were there already" in done.err) == (0, True)
    assert tf.archive(*call, until=45.0, channels=("T1", "T2"), jobs=1, resume=True, start="auto").skipped == 1
    with pytest.raises(tf.UsageError, match=r"until 45, now 46"):
        tf.archive(*call, until=46, channels=["T1", "T2"], jobs=1, resume=True)


def test_results_of_files_not_named_any_more_are_told_and_taken_out_where_asked(tool, tmp_path):
    """Named two by two the base of two files is their folder, of three another: the first two stood there twice."""
    files = [_one_file(tmp_path / "in" / m / f"r{k}.csv") for k, m in enumerate(("m0", "m0", "m1"))]
    into = f"{tmp_path}/r/"
    more = ("--until", 45, "--jobs", 1, "-o", into)
    assert tool("identify", *files[:2], *more).code == 0
    left = tool("identify", *files, *more, "--resume")
    assert "2 parts are of files not named now; left, and count in every query: --resume --prune takes them out" in left.err
    assert len(pd.read_parquet(into)) == 50
    assert "taken out" in tool("identify", *files, *more, "--resume", "--prune").err
    assert len(pd.read_parquet(into)) == 30
    whole = tmp_path / "whole"
    tool("identify", *files, "--until", 45, "--jobs", 1, "-o", f"{whole}/")
    assert same(whole, Path(into))
    assert {p.name for p in Path(into).glob("folder=*")} == {"folder=m0", "folder=m1"}
    refused = tool("identify", *files, *more, "--prune")
    assert "--prune takes parts out of results that --resume goes on with" in refused.err


def test_a_file_that_lacked_a_package_is_tried_again(tmp_path, monkeypatch):
    """It would have stayed unreadable for ever."""
    _one_file(tmp_path / "in" / "r.csv")
    call = ("identify", str(tmp_path / "in"), str(tmp_path / "r"))

    def lacks(self, path, data):
        raise tf.InputError(f"{path}: needs a package", do="pip install 'thermofast[tdms]'")

    with monkeypatch.context() as patch:
        patch.setattr(Reading, "started", lacks)
        assert tf.archive(*call, until=45, jobs=1).statuses == {"unreadable": 1}
    again = tf.archive(*call, until=45, jobs=1, resume=True)
    assert (again.done, again.skipped) == (1, 0)


def test_a_folder_that_cannot_be_looked_into_is_called_so(tmp_path):
    file = SourceFile("sub", "in/sub", str(tmp_path))
    with pytest.raises(tf.InputError, match="a folder that cannot be read"):
        file.content(Options())


def test_an_empty_name_is_no_folder(tool, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = tool("identify", _one_file(tmp_path / "in" / "r.csv"), "-o", "")
    assert (done.code, done.err) == (
        2,
        "Error: -o: empty\n  allowed: a file, or a folder as results/\n  do: name it, or leave -o out\n",
    )
    assert [p.name for p in tmp_path.iterdir()] == ["in"]


def test_results_of_every_name_are_seen_by_those_who_read_folders_of_parquet(archive, tmp_path):
    """They leave out what begins with a dot or an underscore."""
    source = next((archive / "in").rglob("run*.csv")).read_bytes()
    (tmp_path / "in").mkdir()
    names = ["_front.csv", ".rear.csv", "plain.csv"]
    for name in names:
        (tmp_path / "in" / name).write_bytes(source)
    found = tf.archive("identify", [str(tmp_path / "in" / n) for n in names], str(tmp_path / "results"), until=60, jobs=1)
    assert set(pd.read_parquet(tmp_path / "results")["source"]) == set(names) == set(found.to_frame()["source"])


def test_a_pattern_in_a_folder_that_is_not_there_is_refused(archive, tool, tmp_path):
    done = tool("identify", archive / "in" / "*" / "*.csv", tmp_path / "nope" / "**" / "*.csv", "-o", f"{tmp_path}/results/")
    assert done.code == 2
    assert "no folder" in done.err
    assert "nope" in done.err
    assert not (tmp_path / "results").exists()
    assert tool("identify", tmp_path / "nope" / "*.csv").code == 2


def test_a_record_that_ends_before_a_window_is_too_short_not_unreadable(archive, tmp_path):
    """As one that ends before --until: of the others each sensor has its rows."""
    source = next((archive / "in").rglob("run*.csv")).read_text().splitlines()
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "long.csv").write_text("\n".join(source))
    (tmp_path / "in" / "short.csv").write_text("\n".join(source[:60]))
    tf.archive("sweep", str(tmp_path / "in"), str(tmp_path / "results"), windows=[40.0, 100.0], jobs=1)
    told = pd.read_parquet(tmp_path / "results").groupby("source")["status"].agg(set)
    assert told["short.csv"] == {"too_short"}
    assert not told["long.csv"] & {"too_short", "unreadable"}


def test_prune_without_resume_is_refused(archive, tmp_path):
    with pytest.raises(tf.UsageError, match="resume=True"):
        tf.archive("identify", str(archive / "in"), str(tmp_path / "results"), prune=True)


def test_a_folder_is_no_place_for_one_file(archive, tool, tmp_path):
    source = next((archive / "in").rglob("run*.csv"))
    done = tool("improve", source, "-o", f"{tmp_path}/results/")
    assert done.code == 2
    assert "one file is written here" in done.err
    assert "-o results/" not in done.err
    assert "results/" in tool("identify", source, "-o", tmp_path / "a.foo").err
    assert "results/" not in tool("improve", source, "-o", tmp_path / "a.foo").err


@pytest.mark.parametrize(
    ("command", "asked", "name", "together"),
    [
        ("identify", {}, "ukf", 50),
        ("identify", {"criterion": True}, "ukf", 0),
        ("identify", {"drive": "speed"}, "ukf", 0),
        ("sweep", {"criterion": True}, "ukf", 50),
        ("sweep", {"drive": "speed", "model": None}, "joint_fit", 0),
    ],
)
def test_what_is_worked_on_together_is_one_rule_for_command_and_library(command, asked, name, together):
    analysis = Analysis.of_sensors(command, lambda: None, "ukf", asked)
    assert (analysis.more, analysis.together) == ({"filter": name}, together)


def test_command_and_library_name_a_sensor_alike_that_could_not_be_worked_on(tool, tmp_path):
    time = [10.0 * i for i in range(60)]
    bad = tmp_path / "bad.csv"
    pd.DataFrame({"time_s": time, "T1 [degC]": ["x"] * 60}).to_csv(bad, index=False)
    tool("sweep", str(bad), "--drive", "speed", "--windows", "5", "-o", f"{tmp_path / 'a'}/", "-q")
    tf.archive("sweep", bad, tmp_path / "b", drive="speed", windows=[5])
    read = [pads.dataset(tmp_path / name, format="parquet").to_table().to_pandas() for name in ("a", "b")]
    assert list(read[0]["filter"]) == list(read[1]["filter"]) == ["joint_fit"]


def test_a_lock_that_another_call_took_away_keeps_nobody_out_and_is_taken_anew(tmp_path, monkeypatch):
    """That call ends after this one has opened its file and before it has locked it; a third one is refused."""
    fcntl = pytest.importorskip("fcntl")
    lock, real, first = tmp_path / "lock", fcntl.flock, []
    ending = parts._locked(lock, "results")
    ending.__enter__()

    def late(handle, how):
        if not first:
            first.append(handle)
            ending.__exit__(None, None, None)
        return real(handle, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with parts._locked(lock, "results"):
        assert lock.exists()
        with pytest.raises(UsageError, match="results: another call is writing there"), parts._locked(lock, "results"):
            pass
    assert not lock.exists()


def test_a_file_system_without_locks_is_not_another_call(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")

    def none(handle, how):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    with pytest.raises(UsageError, match="cannot be locked") as refused, parts._locked(tmp_path / "lock", "results"):
        pass
    assert "No locks available" in str(refused.value)
