"""Records that nobody shaped for the program: read as they are, and an honest status for every sensor."""

import json
import re

import pytest

# file -> (sensors, surroundings, inputs, rows, length [min])
RECORDS = {
    "cooking_pot/0cm_1L_a.csv": (10, 1, 0, 318, 52.8),
    "cooking_pot/20cm_3L_b.csv": (10, 1, 0, 516, 85.8),
    "cooking_pot/boil_tests.csv": (15, 0, 0, 1619, 269.7),
    "heatshield/duty_sequence.csv": (1, 0, 1, 8640, 288.0),
    "laptop/cooling_Test_300.csv": (3, 0, 0, 114, 9.9),
    "laptop/normal_stand.csv": (3, 0, 0, 114, 9.9),
    "daisy_heating/lamp_steps.csv": (1, 0, 1, 801, 26.7),
    "tclab/energy_balance.csv": (2, 0, 2, 599, 10.0),
    "tclab/hybrid.csv": (2, 0, 2, 201, 10.0),
    "tclab/second_order.csv": (2, 0, 2, 201, 10.0),
    "tclab/step_kelvin.csv": (1, 0, 1, 571, 9.5),
    "ulg_pipe/150801.csv": (4, 0, 1, 274, 14.6),
    "leaf_battery/cell-discharge-temperature-3c.lvm": (4, 0, 0, 1316, 21.9),
}
HONEST = {"ok", "not_determined", "model_doubtful"}


@pytest.mark.parametrize("name", RECORDS)
def test_each_record_is_read_as_it_is(name, shared, tool):
    from thermofast.reading import Options, read_runs

    sensors, surroundings, inputs, rows, minutes = RECORDS[name]
    options = Options(interval_s=1.0) if name.endswith(".lvm") else Options()
    run = read_runs(str(shared / name), options)[0]
    assert (len(run.channels), len(run.ambient), len(run.inputs), len(run.time_s)) == (sensors, surroundings, inputs, rows)
    assert run.time_s[-1] / 60 == pytest.approx(minutes, abs=0.1)
    for until in (None, round(0.4 * minutes, 2)):
        extra = ["--interval", 1] if name.endswith(".lvm") else []
        extra += ["--until", until] if until else []
        done = tool("identify", shared / name, "--format", "jsonl", "-q", *extra)
        assert done.code == 0, done.err
        records = [json.loads(line) for line in done.out.splitlines()]
        assert len(records) == sensors
        for r in records:
            assert r["status"] in HONEST
            assert r["samples"] > 10
            if r["status"] == "ok":
                assert r["steady_state_lo_c"] <= r["steady_state_c"] <= r["steady_state_hi_c"]
                assert 0 < r["t95_lo_min"] <= r["t95_hi_min"]
            else:
                assert r["message"]
            for value in ("steady_state_c", "t95_min"):
                stem, unit = value.rsplit("_", 1)
                low, high = r[f"{stem}_lo_{unit}"], r[f"{stem}_hi_{unit}"]
                if r[value] is not None:
                    assert low is None or low <= r[value]
                    assert high is None or r[value] <= high
            assert r["initial_c"] is None or -30 < r["initial_c"] < 130
            for side in ("lo", "hi"):
                if r[f"steady_state_{side}_c"] is None or r[f"t95_{side}_min"] is None:
                    assert r["status"] == "not_determined"


def test_the_battery_record_asks_for_its_sampling(shared, tool):
    done = tool("identify", shared / "leaf_battery" / "cell-discharge-temperature-3c.lvm")
    assert done.code == 2
    assert "--interval SECONDS" in done.err


def test_the_laptops_graphics_chip_settles_where_it_was_measured(shared, tool):
    done = tool(
        "identify", shared / "laptop" / "cooling_Test_300.csv", "--channels", "GPU_Temp", "--until", 4, "--format", "jsonl", "-q"
    )
    r = json.loads(done.out)
    assert r["steady_state_measured_c"] == pytest.approx(54.0, abs=0.2)
    assert r["steady_state_c"] == pytest.approx(54.0, abs=0.5)
    assert r["noise_c"] >= 0.28  # the rounding to whole degrees is a floor


def test_the_pots_water_is_no_single_lump(shared, tool):
    done = tool("identify", shared / "cooking_pot" / "0cm_1L_a.csv", "--format", "jsonl", "-q")
    statuses = [json.loads(line)["status"] for line in done.out.splitlines()]
    assert statuses.count("ok") <= 3  # water that boils is not an exponential rise


@pytest.mark.proof
def test_the_loop_ranks_the_known_physics_first_and_admits_what_it_lacks(shared):
    from benchmarks.discovery.real_loop import judged

    pipe = judged("ulg_pipe/151204_1.csv", ("outlet_pipe", "inlet_pipe"), None, ("transport_delay", "second_mode"))
    assert pipe["first"] == "transport_delay"
    assert pipe["first_after"] < 0.25 * pipe["before"]
    assert pipe["known_after"] < pipe["first_after"]
    # What the water brings from one end of the pipe to the other is named beside it (docs/real-records.md).
    assert pipe["verdict"] == "transport_delay+neighbour_heat"
    lamp = judged("daisy_heating/lamp_steps.csv", (), None, ("load_step", "second_mode"))
    assert lamp["first"] == "load_step (lamp_voltage, to a power)"
    assert lamp["first_after"] < 0.3 * lamp["before"]


@pytest.mark.proof
def test_a_duty_sequence_is_one_run_when_its_duty_drives_it(shared):
    from benchmarks.discovery.real_loop import judged

    block = judged("heatshield/duty_sequence.csv", (), "heater_duty", ("nonlinear_loss", "second_mode"))
    assert block["before"] < 1.2
    assert block["known_after"] < 0.6 * block["before"]
    assert block["verdict"] == "second_mode"


# Two of the records of docs/real-records.md; python -m benchmarks.discovery.real_loop tries them all.
@pytest.mark.parametrize(
    ("name", "channels", "drive", "first", "falls_to"),
    [
        pytest.param("tclab/second_order.csv", ("T1", "T2"), "heater_1", "transport_delay", 0.75, marks=pytest.mark.proof),
        pytest.param("cooking_pot/20cm_3L_b.csv", ("T10", "T5"), None, "neighbour_heat", 0.35, marks=pytest.mark.proof),
    ],
)
def test_records_of_three_effects_are_unexplained_and_the_ranking_helps(shared, name, channels, drive, first, falls_to):
    from benchmarks.discovery.real_loop import judged

    told = judged(name, channels, drive, ())
    assert told["verdict"] == "unexplained"
    assert told["first"].startswith(first)
    assert told["first_after"] < falls_to * told["before"]


def test_the_laptops_changing_load_is_not_told_with_confidence(shared, tool):
    done = tool(
        "diagnose", shared / "laptop" / "cooling_Test_300.csv", "--channels", "GPU_Temp,CPU_Temp", "--format", "jsonl", "-q"
    )
    # Whole degrees and a load that moves by itself: no name is right.
    for line in done.out.splitlines():
        record = json.loads(line)
        assert record["verdict"] == "unexplained"
        assert record["status"] == "model_doubtful"


def test_the_page_shows_what_the_program_says(shared):
    from benchmarks.documents.real import DOCS, printed
    from benchmarks.estimation import real_records

    page, number = (DOCS / "real-records.md").read_text(), re.compile(r"-?\d+\.?\d*(?:e[+-]?\d+)?")
    table = printed(real_records.main).split("\n")
    shown = page.split("\n")[page.split("\n").index(table[0]) :][: len(table)]
    assert len(table) == 24
    for told, line in zip(table, shown, strict=True):
        assert number.sub("", told) == number.sub("", line)
        assert [float(v) for v in number.findall(told)] == pytest.approx([float(v) for v in number.findall(line)], rel=0.02)
