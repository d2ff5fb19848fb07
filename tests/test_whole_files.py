"""What stands on the disk where any one call of the system fails: the old files or the new ones, never half, never some of both."""

import os
import tempfile
from pathlib import Path

import pytest
from conftest import ROOT

import thermofast as tf
from benchmarks.scale.killed import half_files, make_archive, same
from thermofast.output import whole
from thermofast.workers import flow

SPINDLE = ROOT / "sample_runs" / "spindle.csv"


class Failing:
    """Calls of a function of the system, of which one fails; how many there were."""

    def __init__(self, real, fails):
        self.real, self.fails, self.calls = real, fails, 0

    def __call__(self, *args, **kwargs):
        self.calls += 1
        if self.calls == self.fails:
            raise OSError(28, "No space left on device")
        return self.real(*args, **kwargs)


WHERE = {
    "open": (tempfile, "mkstemp"),
    "write": (os, "chmod"),  # what is written is on its temporary name by then
    "fsync": (os, "fsync"),
    "replace": (os, "replace"),
    "link": (os, "link"),
}


@pytest.mark.parametrize("call", WHERE)
@pytest.mark.parametrize("old", [True, False])
def test_outputs_of_one_call_are_all_there_or_none(tool, tmp_path, monkeypatch, call, old):
    names = ["a.csv", "b.json", "c.html"]
    targets = [tmp_path / n for n in names]
    outputs = [word for t in targets for word in ("-o", t)]
    failures = 0
    for n in range(1, 20):
        for target in targets:
            target.unlink(missing_ok=True)
            if old:
                target.write_text("old")
        module, name = WHERE[call]
        failing = Failing(getattr(module, name), n)
        with monkeypatch.context() as patch:
            patch.setattr(module, name, failing)
            done = tool("identify", SPINDLE, "--until", 60, "--channels", "T5", *outputs, "--trace", tmp_path / "t.csv", "-q")
        there = sorted(p.name for p in tmp_path.iterdir())
        if failing.calls < n:
            break
        told = [t.read_text() for t in targets if t.exists()]
        if done.code == 0:  # the folder's own fsync, after all stands
            assert "old" not in told
            assert there == sorted([*names, "t.csv"])
        else:
            failures += 1
            assert done.code == 2
            assert "No space left on device" in done.err
            assert told == (["old"] * 3 if old else [])
            assert there == (names if old else [])
        (tmp_path / "t.csv").unlink(missing_ok=True)
    assert failing.calls < n  # every call there is has failed once
    assert failures >= (0 if call == "link" else 3)  # where there are no links, files are copied


@pytest.mark.parametrize("call", ["open", "fsync", "replace", "submit"])
def test_an_archive_is_whole_whichever_call_fails(tmp_path, monkeypatch, call):
    make_archive(tmp_path / "in", 4, sensors=2)
    reference = tmp_path / "whole"
    tf.archive("identify", str(tmp_path / "in"), str(reference), until=60, jobs=1)
    into = tmp_path / "r"
    for n in range(1, 30):
        module, name = (flow.Here, "submit") if call == "submit" else WHERE[call]
        failing = Failing(getattr(module, name), n)
        with monkeypatch.context() as patch:
            patch.setattr(module, name, (lambda self, *a: failing(self, *a)) if call == "submit" else failing)
            try:
                tf.archive("identify", str(tmp_path / "in"), str(into), until=60, jobs=1, resume=into.exists())
            except tf.UsageError as error:
                assert "No space left on device" in str(error)
        assert half_files(into) == []
        assert not list(into.rglob(f"{whole.TEMPORARY}*"))
        if failing.calls < n:
            break
        tf.archive("identify", str(tmp_path / "in"), str(into), until=60, jobs=1, resume=True)
        assert same(reference, into)
        for part in sorted(into.glob("folder=*/*.parquet"))[::2]:
            part.unlink()
    assert failing.calls < n
    assert Path(into).exists()


def test_a_link_stays_one_and_a_file_that_nobody_else_may_read_stays_so(tmp_path):
    told = tf.identify(SPINDLE, until=60)
    target, link = tmp_path / "private.csv", tmp_path / "link.csv"
    target.write_text("old")
    target.chmod(0o600)
    link.symlink_to(target)
    told.save(str(link))
    assert link.is_symlink()
    assert target.read_text().startswith("run,channel")
    assert target.stat().st_mode & 0o777 == 0o600
    pipe, to_pipe = tmp_path / "pipe", tmp_path / "to_pipe.csv"
    os.mkfifo(pipe)
    to_pipe.symlink_to(pipe)
    told.save(str(to_pipe))  # nothing may be put in the place of a pipe or a device
    assert pipe.is_fifo()
    assert to_pipe.read_text() == target.read_text()
    told.save(str(tmp_path / "new.csv"))
    assert (tmp_path / "new.csv").stat().st_mode & 0o777 == 0o666 & ~whole.UMASK


def test_a_file_is_open_for_writing_where_it_is_brought_to_the_disk_as_one_system_asks(tmp_path, monkeypatch):
    """And a folder for reading; also where what it takes the place of may not be written."""
    fcntl = pytest.importorskip("fcntl")
    opened = []
    monkeypatch.setattr(os, "fsync", lambda handle: opened.append(fcntl.fcntl(handle, fcntl.F_GETFL) & os.O_ACCMODE))
    target = tmp_path / "out.csv"
    for _ in range(2):
        whole.write_whole(str(target), lambda path: Path(path).write_text("a"))
        target.chmod(0o444)
    assert opened == [os.O_RDWR, os.O_RDONLY] * 2
    assert target.stat().st_mode & 0o777 == 0o444
