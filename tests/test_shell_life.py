"""Completion in a shell, and the manual page."""

import os
import shutil
import subprocess
import sys

import pytest
from conftest import ROOT

from thermofast.main import COMMANDS

SPINDLE = "sample_runs/spindle.csv"


def completed(words, at):
    """What the program offers a shell for the word of that number."""
    env = os.environ | {"COMP_WORDS": words, "COMP_CWORD": str(at), "_THERMOFAST_COMPLETE": "bash_complete"}
    done = subprocess.run([sys.executable, "-m", "thermofast"], env=env, cwd=ROOT, capture_output=True, text=True, check=True)
    return [line.partition(",")[2] for line in done.stdout.splitlines() if line]


@pytest.mark.parametrize(
    ("words", "at", "offered"),
    [
        ("thermofast ident", 1, ["identify"]),
        (f"thermofast identify {SPINDLE} --channels T1", 4, ["T1", "T10"]),
        (f"thermofast identify {SPINDLE} --channels T10,T1", 4, ["T10,T1"]),
        (f"thermofast compare --ambient a {SPINDLE}", 3, []),
        (f"thermofast compare {SPINDLE} --ambient a", 4, ["ambient"]),
        (f"thermofast compare {SPINDLE} --time t", 4, ["time_min"]),
        ("thermofast identify --criterion iec62", 3, ["iec62368-1", "iec62368-1-cool"]),
        ("thermofast sweep --filter cr", 3, ["crpf"]),
        ("thermofast identify no_such.csv --channels T", 4, []),
        ("thermofast identify README.md --channels T", 4, []),
    ],
)
def test_a_shell_is_offered_commands_and_the_columns_of_the_file(words, at, offered):
    assert completed(words, at) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_each_shell_is_printed_and_bash_takes_it(tool, tmp_path, shell):
    done = tool("completion", shell)
    assert done.code == 0
    assert "_THERMOFAST_COMPLETE" in done.out
    if shell == "bash" and shutil.which("bash"):
        script = tmp_path / "thermofast"
        script.write_text(done.out)
        subprocess.run(["bash", "-n", str(script)], check=True)
        told = subprocess.run(
            ["bash", "-c", f"source {script}; complete -p thermofast"], capture_output=True, text=True, check=True
        )
        assert "_thermofast_completion" in told.stdout


def test_the_manual_page_has_every_command_and_option(tool, tmp_path):
    done = tool("man")
    assert done.code == 0
    for name in COMMANDS:
        assert f"\n.SS {name} " in done.out
    for option in ("criterion", "switch\\-off\\-at", "skip\\-footer", "save\\-plot"):
        assert f"\\-\\-{option}" in done.out
    if shutil.which("groff"):
        page = tmp_path / "thermofast.1"
        page.write_text(done.out)
        told = subprocess.run(["groff", "-ww", "-man", "-Tutf8", "-z", str(page)], capture_output=True, text=True, check=True)
        assert told.stderr == ""


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_a_terminal_without_lines_gets_plain_ones(encoding):
    told = subprocess.run(
        [sys.executable, "-m", "thermofast", "identify", "sample_runs/spindle.csv", "--until", "60", "--format", "table", "-q"],
        capture_output=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"},
        check=True,
    ).stdout.decode(encoding)
    assert "\\u" not in told
    assert "----------" in told
