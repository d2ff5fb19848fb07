"""watch: a file while a logger writes it, whatever the logger does, and when a test may be stopped."""

import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import thermofast as tf
from thermofast.analysis.watching import HOLDS, TOGETHER, Look, Watch, first_readings, thinned
from thermofast.errors import InputError
from thermofast.output.files import append_line
from thermofast.pipeline.methods import choose
from thermofast.pipeline.watching import events_before, speed_of, watch_run
from thermofast.reading import Options
from thermofast.reading.follow import Follower, whole_lines
from thermofast.reading.source import BAD_ROW, CUT_ROW, read_growing
from thermofast.records import IdentifyRecord

HEAD = b"time_min,T1\n"


def lines(first, last):
    return b"".join(b"%d,%.3f\n" % (k, 20 + 9 * -np.expm1(-k / 60)) for k in range(first, last))


def test_a_growing_file_is_read_by_whole_lines(tmp_path):
    path = tmp_path / "log.csv"
    follower = Follower(str(path))
    assert follower.poll() is None  # not there yet
    path.write_bytes(HEAD + lines(0, 5) + b"5,20.")
    assert follower.poll() == HEAD + lines(0, 5)
    assert follower.poll() is None
    with path.open("ab") as file:
        file.write(b"718\n6,2")
    assert follower.poll().endswith(b"5,20.718\n")
    assert not follower.notes


def test_a_file_rotated_or_truncated_goes_on_without_its_heading(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(HEAD + lines(0, 8))
    follower = Follower(str(path))
    follower.poll()
    with path.open("ab") as file:
        file.write(lines(8, 10))  # nobody looked before the file was given another name
    path.rename(tmp_path / "log.csv.1")
    path.write_bytes(HEAD + lines(10, 12))
    assert follower.poll() == HEAD + lines(0, 12)
    assert "rotated" in follower.notes[0]
    path.write_bytes(HEAD + lines(12, 13))
    assert follower.poll() == HEAD + lines(0, 13)
    assert "truncated" in follower.notes[1]


def test_a_file_written_again_replaces_what_was_read(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(HEAD + lines(0, 6))
    follower = Follower(str(path))
    follower.poll()
    path.write_bytes(HEAD.replace(b"T1", b"front") + lines(0, 9))
    assert follower.poll() == HEAD.replace(b"T1", b"front") + lines(0, 9)
    assert follower.notes == ["the file was written again"]
    with pytest.raises(tf.InputError, match="a folder"):
        Follower(str(tmp_path)).poll()


def test_what_does_not_grow_by_lines_is_not_followed(tmp_path, tool):
    for name, begin, what in (
        ("run.csv.gz", b"\x1f\x8b\x08", "gzip"),
        ("run.xlsx", b"PK\x03\x04", "workbook"),
        ("r", b"PAR1", "Parquet"),
    ):
        (tmp_path / name).write_bytes(begin + b"0" * 50)
        with pytest.raises(tf.InputError, match=f"(?s){what}.*--replay 600"):
            Follower(str(tmp_path / name)).poll()
    (tmp_path / "two.csv").write_bytes(HEAD)
    said = tool("watch", tmp_path / "two.csv#1", "--tolerance", 0.5, "--give-up", 0.001).err
    assert "never appeared" in said
    assert "itself is followed in its last run" in said


def test_lines_that_end_as_those_of_old_instruments(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes((HEAD + lines(0, 5)).replace(b"\n", b"\r") + b"5,20.")
    assert Follower(str(path)).poll() == (HEAD + lines(0, 5)).replace(b"\n", b"\r")
    assert whole_lines(b"a,b\r\n1,2\r", None) == b"a,b\r\n"


def test_a_line_of_two_byte_letters_ends_whole():
    text = "a,b\n1,2\n3".encode("utf-16")
    assert whole_lines(text, None) == "a,b\n1,2\n".encode("utf-16")


def record(channel, half, status="ok", rate=0.05):
    return IdentifyRecord(
        "run",
        channel,
        "afukf",
        steady_state_c=29.0,
        steady_state_lo_c=29 - half,
        steady_state_hi_c=29 + half,
        rate_per_min=rate,
        status=status,
    )


def rising(minutes, rise=9.0):
    time = np.linspace(0.0, minutes, 40)
    return tf.read({"time_min": time, "a": 20 + rise * -np.expm1(-time / 60), "b": 20 + rise * -np.expm1(-time / 80)})


def test_it_stops_when_all_sensors_are_within_the_tolerance_and_stay_so():
    said = {"a": 0.4, "b": 0.6}
    watch = Watch(lambda run, start: tuple(record(c, h) for c, h in said.items()), 0.5)
    assert not watch.look(rising(60.0)).stop
    said["b"] = 0.499 / TOGETHER
    first = watch.look(rising(61.0))
    assert first.within == (True, True)
    assert not first.stop
    said["b"] = 0.6
    assert not watch.look(rising(70.0)).stop
    said["b"] = 0.4
    assert not watch.look(rising(71.0)).stop
    assert watch.look(rising(71.0 * (1 + HOLDS) + 0.01)).stop
    assert watch.due(75.0)
    assert not watch.due(watch.last_min * 1.005)


def test_a_machine_that_heat_has_not_reached_is_not_settled():
    watch = Watch(lambda run, start: (record("a", 0.01), record("b", 0.01)), 0.5)
    for minutes in (20.0, 22.0, 25.0):
        assert not watch.look(rising(minutes, 0.2)).stop
    slow = Watch(lambda run, start: (record("a", 0.01, rate=0.01), record("b", 0.01, rate=0.01)), 0.5)
    for minutes in (60.0, 70.0, 80.0, 140.0):
        assert not slow.look(rising(minutes)).stop  # not before one and a half time constants
    assert not slow.look(rising(152.0)).stop
    assert slow.look(rising(157.0)).stop
    there = Watch(slow.identify, 0.5)
    assert there.look(rising(200.0)).stop  # a record that was there already is looked at as it was 3 % earlier, too
    known = Watch(lambda run, start: (record("a", 0.01, rate=0.01), record("b", 0.01, rate=0.01)), 0.5, known=True)
    assert known.look(rising(40.0)).stop
    doubtful = Watch(lambda run, start: (record("a", 0.01), record("b", 0.01, "model_doubtful")), 0.5)
    for minutes in (60.0, 70.0, 80.0):
        assert not doubtful.look(rising(minutes)).stop


def test_what_came_long_after_a_change_on_the_way_stops_the_watch_by_itself():
    """Records in doubt as a whole: their later half counts once it is one and a half of the longer time constants long."""
    lengths, pace = [], 0.02

    def identify(run, start):
        minutes = run.time_s[-1] / 60.0
        lengths.append(minutes)
        whole = start is None  # where its rise begins; of the later half from its first reading on
        assert whole or start == 0.0
        said = record("a", 0.1, "model_doubtful" if whole else "ok", rate=0.01 if whole else pace)
        return (said,)

    asked = []

    def happened(run, minute):
        asked.append(minute)
        return event < minute

    event = 60.0
    watch = Watch(identify, 0.5, happened=happened)
    assert not watch.look(rising(200.0)).stop
    assert lengths[-1] == pytest.approx(100.0, abs=6.0)  # the later half, which is one time constant of the whole
    first, second = watch.look(rising(330.0)), watch.look(rising(350.0))
    assert (first.from_min, first.stop) == (165.0, True)  # and as it was 3 % earlier
    assert second.stop
    assert "you can stop now" in second.words
    assert "by the readings from 175 min on" in second.words
    assert second.records[0].t95_min is None
    assert second.records[0].start_min == 175.0
    assert second.records[0].message.startswith("by the readings from 175 min on")
    assert asked == [165.0]  # it takes seconds, and is not asked at every look
    event = 200.0
    assert not Watch(identify, 0.5, happened=happened).look(rising(330.0)).stop
    assert not Watch(identify, 0.5).look(rising(330.0)).stop  # a model that is wrong all the time is wrong in the later half, too
    pace = 0.005
    assert not Watch(identify, 0.5, happened=happened).look(rising(330.0)).stop
    # A gap over the later half leaves nothing to foretell from.
    kept, whole = rising(330.0), slice(0, 20)
    gap = replace(
        kept, time_s=np.append(kept.time_s[whole], 330.0 * 60.0), channels={"a": np.append(kept.channels["a"][whole], 29.0)}
    )
    assert not Watch(identify, 0.5, happened=happened).look(gap).stop


@pytest.mark.proof
def test_a_watch_from_a_named_minute_on_counts_halves_and_events_from_there(tmp_path):
    asked = []

    def identify(run, start):
        asked.append((run.time_s[-1] / 60.0, start))
        return (record("a", 0.1, "model_doubtful" if start else "ok"),)

    Watch(identify, 0.5, start_min=30.0).look(rising(130.0))
    assert asked[0] == (130.0, 30.0)
    assert asked[1] == (pytest.approx(50.0, abs=4.0), 0.0)
    rng, time = np.random.default_rng(2), np.arange(0.0, 200.0, 0.5)
    heat, reading = np.where((time < 30.0) | ((time > 77.0) & (time < 87.0)), 0.0, 10.0), [20.0]
    for h in heat[:-1]:
        reading.append(20.0 + h + (reading[-1] - 20.0 - h) * np.exp(-0.5 / 40.0))
    run = tf.read({"time_min": time, "a": np.array(reading) + 0.02 * rng.standard_normal(len(time))})
    assert not events_before((run, 30.0), 60.0)  # 47 to 57 min after the start
    assert events_before((run, 30.0), 90.0)
    law = {"time_min": time, "a": 20.0 - 10.0 * np.expm1(-time / 40.0) + 0.02 * rng.standard_normal(len(time))}
    assert not events_before((tf.read(law), 0.0), 90.0)  # nothing happened


@pytest.mark.proof
def test_a_pause_on_the_way_does_not_keep_a_watch_waiting_for_ever():
    """Heat off from 40 to 47 min, by an exact lump of 40 min: stopped at four time constants, with the right number."""
    rng, time = np.random.default_rng(2), np.arange(0.0, 200.0, 0.5)
    reading = np.full(len(time), 20.0)
    for k in range(1, len(time)):
        goal = 20.0 if 40.0 < time[k] <= 47.0 else 32.0
        reading[k] = goal + (reading[k - 1] - goal) * np.exp(-0.5 / 40.0)
    columns = {"time_min": time, "T": reading + rng.normal(0.0, 0.02, len(time))}
    watch = Watch(lambda seen, start: tf.identify(seen).records, 0.5, happened=lambda seen, at: events_before((seen, 0.0), at))
    looks = [watch.look(first_readings(tf.read(columns, name="run"), int(2 * minutes))) for minutes in (100, 120, 150, 160, 170)]
    last = looks[-1]
    assert not looks[0].stop
    assert last.stop
    assert abs(last.records[0].steady_state_c - 32.0) < 0.5


def test_a_long_record_is_averaged_without_its_outliers():
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 36000.0, 1.0)
    values = 20 + 9 * -np.expm1(-time / 3600) + 0.02 * rng.standard_normal(len(time))
    values[5000] += 40.0
    run = tf.read({"time_s": time, "a": values})
    short = thinned(run)
    assert 1900 < len(short.time_s) < 2200
    assert short.channels["a"] == pytest.approx(20 + 9 * -np.expm1(-short.time_s / 3600), abs=0.03)
    assert thinned(short) is short


def test_a_replay_says_stop_once_and_ends_there(tool, tmp_path):
    done = tool(
        *("watch", "sample_runs/spindle.csv", "--tolerance", 1, "--channels", "T3,T4", "--replay", "max", "--exit"),
        *("--jsonl", tmp_path / "looks.jsonl", "--exec", f"echo stopped > {tmp_path / 'told'}", "--format", "json"),
    )
    assert done.code == 0, done.err
    assert done.err.count("you can stop now") == 1
    assert (tmp_path / "told").read_text() == "stopped\n"
    looks = [json.loads(line) for line in (tmp_path / "looks.jsonl").read_text().splitlines()]
    assert [look["stop"] for look in looks].index(True) == len(looks) - 1
    assert len(looks) > 30
    last = {r["channel"]: r for r in json.loads(done.out)["records"]}
    whole = json.loads(tool("identify", "sample_runs/spindle.csv", "--channels", "T3,T4", "--format", "json", "-q").out)
    for r in whole["records"]:
        assert abs(last[r["channel"]]["steady_state_c"] - r["steady_state_measured_c"]) < 1.0
    assert looks[-1]["minutes"] < 120
    heard = []
    called = tf.watch("sample_runs/spindle.csv", 1.0, replay="max", told=heard.append, channels=["T3", "T4"])
    assert called.stop
    assert called["T3"].steady_state_c == pytest.approx(last["T3"]["steady_state_c"], abs=1e-9)
    assert len(heard) == len(looks)


def test_a_file_is_followed_to_the_moment(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(HEAD)
    command = [
        sys.executable,
        "-m",
        "thermofast",
        "watch",
        str(path),
        "--tolerance",
        "1",
        "--exit",
        "--poll",
        "0.05",
        "--format",
        "json",
    ]
    watching = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"COLUMNS": "100"})
    rng = np.random.default_rng(4)
    for k in range(0, 300, 5):
        if watching.poll() is not None:
            break
        with path.open("ab") as file:
            for m in range(k, k + 5):
                file.write(b"%d,%.3f\n" % (m, 20 + 9 * -np.expm1(-m / 40) + 0.01 * rng.standard_normal()))
        time.sleep(0.12)
    out, err = watching.communicate(timeout=60)
    assert watching.returncode == 0, err
    assert b"you can stop now" in err
    told = json.loads(out)["records"][0]
    assert told["steady_state_c"] == pytest.approx(29.0, abs=0.5)
    assert told["samples"] < 290


def test_standard_input_is_followed_to_its_end():
    record = HEAD + lines(0, 50)
    command = [sys.executable, "-m", "thermofast", "watch", "-", "--poll", "0.05", "--format", "json", "-q"]
    done = subprocess.run(command, input=record, capture_output=True, check=True, timeout=60)
    assert json.loads(done.stdout)["records"][0]["samples"] == 50


def test_a_stop_is_withdrawn_in_words_and_a_second_test_is_told_anew(tmp_path, capsys):
    from thermofast.shell.live import Looks, commanded, shown

    marker = tmp_path / "fired"
    looks = Looks(None)
    with commanded(f"echo x >> {marker}") as commands, shown(0.5, False, looks, commands) as tell:
        for minutes, half, stop in (
            (50.0, 0.4, True),
            (52.0, 0.4, True),
            (60.0, 0.7, False),
            (10.0, 0.9, False),
            (55.0, 0.3, True),
        ):
            assert looks.stopped == (minutes != 50.0)  # once it was said, it is remembered
            tell(Look(minutes, (record("a", half),), (half <= 0.5,), stop), ())
    said = capsys.readouterr().err
    assert said.count("you can stop now") == 2
    assert said.count("no longer sure") == 1
    assert marker.read_text() == "x\nx\n"


def test_a_record_that_ends_too_soon_has_a_code_of_its_own(tool):
    done = tool("watch", "sample_runs/spindle.csv", "--tolerance", 0.001, "--replay", "max", "--exit", "--channels", "T1")
    assert done.code == 3
    assert "ended before the test could be stopped" in done.err


def test_bad_input_is_met_with_words(tool, tmp_path):
    never = tool("watch", tmp_path / "never.csv", "--give-up", 0.002, "--poll", 0.05)
    assert never.code == 2
    assert "nothing to foretell from was read" in never.err
    speed = tool("watch", "sample_runs/spindle.csv", "--replay", "fast")
    assert speed.code == 2
    assert "600x" in speed.err
    assert speed_of("600x") == 600.0
    assert len(first_readings(rising(60.0), 7).time_s) == 7


@pytest.mark.proof
def test_what_is_waited_for_is_said_where_all_are_within_the_tolerance(tool, tmp_path):
    path = tmp_path / "exact.csv"
    time = np.arange(0.0, 200.0, 0.5)
    noise = np.random.default_rng(4).normal(0.0, 0.02, (2, len(time)))
    readings = [20.0 + (6.0 + k) * -np.expm1(-time / 60.0) + noise[k] for k in range(2)]
    np.savetxt(
        path, np.column_stack([time, *readings]), delimiter=",", header="time_min,T1 [degC],T2 [degC]", comments="", fmt="%.3f"
    )
    watched = tool("watch", path, "--tolerance", 1, "--replay", "max", "--imperfection", "none", "--to", 60)
    assert "2 of 2 sensors within the tolerance" in watched.err
    assert "no stop before 1.5 time constants (" in watched.err
    # A lab whose runs showed no strong effects does not wait for a second mass.
    (tmp_path / "lab.toml").write_text("[imperfection]\nstrong_share = 0.005\nmultiplier = 0.1\n")
    lab = ("--tolerance", 1, "--replay", "max", "--imperfection", tmp_path / "lab.toml", "--to", 80)
    stopped = tool("watch", path, *lab).err
    assert "you can stop now" in stopped
    assert "; it must stay so until " in stopped
    (tmp_path / "lab.toml").write_text("[imperfection]\nmultiplier = 0.1\n")
    assert "no stop before 1.5 time constants (" in tool("watch", path, *lab).err


def test_a_row_that_a_dying_logger_left_behind_is_left_out_and_told(tool, tmp_path):
    lines = Path("sample_runs/spindle.csv").read_text().splitlines(keepends=True)
    glued = lines[150][:20] + lines[151]  # begun again without a line end
    data = "".join([*lines[:120], lines[120][:25] + "\n", *lines[121:150], glued, *lines[152:]]).encode()
    run = read_growing(data, Options(), "run.csv")
    assert len(run.time_s) == len(lines) - 1 - 3
    assert [n for n in run.notes if CUT_ROW in n] == [
        f"line 121 {CUT_ROW} ({lines[120][:25]}) and was left out",
        f"line 151 {CUT_ROW} ({glued[:40]}) and was left out",
    ]
    path = tmp_path / "run.csv"
    path.write_bytes(data)
    watched = tool("watch", path, "--tolerance", 2, "--give-up", 0.01, "--poll", 0.05, "--channels", "T3")
    assert watched.code == 0
    assert f"line 121 {CUT_ROW}" in watched.err
    assert list(read_growing(data.replace(b"T3", b"T\x1b3"), Options(), "run.csv").channels)[2].startswith("T\\x1b3")
    stammered = "".join([*lines[:60], lines[60].replace(",", ",x", 1), *lines[61:90], "?" + lines[90], *lines[91:]]).encode()
    run = read_growing(stammered, Options(), "run.csv")
    assert len(run.time_s) == len(lines) - 1 - 2
    assert sorted(n[:8] for n in run.notes if BAD_ROW in n) == ["line 61 ", "line 91 "]
    with pytest.raises(InputError, match="the row has"):
        read_growing(b"".join([data[:3000], *[b"1,2\n3,4,5,6,7,8,9,10,11\n"] * 30, data[3000:]]), Options(), "run.csv")


def test_a_log_that_can_no_longer_be_read_is_told_at_once(tmp_path):
    told: list[str] = []
    path = tmp_path / "log.csv"
    rows = "".join(f"{m},{20 - 9 * np.expm1(-m / 40):.3f}\n" for m in range(60))
    path.write_bytes(HEAD + rows.encode())

    def tell(look, notes):
        if look is not None:
            with path.open("ab") as file:
                file.write(b"".join(b"%d,1,2\n" % m for m in range(60, 100)))
        told.extend(notes)

    run = watch_run(str(path), Options(), "auto", choose("afukf", None, ()), 0.01, poll_s=0.02, give_up_min=0.01, tell=tell)[1]
    assert run.time_s[-1] == 59 * 60.0
    assert [n for n in told if n.startswith("cannot be read since 59 min: ") and "the row has 3 cells" in n]


def test_watch_and_plan_take_the_machine_from_the_settings_too(tool, tmp_path, monkeypatch):
    run = Path("sample_runs/spindle.csv").resolve()
    monkeypatch.chdir(tmp_path)
    given = ("watch", run, "--replay", "max", "--to", 60, "--channels", "T3", "--tolerance", 0.01, "--format", "json")
    widths = []
    for text in ("", "rates = 'own'\n[imperfection]\nmultiplier = 5\n"):
        (tmp_path / "thermofast.toml").write_text(text)
        (row,) = json.loads(tool(*given).out)["records"]
        widths.append(row["steady_state_hi_c"] - row["steady_state_lo_c"])
    assert widths[1] > 1.5 * widths[0]


def test_a_tolerance_that_the_machine_forbids_is_told(tool):
    watched = tool("watch", "sample_runs/spindle.csv", "--replay", "max", "--to", 100, "--channels", "T3,T4", "--tolerance", 0.1)
    assert ", by the readings alone +-" in watched.err
    assert "K: the machine is the limit (past runs make that less: calibrate, or --model)" in watched.err


def test_a_sensor_that_has_died_is_named_while_the_test_runs():
    minutes = np.arange(0.0, 121.0)
    warm = 20.0 + 8.0 * -np.expm1(-minutes / 40.0)
    dead = np.where(minutes > 60.0, np.nan, warm)
    watch = Watch(lambda run, start: tuple(IdentifyRecord("run", c, "afukf") for c in run.channels), 0.5)
    for readings, said in ((62, False), (80, True), (121, True)):
        run = tf.read({"time_min": minutes[:readings], "T1": warm[:readings], "T2": dead[:readings]})
        words = watch.look(run).words
        assert ("T2 has told no reading since 60 min: --exclude 'T2' goes on without it" in words) == said
    row = IdentifyRecord(
        "run", "T2", "afukf", steady_state_c=30.0, steady_state_lo_c=29.0, steady_state_hi_c=31.0, reading_half_width_c=0.01
    )
    words = Look(300.0, (row,), (False,), False, tolerance_c=0.1, silent=(("T2", 60.0),)).words
    assert "the machine is the limit" not in words
    assert "T2 has told no reading since 60 min" in words


def test_past_runs_are_advised_where_none_are_counted():
    row = IdentifyRecord(
        "run", "T1", "afukf", steady_state_c=30.0, steady_state_lo_c=29.5, steady_state_hi_c=30.5, reading_half_width_c=0.01
    )
    for known, advised in ((False, True), (True, False)):
        said = Look(60.0, (row,), (False,), False, tolerance_c=0.1, known=known).words
        assert "the machine is the limit" in said
        assert ("calibrate, or --model" in said) == advised


def test_a_load_that_stepped_is_no_reason_to_wait_where_it_is_logged(tmp_path):
    """Without the column a test whose load steps in the middle is in doubt from there on, to its end."""
    rng, time = np.random.default_rng(8), np.arange(0.0, 301.0, 6.0)
    after = np.clip(time - 150.0, 0.0, None)
    columns = {"time_min": time, "power_W": np.where(time < 150.0, 400.0, 600.0)}
    for name, rise, tau in (("T1", 8.0, 30.0), ("T2", 6.0, 36.0)):
        columns[name] = (
            20.0 - rise * np.expm1(-time / tau) - 0.5 * rise * np.expm1(-after / tau) + 0.02 * rng.standard_normal(len(time))
        )
    path = tmp_path / "step.csv"
    pd.DataFrame(columns).round(3).to_csv(path, index=False)
    last = tf.watch(path, 0.02, replay="max", drive="power_W", start=0).records
    assert [r.status for r in last] == ["ok", "ok"]
    for row, truth in zip(last, (32.0, 29.0), strict=True):
        assert row.steady_state_lo_c < truth < row.steady_state_hi_c
        assert row.steady_state_hi_c - row.steady_state_lo_c < 1.0
    blind = tf.identify(tf.read(path))
    assert not any(r.status == "ok" and r.steady_state_lo_c > 31.0 and r.steady_state_hi_c < 31.8 for r in blind)
    with pytest.raises(tf.UsageError, match="speed"):
        tf.watch(path, replay="max", drive="speed")


def test_a_command_takes_no_reading_and_prints_none_of_the_results(tmp_path):
    """It reads nothing, its words go to standard error, its code is told though it is quiet, and the table comes first."""
    record = HEAD + lines(0, 400)
    stolen = tmp_path / "stolen"
    command = [sys.executable, "-m", "thermofast", "watch", "-", "--poll", "0.05", "--tolerance", "3", "--format", "csv", "-q"]
    command += ["--exec", f"cat > {stolen}; echo words; exit 7"]
    done = subprocess.run(command, input=record, capture_output=True, check=True, timeout=60)
    assert stolen.read_bytes() == b""
    assert done.stdout.startswith(b"run,channel")
    assert b"words" not in done.stdout
    assert b"words" in done.stderr
    assert b"--exec ended with code 7" in done.stderr


def runs(pid):
    """Whether there is such a process, and not only what is left of one that has ended."""
    status = Path(f"/proc/{pid}/stat")
    if status.exists():
        return status.read_text().rpartition(")")[2].split()[0] != "Z"
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return not Path("/proc/self").exists()


def test_a_command_that_hangs_is_ended_with_all_that_it_began(tmp_path, capfd, monkeypatch):
    from thermofast.shell import live

    monkeypatch.setattr(live, "WAITED_S", 0.3)
    pid = tmp_path / "pid"
    with live.commanded(f"sleep 300 & echo $! > {pid}; wait") as commands:
        commands.begin()
        deadline = time.monotonic() + 20.0
        while not (pid.exists() and pid.read_text().strip()) and time.monotonic() < deadline:
            time.sleep(0.01)
    assert "has been ended: sleep 300" in capfd.readouterr().err
    deadline = time.monotonic() + 20.0
    while runs(int(pid.read_text())) and time.monotonic() < deadline:
        time.sleep(0.02)  # its parent is gone, and who inherits it takes it away soon
    assert not runs(int(pid.read_text()))


def test_looks_that_cannot_be_kept_do_not_end_a_watch(tool, tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    given = ("--replay", "max", "--channels", "T1", "--to", 40, "-q", "--format", "csv")
    done = tool("watch", "sample_runs/spindle.csv", "--jsonl", "/dev/full", *given)
    assert done.code == 2
    assert done.out.startswith("run,channel")
    assert done.err.count("/dev/full: looks are kept no longer: No space left on device") == 1


def test_a_line_is_appended_whole_or_not_at_all(tmp_path):
    """Where ten bytes fit in and twenty are to be written, as on a full disk."""
    resource = pytest.importorskip("resource")
    path = tmp_path / "looks.jsonl"
    append_line(str(path), "first")
    script = f"import thermofast.output.files as f; f.append_line({str(path)!r}, 'second' * 10)"
    full = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (16, 16))}
    done = subprocess.run([sys.executable, "-B", "-c", script], capture_output=True, check=False, **full)
    assert b"File too large" in done.stderr
    assert path.read_text() == "first\n"


def test_a_named_pipe_is_followed_and_given_up(tmp_path, tool):
    """Nobody may ever write to it."""
    if not hasattr(os, "mkfifo"):
        pytest.skip("no named pipes here")
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    command = [sys.executable, "-m", "thermofast", "watch", str(pipe), "--poll", "0.05", "--format", "json", "-q"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as watching:
        pipe.write_bytes(HEAD + lines(0, 50))
        assert json.loads(watching.communicate(timeout=60)[0])["records"][0]["samples"] == 50
    never = tool("watch", pipe, "--give-up", 0.005, "--poll", 0.05)
    assert (never.code, "nothing to foretell from was read" in never.err) == (2, True)


def test_readings_since_the_last_look_count_at_the_end(tmp_path):
    """A look is taken when a record has grown by a hundredth; the last readings are fewer."""
    path = tmp_path / "run.csv"
    path.write_bytes(HEAD + lines(0, 300))
    command = [
        sys.executable,
        "-m",
        "thermofast",
        "watch",
        str(path),
        "--poll",
        "0.05",
        "--give-up",
        "0.03",
        "--format",
        "json",
        "-q",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as watching:
        time.sleep(1.2)
        with path.open("ab") as file:
            file.write(lines(300, 301))
        found = json.loads(watching.communicate(timeout=60)[0])
    assert found["records"][0]["samples"] == 301


def test_a_file_that_is_not_there_is_waited_for_aloud(tmp_path):
    """A name that was mistyped looks like a test that warms up; a folder that is not there is refused."""
    said = []

    def tell(_look, notes):
        said.extend(notes)

    (tmp_path / "spindle_1.csv").write_bytes(HEAD)
    rest = Options(), "auto", choose("afukf", None, ()), 0.5
    with pytest.raises(InputError, match="the file never appeared"):
        watch_run(str(tmp_path / "spindle1.csv"), *rest, poll_s=0.02, give_up_min=0.001, tell=tell)
    assert said == ["waiting for spindle1.csv: it is not there yet; alike there: spindle_1.csv"]
    with pytest.raises(InputError, match="no folder"):
        watch_run(str(tmp_path / "runs" / "spindle.csv"), *rest, tell=tell)


def test_a_file_that_grows_and_cannot_be_read_is_told(tmp_path):
    """Once, after some looks; without it a whole test runs unseen."""
    path, said = tmp_path / "log.csv", []
    path.write_bytes(b"kind\n")

    def tell(_look, notes):
        said.extend(notes)
        with path.open("ab") as file:
            file.write(b"warm\n")

    def write():
        for _ in range(40):
            with path.open("ab") as file:
                file.write(b"warm\n")
            time.sleep(0.02)

    writer = threading.Thread(target=write)
    writer.start()
    with pytest.raises(InputError):
        watch_run(str(path), Options(), "auto", choose("afukf", None, ()), 0.5, poll_s=0.01, give_up_min=0.003, tell=tell)
    writer.join()
    assert sum("it grows, and nothing can be read of it yet" in note for note in said) == 1


def test_two_bytes_a_letter_without_a_mark_are_not_parted_as_bytes():
    """A row of another width is left out of a log of one byte a letter; of two bytes the file is told as it is."""
    text = "time_min,T1\n" + "".join(f"{k},{20 + k}.5\n" for k in range(8)) + "8,28.5,1\n9,29.5\n"
    assert len(read_growing(text.encode(), Options(), "log.csv").channels["T1"]) == 9
    with pytest.raises(InputError, match="line 10"):
        read_growing(text.encode("utf-16-le"), Options(), "log.csv")


def test_a_stop_that_no_longer_holds_at_the_end_is_told_as_that(tool, tmp_path):
    """The load doubles after nine time constants: that it ended before the test could be stopped is not said."""
    path, time = tmp_path / "run.csv", np.arange(0.0, 331.0)
    rise = -8.0 * np.expm1(-time / 30.0) - 8.0 * np.expm1(-np.maximum(time - 290.0, 0.0) / 30.0)
    pd.DataFrame({"time_min": time, "T1": 20.0 + rise + np.random.default_rng(1).normal(0.0, 0.02, 331)}).to_csv(path, index=False)
    done = tool("watch", path, "--tolerance", 1, "--replay", "max")
    assert "you can stop now" in done.err
    assert "what was said of stopping is no longer sure: " in done.err
    assert "ended before" not in done.err


def test_a_watch_says_from_when_on_a_stop_is_possible():
    """Before the sensors are within the tolerance too, once a rate is known; where past runs are known there is no such time."""
    time = np.arange(0.0, 40.0)
    run = tf.read({"time_min": time, "T1": np.round(20.0 + 8.0 * -np.expm1(-time / 60.0), 2)})
    row = IdentifyRecord(
        "r", "T1", "afukf", steady_state_c=28.0, steady_state_lo_c=26.0, steady_state_hi_c=31.0, rate_per_min=1.0 / 60.0
    )
    look = Watch(lambda _run, _start: (row,), 0.5).look(run)
    assert look.within == (False,)
    assert look.waits == "; no stop before about 90 min"
    assert look.words.endswith("no stop before about 90 min")
    assert Watch(lambda _run, _start: (row,), 0.5, known=True).look(run).waits == ""
    unknown = replace(row, steady_state_lo_c=None, status="not_determined")
    assert "not determined yet; no stop before about 90 min" in Watch(lambda _run, _start: (unknown,), 0.5).look(run).words
