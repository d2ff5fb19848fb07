"""What cells are worth: units of temperature, codes of broken probes, false first readings, marks beside readings."""

import numpy as np
import pytest

from thermofast.errors import InputError, UsageError
from thermofast.reading.table import Table
from thermofast.reading.tables.dialect import Dialect
from thermofast.reading.values import degrees, faults, marks
from thermofast.reading_options import Options

WARMING = 20.0 + 0.1 * np.arange(12.0)


def _table(header=True, units=None, decimal=".", **columns):
    columns = {k: v if isinstance(v[0], str) else np.asarray(v, dtype=float) for k, v in columns.items()}
    rows = len(next(iter(columns.values())))
    units = {**dict.fromkeys(columns, ""), **(units or {})}
    dialect = Dialect("utf-8", ";", decimal, 0, (), 1, len(columns))
    return Table("run.csv", list(columns), columns, units, range(1, 1 + rows), (), header=header, dialect=dialect)


def _read(name, values, units="", options=Options(), others=(), is_input=False, header=True):  # noqa: B008 - frozen
    """(column in degC, notes, guesses) of one column among others."""
    values = np.array(values, dtype=float)
    names = [name, *others]
    table = _table(header, {name: units}, **dict.fromkeys(names, values))
    found = degrees.Temperatures(table, {name: units}, options, names)
    return found.of(name, values, is_input), found.notes(), [g.text for g in found.guesses()]


@pytest.mark.parametrize(
    ("name", "unit", "reading", "celsius", "note"),
    [
        ("front", "°C", 50.0, 50.0, None), ("front", "K", 300.0, 26.85, "front: kelvin, turned into degC"),
        ("front", "°F", 212.0, 100.0, "front: degF, turned into degC"), ("front [m°C]", "", 21500.0, 21.5, "readings times 0.001"),
        ("front", "0.1 °C", 215.0, 21.5, "front: readings times 0.1, as the unit says"), ("front [°F]", "", 32.0, 0.0, "degF"),
    ],
)  # fmt: skip
def test_temperatures_are_turned_into_degc_and_it_is_said(name, unit, reading, celsius, note):
    """By the unit line or the name."""
    found, notes, guesses = _read(name, [reading] * 3, unit)
    assert found == pytest.approx(np.full(3, celsius))
    assert (note is None and not notes) or note in notes[0]
    assert guesses == []


def test_the_unit_that_the_user_tells_is_that_of_all_or_of_one_column():
    """It overrules the file's, and says so; what is no unit or no column is refused."""
    found, notes, _ = _read("front [°C]", [212.0] * 3, options=Options(units=("F",)))
    assert found[0] == pytest.approx(100.0)
    assert notes == ["front [°C]: degF, turned into degC", "--units F overrules what the file says of front [°C]"]
    assert _read("front", [212.0] * 3, options=Options(units=("front=F", "C")))[0][0] == pytest.approx(100.0)
    assert _read("rear", [212.0] * 3, options=Options(units=("front=F", "C")), others=["front"])[0][0] == 212.0
    assert _read("front", [2120.0] * 3, options=Options(units=("°C x10",)))[0][0] == pytest.approx(212.0)
    for units, what in ((("rpm",), "is no unit of temperature"), (("rear=F",), "is no column of this record")):
        with pytest.raises(UsageError, match=what):
            _read("front", [20.0] * 3, options=Options(units=units))
    table = _table(front=WARMING)
    assert degrees.unit_told("front", Options(units=("front=F", "K")), table) == "F"
    assert degrees.unit_told("rear", Options(units=("front=F", "K")), table) == "K"
    assert degrees.unit_told("rear", Options(units=("front=F", "K")), table, by_name=True) == ""
    warm = degrees.warm_inputs(["front", "flow", "load"], {"flow": "°C"}, Options(units=("front=F",)), table)
    assert warm == ["front", "flow"]
    assert degrees.warm_inputs(["load", "speed"], {"speed": "rpm"}, Options(units=("C",)), table) == []


@pytest.mark.parametrize(("reading", "cold"), [(170.0, True), (170.5, False), (25.0, True)])
def test_what_is_too_cold_for_kelvin_is_of_a_thermocouple(reading, cold):
    """Up to 170 K; of an input nothing is said."""
    found, _, guesses = _read("front (K)", [reading] * 3)
    assert found[0] == pytest.approx(reading if cold else reading - 273.15)
    assert bool(guesses) is cold
    assert not cold or guesses == ["front (K): too cold for kelvin, read as degC"]
    assert _read("front (K)", [reading] * 3, is_input=True)[2] == []
    assert np.isnan(_read("front (K)", [np.nan] * 3)[0]).all()


def test_a_letter_at_the_end_of_all_names_is_a_unit():
    """Of two names at least; of one that begins at a room in degF; beside T_R it is a place."""
    found, _, guesses = _read("front_F", [212.0] * 3, others=["rear_F", "room_F1"])
    assert found[0] == pytest.approx(100.0)
    assert guesses == ["front_F read as degF, by the letter behind the name"]
    assert _read("front_K", [300.0] * 3, others=["rear_K"])[0][0] == pytest.approx(26.85)
    for begins, turned in ((55.0, True), (54.9, False), (95.0, True), (95.1, False)):
        assert _read("bearing_F", [begins, begins, 150.0])[0][0] == pytest.approx((begins - 32.0) / 1.8 if turned else begins)
    assert _read("bearing_F", [70.0] * 3, others=["bearing_R"])[0][0] == 70.0
    assert _read("bearing_F", [70.0] * 3, is_input=True)[0][0] == 70.0
    assert _read("T_F", [70.0] * 3, others=["T_R"])[0][0] == 70.0
    assert _read("bearing", [70.0] * 3)[0][0] == 70.0
    assert degrees._common_letter(["front_F", "rear_F"]) == "F"
    assert degrees._common_letter(["front_F"]) is None
    assert degrees._common_letter(["front_F", "rear_K"]) is None
    assert degrees._common_letter(["front", "rear"]) is None


@pytest.mark.parametrize(
    ("name", "begins", "what"),
    [
        ("a", 278.0, "a room in kelvin"), ("a", 318.0, "a room in kelvin"), ("a", 277.9, ""), ("a", 318.1, ""),
        ("room", 55.0, "a room in degF or a hot chamber"), ("room", 95.0, "a room in degF"), ("room", 54.9, ""), ("room", 95.5, ""),
        ("pt front", 100.0, "ohms of a platinum resistor"), ("pt front", 130.0, "ohms"), ("pt front", 99.9, ""),
        ("pt front", 130.5, ""), ("rtd front", 1000.0, "ohms"), ("rtd front", 1300.0, "ohms"), ("a", 110.0, ""),
        ("a", 5001.0, "thousandths of a degree?"), ("a", 5001.5, ""), ("a", 199999.0, "thousandths"), ("a", 200000.0, ""), ("a", 200001.0, ""),
    ],
)  # fmt: skip
def test_a_column_that_begins_where_only_another_unit_makes_sense(name, begins, what):
    """By the median of its first three readings."""
    values = [np.nan, begins, 1e5, begins]
    if what:
        with pytest.raises(InputError, match="cannot be told") as told:
            _read(name, values)
        assert what in told.value.found
        assert told.value.found.startswith(f"{begins:g} to {begins:g}, ")
        assert _read(name, values, is_input=True)[0][1] == begins
    else:
        assert _read(name, values)[0][1] == begins


def test_sensors_that_begin_evenly_at_a_room_in_degf_ask_for_their_unit():
    """Three columns or more, none with a unit, within a kelvin of each other, which rise: a cold machine's in degF."""

    def guessed(*begins, rise=20.0):
        table = {f"c{k}": [begin, begin, begin, begin + rise] for k, begin in enumerate(begins)}
        found = degrees.Temperatures(_table(**table), {}, Options(), list(table))
        for name, values in table.items():
            found.of(name, np.array(values))
        return found.guesses()

    with pytest.raises(InputError) as told:
        guessed(68.1, 68.4, 69.8)
    assert told.value.found == "all 3 begin at 68.1 to 69.8: in a room in degF, or as evenly hot in degC"
    assert told.value.do == "say --units F or C"
    for begins, rise in (((68.1, 68.4), 20.0), ((68.1, 68.4, 70.0), 20.0), ((68.1, 68.4, 69.8), -20.0), ((54.0, 55.0, 55.1), 20.0)):
        assert len(guessed(*begins, rise=rise)) == 1


def test_a_hot_beginning_is_told_and_tenths_are_offered():
    """Above 120 degC, or where a room in degF would begin."""
    for begins, hot in ((120.0, False), (120.5, True), (55.0, True), (95.0, True), (54.5, False), (95.5, False), (30.0, False)):
        guesses = _read("bearing", [begins] * 3)[2]
        assert bool(guesses) is hot
        assert not hot or guesses == [f"no unit, taken for degC: bearing begins at {begins:g}"]
    for begins, tenths in ((130.0, True), (350.0, True), (129.0, False), (351.0, False), (200.5, False)):
        found = degrees.Temperatures(_table(bearing=[begins] * 3), {}, Options(), ["bearing"])
        found.of("bearing", np.full(3, begins))
        assert ("tenths" in found.guesses()[0].option) is tenths
    with pytest.raises(InputError) as told:
        _read("c1", [290.0] * 3, header=False)
    assert "--channels" in told.value.do
    with pytest.raises(InputError) as told:
        _read("c1", [290.0] * 3)
    assert told.value.do == "say --units K, F or C"


def test_a_unit_that_changes_in_all_columns_at_once_is_refused():
    """From degC to degF and back, three rows from the ends at least, in steps of 8 at least."""

    def changed(first, second, at=6, n=12, noise=0.0):
        column = np.where(np.arange(n) < at, first, second) + noise * np.arange(n)
        beside = column + np.where((np.arange(n) < at) == (second > first), 5.0, 9.0)
        degrees.refuse_another_unit([column, beside], _table(T1=column, T2=beside))

    with pytest.raises(InputError, match="line 8: the unit changes from degC to degF") as told:
        changed(25.0, 77.0)
    assert told.value.found == "25, then 77"
    with pytest.raises(InputError, match="from degF to degC"):
        changed(77.0, 25.0)
    for at in (4, 8):
        with pytest.raises(InputError, match="the unit changes"):
            changed(25.0, 77.0, at)
    for at in (3, 9):
        changed(25.0, 77.0, at)
    changed(25.0, 79.0)
    changed(25.0, 77.6)
    with pytest.raises(InputError):
        changed(25.0, 77.5)
    changed(-31.0, -23.8)
    with pytest.raises(InputError):
        changed(-29.5, -21.1)
    changed(25.0, 77.0, 3, 6)
    with pytest.raises(InputError):
        changed(25.0, 77.0, 4, 8)
    column = np.where(np.arange(12) < 6, 25.0, 77.0)
    degrees.refuse_another_unit([column, np.full(12, 25.0)], _table(T1=column))
    holes = column.copy()
    holes[0] = np.nan
    degrees.refuse_another_unit([column, holes], _table(T1=column))
    wild = column.copy()
    wild[4] = 40.0
    degrees.refuse_another_unit([wild, wild], _table(T1=column))
    degrees.refuse_another_unit([], _table(T1=column))


def test_a_winding_is_as_warm_as_its_resistance_says():
    """R / R0 (k + T0) - k; what no winding can be is another unit, from -100 to 800 degC."""
    options = Options(resistance=(2.0, 20.0, 235.0))
    ohms = np.array([2.0, 2.2])
    assert degrees.winding(ohms, "R", _table(R=ohms), options).tolist() == pytest.approx([20.0, 45.5])
    for factor, fine in ((4.05, True), (4.07, False), (0.54, True), (0.52, False)):
        if fine:
            degrees.winding(factor * np.full(3, 2.0), "R", _table(R=ohms), options)
            continue
        with pytest.raises(InputError, match="--resistance makes") as told:
            degrees.winding(factor * np.full(3, 2.0), "R", _table(units={"R": "mohm"}, R=ohms), options)
        assert (told.value.do, told.value.found) == ("say R0 in mohm", f"{2.0 * factor:.4g} mohm, R0 2")
    assert np.isnan(degrees.winding(np.full(3, np.nan), "R", _table(R=ohms), options)).all()


def test_words_in_a_column_of_temperatures_are_refused():
    """Numbers with another decimal sign are named as such where they are more than half."""
    with pytest.raises(InputError, match="another decimal sign") as told:
        degrees.refuse_words(_table(T1=["1,5", "2,5", "x"]), "T1")
    assert (told.value.found, "--decimal ," in told.value.do) == ("'1,5'", True)
    with pytest.raises(InputError, match="another decimal sign"):
        degrees.refuse_words(_table(decimal=",", T1=["1.5", "2.5", "x"]), "T1")
    with pytest.raises(InputError, match="no number in a column of temperatures") as told:
        degrees.refuse_words(_table(units={"T1": "°C"}, T1=["", "(21.0)", "(21.1)"]), "T1")
    assert told.value.found == "'(21.0)'"
    for cells, unit in ((["1,5", "x"], ""), (["", "---"], "°C"), (["on", "off"], "rpm"), (["1.5", "2.5"], "")):
        degrees.refuse_words(_table(units={"X": unit}, X=cells), "X")


@pytest.mark.parametrize(
    ("code", "kept"), [(85.0, False), (0.0, False), (-200.0, False), (1300.2, False), (1300.4, True), (86.0, True)]
)
def test_a_code_is_one_where_the_readings_jump_to_and_from_it(code, kept):
    """Of a probe that comes and goes; a reading that is passed by warming is none."""
    found, out = faults.without_impossible(np.where(np.arange(30) == 12, code, 60.0 + 0.1 * np.arange(30.0)))
    assert (out == 0) is kept
    assert bool(np.isfinite(found[12])) is kept
    through = np.linspace(80.0, 90.0, 101)
    assert faults.without_impossible(through)[1] == 0


def test_a_number_far_from_all_others_that_stands_there_twice_is_a_code():
    """By more than what those cover and 10 K more; not at an end alone, and twelve readings at least."""
    for code, taken in ((50.0, True), (49.1, False), (-50.0, True)):
        values = 19.0 + np.linspace(0.0, 10.1, 30)
        values[[7, 20]] = code
        assert np.flatnonzero(faults._same_far_away(values)).tolist() == ([7, 20] if taken else [])
    once = 20.0 + 0.1 * np.arange(30.0)
    once[7] = 90.0
    assert not faults._same_far_away(once).any()
    ends = 20.0 + 0.1 * np.arange(30.0)
    ends[-3:] = 90.0
    assert not faults._same_far_away(ends).any()
    for n, taken in ((12, True), (11, False)):
        values = 20.0 + 0.1 * np.arange(float(n))
        values[[3, 6]] = 90.0
        assert faults._same_far_away(values).any() == taken
    half = np.where(np.arange(20) % 2, 90.0, 20.0 + 0.01 * np.arange(20))
    assert not faults._same_far_away(half).any()


@pytest.mark.parametrize(
    ("name", "owner", "kinds"),
    [
        ("T2 Quality", "t2", {"quality"}), ("Quality", "", {"quality"}), ("T2_valid", "t2", {"valid"}), ("q", None, None),
        ("T2Status", "t2", {"status"}), ("Status code", "", {"statuscode"}), ("valid T2", "t2", {"valid"}), ("T2 q", "t2", {"q"}),
        ("front", None, None), ("Error [code]", "", {"error"}), ("T2 error flag", "t2", {"error", "flag"}), ("ok", "", {"ok"}),
    ],
)  # fmt: skip
def test_whose_mark_a_column_is(name, owner, kinds):
    """The words at its end, or at its beginning; a q alone is none."""
    assert marks._owner(name) == (None if owner is None else (owner, frozenset(kinds)))


def _bad(kinds, cells, of_row=False):
    found = marks.bad_by(frozenset(kinds.split()), cells if isinstance(cells[0], str) else np.array(cells, dtype=float), of_row)
    return None if found is None else found.tolist()


def test_marks_that_are_numbers():
    """OPC's codes, of both kinds, valid ones and faults."""
    assert _bad("quality", [192, 0, 64, 63]) == [False, True, False, True]
    assert _bad("q", [192, 0, 64, 63]) is None
    assert _bad("quality", [192, 0, 64, 216, 28]) == [False, True, False, False, True]
    assert _bad("q", [192, 0, 64]) == [False, True, False]
    assert _bad("quality", [192, 5, 255]) == [False, True, False]
    assert _bad("quality", [192, 5, 256]) is None
    assert _bad("q", [192, 5]) is None
    assert _bad("quality", [128, 64]) is None
    assert _bad("statuscode", [0.0, 2.0**31, 2.0**31 + 5]) == [False, True, True]
    assert _bad("status", [0.0, 2.0**31]) == [False, True]
    assert _bad("valid", [0.0, 2.0**31]) is None
    assert _bad("valid", [1, 0, 1]) == [False, True, False]
    assert _bad("valid", [1, 2]) is None
    assert _bad("fault", [0, 0, 1]) == [False, False, True]
    assert _bad("fault", [0, 1]) is None
    assert _bad("fault", [0, 0, 1], of_row=True) is None
    assert _bad("fault", [2, 2, 1]) is None
    assert _bad("status", [0, 0, 1]) is None
    for wrong in ([-1, 1], [0.5, 1], [np.nan, 1]):
        assert _bad("valid", wrong) is None
    assert marks.bad_by(frozenset(["valid"]), np.zeros(0), False) is None


def test_marks_that_are_words():
    """True and false by what the name says, known words, and codes in hexadecimals."""
    assert _bad("valid", ["True", "false", ""]) == [False, True, False]
    assert _bad("quality", ["1", "0"]) == [False, True]
    assert _bad("fault", ["true", "False", "0"]) == [True, False, False]
    assert _bad("fault", ["true", "false"]) is None
    assert _bad("status", ["OK", "Sensor break", ""]) == [False, True, False]
    assert _bad("status", ["run", "idle"]) is None
    assert _bad("status", ["ok", "idle"]) == [False, False]
    assert _bad("status", ["ok", "idle"], of_row=True) is None
    assert _bad("quality", ["Good", "Uncertain", "Bad"], of_row=True) == [False, False, True]
    assert _bad("statuscode", ["0x00000000", "0x80050000"]) == [False, True]
    assert _bad("status", ["no error", "error 7", "Over-range"]) == [False, True, True]


def test_readings_beside_a_bad_mark_are_left_out():
    """Of the mark's own sensor; of all where the mark stands alone; none where all are bad."""
    good = marks.good_readings(_table(time=[0, 1, 2], T2=[20, 21, 22], T3=[30, 31, 32], T2_valid=[1, 0, 1]))
    assert np.isnan(good.columns["T2"]).tolist() == [False, True, False]
    assert good.columns["T3"].tolist() == [30.0, 31.0, 32.0]
    assert good.notes == ("T2: 1 readings that 'T2_valid' marks as bad left out",)
    alone = marks.good_readings(_table(time=[0, 1, 2], T2=[20, 21, 22], T3=[30, 31, 32], valid=[1, 0, 1]))
    assert [np.isnan(alone.columns[n]).tolist() for n in ("T2", "T3")] == [[False, True, False]] * 2
    assert alone.columns["time"].tolist() == [0.0, 1.0, 2.0]
    two = marks.good_readings(_table(time=[0, 1, 2], T2=[20, 21, 22], valid=[1, 0, 1], ok=[1, 0, 1]))
    assert two.columns["T2"].tolist() == [20.0, 21.0, 22.0]
    every = marks.good_readings(_table(time=[0, 1, 2], T2_value=[20, 21, 22], T2_valid=[0, 0, 0]))
    assert every.notes == ("T2_value: every reading is marked as bad by 'T2_valid': kept",)
    unknown = marks.good_readings(_table(time=[0, 1, 2], T2=[20, 21, 22], T2_status=[1, 2, 3]))
    assert unknown.guesses[0].text == "what 'T2_status' says of T2 is not known (1, 2, 3): readings kept"
    assert marks.good_readings(_table(time=[0, 1, 2], T2=[20, 21, 22], T2_status=[1, 1, 1])).guesses == ()
    apart = marks.good_readings(_table(time=[0, 1, 2], T2_motor=[20, 21, 22], T2_valid=[1, 0, 1]))
    assert apart.columns["T2_motor"].tolist() == [20.0, 21.0, 22.0]
    table = _table(time=[0, 1], T2=[20, 21])
    assert marks.good_readings(table) is table


def test_marks_of_a_long_table():
    """Those of whole rows; words that are neither good nor bad are told."""
    value = np.array([20.0, 21.0, 22.0])
    found, count = marks.good_only(_table(value=value, quality=["Good", "Bad", "Good"]), value)
    assert (np.isnan(found).tolist(), count) == ([False, True, False], 1)
    for cells in (["Good"] * 3, ["Bad"] * 3):
        assert marks.good_only(_table(value=value, quality=cells), value)[1] == 0
    assert marks.good_only(_table(value=value, T2_quality=["Good", "Bad", "Good"]), value)[1] == 0
    told = marks.unsure(_table(value=value, quality=["Good", "Uncertain", "Bad"]))
    assert told[0].text == "readings that 'quality' marks as Uncertain are kept"
    for name, cells in (
        ("quality", ["Good", "Bad", ""]),
        ("status", ["Good", "idle", "Bad"]),
        ("quality", ["0x00", "0x80000000", "0x1"]),
    ):
        assert marks.unsure(_table(value=value, **{name: cells})) == ()


def test_what_is_heated_at_once_begins_where_its_first_reading_is():
    """Of a room in degF too: by the third reading the heated ones are degrees apart, and they were read as degC."""
    table = {"front": [67.95, 71.98, 75.4, 150.0], "rear": [67.98, 70.9, 73.3, 140.0], "bed": [68.05, 67.98, 68.0, 77.0]}
    found = degrees.Temperatures(_table(**table), {}, Options(), list(table))
    for name, values in table.items():
        found.of(name, np.array(values))
    with pytest.raises(InputError) as told:
        found.guesses()
    assert told.value.found == "all 3 begin at 67.95 to 68.05: in a room in degF, or as evenly hot in degC"
