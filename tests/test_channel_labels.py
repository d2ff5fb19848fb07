"""Names in lines about the header: what a preamble, a list or a line of comments says stands at CH1."""

import math

import pytest

from thermofast.errors import InputError, UsageError
from thermofast.reading.headings.called import check_names, columns_named
from thermofast.reading.headings.labels import designation, labelled
from thermofast.reading.source import read_runs
from thermofast.reading_options import Options


def written(tmp_path, head, delimiter=",", columns=3):
    """A file with that head over 40 readings a minute apart of so many columns; the last stays at 20.1."""
    rows = []
    for i in range(40):
        warm = [20.0 + (5 + k) * (1.0 - math.exp(-i / 30.0)) for k in range(columns - 1)]
        rows.append(delimiter.join([f"{i}", *(f"{w:.2f}" for w in warm), "20.1"]))
    path = tmp_path / "run.csv"
    path.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")
    return str(path)


def read(path, **options):
    (run,) = read_runs(path, Options(**options))
    return run


@pytest.mark.parametrize(
    ("head", "sensors", "room"),
    [
        (
            "AMP settings\nCH,Signal name,Input,Range,Filter\nCH1,Front,TEMP,TC_K,Off\nCH2,Rear,TEMP,TC_K,Off\nCH3,Room,TEMP,TC_K,Off\n"
            "Data\nTime [min],CH1,CH2,CH3\nmin,degC,degC,degC\n",
            ["Front CH1", "Rear CH2"],
            ["Room CH3"],
        ),
        (
            '"CH","CH1-1","CH1-2","CH1-3"\n"Comment","Front","Rear","Room"\n"Range","100 C f.s.","100 C f.s.","100 C f.s."\n'
            '"Sensor","K","K","K"\n"Time [min]","CH1-1[C]","CH1-2[C]","CH1-3[C]"\n',
            ["Front CH1-1[C]", "Rear CH1-2[C]"],
            ["Room CH1-3[C]"],
        ),
        ("Location,Front,Rear,Ambient\nTime [min],T1,T2,T3\n", ["Front T1", "Rear T2"], ["Ambient T3"]),
        ("Time,T1,T2,T3\nmin,degC,degC,degC\n,Front,Rear,Room\n", ["Front T1", "Rear T2"], ["Room T3"]),
        ("# T1: front\n# T2: rear\n# T3: room\nTime [min],T1,T2,T3\n", ["front T1", "rear T2"], ["room T3"]),
        ("# T1 = front, T2 = rear, T3 = room\nTime [min],T1,T2,T3\n", ["front T1", "rear T2"], ["room T3"]),
        ("1: Front (K)\n2: Rear (K)\n3: Room (Pt100)\n\nTime [min],1,2,3\n", ["Front 1", "Rear 2"], ["Room 3"]),
        ("Channel,Name\n101,Spindle 1,\n102,Spindle 2,\n103,Room,\n\nTime [min],101 (C),102 (C),103 (C)\n",
         ["Spindle 1 101 (C)", "Spindle 2 102 (C)"], ["Room 103 (C)"]),
        ("测点,主轴前端,主轴后端,环境\nTime [min],T1,T2,T3\n", ["主轴前端 T1", "主轴后端 T2"], ["环境 T3"]),
    ],
)  # fmt: skip
def test_channels_are_called_by_what_stands_there(tmp_path, head, sensors, room):
    run = read(written(tmp_path, head))
    assert list(run.channels) == sensors
    assert list(run.ambient) == room
    assert not any("kelvin" in guess.text for guess in run.guesses)  # K is a thermocouple there
    assert run.channels[sensors[0]][-1] == pytest.approx(20.0 + 5.0 * (1.0 - math.exp(-39 / 30.0)), abs=0.006)


@pytest.mark.parametrize(
    "head",
    [
        "Serial number,ABC123,ABC124,ABC125\n",  # no words
        "Type,Pt100,Pt1000,NTC\n",  # kinds of probes
        "Calibration,March,April,May\n",  # nothing says that these are places
        "Comment,front,front,front\n",  # they tell nothing apart
        "CH,Min,Max\nT1,12.5,30\nT2,13,30\nT3,14,31\n",
        "T1,On\nT2,On\nT3,Off\n",
        "Channel,Name\nT1,Sensor 1\nT2,Sensor 2\nT3,Sensor 3\n",
        "Name,Front,1.5\nOperator,Miller,x\n",  # lines of another width
    ],
)
def test_lines_that_name_no_places_leave_the_names(tmp_path, head):
    assert list(read(written(tmp_path, head + "Time [min],T1,T2,T3\n")).channels) == ["T1", "T2", "T3"]


def test_a_unit_that_a_list_tells_holds(tmp_path):
    head = "Channel,Name,Unit\nCH1,Front,degF\nCH2,Rear,degF\nCH3,Room,degF\n\nTime [min],CH1,CH2,CH3\n"
    run = read(written(tmp_path, head))
    assert run.channels["Front CH1"][0] == pytest.approx((20.0 - 32.0) / 1.8)
    beside = read(written(tmp_path, "CH1,Front [degF]\nCH2,Rear [degF]\nCH3,Room (K)\nTime [min],CH1,CH2,CH3 [degC]\n"))
    assert beside.channels["Rear CH2"][0] == pytest.approx((20.0 - 32.0) / 1.8)
    assert beside.ambient["Room CH3 [degC]"][0] == pytest.approx(20.1)


def test_a_labelled_channel_is_found_by_either_part(tmp_path):
    path = written(tmp_path, "Location,Front,Rear,Front right\nTime [min],T1 [degC],T2 [degC],T3 [degC]\n")
    assert list(read(path, channels=("t1", "rear")).channels) == ["Front T1 [degC]", "Rear T2 [degC]"]
    known = ["Front T1 [degC]", "Rear T2 [degC]", "Front right T3 [degC]"]
    assert columns_named("front", known, known) == ("Front T1 [degC]",)
    assert columns_named("front right", known, known) == ("Front right T3 [degC]",)
    with pytest.raises(UsageError, match="no column"):
        check_names(["right"], known, "--channels", "run.csv")


def test_groups_with_a_clock_each_have_the_names_above(tmp_path):
    path = tmp_path / "run.csv"
    rows = [f"{60 * i},{20 + 0.1 * i:.2f},{60 * i + 1},{20 + 0.2 * i:.2f},{60 * i + 2},20.1" for i in range(40)]
    path.write_text("Front,,Rear,,Room,\n" + ",".join(["Time [s],Temp [degC]"] * 3) + "\n" + "\n".join(rows) + "\n")
    run = read(str(path))
    assert list(run.channels) == ["Front Temp [degC]", "Rear Temp [degC]"]
    assert list(run.ambient) == ["Room Temp [degC]"]


def test_what_is_a_channel_and_nothing_else():
    assert [designation(n) for n in ("CH1-1 [C]", "Kanal 2", "101", "AI 0/4", "T_3")] == [
        "CH1-1",
        "Kanal 2",
        "101",
        "AI 0/4",
        "T_3",
    ]
    assert [designation(n) for n in ("front", "Spindle front 1", "T1 mean", "Ch", "")] == [""] * 5
    assert labelled("Spindle front CH1 [C]") == ("Spindle front", "CH1 [C]")
    assert labelled("T1") is None
    assert labelled("Spindle front") is None


def test_one_unit_in_brackets_above_all_names_is_that_of_all(tmp_path):
    run = read(written(tmp_path, "Warm up of the spindle,,,\n,Temperature [°F],,\nTime [min],T1,T2,T3\n"))
    assert [round(v[0], 3) for v in run.channels.values()] == [-6.667, -6.667, -6.611]  # the first alone was, and in degC


def test_rows_that_end_in_several_empty_cells_have_the_names_of_the_header(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("Time [min],T1,T2\n" + "".join(f"{i},{20 + 0.1 * i:.1f},{20 + 0.2 * i:.1f},,,\n" for i in range(40)))
    assert list(read(str(path)).channels) == ["T1", "T2"]


def test_rows_of_limits_beneath_the_names_are_left_out(tmp_path):
    head = "Time [min],T1,T2,T3\nmin,degC,degC,degC\nMax,80,80,80\nMin,-10,-10,-10\n"
    run = read(written(tmp_path, head))
    assert len(run.time_s) == 40
    assert run.channels["T1"][0] == 20.0
    assert "2 rows above the readings left out (Max, Min)" in " ".join(run.notes)
    path = tmp_path / "run.csv"
    path.write_text(path.read_text().replace("\n7,", "\n7,x", 1))
    with pytest.raises(InputError, match="line 12"):  # lines are those of the file
        read(str(path))


@pytest.mark.parametrize(
    ("head", "said"),
    [
        (
            "Multiplier,0.01\nTime [min],T1,T2,T3\n",
            "Multiplier 0.01, told beside the readings, is in them (--units '°C x100' applies it)",
        ),
        ("# scale factor: 0.1\nTime [min],T1,T2,T3\n", "scale factor 0.1, told"),
        ("Time [min],T1,T2,T3\nOffset,0.1,0.2,0\n", "Offset 0.1, 0.2, 0, told beside the readings"),
        ("Gain,1.0\nOffset,0\nTime [min],T1,T2,T3\n", ""),
    ],
)
def test_a_factor_or_an_offset_beside_the_readings_is_told(tmp_path, head, said):
    told = " ".join(str(g) for g in read(written(tmp_path, head)).guesses)
    assert said in told
    assert said or "told beside" not in told


def test_hostile_names_and_lines_cost_nothing(tmp_path):
    assert labelled("a" * 200_000 + " CH1") is None
    path = written(tmp_path, f"CH1{' ' * 200_000}x\nTime [min],CH1,CH2,CH3\n")
    assert list(read(path).channels) == ["CH1", "CH2"]
