"""Effects and filters of users: as good as built-in ones, and unable to hurt."""

import json
import pickle
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT

import thermofast as tf
from thermofast.filters import BUILT_IN as FILTERS
from thermofast.models import Observations
from thermofast.models.drive import Drive
from thermofast.models.effects import BUILT_IN as EFFECTS
from thermofast.models.effects import Values
from thermofast.plugins import effects, filters
from thermofast.plugins.guard import PluginError, contained
from thermofast.plugins.trial import check_shapes

HIDDEN, SPINDLE = ROOT / "sample_runs" / "hidden.csv", ROOT / "sample_runs" / "spindle.csv"
EFFECT = (ROOT / "sample_runs" / "my_effect.py").read_text()
FILTER = (ROOT / "sample_runs" / "my_filter.py").read_text()
#: A loss that falls by up to five times itself.
NEGATIVE = """
from thermofast.models.effects import Effect, Parameter


class Negative(Effect):
    id, summary, equation, tell_tale = "negative", "s", "e", "t"
    uses_sink = True
    amplitude = "a"
    parameters = (Parameter("a", "1", -1.0, 1.0, 0.3, "share", null=0.0),)

    def apply(self, drive, run, p):
        drive.loss = drive.loss - 5.0 * p.a
"""


@pytest.mark.parametrize("kind", EFFECTS, ids=lambda k: k.id)
def test_built_in_effects_pass_the_check_that_everyones_do(kind):
    assert effects.declaration_problem(kind) is None
    effects.check(kind(), kind.id)


@pytest.mark.parametrize("kind", FILTERS, ids=lambda k: k.name)
def test_built_in_filters_pass_the_check_that_everyones_do(kind):
    assert filters.declaration_problem(kind) is None
    if kind.name != "rls":  # it asks for more readings than the check has
        filters.check(kind(), kind.name)


def test_a_copy_of_a_built_in_effect_is_as_good_as_it(tmp_path):
    source = (ROOT / "models" / "effects" / "sensor_lag.py").read_text()
    text = re.sub(
        r"from \.+([\w.]*) import",
        lambda m: f"from thermofast.models.{'' if m[0].startswith('from ..') else 'effects.'}{m[1]} import",
        source,
    )
    path = tmp_path / "mine.py"
    path.write_text(text.replace('id = "sensor_lag"', 'id = "my_lag"'))
    made = tf.simulate(effects="sensor_lag", seed=5, sensors=3).run()
    own = tf.diagnose(made, effects=[f"{path}"])[0].ranking[0]
    built_in = tf.diagnose(made, effects=["sensor_lag"])[0].ranking[0]
    assert own["effect"] == "my_lag"
    for key in ("gain", "p", "rmse_fit_c", "identifiable", "at_noise"):
        assert own[key] == built_in[key], key
    loaded = effects.load_effect(str(path))
    for name in ("places", "choice_costs", "logged", "uses_sink", "scope", "event"):
        assert getattr(loaded, name) == getattr(next(k for k in EFFECTS if k.id == "sensor_lag"), name)
    assert pickle.loads(pickle.dumps(loaded)).id == "my_lag"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("drive.heat = drive.heat + p", "drive.heet = drive.heat + p"), ["'Drive' object has no attribute 'heet'", "did you mean 'heat'?", "line 24"]),
        (("drive.heat = drive.heat + p", "drive.hidden = drive.hidden + p"), ["write drive.hidden.append((coupling, rate))"]),
        (("drive.heat = drive.heat + p", "drive.hidden = p"), ["drive.hidden is a list of pairs", "write drive.hidden.append"]),
        (("run.middle", "run.midle"), ["'midle'", "did you mean 'middle'?"]),
        (
            ("np.clip((run.middle - p.begin) / p.length, 0.0, 1.0)", "(run.time > p.begin)"),
            ["'begin' has no derivative", "run.after(p.begin)"],
        ),
        (("from thermofast.models.effects", "from models.effects"), ["from thermofast.models.effects import"]),
        (("drive.heat = drive.heat + p", "drive.heat = 1.0 + p"), ["behind another effect, at", "takes back what that one did"]),
        (("run.middle - p.begin", "run.middle * np.random.default_rng().uniform() - p.begin"), ["another curve each time"]),
    ],
)  # fmt: skip
def test_the_check_of_an_effect_says_what_to_write_instead(change, words, tmp_path, tool):
    text = EFFECT.replace(*change)
    assert text != EFFECT
    path = tmp_path / "mine.py"
    path.write_text(text)
    done = tool("effects", "--effect", path)
    assert (done.code, done.out) == (2, "")
    for word in words:
        assert word in done.err


def test_an_effect_of_a_column_that_no_trial_record_has_is_checked_too(tmp_path, tool):
    for k, there in enumerate(('"rpm" in run.inputs', '"rpm" in {**run.ambient, **run.inputs}')):
        logged = f'def choices(self, run):\n        return [Choice("", {{"column": "rpm"}})] if {there} else []\n\n    def apply'
        text = EFFECT.replace("def apply", logged).replace("import Effect", "import Choice, Effect")
        for heat, code in (("drive.heat + p", 0), ("2.0 * drive.heat + p", 2)):
            path = tmp_path / f"mine_{k}_{code}.py"
            path.write_text(text.replace("drive.heat + p", heat))
            done = tool("effects", "--effect", path)
            assert done.code == code, done.err
            assert ("it must change nothing" in done.err) == bool(code)


def test_one_parameter_without_its_comma_is_told(tmp_path, tool):
    path = tmp_path / "mine.py"
    path.write_text(
        re.sub(r"parameters = \([\s\S]*?\n    \)\n", 'parameters = Parameter("a", "1", 0.0, 1.0, 0.5, "x", null=0.0)\n', EFFECT)
    )
    done = tool("effects", "--effect", path)
    assert done.code == 2
    assert "with a comma behind it" in done.err


def test_an_effect_never_fits_worse_than_the_model_without_it(tmp_path):
    """At its null it is that model; a search from where a straight line points may end far away."""
    time, rng = np.arange(400.0), np.random.default_rng(3)
    run = {"time_min": time}
    for name, tau in (("T1", 60.0), ("T2", 90.0), ("T3", 45.0)):  # a heat of twice its last value that falls with 40 min
        late = (np.exp(-time / 40.0) - np.exp(-time / tau)) * 6.0 / (1.0 - tau / 40.0)
        run[name] = (20.0 - 6.0 * np.expm1(-time / tau) + late + 0.01 * rng.standard_normal(len(time))).round(3)
    path = tmp_path / "mine.py"
    path.write_text(NEGATIVE)
    found = tf.improve(run, add=str(path)).to_frame()
    base, added = (found[found.step == k].rmse_fit_c.to_numpy() for k in (0, 1))
    assert (added <= 1.001 * base).all()


def test_a_step_written_with_the_share_of_the_interval_is_accepted(tmp_path, tool):
    path = tmp_path / "mine.py"
    path.write_text(
        EFFECT.replace("np.clip((run.middle - p.begin) / p.length, 0.0, 1.0)", "run.after(p.begin) * (1.0 + 0.01 * p.length)")
    )
    assert tool("effects", "--effect", path).code == 0


def test_a_filter_of_a_file_runs_in_every_process(tool, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(FILTER)
    common = ("identify", SPINDLE, "--until", 60, "--filter", path, "--format", "json", "-q")
    one, two = (json.loads(tool(*common, "--jobs", jobs).out)["records"] for jobs in (1, 2))
    assert one == two
    assert {r["filter"] for r in one} == {"tight_ukf"}
    assert abs(one[4]["steady_state_c"] - 26.7) < 0.5
    set_ = json.loads(tool(*common, "--set", "tight_ukf.spread=0.9").out)["records"]
    assert set_ != one
    assert "spread" in tool("filters", path).out
    assert tf.identify(SPINDLE, until=60, filter=str(path))["T5"].steady_state_c == one[4]["steady_state_c"]
    assert tool("sweep", SPINDLE, "--filter", path, "--channels", "T5", "-q").code == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("setting(0.1, ", "0.1  # ("), "must say its meaning and range"),
        (("0.001, 1.0)", "0.5, 1.0)"), "has a default outside 0.5 to 1"),
        (('closing = "never"', 'closing = "later"'), "closing must be one of"),
        (('summary = "unscented filter with sigma points close to the mean"', 'summary = ""'), "summary must be a non-empty text"),
        (("ScaledPoints(self.spread)", "ScaledPoint(self.spread)"), "NameError"),
        (("ScaledPoints(self.spread)", "ScaledPoints(self.spred)"), "did you mean 'spread'?"),
        (("class TightUkf(GaussianFilter)", "class TightUkf"), "no filter class"),
        (("from thermofast.filters import", "from filters import"), "from thermofast.filters import"),
    ],
)  # fmt: skip
def test_the_check_of_a_filter_says_what_to_write_instead(change, words, tmp_path, tool):
    text = FILTER.replace(*change)
    assert text != FILTER
    path = tmp_path / "mine.py"
    path.write_text(text)
    done = tool("identify", SPINDLE, "--filter", path)
    assert (done.code, done.out) == (2, "")
    assert words in done.err


def test_what_a_filter_gives_back_is_looked_at():
    track = FILTERS[0]().track(__import__("thermofast.models").models.Lump(), np.arange(60.0), 20 + np.arange(60.0) ** 0.5, 0.0)
    assert filters.track_problem(track, 60, "always") is None
    assert "shape (60, 3), needed (61, 3)" in filters.track_problem(track, 61, "always")
    assert "gave int" in filters.track_problem(7, 60, "always")
    for name, value, words in (
        ("state", np.full((60, 3), np.nan), "state is not finite"),
        ("covariance", -track.covariance, "needed 0 or more"),
        ("weight", [1.0] * 60, "weight is of type list"),
        ("weight", np.ones(60, dtype=int), "weight is of type int64"),
        ("weight", np.where(np.arange(60) == 59, np.nan, 1.0), "weight holds nan"),
        ("weight", np.where(np.arange(60) == 59, -0.01, 1.0), "weight holds -0.01"),
        ("weight", np.where(np.arange(60) == 59, 1.01, 1.0), "weight holds 1.01"),
        ("weight", np.zeros(60), "leaves out every reading"),
        ("noise_factor", np.zeros(60), "noise_factor holds 0"),
        ("noise_factor", np.where(np.arange(60) == 59, np.nan, 1.0), "noise_factor holds nan"),
        ("first", 9.0, "first is 9.0"),
        ("first", 61, "first is 61"),
        ("first", True, "first is True"),
        ("diverged_at", -3, "diverged_at is -3"),
        ("first", 60, "begins at no reading, and its closing is 'never'"),
    ):
        assert words in filters.track_problem(replace(track, **{name: value}), 60, "never")
    assert filters.track_problem(replace(track, first=60), 60, "always") is None
    left_out = replace(track, weight=np.where(np.arange(60) == 59, 0.0, 1.0), noise_factor=np.where(np.arange(60) == 59, 0.0, 1.0))
    assert filters.track_problem(left_out, 60, "always") is None  # of a reading that does not count nothing is asked
    with pytest.raises(PluginError, match="needed a class derived from"):
        filters.checked(int, "mine")


def test_a_filter_that_knows_later_readings_is_refused(tmp_path):
    """Its error in a sweep, which asks what was known at each time, would be that of hindsight."""
    text = (
        FILTER.replace("import ", "import dataclasses\nimport ", 1)
        if FILTER.startswith("import")
        else "import dataclasses\n" + FILTER
    )
    text += """
    def track(self, model, time, reading, resolution):
        found = super().track(model, time, reading, resolution)
        state = found.state.copy()
        state[found.first :, 2] = state[-1, 2]
        return dataclasses.replace(found, state=state)
"""
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(PluginError, match="is another where other readings come later"):
        filters.load_filter(str(path))


@pytest.mark.parametrize("late", ["np.nan", "np.inf"])
def test_an_effect_that_breaks_on_a_longer_record_than_that_of_the_check_is_named(late, tmp_path):
    """No traceback, no row that looks like a result; the search goes on without it."""
    path = tmp_path / "mine.py"
    heat = "drive.heat = drive.heat + "
    assert heat in EFFECT
    path.write_text(
        "import numpy as np\n" + EFFECT.replace(heat, f"drive.heat = drive.heat + ({late} if len(run.time) > 100 else 0.0) + ")
    )
    name = effects.load_effect(str(path)).id
    rows = [*tf.compare(HIDDEN, effects=[name], extra=[str(path)]), *tf.improve(HIDDEN, add=[str(path)]).records]
    assert {r.status for r in rows} == {"failed"}
    assert all("drive.heat is not finite" in r.message and "nan or inf where " in r.message for r in rows)
    told = tf.diagnose(HIDDEN, effects=[name, "second_mode"], extra=[str(path)])
    assert {r.status for r in told} != {"failed"}
    assert f"left out: effect '{name}'" in told[0].message


def test_what_was_not_finite_before_is_not_the_fault_of_an_effect_behind():
    effect = effects.load_effect(str(ROOT / "sample_runs" / "my_effect.py"))
    minutes = np.arange(20.0)
    reading = np.full((1, 20), 20.0)
    run = Observations("run", ("T1",), minutes, reading, np.ones_like(reading), np.full(1, 0.01), np.zeros(1))
    drive = Drive.plain(run, np.array([0]), np.full((1, 1), 20.0))
    drive.heat = np.full((1, 20), np.nan)
    effect.apply(drive, run, Values({p.name: np.full((1, 1), p.start) for p in effect.parameters}, {}))
    assert np.isnan(drive.heat).all()


@pytest.mark.parametrize("by_row", ["", " + float(p.a)"])
def test_an_effect_of_complex_numbers_is_refused(by_row, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(NEGATIVE.replace("5.0 * p.a", f"(0.0j * run.time + 5.0 * p.a{by_row})"))
    with pytest.raises(PluginError, match=r"drive\.loss is complex"):
        effects.load_effect(str(path))


def test_the_guides_are_what_is_run():
    for page, code in (("add-an-effect.md", EFFECT), ("add-a-filter.md", FILTER)):
        shown = re.search(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.S)[1]
        # What the page shows stands in the file, docstrings aside.
        lines = [line for line in shown.splitlines() if line.strip()]
        assert [line for line in lines if line not in code] == []
        body = [line for line in lines if not line.startswith(("from ", "import ", "@", '    """'))]
        assert len(body) <= (25 if "effect" in page else 40)


HIDDEN_MASS = """
from thermofast.models.effects import Effect, Parameter


class Mass(Effect):
    id = "my_mass"
    summary = equation = tell_tale = "a hidden mass"
    scope = "sensor"
    amplitude = "kappa"
    parameters = (
        Parameter("kappa", "1/min", 0.0, 2.0, 0.01, "coupling", null=0.0, each="sensor"),
        Parameter("rate", "1/min", 2e-4, 2.0, 0.01, "rate", each="sensor", log=True),
    )

    def apply(self, drive, run, p):
        if p.kappa > 0.0:  # with an if on a value it is called sensor by sensor
            drive.hidden.append((p.kappa, p.rate))
"""


def test_hidden_masses_of_an_effect_written_for_one_sensor_are_those_of_all(tmp_path):
    path = tmp_path / "mass.py"
    path.write_text(HIDDEN_MASS)
    mine = effects.load_effect(str(path))
    built_in = next(kind for kind in EFFECTS if kind.id == "second_mode")()
    time = np.arange(0.0, 200.0, 2.0)
    full = np.full(3, 0.01)
    run = Observations("r", ("A", "B", "C"), time, np.full((3, 100), 20.0), np.ones((3, 100)), full, 0.0 * full)
    p = Values({"kappa": np.array([[0.01], [0.0], [0.03]]), "rate": np.array([[0.004], [0.01], [0.02]])}, {})
    curves = []
    for effect in (mine, built_in):
        drive = Drive.plain(run, np.arange(3), np.full((3, 1), 18.0))
        effect.apply(drive, run, p)
        curves.append(drive.forward(run, np.array([0.02, 0.03, 0.04]), np.array([8.0, 6.0, 5.0]), np.full(3, 18.0)))
    assert curves[0] == pytest.approx(curves[1], abs=1e-12)


def test_what_is_installed_is_looked_for_once_along_a_path(monkeypatch):
    """Each look reads the metadata of every package: a third of the time of a small `tf.identify`."""
    from thermofast.plugins import entrypoints

    asked = []
    monkeypatch.setattr(entrypoints, "entry_points", lambda group: asked.append(group) or [])
    for _ in range(3):
        assert entrypoints.installed("thermofast.nothing", lambda member, origin: member) == ([], [])
    assert asked == ["thermofast.nothing"]
    monkeypatch.syspath_prepend(".")
    entrypoints.installed("thermofast.nothing", lambda member, origin: member)
    assert asked == ["thermofast.nothing"] * 2


def plain_drive():
    """Of two sensors over 61 readings."""
    time, wide = np.arange(61.0), np.ones((2, 61))
    run = Observations("run", ("a", "b"), time, 20.0 * wide, wide, np.ones(2), np.ones(2))
    return Drive.plain(run, np.array([0, 1]), np.full((2, 1), 20.0)), run


@pytest.mark.parametrize(
    ("does", "words"),
    [
        (
            "drive.lag = np.ones(5)",
            "drive.lag has the wrong shape\n  found: (5,)\n  allowed: what broadcasts to (rows, 1) = (2, 1)",
        ),
        ("drive.delay = np.ones((2, 7))", "drive.delay has the wrong shape"),
        ("drive.hidden.append((np.ones((7, 1)), np.ones((7, 1))))", "drive.hidden[0] has the wrong shape"),
        ("drive.hidden.append(('a', 'b'))", "drive.hidden[0] has the wrong shape\n  found: 'a'"),
        ("drive.links.append((0.01, np.ones(3)))", "drive.links[0] has the wrong shape\n  found: (3,)"),
        ("del drive.heat", "drive.heat is gone"),
    ],
)
def test_what_an_effect_leaves_of_a_drive_fits_its_rows_and_readings(does, words):
    """Whatever it was: never an error out of numpy from where the drive is used."""
    drive, run = plain_drive()
    exec(does, {"np": np, "drive": drive})
    with pytest.raises(PluginError) as error:
        check_shapes(EFFECTS[0](), drive, run)
    assert words in str(error.value)


def test_one_number_of_each_row_may_stand_in_a_line():
    drive, run = plain_drive()
    drive.lag, drive.delay = np.array([1.0, 2.0]), np.ones((2, 61))
    drive.links.append((np.array([0.01, 0.02]), np.full(61, 20.0)))
    check_shapes(EFFECTS[0](), drive, run)
    assert drive.links[0][0].shape == (2, 1)
    assert np.isfinite(drive.forward(run, np.full(2, 0.02), np.full(2, 5.0), np.full(2, 20.0))).all()


def test_what_foreign_code_prints_goes_aside_and_other_threads_print_where_they_did(capsys):
    out, inside, told = sys.stdout, threading.Barrier(3), threading.Barrier(3)

    def foreign(name):
        with contained():
            inside.wait(20.0)
            print(name)
            told.wait(20.0)
        print(f"{name} done")

    threads = [threading.Thread(target=foreign, args=(name,)) for name in ("one", "two")]
    for thread in threads:
        thread.start()
    inside.wait(20.0)
    print("a table")
    told.wait(20.0)
    for thread in threads:
        thread.join()
    assert sys.stdout is out  # whoever left last
    printed = capsys.readouterr()
    assert sorted(printed.out.split("\n")) == ["", "a table", "one done", "two done"]
    assert sorted(printed.err.split()) == ["one", "two"]


def test_standard_output_is_as_it_was_after_runs_in_threads():
    out, run = sys.stdout, tf.read(SPINDLE)
    with ThreadPoolExecutor(4) as pool:
        statuses = list(pool.map(lambda minutes: tf.identify(run, until=minutes, jobs=1)[0].status, (40.0, 60.0, 80.0, 100.0)))
    assert statuses == ["ok"] * 4
    assert sys.stdout is out


def test_prints_stay_aside_until_the_last_is_out(capsys):
    """Of one call within another, and of two threads of which one is done before the other."""
    out, first_is_out, entered = sys.stdout, threading.Event(), threading.Event()

    def long():
        with contained():
            entered.set()
            first_is_out.wait(20.0)
            print("long")

    thread = threading.Thread(target=long)
    with contained():
        with contained():
            print("inner")
        print("outer")
        thread.start()
        entered.wait(20.0)
    print("a table")
    first_is_out.set()
    thread.join()
    printed = capsys.readouterr()
    assert (printed.out, printed.err.split()) == ("a table\n", ["inner", "outer", "long"])
    assert sys.stdout is out
