"""Forms of files that a reader from outside found read wrong without a word: factors of time, signs of thousands, names."""

from datetime import datetime, timedelta

import numpy as np
import pytest

import thermofast as tf
from thermofast.reading.moments.epochs import clock_with_a_point, compact
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


FRONT = np.round(21.3 + 9.0 * -np.expm1(-np.arange(150.0) / 60.0), 2)
ROOM = np.round(21.2 + 0.01 * np.sin(np.arange(150.0)), 2)
MINUTES_OF_DAY = 478.0 + np.arange(150.0)
MOMENTS = [datetime(2026, 3, 12, 7, 58, 3) + timedelta(minutes=k) for k in range(150)]


@pytest.mark.parametrize(
    ("form", "told"),
    [
        ("%y%m%d%H%M", "YYMMDDhhmm"),
        ("%y%m%d%H%M%S", "YYMMDDhhmmss"),
        ("%Y%m%d%H%M", "YYYYMMDDhhmm"),
        ("%d%m%Y%H%M%S", "DDMMYYYYhhmmss"),
        ("%H.%M", "a clock of hours and minutes"),
    ],
)
def test_moments_without_signs_and_clocks_with_a_point_are_moments(tmp_path, form, told):
    """They were an epoch, seconds that were counted, or hours with decimals: a record of 149 minutes was 4, 161 or 448 long."""
    rows = [f"{m.strftime(form)},{t},{r}" for m, t, r in zip(MOMENTS, FRONT, ROOM, strict=True)]
    path = _file(tmp_path, "Timestamp,T1 [°C],Room [°C]", rows)
    run = tf.read(path)
    np.testing.assert_allclose(run.time_s, 60.0 * np.arange(150.0))
    assert told in run.guesses[0].text
    np.testing.assert_allclose(tf.read(path, time_format=form).time_s, run.time_s)


def test_moments_of_fourteen_digits_are_the_time_whatever_their_column_is_called(tmp_path):
    rows = [f"{m:%Y%m%d%H%M%S},{t},{r}" for m, t, r in zip(MOMENTS, FRONT, ROOM, strict=True)]
    run = tf.read(_file(tmp_path, "TS,T1 [°C],Room [°C]", rows))
    np.testing.assert_allclose(run.time_s, 60.0 * np.arange(150.0))
    assert list(run.channels) == ["T1 [°C]"]
    backwards = [*rows[:70], rows[71], rows[70], *rows[72:]]
    counted = [f"{20240314081520 + k},{t},{r}" for k, (t, r) in enumerate(zip(FRONT, ROOM, strict=True))]  # an 80th second comes
    for strange in (backwards, counted):
        with pytest.raises(tf.InputError, match="no time column"):
            tf.read(_file(tmp_path, "TS,T1 [°C],Room [°C]", strange))


def test_numbers_that_count_stay_numbers():
    """Seconds since 1970, milliseconds, decimal hours and minutes that start at nought."""
    assert compact(1.77e9 + 60.0 * np.arange(150.0)) is None
    assert compact(2.61e9 + 60.0 * np.arange(150.0)) is None  # a seventieth minute comes
    assert clock_with_a_point(7.5 + np.arange(150.0) / 60.0) is None
    assert clock_with_a_point(np.round(0.01 * np.arange(50.0), 2)) is None
    assert clock_with_a_point(np.round(7.0 + 0.25 * np.arange(50.0), 2)) is None
    clock = clock_with_a_point(np.array([22.58, 22.59, 23.0, 23.01]))
    np.testing.assert_allclose(np.diff(clock), 60.0)
    with_a_gap = clock_with_a_point(np.delete(np.floor(MINUTES_OF_DAY / 60.0) + 0.01 * (MINUTES_OF_DAY % 60.0), [70, 71, 72]))
    np.testing.assert_allclose(with_a_gap, 60.0 * np.delete(MINUTES_OF_DAY, [70, 71, 72]))
    over_midnight = clock_with_a_point(np.array([23.58, 23.59, 0.0, 0.01]))
    np.testing.assert_allclose(np.diff(over_midnight), 60.0)


@pytest.mark.parametrize(
    ("more", "values"),
    [
        ("Room_Q", 0.0 * ROOM),
        ("Room_Q", 192.0 + 0.0 * ROOM),
        ("Room [°C] ok", 1.0 + 0.0 * ROOM),
        ("Room_err", 0.0 * ROOM),
        ("Room_n", 12.0 + 0.0 * ROOM),
        ("Room_unc", 0.1 + 0.01 * ROOM),
        ("Room_H", 45.0 + 0.1 * ROOM),
        ("Room_rssi", -60.0 - np.floor(ROOM)),
        ("Outdoor", ROOM - 16.0),
        ("Aussen", ROOM - 16.0),
    ],
)
def test_what_stands_beside_a_room_is_not_averaged_into_it(tmp_path, more, values):
    rows = [f"{k},{t},{r},{v}" for k, (t, r, v) in enumerate(zip(FRONT, ROOM, values, strict=True))]
    run = tf.read(_file(tmp_path, f"time_min,Front,Room,{more}", rows))
    assert list(run.channels) == ["Front"]
    assert list(run.ambient) == ["Room"]
    np.testing.assert_allclose(run.room, ROOM)


@pytest.mark.parametrize(("name", "values"), [("Front Q", np.round(FRONT)), ("Front H", FRONT + 1.0), ("Front n", np.round(FRONT))])
def test_a_place_behind_a_name_is_no_mark(tmp_path, name, values):
    """In whole degrees, too: more numbers than marks have."""
    rows = [f"{k},{t:.0f},{v},{r}" for k, (t, v, r) in enumerate(zip(FRONT, values, ROOM, strict=True))]
    assert list(tf.read(_file(tmp_path, f"time_min,Front,{name},Room", rows)).channels) == ["Front", name]


def test_rooms_that_differ_and_those_in_tenths_are_told(tmp_path):
    rows = [f"{k},{t},{r},{r + 9.0:.2f}" for k, (t, r) in enumerate(zip(FRONT, ROOM, strict=True))]
    run = tf.read(_file(tmp_path, "time_min,Front,Room,Hall", rows))
    assert "the mean of columns that differ: Room at 21.2, Hall at 30.2" in "; ".join(g.text for g in run.guesses)
    tenths = [f"{k},{10 * t:.0f},{10 * r:.0f}" for k, (t, r) in enumerate(zip(FRONT, ROOM, strict=True))]
    with pytest.raises(tf.InputError, match="tenths of a degree"):
        tf.read(_file(tmp_path, "time_min,Front,Room", tenths))


def test_names_of_what_is_no_sensor_and_of_spindles(tmp_path):
    """Growth and tilt, the mean of all; SP is a spindle where it is measured, and a set point where it stands still."""
    for name in ("Spindle growth", "Headstock tilt", "Column bending", "front elongation", "Front_vib", "Spindel Unwucht"):
        assert sign_of(name, "").kind == "input", name
    both = np.stack(
        [FRONT, np.roll(FRONT, 1) + 0.02 * np.random.default_rng(1).standard_normal(150), np.full(150, 40.0), FRONT], axis=1
    )
    rows = [",".join([str(k), *(f"{v:.2f}" for v in row)]) for k, row in enumerate(both)]
    assert list(tf.read(_file(tmp_path, "time_min,X_TEMP,SP_TEMP,Y_SP_TEMP,Z_TEMP", rows)).channels) == [
        "X_TEMP",
        "SP_TEMP",
        "Z_TEMP",
    ]
    run = tf.read(_file(tmp_path, "time_min,T1 [°C],T2 [°C],T3 [°C],Mittelwert [°C]", rows))
    assert list(run.channels) == ["T1 [°C]", "T2 [°C]", "T3 [°C]"]
    assert list(run.inputs) == ["Mittelwert [°C]"]


def test_a_row_is_of_when_it_was_read_and_not_of_when_it_was_sent_on(tmp_path):
    sent = [MOMENTS[min(149, 20 * (k // 20) + 19)] + timedelta(milliseconds=137 * k) for k in range(150)]
    rows = [f"{s.isoformat()},{m.isoformat()},{t}" for s, m, t in zip(sent, MOMENTS, FRONT, strict=True)]
    run = tf.read(_file(tmp_path, "published_at,recorded_at,T1 [°C]", rows))
    np.testing.assert_allclose(run.time_s, 60.0 * np.arange(150.0))


def test_a_path_of_value_and_quality_keeps_its_place(tmp_path):
    rows = [f"{k},{t},192,{r},192" for k, (t, r) in enumerate(zip(FRONT, ROOM, strict=True))]
    run = tf.read(_file(tmp_path, "time_min,Front.Value,Front.Quality,Room.Value,Room.Quality", rows))
    assert (list(run.channels), list(run.ambient)) == (["Front.Value"], ["Room.Value"])


def test_all_unknown_words_of_a_column_are_advised_at_once(tmp_path):
    """One at a time led from refusal to refusal; and the words of more instruments are known."""
    cells = [f"{v:.1f}" for v in FRONT[:40]]
    cells[5], cells[9], cells[20] = "bla", "foo", "bla"
    path = _file(tmp_path, "time_min,T1", [f"{k},{c}" for k, c in enumerate(cells)])
    with pytest.raises(tf.InputError) as told:
        tf.read(path)
    assert "missing='bla,foo' if these mean 'no reading'" in told.value.do
    assert np.isnan(tf.read(path, missing="bla,foo").channels["T1"]).sum() == 3
    cells[5], cells[9], cells[20] = "+1.#INF", "--------", "Sensor Error"
    known = tf.read(_file(tmp_path, "time_min,T1", [f"{k},{c}" for k, c in enumerate(cells)], "known.csv"))
    assert np.isnan(known.channels["T1"]).sum() == 3


def test_pairs_of_x_in_seconds_have_a_clock_each(tmp_path):
    rows = [f"{k},{t},{2 * k},{r}" for k, (t, r) in enumerate(zip(FRONT, ROOM, strict=True))]
    run = tf.read(_file(tmp_path, "x [s],y [°C],x [s],y [°C]", rows))
    first, second = run.channels.values()
    assert run.time_s[np.flatnonzero(np.isfinite(first))[-1]] == 149.0
    assert run.time_s[np.flatnonzero(np.isfinite(second))[-1]] == 298.0
