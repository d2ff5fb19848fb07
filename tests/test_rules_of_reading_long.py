"""Long tables, one row per sensor and moment: what names the sensor, what is its reading, what is left out."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.errors import InputError, UsageError
from thermofast.reading import long
from thermofast.reading.moments.times import Time
from thermofast.reading.table import Table
from thermofast.reading_options import Options


def _table(header=True, units=None, faults=None, **columns):
    columns = {k: v if isinstance(v[0], str) else np.asarray(v, dtype=float) for k, v in columns.items()}
    rows = len(next(iter(columns.values())))
    units = {**dict.fromkeys(columns, ""), **(units or {})}
    return Table("run.csv", list(columns), columns, units, range(1, 1 + rows), (), faults or {}, header=header)


def _time(seconds):
    return Time(np.asarray(seconds, dtype=float), frozenset({"time"}), "")


#: Two sensors read at each of ten moments, and words for them.
EACH = np.repeat(60.0 * np.arange(10), 2)
NAMES = ["front", "rear"] * 10
VALUES = np.where(np.arange(20) % 2 == 0, 30.0, 50.0) + 0.01 * np.arange(20)


def _layout(seconds=EACH, options=Options(), header=True, units=None, faults=None, **columns):  # noqa: B008 - frozen
    found = long.find_long(_table(header, units, faults, time=seconds, **columns), _time(seconds), options)
    return found if found is None else (found.labels, found.value)


def test_the_columns_that_the_user_names_are_taken():
    """Several joined by a plus; what is no column is refused, and named columns are a wide table's, named sensors a long one's."""
    columns = {"a": NAMES, "b": NAMES, "v": VALUES}
    assert _layout(options=Options(long=("a+b", "v")), **columns) == (("a", "b"), "v")
    assert long.find_long(_table(time=EACH, **columns), _time(EACH), Options(long=("a", "v"))).guess is None
    with pytest.raises(UsageError, match="--long 'c' is no column"):
        _layout(options=Options(long=("a+c", "v")), **columns)
    assert _layout(options=Options(channels=("value",)), sensor=NAMES, value=VALUES) is None
    assert _layout(options=Options(channels=("v",)), sensor=NAMES, value=VALUES) == (("sensor",), "value")


def test_words_under_a_name_of_sensors_and_one_column_of_readings():
    """What was found is told."""
    found = long.find_long(_table(time=EACH, sensor=NAMES, value=VALUES), _time(EACH), Options())
    assert (found.labels, found.value) == (("sensor",), "value")
    assert found.guess.text == "a long table: 'sensor' names the sensor, 'value' is the reading"
    assert _layout(sensor=NAMES, value=VALUES, other=VALUES[::-1]) == (("sensor",), "value")
    assert _layout(sensor=NAMES, foo=VALUES) == (("sensor",), "foo")
    assert _layout(sensor=NAMES, foo=VALUES, temp=VALUES[::-1]) == (("sensor",), "temp")
    assert _layout(sensor=NAMES, foo=VALUES, front_degC=VALUES[::-1]) == (("sensor",), "front_degC")
    assert _layout(sensor=NAMES, value=np.full(20, 3.0)) is None
    assert _layout(sensor=NAMES, status=VALUES) is None
    assert _layout(sensor_status=NAMES, value=VALUES) is None
    faults = {"foo": InputError("a word")}
    assert _layout(sensor=NAMES, foo=VALUES, bar=VALUES[::-1], faults=faults) == (("sensor",), "bar")
    assert _layout(sensor=NAMES, value=VALUES, bar=VALUES[::-1], faults={"value": InputError("a word")}) == (("sensor",), "value")


def test_of_several_readings_the_user_must_say_which():
    """Where sensors take turns; else the table is a wide one. The example is of a mean."""
    with pytest.raises(InputError, match="looks like a long table") as told:
        _layout(sensor=NAMES, foo=VALUES, avg_x=VALUES[::-1], bar=VALUES**2)
    assert "as in --long 'sensor','avg_x'" in told.value.do
    assert told.value.found == "words that repeat in sensor; numbers in foo, avg_x, bar"
    with pytest.raises(InputError) as told:
        _layout(sensor=NAMES, foo=VALUES, bar=VALUES[::-1])
    assert "--long 'sensor','bar'" in told.value.do
    with pytest.raises(InputError, match="looks like a long table"):
        _layout(sensor=NAMES, value=VALUES, temp=VALUES[::-1])
    slow = 60.0 * np.arange(20)
    assert _layout(slow, sensor=["front"] * 10 + ["rear"] * 10, foo=VALUES, bar=VALUES[::-1]) is None
    with pytest.raises(InputError, match="looks like a long table"):
        _layout(header=False, a=NAMES, b=VALUES, c=VALUES[::-1])
    assert _layout(header=False, sensor=np.tile([1.0, 2.0], 10), b=VALUES) is None


def test_words_under_any_name_where_sensors_take_turns():
    """By the stamps, or by readings that jump at every change; two such columns are too many."""
    slow = 60.0 * np.arange(20)
    assert _layout(what=NAMES, value=VALUES) == (("what",), "value")
    assert _layout(slow, what=NAMES, value=VALUES) == (("what",), "value")
    assert _layout(slow, what=NAMES, value=np.arange(20.0)) is None
    assert _layout(slow, what=NAMES, that=NAMES[::-1], value=VALUES) is None
    assert _layout(slow, mode=NAMES, value=VALUES) is None


def test_sensors_that_are_called_by_numbers():
    """Whole ones under such a name, read in turn or at the same stamps."""
    numbers, slow = np.tile([1.0, 2.0], 10), 60.0 * np.arange(20)
    assert _layout(channel=numbers, value=VALUES) == (("channel",), "value")
    assert _layout(slow, channel=numbers, value=VALUES) == (("channel",), "value")
    assert _layout(slow, channel=np.sort(numbers), value=VALUES) is None
    assert _layout(slow, channel=numbers, foo=VALUES) is None
    assert _layout(EACH, channel=numbers, foo=VALUES) == (("channel",), "foo")
    assert _layout(channel=numbers + 0.5, value=VALUES) is None
    assert _layout(channel=np.tile([1.0, 1001.0], 10), value=VALUES) is None
    assert _layout(channel=np.tile([1.0, 1000.0], 10), value=VALUES) == (("channel",), "value")
    assert _layout(id=numbers, sensor=NAMES, value=VALUES) == (("sensor",), "value")
    assert _layout(channel=numbers, node=numbers, value=VALUES)[0] == ("channel",)


@pytest.mark.parametrize(
    ("cells", "repeats"),
    [
        (["a", "b"], True), (["a", "a"], False), (["a", "b", "c"], False), (["a", "b", "c", "a", "b", "c"], True),
        (["a", "b", "c", "d", "a"], False), (["a", "b", "c", "d"] * 2, True), (["a", " a "], False), (["a", "b", ""], False),
        (["a", "b", "", "a", "b", ""], False), ([str(i) for i in range(5000)] * 2, True), ([str(i) for i in range(5001)] * 2, False),
    ],
)  # fmt: skip
def test_names_of_sensors_repeat(cells, repeats):
    """Half as many as rows, two at least and 5000 at most; none is empty."""
    assert long._repeats(cells) is repeats


def test_stamps_stand_there_several_times_each_with_another_name():
    """Seven tenths as many as rows, 95 % of the pairs apart; or time falls back where the name changes."""

    def taken(seconds, labels, *more):
        seconds = np.asarray(seconds, dtype=float)
        return long._interleaved(seconds, {"s": labels, "more": list(more)}, ("s", "more") if more else ("s",))

    assert taken([0, 0, 0, 1, 1, 2, 3, 4, 5, 6], ["a", "b", "c", "a", "b", "a", "a", "a", "a", "a"])
    assert not taken([0, 0, 0, 1, 2, 3, 4, 5, 6, 7], ["a", "b", "c", "a", "b", "a", "a", "a", "a", "a"])
    twenty = np.repeat(np.arange(10.0), 2)
    assert taken(twenty, [*NAMES[:19], "front"])
    assert not taken(twenty, [*NAMES[:17], "front", "front", "front"])
    assert taken([0, 1, 2, 0, 1, 2], ["a"] * 3 + ["b"] * 3)
    assert not taken([0, 1, 2, 0, 1, 2], ["a"] * 2 + ["b"] * 4)
    assert taken([0, 1, 2, 0.5, 1.5, 2.5], ["a"] * 3 + ["b"] * 3)
    assert not taken([0, 1, 2, 0.5, 1.5, 2.5], ["a"] * 3 + ["b"] * 2 + ["c"])
    assert not taken([0, 1, 2, 3, 4, 5], ["a"] * 3 + ["b"] * 3)
    assert taken([0, 1, 0, 1], ["a"] * 4, "x", "x", "y", "y")
    assert not long._interleaved(twenty, {}, ())


def test_sensors_are_read_in_turn_where_four_rows_in_ten_change():
    """Of ten rows more than four."""
    assert long._in_turn(list("ababababab"))
    assert long._in_turn(list("ababaabbbb")) is True  # six changes
    assert long._in_turn(list("abababbbbb"))
    assert not long._in_turn(list("ababbbbbba"))
    assert not long._in_turn(list("aaaaaaaaaa"))
    assert not long._in_turn(None)


def test_readings_jump_where_the_name_changes():
    """Five times as far as they move under one name; three changes at least, 200 names at most."""
    names = ["a", "b"] * 6
    for step, found in ((5.1, True), (4.9, False)):
        value = np.arange(12) // 2 + step * (np.arange(12) % 2)
        assert long._levels(names, value) is found
    assert not long._levels(None, np.arange(12.0))
    assert long._levels(["a", "a", "b", "b", "a", "b"], np.array([0.0, 0.0, 9.0, 9.0, 0.0, 9.0]))
    assert not long._levels(["a", "a", "b", "b", "a", "a"], np.array([0.0, 0.0, 9.0, 9.0, 0.0, 0.0]))
    for count, found in ((200, True), (201, False)):
        assert long._levels([str(k % count) for k in range(2 * count)], np.arange(2.0 * count) % count * 7.0) is found
    holes = np.array([0.0, 9.0, np.nan, 9.0, 0.0, np.nan, 0.0, 9.0])
    assert long._levels(["a", "b"] * 4, holes)


def test_a_second_column_of_words_tells_mean_and_greatest_apart():
    """Where one sensor has several readings at a moment; a column of units or of remarks does not."""
    seconds, sensors = np.repeat(60.0 * np.arange(5), 4), ["front", "front", "rear", "rear"] * 5
    kinds = ["mean", "max"] * 10
    assert _layout(seconds, sensor=sensors, stat=kinds, value=VALUES) == (("sensor", "stat"), "value")
    assert _layout(seconds, sensor=sensors, unit=kinds, value=VALUES) == (("sensor",), "value")
    assert _layout(seconds, sensor=sensors, remark=kinds, value=VALUES) == (("sensor",), "value")
    assert _layout(seconds, sensor=sensors, stat=["mean", "mean", "max", "max"] * 5, value=VALUES)[0] == ("sensor",)
    found = long.find_long(_table(time=seconds, sensor=sensors, stat=kinds, value=VALUES), _time(seconds), Options())
    assert found.guess.text.startswith("a long table: 'sensor' and 'stat' name the sensor")


def test_a_long_table_of_one_sensor():
    """Its name in every row; a column that says that it is a temperature needs no long table."""
    seconds, ones = 60.0 * np.arange(8), ["front "] * 7 + ["front"]
    value = 20.0 + np.arange(8.0)
    found = long.find_long(_table(time=seconds, sensor=ones, value=value), _time(seconds), Options())
    assert (found.labels, found.value) == (("sensor",), "value")
    assert found.guess.text == "a long table of one sensor, named in 'sensor'; 'value' is the reading"
    assert _layout(seconds, sensor=ones, temp_degC=value) is None
    assert _layout(seconds, sensor=ones, foo=value) is None
    assert _layout(seconds, sensor=ones, value=value, foo=value) is None
    assert _layout(seconds, sensor=ones, tag=ones, value=value) is None
    assert _layout(seconds, what=ones, value=value) is None
    assert _layout(seconds, sensor=np.full(8, 3.0), value=value) is None


def test_what_tells_words_is_left_out_where_others_tell_numbers():
    """A door among sensors; words among the numbers of one that is kept are for the user."""
    sensor, value = ["front", "door"] * 4, ["20.5", "on", "20.6", "off", "20.7", "on", "20.8", "off"]
    found = long.without_switches(_table(time=np.arange(8.0), sensor=sensor, value=value))
    assert found.columns["value"].tolist() == [20.5, 20.6, 20.7, 20.8]
    assert found.columns["sensor"] == ["front"] * 4
    assert found.columns["time"].tolist() == [0.0, 2.0, 4.0, 6.0]
    assert found.lines == [1, 3, 5, 7]
    assert found.notes == ("what tells words left out: door",)
    for wrong in (
        {"sensor": sensor, "value": [*value[:6], "hot", "off"]},
        {"sensor": sensor, "value": ["on", "off"] * 4},
        {"sensor": sensor, "foo": value},
        {"what": sensor, "value": value},
        {"sensor": sensor, "tag": sensor, "value": value},
        {"sensor": sensor, "value": value, "wert": value},
        {"sensor_status": sensor, "value": value},
    ):
        table = _table(time=np.arange(8.0), **wrong)
        assert long.without_switches(table) is table
    missing = long.without_switches(_table(time=np.arange(8.0), sensor=sensor, value=["", "on", *value[2:]]))
    assert missing.columns["value"].tolist()[1:] == [20.6, 20.7, 20.8]
    mostly = np.array([20.5, np.nan, 20.6, np.nan, 20.7, 1.0, 20.8, 1.0])
    fault = InputError("run.csv, line 2", found="'open', 'shut' in 2 rows")
    table = _table(time=np.arange(8.0), sensor=sensor, value=mostly, faults={"value": fault})
    assert long.without_switches(table) is table
    once = ["front", "front", "rear", "door"] * 2
    mostly = np.array([20.5, 20.6, 20.7, np.nan, 20.8, 20.9, 21.0, np.nan])
    told = long.without_switches(_table(time=np.arange(8.0), sensor=once, value=mostly, faults={"value": fault}))
    assert (told.columns["value"].tolist(), told.faults) == ([20.5, 20.6, 20.7, 20.8, 20.9, 21.0], {})
    many = InputError("run.csv, line 2", found="'open', 'shut' in 3 rows")
    table = _table(time=np.arange(8.0), sensor=once, value=mostly, faults={"value": many})
    assert long.without_switches(table) is table


def _wide(units=None, labels=("sensor",), of="value", seconds=EACH, **columns):
    return long.to_wide(_table(units=units, time=seconds, **columns), long.Layout(labels, of, None), _time(seconds))


def test_each_sensor_gets_a_column_of_its_own():
    """In the order in which they come; units by the column, or by a column of units."""
    found = _wide(sensor=["b", " a"] * 10, value=VALUES)
    assert found.names == ["time", "b", "a"]
    assert found.columns["b"][::2].tolist() == VALUES[::2].tolist()
    assert np.isnan(found.columns["b"][1::2]).all()
    assert found.notes == ("long table: 2 columns from sensor and value",)
    assert (found.header, found.units) == (True, {"time": "", "b": "", "a": ""})
    assert _wide(units={"value": "°F"}, sensor=NAMES, value=np.full(20, 212.0)).columns["rear"][1] == pytest.approx(100.0)
    mixed = _wide(sensor=NAMES, value=np.full(20, 50.0), unit=["°F", "bar"] * 10)
    assert (mixed.columns["front"][0], mixed.columns["rear"][1]) == (pytest.approx(10.0), 50.0)
    assert mixed.units == {"time": "", "front": "°C", "rear": "bar"}
    assert _wide(sensor=NAMES, temp_F=np.full(20, 212.0), of="temp_F").columns["front"][0] == pytest.approx(100.0)
    assert _wide(sensor=NAMES, temp=VALUES, of="temp").units["front"] == "°C"


def test_names_of_two_columns_are_joined_and_numbers_get_a_word():
    """A column that is the same in every row says nothing; the mark of an archive's end is no sensor."""
    assert _wide(labels=("a", "b"), a=["x", "y"] * 10, b=["u", "u", "v", "v"] * 5, value=VALUES).names[1:] == [
        "x u",
        "y u",
        "x v",
        "y v",
    ]
    assert _wide(labels=("a", "b"), a=["x"] * 20, b=NAMES, value=VALUES).names[1:] == ["front", "rear"]
    assert _wide(labels=("a", "b"), a=["x"] * 20, b=["y"] * 20, value=VALUES).names[1:] == ["x"]
    assert _wide(labels=("channel",), channel=np.tile([1.0, 2.0], 10), value=VALUES).names[1:] == ["channel 1", "channel 2"]
    assert _wide(labels=("foo",), foo=np.tile([1.0, 2.0], 10), value=VALUES).names[1:] == ["sensor 1", "sensor 2"]
    assert _wide(sensor=["a", "$RT_OFF$"] * 10, value=VALUES).names[1:] == ["a"]


def test_readings_that_are_marked_as_bad_are_left_out():
    """Counted in the note."""
    quality = ["Good"] * 19 + ["Bad"]
    found = _wide(sensor=NAMES, value=VALUES, quality=quality)
    assert np.isnan(found.columns["rear"][19])
    assert found.notes == ("long table: 2 columns from sensor and value; 1 reading of bad quality left out",)
    assert (
        _wide(sensor=NAMES, value=VALUES, quality=["Good"] * 18 + ["Bad"] * 2)
        .notes[0]
        .endswith("; 2 readings of bad quality left out")
    )
    with pytest.raises(UsageError, match="holds no numbers"):
        _wide(sensor=NAMES, value=["x"] * 20)
    with pytest.raises(UsageError, match="5001 sensors in sensor"):
        _wide(seconds=np.zeros(5001), sensor=[str(k) for k in range(5001)], value=np.zeros(5001))


def test_rows_without_a_number_beside_what_tells_words_are_counted(tmp_path):
    """`open` may be a word for no reading: that another word stood among a sensor's numbers is told, by how many rows."""
    rows = []
    for k in range(60):
        rows.append(f"2024-05-01 10:{k:02d}:00,front,{'hot' if k == 30 else f'{20 + 0.05 * k:.2f}'}")
        rows.append(f"2024-05-01 10:{k:02d}:00,door,{'open' if k % 3 else 'shut'}")
    path = tmp_path / "run.csv"
    path.write_text("time,sensor,value [degC]\n" + "\n".join(rows) + "\n")
    notes = tf.read(path).notes
    assert "what tells words left out: door" in notes
    assert "1 rows of the others hold no number" in notes
