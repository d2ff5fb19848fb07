"""Results as an Excel workbook, and as CSV that Excel opens by a double click."""

import csv
import io
import re
import zipfile
from dataclasses import is_dataclass

import pytest
import python_calamine
from conftest import ROOT

import thermofast as tf
from thermofast import records
from thermofast.output.meanings import meaning_of
from thermofast.output.report.excel import _shown, write_rows

SPINDLE = ROOT / "sample_runs" / "spindle.csv"


def sheets(path):
    book = python_calamine.CalamineWorkbook.from_path(path)
    return {n: book.get_sheet_by_name(n).to_python(skip_empty_area=False) for n in book.sheet_names}


def inside(path, pattern):
    """Texts of the members of a workbook whose names match."""
    with zipfile.ZipFile(path) as archive:
        return [archive.read(n).decode("utf-8") for n in archive.namelist() if re.search(pattern, n)]


def test_identify_has_a_summary_the_records_the_curves_and_a_chart_of_each_sensor(tool, tmp_path):
    path = tmp_path / "report.xlsx"
    done = tool("identify", SPINDLE, "--channels", "T1,T8", "--until", "60", "-o", path, "-q")
    assert done.code == 0, done.err
    found = sheets(path)
    assert list(found) == ["summary", "identify", "columns", "curves", "charts"]
    result = tf.identify(tf.read(SPINDLE, channels=["T1", "T8"]), until=60.0)
    head, *rows = found["identify"]
    for row, record in zip(rows, result, strict=True):
        told = dict(zip(head, row, strict=True))
        assert told["channel"] == record.channel
        assert told["steady_state_c"] == pytest.approx(record.steady_state_c, rel=1e-12)
        assert isinstance(told["t95_min"], float)
    assert ["read as", "comma-separated, decimal point, header in line 1, utf-8"] in found["summary"]
    curves = dict(zip(found["curves"][0], zip(*found["curves"][1:], strict=True), strict=True))
    run = tf.read(SPINDLE)
    assert [v for v in curves["T1 measured degC"] if v != ""] == pytest.approx(run.channels["T1"].tolist())
    drawn = inside(path, r"charts/chart\d")
    assert len(drawn) == 4
    # A chart names the cells that hold what it shows: the measured curve of the second sensor.
    assert "curves!$I$2:$I$402" in drawn[2]
    # An axis about what is drawn, and the times that matter as lines from its one end to the other.
    assert '<c:min val="17.5"/>' in drawn[0]
    assert '<c:max val="26.5"/>' in drawn[0]
    marks = {label: [v for v in curves[f"T1 {label}"] if v != ""] for label in ("identification time min", "95 % of the rise degC")}
    assert marks == {"identification time min": [60.0, 60.0], "95 % of the rise degC": [17.5, 26.5]}
    assert [label in drawn[0] for label in ("identification time", "95 % of the rise")] == [True, True]
    assert "identification time" not in drawn[1]
    assert found["curves"][0][7:11] == ["T8 time min", "T8 measured degC", "T8 residual K", "T8 model time min"]
    # Every sheet is as wide as a page of paper, and repeats its head on each.
    pages = [re.search(r"<pageSetup [^>]*>", page)[0] for page in inside(path, r"sheets/sheet\d")]
    assert len(pages) == 5
    assert all('orientation="landscape"' in page and 'fitToHeight="0"' in page for page in pages)
    assert inside(path, r"^xl/workbook.xml")[0].count("_xlnm.Print_Titles") == 4


@pytest.mark.parametrize(
    ("arguments", "names", "charts"),
    [
        (("compare", "sample_runs/hidden.csv"), ["summary", "compare", "columns", "curves", "charts"], 8),
        (("diagnose", "sample_runs/hidden.csv"), ["summary", "diagnose", "columns", "ranking", "charts"], 1),
        (("improve", "sample_runs/hidden.csv", "--auto"), ["summary", "improve", "columns", "steps", "charts"], 1),
        (
            ("sweep", SPINDLE, "--windows", "40,50", "--channels", "T5"),
            ["summary", "sweep", "columns", "times", "charts"],
            1,
        ),
        (("inspect", SPINDLE), ["summary", "inspect", "columns"], 0),
    ],
    ids=lambda a: a[0] if isinstance(a, tuple) else "",
)
def test_each_command_writes_its_own_sheets(tool, tmp_path, arguments, names, charts):
    path = tmp_path / "report.xlsx"
    done = tool(*arguments, "-o", path, "-q")
    assert done.code == 0, done.err
    assert list(sheets(path)) == names
    drawn = inside(path, r"charts/chart\d")
    assert len(drawn) == charts
    of = sheets(path)
    for chart in drawn:
        for sheet, column, last in re.findall(r"<c:f>'?([^'!<]+)'?!\$([A-Z]+)\$2:\$[A-Z]+\$(\d+)</c:f>", chart):
            at = 0
            for letter in column:
                at = 26 * at + ord(letter) - 64
            cells = [row[at - 1] for row in of[sheet][1 : int(last)]]
            assert len(cells) == int(last) - 1
            assert any(c != "" for c in cells)


def test_a_sweep_of_several_sensors_is_one_sheet_that_names_them(tmp_path):
    path = tmp_path / "sweep.xlsx"
    tf.sweep(tf.read(SPINDLE, channels=["T1", "T5"]), windows=(40.0, 50.0)).save(path)
    found = sheets(path)
    assert list(found) == ["summary", "sweep", "columns", "times", "charts"]
    assert found["times"][0] == [
        *("T1 time min", "T1 window 40 min K", "T1 window 50 min K"),
        *("T5 time min", "T5 window 40 min K", "T5 window 50 min K"),
        *("T5 shortest time that serves min", "T5 shortest time that serves K"),
    ]


def test_a_sheet_says_what_each_column_is(tmp_path):
    path = tmp_path / "one.xlsx"
    tf.identify(tf.read(SPINDLE, channels=["T1"]), until=60.0).save(path)
    told = {row[0]: row[1:] for row in sheets(path)["columns"][1:]}
    assert list(told) == list(records.IdentifyRecord.columns())
    assert told["t95_hi_min"] == ["min", "upper end of the 95 % interval: when 95 % of the rise is done, after its start"]
    assert told["noise_c"][0] == "K"
    assert told["initial_c"][0] == "degC"
    assert told["status"][0] == ""


def test_columns_that_say_nothing_are_hidden_and_numbers_are_shown_short(tmp_path):
    path = tmp_path / "one.xlsx"
    tf.identify(tf.read(SPINDLE, channels=["T1"]), until=60.0).save(path)
    page, style = inside(path, r"worksheets/sheet2")[0], inside(path, r"styles")[0]
    columns = list(records.IdentifyRecord.columns())
    hidden = [int(n) for n in re.findall(r'<col min="(\d+)"[^>]*hidden="1"', page)]
    assert columns.index("trip_min") + 1 in hidden
    assert columns.index("steady_state_c") + 1 not in hidden
    assert 'formatCode="0.000"' in style
    # So are the columns of curves, by the unit that ends their names.
    tables = sheets(path)
    curves = inside(path, r"worksheets/sheet4")[0]
    styles = {int(n): int(k) for n, k in re.findall(r'<col min="(\d+)"[^>]*style="(\d+)"', curves)}
    formats = dict(re.findall(r'numFmtId="(\d+)" formatCode="([^"]+)"', style))
    used = re.findall(r'<xf numFmtId="(\d+)"', style.split("<cellXfs")[1])
    shown = {name: formats.get(used[styles[k]], "0.00") for k, name in enumerate(tables["curves"][0], 1) if k in styles}
    assert (shown["T1 time min"], shown["T1 measured degC"], shown["T1 residual K"]) == ("0.0", "0.00", "0.000")


def test_the_summary_says_whose_message_it_is(tmp_path):
    columns = {"time_min": list(range(40)), "A_degC": [20.0 + 0.1 * i for i in range(40)], "B_degC": [21.0] * 40}
    tf.identify(tf.read(columns, name="two")).save(tmp_path / "two.xlsx")
    said = {row[0]: row[1] for row in sheets(tmp_path / "two.xlsx")["summary"]}
    assert said["message of B_degC"].startswith("every reading is 21 degC")


def test_a_message_of_one_of_several_runs_names_the_run(tmp_path):
    columns = {"time_min": list(range(40)), "A_degC": [20.0 + 0.1 * i for i in range(40)], "B_degC": [21.0] * 40}
    runs = [tf.read(columns, name=name) for name in ("one.csv", "two.csv")]
    tf.identify(runs).save(tmp_path / "two.xlsx")
    said = {row[0]: row[1] for row in sheets(tmp_path / "two.xlsx")["summary"]}
    assert said["message of B_degC of one.csv, B_degC of two.csv"].startswith("every reading is 21 degC")
    assert [row[1] for row in sheets(tmp_path / "two.xlsx")["summary"] if row[0] == "verdict"][
        -1
    ] == "4 rows: 2 not_determined, 2 constant."


def test_parameters_are_read_as_numbers_with_their_errors():
    told = {"load_step.change": {"value": 0.3125, "standard_error": 0.0213, "unit": "1"}, "t": {"value": 5.0, "unit": "min"}}
    assert _shown(told) == "load_step.change = 0.3125 ± 0.021; t = 5 min"


@pytest.mark.parametrize("kind", [k for k in vars(records).values() if isinstance(k, type) and issubclass(k, records.Row)])
def test_every_column_has_a_meaning(kind):
    if is_dataclass(kind):
        assert [c for c in kind.columns() if not meaning_of(c)] == []


def test_hostile_names_stay_text(tmp_path):
    data = "time_min,=cmd|' /C calc'!A0,http://x.y\n" + "".join(f"{i},{20 + i / 10},{21 + i / 20}\n" for i in range(60))
    run = tmp_path / "=1+1.csv"
    run.write_text(data)
    result = tf.identify(tf.read(run, channels=["=cmd|' /C calc'!A0", "http://x.y"]), until=40.0)
    result.save(tmp_path / "report.xlsx")
    assert {row[1] for row in sheets(tmp_path / "report.xlsx")["identify"][1:]} == {"=cmd|' /C calc'!A0", "http://x.y"}
    for page in inside(tmp_path / "report.xlsx", r"worksheets/"):
        assert "<f>" not in page
        assert "hyperlink" not in page


def test_cells_keep_what_they_are(tmp_path):
    rows = [
        {
            "a": 1.5,
            "b": None,
            "c": [1, 2],
            "d": float("nan"),
            "e": True,
            "f": "007",
            "h": "y" * 40_000,
            "g": [{"from_min": 1.0, "to_min": 20.25}, {"from_min": 30.0, "to_min": float("inf")}],
        }
    ]
    write_rows(str(tmp_path / "t.xlsx"), "bench", list(rows[0]), rows)
    head, row = sheets(tmp_path / "t.xlsx")["bench"]
    assert head == list(rows[0])
    assert row[:6] == [1.5, "", "1, 2", "", True, "007"]
    assert len(row[6]) == 32_767
    assert row[7] == "from_min 1, to_min 20.25; from_min 30"


def test_csv_for_excel_reads_back_as_numbers_with_decimal_commas(tool, tmp_path):
    path = tmp_path / "table.csv"
    done = tool("identify", SPINDLE, "--channels", "T1", "--until", "60", "-o", path, "--excel-csv", "-q")
    assert done.code == 0, done.err
    text = path.read_bytes()
    assert text.startswith(b"\xef\xbb\xbfrun;channel;")
    head, row = csv.reader(io.StringIO(text.decode("utf-8-sig")), delimiter=";")
    told = dict(zip(head, row, strict=True))
    whole = tf.identify(tf.read(SPINDLE, channels=["T1"]), until=60.0)[0].steady_state_c
    assert float(told["steady_state_c"].replace(",", ".")) == pytest.approx(whole, rel=1e-9)
    assert "." not in told["steady_state_c"]
    refused = tool("identify", SPINDLE, "-o", tmp_path / "t.json", "--excel-csv")
    assert refused.code == 2
    assert "--excel-csv is for CSV" in refused.err


def test_one_call_writes_a_page_a_workbook_and_a_table(tool, tmp_path):
    paths = [tmp_path / f"report.{kind}" for kind in ("html", "xlsx", "json")]
    outputs = [word for p in paths for word in ("-o", p)]
    done = tool("improve", "sample_runs/hidden.csv", "--auto", *outputs, "-o", tmp_path / "machine.toml", "-q")
    assert done.code == 0, done.err
    assert done.out == ""
    assert all(p.stat().st_size > 1000 for p in paths)
    assert tf.Model.load(tmp_path / "machine.toml").effects == ("second_mode",)
    assert list(sheets(paths[1])) == ["summary", "improve", "columns", "steps", "charts"]
    refused = tool("identify", SPINDLE, "-o", paths[0], "-o", paths[0])
    assert refused.code == 2
    assert "another output of this command" in refused.err
    wrong = tool("identify", SPINDLE, "-o", paths[0], "-o", tmp_path / "x.doc")
    assert wrong.code == 2
    assert "x.doc" in wrong.err


def test_a_disk_that_is_full_is_said_in_words(monkeypatch, tmp_path):
    """The workbook is put together in memory: its package's own error, with a traceback, is never met."""

    def full(self, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(tf.UsageError, match="No space left"):
        tf.identify(tf.read(SPINDLE, channels=["T1"]), until=60.0).save(tmp_path / "report.xlsx")
    assert not list(tmp_path.iterdir())
