"""--from and --to: a part of a record is what a file of that part is."""

import json

import numpy as np

import thermofast as tf

SPINDLE = "sample_runs/spindle.csv"


def test_a_stretch_is_the_file_of_that_stretch(tool, tmp_path):
    run = tf.read(SPINDLE, from_min=30, to_min=150)
    whole = tf.read(SPINDLE)
    kept = (whole.time_s >= 1800) & (whole.time_s <= 9000)
    assert run.time_s[0] == 0.0
    assert np.array_equal(run.time_s, whole.time_s[kept] - whole.time_s[kept][0])
    assert np.array_equal(run.channels["T3"], whole.channels["T3"][kept])
    assert "30 to 150 min of 400 kept (--from, --to)" in run.notes
    cut = tmp_path / "cut.csv"
    names = list(run.channels)
    lines = [",".join(["time_min", "ambient", *names])]
    columns = [run.time_s / 60.0, run.ambient["ambient"], *(run.channels[n] for n in names)]
    lines += [",".join(f"{v:.6f}" for v in row) for row in zip(*columns, strict=True)]
    cut.write_text("\n".join(lines))
    for command in (("identify", "--until", 60), ("sweep", "--windows", 60), ("compare", "--until", 60)):
        stretch = tool(*command, SPINDLE, "--from", 30, "--to", 150, "--channels", "T3,T5", "--format", "json", "-q")
        file = tool(*command, cut, "--channels", "T3,T5", "--format", "json", "-q")
        mine, theirs = (json.loads(done.out)["records"] for done in (stretch, file))
        numbers = [k for k, v in theirs[0].items() if isinstance(v, float) and "p" not in k.split("_")]
        assert len(numbers) > 3
        for a, b in zip(mine, theirs, strict=True):
            assert all(abs((a[k] or 0.0) - (b[k] or 0.0)) <= 1e-3 * abs(b[k] or 1.0) + 0.02 for k in numbers), command


def test_what_is_no_stretch_is_told(tool):
    for words, said in (
        (("--from", 500), "fewer than two readings lie from --from 500 to the last min"),
        (("--from", 60, "--to", 30), "--to is not after --from"),
        (("--to", "nan"), "is no number; allowed: above 0 in min"),
    ):
        done = tool("identify", SPINDLE, *words)
        assert done.code == 2
        assert said in done.err
