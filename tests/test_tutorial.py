"""The tutorial, command by command: what it shows is what the program prints."""

import re
import shlex

import pytest

from benchmarks.documents.tutorial import BLOCK, PAGE, REAL, REAL_PAGE, workplace

NUMBER = re.compile(r"^[-+]?\d+(\.\d+)?$")


def same(shown, printed):
    """Words alike; numbers within 3 %, or the last digits."""
    if shown == printed:
        return True
    if NUMBER.match(shown) and NUMBER.match(printed):
        return float(shown) == pytest.approx(float(printed), rel=0.03, abs=0.003)
    sides = re.split(r"\.\.", shown), re.split(r"\.\.", printed)
    return len(sides[0]) == 2 == len(sides[1]) and all(
        float(a) == pytest.approx(float(b), rel=0.05, abs=0.01) for a, b in zip(*sides, strict=True)
    )


@pytest.mark.parametrize(("path", "commands"), [pytest.param(PAGE, 9, marks=pytest.mark.proof), (REAL_PAGE, 5)])
def test_every_command_prints_what_the_page_shows(path, commands, tool, monkeypatch):
    if path == REAL_PAGE and not REAL.exists():
        pytest.skip(f"{REAL} is not there")
    monkeypatch.chdir(workplace())
    monkeypatch.setenv("COLUMNS", "118")
    blocks = BLOCK.findall(path.read_text())
    assert len(blocks) >= commands
    for command, shown in blocks:
        done = tool(*shlex.split(command.replace("\\\n", " "))[1:])
        assert done.code == 0, done.err
        printed = done.out.split()
        page = shown.split()
        assert len(page) == len(printed), command
        wrong = [(a, b) for a, b in zip(page, printed, strict=True) if not same(a, b)]
        assert not wrong, f"{command}: {wrong[:5]}"
