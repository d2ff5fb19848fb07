"""One rule, one number: what no longer test would notice."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import thermofast as tf
from thermofast.estimation import closing, measured
from thermofast.estimation.request import EVERYTHING
from thermofast.estimation.sweep import sweep_records, with_trips
from thermofast.models.standards import criterion_from
from thermofast.reading.moments.order import spread_evenly
from thermofast.reading.moments.stamps import parse_stamps
from thermofast.reading.units import parse_unit
from thermofast.reading.values.faults import without_faults, without_impossible
from thermofast.standards.stopping import _missing

MONTHS = {
    "es": "ene feb mar abr may jun jul ago sep oct nov dic",
    "it": "gen feb mar apr mag giu lug ago set ott nov dic",
    "nl": "jan feb mrt apr mei jun jul aug sep okt nov dec",
    "pt": "jan fev mar abr mai jun jul ago set out nov dez",
    "pl": "sty lut mar kwi maj cze lip sie wrz paź lis gru",
    "tr": "oca şub mar nis may haz tem ağu eyl eki kas ara",
    "de": "jan feb mär apr mai jun jul aug sep okt nov dez",
    "cs": "led úno bře dub kvě",
    "ru": "янв фев мар апр мая июн июл авг сен окт ноя дек",
}


def seconds(cells, name="", time_format=None):
    return parse_stamps(cells, "run", range(1, len(cells) + 1), name, time_format).seconds


@pytest.mark.parametrize("language", MONTHS)
def test_months_of_a_language_stand_where_the_calendar_has_them(language):
    """Each month of each language, not one or two of them."""
    names = MONTHS[language].split()
    first = np.array([f"2026-{k:02d}-15" for k in range(1, len(names) + 1)], dtype="datetime64[s]")
    np.testing.assert_array_equal(seconds([f"15 {m} 2026 12:00:00" for m in names]), (first - first[0]).astype(float))


def test_a_zone_that_changes_within_a_record_is_taken_off():
    """The hour that a clock with zones goes back loses no time."""
    cells = ["2026-10-25T02:58:00+02:00", "2026-10-25T02:59:00+02:00", "2026-10-25T02:00:00+01:00", "2026-10-25T02:01:00+01:00"]
    np.testing.assert_array_equal(seconds(cells), [0.0, 60.0, 120.0, 180.0])


def test_a_clock_in_the_users_own_form_goes_on_past_midnight_for_more_than_one_reading():
    cells = ["20.00.00", "04.00.00", "12.00.00", "20.00.00", "04.00.00", "04.30.00"]
    np.testing.assert_array_equal(seconds(cells, time_format="%H.%M.%S"), 3600.0 * np.array([0.0, 8.0, 16.0, 24.0, 32.0, 32.5]))


def test_a_zone_in_the_users_own_form_is_no_wall_clock():
    cells = [f"03.05.2026 10:0{k}:00 +0200" for k in range(4)]
    found = parse_stamps(cells, "run", range(4), "", "%d.%m.%Y %H:%M:%S %z")
    np.testing.assert_array_equal(found.seconds, 60.0 * np.arange(4))
    assert found.starts == ()


def test_minutes_and_seconds_written_with_a_point(tmp_path):
    path = tmp_path / "run.csv"
    rows = [f"{k // 2}.{30 * (k % 2):02d},{20 + 0.1 * k:.2f}" for k in range(60)]
    path.write_text("Time [min.sec],T1\n" + "\n".join(rows) + "\n")
    np.testing.assert_allclose(tf.read(path).time_s, 30.0 * np.arange(60))


def test_a_first_stamp_that_began_before_the_record_holds_its_last_readings():
    """Four readings a minute, of the first minute only the last."""
    time = np.concatenate([[0.0], np.repeat(60.0 * np.arange(1, 7), 4)])
    edges = np.flatnonzero(np.concatenate([[True], np.diff(time) > 0]))
    found = spread_evenly(time, {"a": 20.0 + 0.1 * np.arange(len(time))}, edges)
    np.testing.assert_allclose(np.diff(found), 15.0)


def test_thousandths_of_a_degree_by_a_fraction():
    """All three fractions."""
    assert [parse_unit(f"1/{n} °C").scale for n in (10, 100, 1000)] == [0.1, 0.01, 0.001]


def test_a_true_85_degc_before_a_jump_is_kept():
    """A code is one only where the readings jump to it and from it."""
    values = np.concatenate([np.linspace(75.1, 85.0, 100), np.linspace(60.0, 65.0, 100)])
    found, out = without_impossible(values)
    assert out == 0
    assert np.isfinite(found).all()


def test_a_first_value_that_was_held_before_the_record_began_counts_not():
    """Of a hold that was cut short at the beginning nobody knows when it was taken."""
    column = np.repeat(20.0 + 0.1 * np.cumsum(np.random.default_rng(0).choice([1.0, 2.0, 3.0], size=40)), 5)[3:]
    kept = np.isfinite(without_faults({"a": column}, ["a"])[0]["a"])
    np.testing.assert_array_equal(np.flatnonzero(kept)[:3], [2, 7, 12])


def law(minutes, start=0.0, tau=40.0, rise=30.0, noise=0.02, seed=0):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, minutes, 0.5)
    heated = np.where(time > start, -rise * np.expm1(-np.maximum(time - start, 0.0) / tau), 0.0)
    return time, 20.0 + heated + noise * rng.standard_normal(len(time))


def test_what_is_to_go_and_a_time_asked_for_count_from_the_start_of_the_rise():
    """A record with half an hour of idle."""
    time, reading = law(200.0, 30.0)
    one = tf.identify(tf.read({"time_min": time, "a": reading}), 90.0, start=30.0, at=60.0)[0]
    assert one.time_to_go_min == pytest.approx(one.t95_min - 60.0, abs=0.6)
    assert one.at_c == pytest.approx(20.0 + 30.0 * -np.expm1(-60.0 / 40.0), abs=0.3)


def test_an_outlier_ahead_is_no_error_of_the_model_and_no_reading_without_one():
    """The error ahead is the mean over the readings that count."""
    time, reading = law(40.0)
    spoilt = reading.copy()
    spoilt[[63, 68, 73]] += 9.0
    kept = np.ones(len(time), dtype=bool)
    kept[[63, 68, 73]] = False
    whole = tf.identify(tf.read({"time_min": time, "a": spoilt}), 30.0)[0]
    without = tf.identify(tf.read({"time_min": time[kept], "a": reading[kept]}), 30.0)[0]
    assert whole.rmse_ahead_c == pytest.approx(without.rmse_ahead_c, rel=0.02)


def test_the_readings_own_half_width_is_that_of_an_exact_machine():
    """Reading_half_width_c."""
    run = tf.read({"time_min": law(60.0)[0], "a": law(60.0)[1]})
    told, exact = tf.identify(run)[0], tf.identify(run, imperfection="none", rates="own")[0]
    half = 0.5 * (exact.steady_state_hi_c - exact.steady_state_lo_c)
    assert told.reading_half_width_c == pytest.approx(half, rel=1e-6)
    assert told.reading_half_width_c < 0.45 * (told.steady_state_hi_c - told.steady_state_lo_c)


def test_the_measured_steady_state_is_the_mean_of_the_last_tenth():
    time, reading = law(240.0, noise=0.0)
    assert measured.measured_equilibrium(time, reading)[0] == pytest.approx(reading[-48:].mean(), abs=1e-9)


def test_sides_of_an_interval_keep_their_side_in_another_room():
    """An interval of two different sides."""
    found, said = measured.in_room([np.array([v]) for v in (30.0, 40.0, 60.0)], 20.0, 25.0, 0.0)
    assert [float(v[0]) for v in found.values()] == [25.0, 45.0, 35.0, 65.0]
    assert not said


def test_a_room_that_is_not_logged_for_a_quarter_of_the_time_is_none():
    time, room = np.arange(21.0), np.full(21, 20.0)
    room[::2] = np.nan
    assert measured.room_at(time, room, time, 20.0).tolist() == [20.0] * 21
    room[11:] = np.nan
    assert measured.room_at(time, room, time, 20.0) is None
    assert measured.room_at(time, room, time, 11.0).tolist() == [20.0] * 21
    assert measured.room_at(time, np.where(time % 6 == 1, 20.0, np.nan), time, 12.0) is None  # three readings


def test_what_a_room_does_later_fills_no_gap_before():
    time = np.arange(21.0)
    room = np.where(time < 9, 20.0, np.where(time > 12, 30.0, np.nan))
    found = measured.room_at(time, room, time, 10.0)
    assert found[:11].tolist() == [20.0] * 11
    assert found[11:].tolist() == pytest.approx([26.0, 28.0, *[30.0] * 8])


def test_rounding_alone_is_taken_off_the_noise_that_averages_it_out():
    """0.1 K steps over a probe's own 0.02 K leave 0.03 K of bias."""
    step = 0.1
    fit = SimpleNamespace(
        dof=np.array([40.0]), noise_variance=np.array([step**2 / 12 + 0.02**2]), steady_state_limit=np.array([0.2])
    )
    spread = 0.2 * np.sqrt(fit.noise_variance[0])
    expected = (1.0 + 0.03 / (2.0210754 * spread)) ** 2
    assert closing._rounding(fit, np.array([step]))[0] == pytest.approx(expected, rel=1e-6)


def test_a_cooling_of_which_little_was_read_is_open_downwards():
    """The open side is that to which the readings go."""
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 8.0, 0.25)
    one = tf.identify(
        tf.read({"time_min": time, "a": 80.0 - 60.0 * -np.expm1(-time / 200.0) + 0.05 * rng.standard_normal(len(time))})
    )[0]
    assert one.steady_state_lo_c is None
    assert one.steady_state_hi_c is not None


def test_a_rule_does_not_hold_while_the_machine_has_not_been_switched_on():
    """Sweep with a start."""
    time, reading = law(500.0, 90.0)
    run = tf.read({"time_min": time, "a": reading})
    blank = tf.sweep(run, windows=(200.0,), times=(150.0, 180.0), start=90.0).records[0]
    told = with_trips([blank], criterion_from("2K/h, 2x30min"), [(run, 90.0)])[0]
    # Over the first of the two windows of half an hour the rise is 30 K (1 - exp(-30 / 40)) exp(-t / 40) = 1 K.
    trip = 60.0 + 40.0 * np.log(-30.0 * np.expm1(-0.75))
    assert told.trip_min == pytest.approx(trip, abs=3.0)
    assert told.missing_k == pytest.approx(30.0 * np.exp(-trip / 40.0), abs=0.1)


def test_what_is_missing_is_the_surer_the_larger_the_change_that_the_rule_allows():
    """Of 2 K a window, and of half a kelvin."""
    away = np.array([[1.0, 2.0, 3.0]])
    for change in (0.5, 2.0):
        rule = replace(criterion_from("1K/h"), change_k=change)
        own = 1.96 * 0.1 * np.hypot(1.0, np.sqrt(2.0) * 2.0 / change)
        assert _missing(rule, away, np.array([0.1]))[0, 2] == pytest.approx(2.0 + np.hypot(1.0, own))


def test_a_sensor_apart_is_told_in_another_room_too():
    """The room itself sets no sensor apart."""
    from thermofast.analysis.changed import _apart

    found = _apart(np.array([[20.0, 20.0, 20.0], [26.0, 26.0, 29.0]]), 1, ("a", "b", "c"))
    assert len(found) == 1
    assert found[0].startswith("c began 3 K higher")


def test_a_larger_loss_settles_sooner_in_words():
    """Both ways."""
    from thermofast.analysis.changed import _record
    from thermofast.models.uncertainty.changes import Change

    for size, words in (
        (np.log(1.5), "rises less and settles sooner, by 50 %"),
        (np.log(0.5), "rises more and settles later, by 50 %"),
    ):
        change = Change("loss", None, probability=0.99, size=float(size), deviation=0.01)
        assert words in _record("new", change, ("a",), "loss", "ok", []).message


def test_a_past_run_with_an_idle_beginning_is_read_at_turns_of_its_rise(monkeypatch):
    from thermofast.analysis import calibration
    from thermofast.pipeline.methods import choose

    asked = []

    def identified(signals, method, question=EVERYTHING):
        asked.append((question.until_min, question.at_min))
        sides = {"at_lo_c": 49.0, "at_c": 50.0, "at_hi_c": 51.0}
        return SimpleNamespace(records=[SimpleNamespace(rate_per_min=1 / 40, status="ok", steady_state_measured_c=50.0, **sides)])

    monkeypatch.setattr(calibration, "identify_sensors", identified)
    time, reading = law(260.0, 60.0)
    calibration.past_run((tf.read({"time_min": time, "a": reading}), 60.0), choose("afukf", None, ()))
    assert [u for u, _ in asked[1:8]] == pytest.approx([60.0 + 40.0 * turn for turn in calibration.TURNS])
    assert asked[1][1] == pytest.approx(float(time[-20:].mean()) - 60.0)


def test_what_later_readings_say_counts_from_the_record_again():
    from thermofast.analysis.watching import _of_later
    from thermofast.records import IdentifyRecord

    later = _of_later(IdentifyRecord("run", "a", "afukf", until_min=20.0, t95_min=9.0), 30.0)
    assert (later.start_min, later.until_min, later.t95_min) == (30.0, 50.0, None)


def test_events_of_another_run_are_asked_for_anew():
    """The file begins again with a run that is nearly as long."""
    from thermofast.analysis.watching import Watch
    from thermofast.records import IdentifyRecord

    asked = []

    def identify(run, start):
        sides = {"steady_state_c": 29.0, "steady_state_lo_c": 28.9, "steady_state_hi_c": 29.1, "rate_per_min": 0.05}
        return (IdentifyRecord("run", "a", "afukf", status="ok" if start == 0.0 else "model_doubtful", **sides),)

    def happened(run, minute):
        asked.append(float(run.time_s[-1]) / 60.0)
        return True

    watch = Watch(identify, 0.5, happened=happened)
    for length in (130.0, 125.0):
        time, reading = law(length, noise=0.0)
        watch.look(tf.read({"time_min": time, "a": reading}))
    assert asked == pytest.approx([129.5, 124.5])


def test_a_rate_is_so_many_standard_errors_from_the_files():
    from thermofast.analysis.validate import _off
    from thermofast.machine.modelfile import Number

    file = SimpleNamespace(
        base=[Number(name="rate", unit="1/min", belongs="machine", value=0.02, standard_error=0.002, channel="a")]
    )
    assert _off(file, "a", 0.022) == pytest.approx(np.log(1.1) * 10.0)
    assert _off(file, "b", 0.022) == 0.0


def test_a_set_of_effects_is_doubted_more_than_one():
    """The weight of the record without what was added."""
    from scipy.stats import norm

    from thermofast.pipeline.averaged import averaged
    from thermofast.records import IdentifyRecord

    def told(middle):
        sides = {"steady_state_c": middle, "steady_state_lo_c": middle - 1.0, "steady_state_hi_c": middle + 1.0}
        return IdentifyRecord("run", "a", "afukf", status="ok", **sides)

    for effects, untrue in ((1, 0.15), (3, 0.25)):
        high = averaged(told(50.0), told(60.0), effects).steady_state_hi_c
        assert high == pytest.approx(60.0 + norm.ppf(1.0 - 0.025 / untrue) / 1.96, abs=1e-4)


def test_a_temperature_at_switch_off_rests_on_readings_until_the_time_named_alone():
    """--switch-off-at with --until."""
    from thermofast.records import IdentifyRecord
    from thermofast.standards.switching_off import with_switch_off

    time = np.arange(1.0, 61.0)
    reading = np.round(20.0 + 60.0 * np.exp(-time / 30.0) + np.where(time > 40.0, 5.0, 0.0), 2)
    blank = IdentifyRecord("run", "a", "afukf")
    whole, cut = (tf.read({"time_min": time[:n], "a": reading[:n]}, name="run") for n in (60, 40))
    told = with_switch_off(blank, whole, -1.0, float(cut.time_s[-1]) / 60.0)
    assert told.switch_off_c == with_switch_off(blank, cut, -1.0, None).switch_off_c
    assert told.switch_off_c == pytest.approx(80.0, abs=0.1)  # a minute before the first reading


def test_half_widths_of_a_sweep_with_a_model_are_those_of_identify_at_that_time(monkeypatch):
    """--start."""
    from thermofast.learning import settle
    from thermofast.observing.task import LoopTask

    asked = []
    time, reading = law(100.0)
    task = LoopTask(tf.read({"time_min": time, "a": reading}), start_min=30.0)
    monkeypatch.setattr(settle, "knowledge", lambda t: asked.append(t.until_min) or [SimpleNamespace(past=None, uses_room=False)])
    monkeypatch.setattr(
        settle, "identify_sensors", lambda s, _, q: asked.extend((q.until_min, s.start_min)) or SimpleNamespace(records=[])
    )
    monkeypatch.setattr(settle, "replace", lambda one, **new: one if not isinstance(one, LoopTask) else replace(one, **new))
    settle.half_widths(task, SimpleNamespace(), 20.0)
    assert asked == [50.0, 50.0, 30.0]


def test_a_load_that_jumped_did_so_on_the_clock_of_the_run():
    """--drive with --start."""
    from thermofast.learning.past import _changed

    time = np.arange(100.0)
    heat = np.where(time >= 60.0, 1.0, 0.4)
    run = SimpleNamespace(inputs={}, heat=heat, driven=None, used=np.ones((1, 100), dtype=bool), time=time)
    assert _changed(SimpleNamespace(run=run, model=SimpleNamespace(parts=())), 30.0) == 90.0


def test_what_settles_by_a_time_settles_by_its_inverse():
    from thermofast.learning.rise import slowest
    from thermofast.models.joint import RATE, Key

    part = SimpleNamespace(
        effect=SimpleNamespace(parameters=(SimpleNamespace(name="fall", settles="time"),)),
        concerns=lambda n: np.ones(n, dtype=bool),
    )
    fit = SimpleNamespace(
        values={RATE: np.array([0.05]), Key(0, "fall"): 200.0}, run=SimpleNamespace(sensors=1), model=SimpleNamespace(parts=(part,))
    )
    assert slowest(fit, 0) == pytest.approx(0.005)


def test_a_drive_is_drawn_in_its_own_unit():
    from thermofast.discovery.compare import drive_of

    found = drive_of(SimpleNamespace(drive="power_w", heat=np.array([0.0, 0.5, 1.0]), heat_unit=500.0))
    assert found["power_w"].tolist() == [0.0, 250.0, 500.0]


def test_a_point_in_a_name_stays_one_in_a_csv_for_excel():
    from thermofast.output.text import to_csv

    assert to_csv(["channel", "t"], [{"channel": "T1.front", "t": 1.5}], excel=True).splitlines()[1] == "T1.front;1,5"


def test_a_constant_that_is_no_logarithm_scatters_by_a_share_of_itself():
    """6 % of 100, which counts as four runs, beside two that are alike."""
    from thermofast.models.uncertainty.pooled import _pooled

    scatter = _pooled(np.array([[100.0], [100.0]]), np.full((2, 1), 1e-9), np.array([False]))[2]
    assert scatter[0] == pytest.approx(6.0 * np.sqrt(4.0 / 5.0))


def test_residuals_that_stay_alike_count_for_one():
    """Ten neighbours alike are one."""
    from thermofast.models.uncertainty.pooled import dependence

    assert dependence(np.repeat(np.tile([1.0, -1.0], 10), 10)) == pytest.approx(10.0)


def test_a_sensor_is_so_many_times_as_fast_as_the_slowest_that_has_not_settled():
    from thermofast.models.uncertainty.companions import faster

    found = faster(np.array([0.1, 0.05, 0.01]), 50.0, 4.0, 8.0, 2.0)
    assert found[0] == pytest.approx(10.0)
    assert np.isnan(found[1:]).all()


def test_a_rule_looks_back_on_its_hold_too():
    assert criterion_from("1K/h + 3h").length_min == 240.0
    assert criterion_from("2K/h, 2x30min").length_min == 60.0


def test_a_noise_known_from_few_readings_widens_the_temperature_at_switch_off(monkeypatch):
    """Student's distribution for nine readings."""
    from thermofast.models.standards import switch_off

    time = np.arange(1.0, 10.0)
    reading = 20.0 + 60.0 * np.exp(-time / 6.0) + 0.1 * np.random.default_rng(0).standard_normal(9)
    told = switch_off.temperature_at_switch_off(time, reading, 0.0)
    monkeypatch.setattr(switch_off, "t_quantile", lambda dof: 1.959964)
    normal = switch_off.temperature_at_switch_off(time, reading, 0.0)
    assert (told.high - told.low) / (normal.high - normal.low) == pytest.approx(2.7764451 / 1.959964, rel=1e-5)


def test_before_the_record_a_load_was_as_at_first():
    """A heat that follows a column later."""
    from thermofast.models.effects.load_step import later

    run = SimpleNamespace(time=np.arange(10.0), step=1.0)
    np.testing.assert_allclose(later(run, np.full((1, 10), 0.7), 2.5), 0.7)


def test_what_arrives_at_a_growing_flow_left_with_the_volume_between():
    """T^2 / 20 less the volume 0.8 is what had passed when it left."""
    from thermofast.models.effects.transport_delay import TransportDelay

    time = np.linspace(0.0, 10.0, 201)
    drive = SimpleNamespace(delay=0.0)
    run = SimpleNamespace(time=time, inputs={"flow": time})
    TransportDelay().apply(drive, run, SimpleNamespace(column="flow", scale=10.0, delay=0.8))
    assert drive.delay[120] == pytest.approx(6.0 - np.sqrt(20.0), abs=0.002)


def test_noise_of_a_logged_room_is_borrowed_by_what_follows_it():
    from thermofast.models.effects.ambient import Ambient

    assert Ambient().borrowed_noise(SimpleNamespace(ambient_noise=0.1), None, 0, 0.02, {"gain": -0.5}) == pytest.approx(0.05)


def test_a_machine_whose_runs_are_known_is_not_taken_for_the_law_itself():
    from thermofast.models.imperfection import TYPICAL, Past

    assert TYPICAL.clean > 0.0
    assert Past({}, runs=2).prior(TYPICAL).clean == 0.0
    assert Past({}, runs=0).prior(TYPICAL).clean == TYPICAL.clean


def test_an_error_of_a_logarithm_is_told_in_the_units_of_the_value():
    """Parameters of a record."""
    from thermofast.models.joint import Key
    from thermofast.observing.task import parameters_of

    key = Key(0, "lag")
    column = SimpleNamespace(part=0, key=key, parameter=SimpleNamespace(name="lag", each="run", log=True, unit="min"))
    part = SimpleNamespace(id="ambient", effect=SimpleNamespace(event=None))
    fit = SimpleNamespace(
        model=SimpleNamespace(local=(), shared=(column,), parts=(part,)), values={key: 10.0}, deviations={key: 0.1}
    )
    assert parameters_of(fit)["ambient.lag"] == {"value": 10.0, "standard_error": 1.0, "unit": "min"}


def test_a_steady_state_with_a_logged_column_is_that_of_its_last_level(monkeypatch):
    from thermofast.learning import settle
    from thermofast.models.joint import LEVEL, RATE, START

    monkeypatch.setattr(settle, "replace", lambda one, **new: SimpleNamespace(**{**vars(one), **new}))
    monkeypatch.setattr(settle, "together", lambda _fit, over, _last, _keep: over)
    monkeypatch.setattr(settle, "lasting", lambda _fit: [])
    flow = np.repeat([1.0, 3.0], 10)
    run = SimpleNamespace(ambient={}, inputs={"flow": flow}, heat=flow, used=np.ones((1, 20), dtype=bool))
    values = {LEVEL: np.array([50.0]), START: np.array([20.0]), RATE: np.array([0.02])}
    far = settle._far(SimpleNamespace(run=run, values=values), 100.0, None)
    assert set(far.inputs["flow"]) == set(far.heat) == {3.0}


def test_the_error_of_blocks_left_out_is_that_on_the_blocks():
    """The last eighth of a record jumps by 5 K, which the rest cannot foretell."""
    from thermofast.models.joint import fit_model
    from thermofast.models.search.heldout import held_out_errors
    from thermofast.observing.task import LoopTask, ready

    time, reading = law(200.0, noise=0.02)
    reading[len(time) * 7 // 8 :] += 5.0
    fit = fit_model(ready(LoopTask(tf.read({"time_min": time, "a": reading})))[1].seen)
    assert held_out_errors(fit)[0] > 1.4 * fit.rmse[0]


def test_each_past_run_is_judged_by_factors_of_the_others():
    """A run far off widens the intervals of the others, not its own."""
    from thermofast.analysis.calibration import CANDIDATES, TURNS, Past, _factors, _left_out_factors

    past = []
    for off in (0.1, 0.1, 2.0):
        three = np.array([30.0 + off - 0.5, 30.0 + off, 30.0 + off + 0.5])
        past.append(Past("run", np.broadcast_to(three, (len(CANDIDATES), len(TURNS), 1, 3)).copy(), np.array([30.0])))
    apart = _left_out_factors(past, 0)
    np.testing.assert_array_equal(apart[2], _factors(past, 0, np.array([0, 1])))
    assert (apart[2] < apart[0]).all()


def test_noise_that_remembers_is_drawn_so():
    """Readings of which neighbours share four fifths."""
    from thermofast.analysis.validate import _noise

    rng, residual = np.random.default_rng(1), [0.0]
    for e in rng.standard_normal(600):
        residual.append(0.8 * residual[-1] + e)
    run = SimpleNamespace(
        weight=np.ones((1, 601)), used=np.ones((1, 601), dtype=bool), channels=("a",), reading=np.array([residual])
    )
    drawn = _noise(SimpleNamespace(noise=np.array([1.0]), run=run), 0, np.ones(200, dtype=bool), np.array(residual))
    assert np.mean(drawn[:, 1:] * drawn[:, :-1]) / np.mean(drawn**2) == pytest.approx(0.8, abs=0.06)


# --- bugs of the program as it is: each test passes once it is mended


def test_june_and_july_in_french():
    np.testing.assert_array_equal(seconds(["30 juin 2026 12:00:00", "1 juil. 2026 12:00:00"]), [0.0, 86400.0])


def test_a_sensor_that_was_plugged_in_late_is_done_when_the_others_are():
    time, reading = law(120.0)
    late = np.where(time < 30.0, np.nan, reading)
    one = tf.identify(tf.read({"time_min": time, "a": reading, "b": late}), 60.0, start=0.0)[1]
    assert one.time_to_go_min == pytest.approx(one.t95_min - 60.0, abs=1.0)
    assert one.t95_min > 110.0  # as of the others, from the start of the run on


def test_a_second_room_with_gaps_does_not_take_the_first_away():
    rng = np.random.default_rng(1)
    time, reading = law(90.0)
    room = 20.0 + 0.3 * np.sin(time / 30.0) + 0.01 * rng.standard_normal(len(time))
    gaps = np.where(np.arange(len(time)) % 3 > 0, np.nan, room)
    run = tf.read({"time_min": time, "T1 [degC]": reading, "room1 [degC]": room, "room2 [degC]": gaps})
    assert tf.identify(run, room=30.0)[0].room_c == 30.0


def test_a_reading_missing_at_the_end_of_a_past_run_costs_no_sensor(monkeypatch):
    from thermofast.analysis import calibration
    from thermofast.pipeline.methods import choose

    def identified(*_a, **_more):
        sides = {"at_lo_c": 49.0, "at_c": 50.0, "at_hi_c": 51.0}
        return SimpleNamespace(records=[SimpleNamespace(rate_per_min=1 / 40, status="ok", steady_state_measured_c=50.0, **sides)])

    monkeypatch.setattr(calibration, "identify_sensors", identified)
    time, reading = law(200.0)
    reading[-5] = np.nan
    assert isinstance(
        calibration.past_run((tf.read({"time_min": time, "a": reading}), 0.0), choose("afukf", None, ())), calibration.Past
    )


def test_an_idle_beginning_is_no_time_in_which_a_second_mass_shows():
    from thermofast.analysis.watching import Watch
    from thermofast.records import IdentifyRecord

    def identify(run, start):
        sides = {"steady_state_c": 50.0, "steady_state_lo_c": 49.9, "steady_state_hi_c": 50.1, "rate_per_min": 1 / 40}
        return (IdentifyRecord("run", "a", "afukf", status="ok", start_min=start, **sides),)

    watch = Watch(identify, 0.5, start_min=120.0)
    for length in (140.0, 150.0):  # half and three quarters of a time constant, of the one and a half that are asked for
        time, reading = law(length, 120.0)
        assert not watch.look(tf.read({"time_min": time, "a": reading})).stop


def test_until_means_the_same_readings_in_compare_as_in_identify():
    time, reading = law(200.0, 60.0)
    run = tf.read({"time_min": time, "a": reading})
    ways = {"until": 120.0, "start": 60.0}
    assert tf.compare(run, **ways)[0].samples == tf.identify(run, **ways)[0].samples


def test_a_cooling_without_noise_is_told_too():
    """A simulated record: the error ends the whole call, for all sensors and runs."""
    time = np.arange(1.0, 61.0)
    told = tf.identify(tf.read({"time_min": time, "T1 [degC]": 20.0 + 60.0 * np.exp(-time / 30.0)}), switch_off_at=-1.0)[0]
    assert told.switch_off_c == pytest.approx(80.0, abs=0.01)


def test_an_interval_that_reaches_far_behind_the_beginning_determines_nothing():
    from thermofast.estimation.verdicts import _undetermined

    # Risen by 10 K from 20; fallen by 10 K from 60.
    low, high = np.array([9.0, 11.0, 30.0, 30.0]), np.array([50.0, 50.0, 71.0, 69.0])
    found = SimpleNamespace(
        bounded=np.ones(4, dtype=bool),
        steady_low=low,
        steady_high=high,
        initial=np.array([20.0, 20.0, 60.0, 60.0]),
        state=np.array([[30.0], [30.0], [50.0], [50.0]]),
        noise=np.full(4, 0.02),
    )
    case = SimpleNamespace(found=found, width=high - low, seen=np.full(4, 10.0), went=np.full(4, 10.0))
    reasons = _undetermined(case, np.zeros(4, dtype=bool))
    assert [reason.where.tolist() for reason in reasons] == [[False] * 4, [False] * 4, [True, False, True, False]]
    assert "from 11 K behind where it began on" in reasons[2].say(0)
    assert not _undetermined(case, np.ones(4, dtype=bool))[2].where.any()  # it comes back there


def test_a_sweep_with_a_model_counts_its_times_from_the_first_reading():
    idle, at_once = law(260.0, 60.0, noise=0.2), law(200.0, noise=0.2)
    model = tf.improve(tf.read({"time_min": at_once[0], "a": at_once[1]})).model
    told = tf.sweep({"time_min": idle[0], "a": idle[1]}, windows=(220.0,), times=(50.0, 66.0), start=60.0, model=model)[0]
    late = tf.sweep({"time_min": idle[0], "a": idle[1]}, windows=(220.0,), times=(160.0,), start=60.0, model=model)[0]
    assert told.best_time_min == 66.0  # 6 min of the rise
    assert told.rmse_c > 1.5 * late.rmse_c
    assert late.rmse_c == pytest.approx(0.2, rel=0.15)


def test_the_maker_of_workers_leaves_an_interrupt_to_their_parent():
    code = "import signal, thermofast.workers.starting as s; print(signal.getsignal(signal.SIGINT) == signal.SIG_IGN)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"


def test_mpi_that_somebody_else_has_loaded_hands_nothing_out(monkeypatch):
    from thermofast.workers.cluster import Local, crew_of

    monkeypatch.setitem(sys.modules, "mpi4py.futures", SimpleNamespace())
    crew = crew_of(None)
    assert isinstance(crew, Local)
    crew.close()


def test_shared_files_need_a_cluster_or_mpi_however_that_was_started(monkeypatch):
    """As in docs/scale.md: python -m mpi4py.futures -m thermofast ... --shared-files."""
    from thermofast.shell import archive

    scale = SimpleNamespace(shared_files=True, cluster=None, mpi=False, prune=False, resume=False)
    monkeypatch.setattr(archive, "scale_of", lambda: scale)
    with pytest.raises(tf.UsageError, match="made by a cluster"):
        archive.names_folder("results/")
    monkeypatch.setitem(sys.modules, "mpi4py.futures", SimpleNamespace())
    with pytest.raises(tf.UsageError, match="made by a cluster"):
        archive.names_folder("results/")
    monkeypatch.setenv("PMI_RANK", "0")
    assert archive.names_folder("results/") is True


def test_effects_of_which_no_sensor_is_known_are_not_judged():
    from thermofast.learning.foretold import _told
    from thermofast.models.imperfection import Past
    from thermofast.observing.task import LoopTask

    time, reading = law(100.0)
    assert _told(LoopTask(tf.read({"time_min": time, "a": reading})), 50.0, Past({}), True) == {}


@pytest.mark.parametrize(
    ("times", "serves", "said"),
    [
        ((5.0, 10.0), False, "2 of the times tried lie within that of 40 min, up to 10 min"),
        ((10.0, 40.0, 70.0), False, "1 of the times tried lies within that of 40 min, up to 10 min"),
        ((10.0, 20.0, 31.0), False, "3 of the times tried lie within that of 40 min, up to 31 min"),
        ((10.0, 20.0, 33.0), True, ""),
        ((20.0, 37.0), False, "2 of the times tried lie"),
        (tuple(np.arange(5.0, 40.0)), True, ""),
    ],
)
def test_a_time_serves_that_was_tried_among_others_up_to_the_windows_end(times, serves, said):
    """The error falls to the end of each list, as it does on a record of which more is better."""
    rmse = np.where(np.array(times) < 40.0, 0.02 + 0.5 * np.exp(-np.array(times) / 4.0), np.nan)[None, None]
    width = np.full((1, len(times)), 0.1)
    row = sweep_records(("run", ["T1"], "afukf"), [False], [[]], (40.0,), np.array(times), rmse, width, [41], 0.1)[0]
    assert (row.shortest_time_min is not None) == serves
    assert said in row.message
    assert ("no time tried serves" in row.message) != serves
    assert row.agreed == (True if serves else None)


def test_where_a_record_goes_on_the_row_says_why_nothing_is_missing():
    for end, complete in ((500.0, True), (170.0, False)):
        run = tf.read(dict(zip(("time_min", "a"), law(end), strict=True)))
        row = tf.sweep(run, windows=(90.0,), times=(30.0, 60.0, 80.0), criterion="2K/h").records[0]
        assert row.trip_min is not None
        assert (row.missing_k is not None) == complete
        assert ("is not read from it" in row.message) != complete


def test_what_is_taken_to_be_known_has_no_rank_among_what_is_not():
    time, reading = law(100.0)
    rows = tf.sensitivity(
        tf.read({"time_min": time, "a": reading}), until=60, sizes={"offset": 0.0, "room": 0.0, "jitter": 0.0, "until": 0.0}
    )
    for r in rows:
        assert (r.rank is None) == (r.size == 0.0) == (r.rank_p is None)
    assert {r.rank for r in rows if r.rank} == {1, 2}


@pytest.mark.proof
def test_more_past_runs_make_no_test_longer():
    """What a few runs say by chance of the size of disturbances is no reason to use fewer."""
    found = tf.plan(0.5, sensors=1, interval_s=30.0, rise_c=20.0, tau_min=70.0, noise_c=0.03)
    times = [r.time_min for r in found if "past run" in r.channel]
    assert len(times) == 3
    assert times == sorted(times, reverse=True)
