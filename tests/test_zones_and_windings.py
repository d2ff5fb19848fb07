"""Zones, units of windings, long tables with units, names above units: files of others, read right."""

from datetime import datetime, timedelta

import numpy as np
import pytest

import thermofast as tf
from thermofast.shell.settings import load_settings


def written(path, stamps, minutes=None):
    rise = 20.0 + 20.0 * -np.expm1(-np.arange(len(stamps)) / 50.0)
    path.write_text("time,T1 [C]\n" + "".join(f"{s},{v:.3f}\n" for s, v in zip(stamps, rise, strict=True)))
    return path


def clock(start, minutes, form, back_at=None):
    """Stamps of a clock that is set back by an hour after so many minutes."""
    at = [datetime.fromisoformat(start) + timedelta(minutes=float(m) - (60 if back_at and m >= back_at else 0)) for m in minutes]
    return [a.strftime(form) for a in at]


def test_a_date_of_two_orders_is_read_so_that_the_clock_of_the_zone_runs_evenly(tmp_path):
    stamps = clock("2026-11-01 00:10", range(181), "%m/%d/%Y %I:%M:%S %p", back_at=110)
    run = tf.read(written(tmp_path / "run.csv", stamps), tz="America/New_York")
    assert run.time_s[-1] == 180 * 60
    assert any(g.about == "date order" for g in run.guesses)


def test_a_time_that_the_clock_never_shows_is_refused(tmp_path):
    stamps = clock("2026-03-29 01:30", range(120), "%Y-%m-%d %H:%M:%S")
    with pytest.raises(tf.UsageError, match="a time that its clock never shows") as refusal:
        tf.read(written(tmp_path / "run.csv", stamps), tz="Europe/Berlin")
    assert "2026-03-29 02:00:00" in str(refusal.value)


def test_an_hour_shown_once_where_it_comes_twice_is_a_guess(tmp_path):
    minutes = [m for m in range(0, 300, 5) if not 60 <= m < 130]
    stamps = clock("2026-10-25 01:00", minutes, "%Y-%m-%d %H:%M", back_at=120)
    path = written(tmp_path / "run.csv", stamps)
    run = tf.read(path, tz="Europe/Berlin")
    assert run.time_s[-1] == 295 * 60
    assert any("taken for the second time" in g.text for g in run.guesses)
    with pytest.raises(tf.InputError, match="strict=True"):
        tf.read(path, tz="Europe/Berlin", strict=True)


def test_windings_in_another_unit_than_r0_are_refused(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_min,R1 [kOhm]\n" + "".join(f"{i},{0.002 - 1e-6 * i:.7f}\n" for i in range(60)))
    with pytest.raises(tf.InputError, match="R0 in the unit of the column"):
        tf.read(path, resistance="1.84,21.5")
    assert 20.0 < np.median(tf.read(path, resistance="0.00184,21.5").channels["R1 [kOhm]"]) < 60.0
    with pytest.raises(tf.UsageError, match="R0 was not measured at 294"):  # kelvin: it would be 426 degC
        tf.read(path, resistance="0.00184,294.65")


def test_a_long_table_with_two_names_and_a_unit_in_each_row(tmp_path):
    path = tmp_path / "run.csv"
    sensors = (("M1", "front"), ("M1", "rear"), ("M2", "front"))
    rows = [
        f"2026-05-03 10:{i:02d}:00;{m};{s};{20 + i / 10 + k:.2f};°C".replace(".", ",")
        for i in range(60)
        for k, (m, s) in enumerate(sensors)
    ]
    path.write_text("time;device;channel;value;unit\n" + "\n".join(rows) + "\n")
    assert list(tf.read(path).channels) == ["M1 front", "M1 rear", "M2 front"]


def test_names_stand_above_a_line_that_repeats_a_unit(tmp_path):
    path = tmp_path / "graphtec.csv"
    rows = [f"{i + 1},2026/05/03 10:{i:02d}:00,000,+   {20 + i / 10:.1f},+   {21 + i / 10:.1f},LLLLLLLLLL,LLLL" for i in range(60)]
    head = ["Vendor,GRAPHTEC Corporation", "Data", "Number,Date&Time,ms,CH1,CH2,Alarm1-10,AlarmOut"]
    path.write_text("\n".join([*head, "NO.,Time,ms,degC,degC,A1234567890,A1234", *rows]) + "\n")
    assert list(tf.read(path).channels) == ["CH1", "CH2"]


def test_a_reading_written_as_settings_keeps_its_stretch_and_its_limits(tool, tmp_path):
    stamps = clock("2026-05-03 10:00", range(100), "%Y-%m-%d %H:%M:%S")
    path = written(tmp_path / "run.csv", stamps)
    done = tool("inspect", path, "--from", 10, "--to", 80, "--max-rows", 1000, "--write", tmp_path / "t.toml", "-q")
    assert done.code == 0
    text = (tmp_path / "t.toml").read_text()
    assert "from = 10.0" in text
    assert "to = 80.0" in text
    assert "max_rows = 1000" in text
    assert load_settings(str(tmp_path / "t.toml"))["identify"]["from_min"] == 10.0


def test_a_switch_off_outside_what_can_be_told(tool, tmp_path):
    minutes = np.arange(1.0, 60.0)
    path = tmp_path / "run.csv"
    path.write_text("time_min,T1\n" + "".join(f"{m:g},{20 + 60 * np.exp(-m / 30):.3f}\n" for m in minutes))
    done = tool("identify", path, "--switch-off-at", 100, "-q")
    assert done.code == 2
    assert "not before the record's end" in done.err
    far = tf.identify(path, switch_off_at=-500.0)[0]
    assert far.switch_off_c is None
    assert "is not told" in far.message
    near = tf.identify(path, switch_off_at=-1.0)[0]
    assert near.switch_off_lo_c < 80.0 < near.switch_off_hi_c
