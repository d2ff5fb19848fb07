"""Stamps and clocks as programs write them: each form, month and zone by the calendar, and what is refused."""

from datetime import datetime

import numpy as np
import pytest

from thermofast.errors import InputError
from thermofast.reading.moments import stamps
from thermofast.reading.moments.stamps import looks_like_stamp, parse_stamps, plausible


def _since_1970(*moment):
    return (datetime(*moment) - datetime(1970, 1, 1)).total_seconds()


def _read(cells, name="", time_format=None):
    return parse_stamps(cells, "run", range(1, 1 + len(cells)), name, time_format)


def _seconds(*cells, name="", time_format=None):
    return _read(cells, name, time_format).seconds.tolist()


@pytest.mark.parametrize(
    ("cell", "moment"),
    [
        ("2026年3月14日 8时05分07秒", (8, 5, 7)), ("2026年3月14日 8时5分", (8, 5)), ("2026年3月14日 8时", (8, 0)),
        ("2026년 3월 14일 오후 8:05", (20, 5)), ("2026年3月14日 上午 8:05:07", (8, 5, 7)), ("2026-03-14 PM 8:05", (20, 5)),
        ("2026-03-14 AM 12:05:07", (0, 5, 7)), ("14.03.2026 08:05 Uhr", (8, 5)), ("14.03.2026 08:05:07 hrs", (8, 5, 7)),
        ("14. 3. 2026 08:05:07", (8, 5, 7)), ("2026. 3. 14. 08:05", (8, 5)), ("2026.03.14. 08:05:07", (8, 5, 7)),
        ("14/03/2026 23.05.07", (23, 5, 7)), ("14/03/2026 8.05", (8, 5)), ("14-03-2026 23.05", (23, 5)),
        ("14.03.2026 08h05", (8, 5)), ("14.03.2026 8 h 05 min 07 s", (8, 5, 7)),
        ("Sat Mar 14 08:05:07 CET 2026", (8, 5, 7)), ("Sat Mar 14 08:05:07.250 2026", (8, 5, 7, 250000)),
        ("3/14/2026 8:05:07 p.m.", (20, 5, 7)), ("3/14/2026 12:05:07 AM", (0, 5, 7)), ("3/14/2026 12:05 PM", (12, 5)),
        ("Mar 14, 2026 08:05", (8, 5)), ("14-Mar-26 08:05:07", (8, 5, 7)), ("Saturday, 14 March 2026 08:05", (8, 5)),
        ("20260314_080507", (8, 5, 7)), ("20260314 0805", (8, 5)), ("20260314T080507.5", (8, 5, 7, 500000)),
        ("2026-03-14-08:05:07", (8, 5, 7)), ("2026/3/14, 08:05:07,125", (8, 5, 7, 125000)), ("14.03.2026", (0, 0)),
        ("2026-03-14 08:05:07:500", (8, 5, 7, 500000)), ("14-03-26 23:59:59", (23, 59, 59)),
    ],
)  # fmt: skip
def test_a_moment_in_each_form_that_programs_write(cell, moment):
    """All of the 14th of March 2026, which no order of day and month changes."""
    found = _read([cell])
    assert looks_like_stamp(cell)
    assert found.starts[0] == pytest.approx(_since_1970(2026, 3, 14, *moment), abs=1e-6)
    assert found.dated


@pytest.mark.parametrize(
    ("month", "names"),
    [
        (1, "Jan January янв ene gen sty led oca"), (2, "Feb фев lut úno fev fév şub"), (3, "Mar мар mrt bře mär mrz"),
        (4, "Apr апр abr kwi dub nis avr"), (5, "May май мая mei mag maj kvě mai"), (6, "Jun июн giu cze haz juin"),
        (7, "Jul июл lug lip tem juil juillet"), (8, "Aug авг ago sie ağu aoû"), (9, "Sep сен set wrz zář eyl"),
        (10, "Oct окт ott paź říj eki okt out"), (11, "Nov ноя lis kas"), (12, "Dec дек dic gru pro ara dez déc"),
    ],
)  # fmt: skip
def test_months_in_the_languages_of_labs(month, names):
    """By their first letters, of four where three are those of another."""
    for name in names.split():
        assert set(_read([f"14 {name} 2026 08:05"]).starts) == {_since_1970(2026, month, 14, 8, 5)}, name


@pytest.mark.parametrize(("year", "full"), [("68", 2068), ("69", 1969), ("99", 1999), ("00", 2000), ("1900", 1900), ("2200", 2200)])
def test_years_of_two_digits_reach_from_1969_to_2068(year, full):
    """Others stand as they are, from 1900 to 2200."""
    assert set(_read([f"14 Mar {year}"]).starts) == {_since_1970(full, 3, 14)}


@pytest.mark.parametrize(
    "cell",
    [
        "14 Mar 1899", "14 Mar 2201", "31.04.2026", "29.02.2026", "00.03.2026", "14.13.2026", "2026-00-14", "32 Mar 2026",
        "14.03.2026 24:00:01", "14.03.2026 08:60", "14.03.2026 08:60:60", "14.03.2026 08:00:60", "14.03.2026 13:05 PM", "14.03.2026 0:05 AM",
        "14 Foo 2026", "hot", "20260231 0805",
    ],
)  # fmt: skip
def test_what_no_calendar_has_is_refused_by_its_line(cell):
    """Beside a row that is one."""
    with pytest.raises(InputError, match="line 3: unreadable time") as told:
        _read(["14.03.2026 08:05" if "." in cell else "14 Mar 2026" if "M" in cell or "F" in cell else "2026-03-14", cell])
    assert told.value.found == repr(cell)


def test_dates_that_no_order_reads_together_are_refused_at_the_first_of_them():
    """Each of them is a date by itself."""
    with pytest.raises(InputError, match="line 2: unreadable time"):
        _read(["13/02/2026", "02/13/2026"])


def test_the_last_days_of_months_are_days():
    """Leap years have one more."""
    cells = ["31.01.2024", "29.02.2024", "31.03.2024", "30.04.2024", "31.12.2024"]
    assert _seconds(*cells) == [86400.0 * d for d in (0, 29, 60, 90, 335)]


def test_zones_are_taken_off_and_no_clock_change_is_looked_for():
    """East is earlier; all stamps have one or none has."""
    for zone, ahead in (("Z", 0.0), (" UTC", 0.0), ("+02:00", 2.0), ("-0330", -3.5), (" +05:45", 5.75)):
        found = _read(["2026-03-14 08:00:00Z", f"2026-03-14 09:00:00{zone}"])
        assert found.starts == ()
        assert found.seconds[1] == 3600.0 * (1.0 - ahead)
    for cells, line in ((["2026-03-14 08:00Z", "2026-03-14 08:01"], 3), (["2026-03-14 08:00", "2026-03-14 08:01Z"], 2)):
        with pytest.raises(InputError, match=f"line {line}: unreadable time"):
            _read(cells)


def test_day_and_month_are_told_by_what_is_a_date_then_by_even_steps():
    """An order of which time goes back is none; where none is better the user is asked."""
    assert _seconds("12/03/2026", "13/03/2026") == [0.0, 86400.0]
    assert _seconds("03/12/2026", "03/13/2026") == [0.0, 86400.0]
    both = _read(["03/04/2026 08:00", "03/04/2026 09:00"])
    assert set(both.starts) == {_since_1970(2026, 4, 3, 8), _since_1970(2026, 3, 4, 8)}
    assert both.guess is None
    assert _seconds("03/04/2026", "02/05/2026") == [0.0, 29 * 86400.0]
    daily = [f"{d:02d}/03/2026 {h:02d}:00" for d in range(3, 8) for h in (0, 12)]
    turned = [f"03/{d:02d}/2026 {h:02d}:00" for d in range(3, 8) for h in (0, 12)]
    assert _read(daily).guess.text == "'03/03/2026 00:00' read as day.month.year, the order in which the rows are evenly apart"
    assert _read(turned).guess.text.startswith("'03/03/2026 00:00' read as month.day.year")
    assert _seconds(*daily) == _seconds(*turned) == [43200.0 * k for k in range(10)]
    assert [stamps.unusual_steps(np.array([0.0, 10.0, 20.0, 30.0, 30.0 + s])) for s in (15.9, 16.1, 3.9)] == [0, 1, 1]
    for clock, shown in (("", ""), (" 08:00", " %H:%M"), (" 08:00:00", " %H:%M:%S")):
        with pytest.raises(InputError, match="day and month cannot be told apart") as told:
            _read([f"03/04/2026{clock}", f"04/05/2026{clock}"])
        assert f"'%d/%m/%Y{shown}'" in told.value.do


def test_a_name_may_say_the_order():
    """Also of years of two digits, which stand last else or first."""
    assert _read(["03/04/2026"], "Date (dd/mm/yyyy)").starts[0] == _since_1970(2026, 4, 3)
    assert _read(["03/04/2026"], "Date (mm/dd/yyyy)").starts[0] == _since_1970(2026, 3, 4)
    assert _read(["26-03-14"], "yy-mm-dd").starts[0] == _since_1970(2026, 3, 14)
    assert set(_read(["26-03-14"]).starts) == {_since_1970(2014, 3, 26), _since_1970(2026, 3, 14)}


def test_a_clock_goes_on_past_midnight_and_falls_back_to_a_new_run():
    """Over half a day back, to within an hour or twenty steps of a whole one."""
    assert _seconds("23:58:00", "23:59:00", "00:00:00", "00:01:00") == [0.0, 60.0, 120.0, 180.0]
    assert _seconds("23:30:00", "00:30:00", "01:30:00") == [0.0, 3600.0, 7200.0]
    assert _seconds("20:00:00", "20:01:00", "21:00:00", "08:00:00")[-1] == -12 * 3600.0
    assert _seconds("23:00:00", "23:01:00", "00:02:00")[-1] == -22 * 3600.0 - 58 * 60.0
    assert _seconds("23:00:00", "23:10:00", "02:00:00", "02:10:00") == [0.0, 600.0, 10800.0, 11400.0]
    assert _seconds("00:01:00", "00:00:00", "23:59:00", "23:58:00") == [0.0, -60.0, -120.0, -180.0]
    assert _seconds("13:00:00", "01:00:00") == [0.0, -43200.0]


def test_clocks_of_elapsed_time_go_on_for_days():
    """Beyond 24 hours, and with days in front; points of a minute, and of a second."""
    assert _seconds("23:59:00", "24:00:00", "100:00:00") == [0.0, 60.0, 76 * 3600.0 + 60.0]
    assert _seconds("0 d 23:00:00", "1 d 01:00:00", "2 days, 01:00:00") == [0.0, 7200.0, 93600.0]
    assert _seconds("1.23:00:00", "2.01:00:00.5") == [0.0, 7200.5]
    assert _seconds("05:32.5", "05:33.25") == [0.0, 0.75]
    assert _seconds("05:32:01.5", "05:32:02,25") == [0.0, 0.75]
    assert _seconds("1 d 00:00:30", "0 d 23:00:00") == [0.0, -3630.0]
    assert _read(["01:00:00", "02:00:00"]).starts == ()
    assert not _read(["01:00:00", "02:00:00"]).dated


def test_two_parts_are_hours_and_minutes_or_minutes_and_seconds():
    """By the name, by more than 47, or by what is as long as a record is."""
    assert _seconds("00:00", "00:30", name="Time (mm:ss)") == [0.0, 30.0]
    assert _seconds("00:00", "00:30", name="Time (hh:mm)") == [0.0, 1800.0]
    assert _seconds("59:00", "00:00", name="m:ss") == [0.0, -3540.0]
    found = _read(["00:00", "48:00", "96:00"])
    assert found.seconds.tolist() == [0.0, 2880.0, 5760.0]
    assert found.guess.text == "'00:00' read as minutes:seconds"
    hours = _read(["08:00", "08:01", "08:30"])
    assert hours.seconds.tolist() == [0.0, 60.0, 1800.0]
    assert hours.guess.text.startswith("'08:00' read as hours:minutes")
    with pytest.raises(InputError, match="hours:minutes and minutes:seconds cannot be told apart") as told:
        _read([f"{8 + k // 4:02d}:{15 * (k % 4):02d}" for k in range(41)])
    assert told.value.found == "'08:00' to '18:00'"
    assert _seconds("08:00 AM", "08:01 PM") == [0.0, 43260.0]
    assert _seconds("47:00", "47:10", "47:20")[-1] == 1200.0


@pytest.mark.parametrize(
    ("length", "rows", "likely"),
    [
        (600.0, 2, True), (599.0, 2, False), (600.0, 14900, True), (600.0, 15100, False), (4 * 86400.0, 385, True),
        (4 * 86400.0, 384, False), (4.01 * 86400.0, 2000, False), (900.0, 2, True), (901.0, 2, False), (0.0, 1, False),
    ],
)  # fmt: skip
def test_a_likely_record_is_of_ten_minutes_to_four_days(length, rows, likely):
    """Read every 0.04 s to every quarter of an hour."""
    assert plausible(np.linspace(0.0, length, rows)) is likely
    assert plausible(np.linspace(length, 0.0, rows)) is likely
    if length == 599.0:
        assert plausible(np.linspace(0.0, length, 20), 500.0)


def test_a_format_that_the_user_tells_is_read_as_told():
    """Elapsed clocks pass 60 minutes and midnight; a fraction of nought may be left out."""
    assert _seconds("70:30", "71:00", time_format="%M:%S") == [0.0, 30.0]
    assert _seconds("23:30", "00:30", time_format="%H:%M") == [0.0, 3600.0]
    assert _seconds("30:00:00,5", "30:00:01", time_format="%H:%M:%S") == [0.0, 0.5]
    assert _seconds("59:59", "00:00", time_format="%M:%S") == [0.0, -3599.0]
    assert _seconds("08.05", "09.06", time_format="%H.%M") == [0.0, 3660.0]
    assert _seconds("23.30", "00.30", "12.01", "00.00", time_format="%H.%M") == [0.0, 3600.0, 45060.0, 88200.0]
    assert _seconds("20:38:06.5", "20:38:07", time_format="%H:%M:%S.%f") == [0.0, 0.5]
    told = _read(["14|03|26 08", "14|03|26 09"], time_format="%d|%m|%y %H")
    assert (told.starts, told.dated) == ((_since_1970(2026, 3, 14, 8),), True)
    assert not _read(["08.05"], time_format="%H.%M").dated
    assert _read(["14.03.2026 08:00 +0100", "14.03.2026 08:00 +0000"], time_format="%d.%m.%Y %H:%M %z").seconds[1] == 3600.0
    for cells, form, line in ((["08.05", "8:06"], "%H.%M", 3), (["1:2:3", "1:2"], "%H:%M:%S", 3), (["a:b"], "%M:%S", 2)):
        with pytest.raises(InputError, match=f"line {line}: unreadable time"):
            _read(cells, time_format=form)


def test_an_unreadable_row_near_the_end_may_be_left_out():
    """In the second half, sixty lines from the end at most; signs between digits are told apart from it."""
    for rows, bad, said in (
        (20, 15, "--skip-footer 5"),
        (20, 10, ""),
        (20, 11, "--skip-footer 9"),
        (200, 139, ""),
        (200, 140, "60"),
    ):
        cells = ["14.03.2026 08:05"] * rows
        cells[bad] = "Mean"
        with pytest.raises(InputError, match=f"line {bad + 2}") as told:
            _read(cells)
        assert said in told.value.do
        assert ("--skip-footer" in told.value.do) is bool(said)
    with pytest.raises(InputError, match="another way than in the rest") as told:
        _read(["0,5", "1,0"])
    assert told.value.found == "'0,5', where '.' is the decimal sign elsewhere"
    assert stamps.two_signs(["1", "2.5", ""]) == "2.5"
    assert stamps.two_signs(["1", "2"]) == stamps.two_signs(["1.5", "a"]) == stamps.two_signs([" "]) == ""


@pytest.mark.parametrize(
    "cell",
    ["T1:21.70", "21.5", "", "-12:30", "hot", "2026", "1.2", "12.5.", "20260314", "Zone 1", "May be", "12 h", "100"],
)
def test_what_is_no_stamp(cell):
    """A reading with its name, numbers, words."""
    assert not looks_like_stamp(cell)


@pytest.mark.parametrize("cell", ["12:30", "1:02:03.5", "3 d 01:00:00", "14-Mar-2026", "2026-03-14", "20260314 0805", "  08:05 "])
def test_what_is_a_stamp(cell):
    """Dates, clocks and both."""
    assert looks_like_stamp(cell)


def test_the_end_of_a_day_is_24_00():
    """Beside its own date or without one, as ISO 8601 has it; 24:01 is no time of day."""
    days = ["27.11.2026 23:58", "27.11.2026 23:59", "27.11.2026 24:00", "28.11.2026 00:01"]
    assert parse_stamps(days, "x", range(4)).seconds.tolist() == [0.0, 60.0, 120.0, 180.0]
    daily = ["23:59:58", "23:59:59", "24:00:00", "00:00:01", "00:00:02"]
    assert parse_stamps(daily, "x", range(5)).seconds.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    elapsed = ["23:00:00", "24:00:00", "25:00:00"]
    assert parse_stamps(elapsed, "x", range(3)).seconds.tolist() == [0.0, 3600.0, 7200.0]
    with pytest.raises(InputError, match="unreadable time"):
        parse_stamps(["27.11.2026 23:59", "27.11.2026 24:01"], "x", range(2))
