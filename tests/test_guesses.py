"""Files that were once read wrong without a word: each is read right, or refused with the option to give; guesses are told."""

import json
from datetime import datetime, timedelta

import numpy as np
import pytest

import thermofast as tf
from thermofast.errors import InputError, UsageError
from thermofast.reading import Options, read_runs

N = 241
MINUTES = np.arange(N, dtype=float)
#: Two sensors that settle at 26.4 and 31.2 degC.
FRONT = 18.0 + 8.4 * (1 - np.exp(-MINUTES / 40.0))
REAR = 19.0 + 12.2 * (1 - np.exp(-MINUTES / 50.0))


def table(header, *columns, delimiter=","):
    return "\n".join([header, *(delimiter.join(map(str, row)) for row in zip(*columns, strict=True))]) + "\n"


def written(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "run.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return str(path)


def stamps(start="2026-05-03 20:38:00", step=60.0, n=N, form="%Y-%m-%d %H:%M:%S"):
    begin = datetime.fromisoformat(start)
    return [(begin + timedelta(seconds=step * i)).strftime(form) for i in range(n)]


def values(column):
    return [f"{v:.2f}" for v in column]


def about(run):
    return [g.about for g in run.guesses]


LONG = {
    "one stamp for both": [(t, n, v) for t, a, b in zip(stamps(), FRONT, REAR, strict=True) for n, v in (("front", a), ("rear", b))],
    "read in turn, a second apart": [
        (t, n, v)
        for t, u, a, b in zip(stamps(), stamps("2026-05-03 20:38:01"), FRONT, REAR, strict=True)
        for t, n, v in ((t, "front", a), (u, "rear", b))
    ],
    "one sensor after the other": [(t, n, v) for n, c in (("front", FRONT), ("rear", REAR)) for t, v in zip(stamps(), c, strict=True)],
}  # fmt: skip


@pytest.mark.parametrize("name", LONG)
@pytest.mark.parametrize("header", ["time,sensor,value", "Time,Series,Value", "_time,_field,_value", "stamp,what,temperature"])
def test_a_long_table_gives_each_sensor_its_own_readings(name, header, tmp_path, tool):
    path = written(tmp_path, header + "\n" + "".join(f"{t},{n},{v:.2f}\n" for t, n, v in LONG[name]))
    (run,) = read_runs(path)
    for sensor, truth in (("front", FRONT), ("rear", REAR)):
        column = run.channels[sensor]
        assert column[np.isfinite(column)] == pytest.approx(truth, abs=0.006)
    assert about(run) == ["layout"]
    found = json.loads(tool("identify", path, "--format", "json", "-q").out)
    by_name = {r["channel"]: r for r in found["records"]}
    assert by_name["front"]["steady_state_c"] == pytest.approx(26.4, abs=0.1)
    assert by_name["rear"]["steady_state_c"] == pytest.approx(31.2, abs=0.1)
    assert all("guessed: a long table" in r["message"] for r in found["records"])
    assert found["input"][0]["guesses"][0]["about"] == "layout"


def test_a_long_table_of_numbered_sensors_and_units(tmp_path):
    rows = [(t, k, f"{v:.2f}") for t, a, b in zip(stamps(), FRONT, REAR, strict=True) for k, v in ((1, a), (2, b))]
    (run,) = read_runs(written(tmp_path, table("time,sensor_id,value", *zip(*rows, strict=True))))
    assert list(run.channels) == ["sensor 1", "sensor 2"]
    rows = [
        (t, n, v, u) for t, a in zip(stamps(), FRONT, strict=True) for n, v, u in (("oil", a * 1.8 + 32, "°F"), ("rh", 40.0, "%"))
    ]
    (run,) = read_runs(written(tmp_path, table("last_changed,entity_id,state,unit_of_measurement", *zip(*rows, strict=True))))
    assert list(run.channels) == ["oil"]
    assert run.channels["oil"] == pytest.approx(FRONT, abs=1e-9)
    assert list(run.inputs) == ["rh"]


def test_long_by_the_users_word_and_refused_where_it_cannot_be_told(tmp_path):
    rows = [(t, m, n, v) for t, a, b in zip(stamps(), FRONT, REAR, strict=True) for m, n, v in (("A", "x", a), ("A", "y", b))]
    path = written(tmp_path, "\n".join(",".join(map(str, r)) for r in rows) + "\n")
    with pytest.raises(InputError, match=r"(?s)long table.*--long") as refused:
        read_runs(path)
    assert "column 3" in str(refused.value)
    (run,) = read_runs(path, Options(long=("column 2+column 3", "column 4")))
    assert list(run.channels) == ["x", "y"]
    assert run.guesses == ()
    with pytest.raises(UsageError, match="did you mean 'column 4'"):
        read_runs(path, Options(long=("column 3", "colum 4")))


def test_a_column_of_remarks_or_units_makes_no_long_table(tmp_path):
    state = ["on" if i % 40 < 20 else "off" for i in range(N)]
    (run,) = read_runs(written(tmp_path, table("time_min,T1,state", MINUTES, values(FRONT), state)))
    assert list(run.channels) == ["T1"]
    (run,) = read_runs(written(tmp_path, table("time_min,Unit,Value", MINUTES, ["F"] * N, values(FRONT * 1.8 + 32))))
    assert run.channels["Value"] == pytest.approx(FRONT, abs=0.006)


def test_readings_of_one_stamp_that_are_not_one_sensors_are_not_averaged(tmp_path):
    twice = [t for t in MINUTES for _ in range(2)]
    mixed = [v for a, b in zip(FRONT, REAR, strict=True) for v in (a, b + 5)]
    with pytest.raises(InputError, match="differ by far more than their noise") as refused:
        read_runs(written(tmp_path, table("time_min,T1", twice, values(mixed))))
    assert "--long" in str(refused.value)
    rng = np.random.default_rng(1)
    noisy = [v + 0.05 * rng.standard_normal() for v in FRONT for _ in range(2)]
    (run,) = read_runs(written(tmp_path, table("time_min,T1", twice, values(noisy))))
    assert run.time_s == pytest.approx(30.0 * np.arange(2 * N))
    assert about(run) == ["time"]
    doubled = [v for v in FRONT for _ in range(2)]
    (run,) = read_runs(written(tmp_path, table("time_min,T1", twice, values(doubled))))
    assert run.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    assert run.guesses == ()


def test_two_runs_in_one_file(tmp_path, tool):
    time, temperature = [*MINUTES, *MINUTES[:120]], values([*FRONT, *REAR[:120]])
    path = written(tmp_path, table("time_min,T1", time, temperature))
    first, second = read_runs(path)
    assert (first.name, second.name) == (f"{path}#1", f"{path}#2")
    assert first.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    assert second.channels["T1"] == pytest.approx(REAR[:120], abs=0.006)
    assert about(first) == ["runs"]
    assert "line 243" in str(first.guesses[0])
    found = json.loads(tool("identify", path + "#2", "--format", "json", "-q").out)["records"]
    assert [r["run"] for r in found] == [f"{path}#2"]
    assert found[0]["steady_state_c"] == pytest.approx(31.2, abs=0.3)
    refused = tool("identify", path + "#3")
    assert (refused.code, refused.out) == (2, "")
    assert "#1 to #2" in refused.err


def test_rows_out_of_place_and_files_joined_in_the_wrong_order_are_one_run(tmp_path):
    late = [*range(100), *range(101, 150), 100, *range(150, N)]
    (run,) = read_runs(written(tmp_path, table("time_min,T1", MINUTES[late], values(FRONT[late]))))
    assert run.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    swapped = [*range(120, N), *range(120)]
    (run,) = read_runs(written(tmp_path, table("time,T1", np.array(stamps())[swapped], values(FRONT[swapped]))))
    assert run.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    assert run.guesses == ()


def clock(seconds, form):
    h, m, s = int(seconds // 3600), int(seconds % 3600 // 60), seconds % 60
    return form.format(h=h, m=m, s=s, minutes=int(seconds // 60))


TIMES = {
    "mm:ss below 24:00": ("Time (mm:ss)", [clock(5 * i, "{minutes:02d}:{s:02.0f}") for i in range(N)], 5.0, []),
    "mm:ss, no word, beyond 47": ("Time", [clock(20 * i, "{minutes:02d}:{s:02.0f}") for i in range(N)], 20.0, ["time"]),
    "mm:ss.0 of a spreadsheet": ("Time", [clock(5 * i, "{minutes:02d}:{s:04.1f}") for i in range(N)], 5.0, []),
    "hh:mm beyond midnight": ("Time (hh:mm)", [clock((60 * i + 85000) % 86400, "{h:02d}:{m:02d}") for i in range(N)], 60.0, []),
    "elapsed beyond 24 h": ("Elapsed", [clock(900 * i, "{h}:{m:02d}:{s:02.0f}") for i in range(N)], 900.0, []),
    "days and a clock": ("StepTime", [f"{i // 100}d {clock(30 * (i % 100), '{h:02d}:{m:02d}:{s:05.2f}')}" for i in range(100)], 30.0, []),
    "minutes without unit": ("Time", list(range(N)), 60.0, ["time"]),
    "hours without unit": ("Time", [f"{i / 60:.9f}" for i in range(N)], 60.0, ["time"]),
    "seconds without unit": ("Time", [60 * i for i in range(N)], 60.0, ["time"]),
    "serial days of a spreadsheet": ("Time", [f"{46145.25 + i / 1440:.9f}" for i in range(N)], 60.0, ["time"]),
    "epoch s": ("Time", [1777000000 + 60 * i for i in range(N)], 60.0, []),
    "epoch ms": ("Time", [(1777000000 + 60 * i) * 10**3 for i in range(N)], 60.0, []),
    "epoch us": ("Time", [(1777000000 + 60 * i) * 10**6 for i in range(N)], 60.0, []),
    "epoch ns": ("Time", [(1777000000 + 60 * i) * 10**9 for i in range(N)], 60.0, []),
    "compact stamps": ("when", stamps(form="%Y%m%d_%H%M%S"), 60.0, []),
    "a dash between date and clock": ("date", stamps("2026-05-23 20:38:00", form="%d/%m/%Y-%H:%M:%S"), 60.0, []),
    "milliseconds behind a colon": ("System Time", [f"{s}:500" for s in stamps(form="%H:%M:%S")], 60.0, []),
    "month first with dots": ("Datum Zeit", stamps("2021-12-17 15:30:46", 3600.0, form="%m.%d.%y %I:%M:%S %p"), 3600.0, []),
    "year first, two digits": ("Date", stamps("2011-05-07 00:00:00", 900.0, form="%y.%m.%d %H:%M"), 900.0, ["date order"]),
    "month by name": ("Date", stamps(form="%d-%b-%Y %H:%M:%S"), 60.0, []),
    "day of the week": ("Date", stamps(form="%a, %d %b %Y %H:%M:%S"), 60.0, []),
}  # fmt: skip


@pytest.mark.parametrize("name", TIMES)
def test_time_is_understood(name, tmp_path):
    column, cells, step, guessed = TIMES[name]
    n = len(cells)
    (run,) = read_runs(written(tmp_path, table(f"{column};T1", cells, values(FRONT[:n]), delimiter=";")))
    if name == "days and a clock":
        assert run.time_s[1] == pytest.approx(step)
    else:
        assert run.time_s == pytest.approx(step * np.arange(n), abs=2e-3 if "serial" in name else 1e-4)
    assert about(run) == guessed


@pytest.mark.parametrize(
    ("cells", "do"),
    [
        ([2 * i for i in range(1000)], "--time-unit us, ms, s, min, h or d"),  # 33 min or 33 h
        ([clock(120 * i, "{h:02d}:{m:02d}") for i in range(700)], "--time-format"),  # 23 h or 23 min
    ],
)
def test_a_time_that_cannot_be_told_is_asked_for(cells, do, tmp_path):
    rising = 18.0 + 8.4 * (1 - np.exp(-np.arange(len(cells)) / 100.0))
    with pytest.raises(InputError) as refused:
        read_runs(written(tmp_path, table("Time,T1", cells, values(rising))))
    assert do in str(refused.value)


def test_a_second_column_of_time_tells_the_unit_of_the_first(tmp_path):
    path = written(
        tmp_path,
        table(
            "Test_Time,DateTime,Temperature", [2 * i for i in range(N)], [1494377253.17 + 2 * i for i in range(N)], values(FRONT)
        ),
    )
    (run,) = read_runs(path, Options(time="Test_Time"))
    assert run.time_s == pytest.approx(2.0 * np.arange(N))
    assert run.guesses == ()


def test_missing_does_not_change_how_stamps_are_read(tmp_path):
    cells = stamps("2011-05-07 00:00:00", 900.0, form="%y.%m.%d %H:%M:%S")
    readings = values(FRONT)
    readings[5] = "Logged"
    path = written(tmp_path, table("Date Time;Temp;x", cells, readings, ["a"] * N, delimiter=";"))
    with pytest.raises(InputError, match="--missing 'Logged'"):
        read_runs(path)
    (run,) = read_runs(path, Options(missing=("Logged",)))
    assert run.time_s[-1] == 900.0 * (N - 1)


def test_a_campbell_file(tmp_path):
    head = '"TOA5","CR1000","7","","","","",""\n"TIMESTAMP","RECORD","Batt_V_Min","T1_Avg","T2_Max"\n"TS","RN","Volts","DegF","Deg C"\n"","","Min","Avg","Max"\n'
    rows = "".join(
        f'"{t}",{i},12.9,{a * 1.8 + 32:.3f},{b:.3f}\n' for i, (t, a, b) in enumerate(zip(stamps(), FRONT, REAR, strict=True))
    )
    (run,) = read_runs(written(tmp_path, head + rows))
    assert run.time_s[-1] == 60.0 * (N - 1)
    assert run.channels["T1_Avg"] == pytest.approx(FRONT, abs=1e-3)
    assert run.channels["T2_Max"] == pytest.approx(REAR, abs=1e-3)
    assert list(run.inputs) == ["Batt_V_Min"]
    assert run.guesses == ()


UNITS = {
    "Lager_F": ("C", []),
    "Temp, (*F)": ("F", []),
    "TempF1": ("F", ["unit"]),
    "Temp_F_2": ("F", ["unit"]),
    "T [°F]": ("F", []),
    "T / K": ("K", []),
    "oil temp Kelvin": ("K", []),
    "front (℃)": ("C", []),
    "T (K)": ("C", ["unit"]),  # a thermocouple of type K: 18 degC is no kelvin
}


@pytest.mark.parametrize("name", UNITS)
def test_the_unit_of_a_temperature(name, tmp_path):
    unit, guessed = UNITS[name]
    logged = {"C": FRONT, "F": FRONT * 1.8 + 32, "K": FRONT + 273.15}[unit]
    (run,) = read_runs(written(tmp_path, table(f"time_min;{name}", MINUTES, [f"{v:.4f}" for v in logged], delimiter=";")))
    assert run.channels[name] == pytest.approx(FRONT, abs=1e-3)
    assert about(run) == guessed


def test_places_called_front_and_rear_are_no_units(tmp_path):
    (run,) = read_runs(written(tmp_path, table("time_min,T_F,T_R", MINUTES, values(FRONT), values(REAR))))
    assert run.channels["T_F"] == pytest.approx(FRONT, abs=0.006)
    assert run.guesses == ()


def test_kelvin_without_a_word_is_asked_for(tmp_path):
    path = written(tmp_path, table("0,0,291.15", MINUTES[1:], 0 * MINUTES[1:], [f"{v + 273.15:.2f}" for v in FRONT[1:]]))
    with pytest.raises(InputError, match="unit of column 'column 3'") as refused:
        read_runs(path, Options(time_unit="min"))
    assert "--units K" in str(refused.value)
    (run,) = read_runs(path, Options(time_unit="min", units=("K",), channels=("column 3",)))
    assert run.channels["column 3"] == pytest.approx(FRONT, abs=0.006)
    (run,) = read_runs(
        written(tmp_path, table("time_min,a temp,b temp", MINUTES, values(FRONT * 1.8 + 32), values(REAR))),
        Options(units=("a temp=F",)),
    )
    assert run.channels["a temp"] == pytest.approx(FRONT, abs=0.006)
    with pytest.raises(UsageError, match="C, K or F"):
        read_runs(path, Options(units=("R",)))


#: header of a column -> its role beside a sensor that says that it is one.
ROLES = {
    "AI0 (V)": "input", "front_ohm": "input", "Battery V": "input", "rel. humidity [%]": "input", "T_set": "input",
    "Solltemperatur": "input", "sv_temp": "input", "sample index": "left out", "Coolant temp": "sensor", "Load cell temp": "sensor",
    "T_flow_out": "sensor", "T1 Last (C)": "sensor", "Hallentemperatur": "ambient", "Raumtemp.": "ambient", "amb_temp": "ambient",
    "T_ref": "input", "CJC": "input", "spindle speed": "input", "Vibration mm/s": "input", "val3": "left out", "R1": "left out",
    "front bearing": "left out", "气温 温度": "sensor", "Air pressure": "input", "Temp (°C)": "sensor", "Z (um)": "displacement",
}  # fmt: skip


@pytest.mark.parametrize("name", ROLES)
def test_what_a_column_is(name, tmp_path):
    rising = values(REAR)
    (run,) = read_runs(written(tmp_path, table(f"time_min;Lager [°C];{name}", MINUTES, values(FRONT), rising, delimiter=";")))
    found = {**dict.fromkeys(run.channels, "sensor"), **dict.fromkeys(run.inputs, "input"), **dict.fromkeys(run.ambient, "ambient")}
    found |= dict.fromkeys(run.displacements, "displacement")
    assert found.get(name, "left out") == ROLES[name]
    assert "Lager [°C]" in run.channels
    (run,) = read_runs(
        written(tmp_path, table(f"time_min;Lager [°C];{name}", MINUTES, values(FRONT), rising, delimiter=";")),
        Options(channels=(name,)),
    )
    assert list(run.channels) == [name]


def test_a_file_without_temperatures_is_refused(tmp_path):
    with pytest.raises(InputError, match="no sensor column") as refused:
        read_runs(written(tmp_path, table("time_min,U (V),I (A),n [rpm]", MINUTES, values(FRONT), values(REAR), values(REAR))))
    assert "U (V)" in str(refused.value)


@pytest.mark.parametrize(("form", "fold"), [("%Y-%m-%d %H:%M:%S", "autumn"), ("%d.%m.%Y %H:%M", "spring")])
def test_a_changed_clock_is_told_and_taken_out(form, fold, tmp_path):
    begin = datetime(2026, 10, 25, 1, 30) if fold == "autumn" else datetime(2026, 3, 29, 0, 30)
    change = 90
    shift = timedelta(hours=-1 if fold == "autumn" else 1)
    cells = [(begin + timedelta(minutes=i) + (shift if i >= change else timedelta(0))).strftime(form) for i in range(N)]
    (run,) = read_runs(written(tmp_path, table("time,T1", cells, values(FRONT))))
    assert run.time_s == pytest.approx(60.0 * MINUTES)
    assert about(run) == ["time"]
    assert "clock was changed" in str(run.guesses[0])
    # On any other day an hour without readings is a gap.
    monday = [
        c for i in range(N) for c in [(datetime(2026, 3, 30, 0, 30) + timedelta(minutes=i + (60 if i >= 90 else 0))).strftime(form)]
    ]
    (run,) = read_runs(written(tmp_path, table("time,T1", monday, values(FRONT))))
    assert run.time_s[-1] == 60.0 * (N - 1) + 3600.0


def test_decimal_commas_in_a_comma_separated_file(tmp_path):
    text = "Zeit [min],T1,T2\n" + "".join(
        f"{i},{a:.2f},{b:.2f}\n".replace(".", ",") for i, a, b in zip(range(N), FRONT, REAR, strict=True)
    )
    (run,) = read_runs(written(tmp_path, text))
    assert run.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    assert run.channels["T2"] == pytest.approx(REAR, abs=0.006)
    assert about(run) == ["layout"]
    with pytest.raises(InputError, match="decimal commas"):
        read_runs(written(tmp_path, text.replace("18,00,", "18,")))
    quoted = "Zeit [min],T1\n" + "".join(f'{i},"{a:.2f}"\n'.replace(".", ",") for i, a in zip(range(N), FRONT, strict=True))
    assert read_runs(written(tmp_path, quoted))[0].channels["T1"] == pytest.approx(FRONT, abs=0.006)


def test_numbers_with_thousands_and_units_in_the_cell(tmp_path):
    text = "Test Time(s);Temp 1;Temp 2\n" + "".join(
        f"5,{577 + i // 10:03d},{i % 10:03d}.50;{a:.2f} °C;temp={b:.1f}'C\n"
        for i, (a, b) in enumerate(zip(FRONT, REAR, strict=True))
    )
    (run,) = read_runs(written(tmp_path, text))
    assert run.time_s[10] == 1000.0
    assert run.channels["Temp 1"] == pytest.approx(FRONT, abs=0.006)
    assert run.channels["Temp 2"] == pytest.approx(REAR, abs=0.06)


def test_encodings_that_are_mixed_or_damaged(tmp_path, tool):
    text = "\ufeff时间(min),温度\n".encode() + b"".join(f"{i},{v:.2f}\n".encode() for i, v in enumerate(FRONT))
    (run,) = read_runs(written(tmp_path, text))
    assert run.channels["温度"] == pytest.approx(FRONT, abs=0.006)
    remark = "\ufeff时间(min),温度,备注\n".encode() + b"".join(f"{i},{v:.2f},运行\n".encode("gbk") for i, v in enumerate(FRONT))
    (run,) = read_runs(written(tmp_path, remark))
    assert run.channels["温度"] == pytest.approx(FRONT, abs=0.006)
    assert "gb18030" in run.notes[0]
    assert tool("identify", written(tmp_path, remark), "--format", "csv").code == 0
    holes = table("time_min,T1", MINUTES, values(FRONT)).encode().replace(b"\n100.0,", b"\n" + bytes(4) + b"100.0,")
    (run,) = read_runs(written(tmp_path, holes))
    assert len(run.time_s) == N
    assert "4 NUL bytes" in " ".join(run.notes)


def test_files_that_are_no_text_are_called_by_their_kind(tmp_path):
    for start, kind in (
        (b"PK\x03\x04", "zip archive"),
        (b"TDSm", "TDMS"),
        (b"\x1f\x8b\x08", "gzip"),
        (b"MATLAB 5.0 MAT", "MATLAB"),
    ):
        with pytest.raises(InputError, match=kind):
            read_runs(written(tmp_path, start + bytes(range(256))))


def test_footers_and_a_header_with_one_name_too_many(tmp_path):
    text = (
        table("time_min\tT1\tT2\t", MINUTES, values(FRONT), values(REAR), delimiter="\t")
        + "\nTotal Elapsed Time (sec) = 3.0\n\nEnd\n"
    )
    (run,) = read_runs(written(tmp_path, text))
    assert list(run.channels) == ["T1", "T2"]
    assert [n for n in run.notes if "left out" in n] == [
        "1 lines without readings left out",
        "1 lines below the readings left out ('End')",
    ]
    assert len(run.time_s) == N
    with pytest.raises(InputError, match="line 243: the row has 2 cells"):
        read_runs(written(tmp_path, text.replace("\nTotal", "\n5\t7\nTotal").replace("\n\n", "\n")))


def test_what_stands_between_the_readings_is_left_out_and_told(tmp_path):
    rows = [f"{i};{a:.2f};{b:.2f}" for i, (a, b) in enumerate(zip(FRONT, REAR, strict=True))]
    rows[100:100] = ["time_min;T1;T2", "# door opened", "Event: pump on"]
    rows += ["Min;18,00;19,00", "Max;26,40;31,20"]
    (run,) = read_runs(written(tmp_path, "time_min;T1;T2\n" + "\n".join(rows).replace(".", ",") + "\n"))
    assert run.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    notes = " ".join(run.notes)
    for told in (
        "1 repeated headers",
        "1 comment lines",
        "1 lines without readings",
        "2 lines below the readings left out (Min, Max)",
    ):
        assert told in notes


def test_errors_name_the_line_of_the_file_whatever_was_left_out_above_it(tmp_path):
    rows = [f"{i};{a:.2f};{b:.2f}" for i, (a, b) in enumerate(zip(FRONT, REAR, strict=True))]
    rows[100:100] = ["time_min;T1;T2", "", "# door opened", "Event: pump on"]
    rows[150] = rows[150].replace(";", ";broken ", 1)  # the header stands above: row 150 is line 152
    with pytest.raises(InputError, match=r"line 152, column 'T1': not a number"):
        read_runs(written(tmp_path, "time_min;T1;T2\n" + "\n".join(rows) + "\n"))
    rows[150] = ";" + rows[150].split(";", 1)[1].replace("broken ", "")
    with pytest.raises(InputError, match=r"line 152, column 'time_min': no time in this row"):
        read_runs(written(tmp_path, "time_min;T1;T2\n" + "\n".join(rows) + "\n"))
    commas = [f"{i},{a:.2f}".replace(".", ",") for i, a in enumerate(FRONT)]
    commas[7:7] = ["", ""]
    commas[20] = commas[5]
    (run,) = read_runs(written(tmp_path, "time_min,T1\n" + "\n".join(commas[:20] + commas[21:]) + "\n"))
    assert len(run.time_s) == N - 1


def test_numbers_as_loggers_pad_them(tmp_path):
    rows = "".join(
        f"{i};+  {a:.1f};+++++++\n" if i % 50 == 7 else f"{i};+  {a:.1f};-   {b:.1f}\n"
        for i, (a, b) in enumerate(zip(FRONT, REAR, strict=True))
    )
    (run,) = read_runs(written(tmp_path, "time_min;T1;T2\n" + rows))
    assert run.channels["T1"] == pytest.approx(FRONT, abs=0.06)
    assert np.isnan(run.channels["T2"]).sum() == 5
    assert run.channels["T2"][0] == -19.0
    (run,) = read_runs(
        written(tmp_path, table("time_min;T1", [f"{1000 + i:,}".replace(",", "'") for i in range(N)], values(FRONT), delimiter=";"))
    )
    assert run.time_s[-1] == 60.0 * (N - 1)


FULL = {
    "Excel's mm:ss.0 past the hour": ("Time", [f"{(2287 + 10 * i) // 60 % 60:02d}:{(2287 + 10 * i) % 60:02d}.0" for i in range(N)], 10.0),
    "twelve hours without AM": ("Time", stamps("2026-05-03 12:40:07", 10.0, form="%I:%M:%S"), 10.0),
    "a counter of 32 bits in ms": ("millis", [(4294000000 + 10000 * i) % 2**32 for i in range(N)], 10.0),
    "newest first past midnight": ("clock", stamps("2026-05-03 23:40:07", 10.0, form="%H:%M:%S")[::-1], 10.0),
}  # fmt: skip


@pytest.mark.parametrize("name", FULL)
def test_a_clock_that_is_full_goes_on(name, tmp_path):
    column, cells, step = FULL[name]
    readings = values(FRONT[::-1] if "newest" in name else FRONT)
    (run,) = read_runs(
        written(tmp_path, table(f"{column};T1", cells, readings, delimiter=";")),
        Options(time_unit="ms" if column == "millis" else None),
    )
    assert run.time_s == pytest.approx(step * np.arange(N), abs=1e-3)
    assert run.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    assert about(run) == ([] if "newest" in name else ["time"])


def test_an_elapsed_time_that_falls_back_without_overlap_is_another_run(tmp_path):
    time = [*range(500, 500 + N), *range(N)]
    first, second = read_runs(written(tmp_path, table("time_min,T1", time, values([*FRONT, *REAR]))))
    assert first.channels["T1"] == pytest.approx(FRONT, abs=0.006)
    assert second.channels["T1"] == pytest.approx(REAR, abs=0.006)


def test_a_date_is_written_where_it_changes_and_a_half_of_the_day_beside(tmp_path):
    rows = "".join(
        f"{'03.05.26' if i == 0 else ''};{c};{v}\n"
        for i, (c, v) in enumerate(zip(stamps(form="%H:%M:%S")[:190], values(FRONT), strict=False))
    )
    (run,) = read_runs(written(tmp_path, "DATUM:;ZEIT:;M00: °C\n" + rows))
    assert run.time_s == pytest.approx(60.0 * np.arange(190))
    cells = [(datetime(2026, 5, 13, 11, 0) + timedelta(minutes=i)) for i in range(N)]
    text = "Date,Time,AM/PM,T1\n" + "".join(
        f"{c:%m/%d/%Y},{c:%I:%M:%S},{c:%p},{v}\n" for c, v in zip(cells, values(FRONT), strict=True)
    )
    (run,) = read_runs(written(tmp_path, text))
    assert run.time_s == pytest.approx(60.0 * MINUTES)
    assert run.guesses == ()


def test_segments_of_a_labview_file_are_joined(tmp_path):
    head = "LabVIEW Measurement\nSeparator\tTab\n***End_of_Header***\n\n"
    part = "Channels\t1\nSamples\t80\nY_Unit_Label\tDeg C\n***End_of_Header***\nX_Value\tfront\tComment\n"
    rows = [f"{60 * i:.6f}\t{v:.6f}\n" for i, v in enumerate(FRONT)]
    text = head + part + "".join(rows[:80]) + "\n" + part + "".join(rows[80:160]) + "\n" + part + "".join(rows[160:])
    (run,) = read_runs(written(tmp_path, text))
    assert run.channels["front"] == pytest.approx(FRONT, abs=1e-5)
    with pytest.raises(InputError, match="segment 2 has other channels"):
        read_runs(
            written(tmp_path, text.replace("X_Value\tfront", "X_Value\trear", 2).replace("X_Value\trear", "X_Value\tfront", 1))
        )


def test_two_clocks_are_refused_where_nobody_can_tell_whose_they_are(tmp_path):
    path = written(tmp_path, table("Time (s),Time (s),a [°C],b [°C]", 10 * MINUTES, 30 * MINUTES, values(FRONT), values(REAR)))
    with pytest.raises(InputError, match="two clocks") as refused:
        read_runs(path)
    assert "--time 'Time (s) (2)'" in str(refused.value)
    (run,) = read_runs(path, Options(time="Time (s) (2)", channels=("b [°C]",)))
    assert run.time_s[-1] == 30.0 * (N - 1)


def test_units_in_tenths_a_common_letter_and_what_cannot_be_degc(tmp_path):
    (run,) = read_runs(
        written(
            tmp_path,
            table(
                "time_min;front [0.1°C];rear [1/10 °C]",
                MINUTES,
                [f"{10 * v:.0f}" for v in FRONT],
                [f"{10 * v:.0f}" for v in REAR],
                delimiter=";",
            ),
        )
    )
    assert run.channels["front [0.1°C]"] == pytest.approx(FRONT, abs=0.06)
    (run,) = read_runs(
        written(
            tmp_path,
            table("time_min,front_F,rear_F,room_F", MINUTES, values(FRONT * 1.8 + 32), values(REAR * 1.8 + 32), [66.2] * N),
        )
    )
    assert run.channels["front_F"] == pytest.approx(FRONT, abs=0.006)
    assert run.ambient["room_F"] == pytest.approx([19.0] * N)
    assert about(run) == ["unit"]
    for header, cells, what in (
        ("bearing,room", [values(FRONT), [71.0] * N], "degF"),
        ("Pt100 front", [values(FRONT * 0.39 + 100)], "ohms"),
    ):
        with pytest.raises(InputError, match=what) as refused:
            read_runs(written(tmp_path, table(f"time_min,{header}", MINUTES, *cells)))
        assert "--units" in str(refused.value)


def test_a_probe_that_was_open_for_long_is_not_left_out_in_silence(tmp_path):
    cells = ["KAPUTT" if i < 150 else v for i, v in enumerate(values(REAR))]
    path = written(tmp_path, table("time_min,front [°C],rear [°C]", MINUTES, values(FRONT), cells))
    with pytest.raises(InputError, match="--missing 'KAPUTT'"):
        read_runs(path)
    (run,) = read_runs(path, Options(missing=("KAPUTT",)))
    assert np.isnan(run.channels["rear [°C]"]).sum() == 150


def test_strict_refuses_what_was_guessed_and_a_sure_record_passes(tmp_path, tool):
    guessed = written(tmp_path, table("Time,T1", MINUTES, values(FRONT)))
    refused = tool("identify", guessed, "--strict")
    assert (refused.code, refused.out) == (2, "")
    assert "--time-unit min" in refused.err
    assert tool("identify", guessed, "--strict", "--time-unit", "min", "-q").code == 0
    (tmp_path / "thermofast.toml").write_text("[input]\nstrict = true\n")
    assert tool("--config", tmp_path / "thermofast.toml", "identify", guessed).code == 2
    sure = tool("identify", "sample_runs/spindle.csv", "--strict", "--format", "json", "-q", "--channels", "T1")
    assert sure.code == 0
    assert json.loads(sure.out)["input"][0]["guesses"] == []


@pytest.mark.parametrize("command", ["sweep", "compare", "diagnose", "improve", "filters bench", "sensitivity"])
def test_every_command_tells_the_guess_in_its_rows(command, tmp_path, tool):
    path = written(tmp_path, table("Time,T1", MINUTES, values(FRONT + 0.02 * np.random.default_rng(2).standard_normal(N))))
    done = tool(*command.split(), path, "--format", "json", "-q")
    assert done.code == 0, done.err
    document = json.loads(done.out)
    assert all("'Time' has no unit, taken as min" in r["message"] for r in document["records"])
    assert document["input"][0]["guesses"][0]["option"] == "--time-unit min confirms it"


@pytest.mark.parametrize(
    ("header", "first", "unit"),
    [
        ("date,time,front", ("%Y%m%d", "%H%M%S"), "stamp"),
        ("date,time,front", ("%Y%m%d", "%H:%M:%S"), "stamp"),
        ("date,min,front", ("%Y%m%d", None), "min"),  # counted minutes, not seconds since midnight
        ("datetime,front", ("%Y%m%d%H%M%S",), "stamp"),
    ],
)
def test_a_date_written_as_a_number(tmp_path, header, first, unit):
    columns = [stamps(form=form) if form else MINUTES.astype(int) for form in first]
    run = read_runs(written(tmp_path, table(header, *columns, values(FRONT))), Options())[0]
    assert list(run.channels) == ["front"]
    assert np.array_equal(run.time_s, MINUTES * 60.0)
    assert run.seen.time_unit == unit


def test_a_number_that_is_no_time_in_any_unit(tmp_path):
    times = [*range(N - 1), 1e303]
    with pytest.raises(InputError, match="line 242, column 'time_min': no time in this row"):
        read_runs(written(tmp_path, table("time_min,front", times, values(FRONT))), Options())


EAST = {
    "gb18030": "序号,采集时间,主轴前轴承(℃),环境温度(℃)",
    "cp932": "番号,日時,(1)CH1[℃],周囲温度[℃]",
    "big5": "編號,時間,主軸前軸承(℃),環境溫度(℃)",
    "euc_kr": "번호,시간,스핀들 앞(℃),실내 온도(℃)",
}


@pytest.mark.parametrize("encoding", EAST)
def test_a_file_in_an_encoding_of_east_asia(tmp_path, encoding):
    told = table(EAST[encoding], range(1, N + 1), stamps(), values(FRONT), ["21.0"] * N)
    run = read_runs(written(tmp_path, told, encoding))[0]
    assert list(run.channels) == [EAST[encoding].split(",")[2]]
    assert list(run.ambient) == [EAST[encoding].split(",")[3]]
    assert np.array_equal(run.time_s, MINUTES * 60.0)


@pytest.mark.parametrize("encoding", ["cp1252", "latin-1", "utf-8"])
def test_western_letters_stay_western(tmp_path, encoding):
    told = table("Zeit [min];Lager für Ø20 [°C];Gehäuse [°C]", MINUTES, values(FRONT), values(REAR), delimiter=";")
    run = read_runs(written(tmp_path, told, encoding))[0]
    assert list(run.channels) == ["Lager für Ø20 [°C]", "Gehäuse [°C]"]


@pytest.mark.parametrize(
    "form",
    [
        "%Y年%m月%d日 %H时%M分%S秒",
        "%Y年%m月%d日 %H:%M:%S",
        "%Y/%m/%d %p %I:%M:%S",
        "%d/%m/%Y %Hh%M",
        "%Hh%Mm%Ss",
        "%a %b %d %H:%M:%S %Y",
        "%a %b %d %H:%M:%S CET %Y",
    ],
)
def test_stamps_of_other_forms(tmp_path, form):
    start = "2026-05-13 10:38:00" if "%d/" in form or "%Hh" in form else "2026-05-13 11:38:00"  # over noon and, once, not
    written_so = [s.replace("AM", "上午").replace("PM", "下午") for s in stamps(start, form=form)]
    run = read_runs(written(tmp_path, table("time,front [°C]", written_so, values(FRONT))))[0]
    assert np.array_equal(run.time_s, MINUTES * 60.0)


def test_readings_and_times_that_all_carry_their_unit(tmp_path):
    cells = [[f"{i:g} min" for i in MINUTES], [f"{v:.2f} °C".replace(".", ",") for v in FRONT]]
    (run,) = read_runs(written(tmp_path, table("Zeit;vorn", *cells, delimiter=";")))
    assert run.channels["vorn"] == pytest.approx(np.round(FRONT, 2))
    assert run.time_s[-1] == 60.0 * (N - 1)


def test_each_sensor_with_a_clock_of_its_own(tmp_path):
    later = [(datetime.fromisoformat(s) + timedelta(seconds=20)).isoformat(" ") for s in stamps()]
    text = table("front,,rear,\nTimestamp,Value [°C],Timestamp,Value [°C]", stamps(), values(FRONT), later, values(REAR))
    (run,) = read_runs(written(tmp_path, text))
    front, rear = run.channels.values()
    assert np.array_equal(run.time_s[np.isfinite(front)], MINUTES * 60.0)
    assert np.array_equal(run.time_s[np.isfinite(rear)], MINUTES * 60.0 + 20.0)
    assert rear[np.isfinite(rear)] == pytest.approx(np.round(REAR, 2))


def test_clocks_a_moment_apart_are_one(tmp_path):
    header = "Index,Reading 101 [C],Relative Time (s),Reading 102 [C],Relative Time (s)"
    rows = [range(1, N + 1), values(FRONT), 60.0 * MINUTES, values(REAR), 60.0 * MINUTES + 0.2]
    (run,) = read_runs(written(tmp_path, table(header, *rows)))
    assert np.array_equal(run.time_s, 60.0 * MINUTES)
    assert list(run.channels) == ["Reading 101 [C]", "Reading 102 [C]"]
    assert any("2 clocks within 0.1 %" in n for n in run.notes)


@pytest.mark.parametrize("mark", ["\t", ";", ","])
def test_an_export_of_twincat_scope(tmp_path, mark):
    head = [
        ["Name", "warm-up"],
        ["Starttime of export", "132959733843760000", "Montag", "15:56:24.376"],
        [],
        ["Name", "front", "rear", "Name", "slow"],
        ["SampleTime[ms]", "60000", "60000", "SampleTime[ms]", "300000"],
        ["Unit", "°C (Temperature)", "K", "Unit", "°C (Temperature)"],
        [],
    ]
    rows = [
        [60000 * i, f"{FRONT[i]:.2f}", f"{REAR[i] + 273.15:.2f}", *([300000 * i, f"{FRONT[5 * i]:.2f}"] if 5 * i < N else ["", ""])]
        for i in range(N)
    ]
    (run,) = read_runs(written(tmp_path, "\r\n".join(mark.join(map(str, row)) for row in [*head, *rows, ["EOF"]])))
    front, rear, slow = run.channels.values()
    assert list(run.channels) == ["front [°C]", "rear [K]", "slow [°C]"]
    assert np.array_equal(run.time_s, MINUTES * 60.0)
    assert front == pytest.approx(FRONT, abs=0.006)
    assert rear == pytest.approx(REAR, abs=0.006)
    assert np.array_equal(np.flatnonzero(np.isfinite(slow)), np.arange(0, N, 5))
    assert slow[::5] == pytest.approx(FRONT[::5], abs=0.006)


@pytest.mark.parametrize(
    ("encoding", "header"),
    [
        ("cp1250", "Datum;Čas;Ložisko přední;Teplota okolí"),
        ("cp1250", "Data;Czas;Łożysko przód;Temperatura otoczenia"),
        ("cp1251", "Дата;Время;Подшипник передний;Температура среды"),
        ("cp1252", "Data;Ora;Cuscinetto anteriore;Temperatura ambiente"),
        ("cp1252", "Date;Heure;Palier avant;Température ambiante"),
        ("cp1252", "Fecha;Hora;Rodamiento delantero;Temperatura ambiente"),
        ("cp1252", "Datum;Tid;Lager främre;Omgivning"),
        ("cp1252", "Dato;Tid;Støy på lager;Omgivelser"),
        ("cp1254", "Tarih;Saat;Ön yatak;Ortam sıcaklık"),
        ("utf-8", "Datum;Tijd;Lager voor;Omgeving"),
    ],
)
@pytest.mark.parametrize("clock", ["%H:%M:%S", "%H.%M.%S"])
def test_headers_in_other_languages(tmp_path, encoding, header, clock):
    cells = [[f"{v:.2f}".replace(".", ",") for v in column] for column in (FRONT, np.full(N, 21.0))]
    text = table(header, stamps(form="%d.%m.%Y"), stamps(form=clock), *cells, delimiter=";")
    run = read_runs(written(tmp_path, text, encoding))[0]
    assert list(run.channels) == [header.split(";")[2]]
    assert list(run.ambient) == [header.split(";")[3]]
    assert np.array_equal(run.time_s, 60.0 * MINUTES)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"t": 0, "T1": 20.0}\n{"t": 1, "T1": 20.1}\n', "JSON.*lines=True"),
        ('[{"t": 0, "T1": 20.0}]', "JSON.*read_json"),
        ("<?xml version='1.0'?><rows/>", "XML"),
    ],
)
def test_markup_is_refused_with_the_way_out(tmp_path, text, said):
    with pytest.raises(InputError, match=f"(?s){said}"):
        read_runs(written(tmp_path, text))


def test_clocks_of_a_spreadsheet_are_days(tmp_path):
    half = N // 2
    run = read_runs(written(tmp_path, table("Elapsed,front [°C]", MINUTES[:half] / 1440.0, values(FRONT[:half]))))[0]
    assert run.time_s == pytest.approx(60.0 * MINUTES[:half])
    assert about(run) == ["time"]
    with pytest.raises(InputError, match=r"(?s)does not say its unit.*in h 10 min, in d 4 h"):
        read_runs(written(tmp_path, table("Elapsed,front [°C]", MINUTES / 1440.0, values(FRONT))))


def test_speeds_beside_temperatures_and_tables_that_lie_on_their_side(tmp_path):
    run = read_runs(written(tmp_path, table("time_min,TEMP_1,N_ACT", MINUTES, values(FRONT), ["6000"] * N)))[0]
    assert list(run.channels) == ["TEMP_1"]
    lying = "\n".join(["sensor," + ",".join(map(str, MINUTES)), "front," + ",".join(values(FRONT))])
    with pytest.raises(InputError, match=r"(?s)2 rows of 242 columns.*turn the table"):
        read_runs(written(tmp_path, lying))


def lying(label: str, moments: list[str], *more: str, mark: str = ",") -> str:
    """A table on its side: moments in its first row, a sensor in each other."""
    cells = [[label, *more[:1], *moments], ["front", *more[1:], *values(FRONT)], ["rear", *more[1:], *values(REAR)]]
    return "\n".join(mark.join(row).replace(".", "," if mark == ";" else ".") for row in cells) + "\n"


@pytest.mark.parametrize("mark", [",", ";", "\t"])
@pytest.mark.parametrize("above", ["", "Testbench 7\nreadings of the spindle\n"])
def test_tables_that_lie_on_their_side_are_turned(tmp_path, mark, above):
    stamps = [f"2026-05-03 {8 + int(m // 60):02d}:{int(m % 60):02d}:{round(60 * (m % 1)):02d}" for m in MINUTES]
    for label, moments, more in (
        ("time_min", [f"{m:g}" for m in MINUTES], ()),
        ("sensor", stamps, ()),
        ("Name", stamps, ("Unit", "°C")),
    ):
        run = read_runs(written(tmp_path, above + lying(label, moments, *more, mark=mark)))[0]
        np.testing.assert_allclose(run.time_s, 60.0 * MINUTES, atol=1e-6)
        np.testing.assert_allclose(run.channels["front"], np.round(FRONT, 2), atol=1e-9)
        np.testing.assert_allclose(run.channels["rear"], np.round(REAR, 2), atol=1e-9)
        assert "layout" in about(run)


def test_a_table_with_a_row_of_numbers_for_a_name_is_not_turned(tmp_path):
    text = lying("time_min", [f"{m:g}" for m in MINUTES]).replace("rear,", "17,")
    with pytest.raises(InputError, match="no time in this row"):
        read_runs(written(tmp_path, text))


def test_a_clock_that_the_heading_calls_utc_is_not_changed(tmp_path):
    """A pause of an hour where other clocks are put forward was taken out of the record."""
    rows = []
    for k in range(60):
        minute = k + (60 if k >= 30 else 0)
        rows.append(f"2024-03-31 {1 + minute // 60:02d}:{minute % 60:02d}:00,{20 + k / 8:.3f}")
    for head, paused in (("time (UTC)", True), ("Date Time, GMT+01:00", True), ("time", False)):
        path = tmp_path / "run.csv"
        path.write_text(f'"{head}",T1 [C]\n' + "\n".join(rows) + "\n")
        (run,) = read_runs(path)
        assert run.time_s[-1] == (119.0 if paused else 59.0) * 60.0, head
        assert any("clock was changed" in str(guess) for guess in run.guesses) is not paused


def test_switches_among_the_sensors_of_a_long_table_are_left_out(tmp_path):
    told = {
        "sensor.front": lambda k: f"{20 + k / 8:.2f}",
        "binary_sensor.door": lambda k: "on" if k % 3 else "off",
        "sensor.rear": lambda k: "unavailable" if k == 4 else f"{21 + k / 16:.2f}",
    }
    rows = ["entity_id,state,last_changed"]
    rows += [f"{name},{state(k)},2026-05-03T08:{k:02d}:00.000Z" for name, state in told.items() for k in range(40)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(rows) + "\n")
    (run,) = read_runs(path)
    assert list(run.channels) == ["sensor.front", "sensor.rear"]
    assert run.channels["sensor.front"].tolist() == [round(20 + k / 8, 2) for k in range(40)]
    assert np.flatnonzero(np.isnan(run.channels["sensor.rear"])).tolist() == [4]
    assert any("what tells words left out: binary_sensor.door" in note for note in run.notes)
    path.write_text(
        "\n".join([*rows, "sensor.rear,high,2026-05-03T08:50:00.000Z"] + ["sensor.rear,odd,2026-05-03T08:51:00.000Z"] * 45) + "\n"
    )
    with pytest.raises(InputError):
        read_runs(path)


def test_a_key_for_the_unit_pressed_in_mid_record_is_refused(tmp_path):
    front, rear = FRONT.copy(), REAR.copy()
    front[90:], rear[90:] = 1.8 * front[90:] + 32.0, 1.8 * rear[90:] + 32.0
    with pytest.raises(InputError, match="line 92: the unit changes from degC to degF"):
        read_runs(written(tmp_path, table("time_min,T1,T2", MINUTES, values(front), values(rear))))
    back = [np.where(np.arange(N) < 90, 1.8 * c + 32.0, c) for c in (FRONT, REAR)]
    with pytest.raises(InputError, match="from degF to degC"):
        read_runs(written(tmp_path, table("time_min,front [°F],rear [°F]", MINUTES, *map(values, back))))
    front[90:] += 9.0  # a jump, but not that one
    assert len(read_runs(written(tmp_path, table("time_min,T1,T2", MINUTES, values(front), values(rear))))[0].channels) == 2


@pytest.mark.parametrize("name", ["T1 (&deg;F)", "T1 (¡F)", r"T1 ($^\circ$F)", "T1 [&#176;F]"])
def test_fahrenheit_under_signs_of_other_pages(tmp_path, name):
    run = read_runs(written(tmp_path, table(f"time_min;{name}", MINUTES, values(1.8 * FRONT + 32.0), delimiter=";")))[0]
    (front,) = run.channels.values()
    assert front[0] == pytest.approx(FRONT[0], abs=0.01)


def test_a_column_in_volts_that_is_named_as_a_sensor_is_told(tmp_path):
    text = table("time_min;TC1 [mV];TC2 [°C]", MINUTES, values(FRONT), values(REAR), delimiter=";")
    run = read_runs(written(tmp_path, text), Options(channels=("TC1",)))[0]
    assert any("'TC1 [mV]' is a voltage" in g.text for g in run.guesses)
    assert not read_runs(written(tmp_path, text), Options(channels=("TC1",), units=("TC1 [mV]=C",)))[0].guesses


def test_the_greatest_of_a_sensor_beside_it_and_of_a_pair(tmp_path):
    more = values(FRONT + 0.1)
    run = read_runs(written(tmp_path, table("time_min;front [°C];front_max [°C]", MINUTES, values(FRONT), more, delimiter=";")))[0]
    assert list(run.channels) == ["front [°C]"]
    run = read_runs(
        written(tmp_path, table("time_min;front_min [°C];front_max [°C]", MINUTES, values(FRONT), more, delimiter=";"))
    )[0]
    assert len(run.channels) == 2


def test_places_beside_a_room_that_alone_has_a_unit(tmp_path):
    text = table("time_min;front bearing;motor;hall air [°C]", MINUTES, values(FRONT), values(REAR), ["18.0"] * N, delimiter=";")
    run = read_runs(written(tmp_path, text))[0]
    assert (list(run.channels), list(run.ambient)) == (["front bearing", "motor"], ["hall air [°C]"])


def test_a_long_table_of_two_quantities_keeps_them_apart(tmp_path):
    """A third of the moments stand there twice for one sensor: temperature and vibration became one curve."""
    rows = ["time_min,sensor,quantity,value"]
    for m, a, b in zip(MINUTES, values(FRONT), values(REAR), strict=True):
        rows += [f"{m:g},front,temperature,{a}", f"{m:g},front,vibration,1.2{int(m) % 7}", f"{m:g},rear,temperature,{b}"]
    run = read_runs(written(tmp_path, "\n".join(rows) + "\n"))[0]
    assert list(run.channels) == ["front temperature", "rear temperature"]
    assert "front vibration" in run.inputs
    assert run.channels["front temperature"] == pytest.approx(np.round(FRONT, 2))


def test_markers_of_an_archive_are_left_out(tmp_path):
    rows = ['"VarName";"TimeString";"VarValue";"Validity";"Time_ms"']
    for m, front, rear in zip(MINUTES, values(FRONT), values(REAR), strict=True):
        moment = f"20.11.2026 {6 + int(m // 60):02d}:{int(m % 60):02d}:30"
        clock = f"{46346264236.1111 + 1e6 * m / 1440.0:.4f}"
        for name, v in (("Temp_vorn", front), ("Temp_hinten", rear)):
            rows.append(f'"{name}";"{moment}";{v};1;{clock}'.replace(".", ",").replace(",", ".", 2))
    rows += ['"$RT_COUNT$";241;"";"";""', '"$RT_OFF$";"20.11.2026 10:20:30";0;2;46346431736,1111']
    run = read_runs(written(tmp_path, "\n".join(rows) + "\n"))[0]
    assert list(run.channels) == ["Temp_vorn", "Temp_hinten"]
    assert run.time_s[-1] == pytest.approx(60.0 * MINUTES[-1], abs=1.0)
    assert any("$RT_OFF$" in n for n in run.notes)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("name,tags,time,front", "temps,host=plc,{ns},{v}"),
        ("cycle time [s],time [s],front [°C]", "12.{k},{s},{v}"),
        ("Time,ms,front", "2026-05-03 {h:02d}:{m:02d}:00,250,{v}"),
        ("Data;front [°C]", "15/11/2026 {h:02d}.{m:02d};{v}"),
    ],
)
def test_which_column_is_the_time(tmp_path, header, row):
    told = [
        {"ns": 1790165160 * 10**9 + 60 * 10**9 * i, "k": 5 + i % 3, "s": 60 * i, "h": 8 + i // 60, "m": i % 60, "v": v}
        for i, v in enumerate(values(FRONT))
    ]
    run = read_runs(written(tmp_path, "\n".join([header, *(row.format(**t) for t in told)]) + "\n"))[0]
    assert run.time_s == pytest.approx(60.0 * MINUTES)
    assert len(run.channels) == 1


@pytest.mark.parametrize("mark", [".", ","])
def test_a_labview_file_without_its_column_of_times(tmp_path, mark):
    head = f"LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t{mark}\nX_Columns\tNo\n***End_of_Header***\n\t\n"
    head += "Channels\t2\t\t\nSamples\t241\t241\t\nY_Unit_Label\tDeg C\tDeg C\t\nX_Dimension\tTime\tTime\t\n"
    head += "X0\t1.5E+0\t1.5E+0\t\nDelta_X\t0.500000\t0.500000\t\n***End_of_Header***\t\t\t\nX_Value\tfront\trear\tComment\n"
    rows = [f"\t{a}\t{b}\t".replace(".", mark) for a, b in zip(values(FRONT), values(REAR), strict=True)]
    path = tmp_path / "run.lvm"
    path.write_text(head.replace("0.5", f"0{mark}5").replace("1.5E", f"1{mark}5E") + "\n".join(rows) + "\n")
    (run,) = read_runs(path)
    assert run.time_s == pytest.approx(0.5 * np.arange(N))
    assert list(run.channels) == ["front", "rear"]
    assert any("one row every 0.5 s" in n for n in run.notes)


def test_a_twincat_export_without_the_empty_line_above_its_readings(tmp_path):
    lines = [
        "Name\tScope Project",
        "File\tC:\\x.svdx",
        "Starttime of export\t133900000000000000\tWednesday",
        "Endtime of export\t1",
        "",
    ]
    lines += [
        "Name\tfront\tName\trear",
        "Data-Type\tREAL64\tData-Type\tREAL64",
        "Unit\t(None)\tUnit\t(None)",
        "ScaleFactor\t1\tScaleFactor\t1",
    ]
    lines += [f"{60000 * k}\t{a}\t{60000 * k}\t{b}" for k, (a, b) in enumerate(zip(values(FRONT), values(REAR), strict=True))]
    (run,) = read_runs(written(tmp_path, "\n".join(lines) + "\n"))
    assert run.time_s == pytest.approx(60.0 * np.arange(N))
    assert list(run.channels) == ["front", "rear"]


@pytest.mark.parametrize("word", ["UR", "???", "******", "#N/V", "#ERROR", "Drahtbruch", "TC open", "+1.#QNAN0e+000", "-nan(ind)"])
def test_words_for_no_reading(tmp_path, word):
    cells = [word if i % 9 == 4 else v for i, v in enumerate(values(FRONT))]
    (run,) = read_runs(written(tmp_path, table("time_min;front;rear", MINUTES, cells, values(REAR), delimiter=";")))
    assert np.flatnonzero(np.isnan(run.channels["front"])).tolist() == list(range(4, N, 9))


@pytest.mark.parametrize("name", ["coolant_temp", "oil_temp", "T_coolant", "coolant [degC]"])
def test_what_flows_past_a_machine_says_nothing_of_its_codes(name):
    """S1 and S2 begin where the coolant does: with its temperature named they were dropped, and it was the only sensor."""
    time = np.arange(0.0, 60.0)
    table = {"time_min": time, "S1": 20.1 + 8.0 * -np.expm1(-time / 30.0), "S2": 20.1 + 5.0 * -np.expm1(-time / 35.0)}
    run = tf.read({**table, name: 19.3 + 0.02 * time})
    assert list(run.channels) == ["S1", "S2", name]
    far = tf.read({**table, "S1": 200.0 + time / 7.0, name: 19.3 + 0.02 * time})  # a pressure may begin anywhere
    assert list(far.channels) == [name]
    beside = tf.read({**table, "spindle [degC]": 20.3 + 0.1 * time, name: 19.3 + 0.02 * time})
    assert list(beside.channels) == ["spindle [degC]", name]


def test_the_unit_of_an_input_is_taken_as_told():
    time = np.arange(0.0, 60.0)
    table = {"time_min": time, "S1": 68.0 + 0.1 * time, "S2": 68.2 + 0.05 * time, "coolant": 68.0 + 0.0 * time + 0.01 * time}
    plain, told = tf.read(table), tf.read(table, units="coolant=F")
    assert list(told.inputs) == ["coolant"]
    assert plain.inputs["coolant"][0] == 68.0
    assert told.inputs["coolant"][0] == pytest.approx(20.0)
    assert told.channels["S1"][0] == plain.channels["S1"][0]
    every = tf.read(table, units="F")  # of all sensors, and of no input that nobody calls a temperature
    assert (every.inputs["coolant"][0], every.channels["S1"][0]) == (68.0, pytest.approx(20.0))


def test_a_coolant_without_a_unit_is_asked_for():
    """Its heat was not tried without a word, and the way out that was told led nowhere."""
    time, rng = np.arange(0.0, 240.0), np.random.default_rng(2)
    coolant = 20.0 + 2.0 * (time > 120.0)
    late = np.zeros(240)
    for k in range(1, 240):
        late[k] = late[k - 1] + 0.02 * (coolant[k - 1] - 20.0 - late[k - 1])
    lines = {
        f"S{i}": 20.0 + rise * -np.expm1(-0.02 * time) + late + 0.02 * rng.standard_normal(240) for i, rise in ((1, 9.0), (2, 6.0))
    }
    table = {"time_min": time, **lines, "coolant": coolant}
    plain = tf.compare(table)
    assert all("coolant has no unit and counts as no temperature: --units coolant=C if it is one" in r.message for r in plain)
    (refused,) = tf.diagnose(table, effects="coolant_heat")
    assert "say which input is a temperature: --units COLUMN=C" in refused.message
    told = tf.diagnose(tf.read(table, units="coolant=C"), effects="coolant_heat")
    assert {r.verdict for r in told} == {"coolant_heat"}
    assert not any("counts as no temperature" in r.message for r in told)
