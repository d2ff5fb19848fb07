"""Records held by columns are the records: joined, reordered, as rows and as an Arrow table."""

import math
import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermofast.output.arrow import columns_to_arrow, to_arrow, types_of
from thermofast.records import IdentifyRecord, Record, SweepRecord
from thermofast.records.columns import Records, Same, numbers_of

numbers = st.none() | st.floats(allow_nan=False, allow_infinity=False)
records = st.builds(
    SweepRecord,
    run=st.sampled_from(["a.csv", "b.csv"]),
    channel=st.text(max_size=5),
    filter=st.sampled_from(["afukf", "ukf"]),
    window_min=numbers,
    rmse_c=numbers,
    agreed=st.none() | st.booleans(),
    status=st.sampled_from(["ok", "diverged"]),
    message=st.text(max_size=8),
)


def columns_of(several):
    """Numbers as arrays, as a worker hands them back."""
    held = Records.of(SweepRecord, several)
    for name in ("window_min", "rmse_c"):
        held = held.changed(**{name: np.array([math.nan if v is None else v for v in held.column(name)], dtype=float)})
    return held


@settings(max_examples=60, deadline=None)
@given(st.lists(records, max_size=6), st.lists(records, max_size=6), st.randoms(use_true_random=False))
def test_columns_hold_the_same_records(first, second, random):
    parts = [columns_of(first), Records.of(SweepRecord, second)]
    whole = Records.joined(parts)
    assert list(whole) == first + second
    assert whole == first + second
    assert len(whole) == len(first) + len(second)
    order = list(range(len(whole)))
    random.shuffle(order)
    assert list(whole.taken(np.array(order, dtype=np.intp))) == [(first + second)[i] for i in order]
    assert whole.rows() == [r.as_dict() for r in first + second]
    assert pickle.loads(pickle.dumps(whole)) == whole
    if whole:
        assert whole[-1] == (first + second)[-1]
        assert whole[1:] == tuple(first + second)[1:]


@settings(max_examples=60, deadline=None)
@given(st.lists(records, min_size=1, max_size=8))
def test_the_arrow_table_is_that_of_the_rows(several):
    types = types_of(SweepRecord)
    held = columns_of(several)
    told = to_arrow(SweepRecord.columns(), [r.as_dict() for r in several], types)
    assert columns_to_arrow(held, types).equals(told)
    assert told.column("agreed").to_pylist() == [r.agreed for r in several]
    assert told.column("message").to_pylist() == [r.message for r in several]


def test_columns_not_given_have_their_fields_default():
    held = Records(IdentifyRecord, 2, {"run": Same("r"), "channel": ["a", "b"], "filter": Same("afukf")})
    assert list(held) == [IdentifyRecord("r", "a", "afukf"), IdentifyRecord("r", "b", "afukf")]
    assert held.column("status") == ["ok", "ok"]
    assert held[0] is held[0]


def test_a_joined_column_of_numbers_keeps_whole_numbers_and_gaps():
    one = Records(IdentifyRecord, 1, {"run": Same("r"), "channel": ["a"], "filter": Same("x"), "until_min": Same(60)})
    other = Records(IdentifyRecord, 1, {"run": Same("r"), "channel": ["b"], "filter": Same("x"), "until_min": Same(None)})
    assert Records.joined([one, other]).column("until_min") == [60.0, None]
    assert Records.joined([one, one]).column("until_min") == [60, 60]


def test_nothing_cannot_be_joined():
    with pytest.raises(ValueError, match="no records"):
        Records.joined([])


def test_an_infinity_is_no_number():
    assert np.array_equal(numbers_of(np.array([1.0, np.inf, -np.inf, np.nan])), [1.0, np.nan, np.nan, np.nan], equal_nan=True)


def test_a_column_needs_a_value_where_its_field_has_no_default():
    @dataclass(frozen=True)
    class Bare(Record):
        size: float

    assert list(Records(Bare, 1, {"run": Same("r"), "channel": Same("c"), "size": np.array([2.0])})) == [Bare("r", "c", 2.0)]
