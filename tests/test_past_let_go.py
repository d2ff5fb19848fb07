"""Past runs that a short record lets go: intervals reach to what they say until enough has been read."""

from types import SimpleNamespace

import numpy as np
import pytest

from thermofast.estimation.estimate import none_yet
from thermofast.estimation.imperfect import _with_past
from thermofast.estimation.rules import RULES


def said(steady, t95):
    one = none_yet(3, np.array([40.0]), np.array([True]))
    one.steady[:], one.t95[:] = steady, t95
    one.at[:, 0] = np.array(steady) - 1.0
    return one


@pytest.mark.parametrize(("share", "reaches"), [(0.9, True), (1.1, False)])
def test_intervals_reach_to_the_past_while_little_has_been_read(share, reaches):
    past = SimpleNamespace(time_constant=100.0)
    time = np.linspace(0.0, share * RULES.past_until * past.time_constant, 31)
    closed = SimpleNamespace(sensors=SimpleNamespace(time=time), count=len(time))
    own = said([30.0, 32.0, 36.0], [80.0, 100.0, 120.0])
    learnt = said([34.0, 40.0, 47.0], [200.0, 250.0, np.inf])
    own.let_go[:] = [True, False, True]
    learnt.steady[2] = learnt.t95[2] = np.nan  # nothing was said of it
    _with_past([closed], [np.ones(3, dtype=bool)], [own], [learnt], past)
    wide, narrow = [30.0, 32.0, 47.0], [30.0, 32.0, 36.0]
    assert own.steady.tolist() == [wide if reaches else narrow, narrow, narrow]
    assert own.t95.tolist()[0] == ([80.0, 100.0, np.inf] if reaches else [80.0, 100.0, 120.0])
    assert own.at[0, 0].tolist() == ([29.0, 31.0, 46.0] if reaches else [29.0, 31.0, 35.0])


def test_sensors_that_were_not_asked_keep_what_they_say():
    closed = SimpleNamespace(sensors=SimpleNamespace(time=np.arange(10.0)), count=10)
    own, learnt = said([30.0, 32.0, 36.0], [80.0, 100.0, 120.0]), said([34.0, 40.0, 47.0], [200.0, 250.0, 300.0])
    own.let_go[:] = True
    _with_past([closed], [np.array([True, False, False])], [own], [learnt], SimpleNamespace(time_constant=100.0))
    assert own.steady[:, 2].tolist() == [47.0, 36.0, 36.0]
