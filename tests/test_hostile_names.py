"""Names that a terminal obeys or that are no text, files that are none, readers that go: told in words, and nothing is lost."""

import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
import pytest
from conftest import ROOT

import thermofast as tf
from thermofast.errors import shown_name, visible
from thermofast.workers.cluster import Mpi

SPINDLE = ROOT / "sample_runs" / "spindle.csv"


def test_control_characters_are_shown_and_lines_kept():
    assert visible("a\x1b[2J\x07\n  b\x9b\u202e") == "a\\x1b[2J\\x07\n  b\\x9b\\u202e"
    assert shown_name("a\nb\tc\udcff.csv") == "a\\nb c\\xff.csv"
    assert shown_name("Temperatur °C, 温度 (1)") == "Temperatur °C, 温度 (1)"


def test_names_of_columns_cannot_speak_to_a_terminal(tool, tmp_path):
    path = tmp_path / "run.csv"
    minutes = np.arange(90.0)
    rows = [f"{m:g},{20 - 8 * np.expm1(-m / 30):.3f},{20 - 5 * np.expm1(-m / 30):.3f}" for m in minutes]
    path.write_text("time_min,T\x1b[31m1 [C],T2\x07 [C]\n" + "\n".join(rows) + "\n")
    assert list(tf.read(path).channels) == ["T\\x1b[31m1 [C]", "T2\\x07 [C]"]
    for form in ("table", "csv", "json", "md"):
        done = tool("identify", path, "--format", form)
        assert done.code == 0
        assert not {"\x1b", "\x07"} & set(done.out + done.err)
    refused = tool("identify", path, "--channels", "T\x1b]0;x\x07")
    assert refused.code == 2
    assert not {"\x1b", "\x07"} & set(refused.err)


def test_files_that_are_none_and_names_that_are_no_text_are_rows_of_an_archive(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "in"
    folder.mkdir()
    odd = Path(os.fsdecode(os.fsencode(folder) + b"/a\xff\x1b.csv"))
    for path in (odd, folder / "good.csv"):
        shutil.copy(SPINDLE, path)
    os.mkfifo(folder / "pipe.csv")
    (folder / "zero.csv").symlink_to("/dev/zero")
    found = tf.archive("identify", "in", "out/", until=60, channels="T1", jobs=1)
    assert found.statuses == {"ok": 2, "unreadable": 2}
    told = found.to_frame()
    assert sorted(told.run) == ["in/a\\xff\\x1b.csv", "in/good.csv", "in/pipe.csv", "in/zero.csv"]
    why = dict(zip(told.run, told.message, strict=True))
    assert "a pipe" in why["in/pipe.csv"]
    assert "a device" in why["in/zero.csv"]
    # A file that can no longer be read takes its old part with it.
    (folder / "good.csv").unlink()
    (folder / "good.csv").symlink_to("/dev/zero")
    again = tf.archive("identify", "in", "out/", until=60, channels="T1", jobs=1, resume=True)
    assert list(again.to_frame().query("run == 'in/good.csv'").status) == ["unreadable"]


def test_workers_in_another_folder_find_the_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    (tmp_path / "elsewhere").mkdir()
    for name in ("a.csv", "b.csv"):
        shutil.copy(SPINDLE, tmp_path / "in" / name)
    with ProcessPoolExecutor(1, initializer=os.chdir, initargs=(str(tmp_path / "elsewhere"),)) as workers:
        found = tf.archive("identify", "in", "out/", until=60, channels="T1", executor=workers, shared_files=True)
    assert found.statuses == {"ok": 2}
    assert sorted(found.to_frame().run) == ["in/a.csv", "in/b.csv"]
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_reader_that_goes_takes_no_file_and_no_exit_code_along(tmp_path):
    out = tmp_path / "out.json"
    call = [sys.executable, "-m", "thermofast", "identify", str(SPINDLE), "--until", "60", "-q", "-o", str(out), "--format", "csv"]
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(call, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(json.loads(out.read_text())["records"]) == 10


def test_a_parquet_file_of_one_value_a_million_times_is_no_record(tmp_path):
    path = tmp_path / "bomb.parquet"
    papq.write_table(pa.table({"time_s": pa.array(np.zeros(5_000_000)), "T1": pa.array(np.zeros(5_000_000))}), path)
    with pytest.raises(tf.InputError, match="unpacks to more than 400 times its size"):
        tf.read(path)


def test_memory_that_is_out_is_told_without_a_traceback(tool, monkeypatch):
    def none_left(*_: object, **__: object) -> bytes:
        raise MemoryError("malloc of size 17 failed")

    monkeypatch.setattr("thermofast.reading.source._bytes", none_left)
    done = tool("identify", SPINDLE)
    assert done.code == 2
    assert "out of memory: malloc of size 17 failed" in done.err


def test_several_processes_that_each_would_do_all_of_the_work_are_refused(monkeypatch):
    pytest.importorskip("mpi4py", reason="the extra thermofast[mpi] is not installed")
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "3")
    with pytest.raises(tf.UsageError, match="mpiexec started 3 of us"):
        Mpi()
