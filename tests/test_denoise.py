"""``compare --denoise``: what is left of a record without its sensors' noise."""

import json

import numpy as np
import pandas as pd
import pytest
from conftest import ROOT
from scipy.linalg import toeplitz

import thermofast as tf
from benchmarks.denoised import MINUTES, NOISE, cycle, nothing, record, second_mode
from thermofast.models.noise.denoise import _run
from thermofast.models.noise.residual_noise import NoiseModel


def test_the_smoother_is_the_conditional_mean_of_a_gaussian_vector():
    rng = np.random.default_rng(2)
    noise, decay, size, n = NoiseModel(np.array([0.5, -0.2]), np.array([0.3]), 0.4), 0.9, 0.7, 50
    series, weight = rng.standard_normal(n), rng.integers(1, 4, n).astype(float)
    series[20:24] = np.nan
    mean, variance, told = _run(series, weight, noise, decay, size)
    slow = toeplitz(size**2 * decay ** np.arange(n))
    root = 1.0 / np.sqrt(weight)
    seen = np.flatnonzero(np.isfinite(series))
    both = (slow + root[:, None] * toeplitz(noise.autocovariance(n)) * root)[np.ix_(seen, seen)]
    back = slow[:, seen] @ np.linalg.inv(both)
    assert mean == pytest.approx(back @ series[seen], abs=1e-7)
    assert variance == pytest.approx(np.diag(slow - back @ slow[seen]), abs=1e-7)
    likelihood = -0.5 * (np.linalg.slogdet(both)[1] + series[seen] @ np.linalg.solve(both, series[seen]))
    assert told == pytest.approx(likelihood, abs=1e-6)


@pytest.mark.parametrize("phi", [0.0, 0.5])
def test_the_band_holds_the_truth_and_the_noise_is_gone(phi):
    held, error = [], []
    for seed in range(8):
        truth, reading = record(phi, nothing, seed)
        middle, low, high = tf.compare({"time_min": MINUTES, "T": reading}, denoise=True).denoised[0].sensors["T"]
        held.append(np.mean((low <= truth) & (truth <= high)))
        error.append(np.sqrt(np.mean((middle - truth) ** 2)) / NOISE)
    assert np.mean(held) > 0.93
    assert np.median(error) < 0.2


def test_a_misfit_is_not_taken_for_noise_where_it_can_be_seen_and_is_in_the_band_where_not():
    left, held = 0, []
    for seed in range(6):
        found = tf.compare({"time_min": MINUTES, "T": record(0.0, cycle, seed)[1]}, denoise=True)
        if not found.denoised[0].sensors:
            left += 1
            assert found[0].message.startswith("not denoised: what the model leaves is not the sensor's noise alone")
        truth, reading = record(0.0, second_mode, seed)
        for _, low, high in tf.compare({"time_min": MINUTES, "T": reading}, denoise=True).denoised[0].sensors.values():
            held.append(np.mean((low <= truth) & (truth <= high)))
    assert left >= 5
    assert np.mean(held) > 0.9


def test_the_file_reads_as_a_record_and_what_is_refused_is_told(tool, tmp_path):
    truth, reading = record(0.5, nothing, 1)
    _, bent = record(0.0, cycle, 1)
    run = tmp_path / "run.csv"
    pd.DataFrame({"time_min": MINUTES, "good": reading, "bent": bent}).to_csv(run, index=False)
    done = tool("compare", run, "--denoise", tmp_path / "clean.csv", "--format", "json")
    assert done.code == 0, done.err
    assert "clean.csv: 1 of 2 sensors denoised" in done.err
    clean = pd.read_csv(tmp_path / "clean.csv")
    assert list(clean) == ["time_min", "good", "good_lo", "good_hi"]
    assert np.sqrt(np.mean((np.interp(MINUTES, clean.time_min, clean.good) - truth) ** 2)) < 0.3 * NOISE
    assert "not denoised" in next(r for r in json.loads(done.out)["records"] if r["channel"] == "bent")["message"]
    assert tool("identify", tmp_path / "clean.csv", "--channels", "good", "-q").code == 0
    two = [ROOT / "sample_runs" / name for name in ("hidden.csv", "hidden_second_run.csv")]
    for arguments, words in (
        ([*two, "--denoise", tmp_path / "x.csv"], "writes one run"),
        ([run, "--until", 60, "--denoise", tmp_path / "x.csv"], "leave --until out"),
        ([run, "--denoise", tmp_path / "x.txt"], ".parquet"),
    ):
        done = tool("compare", *arguments)
        assert done.code == 2
        assert words in done.err
        assert not (tmp_path / "x.csv").exists()
    done = tool("compare", run, "--channels", "bent", "--denoise", tmp_path / "x.csv")
    assert done.code == 1
    assert "no sensor is denoised; the messages say why" in done.err
    assert not (tmp_path / "x.csv").exists()
