"""Forms of files that a reader from outside found read wrong without a word: factors of time, signs of thousands, names."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.reading.signs import sign_of
from thermofast.reading.units import to_celsius
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


#: Resistances of a Pt100 [ohm] at [degC], as IEC 60751 (2008) prints them.
IEC_60751 = [
    (-200.0, 18.52),
    (-100.0, 60.26),
    (-50.0, 80.31),
    (0.0, 100.0),
    (25.0, 109.73),
    (100.0, 138.51),
    (200.0, 175.86),
    (850.0, 390.48),
]


@pytest.mark.parametrize(("degrees", "ohms"), IEC_60751)
def test_ohms_of_platinum_are_those_of_the_standard(degrees, ohms):
    """To the last digit that it prints: 5 mohm, over 0.3 to 0.43 ohm for a kelvin."""
    assert to_celsius(np.array([ohms]), "Pt100")[0] == pytest.approx(degrees, abs=0.018)
    assert to_celsius(np.array([10.0 * ohms]), "Pt1000")[0] == pytest.approx(degrees, abs=0.018)


def test_what_no_temperature_makes_of_platinum_is_no_reading():
    assert np.isnan(to_celsius(np.array([5.0, 500.0, 1e4]), "Pt100")).all()


def test_ohms_are_asked_for_and_then_read(tmp_path):
    rows = [f"{30 * k},{108.0 + 0.02 * k:.3f}" for k in range(60)]
    path = _file(tmp_path, "time_s,Pt100_1", rows)
    with pytest.raises(tf.InputError, match="units=Pt100 for ohms, else C"):
        tf.read(path)
    assert tf.read(path, units=["Pt100"]).channels["Pt100_1"][[0, -1]] == pytest.approx([20.53, 23.57], abs=0.02)
    assert tf.read(path, units=["C"]).channels["Pt100_1"][0] == 108.0


@pytest.mark.parametrize("unit", ["degR", "°R", "Rankine"])
def test_degrees_rankine(unit, tmp_path):
    """A German temperature of 0 degC is 491.67 degR; a single R is the rear of a machine."""
    run = tf.read(_file(tmp_path, f"time_s,front [{unit}]", [f"{30 * k},{491.67 + 0.18 * k:.2f}" for k in range(60)]))
    assert next(iter(run.channels.values()))[[0, 10]] == pytest.approx([0.0, 1.0], abs=1e-9)
    assert sign_of("front_R", "").unit is None


def test_a_tag_index_names_sensors_and_channels_choose_among_them(tmp_path):
    """FactoryTalk's form: the sensor is a number in a column of its own."""
    rows = [f"2026-05-03 20:{k // 2:02d}:{30 * (k % 2):02d},{i},{20 + i + 0.1 * k:.2f},U" for k in range(100) for i in range(3)]
    path = _file(tmp_path, "DateAndTime,TagIndex,Val,Status", rows)
    assert list(tf.read(path).channels) == ["tag 0", "tag 1", "tag 2"]
    chosen = tf.read(path, channels=["tag 1"])
    assert list(chosen.channels) == ["tag 1"]
    assert chosen.channels["tag 1"][[0, 99]] == pytest.approx([21.0, 30.9])
    with pytest.raises(tf.UsageError, match="tag 9"):
        tf.read(path, channels=["tag 9"])


def test_settings_beside_temperatures_are_none(tmp_path):
    """Emissivity, gains, a signal in dBm; what never changes, far from every temperature; a probe that is stuck among them stays."""
    head = "time_s,T_front,T_rear,Emissivity,PID_I,wifi_dbm,Window,Nut"
    rows = [f"{30 * k},{21 + 0.05 * k:.2f},{22 + 0.04 * k:.2f},0.95,{0.2 * k:.1f},-70,7,22.5" for k in range(60)]
    run = tf.read(_file(tmp_path, head, rows))
    assert list(run.channels) == ["T_front", "T_rear", "Nut"]
    assert list(tf.read(_file(tmp_path, head, rows), channels=["Window"]).channels) == ["Window"]


def test_what_never_changes_beside_a_probe_that_read_nothing_stays(tmp_path):
    """There is no range then that it could be outside of."""
    run = tf.read(_file(tmp_path, "time_s,T_front,Nut", [f"{30 * k},,22.5" for k in range(60)]))
    assert "Nut" in run.channels


def test_least_and_greatest_are_no_minutes(tmp_path):
    """Yokogawa's line of kinds, MIN and MAX of each channel, stands under the units."""
    head = "\n".join(
        [
            "Ch,,,CH0001,CH0001,CH0002,CH0002",
            "Tag,,,front,front,rear,rear",
            "Unit,,,degC,degC,degC,degC",
            "Type,,,MIN,MAX,MIN,MAX",
            "Date,Time,sub sec,CH0001,CH0001,CH0002,CH0002",
        ]
    )
    rows = [
        f"2026/05/03,20:{k:02d}:00,000,{20 + k / 10:.1f},{20.2 + k / 10:.1f},{21 + k / 10:.1f},{21.2 + k / 10:.1f}"
        for k in range(40)
    ]
    run = tf.read(_file(tmp_path, head, rows))
    names = [f"{place} CH000{i} {what}" for i, place in ((1, "front"), (2, "rear")) for what in ("MIN", "MAX")]
    assert [n.partition(" [")[0] for n in run.channels] == names
    assert [c[0] for c in run.channels.values()] == pytest.approx([20.0, 20.2, 21.0, 21.2])


def test_a_clock_in_a_preamble_is_no_header(tmp_path):
    """Optris: the line of the hour begins as that of the names does."""
    head = "Date\t05/03/2026\nTime\t20:38:07\nTemperature unit\t°C\n\nTime\tArea 1\tArea 2"
    run = tf.read(
        _file(tmp_path, head, [f"00:{k:02d}:00,000\t{21 + k / 10:.1f}\t{22 + k / 10:.1f}".replace(".", ",") for k in range(40)])
    )
    assert [c[-1] for c in run.channels.values()] == pytest.approx([24.9, 25.9])


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        (
            "time_s,front",
            [f"{k},{20 + k / 10:.1f} {'°C' if k < 30 else '°F'}" for k in range(60)],
            "the unit changes within the record",
        ),
        ("Uhrzeit;vorne;hinten", [f"20.{k:02d};{20 + k},5;{21 + k},5" for k in range(40)], "a time of day is 20:00"),
    ],
)
def test_advice_says_what_is_the_matter(head, rows, said, tmp_path):
    with pytest.raises(tf.InputError) as told:
        tf.read(_file(tmp_path, head, rows))
    assert said in str(told.value)


def test_a_decimal_comma_makes_no_constant_of_a_conductor():
    """R0 1,5 and T0 20 written by a German: 1, 5 degC and a k of 20."""
    with pytest.raises(tf.UsageError, match=r"as in 1\.5,20"):
        options_from({"resistance": "1,5,20"})
    assert options_from({"resistance": "1.5,20,225"}).resistance == (1.5, 20.0, 225.0)
