"""Slow parts of the usual size on machines that are quiet otherwise: what the interval leaves open of them."""

from dataclasses import replace

import numpy as np
import pytest

import thermofast as tf
from tests.priors import SMALL_SLOW
from thermofast.models.imperfection import TYPICAL, Part, settle
from thermofast.models.imperfection.evidence import Run
from thermofast.models.imperfection.shapes import LIMIT
from thermofast.models.imperfection.usual import deviations

NOISE = 0.02
TIME = np.arange(0.0, 181.0)


def reading(share, slower, side=1.0, seed=0):
    """Three time constants of a rise of 10 K beside a slow part, in white noise [K]."""
    rise = 10.0 * -np.expm1(-TIME / 60.0) + 10.0 * share * -np.expm1(-TIME / 60.0 / slower)
    return side * rise + NOISE * np.random.default_rng(seed).standard_normal(len(TIME))


def test_the_deviation_is_that_of_least_squares_with_slow_parts_of_the_usual_size():
    """Quiet to the end: start, rise, rate and four slow amplitudes, the latter of deviation 2 % of the rise over all, by least
    squares, the law's derivative in place of its curve.
    """
    quiet = replace(TYPICAL, scales=(1e-4,), strong=(), strong_weights=(), strong_share=0.0)
    run = Run([Part(TIME, reading(0.0, 1.0)[None], np.array([NOISE]), np.zeros(1))], 60.0, quiet, np.zeros(0), "own")
    log_rate, weight, *_ = run.posterior()
    asked, _ = deviations(run, log_rate, weight)
    fall = np.exp(-TIME / 60.0)
    slow = np.array([1.0 - np.exp(-k * TIME / 60.0) for k in (0.05, 0.1, 0.2, 0.4)]).T
    columns = np.column_stack([np.ones(len(TIME)), 1.0 - fall, 10.0 * TIME / 60.0 * fall, 10.0 * slow])
    normal = columns.T @ columns / NOISE**2
    normal[3:, 3:] += np.eye(4) * 4.0 / 0.02**2
    limit = np.array([1.0, 1.0, 0.0, *(10.0,) * 4])
    assert asked[0, LIMIT] == pytest.approx(np.sqrt(limit @ np.linalg.solve(normal, limit)), rel=0.05)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_small_slow_part_of_a_quiet_machine_is_in_the_interval(side):
    """3 % of the rise eight times as slow: the readings are those of one exponential that ends 0.15 K too early."""
    for seed in range(4):
        found = tf.identify({"time_min": TIME, "T": 40.0 + reading(0.03, 8.0, side, seed)}, imperfection=SMALL_SLOW)[0]
        assert found.status == "ok"
        assert found.steady_state_lo_c < 40.0 + side * 10.3 < found.steady_state_hi_c
        near, far = (abs(end - found.steady_state_c) for end in (found.steady_state_lo_c, found.steady_state_hi_c)[:: int(side)])
        assert near < 0.8 * far  # what is cold takes heat and gives none
        assert found.t95_hi_min - found.t95_min > found.t95_min - found.t95_lo_min


def test_what_swings_more_or_is_known_leaves_nothing_more_open():
    """A machine with usual disturbances has slow parts in its own scale, the bare law has none, and a lab may say how large."""
    part = [Part(TIME, reading(0.0, 1.0)[None], np.array([NOISE]), np.zeros(1))]
    usual = settle(part, 60.0, replace(TYPICAL, scales=(1.0,)))
    run = Run(part, 60.0, replace(TYPICAL, scales=(1.0,), strong=(), strong_weights=(), strong_share=0.0), np.zeros(0), "own")
    assert deviations(run, *run.posterior()[:2]) is None
    bare, few, small = (
        tf.identify({"time_min": TIME, "T": 20.0 + reading(0.0, 1.0)}, imperfection=prior)[0]
        for prior in ("none", TYPICAL, replace(TYPICAL, background=replace(TYPICAL.background, slow=0.002)))
    )
    half = [r.steady_state_hi_c - r.steady_state_c for r in (bare, small, few)]
    assert half[0] < half[1] < half[2] < usual.steady[0, 2] - usual.steady[0, 1]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_is_foretold_and_drawn_reaches_to_the_side_of_the_rise_too(side):
    """Of a machine that is known to be quiet."""
    part = [Part(TIME, reading(0.0, 1.0, side)[None], np.array([NOISE]), np.zeros(1))]
    quiet = replace(TYPICAL, scales=(0.03,), strong=(), strong_weights=(), strong_share=0.0)
    found = settle(part, 60.0, quiet, [900.0], draws=20)
    for low, middle, high in (found.steady[0], found.at[0, 0]):
        near, far = (abs(end - middle) for end in (low, high)[:: int(side)])
        assert far > 1.5 * near
    early, late = found.drawn.factor[0]
    assert early == pytest.approx(1.0, abs=0.1)
    assert late > 1.5
