"""Text tables that are not yet a row a line, and rows that are no readings: quotes, segments, headers, footers, words among numbers."""

import numpy as np
import pytest

from thermofast.errors import InputError
from thermofast.reading.tables import lines, text
from thermofast.reading.tables.dialect import Dialect
from thermofast.reading.tables.encoding import to_utf8
from thermofast.reading_options import Options


def _read(*rows, options=Options(), end="\n"):  # noqa: B008 - frozen
    return text.read_text((end.join(rows) + end).encode(), "run.csv", options)


def _rows(count=8, delimiter=",", first=0):
    return [delimiter.join((str(60 * k), f"{20 + 0.1 * k:.1f}", f"{30 + 0.2 * k:.1f}")) for k in range(first, first + count)]


HEAD = "time_s,T1,T2"


def test_bytes_are_counted_across_the_pieces_that_they_are_looked_at_in():
    """A line that begins with the first byte of a piece is one."""
    for before in (lines.AT_ONCE - 1, lines.AT_ONCE, 2 * lines.AT_ONCE - 1):
        data = b"a" * before + b"\nxyz\n"
        assert lines.newlines(data, len(data)) == 2
        assert lines.newlines(data, len(data) - 1) == 1
        assert lines.begins_of_lines(data) == {ord("a"), ord("x")}
    assert lines.begins_of_lines(b"") == set()
    assert lines.newlines(b"", 0) == 0


def test_quotes_around_whole_rows_and_between_blanks():
    """Also Fortran's exponents, and what a page or an archive leaves in the text."""
    whole, notes = lines.plain_rows(b'head\n"0,20.1"\n"60,20.2"\n')
    assert (whole, notes) == (b"head\n0,20.1\n60,20.2\n", ["quotes around whole rows left out"])
    blanks, notes = lines.plain_rows(b'"t" "T1"\n"0" "20.1"\n"60" 20.2\n')
    assert (blanks, notes) == (b'"t"\t"T1"\n"0"\t"20.1"\n"60"\t20.2\n', ["quoted cells between blanks"])
    mixed = b'head\n"0,20.1"\n60,20.2\n'
    assert lines.plain_rows(mixed) == (mixed, [])
    fortran, notes = lines.plain_rows(b"t,T\n0,1.5D+01\n1,.25d-02\n2,20\n")
    assert fortran == b"t,T\n0,1.5E+01\n1,.25E-02\n2,20\n"
    assert notes == ["numbers with Fortran's D for the exponent"]
    half = b"t,T\n0,1.5D+01\n1,20\n"
    assert lines.plain_rows(half) == (half, [])
    assert lines.plain_rows(b"T [&deg;C]\n20\n&#176;\n")[0] == "T [°C]\n20\n°\n".encode()
    marked, notes = lines.plain_rows(b"t;T\n0;20\n$RT_OFF$;5\n60;21\n$RT_COUNT$;2")
    assert (marked, len(notes)) == (b"t;T\n0;20\n60;21\n", 1)
    assert lines.plain_rows(b"a\n")[1] == []


def test_cells_with_line_breaks_stand_in_one_line():
    """With empty lines below, so that line numbers hold; a quote that nothing closes is left out."""
    head = b"t,T,note\n0,20,a\n"
    assert lines.closed_quotes(head) == (head, [])
    assert lines.closed_quotes(head + b'1,21,"x"\n') == (head + b'1,21,"x"\n', [])
    two = head + b'1,21,"on\ntwo"\n2,22,b\n'
    assert lines.closed_quotes(two) == (head + b'1,21,"on two"\n\n2,22,b\n', ["1 cell with line breaks joined"])
    three = head + b'1,21,"on\r\nthe\r\nway"\r\n2,22,"x\ny"\n3,23,c\n'
    found, notes = lines.closed_quotes(three)
    assert found == head + b'1,21,"on the way"\n\n\n2,22,"x y"\n\n3,23,c\n'
    assert notes == ["2 cells with line breaks joined"]
    for wrong in (b'1,21,"open\n2,22,b\n', b'1,21,x"\n2,22,b\n'):
        found, notes = lines.closed_quotes(head + wrong)
        assert found == head + wrong.replace(b'"', b"")
        assert notes == ["unbalanced quotes removed (line 3)"]
    rows = head + b'1,21,"open\n2,22,b\n3,23,c"\n'
    assert lines.closed_quotes(rows)[1] == ["unbalanced quotes removed (line 3, 5)"]
    inner = head.replace(b"\n", b"\r\n") + b'1,21,"on\rtwo"\r\n'
    assert lines.closed_quotes(inner)[0] == head.replace(b"\n", b"\r\n") + b'1,21,"on two"\r\n'
    old = (head + b'1,21,"on\ntwo"\n2,22,b\n').replace(b"\n", b"\r")
    assert lines.closed_quotes(old)[0] == (head + b'1,21,"on two"\n\n2,22,b\n').replace(b"\n", b"\r")


@pytest.mark.parametrize(
    ("line", "opens"),
    [
        (b'1,"a', True), (b'1,"a"', False), (b'1,"a""', True), (b'1,"a""b"', False), (b'1, "a', True), (b'1,a"b', False),
        (b'"a","b', True), (b'"a,b",c', False), (b'"a" x,"b', True), (b"", False), (b'"', True), (b'1,2,', False),
    ],
)  # fmt: skip
def test_a_quoted_cell_that_a_line_leaves_open(line, opens):
    """A doubled quote is one within, and one within a cell opens none."""
    assert lines._opens(line, b",") is opens


def test_lines_at_the_end_and_the_delimiter_of_a_spreadsheet():
    """Empty lines at the end do not count."""
    assert lines.without_last(b"a\nb\nc\n\n", 1) == b"a\nb\n"
    assert lines.without_last(b"a\rb\rc", 2) == b"a\r"
    assert lines.without_last(b"a\n", 3) == b""
    assert lines.without_separator_line(b"sep=;\r\nt;T\r\n") == (b"\r\nt;T\r\n", ";")
    assert lines.without_separator_line(b'"sep=|"\nt|T\n') == (b"\nt|T\n", "|")
    assert lines.without_separator_line(b"sep=;;\n") == (b"sep=;;\n", "")


def _lying(width, sensors=1, mark=",", before=(), first="time_s", cell="20.{}"):
    rows = [mark.join([first, *before, *(str(60 * k) for k in range(width - 1 - len(before)))])]
    names = ["front", "rear", "room"][:sensors]
    rows += [mark.join([n, *before, *(cell.format(k) for k in range(width - 1 - len(before)))]) for n in names]
    return "\n".join(rows).encode() + b"\n"


def test_a_table_that_lies_on_its_side_is_turned():
    """Three times as wide as it is high at least; moments go on, names are words and no two alike."""
    turned, guesses = lines.transposed(_lying(6))
    assert turned.decode().splitlines()[:3] == ["time_s,front", "0,20.0", "60,20.1"]
    assert guesses[0].text.startswith("a table of 1 rows and 6 columns that lies on its side")
    assert lines.transposed(_lying(9, 2))[1]
    assert not lines.transposed(_lying(8, 2))[1]
    assert not lines.transposed(_lying(5))[1]
    assert lines.transposed(_lying(8, mark=";", cell="20,{}"))[0].decode().splitlines()[1] == "0;20,0"
    units = lines.transposed(_lying(9, before=("s",)))[0].decode().splitlines()
    assert units[:3] == ["time_s,front", "s,s", "0,20.0"]
    assert lines.transposed(_lying(9, before=("a", "b")))[1]
    assert not lines.transposed(_lying(12, before=("a", "b", "c")))[1]
    titled = b"Test 7\n" + _lying(9, 2)
    assert lines.transposed(titled)[0].startswith(b"Test 7\ntime_s,front,rear\n")
    for wrong in (
        _lying(9, 2).replace(b"rear", b"front"),
        _lying(9).replace(b",120,", b",60,"),
        _lying(9).replace(b"front", b"7"),
        _lying(9, first="what"),
        _lying(9, cell="x{}"),
        b"time_s,front\n" * 3,
        b"",
    ):
        assert lines.transposed(wrong) == (wrong, [])
    stamps = b"," + b",".join(b"08:0%d" % k for k in range(8)) + b"\nfront," + b",".join(b"20.%d" % k for k in range(8)) + b"\n"
    assert lines.transposed(stamps)[0].decode().splitlines()[:2] == ["time,front", "08:00,20.0"]


SEGMENT = "X_Value\tT1\tComment"


def _labview(*segments, head=("LabVIEW Measurement\t", "Separator\tTab"), names=SEGMENT):
    rows = [*head, "***End_of_Header***"]
    for k, values in enumerate(segments):
        rows += ["Channels\t1", "Samples\t2", "***End_of_Header***", names if k == 0 or names else SEGMENT]
        rows += [f"{t}\t{v}" for t, v in values]
    return ("\n".join(rows) + "\n").encode()


def test_segments_of_a_labview_file_stand_under_the_first_header():
    """Line numbers hold; other channels are refused."""
    data = _labview([(0, 20), (1, 21)], [(2, 22), (3, 23)], [(4, 24)])
    found, notes = lines.joined_segments(data, "run.lvm")
    assert notes == ["3 segments joined"]
    before, after = data.decode().split("\n"), found.decode().split("\n")
    for value in ("0\t20", "1\t21", "2\t22", "3\t23", "4\t24"):
        assert before.index(value) == after.index(value)
    assert after.count(SEGMENT) == 1
    assert sum(line.startswith("Channels") for line in after) == 1
    one = _labview([(0, 20), (1, 21)])
    assert lines.joined_segments(one, "run.lvm") == (one, [])
    assert lines.joined_segments(b"t,T\n", "run.csv") == (b"t,T\n", [])
    with pytest.raises(InputError, match="line 13: segment 2 has other channels"):
        lines.joined_segments(data.replace(SEGMENT.encode() + b"\n2", b"X_Value\tT9\n2"), "run.lvm")


def test_a_labview_file_without_times_has_those_of_its_step():
    """From X0 on, every Delta_X; with the decimal sign of the file."""
    head = ["LabVIEW Measurement\t", "X_Columns\tNo", "***End_of_Header***"]
    rows = [*head, "X0\t2.5\t2.5", "Delta_X\t0.5\t0.5", "***End_of_Header***", SEGMENT, "\t20", "\t21", "\t"]
    found, notes = lines.joined_segments(("\n".join(rows) + "\n").encode(), "run.lvm")
    assert found.decode().split("\n")[7:10] == ["2.5\t20", "3\t21", "\t"]
    assert notes == ["no column of times: one row every 0.5 s, as Delta_X has it"]
    comma = [head[0], "Decimal_Separator\t,", *head[1:], "X0\t0,0", "Delta_X\t0,5", "***End_of_Header***", SEGMENT, "\t20", "\t21"]
    assert lines.joined_segments(("\n".join(comma) + "\n").encode(), "run.lvm")[0].decode().split("\n")[8:10] == [
        "0\t20",
        "0,5\t21",
    ]
    assert lines.joined_segments(("\n".join(r.replace("X0\t2.5\t2.5", "X0\t\t") for r in rows)).encode(), "run.lvm")[1] == notes
    apart = [r.replace("Delta_X\t0.5\t0.5", "Delta_X\t0.5\t0.6") for r in rows]
    assert lines.joined_segments(("\n".join(apart) + "\n").encode(), "run.lvm")[1] == []


def test_a_header_that_stands_again_with_other_columns():
    """Rows are put under all names, each under its own; names that are not told apart are left to the rules for rows."""
    found = _read("time_s,T1,T2", "0,20,30", "60,21,31", "time_s,T2,T3", "120,32,40", "180,33,41", "240,34,42")
    assert found.names == ["time_s", "T1", "T2", "T3"]
    assert found.columns["time_s"].tolist() == [0.0, 60.0, 120.0, 180.0, 240.0]
    np.testing.assert_array_equal(found.columns["T1"], [20.0, 21.0, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(found.columns["T2"], [30.0, 31.0, 32.0, 33.0, 34.0])
    np.testing.assert_array_equal(found.columns["T3"], [np.nan, np.nan, 40.0, 41.0, 42.0])
    assert "the header stands again in line 4 with other columns: rows put under their names" in found.notes
    turned = _read("time_s,T1,T2", "0,20,30", "60,21,31", "time_s,T2,T1", "120,32,22", "180,33,23")
    assert turned.columns["T1"].tolist() == [20.0, 21.0, 22.0, 23.0]
    same = _read("time_s,T1,T2", "0,20,30", "60,21,31", "time_s,T1,T2", "120,22,32")
    assert same.columns["T1"].tolist() == [20.0, 21.0, 22.0]
    assert "1 repeated headers left out" in same.notes
    assert same.headers == (3,)
    with pytest.raises(InputError, match="line 4: the header stands again with other units"):
        _read("time_s,T1 [°C],T2", "0,20,30", "60,21,31", "time_s,T1 [K],T2", "120,300,32")
    with pytest.raises(InputError, match="line 4: the header stands again with other columns"):
        _read("time,T1,T2", "s,°C,°C", "0,20,30", "time,T2,T1", "60,300,32", "120,301,33")


def test_an_export_of_twincat_scope_has_one_line_of_names():
    """Clocks of single channels are called time, units stand behind the names."""
    rows = [
        "Name\tScope\tx",
        "File\tc:\\a",
        "Starttime of export\t1",
        "",
        "Name\tfront\tName\trear",
        "Unit\t°C (x)\tUnit\t(None)",
        "",
    ]
    found, notes = lines.plain_scope(("\n".join([*rows, "0\t20\t0\t30", "1\t21\t1\t31"]) + "\n").encode())
    shown = found.decode().split("\n")
    assert shown[4] == "Time [ms]\tfront [°C]\tTime [ms]\trear"
    assert shown[7:9] == ["0\t20\t0\t30", "1\t21\t1\t31"]
    assert notes == ["TwinCAT Scope export: 2 channels"]
    assert lines.plain_scope(b"Name\tT1\n0\t20\n") == (b"Name\tT1\n0\t20\n", [])


def test_a_last_line_that_stops_in_mid_number_is_left_out():
    """Fewer decimals than all rows before, of six rows at least."""
    dialect = Dialect("utf-8", ",", ".", 0, (), 1, 2)

    def left(rows, last):
        body = "".join(f"{k},20.{10 + k}\n" for k in range(rows)).encode()
        return lines.without_cut_end(body + last, dialect)[0] == body

    assert left(5, b"9,20.1")
    assert left(5, b"9,20.")
    assert left(5, b"9,2")
    assert not left(4, b"9,20.1")
    assert not left(5, b"9,20.11")
    assert not left(5, b"9,20.1\n")
    assert not left(5, b"9,hot")
    assert not left(5, b"9,20.1,")
    uneven = b"0,20.1\n1,20.15\n2,20.1\n3,20.15\n4,20.1\n5,20"
    assert lines.without_cut_end(uneven, dialect) == (uneven, [])
    assert lines.without_cut_end(uneven[:-1], dialect) == (
        uneven[:-4],
        ["the last line stops in mid-number ('2') and was left out"],
    )
    many = b"".join(b"%d,20.%d\n" % (k, 1 + 7 * k) for k in range(12))
    assert lines.without_cut_end(many + b"12,20", dialect)[0] == many  # who leaves out noughts wrote none in twelve rows
    few = b"".join(many.splitlines(keepends=True)[:7])
    assert lines.without_cut_end(few + b"12,20", dialect) == (few + b"12,20", [])
    assert lines.without_cut_end(b"0,20.11\n" * 6 + b"1,20.1", dialect)[1] == [
        "the last line stops in mid-number ('20.1') and was left out"
    ]


def test_lines_below_the_readings_are_left_out():
    """Words where the others begin with a number; as wide or not, and one cut short."""
    found = _read(HEAD, *_rows(40), "Mean,20.3,30.7", "Max,20.7,31.4")
    assert len(found.columns["T1"]) == 40
    assert "2 lines below the readings left out (Mean, Max)" in found.notes
    assert "1 lines below the readings left out ('Mean of all:')" in _read(HEAD, *_rows(), "Mean of all:").notes
    assert "the last line (10) is cut short and was left out" in _read(HEAD, *_rows(), "480,2").notes
    assert len(_read(HEAD, *_rows(), "480,2").columns["T1"]) == 8
    testo = _read("time_s;T1;T2", *_rows(40, delimiter=";"), ";Min:;20.0")
    assert "1 lines below the readings left out (Min:)" in testo.notes
    for row, wide in (("480,21,22,23", 4), ("480,21", 2)):
        with pytest.raises(InputError, match=f"line 6: the row has {wide} cells, the others 3"):
            _read(HEAD, *_rows(4), row, *_rows(4, first=5))
    with pytest.raises(InputError) as told:
        _read(HEAD, *_rows(4), "480,21", *_rows(2, first=5), "1,2", *_rows(2, first=8))
    assert told.value.do.startswith("mend the row and 1 more like it")
    assert "the last 2 lines left out, as told" in _read(HEAD, *_rows(), options=Options(skip_footer=2)).notes
    assert len(_read(HEAD, *_rows(), options=Options(skip_footer=2)).columns["T1"]) == 6


def test_lines_without_readings_among_the_rows():
    """Comments, events and the header again are counted, and rows keep the lines that they have in the file."""
    found = _read(HEAD, *_rows(3), "# comment", *_rows(1, first=3), "door opened", "", *_rows(3, first=4))
    assert {"1 comment lines left out", "1 lines without readings left out"} < set(found.notes)
    assert list(found.lines) == [1, 2, 3, 5, 8, 9, 10]
    assert found.columns["time_s"].tolist() == [60.0 * k for k in range(7)]
    assert list(_read(HEAD, *_rows(4), "", "").lines) == [1, 2, 3, 4]
    for sign in ("%", "//"):
        assert "1 comment lines left out" in _read(HEAD, *_rows(3), f"{sign} comment", *_rows(2, first=3)).notes


def test_decimal_commas_between_commas():
    """Twice as many cells as names, or one less where the time has no fraction."""
    found = _read("time_s,T1", "0,0,20,5", "60,5,21,5", "120,0,22,5")
    assert found.columns["time_s"].tolist() == [0.0, 60.5, 120.0]
    assert found.columns["T1"].tolist() == [20.5, 21.5, 22.5]
    whole = _read("time_s,T1,T2", "0,20,5,30,1", "60,21,5,31,2", "120,22,5,-32,3")
    assert whole.columns["time_s"].tolist() == [0.0, 60.0, 120.0]
    assert whole.columns["T2"].tolist() == [30.1, 31.2, -32.3]
    assert whole.guesses[0].text.startswith("decimal commas in a comma-separated file")


def test_thousands_have_signs_of_their_own():
    """One number of several groups says what a single group is."""
    found = _read("time_s;n", "0;60,000", "1;1,020,000", "2;2,040,000.5", "3;999")
    assert found.columns["n"].tolist() == [60000.0, 1020000.0, 2040000.5, 999.0]
    comma = _read("time_s;n", "0;60.000", "1;1.020.000", "2;2.040.000", "3;0,5", options=Options(decimal=","))
    assert comma.columns["n"].tolist() == [60000.0, 1020000.0, 2040000.0, 0.5]


def test_words_among_numbers_are_told_where_the_column_is_used():
    """By line, as many as there are; a column of words alone is no fault, nor one of numbers in their unit."""
    rows = [f"{60 * k},{20 + k if k not in (3, 5) else 'hot'}" for k in range(12)]
    found = _read("time_s,T1", *rows)
    fault = found.faults["T1"]
    assert "line 5, column 'T1': not a number" in str(fault)
    assert fault.found == "'hot' in 2 rows"
    assert np.flatnonzero(np.isnan(found.columns["T1"])).tolist() == [3, 5]
    once = _read("time_s,T1", *rows[:5], *rows[6:]).faults["T1"]
    assert once.found == "'hot'"
    assert _read("time_s,T1", *rows, options=Options(missing=("HOT",))).faults == {}
    mostly = [f"{60 * k},{20 + k if k > 9 else 'hot'}" for k in range(12)]
    open_ = _read("time_s,T1", *mostly).faults["T1"]
    assert open_.found == "'hot' in 10 rows"
    assert "line 2, column 'T1': not a number" in str(open_)
    assert _read("time_s,T1,x", *(f"{60 * k},20,{'ab'[k % 2]}" for k in range(12))).faults == {}
    carried = _read("time_s,T1", *(f"{60 * k},{20 + k} °F" for k in range(12)))
    assert (carried.units["T1"], carried.columns["T1"][1]) == ("°F", 21.0)
    signs = _read("time_s,T1", *(f"{60 * k},{20 + k}.5 {'H' if k % 3 else '*'}" for k in range(12)))
    assert "no number in a column of temperatures" in str(signs.faults["T1"])
    assert "line 2, column" in str(signs.faults["T1"])
    assert signs.faults["T1"].found.endswith(" in 12 rows")


def test_minus_signs_of_typesetters_and_line_ends_of_all_systems():
    """Also a header of a serial number wider than its rows, and rows of delimiters alone."""
    assert _read("time_s,T1", "0,\u22125.5", "60,\u20136", "120,7").columns["T1"].tolist() == [-5.5, -6.0, 7.0]
    for end in ("\r", "\r\n", "\r\r\n"):
        assert _read(HEAD, *_rows(4), end=end).columns["T2"].tolist() == pytest.approx([30.0, 30.2, 30.4, 30.6])
    assert _read(HEAD, *_rows(3), ",,", ",,", *_rows(2, first=3)).columns["time_s"].tolist() == [0.0, 60.0, 120.0, 180.0, 240.0]
    serial = _read(HEAD + ",serial", *[r + (",7" if k == 0 else "") for k, r in enumerate(_rows(4))])
    assert serial.names == ["time_s", "T1", "T2"]
    blank = _read("time_s  T1", "  0   20.5 ", " 60\t21.5")
    assert blank.columns["T1"].tolist() == [20.5, 21.5]
    assert _read("sep=~", "time_s~T1", "0~20.5", "60~21.5").columns["T1"].tolist() == [20.5, 21.5]
    for empty in ("", " \n\n"):
        with pytest.raises(InputError, match="the file is empty"):
            text.read_text(empty.encode(), "run.csv", Options())
    with pytest.raises(InputError, match="a header and no row of readings"):
        _read(HEAD)


def test_the_sample_ends_with_a_line_and_offsets_are_those_of_lines():
    """Beyond a quarter of a mebibyte and eight lines."""
    row = b"x" * 99 + b"\n"
    assert text._sample_end(row * 3000) == 2622 * 100
    long = b"y" * 200_000 + b"\n"
    assert text._sample_end(long * 20) == 9 * len(long)
    assert text._sample_end(b"a\nb") == 3
    assert [text._offset(b"a\r\nb\rc\nd", k) for k in range(5)] == [0, 3, 5, 7, 8]


@pytest.mark.parametrize("told", [None, "utf-8", "cp1252"])
def test_nuls_are_left_out_whether_the_encoding_is_told_or_not(told):
    data, encoding, notes = to_utf8(b"time_s,a\n0,20.3\n\0\x0060,20.4\n", "f", told)
    assert data == b"time_s,a\n0,20.3\n60,20.4\n"
    assert encoding == (told or "utf-8")
    assert notes == ["2 NUL bytes left out (the logger lost power?)"]


def test_nuls_of_utf_16_are_letters():
    data, _, notes = to_utf8("time_s,a\n0,20.3\n".encode("utf-16-le"), "f", "utf-16-le")
    assert (data, notes) == (b"time_s,a\n0,20.3\n", [])
