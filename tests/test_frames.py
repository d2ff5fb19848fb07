"""Frames and tables in memory: read as a file of the same cells is, options that say something of them, no raw errors."""

import multiprocessing
import warnings

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from conftest import ROOT

import thermofast as tf
from thermofast.errors import InputError, UsageError

SPINDLE = pd.read_csv(ROOT / "sample_runs" / "spindle.csv")
ARROW = pa.Table.from_pandas(SPINDLE)


def same(a, b):
    assert list(a.channels) == list(b.channels)
    for name in a.channels:
        np.testing.assert_array_equal(a.channels[name], b.channels[name])


@pytest.mark.parametrize("missing", ["25", ["25", "lost"]])
def test_missing_means_the_same_in_a_frame_a_table_and_a_file(tmp_path, missing):
    frame = SPINDLE.copy()
    frame.loc[20:25, "T1":"T10"] = 25.0
    frame.to_csv(tmp_path / "run.csv", index=False)
    frame.to_parquet(tmp_path / "run.parquet")
    read = [tf.read(source, missing=missing) for source in (str(tmp_path / "run.csv"), frame, str(tmp_path / "run.parquet"))]
    for run in (*read, tf.read(pa.Table.from_pandas(frame), missing=missing)):
        same(run, read[0])
        assert np.isnan(run.channels["T8"][20:26]).all()


def test_a_word_that_means_no_reading_leaves_numbers():
    frame = SPINDLE.astype({"T3": object})
    frame["T3"] = frame["T3"].map(str)
    frame.loc[5, "T3"] = "lost"
    with pytest.raises(InputError, match="T3"):
        tf.read(frame, channels="T3")
    assert np.isnan(tf.read(frame, missing="lost").channels["T3"][5])


@pytest.mark.parametrize("option", [{"delimiter": ";"}, {"decimal": ","}, {"skip_footer": 2}, {"sheet": "1"}, {"header_line": 2}])
def test_what_is_said_of_files_is_refused_of_frames(option):
    for record in (SPINDLE, ARROW):
        with pytest.raises(UsageError, match="is for files, and this is none"):
            tf.read(record, **option)


def test_limits_hold_for_frames():
    with pytest.raises(InputError, match="401 rows"):
        tf.read(SPINDLE, max_rows=400)
    assert len(tf.read(SPINDLE, max_rows=401).time_s) == 401


def test_durations_say_their_unit():
    frame = SPINDLE.drop(columns="time_min").set_index(pd.to_timedelta(SPINDLE.time_min, unit="min"))
    assert tf.read(frame).time_s[-1] == 24000.0
    for record in (frame, pa.Table.from_pandas(frame.reset_index())):
        with pytest.raises(UsageError, match="durations, which say their unit"):
            tf.read(record, time_unit="min")


@pytest.mark.parametrize("form", ["string_view", "runs", "dictionary"])
def test_every_form_of_an_arrow_column_is_a_sensor(form):
    column = ARROW["T5"].combine_chunks()
    as_form = {
        "string_view": lambda: column.cast(pa.string()).cast(pa.string_view()),
        "runs": lambda: pc.run_end_encode(column),
        "dictionary": lambda: column.dictionary_encode(),
    }[form]()
    same(tf.read(ARROW.set_column(ARROW.column_names.index("T5"), "T5", pa.chunked_array([as_form]))), tf.read(ARROW))


def test_a_column_of_another_kind_is_told_and_refused_by_strict():
    lists = ARROW.append_column("pairs", pa.array([[1.0, 2.0]] * 401))
    assert "left out" in tf.read(lists).guesses[-1].text
    with pytest.raises(InputError, match="pairs"):
        tf.read(lists, strict=True)


@pytest.mark.parametrize("text", ["{:.2f} °C", "{:.2f}°C"])
def test_cells_with_their_unit_are_numbers(text):
    frame = SPINDLE.assign(T1=SPINDLE.T1.map(text.format), T2=[f"{1.8 * v + 32:.3f} °F".replace(".", ",") for v in SPINDLE.T2])
    run = tf.read(frame)
    np.testing.assert_allclose(run.channels["T1"], SPINDLE.T1, atol=0.006)
    np.testing.assert_allclose(run.channels["T2"], SPINDLE.T2, atol=0.001)


def test_a_run_made_by_hand_is_of_numbers_one_for_each_time():
    time, rise = np.arange(0.0, 6000.0, 60.0), 20.0 - 5.0 * np.expm1(-np.arange(100) / 30.0)
    rise += np.random.default_rng(1).normal(0.0, 0.005, 100)
    single = tf.identify(tf.Run("r", time.astype(np.float32), {"T1": rise.astype(np.float32)}))[0]
    told = tf.identify(tf.Run("r", time.tolist(), {"T1": rise.tolist()}))[0]
    assert single.status == told.status == "ok"
    assert single.steady_state_c == pytest.approx(told.steady_state_c, abs=1e-3)
    with pytest.raises(InputError, match=r"'T1' has the wrong shape"):
        tf.Run("r", time, {"T1": rise[1:]})
    with pytest.raises(InputError, match="no array of numbers"):
        tf.Run("r", time, {"T1": ["warm"] * 100})


def test_frames_on_both_sides_have_names_of_their_own():
    hidden = pd.read_csv(ROOT / "sample_runs" / "hidden.csv")
    again = pd.read_csv(ROOT / "sample_runs" / "hidden_second_run.csv")
    named = tf.changed(tf.read(hidden, name="old"), tf.read(again, name="new"))
    assert [r.verdict for r in tf.changed(hidden, again)] == [r.verdict for r in named]


def test_an_inspection_is_asked_by_column():
    found = tf.inspect(SPINDLE)
    assert found["T1"].role == "sensor"
    assert "ambient" in found
    with pytest.raises(KeyError, match="no sensor 'nope'"):
        found["nope"]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: tf.read(SPINDLE, resistance=5), "not a resistance"),
        (lambda: tf.read(SPINDLE, resistance=(None, 1)), "not a resistance"),
        (lambda: tf.read(SPINDLE, long=5), "not two columns"),
        (lambda: tf.read(SPINDLE, long=(1, 2)), "not two columns"),
        (lambda: tf.plan(0.5, sensors=2.5), "a whole number above zero"),
        (lambda: tf.plan([]), "tolerance: none"),
        (lambda: tf.plan(like=[SPINDLE, SPINDLE]), "not one run"),
        (lambda: tf.identify({"a": SPINDLE}), "not one-dimensional"),
        (lambda: tf.archive("identify", SPINDLE, "results/"), "a path or pattern"),
    ],
)
def test_wrong_arguments_are_refused_in_words(call, words):
    with pytest.raises(tf.ThermofastError, match=words):
        call()


def test_a_model_knows_its_own_run_however_it_is_given(tmp_path):
    made = tf.simulate(effects="load_step", seed=11, sensors=4)
    made.save(str(tmp_path / "run.csv"))
    frame = made.to_frame()
    model = tf.improve(str(tmp_path / "run.csv"), auto=True).model
    rows = [tf.identify(run, until=100.0, model=model)["T1"] for run in (str(tmp_path / "run.csv"), frame)]
    assert rows[0].steady_state_c == rows[1].steady_state_c
    assert all("the run that the model was learnt from: load_step as it was there" in row.message for row in rows)
    other = tf.simulate(effects="load_step", seed=12, sensors=4).to_frame()
    assert "learnt from: load_step" not in tf.identify(other, until=100.0, model=model)["T1"].message


def test_a_last_line_without_its_end_is_whole_where_numbers_have_few_decimals_now_and_then(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(SPINDLE.to_csv(index=False).rstrip("\n"))
    assert len(tf.read(str(path)).time_s) == 401


def _in_a_pool(path):
    return len(tf.identify(path, jobs=2))


def test_a_process_of_a_pool_works_alone():
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.map(_in_a_pool, [str(ROOT / "sample_runs" / "spindle.csv")]) == [10]


def test_a_denoised_record_is_a_record_again():
    columns = tf.compare(SPINDLE, denoise=True).denoised[0].columns
    run = tf.read(pd.DataFrame(columns))
    assert (list(run.channels), list(run.ambient)) == ([f"T{k + 1}" for k in range(10)], ["ambient"])
    np.testing.assert_array_equal(run.ambient["ambient"], SPINDLE.ambient)
    assert set(run.inputs) == {f"T{k + 1}{side}" for k in range(10) for side in ("_lo", "_hi")}


def test_sensors_at_the_bottom_and_the_top_are_no_band():
    frame = SPINDLE[["time_min", "T1", "T5"]].assign(T1_lo=SPINDLE.T2, T1_hi=SPINDLE.T3)
    assert list(tf.read(frame).channels) == ["T1", "T5", "T1_lo", "T1_hi"]


@pytest.mark.parametrize("name", ["machine", "run", "sample"])
def test_a_number_that_says_whose_record_it_is_is_no_sensor(name):
    run = tf.read(SPINDLE.assign(**{name: 3}))
    assert len(run.channels) == 10
    assert any(f"columns that never change left out: {name} is 3" in note for note in run.notes)
    assert len(tf.read(SPINDLE.assign(**{name: 3}), channels=["T1", name]).channels) == 2


def test_a_sensor_is_asked_for_by_its_name_without_the_unit_too():
    minutes = np.arange(60.0)
    rise = 20.0 + 5.0 * -np.expm1(-minutes / 20.0) + np.random.default_rng(0).normal(0.0, 0.02, 60)
    result = tf.identify({"time_min": minutes, "T1 [degC]": rise, "T2 [degC]": rise + 1.0})
    assert result["T1"] == result["T1 [degC]"] == result[0]
    assert "T2" in result
    assert "T3" not in result
    with pytest.raises(KeyError, match=r"T1 \[degC\], T2 \[degC\]"):
        result["T3"]


def test_how_numpy_takes_errors_is_the_programs_own():
    """With all of them raised an underflow in the posterior was one; readings of no end are gaps without a warning of numpy's."""
    time = np.arange(0.0, 46.0)
    frame = pd.DataFrame({"time_min": time, "T1": 20.0 - 9.0 * np.expm1(-time / 15.0)})
    plain = tf.identify(frame)[0].steady_state_c
    with np.errstate(all="raise"):
        assert tf.identify(frame)[0].steady_state_c == plain
        assert np.geterr() == dict.fromkeys(("divide", "over", "under", "invalid"), "raise")
    frame.loc[20:22, "T1"] = np.inf
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert tf.identify(frame)[0].steady_state_c == pytest.approx(plain, abs=0.02)
