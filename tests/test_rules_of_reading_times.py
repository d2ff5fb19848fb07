"""Which column is time, and in which unit: names, neighbours and likely lengths, to either side of each rule."""

from datetime import datetime

import numpy as np
import pytest

import thermofast as tf
from thermofast.errors import InputError, UsageError
from thermofast.reading.moments import time_column, times
from thermofast.reading.moments.time_column import is_time_name
from thermofast.reading.moments.times import find_time
from thermofast.reading.table import Table
from thermofast.reading.values.time_units import unit_of
from thermofast.reading_options import Options

TEMPERATURE = 20.0 + 0.1 * np.arange(12.0)
EPOCH = (datetime(2026, 3, 14) - datetime(1970, 1, 1)).total_seconds()


def _table(units=None, durations=(), **columns):
    columns = {k: v if isinstance(v[0], str) else np.asarray(v, dtype=float) for k, v in columns.items()}
    rows = len(next(iter(columns.values())))
    units = {**dict.fromkeys(columns, ""), **(units or {})}
    return Table("run.csv", list(columns), columns, units, range(1, 1 + rows), (), durations=tuple(durations))


def _found(options=Options(), units=None, durations=(), **columns):  # noqa: B008 - frozen
    return find_time(_table(units, durations, **columns), options)


def _of(**columns):
    """Names of the columns that were taken for time."""
    return set(_found(**columns).used)


@pytest.mark.parametrize(
    ("name", "cell", "unit"),
    [
        ("time_s", "", "s"), ("time_min", "", "min"), ("Zeit [h]", "", "h"), ("time", "(ms)", "ms"), ("t", "[Sek] ", "s"),
        ("seconds of the day", "", "s"), ("day of hours", "", "d"), ("elapsed min s", "", "s"), ("X_Value", "", "s"), ("time", "", None),
        ("time_min", "s", "s"), ("x_value", "", None), ("Tage", "", "d"), ("epoch ns", "", "ns"), ("time µs", "", "us"),
    ],
)  # fmt: skip
def test_the_unit_of_a_column_of_time(name, cell, unit):
    """The unit line first, then the last word that is one; what stands behind 'of' is none."""
    assert unit_of(name, cell) == unit


@pytest.mark.parametrize(
    ("name", "is_time"),
    [
        ("time", True), ("Zeit", True), ("Timestamp", True), ("t", True), ("T", False), ("min", True), ("min [°C]", False),
        ("min [s]", True), ("t1 [s]", True), ("T1 (min)", False), ("T1 [min]", True), ("T1 [s]", True), ("T1 [°C]", False),
        ("time temp", False), ("temperature time", False), ("时间", True), ("t_ms", True), ("t_K", False), ("ValueX", True),
        ("Value X (2)", True), ("valuey", False), ("Time 1", True), ("t1", False), ("s2", False), ("SECONDS", True), ("MIN", False),
        ("TS", False), ("Hours", True), ("front", False), ("T_min", False), ("time/s", True), ("t, s", True), ("t_min2", False),
    ],
)  # fmt: skip
def test_names_of_time(name, is_time):
    """Whole words; a least temperature and a numbered reading are none."""
    assert is_time_name(name) is is_time


def test_two_rows_are_a_record_and_rows_may_be_evenly_spaced_as_told():
    """One is none."""
    with pytest.raises(InputError, match=r"run.csv: 1 row of readings"):
        _found(time_s=[0.0], T=[20.0])
    assert _found(time_s=[0.0, 60.0], T=[20.0, 21.0]).seconds.tolist() == [0.0, 60.0]
    even = _found(Options(interval_s=2.5), time=np.arange(3.0) ** 2, T=np.arange(3.0))
    assert (even.seconds.tolist(), even.used, even.unit) == ([0.0, 2.5, 5.0], {"time"}, "interval")
    assert even.note == "time: one row every 2.5 s, as told"
    with pytest.raises(UsageError, match="--time 'x' is no column"):
        _found(Options(time="x"), time_s=[0.0, 1.0])
    assert _found(Options(time="T"), time_s=np.arange(12.0), T=60.0 * np.arange(12.0)).used == {"T"}


def test_no_column_of_time_is_asked_for():
    """A table of more than twenty times as many columns as rows lies on its side."""
    with pytest.raises(InputError, match="no time column") as told:
        _found(front=TEMPERATURE, rear=TEMPERATURE[::-1])
    assert told.value.found == "front, rear"
    for columns, wide in ((41, True), (40, False)):
        with pytest.raises(InputError, match="no time column") as told:
            _found(**{f"c{k}x": [21.0, 20.0] for k in range(columns)})
        assert ("turn the table" in told.value.do) is wide


def test_a_date_and_a_clock_belong_together():
    """Of any name where no other column is time; written anew where it changes, with points for colons."""
    days, clocks = ["2026-03-14"] * 2 + ["2026-03-15"], ["23:00:00", "23:30:00", "00:00:00"]
    for found in (
        _found(a=days, b=clocks, T=[1, 2, 3]),
        _found(Date=days, Time=clocks, T=[1, 2, 3]),
        _found(Date=["2026-03-14", "", "2026-03-15"], Time=clocks, T=[1, 2, 3]),
        _found(Date=days, Time=[c.replace(":", ".") for c in clocks], T=[1, 2, 3]),
        _found(Date=[20260314, 20260314, 20260315], Time=clocks, T=[1, 2, 3]),
    ):
        assert found.seconds.tolist() == [0.0, 1800.0, 3600.0]
        assert set(found.wall) == {EPOCH + 23 * 3600.0}
        assert (found.dated, found.unit, len(found.used)) == (True, "stamp", 2)
    assert _found(Date=days, Time=clocks, T=[1, 2, 3]).note == "time: stamps in 'Date' and 'Time', from '2026-03-14 23:00:00'"
    assert _of(a=days, b=clocks, time_s=[0.0, 60.0, 120.0]) == {"time_s"}
    assert _of(a=["2026-03-14", "2026-03-15", "2026-03-16"], T=[1, 2, 3]) == {"a"}


def test_a_clock_that_begins_at_nought_beside_dates_is_elapsed_time():
    """And goes on by its usual step where the date changes."""
    days = ["2026-03-14", "2026-03-14", "2026-03-15", "2026-03-15"]
    assert _of(Date=days, Time=["0:00:00", "0:10:00", "0:20:00", "0:30:00"], T=[1, 2, 3, 4]) == {"Time"}
    assert _of(Date=days, Time=["0:20", "0:30", "0:40", "0:50"], T=[1, 2, 3, 4]) == {"Time"}
    assert _of(Date=days, Time=["0:21", "0:31", "0:41", "0:51"], T=[1, 2, 3, 4]) == {"Date", "Time"}
    assert _of(Date=days, Time=["0:00:00", "0:10:00", "0:25:30", "0:35:30"], T=[1, 2, 3, 4]) == {"Date", "Time"}
    assert _of(Date=days, Time=["0:00:00", "0:10:00", "0:25:00", "0:35:00"], T=[1, 2, 3, 4]) == {"Time"}
    same = ["2026-03-14"] * 4
    assert _of(Date=same, Time=["0:00:00", "0:10:00", "0:20:00", "0:30:00"], T=[1, 2, 3, 4]) == {"Date", "Time"}


def test_of_several_stamps_the_one_that_changes_most_is_time():
    """What is the same in all rows, or in most, tells when a step or a query began."""
    each = [f"2026-03-14 08:{k:02d}:00" for k in range(12)]
    assert [time_column._mostly_new([0] * (12 - k) + list(range(1, k + 1))) for k in (5, 6)] == [False, True]
    began, step = ["2026-03-14 07:00:00"] * 12, ["2026-03-14 08:00:00"] * 6 + ["2026-03-14 08:06:00"] * 6
    assert _of(began=began, when=each, T=TEMPERATURE) == {"when"}
    assert _of(timestamp=began, when=each, T=TEMPERATURE) == {"when"}
    assert _of(timestamp=step, time=each, T=TEMPERATURE) == {"time"}
    assert _of(time=each, stamp=each, T=TEMPERATURE) == {"time"}
    assert _of(x=each, time=each, T=TEMPERATURE) == {"time"}
    assert _of(x=each, time_s=np.arange(12.0), T=TEMPERATURE) == {"time_s"}


def test_of_several_columns_of_numbers_the_one_that_ascends_with_a_unit():
    """Then an epoch, then one that ascends; a bare s, min or h behind another is no time."""
    up = 60.0 * np.arange(12.0)
    assert _of(time=up, time_s=up, T=TEMPERATURE) == {"time_s"}
    assert _of(time_s=up[::-1], zeit_s=up, T=TEMPERATURE) == {"zeit_s"}
    assert _of(time=up, timestamp=EPOCH + up, T=TEMPERATURE) == {"timestamp"}
    assert _of(time_s=up, s=up, T=TEMPERATURE) == {"time_s"}
    assert _of(time=up, min=up / 60.0, T=TEMPERATURE) == {"time"}
    assert _of(min=up / 60.0, s=up, T=TEMPERATURE) == {"min"}
    cycle = np.tile([0.0, 60.0, 120.0, 180.0], 3)
    assert _of(cycle_time_s=cycle, total_time_s=up, T=TEMPERATURE) == {"total_time_s"}
    assert _of(min=TEMPERATURE - 1.0, max=TEMPERATURE + 1.0, time_s=up) == {"time_s"}
    assert _of(uptime_s=np.full(12, 7.0), elapsed_s=up, T=TEMPERATURE) == {"elapsed_s"}
    assert _of(**{"column 1": up, "column 2": TEMPERATURE}) == {"column 1"}
    assert _found(units={"b": "[min]"}, b=np.arange(12.0), T=TEMPERATURE).seconds[1] == 60.0
    with pytest.raises(InputError, match="no time column"):
        _found(units={"b": "min", "c": "min"}, b=np.arange(12.0), c=np.arange(12.0), T=TEMPERATURE)
    with pytest.raises(InputError, match="no time column"):
        _found(**{"column 1": TEMPERATURE[::-1], "column 2": TEMPERATURE})


@pytest.mark.parametrize(
    ("name", "step", "seconds", "unit"),
    [
        ("time_s", 30.0, 30.0, "s"), ("time_min", 0.5, 30.0, "min"), ("time_h", 0.25, 900.0, "h"), ("time_ms", 500.0, 0.5, "ms"),
        ("time_d", 0.25, 21600.0, "d"), ("Time (100ms)", 5.0, 0.5, "stamp"), ("Time [x10 s]", 3.0, 30.0, "stamp"),
        ("Time [1 min]", 3.0, 180.0, "stamp"), ("Time (0,5 h)", 1.0, 1800.0, "stamp"),
    ],
)  # fmt: skip
def test_numbers_in_their_unit(name, step, seconds, unit):
    """Of the name; also where it counts steps of one."""
    found = _found(**{name: step * np.arange(12.0), "T": TEMPERATURE})
    assert found.seconds == pytest.approx(seconds * np.arange(12.0))
    assert found.unit == unit
    assert bool(found.guesses) is ("x10" in name or "100" in name or "0,5" in name)


def test_minutes_and_seconds_with_a_point_are_told_by_the_name():
    """Up to 59 seconds; as serial days and as a countdown, too."""
    found = _found(**{"Time [min.sec]": [0.0, 0.3, 0.59, 1.0, 1.3], "T": TEMPERATURE[:5]})
    assert found.seconds.tolist() == [0.0, 30.0, 59.0, 60.0, 90.0]
    assert "in minutes and seconds" in found.guesses[0].text
    down = _found(**{"time remaining [s]": 600.0 - 60.0 * np.arange(11.0), "T": TEMPERATURE[:11]})
    assert (down.seconds.tolist(), down.dated) == ([60.0 * k for k in range(11)], False)
    assert down.note.endswith(", counted down")
    up = _found(**{"time remaining [s]": np.arange(11.0), "T": TEMPERATURE[:11]})
    assert up.seconds.tolist() == list(range(11))
    days = _found(time=36526.0 + np.arange(12.0) / 96.0, T=TEMPERATURE)
    assert (days.seconds.tolist(), days.unit) == ([900.0 * k for k in range(12)], "d")
    assert days.guesses[0].text == "'time' read as serial days of a spreadsheet (one is 36526)"


def test_moments_as_numbers():
    """Epochs, ticks, and dates without signs, alone or beside a clock."""
    for unit, size in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        found = _found(time=size * (EPOCH + 60.0 * np.arange(12)), T=TEMPERATURE)
        assert found.seconds == pytest.approx(60.0 * np.arange(12))
        assert (found.unit, found.dated, found.note) == (unit, True, f"time: 'time', an epoch in {unit}")
    ticks = (EPOCH + 62135596800.0 + 60.0 * np.arange(12)) * 1e7
    assert _found(time=ticks, T=TEMPERATURE).seconds == pytest.approx(60.0 * np.arange(12), abs=1e-4)
    whole = _found(time=20260314080000.0 + 100.0 * np.arange(12), T=TEMPERATURE)
    assert (whole.seconds.tolist(), whole.wall) == ([60.0 * k for k in range(12)], (EPOCH + 8 * 3600.0,) * 2)
    beside = _found(date=np.full(12, 20260314.0), time=80000.0 + 100.0 * np.arange(12), T=TEMPERATURE)
    assert (beside.seconds.tolist(), beside.used) == ([60.0 * k for k in range(12)], {"date", "time"})
    assert beside.guesses == ()
    short = _found(date=np.full(12, 20260314.0), time=800.0 + np.arange(12), T=TEMPERATURE)
    assert (short.seconds.tolist(), short.guesses[0].text) == (
        [60.0 * k for k in range(12)],
        "'time' read as hours and minutes (0800)",
    )
    minutes = _found(date=np.full(12, 20260314.0), min=np.arange(12.0), T=TEMPERATURE)
    assert minutes.used == {"min"}


def test_a_unit_that_is_told_wins_and_durations_have_theirs():
    """Also over an epoch and serial days."""
    up = np.arange(12.0)
    assert _found(Options(time_unit="h"), time_s=up, T=TEMPERATURE).seconds[1] == 3600.0
    assert _found(Options(time_unit="s"), time=EPOCH + up, T=TEMPERATURE).seconds[1] == EPOCH + 1.0
    assert _found(Options(time_unit="s"), time=36526.0 + up / 96.0, T=TEMPERATURE).seconds[0] == 36526.0
    with pytest.raises(UsageError, match="holds durations"):
        _found(Options(time_unit="s"), units={"time": "s"}, durations=["time"], time=up, T=TEMPERATURE)
    assert _found(Options(time_format="%H%M"), time=[800.0, 801.0, 830.0], T=[1, 2, 3]).seconds.tolist() == [0.0, 60.0, 1800.0]


def test_rows_without_a_time_are_named():
    """By the first line; numbers from 1e30 on are no time, and a second table may begin there."""
    up = 60.0 * np.arange(12.0)
    up[[5, 7]] = np.nan
    with pytest.raises(InputError, match="line 7, column 'time_s': no time in this row") as told:
        _found(time_s=up, T=TEMPERATURE)
    assert told.value.found == "2 rows without a time"
    up[[5, 7]] = 300.0, -1e30
    with pytest.raises(InputError, match="line 9") as told:
        _found(time_s=up, T=TEMPERATURE)
    assert told.value.found == "1 row without a time"
    assert "--skip-footer 5" in told.value.do
    assert "another table" not in told.value.do
    up[7:] = np.nan, 360.0, 420.0, 480.0, 540.0
    with pytest.raises(InputError) as told:
        _found(time_s=up, T=TEMPERATURE)
    assert "if another table begins in line 9" in told.value.do
    up[8] = 361.0
    with pytest.raises(InputError) as told:
        _found(time_s=up, T=TEMPERATURE)
    assert "another table" not in told.value.do


def test_a_unit_is_guessed_where_one_alone_makes_a_likely_record():
    """Else the user is asked, with the lengths; steps that jitter may be a few minutes of seconds."""
    found = _found(time=30.0 * np.arange(101.0), T=20.0 + np.arange(101.0))
    assert (found.seconds[1], found.unit) == (30.0, "s")
    assert found.guesses[0].text == "'time' has no unit, taken as s: the record is then 50 min long"
    assert _found(time=0.5 * np.arange(101.0), T=20.0 + np.arange(101.0)).unit == "min"
    assert _found(time=0.005 * np.arange(401.0), T=20.0 + np.arange(401.0)).unit == "h"
    clock = _found(time=np.arange(61.0) / 1440.0, T=20.0 + np.arange(61.0))
    assert (clock.unit, clock.seconds[1]) == ("d", pytest.approx(60.0))
    with pytest.raises(InputError, match="does not say its unit of time") as told:
        _found(time=5.0 * np.arange(200.0), T=20.0 + np.arange(200.0))
    assert told.value.found == "0 to 995: in s 16.6 min, in min 16.6 h, in h 41.5 d"
    jitter = 1.0 + 0.02 * np.random.default_rng(0).standard_normal(150)
    with pytest.raises(InputError, match="does not say its unit"):
        _found(time=np.cumsum(jitter), T=20.0 + np.arange(150.0))
    assert _found(time=np.arange(150.0), T=20.0 + np.arange(150.0)).unit == "min"


def test_another_column_of_time_tells_the_unit():
    """One that runs as fast, to a hundredth and two seconds."""
    up = np.arange(12.0)
    stamps = [f"08:{5 * k:02d}:00" for k in range(12)]
    table = _table(time=up * 5.0, clock=stamps, T=TEMPERATURE)
    assert times._without_unit(table, "time", table.columns["time"]).note == "time: 'time' in min, as 'clock' shows"
    for factor, unit in ((60.0, "min"), (60.5, "min"), (61.0, None), (1.0, "s"), (0.0, None)):
        table = _table(time=up * 10.0, zeit_s=up * 10.0 * factor, T=TEMPERATURE)
        assert times._same_time(table, "zeit_s", table.columns["time"]) == unit
    for late, unit in ((1.8, "s"), (2.2, None)):
        table = _table(time=up * 10.0, zeit_s=up * 10.0 + late * (up == 1.0), T=TEMPERATURE)
        assert times._same_time(table, "zeit_s", table.columns["time"]) == unit
    table = _table(time=up, min=up, T=TEMPERATURE)
    assert times._same_time(table, "min", table.columns["time"]) is None
    assert [times.length_of(s) for s in (119.0, 120.0, 7199.0, 7200.0, 172799.0, 172800.0)] == [
        "119 s", "2 min", "120 min", "2 h", "48 h", "2 d",
    ]  # fmt: skip


def test_columns_beside_a_stamp_belong_to_it():
    """Milliseconds of whole seconds, halves of the day; a heading that says UTC is never changed."""
    whole, ms = ["08:00:00", "08:00:00", "08:00:01"], [0.0, 500.0, 250.0]
    found = _found(time=whole, ms=ms, T=[1, 2, 3])
    assert (found.seconds.tolist(), found.used) == ([0.0, 0.5, 1.25], {"time", "ms"})
    for wrong in ([0.0, 500.0, 1000.0], [-1.0, 0.0, 1.0], [0.5, 1.0, 2.0]):
        assert _found(time=whole, millitm=wrong, T=[1, 2, 3]).used == {"time"}
    assert _found(time=whole, millitm=[0.0, 500.0, 999.0], T=[1, 2, 3]).seconds.tolist() == [0.0, 0.5, 1.999]
    assert _found(time=["08:00:00.5", "08:00:01", "08:00:02"], ms=ms, T=[1, 2, 3]).used == {"time"}
    half = _found(time=["11:59:00", "12:00:00", "1:00:00"], x=["AM", "pm", "PM"], T=[1, 2, 3])
    assert (half.seconds.tolist(), half.used) == ([0.0, 60.0, 3660.0], {"time", "x"})
    dates = [f"2026-03-14 08:0{k}:00" for k in range(3)]
    assert _found(time=dates, T=[1, 2, 3]).wall != ()
    assert _found(**{"time UTC": dates, "T": [1, 2, 3]}).wall == ()
    padded = _found(time=["08:00:00.50", "08:00:00.100", "08:00:00.150"], T=[1, 2, 3])
    assert padded.seconds == pytest.approx([0.0, 0.05, 0.1])
    assert padded.note.endswith(", milliseconds written without leading zeros")


def test_a_clock_without_signs_is_told_as_a_guess():
    """Numbers of six digits that jump at every minute."""
    numbers = [80530, 80600, 80630, 80700, 80730]
    for name in ("time", "time_s"):
        found = _found(**{name: numbers, "T": TEMPERATURE[:5]})
        assert found.seconds.tolist() == [0.0, 30.0, 60.0, 90.0, 120.0]
        assert found.guesses[0].text == f"{name!r} read as a clock without signs (080530 is 08:05:30)"


def test_minutes_and_seconds_that_cannot_be_are_minutes_with_decimals(tmp_path):
    """Under `min.sec` 0.75 is no minute and 75 seconds: read as minutes, and told as a guess."""
    path = tmp_path / "run.csv"
    path.write_text("Time [min.sec],T1 [degC]\n" + "".join(f"{0.75 * k:.2f},{20 + 0.01 * k:.2f}\n" for k in range(160)))
    run = tf.read(path)
    assert run.time_s[:3].tolist() == [0.0, 45.0, 90.0]
    assert any("minutes, with decimals" in guess.text for guess in run.guesses)
