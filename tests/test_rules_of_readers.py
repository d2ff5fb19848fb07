"""Numbers and words that readers decide by, to either side of each."""

import struct
import zlib
from datetime import datetime
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from thermofast.errors import InputError
from thermofast.reading.follow import whole_lines
from thermofast.reading.moments import epochs
from thermofast.reading.moments.clock_texts import as_clock, padded
from thermofast.reading.moments.four_parts import DAYS, HUNDREDTHS, days_to_seconds
from thermofast.reading.moments.glitches import without_glitches
from thermofast.reading.moments.stamps import unusual_steps
from thermofast.reading.moments.zones import _moments, _offset, _skipped
from thermofast.reading.signs import sign_of
from thermofast.reading.tables.cells import with_unit
from thermofast.reading.tables.limits import Limits, _column, inflate, matlab_elements, matlab_order
from thermofast.reading.units import parse_unit, to_celsius, unit_above, unit_in_name
from thermofast.reading.values.faults import false_first, held, without_faults, without_impossible

Y2000 = (datetime(2000, 1, 1) - datetime(1970, 1, 1)).total_seconds()


@pytest.mark.parametrize(("unit", "size"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_an_epoch_is_of_the_years_2000_to_2100(unit, size):
    """In whichever unit all of them are, missing ones apart."""
    assert epochs.epoch_of(size * np.array([Y2000, np.nan, Y2000 + 60.0])) == unit
    assert epochs.epoch_of(size * np.array([Y2000 - 86400.0, Y2000 + 60.0])) is None
    assert epochs.epoch_of(size * np.array([Y2000, 4.2e9])) is None


def test_no_number_at_all_is_no_epoch():
    """A column of nan."""
    assert epochs.epoch_of(np.full(3, np.nan)) is None


def test_serial_days_are_of_those_years_with_a_fraction_and_close_to_each_other():
    """36526 is the first of January 2000 in a spreadsheet, 73050 the last of December 2099."""
    assert epochs.serial(np.array([36526.0, 36526.25, 36526.5]))
    assert epochs.serial(np.array([73050.0, 73050.25, 73050.5]))
    assert not epochs.serial(np.array([36525.75, 36526.0, 36526.25]))
    assert not epochs.serial(np.array([73050.75, 73051.0, 73051.25]))
    assert not epochs.serial(np.array([40000.0, 40001.0, 40002.0]))
    assert not epochs.serial(np.array([40000.0, 40000.5, 40001.0]))


def test_ticks_count_from_1601_or_from_the_year_1():
    """Steps of 100 ns: the first of January 2000 and 2050 in both, a year before it in none."""
    year = 365.25 * 86400e7
    for begin, what in ((datetime(1601, 1, 1), "a file time of Windows"), (datetime(1, 1, 1), "ticks of .NET")):
        first = (datetime(2000, 1, 1) - begin).total_seconds() * 1e7
        assert epochs.ticks_of(np.array([first, first + 50.0 * year])) == what
        assert epochs.ticks_of(np.array([first - year, first])) == ""
        assert epochs.ticks_of(np.array([first, first + 101.0 * year])) == ""


def test_a_date_as_a_number_and_the_millionths_of_days_of_an_archive():
    """20260503 is one, a number of seven or nine digits none."""
    assert epochs.is_date_number(np.array([20260503.0, 20260504.0]))
    assert epochs.is_date_number(np.array([19000000.0, 21991231.0]))
    assert not epochs.is_date_number(np.array([18991231.0, 20260504.0]))
    assert not epochs.is_date_number(np.array([20260503.0, 22000000.0]))
    assert not epochs.is_date_number(np.array([20260503.0, np.nan]))
    assert epochs.of_archive(np.array([36526e6, 73050e6]))
    assert not epochs.of_archive(np.array([36525e6, 40000e6]))
    assert not epochs.of_archive(np.array([40000e6, 73051e6]))


def test_moments_beyond_every_calendar_are_the_nearest_that_it_has():
    """Zones need a day to either side."""
    assert epochs.calendar(86400.0) == datetime(1970, 1, 2)
    assert epochs.calendar(1e15) == datetime(9999, 12, 29)
    assert epochs.calendar(-1e15) == datetime(1, 1, 3)


@pytest.mark.parametrize(
    ("cell", "clock"),
    [
        ("1h 02m 03s", "1:02:03"),
        ("1h", "1:00:00"),
        ("1 d 2 hours 3 min 4.5 s", "26:03:04.5"),
        ("2 days, 0 h", "48:00:00"),
        ("PT1H2M3S", "1:02:03"),
        ("P1DT61M", "25:01:00"),
        ("PT0,25S", "0:00:00.25"),
        ("0s", "0:00:00"),
        ("90m1.000001s", "1:30:01.000001"),
        ("59.9999996s", "0:01:00"),
        ("62'03\"", "1:02:03"),
        ("1h 2'3.5''", "1:02:03.5"),
        ("5 m", None),
        ("P1D", None),
        ("", None),
    ],
)
def test_elapsed_times_with_their_units(cell, clock):
    """Days, hours, minutes and seconds as programs and people write them; a length in metres is none."""
    assert as_clock(cell) == clock


def test_milliseconds_without_leading_zeros_are_padded_only_where_that_puts_them_in_order():
    """.50 and then .100 is 50 ms and 100 ms; .5 and then .75 may be what they seem."""
    assert padded(["13:59:49.50", "13:59:49.100"]) == ["13:59:49.050", "13:59:49.100"]
    assert padded(["13:59:49.9 PM", "13:59:49.10 PM"]) == ["13:59:49.009 PM", "13:59:49.010 PM"]
    assert padded(["13:59:49.5", "13:59:49.75"]) is None
    assert padded(["13:59:49.5", "13:59:50.25"]) is None  # not within one second
    assert padded(["13:59:49.50", "13:59:49.100", "13:59:49.20"]) is None  # in order by neither
    assert padded(["13:59:49.100", "13:59:49.200"]) is None
    assert padded(["13:59:49.50", "13:59:49"]) is None


def test_a_clock_of_four_parts_is_told_by_where_its_last_part_goes_over():
    """Seconds go over at 60, hundredths at 100; the name or the user may say it."""
    seconds = [f"00:00:{k // 6:02d}:{k % 6 * 10:02d}" for k in range(12)]
    np.testing.assert_array_equal(days_to_seconds(seconds, "run", "Time", None), 10.0 * np.arange(12))
    hundredths = [f"00:00:{k // 2:02d}:{k % 2 * 50:02d}" for k in range(12)]
    assert days_to_seconds(hundredths, "run", "Time", None) is None
    assert days_to_seconds(["01:02:03:04"], "run", "Elapsed [dd:hh:mm:ss]", None).tolist() == [93784.0]
    assert days_to_seconds(["01:02:03:04"], "run", "Time", DAYS).tolist() == [93784.0]
    assert days_to_seconds(["00:02:03:04"], "run", "Time [dd:hh:mm:ss]", HUNDREDTHS) is None
    assert days_to_seconds(["00:00:03:60", "00:00:04:10"], "run", "Time", None) is None  # no second is the sixtieth
    assert days_to_seconds(["00:24:03:04", "00:24:03:05"], "run", "Time", None) is None  # nor an hour the 24th
    assert days_to_seconds(["01:00:03:04", "01:00:03:05"], "run", "Time", None) is None  # a record begins on its first day
    with pytest.raises(InputError, match="a clock of four parts"):
        days_to_seconds(["00:00:03:04", "00:00:03:05"], "run", "Time", None)


def even(rows=24):
    return 60.0 * np.arange(rows)


def test_a_stamp_that_is_far_off_between_even_rows_is_left_out():
    """Three rows in turn at most, whichever way; by how much and where it stood is said."""
    for rows, off, told in ((1, 200 * 86400.0, "200 days"), (3, -3.0 * 3600.0, "3 h"), (2, 3600.0, "60 min")):
        time = even()
        time[7 : 7 + rows] += off
        kept, said = without_glitches(time, range(len(time)))
        assert sorted(set(range(24)) - set(kept.tolist())) == list(range(7, 7 + rows))
        assert f"by up to {told}, in line{'s' if rows > 1 else ''} 8" in said[0].text
    time = even()
    time[7:11] += 365 * 86400.0
    assert len(without_glitches(time, range(24))[0]) == 24


def test_a_row_that_came_late_is_no_glitch():
    """It leaves a gap where it belongs."""
    time = even()[[*range(7), *range(8, 15), 7, *range(15, 24)]]
    kept, said = without_glitches(time, range(24))
    assert len(kept) == 24
    assert said == []


def test_no_step_back_is_no_glitch():
    """Even a jump of years forward that stays."""
    time = even()
    time[12:] += 1e8
    assert len(without_glitches(time, range(24))[0]) == 24


@pytest.mark.parametrize(
    ("value", "kept"),
    [(-273.15, False), (-273.1, True), (5000.0, True), (5000.5, False), (-127.0, False), (3276.7, False), (655.35, False)],
)
def test_what_no_temperature_can_be(value, kept):
    """Absolute zero, the hottest, and what broken probes write; beside readings that cover as much."""
    values = np.array([-273.0, *np.linspace(-270.5, 4990.0, 40), value, 4995.0])
    found, out = without_impossible(values)
    assert bool(np.isfinite(found[-2])) is kept
    assert out == (0 if kept else 1)


@pytest.mark.parametrize(("step", "false"), [(2.5, 1), (1.5, 0)])
def test_a_false_first_reading_lies_more_than_2_k_away(step, false):
    """The readings jump away from it and then go back towards it, in steps a hundredth of that."""
    column = np.concatenate([[20.0], 20.0 + step - 0.002 * np.arange(40)])
    assert false_first([column]).tolist() == [false]


@pytest.mark.parametrize(("count", "found"), [(1, 1), (3, 3), (4, 0)])
def test_at_most_three_first_readings_are_false(count, found):
    """More of them are a part of the record."""
    column = np.concatenate([np.full(count, 50.0), 20.0 + 0.01 * np.arange(60)])
    assert false_first([column]).tolist() == [found]


def test_false_first_readings_are_told_in_words():
    """One and several, with their temperatures."""
    columns = {n: np.concatenate([np.full(k, 50.0), 20.0 + 0.01 * np.arange(60)]) for n, k in (("a", 1), ("b", 2))}
    found, said = without_faults(columns, ["a", "b"])
    assert said["a"] == "the first reading (50 degC) is far from all others and left out"
    assert said["b"] == "the first 2 readings (50, 50 degC) are far from all others and left out"
    assert np.flatnonzero(np.isnan(found["b"])).tolist() == [0, 1]


@pytest.mark.parametrize(("each", "runs", "length"), [(3, 40, 3), (2, 40, 1), (5, 10, 5), (5, 8, 1)])
def test_a_value_is_held_in_eight_runs_of_three_readings_at_least(each, runs, length):
    """Of so many runs two are cut off by the ends of the record."""
    steps = np.tile([1.0, 3.0, 2.0], 20)[:runs]
    assert held([np.repeat(20.0 + np.cumsum(steps), each)]) == [length]


@pytest.mark.parametrize(
    ("text", "symbol", "scale"),
    [
        ("°C", "C", 1.0),
        ("(*F)", "F", 1.0),
        ("oC", "C", 1.0),
        ("Kelvin", "K", 1.0),
        ("0,1 °C", "C", 0.1),
        ("0.01 °C", "C", 0.01),
        ("10^-2 °C", "C", 0.01),
        ("10-3 degK", "K", 0.001),
        ("mdegC", "C", 0.001),
        ("millidegC", "C", 0.001),
        ("°C x10", "C", 0.1),
        ("°C*100", "C", 0.01),
    ],
)
def test_units_of_temperature_and_their_parts(text, symbol, scale):
    """A reading times the scale is in the unit."""
    unit = parse_unit(text)
    assert (unit.symbol, unit.kind) == (symbol, "temperature")
    assert unit.scale == pytest.approx(scale)


def test_temperatures_in_degrees_celsius():
    """Freezing and boiling water, and tenths of a degree."""
    np.testing.assert_allclose(to_celsius(np.array([32.0, 212.0]), "F"), [0.0, 100.0])
    np.testing.assert_allclose(to_celsius(np.array([273.15, 373.15]), "K"), [0.0, 100.0])
    np.testing.assert_allclose(to_celsius(np.array([2731.5, 3731.5]), "K", 0.1), [0.0, 100.0], atol=1e-9)
    np.testing.assert_allclose(to_celsius(np.array([0.0, 100.0]), "C"), [0.0, 100.0])


@pytest.mark.parametrize(
    ("name", "symbol", "kind"),
    [
        ("front [°C]", "C", "temperature"),
        ("Temp, °C (LGR S/N: 7)", "C", "temperature"),
        ("T1 / °C", "C", "temperature"),
        ("front_ohm", "ohm", "resistance"),
        ("TempF", "F", "temperature"),
        ("W/K", "W/K", "unknown"),
        ("slope [°C/min]", "°C/min", "unknown"),
        ("Vol [Vol%]", "Vol%", "unknown"),
        ("power (W)", "W", "power"),
    ],
)
def test_the_unit_that_a_name_carries(name, symbol, kind):
    """As the docstring of unit_in_name has it."""
    unit = unit_in_name(name)
    assert (unit.symbol, unit.kind) == (symbol, kind)


@pytest.mark.parametrize("name", ["Lager_F", "front", "T1", "[K-Type]", "Zone (12:30)"])
def test_a_name_without_a_unit(name):
    """A single letter, the kind of a thermocouple and a clock are none."""
    assert unit_in_name(name) is None


def test_the_unit_in_a_line_above():
    """Of one scale only; a voltage where nothing else is told."""
    assert unit_above(["# Temperature unit: °F"]) == "F"
    assert unit_above(["# all temperatures in Fahrenheit"]) == "F"
    assert unit_above(["Units: °C", "Units: K"]) == ""
    assert unit_above(["Unit: mV"]) == "mV"
    assert unit_above(["Unit: mV", "Unit: rpm"]) == ""
    assert unit_above([]) == ""


def test_a_unit_is_taken_out_of_cells_that_all_carry_it():
    """Missing ones apart."""
    assert with_unit(["21.3 °C", "", "21.4 °C"], ".", frozenset()) == (["21.3", "", "21.4"], "°C")
    assert with_unit(["temp=47.2'C", "temp=47.3'C"], ".", frozenset())[0] == ["47.2", "47.3"]
    for cells in (["21.3 °C", "70.3 °F"], ["21.3 °C", "hot"], ["21.3 xyz", "21.4 xyz"], ["21.3", "21.4"]):
        assert with_unit(cells, ".", frozenset()) == (cells, "")


def test_whole_lines_end_where_the_last_line_does():
    """In eight and in sixteen bits."""
    assert whole_lines(b"a,b\n1,2\n3,", None) == b"a,b\n1,2\n"
    assert whole_lines(b"a,b", None) == b""
    assert whole_lines(b"\n", None) == b"\n"
    wide = "a,b\n1,2\n3,".encode("utf-16-le")  # without a mark
    assert whole_lines(wide, None) == "a,b\n1,2\n".encode("utf-16-le")
    assert whole_lines(wide[16:], wide[:2]) == b""
    wide = "a\n1\n2".encode("utf-16")
    assert whole_lines(wide, None) == wide[:-2]
    assert whole_lines("1\n2".encode("utf-16-le"), b"\xff\xfe") == "1\n".encode("utf-16-le")


def test_a_table_may_be_as_large_as_the_limits_and_no_larger():
    """Rows, columns and eight bytes a number; the option is named."""
    limits = Limits(max_bytes=800, max_rows=20, max_columns=10)
    limits.check_shape("run", 20, 5)
    limits.check_shape("run", 10, 10)
    for rows, columns, told in ((21, 1, "21 rows"), (1, 11, "11 columns"), (11, 10, "880 bytes in memory")):
        with pytest.raises(InputError, match=f"a table of {told}"):
            limits.check_shape("run", rows, columns)


def test_a_file_may_be_as_large_as_the_limit_and_unpack_to_400_times_its_size():
    """Small ones to whatever they like; a size that no file has is not told."""
    Limits(max_bytes=1 << 20).check_bytes("run", 1 << 20)
    with pytest.raises(InputError, match="more than 1 MiB") as raised:
        Limits(max_bytes=1 << 20).check_bytes("run", (1 << 20) + 1)
    assert "1048577 bytes" in str(raised.value)
    with pytest.raises(InputError, match="more than 2 GiB") as raised:
        Limits().check_bytes("run", 1 << 50)
    assert str(1 << 50) not in str(raised.value)
    Limits().check_unpacked("run", 32 << 20, 1)
    Limits().check_unpacked("run", 400 * (1 << 20), 1 << 20)
    with pytest.raises(InputError, match="400 times its size"):
        Limits().check_unpacked("run", 400 * (1 << 20) + 1, 1 << 20)
    with pytest.raises(InputError, match="400 times its size"):
        Limits().check_unpacked("run", (32 << 20) + 1, 1)


def test_columns_of_a_sheet_are_counted_by_their_letters():
    """A is the first, XFD the last that a sheet has."""
    assert [_column(c) for c in (b"A", b"Z", b"AA", b"AZ", b"XFD")] == [1, 26, 27, 52, 16384]


def test_what_is_packed_comes_out_whole_or_not_at_all():
    """Also in many pieces; what ends early is damaged."""
    data = bytes(range(256)) * 9000
    packed = memoryview(zlib.compress(data, 0))
    assert b"".join(inflate(packed, "run", Limits())) == data
    with pytest.raises(zlib.error, match="ends before"):
        list(inflate(packed[:-8], "run", Limits()))


@pytest.mark.parametrize(("order", "mark"), [("<", b"IM"), (">", b"MI")])
def test_variables_of_a_matlab_file_follow_each_other(order, mark):
    """Packed ones are unpacked; the head tells the order of bytes."""
    packed = zlib.compress(b"second")
    data = b" " * 124 + b"\x00\x01" + mark
    data += struct.pack(f"{order}II", 14, 8) + b"thefirst" + struct.pack(f"{order}II", 15, len(packed)) + packed
    assert matlab_order(data) == order
    first, second = (bytes(v) for v in matlab_elements(data, "run", Limits()))
    assert first[8:] == b"thefirst"
    assert second == b"second"


def test_a_zone_is_ahead_by_its_summer_time_and_leaves_an_hour_out():
    """Berlin in 2026: forward on the 29th of March at 2:00, back on the 25th of October at 3:00."""
    berlin, epoch = ZoneInfo("Europe/Berlin"), datetime(1970, 1, 1)
    march, october = ((datetime(2026, *day) - epoch).total_seconds() for day in ((3, 29), (10, 25)))
    assert [_offset(berlin, march + h * 3600.0, 0) for h in (1, 4)] == [3600.0, 7200.0]
    assert _skipped(berlin, march + 600.0 * np.arange(12)) == np.inf  # up to 1:50
    assert _skipped(berlin, march + 600.0 * np.arange(30)) == march + 7200.0
    assert _moments(berlin, march + 600.0 * np.arange(30)) is None
    whole = october + np.concatenate([60.0 * np.arange(170, 180), 60.0 * np.arange(120, 130)])  # 2:50 to 2:59 and 2:00 again
    moments, guess = _moments(berlin, whole)
    np.testing.assert_array_equal(moments, october - 7200.0 + 60.0 * np.arange(170, 190))
    assert guess == ""
    for minutes, which, zone in ((np.arange(100, 150), "first", 7200.0), (np.arange(130, 200), "second", 3600.0)):
        shown = october + 60.0 * minutes
        told = shown - np.where(minutes < 120, 7200.0, np.where(minutes < 180, zone, 3600.0))
        moments, guess = _moments(berlin, shown)
        np.testing.assert_array_equal(moments, told)
        assert guess.endswith(f"{which} time")


def test_unusual_steps_are_counted():
    """Half of the usual one and a second apart, or back."""
    assert unusual_steps(np.array([0.0, 60.0, 120.0, 211.0, 271.0])) == 0
    assert unusual_steps(np.array([0.0, 60.0, 120.0, 212.0, 272.0])) == 1
    assert unusual_steps(np.array([0.0, 60.0, 0.0, 60.0])) == 1
    assert unusual_steps(np.zeros(1)) == 0


@pytest.mark.parametrize(
    ("name", "unit", "kind"),
    [
        ("Spindle front", "°C", "sensor"),
        ("T3 (ambient) [°C]", "", "ambient"),
        ("Ambient", "°C", "ambient"),
        ("front - room", "°C", "input"),
        ("T1-T2", "°C", "input"),
        ("dT", "°C", "input"),
        ("T_ref", "°C", "input"),
        ("Cold junction", "°C", "input"),
        ("CJC", "°C", "input"),
        ("Reference block", "°C", "sensor"),
        ("Setpoint", "°C", "input"),
        ("Speed", "rpm", "input"),
        ("Power (W)", "", "input"),
        ("Temp phase (A)", "", "sensor"),
        ("Dev1/ai0", "", "input"),
        ("T_Halle", "°C", "ambient"),
        ("R1", "", "nameless"),
        ("bearing", "", "named"),
        ("X growth", "µm", "displacement"),
    ],
)
def test_what_name_and_unit_say_of_a_column(name, unit, kind):
    """A sensor, the room, a difference, the instrument's own, a set point, a load."""
    assert sign_of(name, unit).kind == kind
