"""TDMS and MATLAB files: channels with their units and clock, and what is refused."""

import zlib

import nptdms
import numpy as np
import pytest
from scipy.io import savemat

import thermofast as tf

TIME = np.arange(0.0, 60.0, 0.5)
READING = 20.0 + 6.0 * -np.expm1(-TIME / 20.0)


def tdms(path, channels, group="Log"):
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject(group, n, v, properties=p) for n, v, p in channels])
    return path


CLOCK = {"wf_increment": 30.0, "wf_start_offset": 0.0, "unit_string": "Deg C"}


def test_a_tdms_file_has_its_clock_and_units(tmp_path):
    path = tdms(tmp_path / "run.tdms", [("front", READING, CLOCK), ("oil", READING + 273.15, CLOCK | {"unit_string": "K"})])
    run = tf.read(path)
    assert run.time_s == pytest.approx(30.0 * np.arange(120))
    assert run.channels["front"] == pytest.approx(READING)
    assert run.channels["oil"] == pytest.approx(READING)
    assert run.notes[0] == "TDMS, group 'Log', 2 channels"


def test_stamps_of_a_tdms_file_are_its_time(tmp_path):
    stamps = np.datetime64("2026-03-12T08:00:00", "us") + (30_000_000 * np.arange(120)).astype("timedelta64[us]")
    run = tf.read(tdms(tmp_path / "run.tdms", [("Time", stamps, {}), ("front", READING, {"unit_string": "degC"})]))
    assert run.time_s == pytest.approx(30.0 * np.arange(120))
    assert run.channels["front"] == pytest.approx(READING)


def test_scales_that_cannot_be_applied_and_channels_that_run_apart_are_refused(tmp_path):
    scale = {"NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Reciprocal"}
    path = tdms(tmp_path / "scaled.tdms", [("front", READING, CLOCK | scale)])
    with pytest.raises(tf.InputError, match=r"(?s)'front' has a scale that cannot be applied.*Reciprocal"):
        tf.read(path)
    apart = tdms(tmp_path / "apart.tdms", [("front", READING, CLOCK), ("rear", READING[:60], CLOCK)])
    with pytest.raises(tf.InputError, match="channels of group 'Log' that do not run alike"):
        tf.read(apart)
    broken = tmp_path / "broken.tdms"
    broken.write_bytes(path.read_bytes()[:60])
    with pytest.raises(tf.InputError, match="TDMS"):
        tf.read(broken)


def test_one_of_several_groups_is_named(tmp_path):
    path = tmp_path / "run.tdms"
    with nptdms.TdmsWriter(path) as writer:
        for n, shift in (("A", 0.0), ("B", 5.0)):
            writer.write_segment([nptdms.ChannelObject(n, "front", READING + shift, properties=CLOCK)])
    with pytest.raises(tf.InputError, match=r"(?s)2 TDMS groups of channels.*A, B.*sheet=NAME"):
        tf.read(path)
    assert tf.read(path, sheet="B").channels["front"] == pytest.approx(READING + 5.0)
    with pytest.raises(tf.UsageError, match="sheet='C' is none of its TDMS groups"):
        tf.read(path, sheet="C")


def test_matlab_variables_matrices_and_structures(tmp_path):
    path = tmp_path / "run.mat"
    savemat(
        path, {"time_min": TIME, "T": np.stack([READING, READING + 1.0], axis=1), "note": "warm-up", "k": 3.0, "short": TIME[:5]}
    )
    run = tf.read(path)
    assert list(run.channels) == ["T_1", "T_2"]
    assert run.channels["T_2"] == pytest.approx(READING + 1.0)
    assert run.time_s == pytest.approx(60.0 * TIME)
    assert "of another length, left out: short" in run.notes
    savemat(path, {"log": {"time_s": TIME, "T_front": READING}})
    assert tf.read(path).channels["T_front"] == pytest.approx(READING)


def test_new_and_broken_matlab_files_say_what_to_do(tmp_path):
    new = tmp_path / "new.mat"
    new.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + b" " * 400)
    with pytest.raises(tf.InputError, match=r"(?s)a MATLAB 7.3 file.*-v7"):
        tf.read(new)
    savemat(tmp_path / "run.mat", {"time_s": TIME, "T1": READING})
    data = (tmp_path / "run.mat").read_bytes()
    for cut in (130, 200, len(data) - 40):
        new.write_bytes(data[:cut])
        with pytest.raises(tf.InputError, match=r"MATLAB file that cannot be read|no MATLAB structures|no time|no sensor|a header"):
            tf.read(new)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(
    ("at", "new", "said"),
    [
        (4, 8, "an element of kind 8"),  # of the numbers: 8 is none of the format's kinds
        (4, 14, "without its numbers"),  # a matrix where numbers belong
        (-27, 8, "without its numbers"),  # complex, and no second part
    ],
)
def test_matlab_files_of_which_scipy_would_crash_are_refused(tmp_path, packed, at, new, said):
    path = tmp_path / "run.mat"
    savemat(path, {"time_s": TIME, "T1": READING})
    data = bytearray(path.read_bytes())
    data[data.index(b"T1") + at] = new
    if packed:
        first = 128 + 8 + int.from_bytes(data[132:136], "little")
        parts = [zlib.compress(data[128:first]), zlib.compress(data[first:])]
        data = data[:128] + b"".join(b"\x0f\0\0\0" + len(p).to_bytes(4, "little") + p for p in parts)
    path.write_bytes(bytes(data))
    with pytest.raises(tf.InputError, match=f"(?s)MATLAB file that cannot be read.*{said}"):
        tf.read(path)
