"""The picture of a sweep marks a time only where all windows agree that it serves, as its page does."""

from dataclasses import replace

import pytest
from conftest import ROOT

import thermofast as tf
from thermofast.output.pictures.plots import draw_sweep


@pytest.mark.parametrize(
    ("agreed", "status", "marked"), [(True, "ok", True), (False, "ok", False), (True, "model_doubtful", False)]
)
def test_a_time_that_does_not_serve_is_not_marked(agreed, status, marked):
    run = tf.read(ROOT / "sample_runs" / "spindle.csv", channels=["T5"])
    (swept,) = tf.sweep(run, windows=[40, 50], times=(10, 40, 5)).curves
    rows = tuple(replace(r, agreed=agreed, status=status, shortest_time_min=20.0) for r in swept.records)
    axis = draw_sweep([replace(swept, records=rows)]).axes[0]
    labels = [line.get_label() for line in axis.get_lines()]
    assert ("shortest time that serves" in labels) is marked
