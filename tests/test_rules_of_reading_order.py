"""How rows are put on one clock, to either side of each rule: stamps of several readings, other clocks, hours, sensors in turn."""

from datetime import datetime

import numpy as np
import pytest

from thermofast.errors import InputError, UsageError
from thermofast.reading.moments import order
from thermofast.reading.moments.glitches import without_repeats
from thermofast.reading.moments.in_turn import each_in_turn
from thermofast.reading.moments.times import Time
from thermofast.reading.table import Table

SUNDAY = (datetime(2024, 10, 27) - datetime(1970, 1, 1)).total_seconds()
MARCH = (datetime(2024, 3, 31) - datetime(1970, 1, 1)).total_seconds()


def _spread(sizes, step=10.0, of=None):
    time = np.repeat(step * np.arange(float(len(sizes))), sizes)
    column = np.arange(float(len(time))) if of is None else np.asarray(of, dtype=float)
    edges = np.flatnonzero(np.r_[True, np.diff(time) > 0])
    found = order.spread_evenly(time, {"T": column}, edges)
    return None if found is None else found.tolist()


def test_readings_of_one_stamp_are_put_evenly_between_it_and_the_next():
    """Of as many each, but for the first and the last stamp; the first ones may have been cut off."""
    assert _spread([2] * 5) == [5.0 * k for k in range(10)]
    assert _spread([1, 2, 2, 2, 1]) == [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0]
    assert _spread([3, 2, 2, 2, 3]) == pytest.approx([0, 10 / 3, 20 / 3, 10, 15, 20, 25, 30, 35, 40, 130 / 3, 140 / 3])
    assert _spread([2, 2, 2, 2]) is None
    assert _spread([2, 1, 1, 1, 2]) is None
    assert _spread([2, 3, 3, 1, 3, 3]) is None
    assert _spread([2, *[3] * 9, 1, 2]) is not None
    assert _spread([2, *[3] * 9, 4, 2]) is not None
    assert _spread([2] * 5, of=np.repeat(np.arange(5.0), 2)) is None


def _otherwise(own, alike=False, before=True, main=None, behind=True):
    main = 60.0 * np.arange(12.0) if main is None else np.asarray(main, dtype=float)
    own = own if isinstance(own[0], str) else np.asarray(own, dtype=float)
    columns = {"time": main} | ({"T1": main} if before else {}) | {"clock": own} | ({"T2": main} if behind else {})
    table = Table("run.csv", list(columns), columns, dict.fromkeys(columns, ""), range(len(main)), ())
    return order.runs_otherwise(table, Time(main, frozenset({"time"}), ""), "time", "clock", alike)


def test_another_clock_goes_on_but_not_as_the_time_does():
    """In no unit, by more than a step and a hundredth of the record; readings stand before it and behind it."""
    up = np.arange(12.0)
    assert _otherwise(66.0 * up)
    for scale in (1e-9, 1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0):
        assert not _otherwise(60.0 * up / scale + 5.0)
    assert not _otherwise(66.0 * up, before=False)
    assert not _otherwise(66.0 * up, behind=False)
    assert _otherwise(66.0 * up, alike=True, before=False, behind=False)
    words = {"time": 60.0 * up, "T1": up, "clock": 66.0 * up, "note": ["x"] * 12, "T2": up}
    table = Table("run.csv", list(words), words, dict.fromkeys(words, ""), range(12), ())
    assert not order.runs_otherwise(table, Time(60.0 * up, frozenset(), ""), "time", "clock")
    counter = np.repeat(36.0 * np.arange(250.0), 3)
    assert order.unwrapped(counter % 3600.0)[0] == pytest.approx(counter)
    assert not _otherwise(65.0 * up)  # 55 s late after 11 steps of 60 s
    back = 66.0 * up
    back[5] = back[4]
    assert not _otherwise(back)
    assert _otherwise(back, alike=True)
    back[8] = back[7]
    assert not _otherwise(back, alike=True)
    few = np.r_[66.0 * up[:6], np.full(6, np.nan)]
    assert _otherwise(few * 5.0)
    few[5] = np.nan
    assert not _otherwise(few * 5.0)
    assert not _otherwise(66.0 * up, main=np.zeros(12))


def test_another_clock_of_stamps():
    """Half of its cells must be moments."""
    cells = [f"08:{5 * k:02d}:30" for k in range(12)]
    assert _otherwise(cells)
    assert _otherwise([c if k < 6 else "hot" for k, c in enumerate(cells)])
    assert not _otherwise([c if k < 5 else "hot" for k, c in enumerate(cells)])
    assert not _otherwise([f"08:{k:02d}:30" for k in range(12)])


def test_readings_go_on_where_a_clock_falls_back():
    """By five usual steps, or a twentieth of what they cover."""
    back = np.array([5])
    steps = np.full(11, 0.1)
    for jump, on in ((0.49, True), (0.51, False)):
        column = np.cumsum(np.r_[20.0, np.where(np.arange(11) == 5, jump, steps)])
        assert order._goes_on({"T": column}, back) is on
    flat = np.r_[np.zeros(6), np.full(5, 4.9), 100.0]
    assert order._goes_on({"T": flat}, back)
    assert not order._goes_on({"T": np.where(flat == 4.9, 5.1, flat)}, back)
    assert order._goes_on({"T": np.full(12, np.nan)}, back)
    assert not order._goes_on({"a": flat, "T": np.r_[np.zeros(6), np.ones(6)]}, back)


def test_an_hour_is_looked_for_where_rows_are_evenly_apart():
    """Eight steps at least, of an hour at most; four in five as usual, to a fifth and a second."""
    for count, step, found in ((9, 600.0, True), (8, 600.0, False), (20, 3600.0, True), (20, 3700.0, False)):
        time = step * np.arange(float(count))
        time[5:] -= 3600.0
        assert (order.clock_change(time, (SUNDAY,))[1] is not None) is found, (count, step)
    for uneven, found in ((3, True), (4, False)):
        time = np.r_[0.0, np.cumsum(np.where(np.arange(20) < uneven, 730.0, 600.0))]
        time[12:] -= 3600.0
        assert (order.clock_change(time, (SUNDAY,))[1] is not None) is found
    near = np.r_[0.0, np.cumsum(np.where(np.arange(20) % 3 == 1, 690.0, 600.0))]
    near[13:] -= 3600.0
    assert order.clock_change(near, (SUNDAY,))[1] is not None
    for late, found in ((181.0, True), (183.0, False)):
        time = 600.0 * np.arange(20.0)
        time[12:] -= 3600.0 + late
        assert (order.clock_change(time, (SUNDAY,))[1] is not None) is found
    time = 600.0 * np.arange(80.0)
    for k in range(1, 6):
        time[10 * k :] -= 3600.0
    assert order.clock_change(time, (SUNDAY,))[1] is None
    assert order.clock_change(time[:50], (SUNDAY,))[1] is not None
    both = 600.0 * np.arange(110.0) + 3600.0 * (np.arange(110) >= 10)  # a gap on Saturday stays
    found, guess = order.clock_change(both - 3600.0 * (np.arange(110) >= 80), (SUNDAY - 43200.0,))
    assert found == pytest.approx(both)
    assert "put forward" not in guess.text
    for month, taken in ((3, True), (4, True), (9, True), (10, True), (11, True), (2, False), (5, False), (8, False), (12, False)):
        first = next(d for d in range(1, 8) if datetime(2024, month, d).weekday() == 6)
        start = (datetime(2024, month, first) - datetime(1970, 1, 1)).total_seconds()
        time = 600.0 * np.arange(20.0)
        time[8:] += 3600.0
        assert (order.clock_change(time, (start,))[1] is not None) is taken
        assert (order.clock_change(time, (86400.0, start))[1] is not None) is taken


@pytest.mark.parametrize(
    ("begins", "ends", "told"),
    [(1.9, 3.0, True), (1.9, 2.99, False), (2.0, 3.5, False), (0.5, 3.0, True), (1.5, 26.0, False), (1.0, 20.0, True)],
)
def test_a_gap_across_an_hour_that_no_clock_told(begins, ends, told):
    """From before two to three or later of the same Sunday, and of more than an hour."""
    step = np.array([600.0, (ends - begins) * 3600.0])
    time = np.r_[begins * 3600.0 - 600.0, begins * 3600.0, ends * 3600.0]
    assert (order._hidden_hour(time, step, (MARCH,), 600.0) is not None) is told
    assert order._hidden_hour(time, step, (MARCH - 86400.0, SUNDAY), 600.0) is None


def test_a_calendar_of_twelve_hours_needs_both_of_its_jumps():
    """A day too far at noon or midnight, half a day back an hour later, each to two usual steps."""
    true = 300.0 * np.arange(40.0)
    for off, found in ((0.0, True), (590.0, True), (610.0, False)):
        written = true.copy()
        written[10:] += 86400.0 + off
        written[22:] -= 43200.0
        assert (order.half_days(written)[1] is not None) is found
    for times in (true, true[:1], true[:0], np.zeros(5)):
        assert order.half_days(times)[1] is None


def test_a_second_run_has_five_rows_and_overlaps_the_first_in_three():
    """Of rows that fall back all the time nothing is a run."""
    first = np.arange(10.0)
    assert order.restarts(np.r_[first, first, first + 100.0]) == [10]
    assert order.restarts(np.tile(np.arange(5.0), 50)) != []
    assert order.restarts(np.tile([1.0, 0.0], 60)) == []
    assert order.restarts(np.r_[first, [3.0, 2.0, 1.0], first]) == [13]
    assert order.earlier_stretches(np.r_[first + 20.0, first + 10.0, first]) == [10, 20]
    assert order.earlier_stretches(np.r_[first + 20.0, first + 11.5]) == []


def test_names_that_stand_again_begin_a_run_where_time_falls_back_or_waits():
    """Twenty usual steps, of a second at least; five rows to either side."""
    time = np.r_[np.arange(10.0), 9.0 + 20.5 + np.arange(10.0)]
    lines = list(range(1, 11)) + list(range(12, 22))
    assert order._after_headers(time, lines, [11]) == [10]
    assert order._after_headers(np.r_[np.arange(10.0), 28.5 + np.arange(10.0)], lines, [11]) == []
    assert order._after_headers(0.1 * time, lines, [11]) == []
    assert order._after_headers(np.r_[np.arange(10.0), np.arange(10.0)], lines, [11]) == [10]
    assert order._after_headers(np.r_[np.arange(5.0), 50.0 + np.arange(15.0)], list(range(1, 6)) + list(range(7, 22)), [6]) == [5]
    assert order._after_headers(np.r_[np.arange(4.0), 50.0 + np.arange(15.0)], list(range(1, 5)) + list(range(6, 21)), [5]) == []
    assert order._after_headers(np.r_[np.arange(15.0), 50.0 + np.arange(4.0)], list(range(1, 16)) + list(range(17, 21)), [16]) == []


def test_readings_at_one_stamp_that_are_two_sensors_are_refused():
    """By more than eight of what the means do; by their lines."""
    time = np.repeat(10.0 * np.arange(10.0), 2)
    column = np.repeat(20.0 + 0.1 * np.arange(10.0), 2) + 5.0 * (np.arange(20) % 2)
    with pytest.raises(InputError, match="differ by far more than their noise") as told:
        order.in_order(time, {"T": column}, "run.csv", range(1, 21))
    assert told.value.found == "T, as at lines 2 and 3"
    with pytest.raises(UsageError, match="all rows carry the same time stamp"):
        order.in_order(np.zeros(4), {"T": np.arange(4.0)}, "run.csv", range(4))
    edges = np.arange(0, 20, 2)
    for move, apart, differ in (
        (0.1, 0.79, False),
        (0.1, 0.81, True),
        (0.005, 0.049, False),
        (0.005, 0.051, True),
        (0.0, 0.2, True),
    ):
        values = np.repeat(20.0 + move * np.arange(10.0), 2) + apart * (np.arange(20) % 2)
        assert order._differ(values, order._mean(values, edges), edges) is differ, (move, apart)
    coarse = np.repeat(np.repeat([20.0, 20.5, 21.0], [3, 4, 3]), 2) + 0.5 * (np.arange(20) % 2)
    assert order._differ(coarse, order._mean(coarse, edges), edges) is True


def test_each_sensor_of_a_long_table_has_its_clock_mended_alone():
    """Hours told twice, days gone by and stamps of several readings; rows that tell nothing stay within."""
    nan = np.nan
    clock = Time(np.repeat(60.0 * np.arange(5.0), 4), frozenset(), "", dated=True)
    a = np.where(np.arange(20) % 2 == 0, np.arange(20.0), nan)
    found, guesses = each_in_turn(clock, {"a": a, "b": np.where(np.isnan(a), np.arange(20.0), nan)})
    assert found.seconds[::2].tolist() == [30.0 * k for k in range(10)]
    assert found.seconds[1::2].tolist() == [30.0 * k for k in range(10)]
    assert [g.text for g in guesses] == [order.SPREAD.text]
    rows = np.r_[np.arange(20.0), np.arange(20.0)]
    wall = Time(600.0 * rows - 3600.0 * (rows >= 8), frozenset(), "", wall=(SUNDAY,), dated=True)
    one = np.where(np.arange(40) < 20, 20.0 + 0.1 * rows, nan)
    found, guesses = each_in_turn(wall, {"a": one, "b": np.where(np.isnan(one), 20.0 + 0.1 * rows, nan)})
    assert found.seconds.tolist() == (600.0 * rows).tolist()
    assert len(guesses) == 1
    days = Time(np.r_[3600.0 * np.arange(4.0), 86400.0 + 3600.0 * np.arange(4.0)], frozenset(), "", unit="stamp")
    split = {"a": np.r_[np.arange(4.0), np.full(4, nan)], "b": np.r_[np.full(4, nan), np.arange(4.0)]}
    assert each_in_turn(days, split)[0].seconds.tolist() == [0.0, 3600.0, 7200.0, 10800.0] * 2
    two = Time(days.seconds[[0, 1, 4, 5]], frozenset(), "", unit="stamp")
    pairs = {"a": np.array([1.0, 2.0, nan, nan]), "b": np.array([nan, nan, 1.0, 2.0])}
    assert each_in_turn(two, pairs)[0].seconds.tolist() == [0.0, 3600.0] * 2
    assert each_in_turn(two, {"a": np.full(4, nan)})[0].seconds.tolist() == two.seconds.tolist()
    again = Time(days.seconds, frozenset(), "", unit="stamp", dated=True)
    assert each_in_turn(again, split)[0].seconds.tolist() == days.seconds.tolist()
    silent = Time(np.r_[-50.0, 10.0 * np.arange(6.0), 99.0], frozenset(), "")
    held = np.r_[nan, np.arange(6.0), nan]
    assert each_in_turn(silent, {"a": held})[0].seconds.tolist() == [0.0, 0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 50.0]
    newest = Time(10.0 * np.arange(9.0)[::-1], frozenset(), "")
    assert each_in_turn(newest, {"a": np.arange(9.0)})[0].seconds.tolist() == newest.seconds.tolist()
    lone = Time(np.array([5.0, 0.0]), frozenset(), "")
    assert each_in_turn(lone, {"a": np.array([1.0, nan]), "b": np.array([nan, 1.0])})[0].seconds.tolist() == [5.0, 0.0]


def _once(time, *columns):
    time = np.asarray(time, dtype=float)
    named = {f"T{i}": np.asarray(c, dtype=float) for i, c in enumerate(columns)}
    kept, notes = without_repeats(time, named, range(1, len(time) + 1))
    return kept.tolist(), notes


def test_rows_of_exports_that_overlap_are_there_once():
    """All that stood from that time on must stand again, in every column, and say something."""
    time, reading = [0, 1, 2, 3, 2, 3, 4], [5.0, 6, 7, np.nan, 7, np.nan, 8]
    assert _once(time, [5, 6, 7, 8, 7, 8, 9]) == ([0, 1, 2, 3, 6], ("rows written twice left out: lines 6 to 7",))
    assert _once(time, reading, [1, 2, 3, 4, 3, 4, 5])[0] == [0, 1, 2, 3, 6]
    assert _once(time, [5, 6, 7, 8, 7, 8.1, 9]) == (list(range(7)), ())
    assert _once(time, [5, 6, 7, 8, 7, 8, 9], [1, 2, 3, 4, 3, 5, 5]) == (list(range(7)), ())
    assert _once(time, [5, 6, 7, 7, 7, 7, 9]) == (list(range(7)), ())  # a clock set back while nothing moved
    assert _once([0, 1, 2, 2, 3], [1, 2, 3, 3, 4]) == (list(range(5)), ())
    assert _once([0, 1, 2, 1, 2], [1, 2, 3, 2, 3])[0] == [0, 1, 2]
    assert _once([0, 1, 2, 1], [1, 2, 3, 2]) == (list(range(4)), ())
    assert _once([0, 1, 2, 0, 1, 2], [1, 2, 3, 1, 2, 3])[0] == list(range(6))  # a run that begins anew
