"""Files and calls that readers from outside tried: each was read wrong, or silently not counted."""

import json

import click
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import ROOT
from simulator import held_response

import thermofast as tf
from thermofast.errors import InputError, UsageError
from thermofast.shell.numbers import Finite, Real, Whole

MINUTES = np.arange(60.0)
FRONT = 20.0 + 8.0 * -np.expm1(-MINUTES / 25.0)
REAR = 21.0 + 5.0 * -np.expm1(-MINUTES / 30.0)


def written(tmp_path, above, rows):
    path = tmp_path / "run.csv"
    path.write_text("\n".join([*above, *rows]) + "\n", encoding="utf-8")
    return path


def stamped(*columns):
    return [
        f"2026/05/13,{8 + int(m) // 60:02d}:{int(m) % 60:02d}:07," + ",".join(f"{c[i]:.2f}" for c in columns)
        for i, m in enumerate(MINUTES)
    ]


@pytest.mark.parametrize(("unit", "scale", "zero"), [("C", 1.0, 0.0), ("°F", 1.8, 32.0), ("K", 1.0, 273.15)])
def test_a_unit_line_above_the_names_is_the_unit(tmp_path, unit, scale, zero):
    above = ["Device Type,MW100", "Tag,,front,rear", f"Unit,,{unit},{unit}", "Date,Time,CH001,CH002"]
    run = tf.read(written(tmp_path, above, stamped(scale * FRONT + zero, scale * REAR + zero)))
    assert list(run.channels) == ["front CH001", "rear CH002"]
    np.testing.assert_allclose(run.channels["front CH001"], FRONT, atol=0.006)


def test_millivolts_above_the_names_are_no_sensors_and_tags_stand_for_names_that_are_missing(tmp_path):
    above = ["Tag,,front,rear", "Unit,,mV,C", "Date,Time,,"]
    run = tf.read(written(tmp_path, above, stamped(FRONT, REAR)))
    assert list(run.channels) == ["rear"]
    assert list(run.inputs) == ["front"]


def test_a_unit_line_below_a_header_that_is_named_is_read_and_written_settings_read_the_same(tool, tmp_path):
    path = written(
        tmp_path, ["Logger 7", "Zeit;T1", "min;°F"], [f"{m:g};{1.8 * v + 32.0:.2f}" for m, v in zip(MINUTES, FRONT, strict=True)]
    )
    for run in (tf.read(path), tf.read(path, header_line=2)):
        np.testing.assert_allclose(run.channels["T1"], FRONT, atol=0.006)
    assert tool("inspect", path, "--write", tmp_path / "as.toml").code == 0
    again = tool("--config", tmp_path / "as.toml", "inspect", path, "--format", "csv")
    assert "°F" in again.out
    assert ",20.0," in again.out


def test_words_before_the_numbers_of_a_preamble_are_no_readings(tmp_path):
    above = [
        '"HIOKI 8430","V1.10"',
        '"Scaling","OFF","OFF"',
        '"Ratio","1","1"',
        '"Offset","0","0"',
        "",
        '"Time","U1-1[C]","U1-2[C]"',
    ]
    rows = [f'"26-05-13 08:{int(m):02d}:07",{a:.5E},{b:.5E}' for m, a, b in zip(MINUTES, FRONT, REAR, strict=True)]
    run = tf.read(written(tmp_path, above, rows))
    assert list(run.channels) == ["U1-1[C]", "U1-2[C]"]
    assert run.time_s[-1] == 59 * 60.0


def test_alarms_that_never_change_are_left_out_and_said_to_be_and_changing_ones_are_inputs(tmp_path):
    rows = [f"{m:g},{v:.2f},0,{int(m > 30)}" for m, v in zip(MINUTES, FRONT, strict=True)]
    run = tf.read(written(tmp_path, ["time_min,T1 [°C],Alarm 1,Alarm 2"], rows))
    assert list(run.inputs) == ["Alarm 2"]
    assert any("never change left out: Alarm 1 is 0" in note for note in run.notes)


def test_units_that_overrule_the_file_are_told(tool, tmp_path):
    path = written(tmp_path, ["time_min,T1 [°C]"], [f"{m:g},{v:.2f}" for m, v in zip(MINUTES, FRONT, strict=True)])
    run = tf.read(path, units="F")
    assert any("--units F overrules what the file says of T1 [°C]" in note for note in run.notes)
    assert ",T1 [°C],sensor,F," in tool("inspect", path, "--units", "F", "--format", "csv").out


def test_lists_may_be_given_again_and_a_second_drive_is_refused(tool, tmp_path):
    rows = [f"{m:g},{a:.2f},{b:.2f},{m % 7:g}" for m, a, b in zip(MINUTES, FRONT, REAR, strict=True)]
    path = written(tmp_path, ["time_min,a [°C],b [°C],speed_rpm"], rows)
    told = tool("inspect", path, "--rename", "a=front", "--rename", "b=rear", "--format", "csv").out
    assert ",front,sensor," in told
    assert ",rear,sensor," in told
    refused = tool("identify", path, "--drive", "speed_rpm", "--drive", "b")
    assert refused.code == 2
    assert "given 2 times (speed_rpm, b); one is allowed" in refused.err


def test_steps_that_jitter_may_be_seconds_and_are_asked_for(tmp_path):
    rng = np.random.default_rng(1)
    clock = np.cumsum(np.full(400, 1.01) + rng.uniform(0.0, 0.3, 400))
    rows = [f"{t:.2f},{20.0 + 8.0 * -np.expm1(-t / 150.0):.2f}" for t in clock]
    with pytest.raises(tf.InputError, match="does not say its unit of time"):
        tf.read(written(tmp_path, ["t,T1 [°C]"], rows))


def test_the_curve_of_a_slow_sensor_does_not_stand_still_at_the_end_of_a_fast_one():
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 120.0)
    fast = {f"F{k}": 20.0 + 5.0 * -np.expm1(-time / 15.0) + rng.normal(0.0, 0.02, 120) for k in range(4)}
    slow = 20.0 + 9.0 * -np.expm1(-time / 70.0) + rng.normal(0.0, 0.02, 120)
    found = tf.identify({"time_min": time, **fast, "S": slow})
    curves = next(c for c, r in zip(found.curves, found.records, strict=True) if r.channel == "S")
    assert np.all(np.diff(curves.model[-20:]) > 0.0)


@pytest.mark.proof
@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_held_speed_to_a_power_is_named_without_a_delay_where_no_room_is_logged(power):
    rng = np.random.default_rng(11)
    time, rate = np.arange(420.0), 0.0375
    speed = np.repeat(rng.choice([1000.0, 2000.0, 3000.0, 4000.0], 21), 20)
    heat = 1.5 * (speed / 4000.0) ** power
    reading = held_response(heat, rate)
    run = {f"T{k}": reading + rng.normal(0.0, 0.02, 420) for k in range(2)}
    found = tf.diagnose({"time_min": time, **run, "speed_rpm": speed}, inputs=["speed_rpm"])
    assert found[0].verdict == "load_step"


def _clock(minute):
    return f"2026-03-05 08:{int(minute):02d}:00"


@pytest.mark.parametrize(
    ("head", "row"),
    [
        # Lascar EL-USB: the serial number stands in the first row alone.
        (
            ["Oven,Time,Celsius(°C),High Alarm,Low Alarm,Serial Number"],
            lambda i, a, b: f"{i + 1},{_clock(i)},{a:.2f},40,0" + ",1001" * (not i),
        ),
        # R's write.table: names of rows under no name, between blanks and between commas.
        (['"time_min" "front"'], lambda i, a, b: f'"{i + 1}" {i} {a:.2f}'),
        (['"time_min","front"'], lambda i, a, b: f'"{i + 1}",{i},{a:.2f}'),
        # Names, units, and where the probes sit.
        (["Zeit;vorne;hinten", "[min];[°C];[°C]", "Zeit;Lager;Lager"], lambda i, a, b: f"{i};{a:.2f};{b:.2f}"),
        (["Zeit;Temp.;Temp.", "[min];[°C];[°C]", "Zeit;vorne;hinten"], lambda i, a, b: f"{i};{a:.2f};{b:.2f}"),
        # Numbers in groups: one of several groups says what 60,000 is.
        (["time_ms,front"], lambda i, a, b: f'"{i * 60000:,}",{a:.2f}'),
        # No name says time, a unit does.
        (["Ablauf;vorne", "[min];[°C]"], lambda i, a, b: f"{i};{a:.2f}"),
    ],
)
def test_headers_as_loggers_write_them(tmp_path, head, row):
    rows = [row(i, a, b) for i, (a, b) in enumerate(zip(FRONT[:40], REAR[:40], strict=True))]
    run = tf.read(written(tmp_path, head, rows))
    assert np.allclose(run.time_s, 60.0 * np.arange(40))
    assert next(iter(run.channels.values())) == pytest.approx(np.round(FRONT[:40], 2), abs=0.006)
    assert not any('"' in name for name in run.channels)


def test_texts_of_a_sheet_are_read_with_their_decimal_commas(tmp_path):
    texts = {"Zeit": [_clock(i) for i in range(40)], "vorne [°C]": [f"{a:.2f}".replace(".", ",") for a in FRONT[:40]]}
    path = tmp_path / "pasted.xlsx"
    pd.DataFrame(texts).to_excel(path, index=False)
    assert tf.read(path).channels["vorne [°C]"] == pytest.approx(np.round(FRONT[:40], 2), abs=0.006)


def test_a_column_of_durations_is_the_time(tmp_path):
    pq.write_table(pa.table({"since": pa.array(np.arange(40) * 60, pa.duration("s")), "T1": FRONT[:40]}), tmp_path / "d.parquet")
    assert tf.read(tmp_path / "d.parquet").time_s[-1] == 2340.0


def test_turkish_names(tmp_path):
    rows = [f"{i};{a:.2f}".replace(".", ",") for i, a in enumerate(FRONT[:40])]
    (tmp_path / "t.csv").write_bytes("\n".join(["Zaman [min];İş mili sıcaklığı (°C)", *rows]).encode("cp1254"))
    run = tf.read(tmp_path / "t.csv")
    assert list(run.channels) == ["İş mili sıcaklığı (°C)"]


@pytest.mark.parametrize(
    ("head", "row", "names"),
    [
        (  # Yokogawa GX: channels by number under the lines of tags and units
            '"#GX20","Ver R5.01.01"\n"Sampling Interval","1min"\n\n"CH","","","0001","0101"\n"Tag Comment","","","front","spindle"\n'
            '"Unit","","","C","rpm"\n"Date","Time","ms","0001","0101"',
            lambda i, a, b: f"2026/03/17,{9 + (41 + i) // 60:02d}:{(41 + i) % 60:02d}:12,000,{a:.2f},3000",
            ["front 0001"],
        ),
        (  # Hioki: the names stand under scaling, ratio and offset, in exponents with a sign
            '"Trigger Time","26-03-17 09:41:12"\n"CH","U1-1","U1-2"\n"Scaling","Off","Off"\n"Ratio","+1.00000E+00","+1.00000E+00"\n'
            '"Offset","+0.00000E+00","+0.00000E+00"\n"Time","U1-1[degC]","U1-2[degC]"',
            lambda i, a, b: f"{60.0 * i:+.9E},{a:+.5E},{b:+.5E}",
            ["U1-1[degC]", "U1-2[degC]"],
        ),
    ],
)
def test_names_are_the_line_that_begins_with_time_whatever_stands_above(tmp_path, head, row, names):
    rows = [row(i, a, b) for i, (a, b) in enumerate(zip(FRONT[:40], REAR[:40], strict=True))]
    run = tf.read(written(tmp_path, head.splitlines(), rows))
    assert list(run.channels) == names
    assert np.allclose(run.time_s, 60.0 * np.arange(40))
    assert next(iter(run.channels.values())) == pytest.approx(FRONT[:40], abs=0.006)


def clock(i, every=30):
    """(h, min, s) of a row, from 21:30 on, with a night between rows 30 and 31."""
    s = 21 * 3600 + 30 * 60 + every * i
    return s // 3600 % 24, s // 60 % 60, s % 60


@pytest.mark.parametrize(
    ("head", "row", "step"),
    [
        # A clock under no name beside a date, and the other way round: the day that was between was lost.
        ("Date,,T1,T2", lambda i: f"2026-05-{3 + (i > 30):02d},{{:02d}}:{{:02d}}:{{:02d}}".format(*clock(i)), 24 * 3600),
        ("Ch,,T1,T2", lambda i: f"2026/05/{3 + (i > 30):02d},{{:02d}}:{{:02d}}:{{:02d}}".format(*clock(i)), 24 * 3600),
        (",Time,T1,T2", lambda i: f"{13 + (i > 30):02d}.05.2026,{{:02d}}:{{:02d}}:{{:02d}}".format(*clock(i)), 24 * 3600),
        # Parts of a moment, each in a column; a clock without signs.
        ("h,min,s,T1,T2", lambda i: f"{i // 120},{i // 2 % 60},{30 * i % 60}", 0),
        ("year,month,day,hour,minute,T1,T2", lambda i: f"2026,5,{3 + (i > 30)},{{}},{{}}".format(*clock(i, 60)), 24 * 3600),
        ("Time,T1,T2", lambda i: "{:02d}{:02d}{:02d}".format(*clock(i)), 0),
    ],
)
def test_moments_of_any_name_or_in_parts(tmp_path, head, row, step):
    run = tf.read(written(tmp_path, [head], [f"{row(i)},{FRONT[i]:.2f},{REAR[i]:.2f}" for i in range(60)]))
    every = 60 if "minute" in head else 30
    assert run.time_s.tolist() == [every * i + step * (i > 30) for i in range(60)]
    assert list(run.channels) == ["T1", "T2"]
    assert run.channels["T2"].tolist() == REAR.round(2).tolist()


def test_counts_that_could_be_clocks_stay_counts(tmp_path):
    """Every 100 s each number could be a clock; what counts hours beside minutes is one time in two units."""
    for head, every, first in (("Time [s],T1", 600, 0), ("Time,T1", 100, 0), ("Time [s],T1", 100, 30000)):
        rows = [f"{first + every * i},{FRONT[i]:.2f}" for i in range(10)]
        assert tf.read(written(tmp_path, [head], rows)).time_s.tolist() == [float(every * i) for i in range(10)]
    with pytest.raises(tf.InputError, match="may be a clock without signs"):
        tf.read(written(tmp_path, ["Time,T1"], [f"{30000 + 100 * i},{FRONT[i]:.2f}" for i in range(10)]))
    rows = [f"{8 + i // 60:02d}{i % 60:02d},{FRONT[i]:.2f}" for i in range(50, 60)] + [
        f"09{i:02d},{FRONT[i]:.2f}" for i in range(10)
    ]
    with pytest.raises(tf.InputError, match="may be a clock without signs") as refused:
        tf.read(written(tmp_path, ["Time,T1"], rows))
    assert "say time_format %H%M (or %M%S)" in str(refused.value)
    run = tf.read(written(tmp_path, ["Time,T1"], rows), time_format="%H%M")
    assert run.time_s.tolist() == [60.0 * i for i in range(20)]
    dated = [f"20260503,{row}" for row in rows]
    assert tf.read(written(tmp_path, ["Date,Time,T1"], dated)).time_s.tolist() == [60.0 * i for i in range(20)]
    rows = [f"{i / 60:.4f},{i},{FRONT[i]:.2f}" for i in range(60)]
    run = tf.read(written(tmp_path, ["h,min,T1"], rows))
    assert run.time_s == pytest.approx(60.0 * MINUTES, abs=0.2)


def test_what_tells_the_time_is_not_put_aside_for_what_else_looks_like_it(tmp_path):
    """A batch's date beside how long a tool was used; minutes and seconds of something else; a run that goes on past midnight."""
    elapsed = [f"{i // 4}:{15 * i % 60:02d}:00" for i in range(60)]
    for head, row in (
        ("time_min,Order date,Tool life,T1", lambda i: f"{15 * i},2026-02-01,{elapsed[59 - i]}"),
        (
            "Timestamp,Order date,Tool life,T1",
            lambda i: f"2026-05-0{3 + i // 48} {i // 4 % 24:02d}:{15 * i % 60:02d}:00,2026-02-01,0:00:0{i % 7}",
        ),
        ("Date,Elapsed,T1", lambda i: f"2026-05-0{3 + (i > 16)},{elapsed[i]}"),
        ("time_min,m,s,T1", lambda i: f"{15 * i},{i // 12},{5 * i % 60}"),
    ):
        rows = [f"{row(i)},{FRONT[i]:.2f}" for i in range(48)]
        run = tf.read(written(tmp_path, [head], rows), channels="T1")
        assert run.time_s.tolist() == [900.0 * i for i in range(48)], head


def test_a_number_beside_one_sensor_is_no_sensors_name(tmp_path):
    run = tf.read(written(tmp_path, ["time_s,point,front [degC]"], [f"{10 * i},{1 + i % 8},{FRONT[i]:.2f}" for i in range(60)]))
    assert list(run.channels) == ["front [degC]"]
    # A number that changes once is a stage of the test, not a sensor asked in turn.
    run = tf.read(written(tmp_path, ["time_s,node,value"], [f"{10 * i},{1 + i // 30},{FRONT[i]:.2f}" for i in range(60)]))
    assert "value" in run.channels


def test_sensors_by_number_that_are_asked_in_turn(tmp_path):
    rows = [
        f"2026-05-03 10:{i // 2:02d}:{2 + 3 * (i % 2):02d},{101 + i % 2},{(FRONT, REAR)[i % 2][i // 2]:.2f}" for i in range(118)
    ]
    run = tf.read(written(tmp_path, ["ts,sensor_id,value"], rows))
    assert list(run.channels) == ["sensor 101", "sensor 102"]
    rear = run.channels["sensor 102"]
    assert rear[np.isfinite(rear)].tolist() == REAR[:59].round(2).tolist()


def test_a_line_above_the_names_tells_what_groups_of_columns_are(tmp_path):
    rows = [f"{i};{FRONT[i]:.2f};{REAR[i]:.2f};{i / 4};{i / 8};3000" for i in range(60)]
    names = "Zeit [min];vorn;hinten;X;Y;Spindel"
    for groups in (";Temperatur [°C];;Verlagerung [µm];;Drehzahl [1/min]", "Zeit;Temperatur;;Verlagerung;;Drehzahl"):
        run = tf.read(written(tmp_path, [groups, names], rows))
        assert list(run.channels)[:2] == ["vorn", "hinten"]
        assert [n[-1] for n in run.displacements] == ["X", "Y"]
        assert list(run.inputs) == (["Spindel"] if "[" in groups else [])
    # Settings of a sheet, parts of a machine and kinds of probes stand in such a line, too.
    for above in ("Drehzahl;3000;1/min;;;", ";Spindel;;X axis;;", ";Type K;;Type K;;", "Time;Lab test;Load cycle;;;"):
        run = tf.read(written(tmp_path, [above, names], rows))
        assert list(run.channels) == ["vorn", "hinten", "X", "Y", "Spindel"], above


def test_units_and_probes_as_they_are_written(tmp_path):
    head = "time_min,T1 [?C],T2 [GrdC],T3 [°С],T4 [K-Type],Uebertemperatur [K]"
    run = tf.read(written(tmp_path, [head], [f"{i},{FRONT[i]:.2f},{REAR[i]:.2f},20,{FRONT[i]:.3f},{i / 8}" for i in range(60)]))
    assert list(run.channels) == head.split(",")[1:5]
    rows = [f"{i},{FRONT[i]:.2f} °C" if i < 40 else f"{i},{1.8 * FRONT[i] + 32:.2f} °F" for i in range(60)]
    with pytest.raises(tf.InputError, match="the unit changes within the record"):
        tf.read(written(tmp_path, ["time_min,T1"], rows))


def test_the_time_may_be_what_means_no_reading_elsewhere(tmp_path):
    rows = [f"{i},{0 if i in (5, 6) else FRONT[i].round(2)}" for i in range(60)]
    run = tf.read(written(tmp_path, ["time_min,T1"], rows), missing="0")
    assert run.time_s[0] == 0.0
    assert np.flatnonzero(np.isnan(run.channels["T1"])).tolist() == [5, 6]


def test_clocks_of_four_parts_go_to_the_next_at_60_or_at_100_or_are_asked_for(tmp_path):
    def rows(told):
        return [f"{told(i)},{FRONT[i]:.2f}" for i in range(60)]

    by_name = "Elapsed [dd:hh:mm:ss],T1"
    in_days = rows(lambda i: f"00:{i // 4:02d}:{15 * i % 60:02d}:00")
    assert tf.read(written(tmp_path, [by_name], in_days)).time_s.tolist() == [900.0 * i for i in range(60)]
    with pytest.raises(tf.InputError, match="a clock of four parts"):
        tf.read(written(tmp_path, ["Elapsed,T1"], in_days))
    assert tf.read(written(tmp_path, ["Elapsed,T1"], in_days), time_format="dd:hh:mm:ss").time_s[1] == 900.0
    for step in (7, 10):
        told = rows(lambda i, step=step: f"00:00:{step * i // 60:02d}:{step * i % 60:02d}")
        assert tf.read(written(tmp_path, ["Elapsed,T1"], told)).time_s.tolist() == [float(step * i) for i in range(60)]
    told = rows(lambda i: f"08:12:{20 * i // 100 % 60:02d}:{20 * i % 100:02d}")
    assert tf.read(written(tmp_path, ["Time,T1"], told)).time_s == pytest.approx(0.2 * np.arange(60))


def test_clocks_beside_their_columns_without_a_date_and_one_that_ends_first(tmp_path):
    head = "front time,front [degC],rear time,rear [degC]"
    rows = [f"{8 + i // 60:02d}:{i % 60:02d}:07,{FRONT[i]:.2f},{8 + i // 60:02d}:{i % 60:02d}:17,{REAR[i]:.2f}" for i in range(59)]
    run = tf.read(written(tmp_path, [head], rows))
    assert run.time_s.tolist() == [60.0 * (i // 2) + 10.0 * (i % 2) for i in range(118)]
    for unit in ("min", "minutes"):
        head = f"Time front [{unit}],front [degC],Time rear [{unit}],rear [degC]"
        run = tf.read(written(tmp_path, [head], [f"{i},{FRONT[i]:.2f},{i + 0.5},{REAR[i]:.2f}" for i in range(60)]))
        assert run.time_s.tolist() == [30.0 * i for i in range(120)]
    for filled in ("0,0.00", "403,21.00"):
        rows = [f"{10 * i},{FRONT[i]:.2f}," + (f"{10 * i + 3},{REAR[i]:.2f}" if i <= 40 else filled) for i in range(60)]
        run = tf.read(written(tmp_path, ["front time [s],front [degC],rear time [s],rear [degC]"], rows))
        rear = run.channels["rear [degC]"]
        assert rear[np.isfinite(rear)].tolist() == REAR[:41].round(2).tolist()
        assert run.time_s[np.isfinite(rear)].tolist() == [10.0 * i + 3.0 for i in range(41)]
    # How long a pump ran, beside the time of all, is no clock of its temperature.
    head = "time_s,pump temp [degC],pump time [s],fan temp [degC],fan time [s]"
    path = written(tmp_path, [head], [f"{10 * i},{FRONT[i]:.2f},{3 * i},{REAR[i]:.2f},{i}" for i in range(60)])
    with pytest.raises(tf.InputError, match="or exclude='pump time"):
        tf.read(path)
    assert tf.read(path, exclude=["pump time [s]", "fan time [s]"]).time_s.tolist() == [10.0 * i for i in range(60)]


def test_columns_of_a_calendar_switches_and_qualities_are_no_sensors(tmp_path):
    head = "Timestamp,T1,hour,weekday,Motor on,T1 [°C] rate,noise [°C],mV/K,Dew"
    rows = [
        f"2026-05-03 {i // 4:02d}:{15 * i % 60:02d}:00,{FRONT[i]:.2f},{i // 4},3,{int(i > 9)},0.{i},0.1,40,9" for i in range(60)
    ]
    assert list(tf.read(written(tmp_path, [head], rows)).channels) == ["T1"]
    with pytest.raises(tf.InputError, match="no number in a column of temperatures"):
        tf.read(written(tmp_path, ["time_s,T1,rear [degC]"], [f"{i},{FRONT[i]:.2f},({REAR[i]:.2f})" for i in range(60)]))


# --- columns that are no sensor of their own, and numbers that are no readings --------------------------------------------------------


def made_of(tmp_path, head, *columns, sep=","):
    path = tmp_path / "run.csv"
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([head, *(sep.join(map(str, row)) for row in rows)]), encoding="utf-8")
    return path


ROW_MINUTES = [f"{t}" for t in range(60)]
WARMS = [f"{20.0 + 10.0 * (1.0 - 2.718281828 ** (-t / 20.0)):.2f}" for t in range(60)]
STAYS = [f"{1.0 + t / 60.0:.2f}" for t in range(60)]


@pytest.mark.parametrize(
    "name",
    [
        *(
            "T1-T2 [K]",
            "T3 – T1",
            "Temperaturdifferenz",
            "Temperaturgradient",
            "Spreizung [K]",
            "Tdiff",
            "overtemp",
            "T_rel",
            "excess temp",
        ),
        *(
            "Ziel [°C]",
            "Vorgabe [°C]",
            "Zone1 demand [°C]",
            "T goal",
            "T calc",
            "T sim",
            "T predicted",
            "T correction",
            "T1 min",
            "T1 max",
        ),
    ],
)
def test_what_is_made_from_readings_or_asked_for_is_no_sensor(tmp_path, name):
    run = tf.read(made_of(tmp_path, f"time_min,T1 avg [°C],{name}", ROW_MINUTES, WARMS, STAYS))
    assert list(run.channels) == ["T1 avg [°C]"]
    assert list(run.inputs) == [name]


@pytest.mark.parametrize("name", ["T1-A [°C]", "Zone-1 [°C]", "T2 max [°C]", "bearing min [°C]"])
def test_what_only_looks_like_it_is_one(tmp_path, name):
    assert name in tf.read(made_of(tmp_path, f"time_min,T1 avg [°C],{name}", ROW_MINUTES, WARMS, STAYS)).channels


def test_kelvin_that_are_none_are_a_guess(tmp_path):
    run = tf.read(made_of(tmp_path, "time_min,front [K]", ROW_MINUTES, STAYS))
    assert run.channels["front [K]"][0] == 1.0
    assert [g.text for g in run.guesses] == ["front [K]: too cold for kelvin, read as degC"]
    with pytest.raises(InputError, match="refuses what had to be guessed"):
        tf.read(made_of(tmp_path, "time_min,front [K]", ROW_MINUTES, STAYS), strict=True)


def test_a_column_with_another_decimal_sign_is_refused(tmp_path):
    commas = [w.replace(".", ",") for w in WARMS]
    path = made_of(tmp_path, "time_min;T1;T2", ROW_MINUTES, commas, WARMS, sep=";")
    with pytest.raises(InputError, match="another decimal sign than the rest") as told:
        tf.read(path)
    assert "decimal ," in str(told.value.do)


@pytest.mark.parametrize("few", [0, 20, 50])
@pytest.mark.parametrize(("decimal", "cells"), [(".", "1,500"), (",", "1.500")])
def test_thousands_of_a_speed_beside_readings_with_decimals_are_a_guess(tmp_path, decimal, cells, few):
    """As no decimal sign would be needed twice in a file; a speed below a thousand has none."""
    warms = [w.replace(".", decimal) for w in WARMS]
    speed = ["800" if t < few else cells for t in range(60)]
    path = made_of(tmp_path, "time_min;T1;Speed [rpm]", ROW_MINUTES, warms, speed, sep=";")
    run = tf.read(path)
    assert run.inputs["Speed [rpm]"].tolist() == [800.0] * few + [1500.0] * (60 - few)
    assert [g.text for g in run.guesses] == [f"Speed [rpm]: {cells[1]!r} stands between thousands ({cells!r} is 1500)"]
    with pytest.raises(InputError, match="refuses what had to be guessed"):
        tf.read(path, strict=True)


@pytest.mark.parametrize(("name", "cell"), [("cos phi", "0,998"), ("T2 [°C]", "1,003"), ("flow [l/min]", "1,50")])
@pytest.mark.parametrize("few", [0, 20, 50])
def test_what_may_be_a_decimal_sign_is_none_between_thousands(tmp_path, name, cell, few):
    path = made_of(tmp_path, f"time_min;T1;{name}", ROW_MINUTES, WARMS, ["2"] * few + [cell] * (60 - few), sep=";")
    with pytest.raises(InputError, match=r"another decimal sign than the rest|not a number"):
        tf.read(path)


def test_full_width_digits_are_digits(tmp_path):
    wide = str.maketrans({c: chr(ord(c) + 0xFEE0) for c in "0123456789.:-"})
    stamps = [f"2026-11-28 {8 + t // 60:02d}:{t % 60:02d}:00".translate(wide) for t in range(60)]
    run = tf.read(made_of(tmp_path, "时间,温度１", stamps, [w.translate(wide) for w in WARMS]))
    assert run.channels["温度1"].tolist() == [float(w) for w in WARMS]
    assert (run.time_s[-1], "full-width digits read as digits" in run.notes) == (59 * 60.0, True)


def test_a_mark_for_the_whole_row_takes_all_its_readings(tmp_path):
    marks = ["BAD" if 10 <= t < 15 else "GOOD" for t in range(60)]
    run = tf.read(made_of(tmp_path, "time_min,T1,T2,quality", ROW_MINUTES, WARMS, WARMS, marks))
    assert all(np.flatnonzero(np.isnan(v)).tolist() == [10, 11, 12, 13, 14] for v in run.channels.values())


@pytest.mark.parametrize(("option", "name"), [("exclude", "--exclude"), ("inputs", "--inputs"), ("ambient", "--ambient")])
def test_a_channel_that_another_option_takes_is_told_so(option, name):
    with pytest.raises(UsageError, match="both name"):
        tf.read("sample_runs/spindle.csv", channels=["T5"], **{option: "T5" if option == "ambient" else ["T5"]})


def test_a_setting_may_be_called_with_its_filters_name():
    run = tf.read(ROOT / "sample_runs" / "spindle.csv", channels=["T1"])
    bare, whole = (tf.identify(run, until=60.0, settings={key: 0.97}) for key in ("forgetting", "afukf.forgetting"))
    assert bare[0] == whole[0]


@pytest.mark.parametrize(
    ("given", "minutes"),
    [("90", 90.0), ("90min", 90.0), ("90 min", 90.0), ("1.5h", 90.0), ("5400 s", 90.0), ("0.0625d", 90.0), ("9e1", 90.0)],
)
def test_a_number_may_have_its_unit(given, minutes):
    option = click.Option(["--until"], type=Finite(0, min_open=True), metavar="MIN")
    assert option.type.convert(given, option, None) == pytest.approx(minutes)


@pytest.mark.parametrize(
    ("of", "metavar", "given", "said"),
    [
        (Finite(0, min_open=True), "MIN", "90x", "'90x' is no number; allowed: above 0 in min, or with its unit beside it (s, min"),
        (Finite(0, min_open=True), "MIN", "1,5h", "(s, min, h, d); do: write 1.5h"),
        (Finite(0, min_open=True), "MIN", "min", "'min' is no number"),
        (Finite(0, min_open=True), "MIN", "20K", "'20K' is no number"),
        (Finite(0, min_open=True), "MIN", "0 min", "0 min is outside what is allowed: above 0"),
        (Finite(0, 0.5, min_open=True), "P", "0.6", "0.6 is outside what is allowed: above 0, to 0.5"),
        (Finite(0, 0.5, min_open=True), "P", "0.5", None),
        (Finite(0.05, 3600), "SECONDS", "2h", "2h is outside what is allowed: 0.05 to 3600"),
        (Finite(0.05, 3600), "SECONDS", "50ms", None),
        (Real(), "DEGC", "-5 °C", None),
        (Real(), "DEGC", "inf", "'inf' is no number; allowed: any in degC"),
        (Whole(1), "N", "0", "0 is outside what is allowed: 1 or more"),
        (Whole(1), "N", "1.5", "'1.5' is no whole number; allowed: 1 or more"),
        (Whole(1, 10), "N", "11", "11 is outside what is allowed: 1 to 10"),
        (Whole(1, 10), "N", "10", None),
    ],
)
def test_a_number_that_is_none_is_refused_with_what_is_allowed(of, metavar, given, said):
    option = click.Option(["--it"], type=of, metavar=metavar)
    if said is None:
        assert option.type.convert(given, option, None) == {"0.5": 0.5, "50ms": 0.05, "-5 °C": -5.0, "10": 10}[given]
        return
    with pytest.raises(click.BadParameter) as refused:
        option.type.convert(given, option, None)
    assert said in refused.value.message


def test_the_unit_of_a_time_goes_through_a_command(tool):
    whole = tool(
        "identify", "sample_runs/spindle.csv", "--until", "0.75h", "--at", "6h", "--channels", "T1", "-q", "--format", "json"
    )
    found = json.loads(whole.out)["records"][0]
    assert (found["until_min"], found["at_min"]) == (45.0, 360.0)


def test_wishes_are_numbers_one_by_one_and_an_array_is_a_list_of_them():
    """None among them, a word, True: each refused before any work."""
    run = tf.read(ROOT / "sample_runs" / "spindle.csv")
    with pytest.raises(tf.ThermofastError, match="tolerance: None among them"):
        tf.plan([None])
    assert [row.tolerance_c for row in tf.plan(np.array([0.5]), sensors=1)][:1] == [0.5]
    for wrong in (True, [True], ["40"]):
        with pytest.raises(tf.ThermofastError, match="windows: not a list of minutes"):
            tf.sweep(run, windows=wrong)


def test_a_start_behind_the_end_is_told():
    row = tf.identify(tf.read(ROOT / "sample_runs" / "spindle.csv"), 60, start=90)[0]
    assert (row.status, row.samples) == ("too_short", 0)
    assert "0 readings from 90 min, where the rise starts, to 60" in row.message


def test_what_is_the_same_is_equal(tmp_path):
    """Simulated records by their numbers and truth; a model by what it tells, wherever it is from."""
    one = tf.simulate(sensors=2)
    assert one == tf.simulate(sensors=2)
    assert one != tf.simulate(sensors=2, seed=5)
    assert one != tf.simulate(sensors=3)
    assert one != 7
    model = tf.improve(tf.read(ROOT / "sample_runs" / "spindle.csv")).model
    model.save(tmp_path / "m.toml")
    assert tf.Model.load(tmp_path / "m.toml") == model


def test_a_slice_of_results_is_a_tuple_of_every_kind():
    run = tf.read(ROOT / "sample_runs" / "spindle.csv")
    for found in (tf.identify(run, 60), tf.sweep(run, windows=40), tf.bench(run, until=60)):
        assert isinstance(found[:1], tuple)


def test_what_the_program_wrote_is_no_record(tool, tmp_path):
    rows, trace = tmp_path / "rows.csv", tmp_path / "trace.csv"
    tool("identify", "sample_runs/spindle.csv", "--until", "60", "--channels", "T5", "-q", "-o", rows, "--trace", trace)
    done = tool("identify", rows, "sample_runs/spindle.csv", "--until", "60", "--channels", "T5", "--format", "json", "-q")
    told = {r["status"]: r for r in json.loads(done.out)["records"]}
    assert told["ok"]["channel"] == "T5"
    assert "results of thermofast, and no record" in told["unreadable"]["message"]
    with pytest.raises(InputError, match="results of thermofast, and no record"):
        tf.read(pd.read_csv(rows))
    with pytest.raises(
        InputError, match=r"(?s)the trace of a filter.*long='channel,reading_c' takes its readings|channel,reading_c"
    ):
        tf.read(trace)
    assert list(tf.read(trace, long=("channel", "reading_c")).channels) == ["T5"]


def test_a_time_column_without_a_value_is_named():
    frame = pd.DataFrame({"time_min": np.full(60, np.nan), "T1": FRONT})
    with pytest.raises(InputError, match="column 'time_min': no value"):
        tf.identify(frame)


def test_errors_of_functions_speak_of_their_arguments():
    frame = pd.DataFrame({"time": MINUTES, "T1": FRONT})
    with pytest.raises(InputError, match="time_unit='min' confirms it"):
        tf.read(frame, strict=True)
    with pytest.raises(UsageError, match=r"settings='afukf\.nope=1': afukf has no setting 'nope'"):
        tf.identify(frame, settings={"afukf.nope": 1})
