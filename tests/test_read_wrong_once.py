"""Forms of files that a reader from outside found read wrong without a word: factors of time, signs of thousands, names."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.reading.signs import sign_of
from thermofast.reading.values.time_units import one_unit_alone, steps_of
from thermofast.reading_options import options_from


def _file(tmp_path, head, rows, name="run.csv"):
    path = tmp_path / name
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("name", "unit_cell", "found"),
    [
        ("Zeit [1/10 s]", "", (0.1, "s")),
        ("Time [s/10]", "", (0.1, "s")),
        ("Time [1/100 s]", "", (0.01, "s")),
        ("Time", "1/10 s", (0.1, "s")),
        ("t (0,1 s)", "", (0.1, "s")),
        ("Time [x10 s]", "", (10.0, "s")),
        ("Time [s]", "", None),
        ("Time (min)", "", None),
    ],
)
def test_parts_and_multiples_of_a_unit_are_its_steps(name, unit_cell, found):
    assert steps_of(name, unit_cell) == found


@pytest.mark.parametrize("name", ["Time [ms x 10]", "Time [min*10]", "Time (half-minutes)", "Time (30 s steps)", "Zeit (Std,min)"])
def test_a_unit_with_something_beside_it_is_asked_for(tmp_path, name):
    """The last word that was known was taken, and the rest dropped: times ten to 120 times off."""
    path = _file(tmp_path, f"{name};T1 [°C]", [f"{k};{20 + 0.1 * k:.2f}" for k in range(20)])
    with pytest.raises(tf.InputError, match="the unit of time is not one alone"):
        tf.read(path)
    assert tf.read(path, time_unit="s").time_s[-1] == 19.0
    assert tf.read(path, interval=30.0).time_s[-1] == 19 * 30.0


@pytest.mark.parametrize("name", ["Time (s)", "time [s since 2026-05-03 20:38]", "Elapsed (min)", "Zeit [h]", "t (seconds, UTC+2)"])
def test_a_unit_that_is_one_alone_is_taken(name):
    one_unit_alone("run.csv", name, "")


def test_minutes_and_seconds_with_a_decimal_comma(tmp_path):
    """0,30 is half a minute."""
    rows = [f"{k // 2},{'30' if k % 2 else '00'};{20 + 0.1 * k:.2f}".replace(".", ",") for k in range(40)]
    run = tf.read(_file(tmp_path, "Zeit (min,s);T1 [°C]", rows))
    assert run.time_s[:4].tolist() == [0.0, 30.0, 60.0, 90.0]


def test_three_digits_behind_a_sign_may_be_thousands(tmp_path):
    """Of a furnace of 1205 degC the file says 1,205."""
    maybe = _file(tmp_path, "time_s;Zone 1 (°C)", [f"{k};1,{205 + k}" for k in range(30)])
    run = tf.read(maybe)
    assert any("three digits behind the sign are decimals" in str(g) for g in run.guesses)
    assert not any("three digits" in str(g) for g in tf.read(maybe, decimal=",").guesses)
    surely = _file(tmp_path, "time_s;Zone 1 (°C)", [f"{k};{960 + k}" if k < 40 else f"{k};1.0{k}" for k in range(80)], "b.csv")
    with pytest.raises(tf.InputError, match="a sign of thousands"):
        tf.read(surely)
    cold = _file(tmp_path, "time_s;T1 (°C)", [f"{k};{4 + 0.05 * k:.2f}" for k in range(30)], "c.csv")
    warm = _file(tmp_path, "time_s;T1 (°C)", [f"{k};{21 + 0.0513 * k:.3f}" for k in range(30)], "d.csv")
    frame = {"time_s": np.arange(30.0), "T1 (°C)": 1.0 + np.arange(30.0) / 1000.0}
    assert not any("three digits" in str(g) for source in (cold, warm, frame) for g in tf.read(source).guesses)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Channel 2 - Ambient", "ambient"),
        ("Kanal 3 - Umgebung", "ambient"),
        ("Sensor 3 - Room", "ambient"),
        ("X axis motor", "sensor"),
        ("Y-axis motor bearing", "sensor"),
        ("Heizung Lager", "sensor"),
        ("Valve block", "sensor"),
        ("X axis position", "input"),
        ("Axis load", "input"),
        ("Valve", "input"),
        ("Heizung", "input"),
    ],
)
def test_a_part_of_the_machine_is_one_whatever_stands_beside_it(name, kind, tmp_path):
    rows = [f"{k},{20 + 0.1 * k:.2f},{21 + 0.09 * k:.2f}" for k in range(30)]
    run = tf.read(_file(tmp_path, f"time_s,Spindle,{name}", rows))
    where = {"ambient": run.ambient, "sensor": run.channels, "input": run.inputs}[kind]
    assert any(name in n for n in where), sign_of(name, "")


def test_a_footer_longer_than_the_file_is_none(tmp_path):
    """It took ten minutes and more to leave out a hundred thousand million lines."""
    path = _file(tmp_path, "time_s,T1", [f"{k},{20 + 0.1 * k:.2f}" for k in range(30)])
    with pytest.raises(tf.InputError, match="leaves no line"):
        tf.read(path, skip_footer=99_999_999_999)
    assert options_from({"skip_footer": 3}).skip_footer == 3
    assert len(tf.read(path, skip_footer=3).time_s) == 27


def test_a_pattern_in_quotes_is_looked_up(tmp_path):
    """A shell leaves it as it is."""
    from thermofast.archives.sources import named_by

    for k in (2, 1, 3):
        _file(tmp_path, "time_s,T1", ["0,20", "1,21"], f"m{k}.csv")
    found = named_by([str(tmp_path / "m[12].csv"), "other.csv", "run.csv#2"])
    assert [f.rpartition("/")[2] for f in found] == ["m1.csv", "m2.csv", "other.csv", "run.csv#2"]
    with pytest.raises(tf.InputError, match="no file to read"):
        named_by([str(tmp_path / "x*.csv")])
