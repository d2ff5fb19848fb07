"""A fuzz target for each reader: any bytes are read or refused in words.

python -m benchmarks.reading.fuzz TARGET [--runs 10000] tries what hypothesis makes of bytes around a sound file; where atheris is
installed (pip install atheris), python -m benchmarks.reading.fuzz TARGET --atheris [its options] lets it search by coverage.
TARGET: text, parquet, workbook, packed, tdms, matlab, matlab_plain, settings, model, prior.
"""

import argparse
import contextlib
import io
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import thermofast as tf
from benchmarks.reading.hostile import columns, gz, parquet, xlsx

ROOT = Path(__file__).parents[2]


def _with_file(suffix: str, use: Callable[[str], object]) -> Callable[[bytes], None]:
    def target(data: bytes) -> None:
        with tempfile.NamedTemporaryFile(suffix=suffix) as file:
            file.write(data)
            file.flush()
            with contextlib.suppress(tf.ThermofastError):
                use(file.name)

    return target


def _text() -> bytes:
    held = columns()
    lines = [",".join(held), *(",".join(f"{v:g}" for v in row) for row in zip(*held.values(), strict=True))]
    return "\n".join(lines).encode()


def _tdms() -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    out = io.BytesIO()
    with TdmsWriter(out) as writer:
        writer.write_segment([ChannelObject("run", n, v) for n, v in columns().items()])
    return out.getvalue()


def _matlab(packed: bool = True) -> bytes:
    from scipy.io import savemat

    out = io.BytesIO()
    savemat(out, columns() if packed else {"run": columns(), "note": "text"}, do_compression=packed)
    return out.getvalue()


def _settings(path: str) -> None:
    from thermofast.shell.settings import load_settings

    load_settings(path)


def _prior(path: str) -> None:
    from thermofast.machine.lab import read_imperfection

    read_imperfection(path)


MODEL = b'version = 4\n[base]\ndrive = "power"\n'
#: Target -> (a sound file, what reads it).
TARGETS: dict[str, tuple[Callable[[], bytes], Callable[[bytes], None]]] = {
    "text": (_text, _with_file(".csv", tf.read_all)),
    "parquet": (parquet, _with_file(".parquet", tf.read_all)),
    "workbook": (xlsx, _with_file(".xlsx", tf.read_all)),
    "packed": (gz, _with_file(".csv.gz", tf.read_all)),
    "tdms": (_tdms, _with_file(".tdms", tf.read_all)),
    "matlab": (_matlab, _with_file(".mat", tf.read_all)),
    "matlab_plain": (lambda: _matlab(packed=False), _with_file(".mat", tf.read_all)),
    "settings": (lambda: b'[input]\ntime = "t"\n[identify]\nuntil = 30\n', _with_file(".toml", _settings)),
    "model": (lambda: MODEL, _with_file(".toml", tf.Model.load)),
    "prior": (lambda: b"[imperfection]\nwander = 0.1\n", _with_file(".toml", _prior)),
}


def around(sound: bytes) -> st.SearchStrategy[bytes]:
    """Bytes from nowhere, and a sound file with some of its bytes exchanged."""
    pieces = st.tuples(st.integers(0, len(sound)), st.integers(0, 40), st.binary(max_size=40))
    cut = st.lists(pieces, min_size=1, max_size=4).map(lambda parts: _exchanged(sound, parts))
    return cut | st.binary(max_size=400) | st.binary(max_size=60).map(lambda head: sound[:8] + head)


def _exchanged(sound: bytes, parts: list[tuple[int, int, bytes]]) -> bytes:
    for at, wide, new in parts:
        sound = sound[:at] + new + sound[at + wide :]
    return sound


def fuzz(name: str, runs: int) -> None:
    """So many examples of one target; raises what it finds."""
    make, target = TARGETS[name]

    @settings(max_examples=runs, deadline=None, database=None, suppress_health_check=list(HealthCheck), phases=[Phase.generate])
    @given(around(make()))
    def tried(data: bytes) -> None:
        target(data)

    tried()


def main() -> None:
    """Run a target."""
    options = argparse.ArgumentParser()
    options.add_argument("target", choices=list(TARGETS))
    options.add_argument("--runs", type=int, default=10_000)
    options.add_argument("--atheris", action="store_true")
    given_, more = options.parse_known_args()
    np.seterr(all="ignore")
    if given_.atheris:
        import atheris

        atheris.Setup([sys.argv[0], *more], TARGETS[given_.target][1])
        atheris.Fuzz()
    fuzz(given_.target, given_.runs)
    print(f"{given_.target}: {given_.runs} examples, nothing found")


if __name__ == "__main__":
    main()
