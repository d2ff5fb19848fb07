"""Builds sdist and wheel into dist/ and tries both as a user gets them; ``make dist`` runs it.

Each is installed into a fresh environment beside a package that has top-level ``filters`` and ``models`` of its own, and identifies
a sample run there, far from the sources.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: What an sdist must hold, and what neither may.
HELD = (
    "LICENSE",
    "README.md",
    "CHANGELOG.md",
    "SECURITY.md",
    "CITATION.cff",
    "Makefile",
    "sample_runs/spindle.csv",
    "tests/conftest.py",
)
STRANGER = """
from setuptools import setup
setup(name="stranger", version="1", packages=["filters", "models"])
"""
COMPILED, SLOW = 'assert ours.COMPILED, "the wheel has no compiled core"', "assert not ours.COMPILED"
TRIAL = """
import filters, models, thermofast as tf
assert filters.OF == models.OF == "stranger", (filters.__file__, models.__file__)
from thermofast import models as ours
assert ours.COMPILED, "the wheel has no compiled core"
record = tf.identify({run!r}, until=60)["T5"]
assert abs(record.steady_state_c - 26.8) < 0.3, record.steady_state_c
print(tf.__version__, "settles at", round(record.steady_state_c, 2))
"""


def run(*words: object, **more: object) -> str:
    """A command that must succeed; what it prints."""
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, check=False, **more)  # type: ignore[call-overload]
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))}\n{done.stdout}\n{done.stderr}")
    return str(done.stdout)


def build(into: Path) -> tuple[Path, Path]:
    """(sdist, wheel); the wheel is built from the sdist."""
    for old in into.glob("thermofast-*"):
        old.unlink()
    run(sys.executable, "-m", "build", "--outdir", into, ROOT)
    (sdist,) = into.glob("*.tar.gz")
    (wheel,) = into.glob("*.whl")
    return sdist, wheel


def check_contents(sdist: Path, wheel: Path) -> None:
    """What is in them, and what is not."""
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    missing = [name for name in HELD if name not in names]
    with zipfile.ZipFile(wheel) as packed:
        inside = packed.namelist()
    tops = {name.partition("/")[0] for name in inside}
    alien = [name for name in tops if name != "thermofast" and not name.endswith((".dist-info", ".libs"))]
    sources = [name for name in inside if name.endswith((".c", ".pyx"))]
    compiled = [name for name in inside if name.endswith((".so", ".pyd"))]
    if missing or alien or sources or len(compiled) < 5 or "thermofast/output/report/page.css" not in inside:
        sys.exit(f"missing in the sdist: {missing}; strange in the wheel: {alien + sources}; compiled: {compiled}")


def try_it(package: Path) -> str:
    """What the trial prints in a fresh environment beside a stranger."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        venv.create(place / "env", with_pip=True)
        python = place / "env" / "bin" / "python"
        for name in ("filters", "models"):
            (place / "stranger" / name).mkdir(parents=True)
            (place / "stranger" / name / "__init__.py").write_text('OF = "stranger"\n')
        (place / "stranger" / "setup.py").write_text(STRANGER)
        run(python, "-m", "pip", "install", "--quiet", "setuptools", place / "stranger", package)
        (place / "trial.py").write_text(TRIAL.format(run=str(ROOT / "sample_runs" / "spindle.csv")))
        told = run(python, place / "trial.py", cwd=place)
        run(place / "env" / "bin" / "thermofast", "identify", ROOT / "sample_runs" / "spindle.csv", "--until", 60, "-q", cwd=place)
        return told.strip()


def without_compiler(sdist: Path) -> str:
    """What identify says where nothing can be compiled: the same, slower."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        venv.create(place / "env", with_pip=True)
        run(place / "env" / "bin" / "python", "-m", "pip", "install", "--quiet", sdist, env=os.environ | {"CC": "false"})
        (place / "trial.py").write_text(TRIAL.format(run=str(ROOT / "sample_runs" / "spindle.csv")).replace(COMPILED, SLOW))
        (place / "filters.py").write_text('OF = "stranger"')
        (place / "models.py").write_text('OF = "stranger"')
        return run(place / "env" / "bin" / "python", place / "trial.py", cwd=place).strip()


def main() -> None:
    """Build, check, try."""
    into = ROOT / "dist"
    into.mkdir(exist_ok=True)
    sdist, wheel = build(into)
    check_contents(sdist, wheel)
    for package in (wheel, sdist):
        print(package.name, try_it(package))
    print(sdist.name, "without a compiler", without_compiler(sdist))


if __name__ == "__main__":
    main()
