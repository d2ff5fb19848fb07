"""Files that were read wrong without a word, or refused though a careful reader would know."""

import re

import numpy as np
import pytest

import thermofast as tf
from tests.priors import SMALL_SLOW
from tests.test_guesses import FRONT, MINUTES, REAR, N, about, stamps, table, values, written
from thermofast.errors import InputError
from thermofast.reading import Options, read_runs

ROOM = ["21.0"] * N


@pytest.mark.parametrize("word", ["init", "no sensor", "O/L", "k.A."])
def test_words_in_the_first_rows_are_no_header(tmp_path, word):
    cells = [word] * 5 + values(FRONT)[5:], [word] * 5 + values(REAR)[5:]
    path = written(tmp_path, table("time,front [°C],room [°C]", stamps(), *cells))
    with pytest.raises(InputError, match=rf"(?s)line 2, column 'front \[°C\]': not a number.*--missing '{word}'"):
        read_runs(path)
    run = read_runs(path, Options(missing=(word,)))[0]
    assert list(run.channels) == ["front [°C]"]
    assert np.isfinite(run.channels["front [°C]"]).sum() == N - 5


def test_the_minus_of_typesetters(tmp_path):
    cold = [f"{v - 30.0:.2f}".replace("-", "\u2212") for v in FRONT]
    run = read_runs(written(tmp_path, table("time,front [°C]", stamps(), cold)))[0]
    assert run.channels["front [°C]"] == pytest.approx(FRONT - 30.0, abs=0.006)


@pytest.mark.parametrize(
    ("head", "names"),
    [
        ("# time(min) front(C) room(C)", ["front(C)"]),
        ("% time_min front room", ["front"]),
        ("time_min front room\nfloat float float", ["front"]),
    ],
)
def test_names_behind_a_sign_of_a_comment_or_over_a_line_of_types(tmp_path, head, names):
    run = read_runs(written(tmp_path, table(head, 0.1 * MINUTES, values(FRONT), ROOM, delimiter=" ")))[0]
    assert list(run.channels) == names
    assert len(run.ambient) == 1
    assert run.time_s == pytest.approx(6.0 * MINUTES)


def test_a_table_of_markdown(tmp_path):
    rows = [f"| {t} | {v} |" for t, v in zip(stamps(), values(FRONT), strict=True)]
    run = read_runs(written(tmp_path, "\n".join(["| time | front °C |", "|---|---:|", *rows])))[0]
    assert list(run.channels) == ["front °C"]


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("front - room", "inputs"),
        ("front-room [K]", "inputs"),
        ("Rise over ambient [K]", "inputs"),
        ("Übertemperatur Wicklung [K]", "inputs"),
        ("Temperature rise [K]", "inputs"),
        ("front-rear [K]", "inputs"),
        ("Dehnung", "inputs"),
        ("Börvärde [°C]", "inputs"),
        ("bearing room side [°C]", "channels"),
        ("Umgebungsluft [°C]", "ambient"),
        ("Omgevingstemperatuur", "ambient"),
        ("Температура воздуха", "ambient"),
        ("雰囲気温度", "ambient"),
        ("front [C°]", "channels"),
        ("front [oC]", "channels"),
    ],
)
def test_what_a_column_is(tmp_path, name, role):
    run = read_runs(written(tmp_path, table(f"time_min,front [°C],rear [°C],{name}", MINUTES, values(FRONT), values(REAR), ROOM)))[
        0
    ]
    assert list(getattr(run, role))[-1].startswith(name)


@pytest.mark.parametrize(
    ("form", "minutes"),
    [
        ("%d.%m.%Y %H.%M.%S", 1),
        ("%d. %m. %Y %H:%M:%S", 1),
        ("%Y. %m. %d. %H:%M:%S", 1),
        ("%d/%m/%Y %I:%M:%S p. m.", 1),
        ("elapsed 0 %H:%M:%S", 1),
    ],
)
def test_stamps_of_other_countries(tmp_path, form, minutes):
    cells = stamps("2026-05-13 13:38:00" if "p. m." in form else "2026-05-13 00:00:00", form=form.removeprefix("elapsed "))
    run = read_runs(written(tmp_path, table("time,front [°C]", cells, values(FRONT))))[0]
    assert np.array_equal(run.time_s, 60.0 * MINUTES * minutes)


def test_elapsed_days_of_net(tmp_path):
    cells = [(f"{m // 144}." if m >= 144 else "") + f"{m % 144 // 6:02d}:{m % 6}0:00" for m in range(N)]
    run = read_runs(written(tmp_path, table("Elapsed,front [°C]", cells, values(FRONT))))[0]
    assert np.array_equal(run.time_s, 600.0 * MINUTES)


def test_a_clock_of_numbers_in_the_users_own_format(tmp_path):
    cells = [int(s) for s in stamps("2026-05-13 08:15:00", form="%H%M%S")]
    run = read_runs(
        written(tmp_path, table("hhmmss,front [°C]", cells, values(FRONT))), Options(time="hhmmss", time_format="%H%M%S")
    )[0]
    assert np.array_equal(run.time_s, 60.0 * MINUTES)


def test_names_with_readings_are_no_clocks(tmp_path):
    with pytest.raises(InputError, match=r"no row of readings|no time column"):
        read_runs(written(tmp_path, "\n".join(f"T1:{v},T2:{v}" for v in values(FRONT))))


def test_a_block_of_nuls_at_the_end(tmp_path):
    data = table("time_min,front [°C]", MINUTES, values(FRONT)).encode() + b"\0" * 4096
    run = read_runs(written(tmp_path, data))[0]
    assert len(run.time_s) == N
    assert any("4096 NUL bytes at the end" in n for n in run.notes)
    assert about(run) == []


@pytest.mark.parametrize("start", ["2026-05-13 00:15:00", "2026-05-13 00:00:00"])
def test_clocks_that_a_spreadsheet_saved_as_minutes_go_on_past_the_hour(tmp_path, start):
    cells = stamps(start, form="%M:%S.0")
    (run,) = read_runs(written(tmp_path, table("Time,front [°C],rear [°C]", cells, values(FRONT), values(REAR))))
    assert np.array_equal(run.time_s, 60.0 * MINUTES)
    assert about(run) == ["time"]


def test_two_runs_of_an_hour_stay_two(tmp_path):
    cells = [f"{int(m) % 60:02d}:00.0" for m in MINUTES[:120]]
    twice = [*values(FRONT[:60]), *values(FRONT[:60])]
    assert len(read_runs(written(tmp_path, table("Time,front [°C]", cells, twice)))) == 2


def test_milliseconds_in_a_column_of_their_own(tmp_path):
    seconds = 0.3 * MINUTES
    clock = [f"08:{15 + int(s // 60):02d}:{int(s) % 60:02d}" for s in seconds]
    cells = ["05/13/2026"] * N, clock, [f"{1000 * (s % 1):.0f}" for s in seconds]
    run = read_runs(written(tmp_path, table("Date,Time,Millitm,front [°C]", *cells, values(FRONT))))[0]
    assert run.time_s == pytest.approx(seconds)
    assert list(run.channels) == ["front [°C]"]


def test_bad_qualities_the_end_of_a_log_and_codes_of_broken_probes(tmp_path):
    rows = [(f"{s},{name},{v},{q}") for s, v in zip(stamps(), values(FRONT), strict=True) for name, q in (("a", 192), ("b", 192))]
    rows[20] = rows[20].rsplit(",", 2)[0] + ",0,0"
    rows[31] = rows[31].rsplit(",", 2)[0] + ",3276.7,192"
    rows[41] = rows[41].rsplit(",", 2)[0] + ",-127,192"
    rows.append(f"{stamps()[-1]},$RT_OFF$,0,192")
    run = read_runs(written(tmp_path, "\n".join(["time,tag,value,quality", *rows])))[0]
    assert list(run.channels) == ["a", "b"]
    assert np.flatnonzero(np.isnan(run.channels["a"])).tolist() == [10]
    assert np.flatnonzero(np.isnan(run.channels["b"])).tolist() == [15, 20]
    assert any("1 reading of bad quality left out" in n for n in run.notes)


def test_rows_of_nothing_but_delimiters_are_empty(tmp_path):
    lines = table("time,front [°C],rear [°C]", stamps(), values(FRONT), values(REAR)).splitlines()
    lines.insert(5, ",,")
    run = read_runs(written(tmp_path, "\n".join([*lines, ",,", '"",,'])))[0]
    assert np.array_equal(run.time_s, 60.0 * MINUTES)


def test_the_swings_of_a_load_are_no_outliers():
    minutes, fine = 0.5 * np.arange(121), 0.01
    fast, slow, read = 0.0, 0.0, []
    for k in range(6001):
        if k % 50 == 0:
            read.append(20.0 + fast + slow)
        load = 1.0 if (k * fine) % 10.0 < 6.0 else 0.0
        fast, slow = fast + fine * (8.0 * load - fast) / 5.0, slow + fine * (12.0 * load - slow) / 60.0
    noisy = np.array(read) + 0.03 * np.random.default_rng(7).standard_normal(121)
    run = tf.read({"time_min": minutes, "A [°C]": noisy, "B [°C]": 0.8 * noisy + 4.0})
    # Six cycles of ten minutes: what swings is taken out, and the mean load's 20 + 0.6 (8 + 12) is held.
    steady = tf.identify(run, jobs=1, imperfection=SMALL_SLOW).records[0]
    assert steady.status == "ok"
    assert steady.steady_state_lo_c <= 32.0 <= steady.steady_state_hi_c
    record = tf.identify(run, jobs=1, imperfection="none").records[0]
    assert record.status != "ok"
    left_out = re.search(r"(\d+) outliers left out of 121 readings: too many", record.message or "")
    assert record.status == "not_determined" or (left_out and int(left_out[1]) > 12)


@pytest.mark.parametrize(
    ("line", "header", "scale"),
    [
        ("Units: °F", "time,front,room", 1.8),
        ("Temperature Unit;degF;", "time,front,room", 1.8),
        ("Units: °F", "time,front [°C],room [°C]", 1.0),  # what stands at the readings counts
        ("Unit: 12", "time,front,room", 1.0),
    ],
)
def test_a_unit_above_the_names(tmp_path, line, header, scale):
    cells = [[f"{scale * v + (32.0 if scale > 1.0 else 0.0):.3f}" for v in column] for column in (FRONT, np.full(N, 21.0))]
    run = read_runs(written(tmp_path, f"Logger 7\n{line}\n\n" + table(header, stamps(), *cells)))[0]
    assert next(iter(run.channels.values())) == pytest.approx(FRONT, abs=0.002)
    assert next(iter(run.ambient.values())) == pytest.approx(21.0, abs=0.002)
