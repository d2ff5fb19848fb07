"""Columns that a logger writes only where they have changed by so much (a deadband; state changes of building automation)."""

import numpy as np
import pytest

import thermofast as tf
from thermofast.reading.values.unchanged import band_of


def kept(time, values, band):
    """Places at which a logger with a deadband writes."""
    places, last = [0], values[0]
    for i in range(1, len(time)):
        if abs(values[i] - last) >= band:
            places.append(i)
            last = values[i]
    return np.array(places)


def record(band: float, seed: int = 5) -> tuple[dict[str, np.ndarray], list[float]]:
    """Two exact sensors read every 5 s, written where they moved by a band; and their limits."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 36000.0, 5.0)
    columns, limits, places = {}, [], []
    for i in range(2):
        tau, rise = rng.uniform(40.0, 110.0) * 60.0, rng.uniform(10.0, 30.0)
        line = 20.0 + rise * -np.expm1(-time / tau) + 0.02 * rng.standard_normal(len(time))
        at = kept(time, line, band)
        columns[f"T{i}"] = np.full(len(time), np.nan)
        columns[f"T{i}"][at] = np.round(line[at], 2)
        limits.append(20.0 + rise)
        places.append(at)
    written = np.union1d(*places)
    return {"time_s": time[written]} | {n: c[written] for n, c in columns.items()}, limits


@pytest.mark.parametrize("band", [0.1, 0.5, 1.0])
def test_such_columns_are_known_and_stay_between(band):
    columns, limits = record(band)
    run = tf.read(columns)
    assert [g.text.startswith("logged only where they change by") for g in run.guesses] == [True]
    assert np.diff(run.time_s).max() < run.time_s[-1] / 150.0
    line = run.channels["T0"]
    assert np.isfinite(line).all()
    exact = np.interp(run.time_s, columns["time_s"], columns["T0"], right=columns["T0"][-1])
    assert np.nanmax(np.abs(line - exact)) < 2.0 * band
    for row, limit in zip(tf.identify(run, until=150), limits, strict=True):
        assert row.steady_state_lo_c <= limit <= row.steady_state_hi_c


def test_other_gaps_are_gaps():
    rng, time = np.random.default_rng(3), np.arange(0.0, 7200.0, 10.0)
    line = 20.0 + 9.0 * -np.expm1(-time / 2400.0) + 0.02 * rng.standard_normal(len(time))
    assert band_of(time, line) == 0.0
    for share in (0.1, 0.5, 0.9):  # cells that are missing here and there
        assert band_of(time, np.where(rng.random(len(time)) < share, np.nan, line)) == 0.0
    slow = np.where(np.arange(len(time)) % 12, np.nan, line)  # a slower logger in the same table
    assert band_of(time, slow) == 0.0
    pauses = np.where((np.arange(len(time)) // 20) % 2, np.nan, line)  # one that sleeps
    assert band_of(time, pauses) == 0.0
    assert band_of(time, np.round(line, 1)) == 0.0
