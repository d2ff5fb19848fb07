"""What goes wrong between machine and file: a sensor logged twice, a probe that comes off, a workbook's notes beside its record."""

from types import SimpleNamespace

import numpy as np
import pytest
import xlsxwriter
from conftest import ROOT

import thermofast as tf
from thermofast.discovery.wording import _coarse, _unlogged, _when
from thermofast.models.effects import BUILT_IN
from thermofast.models.effects.base import Choice
from thermofast.models.joint import Key, Part
from thermofast.models.noise.chain import came_off, originals
from thermofast.observing.observe import observe

KINDS = {kind.id: kind for kind in BUILT_IN}

TIME = np.arange(360.0)


def warming(rate, rise, seed=0, noise=0.02):
    return 20.0 + rise * -np.expm1(-rate * TIME) + noise * np.random.default_rng(seed).standard_normal(len(TIME))


@pytest.fixture
def fallen():
    """Three sensors, of which the second comes off at 200 min into air of 20 degC."""
    columns = {"time_min": TIME, "T1": warming(0.02, 25.0, 1), "T2": warming(0.012, 15.0, 2), "T3": warming(0.015, 9.0, 3)}
    after = TIME >= 200.0
    columns["T2"][after] = 20.0 + (columns["T2"][199] - 20.0) * np.exp(-(TIME[after] - 200.0) / 2.0)
    columns["T2"][after] += 0.02 * np.random.default_rng(4).standard_normal(after.sum())
    return columns


def test_a_second_column_of_the_same_readings_is_said_to_be_one_and_counts_once():
    columns = {"time_min": TIME, "front": warming(0.02, 25.0, 1), "rear": warming(0.012, 15.0, 2)}
    run = tf.read({**columns, "rear again": columns["rear"]})
    assert run.channel_notes == {"rear again": "every reading is that of rear: one sensor logged twice?"}
    alone = tf.identify(tf.read(columns), until=60.0, jobs=1)
    twice = tf.identify(run, until=60.0, jobs=1)
    for one, other in zip(alone, list(twice)[:2], strict=True):
        assert other.steady_state_lo_c == one.steady_state_lo_c
        assert other.steady_state_hi_c == one.steady_state_hi_c
    assert twice[2].steady_state_hi_c == twice[1].steady_state_hi_c
    assert "rear" not in twice[1].rate_shared_with
    assert "one sensor logged twice" in twice[2].message
    seen = observe(run)
    assert seen.seen.channels == ("front", "rear")
    assert seen.refused == (("rear again", "no_data", "every reading is that of rear, and so no evidence of its own"),)


def test_the_copy_is_named_as_it_was_renamed():
    columns = {"time_min": TIME, "A": warming(0.02, 25.0, 1), "B": warming(0.02, 25.0, 1)}
    assert tf.read(columns, rename=["A=front", "B=rear"]).channel_notes == {
        "rear": "every reading is that of front: one sensor logged twice?"
    }


def test_what_is_a_copy():
    first = warming(0.02, 25.0, 1)
    gaps = np.where(TIME % 50 == 3, np.nan, first)
    whole = np.round(warming(0.02, 8.0, 1, noise=0.0))  # changes eight times: two sensors may do so by chance
    columns = [first, gaps, first + 0.001, first.copy(), whole, gaps.copy(), whole.copy(), np.full(360, 20.0), np.full(360, 20.0)]
    assert originals(columns).tolist() == [0, 1, 2, 0, 4, 1, 6, 7, 8]
    assert originals([]).tolist() == []


def test_a_probe_that_comes_off_is_told_and_its_readings_from_there_on_are_left_out(fallen):
    found = observe(tf.read(fallen))
    [note] = [n for n in found.notes if n.channel == "T2"]
    assert note.text.startswith("it falls 14 K in 5 min at 19")
    assert "did the probe come off?" in note.text
    later = {n: np.append(v[:30], v + 30.0 if n == "time_min" else v) for n, v in fallen.items()}
    [note] = [n for n in observe(tf.read(later), 30.0).notes if n.channel == "T2"]
    assert note.text.startswith("it falls 14 K in 5 min at 22")  # on the clock of the run
    used = found.seen.used[1]
    assert used[TIME < 198.0].all()
    assert not used[TIME >= 200.0].any()
    assert found.seen.used[[0, 2]].all()
    records = tf.diagnose(fallen, jobs=1).records
    assert {r.verdict for r in records} == {"none"}
    assert "did the probe come off?" in records[1].message
    assert "did the probe come off?" not in records[0].message


def off(columns, noise=0.02):
    reading = np.array([v for n, v in columns.items() if n != "time_min"])
    return came_off(TIME, reading, np.isfinite(reading), np.full(len(reading), noise))


def test_what_happens_to_the_machine_is_no_probe_that_came_off(fallen):
    assert set(off(fallen)) == {1}
    assert off({"T2": fallen["T2"]}) == {}  # nobody tells whether the machine went on
    cooled = {n: v.copy() for n, v in fallen.items()}
    after = TIME >= 200.0
    for name in ("T1", "T3"):  # a coolant reaches the others too
        cooled[name][after] -= 0.3 * (cooled[name][199] - 20.0) * -np.expm1(-(TIME[after] - 200.0) / 3.0)
    assert off(cooled) == {}
    stopped = {n: v.copy() for n, v in fallen.items()}  # as slow as it warmed
    stopped["T2"] = np.where(after, 20.0 + 14.0 * np.exp(-0.05 * (TIME - 200.0)), warming(0.012, 15.0, 2))
    assert off(stopped) == {}
    less = {n: v.copy() for n, v in fallen.items()}  # down by a half, as a reading that jumps
    less["T2"] = np.where(after, 26.0, warming(0.012, 15.0, 2))
    assert off(less) == {}


def test_a_logged_switch_at_that_time_may_have_cooled_it(fallen):
    run = tf.read({**fallen, "coolant": np.where(TIME >= 200.0, 1.0, 0.0)})
    assert run.inputs
    assert not [n for n in observe(run).notes if n.channel == "T2"]
    early = tf.read({**fallen, "coolant": np.where(TIME >= 100.0, 1.0, 0.0)})
    assert [n for n in observe(early).notes if n.channel == "T2"]


def test_a_row_that_rose_and_came_back_is_not_told_to_measure_longer(fallen):
    row = tf.identify(fallen, until=300.0, jobs=1)[1]
    assert row.status == "not_determined"
    assert "it falls 14 K in 3 min at 200 min, to where it began, while the others go on: did the probe come off?" in row.message
    assert "--until 200" in row.message
    assert "measure longer" not in row.message
    alone = tf.identify({n: fallen[n] for n in ("time_min", "T2")}, until=300.0, jobs=1)[
        0
    ]  # nobody tells whether the machine went on
    assert alone.status == "not_determined"
    assert "the readings went 13.6 K and came back" in alone.message
    assert "measure longer" not in alone.message


def test_a_sheet_of_notes_beside_the_record_is_no_second_table(tmp_path):
    path = tmp_path / "run.xlsx"
    with xlsxwriter.Workbook(path) as book:
        notes, sheet = book.add_worksheet("Info"), book.add_worksheet("Data")
        for k, row in enumerate(
            (("begun", "08:00"), ("interval", "60"), ("1", "21,5"), ("2", "21,6"), ("3", "21,9"), ("4", "22,4"))
        ):
            notes.write_row(k, 0, row)
        sheet.write_row(0, 0, ["time_min", "T1"])
        for k, (minute, value) in enumerate(zip(TIME, warming(0.02, 25.0, 1), strict=True)):
            sheet.write_row(k + 1, 0, [minute, value])
    assert list(tf.read(path).channels) == ["T1"]


def test_advice_names_what_is_not_logged_the_moment_and_a_coarse_logger():
    columns = {"time_min": TIME, "T1": warming(0.02, 25.0, 1), "T2": warming(0.01, 15.0, 2)}
    seen = observe(tf.read(columns)).seen
    assert _unlogged(seen) == " (speed, power, coolant, room)"
    logged = {"spindle_rpm": 1000.0 + (TIME > 50.0), "room": 20.0 + 0.01 * TIME}
    assert _unlogged(observe(tf.read({**columns, **logged}, ambient="room")).seen) == " (power, coolant)"
    assert _when((130.0, 150.0, 0.4), seen) == "changed at 130 min"
    assert _when((2.0, 150.0, 0.4), seen) == _when(None, seen) == "may change"
    # Where the nearest model has a change of the run, that is when; a probe that jumped is not.
    jump, load = (Part(KINDS[name](), Choice("")) for name in ("reading_jump", "load_step"))
    near = SimpleNamespace(parts=(jump, load), fit=SimpleNamespace(values={Key(0, "event"): 9.0, Key(1, load.effect.event): 110.3}))
    assert _when((130.0, 150.0, 0.4), seen, [near]) == "changed at about 110 min"
    assert _when((130.0, 150.0, 0.4), seen, [SimpleNamespace(parts=(jump,), fit=near.fit)]) == "changed at 130 min"
    assert _when((2.0, 150.0, 0.4), seen, [near]) == "may change"
    assert _coarse(seen) == []
    whole = observe(tf.read({n: np.round(v) for n, v in columns.items()})).seen
    assert _coarse(whole) == ["readings in steps of 1 K hide what is smaller: log more digits"]


@pytest.mark.skipif(not (ROOT / "../shared/cases").exists(), reason="the simulated machines of ../shared are not there")
def test_no_simulated_machine_of_others_is_taken_for_one_whose_probe_came_off():
    looked = 0
    for path in sorted((ROOT / "../shared/cases").glob("*/*.csv"))[::5]:
        found = observe(tf.read(path))
        assert not [n.text for n in found.notes if "come off" in n.text], path
        assert not [why for _, _, why in found.refused if "every reading" in why], path
        looked += 1
    assert looked > 50


def loose(minutes=8.0, level=20.0, other=0.0, before=0.0):
    """Two sensors of 50 and 80 min without noise: the first falls from 199 min on, in so many minutes, to a level."""
    reading = 20.0 + np.array([-25.0 * np.expm1(-TIME / 50.0), -15.0 * np.expm1(-TIME / 80.0)])
    top, after = reading[0, 199], TIME > 199
    reading[0, after] = np.maximum(top - (top - level) * (TIME[after] - 199.0) / minutes, level)
    reading[0, 180:200] += np.linspace(0.0, before, 20)
    reading[1, after] += other
    return came_off(TIME, reading, np.ones(reading.shape, dtype=bool), np.full(2, 0.02))


def test_a_fall_is_told_with_its_time_its_size_and_where_it_ends():
    """It lasts from its last reading at the top to the first at rest, within a tenth of the fall of the level."""
    fell = loose()[0]
    assert fell.first in (198, 199)
    assert fell.minutes == pytest.approx(8.0)
    assert fell.fall == pytest.approx(25.0 * -np.expm1(-199.0 / 50.0))
    assert fell.level == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("what", "found"),
    [
        ({"minutes": 10.0}, True),  # a fifth of 50 min
        ({"minutes": 16.0}, False),
        ({"level": 20.0 + 0.2 * 24.53}, True),  # a quarter of the way from where it began at most
        ({"level": 20.0 + 0.3 * 24.53}, False),
        ({"level": 20.0 - 0.2 * 24.53}, True),
        ({"level": 20.0 - 0.3 * 24.53}, False),
        ({"other": -1.0}, True),  # the other has gone 13.8 K; a tenth of it and six deviations
        ({"other": -2.5}, False),
        ({"other": 2.5}, False),
    ],
)
def test_what_is_a_probe_that_came_off(what, found):
    """The shares of the module's constants, to either side of each."""
    assert (0 in loose(**what)) is found


def test_one_sensor_alone_never_came_off():
    """Nothing says then that the machine was not switched off."""
    reading = 20.0 + np.where(TIME < 200.0, 25.0 * -np.expm1(-TIME / 50.0), 0.0)
    assert came_off(TIME, reading[None], np.ones((1, 360), dtype=bool), np.array([0.02])) == {}


@pytest.mark.parametrize(("changes", "original"), [(23, 1), (24, 0)])
def test_a_column_must_change_24_times_to_be_a_copy(changes, original):
    """Two coarse sensors that change less often may be alike by chance."""
    column = np.concatenate([np.full(40, 20.0), 20.0 + np.minimum(np.arange(1.0, 61.0), changes)])
    assert originals([column, column.copy()])[1] == original
