"""The shape of the house: layers, docstrings, help texts, and documentation that is executed."""

import ast
import importlib
import re
import shlex
import subprocess
import sys
from dataclasses import fields
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from click.testing import CliRunner
from conftest import ROOT

from thermofast.filters import BUILT_IN
from thermofast.main import COMMANDS, cli

#: Folder at the top -> name it is installed under.
FOLDERS = {"models": "thermofast.models", "filters": "thermofast.filters", "thermofast_cli": "thermofast"}
SOURCES = [p for folder in FOLDERS for p in sorted((ROOT / folder).rglob("*.py"))]
#: Catalogues may hold as many files as they have members.
CATALOGUES = ("filters", "models/effects", "thermofast_cli/commands")


def imported(path: Path) -> set[str]:
    """Modules that a file imports, those of its own folder aside."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_the_layers_hold(path):
    folder = path.relative_to(ROOT).parts[0]
    mine = {name for name in imported(path) if name.partition(".")[0] == "thermofast"}
    if folder == "thermofast_cli":
        assert all(name.startswith(("thermofast.models", "thermofast.filters")) for name in mine)
    else:  # neither knows the other, nor the tool
        assert not mine
        assert not {name.partition(".")[0] for name in imported(path)} & {"click", "pandas", "pyarrow", "rich"}


def folders_used(path: Path, top: Path) -> set[str]:
    """Folders below `top` that a file there imports from, for the checker of types alone aside; commands are of the shell."""
    tree, parts = ast.parse(path.read_text()), path.relative_to(top).parts
    for node in [n for n in ast.walk(tree) if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]:
        node.body = []
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = [*parts[: len(parts) - node.level], *(node.module or "").split(".")]
            names = [base[0]] if base[0] else [a.name for a in node.names]
            found |= {name for name in names if (top / name).is_dir()}
    return {"shell" if name == "commands" else name for name in found}


@pytest.mark.parametrize("name", ["thermofast_cli", "models"])
def test_no_two_folders_stand_on_each_other(name):
    """What a folder stands on does not stand on it: a newcomer can read them one after another."""
    top, graph = ROOT / name, {}
    for path in top.rglob("*.py"):
        if path.parent != top:
            folder = path.relative_to(top).parts[0]
            folder = "shell" if folder == "commands" else folder
            graph.setdefault(folder, set()).update(folders_used(path, top) - {folder})
    order = list(TopologicalSorter(graph).static_order())
    for below, above in (
        ("machine", "observing"),
        ("observing", "learning"),
        ("learning", "discovery"),
        ("discovery", "shell"),
        ("core", "noise"),
    ):
        if below in order:
            assert order.index(below) < order.index(above)


def test_a_newcomer_reads_the_tree():
    for folder in (*FOLDERS, "benchmarks"):
        for place in [ROOT / folder, *(p for p in (ROOT / folder).rglob("*") if p.is_dir() and p.name != "__pycache__")]:
            held = [p for p in place.iterdir() if p.suffix in (".py", ".pyx", ".pyi")]
            if held and str(place.relative_to(ROOT)) not in CATALOGUES:
                assert len(held) <= 12, f"{place}: {len(held)} files"


def test_every_benchmark_can_be_imported():
    """Hardly one of them runs here: a name that has gone shows at least."""
    modules = sorted(p.relative_to(ROOT).with_suffix("") for p in (ROOT / "benchmarks").rglob("*.py") if p.stem != "__main__")
    code = "\n".join(f"import {'.'.join(m.parts)}".removesuffix(".__init__") for m in modules)
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr == ""


def test_nothing_strays_at_the_top():
    git = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if git.returncode:
        pytest.skip("no git checkout")
    suffixes = {Path(name).suffix for name in git.stdout.splitlines() if "/" not in name}
    assert suffixes <= {"", ".cff", ".md", ".py", ".toml", ".txt"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_are_small_and_printing_and_opening_have_one_place(path):
    text = path.read_text()
    assert len(text.splitlines()) < 480
    where = str(path.relative_to(ROOT))
    if where != "thermofast_cli/output/screen.py":
        assert not re.search(r"^\s*print\(", text, re.M)
    if where not in ("thermofast_cli/reading/source.py", "thermofast_cli/output/files.py"):
        assert not re.search(r"(?<![\w.])open\(|read_bytes\(|(?<!formatter\.)write_text\(", text)


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_everything_public_is_explained(path):
    tree = ast.parse(path.read_text())
    assert ast.get_docstring(tree)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            short = isinstance(node, ast.FunctionDef) and len(node.body) <= 6
            assert short or ast.get_docstring(node), f"{path}:{node.lineno} {node.name}"


README = (ROOT / "README.md").read_text() if (ROOT / "README.md").exists() else ""


@pytest.mark.parametrize("path", sorted((ROOT / "thermofast_cli" / "commands").glob("*.py")), ids=lambda p: p.stem)
def test_a_command_is_a_thin_adapter(path):
    """Sixty lines with its parameters and help: what it does is the library's."""
    functions = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.FunctionDef)]
    assert max((n.end_lineno - n.lineno + 1 for n in functions), default=0) <= 60


#: Every line of the README's shell blocks can be pasted as it stands.
EXAMPLES = [
    line
    for block in re.findall(r"^```sh\n(.*?)^```", README, re.M | re.S)
    for line in block.strip().splitlines()
    if not line.startswith("make ")
]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_an_example_that_runs(name, tmp_path):
    shown = CliRunner().invoke(cli, [name, "--help"])
    assert shown.exit_code == 0
    example = re.search(r"Example:\s+thermofast (.*)", " ".join(shown.output.split()))
    assert example
    start = " ".join(["thermofast", *example.group(1).split()[:2]])
    if any(start in line for line in EXAMPLES):
        return  # the README's own run of it is tested below
    words = [str(ROOT / w) if w.startswith("sample_runs/") else w for w in shlex.split(example.group(1))]
    done = subprocess.run(
        [sys.executable, "-m", "thermofast", *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
    )
    assert done.returncode == 0, done.stderr


def environment():
    import os

    return {**os.environ, "PYTHONPATH": str(ROOT)}


def test_the_help_of_the_tool_lists_every_command_and_option_name_of_filters():
    shown = " ".join(CliRunner().invoke(cli, ["--help"]).output.split())
    for name, line in COMMANDS.items():
        assert name in shown
        assert line in shown
    help_text = " ".join(CliRunner().invoke(cli, ["identify", "--help"]).output.split())
    for kind in BUILT_IN:
        assert kind.name in help_text


def test_the_readme_has_examples():
    assert len(EXAMPLES) >= 5


TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text()
#: What the tutorial does not run already, and holds the figures of.
OWN = [line for line in EXAMPLES if line.split(" --")[0] not in TUTORIAL]


#: Those that take the longest: what they do has tests of its own, and the figures that they print are not held here.
LONG = (" --next", " --unknown-heat", " --together", " plan ")


def _example(line: str) -> object:
    return pytest.param(line, marks=pytest.mark.proof) if any(word in line for word in LONG) else line


@pytest.mark.parametrize("line", [_example(line) for line in OWN])
def test_an_example_of_the_readme_runs(line, tmp_path, tool, monkeypatch):
    (tmp_path / "sample_runs").symlink_to(ROOT / "sample_runs")
    if "|" not in line and "&&" not in line:  # nothing for a shell: in this process
        monkeypatch.chdir(tmp_path)
        shown = tool(*shlex.split(line)[1:])
        assert shown.code == 0, shown.err
        assert shown.out or "-o" in line
        return
    command = re.sub(r"\bthermofast\b(?!\.)", f"{sys.executable} -m thermofast", line)
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], cwd=tmp_path, capture_output=True, text=True, env=environment(), check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout or "-o" in line


def test_documents_name_files_that_exist():
    for document in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"\]\(([^)#]+)\)", document.read_text()):
            if not target.startswith("http"):
                assert (document.parent / target).exists(), f"{document.name}: {target}"
        for target in re.findall(
            r"`((?:models|filters|thermofast_cli|benchmarks|sample_runs|tests)/[\w./]+)`", document.read_text()
        ):
            assert (ROOT / target).exists(), f"{document.name}: {target}"


def test_the_page_of_thresholds_is_what_the_program_uses():
    from benchmarks.documents.thresholds import PAGE, page

    assert PAGE.read_text() == page()


@pytest.mark.parametrize("module", ["thermofast.models.search.rules", "thermofast.estimation.rules"])
def test_every_rule_decides_something(module):
    """A threshold that the page tells of and nothing reads would be a promise that nobody keeps."""
    sources = [p.read_text() for folder in ("models", "filters", "thermofast_cli") for p in (ROOT / folder).rglob("*.py")]
    read = set(re.findall(r"\b(?:RULES|rules)\.(\w+)", "\n".join(sources)))
    unread = [f.name for f in fields(importlib.import_module(module).RULES) if f.name not in read]
    assert not unread
