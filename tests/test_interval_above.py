"""A file without a column of time whose head says how far apart its rows are."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.reading.headings.interval import interval_above


@pytest.mark.parametrize(
    ("line", "seconds"),
    [
        ("Sample interval: 60 s", 60.0),
        ("Sampling interval;1min", 60.0),
        ("# sampling rate 1 Hz", 1.0),
        ("Interval,00:00:30", 30.0),
        ("Abtastintervall: 500 ms", 0.5),
        ("Abtastrate;2 Hz;;;", 0.5),
        ("Rate: 0.5 Sa/s", 2.0),
        ("Messintervall: 2,5 s", 2.5),
        ('"Interval (s)","10"', 10.0),
        ("Interval [min]: 2", 120.0),
        ("Scan rate: 10 s", 10.0),
        ("Log Interval = 5 sec", 5.0),
        ("采样间隔：1 s", 1.0),
        ("Recording Interval,01:00:00", 3600.0),
    ],
)
def test_what_a_head_says_of_its_rows(line, seconds):
    assert interval_above(["Logger XY", line, "Serial 12345"]) == (pytest.approx(seconds), line.strip().strip(",;\t "))


@pytest.mark.parametrize(
    "line",
    [
        "Report period: 2024-03-14 08:00:00",
        "Interval",
        "Interval: 60",
        "Interval: 0 s",
        "Interval: 00:00:00",
        "Interval: 5 K",
        "Flow rate: 12 l/min",
        "Heart rate 60 min ago",
        "interval,front,rear",
        "Calibration interval: 12 months",
        "Frame rate 25 fps",
    ],
)
def test_what_says_nothing_of_rows(line):
    assert interval_above([line]) is None


def test_two_that_do_not_agree_are_none():
    assert interval_above(["Interval: 10 s", "Sample interval: 1 min"]) is None
    assert interval_above(["Interval: 60 s", "Sample interval: 1 min"]) == (60.0, "Interval: 60 s")


@pytest.mark.parametrize("sep", [",", ";", "\t"])
def test_the_refusal_says_what_to_give_and_that_reads_the_file(tmp_path, sep):
    file = tmp_path / "run.csv"
    rows = [sep.join(f"{20.0 + rise * -np.expm1(-i / 60):.2f}" for rise in (8, 5)) for i in range(300)]
    file.write_text("\n".join(["Logger XY", f"Sample interval{sep}30 s", "", sep.join(("front", "rear")), *rows]))
    with pytest.raises(tf.InputError) as refused:
        tf.read(file)
    assert "above them 'Sample interval" in str(refused.value)
    assert "interval=30 if every row is as far apart as that line says" in str(refused.value)
    assert tf.read(file, interval=30.0).time_s[-1] == pytest.approx(299 * 30.0)


def test_long_lines_cost_nothing():
    assert interval_above(["sampling " * 20_000 + "interval: 60 s", "interval" * 50_000, "_ " * 100_000]) is None
