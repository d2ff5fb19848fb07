"""Records as loggers write them, read right; and the rules that say so."""

import csv
import io
import re
import zipfile
from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import thermofast as tf
from thermofast.errors import InputError, UsageError
from thermofast.reading import Options, read_runs, wide
from thermofast.reading import table as tables
from thermofast.reading.moments.stamps import parse_stamps
from thermofast.reading.tables import text
from thermofast.reading.tables.limits import Limits, inflated
from thermofast.reading.tables.text import read_text
from thermofast.reading.tables.workbook import _cell
from thermofast.reading.values.time_units import unit_of
from thermofast.reading.vocabulary import words
from thermofast.reading.wide import read_wide
from thermofast.reading_options import options_from

TIMES = [0.0, 1.0, 2.0, 3.0]
T1 = [18.25, 18.5, 18.75, 19.0]


def read_run(path, options=None):
    (run,) = read_runs(path, options)
    return run


def stamps_to_seconds(cells, place, time_format=None):
    return parse_stamps(cells, place, range(1, len(cells) + 1), "", time_format).seconds


def written(tmp_path, text, encoding="utf-8", name="run.csv"):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding) if isinstance(text, str) else text)
    return str(path)


DIALECTS = {
    "comma": ("time_min,T1,room\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-8"),
    "crlf": ("time_min,T1,room\r\n0,18.25,17.9\r\n1,18.5,17.9\r\n2,18.75,17.9\r\n3,19,17.9\r\n", "utf-8"),
    "cr": ("time_min,T1,room\r0,18.25,17.9\r1,18.5,17.9\r2,18.75,17.9\r3,19,17.9\r", "utf-8"),
    "german": ("Zeit [min];T1;Raum\n0;18,25;17,9\n1;18,5;17,9\n2;18,75;17,9\n3;19;17,9\n", "cp1252"),
    "tab": ("time_min\tT1\troom\n0\t18.25\t17.9\n1\t18.5\t17.9\n2\t18.75\t17.9\n3\t19\t17.9\n", "utf-8"),
    "tab with decimal comma": ("time_min\tT1\troom\n0\t18,25\t17,9\n1\t18,5\t17,9\n2\t18,75\t17,9\n3\t19\t17,9\n", "utf-8"),
    "blanks": ("time_min  T1   room\n 0  18.25  17.9\n 1  18.5   17.9\n 2  18.75  17.9\n 3  19     17.9\n", "utf-8"),
    "bom": ("\ufefftime_min,T1,room\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-8"),
    "utf-16": ("time_min,T1,room\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-16"),
    "utf-16 without bom": ("time_min,T1,room\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-16-le"),
    "utf-16 big without bom": ("time_min,T1,room\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-16-be"),
    "unit row": ("time,T1,room\nmin,°C,°C\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "cp1252"),
    "preamble": ("Logger 7\nSerial,123\n\ntime_min,T1,room\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-8"),
    "comment": ("# made in 2026\ntime_min,T1,room\n0,18.25,17.9\n1,18.5,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-8"),
    "quoted": ('"time_min","T1","room"\n"0","18.25","17.9"\n"1","18.5","17.9"\n"2","18.75","17.9"\n"3","19","17.9"\n', "utf-8"),
    "spaces": ("time_min, T1, room\n0, 18.25, 17.9\n1, 18.5, 17.9\n2, 18.75, 17.9\n3, 19, 17.9\n", "utf-8"),
    "trailing delimiter": ("time_min,T1,room,\n0,18.25,17.9,\n1,18.5,17.9,\n2,18.75,17.9,\n3,19,17.9,\n", "utf-8"),
    "hours": ("time_h,T1,room\n0,18.25,17.9\n0.016666666666667,18.5,17.9\n0.033333333333333,18.75,17.9\n0.05,19,17.9\n", "utf-8"),
    "iso stamps": (
        "timestamp,T1,room\n2026-05-03T20:38:00Z,18.25,17.9\n2026-05-03T20:39:00Z,18.5,17.9\n"
        "2026-05-03T20:40:00Z,18.75,17.9\n2026-05-03T20:41:00Z,19,17.9\n", "utf-8"),
    "german stamps": (
        "Zeitstempel;T1;Raum\n03.05.2026 20:38:00;18,25;17,9\n03.05.2026 20:39:00;18,5;17,9\n"
        "03.05.2026 20:40:00;18,75;17,9\n03.05.2026 20:41:00;19;17,9\n", "utf-8"),
    "date and clock": (
        "Date,Time,T1,room\n5/13/2026,8:38:00 PM,18.25,17.9\n5/13/2026,8:39:00 PM,18.5,17.9\n"
        "5/13/2026,8:40:00 PM,18.75,17.9\n5/13/2026,8:41:00 PM,19,17.9\n", "utf-8"),
    "over midnight": ("clock,T1,room\n23:58:30,18.25,17.9\n23:59:30,18.5,17.9\n00:00:30,18.75,17.9\n00:01:30,19,17.9\n", "utf-8"),
    "unsorted": ("time_min,T1,room\n1,18.5,17.9\n0,18.25,17.9\n3,19,17.9\n2,18.75,17.9\n", "utf-8"),
    "repeated": ("time_min,T1,room\n0,18.25,17.9\n1,18.4,17.9\n1,18.6,17.9\n2,18.75,17.9\n3,19,17.9\n", "utf-8"),
    "kelvin": ("time_min,T1 [K],room\n0,291.4,17.9\n1,291.65,17.9\n2,291.9,17.9\n3,292.15,17.9\n", "utf-8"),
    "counter": ("No,time_min,T1,room\n1,0,18.25,17.9\n2,1,18.5,17.9\n3,2,18.75,17.9\n4,3,19,17.9\n", "utf-8"),
    "words": ("time_min,T1,room,remark\n0,18.25,17.9,start\n1,18.5,17.9,ok\n2,18.75,17.9,ok\n3,19,17.9,end\n", "utf-8"),
}  # fmt: skip


@pytest.mark.parametrize("name", DIALECTS)
def test_each_dialect_gives_the_same_record(name, tmp_path):
    text, encoding = DIALECTS[name]
    run = read_run(written(tmp_path, text, encoding))
    assert run.time_s / 60 == pytest.approx(TIMES, abs=1e-9)
    assert len(run.channels) == 1
    assert next(iter(run.channels.values())) == pytest.approx(T1, abs=1e-9)
    assert next(iter(run.ambient.values())) == pytest.approx([17.9] * 4)
    assert run.notes


def test_words_for_no_reading_and_overloads_are_nan(tmp_path):
    text = "time_s,a,b,speed\n0,OL,20,1\n1,NaN,9.9E+37,1\n2,---,21,1\n3,22,-9999,1\n4,,22,1\n5,bad data,22.5,1\n"
    run = read_run(written(tmp_path, text), Options(missing=("bad data",)))
    assert np.isnan(run.channels["a"]).tolist() == [True, True, True, False, True, True]
    assert np.isnan(run.channels["b"]).tolist() == [False, True, False, True, False, False]
    assert "2 overload" in run.channel_notes["b"]
    assert list(run.inputs) == ["speed"]


def test_parquet_with_stamps_integers_and_nulls(tmp_path):
    start = datetime(2026, 5, 3, 20, 38)
    frame = pd.DataFrame(
        {
            "timestamp": [start + timedelta(minutes=i) for i in range(4)],
            "T1": T1,
            "T2": pd.array([20, None, 21, 22], dtype="Int64"),
            "flag": [True, False, True, True],
            "label": list("abcd"),
        }
    )
    path = tmp_path / "run.parquet"
    frame.to_parquet(path)
    run = read_run(str(path))
    assert run.time_s.tolist() == [0, 60, 120, 180]
    assert run.channels["T1"].tolist() == T1
    assert np.isnan(run.channels["T2"][1])


def test_the_user_has_the_last_word(tmp_path):
    path = written(tmp_path, "when,a,b,c\n0,20,1,30\n1,21,2,31\n2,22,3,32\n")
    run = read_run(path, Options(time="when", time_unit="h", ambient="c", inputs=("b",)))
    assert run.time_s.tolist() == [0, 3600, 7200]
    assert (list(run.channels), list(run.ambient), list(run.inputs)) == (["a"], ["c"], ["b"])
    assert list(read_run(path, Options(interval_s=10.0, channels=("a",))).channels) == ["a"]
    assert list(read_run(path, Options(interval_s=10.0, exclude=("a", "when"))).channels) == ["b", "c"]
    with pytest.raises(UsageError, match="no column"):
        read_run(path, Options(time="clock"))
    headless = written(tmp_path, "0;1,5\n1;2,5\n2;3,5\n", name="h.csv")
    assert read_run(headless, Options(header_line=0, time_unit="min")).channels["column 2"].tolist() == [1.5, 2.5, 3.5]
    assert read_run(headless, Options(time_unit="s")).channels["column 2"].tolist() == [1.5, 2.5, 3.5]
    named = written(tmp_path, "x\ntime_s|T\n0|1\n1|2\n", name="n.csv")
    assert read_run(named, Options(header_line=2, delimiter="|")).channels["T"].tolist() == [1, 2]


def test_duplicate_and_empty_names_are_told_apart(tmp_path):
    run = read_run(written(tmp_path, "time_s,T,T,\n0,1,2,3\n1,2,3,4\n2,3,4,5\n"))
    assert list(run.channels) == ["T", "T (2)", "column 4"]


def test_a_last_line_cut_short_is_left_out_and_told(tmp_path):
    run = read_run(written(tmp_path, "time_s,a,b\n0,1,2\n1,2,3\n2,3"))
    assert len(run.time_s) == 2
    assert any("cut short" in note for note in run.notes)


def test_ambiguous_days_are_refused_and_others_decided():
    same_day = ["03/04/2026 10:00:00", "03/04/2026 10:01:00"]
    assert stamps_to_seconds(same_day, "x").tolist() == [0, 60]
    days = ["03/04/2026", "04/04/2026", "05/04/2026"]
    with pytest.raises(InputError, match="day and month"):
        stamps_to_seconds(["01/02/2026", "02/02/2026", "02/03/2026"], "x")
    assert stamps_to_seconds(days, "x", "%d/%m/%Y").tolist() == [0, 86400, 172800]
    assert stamps_to_seconds(["13/04/2026", "14/04/2026"], "x").tolist() == [0, 86400]
    assert stamps_to_seconds(["2026-01-01 10:00:00.5", "2026-01-01 10:00:01"], "x").tolist() == [0, 0.5]
    with pytest.raises(InputError, match=r"line 3.*unreadable time"):
        stamps_to_seconds(["2026-01-01 10:00:00", "2026-01-01 25:00:00"], "x")


def test_names_tell_units_and_words():
    assert unit_of("time_min") == "min"
    assert unit_of("Zeit [h]") == "h"
    assert unit_of("t", "sec") == "s"
    assert unit_of("elapsed") is None
    assert words("CPU_Temp2") == ["cpu", "temp"]
    assert words("spindleSpeed_rpm") == ["spindle", "speed", "rpm"]


names = st.text(st.characters(whitelist_categories=("Lu", "Ll")), min_size=1, max_size=6)


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(st.lists(st.floats(-200, 900).map(lambda v: round(v, 3)), min_size=2, max_size=2), min_size=3, max_size=30),
    delimiter=st.sampled_from([",", ";", "\t", "|"]),
    comma=st.booleans(),
    newline=st.sampled_from(["\n", "\r\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    preamble=st.integers(0, 3),
)
def test_what_was_written_is_read(values, delimiter, comma, newline, encoding, preamble):
    comma = comma and delimiter != ","
    rows = [[str(float(i)), *(f"{v:.3f}" for v in row)] for i, row in enumerate(values)]
    if comma:
        rows = [[c.replace(".", ",") for c in row] for row in rows]
    lines = ["Logger of the lab"] * preamble + [delimiter.join(["time_s", "Lager", "Gehäuse"])] + [delimiter.join(r) for r in rows]
    table = read_text((newline.join(lines) + newline).encode(encoding), "x", Options())
    assert table.names == ["time_s", "Lager", "Gehäuse"]
    assert np.column_stack([table.columns["Lager"], table.columns["Gehäuse"]]) == pytest.approx(np.array(values), abs=1e-9)


@example(b"!\x0c0")
@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_give_a_record_or_an_input_error(data):
    try:
        table = read_text(data, "x", Options())
    except InputError as error:
        assert str(error).startswith("x")
    else:
        assert len(table.names) > 1


STAMPS = [f"2026-05-03 20:{38 + i}:00" for i in range(4)]
#: Records that were once read wrong without a word.
MISREAD = {
    "an unnamed column of stamps beside T1": ",T1,room\n" + "".join(f"{s},{v},17.9\n" for s, v in zip(STAMPS, T1, strict=True)),
    "an unknown name over stamps": "Zeitpunkt,T1,room\n" + "".join(f"{s},{v},17.9\n" for s, v in zip(STAMPS, T1, strict=True)),
    "time in the last column": "T1,room,time_min\n" + "".join(f"{v},17.9,{i}\n" for i, v in enumerate(T1)),
    "newest first": "time_min,T1,room\n" + "".join(f"{3 - i},{v},17.9\n" for i, v in enumerate(T1[::-1])),
    "kelvin by suffix": "time_min,T_K,room\n" + "".join(f"{i},{v + 273.15:.2f},17.9\n" for i, v in enumerate(T1)),
    "a thermocouple of type K": "time_min,T (K),room\n" + "".join(f"{i},{v},17.9\n" for i, v in enumerate(T1)),
    "fahrenheit": "time_min,T [°F],room\n" + "".join(f"{i},{v * 1.8 + 32:.2f},17.9\n" for i, v in enumerate(T1)),
    "an unknown unit in the unit row": "time;T1;room;force\nmin;°C;°C;kN\n" + "".join(f"{i};{v};17.9;3\n" for i, v in enumerate(T1)),
    "a header behind a hash": "#time_min,T1,room\n" + "".join(f"{i},{v},17.9\n" for i, v in enumerate(T1)),
    "an unnamed row counter": ",time_min,T1,room\n" + "".join(f"{i + 1},{i},{v},17.9\n" for i, v in enumerate(T1)),
    "epoch in ms": "timestamp,T1,room\n" + "".join(f"{1777000000000 + 60000 * i},{v},17.9\n" for i, v in enumerate(T1)),
    "a form feed in the preamble": "Logger\x0cpage 1\ntime_min,T1,room\n" + "".join(f"{i},{v},17.9\n" for i, v in enumerate(T1)),
    "whole numbers among decimal commas": "time_min;T1;room\n0;18,25;17,9\n1;18,5;17,9\n2;18,75;17,9\n3;19;18\n".replace(";18\n", ";17,9\n"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISREAD)
def test_what_was_once_misread(name, tmp_path):
    run = read_run(written(tmp_path, MISREAD[name]), Options(exclude=("force",) if "force" in MISREAD[name] else ()))
    assert run.time_s / 60 == pytest.approx(TIMES, abs=1e-9)
    assert len(run.channels) == 1, list(run.channels)
    assert next(iter(run.channels.values())) == pytest.approx(T1, abs=0.01)


def test_dropout_rows_do_not_decide_the_decimal_sign(tmp_path):
    rows = "".join(f"{i};{18 + i / 8:.3f};17,9\n".replace(".", ",") for i in range(40)) + "40;;\n41;29;35\n42;OL;OL\n"
    run = read_run(written(tmp_path, "time_min;T1;T2\n" + rows))
    assert run.channels["T1"][8] == 19.0
    assert run.channels["T1"][41] == 29.0


def test_numbers_that_mean_no_reading_and_interval_beside_a_time_column(tmp_path):
    path = written(tmp_path, "time_min,T1\n0,20\n1,85\n2,21\n3,22\n")
    assert np.isnan(read_run(path, Options(missing=("85",))).channels["T1"]).tolist() == [False, True, False, False]
    assert list(read_run(path, Options(interval_s=60.0)).channels) == ["T1"]
    busy = written(tmp_path, "time_min,T1,event\n0,20,\n1,21,\n2,22,door\n" + "3,23,\n" * 300, name="b.csv")
    assert list(read_run(busy, Options(exclude=("event",))).channels) == ["T1"]


def test_a_very_wide_record(tmp_path):
    columns = 30_000
    text = "time_s," + ",".join(f"c{i}" for i in range(columns)) + "\n"
    text += "".join(f"{k}," + ",".join([f"{20 + k}.25"] * columns) + "\n" for k in range(3))
    run = read_run(written(tmp_path, text))
    assert len(run.channels) == columns
    assert run.channels["c29999"].tolist() == [20.25, 21.25, 22.25]


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_wide_tables_of_numbers_are_read_as_narrow_ones(delimiter, ending, monkeypatch):
    rng = np.random.default_rng(5)
    rows = [[k, *(np.float64(v).item() for v in 20 + rng.normal(size=249) * 10.0 ** rng.integers(-9, 9, 249))] for k in range(70)]
    lines = [delimiter.join(["time_s", *(f"c{i}" for i in range(249))]), *(delimiter.join(map(repr, row)) for row in rows)]
    lines[1:1] = [""] * 40
    text = (ending.join(lines) + ending).encode()
    wide = read_text(text, "wide.csv", Options(missing=(repr(rows[3][7]),)))
    assert wide.columns["time_s"].base.shape[1] == 250  # in one block
    monkeypatch.setattr(tables, "WIDE", 10_000)
    narrow = read_text(text, "wide.csv", Options(missing=(repr(rows[3][7]),)))
    assert list(wide.columns) == list(narrow.columns)
    assert np.isnan(wide.columns["c6"][3])
    assert list(wide.lines) == list(narrow.lines) == list(range(41, 111))
    for n, column in narrow.columns.items():
        assert np.array_equal(wide.columns[n], column, equal_nan=True)


@pytest.mark.parametrize("cell", ["", "-", "1e", "1.5.2", "1+2", "x"])
def test_wide_tables_with_another_cell_name_it_by_its_row(cell):
    text = "time_s," + ",".join(f"c{i}" for i in range(250)) + "\n"
    text += "".join(f"{k}," + ",".join([cell if (k, i) == (50, 249) else "20.25" for i in range(250)]) + "\n" for k in range(60))
    table = read_text(text.encode(), "wide.csv", Options())
    assert np.isnan(table.columns["c249"][50])
    assert np.nansum(table.columns["c249"]) == 59 * 20.25
    assert ("c249" in table.faults) == (cell not in ("", "-"))
    assert all("line 52, " in fault.what for fault in table.faults.values())


def test_a_large_file_in_pieces_is_read_as_a_small_one(monkeypatch):
    rng = np.random.default_rng(7)
    rows = [
        f"2026-03-01 08:{k // 60:02d}:{k % 60:02d};" + ";".join(f"{v:.3f}" for v in 20 + rng.normal(size=6)) for k in range(2000)
    ]
    for k, column in ((5, 2), (900, 2), (1500, 4)):
        rows[k] = ";".join("OL" if i == column else c for i, c in enumerate(rows[k].split(";")))
    lines = ["time;" + ";".join(f"T{i}" for i in range(1, 7)), *rows]
    data = "\n".join(lines).replace(".", ",").encode()
    small = read_text(data, "run.csv", Options())
    monkeypatch.setattr(text, "LARGE", 1000)
    monkeypatch.setattr(text, "PIECE", 4000)
    large = read_text(data, "run.csv", Options())
    assert np.flatnonzero(np.isnan(small.columns["T2"])).tolist() == [5, 900]
    assert np.isnan(small.columns["T4"][1500])
    assert not small.faults
    assert not large.faults
    for n, column in small.columns.items():
        assert np.array_equal(column, large.columns[n], equal_nan=n != "time")
    lines[1800] = "7;8"
    with pytest.raises(InputError, match="line 1801: the row has 2 cells, the others 7"):
        read_text("\n".join(lines).replace(".", ",").encode(), "run.csv", Options())


def test_a_wide_table_with_rows_of_one_cell_is_refused():
    text = (
        ",".join(f"c{i}" for i in range(250))
        + "\n"
        + (",".join(["1"] * 250) + "\n") * 32
        + "7\n" * 32
        + ",".join(["1"] * 250)
        + "\n"
    )
    with pytest.raises(InputError, match=r"line 34: the row has 1 cells, the others 250"):
        read_text(text.encode(), "wide.csv", Options())


@pytest.mark.parametrize(
    ("time_format", "cells", "seconds"),
    [
        ("%M:%S", ["58:30", "59:30", "60:30", "61:31"], [0.0, 60.0, 120.0, 181.0]),
        ("%H:%M", ["22:59", "23:59", "00:59", "02:00"], [0.0, 3600.0, 7200.0, 10860.0]),
        ("%H:%M:%S", ["23:59:58", "00:00:01", "01:01:03"], [0.0, 3.0, 3665.0]),
        ("%H:%M:%S", ["25:00:00", "26:01:01"], [0.0, 3661.0]),
    ],
)
def test_clocks_in_the_users_own_format(time_format, cells, seconds):
    assert stamps_to_seconds(cells, "run.csv", time_format) == pytest.approx(seconds)


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_a_member_is_unpacked_from_where_its_own_head_ends(method):
    """Names and extra fields of any length stand between a member's head and its bytes."""
    packed, text = io.BytesIO(), b"time_min,T1\n" + b"".join(b"%d,%d\n" % (i, i * i) for i in range(500))
    with zipfile.ZipFile(packed, "w", method) as archive:
        for name in ("a", "a much longer name.csv"):
            member = zipfile.ZipInfo(name)
            member.compress_type, member.extra = method, b"\x99\x99\x04\x00abcd"
            archive.writestr(member, text)
    with zipfile.ZipFile(packed) as archive:
        for member in archive.infolist():
            assert b"".join(inflated(packed.getvalue(), member, "run.zip", Limits())) == text


@pytest.mark.parametrize("name", ["T1_F", "T1F", "T1 F", "bearing_F", "temp_f", "TF1"])
def test_an_f_behind_a_column_that_begins_at_a_room_in_degf_is_its_unit_and_a_guess(name):
    time = np.arange(0.0, 60.0)
    warm = 20.0 + 15.0 * -np.expm1(-time / 60.0)
    (run,) = read_runs(pd.DataFrame({"time_min": time, name: 1.8 * warm + 32.0}))
    assert next(iter(run.channels.values())) == pytest.approx(warm)
    assert any("read as degF, by the letter behind the name" in g.text for g in run.guesses)
    beside = {"T1_F": "T1_R", "bearing_F": "bearing_R"}.get(name)
    if beside:  # front and rear
        (run,) = read_runs(pd.DataFrame({"time_min": time, name: 40.0 + warm, beside: 40.0 + warm}))
        assert next(iter(run.channels.values())) == pytest.approx(40.0 + warm)


def test_a_column_without_unit_that_begins_where_a_room_would_be_in_degf_is_told():
    (run,) = read_runs(pd.DataFrame({"time_min": np.arange(60.0), "T1": 68.0 + np.arange(60.0) / 10.0}))
    assert any("no unit, taken for degC: T1 begins at 68" in g.text for g in run.guesses)


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["12:00:00.5", "12:00:01.25", "12:00:03"], [0.0, 0.75, 2.5]),
        (["05:32.5", "05:33.0", "05:34.25"], [0.0, 0.5, 1.75]),
        (["2026-03-01 115959.75", "2026-03-01 120000.25", "2026-03-01 120001.00"], [0.0, 0.5, 1.25]),
        (["20:38:07,250", "20:38:07,750", "20:38:09,000"], [0.0, 0.5, 1.75]),
    ],
)
def test_fractions_of_seconds_wherever_they_stand(cells, seconds):
    assert stamps_to_seconds(cells, "run.csv") == pytest.approx(seconds, abs=1e-6)


def test_moments_written_as_one_number():
    start = datetime(2026, 5, 3, 20, 38, 7)
    cells = [int((start + timedelta(seconds=90 * k)).strftime("%Y%m%d%H%M%S")) for k in range(5)]
    (run,) = read_runs(pd.DataFrame({"time": cells, "T1 [degC]": np.arange(5.0) + 20.0}))
    assert run.time_s == pytest.approx(90.0 * np.arange(5))


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        (timedelta(seconds=3661.5), "1:01:01.500"),
        (timedelta(seconds=-59.25), "-0:00:59.250"),
        (timedelta(hours=100), "100:00:00.000"),
        (datetime(2026, 3, 1, 8, 0, 5), "2026-03-01 08:00:05"),
        (20.1, "20.1"),
        (3.0, "3"),
        (None, ""),
    ],
)
def test_cells_of_a_workbook_as_a_logger_would_write_them(cell, text):
    assert _cell(cell) == text


def test_a_last_line_that_is_cut_short_is_named_by_its_line():
    text = b"time_min,T1,T2\n" + b"".join(b"%d,20.%d,21.%d\n" % (i, i, i) for i in range(9)) + b"9,20.9\n"
    table = read_text(text, "run.csv", Options())
    assert any("the last line (11) is cut short and was left out" in note for note in table.notes)
    with pytest.raises(InputError, match="line 5"):
        read_text(text.replace(b"3,20.3,21.3", b"3,20.3"), "run.csv", Options())


@pytest.mark.parametrize(("encoding", "minus"), [("cp1252", "-"), ("utf-8", "-"), ("utf-8", "\N{MINUS SIGN}")])
def test_what_stands_far_down_a_long_file_is_read_as_at_its_beginning(encoding, minus):
    """Its encoding and its signs are told by all of it, although most of a file is looked at for single bytes only."""
    rows = [f"{k};{18.0 + 0.001 * k:.3f};ok" for k in range(9000)]
    rows[8000] = f"8000;{minus}5.125;Kühlung an"
    table = read_text(("time_min;T1;Bemerkung\n" + "\n".join(rows) + "\n").encode(encoding), "run.csv", Options())
    assert table.dialect.encoding == encoding
    assert table.columns["T1"][8000] == -5.125
    assert table.columns["Bemerkung"][8000] == "Kühlung an"


@pytest.mark.parametrize(
    ("rows", "where", "odd"),
    [
        ([f"{60 * k:,d};{20.25 + k:.2f};{19.5 + k:.2f}" for k in range(40)], "time_s", "'1,020', where '.'"),
        ([f"{60 * k}.0;{20 + k},25;{19 + k},50" for k in range(40)], "time_s", "'0.0', where ','"),
    ],
)
def test_a_second_decimal_sign_is_told_as_one(rows, where, odd, tmp_path):
    path = written(tmp_path, "time_s;T1;T2\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match=f"column '{where}': numbers written in another way") as refused:
        read_run(path)
    assert odd in str(refused.value)


def test_marks_of_readings_are_never_the_readings_of_a_long_table(tmp_path):
    """Where the values cannot be read, the column of their validity, a number in each row, was taken in their place."""
    rows = [f'"{n}";"{k // 60:02d}:{k % 60:02d}:00";{20 + k / 8:.3f};{k % 7 > 0:d}' for k in range(90) for n in ("T_a", "T_b")]
    text = '"VarName";"TimeString";"VarValue";"Validity"\n' + "\n".join(rows) + "\n"
    assert list(read_run(written(tmp_path, text)).channels) == ["T_a", "T_b"]
    path = written(tmp_path, re.sub(r";(\d)\n", r";\1.5\n", re.sub(r"(\d)\.(\d{3})", r"\1,\2", text)))
    with pytest.raises(InputError, match="column 'VarValue'"):
        read_run(path, Options(decimal="."))


def rising(count=40):
    return [(60.0 * k, 20.0 + 0.25 * k, 21.0 + 0.125 * k) for k in range(count)]


@pytest.mark.parametrize(
    ("head", "line", "seconds"),
    [
        ("Time (100ms)", lambda t: f"{10 * t:g}", 60.0),
        ("Time [x10 s]", lambda t: f"{t / 10:g}", 60.0),
        ("Time (min.sec)", lambda t: f"{t // 60:.0f}.{t % 60:02.0f}", 60.0),
        ("Time (hh.mm)", lambda t: f"{t // 3600:.0f}.{t % 3600 // 60:02.0f}", 60.0),
        ("Time (s)", lambda t: f"{t:g}", 60.0),
    ],
)
def test_clocks_that_count_steps_or_minutes_and_seconds(head, line, seconds, tmp_path):
    rows = [f"{line(t)},{a:.3f}" for t, a, _ in rising()]
    run = read_run(written(tmp_path, f"{head},Front (°C)\n" + "\n".join(rows) + "\n"))
    assert np.allclose(np.diff(run.time_s), seconds)
    assert bool(run.guesses) == (head != "Time (s)")


def test_readings_that_a_mark_beside_them_calls_bad_are_none(tmp_path):
    marked = [
        f"{t:g},{a:.3f},GOOD,{0.0 if k in (5, 6) else b:.3f},{'BAD' if k in (5, 6) else 'GOOD'}"
        for k, (t, a, b) in enumerate(rising())
    ]
    run = read_run(written(tmp_path, "time_s,T1 [°C],T1 Quality,T2 [°C],T2 Quality\n" + "\n".join(marked) + "\n"))
    assert np.isfinite(run.channels["T1 [°C]"]).all()
    assert np.flatnonzero(np.isnan(run.channels["T2 [°C]"])).tolist() == [5, 6]
    assert any("'T2 Quality' marks as bad" in note for note in run.notes)


def test_an_archive_of_siemens_keeps_its_fractions_of_a_second_and_its_validity(tmp_path):
    rows = []
    for k, (_, a, b) in enumerate(rising()):
        moment = 45356354166.6667 + 0.25 * k / 0.0864
        for name, value, valid in (("Front", a, 1), ("Rear", 0.0 if k == 7 else b, int(k != 7))):
            stamp = f"05.03.2024 08:30:{k // 4:02d}"
            rows.append(
                f'"{name}";"{stamp}";{value:.4f};{valid};{moment:.4f}'.replace(".", ",").replace("05,03,2024", "05.03.2024")
            )
    text = '"VarName";"TimeString";"VarValue";"Validity";"Time_ms"\n' + "\n".join(rows) + "\n"
    run = read_run(written(tmp_path, text))
    assert np.allclose(np.diff(run.time_s), 0.25, atol=2e-3)
    assert np.flatnonzero(np.isnan(run.channels["Rear"])).tolist() == [7]
    assert run.channels["Front"][:2].tolist() == [20.0, 20.25]


@pytest.mark.parametrize("stamped", [False, True])
def test_readings_with_clocks_of_their_own_are_not_put_on_one(stamped, tmp_path):
    def told(t):
        return f"2024-03-05 08:{int(t) // 60:02d}:{int(t) % 60:02d}" if stamped else f"{t:g}"

    heads = ("Time Front", "Time Rear") if stamped else ("Time A (s)", "Time B (s)")
    for factor in (1.0, 0.5):
        rows = [f"{told(t)},{a:.3f},{told(factor * t)},{b:.3f}" for t, a, b in rising()]
        path = written(tmp_path, f"{heads[0]},Front (°C),{heads[1]},Rear (°C)\n" + "\n".join(rows) + "\n")
        run = read_run(path)  # a clock that is named after its column, or stands before it, is that column's
        rear = run.channels["Rear (°C)"]
        assert list(run.channels) == ["Front (°C)", "Rear (°C)"]
        assert run.time_s[np.isfinite(rear)].tolist() == [factor * t for t, *_ in rising()]
        assert rear[np.isfinite(rear)].tolist() == [b for *_, b in rising()]


def test_marks_mask_the_readings_that_they_name_and_no_others(tmp_path):
    rows = [f"{t:g},{a:.3f},{b:.3f},{'BAD' if k == 3 else 'GOOD'}" for k, (t, a, b) in enumerate(rising())]
    run = read_run(written(tmp_path, "time_s,T [°C],Table [°C],T Quality\n" + "\n".join(rows) + "\n"))
    assert [int(np.isnan(v).sum()) for v in run.channels.values()] == [1, 0]


@pytest.mark.parametrize("own", [lambda k: 60.0 * k + 7.0, lambda k: float(k)])
def test_a_clock_some_seconds_late_or_in_minutes_is_no_other(own, tmp_path):
    rows = [f"{t:g},{a:.3f},{own(k):g},{b:.3f}" for k, (t, a, b) in enumerate(rising())]
    run = read_run(written(tmp_path, "Time A (s),Front (°C),Time B,Rear (°C)\n" + "\n".join(rows) + "\n"))
    assert list(run.channels) == ["Front (°C)", "Rear (°C)"]
    uneven = [f"{t:g},{a:.3f},{39 * 60.0 * (k / 39) ** 2:.1f},{b:.3f}" for k, (t, a, b) in enumerate(rising())]
    with pytest.raises(InputError, match="two clocks"):
        read_run(written(tmp_path, "Time upper (s),Front (°C),Time lower (s),Rear (°C)\n" + "\n".join(uneven) + "\n"))


def test_a_unit_that_changes_within_a_record_is_refused(tmp_path):
    rows = [f"{t:g},{a:.3f},{'F' if t < 1200 else 'C'}" for t, a, _ in rising()]
    with pytest.raises(InputError, match="the unit changes within the record"):
        read_run(written(tmp_path, "time_s,Value,Unit\n" + "\n".join(rows) + "\n"))


@pytest.mark.parametrize(
    "head",
    [
        ",,,CH,0001,0002\n,,,Tag,Front,Rear\nDate,Time,sec,Unit,degC,degC\n",
        '"CH","","","","0001","0002"\n"Tag","","","","Front","Rear"\n"Unit","","","","C","C"\n"Date","Time","sec","","",""\n',
    ],
)
def test_columns_that_are_named_in_the_line_of_units(head, tmp_path):
    """Yokogawa: a pause of two days was lost with the column of dates."""
    rows = [f"2024/03/0{5 + 2 * (k // 20)},08:{k:02d}:00,.500,,{a:.2f},{b:.2f}" for k, (_, a, b) in enumerate(rising())]
    run = read_run(written(tmp_path, head + "\n".join(rows) + "\n"))
    assert list(run.channels) == ["Front", "Rear"]
    assert run.time_s[-1] == 2 * 86400.0 + 39 * 60.0


def test_a_footer_whose_first_cell_is_empty_is_left_out(tmp_path):
    rows = [
        f"{k};05.03.2024 08:{k:02d}:00;{a:.1f};{b:.1f}".replace(".", ",").replace("05,03,2024", "05.03.2024")
        for k, (_, a, b) in enumerate(rising())
    ]
    text = (
        "Id;Datum Zeit;Kanal 1 [°C];Kanal 2 [°C]\n"
        + "\n".join(rows)
        + "\n\n;Min:;20,0;21,0\n;Max:;29,8;25,9\n;Mittelwert:;24,9;23,4\n"
    )
    run = read_run(written(tmp_path, text))
    assert len(run.time_s) == 40
    assert any("3 lines below the readings left out (Min:, Max:, Mittelwert:)" in note for note in run.notes)


@settings(max_examples=40, deadline=None)
@given(
    remarks=st.dictionaries(st.integers(0, 59), st.text('ab ,;"\n\t', max_size=12), max_size=4),
    delimiter=st.sampled_from(";,"),
    ending=st.sampled_from(["\n", "\r\n"]),
)
def test_remarks_with_line_breaks_and_quotes_cost_no_row(tmp_path_factory, remarks, delimiter, ending):
    """Written as the csv module does, a cell may hold anything; the rows below a quote were swallowed to the next one."""
    path = tmp_path_factory.mktemp("quoted") / "run.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, delimiter=delimiter, lineterminator=ending)
        writer.writerow(["time\n[min]", "front", "rear", "remark"])
        for i in range(60):
            writer.writerow([i, f"{20 + i / 8:.3f}", f"{30 - i / 8:.3f}", remarks.get(i, "")])
    run = read_run(str(path))
    np.testing.assert_array_equal(run.time_s, 60.0 * np.arange(60))
    np.testing.assert_array_equal(run.channels["front"], 20 + np.arange(60) / 8)
    np.testing.assert_array_equal(run.channels["rear"], 30 - np.arange(60) / 8)


def test_a_quote_that_nothing_closes_is_left_out_and_said_to_be(tmp_path):
    remarks = {20: '2" pipe'}
    rows = [f"{i};{20 + i / 8:.3f};{remarks.get(i, '')}" for i in range(60)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["time [min];front;remark", *rows]))
    run = read_run(str(path))
    assert len(run.time_s) == 60
    assert "unbalanced quotes removed (line 22)" in "; ".join(run.notes)


@pytest.fixture
def large(monkeypatch):
    """What is read a few lines at a time begins with half a megabyte."""
    monkeypatch.setattr(wide, "LARGE", 1 << 19)


def wide_file(tmp_path, change=lambda lines: lines, ending="\n", last=True):
    """A file of 0.6 MB of 300 columns of numbers, with a change to its lines."""
    rng = np.random.default_rng(6)
    rows = [[f"{60 * k}", *(f"{20 - 5 * np.expm1(-k / 900) + e:.3f}" for e in rng.normal(0, 0.02, 299))] for k in range(400)]
    lines = [",".join(["time_s", *(f"T{i + 1} [°C]" for i in range(299))]), *map(",".join, rows)]
    path = tmp_path / "wide.csv"
    path.write_bytes((ending.join(change(lines)) + (ending if last else "")).encode())
    assert path.stat().st_size > wide.LARGE
    return path


def exchanged(at, text):
    return lambda lines: [*lines[:at], text(lines[at]), *lines[at + 1 :]]


@pytest.mark.parametrize("options", [{}, {"missing": "20.0"}, {"channels": "T1 [°C], T7 [°C]"}], ids=str)
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("last", [True, False])
def test_a_large_wide_file_is_read_in_a_few_lines_at_a_time_as_it_is_whole(tmp_path, options, ending, last, large):
    path = wide_file(tmp_path, ending=ending, last=last)
    assert read_wide(path, "wide.csv", options_from(dict(options)), Limits()) is not None
    parts = tf.read(str(path), **options)
    whole = read_runs(str(path), options_from(dict(options)), data=path.read_bytes())[0]
    assert (parts.notes, parts.guesses, parts.seen) == (whole.notes, whole.guesses, whole.seen)
    for group in ("channels", "ambient", "inputs"):
        assert list(getattr(parts, group)) == list(getattr(whole, group))
        for name, column in getattr(whole, group).items():
            np.testing.assert_array_equal(getattr(parts, group)[name], column)


OTHERWISE = {
    "a word": exchanged(300, lambda line: line.replace(",", ",OL,", 1)),
    "an empty line": exchanged(300, lambda line: "\n" + line),
    "a short row": exchanged(300, lambda line: line.rpartition(",")[0]),
    "an empty cell": exchanged(300, lambda line: "".join([*line.rpartition(",")[:2]])),
    "a footer": lambda lines: [*lines, "Mean" + ",20" * 299],
    "a comment": exchanged(250, lambda line: "# changed the belt"),
}


@pytest.mark.parametrize("what", OTHERWISE)
def test_what_is_not_plain_in_a_large_wide_file_is_told_as_in_any_other(tmp_path, what, large):
    path = wide_file(tmp_path, OTHERWISE[what])
    assert read_wide(path, "wide.csv", Options(), Limits()) is None
    found = [
        f"{type(e).__name__}: {e}" if (e := _error(lambda d=d: read_runs(str(path), data=d))) else "read"
        for d in (None, path.read_bytes())
    ]
    assert found[0] == found[1]


def test_a_last_line_of_a_large_wide_file_that_stops_in_mid_number_is_left_out(tmp_path, large):
    path = wide_file(tmp_path, lambda lines: [*lines[:-1], lines[-1][:-2]], last=False)
    run = tf.read(str(path))
    assert len(run.time_s) == 399
    assert any("stops in mid-number" in note for note in run.notes)


def _error(call):
    try:
        call()
    except tf.ThermofastError as error:
        return error
    return None


def test_limits_hold_for_a_large_wide_file(tmp_path, large):
    path = str(wide_file(tmp_path))
    with pytest.raises(InputError, match="400 rows"):
        tf.read(path, max_rows=100)
    with pytest.raises(InputError, match="bytes"):
        tf.read(path, max_bytes=1 << 18)


def test_a_header_may_stand_below_the_lines_that_are_looked_at(tmp_path):
    """As far down as it is said to; without a word, what is looked at is told."""
    path = tmp_path / "deep.csv"
    rows = "".join(f"{k},{20 + k}.5\n" for k in range(8))
    path.write_text("".join(f"# {'x' * 8}: remark {k}\n" for k in range(450)) + "time_min,T1\n" + rows)
    run = read_run(path, Options(header_line=451, delimiter=","))
    assert run.channels["T1"].tolist() == [20.5 + k for k in range(8)]
    with pytest.raises(InputError, match="the first 400 lines are looked at, and those below the line named"):
        read_run(path)


def test_a_link_to_nothing_is_told_as_one(tmp_path):
    """The folder lists it, so that "no such file" alone would be a riddle."""
    link = tmp_path / "run.csv"
    link.symlink_to("gone.csv")
    with pytest.raises(InputError, match="no such file") as told:
        read_run(link)
    assert told.value.found == "a link to gone.csv, which is not there"
