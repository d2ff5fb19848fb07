"""Letters that may be a unit, a place or a type; units said of all columns; headers of controllers and recorders."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.reading.signs import sign_of
from thermofast.reading.tables.dialect import is_process_line, is_unit_line
from thermofast.reading.units import unit_above
from thermofast.reading.values.faults import false_first


def _read(tmp_path, head, columns, delimiter=",", **options):
    """A file of these columns under these lines, read."""
    rows = [delimiter.join(str(c) for c in row) for row in zip(*columns, strict=True)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    return tf.read(path, **options)


STAMPS = [f"2024-03-14 08:{k:02d}:00" for k in range(40)]
SECONDS = [60 * k for k in range(40)]
COLD = [f"{22.0 + 0.1 * k:.2f}" for k in range(40)]
AS_F = [f"{71.6 + 0.18 * k:.2f}" for k in range(40)]


@pytest.mark.parametrize(
    "head",
    [
        ['"#NAMES"', "t_stamp,front,rear", '"#TYPES"', "D,F,F"],
        ['"#NAMES"', "t_stamp,front,rear", '"#TYPES"', "date,D,D"],
        ["Time,front,rear", "DT,F,F"],
    ],
)
def test_the_types_of_a_database_are_no_units(tmp_path, head):
    run = _read(tmp_path, head, (STAMPS, COLD, COLD))
    assert list(run.channels) == ["front", "rear"]
    assert [c[0] for c in run.channels.values()] == [22.0, 22.0]


def test_a_line_of_types_needs_a_date():
    assert is_process_line(["D", "F", "F"])
    assert not is_unit_line(["D", "F", "F"])
    assert is_unit_line(["s", "F", "F"])
    assert not is_process_line(["d", "F", "F"])  # days
    assert is_process_line(["Sensor", "J", "Typ K", "Pt100"])
    assert not is_process_line(["Sensor", "front", "rear"])
    assert not is_unit_line([])


@pytest.mark.parametrize("head", [["Time (s),Bearing (F),T2 [C]"], ["Time,front,rear", "C,F,F"], ["Time,a,b", "Filter,F,F"]])
def test_a_bare_f_colder_than_any_machine_is_asked_for(tmp_path, head):
    """22 under an F is a room in degC, and a frosty one in degF."""
    columns = (SECONDS if "(s)" in head[0] else STAMPS, COLD, COLD)
    with pytest.raises(tf.InputError, match=r"the unit of column .* cannot be told") as told:
        _read(tmp_path, head, columns)
    assert "-5.5 degC in degF" in told.value.found
    assert next(iter(_read(tmp_path, head, columns, units="C").channels.values()))[0] == 22.0
    assert next(iter(_read(tmp_path, head, columns, units="F").channels.values()))[0] == pytest.approx(-5.556, abs=1e-3)


@pytest.mark.parametrize(("name", "first"), [("T (F)", 22.0), ("T [F]", 22.0), ("T (°F)", -5.556)])
def test_a_bare_f_of_a_machine_in_degf_and_a_sign_are_taken(tmp_path, name, first):
    column = AS_F if first > 0.0 else COLD
    run = _read(tmp_path, [f"Time (s),{name}"], (SECONDS, column))
    assert next(iter(run.channels.values()))[0] == pytest.approx(first, abs=1e-3)


def test_a_unit_said_of_all_leaves_columns_their_own(tmp_path):
    columns = SECONDS, AS_F, COLD
    run = _read(tmp_path, ["Time (s),T1,Room (°C)"], columns, units="F")
    assert run.channels["T1"][0] == pytest.approx(22.0)
    assert run.ambient["Room (°C)"][0] == 22.0
    assert any("Room (°C) kept its own" in note for note in run.notes)
    said = {c.name: c.unit for c in run.seen.columns}
    assert (said["T1"], said["Room (°C)"]) == ("F", "C")
    # Where all have one it puts them right.
    both = _read(tmp_path, ["Time (s),T1 [°C],Room (°C)"], columns, units="F")
    assert both.ambient["Room (°C)"][0] == pytest.approx((22.0 - 32.0) / 1.8)


def test_two_that_begin_in_degf_beside_a_room_in_degc_are_asked_for(tmp_path):
    head, columns = ["Time (s),T1,T2,Room (°C)"], (SECONDS, AS_F, AS_F, ["22.0"] * 40)
    with pytest.raises(tf.InputError, match="the unit of its temperatures cannot be told") as told:
        _read(tmp_path, head, columns)
    assert told.value.found == "2 that begin at 71.6 to 71.6: in degF beside a room of 22 degC, or as evenly hot in degC"
    assert _read(tmp_path, head, columns, units="F").channels["T1"][0] == pytest.approx(22.0)
    assert _read(tmp_path, head, (*columns[:3], ["26.0"] * 40)).channels["T1"][0] == 71.6  # a warm machine in a room


@pytest.mark.parametrize("units", ["Pt100", "Pt100 front (Ohm)=Pt100"])
def test_ohms_said_to_be_platinum_are_sensors(tmp_path, units):
    head, columns = ["Time (s),Pt100 front (Ohm),Room (°C)"], (SECONDS, [f"{108.58 + 0.01 * k:.3f}" for k in range(40)], COLD)
    with pytest.raises(tf.InputError, match="no sensor column") as told:
        _read(tmp_path, head, columns)
    assert "units=" in told.value.do or "--units Pt100" in told.value.do
    run = _read(tmp_path, head, columns, units=units)
    assert next(iter(run.channels.values()))[0] == pytest.approx(22.03, abs=0.01)
    assert run.ambient["Room (°C)"][0] == 22.0


def test_clocks_that_end_at_other_rows_are_each_of_the_columns_beside_them(tmp_path):
    slow = [str(60 * k) if 60 * k <= 390 else "" for k in range(40)]
    house = [f"{22.0 + 0.5 * k:.2f}" if 60 * k <= 390 else "" for k in range(40)]
    fast = [10 * k for k in range(40)]
    run = _read(tmp_path, ["Time fast [s],front [°C],Time slow [s],housing [°C]"], (fast, COLD, slow, house))
    housing = next(c for n, c in run.channels.items() if n.startswith("housing"))
    assert np.isfinite(housing).sum() == 7
    assert housing[run.time_s == 360.0][0] == 25.0
    # Rows without a time between others are to be mended, and no end of a clock.
    with pytest.raises(tf.InputError, match="without a time"):
        _read(tmp_path, ["Time fast [s],front [°C],Time slow [s],housing [°C]"], (["0", "", *fast[2:]], COLD, slow, house))


def test_remarks_of_as_many_words_as_columns_are_no_names(tmp_path):
    head = ["# rig: spindle 7", "# temps in degrees F", "# dt=30s"]
    run = _read(tmp_path, head, (SECONDS, AS_F, AS_F), " ")
    assert list(run.channels) == ["column 2", "column 3"]
    assert run.channels["column 2"][0] == pytest.approx(22.0)


@pytest.mark.parametrize(("line", "unit"), [("# temps in degrees F", "F"), ("# values are °C", "C"), ("# degree of fit", "")])
def test_a_scale_in_words(line, unit):
    assert unit_above([line]) == unit


def test_a_scope_export_that_begins_with_its_file(tmp_path):
    head = ["Name\tScope Project", "File\tD:\\scope\\warmup.svdx", "StartTime\t133548777200000000\t14.03.2024 08:15:20", ""]
    head += ["Name\tT_front\tName\tT_rear", "SampleTime[ms]\t60000\tSampleTime[ms]\t60000", "Unit\t°C\tUnit\t°C", ""]
    clock = [1000 * s for s in SECONDS]
    run = _read(tmp_path, head, (clock, COLD, clock, COLD), "\t")
    assert [n.split(" ")[0] for n in run.channels] == ["T_front", "T_rear"]
    assert run.time_s[-1] == 60.0 * 39


def test_a_controllers_tag_in_front_says_nothing():
    assert sign_of("[PLC]T_Front", "").kind == sign_of("T_Front", "").kind == "sensor"
    assert sign_of("[°C]", "").unit is not None


@pytest.mark.parametrize("word", ["BURN OUT", "OTC", "OVLD"])
def test_words_of_recorders_are_no_reading(tmp_path, word):
    run = _read(tmp_path, ["Time (s),T1,T2"], (SECONDS, COLD, [word] * 40))
    assert run.channels["T1"][0] == 22.0
    assert not any(np.isfinite(c).any() for n, c in run.channels.items() if n == "T2")


def test_a_false_first_reading_is_that_of_its_own_column():
    rise = 20.0 + 0.1 * np.arange(60.0)
    false = rise.copy()
    false[0] = 85.0
    assert false_first([rise, false, rise]).tolist() == [0, 1, 0]
