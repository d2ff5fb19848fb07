"""Clocks of long tables, clocks of single columns, and marks beside readings: what was read wrong without a word before."""

from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest

import thermofast as tf
from thermofast.errors import InputError, UsageError
from thermofast.reading.moments.order import clock_change
from thermofast.reading.signs import sign_of
from thermofast.reading.tables.lines import AT_ONCE, begins_of_lines, newlines
from thermofast.reading.values.marks import bad_by

COUNT = 120
SECONDS = 60.0 * np.arange(COUNT)
FRONT = 20.0 + 8.0 * -np.expm1(-SECONDS / 3600.0)
REAR = 21.0 + 5.0 * -np.expm1(-SECONDS / 3000.0)
AUTUMN, SPRING = datetime(2026, 10, 25, 3), datetime(2026, 3, 29, 2)


def moment(seconds, start, form="%Y-%m-%d %H:%M:%S", change=None, hours=0):
    told = start + timedelta(seconds=float(seconds))
    return (told + timedelta(hours=hours) if change is not None and told >= change else told).strftime(form)


def wall(seconds):
    return moment(seconds, datetime(2026, 10, 25, 1, 30), change=AUTUMN, hours=-1)


CLOCKS = {
    "an hour told twice": lambda s: wall(2.0 * s),
    "an hour never told": lambda s: moment(s, datetime(2026, 3, 29, 1), change=SPRING, hours=1),
    "twelve hours": lambda s: moment(s, datetime(2026, 5, 3, 11, 30), "%I:%M:%S"),
    "twelve hours and a date": lambda s: moment(s, datetime(2026, 5, 3, 11, 30), "%Y-%m-%d %I:%M:%S"),
    "twelve hours, a date and midnight": lambda s: moment(s, datetime(2026, 5, 3, 23, 15), "%Y-%m-%d %I:%M:%S"),
    "past midnight": lambda s: moment(s, datetime(2026, 5, 3, 23, 30), "%H:%M:%S"),
    "four readings a minute": lambda s: moment(s / 4.0, datetime(2026, 5, 3, 8, 30), "%Y-%m-%d %H:%M"),
}
LENGTH = {"an hour told twice": 2.0, "four readings a minute": 0.25}


def written(tmp_path, head, rows):
    path = tmp_path / "run.csv"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("in_blocks", [False, True])
@pytest.mark.parametrize("clock", CLOCKS)
def test_a_long_table_has_the_clock_of_each_of_its_sensors(tmp_path, clock, in_blocks):
    told = [CLOCKS[clock](s) for s in SECONDS]
    front, rear = ([f"{t},{n},{v:.3f}" for t, v in zip(told, of, strict=True)] for n, of in (("front", FRONT), ("rear", REAR)))
    rows = [*front, *rear] if in_blocks else [row for pair in zip(front, rear, strict=True) for row in pair]
    run = tf.read(written(tmp_path, "time,sensor,value", rows))
    scale = LENGTH.get(clock, 1.0)
    for name, truth in (("front", FRONT), ("rear", REAR)):
        here = np.isfinite(run.channels[name])
        np.testing.assert_allclose(run.channels[name][here], truth, atol=6e-4)
        np.testing.assert_allclose(run.time_s[here], scale * SECONDS, atol=1e-6)
    assert clock == "past midnight" or any(g.about == "time" for g in run.guesses)


def two_clocks(tmp_path, head, one, other):
    rows = [f"{a},{x:.3f},{b},{y:.3f}" for a, x, b, y in zip(one, FRONT, other, REAR, strict=True)]
    return written(tmp_path, head, rows)


@pytest.mark.parametrize("head", ["Time [s],front [°C],Time [s],rear [°C]", "t1 [s],T1 [°C],t2 [s],T2 [°C]"])
def test_written_settings_keep_a_clock_for_each_column(tool, tmp_path, head):
    path = two_clocks(tmp_path, head, SECONDS, 1.5 * SECONDS + 7.0)
    rear = head.split(",")[3]
    assert tool("inspect", path, "--write", tmp_path / "as.toml").code == 0
    assert "\ntime = " not in (tmp_path / "as.toml").read_text(encoding="utf-8")
    for run in (tf.read(path), tf.read(path, channels=[rear])):
        here = np.isfinite(run.channels[rear])
        np.testing.assert_allclose(run.time_s[here] - run.time_s[here][0], 1.5 * SECONDS, atol=1e-6)
    shown = tool("--config", tmp_path / "as.toml", "inspect", path, "--format", "csv").out
    assert shown == tool("inspect", path, "--format", "csv").out
    assert shown.count(",time,") == 2


def test_the_curves_of_a_panel_have_clocks_of_their_own(tmp_path):
    start = datetime(2026, 5, 3, 8)
    one, other = ([moment(s, start) for s in of] for of in (SECONDS, 1.5 * SECONDS + 7.0))
    run = tf.read(two_clocks(tmp_path, "T1 ValueX,T1 ValueY,T2 ValueX,T2 ValueY", one, other))
    here = np.isfinite(run.channels["T2 ValueY"])
    np.testing.assert_allclose(run.time_s[here], 1.5 * SECONDS + 7.0, atol=1e-6)


@pytest.mark.parametrize("what", ["a cell that is no moment", "an hour told twice"])
def test_a_second_clock_that_cannot_be_read_is_refused_not_dropped(tmp_path, what):
    start = datetime(2026, 5, 3, 8)
    one, other = [moment(s, start) for s in SECONDS], [moment(1.5 * s + 7.0, start) for s in SECONDS]
    if what == "an hour told twice":
        one, other = [wall(2.0 * s) for s in SECONDS], [wall(3.0 * s + 14.0) for s in SECONDS]
    else:
        other[50] = "#"
    with pytest.raises(InputError, match="two clocks, 'Time"):
        tf.read(two_clocks(tmp_path, "Time,front [°C],Time,rear [°C]", one, other))


def test_a_clock_that_was_set_within_the_record_is_refused(tmp_path):
    told = [moment(s, datetime(2000, 1, 1) if s < 600 else datetime(2026, 5, 3, 8)) for s in SECONDS]
    rows = [f"{t},{v:.3f}" for t, v in zip(told, FRONT, strict=True)]
    with pytest.raises(InputError, match=r"line 12: the time jumps by 26\.3 years"):
        tf.read(written(tmp_path, "time,front [°C]", rows))


BROKEN = np.arange(COUNT)[30:40]


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("T1 Status", "Good", "Bad"),
        ("T1 Status", "OK", "Sensor break"),
        ("T1_Q", "192", "0"),
        ("T1.Q", "192", "24"),
        ("Q_T1", "192", "0"),
        ("T1 OPC Quality", "192", "0"),
        ("T1 StatusCode", "0", "2147483648"),
        ("T1 Error", "0", "1"),
        ("T1 Fault", "0", "3"),
        ("T1 ok", "1", "0"),
        ("T1 valid", "True", "False"),
        ("T1 Status", "OK", "Over-range"),
        ("Status", "OK", "Error"),
    ],
)
def test_marks_that_say_that_a_reading_is_none(tmp_path, name, good, bad):
    marks = np.where(np.isin(np.arange(COUNT), BROKEN), bad, good)
    shown = np.where(marks == bad, FRONT - 1.7, FRONT)
    rows = [f"{s:g},{x:.3f},{m},{y:.3f}" for s, x, m, y in zip(SECONDS, shown, marks, REAR, strict=True)]
    run = tf.read(written(tmp_path, f"time_s,T1,{name},T2", rows))
    assert list(run.channels) == ["T1", "T2"]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(run.channels["T1"])), BROKEN)
    assert np.isnan(run.channels["T2"]).sum() == (len(BROKEN) if name == "Status" else 0)
    assert any("10 readings" in n for n in run.notes)


@pytest.mark.parametrize(
    ("name", "usual", "other"),
    [
        ("T1_Status", "0", "128"),
        ("Status", "run", "error"),
        ("T1 Error", "1", "0"),
        ("Q_T1", "130.0", "131.0"),
        ("Mode ok", "1", "0"),
    ],
)
def test_marks_of_which_it_is_not_known_what_they_say_leave_the_readings(tmp_path, name, usual, other):
    marks = np.where(np.isin(np.arange(COUNT), BROKEN), other, usual)
    rows = [f"{s:g},{x:.3f},{m},{y:.3f}" for s, x, m, y in zip(SECONDS, FRONT, marks, REAR, strict=True)]
    run = tf.read(written(tmp_path, f"time_s,T1,{name},T2", rows))
    assert np.isfinite(run.channels["T1"]).all()
    assert np.isfinite(run.channels["T2"]).all()
    if name == "T1_Status":
        assert any("what 'T1_Status' says of T1 is not known (0, 128)" in g.text for g in run.guesses)


def test_marks_of_nothing_but_bad_readings_are_told_and_not_followed(tmp_path):
    rows = [f"{s:g},{x:.3f},Bad" for s, x in zip(SECONDS, FRONT, strict=True)]
    rows[0] = rows[0].replace("Bad", "Invalid")
    assert bad_by(frozenset(["valid"]), ["False"] * 3, of_row=False).all()  # type: ignore[union-attr]
    rows = [f"{s:g},{x:.3f},False" for s, x in zip(SECONDS, FRONT, strict=True)]
    run = tf.read(written(tmp_path, "time_s,T1,T1 valid", rows))
    assert np.isfinite(run.channels["T1"]).all()
    assert any("every reading is marked as bad by 'T1 valid': kept" in n for n in run.notes)


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("input", "設定温度 目标温度 설정온도 Žádaná Nastavená Nastawa Задание Asetuslämpötila Alapjel Setpunt Ingesteld WSP"),
        ("input", "Temperatura_zadana Temperatura_impostata Ayar_sıcaklığı Abschalttemperatur Grenztemperatur Sollvorgabe"),
        ("input", "Regelabweichung Überhöhung Hedef_sıcaklık Temp_objetivo Nominal_temp"),
        ("ambient", "気温 실온 Omgivelsestemperatur Temperatura_pokojowa Комнатная_температура Oda_sıcaklığı Szobahőmérséklet"),
        ("sensor", "主軸温度 Łożysko Подшипник Laakeri Warmbereich Limiter_housing Setzstock Setter_block Tmax"),
    ],
)
def test_what_is_asked_for_and_the_room_in_the_languages_of_loggers(kind, names):
    assert {n: sign_of(n.replace("_", " "), "°C").kind for n in names.split()} == dict.fromkeys(names.split(), kind)


@pytest.mark.parametrize("name", ["Vin", "Press", "Ibat", "Hum"])
def test_short_names_of_supplies_are_no_sensors(name):
    assert sign_of(name, "").kind == "input"
    assert sign_of(f"{name} ram", "").kind != "input"


@pytest.mark.parametrize(
    ("head", "row", "minutes"),
    [
        ("Time [h],101,102", lambda s: f"{s / 3600.0:.6f}", 119.0),
        ("time_s,1,2", lambda s: f"{s:g}", 119.0),
        ("elapsed,T1 [°C],T2 [°C]", lambda s: f"{int(s // 3600)}h{int(s % 3600 // 60)}m", 119.0),
        ("elapsed,T1 [°C],T2 [°C]", lambda s: f"{int(s // 3600)} hr {int(s % 3600 // 60)} min 5 s", 119.0),
        ("time,T1 [°C],T2 [°C]", lambda s: f"{116444736000000000 + 10000000 * (1770000000 + int(s))}", 119.0),
        ("time,T1 [°C],T2 [°C]", lambda s: f"{639120000000000000 + 10000000 * int(s)}", 119.0),
        ("Year,Day,HHMM,T1 [°C],T2 [°C]", lambda s: f"2026,123,{100 * (8 + int(s) // 3600) + int(s) % 3600 // 60}", 119.0),
    ],
)
def test_names_of_numbers_and_times_of_other_programs(tmp_path, head, row, minutes):
    rows = [f"{row(s)},{x:.3f},{y:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    run = tf.read(written(tmp_path, head, rows))
    assert list(run.channels) == head.split(",")[-2:]
    assert run.time_s[-1] == pytest.approx(60.0 * minutes, abs=2e-3)
    assert len(run.time_s) == COUNT


@pytest.mark.parametrize(("unit", "scale"), [("m°C", 1000.0), ("mdegC", 1000.0), ("°C x10", 10.0), ("°C*100", 100.0)])
def test_degrees_that_were_kept_as_whole_numbers(tmp_path, unit, scale):
    rows = [f"{s:g},{scale * x:.0f}" for s, x in zip(SECONDS, FRONT, strict=True)]
    run = tf.read(written(tmp_path, f"time_s,T1 [{unit}]", rows))
    np.testing.assert_allclose(run.channels[f"T1 [{unit}]"], FRONT, atol=0.51 / scale)
    assert any(f"readings times {1.0 / scale:g}" in n for n in run.notes)


def test_advice_on_day_and_month_has_the_parts_of_the_stamps(tmp_path):
    rows = [f"0{3 + i}/04/2026 08:00,{x:.3f}" for i, x in enumerate(FRONT[:3])]
    with pytest.raises(InputError, match="day and month") as error:
        tf.read(written(tmp_path, "time,T1 [°C]", rows))
    assert "'%d/%m/%Y %H:%M'" in str(error.value)


def test_hostile_and_odd_names_stay_what_they_are(tool, tmp_path):
    rows = [f"{s:g},{x:.3f},{y:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    path = written(tmp_path, "#time_s,%s{0} [°C],<script>|& [°C]", rows)
    assert list(tf.read(path).channels) == ["%s{0} [°C]", "<script>|& [°C]"]
    shown = tool("inspect", path, "--format", "md").out
    assert "| %s{0} [°C] |" in shown
    assert "| &lt;script>\\|&amp; [°C] |" in shown


def test_a_column_that_two_options_name_is_refused(tmp_path):
    rows = [f"{s:g},{x:.3f},{y:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    path = written(tmp_path, "time_s,T1,T2", rows)
    with pytest.raises(UsageError, match="both name 'T2'"):
        tf.read(path, ambient="T2", inputs=["T2"])


# --- rows in another order, runs that were appended, clocks that were set ------------------------------------------------------------


@pytest.mark.parametrize("long", [False, True])
@pytest.mark.parametrize("clock", ["an hour told twice", "an hour never told", "twelve hours and a date", "past midnight"])
def test_newest_first_with_any_clock(tmp_path, clock, long):
    told = [CLOCKS[clock](s) for s in SECONDS]
    rows = [f"{t},{x:.3f},{y:.3f}" for t, x, y in zip(told, FRONT, REAR, strict=True)]
    if long:
        rows = [f"{t},{n},{v:.3f}" for t, x, y in zip(told, FRONT, REAR, strict=True) for n, v in (("front", x), ("rear", y))]
    run = tf.read(written(tmp_path, "time,sensor,value" if long else "time,front [°C],rear [°C]", rows[::-1]))
    scale = LENGTH.get(clock, 1.0)
    for name, truth in zip(run.channels, (REAR, FRONT) if long else (FRONT, REAR), strict=True):
        here = np.isfinite(run.channels[name])
        np.testing.assert_allclose(run.time_s[here], scale * SECONDS, atol=1e-6)
        np.testing.assert_allclose(run.channels[name][here], truth, atol=6e-4)


def test_time_that_is_still_to_go_is_counted_down(tmp_path):
    rows = [f"{SECONDS[-1] - s:g},{x:.3f}" for s, x in zip(SECONDS, FRONT, strict=True)]
    run = tf.read(written(tmp_path, "Time remaining [s],front", rows))
    np.testing.assert_allclose(run.channels["front"], FRONT, atol=6e-4)
    np.testing.assert_allclose(run.time_s, SECONDS, atol=1e-9)


@pytest.mark.parametrize(("pause", "count"), [(86400.0, 2), (60.0, 1)])
def test_names_that_stand_again_after_a_gap_begin_another_run(tmp_path, pause, count):
    """A page of a long record repeats them too, and leaves no gap."""
    head, start = "time,front [°C],rear [°C]", datetime(2026, 5, 3, 8)
    rows = [f"{moment(s, start)},{x:.3f},{y:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    later = [f"{moment(s + SECONDS[-1] + pause, start)},{x:.3f},{y:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    runs = tf.read_all(written(tmp_path, head, [*rows, head, *later]))
    assert [len(r.time_s) for r in runs] == [2 * COUNT // count] * count


def test_a_clock_that_was_set_back_while_it_ran_is_put_right(tmp_path):
    start = datetime(2026, 5, 3, 8)
    told = [moment(s - (130.0 if s > 3000.0 else 0.0), start) for s in SECONDS]
    rows = [f"{t},{x:.4f}" for t, x in zip(told, FRONT, strict=True)]
    run = tf.read(written(tmp_path, "time,front [°C]", rows))
    np.testing.assert_allclose(run.time_s, SECONDS, atol=1e-6)
    assert any("set back by 130 s" in g.text for g in run.guesses)
    rows = [f"{moment(s, start)},{x:.4f}" for s, x in zip(SECONDS, FRONT, strict=True)]
    rows[50], rows[52] = rows[52], rows[50]  # two rows that changed places are none
    run = tf.read(written(tmp_path, "time,front [°C]", rows))
    np.testing.assert_allclose(run.channels["front [°C]"], FRONT, atol=6e-5)
    assert not run.guesses


# --- names, labels and units above ----------------------------------------------------------------------------------------------------


def columns_of(run):
    return list(run.channels), list(run.ambient), list(run.inputs)


@pytest.mark.parametrize(
    ("above", "expected"),
    [
        (["Time,T1 (avg) [°C],T1 (min) [°C],T1 (max) [°C]"], (["T1 (avg) [°C]"], [], ["T1 (min) [°C]", "T1 (max) [°C]"])),
        (["Time,T1 (front bearing) [°C],T3 (ambient) [°C],T4 (setpoint) [°C]"], ([0], [1], [2])),
        (["Time,T1-front,T2-rear,T3-room"], ([0, 1], [2], [])),
        (["Time,SV1 MOTOR TEMP,SP1 MOTOR TEMP,SP1 SPEED"], ([0, 1], [], [2])),
        (["Time,T1.PV,T1.OP,T1 Stellgrad"], ([0], [], [1, 2])),
        (["Label,front,room,setpoint", "Unit,°C,°C,°C", "Time,CH1,CH2,CH3"], (["front CH1"], ["room CH2"], ["setpoint CH3"])),
        ([",Measured,,Setpoint", "Time,front,rear,front"], (["Measured front", "rear"], [], ["Setpoint front"])),
        ([",Left,,Right", "Time,T1,T2,T1"], (["Left T1", "T2", "Right T1"], [], [])),
        ([",front,front,rear", ",mean,std,mean"], (["front mean", "rear"], [], ["front std"])),
    ],
)
def test_what_lines_above_and_brackets_say_of_columns(tmp_path, above, expected):
    start = datetime(2026, 5, 3, 8)
    rows = [
        f"{moment(s, start)},{x:.3f},{y:.3f},{z:.2f}" for s, x, y, z in zip(SECONDS, FRONT, REAR, 20.0 + 0.01 * REAR, strict=True)
    ]
    run = tf.read(written(tmp_path, "\n".join(above), rows))
    names = above[-1].split(",")[1:]
    assert columns_of(run) == tuple([n if isinstance(n, str) else names[n] for n in some] for some in expected)


@pytest.mark.parametrize("above", ["# all temperatures in Fahrenheit", "# Unit: °F", "s,°F,°F"])
def test_the_unit_that_a_comment_or_a_line_above_says(tmp_path, above):
    rows = [f"{s:g},{1.8 * x + 32.0:.3f},{1.8 * y + 32.0:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    run = tf.read(written(tmp_path, f"{above}\nTime,T1,T2" if above[0] == "s" else f"{above}\ntime_s,T1,T2", rows))
    np.testing.assert_allclose(run.channels["T1"], FRONT, atol=6e-4)
    with pytest.raises(InputError, match="no sensor column"):
        tf.read(written(tmp_path, "Unit: mV\ntime_s,T1,T2", rows))


def test_a_number_logger_and_a_probe_under_its_name(tmp_path):
    """Row numbers under the name of a thermocouple logger, and odd numbers in a sensor's column."""
    rows = [f"{i},{s:g},{x:.3f}" for i, (s, x) in enumerate(zip(SECONDS, FRONT, strict=True), 1)]
    assert list(tf.read(written(tmp_path, "EL-USB-TC,Time [s],front [°C]", rows)).channels) == ["front [°C]"]
    rows = [f"{s:g},{x:.3f}{' H' if x > 23.0 else ''},{y:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    with pytest.raises(InputError, match="no number in a column of temperatures"):
        tf.read(written(tmp_path, "time_s,T1,T2", rows))


def test_clocks_called_after_the_column_beside_them(tmp_path):
    path = two_clocks(tmp_path, "t_front,front [°C],t_rear,rear [°C]", SECONDS, 1.5 * SECONDS + 7.0)
    run = tf.read(path, time_unit="s")
    here = np.isfinite(run.channels["rear [°C]"])
    np.testing.assert_allclose(run.time_s[here], 1.5 * SECONDS + 7.0, atol=1e-6)


@pytest.mark.parametrize("code", [888.88, 1820.0, -242.02, 1300.0])
def test_codes_of_displays_and_ranges_are_no_readings(tmp_path, code):
    shown = np.where((SECONDS > 3000.0) & (SECONDS < 3400.0), code, FRONT)
    run = tf.read(written(tmp_path, "time_s,T1 [°C]", [f"{s:g},{x:.3f}" for s, x in zip(SECONDS, shown, strict=True)]))
    np.testing.assert_array_equal(np.isnan(run.channels["T1 [°C]"]), shown == code)


def test_settings_of_a_file_of_commas_read_it_again(tool, tmp_path):
    rows = [f"{s:g},{x:.2f},{y:.2f}".replace(".", ",") for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    path = written(tmp_path, "t_s,T1,T2", rows)
    assert tool("inspect", path, "--write", tmp_path / "as.toml").code == 0
    again = tool("--config", tmp_path / "as.toml", "inspect", path, "--format", "csv")
    assert again.code == 0
    assert ",20.0," in again.out


# --- rows as other programs write them ---------------------------------------------------------------------------------------------


def test_a_long_table_of_means_and_extremes_keeps_them_apart(tmp_path):
    start = datetime(2026, 5, 3, 8)
    rows = [
        f"{moment(s, start)},front,{what},{x + more:.3f}"
        for s, x in zip(SECONDS, FRONT, strict=True)
        for what, more in (("avg", 0.0), ("min", -0.1), ("max", 0.1))
    ]
    alone = tf.read(written(tmp_path, "time,sensor,stat,value", rows))
    assert columns_of(alone) == (["avg"], [], ["min", "max"])
    run = tf.read(written(tmp_path, "time,sensor,stat,value", [*rows, *(r.replace("front", "rear") for r in rows)]))
    assert columns_of(run)[0] == ["front avg", "rear avg"]
    np.testing.assert_allclose(run.channels["front avg"], FRONT, atol=6e-4)
    np.testing.assert_allclose(run.time_s, SECONDS, atol=1e-9)


@pytest.mark.parametrize("quality", ["Uncertain", "0x40000000"])
def test_marks_of_a_long_table(tmp_path, quality):
    good, bad = ("Good", "Bad") if quality == "Uncertain" else ("0x00000000", "0x80340000")
    rows = [
        f"{s:g},front,{x:.3f},{bad if i in BROKEN else quality if i < 5 else good}"
        for i, (s, x) in enumerate(zip(SECONDS, FRONT, strict=True))
    ]
    rows += [f"{s:g},rear,{y:.3f},{good}" for s, y in zip(SECONDS, REAR, strict=True)]
    run = tf.read(written(tmp_path, "time_s,sensor,value,quality", rows))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(run.channels["front"])), BROKEN)
    assert any("'quality' marks as Uncertain are kept" in g.text for g in run.guesses) == (quality == "Uncertain")


@pytest.mark.parametrize("form", ["whole rows", "R", "Fortran"])
def test_rows_of_other_programs(tmp_path, form):
    start = datetime(2026, 5, 3, 8)
    told = [moment(s, start) for s in SECONDS]
    values = list(zip(told, FRONT, REAR, strict=True))
    head, rows = {
        "whole rows": ("Time,front,rear", [f'"{t},{x:.3f},{y:.3f}"' for t, x, y in values]),
        "R": ('"time" "front" "rear"', [f'"{i}" "{t}" {x:.3f} {y:.3f}' for i, (t, x, y) in enumerate(values, 1)]),
        "Fortran": (
            "time_s,front,rear",
            [f"{s:g},{x / 100.0:.5f}D+02,{y / 100.0:.5f}D+02" for s, (_, x, y) in zip(SECONDS, values, strict=True)],
        ),
    }[form]
    run = tf.read(written(tmp_path, head, rows))
    assert list(run.channels) == ["front", "rear"]
    np.testing.assert_allclose(run.channels["front"], FRONT, atol=6e-4)
    np.testing.assert_allclose(run.time_s, SECONDS, atol=1e-6)


@pytest.mark.parametrize(("month", "number"), [("paź", 10), ("úno", 2), ("ağu", 8), ("out", 10)])
def test_months_of_more_languages(tmp_path, month, number):
    rows = [f"30-{month}-2026 23:{i:02d},{x:.3f}" for i, x in enumerate(FRONT[:60])] if number != 2 else []
    rows = rows or [f"27-{month}-2026 23:{i:02d},{x:.3f}" for i, x in enumerate(FRONT[:60])]
    rows += [f"{'31' if number != 2 else '28'}-{month}-2026 00:{i:02d},{x:.3f}" for i, x in enumerate(FRONT[60:])]
    run = tf.read(written(tmp_path, "Date,front", rows))
    np.testing.assert_allclose(run.time_s, SECONDS, atol=1e-6)


def test_a_table_below_the_record_is_named_with_the_option_that_leaves_it_out(tmp_path):
    rows = [f"{s:g},{x:.3f}" for s, x in zip(SECONDS, FRONT, strict=True)]
    path = written(tmp_path, "time_s,front", [*rows, ",24.5", ",20.0"])
    with pytest.raises(InputError, match="2 rows without a time") as error:
        tf.read(path)
    assert "skip_footer=2" in str(error.value)
    np.testing.assert_allclose(tf.read(path, skip_footer=2).channels["front"], FRONT, atol=6e-4)


def test_an_hour_that_a_gap_may_hide_is_told(tmp_path):
    """Whether that clock was put forward in the pause, or runs in UTC, the file does not say."""
    start = datetime(2026, 3, 29, 1)
    rows = [f"{moment(s + (4800.0 if s > 2400.0 else 0.0), start)},{x:.3f}" for s, x in zip(SECONDS, FRONT, strict=True)]
    run = tf.read(written(tmp_path, "time,front [°C]", rows))
    assert run.time_s[-1] == SECONDS[-1] + 4800.0
    assert any(
        "from 2026-03-29 01:40 to 03:01: where that clock was put forward it is an hour shorter" in g.text for g in run.guesses
    )


def test_rows_that_are_numbered_backwards(tmp_path):
    rows = [f"{i},{s:g},{x:.3f}" for i, (s, x) in enumerate(zip(SECONDS, FRONT, strict=True), 1)]
    assert list(tf.read(written(tmp_path, "No.,time_s,front", rows[::-1])).channels) == ["front"]


def test_a_clock_of_one_column_is_not_taken_for_the_others(tmp_path):
    path = two_clocks(tmp_path, "t_front,front [°C],t_rear,rear [°C]", SECONDS, 1.5 * SECONDS + 7.0)
    with pytest.raises(InputError, match="two clocks, 't_front' and 't_rear'"):
        tf.read(path, time="t_front", time_unit="s")
    assert list(tf.read(path, time="t_rear", time_unit="s", channels=["rear [°C]"]).channels) == ["rear [°C]"]


@pytest.mark.parametrize("name", ["n", "P", "I_Spindel", "H2", "X"])
def test_signs_of_quantities_beside_temperatures_are_no_sensors(tmp_path, name):
    rows = [f"{s:g},{x:.3f},{y:.3f},{y / 7.0:.3f}" for s, x, y in zip(SECONDS, FRONT, REAR, strict=True)]
    run = tf.read(written(tmp_path, f"time_s,T1,T2,{name}", rows))
    assert list(run.channels) == ["T1", "T2"]
    assert any(name in g.text for g in run.guesses)
    assert name in tf.read(written(tmp_path, f"time_s,front,rear,{name}", rows)).channels
    assert name in tf.read(written(tmp_path, f"time_s,T1,T2,{name}", rows), channels=["T1", name]).channels


def test_marks_of_sensors_in_other_scripts(tmp_path):
    marks = np.where(np.isin(np.arange(COUNT), BROKEN), "Bad", "Good")
    rows = [f"{s:g},{x:.3f},{m}" for s, x, m in zip(SECONDS, FRONT, marks, strict=True)]
    run = tf.read(written(tmp_path, "time_s,主轴 [°C],主轴 Quality", rows))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(run.channels["主轴 [°C]"])), BROKEN)


def test_two_rows_years_apart_are_refused_in_words(tmp_path):
    with pytest.raises(InputError, match=r"line 3: the time jumps by 26\.0 years"):
        tf.read(written(tmp_path, "time,front", ["2000-01-01 00:00:00,20.0", "2026-01-01 00:00:00,21.0"]))


def spelt(seconds: float, form: str) -> str:
    """An elapsed time as Go's and ISO 8601's parts that are not nought, or with primes."""
    h, m, s = int(seconds // 3600), int(seconds // 60 % 60), f"{seconds % 60:g}"
    if form == "go":
        return f"{h}h{m}m{s}s" if h else f"{m}m{s}s" if m else f"{s}s"
    if form == "iso":
        return "PT" + (f"{h}H" if h else "") + (f"{m}M" if m else "") + (f"{s}S" if s != "0" or (not h and not m) else "")
    return {"primes": f"{60 * h + m}'{s:0>2}''", "seconds": f"PT{seconds:g}S", "days": f"P0DT{h}H{m}M{s}S"}[form]


@pytest.mark.parametrize("form", ["go", "iso", "primes", "seconds", "days"])
@pytest.mark.parametrize("late", [0.0, 3585.5])
def test_elapsed_times_with_their_units_between(tmp_path, form, late):
    rows = [f"{spelt(s + late, form)},{x:.3f}" for s, x in zip(SECONDS, FRONT, strict=True)]
    run = tf.read(written(tmp_path, "elapsed,front [°C]", rows))
    np.testing.assert_allclose(run.time_s, SECONDS, atol=1e-6)
    assert list(run.channels) == ["front [°C]"]


@pytest.mark.parametrize("last", ["9999-12-31 23:59:00", "6025-01-24 14:18:00"])
def test_a_gap_to_the_end_of_the_calendar_is_refused_in_words(tmp_path, last):
    rows = [f"{moment(s, datetime(2025, 1, 24, 14))},{x:.3f}" for s, x in zip(SECONDS, FRONT, strict=True)]
    end = datetime.fromisoformat(last)
    rows += [f"{end - timedelta(minutes=30 - k)},{28 + 0.001 * k:.3f}" for k in range(30)]
    with pytest.raises(InputError, match=r"line 122: the time jumps by \d+\.\d years"):
        tf.read(written(tmp_path, "time,front [°C]", rows))
    assert clock_change(np.array([*range(9), 8e12]) * 60.0, (1.7e9,)) == (pytest.approx(np.array([*range(9), 8e12]) * 60.0), None)


GLITCHES = {
    "a clock that fell back to its beginning": ([50], ["2000-01-01 00:00:05"], "by up to 25 years, in line 52"),
    "a counter that ran over": ([50, 51], ["2036-02-07 06:28:16", "2036-02-07 06:28:18"], "by up to 11 years, in lines 52, 53"),
    "a stamp with a digit too many": ([70], ["2025025-01-24 14:27:32"], "by up to 270000 years, in line 72"),
    "an hour ahead": ([30], ["2025-01-24 15:30:00"], "by up to 60 min, in line 32"),
    "two at once": ([20, 90], ["2025-01-23 14:20:00", "2025-01-24 14:12:30"], "by up to 24 h, in lines 22, 92"),
}


@pytest.mark.parametrize("which", GLITCHES)
def test_a_clock_that_is_wrong_for_a_moment(tmp_path, which):
    at, stamps, told = GLITCHES[which]
    clock = [moment(s, datetime(2025, 1, 24, 14)) for s in SECONDS]
    for k, stamp in zip(at, stamps, strict=True):
        clock[k] = stamp
    run = tf.read(written(tmp_path, "time,front [°C]", [f"{c},{x:.3f}" for c, x in zip(clock, FRONT, strict=True)]))
    np.testing.assert_allclose(run.time_s, np.delete(SECONDS, at))
    np.testing.assert_allclose(run.channels["front [°C]"], np.delete(FRONT, at), atol=6e-4)
    assert [g.text for g in run.guesses if "wrong for a moment" in g.text] == [
        f"the clock was wrong for a moment, {told}: left out"
    ]


@pytest.mark.parametrize("moved", [(50, 10), (10, 50), (60, 61), (119, 40)])
def test_rows_that_came_late_are_put_where_they_belong(tmp_path, moved):
    order = list(range(COUNT))
    order.insert(moved[1], order.pop(moved[0]))
    run = tf.read(written(tmp_path, "time_s,front [°C]", [f"{SECONDS[k]:g},{FRONT[k]:.3f}" for k in order]))
    np.testing.assert_array_equal(run.time_s, SECONDS)
    np.testing.assert_allclose(run.channels["front [°C]"], FRONT, atol=6e-4)
    assert not run.guesses


def test_rows_in_each_others_place_are_exchanged(tmp_path):
    order = list(range(COUNT))
    order[20], order[65] = order[65], order[20]
    run = tf.read(written(tmp_path, "time_s,front [°C]", [f"{SECONDS[k]:g},{FRONT[k]:.3f}" for k in order]))
    np.testing.assert_array_equal(run.time_s, SECONDS)


def test_lines_are_counted_over_the_pieces_in_which_a_text_is_looked_at():
    text = b"".join(b"%d;1,5\n" % k + (b";\n" if k % 9000 == 8999 else b"") for k in range(20_000))
    assert len(text) > 2 * AT_ONCE
    assert newlines(text, len(text)) == text.count(b"\n")
    assert newlines(text, 70_001) == text.count(b"\n", 0, 70_001)
    assert begins_of_lines(text) == set(b"0123456789;")
    assert begins_of_lines(b"a\n" * AT_ONCE + b" ") == set(b"a ")  # the last piece is one byte


LONG = "two times that disagree about how long the record is"


def _two_times(scale, minutes=None, name="time_min"):
    """A table whose stamps are `scale` minutes apart, with a column of minutes beside."""
    up = np.arange(60.0)
    stamps = pd.Timestamp("2026-03-01") + pd.to_timedelta(60.0 * scale * up, unit="s")
    return pd.DataFrame({"time": stamps, name: up if minutes is None else minutes, "T1 [°C]": 20.0 + 9.0 * -np.expm1(-up / 20.0)})


@pytest.mark.parametrize(
    ("scale", "refused"), [(1 / 60.0, True), (0.66, True), (0.68, False), (1.0, False), (1.49, False), (1.51, True)]
)
def test_times_of_quite_another_length_are_not_chosen_between(scale, refused):
    """As stamps of an import beside the minutes of the logger; which is right, only the user knows."""
    table = _two_times(scale)
    if not refused:
        assert tf.read(table).time_s[-1] == pytest.approx(59.0 * 60.0 * scale)
        return
    with pytest.raises(InputError, match=LONG) as error:
        tf.read(table)
    assert "59 min by 'time_min'" in str(error.value)
    assert tf.read(table, time="time_min").time_s[-1] == pytest.approx(59.0 * 60.0)
    assert tf.read(table, exclude=["time_min"]).time_s[-1] == pytest.approx(59.0 * 60.0 * scale)


def test_an_index_of_time_counts_as_a_column_of_it():
    table = _two_times(1 / 60.0)
    with pytest.raises(InputError, match=LONG):
        tf.read(table.set_index("time").rename_axis(None))


def test_what_counts_otherwise_is_no_time_of_the_record():
    """Hours of operation stand still, a column without a unit may count anything, one that bends is another clock."""
    up = np.arange(60.0)
    still = 5.0 * np.floor(up / 2.0)
    for name, minutes in (("time_min", still), ("clock", 5.0 * up), ("time_min", 0.1 * up**2 + 0.01 * up), ("min", 5.0 * up)):
        assert tf.read(_two_times(1.0, minutes, name)).time_s[-1] == pytest.approx(59.0 * 60.0)
