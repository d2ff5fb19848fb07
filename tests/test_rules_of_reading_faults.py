"""Codes of broken probes and held values, marks of OPC, elements of MATLAB's files, columns of Arrow and Parquet, one by one."""

import datetime as dt
import decimal
import io
import struct

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
import pytest

from thermofast.errors import InputError
from thermofast.reading import table as tables
from thermofast.reading.table import Table, from_arrow, read_parquet
from thermofast.reading.tables import clocks, measured
from thermofast.reading.tables.limits import Limits
from thermofast.reading.values import faults, marks
from thermofast.reading_options import Options


def _table(**given):
    given = {k: v if isinstance(v[0], str) else np.asarray(v, dtype=float) for k, v in given.items()}
    return Table("run.csv", list(given), given, dict.fromkeys(given, ""), range(1, 1 + len(next(iter(given.values())))), ())


@pytest.mark.parametrize(
    "code",
    [
        -127.0, 3276.7, 3276.8, -3276.8, 655.35, 999.9, 999.99, -99.9, -99.99, -270.0, -250.0, -246.0, -242.02, -242.0, -200.0,
        0.0, 85.0, 327.67, 409.5, 850.0, 888.8, 888.88, 1300.0, 1370.0, 1372.0, 1767.6, 1768.0, 1820.0, 1999.0, 2320.0, 1300.29, 1999.29,
        9.9e37, -273.15, -1e30,
    ],
)  # fmt: skip
def test_each_code_that_loggers_write_for_a_broken_probe(code):
    """A single one among forty readings; half a degree beside it is a reading."""
    values = 40.0 + 0.01 * np.arange(40.0)
    values[17] = code
    found, count = faults.without_impossible(values)
    assert (count, np.flatnonzero(np.isnan(found)).tolist()) == (1, [17])
    if -273.0 < code < 5000.0 and code not in (-242.0, -242.02, 1767.6, 1768.0, 1300.29, 1999.29):
        values[17] = code - 0.5
        assert faults.without_impossible(values)[1] == 0


def _with_codes(values, **at):
    values = np.array(values, dtype=float)
    return np.flatnonzero(np.isnan(faults.without_impossible(values)[0])).tolist()


def test_a_code_lies_across_a_jump_from_the_readings_on_each_side():
    """Five times the three steps beyond it, twenty times the usual one, and 2 K."""
    quiet = np.full(20, 60.0)
    assert _with_codes(np.r_[quiet, 85.0, quiet]) == [20]
    assert _with_codes(np.r_[85.0, quiet]) == [0]
    assert _with_codes(np.r_[quiet, 85.0]) == [20]
    assert _with_codes(np.r_[84.0, 85.0, quiet]) == []
    assert _with_codes(np.r_[82.9, 85.0, quiet]) == [1]
    assert _with_codes(np.r_[83.1, 85.0, quiet]) == []
    assert _with_codes(np.r_[quiet, 76.0, 76.0, 78.0, 76.0, 85.0, quiet]) == []
    assert _with_codes(np.r_[quiet, 76.0, 77.7, 76.0, 76.0, 85.0, quiet]) == [24]
    assert _with_codes(np.r_[quiet, 76.0, 77.9, 76.0, 76.0, 85.0, quiet]) == []
    assert _with_codes(np.r_[quiet, 77.9, 76.0, 76.0, 76.0, 76.0, 85.0, quiet]) == [25]
    assert _with_codes(np.r_[quiet, 85.0, 76.0, 76.0, 77.9, 76.0, quiet]) == []
    assert _with_codes(np.r_[quiet, 85.0, 76.0, 76.0, 76.0, 76.0, 77.9, 76.0, quiet]) == [20]
    for step, code in ((0.2, [34]), (0.245, [34]), (0.255, []), (0.3, [])):
        swings = 80.0 + step * (np.arange(30) % 2)
        assert _with_codes(np.r_[swings, np.full(4, 80.0), 85.0, np.full(4, 80.0), swings]) == code
    assert _with_codes(np.r_[quiet, 85.0, 85.0, 86.0, quiet]) == []
    assert _with_codes(np.r_[quiet, 85.000004, quiet]) == []
    assert _with_codes(np.r_[quiet, 85.0, 60.0, 85.0, np.nan, 85.0, quiet]) == [20, 22, 23, 24]
    assert _with_codes(np.full(20, 85.0)) == []


def test_the_ends_tell_that_there_is_no_code():
    """What lies far from a few readings is looked at, above them and below."""
    warm = 60.0 + np.linspace(0.0, 10.0, 28)
    for code, taken in ((30.0, True), (39.9, True), (40.1, False), (84.0, False), (101.0, True)):
        values = warm.copy()
        values[[5, 17]] = code
        assert _with_codes(values) == ([5, 17] if taken else []), code
    values = warm.copy()
    assert faults.without_impossible(values)[0] is values
    assert faults.without_impossible(np.full(3, np.nan))[1] == 0


@pytest.mark.parametrize("count", [1, 2, 3])
def test_false_first_readings_jump_ten_times_the_steps_that_follow(count):
    """And twice as far as any step among them; a fast machine slows down step by step."""
    after = 30.0 - 0.3 * np.arange(40.0)
    for jump, false in ((3.2, 0), (20.0, count)):
        first = np.full(count, 30.0 - jump)
        assert faults.false_first([np.r_[first, after]]).tolist() == [false]
    apart = 30.0 - np.linspace(20.0, 30.0, count)
    assert faults.false_first([np.r_[apart, after]]).tolist() == [count]
    assert faults.false_first([np.r_[np.full(count, 10.0), after[: 23 - count]]]).tolist() == [0]
    slowing = 100.0 * np.exp(-0.5 * np.arange(60.0))
    assert faults.false_first([slowing, np.full(60, 20.0)]).tolist() == [0, 0]
    on = np.r_[np.full(count, 0.0), 50.0 + 0.5 * np.arange(60.0)]
    assert faults.false_first([on]).tolist() == [count]
    assert faults.false_first([np.r_[np.full(count, 0.0), 50.0 + 1.0 * np.arange(60.0)]]).tolist() == [0]


def test_one_reading_of_each_that_is_held_counts():
    """That at which a new one is taken; a value that stood there twice is two."""
    column = np.repeat([20.0, 22.0, 21.0, 24.0, 23.0, 26.0, 25.0, 28.0, 27.0, 30.0, 29.0], 4)[2:]
    found, said = faults.without_faults({"a": column}, ["a"])
    assert said["a"] == "each value is held for 4 readings: one of them counts"
    assert np.flatnonzero(np.isfinite(found["a"])).tolist() == list(range(2, 42, 4))
    rising = np.repeat(20.0 + np.arange(12.0), 4)
    assert faults.held([rising]) == [1]
    twice = np.repeat([20.0, 22.0, 22.0, 21.0, 24.0, 23.0, 26.0, 25.0, 28.0, 27.0, 30.0, 29.0, 32.0, 31.0, 34.0, 33.0, 36.0], 4)
    assert faults.held([twice]) == [4]
    assert faults._taken(np.repeat([1.0, 2.0, 3.0], 4), 4).nonzero()[0].tolist() == [0, 4, 8]
    assert faults._taken(np.repeat([1.0, 2.0, 3.0], 4)[2:], 4).nonzero()[0].tolist() == [2, 6]
    assert faults._taken(np.r_[np.full(6, 1.0), np.full(4, 2.0)], 4).nonzero()[0].tolist() == [0, 6]


@pytest.mark.parametrize("code", [0, 4, 8, 12, 16, 20, 24, 28, 64, 68, 80, 84, 88, 192, 216])
def test_each_of_the_classic_codes_of_quality(code):
    """Good from 192 on, bad below 64; a number beside them makes a column q none of marks."""
    found = marks.bad_by(frozenset(["q"]), np.array([192.0, code]), False)
    assert found.tolist() == [False, code < 64]
    assert marks.bad_by(frozenset(["q"]), np.array([192.0, code + 1.0]), False) is None


def test_a_mark_that_is_not_known_leaves_the_others_to_be_looked_at():
    """Nor does one that is bad throughout."""
    columns = {
        "T1": [20, 21, 22],
        "T1_status": [1, 2, 3],
        "T2": [20, 21, 22],
        "T2_valid": [0, 0, 0],
        "T3": [1, 2, 3],
        "T3_ok": [1, 0, 1],
    }
    found = marks.good_readings(_table(time=[0, 1, 2], **columns))
    assert np.isnan(found.columns["T3"]).tolist() == [False, True, False]
    assert np.isfinite(found.columns["T2"]).all()


def test_a_counter_may_stand_before_the_clocks_of_the_columns():
    """And no reading may; clocks that differ by a missing moment only are one."""
    up, n = 10.0 * np.arange(12.0), np.arange(1.0, 13.0)
    both = {"Time 1": up, "a": n**2, "Time 2": up + 5.0, "b": n**3}
    assert len(clocks.with_one_clock(_table(no=n, **both), Options()).columns["a"]) == 24
    for lead in (2.0 * n, n**2, np.full(12, 7.0)):
        assert len(clocks.with_one_clock(_table(no=lead, **both), Options()).columns["a"]) == 12
    holes = up.copy()
    holes[5] = np.nan
    same = {"Time 1": holes, "a": n**2, "Time 2": holes.copy(), "b": n**3}
    assert list(clocks.with_one_clock(_table(**same), Options()).columns) == list(same)


def _element(kind, content, order="<"):
    return struct.pack(f"{order}II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def _small(kind, content, order="<"):
    return struct.pack(f"{order}I", len(content) << 16 | kind) + content.ljust(4, b"\0")


@pytest.mark.parametrize("order", ["<", ">"])
def test_elements_of_a_matlab_file(order):
    """Up to four bytes stand within the tag, others behind it in steps of eight."""
    data = _small(1, b"ab", order) + _element(9, b"12345", order) + _small(5, b"wxyz", order) + _element(14, b"", order)
    found = [(kind, bytes(held)) for kind, held in measured._elements(memoryview(data), order)]
    assert found == [(1, b"ab"), (9, b"12345"), (5, b"wxyz"), (14, b"")]
    for kind in (1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 14, 16, 17, 18):
        assert measured._elements(memoryview(_element(kind, b"", order)), order)[0][0] == kind
    for kind in (0, 8, 10, 11, 15, 19):
        with pytest.raises(ValueError, match=f"an element of kind {kind} and 0 bytes"):
            measured._elements(memoryview(_element(kind, b"", order)), order)
    with pytest.raises(ValueError, match="kind 1 and 5 bytes"):
        measured._elements(memoryview(struct.pack(f"{order}I", 5 << 16 | 1) + b"1234"), order)


def _matrix(of, numbers, flags=0, kind=9):
    head = _element(6, struct.pack("<II", of | flags, 0)) + _element(5, b"\1\0\0\0\1\0\0\0") + _small(1, b"T")
    return _element(14, head + b"".join(_element(kind, b"\0" * 8) for _ in range(numbers)))


def _checked(data, depth=0):
    try:
        measured._check_tags(memoryview(data), "<", depth)
    except ValueError as error:
        return str(error)
    return ""


def test_a_variable_of_a_matlab_file_has_its_numbers():
    """One element of a full matrix, three of a sparse one, one more of a complex; cells and structures hold matrices."""
    for of, needed in ((4, 1), (6, 1), (15, 1), (5, 3), (1, 0), (2, 0), (3, 0), (16, 0)):
        assert _checked(_matrix(of, needed)) == ""
        assert _checked(_matrix(of, needed + 1, 0x800)) == ""
        if needed:
            assert _checked(_matrix(of, needed - 1)) == "a variable without its numbers"
            assert _checked(_matrix(of, needed, 0x800)) == "a variable without its numbers"
    deep = _element(6, struct.pack("<II", 6, 0)) + _element(5, b"\1\0\0\0" * 3) + _small(1, b"T") + _element(9, b"\0" * 8)
    assert _checked(_element(14, deep)) == ""
    assert _checked(_element(14, b"")) == ""
    assert _checked(_element(9, b"12345678")) == ""
    short = _element(14, _element(6, b"\0" * 8) + _small(1, b"T"))
    wrong = _element(14, _element(5, b"\0" * 8) + _small(1, b"T") + _small(1, b"T"))
    thin = _element(14, _element(6, b"\0" * 16) + _small(1, b"T") + _small(1, b"T"))
    for data in (short, wrong, thin):
        assert _checked(data) == "a variable without its flags, size and name"
    for levels, told in ((19, ""), (20, "more than 20 structures within each other")):
        cell = _matrix(6, 1)
        for _ in range(levels):
            cell = _element(14, _matrix(1, 0)[8:] + cell)
        assert _checked(cell) == told
    assert _checked(_matrix(6, 1), 20) == "more than 20 structures within each other"
    assert _checked(_matrix(6, 1), 19) == ""


def test_columns_of_arrow_by_their_types():
    """Moments as stamps, lengths of time in seconds, words as words or as the numbers that they are; others are left out."""
    table = pa.table(
        {
            "whole": pa.array([1, None, 3], pa.int32()),
            "float": pa.array([1.5, None, 2.5], pa.float32()),
            "exact": pa.array([decimal.Decimal("1.5"), None, decimal.Decimal("2.5")]),
            "date": pa.array([dt.date(2026, 3, 14), None, dt.date(2026, 3, 15)]),
            "clock": pa.array([dt.time(8), None, dt.time(9)], pa.time64("us")),
            "yes": pa.array([True, None, False]),
            "length": pa.array([dt.timedelta(seconds=1.5), None, dt.timedelta(0)], pa.duration("ms")),
            "words": pa.array(["a", None, "b"]).dictionary_encode(),
            "text": pa.array(["1,5", None, "2,5"], pa.string_view()),
            "runs": pa.RunEndEncodedArray.from_arrays([2, 3], pa.array([7.0, 8.0])),
            "list": pa.array([[1], None, [2]]),
            "moment": pa.array([dt.datetime(2026, 3, 14, 8), None, None], pa.timestamp("s")),
        }
    )
    found = from_arrow(table, "run", ["note"])
    for name, numbers in (("whole", [1, np.nan, 3]), ("float", [1.5, np.nan, 2.5]), ("exact", [1.5, np.nan, 2.5]), ("text", [1.5, np.nan, 2.5]),
                          ("length", [1.5, np.nan, 0.0]), ("runs", [7.0, 7.0, 8.0])):  # fmt: skip
        np.testing.assert_array_equal(found.columns[name], np.array(numbers, dtype=float))
    assert found.columns["date"] == ["2026-03-14", "", "2026-03-15"]
    assert found.columns["clock"] == ["08:00:00", "", "09:00:00"]
    assert (found.columns["yes"], found.columns["words"]) == (["True", "", "False"], ["a", "", "b"])
    assert found.columns["moment"] == ["2026-03-14T08:00:00.000000", "", ""]
    assert (found.units["length"], found.durations) == ("s", ("length",))
    assert found.guesses[0].text.startswith("column 'list' of type list")
    assert (found.notes, list(found.lines)) == (("note",), [0, 1, 2])
    with pytest.raises(InputError, match="no column of numbers"):
        from_arrow(pa.table({"list": pa.array([[1]])}), "run", [])
    with pytest.raises(InputError, match="the column 'a' twice"):
        from_arrow(pa.Table.from_arrays([pa.array([1]), pa.array([1])], ["a", "a"]), "run", [])
    chunks = pa.chunked_array([[1.0, None], [], [3.0]], pa.float64())
    np.testing.assert_array_equal(tables.to_floats(chunks), [1.0, np.nan, 3.0])
    assert tables.to_floats(chunks.slice(2)).tolist() == [3.0]
    assert len(tables.to_floats(pa.chunked_array([], pa.float64()))) == 0


def test_a_parquet_file_is_as_large_as_its_words_in_every_row():
    """Each row counts; a damaged one is refused in words."""

    def packed(**columns):
        data = io.BytesIO()
        papq.write_table(pa.table(columns), data)
        return data.getvalue()

    found = read_parquet(packed(t=[0.0, 1.0], T=["20,5", "21,5"], w=["a", "b"]), "run.parquet", Limits())
    assert (found.columns["T"].tolist(), found.columns["w"], found.notes) == ([20.5, 21.5], ["a", "b"], ("Parquet, 2 rows",))
    data = packed(w=["x" * 1000] * 1000, t=np.arange(1000.0))
    read_parquet(data, "run.parquet", Limits(max_bytes=1_000_000))
    with pytest.raises(InputError, match="column 'w'"):
        read_parquet(data, "run.parquet", Limits(max_bytes=999_999))
    with pytest.raises(InputError, match="not a readable Parquet file"):
        read_parquet(data[:-20], "run.parquet", Limits())
    with pytest.raises(InputError, match="1000 rows"):
        read_parquet(data, "run.parquet", Limits(max_rows=999))


def test_wide_tables_of_nothing_but_numbers():
    """From 200 columns on; empty lines are left out, a row of another width or a word makes it none."""
    rows = [",".join(str(k + row) for k in range(200)) for row in range(40)]
    body = "\n".join([*rows[:35], "", *rows[35:]])
    for end in ("", "\n"):
        found = tables.wide_numbers((body + end).encode(), 200, ",")
        assert found.shape == (40, 200)
        assert found[:, 199].tolist() == [199.0 + row for row in range(40)]
    for end in ("", "\n"):
        assert tables.wide_numbers(("\n".join(rows) + end).encode(), 200, ",").shape == (40, 200)
    assert tables.wide_numbers(body.encode(), 199, ",") is None
    assert tables.wide_numbers(body.replace("7", "x").encode(), 200, ",") is None
    assert tables.wide_numbers((body + "\n1,2").encode(), 200, ",") is None
    assert tables.wide_numbers((body + ",").encode(), 200, ",") is None
    empty = "\n" * 40 + body
    assert len(tables.wide_numbers(empty.encode(), 200, ",")) == 40
