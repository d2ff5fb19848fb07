"""Runs the tutorials command by command: ``python -m benchmarks.documents.tutorial`` writes what they print under each of them.

A block is ``$ thermofast ...`` in a console fence and what it prints beneath; the suite runs the same blocks and holds the figures.
docs/tutorial-real.md needs the records of ../shared/data and is left as it is where they are absent.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE, REAL_PAGE = ROOT / "docs" / "tutorial.md", ROOT / "docs" / "tutorial-real.md"
REAL = ROOT.parent / "shared" / "data" / "heatshield"
BLOCK = re.compile(r"```console\n\$ (.+?)\n(.*?)```", re.S)


def run(command: str, folder: Path) -> str:
    """What a command of the tutorial prints, run in `folder`; pictures and models stay there."""
    words = shlex.split(command.replace("\\\n", " "))
    assert words[0] == "thermofast"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "118"}
    done = subprocess.run(
        [sys.executable, "-m", "thermofast", *words[1:]],
        cwd=folder,
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return "\n".join(line.rstrip() for line in done.stdout.strip("\n").splitlines() if line.strip())


def workplace() -> Path:
    """A folder with the sample runs in it, and the measured one of the second page where it is there."""
    folder = Path(tempfile.mkdtemp())
    (folder / "sample_runs").symlink_to(ROOT / "sample_runs")
    if REAL.exists():
        (folder / "real").symlink_to(REAL)
    return folder


def main() -> None:
    """Rewrite the pages with what its commands print today, and the pictures it shows."""
    folder = workplace()
    for path in (PAGE, REAL_PAGE) if REAL.exists() else (PAGE,):
        page = BLOCK.sub(lambda m: f"```console\n$ {m.group(1)}\n{run(m.group(1), folder)}\n```", path.read_text())
        path.write_text(page)
    for picture in folder.glob("*.png"):
        if picture.name != "real.png":  # the record is not ours to draw in our pages
            shutil.copy(picture, ROOT / "docs" / f"tutorial-{picture.name}")


if __name__ == "__main__":
    main()
