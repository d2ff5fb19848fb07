"""Methods to tell a displacement beside least squares and the network: arx, a table per minute, a net, over runs left out."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

import thermofast as tf
from benchmarks.documents.displacement_methods import machine, warm_ups
from thermofast.displacements import METHODS, TOGETHER, arx
from thermofast.models.displacement import Sample
from thermofast.models.displacement.scoring import compare
from thermofast.output.files import write_columns


def test_the_equation_is_found_and_run_freely():
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([0.0, 1.0, 2.0], 60), 10)[:, None] + 0.01 * rng.standard_normal((600, 1))
    # y_k = 0.9 y_k-1 + 0.3 u_k, from where it would stand still at the first input
    still = 0.3 * u[0, 0] / (1.0 - 0.9)
    y = lfilter([0.3], [1.0, -0.9], u[:, 0], zi=[0.9 * still])[0]
    sample = Sample.of(20.0 + u, y)
    everything = np.ones(600, bool)
    told = arx((1, 1))(sample, everything)
    assert told.mean == pytest.approx(y, abs=0.02)
    assert told.note == "order 1, 1"
    # Readings left out do not enter: the last third may be anything.
    first = everything.copy()
    first[400:] = False
    spoilt = Sample(sample.temperatures, np.where(first, y, 1e6), sample.minutes, sample.run)
    assert arx((1, 1))(spoilt, first).mean == pytest.approx(arx((1, 1))(sample, first).mean)
    assert np.abs(arx((1, 1))(sample, first).mean - y)[400:].max() < 0.05


@pytest.mark.proof
def test_each_method_is_trusted_on_what_it_is_for():
    methods = {n: METHODS[n] for n in ("least squares", "arx")}
    lagging = compare(warm_ups(1, 40.0, runs=6), methods)
    assert lagging.choice == "arx"
    assert lagging.scores["arx"].rmse < 0.4 * lagging.scores["least squares"].rmse
    assert lagging.scores["arx"].coverage > 0.85
    bent = compare(machine(0, "bends with the temperature"), {n: METHODS[n] for n in ("least squares", "neural network")})
    assert bent.choice == "neural network"
    assert bent.scores["neural network"].rmse < 0.5 * bent.scores["least squares"].rmse
    walk = compare(
        machine(0, "a walk, nothing to do with them"), {n: METHODS[n] for n in ("least squares", "arx", "neural network")}
    )
    assert walk.choice == "neither"


def runs_in(folder, several, ends=None):
    paths = []
    for r in range(several.runs):
        rows = several.run == r
        rows &= several.minutes <= (ends[r] if ends else np.inf)
        columns = {"time_min": several.minutes[rows]}
        columns |= {f"T{i + 1}": several.temperatures[rows, i] for i in range(3)} | {"Z_um": several.displacement[rows]}
        paths.append(folder / f"run {r}.csv")
        write_columns(str(paths[-1]), columns)
    return paths


def test_several_runs_are_learned_from_together_and_left_out_in_turn(tool, tmp_path):
    paths = runs_in(tmp_path, warm_ups(3, 8.0, runs=8), [150.0, 150.0, 150.0, 100.0, 100.0, 100.0, 100.0, 100.0])
    picture = tmp_path / "together.png"
    done = tool("displacement", *paths, "--together", "--format", "json", "-q", "--save-plot", picture)
    assert done.code == 0, done.err
    assert picture.stat().st_size > 20_000
    found = {r["method"]: r for r in json.loads(done.out)["records"]}
    assert set(found) == set(TOGETHER)
    assert all((r["run"], r["runs"], r["left_out"]) == ("8 runs", 8, "runs") for r in found.values())
    assert found["arx"]["trusted"]
    # The table of each minute is behind what all minutes tell, as on the paper's own machine (tests/published).
    assert found["network by minute"]["rmse_ahead_um"] > 2.0 * found["arx"]["rmse_ahead_um"]
    assert "tables that end at 1" in found["arx"]["message"]
    alone = json.loads(tool("displacement", paths[0], "--format", "json", "-q").out)["records"]
    assert {r["status"] for r in alone} == {"too_short"}  # 30 readings


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--methods", "kriging"], "least_squares, network, arx, network_by_minute, neural_network"),
        (["--order", "2"], "two whole numbers"),
        (["--order", "0,2"], "two whole numbers"),
        (["--order", "2,2", "--methods", "network"], "--order is that of arx"),
    ],
)
def test_wrong_options_are_told(tool, arguments, words):
    done = tool("displacement", "sample_runs/displacement.csv", *arguments)
    assert done.code == 2
    assert words in done.err


def test_what_the_readings_do_not_bear_is_a_status_with_words(tmp_path):
    two = [tf.read(p) for p in runs_in(tmp_path, warm_ups(3, 8.0, runs=2))]
    lone = tf.displacement(two[0], methods="network_by_minute", together=True)
    assert lone[0].status == "too_short"
    few = tf.displacement([*two], together=True)
    assert {r.status for r in few} == {"too_short"}
    sample = machine(1, "linear")
    everything = np.ones(len(sample.run), bool)
    with pytest.raises(ValueError, match=r"order 20, 20 has 141 parameters: 705 readings in a row are needed, 380 are there"):
        arx((20, 20))(sample, everything)
    with pytest.raises(ValueError, match="4 runs to learn from, 1 are there"):
        METHODS["network by minute"](sample, everything)
    uneven = Sample(sample.temperatures, sample.displacement, np.sort(np.random.default_rng(0).uniform(0, 1200, 400)), sample.run)
    with pytest.raises(ValueError, match="even times"):
        arx((1, 1))(uneven, everything)
    with pytest.raises(ValueError, match="60 readings, 50 are there"):
        METHODS["neural network"](sample, np.arange(400) < 50)


def test_a_net_without_scikit_learn_says_what_to_install(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "sklearn.neural_network", None)
    found = tf.displacement("sample_runs/displacement.csv", "Z_um", methods="neural_network,least_squares")
    assert {r.method: r.status for r in found} == {"least squares": "ok", "neural network": "not_determined"}
    assert "pip install 'thermofast[neural]'" in next(r for r in found if r.method == "neural network").message


def test_gaps_inputs_and_dead_runs_are_borne():
    rng = np.random.default_rng(3)
    time = np.arange(1200.0)
    load = np.repeat(rng.choice([0.0, 0.5, 1.0], 40), 30)
    heat = lagged_by(load, 30.0)
    columns = {"time_min": time, "T1": 20.0 + 8.0 * heat + 0.02 * rng.standard_normal(1200)}
    columns |= {"Z_um": 20.0 * lagged_by(heat, 60.0) + 0.1 * rng.standard_normal(1200)}
    columns |= {"speed_rpm": np.where(time % 10 == 0, 3000.0 * load, np.nan), "pump_rpm": np.where(time % 7 == 0, 1400.0, np.nan)}
    whole = {r.method: r for r in tf.displacement(columns, inputs="speed_rpm,pump_rpm")}
    assert whole["least squares"].samples == 1200  # inputs that are logged now and then cost no rows
    assert whole["arx"].sensors == ["T1", "speed_rpm"]
    assert whole["arx"].trusted
    # A night without readings is time that passed, not one step.
    kept = (time < 500.0) | (time > 700.0)
    gap = {r.method: r for r in tf.displacement({n: c[kept] for n, c in columns.items()}, inputs="speed_rpm,pump_rpm")}
    assert gap["arx"].rmse_ahead_um < 0.5
    dead = {n: np.full(1200, np.nan) if n == "T1" else c for n, c in columns.items()}
    runs = [
        tf.read({k: v for k, v in c.items() if "rpm" not in k}, name=n)
        for n, c in (("a", columns), ("b", columns), ("c", columns), ("d", dead))
    ]
    found = tf.displacement(runs, together=True, methods="least_squares")
    assert {r.runs for r in found} == {3}
    assert "no row of d is whole" in found[0].message


def lagged_by(drive, tau):
    return lfilter([1.0 - np.exp(-1.0 / tau)], [1.0, -np.exp(-1.0 / tau)], drive)


def test_a_sensor_that_stands_still_and_moves_later_says_nothing():
    sample = machine(1, "linear")
    still = np.full(len(sample.run), 21.3)
    still[350:] += 0.1
    beside = Sample(np.column_stack([sample.temperatures, still]), sample.displacement, sample.minutes, sample.run)
    used = np.arange(len(still)) < 350
    for name in ("arx", "neural network"):
        error = (METHODS[name](beside, used).mean - sample.displacement)[~used]
        assert np.abs(error).max() < 5.0


def test_displacements_that_begin_at_nought_go_with_changes_from_the_start(tool, tmp_path):
    """Runs begun in rooms of 18 to 24 degC, the probe set to nought at each start: absolute temperatures say nothing of it."""
    paths, rng, time = [], np.random.default_rng(8), np.arange(0.0, 300.0, 1.0)
    for r, room in enumerate((18.0, 20.0, 22.0, 24.0)):
        load = rng.uniform(0.6, 1.4)
        rises = [load * size * -np.expm1(-time / tau) for size, tau in ((14.0, 30.0), (6.0, 110.0))]
        front, column = (room + rise + 0.02 * rng.standard_normal(len(time)) for rise in rises)
        z = 4.0 * rises[0] - 2.5 * rises[1] + 0.3 * rng.standard_normal(len(time))
        paths.append(tmp_path / f"run {r}.csv")
        write_columns(str(paths[-1]), {"time_min": time, "front": front, "column": column, "Z [um]": z - z[0]})
    call = ["displacement", *paths, "--together", "--methods", "least_squares", "--displacements", "Z", "--format", "json", "-q"]
    done = tool(*call)
    assert done.code == 0, done.err
    (found,) = json.loads(done.out)["records"]
    assert found["trusted"]
    assert found["rmse_ahead_um"] < 0.6
    assert found["coverage"] > 0.88
    assert "temperatures count from each run's start" in found["message"]
    refused = tool("displacement", paths[0], "--displacements", "Y")
    assert "Z [um]" in refused.err


def test_a_name_of_two_columns_is_told_as_that(tool, tmp_path):
    path = tmp_path / "twice.csv"
    path.write_text("time_min,T1 [°C],T1 [°C],T2 [°C]\n" + "".join(f"{k},{20 + k},{21 + k},{22 + k}\n" for k in range(20)))
    refused = tool("identify", path, "--channels", "T1")
    assert refused.code == 2
    assert "'T1' is the name of several columns" in refused.err
    assert "say one in full" in refused.err
