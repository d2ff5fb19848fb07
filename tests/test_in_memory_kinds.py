"""Kinds of tables in memory that are not pandas', and what a result is asked for."""

import numpy as np
import pyarrow as pa
import pytest

import thermofast as tf
from thermofast.results import Result

TIME = np.arange(60.0)
WARM = 20.0 + 5.0 * -np.expm1(-TIME / 20.0)


class Streamed:
    """A table of a library that nobody here knows, which gives an Arrow stream away."""

    def __init__(self, table):
        self.table = table

    def __arrow_c_stream__(self, requested_schema=None):
        return self.table.__arrow_c_stream__(requested_schema)


def test_a_table_that_gives_an_arrow_stream_is_read():
    run = tf.read(Streamed(pa.table({"time_min": TIME, "T1": WARM})))
    assert run.channels["T1"] == pytest.approx(WARM)
    assert run.time_s[-1] == 59.0 * 60.0
    with pytest.raises(tf.InputError, match="not a record"):
        tf.read(Streamed(pa.chunked_array([[1.0, 2.0]])))


def test_structured_arrays_are_tables():
    records = np.rec.fromarrays([TIME, WARM], names="time_min,T1")
    assert tf.read(np.array(records)).channels["T1"] == pytest.approx(WARM)


def test_complex_numbers_and_rows_as_dictionaries_are_refused_with_the_way():
    with pytest.raises(tf.InputError, match=r"'T1': complex, not a number(?s:.*)real part"):
        tf.read({"time_min": TIME, "T1": WARM + 5j})
    with pytest.raises(tf.InputError, match="not one-dimensional"):
        tf.read({"time_min": TIME[:2], "T1": [[1.0, 2.0], [3.0]]})
    with pytest.raises(tf.InputError, match=r"pandas.DataFrame\(rows\)"):
        tf.read({"time_min": 0.0, "T1": 20.0})


def test_records_are_found_in_their_result_and_places_beyond_it_are_told():
    found = tf.identify({"time_min": TIME, "T1": WARM})
    assert found[0] in found
    assert "T1" in found
    assert "T2" not in found
    with pytest.raises(IndexError, match="record 3 of 1"):
        found[3]


def test_a_whole_number_of_minutes_is_told_as_the_command_tells_it():
    found = tf.identify({"time_min": TIME, "T1": WARM}, until=40)
    assert (found[0].until_min, type(found[0].until_min)) == (40.0, float)
    with pytest.raises(tf.UsageError, match="it is called 'settings'"):
        tf.identify({"time_min": TIME, "T1": WARM}, set={"afukf.closing_step": False})


def test_categories_of_words_as_polars_keeps_them_are_words():
    """A dictionary of texts that are views, which Arrow casts to nothing."""
    words = pa.DictionaryArray.from_arrays(pa.array([0, 1] * 30, pa.int32()), pa.array(["on", "off"], pa.string_view()))
    whole = pa.DictionaryArray.from_arrays(pa.array(range(60), pa.int32()), pa.array(WARM))
    run = tf.read(pa.table({"time_min": TIME, "T1": WARM, "state": words, "T2": whole}))
    assert list(run.channels) == ["T1", "T2"]
    assert run.channels["T2"] == pytest.approx(WARM)


def test_words_of_reading_are_listed_where_one_is_not_known():
    with pytest.raises(tf.UsageError, match="no argument 'foo'") as told:
        tf.read({"time_min": TIME, "T1": WARM}, foo=1)
    assert "interval" in told.value.allowed


def test_a_watch_takes_a_filter_as_identify_does(tmp_path):
    path = tmp_path / "run.csv"
    np.savetxt(path, np.column_stack([TIME, WARM]), delimiter=",", header="time_min,T1", comments="")
    told = tf.watch(path, replay="max", leave=False, filter="ukf", tolerance=1.0)
    assert [r.filter for r in told] == ["ukf"]


@pytest.mark.parametrize("kind", Result.__subclasses__(), ids=lambda k: k.__name__)
def test_a_result_tells_a_type_checker_what_it_holds(kind):
    [base] = kind.__orig_bases__
    assert base.__args__ == (kind.kind,)
