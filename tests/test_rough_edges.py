"""What once ended in a traceback, a cut table or a word against itself."""

import json
import os
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import ROOT
from lone import identify_sensor

from thermofast.estimation.closing import track_of
from thermofast.estimation.estimate import FilterError
from thermofast.estimation.measured import contradiction, measured_equilibrium
from thermofast.estimation.request import Method
from thermofast.filters import Filter
from thermofast.models import Lump
from thermofast.models.imperfection import NONE
from thermofast.output.screen import _told_once
from thermofast.output.table import GAP, INTERVAL, Column, blocks, folded, lines_of

SPINDLE = str(ROOT / "sample_runs" / "spindle.csv")
HIDDEN = str(ROOT / "sample_runs" / "hidden.csv")


@pytest.mark.parametrize(("windows", "times"), [("40,45,50,55", "20:32:1"), ("400", "10:100:2"), ("40,45,50,55", "10:30:1")])
def test_a_sweep_in_which_no_time_serves_says_so(windows, times, tool):
    done = tool("sweep", SPINDLE, "--windows", windows, "--times", times, "--format", "json", "-q")
    assert done.code == 0
    records = json.loads(done.out)["records"]
    unserved = [r for r in records if r["shortest_time_min"] is None]
    assert unserved
    for r in unserved:
        assert "no time tried serves" in r["message"]
        assert r["agreed"] is None
        assert r["best_time_min"] <= float(times.split(":")[1])
    for r in records:
        if r["earliest_time_min"] is not None:
            assert r["earliest_time_min"] < r["window_min"]


def test_a_record_that_ends_where_it_began_measures_nothing():
    time = np.arange(100.0)
    assert measured_equilibrium(time, np.full(100, 20.0)) is None
    reading = np.full(100, 20.0)
    reading[50] = 20.1
    assert measured_equilibrium(time, reading) is None


class Angry(Filter):
    """Raises what no one expects."""

    name, summary, reference = "angry", "raises", "nobody"
    closing = "never"

    def track(self, model, time, reading, resolution):
        raise KeyError("gain")


class Wild(Angry):
    """Returns what no one can use."""

    name = "wild"

    def track(self, model, time, reading, resolution):
        return [1, 2, 3]


def test_a_filter_that_raises_costs_a_row():
    time = np.arange(60.0)
    reading = 20 + 5 * (1 - np.exp(-0.03 * time))
    for kind, words in ((Angry, "angry raised KeyError: 'gain'"), (Wild, "track() gave list, needed thermofast.filters.Track")):
        record = identify_sensor("run", "T1", time, reading, Method(Lump(), kind())).record
        assert record.status == "diverged"
        assert words in record.message
    with pytest.raises(FilterError, match=r"test_rough_edges.py, line \d+"):
        track_of(Angry(), Lump(), time, reading, 0.0)


class Point:
    """An entry point whose package fails as it is imported."""

    name, value, dist = "torn", "torn:Effect", None

    def load(self):
        raise ImportError("libtorn.so is missing")


def test_broken_plug_ins_are_lines_in_the_catalogue_and_stop_nothing(tool, monkeypatch):
    wrong = EntryPoint("path", "pathlib:Path", "thermofast.effects")
    monkeypatch.setattr("thermofast.plugins.entrypoints.entry_points", lambda group: [Point(), wrong])
    for catalogue in ("effects", "filters"):
        shown = tool(catalogue)
        assert shown.code == 0
        assert "torn" in shown.out
        assert "libtorn.so is missing" in shown.out
        assert "needed a class derived from" in shown.out
    assert tool("identify", SPINDLE, "--channels", "T5", "-q").code == 0
    assert tool("diagnose", HIDDEN, "-q", "--effects", "second_mode").code == 0


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted in /proc")
@pytest.mark.parametrize(("kind", "more"), [("csv", 1), ("parquet", 0)])
def test_reading_starts_no_threads_that_could_abort_a_refusal(kind, more, tmp_path):
    # pyarrow's own threads, still starting as the process ended, aborted one refusal in forty; benchmarks/reading/refusals.py counts them.
    # The one that hands a CSV file's block over has done so when the file is read.
    path = tmp_path / f"run.{kind}"
    frame = pd.read_csv(SPINDLE)
    frame.to_csv(path, index=False) if kind == "csv" else frame.to_parquet(path, index=False)
    count = "print(len(os.listdir('/proc/self/task')))"
    code = f"import os, pyarrow.csv, thermofast as tf; {count}; tf.read({str(path)!r}); {count}"
    alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=alone)
    before, after = map(int, done.stdout.split())
    assert after <= before + more  # a thread of the import itself may already be there


def test_a_library_call_takes_one_thread_for_a_product_and_leaves_the_callers_own():
    """Small products on a busy machine took forty times as long by several threads; the caller's own go on as they were."""
    code = """
from threadpoolctl import threadpool_info
import numpy, thermofast as tf, thermofast.judging as judging
count = lambda: sorted({pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"})
from thermofast.given import checked
print(count(), checked(lambda: count())(), count())
import threading
began, may_end = threading.Event(), threading.Event()
longer = threading.Thread(target=checked(lambda: (began.set(), may_end.wait())))
def shorter():
    longer.start(), began.wait()
checked(shorter)()
print(count())
may_end.set(), longer.join()
print(count())
threads = [[threading.Event() for _ in range(2)] for _ in range(2)]
began = [threading.Thread(target=checked(lambda s=start, e=end: (s.set(), e.wait()))) for start, end in threads]
for thread, (start, _) in zip(began, threads):
    thread.start(), start.wait()
for thread, (_, end) in zip(began, threads):
    end.set(), thread.join()
print(count())
"""
    free = {n: v for n, v in os.environ.items() if not n.endswith("_NUM_THREADS")} | {"OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=free)
    # A call that another thread began while this one ran, and that ends after it, must not leave its own limit behind.
    assert done.stdout.split() == ["[2]", "[1]", "[2]", "[1]", "[2]", "[2]"]


# --- tables ---------------------------------------------------------------------------------------------------------------------------


def columns():
    names = ["front_bearing_outer_ring", "T2", "motor"]
    sets = ["second_mode+ambient", "load_step", "neighbour_heat, friction_decay, sensor_lag"]
    return [
        Column("sensor", tuple(names), True),
        Column("also possible", tuple(sets), True),
        *[Column(f"error {k} K", ("123.456", "0.001", "-5.250"), False) for k in range(9)],
        Column("status", ("not_determined", "ok", "model_doubtful"), True),
    ]


@pytest.mark.parametrize("width", [60, 72, 80, 100, 132, 200, None])
def test_no_width_cuts_a_number_a_name_or_a_status(width):
    found = blocks(columns(), width)
    text = ""
    for block in found:
        heading, rows = lines_of(block)
        lines = heading + [line for row in rows for line in row]
        assert width is None or max(map(len, lines)) <= width
        assert block[0][0].heading == "sensor"
        text += "\n".join(lines) + "\n"
    assert sum(c.heading == "status" for block in found for c, _ in block) == 1
    for whole in (
        "123.456",
        "-5.250",
        "not_determined",
        "model_doubtful",
        "T2",
        "motor",
        "second_mode+",
        "neighbour_heat,",
        "load_step",
    ):
        assert whole in text
    assert "front_bearing_outer_ring" in re.sub(r"\s", "", text)
    if width is None or width >= sum(c.natural for c in columns()) + GAP * 11:
        assert len(found) == 1


@pytest.mark.parametrize("width", range(60, 140, 5))
def test_an_interval_stays_with_its_number(width):
    numbers = [c for k in range(5) for c in (Column(f"at {k} degC", ("25.41",), False), Column(INTERVAL, ("25.13..26.32",), False))]
    table = [Column("sensor", ("front_bearing",), True), *numbers, Column("status", ("ok",), True)]
    headings = [[c.heading for c, _ in block] for block in blocks(table, width)]
    for block in headings:
        for k, heading in enumerate(block):
            assert heading != INTERVAL or block[k - 1].startswith("at ")
    assert sum(block.count(INTERVAL) for block in headings) == 5


def test_lists_break_behind_plus_and_commas_only():
    assert folded("second_mode+ambient", 13) == ["second_mode+", "ambient"]
    assert folded("ambient, load_step", 10) == ["ambient,", "load_step"]
    assert folded("cooling_switch", 20) == ["cooling_switch"]
    assert folded("", 5) == [""]


def test_a_piped_table_is_as_wide_as_it_needs(tool):
    shown = tool("identify", SPINDLE, "--until", 60, "--format", "table", "-q").out
    header = next(line for line in shown.splitlines() if line.startswith("sensor"))
    for heading in ("settles degC", "95 % interval", "measured", "to go min", "ahead K", "status"):
        assert heading in header
    assert shown.count("T10 ") == 1


# --- never ok against its own evidence ------------------------------------------------------------------------------------------------


def test_a_row_is_not_ok_against_the_readings_after_it(tool):
    time = np.arange(401.0)
    two = 20 + 8 * (1 - np.exp(-time / 40)) + 6 * (1 - np.exp(-time / 400)) + 0.02 * np.random.default_rng(0).standard_normal(401)
    bare = Method(Lump(), Filter_(), imperfection=NONE, rates="own")
    law = identify_sensor("run", "T1", time, two, bare, 45.0).record
    assert law.steady_state_hi_c - law.steady_state_lo_c < law.rmse_ahead_c
    assert law.status == "model_doubtful"
    assert "the readings after 45 min leave the prediction's band, by up to" in law.message
    record = identify_sensor("run", "T1", time, two, Method(Lump(), Filter_()), 60.0).record
    assert record.rmse_ahead_c > 1.0
    assert record.steady_state_hi_c - record.steady_state_lo_c > 4.0 * (law.steady_state_hi_c - law.steady_state_lo_c)
    assert record.status == "model_doubtful"
    assert "the readings after 60 min leave the prediction's band, by up to" in record.message
    assert "a second mass slower than" in record.unseen


def Filter_():  # noqa: N802
    from thermofast.filters import Afukf

    return Afukf()


@pytest.mark.proof
def test_exact_records_are_hardly_ever_told_against_themselves():
    rng = np.random.default_rng(11)
    time, against = np.arange(301.0), 0
    for until in (30.0, 45.0, 60.0, 120.0):
        for _ in range(60):
            rate = rng.uniform(0.008, 0.03)
            reading = np.round((26.7 - 8.8 * np.exp(-rate * time) + rng.normal(0, 0.02, 301)) / 0.01) * 0.01
            record = identify_sensor("run", "T1", time, reading, Method(Lump(), Filter_()), until).record
            against += "prediction's band" in record.message
    assert against <= 2  # of 240


def test_a_contradiction_needs_several_readings():
    residual, half = np.zeros(100), np.full(100, 0.1)
    residual[50] = 5.0
    assert contradiction(residual, half, 0.02) is None
    residual[40:60] = -0.5
    assert contradiction(residual, half, 0.02) == pytest.approx(0.5)


# --- words ----------------------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    """Two sensors whose load steps at 180 min as the speed is logged to do, and a room that is logged."""
    rng = np.random.default_rng(4)
    time = np.arange(361.0)
    speed = np.where(time < 180, 2000.0, 3000.0)
    heat = np.where(time < 180, 1.0, 1.5)
    columns = []
    for rate, rise in ((0.02, 9.0), (0.03, 6.0)):
        curve = np.empty(361)
        curve[0] = 20.0
        for k in range(1, 361):
            curve[k] = 20.0 + rise * heat[k] + (curve[k - 1] - 20.0 - rise * heat[k]) * np.exp(-rate)
        columns.append(curve + 0.02 * rng.standard_normal(361))
    room = 20.0 + 0.01 * rng.standard_normal(361)
    path = tmp_path_factory.mktemp("stepped") / "run.csv"
    rows = zip(time, *columns, speed, room, strict=True)
    path.write_text("time_min,T1,T2,speed,ambient\n" + "".join(f"{t:g},{a:.3f},{b:.3f},{s:g},{r:.3f}\n" for t, a, b, s, r in rows))
    return str(path)


def test_a_logged_column_that_steps_is_named(stepped, tool):
    found = json.loads(tool("compare", stepped, "--until", 170, "--format", "json", "-q").out)["records"]
    for record in found:
        assert "speed steps from 2000 to 3000 at 180 min" in record["message"]
        assert "nothing logs" not in record["message"]
    verdict = json.loads(tool("diagnose", stepped, "--until", 170, "--format", "json", "-q").out)["records"][0]
    assert verdict["verdict"] == "none"
    assert "times the noise" in verdict["advice"]
    assert "nothing to add" not in verdict["advice"]


@pytest.mark.proof
def test_no_rival_is_the_verdict_in_another_order(tool):
    found = json.loads(tool("diagnose", ROOT / "sample_runs" / "hidden_two.csv", "--format", "json", "-q").out)["records"]
    for record in found:
        named = sorted(record["verdict"].split("+"))
        assert all(sorted(other.split("+")) != named for other in record["also_possible"])
        assert "log the ambient" not in record["advice"]  # it is logged


def test_hints_leave_out_what_is_logged(stepped):
    from thermofast.discovery.wording import hints_of
    from thermofast.models.effects import BUILT_IN
    from thermofast.models.search.candidates import Candidate
    from thermofast.observing.task import LoopTask, ready
    from thermofast.reading import read_runs

    prepared = ready(LoopTask(read_runs(stepped)[0]))[1]

    class Part:
        def __init__(self, effect):
            self.effect = effect

    class Some:
        parts = tuple(Part(kind()) for kind in BUILT_IN)

    some: Candidate = Some()
    told = hints_of([some], prepared.seen)
    assert told
    assert not [h for h in told if h.startswith("log the ambient") or ("speed" in h and h.startswith("log "))]


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["identfy", SPINDLE], "did you mean 'identify'?"),
        (["help", "swep"], "did you mean 'sweep'?"),
        (["effects", "second_mod"], "did you mean 'second_mode'?"),
        (["diagnose", HIDDEN, "--effects", "ambeint"], "did you mean 'ambient'?"),
        (["identify", SPINDLE, "--filter", "afuk"], "did you mean 'afukf'?"),
        (["filters", "ukff"], "did you mean 'ukf'?"),
        (["identify", SPINDLE, "--channels", "ambeint"], "did you mean 'ambient'?"),
        (["compare", SPINDLE, "--drive", "amient"], "is no logged input"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_nearest(arguments, hint, tool):
    done = tool(*arguments)
    assert (done.code, done.out) == (2, "")
    assert hint in done.err


def test_help_lists_commands_by_task_and_reading_options_once(tool):
    from thermofast.main import TASKS
    from thermofast.reading_options import Options

    shown = tool("--help").out
    for task, commands in TASKS.items():
        assert f"{task}:" in shown
        assert all(name in shown for name in commands)
    reading = tool("help", "reading").out
    options = ["--" + name.removesuffix("_s").removesuffix("_min").replace("_", "-") for name in (*vars(Options()), "start")]
    for option in options:
        assert re.search(rf"^\s*{option} ", reading, re.M)
    for name in ("identify", "diagnose", "sweep"):
        page = tool("help", name).out
        assert page == tool(name, "--help").out
        assert "thermofast help reading" in page
        assert not re.search(r"^\s*--delimiter CHAR", page, re.M)


def test_progress_of_a_single_run_shows_on_a_terminal(monkeypatch, capsys):
    from thermofast.output import screen
    from thermofast.workers.engine import _counted

    done = []
    assert list(_counted(map, done.append)(abs, [-1, -2])) == [1, 2]
    assert done == [1, 1]
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with screen.progress(1, "models tried", False) as advance:
        advance(3)
    assert "models tried" in capsys.readouterr().err
    with screen.progress(1, "models tried", True) as advance:
        advance(1)
    assert capsys.readouterr().err == ""


def test_pictures_promise_nothing_that_is_not_determined(tool, tmp_path):
    from thermofast.estimation.curves import marks
    from thermofast.records import IdentifyRecord

    open_ended = IdentifyRecord("r", "T1", "afukf", steady_state_c=25.0, t95_min=90.0, status="not_determined")
    assert marks(open_ended, 0.0) == ("not determined", None, None)
    good = IdentifyRecord("r", "T1", "afukf", steady_state_c=25.0, steady_state_lo_c=24.9, steady_state_hi_c=25.1, t95_min=90.0)
    assert marks(good, 10.0) == ("settles at 25.00 °C (24.90..25.10)", 25.0, 100.0)
    path = tmp_path / "a.svg"
    assert tool("compare", HIDDEN, "--until", 120, "-q", "--save-plot", path, "--format", "csv").code == 0
    assert path.read_text().count("the model fails") == 1  # named once, in the legend


def test_readme_blocks_can_be_pasted():
    for page in [ROOT / "README.md"]:
        for block in re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.M | re.S):
            assert not re.search(r"^\$ ", block, re.M)


def test_advice_names_what_can_be_called(tool, tmp_path):
    assert "thermofast filters bench run.csv" in tool("filters", "bench").err
    assert ".toml" in tool("improve", "sample_runs/hidden.csv", "--auto", "-o", tmp_path / "m.foo").err
    refused = tool("inspect", "sample_runs/spindle.csv", "--write", tmp_path / "none" / "x.toml")
    assert "there is no folder" in refused.err
    assert refused.out == ""  # before anything is read


def test_what_another_sensor_is_told_too_is_said_once():
    """One sensor has a word of its own before what all have: the paragraph stood there twice."""
    told = _told_once([("T1", "the model fails"), ("T2", "T2: 9 readings left out; the model fails"), ("T3", "another")])
    assert told == [("T1", "the model fails"), ("T2", "9 readings left out"), ("T2", "the model fails"), ("T3", "another")]


def test_a_picture_has_names_in_any_script(tmp_path, tool):
    """Without a warning, which the suite takes for an error, also where this machine has no font for them."""
    path = tmp_path / "run.csv"
    path.write_text("time_min,温度1\n" + "".join(f"{k},{20 + 8 * (1 - 0.97**k):.2f}\n" for k in range(90)), encoding="utf-8")
    done = tool("identify", path, "-q", "--save-plot", tmp_path / "picture.png")
    assert done.code == 0
    assert done.err == ""
