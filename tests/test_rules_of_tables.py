"""Rules by which tables and clocks are read, to either side of each: parts of moments, order of rows, bytes, cells, names."""

import codecs
import io
import lzma
import zipfile
from datetime import datetime

import numpy as np
import pytest

from thermofast.errors import InputError
from thermofast.reading.headings.names import names_and_units
from thermofast.reading.moments import order
from thermofast.reading.moments.parts import clock_written_as_number, days_of_year, moments_in_parts
from thermofast.reading.signs import names_a_set_point, names_the_room_alone, sign_of
from thermofast.reading.table import Table
from thermofast.reading.tables import encoding
from thermofast.reading.tables.dialect import Dialect, header_cells, is_missing, is_number, split, to_number
from thermofast.reading.tables.packed import is_workbook, unpacked


def _table(**columns):
    columns = {k: v if isinstance(v[0], str) else np.asarray(v, dtype=float) for k, v in columns.items()}
    return Table("run.csv", list(columns), columns, {}, range(1, 1 + len(next(iter(columns.values())))), ())


def _seconds(found):
    return None if found is None else found[0].seconds.tolist()


def test_two_parts_of_a_clock_at_least_go_on_together():
    """Minute and second, or hour and minute; where the smaller falls back the larger changes, and nowhere else."""
    assert _seconds(moments_in_parts(_table(Minute=[0, 0, 1, 1], Second=[0, 30, 0, 30]))) == [0.0, 30.0, 60.0, 90.0]
    assert _seconds(moments_in_parts(_table(Hour=[30, 30, 31, 31], Minute=[0, 30, 0, 30]))) == [0.0, 1800.0, 3600.0, 5400.0]
    assert _seconds(moments_in_parts(_table(Minute=[0, 1, 2], Second=[5, 5, 5]))) == [0.0, 60.0, 120.0]
    for wrong in (
        {"Hour": [0, 0, 1, 1]},
        {"Hour": [0, 0, 0], "Second": [0, 30, 59]},
        {"Minute": [0, 1, 2, 3], "Second": [0, 20, 40, 59]},
        {"Minute": [0, 0, 0, 0], "Second": [0, 30, 0, 30]},
        {"Minute": [0, 0.5, 1, 1], "Second": [0, 30, 0, 30]},
        {"Minute": [58, 59, 60, 60], "Second": [0, 0, 0, 30]},
        {"Minute": [0, 0, 1, 1], "Second": [0, 61, 0, 30]},
    ):
        assert moments_in_parts(_table(**wrong)) is None
    assert _seconds(moments_in_parts(_table(Minute=[0, 0, 1, 1], Second=[0, 59.5, 0, 60]))) == [0.0, 59.5, 60.0, 120.0]


def test_parts_of_a_date_stand_beside_the_clock():
    """Years of two digits are of this century; a column of dates in words tells them too."""
    clock = {"Hour": [23, 23, 0], "Minute": [58, 59, 0]}
    day = datetime(2024, 2, 29).toordinal() - datetime(1970, 1, 1).toordinal()
    for year in (2024, 24):
        stamps, used = moments_in_parts(_table(Year=[year] * 3, Month=[2, 2, 3], Day=[29, 29, 1], **clock, T=[1, 2, 3]))
        assert stamps.seconds.tolist() == [0.0, 60.0, 120.0]
        assert stamps.starts == (86400.0 * day + 23 * 3600.0 + 58 * 60.0,)
        assert used == {"Year", "Month", "Day", "Hour", "Minute"}
    stamps, used = moments_in_parts(_table(When=["2024-02-29", "2024-02-29", "2024-03-01"], **clock))
    assert stamps.seconds.tolist() == [0.0, 60.0, 120.0]
    assert used == {"When", "Hour", "Minute"}
    assert moments_in_parts(_table(**clock))[1] == {"Hour", "Minute"}


def test_a_day_of_the_year_and_a_clock_without_signs_are_moments():
    """The 60th of a leap year is the 29th of February; up to the 366th, and to 2400."""
    found = days_of_year(_table(Year=[2024, 2024], DOY=[60, 60], HHMM=[1305, 1306]))
    day = datetime(2024, 2, 29).toordinal() - datetime(1970, 1, 1).toordinal()
    assert found[0].starts == (86400.0 * day + 13 * 3600.0 + 5 * 60.0,)
    assert found[0].seconds.tolist() == [0.0, 60.0]
    assert found[1] == {"Year", "DOY", "HHMM"}
    assert days_of_year(_table(Year=[2024, 2025], Day=[366, 1], Time=[2400, 1]))[0].seconds.tolist() == [0.0, 60.0]
    good = {"Year": [2024, 2024], "DOY": [1, 1], "HHMM": [0, 1]}
    for wrong in (
        {"Year": [1989, 1989]}, {"Year": [2101, 2101]}, {"DOY": [0, 0]}, {"DOY": [367, 367]}, {"DOY": [1.5, 1.5]},
        {"HHMM": [-1, 1]}, {"HHMM": [1, 2401]}, {"HHMM": [0, 60]}, {"HHMM": [2, 1]}, {"HHMM": ["0", "1"]},
    ):  # fmt: skip
        assert days_of_year(_table(**(good | wrong))) is None
    assert days_of_year(_table(DOY=[1, 1], HHMM=[0, 1])) is None
    for edge in ({"Year": [1990, 1990]}, {"Year": [2100, 2100]}, {"DOY": [366, 366]}, {"HHMM": [0, 59]}):
        assert days_of_year(_table(**(good | edge))) is not None


def test_numbers_that_jump_at_every_minute_are_a_clock():
    """080530 is 08:05:30; past midnight it goes on. Every hundred of them from the beginning is a count."""

    def read(*numbers, in_seconds=False):
        found = clock_written_as_number(np.array(numbers, dtype=float), "column Time", in_seconds)
        return None if found is None else found.tolist()

    assert read(80530, 80600, 80630, 80700) == [0.0, 30.0, 60.0, 90.0]
    assert read(80530, 80600, 80630, 80700, in_seconds=True) == [0.0, 30.0, 60.0, 90.0]
    assert read(235930, 0, 30, 100) == [0.0, 30.0, 60.0, 90.0]
    assert read(80530, 80600, 80630) is None
    assert read(80530, 80600, 80630, 80670) is None
    assert read(80530, 80600, 86030, 86100) is None
    assert read(239830, 240000, 240030, 240100) is None
    assert read(80530.5, 80600, 80630, 80700) is None
    assert read(0, 100, 200, 300) is None
    assert read(80700, 80630, 80600, 80530) is None
    for numbers, form in (((100000, 100100, 100200, 100300), "%H%M%S"), ((1258, 1259, 1300, 1301), "%H%M")):
        with pytest.raises(InputError, match="may be a clock") as told:
            read(*numbers)
        assert told.value.do.startswith(f"say --time-format {form}")
        assert read(*numbers, in_seconds=True) is None


def test_rows_stand_newest_first_where_nine_in_ten_go_back():
    """And time goes at all."""
    assert order.newest_first(np.r_[np.arange(20.0, 0.0, -1.0), 1.5])
    assert not order.newest_first(np.r_[np.arange(18.0, 0.0, -1.0), 2.0, 3.0, 4.0])
    assert not order.newest_first(np.array([2.0, 1.0]))
    assert order.newest_first(np.array([3.0, 2.0, 1.0]))
    assert not order.newest_first(np.zeros(5))


def test_a_second_run_overlaps_the_first_in_three_rows_of_five():
    """Fewer are rows out of place."""
    five = np.arange(5.0)
    assert order.restarts(np.r_[five, five]) == [5]
    assert order.restarts(np.r_[five, five, five]) == [5, 10]
    assert order.restarts(np.r_[five, five[:4]]) == []
    assert order.restarts(np.r_[five[:4], five]) == []
    assert order.restarts(np.r_[five, five + 2.0]) == [5]
    assert order.restarts(np.r_[five, five + 2.5]) == []
    assert order.restarts(np.arange(9.0)) == []
    assert order.restarts(np.r_[five, five - 3.0]) == []
    assert order.restarts(np.r_[five, five - 2.0]) == [5]


def test_stretches_that_lie_before_the_one_above_are_runs():
    """Of five rows each at least."""
    assert order.earlier_stretches(np.r_[np.arange(20.0, 25.0), np.arange(10.0, 15.0), np.arange(5.0)]) == [5, 10]
    assert order.earlier_stretches(np.r_[np.arange(20.0, 25.0), np.arange(16.0, 21.0)]) == [5]
    assert order.earlier_stretches(np.r_[np.arange(20.0, 25.0), np.arange(16.5, 21.0)]) == []
    assert order.earlier_stretches(np.r_[np.arange(20.0, 24.0), np.arange(5.0)]) == []
    assert order.earlier_stretches(np.arange(9.0)) == []


def test_a_clock_of_twelve_hours_is_told_by_its_midnight():
    """From 11:59 a day too far at 12:00, back by half a day an hour later."""
    true = 60.0 * np.arange(0.0, 180.0)
    written = true.copy()
    written[60:120] += 86400.0
    written[120:] += 43200.0
    found, guess = order.half_days(written)
    assert found == pytest.approx(true)
    assert "twelve hours" in guess.text
    for wrong in (
        np.r_[true[:60], true[60:] + 86400.0],
        np.r_[true[:60], true[60:] - 43200.0],
        np.r_[written[:60], written[60:] + 300.0],
    ):
        assert order.half_days(wrong)[1] is None
    assert order.half_days(true)[1] is None


def _walk(n):
    return {"T": 20.0 + 0.1 * np.arange(float(n))}


def test_a_clock_that_was_set_back_while_readings_went_on_is_set_again():
    """By an hour at most, four times, with four usual steps about it."""
    for back in (90.0, 3590.0):
        time = 10.0 * np.arange(30.0)
        time[12:] -= back
        found, guess = order.set_back(time, _walk(30))
        assert found == pytest.approx(10.0 * np.arange(30.0))
        assert f"{back:g} s" in guess.text
    time = 10.0 * np.arange(30.0)
    time[12:] -= 3620.0
    assert order.set_back(time, _walk(30))[1] is None
    time[12:] += 3530.0
    cold = _walk(30)
    cold["T"][12:] -= 2.0
    assert order.set_back(time, cold)[1] is None
    near = time.copy()
    near[15:] += 6.0
    assert order.set_back(near, _walk(30))[1] is None
    late = time.copy()
    late[18:] += 6.0
    assert order.set_back(late, _walk(30))[1] is not None
    many = 10.0 * np.arange(60.0) - 90.0 * (np.arange(60) // 12)
    assert order.set_back(many, _walk(60))[1] is not None
    assert order.set_back(many - 90.0 * (np.arange(60) > 53), _walk(60))[1] is None


@pytest.mark.parametrize("full", [3600.0, 43200.0, 86400.0, 2**32 / 1e3, 2**16 / 1e3])
def test_a_full_counter_goes_on(full):
    """Where it falls back by all of it but a usual step."""
    true = 0.01 * full * np.arange(250.0)
    found, guess = order.unwrapped(true % full)
    assert found == pytest.approx(true)
    assert "2 times: full" in guess.text
    assert order.unwrapped(np.r_[true[:100], true[:100] + 0.04 * full])[1] is None
    assert order.unwrapped(true[:90])[1] is None
    coarse = 0.11 * full * np.arange(25.0)
    assert order.unwrapped(coarse % full)[1] is None or full != 2**16 / 1e3


SUNDAY = (datetime(2024, 10, 27) - datetime(1970, 1, 1)).total_seconds()


def test_an_hour_is_taken_out_on_a_sunday_night_alone_when_it_was_put_forward():
    """A gap of an hour on another day is a gap; an hour set back is one on any day."""
    step = 600.0
    time = step * np.arange(40.0)
    back, forward = time - 3600.0 * (time > 10000.0), time + 3600.0 * (time > 10000.0)
    for start, taken in ((SUNDAY, True), (SUNDAY + 86400.0, False), (SUNDAY + 3.0 * 3600.0, False)):
        found, guess = order.clock_change(forward, (start,))
        assert (guess is not None and "put forward" in guess.text) == taken
        assert found == pytest.approx(time if taken else forward)
        found, guess = order.clock_change(back, (start,))
        assert "set back" in guess.text
        assert found == pytest.approx(time)
    assert order.clock_change(forward[:8], (SUNDAY,))[1] is None


def test_a_gap_across_the_hour_that_no_clock_tells_is_told():
    """From before two to after three on a Sunday in March or April."""
    march = (datetime(2024, 3, 31) - datetime(1970, 1, 1)).total_seconds()
    time = np.r_[600.0 * np.arange(10.0), 600.0 * np.arange(10.0) + 4.0 * 3600.0]
    assert "a gap from 2024-03-31 01:30 to 04:00" in order.clock_change(time, (march,))[1].text
    for start in (march + 86400.0, SUNDAY, march + 2.0 * 3600.0, march - 2.0 * 3600.0):
        assert order.clock_change(time, (start,))[1] is None


def test_a_calendar_that_jumps_by_years_once_is_refused():
    """Two such jumps are no clock that was set."""
    year = 365.25 * 86400.0
    ten = 60.0 * np.arange(10.0)
    with pytest.raises(InputError, match=r"line 6: the time jumps by 3\.0 years"):
        order._refuse_reset(ten + 3.0 * year * (ten >= 300.0), "run.csv", range(10))
    order._refuse_reset(ten + 0.9 * year * (ten >= 300.0), "run.csv", range(10))
    order._refuse_reset(ten + 2.0 * year * (ten >= 300.0) + 2.0 * year * (ten >= 400.0), "run.csv", range(10))


def test_readings_at_one_stamp_are_averaged_where_they_are_one_sensors():
    """Missing ones apart; far apart they are of two."""
    edges = np.array([0, 2, 3])
    assert order._mean(np.array([1.0, 3.0, 5.0, np.nan]), edges)[:2].tolist() == [2.0, 5.0]
    assert np.isnan(order._mean(np.array([1.0, 3.0, 5.0, np.nan]), edges)[2])
    edges = np.arange(0, 20, 2)
    slow = np.repeat(20.0 + 0.1 * np.arange(10.0), 2)
    for apart, differ in ((0.7, False), (0.9, True), (5.0, True)):
        column = slow + apart * (np.arange(20) % 2)
        assert order._differ(column, order._mean(column, edges), edges) == differ
    assert not order._differ(slow, order._mean(slow, edges), edges)
    three = np.arange(0, 6, 2)
    for apart in (0.9, 1.1):
        column = np.array([20.0, 20.0 + apart] * 3)
        assert order._differ(column, order._mean(column, three), three) == (apart > 1.0)


@pytest.mark.parametrize(
    ("cell", "decimal", "value"),
    [
        ("1,234.5", ".", 1234.5), ("1.234,5", ",", 1234.5), ("1'234.5", ".", 1234.5), ("1 234,5", ",", 1234.5),
        ("12,5", ",", 12.5), ("-.5", ".", -0.5), ("+ 3.", ".", 3.0), ("1,234,567", ".", 1234567.0), ("2.5e-3", ".", 0.0025),
        ("12,5", ".", None), ("1,234", ".", None), ("1,23.5", ".", None),
        ("1.2.3", ".", None), ("12 34", ".", None), ("e5", ".", None),
    ],
)  # fmt: skip
def test_a_number_has_its_decimal_sign_and_thousands_by_the_other(cell, decimal, value):
    """A single group of three without decimals is told from a fraction by nobody."""
    assert is_number(cell, decimal) == (value is not None)
    if value is not None:
        assert to_number(cell, decimal) == pytest.approx(value)


def test_lines_are_parted_and_words_for_nothing_known():
    """Quotes hold a delimiter, blanks are one; the sign of a comment stands before names."""
    assert split('a;"b;c";d', ";") == ["a", "b;c", "d"]
    assert split('  a   "b" c ', " ") == ["a", "b", "c"]
    assert split("a\rb,c", ",") == ["a b", "c"]
    assert header_cells("# t T1", " ") == ["t", "T1"]
    assert header_cells("# t,T1", ",") == ["# t", "T1"]
    assert is_missing(" NaN ")
    assert not is_missing("20")
    assert is_missing("-999", frozenset(["-999"]))
    assert Dialect("utf-8", ";", ",", 0, (), 1, 2).describe() == "semicolon-separated, decimal comma, header in line 1, utf-8"
    assert Dialect("utf-8", "\t", ".", None, (), 0, 2).describe() == "tab-separated, decimal point, no header, utf-8"


TEXT = "Zeit;Wärme °C\n" + "".join(f"{i};20,{i}\n" for i in range(40))


@pytest.mark.parametrize(
    ("data", "name"),
    [
        (TEXT.encode(), "utf-8"),
        (codecs.BOM_UTF8 + TEXT.encode(), "utf-8-sig"),
        (TEXT.encode("utf-16"), "utf-16"),
        (TEXT.encode("utf-16-le"), "utf-16-le"),
        (TEXT.encode("utf-16-be"), "utf-16-be"),
        (TEXT.encode("cp1252"), "cp1252"),
        ("时间,温度\n0,20\n".encode("gb18030"), "gb18030"),
        ("время,Температура\n0,20\n".encode("cp1251"), "cp1251"),
        (TEXT.encode() + b"\0" * 300, "utf-8"),
    ],
)
def test_an_encoding_is_known_by_marks_nuls_and_words(data, name):
    """And the text comes out of it."""
    assert encoding.detect_encoding(data, "run.csv") == name
    told, used, _ = encoding.to_utf8(data, "run.csv", None)
    assert used == name
    assert told.decode().rstrip("\0").splitlines()[0] in ("Zeit;Wärme °C", "时间,温度", "время,Температура")


def test_bytes_that_are_no_text_are_refused_with_what_they_are():
    """By their first bytes, by control characters of more than one in a hundred, by NULs of more than half."""
    for data, word in (
        (b"%PDF-1.4", "a PDF document"),
        (b"\x89HDF\r\n", "HDF5"),
        (b"\x01" * 9 + b"a" * 600, "not a text table"),
        (b"a\n" + b"\0" * 9, "not a text"),
    ):
        with pytest.raises(InputError, match=word):
            encoding.detect_encoding(data, "run.csv")
    assert encoding.detect_encoding(b"\x01" * 9 + b"a" * 1000, "run.csv") == "utf-8"
    assert encoding.detect_encoding(b"0,20\r\n\t\x0c\x1a" * 9, "run.csv") == "utf-8"


def test_nuls_of_a_logger_that_lost_power_are_left_out_and_told():
    """At the end, and in between."""
    assert encoding.to_utf8(b"a\n1\n" + b"\0" * 5, "run.csv", None)[2] == [
        "5 NUL bytes at the end left out (the logger lost power?)"
    ]
    data, _, notes = encoding.to_utf8(b"a\n1\n\0\0\n22\n", "run.csv", None)
    assert (data, notes) == (b"a\n1\n\n22\n", ["2 NUL bytes left out (the logger lost power?)"])


def test_lines_of_two_encodings_are_read_each_in_its_own():
    """UTF-8 where a line is, else Windows-1252; beside Chinese words GB 18030."""
    mixed = "ä\n".encode() + "ö\n".encode("cp1252")
    assert encoding.to_utf8(mixed, "run.csv", None)[:2] == ("ä\nö\n".encode(), "utf-8 with lines in cp1252")
    chinese = "温度\n".encode() + "环境\n".encode("gb18030")
    assert encoding.to_utf8(chinese, "run.csv", None)[:2] == ("温度\n环境\n".encode(), "utf-8 with lines in gb18030")
    with pytest.raises(InputError, match="cannot be decoded as utf-8"):
        encoding.to_utf8("ö".encode("cp1252"), "run.csv", "utf-8")
    for text, word in ((b' [{"a": 1}]', "JSON"), (b"<?xml version", "XML")):
        with pytest.raises(InputError, match=word):
            encoding.refuse_markup(text, "run.csv")
    encoding.refuse_markup(b"a,{b}\n", "run.csv")


def _zip(*names):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for name in names:
            archive.writestr(name, b"t,T\n" if not name.endswith("/") else b"")
    return data.getvalue()


def test_an_archive_of_one_file_is_unpacked():
    """Folders and what a Mac adds apart; a workbook stays what it is, a damaged or doubled one is refused."""
    assert unpacked(_zip("run.csv", "folder/", "__MACOSX/run.csv"), "run.zip") == b"t,T\n"
    with pytest.raises(InputError, match="an archive of 2 files"):
        unpacked(_zip("a.csv", "b.csv"), "run.zip")
    book = _zip("xl/workbook.xml")
    assert is_workbook(book)
    assert unpacked(book, "run.xlsx") == book
    assert not is_workbook(_zip("run.csv"))
    assert not is_workbook(b"PK\x03\x04 cut short")
    assert not is_workbook(b"t,T\n")
    assert is_workbook(b"\xd0\xcf\x11\xe0 old")
    packed = lzma.compress(b"t,T\n" * 9)
    assert unpacked(packed, "run.csv.xz") == b"t,T\n" * 9
    for damaged in (packed[:-9], _zip("run.csv")[:30]):
        with pytest.raises(InputError, match="cannot be unpacked"):
            unpacked(damaged, "run")


@pytest.mark.parametrize(
    ("name", "unit", "kind"),
    [
        ("Front bearing", "", "named"), ("R1", "", "nameless"), ("T1", "", "sensor"),
        ("Temp front", "", "sensor"), ("Front", "degC", "sensor"),
        ("T room", "", "ambient"), ("T3 (ambient) [°C]", "", "ambient"), ("T bearing room side", "", "sensor"),
        ("T setpoint", "", "input"), ("T1-T2", "°C", "input"), ("front - room", "°C", "input"),
        ("dT", "", "input"), ("T_ref", "", "input"),
        ("Cold junction", "", "input"), ("Reference block", "°C", "sensor"), ("rpm", "", "input"), ("Power", "W", "input"),
        ("Displacement Z", "um", "displacement"), ("Displacement Z", "", "displacement"), ("Dev1/ai0", "", "input"),
        ("Day", "", "other"), ("T1 (2)", "", "sensor"),
        ("Phase [A]", "", "input"), ("Temperature [A]", "", "sensor"),
    ],
)  # fmt: skip
def test_names_and_units_say_what_a_column_is(name, unit, kind):
    """A place on the machine is no room, a difference no temperature, a letter beside a temperature no unit."""
    assert sign_of(name, unit).kind == kind


def test_labels_of_the_room_and_of_set_points():
    """The room alone, with no other place."""
    assert names_the_room_alone("Room temperature")
    assert not names_the_room_alone("Room bearing")
    assert not names_the_room_alone("Temperature")
    assert names_a_set_point("Setpoint")
    assert not names_a_set_point("Front")


def _names(*lines, header=0, units=(), data=None, delimiter=";"):
    data = header + 1 + len(units) if data is None else data
    dialect = Dialect("utf-8", delimiter, ".", header, tuple(units), data, len(lines[data].split(delimiter)))
    return names_and_units(list(lines), dialect, "run.csv")


def test_names_are_told_apart_and_filled_where_none_is_told():
    """By number; a sign of a comment and the end of a line are no names."""
    assert _names("#t;T1;T1;", "0;1;2;") == (["t", "T1", "T1 (2)", "column 4"], [""] * 4)
    assert _names("t;T1", "0;1;")[0] == ["t", "T1", "column 3"]
    assert _names("T1;T2", "1;20;30", "2;20;30", "3;20;30")[0] == ["column 1", "T1", "T2"]
    assert _names("t;T1;comment", "0;1")[0] == ["t", "T1"]
    assert _names("t;T1", "s;°C", "0;20", units=[1]) == (["t", "T1"], ["s", "°C"])
    with pytest.raises(InputError, match="line 2: the row has 4 cells and the header 2"):
        _names("t;T1", "0;1;2;3")
    with pytest.raises(InputError, match="line 2: the row has 3 cells and the header 2"):
        _names("t;T1", "0;1;2", "5;1;2")


def test_a_group_above_tells_the_unit_and_columns_of_one_name_apart():
    """A merged cell stands where it begins."""
    above = ";Temperature [°C];;Displacement [um];"
    assert _names(above, "t;a;b;x;y", "0;1;2;3;4", header=1) == (["t", "a", "b", "x", "y"], ["", "C", "C", "um", "um"])
    assert _names(";Front;;Rear;", "t;min;max;min;max", "0;1;2;3;4", header=1)[0] == [
        "t",
        "Front min",
        "Front max",
        "Rear min",
        "Rear max",
    ]
    paths = "Time;/amdcpu/0/temperature/0;/amdcpu/0/load/1"
    assert _names(paths, "t;Core;CPU", "0;40;5", header=1)[1] == ["", "°C", "%"]


def _ordered(time, headers=(), of=None, **more):
    time = np.array(time, dtype=float)
    column = np.arange(len(time)) / 10.0 if of is None else np.array(of)
    return order.in_order(time, {"T": column}, "run.csv", range(1, 1 + len(time)), headers=headers, **more)


def test_rows_are_put_in_the_order_of_time_and_what_was_done_is_told():
    """Newest first, a row out of place, a stamp twice, of several sensors without a word."""
    (one,) = _ordered([30, 20, 10, 0])
    assert (one.time.tolist(), one.columns["T"].tolist()) == ([0.0, 10.0, 20.0, 30.0], [0.3, 0.2, 0.1, 0.0])
    assert one.notes == ("newest first: sorted by time",)
    (one,) = _ordered([0, 10, 30, 20, 40, 50, 60])
    assert one.columns["T"].tolist() == [0.0, 0.1, 0.3, 0.2, 0.4, 0.5, 0.6]
    assert one.notes == ("1 row out of order: sorted by time",)
    (one,) = _ordered([0, 10, 10, 20, 30, 40, 40])
    assert one.time.tolist() == [0.0, 10.0, 20.0, 30.0, 40.0]
    assert one.columns["T"].tolist() == pytest.approx([0.0, 0.15, 0.3, 0.4, 0.55])
    assert one.notes == ("2 repeated time stamps: readings of one stamp averaged",)
    assert _ordered([0, 10, 10, 20, 30])[0].notes == ("1 repeated time stamp: readings of one stamp averaged",)
    (one,) = _ordered([0, 0, 10, 10, 20, 20, 30, 30, 40, 40])
    assert one.time.tolist() == [5.0 * k for k in range(10)]
    (one,) = _ordered([0, 20, 10, 0, 10, 20], mixed=True)
    assert (one.time.tolist(), one.notes) == ([0.0, 10.0, 20.0], ())
    with pytest.raises(Exception, match="all rows carry the same time stamp"):
        _ordered([5, 5, 5, 5])


def test_a_time_that_begins_anew_is_another_run_and_so_is_one_below_its_names():
    """From five rows on; below names that stand again where the time falls back or leaves twenty usual steps."""
    warming = [20.0, 23.0, 25.0, 26.5, 27.5, 28.0, 28.5]
    first, second = _ordered([*range(0, 70, 10), *range(0, 70, 10)], of=warming * 2)
    assert second.columns["T"].tolist() == warming
    assert first.guesses[-1].text == "the time begins anew at line 9: 2 runs, #1 to #2"
    for gap, runs in ((210, 2), (190, 1)):
        assert len(_ordered([*range(0, 70, 10), *range(60 + gap, 130 + gap, 10)], headers=[8])) == runs
    assert len(_ordered([*range(0, 70, 10), *range(270, 340, 10)])) == 1
    earlier = [*range(200, 270, 10), *range(0, 70, 10)]
    assert [len(_ordered(earlier, dated=d, of=warming * 2)) for d in (False, True)] == [2, 1]
