"""``compare --denoise``: what is left of a record without its sensors' noise."""

import json

import numpy as np
import pandas as pd
import pytest
from conftest import ROOT
from scipy.signal import lfilter

import thermofast as tf
from benchmarks.analysis.denoised import MINUTES, NOISE, cycle, figures, nothing, record, second_mode
from thermofast.models.noise import denoise


def dense(time, residual, weight, tangent, rate, size, memory):
    """Mean, deviation, noise and log likelihood, restricted, of one point of the grid, by matrices of all readings at once."""
    lag = np.abs(time[:, None] - time)
    x = rate * lag
    slow = size**2 * (1.0 + x) * np.exp(-x)
    noise = memory ** (lag / np.median(np.diff(time))) / np.sqrt(weight[:, None] * weight)
    seen = np.isfinite(residual)
    both = (slow + noise)[np.ix_(seen, seen)]
    h, r = tangent[seen], residual[seen]
    inverse = np.linalg.inv(both)
    precision = h.T @ inverse @ h
    beta = np.linalg.solve(precision, h.T @ inverse @ r)
    left = r - h @ beta
    variance = left @ inverse @ left / (len(r) - h.shape[1])
    back = slow[:, seen] @ inverse
    beside = tangent - back @ h
    spread = np.diag(slow - back @ slow[seen]) + np.einsum("ni,ij,nj->n", beside, np.linalg.inv(precision), beside)
    free = len(r) - h.shape[1]
    restricted = -0.5 * (free * np.log(variance) + np.linalg.slogdet(both)[1] + np.linalg.slogdet(precision)[1])
    return tangent @ beta + back @ left, np.sqrt(variance * spread), np.sqrt(variance), restricted


def test_the_smoother_is_the_conditional_mean_of_a_gaussian_vector(monkeypatch):
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.choice([1.0, 2.0], 60, p=[0.9, 0.1]))
    series, weight, rate = rng.standard_normal(60), rng.integers(1, 4, 60).astype(float), 1.0 / 40.0
    series[20:24] = np.nan
    tangent = np.column_stack([np.ones(60), np.exp(-rate * time), 2.0 * np.ones(60)])
    longest = denoise.MEMORY ** (10.0 * rate)
    fits = []
    points = ((0.7, 0.5, 0.0), (2.5, 2.0, 0.65), (8.0, 15.0, 1.0))
    for speed, size, share in points:
        for name, values in (("SPEEDS", (speed,)), ("SIZES", (size,)), ("SHARES", (share,))):
            monkeypatch.setattr(denoise, name, values)
        found = denoise.smoothed(time, series, weight, tangent, rate)
        mean, deviation, noise, restricted = dense(time, series, weight, tangent[:, :2], speed * rate, size, share * longest)
        fits.append((mean, deviation, restricted))
        assert found.mean == pytest.approx(mean, abs=1e-6)
        assert found.deviation == pytest.approx(deviation, abs=1e-6)
        assert found.noise == pytest.approx(noise, abs=1e-8)
        assert found.innovation @ found.innovation == pytest.approx(np.isfinite(series).sum() - 2)
        assert found.taken.T @ found.innovation == pytest.approx(np.zeros(2), abs=1e-9)
    # Together they are weighed by their likelihoods.
    monkeypatch.setattr(denoise, "SPEEDS", (0.7, 2.5))
    monkeypatch.setattr(denoise, "SIZES", (0.5,))
    monkeypatch.setattr(denoise, "SHARES", (0.0,))
    other = dense(time, series, weight, tangent[:, :2], 2.5 * rate, 0.5, 0.0)
    share = 1.0 / (1.0 + np.exp(other[3] - fits[0][2]))
    both = denoise.smoothed(time, series, weight, tangent, rate)
    assert both.mean == pytest.approx(share * fits[0][0] + (1.0 - share) * other[0], abs=1e-6)


def test_the_grid_is_weighed_by_the_likelihood_of_the_noise_drawn():
    rng = np.random.default_rng(3)
    time, rate = np.arange(500.0), 1.0 / 80.0
    tangent = np.column_stack([np.ones(500), np.exp(-rate * time)])
    for memory, longest in ((0.0, False), (0.95, True)):
        noise = lfilter([1.0], [1.0, -memory], rng.standard_normal(600))[100:] * np.sqrt(1.0 - memory**2)
        found = denoise.smoothed(time, noise, np.ones(500), tangent, rate)
        assert (found.longest > 3.0) == longest
        if not longest:
            assert found.noise == pytest.approx(1.0, abs=0.1)
            assert np.sqrt(np.mean(found.mean**2)) < 0.25


@pytest.mark.parametrize("phi", [0.0, pytest.param(0.5, marks=pytest.mark.proof)])
def test_the_band_holds_the_truth_and_the_noise_is_gone(phi):
    held, error = [], []
    for seed in range(8):
        truth, reading = record(phi, nothing, seed)
        middle, low, high = tf.compare({"time_min": MINUTES, "T": reading}, denoise=True).denoised[0].sensors["T"]
        held.append(np.mean((low <= truth) & (truth <= high)))
        error.append(np.sqrt(np.mean((middle - truth) ** 2)) / NOISE)
    assert np.mean(held) > 0.93
    assert np.median(error) < 0.2


@pytest.mark.proof
def test_the_band_holds_what_deviates_from_the_model_slowly():
    held = []
    for seed in range(4):
        for beside in (cycle, second_mode):
            truth, reading = record(0.0, beside, seed)
            for _, low, high in tf.compare({"time_min": MINUTES, "T": reading}, denoise=True).denoised[0].sensors.values():
                held.append(np.mean((low <= truth) & (truth <= high)))
    assert len(held) == 8
    assert np.mean(held) > 0.9


@pytest.mark.proof
def test_the_band_holds_on_machines_that_are_not_the_law():
    for name in ("bar:", "plate:"):
        line = figures(name, range(840_000, 840_003)).split("|")
        assert int(line[2].split()[0]) >= 3, line
        assert float(line[4].split()[0]) > 90.0, line


@pytest.mark.parametrize(("step", "tau", "n"), [(10.0, 30.0, 60), (20.0, 60.0, 40), (15.0, 30.0, 40)])
def test_a_few_readings_in_a_time_constant_are_enough(step, tau, n):
    time = step * np.arange(n)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        reading = 30.0 - 10.0 * np.exp(-time / tau) + 0.05 * rng.standard_normal(n)
        assert "T" in tf.compare({"time_min": time, "T": reading}, denoise=True).denoised[0].sensors


@pytest.mark.proof
def test_a_record_that_hardly_bends_may_still_deviate():
    time, held = np.arange(300.0), []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        truth = 20.0 + 0.05 * time + 0.1 * np.sin(2.0 * np.pi * time / 100.0)
        reading = np.where((time > 100.0) & (time < 112.0), np.nan, truth + 0.05 * rng.standard_normal(300))
        _, low, high = tf.compare({"time_min": time, "T": reading}, denoise=True).denoised[0].sensors["T"]
        held.append(np.mean((low <= truth) & (truth <= high)))
    assert np.mean(held) > 0.9


def test_a_second_of_readings_is_averaged_and_its_band_is_that_of_the_mean():
    time = np.arange(7200.0) / 60.0
    truth, held = 30.0 - 10.0 * np.exp(-time / 30.0), []
    for seed in range(4):
        reading = truth + 0.05 * np.random.default_rng(seed).standard_normal(len(time))
        clean = tf.compare({"time_min": time, "T": reading}, denoise=True).denoised[0]
        middle, low, high = clean.sensors["T"]
        true = np.interp(clean.time, time, truth)
        held.append(np.mean((low <= true) & (true <= high)))
        assert len(middle) < 2000
        assert np.median(high - low) < 0.03
    assert np.mean(held) > 0.85


def test_noise_that_remembers_as_the_machine_does_is_left():
    rng = np.random.default_rng(1)
    walk = lfilter([1.0], [1.0, -0.9], rng.standard_normal(500))[100:] * 0.05 * np.sqrt(1.0 - 0.81)
    found = tf.compare({"time_min": MINUTES, "T": record(0.0, nothing, 4)[0] + walk}, denoise=True)
    assert found[0].message.startswith("not denoised: what the model leaves remembers too long")


def test_a_band_never_takes_the_name_of_a_sensor(tool, tmp_path):
    reading = record(0.0, nothing, 1)[1]
    pd.DataFrame({"time_min": MINUTES, "T": reading, "T_lo": record(0.0, nothing, 2)[1]}).to_csv(tmp_path / "run.csv", index=False)
    done = tool("compare", tmp_path / "run.csv", "--denoise", tmp_path / "clean.csv", "-q")
    assert done.code == 2
    assert "the band of 'T' would be called as the sensor 'T_lo'" in done.err
    assert not (tmp_path / "clean.csv").exists()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda y: np.where(MINUTES < 250.0, y, y + 0.6), "what the model leaves jumps"),
        (lambda y: np.round(y * 2.0) / 2.0, "the logger's step"),
        (lambda y: np.where(MINUTES > -1.0, 20.0 + 5.0 * -np.expm1(-MINUTES / 60.0), y), "the readings are the model"),
        (lambda y: y + 0.15 * np.sin(MINUTES), "noise beside a smooth deviation"),
    ],
)
def test_what_is_no_noise_of_a_sensor_is_left(change, why):
    found = tf.compare({"time_min": MINUTES, "T": change(record(0.0, nothing, 4)[1])}, denoise=True)
    assert not found.denoised or not found.denoised[0].sensors
    assert found[0].message.startswith(f"not denoised: {why}")


def test_the_file_reads_as_a_record_and_what_is_refused_is_told(tool, tmp_path):
    truth, reading = record(0.5, nothing, 1)
    bent = np.where(MINUTES < 250.0, reading, reading + 0.6)
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
