"""Files that are damaged on purpose, files that are larger inside than out, and what a user may say of sizes."""

import io
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import thermofast as tf
from benchmarks.reading.fuzz import TARGETS, fuzz
from benchmarks.reading.hostile import KINDS, bombs, columns, outcomes, read
from thermofast.reading.tables import limits, packed

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(("kind", "files"), [("parquet", 500), ("xlsx", 100), ("gz", 100)])
def test_damaged_files_are_refused_or_read_as_they_were(kind, files):
    found = outcomes(kind, files, 900_000, 1)
    assert set(found) <= {"refused", "same", "named otherwise", "guessed, and told"}
    assert found["refused"] > 0.8 * files


def test_the_sound_file_is_read_by_each_reader(tmp_path):
    for kind, make in KINDS.items():
        path = tmp_path / f"run.{'csv.gz' if kind == 'gz' else kind}"
        path.write_bytes(make())
        run = tf.read(path)
        assert np.array_equal(run.channels["T1"], columns()["T1"])
    assert read(("gz", [1]))[0][1] in ("refused", "same")


def test_bombs_are_refused_before_they_are_unpacked(tmp_path):
    import tracemalloc

    for path in bombs(tmp_path, 48):
        tracemalloc.start()
        with pytest.raises(tf.InputError) as refusal:
            tf.read_all(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 150e6, path.name
        assert path.name in str(refusal.value)


def test_a_sheet_that_says_it_is_small_is_unpacked_as_it_is(tmp_path):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", "<a/>")
        archive.writestr("xl/worksheets/sheet1.xml", b" " * (64 << 20))
    data = bytearray(out.getvalue())
    true = struct.pack("<I", 64 << 20)
    while (at := data.find(true)) >= 0:
        data[at : at + 4] = struct.pack("<I", 100)
    path = tmp_path / "lies.xlsx"
    path.write_bytes(data)
    with pytest.raises(tf.InputError, match="unpacks to more than 400 times its size"):
        tf.read(path)


def test_a_packed_variable_of_matlab_is_looked_at_first(tmp_path):
    path = tmp_path / "run.mat"
    savemat(path, {"t_min": np.arange(60.0), "T1": np.arange(60.0) / 10.0 + 20.0}, do_compression=True)
    assert tf.read(path).channels["T1"][9] == pytest.approx(20.9)
    bomb = zlib.compress(b"\0" * (64 << 20))
    path.write_bytes(path.read_bytes()[:128] + struct.pack("<II", 15, len(bomb)) + bomb)
    with pytest.raises(tf.InputError, match="unpacks to more than 400 times"):
        tf.read(path)


@pytest.mark.parametrize(
    ("option", "most", "what"),
    [("max_bytes", 1000, "more than 0 MiB"), ("max_rows", 50, "a table of 60 rows"), ("max_columns", 2, "a table of 3 columns")],
)
def test_limits_are_the_users(tmp_path, option, most, what):
    path = tmp_path / "run.parquet"
    path.write_bytes(KINDS["parquet"]())
    with pytest.raises(tf.InputError, match=what) as refusal:
        tf.read(path, **{option: most})
    assert option in str(refusal.value)
    assert len(tf.read(path, **{option: 1_000_000}).time_s) == 60
    with pytest.raises(tf.UsageError, match="a whole number above zero"):
        tf.read(path, **{option: 0})


def test_text_has_limits_of_rows_and_columns(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_min,T1,T2\n" + "".join(f"{i},{20 + i / 10},{20 + i / 20}\n" for i in range(60)))
    assert len(tf.read(path, max_rows=100).channels) == 2
    for option in ({"max_rows": 30}, {"max_columns": 2}, {"max_bytes": 100}):
        with pytest.raises(tf.InputError, match=r"max_(rows|columns|bytes)"):
            tf.read(path, **option)


def test_devices_are_no_records(tool):
    done = tool("identify", "/dev/zero", "-q")
    assert done.code == 2
    assert "a device" in done.err


def test_ratios_are_those_of_logged_readings():
    """A constant record packs many times; that must be read."""
    rows = "".join(f"{i},20.00,20.00,20.00,20.00\n" for i in range(1_200_000)).encode()
    assert len(rows) > limits.LARGE
    assert len(rows) < 64 << 20
    assert packed.unpacked(zlib.compress(rows, 9, wbits=31), "run", limits.Limits()) == rows


@pytest.mark.parametrize("name", TARGETS)
def test_any_bytes_are_read_or_refused(name):
    fuzz(name, 100)


def test_no_code_is_run_that_only_a_model_or_settings_name(tmp_path, monkeypatch, tool):
    monkeypatch.chdir(tmp_path)
    mark = tmp_path / "ran"
    effect = (ROOT / "sample_runs" / "my_effect.py").read_text()
    (tmp_path / "mine.py").write_text(effect)
    run = str(ROOT / "sample_runs" / "hidden_ramp.csv")
    tf.improve(run, add="mine.py").model.save("machine.toml")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "mine.py").write_text(
        effect + f"\nimport os\n\nos.mkdir({str(mark)!r}) if not os.path.exists({str(mark)!r}) else None\n"
    )
    (tmp_path / "mine.py").write_text((tmp_path / "other" / "mine.py").read_text())
    for call in (["compare", run], ["identify", run, "--until", "60"], ["diagnose", run], ["sweep", run], ["watch", run]):
        told = tool(*call, "--model", "machine.toml")
        assert told.code == 2
        assert "say --effect mine.py" in told.err
    settings = ('filter = "mine.py"', '[diagnose]\neffect = ["mine.py"]', '[improve]\nadd = "x,mine.py"', '[watch]\nexec = "a b"')
    for text, says in zip(settings, ("--filter mine.py", "--effect mine.py", "--add x,mine.py", "--exec 'a b'"), strict=True):
        (tmp_path / "thermofast.toml").write_text(text + "\n")
        told = tool("compare", run)
        assert told.code == 2
        assert f"say {says} on the command line" in told.err
    (tmp_path / "thermofast.toml").unlink()
    assert not mark.exists()
    with pytest.raises(tf.ThermofastError, match="code of somebody's own"):
        tf.compare(run, model="machine.toml")
    model = tf.Model.load("machine.toml", extra=str(tmp_path / "other" / "mine.py"))
    assert all(list(r.effects) == ["load_ramp"] for r in tf.compare(run, model=model))
    assert mark.exists()
    assert tool("compare", run, "--model", "machine.toml", "--effect", "other/mine.py").code == 0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[watch]\njsonl = "victimrc"', "--jsonl writes outside"),
        ('[identify]\ncluster = "tcp://127.0.0.1:45671"', "--cluster works elsewhere"),
        ("[identify]\nmpi = true", "--mpi works elsewhere"),
        ('[identify]\noutput = ["../x.csv"]', "--output writes outside"),
        ('[identify]\nsave_plot = "/tmp/x.png"', "--save-plot writes outside"),
        ('[displacement]\npredicted = "../x.csv"', "--predicted writes outside"),
        ('[identify]\ntrace = "../x.csv"', "--trace writes outside"),
        ('[compare]\ndenoise = "../x.csv"', "--denoise writes outside"),
        ("[identify]\nauto = 5", "allowed: true or false"),
        ("[identify]\nuntil = true", "allowed: a number"),
        ("[identify]\nuntil = [60]", "allowed: a number"),
        ("[identify]\njobs = 1.5", "allowed: a whole number"),
        ("[identify]\nlimit = true", "allowed: a number"),
    ],
)
def test_settings_of_anybody_write_and_connect_nowhere_and_hold_what_an_option_takes(text, says, tmp_path, monkeypatch, tool):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thermofast.toml").write_text(text + "\n")
    told = tool("identify", str(ROOT / "sample_runs" / "spindle.csv"), "--until", "60")
    assert told.code == 2
    assert says in told.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["thermofast.toml"]


def test_settings_may_name_results_below_this_folder(tmp_path, monkeypatch, tool):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thermofast.toml").write_text('[identify]\noutput = ["x.csv"]\nuntil = 60\nlimit = 105\n')
    assert tool("identify", str(ROOT / "sample_runs" / "spindle.csv")).code == 0
    assert (tmp_path / "x.csv").exists()
