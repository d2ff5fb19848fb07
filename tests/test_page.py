"""The page of a result: self-contained, inert for hostile names, and alive in a real browser."""

import html
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ROOT

import thermofast as tf
from benchmarks.scale.accessibility import BROWSER, in_browser
from thermofast.output.report.charts import Series, charts_of, drawn_of, extremes
from thermofast.output.report.charts import _needed_heat as needed_heat
from thermofast.output.report.figures import figures_of
from thermofast.output.report.glance import glance_page as glance
from thermofast.output.report.page import _cell as page_cell
from thermofast.output.report.page import _chance as chance
from thermofast.output.report.page import page_of
from thermofast.output.report.verdicts import verdict_of
from thermofast.output.report.words import interval_words, run_names
from thermofast.records import ChangedRecord, DiagnoseRecord, IdentifyRecord, ImproveRecord, SweepRecord

SPINDLE = ROOT / "sample_runs" / "spindle.csv"
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine")

#: What a user does on the page, and what is to be seen of it, as JSON in an element at its end.
ACTS = """
<script>
addEventListener("load", () => {
  const seen = {}, table = document.getElementById("records"), svg = document.querySelector("figure > svg");
  const column = [...table.tHead.rows[0].cells].findIndex((c) => c.textContent === "steady_state_c");
  const values = () => [...table.tBodies[0].rows].map((r) => Number(r.cells[column].dataset.value));
  seen.figures = document.querySelectorAll("figure > svg").length;
  seen.points = document.querySelector("path.measured").getAttribute("d").split("z").length - 1;
  table.tHead.rows[0].cells[column].firstChild.click();
  seen.up = values();
  seen.sort = table.tHead.rows[0].cells[column].getAttribute("aria-sort");
  table.tHead.rows[0].cells[column].firstChild.click();
  seen.down = values();
  const press = (key) => svg.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  press("End");
  seen.readout = document.querySelector("figure .readout").textContent;
  const labels = () => [...svg.querySelectorAll("text")].map((t) => t.textContent).join(" ");
  const whole = labels();
  press("+");
  seen.zoomed = labels() !== whole;
  press("0");
  seen.back = labels() === whole;
  const box = svg.getBoundingClientRect();
  const at = (type, share) => svg.dispatchEvent(new PointerEvent(type, { clientX: box.left + share * box.width, clientY: box.top + 40, pointerType: "mouse" }));
  at("pointerdown", 0.3); at("pointermove", 0.5); at("pointerup", 0.5);
  seen.dragged = labels() !== whole;
  // What is drawn is drawn anew while a button is down: a click must find the chart itself, or none comes.
  svg.scrollIntoView();
  const now = svg.getBoundingClientRect();
  seen.under = document.elementFromPoint(now.left + 0.5 * now.width, now.top + 60) === svg;
  svg.dispatchEvent(new MouseEvent("dblclick", { bubbles: true }));
  seen.all = labels() === whole;
  for (let k = 0; k < 40; k += 1) press("+");
  seen.close = svg.querySelector("path.measured").getAttribute("d").split("z").length - 1;
  press("0");
  press("Home"); press("ArrowRight");
  seen.told = document.querySelector("figure .readout").textContent;
  seen.sorted = document.getElementById("said").textContent;
  seen.letters = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width * 11;
  seen.width = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  const told = document.createElement("pre");
  told.id = "seen";
  told.textContent = JSON.stringify(seen);
  document.body.append(told);
});
</script>
"""


@needs_browser
@pytest.mark.parametrize("size", ["1200,900", "390,844"], ids=["desk", "phone"])
def test_the_page_is_alive_in_a_browser(tool, tmp_path, size):
    path = tmp_path / "report.html"
    done = tool("identify", SPINDLE, "--channels", "T1,T8,T10", "--until", "60", "-o", path, "-q")
    assert done.code == 0, done.err
    path.write_text(path.read_text(encoding="utf-8").replace("</body>", ACTS + "</body>"), encoding="utf-8")
    dom, console = in_browser(path, tmp_path, f"--window-size={size}")
    assert console == []
    seen = json.loads(html.unescape(re.search(r'<pre id="seen">(.*?)</pre>', dom, re.DOTALL)[1]))
    assert seen["figures"] == 3
    assert seen["points"] == 401
    assert seen["up"] == sorted(seen["up"])
    assert seen["down"] == seen["up"][::-1]
    assert seen["sort"] == "ascending"
    measured = tf.read(SPINDLE).channels["T1"][-1]
    assert seen["readout"].startswith("400 min; 95 % band ")
    assert f"measured {measured:.2f} °C" in seen["readout"]
    assert seen["zoomed"]
    assert seen["back"]
    assert seen["dragged"]
    assert seen["under"]
    assert seen["all"]
    assert seen["close"] >= 2
    # Measured, model and residual of one time: they add up.
    reading, model, left = (float(v) for v in re.findall(r"(?:measured|model|residual) (-?[0-9.]+)", seen["told"]))
    assert reading - model == pytest.approx(left, abs=0.011)
    assert seen["sorted"] == "sorted by steady_state_c, greatest first"
    assert seen["letters"] >= 9.0
    assert seen["width"] <= 0


@needs_browser
@pytest.mark.parametrize(
    ("arguments", "figures"),
    [
        (("compare", "sample_runs/hidden.csv", "--until", "120"), 4),
        (("improve", "sample_runs/hidden.csv", "--auto"), 1),
        (("sweep", SPINDLE, "--windows", "40,50", "--channels", "T5"), 1),
        (("diagnose", "sample_runs/hidden.csv"), 0),
    ],
    ids=lambda a: a[0] if isinstance(a, tuple) else "",
)
def test_each_command_has_a_page_without_an_error(tool, tmp_path, arguments, figures):
    path = tmp_path / "report.html"
    done = tool(*arguments, "-o", path, "-q")
    assert done.code == 0, done.err
    dom, console = in_browser(path, tmp_path)
    assert console == []
    assert len(re.findall(r"<svg[^>]*role=\"img\"", dom)) == figures
    assert dom.count('aria-label="Zoom in: ') == figures
    assert ("Ranking of the effects" in dom) == (arguments[0] == "diagnose")


def test_the_page_says_what_the_records_say_and_how_it_was_made(tool, tmp_path):
    path = tmp_path / "report.html"
    tool("identify", SPINDLE, "--channels", "T1,T8", "--until", "60", "-o", path, "-q")
    page = path.read_text(encoding="utf-8")
    records = tf.identify(tf.read(SPINDLE, channels=["T1", "T8"]), until=60.0)
    hot = records["T8"]
    low, high = hot.steady_state_lo_c, hot.steady_state_hi_c
    assert f"T8 settles highest, at {hot.steady_state_c:.2f} degC (95 %: {low:.2f} to {high:.2f})." in page
    assert "comma-separated, decimal point, header in line 1, utf-8" in page
    assert tf.__version__ in page
    assert '<th scope="col" title="standard deviation of the noise [K]">' in page
    assert (
        "<dt>t95_hi_min</dt><dd>upper end of the 95 % interval: when 95 % of the rise is done, after its start [min]</dd>" in page
    )
    assert re.search(r"SHA-256 [0-9a-f]{64}", page)
    assert not re.search(r"(src|href)=\"?(https?:)?//", page)


def test_hostile_names_stay_text(tmp_path):
    name = "</script><script>alert(1)</script><img src=x onerror=alert(1)>"
    time = np.arange(0.0, 121.0)
    reading = 20.0 - 8.0 * np.expm1(-time / 30.0) + 0.02 * np.random.default_rng(0).standard_normal(121)
    run = tf.read({"time_min": time, name: reading}, channels=[name], name="<b>run</b>\u2028.csv")
    for result in (tf.identify(run, until=60.0, details=True), tf.diagnose(run)):
        page = page_of(result)
        assert page.count("<script") == 2
        assert "<img" not in page
        assert "<b>" not in page
        assert "\u2028" not in page.split('id="data">')[1]


def test_ten_sensors_of_twenty_thousand_readings_make_a_small_page():
    rng, time = np.random.default_rng(1), np.arange(20_000) / 60.0
    data = {f"T{i}": 20.0 - (8.0 + i) * np.expm1(-time / 40.0) + 0.03 * rng.standard_normal(20_000) for i in range(10)}
    result = tf.identify(tf.read({"time_min": time, **data}), until=60.0, details=True)
    assert len(page_of(result).encode("utf-8")) <= 300_000


def test_a_thinned_curve_keeps_its_outliers():
    values = np.zeros(10_000)
    values[[1234, 8765]] = 5.0, -7.0
    kept = extremes(values, 300)
    assert len(kept) <= 600
    assert {1234, 8765} <= set(kept.tolist())


def test_a_trace_cannot_be_a_page(tool, tmp_path):
    done = tool("identify", SPINDLE, "--trace", tmp_path / "t.html")
    assert done.code == 2
    assert ".csv" in done.err


def test_a_page_says_the_command_and_the_settings_that_made_it(tool, tmp_path):
    lab = tmp_path / "lab.toml"
    lab.write_text('[input]\nchannels = ["T1", "T2"]\n')
    done = tool("--config", lab, "identify", SPINDLE, "--until", "60", "-o", tmp_path / "p.html", "-o", tmp_path / "p.xlsx", "-q")
    assert done.code == 0, done.err
    page = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert f"thermofast --config {lab} identify {SPINDLE} --until 60 -o" in page
    assert "<dt>Settings from thermofast.toml</dt><dd><code>--channels T1,T2</code></dd>" in page
    tf.identify(tf.read(SPINDLE, channels="T1"), until=60.0).save(tmp_path / "q.html")
    assert "identify, from Python" in (tmp_path / "q.html").read_text(encoding="utf-8")


def test_a_name_does_not_turn_the_words_that_follow_it():
    time = np.arange(60.0)
    run = tf.read({"time_min": time, "T\u202e1 [°C]": 20.0 + 5.0 * -np.expm1(-time / 20.0), "T2 [°C]": 20.0 + time / 30.0})
    page = page_of(tf.identify(run))
    assert "T\\u202e1" in page
    assert "\u202e" not in page


@pytest.mark.parametrize(
    ("limit", "does", "words"),
    [
        (40.0, "comes nearest to", "K below it, chance of exceeding it below 0.1 %."),
        (25.0, "goes farthest beyond", "K above it, chance of exceeding it "),
    ],
)
def test_the_verdict_tells_the_limit(limit, does, words):
    page = page_of(tf.identify("sample_runs/spindle.csv", until=120, channels="T1,T3", limit=limit))
    top = page[page.index('class="verdict"') :][:2000]
    assert f"{does} the limit of {limit:g} degC: " in top
    assert words in top


def test_of_many_sensors_those_that_a_page_speaks_of_are_drawn():
    """Seventy, the hottest and the slowest at the end, one in doubt: they are drawn, the last of the others are not."""
    time, rng = np.arange(0.0, 240.0), np.random.default_rng(0)
    tau = np.r_[np.full(68, 40.0), 40.0, 60.0]
    rise = np.r_[np.full(68, 8.0), 12.0, 8.0]
    lines = rise[:, None] * -np.expm1(-time / tau[:, None]) + 0.02 * rng.standard_normal((70, 240))
    lines[65, 160:] += 3.0
    table = {"time_min": time} | {f"T{i}": 20.0 + line for i, line in enumerate(lines)}
    found = tf.identify(table, until=200.0, details=True, imperfection="none", start=0.0)
    drawn = [c.channel for c in drawn_of(found)]
    assert len(drawn) == 60
    doubted = {r.channel for r in found if r.status != "ok"}
    assert "T65" in doubted
    assert drawn[-3:] == ["T65", "T68", "T69"]
    assert drawn[:-3] == [f"T{i}" for i in range(57)]
    assert doubted <= set(drawn)
    said = " ".join(verdict_of(found, found.rows()))
    assert "T68 settles highest" in said
    assert "T69 is the last to have done 95 %" in said
    assert "60 of 70 sensors are drawn" in said


def test_the_chart_shows_when_the_rule_holds_and_a_limit_that_is_near():
    run = tf.read(SPINDLE, channels=["T5"])
    (chart,) = charts_of(tf.identify(run, until=60.0, criterion="iec60034-1", limit=28.0, details=True))
    (told,) = tf.identify(run, until=60.0, criterion="iec60034-1")
    assert (told.trip_min, "trip", "stopping rule 2K/h, 2x30min") in chart.marks
    (limit,) = [s for s in chart.strips[0].series if s.label == "limit"]
    assert limit.y.tolist() == [28.0, 28.0]
    (chart,) = charts_of(tf.identify(run, until=60.0, limit=105.0, details=True))
    assert [s.label for s in chart.strips[0].series] == ["95 % band", "measured", "model"]
    assert [m[2] for m in chart.marks] == ["identification time", "95 % of the rise"]


def test_a_page_of_paper_has_every_value_with_its_name():
    page = page_of(tf.identify(SPINDLE, until=60, channels="T1"))
    heads = re.findall(r'<button type="button">([a-z0-9_]+)</button>', page)
    printed = dict(re.findall(r'#records td:nth-child\((\d+)\):before\{content:"([a-z0-9_]+): "\}', page))
    assert list(printed.values()) == heads
    assert [int(k) for k in printed] == list(range(1, len(heads) + 1))
    assert '<th scope="row" class="who">T1</th><td class="number">' in page


def test_runs_of_one_name_are_told_apart_by_their_folders():
    runs = ["a/x/run.csv", "b/x/run.csv", "b/other.csv", "-"]
    assert list(run_names(runs).values()) == [str(Path("a/x/run.csv")), str(Path("b/x/run.csv")), "other.csv", "-"]


def test_a_page_says_who_has_no_prediction_and_why():
    time = np.arange(0.0, 120.0)
    rise = 20.0 - 8.0 * np.expm1(-time / 40.0) + 0.02 * np.random.default_rng(0).standard_normal(120)
    found = tf.identify({"time_min": time, "A_degC": rise, "B_degC": np.full(120, 21.0)}, until=100.0)
    said = verdict_of(found, found.rows())
    assert "B_degC: Every reading is 21 degC: is the probe connected?" in said
    assert said[-1] == "2 rows: 1 ok, 1 constant."
    late = tf.identify({"time_min": time, "A": np.r_[np.full(30, 20.0), rise[:90]]}, until=110.0, start=30.0)
    assert any("counted from where it begins, at 30 min" in s for s in verdict_of(late, late.rows()))
    falls = tf.identify({"time_min": time, "A": 40.0 - rise}, until=100.0)
    assert any("done 95 % of its fall, after" in s for s in verdict_of(falls, falls.rows()))


def test_a_page_says_the_heat_that_a_model_lacks_and_how_far_it_is_off(tmp_path):
    found = tf.compare(ROOT / "sample_runs" / "hidden.csv", until=120, unknown_heat=True, details=True)
    chart = charts_of(found)[0]
    assert [s.unit for s in chart.strips] == ["°C", "K", "K/min"]
    heat = found.records[0].unknown_heat
    band, line = chart.strips[2].series
    assert line.y.tolist() == [row["heat_k_per_min"] for row in heat]
    assert band.y.tolist() == [row["lo_k_per_min"] for row in heat]
    assert band.high.tolist() == [row["hi_k_per_min"] for row in heat]
    worst = max(found.records, key=lambda r: abs(r.worst_error_c))
    assert f"it reads {abs(worst.worst_error_c):.2f} K above the model, on average." in verdict_of(found, found.rows())[0]


def test_a_model_that_grew_is_judged_by_its_last_step_and_drawn_from_two_on():
    found = tf.improve(ROOT / "sample_runs" / "hidden.csv", add=["second_mode"])
    assert verdict_of(found, found.rows())[-1] == "4 rows of the last step: 4 ok."
    assert len(charts_of(found)) == 1
    none = tf.improve(SPINDLE, channels="T1", auto=True)
    assert charts_of(none) == []
    strokes = [Series("line", "", (), (), number=k).stroke for k in range(36)]
    assert len(set(strokes)) == 36


def test_a_long_record_says_that_not_all_of_it_is_drawn():
    time = np.arange(5000) / 10.0
    rise = 20.0 - 8.0 * np.expm1(-time / 40.0) + 0.02 * np.random.default_rng(0).standard_normal(5000)
    (figure,) = figures_of(tf.identify({"time_min": time, "A": rise}, until=60.0, details=True))
    assert figure["says"] == "600 of 5000 readings are drawn: the least and the largest of each stretch."


def _said_of(command, *records):
    return verdict_of(SimpleNamespace(command=command, records=[], curves=[]), [r.as_dict() for r in records])


def test_the_top_of_a_page_tells_the_error_on_runs_that_were_left_out_beside_that_on_blocks():
    first = ImproveRecord("a/r.csv", "T1", 0, [], rmse_ahead_c=0.4, rmse_other_runs_c=0.8)
    last = ImproveRecord(
        "a/r.csv", "T1", 1, ["second_mode"], rmse_ahead_c=0.1, rmse_other_runs_c=0.2, stopped_because="nothing gains"
    )
    assert _said_of("improve", first, last) == [
        "r.csv: with second_mode the error on readings that were not fitted goes from 0.400 to 0.100 K, on this run with what is "
        "shared told by the others from 0.800 to 0.200 K.",
        "It stopped because nothing gains.",
        "1 row of the last step: 1 ok.",
    ]
    lines = SimpleNamespace(
        run="a/r.csv", labels=["base", "second_mode"], channels=("T1",), ahead_errors=[np.array([0.8]), np.array([0.2])]
    )
    (chart,) = charts_of(SimpleNamespace(command="improve", records=[first, last], steps=[lines]))
    assert chart.says.startswith("The error on this run with what is shared told by the other runs")


def test_a_command_without_sentences_of_its_own_says_those_of_its_records():
    rows = [ChangedRecord("new.csv", f"T{i}", verdict="nothing", message=f"sensor {i} is as it was") for i in range(5)]
    said = _said_of("changed", *rows)
    assert said == ["Verdict: Nothing.", *(f"Sensor {i} is as it was." for i in range(3)), "The table says more.", "5 rows: 5 ok."]
    clean = DiagnoseRecord("r.csv", "T1", verdict="none", message="down to the noise", advice="nothing to add")
    assert _said_of("diagnose", clean)[:3] == ["r.csv: Nothing is missing.", "Down to the noise.", "Advice: Nothing to add."]


def test_the_top_of_a_page_tells_the_temperature_at_the_moment_of_switching_off():
    rows = [
        IdentifyRecord("r.csv", f"T{i}", "afukf", switch_off_min=-2.0, switch_off_c=c, switch_off_lo_c=c - 1, switch_off_hi_c=c + 1)
        for i, c in enumerate((40.0, 50.0))
    ]
    assert "When it was switched off, at -2 min, T1 was the hottest, at 50.00 degC (95 %: 49.00 to 51.00)." in _said_of(
        "identify", *rows
    )


def test_a_sweeps_mark_is_the_time_that_serves_in_every_window():
    records = [
        SweepRecord("r.csv", "T1", "afukf", window_min=w, shortest_time_min=t, agreed=True) for w, t in ((40.0, 25.0), (50.0, 31.0))
    ]
    swept = SimpleNamespace(records=records, times=np.arange(20.0, 40.0), rmse=np.ones((2, 20)))
    (chart,) = charts_of(SimpleNamespace(command="sweep", records=records, curves=[swept]))
    assert chart.marks == ((31.0, "mark", "shortest time that serves"),)


def test_a_heat_is_drawn_in_watts_where_they_are_known():
    row = {
        "time_min": 1.0,
        "heat_k_per_min": 0.1,
        "lo_k_per_min": 0.0,
        "hi_k_per_min": 0.2,
        "heat_w": 50.0,
        "lo_w": 40.0,
        "hi_w": 60.0,
    }
    (strip,) = needed_heat([row, row | {"time_min": 2.0}])
    assert strip.unit == "W"
    assert strip.series[1].y.tolist() == [50.0, 50.0]
    assert needed_heat([]) == ()


def test_chances_and_tables_that_are_too_small_or_too_long_to_be_shown():
    assert chance(1.1e-307) == chance(0.0) == "&lt; 1e-300"
    assert chance(2e-299) == "2e-299"
    rows = [IdentifyRecord("r.csv", f"T{i}", "afukf").as_dict() for i in range(61)]
    assert glance(rows, {"r.csv": "r.csv"}) == ""
    assert glance(rows[:60], {"r.csv": "r.csv"}).count("<tr>") == 61


def test_an_open_side_of_an_interval_is_said():
    assert interval_words({"lo": 26.1, "hi": None}, ("lo", "hi"), 2) == "26.10 to open"
    row = IdentifyRecord("r.csv", "T1", "afukf", steady_state_c=27.0, steady_state_lo_c=None, steady_state_hi_c=28.0)
    assert "T1 settles highest, at 27.00 degC (95 %: open to 28.00)." in _said_of("identify", row)


def test_parameters_are_words_on_a_page_and_whole_where_they_are_copied():
    told = {"second_mode.kappa": {"value": 0.0048, "standard_error": 0.0001, "unit": "1/min"}}
    shown = page_cell("parameters", told)
    assert shown.endswith(">second_mode.kappa = 0.0048 ± 0.0001 1/min</td>")
    assert json.loads(html.unescape(re.search('data-value="([^"]*)"', shown)[1])) == told
    many = [{"time_min": float(k), "heat_k_per_min": 0.1} for k in range(40)]
    assert page_cell("unknown_heat", many).endswith("time_min 39, heat_k_per_min 0.1</code></details></td>")
    assert "<summary>40 entries</summary>" in page_cell("unknown_heat", many)
    assert '<details class="words">' in page_cell("message", "word " * 60)
