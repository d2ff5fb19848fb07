"""The temperature at switch-off from readings that begin later, and windings read by their resistance."""

import json

import numpy as np
import pytest

import thermofast as tf
from benchmarks.analysis.switch_off import cooling, trial
from thermofast.models.standards import temperature_at_switch_off


def record(path, first_s=45, noise=0.0):
    """A winding of two modes, read from so many seconds after the switch-off on: 95 degC then, and its core, 80 degC."""
    rng = np.random.default_rng(1)
    lines = ["time_s,R_winding [ohm],core [°C]"]
    for t in range(first_s, first_s + 900, 10):
        winding = 25.0 + 60.0 * np.exp(-t / 1500.0) + 10.0 * np.exp(-t / 240.0) + noise * rng.standard_normal()
        core = 25.0 + 55.0 * np.exp(-t / 1800.0) + noise * rng.standard_normal()
        lines.append(f"{t},{1.84 * (winding + 235.0) / 256.5:.6f},{core:.4f}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_a_winding_is_read_by_its_resistance_and_told_at_switch_off(tool, tmp_path):
    path = record(tmp_path / "run.csv", noise=0.02)
    done = tool("identify", path, "--resistance", "1.84,21.5", "--switch-off-at", "-0.75", "--format", "json", "-q")
    rows = {r["channel"]: r for r in json.loads(done.out)["records"]}
    for name, truth in (("R_winding [ohm]", 95.0), ("core [°C]", 80.0)):
        row = rows[name]
        assert row["switch_off_min"] == -0.75
        assert row["switch_off_lo_c"] <= truth <= row["switch_off_hi_c"]
        assert row["switch_off_c"] == pytest.approx(truth, abs=0.1)
    assert "two modes" in rows["R_winding [ohm]"]["message"]
    assert "one mode" in rows["core [°C]"]["message"]
    assert "45 s before the first reading" in rows["core [°C]"]["message"]


def test_resistance_of_copper_and_of_what_is_told(tmp_path):
    path = record(tmp_path / "run.csv")
    first = 25.0 + 60.0 * np.exp(-45 / 1500.0) + 10.0 * np.exp(-45 / 240.0)
    copper = tf.read(path, resistance="1.84,21.5").channels
    assert list(copper) == ["R_winding [ohm]", "core [°C]"]
    assert copper["R_winding [ohm]"][0] == pytest.approx(first, abs=1e-3)
    other = tf.read(path, resistance="1.84,21.5,225").channels["R_winding [ohm]"][0]
    assert other == pytest.approx((first + 235.0) / 256.5 * 246.5 - 225.0, abs=1e-3)
    assert list(tf.read(path).channels) == ["core [°C]"]
    plain = tmp_path / "plain.csv"
    plain.write_text("time_s,a\n" + "".join(f"{10 * i},{2.0 - 0.01 * i}\n" for i in range(30)))
    assert tf.read(plain, resistance="2.0,20", channels="a").channels["a"][0] == pytest.approx(20.0)
    with pytest.raises(tf.UsageError, match="resistance: no column is in ohms"):
        tf.read(plain, resistance="2.0,20")
    for wrong in ("1.84", "0,20", "a,b", "1,2,3,4", "1,-400"):
        with pytest.raises(tf.UsageError, match="resistance: not a resistance and its temperature"):
            tf.read(path, resistance=wrong)


def test_a_switch_off_inside_the_record_uses_what_comes_after_it():
    time = np.arange(0.0, 240.0, 0.25)
    heating, cooling_down = 60.0 - 40.0 * np.exp(-time / 30.0), None
    hot = 60.0 - 40.0 * np.exp(-120.0 / 30.0)
    cooling_down = 20.0 + (hot - 20.0) * np.exp(-(time - 120.0) / 40.0)
    reading = np.where(time <= 120.0, heating, cooling_down) + 0.03 * np.random.default_rng(2).standard_normal(len(time))
    kept = (time < 118.0) | (time > 121.5)  # the probe was changed
    told = tf.identify({"time_min": time[kept], "T1": reading[kept]}, switch_off_at=120.0, start=0.0)[0]
    assert told.switch_off_lo_c <= hot <= told.switch_off_hi_c
    assert told.switch_off_c == pytest.approx(hot, abs=0.3)


def test_too_few_readings_say_so():
    assert temperature_at_switch_off(np.arange(5.0), np.arange(5.0), -1.0) is None
    time = np.arange(0.0, 60.0)
    told = tf.identify({"time_min": time, "T1": 20.0 + 5.0 * np.exp(-time / 20.0)}, switch_off_at=55.0)[0]
    assert told.switch_off_c is None
    assert "too few readings after the switch-off" in told.message


@pytest.mark.proof
@pytest.mark.parametrize("modes", [1, 2])
def test_intervals_hold_about_as_often_as_they_say(modes):
    found = np.array([trial(modes, seed) for seed in range(83_000, 83_080)])
    assert 0.87 <= found[:, 1].mean() <= 1.0
    assert np.sqrt(np.mean(found[:, 0] ** 2) / np.mean(found[:, 2] ** 2)) < 2.2  # one in eighty takes noise for a mode
    assert np.median(np.abs(found[:, 0]) / found[:, 2]) < 0.8  # of a normal error at the limit: 0.67


@pytest.mark.parametrize("number", [24, 36, 75])
def test_two_rates_that_are_known_together_far_better_than_each(number):
    """A grid that does not lie along what is known of both steps over it."""
    rng = np.random.default_rng(21)
    for _ in range(number + 1):
        room, step, late = rng.uniform(18, 25), rng.choice([10, 30]) / 60, rng.choice([0.5, 0.75, 1.5, 2.0])
        noise, time = rng.choice([0.02, 0.1]), np.arange(int(60 / step)) * step
        hot, slow, fast, share = rng.uniform(20, 80), rng.uniform(20, 90), rng.uniform(2, 8), rng.uniform(0.05, 0.5)
        clean = room + hot * ((1 - share) * np.exp(-(late + time) / slow) + share * np.exp(-(late + time) / fast))
        reading = np.round(clean + noise * rng.standard_normal(len(time)), 2)
    found = temperature_at_switch_off(time, reading, -late)
    assert found.low < room + hot < found.high
    assert found.high - found.low < 10.0 * noise
    assert found.noise == pytest.approx(noise, rel=0.12)


def test_a_line_and_a_constant_are_no_trouble():
    time = np.arange(1.0, 30.0, 0.5)
    rng = np.random.default_rng(0)
    for reading in (50.0 - 0.5 * time, np.full(len(time), 50.0)):
        found = temperature_at_switch_off(time, reading + 0.05 * rng.standard_normal(len(time)), 0.0)
        assert found.low < 50.0 < found.high
        assert found.high - found.low < 1.0


def test_the_limit_of_the_benchmark_is_that_of_a_line_for_readings_at_once():
    time, reading, truth, limit = cooling(1, 5)
    assert len(time) == len(reading)
    assert 0.0 < limit < 1.0
    assert abs(reading[0] - truth) < 0.2 * abs(truth)


def test_readings_that_rise_have_no_switch_off_before_them():
    time = np.arange(0.0, 200.0)
    reading = 20.0 + 10.0 * -np.expm1(-time / 60.0) + 0.02 * np.random.default_rng(0).standard_normal(200)
    for number in (200, 12):
        (told,) = tf.identify({"time_min": time[:number], "T1": reading[:number]}, switch_off_at=-5.0)
        assert told.switch_off_c is None
        assert "the readings rise after the switch-off" in told.message


def test_a_part_that_others_warm_has_more_modes_than_two():
    """Five bodies in a row, the first heated until then, by the exponential of their matrix: the others stay warm and fall later."""
    held, time = [], np.arange(1.0, 61.0, 0.5)
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        capacity, links, loss = rng.uniform(8.0, 40.0, 5), rng.uniform(0.3, 0.9, 4), rng.uniform(0.1, 0.4, 5)
        matrix = np.diag(links, 1) + np.diag(links, -1)
        matrix -= np.diag(matrix.sum(axis=1) + loss)
        rise = np.linalg.solve(matrix, -np.array([12.0, 0.0, 0.0, 0.0, 0.0]))
        rates, vectors = np.linalg.eig(matrix / capacity[:, None])
        sizes = np.linalg.solve(vectors, rise)
        for part in range(1, 5):
            clean = 21.0 + (vectors[part] * sizes * np.exp(np.outer(time, rates))).sum(axis=1).real
            for _ in range(3):
                found = temperature_at_switch_off(time, clean + 0.03 * rng.standard_normal(len(time)), 0.0)
                held.append(found.low < 21.0 + rise[part] < found.high)
    assert sum(held) >= 31  # of 36; two modes alone held 21


def test_a_reading_at_the_very_moment_counts():
    """Nothing is left to be told then: the interval is that of the readings."""
    time = np.arange(0.0, 61.0, 1.0)
    reading = 21.0 + 20.0 * np.exp(-time / 30.0) + 0.05 * np.random.default_rng(4).standard_normal(len(time))
    run = tf.read({"time_min": time, "T1": reading})
    row = tf.identify(run, switch_off_at=0.0)[0]
    assert row.switch_off_lo_c < 41.0 < row.switch_off_hi_c
    assert row.switch_off_hi_c - row.switch_off_lo_c < 0.15
    assert "at switch-off, 0 s before the first reading" in row.message
