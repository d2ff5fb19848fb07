"""Would a test fail if the code were wrong? ``python -m benchmarks.project.mutants [--mutants 600] [--seed 0] [--jobs 2]``.

Places of ``filters``, ``models`` and the readers at which a mutation of cosmic-ray applies are drawn at random. Each is changed in
a copy of the repository, and the tests run that pass its line (by a run of the suite under coverage, kept in build/mutants): those
that pass little besides first, for at most --seconds. Printed: the share that a test noticed, and each mutant that none did. Needs
cosmic-ray (extra ``mutation``).
"""

import argparse
import ast
import hashlib
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as Tree
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

ROOT = Path(__file__).parents[2]
MUTATED = ("filters", "models", "thermofast_cli/reading")
LEFT = shutil.ignore_patterns(".git", ".venv", "build", "dist", "out", ".hypothesis", "*.egg-info", "*cache*", "*.c")


@dataclass(frozen=True)
class Mutant:
    """An operator of cosmic-ray at its n-th place in a file (relative), and the line there."""

    file: str
    operator: str
    occurrence: int
    line: int


@dataclass(frozen=True)
class Suite:
    """Tests by the lines that they pass: (file, line) -> tests; seconds of each test; lines that it passes in all."""

    passing: dict[tuple[str, int], set[str]]
    seconds: dict[str, float]
    reach: dict[str, int]


def copied(folder: Path) -> Path:
    """A copy of the repository that stands before what is installed; the three folders linked as the one package."""
    shutil.copytree(ROOT, folder, ignore=LEFT)
    package = folder / "build" / "package" / "thermofast"
    package.mkdir(parents=True)
    for path in (*(folder / "thermofast_cli").iterdir(), folder / "models", folder / "filters"):
        (package / path.name).symlink_to(path)
    return folder


def environment(folder: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(folder / "build" / "package"), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}


def mapped(kept: Path) -> Suite:
    """The suite run once under coverage; a second call reads what the first kept, while the code is the same."""
    from coverage import CoverageData

    data, report = kept / "coverage", kept / "tests.xml"
    sources = sorted(f for folder in ("tests", "thermofast_cli", *MUTATED[:2]) for f in (ROOT / folder).rglob("*.py"))
    state = hashlib.sha256(b"".join(f.read_bytes() for f in sources)).hexdigest()
    if not (kept / "state").exists() or (kept / "state").read_text() != state:
        with tempfile.TemporaryDirectory() as scratch:
            folder = copied(Path(scratch) / "copy")
            more = ("--cov", "--cov-context=test", "--cov-report=", "--cov-fail-under=0", f"--junitxml={report.resolve()}")
            subprocess.run([sys.executable, "-m", "pytest", "-q", *more], cwd=folder, env=environment(folder), check=False)
            shutil.copy(folder / ".coverage", data)
            (kept / "root").write_text(str(folder.resolve()))
            (kept / "state").write_text(state)
    root = (kept / "root").read_text()
    seconds = {}
    for case in Tree.parse(report).iter("testcase"):
        module = case.get("classname", "").replace(".", "/")
        if case.find("failure") is None and case.find("error") is None and case.find("skipped") is None:
            seconds[f"{module}.py::{case.get('name')}"] = float(case.get("time", 0.0))
    found = CoverageData(str(data))
    found.read()
    passing: dict[tuple[str, int], set[str]] = defaultdict(set)
    reach: dict[str, int] = defaultdict(int)
    for file in found.measured_files():
        if not file.startswith(root):
            continue
        name = str(Path(file).relative_to(root))
        for line, contexts in found.contexts_by_lineno(file).items():
            tests = {c.split("|")[0] for c in contexts} & seconds.keys()
            for test in tests:
                reach[test] += 1
            if name.startswith(MUTATED):
                passing[name, line] |= tests
    return Suite(passing, seconds, reach)


def annotations(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """From where to where (line, column) types are written: to change one is an error at import, or nothing at all."""
    parts = [getattr(node, kind, None) for node in ast.walk(ast.parse(source)) for kind in ("annotation", "returns")]
    return [
        ((part.lineno, part.col_offset), (part.end_lineno or part.lineno, part.end_col_offset or 0))
        for part in parts
        if isinstance(part, ast.expr)
    ]


def places(file: Path) -> Iterator[list[Mutant]]:
    """The mutants at each place of a file."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    source = file.read_text(encoding="utf-8")
    tree, typed, found = get_ast(source), annotations(source), defaultdict(list)
    name = str(file.relative_to(ROOT))
    for operator in operator_names():
        if "Variable" in operator:  # asks which variables
            continue
        rule, count = get_operator(operator)(), 0
        for node in ast_nodes(tree):
            for start, _end in rule.mutation_positions(node):
                if not any(a <= start < b for a, b in typed):
                    found[start].append(Mutant(name, operator, count, start[0]))
                count += 1
    yield from found.values()


def drawn(count: int, seed: int) -> list[Mutant]:
    """Places at random, and one mutant of each."""
    files = sorted(f for folder in MUTATED for f in (ROOT / folder).rglob("*.py"))
    rng = random.Random(seed)
    every = [place for file in files for place in places(file)]
    return [rng.choice(place) for place in rng.sample(every, count)]


def once_loaded(file: str, line: int) -> Iterator[tuple[str, int]]:
    """Where what stands outside functions acts, (file, line): within its function or class, and wherever its name is used.

    A table, a default or a decorator is worked out when its module is loaded, under no test.
    """
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    of_line = [n for n in ast.walk(tree) if isinstance(n, ast.stmt) and n.lineno <= line <= (n.end_lineno or n.lineno)]
    headed = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.decorator_list]
    of_line += [n for n in headed if n.decorator_list[0].lineno <= line < n.lineno]
    names: set[str] = set()
    for node in of_line:
        if isinstance(node, ast.FunctionDef):
            yield from ((file, at) for at in range(node.lineno, (node.end_lineno or node.lineno) + 1))
        elif isinstance(node, ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
    for path in (p for folder in MUTATED for p in (ROOT / folder).rglob("*.py")):
        for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (isinstance(n, ast.Name) and n.id in names) or (isinstance(n, ast.Attribute) and n.attr in names):
                yield str(path.relative_to(ROOT)), n.lineno


def chosen(suite: Suite, mutant: Mutant, most: float) -> list[str]:
    """The tests that pass the line, for so many seconds: those first that pass little besides, and are quick."""
    tests = suite.passing.get((mutant.file, mutant.line), set())
    if not tests:
        tests = set().union(*(suite.passing.get(place, set()) for place in set(once_loaded(mutant.file, mutant.line))))
    ordered = sorted(tests, key=lambda t: (suite.reach[t] * (0.05 + suite.seconds[t]), t))
    kept, total = [], 0.0
    for test in ordered:
        total += suite.seconds[test]
        if kept and total > most:
            break
        kept.append(test)
    return kept


def noticed(mutant: Mutant, suite: Suite, most: float, folders: "SimpleQueue[Path]") -> bool:
    """Whether a test fails, or hangs, on it."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    tests = chosen(suite, mutant, most)
    if not tests:
        return False
    folder = folders.get()
    path = folder / mutant.file
    source = path.read_text(encoding="utf-8")
    try:
        path.write_text(mutate_code(source, get_operator(mutant.operator)(), mutant.occurrence), encoding="utf-8")
        call = [sys.executable, "-m", "pytest", "-q", "-x", "-n0", "-p", "no:cacheprovider", "--hypothesis-seed=0", *tests]
        done = subprocess.run(
            call,
            cwd=folder,
            env=environment(folder),
            timeout=120.0 + 5.0 * most,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        return done.returncode not in (0, 5)
    except subprocess.TimeoutExpired:
        return True
    finally:
        path.write_text(source, encoding="utf-8")
        folders.put(folder)


def main() -> None:
    """Print the score and what survived."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--mutants", type=int, default=600)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--seconds", type=float, default=60.0, help="of tests for a mutant at most")
    given = options.parse_args()
    kept = ROOT / "build" / "mutants"
    kept.mkdir(parents=True, exist_ok=True)
    suite = mapped(kept)
    mutants = drawn(given.mutants, given.seed)
    began, folders, score = time.perf_counter(), SimpleQueue[Any](), 0
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(given.jobs) as pool:
        for k in range(given.jobs):
            folders.put(copied(Path(scratch) / f"copy {k}"))
        work = partial(noticed, suite=suite, most=given.seconds, folders=folders)
        for k, (mutant, found) in enumerate(zip(mutants, pool.map(work, mutants), strict=True), 1):
            score += found
            if not found:
                print(f"{mutant.file}:{mutant.line} {mutant.operator} #{mutant.occurrence}", flush=True)
            if k % 50 == 0:
                print(f"-- {score} of {k} noticed, {time.perf_counter() - began:.0f} s", flush=True)
    print(f"{score} of {len(mutants)} mutants noticed: {100 * score / len(mutants):.1f} % (85)")


if __name__ == "__main__":
    main()
