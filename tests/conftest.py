"""Shared fixtures: the tool called in this process, and where real records lie."""

import io
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from thermofast.main import run

# Where it is set, each process that a test starts would compile the program anew: half a second, some hundreds of times.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Tests run beside each other, one on each core: threads of the linear algebra would only wait for each other.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "data"


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


@pytest.fixture
def tool(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """``tool("identify", path, ...)`` with optional ``stdin=bytes``; standard input is otherwise nothing."""

    def call(*arguments: object, stdin: bytes | None = None) -> Outcome:
        if stdin is not None:
            monkeypatch.setattr("thermofast.shell.session._piped", lambda: True)
            monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BufferedReader(io.BytesIO(stdin))))
        else:
            monkeypatch.setattr("thermofast.shell.session._piped", lambda: False)
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            run([str(a) for a in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return Outcome(int(stop.value.code or 0), captured.out, captured.err)

    return call


@pytest.fixture
def shared() -> Path:
    if not SHARED.is_dir():
        pytest.skip(f"no folder {SHARED}: the measured records are not part of this repository")
    return SHARED


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The long ones first, so that no worker is left with one at the end."""
    items.sort(key=lambda item: not item.nodeid.startswith(("tests/test_tutorial", "tests/test_discovery", "tests/published")))
