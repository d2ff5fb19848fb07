"""Which column is what, clocks of single columns, and tables that are in memory or in files of measurement programs."""

import datetime as dt

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from thermofast.errors import InputError, UsageError
from thermofast.reading import columns
from thermofast.reading.headings import called
from thermofast.reading.signs import sign_of
from thermofast.reading.table import Table, words_or_numbers
from thermofast.reading.tables import clocks, measured, workbook
from thermofast.reading.tables.frames import table_of
from thermofast.reading_options import Options

WARMING = 20.0 + 0.13 * np.arange(60.0) ** 0.9


def _roles(units=None, options=Options(), origin="header", **values):  # noqa: B008 - frozen
    values = {k: np.array(v, dtype=float) for k, v in values.items()}
    return columns.classify(list(values), values, units or {}, options, "run.csv", origin)


def _table(units=None, **given):
    given = {k: v if isinstance(v[0], str) else np.asarray(v, dtype=float) for k, v in given.items()}
    units = {**dict.fromkeys(given, ""), **(units or {})}
    return Table("run.csv", list(given), given, units, range(1, 1 + len(next(iter(given.values())))), ())


def test_the_user_says_first_what_a_column_is():
    """Then unit and name; where sensors are named all others are none."""
    found = _roles(T1=WARMING, T2=WARMING, T3=WARMING, options=Options(ambient="T1", inputs=("T2",)))
    assert (found.ambient, found.inputs, found.sensors) == (("T1",), ("T2",), ("T3",))
    named = _roles(T1=WARMING, x=WARMING, room=WARMING, load=WARMING, options=Options(channels=("x",)))
    assert (named.sensors, named.ambient, named.inputs) == (("x",), ("room",), ("load",))
    assert named.notes == ()
    assert _roles(T1=WARMING, T2=WARMING, options=Options(exclude=("T2",))).sensors == ("T1",)
    assert _roles(room=WARMING, hall=WARMING, T1=WARMING, options=Options(ambient="hall")).ambient == ("hall",)
    for options, told in (
        (Options(channels=("y",)), "--channels 'y'"),
        (Options(inputs=("y",)), "--inputs"),
        (Options(ambient="y"), "--am"),
    ):
        with pytest.raises(UsageError, match=told):
            _roles(T1=WARMING, options=options)


def test_columns_that_tell_nothing_are_left_out_by_what_they_are():
    """Counters, those without readings, and those that never change."""
    n = np.arange(60.0)
    found = _roles(n=n, T1=WARMING, x=np.full(60, np.nan), y=np.full(60, 7.0), machine=np.full(60, 3.0))
    assert found.sensors == ("T1",)
    assert found.notes == (
        "row counters left out: n",
        "columns without readings left out: x",
        "columns that never change left out: y is 7, machine is 3",
    )
    assert _roles(y=np.full(9, 7.0), z=WARMING[:9]).sensors == ("y", "z")
    assert _roles(y=np.full(10, 7.0), z=WARMING[:10]).sensors == ("z",)
    assert "alarm" not in _roles(alarm=np.zeros(60), T1=WARMING).inputs
    assert _roles(alarm=n % 2, T1=WARMING).inputs == ("alarm",)


@pytest.mark.parametrize(
    ("name", "column", "counts"),
    [
        ("foo", np.arange(6.0), True), ("foo", np.arange(1.0, 7.0), True), ("foo", np.arange(5.0), False),
        ("foo", np.arange(2.0, 8.0), False), ("index", np.arange(5.0, 9.0), True), ("index", [5.0, 7.0, 9.0], False),
        ("index", [5.0, 6.0, 7.0, 9.0], True), ("index", [9.0, 8.0, 7.0], True), ("index", [5.0], False), ("index", [5.0, 5.0, 6.0, 7.0, 8.0], False), ("#", [1.0, 2.0], True),
        ("T1", np.arange(21.0), True), ("T1", np.arange(20.0), False), ("T1", np.arange(2.0, 30.0), False), ("n", [3.0, 4.0], True),
        ("foo", np.arange(6.0) + 0.5, False), ("foo", [0.0, 1.0, 2.0, 3.0, np.nan, 5.0, 6.0], False), ("foo", 2.0 * np.arange(8.0), False),
    ],
)  # fmt: skip
def test_a_column_that_counts_the_rows(name, column, counts):
    """From nought or one in steps of one, or under a name that says so."""
    assert bool(columns._counts(name, sign_of(name, ""), np.array(column, dtype=float))) is counts


def test_where_others_say_that_they_are_temperatures_codes_are_none():
    """Told as a guess; in a table without names all are taken, and it is said."""
    found = _roles(front_degC=WARMING, S1=WARMING)
    assert found.sensors == ("front_degC",)
    assert found.guesses[0].text == "no temperatures, as neither name nor unit says so: S1"
    alone = _roles(S1=WARMING, S2=WARMING + 1.0)
    assert alone.sensors == ("S1", "S2")
    assert alone.guesses[0].text == "taken for temperatures, though neither name nor unit says so: S1, S2"
    assert _roles(S1=WARMING, origin="none").guesses[0].text == "taken for temperatures, though no header: S1"
    assert _roles(S1=WARMING, origin="long").guesses == ()
    assert _roles(front_degC=WARMING, S1=WARMING, origin="long").sensors == ("front_degC", "S1")
    assert _roles(S1=WARMING, step=np.repeat([1.0, 2.0, 3.0], 20), S2=WARMING).sensors == ("S1", "S2")
    assert _roles(S1=WARMING, S3=np.repeat([1.0, 2.0, 3.0], 17)[:51].tolist() + [3.0] * 9).sensors == ("S1",)
    assert _roles(S1=WARMING, S3=np.tile([1.0, 2.0, 3.0, 4.0], 15)).sensors == ("S1", "S3")
    assert [columns._code(np.tile([1.0, 2.0, 3.0], 17)[:n]) for n in (50, 51)] == [False, True]
    assert _roles(bearing=WARMING, front=np.arange(60.0) % 2).sensors == ("bearing",)
    assert _roles(T_front=WARMING, bearing=np.full(60, 1000.5) + WARMING).sensors == ("T_front",)
    assert _roles(T_front=WARMING, bearing=WARMING + 900.0).sensors == ("T_front", "bearing")
    assert _roles(T1=WARMING, n1=WARMING).sensors == ("T1",)
    assert _roles(coolant_degC=WARMING, S1=WARMING, S2=WARMING + 9.0).sensors == ("coolant_degC", "S1", "S2")
    assert _roles(coolant_degC=WARMING, S1=WARMING, S2=WARMING + 11.0).sensors == ("coolant_degC",)
    assert _roles(coolant_degC=WARMING, S1=WARMING).sensors == ("coolant_degC",)


def test_differences_extremes_and_bands_of_others_are_no_sensors():
    """By their names, and bands by being as far to either side in every row."""
    assert columns._differences(["T1", "T2", "T1-T2", "T1 - T3", "t1 [K] - T2"]) == ["T1-T2"]
    assert columns._extremes(["T1 avg", "T1 min", "T1 max", "T2 min"]) == ["T1 min", "T1 max"]
    assert columns._extremes(["T1", "T1 max"]) == ["T1 max"]
    assert columns._extremes(["T1 min", "T1 max"]) == []
    assert columns._extremes(["T1", "T1 min", "T1 max"]) == []
    assert columns._extremes(["T1 [°C]", "T1 std [°C]"]) == ["T1 std [°C]"]
    assert columns._extremes(["a", "b"]) == []
    values = {
        "T1": WARMING,
        "T1_lo": WARMING - 1.0,
        "T1_hi": WARMING + 1.0,
        "T2": WARMING,
        "T2_lo": WARMING,
        "T2_hi": WARMING + 1.0,
    }
    assert columns._bands(list(values), values) == ["T1_lo", "T1_hi"]
    assert columns._rooms(["T1-front", "T3-room"]) == ["T3-room"]
    assert columns._rooms(["T2-room", "T3-room"]) == []
    assert columns._beyond_place(["lab/T1", "lab/T2", "x"]) == {"lab/T1": "T1", "lab/T2": "T2", "x": "x"}
    assert columns._beyond_place(["lab T1", "lab T2"]) == {"lab T1": "T1", "lab T2": "T2"}
    assert columns._beyond_place(["lab T1", "lab T2", "x"])["lab T1"] == "lab T1"
    assert columns._beyond_place(["lab/T1", "x"])["lab/T1"] == "lab/T1"
    assert columns._beyond_place(["lab/1", "lab/2"])["lab/1"] == "lab/1"


def test_columns_by_whole_name_pattern_or_name_before_the_unit():
    """What names none stays as it is."""
    known = ["T1 [°C]", "T2 [°C]", "front (a)", "front (b)", "load"]
    readings = known[:4]
    assert called.columns_named("load", known, readings) == ("load",)
    assert called.columns_named("T*", known, readings) == ("T1 [°C]", "T2 [°C]")
    assert called.columns_named("T?[*", known, readings) == ("T?[*",)
    assert called.columns_named("T? [*", known, readings) == ("T1 [°C]", "T2 [°C]")
    assert called.columns_named("l*", known, readings) == ("l*",)
    assert called.columns_named("t1", known, readings) == ("T1 [°C]",)
    assert called.columns_named("front", known, readings) == ("front",)
    told = called.resolved(Options(channels=("T*", "t1"), exclude=("l*",), units=("t1=F", "C"), ambient="t2"), known, readings)
    assert (told.channels, told.exclude) == (("T1 [°C]", "T2 [°C]"), ("load",))
    assert (told.units, told.ambient) == (("T1 [°C]=F", "C"), "T2 [°C]")


def test_resistances_and_displacements():
    """Ohms by unit or name; millimetres are turned into micrometres."""
    names = ["R1 [ohm]", "winding resistance", "T1"]
    assert columns.resistive(names, {}, Options(), "run") == names[:2]
    assert columns.resistive(names, {}, Options(channels=("R1 [ohm]",)), "run") == names[:1]
    assert columns.resistive(names, {}, Options(exclude=("R1 [ohm]",)), "run") == names[1:2]
    assert columns.resistive(["T1", "T2"], {}, Options(channels=("T2", "T9")), "run") == ["T2"]
    with pytest.raises(UsageError, match="no column is in ohms"):
        columns.resistive(["T1"], {}, Options(), "run")
    told = [columns.length_unit(*c) for c in (("Z", "mm"), ("Z um", ""), ("Z", "µm"), ("Z in microns", ""), ("Z", ""))]
    assert told == ["mm", "um", "um", "um", ""]
    odd = _roles(speed=WARMING, T1=WARMING, units={"speed": "rpm"}, options=Options(channels=("speed",)))
    assert odd.guesses[-1].text == "taken for degC, as asked: 'speed' is a speed, in rpm"
    assert _roles(speed=WARMING, units={"speed": "rpm"}, options=Options(channels=("speed",), units=("speed=C",))).guesses == ()


def test_columns_with_clocks_of_their_own_are_put_on_one():
    """Each follows its clock, or stands before it; alike to a thousandth of the record they are one."""
    first, second = 10.0 * np.arange(12.0), 10.0 * np.arange(12.0) + 5.0
    t = {"Time 1": first, "a": WARMING[:12], "Time 2": second, "b": WARMING[12:24]}
    found = clocks.with_one_clock(_table(**t), Options())
    assert found.names == ["Time 1", "a", "b"]
    assert found.columns["Time 1"].tolist() == [5.0 * k for k in range(24)]
    np.testing.assert_array_equal(found.columns["a"][::2], WARMING[:12])
    np.testing.assert_array_equal(found.columns["b"][1::2], WARMING[12:24])
    assert np.isnan(found.columns["b"][::2]).all()
    assert found.notes == ("2 clocks, each of the columns beside it: 24 moments in all",)
    assert found.lines == [1 + k // 2 for k in range(24)]
    assert found.clocks == ("Time 1", "Time 2")
    before = clocks.with_one_clock(
        _table(**dict(zip(["a", "Time 1", "b", "Time 2"], [t[k] for k in ("a", "Time 1", "b", "Time 2")], strict=True))), Options()
    )
    assert before.names == ["Time 1", "a", "b"]
    assert before.columns["a"][::2].tolist() == WARMING[:12].tolist()
    for late, one in ((0.11, True), (0.12, False)):
        near = clocks.with_one_clock(_table(**(t | {"Time 2": first + late})), Options())
        assert (near.names == ["Time 1", "a", "b"] and len(near.columns["a"]) == 12) is one
    for options in (Options(time="Time 1"), Options(interval_s=1.0), Options(long=("a", "b"))):
        table = _table(**t)
        assert clocks.with_one_clock(table, options) is table
    for wrong in (
        t | {"Time 2": first},
        t | {"Time 2": np.full(12, 7.0)},
        t | {"Time 2": np.r_[second[:5], second[4:11]]},
        {"Time 1": first, "Time 2": second, "a": first, "b": first},
    ):
        assert len(clocks.with_one_clock(_table(**wrong), Options()).columns) == 4
    ended = second.copy()
    ended[8:] = 0.0
    short = clocks.with_one_clock(_table(**(t | {"Time 2": ended})), Options())
    assert len(short.columns["a"]) == 20


def test_clocks_of_stamps_and_clocks_that_are_called_after_their_columns():
    """Of one origin; past midnight each goes on by itself."""
    one, two = (["23:58:00", "23:59:00", "00:00:00"], ["23:58:30", "23:59:30", "00:00:30"])
    found = clocks.with_one_clock(_table(**{"Time 1": one, "a": [1, 2, 3], "Time 2": two, "b": [4, 5, 6]}), Options())
    assert found.columns["Time 1"] == ["23:58:00", "23:58:30", "23:59:00", "23:59:30", "00:00:00", "00:00:30"]
    dated = [[f"2026-03-14 {c}" for c in ("08:00", "08:01", "")], [f"2026-03-14 {c}" for c in ("08:00:30", "08:01:30", "08:02:30")]]
    dated[0][2] = ""
    found = clocks.with_one_clock(_table(**{"Time 1": dated[0], "a": [1, 2, 3], "Time 2": dated[1], "b": [4, 5, 6]}), Options())
    assert len(found.columns["a"]) == 5
    assert found.columns["b"][[1, 3, 4]].tolist() == [4.0, 5.0, 6.0]
    up = np.arange(11.0)
    named = {"t_front": up, "front": WARMING[:11], "t_rear [s]": up + 0.5, "rear": WARMING[:11], "t_x": up, "y": up}
    assert clocks.clocks_of_columns(_table(**named)) == []
    named = {"t_front": up, "front [°C]": WARMING[:11], "t rear": up + 0.5, "Rear": WARMING[:11]}
    assert clocks.clocks_of_columns(_table(**named)) == ["t_front", "t rear"]
    assert len(clocks.with_one_clock(_table(**named), Options()).columns["Rear"]) == 22
    assert clocks.clocks_of_columns(_table(**{k: v[:10] for k, v in named.items()})) == []
    assert clocks.clocks_of_columns(_table(**(named | {"t_front": np.zeros(11)}))) == []
    named = {"Time front": up, "front": WARMING[:11], "Time rear": up + 0.5, "rear": WARMING[:11]}
    assert len(clocks.with_one_clock(_table(**named), Options()).columns["rear"]) == 22


def test_a_table_of_pandas():
    """An index of time is its column of time; what is no table is refused with what it is."""
    moments = pd.date_range("2026-03-14 08:00", periods=3, freq="min")
    frame = pd.DataFrame({"T1": [1.0, None, 3.0]}, index=moments)
    found = table_of(frame)
    assert found.names == ["time", "T1"]
    assert found.columns["time"][1] == "2026-03-14T08:01:00.000000"
    assert found.columns["T1"].tolist()[::2] == [1.0, 3.0]
    assert found.notes == ("2 columns of 3 rows",)
    assert table_of(frame.rename_axis("when")).names == ["when", "T1"]
    assert table_of(frame.assign(time=[1, 2, 3])).names == ["time (index)", "T1", "time"]
    assert table_of(pd.DataFrame({"T1": [1.0, 2.0]})).names == ["T1"]
    assert table_of(pd.DataFrame({"T1": [1.0, 2.0]}, index=[0.0, 0.5])).names == ["index", "T1"]
    assert table_of(pd.DataFrame({"T1": [1.0]}, index=pd.Index([7], name="k"))).names == ["k", "T1"]
    assert table_of(pd.DataFrame({"T1": [1.0, 2.0]}, index=["08:00", "08:01"])).columns["time"] == ["08:00", "08:01"]
    assert table_of(pd.DataFrame({"T1": [1.0, 2.0]}, index=["a", "b"])).names == ["T1"]
    assert table_of(pd.Series([1.0, 2.0], index=moments[:2])).names == ["time", "T1"]
    assert table_of(pd.Series([1.0], name="x")).names == ["x"]
    assert table_of(frame.set_index(moments.tz_localize("Europe/Berlin"))).columns["time"][0] == "2026-03-14T07:00:00+00:00"
    period = table_of(frame.set_index(moments.to_period("min")))
    assert period.columns["time"][2] == "2026-03-14T08:02:00.000000"
    lengths = table_of(frame.set_index(pd.to_timedelta([0, 60, 90], unit="s")))
    assert (lengths.columns["time"].tolist(), lengths.units["time"], lengths.durations) == ([0.0, 60.0, 90.0], "s", ("time",))
    own = pd.Series([1.0, 2.0])
    assert not np.shares_memory(table_of({"a": own}).columns["a"], own.to_numpy())
    flags = table_of(pd.DataFrame({"a": [True, False], "b": pd.array([True, None], dtype="boolean")}))
    assert (flags.columns["a"], flags.columns["b"]) == (["True", "False"], ["True", ""])
    for wrong, told in (
        (pd.DataFrame([[1, 2]], columns=["a", "a"]), "the column 'a' twice"),
        (pd.DataFrame([[1]], columns=pd.MultiIndex.from_tuples([("a", "b")])), "columns of several levels"),
        (pd.DataFrame({"a": [1]}, index=pd.MultiIndex.from_tuples([(1, 2)])), "an index of several levels"),
        (moments, "not a record"),
        (np.zeros((3, 2)), "not a record"),
        ({1: [1.0]}, "a column is called 1"),
        ({}, "no columns"),
        ({"a": [1.0], "b": [1.0, 2.0]}, "columns of different length"),
        ({"a": np.zeros((2, 2))}, "not one-dimensional"),
        ({"a": np.array([1, 2], dtype="timedelta64[M]")}, "months and years have no length"),
        ({"a": [1.0, "x", 2.0]}, "row 2, column 'a': not a number"),
        ({"a": pd.Series([1.0, 2.0]), "b": pd.Series([1.0, 2.0], index=[1, 2])}, "'b' has another index than 'a'"),
    ):
        with pytest.raises(InputError, match=told):
            table_of(wrong)
    with pytest.raises(UsageError, match="--header-line, --skip-footer is for files"):
        table_of(frame, options=Options(header_line=2, skip_footer=1))
    with pytest.raises(InputError, match="a table of 3 rows"):
        table_of(frame, options=Options(max_rows=2))


def test_a_table_of_arrays_and_of_arrow():
    """Masked values and words for no reading are nan; objects are numbers, stamps or words throughout."""
    mask = [False, True, False]
    found = table_of(
        {
            "a": np.ma.array([1.0, 2.0, 3.0], mask=mask),
            "b": np.ma.array([1, 2, 3], mask=mask),
            "c": np.ma.array(np.array(["2026-03-14", "2026-03-15", "2026-03-16"], dtype="datetime64[D]"), mask=mask),
            "d": [1, None, "NaN"],
            "e": [dt.time(8), None, dt.time(9)],
            "f": [dt.datetime(2026, 3, 14, 8), pd.NaT, dt.date(2026, 3, 15)],
            "g": np.array(["1,5", "2,5", ""]),
            "h": np.array([60, 120, 180], dtype="timedelta64[s]"),
            "i": np.array([True, False, True]),
            "j": [np.bool_(True), None, False],
            "k": np.ma.array(np.array(["x", "y", "z"]), mask=mask),
        }
    )
    for name in ("a", "b"):
        np.testing.assert_array_equal(found.columns[name], [1.0, np.nan, 3.0])
    np.testing.assert_array_equal(found.columns["d"], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(found.columns["g"], [1.5, 2.5, np.nan])
    assert found.columns["c"] == ["2026-03-14T00:00:00.000000", "", "2026-03-16T00:00:00.000000"]
    assert (found.columns["e"], found.columns["f"]) == (["08:00:00", "", "09:00:00"], ["2026-03-14 08:00:00", "", "2026-03-15"])
    assert (found.columns["h"].tolist(), found.units["h"], found.durations) == ([60.0, 120.0, 180.0], "s", ("h",))
    assert (found.columns["i"], found.columns["j"], found.columns["k"]) == (
        ["True", "False", "True"],
        ["True", "", "False"],
        ["x", "", "z"],
    )
    arrow = pa.table({"t": pa.array([dt.datetime(2026, 3, 14, 8)], pa.timestamp("ms", "UTC")), "T1": pa.array([1.5])})
    for given in (arrow, arrow.to_batches()[0], pa.RecordBatchReader.from_batches(arrow.schema, arrow.to_batches())):
        read = table_of(given)
        assert read.columns["t"] == ["2026-03-14T08:00:00.000000+00:00"]
        assert (read.columns["T1"].tolist(), read.notes) == ([1.5], ("Arrow table, 1 rows",))
    assert words_or_numbers(["20260314", "20260315"]) == ["20260314", "20260315"]
    assert words_or_numbers(["1.5", "x"]) == ["1.5", "x"]
    assert words_or_numbers(["", "a"]) == ["", "a"]
    assert words_or_numbers(["", "---"]) == ["", "---"]
    assert words_or_numbers(["1,234.5", "2,000.0"]).tolist() == [1234.5, 2000.0]
    assert words_or_numbers(["1234", "5678"]).tolist() == [1234.0, 5678.0]
    assert words_or_numbers(["1,5", "x.y"]) == ["1,5", "x.y"]
    np.testing.assert_array_equal(words_or_numbers(["1.5", "---", "2"]), [1.5, np.nan, 2.0])


def test_channels_of_a_matlab_file():
    """Vectors of one length, matrices column by column, one of several structures by its name."""
    from io import BytesIO

    from scipy.io import savemat

    def read(group=None, **held):
        data = BytesIO()
        savemat(data, held)
        assert measured.is_measured(data.getvalue())
        return measured.measured_table(data.getvalue(), "run.mat", group, measured.Limits())

    found = read(t=np.arange(4.0), T=np.arange(8.0).reshape(2, 4), short=np.arange(3.0), one=7.0, word="abc")
    assert found.names == ["t", "T_1", "T_2"]
    assert found.columns["T_2"].tolist() == [4.0, 5.0, 6.0, 7.0]
    assert found.notes == ("MATLAB, variables, 3 columns", "of another length, left out: short")
    both = {"a": {"t": np.arange(3.0), "T": np.arange(3.0)}, "b": {"t": np.arange(2.0)}}
    assert read("a", **both).names == ["t", "T"]
    with pytest.raises(InputError, match="2 MATLAB structures of vectors") as told:
        read(**both)
    assert (told.value.found, told.value.do) == ("a, b", "say which: --sheet NAME")
    with pytest.raises(UsageError, match="--sheet 'c' is none of its"):
        read("c", **both)
    with pytest.raises(InputError, match="no MATLAB structures"):
        read(one=7.0)
    assert [measured._numbers_in(k) for k in range(1, 17)] == [0, 0, 0, 1, 3, *[1] * 10, 0]


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        (20.0, "20"), (20.5, "20.5"), (0.1 + 0.2, "0.3"), (dt.datetime(2026, 3, 14, 8), "2026-03-14 08:00:00"), (None, ""), ("x", "x"),
        (dt.timedelta(hours=26, minutes=3, seconds=4.5), "26:03:04.500"), (dt.timedelta(seconds=-61), "-0:01:01.000"), (7, "7"),
    ],
)  # fmt: skip
def test_a_cell_of_a_sheet_as_a_logger_would_write_it(cell, text):
    """Whole numbers without a fraction, lengths of time in hours."""
    assert workbook._cell(cell) == text


def test_a_sheet_with_a_table_has_three_rows_of_two_numbers():
    """Numbers as text, too, where no sheet has others."""
    rows = [[1.0, 2], ["a", "b"], [dt.time(8), True], [3, dt.timedelta(1)]]
    assert list(workbook._with_rows_of(workbook._is_number, {"x": rows, "y": rows[:3], "z": [[1.0]] * 5})) == ["x"]
    for cell, reads in (("1.5", True), ("1,5", True), ("08:00", True), ("x", False), (None, False), (2, True)):
        assert workbook._reads(cell) is reads


def _of(found, word):
    return [g.text for g in found.guesses if word in g.text]


def test_a_word_that_takes_a_moving_sensor_away_is_a_guess():
    """Housing diff gear is a place, not a difference; what stands still, begins at nothing or hardly moves is what its name says."""
    names = {"front [°C]": WARMING, "Housing diff gear [°C]": WARMING + 0.4, "set screw [°C]": WARMING - 0.3}
    found = _roles(**names, **{"Ambient side cover [°C]": WARMING + 0.1})
    assert found.sensors == ("front [°C]",)
    (said,) = _of(found, "moves as the sensors do")
    assert said.endswith("Housing diff gear [°C], set screw [°C], Ambient side cover [°C]")
    told = {
        "Setpoint [°C]": np.repeat([20.0, 24.0], 30),
        "Target temp [°C]": np.full(60, 25.0),
        "diff front rear [°C]": WARMING - 20.0,
        "Room [°C]": 20.0 + 0.005 * np.arange(60.0),
    }
    assert _of(_roles(**{"front [°C]": WARMING}, **told), "moves as the sensors do") == []
    # A room that drifts by as much as a sensor far from the heat rises is a room.
    far = {"front [°C]": WARMING, "bed [°C]": WARMING, "column [°C]": 20.0 + 0.8 * np.linspace(0.0, 1.0, 60)}
    assert _of(_roles(**far, **{"ambient [°C]": 20.0 + 0.7 * np.linspace(0.0, 1.0, 60)}), "moves as the sensors do") == []
    asked = Options(inputs=("set screw [°C]", "Housing diff gear [°C]"))
    assert _of(_roles(**names, options=asked), "moves as the sensors do") == []


def test_thousandths_of_a_kelvin_are_temperatures_and_small_ones_a_noise():
    found = _roles(**{"front [mK]": 1000.0 * (WARMING + 273.15), "noise of front [mK]": 12.0 + 0.1 * WARMING, "gap [mK]": WARMING})
    assert found.sensors == ("front [mK]",)
    assert found.inputs == ("noise of front [mK]", "gap [mK]")
