"""Small samples of long proofs: records of no machine, what must not matter, work done again and again."""

import pytest

from benchmarks.reading.random_records import metamorphic, outcome
from benchmarks.scale.soak import soak


@pytest.mark.parametrize("first", [0, pytest.param(500_000, marks=pytest.mark.proof)])
def test_records_of_no_machine_get_a_status(first):
    told = {seed: outcome(seed) for seed in range(first, first + 36)}
    assert {s: t for s, t in told.items() if t not in ("a status each", "refused")} == {}


@pytest.mark.parametrize(
    "seed", [503_504, 505_728, 506_797, 713_982, pytest.param(718_700, marks=pytest.mark.proof), 722_610, 724_312]
)
def test_those_that_once_warned(seed):
    assert outcome(seed) == "a status each"


@pytest.mark.parametrize("seed", range(4))
def test_units_and_zero_points_change_nothing_but_units(seed):
    assert metamorphic(seed) == []


@pytest.mark.proof
def test_nothing_is_left_open():
    slope, error, turns, files, threads = soak(0.0, 3, 8)
    assert turns >= 11
    assert (files, threads) == (0, 0)
    assert slope - 3.0 * error < 300.0  # kB a turn: a leak of a record would be more
