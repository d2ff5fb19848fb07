"""What a shell may do to a call: closed streams, links in folders, results among records, outputs over records."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import thermofast as tf
from thermofast.archives.sources import sources_of
from thermofast.errors import InputError, TooShortError
from thermofast.output.report.verdicts import verdict_of

ROOT = Path(__file__).parents[1]
SPINDLE = str(ROOT / "sample_runs" / "spindle.csv")


def record(minutes, tau=30.0, seed=0):
    time = np.arange(float(minutes))
    noise = 0.02 * np.random.default_rng(seed).standard_normal((2, len(time)))
    rise = -np.expm1(-time / tau)
    return pd.DataFrame({"time_min": time, "T1": 20.0 + 10.0 * rise + noise[0], "T2": 20.0 + 8.0 * rise + noise[1]})


@pytest.fixture
def tree(tmp_path):
    for folder in ("a", "b", ".hidden"):
        (tmp_path / "archive" / folder).mkdir(parents=True)
        record(90).to_csv(tmp_path / "archive" / folder / "run.csv", index=False)
    record(90).to_csv(tmp_path / "archive" / "._run.csv", index=False)
    (tmp_path / "far").mkdir()
    record(90, seed=1).to_csv(tmp_path / "far" / "run.csv", index=False)
    return tmp_path / "archive"


def names(*given, aside=None):
    return [s.name for s in sources_of([str(g) for g in given], aside)]


def test_links_are_followed_once_and_a_file_is_read_under_its_own_name(tree):
    (tree / "a" / "again.csv").symlink_to(tree / "b" / "run.csv")
    (tree / "b" / "zz.csv").symlink_to(tree / "a" / "run.csv")
    (tree / "c").symlink_to(tree.parent / "far")
    (tree / "round").symlink_to(tree)
    assert names(tree) == ["a/run.csv", "b/run.csv", "c/run.csv"]
    assert names(tree / "**" / "*.csv") == ["a/run.csv", "b/run.csv", "c/run.csv"]
    assert names(tree / "*" / "*.csv") == ["a/run.csv", "b/run.csv", "c/run.csv"]
    with pytest.raises(InputError, match="no file to read"):  # of the Mac's shadows nothing is a record
        names(tree / "*.csv")


def test_a_link_to_itself_is_a_row_and_not_the_end(tree, tool, tmp_path):
    (tree / "self.csv").symlink_to("self.csv")
    (tree / "gone.csv").symlink_to("nowhere.csv")
    assert names(tree) == ["a/run.csv", "b/run.csv", "gone.csv", "self.csv"]
    done = tool("identify", str(tree), "--until", "60", "-o", f"{tmp_path / 'out'}/")
    assert "2 unreadable" in done.err
    assert done.code == 1


def test_a_folder_that_cannot_be_read_is_no_folder_without_files(tree, monkeypatch):
    listed = os.scandir

    def scandir(path):
        if Path(path).name == "b":
            raise PermissionError(13, "Permission denied")
        return listed(path)

    monkeypatch.setattr(os, "scandir", scandir)
    assert names(tree) == ["a/run.csv", "b"]
    assert names(tree / "*" / "*.csv") == ["a/run.csv", "b"]


def test_results_of_an_earlier_call_are_no_records(tree, tool, tmp_path):
    assert tool("identify", str(tree), "--until", "60", "-o", f"{tree / 'results'}/").code == 0
    done = tool("identify", str(tree), "--until", "60", "-o", f"{tmp_path / 'other'}/")
    assert done.code == 0
    assert "2 files done" in done.err


def test_a_record_that_ends_early_costs_itself_alone(tool, tmp_path):
    record(90).to_csv(tmp_path / "long.csv", index=False)
    record(38).to_csv(tmp_path / "short.csv", index=False)
    both = [str(tmp_path / name) for name in ("long.csv", "short.csv")]
    for of in (tf.identify, tf.compare, tf.diagnose):
        told = of(both, until=60).to_frame()
        assert told["channel"].tolist() == ["T1", "T2", "T1", "T2"]
        assert told["status"].tolist()[2:] == ["too_short"] * 2
        assert told["status"][0] != "too_short"
        assert told["message"][2] == "the record ends at 37 min, before --until 60"
    with pytest.raises(TooShortError, match="longer than the record"):
        tf.identify(both[1], until=60)
    done = tool("identify", str(tmp_path), "--until", "60", "-o", f"{tmp_path / 'out'}/")
    assert "1 too_short" in done.err


@pytest.mark.parametrize("closed", ["2>&-", ">&-", "<&-"])
def test_a_stream_that_is_closed_costs_nothing_but_what_is_said_there(closed, tmp_path):
    out = tmp_path / "o.csv"
    call = f"{shlex.quote(sys.executable)} -m thermofast identify {shlex.quote(SPINDLE)} --until 60 -o {shlex.quote(str(out))} {closed}"
    done = subprocess.run(["sh", "-c", call], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert out.read_text().startswith("run,channel,filter")


def test_what_is_said_to_a_closed_stream_goes_into_no_result(tmp_path):
    call = f"{shlex.quote(sys.executable)} -m thermofast identify {shlex.quote(SPINDLE)} --until 60 --format csv 2>&-"
    done = subprocess.run(["sh", "-c", call], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0
    assert done.stdout.startswith("run,channel,filter")


def test_a_watch_does_not_write_into_the_record_it_follows(tool, tmp_path):
    path = tmp_path / "run.csv"
    record(90).to_csv(path, index=False)
    before = path.read_bytes()
    done = tool("watch", str(path), "--replay", "max", "--jsonl", str(path), "-q")
    assert done.code == 2
    assert "would overwrite the record" in done.err
    assert path.read_bytes() == before


def test_the_top_of_a_page_states_no_row_that_is_in_doubt():
    result = tf.identify(str(ROOT / "sample_runs" / "hidden.csv"), until=60, limit=28.0)
    rows = [r.as_dict() for r in result]
    told = verdict_of(result, rows)
    assert told[0].startswith("T1 settles highest of those that are sure")
    assert told[1] == "In doubt or not determined: T4."
    assert told[2].startswith("T4: ")
    assert told[2][4:-1].lower() == rows[3]["message"].lower()
    assert any("T4 goes farthest beyond the limit of 28 degC" in s and "above 99.9 %, which is in doubt" in s for s in told)


def test_the_top_of_a_page_of_a_sweep_counts_what_serves_in_every_window():
    result = tf.sweep(SPINDLE)
    told = verdict_of(result, [r.as_dict() for r in result])
    assert (
        told[0]
        == "An identification time serves in 3 of 10 sensors, whatever the window: from 28 min for the first of them, from 34 min for the last."
    )
    assert told[1] == "The steady state is known to within the tolerance in 0 of 10."
