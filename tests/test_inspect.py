"""``inspect``, files that are packed or are workbooks, and columns named in short."""

import bz2
import datetime as dt
import gzip
import io
import json
import lzma
import zipfile
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pytest
import xlsxwriter
from conftest import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st

import thermofast as tf
from thermofast.reading.tables.packed import MAGIC, unpacked
from thermofast.reading_options import joined, names

SPINDLE = ROOT / "sample_runs" / "spindle.csv"
COLUMNS = ["run", "column", "role", "unit", "readings", "first", "last", "guessed", "note"]


def told(tool, *arguments):
    done = tool("inspect", *arguments, "--format", "json", "-q")
    assert done.code == 0, done.err
    return json.loads(done.out)


def test_each_column_is_shown_with_what_it_is_taken_for(tool, tmp_path):
    path = tmp_path / "day.csv"
    rows = [f"12.03.2026 08:{m:02d}:00;{100 + m};{68 + m};;{20 + 0.1 * m:.1f};run".replace(".", ",") for m in range(30) if m != 12]
    rows = [r.replace("12,03,2026", "12.03.2026") for r in rows]
    path.write_text("Zeit;rpm;Lager [°F];Bemerkung;Hallentemperatur;Zustand\n" + "\n".join(rows) + "\n", encoding="utf-8")
    document = told(tool, path)
    records = document["records"]
    assert list(records[0]) == COLUMNS
    assert {r["column"]: (r["role"], r["unit"]) for r in records} == {
        "Zeit": ("time", "stamp"),
        "rpm": ("input", ""),
        "Lager [°F]": ("sensor", "F"),
        "Bemerkung": ("ignored", ""),
        "Hallentemperatur": ("ambient", ""),
        "Zustand": ("ignored", ""),
    }
    of = {r["column"]: r for r in records}
    assert (of["Lager [°F]"]["first"], of["Lager [°F]"]["last"]) == pytest.approx((20.0, 36.1111111))
    assert (of["Zeit"]["first"], of["Zeit"]["last"], of["Zeit"]["readings"]) == (0.0, 29.0, 29)
    assert of["Zeit"]["note"] == "every 60 s"
    assert (of["Bemerkung"]["note"], of["Zustand"]["note"]) == ("empty", "words")
    layout = document["input"][0]
    assert {k: layout[k] for k in ("rows", "duration_s", "delimiter", "decimal", "header_line", "time_column", "long")} == {
        "rows": 29,
        "duration_s": 1740.0,
        "delimiter": ";",
        "decimal": ",",
        "header_line": 1,
        "time_column": "Zeit",
        "long": [],
    }


def test_gaps_missing_cells_and_guesses_are_marked(tool, tmp_path):
    path = tmp_path / "run.csv"
    time = [t for t in range(0, 36000, 10) if not 600 <= t < 1200]
    path.write_text("t,T1\n" + "".join(f"{t},{20 + t / 10000 if t != 50 else ''}\n" for t in time))
    first, second = told(tool, path)["records"]
    assert first["note"] == "every 10 s, 1 gap, the longest 10.2 min"
    assert "has no unit, taken as s" in first["guessed"]
    assert (second["readings"], second["note"], second["guessed"]) == (len(time) - 1, "1 missing", "")


def test_a_file_that_is_refused_is_shown_as_far_as_it_can_be(tool, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,block\n" + "".join(f"{10 * i},{300 + i}\n" for i in range(20)))
    done = tool("inspect", path, "--format", "table", "-q")
    assert done.code == 2
    assert "block" in done.out
    assert "319" in done.out
    assert "the unit of column 'block' cannot be told" in done.err
    assert '"column": "block"' in tool("inspect", path, "--format", "json").out


def test_the_table_has_a_small_picture_and_the_picture_can_be_saved(tool, tmp_path):
    done = tool("inspect", SPINDLE, "--format", "table", "-q", "--save-plot", tmp_path / "run.png")
    assert "│" in done.out
    assert "and 4 more sensors" in done.out
    assert "\x1b" not in done.out
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_what_was_read_is_written_as_settings_that_read_it_so_again(tool, tmp_path):
    path, target = tmp_path / "run.csv", tmp_path / "thermofast.toml"
    text = "Temp., °C;Clock [min];Tür;power, W\n" + "".join(f"{20 + i / 10:.1f};{i};{19.5};{100}\n" for i in range(40))
    path.write_bytes(text.encode("cp1252"))
    read = told(tool, path, "--ambient", "Tür", "--write", target)["records"]
    # In the folder of the settings file, and with nothing else said.
    done = tool("--config", target, "inspect", path, "--format", "json", "-q")
    assert json.loads(done.out)["records"] == read
    assert 'ambient = "Tür"' in target.read_text(encoding="utf-8")
    again = tool("inspect", path, "--write", target, "-q")
    assert again.code == 2
    assert "is there already" in again.err


@given(st.lists(st.text(st.characters(blacklist_categories=("Cs", "Cc")), min_size=1).map(str.strip).filter(bool), min_size=1))
@settings(max_examples=150, deadline=None)
def test_names_joined_are_taken_apart_again(several):
    assert names(joined(several)) == tuple(several)


@pytest.mark.parametrize(
    "given",
    [
        ("--units", "K", "--missing", "aus", "--skip-footer", "2", "--interval", "10"),
        ("--units", "front=K,rear (2)=K", "--missing", "aus,n.a.", "--skip-footer", "2", "--interval", "10", "--start", "1.5"),
        ("--units", "K", "--missing", "aus", "--skip-footer", "2", "--interval", "10", "--rename", "front=nose,rear (2)=tail"),
        (
            "--units",
            "K",
            "--missing",
            "aus",
            "--skip-footer",
            "2",
            "--interval",
            "10",
            "--exclude",
            "r*",
            "--rename",
            "rear (2)=tail",
        ),
    ],
)
def test_settings_hold_the_options_that_were_given(tool, tmp_path, given):
    path, target = tmp_path / "run.csv", tmp_path / "lab.toml"
    rows = "".join(f"{300 + i};{301 + i if i % 5 else 'aus'}\n" for i in range(40))
    path.write_text("front;rear (2)\n" + rows + "end of record; 7\nsignature;8\n")
    read = told(tool, path, *given, "--write", target)["records"]
    done = tool("--config", target, "inspect", path, "--format", "json", "-q")
    assert done.code == 0, done.err
    assert json.loads(done.out)["records"] == read
    assert read[0]["first"] == pytest.approx(26.85)


def test_columns_may_be_named_without_their_unit_and_by_patterns(tmp_path):
    path = tmp_path / "run.csv"
    text = 'time_s,"front [°C]",rear (degC),rear_2,pump W\n' + "".join(
        f"{10 * i},{20 + i},{21 + i},{22 + i},5\n" for i in range(20)
    )
    path.write_text(text, encoding="utf-8")
    assert list(tf.read(path, channels="front").channels) == ["front [°C]"]
    assert list(tf.read(path, channels="re*").channels) == ["rear (degC)", "rear_2"]
    assert list(tf.read(path, channels="Front, rear_?").channels) == ["front [°C]", "rear_2"]
    assert list(tf.read(path, exclude="*2").channels) == ["front [°C]", "rear (degC)"]
    assert tf.read(path, channels="rear", units="rear=F").channels["rear (degC)"][0] == pytest.approx((21.0 - 32.0) / 1.8)
    assert list(tf.read(path, channels="rear", rename="rear=R").channels) == ["R"]
    with pytest.raises(tf.UsageError, match="channels='x\\*' is no column"):
        tf.read(path, channels="x*")


@pytest.mark.parametrize("pattern", ["T*", "*"])
def test_a_pattern_means_readings_alone_not_the_time_beside_them(tmp_path, pattern):
    path = tmp_path / "run.csv"
    path.write_text("Time [s],T1,T2,Tool\n" + "".join(f"{10 * i},{20 + i},{21 + i},x\n" for i in range(20)))
    assert list(tf.read(path, channels=pattern).channels) == ["T1", "T2"]
    assert list(tf.read(path, exclude="*2").channels) == ["T1"]
    assert list(tf.read(path, time="Time", rename="T1=x,T2=y", channels="T1").channels) == ["x"]


def packs(data):
    zipped, zst = io.BytesIO(), pa.BufferOutputStream()
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run.csv", data)
    with pa.CompressedOutputStream(zst, "zstd") as stream:
        stream.write(data)
    packed = {"gz": gzip.compress(data), "bz2": bz2.compress(data), "xz": lzma.compress(data), "zip": zipped.getvalue()}
    return packed | {"zst": zst.getvalue().to_pybytes()}


@pytest.mark.parametrize("kind", ["gz", "bz2", "xz", "zip", "zst"])
def test_a_packed_file_is_the_file_and_a_cut_one_is_refused(tmp_path, kind):
    data = packs(SPINDLE.read_bytes())[kind]
    path = tmp_path / f"run.csv.{kind}"
    path.write_bytes(data)
    plain, packed = tf.read(SPINDLE), tf.read(path)
    assert list(packed.channels) == list(plain.channels)
    assert all(np.array_equal(packed.channels[n], plain.channels[n]) for n in plain.channels)
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(tf.InputError, match=r"cannot be unpacked|not a text table"):
        tf.read(path)


@given(st.sampled_from(sorted(MAGIC)), st.binary(max_size=300), st.integers(0, 10_000))
@settings(max_examples=300, deadline=None)
def test_a_damaged_archive_is_a_message(magic, junk, at):
    whole = next(p for p in packs(b"time_s,T1\n0,20\n10,21\n" * 50).values() if p.startswith(magic))
    at %= len(whole)
    for data in (magic + junk, whole[:at] + junk + whole[at + len(junk) :]):
        try:
            assert isinstance(unpacked(data, "run"), bytes)
        except tf.InputError as error:
            assert str(error).startswith("run: ")


def test_an_archive_of_several_files_is_refused_by_their_names(tmp_path):
    path = tmp_path / "runs.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.csv", "x")
        archive.writestr("b.csv", "y")
    with pytest.raises(tf.InputError, match=r"(?s)an archive of 2 files.*a\.csv, b\.csv"):
        tf.read(path)


def workbook(path, sheets, value=0):
    """A workbook of these sheets; value is what is stored of each formula."""
    with xlsxwriter.Workbook(path, {"default_date_format": "yyyy-mm-dd hh:mm:ss"}) as book:
        for name, rows in sheets.items():
            sheet = book.add_worksheet(name)
            for number, row in enumerate(rows):
                sheet.write_row(number, 0, row)
                for column, cell in enumerate(row):
                    if isinstance(cell, str) and cell.startswith("="):
                        sheet.write_formula(number, column, cell, value=value)
    return path


def test_a_workbook_is_read_sheet_by_sheet(shared):
    path = shared.parent / "loggers" / "picolog_calibration.xlsx"
    truth = json.loads((path.parent / "truth.json").read_text(encoding="utf-8"))[path.name]["truth"]
    with pytest.raises(tf.InputError, match="say time_unit"):
        tf.read(path)
    run = tf.read(path, time_unit="s")
    assert run.time_s[-1] == truth["last_elapsed_s"]
    assert {n: (c[0], c[-1]) for n, c in run.channels.items()} == {
        n: (t["first"], t["last"]) for n, t in truth["temperatures_degC"].items()
    }
    assert "Excel, sheet 'Calibration_Data'" in run.notes
    with pytest.raises(tf.UsageError, match="no sheet of this workbook"):
        tf.read(path, sheet="Sheet9")
    with pytest.raises(tf.UsageError, match="sheet is for workbooks"):
        tf.read(SPINDLE, sheet="x")


def test_of_several_sheets_one_must_be_named_and_stamps_stay_stamps(tmp_path):
    begin = dt.datetime(2026, 3, 1, 8, 0)
    rows = [["time", "T1", "room"], *([begin + dt.timedelta(seconds=10 * i), 20 + 0.5 * i, 20.5] for i in range(30))]
    path = workbook(tmp_path / "book.xlsx", {"notes": [["made by", "me"]], "run": rows, "other": rows})
    with pytest.raises(tf.InputError, match=r"(?s)2 sheets hold tables.*run, other"):
        tf.read(path)
    run = tf.read(path, sheet="run")
    assert run.time_s.tolist() == [10.0 * i for i in range(30)]
    assert run.channels["T1"].tolist() == [20 + 0.5 * i for i in range(30)]
    assert list(run.ambient) == ["room"]


def test_numbers_that_a_workbook_stores_as_text_are_read_as_the_numbers_beside_them(tmp_path):
    """A column pasted as text, with decimal commas, took the commas' reading to the columns of numbers beside it."""
    rows = [["time_min", "T1 [degC]", "T2 [degC]"], *([i, 20.5 + i, f"{30 + i},25"] for i in range(30))]
    path = workbook(tmp_path / "text.xlsx", {"run": rows})
    run = tf.read(path)
    assert run.channels["T1 [degC]"].tolist() == [20.5 + i for i in range(30)]
    assert run.channels["T2 [degC]"].tolist() == [30.25 + i for i in range(30)]
    assert [g.text for g in run.guesses if g.about == "marks"] == ["cells C2 and 29 more are text with a decimal comma ('30,25')"]
    one = workbook(tmp_path / "one.xlsx", {"run": [*rows[:1], *([i, 20.5 + i, 30.5 + i] for i in range(28)), [28, "48,5", 58.5]]})
    run = tf.read(one)
    assert run.channels["T1 [degC]"][-1] == 48.5
    assert [g.text for g in run.guesses if g.about == "marks"] == ["cell B30 is text with a decimal comma ('48,5')"]
    whole = [
        rows[0],
        *([i, f"{20 + i},5", f"{30 + i},25"] for i in range(30)),
    ]  # numbers that are no decimals say nothing of a comma
    run = tf.read(workbook(tmp_path / "whole.xlsx", {"run": whole}))
    assert run.channels["T2 [degC]"].tolist() == [30.25 + i for i in range(30)]
    assert not [g for g in run.guesses if g.about == "marks"]
    rows[5][2] = "1,250"  # may be a thousand
    with pytest.raises(tf.InputError, match="1,250"):
        tf.read(workbook(tmp_path / "thousand.xlsx", {"run": rows}))


def test_formulas_that_nobody_worked_out_are_told(tmp_path):
    rows = [["time_min", "T1", "T2"], *([i, 20.5 + i, f"=B{i + 2}+1"] for i in range(30))]
    told = "formulas without a stored value are empty cells"
    run = tf.read(workbook(tmp_path / "formulas.xlsx", {"run": rows}, value=""))
    assert told in [g.text for g in run.guesses]
    assert tf.identify(run)["T2"].status == "no_data"
    run = tf.read(workbook(tmp_path / "worked.xlsx", {"run": rows}, value=25.5))
    assert told not in [g.text for g in run.guesses]
    assert run.channels["T2"].tolist() == [25.5] * 30


def test_columns_get_other_names_in_all_that_is_told(tool, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,K1,K2,rpm\n" + "".join(f"{10 * i},{20 + i},{21 + i},500\n" for i in range(40)))
    run = tf.read(path, rename="K1=front bearing,rpm=speed", channels="K1,K2")
    assert list(run.channels) == ["front bearing", "K2"]
    assert list(run.inputs) == ["speed"]
    records = told(tool, path, "--channels", "K1,K2", "--rename", "K1=front bearing")["records"]
    assert [(r["column"], r["readings"], r["note"]) for r in records[1:3]] == [
        ("front bearing", 40, "'K1' in the file"),
        ("K2", 40, ""),
    ]
    for wrong, why in (("K9=x", "no column that was read"), ("K1=K2", "two columns one name"), ("K1", "not a name and a new one")):
        with pytest.raises(tf.UsageError, match=why):
            tf.read(path, rename=[wrong])


def test_lines_at_the_end_are_left_out_as_told(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,T1\n" + "".join(f"{10 * i},{20 + i}\n" for i in range(40)) + "390,99\n400,98\n\n")
    run = tf.read(path, skip_footer=2)
    assert run.channels["T1"].tolist() == [20.0 + i for i in range(40)]
    assert "the last 2 lines left out, as told" in run.notes
    with pytest.raises(tf.InputError):
        tf.read(path, skip_footer=500)


def test_a_libreoffice_workbook_is_read(tmp_path):
    rows = [["time_min", "T1"], *([i, 20 + i / 10] for i in range(30))]
    cells = "".join(
        "<table:table-row>"
        + "".join(
            f'<table:table-cell office:value-type="string"><text:p>{v}</text:p></table:table-cell>'
            if isinstance(v, str)
            else f'<table:table-cell office:value-type="float" office:value="{v}"/>'
            for v in row
        )
        + "</table:table-row>"
        for row in rows
    )
    space = " ".join(f'xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text"))
    body = (
        f'<office:body><office:spreadsheet><table:table table:name="log">{cells}</table:table></office:spreadsheet></office:body>'
    )
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    space_of_list = 'xmlns:manifest="urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"'
    entry = f'<manifest:file-entry manifest:full-path="/" manifest:media-type="{kind}"/>'
    with zipfile.ZipFile(tmp_path / "run.ods", "w") as archive:
        archive.writestr("mimetype", kind)
        archive.writestr("content.xml", f"<office:document-content {space}>{body}</office:document-content>")
        archive.writestr("META-INF/manifest.xml", f"<manifest:manifest {space_of_list}>{entry}</manifest:manifest>")
    run = tf.read(tmp_path / "run.ods")
    assert run.channels["T1"] == pytest.approx([20 + i / 10 for i in range(30)])
    assert "sheet 'log'" in run.notes[0]


def test_a_zone_takes_summer_time_out_exactly(tmp_path):
    # The clock in Berlin goes back from 3:00 to 2:00 on 25 October 2026, and forward from 2:00 to 3:00 on 29 March.
    start = dt.datetime(2026, 10, 24, 23, 30, tzinfo=dt.UTC)
    zone = ZoneInfo("Europe/Berlin")
    for begin in (start, dt.datetime(2026, 3, 28, 23, 30, tzinfo=dt.UTC)):
        moments = [begin + dt.timedelta(minutes=7 * k) for k in range(40)]
        rows = "".join(f"{m.astimezone(zone):%d.%m.%Y %H:%M:%S};{20 + 0.1 * k:.1f}\n" for k, m in enumerate(moments))
        path = tmp_path / "run.csv"
        path.write_text("Zeit;T1\n" + rows)
        run = tf.read(path, tz="Europe/Berlin")
        assert run.time_s == pytest.approx([420.0 * k for k in range(40)])
        assert "in Europe/Berlin" in " ".join(run.notes)
    with pytest.raises(tf.UsageError, match="tz: no such zone 'Europe/Bern'"):
        tf.read(path, tz="Europe/Bern")
    with pytest.raises(tf.UsageError, match="tz is for dates and times that have no zone"):
        tf.read(SPINDLE, tz="Europe/Berlin")
