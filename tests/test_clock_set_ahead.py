"""A clock that leaps ahead while readings go on as if it had not."""

import numpy as np
import pytest

import thermofast as tf

MINUTES = np.arange(0.0, 240.0)


def read(leap=60.0, at=100, moved=0.0, noise=0.02, rises=(9.0, 5.0)):
    """Two sensors of 70 min, a reading a minute; from reading `at` on stamps are `leap` [min] later, and the machine `moved`."""
    rng = np.random.default_rng(4)
    stamps = MINUTES + leap * (at <= MINUTES)
    passed = MINUTES + moved * (at <= MINUTES)
    columns = {f"T{k}": 20.0 + r * -np.expm1(-passed / 70.0) + noise * rng.standard_normal(240) for k, r in enumerate(rises)}
    return tf.read({"time_min": stamps} | columns)


def test_a_leap_in_which_nothing_moved_is_told():
    (guess,) = read().guesses
    assert guess.text.startswith("61 min without a reading from 99 min on, in which no sensor moved")
    assert guess.about == "time"


@pytest.mark.parametrize(
    "given",
    [
        {"moved": 60.0},  # a logger that was off, of a machine that went on
        {"moved": 20.0},
        {"leap": 15.0},  # no more than some readings that are missing
        {"at": 5},  # nothing before it tells how fast it was
        {"rises": (0.0, 0.0)},  # nothing moves at all
        {"at": 225, "noise": 0.3},  # it had settled, for all that can be seen
    ],
)
def test_other_gaps_are_none(given):
    assert read(**given).guesses == ()
